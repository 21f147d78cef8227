//! Shading: pure functions of a surface interaction and light samples. Visibility is tested by the caller.

pub mod bsdf;
mod lights;
mod metallic_roughness;
pub mod normal_map;
mod phong;
pub mod texture;

pub use crate::scene::ShadingMode;
pub use lights::{LightSample, LightSoa};
pub use phong::Scratch;

use glam::DVec3;

use crate::scene::Material;
use crate::world::{InteractionSoa, PreparedMaterial, SurfaceInteraction, Vec3Soa, World};

/// Whether lights can change the colour of a material.
pub fn takes_light(material: &PreparedMaterial, mode: ShadingMode) -> bool {
    match material {
        Material::Phong(material) => phong::takes_light(material, mode),
        Material::MetallicRoughness(material) => !material.unlit,
    }
}

/// The colour of a surface, in the numbers of the pipeline. `lights` are the samples of the lights that reach it.
pub fn shade(
    world: &World,
    mode: ShadingMode,
    surface: &SurfaceInteraction,
    lights: &[LightSample],
) -> DVec3 {
    match &world.materials[surface.material as usize] {
        Material::Phong(material) => phong::shade(world, material, mode, surface, lights),
        Material::MetallicRoughness(material) => {
            metallic_roughness::shade(world, material, mode, surface, lights)
        }
    }
}

/// Computes the colours of all `surfaces`, with the bits of [`shade`]. Lights are added in the order of `lights`.
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
        if let Material::Phong(material) = &world.materials[*index as usize]
            && material.texture.is_none()
        {
            phong::shade_all(world, material, mode, (surfaces, range), lights, (colours, scratch));
            continue;
        }
        for i in range {
            samples.clear();
            samples.extend(lights.iter().filter(|light| light.reaches[i]).map(|light| light.get(i)));
            colours.set(i, shade(world, mode, &surfaces.get(i), &samples));
        }
    }
}
