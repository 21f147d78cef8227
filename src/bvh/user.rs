//! The room as a library: a structure over the user's own triangles and spheres. It is the one that pictures are made with.

use glam::DVec3;

use super::{Accelerator, Preset, Primitive, Slot, Structure, Traversal, build};
use crate::geometry::{Hit, Numerics, PrimId, Ray, Sphere, Triangle};

/// Triangles and spheres, ready for rays. A primitive's number is its place in the list that it came in.
/// [The first page of the crate](crate) has an example.
pub struct Bvh {
    accelerator: Box<dyn Accelerator>,
    structure: Structure,
    numerics: Numerics,
    /// Whether each primitive is one that the tier's numbers can hold, and so has a place in the structure.
    held: Vec<bool>,
}

/// What [`Bvh::update`] has done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Update {
    /// The tree kept its shape; it costs so many times what it did when it was built.
    Refitted(f64),
    /// A new tree was built.
    Rebuilt,
}

/// A number that is not finite, or beyond what f32 holds: boxes are f32 in every tier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotFinite {
    /// In a primitive.
    #[error("primitive {0} has a coordinate or a radius that is not finite, or too large for f32")]
    Primitive(usize),
    /// In a ray, or its direction is zero.
    #[error(
        "a ray needs an origin of finite f32 numbers and a direction of finite numbers, not all of them 0"
    )]
    Ray,
}

/// How many times its cost at build a tree may come to before another is built.
///
/// On the bunny, twisted and bent as a whole, rays need 11 to 16 % more tests than in a new tree at 1.2 times the cost,
/// 30 to 40 % at 1.6, and 1.6 to 1.9 times as many at 2.3. Refitting takes 0.4 of the time of building (6.7 ms and 16.3 ms on
/// one thread); the difference is what 12 % of the work of about 200,000 diffuse rays comes to. Where every corner shakes
/// on its own, new trees become nearly as much worse, and another is built for nothing.
const MOST_TIMES_WORSE: f64 = 1.2;

/// Whether a tree that was refitted is to be kept, by what [`Accelerator::refit`] says.
pub fn is_worth_keeping(times_worse: f64) -> bool {
    times_worse <= MOST_TIMES_WORSE
}

impl Bvh {
    /// Built as pictures are by default: no ray passes between triangles that share an edge.
    ///
    /// # Errors
    /// [`NotFinite`] for coordinates and radii that are not finite in f32.
    pub fn new(primitives: impl IntoIterator<Item = Primitive>) -> Result<Self, NotFinite> {
        Bvh::with(primitives, Preset::default(), Numerics::default())
    }

    /// Built with a preset, in a tier.
    ///
    /// # Errors
    /// [`NotFinite`] for coordinates and radii that are not finite in f32.
    pub fn with(
        primitives: impl IntoIterator<Item = Primitive>,
        preset: Preset,
        numerics: Numerics,
    ) -> Result<Self, NotFinite> {
        Ok(Bvh::over(&checked(primitives, numerics)?, Structure::Wide(preset), numerics))
    }

    fn over(primitives: &[Option<Primitive>], structure: Structure, numerics: Numerics) -> Self {
        let slots =
            (0..).zip(primitives).filter_map(|(id, p)| Some(Slot { primitive: (*p)?, id: PrimId(id) }));
        let held = primitives.iter().map(Option::is_some).collect();
        Bvh { accelerator: build(slots, structure, numerics), structure, numerics, held }
    }

