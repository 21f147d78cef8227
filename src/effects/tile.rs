//! What stages work on: the rays of one tile, level by level.
//!
//! Level 0 holds the rays of the tile's pixels, each further level the rays that surfaces of the one before sent out.
//! All arrays are kept from tile to tile, so that a steady state allocates nothing; each stage sets what it fills anew.
//! What only one effect needs is not here but in its own file, and exists where that runs ([`Tile::with`]).

use std::any::Any;

use super::RayKind;
use crate::bvh::Traversal;
use crate::film::Window;
use crate::geometry::{Hit, Ray};
use crate::shading::{LightLanes, Scratch};
use crate::world::{Lanes, RayLanes, Surfaces, View, World};

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
    /// For each surface, where rays that leave it start; there where some do.
    pub origins: Option<Box<Lanes>>,
    /// For each surface, where its shadow rays start; there where that is not where other rays do.
    pub shadow_origins: Option<Box<Lanes>>,
    /// For each surface, its colour.
    pub colours: Box<Lanes>,
}

impl Level {
    /// Bytes of memory that it holds, but for what an effect put there.
    pub fn bytes(&self) -> usize {
        let Level { rays, lanes, sources, hits, surfaces, origins, shadow_origins: _, colours } = self;
        size_of::<Level>()
            + vec_bytes(rays)
            + size_of_val(&**lanes)
            + vec_bytes(sources)
            + vec_bytes(hits)
            + size_of_val(&**surfaces)
            + usize::from(origins.is_some()) * size_of::<Lanes>()
            + size_of_val(&**colours)
    }
}

/// Bytes of memory that a vector holds.
pub fn vec_bytes<T>(values: &Vec<T>) -> usize {
    values.capacity() * size_of::<T>()
}

/// A tile in the making.
#[derive(Default)]
pub struct Tile {
    /// The pixels it covers.
    pub window: Option<Window>,
    /// The generations of rays.
    pub levels: Vec<Level>,
    /// The one that is being worked on.
    pub depth: usize,
    /// The finished pixels, row by row from the top; until an effect that takes several samples has made them, what each ray of
    /// level 0 saw.
    pub pixels: Vec<[f32; 3]>,
    /// Whether the stages are to be run again, for further samples.
    pub again: bool,
    /// How many samples each of the finished pixels took; empty where it is one.
    pub taken: Vec<u32>,
    /// What traversals need and count.
    pub traversal: Traversal,
    /// Rays cast and rays that hit, by kind; no entry for kinds of which none was.
    pub rays: Vec<(RayKind, RayCount)>,
    /// The lights as the surfaces of a level see them, in the world's order, until those are shaded; empty where no stage
    /// looked for lights.
    pub lights: Vec<Box<LightLanes>>,
    /// What shading needs in passing.
    pub shading: Box<Scratch>,
    /// For each object, whether a primary ray has seen it.
    pub seen: Vec<bool>,
    /// Who looks on while the tile is made; nobody while a picture is rendered.
    pub onlooker: Option<Box<Onlooker>>,
    /// What effects keep for themselves, each in a type of its own.
    own: Vec<Box<dyn Any + Send>>,
}

/// Every ray of a tile, in the order that they are cast in.
#[derive(Debug, Default)]
pub struct Onlooker {
    /// The rays.
    pub casts: Vec<Cast>,
}

/// A ray that was cast.
#[derive(Debug, Clone, Copy)]
pub struct Cast {
    /// What it was cast for.
    pub kind: RayKind,
    /// The level whose ray it is, or whose surface asked.
    pub depth: usize,
    /// What sent it: a pixel of the tile or a surface of the level before where the ray is one of a level, a surface of the level
    /// where it asks whether something is in its way.
    pub source: u32,
    /// Of a ray towards a light, which.
    pub light: Option<usize>,
    /// The ray.
    pub ray: Ray,
    /// What came of it.
    pub met: Met,
}

/// What came of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Met {
    /// It hit nothing.
    Nothing,
    /// It was asked for its closest hit.
    Hit(Hit),
    /// It was only asked whether anything is in its way, and something is.
    Something,
}

