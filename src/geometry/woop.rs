//! The triangle test of the tiers that do not leak.
//!
//! Woop, Benthin and Wald, Watertight Ray/Triangle Intersection, JCGT 2(1) 2013, section 3, carried out in f64: the
//! vertices are sheared so that the ray is the third axis, and the hit is decided by three edge functions
//! `p.x * q.y - p.y * q.x` in the plane.
//!
//! Why f64 throughout rather than f32 with a fallback: in f64 the sheared corners are within a few 2^-53 of exact,
//! relative to their distance from the ray's origin, and each edge function has the exact sign of what it is computed
//! from: where its two products nearly cancel, their rounding errors are added, which are known exactly. So a hit is decided as
//! if exactly, for a triangle whose corners are moved by that little, and every triangle at a corner sees it at the same
//! place. With zero on the inside, a hit between two triangles that share an edge cannot be lost, and none is found beside a
//! triangle that is seen edge-on. No FMA: it would break the symmetry between the two sides of an edge.

use glam::DVec3;

use super::bounds::hold;
use super::bundle::{FourHits, FourRays, hit_four};
use super::expansion::{Expansion, two_product, two_sum};
use super::quad::{LANES, Quad};
use super::simd::Simd;
use super::{Corner, Ray, Triangle, TriangleHit};

/// A ray made ready for triangles.
#[derive(Clone, Copy)]
pub struct WoopTest {
    /// Axes turned, as are the inverses.
    origin: DVec3,
    /// The axis that the ray runs along most.
    along: Along,
    /// The two shears, and the reciprocal of the direction along that axis.
    pub shear: [f64; 3],
    /// Reciprocals of the direction.
    inverse: [f64; 3],
    /// The ends.
    t_min: f64,
    t_max: f64,
    /// All lanes of four where the direction has a 0: the box of a triangle has to be asked in another way then.
    pub odd: u32,
}

/// The axis that a ray runs along most; the first of those that are alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Along {
    /// Of a ray. Without branches: which axis it is, is as good as random.
    #[inline(always)]
    pub fn of(ray: &Ray) -> Self {
        let length = ray.direction.abs();
        let x_first = length.x >= length.y && length.x >= length.z;
        [[Along::Z, Along::Y], [Along::X; 2]][usize::from(x_first)][usize::from(length.y >= length.z)]
    }

    /// The axes turned so that this one is the last.
    #[inline(always)]
    pub fn axes(self) -> [usize; 3] {
        [[1, 2, 0], [2, 0, 1], [0, 1, 2]][self as usize]
    }

    /// A vector with its axes turned so; written out, they stay in registers.
    #[inline(always)]
    pub fn turned(self, v: DVec3) -> DVec3 {
        match self {
            Along::X => DVec3::new(v.y, v.z, v.x),
            Along::Y => DVec3::new(v.z, v.x, v.y),
            Along::Z => v,
        }
    }

    /// Where each axis is then.
    #[inline(always)]
    pub fn places(self) -> [usize; 3] {
        [[2, 0, 1], [1, 2, 0], [0, 1, 2]][self as usize]
    }
}

/// A triangle seen along a ray: its corners from the ray's origin, axes turned so that the ray runs along the third,
/// and what is left of them across the ray.
pub struct Sheared {
    /// The corners.
    pub corners: [DVec3; 3],
    /// How far they lie aside of the ray.
    pub aside: [[f64; 2]; 3],
}

