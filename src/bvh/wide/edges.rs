//! The rays of a packet against triangles, in f32: which surely pass beside one, which surely meet it, and between which depths.

use super::frustum::Frustum;
use super::node::WIDTH;
use super::seen::{ALL, PRODUCT_SLACK, Seen, UNDERFLOW, above, below, cross, four, size_of};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;

/// The edges of four triangles as functions of u and v; each a u + b v + c, and a ray is inside where all are positive, or where
/// it is not known on which side of the triangle it starts, all negative.
///
/// Each is off by less than its bound. With P = |a u| + |b v| + |c|: a, b and c are rounded to f32 (u of themselves each), u
/// and v are off by 5 u, the products and sums round three times more: 9 u P at most, and 16 u P stands here, which leaves the
/// sum of the three its two roundings. In f64, a, b and c are products of corners A and B: off by 4 of its roundings of |A| |B|,
/// as is what the tier decides by. And a ray that passes the apex on a side by `spread` sees an edge function that differs by the
/// edge's length times that.
///
/// The sum of the three is how fast the ray (u, v, 1) goes through the triangle's plane, which lies ahead of the apex by
/// the volume V = A . (B x C): so the quotient is the depth where it meets it, and edges are turned so that V is positive. V is
/// off by 9 roundings of f64 of |A| |B| |C|, and the depth that the tier finds, a sum of the corners' depths by their weights, is so
/// by no more than 70; four times [`PRODUCT_SLACK`], 128, stands for both. Rays that pass the apex on a side, at depth 0 by `spread` (1 +
/// |u| + |v|) on each axis at most, meet a plane that is ahead by that times its slopes across, a and b in sum, more or less. They may
/// end beyond the apex, by `spread`, where depths are negative: planes that are so near that they are met there are ahead by no
/// more than twice those slopes and c in sum times `spread`; of them the sign of V says nothing.
pub struct Edges {
    edges: [EdgeLanes; 3],
    /// V, at least and at most; from 0 to infinity where nothing is known of depths.
    volumes: [[f32; LANES]; 2],
    /// The sums of the edges' bounds.
    bounds: [f32; LANES],
    /// The triangles of which the sign of V is known,
    ahead: u32,
    /// and that sign as a factor, of the volume in the scene's axes.
    pub signs: [f64; LANES],
}

/// One edge of four triangles.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct EdgeLanes {
    a_and_b: [f32; 2 * LANES],
    c_and_bound: [f32; 2 * LANES],
}

/// What the rays of a block are to a triangle, as bits.
pub struct Met<S: Simd> {
    /// Those that may be inside.
    pub maybe: u32,
    /// Those that surely are.
    pub surely: u32,
    /// The sums of the edge functions.
    sums: S::F8,
}

/// 16 u.
const EDGE_SLACK: f64 = 8.0 * f32::EPSILON as f64;

/// 1 - 8 u and 1 + 8 u: a sum, a difference from it and a quotient are off by 4 u.
const QUOTIENT_MARGINS: [f64; 2] = [1.0 - 4.0 * f32::EPSILON as f64, 1.0 + 4.0 * f32::EPSILON as f64];

