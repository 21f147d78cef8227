//! Four rays against one triangle at once, or one ray against four, with the bits that each of them would get alone.

use super::quad::{LANES, Quad};
use super::simd::Simd;
use super::woop::{Along, CANCELLED, NEAR};
use super::{Corner, Hit, PrimId, Ray, SlotId};

/// How many rays a bundle holds.
pub const RAYS: usize = 4;

/// What four rays found on a triangle, or one on four. Lanes are bits.
#[derive(Clone, Copy)]
pub struct FourHits {
    /// Those that hit.
    pub hit: u32,
    /// Those that have to be asked one by one.
    pub unsure: u32,
    /// Distances.
    pub t: [f64; RAYS],
    /// Barycentric coordinates of the second and the third corner.
    pub weights: [[f64; RAYS]; 2],
}

impl FourHits {
    /// All are missed.
    pub const NONE: FourHits = FourHits { hit: 0, unsure: 0, t: [0.0; RAYS], weights: [[0.0; RAYS]; 2] };
    /// For tiers that do not work on four at once.
    pub const ONE_BY_ONE: FourHits = FourHits { unsure: (1 << RAYS) - 1, ..FourHits::NONE };

    /// The hit in a lane, on what is called `prim` and kept in `slot`.
    #[inline(always)]
    pub fn at(&self, lane: usize, prim: PrimId, slot: SlotId) -> Hit {
        Hit { t: self.t[lane], prim, slot, weights: [self.weights[0][lane], self.weights[1][lane]] }
    }
}

/// Four rays, number by number.
pub struct Gathered<S: Simd> {
    /// Where they start.
    pub origin: [S::D4; 3],
    /// Where they go.
    pub direction: [S::D4; 3],
    /// See [`Ray`].
    pub t_min: S::D4,
    /// See [`Ray`].
    pub t_max: S::D4,
}

impl<S: Simd> Gathered<S> {
    /// From `first` on; lanes beyond the last ray hold that.
    ///
    /// # Panics
    /// Without rays.
    #[inline(always)]
    pub fn new(rays: &[Ray], first: usize) -> Self {
        let last = rays.len() - 1;
        let halves = |lane: usize| {
            let [low, high]: [[f64; 4]; 2] = bytemuck::cast(rays[(first + lane).min(last)]);
            (S::d4(low), S::d4(high))
        };
        let [a, b, c, d] = [halves(0), halves(1), halves(2), halves(3)];
        let [ox, oy, oz, dx] = S::d4_transposed([a.0, b.0, c.0, d.0]);
        let [dy, dz, t_min, t_max] = S::d4_transposed([a.1, b.1, c.1, d.1]);
        Gathered { origin: [ox, oy, oz], direction: [dx, dy, dz], t_min, t_max }
    }
}

/// Four rays made ready for triangles, axes turned so that all run along the third most.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub struct WoopBundle {
    origin: [[f64; RAYS]; 3],
    shear: [[f64; RAYS]; 2],
    inverse: [[f64; RAYS]; 3],
    t_min: [f64; RAYS],
    t_max: [f64; RAYS],
    /// How the axes are turned.
    axes: [usize; 3],
    /// Rays that do not fit in: they run along another axis, or not at all along one.
    odd: u32,
}

impl Default for WoopBundle {
    /// Of rays that are asked one by one.
    fn default() -> Self {
        let none = [[0.0; RAYS]; 3];
        WoopBundle {
            origin: none,
            shear: [[0.0; RAYS]; 2],
            inverse: none,
            t_min: [0.0; RAYS],
            t_max: [0.0; RAYS],
            axes: [0, 1, 2],
            odd: (1 << RAYS) - 1,
        }
    }
}

