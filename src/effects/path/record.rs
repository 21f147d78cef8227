//! Records of path vertices ([`Recorder`]), from the arrays that the stage has filled.

#[cfg(doc)]
use super::continuations::Continuations;
use super::continuations::survival;
use super::emission::{emitted, found_at_infinity};
use super::light_samples::LightSamples;
use super::lights::Lights;
use super::numbers::{GenerationNumbers, Sequence};
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, LightPath, Scatter};
use crate::effects::record::{
    ContinuationRecord, DirectionRecord, EmissionRecord, LightSampleRecord, PathRecord, RouletteRecord,
    ShadowRayRecord,
};
use crate::effects::recorder::Recorder;
use crate::effects::tile::{RayGeneration, RenderContext};
use crate::world::World;
use glam::DVec3;

impl Buffers {
    /// Records the vertices of a generation and what its rays that missed found, once it is decided which paths
    /// continue. `pdfs` are those of [`Continuations`] before.
    #[cold]
    pub(super) fn record_vertices(
        &self,
        recorder: &mut Recorder,
        (context, lights, stage): (&RenderContext, &Lights, &Scatter),
        generation: &RayGeneration,
        (pdfs, has_roulette): (&[f64], bool),
        depth: u32,
    ) {
        let (world, surfaces) = (context.world, &*generation.surfaces);
        let Buffers { vertices, continuations, numbers, next, .. } = self;
        let is_last = self.are_last((world, stage), surfaces, depth);
        for record in recorder.rays(depth as usize) {
            let (i, is_hit) = (record.index, record.hit.is_some());
            let path = &self.paths[if is_hit { surfaces.ray_of()[i] as usize } else { i }];
            let (throughput, found) = if is_hit {
                let material = &world.materials[surfaces.materials()[i] as usize];
                (vertices.throughput.get(i), emitted((world, lights), material, surfaces, i, path))
            } else {
                let direction = generation.rays.get(i).direction();
                let position = world.environment_position(direction);
                let found = found_at_infinity(world, lights, direction, (path.pdf, position), depth);
                (path.throughput, Some((found, 1.0)))
            };
            let emission = found.map(|(radiance, weight)| {
                let product = throughput * radiance * weight;
                let adds =
                    if product.is_finite() { stage.clamped(product, path.bounces) } else { DVec3::ZERO };
                EmissionRecord { radiance, weight, adds }
            });
            let scatters = is_hit && !is_last && (pdfs[i] != 0.0 || stage.allows(path, depth, false));
            let bsdf_sample = scatters.then(|| {
                let (weight, pdf) = (continuations.weight.get(i), pdfs[i]);
                let direction = vertices.to_world(i, continuations.local.get(i));
                let (probability, [_, number]) =
                    (survival(throughput * weight), numbers.lobe_and_roulette(i));
                let position = continuations.continuing.iter().position(|continuing| continuing == i);
                ContinuationRecord {
                    sample: (pdf != 0.0).then_some(DirectionRecord { direction, weight, pdf }),
                    roulette: (pdf != 0.0 && has_roulette).then_some(RouletteRecord { probability, number }),
                    throughput: position.map(|k| next[k].throughput),
                }
            });
            let end = match &bsdf_sample {
                _ if !is_hit => Some("nothing is hit"),
                None => Some("the limit of bounces"),
                Some(ContinuationRecord { throughput: Some(_), .. }) => None,
                Some(ContinuationRecord { sample: None, .. }) => Some("the surface scatters nothing"),
                Some(ContinuationRecord {
                    roulette: Some(RouletteRecord { probability, number }), ..
                }) if number >= probability => Some("Russian roulette"),
                Some(_) => Some("the sampled direction is on the wrong side, or carries nothing"),
            };
            let light_samples = Vec::new();
            record.path = Some(PathRecord { throughput, emission, light_samples, bsdf_sample, end });
        }
    }
}

/// Records a light sample of each vertex of a generation, the one of this index. `light_paths` are those before shadow
/// rays were traced.
#[cold]
pub(super) fn record_light_samples(
    recorder: &mut Recorder,
    (world, stage, depth): (&World, &Scatter, u32),
    (index, samples, numbers): (u32, &LightSamples, &mut GenerationNumbers),
    light_paths: &[LightPath],
    occluded: &[bool],
) {
    if light_paths.is_empty() {
        return;
    }
    let lights = Lights::new(world, stage);
    numbers.fill_light(Sequence { seed: stage.seed, sampler: stage.sampler, depth }, index);
    for (i, record) in recorder.surfaces(depth as usize) {
        let position = samples.lit.iter().position(|lit| lit == i);
        let (Some(path), Some(hit), Some(k)) = (&mut record.path, &record.hit, position) else { continue };
        let (pdf, bsdf_pdf, choice) = (samples.pdf[i], samples.bsdf_pdf[i], numbers.light_and_point(i)[0]);
        let (ray, is_occluded) = (samples.shadow_rays.get(k), occluded[k]);
        path.light_samples.push(LightSampleRecord {
            light: match lights.light(hit.position, choice) {
                Some((light, _)) => world.light_name(light),
                None if lights.is_emitter(choice) => "emissive surfaces".into(),
                None => "environment".into(),
            },
            direction: samples.direction.get(i),
            radiance: samples.radiance.get(i),
            pdf,
            bsdf: samples.value.get(i),
            bsdf_pdf,
            weight: light_weight(stage.technique, pdf, bsdf_pdf),
            if_visible: light_paths[k].radiance,
            adds: if is_occluded { DVec3::ZERO } else { samples.light_paths[k].radiance },
            shadow_ray: ShadowRayRecord::new(world, (LIGHT_RAYS, None), &ray, is_occluded),
        });
    }
}
