//! Acceleration structures over triangles and analytic shapes, behind [`Accelerator`].
//!
//! [`build`] makes one in any [`Layout`] and tier of numerics. obvhs builds the trees (`build`); the traversals are
//! kiln's: `wide` over nodes of eight children, `instances` over meshes that are placed many times ([`Instance`]), and
//! `brute_force`, the oracle of the tests. [`Bvh`] is the interface for library users.
//!
//! Every layout returns exactly the hits of [`Layout::BruteForce`]: the least t, ties to the lowest primitive id. The
//! tier `fast` is exempt ([`Numerics::Fast`]).
//! obvhs's own traversal does not: its boxes are tested without margin, tiny direction components are clamped, ties
//! depend on the layout, and its triangle test loses rays on edges seen from behind.

mod api;
mod batch;
mod brute_force;
mod build;
mod closest_point;
mod coarse_rounding;
mod crossings;
mod generalised;
mod instances;
mod layered;
mod lists;
mod nearby;
mod open_edges;
mod placed_meshes;
mod preset;
mod quality;
mod sah;
mod saved;
mod shapes;
pub(crate) mod splitmix64;
mod stored_slot;
mod wide;

pub use api::{Bvh, InvalidMesh, InvalidRays, NotFinite, RayArrays, Update};
pub use batch::RayList;
pub use closest_point::ClosestPoint;
pub use coarse_rounding::CoarseRounding;
pub use crossings::{CONTAINS_DIRECTION, Closedness, Containment, InsideRule, NotClosed, SignedHit};
pub use generalised::WindingNumber;
pub use instances::{Instance, MeshSpace, can_be_instance};
pub use lists::Lists;
pub use preset::Preset;
pub use quality::{Quality, VisitedNode, quality};

use std::sync::Arc;

use glam::DVec3;

use brute_force::BruteForce;
use instances::{Instances, MeshBvh};
use layered::Layered;
use shapes::Shapes;
use stored_slot::{MeshSlots, Slots, StoredSlot};

use crate::geometry::simd::InstructionSet;
use crate::geometry::{
    AnalyticShape, Bounds, Double, Exact, Fast, Hit, HitBuffer, LineTest, Numerics, Precision, PrimId, Ray,
    Rays, SlotId, Tier, Triangle, Watertight,
};

/// The geometry of one primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A triangle.
    Triangle(Triangle),
    /// Any other shape.
    Analytic(AnalyticShape),
}

impl Primitive {
    /// The smallest f32 box around the primitive; for triangles see [`Triangle::bounds`].
    pub fn bounds(&self) -> Bounds {
        match self {
            Primitive::Triangle(triangle) => triangle.bounds(),
            Primitive::Analytic(shape) => shape.bounds(),
        }
    }

    /// The primitive rounded to `precision`; `None` for an analytic shape that is then empty. Triangles without area
    /// stay: where one closes a gap at a T-vertex, rays hit it.
    pub fn rounded(&self, precision: Precision) -> Option<Self> {
        match *self {
            Primitive::Triangle(Triangle(corners)) => {
                Some(Primitive::Triangle(Triangle(corners.map(|corner| corner.map(|c| precision.round(c))))))
            }
            Primitive::Analytic(shape) => shape.rounded(precision).map(Primitive::Analytic),
        }
    }
}

/// A primitive and its id.
#[derive(Debug, Clone, Copy)]
pub struct Slot {
    /// Its geometry.
    pub primitive: Primitive,
    /// Its index in the scene description.
    pub id: PrimId,
}

/// The layout of an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// A tree of eight children per node, converted from obvhs's binary tree, traversed by AVX-512 or AVX2 where the
    /// machine has it.
    Wide(Preset),
    /// The same, traversed by AVX2 at most.
    Avx2(Preset),
    /// The same, traversed by portable code.
    Portable(Preset),
    /// No structure: every ray is tested against every primitive.
    BruteForce,
}

impl Layout {
    /// The build preset; `None` for brute force, which has no trees and no instances.
    pub fn preset(self) -> Option<Preset> {
        self.tree().map(|(preset, _)| preset)
    }

