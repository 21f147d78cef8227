//! Textures: what the pictures of materials say of the surfaces that have them, and of no others.
//!
//! Where a filter asks how much of a picture a pixel sees, rays carry how they change from pixel to pixel (ray
//! differentials; see [`crate::world::Differential`]), from the camera and through mirrors.

use std::sync::Arc;

use super::tile::{Context, Level, Tile};
use super::{Effect, Stage};
use crate::scene::TextureFilter;
use crate::shading::texture::look_up;
use crate::world::{Differential, LoweredMaterial, LoweredTexture, Meaning, Texels, World};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "textures",
    summary: "pictures on surfaces: nearest, bilinear, mipmap or anisotropic; their own sampler's, if not said",
    needs_lights: false,
    called_for: |world: &World| match used(world).filter(|material| material.textures().count() > 0).count() {
        0 => Err("no material has a picture".into()),
        n => Ok(format!("{n} material(s) with pictures")),
    },
};

/// The materials of all objects, each as often as there are objects of it.
fn used(world: &World) -> impl Iterator<Item = &LoweredMaterial> {
    let mut is_used = vec![false; world.materials.len()];
    world.objects.iter().for_each(|object| is_used[object.material as usize] = true);
    world.materials.iter().zip(is_used).filter(|(_, used)| *used).map(|(material, _)| material)
}

/// What all stages that look pictures up go by.
#[derive(Clone)]
pub struct Pictures {
    /// The user's filter.
    pub filter: Option<TextureFilter>,
    /// Whether footprints are carried along.
    pub footprints: bool,
    /// For each material, whether it is asked where its surfaces are in pictures.
    wanted: Arc<[bool]>,
    /// How wide a sample is in pixels.
    sample_width: f64,
}

impl Pictures {
    /// Finds which materials and filters there are to ask, and makes the pyramids that those need.
    ///
    /// `samples` is the number of rays a pixel: with several, each sees as much less of a picture (Pharr, Jakob and Humphreys,
    /// Physically Based Rendering, 4th edition 2023, section 10.1.3, scales differentials by 1 / sqrt(samples)).
    pub fn new(
        world: &World,
        textures: bool,
        normal_maps: bool,
        filter: Option<TextureFilter>,
        samples: u32,
    ) -> Self {
        let of = |material: &LoweredMaterial| {
            let maps = material.normal_map().filter(|_| normal_maps).map(|m| (m.texture, Meaning::Numbers));
            material.textures().filter(|_| textures).chain(maps).collect::<Vec<_>>()
        };
        let asked = |texture: &LoweredTexture| texture.sampler.filter(filter);
        for (texture, meaning) in used(world).flat_map(of).filter(|(t, _)| asked(t).needs_pyramid()) {
            world.images[texture.image as usize].make_pyramid(meaning);
        }
        Pictures {
            filter,
            footprints: used(world).flat_map(of).any(|(texture, _)| asked(&texture).needs_footprint()),
            wanted: world.materials.iter().map(|material| !of(material).is_empty()).collect(),
            sample_width: 1.0 / f64::from(samples.max(1)).sqrt(),
        }
    }

    /// The differential of a ray of a level.
    fn differential(&self, context: &Context, index: usize, level: &Level, ray: usize) -> Differential {
        match index {
            0 => context.view.differential(level.rays[ray].direction).scaled(self.sample_width),
            _ => level.differentials[ray],
        }
    }
}

/// Finds where the surfaces of a level are in their pictures.
pub struct Locate {
    /// Which level.
    pub level: usize,
    /// What is asked for.
    pub pictures: Pictures,
}

impl Stage for Locate {
    fn name(&self) -> &'static str {
        "texture coordinates"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let mut points = std::mem::take(&mut tile.levels[self.level].texture_points);
        points.clear();
        let level = &tile.levels[self.level];
        let surfaces = &level.surfaces;
        for (material, range) in surfaces.by_material() {
            if !self.pictures.wanted[*material as usize] {
                continue;
            }
            points.resize(surfaces.len(), None);
            for i in range.clone() {
                let ray = surfaces.ray_of()[i] as usize;
                let Some(hit) = &level.hits[ray] else { continue };
                let differential = self
                    .pictures
                    .footprints
                    .then(|| self.pictures.differential(context, self.level, level, ray));
                let (surface, ray) = (surfaces.get(i), &level.rays[ray]);
                points[i] = context.world.texture_point(&surface, hit, ray, differential.as_ref());
            }
        }
        tile.levels[self.level].texture_points = points;
    }
}

/// Follows footprints through the mirrors of a level, onto the next one.
pub struct Follow {
    /// Which level.
    pub from: usize,
    /// What is asked for.
    pub pictures: Pictures,
}

impl Stage for Follow {
    fn name(&self) -> &'static str {
        "texture footprints"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let (before, after) = tile.levels.split_at_mut(self.from + 1);
        let (level, next) = (&before[self.from], &mut after[0]);
        next.differentials.clear();
        for &source in &next.sources {
            let ray = level.surfaces.ray_of()[source as usize] as usize;
            let differential = self.pictures.differential(context, self.from, level, ray);
            let surface = level.surfaces.get(source as usize);
            next.differentials.push(level.hits[ray].map_or(differential, |hit| {
                context.world.mirrored_differential(&surface, &hit, &level.rays[ray], &differential)
            }));
        }
    }
}

/// Looks up the pictures of the surfaces of a level.
pub struct Textures {
    /// Which level.
    pub level: usize,
    /// What is asked for.
    pub pictures: Pictures,
}

impl Stage for Textures {
    fn name(&self) -> &'static str {
        "textures"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Level { surfaces, texture_points, .. } = &mut tile.levels[self.level];
        if texture_points.is_empty() {
            return;
        }
        let mut texels = std::mem::take(&mut surfaces.texels);
        texels.resize(surfaces.len(), Texels::default());
        for (material, range) in surfaces.by_material() {
            let material = &context.world.materials[*material as usize];
            let look_up_all = |texture: &Option<LoweredTexture>, meaning, texels: &mut [Texels], set: Set| {
                let Some(texture) = texture else { return };
                let image = &context.world.images[texture.image as usize];
                let filter = texture.sampler.filter(self.pictures.filter);
                for (texels, point) in texels.iter_mut().zip(&texture_points[range.clone()]) {
                    if let Some(point) = point {
                        set(texels, look_up(image, meaning, &texture.sampler, &filter, point));
                    }
                }
            };
            let texels = &mut texels[range.clone()];
            match material {
                LoweredMaterial::Phong(m) => {
                    look_up_all(&m.texture, Meaning::Colours, texels, |t, c| t.colour = c);
                }
                LoweredMaterial::MetallicRoughness(m) => {
                    look_up_all(&m.base_colour_texture, Meaning::Colours, texels, |t, c| t.colour = c);
                    look_up_all(&m.metallic_roughness_texture, Meaning::Numbers, texels, |t, c| {
                        (t.roughness, t.metallic) = (c.y, c.z);
                    });
                    look_up_all(&m.emission_texture, Meaning::Colours, texels, |t, c| t.emission = c);
                }
            }
        }
        surfaces.texels = texels;
    }
}

/// Where what a picture shows goes.
type Set = fn(&mut Texels, glam::DVec3);
