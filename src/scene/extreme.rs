//! How far the objects of a scene reach, to the bit, without looking at every corner of every placed mesh.
//!
//! What is asked for is the greatest value that some affine function takes, as computed, on any corner. Boxes around
//! parts of a mesh tell which placements, and which parts of them, may hold it; only their corners are looked at.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::{Mesh, Object, Placed, Shape};

/// A function of points, affine up to rounding.
pub struct Measure<'a> {
    /// The function, with all its rounding.
    pub value: &'a dyn Fn(DVec3) -> f64,
    /// What it is for a sphere, given its centre and its radius.
    pub of_sphere: &'a dyn Fn(DVec3, f64) -> f64,
    /// Its gradient.
    pub gradient: DVec3,
    /// No less than the gradient on any axis, nor any factor that it is added up from.
    pub weight: DVec3,
    /// No less, on any axis, than what is added to the coordinates of a point.
    pub offset: DVec3,
}

/// The share of the numbers that a value is computed from by which it may be off, generously: a few roundings of f64.
const ROUNDING: f64 = 1.0 / (1u64 << 44) as f64;

/// The greatest value of each measure on any corner or sphere of `objects`; negative infinity where there is nothing.
pub fn greatest(objects: &[Object], measures: &[Measure]) -> Vec<f64> {
    let mut best = vec![f64::NEG_INFINITY; measures.len()];
    let mut placed: Vec<&Placed> = Vec::new();
    let mut parts: HashMap<*const Mesh, Vec<Part>> = HashMap::new();
    for object in objects {
        match &object.shape {
            Shape::Sphere { centre, radius } => {
                for (best, measure) in best.iter_mut().zip(measures) {
                    *best = best.max((measure.of_sphere)(*centre, *radius));
                }
            }
            Shape::Mesh(mesh) => mesh.corners().for_each(|p| include(&mut best, measures, p)),
            Shape::Placed(one) => {
                parts.entry(Arc::as_ptr(&one.mesh)).or_insert_with(|| split(&one.mesh));
                placed.push(one);
            }
        }
    }
    for (best, measure) in best.iter_mut().zip(measures) {
        let mut limits: Vec<(f64, &Placed)> = placed
            .iter()
            .map(|&one| (measure.limit(one, Part::around(&parts[&Arc::as_ptr(&one.mesh)])), one))
            .collect();
        limits.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (limit, one) in limits {
            if limit <= *best {
                break;
            }
            for part in &parts[&Arc::as_ptr(&one.mesh)] {
                if measure.limit(one, (part.min, part.max)) > *best {
                    let values = part.points.iter().map(|&p| (measure.value)(one.placement.point(p)));
                    *best = values.fold(*best, f64::max);
                }
            }
        }
    }
    best
}

fn include(best: &mut [f64], measures: &[Measure], p: DVec3) {
    for (best, measure) in best.iter_mut().zip(measures) {
        *best = best.max((measure.value)(p));
    }
}

impl Measure<'_> {
    /// No corner of this part of a mesh has a greater value.
    fn limit(&self, placed: &Placed, (min, max): (DVec3, DVec3)) -> f64 {
        let (centre, half) = (min / 2.0 + max / 2.0, max / 2.0 - min / 2.0);
        let (linear, offset) = placed.placement.as_one();
        let across = (linear.transpose() * self.gradient).abs().dot(half);
        let numbers = placed.placement.reach(min.abs().max(max.abs())) + self.offset;
        let limit = (self.value)(linear * centre + offset) + across + self.weight.dot(numbers) * ROUNDING;
        // Where there is no telling, there is none.
        if limit.is_nan() { f64::INFINITY } else { limit }
    }
}

/// Corners of a mesh that lie close together, and the box around them.
struct Part {
    min: DVec3,
    max: DVec3,
    points: Vec<DVec3>,
}

/// How many points a part has at most.
const PART: usize = 64;

impl Part {
    fn new(points: &[DVec3]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        // In this order, what is not a number is passed over.
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

/// The corners of a mesh, each once, in parts: halved across the longest side of their box until they are few.
fn split(mesh: &Mesh) -> Vec<Part> {
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
    let mut points: Vec<DVec3> =
        mesh.positions.iter().zip(used).filter(|(_, used)| *used).map(|(&p, _)| p).collect();
    let mut parts = Vec::new();
    let mut waiting = vec![points.as_mut_slice()];
    while let Some(points) = waiting.pop() {
        let part = Part::new(points);
        if points.len() <= PART {
            parts.push(part);
            continue;
        }
        let axis = (part.max - part.min).max_position();
        let middle = points.len() / 2;
        points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        waiting.extend(<[_; 2]>::from(points.split_at_mut(middle)));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::super::{MaterialId, Placement, Scene};
    use super::*;
    use glam::{DMat4, DQuat};

    /// Points all over a ball, placed a hundred times: the box is that of the copies, to the bit.
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
