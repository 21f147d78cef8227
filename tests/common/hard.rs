//! Geometry and rays that are hard to trace, from fixed seeds, and the assertions that they are used with.
//!
//! Coordinates are f32 numbers unless a generator says otherwise. Then every tier of numerics is given the same
//! triangles and the same rays, and one exact answer judges them all.

pub mod cases;
pub mod check;
pub mod meshes;
pub mod rays;
pub mod results;
pub mod spheres;
pub mod tree_inputs;

use glam::DVec3;
use kiln::bvh::detail::{Precision, Slot};
use kiln::bvh::{PrimId, Primitive, Ray, Sphere, Triangle};

/// The corners of a triangle.
pub type Corners = [DVec3; 3];

/// A quarter of `n`, times the environment variable `KILN_HARD_FACTOR`, by which long runs repeat more.
pub fn times_factor(n: usize) -> usize {
    let factor = std::env::var("KILN_HARD_FACTOR").ok();
    n * factor.map_or(1, |text| text.parse::<usize>().expect("KILN_HARD_FACTOR is a whole number")) / 4
}

/// The nearest point that f32 can hold.
pub fn single(p: DVec3) -> DVec3 {
    p.as_vec3().as_dvec3()
}

/// The same for every corner.
pub fn single_mesh(triangles: &[Corners]) -> Vec<Corners> {
    triangles.iter().map(|corners| corners.map(single)).collect()
}

/// Every corner moved by a function.
pub fn placed(triangles: &[Corners], place: impl Fn(DVec3) -> DVec3) -> Vec<Corners> {
    triangles.iter().map(|corners| corners.map(&place)).collect()
}

/// Triangles, numbered as they come.
pub fn triangles(triangles: impl IntoIterator<Item = Corners>) -> Vec<Slot> {
    numbered(triangles.into_iter().map(|corners| Primitive::Triangle(Triangle(corners))))
}

/// A sphere, as a primitive.
pub fn ball(centre: DVec3, radius: f64) -> Primitive {
    Primitive::from(Sphere { centre, radius })
}

/// Primitives, numbered as they come.
pub fn numbered(primitives: impl IntoIterator<Item = Primitive>) -> Vec<Slot> {
    (0..).zip(primitives).map(|(id, primitive)| Slot { primitive, id: PrimId(id) }).collect()
}

/// The corners of the triangles among some primitives.
pub fn corners_of(slots: &[Slot]) -> Vec<Corners> {
    slots
        .iter()
        .filter_map(|slot| match slot.primitive {
            Primitive::Triangle(Triangle(corners)) => Some(corners),
            Primitive::Analytic(_) => None,
        })
        .collect()
}

/// A ray of f32 numbers without end, which is the same in every tier.
pub fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Precision::Single.ray(origin, direction, 0.0, f64::INFINITY)
}

/// A ray of f32 numbers from `origin` towards `target`, its direction of length 1 up to rounding.
pub fn ray_towards(origin: DVec3, target: DVec3) -> Ray {
    let origin = single(origin);
    ray(origin, (target - origin).normalize())
}

/// A ray of f64 numbers from `origin` towards `target`, its direction of length 1 up to rounding.
pub fn fine_ray_towards(origin: DVec3, target: DVec3) -> Ray {
    Precision::Double.ray(origin, (target - origin).normalize(), 0.0, f64::INFINITY)
}
