//! The watertight triangle test (`woop`) for a ray-triangle pair in each lane: rays and one triangle or a triangle each
//! ([`PreparedRayN`], rays of one major axis), rays of any major axis with a triangle each ([`PreparedEachN`]), or one
//! ray and four triangles (`WoopTest::hit_triangle4`).
//!
//! Operations and their order are those of the test for one ray, so the results have the same bits. Lanes where that
//! test would branch off (cancellation, zero direction components, sides that f64 does not decide) come back undecided.

use glam::DVec3;

use super::lanes::{HitN, RayN, Triangle4};
use super::simd::Doubles;
use super::woop::{CANCELLED, MajorAxis, NEAR, WoopTest};
use super::{Corner, Rays};

/// Rays prepared for triangles, axes permuted so that the major axis of the first ray is the third.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct PreparedRayN<D: Doubles> {
    origin: [D::Array; 3],
    shear: [D::Array; 2],
    inverse: [D::Array; 3],
    t_min: D::Array,
    t_max: D::Array,
    /// The permutation of the axes.
    axes: [usize; 3],
    /// Lanes that are never decided here: another major axis, or a zero direction component.
    unsupported: u32,
}

impl<D: Doubles> Default for PreparedRayN<D> {
    /// Unsupported lanes.
    fn default() -> Self {
        PreparedRayN {
            origin: [D::ZEROS; 3],
            shear: [D::ZEROS; 2],
            inverse: [D::ZEROS; 3],
            t_min: D::ZEROS,
            t_max: D::ZEROS,
            axes: [0, 1, 2],
            unsupported: D::ALL,
        }
    }
}

impl<D: Doubles> PreparedRayN<D> {
    /// Prepares rays from index `first` on.
    ///
    /// # Panics
    /// If there is no such ray.
    #[inline(always)]
    pub(crate) fn fill(&mut self, rays: Rays, first: usize) {
        let PreparedEachN { rays, x_first, y_first } = PreparedEachN::new(&rays.lanes(first));
        let major = MajorAxis::of_order(x_first & 1 != 0, y_first & 1 != 0);
        let same = match major {
            MajorAxis::X => x_first,
            MajorAxis::Y => !x_first & y_first,
            MajorAxis::Z => !(x_first | y_first),
        };
        let unsupported = (rays.unsupported | !same) & D::ALL;
        *self = PreparedRayN { axes: major.axes(), unsupported, ..rays };
    }

    /// The hits of the rays on one triangle. `ahead`: the caller knows that no hit lies behind a ray's origin,
    /// and the test for that is left out.
    #[inline(always)]
    pub(crate) fn hit(&self, corners: &[[f64; 3]; 3], ahead: bool) -> HitN<D> {
        let origin = load::<D>(&self.origin);
        let mut from_origin = [[origin[0]; 3]; 3];
        for (corner, from_origin) in corners.iter().zip(&mut from_origin) {
            for place in 0..3 {
                let at = D::splat(corner[self.axes[place] % 3]);
                from_origin[place] = at - origin[place];
            }
        }
        self.hit_from_origin(&from_origin, ahead)
    }

    /// The hits of each ray on a triangle of its own, given as a lane of a [`Triangle4`] and known to lie ahead.
    #[inline(always)]
    pub(crate) fn hit_each<'a, C: Corner>(
        &self,
        triangle: impl Fn(usize) -> (&'a Triangle4<C>, usize),
    ) -> HitN<D> {
        let origin = load::<D>(&self.origin);
        let mut from_origin = [[origin[0]; 3]; 3];
        for (k, from_origin) in from_origin.iter_mut().enumerate() {
            for place in 0..3 {
                let axis = self.axes[place] % 3;
                let at = C::gather::<D>(
                    #[inline(always)]
                    |lane| {
                        let (triangles, place) = triangle(lane);
                        triangles.corners[k][axis][place]
                    },
                );
                from_origin[place] = at - origin[place];
            }
        }
        self.hit_from_origin(&from_origin, true)
    }

    #[inline(always)]
    fn hit_from_origin(&self, corners: &[[D; 3]; 3], ahead: bool) -> HitN<D> {
        let inverse = load::<D>(&self.inverse);
        let rays = ShearedN {
            shear: [D::load(self.shear[0]), D::load(self.shear[1])],
            sign: D::splat(1.0).copysign(inverse[2]),
            inverse,
            t_min: D::load(self.t_min),
            t_max: D::load(self.t_max),
        };
        let mut hits = hit_lanes::<D, true>(corners, &rays, 0, ahead);
        hits.hit &= !self.unsupported;
        hits.undecided |= self.unsupported;
        hits
    }
}

