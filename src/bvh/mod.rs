//! Acceleration structures over triangles and spheres alike.
//!
//! obvhs builds the tree; kiln walks it itself. obvhs's own traversal and intersectors are fast but not conservative:
//! its boxes are tested without margin, tiny direction components are clamped, ties depend on the layout, and its
//! triangle test loses rays on edges seen from behind. The picture must not depend on the structure, so every
//! structure here answers exactly as [`Structure::BruteForce`] does, in every tier of numerics: the least t, ties to the lowest primitive id.
//!
//! Meshes that stand in many places are kept once ([`Instance`]), beside a structure for everything else.

mod brute_force;
mod build;
mod instances;
pub mod mix;
mod preset;
mod quality;
mod store;
mod tree;
mod user;
mod wide;

pub use instances::{Instance, MeshSpace, can_be_instance};
pub use preset::Preset;
pub use quality::{Quality, Seen, quality};
pub use user::{Bvh, NotFinite, Update, is_worth_keeping};

use brute_force::BruteForce;
use instances::Instances;
use store::StoredSlot;

use glam::{DVec3, Vec3};

use crate::geometry::{
    Bounds, Double, Exact, Fast, Hit, Numerics, Precision, PrimId, Ray, SlotId, Sphere, Tier, Triangle,
    Watertight,
};

/// The geometry of one primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A triangle.
    Triangle(Triangle),
    /// An analytic sphere.
    Sphere(Sphere),
}

impl Primitive {
    /// The smallest f32 box that holds the primitive.
    pub fn bounds(&self) -> Bounds {
        match self {
            Primitive::Triangle(triangle) => triangle.bounds(),
            Primitive::Sphere(sphere) => sphere.bounds(),
        }
    }

    /// In numbers of `precision`; `None` for a sphere whose radius rounds to 0. Triangles that have no area are kept: where they close a gap
    /// at a T-vertex, rays hit them.
    pub fn rounded(&self, precision: Precision) -> Option<Self> {
        match *self {
            Primitive::Triangle(Triangle(corners)) => {
                Some(Primitive::Triangle(Triangle(corners.map(|corner| corner.map(|c| precision.round(c))))))
            }
            Primitive::Sphere(Sphere { centre, radius }) => {
                let sphere = Sphere { centre: centre.map(|c| Precision::Double.round(c)), radius };
                (precision.round(radius) > 0.0).then_some(Primitive::Sphere(sphere))
            }
        }
    }
}

/// A primitive and its number.
#[derive(Debug, Clone, Copy)]
pub struct Slot {
    /// Its geometry.
    pub primitive: Primitive,
    /// Its place in the description.
    pub id: PrimId,
}

/// How rays find what they hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Structure {
    /// obvhs's binary tree, built with a preset.
    Tree(Preset),
    /// The same tree converted to nodes of eight, for the instructions that the machine has.
    Wide(Preset),
    /// The same without instructions that not every machine has.
    Portable(Preset),
    /// No structure: every primitive is tested. The oracle that the others are held to.
    BruteForce,
}

impl Structure {
    /// How its trees are built; `None` where it has none, and no place for instances.
    pub fn preset(self) -> Option<Preset> {
        match self {
            Structure::Tree(preset) | Structure::Wide(preset) | Structure::Portable(preset) => Some(preset),
            Structure::BruteForce => None,
        }
    }
}

impl Default for Structure {
    fn default() -> Self {
        Structure::Wide(Preset::default())
    }
}

impl Structure {
    /// Every structure but brute force: every layout, built with every preset.
    pub fn trees() -> impl Iterator<Item = Structure> {
        [Structure::Tree, Structure::Wide, Structure::Portable]
            .into_iter()
            .flat_map(|layout| Preset::ALL.map(layout))
    }
}

/// Builds a structure over primitives whose numbers are rounded to those of the tier.
pub fn build(
    slots: impl IntoIterator<Item = Slot>,
    structure: Structure,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    build_from(&mut slots.into_iter(), structure, numerics)
}

/// Not generic, so that the traversals of every tier are compiled once and not again in each crate that calls [`build`].
fn build_from(
    slots: &mut dyn Iterator<Item = Slot>,
    structure: Structure,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    fn of<T: Tier>(slots: &mut dyn Iterator<Item = Slot>, structure: Structure) -> Box<dyn Accelerator> {
        let stored: Vec<StoredSlot<T>> = slots.map(StoredSlot::new).collect();
        match structure {
            Structure::Tree(preset) => Box::new(build::build(&stored, preset)),
            Structure::Wide(preset) => Box::new(build::build_wide(&stored, preset, wide::is_accelerated())),
            Structure::Portable(preset) => Box::new(build::build_wide(&stored, preset, false)),
            Structure::BruteForce => Box::new(BruteForce::new(stored)),
        }
    }
    match numerics {
        Numerics::Fast => of::<Fast>(slots, structure),
        Numerics::Watertight => of::<Watertight>(slots, structure),
        Numerics::Double => of::<Double>(slots, structure),
        Numerics::Exact => of::<Exact>(slots, structure),
    }
}

