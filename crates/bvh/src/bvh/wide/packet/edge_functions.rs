//! [`EdgeFunctions`]: the f32 test of a packet's rays against triangles: which rays certainly miss, which certainly
//! hit, and between which depths.

use super::frustum::Frustum;
use super::projected_triangles::{
    Arithmetic, InF64, PRODUCT_SLACK, ProjectedTriangles, UNDERFLOW, above, below, difference_of_products,
    norm1,
};
use super::rays::OfBlock;
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};

/// The edge functions a u + b v + c of a triangle in each lane of [`Simd::D`]. A ray is inside if all three are
/// positive or, where the side of the triangle on which rays start is unknown, all three are negative.
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
pub(crate) struct EdgeFunctions<S: Simd> {
    edges: [EdgeFunctionN<S>; 3],
    /// Bounds of V; 0 and infinity if depths are unknown.
    volumes: [OfBlock<S>; 2],
    /// The sums of the three error bounds.
    bounds: OfBlock<S>,
    /// The triangles whose sign of V is known, as bits.
    oriented: u32,
    /// The sign of V in world axes, as a factor.
    pub signs: <S::D as Vector>::Array,
}

/// One edge function and its error bound for each triangle: two numbers of every triangle in one vector.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct EdgeFunctionN<S: Simd> {
    a_and_b: OfBlock<S>,
    c_and_bound: OfBlock<S>,
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

impl<S: Simd> EdgeFunctions<S> {
    #[inline(always)]
    pub(crate) fn new(projected: &ProjectedTriangles<S, InF64>, frustum: &Frustum) -> Self {
        let reach = frustum.intervals.map(|[low, high]| f64::from(low.abs().max(high.abs())));
        let slopes = 1.0 + reach[0] + reach[1];
        let reach = [S::D::splat(reach[0]), S::D::splat(reach[1])];
        let corners = &projected.corners;
        let sizes = [norm1::<S>(&corners[0]), norm1::<S>(&corners[1]), norm1::<S>(&corners[2])];
        let mut edges = [EdgeFunctionN { a_and_b: S::F::ZEROS, c_and_bound: S::F::ZEROS }; 3];
        let zero = S::D::splat(0.0);
        let (mut normal, mut bounds) = ([zero; 3], zero);
        let mut last = [zero; 3];
        for (k, edge) in edges.iter_mut().enumerate() {
            let (line, error) = line::<S>(projected, &sizes, frustum, slopes, k);
            let [a, b, c] = line;
            let error = error + S::D::splat(UNDERFLOW * slopes);
            let bound = edge.set(line, error, reach);
            normal = [normal[0] + a, normal[1] + b, normal[2] + c];
            bounds = bounds + bound;
            last = line;
        }
        let bounds = <InF64 as Arithmetic<S>>::to_f32(above::<S, InF64>(bounds));
        if frustum.shear.is_some() {
            let unknown = [S::F::ZEROS, S::F::splat(f32::INFINITY).array()];
            return EdgeFunctions {
                edges,
                volumes: unknown,
                bounds,
                oriented: 0,
                signs: S::D::splat(1.0).array(),
            };
        }
        // The last edge goes from the third corner to the first.
        let [x, y, z] = corners[1];
        let volume = x * last[0] + y * last[1] + z * last[2];
        let error = volume_error::<S>(&sizes, &normal, frustum, slopes);
        let size = volume.abs();
        let [smaller, larger] = QUOTIENT_MARGINS;
        // Clamped, because infinity would not be a lower bound.
        let least = (size - error) * S::D::splat(smaller);
        let least = below::<S, InF64>(S::D::splat(f64::from(f32::MAX)).min(least));
        let most = above::<S, InF64>((size + error) * S::D::splat(larger));
        // Orients the edges so that V is positive.
        let sign = S::D::splat(1.0).copysign(volume);
        let signs = S::D::to_floats(sign, sign);
        for edge in &mut edges {
            edge.a_and_b = (S::F::load(edge.a_and_b) * signs).array();
            let one = S::D::splat(1.0);
            edge.c_and_bound = (S::F::load(edge.c_and_bound) * S::D::to_floats(sign, one)).array();
        }
        let oriented = error.lt(size);
        let volumes = [<InF64 as Arithmetic<S>>::to_f32(least), <InF64 as Arithmetic<S>>::to_f32(most)];
        // A flipped depth axis mirrors the triangle.
        let mirrored = S::D::splat(if frustum.flipped { -1.0 } else { 1.0 });
        EdgeFunctions { edges, volumes, bounds, oriented, signs: (sign * mirrored).array() }
    }

