//! Adaptive sampling: a pixel whose estimated error is small enough takes no further samples ([`super::convergence`]).
//!
//! The background B of a pixel with alpha is unknown. The displayed error of the composite in linear light, C + (1 -
//! alpha) B, is tested over black (B = 0) and over white, by composites of samples, because colour and alpha are
//! correlated; other greys lie between the two. Browsers composite display values instead: alpha D(C / alpha) + (1 -
//! alpha) D(B). Where the straight colour C / alpha is constant, the error of this is at most that of alpha, so alpha
//! itself is tested as well.

use glam::DVec3;

use super::convergence::{
    Criterion, FirstSamples, Integrand, Neighbourhood, SampleGroups, displayed_error, missed_variance,
    random_variance, unseen_variance,
};
use super::region::SampledRegion;
use super::samples::{PixelSampleSequence, TileSamples};
use super::tile::{RenderContext, Tile, vec_bytes};
use super::variance::SampleVariance;
use super::{Effect, EffectContext, Hook, PlanSpec, Stage, id};
use crate::scene::PixelSampler;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::ADAPTIVE,
    summary: "adaptive sampling: fewer samples for pixels with little noise",
    source: "Dammertz and others, A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination, 2010",
    builds_on: Some(id::ANTIALIASING),
    decides_samples: true,
    called_for: |_, plan_settings| {
        let sampling = &plan_settings.sampling;
        let Some(level) = sampling.noise else {
            return Err("no noise threshold; --noise sets one".into());
        };
        let (floor, most) = (Criterion::new(sampling).min_samples, sampling.max_samples());
        if floor == most {
            return Err(format!("every pixel takes {most} sample(s) anyway"));
        }
        Ok(format!("`noise` {level}, {floor} to {most} samples per pixel"))
    },
    specify: |_, spec: &mut PlanSpec| spec.adaptive = true,
    stages: |context: &EffectContext, hook| match hook {
        Hook::Film => {
            let test = TestConvergence::new(context);
            vec![Stage::new("adaptive", move |tile, context| test.run(tile, context))]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<Buffers>().map_or(0, Buffers::bytes),
    ..Effect::NONE
};

/// The statistics of each pixel of the sampled region.
#[derive(Default)]
struct Buffers {
    colour: Estimates,
    /// Of the alpha channel; empty without one.
    alpha: Estimates,
    /// Of the composite over white; empty without an alpha channel.
    over_white: Estimates,
    /// For each pixel, whether a sample of it has hit a surface.
    has_surface: Vec<bool>,
}

impl Buffers {
    fn bytes(&self) -> usize {
        let Buffers { colour, alpha, over_white, has_surface } = self;
        let estimates = colour.bytes() + alpha.bytes() + over_white.bytes();
        size_of::<Buffers>() + estimates + vec_bytes(has_surface)
    }
}

/// The samples of a pixel.
#[derive(Clone, Copy, Default)]
struct PixelSamples {
    groups: SampleGroups,
    variance: SampleVariance,
}

/// What the samples of each pixel of the sampled region say of its error.
#[derive(Default)]
struct Estimates {
    pixels: Vec<PixelSamples>,
    first: Vec<FirstSamples>,
    /// For each pixel, what the first samples around it say; unused for those of the apron.
    around: Vec<Neighbourhood>,
}

impl Estimates {
    fn bytes(&self) -> usize {
        let Estimates { pixels, first, around } = self;
        vec_bytes(pixels) + vec_bytes(first) + vec_bytes(around)
    }

    fn start(&mut self, pixels: usize) {
        self.pixels.clear();
        self.pixels.resize(pixels, PixelSamples::default());
    }

    fn add(&mut self, pixel: usize, value: [f32; 3], sign: f32) {
        let PixelSamples { groups, variance } = &mut self.pixels[pixel];
        groups.add(value, sign);
        variance.add(value);
    }

    /// Keeps what the first samples say.
    fn end_first_round(&mut self, region: SampledRegion) {
        let Estimates { pixels, first, around } = self;
        first.clear();
        first.extend(pixels.iter().map(|pixel| FirstSamples::from(&pixel.variance)));
        around.clear();
        around.resize(first.len(), Neighbourhood::default());
        for pixel in region.tile_pixels().filter(|_| !first.is_empty()) {
            around[pixel] = first[pixel].neighbourhood(region.neighbourhood(pixel).map(|near| &first[near]));
        }
    }

    /// The variance of a pixel's value. `unseen` is the light of events that no sample may have shown.
    fn variance(
        &self,
        pixel: usize,
        integrand: Integrand,
        (first, unseen): (u32, f64),
        mean_sign: f64,
    ) -> DVec3 {
        let PixelSamples { groups, variance } = &self.pixels[pixel];
        let (around, taken) = (&self.around[pixel], variance.count());
        let missed = missed_variance(around.deviation, taken);
        match integrand {
            Integrand::Stratified => missed + groups.variance(variance.mean(), mean_sign),
            Integrand::Random => {
                let observed = taken.saturating_add(around.others.saturating_mul(first));
                missed
                    + random_variance((variance, groups), around.variance, mean_sign)
                    + unseen_variance(unseen, observed)
            }
        }
    }
}

/// After each pass, adds its samples to the statistics; after each round, ends the pixels that have converged.
struct TestConvergence {
    sampler: PixelSampleSequence,
    criterion: Criterion,
    colour: Integrand,
    alpha: Integrand,
    over_white: Integrand,
}

impl TestConvergence {
    fn new(context: &EffectContext) -> Self {
        let sampler = PixelSampleSequence::new(context);
        let is_independent = sampler.kind == PixelSampler::Independent;
        let integrand = |is_random: bool| match is_random || is_independent {
            true => Integrand::Random,
            false => Integrand::Stratified,
        };
        let catches = context.world.shadow_catcher().is_some();
        let is_alpha_random = context.spec.continued.is_some() || catches && context.spec.is_random;
        TestConvergence {
            sampler,
            criterion: Criterion::new(context.sampling),
            colour: integrand(context.spec.is_random),
            alpha: integrand(is_alpha_random),
            over_white: integrand(context.spec.is_random || is_alpha_random),
        }
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        if !tile.needs_more_samples {
            return;
        }
        tile.with_buffers(|buffers: &mut Buffers, tile| {
            tile.with_buffers(|samples: &mut TileSamples, tile| {
                let Buffers { colour, alpha, over_white, has_surface } = buffers;
                if samples.is_first_pass() {
                    let pixels = samples.sums().len();
                    let with_alpha = if tile.coverage.is_some() { pixels } else { 0 };
                    colour.start(pixels);
                    alpha.start(with_alpha);
                    over_white.start(with_alpha);
                    has_surface.clear();
                    has_surface.resize(pixels, false);
                }
                for (pixel, sign, &value) in samples.of_pass(&tile.pixels) {
                    colour.add(pixel, value, sign as f32);
                }
                let (coverage, white) =
                    (tile.coverage.as_deref().unwrap_or_default(), context.display.white());
                for ((pixel, sign, &value), colour) in samples.of_pass(coverage).zip(&tile.pixels) {
                    alpha.add(pixel, [value; 3], sign as f32);
                    let behind = white as f32 * (1.0 - value);
                    over_white.add(pixel, colour.map(|channel| channel + behind), sign as f32);
                }
                for &ray in &tile.camera_hits {
                    has_surface[samples.pixel_of(ray)] = true;
                }
                if samples.is_round_done() {
                    self.end_round(buffers, samples, context);
                    if samples.is_finished() {
                        samples.finish(tile, &self.sampler, context.world.pipeline);
                    }
                }
            });
        });
    }

    fn end_round(&self, buffers: &mut Buffers, samples: &mut TileSamples, context: &RenderContext) {
        let TestConvergence { sampler, criterion, .. } = self;
        let taken = samples.round_end();
        if taken == criterion.min_samples {
            buffers.colour.end_first_round(samples.region());
            buffers.alpha.end_first_round(samples.region());
            buffers.over_white.end_first_round(samples.region());
        }
        let (display, pipeline) = (context.display, context.world.pipeline);
        let displayed = |colour: DVec3| display.displayed(pipeline, colour);
        let covered = |alpha: DVec3| alpha.clamp(DVec3::ZERO, DVec3::ONE);
        let Buffers { colour, alpha, over_white, has_surface } = &*buffers;
        let first = criterion.min_samples;
        let is_noisy = |estimates: &Estimates,
                        integrand,
                        (pixel, value, unseen): (usize, DVec3, f64),
                        shown: &dyn Fn(DVec3) -> DVec3| {
            let variance = estimates.variance(pixel, integrand, (first, unseen), sampler.filter.mean_sign());
            // Without variance, as on a background, the error is 0; this saves the conversion to display values.
            variance != DVec3::ZERO && {
                let error = DVec3::from(variance.to_array().map(f64::sqrt));
                displayed_error(value, error, shown) > criterion.max_error
            }
        };
        samples.start_round(criterion.next_test(taken, sampler.samples), |pixel, sum, coverage| {
            let of_surface = f64::from(u8::from(has_surface[pixel]));
            let (white, value) = (display.white(), sum.value(&sampler.filter));
            let unseen = of_surface * white;
            is_noisy(colour, self.colour, (pixel, value, unseen), &displayed)
                || coverage.is_some_and(|sum| {
                    let covering = sum.value(&sampler.filter);
                    let composite = value + white * (DVec3::ONE - covering);
                    is_noisy(alpha, self.alpha, (pixel, covering, of_surface), &covered)
                        || is_noisy(over_white, self.over_white, (pixel, composite, unseen), &displayed)
                })
        });
    }
}
