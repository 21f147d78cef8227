//! [`SmallLeafBatch`]: the primitives of a small scene, as the tests of all pairs read them.

use crate::bvh::wide::layout::Wide;
use crate::geometry::estimate::{Errors, Estimate, RaysInF32, SphereInF32, TriangleInF32, reach_of_origins};
use crate::geometry::lanes::{HitN, LANES4, MAX_LANES, RayN};
use crate::geometry::plane::{PLANE_NUMBERS, TrianglePlane, plane_of};
use crate::geometry::simd::{Doubles, Floats, TABLE};
use crate::geometry::woop_n::PreparedEachN;
use crate::geometry::{AnalyticShape, NO_PRIMITIVE, Rays, SphereN, Tier};

/// The most primitives that all rays are tested against. Measurements: docs/decisions.md.
const MAX_PRIMITIVES: usize = TABLE;

/// The index that stands for a miss.
pub(super) const NONE: u32 = TABLE as u32;

/// The primitives of a small scene. An index is that of a triangle or, from their number on, of a sphere.
pub(crate) struct SmallLeafBatch {
    triangles: Vec<TriangleInF32>,
    spheres: Vec<SphereInF32>,
    /// For each index, slot and primitive; the last entry stands for a miss.
    pub(super) slots: [u32; TABLE + 1],
    pub(super) prims: [u32; TABLE + 1],
    /// The largest coordinate of the primitives, up to rounding, and the bounds of errors of rays that start within.
    reach: f64,
    errors: [Errors; TABLE],
    /// For each index, the corners of a triangle and the numbers of its plane, or centre and radius of a sphere.
    corners: [[[f64; TABLE]; 3]; 3],
    planes: [[f64; TABLE]; PLANE_NUMBERS],
    centres: [[f64; TABLE]; 3],
    radii: [f64; TABLE],
}

impl SmallLeafBatch {
    /// The primitives of a scene; `None` if it is not small enough, or the tier or a primitive do not allow it.
    pub(crate) fn new<T: Tier>(wide: &Wide<T>) -> Option<Box<Self>> {
        if !T::HAS_RAY_N || wide.triangles.len() + wide.analytic.len() > MAX_PRIMITIVES {
            return None;
        }
        let mut batch = Box::new(SmallLeafBatch {
            triangles: Vec::new(),
            spheres: Vec::new(),
            slots: [0; TABLE + 1],
            prims: [NO_PRIMITIVE; TABLE + 1],
            reach: 0.0,
            errors: [Errors::NONE; TABLE],
            corners: [[[0.0; TABLE]; 3]; 3],
            planes: [[0.0; TABLE]; PLANE_NUMBERS],
            centres: [[0.0; TABLE]; 3],
            radii: [0.0; TABLE],
        });
        let mut count = 0;
        for (slot, leaf, lane) in (0..wide.triangles.len() * LANES4).map(|i| (i, i / LANES4, i % LANES4)) {
            let leaf = &wide.triangles[leaf];
            let (id, corners) = (leaf.ids[lane], leaf.corners.corners_f64(lane));
            // No ray hits a point. A split triangle is in several slots.
            let is_point = corners[0] == corners[1] && corners[1] == corners[2];
            if id == NO_PRIMITIVE || is_point || batch.prims[..count].contains(&id) {
                continue;
            }
            if count == MAX_PRIMITIVES {
                return None;
            }
            let triangle = TriangleInF32::new(&corners);
            if !triangle.is_supported() {
                return None;
            }
            batch.triangles.push(triangle);
            batch.reach = corners.iter().flatten().fold(batch.reach, |reach, x| reach.max(x.abs()));
            (batch.slots[count], batch.prims[count]) = (slot as u32, id);
            for (to, corner) in batch.corners.iter_mut().zip(corners) {
                to.iter_mut().zip(corner).for_each(|(to, x)| to[count] = x);
            }
            batch.planes.iter_mut().zip(plane_of(&corners)).for_each(|(to, x)| to[count] = x);
            count += 1;
        }
        for (index, (shape, id)) in (0..).zip(&wide.analytic).filter(|(_, (shape, _))| !shape.is_empty()) {
            let AnalyticShape::Sphere(sphere) = shape;
            let in_f32 = SphereInF32::new(sphere);
            if count == MAX_PRIMITIVES || !in_f32.is_supported() {
                return None;
            }
            batch.spheres.push(in_f32);
            batch.reach = batch.reach.max(sphere.centre.abs().max_element() + sphere.radius);
            (batch.slots[count], batch.prims[count]) = (wide.slot_of_analytic(index).index(), id.0);
            batch.centres.iter_mut().zip(sphere.centre.to_array()).for_each(|(to, x)| to[count] = x);
            batch.radii[count] = sphere.radius;
            count += 1;
        }
        // Origins of secondary rays lie on surfaces, up to 2^-23 of their coordinates.
        batch.reach *= 1.0 + 1.0 / f64::from(1 << 20);
        batch.errors = batch.errors_within(batch.reach);
        Some(batch)
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.triangles.len() * size_of::<TriangleInF32>()
            + self.spheres.len() * size_of::<SphereInF32>()
    }

