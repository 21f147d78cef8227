//! Continuation of paths: directions sampled by BSDFs, and Russian roulette.

use glam::DVec3;

use super::numbers::GenerationNumbers;
use super::vertices::{ClassPartition, IndexList, Vertices};
use super::{Buffers, Path, Scatter};
use crate::effects::tile::RayGeneration;
use crate::shading::bsdf::{BsdfSample, DirectionSample};
use crate::world::{Flags, InteractionSoa, PerRay, Vec3Soa, World, select, simd};

/// The highest probability with which roulette lets a path continue.
const MAX_SURVIVAL: f64 = 0.95;

/// The probability with which roulette lets a path of this throughput continue.
#[inline(always)]
pub(super) fn survival(throughput: DVec3) -> f64 {
    throughput.max_element().min(MAX_SURVIVAL)
}

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
    /// [`Vertices::leaves_above`].
    is_above: Flags,
    throughput: Vec3Soa,
    /// The origins of the rays.
    origin: Vec3Soa,
    /// The vertices at which paths continue.
    pub(super) continuing: IndexList,
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

    /// Sets the sample of a vertex with a class of BSDF, if it is a member.
    #[inline(always)]
    pub(super) fn set_member(
        &mut self,
        members: &ClassPartition,
        vertices: &Vertices,
        i: usize,
        sample: DirectionSample,
        is_delta: bool,
    ) {
        let (is_member, is_visible) = (members.has(i), vertices.is_visible(i));
        let pdf = if is_visible { sample.pdf } else { 0.0 };
        self.local.set(i, select(is_member, sample.direction, self.local.get(i)));
        self.weight.set(i, select(is_member, sample.weight, self.weight.get(i)));
        self.pdf[i] = if is_member { pdf } else { self.pdf[i] };
        self.is_delta.set(i, (is_member & is_visible & is_delta) | (!is_member & self.is_delta.get(i)));
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
            let is_above = vertices.leaves_above(i, surfaces, direction);
            let throughput = vertices.throughput.get(i) * self.weight.get(i);
            let survival = survival(throughput);
            let [_, number] = numbers.lobe_and_roulette(i);
            let survives = !has_roulette | (number < survival);
            let throughput = select(has_roulette, throughput / survival, throughput);
            let is_zero = (throughput.x == 0.0) & (throughput.y == 0.0) & (throughput.z == 0.0);
            let continues = ((local.z > 0.0) == is_above) & survives & !is_zero;
            self.origin.set(i, vertices.origin_above(i));
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
        (world, stage): (&World, &Scatter),
        (generation, next): (&RayGeneration, &mut RayGeneration),
        has_roulette: bool,
    ) {
        let Buffers { vertices, continuations, numbers, .. } = self;
        let surfaces = &*generation.surfaces;
        let precision = world.numerics().ray_precision();
        simd!(continuations.find_throughputs(surfaces, vertices, numbers, has_roulette));
        let Continuations { continuing, pdf, direction, throughput, origin, is_above, .. } =
            &mut **continuations;
        let is_finite = |i: usize| throughput.get(i).is_finite();
        continuing.fill(vertices.len(), |i| pdf[i] != 0.0);
        self.discarded += continuing.retain(is_finite);
        for i in continuing.iter().filter(|&i| !is_above.get(i)) {
            origin.set(i, vertices.origin(i, world, surfaces, direction.get(i)));
        }
        simd!(next.rays.write(
            0..continuing.len(),
            #[inline(always)]
            |k| {
                let i = continuing.get(k);
                precision.ray(origin.get(i), direction.get(i), 0.0, f64::INFINITY)
            }
        ));
        // In a loop each: an iterator of known length is appended without checks of the capacity.
        let ray_of = |i: usize| surfaces.ray_of()[i] as usize;
        next.sources.extend(continuing.iter().map(|i| i as u32));
        next.camera_rays.extend(continuing.iter().map(|i| generation.camera_rays[ray_of(i)]));
        self.next.extend(continuing.iter().map(|i| {
            let Path { bounces: before, counted, .. } = self.paths[ray_of(i)];
            let is_delta = pdf[i].is_infinite();
            let bounces = if before == 0 && is_delta { 0 } else { (before + 1).min(2) };
            let counted = counted.saturating_add(u16::from(stage.limits.counts(is_delta)));
            let (throughput, from) = (throughput.get(i), vertices.position(i));
            Path { throughput, pdf: pdf[i], from, counted, bounces }
        }));
        if world.volumes.is_some() {
            let media = |i: usize| vertices.media_towards(i, surfaces, direction.get(i));
            self.next_media.extend(continuing.iter().map(media));
        }
    }
}
