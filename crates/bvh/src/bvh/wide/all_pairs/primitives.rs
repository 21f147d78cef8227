//! [`SmallLeafBatch`]: the primitives of a small scene, as the tests of all pairs read them.

use crate::bvh::wide::layout::Wide;
use crate::geometry::estimate::{Errors, Estimate, RaysInF32, ShapeInF32, TriangleInF32, reach_of_origins};
use crate::geometry::lanes::{HitN, LANES4, MAX_LANES, RayN};
use crate::geometry::plane::{PLANE_NUMBERS, TrianglePlane, plane_of};
use crate::geometry::simd::{Doubles, Floats, TABLE};
use crate::geometry::woop_n::PreparedEachN;
use crate::geometry::{AnalyticShape, NO_PRIMITIVE, Rays, SHAPE_NUMBERS, ShapeN, Tier};

/// The most primitives that all rays are tested against. Measurements: docs/decisions.md.
const MAX_PRIMITIVES: usize = TABLE;

/// The index that stands for a miss.
pub(super) const NONE: u32 = TABLE as u32;

/// The primitives of a small scene. An index is that of a triangle or, from their number on, of an analytic
/// shape. These are sorted by kind.
pub(crate) struct SmallLeafBatch {
    triangles: Vec<TriangleInF32>,
    shapes: Vec<ShapeInF32>,
    /// For each kind of analytic shape the first index, and one shape.
    kinds: Vec<(usize, AnalyticShape)>,
    /// For each index, slot and primitive; the last entry stands for a miss.
    pub(super) slots: [u32; TABLE + 1],
    pub(super) prims: [u32; TABLE + 1],
    /// The largest coordinate of the primitives, up to rounding, and the bounds of errors of rays that start within.
    reach: f64,
    errors: [Errors; TABLE],
    /// For each index, the corners of a triangle and the numbers of its plane, or the numbers of an analytic shape.
    corners: [[[f64; TABLE]; 3]; 3],
    planes: [[f64; TABLE]; PLANE_NUMBERS],
    numbers: [[f64; TABLE]; SHAPE_NUMBERS],
}

