//! What is recorded of a pixel's samples: their rays, and what stages computed at them, in the numbers that stages
//! computed with. Plain data, which [`crate::job::pixel`] prints as text and as JSON.
//!
//! [`super::recorder`] fills it. Positions and lengths are in world coordinates until [`SampleRecord::move_back`].

use glam::{DVec2, DVec3};
use serde::{Serialize, Serializer};

use super::RayKind;
use crate::bvh::{Primitive, Ray, Traversal};
use crate::error::printable;
use crate::film::rounding::quantise;
use crate::shading::SurfaceTerms;
use crate::world::{Recentering, SurfaceInteraction, World};

/// A sample of the pixel, or a layer of it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct SampleRecord {
    /// The index of the sample.
    pub index: u32,
    /// The film position in pixels, right of and below the picture's top left corner.
    pub film_position: [f64; 2],
    /// Its weight, 1 or -1: samples are distributed as the reconstruction filter.
    pub weight: f64,
    /// Of a layer of transparent surfaces, which are summed.
    pub layer: Option<LayerRecord>,
    /// The colour that enters the sum.
    pub colour: [f32; 3],
    /// The part that surfaces cover, in pictures with an alpha channel.
    pub coverage: Option<f32>,
    /// Displayed colour times coverage, and coverage, of an unlit surface.
    pub unlit: Option<[f32; 4]>,
    /// Its rays, one of each generation from the camera ray on; empty if they are not recorded.
    pub rays: Vec<RayRecord>,
    /// The index of its camera ray in the tile.
    #[serde(skip)]
    pub(super) camera_ray: usize,
}

/// A layer of transparent surfaces.
#[derive(Debug, Clone, Serialize)]
pub struct LayerRecord {
    /// The transmittance of the layers before it.
    pub transmittance: f64,
    /// Its opacity. Its colour is multiplied by both.
    pub opacity: f64,
}

/// A ray that was traced to its closest hit.
#[derive(Debug, Clone, Serialize)]
pub struct RayRecord {
    /// The kind.
    pub kind: RayKind,
    /// The number of bounces between camera and ray.
    pub depth: usize,
    /// The index in the sample's rays of the one whose surface it leaves.
    pub parent: Option<usize>,
    /// The origin.
    pub origin: DVec3,
    /// The unit direction.
    pub direction: DVec3,
    /// The surface that it hits.
    pub hit: Option<HitRecord>,
    /// The occlusion tests from there, but for those of light samples.
    pub shadow_rays: Vec<ShadowRayRecord>,
    /// Local shading there.
    pub local: Option<LocalRecord>,
    /// What a path does there, or finds infinitely far away.
    pub path: Option<PathRecord>,
    /// Its index in its generation: among the surfaces if it hits one, otherwise among the rays.
    #[serde(skip)]
    pub(super) index: usize,
}

/// A surface at a hit.
#[derive(Debug, Clone, Serialize)]
pub struct HitRecord {
    /// The distance from the ray's origin.
    pub t: f64,
    /// The object's name.
    pub object: String,
    /// `triangle`, or the name of an analytic shape.
    pub shape: &'static str,
    /// The primitive's number in the scene.
    pub primitive: u32,
    /// The primitive's number in its object.
    pub primitive_of_object: u32,
    /// The material's name.
    pub material: String,
    /// The index of the material.
    #[serde(skip)]
    pub material_index: u32,
    /// The position.
    pub position: DVec3,
    /// The unit geometric normal, on the side of the ray's origin.
    pub geometric_normal: DVec3,
    /// The unit shading normal: interpolated vertex normals and normal maps applied.
    pub shading_normal: DVec3,
    /// The barycentrics u, v and w, on a triangle.
    pub barycentrics: Option<[f64; 3]>,
    /// Texture coordinates.
    pub uv: Option<DVec2>,
}

/// An occlusion test.
#[derive(Debug, Clone, Serialize)]
pub struct ShadowRayRecord {
    /// The kind.
    pub kind: RayKind,
    /// The light, in local shading.
    pub light: Option<String>,
    /// The origin.
    pub origin: DVec3,
    /// The unit direction.
    pub direction: DVec3,
    /// The length; `null` in JSON if it is infinite.
    pub length: f64,
    /// Whether it is occluded.
    pub is_occluded: bool,
    /// The nearest object in its way, if it is occluded.
    pub occluder: Option<Occluder>,
}

