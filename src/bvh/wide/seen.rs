//! Triangles as a packet sees them: where they lie in its plane of u and v, and which of its rays can be inside.

use super::frustum::Frustum;
use super::lanes::BLOCKS;
use super::node::WIDTH;
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Corner, Quad, Tier};

/// Least and greatest u, least and greatest v of every block of rays.
pub type Extents = [[[f32; BLOCKS]; 2]; 2];

/// A group of triangles seen from an apex: across its u and v, and in depth.
pub struct Seen<S: Simd> {
    /// Corners from the apex, each `[u axis, v axis, depth]`.
    pub corners: [[S::D4; 3]; 3],
    /// Where corners are seen, each `[u, v]`.
    pub points: [[S::D4; 2]; 3],
    /// A depth before each triangle.
    pub nearest: [f32; LANES],
    /// Least and greatest u, least and greatest v, and more; infinite where a corner is not before the apex.
    extents: [[[f32; LANES]; 2]; 2],
    /// The triangles that overlap the packet.
    pub overlapping: u32,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    pub fn new<T: Tier>(quad: &Quad<T::Corner>, frustum: &Frustum) -> Self {
        let zero = S::d4_splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let (mut least, mut most) = ([zero; 2], [zero; 2]);
        let (mut nearest, mut farthest) = (zero, zero);
        let mut points = [[zero; 2]; 3];
        let (spread, depth) = (S::d4_splat(frustum.spread), S::d4_splat(f64::from(frustum.depth)));
        for (k, corner) in corners.iter_mut().enumerate() {
            for (place, side) in corner.iter_mut().enumerate() {
                let axis = frustum.axes[place];
                let (at, apex) =
                    (T::Corner::to_d4::<S>(quad.corners[k][axis]), S::d4_splat(frustum.apex[axis]));
                let down = place == 2 && frustum.downwards;
                *side = if down { S::d4_sub(apex, at) } else { S::d4_sub(at, apex) };
            }
            let (at, off) = match frustum.shear {
                None => from_apex::<S>(corner, spread),
                Some(shear) => carried::<S>(corner, shear, frustum.size),
            };
            for place in 0..2 {
                let (low, high) = (S::d4_sub(at[place], off[place]), S::d4_add(at[place], off[place]));
                least[place] = if k == 0 { low } else { S::d4_min(low, least[place]) };
                most[place] = if k == 0 { high } else { S::d4_max(high, most[place]) };
            }
            points[k] = at;
            nearest = if k == 0 { corner[2] } else { S::d4_min(corner[2], nearest) };
            farthest = if k == 0 { corner[2] } else { S::d4_max(corner[2], farthest) };
        }
        // Where a corner is not clearly before the apex there is no saying where it is seen.
        let clear = if frustum.shear.is_some() { ALL } else { S::d4_lt(S::d4_add(spread, spread), nearest) };
        let [[first_u, last_u], [first_v, last_v]] = frustum.slopes;
        let mut across = S::d4_le(least[0], splat::<S>(last_u)) & S::d4_le(splat::<S>(first_u), most[0]);
        across &= S::d4_le(least[1], splat::<S>(last_v)) & S::d4_le(splat::<S>(first_v), most[1]);
        let start = S::d4_sub(S::d4_splat(f64::from(frustum.start)), spread);
        let ahead = S::d4_le(start, farthest) & S::d4_le(nearest, depth);
        let [low_u, low_v] = [four::<S>(below::<S>(least[0])), four::<S>(below::<S>(least[1]))];
        let [high_u, high_v] = [four::<S>(above::<S>(most[0])), four::<S>(above::<S>(most[1]))];
        let mut seen = Seen {
            corners,
            points,
            nearest: four::<S>(below::<S>(nearest)),
            extents: [[low_u, high_u], [low_v, high_v]],
            overlapping: ahead & (across | !clear & ALL),
        };
        let mut unclear = !clear & ALL;
        while unclear != 0 {
            let lane = unclear.trailing_zeros() as usize % LANES;
            unclear &= unclear - 1;
            for extent in &mut seen.extents {
                (extent[0][lane], extent[1][lane]) = (f32::NEG_INFINITY, f32::INFINITY);
            }
        }
        seen
    }

    /// The blocks of the packet that a triangle overlaps, as bits.
    #[inline(always)]
    pub fn blocks(&self, lane: usize, extents: &Extents) -> u32 {
        let mut blocks = 0;
        for some in (0..BLOCKS).step_by(WIDTH) {
            let mut mask = u32::MAX;
            for ([least, most], extent) in extents.iter().zip(&self.extents) {
                let (low, high) = (S::f8_splat(extent[0][lane]), S::f8_splat(extent[1][lane]));
                mask &= S::f8_le(eight::<S>(least, some), high) & S::f8_le(low, eight::<S>(most, some));
            }
            blocks |= mask << some;
        }
        blocks
    }
}

