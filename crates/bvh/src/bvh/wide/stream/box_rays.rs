//! [`BoxRays`]: the rays of a stream prepared for the boxes of nodes, and [`RayMask`]: those that a stream does not
//! trace.

use crate::bvh::wide::layout::WIDTH;
use crate::bvh::wide::single::box_ray::{BoxRay, LENGTHS, WIDENING};
use crate::geometry::simd::{Doubles, Floats, Simd, Vector};
use crate::geometry::{BATCH, Rays};

/// Some of at most [`BATCH`] rays, as bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct RayMask([u64; BATCH / 64]);

impl RayMask {
    /// The first rays.
    pub(crate) fn first(count: usize) -> Self {
        RayMask([u64::MAX; BATCH / 64]).keep(count)
    }

    /// Those of the first rays.
    #[inline(always)]
    fn keep(mut self, count: usize) -> Self {
        for (index, bits) in self.0.iter_mut().enumerate() {
            let beyond = count.saturating_sub(64 * index);
            *bits &= if beyond < 64 { (1 << beyond) - 1 } else { u64::MAX };
        }
        self
    }

    /// The ascending indices, below `count`, of rays that are neither in the mask nor `known`, and their number.
    #[inline(always)]
    pub(crate) fn others(&self, count: usize, known: impl Fn(usize) -> bool) -> ([u16; BATCH], usize) {
        let (mut others, mut len) = ([0; BATCH], 0);
        for ray in 0..count.min(BATCH) {
            others[len % BATCH] = ray as u16;
            len += usize::from((self.0[ray / 64] >> (ray % 64) & 1 == 0) & !known(ray));
        }
        (others, len)
    }

    /// The indices of the rays, ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> {
        let mut bits = self.0;
        std::iter::from_fn(move || {
            let index = bits.iter().position(|bits| *bits != 0)?;
            let ray = 64 * index + bits[index].trailing_zeros() as usize;
            bits[index] &= bits[index] - 1;
            Some(ray)
        })
    }
}

/// Rays prepared for boxes, a vector of f32 at a time, in the order in which they start: those in flight need less
/// memory than a batch.
pub(crate) struct BoxRays {
    prepared: [BoxRay; WIDTH],
    /// The index of the first of them.
    first: usize,
}

impl Default for BoxRays {
    fn default() -> Self {
        BoxRays { prepared: [BoxRay::default(); WIDTH], first: usize::MAX }
    }
}

impl BoxRays {
    /// The rays that this does not support: those with a zero in their direction, those whose direction needs scaling,
    /// and those whose offsets are not finite in f32: from an infinite one the ray would enter the infinite boxes of
    /// empty places.
    #[inline(always)]
    pub(crate) fn unsupported<D: Doubles>(rays: Rays) -> RayMask {
        let (zero, least, most) = (D::splat(0.0), D::splat(*LENGTHS.start()), D::splat(*LENGTHS.end()));
        let mut unsupported = RayMask::default();
        for first in (0..rays.len()).step_by(D::LANES) {
            let [x, y, z] = rays.direction_lanes::<D>(first);
            let [x, y, z] = [x.abs(), y.abs(), z.abs()];
            let longest = x.max(y).max(z);
            let mut supported = zero.lt(x) & zero.lt(y) & zero.lt(z) & least.le(longest) & longest.le(most);
            // Half the range, so that the widened offset is finite, too.
            let range = D::splat(f64::from(f32::MAX / 2.0));
            for (origin, direction) in rays.origin_lanes::<D>(first).into_iter().zip([x, y, z]) {
                supported &= origin.abs().le(range * direction);
            }
            unsupported.0[first / 64] |= u64::from(!supported & D::ALL) << (first % 64);
        }
        unsupported.keep(rays.len())
    }

