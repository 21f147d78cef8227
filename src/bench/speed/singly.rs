//! Rays that are asked about one by one.

use super::Queue;

/// A queue over rays in an engine's own form; `ask` is called with each of them.
pub fn singly<'a, R: Send + 'a>(
    rays: impl Iterator<Item = R>,
    ask: impl FnMut(&R) -> Option<u32> + Send + 'a,
) -> Box<dyn Queue + 'a> {
    let rays: Vec<R> = rays.collect();
    // Written to, so that its memory is really there.
    let mut answers = vec![Some(1); rays.len()];
    answers.clear();
    Box::new(Singly { rays, answers, ask })
}

struct Singly<R, F> {
    rays: Vec<R>,
    answers: Vec<Option<u32>>,
    ask: F,
}

impl<R: Send, F: FnMut(&R) -> Option<u32> + Send> Queue for Singly<R, F> {
    fn run(&mut self) {
        self.answers.extend(self.rays.iter().map(&mut self.ask));
    }

    fn answers(&self) -> Vec<Option<u32>> {
        self.answers.clone()
    }
}