/// Builds a structure over primitives, and over meshes that stand in many places, of which each [`can_be_instance`].
pub fn build_with_instances(
    slots: impl IntoIterator<Item = Slot>,
    instances: Vec<Instance>,
    structure: Structure,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    let slots = &mut slots.into_iter();
    let Some(preset) = structure.preset().filter(|_| !instances.is_empty()) else {
        return match numerics.precision() {
            Precision::Single => {
                build(slots.chain(instances.iter().flat_map(Instance::slots::<Vec3>)), structure, numerics)
            }
            Precision::Double => {
                build(slots.chain(instances.iter().flat_map(Instance::slots::<DVec3>)), structure, numerics)
            }
        };
    };
    let flat = build_from(slots, structure, numerics);
    over_instances(flat, instances, preset, numerics)
}

fn over_instances(
    flat: Box<dyn Accelerator>,
    instances: Vec<Instance>,
    preset: Preset,
    numerics: Numerics,
) -> Box<dyn Accelerator> {
    match numerics {
        Numerics::Fast => Box::new(Instances::<Fast>::new(flat, instances, preset)),
        Numerics::Watertight => Box::new(Instances::<Watertight>::new(flat, instances, preset)),
        Numerics::Double => Box::new(Instances::<Double>::new(flat, instances, preset)),
        Numerics::Exact => Box::new(Instances::<Exact>::new(flat, instances, preset)),
    }
}

/// What a traversal needs from one ray to the next, and what it counted.
#[derive(Default)]
pub struct Traversal {
    stack: Vec<(u32, f32)>,
    children: Vec<(wide::Child, f32)>,
    packet: Box<wide::Scratch>,
    stacks: wide::Stacks,
    /// Where the rays of a batch begin.
    entries: Vec<(u32, f32)>,
    instances: instances::Stacks,
    /// The work done so far.
    pub tests: Tests,
}

/// Deterministic measures of work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tests {
    /// Boxes tested.
    pub nodes: u64,
    /// Primitives tested; of packets, pairs of a ray and a primitive that it may meet by bounds in f32, whether that decides or the tier.
    pub primitives: u64,
}

impl std::ops::AddAssign for Tests {
    fn add_assign(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.primitives += other.primitives;
    }
}

/// What answers "what does this ray hit".
pub trait Accelerator: Send + Sync {
    /// The hit with the least t, and among those at the same t the one with the lowest primitive id.
    fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit>;

    /// Whether the ray hits anything at all.
    fn is_occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool;

    /// Every hit of the ray, in no order, appended to `hits`. On an edge or a corner all triangles that meet there count.
    fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>, traversal: &mut Traversal);

    /// What [`Hit::slot`] refers to.
    fn primitive(&self, slot: SlotId) -> Primitive;

    /// The tier that it decides by.
    fn numerics(&self) -> Numerics;

    /// What there is to say about the structure.
    fn describe(&self) -> Description;

    /// Takes new positions for the primitives it was built over, `primitive` telling each by its id, and keeps its shape:
    /// much quicker than to build, and as right. Those that the tier's numbers cannot hold ([`Primitive::rounded`]) are not
    /// hit until they are back. Says how many times the cost by the surface area heuristic, which grows with the time of
    /// rays, is what it was when it was built: [`is_worth_keeping`] judges.
    ///
    /// `None` where it cannot be: the structure is not made for it, or a triangle has become a sphere. Such a one must be
    /// built anew.
    fn refit(&mut self, _primitive: &(dyn Fn(PrimId) -> Primitive + Sync)) -> Option<f64> {
        None
    }

    /// How good its tree is; `None` where there is none. Looks at every node.
    fn quality(&self) -> Option<Quality>;

    /// The closest hit of every ray, in order, appended to `hits`.
    fn closest_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>, traversal: &mut Traversal) {
        hits.extend(rays.iter().map(|ray| self.closest_hit(ray, traversal)));
    }

    /// Whether every ray hits anything at all, in order, appended to `occluded`.
    fn are_occluded(&self, rays: &[Ray], occluded: &mut Vec<bool>, traversal: &mut Traversal) {
        occluded.extend(rays.iter().map(|ray| self.is_occluded(ray, traversal)));
    }
}

/// What there is to say about an acceleration structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Its name.
    pub layout: &'static str,
    /// The widest instructions that its traversal uses: see [`compiled_isa`].
    pub isa: &'static str,
    /// How many nodes it has.
    pub nodes: usize,
    /// How many slots it has; may exceed the primitives where large ones are kept in several places.
    pub slots: usize,
    /// Its size in bytes.
    pub bytes: usize,
}

/// The widest instructions that the compiler was allowed to use: `avx512`, `avx2`, `sse2`, `neon` or `scalar`.
pub fn compiled_isa() -> &'static str {
    match () {
        () if cfg!(target_feature = "avx512f") => "avx512",
        () if cfg!(target_feature = "avx2") => "avx2",
        () if cfg!(target_feature = "sse2") => "sse2",
        () if cfg!(target_feature = "neon") => "neon",
        () => "scalar",
    }
}
