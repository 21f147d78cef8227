//! [`UserGeometry`]: the interface of a surface whose intersections a user of the library computes, in a
//! [`Bvh`](crate::bvh::Bvh) with triangles, spheres and disks.

use glam::DVec3;

use super::{Ray, Side};

/// A surface with an intersection function of its own, for
/// [`Bvh::set_user_geometry`](crate::bvh::Bvh::set_user_geometry).
///
/// # Contract
/// All methods are pure functions of `self` and their arguments: the same numbers at every call, on every thread.
/// The guarantees of the tiers but `fast` then hold for structures with user geometry, too: the same hits, to the bit,
/// from every query, layout, instruction set and number of threads, the closest first, at equal t the lowest id first.
///
/// - [`UserGeometry::bounds`] contains the whole surface. A point reported outside is moved along the ray into the
///   box, and dropped if the ray misses the box.
/// - [`UserGeometry::intersect`] reports every point on the ray, independently of `t_min` and `t_max`: the structure
///   compares t with them and finds the closest. Queries for closest hits, any hit and all hits use one point of each
///   user geometry, the first between `t_min` and `t_max`. A filter that rejects this point rejects the user geometry.
/// - t is in f64 in every tier, with the error of the implementation. Hits whose t differ by less than their errors may
///   be in the wrong order, and a point within its error of `t_min` or `t_max` may be on the wrong side of it.
/// - The tier `exact` takes t as an exact number: whether it is before a hit on a triangle, a sphere or a disk is
///   decided exactly. Whether the surface is hit at all is as exact as `intersect`.
/// - The tiers `fast` and `watertight` round neither user geometry nor its rays to f32.
pub trait UserGeometry: Send + Sync {
    /// The least and the greatest corner of a box that contains the surface; finite in f32.
    fn bounds(&self) -> [DVec3; 2];

    /// Calls `found` with t and side of every point with t > 0 at which the ray meets the surface, in any order; other
    /// t are ignored. `t_min` of the ray is 0 and `t_max` infinity. Its direction is of any length but 0, and t is in
    /// units of that length. Containment and winding numbers use a direction that is not normalised.
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
    /// ([`Bvh::closedness`](crate::bvh::Bvh::closedness) counts it as a boundary edge), and the error of its
    /// generalised winding numbers is infinite: the solid angle of the surface is unknown.
    fn is_closed(&self) -> bool {
        false
    }

    /// The point of the surface that is closest to `point`. `None` if there is no such function: distance queries then
    /// ignore the surface.
    fn closest_point(&self, _point: DVec3) -> Option<DVec3> {
        None
    }
}
