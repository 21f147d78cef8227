//! The full account of a tile's hits. What [`World::surface`] computes for one hit is computed here for as many at once
//! as lie side by side on one sphere or flat triangle, in the same operations.

use std::ops::Range;

use glam::DVec3;

use super::World;
use super::lanes::{LANES, Lanes, RayLanes, widely};
use super::surface::{Surface, Texels};
use crate::bvh::Primitive;
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Hit, PrimId, SlotId, Sphere, Triangle};

/// Hits beside one another on one primitive are worth a loop of their own from this many on.
const WORTH_A_LOOP: usize = 4;

/// The points that the rays of a tile hit, in the order of the rays: [`Surface`]s, coordinate by coordinate.
pub struct Surfaces {
    len: usize,
    /// Where they are.
    pub position: Lanes,
    /// The same moved away from the edges of their triangles, and the sizes that their errors are relative to: see [`SurfacePoint`].
    start: Lanes,
    reach: Lanes,
    /// Unit vectors towards where the rays came from.
    pub view: Lanes,
    /// Unit normals of the geometry, on the side that the ray came from.
    pub geometric_normal: Lanes,
    /// Unit normals for shading, on the same side.
    pub shading_normal: Lanes,
    /// The objects' own tints.
    pub tint: Lanes,
    /// For each point, what its material's pictures say; empty where nobody looked.
    pub texels: Vec<Texels>,
    /// Distance and barycentric coordinates.
    t: [f64; LANES],
    weights: [[f64; LANES]; 2],
    prim: [u32; LANES],
    object: [u32; LANES],
    material: [u32; LANES],
    ray_of: [u32; LANES],
    runs: Vec<Run>,
    parts: Vec<(u32, Range<usize>)>,
}

/// The points from `start` on are all on one primitive.
#[derive(Clone, Copy)]
struct Run {
    start: usize,
    slot: SlotId,
    prim: PrimId,
}

impl Default for Surfaces {
    fn default() -> Self {
        Surfaces {
            len: 0,
            position: Lanes::default(),
            start: Lanes::default(),
            reach: Lanes::default(),
            view: Lanes::default(),
            geometric_normal: Lanes::default(),
            shading_normal: Lanes::default(),
            tint: Lanes::default(),
            texels: Vec::new(),
            t: [0.0; LANES],
            weights: [[0.0; LANES]; 2],
            prim: [0; LANES],
            object: [0; LANES],
            material: [0; LANES],
            ray_of: [0; LANES],
            runs: Vec::new(),
            parts: Vec::new(),
        }
    }
}

impl Surfaces {
    /// How many points there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len.min(LANES)
    }

    /// Whether nothing was hit.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// For each point, its ray.
    pub fn ray_of(&self) -> &[u32] {
        &self.ray_of[..self.len()]
    }

    /// For each point, the index of its object.
    pub fn objects(&self) -> &[u32] {
        &self.object[..self.len()]
    }

    /// For each point, the index of its material.
    pub fn materials(&self) -> &[u32] {
        &self.material[..self.len()]
    }

    /// The points in parts of one material each: its index, and where the part begins and ends.
    pub fn by_material(&self) -> &[(u32, Range<usize>)] {
        &self.parts
    }

    fn find_parts(&mut self) {
        self.parts.clear();
        for (index, run) in self.runs.iter().enumerate() {
            let end = self.runs.get(index + 1).map_or(self.len, |next| next.start);
            // A run is on one primitive, and has one material.
            let material = self.material[run.start];
            match self.parts.last_mut() {
                Some((same, range)) if *same == material => range.end = end,
                _ => self.parts.push((material, run.start..end)),
            }
        }
    }

    /// Where a point is, and where secondary rays leave it.
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

    /// A point.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Surface {
        Surface {
            point: self.point(i),
            view: self.view.get(i),
            geometric_normal: self.geometric_normal.get(i),
            shading_normal: self.shading_normal.get(i),
            texels: self.texels.get(i).copied().unwrap_or_default(),
            tint: self.tint.get(i),
            prim: PrimId(self.prim[i]),
            object: self.object[i],
            material: self.material[i],
        }
    }

    fn set(&mut self, i: usize, surface: &Surface) {
        self.set_point(i, surface.point);
        self.view.set(i, surface.view);
        self.geometric_normal.set(i, surface.geometric_normal);
        self.shading_normal.set(i, surface.shading_normal);
        self.tint.set(i, surface.tint);
        self.prim[i] = surface.prim.0;
        self.object[i] = surface.object;
        self.material[i] = surface.material;
    }

    /// Takes the hits in, and notes which of them lie side by side on one primitive.
    fn gather(&mut self, rays: &RayLanes, hits: &[Option<Hit>]) {
        assert!(hits.len() <= LANES, "a tile has at most one ray a pixel and level");
        self.runs.clear();
        self.texels.clear();
        let mut len = 0;
        let mut last = None;
        for (index, hit) in (0..).zip(hits) {
            let Some(hit) = hit else { continue };
            self.ray_of[len] = index;
            self.t[len] = hit.t;
            self.weights[0][len] = hit.weights[0];
            self.weights[1][len] = hit.weights[1];
            if last != Some(hit.slot) {
                last = Some(hit.slot);
                self.runs.push(Run { start: len, slot: hit.slot, prim: hit.prim });
            }
            len += 1;
        }
        self.len = len;
        // Of length 1 up to the rounding of the ray, 2^-24 and less.
        if len == hits.len() {
            widely(
                #[inline(always)]
                || (0..len.min(LANES)).for_each(|i| self.view.set(i, -rays.direction.get(i))),
            );
        } else {
            for i in 0..len.min(LANES) {
                self.view.set(i, -rays.direction.get(self.ray_of[i] as usize));
            }
        }
    }
}