/// An object in the way of a shadow ray.
#[derive(Debug, Clone, Serialize)]
pub struct Occluder {
    /// Its name.
    pub object: String,
    /// Its distance from the ray's origin.
    pub t: f64,
}

/// Local shading of a surface. Colours are in the numbers of the pipeline.
#[derive(Debug, Clone, Serialize)]
pub struct LocalRecord {
    /// The lights.
    pub lights: Vec<LightRecord>,
    /// The terms.
    #[serde(flatten)]
    pub terms: SurfaceTerms,
    /// The colour, clamped to the range of the pipeline, before glaze.
    pub colour: DVec3,
    /// Glaze: the reflection and the blended colour.
    pub glaze: Option<GlazeRecord>,
    /// The steps in 8-bit values, in the pipeline `u8`.
    pub steps_8_bit: Option<Steps8Bit>,
}

/// A light at a surface, in local shading.
#[derive(Debug, Clone, Serialize)]
pub struct LightRecord {
    /// Its name.
    pub light: String,
    /// The cosine between shading normal and light.
    pub cosine: f64,
    /// The incident radiance, times the transmittance of transparent surfaces in the way.
    pub radiance: DVec3,
    /// Whether it reaches the surface: not below the horizon, not occluded, and returned by the material.
    pub reaches: bool,
}

/// A blended reflection.
#[derive(Debug, Clone, Serialize)]
pub struct GlazeRecord {
    /// The colour that the mirrored ray found.
    pub mirrored: DVec3,
    /// The weight of the surface's own colour, and of that.
    pub weights: [f64; 2],
    /// The blended colour.
    pub colour: DVec3,
}

/// The values of local shading in the pipeline `u8`, each rounded to 8 bits.
#[derive(Debug, Clone, Serialize)]
pub struct Steps8Bit {
    /// The base colour.
    pub own: [u8; 3],
    /// `mix_light` of the base colour and the sum of the terms.
    pub colour: [u8; 3],
    /// The colour that the mirrored ray found.
    pub mirrored: Option<[u8; 3]>,
    /// `weighted_combine` of both.
    pub glazed: Option<[u8; 3]>,
}

/// A vertex of a path, or what a ray found infinitely far away.
#[derive(Debug, Clone, Serialize)]
pub struct PathRecord {
    /// The throughput, with the transmittance of the medium up to the surface.
    pub throughput: DVec3,
    /// What the surface emits, or what is infinitely far away.
    pub emission: Option<EmissionRecord>,
    /// The light samples that could add something.
    pub light_samples: Vec<LightSampleRecord>,
    /// The direction sampled by the BSDF; `None` at the last vertex that the depth allows.
    pub bsdf_sample: Option<ContinuationRecord>,
    /// Why the path ends; `None` if it continues.
    pub end: Option<&'static str>,
}

/// Radiance that a path found.
#[derive(Debug, Clone, Serialize)]
pub struct EmissionRecord {
    /// The emitted radiance. That from infinitely far away is the sum over environment and lights, each times its
    /// weight.
    pub radiance: DVec3,
    /// The weight of multiple importance sampling.
    pub weight: f64,
    /// What is added to the sample: throughput times radiance times weight, limited by the clamp; 0 if not finite.
    pub adds: DVec3,
}

/// A light sample with its shadow ray.
#[derive(Debug, Clone, Serialize)]
pub struct LightSampleRecord {
    /// The light by name, `environment`, or `emissive surfaces`.
    pub light: String,
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
    /// What it adds: 0 if it is occluded, otherwise `if_visible` times the transmittance of transparent surfaces.
    pub adds: DVec3,
    /// The shadow ray.
    pub shadow_ray: ShadowRayRecord,
}

/// The direction that a path's vertex samples by its BSDF.
#[derive(Debug, Clone, Serialize)]
pub struct ContinuationRecord {
    /// The sampled direction; `None` if the BSDF gives none.
    pub sample: Option<DirectionRecord>,
    /// Russian roulette; `None` where it is not played.
    pub roulette: Option<RouletteRecord>,
    /// The throughput of the continued path; `None` if it ends.
    pub throughput: Option<DVec3>,
}

