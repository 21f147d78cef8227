//! [`Transform`]: rays from world space into the space of a mesh, with bounds on their error there.
//!
//! Triangles are tested in world space, on corners that are rounded there. The boxes of a mesh's tree bound the
//! corners of the mesh before placement. So the boxes are enlarged by all differences between the two:
//!
//! 1. a corner in world space is off by the arithmetic of its placement (`Placement::error`) and by its rounding to
//!    the precision of the tier, half an ulp;
//! 2. a hit is off its rounded triangle by the error of the tier's test: relative to the triangle, and to the
//!    distance from the ray's origin;
//! 3. the inverse of the placement has a residual, which is computed; and transforming a ray rounds, relative to the
//!    distance from its origin.
//!
//! Errors in world space are transformed by the absolute values of the inverse. Then a hit decided in world space
//! lies in the enlarged boxes of its triangle at its own t: directions are transformed without normalisation, so t is
//! the same in both spaces.

use glam::{DMat3, DVec3};

use crate::bvh::wide::BoxRay;
use crate::geometry::{Mesh, Numerics, Placed, Placement, Ray};

/// The space of a mesh's tree: that of the mesh, centred and scaled to coordinates of at most 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSpace {
    middle: DVec3,
    /// A power of two.
    scale: f64,
    /// The largest absolute coordinates of the mesh.
    reach: DVec3,
}

impl MeshSpace {
    /// The space of a mesh; `None` if its extent is 0 or its reciprocal not a normal number.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = mesh.corners().fold(none, |(min, max), p| (min.min(p), max.max(p)));
        let half = (max / 2.0 - min / 2.0).max_element();
        let scale = (-half.log2().ceil()).exp2();
        let usable = half > 0.0 && scale.is_normal() && scale.recip().is_normal();
        let reach = min.abs().max(max.abs());
        (usable && reach.is_finite()).then_some(MeshSpace { middle: min / 2.0 + max / 2.0, scale, reach })
    }

    /// Whether all corners are finite in f32 where the mesh is placed. Where this is `false`, they may be.
    pub(crate) fn is_finite_at(&self, placement: &Placement) -> bool {
        placement.reach(self.reach).as_vec3().is_finite()
    }

    /// A point of the mesh in this space.
    pub fn point(&self, p: DVec3) -> DVec3 {
        (p - self.middle) * self.scale
    }
}

/// The transform between world space and the [`MeshSpace`] of an instance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Transform {
    world_from_box: DMat3,
    /// The centre of the mesh in world space.
    origin: DVec3,
    box_from_world: DMat3,
    /// The enlargement of boxes for every ray.
    box_error: DVec3,
    /// The further enlargement per unit of distance from the ray's origin.
    box_error_per_distance: DVec3,
    /// The error of corners in world space.
    error: DVec3,
}

/// The distance of a hit from its triangle, relative to the distance from the ray's origin and to the triangle's size.
///
/// In the tiers that decide in f64, a hit's distance is clamped to the bounds of its triangle up to 1 + 2^-26
/// (`clamp_to_bounds` of [`crate::geometry`]), its barycentrics are good to 2^-32, and transforming a ray takes a few
/// 2^-53: 2^-25 is more than all together.
const SHARE_OF_DISTANCE: f64 = 1.0 / (1u32 << 25) as f64;

/// The largest enlargement of boxes, in half sizes of the mesh, within the range of f32. Along an axis with such
/// errors boxes cull nothing: the mesh is flattened there, or too far away for the precision of the tier.
const MAX_BOX_ERROR: f64 = (1u32 << 20) as f64;

/// The largest scale, and reciprocal of a scale, for which f32 directions, their reciprocals and products do not
/// overflow.
const LARGEST_SCALE: f64 = (1u128 << 60) as f64;

