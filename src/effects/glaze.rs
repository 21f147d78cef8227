//! Glaze: a faint mirror over a surface.
//!
//! The assignment's report: a ray from the point along `r = d - 2 N (d.N)`; if it hits something of colour C_I, the
//! surface's colour becomes `own_weight * C + weight * C_I`; if it hits nothing, the colour stays as it is.
//!
//! # When a path stops
//! After its bounces, and before where going on could not show. The colour of a surface that a path has come to counts in its
//! pixel by the product W of the weights on the way. Not sending a ray from there changes it by at most the largest colour M around
//! (both weights are 0 to 1), and the pixel by at most W M. A path stops where W < 2^-53, half the step of f64 at white:
//! then W M is no more than the sum's own rounding does for colours up to white, and for lights a million times as bright it is
//! 2^-33, where the steps of eight bits are 2^-8 apart in `display` and 2^-11.7 (1 / (255 * 12.92)) or more in `linear`, the
//! sRGB curve being steepest at black. Between sum and steps the film rounds to f32, so eight bits can change only if the f64 sum
//! lies within W M of one of 255 numbers, those halfway between the two f32 beside a step: for colours up to white that is a chance of
//! 2^-44 a channel. The f32 of an EXR can differ by a step, with a chance of 2^-28 for colours around white and more for darker ones;
//! `--with glaze=every-bounce` never stops. In `u8` every mixing rounds, and a rounding can carry the least change on, so
//! there paths do not stop.

use std::ops::Range;

use glam::DVec3;

use super::tile::{Context, Level, Tile, vec_bytes};
use super::{Asked, Depth, Effect, Further, Hook, RayKind, Stage, Value, named};
use crate::film::ColourPipeline;
use crate::geometry::{Precision, Ray};
use crate::scene::Glaze;
use crate::world::{LANES, Lanes, LoweredMaterial, RayLanes, Surface, Surfaces, World, widely};

const NAME: &str = "glaze";

/// Mirrored by a glazed surface.
const RAYS: RayKind = RayKind(NAME);

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: NAME,
    summary: "glazed materials mirror what is around them",
    needs_lights: false,
    is_shading: true,
    rays: &[RAYS],
    value: Some(Value {
        meaning: "rule for stopping",
        check: |value| match value.parse::<u32>() {
            Ok(1..) => Ok(()),
            _ if value == EVERY_BOUNCE => Ok(()),
            _ => Err(format!("give the most bounces, a number from 1, or `{EVERY_BOUNCE}`")),
        },
    }),
    called_for: |world: &World, _| {
        let glazed = world.materials_in_use().filter(|(_, material)| mirror(material).is_some());
        let names: Vec<&str> = glazed.map(|(name, _)| name).collect();
        named("material", &names).ok_or_else(|| "no object is of a glazed material".into())
    },
    outline: |asked, outline| {
        outline.leaving = outline.leaving.max(most_bounces(asked));
        outline.further = Some(Further { kind: RAYS, hits: "glaze hits", effect: NAME });
    },
    stages: |asked: &Asked, hook| match hook {
        Hook::AfterShading(Depth::Further) if most_bounces(asked) < 2 => Vec::new(),
        Hook::AfterShading(_) => {
            vec![Box::new(Reflect { least: least_weight(asked), most: most_bounces(asked) })]
        }
        Hook::AfterLevels => vec![Box::new(Combine)],
        _ => Vec::new(),
    },
    bytes: |tile| {
        let levels: usize = tile.levels.iter().skip(1).map(Level::bytes).sum();
        let own = tile.kept::<Buffers>().map_or(0, |Buffers { glazed, weights, next_weights }| {
            size_of::<Buffers>() + vec_bytes(glazed) + vec_bytes(weights) + vec_bytes(next_weights)
        });
        levels + own
    },
};

/// The value that lets paths go on to their last bounce.
const EVERY_BOUNCE: &str = "every-bounce";

/// A path of less weight stops: half the step of f64 at 1.
const LEAST_WEIGHT: f64 = f64::EPSILON / 2.0;

/// The weight below which paths stop; 0 where none does.
fn least_weight(asked: &Asked) -> f64 {
    let world = asked.world;
    let weights = world.materials_in_use().filter_map(|(_, material)| Some(mirror(material)?.weight));
    // Of the path to the last surface that could send a ray.
    let least = weights.fold(0.0, f64::max).powf(f64::from(most_bounces(asked).saturating_sub(1)));
    let never = asked.value.as_deref() == Some(EVERY_BOUNCE)
        || world.pipeline == ColourPipeline::U8
        || least >= LEAST_WEIGHT;
    if never { 0.0 } else { LEAST_WEIGHT }
}

