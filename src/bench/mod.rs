//! Comparison of kiln's acceleration structures with other libraries on the same meshes and rays. Its interface may
//! change between versions more than that of the other modules.
//!
//! An [`Engine`] builds a [`Built`] structure over a [`Mesh`], which leak tests query. To add an engine: a file here,
//! and a line in [`engines`].
//!
//! - [`effects`]: cost of each effect of a picture.
//! - [`leaks`]: number of rays that leak through a closed mesh.
//! - [`speed`]: ray throughput and number of wrong hits.
//! - [`tiers`]: cost and errors of kiln's numerics tiers.

#[cfg(feature = "peers")]
mod bvh_peer;
mod clock;
// `unsafe_code` is allowed for C and C++ libraries only.
pub mod effects;
#[allow(unsafe_code)]
mod embree;
mod envelope;
pub mod generate;
pub(crate) mod html;
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
pub use envelope::Envelope;
pub use icosphere::{Icosphere, Mesh, PLACEMENTS, Placement};
pub use numbers::Numbers;
pub use rays::{LeakRayKind, ray};
pub use spread::Spread;

use glam::DVec3;

use crate::error::Result;
use crate::geometry::{Hit, Numerics};

/// Subdivision level of the closed mesh: 81,920 triangles.
const LEVEL: u32 = 6;

/// A library with a layout for the leak test.
pub trait Engine: Sync {
    /// The library: one of [`NAMES`].
    fn name(&self) -> &'static str;

    /// Layout or mode, such as `bvh2`, `cwbvh`, `brute-force` or `robust`.
    fn layout(&self) -> &'static str;

    /// Numerics tier, if the library has several.
    fn tier(&self) -> Option<&'static str> {
        None
    }

    /// Whether a query tests every triangle, which is feasible for small meshes only.
    fn is_exhaustive(&self) -> bool {
        false
    }

    /// Whether [`Built::crossings`] returns all crossings and not only the first one.
    fn finds_all_crossings(&self) -> bool {
        true
    }

    /// Tier of the ray origin offset of secondary rays; `None` for an engine without such an offset.
    fn origins(&self) -> Option<Numerics> {
        None
    }

    /// Builds the structure over `mesh`.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::error::Error::Failed) if the library fails.
    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>>;
}

/// A built structure, for queries from any number of threads.
pub trait Built: Sync {
    /// Appends the triangles that the ray crosses at t > 0, in any order. For a crossing at an edge, one or both
    /// triangles may be appended.
    ///
    /// `origin` and `direction`, which is of length 1, are rounded to the precision of the engine. Zeros may be
    /// negative.
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>);
}

/// A library that is not available.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unavailable {
    /// The library.
    pub name: &'static str,
    /// The reason.
    pub reason: String,
    /// How to make it available.
    pub remedy: &'static str,
}

/// All libraries with an [`Engine`].
pub const NAMES: [&str; 4] = ["kiln", "obvhs", "embree", "tinybvh"];

/// The available engines in the order of [`NAMES`], and the unavailable libraries.
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

/// Whether a primitive is the closest hit, given all hits in `exact`. Triangles whose relative distance to the closest
/// hit is below 2^-20, such as adjacent ones at an edge, count, too.
fn is_nearest(prim: u32, reference: &[Hit]) -> bool {
    let nearest = reference.iter().map(|hit| hit.t).fold(f64::INFINITY, f64::min);
    let within = nearest * (1.0 + 8.0 * f64::from(f32::EPSILON));
    reference.iter().any(|hit| hit.prim.0 == prim && hit.t <= within)
}
