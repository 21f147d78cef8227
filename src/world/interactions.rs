//! Surface interactions of a ray generation, as a structure of arrays.
//!
//! Runs of adjacent hits on one sphere or flat triangle are computed in one vectorised loop, and so are hits on
//! different triangles, whose corners are gathered: with the operations of [`World::interaction`] and the same bits.

use std::ops::Range;

use glam::DVec3;

use super::World;
use super::hit_order::{HitOrder, sort};
use super::interaction::SurfaceInteraction;
use super::simd;
use super::soa::{Flags, PerRay, RAYS_PER_BATCH, Vec3Soa};
use super::texels::Texels;
use crate::bvh::detail::{EdgeTest, HitBuffer, RayBuffer, SurfacePoint};
use crate::bvh::{AnalyticShape, Hit, Numerics, PrimId, Primitive, SlotId, Triangle};

/// The shortest run of hits on one primitive that is computed in a loop of its own.
const MIN_RUN: usize = 4;

/// [`SurfaceInteraction`]s of the rays that hit, in a [`HitOrder`], as a structure of arrays.
#[derive(Default)]
pub struct InteractionSoa {
    len: usize,
    /// The positions.
    pub position: Vec3Soa,
    /// The other fields of [`SurfacePoint`].
    start: Vec3Soa,
    reach: Vec3Soa,
    /// Unit vectors towards the rays' origins.
    pub view: Vec3Soa,
    /// Unit normals of the primitives, on the side of `view`.
    pub geometric_normal: Vec3Soa,
    /// Unit normals for shading, on the side of the geometric normals.
    pub shading_normal: Vec3Soa,
    /// Interpolated vertex colours.
    pub tint: Vec3Soa,
    /// Whether any of these may differ from 1.
    pub is_tinted: bool,
    /// Factors of the ambient light, 0 to 1; empty where all are 1.
    pub ambient: Vec<f64>,
    /// The values of the materials' textures.
    pub texels: Texels,
    /// See [`SurfaceInteraction::is_turned`].
    is_turned: Flags,
    /// The hits: distances along the rays, barycentrics v and w, primitives and their slots.
    t: PerRay<f64>,
    barycentrics: [PerRay<f64>; 2],
    prim: PerRay<u32>,
    slot: PerRay<u32>,
    object: PerRay<u32>,
    material: PerRay<u32>,
    ray_of: PerRay<u32>,
    /// The rays in the order of their hits, where these are sorted.
    sorted: PerRay<u32>,
    /// The corners of triangles whose hits are no runs.
    corners: [Vec3Soa; 3],
    /// Whether an interaction is left to [`World::interaction`].
    is_scalar: Flags,
    runs: Vec<Run>,
    material_ranges: Vec<(u32, Range<usize>)>,
}

/// Consecutive interactions on one primitive. A run ends where the next begins.
#[derive(Clone, Copy)]
struct Run {
    start: usize,
    slot: SlotId,
    prim: PrimId,
}

