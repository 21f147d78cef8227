//! Shadow rays of light samples: listed with what each adds if the light is not occluded, and traced for a generation.

use glam::DVec3;

use super::light_samples::LightSamples;
use super::record::record_light_samples;
use super::vertices::Vertices;
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, LightPath, Scatter};
use crate::bvh::detail::Precision;
use crate::bvh::{Numerics, Ray};
use crate::effects::tile::{RayGeneration, Tile};
use crate::effects::{LightTechnique, shadow_ray, transparency};
use crate::shading::LightSample;
use crate::world::{InteractionSoa, World, select, simd};

impl LightSamples {
    /// Computes contributions and shadow rays.
    #[inline(always)]
    pub(super) fn find_contributions(
        &mut self,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        technique: LightTechnique,
    ) {
        for i in 0..vertices.len() {
            let (pdf, value) = (self.pdf[i], self.value.get(i));
            let weight = light_weight(technique, pdf, self.bsdf_pdf[i]) / pdf;
            let weight = if pdf == f64::INFINITY { 1.0 } else { weight };
            let radiance = vertices.throughput.get(i) * value * self.radiance.get(i) * weight;
            let is_zero = (radiance.x == 0.0) & (radiance.y == 0.0) & (radiance.z == 0.0);
            self.contribution.set(i, radiance);
            self.pdf[i] = if is_zero { 0.0 } else { pdf };
            let (direction, distance) = (self.direction.get(i), self.distance[i]);
            let to_end = self.end.get(i) - vertices.origin_above(i);
            let length = to_end.length();
            let scale = 1.0 / length;
            let is_far = distance == f64::INFINITY;
            let is_above = vertices.leaves_above(i, surfaces, direction);
            let is_common =
                is_above & (is_far | ((distance == 0.0) & (scale > 0.0) & (scale < f64::INFINITY)));
            self.ray_origin.set(i, vertices.origin_above(i));
            self.ray_direction.set(i, select(is_far, direction, to_end * scale));
            self.t_max[i] = if is_far { f64::INFINITY } else { length };
            self.is_special.set(i, !is_common);
        }
    }

    /// Lists the vertices with a shadow ray, and completes the special ones. Returns the number of samples with a
    /// contribution that is not finite.
    pub(super) fn list_rays(&mut self, world: &World, surfaces: &InteractionSoa, vertices: &Vertices) -> u64 {
        let mut lit = std::mem::take(&mut self.lit);
        lit.fill(vertices.len(), |i| self.pdf[i] != 0.0);
        let discarded = lit.retain(|i| self.contribution.get(i).is_finite());
        lit.retain(|i| !self.is_special.get(i) || self.set_special_ray(world, surfaces, vertices, i));
        self.lit = lit;
        discarded
    }

    /// Sets the special shadow ray of a vertex; `false` where both ends coincide.
    #[inline]
    fn set_special_ray(
        &mut self,
        world: &World,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        i: usize,
    ) -> bool {
        let origin = vertices.origin(i, world, surfaces, self.direction.get(i));
        let ray = self.special_ray(i, origin, vertices.position(i), world.numerics());
        if let Some(ray) = ray {
            self.ray_origin.set(i, ray.origin());
            self.ray_direction.set(i, ray.direction());
            self.t_max[i] = ray.t_max();
        }
        ray.is_some()
    }

    /// Writes the listed shadow rays.
    #[inline(always)]
    pub(super) fn write_rays(&mut self, precision: Precision) {
        let LightSamples { lit, shadow_rays, ray_origin, ray_direction, t_max, .. } = self;
        shadow_rays.write(
            0..lit.len(),
            #[inline(always)]
            |k| {
                let i = lit.get(k);
                precision.ray(ray_origin.get(i), ray_direction.get(i), 0.0, t_max[i])
            },
        );
    }

    /// The shadow ray from `origin`, of a vertex at `position`, to any light.
    pub(super) fn special_ray(
        &self,
        i: usize,
        origin: DVec3,
        position: DVec3,
        numerics: Numerics,
    ) -> Option<Ray> {
        let (direction, distance) = (self.direction.get(i), self.distance[i]);
        if distance > 0.0 {
            let light = LightSample { direction, distance, radiance: DVec3::ZERO, cosine: 0.0 };
            let light = light.seen_from(origin - position);
            // Lights at infinity have no stored end.
            let share = if distance.is_finite() { self.end.get(i).x } else { 1.0 };
            let distance = light.distance * share;
            return Some(shadow_ray(origin, &LightSample { distance, ..light }, numerics));
        }
        let end = self.end.get(i);
        let direction = (end - origin).try_normalize()?;
        Some(numerics.ray_precision().ray(origin, direction, 0.0, end.distance(origin)))
    }
}

