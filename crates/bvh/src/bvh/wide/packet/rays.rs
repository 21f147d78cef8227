//! [`PacketRays`]: the rays of a packet as structures of arrays, in blocks, and what they have in common.

use super::frustum::{MAX_SPREAD, SLACK};
use crate::bvh::wide::single::box_ray::MARGIN;
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{PACKET, Rays};

/// The most blocks per packet. A block has a ray for each lane of [`Simd::F`], 8 at least.
pub(crate) const BLOCKS: usize = PACKET / 8;

// Sets of blocks are bits of a u32, of groups of four rays those of a u64.
const _: () = assert!(BLOCKS <= 32 && PACKET / 4 <= 64);

/// Rays in blocks, one array per quantity. Lanes beyond the last ray hold others ([`Rays`]), but for `ends`, which a
/// packet sets.
#[repr(C, align(64))]
pub(crate) struct PacketRays<S: Simd> {
    /// u, v and depth per unit of t of every ray.
    pub projected: [[OfBlock<S>; BLOCKS]; 3],
    /// An upper bound of the depth of every ray's origin.
    pub starts: [OfBlock<S>; BLOCKS],
    /// `t_max` of every ray, rounded to nearest.
    pub ends: [OfBlock<S>; BLOCKS],
    /// The number of blocks in use.
    pub blocks: usize,
}

/// A number for every ray of a block.
pub(crate) type OfBlock<S> = <<S as Simd>::F as Vector>::Array;

impl<S: Simd> Default for PacketRays<S> {
    fn default() -> Self {
        let zeros = [S::F::ZEROS; BLOCKS];
        PacketRays { projected: [zeros; 3], starts: zeros, ends: zeros, blocks: 0 }
    }
}

/// Least and greatest coordinates of points, per axis and lane.
struct Extent<D: Doubles>([[D; 2]; 3]);

impl<D: Doubles> Extent<D> {
    #[inline(always)]
    fn empty() -> Self {
        Extent([[D::splat(f64::INFINITY), D::splat(f64::NEG_INFINITY)]; 3])
    }

    #[inline(always)]
    fn include(&mut self, at: &[D; 3]) {
        for ([least, most], &at) in self.0.iter_mut().zip(at) {
            (*least, *most) = (at.min(*least), at.max(*most));
        }
    }

    /// Least and greatest coordinate per axis.
    #[inline(always)]
    fn reduce(&self) -> [[f64; 2]; 3] {
        let mut extent = [[0.0; 2]; 3];
        for (extent, &[least, most]) in extent.iter_mut().zip(&self.0) {
            *extent = [least.reduce_min(), most.reduce_max()];
        }
        extent
    }
}

/// What the rays of a packet have in common.
pub(crate) struct Common {
    /// The common origin.
    pub origin: Option<[f64; 3]>,
    /// The centre of the points at `t_max`, and the largest distance on any axis at which a ray passes it; `None` if
    /// that exceeds [`MAX_SPREAD`].
    pub end: Option<([f64; 3], f64)>,
    /// Whether `t_min` of all rays is 0.
    pub starts_at_0: bool,
    /// Least and greatest component of the directions, per axis.
    pub directions: [[f32; 2]; 3],
}

impl<S: Simd> PacketRays<S> {
    /// Loads the ends of at least one ray. Looks for a common end if `to_end`, else for a common origin.
    #[inline(always)]
    pub(crate) fn fill(&mut self, rays: Rays, to_end: bool) -> Common {
        self.blocks = rays.len().div_ceil(S::F::LANES);
        let (mut starts, mut ends) = (Extent::<S::D>::empty(), Extent::<S::D>::empty());
        let (mut reach, mut nearest) = (S::D::splat(0.0), S::D::splat(f64::INFINITY));
        let mut latest = S::D::splat(0.0);
        let mut directions = Extent::<S::D>::empty();
        for block in 0..self.blocks {
            let low = rays.lanes::<S::D>(block * S::F::LANES);
            let high = rays.lanes::<S::D>(block * S::F::LANES + S::D::LANES);
            self.ends[block] = S::D::to_floats(low.t_max, high.t_max).array();
            for lanes in [&low, &high] {
                latest = lanes.t_min.abs().max(latest);
                directions.include(&lanes.direction);
                if !to_end {
                    starts.include(&lanes.origin);
                    continue;
                }
                let mut end = lanes.origin;
                for (end, &direction) in end.iter_mut().zip(&lanes.direction) {
                    reach = (*end).abs().max(reach);
                    *end = *end + lanes.t_max * direction;
                }
                ends.include(&end);
                reach = lanes.t_max.max(reach);
                nearest = lanes.t_max.min(nearest);
            }
        }
        let start = starts.reduce();
        let same = !to_end && start.iter().all(|[least, most]| least == most);
        let end =
            if to_end { common_end(ends.reduce(), reach.reduce_max(), nearest.reduce_min()) } else { None };
        let origin = same.then(|| rays.origin(0).to_array());
        let directions = directions.reduce().map(|extent| extent.map(|x| x as f32));
        Common { origin, end, starts_at_0: latest.reduce_max() == 0.0, directions }
    }

