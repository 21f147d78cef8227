//! [`EdgeFunctions`]: the f32 test of a packet's rays against triangles: which rays certainly miss, which certainly
//! hit, and between which depths.

use super::frustum::Frustum;
use super::projected_triangles::{
    PRODUCT_SLACK, ProjectedTriangles, UNDERFLOW, above, below, difference_of_products, norm1, to_f32,
};
use super::rays::BLOCK;
use crate::geometry::four::{LANES4, MASK4};
use crate::geometry::simd::Simd;

/// The edge functions a u + b v + c of four triangles. A ray is inside if all three are positive or, where the side
/// of the triangle on which rays start is unknown, all three are negative.
///
/// Errors, with u = 2^-24 and P = |a u| + |b v| + |c|: a, b and c are rounded to f32 (u of themselves each), u and v
/// are off by 5 u, the products and sums round three times more: 9 u P at most. The bound uses 16 u P, which also
/// covers the two roundings of the sum of the three functions. In f64, a, b and c are products of corners A and B:
/// off by 4 roundings of |A| |B|, as are the tier's own edge functions. A ray that passes the apex at a distance of
/// up to `spread` sees an edge function that differs by that times the edge's length.
///
/// The sum of the three is n . (u, v, 1) for the triangle's normal n. The plane lies at the volume V = A . (B x C)
/// ahead of the apex in the same unit, so V over the sum is the depth of the intersection; edges are oriented so that
/// V is positive. V is off by 9 roundings of f64 of |A| |B| |C|, and the depth found by the tier, a sum of the
/// corners' depths by their weights, by at most 70; four times [`PRODUCT_SLACK`], 128, covers both. Rays that pass
/// the apex at depth 0 by up to `spread` (1 + |u| + |v|) on each axis meet a plane whose V differs by that times its
/// slopes across, a and b in sum. They may end beyond the apex by `spread`, at negative depths: V of planes met there
/// is at most `spread` times twice those slopes and c in sum; for these the sign of V is unknown.
pub(crate) struct EdgeFunctions {
    edges: [EdgeFunction4; 3],
    /// Bounds of V; 0 and infinity if depths are unknown.
    volumes: [[f32; LANES4]; 2],
    /// The sums of the three error bounds.
    bounds: [f32; LANES4],
    /// The triangles whose sign of V is known, as bits.
    oriented: u32,
    /// The sign of V in world axes, as a factor.
    pub signs: [f64; LANES4],
}

/// One edge function and its error bound for four triangles.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct EdgeFunction4 {
    a_and_b: [f32; 2 * LANES4],
    c_and_bound: [f32; 2 * LANES4],
}

/// The rays of a block against one triangle, as bits.
pub(crate) struct Overlap<S: Simd> {
    /// The rays that may hit.
    pub possible: u32,
    /// The rays whose line certainly passes through the triangle.
    pub certain: u32,
    /// The sums of the edge functions.
    sums: S::F8,
}

/// 16 u.
const EDGE_SLACK: f64 = 8.0 * f32::EPSILON as f64;

/// 1 - 8 u and 1 + 8 u: a sum, a difference from it and a quotient are off by 4 u.
const QUOTIENT_MARGINS: [f64; 2] = [1.0 - 4.0 * f32::EPSILON as f64, 1.0 + 4.0 * f32::EPSILON as f64];

