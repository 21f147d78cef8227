//! A setting: everything that a study varies of how a scene is rendered.

use crate::bvh::Structure;
use crate::effects::Choices;
use crate::film::ColourPipeline;
use crate::geometry::Numerics;
use crate::scene::{Material, Sampling, Scene, TextureFilter};

/// How a scene is rendered.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// How exactly it is decided what a ray hits.
    pub numerics: Numerics,
    /// How rays find it.
    pub structure: Structure,
    /// The numbers light is added up in.
    pub pipeline: ColourPipeline,
    /// How pixels are sampled.
    pub sampling: Sampling,
    /// The most bounces of any glaze; `None` for as many as the scene says.
    pub bounces: Option<u32>,
    /// The filter of all pictures; `None` for as the scene says.
    pub textures: Option<TextureFilter>,
    /// Effects to do without.
    pub without: Vec<&'static str>,
}

/// Settings that agree in this can share a prepared scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldKey {
    numerics: Numerics,
    structure: Structure,
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
        scene.sampling = self.sampling;
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
        let mut choices = asked.clone();
        for name in &self.without {
            choices.with.retain(|typed| typed.split('=').next() != Some(name));
            choices.without.push((*name).to_owned());
        }
        if let Some(filter) = self.textures {
            choices.with.push(format!("textures={}", filter.name()));
        }
        choices
    }

    /// The options of `kiln render` that make of the base what this is.
    pub fn options(&self, base: &Setting) -> String {
        let mut options: Vec<String> = Vec::new();
        let mut add = |differs: bool, option: String| {
            if differs {
                options.push(option);
            }
        };
        add(self.numerics != base.numerics, format!("--numerics {}", self.numerics.name()));
        add(self.pipeline != base.pipeline, format!("--colour {}", self.pipeline.name()));
        if let Some(preset) = self.structure.preset() {
            add(self.structure.preset() != base.structure.preset(), format!("--bvh {}", preset.name()));
        }
        let (own, theirs) = (&self.sampling, &base.sampling);
        if let Some(samples) = own.samples {
            add(own.samples != theirs.samples, format!("--samples {samples}"));
        }
        if let Some(filter) = own.filter {
            add(own.filter != theirs.filter, format!("--filter {}", filter.name()));
        }
        if let Some(noise) = own.noise {
            add(own.noise != theirs.noise, format!("--noise {noise}"));
        }
        if let Some(filter) = self.textures {
            add(true, format!("--with textures={}", filter.name()));
        }
        self.without.iter().for_each(|name| add(true, format!("--without {name}")));
        if self.bounces == Some(0) {
            add(true, "--without glaze".into());
        }
        options.join(" ")
    }
}