/// Rays prepared for triangles of their own, axes permuted so that each ray's major axis is the third.
pub(crate) struct PreparedEachN<D: Doubles> {
    rays: PreparedRayN<D>,
    /// The lanes whose x is the major axis, and of the others those whose y is.
    x_first: u32,
    y_first: u32,
}

impl<D: Doubles> PreparedEachN<D> {
    /// Prepares a ray for each lane. As `WoopTest::new`, all lanes at once.
    #[inline(always)]
    pub(crate) fn new(rays: &RayN<D>) -> Self {
        let (zero, one) = (D::splat(0.0), D::splat(1.0));
        let [x, y, z] = rays.direction;
        let [x, y, z] = [x.abs(), y.abs(), z.abs()];
        let mut each = PreparedEachN {
            rays: PreparedRayN { t_min: rays.t_min.array(), t_max: rays.t_max.array(), ..Default::default() },
            x_first: y.le(x) & z.le(x),
            y_first: z.le(y),
        };
        let direction = each.permuted(&rays.direction);
        let origin = each.permuted(&rays.origin);
        let inverse = [one / direction[0], one / direction[1], one / direction[2]];
        each.rays.origin = [origin[0].array(), origin[1].array(), origin[2].array()];
        each.rays.inverse = [inverse[0].array(), inverse[1].array(), inverse[2].array()];
        each.rays.shear = [(direction[0] * inverse[2]).array(), (direction[1] * inverse[2]).array()];
        each.rays.unsupported = x.le(zero) | y.le(zero) | z.le(zero);
        each
    }

    /// The ray in a lane, which must have no zeros in its direction.
    #[inline(always)]
    pub(crate) fn ray(&self, lane: usize) -> WoopTest {
        let PreparedRayN { origin, shear, inverse, t_min, t_max, .. } = &self.rays;
        WoopTest {
            origin: DVec3::new(origin[0][lane], origin[1][lane], origin[2][lane]),
            major: MajorAxis::of_order(self.x_first >> lane & 1 != 0, self.y_first >> lane & 1 != 0),
            shear: [shear[0][lane], shear[1][lane]],
            sign: 1f64.copysign(inverse[2][lane]),
            inverse: [inverse[0][lane], inverse[1][lane], inverse[2][lane]],
            t_min: t_min[lane],
            t_max: t_max[lane],
            zero_direction_mask: 0,
        }
    }

    /// A vector in each lane by [`MajorAxis::axes`].
    #[inline(always)]
    fn permuted(&self, &[x, y, z]: &[D; 3]) -> [D; 3] {
        let (of_x, of_y) = (self.x_first, self.y_first);
        [
            D::select(of_x, y, D::select(of_y, z, x)),
            D::select(of_x, z, D::select(of_y, x, y)),
            D::select(of_x, x, D::select(of_y, y, z)),
        ]
    }

    /// The hits of the rays on the triangles with corners `corners[k][axis]`.
    #[inline(always)]
    pub(crate) fn hit(&self, corners: &[[D; 3]; 3]) -> HitN<D> {
        let origin = load::<D>(&self.rays.origin);
        let mut from_origin = [[origin[0]; 3]; 3];
        for (corner, from_origin) in corners.iter().zip(&mut from_origin) {
            let [x, y, z] = self.permuted(corner);
            *from_origin = [x - origin[0], y - origin[1], z - origin[2]];
        }
        self.rays.hit_from_origin(&from_origin, false)
    }
}

/// The parameters of rays apart from their origins, from which corners are given.
pub(crate) struct ShearedN<D: Doubles> {
    /// The two shears.
    pub shear: [D; 2],
    /// 1 with the sign of the direction along the third axis.
    pub sign: D,
    /// Reciprocals of the direction.
    pub inverse: [D; 3],
    /// See [`super::Ray::t_min`].
    pub t_min: D,
    /// See [`super::Ray::t_max`].
    pub t_max: D,
}