impl WoopBundle {
    /// Makes up to four rays ready, at least one; lanes beyond hold the last. As `WoopTest::new` does, for all at once.
    ///
    /// # Panics
    /// Without rays.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, rays: &[Ray]) {
        let along = Along::of(&rays[0]);
        let four = Gathered::<S>::new(rays, 0);
        self.axes = along.axes();
        (self.t_min, self.t_max) = (S::d4_array(four.t_min), S::d4_array(four.t_max));
        let (zero, one) = (S::d4_splat(0.0), S::d4_splat(1.0));
        let mut turned = [[0.0; RAYS]; 3];
        let mut zeros = 0;
        for (axis, place) in along.places().into_iter().enumerate() {
            let direction = four.direction[axis];
            self.origin[place] = S::d4_array(four.origin[axis]);
            self.inverse[place] = S::d4_array(S::d4_div(one, direction));
            turned[place] = S::d4_array(direction);
            zeros |= S::d4_le(S::d4_abs(direction), zero);
        }
        let inverse = S::d4(self.inverse[2]);
        let shear = |k: usize| S::d4_array(S::d4_mul(S::d4(turned[k]), inverse));
        self.shear = [shear(0), shear(1)];
        let [x, y, z] = four.direction.map(S::d4_abs);
        let x_first = S::d4_le(y, x) & S::d4_le(z, x);
        let y_first = S::d4_le(z, y);
        let same = match along {
            Along::X => x_first,
            Along::Y => !x_first & y_first,
            Along::Z => !(x_first | y_first),
        };
        self.odd = (!same | zeros) & ((1 << RAYS) - 1);
    }

    /// What the test for one ray, Woop's in f64, says of each of the rays, by the same operations in the same order. `ahead`: no triangle
    /// that a ray hits lies behind it, which then is not looked into.
    #[inline(always)]
    pub fn hit<S: Simd>(&self, corners: &[[f64; 3]; 3], ahead: bool) -> FourHits {
        let origin = load::<S>(&self.origin);
        let mut seen = [[origin[0]; 3]; 3];
        for (corner, seen) in corners.iter().zip(&mut seen) {
            for place in 0..3 {
                let at = S::d4_splat(corner[self.axes[place] % 3]);
                seen[place] = S::d4_sub(at, origin[place]);
            }
        }
        self.hit_seen::<S>(&seen, ahead)
    }

    /// The same of each ray and a triangle of its own, which is one of a quad and ahead of it.
    #[inline(always)]
    pub fn hit_each<S: Simd, C: Corner>(&self, triangles: &[(&Quad<C>, usize); RAYS]) -> FourHits {
        let origin = load::<S>(&self.origin);
        let mut seen = [[origin[0]; 3]; 3];
        for (k, seen) in seen.iter_mut().enumerate() {
            for place in 0..3 {
                let axis = self.axes[place] % 3;
                let [a, b, c, d] = *triangles;
                let at = C::to_d4::<S>([
                    a.0.corners[k][axis][a.1 % LANES],
                    b.0.corners[k][axis][b.1 % LANES],
                    c.0.corners[k][axis][c.1 % LANES],
                    d.0.corners[k][axis][d.1 % LANES],
                ]);
                seen[place] = S::d4_sub(at, origin[place]);
            }
        }
        self.hit_seen::<S>(&seen, true)
    }

    #[inline(always)]
    fn hit_seen<S: Simd>(&self, seen: &[[S::D4; 3]; 3], ahead: bool) -> FourHits {
        let inverse = load::<S>(&self.inverse);
        let rays = FourRays {
            shear: [S::d4(self.shear[0]), S::d4(self.shear[1]), inverse[2]],
            inverse,
            t_min: S::d4(self.t_min),
            t_max: S::d4(self.t_max),
        };
        let mut hits = hit_four::<S>(seen, &rays, 0, ahead);
        hits.hit &= !self.odd;
        hits.unsure |= self.odd;
        hits
    }
}

/// What is known of four rays besides where they see corners.
pub struct FourRays<S: Simd> {
    /// The two shears, and the reciprocal of the direction along the third axis.
    pub shear: [S::D4; 3],
    /// Reciprocals of the direction.
    pub inverse: [S::D4; 3],
    /// Hits are beyond this,
    pub t_min: S::D4,
    /// and before this.
    pub t_max: S::D4,
}

