//! Bounding boxes in f32, directed rounding, and the margins of box tests.

use glam::{DVec3, Vec3};

use super::Ray;
use super::lanes::RayN;
use super::simd::Doubles;

/// An axis-aligned f32 box, borders included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest f32 box around the f64 box from `min` to `max`.
    pub fn rounded_out(min: DVec3, max: DVec3) -> Self {
        Bounds { min: per_axis(min, round_down), max: per_axis(max, round_up) }
    }

    /// [`Bounds::rounded_out`] of triangles, or of parts of them, with coordinates of at most `reach`; planes near 0
    /// are moved outwards by [`NEAR_ZERO`].
    pub(crate) fn of_triangles([min, max]: [DVec3; 2], reach: f64) -> Self {
        let moved = |x: f64, by: f64| if x.abs() < reach * NEAR_ZERO.0 { x + reach * by } else { x };
        Self::rounded_out(min.map(|x| moved(x, -NEAR_ZERO.1)), max.map(|x| moved(x, NEAR_ZERO.1)))
    }

    /// [`Bounds::of_triangles`] for a triangle's own bounds.
    #[inline(always)]
    pub(crate) fn grown_near_zero(self) -> Self {
        let (least, most) = (self.min.abs().min(self.max.abs()), self.min.abs().max(self.max.abs()));
        let reach = f64::from(most.max_element());
        if f64::from(least.min_element()) < reach * NEAR_ZERO.0 {
            return Self::of_triangles([self.min.as_dvec3(), self.max.as_dvec3()], reach);
        }
        self
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box of what both contain; inverted on an axis on which they are apart.
    pub fn intersection(self, other: Self) -> Self {
        Bounds { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Half the surface area.
    pub fn half_area(&self) -> f32 {
        let size = self.max - self.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// The unit in the last place of the largest coordinate.
    pub fn ulp(&self) -> f32 {
        let largest = self.min.abs().max(self.max.abs()).max_element();
        largest.next_up() - largest
    }

    /// This box, enlarged by `below` at its lower and `above` at its upper planes.
    pub fn grown(self, below: Vec3, above: Vec3) -> Self {
        Bounds { min: self.min - below, max: self.max + above }
    }
}

/// `t` clamped to the interval in which `ray` is inside the box from `min` to `max`; `None` if there is no such
/// interval, up to [`DOUBLE_MARGIN`].
///
/// The distances of the planes take one subtraction, one reciprocal and one multiplication each, so they are good to
/// 2 ulp even where the primitive test cancels. A node that contains this box then contains the hit, whatever the
/// error of `t`; and on an axis-aligned triangle the result is the distance of the plane.
#[inline(always)]
pub(crate) fn clamp_to_bounds(min: DVec3, max: DVec3, ray: &Ray, t: f64) -> Option<f64> {
    let inverse = ray.direction.recip();
    let downwards = inverse.cmplt(DVec3::ZERO);
    let near = (DVec3::select(downwards, max, min) - ray.origin) * inverse;
    let far = (DVec3::select(downwards, min, max) - ray.origin) * inverse;
    // NaN, from a ray in a plane of the box (0 times infinity), is never taken. Other distances on an axis of zero
    // direction are infinite and do not clamp.
    let up = |t: f64, bound: f64| if bound > t { bound } else { t };
    let down = |t: f64, bound: f64| if bound < t { bound } else { t };
    let enter = up(up(up(f64::NEG_INFINITY, near.x), near.y), near.z);
    let leave = down(down(down(f64::INFINITY, far.x), far.y), far.z);
    (enter <= leave * DOUBLE_MARGIN).then(|| up(down(t, leave), enter))
}

/// [`clamp_to_bounds`] with bounds enlarged by [`CORNER_ERROR`] times `reach`, the largest coordinate of the triangle
/// relative to the ray's origin: for a hit that the triangle test finds ahead and nearer than [`DOUBLE_MARGIN`] covers.
///
/// The triangle test sees corners moved by that much at most, so the exact ray has a point in these bounds. A node that
/// contains the triangle is entered for it, too: see [`NEAR_ZERO`].
#[cold]
pub(crate) fn clamp_near(min: DVec3, max: DVec3, ray: &Ray, t: f64, reach: f64) -> Option<f64> {
    let slack = CORNER_ERROR * reach;
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let inverse = ray.direction[axis].recip();
        let low = (min[axis] - ray.origin[axis] - slack) * inverse;
        let high = (max[axis] - ray.origin[axis] + slack) * inverse;
        // NaN, of 0 times infinity, does not clamp.
        enter = enter.max(low.min(high));
        leave = leave.min(low.max(high));
    }
    (enter <= leave * DOUBLE_MARGIN).then(|| t.min(leave).max(enter))
}

/// The interval in which the ray in each lane is inside the bounds there, for [`clamp_to_bounds`] in f64.
pub(super) struct BoundsInterval<D> {
    enter: D,
    leave: D,
    /// The rays that have one, up to [`DOUBLE_MARGIN`].
    pub passes: u32,
    /// The rays that this is sure of: those without a direction component of 0.
    pub sure: u32,
}

impl<D: Doubles> BoundsInterval<D> {
    /// For bounds of the given centres and half sizes, by the operations of [`clamp_to_bounds`].
    #[inline(always)]
    pub(super) fn new(centre: &[D; 3], half: &[D; 3], rays: &RayN<D>) -> Self {
        let (mut enter, mut leave) = (D::splat(f64::NEG_INFINITY), D::splat(f64::INFINITY));
        let mut sure = D::ALL;
        for axis in 0..3 {
            let inverse = D::splat(1.0) / rays.direction[axis];
            sure &= inverse.abs().lt(D::splat(f64::INFINITY));
            let low = (centre[axis] - half[axis] - rays.origin[axis]) * inverse;
            let high = (centre[axis] + half[axis] - rays.origin[axis]) * inverse;
            enter = low.min(high).max(enter);
            leave = low.max(high).min(leave);
        }
        BoundsInterval { enter, leave, passes: enter.le(leave * D::splat(DOUBLE_MARGIN)), sure }
    }

    /// Distances clamped to it.
    #[inline(always)]
    pub(super) fn clamp(&self, t: D) -> D {
        self.enter.max(self.leave.min(t))
    }
}

fn per_axis(v: DVec3, f: impl Fn(f64) -> f32) -> Vec3 {
    Vec3::new(f(v.x), f(v.y), f(v.z))
}

/// `x` rounded to f32, upwards if `side` is above 0, downwards if below, to nearest if it is 0.
///
/// Without branches on the numbers, which would be mispredicted.
#[inline(always)]
pub(crate) fn round_towards(x: f64, side: f64) -> f32 {
    let y = x as f32;
    if y == 0.0 {
        return if side > 0.0 { round_up(x) } else { round_down(x) };
    }
    let short = (x - f64::from(y)) * side > 0.0;
    let larger = (side > 0.0) == (y > 0.0);
    let step = if larger { 1 } else { u32::MAX };
    f32::from_bits(y.to_bits().wrapping_add(if short { step } else { 0 }))
}

/// The largest f32 that is not above `x`.
#[inline(always)]
pub(crate) fn round_down(x: f64) -> f32 {
    -round_up(-x)
}

/// The smallest f32 that is not below `x`.
#[inline(always)]
pub(crate) fn round_up(x: f64) -> f32 {
    let y = x as f32;
    let bits = y.to_bits();
    // The next number up. `y < x` excludes NaN, +infinity and -0.
    let next = if y.is_sign_negative() { bits.wrapping_sub(1) } else { bits + 1 };
    if f64::from(y) < x { f32::from_bits(next) } else { y }
}

/// The margin of the f32 box test: at least (1 + 2 γ3) (1 + u) for f32 with u = 2^-24 (Ize, Robust BVH Ray Traversal,
/// JCGT 2(2) 2013).
///
/// A computed distance to a plane is the true one times at most three factors of 1 ± u (subtract, reciprocal,
/// multiply), so either end of the overlap may be off by γ3, and one end that is moved by 2 γ3 absorbs both; the last
/// factor is for the rounding of that move itself.
pub(crate) const PRUNE_MARGIN: f32 = 1.0 + 4.0 * f32::EPSILON;

/// The margin of the f64 test of a primitive's own bounds. Ize's derivation requires 1 + 3.5 ε. The rest is for
/// primitive tests that see corners moved by up to 2^-50 of their distance to the ray's origin ([`super::woop`]): it
/// covers hits from 2^-24 of that distance on, and [`clamp_near`] covers nearer ones on triangles. [`PRUNE_MARGIN`] is
/// wider than f32 requires by 2^-24, so a box entered with this margin is entered in f32, too.
pub(crate) const DOUBLE_MARGIN: f64 = 1.0 + 1.0 / (1u32 << 26) as f64;

/// The distance, relative to that of the farthest corner from the ray's origin, by which the triangle test sees corners
/// moved on each axis: 2^-50 (see [`super::spawn`]), doubled for the rounding of [`clamp_near`].
const CORNER_ERROR: f64 = 1.0 / (1u64 << 49) as f64;

/// Planes of boxes nearer to 0 than the first number, relative to the largest coordinate R, are moved by the second.
///
/// A hit of [`clamp_near`] may lie outside the bounds of its triangle by 2^-49 M, with M the distance of the farthest
/// corner. It is near, so M < 2.1 R, and 2^-49 M < 2^-47 R. Where the ray's origin is farther than 2^-26 M from a plane
/// on its axis, the relative margins of box tests cover that. Else the origin is within 2^-24 R of the plane p: for
/// |p| >= 2^-22 R its coordinate exceeds 2^-23 R, and box tests and frusta move origins by 2^-23 of their coordinates
/// and more than they round, so by 2^-46 R. Planes nearer to 0 are moved here. Secondary rays start 2^-40 R from their
/// triangle ([`super::spawn`]), outside its box still.
const NEAR_ZERO: (f64, f64) = (1.0 / (1u32 << 22) as f64, 1.0 / (1u64 << 47) as f64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_is_what_ize_derives() {
        let u = f64::from(f32::EPSILON) / 2.0;
        let gamma3 = 3.0 * u / (1.0 - 3.0 * u);
        let least = (1.0 + 2.0 * gamma3) * (1.0 + u) * DOUBLE_MARGIN;
        assert!(f64::from(PRUNE_MARGIN) >= least);
        assert!(f64::from(PRUNE_MARGIN.next_down()) < least);
    }

    /// A plane at 0 or within 2^-22 of the largest coordinate moves by at least 2^-47 of it, others stay; the same by
    /// both precisions.
    #[test]
    fn boxes_of_triangles_grow_at_planes_near_zero() {
        let (min, max) = (DVec3::new(0.0, 3.0, -5e-8), DVec3::new(1.0, 4.0, 1e-5));
        let [min, max] = [min, max].map(|p| p.as_vec3().as_dvec3());
        let b = Bounds::of_triangles([min, max], 4.0);
        let moved = min - b.min.as_dvec3();
        let by = 4.0 * 2f64.powi(-47);
        assert!(moved.x.min(moved.z) >= by && moved.x.max(moved.z) < by * 2.0, "{moved}");
        assert_eq!(([b.min.y, b.max.y], b.max.x, f64::from(b.max.z)), ([3.0, 4.0], 1.0, max.z));
        let in_f32 = Bounds { min: min.as_vec3(), max: max.as_vec3() };
        assert_eq!(in_f32.grown_near_zero(), b);
    }

    #[test]
    fn rounding_is_directed_everywhere() {
        let f32_max = f64::from(f32::MAX);
        for x in [0.1, 1.0, 1e-46, 1e-40, 1.5e38, f32_max, f32_max * 1.5, 0.0, f64::INFINITY] {
            for x in [x, -x] {
                let (down, up) = (round_down(x), round_up(x));
                assert!(f64::from(down) <= x && x <= f64::from(up), "{x}");
                assert!(down == up || down.next_up() == up, "{x}: {down} {up}");
                assert_eq!(down == up, f64::from(x as f32) == x);
                assert_eq!(round_towards(x, 0.3), up);
                assert_eq!(round_towards(x, -1e-9), down);
            }
        }
    }
}
