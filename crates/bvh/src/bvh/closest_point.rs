//! [`Bvh`]: closest points and signed distances.

use glam::DVec3;

use super::{Bvh, Primitive, Traversal};
use crate::geometry::{Point, PrimId, Triangle};

/// The point of a surface that is closest to another point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ClosestPoint {
    /// The point.
    pub point: DVec3,
    /// Its distance, not negative.
    pub distance: f64,
    /// The primitive that it is on.
    pub prim: PrimId,
}

impl Bvh {
    /// The closest point of the surface; of primitives at equal distance, the one with the lowest id. `None` without
    /// primitives, and for a point that is not finite, or too large for f32 ([`NotFinite`](super::NotFinite)). In f64
    /// for the primitives as stored: good to 2^-48 of the largest distance to a corner of the triangle on each axis.
    pub fn closest_point(&self, point: impl Point, traversal: &mut Traversal) -> Option<ClosestPoint> {
        self.closest_point_within(point, f64::INFINITY, traversal)
    }

    /// [`Bvh::closest_point`] that is no farther than `max_distance`; `None` without one. Farther nodes are not
    /// visited.
    pub fn closest_point_within(
        &self,
        point: impl Point,
        max_distance: f64,
        traversal: &mut Traversal,
    ) -> Option<ClosestPoint> {
        let point = point.to_dvec3();
        // Beyond f32, which bounds all primitives, squares of distances overflow.
        point.as_vec3().is_finite().then_some(())?;
        let mut best: Option<ClosestPoint> = None;
        let mut visit = |closest: ClosestPoint| {
            let ClosestPoint { distance, prim, .. } = closest;
            let is_better = match best {
                None => distance <= max_distance,
                Some(best) => distance < best.distance || distance == best.distance && prim < best.prim,
            };
            if is_better {
                best = Some(closest);
            }
            best.map_or(max_distance, |best| best.distance)
        };
        self.each_closest_point(point, max_distance, &mut visit, traversal);
        best
    }

    /// Calls `visit` with the closest points of primitives that are no farther than `max_distance`, or than the
    /// distance that it returned last, and perhaps of others; of a split triangle several times.
    pub(super) fn each_closest_point(
        &self,
        point: DVec3,
        max_distance: f64,
        visit: &mut dyn FnMut(ClosestPoint) -> f64,
        traversal: &mut Traversal,
    ) {
        let mut limit = max_distance;
        let mut visit_primitive = |prim, primitive| {
            limit = visit(closest_on(&primitive, prim, point));
            limit
        };
        self.accelerator().each_near_box([point; 2], max_distance, &mut visit_primitive, traversal);
        if let Some(shapes) = self.own_shapes() {
            shapes.each_closest_point(point, limit, visit, traversal);
        }
    }

    /// The distance of a point from the surface, negative inside, as [`Bvh::contains`] decides. `None` where
    /// [`Bvh::closest_point`] is.
    pub fn signed_distance(&self, point: impl Point, traversal: &mut Traversal) -> Option<f64> {
        let point = point.to_dvec3();
        let ClosestPoint { distance, .. } = self.closest_point(point, traversal)?;
        Some(self.contains(point, traversal).signed(distance))
    }
}

/// The closest point of a primitive.
pub(super) fn closest_on(primitive: &Primitive, prim: PrimId, point: DVec3) -> ClosestPoint {
    let offset = offset(point, primitive);
    ClosestPoint { point: point + offset, distance: offset.length(), prim }
}

/// The vector to the closest point of a primitive.
fn offset(point: DVec3, primitive: &Primitive) -> DVec3 {
    match primitive {
        Primitive::Triangle(Triangle(corners)) => offset_to_triangle(corners.map(|p| p - point)),
        Primitive::Analytic(shape) => shape.surface(point).0.position - point,
    }
}

/// The point of a triangle that is closest to 0: that of the plane if it is inside, or else of an edge. The edges
/// are tried in any case, because the normal of a sliver is not reliable.
fn offset_to_triangle([a, b, c]: [DVec3; 3]) -> DVec3 {
    let on_edge = |from: DVec3, to: DVec3| {
        let along = to - from;
        let share = -from.dot(along) / along.length_squared();
        // NaN, of an edge without length, becomes 0.
        from + along * if share > 0.0 { share.min(1.0) } else { 0.0 }
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    let nearer = |a: DVec3, b: DVec3| if b.length_squared() < a.length_squared() { b } else { a };
    let best = nearer(nearer(edges[0], edges[1]), edges[2]);
    let normal = (b - a).cross(c - a);
    let weights = [b.cross(c), c.cross(a), a.cross(b)].map(|area| area.dot(normal));
    if weights.iter().all(|&weight| weight > 0.0) {
        let sum = weights[0] + weights[1] + weights[2];
        return nearer(best, (a * weights[0] + b * weights[1] + c * weights[2]) / sum);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Preset;
    use crate::geometry::Numerics;

    /// Squares of larger coordinates overflow: a closest point is finite, or there is none.
    #[test]
    fn closest_points_are_finite() {
        let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let tetrahedron = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(Primitive::from);
        let ball = Primitive::from(([5.0, 0.0, 0.0], 1.0));
        let largest = f64::from(f32::MAX);
        for numerics in Numerics::ALL {
            let bvh = Bvh::with(tetrahedron.into_iter().chain([ball]), Preset::default(), numerics);
            let (bvh, traversal) = (bvh.expect("finite"), &mut Traversal::default());
            for far in [1e300, 2.0 * largest, f64::MAX, f64::INFINITY, f64::NAN] {
                for point in [DVec3::X * far, DVec3::splat(-far), DVec3::new(0.1, far, 0.1)] {
                    assert_eq!(bvh.closest_point(point, traversal), None, "{point}");
                    assert_eq!(bvh.signed_distance(point, traversal), None, "{point}");
                    assert_eq!(bvh.winding_number(point, traversal), 0, "{point}");
                    assert_eq!(bvh.par_closest_points(&[point]), [None], "{point}");
                    assert_eq!(bvh.par_signed_distances(&[point]), [None], "{point}");
                    assert_eq!(bvh.par_winding_numbers(&[point]), [0], "{point}");
                }
            }
            for far in [1e10, 1e30, largest] {
                let point = DVec3::splat(far);
                let closest = bvh.closest_point(point, traversal).expect("a point");
                // All of the surface is within 10 of the origin, which is at a distance of sqrt(3) `far`.
                let relative = closest.distance / (far * 3f64.sqrt()) - 1.0;
                assert!(relative.abs() < 1e-8 && closest.point.is_finite(), "{closest:?}");
                assert_eq!(bvh.signed_distance(point, traversal), Some(closest.distance));
            }
        }
    }
}
