//! Path tracing: light that surfaces scatter onto each other (Kajiya, The Rendering Equation, 1986), with next event
//! estimation, multiple importance sampling and Russian roulette (pbrt, 4th edition, chapter 13).
//!
//! A path of a pixel sample is one ray a generation. At each surface ([`scatter`]) it adds the emitted radiance, the radiance
//! of sampled lights ([`lights`]), one unless more are asked for, and continues in a direction sampled by the BSDF. Rays of a generation are traced
//! together, and so are its shadow rays. Random numbers depend on pixel, sample, generation and seed.

mod lights;
mod media;
mod scatter;
#[cfg(test)]
mod tests;

use glam::DVec3;

use media::Media;

use super::samples::{SampleIndex, list_samples};
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::transparency;
use super::{
    Choices, Effect, EffectContext, EffectValue, Hook, LightTechnique, PathSettings, RayKind, SecondaryRays,
    Stage, TextureUse, id, named,
};
use crate::geometry::RayBuffer;
use crate::scene::{PixelSampler, Sampling, Transport};
use crate::world::World;

/// Rays in directions sampled by BSDFs.
pub const RAYS: RayKind = RayKind { name: "path", is_shadow: false, colour: [120, 230, 150] };

/// Shadow rays to sampled lights.
pub const LIGHT_RAYS: RayKind = RayKind { name: "light-sample", is_shadow: true, colour: [120, 190, 255] };

/// The bounces of a path where none are asked for.
pub const DEFAULT_DEPTH: u32 = PathSettings::DEFAULT_DEPTH;

/// The registry's entry.
pub const EFFECT: Effect = Effect {
    id: id::PATH,
    summary: "path tracing: indirect light, soft shadows of emissive surfaces and environments",
    source: "Kajiya, The Rendering Equation, 1986; Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997",
    builds_on: None,
    needs_lights: false,
    is_shading: true,
    decides_samples: false,
    is_study_switch: false,
    whitted_only: false,
    rays: &[RAYS, LIGHT_RAYS],
    value: Some(EffectValue {
        meaning: "number of bounces",
        check: |value| match value.parse::<u32>() {
            Ok(0..=MAX_DEPTH) => Ok(()),
            _ => Err(format!("give a number from 0 to {MAX_DEPTH}")),
        },
    }),
    called_for,
    specify: |_, spec| {
        spec.is_path = true;
        spec.is_random = true;
        spec.texture_use.is_path = true;
        spec.lit = false;
        spec.secondary = Some(SecondaryRays { kind: RAYS, hits: "path hits", effect: id::PATH });
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::AfterShading(_) => vec![Box::new(Scatter::new(context))],
        Hook::Film => vec![Box::new(WriteRadiance)],
        _ => Vec::new(),
    },
    bytes: |tile| {
        let generations: usize = tile.generations.iter().skip(1).map(RayGeneration::bytes).sum();
        generations + tile.buffers::<Buffers>().map_or(0, Buffers::bytes)
    },
};

/// The limit of bounces that can be asked for.
const MAX_DEPTH: u32 = 1000;

fn called_for(world: &World, choices: &Choices) -> Result<String, String> {
    let clamp =
        choices.clamp.map_or(String::new(), |clamp| format!("; indirect light is clamped to {clamp}"));
    transport(world, choices).map(|why| why + &clamp)
}

/// What calls for paths, or speaks against them.
fn transport(world: &World, choices: &Choices) -> Result<String, String> {
    match choices.transport {
        Some(transport @ Transport::Whitted) => Err(format!("the transport is `{}`", transport.name())),
        Some(transport @ Transport::Path) => Ok(format!("the transport is `{}`", transport.name())),
        None if world.environment.is_some() => Ok("the scene has an `environment`".into()),
        None => {
            let names: Vec<&str> = world.area_lights.names.iter().map(String::as_str).collect();
            let nothing =
                || "the scene has no environment and no area light; --transport path asks for it".into();
            named("area light", &names).ok_or_else(nothing)
        }
    }
}

/// The state of a path.
#[derive(Debug, Clone, Copy)]
struct Path {
    /// Its camera ray, as an index into generation 0.
    camera_ray: u32,
    /// The product of the BSDF weights and roulette factors so far.
    throughput: DVec3,
    /// The last vertex, from which its light sample was taken. Not the origin of the ray, which is offset: both techniques of
    /// multiple importance sampling must have the densities of one point.
    from: DVec3,
    /// The density per solid angle with which the BSDF sampled the current ray; infinite for camera rays and for
    /// directions that no light sample can reach.
    pdf: f64,
}

/// A shadow ray's path and the radiance that it adds if unoccluded.
#[derive(Debug, Clone, Copy)]
struct LightPath {
    camera_ray: u32,
    radiance: DVec3,
}

/// The buffers of the effect.
#[derive(Default)]
struct Buffers {
    /// For each camera ray, the radiance of its path so far.
    radiance: Vec<DVec3>,
    /// For each camera ray, its pixel and sample.
    samples: Vec<SampleIndex>,
    /// For each ray of the current generation, its path.
    paths: Vec<Path>,
    /// The same for the next generation.
    next: Vec<Path>,
    /// For each ray of the current generation, the volumes that it runs through, and the same for the next. Empty in
    /// worlds without volumes.
    media: Vec<Media>,
    next_media: Vec<Media>,
    shadow_rays: RayBuffer,
    /// For each shadow ray, what it adds.
    light_paths: Vec<LightPath>,
    occluded: Vec<bool>,
    /// Samples of light in the current generation that were not finite.
    discarded: u64,
}

