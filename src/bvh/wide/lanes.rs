//! The rays of a packet, number by number and in blocks, and what they have in common.

use crate::geometry::Ray;
use crate::geometry::bundle::{Gathered, RAYS};
use crate::geometry::simd::Simd;

use super::frustum::{MOST_SPREAD, SLACK};
use super::node::{MARGIN, WIDTH};

/// How many blocks there are at most.
pub const BLOCKS: usize = 32;

/// Rays in blocks of [`WIDTH`], one array for each number. What is beyond the last ray repeats it.
pub struct Lanes {
    /// Directions; after [`Frustum::new`](super::frustum::Frustum::new) u and v of every ray, and what it advances in depth.
    pub directions: [[[f32; WIDTH]; BLOCKS]; 3],
    /// The depths from which the rays' distances count, or more.
    pub starts: [[f32; WIDTH]; BLOCKS],
    /// The distances beyond which nothing counts for a ray, to the nearest f32.
    pub ends: [[f32; WIDTH]; BLOCKS],
    /// How many blocks there are.
    pub blocks: usize,
}

impl Default for Lanes {
    fn default() -> Self {
        let zeros = [[0.0; WIDTH]; BLOCKS];
        Lanes { directions: [zeros; 3], starts: zeros, ends: zeros, blocks: 0 }
    }
}

/// The least and the greatest of what rays have.
pub struct Range<S: Simd>([[S::D4; 2]; 3]);

impl<S: Simd> Range<S> {
    #[inline(always)]
    fn empty() -> Self {
        Range([[S::d4_splat(f64::INFINITY), S::d4_splat(f64::NEG_INFINITY)]; 3])
    }

    #[inline(always)]
    fn include(&mut self, at: &[S::D4; 3]) {
        for ([least, most], &at) in self.0.iter_mut().zip(at) {
            (*least, *most) = (S::d4_min(at, *least), S::d4_max(at, *most));
        }
    }

    /// Least and greatest on each axis.
    #[inline(always)]
    fn ends(&self) -> [[f64; 2]; 3] {
        let mut ends = [[0.0; 2]; 3];
        for (ends, &[least, most]) in ends.iter_mut().zip(&self.0) {
            *ends = [least_of::<S>(least), most_of::<S>(most)];
        }
        ends
    }
}

/// What rays may have in common.
pub struct Common {
    /// Where the first starts, if all start there.
    pub start: Option<[f64; 3]>,
    /// The middle of the places that they end at, and how far on any axis a ray passes beside it at most; if that is little.
    pub end: Option<([f64; 3], f64)>,
    /// Whether the distances of all count from 0 on.
    pub counts_from_0: bool,
    /// Least and greatest component of the directions, on each axis.
    pub directions: [[f32; 2]; 3],
}

impl Lanes {
    /// Takes the directions and ends of rays, at least one.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, rays: &[Ray], to_end: bool) -> Common {
        self.blocks = rays.len().div_ceil(WIDTH);
        let (mut starts, mut ends) = (Range::<S>::empty(), Range::<S>::empty());
        let (mut reach, mut nearest) = (S::d4_splat(0.0), S::d4_splat(f64::INFINITY));
        let mut late = S::d4_splat(0.0);
        let mut directions = [[S::f8_splat(f32::INFINITY), S::f8_splat(f32::NEG_INFINITY)]; 3];
        for block in 0..self.blocks {
            for ahead in 0..WIDTH {
                S::prefetch(rays, rays, false, (block + 4) * WIDTH + ahead);
            }
            let low = Gathered::<S>::new(rays, block * WIDTH);
            let high = Gathered::<S>::new(rays, block * WIDTH + RAYS);
            for (axis, [least, most]) in directions.iter_mut().enumerate() {
                let along = S::f8_from_d4(low.direction[axis], high.direction[axis]);
                (*least, *most) = (S::f8_min(along, *least), S::f8_max(along, *most));
                self.directions[axis][block] = S::f8_array(along);
            }
            self.ends[block] = S::f8_array(S::f8_from_d4(low.t_max, high.t_max));
            for four in [&low, &high] {
                late = S::d4_max(S::d4_abs(four.t_min), late);
                if !to_end {
                    starts.include(&four.origin);
                    continue;
                }
                let mut end = four.origin;
                for (end, &along) in end.iter_mut().zip(&four.direction) {
                    reach = S::d4_max(S::d4_abs(*end), reach);
                    *end = S::d4_add(*end, S::d4_mul(four.t_max, along));
                }
                ends.include(&end);
                reach = S::d4_max(four.t_max, reach);
                nearest = S::d4_min(four.t_max, nearest);
            }
        }
        let start = starts.ends();
        // Nothing is equal to what is not a number.
        let same = !to_end && start.iter().all(|[least, most]| least == most);
        let mut intervals = [[0.0; 2]; 3];
        for (interval, [least, most]) in intervals.iter_mut().zip(directions) {
            *interval = [S::f8_least(least), S::f8_most(most)];
        }
        let end =
            if to_end { common_end(ends.ends(), most_of::<S>(reach), least_of::<S>(nearest)) } else { None };
        let start = same.then(|| rays[0].origin.to_array());
        Common { start, end, counts_from_0: most_of::<S>(late) == 0.0, directions: intervals }
    }

    /// Depths before (but where rays run the same way) and beyond those at `ends` along the rays of a block.
    #[inline(always)]
    pub fn depths<S: Simd>(&self, block: usize) -> [S::F8; 2] {
        // Both factors are rounded, and so is their product, and the sum; what is too small for f32 is less than its least normal.
        let way = S::f8_mul(S::f8(self.directions[2][block]), S::f8(self.ends[block]));
        let start = S::f8(self.starts[block]);
        let near = S::f8_add(start, S::f8_mul(way, S::f8_splat(1.0 / MARGIN)));
        let far = S::f8_add(start, S::f8_mul(way, S::f8_splat(MARGIN)));
        // Without an end there is no difference, which is not taken.
        let near = S::f8_min(S::f8_sub(near, rounding::<S>(near)), near);
        [near, S::f8_max(S::f8_add(far, rounding::<S>(far)), far)]
    }

    /// The same of one ray, at `t`.
    #[inline(always)]
    pub fn depths_at(&self, ray: usize, t: f64) -> [f32; 2] {
        let (block, lane) = (ray / WIDTH % BLOCKS, ray % WIDTH);
        let (start, way) = (self.starts[block][lane], self.directions[2][block][lane] * t as f32);
        let (near, far) = (start + way * (1.0 / MARGIN), start + way * MARGIN);
        let rounding = |x: f32| x.abs() * SLACK as f32 + f32::MIN_POSITIVE;
        [near - rounding(near), far + rounding(far)]
    }
}