/// The hits of ray-triangle pairs. `corners` are relative to the ray origins, axes permuted so that the major
/// axis is the third. Lanes of `zero_direction_mask` come back undecided unless they miss. `ahead`: see
/// [`PreparedRayN::hit`]. `EARLY`: with branches that spare work where all are missed, as most triangles are.
///
/// Longer than other functions: its parts share the registers of the corners.
#[inline(always)]
pub(crate) fn hit_lanes<D: Doubles, const EARLY: bool>(
    corners: &[[D; 3]; 3],
    rays: &ShearedN<D>,
    zero_direction_mask: u32,
    ahead: bool,
) -> HitN<D> {
    let zero = D::splat(0.0);
    let [[_, _, az], [_, _, bz], [_, _, cz]] = *corners;
    let [(weight_a, product_a), (weight_b, product_b), (weight_c, product_c)] =
        edges(&sheared_corners(corners, &rays.shear));
    let inside = same_signs([weight_a, weight_b, weight_c]);
    if EARLY && inside == 0 {
        return HitN::NONE;
    }
    let cancelled = nearly_cancel(weight_a, product_a)
        | nearly_cancel(weight_b, product_b)
        | nearly_cancel(weight_c, product_c);
    let mut undecided = inside & (zero_direction_mask | cancelled);

    let sum = weight_a + weight_b + weight_c;
    let share = D::splat(1.0) / sum;
    let (da, db, dc) = (weight_a * az, weight_b * bz, weight_c * cz);
    let depth = (da + db + dc) * share;
    let (mut least, mut most) = (corners[0], corners[0]);
    for corner in &corners[1..] {
        for (axis, &coordinate) in corner.iter().enumerate() {
            least[axis] = least[axis].min(coordinate);
            most[axis] = most[axis].max(coordinate);
        }
    }
    let reaches = reaches_of(corners);
    let reach = reaches[0].max(reaches[1]).max(reaches[2]);
    let near = depth.abs().lt(reach * D::splat(NEAR));
    let mut behind = 0;
    if !ahead && (!EARLY || near & inside & !undecided != 0) {
        let (is_behind, cannot_say) = side(corners, &reaches, sum * rays.sign);
        behind = near & is_behind;
        undecided |= near & inside & cannot_say;
    }

    // Clamped to the triangle's own bounds: see `clamp_to_bounds`.
    let computed = depth * rays.inverse[2];
    let mut enter = D::splat(f64::NEG_INFINITY);
    let mut leave = D::splat(f64::INFINITY);
    for axis in 0..3 {
        let inverse = rays.inverse[axis];
        let (a, b) = (least[axis] * inverse, most[axis] * inverse);
        enter = a.min(b).max(enter);
        leave = a.max(b).min(leave);
    }
    let passes = enter.le(leave * D::splat(super::bounds::DOUBLE_MARGIN));
    let t = enter.max(leave.min(computed));
    let after_start = rays.t_min.lt(t);
    // Ahead by the exact test, but not by the rounded distance or not within the bounds: see `WoopTest::hit`.
    undecided |= near & inside & !behind & !(after_start & passes);
    // Seen too nearly edge-on: see there, too.
    undecided |= if ahead { 0 } else { inside & !near & computed.le(zero) & after_start };
    let within = after_start & t.lt(rays.t_max);
    HitN {
        hit: inside & passes & within & !behind & !undecided,
        undecided,
        t: t.array(),
        barycentrics: [(weight_b * share).array(), (weight_c * share).array()],
    }
}

/// The lanes that may be hit: those whose line crosses the triangle, but for crossings certainly behind the origin. In
/// the others the test for one ray misses ([`side`] has the proof).
#[inline(always)]
pub(crate) fn may_hit<D: Doubles>(corners: &[[D; 3]; 3], shear: &[D; 2], sign: D) -> u32 {
    let [(a, _), (b, _), (c, _)] = edges(&sheared_corners(corners, shear));
    let (is_behind, cannot_say) = side(corners, &reaches_of(corners), (a + b + c) * sign);
    same_signs([a, b, c]) & (!is_behind | cannot_say)
}

