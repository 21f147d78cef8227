//! Emissive triangles: uniform points of them, also of one or two without branches.

use glam::DVec3;

use crate::bvh::detail::{EdgeTest, SurfacePoint, point_at, reach_of};
use crate::bvh::{Numerics, Triangle};

/// A triangle, with what all of its points have in common.
pub(super) struct SampledTriangle {
    pub(super) triangle: Triangle,
    /// `None` for a triangle too thin to have one, whose samples give no light.
    pub(super) normal: Option<DVec3>,
    edges: EdgeTest,
    /// [`SurfacePoint::reach`] of its points.
    reach: DVec3,
}

impl SampledTriangle {
    pub(super) fn new(triangle: Triangle) -> Self {
        let (normal, edges) = (triangle.unit_normal(), EdgeTest::new(triangle.0, Numerics::Watertight));
        SampledTriangle { triangle, normal, edges, reach: reach_of(triangle.0) }
    }

    /// A point, and whether it is near an edge, where its start must be moved.
    #[inline(always)]
    fn point(&self, barycentrics: [f64; 3]) -> (SurfacePoint, bool) {
        let point = SurfacePoint::new(point_at(self.triangle.0, barycentrics), self.reach);
        (point, self.edges.is_near(barycentrics))
    }

    /// A uniform point and its barycentrics. `density` is that of the choice of the triangle times its area.
    #[inline]
    pub(super) fn sample(&self, density: f64, numbers: [f64; 2]) -> Option<(TriangleSample, [f64; 3])> {
        let barycentrics = barycentrics_at(numbers);
        let (mut point, is_near) = self.point(barycentrics);
        if is_near {
            point = SurfacePoint::on_triangle(self.triangle.0, barycentrics, Numerics::Watertight);
        }
        Some((TriangleSample { point, normal: self.normal?, density }, barycentrics))
    }
}

/// The emissive triangles of a world that has one or two, as a quadrilateral lamp, to be sampled without branches.
pub(crate) struct TwoTriangles<'a> {
    /// The same twice if there is one.
    pub(super) triangles: [&'a SampledTriangle; 2],
    pub(super) normals: [DVec3; 2],
    pub(super) densities: [f64; 2],
    pub(super) radiances: [DVec3; 2],
    /// The choice from which the second is chosen, times the total power, and that power.
    pub(super) second_from: f64,
    pub(super) total: f64,
}

impl TwoTriangles<'_> {
    /// The sample of [`Emitters::sample_triangle`], its radiance, and whether it is near an edge, where
    /// [`Emitters::sample_triangle`] moves its start.
    #[inline(always)]
    pub(crate) fn sample(&self, choice: f64, numbers: [f64; 2]) -> (TriangleSample, DVec3, bool) {
        let is_second = self.second_from <= choice * self.total;
        let select = |[a, b]: [f64; 2]| if is_second { b } else { a };
        let select_all =
            |[a, b]: [DVec3; 2]| DVec3::new(select([a.x, b.x]), select([a.y, b.y]), select([a.z, b.z]));
        let barycentrics = barycentrics_at(numbers);
        let [(first, is_near_first), (second, is_near_second)] =
            [self.triangles[0].point(barycentrics), self.triangles[1].point(barycentrics)];
        let position = select_all([first.position, second.position]);
        let point = SurfacePoint::new(position, select_all([first.reach, second.reach]));
        let (normal, density) = (select_all(self.normals), select(self.densities));
        let is_near = if is_second { is_near_second } else { is_near_first };
        (TriangleSample { point, normal, density }, select_all(self.radiances), is_near)
    }
}

/// The barycentrics of a uniform point of a triangle (Heitz, A Low-Distortion Map Between Triangle and Square, 2019).
#[inline(always)]
fn barycentrics_at([x, y]: [f64; 2]) -> [f64; 3] {
    let is_upper = y > x;
    let v = if is_upper { 0.5 * x } else { x - 0.5 * y };
    let w = if is_upper { y - 0.5 * x } else { 0.5 * y };
    [1.0 - v - w, v, w]
}

/// A point of an emissive triangle, sampled uniformly.
pub(crate) struct TriangleSample {
    /// The point, with what ray origins are computed from.
    pub(crate) point: SurfacePoint,
    /// A unit normal.
    pub(crate) normal: DVec3,
    /// The density per area.
    pub(crate) density: f64,
}

impl TriangleSample {
    /// The unit vector from `from` towards the point, the unit normal on the side of `from`, and the density per solid
    /// angle; 0 where the point cannot light `from`.
    #[inline(always)]
    pub(crate) fn seen_from(&self, from: DVec3) -> (DVec3, DVec3, f64) {
        let to_light = self.point.position - from;
        let scale = 1.0 / to_light.length();
        let direction = to_light * scale;
        let cosine = -direction.dot(self.normal);
        let turn = |c: f64| if cosine < 0.0 { -c } else { c };
        let normal = DVec3::new(turn(self.normal.x), turn(self.normal.y), turn(self.normal.z));
        let pdf = self.density * to_light.length_squared() / cosine.abs();
        let is_possible = (scale > 0.0) & (scale < f64::INFINITY) & (pdf > 0.0) & (pdf < f64::INFINITY);
        (direction, normal, if is_possible { pdf } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points near edges and corners are moved inwards as those of every triangle are.
    #[test]
    fn points_of_triangles_are_surface_points() {
        let triangle =
            Triangle([DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 2.5, 3.0), DVec3::new(1.5, 5.0, 2.0)]);
        let sampled = SampledTriangle::new(triangle);
        let nearly_one = 1.0 - f64::EPSILON / 2.0;
        let mut moved = 0;
        for numbers in [[0.0, 0.0], [0.5, 0.5], [0.3, 0.6], [nearly_one, 0.0], [0.0, nearly_one], [0.7, 0.2]]
        {
            let (sample, barycentrics) = sampled.sample(1.0, numbers).expect("a normal");
            let TriangleSample { point, normal, .. } = sample;
            assert_eq!(
                point,
                SurfacePoint::on_triangle(triangle.0, barycentrics, Numerics::Watertight),
                "{numbers:?}"
            );
            assert_eq!(Some(normal), triangle.unit_normal());
            moved += usize::from(point.start != point.position);
        }
        assert_eq!(moved, 3);
    }
}
