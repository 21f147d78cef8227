//! Triangles as a packet sees them: where they lie in its plane of u and v, and which of its rays can be inside.

use super::frustum::{BLOCKS, Frustum};
use super::node::WIDTH;
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Corner, Quad, Tier, round_down, round_up};

/// Least and greatest u, least and greatest v of every block of rays.
pub type Extents = [[[f32; BLOCKS]; 2]; 2];

/// The edges of a triangle as functions of u and v, each `[a, b, c]` for a u + b v + c; a ray is inside where all are
/// positive or all negative.
///
/// Each is off by less than its bound. With P = |a u| + |b v| + |c|: a, b and c are rounded to f32 (u of themselves each), u
/// and v are off by 5 u, the products and sums round three times more: 9 u P at most, and 16 u P stands here. In f64, a, b and c are
/// products of corners A and B: off by 4 of its roundings of |A| |B|, as is what the tier decides by. And a ray
/// that passes the apex on a side by `spread` sees an edge function that differs by the edge's length times that.
pub struct Edges {
    lines: [[f32; 3]; 3],
    bounds: [f32; 3],
}

/// A group of triangles seen from an apex: across its u and v, and in depth.
pub struct Seen {
    /// Corners from the apex, each `[u axis, v axis, depth][lane]`.
    corners: [[[f64; LANES]; 3]; 3],
    /// Where rays that run the same way carry them, each `[u, v][lane]`.
    points: [[[f64; LANES]; 2]; 3],
    /// The least depth of each triangle.
    pub nearest: [f64; LANES],
    /// Least and greatest u, least and greatest v; infinite where a corner is not before the apex.
    extents: [[[f64; LANES]; 2]; 2],
    /// The triangles that overlap the packet.
    pub overlapping: u32,
}

