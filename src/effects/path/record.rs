//! Records of path vertices ([`Recorder`]), from the arrays that the stage has filled.

use super::continuations::survival;
use super::emission::{emitted, found_at_infinity};
use super::lights::Lights;
use super::numbers::Sequence;
use super::vertices::IndexList;
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, LightPath, Scatter};
use crate::effects::record::{
    ContinuationRecord, Emission, LightSampleRecord, LightSource, PathVertex, Recorder, Roulette,
    SampledDirection,
};
use crate::effects::tile::{RayGeneration, RenderContext};
use crate::geometry::Rays;
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
        let emission = |throughput: DVec3, (radiance, weight): (DVec3, f64), bounces: u8| {
            let product = throughput * radiance * weight;
            let adds = if product.is_finite() { stage.clamped(product, bounces) } else { DVec3::ZERO };
            Emission { radiance, weight, adds }
        };
        for (ray, record) in recorder.of_rays(depth as usize).filter(|(_, record)| record.surface.is_none()) {
            let (path, direction) = (&self.paths[ray], generation.rays.get(ray).direction());
            let place = world.environment_position(direction);
            let found = found_at_infinity(world, lights, direction, (path.pdf, place), depth);
            let emission = Some(emission(path.throughput, (found, 1.0), path.bounces));
            let throughput = path.throughput;
            record.vertex = Some(PathVertex { throughput, emission, lights: Vec::new(), continuation: None });
        }
        let is_last = self.are_last((world, stage), surfaces, depth);
        for (i, record) in recorder.of_surfaces(depth as usize) {
            let path = &self.paths[surfaces.ray_of()[i] as usize];
            let material = &world.materials[surfaces.materials()[i] as usize];
            let throughput = self.vertices.throughput.get(i);
            let found = emitted((world, lights), material, surfaces, i, path);
            let emission = found.map(|found| emission(throughput, found, path.bounces));
            let samples = &self.continuations;
            let pdf = samples.pdf[i];
            let is_ended = is_last || pdf == 0.0 && !stage.allows(path, depth, false);
            let continuation = (!is_ended).then(|| {
                let sample = (pdf != 0.0).then(|| {
                    let direction = self.vertices.to_world(i, samples.local.get(i));
                    SampledDirection { direction, weight: samples.weight.get(i), pdf }
                });
                ContinuationRecord { sample, roulette: None, throughput: None }
            });
            record.vertex = Some(PathVertex { throughput, emission, lights: Vec::new(), continuation });
        }
        let Buffers { light_samples, numbers, .. } = self;
        let light_samples = light_samples.iter().filter(|_| !is_last);
        for (index, samples) in (0..).zip(light_samples) {
            numbers.fill_light(Sequence { seed: stage.seed, sampler: stage.sampler, depth }, index);
            for (i, record) in recorder.of_surfaces(depth as usize) {
                let place = samples.lit.iter().position(|lit| lit == i);
                let (Some(vertex), Some(place)) = (&mut record.vertex, place) else { continue };
                let (pdf, bsdf_pdf) = (samples.pdf[i], samples.bsdf_pdf[i]);
                let choice = numbers.light_and_point(i)[0];
                vertex.lights.push(LightSampleRecord {
                    source: if lights.is_environment(choice) {
                        LightSource::Environment
                    } else if lights.is_emitter(choice) {
                        LightSource::Emitters
                    } else {
                        LightSource::Light(lights.index(choice[0]))
                    },
                    direction: samples.direction.get(i),
                    radiance: samples.radiance.get(i),
                    pdf,
                    bsdf: samples.value.get(i),
                    bsdf_pdf,
                    weight: light_weight(stage.technique, pdf, bsdf_pdf),
                    if_visible: samples.light_paths[place].radiance,
                    adds: DVec3::ZERO,
                });
            }
        }
    }

    /// Records how the paths of a generation continue, once that is decided.
    #[cold]
    pub(super) fn record_continuations(&self, recorder: &mut Recorder, has_roulette: bool, depth: u32) {
        let Buffers { continuations, numbers, next, .. } = self;
        for (i, record) in recorder.of_surfaces(depth as usize) {
            let Some(vertex) = &mut record.vertex else { continue };
            let Some(continuation) = &mut vertex.continuation else { continue };
            let place = continuations.continuing.iter().position(|continuing| continuing == i);
            continuation.throughput = place.map(|place| next[place].throughput);
            if let (true, Some(sample)) = (has_roulette, continuation.sample) {
                let [_, number] = numbers.lobe_and_roulette(i);
                let probability = survival(vertex.throughput * sample.weight);
                continuation.roulette = Some(Roulette { probability, number });
            }
        }
    }
}

/// Records the shadow rays of a light sample of each vertex, and what they add.
#[cold]
pub(super) fn record_light_samples(
    recorder: &mut Recorder,
    depth: usize,
    (lit, rays, occluded): (&IndexList, Rays, &[bool]),
    light_paths: &[LightPath],
) {
    recorder.add_tests((LIGHT_RAYS, None), depth, lit.iter(), rays, occluded);
    for (i, record) in recorder.of_surfaces(depth) {
        let (Some(vertex), Some(place)) = (&mut record.vertex, lit.iter().position(|lit| lit == i)) else {
            continue;
        };
        // The test that was added is that of the sample with the same place.
        let count = record.tests.iter().filter(|test| test.kind == LIGHT_RAYS).count();
        if let Some(sample) = vertex.lights.get_mut(count.wrapping_sub(1)).filter(|_| !occluded[place]) {
            sample.adds = light_paths[place].radiance;
        }
    }
}