impl Onlooker {
    /// Sees the rays of a level.
    #[cold]
    pub fn see_level(&mut self, kind: RayKind, depth: usize, level: &Level) {
        let rays = level.rays.iter().zip(&level.hits).zip(&level.sources);
        self.casts.extend(rays.map(|((&ray, hit), &source)| {
            let met = hit.map_or(Met::Nothing, Met::Hit);
            Cast { kind, depth, source, light: None, ray, met }
        }));
    }

    /// Sees rays that are asked whether something is in their way; of each of them, which surface asks.
    #[cold]
    pub fn see_asked(
        &mut self,
        kind: RayKind,
        depth: usize,
        light: Option<usize>,
        surfaces: &[u32],
        rays: &[Ray],
        blocked: &[bool],
    ) {
        let rays = rays.iter().zip(blocked).zip(surfaces);
        self.casts.extend(rays.map(|((&ray, &blocked), &source)| {
            let met = if blocked { Met::Something } else { Met::Nothing };
            Cast { kind, depth, source, light, ray, met }
        }));
    }
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
        self.depth = 0;
        self.again = false;
        self.taken.clear();
        self.pixels.clear();
    }

    /// The level that is being worked on, made where it does not exist yet.
    pub fn level(&mut self) -> &mut Level {
        if self.levels.len() <= self.depth {
            self.levels.resize_with(self.depth + 1, Level::default);
        }
        &mut self.levels[self.depth]
    }

    /// The level that is being worked on and the next, made where it does not exist yet.
    pub fn this_and_next(&mut self) -> (&mut Level, &mut Level) {
        if self.levels.len() <= self.depth + 1 {
            self.levels.resize_with(self.depth + 2, Level::default);
        }
        let (before, after) = self.levels.split_at_mut(self.depth + 1);
        (&mut before[self.depth], &mut after[0])
    }

    /// Goes on to the next level, if it has rays.
    pub fn descend(&mut self) -> bool {
        let goes_on = self.levels.get(self.depth + 1).is_some_and(|next| !next.rays.is_empty());
        self.depth += usize::from(goes_on);
        goes_on
    }

    /// Goes back to the level before, if there is one.
    pub fn ascend(&mut self) -> bool {
        let goes_back = self.depth > 0;
        self.depth -= usize::from(goes_back);
        goes_back
    }

    /// Works on the tile with what an effect keeps for itself, made where it does not exist yet.
    pub fn with<T: Default + Send + 'static, R>(&mut self, work: impl FnOnce(&mut T, &mut Tile) -> R) -> R {
        let at = self.own.iter().position(|own| own.is::<T>());
        let mut taken = match at {
            Some(at) => self.own.swap_remove(at),
            None => Box::<T>::default(),
        };
        let own = taken.downcast_mut().expect("what was found by its type");
        let result = work(own, self);
        self.own.push(taken);
        result
    }

    /// What an effect keeps for itself; `None` where it never ran.
    pub fn kept<T: 'static>(&self) -> Option<&T> {
        self.own.iter().find_map(|own| own.downcast_ref())
    }

    /// Bytes of memory that it holds for what every picture takes: what effects hold is theirs to say.
    pub fn bytes(&self) -> usize {
        let Tile { levels, pixels, lights, shading, seen, .. } = self;
        size_of::<Tile>()
            + levels.first().map_or(0, Level::bytes)
            + vec_bytes(pixels)
            + vec_bytes(lights)
            + lights.len() * size_of::<LightLanes>()
            + size_of_val(&**shading)
            + vec_bytes(seen)
    }

    /// Adds to the count of a kind of ray.
    pub fn count(&mut self, kind: RayKind, cast: usize, hit: usize) {
        let at = self.rays.iter().position(|(known, _)| *known == kind).unwrap_or_else(|| {
            self.rays.push((kind, RayCount::default()));
            self.rays.len() - 1
        });
        let count = &mut self.rays[at].1;
        count.cast += cast as u64;
        count.hit += hit as u64;
    }
}
