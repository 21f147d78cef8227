//! A record of one pixel: its rays and what stages computed at them, in the numbers that stages computed with.
//!
//! Stages call [`Tile::record`] once a tile, after they have filled their buffers; without a [`Recorder`] in the tile
//! that is one test of a pointer. No stage computes anything else because of it: recorded pictures have the same bits.

use std::ops::Range;

use glam::DVec3;
use serde::Serialize;

use super::RayKind;
use super::samples::{SampleIndex, TileSamples, list_samples};
use super::tile::Tile;
use super::transparency::layer_weight;
use crate::geometry::{Ray, Rays};
use crate::shading::SurfaceTerms;
use crate::world::SurfaceInteraction;

/// Records the samples of a pixel.
#[derive(Debug, Default)]
pub struct Recorder {
    /// Column and row of the pixel.
    pixel: [u32; 2],
    /// The samples, by index, whose rays are recorded.
    traced: Range<u32>,
    /// All samples of the pixel, in the order in which they are summed; where camera rays see layers of transparent
    /// surfaces, one entry a layer, the nearest first.
    pub samples: Vec<SampleRecord>,
    /// The rays, each after the one that it continues.
    pub rays: Vec<RayRecord>,
    /// The filtered colour, before unlit surfaces and a backdrop are composited with it.
    pub filtered: [f32; 3],
    /// For each camera ray of the pass, its index in `samples`.
    pass: Vec<Option<usize>>,
    /// By depth: for each ray and for each surface of the generation, the index in `rays`.
    of_ray: Vec<Vec<Option<usize>>>,
    of_surface: Vec<Vec<Option<usize>>>,
}

/// A sample of the pixel, or a layer of it.
#[derive(Debug, Clone, Default)]
pub struct SampleRecord {
    /// The index of the sample.
    pub index: u32,
    /// The film position in pixels, right of and below the picture's top left corner.
    pub film_position: [f64; 2],
    /// The sign of its filter weight.
    pub sign: f64,
    /// Of a layer: the transmittance of the layers before it, and its opacity.
    pub layer: Option<[f64; 2]>,
    /// The colour that enters the sum.
    pub colour: [f32; 3],
    /// The part that surfaces cover, in pictures with an alpha channel.
    pub coverage: Option<f32>,
    /// [`Tile::shown`].
    pub unlit: Option<[f32; 4]>,
    /// The index of its camera ray in [`Recorder::rays`]; `None` if that is not recorded.
    pub ray: Option<usize>,
}

/// A ray that was traced to its closest hit.
#[derive(Debug, Clone)]
pub struct RayRecord {
    /// Its kind.
    pub kind: RayKind,
    /// Its generation.
    pub depth: usize,
    /// The index of the ray whose surface it leaves.
    pub parent: Option<usize>,
    /// The ray.
    pub ray: Ray,
    /// The surface that it hits.
    pub surface: Option<SurfaceInteraction>,
    /// The occlusion tests from that surface.
    pub tests: Vec<OcclusionTest>,
    /// Local shading of the surface.
    pub local: Option<LocalRecord>,
    /// What a path does there, or finds infinitely far away.
    pub vertex: Option<PathVertex>,
}

/// An occlusion test.
#[derive(Debug, Clone, Copy)]
pub struct OcclusionTest {
    /// Its kind.
    pub kind: RayKind,
    /// The index of the light that it leads to, in local shading.
    pub light: Option<usize>,
    /// The ray.
    pub ray: Ray,
    /// Whether it is occluded.
    pub is_occluded: bool,
}

/// Local shading of a surface. Colours are in the numbers of the pipeline.
#[derive(Debug, Clone)]
pub struct LocalRecord {
    /// The lights at the surface.
    pub lights: Vec<LightAtSurface>,
    /// The terms.
    pub terms: SurfaceTerms,
    /// The colour before reflections are blended with it.
    pub colour: DVec3,
    /// The reflection that is blended with it.
    pub blend: Option<Blend>,
}

/// A light at a surface, in local shading.
#[derive(Debug, Clone, Copy)]
pub struct LightAtSurface {
    /// The cosine between shading normal and light.
    pub cosine: f64,
    /// The incident radiance, times the transmittance of transparent surfaces in the way.
    pub radiance: DVec3,
    /// Whether the light is above the horizon, not occluded, and returned by the material.
    pub reaches: bool,
}

