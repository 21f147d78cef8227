//! The transport `path`: light that surfaces scatter onto each other (Kajiya, The Rendering Equation, 1986), with next
//! event estimation, multiple importance sampling and Russian roulette (pbrt, 4th edition, chapter 13).
//!
//! A path of a pixel sample is one ray a generation; the rays of two generations are kept. The vertices of a generation
//! ([`vertices`]) take these steps together, each a file:
//! 1. paths add the radiance that surfaces emit, or that rays which hit nothing find ([`emission`]);
//! 2. lights ([`lights`]) are sampled ([`light_samples`]);
//! 3. BSDFs are evaluated for the light samples, and sampled ([`bsdf`]), by class: Lambert's, those of metal and opaque
//!    dielectric ([`opaque_bsdfs`]), of [`smooth_glass`], and all others;
//! 4. light samples are listed as shadow rays with what they add ([`shadow_rays`]), by the weights of multiple importance
//!    sampling ([`weights`]), and traced together;
//! 5. limits on bounces ([`limits`]) and Russian roulette end paths; the others are the next generation, without gaps
//!    ([`continuations`]).
//!
//! All but the choice of lights, the BSDFs of the last class, and media are loops without branches over structures of
//! arrays, which the compiler vectorises. Random numbers depend on pixel, sample, generation and seed.

mod bsdf;
mod continuations;
mod emission;
mod light_samples;
mod lights;
mod limits;
mod media;
mod numbers;
mod opaque_bsdfs;
mod record;
mod shadow_rays;
mod smooth_glass;
#[cfg(test)]
mod tests;
mod vertices;
mod weights;

use glam::DVec3;

use bsdf::Bsdfs;
use continuations::Continuations;
use light_samples::{LightSamples, TriangleSamples};
use lights::Lights;
use media::MediumStackId;
use numbers::{GenerationNumbers, Sequence};
use vertices::{IndexList, Vertices};

use super::bounce_limits::BounceLimits;
use super::recorder::Recorder;
use super::samples::{SampleIndex, list_samples};
use super::shadow_catcher::catch_shadows;
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use super::unlit::expose_unlit;
use super::{
    Effect, EffectContext, EffectValue, Hook, LightTechnique, PathSettings, PlanSettings, RayKind,
    SecondaryRays, Stage, TextureUse, TransportEntry, id, named,
};
use crate::scene::{PixelSampler, Sampling, TextureSlot, Transport, TransportReason, ValueKind};
use crate::shading::base_colour;
use crate::world::{EnvironmentCell, InteractionSoa, World};

/// Rays in directions sampled by BSDFs.
pub const RAYS: RayKind = RayKind { name: "path", is_shadow: false, colour: [120, 230, 150] };

/// Shadow rays to sampled lights.
pub const LIGHT_RAYS: RayKind = RayKind { name: "light-sample", is_shadow: true, colour: [120, 190, 255] };

/// The registry's entry.
pub(super) const TRANSPORT: TransportEntry = TransportEntry {
    transport: Transport::Path,
    switch: Some(id::PATH),
    effects: &[],
    reason: "paths are traced",
    specify: |context: &EffectContext, spec| {
        spec.is_random = true;
        let depth = context.value.as_ref().and_then(|value| value.parse().ok());
        spec.bounce_limits = BounceLimits::new(depth, spec.path.depth_specular);
        spec.has_rare_light |= context.world.volumes.is_some();
        spec.secondary =
            Some(SecondaryRays { kind: RAYS, hits: "path hits", effect: id::PATH, are_mirrored: false });
    },
    stages: |context: &EffectContext, hook| match hook {
        Hook::Shading(_) => {
            let scatter = Scatter::new(context);
            vec![Stage::with_buffers("path", move |buffers: &mut Buffers, tile, context| {
                if tile.depth == 0 {
                    buffers.start(tile, context.world);
                }
                buffers.scatter(tile, context, &scatter);
                buffers.trace_shadow_rays(tile, context.world, &scatter);
            })]
        }
        Hook::Film => vec![Stage::new("film", write_radiance)],
        _ => Vec::new(),
    },
};

