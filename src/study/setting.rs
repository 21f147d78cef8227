//! A setting: everything that a study varies of how a scene is rendered.

use crate::bvh::Layout;
use crate::effects::{id, Choices, EffectId};
use crate::film::ColourPipeline;
use crate::geometry::Numerics;
use crate::scene::{Material, Sampling, Scene, TextureFilter};

/// How a scene is rendered.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// How exactly it is decided what a ray hits.
    pub numerics: Numerics,
    /// How rays find it.
    pub structure: Layout,
    /// The numbers light is added up in.
    pub pipeline: ColourPipeline,
    /// How pixels are sampled.
    pub sampling: Sampling,
    /// The most bounces of any glaze; `None` for as many as the scene says.
    pub bounces: Option<u32>,
    /// The filter of all pictures; `None` for as the scene says.
    pub textures: Option<TextureFilter>,
    /// Effects to do without.
    pub without: Vec<EffectId>,
}

/// Settings that agree in this can share a prepared scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldKey {
    numerics: Numerics,
    structure: Layout,
    pipeline: ColourPipeline,
    bounces: Option<u32>,
}

impl Setting {
    /// What of it is decided when the scene is prepared.
    pub fn world(&self) -> WorldKey {
        let &Setting { numerics, structure, pipeline, bounces, .. } = self;
        WorldKey { numerics, structure, pipeline, bounces }
    }

    /// The picture that this one is held against: as the base has it, in `exact`, at the same sample points. Rounding to 8 bits at
    /// every step is itself an error, so its twin does not.
    pub fn twin(&self, base: &Setting) -> Setting {
        Setting { numerics: Numerics::Exact, sampling: self.sampling, ..base.clone() }.unrounded()
    }

    /// The same in a pipeline that does not round on the way.
    pub fn unrounded(mut self) -> Setting {
        if self.pipeline == ColourPipeline::U8 {
            self.pipeline = ColourPipeline::Display;
        }
        self
    }

    /// The scene with what the setting says of its contents.
    pub fn scene(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        if let Some(most) = self.bounces {
            let glazes = scene.materials.iter_mut().filter_map(|material| match material {
                Material::Phong(phong) => phong.glaze.as_mut(),
                Material::MetallicRoughness(_) => None,
            });
            glazes.for_each(|glaze| glaze.bounces = glaze.bounces.min(most));
        }
        scene
    }

    /// What is asked of effects, over what was asked before.
    pub fn choices(&self, asked: &Choices) -> Choices {
        let mut choices = Choices { sampling: self.sampling, ..asked.clone() };
        for effect in &self.without {
            choices.with.retain(|typed| typed.split('=').next() != Some(effect.name()));
            choices.without.push(effect.name().to_owned());
        }
        if let Some(filter) = self.textures {
            choices.with.push(id::TEXTURES.with_value(filter.name()));
        }
        choices
    }

    /// The options of `kiln render` that make this picture, to the bit, given beside those that `base` and `asked` come from; one
    /// of the same name takes the place of one that was given. `None` where there are none that do.
    pub fn options(&self, base: &Setting, asked: &Choices) -> Option<String> {
        let mut options: Vec<String> = Vec::new();
        if self.numerics != base.numerics {
            options.push(format!("--numerics {}", self.numerics.name()));
        }
        if self.pipeline != base.pipeline {
            options.push(format!("--colour {}", self.pipeline.name()));
        }
        if self.structure != base.structure {
            // Layouts are not for users to choose.
            let preset = self.structure.preset().filter(|&preset| self.structure == Layout::Wide(preset))?;
            options.push(format!("--bvh {}", preset.name()));
        }
        options.extend(self.sampling_options(&base.sampling)?);
        options
            .extend(self.textures.map(|filter| format!("--with {}", id::TEXTURES.with_value(filter.name()))));
        let mut without = self.without.clone();
        match self.bounces {
            None => {}
            Some(0) => without.push(id::GLAZE),
            // Said once already, in a value of its own, it cannot be said again.
            Some(_) if asked.scene.get(id::GLAZE.name()).is_some() => return None,
            Some(most) => options.push(format!("--with {}", id::GLAZE.with_value(most))),
        }
        for effect in without {
            // Asked for and not: one of the two would have to go.
            if asked.with.iter().any(|typed| typed.split('=').next() == Some(effect.name())) {
                return None;
            }
            options.push(format!("--without {effect}"));
        }
        Some(options.join(" "))
    }

    /// The options that make this sampling of that of the base. Options cannot take back that something was said.
    fn sampling_options(&self, base: &Sampling) -> Option<Vec<String>> {
        let own = &self.sampling;
        let mut options = Vec::new();
        if own == base {
            return Some(options);
        }
        if let Some(samples) = own.samples.filter(|_| own.samples != base.samples) {
            options.push(format!("--samples {samples}"));
        }
        if let Some(filter) = own.filter.filter(|_| own.filter != base.filter) {
            options.push(format!("--filter {}", filter.name()));
        }
        let radius = own.shape_and_radius().1;
        if own.filter_radius != base.filter_radius {
            options.push(format!("--filter-radius {radius}"));
        }
        match own.noise {
            Some(noise) if own.noise != base.noise => options.push(format!("--noise {noise}")),
            None if base.noise.is_some() => options.push(format!("--without {}", id::ADAPTIVE)),
            _ => {}
        }
        // What was said is said: one sample then is not that of the pixel's centre.
        let said = Sampling { samples: own.samples.or(base.samples), ..*base };
        let is_centred = !own.is_wanted();
        (is_centred != said.is_wanted() || own.is_wanted()).then_some(options)
    }
}
