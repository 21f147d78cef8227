//! Soft shadows: directional lights with an apparent diameter are blocked in part.
//!
//! Shadow rays go to points of the light's disc, uniform in its solid angle, one for each sample of a pixel. Their mean
//! is the share of the disc that is visible, by which the light of its centre is multiplied. A direction below the
//! horizon of the triangle is mirrored above it, so that a surface does not shade itself.

use crate::effects::random::Dimension;
use crate::effects::samples::DiscPoints;
use crate::effects::tile::{RenderContext, Tile};
use crate::effects::{Effect, EffectContext, Hook, Stage, id, named};
use crate::scene::{PixelSampler, Sampling};
use crate::world::World;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::SOFT_SHADOWS,
    summary: "soft shadows of lights with an apparent diameter",
    source: "Cook, Porter and Carpenter, Distributed Ray Tracing, 1984",
    builds_on: Some(id::SHADOWS),
    needs_lights: true,
    is_shading: true,
    called_for: |world: &World, plan_settings| {
        let discs = world.lights.iter().filter(|light| light.disc.is_some());
        let Some(names) = named("light", discs.map(|light| light.name.as_str())) else {
            return Err("no directional light has an `angle`".into());
        };
        if !plan_settings.sampling.is_wanted() {
            return Err("one sample per pixel has no soft shadow; --samples takes more".into());
        }
        Ok(format!("the apparent diameter of {names}"))
    },
    specify: |_, spec| {
        spec.soft_shadows = spec.shadow_rays;
        spec.is_random |= spec.shadow_rays;
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::BeforeLighting(_) if context.spec.soft_shadows => {
            let Sampling { sampler, seed, .. } = *context.sampling;
            vec![Stage::with_buffers("soft shadows", move |points, tile, context| {
                sample_discs(points, (sampler, seed), tile, context);
            })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| tile.buffers::<DiscPoints>().map_or(0, DiscPoints::bytes),
    ..Effect::NONE
};

/// Samples the discs of the lights at the surfaces of a generation.
fn sample_discs(
    DiscPoints { numbers, directions }: &mut DiscPoints,
    (sampler, seed): (PixelSampler, u32),
    tile: &mut Tile,
    context: &RenderContext,
) {
    numbers.start(tile);
    let generation = &tile.generations[tile.current];
    let surfaces = &generation.surfaces;
    directions.resize_with(context.world.lights.len(), Vec::new);
    for (index, (directions, light)) in directions.iter_mut().zip(&context.world.lights).enumerate() {
        directions.clear();
        let Some(disc) = &light.disc else { continue };
        let sequence = (sampler, seed, Dimension::disc(index as u32));
        directions.extend((0..surfaces.len()).map(|i| {
            let ray = surfaces.ray_of()[i] as usize;
            let towards = disc.sample(numbers.pair(sequence, (&generation.rays, ray), (0, 1)));
            // The geometric normal is on the side of the ray origin.
            let normal = surfaces.geometric_normal.get(i);
            towards - 2.0 * towards.dot(normal).min(0.0) * normal
        }));
    }
}
