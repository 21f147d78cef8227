//! [`Point`]: what queries take as a point or a direction.

use std::borrow::Cow;

use glam::{DVec3, Vec3};

/// A point or a direction: `DVec3`, `Vec3`, `[f64; 3]` or `[f32; 3]`. Of coordinates one after the other,
/// `numbers.as_chunks().0` is a slice of points, and of indices one of triangles.
pub trait Point: Copy + Send + Sync {
    /// Its coordinates.
    fn to_dvec3(self) -> DVec3;

    /// The coordinates of a slice, which are copied unless they are stored as such.
    fn all(points: &[Self]) -> Cow<'_, [DVec3]> {
        points.iter().map(|point| point.to_dvec3()).collect()
    }
}

impl Point for DVec3 {
    #[inline]
    fn to_dvec3(self) -> DVec3 {
        self
    }

    fn all(points: &[Self]) -> Cow<'_, [DVec3]> {
        points.into()
    }
}

impl Point for [f64; 3] {
    #[inline]
    fn to_dvec3(self) -> DVec3 {
        self.into()
    }

    fn all(points: &[Self]) -> Cow<'_, [DVec3]> {
        bytemuck::cast_slice::<_, DVec3>(points).into()
    }
}

impl Point for Vec3 {
    #[inline]
    fn to_dvec3(self) -> DVec3 {
        self.as_dvec3()
    }
}

impl Point for [f32; 3] {
    #[inline]
    fn to_dvec3(self) -> DVec3 {
        Vec3::from(self).as_dvec3()
    }
}
