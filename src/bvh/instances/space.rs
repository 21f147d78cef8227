//! A ray brought into the space of a mesh, and how far it may lie beside the true one there.
//!
//! Triangles are tested in the world, on corners that are rounded there. The tree over a mesh has boxes around the
//! corners as the mesh has them. So the boxes are met as if they were larger by all that lies between the two:
//!
//! 1. a corner in the world is off by the arithmetic of its placement ([`Placement::error`]) and by its rounding to the
//!    numbers of the tier, half a step of them;
//! 2. a hit is off its triangle, as rounded, by what the tier's test allows: relative to the triangle, and to the distance
//!    from the ray's origin;
//! 3. the way back is the inverse of the placement up to a residual, which is computed; and bringing a ray there rounds,
//!    relative to the distance from its origin.
//!
//! What is said in the world is carried back by the absolute values of the inverse. All of it is relative to the numbers at
//! hand. A hit that is decided in the world lies in the boxes of its triangle, larger by that, at its own t: the direction
//! keeps its length under the map, so t is the same in both spaces.

use glam::{DMat3, DVec3};

use crate::geometry::{Numerics, Ray, WidenedBoxTest};
use crate::scene::{Mesh, Placed};

/// The space of a mesh's tree: the mesh's own, moved and scaled so that its coordinates are no larger than 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSpace {
    middle: DVec3,
    /// A power of two.
    scale: f64,
    /// The largest coordinates of the mesh.
    reach: DVec3,
}

impl MeshSpace {
    /// `None` for a mesh without extent, or of one beyond all sense.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = mesh.corners().fold(none, |(min, max), p| (min.min(p), max.max(p)));
        let half = (max / 2.0 - min / 2.0).max_element();
        let scale = (-half.log2().ceil()).exp2();
        let usable = half > 0.0 && scale.is_normal() && scale.recip().is_normal();
        let reach = min.abs().max(max.abs());
        (usable && reach.is_finite()).then_some(MeshSpace { middle: min / 2.0 + max / 2.0, scale, reach })
    }

    /// A point of the mesh.
    pub fn point(&self, p: DVec3) -> DVec3 {
        (p - self.middle) * self.scale
    }
}

/// A mesh in one of its places, as seen by rays.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    world_from_box: DMat3,
    /// Where the middle of the mesh is.
    origin: DVec3,
    box_from_world: DMat3,
    /// How much larger boxes are taken to be, wherever a ray comes from.
    aside: DVec3,
    /// And how much more for each unit of distance from its origin.
    aside_per_distance: DVec3,
    /// How far points are off in the world.
    error: DVec3,
}

/// How far a hit may lie off its triangle, relative to the distance from the ray's origin and to the triangle's size.
///
/// In the tiers that decide in f64, a hit's distance is held in the box of its triangle up to 1 + 2^-26
/// ([`crate::geometry`], `hold`), its share of the corners is good to 2^-32, and bringing a ray into the mesh's space takes a
/// few 2^-53: 2^-25 is more than all together. In `fast` it is held in that box up to 1 + 2^-21, and may be anywhere in
/// it.
fn share_of_distance(numerics: Numerics) -> f64 {
    match numerics {
        Numerics::Fast => 1.0 / (1u32 << 20) as f64,
        Numerics::Watertight | Numerics::Double | Numerics::Exact => 1.0 / (1u32 << 25) as f64,
    }
}

/// How much larger boxes may be taken to be, in half sizes of the mesh: f32 holds it with the rest. Where the tier's
/// numbers cannot tell parts of the mesh apart along an axis, boxes are no use along it: it is squeezed, or far away.
const MOST_ASIDE: f64 = (1u32 << 20) as f64;

/// Scales beyond this, either way, are beyond what f32 directions hold together with their reciprocals and products.
const LARGEST_SCALE: f64 = (1u128 << 60) as f64;

impl Frame {
    /// `None` where no ray can be brought back, or none with any use.
    pub fn new(placed: &Placed, space: &MeshSpace, numerics: Numerics) -> Option<Self> {
        let (linear, offset) = placed.placement.as_one();
        let world_from_box = linear * space.scale.recip();
        let origin = linear * space.middle + offset;
        let box_from_world = world_from_box.inverse();
        let (out, back) = (world_from_box.abs(), box_from_world.abs());
        let greatest = |m: &DMat3| m.to_cols_array().into_iter().fold(0.0, f64::max);
        let usable = greatest(&out) < LARGEST_SCALE && greatest(&back) < LARGEST_SCALE;
        if !(usable && out.is_finite() && back.is_finite()) {
            return None;
        }
        // Of the corners, and of the origin by which they are seen.
        let error = 2.0 * placed.placement.error(space.reach);
        let half = out * DVec3::ONE;
        let largest = origin.abs() + half + error;
        let rounding = numerics.precision().epsilon() / 2.0 * largest + f64::from(f32::from_bits(1));
        let share = share_of_distance(numerics);
        let off_the_triangle = DVec3::splat(2.0 * half.max_element() * share);
        // What inverse and map together are off the identity, with what computing that rounds.
        let residual =
            (box_from_world * world_from_box - DMat3::IDENTITY).abs() + (back * out) * (8.0 * f64::EPSILON);
        let mut aside = back * (error + rounding + off_the_triangle) + residual * DVec3::ONE;
        if numerics == Numerics::Fast {
            // A hit anywhere in the box of its triangle may lie that far outside the mesh, which rounds in f32.
            aside += spread(&back, &out) * DVec3::splat(4.0 * f64::from(f32::EPSILON));
        }
        (aside.max_element() <= MOST_ASIDE).then_some(Frame {
            world_from_box,
            origin,
            box_from_world,
            aside,
            aside_per_distance: back * DVec3::splat(share),
            error,
        })
    }

    /// How far the box around a triangle in the world reaches beyond the triangle's own, seen from the mesh, in half
    /// sizes of that: 0 where axes stay axes.
    pub fn spread(&self) -> DMat3 {
        spread(&self.box_from_world.abs(), &self.world_from_box.abs())
    }

    /// A box in the world that holds every corner in a box of the mesh's tree, before it is rounded.
    pub fn in_world(&self, min: DVec3, max: DVec3) -> [DVec3; 2] {
        let (centre, half) = (min / 2.0 + max / 2.0, max / 2.0 - min / 2.0);
        let centre = self.world_from_box * centre + self.origin;
        let out = self.world_from_box.abs();
        // The last: what the sums here round, and the coordinates of the tree.
        let half = out * half + self.error + (out * DVec3::ONE + self.origin.abs()) * (32.0 * f64::EPSILON);
        [centre - half, centre + half]
    }

    /// A ray in the space of the mesh's tree, from where it enters the mesh's box in the world; and at what distance
    /// along the ray that is. No hit is before.
    ///
    /// From there, because f32 has no digits to spare for the way to the mesh.
    #[inline]
    pub fn local(&self, ray: &Ray, enter: f32) -> (WidenedBoxTest, f64) {
        let from = ray.origin - self.origin;
        let direction = self.box_from_world * ray.direction;
        // What the box test of any tier may be off by is half of this.
        let enter = f64::from(enter);
        let before = enter - enter.abs() / f64::from(1u32 << 20);
        let start = if before > ray.t_min { before } else { ray.t_min };
        let origin = self.box_from_world * from + direction * start;
        let aside = self.aside + self.aside_per_distance * from.abs().max_element();
        (WidenedBoxTest::new(origin, direction, aside), start)
    }
}

fn spread(back: &DMat3, out: &DMat3) -> DMat3 {
    (*back * *out - DMat3::IDENTITY).abs()
}
