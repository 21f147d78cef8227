//! The per-tile working set: ray, hit and shading buffers, one set per ray generation.
//!
//! Generation 0 holds the camera rays of the tile's pixels, each further generation the rays cast from the surfaces of the one
//! before. All buffers are kept from tile to tile, so rendering allocates nothing once they have grown; each stage overwrites
//! what it fills. Buffers of a single effect are defined in its own file and exist only where it runs ([`Tile::with_buffers`]).

use std::any::Any;
use std::ops::AddAssign;

use glam::DVec3;

use super::RayKind;
use super::recorder::Recorder;
use super::unlit::has_unlit;
use crate::bvh::Traversal;
use crate::bvh::detail::{HitBuffer, RayBuffer};
use crate::film::{DisplayTransform, Window};
use crate::shading::{LightSoa, Scratch};
#[cfg(doc)]
use crate::world::RAYS_PER_BATCH;
use crate::world::{Flags, InteractionSoa, Vec3Soa, View, World};

/// The errors of noisy pixels ([`Tile::noisy_pixels`]), in levels.
pub const NOISY_LEVELS: f64 = 3.0;

/// The read-only input of every stage.
pub struct RenderContext<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// The camera.
    pub view: &'a View,
    /// The display transform, as far as it is known before the picture is.
    pub display: DisplayTransform,
    /// Whether pixels are developed by `display`, so that unlit surfaces and the backdrop bypass exposure and tone map.
    /// Otherwise they are radiance.
    pub is_displayed: bool,
}

/// The rays of one generation with their hits and shading, at most [`RAYS_PER_BATCH`] rays.
#[derive(Default)]
pub struct RayGeneration {
    /// The rays.
    pub rays: RayBuffer,
    /// For each ray its source: in generation 0 a pixel of the tile, otherwise a surface of the generation before.
    pub sources: Vec<u32>,
    /// For each ray beyond generation 0, the camera ray whose random numbers it has; empty where rays have their own.
    pub camera_rays: Vec<u32>,
    /// For each ray, its closest hit.
    pub hits: HitBuffer,
    /// The surface interactions of the rays that hit, in the order of the rays.
    pub surfaces: Box<InteractionSoa>,
    /// For each surface, the origin of the rays that leave it; `None` where no rays do.
    pub origins: Option<Box<Vec3Soa>>,
    /// The same for shadow rays, and for all rays of paths, where surfaces of smooth meshes have others; else `None`.
    pub lifted: Option<Box<StartPoints>>,
    /// For each surface, its colour; `None` for transports that keep none.
    pub colours: Option<Box<Vec3Soa>>,
}

/// For each surface, the point that rays leave.
#[derive(Clone, Default)]
pub struct StartPoints {
    /// The point.
    pub position: Vec3Soa,
    /// The origin of the rays.
    pub origin: Vec3Soa,
    /// Whether it lies above the triangle, so that rays may leave below the triangle's horizon, too.
    pub is_lifted: Flags,
}

impl RayGeneration {
    /// Bytes of memory, without the buffers that effects add.
    pub fn bytes(&self) -> usize {
        let RayGeneration { rays, sources, camera_rays, hits, surfaces, origins, colours, .. } = self;
        size_of::<RayGeneration>()
            + rays.bytes()
            + vec_bytes(sources)
            + vec_bytes(camera_rays)
            + hits.bytes()
            + size_of_val(&**surfaces)
            + usize::from(origins.is_some()) * size_of::<Vec3Soa>()
            + usize::from(colours.is_some()) * size_of::<Vec3Soa>()
    }
}

/// Bytes of memory that a vector holds.
pub fn vec_bytes<T>(values: &Vec<T>) -> usize {
    values.capacity() * size_of::<T>()
}

/// The working set of one thread, which renders one tile at a time.
#[derive(Default)]
pub struct Tile {
    /// The pixels of the tile.
    pub window: Option<Window>,
    /// The ray generations: all of them where stages go back over them, otherwise the current and the next one.
    pub generations: Vec<RayGeneration>,
    /// The index in `generations` of the one that stages work on.
    pub current: usize,
    /// The number of that generation: of the bounces between the camera and its rays.
    pub depth: usize,
    /// The colours of the pixels, row by row from the top. While an effect takes several samples: the colours of the rays of
    /// generation 0.
    pub pixels: Vec<[f32; 3]>,
    /// For each camera ray, then for each pixel, the part of it that surfaces cover; `None` for pictures without an
    /// alpha channel.
    pub coverage: Option<Vec<f32>>,
    /// For each camera ray, then for each pixel: colour times coverage, and coverage, of directly visible unlit
    /// surfaces ([`super::unlit`]); `None` if they are radiance. Their share of `pixels` is that colour times
    /// [`DisplayTransform::white`].
    pub shown: Option<Vec<[f32; 4]>>,
    /// The camera rays that hit a ground of which the picture shows the shadows alone, and where
    /// ([`super::shadow_catcher`]); empty without `coverage`.
    pub caught: Vec<(u32, DVec3)>,
    /// Whether the stages have to run again, for further samples.
    pub needs_more_samples: bool,
    /// Samples taken for each finished pixel; empty where each has one.
    pub sample_counts: Vec<u32>,
    /// Traversal state and counters.
    pub traversal: Traversal,
    /// Rays cast and rays that hit, by kind; kinds without rays have no entry.
    pub rays: Vec<(RayKind, RayCount)>,
    /// For each light of the world, its samples at the surfaces of the current generation; empty where lights are not evaluated.
    pub lights: Vec<Box<LightSoa>>,
    /// Temporary buffers of shading.
    pub shading: Box<Scratch>,
    /// The camera rays that hit a surface.
    pub camera_hits: Vec<u32>,
    /// For each object, whether a primary ray has hit it.
    pub visible_objects: Vec<bool>,
    /// For each camera ray, albedo and shading normal of the first surface of its path that is neither a smooth mirror
    /// nor clear glass; empty without paths, `None` where nothing reads it.
    pub scattering: Option<Vec<Option<[[f32; 3]; 2]>>>,
    /// Samples of light that were left out because they were not finite numbers.
    pub discarded_samples: u64,
    /// Paths traced and cut.
    pub paths: PathCount,
    /// Pixels that depend on random numbers and whose standard error, by their own samples, is above [`NOISY_LEVELS`]
    /// times the level of adaptive sampling.
    pub noisy_pixels: u64,
    /// Records a pixel; `None` while pictures are rendered.
    pub recorder: Option<Box<Recorder>>,
    /// The buffers of effects, one type each.
    effect_buffers: Vec<Box<dyn Any + Send>>,
}

