//! How fast rays are answered, and how many answers are wrong, by kiln and by other libraries.
//!
//! All contenders get the same mesh of f32 corners and the same f32 rays, and take turns in every round, so that what
//! slows the machine down slows all of them down. Rays are put into an engine's own form beforehand; only its queries
//! are timed. Every contender's answers are compared with those of kiln's tier `exact`.
//!
//! To add a contender: implement [`Contender`] in the engine's file, and give it a line in [`contenders`].

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
pub use setting::{Triangles, Viewpoint, eye, scene, triangles};
pub(super) use singly::singly;

use super::{Mesh, Unavailable, embree, kiln, obvhs};
use crate::bvh::Tests;
use crate::error::Result;
use crate::geometry::Ray;

/// Every library that can take part.
pub const NAMES: [&str; 6] = ["kiln", "obvhs", "bvh", "parry3d", "tinybvh", "embree"];

/// What a contender is called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The library: one of [`NAMES`].
    pub engine: &'static str,
    /// The layout of its structure, or how rays are handed to it.
    pub layout: &'static str,
    /// The tier of numerics, where the library has several.
    pub tier: Option<&'static str>,
    /// How thoroughly it builds, where that can be chosen.
    pub preset: Option<&'static str>,
    /// The widest instruction set that its traversal uses.
    pub isa: &'static str,
}

/// An engine with one of its layouts, tiers and presets.
pub trait Contender: Sync {
    /// What it is called.
    fn label(&self) -> Label;

    /// From triangles in memory to ready for rays, on as many threads as there are in the current pool.
    ///
    /// # Errors
    /// [`Error::Failed`](crate::error::Error::Failed) where the library could not.
    fn build(&self, mesh: &Mesh) -> Result<Box<dyn BuiltContender>>;
}

/// What is known of a structure without casting a ray. `None` where the library does not tell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Facts {
    /// How many nodes it has.
    pub nodes: Option<u64>,
    /// See [`Quality::depth`](crate::bvh::Quality::depth).
    pub depth: Option<u32>,
    /// See [`Quality::sah_cost`](crate::bvh::Quality::sah_cost).
    pub sah_cost: Option<f64>,
    /// Its size in bytes, with its triangles.
    pub bytes: Option<u64>,
}

/// A structure that is built.
pub trait BuiltContender: Send + Sync {
    /// What is known of it.
    fn facts(&self) -> Facts;

    /// Puts rays of a kind into the engine's own form, with room for the answers.
    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a>;
}

/// Rays that wait for their answers.
pub trait RayQueue: Send {
    /// Finds all answers. Called once; this is what is timed.
    fn run(&mut self);

    /// What each ray found, in their order: the primitive that it hits first, or any number where the question is
    /// whether it hits anything.
    fn hits(&self) -> Vec<Option<u32>>;

    /// The work that was done, where it is counted.
    fn tests(&self) -> Option<Tests> {
        None
    }
}

/// Every contender that is there, built and asked on so many threads, in the order of [`NAMES`], and the libraries that
/// are not.
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

/// kiln as it renders, and Embree by single rays where it is there.
pub fn defaults(threads: usize) -> Vec<Box<dyn Contender>> {
    let mut defaults = vec![kiln::default_contender()];
    defaults.extend(embree::contenders(threads).into_iter().flat_map(|ways| ways.into_iter().take(1)));
    defaults
}
