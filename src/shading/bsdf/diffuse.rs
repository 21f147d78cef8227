//! Lambert's diffuse reflection.

use std::f64::consts::PI;

use glam::DVec3;

use super::lobe::Value;

/// A diffuse lobe with an albedo.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diffuse(pub(crate) DVec3);

impl Diffuse {
    /// The directional albedo.
    pub(crate) fn albedo(&self) -> DVec3 {
        self.0
    }

    /// The BRDF albedo / pi times cosine, and the density cos / pi.
    pub(crate) fn value(&self, light: DVec3) -> Value {
        let density = light.z.max(0.0) / PI;
        Value { scattered: self.0 * density, density }
    }

    /// A direction of the hemisphere with the density cos / pi: the cosine is the root of a uniform number.
    pub(crate) fn sample(numbers: [f64; 2]) -> DVec3 {
        let sine = numbers[0].sqrt();
        let (sin, cos) = (2.0 * PI * numbers[1]).sin_cos();
        DVec3::new(sine * cos, sine * sin, (1.0 - numbers[0]).sqrt())
    }
}
