//! [`Bvh`]: the acceleration structure for library users, over their own triangles and analytic shapes.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::threads::*;
use glam::DVec3;

use super::generalised::Expansions;
use super::open_edges::Unbalanced;
use super::placed_meshes::InstanceTable;
use super::stored_slot::MeshSlots;
use super::{
    Accelerator, Closedness, Layout, Preset, Primitive, RayList, Slot, Source, Traversal, build, build_from,
};
use crate::geometry::{
    AnalyticShape, Bounds, Corner, Hit, HitBuffer, Numerics, Point, Precision, PrimId, Ray, Rays, SlotId,
    Sphere, Triangle,
};

/// A bounding volume hierarchy over triangles and analytic shapes. A primitive's id is its index in the list that it
/// was built from. The [crate documentation](crate) has an example.
#[derive(Clone)]
pub struct Bvh {
    /// Shared by clones.
    pub(super) accelerator: Arc<dyn Accelerator>,
    pub(super) layout: Layout,
    pub(super) numerics: Numerics,
    /// Whether each primitive has a rounded form ([`Primitive::rounded`]), and so a slot.
    pub(super) has_slot: Vec<bool>,
    pub(super) instances: InstanceTable,
    /// The ids at which triangles begin or end to be seen clockwise from the front.
    pub(super) clockwise: Vec<u32>,
    pub(super) closedness: OnceLock<Closedness>,
    /// Of instances.
    pub(super) unbalanced: OnceLock<Unbalanced>,
    pub(super) expansions: OnceLock<Arc<Expansions>>,
}

/// The result of [`Bvh::update`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Update {
    /// The tree was refitted. Its cost by the surface area heuristic, relative to that at build.
    Refitted(f64),
    /// A new tree was built.
    Rebuilt,
}

/// A number that is not finite or exceeds f32: bounds are f32 in every tier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NotFinite {
    /// In a primitive.
    Primitive(usize),
    /// In the origin of a ray.
    Origin,
    /// In the direction of a ray, or it is zero.
    Direction,
    /// The maximum distance of a ray is NaN or not above 0, or not above its minimum distance.
    Distance,
    /// The minimum distance of a ray is NaN or negative.
    MinDistance,
    /// The bounds of the user geometry with this index ([`Bvh::set_user_geometry`]); also if they are inverted.
    Bounds(usize),
    /// The user geometry with this index has no id or slot: 32 bits number those of all primitives.
    Id(usize),
}

impl std::fmt::Display for NotFinite {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            NotFinite::Primitive(index) => write!(
                f,
                "primitive {index} has a coordinate or a radius that is not finite, or too large for f32"
            ),
            NotFinite::Bounds(index) => {
                write!(
                    f,
                    "the bounds of user geometry {index} are not finite, too large for f32, or inverted"
                )
            }
            NotFinite::Id(index) => write!(f, "there is no id for user geometry {index}: 32 bits number all"),
            NotFinite::Origin => f.write_str("the origin of a ray is not finite, or too large for f32"),
            NotFinite::Direction => f.write_str("the direction of a ray is not finite, or zero"),
            NotFinite::Distance => {
                f.write_str("the maximum distance of a ray is not above 0 or its minimum distance")
            }
            NotFinite::MinDistance => f.write_str("the minimum distance of a ray is NaN or negative"),
        }
    }
}

impl std::error::Error for NotFinite {}

/// Why [`Bvh::rays`] does not make a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InvalidRays {
    /// The first ray that is not valid.
    Ray {
        /// Its index.
        index: usize,
        /// What is wrong with it.
        why: NotFinite,
    },
    /// There are not as many directions as origins.
    Directions {
        /// The number of directions.
        directions: usize,
        /// The number of origins.
        origins: usize,
    },
    /// There are neither as many `t_max` as origins, nor one for all.
    Distances {
        /// The number of `t_max`.
        distances: usize,
        /// The number of origins.
        origins: usize,
    },
}

