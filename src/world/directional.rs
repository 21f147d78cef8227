//! Directional lights with an apparent diameter: discs of uniform radiance at an infinite distance, such as the sun.

use std::f64::consts::PI;

use glam::DVec3;

use super::turns::sin_cos_of_turns;

/// The disc of a directional light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightDisc {
    /// The radiance from every direction of the disc.
    pub(crate) radiance: DVec3,
    /// The unit vector towards its centre.
    axis: DVec3,
    /// 1 minus the cosine of its angular radius.
    span: f64,
}

impl LightDisc {
    /// The disc of a light that travels along the unit vector `direction`, with an apparent diameter of `angle`
    /// radians, 0 to pi. `None` for a diameter that unit vectors in f64 cannot resolve, such as 0.
    ///
    /// `intensity` is the light's without a diameter: a facing surface has the irradiance pi * intensity. A disc of
    /// radiance L and angular radius h straight above has the irradiance of the integral of L cos t over its solid
    /// angle, 2 pi L times the integral of cos t sin t from 0 to h, which is pi L sin^2 h. So L = intensity / sin^2 h.
    pub(super) fn new(direction: DVec3, angle: f64, intensity: DVec3) -> Option<Self> {
        let (sin, sin_of_half) = (libm::sin(0.5 * angle), libm::sin(0.25 * angle));
        (sin > f64::EPSILON).then(|| LightDisc {
            radiance: intensity / (sin * sin),
            axis: -direction,
            span: 2.0 * sin_of_half * sin_of_half,
        })
    }

    /// A unit direction towards the disc, uniform in its solid angle. `numbers` are in [0, 1).
    pub(crate) fn sample(&self, [x, y]: [f64; 2]) -> DVec3 {
        let height = self.span * x;
        let sin = (height * (2.0 - height)).max(0.0).sqrt();
        let (tangent, bitangent) = self.axis.any_orthonormal_pair();
        let (sin_angle, cos_angle) = sin_cos_of_turns(y);
        let sideways = (tangent * cos_angle + bitangent * sin_angle) * sin;
        (self.axis * (1.0 - height) + sideways).normalize()
    }

    /// The density per solid angle of [`LightDisc::sample`] within the disc.
    pub(crate) fn density(&self) -> f64 {
        1.0 / (2.0 * PI * self.span)
    }

    /// Whether a unit direction points at the disc. The squared chord, 2 (1 - cos), has no cancellation for small
    /// angles.
    pub(crate) fn contains(&self, direction: DVec3) -> bool {
        (direction - self.axis).length_squared() <= 2.0 * self.span
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The irradiance of a facing surface is pi times the intensity for every diameter: by the mean of
    /// radiance * cosine / density over a midpoint grid of samples. The cosine is linear in the first number, for which
    /// the midpoint rule is exact.
    #[test]
    fn the_irradiance_does_not_depend_on_the_diameter() {
        for degrees in [1e-6f64, 0.53, 10.0, 90.0, 180.0] {
            let direction = DVec3::new(0.3, -0.9, 0.2).normalize();
            let disc = LightDisc::new(direction, degrees.to_radians(), DVec3::ONE).unwrap();
            let mut sum = 0.0;
            for i in 0..1024 {
                let numbers = [(f64::from(i / 32) + 0.5) / 32.0, (f64::from(i % 32) + 0.5) / 32.0];
                let sampled = disc.sample(numbers);
                assert!(disc.contains(sampled), "{degrees} {numbers:?}");
                sum += disc.radiance.x * -sampled.dot(direction) / disc.density();
            }
            assert!((sum / 1024.0 / PI - 1.0).abs() < 1e-9, "{degrees}: {}", sum / 1024.0 / PI);
        }
    }
}