    /// Prepares the rays from index `first` on, as [`BoxRay::new`], with `t_min` rounded down further.
    /// What it prepares for rays that are not supported must not be used.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, rays: Rays, first: usize, fast: bool) {
        let (zero, one) = (S::F8::splat(0.0), S::F8::splat(1.0));
        let (mut inverses, mut offsets) = ([S::F8::ZEROS; 3], [[S::F8::ZEROS; 2]; 3]);
        for axis in 0..3 {
            let inverse = one / rays.direction_floats::<S::D4>(axis, first);
            let offset = rays.origin_floats::<S::D4>(axis, first) * inverse;
            let underflow = (inverse.abs() + one) * S::F8::splat(f32::MIN_POSITIVE);
            let widening = if fast { zero } else { offset.abs() * S::F8::splat(WIDENING) + underflow };
            inverses[axis] = inverse.array();
            offsets[axis] = [(offset + widening).array(), (offset - widening).array()];
        }
        // Rounded to nearest, then down by more than that rounds. Underflow is covered by the widening.
        let t_min = rays.t_min_floats::<S::D4>(first);
        let t_min = (t_min * S::F8::splat(1.0 - f32::EPSILON)).max(zero).array();
        let [[ox, px], [oy, py], [oz, pz]] = &offsets;
        for (lane, ray) in self.prepared.iter_mut().enumerate() {
            let inverse = [inverses[0][lane], inverses[1][lane], inverses[2][lane]];
            let offsets = [[ox[lane], px[lane]], [oy[lane], py[lane]], [oz[lane], pz[lane]]];
            *ray = BoxRay::of_parts(inverse, offsets, t_min[lane]);
        }
    }

    /// The ray at `i`, prepared; the next ones too, so that indices should ascend. `fast` must be that of the calls
    /// before.
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&mut self, rays: Rays, i: usize, fast: bool) -> &BoxRay {
        let first = i / WIDTH * WIDTH;
        if self.first != first {
            self.fill::<S>(rays, first, fast);
            self.first = first;
        }
        &self.prepared[i % WIDTH]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::simd::Portable;
    use crate::geometry::{Ray, RayBuffer};
    use glam::DVec3;

    #[test]
    fn rays_of_a_packet_are_prepared_as_one() {
        let component = |i: usize| [1.0, -1.0, 0.3, -7.5, 1e-30, 1e3][i % 6];
        let coordinate = |i: usize| [0.0, -0.1, 3e7, 1e-40, -1e-45, 1e6][i % 6];
        let rays: RayBuffer = (0..216)
            .map(|i| Ray {
                origin: DVec3::new(coordinate(i / 6), coordinate(i / 36), coordinate(i)),
                direction: DVec3::new(component(i), component(i / 6), component(i / 36)),
                t_min: [0.0, 1e-50, 0.1, 1.0 / 3.0, 1e20][i % 5],
                t_max: f64::INFINITY,
            })
            .filter(|ray| LENGTHS.contains(&ray.direction.abs().max_element()))
            .take(208)
            .collect();
        assert_eq!(rays.len(), 208);
        assert_eq!(BoxRays::unsupported::<<Portable as Simd>::D4>(rays.rays()), RayMask::default());
        let mut prepared = BoxRays::default();
        for (i, ray) in rays.rays().iter().enumerate() {
            let (mut found, expected) =
                (*prepared.at::<Portable>(rays.rays(), i, false), BoxRay::new(&ray, true, false));
            assert!(found.t_min <= expected.t_min && f64::from(found.t_min) >= ray.t_min * 0.999_999 - 1e-45);
            found.t_min = expected.t_min;
            assert_eq!(found, expected, "{ray:?}");
        }
    }

    #[test]
    fn rays_that_are_not_supported_are_found_one_by_one() {
        let is_plain = |i: usize| !i.is_multiple_of(37);
        for len in [1, 5, 64, 200, BATCH] {
            let ray = |i: usize| Ray {
                origin: DVec3::ONE,
                direction: [DVec3::Z, DVec3::new(0.5, 0.5, 0.5)][usize::from(is_plain(i))],
                t_min: 0.0,
                t_max: 1.0,
            };
            let rays: RayBuffer = (0..len).map(ray).collect();
            let unsupported = BoxRays::unsupported::<<Portable as Simd>::D4>(rays.rays());
            let expected: Vec<usize> = (0..len).filter(|&i| !is_plain(i)).collect();
            assert_eq!(unsupported.iter().collect::<Vec<_>>(), expected);
            let (others, count) = unsupported.others(len, |_| false);
            let plain = (0..len).filter(|&i| is_plain(i));
            assert!(others[..count].iter().map(|&ray| usize::from(ray)).eq(plain));
            assert_eq!(RayMask::first(len).iter().collect::<Vec<_>>(), (0..len).collect::<Vec<_>>());
        }
    }
}