impl std::fmt::Display for InvalidRays {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            InvalidRays::Ray { index, why } => write!(f, "ray {index}: {why}"),
            InvalidRays::Directions { directions, origins } => {
                write!(f, "{directions} directions, expected one for each of {origins} origins")
            }
            InvalidRays::Distances { distances, origins } => {
                write!(f, "{distances} maximum distances, expected one, or one for each of {origins} origins")
            }
        }
    }
}

impl std::error::Error for InvalidRays {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            InvalidRays::Ray { why, .. } => Some(why),
            InvalidRays::Directions { .. } | InvalidRays::Distances { .. } => None,
        }
    }
}

/// Why a mesh is not part of a structure ([`Bvh::from_mesh`], [`Bvh::from_instances`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InvalidMesh {
    /// The first triangle with a vertex that is not finite, or too large for f32.
    NotFinite(NotFinite),
    /// The first triangle with a vertex that does not exist.
    Index {
        /// The index of the triangle.
        triangle: usize,
        /// The index of the vertex.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// There are more triangles than ids.
    TooManyTriangles,
}

impl std::fmt::Display for InvalidMesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            InvalidMesh::NotFinite(why) => why.fmt(f),
            InvalidMesh::Index { triangle, vertex, vertices } => {
                write!(f, "triangle {triangle} has the vertex {vertex}, and there are {vertices} vertices")
            }
            InvalidMesh::TooManyTriangles => f.write_str("there are more triangles than 32 bits can number"),
        }
    }
}

impl std::error::Error for InvalidMesh {}

impl From<NotFinite> for InvalidMesh {
    fn from(why: NotFinite) -> Self {
        InvalidMesh::NotFinite(why)
    }
}

/// The cost relative to that at build above which a refitted tree is rebuilt. Measurements: docs/decisions.md.
const MAX_RELATIVE_COST: f64 = 1.2;

/// Whether to keep a refitted tree with this cost relative to that at build, as returned by [`Accelerator::refit`].
fn is_worth_keeping(relative_cost: f64) -> bool {
    relative_cost <= MAX_RELATIVE_COST
}

impl Bvh {
    /// Builds with the default preset and tier: watertight, no ray passes between triangles that share an edge.
    ///
    /// # Errors
    /// [`NotFinite`] for coordinates and radii that are not finite in f32.
    pub fn new(primitives: impl IntoIterator<Item = Primitive>) -> Result<Self, NotFinite> {
        Bvh::with(primitives, Preset::default(), Numerics::default())
    }

    /// Builds with a preset and a tier.
    ///
    /// # Errors
    /// [`NotFinite`] for coordinates and radii that are not finite in f32.
    pub fn with(
        primitives: impl IntoIterator<Item = Primitive>,
        preset: Preset,
        numerics: Numerics,
    ) -> Result<Self, NotFinite> {
        Ok(Bvh::over(&checked(primitives)?, Layout::Wide(preset), numerics))
    }

    /// Builds over triangles that share vertices, with the default preset and tier. A triangle's id is its index.
    ///
    /// # Errors
    /// [`InvalidMesh`] for the first triangle whose vertices do not exist or are not finite in f32.
    pub fn from_mesh(vertices: &[impl Point], triangles: &[[u32; 3]]) -> Result<Self, InvalidMesh> {
        Bvh::from_mesh_with(vertices, triangles, Preset::default(), Numerics::default())
    }

    /// [`Bvh::from_mesh`] with a preset and a tier.
    ///
    /// # Errors
    /// As [`Bvh::from_mesh`].
    pub fn from_mesh_with(
        vertices: &[impl Point],
        triangles: &[[u32; 3]],
        preset: Preset,
        numerics: Numerics,
    ) -> Result<Self, InvalidMesh> {
        let vertex = |index: u32| vertices[index as usize].to_dvec3();
        check_mesh(triangles, vertices.len(), &vertex)?;
        let layout = Layout::Wide(preset);
        let slots = MeshSlots { triangles, vertex: &vertex };
        Ok(Bvh::around(
            build_from(Source::Mesh(slots), layout, numerics),
            vec![true; triangles.len()],
            layout,
        ))
    }

