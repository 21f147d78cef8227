//! Numerically hard rays: through vertices, edges and lattice points, and along axes.

use glam::DVec3;
use kiln::bvh::Ray;

use super::{Corners, ray, single};
use crate::common::Numbers;

/// Kind of a target point on a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum At {
    Corner,
    EdgeMiddle,
    Edge,
    Inside,
    Centroid,
}

impl At {
    /// The points that neighbours share.
    pub const SHARED: [At; 3] = [At::Corner, At::EdgeMiddle, At::Edge];
    pub const ALL: [At; 5] = [At::Corner, At::EdgeMiddle, At::Edge, At::Inside, At::Centroid];

    /// A point of this kind on the triangle.
    pub fn of(self, corners: &Corners, numbers: &mut Numbers) -> DVec3 {
        let turn = numbers.below(3);
        let [a, b, c] = [corners[turn], corners[(turn + 1) % 3], corners[(turn + 2) % 3]];
        match self {
            At::Corner => a,
            At::EdgeMiddle => (a + b) / 2.0,
            At::Edge => a.lerp(b, numbers.unit()),
            At::Centroid => (a + b + c) / 3.0,
            At::Inside => {
                // Kept off the edges: each weight is a twentieth at least.
                let [u, v, w] = [(); 3].map(|()| 0.1 + numbers.unit());
                (a * u + b * v + c * w) / (u + v + w)
            }
        }
    }
}

/// Points of the triangles, each kind as often as the others.
pub fn targets(triangles: &[Corners], kinds: &[At], count: usize, numbers: &mut Numbers) -> Vec<DVec3> {
    (0..count)
        .map(|i| {
            let corners = triangles[numbers.below(triangles.len())];
            kinds[i % kinds.len()].of(&corners, numbers)
        })
        .collect()
}

/// All six directions along an axis, in all four patterns of signs that their zeros can have.
pub fn axes_with_signed_zeros() -> Vec<[DVec3; 4]> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            all.push([(0.0, 0.0), (0.0, -0.0), (-0.0, 0.0), (-0.0, -0.0)].map(|(u, v)| {
                let mut direction = DVec3::ZERO;
                direction[axis] = sign;
                direction[(axis + 1) % 3] = u;
                direction[(axis + 2) % 3] = v;
                direction
            }));
        }
    }
    all
}

/// All 26 directions with components -1, 0 and 1.
pub fn lattice_directions() -> Vec<DVec3> {
    let all = (0..27).map(|i| DVec3::new((i % 3) as f64, (i / 3 % 3) as f64, (i / 9) as f64) - 1.0);
    all.filter(|direction| *direction != DVec3::ZERO).collect()
}

/// Parallel rays over a square lattice of the plane across `axis`: from `low` to `high` in steps of `step`, both
/// coordinates, starting at `start` along the axis.
pub fn lattice(axis: usize, start: f64, (low, high): (f64, f64), step: f64, direction: DVec3) -> Vec<Ray> {
    let count = ((high - low) / step).round() as usize + 1;
    (0..count * count)
        .map(|i| {
            let mut origin = DVec3::splat(low);
            origin[axis] = start;
            origin[(axis + 1) % 3] += step * (i % count) as f64;
            origin[(axis + 2) % 3] += step * (i / count) as f64;
            ray(origin, direction)
        })
        .collect()
}

/// Rays at each target from around a centre: from points within the cube of the given half side.
pub fn from_around(centre: DVec3, half_side: f64, targets: &[DVec3], numbers: &mut Numbers) -> Vec<Ray> {
    targets.iter().map(|target| super::ray_towards(centre + numbers.vector() * half_side, *target)).collect()
}

/// Rays with numbers of few digits through each target, so that they pass it exactly: from `target - steps`, with steps
/// of whole numbers times a power of two, as far as f32 can hold the difference.
pub fn exactly_through(targets: &[DVec3], reach: i32, unit: f64, numbers: &mut Numbers) -> Vec<Ray> {
    let mut rays = Vec::new();
    for target in targets {
        let whole = |numbers: &mut Numbers| numbers.below(2 * reach as usize + 1) as f64 - f64::from(reach);
        let step = DVec3::new(whole(numbers), whole(numbers), whole(numbers)) * unit;
        let origin = *target - step;
        if step != DVec3::ZERO && origin == single(origin) {
            rays.push(ray(origin, step));
        }
    }
    rays
}