impl Transform {
    /// The transform of a placed mesh; `None` if the placement is singular, or its error exceeds [`MAX_BOX_ERROR`].
    pub(crate) fn new(placed: &Placed, space: &MeshSpace, numerics: Numerics) -> Option<Self> {
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
        // Of the corners, and of the ray origin that is subtracted from them.
        let error = 2.0 * placed.placement.error(space.reach);
        let half = out * DVec3::ONE;
        let largest = origin.abs() + half + error;
        let rounding = numerics.precision().epsilon() / 2.0 * largest + f64::from(f32::from_bits(1));
        let off_the_triangle = DVec3::splat(2.0 * half.max_element() * SHARE_OF_DISTANCE);
        // The deviation of inverse times matrix from the identity, and the rounding of this product.
        let residual =
            (box_from_world * world_from_box - DMat3::IDENTITY).abs() + (back * out) * (8.0 * f64::EPSILON);
        let box_error = back * (error + rounding + off_the_triangle) + residual * DVec3::ONE;
        (box_error.max_element() <= MAX_BOX_ERROR).then_some(Transform {
            world_from_box,
            origin,
            box_from_world,
            box_error,
            box_error_per_distance: back * DVec3::splat(SHARE_OF_DISTANCE),
            error,
        })
    }

    /// Bounds in world space of all corners in a box of the mesh's tree, not yet rounded to f32.
    pub(crate) fn in_world(&self, min: DVec3, max: DVec3) -> [DVec3; 2] {
        let (centre, half) = (min / 2.0 + max / 2.0, max / 2.0 - min / 2.0);
        let centre = self.world_from_box * centre + self.origin;
        let out = self.world_from_box.abs();
        // The last term is the rounding of these sums and of the coordinates of the tree.
        let half = out * half + self.error + (out * DVec3::ONE + self.origin.abs()) * (32.0 * f64::EPSILON);
        [centre - half, centre + half]
    }

    /// Bounds in [`MeshSpace`] of a box in world space, enlarged as boxes are for rays, and the largest factor by which
    /// distances grow there: an upper bound on the largest singular value of the map.
    ///
    /// The square of this value is the largest eigenvalue of B B^T and of B^T B, which is at most the largest sum of a
    /// row of absolute values. One of the two is diagonal, and the bound close, for a rotation with scales along axes.
    pub(crate) fn local_box(&self, [min, max]: [DVec3; 2]) -> ([DVec3; 2], f64) {
        let map = self.box_from_world;
        let (from, half) = (min / 2.0 + max / 2.0 - self.origin, max / 2.0 - min / 2.0);
        let distance = (from.abs() + half).max_element();
        let (centre, reach) =
            (map * from, map.abs() * half + self.box_error + self.box_error_per_distance * distance);
        let largest_row = |m: DMat3| (m.abs().transpose() * DVec3::ONE).max_element();
        let square = largest_row(map * map.transpose()).min(largest_row(map.transpose() * map));
        // The rounding of products and sums is below 16 u.
        ([centre - reach, centre + reach], square.sqrt() * (1.0 + 16.0 * f64::EPSILON))
    }

    /// The ray in [`MeshSpace`], starting where it enters the world-space box of the instance (at distance `enter`),
    /// and the distance of that start. No hit is before it.
    ///
    /// Starting there keeps f32 coordinates small. Errors are as large as [`BoxRay::with_error`] requires: `box_error`
    /// is at least 2 [`SHARE_OF_DISTANCE`] on every axis, as |B| |A| 1 is at least |B A| 1 = 1 for the two maps A and
    /// B. From its start to a hit the ray goes less than 2^50, by [`MAX_BOX_ERROR`], and 2^6 errors for the rounding of
    /// `enter`.
    #[inline]
    pub(crate) fn local(&self, ray: &Ray, enter: f64) -> (BoxRay, f64) {
        let from = ray.origin - self.origin;
        let direction = self.box_from_world * ray.direction;
        // The error of the box test, 4 u, is a quarter of this.
        let before = enter - enter.abs() / f64::from(1u32 << 20);
        let start = if before > ray.t_min { before } else { ray.t_min };
        let origin = self.box_from_world * from + direction * start;
        let box_error = self.box_error + self.box_error_per_distance * from.abs().max_element();
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
        (BoxRay::with_error(&ray, box_error), start)
    }
}