    /// The rays of a block against the triangle in a lane.
    #[inline(always)]
    pub(crate) fn overlap(&self, lane: usize, u: S::F, v: S::F) -> Overlap<S> {
        let zero = S::F::splat(0.0);
        let (mut values, mut bounds) = ([zero; 3], [zero; 3]);
        for (k, EdgeFunctionN { a_and_b, c_and_bound }) in self.edges.iter().enumerate() {
            let (a, b) = (S::F::splat(a_and_b[lane]), S::F::splat(a_and_b[S::D::LANES + lane]));
            let c = S::F::splat(c_and_bound[lane]);
            values[k] = a.mul_add(u, b.mul_add(v, c));
            bounds[k] = S::F::splat(c_and_bound[S::D::LANES + lane]);
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
    pub(crate) fn depths(&self, lane: usize, overlap: &Overlap<S>) -> [S::F; 2] {
        let zero = S::F::splat(0.0);
        let bound = S::F::splat(self.bounds[lane]);
        // A sum within its error bound may be 0.
        let least = (overlap.sums - bound).max(zero);
        let most = overlap.sums + bound;
        let [nearest, farthest] = [S::F::splat(self.volumes[0][lane]), S::F::splat(self.volumes[1][lane])];
        [nearest / most, farthest / least]
    }
}

impl<S: Simd> EdgeFunctionN<S> {
    /// Writes edge functions with the given errors in f64, and returns their error bounds. `reach` are the largest
    /// |u| and |v|.
    #[inline(always)]
    fn set(&mut self, [a, b, c]: [S::D; 3], error: S::D, reach: [S::D; 2]) -> S::D {
        let (of_u, of_v) = (a.abs() * reach[0], b.abs() * reach[1]);
        let size = of_u + of_v + c.abs();
        let bound = above::<S, InF64>(size * S::D::splat(EDGE_SLACK) + error);
        // Where f32 overflows, every ray may be inside. Without a branch: empty lanes count among these.
        let largest = a.abs().max(b.abs().max(size.max(bound)));
        let overflows = !largest.lt(S::D::splat(f64::from(f32::MAX) / 2.0)) & S::D::ALL;
        let (zero, infinity) = (S::F::splat(0.0), S::F::splat(f32::INFINITY));
        let in_pairs = overflows | overflows << S::D::LANES;
        self.a_and_b = S::F::select(in_pairs, zero, S::D::to_floats(a, b)).array();
        let c_and_bound = S::F::select(overflows, zero, S::D::to_floats(c, bound));
        self.c_and_bound = S::F::select(overflows << S::D::LANES, infinity, c_and_bound).array();
        bound
    }
}

/// Edge function k of the triangles, from corner k to the next, and its error in f64. `sizes` are the norms of the
/// corners, `slopes` is a bound on 1 + |u| + |v|.
#[inline(always)]
fn line<S: Simd>(
    projected: &ProjectedTriangles<S, InF64>,
    sizes: &[S::D; 3],
    frustum: &Frustum,
    slopes: f64,
    k: usize,
) -> ([S::D; 3], S::D) {
    let next = (k + 1) % 3;
    if frustum.shear.is_some() {
        let (p, q) = (projected.points[k], projected.points[next]);
        let line = [p[1] - q[1], q[0] - p[0], difference_of_products::<S>(p[0], q[1], p[1], q[0])];
        // A point is off by a few roundings of its corner and of the origins of the rays.
        let size = sizes[k] + sizes[next] + S::D::splat(frustum.reach);
        return (line, size * size * S::D::splat(PRODUCT_SLACK));
    }
    let (p, q) = (projected.corners[k], projected.corners[next]);
    let rounding = sizes[k] * sizes[next] * S::D::splat(PRODUCT_SLACK);
    let error = if frustum.spread == 0.0 {
        rounding
    } else {
        let along = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
        let length = norm1::<S>(&along) + S::D::splat(frustum.spread);
        rounding + S::D::splat(2.0 * frustum.spread) * length
    };
    let line = [
        difference_of_products::<S>(p[1], q[2], p[2], q[1]),
        difference_of_products::<S>(p[2], q[0], p[0], q[2]),
        difference_of_products::<S>(p[0], q[1], p[1], q[0]),
    ];
    (line, error * S::D::splat(slopes))
}

/// The error of V: see [`EdgeFunctions`]. `normal` is the sum of the edge functions' coefficients.
#[inline(always)]
fn volume_error<S: Simd>(sizes: &[S::D; 3], normal: &[S::D; 3], frustum: &Frustum, slopes: f64) -> S::D {
    let product = sizes[0] * sizes[1] * sizes[2];
    let error = product * S::D::splat(4.0 * PRODUCT_SLACK) + S::D::splat(UNDERFLOW);
    if frustum.spread == 0.0 {
        return error;
    }
    let pairs = (sizes[0] + sizes[1]) * (sizes[1] + sizes[2]);
    let across = normal[0].abs() + normal[1].abs();
    let total = across * S::D::splat(slopes) + normal[2].abs();
    let total = total + pairs * S::D::splat(4.0 * PRODUCT_SLACK * slopes);
    error + total * S::D::splat(2.0 * frustum.spread)
}
