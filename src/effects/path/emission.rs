//! The radiance that paths find: of emissive surfaces, and of what lies infinitely far away.

use glam::DVec3;

use super::lights::Lights;
use super::{Buffers, Path, Scatter};
use crate::effects::tile::{RayGeneration, RenderContext};
use crate::scene::TextureSlot;
use crate::world::{InteractionSoa, PreparedMaterial, World};

impl Scatter {
    /// What a path adds after `bounces` (`Path::bounces`): as it is where light comes to the camera directly or by one surface, otherwise
    /// scaled down until no channel exceeds the clamp.
    #[inline]
    pub(super) fn clamped(&self, radiance: DVec3, bounces: u8) -> DVec3 {
        let largest = radiance.max_element();
        let exceeds = bounces >= 2 && largest > self.clamp;
        if !exceeds {
            return radiance;
        }
        if largest.is_finite() {
            radiance * (self.clamp / largest)
        } else {
            radiance.min(DVec3::splat(self.clamp))
        }
    }
}

impl Buffers {
    /// Adds the radiance from infinitely far away to the paths whose ray missed. Camera rays see the background where
    /// the scene has no environment or hides it, and no directional lights.
    pub(super) fn add_missed(
        &mut self,
        generation: &RayGeneration,
        context: &RenderContext,
        lights: &Lights,
        stage: &Scatter,
        depth: u32,
    ) {
        if generation.surfaces.len() == generation.rays.len() {
            return;
        }
        self.missed.fill(generation.rays.len(), |ray| generation.hits.get(ray).is_none());
        // In a loop of its own, so that the next one reads texels for several rays at once.
        self.places.clear();
        if lights.uniform_radiance().is_none() {
            let place = |ray: usize| context.world.environment_position(generation.rays.get(ray).direction());
            self.places.extend(self.missed.iter().map(place));
        }
        for k in 0..self.missed.len() {
            let (ray, place) = (self.missed.get(k), self.places.get(k).copied().unwrap_or_default());
            let path = &self.paths[ray];
            let direction = generation.rays.get(ray).direction();
            let radiance = found_at_infinity(context.world, lights, direction, (path.pdf, place), depth);
            let (radiance, bounces) = (path.throughput * radiance, path.bounces);
            self.add_radiance(generation.camera_rays[ray], radiance, stage, bounces);
        }
    }

    /// Adds radiance to a camera ray, or counts it if it is not finite.
    #[inline]
    pub(super) fn add_radiance(&mut self, camera_ray: u32, radiance: DVec3, stage: &Scatter, bounces: u8) {
        if radiance.is_finite() {
            self.radiance[camera_ray as usize] += stage.clamped(radiance, bounces);
        } else {
            self.discarded += 1;
        }
    }

    /// Adds the radiance that the surfaces of a generation emit towards the origins of their rays.
    pub(super) fn add_emitted(
        &mut self,
        generation: &RayGeneration,
        world: &World,
        lights: &Lights,
        stage: &Scatter,
    ) {
        let surfaces = &generation.surfaces;
        for (material, range) in surfaces.by_material() {
            let material = &world.materials[*material as usize];
            if !material.is_unlit() && *material.emission() == DVec3::ZERO {
                continue;
            }
            for i in range.clone() {
                let ray = surfaces.ray_of()[i] as usize;
                let path = &self.paths[ray];
                let Some((emission, weight)) = emitted((world, lights), material, surfaces, i, path) else {
                    continue;
                };
                let radiance = self.vertices.throughput.get(i) * emission * weight;
                self.add_radiance(generation.camera_rays[ray], radiance, stage, path.bounces);
            }
        }
    }
}

/// The radiance from infinitely far away that a path finds in a direction, weighted against light samples. Camera rays
/// see the background.
#[inline]
pub(super) fn found_at_infinity(
    world: &World,
    lights: &Lights,
    direction: DVec3,
    (pdf, place): (f64, [f64; 2]),
    depth: u32,
) -> DVec3 {
    if depth == 0 {
        world.background_towards(direction, place)
    } else {
        lights.radiance_from_infinity(direction, pdf, place)
    }
}

/// The radiance that a surface emits towards a path, and its weight against light samples; `None` if it emits nothing.
#[inline]
pub(super) fn emitted(
    (world, lights): (&World, &Lights),
    material: &PreparedMaterial,
    surfaces: &InteractionSoa,
    i: usize,
    path: &Path,
) -> Option<(DVec3, f64)> {
    let emission = emission(material, surfaces, i);
    let is_dark_side =
        world.emitters.is_one_sided(surfaces.hit(i).prim) && world.is_seen_from_back(surfaces, i);
    let is_emitted = emission != DVec3::ZERO && !is_dark_side;
    is_emitted.then(|| (emission, lights.weight_of_emitter(&surfaces.get(i), path)))
}

/// The radiance that a surface emits.
fn emission(material: &PreparedMaterial, surfaces: &InteractionSoa, i: usize) -> DVec3 {
    let texel = |slot| surfaces.texels.get(slot, i);
    if material.is_unlit() {
        return material.colour() * surfaces.tint.get(i) * texel(TextureSlot::BaseColour);
    }
    material.emission() * texel(TextureSlot::Emission)
}
