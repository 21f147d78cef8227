//! Glaze: a weak mirror reflection over a surface.
//!
//! The assignment's report: a ray leaves the point along `r = d - 2 N (d.N)`. If it hits something of colour C_I, the surface's
//! colour becomes `own_weight * C + weight * C_I`; if it hits nothing, the colour stays as it is.
//!
//! # Path termination
//! A path ends after its bounces, and earlier where continuing could not show. The colour at the end of a path enters its pixel
//! with the product W of the weights along the path (its throughput). Casting no ray from there changes that colour by at most the
//! largest colour M of the scene (both weights are 0 to 1), and the pixel by at most W M. A path ends where W < 2^-53, half the
//! spacing of f64 at white. Then W M is no larger than the rounding of the sum for colours up to white. For lights a million times
//! as bright it is 2^-33, while the steps of 8-bit output are 2^-8 apart in `display` and 2^-11.7 (1 / (255 * 12.92)) or more in
//! `linear`, where the sRGB curve is steepest at black. The film rounds the sum to f32 before it is quantised, so 8-bit output
//! can change only if the f64 sum lies within W M of one of 255 numbers, those halfway between the two f32 values beside a step: for
//! colours up to white, with a probability of 2^-44 per channel. The f32 values of an EXR can differ by one unit in the last
//! place, with a probability of 2^-28 for colours around white and more for darker ones; `--with glaze=every-bounce` never ends a
//! path early. In `u8` every mix is rounded, and rounding can amplify any change, so paths do not end early there.

use std::ops::Range;

use glam::DVec3;

use crate::bvh::Ray;
use crate::bvh::detail::{Precision, RayBuffer};
use crate::effects::record::GlazeRecord;
use crate::effects::recorder::Recorder;
use crate::effects::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use crate::effects::{
    Effect, EffectContext, EffectValue, Hook, RayClass, RayKind, SecondaryRays, Stage, id, named,
};
use crate::film::ColourPipeline;
use crate::scene::{Glaze, Material, ValueKind};
use crate::world::{
    InteractionSoa, PreparedMaterial, RAYS_PER_BATCH, SurfaceInteraction, Vec3Soa, World, simd,
};

/// Mirrored rays.
pub const RAYS: RayKind = RayKind { name: "glaze", is_shadow: false, colour: [120, 230, 150] };

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::GLAZE,
    summary: "mirror reflections of glazed materials",
    source: "Whitted, An Improved Illumination Model for Shaded Display, 1980",
    is_shading: true,
    rays: &[RAYS],
    value: Some(EffectValue {
        meaning: "number of bounces",
        placeholder: "BOUNCES|every-bounce",
        kind: || ValueKind::Number { range: [1.0, f64::from(u32::MAX)], is_whole: true },
        check: |value| match value.parse::<u32>() {
            Ok(1..) => Ok(()),
            _ if value == EVERY_BOUNCE => Ok(()),
            _ => Err(format!("give the maximum number of bounces, from 1, or `{EVERY_BOUNCE}`")),
        },
    }),
    called_for: |world: &World, _| {
        let glazed = world.materials_in_use().filter(|material| mirror(material).is_some());
        named("material", glazed.map(Material::name))
            .ok_or_else(|| "no object is of a glazed material".into())
    },
    specify: |context, spec| {
        spec.generations_with_origins = spec.generations_with_origins.max(most_bounces(context));
        spec.secondary =
            Some(SecondaryRays { kind: RAYS, hits: "glaze hits", effect: id::GLAZE, are_mirrored: true });
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::AfterShading(RayClass::Secondary) if most_bounces(context) < 2 => Vec::new(),
        Hook::AfterShading(_) => {
            let reflect = Reflect { min_weight: min_weight(context), most: most_bounces(context) };
            vec![Stage::with_buffers("glaze rays", move |buffers, tile, context| {
                reflect.reflect(buffers, tile, context.world);
            })]
        }
        Hook::AfterGenerations => vec![Stage::new("glaze mixing", combine)],
        _ => Vec::new(),
    },
    bytes: |tile| {
        let generations: usize = tile.generations.iter().skip(1).map(RayGeneration::bytes).sum();
        tile.buffers::<Buffers>().map_or(0, |Buffers { glazed, weights, next_weights }| {
            let lists = vec_bytes(glazed) + vec_bytes(weights) + vec_bytes(next_weights);
            size_of::<Buffers>() + lists + generations
        })
    },
    ..Effect::NONE
};

