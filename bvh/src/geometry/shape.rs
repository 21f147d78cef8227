//! [`Shape`]: what a surface of another crate has to offer to be hit, in a [`Bvh`](crate::bvh::Bvh) with triangles,
//! spheres and disks.

use glam::DVec3;

use super::{Ray, Side};

/// A surface that is intersected by code of its own: [`Bvh::set_shapes`](crate::bvh::Bvh::set_shapes) takes it.
///
/// # Contract
/// All methods are pure functions of the shape and their arguments: the same numbers at every call, on every thread.
/// The guarantees of the tiers but `fast` then hold for structures with shapes, too: the same hits, to the bit, from
/// every query, layout, instruction set and number of threads, the closest first, at equal t the lowest id first.
///
/// - [`Shape::bounds`] holds all of the surface. A point that is reported outside is moved along the ray into the box,
///   and left out if the ray misses the box: no structure loses it, but it is not where it was reported.
/// - [`Shape::intersect`] reports every point; no point is lost and none is found twice because of where the ray ends,
///   since it does not know where: the structure compares t with the ends of the ray, and finds the closest.
/// - t is in f64 in every tier. Its error is that of the shape. Hits whose t differ by less than their errors may be
///   in the wrong order, and crossings within it of the ray's origin or of `t_max` may be on the wrong side of that.
/// - The tier `exact` takes t of a shape as an exact number: it decides exactly whether that is before a hit on a
///   triangle, a sphere or a disk. Whether the shape is hit at all is as exact as `intersect`.
/// - Nothing of a shape is rounded to f32 in the tiers `fast` and `watertight`, and its rays are not either.
pub trait Shape: Send + Sync {
    /// The least and the greatest corner of a box that holds the surface; finite in f32.
    fn bounds(&self) -> [DVec3; 2];

    /// Calls `found` with t and side of every point with t > 0 at which the ray meets the surface, in any order; points
    /// behind its origin do no harm. The ray has neither end: `t_min` is 0 and `t_max` infinity. t is in units of the
    /// length of the ray's direction, which is 1 up to rounding, or what [`Ray::unchecked`] was given.
    ///
    /// A point that is touched and not passed through is reported twice at the same t, on both sides. Then the sides of
    /// a closed surface alternate along every ray, and the last one is [`Side::Leaving`]; containment depends on this.
    fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side));

    /// The unit normal at a point of the surface, which is given up to rounding; outwards of a closed surface. `None`
    /// has [`Bvh::geometric_normal`](crate::bvh::Bvh::geometric_normal) return `None`.
    fn normal(&self, _point: DVec3) -> Option<DVec3> {
        None
    }

    /// Whether the surface encloses a volume. If not, a structure that contains it is not closed
    /// ([`Bvh::closedness`](crate::bvh::Bvh::closedness) counts it as a boundary edge), and a generalised winding
    /// number has an additional error of 1/2.
    fn is_closed(&self) -> bool {
        false
    }

    /// The point of the surface that is closest to `point`. `None` for a shape that cannot tell: queries of what is
    /// near a point then leave it out, and distances are those of everything else.
    fn closest_point(&self, _point: DVec3) -> Option<DVec3> {
        None
    }
}
