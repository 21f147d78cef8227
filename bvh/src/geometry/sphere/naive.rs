//! The test of the tier `naive`: that of [`super`] in f32.

use super::Sphere;
use crate::geometry::naive::{FastTest, within};
use crate::geometry::{PreparedRay, Ray};

/// The least distance within `t_min < t < t_max` at which the ray meets the sphere.
#[inline(always)]
pub(crate) fn hit(ray: &Ray, sphere: &Sphere) -> Option<f64> {
    let test = FastTest::new(ray);
    let (d, f) = (test.direction, test.origin - sphere.centre.as_vec3());
    let radius = sphere.radius as f32;
    let a = d.dot(d);
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let discriminant = radius * radius - nearest.dot(nearest);
    if discriminant < 0.0 || discriminant.is_nan() {
        return None;
    }
    let q = b + (a * discriminant).sqrt().copysign(b);
    let c = f.dot(f) - radius * radius;
    let (t0, t1) = (c / q, q / a);
    let b = sphere.bounds();
    let within = |t: f32| within(&test.boxes, ray, t, [b.min.into(), b.max.into()]);
    within(t0.min(t1)).or_else(|| within(t0.max(t1)))
}
