//! New positions for the same primitives: boxes are computed anew, what is in which of them stays.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::super::Primitive;
use super::super::build::LEAST_SHARE;
use super::node::{Content, Node, WIDTH};
use super::{Group, NONE, Wide};
use crate::geometry::{Bounds, Corner, PrimId, Tier, Triangle};

impl<T: Tier> Wide<T> {
    /// Takes the primitives as they are now; see [`super::super::Accelerator::refit`].
    pub(super) fn refit_to(&mut self, primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        let before = self.cost_at_build.unwrap_or_else(|| self.cost());
        self.cost_at_build = Some(before);
        let precision = T::NUMERICS.precision();
        let is_other_kind = AtomicBool::new(false);
        let now = |id: PrimId| primitive(id).rounded(precision);
        let of_group = |group: &mut Group<T::Corner>| {
            let mut whole = Around::NONE;
            for lane in 0..group.ids.len() {
                let id = group.ids[lane];
                if id == NONE {
                    continue;
                }
                match now(PrimId(id)) {
                    Some(Primitive::Triangle(Triangle(corners))) => {
                        let corners = corners.map(T::Corner::lower);
                        whole.add(T::Corner::bounds(&corners));
                        group.quad.set(lane, Some(&corners));
                    }
                    Some(Primitive::Sphere(_)) | None => is_other_kind.store(true, Ordering::Relaxed),
                }
            }
            whole
        };
        let groups: Vec<Around> =
            self.groups.par_iter_mut().with_min_len(LEAST_SHARE).map(of_group).collect();
        let mut spheres = vec![Around::NONE; self.spheres.len()];
        for ((sphere, id), whole) in self.spheres.iter_mut().zip(&mut spheres) {
            match now(*id) {
                Some(Primitive::Sphere(moved)) => {
                    whole.add(moved.bounds());
                    *sphere = moved;
                }
                None => sphere.radius = 0.0,
                Some(Primitive::Triangle(_)) => is_other_kind.store(true, Ordering::Relaxed),
            }
        }
        // A node stands before those below it.
        for index in (0..self.nodes.len()).rev() {
            for place in 0..WIDTH {
                let union = |boxes: &[Around], range: std::ops::Range<u32>| {
                    boxes[range.start as usize..range.end as usize]
                        .iter()
                        .fold(Around::NONE, |a, b| a.union(b))
                };
                let child = self.nodes[index].children[place];
                let b = match child.content() {
                    Content::Node(child) => match self.nodes.get(child as usize) {
                        Some(node) => Around::all_of(node),
                        // A place that never held anything.
                        None => continue,
                    },
                    Content::Groups(range) => union(&groups, range),
                    Content::Spheres(range) => union(&spheres, range),
                };
                self.nodes[index].set(place, b.0, child);
                if b.is_nothing() {
                    self.nodes[index].present &= !(1 << place);
                }
            }
        }
        if is_other_kind.into_inner() {
            return None;
        }
        let after = self.cost();
        // Where nothing has any area all trees are as good.
        Some(if before > 0.0 && after > 0.0 { after / before } else { 1.0 })
    }

    /// How many nodes and leaves a line through the whole meets on average (the surface area heuristic, MacDonald and Booth
    /// 1990), each counted as 1; 0 where there is no area.
    fn cost(&self) -> f64 {
        let area = |b: Bounds| {
            let size = (b.max.as_dvec3() - b.min.as_dvec3()).max(glam::DVec3::ZERO);
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        let whole = self.nodes.first().map_or(0.0, |root| area(Around::all_of(root).0));
        if whole <= 0.0 {
            return 0.0;
        }
        let of_node = |node: &Node| -> f64 {
            let held = (0..WIDTH).filter(|place| node.present >> place & 1 != 0);
            held.map(|place| area(node.bounds(place))).sum()
        };
        1.0 + self.nodes.iter().map(of_node).sum::<f64>() / whole
    }
}

/// A box, inside out where it holds nothing.
#[derive(Clone, Copy)]
struct Around(Bounds);

impl Around {
    const NONE: Self = Around(Bounds { min: glam::Vec3::INFINITY, max: glam::Vec3::NEG_INFINITY });

    fn add(&mut self, b: Bounds) {
        self.0 = self.0.union(b);
    }

    fn union(self, other: &Self) -> Self {
        Around(self.0.union(other.0))
    }

    fn is_nothing(&self) -> bool {
        self.0.min.x > self.0.max.x
    }

    /// Around all that a node holds.
    fn all_of(node: &Node) -> Self {
        let least = |axis: usize| node.planes[axis][0].into_iter().fold(f32::INFINITY, f32::min);
        let greatest = |axis: usize| node.planes[axis][1].into_iter().fold(f32::NEG_INFINITY, f32::max);
        let [min, max] = [[0, 1, 2].map(least), [0, 1, 2].map(greatest)];
        Around(Bounds { min: min.into(), max: max.into() })
    }
}