impl EdgeFunctions {
    #[inline(always)]
    pub(crate) fn new<S: Simd>(projected: &ProjectedTriangles<S>, frustum: &Frustum) -> Self {
        let reach = frustum.intervals.map(|[low, high]| f64::from(low.abs().max(high.abs())));
        let slopes = 1.0 + reach[0] + reach[1];
        let reach = [S::d4_splat(reach[0]), S::d4_splat(reach[1])];
        let corners = &projected.corners;
        let sizes = [norm1::<S>(&corners[0]), norm1::<S>(&corners[1]), norm1::<S>(&corners[2])];
        let mut edges = [EdgeFunction4 { a_and_b: [0.0; 2 * LANES4], c_and_bound: [0.0; 2 * LANES4] }; 3];
        let zero = S::d4_splat(0.0);
        let (mut normal, mut bounds) = ([zero; 3], zero);
        let mut last = [zero; 3];
        for (k, edge) in edges.iter_mut().enumerate() {
            let (line, error) = line::<S>(projected, &sizes, frustum, slopes, k);
            let [a, b, c] = line;
            let error = S::d4_add(error, S::d4_splat(UNDERFLOW * slopes));
            let bound = edge.set::<S>(line, error, reach);
            normal = [S::d4_add(normal[0], a), S::d4_add(normal[1], b), S::d4_add(normal[2], c)];
            bounds = S::d4_add(bounds, bound);
            last = line;
        }
        let bounds = to_f32::<S>(above::<S>(bounds));
        if frustum.shear.is_some() {
            let unknown = [[0.0; LANES4], [f32::INFINITY; LANES4]];
            return EdgeFunctions { edges, volumes: unknown, bounds, oriented: 0, signs: [1.0; LANES4] };
        }
        // The last edge goes from the third corner to the first.
        let [x, y, z] = corners[1];
        let volume =
            S::d4_add(S::d4_add(S::d4_mul(x, last[0]), S::d4_mul(y, last[1])), S::d4_mul(z, last[2]));
        let error = volume_error::<S>(&sizes, &normal, frustum, slopes);
        let size = S::d4_abs(volume);
        let [smaller, larger] = QUOTIENT_MARGINS;
        // Clamped, because infinity would not be a lower bound.
        let least = S::d4_mul(S::d4_sub(size, error), S::d4_splat(smaller));
        let least = below::<S>(S::d4_min(S::d4_splat(f64::from(f32::MAX)), least));
        let most = above::<S>(S::d4_mul(S::d4_add(size, error), S::d4_splat(larger)));
        // Orients the edges so that V is positive.
        let sign = S::d4_copysign(S::d4_splat(1.0), volume);
        let signs = S::f8_from_d4(sign, sign);
        for edge in &mut edges {
            edge.a_and_b = S::f8_array(S::f8_mul(S::f8(edge.a_and_b), signs));
            let one = S::d4_splat(1.0);
            edge.c_and_bound = S::f8_array(S::f8_mul(S::f8(edge.c_and_bound), S::f8_from_d4(sign, one)));
        }
        let oriented = S::d4_lt(error, size);
        let volumes = [to_f32::<S>(least), to_f32::<S>(most)];
        // A flipped depth axis mirrors the triangle.
        let mirrored = S::d4_splat(if frustum.flipped { -1.0 } else { 1.0 });
        EdgeFunctions { edges, volumes, bounds, oriented, signs: S::d4_array(S::d4_mul(sign, mirrored)) }
    }

    /// The rays of a block against the triangle in a lane.
    #[inline(always)]
    pub(crate) fn overlap<S: Simd>(&self, lane: usize, u: [f32; BLOCK], v: [f32; BLOCK]) -> Overlap<S> {
        let (u, v) = (S::f8(u), S::f8(v));
        let zero = S::f8_splat(0.0);
        let (mut values, mut bounds) = ([zero; 3], [zero; 3]);
        for (k, EdgeFunction4 { a_and_b, c_and_bound }) in self.edges.iter().enumerate() {
            let (a, b) = (S::f8_splat(a_and_b[lane]), S::f8_splat(a_and_b[LANES4 + lane]));
            let c = S::f8_splat(c_and_bound[lane]);
            values[k] = S::mul_add(a, u, S::mul_add(b, v, c));
            bounds[k] = S::f8_splat(c_and_bound[LANES4 + lane]);
        }
        let ([x, y, z], [of_x, of_y, of_z]) = (values, bounds);
        let least = S::f8_min(S::f8_min(S::f8_add(x, of_x), S::f8_add(y, of_y)), S::f8_add(z, of_z));
        let mut possible = S::f8_le(zero, least);
        if self.oriented >> lane & 1 == 0 {
            let most = S::f8_max(S::f8_max(S::f8_sub(x, of_x), S::f8_sub(y, of_y)), S::f8_sub(z, of_z));
            possible |= S::f8_le(most, zero);
            return Overlap { possible, certain: 0, sums: zero };
        }
        let least = S::f8_min(S::f8_min(S::f8_sub(x, of_x), S::f8_sub(y, of_y)), S::f8_sub(z, of_z));
        Overlap { possible, certain: S::f8_le(zero, least), sums: S::f8_add(S::f8_add(x, y), z) }
    }

    /// Bounds of the depths at which the certain rays of a block hit the triangle in a lane.
    #[inline(always)]
    pub(crate) fn depths<S: Simd>(&self, lane: usize, overlap: &Overlap<S>) -> [S::F8; 2] {
        let zero = S::f8_splat(0.0);
        let bound = S::f8_splat(self.bounds[lane]);
        // A sum within its error bound may be 0.
        let least = S::f8_max(S::f8_sub(overlap.sums, bound), zero);
        let most = S::f8_add(overlap.sums, bound);
        let [nearest, farthest] = [S::f8_splat(self.volumes[0][lane]), S::f8_splat(self.volumes[1][lane])];
        [S::f8_div(nearest, most), S::f8_div(farthest, least)]
    }
}

