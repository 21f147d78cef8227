//! [`Results`]: what queries of many rays append.

use crate::geometry::HitBuffer;

/// The results of rays so far, in their order.
pub(crate) enum Results<'a> {
    /// The closest hits.
    Closest(&'a mut HitBuffer),
    /// Whether each hits anything.
    Occluded(&'a mut Vec<bool>),
}

impl Results<'_> {
    /// Their number.
    pub(crate) fn len(&self) -> usize {
        match self {
            Results::Closest(hits) => hits.len(),
            Results::Occluded(occluded) => occluded.len(),
        }
    }

    /// Appends misses, up to a number of results.
    pub(crate) fn resize(&mut self, len: usize) {
        match self {
            Results::Closest(hits) => hits.resize(len),
            Results::Occluded(occluded) => occluded.resize(len, false),
        }
    }
}
