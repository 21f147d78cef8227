//! Adaptive sampling: a pixel whose estimated error is small enough takes no further samples ([`super::convergence`]).
//!
//! The background B of a pixel with alpha is unknown. The displayed error of the composite in linear light, C + (1 -
//! alpha) B, is tested over black (B = 0) and over white, by composites of samples, because colour and alpha are
//! correlated; other greys lie between the two. Browsers composite display values instead: alpha D(C / alpha) + (1 -
//! alpha) D(B). Where the straight colour C / alpha is constant, the error of this is at most that of alpha, so alpha
//! itself is tested as well.

use glam::{DVec3, Vec4};

use super::convergence::{
    Criterion, FirstSamples, Integrand, Neighbourhood, RARE_LIGHT_RADIUS, SampleEstimate, SampleGroups,
    displayed_error, is_displayed_within, missed_variance, unseen_variance, value_and_variance,
};
use super::region::SampledRegion;
use super::samples::{PixelSampleSequence, TileSamples};
use super::tile::{NOISY_LEVELS, RenderContext, Tile, vec_bytes};
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

/// Sample statistics of the pixels of the sampled region.
#[derive(Default)]
struct Estimates {
    samples: Vec<(SampleGroups, SampleVariance)>,
    first: Vec<FirstSamples>,
    /// For each pixel, statistics of the first samples around it; unused for those of the apron.
    around: Vec<Neighbourhood>,
    /// At the end of a round, for each pixel that is sampled.
    current: Vec<SampleEstimate>,
}

impl Estimates {
    fn bytes(&self) -> usize {
        let Estimates { samples, first, around, current } = self;
        vec_bytes(samples) + vec_bytes(first) + vec_bytes(around) + vec_bytes(current)
    }

    fn start(&mut self, pixels: usize) {
        self.samples.clear();
        self.samples.resize(pixels, Default::default());
        self.current.clear();
        self.current.resize(pixels, SampleEstimate::default());
    }

    fn add(&mut self, pixel: usize, value: [f32; 3], sign: f32) {
        let (groups, variance) = &mut self.samples[pixel];
        groups.add(value, sign);
        variance.add(value);
    }

    /// Stores the statistics of the first samples.
    fn end_first_round(&mut self, region: SampledRegion, has_rare_light: bool) {
        let Estimates { samples, first, around, .. } = self;
        first.clear();
        first.extend(samples.iter().map(|(_, variance)| FirstSamples::from(variance)));
        around.clear();
        around.resize(first.len(), Neighbourhood::default());
        for pixel in region.tile_pixels().filter(|_| !first.is_empty()) {
            around[pixel] = Neighbourhood::new(region.around(pixel).map(|near| &first[near]));
        }
        if !has_rare_light || first.is_empty() {
            return;
        }
        let isolated: Vec<Vec4> = (0..first.len())
            .map(|pixel| first[pixel].isolated_variance(region.around(pixel).map(|near| &first[near])))
            .collect();
        if isolated.iter().all(|&variance| variance == Vec4::ZERO) {
            return;
        }
        for pixel in region.tile_pixels() {
            let sum =
                |radius| -> Vec4 { region.neighbourhood(pixel, radius).map(|near| isolated[near]).sum() };
            // Whether its neighbours are isolated depends on the pixel's own samples.
            let count = |radius| region.neighbourhood(pixel, radius).count();
            let others = (count(RARE_LIGHT_RADIUS) - count(1)).max(1) as f32;
            around[pixel].isolated = (sum(RARE_LIGHT_RADIUS) - sum(1)).max(Vec4::ZERO) / others;
        }
    }

    /// Updates the estimates of the pixels that are sampled.
    fn end_round(&mut self, live: impl Iterator<Item = usize>, mean_sign: f64) {
        for pixel in live.filter(|_| !self.samples.is_empty()) {
            let (groups, variance) = &self.samples[pixel];
            self.current[pixel] = SampleEstimate::new(variance, groups, mean_sign);
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
    has_rare_light: bool,
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
            has_rare_light: context.spec.has_rare_light,
        }
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        tile.with_buffers(|buffers: &mut Buffers, tile| {
            tile.with_buffers(|samples: &mut TileSamples, tile| {
                // Otherwise all pixels have the most samples, and the pass is part of them.
                if tile.needs_more_samples {
                    self.add_pass(buffers, samples, tile, context);
                }
                if !tile.needs_more_samples {
                    let counts = samples.region().tile_pixels().zip(&tile.sample_counts);
                    tile.noisy_pixels += self.count_noisy(&buffers.colour, counts, context);
                }
            });
        });
    }

