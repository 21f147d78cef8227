//! Adaptive effort: a pixel whose value is certain enough is sampled no further ([`super::effort`]).

use glam::{DVec3, Vec4};

use super::effort::{Adaptive, First, Groups, displayed_error, unseen};
use super::samples::{Field, Sampler, Samples};
use super::tile::{Context, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Outline, Stage};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "adaptive",
    summary: "pixels that are certain enough take fewer samples than others",
    needs_lights: false,
    is_shading: false,
    rays: &[],
    value: None,
    called_for: |_, sampling| {
        let Some(level) = sampling.noise else {
            return Err("no level of noise is given; --noise does".into());
        };
        let (floor, most) = (Adaptive::new(sampling).floor, sampling.most_samples());
        if floor == most {
            return Err(format!("every pixel takes {most} sample(s) anyway"));
        }
        Ok(format!("`noise` {level}, {floor} to {most} samples a pixel"))
    },
    outline: |_, outline: &mut Outline| outline.adaptive = true,
    stages: |asked: &Asked, hook| match hook {
        Hook::Film => {
            let adaptive = Adaptive::new(asked.sampling);
            vec![Box::new(Judge { sampler: Sampler::new(asked), adaptive })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.kept::<Buffers>().map_or(0, Buffers::bytes),
};

/// What pixels are judged by.
#[derive(Default)]
struct Buffers {
    /// The samples of each pixel in groups.
    groups: Vec<Groups>,
    /// What each pixel's first samples were.
    first: Vec<First>,
    /// For each pixel, how far the first samples around it lie apart.
    around: Vec<Vec4>,
}

impl Buffers {
    fn bytes(&self) -> usize {
        let Buffers { groups, first, around } = self;
        vec_bytes(groups) + vec_bytes(first) + vec_bytes(around)
    }
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
        tile.with(|Buffers { groups, first, around }, tile| {
            tile.with(|samples: &mut Samples, tile| {
                if samples.is_first_pass() {
                    groups.clear();
                    groups.resize(samples.sums().len(), Groups::default());
                }
                for (pixel, sign, &colour) in samples.seen(&tile.pixels) {
                    groups[pixel].add(colour, sign as f32);
                }
                if !samples.is_round_done() {
                    return;
                }
                let mean_sign = sampler.filter.mean_sign();
                let taken = samples.round_end();
                if taken == adaptive.floor {
                    let pixels = samples.sums().iter().zip(&*groups);
                    first.clear();
                    first.extend(pixels.map(|(sum, groups)| First::new(groups, sum.mean(), mean_sign)));
                    look_around(samples.field(), first, around);
                }
                samples.go_on_where(adaptive.next_look(taken, sampler.samples), |pixel, sum| {
                    let seen = groups[pixel].variance(sum.mean(), mean_sign);
                    let variance = seen + unseen(around[pixel], taken);
                    // What has no variance, such as a background, is not worth the encoding.
                    let error = if variance == DVec3::ZERO {
                        0.0
                    } else {
                        let error = DVec3::from(variance.to_array().map(f64::sqrt));
                        displayed_error(sum.value(&sampler.filter), error, pipeline)
                    };
                    error > adaptive.level
                });
                if samples.is_over() {
                    samples.finish(tile, sampler, pipeline);
                }
            });
        });
    }
}

/// For each of the tile's own pixels, how far the first samples of those around it lie apart; zero for the others.
fn look_around(field: Field, first: &[First], around: &mut Vec<Vec4>) {
    around.clear();
    around.resize(first.len(), Vec4::ZERO);
    for pixel in field.own() {
        around[pixel] = first[pixel].spread(field.near(pixel).map(|near| &first[near]));
    }
}