    fn around(accelerator: Box<dyn Accelerator>, has_slot: Vec<bool>, layout: Layout) -> Self {
        let numerics = accelerator.numerics();
        Bvh {
            accelerator: accelerator.into(),
            layout,
            numerics,
            has_slot,
            instances: InstanceTable::default(),
            clockwise: Vec::new(),
            closedness: OnceLock::new(),
            unbalanced: OnceLock::new(),
            expansions: OnceLock::new(),
        }
    }

    pub(super) fn over(primitives: &[Primitive], layout: Layout, numerics: Numerics) -> Self {
        let rounded = || primitives.iter().map(|p| p.rounded(numerics.precision()));
        let slots = (0..).zip(rounded()).filter_map(|(id, p)| Some(Slot { primitive: p?, id: PrimId(id) }));
        let has_slot = rounded().map(|p| p.is_some()).collect();
        Bvh::around(build(slots, layout, numerics), has_slot, layout)
    }

    /// A ray from `origin`, rounded to the precision of the tier. `direction` of any length but 0 is normalised, so t
    /// is a distance. That rounds: the tier `exact` decides for the normalised direction, not for the line through the
    /// given numbers ([`Ray::unchecked`] takes a direction as it is, with t in units of its length).
    ///
    /// # Errors
    /// [`NotFinite::Origin`], also if it exceeds f32, and [`NotFinite::Direction`].
    pub fn ray(&self, origin: impl Point, direction: impl Point) -> Result<Ray, NotFinite> {
        self.ray_within(origin, direction, f64::INFINITY)
    }

    /// [`Bvh::ray`] with a maximum distance: hits have 0 < t < `t_max`, open at both ends. A shadow ray to a light has
    /// the distance of the light as `t_max`.
    ///
    /// # Errors
    /// As [`Bvh::ray`], and [`NotFinite::Distance`]. `t_max` may be infinite.
    pub fn ray_within(
        &self,
        origin: impl Point,
        direction: impl Point,
        t_max: f64,
    ) -> Result<Ray, NotFinite> {
        let (origin, direction) = (origin.to_dvec3(), direction.to_dvec3());
        check_ray(origin, direction, t_max)?;
        Ok(ray_of(self.numerics.ray_precision(), origin, direction, t_max))
    }

