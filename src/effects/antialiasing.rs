//! Antialiasing: a pixel is the filtered mean of several samples instead of the one through its centre ([`super::samples`]).

use super::region::SampledRegion;
use super::samples::{PixelSampleSequence, TileSamples};
use super::tile::{RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, Hook, Stage, id};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::ANTIALIASING,
    summary: "several filtered samples per pixel instead of one at its centre",
    source: "pbrt, 4th edition, chapter 8",
    decides_samples: true,
    called_for: |_, plan_settings| {
        let sampling = &plan_settings.sampling;
        if !sampling.is_wanted() {
            return Err("one sample per pixel, at its centre; --samples takes more".into());
        }
        let filter = sampling.shape_and_radius();
        let (samples, name, radius) = (sampling.max_samples(), filter.0.name(), filter.1);
        let up_to = if sampling.noise.is_some() { "up to " } else { "" };
        Ok(format!("{up_to}{samples} sample(s) per pixel, filter `{name}` of radius {radius}"))
    },
    specify: |context: &EffectContext, spec| {
        spec.own_camera_rays = true;
        spec.samples = context.sampling.samples_of_footprints();
    },
    stages: |context: &EffectContext, hook| {
        let sequence = || PixelSampleSequence::new(context);
        match hook {
            Hook::Rays => vec![Stage::with_buffers("primary", fill(sequence()))],
            Hook::Film => vec![Stage::with_buffers("samples", add(sequence()))],
            _ => Vec::new(),
        }
    },
    bytes: |tile| {
        tile.buffers::<TileSamples>().map_or(0, TileSamples::bytes) + vec_bytes(&tile.sample_counts)
    },
    ..Effect::NONE
};

/// Fills generation 0 with the rays of the next pass of samples.
fn fill(sequence: PixelSampleSequence) -> impl Fn(&mut TileSamples, &mut Tile, &RenderContext) {
    move |samples, tile, context| {
        let Some(window) = tile.window else { return };
        if !tile.needs_more_samples {
            let region = SampledRegion::new(window, sequence.apron, context.view.size());
            samples.start(region, &sequence, tile);
        }
        samples.next_pass(&sequence);
        let (x, y) = samples.film_positions();
        let precision = context.world.numerics().ray_precision();
        let generation = tile.generation();
        context.view.rays_through(x, y, precision, &mut generation.rays);
        generation.sources.clear();
        generation.sources.extend(0..x.len() as u32);
        tile.pixels.clear();
    }
}

/// Adds the pass's samples to their pixels, and gives the pixels their values after the last pass.
fn add(sequence: PixelSampleSequence) -> impl Fn(&mut TileSamples, &mut Tile, &RenderContext) {
    move |samples, tile, context| {
        samples.add(tile);
        // The stage of adaptive sampling, which comes next, may end the tile earlier.
        tile.needs_more_samples = !samples.is_round_done() || samples.round_end() < sequence.samples;
        if !tile.needs_more_samples {
            samples.finish(tile, &sequence, context.world.pipeline);
        }
    }
}
