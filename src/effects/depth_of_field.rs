//! Depth of field: camera rays start on the lens of the camera ([`crate::world::ThinLens`]), another point of it for each
//! sample of a pixel.

use super::random::{Dimension, independent_pair, pair};
use super::samples::{SampleIndex, list_samples};
use super::tile::{RenderContext, Tile, vec_bytes};
use super::{Effect, EffectContext, EffectValue, Hook, Stage, id};
use crate::scene::{PixelSampler, Sampling, ValueKind};
use crate::world::{PerRay, Vec3Soa, simd};

/// The largest blur that can be asked for, in heights of the picture.
const MAX_BLUR: f64 = 100.0;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::DEPTH_OF_FIELD,
    summary: "points off the plane of focus are blurred by the aperture of the camera's lens",
    source: "Cook, Porter and Carpenter, Distributed Ray Tracing, 1984",
    decides_samples: true,
    is_study_switch: true,
    value: Some(EffectValue {
        placeholder: "BLUR",
        meaning: "blur of points infinitely far away in heights of the picture",
        kind: || ValueKind::Number { range: [f64::MIN_POSITIVE, MAX_BLUR], is_whole: false },
        check: |value| match value.parse::<f64>() {
            Ok(blur) if blur > 0.0 && blur <= MAX_BLUR => Ok(()),
            _ => Err(format!("give a number above 0, at most {MAX_BLUR}")),
        },
    }),
    called_for: |_, plan_settings| {
        plan_settings.lens.clone().ok_or_else(|| "the camera has no aperture".into())
    },
    specify: |_, spec| (spec.is_random, spec.has_rare_light) = (true, true),
    stages: |context: &EffectContext, hook| match hook {
        Hook::Rays => {
            let Sampling { sampler, seed, .. } = *context.sampling;
            vec![Stage::with_buffers("lens", move |buffers, tile, context| {
                sample_lens(buffers, (sampler, seed), tile, context);
            })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| {
        let bytes = |buffers: &Buffers| size_of_val(buffers) + vec_bytes(&buffers.samples);
        tile.buffers::<Buffers>().map_or(0, bytes)
    },
    ..Effect::NONE
};

#[derive(Default)]
struct Buffers {
    samples: Vec<SampleIndex>,
    /// For each ray, its random numbers.
    numbers: PerRay<[f64; 2]>,
    /// For each ray, the opposite of its direction.
    backwards: Vec3Soa,
}

/// Moves the camera rays onto the lens.
fn sample_lens(
    Buffers { samples, numbers, backwards }: &mut Buffers,
    (sampler, seed): (PixelSampler, u32),
    tile: &mut Tile,
    context: &RenderContext,
) {
    samples.clear();
    list_samples(tile, samples);
    match sampler {
        PixelSampler::Sobol => simd!(draw(
            numbers,
            samples,
            #[inline(always)]
            |pixel, sample| pair(pixel, seed, sample, Dimension::LENS)
        )),
        PixelSampler::Independent => simd!(draw(
            numbers,
            samples,
            #[inline(always)]
            |pixel, sample| independent_pair(pixel, seed, sample, Dimension::LENS)
        )),
    }
    let rays = &mut tile.generation().rays;
    backwards.set_negated(rays.rays().directions());
    context.view.put_on_lens(rays, backwards, numbers, context.world.numerics().ray_precision());
}

/// Computes the random numbers of samples, by pixel and sample.
#[inline(always)]
fn draw(numbers: &mut PerRay<[f64; 2]>, samples: &[SampleIndex], pair: impl Fn([u32; 2], u32) -> [f32; 2]) {
    for (numbers, sample) in numbers.iter_mut().zip(samples) {
        *numbers = pair([sample.x, sample.y], sample.sample).map(f64::from);
    }
}