impl WoopTest {
    /// Prepares `ray`.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let (d, along) = (ray.direction, Along::of(ray));
        let turned = along.turned(d);
        let inverse = turned.recip();
        WoopTest {
            origin: along.turned(ray.origin),
            along,
            shear: [turned.x * inverse.z, turned.y * inverse.z, inverse.z],
            inverse: inverse.to_array(),
            t_min: ray.t_min,
            t_max: ray.t_max,
            odd: if d.cmpeq(DVec3::ZERO).any() { (1 << LANES) - 1 } else { 0 },
        }
    }

    /// The triangle seen along the ray.
    #[inline(always)]
    pub fn sheared<C: Corner>(&self, [a, b, c]: &[C; 3]) -> Sheared {
        let from_origin = |corner: &C| self.along.turned(corner.raise()) - self.origin;
        let corners = [from_origin(a), from_origin(b), from_origin(c)];
        let aside = |v: DVec3| [v.x - self.shear[0] * v.z, v.y - self.shear[1] * v.z];
        Sheared { corners, aside: corners.map(aside) }
    }

    /// What [`WoopTest::hit`] says of each triangle of `quad`, as far as that can be told for all at once.
    #[inline(always)]
    pub fn hit_quad<S: Simd, C: Corner>(&self, quad: &Quad<C>) -> FourHits {
        hit_four::<S>(&self.seen::<S, C>(quad), &self.four_times::<S>(), self.odd, false)
    }

    /// The corners of a quad from the origin, axes turned.
    #[inline(always)]
    fn seen<S: Simd, C: Corner>(&self, quad: &Quad<C>) -> [[S::D4; 3]; 3] {
        let axes = self.along.axes();
        let [x, y, z] = self.origin.to_array();
        let origin = [S::d4_splat(x), S::d4_splat(y), S::d4_splat(z)];
        let mut seen = [origin; 3];
        for (corner, seen) in quad.corners.iter().zip(&mut seen) {
            for place in 0..3 {
                seen[place] = S::d4_sub(C::to_d4::<S>(corner[axes[place]]), origin[place]);
            }
        }
        seen
    }

    /// This ray as four rays.
    #[inline(always)]
    fn four_times<S: Simd>(&self) -> FourRays<S> {
        let [[sx, sy, _], [x, y, z]] = [self.shear, self.inverse];
        let inverse = [S::d4_splat(x), S::d4_splat(y), S::d4_splat(z)];
        FourRays {
            shear: [S::d4_splat(sx), S::d4_splat(sy), inverse[2]],
            inverse,
            t_min: S::d4_splat(self.t_min),
            t_max: S::d4_splat(self.t_max),
        }
    }

    /// Where `ray`, for which this was made, hits the triangle within the ray's ends.
    #[inline(always)]
    pub fn hit<C: Corner>(&self, ray: &Ray, corners: &[C; 3]) -> Option<TriangleHit> {
        let sheared = self.sheared(corners);
        // Rounded, a sign is right or zero: whatever has opposite signs is missed, and most triangles are.
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
        // Close to the origin the depth's error may be larger than the depth: above all on needles.
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        let is_near = depth.abs() < reach * NEAR;
        if is_near && is_behind(ray, corners, &sheared, sum, self.shear[2]) {
            return None;
        }
        let t = depth * self.shear[2];
        let [min, max] = C::span(corners);
        let t = hold(min, max, ray, t)?;
        // It is ahead, whatever its rounded distance says.
        let t = if is_near { t.max(f64::MIN_POSITIVE) } else { t };
        (ray.t_min < t && t < ray.t_max)
            .then_some(TriangleHit { t, weights: [weight_b * share, weight_c * share] })
    }
}

impl Sheared {
    /// The edge functions, each proportional to the weight of the corner opposite.
    #[inline(always)]
    pub fn weights(&self) -> [f64; 3] {
        let [[ax, ay], [bx, by], [cx, cy]] = self.aside;
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }

    /// The same, computed anew where the products of one nearly cancel.
    #[inline(always)]
    fn weights_with_exact_signs(&self, weights: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.aside;
        let exact = |p: [f64; 2], q: [f64; 2], weight: f64| {
            if weight.abs() > CANCELLED * (p[0] * q[1]).abs() { weight } else { cancelled(p, q) }
        };
        [exact(c, b, weights[0]), exact(a, c, weights[1]), exact(b, a, weights[2])]
    }
}

