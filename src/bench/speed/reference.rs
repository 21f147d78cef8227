//! Reference hits from kiln's tier `exact`.

use rayon::prelude::*;

use super::super::{Mesh, is_nearest, kiln};
use super::{Kind, RaySets};
use crate::bvh::{Accelerator, Layout, Preset, Traversal};
use crate::geometry::{Numerics, Ray};

/// All hits of every ray.
pub struct ReferenceHits<'a> {
    accelerator: Box<dyn Accelerator>,
    ray_sets: &'a RaySets,
    hits: [Vec<Option<u32>>; 4],
}

impl<'a> ReferenceHits<'a> {
    /// Over a mesh, for every ray of `questions`.
    pub fn new(mesh: &Mesh, ray_sets: &'a RaySets) -> Self {
        let accelerator = kiln::accelerator(mesh, Layout::Bvh2(Preset::default()), Numerics::Exact);
        let hits = Kind::ALL.map(|kind| {
            let one = |traversal: &mut Traversal, ray: &Ray| match kind.is_any_hit() {
                true => accelerator.is_occluded(ray, traversal).then_some(0),
                false => accelerator.closest_hit(ray, traversal).map(|hit| hit.prim.0),
            };
            ray_sets.of(kind).par_iter().map_init(Traversal::default, one).collect()
        });
        ReferenceHits { accelerator, ray_sets, hits }
    }

    /// Number of wrong hits: false hits, false misses and wrong triangles.
    pub fn wrong(&self, kind: Kind, hits: &[Option<u32>]) -> u64 {
        let reference = &self.hits[kind as usize];
        assert_eq!(hits.len(), reference.len(), "an answer for every ray");
        let is_wrong =
            |((ray, found), reference): ((&Ray, &Option<u32>), &Option<u32>)| match (found, reference) {
                (None, None) => false,
                (Some(found), Some(reference)) if kind.is_any_hit() || found == reference => false,
                (Some(found), Some(_)) => {
                    let mut hits = Vec::new();
                    self.accelerator.all_hits(ray, &mut hits, &mut Traversal::default());
                    !is_nearest(*found, &hits)
                }
                _ => true,
            };
        let rays = self.ray_sets.of(kind).par_iter();
        rays.zip(hits).zip(reference).filter(|question| is_wrong(*question)).count() as u64
    }
}
