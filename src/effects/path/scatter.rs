//! A surface interaction of a path: emission, one light sample, and the direction in which the path continues.

use glam::DVec3;

use super::lights::{LightConnection, Lights};
use super::media::{Crossing, Media};
use super::{Buffers, LightPath, Path, Scatter};
use crate::effects::random;
use crate::effects::samples::SampleIndex;
use crate::effects::tile::{RayGeneration, RenderContext, Tile};
use crate::effects::{LightTechnique, PathSettings};
use crate::geometry::{Hit, Ray};
use crate::scene::{Material, Phong, PixelSampler};
use crate::shading::bsdf::{Bsdf, BsdfParameters};
use crate::shading::{ShadingMode, shade};
use crate::world::{PreparedMaterial, SurfaceInteraction, World};

/// The highest probability with which roulette lets a path continue.
const MAX_SURVIVAL: f64 = 0.95;

/// The two-dimensional random numbers of a path vertex; of its light samples, those of the first.
#[derive(Clone, Copy)]
#[repr(u32)]
enum Dimension {
    Direction,
    LobeAndRoulette,
    LightPoint,
    LightChoice,
}

/// Dimensions a vertex.
const DIMENSIONS: u32 = 4;

/// The first dimension of further light samples, beyond those of the longest path.
const FURTHER_LIGHT_SAMPLES: u32 = 1 << 20;

/// The random numbers of a path vertex.
struct Numbers {
    sample: SampleIndex,
    seed: u32,
    sampler: PixelSampler,
    depth: u32,
}

impl Numbers {
    fn of(&self, dimension: Dimension) -> [f64; 2] {
        let SampleIndex { x, y, sample } = self.sample;
        let dimension = 1 + self.depth * DIMENSIONS + dimension as u32;
        random::pair_of(self.sampler, [x, y], self.seed, sample, dimension).map(f64::from)
    }

    /// The numbers for the choice of a light and of a point on it, for light sample `index` of the vertex.
    fn of_light(&self, index: u32) -> [[f64; 2]; 2] {
        if index == 0 {
            return [Dimension::LightChoice, Dimension::LightPoint].map(|dimension| self.of(dimension));
        }
        let SampleIndex { x, y, sample } = self.sample;
        let place = self.depth * PathSettings::MAX_LIGHT_SAMPLES + index;
        [0, 1].map(|part| {
            let dimension = FURTHER_LIGHT_SAMPLES + 2 * place + part;
            random::pair_of(self.sampler, [x, y], self.seed, sample, dimension).map(f64::from)
        })
    }
}

impl Buffers {
    /// Adds emitted radiance, lists shadow rays and fills the next generation.
    pub(super) fn scatter(&mut self, tile: &mut Tile, context: &RenderContext, stage: &Scatter) {
        let depth = tile.depth;
        let mut scattering = tile.scattering.take();
        if let Some(found) = scattering.as_mut().filter(|_| depth == 0) {
            found.clear();
            found.resize(self.paths.len(), None);
        }
        let (generation, next) = tile.this_and_next();
        next.rays.clear();
        next.sources.clear();
        self.next.clear();
        self.next_media.clear();
        self.shadow_rays.clear();
        self.light_paths.clear();
        let lights = Lights::new(context.world, stage);
        self.discarded = 0;
        self.add_missed(generation, context, &lights, stage, depth);
        for index in 0..generation.surfaces.len() {
            let ray = generation.surfaces.ray_of()[index] as usize;
            let Some(hit) = generation.hits.get(ray) else { continue };
            let path = self.paths[ray];
            let media = self.media.get(ray).copied().unwrap_or(Media::EMPTY);
            let sample = self.samples[path.camera_ray as usize];
            let &Scatter { seed, sampler, .. } = stage;
            let numbers = Numbers { sample, seed, sampler, depth: depth as u32 };
            let surface = generation.surfaces.get(index);
            let vertex = Vertex::new(context.world, &lights, surface, &hit, (path, media));
            self.add_radiance(path.camera_ray, vertex.emitted, stage, depth);
            if let Some(found) = &mut scattering
                && !vertex.bsdf.as_ref().is_some_and(Bsdf::is_delta)
            {
                found[path.camera_ray as usize].get_or_insert_with(|| vertex.albedo_and_normal());
            }
            let Some(bsdf) = vertex.bsdf.as_ref().filter(|_| (depth as u32) < stage.depth) else { continue };
            self.sample_lights(&vertex, bsdf, &lights, &numbers, stage);
            if let Some((ray, path, media)) =
                vertex.continue_path(bsdf, &numbers, stage.settings.roulette_from)
            {
                if !path.throughput.is_finite() {
                    self.discarded += 1;
                    continue;
                }
                next.rays.push(&ray);
                next.sources.push(index as u32);
                self.next.push(path);
                if context.world.volumes.is_some() {
                    self.next_media.push(media);
                }
            }
        }
        std::mem::swap(&mut self.paths, &mut self.next);
        std::mem::swap(&mut self.media, &mut self.next_media);
        tile.scattering = scattering;
        tile.discarded_samples += self.discarded;
    }

