//! Ray throughput and number of wrong hits of kiln and other libraries.
//!
//! All contenders get the same mesh and rays with f32 values. They are interleaved in every round, so that other load
//! on the machine affects all of them. Rays are converted to an engine's format beforehand; only its queries are timed.
//! The hits of every contender are compared with those of kiln's tier `exact`.
//!
//! To add a contender: implement [`Contender`] in the engine's file, and add a line to [`contenders`]. Another crate
//! passes its own to [`measure`] beside those: `examples/compare_bvh.rs`.

mod measure;
mod page;
mod rays;
mod reference;
mod scaling;
mod setting;
mod singly;

pub use measure::{Settings, SpeedRow, best, measure};
pub use page::page;
pub use rays::{BATCH, Kind, RaySets, ViewSetup};
pub use reference::ReferenceHits;
pub use scaling::{ScalingStep, plot as scaling_plot, scaling, sizes};
pub use setting::{Triangles, Viewpoint, scene, triangles, view_setup};
pub use singly::singly;

use super::{Mesh, Unavailable, embree, kiln, obvhs};
use crate::bvh::Tests;
use crate::error::Result;
use crate::geometry::Ray;

/// All libraries with a [`Contender`].
pub const NAMES: [&str; 6] = ["kiln", "obvhs", "bvh", "parry3d", "tinybvh", "embree"];

/// Name of a contender.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The library: one of [`NAMES`], or that of another crate.
    pub engine: &'static str,
    /// Layout of its structure, or query functions.
    pub layout: &'static str,
    /// Numerics tier, if the library has several.
    pub tier: Option<&'static str>,
    /// Build preset, if the library has several.
    pub preset: Option<&'static str>,
    /// Widest instruction set of its traversal.
    pub isa: &'static str,
}

/// An engine with one of its layouts, tiers and presets.
pub trait Contender: Sync {
    /// Its name.
    fn label(&self) -> Label;

    /// Builds a structure over `mesh` on the current pool, ready for queries.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::error::Error::Failed) if the library fails.
    fn build(&self, mesh: &Mesh) -> Result<Box<dyn BuiltContender>>;
}

/// Static properties of a structure; `None` if the library does not provide them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Facts {
    /// Number of nodes.
    pub nodes: Option<u64>,
    /// See [`Quality::depth`](crate::bvh::Quality::depth).
    pub depth: Option<u32>,
    /// See [`Quality::sah_cost`](crate::bvh::Quality::sah_cost).
    pub sah_cost: Option<f64>,
    /// Size in bytes, including triangles.
    pub bytes: Option<u64>,
}

/// A built structure.
pub trait BuiltContender: Send + Sync {
    /// Its static properties.
    fn facts(&self) -> Facts;

    /// Converts rays of a kind to the engine's format, and allocates memory for the hits.
    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a>;
}

/// Converted rays, ready to be traced.
pub trait RayQueue: Send {
    /// Traces all rays. Called once; this is timed.
    fn run(&mut self);

    /// The hit primitive of each ray in order; for any-hit queries, any number for a hit.
    fn hits(&self) -> Vec<Option<u32>>;

    /// Number of intersection tests, if counted.
    fn tests(&self) -> Option<Tests> {
        None
    }
}

/// The available contenders for a number of threads, in the order of [`NAMES`], and the unavailable libraries.
pub fn contenders(threads: usize) -> (Vec<Box<dyn Contender>>, Vec<Unavailable>) {
    let (mut present, mut absent) = (kiln::contenders(), Vec::new());
    present.extend(obvhs::contenders());
    #[cfg(feature = "peers")]
    {
        present.extend(super::bvh_peer::contenders());
        present.extend(super::parry::contenders());
    }
    #[cfg(not(feature = "peers"))]
    absent.extend(["bvh", "parry3d"].map(|name| Unavailable {
        name,
        reason: "kiln was built without it".into(),
        remedy: "build with --features peers",
    }));
    #[cfg(all(feature = "tinybvh", target_feature = "avx2"))]
    present.extend(super::tinybvh::contenders());
    #[cfg(not(all(feature = "tinybvh", target_feature = "avx2")))]
    absent.push(super::no_tinybvh());
    match embree::contenders(threads) {
        Ok(engines) => present.extend(engines),
        Err(reason) => absent.push(reason),
    }
    (present, absent)
}

/// kiln in its defaults, and Embree with single rays if available.
pub fn defaults(threads: usize) -> Vec<Box<dyn Contender>> {
    let mut defaults = vec![kiln::default_contender()];
    defaults.extend(embree::contenders(threads).into_iter().flat_map(|ways| ways.into_iter().take(1)));
    defaults
}
