//! Alpha: surfaces of opacity below 1, blended over what is behind them ([`super::transparency`]).

use super::transparency::{Buffers, ContinuedRays, blend_layers};
use super::{Effect, EffectContext, Hook, RayKind, Stage, id, named};
use crate::world::World;

/// Rays that were continued behind a surface.
pub const RAYS: RayKind = RayKind { name: "alpha", is_shadow: false, colour: [240, 180, 120] };

/// Shadow rays that were continued behind a surface.
pub const SHADOW_RAYS: RayKind = RayKind { name: "alpha-shadow", is_shadow: true, colour: [160, 170, 220] };

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::ALPHA,
    summary: "alpha transparency of surfaces, independent of their order, also for shadow rays",
    source: "Enderton and others, Stochastic Transparency, 2010",
    is_study_switch: true,
    rays: &[RAYS, SHADOW_RAYS],
    called_for: |world: &World, _| {
        let transparent = world.objects.iter().filter(|object| world.is_transparent(object));
        let names = transparent.map(|object| world.materials[object.material as usize].name());
        named("material", names).ok_or_else(|| "every surface is opaque".into())
    },
    specify: |_, spec| {
        spec.continued = Some(ContinuedRays { rays: RAYS, shadow_rays: SHADOW_RAYS });
        spec.is_random = true;
    },
    stages: |context: &EffectContext, hook| match (hook, context.transparency()) {
        (Hook::Film, Some(how)) if how.is_layered => {
            vec![Stage::with_buffers("alpha blending", blend_layers)]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<Buffers>().map_or(0, Buffers::bytes),
    ..Effect::NONE
};