impl InteractionSoa {
    /// The number of interactions.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len.min(RAYS_PER_BATCH)
    }

    /// Whether no ray hit.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// For each interaction, the index of its ray.
    pub fn ray_of(&self) -> &[u32] {
        &self.ray_of[..self.len()]
    }

    /// For each interaction, the index of its object.
    pub fn objects(&self) -> &[u32] {
        &self.object[..self.len()]
    }

    /// For each interaction, the index of its material.
    pub fn materials(&self) -> &[u32] {
        &self.material[..self.len()]
    }

    /// Maximal ranges of interactions with one material, in order: the material's index and the range.
    pub fn by_material(&self) -> &[(u32, Range<usize>)] {
        &self.material_ranges
    }

    fn find_material_ranges(&mut self) {
        self.material_ranges.clear();
        for (index, run) in self.runs.iter().enumerate() {
            let end = self.runs.get(index + 1).map_or(self.len, |next| next.start);
            // A run lies on one primitive, so it has one material.
            let material = self.material[run.start];
            match self.material_ranges.last_mut() {
                Some((same, range)) if *same == material => range.end = end,
                _ => self.material_ranges.push((material, run.start..end)),
            }
        }
    }

    /// The surface point of the interaction at `i`.
    #[inline(always)]
    pub fn point(&self, i: usize) -> SurfacePoint {
        SurfacePoint { position: self.position.get(i), start: self.start.get(i), reach: self.reach.get(i) }
    }

    #[inline(always)]
    fn set_point(&mut self, i: usize, point: SurfacePoint) {
        self.position.set(i, point.position);
        self.start.set(i, point.start);
        self.reach.set(i, point.reach);
    }

    /// The interaction at `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> SurfaceInteraction {
        SurfaceInteraction {
            point: self.point(i),
            view: self.view.get(i),
            geometric_normal: self.geometric_normal.get(i),
            shading_normal: self.shading_normal.get(i),
            ambient: self.ambient.get(i).copied().unwrap_or(1.0),
            tint: self.tint.get(i),
            is_turned: self.is_turned.get(i),
            hit: self.hit(i),
            object: self.object[i],
            material: self.material[i],
        }
    }

    /// The hit of the interaction at `i`.
    #[inline(always)]
    pub fn hit(&self, i: usize) -> Hit {
        let (prim, barycentrics) = (PrimId(self.prim[i]), [self.barycentrics[0][i], self.barycentrics[1][i]]);
        Hit { t: self.t[i], prim, slot: SlotId::new(self.slot[i]), barycentrics }
    }

    /// The barycentrics u, v and w of a hit on a triangle.
    #[inline(always)]
    fn barycentrics(&self, i: usize) -> [f64; 3] {
        let (v, w) = (self.barycentrics[0][i], self.barycentrics[1][i]);
        [1.0 - v - w, v, w]
    }

    fn set(&mut self, i: usize, surface: &SurfaceInteraction) {
        self.set_point(i, surface.point);
        self.view.set(i, surface.view);
        self.geometric_normal.set(i, surface.geometric_normal);
        self.shading_normal.set(i, surface.shading_normal);
        self.tint.set(i, surface.tint);
        self.is_tinted |= surface.tint != DVec3::ONE;
        self.is_turned.set(i, surface.is_turned);
        self.object[i] = surface.object;
        self.material[i] = surface.material;
    }

    /// Compacts the hits and finds their runs.
    fn gather(&mut self, rays: &RayBuffer, hits: &HitBuffer, order: HitOrder) {
        assert!(hits.len() <= RAYS_PER_BATCH, "at most {RAYS_PER_BATCH} rays");
        self.runs.clear();
        self.texels.clear();
        self.ambient.clear();
        self.is_tinted = false;
        let is_sorted = order == HitOrder::Primitives && sort(hits, &mut self.sorted);
        let mut len = 0;
        let mut last = None;
        for place in 0..hits.len() {
            let index = if is_sorted { self.sorted[place] } else { place as u32 };
            let Some(hit) = hits.get(index as usize) else { continue };
            self.ray_of[len] = index;
            self.t[len] = hit.t;
            self.barycentrics[0][len] = hit.barycentrics[0];
            self.barycentrics[1][len] = hit.barycentrics[1];
            (self.prim[len], self.slot[len]) = (hit.prim.0, hit.slot.index());
            if last != Some(hit.slot) {
                last = Some(hit.slot);
                self.runs.push(Run { start: len, slot: hit.slot, prim: hit.prim });
            }
            len += 1;
        }
        self.len = len;
        // Of length 1 up to the rounding of the ray's direction, at most 2^-24.
        if len == hits.len() && !is_sorted {
            self.view.set_negated(rays.rays().directions());
        } else {
            for i in 0..len.min(RAYS_PER_BATCH) {
                self.view.set(i, -rays.get(self.ray_of[i] as usize).direction());
            }
        }
    }
}

