//! Settings of a study: one parameter at a time, then combinations. Parameters without effect on the scene are omitted,
//! with the reason.

use super::data::ReferenceKind;
use super::path_sweep;
use super::setting::Setting;
use kiln::bvh::detail::Layout;
use kiln::bvh::{Numerics, Preset};
use kiln::effects::{EFFECTS, Effect, EffectId, Plan, id};
use kiln::film::{ColourPipeline, FilterShape};
use kiln::scene::{DefaultLook, Material, Sampling, Scene, TextureFilter};

/// Maximum number of primitives for brute force.
const MAX_BRUTE_FORCE: usize = 256;

/// Standard errors for adaptive sampling: 5, 2.5 and 1 steps of 8 bits.
const NOISE: [f64; 3] = [0.02, 0.01, 0.004];

/// Samples per pixel for the comparison of filters and of path tracing, enough that noise does not dominate.
pub(super) const FILTER_SAMPLES: u32 = 16;

/// A setting of the sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name of the varied parameter.
    pub parameter: &'static str,
    /// Value of the parameter.
    pub name: String,
    /// Reference for its error.
    pub reference: ReferenceKind,
    /// Whether this is the base setting.
    pub base: bool,
    /// Values of all parameters.
    pub setting: Setting,
}

/// An omitted parameter: its name and the reason.
pub type Omitted = (&'static str, String);

/// Names of all parameters.
pub fn parameters() -> Vec<&'static str> {
    let own = EFFECTS.iter().filter(|effect| effect.is_study_switch).map(Effect::name);
    let first = ["numerics", "bvh", "colour", "glaze bounces"];
    let last = ["texture filter", "samples", "filter", "noise", "together"];
    first.into_iter().chain(own).chain(path_sweep::PARAMETERS).chain(last).collect()
}

/// The settings of the sweep, beginning with `base`, and the omitted parameters. `plan` is the plan of the base.
pub fn sweep(
    (scene, look): (&Scene, &DefaultLook),
    base: &Setting,
    plan: &Plan,
    most: u32,
) -> (Vec<Candidate>, Vec<Omitted>) {
    let first = Candidate {
        parameter: "as given",
        name: describe_sampling(&base.sampling),
        reference: ReferenceKind::Limit,
        base: true,
        setting: base.clone(),
    };
    let mut list = SweepBuilder { base, candidates: vec![first], omitted: Vec::new() };
    list.numerics();
    list.structures(scene);
    list.colour();
    list.glaze(scene, plan);
    list.effects(plan);
    list.textures(plan);
    list.paths(path_sweep::has_extended_light(scene, look), plan, most);
    list.samples(most);
    list.together(most);
    (list.candidates, list.omitted)
}

/// Description of a sampling.
fn describe_sampling(sampling: &Sampling) -> String {
    match (sampling.is_wanted(), sampling.noise) {
        (false, _) => "1 sample".into(),
        (_, Some(noise)) => format!("noise {noise}"),
        (_, None) => format!("{} samples", sampling.max_samples()),
    }
}

/// The sweep so far.
pub(super) struct SweepBuilder<'a> {
    pub(super) base: &'a Setting,
    candidates: Vec<Candidate>,
    pub(super) omitted: Vec<Omitted>,
}

