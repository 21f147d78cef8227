//! The watertight triangle test of the tiers `watertight` and `double`, and the f64 filter of `exact`.
//!
//! Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, JCGT 2(1) 2013, section 3, carried out in f64: the
//! vertices are sheared so that the ray is the third axis, and three edge functions `p.x * q.y - p.y * q.x` in that
//! plane decide the hit.
//!
//! The sheared corners are within a few 2^-53 of exact, relative to their distance from the ray's origin. Each edge
//! function has the exact sign of the sheared corners' determinant: where its two products nearly cancel, their
//! rounding errors, which are known exactly, are added. So a hit is decided exactly for a triangle whose corners are
//! moved by a few 2^-53 of their distance, and all triangles at a corner see it at the same place. Zero counts as
//! inside: no ray passes between two triangles that share an edge, and none hits beside a triangle seen edge-on.
//! Without FMA, which would break the symmetry between the two sides of an edge.
//!
//! In the bounds, u = 2^-53. The test for a pair in each lane is in [`super::woop_n`], that of one ray and four triangles
//! in [`super::woop_packet`].

use glam::DVec3;

use super::bounds::{clamp_near, clamp_to_bounds};
use super::expansion::{Expansion, two_product, two_sum};
use super::lanes::MASK4;
use super::{Corner, Ray, Triangle, TriangleHit};

/// A ray prepared for triangles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WoopTest {
    /// Axes permuted so that the major axis is the third.
    pub(super) origin: DVec3,
    pub(super) major: MajorAxis,
    /// The two shears.
    pub(super) shear: [f64; 2],
    /// 1 with the sign of the direction along the major axis.
    pub(super) sign: f64,
    /// Reciprocals of the direction, axes permuted.
    pub(super) inverse: [f64; 3],
    pub(super) t_min: f64,
    pub(super) t_max: f64,
    /// [`MASK4`] if a direction component is 0, else 0: the four-wide clamp to the triangle's bounds does not
    /// handle 0 times infinity.
    pub zero_direction_mask: u32,
}

/// The axis of a ray's largest direction component; the first of equal ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum MajorAxis {
    /// x.
    #[default]
    X,
    /// y.
    Y,
    /// z.
    Z,
}

impl MajorAxis {
    /// The major axis of a direction. Without branches, which would be mispredicted.
    #[inline(always)]
    pub(crate) fn of(direction: DVec3) -> Self {
        let length = direction.abs();
        Self::of_order(length.x >= length.y && length.x >= length.z, length.y >= length.z)
    }

    /// The major axis of a direction whose x is not below the others (`x_first`), or whose y is not below its z.
    #[inline(always)]
    pub(crate) fn of_order(x_first: bool, y_first: bool) -> Self {
        [[MajorAxis::Z, MajorAxis::Y], [MajorAxis::X; 2]][usize::from(x_first)][usize::from(y_first)]
    }

    /// The even permutation of the axes with this one last.
    #[inline(always)]
    pub(crate) fn axes(self) -> [usize; 3] {
        // A reference: else the table is copied to the stack before it is read.
        const AXES: &[[usize; 3]; 3] = &[[1, 2, 0], [2, 0, 1], [0, 1, 2]];
        AXES[self as usize]
    }

    /// A vector with its axes permuted by [`MajorAxis::axes`]; written out, so that it stays in registers.
    #[inline(always)]
    pub(crate) fn permuted(self, v: DVec3) -> DVec3 {
        match self {
            MajorAxis::X => DVec3::new(v.y, v.z, v.x),
            MajorAxis::Y => DVec3::new(v.z, v.x, v.y),
            MajorAxis::Z => v,
        }
    }
}

/// A triangle relative to a ray's origin, axes permuted so that the ray's major axis is the third.
pub(crate) struct Sheared {
    /// The corners, not sheared.
    pub corners: [DVec3; 3],
    /// x and y of the sheared corners: the ray is at (0, 0).
    pub sheared_xy: [[f64; 2]; 3],
}