impl EdgeFunction4 {
    /// Writes edge functions with the given errors in f64, and returns their error bounds. `reach` are the largest
    /// |u| and |v|.
    #[inline(always)]
    fn set<S: Simd>(&mut self, [a, b, c]: [S::D4; 3], error: S::D4, reach: [S::D4; 2]) -> S::D4 {
        let (of_u, of_v) = (S::d4_mul(S::d4_abs(a), reach[0]), S::d4_mul(S::d4_abs(b), reach[1]));
        let size = S::d4_add(S::d4_add(of_u, of_v), S::d4_abs(c));
        let bound = above::<S>(S::d4_add(S::d4_mul(size, S::d4_splat(EDGE_SLACK)), error));
        self.a_and_b = S::f8_array(S::f8_from_d4(a, b));
        self.c_and_bound = S::f8_array(S::f8_from_d4(c, bound));
        // Where f32 overflows, every ray may be inside.
        let largest = S::d4_max(S::d4_abs(a), S::d4_max(S::d4_abs(b), S::d4_max(size, bound)));
        let mut overflows = !S::d4_lt(largest, S::d4_splat(f64::from(f32::MAX) / 2.0)) & MASK4;
        while overflows != 0 {
            let lane = overflows.trailing_zeros() as usize % LANES4;
            overflows &= overflows - 1;
            (self.a_and_b[lane], self.a_and_b[LANES4 + lane]) = (0.0, 0.0);
            (self.c_and_bound[lane], self.c_and_bound[LANES4 + lane]) = (0.0, f32::INFINITY);
        }
        bound
    }
}

/// Edge function k of four triangles, from corner k to the next, and its error in f64. `sizes` are the norms of the
/// corners, `slopes` is a bound on 1 + |u| + |v|.
#[inline(always)]
fn line<S: Simd>(
    projected: &ProjectedTriangles<S>,
    sizes: &[S::D4; 3],
    frustum: &Frustum,
    slopes: f64,
    k: usize,
) -> ([S::D4; 3], S::D4) {
    let next = (k + 1) % 3;
    if frustum.shear.is_some() {
        let (p, q) = (projected.points[k], projected.points[next]);
        let line = [
            S::d4_sub(p[1], q[1]),
            S::d4_sub(q[0], p[0]),
            difference_of_products::<S>(p[0], q[1], p[1], q[0]),
        ];
        // A point is off by a few roundings of its corner and of the origins of the rays.
        let size = S::d4_add(S::d4_add(sizes[k], sizes[next]), S::d4_splat(frustum.reach));
        return (line, S::d4_mul(S::d4_mul(size, size), S::d4_splat(PRODUCT_SLACK)));
    }
    let (p, q) = (projected.corners[k], projected.corners[next]);
    let rounding = S::d4_mul(S::d4_mul(sizes[k], sizes[next]), S::d4_splat(PRODUCT_SLACK));
    let error = if frustum.spread == 0.0 {
        rounding
    } else {
        let along = [S::d4_sub(q[0], p[0]), S::d4_sub(q[1], p[1]), S::d4_sub(q[2], p[2])];
        let length = S::d4_add(norm1::<S>(&along), S::d4_splat(frustum.spread));
        S::d4_add(rounding, S::d4_mul(S::d4_splat(2.0 * frustum.spread), length))
    };
    let line = [
        difference_of_products::<S>(p[1], q[2], p[2], q[1]),
        difference_of_products::<S>(p[2], q[0], p[0], q[2]),
        difference_of_products::<S>(p[0], q[1], p[1], q[0]),
    ];
    (line, S::d4_mul(error, S::d4_splat(slopes)))
}

/// The error of V: see [`EdgeFunctions`]. `normal` is the sum of the edge functions' coefficients.
#[inline(always)]
fn volume_error<S: Simd>(sizes: &[S::D4; 3], normal: &[S::D4; 3], frustum: &Frustum, slopes: f64) -> S::D4 {
    let product = S::d4_mul(S::d4_mul(sizes[0], sizes[1]), sizes[2]);
    let error = S::d4_add(S::d4_mul(product, S::d4_splat(4.0 * PRODUCT_SLACK)), S::d4_splat(UNDERFLOW));
    if frustum.spread == 0.0 {
        return error;
    }
    let pairs = S::d4_mul(S::d4_add(sizes[0], sizes[1]), S::d4_add(sizes[1], sizes[2]));
    let across = S::d4_add(S::d4_abs(normal[0]), S::d4_abs(normal[1]));
    let total = S::d4_add(S::d4_mul(across, S::d4_splat(slopes)), S::d4_abs(normal[2]));
    let total = S::d4_add(total, S::d4_mul(pairs, S::d4_splat(4.0 * PRODUCT_SLACK * slopes)));
    S::d4_add(error, S::d4_mul(total, S::d4_splat(2.0 * frustum.spread)))
}