/// An f32 number four times.
#[inline(always)]
fn splat<S: Simd>(x: f32) -> S::D4 {
    S::d4_splat(f64::from(x))
}

/// All lanes.
pub const ALL: u32 = (1 << LANES) - 1;

/// a b - c d
#[inline(always)]
pub fn cross<S: Simd>(a: S::D4, b: S::D4, c: S::D4, d: S::D4) -> S::D4 {
    S::d4_sub(S::d4_mul(a, b), S::d4_mul(c, d))
}

/// The sum of three numbers' sizes.
#[inline(always)]
pub fn size_of<S: Simd>(v: &[S::D4; 3]) -> S::D4 {
    S::d4_add(S::d4_add(S::d4_abs(v[0]), S::d4_abs(v[1])), S::d4_abs(v[2]))
}

/// Numbers that are not above `x` when they are rounded to f32, which is off by u of them, or by what f32 has no places for.
#[inline(always)]
pub fn below<S: Simd>(x: S::D4) -> S::D4 {
    S::d4_sub(x, rounding::<S>(x))
}

/// Numbers that are not below `x` when they are rounded to f32.
#[inline(always)]
pub fn above<S: Simd>(x: S::D4) -> S::D4 {
    S::d4_add(x, rounding::<S>(x))
}

#[inline(always)]
fn rounding<S: Simd>(x: S::D4) -> S::D4 {
    S::d4_add(S::d4_mul(S::d4_abs(x), S::d4_splat(f64::from(f32::EPSILON))), S::d4_splat(UNDERFLOW))
}

/// Rounded to f32.
#[inline(always)]
pub fn four<S: Simd>(x: S::D4) -> [f32; LANES] {
    let [a, b, c, d, ..] = S::f8_array(S::f8_from_d4(x, x));
    [a, b, c, d]
}

/// Where a corner is seen from the apex, and what that may be off by.
#[inline(always)]
fn from_apex<S: Simd>(corner: &[S::D4; 3], spread: S::D4) -> ([S::D4; 2], [S::D4; 2]) {
    let share = S::d4_div(S::d4_splat(1.0), corner[2]);
    // A ray that passes the apex on a side sees a corner moved by as much; and in depth, which changes a slope by that share
    // of itself, twice that at the depths where it counts.
    let aside = S::d4_mul(spread, share);
    let of_slope = S::d4_add(S::d4_splat(SLOPE_SLACK), S::d4_add(aside, aside));
    let (u, v) = (S::d4_mul(corner[0], share), S::d4_mul(corner[1], share));
    let off_u = S::d4_add(S::d4_mul(S::d4_abs(u), of_slope), aside);
    let off_v = S::d4_add(S::d4_mul(S::d4_abs(v), of_slope), aside);
    ([u, v], [off_u, off_v])
}

/// Where rays that run the same way carry a corner, and what that may be off by.
#[inline(always)]
fn carried<S: Simd>(corner: &[S::D4; 3], shear: [f64; 2], size: f64) -> ([S::D4; 2], [S::D4; 2]) {
    let back_u = S::d4_mul(S::d4_splat(shear[0]), corner[2]);
    let back_v = S::d4_mul(S::d4_splat(shear[1]), corner[2]);
    let (u, v) = (S::d4_sub(corner[0], back_u), S::d4_sub(corner[1], back_v));
    let largest = S::d4_max(S::d4_max(S::d4_abs(corner[0]), S::d4_abs(corner[1])), S::d4_abs(corner[2]));
    let roundings = S::d4_mul(S::d4_add(largest, S::d4_splat(size)), S::d4_splat(PRODUCT_SLACK));
    let off_u = S::d4_add(S::d4_mul(S::d4_abs(u), S::d4_splat(SLOPE_SLACK)), roundings);
    let off_v = S::d4_add(S::d4_mul(S::d4_abs(v), S::d4_splat(SLOPE_SLACK)), roundings);
    ([u, v], [off_u, off_v])
}

/// What a corner's slope, computed in f64, may be off by, and a ray's in f32, as a share.
const SLOPE_SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// 32 roundings of f64.
pub const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// The least normal number of f32: what smaller ones may be off by, and more.
pub const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

#[inline(always)]
fn eight<S: Simd>(list: &[f32; BLOCKS], first: usize) -> S::F8 {
    let mut some = [0.0; WIDTH];
    some.copy_from_slice(&list[first..first + WIDTH]);
    S::f8(some)
}
