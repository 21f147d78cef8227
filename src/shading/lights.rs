//! Light samples: direction, distance and radiance of a light at a surface.

use glam::DVec3;

use crate::scene::{Falloff, LightKind};
use crate::world::{InteractionSoa, PerRay, Vec3Soa, WorldLight, simd};

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
    /// The light at a point of the scene, whatever is there: its `cosine` is 0. `None` where it has no radiance.
    pub(crate) fn towards(light: &WorldLight, point: DVec3) -> Option<Self> {
        let (sample, is_something) = Self::incident(&light.kind, light.radiance, point);
        is_something.then_some(sample)
    }

    #[inline(always)]
    fn incident(kind: &LightKind, radiance: DVec3, point: DVec3) -> (Self, bool) {
        let (to_light, strength) = kind.incident(point);
        let length = to_light.length();
        // Not finite for a light at the point itself, which `length > 0` rejects.
        let direction = to_light / length;
        let radiance = radiance * strength;
        let sum = radiance * 0.0;
        let is_finite = (sum.x == 0.0) & (sum.y == 0.0) & (sum.z == 0.0);
        let is_something = (radiance.x != 0.0) | (radiance.y != 0.0) | (radiance.z != 0.0);
        let is_something = is_something & (length > 0.0) & is_finite;
        let distance = if kind.position().is_some() { length } else { f64::INFINITY };
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
#[derive(Default)]
pub struct LightSoa {
    direction: Vec3Soa,
    radiance: Vec3Soa,
    distance: PerRay<f64>,
    cosine: PerRay<f64>,
    /// For each surface, whether the light contributes. Cleared by occlusion tests.
    pub reaches: PerRay<bool>,
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

    /// Samples `light` at every surface. It contributes nothing where its radiance is 0 or not finite, where it lies at
    /// the point itself, or below the horizon. The horizon is that of the shading normal and, unless `smooth` is set,
    /// also that of the geometric normal.
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
            let (sample, is_something) = LightSample::incident(kind, radiance, surfaces.position.get(i));
            let cosine = surfaces.shading_normal.get(i).dot(sample.direction);
            let is_above = surfaces.geometric_normal.get(i).dot(sample.direction) > 0.0;
            self.direction.set(i, sample.direction);
            self.radiance.set(i, sample.radiance);
            self.distance[i] = sample.distance;
            self.cosine[i] = cosine;
            self.reaches[i] = (cosine > 0.0) & (smooth | is_above) & is_something;
        }
    }
}
