//! The BSDFs of path vertices: their parameters, their values for light samples, and the directions that they sample.

use std::ops::Range;

use glam::DVec3;

use super::continuations::Continuations;
use super::light_samples::LightSamples;
use super::media::MediumTransition;
use super::numbers::GenerationNumbers;
use super::opaque_bsdfs::OpaqueBsdfs;
use super::smooth_glass::SmoothGlasses;
use super::vertices::{ClassPartition, Vertices};
use crate::effects::tile::vec_bytes;
use crate::scene::{Layers, Material, Phong, TextureSlot};
use crate::shading::bsdf::{Bsdf, BsdfParameters, Ggx, diffuse};
use crate::world::{InteractionSoa, PreparedMaterial, Vec3Soa, World, simd};

/// The BSDFs of the vertices of a generation, by class.
#[derive(Default)]
pub(super) struct Bsdfs {
    /// Vertices with Lambert's BSDF alone, and their albedos.
    diffuse: ClassPartition,
    albedo: Vec3Soa,
    opaque: OpaqueBsdfs,
    smooth_glass: SmoothGlasses,
    /// All other vertices.
    general: Vec<u32>,
}

/// The classes of BSDFs.
#[derive(Clone, Copy)]
enum Class {
    Diffuse,
    Opaque,
    SmoothGlass,
    General,
}

impl Class {
    /// The class of all surfaces of a material.
    fn of(material: &PreparedMaterial) -> Self {
        match material {
            Material::Phong(Phong { refraction: Some(_), .. }) => Class::SmoothGlass,
            Material::Phong(m) if m.specular <= 0.0 => Class::Diffuse,
            Material::Phong(_) => Class::Opaque,
            Material::MetallicRoughness(m) => {
                let Layers { transmission, volume, .. } = m.layers;
                if m.unlit || m.layers.has_extra_lobes() || m.layers.anisotropy > 0.0 {
                    Class::General
                } else if transmission <= 0.0 {
                    Class::Opaque
                } else if transmission >= 1.0
                    && m.textures[TextureSlot::Transmission].is_none()
                    && volume.is_some()
                    && m.metallic <= 0.0
                    && Ggx::new(m.roughness).is_delta()
                {
                    Class::SmoothGlass
                } else {
                    Class::General
                }
            }
        }
    }
}