impl Seen {
    #[inline(always)]
    pub fn new<S: Simd, T: Tier>(quad: &Quad<T::Corner>, frustum: &Frustum) -> Self {
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
        let parallel = frustum.shear.is_some();
        let all = (1 << LANES) - 1;
        let clear = if parallel { all } else { S::d4_lt(S::d4_add(spread, spread), nearest) };
        let slope = |k: usize, side: usize| S::d4_splat(f64::from(frustum.slopes[k][side]));
        let mut across = S::d4_le(least[0], slope(0, 1)) & S::d4_le(slope(0, 0), most[0]);
        across &= S::d4_le(least[1], slope(1, 1)) & S::d4_le(slope(1, 0), most[1]);
        let start = S::d4_sub(S::d4_splat(f64::from(frustum.start)), spread);
        let ahead = S::d4_le(start, farthest) & S::d4_le(nearest, depth);
        let mut seen = Seen {
            corners: [[[0.0; LANES]; 3]; 3],
            points: [[[0.0; LANES]; 2]; 3],
            nearest: S::d4_array(nearest),
            extents: [
                [S::d4_array(least[0]), S::d4_array(most[0])],
                [S::d4_array(least[1]), S::d4_array(most[1])],
            ],
            overlapping: ahead & (across | !clear & all),
        };
        for k in 0..3 {
            for place in 0..3 {
                seen.corners[k][place] = S::d4_array(corners[k][place]);
            }
            if parallel {
                seen.points[k] = [S::d4_array(points[k][0]), S::d4_array(points[k][1])];
            }
        }
        let mut unclear = !clear & all;
        while unclear != 0 {
            let lane = unclear.trailing_zeros() as usize % LANES;
            unclear &= unclear - 1;
            for extent in &mut seen.extents {
                (extent[0][lane], extent[1][lane]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
        seen
    }

    /// The blocks of the packet that a triangle overlaps, as bits.
    #[inline(always)]
    pub fn blocks<S: Simd>(&self, lane: usize, extents: &Extents) -> u32 {
        let mut blocks = 0;
        for some in (0..BLOCKS).step_by(WIDTH) {
            let mut mask = u32::MAX;
            for k in 0..2 {
                let low = S::f8_splat(round_down(self.extents[k][0][lane]));
                let high = S::f8_splat(round_up(self.extents[k][1][lane]));
                let [least, most] = &extents[k];
                mask &= S::f8_le(eight::<S>(least, some), high) & S::f8_le(low, eight::<S>(most, some));
            }
            blocks |= mask << some;
        }
        blocks
    }

    /// The edges of a triangle as functions of u and v.
    #[inline(always)]
    pub fn edges(&self, lane: usize, frustum: &Frustum) -> Edges {
        let corner = |k: usize| [0, 1, 2].map(|place| self.corners[k][place][lane]);
        let corners = [corner(0), corner(1), corner(2)];
        let reach = frustum.slopes.map(|[low, high]| f64::from(low.abs().max(high.abs())));
        let sum = |x: [f64; 3]| x[0].abs() + x[1].abs() + x[2].abs();
        let mut edges = Edges { lines: [[0.0; 3]; 3], bounds: [0.0; 3] };
        for k in 0..3 {
            let next = (k + 1) % 3;
            let (p, q) = (corners[k], corners[next]);
            let (line, off) = match frustum.shear {
                None => {
                    let length = (q[0] - p[0]).abs() + (q[1] - p[1]).abs() + (q[2] - p[2]).abs();
                    let line =
                        [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
                    let aside = 1.0 + reach[0] + reach[1];
                    let passing = 2.0 * frustum.spread * (length + frustum.spread);
                    (line, (sum(p) * sum(q) * PRODUCT_SLACK + passing) * aside)
                }
                Some(_) => {
                    let point = |k: usize| [0, 1].map(|place| self.points[k][place][lane]);
                    let (a, b) = (point(k), point(next));
                    let line = [a[1] - b[1], b[0] - a[0], a[0] * b[1] - a[1] * b[0]];
                    // A point is off by a few roundings of the corner that was carried, and of where the rays start.
                    let size = sum(p) + sum(q) + frustum.size;
                    (line, size * size * PRODUCT_SLACK)
                }
            };
            let size = line[0].abs() * reach[0] + line[1].abs() * reach[1] + line[2].abs();
            let bound = size * EDGE_SLACK + off + UNDERFLOW * (1.0 + reach[0] + reach[1]);
            // What f32 cannot hold says nothing: every ray may be inside.
            edges.bounds[k] = if size < f64::from(f32::MAX) { round_up(bound) } else { f32::INFINITY };
            if edges.bounds[k].is_finite() {
                edges.lines[k] = [line[0] as f32, line[1] as f32, line[2] as f32];
            }
        }
        edges
    }
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

/// 16 u: see [`Edges`].
const EDGE_SLACK: f64 = 8.0 * f32::EPSILON as f64;

/// 32 roundings of f64: see [`Edges`].
const PRODUCT_SLACK: f64 = 16.0 * f64::EPSILON;

/// The least normal number of f32: what smaller ones may be off by, and more.
const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

#[inline(always)]
fn eight<S: Simd>(list: &[f32; BLOCKS], first: usize) -> S::F8 {
    let mut some = [0.0; WIDTH];
    some.copy_from_slice(&list[first..first + WIDTH]);
    S::f8(some)
}

impl Edges {
    /// The rays of a block that may be inside, as bits.
    #[inline(always)]
    pub fn inside<S: Simd>(&self, u: [f32; WIDTH], v: [f32; WIDTH]) -> u32 {
        let (u, v) = (S::f8(u), S::f8(v));
        let zero = S::f8_splat(0.0);
        let (mut least, mut most) = (S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY));
        for ([a, b, c], bound) in self.lines.into_iter().zip(self.bounds) {
            let value = S::mul_add(S::f8_splat(a), u, S::mul_add(S::f8_splat(b), v, S::f8_splat(c)));
            least = S::f8_min(S::f8_add(value, S::f8_splat(bound)), least);
            most = S::f8_max(S::f8_sub(value, S::f8_splat(bound)), most);
        }
        S::f8_le(zero, least) | S::f8_le(most, zero)
    }
}
