//! Limits on the bounces of paths, and the paths that estimate the light which these leave out.
//!
//! Of the rays whose next vertex scatters less than without limits, a random share is traced once more, in the next
//! generation. That vertex then scatters by the lobes that the limits leave out, and what follows has no limits but
//! Russian roulette. Light found that way, over the share, is an unbiased estimate of the light left out: the share is
//! chosen by random numbers of its own, before anything is known of the vertex.

use glam::DVec3;

use super::bsdf::can_be_delta;
use super::media::MediumStackId;
use super::{Buffers, LightPath, Path, Scatter};
use crate::effects::light_left_out::{BounceLimits, ByBounces, LeftOut, LeftOutSample};
use crate::effects::random::{Dimension, independent_pair};
use crate::effects::tile::{RayGeneration, Tile, vec_bytes};
use crate::film::colour::luminance;
use crate::geometry::Ray;
use crate::world::{RAYS_PER_BATCH, World};

/// The number of paths of a picture that would continue beyond the limits if all were limited, to within a factor of 2
/// and as far as [`SHARES`] allow: enough for standard errors of a few percent. Measurements: docs/decisions.md.
const CONTINUED_PATHS: f64 = 8192.0;

/// The range of the share of limited paths that continue.
const SHARES: [f64; 2] = [1.0 / 1024.0, 1.0 / 16.0];

/// The share of limited paths that continue beyond the limits, times the largest channel of their throughput where that
/// is below 1, for a picture of at most this many paths. A power of two, by which radiance is divided without rounding.
pub(super) fn share(paths: f64) -> f64 {
    let share = (CONTINUED_PATHS / paths.max(1.0)).clamp(SHARES[0], SHARES[1]);
    f64::from_bits(share.to_bits() & f64::INFINITY.to_bits())
}

/// The lobes by which a vertex may scatter: all but perfectly specular ones, and these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lobes {
    rough: bool,
    delta: bool,
}

impl Lobes {
    const ALL: Lobes = Lobes { rough: true, delta: true };
}

/// How a path scatters at its next vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scattering {
    /// As far as the limits let the paths of the picture.
    OfPicture,
    /// Without limits.
    Unlimited,
    /// The same, beyond the limit on specular bounces, so that no larger limit on the others reaches it.
    BeyondSpecular,
    /// By the lobes that the limits leave out. The vertex is that of a path of the picture, which has its emission.
    Repeated(LeftOutLobes),
}

/// The lobes that limits leave out at a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LeftOutLobes {
    Rough,
    Delta,
    /// All: of the one limit, or of both where specular bounces have their own.
    All {
        has_specular: bool,
    },
}

impl Scattering {
    /// Whether the vertex is that of a path of the picture.
    #[inline]
    pub(super) fn is_repeated(self) -> bool {
        matches!(self, Scattering::Repeated(_))
    }

    /// That of the vertex after the next.
    #[inline]
    pub(super) fn next(self) -> Self {
        match self {
            Scattering::Repeated(LeftOutLobes::Delta | LeftOutLobes::All { has_specular: true }) => {
                Scattering::BeyondSpecular
            }
            Scattering::Repeated(_) => Scattering::Unlimited,
            other => other,
        }
    }

    /// The bounces that a limit on those that count would have to allow for light after `counted` of them; 0 where none
    /// suffices.
    #[inline]
    pub(super) fn needed(self, counted: u16) -> u16 {
        if self.next() == Scattering::BeyondSpecular { 0 } else { counted }
    }
}

/// The lobes of a vertex on a path of the picture.
fn lobes_within(limits: &BounceLimits, path: &Path, generation: u32) -> Lobes {
    let counted = u32::from(path.counted);
    let rough = counted < limits.depth;
    let delta = limits.specular.map_or(rough, |specular| generation - counted < specular);
    Lobes { rough, delta }
}

/// A path that continues beyond the limits with the next generation that has room.
struct WaitingPath {
    ray: Ray,
    camera_ray: u32,
    path: Path,
    /// `None` in worlds without volumes.
    media: Option<MediumStackId>,
}