    /// [`Bvh::ray_within`] of each origin with the direction at the same index; with `t_max` of one number for all
    /// rays, or one for each, or `None` for infinity.
    ///
    /// # Errors
    /// [`InvalidRays`]: arrays of other lengths, or the first ray that is not valid, and why.
    pub fn rays<'a, P: Point>(
        &self,
        origins: &'a [P],
        directions: &'a [P],
        t_max: Option<&'a [f64]>,
    ) -> Result<RayArrays<'a, P>, InvalidRays> {
        let len = origins.len();
        if directions.len() != len {
            return Err(InvalidRays::Directions { directions: directions.len(), origins: len });
        }
        if let Some(t_max) = t_max.filter(|t_max| ![1, len].contains(&t_max.len())) {
            return Err(InvalidRays::Distances { distances: t_max.len(), origins: len });
        }
        let rays =
            RayArrays { origins, directions, t_max, precision: self.numerics.ray_precision(), width: None };
        let check = |index: usize| {
            check_ray(origins[index].to_dvec3(), directions[index].to_dvec3(), rays.t_max(index))
                .err()
                .map(|why| InvalidRays::Ray { index, why })
        };
        (0..len).into_par_iter().with_min_len(1 << 12).find_map_first(check).map_or(Ok(rays), Err)
    }

    /// The closest hit; of hits at equal t, the one with the lowest id.
    pub fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        self.accelerator.closest_hit(ray, traversal)
    }

    /// The closest of the hits that `accepts` returns `true` for, and [`Bvh::closest_hit`] if it always does. It is
    /// called with some of the hits, in no order.
    pub fn closest_hit_by(
        &self,
        ray: &Ray,
        mut accepts: impl FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit> {
        self.accelerator.closest_hit_by(ray, &mut accepts, traversal)
    }

    /// Whether the ray hits anything between `t_min` and `t_max`.
    pub fn occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.accelerator.is_occluded(ray, traversal)
    }

    /// Whether the ray hits, between `t_min` and `t_max`, a primitive that `accepts` returns `true` for. It is called
    /// with hit primitives only, in no order.
    pub fn occluded_by(
        &self,
        ray: &Ray,
        mut accepts: impl FnMut(PrimId) -> bool,
        traversal: &mut Traversal,
    ) -> bool {
        self.accelerator.is_occluded_by(ray, &mut accepts, traversal)
    }

    /// Every primitive that the ray hits between `t_min` and `t_max`, sorted by t, those at equal t by id.
    ///
    /// - A primitive has one hit: of a sphere the nearer of two. A ray with `t_min` beyond that hit ([`Ray::between`])
    ///   finds the other.
    /// - On a shared edge or corner, every triangle that has it is hit. Their t are equal up to rounding, and no hit is
    ///   merged. Hits are not crossings: those are counted by [`Bvh::crossings`].
    /// - Primitives at the same place are all hit, at equal t.
    ///
    /// The first hit is [`Bvh::closest_hit`]. In the tier `exact` only up to rounding: it decides which hit is closest
    /// by exact distances, of which t is the rounded value.
    pub fn all_hits(&self, ray: &Ray, traversal: &mut Traversal) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.accelerator.all_hits(ray, &mut hits, traversal);
        hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.prim.cmp(&b.prim)));
        hits
    }

    /// The geometric normal at a hit of the ray, of length 1: for a triangle `(b - a) x (c - a)` normalised, or its
    /// opposite ([`Bvh::set_clockwise`]), for a sphere outwards. It is not turned towards the ray: the front was hit if
    /// its dot product with the ray's direction is negative. It is that of the primitive as stored, with corners
    /// rounded to the precision of the tier.
    ///
    /// `None` for a triangle without area, or too thin for its corners ([`Triangle::unit_normal`]).
    ///
    /// `hit` must come from this structure, after its last [`Bvh::update`]; slots change when it is rebuilt.
    pub fn geometric_normal(&self, ray: &Ray, hit: &Hit) -> Option<DVec3> {
        self.geometric_normal_at(hit.prim, hit.slot, ray.at(hit.t))
    }

    /// [`Bvh::geometric_normal`] of a primitive in its slot ([`Hit::slot`]), at the point of a hit.
    pub fn geometric_normal_at(&self, prim: PrimId, slot: SlotId, point: DVec3) -> Option<DVec3> {
        if let Some(shape) = self.own_shapes().and_then(|shapes| shapes.in_slot(slot)) {
            return shape.normal(point);
        }
        match self.oriented(prim, self.accelerator.primitive(slot)) {
            Primitive::Triangle(triangle) => triangle.unit_normal(),
            Primitive::Analytic(shape) => Some(shape.surface(point).1),
        }
    }

    /// The closest hit of every ray. Fastest for batches of 64 and more rays with a common origin, end or direction.
    pub fn closest_hits(&self, rays: Rays, traversal: &mut Traversal) -> HitBuffer {
        let mut hits = HitBuffer::default();
        self.accelerator.closest_hits(rays, &mut hits, traversal);
        hits
    }

    /// Whether each ray hits anything.
    pub fn are_occluded(&self, rays: Rays, traversal: &mut Traversal) -> Vec<bool> {
        let mut occluded = Vec::with_capacity(rays.len());
        self.accelerator.are_occluded(rays, &mut occluded, traversal);
        occluded
    }

    /// Replaces the primitives. The tree is refitted if their number and kinds are the same and it stays good enough
    /// (at most 1.2 times the cost at build), else rebuilt. On an error nothing changes. Clones share a tree, of which a copy is
    /// refitted. User geometry ([`Bvh::set_user_geometry`]) stays, as does [`Bvh::set_clockwise`] but of instances.
    ///
    /// # Errors
    /// [`NotFinite`], as for [`Bvh::new`].
    pub fn update(&mut self, primitives: impl IntoIterator<Item = Primitive>) -> Result<Update, NotFinite> {
        let now = checked(primitives)?;
        if let Some(relative_cost) = self.refit(now.len(), &|id| now[id.0 as usize]) {
            return Ok(Update::Refitted(relative_cost));
        }
        self.replace(Bvh::over(&now, self.layout, self.numerics))
    }

    /// [`Bvh::update`] by the triangles of vertices, as in [`Bvh::from_mesh`]; without a copy of them.
    ///
    /// # Errors
    /// As [`Bvh::from_mesh`].
    pub fn update_mesh(
        &mut self,
        vertices: &[impl Point],
        triangles: &[[u32; 3]],
    ) -> Result<Update, InvalidMesh> {
        let vertex = |index: u32| vertices[index as usize].to_dvec3();
        check_mesh(triangles, vertices.len(), &vertex)?;
        let now = |id: PrimId| Primitive::from(triangles[id.0 as usize].map(vertex));
        if let Some(relative_cost) = self.refit(triangles.len(), &now) {
            return Ok(Update::Refitted(relative_cost));
        }
        let preset = self.layout.preset().expect("a `Bvh` has a tree");
        Ok(self.replace(Bvh::from_mesh_with(vertices, triangles, preset, self.numerics)?)?)
    }

    /// Refits the tree to `count` primitives, given by id, which are finite. `None` if it must be built anew.
    fn refit(&mut self, count: usize, now: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        // A primitive without a slot cannot be refitted.
        let is_empty = |id| now(PrimId(id)).rounded(self.numerics.precision()).is_none();
        let is_same = self.instances.ids().is_none()
            && self.has_slot.len() == count
            && (0..).zip(&self.has_slot).all(|(id, has_slot)| *has_slot || is_empty(id));
        if !is_same {
            return None;
        }
        if Arc::get_mut(&mut self.accelerator).is_none()
            && let Some(copy) = self.accelerator.copy_to_refit()
        {
            self.accelerator = copy;
        }
        let relative_cost = Arc::get_mut(&mut self.accelerator)?.refit(now)?;
        self.forget_surface();
        is_worth_keeping(relative_cost).then_some(relative_cost)
    }

    /// Takes over a structure that was built anew, with the user geometry of this one.
    fn replace(&mut self, mut rebuilt: Bvh) -> Result<Update, NotFinite> {
        if self.instances.ids().is_none() {
            rebuilt.clockwise.clone_from(&self.clockwise);
        }
        rebuilt.set_user_geometry(self.user_geometries().cloned())?;
        *self = rebuilt;
        Ok(Update::Rebuilt)
    }

    /// Frees what generalised winding numbers are computed from; their next query builds it again.
    #[doc(hidden)]
    pub fn forget_expansions(&mut self) {
        self.expansions = OnceLock::new();
    }

    /// Which triangles are seen clockwise from the front, as those of a mesh under a mirroring transform (glTF 2.0,
    /// section 3.7.4): of consecutive parts of the primitives the number, and whether they are. They are turned over in
    /// normals, sides of crossings, winding numbers and closedness; barycentrics remain those of the corners as given.
    /// [`Bvh::from_instances`] does so by itself.
    pub fn set_clockwise(&mut self, parts: impl IntoIterator<Item = (usize, bool)>) {
        let mut end = 0u32;
        let ends = parts.into_iter().map(|(count, is_clockwise)| {
            let first = end;
            end = u32::try_from(count).map_or(u32::MAX, |count| first.saturating_add(count));
            is_clockwise.then_some([first, end])
        });
        self.clockwise = ends.flatten().flatten().collect();
        self.instances.forget_parts();
        self.forget_surface();
    }

    /// A primitive as stored, with the corners of a triangle counterclockwise seen from the front.
    #[inline]
    pub(super) fn oriented(&self, prim: PrimId, primitive: Primitive) -> Primitive {
        let is_clockwise = || self.clockwise.partition_point(|&id| id <= prim.0) % 2 == 1;
        match primitive {
            Primitive::Triangle(Triangle([a, b, c])) if is_clockwise() => Primitive::from([a, c, b]),
            other => other,
        }
    }

    /// Calls `visit` with every primitive, [`Bvh::oriented`]; with a split triangle several times.
    pub(super) fn each_oriented(&self, mut visit: impl FnMut(PrimId, Primitive)) {
        self.accelerator.each_primitive(&mut |prim, primitive| visit(prim, self.oriented(prim, primitive)));
    }

    /// To be called where the surface changes.
    pub(super) fn forget_surface(&mut self) {
        self.closedness = OnceLock::new();
        self.unbalanced = OnceLock::new();
        self.expansions = OnceLock::new();
    }

    /// The number of ids of primitives, without user geometry.
    pub(super) fn ids(&self) -> u32 {
        self.instances.ids().unwrap_or(self.has_slot.len() as u32)
    }

    /// The number of ids: of primitives and user geometry.
    pub fn len(&self) -> usize {
        self.ids() as usize + self.user_geometries().count()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The tier.
    pub fn numerics(&self) -> Numerics {
        self.numerics
    }

    /// The least and the greatest corner of the box around all primitives, as stored, and the bounds of user geometry;
    /// `None` without any. Visits every primitive.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let mut all: Option<[DVec3; 2]> = None;
        let mut add = |[min, max]: [DVec3; 2]| {
            let [least, most] = all.unwrap_or([min, max]);
            all = Some([least.min(min), most.max(max)]);
        };
        self.accelerator.each_primitive(&mut |_, primitive| match primitive {
            Primitive::Triangle(Triangle(corners)) => add(DVec3::span(&corners)),
            Primitive::Analytic(shape) => {
                let Bounds { min, max } = shape.bounds();
                add([min, max].map(|corner| corner.as_dvec3()));
            }
        });
        self.user_geometries().for_each(|shape| add(shape.bounds()));
        all
    }

    /// The number of analytic shapes that cannot be hit because their radius is not above 0.
    pub fn left_out(&self) -> usize {
        self.has_slot.iter().filter(|has_slot| !**has_slot).count()
    }

    /// The underlying acceleration structure.
    pub fn accelerator(&self) -> &dyn Accelerator {
        &*self.accelerator
    }
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut all = f.debug_struct("Bvh");
        all.field("layout", &self.layout).field("numerics", &self.numerics);
        all.field("size", &self.accelerator.describe()).finish_non_exhaustive()
    }
}

