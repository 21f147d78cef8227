//! Light samples of path vertices, as structures of arrays: chosen, listed as shadow rays with what they add, and traced
//! for a generation.

use glam::DVec3;

use super::lights::{LightConnection, Lights};
use super::numbers::GenerationNumbers;
use super::vertices::{List, Vertices, select};
use super::weights::light_weight;
use super::{Buffers, LIGHT_RAYS, LightPath, Scatter};
use crate::effects::tile::{RayGeneration, Tile, vec_bytes};
use crate::effects::{LightTechnique, RayKind, shadow_ray, transparency};
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Numerics, Precision, Ray, RayBuffer};
use crate::shading::LightSample;
use crate::world::{
    EnvironmentCell, Flags, InteractionSoa, PerRay, TriangleSample, TwoTriangles, UNIFORM_DENSITY, Vec3Soa, World, simd, uniform_direction,
};

/// A light sample at each vertex of a generation.
#[derive(Default)]
pub(super) struct LightSamples {
    /// Unit vectors towards the sampled points.
    direction: Vec3Soa,
    /// The same in the frames of the vertices.
    pub(super) local: Vec3Soa,
    /// The incident radiance.
    radiance: Vec3Soa,
    /// The density per solid angle, times the expected number of samples of the light; infinite for lights without
    /// size, which no BSDF sample reaches; 0 where there is no sample, and other arrays mean nothing.
    pub(super) pdf: PerRay<f64>,
    /// The distances of lights without size and of what is infinitely far away; 0 for points of surfaces.
    distance: PerRay<f64>,
    /// Points of surfaces as ends of shadow rays, in front of the surface.
    end: Vec3Soa,
    /// Origins, directions and lengths of shadow rays.
    ray_origin: Vec3Soa,
    ray_direction: Vec3Soa,
    t_max: PerRay<f64>,
    /// Whether the shadow ray starts below the surface, ends at a light without size, or has no length.
    is_special: Flags,
    /// The value of the BSDF times the cosine, and its density per solid angle.
    pub(super) value: Vec3Soa,
    pub(super) bsdf_pdf: PerRay<f64>,
    /// The radiance that the paths gain where the light is not occluded.
    contribution: Vec3Soa,
    /// The vertices with a shadow ray.
    lit: List,
    /// The shadow rays of these, and what each adds.
    shadow_rays: RayBuffer,
    light_paths: Vec<LightPath>,
}

/// [`TriangleSample`]s as a structure of arrays, at vertices whose light sample is one.
#[derive(Default)]
pub(super) struct TriangleSamples {
    is_set: Flags,
    position: Vec3Soa,
    start: Vec3Soa,
    reach: Vec3Soa,
    normal: Vec3Soa,
    density: PerRay<f64>,
    radiance: Vec3Soa,
}

impl TriangleSamples {
    fn get(&self, i: usize) -> TriangleSample {
        let (position, start, reach) = (self.position.get(i), self.start.get(i), self.reach.get(i));
        let point = SurfacePoint { position, start, reach };
        TriangleSample { point, normal: self.normal.get(i), density: self.density[i] }
    }

    fn set(&mut self, i: usize, sample: &TriangleSample, radiance: DVec3) {
        let &TriangleSample { point: SurfacePoint { position, start, reach }, normal, density } = sample;
        self.position.set(i, position);
        self.start.set(i, start);
        self.reach.set(i, reach);
        self.normal.set(i, normal);
        self.density[i] = density;
        self.radiance.set(i, radiance);
    }
}

/// A tier for [`SurfacePoint::origin_towards`], as a constant: loops then have no branch on it.
const fn numerics<const FAST: bool>() -> Numerics {
    if FAST { Numerics::Fast } else { Numerics::Watertight }
}

