//! [`PacketRays`]: the rays of a packet as structures of arrays, in blocks of eight, and what they have in common.

use super::frustum::{MAX_SPREAD, SLACK};
use crate::bvh::wide::layout::WIDTH;
use crate::bvh::wide::single::box_ray::MARGIN;
use crate::geometry::Ray;
use crate::geometry::four::{LANES4, Ray4};
use crate::geometry::simd::{Simd, prefetch};

/// Rays per block: the lanes of [`Simd::F8`].
pub(crate) const BLOCK: usize = WIDTH;

/// Blocks per packet.
pub(crate) const BLOCKS: usize = 32;

/// Rays per packet: those of a tile.
pub(crate) const PACKET: usize = BLOCK * BLOCKS;

/// Rays in blocks of [`BLOCK`], one array per quantity. Lanes beyond the last ray repeat it.
pub(crate) struct PacketRays {
    /// u, v and depth per unit of t of every ray; before [`PacketRays::project`], the components of its direction.
    pub projected: [[[f32; BLOCK]; BLOCKS]; 3],
    /// An upper bound of the depth of every ray's origin.
    pub starts: [[f32; BLOCK]; BLOCKS],
    /// `t_max` of every ray, rounded to nearest.
    pub ends: [[f32; BLOCK]; BLOCKS],
    /// The number of blocks in use.
    pub blocks: usize,
}

impl Default for PacketRays {
    fn default() -> Self {
        let zeros = [[0.0; BLOCK]; BLOCKS];
        PacketRays { projected: [zeros; 3], starts: zeros, ends: zeros, blocks: 0 }
    }
}

/// Least and greatest coordinates of points, per axis and lane.
struct Extent<S: Simd>([[S::D4; 2]; 3]);

impl<S: Simd> Extent<S> {
    #[inline(always)]
    fn empty() -> Self {
        Extent([[S::d4_splat(f64::INFINITY), S::d4_splat(f64::NEG_INFINITY)]; 3])
    }

    #[inline(always)]
    fn include(&mut self, at: &[S::D4; 3]) {
        for ([least, most], &at) in self.0.iter_mut().zip(at) {
            (*least, *most) = (S::d4_min(at, *least), S::d4_max(at, *most));
        }
    }