/// The state of the paths that continue beyond the limits.
#[derive(Default)]
pub(super) struct LeftOutPaths {
    /// See [`share`].
    share: f64,
    /// For each vertex of a limited generation, its lobes.
    lobes: Vec<Lobes>,
    /// Whether any of these may scatter.
    pub(super) any_scatters: bool,
    /// Whether the generation has paths beyond the limits.
    pub(super) has_unlimited: bool,
    waiting: Vec<WaitingPath>,
    /// For each light sample of the generation, the radiance that the clamp takes away; empty without a clamp.
    pub(super) clamped_off: Vec<DVec3>,
    /// For each shadow ray, the transmittance; empty where all is 0 or 1.
    pub(super) transmittances: Vec<f64>,
    bounces: ByBounces,
}

impl LeftOutPaths {
    /// Begins the paths of camera rays.
    pub(super) fn start(&mut self, share: f64) {
        self.share = share;
        self.has_unlimited = false;
        self.waiting.clear();
        self.clamped_off.clear();
    }

    /// Whether a limit ends the path at a vertex of a limited generation, unless it continues by a perfectly specular
    /// lobe.
    pub(super) fn ends(&self, vertex: usize) -> bool {
        !self.lobes[vertex].rough
    }

    /// Bytes of memory beside the structure itself.
    pub(super) fn bytes(&self) -> usize {
        let LeftOutPaths {
            lobes,
            waiting,
            clamped_off,
            transmittances,
            bounces: ByBounces { light, rays },
            ..
        } = self;
        vec_bytes(lobes)
            + vec_bytes(waiting)
            + vec_bytes(clamped_off)
            + vec_bytes(transmittances)
            + vec_bytes(light)
            + vec_bytes(rays)
    }

    /// Adds the light samples of a generation that are visible: those of paths beyond the limits, and what the clamp
    /// takes away of others. The first is number `listed` of the generation; `count` is the number of camera rays.
    #[cold]
    pub(super) fn add_light_samples(
        &mut self,
        (light_paths, listed): (&[LightPath], usize),
        occluded: &[bool],
        count: usize,
        radiance: &mut [DVec3],
        stage: &Scatter,
    ) {
        for (k, path) in light_paths.iter().enumerate().filter(|(k, _)| !occluded[*k]) {
            let transmittance = self.transmittances.get(k).copied().unwrap_or(1.0);
            let target = path.target as usize;
            if target >= count {
                self.add_light(path.needed, path.radiance, stage);
            } else if let Some(clamped_off) = self.clamped_off.get(listed + k) {
                radiance[2 * count + target] += *clamped_off * transmittance;
            }
        }
    }

    /// Adds light that a path beyond the limits finds after `counted` bounces that count.
    #[cold]
    pub(super) fn add_light(&mut self, counted: u16, radiance: DVec3, stage: &Scatter) {
        add_at(&mut self.bounces.light, stage.limits.beyond(counted), luminance(radiance) / self.share);
    }
}

fn add_at(values: &mut Vec<f64>, index: usize, value: f64) {
    if values.len() <= index {
        values.resize(index + 1, 0.0);
    }
    values[index] += value;
}

impl Buffers {
    /// Finds the lobes of the vertices of a limited generation.
    pub(super) fn find_scattering(
        &mut self,
        generation: &RayGeneration,
        world: &World,
        stage: &Scatter,
        depth: u32,
    ) {
        let Buffers { left_out, paths, vertices, .. } = self;
        let LeftOutPaths { share, lobes, any_scatters, has_unlimited, bounces, .. } = left_out;
        *has_unlimited = false;
        let unlimited = paths.iter().filter(|path| path.scattering != Scattering::OfPicture);
        for path in unlimited.filter(|_| stage.measures_left_out) {
            *has_unlimited = true;
            let needed = path.scattering.needed(path.counted);
            add_at(&mut bounces.rays, stage.limits.beyond(needed), 1.0 / *share);
        }
        lobes.clear();
        *any_scatters = false;
        if !*has_unlimited && stage.limits.specular.is_none() {
            return;
        }
        let surfaces = &*generation.surfaces;
        for (material, range) in surfaces.by_material() {
            let has_delta = can_be_delta(&world.materials[*material as usize]);
            for i in range.clone() {
                let path = &paths[surfaces.ray_of()[i] as usize];
                let found = match path.scattering {
                    Scattering::OfPicture => lobes_within(&stage.limits, path, depth),
                    Scattering::Unlimited
                    | Scattering::BeyondSpecular
                    | Scattering::Repeated(LeftOutLobes::All { .. }) => Lobes::ALL,
                    Scattering::Repeated(LeftOutLobes::Rough) => Lobes { rough: true, delta: false },
                    Scattering::Repeated(LeftOutLobes::Delta) => Lobes { rough: false, delta: true },
                };
                lobes.resize(lobes.len().max(i + 1), Lobes::ALL);
                lobes[i] = found;
                let is_delta = || has_delta || vertices.crossing(i).is_hidden;
                *any_scatters |= found.rough || found.delta && is_delta();
            }
        }
    }

