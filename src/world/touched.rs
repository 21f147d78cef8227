//! Planes of surfaces with punctual lights on them. Shadow rays to these lights end in front of the planes.
//!
//! Corners of triangles are rounded to the precision of the tier, positions of lights are not: a rounded surface may
//! occlude a light on it, or just above it, from everywhere. Rounding the light as well would put it only on surfaces
//! that are parallel to an axis.
//!
//! Let e be the relative error of a coordinate ([`unit`]), and R the largest coordinate of a triangle's rounded
//! corners. Rounding moves a corner by at most e R on each axis, by √3 e R in all, and every point of the triangle, a
//! convex combination, by no more. So a light on a triangle is at most √3 e R from the rounded triangle and its plane:
//! such planes are touched. Let n be the plane's unit normal, h > 0 the height of a ray's origin above the light along
//! n or -n, and |r| <= √3 e R the light's height above the plane. At the share s of the way to the light the ray is h
//! (1 - s) + r above the plane. It is tested up to the share 1 - 2 e R / h, where that is 2 e R + r > 0: so it does not
//! reach the plane, whatever its angle. The remaining 0.26 e R exceeds the errors of triangle tests
//! (kiln-bvh's `geometry::spawn`). In exact arithmetic a segment that ends on the plane does not cross it either. Surfaces within
//! 2 e R of the light along n do not occlude it, since their position is not known more precisely; surfaces farther
//! away do.
//!
//! Lights and geometry are not moved. Analytic shapes are not rounded, but a light in the plane of a disk is as near to
//! it as its rays' ends: of these shapes, the tangent plane at the light is touched.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::WorldLight;
use crate::bvh::detail::reach_of;
use crate::bvh::{Numerics, Primitive};
use crate::scene::{Mesh, Object, Placed, Shape};

/// Maximum number of planes per light. Further ones, at a vertex of many triangles, may occlude it.
const MOST: usize = 64;

/// A plane through a light, up to rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TouchedPlane {
    /// The unit normal, of either side.
    normal: DVec3,
    /// The height above the light at which shadow rays end.
    margin: f64,
}

impl WorldLight {
    /// Fraction of the way from a point to the light on which the shadow ray is tested: 1 for a light that touches no
    /// plane.
    #[inline]
    pub(crate) fn tested_share(&self, from: DVec3) -> f64 {
        let Some(position) = self.kind.position().filter(|_| !self.touched.is_empty()) else { return 1.0 };
        let share = |plane: &TouchedPlane| 1.0 - plane.margin / (from - position).dot(plane.normal).abs();
        self.touched.iter().map(share).fold(1.0, f64::min).max(0.0)
    }
}

/// Relative error of coordinates. In f32 it is half an epsilon; in `fast`, whose rays are rounded as well, eight times
/// that, without a proof. In f64 it is 64 epsilon, four times the maximum error of a triangle test, for positions that
/// are computed from angles and transforms.
fn unit(numerics: Numerics) -> f64 {
    let roundings = if numerics == Numerics::Fast { 8.0 } else { 1.0 };
    (0.5 * roundings * numerics.precision().epsilon()).max(64.0 * f64::EPSILON)
}

/// Copies the planes of known lights to those at the same positions.
pub(super) fn copy(lights: &mut [WorldLight], known: &[WorldLight]) {
    let place =
        |light: &WorldLight| light.kind.position().map(|position| position.to_array().map(f64::to_bits));
    let on_planes = known.iter().filter(|light| !light.touched.is_empty());
    let planes: HashMap<_, _> = on_planes.map(|light| (place(light), &light.touched)).collect();
    for light in lights {
        light.touched = planes.get(&place(light)).map_or(Vec::new(), |planes| (*planes).clone());
    }
}

/// Finds the planes that each light touches.
pub(super) fn find(lights: &mut [WorldLight], objects: &[Object], numerics: Numerics) {
    let (precision, unit) = (numerics.precision(), unit(numerics));
    let mut positions: Vec<(DVec3, usize)> = Vec::new();
    for (index, light) in lights.iter().enumerate() {
        positions.extend(light.kind.position().filter(|p| p.is_finite()).map(|position| (position, index)));
    }
    if positions.is_empty() {
        return;
    }
    positions.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    let within = |(min, max): (DVec3, DVec3)| {
        let first = positions.partition_point(|(position, _)| position.x < min.x);
        let last = positions.partition_point(|(position, _)| position.x <= max.x);
        let in_slab = &positions[first..last.max(first)];
        in_slab.iter().filter(move |(p, _)| (p.cmpge(min) & p.cmple(max)).all())
    };
    let mut meshes: HashMap<*const Mesh, (DVec3, DVec3)> = HashMap::new();
    for object in objects {
        if let Shape::Placed(placed) = &object.shape {
            let span = || span(placed.mesh.positions.iter().copied());
            let of_mesh = *meshes.entry(Arc::as_ptr(&placed.mesh)).or_insert_with(span);
            if within(placed_box(placed, of_mesh, unit)).next().is_none() {
                continue;
            }
        }
        for primitive in object.shape.primitives() {
            let Some(primitive) = primitive.rounded(precision) else { continue };
            let (reach, (min, max)) = match &primitive {
                Primitive::Triangle(triangle) => (reach_of(triangle.0), span(triangle.0.into_iter())),
                Primitive::Analytic(shape) => {
                    let (centre, radius) = shape.bounding_sphere();
                    (centre.abs() + radius, (centre - radius, centre + radius))
                }
            };
            let reach = unit * reach.max_element();
            let near = 3f64.sqrt() * reach;
            for &(position, index) in within((min - near, max + near)) {
                let touched = &mut lights[index].touched;
                let (is_on, normal) = match &primitive {
                    Primitive::Triangle(triangle) => {
                        let Some(normal) = triangle.unit_normal() else { continue };
                        ((position - triangle.0[0]).dot(normal).abs() <= near, normal)
                    }
                    Primitive::Analytic(shape) => {
                        let (point, normal) = shape.surface(position);
                        (position.distance(point.position) <= near, normal)
                    }
                };
                let plane = TouchedPlane { normal, margin: 2.0 * reach };
                if is_on && touched.len() < MOST && !touched.contains(&plane) {
                    touched.push(plane);
                }
            }
        }
    }
}

/// Bounding box of points.
fn span(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)))
}

/// Bounding box of a placed mesh whose points have the bounding box `(min, max)`, padded for the rounding of its
/// corners.
fn placed_box(placed: &Placed, (min, max): (DVec3, DVec3), unit: f64) -> (DVec3, DVec3) {
    let corners = (0..8u32).map(|i| {
        let side = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
        placed.placement.point(DVec3::new(side(0), side(1), side(2)))
    });
    let (least, most) = span(corners);
    let reach = least.abs().max(most.abs()).max_element();
    let error = placed.placement.error(min.abs().max(max.abs())).max_element();
    // Doubled for the rounding of the box itself.
    let wider = 2.0 * (3f64.sqrt() * unit * reach + error);
    (least - wider, most + wider)
}
