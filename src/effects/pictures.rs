//! Where surfaces are in the pictures of their materials: what textures and normal maps both go by.
//!
//! Where a filter asks how much of a picture a pixel sees, rays carry how they change from pixel to pixel (ray
//! differentials; see [`crate::world::Differential`]), from the camera and through mirrors. Nothing of this is done for
//! surfaces whose materials have no picture to look up.

use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Hook, Pictures, Stage};
use crate::scene::Filter;
use crate::world::{Differential, LoweredMaterial, LoweredTexture, Meaning, TexturePoint, World};

/// What is kept of every level.
#[derive(Default)]
pub struct Buffers {
    /// By their depth; those beyond the current one are left over from other tiles.
    levels: Vec<OfLevel>,
}

#[derive(Default)]
struct OfLevel {
    /// For each ray, how it changes from pixel to pixel; on levels beyond the first, where footprints are wanted.
    differentials: Vec<Differential>,
    /// For each surface, where it is in its pictures, if it is in any; empty where none is.
    points: Vec<Option<TexturePoint>>,
}

impl Buffers {
    /// For each surface of a level, where it is in its pictures, if it is in any; empty where none is.
    pub fn points(&self, depth: usize) -> &[Option<TexturePoint>] {
        &self.levels[depth].points
    }

    /// Its size in bytes.
    pub fn bytes(&self) -> usize {
        let own = |level: &OfLevel| vec_bytes(&level.differentials) + vec_bytes(&level.points);
        size_of::<Buffers>() + vec_bytes(&self.levels) + self.levels.iter().map(own).sum::<usize>()
    }
}

impl Pictures {
    /// The pictures of a material that are looked up, with what their values mean.
    fn of<'a>(&self, material: &'a LoweredMaterial) -> impl Iterator<Item = (LoweredTexture, Meaning)> + 'a {
        let Pictures { textures, normal_maps, .. } = *self;
        let map = material.normal_map().filter(|_| normal_maps).map(|map| (map.texture, Meaning::Numbers));
        material.textures().filter(move |_| textures).chain(map)
    }

    /// How a picture is looked up.
    pub fn filter(&self, texture: &LoweredTexture) -> Filter {
        texture.sampler.filter(self.filter)
    }

    /// Makes the pyramids that are asked for, where there are none yet.
    fn make_pyramids(&self, world: &World) {
        let pictures = world.materials_in_use().flat_map(|(_, material)| self.of(material));
        for (texture, meaning) in pictures.filter(|(texture, _)| self.filter(texture).needs_pyramid()) {
            world.images[texture.image as usize].make_pyramid(meaning);
        }
    }
}

/// The stages of an effect at a hook: before lights are looked at, surfaces are found in their pictures, by the first effect
/// that asks, and `look_up` follows.
pub fn stages(
    asked: &Asked,
    hook: Hook,
    is_first: bool,
    look_up: impl Stage + 'static,
) -> Vec<Box<dyn Stage>> {
    let Hook::BeforeLighting(_) = hook else { return Vec::new() };
    let mut stages: Vec<Box<dyn Stage>> = Vec::new();
    if is_first {
        stages.push(Box::new(Locate::new(asked)));
    }
    stages.push(Box::new(look_up));
    stages
}

/// Finds where the surfaces of a level are in their pictures.
struct Locate {
    /// For each material, whether it is asked.
    wanted: Vec<bool>,
    /// Whether footprints are wanted.
    footprints: bool,
    /// How wide a sample is in pixels.
    sample_width: f64,
}

impl Locate {
    fn new(asked: &Asked) -> Self {
        let (world, pictures) = (asked.world, asked.outline.pictures);
        pictures.make_pyramids(world);
        let of = |material| pictures.of(material);
        Locate {
            wanted: world.materials.iter().map(|material| of(material).next().is_some()).collect(),
            footprints: world
                .materials_in_use()
                .flat_map(|(_, material)| of(material))
                .any(|(texture, _)| pictures.filter(&texture).needs_footprint()),
            sample_width: sample_width(asked.outline.samples),
        }
    }
}

/// How wide a sample is in pixels, of so many: each sees as much less (Pharr, Jakob and Humphreys, Physically Based
/// Rendering, 4th edition, 2023, section 10.1.3).
fn sample_width(samples: u32) -> f64 {
    1.0 / f64::from(samples.max(1)).sqrt()
}

impl Stage for Locate {
    fn name(&self) -> &'static str {
        "texture coordinates"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|own: &mut Buffers, tile| self.locate(own, tile, context));
    }
}

impl Locate {
    fn locate(&self, own: &mut Buffers, tile: &Tile, context: &Context) {
        let (depth, level) = (tile.depth, &tile.levels[tile.depth]);
        if own.levels.len() <= depth {
            own.levels.resize_with(depth + 1, OfLevel::default);
        }
        let (before, after) = own.levels.split_at_mut(depth);
        let OfLevel { differentials, points } = &mut after[0];
        if self.footprints && depth > 0 {
            let before = &before[depth - 1].differentials;
            let differential = |ray: usize| self.differential(context, &tile.levels[depth - 1], before, ray);
            differentials.clear();
            differentials.extend(mirrored(context.world, &tile.levels[depth - 1], level, differential));
        }
        points.clear();
        let surfaces = &level.surfaces;
        for (_, range) in surfaces.by_material().iter().filter(|(m, _)| self.wanted[*m as usize]) {
            points.resize(surfaces.len(), None);
            for i in range.clone() {
                let ray = surfaces.ray_of()[i] as usize;
                let Some(hit) = &level.hits[ray] else { continue };
                let differential =
                    self.footprints.then(|| self.differential(context, level, differentials, ray));
                let surface = surfaces.get(i);
                points[i] =
                    context.world.texture_point(&surface, hit, &level.rays[ray], differential.as_ref());
            }
        }
    }

    /// The differential of a ray of a level: `further` has those of levels beyond the first, which begins anew.
    fn differential(
        &self,
        context: &Context,
        level: &Level,
        further: &[Differential],
        ray: usize,
    ) -> Differential {
        match further.get(ray) {
            Some(differential) => *differential,
            None => context.view.differential(level.rays[ray].direction).scaled(self.sample_width),
        }
    }
}

/// The differentials of the rays of level `to`, which surfaces of level `from` mirrored.
fn mirrored<'a>(
    world: &'a World,
    from: &'a Level,
    to: &'a Level,
    differential: impl Fn(usize) -> Differential + 'a,
) -> impl Iterator<Item = Differential> + 'a {
    to.sources.iter().map(move |&source| {
        let ray = from.surfaces.ray_of()[source as usize] as usize;
        let surface = from.surfaces.get(source as usize);
        from.hits[ray].map_or(Differential::default(), |hit| {
            world.mirrored_differential(&surface, &hit, &from.rays[ray], &differential(ray))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_share_a_pixel() {
        assert_eq!([1, 4, 16].map(sample_width), [1.0, 0.5, 0.25]);
        assert_eq!(sample_width(0), 1.0);
    }
}
