//! [`AnalyticShape`]: the primitives that are not triangles (Embree's user geometry). Each kind is a type with
//! methods of the same names.

use glam::DVec3;

use super::distance::Distance;
use super::lanes::{HitN, RayN};
use super::simd::{Doubles, Floats};
use super::spawn::SurfacePoint;
use super::{Bounds, Numerics, Precision, Ray, Side, Sphere};

/// A primitive that is not a triangle. Another kind is another variant, and an arm of `each!`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum AnalyticShape {
    /// A sphere.
    Sphere(Sphere),
}

/// Evaluates an expression for the shape of any kind.
macro_rules! each {
    ($self:expr, $shape:ident => $value:expr) => {
        match $self {
            AnalyticShape::Sphere($shape) => $value,
        }
    };
}

impl AnalyticShape {
    /// A shape without points.
    pub(crate) const EMPTY: AnalyticShape =
        AnalyticShape::Sphere(Sphere { centre: DVec3::ZERO, radius: 0.0 });

    /// Whether it is [`AnalyticShape::EMPTY`].
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::EMPTY
    }

    /// The name of the kind of shape, such as `sphere`.
    pub fn name(&self) -> &'static str {
        each!(self, shape => shape.name())
    }

    /// The smallest f32 box that holds it; not finite if its numbers are not.
    pub fn bounds(&self) -> Bounds {
        each!(self, shape => shape.bounds())
    }

    /// Centre and radius of a sphere that holds it. Packets cull their rays by it.
    #[inline(always)]
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        each!(self, shape => shape.bounding_sphere())
    }

    /// The shape rounded to the precision of a tier; `None` if that is empty.
    pub(crate) fn rounded(&self, precision: Precision) -> Option<Self> {
        each!(self, shape => shape.rounded(precision).map(Self::from))
    }

    /// The shape translated by `-origin`, then scaled by `scale`.
    pub fn recentred(&self, origin: DVec3, scale: f64) -> Self {
        each!(self, shape => shape.recentred(origin, scale).into())
    }

    /// The least distance with `t_min < t < t_max` at which the ray meets the surface, from either side, within the
    /// interval in which the ray is inside the shape's own bounds. In f32 in the tier `fast`, decided exactly and good
    /// to [`super::exact::TOLERANCE`] in `exact`, else in f64.
    #[inline(always)]
    pub(crate) fn hit(&self, ray: &Ray, numerics: Numerics) -> Option<f64> {
        each!(self, shape => shape.hit(ray, numerics))
    }

    /// [`AnalyticShape::hit`] in f64 for a ray in each lane. Undecided lanes are tested by `hit`; a new kind may leave
    /// all undecided.
    #[inline(always)]
    pub(crate) fn hit_n<D: Doubles>(&self, rays: &RayN<D>) -> HitN<D> {
        each!(self, shape => shape.hit_n(rays))
    }

    /// The rays that hit it, one in each lane, and their distances, in f32. For the tier `fast`.
    #[inline(always)]
    pub(crate) fn hit_in_f32<F: Floats>(
        &self,
        origin: &[F; 3],
        direction: &[F; 3],
        ends: [F; 2],
    ) -> (u32, F) {
        each!(self, shape => shape.hit_in_f32(origin, direction, ends))
    }

    /// See [`LineTest::cross_shape`](super::LineTest::cross_shape).
    pub(crate) fn crossings(&self, ray: &Ray) -> [Option<(f64, Side)>; 2] {
        each!(self, shape => shape.crossings(ray))
    }

    /// The exact distance at which the ray's line enters or leaves the shape.
    pub(crate) fn exact_crossing(&self, ray: &Ray, side: Side) -> Option<Distance> {
        each!(self, shape => shape.exact_crossing(ray, side))
    }

    /// The exact distance.
    pub(crate) fn exact_distance(&self, ray: &Ray) -> Option<Distance> {
        each!(self, shape => shape.exact_distance(ray))
    }

    /// The point of the surface nearest to `point`, and the outward unit normal there.
    #[inline(always)]
    pub fn surface(&self, point: DVec3) -> (SurfacePoint, DVec3) {
        each!(self, shape => shape.surface(point))
    }

    /// The derivative of the outward unit normal at a point of the surface in the direction `step` of its tangent
    /// plane.
    pub fn normal_derivative(&self, point: DVec3, step: DVec3) -> DVec3 {
        each!(self, shape => shape.normal_derivative(point, step))
    }

    /// The area of the surface.
    pub fn area(&self) -> f64 {
        each!(self, shape => shape.area())
    }

    /// The volume that it encloses.
    pub fn volume(&self) -> f64 {
        each!(self, shape => shape.volume())
    }

    /// The solid angle that it subtends at `from`, in steradians.
    pub fn solid_angle(&self, from: DVec3) -> f64 {
        each!(self, shape => shape.solid_angle(from))
    }

    /// A unit direction from `from` towards the shape, uniform in its solid angle, and the distance to the surface.
    /// `numbers` are in [0, 1).
    pub fn sample_solid_angle(&self, from: DVec3, numbers: [f64; 2]) -> Option<(DVec3, f64)> {
        each!(self, shape => shape.sample_solid_angle(from, numbers))
    }
}

impl From<Sphere> for AnalyticShape {
    fn from(sphere: Sphere) -> Self {
        AnalyticShape::Sphere(sphere)
    }
}