/// The count of paths: one for each sample, or for each layer of transparent surfaces where a pixel has one sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PathCount {
    /// Paths that were traced.
    pub traced: u64,
    /// Those that a limit on bounces ended at a surface that may scatter, with a throughput above 0.
    pub cut: u64,
}

impl AddAssign for PathCount {
    fn add_assign(&mut self, other: Self) {
        self.traced += other.traced;
        self.cut += other.cut;
    }
}

/// The count of rays of one kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCount {
    /// Rays that were cast.
    pub cast: u64,
    /// Those that hit.
    pub hit: u64,
}

impl Tile {
    /// Working set for a picture. `has_alpha`: whether coverage is computed.
    pub fn for_picture(context: &RenderContext, has_alpha: bool) -> Self {
        let shows_unlit = context.is_displayed && !context.display.is_identity() && has_unlit(context.world);
        Tile { coverage: has_alpha.then(Vec::new), shown: shows_unlit.then(Vec::new), ..Tile::default() }
    }

    /// Begins a tile. Counters continue.
    pub fn start(&mut self, window: Window) {
        self.window = Some(window);
        (self.current, self.depth) = (0, 0);
        self.needs_more_samples = false;
        self.sample_counts.clear();
        self.pixels.clear();
    }

    /// Calls `work` with the recorder, if there is one.
    pub fn record(&mut self, work: impl FnOnce(&mut Recorder, &Tile)) {
        if let Some(mut recorder) = self.recorder.take() {
            work(&mut recorder, self);
            self.recorder = Some(recorder);
        }
    }

    /// The current generation, created if it does not exist.
    pub fn generation(&mut self) -> &mut RayGeneration {
        if self.generations.len() <= self.current {
            self.generations.resize_with(self.current + 1, RayGeneration::default);
        }
        &mut self.generations[self.current]
    }

    /// The current generation and the next, created if they do not exist.
    pub fn this_and_next(&mut self) -> (&mut RayGeneration, &mut RayGeneration) {
        if self.generations.len() <= self.current + 1 {
            self.generations.resize_with(self.current + 2, RayGeneration::default);
        }
        let (before, after) = self.generations.split_at_mut(self.current + 1);
        (&mut before[self.current], &mut after[0])
    }

    /// Moves on to the next generation if it has rays; returns whether it has. The buffers of the one before are those
    /// of the next, unless `keeps_all`.
    pub fn descend(&mut self, keeps_all: bool) -> bool {
        let next = self.current + 1;
        let has_rays = self.generations.get(next).is_some_and(|next| !next.rays.is_empty());
        if has_rays {
            self.depth += 1;
            if keeps_all { self.current = next } else { self.generations.swap(self.current, next) }
        }
        has_rays
    }

    /// Moves back to the generation before that is kept; returns `false`, at depth 0, where there is none.
    pub fn ascend(&mut self) -> bool {
        let is_deeper = self.current > 0;
        self.current -= usize::from(is_deeper);
        self.depth = self.current;
        is_deeper
    }

    /// Calls `work` with an effect's buffers of type `T`, created if they do not exist, and with the tile.
    pub fn with_buffers<T: Default + Send + 'static, R>(
        &mut self,
        work: impl FnOnce(&mut T, &mut Tile) -> R,
    ) -> R {
        let at = self.effect_buffers.iter().position(|buffers| buffers.is::<T>());
        let mut taken = match at {
            Some(at) => self.effect_buffers.swap_remove(at),
            None => Box::<T>::default(),
        };
        let buffers = taken.downcast_mut().expect("what was found by its type");
        let result = work(buffers, self);
        self.effect_buffers.push(taken);
        result
    }

    /// An effect's buffers of type `T`; `None` where it has not run.
    pub fn buffers<T: 'static>(&self) -> Option<&T> {
        self.effect_buffers.iter().find_map(|buffers| buffers.downcast_ref())
    }

    /// Bytes of memory for what every picture needs. The memory of effects is counted by [`super::Effect::bytes`].
    pub fn bytes(&self) -> usize {
        let Tile { generations, pixels, lights, shading, visible_objects, .. } = self;
        size_of::<Tile>()
            + generations.first().map_or(0, RayGeneration::bytes)
            + vec_bytes(pixels)
            + vec_bytes(lights)
            + lights.len() * size_of::<LightSoa>()
            + size_of_val(&**shading)
            + vec_bytes(visible_objects)
    }

    /// Adds to the count of a kind of ray.
    pub fn count(&mut self, kind: RayKind, cast: usize, hit: usize) {
        let at = self.rays.iter().position(|(known, _)| *known == kind).unwrap_or_else(|| {
            self.rays.push((kind, RayCount::default()));
            self.rays.len() - 1
        });
        let count = &mut self.rays[at].1;
        count.cast += cast as u64;
        count.hit += hit as u64;
    }
}
