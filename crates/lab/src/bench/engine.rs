//! An engine: a library with one of its layouts, for leak and speed tests.

use glam::DVec3;

use super::Mesh;
use super::speed::Kind;
use kiln::bvh::detail::Tests;
use kiln::bvh::{Numerics, Ray};
use kiln::error::Result;

/// Name of an engine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The library: one of [`speed::NAMES`](super::speed::NAMES), or that of another crate.
    pub engine: &'static str,
    /// Layout of its structure, query functions or mode.
    pub layout: &'static str,
    /// Numerics tier, if the library has several.
    pub tier: Option<&'static str>,
    /// Build preset, if the library has several.
    pub preset: Option<&'static str>,
    /// Widest instruction set of its traversal.
    pub isa: &'static str,
}

type Build = dyn Fn(&Mesh) -> Result<Box<dyn Built>> + Sync;

/// A library with one of its layouts, tiers and presets.
pub struct Engine {
    /// Its name.
    pub label: Label,
    build: Box<Build>,
}

impl Engine {
    /// `build` builds a structure over a mesh on the current pool, ready for queries.
    pub fn new(label: Label, build: impl Fn(&Mesh) -> Result<Box<dyn Built>> + Sync + 'static) -> Self {
        Engine { label, build: Box::new(build) }
    }

    /// Builds the structure over `mesh`.
    ///
    /// # Errors
    /// [`Error::Failed`](kiln::error::Error::Failed) if the library fails.
    pub fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        (self.build)(mesh)
    }
}

/// Static properties of a structure; `None` if the library does not provide them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Facts {
    /// Number of nodes.
    pub nodes: Option<u64>,
    /// See [`Quality::depth`](kiln::bvh::detail::Quality::depth).
    pub depth: Option<u32>,
    /// See [`Quality::sah_cost`](kiln::bvh::detail::Quality::sah_cost).
    pub sah_cost: Option<f64>,
    /// Size in bytes, including triangles.
    pub bytes: Option<u64>,
}

/// A built structure, for queries from any number of threads.
pub trait Built: Send + Sync {
    /// Its static properties.
    fn facts(&self) -> Facts {
        Facts::default()
    }

    /// Converts rays of a kind to the engine's format, and allocates memory for the hits.
    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a>;

    /// Appends the triangles that the ray crosses at t > 0, in any order; the first one, unless
    /// [`Built::finds_all_crossings`]. For a crossing at an edge, one or both triangles may be appended.
    ///
    /// `origin` and `direction`, which is of length 1, are rounded to the precision of the engine. Zeros may be
    /// negative.
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let rays = [Ray::unchecked(origin, direction, 0.0, f64::INFINITY)];
        let mut queue = self.queue(Kind::Random, &rays);
        queue.run();
        found.extend(queue.hits().into_iter().flatten());
    }

    /// Whether [`Built::crossings`] returns all crossings and not only the first one.
    fn finds_all_crossings(&self) -> bool {
        false
    }

    /// Tier of the ray origin offset of secondary rays; `None` for an engine without such an offset.
    fn origins(&self) -> Option<Numerics> {
        None
    }
}

/// Converted rays, ready to be traced.
pub trait RayQueue: Send {
    /// Traces all rays. Called once; this is timed.
    fn run(&mut self);

    /// The hit primitive of each ray in order; for any-hit queries, any number for a hit.
    fn hits(&self) -> Vec<Option<u32>>;

    /// The distances of the hits, of any value where nothing is hit; `None` where they are not compared.
    fn distances(&self) -> Option<Vec<f64>> {
        None
    }

    /// Number of intersection tests, if counted.
    fn tests(&self) -> Option<Tests> {
        None
    }
}

/// A queue that traces rays in an engine's format one by one. `hit` returns the primitive that a ray hits, if any.
pub fn singly<'a, R: Send + 'a>(
    rays: impl Iterator<Item = R>,
    hit: impl FnMut(&R) -> Option<u32> + Send + 'a,
) -> Box<dyn RayQueue + 'a> {
    let rays: Vec<R> = rays.collect();
    // Written to, so that its memory pages are mapped.
    let mut hits = vec![Some(1); rays.len()];
    hits.clear();
    Box::new(Singly { rays, hits, hit })
}

struct Singly<R, F> {
    rays: Vec<R>,
    hits: Vec<Option<u32>>,
    hit: F,
}

impl<R: Send, F: FnMut(&R) -> Option<u32> + Send> RayQueue for Singly<R, F> {
    fn run(&mut self) {
        self.hits.extend(self.rays.iter().map(&mut self.hit));
    }

    fn hits(&self) -> Vec<Option<u32>> {
        self.hits.clone()
    }
}
