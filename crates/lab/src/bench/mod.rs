//! Comparison of kiln's acceleration structures with other libraries on the same meshes and rays. Its interface may
//! change between versions more than that of the other modules.
//!
//! An [`Engine`] builds a [`Built`] structure over a [`Mesh`]. To add one: a file here, and a line in [`leaks::engines`]
//! or [`speed::engines`]. Another crate passes its own to [`speed::measure`]: `examples/compare_bvh.rs`.
//!
//! - [`contains`]: number of points that a closed mesh wrongly contains or not.
//! - [`effects`]: cost of each effect of a picture.
//! - [`leaks`]: number of rays that leak through a closed mesh.
//! - [`light_left_out`]: the light that limits on paths leave out of a picture.
//! - [`price`]: what accuracy costs, in kiln's tiers and in other libraries.
//! - [`speed`]: ray throughput and number of wrong hits.

#[cfg(feature = "peers")]
mod bvh_peer;
// `unsafe_code` is allowed for C and C++ libraries only.
pub mod contains;
pub mod effects;
#[allow(unsafe_code)]
mod embree;
mod engine;
mod envelope;
pub mod errors;
pub mod generate;
mod icosphere;
pub mod leaks;
pub mod light_left_out;
mod numbers;
mod obvhs;
mod own;
#[cfg(feature = "peers")]
mod parry;
pub(crate) mod plot;
pub mod price;
mod rays;
pub mod speed;
mod tetrahedron;
#[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
#[allow(unsafe_code)]
mod tinybvh;

pub use crate::timing::Quartiles;
pub use engine::{Built, Engine, Facts, Label, RayQueue, singly};
pub use envelope::ResultFile;
pub use icosphere::{Icosphere, Mesh, PLACEMENTS, Placement};
pub use numbers::Numbers;
pub use plot::three_digits;
pub use rays::{LeakRayKind, ray};

use kiln::bvh::Hit;
use kiln::error::Error;

/// Subdivision level of the closed mesh: 81,920 triangles.
const LEVEL: u32 = 6;

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

impl Unavailable {
    /// The reason and the remedy.
    pub fn skipped_reason(&self) -> String {
        format!("{}; {}", self.reason, self.remedy)
    }

    /// The error where the library is asked for.
    pub fn error(&self) -> Error {
        Error::Failed { what: format!("{}: {}", self.name, self.reason), hint: self.remedy.into() }
    }
}

impl std::fmt::Display for Unavailable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: not measured: {}", self.name, self.skipped_reason())
    }
}

/// Engines of a library, or why there are none.
type Available = std::result::Result<Vec<Engine>, Unavailable>;

/// The available engines in order, and the unavailable libraries.
fn gathered(libraries: impl IntoIterator<Item = Available>) -> (Vec<Engine>, Vec<Unavailable>) {
    let (mut present, mut absent) = (Vec::new(), Vec::new());
    for library in libraries {
        match library {
            Ok(engines) => present.extend(engines),
            Err(reason) => absent.push(reason),
        }
    }
    (present, absent)
}

#[cfg(not(all(feature = "tinybvh", feature = "peers", target_feature = "avx2")))]
fn not_compiled(name: &'static str, remedy: &'static str) -> Available {
    Err(Unavailable { name, reason: "kiln was built without it".into(), remedy })
}

fn tinybvh() -> Available {
    #[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
    return Ok(tinybvh::engines());
    #[cfg(not(all(feature = "tinybvh", target_feature = "avx2")))]
    not_compiled("tinybvh", "build with RUSTFLAGS=\"-C target-feature=+avx2\" and --features tinybvh")
}

/// Whether a primitive is the closest hit, given all hits in `exact`. Triangles whose relative distance to the closest
/// hit is below 2^-20, such as adjacent ones at an edge, count, too.
fn is_nearest(prim: u32, reference: &[Hit]) -> bool {
    let nearest = reference.iter().map(|hit| hit.t).fold(f64::INFINITY, f64::min);
    let within = nearest * (1.0 + 8.0 * f64::from(f32::EPSILON));
    reference.iter().any(|hit| hit.prim.0 == prim && hit.t <= within)
}