/// The effect by which users switch the transport.
pub const EFFECT: Effect = Effect {
    id: id::PATH,
    summary: "path tracing: indirect light, soft shadows of emissive surfaces and environments",
    source: "Kajiya, The Rendering Equation, 1986; Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997",
    is_shading: true,
    rays: &[RAYS, LIGHT_RAYS],
    value: Some(EffectValue {
        meaning: "number of bounces",
        placeholder: "BOUNCES",
        kind: || ValueKind::Number { range: [0.0, f64::from(PathSettings::MAX_DEPTH)], is_whole: true },
        check: |value| match value.parse::<u32>() {
            Ok(0..=PathSettings::MAX_DEPTH) => Ok(()),
            _ => Err(format!("give a number from 0 to {}", PathSettings::MAX_DEPTH)),
        },
    }),
    called_for,
    bytes: |tile| {
        let generations: usize = tile.generations.iter().skip(1).map(RayGeneration::bytes).sum();
        tile.buffers::<Buffers>().map_or(0, |buffers| generations + buffers.bytes())
    },
    ..Effect::NONE
};

/// What calls for paths, or speaks against them.
fn called_for(world: &World, plan_settings: &PlanSettings) -> Result<String, String> {
    let names = &world.area_lights.names;
    let (has_environment, has_area_light) = (world.environment.is_some(), !names.is_empty());
    let has_reason = world.path_tracing_reason.is_some();
    let (transport, reason) =
        Transport::called_for(plan_settings.transport, has_environment, has_area_light, has_reason);
    let why = match reason {
        TransportReason::Choice => format!("the transport is `{}`", transport.name()),
        TransportReason::Environment => "the scene has an `environment`".into(),
        TransportReason::AreaLight => {
            named("area light", names.iter().map(String::as_str)).unwrap_or_default()
        }
        TransportReason::Material => world.path_tracing_reason.as_deref().unwrap_or_default().to_owned(),
        TransportReason::Nothing => {
            "the scene has no environment and no area light; --transport path turns it on".into()
        }
    };
    if transport != Transport::Path {
        return Err(why);
    }
    let clamp = plan_settings.clamp.map(|clamp| format!("; indirect light is clamped to {clamp}"));
    Ok(why + &clamp.unwrap_or_default())
}

/// The state of a path.
#[derive(Debug, Clone, Copy)]
struct Path {
    /// The product of the BSDF weights and roulette factors so far.
    throughput: DVec3,
    /// [`Vertices::position`] of the last vertex. Not the origin of the ray, which is offset.
    from: DVec3,
    /// The density per solid angle with which the BSDF sampled the current ray; infinite for camera rays and for
    /// directions that no light sample can reach.
    pdf: f64,
    /// The number of scattering events that count towards the limit of bounces.
    counted: u16,
    /// The number of scattering events, not counting leading perfectly specular ones; 2 for more.
    bounces: u8,
}

impl Path {
    /// The path of a camera ray.
    const OF_CAMERA: Path =
        Path { throughput: DVec3::ONE, from: DVec3::ZERO, pdf: f64::INFINITY, counted: 0, bounces: 0 };
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
    media: Vec<MediumStackId>,
    next_media: Vec<MediumStackId>,
    /// For each shadow ray of a light sample, whether it is occluded.
    occluded: Vec<bool>,
    /// The rays of the current generation that hit nothing, and the places of their directions in the environment.
    missed: Box<IndexList>,
    places: Vec<[f64; 2]>,
    /// Cells of the environment that light samples are taken in.
    cells: Vec<EnvironmentCell>,
    /// What the vertices of the current generation have.
    numbers: Box<GenerationNumbers>,
    vertices: Box<Vertices>,
    bsdfs: Box<Bsdfs>,
    /// Light samples, each of all vertices.
    light_samples: Vec<Box<LightSamples>>,
    triangle_samples: Box<TriangleSamples>,
    continuations: Box<Continuations>,
    /// Samples of light in the current generation that were not finite.
    discarded: u64,
    /// Paths that a limit on bounces cut in the current generation.
    cut: u64,
}