/// The mirror over a material, where there is anything to see in it.
fn mirror(material: &LoweredMaterial) -> Option<&Glaze> {
    material.glaze().filter(|glaze| glaze.bounces > 0 && glaze.weight > 0.0)
}

/// The most bounces that any path has: what materials ask for, no more than was allowed.
fn most_bounces(asked: &Asked) -> u32 {
    let mirrors = asked.world.materials_in_use().filter_map(|(_, material)| mirror(material));
    let allowed = asked.value.as_ref().and_then(|value| value.parse().ok()).unwrap_or(u32::MAX);
    mirrors.map(|glaze| glaze.bounces).max().unwrap_or(0).min(allowed)
}

/// What sending rays out takes.
#[derive(Default)]
struct Buffers {
    /// Where the surfaces that send rays out are, side by side.
    glazed: Vec<Range<usize>>,
    /// For each ray of the level, the weight that what it sees has in its pixel; there where paths can stop by it.
    weights: Vec<f64>,
    /// The same for the next level.
    next_weights: Vec<f64>,
}

/// Sends mirrored rays out from the glazed surfaces of a level, onto the next one.
struct Reflect {
    /// Paths of less weight stop.
    least: f64,
    /// Paths of so many bounces stop, whatever materials ask for.
    most: u32,
}

impl Stage for Reflect {
    fn name(&self) -> &'static str {
        "glaze rays"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        tile.with(|own: &mut Buffers, tile| reflect(own, self, tile, context.world));
    }
}

fn reflect(own: &mut Buffers, &Reflect { least, most }: &Reflect, tile: &mut Tile, world: &World) {
    let glazed = &mut own.glazed;
    let (depth, surfaces) = (tile.depth, &tile.levels[tile.depth].surfaces);
    glazed.clear();
    for (material, range) in surfaces.by_material() {
        if mirror(&world.materials[*material as usize])
            .is_some_and(|glaze| depth < glaze.bounces.min(most) as usize)
        {
            match glazed.last_mut() {
                Some(last) if last.end == range.start => last.end = range.end,
                _ => glazed.push(range.clone()),
            }
        }
    }
    if glazed.is_empty() && tile.levels.len() == depth + 1 {
        // Nothing is sent out, and no level was.
        return;
    }
    let precision = world.numerics().ray_precision();
    let (level, next) = tile.this_and_next();
    let Level { surfaces, origins, .. } = level;
    let Level { sources, rays, lanes, .. } = next;
    sources.clear();
    rays.clear();
    let Some(origins) = origins else { return };
    let mut all_leave = true;
    for range in &*glazed {
        sources.extend(range.start as u32..range.end as u32);
        all_leave &= match precision {
            Precision::Single => widely(
                #[inline(always)]
                || mirrored_rays(surfaces, range, origins, Precision::Single, lanes),
            ),
            Precision::Double => widely(
                #[inline(always)]
                || mirrored_rays(surfaces, range, origins, Precision::Double, lanes),
            ),
        };
    }
    if least > 0.0 {
        if depth == 0 {
            own.weights.clear();
            own.weights.resize(LANES, 1.0);
        }
        stop_light_paths(own, least, surfaces, sources, world);
    }
    if !all_leave {
        for &source in &*sources {
            let source = source as usize;
            lanes.set(source, &mirrored_ray(origins.get(source), &surfaces.get(source), precision));
        }
    }
    if sources.len() < surfaces.len() {
        for (to, &from) in sources.iter().enumerate() {
            lanes.set(to, &lanes.get(from as usize));
        }
    }
    lanes.weave(sources.len(), rays);
}

/// Takes those surfaces out of `sources` whose colours count too little in their pixels to be mixed with anything.
fn stop_light_paths(
    own: &mut Buffers,
    least: f64,
    surfaces: &Surfaces,
    sources: &mut Vec<u32>,
    world: &World,
) {
    let Buffers { weights, next_weights, .. } = own;
    next_weights.clear();
    sources.retain(|&source| {
        let path = weights[surfaces.ray_of()[source as usize] as usize];
        let material = &world.materials[surfaces.materials()[source as usize] as usize];
        let goes_on = path >= least;
        if goes_on {
            next_weights.push(path * mirror(material).map_or(0.0, |glaze| glaze.weight));
        }
        goes_on
    });
    std::mem::swap(weights, next_weights);
}

