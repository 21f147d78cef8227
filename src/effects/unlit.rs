//! Unlit surfaces in pictures that are displayed: their colours pass exposure and tone map unchanged.
//!
//! What a camera ray sees of them directly is kept beside the light of the picture, in [`Tile::shown`], and is put over
//! it once exposure and tone map have been applied to the rest. In mirrors and behind glass they are light.

use super::Stage;
use super::tile::{RenderContext, Tile};
use crate::scene::{Material, MetallicRoughness};
use crate::shading::metallic_roughness::base_colour;
use crate::world::{PreparedMaterial, World};

/// Whether an object of a world is unlit.
pub(crate) fn has_unlit(world: &World) -> bool {
    world.materials_in_use().any(PreparedMaterial::is_unlit)
}

/// Finds the colours of the unlit surfaces that camera rays see.
pub(crate) struct FindUnlit;

impl Stage for FindUnlit {
    fn name(&self) -> &'static str {
        "unlit"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let Tile { generations, current, shown: Some(shown), .. } = tile else { return };
        let surfaces = &generations[*current].surfaces;
        for (material, range) in surfaces.by_material() {
            let Material::MetallicRoughness(material @ MetallicRoughness { unlit: true, .. }) =
                &context.world.materials[*material as usize]
            else {
                continue;
            };
            for i in range.clone() {
                let [r, g, b] = base_colour(material, &surfaces.get(i)).as_vec3().to_array();
                shown[surfaces.ray_of()[i] as usize] = [r, g, b, 1.0];
            }
        }
    }
}

/// Gives the camera rays that see unlit surfaces, whose colours are in [`Tile::pixels`], the light that is displayed in
/// their colours without a tone map, so that noise is judged by what is displayed.
pub(crate) fn expose_unlit(tile: &mut Tile, context: &RenderContext) {
    let Tile { shown: Some(shown), pixels, .. } = tile else { return };
    let white = context.display.white();
    for (pixel, &[r, g, b, part]) in pixels.iter_mut().zip(&*shown) {
        if part > 0.0 {
            *pixel = [r, g, b].map(|c| (f64::from(c) * white) as f32);
        }
    }
}