impl Edges {
    /// Of what is seen.
    #[inline(always)]
    pub fn new<S: Simd>(seen: &Seen<S>, frustum: &Frustum) -> Self {
        let reach = frustum.slopes.map(|[low, high]| f64::from(low.abs().max(high.abs())));
        let aside = 1.0 + reach[0] + reach[1];
        let (reach_u, reach_v) = (S::d4_splat(reach[0]), S::d4_splat(reach[1]));
        let corners = &seen.corners;
        let sizes = [size_of::<S>(&corners[0]), size_of::<S>(&corners[1]), size_of::<S>(&corners[2])];
        let mut edges = [EdgeLanes { a_and_b: [0.0; 2 * LANES], c_and_bound: [0.0; 2 * LANES] }; 3];
        let zero = S::d4_splat(0.0);
        let (mut normal, mut bounds) = ([zero; 3], zero);
        let mut last = [zero; 3];
        for (k, edge) in edges.iter_mut().enumerate() {
            let next = (k + 1) % 3;
            let ([a, b, c], off) = match frustum.shear {
                None => {
                    let (p, q) = (corners[k], corners[next]);
                    let off = S::d4_mul(S::d4_mul(sizes[k], sizes[next]), S::d4_splat(PRODUCT_SLACK));
                    let passing = if frustum.spread == 0.0 {
                        off
                    } else {
                        let along = [S::d4_sub(q[0], p[0]), S::d4_sub(q[1], p[1]), S::d4_sub(q[2], p[2])];
                        let length = S::d4_add(size_of::<S>(&along), S::d4_splat(frustum.spread));
                        S::d4_add(off, S::d4_mul(S::d4_splat(2.0 * frustum.spread), length))
                    };
                    let line = [
                        cross::<S>(p[1], q[2], p[2], q[1]),
                        cross::<S>(p[2], q[0], p[0], q[2]),
                        cross::<S>(p[0], q[1], p[1], q[0]),
                    ];
                    (line, S::d4_mul(passing, S::d4_splat(aside)))
                }
                Some(_) => {
                    let (p, q) = (seen.points[k], seen.points[next]);
                    let line =
                        [S::d4_sub(p[1], q[1]), S::d4_sub(q[0], p[0]), cross::<S>(p[0], q[1], p[1], q[0])];
                    // A point is off by a few roundings of the corner that was carried, and of where the rays start.
                    let size = S::d4_add(S::d4_add(sizes[k], sizes[next]), S::d4_splat(frustum.size));
                    (line, S::d4_mul(S::d4_mul(size, size), S::d4_splat(PRODUCT_SLACK)))
                }
            };
            let (of_u, of_v) = (S::d4_mul(S::d4_abs(a), reach_u), S::d4_mul(S::d4_abs(b), reach_v));
            let size = S::d4_add(S::d4_add(of_u, of_v), S::d4_abs(c));
            let off = S::d4_add(off, S::d4_splat(UNDERFLOW * aside));
            let bound = above::<S>(S::d4_add(S::d4_mul(size, S::d4_splat(EDGE_SLACK)), off));
            edge.a_and_b = S::f8_array(S::f8_from_d4(a, b));
            edge.c_and_bound = S::f8_array(S::f8_from_d4(c, bound));
            normal = [S::d4_add(normal[0], a), S::d4_add(normal[1], b), S::d4_add(normal[2], c)];
            bounds = S::d4_add(bounds, bound);
            last = [a, b, c];
            // What f32 cannot hold says nothing: every ray may be inside.
            let largest = S::d4_max(S::d4_abs(a), S::d4_max(S::d4_abs(b), S::d4_max(size, bound)));
            let mut beyond = !S::d4_lt(largest, S::d4_splat(f64::from(f32::MAX) / 2.0)) & ALL;
            while beyond != 0 {
                let lane = beyond.trailing_zeros() as usize % LANES;
                beyond &= beyond - 1;
                (edge.a_and_b[lane], edge.a_and_b[LANES + lane]) = (0.0, 0.0);
                (edge.c_and_bound[lane], edge.c_and_bound[LANES + lane]) = (0.0, f32::INFINITY);
            }
        }
        let bounds = four::<S>(above::<S>(bounds));
        if frustum.shear.is_some() {
            return Edges { edges, volumes: UNKNOWN, bounds, ahead: 0, signs: [1.0; LANES] };
        }
        // The last edge goes from the third corner to the first.
        let [x, y, z] = corners[1];
        let volume =
            S::d4_add(S::d4_add(S::d4_mul(x, last[0]), S::d4_mul(y, last[1])), S::d4_mul(z, last[2]));
        let product = S::d4_mul(S::d4_mul(sizes[0], sizes[1]), sizes[2]);
        let mut off = S::d4_add(S::d4_mul(product, S::d4_splat(4.0 * PRODUCT_SLACK)), S::d4_splat(UNDERFLOW));
        if frustum.spread != 0.0 {
            let pairs = S::d4_mul(S::d4_add(sizes[0], sizes[1]), S::d4_add(sizes[1], sizes[2]));
            let slopes = S::d4_add(S::d4_abs(normal[0]), S::d4_abs(normal[1]));
            let slopes = S::d4_add(S::d4_mul(slopes, S::d4_splat(aside)), S::d4_abs(normal[2]));
            let slopes = S::d4_add(slopes, S::d4_mul(pairs, S::d4_splat(4.0 * PRODUCT_SLACK * aside)));
            off = S::d4_add(off, S::d4_mul(slopes, S::d4_splat(2.0 * frustum.spread)));
        }
        let size = S::d4_abs(volume);
        let [smaller, larger] = QUOTIENT_MARGINS;
        // No less than all that f32 can hold is at least that.
        let least = S::d4_mul(S::d4_sub(size, off), S::d4_splat(smaller));
        let least = below::<S>(S::d4_min(S::d4_splat(f64::from(f32::MAX)), least));
        let most = above::<S>(S::d4_mul(S::d4_add(size, off), S::d4_splat(larger)));
        // Turned by a factor of 1 or -1, by which every sign is that of V.
        let sign = S::d4_copysign(S::d4_splat(1.0), volume);
        let signs = S::f8_from_d4(sign, sign);
        for edge in &mut edges {
            edge.a_and_b = S::f8_array(S::f8_mul(S::f8(edge.a_and_b), signs));
            let one = S::d4_splat(1.0);
            edge.c_and_bound = S::f8_array(S::f8_mul(S::f8(edge.c_and_bound), S::f8_from_d4(sign, one)));
        }
        let ahead = S::d4_lt(off, size);
        let volumes = [four::<S>(least), four::<S>(most)];
        // A frustum that looks down its axis sees a mirror image.
        let mirrored = S::d4_splat(if frustum.downwards { -1.0 } else { 1.0 });
        Edges { edges, volumes, bounds, ahead, signs: S::d4_array(S::d4_mul(sign, mirrored)) }
    }