    /// Lists the shadow rays to the lights that are sampled at a vertex.
    fn sample_lights(
        &mut self,
        vertex: &Vertex,
        bsdf: &Bsdf,
        lights: &Lights,
        numbers: &Numbers,
        stage: &Scatter,
    ) {
        // Each sample is limited to its share of the clamp.
        let samples = f64::from(stage.settings.light_samples);
        for index in 0..stage.settings.light_samples {
            let Some((shadow_ray, radiance)) = vertex.sample_light(bsdf, lights, numbers.of_light(index))
            else {
                continue;
            };
            if !radiance.is_finite() {
                self.discarded += 1;
                continue;
            }
            let radiance = stage.clamped(radiance * samples, numbers.depth as usize + 1) / samples;
            self.shadow_rays.push(&shadow_ray);
            self.light_paths.push(LightPath { camera_ray: vertex.path.camera_ray, radiance });
        }
    }

    /// Adds the radiance from infinitely far away to the paths whose ray missed. Camera rays see the background where
    /// the scene has no environment or hides it, and no directional lights.
    fn add_missed(
        &mut self,
        generation: &RayGeneration,
        context: &RenderContext,
        lights: &Lights,
        stage: &Scatter,
        depth: usize,
    ) {
        if generation.surfaces.len() == generation.rays.len() {
            return;
        }
        let missed = generation.hits.iter().enumerate().filter(|(_, hit)| hit.is_none());
        for (ray, _) in missed {
            let path = self.paths[ray];
            let direction = generation.rays.get(ray).direction;
            let radiance = if depth == 0 {
                context.world.background_towards(direction)
            } else {
                lights.radiance_from_infinity(direction, path.pdf)
            };
            self.add_radiance(path.camera_ray, path.throughput * radiance, stage, depth);
        }
    }

    /// Adds radiance to a camera ray, or counts it if it is not finite.
    fn add_radiance(&mut self, camera_ray: u32, radiance: DVec3, stage: &Scatter, depth: usize) {
        if radiance.is_finite() {
            self.radiance[camera_ray as usize] += stage.clamped(radiance, depth);
        } else {
            self.discarded += 1;
        }
    }
}

/// A surface interaction of a path.
struct Vertex<'a> {
    world: &'a World,
    hit: &'a Hit,
    surface: SurfaceInteraction,
    path: Path,
    /// The media in front of the surface and behind it.
    sides: [Media; 2],
    /// Tangent, bitangent and shading normal.
    frame: [DVec3; 3],
    /// The radiance that the surface emits towards the ray's origin, weighted for the path.
    emitted: DVec3,
    /// `None` where the surface scatters nothing.
    bsdf: Option<Bsdf>,
}

