//! [`AnalyticShape`]: the primitives that are not triangles (Embree's user geometry). Each kind is a type with
//! methods of the same names.

use glam::DVec3;

use super::disk::DiskN;
use super::distance::Distance;
use super::fast::{FastRay, One};
use super::lanes::{HitN, RayN};
use super::simd::{Doubles, Floats, Vector};
use super::spawn::SurfacePoint;
use super::sphere::SphereN;
use super::{Bounds, Disk, Numerics, Precision, PreparedRay, Ray, Side, Sphere};

/// A primitive that is not a triangle. Another kind is another variant here and of [`ShapeN`], and an arm of `each!`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum AnalyticShape {
    /// A sphere.
    Sphere(Sphere),
    /// A disk.
    Disk(Disk),
}

/// Shapes of one kind, one in each lane.
pub(crate) enum ShapeN<D> {
    /// Spheres.
    Sphere(SphereN<D>),
    /// Disks.
    Disk(DiskN<D>),
}

/// The most numbers that [`AnalyticShape::numbers`] has.
pub(crate) const SHAPE_NUMBERS: usize = 7;

/// Evaluates an expression for the shape or shapes of any kind.
macro_rules! each {
    ($self:expr, $shape:ident => $value:expr) => {
        match $self {
            Self::Sphere($shape) => $value,
            Self::Disk($shape) => $value,
        }
    };
}

impl AnalyticShape {
    /// The names of all kinds.
    pub const NAMES: [&str; 2] = ["sphere", "disk"];

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

    /// A sphere that touches or crosses the plane with the normal `out` before which all of the shape lies, and is not
    /// before it: one point if its radius is 0.
    pub fn support(&self, out: DVec3) -> (DVec3, f64) {
        each!(self, shape => shape.support(out))
    }

    /// The centre, to be moved.
    pub fn centre_mut(&mut self) -> &mut DVec3 {
        each!(self, shape => &mut shape.centre)
    }

    /// The radius, to be changed. It must stay above 0.
    pub fn radius_mut(&mut self) -> &mut f64 {
        each!(self, shape => &mut shape.radius)
    }

    /// The unit vector that gives its direction, to be changed; `None` if it looks alike from all sides.
    pub fn direction_mut(&mut self) -> Option<&mut DVec3> {
        each!(self, shape => shape.direction_mut())
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
        match numerics {
            Numerics::Fast => {
                let FastRay { origin, t_min, direction, t_max } = FastRay::new(ray);
                let ends = [One::splat(t_min), One::splat(t_max)];
                let (hit, t) = self.hit_in_f32(&origin.map(One::splat), &direction.map(One::splat), ends);
                (hit != 0).then(|| t.array()[0].into())
            }
            Numerics::Watertight | Numerics::Double => each!(self, shape => shape.hit_in_f64(ray)),
            Numerics::Exact => each!(self, shape => shape.hit_exactly(ray)),
        }
    }

    /// Whether it fills [`AnalyticShape::bounding_sphere`], so that lines which meet the one meet the other.
    pub(crate) fn is_bounding_sphere(&self) -> bool {
        each!(self, shape => shape.is_bounding_sphere())
    }

    /// The numbers that [`AnalyticShape::in_lanes`] takes.
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [f64; SHAPE_NUMBERS] {
        each!(self, shape => shape.numbers())
    }

    /// Shapes of the kind of this one, from their numbers by index.
    #[inline(always)]
    pub(crate) fn in_lanes<D: Doubles>(&self, number: impl Fn(usize) -> D) -> ShapeN<D> {
        match self {
            AnalyticShape::Sphere(_) => ShapeN::Sphere(SphereN::new(number)),
            AnalyticShape::Disk(_) => ShapeN::Disk(DiskN::new(number)),
        }
    }

    /// [`AnalyticShape::hit`] in f64 for a ray in each lane. Undecided lanes are tested by `hit`.
    #[inline(always)]
    pub(crate) fn hit_n<D: Doubles>(&self, rays: &RayN<D>) -> HitN<D> {
        let numbers = self.numbers();
        let shapes = self.in_lanes(
            #[inline(always)]
            |index| D::splat(numbers[index]),
        );
        shapes.hit(rays)
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

    /// Whether it encloses a volume.
    pub fn is_closed(&self) -> bool {
        each!(self, shape => shape.is_closed())
    }

    /// The volume that it encloses.
    pub fn volume(&self) -> f64 {
        each!(self, shape => shape.volume())
    }
}

impl<D: Doubles> ShapeN<D> {
    /// The rays that certainly miss because they start outside and lead away.
    #[inline(always)]
    pub(crate) fn behind(&self, rays: &RayN<D>) -> u32 {
        each!(self, shapes => shapes.behind(rays))
    }

    /// The hits in f64 of a ray in each lane on the shape there. Undecided lanes are tested by [`AnalyticShape::hit`];
    /// a new kind may leave all undecided.
    #[inline(always)]
    pub(crate) fn hit(&self, rays: &RayN<D>) -> HitN<D> {
        each!(self, shapes => shapes.hit(rays))
    }
}

impl From<Sphere> for AnalyticShape {
    fn from(sphere: Sphere) -> Self {
        AnalyticShape::Sphere(sphere)
    }
}

impl From<Disk> for AnalyticShape {
    fn from(disk: Disk) -> Self {
        AnalyticShape::Disk(disk)
    }
}