    /// What the rays of a block are to the triangle in a lane.
    #[inline(always)]
    pub fn meet<S: Simd>(&self, lane: usize, u: [f32; WIDTH], v: [f32; WIDTH]) -> Met<S> {
        let (u, v) = (S::f8(u), S::f8(v));
        let zero = S::f8_splat(0.0);
        let (mut values, mut bounds) = ([zero; 3], [zero; 3]);
        for (k, EdgeLanes { a_and_b, c_and_bound }) in self.edges.iter().enumerate() {
            let (a, b) = (S::f8_splat(a_and_b[lane]), S::f8_splat(a_and_b[LANES + lane]));
            let c = S::f8_splat(c_and_bound[lane]);
            values[k] = S::mul_add(a, u, S::mul_add(b, v, c));
            bounds[k] = S::f8_splat(c_and_bound[LANES + lane]);
        }
        let ([x, y, z], [of_x, of_y, of_z]) = (values, bounds);
        let least = S::f8_min(S::f8_min(S::f8_add(x, of_x), S::f8_add(y, of_y)), S::f8_add(z, of_z));
        let mut maybe = S::f8_le(zero, least);
        if self.ahead >> lane & 1 == 0 {
            let most = S::f8_max(S::f8_max(S::f8_sub(x, of_x), S::f8_sub(y, of_y)), S::f8_sub(z, of_z));
            maybe |= S::f8_le(most, zero);
            return Met { maybe, surely: 0, sums: zero };
        }
        let least = S::f8_min(S::f8_min(S::f8_sub(x, of_x), S::f8_sub(y, of_y)), S::f8_sub(z, of_z));
        Met { maybe, surely: S::f8_le(zero, least), sums: S::f8_add(S::f8_add(x, y), z) }
    }

    /// The depths between which rays that surely meet the triangle in a lane do so.
    #[inline(always)]
    pub fn depths<S: Simd>(&self, lane: usize, met: &Met<S>) -> [S::F8; 2] {
        let zero = S::f8_splat(0.0);
        let bound = S::f8_splat(self.bounds[lane]);
        // Nothing is left of a sum that is not above its bound.
        let (least, most) = (S::f8_max(S::f8_sub(met.sums, bound), zero), S::f8_add(met.sums, bound));
        let [nearest, farthest] = [S::f8_splat(self.volumes[0][lane]), S::f8_splat(self.volumes[1][lane])];
        [S::f8_div(nearest, most), S::f8_div(farthest, least)]
    }
}

/// Volumes of which nothing is known.
const UNKNOWN: [[f32; LANES]; 2] = [[0.0; LANES], [f32::INFINITY; LANES]];
