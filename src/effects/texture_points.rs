//! Texture coordinates and footprints of surfaces, shared by the effects of textures and normal maps.
//!
//! Where a filter needs the footprint of a pixel, rays have differentials ([`crate::world::Differential`]): those of camera rays
//! follow from the direction, those of mirrored rays from the ray and surface before. Surfaces without a texture are skipped.

use std::collections::BTreeSet;

use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::{EffectContext, Hook, PlanSettings, Stage, TextureUse, id, textures};
use crate::scene::{ImageId, Material, ResolvedTextureFilter, TexelEncoding, Texture, TextureSlot};
use crate::world::{Differential, TexturePoint, World};

/// The texture points of a tile.
#[derive(Default)]
pub(crate) struct Buffers {
    /// As [`Tile::generations`]. Entries beyond the current one are stale.
    generations: Vec<GenerationBuffers>,
}

#[derive(Default)]
struct GenerationBuffers {
    /// For each ray, its differential. Empty in generation 0 and where no footprints are needed.
    differentials: Vec<Differential>,
    /// See [`Buffers::points`], by set of texture coordinates.
    points: Vec<Vec<Option<TexturePoint>>>,
}

impl Buffers {
    /// For each surface of a generation, its texture point by a set of texture coordinates; `None` for surfaces without a
    /// texture on that set, empty where all are.
    pub(crate) fn points(&self, generation: usize, set: u8) -> &[Option<TexturePoint>] {
        self.generations[generation].points.get(usize::from(set)).map_or(&[], Vec::as_slice)
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        let bytes = |buffers: &GenerationBuffers| {
            let points = buffers.points.iter().map(vec_bytes).sum::<usize>();
            vec_bytes(&buffers.differentials) + vec_bytes(&buffers.points) + points
        };
        let generations = self.generations.iter().map(bytes).sum::<usize>();
        size_of::<Buffers>() + vec_bytes(&self.generations) + generations
    }
}

impl TextureUse {
    /// Textures that options and the scene file leave on: a superset of the lookups of any plan.
    pub(crate) fn left_on(plan_settings: &PlanSettings) -> Self {
        let is_on = |effect| plan_settings.switch(effect).0 != Some(false);
        TextureUse {
            material_textures: is_on(id::TEXTURES),
            normal_maps: is_on(id::NORMAL_MAPS),
            transport: None,
            filter: plan_settings.switch(id::TEXTURES).1.as_deref().and_then(textures::filter),
        }
    }

    /// The textures of a material that are looked up.
    pub(crate) fn of<C>(
        &self,
        material: &Material<C>,
    ) -> impl Iterator<Item = (TextureSlot, Texture)> + use<C> {
        let TextureUse { material_textures, normal_maps, transport, .. } = *self;
        let is_used = move |slot: TextureSlot| match (slot, transport) {
            (TextureSlot::Normal, _) => normal_maps,
            (_, None) => material_textures && !slot.entry().transports.is_empty(),
            (_, Some(transport)) => material_textures && slot.entry().transports.contains(&transport),
        };
        material.textures().iter().filter(move |(slot, _)| is_used(*slot))
    }

    /// The filter of a texture.
    pub fn filter(&self, texture: &Texture) -> ResolvedTextureFilter {
        texture.sampler.filter(self.filter)
    }

    /// Images of a material that need mip maps, with the encoding of their texels.
    pub(crate) fn mip_maps<C>(
        &self,
        material: &Material<C>,
    ) -> impl Iterator<Item = (ImageId, TexelEncoding)> + use<C> {
        let texture_use = *self;
        let textures =
            self.of(material).filter(move |(_, texture)| texture_use.filter(texture).needs_mip_map());
        textures.map(|(slot, texture)| (texture.image, slot.entry().encoding))
    }

    /// Builds the mip maps that the filters need and that do not exist yet.
    fn make_mip_maps(&self, world: &World) {
        for (image, encoding) in world.materials_in_use().flat_map(|material| self.mip_maps(material)) {
            world.images[image.0 as usize].make_mip_map(encoding);
        }
    }
}

/// The stages of an effect at a hook: before lighting, the texture points where the effect is the first that needs them, then
/// `look_up`.
pub(crate) fn stages(context: &EffectContext, hook: Hook, is_first: bool, look_up: Stage) -> Vec<Stage> {
    let Hook::BeforeLighting(_) = hook else { return Vec::new() };
    let points = is_first.then(|| {
        let points = FindTexturePoints::new(context);
        let find = move |buffers: &mut Buffers, tile: &mut Tile, context: &RenderContext| {
            points.find(buffers, tile, context);
        };
        Stage::with_buffers("texture coordinates", find)
    });
    points.into_iter().chain([look_up]).collect()
}

