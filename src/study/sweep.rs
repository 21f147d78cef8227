//! Which settings a study looks at: one knob at a time, then those together that a user would trade for each other. Knobs with
//! nothing to do in the scene are left out, with the reason.

use super::data::Judge;
use super::setting::Setting;
use crate::bvh::{Layout, Preset};
use crate::effects::{id, Effect, EffectId, Plan, EFFECTS};
use crate::film::{ColourPipeline, FilterShape};
use crate::geometry::Numerics;
use crate::scene::{Material, Sampling, Scene, TextureFilter};

/// Brute force tests every primitive for every ray: beyond this many nobody would wait.
const FEW: usize = 256;

/// Standard errors that pixels are sampled to: five steps of 8 bits, two and a half, and one.
const NOISE: [f64; 3] = [0.02, 0.01, 0.004];

/// Samples at which filters are compared: so many that their noise is not all there is to see.
const FILTERED: u32 = 16;

/// A setting that is looked at, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// What was varied.
    pub knob: &'static str,
    /// What it was set to.
    pub name: String,
    /// What its errors are measured against.
    pub judge: Judge,
    /// Whether it is the picture that was asked for.
    pub base: bool,
    /// How the picture is made.
    pub setting: Setting,
}

/// A knob that is left out: its name, and why.
pub type Absent = (&'static str, String);

/// The names of all knobs.
pub fn knobs() -> Vec<&'static str> {
    let own = EFFECTS.iter().filter(|effect| effect.is_study_switch).map(Effect::name);
    let first = ["numerics", "bvh", "colour", "glaze bounces"];
    first.into_iter().chain(own).chain(["picture filter", "samples", "filter", "noise", "together"]).collect()
}

/// The settings to look at around `base`, which comes first, and the knobs that are left out. `plan` is that of the base.
pub fn sweep(scene: &Scene, base: &Setting, plan: &Plan, most: u32) -> (Vec<Candidate>, Vec<Absent>) {
    let first = Candidate {
        knob: "as asked for",
        name: described(&base.sampling),
        judge: Judge::Limit,
        base: true,
        setting: base.clone(),
    };
    let mut list = List { base, found: vec![first], absent: Vec::new() };
    list.numerics();
    list.structures(scene);
    list.colour();
    list.glaze(scene, plan);
    list.effects(plan);
    list.textures(plan);
    list.samples(most);
    list.together(most);
    (list.found, list.absent)
}

/// How pixels are sampled, in words.
fn described(sampling: &Sampling) -> String {
    let samples = sampling.max_samples();
    match (sampling.is_wanted(), sampling.noise) {
        (false, _) => "1 sample".into(),
        (_, Some(noise)) => format!("noise {noise}"),
        (_, None) => format!("{samples} samples"),
    }
}

struct List<'a> {
    base: &'a Setting,
    found: Vec<Candidate>,
    absent: Vec<Absent>,
}

