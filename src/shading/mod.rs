//! Shading: pure functions of a surface interaction and light samples. Visibility is tested by the caller.

pub mod bsdf;
mod lights;
pub(crate) mod metallic_roughness;
pub mod normal_map;
mod opacity;
mod phong;
pub mod texture;

pub use crate::scene::ShadingMode;
pub use lights::{LightSample, LightSoa};
pub use opacity::SceneOpacity;
pub(crate) use opacity::{VISIBLE_FROM, opacity};
pub use phong::Scratch;

use glam::DVec3;

use crate::scene::{Material, TextureSlot};
use crate::world::{InteractionSoa, PreparedMaterial, SurfaceInteraction, Vec3Soa, World};

/// Whether lights can change the colour of a material.
pub fn takes_light(material: &PreparedMaterial, mode: ShadingMode) -> bool {
    match material {
        Material::Phong(material) => phong::takes_light(material, mode),
        Material::MetallicRoughness(material) => !material.unlit,
    }
}

/// The base colour of a surface, in the numbers of the pipeline. `texel` is the value of its texture.
pub fn base_colour(world: &World, surface: &SurfaceInteraction, texel: DVec3) -> DVec3 {
    world.pipeline.clamp(world.materials[surface.material as usize].colour() * surface.tint * texel)
}

/// Computes the colours of all `surfaces`, in the numbers of the pipeline. Lights are added in the order of `lights`,
/// where they reach.
pub fn shade_all(
    world: &World,
    mode: ShadingMode,
    surfaces: &InteractionSoa,
    lights: &[Box<LightSoa>],
    colours: &mut Vec3Soa,
    scratch: &mut Scratch,
) {
    let mut samples = Vec::new();
    for (index, range) in surfaces.by_material() {
        let range = range.clone();
        if mode == ShadingMode::Flat {
            range.for_each(|i| {
                let texel = surfaces.texels.get(TextureSlot::BaseColour, i);
                colours.set(i, base_colour(world, &surfaces.get(i), texel));
            });
            continue;
        }
        match &world.materials[*index as usize] {
            Material::Phong(material) => {
                phong::shade(world, material, mode, (surfaces, range), lights, (colours, scratch));
            }
            Material::MetallicRoughness(material) => range.for_each(|i| {
                samples.clear();
                samples.extend(lights.iter().filter(|light| light.reaches[i]).map(|light| light.get(i)));
                let texel = |slot| surfaces.texels.get(slot, i);
                let colour =
                    metallic_roughness::shade(world, material, mode, &surfaces.get(i), texel, &samples);
                colours.set(i, colour);
            }),
        }
    }
}