    fn add_pass(
        &self,
        buffers: &mut Buffers,
        samples: &mut TileSamples,
        tile: &mut Tile,
        context: &RenderContext,
    ) {
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
        let (coverage, white) = (tile.coverage.as_deref().unwrap_or_default(), context.display.white());
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
    }

    /// The number of pixels of [`Tile::noisy_pixels`].
    fn count_noisy<'a>(
        &self,
        colour: &Estimates,
        counts: impl Iterator<Item = (usize, &'a u32)>,
        context: &RenderContext,
    ) -> u64 {
        let displayed = |value: DVec3| context.display.displayed(context.world.pipeline, value);
        let is_noisy = |&(pixel, &count): &(usize, &u32)| {
            // None where the first samples are all.
            let (Some(own), Some(around)) = (colour.current.get(pixel), colour.around.get(pixel)) else {
                return false;
            };
            let (value, variance) = value_and_variance([own].into_iter(), self.colour, around);
            // Samples of its value and of its variance are not the same.
            let variance = variance * (f64::from(own.count()) / f64::from(count));
            let error = DVec3::from(variance.to_array().map(f64::sqrt));
            displayed_error(value, error, displayed) > NOISY_LEVELS * self.criterion.max_error
        };
        let has_level = self.colour == Integrand::Random && self.criterion.max_error >= 0.0;
        counts.filter(|_| has_level).filter(is_noisy).count() as u64
    }

    fn end_round(&self, buffers: &mut Buffers, samples: &mut TileSamples, context: &RenderContext) {
        let TestConvergence { sampler, criterion, .. } = self;
        let (taken, first, region) = (samples.round_end(), criterion.min_samples, samples.region());
        let Buffers { colour, alpha, over_white, has_surface } = buffers;
        for estimates in [&mut *colour, alpha, over_white] {
            if taken == first {
                estimates.end_first_round(region, self.has_rare_light);
            }
            estimates.end_round(samples.live(), sampler.filter.mean_sign());
        }
        let (display, pipeline) = (context.display, context.world.pipeline);
        let displayed = |colour: DVec3| display.displayed(pipeline, colour);
        let covered = |alpha: DVec3| alpha.clamp(DVec3::ZERO, DVec3::ONE);
        let has_surface = &*has_surface;
        let is_accurate = |estimates: &Estimates,
                           integrand,
                           (pixel, white, observed): (usize, f64, u32),
                           shown: &dyn Fn(DVec3) -> DVec3| {
            let around = &estimates.around[pixel];
            let near = || region.tested_by(pixel).map(|near| &estimates.current[near]);
            let (value, variance) = value_and_variance(near(), integrand, around);
            let mut variance = variance + missed_variance(around.deviation, taken);
            let has_surface = || region.around(pixel).any(|near| has_surface[near]);
            if integrand == Integrand::Random && has_surface() {
                variance += unseen_variance(value, white, observed, taken);
            }
            is_displayed_within(criterion.max_error, (value, variance), near(), shown)
        };
        let (colour, alpha, over_white) = (&*colour, &*alpha, &*over_white);
        samples.start_round(criterion.next_test(taken, sampler.samples), |pixel| {
            let [near, around] =
                [region.tested_by(pixel).count(), region.around(pixel).count()].map(|n| n as u32);
            let observed = near.saturating_mul(taken).saturating_add((around - near).saturating_mul(first));
            let white = display.white();
            is_accurate(colour, self.colour, (pixel, white, observed), &displayed)
                && (alpha.first.is_empty()
                    || is_accurate(alpha, self.alpha, (pixel, 1.0, observed), &covered)
                        && is_accurate(over_white, self.over_white, (pixel, white, observed), &displayed))
        });
    }
}