impl World {
    /// Everything that is to be known of the closest hits of `rays`, at most [`LANES`] of them: into `surfaces`.
    pub fn surfaces(&self, rays: &RayLanes, hits: &[Option<Hit>], surfaces: &mut Surfaces) {
        surfaces.gather(rays, hits);
        let mut end = surfaces.len();
        for index in (0..surfaces.runs.len()).rev() {
            let run = surfaces.runs[index];
            self.surfaces_of_run(run, end, rays, hits, surfaces);
            end = run.start;
        }
        surfaces.find_parts();
    }

    /// Everything that is to be known of the hits of a run, which ends before `end`.
    fn surfaces_of_run(
        &self,
        run: Run,
        end: usize,
        rays: &RayLanes,
        hits: &[Option<Hit>],
        surfaces: &mut Surfaces,
    ) {
        let range = run.start..end;
        if range.len() >= WORTH_A_LOOP && self.is_plain(run.prim) {
            match self.accelerator.primitive(run.slot) {
                Primitive::Sphere(sphere) => {
                    for i in range.clone() {
                        let point = rays.get(surfaces.ray_of[i] as usize).at(surfaces.t[i]);
                        surfaces.position.set(i, point);
                    }
                    widely(
                        #[inline(always)]
                        || on_sphere(surfaces, range.clone(), &sphere),
                    );
                    return self.name_run(run.prim, range, surfaces);
                }
                Primitive::Triangle(triangle) => {
                    if let Some(normal) = triangle.unit_normal() {
                        widely(
                            #[inline(always)]
                            || on_triangle(surfaces, range.clone(), &triangle, normal),
                        );
                        for i in range.clone() {
                            let (point, normal) = (surfaces.point(i), surfaces.geometric_normal.get(i));
                            let point =
                                self.with_visible_start(point, normal, surfaces.view.get(i), surfaces.t[i]);
                            surfaces.start.set(i, point.start);
                        }
                        return self.name_run(run.prim, range, surfaces);
                    }
                }
            }
        }
        for i in range {
            let ray = surfaces.ray_of[i] as usize;
            if let Some(hit) = &hits[ray] {
                surfaces.set(i, &self.surface(&rays.get(ray), hit));
            }
        }
    }

    /// Whether nothing is interpolated across the object of a primitive.
    fn is_plain(&self, prim: PrimId) -> bool {
        self.objects[self.object_of(prim) as usize].attributes.are_none()
    }

    /// Notes whose points those of a run are.
    fn name_run(&self, prim: PrimId, range: Range<usize>, surfaces: &mut Surfaces) {
        let object = self.object_of(prim);
        surfaces.prim[range.clone()].fill(prim.0);
        surfaces.object[range.clone()].fill(object);
        surfaces.material[range].fill(self.objects[object as usize].material);
    }
}

/// The points of a run on a flat triangle whose normal has length 1.
#[inline(always)]
fn on_triangle(surfaces: &mut Surfaces, range: Range<usize>, triangle: &Triangle, normal: DVec3) {
    for i in range.start..range.end.min(LANES) {
        let (v, w) = (surfaces.weights[0][i], surfaces.weights[1][i]);
        let point = SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w]);
        finish(surfaces, i, point, normal);
    }
}

/// The points of a run on a sphere; they stand where the rays' distances put them.
#[inline(always)]
fn on_sphere(surfaces: &mut Surfaces, range: Range<usize>, sphere: &Sphere) {
    for i in range.start..range.end.min(LANES) {
        let (_, normal) = sphere.surface(surfaces.position.get(i));
        finish(surfaces, i, SurfacePoint::on_sphere(sphere.centre, sphere.radius, normal), normal);
    }
}

/// A point of a plain surface, its normal turned to the side that the ray came from.
#[inline(always)]
fn finish(surfaces: &mut Surfaces, i: usize, point: SurfacePoint, normal: DVec3) {
    // The view is the direction's negative to the bit, so this is the sign of their product turned.
    let behind = normal.dot(surfaces.view.get(i)) < 0.0;
    let turn = |c: f64| if behind { -c } else { c };
    let facing = DVec3::new(turn(normal.x), turn(normal.y), turn(normal.z));
    surfaces.set_point(i, point);
    surfaces.geometric_normal.set(i, facing);
    surfaces.shading_normal.set(i, facing);
    surfaces.tint.set(i, DVec3::ONE);
}
