//! Every ray against every primitive, a vector of rays at once: for incoherent rays in scenes so small that traversal
//! costs more than it saves.
//!
//! Estimates in f32 ([`crate::geometry::estimate`]) find, for each ray, the primitive that it certainly hits first, and
//! those that they leave open: [`OPEN`] at most. Most often that is the primitive that the ray starts on, which f64
//! shows to lie behind, and for shadow rays the light at their end. The tier's test decides the others, and gives the
//! hit its bits. Rays with more that is open are traced one by one.

use super::layout::Wide;
use crate::bvh::{Accelerator, Traversal};
use crate::geometry::estimate::{Errors, Estimate, RaysInF32, SphereInF32, TriangleInF32, reach_of_origins};
use crate::geometry::lanes::{HitN, LANES4, MAX_LANES, RayN};
use crate::geometry::plane::{PLANE_NUMBERS, TrianglePlane, plane_of};
use crate::geometry::simd::{Doubles, Floats, Simd, TABLE, Vector};
use crate::geometry::woop_n::PreparedEachN;
use crate::geometry::{AnalyticShape, HitBuffer, NO_PRIMITIVE, Rays, SphereN, Tier};

/// The most primitives that all rays are tested against. Measurements: docs/decisions.md.
const MAX_PRIMITIVES: usize = TABLE;

/// The primitives of a ray that f32 may leave open.
const OPEN: usize = 2;

/// The index of no primitive.
const NONE: u32 = TABLE as u32;

/// The primitives of a small scene. An index is that of a triangle or, from their number on, of a sphere.
pub(crate) struct FewPrimitives {
    triangles: Vec<TriangleInF32>,
    spheres: Vec<SphereInF32>,
    /// For each index, slot and primitive; one entry more, of no primitive.
    slots: [u32; TABLE + 1],
    prims: [u32; TABLE + 1],
    /// The largest coordinate of the primitives, up to rounding, and the bounds of errors of rays that start within.
    reach: f64,
    errors: [Errors; TABLE],
    /// For each index, the corners of a triangle and the numbers of its plane, or centre and radius of a sphere.
    corners: [[[f64; TABLE]; 3]; 3],
    planes: [[f64; TABLE]; PLANE_NUMBERS],
    centres: [[f64; TABLE]; 3],
    radii: [f64; TABLE],
}

