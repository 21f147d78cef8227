//! Transforms of instanced meshes, random with fixed seeds.

use glam::{DMat4, DQuat, DVec3};
use kiln::scene::{Placement, Step};

use super::Numbers;

/// What is done to a mesh for its places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Family {
    /// Moved by multiples of a power of two.
    Rows,
    /// Turned, scaled evenly, mirrored now and then.
    Turned,
    /// Scaled by another factor along each axis, before and after it is turned.
    Skewed,
    /// A thousand sizes away from the origin.
    Far,
    /// From 1e-6 to 1e6 in size.
    Scales,
    /// As thin as 1e-9 of its size, turned before that or after.
    Squeezed,
    /// So far away that f32 has a few dozen places for it: most triangles are lines, many the same.
    Lost,
    /// Through a node and a placement, and then brought into range.
    Steps,
}

/// All of them.
pub const FAMILIES: [Family; 8] = [
    Family::Rows,
    Family::Turned,
    Family::Skewed,
    Family::Far,
    Family::Scales,
    Family::Squeezed,
    Family::Lost,
    Family::Steps,
];

impl Family {
    /// One of its places.
    pub fn place(self, i: usize, numbers: &mut Numbers) -> Placement {
        let rotation = DQuat::from_axis_angle(numbers.direction(), numbers.signed() * 4.0);
        let at = numbers.vector() * 4.0;
        let sign = if i.is_multiple_of(3) { -1.0 } else { 1.0 };
        let even = DVec3::new(sign, 1.0, 1.0) * (0.2 + numbers.unit());
        let axes = DVec3::from([(); 3].map(|()| 10f64.powf(numbers.signed())));
        let turned = DMat4::from_scale_rotation_translation(even, rotation, at);
        Placement::new(match self {
            Family::Rows => {
                DMat4::from_translation(DVec3::new((i % 4) as f64, (i / 4) as f64, (i % 3) as f64) * 1.5)
            }
            Family::Turned => turned,
            Family::Skewed if i.is_multiple_of(2) => {
                DMat4::from_scale_rotation_translation(axes, rotation, at)
            }
            Family::Skewed => {
                DMat4::from_translation(at) * DMat4::from_scale(axes) * DMat4::from_quat(rotation)
            }
            Family::Far => DMat4::from_translation(DVec3::new(1e3, -2e3, 5e2)) * turned,
            Family::Squeezed => {
                let thin = DMat4::from_scale(DVec3::new(1.0, 1.0, 10f64.powi(-(i as i32 % 10))));
                if i.is_multiple_of(2) { turned * thin } else { DMat4::from_translation(at) * thin * turned }
            }
            Family::Lost => DMat4::from_translation(DVec3::splat(3e5)) * turned,
            Family::Scales => {
                let size = 10f64.powi(i as i32 % 13 - 6);
                DMat4::from_scale_rotation_translation(even * size, rotation, at * size)
            }
            Family::Steps => {
                let mut placement = Placement::new(turned);
                placement.then(Step::Affine(DMat4::from_rotation_z(0.3)));
                placement.then(Step::Shift { middle: DVec3::new(0.1, 0.2, 0.3), scale: 4.0 });
                return placement;
            }
        })
    }
}