impl Buffers {
    fn bytes(&self) -> usize {
        let Buffers { radiance, samples, paths, next, media, next_media, .. } = self;
        let Buffers { shadow_rays, light_paths, occluded, .. } = self;
        size_of::<Buffers>()
            + vec_bytes(radiance)
            + vec_bytes(samples)
            + vec_bytes(paths)
            + vec_bytes(next)
            + vec_bytes(media)
            + vec_bytes(next_media)
            + shadow_rays.bytes()
            + vec_bytes(light_paths)
            + vec_bytes(occluded)
    }

    /// Begins the paths of the camera rays.
    fn start(&mut self, tile: &Tile, world: &World) {
        let count = tile.generations[0].rays.len();
        let camera =
            |camera_ray| Path { camera_ray, throughput: DVec3::ONE, from: DVec3::ZERO, pdf: f64::INFINITY };
        self.radiance.clear();
        self.radiance.resize(count, DVec3::ZERO);
        self.paths.clear();
        self.paths.extend((0..count as u32).map(camera));
        self.samples.clear();
        list_samples(tile, &mut self.samples);
        self.media.clear();
        if world.volumes.is_some() {
            let origins = tile.generations[0].rays.rays().iter().map(|ray| ray.origin);
            Media::at_each(world, origins, &mut self.media);
        }
    }
}

/// Adds radiance at the surfaces of a generation and fills the next one with the continuing rays.
struct Scatter {
    /// The most bounces.
    depth: u32,
    /// The seed of the random numbers.
    seed: u32,
    /// The kind that shadow rays behind surfaces are counted as; `None` where all surfaces are opaque.
    continued: Option<RayKind>,
    sampler: PixelSampler,
    technique: LightTechnique,
    /// Roulette and light samples.
    settings: PathSettings,
    /// How textures are looked up.
    texture_use: TextureUse,
    /// The largest radiance that indirect light adds at a surface; infinite if there is no limit.
    clamp: f64,
}

impl Scatter {
    fn new(context: &EffectContext) -> Self {
        let depth = context.value.as_ref().and_then(|value| value.parse().ok()).unwrap_or(DEFAULT_DEPTH);
        let Sampling { seed, sampler, .. } = *context.sampling;
        let settings = context.spec.path;
        let light_samples = settings.light_samples.clamp(1, PathSettings::MAX_LIGHT_SAMPLES);
        Scatter {
            depth,
            seed: seed.unwrap_or(0),
            sampler: sampler.unwrap_or_default(),
            technique: context.spec.light_technique,
            settings: PathSettings { light_samples, ..settings },
            texture_use: context.spec.texture_use,
            continued: context.spec.continued.map(|kinds| kinds.shadow_rays),
            clamp: context.clamp.unwrap_or(f64::INFINITY),
        }
    }

    /// What a path adds after `bounces` bounces: as it is where light comes to the camera directly or by one surface,
    /// otherwise scaled down until no channel exceeds the clamp.
    fn clamped(&self, radiance: DVec3, bounces: usize) -> DVec3 {
        let largest = radiance.max_element();
        let exceeds = bounces >= 2 && largest > self.clamp;
        if !exceeds {
            return radiance;
        }
        if largest.is_finite() {
            radiance * (self.clamp / largest)
        } else {
            radiance.min(DVec3::splat(self.clamp))
        }
    }
}

impl Stage for Scatter {
    fn name(&self) -> &'static str {
        "path"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        tile.with_buffers(|own: &mut Buffers, tile| {
            if tile.depth == 0 {
                own.start(tile, context.world);
            }
            own.scatter(tile, context, self);
            own.trace_shadow_rays(tile, context.world, self.continued);
        });
    }
}

impl Buffers {
    /// Traces the shadow rays of a generation and adds the radiance of those that are not occluded.
    fn trace_shadow_rays(&mut self, tile: &mut Tile, world: &World, continued: Option<RayKind>) {
        let Buffers { shadow_rays, light_paths, occluded, radiance, .. } = self;
        occluded.clear();
        world.accelerator.are_occluded(shadow_rays.rays(), occluded, &mut tile.traversal);
        let mut count = 0;
        for ((path, ray), occluded) in light_paths.iter().zip(shadow_rays.rays().iter()).zip(&mut *occluded) {
            let mut transmittance = f64::from(u8::from(!*occluded));
            if *occluded && continued.is_some() {
                transmittance = transparency::transmittance(world, &ray, &mut tile.traversal, &mut count);
                *occluded = transmittance == 0.0;
            }
            if !*occluded {
                radiance[path.camera_ray as usize] += path.radiance * transmittance;
            }
        }
        if let Some(kind) = continued.filter(|_| count > 0) {
            tile.count(kind, count, 0);
        }
        if let Some(recorder) = &mut tile.recorder {
            let sources: Vec<u32> = light_paths.iter().map(|path| path.camera_ray).collect();
            recorder.record_occlusion(LIGHT_RAYS, tile.depth, None, &sources, shadow_rays.rays(), occluded);
        }
        tile.count(LIGHT_RAYS, occluded.len(), occluded.iter().filter(|&&occluded| occluded).count());
    }
}

/// Writes the radiance of the paths to the pixels.
struct WriteRadiance;

impl Stage for WriteRadiance {
    fn name(&self) -> &'static str {
        "film"
    }

    fn run(&self, tile: &mut Tile, context: &RenderContext) {
        let pipeline = context.world.pipeline;
        tile.with_buffers(|own: &mut Buffers, tile| {
            tile.pixels.clear();
            let pixel = |&radiance: &DVec3| pipeline.clamp(radiance).as_vec3().to_array();
            tile.pixels.extend(own.radiance.iter().map(pixel));
        });
    }
}
