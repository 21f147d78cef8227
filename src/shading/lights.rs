//! Light samples: direction, distance and radiance of a light at a surface.

use glam::DVec3;

use crate::scene::{Falloff, LightKind};
use crate::world::{InteractionSoa, RAYS_PER_BATCH, SurfaceInteraction, Vec3Soa, WorldLight, simd};

/// A light sampled at a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// The unit vector towards the light.
    pub direction: DVec3,
    /// The distance of the light; infinite for directional lights.
    pub distance: f64,
    /// The incident radiance: colour times intensity times falloff, without the cosine.
    pub radiance: DVec3,
    /// The cosine between the shading normal and the direction, above 0.
    pub cosine: f64,
}

impl LightSample {
    /// The light sampled at a surface; `None` where it contributes nothing: its radiance there is 0 or not finite, it lies at the
    /// point itself, or below the horizon. The horizon is that of the shading normal and, unless `smooth` is set, also that of the
    /// geometric normal.
    #[inline]
    pub fn new(light: &WorldLight, surface: &SurfaceInteraction, smooth: bool) -> Option<Self> {
        let normals = [surface.shading_normal, surface.geometric_normal];
        let (sample, reaches) =
            Self::at(&light.kind, light.radiance, surface.point.position, normals, smooth);
        reaches.then_some(sample)
    }

    /// The light sampled at a point with the given shading and geometric normal, and whether it contributes there. Without
    /// branches on the surface, for vectorisation.
    #[inline(always)]
    fn at(
        kind: &LightKind,
        radiance: DVec3,
        point: DVec3,
        [shading_normal, geometric_normal]: [DVec3; 2],
        smooth: bool,
    ) -> (Self, bool) {
        let (sample, is_something) = Self::incident(kind, radiance, point);
        let cosine = shading_normal.dot(sample.direction);
        let reaches = (cosine > 0.0) & (smooth | (geometric_normal.dot(sample.direction) > 0.0));
        (LightSample { cosine, ..sample }, reaches & is_something)
    }

    /// The light at a point of the scene, whatever is there: its `cosine` is 0. `None` where it has no radiance.
    pub(crate) fn towards(light: &WorldLight, point: DVec3) -> Option<Self> {
        let (sample, is_something) = Self::incident(&light.kind, light.radiance, point);
        is_something.then_some(sample)
    }

    #[inline(always)]
    fn incident(kind: &LightKind, radiance: DVec3, point: DVec3) -> (Self, bool) {
        let (to_light, strength) = match kind {
            LightKind::Directional { direction, .. } => (-*direction, 1.0),
            LightKind::Point { position, falloff } => {
                let to_light = *position - point;
                (to_light, distance_attenuation(*falloff, to_light.length_squared()))
            }
            LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } => {
                let to_light = *position - point;
                let cosine = -to_light.dot(*direction) / to_light.length();
                let cone = cone_attenuation(cosine, *inner_angle, *outer_angle);
                (to_light, cone * distance_attenuation(*falloff, to_light.length_squared()))
            }
            // Surfaces of the scene, which are lights in path tracing alone.
            LightKind::Sphere { .. } | LightKind::Rectangle { .. } => (DVec3::ZERO, 0.0),
        };
        let length = to_light.length();
        // Not finite for a light at the point itself, which `length > 0` rejects.
        let direction = to_light / length;
        let radiance = radiance * strength;
        let sum = radiance * 0.0;
        let is_finite = (sum.x == 0.0) & (sum.y == 0.0) & (sum.z == 0.0);
        let is_something = (radiance.x != 0.0) | (radiance.y != 0.0) | (radiance.z != 0.0);
        let is_something = is_something & (length > 0.0) & is_finite;
        let distance = if matches!(kind, LightKind::Directional { .. }) { f64::INFINITY } else { length };
        (LightSample { direction, distance, radiance, cosine: 0.0 }, is_something)
    }

    /// The same sample as seen from a point displaced by `moved`: direction and distance change, radiance and cosine do not.
    #[inline(always)]
    pub fn seen_from(&self, moved: DVec3) -> Self {
        if self.distance.is_infinite() {
            return *self;
        }
        let to_light = self.direction * self.distance - moved;
        let distance = to_light.length();
        // At the light itself there is no direction; the original one is kept.
        let direction = if distance > 0.0 { to_light / distance } else { self.direction };
        LightSample { direction, distance, ..*self }
    }
}