    /// Computes u, v and depth per unit of t, whose axes are `axes`, from the directions. Returns the intervals of u
    /// and v. `to_end`: the directions point to the apex.
    #[inline(always)]
    pub(crate) fn project(&mut self, rays: Rays, axes: [usize; 3], to_end: bool) -> [[S::F; 2]; 2] {
        let sign = S::F::splat(if to_end { -1.0 } else { 1.0 });
        let one = S::F::splat(1.0);
        let mut intervals = [[S::F::splat(f32::INFINITY), S::F::splat(f32::NEG_INFINITY)]; 2];
        for block in 0..self.blocks {
            let depth = rays.direction_floats::<S::D>(axes[2], block * S::F::LANES).abs();
            let share = sign * (one / depth);
            self.projected[2][block] = depth.array();
            for (k, [least, most]) in intervals.iter_mut().enumerate() {
                let slope = rays.direction_floats::<S::D>(axes[k], block * S::F::LANES) * share;
                self.projected[k][block] = slope.array();
                (*least, *most) = (slope.min(*least), slope.max(*most));
            }
        }
        intervals
    }

    /// [`PacketRays::project`] for parallel rays, also loading their ends: u and v are where a ray crosses the plane of
    /// depth 0. Depth per unit of t is left out. Returns bounds of u and v, a lower bound of the depths of origins, and
    /// a bound on coordinates of origins relative to the apex and on how far the shear moves them.
    #[inline(always)]
    pub(crate) fn project_parallel(
        &mut self,
        rays: Rays,
        apex: [f64; 3],
        axes: [usize; 3],
        flipped: bool,
        shear: [f64; 2],
    ) -> ([[f64; 2]; 2], f64, f64) {
        let (slack, zero) = (S::D::splat(SLACK), S::D::splat(0.0));
        let [infinity, nothing] = [S::D::splat(f64::INFINITY), S::D::splat(f64::NEG_INFINITY)];
        let (mut intervals, mut min_depth, mut reach) = ([[infinity, nothing]; 2], infinity, zero);
        for block in 0..self.blocks {
            let (mut places, mut starts, mut ends) = ([[zero; 2]; 2], [zero; 2], [zero; 2]);
            for half in 0..2 {
                let first = block * S::F::LANES + half * S::D::LANES;
                let origin = rays.origin_lanes::<S::D>(first);
                let along = origin[axes[2]] - S::D::splat(apex[axes[2]]);
                let start = if flipped { zero - along } else { along };
                for k in 0..2 {
                    let lateral = origin[axes[k]] - S::D::splat(apex[axes[k]]);
                    let sheared = S::D::splat(shear[k]) * start;
                    let (at, size) = (lateral - sheared, lateral.abs() + sheared.abs());
                    let error = size * slack;
                    let [least, most] = &mut intervals[k];
                    (*least, *most) = ((at - error).min(*least), (at + error).max(*most));
                    reach = size.max(reach);
                    places[k][half] = at;
                }
                let error = start.abs() * slack;
                min_depth = (start - error).min(min_depth);
                reach = start.abs().max(reach);
                // The error is far more than the rounding to f32; the least normal number covers underflow.
                starts[half] = start + error + S::D::splat(f64::from(f32::MIN_POSITIVE));
                ends[half] = rays.t_max_lanes(first);
            }
            for (k, [low, high]) in places.into_iter().enumerate() {
                self.projected[k][block] = S::D::to_floats(low, high).array();
            }
            self.starts[block] = S::D::to_floats(starts[0], starts[1]).array();
            self.ends[block] = S::D::to_floats(ends[0], ends[1]).array();
        }
        let intervals = intervals.map(|[least, most]| [least.reduce_min(), most.reduce_max()]);
        (intervals, min_depth.reduce_min(), reach.reduce_max())
    }

