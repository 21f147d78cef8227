//! [`BoxRays`]: the rays of a stream prepared for the boxes of nodes.

use crate::bvh::wide::single::box_ray::{BoxRay, LENGTHS, WIDENING};
use crate::geometry::simd::{Doubles, Simd, Vector};
use crate::geometry::{BATCH, Rays};

/// A [`BoxRay`] for each ray.
pub(crate) struct BoxRays(Vec<BoxRay>);

impl Default for BoxRays {
    fn default() -> Self {
        BoxRays(vec![BoxRay::of_parts([1.0; 3], [[0.0; 2]; 3], 0.0); BATCH])
    }
}

impl BoxRays {
    /// Whether the directions have no zeros and need no scaling, and the offsets are finite in f32: from an infinite one
    /// the ray would enter the infinite boxes of empty places.
    #[inline(always)]
    pub(crate) fn supports<D: Doubles>(rays: Rays) -> bool {
        let (zero, least, most) = (D::splat(0.0), D::splat(*LENGTHS.start()), D::splat(*LENGTHS.end()));
        let mut supported = D::ALL;
        for first in (0..rays.len()).step_by(D::LANES) {
            let [x, y, z] = rays.direction_lanes::<D>(first);
            let [x, y, z] = [x.abs(), y.abs(), z.abs()];
            let longest = x.max(y).max(z);
            supported &= zero.lt(x) & zero.lt(y) & zero.lt(z) & least.le(longest) & longest.le(most);
            // Half the range, so that the widened offset is finite, too.
            let range = D::splat(f64::from(f32::MAX / 2.0));
            for (origin, direction) in rays.origin_lanes::<D>(first).into_iter().zip([x, y, z]) {
                supported &= origin.abs().le(range * direction);
            }
        }
        supported == D::ALL
    }

    /// Prepares the rays of a vector of f32 from index `first` on, as [`BoxRay::new`], with `t_min` rounded down further.
    /// They must be supported.
    #[inline(always)]
    pub(crate) fn fill<S: Simd>(&mut self, rays: Rays, first: usize, fast: bool) {
        let (zero, one) = (S::F8::splat(0.0), S::F8::splat(1.0));
        let (mut inverses, mut offsets) = ([S::F8::ZEROS; 3], [[S::F8::ZEROS; 2]; 3]);
        for axis in 0..3 {
            let inverse = one / rays.direction_floats::<S::D4>(axis, first);
            let offset = rays.origin_floats::<S::D4>(axis, first) * inverse;
            let (of_offset, of_inverse) = (offset.max(zero - offset), inverse.max(zero - inverse));
            let underflow = (of_inverse + one) * S::F8::splat(f32::MIN_POSITIVE);
            let widening = if fast { zero } else { of_offset * S::F8::splat(WIDENING) + underflow };
            inverses[axis] = inverse.array();
            offsets[axis] = [(offset + widening).array(), (offset - widening).array()];
        }
        // Rounded to nearest, then down by more than that rounds. Underflow is covered by the widening.
        let t_min = rays.t_min_floats::<S::D4>(first);
        let t_min = (t_min * S::F8::splat(1.0 - f32::EPSILON)).max(zero).array();
        let [[ox, px], [oy, py], [oz, pz]] = &offsets;
        for (lane, ray) in self.0[first..first + S::F8::LANES].iter_mut().enumerate() {
            let inverse = [inverses[0][lane], inverses[1][lane], inverses[2][lane]];
            let offsets = [[ox[lane], px[lane]], [oy[lane], py[lane]], [oz[lane], pz[lane]]];
            *ray = BoxRay::of_parts(inverse, offsets, t_min[lane]);
        }
    }

    /// The ray at `i`.
    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> &BoxRay {
        &self.0[i]
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
        assert!(BoxRays::supports::<<Portable as Simd>::D4>(rays.rays()));
        let mut packet = BoxRays::default();
        for first in (0..rays.len()).step_by(8) {
            packet.fill::<Portable>(rays.rays(), first, false);
        }
        for (i, ray) in rays.rays().iter().enumerate() {
            let (mut found, expected) = (*packet.at(i), BoxRay::new(&ray, true, false));
            assert!(found.t_min <= expected.t_min && f64::from(found.t_min) >= ray.t_min * 0.999_999 - 1e-45);
            found.t_min = expected.t_min;
            assert_eq!(found, expected, "{ray:?}");
        }
    }
}