    /// Least and greatest coordinate per axis.
    #[inline(always)]
    fn reduce(&self) -> [[f64; 2]; 3] {
        let mut extent = [[0.0; 2]; 3];
        for (extent, &[least, most]) in extent.iter_mut().zip(&self.0) {
            *extent = [reduce_min::<S>(least), reduce_max::<S>(most)];
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

impl PacketRays {
    /// Loads directions and ends of at least one ray. Looks for a common end if `to_end`, else for a common origin.
    /// Prefetches the packet of rays that comes after them.
    #[inline(always)]
    pub(crate) fn fill<S: Simd>(&mut self, rays: &[Ray], following: &[Ray], to_end: bool) -> Common {
        self.blocks = rays.len().div_ceil(BLOCK);
        let (mut starts, mut ends) = (Extent::<S>::empty(), Extent::<S>::empty());
        let (mut reach, mut nearest) = (S::d4_splat(0.0), S::d4_splat(f64::INFINITY));
        let mut latest = S::d4_splat(0.0);
        let mut directions = [[S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY)]; 3];
        for block in 0..self.blocks {
            for index in (block * BLOCK..following.len()).take(BLOCK) {
                prefetch(following, index);
            }
            let low = Ray4::<S>::new(rays, block * BLOCK);
            let high = Ray4::<S>::new(rays, block * BLOCK + LANES4);
            for (axis, [least, most]) in directions.iter_mut().enumerate() {
                let component = S::f8_from_d4(low.direction[axis], high.direction[axis]);
                (*least, *most) = (S::f8_min(component, *least), S::f8_max(component, *most));
                self.projected[axis][block] = S::f8_array(component);
            }
            self.ends[block] = S::f8_array(S::f8_from_d4(low.t_max, high.t_max));
            for four in [&low, &high] {
                latest = S::d4_max(S::d4_abs(four.t_min), latest);
                if !to_end {
                    starts.include(&four.origin);
                    continue;
                }
                let mut end = four.origin;
                for (end, &direction) in end.iter_mut().zip(&four.direction) {
                    reach = S::d4_max(S::d4_abs(*end), reach);
                    *end = S::d4_add(*end, S::d4_mul(four.t_max, direction));
                }
                ends.include(&end);
                reach = S::d4_max(four.t_max, reach);
                nearest = S::d4_min(four.t_max, nearest);
            }
        }
        let start = starts.reduce();
        // NaN is not equal to itself.
        let same = !to_end && start.iter().all(|[least, most]| least == most);
        let mut intervals = [[0.0; 2]; 3];
        for (interval, [least, most]) in intervals.iter_mut().zip(directions) {
            *interval = [S::f8_reduce_min(least), S::f8_reduce_max(most)];
        }
        let end = if to_end {
            common_end(ends.reduce(), reduce_max::<S>(reach), reduce_min::<S>(nearest))
        } else {
            None
        };
        let origin = same.then(|| rays[0].origin.to_array());
        Common { origin, end, starts_at_0: reduce_max::<S>(latest) == 0.0, directions: intervals }
    }

    /// Turns the directions, with `u_axis` the first of the axes (u, v, depth), into u, v and depth per unit of t.
    /// Returns the intervals of u and v. `to_end`: the directions point to the apex.
    #[inline(always)]
    pub(crate) fn project<S: Simd>(&mut self, u_axis: usize, to_end: bool) -> [[S::F8; 2]; 2] {
        self.projected.rotate_left(u_axis);
        let sign = S::f8_splat(if to_end { -1.0 } else { 1.0 });
        let one = S::f8_splat(1.0);
        let mut intervals = [[S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY)]; 2];
        for block in 0..self.blocks {
            let depth = S::f8(self.projected[2][block]);
            let depth = S::f8_max(depth, S::f8_sub(S::f8_splat(0.0), depth));
            let share = S::f8_mul(sign, S::f8_div(one, depth));
            self.projected[2][block] = S::f8_array(depth);
            for (k, [least, most]) in intervals.iter_mut().enumerate() {
                let slope = S::f8_mul(S::f8(self.projected[k][block]), share);
                self.projected[k][block] = S::f8_array(slope);
                (*least, *most) = (S::f8_min(slope, *least), S::f8_max(slope, *most));
            }
        }
        intervals
    }

    /// Depths before and beyond `t_max` of the rays of a block; without `t_max`, infinite. Where rays are parallel,
    /// the first is no bound.
    #[inline(always)]
    pub(crate) fn depths<S: Simd>(&self, block: usize) -> [S::F8; 2] {
        // Both factors, their product and the sum are rounded; underflow is below the least normal number.
        let length = S::f8_mul(S::f8(self.projected[2][block]), S::f8(self.ends[block]));
        let start = S::f8(self.starts[block]);
        let near = S::f8_add(start, S::f8_mul(length, S::f8_splat(1.0 / MARGIN)));
        let far = S::f8_add(start, S::f8_mul(length, S::f8_splat(MARGIN)));
        // If `t_max` is infinite the difference is NaN, which is not taken.
        let near = S::f8_min(S::f8_sub(near, rounding::<S>(near)), near);
        [near, S::f8_max(S::f8_add(far, rounding::<S>(far)), far)]
    }

    /// Depths before and beyond `t` on one ray.
    #[inline(always)]
    pub(crate) fn depths_at(&self, ray: usize, t: f64) -> [f32; 2] {
        let (block, lane) = (ray / BLOCK % BLOCKS, ray % BLOCK);
        let (start, length) = (self.starts[block][lane], self.projected[2][block][lane] * t as f32);
        let (near, far) = (start + length * (1.0 / MARGIN), start + length * MARGIN);
        let rounding = |x: f32| x.abs() * SLACK as f32 + f32::MIN_POSITIVE;
        [near - rounding(near), far + rounding(far)]
    }
}

/// A bound on the rounding of a depth.
#[inline(always)]
fn rounding<S: Simd>(depth: S::F8) -> S::F8 {
    let size = S::f8_max(depth, S::f8_sub(S::f8_splat(0.0), depth));
    S::f8_add(S::f8_mul(size, S::f8_splat(SLACK as f32)), S::f8_splat(f32::MIN_POSITIVE))
}

/// The least lane.
#[inline(always)]
fn reduce_min<S: Simd>(x: S::D4) -> f64 {
    let [a, b, c, d] = S::d4_array(x);
    a.min(b).min(c.min(d))
}

/// The greatest lane.
#[inline(always)]
fn reduce_max<S: Simd>(x: S::D4) -> f64 {
    let [a, b, c, d] = S::d4_array(x);
    a.max(b).max(c.max(d))
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
    use glam::DVec3;

    /// Depths of rays of several lengths, computed in f64, whose error is far below the bounds.
    #[test]
    fn depths_lie_within_their_bounds() {
        let mut state = 3u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for scale in [1e-30, 1.0, 1e30] {
            let rays: Vec<Ray> = (0..BLOCK * BLOCKS)
                .map(|_| {
                    let direction = DVec3::new(unit() - 0.5, unit() - 0.5, 2.0).normalize();
                    Ray { origin: DVec3::ONE, direction, t_min: 0.0, t_max: scale * (unit() + 0.5) }
                })
                .collect();
            let mut packet = PacketRays::default();
            let frustum = Frustum::new::<Portable>(&rays, &[], false, &mut packet).expect("one start");
            assert_eq!(frustum.axes[2], 2);
            for (index, ray) in rays.iter().enumerate() {
                let depth = ray.direction.z * ray.t_max;
                let [near, far] =
                    packet.depths::<Portable>(index / BLOCK).map(|d| f64::from(d[index % BLOCK]));
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                let [near, far] = packet.depths_at(index, ray.t_max).map(f64::from);
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                assert!(far - near < 1e-5 * depth, "{near} {depth} {far}");
            }
        }
        let endless = Ray { origin: DVec3::ZERO, direction: DVec3::Z, t_min: 0.0, t_max: f64::INFINITY };
        let askew = Ray { direction: DVec3::new(0.6, 0.0, 0.8), ..endless };
        let mut packet = PacketRays::default();
        Frustum::new::<Portable>(&[endless, askew], &[], false, &mut packet).expect("one start");
        assert_eq!(packet.depths::<Portable>(0), [[f32::INFINITY; BLOCK]; 2]);
    }
}
