//! Records one pixel's samples while it is rendered.
//!
//! Stages call [`Tile::record`] once a tile, after they have filled their buffers; without a [`Recorder`] in the tile
//! that is one test of a pointer. No stage computes anything else because of it: recorded pictures have the same bits.

use std::ops::Range;

use super::RayKind;
use super::record::{HitRecord, LayerRecord, RayRecord, SampleRecord, ShadowRayRecord};
use super::samples::{SampleIndex, TileSamples, list_samples};
use super::tile::Tile;
use super::transparency::layer_weight;
use crate::bvh::detail::Rays;
use crate::world::World;

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
    /// The filtered colour, before unlit surfaces and a backdrop are composited with it.
    pub filtered: [f32; 3],
    /// The number of samples of earlier passes.
    earlier: usize,
}

impl Recorder {
    /// A recorder of the pixel, with the rays of the samples whose index is in `traced`.
    pub fn new(pixel: [u32; 2], traced: Range<u32>) -> Self {
        Recorder { pixel, traced, ..Recorder::default() }
    }

    /// The records of a generation's rays.
    pub(super) fn rays(&mut self, depth: usize) -> impl Iterator<Item = &mut RayRecord> {
        self.samples[self.earlier..].iter_mut().filter_map(move |sample| sample.rays.get_mut(depth))
    }

    /// The records of a generation's rays that hit, each with the index of its surface.
    pub(super) fn surfaces(&mut self, depth: usize) -> impl Iterator<Item = (usize, &mut RayRecord)> {
        self.rays(depth).filter(|ray| ray.hit.is_some()).map(|ray| (ray.index, ray))
    }

    /// Records the rays of the current generation with their surfaces.
    pub(super) fn add_generation(&mut self, kind: RayKind, tile: &Tile, world: &World) {
        let (depth, generation) = (tile.depth, &tile.generations[tile.current]);
        if depth == 0 {
            self.start_pass(tile);
        }
        let surfaces = &generation.surfaces;
        for sample in &mut self.samples[self.earlier..] {
            let index = match sample.rays.last() {
                None if depth == 0 && self.traced.contains(&sample.index) => Some(sample.camera_ray),
                Some(parent) if parent.depth + 1 == depth && parent.hit.is_some() => {
                    generation.sources.iter().position(|&source| source as usize == parent.index)
                }
                _ => None,
            };
            let Some(index) = index else { continue };
            let ray = generation.rays.get(index);
            let surface = surfaces.ray_of().iter().position(|&ray| ray as usize == index);
            sample.rays.push(RayRecord {
                kind,
                depth,
                parent: depth.checked_sub(1),
                origin: ray.origin(),
                direction: ray.direction(),
                hit: surface.map(|surface| HitRecord::new(world, &ray, &surfaces.get(surface))),
                shadow_rays: Vec::new(),
                local: None,
                path: None,
                index: surface.unwrap_or(index),
            });
        }
    }

    /// Lists the samples of the pixel in a pass.
    fn start_pass(&mut self, tile: &Tile) {
        self.earlier = self.samples.len();
        let mut indices = Vec::new();
        list_samples(tile, &mut indices);
        let samples = tile.buffers::<TileSamples>();
        let positions = samples.map(|samples| samples.film_positions());
        let signs: Option<Vec<f64>> =
            samples.map(|samples| samples.of_pass(&indices).map(|(_, sign, _)| sign).collect());
        for (i, &index) in indices.iter().enumerate() {
            let SampleIndex { x, y, sample } = index;
            if [x, y] == self.pixel && samples.is_none_or(|samples| samples.is_counted(index)) {
                let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let layer = layer_weight(tile, i);
                self.samples.push(SampleRecord {
                    index: sample,
                    film_position: positions.map_or(centre, |(x, y)| [x[i], y[i]]),
                    weight: signs.as_ref().map_or(1.0, |signs| signs[i]),
                    layer: layer.map(|[transmittance, opacity]| LayerRecord { transmittance, opacity }),
                    camera_ray: i,
                    ..SampleRecord::default()
                });
            }
        }
    }

    /// Records the colours of the pass's samples.
    pub(super) fn add_colours(&mut self, tile: &Tile) {
        for sample in &mut self.samples[self.earlier..] {
            let ray = sample.camera_ray;
            sample.colour = tile.pixels[ray];
            sample.coverage = tile.coverage.as_ref().map(|coverage| coverage[ray]);
            sample.unlit = tile.shown.as_ref().map(|shown| shown[ray]).filter(|shown| shown[3] > 0.0);
        }
    }

    /// Records the filtered colour of the pixel.
    pub(crate) fn add_filtered(&mut self, tile: &Tile) {
        self.filtered = tile.pixels.first().copied().unwrap_or_default();
    }

    /// Records occlusion tests, each from one of `surfaces` of a generation. `kind` has the index of the light, too, in
    /// local shading.
    pub(super) fn add_tests(
        &mut self,
        kind: (RayKind, Option<usize>),
        (world, depth): (&World, usize),
        surfaces: &[u32],
        rays: Rays,
        occluded: &[bool],
    ) {
        for (surface, record) in self.surfaces(depth) {
            let Some(k) = surfaces.iter().position(|&tested| tested as usize == surface) else { continue };
            record.shadow_rays.push(ShadowRayRecord::new(world, kind, &rays.get(k), occluded[k]));
        }
    }
}