/// Computes the texture points of the surfaces of a generation.
struct FindTexturePoints {
    /// For each material, the sets of texture coordinates of the textures that are looked up.
    sets: Vec<Vec<u8>>,
    /// Whether footprints are needed.
    footprints: bool,
    /// Whether secondary rays have footprints: mirrored ones. Those that sample a lobe have none, as one texel is a
    /// sample of a filter over it.
    are_mirrored: bool,
    /// The width of a sample in pixels.
    sample_width: f64,
}

impl FindTexturePoints {
    fn new(context: &EffectContext) -> Self {
        let (world, texture_use) = (context.world, context.spec.texture_use);
        texture_use.make_mip_maps(world);
        let of = |material| texture_use.of(material);
        let sets = |material| {
            let sets: BTreeSet<u8> = of(material).map(|(_, texture)| texture.coordinates).collect();
            sets.into_iter().collect()
        };
        FindTexturePoints {
            sets: world.materials.iter().map(sets).collect(),
            footprints: world
                .materials_in_use()
                .flat_map(of)
                .any(|(_, texture)| texture_use.filter(&texture).needs_footprint()),
            are_mirrored: context.spec.secondary.is_some_and(|rays| rays.are_mirrored),
            sample_width: sample_width(context.spec.samples),
        }
    }
}

/// The width of a sample in pixels for this many samples a pixel (Pharr, Jakob and Humphreys, Physically Based Rendering, 4th
/// edition, 2023, section 10.1.3).
fn sample_width(samples: u32) -> f64 {
    1.0 / f64::from(samples.max(1)).sqrt()
}

impl FindTexturePoints {
    fn find(&self, buffers: &mut Buffers, tile: &Tile, context: &RenderContext) {
        let (current, generation) = (tile.current, &tile.generations[tile.current]);
        if buffers.generations.len() <= current {
            buffers.generations.resize_with(current + 1, GenerationBuffers::default);
        }
        let (before, after) = buffers.generations.split_at_mut(current);
        let GenerationBuffers { differentials, points } = &mut after[0];
        let footprints = self.footprints && (tile.depth == 0 || self.are_mirrored);
        if footprints && tile.depth > 0 {
            let (from, before) = (&tile.generations[current - 1], &before[current - 1].differentials);
            let differential = |ray: usize| self.differential(context, from, before, ray);
            differentials.clear();
            differentials.extend(mirrored(context.world, from, generation, differential));
        }
        points.iter_mut().for_each(Vec::clear);
        let surfaces = &generation.surfaces;
        let parts = surfaces.by_material().iter();
        let parts = parts.flat_map(|(m, range)| self.sets[*m as usize].iter().map(move |set| (*set, range)));
        for (set, range) in parts {
            if points.len() <= usize::from(set) {
                points.resize_with(usize::from(set) + 1, Vec::new);
            }
            let points = &mut points[usize::from(set)];
            points.resize(surfaces.len(), None);
            for i in range.clone() {
                let ray = surfaces.ray_of()[i] as usize;
                let differential =
                    footprints.then(|| self.differential(context, generation, differentials, ray));
                let ray = &generation.rays.get(ray);
                let hit = (surfaces.objects()[i], &surfaces.hit(i), surfaces.geometric_normal.get(i));
                points[i] = context.world.texture_point(hit, ray, differential.as_ref(), set);
            }
        }
    }

    /// The differential of a ray: its entry in `secondary`, which is empty for generation 0, or that of a camera ray.
    fn differential(
        &self,
        context: &RenderContext,
        generation: &RayGeneration,
        secondary: &[Differential],
        ray: usize,
    ) -> Differential {
        match secondary.get(ray) {
            Some(differential) => *differential,
            None => context.view.differential(generation.rays.get(ray).direction()).scaled(self.sample_width),
        }
    }
}

/// The differentials of the rays of generation `to`, mirrored by surfaces of generation `from`. `differential` gives those of the rays
/// of `from`.
fn mirrored<'a>(
    world: &'a World,
    from: &'a RayGeneration,
    to: &'a RayGeneration,
    differential: impl Fn(usize) -> Differential + 'a,
) -> impl Iterator<Item = Differential> + 'a {
    to.sources.iter().map(move |&source| {
        let ray = from.surfaces.ray_of()[source as usize] as usize;
        let surface = from.surfaces.get(source as usize);
        world.mirrored_differential(&surface, &from.rays.get(ray), &differential(ray))
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