impl<'a> Vertex<'a> {
    fn new(
        world: &'a World,
        lights: &Lights,
        surface: SurfaceInteraction,
        hit: &'a Hit,
        (path, media): (Path, Media),
    ) -> Self {
        let material = &world.materials[surface.material as usize];
        // A bent normal that is turned away from the view has no local frame.
        let cosine = surface.shading_normal.dot(surface.view);
        let normal = if cosine > 0.0 { surface.shading_normal } else { surface.geometric_normal };
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let frame = [tangent, bitangent, normal];
        let crossing = Crossing::new(world, media, &surface, hit);
        let throughput = path.throughput * crossing.transmittance(world, hit.t);
        let path = Path { throughput, ..path };
        let view = to_local(&frame, surface.view);
        let parameters = parameters(material, &surface, &crossing).filter(|_| view.z > 0.0);
        let bsdf = parameters.map(|parameters| Bsdf::new(&parameters, view));
        let is_dark_side = world.emitters.is_one_sided(surface.prim)
            && world.is_back(surface.object, hit, surface.point.position, surface.view);
        let emission = if is_dark_side { DVec3::ZERO } else { emission(material, &surface) };
        let emitted = if emission == DVec3::ZERO {
            DVec3::ZERO
        } else {
            throughput * emission * lights.weight_of_emitter(&surface, hit, &path)
        };
        Vertex { world, hit, surface, path, sides: crossing.sides, frame, emitted, bsdf }
    }

    /// The albedo and the shading normal, for denoisers.
    fn albedo_and_normal(&self) -> [[f32; 3]; 2] {
        let albedo = shade(self.world, ShadingMode::Flat, &self.surface, &[]);
        [albedo, self.surface.shading_normal].map(|value| value.as_vec3().to_array())
    }

    /// The value of the BSDF times the cosine, and its density, for a world direction. 0 where shading and geometric normal
    /// disagree on the side.
    fn eval(&self, bsdf: &Bsdf, direction: DVec3) -> (DVec3, f64) {
        let local = to_local(&self.frame, direction);
        if (local.z > 0.0) != (direction.dot(self.surface.geometric_normal) > 0.0) {
            return (DVec3::ZERO, 0.0);
        }
        bsdf.eval_pdf(local)
    }

    /// The origin of a ray that leaves the surface in a direction.
    fn origin(&self, direction: DVec3) -> DVec3 {
        let (point, normal) = (self.surface.point, self.surface.geometric_normal);
        if direction.dot(normal) > 0.0 {
            point.origin_towards(normal, self.world.numerics())
        } else {
            self.world.origin_behind(point.position, direction, self.hit)
        }
    }

    /// The media on the side of a direction.
    fn media_towards(&self, direction: DVec3) -> Media {
        self.sides[usize::from(direction.dot(self.surface.geometric_normal) <= 0.0)]
    }

    /// The shadow ray to a sampled light, and the radiance that the path gains if it is not occluded.
    fn sample_light(
        &self,
        bsdf: &Bsdf,
        lights: &Lights,
        [choice, numbers]: [[f64; 2]; 2],
    ) -> Option<(Ray, DVec3)> {
        if bsdf.is_delta() {
            return None;
        }
        let position = self.surface.point.position;
        let LightConnection { direction, radiance, pdf, target } =
            lights.sample(position, choice, numbers)?;
        let (value, bsdf_pdf) = self.eval(bsdf, direction);
        let weight = pdf.map_or(1.0, |pdf| light_weight(lights.technique, pdf, bsdf_pdf) / pdf);
        let radiance = self.path.throughput * value * radiance * weight;
        if radiance == DVec3::ZERO {
            return None;
        }
        let ray = target.ray(self.origin(direction), position, self.world.numerics())?;
        // What is infinitely far away is in no volume.
        let end = if ray.t_max.is_finite() { ray.at(ray.t_max) } else { DVec3::INFINITY };
        let media = self.media_towards(direction).around(self.world, end);
        Some((ray, radiance * media.transmittance(self.world, ray.t_max)))
    }