    /// Depths before and beyond `t_max` of the rays of a block; without `t_max`, infinite. Where rays are parallel,
    /// the first is no bound.
    #[inline(always)]
    pub(crate) fn depths(&self, block: usize) -> [S::F; 2] {
        // Both factors, their product and the sum are rounded; underflow is below the least normal number.
        let length = S::F::load(self.projected[2][block]) * S::F::load(self.ends[block]);
        let start = S::F::load(self.starts[block]);
        let near = start + length * S::F::splat(1.0 / MARGIN);
        let far = start + length * S::F::splat(MARGIN);
        // If `t_max` is infinite the difference is NaN, which is not taken.
        let near = (near - rounding(near)).min(near);
        [near, (far + rounding(far)).max(far)]
    }

    /// The depths at `t_max` of the rays of a block, rounded.
    #[inline(always)]
    pub(crate) fn depth_of_end(&self, block: usize) -> S::F {
        S::F::load(self.projected[2][block])
            .mul_add(S::F::load(self.ends[block]), S::F::load(self.starts[block]))
    }

    /// Depths before and beyond `t` on one ray.
    #[inline(always)]
    pub(crate) fn depths_at(&self, ray: usize, t: f64) -> [f32; 2] {
        let (block, lane) = (ray / S::F::LANES % BLOCKS, ray % S::F::LANES);
        let (start, length) = (self.starts[block][lane], self.projected[2][block][lane] * t as f32);
        let (near, far) = (start + length * (1.0 / MARGIN), start + length * MARGIN);
        let rounding = |x: f32| x.abs() * SLACK as f32 + f32::MIN_POSITIVE;
        [near - rounding(near), far + rounding(far)]
    }
}

/// A bound on the rounding of a depth.
#[inline(always)]
fn rounding<F: Floats>(depth: F) -> F {
    depth.abs() * F::splat(SLACK as f32) + F::splat(f32::MIN_POSITIVE)
}

/// The centre of the rays' ends, and the largest distance on any axis at which a ray passes it; `None` if that is too
/// large for a frustum. `reach` bounds the coordinates and lengths of the rays, `nearest` is the least length.
#[inline(always)]
fn common_end(ends: [[f64; 2]; 3], reach: f64, nearest: f64) -> Option<([f64; 3], f64)> {
    let [x, y, z] = ends.map(|[least, most]| most - least);
    // The rounding of the ends, and the margins of box tests and clamped hits, are far less than the second term.
    let spread = x.max(y).max(z) + reach * SLACK;
    // Rays without an end have none in common.
    let fits = spread.is_finite() && spread <= nearest * MAX_SPREAD;
    fits.then(|| (ends.map(|[least, most]| (least + most) / 2.0), spread))
}

#[cfg(test)]
mod tests {
    use super::super::frustum::Frustum;
    use super::*;
    use crate::geometry::simd::Portable;
    use crate::geometry::{Ray, RayBuffer};
    use glam::DVec3;

    const LANES: usize = <Portable as Simd>::F::LANES;

    /// Depths of rays of several lengths, computed in f64, whose error is far below the bounds.
    #[test]
    fn depths_lie_within_their_bounds() {
        let mut state = 3u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for scale in [1e-30, 1.0, 1e30] {
            let rays: RayBuffer = (0..PACKET)
                .map(|_| {
                    let direction = DVec3::new(unit() - 0.5, unit() - 0.5, 2.0).normalize();
                    Ray { origin: DVec3::ONE, direction, t_min: 0.0, t_max: scale * (unit() + 0.5) }
                })
                .collect();
            let mut packet = PacketRays::<Portable>::default();
            let frustum = Frustum::new(rays.rays(), false, &mut packet).expect("one start");
            assert_eq!(frustum.axes[2], 2);
            for (index, ray) in rays.rays().iter().enumerate() {
                let depth = ray.direction.z * ray.t_max;
                let [near, far] = packet.depths(index / LANES).map(|d| f64::from(d.array()[index % LANES]));
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                let [near, far] = packet.depths_at(index, ray.t_max).map(f64::from);
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                assert!(far - near < 1e-5 * depth, "{near} {depth} {far}");
            }
        }
        let endless = Ray { origin: DVec3::ZERO, direction: DVec3::Z, t_min: 0.0, t_max: f64::INFINITY };
        let askew = Ray { direction: DVec3::new(0.6, 0.0, 0.8), ..endless };
        let mut packet = PacketRays::<Portable>::default();
        let rays = RayBuffer::from_iter([endless, askew]);
        Frustum::new(rays.rays(), false, &mut packet).expect("one start");
        assert_eq!(packet.depths(0).map(Vector::array), [[f32::INFINITY; LANES]; 2]);
    }
}
