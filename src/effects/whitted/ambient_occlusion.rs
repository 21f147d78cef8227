//! Ambient occlusion: the ambient light of a surface is that of the directions in which nothing is near.
//!
//! The ambient term is multiplied by the integral over the hemisphere above the surface of visibility times cosine, over pi, where
//! visibility is 1 if nothing is hit within a radius (Zhukov, Iones and Kronin, An Ambient Light Illumination Model, EGWR 1998, with
//! a step as the obscurance). Directions are sampled by the cosine around the geometric normal, stratified over the samples of a
//! pixel.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::bvh::detail::RayBuffer;
use crate::effects::random::Dimension;
use crate::effects::samples::SurfaceNumbers;
use crate::effects::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use crate::effects::{Effect, EffectContext, EffectValue, Hook, PlanSettings, RayKind, Stage, id};
use crate::scene::{PixelSampler, ValueKind};
use crate::world::World;

/// Rays that test whether anything is near.
pub const RAYS: RayKind = RayKind { name: "ambient-occlusion", is_shadow: false, colour: [170, 200, 140] };

/// The radius where none is given, in diagonals of the scene's bounds.
const RADIUS: f64 = 0.1;

/// The largest radius that can be asked for, in diagonals.
const MAX_RADIUS: f64 = 1e6;

/// The rays of a surface in a picture of one sample a pixel. More samples share them, but each casts at least one. So few
/// that a picture of few samples takes less time than an adaptive one.
const RAYS_PER_PIXEL: u32 = 8;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::AMBIENT_OCCLUSION,
    summary: "ambient occlusion: nearby surfaces reduce ambient light",
    source: "Zhukov and others, An Ambient Light Illumination Model, 1998",
    is_shading: true,
    rays: &[RAYS],
    value: Some(EffectValue {
        meaning: "radius in diagonals of the scene",
        placeholder: "RADIUS",
        kind: || ValueKind::Number { range: [f64::MIN_POSITIVE, MAX_RADIUS], is_whole: false },
        check: |value| match value.parse::<f64>() {
            Ok(radius) if radius > 0.0 && radius <= MAX_RADIUS => Ok(()),
            _ => Err(format!("give a number above 0, at most {MAX_RADIUS}")),
        },
    }),
    called_for,
    specify: |_, spec| {
        spec.generations_with_origins = u32::MAX;
        spec.is_random = true;
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::BeforeLighting(_) => {
            let test = TestHemispheres::new(context);
            vec![Stage::with_buffers("ambient occlusion", move |buffers, tile, context| {
                test.run(buffers, tile, context);
            })]
        }
        _ => Vec::new(),
    },
    bytes: |tile| {
        let factors = tile.generations.iter().map(|generation| vec_bytes(&generation.surfaces.ambient));
        let lists = tile.buffers::<Buffers>().map_or(0, |Buffers { numbers, rays, occluded }| {
            numbers.bytes() + size_of::<Buffers>() + rays.bytes() + vec_bytes(occluded)
        });
        lists + factors.sum::<usize>()
    },
    ..Effect::NONE
};

/// Constant ambient light does without, unless it is asked for.
fn called_for(world: &World, plan_settings: &PlanSettings) -> Result<String, String> {
    let name = id::AMBIENT_OCCLUSION.name();
    if world.fill.is_some() {
        return Ok("the fill light casts no shadows".into());
    }
    let typed = plan_settings.with.iter().any(|typed| typed.split('=').next() == Some(name));
    if !typed && !plan_settings.scene.get(name).is_some_and(|value| value.is_on()) {
        return Err("off by default; --with turns it on".into());
    }
    if !world.has_ambient() {
        return Err("there is no ambient light".into());
    }
    Ok("the scene has `ambient` light".into())
}

/// Temporary buffers.
#[derive(Default)]
struct Buffers {
    numbers: SurfaceNumbers,
    /// One ray of each surface.
    rays: RayBuffer,
    occluded: Vec<bool>,
}

/// Computes the factor of the ambient light at the surfaces of a generation.
struct TestHemispheres {
    radius: f64,
    /// Rays a surface.
    count: u32,
    sampler: PixelSampler,
    seed: u32,
}

impl TestHemispheres {
    fn new(context: &EffectContext) -> Self {
        let radius = context.value.as_ref().and_then(|value| value.parse().ok()).unwrap_or(RADIUS);
        let samples = context.sampling.total.unwrap_or(context.spec.samples).max(1);
        // Adaptive sampling adds samples where one ray each is not enough.
        let most = if context.spec.adaptive { 1 } else { RAYS_PER_PIXEL };
        TestHemispheres {
            radius: radius * context.world.diagonal,
            count: RAYS_PER_PIXEL.div_ceil(samples).min(most),
            sampler: context.sampling.sampler,
            seed: context.sampling.seed,
        }
    }

    fn run(&self, buffers: &mut Buffers, tile: &mut Tile, context: &RenderContext) {
        let Buffers { numbers, rays, occluded } = buffers;
        numbers.start(tile);
        let Tile { generations, current, traversal, .. } = tile;
        let generation = &mut generations[*current];
        let mut factors = std::mem::take(&mut generation.surfaces.ambient);
        let RayGeneration { surfaces, origins, .. } = &*generation;
        let Some(origins) = origins else { return };
        let precision = context.world.numerics().ray_precision();
        factors.clear();
        factors.resize(surfaces.len(), 0.0);
        for k in 0..self.count {
            rays.write(0..surfaces.len(), |i| {
                let ray = surfaces.ray_of()[i] as usize;
                let sequence = (self.sampler, self.seed, Dimension::AMBIENT_OCCLUSION);
                let pair = numbers.pair(sequence, (&generation.rays, ray), (k, self.count));
                let direction = above(surfaces.geometric_normal.get(i), pair);
                precision.ray(origins.get(i), direction, 0.0, self.radius)
            });
            occluded.clear();
            context.world.accelerator.are_occluded(rays.rays(), occluded, traversal);
            for (factor, &occluded) in factors.iter_mut().zip(&*occluded) {
                *factor += f64::from(u8::from(!occluded));
            }
        }
        let visible: f64 = factors.iter().sum();
        factors.iter_mut().for_each(|factor| *factor /= f64::from(self.count));
        let cast = factors.len() * self.count as usize;
        generation.surfaces.ambient = factors;
        tile.count(RAYS, cast, cast - visible as usize);
    }
}

/// A direction above a surface with a density proportional to the cosine (Malley's method; pbrt, 4th edition, section A.5.3).
fn above(normal: DVec3, [x, y]: [f64; 2]) -> DVec3 {
    // The numbers are of f32, and so is the direction about the normal.
    let (sin, cos) = ((TAU * x) as f32).sin_cos();
    let (sin, cos) = (f64::from(sin), f64::from(cos));
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let radius = y.sqrt();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - y).sqrt()).normalize()
}