    /// The ray, the state and the media with which the path continues; `None` where it ends.
    fn continue_path(
        &self,
        bsdf: &Bsdf,
        numbers: &Numbers,
        roulette_from: u32,
    ) -> Option<(Ray, Path, Media)> {
        let [x, y] = numbers.of(Dimension::Direction);
        let has_roulette = numbers.depth >= roulette_from;
        let [lobe, roulette] =
            if has_roulette || bsdf.has_choice() { numbers.of(Dimension::LobeAndRoulette) } else { [0.0; 2] };
        let sample = bsdf.sample([lobe, x, y])?;
        let [tangent, bitangent, normal] = self.frame;
        let local = sample.direction;
        let direction = (tangent * local.x + bitangent * local.y + normal * local.z).normalize();
        if (local.z > 0.0) != (direction.dot(self.surface.geometric_normal) > 0.0) {
            return None;
        }
        let mut throughput = self.path.throughput * sample.weight;
        if has_roulette {
            let survival = throughput.max_element().min(MAX_SURVIVAL);
            if roulette >= survival {
                return None;
            }
            throughput /= survival;
        }
        if throughput == DVec3::ZERO {
            return None;
        }
        let pdf = if sample.is_delta { f64::INFINITY } else { sample.pdf };
        let precision = self.world.numerics().ray_precision();
        let ray = precision.ray(self.origin(direction), direction, 0.0, f64::INFINITY);
        let path = Path { throughput, pdf, from: self.surface.point.position, ..self.path };
        Some((ray, path, self.media_towards(direction)))
    }
}

/// The power heuristic with exponent 2 (Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, section
/// 9.2.4): the weight of a sample of density `own` beside a technique of density `other`.
fn power_heuristic(own: f64, other: f64) -> f64 {
    if own.is_infinite() {
        return 1.0;
    }
    // Scaled, so that no square overflows or underflows.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

/// The weight of light found by a BSDF sample of density `own`, where light samples have the density `light`.
pub(super) fn bsdf_weight(technique: LightTechnique, own: f64, light: f64) -> f64 {
    match technique {
        LightTechnique::Both => power_heuristic(own, light),
        LightTechnique::BsdfSamples => 1.0,
        // 1 for what light samples cannot reach.
        LightTechnique::LightSamples => f64::from(u8::from(own.is_infinite() || light <= 0.0)),
    }
}

/// The weight of a light sample of density `own`, where BSDF samples have the density `bsdf`.
fn light_weight(technique: LightTechnique, own: f64, bsdf: f64) -> f64 {
    match technique {
        LightTechnique::Both => power_heuristic(own, bsdf),
        LightTechnique::BsdfSamples => f64::from(u8::from(bsdf <= 0.0)),
        LightTechnique::LightSamples => 1.0,
    }
}

fn to_local([tangent, bitangent, normal]: &[DVec3; 3], v: DVec3) -> DVec3 {
    DVec3::new(v.dot(*tangent), v.dot(*bitangent), v.dot(*normal))
}

/// The radiance that a surface emits.
fn emission(material: &PreparedMaterial, surface: &SurfaceInteraction) -> DVec3 {
    match material {
        Material::Phong(m) => m.emission,
        Material::MetallicRoughness(m) if m.unlit => m.base_colour * surface.tint * surface.texels.colour,
        Material::MetallicRoughness(m) => m.emission * surface.texels.emission,
    }
}

/// The parameters of the BSDF, `None` where nothing is scattered.
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
    let unit = |colour: DVec3| colour.clamp(DVec3::ZERO, DVec3::ONE);
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
        // Blinn's exponent as a width of GGX (Walter and others, Microfacet Models for Refraction, 2007, section 5.2): alpha^2 =
        // 2 / (n + 2). Without a highlight there is no specular layer.
        Material::Phong(m) => BsdfParameters {
            base_colour: unit(m.colour * surface.tint * surface.texels.colour * m.diffuse),
            metallic: 0.0,
            roughness: (2.0 / (m.shininess + 2.0)).sqrt().sqrt().clamp(0.0, 1.0),
            specular: m.specular.clamp(0.0, 1.0),
            ..BsdfParameters::default()
        },
    };
    Some(BsdfParameters { ior: parameters.ior / crossing.ior_around, ..parameters })
}
