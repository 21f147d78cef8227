//! kiln's acceleration structures beside those of other libraries, all asked the same questions.
//!
//! An [`Engine`] builds a [`Built`] over a [`Mesh`]; a test asks every `Built` through one trait and knows no more of it.
//! To add an engine: a file here, and a line in [`engines`].
//!
//! - [`effects`]: what each effect of a picture costs.
//! - [`leaks`]: how many rays slip through a closed mesh.
//! - [`speed`]: how fast rays are answered, and how many answers are wrong.
//! - [`tiers`]: what each of kiln's tiers of numerics costs, and what it gets wrong.

#[cfg(feature = "peers")]
mod bvh_peer;
mod clock;
// The peers that are not written in Rust are called as C and C++ are; `unsafe_code` is denied everywhere else.
pub mod effects;
#[allow(unsafe_code)]
mod embree;
pub mod generate;
mod icosphere;
mod kiln;
pub mod leaks;
pub mod memory;
mod numbers;
mod obvhs;
#[cfg(feature = "peers")]
mod parry;
pub(crate) mod plot;
mod rays;
pub mod speed;
mod spread;
mod tetrahedron;
pub mod tiers;
#[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
#[allow(unsafe_code)]
mod tinybvh;

pub use clock::Clock;
pub use icosphere::{Icosphere, Mesh, PLACEMENTS, Placement};
pub use numbers::Numbers;
pub use rays::{LeakRayKind, ray};
pub use spread::Spread;

use glam::DVec3;

use crate::error::Result;
use crate::geometry::{Hit, Numerics};

/// How often the closed mesh is subdivided: 81,920 triangles.
const LEVEL: u32 = 6;

/// A library with one of its layouts: what builds the structure that is tested.
pub trait Engine: Sync {
    /// The library: one of [`NAMES`].
    fn name(&self) -> &'static str;

    /// The layout or mode of it, such as `bvh2`, `cwbvh`, `brute-force` or `robust`.
    fn layout(&self) -> &'static str;

    /// The tier of numerics, where the library has several.
    fn tier(&self) -> Option<&'static str> {
        None
    }

    /// Whether a query looks at every triangle, so that only small meshes are within reach.
    fn is_exhaustive(&self) -> bool {
        false
    }

    /// Whether [`Built::crossings`] gives the crossings behind the first one, too.
    fn finds_all_crossings(&self) -> bool {
        true
    }

    /// The tier whose rule places the origins of secondary rays; `None` for an engine that has no rule of its own.
    fn origins(&self) -> Option<Numerics> {
        None
    }

    /// Builds the structure over `mesh`.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::error::Error::Failed) where the library could not.
    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>>;
}

/// A structure that can be asked, from any number of threads.
pub trait Built: Sync {
    /// Appends the triangles that the ray crosses at t > 0, in any order; one that lies at the edge of two triangles may
    /// be given as one or both.
    ///
    /// `origin` and `direction`, which is of length 1, are rounded to the numbers that the engine works in. Zeros may be negative.
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>);
}

/// An engine that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unavailable {
    /// The library.
    pub name: &'static str,
    /// Why it is not there.
    pub reason: String,
    /// How to get it.
    pub remedy: &'static str,
}

/// Every library that kiln knows how to ask.
pub const NAMES: [&str; 4] = ["kiln", "obvhs", "embree", "tinybvh"];

/// Every engine that is there, in the order of [`NAMES`], and those that are not.
pub fn engines() -> (Vec<Box<dyn Engine>>, Vec<Unavailable>) {
    let mut present = kiln::engines();
    let mut absent = Vec::new();
    present.extend(obvhs::engines());
    match embree::engines() {
        Ok(engines) => present.extend(engines),
        Err(reason) => absent.push(reason),
    }
    #[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
    present.extend(tinybvh::engines());
    #[cfg(not(all(feature = "tinybvh", target_feature = "avx2")))]
    absent.push(no_tinybvh());
    (present, absent)
}

#[cfg(not(all(feature = "tinybvh", target_feature = "avx2")))]
fn no_tinybvh() -> Unavailable {
    Unavailable {
        name: "tinybvh",
        reason: "kiln was built without it".into(),
        remedy: "build with RUSTFLAGS=\"-C target-feature=+avx2\" and --features tinybvh",
    }
}

/// Whether a primitive is among those that are hit nearest, given every true hit of a ray.
///
/// Of several triangles that meet where the ray passes, each is right: their distances differ by less than 2^-20 of
/// themselves.
fn is_nearest(prim: u32, reference: &[Hit]) -> bool {
    let nearest = reference.iter().map(|hit| hit.t).fold(f64::INFINITY, f64::min);
    let within = nearest * (1.0 + 8.0 * f64::from(f32::EPSILON));
    reference.iter().any(|hit| hit.prim.0 == prim && hit.t <= within)
}
