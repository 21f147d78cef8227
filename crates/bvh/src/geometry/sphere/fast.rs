//! The test of the tier `fast`: that of [`super`] in f32, for a ray in each lane.

use super::Sphere;
use crate::geometry::fast::{dot, minus};
use crate::geometry::simd::Floats;

/// The lanes that hit, and the distances.
#[inline(always)]
pub(crate) fn hit_n<F: Floats>(
    sphere: &Sphere,
    origin: &[F; 3],
    d: &[F; 3],
    [t_min, t_max]: [F; 2],
) -> (u32, F) {
    let [x, y, z] = sphere.centre.as_vec3().to_array();
    let f = minus(origin, &[F::splat(x), F::splat(y), F::splat(z)]);
    let (radius, zero) = (F::splat(sphere.radius as f32), F::splat(0.0));
    let (a, b) = (dot(d, d), zero - dot(&f, d));
    let share = b / a;
    let nearest = [d[0].mul_add(share, f[0]), d[1].mul_add(share, f[1]), d[2].mul_add(share, f[2])];
    let discriminant = radius.mul_sub(radius, dot(&nearest, &nearest));
    let met = zero.le(discriminant);
    let q = b + (a * discriminant).sqrt().flip(b);
    let c = dot(&f, &f) - radius * radius;
    let (t0, t1) = (c / q, q / a);
    let (near, far) = (t0.min(t1), t0.max(t1));
    let within = t_min.lt(near) & near.lt(t_max);
    let t = F::select(within, near, far);
    (met & t_min.lt(t) & t.lt(t_max), t)
}