    /// The build preset and the instruction set of a tree.
    fn tree(self) -> Option<(Preset, InstructionSet)> {
        match self {
            Layout::Wide(preset) => Some((preset, InstructionSet::widest())),
            Layout::Avx2(preset) => Some((preset, InstructionSet::avx2())),
            Layout::Portable(preset) => Some((preset, InstructionSet::Portable)),
            Layout::BruteForce => None,
        }
    }

    /// Every layout except brute force, with every preset.
    pub fn trees() -> impl Iterator<Item = Layout> {
        let layouts = [Layout::Wide, Layout::Avx2, Layout::Portable];
        layouts.into_iter().flat_map(|layout| Preset::ALL.map(layout))
    }
}

impl Default for Layout {
    fn default() -> Self {
        Layout::Wide(Preset::default())
    }
}

/// Builds a structure over primitives, which are rounded to the precision of the tier.
pub fn build(
    slots: impl IntoIterator<Item = Slot>,
    layout: Layout,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    build_from(Source::Listed(&mut slots.into_iter()), layout, numerics)
}

/// What a structure is built over.
enum Source<'a> {
    /// Primitives, which are copied for the time of the build.
    Listed(&'a mut dyn Iterator<Item = Slot>),
    /// The triangles of a mesh.
    Mesh(MeshSlots<'a>),
}

/// Not generic, so that the traversals are compiled once and not in each crate that calls [`build`].
fn build_from(source: Source, layout: Layout, numerics: Numerics) -> Box<dyn Accelerator> {
    fn over<T: Tier>(slots: &dyn Slots<T::Corner>, layout: Layout) -> Box<dyn Accelerator> {
        match layout.tree() {
            Some((preset, instructions)) => Box::new(build::build_wide::<T>(slots, preset, instructions)),
            None => {
                let all = (0..slots.len() as u32).map(|slot| slots.get(slot));
                Box::new(BruteForce::<T>::new(all.collect()))
            }
        }
    }
    fn of<T: Tier>(source: Source, layout: Layout) -> Box<dyn Accelerator> {
        match source {
            Source::Listed(slots) => over::<T>(&slots.map(StoredSlot::new).collect::<Vec<_>>(), layout),
            Source::Mesh(slots) => over::<T>(&slots, layout),
        }
    }
    match numerics {
        Numerics::Fast => of::<Fast>(source, layout),
        Numerics::Watertight => of::<Watertight>(source, layout),
        Numerics::Double => of::<Double>(source, layout),
        Numerics::Exact => of::<Exact>(source, layout),
    }
}

/// Builds a structure over primitives and over instances, each of which must satisfy [`can_be_instance`].
pub fn build_with_instances(
    slots: impl IntoIterator<Item = Slot>,
    instances: Vec<Instance>,
    layout: Layout,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    let slots = &mut slots.into_iter();
    let Some(tree) = layout.tree().filter(|_| !instances.is_empty()) else {
        return build(slots.chain(instances.iter().flat_map(Instance::slots)), layout, numerics);
    };
    let flat = build_from(Source::Listed(slots), layout, numerics);
    over_instances(flat, instances, tree, numerics, &mut Vec::new())
}

/// See [`Instances::new`].
fn over_instances(
    flat: Box<dyn Accelerator>,
    instances: Vec<Instance>,
    tree: (Preset, InstructionSet),
    numerics: Numerics,
    built: &mut Vec<Arc<MeshBvh>>,
) -> Box<dyn Accelerator> {
    fn of<T: Tier>(
        flat: Box<dyn Accelerator>,
        instances: Vec<Instance>,
        tree: (Preset, InstructionSet),
        built: &mut Vec<Arc<MeshBvh>>,
    ) -> Box<dyn Accelerator> {
        let layer = Instances::<T>::new(instances, tree, built);
        Box::new(Layered { flat: flat.into(), layer })
    }
    match numerics {
        Numerics::Fast => of::<Fast>(flat, instances, tree, built),
        Numerics::Watertight => of::<Watertight>(flat, instances, tree, built),
        Numerics::Double => of::<Double>(flat, instances, tree, built),
        Numerics::Exact => of::<Exact>(flat, instances, tree, built),
    }
}

/// What a traversal does after a hit or a leaf.
pub(crate) enum Next {
    /// Continue.
    Continue,
    /// Continue, but skip what is farther than this distance.
    Shorten(f64),
    /// Stop.
    Stop,
}

/// Keeps one hit per primitive of those from index `first` on: a split triangle is in several slots.
pub(crate) fn merge_split(hits: &mut Vec<Hit>, first: usize) {
    let mut found = hits.split_off(first);
    found.sort_unstable_by_key(|hit| hit.prim);
    found.dedup_by_key(|hit| hit.prim);
    hits.append(&mut found);
}

/// The memory of traversals, reused from one ray to the next, and their counters. One per thread.
#[derive(Default)]
pub struct Traversal {
    /// Nodes that wait: those of a structure or of the top level of instances, and those of a mesh.
    children: Vec<(wide::Child, f32)>,
    mesh_children: Vec<(wide::Child, f32)>,
    packet: wide::Scratches,
    /// Allocated for the first stream: that takes longer than tracing a ray.
    stream: Option<wide::StreamScratch>,
    sides: Vec<(PrimId, i32)>,
    /// The number of tests so far.
    pub tests: Tests,
}

/// Counters of intersection tests; deterministic.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Tests {
    /// Boxes tested.
    pub nodes: u64,
    /// Primitives tested. In packets: pairs of a ray and a primitive that the f32 bounds do not exclude.
    pub primitives: u64,
}

