//! Adaptive sampling: a pixel whose estimated error is small enough takes no further samples ([`super::convergence`]).

use glam::{DVec3, Vec4};

use super::convergence::{Criterion, FirstSamples, SampleGroups, displayed_error, missed_variance};
use super::region::SampledRegion;
use super::samples::{Sampler, TileSamples};
use super::tile::{RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, Hook, PlanSpec, Stage, id};
use crate::film::{ColourPipeline, DisplayTransform};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::ADAPTIVE,
    summary: "pixels with little noise take fewer samples than others",
    source: "Dammertz and others, A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination, 2010",
    builds_on: Some(id::ANTIALIASING),
    needs_lights: false,
    is_shading: false,
    decides_samples: true,
    is_study_switch: false,
    whitted_only: false,
    rays: &[],
    value: None,
    called_for: |_, choices| {
        let sampling = &choices.sampling;
        let Some(level) = sampling.noise else {
            return Err("no level of noise is given; --noise does".into());
        };
        let (floor, most) = (Criterion::new(sampling).min_samples, sampling.max_samples());
        if floor == most {
            return Err(format!("every pixel takes {most} sample(s) anyway"));
        }
        Ok(format!("`noise` {level}, {floor} to {most} samples a pixel"))
    },
    specify: |_, spec: &mut PlanSpec| spec.adaptive = true,
    stages: |context: &EffectContext, hook| match hook {
        Hook::Film => {
            let criterion = Criterion::new(context.sampling);
            vec![Box::new(TestConvergence { sampler: Sampler::new(context), criterion })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<Buffers>().map_or(0, Buffers::bytes),
};

/// The statistics of each pixel of the sampled region.
#[derive(Default)]
struct Buffers {
    /// The samples of each pixel in groups.
    groups: Vec<SampleGroups>,
    /// Mean and variance of each pixel's first samples.
    first: Vec<FirstSamples>,
    /// For each pixel, the mean square deviation of the first samples around it.
    around: Vec<Vec4>,
}

impl Buffers {
    fn bytes(&self) -> usize {
        let Buffers { groups, first, around } = self;
        vec_bytes(groups) + vec_bytes(first) + vec_bytes(around)
    }

    /// Computes the deviations around each of the tile's own pixels from the first samples; zero for the others.
    fn find_deviations(&mut self, samples: &TileSamples, mean_sign: f64) {
        let Buffers { groups, first, around } = self;
        let region: SampledRegion = samples.region();
        let pixels = samples.sums().iter().zip(&*groups);
        first.clear();
        first.extend(pixels.map(|(sum, groups)| FirstSamples::new(groups, sum.mean(), mean_sign)));
        around.clear();
        around.resize(first.len(), Vec4::ZERO);
        for pixel in region.own() {
            around[pixel] = first[pixel].deviation(region.neighbourhood(pixel).map(|near| &first[near]));
        }
    }
}

/// After each pass, adds its samples to the groups; after each round, ends the pixels that have converged.
struct TestConvergence {
    sampler: Sampler,
    criterion: Criterion,
}

impl Stage for TestConvergence {
    fn name(&self) -> &'static str {
        "adaptive"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        if !tile.needs_more_samples {
            return;
        }
        tile.with_buffers(|buffers: &mut Buffers, tile| {
            tile.with_buffers(|samples: &mut TileSamples, tile| {
                if samples.is_first_pass() {
                    buffers.groups.clear();
                    buffers.groups.resize(samples.sums().len(), SampleGroups::default());
                }
                for (pixel, sign, &colour) in samples.of_pass(&tile.pixels) {
                    buffers.groups[pixel].add(colour, sign as f32);
                }
                if samples.is_round_done() {
                    self.end_round(buffers, samples, tile, (context.world.pipeline, context.display));
                }
            });
        });
    }
}

impl TestConvergence {
    fn end_round(
        &self,
        buffers: &mut Buffers,
        samples: &mut TileSamples,
        tile: &mut Tile,
        (pipeline, display): (ColourPipeline, DisplayTransform),
    ) {
        let (sampler, criterion) = (&self.sampler, &self.criterion);
        let mean_sign = sampler.filter.mean_sign();
        let taken = samples.round_end();
        if taken == criterion.min_samples {
            buffers.find_deviations(samples, mean_sign);
        }
        let Buffers { groups, around, .. } = &*buffers;
        samples.start_round(criterion.next_test(taken, sampler.samples), |pixel, sum| {
            let estimated = groups[pixel].variance(sum.mean(), mean_sign);
            let variance = estimated + missed_variance(around[pixel], taken);
            // Without variance, as on a background, the error is 0; this saves the conversion to display values.
            let error = if variance == DVec3::ZERO {
                0.0
            } else {
                let error = DVec3::from(variance.to_array().map(f64::sqrt));
                displayed_error(sum.value(&sampler.filter), error, |colour| {
                    display.displayed(pipeline, colour)
                })
            };
            error > criterion.max_error
        });
        if samples.is_finished() {
            samples.finish(tile, sampler, pipeline);
        }
    }
}
