//! Albedo and shading normal of a tile's pixels, for denoisers, and the objects that cover them, for mattes: means over
//! the samples of a pixel, with the picture's filter, textures and normal maps.

use crate::effects::samples::{SampleSum, TileSamples};
use crate::effects::tile::Tile;
use crate::effects::{Plan, id, transparency};
use crate::film::ReconstructionFilter;
use crate::scene::TextureSlot;
use crate::shading::base_colour;
use crate::world::World;

/// The features of a pixel.
#[derive(Debug, Clone, Default)]
pub(super) struct Features {
    /// Albedo and normal of the first surface; 0 for the background.
    pub first: [[f32; 3]; 2],
    /// The same of the first surface of a path that is neither a smooth mirror nor clear glass. Local shading has
    /// neither.
    pub behind_mirrors: [[f32; 3]; 2],
    /// The objects that the pixel shows first, each with the part of the pixel that it covers; empty if nothing reads
    /// them.
    pub covered: Vec<(u32, f64)>,
}

/// The first surface of a camera ray.
#[derive(Clone, Copy)]
pub(super) struct FirstSurface {
    /// Albedo and normal.
    features: [[f32; 3]; 2],
    /// The index of its object.
    object: u32,
}

/// What a ray adds to its pixel: the object of its first surface, and the values of [`Features`].
type RayFeatures = (u32, [[[f32; 3]; 2]; 2]);

/// Objects, each with the number of samples that show it, and of those among them with negative sign.
type ObjectCounts = Vec<(u32, [u32; 2])>;

/// The plan that gives the features of a picture, where it is not the picture's own: without light, which decides the
/// samples of adaptive sampling and the paths behind mirrors.
pub(super) fn plan_without_light(plan: &Plan, world: &World, has_mirrors: bool) -> Option<Plan> {
    let is_needed = [id::TEXTURES, id::NORMAL_MAPS, id::ALPHA, id::ANTIALIASING, id::DEPTH_OF_FIELD];
    let decides = plan.is_adaptive() || has_mirrors && plan.transport.traces_paths();
    (!decides).then(|| plan.keeping(world, |i| is_needed.contains(&plan.decisions[i].effect)))
}

/// The filter of a plan's samples, if it takes some. Its tables take as long as some tiles, so there is one for all.
pub(super) fn filter_of(plan: &Plan) -> Option<ReconstructionFilter> {
    let (shape, radius) = plan.sampling.shape_and_radius();
    plan.takes_samples().then(|| ReconstructionFilter::new(shape, radius))
}

/// Collects the features of a tile's pixels pass by pass.
#[derive(Default)]
pub(super) struct FeatureSums {
    sums: Vec<[SampleSum; 4]>,
    /// For each pixel, the objects that its samples show; `None` if nothing reads them.
    objects: Option<Vec<ObjectCounts>>,
    /// Of pictures with one sample a pixel.
    centres: Vec<Option<RayFeatures>>,
}

impl FeatureSums {
    pub(super) fn new(tile: &mut Tile, has_objects: bool) -> Self {
        tile.scattering = Some(Vec::new());
        FeatureSums { objects: has_objects.then(Vec::new), ..FeatureSums::default() }
    }

