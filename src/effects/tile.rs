//! What stages work on: the rays of one tile, level by level.
//!
//! Level 0 holds the rays of the tile's pixels, each further level the rays that surfaces of the one before sent out.
//! All arrays are kept from tile to tile, so that a steady state allocates nothing; each stage sets what it fills anew.

use super::RayKind;
use crate::bvh::Traversal;
use crate::film::Window;
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Hit, Ray};
use crate::shading::{LightLanes, Scratch};
use crate::world::{Differential, Lanes, RayLanes, Surfaces, TexturePoint, View, World};

/// What every stage may read.
pub struct Context<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// The camera.
    pub view: &'a View,
}

/// The rays of one generation and what became of them: at most one a pixel.
#[derive(Default)]
pub struct Level {
    /// The rays.
    pub rays: Vec<Ray>,
    /// The same, coordinate by coordinate.
    pub lanes: Box<RayLanes>,
    /// For each ray, what sent it: a pixel of the tile on level 0, a surface of the level before on others.
    pub sources: Vec<u32>,
    /// For each ray, its closest hit.
    pub hits: Vec<Option<Hit>>,
    /// The points that were hit, in the order of the rays.
    pub surfaces: Box<Surfaces>,
    /// For each ray, how it changes from pixel to pixel; on levels above 0, where footprints are followed.
    pub differentials: Vec<Differential>,
    /// For each surface, where it is in its pictures, if it is in any; empty where none is or nobody asks.
    pub texture_points: Vec<Option<TexturePoint>>,
    /// For each surface, where rays that leave it start; set where some do.
    pub origins: Box<Lanes>,
    /// For each surface, the point that its shadow rays start from; empty where that is the surface's own.
    pub shadow_points: Vec<SurfacePoint>,
    /// For each surface, its colour.
    pub colours: Box<Lanes>,
}

/// A tile in the making.
#[derive(Default)]
pub struct Tile {
    /// The pixels it covers.
    pub window: Option<Window>,
    /// The generations of rays.
    pub levels: Vec<Level>,
    /// The finished pixels, row by row from the top.
    pub pixels: Vec<[f32; 3]>,
    /// What traversals need and count.
    pub traversal: Traversal,
    /// Rays cast and rays that hit, by kind.
    pub rays: [RayCount; RayKind::ALL.len()],
    /// The lights as the surfaces of a level see them, in the world's order, until those are shaded; empty where no stage
    /// looked for lights.
    pub lights: Vec<Box<LightLanes>>,
    /// The shadow rays of all surfaces of a level, coordinate by coordinate.
    pub shadow_lanes: Box<RayLanes>,
    /// Those that are cast, while it is being asked which are blocked.
    pub shadow_rays: Vec<Ray>,
    /// For each surface of that level, where they start, where that is not where other rays do.
    pub shadow_origins: Box<Lanes>,
    /// For each of the rays, whether it is.
    pub occluded: Vec<bool>,
    /// For each of them, its surface.
    pub shadowed: Vec<u32>,
    /// What shading needs in passing.
    pub shading: Box<Scratch>,
    /// For each object, whether a primary ray has seen it.
    pub seen: Vec<bool>,
}

/// Rays of a kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCount {
    /// How many were cast.
    pub cast: u64,
    /// How many of them hit something.
    pub hit: u64,
}

impl Tile {
    /// Makes ready for the pixels of `window`. Counts go on.
    pub fn start(&mut self, window: Window) {
        self.window = Some(window);
        self.pixels.clear();
    }

    /// A level, made where it does not exist yet.
    pub fn level(&mut self, index: usize) -> &mut Level {
        if self.levels.len() <= index {
            self.levels.resize_with(index + 1, Level::default);
        }
        &mut self.levels[index]
    }

    /// Adds to the count of a kind of ray.
    pub fn count(&mut self, kind: RayKind, cast: usize, hit: usize) {
        let count = &mut self.rays[kind as usize];
        count.cast += cast as u64;
        count.hit += hit as u64;
    }
}
