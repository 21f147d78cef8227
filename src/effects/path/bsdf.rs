//! The BSDFs of path vertices: their parameters, their values for light samples, and the directions that they sample.

use glam::DVec3;

use super::continuations::Continuations;
use super::light_samples::LightSamples;
use super::media::Crossing;
use super::numbers::GenerationNumbers;
use super::vertices::Vertices;
use crate::scene::{Material, Phong};
use crate::shading::bsdf::{Bsdf, BsdfParameters, diffuse};
use crate::world::{InteractionSoa, PreparedMaterial, SurfaceInteraction, World, simd};

/// Evaluates the BSDFs for the light samples of all vertices and samples a direction of each. Without random numbers
/// these directions mean nothing, only whether BSDFs are made of delta lobes.
pub(super) fn eval_and_sample(
    world: &World,
    surfaces: &InteractionSoa,
    vertices: &Vertices,
    numbers: &GenerationNumbers,
    lights: &mut [Box<LightSamples>],
    continuations: &mut Continuations,
) {
    if vertices.general.len() < vertices.len() {
        for samples in &mut *lights {
            simd!(eval_diffuse(vertices, samples));
        }
        simd!(sample_diffuse(vertices, numbers, continuations));
    }
    let mut bsdf = Bsdf::EMPTY;
    for i in vertices.general.iter().map(|&i| i as usize) {
        let is_set = set(&mut bsdf, world, surfaces, vertices, i);
        let is_delta = !is_set || bsdf.is_delta();
        for samples in &mut *lights {
            if is_delta || samples.pdf[i] == 0.0 {
                samples.pdf[i] = 0.0;
                continue;
            }
            let (value, pdf) = bsdf.eval_pdf(samples.local.get(i));
            samples.value.set(i, value);
            samples.bsdf_pdf[i] = pdf;
        }
        let sample = is_set.then(|| {
            let [[x, y], [lobe, _]] = [numbers.direction(i), numbers.lobe_and_roulette(i)];
            bsdf.sample([lobe, x, y])
        });
        continuations.set(i, sample.flatten());
        continuations.is_delta.set(i, is_set && is_delta);
    }
}

/// Sets the BSDF of a vertex, for its view. Returns whether the surface scatters light.
fn set(bsdf: &mut Bsdf, world: &World, surfaces: &InteractionSoa, vertices: &Vertices, i: usize) -> bool {
    if !vertices.is_visible(i) {
        return false;
    }
    let surface = surfaces.get(i);
    let crossing = vertices.crossings.get(i).unwrap_or(&Crossing::NONE);
    let material = &world.materials[surface.material as usize];
    let Some(parameters) = parameters(material, &surface, crossing) else { return false };
    bsdf.set(&parameters, vertices.view.get(i));
    true
}

#[inline(always)]
fn eval_diffuse(vertices: &Vertices, samples: &mut LightSamples) {
    for i in 0..vertices.len() {
        let (value, pdf) = diffuse::eval_pdf(vertices.albedo.get(i), samples.local.get(i));
        samples.value.set(i, value);
        samples.bsdf_pdf[i] = pdf;
    }
}

#[inline(always)]
fn sample_diffuse(vertices: &Vertices, numbers: &GenerationNumbers, continuations: &mut Continuations) {
    for i in 0..vertices.len() {
        let albedo = vertices.albedo.get(i);
        let direction = diffuse::sample(numbers.direction(i));
        let (value, pdf) = diffuse::eval_pdf(albedo, direction);
        let (is_visible, reflects) = (vertices.is_visible(i), albedo.element_sum() > 0.0);
        let is_possible = is_visible & reflects & (pdf > 0.0);
        continuations.local.set(i, direction);
        continuations.weight.set(i, value / pdf);
        continuations.pdf[i] = if is_possible { pdf } else { 0.0 };
        continuations.is_delta.set(i, is_visible & !reflects);
    }
}

/// Whether the BSDF of a material is Lambert's alone.
pub(super) fn is_diffuse(material: &PreparedMaterial) -> bool {
    matches!(material, Material::Phong(m) if m.specular <= 0.0 && m.refraction.is_none())
}

/// The albedo of a surface of a material that [`is_diffuse`].
#[inline]
pub(super) fn diffuse_albedo(material: &PreparedMaterial, surfaces: &InteractionSoa, i: usize) -> DVec3 {
    let Material::Phong(m) = material else { return DVec3::ZERO };
    let texel = surfaces.texels.get(i).map_or(DVec3::ONE, |texels| texels.colour);
    phong_albedo(m, surfaces.tint.get(i), texel)
}

fn phong_albedo(m: &Phong<DVec3>, tint: DVec3, texel: DVec3) -> DVec3 {
    unit(m.colour * tint * texel * m.diffuse)
}

fn unit(colour: DVec3) -> DVec3 {
    colour.clamp(DVec3::ZERO, DVec3::ONE)
}

/// The parameters of the BSDF, `None` where nothing is scattered.
#[inline]
fn parameters(
    material: &PreparedMaterial,
    surface: &SurfaceInteraction,
    crossing: &Crossing,
) -> Option<BsdfParameters> {
    if crossing.is_hidden {
        return Some(BsdfParameters {
            ior: 1.0,
            metallic: 0.0,
            transmission: 1.0,
            ..BsdfParameters::default()
        });
    }
    let texels = &surface.further_texels;
    let from_inside = crossing.from_inside;
    let parameters = match material {
        Material::MetallicRoughness(m) if m.unlit => return None,
        Material::MetallicRoughness(m) => BsdfParameters {
            base_colour: unit(m.base_colour * surface.tint * surface.texels.colour),
            metallic: (m.metallic * surface.texels.metallic).clamp(0.0, 1.0),
            roughness: (m.roughness * surface.texels.roughness).clamp(0.0, 1.0),
            ior: m.layers.ior,
            specular: m.layers.specular * texels.specular,
            specular_colour: m.layers.specular_colour * texels.specular_colour,
            transmission: m.layers.transmission * texels.transmission,
            thin_walled: m.layers.volume.is_none(),
            from_inside,
            clearcoat: m.layers.clearcoat * texels.clearcoat,
            clearcoat_roughness: m.layers.clearcoat_roughness * texels.clearcoat_roughness,
            sheen_colour: m.layers.sheen_colour * texels.sheen_colour,
            sheen_roughness: m.layers.sheen_roughness * texels.sheen_roughness,
        },
        Material::Phong(Phong { refraction: Some(glass), .. }) => BsdfParameters {
            base_colour: unit(glass.filter),
            metallic: 0.0,
            roughness: 0.0,
            ior: glass.ior,
            transmission: 1.0,
            from_inside,
            ..BsdfParameters::default()
        },
        // Blinn's exponent as a width of GGX (Walter and others, Microfacet Models for Refraction, 2007, section 5.2):
        // alpha^2 = 2 / (n + 2). Without a highlight there is no specular layer.
        Material::Phong(m) => BsdfParameters {
            base_colour: phong_albedo(m, surface.tint, surface.texels.colour),
            metallic: 0.0,
            roughness: (2.0 / (m.shininess + 2.0)).sqrt().sqrt().clamp(0.0, 1.0),
            specular: m.specular.clamp(0.0, 1.0),
            ..BsdfParameters::default()
        },
    };
    Some(BsdfParameters { ior: parameters.ior / crossing.ior_around, ..parameters })
}