    /// The number of primitives.
    pub(super) fn len(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// The bounds of errors for rays whose origins have coordinates up to `reach`.
    fn errors_within(&self, reach: f64) -> [Errors; TABLE] {
        let mut all = [Errors::NONE; TABLE];
        let (of_triangles, of_spheres) = all.split_at_mut(self.triangles.len());
        of_triangles.iter_mut().zip(&self.triangles).for_each(|(to, triangle)| *to = triangle.errors(reach));
        of_spheres.iter_mut().zip(&self.spheres).for_each(|(to, sphere)| *to = sphere.errors(reach));
        all
    }

    /// The bounds of errors for rays, in `of_rays` where they start outside of the scene.
    #[inline(always)]
    pub(super) fn errors<'a, D: Doubles>(
        &'a self,
        rays: Rays,
        of_rays: &'a mut [Errors; TABLE],
    ) -> &'a [Errors; TABLE] {
        let reach = reach_of_origins::<D>(rays);
        if reach <= self.reach {
            return &self.errors;
        }
        *of_rays = self.errors_within(reach);
        of_rays
    }

    /// Calls `visit` with the index and the estimate of each primitive that a ray may hit.
    #[inline(always)]
    pub(super) fn each<F: Floats>(
        &self,
        errors: &[Errors; TABLE],
        rays: &RaysInF32<F>,
        mut visit: impl FnMut(u32, Estimate<F>),
    ) {
        let (of_triangles, of_spheres) = errors.split_at(self.triangles.len());
        let mut index = 0;
        for (triangle, errors) in self.triangles.iter().zip(of_triangles) {
            let estimate = triangle.estimate(errors, rays);
            if estimate.possible != 0 {
                visit(index, estimate);
            }
            index += 1;
        }
        for (sphere, errors) in self.spheres.iter().zip(of_spheres) {
            let estimate = sphere.estimate(errors, rays);
            if estimate.possible != 0 {
                visit(index, estimate);
            }
            index += 1;
        }
    }

    /// The lanes of `lanes` with a sphere.
    #[inline(always)]
    fn spheres_of<D: Doubles>(&self, indices: &[u32; MAX_LANES], lanes: u32) -> u32 {
        let mut spheres = 0;
        if !self.spheres.is_empty() {
            let first = self.triangles.len() as u32;
            for (lane, &index) in indices.iter().enumerate().take(D::LANES) {
                spheres |= u32::from(index >= first) << lane;
            }
        }
        spheres & lanes
    }

    #[inline(always)]
    fn sphere<D: Doubles>(&self, indices: &[u32; MAX_LANES]) -> SphereN<D> {
        let [x, y, z] = &self.centres;
        SphereN {
            centre: [D::look_up(x, indices), D::look_up(y, indices), D::look_up(z, indices)],
            radius: D::look_up(&self.radii, indices),
        }
    }

    /// The lanes of `lanes` whose primitive may lie ahead of the ray's origin.
    #[inline(always)]
    pub(super) fn ahead<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> u32 {
        if lanes == 0 {
            return 0;
        }
        let spheres = self.spheres_of::<D>(indices, lanes);
        let mut behind = 0;
        if spheres != lanes {
            let mut numbers = [rays.t_min; PLANE_NUMBERS];
            for (number, table) in numbers.iter_mut().zip(&self.planes) {
                *number = D::look_up(table, indices);
            }
            behind |= TrianglePlane::of_numbers(numbers).behind(rays) & !spheres;
        }
        if spheres != 0 {
            behind |= self.sphere(indices).behind(rays) & spheres;
        }
        lanes & !behind
    }

    /// The tier's hits of each ray on the primitive of its index, in the lanes of `lanes`.
    #[inline(always)]
    pub(super) fn hit<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> HitN<D> {
        if lanes == 0 {
            return HitN::NONE;
        }
        let spheres = self.spheres_of::<D>(indices, lanes);
        let mut hits = HitN::NONE;
        if spheres != lanes {
            let mut corners = [[rays.t_min; 3]; 3];
            for (corner, tables) in corners.iter_mut().zip(&self.corners) {
                for (x, table) in corner.iter_mut().zip(tables) {
                    *x = D::look_up(table, indices);
                }
            }
            hits = PreparedEachN::new(rays).hit(&corners);
            hits.hit &= lanes & !spheres;
            hits.undecided &= lanes & !spheres;
        }
        if spheres != 0 {
            let of_spheres = self.sphere(indices).hit(rays);
            hits.hit |= of_spheres.hit & spheres;
            hits.undecided |= of_spheres.undecided & spheres;
            hits.select(spheres, &of_spheres);
        }
        hits
    }
}