impl List<'_> {
    fn add(&mut self, knob: &'static str, name: impl Into<String>, judge: Judge, setting: Setting) {
        self.found.push(Candidate { knob, name: name.into(), judge, base: false, setting });
    }

    fn numerics(&mut self) {
        for numerics in Numerics::ALL {
            self.add("numerics", numerics.name(), Judge::Twin, Setting { numerics, ..self.base.clone() });
        }
    }

    fn structures(&mut self, scene: &Scene) {
        for preset in Preset::ALL {
            let structure = Layout::Wide(preset);
            self.add("bvh", preset.name(), Judge::Twin, Setting { structure, ..self.base.clone() });
        }
        let preset = self.base.structure.preset().unwrap_or_default();
        let mut layouts =
            vec![("layout bvh8-portable", Layout::Portable(preset)), ("layout bvh2", Layout::Bvh2(preset))];
        if scene.primitive_count() <= FEW {
            layouts.push(("layout brute-force", Layout::BruteForce));
        }
        for (name, structure) in layouts {
            self.add("bvh", name, Judge::Twin, Setting { structure, ..self.base.clone() });
        }
    }

    fn colour(&mut self) {
        if self.base.pipeline == ColourPipeline::Linear {
            let why = "the picture adds up light linearly; `display` and `u8` are other pictures, not approximations of it";
            self.absent.push(("colour", why.into()));
            return;
        }
        for pipeline in [ColourPipeline::U8, ColourPipeline::Display] {
            self.add("colour", pipeline.name(), Judge::Twin, Setting { pipeline, ..self.base.clone() });
        }
    }

    fn glaze(&mut self, scene: &Scene, plan: &Plan) {
        if let Some(why) = off(plan, id::GLAZE) {
            self.absent.push(("glaze bounces", why));
            return;
        }
        let most = most_bounces(scene);
        let mut bounces = 0;
        while bounces < most {
            let setting = Setting { bounces: Some(bounces), ..self.base.clone() };
            self.add("glaze bounces", bounces_named(bounces), Judge::Twin, setting);
            bounces = (2 * bounces).max(1);
        }
        self.add("glaze bounces", bounces_named(most), Judge::Twin, self.base.clone());
    }

    fn effects(&mut self, plan: &Plan) {
        for effect in EFFECTS.iter().filter(|effect| effect.is_study_switch) {
            if let Some(why) = off(plan, effect.id) {
                self.absent.push((effect.name(), why));
                continue;
            }
            let without = [self.base.without.as_slice(), &[effect.id]].concat();
            self.add(effect.name(), "off", Judge::Twin, Setting { without, ..self.base.clone() });
            self.add(effect.name(), "on", Judge::Twin, self.base.clone());
        }
    }

    fn textures(&mut self, plan: &Plan) {
        if let Some(why) = off(plan, id::TEXTURES) {
            self.absent.push(("picture filter", why));
            return;
        }
        for filter in TextureFilter::ALL {
            let setting = Setting { textures: Some(filter), ..self.base.clone() };
            self.add("picture filter", filter.name(), Judge::Twin, setting);
        }
    }

    fn samples(&mut self, most: u32) {
        for samples in counts(most) {
            let setting = self.sampled(samples);
            self.add("samples", samples_named(samples), Judge::Limit, setting);
        }
        for filter in FilterShape::ALL {
            let mut setting = self.sampled(FILTERED.min(most));
            setting.sampling.filter = Some(filter);
            setting.sampling.filter_radius = None;
            let name = format!("{} ({})", filter.name(), samples_named(FILTERED.min(most)));
            self.add("filter", name, Judge::Limit, setting);
        }
        if most <= FILTERED {
            self.absent.push((
                "noise",
                format!("at most {most} samples a pixel are looked at; it needs more than {FILTERED}"),
            ));
            return;
        }
        for noise in NOISE {
            let mut setting = self.sampled(most);
            setting.sampling.noise = Some(noise);
            self.add("noise", format!("{noise} (up to {most} samples)"), Judge::Limit, setting);
        }
    }

    /// Samples with what may be cheaper to give up, or dearer to have.
    fn together(&mut self, most: u32) {
        let has_glaze = self.found.iter().any(|candidate| candidate.knob == "glaze bounces");
        let has_shadows = self.found.iter().any(|candidate| candidate.knob == id::SHADOWS.name());
        for samples in [4, 16].into_iter().filter(|&samples| samples <= most) {
            let sampled = self.sampled(samples);
            for numerics in Numerics::ALL.into_iter().filter(|&numerics| numerics != self.base.numerics) {
                let name = format!("{}, {}", numerics.name(), samples_named(samples));
                self.add("together", name, Judge::Limit, Setting { numerics, ..sampled.clone() });
            }
            if has_glaze {
                let name = format!("no glaze, {}", samples_named(samples));
                self.add("together", name, Judge::Limit, Setting { bounces: Some(0), ..sampled.clone() });
            }
            if has_shadows {
                let name = format!("no shadows, {}", samples_named(samples));
                let without = [sampled.without.as_slice(), &[id::SHADOWS]].concat();
                self.add("together", name, Judge::Limit, Setting { without, ..sampled });
            }
        }
    }

    /// The base with so many samples a pixel.
    fn sampled(&self, samples: u32) -> Setting {
        let mut setting = self.base.clone();
        (setting.sampling.samples, setting.sampling.noise) = (Some(samples), None);
        setting
    }
}

/// 1, 2, 4, …
fn counts(most: u32) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(1u32), |samples| samples.checked_mul(2))
        .take_while(move |&samples| samples <= most)
}

fn samples_named(samples: u32) -> String {
    if samples == 1 {
        "1 sample".into()
    } else {
        format!("{samples} samples")
    }
}

fn bounces_named(bounces: u32) -> String {
    if bounces == 1 {
        "1 bounce".into()
    } else {
        format!("{bounces} bounces")
    }
}

/// Why an effect is not computed; `None` where it is.
fn off(plan: &Plan, effect: EffectId) -> Option<String> {
    let decision = plan.decisions.iter().find(|decision| decision.effect == effect);
    decision.map_or(Some("this kiln was built without it".into()), |d| (!d.on).then(|| d.why.clone()))
}

/// The most bounces that a material in use asks for.
fn most_bounces(scene: &Scene) -> u32 {
    let materials = scene.objects.iter().map(|object| &scene.materials[object.material.0 as usize]);
    let bounces = materials.filter_map(|material| match material {
        Material::Phong(phong) => phong.glaze.map(|glaze| glaze.bounces),
        Material::MetallicRoughness(_) => None,
    });
    bounces.max().unwrap_or(0)
}
