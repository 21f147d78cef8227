//! What arrives from a light at a point.

use glam::DVec3;

use crate::scene::{Falloff, LightKind};
use crate::world::{Surface, WorldLight};

/// A light as seen from a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: DVec3,
    /// How far away the light is; infinite for directional lights.
    pub distance: f64,
    /// What arrives, before the surface's tilt: colour times intensity times falloff.
    pub radiance: DVec3,
    /// Cosine between the shading normal and the direction, above 0.
    pub cosine: f64,
}

impl LightSample {
    /// The light as seen from the surface, or `None` where it adds nothing: it has no intensity there, lies in the
    /// surface, or shines on the other side. The sides are those of the shading normal, and of the geometry, too, unless
    /// the surface is to be taken as `smooth`.
    #[inline]
    pub fn new(light: &WorldLight, surface: &Surface, smooth: bool) -> Option<Self> {
        let (to_light, strength) = match &light.kind {
            LightKind::Directional { direction } => (-*direction, 1.0),
            LightKind::Point { position, falloff } => {
                let to_light = *position - surface.point.position;
                (to_light, weaken(*falloff, to_light.length_squared()))
            }
            LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } => {
                let to_light = *position - surface.point.position;
                let cosine = -to_light.dot(*direction) / to_light.length();
                let cone = cone(cosine, *inner_angle, *outer_angle);
                (to_light, cone * weaken(*falloff, to_light.length_squared()))
            }
        };
        let length = to_light.length();
        // A light in the point itself has no direction to shine from.
        let direction = to_light / length;
        let cosine = surface.shading_normal.dot(direction);
        let reaches = cosine > 0.0 && (smooth || surface.geometric_normal.dot(direction) > 0.0);
        let radiance = light.radiance * strength;
        if !(reaches && length > 0.0 && radiance.is_finite() && radiance != DVec3::ZERO) {
            return None;
        }
        let distance =
            if matches!(light.kind, LightKind::Directional { .. }) { f64::INFINITY } else { length };
        Some(LightSample { direction, distance, radiance, cosine })
    }

    /// The same light from a point that lies `moved` beside the surface's.
    pub fn seen_from(&self, moved: DVec3) -> Self {
        if self.distance.is_infinite() {
            return *self;
        }
        let to_light = self.direction * self.distance - moved;
        let distance = to_light.length();
        // Lifted right into the light, it has no direction; the surface's own will do.
        let direction = if distance > 0.0 { to_light / distance } else { self.direction };
        LightSample { direction, distance, ..*self }
    }
}

/// KHR_lights_punctual: 1 / d^2, times max(min(1 - (d / range)^4, 1), 0) where there is a range.
fn weaken(falloff: Falloff, distance_squared: f64) -> f64 {
    match falloff {
        Falloff::None => 1.0,
        Falloff::InverseSquare { range: None } => 1.0 / distance_squared,
        Falloff::InverseSquare { range: Some(range) } => {
            let ratio = distance_squared / (range * range);
            (1.0 - ratio * ratio).clamp(0.0, 1.0) / distance_squared
        }
    }
}

/// KHR_lights_punctual: the square of a linear ramp in the cosine from the outer to the inner angle.
fn cone(cosine: f64, inner_angle: f64, outer_angle: f64) -> f64 {
    let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
    if cosine <= outer {
        return 0.0;
    }
    let ramp = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0);
    // Equal angles make a sharp edge: 0 / 0 inside is full strength.
    if ramp.is_nan() { 1.0 } else { ramp * ramp }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falloff_by_hand() {
        assert_eq!(weaken(Falloff::None, 100.0), 1.0);
        assert_eq!(weaken(Falloff::InverseSquare { range: None }, 4.0), 0.25);
        // d = 1, range = 2: 1 - (1/2)^4 = 15/16.
        assert_eq!(weaken(Falloff::InverseSquare { range: Some(2.0) }, 1.0), 15.0 / 16.0);
        assert_eq!(weaken(Falloff::InverseSquare { range: Some(2.0) }, 9.0), 0.0);
    }

    #[test]
    fn cones_by_hand() {
        let (inner, outer) = (0.0f64, 60f64.to_radians());
        assert_eq!(cone(1.0, inner, outer), 1.0);
        assert_eq!(cone(0.5, inner, outer), 0.0);
        // Halfway in the cosine: (1/2)^2.
        assert!((cone(0.75, inner, outer) - 0.25).abs() < 1e-12);
        assert_eq!(cone(0.9, outer, outer), 1.0);
    }
}
