//! Settings of path tracing: bounces, roulette, clamp, techniques of direct light, substitutes of indirect light.
//! Varied only where the plan traces paths.

use super::data::ReferenceKind;
use super::setting::{PathVariation, Setting};
use super::sweep::{FILTER_SAMPLES, SweepBuilder, bounces_named, reason_off, samples_named};
use kiln::effects::{LightTechnique, PathSettings, Plan, id};
use kiln::scene::{DefaultLook, Scene};

/// The bounces of the limit, unless the picture has more: of the light that white paint (albedo 0.9) reflects, a
/// millionth is left. Russian roulette ends most paths earlier.
const LIMIT_BOUNCES: u32 = 128;

/// The bounces in the comparison of Russian roulette, so many that it matters.
const ROULETTE_BOUNCES: u32 = 32;

/// Samples per pixel in combinations: a quarter of those of the parameters.
const FEW_SAMPLES: u32 = 4;

/// Clamps of indirect light, as radiance; 1 is white.
const CLAMPS: [f64; 3] = [1.0, 4.0, 16.0];

const BOUNCES: &str = "path bounces";
const INDIRECT: &str = "indirect light";
const ROULETTE: &str = "roulette";
const CLAMP: &str = "clamp";
pub(super) const TECHNIQUE: &str = "light technique";
const LIGHT_SAMPLES: &str = "light samples";

/// Name of the setting of local shading with ambient occlusion.
const AMBIENT: &str = "ambient occlusion";

/// Names of the parameters.
pub(super) const PARAMETERS: [&str; 6] = [BOUNCES, INDIRECT, ROULETTE, CLAMP, TECHNIQUE, LIGHT_SAMPLES];

/// Whether paths are traced.
pub(super) fn traces_paths(plan: &Plan) -> bool {
    reason_off(plan, id::PATH).is_none()
}

/// The most bounces of a path.
fn bounces_of(plan: &Plan) -> u32 {
    let decision = plan.decisions.iter().find(|decision| decision.effect == id::PATH);
    let value = decision.and_then(|decision| decision.value.as_ref()?.parse().ok());
    value.unwrap_or(PathSettings::DEFAULT_DEPTH)
}

/// The setting that the limit is rendered in, but for its samples: for paths without a clamp, which is biased, and with
/// more bounces than any of the sweep. Otherwise the base.
pub(super) fn reference(base: &Setting, plan: &Plan) -> Setting {
    if !traces_paths(plan) {
        return base.clone();
    }
    let depth = Some(bounces_of(plan).max(LIMIT_BOUNCES));
    Setting { path: PathVariation { depth, ..PathVariation::default() }, ..base.clone() }
}

/// Whether a light can be found by BSDF samples and by light samples.
pub(super) fn has_extended_light(scene: &Scene, look: &DefaultLook) -> bool {
    let has_extent = scene.lights.iter().any(|light| light.kind.has_extent());
    look.environment.is_some() || scene.emits() || has_extent
}

/// Name of a technique.
pub(super) fn technique_named(technique: LightTechnique) -> &'static str {
    match technique {
        LightTechnique::BsdfSamples => "BSDF samples",
        LightTechnique::LightSamples => "samples of lights",
        LightTechnique::Both => "both (MIS)",
    }
}

impl SweepBuilder<'_> {
    /// Adds all settings of path tracing, or the reason why there are none.
    pub(super) fn paths(&mut self, has_extended_light: bool, plan: &Plan, most: u32) {
        if let Some(why) = reason_off(plan, id::PATH) {
            self.omitted.extend(PARAMETERS.map(|parameter| (parameter, why.clone())));
            return;
        }
        let (own, samples) = (self.base.path, FILTER_SAMPLES.min(most));
        let depth = bounces_of(plan);
        self.bounces(depth, samples);
        self.indirect(samples);
        let deep = depth.max(ROULETTE_BOUNCES);
        for (name, roulette_from) in [("off", u32::MAX), ("after 3 bounces", 3), ("after 1 bounce", 1)] {
            let estimator = PathSettings { roulette_from, ..own.estimator };
            let name = format!("{name}, at most {deep}");
            self.path(ROULETTE, &name, samples, PathVariation { estimator, depth: Some(deep), ..own });
        }
        for clamp in CLAMPS {
            self.path(CLAMP, &clamp.to_string(), samples, PathVariation { clamp: Some(clamp), ..own });
        }
        self.path(CLAMP, "none", samples, PathVariation { clamp: None, ..own });
        self.techniques(has_extended_light, samples);
        for light_samples in [1, 2, 4, 8] {
            let estimator = PathSettings { light_samples, ..own.estimator };
            let name = format!("{light_samples} a surface");
            self.path(LIGHT_SAMPLES, &name, samples, PathVariation { estimator, ..own });
        }
        self.few_samples(samples);
    }

    /// Adds a setting of path tracing.
    fn path(&mut self, parameter: &'static str, name: &str, samples: u32, path: PathVariation) {
        let setting = Setting { path, ..self.sampled(samples) };
        let name = format!("{name} ({})", samples_named(samples));
        self.add(parameter, name, ReferenceKind::Limit, setting);
    }

    /// Bounces: 0, powers of two to 16, and those of the picture.
    fn bounces(&mut self, own: u32, samples: u32) {
        let mut depths = vec![0, 1, 2, 4, 8, 16, own];
        depths.sort_unstable();
        depths.dedup();
        for depth in depths {
            let path = PathVariation { depth: Some(depth), ..self.base.path };
            self.path(BOUNCES, &bounces_named(depth), samples, path);
        }
    }

    /// Indirect light by paths, by the ambient term with ambient occlusion, and left out.
    fn indirect(&mut self, samples: u32) {
        let own = self.base.path;
        // The intensity is fitted once there is a limit.
        self.path(INDIRECT, AMBIENT, samples, PathVariation { ambient: Some(1.0), ..own });
        self.path(INDIRECT, "none", samples, PathVariation { depth: Some(1), ..own });
        self.path(INDIRECT, "paths", samples, own);
    }

    fn techniques(&mut self, has_extended_light: bool, samples: u32) {
        if !has_extended_light {
            let why = "no environment and no light with a size: BSDF samples find none";
            self.omitted.push((TECHNIQUE, why.into()));
            return;
        }
        for technique in [LightTechnique::BsdfSamples, LightTechnique::LightSamples, LightTechnique::Both] {
            let path = PathVariation { technique, ..self.base.path };
            self.path(TECHNIQUE, technique_named(technique), samples, path);
        }
    }

    /// Combinations with fewer samples: less noise a sample against less time a sample.
    fn few_samples(&mut self, samples: u32) {
        let own = self.base.path;
        if samples <= FEW_SAMPLES {
            return;
        }
        for depth in [1, 2, 4] {
            let path = PathVariation { depth: Some(depth), ..own };
            self.path("together", &bounces_named(depth), FEW_SAMPLES, path);
        }
        let path = PathVariation { clamp: Some(CLAMPS[1]), ..own };
        self.path("together", &format!("clamp {}", CLAMPS[1]), FEW_SAMPLES, path);
        for light_samples in [2, 4] {
            let estimator = PathSettings { light_samples, ..own.estimator };
            let name = format!("{light_samples} light samples");
            self.path("together", &name, FEW_SAMPLES, PathVariation { estimator, ..own });
        }
        self.path("together", AMBIENT, FEW_SAMPLES, PathVariation { ambient: Some(1.0), ..own });
    }
}