/// A blended reflection.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Blend {
    /// The colour that the mirrored ray found.
    pub mirrored: DVec3,
    /// The weight of the surface's own colour, and of that.
    pub weights: [f64; 2],
    /// The blended colour.
    pub colour: DVec3,
}

/// A vertex of a path, or what a ray that missed found.
#[derive(Debug, Clone)]
pub struct PathVertex {
    /// The throughput, with the transmittance of the medium up to the surface.
    pub throughput: DVec3,
    /// What the path adds for what the surface emits, or for what is infinitely far away.
    pub emission: Option<Emission>,
    /// The light samples.
    pub lights: Vec<LightSampleRecord>,
    /// The sampled direction; `None` at the last vertex that the depth allows.
    pub continuation: Option<ContinuationRecord>,
}

/// Radiance that a path found.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Emission {
    /// The emitted radiance. That from infinitely far away is the sum over environment and lights, each times its
    /// weight.
    pub radiance: DVec3,
    /// The weight of multiple importance sampling.
    pub weight: f64,
    /// What is added to the sample: throughput times radiance times weight, limited by the clamp; 0 if not finite.
    pub adds: DVec3,
}

/// Where a light sample lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightSource {
    /// On the light of this index.
    Light(usize),
    /// On an emissive surface.
    Emitters,
    /// In the environment.
    Environment,
}

/// A light sample with a shadow ray.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LightSampleRecord {
    /// Where it lies.
    #[serde(skip)]
    pub source: LightSource,
    /// The direction towards it.
    pub direction: DVec3,
    /// The incident radiance.
    pub radiance: DVec3,
    /// The density per solid angle times the expected number of samples of the light; infinite for lights without size.
    pub pdf: f64,
    /// The value of the BSDF times the cosine, and the density with which the BSDF samples that direction.
    pub bsdf: DVec3,
    /// See `bsdf`.
    pub bsdf_pdf: f64,
    /// The weight of multiple importance sampling.
    pub weight: f64,
    /// What it adds if it is visible: throughput, BSDF, radiance and weight over the density, times the transmittance
    /// of the medium, limited by the clamp.
    pub if_visible: DVec3,
    /// What it adds.
    pub adds: DVec3,
}

/// The direction that a path's vertex samples by its BSDF.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ContinuationRecord {
    /// The sampled direction; `None` if the BSDF gives none.
    pub sample: Option<SampledDirection>,
    /// Russian roulette; `None` where it is not played.
    pub roulette: Option<Roulette>,
    /// The throughput of the continued path; `None` if it ends.
    pub throughput: Option<DVec3>,
}

/// A direction sampled by a BSDF.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct SampledDirection {
    /// The unit direction.
    pub direction: DVec3,
    /// The value of the BSDF times the cosine, over the density.
    pub weight: DVec3,
    /// The density per solid angle; infinite for delta lobes.
    pub pdf: f64,
}

/// Russian roulette.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Roulette {
    /// The probability with which the path continues.
    pub probability: f64,
    /// The random number, which has to be less.
    pub number: f64,
}

impl Recorder {
    /// A recorder of the pixel, with the rays of the samples whose index is in `traced`.
    pub fn new(pixel: [u32; 2], traced: Range<u32>) -> Self {
        Recorder { pixel, traced, ..Recorder::default() }
    }

    /// The records of a generation's rays.
    pub(super) fn of_rays(&mut self, depth: usize) -> impl Iterator<Item = (usize, &mut RayRecord)> {
        records(&self.of_ray, &mut self.rays, depth)
    }

    /// The index of each recorded surface of a generation with its record.
    pub(super) fn of_surfaces(&mut self, depth: usize) -> impl Iterator<Item = (usize, &mut RayRecord)> {
        records(&self.of_surface, &mut self.rays, depth)
    }

