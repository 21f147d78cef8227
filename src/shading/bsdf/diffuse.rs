//! Lambert's diffuse reflection, without branches.

use std::f64::consts::PI;

use glam::DVec3;

use crate::world::sin_cos_of_turns;

/// The BSDF of an albedo times the cosine of `light`, and the density per solid angle of [`sample`]; 0 below the surface.
#[inline(always)]
pub(crate) fn eval_pdf(albedo: DVec3, light: DVec3) -> (DVec3, f64) {
    let density = light.z.max(0.0) / PI;
    (albedo * density, density)
}

/// A direction of the hemisphere with the density cos / pi: the cosine is the root of a uniform number.
#[inline(always)]
pub(crate) fn sample(numbers: [f64; 2]) -> DVec3 {
    let sine = numbers[0].sqrt();
    let (sin, cos) = sin_cos_of_turns(numbers[1]);
    DVec3::new(sine * cos, sine * sin, (1.0 - numbers[0]).sqrt())
}
