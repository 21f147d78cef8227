//! Conversion of the lights of scene files.

use glam::DVec3;
use toml::Spanned;

use super::Builder;
use crate::error::Result;
use crate::film::Colour;
use crate::scene::file::{FalloffValue, LightSection, LightType};
use crate::scene::{Falloff, Light, LightKind};

/// Maximum coordinate of a light, because the square of its distance must not overflow.
const FARTHEST_LIGHT: f64 = 1e100;

/// Default cone angles of a spot in degrees, from KHR_lights_punctual.
const INNER_CONE_ANGLE: f64 = 0.0;
const OUTER_CONE_ANGLE: f64 = 45.0;

impl Builder<'_> {
    /// Converts a light section; unnamed lights are named by `index`.
    pub(super) fn light(&self, index: usize, section: &Spanned<LightSection>) -> Result<Light> {
        let (start, s) = (section.span().start, section.get_ref());
        let name = s.name.clone().unwrap_or_else(|| format!("light {index}"));
        let of_spots = [
            ("look_at", s.look_at.is_some()),
            ("inner_cone_angle", s.inner_cone_angle.is_some()),
            ("outer_cone_angle", s.outer_cone_angle.is_some()),
        ];
        if let Some((key, _)) = of_spots.into_iter().find(|(_, given)| *given && s.kind != LightType::Spot) {
            let hint = format!("only a spot has `{key}`: give it `type = \"spot\"`");
            return Err(self.error(start, format!("light `{name}` has a `{key}`"), &hint));
        }
        let not_placed = |hint| Err(self.error(start, format!("light `{name}` is not placed"), hint));
        let falloff = match s.falloff {
            FalloffValue::None => Falloff::None,
            FalloffValue::InverseSquare => Falloff::InverseSquare { range: None },
        };
        let kind = match (s.kind, s.position, s.direction) {
            (LightType::Point, Some(position), None) => {
                LightKind::Point { position: self.light_position(start, &name, position)?, falloff }
            }
            (LightType::Directional, None, Some(direction)) => LightKind::Directional {
                direction: self.light_direction(start, "direction", direction.into())?,
            },
            (LightType::Spot, Some(position), direction) => {
                let position = self.light_position(start, &name, position)?;
                let direction = match (direction, s.look_at) {
                    (Some(direction), None) => self.light_direction(start, "direction", direction.into())?,
                    (None, Some(target)) => {
                        self.finite(start, "look_at", &target)?;
                        let halved = DVec3::from(target) / 2.0 - position / 2.0;
                        self.light_direction(start, "look_at", halved)?
                    }
                    _ => return not_placed("a spot has either a `direction` or a point to `look_at`"),
                };
                let [inner_angle, outer_angle] = self.cone(start, s)?;
                LightKind::Spot { position, direction, falloff, inner_angle, outer_angle }
            }
            (LightType::Point, ..) => {
                return not_placed("a point light has a `position` and no `direction`");
            }
            (LightType::Directional, ..) => {
                return not_placed("a directional light has a `direction` and no `position`");
            }
            (LightType::Spot, ..) => {
                return not_placed("a spot has a `position`, and a `direction` or a point to `look_at`");
            }
        };
        let intensity = self.not_negative(start, "intensity", s.intensity.unwrap_or(1.0))?;
        let colour = Colour::from_u8(s.colour.map_or([255; 3], |c| c.0));
        Ok(Light { name, colour, intensity, kind })
    }

    fn light_position(&self, start: usize, name: &str, position: [f64; 3]) -> Result<DVec3> {
        self.finite(start, "position", &position)?;
        if position.iter().any(|c| c.abs() > FARTHEST_LIGHT) {
            let what = format!("light `{name}` is beyond 1e100");
            return Err(self.error(start, what, "give it `type = \"directional\"` and a `direction`"));
        }
        Ok(position.into())
    }

    /// The normalised value of `key`.
    fn light_direction(&self, start: usize, key: &str, direction: DVec3) -> Result<DVec3> {
        self.finite(start, key, &direction.to_array())?;
        // Scaling first prevents overflow and underflow of squares.
        let scaled = direction / direction.abs().max_element();
        scaled.try_normalize().ok_or_else(|| {
            let (what, hint) = match key {
                "look_at" => ("`look_at` is where the light is", "give another point for it to look at"),
                _ => ("`direction` has no length", "give the direction the light travels in"),
            };
            self.error(start, what, hint)
        })
    }

    /// Inner and outer half angle of the cone in radians.
    fn cone(&self, start: usize, s: &LightSection) -> Result<[f64; 2]> {
        let inner = s.inner_cone_angle.unwrap_or(INNER_CONE_ANGLE);
        let outer = s.outer_cone_angle.unwrap_or(OUTER_CONE_ANGLE);
        if !(outer > 0.0 && outer <= 90.0) {
            let what = format!("`outer_cone_angle` is {outer}");
            return Err(self.error(start, what, "give degrees from the axis, above 0 and at most 90"));
        }
        if !(inner >= 0.0 && inner <= outer) {
            let what = format!("`inner_cone_angle` is {inner}, and `outer_cone_angle` {outer}");
            return Err(self.error(
                start,
                what,
                "give degrees from the axis, 0 or more and at most the outer angle",
            ));
        }
        Ok([inner.to_radians(), outer.to_radians()])
    }
}
