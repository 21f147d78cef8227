//! What arrives from a light at a point.

use glam::DVec3;

use crate::scene::{Falloff, LightKind};
use crate::world::{LANES, Lanes, Surface, Surfaces, WorldLight, widely};

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
        let normals = [surface.shading_normal, surface.geometric_normal];
        let (sample, reaches) =
            Self::at(&light.kind, light.radiance, surface.point.position, normals, smooth);
        reaches.then_some(sample)
    }

    /// The light as seen from a point with the given normals for shading and of the geometry, and whether it adds
    /// anything there.
    #[inline(always)]
    fn at(
        kind: &LightKind,
        radiance: DVec3,
        point: DVec3,
        [shading_normal, geometric_normal]: [DVec3; 2],
        smooth: bool,
    ) -> (Self, bool) {
        let (to_light, strength) = match kind {
            LightKind::Directional { direction } => (-*direction, 1.0),
            LightKind::Point { position, falloff } => {
                let to_light = *position - point;
                (to_light, weaken(*falloff, to_light.length_squared()))
            }
            LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } => {
                let to_light = *position - point;
                let cosine = -to_light.dot(*direction) / to_light.length();
                let cone = cone(cosine, *inner_angle, *outer_angle);
                (to_light, cone * weaken(*falloff, to_light.length_squared()))
            }
        };
        let length = to_light.length();
        // A light in the point itself has no direction to shine from.
        let direction = to_light / length;
        let cosine = shading_normal.dot(direction);
        let reaches = (cosine > 0.0) & (smooth | (geometric_normal.dot(direction) > 0.0));
        let radiance = radiance * strength;
        let sum = radiance * 0.0;
        let is_finite = (sum.x == 0.0) & (sum.y == 0.0) & (sum.z == 0.0);
        let is_something = (radiance.x != 0.0) | (radiance.y != 0.0) | (radiance.z != 0.0);
        let reaches = reaches & (length > 0.0) & is_finite & is_something;
        let distance = if matches!(kind, LightKind::Directional { .. }) { f64::INFINITY } else { length };
        (LightSample { direction, distance, radiance, cosine }, reaches)
    }

    /// The same light from a point that lies `moved` beside the surface's.
    #[inline(always)]
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

/// A light as the surfaces of a level see it.
pub struct LightLanes {
    direction: Lanes,
    radiance: Lanes,
    distance: [f64; LANES],
    cosine: [f64; LANES],
    /// Whether it adds anything to the surface.
    pub reaches: [bool; LANES],
}

impl Default for LightLanes {
    fn default() -> Self {
        LightLanes {
            direction: Lanes::default(),
            radiance: Lanes::default(),
            distance: [0.0; LANES],
            cosine: [0.0; LANES],
            reaches: [false; LANES],
        }
    }
}

impl LightLanes {
    /// The light as seen from the surface at `i`, where it reaches that.
    #[inline(always)]
    pub fn get(&self, i: usize) -> LightSample {
        LightSample {
            direction: self.direction.get(i),
            distance: self.distance[i],
            radiance: self.radiance.get(i),
            cosine: self.cosine[i],
        }
    }

    /// Looks at `light` from every surface: [`LightSample::new`] for each.
    pub fn look(&mut self, light: &WorldLight, surfaces: &Surfaces, smooth: bool) {
        // The common kinds are told apart once, not for every surface.
        match &light.kind {
            &LightKind::Directional { direction } => {
                widely(
                    #[inline(always)]
                    || self.fill(&LightKind::Directional { direction }, light, surfaces, smooth),
                );
            }
            &LightKind::Point { position, falloff: Falloff::None } => widely(
                #[inline(always)]
                || {
                    let kind = LightKind::Point { position, falloff: Falloff::None };
                    self.fill(&kind, light, surfaces, smooth);
                },
            ),
            &LightKind::Point { position, falloff: Falloff::InverseSquare { range: None } } => widely(
                #[inline(always)]
                || {
                    let falloff = Falloff::InverseSquare { range: None };
                    self.fill(&LightKind::Point { position, falloff }, light, surfaces, smooth);
                },
            ),
            kind => self.fill(kind, light, surfaces, smooth),
        }
    }

    #[inline(always)]
    fn fill(&mut self, kind: &LightKind, light: &WorldLight, surfaces: &Surfaces, smooth: bool) {
        let radiance = light.radiance;
        for i in 0..surfaces.len() {
            let normals = [surfaces.shading_normal.get(i), surfaces.geometric_normal.get(i)];
            let (sample, reaches) =
                LightSample::at(kind, radiance, surfaces.position.get(i), normals, smooth);
            self.direction.set(i, sample.direction);
            self.radiance.set(i, sample.radiance);
            self.distance[i] = sample.distance;
            self.cosine[i] = sample.cosine;
            self.reaches[i] = reaches;
        }
    }
}

/// KHR_lights_punctual: 1 / d^2, times max(min(1 - (d / range)^4, 1), 0) where there is a range.
#[inline(always)]
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