/// What depths may be off by.
#[inline(always)]
fn rounding<S: Simd>(depth: S::F8) -> S::F8 {
    let size = S::f8_max(depth, S::f8_sub(S::f8_splat(0.0), depth));
    S::f8_add(S::f8_mul(size, S::f8_splat(SLACK as f32)), S::f8_splat(f32::MIN_POSITIVE))
}

/// The least of four.
#[inline(always)]
fn least_of<S: Simd>(x: S::D4) -> f64 {
    let [a, b, c, d] = S::d4_array(x);
    a.min(b).min(c.min(d))
}

/// The greatest of four.
#[inline(always)]
fn most_of<S: Simd>(x: S::D4) -> f64 {
    let [a, b, c, d] = S::d4_array(x);
    a.max(b).max(c.max(d))
}

/// The middle of the places that rays end at, and how far any passes beside it, which go `reach` far at most and are
/// `nearest` long at least.
#[inline(always)]
fn common_end(ends: [[f64; 2]; 3], reach: f64, nearest: f64) -> Option<([f64; 3], f64)> {
    let [x, y, z] = ends.map(|[least, most]| most - least);
    // The ends are computed, and hits are held to their boxes, to far less than this.
    let spread = x.max(y).max(z) + reach * SLACK;
    // Rays without an end have none in common.
    let is_little = spread.is_finite() && spread <= nearest * MOST_SPREAD;
    is_little.then(|| (ends.map(|[least, most]| (least + most) / 2.0), spread))
}

#[cfg(test)]
mod tests {
    use super::super::frustum::Frustum;
    use super::*;
    use crate::geometry::simd::Portable;
    use glam::DVec3;

    /// Depths of f64 rays of several lengths, computed in f64: far better than f32 bounds can tell.
    #[test]
    fn depths_lie_within_their_bounds() {
        let mut state = 3u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for scale in [1e-30, 1.0, 1e30] {
            let rays: Vec<Ray> = (0..WIDTH * BLOCKS)
                .map(|_| {
                    let direction = DVec3::new(unit() - 0.5, unit() - 0.5, 2.0).normalize();
                    Ray { origin: DVec3::ONE, direction, t_min: 0.0, t_max: scale * (unit() + 0.5) }
                })
                .collect();
            let mut lanes = Lanes::default();
            let frustum = Frustum::new::<Portable>(&rays, false, &mut lanes).expect("one start");
            assert_eq!(frustum.axes[2], 2);
            for (index, ray) in rays.iter().enumerate() {
                let depth = ray.direction.z * ray.t_max;
                let [near, far] =
                    lanes.depths::<Portable>(index / WIDTH).map(|d| f64::from(d[index % WIDTH]));
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                let [near, far] = lanes.depths_at(index, ray.t_max).map(f64::from);
                assert!(near < depth && depth < far, "{near} {depth} {far}");
                assert!(far - near < 1e-5 * depth, "{near} {depth} {far}");
            }
        }
        let endless = Ray { origin: DVec3::ZERO, direction: DVec3::Z, t_min: 0.0, t_max: f64::INFINITY };
        let askew = Ray { direction: DVec3::new(0.6, 0.0, 0.8), ..endless };
        let mut lanes = Lanes::default();
        Frustum::new::<Portable>(&[endless, askew], false, &mut lanes).expect("one start");
        assert_eq!(lanes.depths::<Portable>(0), [[f32::INFINITY; WIDTH]; 2]);
    }
}