impl SmallLeafBatch {
    /// The primitives of a scene; `None` if it is not small enough, or the tier or a primitive do not allow it.
    pub(crate) fn new<T: Tier>(wide: &Wide<T>) -> Option<Box<Self>> {
        if !T::HAS_RAY_N || wide.triangles.len() + wide.analytic.len() > MAX_PRIMITIVES {
            return None;
        }
        let mut batch = Box::new(SmallLeafBatch {
            triangles: Vec::new(),
            shapes: Vec::new(),
            kinds: Vec::new(),
            slots: [0; TABLE + 1],
            prims: [NO_PRIMITIVE; TABLE + 1],
            reach: 0.0,
            errors: [Errors::NONE; TABLE],
            corners: [[[0.0; TABLE]; 3]; 3],
            planes: [[0.0; TABLE]; PLANE_NUMBERS],
            numbers: [[0.0; TABLE]; SHAPE_NUMBERS],
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
        let shapes =
            (0..).zip(&wide.analytic).filter_map(|(index, (shape, id))| Some((index, (*shape)?, id.0)));
        let mut shapes: Vec<(u32, AnalyticShape, u32)> = shapes.collect();
        shapes.sort_by_key(|(_, shape, _)| shape.name());
        for (index, shape, id) in shapes {
            let in_f32 = ShapeInF32::new(&shape);
            if count == MAX_PRIMITIVES || !in_f32.is_supported() {
                return None;
            }
            if batch.kinds.last().is_none_or(|(_, other)| other.name() != shape.name()) {
                batch.kinds.push((count, shape));
            }
            batch.reach = batch.reach.max(in_f32.reach());
            batch.shapes.push(in_f32);
            (batch.slots[count], batch.prims[count]) = (wide.slot_of_analytic(index).index(), id);
            batch.numbers.iter_mut().zip(shape.numbers()).for_each(|(to, x)| to[count] = x);
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
            + self.shapes.len() * size_of::<ShapeInF32>()
    }

    /// The number of primitives.
    pub(super) fn len(&self) -> usize {
        self.triangles.len() + self.shapes.len()
    }

    /// The bounds of errors for rays whose origins have coordinates up to `reach`.
    fn errors_within(&self, reach: f64) -> [Errors; TABLE] {
        let mut all = [Errors::NONE; TABLE];
        let (of_triangles, of_shapes) = all.split_at_mut(self.triangles.len());
        of_triangles.iter_mut().zip(&self.triangles).for_each(|(to, triangle)| *to = triangle.errors(reach));
        of_shapes.iter_mut().zip(&self.shapes).for_each(|(to, shape)| *to = shape.errors(reach));
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
        let (of_triangles, of_shapes) = errors.split_at(self.triangles.len());
        let mut index = 0;
        for (triangle, errors) in self.triangles.iter().zip(of_triangles) {
            let estimate = triangle.estimate(errors, rays);
            if estimate.possible != 0 {
                visit(index, estimate);
            }
            index += 1;
        }
        for (shape, errors) in self.shapes.iter().zip(of_shapes) {
            let estimate = shape.estimate(errors, rays);
            if estimate.possible != 0 {
                visit(index, estimate);
            }
            index += 1;
        }
    }

    /// The lanes whose index is `first` or above.
    #[inline(always)]
    fn lanes_from<D: Doubles>(first: usize, indices: &[u32; MAX_LANES]) -> u32 {
        let mut lanes = 0;
        for (lane, &index) in indices.iter().enumerate().take(D::LANES) {
            lanes |= u32::from(index >= first as u32) << lane;
        }
        lanes
    }

    /// The lanes of `lanes` with an analytic shape.
    #[inline(always)]
    fn analytic_lanes<D: Doubles>(&self, indices: &[u32; MAX_LANES], lanes: u32) -> u32 {
        if self.shapes.is_empty() { 0 } else { Self::lanes_from::<D>(self.triangles.len(), indices) & lanes }
    }

    /// Calls `visit` for each kind of analytic shape in `lanes`, with its lanes and the shapes of all indices, as if
    /// they were of that kind.
    #[inline(always)]
    fn each_kind<D: Doubles>(
        &self,
        indices: &[u32; MAX_LANES],
        mut lanes: u32,
        mut visit: impl FnMut(u32, ShapeN<D>),
    ) {
        for (place, (first, shape)) in self.kinds.iter().enumerate().rev() {
            let of_kind = if place == 0 { lanes } else { Self::lanes_from::<D>(*first, indices) & lanes };
            lanes &= !of_kind;
            if of_kind != 0 {
                let number = |number: usize| D::look_up(&self.numbers[number], indices);
                visit(of_kind, shape.in_lanes(number));
            }
        }
    }

    /// The lanes of `lanes` whose primitive may lie ahead of the ray's origin.
    #[inline(always)]
    pub(super) fn ahead<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> u32 {
        if lanes == 0 {
            return 0;
        }
        let analytic = self.analytic_lanes::<D>(indices, lanes);
        let mut behind = 0;
        if analytic != lanes {
            let mut numbers = [rays.t_min; PLANE_NUMBERS];
            for (number, table) in numbers.iter_mut().zip(&self.planes) {
                *number = D::look_up(table, indices);
            }
            behind |= TrianglePlane::of_numbers(numbers).behind(rays) & !analytic;
        }
        self.each_kind(
            indices,
            analytic,
            #[inline(always)]
            |lanes, shapes| behind |= shapes.behind(rays) & lanes,
        );
        lanes & !behind
    }

    /// The tier's hits of each ray on the primitive of its index, in the lanes of `lanes`.
    #[inline(always)]
    pub(super) fn hit<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> HitN<D> {
        if lanes == 0 {
            return HitN::NONE;
        }
        let analytic = self.analytic_lanes::<D>(indices, lanes);
        let mut hits = HitN::NONE;
        if analytic != lanes {
            let mut corners = [[rays.t_min; 3]; 3];
            for (corner, tables) in corners.iter_mut().zip(&self.corners) {
                for (x, table) in corner.iter_mut().zip(tables) {
                    *x = D::look_up(table, indices);
                }
            }
            hits = PreparedEachN::new(rays).hit(&corners);
            hits.hit &= lanes & !analytic;
            hits.undecided &= lanes & !analytic;
        }
        self.each_kind(
            indices,
            analytic,
            #[inline(always)]
            |lanes, shapes| {
                let of_kind = shapes.hit(rays);
                hits.hit |= of_kind.hit & lanes;
                hits.undecided |= of_kind.undecided & lanes;
                hits.select(lanes, &of_kind);
            },
        );
        hits
    }
}