/// The value that lets every path take all its bounces.
const EVERY_BOUNCE: &str = "every-bounce";

/// The throughput below which paths end: half the spacing of f64 at 1.
const MIN_WEIGHT: f64 = f64::EPSILON / 2.0;

/// The throughput below which paths end; 0 where none can end early.
fn min_weight(context: &EffectContext) -> f64 {
    let world = context.world;
    let weights = world.materials_in_use().filter_map(|material| Some(mirror(material)?.weight));
    // The throughput bound of a path to the last surface that can cast a ray.
    let least = weights.fold(0.0, f64::max).powf(f64::from(most_bounces(context).saturating_sub(1)));
    let never = context.value.as_deref() == Some(EVERY_BOUNCE)
        || world.pipeline == ColourPipeline::U8
        || least >= MIN_WEIGHT;
    if never { 0.0 } else { MIN_WEIGHT }
}

/// The glaze of a material; `None` where it has none or one that shows nothing.
fn mirror(material: &PreparedMaterial) -> Option<&Glaze> {
    material.glaze().filter(|glaze| glaze.bounces > 0 && glaze.weight > 0.0)
}

/// The maximum of the materials' bounces, limited by the effect's value.
fn most_bounces(context: &EffectContext) -> u32 {
    let mirrors = context.world.materials_in_use().filter_map(|material| mirror(material));
    let limit = context.value.as_ref().and_then(|value| value.parse().ok()).unwrap_or(u32::MAX);
    mirrors.map(|glaze| glaze.bounces).max().unwrap_or(0).min(limit)
}

/// Temporary buffers of [`Reflect`].
#[derive(Default)]
struct Buffers {
    /// The ranges of surfaces that cast rays.
    glazed: Vec<Range<usize>>,
    /// For each ray of the generation, the throughput of its path. Only where paths can end early.
    weights: Vec<f64>,
    /// The same for the next generation.
    next_weights: Vec<f64>,
}

/// Casts mirrored rays from the glazed surfaces of a generation: fills the next one.
struct Reflect {
    /// The throughput below which paths end.
    min_weight: f64,
    /// The limit on bounces.
    most: u32,
}

impl Reflect {
    fn reflect(&self, buffers: &mut Buffers, tile: &mut Tile, world: &World) {
        let Tile { depth, current, .. } = *tile;
        self.find_glazed(&mut buffers.glazed, &tile.generations[current].surfaces, depth, world);
        if buffers.glazed.is_empty() && tile.generations.len() == current + 1 {
            // The next generation does not exist; otherwise it has to be emptied.
            return;
        }
        let precision = world.numerics().ray_precision();
        let (generation, next) = tile.this_and_next();
        let RayGeneration { surfaces, origins, .. } = generation;
        let RayGeneration { sources, camera_rays, rays, .. } = next;
        sources.clear();
        camera_rays.clear();
        rays.clear();
        let Some(origins) = origins else { return };
        let mut all_leave = true;
        for range in &buffers.glazed {
            sources.extend(range.start as u32..range.end as u32);
            all_leave &= match precision {
                Precision::Single => simd!(mirrored_rays(surfaces, range, origins, Precision::Single, rays)),
                Precision::Double => simd!(mirrored_rays(surfaces, range, origins, Precision::Double, rays)),
            };
        }
        if self.min_weight > 0.0 {
            if depth == 0 {
                buffers.weights.clear();
                buffers.weights.resize(RAYS_PER_BATCH, 1.0);
            }
            end_light_paths(buffers, self.min_weight, surfaces, sources, world);
        }
        if !all_leave {
            for &source in &*sources {
                let source = source as usize;
                rays.set(source, &mirrored_ray(origins.get(source), &surfaces.get(source), precision));
            }
        }
        rays.keep(sources);
    }

    /// Finds the surfaces whose material casts a ray at this depth; adjacent ranges are joined.
    fn find_glazed(
        &self,
        glazed: &mut Vec<Range<usize>>,
        surfaces: &InteractionSoa,
        depth: usize,
        world: &World,
    ) {
        glazed.clear();
        for (material, range) in surfaces.by_material() {
            if mirror(&world.materials[*material as usize])
                .is_some_and(|glaze| depth < glaze.bounces.min(self.most) as usize)
            {
                match glazed.last_mut() {
                    Some(last) if last.end == range.start => last.end = range.end,
                    _ => glazed.push(range.clone()),
                }
            }
        }
    }
}

