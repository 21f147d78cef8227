//! Light samples at path vertices: listed as shadow rays with what they add, and traced for a generation.

use glam::DVec3;

use super::lights::{LightConnection, Lights};
use super::vertex::Vertex;
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, LightPath, Scatter};
use crate::effects::tile::Tile;
use crate::effects::{RayKind, transparency};
use crate::geometry::Ray;
use crate::shading::bsdf::Bsdf;
use crate::world::World;

impl Buffers {
    /// Lists the shadow rays to the lights that are sampled at a vertex.
    pub(super) fn list_light_samples(
        &mut self,
        vertex: &Vertex,
        bsdf: &Bsdf,
        lights: &Lights,
        stage: &Scatter,
    ) {
        // Each sample is limited to its share of the clamp.
        let samples = f64::from(stage.settings.light_samples);
        for index in 0..stage.settings.light_samples {
            let Some((shadow_ray, radiance)) = vertex.sample_light(bsdf, lights, index) else {
                continue;
            };
            if !radiance.is_finite() {
                self.discarded += 1;
                continue;
            }
            let radiance = stage.clamped(radiance * samples, vertex.numbers.sequence.depth + 1) / samples;
            self.shadow_rays.push(&shadow_ray);
            self.light_paths.push(LightPath { camera_ray: vertex.camera_ray, radiance });
        }
    }

    /// Traces the shadow rays of a generation and adds the radiance of those that are not occluded.
    pub(super) fn trace_shadow_rays(&mut self, tile: &mut Tile, world: &World, continued: Option<RayKind>) {
        let Buffers { shadow_rays, light_paths, occluded, radiance, .. } = self;
        occluded.clear();
        world.accelerator.are_occluded(shadow_rays.rays(), occluded, &mut tile.traversal);
        let mut count = 0;
        for ((path, ray), occluded) in light_paths.iter().zip(shadow_rays.rays().iter()).zip(&mut *occluded) {
            let mut transmittance = f64::from(u8::from(!*occluded));
            if *occluded && continued.is_some() {
                transmittance = transparency::transmittance(world, &ray, &mut tile.traversal, &mut count);
                *occluded = transmittance == 0.0;
            }
            if !*occluded {
                radiance[path.camera_ray as usize] += path.radiance * transmittance;
            }
        }
        if let Some(kind) = continued.filter(|_| count > 0) {
            tile.count(kind, count, 0);
        }
        if let Some(recorder) = &mut tile.recorder {
            let sources: Vec<u32> = light_paths.iter().map(|path| path.camera_ray).collect();
            recorder.record_occlusion(LIGHT_RAYS, tile.depth, None, &sources, shadow_rays.rays(), occluded);
        }
        tile.count(LIGHT_RAYS, occluded.len(), occluded.iter().filter(|&&occluded| occluded).count());
    }
}

impl Vertex<'_> {
    /// The shadow ray to a sampled light, and the radiance that the path gains if it is not occluded.
    fn sample_light(&self, bsdf: &Bsdf, lights: &Lights, sample: u32) -> Option<(Ray, DVec3)> {
        if bsdf.is_delta() {
            return None;
        }
        let position = self.surface.point.position;
        let [choice, point] = self.numbers.light(sample);
        let LightConnection { direction, radiance, pdf, target } = lights.sample(position, choice, point)?;
        let (value, bsdf_pdf) = self.eval(bsdf, direction);
        let weight = pdf.map_or(1.0, |pdf| light_weight(lights.technique, pdf, bsdf_pdf) / pdf);
        let radiance = self.path.throughput * value * radiance * weight;
        if radiance == DVec3::ZERO {
            return None;
        }
        let ray = target.ray(self.origin(direction), position, self.world.numerics())?;
        // What is infinitely far away is in no volume.
        let end = if ray.t_max.is_finite() { ray.at(ray.t_max) } else { DVec3::INFINITY };
        let media = self.media_towards(direction).around(self.world, end);
        Some((ray, radiance * media.transmittance(self.world, ray.t_max)))
    }
}
