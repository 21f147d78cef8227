//! Progress of a study.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::setting::Setting;
use crate::render::RenderControl;

/// Approximate work per tile, in samples per pixel.
pub(crate) fn effort(setting: &Setting) -> usize {
    let sampling = &setting.sampling;
    if sampling.is_wanted() { sampling.max_samples() as usize } else { 1 }
}

/// Progress in tiles times samples per pixel.
pub(crate) struct ProgressMeter<'a> {
    /// Receiver of the progress.
    pub control: &'a RenderControl<'a>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl<'a> ProgressMeter<'a> {
    /// No progress.
    pub(crate) fn new(control: &'a RenderControl<'a>) -> Self {
        ProgressMeter { control, done: AtomicUsize::new(0), total: AtomicUsize::new(1) }
    }

    /// Sets the total work, in tiles times samples per pixel.
    pub(crate) fn set_total(&self, total: usize) {
        self.total.store(total, Ordering::Relaxed);
    }

    /// Adds a finished tile of `effort` samples per pixel.
    pub(crate) fn step(&self, effort: usize) {
        let done = effort + self.done.fetch_add(effort, Ordering::Relaxed);
        (self.control.progress)(done, self.total.load(Ordering::Relaxed).max(done));
    }
}
