//! Options that were given and change nothing in a picture.

use crate::effects::{EffectId, id};
use crate::error::Warnings;
use crate::job::{PictureOptions, PlanSettings};

/// The options of several samples per pixel.
const SAMPLING: &[&str] = &["samples", "filter", "filter-radius", "noise", "min-samples", "seed", "sampler"];

/// What decides beside the settings whether options change a picture.
#[derive(Clone, Copy, Default)]
pub struct PictureUse {
    /// The time of a still picture in seconds; `None` for frames.
    pub time: Option<f64>,
    /// Whether its values are rounded to integers.
    pub is_rounded: bool,
}

/// Warns of options that were given and change nothing in a picture with these settings, whatever the scene contains.
pub fn warn_of_unused(
    given: &PictureOptions,
    settings: &PlanSettings,
    picture: PictureUse,
    warnings: &mut Warnings,
) {
    let sampling = &settings.sampling;
    let is_without = |effect: EffectId| settings.without.iter().any(|name| *name == effect.name());
    let reasons = [
        (SAMPLING, is_without(id::ANTIALIASING), " without the effect `antialiasing`"),
        (&["noise"], is_without(id::ADAPTIVE), " without the effect `adaptive`"),
        (&["min-samples"], sampling.noise.is_none(), " without --noise"),
        (&["same-grain"], picture.time == Some(0.0), " in a picture at time 0"),
        (&["dither"], !picture.is_rounded, ": the values are not rounded to integers"),
    ];
    let is_default = |name: &str, text: &str| text == "false" || (name, text) == ("samples", "1");
    for (name, text) in given.entries() {
        let applies = |(names, holds, _): &&(&[&str], bool, _)| *holds && names.contains(&&*name);
        if let Some((_, _, why)) = reasons.iter().find(applies).filter(|_| !is_default(&name, &text)) {
            warnings.push(format!("--{name} changes nothing{why}"));
        }
    }
}