impl SweepBuilder<'_> {
    pub(super) fn add(
        &mut self,
        parameter: &'static str,
        name: impl Into<String>,
        reference: ReferenceKind,
        setting: Setting,
    ) {
        self.candidates.push(Candidate { parameter, name: name.into(), reference, base: false, setting });
    }

    /// Adds the base with a change that leaves the sample points as they are.
    fn vary(&mut self, parameter: &'static str, name: impl Into<String>, change: impl FnOnce(&mut Setting)) {
        let mut setting = self.base.clone();
        change(&mut setting);
        self.add(parameter, name, ReferenceKind::SameSamples, setting);
    }

    /// Whether an effect is on; if it is not, `parameter` is omitted with the reason.
    fn has(&mut self, parameter: &'static str, plan: &Plan, effect: EffectId) -> bool {
        let why = reason_off(plan, effect);
        self.omitted.extend(why.clone().map(|why| (parameter, why)));
        why.is_none()
    }

    fn numerics(&mut self) {
        for numerics in Numerics::ALL {
            self.vary("numerics", numerics.name(), |setting| setting.numerics = numerics);
        }
    }

    fn structures(&mut self, scene: &Scene) {
        for preset in Preset::ALL {
            self.vary("bvh", preset.name(), |setting| setting.structure = Layout::Wide(preset));
        }
        let preset = self.base.structure.preset().unwrap_or_default();
        let mut layouts = vec![("layout bvh8-portable", Layout::Portable(preset))];
        if scene.primitive_count() <= MAX_BRUTE_FORCE {
            layouts.push(("layout brute-force", Layout::BruteForce));
        }
        for (name, structure) in layouts {
            self.vary("bvh", name, |setting| setting.structure = structure);
        }
    }

    fn colour(&mut self) {
        if self.base.pipeline == ColourPipeline::Linear {
            let why = "the picture adds up light linearly; `display` and `u8` are other pictures, not approximations of it";
            self.omitted.push(("colour", why.into()));
            return;
        }
        for pipeline in [ColourPipeline::U8, ColourPipeline::Display] {
            self.vary("colour", pipeline.name(), |setting| setting.pipeline = pipeline);
        }
    }

    fn glaze(&mut self, scene: &Scene, plan: &Plan) {
        if !self.has("glaze bounces", plan, id::GLAZE) {
            return;
        }
        let most = most_bounces(scene);
        for bounces in [0].into_iter().chain(powers_of_two()).take_while(|bounces| *bounces < most) {
            self.vary("glaze bounces", bounces_named(bounces), |setting| setting.bounces = Some(bounces));
        }
        self.vary("glaze bounces", bounces_named(most), |_| ());
    }

    fn effects(&mut self, plan: &Plan) {
        for effect in EFFECTS.iter().filter(|effect| effect.is_study_switch) {
            if self.has(effect.name(), plan, effect.id) {
                self.vary(effect.name(), "off", |setting| setting.without.push(effect.id));
                self.vary(effect.name(), "on", |_| ());
            }
        }
    }

    fn textures(&mut self, plan: &Plan) {
        if self.has("texture filter", plan, id::TEXTURES) {
            for filter in TextureFilter::ALL {
                self.vary("texture filter", filter.name(), |setting| setting.textures = Some(filter));
            }
        }
    }

    fn samples(&mut self, most: u32) {
        for samples in powers_of_two().take_while(|&samples| samples <= most) {
            let setting = self.sampled(samples);
            self.add("samples", samples_named(samples), ReferenceKind::Limit, setting);
        }
        let count = FILTER_SAMPLES.min(most);
        for filter in FilterShape::ALL {
            let mut setting = self.sampled(count);
            (setting.sampling.filter, setting.sampling.filter_radius) = (Some(filter), None);
            let name = format!("{} ({})", filter.name(), samples_named(count));
            self.add("filter", name, ReferenceKind::Limit, setting);
        }
        if most <= FILTER_SAMPLES {
            let why =
                format!("at most {most} samples a pixel are looked at; it needs more than {FILTER_SAMPLES}");
            self.omitted.push(("noise", why));
            return;
        }
        for noise in NOISE {
            let mut setting = self.sampled(most);
            setting.sampling.noise = Some(noise);
            self.add("noise", format!("{noise} (up to {most} samples)"), ReferenceKind::Limit, setting);
        }
    }

    /// Combinations of sample counts with the other tiers.
    fn together(&mut self, most: u32) {
        for samples in [4, 16].into_iter().filter(|&samples| samples <= most) {
            let sampled = self.sampled(samples);
            for numerics in Numerics::ALL.into_iter().filter(|&numerics| numerics != self.base.numerics) {
                let name = format!("{}, {}", numerics.name(), samples_named(samples));
                self.add("together", name, ReferenceKind::Limit, Setting { numerics, ..sampled.clone() });
            }
        }
    }

    /// The base with `samples` samples per pixel.
    pub(super) fn sampled(&self, samples: u32) -> Setting {
        let mut setting = self.base.clone();
        (setting.sampling.samples, setting.sampling.noise) = (Some(samples), None);
        setting
    }
}

fn powers_of_two() -> impl Iterator<Item = u32> {
    std::iter::successors(Some(1u32), |power| power.checked_mul(2))
}

pub(super) fn samples_named(samples: u32) -> String {
    if samples == 1 { "1 sample".into() } else { format!("{samples} samples") }
}

pub(super) fn bounces_named(bounces: u32) -> String {
    if bounces == 1 { "1 bounce".into() } else { format!("{bounces} bounces") }
}

/// The reason why an effect is off; `None` if it is on.
pub(super) fn reason_off(plan: &Plan, effect: EffectId) -> Option<String> {
    let decision = plan.decisions.iter().find(|decision| decision.effect == effect);
    decision.map_or(Some("this kiln was built without it".into()), |d| (!d.on).then(|| d.why.clone()))
}

/// Maximum number of glaze bounces of the materials in use.
fn most_bounces(scene: &Scene) -> u32 {
    let materials = scene.objects.iter().map(|object| &scene.materials[object.material.0 as usize]);
    let bounces = materials.filter_map(|material| match material {
        Material::Phong(phong) => phong.glaze.map(|glaze| glaze.bounces),
        Material::MetallicRoughness(_) => None,
    });
    bounces.max().unwrap_or(0)
}
