//! The right answers: those of kiln's tier `exact`.

use rayon::prelude::*;

use super::super::{Mesh, is_nearest, kiln};
use super::{Kind, Questions};
use crate::bvh::{Accelerator, Layout, Preset, Traversal};
use crate::geometry::{Numerics, Ray};

/// What every ray should find.
pub struct Truth<'a> {
    accelerator: Box<dyn Accelerator>,
    questions: &'a Questions,
    answers: [Vec<Option<u32>>; 4],
}

impl<'a> Truth<'a> {
    /// Over a mesh, for every ray of `questions`.
    pub fn new(mesh: &Mesh, questions: &'a Questions) -> Self {
        let accelerator = kiln::accelerator(mesh, Layout::Bvh2(Preset::default()), Numerics::Exact);
        let answers = Kind::ALL.map(|kind| {
            let one = |traversal: &mut Traversal, ray: &Ray| match kind.is_any_hit() {
                true => accelerator.is_occluded(ray, traversal).then_some(0),
                false => accelerator.closest_hit(ray, traversal).map(|hit| hit.prim.0),
            };
            questions.of(kind).par_iter().map_init(Traversal::default, one).collect()
        });
        Truth { accelerator, questions, answers }
    }

    /// How many answers are wrong: a hit that there is not, a miss where there is a hit, or a triangle that is not one
    /// of those that are truly hit nearest.
    pub fn wrong(&self, kind: Kind, answers: &[Option<u32>]) -> u64 {
        let truth = &self.answers[kind as usize];
        assert_eq!(answers.len(), truth.len(), "an answer for every ray");
        let is_wrong = |((ray, found), truth): ((&Ray, &Option<u32>), &Option<u32>)| match (found, truth) {
            (None, None) => false,
            (Some(found), Some(truth)) if kind.is_any_hit() || found == truth => false,
            (Some(found), Some(_)) => {
                let mut hits = Vec::new();
                self.accelerator.all_hits(ray, &mut hits, &mut Traversal::default());
                !is_nearest(*found, &hits)
            }
            _ => true,
        };
        let rays = self.questions.of(kind).par_iter();
        rays.zip(answers).zip(truth).filter(|question| is_wrong(*question)).count() as u64
    }
}