impl Buffers {
    /// Lists the shadow rays of light samples with a contribution.
    pub(super) fn list_shadow_rays(
        &mut self,
        (world, stage): (&World, &Scatter),
        generation: &RayGeneration,
    ) {
        let Buffers { vertices, light_samples, .. } = self;
        let surfaces = &*generation.surfaces;
        // Each sample is limited to its share of the clamp.
        let count = f64::from(stage.settings.light_samples);
        for samples in light_samples {
            // The usual technique is passed as a constant, so that the loop has no branch on it.
            match stage.technique {
                LightTechnique::Both => {
                    simd!(samples.find_contributions(surfaces, vertices, LightTechnique::Both));
                }
                technique => samples.find_contributions(surfaces, vertices, technique),
            }
            self.discarded += samples.list_rays(world, surfaces, vertices);
            simd!(samples.write_rays(world.numerics().ray_precision()));
            let LightSamples { lit, shadow_rays, light_paths, contribution, direction, .. } = &mut **samples;
            light_paths.extend((0..lit.len()).map(|k| {
                let i = lit.get(k);
                let ray = surfaces.ray_of()[i] as usize;
                let mut radiance = contribution.get(i);
                if world.volumes.is_some() {
                    // What is infinitely far away is in no volume.
                    let shadow_ray = shadow_rays.get(k);
                    let t_max = shadow_ray.t_max();
                    let end = if t_max.is_finite() { shadow_ray.at(t_max) } else { DVec3::INFINITY };
                    let media = vertices.media_towards(i, surfaces, direction.get(i));
                    radiance *= vertices.media.transmittance(world, media, end, t_max);
                }
                if stage.clamp < f64::INFINITY {
                    radiance = stage.clamped(radiance * count, self.paths[ray].bounces + 1) / count;
                }
                LightPath { camera_ray: generation.camera_rays[ray], radiance }
            }));
        }
    }

    /// Traces the shadow rays of a generation and adds the radiance of those that are not occluded.
    pub(super) fn trace_shadow_rays(&mut self, tile: &mut Tile, world: &World, stage: &Scatter) {
        let Buffers { light_samples, numbers, occluded, radiance, .. } = self;
        for (index, samples) in (0..).zip(&mut *light_samples) {
            let LightSamples { shadow_rays, light_paths, .. } = &mut **samples;
            let recorded = tile.recorder.as_ref().map(|_| light_paths.clone());
            occluded.clear();
            world.accelerator.are_occluded(shadow_rays.rays(), occluded, &mut tile.traversal);
            match stage.continued {
                None => {
                    for (path, &occluded) in light_paths.iter().zip(&*occluded) {
                        // Without a branch, which would be mispredicted.
                        let gained = if occluded { DVec3::ZERO } else { path.radiance };
                        radiance[path.camera_ray as usize] += gained;
                    }
                }
                Some(kind) => {
                    let (filter, mut count) = (stage.texture_use.filter, 0);
                    let rays = shadow_rays.rays().iter();
                    for ((path, ray), occluded) in light_paths.iter_mut().zip(rays).zip(&mut *occluded) {
                        let mut transmittance = 1.0;
                        if *occluded {
                            transmittance = transparency::transmittance(
                                world,
                                &ray,
                                &mut tile.traversal,
                                filter,
                                &mut count,
                            );
                            *occluded = transmittance == 0.0;
                        }
                        if !*occluded {
                            path.radiance *= transmittance;
                            radiance[path.camera_ray as usize] += path.radiance;
                        }
                    }
                    if count > 0 {
                        tile.count(kind, count, 0);
                    }
                }
            }
            if let (Some(recorder), Some(light_paths)) = (&mut tile.recorder, recorded) {
                let depth = tile.depth as u32;
                let taken = (index, &**samples, &mut **numbers);
                record_light_samples(recorder, (world, stage, depth), taken, &light_paths, occluded);
            }
            tile.count(LIGHT_RAYS, occluded.len(), occluded.iter().filter(|&&occluded| occluded).count());
        }
    }
}
