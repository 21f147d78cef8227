//! Generalised winding numbers: of surfaces that are not closed, with bounds on their errors.
//!
//! The generalised winding number of a surface around a point q is the solid angle that it subtends there over 4 pi
//! (Jacobson, Kavan and Sorkine-Hornung, Robust Inside-Outside Segmentation using Generalized Winding Numbers, ACM
//! Transactions on Graphics 32(4), 2013): with `F(y) = y / |y|³`, it is the integral of `n . F(x - q) / 4 pi` over the
//! points x of the surface. A tree replaces distant triangles by a Taylor expansion (Barill, Dickson, Schmidt, Levin
//! and Jacobson, Fast Winding Numbers for Soups and Clouds, ACM Transactions on Graphics 37(4), 2018).
//!
//! # Expansion
//! With a centre p, `x = p + d`, `r = p - q` and `u = r / |r|`: 1 / |r + d| is the sum over k of
//! `(-1)^k h_k(d) / |r|^(k+1)`, where `h_k(d) = |d|^k P_k(u . d / |d|)` and P_k is a Legendre polynomial. F is minus
//! its gradient, so the terms of the winding number up to k = 3 are
//!
//! - `N . u / |r|²`, where N is the integral of n,
//! - `-3 M(u, u) / |r|³`, where M is that of `n d`, symmetric and without trace,
//! - `15/2 T(u, u, u) / |r|⁴`, where T is that of `n d d`, symmetric and without trace,
//!
//! over 4 pi. Symmetric parts without trace are enough, since u is contracted with harmonic polynomials: 15 numbers.
//!
//! # Error
//! The gradient of h_k has the square `|d|^(2k-2) (k² P² + (1 - c²) P'²)`, with P and P' at the cosine c. The sum
//! `P² + (1 - c²) P'² / (k (k + 1))` grows with |c|, since its derivative is `2 c P'² / (k (k + 1))` by Legendre's
//! equation, and is 1 at the ends. So the gradient is not longer than `(k + 1/2) |d|^(k-1)`. With |d| <= radius, t =
//! radius / |r| < 1 and A3 the integral of `(|d| / radius)³` over the surface in units of radius², what the terms
//! from k = 4 on add is at most `A3 t⁵ g(t) / 4 pi`, `g(t) = 9/2 + 11/2 t + 13/2 t² + ... = 9/2 / (1 - t) + t / (1 -
//! t)²`. A node is expanded where t is so small that this is below [`NODE_ERROR`](expansions::NODE_ERROR); elsewhere
//! its children are, and the triangles of a leaf have their solid angles exactly (van Oosterom and Strackee, The
//! Solid Angle of a Plane Triangle, IEEE Transactions on Biomedical Engineering 30(2), 1983). All numbers of a node
//! are in units of its radius, so that they neither overflow nor underflow.
//!
//! Rounding is bounded beside it, with u = 2^-53: see [`Node::rounding`](expansions::Node::rounding) and [`sums`].

mod expansions;
mod sums;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;

use super::crossings::{CONTAINS_DIRECTION, winding_ray};
use super::{Bvh, InsideRule, Primitive, Traversal};
use crate::geometry::Point;
use crate::geometry::simd::InstructionSet;
pub(super) use expansions::Expansions;

/// A winding number and how much it may be wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct WindingNumber {
    /// 1 well inside, 0 outside, -1 inside of a surface turned inside out; near a hole anything between.
    pub value: f64,
    /// A bound on the error of the value: 0 for a closed surface.
    pub error: f64,
}

impl WindingNumber {
    /// That of a closed surface; unknown for NaN and for a point too large for f32.
    pub(super) fn exact(point: DVec3, number: i32) -> Self {
        let error = if point.as_vec3().is_finite() { 0.0 } else { f64::INFINITY };
        WindingNumber { value: number.into(), error }
    }

    /// Whether the value exceeds 1/2, or is below -1/2.
    pub(super) fn is_inside(&self) -> bool {
        self.value.abs() > 0.5
    }

    /// The distance of the value from 1/2 or -1/2, less the error.
    pub(super) fn margin(&self) -> f64 {
        (self.value.abs() - 0.5).abs() - self.error
    }
}

impl Bvh {
    /// The generalised winding number around a point: the solid angle that the surface subtends there over 4 pi, by the
    /// sign of its sides. For a closed surface the number of [`Bvh::winding_number`], without error. For another it is
    /// continuous but at the surface itself, and changes little with small holes.
    ///
    /// `beta` is at least 1, the default for speed: distant triangles are summed up at `beta` times the distance that
    /// is allowed at 1. The error falls at least with its third power, and time grows with its second; at infinity
    /// every triangle is added by itself, and the error is that of rounding. A point on an edge of the surface has an
    /// error of about 1.
    ///
    /// For triangles as stored, with corners rounded to the tier's precision. A disk that is not distant adds an
    /// error of 1/2. The first call after building or [`Bvh::update`] takes O(n log² n) time and some 150 bytes of
    /// memory a triangle. The error is infinite for NaN, for a point too large for f32, and with user geometry that is
    /// not closed.
    pub fn generalised_winding_number(
        &self,
        point: impl Point,
        beta: f64,
        traversal: &mut Traversal,
    ) -> WindingNumber {
        let point = point.to_dvec3();
        if self.inside_rule() == InsideRule::Crossings {
            return WindingNumber::exact(point, self.winding_number(point, traversal));
        }
        let mut number = WindingNumber { value: 0.0, error: 0.0 };
        let set = &mut |_, found| number = found;
        self.expansions().evaluate(&[point], beta, InstructionSet::widest(), &mut Vec::new(), set);
        self.with_shapes(number, point, traversal)
    }

    /// The winding number with that of [`Bvh::user_geometries`]: exact for closed ones; of open ones 0, with an
    /// infinite error, as their solid angles are unknown.
    pub(super) fn with_shapes(
        &self,
        number: WindingNumber,
        point: DVec3,
        traversal: &mut Traversal,
    ) -> WindingNumber {
        let Some((shapes, ray)) = self.own_shapes().zip(winding_ray(point, CONTAINS_DIRECTION)) else {
            return number;
        };
        WindingNumber {
            value: number.value + f64::from(shapes.winding_number_of_closed(&ray, traversal)),
            error: if shapes.open() > 0 { f64::INFINITY } else { number.error },
        }
    }

    /// The expansions of the surface.
    pub(super) fn expansions(&self) -> &Arc<Expansions> {
        if let Some(known) = self.expansions.get() {
            return known;
        }
        // Not while the cell is locked: see `Bvh::closedness`.
        let found = match self.instances.parts() {
            Some(parts) => Expansions::of_parts(parts.iter().map(|part| part.expansions(self.numerics))),
            None => Expansions::new(self.oriented_primitives()),
        };
        self.expansions.get_or_init(|| Arc::new(found))
    }

    /// Every primitive once, in the order of ids.
    fn oriented_primitives(&self) -> Vec<Primitive> {
        // A split triangle is in several slots.
        let mut found = vec![None; self.ids() as usize];
        self.each_oriented(|prim, primitive| found[prim.0 as usize] = Some(primitive));
        found.into_iter().flatten().collect()
    }
}
