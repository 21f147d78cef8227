//! The report of a pixel: plain data, printed as text or as JSON.

use glam::{DVec2, DVec3};
use serde::{Serialize, Serializer};

use crate::effects::RayKind;
use crate::effects::record::{Blend, ContinuationRecord, Emission, LightSampleRecord};

/// A pixel of a picture.
#[derive(Debug, Clone, Serialize)]
pub struct PixelReport {
    /// Column and row, from the top left corner of the whole picture.
    pub pixel: [u32; 2],
    /// Width and height of the whole picture.
    pub size: [u32; 2],
    /// The 8-bit values of the pixel.
    pub displayed: [u8; 3],
    /// The 8-bit alpha, of pictures with a transparent background.
    pub alpha: Option<u8>,
    /// How the samples become these.
    pub colour: ColourReport,
    /// The transport.
    pub transport: &'static str,
    /// The number of samples.
    pub samples_taken: usize,
    /// The reconstruction filter; `None` for the one sample at the pixel's centre.
    pub filter: Option<FilterReport>,
    /// Mean and standard error of the samples' colours, without their signs; `None` for a single sample.
    pub noise: Option<NoiseReport>,
    /// The first samples, or those from the chosen one on, with their rays. Of a pixel that shows layers of transparent
    /// surfaces, one entry a layer.
    pub samples: Vec<SampleReport>,
    /// The number of samples that are not listed.
    pub samples_left_out: usize,
    /// What the report does not list.
    pub not_listed: Vec<String>,
    /// The rays as they were traced, in world coordinates.
    #[serde(skip)]
    pub traced: Vec<TracedRay>,
}

/// The steps from the samples of a pixel to its 8-bit values.
#[derive(Debug, Clone, Serialize)]
pub struct ColourReport {
    /// The colour pipeline.
    pub pipeline: &'static str,
    /// The filtered sum of the samples.
    pub filtered: [f32; 3],
    /// The same with unlit surfaces and backdrop: the value of the film. `None` where the film holds displayed colours,
    /// which exposure and tone map leave as they are.
    pub film: Option<[f32; 3]>,
    /// Exposure in EV.
    pub exposure: f64,
    /// The film value times 2^EV.
    pub exposed: Option<DVec3>,
    /// The tone map.
    pub tone_map: &'static str,
    /// Displayed linear light; in the pipelines of display values the film value.
    pub tone_mapped: DVec3,
    /// Display values from 0 to 1, before they are rounded to 8 bits.
    pub encoded: DVec3,
}

/// A reconstruction filter. The pixel is the mean of the samples; for a filter with negative lobes the mean m of the
/// colours c plus the mean of weight (c - m), divided by the mean sign.
#[derive(Debug, Clone, Serialize)]
pub struct FilterReport {
    /// Its shape.
    pub shape: &'static str,
    /// Its radius in pixels.
    pub radius: f64,
    /// The expected weight of a sample, which has the weight 1 or -1.
    pub mean_sign: f64,
}

/// What all samples of a pixel say of its noise.
#[derive(Debug, Clone, Serialize)]
pub struct NoiseReport {
    /// The mean of the colours.
    pub mean: DVec3,
    /// Their standard deviation over the square root of their number.
    pub standard_error: DVec3,
}

/// A sample.
#[derive(Debug, Clone, Serialize)]
pub struct SampleReport {
    /// Its index.
    pub index: u32,
    /// Film position in pixels, right of and below the picture's top left corner.
    pub film_position: [f64; 2],
    /// Its weight, 1 or -1: samples are distributed as the filter, see [`FilterReport`].
    pub weight: f64,
    /// Of a layer of transparent surfaces, which are summed.
    pub layer: Option<LayerReport>,
    /// The colour that enters the sum.
    pub colour: [f32; 3],
    /// The part that surfaces cover, in pictures with an alpha channel.
    pub coverage: Option<f32>,
    /// Displayed colour times coverage, and coverage, of an unlit surface.
    pub unlit: Option<[f32; 4]>,
    /// Its rays; the first is the camera ray.
    pub rays: Vec<RayReport>,
}

/// A layer of transparent surfaces.
#[derive(Debug, Clone, Serialize)]
pub struct LayerReport {
    /// The transmittance of the layers before it.
    pub transmittance: f64,
    /// Its opacity. Its colour is multiplied by both.
    pub opacity: f64,
}