impl LightSamples {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.shadow_rays.bytes() + vec_bytes(&self.light_paths)
    }

    /// Removes the shadow rays.
    pub(super) fn clear_rays(&mut self) {
        self.shadow_rays.clear();
        self.light_paths.clear();
    }

    /// Takes a light sample of each vertex.
    pub(super) fn take(
        &mut self,
        (world, lights): (&World, &Lights),
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        (triangles, cells): (&mut TriangleSamples, &mut Vec<EnvironmentCell>),
    ) {
        simd!(self.clear(vertices, triangles));
        let (two, uniform) = (lights.two_triangles(), lights.uniform_radiance());
        if let Some(radiance) = uniform {
            simd!(self.sample_uniform(radiance, lights, vertices, numbers));
        }
        if lights.has_others(two.is_some()) {
            self.sample_others((lights, two.is_some()), surfaces, vertices, numbers, triangles);
        }
        if uniform.is_none() && world.environment.is_some() {
            self.sample_environment(lights, vertices, numbers, cells);
        }
        match (two, world.numerics()) {
            (Some(two), Numerics::Fast) => {
                self.connect_two::<true>(&two, lights, surfaces, vertices, numbers);
            }
            (Some(two), _) => self.connect_two::<false>(&two, lights, surfaces, vertices, numbers),
            (None, Numerics::Fast) => self.connect_listed::<true>(triangles, lights, surfaces, vertices),
            (None, _) => self.connect_listed::<false>(triangles, lights, surfaces, vertices),
        }
    }

    /// Removes all samples.
    #[inline(always)]
    fn clear(&mut self, vertices: &Vertices, triangles: &mut TriangleSamples) {
        for i in 0..vertices.len() {
            triangles.is_set.set(i, false);
            self.pdf[i] = 0.0;
        }
    }

    /// Samples a uniform environment.
    #[inline(always)]
    fn sample_uniform(
        &mut self,
        radiance: DVec3,
        lights: &Lights,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
    ) {
        let density = UNIFORM_DENSITY * lights.expected();
        for i in 0..vertices.len() {
            let [choice, point] = numbers.light_and_point(i);
            let is_chosen = vertices.is_visible(i) & lights.is_environment(choice);
            self.direction.set(i, select(is_chosen, uniform_direction(point), self.direction.get(i)));
            self.radiance.set(i, select(is_chosen, radiance, self.radiance.get(i)));
            self.pdf[i] = if is_chosen { density } else { self.pdf[i] };
            self.distance[i] = if is_chosen { f64::INFINITY } else { self.distance[i] };
        }
    }

    /// Samples an environment image.
    fn sample_environment(
        &mut self,
        lights: &Lights,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        cells: &mut Vec<EnvironmentCell>,
    ) {
        let mut chosen = std::mem::take(&mut self.lit);
        chosen.fill(vertices.len(), |i| {
            vertices.is_visible(i) & lights.is_environment(numbers.light_and_point(i)[0])
        });
        let points = chosen.iter().map(|i| numbers.light_and_point(i)[1]);
        lights.sample_environment(points, cells, |k, sample| self.set(chosen.get(k), &sample));
        self.lit = chosen;
    }

    /// Samples punctual lights, and emitters unless `are_emitters_left`.
    fn sample_others(
        &mut self,
        (lights, are_emitters_left): (&Lights, bool),
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        triangles: &mut TriangleSamples,
    ) {
        for i in 0..vertices.len() {
            let [choice, point] = numbers.light_and_point(i);
            let is_left = are_emitters_left && lights.is_emitter(choice);
            if !vertices.is_visible(i) || is_left || lights.is_environment(choice) {
                continue;
            }
            if let Some((sample, radiance)) = lights.sample_triangle(choice, point) {
                triangles.set(i, &sample, radiance);
                triangles.is_set.set(i, true);
            } else if let Some(sample) = lights.sample(surfaces.position.get(i), choice, point) {
                self.set(i, &sample);
            }
        }
    }

    /// Samples one or two triangles where these are chosen, and computes directions.
    #[inline(always)]
    fn connect_two<const FAST: bool>(
        &mut self,
        two: &TwoTriangles,
        lights: &Lights,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
    ) {
        let is_set = |i: usize| vertices.is_visible(i) & lights.is_emitter(numbers.light_and_point(i)[0]);
        let is_any_near = simd!(self.find_directions::<FAST>(
            lights,
            surfaces,
            vertices,
            #[inline(always)]
            |i| {
                let [choice, point] = numbers.light_and_point(i);
                let (sample, radiance, is_near) = two.sample(choice[1], point);
                (is_set(i), sample, radiance, is_near)
            }
        ));
        if is_any_near {
            self.move_ends::<FAST>(lights, surfaces, numbers, (0..vertices.len()).filter(|&i| is_set(i)));
        }
    }

    /// Moves the ends of shadow rays near edges of their triangle.
    #[cold]
    fn move_ends<const FAST: bool>(
        &mut self,
        lights: &Lights,
        surfaces: &InteractionSoa,
        numbers: &GenerationNumbers,
        vertices: impl Iterator<Item = usize>,
    ) {
        for i in vertices {
            let [choice, point] = numbers.light_and_point(i);
            if let Some((sample, _)) = lights.sample_triangle(choice, point) {
                let (_, normal, _) = sample.seen_from(surfaces.position.get(i));
                self.end.set(i, sample.point.origin_towards(normal, numerics::<FAST>()));
            }
        }
    }

    /// Computes directions to listed samples of triangles.
    #[inline(always)]
    fn connect_listed<const FAST: bool>(
        &mut self,
        triangles: &TriangleSamples,
        lights: &Lights,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
    ) {
        simd!(self.find_directions::<FAST>(
            lights,
            surfaces,
            vertices,
            #[inline(always)]
            |i| (triangles.is_set.get(i), triangles.get(i), triangles.radiance.get(i), false)
        ));
    }

    fn set(&mut self, i: usize, sample: &LightConnection) {
        self.direction.set(i, sample.direction);
        self.radiance.set(i, sample.radiance);
        self.pdf[i] = sample.pdf;
        self.distance[i] = sample.distance;
        self.end.set(i, sample.end);
    }

    /// Computes what samples of triangles are as seen from the vertices, and directions in the frames of the vertices.
    /// There is no sample where shading and geometric normal disagree on the side. `sample` returns whether there is such
    /// a sample, the sample, its radiance, and a flag; returns whether any sample has the flag.
    #[inline(always)]
    fn find_directions<const FAST: bool>(
        &mut self,
        lights: &Lights,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        sample: impl Fn(usize) -> (bool, TriangleSample, DVec3, bool),
    ) -> bool {
        let expected = lights.expected();
        let mut is_any = false;
        for i in 0..vertices.len() {
            let (is_set, sample, radiance, flag) = sample(i);
            is_any |= is_set & flag;
            let (direction, normal, pdf) = sample.seen_from(surfaces.position.get(i));
            let end = sample.point.origin_towards(normal, numerics::<FAST>());
            let direction = select(is_set, direction, self.direction.get(i));
            let pdf = if is_set { (pdf * expected).min(f64::MAX) } else { self.pdf[i] };
            let local = vertices.to_local(i, direction);
            let is_above = direction.dot(surfaces.geometric_normal.get(i)) > 0.0;
            self.direction.set(i, direction);
            self.local.set(i, local);
            self.radiance.set(i, select(is_set, radiance, self.radiance.get(i)));
            self.pdf[i] = if (local.z > 0.0) == is_above { pdf } else { 0.0 };
            self.distance[i] = if is_set { 0.0 } else { self.distance[i] };
            self.end.set(i, select(is_set, end, self.end.get(i)));
        }
        is_any
    }

    /// Computes contributions and shadow rays.
    #[inline(always)]
    fn find_contributions(
        &mut self,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        technique: LightTechnique,
    ) {
        for i in 0..vertices.len() {
            let (pdf, value) = (self.pdf[i], self.value.get(i));
            let weight = light_weight(technique, pdf, self.bsdf_pdf[i]) / pdf;
            let weight = if pdf == f64::INFINITY { 1.0 } else { weight };
            let radiance = vertices.throughput.get(i) * value * self.radiance.get(i) * weight;
            let is_zero = (radiance.x == 0.0) & (radiance.y == 0.0) & (radiance.z == 0.0);
            self.contribution.set(i, radiance);
            self.pdf[i] = if is_zero { 0.0 } else { pdf };
            let (direction, distance) = (self.direction.get(i), self.distance[i]);
            let to_end = self.end.get(i) - vertices.origin_above(i);
            let length = to_end.length();
            let scale = 1.0 / length;
            let is_far = distance == f64::INFINITY;
            let is_above = direction.dot(surfaces.geometric_normal.get(i)) > 0.0;
            let is_common =
                is_above & (is_far | ((distance == 0.0) & (scale > 0.0) & (scale < f64::INFINITY)));
            self.ray_origin.set(i, vertices.origin_above(i));
            self.ray_direction.set(i, select(is_far, direction, to_end * scale));
            self.t_max[i] = if is_far { f64::INFINITY } else { length };
            self.is_special.set(i, !is_common);
        }
    }

    /// Lists the vertices with a shadow ray, and completes the special ones. Returns the number of samples with a
    /// contribution that is not finite.
    fn list_rays(&mut self, world: &World, surfaces: &InteractionSoa, vertices: &Vertices) -> u64 {
        let mut lit = std::mem::take(&mut self.lit);
        lit.fill(vertices.len(), |i| self.pdf[i] != 0.0);
        let discarded = lit.retain(|i| self.contribution.get(i).is_finite());
        lit.retain(|i| !self.is_special.get(i) || self.set_special_ray(world, surfaces, vertices, i));
        self.lit = lit;
        discarded
    }

    /// Sets the special shadow ray of a vertex; `false` where both ends coincide.
    #[inline]
    fn set_special_ray(
        &mut self,
        world: &World,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        i: usize,
    ) -> bool {
        let origin = vertices.origin(i, world, surfaces, self.direction.get(i));
        let ray = self.special_ray(i, origin, surfaces.position.get(i), world.numerics());
        if let Some(Ray { origin, direction, t_max, .. }) = ray {
            self.ray_origin.set(i, origin);
            self.ray_direction.set(i, direction);
            self.t_max[i] = t_max;
        }
        ray.is_some()
    }

    /// Writes the listed shadow rays.
    #[inline(always)]
    fn write_rays(&mut self, precision: Precision) {
        let LightSamples { lit, shadow_rays, ray_origin, ray_direction, t_max, .. } = self;
        shadow_rays.write(
            0..lit.len(),
            #[inline(always)]
            |k| {
                let i = lit.get(k);
                precision.ray(ray_origin.get(i), ray_direction.get(i), 0.0, t_max[i])
            },
        );
    }

    /// The shadow ray from `origin`, of a vertex at `position`, to any light.
    fn special_ray(&self, i: usize, origin: DVec3, position: DVec3, numerics: Numerics) -> Option<Ray> {
        let (direction, distance) = (self.direction.get(i), self.distance[i]);
        if distance > 0.0 {
            let light = LightSample { direction, distance, radiance: DVec3::ZERO, cosine: 0.0 };
            return Some(shadow_ray(origin, &light.seen_from(origin - position), numerics));
        }
        let end = self.end.get(i);
        let direction = (end - origin).try_normalize()?;
        Some(numerics.ray_precision().ray(origin, direction, 0.0, end.distance(origin)))
    }
}

