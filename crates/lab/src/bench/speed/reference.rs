//! Reference hits from kiln's tier `exact`.

use rayon::prelude::*;

use super::super::is_nearest;
use kiln::bvh::detail::Accelerator;
use kiln::bvh::{Hit, Ray, Traversal};

/// The right answers to rays.
pub struct ReferenceHits<'a> {
    exact: &'a dyn Accelerator,
    rays: &'a [Ray],
    is_any_hit: bool,
    hits: Vec<Option<u32>>,
}

impl<'a> ReferenceHits<'a> {
    /// The answers of `exact`: the closest hit of each ray, or whether it hits anything.
    pub fn new(exact: &'a dyn Accelerator, rays: &'a [Ray], is_any_hit: bool) -> Self {
        let one = |traversal: &mut Traversal, ray: &Ray| match is_any_hit {
            true => exact.is_occluded(ray, traversal).then_some(0),
            false => exact.closest_hit(ray, traversal).map(|hit| hit.prim.0),
        };
        let hits = rays.par_iter().map_init(Traversal::default, one).collect();
        ReferenceHits { exact, rays, is_any_hit, hits }
    }

    fn all_hits(&self, ray: &Ray, traversal: &mut Traversal) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.exact.all_hits(ray, &mut hits, traversal);
        hits
    }

    /// Number of wrong hits: false hits, false misses and wrong triangles.
    pub fn wrong(&self, found: &[Option<u32>]) -> u64 {
        assert_eq!(found.len(), self.hits.len(), "an answer for every ray");
        let is_wrong = |traversal: &mut Traversal, index: usize| match (found[index], self.hits[index]) {
            (None, None) => false,
            (Some(found), Some(reference)) if self.is_any_hit || found == reference => false,
            (Some(found), Some(_)) => !is_nearest(found, &self.all_hits(&self.rays[index], traversal)),
            _ => true,
        };
        let wrong = (0..found.len()).into_par_iter().map_init(Traversal::default, is_wrong);
        wrong.filter(|&is_wrong| is_wrong).count() as u64
    }

    /// The largest error of a distance in f32 ulp, of hits on triangles that the ray hits.
    pub fn worst_distance(&self, found: &[Option<u32>], distances: &[f64]) -> f64 {
        let error = |traversal: &mut Traversal, index: usize| {
            let all = self.all_hits(&self.rays[index], traversal);
            let truth = all.iter().find(|hit| Some(hit.prim.0) == found[index]);
            truth.map_or(0.0, |hit| error_in_ulp(distances[index], hit.t))
        };
        (0..found.len()).into_par_iter().map_init(Traversal::default, error).reduce(|| 0.0, f64::max)
    }
}

/// The error of a distance in f32 ulp.
pub(crate) fn error_in_ulp(t: f64, truth: f64) -> f64 {
    let single = truth as f32;
    (t - truth).abs() / (f64::from(single.next_up()) - f64::from(single))
}