impl WoopTest {
    /// Prepares `ray`.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let major = MajorAxis::of(ray.direction);
        let (origin, direction) = (major.permuted(ray.origin), major.permuted(ray.direction));
        let inverse = direction.recip();
        WoopTest {
            origin,
            major,
            shear: [direction.x * inverse.z, direction.y * inverse.z],
            sign: 1f64.copysign(direction.z),
            inverse: inverse.to_array(),
            t_min: ray.t_min,
            t_max: ray.t_max,
            zero_direction_mask: if direction.cmpeq(DVec3::ZERO).any() { MASK4 } else { 0 },
        }
    }

    /// The triangle relative to the ray.
    #[inline(always)]
    pub(crate) fn sheared<C: Corner>(&self, [a, b, c]: &[C; 3]) -> Sheared {
        let from_origin = |corner: &C| self.major.permuted(corner.to_dvec3()) - self.origin;
        let corners = [from_origin(a), from_origin(b), from_origin(c)];
        let sheared_xy = |v: DVec3| [v.x - self.shear[0] * v.z, v.y - self.shear[1] * v.z];
        Sheared { corners, sheared_xy: corners.map(sheared_xy) }
    }

    /// The hit of `ray`, for which this was prepared, on a triangle, with `t_min < t < t_max`.
    #[inline(always)]
    pub(crate) fn hit<C: Corner>(&self, ray: &Ray, corners: &[C; 3]) -> Option<TriangleHit> {
        let sheared = self.sheared(corners);
        // A rounded sign is right or zero, so opposite signs are a certain miss. Most triangles are missed.
        let weights = sheared.weights();
        if !inside(weights) {
            return None;
        }
        let weights @ [weight_a, weight_b, weight_c] = sheared.weights_with_exact_signs(weights);
        let sum = weight_a + weight_b + weight_c;
        if !inside(weights) || sum == 0.0 {
            return None;
        }
        let share = 1.0 / sum;
        // A convex combination of the corners' depths: its error is relative to the triangle, not to the scene.
        let [a, b, c] = sheared.corners;
        let depth = (weight_a * a.z + weight_b * b.z + weight_c * c.z) * share;
        // Near the origin the depth's error may exceed the depth, above all on needles.
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        let is_near = depth.abs() < reach * NEAR;
        let computed = depth * self.inverse[2];
        let [min, max] = C::span(corners);
        let clamped = clamp_to_bounds(min, max, ray, computed);
        // Bounds ahead but not the computed depth: the triangle is seen too nearly edge-on for that.
        let is_unclear = is_near || computed <= 0.0 && clamped.is_some_and(|t| t > 0.0);
        if is_unclear && is_behind(ray, corners, &sheared, sum, self.sign) {
            return None;
        }
        let t = match clamped {
            Some(t) => t,
            None if is_near => clamp_near(min, max, ray, computed, reach)?,
            None => return None,
        };
        // Ahead by the exact test, whatever the sign of the rounded distance.
        let t = if is_near { t.max(f64::MIN_POSITIVE) } else { t };
        (ray.t_min < t && t < ray.t_max)
            .then_some(TriangleHit { t, barycentrics: [weight_b * share, weight_c * share] })
    }
}

impl Sheared {
    /// The edge functions, each proportional to the barycentric of the corner opposite.
    #[inline(always)]
    pub(crate) fn weights(&self) -> [f64; 3] {
        let [[ax, ay], [bx, by], [cx, cy]] = self.sheared_xy;
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }

    /// The same, recomputed where the two products of one nearly cancel.
    #[inline(always)]
    fn weights_with_exact_signs(&self, weights: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.sheared_xy;
        let exact = |p: [f64; 2], q: [f64; 2], weight: f64| {
            if weight.abs() > CANCELLED * (p[0] * q[1]).abs() { weight } else { cancelled(p, q) }
        };
        [exact(c, b, weights[0]), exact(a, c, weights[1]), exact(b, a, weights[2])]
    }
}

/// Whether the origin lies on or beyond the plane of a triangle that the ray's line crosses. Exact for the corners as
/// given; for slivers, exact for the sheared corners. `sum` is the sum of the edge functions, `along` has the
/// sign of the direction along the third axis.
///
/// The crossing lies ahead if the corners' determinant, relative to the origin, has the opposite sign of `sum *
/// along`. Shearing keeps the determinant but rounds corners, which can turn a sliver over: `sum` is then that of
/// the sheared sliver, so the determinant must be, too. All sheared triangles together have no gaps, so an origin
/// inside a closed mesh has a crossing ahead in every direction.
#[inline(never)]
fn is_behind<C: Corner>(ray: &Ray, corners: &[C; 3], sheared: &Sheared, sum: f64, along: f64) -> bool {
    let against = sum.signum() * along;
    let corners = corners.map(Corner::to_dvec3);
    let [a, b, c] = sheared.corners;
    let reach = |v: DVec3| v.abs().max_element();
    // Sheared coordinates are off by 3 u of their corner's reach and no larger than twice that; see `side` in `woop_n`.
    let bound = 128.0 * f64::EPSILON * reach(a) * reach(b) * reach(c);
    let determinant = a.dot(b.cross(c));
    if determinant.abs() > bound {
        return determinant * against >= 0.0;
    }
    let origin = ray.origin;
    let sides = corners.map(|corner| [0, 1, 2].map(|k| Expansion::difference(corner[k], origin[k])));
    let sign = sign_of_determinant(&sides);
    let most = reach(a).max(reach(b)).max(reach(c));
    // The sum of the edge functions is off by 96 u for the sheared corners and 36 u for itself, of the square of the
    // reach.
    let is_sliver = sum.abs() <= 128.0 * f64::EPSILON * most * most;
    if sign != 0 && !is_sliver {
        return f64::from(sign) * against >= 0.0;
    }
    if sign == 0 && !Triangle(corners).is_degenerate() {
        return true;
    }
    let number = |x: f64| Expansion::difference(x, 0.0);
    let sheared = [0, 1, 2].map(|k| {
        let [x, y] = sheared.sheared_xy[k];
        [number(x), number(y), number(sheared.corners[k].z)]
    });
    f64::from(sign_of_determinant(&sheared)) * against >= 0.0
}