impl Buffers {
    /// Lists the shadow rays of light samples with a contribution.
    pub(super) fn list_shadow_rays(
        &mut self,
        (world, stage): (&World, &Scatter),
        generation: &RayGeneration,
    ) {
        let Buffers { vertices, light_samples, .. } = self;
        let surfaces = &*generation.surfaces;
        // Each sample is limited to its share of the clamp.
        let count = f64::from(stage.settings.light_samples);
        for samples in light_samples {
            // The usual technique is passed as a constant, so that the loop has no branch on it.
            match stage.technique {
                LightTechnique::Both => {
                    simd!(samples.find_contributions(surfaces, vertices, LightTechnique::Both));
                }
                technique => samples.find_contributions(surfaces, vertices, technique),
            }
            self.discarded += samples.list_rays(world, surfaces, vertices);
            simd!(samples.write_rays(world.numerics().ray_precision()));
            for (k, i) in samples.lit.iter().enumerate() {
                let ray = surfaces.ray_of()[i] as usize;
                let mut radiance = samples.contribution.get(i);
                if world.volumes.is_some() {
                    // What is infinitely far away is in no volume.
                    let shadow_ray = samples.shadow_rays.get(k);
                    let t_max = shadow_ray.t_max;
                    let end = if t_max.is_finite() { shadow_ray.at(t_max) } else { DVec3::INFINITY };
                    let direction = samples.direction.get(i);
                    let media = vertices.media_towards(i, surfaces, direction).around(world, end);
                    radiance *= media.transmittance(world, t_max);
                }
                if stage.clamp < f64::INFINITY {
                    radiance = stage.clamped(radiance * count, self.paths[ray].bounces + 1) / count;
                }
                samples.light_paths.push(LightPath { camera_ray: generation.camera_rays[ray], radiance });
            }
        }
    }

