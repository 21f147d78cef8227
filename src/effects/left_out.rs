//! Measurement of the light that limits leave out ([`LeftOut`]): the transport hands over the samples of each pass.

use super::light_left_out::LeftOut;
use super::{Effect, EffectContext, Hook, Stage, id};

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::LEFT_OUT,
    summary: "measures the light that limits of bounces and the clamp leave out; the picture stays the same",
    source: "Arvo and Kirk, Particle Transport and Image Synthesis, 1990 (Russian roulette)",
    builds_on: Some(id::PATH),
    is_measurement: true,
    called_for: |_, _| Ok(format!("`{}` has limits", id::PATH)),
    // Layers of transparent surfaces of one sample are not samples of the pixel.
    specify: |_, spec| spec.measures_left_out = !spec.layers || spec.own_camera_rays,
    stages: |context: &EffectContext, hook| match hook {
        Hook::Film if context.spec.measures_left_out => {
            vec![Stage::with_buffers("left-out", |buffers: &mut LeftOut, tile, _| buffers.end_pass(tile))]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<LeftOut>().map_or(0, LeftOut::bytes),
    ..Effect::NONE
};
