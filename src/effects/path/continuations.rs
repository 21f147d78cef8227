//! Continuation of paths: directions sampled by BSDFs, and Russian roulette.

use super::numbers::GenerationNumbers;
use super::vertices::{Vertices, select};
use super::{Buffers, Path};
use crate::effects::tile::RayGeneration;
use crate::shading::bsdf::BsdfSample;
use crate::world::{Flags, InteractionSoa, PerRay, Vec3Soa, World, simd};

/// The highest probability with which roulette lets a path continue.
const MAX_SURVIVAL: f64 = 0.95;

/// A direction sampled at each vertex of a generation.
#[derive(Default)]
pub(super) struct Continuations {
    /// Unit vectors in the frames of the vertices.
    pub(super) local: Vec3Soa,
    /// The value of the BSDF times the cosine over the density.
    pub(super) weight: Vec3Soa,
    /// The density per solid angle; infinite for delta lobes; 0 where the path ends, and other arrays mean nothing.
    pub(super) pdf: PerRay<f64>,
    /// Whether the BSDF has delta lobes alone, or none.
    pub(super) is_delta: Flags,
    /// Unit vectors in the world.
    direction: Vec3Soa,
    /// Whether these are on the side of the geometric normal.
    is_above: Flags,
    throughput: Vec3Soa,
}

impl Continuations {
    /// Sets the sample of a vertex.
    pub(super) fn set(&mut self, i: usize, sample: Option<BsdfSample>) {
        let Some(BsdfSample { direction, weight, pdf, is_delta, .. }) = sample else {
            self.pdf[i] = 0.0;
            return;
        };
        self.local.set(i, direction);
        self.weight.set(i, weight);
        self.pdf[i] = if is_delta { f64::INFINITY } else { pdf };
    }

    /// Computes directions in the world and throughputs. Paths end where shading and geometric normal disagree on the
    /// side, and by Russian roulette where `has_roulette`.
    #[inline(always)]
    fn find_throughputs(
        &mut self,
        surfaces: &InteractionSoa,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        has_roulette: bool,
    ) {
        for i in 0..vertices.len() {
            let local = self.local.get(i);
            let direction = vertices.to_world(i, local);
            let is_above = direction.dot(surfaces.geometric_normal.get(i)) > 0.0;
            let throughput = vertices.throughput.get(i) * self.weight.get(i);
            let survival = throughput.max_element().min(MAX_SURVIVAL);
            let [_, number] = numbers.lobe_and_roulette(i);
            let survives = !has_roulette | (number < survival);
            let throughput = select(has_roulette, throughput / survival, throughput);
            let is_zero = (throughput.x == 0.0) & (throughput.y == 0.0) & (throughput.z == 0.0);
            let continues = ((local.z > 0.0) == is_above) & survives & !is_zero;
            self.is_above.set(i, is_above);
            self.direction.set(i, direction);
            self.throughput.set(i, throughput);
            self.pdf[i] = if continues { self.pdf[i] } else { 0.0 };
        }
    }
}

impl Buffers {
    /// Fills the next generation with the continuing paths.
    pub(super) fn list_continuations(
        &mut self,
        world: &World,
        (generation, next): (&RayGeneration, &mut RayGeneration),
        has_roulette: bool,
    ) {
        let Buffers { vertices, continuations, numbers, .. } = self;
        let surfaces = &*generation.surfaces;
        let precision = world.numerics().ray_precision();
        simd!(continuations.find_throughputs(surfaces, vertices, numbers, has_roulette));
        for (i, &ray) in surfaces.ray_of().iter().enumerate() {
            let (pdf, throughput) = (continuations.pdf[i], continuations.throughput.get(i));
            if pdf == 0.0 {
                continue;
            }
            if !throughput.is_finite() {
                self.discarded += 1;
                continue;
            }
            let direction = continuations.direction.get(i);
            let origin = if continuations.is_above.get(i) {
                vertices.origin_above(i)
            } else {
                vertices.origin(i, world, surfaces, direction)
            };
            next.rays.push(&precision.ray(origin, direction, 0.0, f64::INFINITY));
            next.sources.push(i as u32);
            next.camera_rays.push(generation.camera_rays[ray as usize]);
            let before = self.paths[ray as usize].bounces;
            let bounces = if before == 0 && pdf.is_infinite() { 0 } else { before + 1 };
            self.next.push(Path { throughput, pdf, from: surfaces.position.get(i), bounces });
            if world.volumes.is_some() {
                self.next_media.push(vertices.media_towards(i, surfaces, direction));
            }
        }
    }
}