    /// Removes light samples and continuations by lobes that vertices do not have.
    pub(super) fn drop_ended(&mut self) {
        let Buffers { left_out, light_samples, continuations, .. } = self;
        for (i, lobes) in left_out.lobes.iter().enumerate() {
            if !lobes.rough {
                light_samples.iter_mut().for_each(|samples| samples.pdf[i] = 0.0);
            }
            let is_delta = continuations.pdf[i].is_infinite();
            if !(if is_delta { lobes.delta } else { lobes.rough }) {
                continuations.pdf[i] = 0.0;
            }
        }
    }

    /// Adds a share of the rays whose vertices are limited to the next generation.
    pub(super) fn list_repeated(
        &mut self,
        stage: &Scatter,
        (generation, next): (&RayGeneration, &mut RayGeneration),
        depth: u32,
    ) {
        for (ray, path) in self.paths.iter().enumerate() {
            if path.scattering != Scattering::OfPicture {
                continue;
            }
            let left_out = match lobes_within(&stage.limits, path, depth) {
                Lobes { rough: true, delta: true } => continue,
                Lobes { rough: false, delta: false } => {
                    LeftOutLobes::All { has_specular: stage.limits.specular.is_some() }
                }
                Lobes { rough: false, delta: true } => LeftOutLobes::Rough,
                Lobes { rough: true, delta: false } => LeftOutLobes::Delta,
            };
            let camera_ray = generation.camera_rays[ray];
            let sample = self.samples[camera_ray as usize];
            let dimension = Dimension::left_out(depth);
            let [number, _] = independent_pair([sample.x, sample.y], stage.seed, sample.sample, dimension);
            let survival = path.throughput.max_element().min(1.0);
            if f64::from(number) >= self.left_out.share * survival {
                continue;
            }
            let path = Path {
                throughput: path.throughput / survival,
                scattering: Scattering::Repeated(left_out),
                ..*path
            };
            let (ray, media) = (generation.rays.get(ray), self.media.get(ray).copied());
            self.left_out.waiting.push(WaitingPath { ray, camera_ray, path, media });
        }
        // Where all rays of a full batch continue by specular lobes, there is no room beside them.
        let waiting = &mut self.left_out.waiting;
        let room = (RAYS_PER_BATCH - next.rays.len()).min(waiting.len());
        if room > 0 && self.radiance.len() < 2 * self.samples.len() {
            self.radiance.resize(2 * self.samples.len(), DVec3::ZERO);
        }
        for WaitingPath { ray, camera_ray, path, media } in waiting.drain(..room) {
            next.rays.push(&ray);
            // Sources are read by mirror reflections of local shading only.
            next.sources.push(u32::MAX);
            next.camera_rays.push(camera_ray);
            self.next.push(path);
            self.next_media.extend(media);
        }
    }

    /// Moves the light left out of the paths of a pass to the buffer of its effect.
    pub(super) fn hand_over_left_out(&mut self, tile: &mut Tile) {
        let Buffers { samples, radiance, left_out, .. } = self;
        let share = left_out.share;
        let of = |section: usize| radiance.get(section * samples.len()..).unwrap_or_default();
        let (by_depth, by_clamp) = (of(1), of(2));
        let value = |section: &[DVec3], i: usize| section.get(i).copied().unwrap_or_default();
        tile.with_buffers(|into: &mut LeftOut, _| {
            into.samples.clear();
            let samples = samples.iter().take(by_depth.len()).enumerate();
            into.samples.extend(samples.filter_map(|(i, sample)| {
                let (by_depth, by_clamp) = (value(by_depth, i), value(by_clamp, i));
                let is_whole = by_depth == DVec3::ZERO && by_clamp == DVec3::ZERO;
                let index = *sample;
                (!is_whole).then(|| LeftOutSample { index, by_depth: by_depth / share, by_clamp })
            }));
            into.bounces.add(&left_out.bounces);
        });
        left_out.bounces.light.clear();
        left_out.bounces.rays.clear();
    }
}
