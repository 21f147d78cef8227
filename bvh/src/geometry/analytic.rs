//! Primitives that are not triangles (Embree's user geometry): the interface [`Intersector`], and the closed set
//! [`AnalyticShape`] that acceleration structures store.

use glam::DVec3;

use super::distance::Distance;
use super::lanes::{HitN, RayN};
use super::simd::Doubles;
use super::spawn::SurfacePoint;
use super::{Bounds, Precision, Ray, Sphere};

/// The geometry and intersection tests of a primitive that is not a triangle.
///
/// Every test returns the least distance with `t_min < t < t_max` at which the ray meets the surface, from either
/// side, within the interval in which the ray is inside the primitive's own bounds.
pub(crate) trait Intersector: Copy {
    /// The name of the kind of shape, such as `sphere`.
    fn name(&self) -> &'static str;

    /// The smallest f32 box that holds it; not finite if its numbers are not.
    fn bounds(&self) -> Bounds;

    /// Centre and radius of a sphere that holds it. Packets cull their rays by it.
    fn bounding_sphere(&self) -> (DVec3, f64);

    /// Whether it has no points, so that every ray misses it.
    fn is_empty(&self) -> bool;

    /// The shape rounded to the precision of a tier; `None` if that is empty.
    fn rounded(&self, precision: Precision) -> Option<Self>;

    /// The shape translated by `-origin`, then scaled by `scale`.
    fn recentred(&self, origin: DVec3, scale: f64) -> Self;

    /// The test in f64.
    fn hit(&self, ray: &Ray) -> Option<f64>;

    /// The test in f32, of the tier `naive`.
    fn hit_fast(&self, ray: &Ray) -> Option<f64>;

    /// The test decided exactly, of the tier `exact`; the distance is good to [`super::exact::TOLERANCE`].
    fn hit_exact(&self, ray: &Ray) -> Option<f64>;

    /// The exact distance.
    fn exact_distance(&self, ray: &Ray) -> Option<Distance>;

    /// [`Intersector::hit`] for a ray in each lane. Undecided lanes are tested by `hit`.
    #[inline(always)]
    fn hit_n<D: Doubles>(&self, _rays: &RayN<D>) -> HitN<D> {
        HitN::UNDECIDED
    }

    /// The point of the surface nearest to `point`, and the outward unit normal there.
    fn surface(&self, point: DVec3) -> (SurfacePoint, DVec3);

    /// The area of the surface.
    fn area(&self) -> f64;

    /// The solid angle that it subtends at `from`, in steradians.
    fn solid_angle(&self, from: DVec3) -> f64;

    /// A unit direction from `from` towards the shape, uniform in its solid angle, and the distance to the surface.
    /// `numbers` are in [0, 1).
    fn sample_solid_angle(&self, from: DVec3, numbers: [f64; 2]) -> Option<(DVec3, f64)>;

    /// The derivative of the outward unit normal at a point of the surface in the direction `step` of its tangent
    /// plane.
    fn normal_derivative(&self, point: DVec3, step: DVec3) -> DVec3;
}

/// A primitive that is not a triangle; the methods are those of [`Intersector`]. Another kind of shape is another variant, and an arm of `each!`.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Methods that call those of the shape.
macro_rules! delegate {
    ($($(#[$doc:meta])* $visibility:vis fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty;)*) => {
        $($(#[$doc])*
        #[inline(always)]
        $visibility fn $name(&self, $($argument: $type),*) -> $result {
            each!(self, shape => shape.$name($($argument),*))
        })*
    };
}

impl AnalyticShape {
    /// A shape without points.
    pub(crate) const EMPTY: AnalyticShape =
        AnalyticShape::Sphere(Sphere { centre: DVec3::ZERO, radius: 0.0 });

    delegate! {
        /// The name of the kind of shape, such as `sphere`.
        pub fn name() -> &'static str;
        /// The smallest f32 box that holds it; not finite if its numbers are not.
        pub fn bounds() -> Bounds;
        /// Centre and radius of a sphere that holds it.
        pub fn bounding_sphere() -> (DVec3, f64);
        /// The point of the surface nearest to `point`, and the outward unit normal there.
        pub fn surface(point: DVec3) -> (SurfacePoint, DVec3);
        /// The derivative of the outward unit normal at a point of the surface in the direction `step` of its tangent
        /// plane.
        pub fn normal_derivative(point: DVec3, step: DVec3) -> DVec3;
        /// The area of the surface.
        pub fn area() -> f64;
        /// The solid angle that it subtends at `from`, in steradians.
        pub fn solid_angle(from: DVec3) -> f64;
        /// A unit direction from `from` towards the shape, uniform in its solid angle, and the distance to the surface.
        /// `numbers` are in [0, 1).
        pub fn sample_solid_angle(from: DVec3, numbers: [f64; 2]) -> Option<(DVec3, f64)>;
        pub(crate) fn is_empty() -> bool;
        pub(crate) fn hit(ray: &Ray) -> Option<f64>;
        pub(crate) fn hit_fast(ray: &Ray) -> Option<f64>;
        pub(crate) fn hit_exact(ray: &Ray) -> Option<f64>;
        pub(crate) fn exact_distance(ray: &Ray) -> Option<Distance>;
    }

    #[inline(always)]
    pub(crate) fn hit_n<D: Doubles>(&self, rays: &RayN<D>) -> HitN<D> {
        each!(self, shape => shape.hit_n(rays))
    }

    pub(crate) fn rounded(&self, precision: Precision) -> Option<Self> {
        each!(self, shape => shape.rounded(precision).map(Self::from))
    }

    /// The shape translated by `-origin`, then scaled by `scale`.
    pub fn recentred(&self, origin: DVec3, scale: f64) -> Self {
        each!(self, shape => shape.recentred(origin, scale).into())
    }
}

impl From<Sphere> for AnalyticShape {
    fn from(sphere: Sphere) -> Self {
        AnalyticShape::Sphere(sphere)
    }
}
