//! The watertight triangle test (`woop`) for four ray-triangle pairs at once: four rays and one triangle, four rays
//! with a triangle each, or one ray and four triangles (`WoopTest::hit_triangle4`).
//!
//! Operations and their order are those of the test for one ray, so the results have the same bits. Lanes where that
//! test would branch off (cancellation, zero direction components, sides that f64 does not decide) come back undecided.

use super::four::{Hit4, LANES4, MASK4, Ray4, Triangle4};
use super::simd::Simd;
use super::woop::{CANCELLED, MajorAxis, NEAR};
use super::{Corner, Ray};

/// Four rays prepared for triangles, axes permuted so that the major axis of the first ray is the third.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct PreparedRay4 {
    origin: [[f64; LANES4]; 3],
    shear: [[f64; LANES4]; 2],
    inverse: [[f64; LANES4]; 3],
    t_min: [f64; LANES4],
    t_max: [f64; LANES4],
    /// The permutation of the axes.
    axes: [usize; 3],
    /// Lanes that are never decided here: another major axis, or a zero direction component.
    unsupported: u32,
}

impl Default for PreparedRay4 {
    /// Four unsupported lanes.
    fn default() -> Self {
        let none = [[0.0; LANES4]; 3];
        PreparedRay4 {
            origin: none,
            shear: [[0.0; LANES4]; 2],
            inverse: none,
            t_min: [0.0; LANES4],
            t_max: [0.0; LANES4],
            axes: [0, 1, 2],
            unsupported: MASK4,
        }
    }
}

impl PreparedRay4 {
    /// Prepares the first four of `rays`; lanes beyond the end repeat the last ray. As `WoopTest::new`, four at once.
    ///
    /// # Panics
    /// If `rays` is empty.
    #[inline(always)]
    pub(crate) fn fill<S: Simd>(&mut self, rays: &[Ray]) {
        let major = MajorAxis::of(&rays[0]);
        let four = Ray4::<S>::new(rays, 0);
        self.axes = major.axes();
        (self.t_min, self.t_max) = (S::d4_array(four.t_min), S::d4_array(four.t_max));
        let (zero, one) = (S::d4_splat(0.0), S::d4_splat(1.0));
        let mut permuted = [[0.0; LANES4]; 3];
        let mut zeros = 0;
        for (axis, place) in major.places().into_iter().enumerate() {
            let direction = four.direction[axis];
            self.origin[place] = S::d4_array(four.origin[axis]);
            self.inverse[place] = S::d4_array(S::d4_div(one, direction));
            permuted[place] = S::d4_array(direction);
            zeros |= S::d4_le(S::d4_abs(direction), zero);
        }
        let inverse = S::d4(self.inverse[2]);
        let shear = |k: usize| S::d4_array(S::d4_mul(S::d4(permuted[k]), inverse));
        self.shear = [shear(0), shear(1)];
        let [x, y, z] = four.direction.map(S::d4_abs);
        let x_first = S::d4_le(y, x) & S::d4_le(z, x);
        let y_first = S::d4_le(z, y);
        let same = match major {
            MajorAxis::X => x_first,
            MajorAxis::Y => !x_first & y_first,
            MajorAxis::Z => !(x_first | y_first),
        };
        self.unsupported = (!same | zeros) & MASK4;
    }

    /// The hits of the four rays on one triangle. `ahead`: the caller knows that no hit lies behind a ray's origin,
    /// and the test for that is left out.
    #[inline(always)]
    pub(crate) fn hit<S: Simd>(&self, corners: &[[f64; 3]; 3], ahead: bool) -> Hit4 {
        let origin = load::<S>(&self.origin);
        let mut from_origin = [[origin[0]; 3]; 3];
        for (corner, from_origin) in corners.iter().zip(&mut from_origin) {
            for place in 0..3 {
                let at = S::d4_splat(corner[self.axes[place] % 3]);
                from_origin[place] = S::d4_sub(at, origin[place]);
            }
        }
        self.hit_from_origin::<S>(&from_origin, ahead)
    }