impl World {
    /// Computes the surface interactions of the closest hits of `rays`, at most [`RAYS_PER_BATCH`].
    pub fn interactions(
        &self,
        rays: &RayBuffer,
        hits: &HitBuffer,
        order: HitOrder,
        surfaces: &mut InteractionSoa,
    ) {
        surfaces.gather(rays, hits, order);
        // The hits from `single` on are those of runs that are too short.
        let (mut single, mut end) = (surfaces.len(), surfaces.len());
        for index in (0..surfaces.runs.len()).rev() {
            let run = surfaces.runs[index];
            if self.interactions_of_run(run, end, rays, surfaces) {
                self.interactions_of_single_hits(end..single, rays, surfaces);
                single = run.start;
            }
            end = run.start;
        }
        self.interactions_of_single_hits(0..single, rays, surfaces);
        surfaces.find_material_ranges();
    }

    /// Whether a surface is seen from the back: from the inside of an analytic shape, or where the corners of a
    /// triangle are seen clockwise, counterclockwise in a mirrored mesh.
    #[inline]
    pub(crate) fn is_seen_from_back(&self, surfaces: &InteractionSoa, i: usize) -> bool {
        surfaces.is_turned.get(i) != self.objects[surfaces.object[i] as usize].is_mirrored
    }

