//! Maxima of affine functions over the vertices and bounding spheres of a scene (support function values), such as its bounds.
//!
//! The results equal those of an exhaustive search bit by bit. Bounding boxes of parts of each mesh give upper bounds,
//! rounding included; only the vertices of parts that may contain the maximum are evaluated.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::{Mesh, Object, Placed, Shape};

/// A function of points that is affine up to rounding.
pub struct AffineFunction<'a> {
    /// The function as computed, rounding included.
    pub value: &'a dyn Fn(DVec3) -> f64,
    /// Its maximum over a sphere, given centre and radius.
    pub of_sphere: &'a dyn Fn(DVec3, f64) -> f64,
    /// Its gradient.
    pub gradient: DVec3,
    /// Upper bound, on each axis, of the gradient and of every term that it is summed from.
    pub weight: DVec3,
    /// Upper bound, on each axis, of the absolute value added to a point's coordinates.
    pub offset: DVec3,
}

/// Bound of the rounding error of a value, relative to the magnitudes that it is computed from: a few roundings in f64,
/// with a margin.
const ROUNDING: f64 = 1.0 / (1u64 << 44) as f64;

/// Maximum of each function over all vertices and bounding spheres of `objects`; negative infinity if there are none.
pub fn maxima(objects: &[Object], functions: &[AffineFunction]) -> Vec<f64> {
    let mut best = vec![f64::NEG_INFINITY; functions.len()];
    let mut placed: Vec<&Placed> = Vec::new();
    let mut parts: HashMap<*const Mesh, Vec<Part>> = HashMap::new();
    for object in objects {
        match &object.shape {
            Shape::Analytic(shape) => {
                let (centre, radius) = shape.bounding_sphere();
                for (best, function) in best.iter_mut().zip(functions) {
                    *best = best.max((function.of_sphere)(centre, radius));
                }
            }
            Shape::Mesh(mesh) => mesh.corners().for_each(|p| include_point(&mut best, functions, p)),
            Shape::Placed(one) => {
                parts.entry(Arc::as_ptr(&one.mesh)).or_insert_with(|| split(&one.mesh));
                placed.push(one);
            }
        }
    }
    for (best, function) in best.iter_mut().zip(functions) {
        let mut limits: Vec<(f64, &Placed)> = placed
            .iter()
            .map(|&one| (function.upper_bound(one, Part::around(&parts[&Arc::as_ptr(&one.mesh)])), one))
            .collect();
        limits.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (limit, one) in limits {
            if limit <= *best {
                break;
            }
            for part in &parts[&Arc::as_ptr(&one.mesh)] {
                if function.upper_bound(one, (part.min, part.max)) > *best {
                    let values = part.points.iter().map(|&p| (function.value)(one.placement.point(p)));
                    *best = values.fold(*best, f64::max);
                }
            }
        }
    }
    best
}

fn include_point(best: &mut [f64], functions: &[AffineFunction], p: DVec3) {
    for (best, function) in best.iter_mut().zip(functions) {
        *best = best.max((function.value)(p));
    }
}

impl AffineFunction<'_> {
    /// Upper bound of the function over the vertices of a mesh part with the given bounds.
    fn upper_bound(&self, placed: &Placed, (min, max): (DVec3, DVec3)) -> f64 {
        let (centre, half) = (min / 2.0 + max / 2.0, max / 2.0 - min / 2.0);
        let (linear, offset) = placed.placement.as_one();
        let across = (linear.transpose() * self.gradient).abs().dot(half);
        let numbers = placed.placement.reach(min.abs().max(max.abs())) + self.offset;
        let limit = (self.value)(linear * centre + offset) + across + self.weight.dot(numbers) * ROUNDING;
        // A bound that overflowed to NaN excludes nothing.
        if limit.is_nan() { f64::INFINITY } else { limit }
    }
}

/// Neighbouring vertices of a mesh and their bounding box.
struct Part {
    min: DVec3,
    max: DVec3,
    points: Vec<DVec3>,
}

/// Maximum number of vertices in a part.
const MAX_PART_POINTS: usize = 64;

impl Part {
    fn new(points: &[DVec3]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        // In this argument order `min` and `max` ignore NaN.
        for p in points {
            (min, max) = (p.min(min), p.max(max));
        }
        Part { min, max, points: points.to_vec() }
    }

    fn around(parts: &[Part]) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        parts.iter().fold(none, |(min, max), part| (part.min.min(min), part.max.max(max)))
    }
}

/// Splits the vertices used by a mesh at the median along the longest axis until each part has at most
/// `MAX_MAX_PART_POINTS_POINTS`.
fn split(mesh: &Mesh) -> Vec<Part> {
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
    let mut points: Vec<DVec3> =
        mesh.positions.iter().zip(used).filter(|(_, used)| *used).map(|(&p, _)| p).collect();
    let mut parts = Vec::new();
    let mut stack = vec![points.as_mut_slice()];
    while let Some(points) = stack.pop() {
        let part = Part::new(points);
        if points.len() <= MAX_PART_POINTS {
            parts.push(part);
            continue;
        }
        let axis = (part.max - part.min).max_position();
        let middle = points.len() / 2;
        points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        stack.extend(<[_; 2]>::from(points.split_at_mut(middle)));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::super::{MaterialId, Placement, Scene};
    use super::*;
    use glam::{DMat4, DQuat};

    /// Points on a sphere, instanced a hundred times: the bounds equal those of the baked copies, bit by bit.
    #[test]
    fn placed_meshes_reach_as_far_as_their_copies() {
        let turn = |i: u32| {
            let angle = f64::from(i) * 2.399_963;
            let z = 1.0 - 2.0 * f64::from(i % 997) / 997.0;
            DVec3::new(angle.cos() * (1.0 - z * z).sqrt(), angle.sin() * (1.0 - z * z).sqrt(), z)
        };
        let mesh = Arc::new(Mesh {
            positions: (0..3000).map(turn).collect(),
            triangles: (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..Mesh::default()
        });
        let object = |shape| Object { name: "o".into(), input: 0, material: MaterialId(0), shape };
        for far in [0.0, 1e6] {
            let places = (0..100).map(|i| {
                let [at, scale] = [turn(i) * 3.0 + far, turn(i * 7 + 3).abs() + 0.1];
                let rotation = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(0.3);
                let map = DMat4::from_scale_rotation_translation(scale, rotation, at);
                Placed::new(mesh.clone(), Placement::new(map))
            });
            let placed: Vec<Placed> = places.collect();
            let copies = placed.iter().map(|p| object(Shape::Mesh(p.bake()))).collect();
            let shared = placed.into_iter().map(|p| object(Shape::Placed(p))).collect();
            let bounds = |objects| Scene { objects, ..Scene::default() }.bounds();
            assert_eq!(bounds(shared), bounds(copies));
        }
    }
}