    /// The hits of each ray on a triangle of its own, given as a lane of a [`Triangle4`] and known to lie ahead.
    #[inline(always)]
    pub(crate) fn hit_each<S: Simd, C: Corner>(&self, triangles: &[(&Triangle4<C>, usize); LANES4]) -> Hit4 {
        let origin = load::<S>(&self.origin);
        let mut from_origin = [[origin[0]; 3]; 3];
        for (k, from_origin) in from_origin.iter_mut().enumerate() {
            for place in 0..3 {
                let axis = self.axes[place] % 3;
                let [a, b, c, d] = *triangles;
                let at = C::to_d4::<S>([
                    a.0.corners[k][axis][a.1 % LANES4],
                    b.0.corners[k][axis][b.1 % LANES4],
                    c.0.corners[k][axis][c.1 % LANES4],
                    d.0.corners[k][axis][d.1 % LANES4],
                ]);
                from_origin[place] = S::d4_sub(at, origin[place]);
            }
        }
        self.hit_from_origin::<S>(&from_origin, true)
    }

    #[inline(always)]
    fn hit_from_origin<S: Simd>(&self, corners: &[[S::D4; 3]; 3], ahead: bool) -> Hit4 {
        let inverse = load::<S>(&self.inverse);
        let rays = Sheared4 {
            shear: [S::d4(self.shear[0]), S::d4(self.shear[1]), inverse[2]],
            inverse,
            t_min: S::d4(self.t_min),
            t_max: S::d4(self.t_max),
        };
        let mut hits = hit_four::<S>(corners, &rays, 0, ahead);
        hits.hit &= !self.unsupported;
        hits.undecided |= self.unsupported;
        hits
    }
}

/// The parameters of four rays apart from their origins, from which corners are given.
pub(crate) struct Sheared4<S: Simd> {
    /// The two shears, and the reciprocal of the direction along the third axis.
    pub shear: [S::D4; 3],
    /// Reciprocals of the direction.
    pub inverse: [S::D4; 3],
    /// See [`Ray::t_min`].
    pub t_min: S::D4,
    /// See [`Ray::t_max`].
    pub t_max: S::D4,
}

/// The hits of four ray-triangle pairs. `corners` are relative to the ray origins, axes permuted so that the major
/// axis is the third. Lanes of `zero_direction_mask` come back undecided unless they miss. `ahead`: see
/// [`PreparedRay4::hit`].
///
/// Longer than other functions: its parts share the registers of the corners.
#[inline(always)]
pub(crate) fn hit_four<S: Simd>(
    corners: &[[S::D4; 3]; 3],
    rays: &Sheared4<S>,
    zero_direction_mask: u32,
    ahead: bool,
) -> Hit4 {
    let zero = S::d4_splat(0.0);
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *corners;
    let shear = &rays.shear;
    let ((ax, ay), (bx, by), (cx, cy)) = (
        sheared_xy::<S>(ax, ay, az, shear),
        sheared_xy::<S>(bx, by, bz, shear),
        sheared_xy::<S>(cx, cy, cz, shear),
    );
    let (weight_a, product_a) = edge::<S>(cx, by, cy, bx);
    let (weight_b, product_b) = edge::<S>(ax, cy, ay, cx);
    let (weight_c, product_c) = edge::<S>(bx, ay, by, ax);
    let lowest = S::d4_min(S::d4_min(weight_a, weight_b), weight_c);
    let highest = S::d4_max(S::d4_max(weight_a, weight_b), weight_c);
    let inside = S::d4_le(zero, lowest) | S::d4_le(highest, zero);
    // Most triangles are missed.
    if inside == 0 {
        return Hit4::NONE;
    }
    let cancelled = nearly_cancel::<S>(weight_a, product_a)
        | nearly_cancel::<S>(weight_b, product_b)
        | nearly_cancel::<S>(weight_c, product_c);
    let mut undecided = inside & (zero_direction_mask | cancelled);

    let sum = S::d4_add(S::d4_add(weight_a, weight_b), weight_c);
    let share = S::d4_div(S::d4_splat(1.0), sum);
    let (da, db, dc) = (S::d4_mul(weight_a, az), S::d4_mul(weight_b, bz), S::d4_mul(weight_c, cz));
    let depth = S::d4_mul(S::d4_add(S::d4_add(da, db), dc), share);
    let (mut least, mut most, mut reaches) = (corners[0], corners[0], [zero; 3]);
    for (k, corner) in corners.iter().enumerate() {
        for (axis, &coordinate) in corner.iter().enumerate() {
            if k > 0 {
                least[axis] = S::d4_min(least[axis], coordinate);
                most[axis] = S::d4_max(most[axis], coordinate);
            }
            reaches[k] = S::d4_max(S::d4_abs(coordinate), reaches[k]);
        }
    }
    let reach = S::d4_max(S::d4_max(reaches[0], reaches[1]), reaches[2]);
    let near = S::d4_lt(S::d4_abs(depth), S::d4_mul(reach, S::d4_splat(NEAR)));
    let mut behind = 0;
    if !ahead && near & inside & !undecided != 0 {
        let (is_behind, cannot_say) = side::<S>(corners, &reaches, S::d4_mul(sum, shear[2]));
        behind = near & is_behind;
        undecided |= near & inside & cannot_say;
    }

    // Clamped to the triangle's own bounds: see `clamp_to_bounds`.
    let t = S::d4_mul(depth, shear[2]);
    let mut enter = S::d4_splat(f64::NEG_INFINITY);
    let mut leave = S::d4_splat(f64::INFINITY);
    for axis in 0..3 {
        let inverse = rays.inverse[axis];
        let (a, b) = (S::d4_mul(least[axis], inverse), S::d4_mul(most[axis], inverse));
        enter = S::d4_max(S::d4_min(a, b), enter);
        leave = S::d4_min(S::d4_max(a, b), leave);
    }
    let passes = S::d4_le(enter, S::d4_mul(leave, S::d4_splat(super::bounds::DOUBLE_MARGIN)));
    let t = S::d4_max(enter, S::d4_min(leave, t));
    let after_start = S::d4_lt(rays.t_min, t);
    // Ahead by the exact test, but not by the rounded distance: see `WoopTest::hit`.
    undecided |= near & inside & !behind & !after_start;
    let within = after_start & S::d4_lt(t, rays.t_max);
    Hit4 {
        hit: inside & passes & within & !behind & !undecided,
        undecided,
        t: S::d4_array(t),
        barycentrics: [S::d4_array(S::d4_mul(weight_b, share)), S::d4_array(S::d4_mul(weight_c, share))],
    }
}