impl FewPrimitives {
    /// The primitives of a scene; `None` if it is not small enough, or the tier or a primitive do not allow it.
    pub(crate) fn new<T: Tier>(wide: &Wide<T>) -> Option<Box<Self>> {
        if !T::HAS_RAY_N || wide.triangles.len() + wide.analytic.len() > MAX_PRIMITIVES {
            return None;
        }
        let mut few = Box::new(FewPrimitives {
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
            if id == NO_PRIMITIVE || is_point || few.prims[..count].contains(&id) {
                continue;
            }
            if count == MAX_PRIMITIVES {
                return None;
            }
            let triangle = TriangleInF32::new(&corners);
            if !triangle.is_supported() {
                return None;
            }
            few.triangles.push(triangle);
            few.reach = corners.iter().flatten().fold(few.reach, |reach, x| reach.max(x.abs()));
            (few.slots[count], few.prims[count]) = (slot as u32, id);
            for (to, corner) in few.corners.iter_mut().zip(corners) {
                to.iter_mut().zip(corner).for_each(|(to, x)| to[count] = x);
            }
            few.planes.iter_mut().zip(plane_of(&corners)).for_each(|(to, x)| to[count] = x);
            count += 1;
        }
        for (index, (shape, id)) in (0..).zip(&wide.analytic).filter(|(_, (shape, _))| !shape.is_empty()) {
            let AnalyticShape::Sphere(sphere) = shape;
            let in_f32 = SphereInF32::new(sphere);
            if count == MAX_PRIMITIVES || !in_f32.is_supported() {
                return None;
            }
            few.spheres.push(in_f32);
            few.reach = few.reach.max(sphere.centre.abs().max_element() + sphere.radius);
            (few.slots[count], few.prims[count]) = (wide.slot_of_analytic(index).index(), id.0);
            few.centres.iter_mut().zip(sphere.centre.to_array()).for_each(|(to, x)| to[count] = x);
            few.radii[count] = sphere.radius;
            count += 1;
        }
        // Origins of secondary rays lie on surfaces, up to 2^-23 of their coordinates.
        few.reach *= 1.0 + 1.0 / f64::from(1 << 20);
        few.errors = few.errors_within(few.reach);
        Some(few)
    }

    fn len(&self) -> usize {
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
    fn errors<'a, D: Doubles>(&'a self, rays: Rays, of_rays: &'a mut [Errors; TABLE]) -> &'a [Errors; TABLE] {
        let reach = reach_of_origins::<D>(rays);
        if reach <= self.reach {
            return &self.errors;
        }
        *of_rays = self.errors_within(reach);
        of_rays
    }

    /// Calls `visit` with the index and the estimate of each primitive that a ray may hit.
    #[inline(always)]
    fn each<F: Floats>(
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

    /// Of some lanes, those whose index is that of a sphere.
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

    /// Of some lanes, those without the rays that certainly miss the primitive of their index because it lies behind them.
    #[inline(always)]
    fn ahead<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> u32 {
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
    fn hit<D: Doubles>(&self, rays: &RayN<D>, indices: &[u32; MAX_LANES], lanes: u32) -> HitN<D> {
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

/// The primitives that are left open for each ray of a group.
struct Open<F> {
    /// Indices as the bits of f32 numbers: selected as numbers are.
    indices: [F; OPEN],
    /// The rays that have at least one, two and so on.
    has: [u32; OPEN],
    /// The rays that have too many.
    overflown: u32,
}

impl<F: Floats> Open<F> {
    #[inline(always)]
    fn new() -> Self {
        Open { indices: [index_bits(0); OPEN], has: [0; OPEN], overflown: 0 }
    }

    #[inline(always)]
    fn add(&mut self, mut rays: u32, index: u32) {
        for (indices, has) in self.indices.iter_mut().zip(&mut self.has) {
            let first = rays & !*has;
            *indices = F::select(first, index_bits(index), *indices);
            rays &= *has;
            *has |= first;
        }
        self.overflown |= rays;
    }
}

/// An index as the bits of f32 numbers.
#[inline(always)]
fn index_bits<F: Floats>(index: u32) -> F {
    F::splat(f32::from_bits(index))
}

/// A part of a group of rays: as many as [`Simd::D`] has lanes.
struct Part {
    /// The place of its first ray in the group.
    start: usize,
    /// Its rays.
    count: usize,
}

impl Part {
    /// The parts of a group of `count` rays.
    #[inline(always)]
    fn each<S: Simd>(count: usize, mut visit: impl FnMut(Part)) {
        for start in (0..count.min(S::F::LANES)).step_by(S::D::LANES) {
            visit(Part { start, count: (count - start).min(S::D::LANES) });
        }
    }

    /// The mask of its rays out of that of a group.
    #[inline(always)]
    fn of(&self, group: u32) -> u32 {
        group >> self.start & u32::MAX >> (u32::BITS as usize - self.count)
    }

    /// The indices of its rays.
    #[inline(always)]
    fn indices<S: Simd>(&self, of_group: &<S::F as Vector>::Array) -> [u32; MAX_LANES] {
        let mut indices = [0; MAX_LANES];
        for (to, x) in indices.iter_mut().zip(&of_group.as_ref()[self.start..self.start + S::D::LANES]) {
            *to = x.to_bits();
        }
        indices
    }
}

/// Appends the closest hits of the rays.
#[inline(always)]
pub(crate) fn closest<T: Tier, S: Simd>(
    wide: &Wide<T>,
    few: &FewPrimitives,
    rays: Rays,
    hits: &mut HitBuffer,
    traversal: &mut Traversal,
) {
    traversal.tests.primitives += (rays.len() * few.len()) as u64;
    S::run(
        #[inline(always)]
        || {
            let mut of_rays = [Errors::NONE; TABLE];
            let errors = few.errors::<S::D>(rays, &mut of_rays);
            hits.reserve(rays.len());
            for first in (0..rays.len()).step_by(S::F::LANES) {
                closest_of_group::<T, S>((wide, few, errors), rays, first, hits, traversal);
            }
        },
    );
}

#[inline(always)]
fn closest_of_group<T: Tier, S: Simd>(
    (wide, few, errors): (&Wide<T>, &FewPrimitives, &[Errors; TABLE]),
    rays: Rays,
    first: usize,
    hits: &mut HitBuffer,
    traversal: &mut Traversal,
) {
    let group = RaysInF32::<S::F>::new::<S::D>(rays, first);
    let mut open = Open::<S::F>::new();
    let (mut near, mut far, mut best) = (group.t_max, group.t_max, index_bits::<S::F>(NONE));
    few.each(
        errors,
        &group,
        #[inline(always)]
        |index, estimate| {
            let farther = estimate.certain & far.le(estimate.near);
            let nearer = estimate.certain & estimate.far.lt(near);
            near = S::F::select(nearer, estimate.near, near);
            far = S::F::select(nearer, estimate.far, far);
            best = S::F::select(nearer, index_bits(index), best);
            open.add(estimate.possible & !(farther | nearer), index);
        },
    );
    let best = best.array();
    let indices = [open.indices[0].array(), open.indices[1].array()];
    Part::each::<S>(
        rays.len() - first,
        #[inline(always)]
        |part| {
            let lanes = rays.lanes::<S::D>(first + part.start);
            let mut found = part.indices::<S>(&best);
            let mut has_best = 0;
            for (lane, &index) in found.iter().enumerate().take(part.count) {
                has_best |= u32::from(index != NONE) << lane;
            }
            let mut unsure = part.of(open.overflown | !group.supported);
            let mut nearest = few.hit(&lanes, &found, has_best);
            // What f32 certainly hit, the tier must hit, too.
            unsure |= has_best & !nearest.hit;
            for (indices, has) in indices.iter().zip(open.has) {
                let indices = part.indices::<S>(indices);
                let is_open = few.ahead(&lanes, &indices, part.of(has) & !unsure);
                if is_open == 0 {
                    continue;
                }
                let other = few.hit(&lanes, &indices, is_open);
                let (t, of_other) = (S::D::load(nearest.t), S::D::load(other.t));
                // The order of equal distances is left to the tier.
                unsure |= other.undecided | nearest.hit & other.hit & t.le(of_other) & of_other.le(t);
                let is_nearer = other.hit & (!nearest.hit | of_other.lt(t));
                nearest.hit |= is_nearer;
                nearest.select(is_nearer, &other);
                for (lane, (to, index)) in found.iter_mut().zip(indices).enumerate() {
                    *to = if is_nearer >> lane & 1 != 0 { index } else { *to };
                }
            }
            let (mut prims, mut slots) = ([NO_PRIMITIVE; MAX_LANES], [0; MAX_LANES]);
            for (lane, &index) in found.iter().enumerate().take(S::D::LANES) {
                let index = if nearest.hit >> lane & 1 != 0 { index } else { NONE } as usize % (TABLE + 1);
                (prims[lane], slots[lane]) = (few.prims[index], few.slots[index]);
            }
            let before = hits.len();
            hits.append(part.count, &prims, &slots, &nearest);
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                let hit = wide.closest_hit(&rays.get(first + part.start + lane), traversal);
                hits.set(before + lane, hit.as_ref());
            }
        },
    );
}

/// Appends whether each ray hits anything.
#[inline(always)]
pub(crate) fn occluded<T: Tier, S: Simd>(
    wide: &Wide<T>,
    few: &FewPrimitives,
    rays: Rays,
    occluded: &mut Vec<bool>,
    traversal: &mut Traversal,
) {
    traversal.tests.primitives += (rays.len() * few.len()) as u64;
    S::run(
        #[inline(always)]
        || {
            let mut of_rays = [Errors::NONE; TABLE];
            let errors = few.errors::<S::D>(rays, &mut of_rays);
            for first in (0..rays.len()).step_by(S::F::LANES) {
                let hit = occluded_of_group::<T, S>((wide, few, errors), rays, first, traversal);
                let count = S::F::LANES.min(rays.len() - first);
                occluded.extend((0..count).map(|lane| hit >> lane & 1 != 0));
            }
        },
    );
}

/// The rays of a group that hit anything.
#[inline(always)]
fn occluded_of_group<T: Tier, S: Simd>(
    (wide, few, errors): (&Wide<T>, &FewPrimitives, &[Errors; TABLE]),
    rays: Rays,
    first: usize,
    traversal: &mut Traversal,
) -> u32 {
    let group = RaysInF32::<S::F>::new::<S::D>(rays, first);
    let mut open = Open::<S::F>::new();
    let mut certain = 0;
    few.each(
        errors,
        &group,
        #[inline(always)]
        |index, estimate| {
            let beyond = estimate.certain & group.t_max.le(estimate.near);
            let hit = estimate.certain & estimate.far.lt(group.t_max);
            certain |= hit;
            open.add(estimate.possible & !(beyond | hit), index);
        },
    );
    certain &= group.supported;
    let indices = [open.indices[0].array(), open.indices[1].array()];
    let mut all = 0;
    Part::each::<S>(
        rays.len() - first,
        #[inline(always)]
        |part| {
            let lanes = rays.lanes::<S::D>(first + part.start);
            let mut hit = part.of(certain);
            let mut unsure = part.of(open.overflown | !group.supported) & !hit;
            let indices = [part.indices::<S>(&indices[0]), part.indices::<S>(&indices[1])];
            let decided = hit | unsure;
            let is_open = [
                few.ahead(&lanes, &indices[0], part.of(open.has[0]) & !decided),
                few.ahead(&lanes, &indices[1], part.of(open.has[1]) & !decided),
            ];
            // Most rays have one left: all of these are tested together.
            let [mut first_open, second_open] = indices;
            for (lane, to) in first_open.iter_mut().enumerate() {
                *to = if is_open[0] >> lane & 1 != 0 { *to } else { second_open[lane] };
            }
            let found = few.hit(&lanes, &first_open, is_open[0] | is_open[1]);
            hit |= found.hit;
            unsure |= found.undecided;
            let found = few.hit(&lanes, &second_open, is_open[0] & is_open[1] & !hit);
            hit |= found.hit;
            unsure = (unsure | found.undecided) & !hit;
            while unsure != 0 {
                let lane = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                let ray = rays.get(first + part.start + lane);
                hit |= u32::from(wide.is_occluded(&ray, traversal)) << lane;
            }
            all |= hit << part.start;
        },
    );
    all
}