    /// Adds the camera rays of the pass that the stages have run, with [`first_surfaces`].
    pub(super) fn add_pass(&mut self, plan: &Plan, tile: &mut Tile, first: Vec<Option<FirstSurface>>) {
        let behind_mirrors = tile.scattering.as_deref().unwrap_or_default();
        let with_mirrors = |(ray, first): (usize, Option<FirstSurface>)| {
            let scattering = behind_mirrors.get(ray).map(|found| found.unwrap_or_default());
            first
                .map(|FirstSurface { features, object }| (object, [features, scattering.unwrap_or(features)]))
        };
        let rays: Vec<Option<RayFeatures>> = first.into_iter().enumerate().map(with_mirrors).collect();
        if plan.takes_samples() {
            tile.with_buffers(|samples: &mut TileSamples, _| {
                self.sums.resize(samples.sums().len(), [SampleSum::default(); 4]);
                for (pixel, sign, ray) in samples.counted_of_pass(&rays) {
                    let values = ray.map(|(_, values)| values).unwrap_or_default();
                    let pairs = self.sums[pixel].iter_mut().zip(values.as_flattened());
                    pairs.for_each(|(sum, &value)| sum.add(value, sign));
                }
                if let Some(objects) = &mut self.objects {
                    objects.resize(samples.sums().len(), Vec::new());
                    for (pixel, sign, ray) in samples.counted_of_pass(&rays) {
                        ray.iter().for_each(|&(object, _)| count(&mut objects[pixel], object, sign < 0.0));
                    }
                }
            });
            return;
        }
        // A pass of such a picture is a layer; AOVs show the first that is visible.
        self.centres.resize(rays.len(), None);
        let opacities = transparency::layer_opacities(tile);
        for (i, (pixel, ray)) in self.centres.iter_mut().zip(rays).enumerate() {
            if opacities.is_none_or(|opacities| opacities[i] >= transparency::VISIBLE_FROM) {
                *pixel = pixel.or(ray);
            }
        }
    }

    /// The features of the tile's pixels. `filter` is that of a plan that takes samples ([`filter_of`]).
    pub(super) fn finish(self, filter: Option<&ReconstructionFilter>, tile: &mut Tile) -> Vec<Features> {
        tile.scattering = None;
        let Some(filter) = filter else {
            let has_objects = self.objects.is_some();
            let of_centre = |centre: Option<RayFeatures>| {
                let (first, behind_mirrors) = centre.map(|(_, [a, b])| (a, b)).unwrap_or_default();
                let covered = centre.filter(|_| has_objects).map(|(object, _)| (object, 1.0));
                Features { first, behind_mirrors, covered: covered.into_iter().collect() }
            };
            return self.centres.into_iter().map(of_centre).collect();
        };
        let value = |sum: &SampleSum| sum.value(filter).as_vec3().to_array();
        let of_pixel = |pixel: usize| {
            let [a, b, c, d] = &self.sums[pixel];
            let objects = self.objects.as_ref().map_or(&[][..], |objects| &objects[pixel]);
            let covered = objects.iter().map(|&(object, counts)| (object, a.part(counts, filter)));
            Features {
                first: [a, b].map(value),
                behind_mirrors: [c, d].map(value),
                covered: covered.collect(),
            }
        };
        tile.with_buffers(|samples: &mut TileSamples, _| {
            samples.region().tile_pixels().map(of_pixel).collect()
        })
    }
}

/// Counts a sample of an object.
fn count(objects: &mut ObjectCounts, object: u32, is_negative: bool) {
    let index = objects.iter().position(|(known, _)| *known == object).unwrap_or_else(|| {
        objects.push((object, [0; 2]));
        objects.len() - 1
    });
    let (_, [count, negative_count]) = &mut objects[index];
    *count += 1;
    *negative_count += u32::from(is_negative);
}

/// Each camera ray's surface; `None` where it hits nothing.
pub(super) fn first_surfaces(tile: &Tile, world: &World) -> Vec<Option<FirstSurface>> {
    let generation = &tile.generations[tile.current];
    let mut rays = vec![None; generation.rays.len()];
    for (i, &ray) in generation.surfaces.ray_of().iter().enumerate() {
        let surface = generation.surfaces.get(i);
        let texel = generation.surfaces.texels.get(TextureSlot::BaseColour, i);
        let albedo = base_colour(world, &surface, texel);
        let features = [albedo, surface.shading_normal].map(|value| value.as_vec3().to_array());
        rays[ray as usize] = Some(FirstSurface { features, object: surface.object });
    }
    rays
}