impl Buffers {
    fn bytes(&self) -> usize {
        let Buffers { radiance, samples, paths, next, media, next_media, .. } = self;
        let Buffers { occluded, places, cells, vertices, bsdfs, light_samples, .. } = self;
        size_of::<Buffers>()
            + vec_bytes(radiance)
            + vec_bytes(samples)
            + vec_bytes(paths)
            + vec_bytes(next)
            + vec_bytes(media)
            + vec_bytes(next_media)
            + vec_bytes(occluded)
            + size_of::<IndexList>()
            + vec_bytes(places)
            + vec_bytes(cells)
            + size_of::<GenerationNumbers>()
            + vertices.bytes()
            + bsdfs.bytes()
            + vec_bytes(light_samples)
            + light_samples.iter().map(|samples| samples.bytes()).sum::<usize>()
            + size_of::<TriangleSamples>()
            + size_of::<Continuations>()
    }

    /// Begins the paths of the camera rays.
    fn start(&mut self, tile: &mut Tile, world: &World) {
        let generation = tile.generation();
        let count = generation.rays.len();
        generation.camera_rays.clear();
        generation.camera_rays.extend(0..count as u32);
        self.radiance.clear();
        self.radiance.resize(count, DVec3::ZERO);
        self.paths.clear();
        self.paths.resize(count, Path::OF_CAMERA);
        tile.paths.traced += count as u64;
        self.samples.clear();
        list_samples(tile, &mut self.samples);
        self.media.clear();
        if world.volumes.is_some() {
            self.vertices.media.start(world, tile.generation().rays.rays().origins(), &mut self.media);
        }
    }
}

/// Adds radiance at the surfaces of a generation and fills the next one with the continuing rays.
struct Scatter {
    limits: BounceLimits,
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
        let Sampling { seed, sampler, .. } = *context.sampling;
        let settings = context.spec.path;
        let light_samples = settings.light_samples.clamp(1, PathSettings::MAX_LIGHT_SAMPLES);
        Scatter {
            limits: context.spec.bounce_limits,
            seed,
            sampler,
            technique: context.spec.light_technique,
            settings: PathSettings { light_samples, ..settings },
            texture_use: context.spec.texture_use,
            continued: context.spec.continued.map(|kinds| kinds.shadow_rays),
            clamp: context.clamp.unwrap_or(f64::INFINITY),
        }
    }
}

