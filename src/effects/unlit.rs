//! Unlit surfaces of displayed pictures, which bypass exposure and tone map.
//!
//! Directly visible ones are stored in [`Tile::shown`] and composited after exposure and tone map. In mirrors and
//! behind glass they are radiance.

use super::tile::{RenderContext, Tile};
use crate::scene::TextureSlot;
use crate::world::{PreparedMaterial, World};

/// Whether any object is unlit.
pub(crate) fn has_unlit(world: &World) -> bool {
    world.materials_in_use().any(PreparedMaterial::is_unlit)
}

/// Stores the colours of directly visible unlit surfaces.
pub(crate) fn find(tile: &mut Tile, context: &RenderContext) {
    let Tile { generations, current, shown: Some(shown), .. } = tile else { return };
    let surfaces = &generations[*current].surfaces;
    for (material, range) in surfaces.by_material() {
        let material = &context.world.materials[*material as usize];
        for i in range.clone().filter(|_| material.is_unlit()) {
            let texel = surfaces.texels.get(TextureSlot::BaseColour, i);
            let colour = material.colour() * surfaces.tint.get(i) * texel;
            let [r, g, b] = colour.as_vec3().to_array();
            shown[surfaces.ray_of()[i] as usize] = [r, g, b, 1.0];
        }
    }
}

/// Sets [`Tile::pixels`] of camera rays on unlit surfaces to the radiance that is displayed as their colour without a
/// tone map, so that adaptive sampling tests the displayed noise.
pub(crate) fn expose_unlit(tile: &mut Tile, context: &RenderContext) {
    let Tile { shown: Some(shown), pixels, .. } = tile else { return };
    let white = context.display.white();
    for (pixel, &[r, g, b, part]) in pixels.iter_mut().zip(&*shown) {
        if part > 0.0 {
            *pixel = [r, g, b].map(|c| (f64::from(c) * white) as f32);
        }
    }
}
