//! Loading of inputs into a resolved job, with timing and progress.

use std::time::Instant;

use super::arguments::Arguments;
use super::statistics::Seconds;
use crate::error::{Result, Warnings};
use crate::import;
use crate::job::{RenderSettings, ResolvedJob, resolve};

/// Loads the inputs and resolves the render settings. `show` is called with the name of each phase and the warnings so
/// far.
pub(crate) fn load_and_resolve(
    arguments: &Arguments,
    settings: &RenderSettings,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<ResolvedJob> {
    show("loading", warnings);
    let scene =
        timed(&mut seconds.load, || import::load_with(&arguments.inputs, &arguments.import, warnings))?;
    if !scene.clips.is_empty() && scene.import_options.pose().is_none() {
        warnings.note("the scene has clips and is drawn at rest; `--time SECONDS` draws a moment of them");
    }
    show("preparing", warnings);
    timed(&mut seconds.prepare, || resolve(scene, settings, warnings))
}

/// Calls `work` and adds its time in seconds.
pub(crate) fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds += start.elapsed().as_secs_f64();
    result
}
