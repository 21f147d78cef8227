//! The lights of a world as one distribution for next event estimation: each punctual and directional light, or the punctual
//! ones together where there are many, the emissive surfaces and the environment, chosen with equal probability.

use std::f64::consts::PI;

use glam::DVec3;

use super::light_samples::end_tier;
use super::weights::bsdf_weight;
use super::{Path, Scatter};
use crate::bvh::Numerics;
use crate::effects::{LightTechnique, TextureUse};
use crate::scene::{TexelEncoding, TextureSlot};
use crate::shading::LightSample;
use crate::shading::texture::look_up;
use crate::world::{
    EmitterSample, Emitters, EnvironmentCell, LightGroups, SurfaceInteraction, TexturePoint, TriangleSample,
    TwoTriangles, World, sampled_emission,
};

/// The lights of a world.
pub(super) struct Lights<'a> {
    world: &'a World,
    emitters: &'a Emitters,
    /// How the textures of emissive surfaces are looked up.
    texture_use: TextureUse,
    /// Single lights, then the many if there are, then the emitters if there are any, then the environment if there is one.
    count: usize,
    /// The number of the first two kinds.
    before_emitters: usize,
    /// The expected number of samples of each light at a surface is 1 over this.
    per_sample: f64,
    technique: LightTechnique,
}

/// A sampled light as seen from a point.
pub(super) struct LightConnection {
    /// The unit vector towards the sampled point.
    pub(super) direction: DVec3,
    /// The incident radiance; for lights without size divided by the expected number of samples of the light. Not yet
    /// divided by `pdf`.
    pub(super) radiance: DVec3,
    /// The density per solid angle, times the expected number of samples of the light (Veach 1997, section 9.2.2);
    /// infinite for lights without size, which no BSDF sample reaches.
    pub(super) pdf: f64,
    /// The distance of a light without size, which may lie on a surface; infinite for what is infinitely far away; 0 for
    /// a point of a surface.
    pub(super) distance: f64,
    /// That point, offset in front of its surface. For a light without size: in each component, the tested fraction of
    /// the shadow ray ([`crate::world::WorldLight::tested_share`]).
    pub(super) end: DVec3,
}

impl LightConnection {
    /// A sample of what is infinitely far away.
    fn at_infinity(direction: DVec3, radiance: DVec3, pdf: f64) -> Self {
        LightConnection { direction, radiance, pdf, distance: f64::INFINITY, end: DVec3::ZERO }
    }
}

impl<'a> Lights<'a> {
    pub(super) fn new(world: &'a World, stage: &Scatter) -> Self {
        let &Scatter { technique, texture_use, settings, .. } = stage;
        let emitters = &*world.emitters;
        let LightGroups { singles, many } = &*world.light_groups;
        let before_emitters = singles.len() + usize::from(many.is_some());
        let count =
            before_emitters + usize::from(!emitters.is_empty()) + usize::from(world.environment.is_some());
        let per_sample = count as f64 / f64::from(settings.light_samples);
        Lights { world, emitters, texture_use, count, before_emitters, per_sample, technique }
    }

    /// The expected number of samples of each light at a surface.
    pub(super) fn expected(&self) -> f64 {
        1.0 / self.per_sample
    }

    /// The index of a chosen group, and a number in [0, 1) for the choice within it. The second number of a choice has 24
    /// bits; what the choice of the group leaves of the first follows them.
    #[inline(always)]
    fn group(&self, [first, second]: [f64; 2]) -> (usize, f64) {
        let at = first * self.count as f64;
        let index = (at as usize).min(self.count - 1);
        // The largest sums round to 1.
        (index, (second + (at - index as f64) / f64::from(1 << 24)).min(1.0 - f64::EPSILON))
    }

    /// The light that is not a surface which a choice takes from a point, and its probability within the choices of its
    /// group; `None` for the emitters and the environment.
    pub(super) fn light(&self, from: DVec3, choice: [f64; 2]) -> Option<(usize, f64)> {
        let LightGroups { singles, many } = &*self.world.light_groups;
        let (index, number) = self.group(choice);
        if let Some(&light) = singles.get(index) {
            return Some((light as usize, 1.0));
        }
        let (lights, tree) = many.as_ref().filter(|_| index == singles.len())?;
        let (light, probability) = tree.sample(from, number);
        Some((lights[light] as usize, probability))
    }

    /// Whether a choice is one of the emitters. Without branches, for loops over vertices.
    #[inline(always)]
    pub(super) fn is_emitter(&self, choice: [f64; 2]) -> bool {
        let (at, first) = (choice[0] * self.count as f64, self.before_emitters as f64);
        let is_last = self.world.environment.is_none();
        !self.emitters.is_empty() & (first <= at) & (is_last | (at < first + 1.0))
    }

    /// Whether a choice is the environment. Without branches.
    #[inline(always)]
    pub(super) fn is_environment(&self, choice: [f64; 2]) -> bool {
        self.world.environment.is_some() & ((self.count as f64) - 1.0 <= choice[0] * self.count as f64)
    }

    /// The radiance of a uniform environment.
    pub(super) fn uniform_radiance(&self) -> Option<DVec3> {
        self.world.environment.as_ref()?.uniform_radiance()
    }

