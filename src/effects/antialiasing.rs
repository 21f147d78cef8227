//! Antialiasing: a pixel is the filtered mean of several samples instead of what its centre sees ([`super::samples`]).

use super::samples::{Field, Sampler, Samples};
use super::tile::{Context, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Stage};

/// How many samples pictures are taken to have that are made in parts, for what depends on it: how much of a texture each sees.
/// Fewer would blur textures, which no measurement of noise sees.
const SAMPLES_OF_PARTS: u32 = 64;

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "antialiasing",
    summary: "a pixel is the filtered mean of several samples, not what its centre sees",
    needs_lights: false,
    is_shading: false,
    rays: &[],
    value: None,
    called_for: |_, sampling| {
        if !sampling.is_wanted() {
            return Err("one sample a pixel, through its centre; --samples asks for more".into());
        }
        let filter = sampling.shape_and_radius();
        let (samples, name, radius) = (sampling.most_samples(), filter.0.name(), filter.1);
        let up_to = if sampling.noise.is_some() { "up to " } else { "" };
        Ok(format!("{up_to}{samples} sample(s) a pixel, filter `{name}` of radius {radius}"))
    },
    outline: |asked: &Asked, outline| {
        outline.own_rays = true;
        let sampling = asked.sampling;
        // A part of a picture whose samples are not known yet: many.
        let least = if sampling.first.is_some() { SAMPLES_OF_PARTS } else { 1 };
        outline.samples = sampling.most_samples().max(least);
    },
    stages: |asked: &Asked, hook| match hook {
        Hook::Rays => vec![Box::new(Scatter(Sampler::new(asked)))],
        Hook::Film => vec![Box::new(Gather(Sampler::new(asked)))],
        _ => Vec::new(),
    },
    bytes: |tile| tile.kept::<Samples>().map_or(0, Samples::bytes) + vec_bytes(&tile.taken),
};

/// Fills level 0 with the rays of the next pass of samples.
pub struct Scatter(Sampler);

impl Stage for Scatter {
    fn name(&self) -> &'static str {
        "primary"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Some(window) = tile.window else { return };
        tile.with(|samples: &mut Samples, tile| {
            if !tile.again {
                samples.start(Field::new(window, self.0.apron, context.view.size()), &self.0);
            }
            samples.list(&self.0);
            let (x, y) = samples.places();
            let precision = context.world.numerics().ray_precision();
            let level = tile.level();
            context.view.rays_through(x, y, precision, &mut level.lanes);
            level.lanes.weave(x.len(), &mut level.rays);
            level.sources.clear();
            level.sources.extend(0..x.len() as u32);
            tile.pixels.clear();
        });
    }
}

/// Adds what the pass saw to the pixels, and gives them their values after the last.
pub struct Gather(Sampler);

impl Stage for Gather {
    fn name(&self) -> &'static str {
        "samples"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|samples: &mut Samples, tile| {
            samples.take(&tile.pixels);
            // Whether pixels that could take more do so is for the next stage to say.
            tile.again = !samples.is_round_done() || samples.round_end() < self.0.samples;
            if !tile.again {
                samples.finish(tile, &self.0, context.world.pipeline);
            }
        });
    }
}