impl Buffers {
    /// Takes the steps of a generation's vertices, up to the tracing of shadow rays, and fills the next generation.
    fn scatter(&mut self, tile: &mut Tile, context: &RenderContext, stage: &Scatter) {
        let world = context.world;
        let depth = tile.depth as u32;
        let (mut scattering, mut recorder) = (tile.scattering.take(), tile.recorder.take());
        if let Some(found) = scattering.as_mut().filter(|_| depth == 0) {
            found.clear();
            found.resize(self.paths.len(), None);
        }
        let (generation, next) = tile.this_and_next();
        self.clear_next(next);
        (self.discarded, self.cut) = (0, 0);
        let lights = Lights::new(world, stage);
        self.add_missed(generation, context, &lights, stage, depth);
        let surfaces = &*generation.surfaces;
        self.vertices.begin(world, surfaces, &self.paths, &self.media);
        self.add_emitted(generation, world, &lights, stage);
        // The last vertices of paths only emit; denoising AOVs need to know whether they scatter.
        let is_last = self.are_last((world, stage), surfaces, depth);
        if is_last {
            self.count_cut(world, surfaces);
        } else {
            let camera_rays = surfaces.ray_of().iter().map(|&ray| generation.camera_rays[ray as usize]);
            let sequence = Sequence { seed: stage.seed, sampler: stage.sampler, depth };
            self.numbers.fill(camera_rays.map(|ray| self.samples[ray as usize]), sequence);
            self.vertices.find_frames(world, surfaces, generation.lifted.as_deref());
            self.sample_lights((world, &lights, stage), surfaces, sequence);
        }
        if is_last && scattering.is_some() {
            self.vertices.find_frames(world, surfaces, generation.lifted.as_deref());
        }
        if !is_last || scattering.is_some() {
            let Buffers { vertices, bsdfs, numbers, light_samples, continuations, .. } = self;
            let light_samples = if is_last { &mut [] } else { &mut light_samples[..] };
            bsdfs.find(world, surfaces, vertices);
            bsdfs.eval_and_sample(world, surfaces, vertices, numbers, light_samples, continuations);
        }
        if let Some(found) = &mut scattering {
            self.note_scattering(world, generation, found);
        }
        let is_limited = depth >= stage.limits.first();
        if !is_last {
            if is_limited {
                self.drop_ended(stage, surfaces, depth);
            }
            self.list_shadow_rays((world, stage), generation);
        }
        let pdfs = recorder.as_ref().map(|_| self.continuations.pdf.to_vec());
        let has_roulette = is_limited || depth >= stage.settings.roulette_from;
        if !is_last {
            self.list_continuations((world, stage), (generation, next), has_roulette);
        }
        if let (Some(recorder), Some(pdfs)) = (&mut recorder, pdfs) {
            let stage = (context, &lights, stage);
            self.record_vertices(recorder, stage, generation, (&pdfs, has_roulette), depth);
        }
        std::mem::swap(&mut self.paths, &mut self.next);
        std::mem::swap(&mut self.media, &mut self.next_media);
        (tile.scattering, tile.recorder) = (scattering, recorder);
        tile.discarded_samples += self.discarded;
        tile.paths.cut += self.cut;
    }

    /// Takes the light samples of all vertices.
    fn sample_lights(
        &mut self,
        (world, lights, stage): (&World, &Lights, &Scatter),
        surfaces: &InteractionSoa,
        sequence: Sequence,
    ) {
        let Buffers { vertices, numbers, light_samples, triangle_samples, cells, .. } = self;
        light_samples.resize_with(stage.settings.light_samples as usize, Box::default);
        for (index, samples) in (0..).zip(light_samples) {
            numbers.fill_light(sequence, index);
            samples.take((world, lights), surfaces, vertices, numbers, (triangle_samples, cells));
        }
    }

    /// Notes albedo and shading normal, for denoisers, of paths that first meet a surface with a BSDF that is not
    /// made of delta lobes.
    fn note_scattering(
        &self,
        world: &World,
        generation: &RayGeneration,
        found: &mut [Option<[[f32; 3]; 2]>],
    ) {
        for (i, &ray) in generation.surfaces.ray_of().iter().enumerate() {
            let found = &mut found[generation.camera_rays[ray as usize] as usize];
            if found.is_none() && !self.continuations.is_delta.get(i) {
                let surface = generation.surfaces.get(i);
                let texel = generation.surfaces.texels.get(TextureSlot::BaseColour, i);
                let values = [base_colour(world, &surface, texel), surface.shading_normal];
                *found = Some(values.map(|value| value.as_vec3().to_array()));
            }
        }
    }

    fn clear_next(&mut self, next: &mut RayGeneration) {
        next.rays.clear();
        next.sources.clear();
        next.camera_rays.clear();
        self.next.clear();
        self.next_media.clear();
        self.light_samples.iter_mut().for_each(|samples| samples.clear_rays());
    }
}

/// Writes the radiance of the paths to the pixels.
fn write_radiance(tile: &mut Tile, context: &RenderContext) {
    let pipeline = context.world.pipeline;
    tile.with_buffers(|buffers: &mut Buffers, tile| {
        tile.pixels.clear();
        let pixel = |&radiance: &DVec3| pipeline.clamp(radiance).as_vec3().to_array();
        tile.pixels.extend(buffers.radiance.iter().map(pixel));
    });
    expose_unlit(tile, context);
    catch_shadows(tile, context.world, true);
    tile.record(Recorder::add_colours);
}
