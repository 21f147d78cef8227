//! How far a study is.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::setting::Setting;
use crate::render::RenderControl;

/// About how much work a tile of a picture is, in samples a pixel.
pub fn effort(setting: &Setting) -> usize {
    let sampling = &setting.sampling;
    if sampling.is_wanted() {
        sampling.max_samples() as usize
    } else {
        1
    }
}

/// How far the whole work is, in tiles times samples.
pub struct Meter<'a> {
    /// Who is told.
    pub watch: &'a RenderControl<'a>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl<'a> Meter<'a> {
    /// At the beginning.
    pub fn new(watch: &'a RenderControl<'a>) -> Self {
        Meter { watch, done: AtomicUsize::new(0), total: AtomicUsize::new(1) }
    }

    /// Says how much there is to do, in tiles times samples.
    pub fn expect(&self, total: usize) {
        self.total.store(total, Ordering::Relaxed);
    }

    /// Tells of a tile that is done, of so many samples a pixel.
    pub fn step(&self, effort: usize) {
        let done = effort + self.done.fetch_add(effort, Ordering::Relaxed);
        (self.watch.progress)(done, self.total.load(Ordering::Relaxed).max(done));
    }
}