impl std::ops::AddAssign for Tests {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.primitives += other.primitives;
    }
}

/// The queries of an [`Accelerator`] for this crate alone; so nothing outside of it is one.
pub(crate) trait Nearby {
    /// [`Accelerator::each_primitive`], for the defaults.
    fn every_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive));

    /// A copy, whose queries are valid after [`Accelerator::refit`]; `None` without that.
    fn copy_to_refit(&self) -> Option<Arc<dyn Accelerator>> {
        None
    }

    /// [`Accelerator::closest_hit`] of the hits that `accepts` returns `true` for.
    fn closest_hit_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(&Hit) -> bool,
        traversal: &mut Traversal,
    ) -> Option<Hit>;

    /// Calls `visit` with every primitive that has a point on the ray, or a point at no distance above 0 from it, ends
    /// included, and perhaps with others; with a split triangle several times.
    fn each_near_ray(
        &self,
        _ray: &LineTest,
        visit: &mut dyn FnMut(PrimId, Primitive),
        _traversal: &mut Traversal,
    ) {
        self.every_primitive(visit);
    }

    /// [`Nearby::each_near_ray`] of every ray; `visit` also takes the index of the ray and its test.
    fn each_near_rays(
        &self,
        rays: Rays,
        visit: &mut dyn FnMut(usize, &LineTest, PrimId, Primitive),
        traversal: &mut Traversal,
    ) {
        for (index, ray) in rays.iter().enumerate() {
            let test = LineTest::new(&ray);
            let mut visit = |prim, primitive| visit(index, &test, prim, primitive);
            self.each_near_ray(&test, &mut visit, traversal);
        }
    }

    /// Calls `visit` with every primitive that is no farther from the box of a least and a greatest corner than
    /// `limit`, or than the distance that `visit` returned last, and perhaps with others. A point is a box of two equal
    /// corners.
    fn each_near_box(
        &self,
        _corners: [DVec3; 2],
        _limit: f64,
        visit: &mut dyn FnMut(PrimId, Primitive) -> f64,
        _traversal: &mut Traversal,
    ) {
        self.every_primitive(&mut |prim, primitive| {
            visit(prim, primitive);
        });
    }

    /// The structure of its primitives and the user geometry beside them; `None` without any.
    fn parts(&self) -> Option<(&Arc<dyn Accelerator>, &Shapes)> {
        None
    }

    /// Writes it as [`Bvh::save`] does the structure that it belongs to; `None` if it cannot be saved.
    fn save(&self, _of: &Bvh, _to: &mut saved::Writer) -> Option<std::io::Result<()>> {
        None
    }

    /// The end of the range of slots without a primitive. Slots of instances begin there.
    fn slots_end(&self) -> u32 {
        u32::MAX
    }
}

