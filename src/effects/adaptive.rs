//! Adaptive effort: a pixel whose value is certain enough is sampled no further ([`super::effort`]).

use super::effort::{Adaptive, Groups, displayed_error};
use super::samples::{Sampler, Samples};
use super::tile::{Context, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Outline, Stage};
use crate::world::World;

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "adaptive",
    summary: "pixels that are certain enough take fewer samples than others",
    needs_lights: false,
    is_shading: false,
    rays: &[],
    value: None,
    called_for: |world: &World| {
        let Some(level) = world.sampling.noise else {
            return Err("no level of noise is given; --noise does".into());
        };
        let (floor, most) = (Adaptive::new(&world.sampling).floor, world.sampling.most_samples());
        if floor == most {
            return Err(format!("every pixel takes {most} sample(s) anyway"));
        }
        Ok(format!("`noise` {level}, {floor} to {most} samples a pixel"))
    },
    outline: |_, outline: &mut Outline| outline.adaptive = true,
    stages: |asked: &Asked, hook| match hook {
        Hook::Film => {
            let adaptive = Adaptive::new(&asked.world.sampling);
            vec![Box::new(Judge { sampler: Sampler::new(asked), adaptive })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.kept::<Buffers>().map_or(0, |Buffers { groups }| vec_bytes(groups)),
};

/// The samples of each pixel in groups.
#[derive(Default)]
struct Buffers {
    groups: Vec<Groups>,
}

/// After each pass, takes it in; after each round, lets go of the pixels that are done.
struct Judge {
    sampler: Sampler,
    adaptive: Adaptive,
}

impl Stage for Judge {
    fn name(&self) -> &'static str {
        "adaptive"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        if !tile.again {
            return;
        }
        let pipeline = context.world.pipeline;
        let (sampler, adaptive) = (&self.sampler, &self.adaptive);
        tile.with(|Buffers { groups }, tile| {
            tile.with(|samples: &mut Samples, tile| {
                if samples.is_first_pass() {
                    groups.clear();
                    groups.resize(samples.pixels(), Groups::default());
                }
                for (pixel, sign, &colour) in samples.seen(&tile.pixels) {
                    groups[pixel].add(colour, sign as f32);
                }
                if !samples.is_round_done() {
                    return;
                }
                let mean_sign = sampler.filter.mean_sign();
                samples.go_on_where(adaptive.next_look(samples.round_end(), sampler.samples), |pixel, sum| {
                    let error = groups[pixel].standard_error(sum.mean(), mean_sign);
                    displayed_error(sum.value(&sampler.filter), error, pipeline) > adaptive.level
                });
                if samples.is_over() {
                    samples.finish(tile, sampler, pipeline);
                }
            });
        });
    }
}