/// Masks of the rays whose triangle contains the origin or lies behind it, and of those that f64 does not decide.
/// `against` has the sign of the side from which a ray meets the triangle; `reaches` are the largest coordinates of
/// each corner.
///
/// `is_behind` of the test for one ray takes the determinant of the corners as given or as sheared. Above the bound
/// both have the sign of this one: shearing rounds each of two coordinates by 3 u of the corner's reach, in products
/// of which no factor is more than twice its corner's reach, so it moves the determinant by 72 u of the product of
/// the three reaches; and the 6 products here round by 16 u each.
#[inline(always)]
fn side<S: Simd>([a, b, c]: &[[S::D4; 3]; 3], reaches: &[S::D4; 3], against: S::D4) -> (u32, u32) {
    let zero = S::d4_splat(0.0);
    let mut height = zero;
    for (k, i, j) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let (left, right) = (S::d4_mul(b[i], c[j]), S::d4_mul(b[j], c[i]));
        height = S::d4_add(height, S::d4_mul(a[k], S::d4_sub(left, right)));
    }
    let size = S::d4_mul(S::d4_mul(reaches[0], reaches[1]), reaches[2]);
    let bound = S::d4_mul(size, S::d4_splat(128.0 * f64::EPSILON));
    let cannot_say = S::d4_le(S::d4_abs(height), bound);
    // Signs are compared one by one: their product could underflow.
    let (up, down) =
        (S::d4_le(zero, height) & S::d4_le(zero, against), S::d4_le(height, zero) & S::d4_le(against, zero));
    (up | down, cannot_say)
}

#[inline(always)]
fn load<S: Simd>(axes: &[[f64; LANES4]; 3]) -> [S::D4; 3] {
    [S::d4(axes[0]), S::d4(axes[1]), S::d4(axes[2])]
}

/// A corner's x and y in the sheared plane.
#[inline(always)]
fn sheared_xy<S: Simd>(x: S::D4, y: S::D4, z: S::D4, shear: &[S::D4; 3]) -> (S::D4, S::D4) {
    (S::d4_sub(x, S::d4_mul(shear[0], z)), S::d4_sub(y, S::d4_mul(shear[1], z)))
}

/// The edge function `p.x * q.y - p.y * q.x`, and its first product.
#[inline(always)]
fn edge<S: Simd>(px: S::D4, qy: S::D4, py: S::D4, qx: S::D4) -> (S::D4, S::D4) {
    let product = S::d4_mul(px, qy);
    (S::d4_sub(product, S::d4_mul(py, qx)), product)
}

/// The lanes where the products of an edge function nearly cancel.
#[inline(always)]
fn nearly_cancel<S: Simd>(weight: S::D4, product: S::D4) -> u32 {
    let bound = S::d4_mul(S::d4_splat(CANCELLED), S::d4_abs(product));
    S::d4_le(S::d4_abs(weight), bound)
}
