//! Records of path vertices ([`Recorder`]), from the arrays that the stage has filled.

use super::continuations::survival;
use super::emission::{emitted, found_at_infinity};
use super::light_samples::LightSamples;
use super::lights::Lights;
use super::numbers::Sequence;
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, Scatter};
use crate::effects::record::{
    ContinuationRecord, DirectionRecord, EmissionRecord, LightSampleRecord, PathRecord, RouletteRecord,
    ShadowRayRecord,
};
use crate::effects::recorder::Recorder;
use crate::effects::tile::{RayGeneration, RenderContext};
use crate::world::World;
use glam::DVec3;

impl Buffers {
    /// Records the vertices of a generation and what its rays that missed found, before shadow rays are traced and
    /// paths continue.
    #[cold]
    pub(super) fn record_vertices(
        &mut self,
        recorder: &mut Recorder,
        (context, lights, stage): (&RenderContext, &Lights, &Scatter),
        generation: &RayGeneration,
        depth: u32,
    ) {
        let (world, surfaces) = (context.world, &*generation.surfaces);
        let is_last = self.are_last((world, stage), surfaces, depth);
        for record in recorder.rays(depth as usize) {
            let (i, is_hit, samples) = (record.index, record.hit.is_some(), &self.continuations);
            let path = &self.paths[if is_hit { surfaces.ray_of()[i] as usize } else { i }];
            let (throughput, found) = if is_hit {
                let material = &world.materials[surfaces.materials()[i] as usize];
                let found = emitted((world, lights), material, surfaces, i, path);
                (self.vertices.throughput.get(i), found)
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
            let is_ended = is_last || is_hit && samples.pdf[i] == 0.0 && !stage.allows(path, depth, false);
            let bsdf_sample = (is_hit && !is_ended).then(|| {
                let (weight, pdf) = (samples.weight.get(i), samples.pdf[i]);
                let direction = self.vertices.to_world(i, samples.local.get(i));
                let sample = (pdf != 0.0).then_some(DirectionRecord { direction, weight, pdf });
                ContinuationRecord { sample, roulette: None, throughput: None }
            });
            let end = match is_hit {
                false => Some("nothing is hit"),
                true => is_ended.then_some("the limit of bounces"),
            };
            record.path =
                Some(PathRecord { throughput, emission, light_samples: Vec::new(), bsdf_sample, end });
        }
        if !is_last {
            self.record_light_samples(recorder, (world, lights, stage), depth);
        }
    }

    /// Records light samples whose shadow rays are listed.
    fn record_light_samples(
        &mut self,
        recorder: &mut Recorder,
        (world, lights, stage): (&World, &Lights, &Scatter),
        depth: u32,
    ) {
        let Buffers { light_samples, numbers, .. } = self;
        for (index, samples) in (0..).zip(light_samples) {
            numbers.fill_light(Sequence { seed: stage.seed, sampler: stage.sampler, depth }, index);
            for (i, record) in recorder.surfaces(depth as usize) {
                let position = samples.lit.iter().position(|lit| lit == i);
                let (Some(path), Some(k)) = (&mut record.path, position) else { continue };
                let (pdf, bsdf_pdf) = (samples.pdf[i], samples.bsdf_pdf[i]);
                let choice = numbers.light_and_point(i)[0];
                path.light_samples.push(LightSampleRecord {
                    index,
                    light: if lights.is_environment(choice) {
                        "environment".into()
                    } else if lights.is_emitter(choice) {
                        "emissive surfaces".into()
                    } else {
                        world.light_name(lights.index(choice[0]))
                    },
                    direction: samples.direction.get(i),
                    radiance: samples.radiance.get(i),
                    pdf,
                    bsdf: samples.value.get(i),
                    bsdf_pdf,
                    weight: light_weight(stage.technique, pdf, bsdf_pdf),
                    if_visible: samples.light_paths[k].radiance,
                    shadow_ray: ShadowRayRecord::new(LIGHT_RAYS, None, &samples.shadow_rays.get(k)),
                    adds: DVec3::ZERO,
                });
            }
        }
    }

    /// Records how the paths of a generation continue, once that is decided.
    #[cold]
    pub(super) fn record_continuations(&self, recorder: &mut Recorder, has_roulette: bool, depth: u32) {
        let Buffers { continuations, numbers, next, .. } = self;
        for (i, record) in recorder.surfaces(depth as usize) {
            let Some(path) = &mut record.path else { continue };
            let Some(bsdf_sample) = &mut path.bsdf_sample else { continue };
            let position = continuations.continuing.iter().position(|continuing| continuing == i);
            bsdf_sample.throughput = position.map(|k| next[k].throughput);
            if let (true, Some(sample)) = (has_roulette, &bsdf_sample.sample) {
                let [_, number] = numbers.lobe_and_roulette(i);
                let probability = survival(path.throughput * sample.weight);
                bsdf_sample.roulette = Some(RouletteRecord { probability, number });
            }
            path.end = match &*bsdf_sample {
                ContinuationRecord { throughput: Some(_), .. } => None,
                ContinuationRecord { sample: None, .. } => Some("the surface scatters nothing"),
                ContinuationRecord { roulette: Some(RouletteRecord { probability, number }), .. }
                    if number >= probability =>
                {
                    Some("Russian roulette")
                }
                _ => Some("the sampled direction is on the wrong side, or carries nothing"),
            };
        }
    }
}

/// Records which of the light samples of this index are occluded, and what the others add.
#[cold]
pub(super) fn record_visibility(
    recorder: &mut Recorder,
    (world, depth): (&World, usize),
    (index, samples): (u32, &LightSamples),
    occluded: &[bool],
) {
    for (i, record) in recorder.surfaces(depth) {
        let recorded = record.path.iter_mut().flat_map(|path| &mut path.light_samples);
        for sample in recorded.filter(|sample| sample.index == index) {
            let Some(k) = samples.lit.iter().position(|lit| lit == i) else { continue };
            if occluded[k] {
                sample.shadow_ray.set_occluded(world, &samples.shadow_rays.get(k));
            } else {
                sample.adds = samples.light_paths[k].radiance;
            }
        }
    }
}
