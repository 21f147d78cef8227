//! Light samples of path vertices, as structures of arrays.

use glam::DVec3;

use super::LightPath;
use super::lights::{LightConnection, Lights};
use super::numbers::GenerationNumbers;
use super::vertices::{IndexList, Vertices};
use crate::bvh::Numerics;
use crate::bvh::detail::{RayBuffer, SurfacePoint};
use crate::effects::tile::vec_bytes;
use crate::world::{
    EnvironmentCell, Flags, InteractionSoa, PerRay, TriangleSample, TwoTriangles, UNIFORM_DENSITY, Vec3Soa,
    World, select, simd, uniform_direction,
};

/// A light sample at each vertex of a generation.
#[derive(Default)]
pub(super) struct LightSamples {
    /// Unit vectors towards the sampled points.
    pub(super) direction: Vec3Soa,
    /// The same in the frames of the vertices.
    pub(super) local: Vec3Soa,
    /// The incident radiance.
    pub(super) radiance: Vec3Soa,
    /// The density per solid angle, times the expected number of samples of the light; infinite for lights without
    /// size, which no BSDF sample reaches; 0 where there is no sample, and other arrays mean nothing.
    pub(super) pdf: PerRay<f64>,
    /// The distances of lights without size and of what is infinitely far away; 0 for points of surfaces.
    pub(super) distance: PerRay<f64>,
    /// Ends of shadow rays to surfaces, in front of these: [`LightConnection::end`].
    pub(super) end: Vec3Soa,
    /// Origins, directions and lengths of shadow rays.
    pub(super) ray_origin: Vec3Soa,
    pub(super) ray_direction: Vec3Soa,
    pub(super) t_max: PerRay<f64>,
    /// Whether the shadow ray starts below the surface, ends at a light without size, or has no length.
    pub(super) is_special: Flags,
    /// The value of the BSDF times the cosine, and its density per solid angle.
    pub(super) value: Vec3Soa,
    pub(super) bsdf_pdf: PerRay<f64>,
    /// The radiance that the paths gain where the light is not occluded.
    pub(super) contribution: Vec3Soa,
    /// The vertices with a shadow ray.
    pub(super) lit: IndexList,
    /// The shadow rays of these, and what each adds.
    pub(super) shadow_rays: RayBuffer,
    pub(super) light_paths: Vec<LightPath>,
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

/// The tier for the ends of shadow rays before lights, by [`SurfacePoint::origin_towards`]: those of `watertight` serve
/// all strict tiers.
pub(super) const fn end_tier(is_fast: bool) -> Numerics {
    if is_fast { Numerics::Fast } else { Numerics::Watertight }
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
        if lights.has_others(two.as_ref()) {
            self.sample_others((lights, two.as_ref()), vertices, numbers, triangles);
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

    /// Samples punctual lights, and emitters unless these are `two` triangles.
    fn sample_others(
        &mut self,
        (lights, two): (&Lights, Option<&TwoTriangles>),
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        triangles: &mut TriangleSamples,
    ) {
        for i in 0..vertices.len() {
            let [choice, point] = numbers.light_and_point(i);
            let is_of_two = two.is_some() && lights.is_emitter(choice);
            if !vertices.is_visible(i) || is_of_two || lights.is_environment(choice) {
                continue;
            }
            let from = vertices.position(i);
            if let Some((sample, radiance)) = lights.sample_triangle(from, choice, point) {
                triangles.set(i, &sample, radiance);
                triangles.is_set.set(i, true);
            } else if let Some(sample) = lights.sample(from, choice, point) {
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
            self.move_ends::<FAST>(lights, vertices, numbers, (0..vertices.len()).filter(|&i| is_set(i)));
        }
    }

    /// Moves the ends of shadow rays near edges of their triangle.
    #[cold]
    fn move_ends<const FAST: bool>(
        &mut self,
        lights: &Lights,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        chosen: impl Iterator<Item = usize>,
    ) {
        for i in chosen {
            let [choice, point] = numbers.light_and_point(i);
            let from = vertices.position(i);
            if let Some((sample, _)) = lights.sample_triangle(from, choice, point) {
                let (_, normal, _) = sample.seen_from(from);
                self.end.set(i, sample.point.origin_towards(normal, end_tier(FAST)));
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
    /// a sample, the sample, its radiance, and whether it is near an edge. Returns whether any is.
    #[inline(always)]
    fn find_directions<const FAST: bool>(
        &mut self,
        lights: &Lights,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        sample: impl Fn(usize) -> (bool, TriangleSample, DVec3, bool),
    ) -> bool {
        let expected = lights.expected();
        let mut is_any_near = false;
        for i in 0..vertices.len() {
            let (is_set, sample, radiance, is_near) = sample(i);
            is_any_near |= is_set & is_near;
            let (direction, normal, pdf) = sample.seen_from(vertices.position(i));
            let end = sample.point.origin_towards(normal, end_tier(FAST));
            let direction = select(is_set, direction, self.direction.get(i));
            let pdf = if is_set { (pdf * expected).min(f64::MAX) } else { self.pdf[i] };
            let local = vertices.to_local(i, direction);
            let is_above = vertices.leaves_above(i, surfaces, direction);
            self.direction.set(i, direction);
            self.local.set(i, local);
            self.radiance.set(i, select(is_set, radiance, self.radiance.get(i)));
            self.pdf[i] = if (local.z > 0.0) == is_above { pdf } else { 0.0 };
            self.distance[i] = if is_set { 0.0 } else { self.distance[i] };
            self.end.set(i, select(is_set, end, self.end.get(i)));
        }
        is_any_near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::detail::{HitBuffer, Layout, RayBuffer};
    use crate::bvh::{Mesh, Traversal};
    use crate::effects::LightTechnique;
    use crate::effects::bounce_limits::BounceLimits;
    use crate::effects::path::numbers::Sequence;
    use crate::effects::path::{Path, Scatter};
    use crate::effects::samples::SampleIndex;
    use crate::effects::{PathSettings, TextureUse};
    use crate::film::{Colour, ColourPipeline};
    use crate::scene::{
        Environment, EnvironmentSource, Falloff, Light, LightKind, Material, MaterialId, Object, Phong,
        PixelSampler, Scene, Shape,
    };
    use crate::world::{HitOrder, RAYS_PER_BATCH};

    /// A floor, a lamp of some triangles that crosses it, a uniform environment, and perhaps a point light.
    fn world(numerics: Numerics, triangles: usize, has_point: bool) -> World {
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
        let light = Light { name: String::new(), colour, intensity: 1.0, kind };
        let mut lamp_mesh = quad([[0.2, -0.5, -1.0], [1.3, 0.8, -1.0], [1.3, 0.8, 1.0], [0.2, -0.5, 1.0]]);
        lamp_mesh.positions.push(DVec3::new(-1.0, 0.9, 1.2));
        lamp_mesh.triangles.push([1, 2, 4]);
        lamp_mesh.triangles.truncate(triangles);
        let scene = Scene {
            materials: vec![Material::Phong(Phong::default()), Material::Phong(lamp)],
            objects: vec![
                object(0, quad([[-2.0, 0.0, -2.0], [-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0]])),
                object(1, lamp_mesh),
            ],
            lights: if has_point { vec![light] } else { Vec::new() },
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
        let lamps = [(1, true), (2, true), (3, true), (2, false), (3, false)];
        let mut kinds = [0; 4];
        for (numerics, (triangles, has_point)) in
            Numerics::ALL.into_iter().flat_map(|numerics| lamps.map(|lamp| (numerics, lamp)))
        {
            let world = world(numerics, triangles, has_point);
            let surfaces = surfaces(&world);
            let stage = Scatter {
                limits: BounceLimits::new(Some(3), None),
                seed: 1,
                continued: None,
                sampler: PixelSampler::Sobol,
                technique: LightTechnique::Both,
                settings: PathSettings::default(),
                texture_use: TextureUse::default(),
                clamp: f64::INFINITY,
            };
            let lights = Lights::new(&world, &stage);
            let mut vertices = Box::<Vertices>::default();
            let path = Path { pdf: 1.0, ..Path::OF_CAMERA };
            vertices.begin(&world, &surfaces, &[path; RAYS_PER_BATCH], &[]);
            vertices.find_frames(&world, &surfaces, None);
            let mut numbers = Box::<GenerationNumbers>::default();
            let sequence = Sequence { seed: 1, sampler: PixelSampler::Sobol, depth: 1 };
            let pixels = (0..surfaces.len() as u32).map(|x| SampleIndex { x, y: 0, sample: 0 });
            numbers.fill(pixels, sequence);
            numbers.fill_light(sequence, 0);
            let mut samples = Box::<LightSamples>::default();
            samples.take(
                (&world, &lights),
                &surfaces,
                &vertices,
                &numbers,
                (&mut Box::default(), &mut Vec::new()),
            );
            for i in 0..vertices.len() {
                samples.bsdf_pdf[i] = 0.3;
                samples.value.set(i, DVec3::ONE);
            }
            samples.find_contributions(&surfaces, &vertices, LightTechnique::Both);
            samples.list_rays(&world, &surfaces, &vertices);
            samples.write_rays(world.numerics().ray_precision());
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
        }
        assert!(kinds.into_iter().all(|count| count > 0), "{kinds:?}");
    }
}