/// A ray that was traced to its closest hit.
#[derive(Debug, Clone, Serialize)]
pub struct RayReport {
    /// The kind, as in statistics.
    pub kind: &'static str,
    /// The number of bounces between camera and ray.
    pub depth: usize,
    /// The index in the sample's rays of the one whose surface it leaves.
    pub parent: Option<usize>,
    /// The origin.
    pub origin: DVec3,
    /// The unit direction.
    pub direction: DVec3,
    /// The surface that it hits.
    pub hit: Option<HitReport>,
    /// The occlusion tests from there.
    pub shadow_rays: Vec<ShadowRayReport>,
    /// Local shading there.
    pub local: Option<LocalReport>,
    /// What a path does there, or finds infinitely far away.
    pub path: Option<PathReport>,
}

/// A surface at a hit.
#[derive(Debug, Clone, Serialize)]
pub struct HitReport {
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
pub struct ShadowRayReport {
    /// The kind, as in statistics.
    pub kind: &'static str,
    /// The light, in local shading.
    pub light: Option<String>,
    /// The origin.
    pub origin: DVec3,
    /// The unit direction.
    pub direction: DVec3,
    /// The length; `null` if it is infinite.
    pub length: f64,
    /// Whether it is occluded.
    pub is_occluded: bool,
    /// The nearest object in its way.
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

/// Local shading of a surface.
#[derive(Debug, Clone, Serialize)]
pub struct LocalReport {
    /// The reflection model: `phong` (base colour times the sum of the terms), `metallic-roughness` (sum of the terms),
    /// `flat` or `unlit`.
    pub model: &'static str,
    /// The base colour C.
    pub own: DVec3,
    /// The lights.
    pub lights: Vec<LightReport>,
    /// The terms.
    pub terms: Vec<TermReport>,
    /// The sum of the terms, of `phong`.
    pub light: Option<DVec3>,
    /// The colour, clamped to the range of the pipeline, before glaze.
    pub colour: DVec3,
    /// Glaze: the reflection and the blended colour.
    pub glaze: Option<Blend>,
    /// The steps in 8-bit values, in the pipeline `u8`.
    pub steps_8_bit: Option<Steps8Bit>,
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

/// A light at a surface.
#[derive(Debug, Clone, Serialize)]
pub struct LightReport {
    /// Its name.
    pub light: String,
    /// The cosine between shading normal and light.
    pub cosine: f64,
    /// The incident radiance, times the transmittance of transparent surfaces in the way.
    pub radiance: DVec3,
    /// Whether it reaches the surface: not below the horizon, not occluded, and returned by the material.
    pub reaches: bool,
}

/// A term of local shading.
#[derive(Debug, Clone, Serialize)]
pub struct TermReport {
    /// `L_a`, `L_d`, `L_s`, or `L_e` for emission.
    pub name: &'static str,
    /// The light.
    pub light: Option<String>,
    /// Its index in the list of lights.
    pub light_index: Option<usize>,
    /// Names and values of its factors, beside the radiance of the light.
    #[serde(serialize_with = "as_map")]
    pub factors: Vec<(&'static str, f64)>,
    /// Its value.
    pub value: DVec3,
}

/// A vertex of a path, or what a ray found infinitely far away.
#[derive(Debug, Clone, Serialize)]
pub struct PathReport {
    /// The throughput, with the transmittance of the medium up to the surface.
    pub throughput: DVec3,
    /// What the surface emits, or what is infinitely far away.
    pub emission: Option<Emission>,
    /// The light samples that could add something.
    pub light_samples: Vec<LightSampleReport>,
    /// The direction sampled by the BSDF.
    pub bsdf_sample: Option<ContinuationRecord>,
    /// Why the path ends; `None` if it goes on.
    pub end: Option<&'static str>,
}

/// A light sample with its shadow ray.
#[derive(Debug, Clone, Serialize)]
pub struct LightSampleReport {
    /// The light by name, `environment`, or `emissive surfaces`.
    pub light: String,
    /// Its values.
    #[serde(flatten)]
    pub sample: LightSampleRecord,
}

/// A ray in world coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct TracedRay {
    /// Its kind.
    pub kind: RayKind,
    /// Origin and unit direction.
    pub origin: DVec3,
    /// See `origin`.
    pub direction: DVec3,
    /// The distance of the hit, or of the end; may be infinite.
    pub length: f64,
    /// Whether it hits anything.
    pub is_hit: bool,
}

fn as_map<S: Serializer>(
    pairs: &[(&'static str, f64)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().copied())
}