/// Rays from arrays of origins and directions, checked by [`Bvh::rays`], of any length but 0.
#[derive(Debug, Clone, Copy)]
pub struct RayArrays<'a, P = [f64; 3]> {
    origins: &'a [P],
    directions: &'a [P],
    t_max: Option<&'a [f64]>,
    precision: Precision,
    width: Option<usize>,
}

impl<P: Copy> RayArrays<'_, P> {
    /// The same rays as those of a picture, row by row, of which `width` are in a row. They are traced in tiles, which
    /// is faster. Slices of these rays begin with a row.
    pub fn in_rows(&self, width: usize) -> Self {
        RayArrays { width: (1..=1 << 12).contains(&width).then_some(width), ..*self }
    }

    /// The rays at a range of indices.
    ///
    /// # Panics
    /// If there are not as many rays.
    pub fn slice(&self, range: Range<usize>) -> Self {
        let t_max = self.t_max.map(|t_max| if t_max.len() == 1 { t_max } else { &t_max[range.clone()] });
        let (origins, directions) = (&self.origins[range.clone()], &self.directions[range]);
        RayArrays { origins, directions, t_max, ..*self }
    }

    fn t_max(&self, index: usize) -> f64 {
        match self.t_max {
            None => f64::INFINITY,
            Some(&[one]) => one,
            Some(each) => each[index],
        }
    }
}