    /// See [`Emitters::two_triangles`].
    pub(super) fn two_triangles(&self) -> Option<TwoTriangles<'_>> {
        self.emitters.two_triangles()
    }

    /// Whether there are lights without size or discs, or emitters other than one or two triangles.
    pub(super) fn has_others(&self, two: Option<&TwoTriangles>) -> bool {
        !self.world.lights.is_empty() || two.is_none() && !self.emitters.is_empty()
    }

    /// The light sample of [`Lights::sample`] before it is seen from a point, with its radiance, if it is of a triangle
    /// without emission texture.
    #[inline]
    pub(super) fn sample_triangle(
        &self,
        from: DVec3,
        choice: [f64; 2],
        numbers: [f64; 2],
    ) -> Option<(TriangleSample, DVec3)> {
        let is_emitter = self.is_emitter(choice);
        if is_emitter {
            self.emitters.sample_triangle(from, self.emitter_number(choice), numbers)
        } else {
            None
        }
    }

    /// The number that chooses among the emitters. Two are chosen in loops, by 24 bits.
    fn emitter_number(&self, choice: [f64; 2]) -> f64 {
        if self.emitters.are_two() { choice[1] } else { self.group(choice).1 }
    }

    /// Calls `found` with the index of a pair of numbers and the light sample of the environment, where that has a density.
    pub(super) fn sample_environment(
        &self,
        numbers: impl Iterator<Item = [f64; 2]>,
        cells: &mut Vec<EnvironmentCell>,
        mut found: impl FnMut(usize, LightConnection),
    ) {
        let Some(environment) = &self.world.environment else { return };
        environment.sample_each(numbers, cells, |index, sample| {
            let pdf = sample.pdf * self.expected();
            if pdf > 0.0 {
                found(index, LightConnection::at_infinity(sample.direction, sample.radiance, pdf));
            }
        });
    }

    /// Takes one of the light samples of a point; `None` where the sample gives no light there.
    pub(super) fn sample(&self, from: DVec3, choice: [f64; 2], numbers: [f64; 2]) -> Option<LightConnection> {
        if self.count == 0 {
            return None;
        }
        let expected = self.expected();
        if let Some((index, probability)) = self.light(from, choice) {
            let light = &self.world.lights[index];
            if let Some(disc) = &light.disc {
                let direction = disc.sample(numbers);
                let pdf = disc.density() * expected;
                return Some(LightConnection::at_infinity(direction, disc.radiance, pdf));
            }
            let sample = LightSample::towards(light, from)?;
            // An intensity of 1 gives a facing diffuse surface the radiance of its base colour, pi times that of the BSDF.
            let radiance = PI * sample.radiance / (expected * probability);
            let LightSample { direction, distance, .. } = sample;
            let (pdf, end) = (f64::INFINITY, DVec3::splat(light.tested_share(from)));
            return Some(LightConnection { direction, radiance, pdf, distance, end });
        }
        if self.is_emitter(choice) {
            let sample = self.emitters.sample(from, self.emitter_number(choice), numbers)?;
            return Some(LightConnection {
                direction: sample.direction,
                radiance: sample.radiance * self.emission_texel(&sample),
                pdf: (sample.pdf * expected).min(f64::MAX),
                distance: 0.0,
                end: sample
                    .point
                    .origin_towards(sample.normal, end_tier(self.world.numerics() == Numerics::Fast)),
            });
        }
        let environment = self.world.environment.as_ref()?;
        let sample = environment.sample(numbers);
        let pdf = sample.pdf * expected;
        (pdf > 0.0).then_some(LightConnection::at_infinity(sample.direction, sample.radiance, pdf))
    }

    /// The radiance from infinitely far away for a BSDF sample of density `pdf`: of the environment and of the discs of
    /// directional lights, each weighted against its own light samples. `place` is [`World::environment_position`].
    #[inline]
    pub(super) fn radiance_from_infinity(&self, direction: DVec3, pdf: f64, place: [f64; 2]) -> DVec3 {
        let discs = self.world.lights.iter().filter_map(|light| light.disc.as_ref());
        let seen = discs.filter(|disc| disc.contains(direction));
        let mut radiance: DVec3 = seen
            .map(|disc| disc.radiance * bsdf_weight(self.technique, pdf, disc.density() / self.per_sample))
            .sum();
        if let Some(environment) = &self.world.environment {
            let (seen, light_pdf) = environment.eval_pdf(direction, place);
            radiance += seen * bsdf_weight(self.technique, pdf, light_pdf / self.per_sample);
        }
        radiance
    }

    /// The weight of the emission found by a path against light samples.
    pub(super) fn weight_of_emitter(&self, surface: &SurfaceInteraction, path: &Path) -> f64 {
        let material = &self.world.materials[surface.material as usize];
        let Some(emission) = sampled_emission(material).filter(|_| path.pdf.is_finite()) else { return 1.0 };
        let object = &self.world.objects[surface.object as usize];
        let local = surface.hit.prim.0 - object.first.0;
        let shape = if object.is_analytic { self.world.shape_of(surface) } else { None };
        let light_pdf = self.emitters.pdf(surface, shape, (local, emission), path.from);
        bsdf_weight(self.technique, path.pdf, light_pdf / self.per_sample)
    }

    /// The factor of the emission by its texture at a sampled point: the value that a path finds there, by the filter
    /// without a footprint. 1 without texture or where textures are off.
    fn emission_texel(&self, sample: &EmitterSample) -> DVec3 {
        let texture = self.world.materials[sample.material as usize].textures()[TextureSlot::Emission];
        let Some(texture) = texture.filter(|_| self.texture_use.material_textures) else { return DVec3::ONE };
        let Some(uv) = self.world.uv(sample.object, sample.id, sample.barycentrics, texture.coordinates)
        else {
            return DVec3::ONE;
        };
        let (image, filter) =
            (&self.world.images[texture.image.0 as usize], self.texture_use.filter(&texture));
        let point = TexturePoint { uv, ..TexturePoint::default() };
        look_up(image, TexelEncoding::Colour, &texture.sampler, &filter, &point)
    }
}