/// An acceleration structure: intersection queries, refitting and description. Made by this crate only.
#[allow(private_bounds)]
pub trait Accelerator: Nearby + Send + Sync {
    /// The closest hit; of hits at equal t, the one with the lowest primitive id, except in `fast`.
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit>;

    /// Whether the ray hits anything.
    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool;

    /// Appends every hit of the ray to `hits`, in no order. On an edge or corner, all triangles that share it are hit.
    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal);

    /// Appends every hit of every ray of a packet to `hits`, with the index of the ray, in no order; with a split
    /// triangle perhaps several times.
    fn each_hit(&self, rays: Rays, hits: &mut Vec<(usize, Hit)>, traversal: &mut Traversal) {
        let mut found = Vec::new();
        for (index, ray) in rays.iter().enumerate() {
            self.all_hits(&ray, &mut found, traversal);
            hits.extend(found.drain(..).map(|hit| (index, hit)));
        }
    }

    /// Whether incoherent rays of a batch are traced as streams, in whose order nothing is gained by neighbours.
    fn has_streams(&self) -> bool {
        false
    }

    /// The primitive that [`Hit::slot`] refers to.
    fn primitive(&self, slot: SlotId) -> Primitive;

    /// Calls `visit` with every primitive as it is stored; with a split triangle several times.
    fn each_primitive(&self, visit: &mut dyn FnMut(PrimId, Primitive)) {
        self.every_primitive(visit);
    }

    /// Whether the ray hits any primitive that `accepts` returns `true` for.
    fn is_occluded_by(
        &self,
        ray: &Ray,
        accepts: &mut dyn FnMut(PrimId) -> bool,
        traversal: &mut Traversal,
    ) -> bool {
        let mut hits = Vec::new();
        self.all_hits(ray, &mut hits, traversal);
        hits.into_iter().any(|hit| accepts(hit.prim))
    }

    /// The tier of its intersection tests.
    fn numerics(&self) -> Numerics;

    /// Its layout, instruction set and size.
    fn describe(&self) -> Description;

    /// Refits the tree to new positions of its primitives, given by id. Faster than a build, and hits are as exact.
    /// Primitives without a rounded form ([`Primitive::rounded`]) are missed until a later refit. Returns the cost by
    /// the surface area heuristic relative to that at build.
    ///
    /// `None` if the layout does not support it, or a primitive has changed its kind: the structure must be built anew.
    fn refit(&mut self, _primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        None
    }

    /// The quality of its tree; `None` without a single tree. Visits every node.
    fn quality(&self) -> Option<Quality> {
        None
    }

    /// Appends the closest hit of every ray to `hits`, in order.
    fn closest_hits(&self, rays: Rays, hits: &mut HitBuffer, traversal: &mut Traversal) {
        rays.iter().for_each(|ray| hits.push(self.closest_hit(&ray, traversal).as_ref()));
    }

    /// Appends whether each ray hits anything to `occluded`, in order.
    fn are_occluded(&self, rays: Rays, occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        occluded.extend(rays.iter().map(|ray| self.is_occluded(&ray, traversal)));
    }
}

/// The layout, instruction set and size of an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Description {
    /// The name of its layout.
    pub layout: &'static str,
    /// The widest instruction set of its traversal; see [`compiled_isa`].
    pub isa: &'static str,
    /// The number of nodes.
    pub nodes: usize,
    /// The number of slots; exceeds the number of primitives where large triangles are split.
    pub slots: usize,
    /// Its size in bytes.
    pub bytes: usize,
}

/// The widest instruction set that the compiler was allowed to use: `avx512`, `avx2`, `sse2`, `neon` or `scalar`.
pub fn compiled_isa() -> &'static str {
    match () {
        () if cfg!(target_feature = "avx512f") => "avx512",
        () if cfg!(target_feature = "avx2") => "avx2",
        () if cfg!(target_feature = "sse2") => "sse2",
        () if cfg!(target_feature = "neon") => "neon",
        () => "scalar",
    }
}
