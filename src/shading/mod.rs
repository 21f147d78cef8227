//! Light at a point: pure functions of a surface and what shines on it.
//!
//! Nothing here casts a ray; whether a light is in the way of nothing is somebody else's business.

mod lights;
mod metallic_roughness;
pub mod normal_map;
mod phong;
pub mod texture;

pub use lights::{LightLanes, LightSample};
pub use phong::Scratch;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::world::{Lanes, LoweredMaterial, Surface, Surfaces, World};

/// How far shading goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShadingMode {
    /// The object's own colour.
    Flat,
    /// Ambient light alone.
    Ambient,
    /// Ambient and diffuse light.
    Diffuse,
    /// Ambient and diffuse light and highlights.
    #[default]
    Phong,
}

impl ShadingMode {
    /// Every mode, from the least to all.
    pub const ALL: [ShadingMode; 4] =
        [ShadingMode::Flat, ShadingMode::Ambient, ShadingMode::Diffuse, ShadingMode::Phong];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            ShadingMode::Flat => "flat",
            ShadingMode::Ambient => "ambient",
            ShadingMode::Diffuse => "diffuse",
            ShadingMode::Phong => "phong",
        }
    }

    /// Whether lights take part at all.
    pub fn uses_lights(self) -> bool {
        self >= ShadingMode::Diffuse
    }
}

/// Whether any light, whatever its strength, can change the colour of such a material.
pub fn takes_light(material: &LoweredMaterial, mode: ShadingMode) -> bool {
    match material {
        LoweredMaterial::Phong(material) => phong::takes_light(material, mode),
        LoweredMaterial::MetallicRoughness(material) => !material.unlit,
    }
}

/// The colour of a surface under the given lights: those that reach it, each as seen from it.
pub fn shade(world: &World, mode: ShadingMode, surface: &Surface, lights: &[LightSample]) -> DVec3 {
    match &world.materials[surface.material as usize] {
        LoweredMaterial::Phong(material) => phong::shade(world, material, mode, surface, lights),
        LoweredMaterial::MetallicRoughness(material) => {
            metallic_roughness::shade(world, material, mode, surface, lights)
        }
    }
}

/// The colours of all `surfaces` under the lights as they see them: [`shade`] for each, in the order of the lights.
pub fn shade_all(
    world: &World,
    mode: ShadingMode,
    surfaces: &Surfaces,
    lights: &[Box<LightLanes>],
    colours: &mut Lanes,
    scratch: &mut Scratch,
) {
    let mut samples = Vec::new();
    for (index, range) in surfaces.by_material() {
        let range = range.clone();
        if let LoweredMaterial::Phong(material) = &world.materials[*index as usize]
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