/// Removes from `sources` the surfaces whose path has a throughput below `min_weight`, and updates the throughputs.
fn end_light_paths(
    buffers: &mut Buffers,
    min_weight: f64,
    surfaces: &InteractionSoa,
    sources: &mut Vec<u32>,
    world: &World,
) {
    let Buffers { weights, next_weights, .. } = buffers;
    next_weights.clear();
    sources.retain(|&source| {
        let path = weights[surfaces.ray_of()[source as usize] as usize];
        let material = &world.materials[surfaces.materials()[source as usize] as usize];
        let continues = path >= min_weight;
        if continues {
            next_weights.push(path * mirror(material).map_or(0.0, |glaze| glaze.weight));
        }
        continues
    });
    std::mem::swap(weights, next_weights);
}

/// Writes the mirrored rays of the surfaces in `range`. Returns whether all of them point out of their surface.
#[inline(always)]
fn mirrored_rays(
    surfaces: &InteractionSoa,
    range: &Range<usize>,
    origins: &Vec3Soa,
    precision: Precision,
    rays: &mut RayBuffer,
) -> bool {
    let mut all_leave = true;
    rays.write(
        range.clone(),
        #[inline(always)]
        |i| {
            let mirrored = mirrored(surfaces.view.get(i), surfaces.shading_normal.get(i));
            let ray = precision.ray(origins.get(i), mirrored, 0.0, f64::INFINITY);
            all_leave &= ray.direction().dot(surfaces.geometric_normal.get(i)) > 0.0;
            ray
        },
    );
    all_leave
}

#[inline(always)]
fn mirrored(view: DVec3, normal: DVec3) -> DVec3 {
    2.0 * view.dot(normal) * normal - view
}

/// Mixes the colours of a generation into the surfaces of the one before that cast its rays.
fn combine(tile: &mut Tile, context: &RenderContext) {
    let (generation, next) = tile.this_and_next();
    let world = context.world;
    let (Some(colours), Some(next_colours)) = (&mut generation.colours, &next.colours) else { return };
    let mut mix = |ray: usize, mirrored: DVec3| {
        let source = next.sources[ray] as usize;
        let material = generation.surfaces.materials()[source] as usize;
        if let Some(glaze) = world.materials[material].glaze() {
            let colour = colours.get(source);
            let mixed = world.pipeline.weighted_combine(colour, mirrored, glaze.own_weight, glaze.weight);
            colours.set(source, mixed);
        }
    };
    for (i, &ray) in next.surfaces.ray_of().iter().enumerate() {
        mix(ray as usize, next_colours.get(i));
    }
    // Mirrored rays see the environment, as scattered ones do in path tracing, even where it is no background.
    if let Some(environment) = &world.environment {
        for (ray, _) in next.hits.iter().enumerate().filter(|(_, hit)| hit.is_none()) {
            mix(ray, environment.eval(next.rays.get(ray).direction()));
        }
    }
    tile.record(|recorder, tile| record(recorder, tile, world));
}

/// Records the colours that were blended at the surfaces of the current generation.
#[cold]
fn record(recorder: &mut Recorder, tile: &Tile, world: &World) {
    let [generation, next] = [0, 1].map(|more| &tile.generations[tile.current + more]);
    let (Some(colours), Some(next_colours)) = (&generation.colours, &next.colours) else { return };
    for (i, record) in recorder.surfaces(tile.depth) {
        let glaze = world.materials[generation.surfaces.materials()[i] as usize].glaze();
        let ray = next.sources.iter().position(|&source| source as usize == i);
        let (Some(local), Some(glaze), Some(ray)) = (&mut record.local, glaze, ray) else { continue };
        let mirrored = match next.surfaces.ray_of().iter().position(|&of| of as usize == ray) {
            Some(surface) => Some(next_colours.get(surface)),
            None => world.environment.as_ref().map(|light| light.eval(next.rays.get(ray).direction())),
        };
        let weights = [glaze.own_weight, glaze.weight];
        local.glaze = mirrored.map(|mirrored| GlazeRecord { mirrored, weights, colour: colours.get(i) });
    }
}