/// A light sampled at the surfaces of a ray generation, as a structure of arrays.
pub struct LightSoa {
    direction: Vec3Soa,
    radiance: Vec3Soa,
    distance: [f64; RAYS_PER_BATCH],
    cosine: [f64; RAYS_PER_BATCH],
    /// For each surface, whether the light contributes. Cleared by occlusion tests.
    pub reaches: [bool; RAYS_PER_BATCH],
}

impl Default for LightSoa {
    fn default() -> Self {
        LightSoa {
            direction: Vec3Soa::default(),
            radiance: Vec3Soa::default(),
            distance: [0.0; RAYS_PER_BATCH],
            cosine: [0.0; RAYS_PER_BATCH],
            reaches: [false; RAYS_PER_BATCH],
        }
    }
}

impl LightSoa {
    /// The sample at surface `i`, meaningful only where `reaches` is set.
    #[inline(always)]
    pub fn get(&self, i: usize) -> LightSample {
        LightSample {
            direction: self.direction.get(i),
            distance: self.distance[i],
            radiance: self.radiance.get(i),
            cosine: self.cosine[i],
        }
    }

    /// Multiplies the radiance at surface `i`.
    pub(crate) fn scale(&mut self, i: usize, factor: f64) {
        self.radiance.set(i, self.radiance.get(i) * factor);
    }

    /// Samples `light` at every surface, with the bits of [`LightSample::new`].
    pub fn sample(&mut self, light: &WorldLight, surfaces: &InteractionSoa, smooth: bool) {
        // The common kinds are passed as constants, so that the loop has no branch on them.
        match &light.kind {
            &LightKind::Directional { direction, angle } => {
                simd!(self.fill(&LightKind::Directional { direction, angle }, light, surfaces, smooth));
            }
            &LightKind::Point { position, falloff: Falloff::None } => simd!({
                let kind = LightKind::Point { position, falloff: Falloff::None };
                self.fill(&kind, light, surfaces, smooth);
            }),
            &LightKind::Point { position, falloff: Falloff::InverseSquare { range: None } } => simd!({
                let falloff = Falloff::InverseSquare { range: None };
                self.fill(&LightKind::Point { position, falloff }, light, surfaces, smooth);
            }),
            kind => self.fill(kind, light, surfaces, smooth),
        }
    }

    #[inline(always)]
    fn fill(&mut self, kind: &LightKind, light: &WorldLight, surfaces: &InteractionSoa, smooth: bool) {
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

/// The distance attenuation of KHR_lights_punctual: 1 / d^2, times max(min(1 - (d / range)^4, 1), 0) for a light with a range.
#[inline(always)]
fn distance_attenuation(falloff: Falloff, distance_squared: f64) -> f64 {
    match falloff {
        Falloff::None => 1.0,
        Falloff::InverseSquare { range: None } => 1.0 / distance_squared,
        Falloff::InverseSquare { range: Some(range) } => {
            let ratio = distance_squared / (range * range);
            (1.0 - ratio * ratio).clamp(0.0, 1.0) / distance_squared
        }
    }
}

/// The angular attenuation of KHR_lights_punctual: the square of a linear ramp in the cosine from the outer to the inner angle.
fn cone_attenuation(cosine: f64, inner_angle: f64, outer_angle: f64) -> f64 {
    let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
    if cosine <= outer {
        return 0.0;
    }
    let ramp = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0);
    // Equal angles give a sharp edge: 0 / 0 inside the cone counts as 1.
    if ramp.is_nan() { 1.0 } else { ramp * ramp }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falloff_by_hand() {
        assert_eq!(distance_attenuation(Falloff::None, 100.0), 1.0);
        assert_eq!(distance_attenuation(Falloff::InverseSquare { range: None }, 4.0), 0.25);
        // d = 1, range = 2: 1 - (1/2)^4 = 15/16.
        assert_eq!(distance_attenuation(Falloff::InverseSquare { range: Some(2.0) }, 1.0), 15.0 / 16.0);
        assert_eq!(distance_attenuation(Falloff::InverseSquare { range: Some(2.0) }, 9.0), 0.0);
    }

    #[test]
    fn cones_by_hand() {
        let (inner, outer) = (0.0f64, 60f64.to_radians());
        assert_eq!(cone_attenuation(1.0, inner, outer), 1.0);
        assert_eq!(cone_attenuation(0.5, inner, outer), 0.0);
        // Halfway in the cosine: (1/2)^2.
        assert!((cone_attenuation(0.75, inner, outer) - 0.25).abs() < 1e-12);
        assert_eq!(cone_attenuation(0.9, outer, outer), 1.0);
    }
}