/// The mirrored rays of the surfaces in `range`, also where they point into them; whether none does.
#[inline(always)]
fn mirrored_rays(
    surfaces: &Surfaces,
    range: &Range<usize>,
    origins: &Lanes,
    precision: Precision,
    rays: &mut RayLanes,
) -> bool {
    let mut all_leave = true;
    for i in range.start..range.end.min(LANES) {
        let mirrored = mirrored(surfaces.view.get(i), surfaces.shading_normal.get(i));
        let ray = precision.ray(origins.get(i), mirrored, 0.0, f64::INFINITY);
        rays.set(i, &ray);
        all_leave &= ray.direction.dot(surfaces.geometric_normal.get(i)) > 0.0;
    }
    all_leave
}

#[inline(always)]
fn mirrored(view: DVec3, normal: DVec3) -> DVec3 {
    2.0 * view.dot(normal) * normal - view
}

/// Mixes what mirrored rays saw into the surfaces that sent them.
struct Combine;

impl Stage for Combine {
    fn name(&self) -> &'static str {
        "glaze mixing"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let (level, next) = tile.this_and_next();
        for (i, &ray) in next.surfaces.ray_of().iter().enumerate() {
            let source = next.sources[ray as usize] as usize;
            let material = level.surfaces.materials()[source] as usize;
            if let Some(glaze) = context.world.materials[material].glaze() {
                let (own, mirrored) = (level.colours.get(source), next.colours.get(i));
                let mixed =
                    context.world.pipeline.weighted_combine(own, mirrored, glaze.own_weight, glaze.weight);
                level.colours.set(source, mixed);
            }
        }
    }
}

/// The mirrored ray from `origin`, on the surface's outer side. Where a smooth normal or rounding turns it into the surface it is
/// turned back to just above it.
pub fn mirrored_ray(origin: DVec3, surface: &Surface, precision: Precision) -> Ray {
    let (normal, outer) = (surface.shading_normal, surface.geometric_normal);
    let mirrored = mirrored(surface.view, normal);
    let ray = precision.ray(origin, mirrored, 0.0, f64::INFINITY);
    let height = ray.direction.dot(outer);
    if height > 0.0 {
        return ray;
    }
    precision.ray(origin, lifted(mirrored, outer, precision), 0.0, f64::INFINITY)
}

/// `direction` turned to rise above the surface by a share that survives rounding: a few of its steps.
fn lifted(direction: DVec3, outer: DVec3, precision: Precision) -> DVec3 {
    let beside = |v: DVec3| v - v.dot(outer) * outer;
    let rise = 16.0 * precision.epsilon();
    // Straight into the surface there is no "along", only what rounding leaves of it. Taking away the part across a second time
    // tells: of a direction along the surface nearly all remains.
    let along = beside(direction).try_normalize().map(beside).filter(|along| along.length_squared() > 0.5);
    along.map_or(outer, |along| (along.normalize() + rise * outer).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A surface seen from `height` above its plane, whose smooth normal is bent; `None` where it is bent away.
    fn surface(normal: [f64; 3], along: [f64; 3], height: f64, bend: [f64; 3]) -> Option<Surface> {
        let outer = DVec3::from(normal).try_normalize()?;
        let along = DVec3::from(along);
        let along = (along - along.dot(outer) * outer).normalize_or(outer.any_orthonormal_vector());
        let smooth = (outer + DVec3::from(bend)).normalize();
        (smooth.dot(outer) > 0.0).then_some(Surface {
            point: crate::geometry::spawn::SurfacePoint {
                position: DVec3::ZERO,
                start: DVec3::ZERO,
                reach: DVec3::ZERO,
            },
            view: (along + height * outer).normalize(),
            geometric_normal: outer,
            shading_normal: smooth,
            texels: crate::world::Texels::default(),
            tint: DVec3::ONE,
            prim: crate::geometry::PrimId(0),
            object: 0,
            material: 0,
        })
    }

    /// How steeply the mirrored ray leaves.
    fn rise(surface: &Surface, precision: Precision) -> f64 {
        mirrored_ray(DVec3::ZERO, surface, precision).direction.dot(surface.geometric_normal)
    }

    #[test]
    fn a_ray_that_is_mirrored_straight_into_the_surface_leaves_it() {
        // A smooth normal turned by 45 degrees, seen along the surface, mirrors straight down; what is left along the surface
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
        /// No mirrored ray points into the surface, however it grazes and whatever the smooth normal says.
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