/// Four pairs of a ray and a triangle. `seen` are the corners from the ray's origin, axes turned so that the ray runs along the
/// third most. The lanes of `odd` have to be asked one by one where they are not missed. `ahead`: what is hit is known to lie ahead.
#[inline(always)]
pub fn hit_four<S: Simd>(seen: &[[S::D4; 3]; 3], rays: &FourRays<S>, odd: u32, ahead: bool) -> FourHits {
    let zero = S::d4_splat(0.0);
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *seen;
    let shear = &rays.shear;
    let ((ax, ay), (bx, by), (cx, cy)) =
        (aside::<S>(ax, ay, az, shear), aside::<S>(bx, by, bz, shear), aside::<S>(cx, cy, cz, shear));
    let (weight_a, product_a) = edge::<S>(cx, by, cy, bx);
    let (weight_b, product_b) = edge::<S>(ax, cy, ay, cx);
    let (weight_c, product_c) = edge::<S>(bx, ay, by, ax);
    let lowest = S::d4_min(S::d4_min(weight_a, weight_b), weight_c);
    let highest = S::d4_max(S::d4_max(weight_a, weight_b), weight_c);
    let inside = S::d4_le(zero, lowest) | S::d4_le(highest, zero);
    // Most triangles are missed.
    if inside == 0 {
        return FourHits::NONE;
    }
    let cancelled = nearly_cancel::<S>(weight_a, product_a)
        | nearly_cancel::<S>(weight_b, product_b)
        | nearly_cancel::<S>(weight_c, product_c);
    let mut unsure = inside & (odd | cancelled);

    let sum = S::d4_add(S::d4_add(weight_a, weight_b), weight_c);
    let share = S::d4_div(S::d4_splat(1.0), sum);
    let (da, db, dc) = (S::d4_mul(weight_a, az), S::d4_mul(weight_b, bz), S::d4_mul(weight_c, cz));
    let depth = S::d4_mul(S::d4_add(S::d4_add(da, db), dc), share);
    let (mut least, mut most, mut reaches) = (seen[0], seen[0], [zero; 3]);
    for (k, corner) in seen.iter().enumerate() {
        for (axis, &side) in corner.iter().enumerate() {
            if k > 0 {
                least[axis] = S::d4_min(least[axis], side);
                most[axis] = S::d4_max(most[axis], side);
            }
            reaches[k] = S::d4_max(S::d4_abs(side), reaches[k]);
        }
    }
    let reach = S::d4_max(S::d4_max(reaches[0], reaches[1]), reaches[2]);
    let near = S::d4_lt(S::d4_abs(depth), S::d4_mul(reach, S::d4_splat(NEAR)));
    let mut behind = 0;
    if !ahead && near & inside & !unsure != 0 {
        let (is_behind, cannot_say) = side::<S>(seen, &reaches, S::d4_mul(sum, shear[2]));
        behind = near & is_behind;
        unsure |= near & inside & cannot_say;
    }

    // Held within the triangle's own box: see `hold`.
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
    // Ahead, but not by its rounded distance: see `WoopTest::hit`.
    unsure |= near & inside & !behind & !after_start;
    let within = after_start & S::d4_lt(t, rays.t_max);
    FourHits {
        hit: inside & passes & within & !behind & !unsure,
        unsure,
        t: S::d4_array(t),
        weights: [S::d4_array(S::d4_mul(weight_b, share)), S::d4_array(S::d4_mul(weight_c, share))],
    }
}

/// The rays that start on a triangle or leave it behind, and those for which f64 cannot tell. `against` has the sign of the side that
/// a ray runs against, `reaches` are the largest coordinates of each corner.
///
/// As `is_behind` of the test for one ray, which takes the determinant of the corners as they are or as they are sheared. Above the bound
/// both have the sign of this one: shearing rounds each of two coordinates by 3 u of the corner's reach, in products of which no
/// factor is more than twice its corner's reach, so it moves the determinant by 72 u of the product of the three reaches; and the 6
/// products here round by 16 u each.
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
    // Not by the sign of a product, which could vanish.
    let (up, down) =
        (S::d4_le(zero, height) & S::d4_le(zero, against), S::d4_le(height, zero) & S::d4_le(against, zero));
    (up | down, cannot_say)
}

#[inline(always)]
fn load<S: Simd>(axes: &[[f64; RAYS]; 3]) -> [S::D4; 3] {
    [S::d4(axes[0]), S::d4(axes[1]), S::d4(axes[2])]
}

/// How far a corner lies aside of the rays.
#[inline(always)]
fn aside<S: Simd>(x: S::D4, y: S::D4, z: S::D4, shear: &[S::D4; 3]) -> (S::D4, S::D4) {
    (S::d4_sub(x, S::d4_mul(shear[0], z)), S::d4_sub(y, S::d4_mul(shear[1], z)))
}

/// An edge function, and the first of its two products.
#[inline(always)]
fn edge<S: Simd>(px: S::D4, qy: S::D4, py: S::D4, qx: S::D4) -> (S::D4, S::D4) {
    let product = S::d4_mul(px, qy);
    (S::d4_sub(product, S::d4_mul(py, qx)), product)
}

/// Where the products of an edge function nearly cancel.
#[inline(always)]
fn nearly_cancel<S: Simd>(weight: S::D4, product: S::D4) -> u32 {
    let bound = S::d4_mul(S::d4_splat(CANCELLED), S::d4_abs(product));
    S::d4_le(S::d4_abs(weight), bound)
}