impl<P: Point> RayList for RayArrays<'_, P> {
    fn len(&self) -> usize {
        self.origins.len()
    }

    #[inline]
    fn get(&self, index: usize) -> Ray {
        let (origin, direction) = (self.origins[index].to_dvec3(), self.directions[index].to_dvec3());
        ray_of(self.precision, origin, direction, self.t_max(index))
    }

    #[inline]
    fn sort_key(&self, index: usize) -> [DVec3; 2] {
        let direction = self.directions[index].to_dvec3();
        [self.origins[index].to_dvec3(), direction * direction.abs().max_element().recip()]
    }

    fn width(&self) -> Option<usize> {
        self.width
    }
}

impl Ray {
    /// The same ray with other ends: hits have `t_min` < t < `t_max`, which may be infinite.
    ///
    /// # Errors
    /// [`NotFinite::MinDistance`] and [`NotFinite::Distance`].
    pub fn between(&self, t_min: f64, t_max: f64) -> Result<Ray, NotFinite> {
        check_ends(t_min, t_max)?;
        Ok(Ray { t_min, t_max, ..*self })
    }
}

fn check_ends(t_min: f64, t_max: f64) -> Result<(), NotFinite> {
    if t_min.is_nan() || t_min < 0.0 {
        return Err(NotFinite::MinDistance);
    }
    if t_max.is_nan() || t_max <= t_min {
        return Err(NotFinite::Distance);
    }
    Ok(())
}