    /// Computes the interactions of a run, which ends before `end`. Returns `false` where its hits are left to
    /// [`World::interactions_of_single_hits`].
    fn interactions_of_run(
        &self,
        run: Run,
        end: usize,
        rays: &RayBuffer,
        surfaces: &mut InteractionSoa,
    ) -> bool {
        let range = run.start..end;
        if range.len() >= MIN_RUN && self.is_plain(run.prim) {
            match self.accelerator.primitive(run.slot) {
                Primitive::Analytic(shape) => {
                    for i in range.clone() {
                        let point = rays.get(surfaces.ray_of[i] as usize).at(surfaces.t[i]);
                        surfaces.position.set(i, point);
                    }
                    simd!(on_analytic(surfaces, range.clone(), &shape));
                    self.set_indices(run.prim, range, surfaces);
                    return true;
                }
                Primitive::Triangle(triangle) => {
                    if let Some(normal) = triangle.unit_normal() {
                        let edges = EdgeTest::new(triangle.0, self.numerics());
                        let is_any_near =
                            simd!(on_triangle(surfaces, range.clone(), &triangle, normal, &edges));
                        if is_any_near {
                            self.move_starts(surfaces, range.clone(), &triangle, &edges);
                        }
                        self.set_indices(run.prim, range, surfaces);
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Computes the interactions of hits on different primitives.
    fn interactions_of_single_hits(
        &self,
        range: Range<usize>,
        rays: &RayBuffer,
        surfaces: &mut InteractionSoa,
    ) {
        for i in range.clone() {
            let primitive = self.accelerator.primitive(SlotId::new(surfaces.slot[i]));
            surfaces.is_scalar.set(i, !matches!(primitive, Primitive::Triangle(_)));
            if let Primitive::Triangle(triangle) = primitive {
                for (to, corner) in surfaces.corners.iter_mut().zip(triangle.0) {
                    to.set(i, corner);
                }
            }
        }
        let numerics = self.numerics();
        simd!(on_triangles(surfaces, range.clone(), numerics));
        for i in range {
            if surfaces.is_scalar.get(i) {
                let ray = rays.get(surfaces.ray_of[i] as usize);
                surfaces.set(i, &self.interaction(&ray, &surfaces.hit(i)));
                continue;
            }
            let prim = PrimId(surfaces.prim[i]);
            let index = self.object_of(prim);
            let object = &self.objects[index as usize];
            (surfaces.object[i], surfaces.material[i]) = (index, object.material);
            let barycentrics = surfaces.barycentrics(i);
            if let Some(normal) = object.smooth_normal(prim, barycentrics, surfaces.geometric_normal.get(i)) {
                surfaces.shading_normal.set(i, normal);
            }
            if let Some(tint) = object.tint(prim, barycentrics, self.pipeline) {
                surfaces.tint.set(i, tint);
                surfaces.is_tinted = true;
            }
        }
    }

    /// Moves the starts of secondary rays of a run on a flat triangle that are near edges.
    #[cold]
    fn move_starts(
        &self,
        surfaces: &mut InteractionSoa,
        range: Range<usize>,
        triangle: &Triangle,
        edges: &EdgeTest,
    ) {
        for i in range {
            let barycentrics = surfaces.barycentrics(i);
            if edges.is_near(barycentrics) {
                let point = SurfacePoint::on_triangle(triangle.0, barycentrics, self.numerics());
                let (normal, view) = (surfaces.geometric_normal.get(i), surfaces.view.get(i));
                let point = self.with_visible_start(point, normal, view, surfaces.t[i]);
                surfaces.start.set(i, point.start);
            }
        }
    }

    /// Whether the object of a primitive has no vertex attributes.
    fn is_plain(&self, prim: PrimId) -> bool {
        self.objects[self.object_of(prim) as usize].attributes.are_none()
    }

    /// Writes object and material of a run.
    fn set_indices(&self, prim: PrimId, range: Range<usize>, surfaces: &mut InteractionSoa) {
        let object = self.object_of(prim);
        surfaces.object[range.clone()].fill(object);
        surfaces.material[range].fill(self.objects[object as usize].material);
    }
}

/// Computes a run on a flat triangle; `normal` has length 1. Returns whether any point may be near an edge: the starts
/// of those are not moved.
#[inline(always)]
fn on_triangle(
    surfaces: &mut InteractionSoa,
    range: Range<usize>,
    triangle: &Triangle,
    normal: DVec3,
    edges: &EdgeTest,
) -> bool {
    let mut is_any_near = false;
    for i in range.start..range.end.min(RAYS_PER_BATCH) {
        let barycentrics = surfaces.barycentrics(i);
        is_any_near |= edges.is_near(barycentrics);
        finish(surfaces, i, SurfacePoint::in_triangle(triangle.0, barycentrics), normal);
    }
    is_any_near
}

/// Computes hits on the triangles of `corners`, without vertex attributes. Those near an edge, or on triangles without
/// normal, are left to [`World::interaction`].
#[inline(always)]
fn on_triangles(surfaces: &mut InteractionSoa, range: Range<usize>, numerics: Numerics) {
    for i in range.start..range.end.min(RAYS_PER_BATCH) {
        let [a, b, c] = &surfaces.corners;
        let triangle = Triangle([a.get(i), b.get(i), c.get(i)]);
        let barycentrics = surfaces.barycentrics(i);
        let (normal, has_normal) = triangle.unit_normal_unchecked();
        let is_near = EdgeTest::new(triangle.0, numerics).is_near(barycentrics);
        let is_turned = triangle.normal().dot(surfaces.view.get(i)) < 0.0;
        finish(surfaces, i, SurfacePoint::in_triangle(triangle.0, barycentrics), normal);
        surfaces.is_turned.set(i, is_turned);
        surfaces.is_scalar.set(i, surfaces.is_scalar.get(i) | is_near | !has_normal);
    }
}

/// Computes a run on an analytic shape, from positions `ray.at(t)`.
#[inline(always)]
fn on_analytic(surfaces: &mut InteractionSoa, range: Range<usize>, shape: &AnalyticShape) {
    for i in range.start..range.end.min(RAYS_PER_BATCH) {
        let (point, normal) = shape.surface(surfaces.position.get(i));
        finish(surfaces, i, point, normal);
    }
}

/// Writes an interaction without vertex attributes; its normal is turned to the side of the view.
#[inline(always)]
fn finish(surfaces: &mut InteractionSoa, i: usize, point: SurfacePoint, normal: DVec3) {
    // `view` is exactly the negated direction, so this is exactly the test of the scalar code.
    let behind = normal.dot(surfaces.view.get(i)) < 0.0;
    let turn = |c: f64| if behind { -c } else { c };
    let facing = DVec3::new(turn(normal.x), turn(normal.y), turn(normal.z));
    surfaces.is_turned.set(i, behind);
    surfaces.set_point(i, point);
    surfaces.geometric_normal.set(i, facing);
    surfaces.shading_normal.set(i, facing);
    surfaces.tint.set(i, DVec3::ONE);
}