/// Whether the origin lies on or beyond the plane of a triangle that the ray's line meets. Exact: of the corners as given, or for slivers of
/// the sheared corners. `sum` is that of its edge functions, `inverse` the reciprocal of the direction along the third axis.
///
/// The crossing lies ahead if the corners' determinant, seen from the origin, has the opposite sign of `sum` times `inverse`. Shearing keeps the
/// determinant but rounds corners, which can turn a sliver over: then `sum` says how it lies when sheared, and so must the determinant. All
/// sheared triangles together have no gaps, so an origin inside a closed mesh has a crossing ahead in every direction.
#[inline(never)]
fn is_behind<C: Corner>(ray: &Ray, corners: &[C; 3], sheared: &Sheared, sum: f64, inverse: f64) -> bool {
    let against = sum.signum() * inverse.signum();
    let corners = corners.map(Corner::raise);
    let [a, b, c] = sheared.corners;
    let reach = |v: DVec3| v.abs().max_element();
    // Sheared coordinates are off by 3 u of their corner's reach and no larger than twice that; see `side` in `bundle`.
    let bound = 128.0 * f64::EPSILON * reach(a) * reach(b) * reach(c);
    let determinant = a.dot(b.cross(c));
    if determinant.abs() > bound {
        return determinant * against >= 0.0;
    }
    let origin = ray.origin;
    let sides = corners.map(|corner| [0, 1, 2].map(|k| Expansion::difference(corner[k], origin[k])));
    let sign = sign_of_determinant(&sides);
    let most = reach(a).max(reach(b)).max(reach(c));
    // The sum of the edge functions is off by 96 u for the sheared corners and 36 u for itself, of the square of the reach.
    let is_sliver = sum.abs() <= 128.0 * f64::EPSILON * most * most;
    if sign != 0 && !is_sliver {
        return f64::from(sign) * against >= 0.0;
    }
    if sign == 0 && !Triangle(corners).is_degenerate() {
        return true;
    }
    let number = |x: f64| Expansion::difference(x, 0.0);
    let sheared = [0, 1, 2].map(|k| {
        let [x, y] = sheared.aside[k];
        [number(x), number(y), number(sheared.corners[k].z)]
    });
    f64::from(sign_of_determinant(&sheared)) * against >= 0.0
}

/// The sign of the determinant of three rows.
fn sign_of_determinant([a, b, c]: &[[Expansion; 3]; 3]) -> i32 {
    let term = |(k, i, j): (usize, usize, usize)| {
        a[k].clone() * (b[i].clone() * c[j].clone() - b[j].clone() * c[i].clone())
    };
    let terms = [(0, 1, 2), (1, 2, 0), (2, 0, 1)].map(term);
    terms.into_iter().fold(Expansion::default(), |sum, term| sum + term).sign()
}

/// Whether all are on the same side, zeros on both.
#[inline(always)]
fn inside([a, b, c]: [f64; 3]) -> bool {
    (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0)
}

/// The share of a triangle's largest depth below which its distance is not trusted to tell whether it lies ahead.
pub const NEAR: f64 = 1.0 / 64.0;

/// Differences below this share of the products are computed to their last place. Above it the error is that of two
/// roundings in at least 33 remaining places.
pub const CANCELLED: f64 = 1.0 / (1u32 << 20) as f64;

/// `p.x * q.y - p.y * q.x` where the products nearly cancel, with its exact sign: their rounded difference is exact then,
/// and so are their rounding errors.
#[cold]
fn cancelled(p: [f64; 2], q: [f64; 2]) -> f64 {
    let ((left, left_error), (right, right_error)) = (two_product(p[0], q[1]), two_product(p[1], q[0]));
    let (errors, last) = two_sum(left_error, -right_error);
    let (sum, error) = two_sum(left - right, errors);
    sum + (error + last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::expansion::Expansion;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// Vectors that are nearly or exactly parallel: the sign is that of exact arithmetic, the value good to the share
        /// of the products that is left when they do not cancel; and exchanging the two gives the negative.
        #[test]
        fn determinants_have_their_exact_sign(
            p in prop::array::uniform2(-1.0f64..1.0),
            factor in prop_oneof![-4.0f64..4.0, (-4i32..4).prop_map(f64::from)],
            steps in prop::array::uniform2(-3i64..=3),
            aside in prop::sample::select(vec![0.0, 1e-17, 1e-9, 1e-5, 0.1]),
        ) {
            let moved = |x: f64, by: i64| f64::from_bits((x.to_bits() as i64 + by) as u64);
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
}
