//! [`EdgeFunctions`]: the f32 test of a packet's rays against triangles: which rays certainly miss, which certainly
//! hit, and between which depths.

use super::frustum::Frustum;
use super::projected_triangles::{
    PRODUCT_SLACK, ProjectedTriangles, UNDERFLOW, above, below, difference_of_products, norm1, to_f32,
};
use crate::geometry::lanes::{LANES4, MASK4};
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};

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
    sums: S::F,
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
        let reach = [S::D4::splat(reach[0]), S::D4::splat(reach[1])];
        let corners = &projected.corners;
        let sizes = [norm1::<S>(&corners[0]), norm1::<S>(&corners[1]), norm1::<S>(&corners[2])];
        let mut edges = [EdgeFunction4 { a_and_b: [0.0; 2 * LANES4], c_and_bound: [0.0; 2 * LANES4] }; 3];
        let zero = S::D4::splat(0.0);
        let (mut normal, mut bounds) = ([zero; 3], zero);
        let mut last = [zero; 3];
        for (k, edge) in edges.iter_mut().enumerate() {
            let (line, error) = line::<S>(projected, &sizes, frustum, slopes, k);
            let [a, b, c] = line;
            let error = error + S::D4::splat(UNDERFLOW * slopes);
            let bound = edge.set::<S>(line, error, reach);
            normal = [normal[0] + a, normal[1] + b, normal[2] + c];
            bounds = bounds + bound;
            last = line;
        }
        let bounds = to_f32::<S>(above::<S>(bounds));
        if frustum.shear.is_some() {
            let unknown = [[0.0; LANES4], [f32::INFINITY; LANES4]];
            return EdgeFunctions { edges, volumes: unknown, bounds, oriented: 0, signs: [1.0; LANES4] };
        }
        // The last edge goes from the third corner to the first.
        let [x, y, z] = corners[1];
        let volume = x * last[0] + y * last[1] + z * last[2];
        let error = volume_error::<S>(&sizes, &normal, frustum, slopes);
        let size = volume.abs();
        let [smaller, larger] = QUOTIENT_MARGINS;
        // Clamped, because infinity would not be a lower bound.
        let least = (size - error) * S::D4::splat(smaller);
        let least = below::<S>(S::D4::splat(f64::from(f32::MAX)).min(least));
        let most = above::<S>((size + error) * S::D4::splat(larger));
        // Orients the edges so that V is positive.
        let sign = S::D4::splat(1.0).copysign(volume);
        let signs = S::D4::to_floats(sign, sign);
        for edge in &mut edges {
            edge.a_and_b = (S::F8::load(edge.a_and_b) * signs).array();
            let one = S::D4::splat(1.0);
            edge.c_and_bound = (S::F8::load(edge.c_and_bound) * S::D4::to_floats(sign, one)).array();
        }
        let oriented = error.lt(size);
        let volumes = [to_f32::<S>(least), to_f32::<S>(most)];
        // A flipped depth axis mirrors the triangle.
        let mirrored = S::D4::splat(if frustum.flipped { -1.0 } else { 1.0 });
        EdgeFunctions { edges, volumes, bounds, oriented, signs: (sign * mirrored).array() }
    }

    /// The rays of a block against the triangle in a lane.
    #[inline(always)]
    pub(crate) fn overlap<S: Simd>(&self, lane: usize, u: S::F, v: S::F) -> Overlap<S> {
        let zero = S::F::splat(0.0);
        let (mut values, mut bounds) = ([zero; 3], [zero; 3]);
        for (k, EdgeFunction4 { a_and_b, c_and_bound }) in self.edges.iter().enumerate() {
            let (a, b) = (S::F::splat(a_and_b[lane]), S::F::splat(a_and_b[LANES4 + lane]));
            let c = S::F::splat(c_and_bound[lane]);
            values[k] = a.mul_add(u, b.mul_add(v, c));
            bounds[k] = S::F::splat(c_and_bound[LANES4 + lane]);
        }
        let ([x, y, z], [of_x, of_y, of_z]) = (values, bounds);
        let least = (x + of_x).min(y + of_y).min(z + of_z);
        let mut possible = zero.le(least);
        if self.oriented >> lane & 1 == 0 {
            let most = (x - of_x).max(y - of_y).max(z - of_z);
            possible |= most.le(zero);
            return Overlap { possible, certain: 0, sums: zero };
        }
        let least = (x - of_x).min(y - of_y).min(z - of_z);
        Overlap { possible, certain: zero.le(least), sums: x + y + z }
    }

    /// Bounds of the depths at which the certain rays of a block hit the triangle in a lane.
    #[inline(always)]
    pub(crate) fn depths<S: Simd>(&self, lane: usize, overlap: &Overlap<S>) -> [S::F; 2] {
        let zero = S::F::splat(0.0);
        let bound = S::F::splat(self.bounds[lane]);
        // A sum within its error bound may be 0.
        let least = (overlap.sums - bound).max(zero);
        let most = overlap.sums + bound;
        let [nearest, farthest] = [S::F::splat(self.volumes[0][lane]), S::F::splat(self.volumes[1][lane])];
        [nearest / most, farthest / least]
    }
}