/// # Errors
/// As those of [`Bvh::ray_within`].
fn check_ray(origin: DVec3, direction: DVec3, t_max: f64) -> Result<(), NotFinite> {
    if !origin.as_vec3().is_finite() {
        return Err(NotFinite::Origin);
    }
    if !direction.is_finite() || direction == DVec3::ZERO {
        return Err(NotFinite::Direction);
    }
    check_ends(0.0, t_max)
}

#[inline]
fn ray_of(precision: Precision, origin: DVec3, direction: DVec3, t_max: f64) -> Ray {
    // Divided first: the square of the length could overflow or underflow.
    let direction = (direction / direction.abs().max_element()).normalize();
    precision.ray(origin, direction, 0.0, t_max)
}

/// Whether the numbers of a primitive and its bounds, which are f32 in every tier, are finite.
fn is_finite(primitive: &Primitive) -> bool {
    let is_finite = match primitive {
        Primitive::Triangle(Triangle(corners)) => corners.iter().all(|corner| corner.is_finite()),
        // Its bounds are not finite if its numbers are not.
        Primitive::Analytic(_) => true,
    };
    let b = primitive.bounds();
    is_finite && b.min.is_finite() && b.max.is_finite()
}

/// # Errors
/// The first triangle with a vertex that does not exist or is not finite.
fn check_mesh(
    triangles: &[[u32; 3]],
    vertices: usize,
    vertex: &dyn Fn(u32) -> DVec3,
) -> Result<(), InvalidMesh> {
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|index| **index as usize >= vertices) {
            return Err(InvalidMesh::Index { triangle, vertex, vertices });
        }
        if !is_finite(&Primitive::from(corners.map(vertex))) {
            return Err(NotFinite::Primitive(triangle).into());
        }
    }
    Ok(())
}

/// The primitives, if all are finite.
fn checked(primitives: impl IntoIterator<Item = Primitive>) -> Result<Vec<Primitive>, NotFinite> {
    let check = |(index, primitive): (usize, Primitive)| match is_finite(&primitive) {
        true => Ok(primitive),
        false => Err(NotFinite::Primitive(index)),
    };
    primitives.into_iter().enumerate().map(check).collect()
}

/// A triangle of three corners.
impl From<[[f64; 3]; 3]> for Primitive {
    fn from(corners: [[f64; 3]; 3]) -> Self {
        Primitive::Triangle(Triangle(corners.map(DVec3::from)))
    }
}

/// A triangle of three corners.
impl From<[DVec3; 3]> for Primitive {
    fn from(corners: [DVec3; 3]) -> Self {
        Primitive::Triangle(Triangle(corners))
    }
}

/// A sphere of a centre and radius.
impl From<([f64; 3], f64)> for Primitive {
    fn from((centre, radius): ([f64; 3], f64)) -> Self {
        Sphere { centre: centre.into(), radius }.into()
    }
}

/// A shape that is not a triangle.
impl<S: Into<AnalyticShape>> From<S> for Primitive {
    fn from(shape: S) -> Self {
        Primitive::Analytic(shape.into())
    }
}
