//! [`Ground`]: a square under a scene that has none.

use glam::DVec3;

use super::Camera;

/// Half the side of the square, in radii of the scene.
const REACH: f64 = 20.0;

/// How far the ground is below the lowest point, in radii of the scene: so that rounding does not mix it with a surface
/// of the scene that lies in the same plane. A recentered scene reaches some 30 radii from the origin, where f32 has
/// steps of 2^-19.
const GAP: f64 = 1.0 / 65_536.0;

/// The albedo of a ground that is asked for.
const ALBEDO: f64 = 0.5;

/// A horizontal grey square under a scene: not one of its objects, so that cameras are not fitted to it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ground {
    /// Its centre.
    pub centre: DVec3,
    /// Half its side.
    pub half_side: f64,
    /// Its albedo, of all channels.
    pub albedo: f64,
    /// Whether it is left out where the camera is not above it: [`Ground::is_hidden_from`].
    pub is_hidden_from_below: bool,
    /// Whether it shows its shadows alone before a backdrop ([`super::DefaultLook::has_backdrop`]), not its surface.
    // Hashed where it does not, so that grounds of the default look keep their fingerprints.
    #[serde(skip_serializing_if = "bool::clone")]
    pub catches_shadows: bool,
}

/// A ground that is asked for, without a size.
impl Default for Ground {
    fn default() -> Self {
        Ground {
            centre: DVec3::ZERO,
            half_side: 0.0,
            albedo: ALBEDO,
            is_hidden_from_below: false,
            catches_shadows: false,
        }
    }
}

impl Ground {
    /// Whether a camera does not see it.
    pub fn is_hidden_from(&self, camera: &Camera) -> bool {
        self.is_hidden_from_below && camera.position.y <= self.centre.y
    }

    /// This ground under a bounding box, whose radius is half its diagonal. `None` for a box without size.
    pub fn under(self, (min, max): (DVec3, DVec3)) -> Option<Self> {
        let (middle, radius) = (min / 2.0 + max / 2.0, (max / 2.0 - min / 2.0).length());
        let centre = DVec3::new(middle.x, min.y - GAP * radius, middle.z);
        let ground = Ground { centre, half_side: REACH * radius, ..self };
        (radius > 0.0 && ground.half_side.is_finite()).then_some(ground)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 2 by 4 by 4 has the radius 3.
    #[test]
    fn the_ground_is_under_the_box() {
        let bounds = (DVec3::new(1.0, -5.0, 0.0), DVec3::new(3.0, -1.0, 4.0));
        let ground = Ground::default().under(bounds).unwrap();
        assert_eq!((ground.centre.x, ground.centre.z, ground.half_side), (2.0, 2.0, 60.0));
        assert!(ground.centre.y < -5.0 && ground.centre.y > -5.001);
    }

    #[test]
    fn a_point_has_no_ground() {
        for (min, max) in [(DVec3::ONE, DVec3::ONE), (-DVec3::MAX, DVec3::MAX), (DVec3::NAN, DVec3::ONE)] {
            assert_eq!(Ground::default().under((min, max)), None);
        }
    }
}