impl EdgeFunction4 {
    /// Writes edge functions with the given errors in f64, and returns their error bounds. `reach` are the largest
    /// |u| and |v|.
    #[inline(always)]
    fn set<S: Simd>(&mut self, [a, b, c]: [S::D4; 3], error: S::D4, reach: [S::D4; 2]) -> S::D4 {
        let (of_u, of_v) = (a.abs() * reach[0], b.abs() * reach[1]);
        let size = of_u + of_v + c.abs();
        let bound = above::<S>(size * S::D4::splat(EDGE_SLACK) + error);
        self.a_and_b = S::D4::to_floats(a, b).array();
        self.c_and_bound = S::D4::to_floats(c, bound).array();
        // Where f32 overflows, every ray may be inside.
        let largest = a.abs().max(b.abs().max(size.max(bound)));
        let mut overflows = !largest.lt(S::D4::splat(f64::from(f32::MAX) / 2.0)) & MASK4;
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
        let line = [p[1] - q[1], q[0] - p[0], difference_of_products::<S>(p[0], q[1], p[1], q[0])];
        // A point is off by a few roundings of its corner and of the origins of the rays.
        let size = sizes[k] + sizes[next] + S::D4::splat(frustum.reach);
        return (line, size * size * S::D4::splat(PRODUCT_SLACK));
    }
    let (p, q) = (projected.corners[k], projected.corners[next]);
    let rounding = sizes[k] * sizes[next] * S::D4::splat(PRODUCT_SLACK);
    let error = if frustum.spread == 0.0 {
        rounding
    } else {
        let along = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
        let length = norm1::<S>(&along) + S::D4::splat(frustum.spread);
        rounding + S::D4::splat(2.0 * frustum.spread) * length
    };
    let line = [
        difference_of_products::<S>(p[1], q[2], p[2], q[1]),
        difference_of_products::<S>(p[2], q[0], p[0], q[2]),
        difference_of_products::<S>(p[0], q[1], p[1], q[0]),
    ];
    (line, error * S::D4::splat(slopes))
}

/// The error of V: see [`EdgeFunctions`]. `normal` is the sum of the edge functions' coefficients.
#[inline(always)]
fn volume_error<S: Simd>(sizes: &[S::D4; 3], normal: &[S::D4; 3], frustum: &Frustum, slopes: f64) -> S::D4 {
    let product = sizes[0] * sizes[1] * sizes[2];
    let error = product * S::D4::splat(4.0 * PRODUCT_SLACK) + S::D4::splat(UNDERFLOW);
    if frustum.spread == 0.0 {
        return error;
    }
    let pairs = (sizes[0] + sizes[1]) * (sizes[1] + sizes[2]);
    let across = normal[0].abs() + normal[1].abs();
    let total = across * S::D4::splat(slopes) + normal[2].abs();
    let total = total + pairs * S::D4::splat(4.0 * PRODUCT_SLACK * slopes);
    error + total * S::D4::splat(2.0 * frustum.spread)
}