impl Bsdfs {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + vec_bytes(&self.general)
    }

    /// Finds the BSDFs of a generation.
    pub(super) fn find(&mut self, world: &World, surfaces: &InteractionSoa, vertices: &Vertices) {
        self.diffuse.clear();
        self.opaque.members.clear();
        self.smooth_glass.members.clear();
        self.general.clear();
        for (material, range) in surfaces.by_material() {
            let material = &world.materials[*material as usize];
            let class = Class::of(material);
            let mut rest = range.clone();
            while !rest.is_empty() {
                let first = rest.start;
                let is_alike = |&i: &usize| {
                    let has_same_tint =
                        !surfaces.is_tinted || surfaces.tint.get(i) == surfaces.tint.get(first);
                    has_same_tint && vertices.have_same_crossing(first, i)
                };
                let end = (first + 1..rest.end).find(|i| !is_alike(i)).unwrap_or(rest.end);
                // If hidden there is no interface, whatever the material.
                let class = if vertices.crossing(first).is_hidden { Class::SmoothGlass } else { class };
                self.add(class, material, surfaces, vertices, first..end);
                rest.start = end;
            }
        }
        self.opaque.find_albedos(vertices);
    }

    /// Adds vertices with surfaces of one class, material, tint and crossing.
    fn add(
        &mut self,
        class: Class,
        material: &PreparedMaterial,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        range: Range<usize>,
    ) {
        let parameters = |i: usize| {
            let parameters = parameters(material, surfaces, i, vertices.crossing(i));
            parameters.unwrap_or_else(|| unreachable!("the class of unlit materials is the general one"))
        };
        // Without textures all have the same parameters.
        let step = if surfaces.texels.is_empty() { range.len() } else { 1 };
        let parts = range.clone().step_by(step).map(|first| first..first + step);
        match class {
            Class::Diffuse => {
                for part in parts {
                    let albedo = diffuse_albedo(material, surfaces, part.start);
                    part.for_each(|i| self.albedo.set(i, albedo));
                }
                self.diffuse.push(range);
            }
            Class::Opaque => {
                parts.for_each(|part| self.opaque.set(part.clone(), &parameters(part.start)));
                self.opaque.members.push(range);
            }
            Class::SmoothGlass => {
                parts.for_each(|part| self.smooth_glass.set(part.clone(), &parameters(part.start)));
                self.smooth_glass.members.push(range);
            }
            Class::General => self.general.extend(range.start as u32..range.end as u32),
        }
    }

    /// Evaluates the BSDFs for the light samples of all vertices and samples a direction of each. Without random numbers
    /// these directions mean nothing, only whether BSDFs are made of delta lobes.
    pub(super) fn eval_and_sample(
        &self,
        world: &World,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        lights: &mut [Box<LightSamples>],
        continuations: &mut Continuations,
    ) {
        // The loops over Lambert's BSDFs write all vertices of their range; those of later classes are written again.
        for samples in &mut *lights {
            simd!(self.eval_diffuse(samples));
            simd!(self.opaque.eval(vertices, samples));
            simd!(self.smooth_glass.drop_light_samples(samples));
        }
        simd!(self.sample_diffuse(vertices, numbers, continuations));
        simd!(self.opaque.sample(vertices, numbers, continuations));
        simd!(self.smooth_glass.sample(vertices, numbers, continuations));
        let mut bsdf = Bsdf::EMPTY;
        for i in self.general.iter().map(|&i| i as usize) {
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

    #[inline(always)]
    fn eval_diffuse(&self, samples: &mut LightSamples) {
        for i in self.diffuse.range() {
            let (value, pdf) = diffuse::eval_pdf(self.albedo.get(i), samples.local.get(i));
            samples.value.set(i, value);
            samples.bsdf_pdf[i] = pdf;
        }
    }

    #[inline(always)]
    fn sample_diffuse(
        &self,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        continuations: &mut Continuations,
    ) {
        for i in self.diffuse.range() {
            let albedo = self.albedo.get(i);
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
}

/// Whether surfaces of a material may have perfectly specular lobes.
pub(super) fn can_be_delta(material: &PreparedMaterial) -> bool {
    match material {
        Material::Phong(m) => m.refraction.is_some() || m.specular > 0.0 && !m.shininess.is_finite(),
        Material::MetallicRoughness(m) => {
            let is_smooth =
                |roughness: f64, slot| m.textures[slot].is_some() || Ggx::new(roughness).is_delta();
            let has_coat = m.layers.clearcoat > 0.0
                && is_smooth(m.layers.clearcoat_roughness, TextureSlot::ClearcoatRoughness);
            // With an index of refraction of 1, light passes.
            !m.unlit
                && (is_smooth(m.roughness, TextureSlot::MetallicRoughness)
                    || has_coat
                    || m.layers.transmission > 0.0)
        }
    }
}

/// Whether surfaces of a material may scatter light.
pub(super) fn can_scatter(material: &PreparedMaterial) -> bool {
    match material {
        Material::Phong(m) => {
            m.refraction.is_some() || m.specular > 0.0 || m.diffuse * m.colour != DVec3::ZERO
        }
        Material::MetallicRoughness(m) => !m.unlit,
    }
}

/// Sets the BSDF of a vertex, for its view. Returns whether the surface scatters light.
fn set(bsdf: &mut Bsdf, world: &World, surfaces: &InteractionSoa, vertices: &Vertices, i: usize) -> bool {
    if !vertices.is_visible(i) {
        return false;
    }
    let material = &world.materials[surfaces.materials()[i] as usize];
    let Some(parameters) = parameters(material, surfaces, i, vertices.crossing(i)) else { return false };
    bsdf.set(&parameters, vertices.view.get(i));
    true
}

/// The albedo of a surface of class [`Class::Diffuse`].
#[inline]
fn diffuse_albedo(material: &PreparedMaterial, surfaces: &InteractionSoa, i: usize) -> DVec3 {
    let Material::Phong(m) = material else { return DVec3::ZERO };
    phong_albedo(m, surfaces, i)
}

fn phong_albedo(m: &Phong<DVec3>, surfaces: &InteractionSoa, i: usize) -> DVec3 {
    let texel = surfaces.texels.get(TextureSlot::BaseColour, i);
    unit(m.colour * surfaces.tint.get(i) * texel * m.diffuse)
}

fn unit(colour: DVec3) -> DVec3 {
    colour.clamp(DVec3::ZERO, DVec3::ONE)
}

/// The parameters of the BSDF, `None` where nothing is scattered.
#[inline]
fn parameters(
    material: &PreparedMaterial,
    surfaces: &InteractionSoa,
    i: usize,
    crossing: &MediumTransition,
) -> Option<BsdfParameters> {
    if crossing.is_hidden {
        return Some(BsdfParameters {
            ior: 1.0,
            metallic: 0.0,
            transmission: 1.0,
            ..BsdfParameters::default()
        });
    }
    let texel = |slot| surfaces.texels.get(slot, i);
    let from_inside = crossing.from_inside;
    let parameters = match material {
        Material::MetallicRoughness(m) if m.unlit => return None,
        Material::MetallicRoughness(m) => {
            let (layers, both) = (&m.layers, texel(TextureSlot::MetallicRoughness));
            BsdfParameters {
                base_colour: unit(m.base_colour * surfaces.tint.get(i) * texel(TextureSlot::BaseColour)),
                metallic: (m.metallic * both.z).clamp(0.0, 1.0),
                roughness: (m.roughness * both.y).clamp(0.0, 1.0),
                ior: layers.ior,
                specular: layers.specular * texel(TextureSlot::Specular).x,
                specular_colour: layers.specular_colour * texel(TextureSlot::SpecularColour),
                transmission: layers.transmission * texel(TextureSlot::Transmission).x,
                thin_walled: layers.volume.is_none(),
                from_inside,
                clearcoat: layers.clearcoat * texel(TextureSlot::Clearcoat).x,
                clearcoat_roughness: layers.clearcoat_roughness * texel(TextureSlot::ClearcoatRoughness).y,
                sheen_colour: layers.sheen_colour * texel(TextureSlot::SheenColour),
                sheen_roughness: layers.sheen_roughness * texel(TextureSlot::SheenRoughness).x,
                anisotropy: layers.anisotropy * texel(TextureSlot::Anisotropy).z,
            }
        }
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
            base_colour: phong_albedo(m, surfaces, i),
            metallic: 0.0,
            roughness: (2.0 / (m.shininess + 2.0)).sqrt().sqrt().clamp(0.0, 1.0),
            specular: m.specular.clamp(0.0, 1.0),
            ..BsdfParameters::default()
        },
    };
    Some(BsdfParameters { ior: parameters.ior / crossing.ior_around, ..parameters })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::detail::{HitBuffer, Layout, RayBuffer};
    use crate::bvh::{Numerics, Sphere, Traversal};
    use crate::effects::path::Path;
    use crate::effects::path::numbers::Sequence;
    use crate::effects::samples::SampleIndex;
    use crate::film::{Colour, ColourPipeline};
    use crate::scene::{
        AnalyticShape, MaterialId, MetallicRoughness, Object, PixelSampler, Refraction, Scene, Shape, Volume,
    };
    use crate::world::{HitOrder, RAYS_PER_BATCH};

    /// Materials of all classes.
    fn materials() -> Vec<Material> {
        let colour = Colour::Linear(DVec3::new(0.9, 0.5, 0.2));
        let phong = Phong { colour, ..Phong::default() };
        let glass = Phong { refraction: Some(Refraction { ior: 1.5, filter: colour }), ..phong.clone() };
        let rough = |metallic, roughness, layers| MetallicRoughness {
            base_colour: colour,
            metallic,
            roughness,
            layers,
            ..MetallicRoughness::default()
        };
        let volume = Volume { attenuation_colour: colour, attenuation_distance: f64::INFINITY };
        let transparent = Layers { transmission: 1.0, volume: Some(volume), ..Layers::default() };
        let of = Material::MetallicRoughness;
        vec![
            Material::Phong(phong.clone()),
            Material::Phong(Phong { specular: 0.5, shininess: 30.0, ..phong }),
            Material::Phong(glass),
            of(rough(1.0, 0.3, Layers::default())),
            of(rough(1.0, 0.0, Layers::default())),
            of(rough(0.0, 0.5, Layers::default())),
            of(rough(0.0, 0.0, transparent.clone())),
            of(rough(0.0, 0.4, transparent)),
            of(rough(0.3, 0.4, Layers { clearcoat: 1.0, ..Layers::default() })),
            of(MetallicRoughness { unlit: true, ..rough(0.0, 0.5, Layers::default()) }),
        ]
    }

    /// A grid of spheres, the materials of which are those of their numbers plus `shift`, and far away one of glass whose inside
    /// the surface of a larger one divides.
    fn world(shift: usize) -> World {
        let materials = materials();
        let sphere = |material: usize, x: f64, y: f64, radius| Object {
            name: String::new(),
            input: 0,
            material: MaterialId(material as u32),
            shape: Shape::Analytic(AnalyticShape::from(Sphere { centre: DVec3::new(x, y, 0.0), radius })),
        };
        let grid =
            (0..40).map(|k| sphere((k + shift) % materials.len(), (k % 8) as f64, (k / 8) as f64, 0.45));
        let objects = grid.chain([sphere(2, 50.0, 0.0, 0.5), sphere(6, 52.0, 0.0, 2.0)]).collect();
        let scene = Scene { materials, objects, ..Scene::default() };
        World::prepare(scene, ColourPipeline::Linear, Layout::default(), Numerics::Watertight)
    }

    /// What the loops of the classes give is what the general BSDF gives for each vertex, whatever an earlier generation left in
    /// the arrays.
    #[test]
    fn bsdfs_of_a_generation_are_those_of_each_vertex() {
        let (mut bsdfs, mut lights) = (Box::<Bsdfs>::default(), vec![Box::<LightSamples>::default()]);
        let (mut continuations, mut numbers) =
            (Box::<Continuations>::default(), Box::<GenerationNumbers>::default());
        let (mut hidden, mut seen) = (0, [0; 4]);
        for (shift, order) in [(0, HitOrder::Rays), (3, HitOrder::Primitives), (7, HitOrder::Rays)] {
            let world = world(shift);
            let sequence = Sequence { seed: shift as u32, sampler: PixelSampler::Independent, depth: 1 };
            numbers.fill((0..RAYS_PER_BATCH as u32).map(|x| SampleIndex { x, y: 0, sample: 0 }), sequence);
            let (mut rays, mut hits) = (RayBuffer::default(), HitBuffer::default());
            for i in 0..RAYS_PER_BATCH {
                let [u, v] = numbers.direction(i);
                let [from, to] = if i % 8 == 0 {
                    [DVec3::new(49.7, 0.0, 0.0), DVec3::new(52.0, u, v)]
                } else {
                    [DVec3::new(3.0, 2.0, 9.0), DVec3::new(8.0 * u - 0.5, 5.0 * v - 0.5, 0.0)]
                };
                let precision = world.numerics().ray_precision();
                rays.push(&precision.ray(from, (to - from).normalize(), 0.0, f64::INFINITY));
            }
            world.accelerator.closest_hits(rays.rays(), &mut hits, &mut Traversal::default());
            let mut surfaces = Box::<InteractionSoa>::default();
            world.interactions(&rays, &hits, order, &mut surfaces);
            // Vertex colours and texels that differ between vertices of one material.
            let colours = (0..surfaces.len()).map(|i| DVec3::splat(1.0 / (1 + i / 2 % 3) as f64));
            if shift == 3 {
                surfaces.is_tinted = true;
                colours.enumerate().for_each(|(i, colour)| surfaces.tint.set(i, colour));
            } else if shift == 7 {
                let texels = surfaces.texels.of_mut(TextureSlot::BaseColour, colours.len());
                texels.iter_mut().zip(colours).for_each(|(texel, colour)| *texel = colour);
            }
            let (mut vertices, mut media) = (Box::<Vertices>::default(), Vec::new());
            vertices.media.start(&world, rays.rays().origins(), &mut media);
            let path = Path { pdf: 1.0, ..Path::OF_CAMERA };
            vertices.begin(&world, &surfaces, &[path; RAYS_PER_BATCH], &media);
            vertices.find_frames(&world, &surfaces, None);
            for i in 0..vertices.len() {
                let [u, v] = numbers.lobe_and_roulette(i);
                lights[0].local.set(i, DVec3::new(u - 0.5, v - 0.5, 0.7 * u - 0.1).normalize());
                lights[0].pdf[i] = 1.0;
            }
            bsdfs.find(&world, &surfaces, &vertices);
            bsdfs.eval_and_sample(&world, &surfaces, &vertices, &numbers, &mut lights, &mut continuations);
            let mut bsdf = Bsdf::EMPTY;
            for i in 0..vertices.len() {
                hidden += usize::from(vertices.crossing(i).is_hidden);
                let is_set = set(&mut bsdf, &world, &surfaces, &vertices, i);
                let scatters = is_set && !bsdf.is_delta();
                assert_eq!(lights[0].pdf[i], f64::from(u8::from(scatters)));
                assert_eq!(continuations.is_delta.get(i), is_set && !scatters);
                if scatters {
                    let value = (lights[0].value.get(i), lights[0].bsdf_pdf[i]);
                    assert_eq!(value, bsdf.eval_pdf(lights[0].local.get(i)));
                }
                let [[u, v], [lobe, _]] = [numbers.direction(i), numbers.lobe_and_roulette(i)];
                let Some(expected) = is_set.then(|| bsdf.sample([lobe, u, v])).flatten() else {
                    assert_eq!(continuations.pdf[i], 0.0);
                    seen[0] += 1;
                    continue;
                };
                seen[1 + usize::from(expected.is_delta) + usize::from(expected.is_transmission)] += 1;
                let pdf = if expected.is_delta { f64::INFINITY } else { expected.pdf };
                assert_eq!((continuations.local.get(i), continuations.pdf[i]), (expected.direction, pdf));
                // The general BSDF divides smooth glass by its albedo, which is 1 up to rounding.
                let difference = (continuations.weight.get(i) - expected.weight).abs().max_element();
                assert!(difference <= 1e-14 * expected.weight.max_element());
            }
        }
        assert!(hidden > 20 && seen.iter().all(|&count| count > 20), "{hidden} {seen:?}");
    }
}