/// Masks of the rays whose triangle contains the origin or lies behind it, and of those that f64 does not decide.
/// `against` has the sign of the side from which a ray meets the triangle: that of the sum of the edge functions times
/// the direction along the third axis, of which only the sign is taken, so that directions of any length do not
/// underflow. `reaches` are the largest coordinates of
/// each corner.
///
/// `is_behind` of the test for one ray takes the determinant of the corners as given or as sheared. Above the bound
/// both have the sign of this one: shearing rounds each of two coordinates by 3 u of the corner's reach, in products
/// of which no factor is more than twice its corner's reach, so it moves the determinant by 72 u of the product P of
/// the three reaches; and the 6 products here round by 16 u each.
///
/// [`may_hit`] drops a triangle by these masks alone, also where the tests do not compute the determinant because the
/// crossing is not [`NEAR`] the origin. Those take the sign of `depth`, which is Σ w z / Σ w with the edge functions w,
/// and it is the same above the bound:
/// - With exact w of the sheared corners, Σ w z is minus their determinant, so beyond (256 - 168) u P.
/// - A computed w is off by 16 u of the product of two reaches: both of its products are below 4 of those and are
///   rounded by u, and so is their difference, below 8. That moves Σ w z by 48 u P, which leaves its sign.
/// - All w have one sign, so the products w z and their sums are below |Σ w| times the largest reach. Computing Σ w z
///   rounds by less than 4 u of that, and where the crossing is not near, the result is at least 1/64 of it.
///
/// A distance on the wrong side is clamped to the bounds of the triangle; where those lie ahead, the tests compute the
/// determinant, too. Where all three w are computed as 0, Σ w z is within 48 u P, and nothing is dropped.
#[inline(always)]
fn side<D: Doubles>([a, b, c]: &[[D; 3]; 3], reaches: &[D; 3], against: D) -> (u32, u32) {
    let zero = D::splat(0.0);
    let mut height = zero;
    for (k, i, j) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let (left, right) = (b[i] * c[j], b[j] * c[i]);
        height = height + a[k] * (left - right);
    }
    let size = reaches[0] * reaches[1] * reaches[2];
    let bound = size * D::splat(128.0 * f64::EPSILON);
    let cannot_say = height.abs().le(bound);
    // Signs are compared one by one: their product could underflow.
    let (up, down) = (zero.le(height) & zero.le(against), height.le(zero) & against.le(zero));
    (up | down, cannot_say)
}

#[inline(always)]
fn load<D: Doubles>(axes: &[D::Array; 3]) -> [D; 3] {
    [D::load(axes[0]), D::load(axes[1]), D::load(axes[2])]
}

/// x and y of corners in the sheared plane.
#[inline(always)]
pub(super) fn sheared_corners<D: Doubles>([a, b, c]: &[[D; 3]; 3], shear: &[D; 2]) -> [[D; 2]; 3] {
    [sheared_xy(a, shear), sheared_xy(b, shear), sheared_xy(c, shear)]
}

#[inline(always)]
fn sheared_xy<D: Doubles>(&[x, y, z]: &[D; 3], shear: &[D; 2]) -> [D; 2] {
    [x - shear[0] * z, y - shear[1] * z]
}

/// The edge functions of sheared corners, each with its first product.
#[inline(always)]
pub(super) fn edges<D: Doubles>(&[a, b, c]: &[[D; 2]; 3]) -> [(D, D); 3] {
    [edge(c, b), edge(a, c), edge(b, a)]
}

/// The edge function `p.x * q.y - p.y * q.x`, and its first product.
#[inline(always)]
fn edge<D: Doubles>(p: [D; 2], q: [D; 2]) -> (D, D) {
    let product = p[0] * q[1];
    (product - p[1] * q[0], product)
}

/// The lanes in which no two weights have opposite signs.
#[inline(always)]
fn same_signs<D: Doubles>([a, b, c]: [D; 3]) -> u32 {
    let zero = D::splat(0.0);
    zero.le(a.min(b).min(c)) | a.max(b).max(c).le(zero)
}

/// The largest coordinate of each corner.
#[inline(always)]
fn reaches_of<D: Doubles>([a, b, c]: &[[D; 3]; 3]) -> [D; 3] {
    [reach_of(a), reach_of(b), reach_of(c)]
}

#[inline(always)]
fn reach_of<D: Doubles>([x, y, z]: &[D; 3]) -> D {
    x.abs().max(y.abs()).max(z.abs())
}

/// The lanes where the products of an edge function nearly cancel.
#[inline(always)]
fn nearly_cancel<D: Doubles>(weight: D, product: D) -> u32 {
    let bound = D::splat(CANCELLED) * product.abs();
    weight.abs().le(bound)
}