/// A direction sampled by a BSDF.
#[derive(Debug, Clone, Serialize)]
pub struct DirectionRecord {
    /// The unit direction.
    pub direction: DVec3,
    /// The value of the BSDF times the cosine, over the density.
    pub weight: DVec3,
    /// The density per solid angle; infinite for delta lobes.
    pub pdf: f64,
}

/// Russian roulette.
#[derive(Debug, Clone, Serialize)]
pub struct RouletteRecord {
    /// The probability with which the path continues.
    pub probability: f64,
    /// The random number, which has to be less.
    pub number: f64,
}

impl Serialize for RayKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

impl SampleRecord {
    /// Converts positions and lengths to scene coordinates.
    pub fn move_back(&mut self, recentering: &Recentering) {
        let point_back = |point: &mut DVec3| *point = recentering.point_back(*point);
        for ray in &mut self.rays {
            point_back(&mut ray.origin);
            if let Some(hit) = &mut ray.hit {
                point_back(&mut hit.position);
                hit.t /= recentering.scale;
            }
            let light_samples = ray.path.iter_mut().flat_map(|path| &mut path.light_samples);
            let of_samples = light_samples.map(|sample| &mut sample.shadow_ray);
            for shadow_ray in ray.shadow_rays.iter_mut().chain(of_samples) {
                point_back(&mut shadow_ray.origin);
                shadow_ray.length /= recentering.scale;
                shadow_ray.occluder.iter_mut().for_each(|occluder| occluder.t /= recentering.scale);
            }
        }
    }
}

impl RayRecord {
    /// The occlusion tests from its surface, those of light samples last.
    pub fn occlusion_tests(&self) -> impl Iterator<Item = &ShadowRayRecord> {
        let light_samples = self.path.iter().flat_map(|path| &path.light_samples);
        self.shadow_rays.iter().chain(light_samples.map(|sample| &sample.shadow_ray))
    }
}

impl HitRecord {
    /// The record of a surface that `ray` hits.
    pub(super) fn new(world: &World, ray: &Ray, surface: &SurfaceInteraction) -> Self {
        let &SurfaceInteraction { hit, object: index, material, geometric_normal, shading_normal, .. } =
            surface;
        let (object, [v, w]) = (&world.objects[index as usize], hit.barycentrics);
        let (shape, barycentrics) = match world.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => (shape.name(), None),
            Primitive::Triangle(_) => ("triangle", Some([1.0 - v - w, v, w])),
        };
        HitRecord {
            t: hit.t,
            object: printable(&object.name).into_owned(),
            shape,
            primitive: hit.prim.0,
            primitive_of_object: hit.prim.0 - object.first.0,
            material: printable(world.materials[material as usize].name()).into_owned(),
            material_index: material,
            position: surface.point.position,
            geometric_normal,
            shading_normal,
            barycentrics,
            uv: world.texture_point((index, &hit, geometric_normal), ray, None, 0).map(|point| point.uv),
        }
    }
}

impl LocalRecord {
    /// Sets the steps in 8-bit values.
    pub fn round(&mut self) {
        let bytes = |colour: DVec3| colour.to_array().map(quantise::<u8>);
        let glaze = self.glaze.as_ref();
        self.steps_8_bit = Some(Steps8Bit {
            own: bytes(self.terms.own),
            colour: bytes(self.colour),
            mirrored: glaze.map(|glaze| bytes(glaze.mirrored)),
            glazed: glaze.map(|glaze| bytes(glaze.colour)),
        });
    }
}

impl ShadowRayRecord {
    /// The record of an occlusion test, with the occluder, which the test itself does not find.
    pub(super) fn new(
        world: &World,
        (kind, light): (RayKind, Option<usize>),
        ray: &Ray,
        is_occluded: bool,
    ) -> Self {
        let hit = is_occluded.then(|| world.accelerator.closest_hit(ray, &mut Traversal::default()));
        ShadowRayRecord {
            kind,
            light: light.map(|light| world.light_name(light)),
            origin: ray.origin(),
            direction: ray.direction(),
            length: ray.t_max(),
            is_occluded,
            occluder: hit.flatten().map(|hit| Occluder {
                object: printable(&world.objects[world.object_of(hit.prim) as usize].name).into_owned(),
                t: hit.t,
            }),
        }
    }
}
