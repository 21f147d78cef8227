//! Queues of single rays.

use super::RayQueue;

/// A queue that traces rays in an engine's format one by one. `hit` returns the primitive that a ray hits, if any.
pub fn singly<'a, R: Send + 'a>(
    rays: impl Iterator<Item = R>,
    hit: impl FnMut(&R) -> Option<u32> + Send + 'a,
) -> Box<dyn RayQueue + 'a> {
    let rays: Vec<R> = rays.collect();
    // Written to, so that its memory pages are mapped.
    let mut hits = vec![Some(1); rays.len()];
    hits.clear();
    Box::new(Singly { rays, hits, hit })
}

struct Singly<R, F> {
    rays: Vec<R>,
    hits: Vec<Option<u32>>,
    hit: F,
}

impl<R: Send, F: FnMut(&R) -> Option<u32> + Send> RayQueue for Singly<R, F> {
    fn run(&mut self) {
        self.hits.extend(self.rays.iter().map(&mut self.hit));
    }

    fn hits(&self) -> Vec<Option<u32>> {
        self.hits.clone()
    }
}
