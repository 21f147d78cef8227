//! Settings: the values of all parameters that a study varies.

use kiln::bvh::Numerics;
use kiln::bvh::detail::Layout;
use kiln::effects::{EffectId, LightTechnique, PathSettings, PlanSettings, id};
use kiln::film::ColourPipeline;
use kiln::scene::{Material, Sampling, Scene, TextureFilter, Transport};

/// Values of all varied parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Numerics tier.
    pub numerics: Numerics,
    /// Acceleration structure.
    pub structure: Layout,
    /// Colour pipeline.
    pub pipeline: ColourPipeline,
    /// Pixel sampling.
    pub sampling: Sampling,
    /// Maximum number of glaze bounces; `None` for that of the scene.
    pub bounces: Option<u32>,
    /// Texture filter; `None` for those of the scene.
    pub textures: Option<TextureFilter>,
    /// Effects turned off.
    pub without: Vec<EffectId>,
    /// Path tracing.
    pub path: PathVariation,
}

/// Values of the parameters of path tracing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathVariation {
    /// Maximum number of bounces; `None` for that of the picture.
    pub depth: Option<u32>,
    /// Largest radiance that a path adds by indirect light; none if `None`.
    pub clamp: Option<f64>,
    /// Which samples of light count.
    #[doc(hidden)]
    pub technique: LightTechnique,
    /// Roulette and light samples.
    pub estimator: PathSettings,
    /// Intensity of the ambient light, for local shading with ambient occlusion instead of paths.
    pub ambient: Option<f64>,
}

impl PathVariation {
    /// The values that are asked for.
    pub fn of(asked: &PlanSettings) -> Self {
        let &PlanSettings { clamp, light_technique: technique, path: estimator, .. } = asked;
        PathVariation { depth: None, clamp, technique, estimator, ambient: None }
    }

    /// Sets these values.
    fn apply(&self, plan_settings: &mut PlanSettings) {
        let &PathVariation { depth, clamp, technique, estimator, ambient } = self;
        (plan_settings.clamp, plan_settings.light_technique, plan_settings.path) =
            (clamp, technique, estimator);
        plan_settings.with.extend(depth.map(|depth| id::PATH.with_value(depth)));
        if ambient.is_some() {
            plan_settings.transport = Some(Transport::Whitted);
            plan_settings.without.retain(|name| name != id::AMBIENT_OCCLUSION.name());
            plan_settings.with.push(id::AMBIENT_OCCLUSION.name().to_owned());
        }
    }

    /// Options that change the values of the base to these; `None` if there are none that do.
    fn options(&self, base: &PathVariation) -> Option<Vec<String>> {
        let like_base = PathVariation { depth: self.depth, clamp: self.clamp, ..*base };
        if *self != like_base || self.clamp.is_none() && base.clamp.is_some() {
            return None;
        }
        let depth = self.depth.map(|depth| format!("--depth {depth}"));
        let clamp = self.clamp.filter(|_| self.clamp != base.clamp).map(|clamp| format!("--clamp {clamp}"));
        Some(depth.into_iter().chain(clamp).collect())
    }
}

impl Setting {
    /// Whether both settings have the same prepared scene.
    pub fn shares_world(&self, other: &Setting) -> bool {
        let key = |setting: &Setting| {
            let Setting { numerics, structure, pipeline, bounces, path, .. } = setting;
            (*numerics, *structure, *pipeline, *bounces, path.ambient)
        };
        key(self) == key(other)
    }

    /// The twin: the base in `exact` at the sample points of this setting, without rounding to 8 bits in every step.
    pub fn twin(&self, base: &Setting) -> Setting {
        Setting { numerics: Numerics::Exact, sampling: self.sampling, ..base.clone() }.unrounded()
    }

    /// The setting with a pipeline that rounds only the final picture.
    pub fn unrounded(mut self) -> Setting {
        if self.pipeline == ColourPipeline::U8 {
            self.pipeline = ColourPipeline::Display;
        }
        self
    }

    /// Whether an effect is turned off that the base has.
    pub fn has_effect_off(&self, base: &Setting) -> bool {
        self.without.len() > base.without.len() || self.bounces == Some(0)
    }

    /// The scene with the glaze bounces of this setting.
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

    /// `asked` with the effects and the sampling of this setting.
    pub fn plan_settings(&self, asked: &PlanSettings) -> PlanSettings {
        let mut plan_settings = PlanSettings { sampling: self.sampling, ..asked.clone() };
        for effect in &self.without {
            plan_settings.with.retain(|typed| typed.split('=').next() != Some(effect.name()));
            plan_settings.without.push(effect.name().to_owned());
        }
        self.path.apply(&mut plan_settings);
        if let Some(filter) = self.textures {
            plan_settings.with.push(id::TEXTURES.with_value(filter.name()));
        }
        plan_settings
    }

    /// Options of `kiln render` that give exactly this picture, in addition to those of `base` and `asked`. An option
    /// replaces a given one of the same name. `None` if there are no such options.
    pub fn options(&self, base: &Setting, asked: &PlanSettings) -> Option<String> {
        let mut options: Vec<String> = Vec::new();
        if self.numerics != base.numerics {
            options.push(format!("--numerics {}", self.numerics.name()));
        }
        if self.pipeline != base.pipeline {
            options.push(format!("--colour {}", self.pipeline.name()));
        }
        if self.structure != base.structure {
            // There is no option for layouts.
            let preset = self.structure.preset().filter(|&preset| self.structure == Layout::Wide(preset))?;
            options.push(format!("--bvh {}", preset.name()));
        }
        options.extend(self.path.options(&base.path)?);
        options.extend(self.sampling_options(&base.sampling)?);
        options
            .extend(self.textures.map(|filter| format!("--with {}", id::TEXTURES.with_value(filter.name()))));
        let mut without = self.without.clone();
        match self.bounces {
            None => {}
            Some(0) => without.push(id::GLAZE),
            // The option cannot be given twice.
            Some(_) if asked.scene.get(id::GLAZE.name()).is_some() => return None,
            Some(most) => options.push(format!("--with {}", id::GLAZE.with_value(most))),
        }
        for effect in without {
            // `--with` and `--without` of one effect exclude each other.
            if asked.with.iter().any(|typed| typed.split('=').next() == Some(effect.name())) {
                return None;
            }
            options.push(format!("--without {effect}"));
        }
        Some(options.join(" "))
    }

    /// Options that change the sampling of the base to this one; `None` if an option of the base would have to be
    /// removed.
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
        // With options of the base, one sample is not at the pixel centre.
        let given = Sampling { samples: own.samples.or(base.samples), ..*base };
        let is_centred = !own.is_wanted();
        (is_centred != given.is_wanted() || own.is_wanted()).then_some(options)
    }
}