    /// Traces the shadow rays of a generation and adds the radiance of those that are not occluded.
    pub(super) fn trace_shadow_rays(&mut self, tile: &mut Tile, world: &World, continued: Option<RayKind>) {
        let Buffers { light_samples, occluded, radiance, .. } = self;
        for LightSamples { shadow_rays, light_paths, .. } in light_samples.iter().map(|samples| &**samples) {
            occluded.clear();
            world.accelerator.are_occluded(shadow_rays.rays(), occluded, &mut tile.traversal);
            match continued {
                None => {
                    for (path, &occluded) in light_paths.iter().zip(&*occluded) {
                        // Without a branch, which would be mispredicted.
                        let gained = if occluded { DVec3::ZERO } else { path.radiance };
                        radiance[path.camera_ray as usize] += gained;
                    }
                }
                Some(kind) => {
                    let mut count = 0;
                    let rays = shadow_rays.rays().iter();
                    for ((path, ray), occluded) in light_paths.iter().zip(rays).zip(&mut *occluded) {
                        let mut transmittance = 1.0;
                        if *occluded {
                            transmittance =
                                transparency::transmittance(world, &ray, &mut tile.traversal, &mut count);
                            *occluded = transmittance == 0.0;
                        }
                        if !*occluded {
                            radiance[path.camera_ray as usize] += path.radiance * transmittance;
                        }
                    }
                    if count > 0 {
                        tile.count(kind, count, 0);
                    }
                }
            }
            if let Some(recorder) = &mut tile.recorder {
                let sources: Vec<u32> = light_paths.iter().map(|path| path.camera_ray).collect();
                recorder.record_occlusion(
                    LIGHT_RAYS,
                    tile.depth,
                    None,
                    &sources,
                    shadow_rays.rays(),
                    occluded,
                );
            }
            tile.count(LIGHT_RAYS, occluded.len(), occluded.iter().filter(|&&occluded| occluded).count());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Layout, Traversal};
    use crate::effects::path::Path;
    use crate::effects::path::numbers::Sequence;
    use crate::effects::samples::SampleIndex;
    use crate::effects::{PathSettings, TextureUse};
    use crate::film::{Colour, ColourPipeline};
    use crate::geometry::{HitBuffer, Mesh, RayBuffer};
    use crate::scene::{
        Environment, EnvironmentSource, Falloff, Light, LightKind, Material, MaterialId, Object, Phong,
        PixelSampler, Scene, Shape,
    };
    use crate::world::{HitOrder, RAYS_PER_BATCH};

    /// A floor, a lamp of two triangles that crosses it, a point light and a uniform environment.
    fn world(numerics: Numerics) -> World {
        let quad = |corners: [[f64; 3]; 4]| Mesh {
            positions: corners.map(DVec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let object = |material, mesh| Object {
            name: String::new(),
            input: 0,
            material: MaterialId(material),
            shape: Shape::Mesh(mesh),
        };
        let lamp = Phong { emission: Colour::Linear(DVec3::new(3.0, 2.0, 1.0)), ..Phong::default() };
        let kind = LightKind::Point { position: DVec3::new(0.3, 1.2, 0.1), falloff: Falloff::None };
        let colour = Colour::Linear(DVec3::ONE);
        let scene = Scene {
            materials: vec![Material::Phong(Phong::default()), Material::Phong(lamp)],
            objects: vec![
                object(0, quad([[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]])),
                object(1, quad([[0.2, -0.5, -1.0], [1.3, 0.8, -1.0], [1.3, 0.8, 1.0], [0.2, -0.5, 1.0]])),
            ],
            lights: vec![Light { name: String::new(), colour, intensity: 1.0, kind }],
            environment: Some(Environment {
                source: EnvironmentSource::Colour(colour),
                rotation: 0.0,
                intensity: 0.5,
                is_hidden: false,
            }),
            ..Scene::default()
        };
        World::prepare(scene, ColourPipeline::Linear, Layout::default(), numerics)
    }

    /// The surfaces that rays from one point meet.
    fn surfaces(world: &World) -> Box<InteractionSoa> {
        let (mut rays, mut hits) = (RayBuffer::default(), HitBuffer::default());
        let from = DVec3::new(-0.4, 1.1, 0.2);
        for i in 0..RAYS_PER_BATCH {
            let to = DVec3::new((i % 16) as f64 / 4.0 - 1.9, 0.0, (i / 16) as f64 / 4.0 - 1.9);
            let precision = world.numerics().ray_precision();
            rays.push(&precision.ray(from, (to - from).normalize(), 0.0, f64::INFINITY));
        }
        world.accelerator.closest_hits(rays.rays(), &mut hits, &mut Traversal::default());
        let mut surfaces = Box::default();
        world.interactions(&rays, &hits, HitOrder::Rays, &mut surfaces);
        surfaces
    }

    /// What loops compute for all vertices are the samples and the shadow rays of each vertex alone, in every tier.
    #[test]
    fn light_samples_of_a_generation_are_those_of_each_vertex() {
        for numerics in Numerics::ALL {
            let world = world(numerics);
            let surfaces = surfaces(&world);
            let stage = Scatter {
                depth: 3,
                seed: 1,
                continued: None,
                sampler: PixelSampler::Sobol,
                technique: LightTechnique::Both,
                settings: PathSettings::default(),
                texture_use: TextureUse {
                    material_textures: false,
                    normal_maps: false,
                    slots: &[],
                    filter: None,
                },
                clamp: f64::INFINITY,
            };
            let lights = Lights::new(&world, &stage);
            let mut vertices = Box::<Vertices>::default();
            let path = Path { throughput: DVec3::ONE, from: DVec3::ZERO, pdf: 1.0, bounces: 0 };
            vertices.begin(&world, &surfaces, &[path; RAYS_PER_BATCH], &[]);
            vertices.find_frames(&world, &surfaces);
            let mut numbers = Box::<GenerationNumbers>::default();
            let sequence = Sequence { seed: 1, sampler: PixelSampler::Sobol, depth: 1 };
            let pixels = (0..surfaces.len() as u32).map(|x| SampleIndex { x, y: 0, sample: 0 });
            numbers.fill(pixels, sequence);
            numbers.fill_light(sequence, 0);
            let mut samples = Box::<LightSamples>::default();
            samples.take((&world, &lights), &surfaces, &vertices, &numbers, (&mut Box::default(), &mut Vec::new()));
            for i in 0..vertices.len() {
                samples.bsdf_pdf[i] = 0.3;
                samples.value.set(i, DVec3::ONE);
            }
            samples.find_contributions(&surfaces, &vertices, LightTechnique::Both);
            samples.list_rays(&world, &surfaces, &vertices);
            samples.write_rays(world.numerics().ray_precision());
            let mut kinds = [0; 4];
            for i in 0..vertices.len() {
                let [choice, point] = numbers.light_and_point(i);
                let position = surfaces.position.get(i);
                let alone = lights.sample(position, choice, point).filter(|sample| {
                    let is_above = sample.direction.dot(surfaces.geometric_normal.get(i)) > 0.0;
                    (vertices.to_local(i, sample.direction).z > 0.0) == is_above
                });
                let Some(alone) = alone else {
                    assert_eq!(samples.pdf[i], 0.0, "{numerics:?}, vertex {i}");
                    kinds[3] += 1;
                    continue;
                };
                assert_eq!((samples.direction.get(i), samples.pdf[i]), (alone.direction, alone.pdf));
                assert_eq!((samples.distance[i], samples.radiance.get(i)), (alone.distance, alone.radiance));
                if alone.distance == 0.0 {
                    assert_eq!(samples.end.get(i), alone.end);
                }
                let origin = vertices.origin(i, &world, &surfaces, alone.direction);
                let ray = samples.special_ray(i, origin, position, numerics);
                let place = samples.lit.iter().position(|listed| listed == i);
                assert_eq!(place.map(|k| samples.shadow_rays.get(k)), ray, "{numerics:?}, vertex {i}");
                let kind = [0.0, f64::INFINITY].iter().position(|&of| of == alone.distance).unwrap_or(2);
                kinds[kind] += 1;
            }
            assert!(kinds.into_iter().all(|count| count > 0), "{kinds:?}");
        }
    }
}