    /// A ray in the numbers of the tier, from `origin` on. `direction` may have any length but 0 and is normalised, so a hit's t is a
    /// distance.
    ///
    /// # Errors
    /// [`NotFinite::Ray`], also for an origin beyond what f32 holds.
    pub fn ray(&self, origin: impl Into<DVec3>, direction: impl Into<DVec3>) -> Result<Ray, NotFinite> {
        let (origin, direction) = (origin.into(), direction.into());
        let largest = direction.abs().max_element();
        if !origin.as_vec3().is_finite() || !direction.is_finite() || largest == 0.0 {
            return Err(NotFinite::Ray);
        }
        // Divided first: the square of the length may be more or less than f64 holds.
        let direction = (direction / largest).normalize();
        Ok(self.numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY))
    }

    /// The hit with the least t, ties to the primitive that came first.
    pub fn closest_hit(&self, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        self.accelerator.closest_hit(ray, traversal)
    }

    /// Whether the ray hits anything between its ends.
    pub fn occluded(&self, ray: &Ray, traversal: &mut Traversal) -> bool {
        self.accelerator.is_occluded(ray, traversal)
    }

    /// The closest hit of every ray. Quickest for rays that start or end close together, 64 and more at a time.
    pub fn closest_hits(&self, rays: &[Ray], traversal: &mut Traversal) -> Vec<Option<Hit>> {
        let mut hits = Vec::with_capacity(rays.len());
        self.accelerator.closest_hits(rays, &mut hits, traversal);
        hits
    }

    /// Whether each ray hits anything.
    pub fn are_occluded(&self, rays: &[Ray], traversal: &mut Traversal) -> Vec<bool> {
        let mut occluded = Vec::with_capacity(rays.len());
        self.accelerator.are_occluded(rays, &mut occluded, traversal);
        occluded
    }

    /// Takes the primitives as they are now. Where they are the same ones in other places the tree is kept and its boxes
    /// are computed anew, unless it has become so much worse ([`is_worth_keeping`]) that another pays. On an error all is as
    /// it was.
    ///
    /// # Errors
    /// [`NotFinite`], as for [`Bvh::new`].
    pub fn update(&mut self, primitives: impl IntoIterator<Item = Primitive>) -> Result<Update, NotFinite> {
        let now = checked(primitives, self.numerics)?;
        // A triangle that could not be held before has no place in the tree.
        let is_same =
            self.held.len() == now.len() && self.held.iter().zip(&now).all(|(held, p)| *held || p.is_none());
        if is_same {
            // Only spheres can be without a place: those of no radius.
            let nothing = Primitive::Sphere(Sphere { centre: DVec3::ZERO, radius: 0.0 });
            let times_worse = self.accelerator.refit(&|id| now[id.0 as usize].unwrap_or(nothing));
            if let Some(times_worse) = times_worse.filter(|times| is_worth_keeping(*times)) {
                return Ok(Update::Refitted(times_worse));
            }
        }
        *self = Bvh::over(&now, self.structure, self.numerics);
        Ok(Update::Rebuilt)
    }

    /// How many spheres cannot be hit, because their radius is not above 0.
    pub fn left_out(&self) -> usize {
        self.held.iter().filter(|held| !**held).count()
    }

    /// What answers, for all that it can besides.
    pub fn accelerator(&self) -> &dyn Accelerator {
        &*self.accelerator
    }
}

/// The primitives in the numbers of the tier; `None` for those that it cannot hold.
fn checked(
    primitives: impl IntoIterator<Item = Primitive>,
    numerics: Numerics,
) -> Result<Vec<Option<Primitive>>, NotFinite> {
    let precision = numerics.precision();
    let is_finite = |primitive: &Primitive| {
        let held = match primitive {
            Primitive::Triangle(Triangle(corners)) => corners.iter().all(|corner| corner.is_finite()),
            Primitive::Sphere(sphere) => sphere.centre.is_finite() && sphere.radius.is_finite(),
        };
        // Boxes are f32 in every tier.
        let b = primitive.bounds();
        held && b.min.is_finite() && b.max.is_finite()
    };
    let check = |(index, primitive): (usize, Primitive)| match is_finite(&primitive) {
        true => Ok(primitive.rounded(precision)),
        false => Err(NotFinite::Primitive(index)),
    };
    primitives.into_iter().enumerate().map(check).collect()
}

/// Three corners.
impl From<[[f64; 3]; 3]> for Primitive {
    fn from(corners: [[f64; 3]; 3]) -> Self {
        Primitive::Triangle(Triangle(corners.map(DVec3::from)))
    }
}

/// Three corners.
impl From<[[f32; 3]; 3]> for Primitive {
    fn from(corners: [[f32; 3]; 3]) -> Self {
        Primitive::Triangle(Triangle(corners.map(|corner| corner.map(f64::from).into())))
    }
}

/// The centre and the radius of a sphere.
impl From<([f64; 3], f64)> for Primitive {
    fn from((centre, radius): ([f64; 3], f64)) -> Self {
        Primitive::Sphere(Sphere { centre: centre.into(), radius })
    }
}
