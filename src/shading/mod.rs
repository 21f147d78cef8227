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
use serde::{Serialize, Serializer};

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
                let colour = metallic_roughness::shade(
                    world,
                    material,
                    mode,
                    &surfaces.get(i),
                    texel,
                    &samples,
                    |_, _, _| (),
                );
                colours.set(i, colour);
            }),
        }
    }
}

/// The terms of a surface's colour in local shading.
#[derive(Debug, Clone, Serialize)]
pub struct SurfaceTerms {
    /// The reflection model: `phong` (base colour times the sum of the terms), `metallic-roughness` (sum of the terms),
    /// `flat` or `unlit`.
    pub model: &'static str,
    /// The base colour.
    pub own: DVec3,
    /// The reflected light, by which the base colour is multiplied; `None` if terms are colours, which are added.
    pub light: Option<DVec3>,
    /// The terms.
    pub terms: Vec<Term>,
}

/// A term of local shading: of emission (`L_e`), ambient light (`L_a`), diffuse (`L_d`) or specular reflection (`L_s`).
#[derive(Debug, Clone, Serialize)]
pub struct Term {
    /// Its name.
    pub name: &'static str,
    /// The name of its light.
    pub light: Option<String>,
    /// The index of its light.
    pub light_index: Option<usize>,
    /// Names and values of its factors, without the radiance of the light.
    #[serde(serialize_with = "as_map")]
    pub factors: Vec<(&'static str, f64)>,
    /// Its value.
    pub value: DVec3,
}

impl Term {
    /// A term without factors.
    fn new(world: &World, name: &'static str, light_index: Option<usize>, value: DVec3) -> Self {
        let light = light_index.map(|index| world.light_name(index));
        Term { name, light, light_index, factors: Vec::new(), value }
    }
}

fn as_map<S: Serializer>(pairs: &[(&'static str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().copied())
}

/// The terms of surface `i` under lights that were sampled there, by the code of [`shade_all`].
pub fn terms_of(
    world: &World,
    mode: ShadingMode,
    surfaces: &InteractionSoa,
    lights: &[Box<LightSoa>],
    i: usize,
) -> SurfaceTerms {
    let surface = surfaces.get(i);
    let texel = |slot| surfaces.texels.get(slot, i);
    let own = base_colour(world, &surface, texel(TextureSlot::BaseColour));
    let mut terms = SurfaceTerms { model: "flat", own, light: None, terms: Vec::new() };
    match &world.materials[surface.material as usize] {
        _ if mode == ShadingMode::Flat => {}
        Material::Phong(material) => return phong::terms(world, material, mode, (surfaces, i), lights),
        Material::MetallicRoughness(material) => {
            terms.model = if material.unlit { "unlit" } else { "metallic-roughness" };
            let reaching = || lights.iter().enumerate().filter(|(_, light)| light.reaches[i]);
            let samples: Vec<LightSample> = reaching().map(|(_, light)| light.get(i)).collect();
            let indices: Vec<usize> = reaching().map(|(index, _)| index).collect();
            let note = |name, light: Option<usize>, value: DVec3| {
                let light = light.map(|index| indices[index]);
                if light.is_some() || value != DVec3::ZERO {
                    terms.terms.push(Term::new(world, name, light, value));
                }
            };
            metallic_roughness::shade(world, material, mode, &surface, texel, &samples, note);
        }
    }
    terms
}