    /// Records the rays of the current generation with their surfaces.
    pub(super) fn add_generation(&mut self, kind: RayKind, tile: &Tile) {
        let (depth, generation) = (tile.depth, &tile.generations[tile.current]);
        if depth == 0 {
            self.start_pass(tile);
        }
        self.of_ray.truncate(depth);
        self.of_surface.truncate(depth);
        let mut of_ray = vec![None; generation.rays.len()];
        for (index, id) in of_ray.iter_mut().enumerate() {
            let sample = if depth == 0 { self.pass[index] } else { None };
            let parent = (depth > 0)
                .then(|| self.of_surface[depth - 1].get(generation.sources[index] as usize).copied());
            let parent = parent.flatten().flatten();
            let is_traced = sample.is_some_and(|sample| self.traced.contains(&self.samples[sample].index));
            if !is_traced && parent.is_none() {
                continue;
            }
            *id = Some(self.rays.len());
            if let Some(sample) = sample {
                self.samples[sample].ray = *id;
            }
            self.rays.push(RayRecord {
                kind,
                depth,
                parent,
                ray: generation.rays.get(index),
                surface: None,
                tests: Vec::new(),
                local: None,
                vertex: None,
            });
        }
        let surfaces = &generation.surfaces;
        let of_surface = surfaces.ray_of().iter().enumerate().map(|(i, &ray)| {
            let id = of_ray[ray as usize]?;
            self.rays[id].surface = Some(surfaces.get(i));
            Some(id)
        });
        self.of_surface.push(of_surface.collect());
        self.of_ray.push(of_ray);
    }

    /// Lists the samples of the pixel in a pass.
    fn start_pass(&mut self, tile: &Tile) {
        let mut indices = Vec::new();
        list_samples(tile, &mut indices);
        let samples = tile.buffers::<TileSamples>();
        let signs: Vec<f64> = samples
            .map_or(Vec::new(), |samples| samples.of_pass(&indices).map(|(_, sign, _)| sign).collect());
        self.pass.clear();
        for (i, &index) in indices.iter().enumerate() {
            let SampleIndex { x, y, sample } = index;
            let is_own = [x, y] == self.pixel && samples.is_none_or(|samples| samples.is_counted(index));
            self.pass.push(is_own.then_some(self.samples.len()));
            if is_own {
                let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let film_position = samples.map_or(centre, |samples| {
                    let (x, y) = samples.film_positions();
                    [x[i], y[i]]
                });
                let (sign, layer) = (signs.get(i).copied().unwrap_or(1.0), layer_weight(tile, i));
                let record =
                    SampleRecord { index: sample, film_position, sign, layer, ..SampleRecord::default() };
                self.samples.push(record);
            }
        }
    }

    /// Records the colours of the pass's samples.
    pub(super) fn add_colours(&mut self, tile: &Tile) {
        for (ray, sample) in self.pass.iter().enumerate() {
            let Some(sample) = sample.map(|sample| &mut self.samples[sample]) else { continue };
            sample.colour = tile.pixels[ray];
            sample.coverage = tile.coverage.as_ref().map(|coverage| coverage[ray]);
            sample.unlit = tile.shown.as_ref().map(|shown| shown[ray]).filter(|shown| shown[3] > 0.0);
        }
    }

    /// Records the filtered colour of the pixel.
    pub(crate) fn add_filtered(&mut self, tile: &Tile) {
        self.filtered = tile.pixels.first().copied().unwrap_or_default();
    }

    /// Records occlusion tests, each from a surface of a generation.
    pub(super) fn add_tests(
        &mut self,
        (kind, light): (RayKind, Option<usize>),
        depth: usize,
        surfaces: impl Iterator<Item = usize>,
        rays: Rays,
        occluded: &[bool],
    ) {
        for ((surface, ray), &is_occluded) in surfaces.zip(rays.iter()).zip(occluded) {
            if let Some(id) = self.of_surface[depth][surface] {
                self.rays[id].tests.push(OcclusionTest { kind, light, ray, is_occluded });
            }
        }
    }
}

/// The records of a generation, with the indices of their rays or surfaces.
fn records<'a>(
    ids: &'a [Vec<Option<usize>>],
    records: &'a mut [RayRecord],
    depth: usize,
) -> impl Iterator<Item = (usize, &'a mut RayRecord)> {
    let mut by_id: Vec<Option<usize>> = vec![None; records.len()];
    for (index, id) in ids.get(depth).into_iter().flatten().enumerate() {
        if let Some(id) = id {
            by_id[*id] = Some(index);
        }
    }
    by_id.into_iter().zip(records).filter_map(|(index, record)| Some((index?, record)))
}