/// The mirrored ray from `origin`, on the side that is seen. Where an interpolated normal or rounding would make it point into the
/// surface, it is turned to just above it.
pub fn mirrored_ray(origin: DVec3, surface: &SurfaceInteraction, precision: Precision) -> Ray {
    let (normal, outer) = (surface.shading_normal, surface.geometric_normal);
    let mirrored = mirrored(surface.view, normal);
    let ray = precision.ray(origin, mirrored, 0.0, f64::INFINITY);
    let height = ray.direction().dot(outer);
    if height > 0.0 {
        return ray;
    }
    precision.ray(origin, lifted(mirrored, outer, precision), 0.0, f64::INFINITY)
}

/// `direction` turned to rise above the surface by 16 units of rounding, so that the rounded direction still rises.
fn lifted(direction: DVec3, outer: DVec3, precision: Precision) -> DVec3 {
    let beside = |v: DVec3| v - v.dot(outer) * outer;
    let rise = 16.0 * precision.epsilon();
    // A direction straight into the surface has no tangential part but rounding noise. Projecting a second time tells them apart:
    // a true tangential direction keeps its length, noise does not.
    let along = beside(direction).try_normalize().map(beside).filter(|along| along.length_squared() > 0.5);
    along.map_or(outer, |along| (along.normalize() + rise * outer).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Hit, PrimId, SlotId};
    use proptest::prelude::*;

    /// A surface seen from `height` above its plane, its shading normal bent; `None` where that leaves the hemisphere.
    fn surface(normal: [f64; 3], along: [f64; 3], height: f64, bend: [f64; 3]) -> Option<SurfaceInteraction> {
        let outer = DVec3::from(normal).try_normalize()?;
        let along = DVec3::from(along);
        let along = (along - along.dot(outer) * outer).normalize_or(outer.any_orthonormal_vector());
        let smooth = (outer + DVec3::from(bend)).normalize();
        let hit = Hit { t: 1.0, prim: PrimId(0), slot: SlotId::new(0), barycentrics: [0.0; 2] };
        let view = (along + height * outer).normalize();
        (smooth.dot(outer) > 0.0).then_some(SurfaceInteraction {
            geometric_normal: outer,
            shading_normal: smooth,
            ..SurfaceInteraction::facing(view, hit, 0, 0)
        })
    }

    /// The cosine between the mirrored ray and the geometric normal.
    fn rise(surface: &SurfaceInteraction, precision: Precision) -> f64 {
        mirrored_ray(DVec3::ZERO, surface, precision).direction().dot(surface.geometric_normal)
    }

    #[test]
    fn a_ray_that_is_mirrored_straight_into_the_surface_leaves_it() {
        // A shading normal turned by 45 degrees, seen along the surface, mirrors straight down; the tangential part that is left
        // is rounding.
        for k in 0..1000 {
            let angle = f64::from(k);
            let (normal, along) = ([angle.cos(), 0.3, angle.sin()], [angle.sin(), 0.1, -angle.cos()]);
            let outer = DVec3::from(normal).normalize();
            let along = DVec3::from(along) - DVec3::from(along).dot(outer) * outer;
            let bend = (-along.normalize() * (1.0 - 1e-15)).to_array();
            let surface =
                surface(normal, along.to_array(), 1e-12, bend).expect("bent by less than a right angle");
            for precision in [Precision::Single, Precision::Double] {
                assert!(rise(&surface, precision) > 0.0, "{surface:?}");
            }
        }
    }

    proptest! {
        /// No mirrored ray points into the surface, for any grazing angle and shading normal.
        #[test]
        fn mirrored_rays_leave(
            normal in prop::array::uniform3(-1.0f64..1.0),
            along in prop::array::uniform3(-1.0f64..1.0),
            height in prop::sample::select(vec![1e-12, 1e-9, 1e-8, 1e-7, 1e-4, 0.1, 1.0]),
            bend in prop::array::uniform3(-0.5f64..0.5),
        ) {
            let Some(surface) = surface(normal, along, height, bend) else { return Ok(()) };
            for precision in [Precision::Single, Precision::Double] {
                prop_assert!(rise(&surface, precision) > 0.0);
            }
        }
    }
}
