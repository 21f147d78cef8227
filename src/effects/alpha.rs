//! Alpha: surfaces of opacity below 1, blended over what is behind them ([`super::transparency`]).

use super::transparency::{BlendLayers, Buffers, RAYS, SHADOW_RAYS, Transparency};
use super::{Effect, EffectContext, Hook, id, named};
use crate::world::World;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::ALPHA,
    summary: "surfaces with alpha show what is behind them, in any order, and let light through",
    builds_on: None,
    needs_lights: false,
    is_shading: false,
    decides_samples: false,
    is_study_switch: true,
    whitted_only: false,
    rays: &[RAYS, SHADOW_RAYS],
    value: None,
    called_for: |world: &World, _| {
        let transparent = world.objects.iter().filter(|object| world.is_transparent(object));
        let names: Vec<&str> =
            transparent.map(|object| world.materials[object.material as usize].name()).collect();
        named("material", &names).ok_or_else(|| "every surface is opaque".into())
    },
    specify: |_, spec| spec.is_transparent = true,
    stages: |context: &EffectContext, hook| match (hook, context.transparency()) {
        (Hook::Film, Some(Transparency::Layers)) => vec![Box::new(BlendLayers)],
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<Buffers>().map_or(0, Buffers::bytes),
};