/// The sign of the determinant of three rows.
pub(crate) fn sign_of_determinant([a, b, c]: &[[Expansion; 3]; 3]) -> i32 {
    let term = |(k, i, j): (usize, usize, usize)| {
        a[k].clone() * (b[i].clone() * c[j].clone() - b[j].clone() * c[i].clone())
    };
    let terms = [(0, 1, 2), (1, 2, 0), (2, 0, 1)].map(term);
    terms.into_iter().fold(Expansion::default(), |sum, term| sum + term).sign()
}

/// Whether all have the same sign; zeros have both.
#[inline(always)]
fn inside([a, b, c]: [f64; 3]) -> bool {
    (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0)
}

/// The share of a triangle's largest coordinate, relative to the origin, below which a rounded depth does not decide
/// whether the hit lies ahead.
pub(crate) const NEAR: f64 = 1.0 / 64.0;

/// The share of its products below which an edge function is recomputed with their rounding errors. Above it, at
/// least 33 bits remain, with the error of two roundings.
pub(crate) const CANCELLED: f64 = 1.0 / (1u32 << 20) as f64;

/// `p.x * q.y - p.y * q.x` with its exact sign, for products that nearly cancel: their difference is then exact
/// (Sterbenz), and so are their rounding errors.
#[cold]
fn cancelled(p: [f64; 2], q: [f64; 2]) -> f64 {
    let ((left, left_error), (right, right_error)) = (two_product(p[0], q[1]), two_product(p[1], q[0]));
    let (errors, last) = two_sum(left_error, -right_error);
    let (sum, error) = two_sum(left - right, errors);
    sum + (error + last)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::geometry::PreparedRay;
    use crate::geometry::lanes::Triangle4;
    use crate::geometry::simd::Portable;
    use proptest::prelude::*;
    use proptest::test_runner::TestRunner;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// For nearly or exactly parallel vectors, the sign is that of exact arithmetic, the value as good as if the
        /// products did not cancel, and swapping the vectors negates it.
        #[test]
        fn determinants_have_their_exact_sign(
            p in prop::array::uniform2(-1.0f64..1.0),
            factor in prop_oneof![-4.0f64..4.0, (-4i32..4).prop_map(f64::from)],
            steps in prop::array::uniform2(-3i64..=3),
            aside in prop::sample::select(vec![0.0, 1e-17, 1e-9, 1e-5, 0.1]),
        ) {
            let moved = |x: f64, by: i64| f64::from_bits(x.to_bits().wrapping_add_signed(by));
            let q = [moved(p[0] * factor, steps[0]), moved(p[1] * factor + aside, steps[1])];
            prop_assume!(q[0].is_finite() && q[1].is_finite());
            let difference = |a: f64| Expansion::difference(a, 0.0);
            let exact = difference(p[0]).scaled(q[1]) - difference(p[1]).scaled(q[0]);
            let determinant = |p: [f64; 2], q: [f64; 2]| {
                let plain = p[0] * q[1] - p[1] * q[0];
                if plain.abs() > CANCELLED * (p[0] * q[1]).abs() { plain } else { cancelled(p, q) }
            };
            let found = determinant(p, q);
            let sign = if found == 0.0 { 0 } else { found.signum() as i32 };
            prop_assert_eq!(sign, exact.sign());
            prop_assert!((found - exact.estimate()).abs() <= f64::EPSILON / CANCELLED * exact.estimate().abs());
            prop_assert_eq!(determinant(q, p), -found);
        }
    }

    /// Triangles whose plane passes so near to the origin, relative to the bound of `side`, that f64 just decides or does not
    /// decide which side of it the origin lies on; seen edge-on, from either side, by rays through a point of them.
    #[test]
    fn four_triangles_are_hit_as_one_at_the_bound_of_the_sides() {
        type Case = ([[f64; 3]; 2], [i32; 3], [f64; 2], [f64; 4], [f64; 2], [bool; 2], [f64; 3], f64);
        let unit = || prop::array::uniform3(-1.0f64..1.0);
        let heights =
            prop::sample::select(vec![0.0, 0.1, 0.3, 0.6, 0.9, 1.0, 1.1, 2.0, 10.0, 1e3, 1e9, 1e14, 1e17]);
        let cases = (
            [unit(), unit()],
            prop::array::uniform3(-24i32..=0),
            prop::array::uniform2(-2.0f64..2.0),
            prop::array::uniform4(heights),
            prop::array::uniform2(prop_oneof![0.0f64..0.5, Just(0.0)]),
            prop::array::uniform2(prop::bool::ANY),
            prop::array::uniform3(prop_oneof![Just(0.0), -1.0f64..1.0]),
            prop::sample::select(vec![0.0, 1e-18, 1e-16, 1e-14, 1e-12, 1e-3]),
        );
        // Triangles that are hit; that lie behind the origin and are dropped; that are not, as f64 does not say so; and
        // that the test of four leaves undecided.
        let counts = [const { Cell::new(0) }; 4];
        let test = |(points, sizes, [along_a, along_b], heights, [v, w], sides, origin, aside): Case| {
            let [p, q] = points.map(DVec3::from);
            prop_assume!(p.cross(q).length() > 1e-3);
            let normal = p.cross(q).normalize();
            let [size_a, size_b, size_c] = sizes.map(f64::from).map(f64::exp2);
            let origin = DVec3::from(origin);
            let corners = |height: f64| {
                let bound = height * 128.0 * f64::EPSILON * if sides[0] { 1.0 } else { -1.0 };
                let third = p * along_a + q * along_b + normal * bound;
                [p * size_a, q * size_b, third * size_c].map(|corner| origin + corner)
            };
            let four = heights.map(corners);
            let through = four[0][0] * (1.0 - v - w) + four[0][1] * v + four[0][2] * w - origin;
            let direction =
                (through + normal * (aside * through.length())) * if sides[1] { 1.0 } else { -1.0 };
            prop_assume!(direction.abs().min_element() > 0.0);
            let ray = Ray { origin, direction: direction.normalize(), t_min: 0.0, t_max: f64::INFINITY };
            let back = Ray { direction: -ray.direction, ..ray };
            let (test, backwards) = (WoopTest::new(&ray), WoopTest::new(&back));
            let mut triangles = Triangle4::<DVec3>::EMPTY;
            for (lane, triangle) in four.iter().enumerate() {
                triangles.set(lane, triangle);
            }
            let may_hit = test.may_hit4::<_, Portable>(&triangles);
            let hits = [
                test.hit_triangle4::<_, Portable, true>(&triangles),
                test.hit_triangle4::<_, Portable, false>(&triangles),
            ];
            for (lane, triangle) in four.iter().enumerate() {
                let (one, behind) = (test.hit(&ray, triangle), backwards.hit(&back, triangle));
                let (may_hit, is_undecided) = (may_hit >> lane & 1 != 0, hits[1].undecided >> lane & 1 != 0);
                prop_assert!(one.is_none() || may_hit, "{one:?} {ray:?} {triangle:?}");
                for hits in &hits {
                    let found = (hits.hit >> lane & 1 != 0).then(|| hits.t[lane].to_bits());
                    let is_decided = hits.undecided >> lane & 1 == 0;
                    prop_assert!(
                        !is_decided || found == one.map(|hit| hit.t.to_bits()),
                        "{ray:?} {triangle:?}"
                    );
                }
                let occurs =
                    [one.is_some(), behind.is_some() && !may_hit, behind.is_some() && may_hit, is_undecided];
                counts
                    .iter()
                    .zip(occurs)
                    .for_each(|(count, occurs)| count.set(count.get() + u32::from(occurs)));
            }
            Ok(())
        };
        let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) };
        let result = TestRunner::new(config).run(&cases, test);
        result.unwrap_or_else(|error| panic!("{error}"));
        let counts = counts.map(Cell::into_inner);
        // Each occurs in a share of the 16,000 that no change of the random numbers leaves empty.
        assert!(
            counts.iter().zip([1000, 1000, 100, 1000]).all(|(&count, least)| count > least),
            "{counts:?}"
        );
    }
}
