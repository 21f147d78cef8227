//! Conversion of the lights of scene files.

use glam::DVec3;
use toml::Spanned;

use crate::error::Result;
use crate::film::Colour;
use crate::import::formats::scene_file::Builder;
use crate::import::formats::scene_file::sections::{FalloffValue, LightSection, LightType};
use crate::scene::{Falloff, Light, LightKind};

/// Maximum coordinate of a light, because the square of its distance must not overflow.
const FARTHEST_LIGHT: f64 = 1e100;

/// Radii and sides of lights: their squares and reciprocal areas are finite, also times an intensity of 1e100.
const SIZES: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

/// Default cone angles of a spot in degrees, from KHR_lights_punctual.
const INNER_CONE_ANGLE: f64 = 0.0;
const OUTER_CONE_ANGLE: f64 = 45.0;

/// What a light of a type is called, where it shines from and to, and the further keys that it takes.
struct Form {
    noun: &'static str,
    placing: &'static str,
    keys: &'static [&'static str],
}

fn form_of(kind: LightType) -> Form {
    let (noun, placing, keys): (_, _, &[_]) = match kind {
        LightType::Point => ("a point light", "a `position` and no `direction`", &["position", "falloff"]),
        LightType::Directional => {
            ("a directional light", "a `direction` and no `position`", &["direction", "angle"])
        }
        LightType::Spot => (
            "a spot",
            "a `position`, and a `direction` or a point to `look_at`",
            &["position", "direction", "look_at", "inner_cone_angle", "outer_cone_angle", "falloff"],
        ),
        LightType::Sphere => ("a sphere", "a `position` and a `radius`", &["position", "radius"]),
        LightType::Rectangle => (
            "a rectangle",
            "a `position`, a `size` and a `direction` or a point to `look_at`",
            &["position", "direction", "look_at", "size", "up"],
        ),
        LightType::Disk => (
            "a disk",
            "a `position`, a `radius` and a `direction` or a point to `look_at`",
            &["position", "direction", "look_at", "radius"],
        ),
    };
    Form { noun, placing, keys }
}

impl Builder<'_> {
    /// Converts a light section; unnamed lights are named by `index`.
    pub(super) fn light(&self, index: usize, section: &Spanned<LightSection>) -> Result<Light> {
        let (start, s) = (section.span().start, section.get_ref());
        let name = s.name.clone().unwrap_or_else(|| format!("light {index}"));
        self.check_keys(start, &name, s)?;
        let falloff = match s.falloff {
            FalloffValue::None => Falloff::None,
            FalloffValue::InverseSquare => Falloff::InverseSquare { range: None },
        };
        let position = s.position.map(|position| self.light_position(start, &name, position)).transpose()?;
        let form = form_of(s.kind);
        let not_placed = || {
            let hint = format!("{} has {}", form.noun, form.placing);
            self.error(start, format!("light `{name}` is not placed"), &hint)
        };
        let direction = match (s.direction, s.look_at, position) {
            (Some(_), Some(_), _) => {
                let hint = format!("{} has either a `direction` or a point to `look_at`", form.noun);
                return Err(self.error(start, format!("light `{name}` is not placed"), &hint));
            }
            (Some(direction), ..) => Some(self.light_direction(start, "direction", direction.into())?),
            (None, Some(target), Some(position)) => {
                self.finite(start, "look_at", &target)?;
                let halved = DVec3::from(target) / 2.0 - position / 2.0;
                Some(self.light_direction(start, "look_at", halved)?)
            }
            _ => None,
        };
        let placed = |value: Option<DVec3>| value.ok_or_else(not_placed);
        let kind = match s.kind {
            LightType::Point => LightKind::Point { position: placed(position)?, falloff },
            LightType::Directional => {
                LightKind::Directional { direction: placed(direction)?, angle: self.angle(start, s)? }
            }
            LightType::Spot => {
                let (position, direction) = (placed(position)?, placed(direction)?);
                let [inner_angle, outer_angle] = self.cone(start, s)?;
                LightKind::Spot { position, direction, falloff, inner_angle, outer_angle }
            }
            LightType::Sphere => {
                let (position, radius) = (placed(position)?, s.radius.ok_or_else(not_placed)?);
                LightKind::Sphere { position, radius: self.light_size(start, "radius", radius)? }
            }
            LightType::Disk => {
                let (position, direction) = (placed(position)?, placed(direction)?);
                let radius = self.light_size(start, "radius", s.radius.ok_or_else(not_placed)?)?;
                LightKind::Disk { position, direction, radius }
            }
            LightType::Rectangle => {
                let (position, direction) = (placed(position)?, placed(direction)?);
                let [width, height] =
                    s.size.ok_or_else(not_placed)?.map(|side| self.light_size(start, "size", side));
                let up = self.light_up(start, s.up)?;
                LightKind::Rectangle { position, direction, up, size: [width?, height?] }
            }
        };
        let intensity = self.not_negative(start, "intensity", s.intensity.unwrap_or(1.0))?;
        let colour = Colour::from_u8(s.colour.map_or([255; 3], |c| c.0));
        Ok(Light { name, colour, intensity, kind })
    }

    /// Rejects keys that lights of other types have.
    fn check_keys(&self, start: usize, name: &str, s: &LightSection) -> Result<()> {
        let typed = [
            ("position", s.position.is_some()),
            ("direction", s.direction.is_some()),
            ("look_at", s.look_at.is_some()),
            ("inner_cone_angle", s.inner_cone_angle.is_some()),
            ("outer_cone_angle", s.outer_cone_angle.is_some()),
            ("angle", s.angle.is_some()),
            ("radius", s.radius.is_some()),
            ("size", s.size.is_some()),
            ("up", s.up.is_some()),
            ("falloff", s.falloff != FalloffValue::None),
        ];
        let Form { noun, placing, keys } = form_of(s.kind);
        let Some((key, _)) = typed.into_iter().find(|(key, given)| *given && !keys.contains(key)) else {
            return Ok(());
        };
        let all = [
            LightType::Point,
            LightType::Directional,
            LightType::Spot,
            LightType::Sphere,
            LightType::Rectangle,
            LightType::Disk,
        ];
        let of = all.into_iter().map(form_of).filter(|form| form.keys.contains(&key));
        let of: Vec<&str> = of.map(|form| form.noun).collect();
        let of = match of.as_slice() {
            [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
            all => all.concat(),
        };
        let hint = match key {
            "position" | "direction" => {
                let hint = format!("{noun} has {placing}");
                return Err(self.error(start, format!("light `{name}` is not placed"), &hint));
            }
            "falloff" if s.kind != LightType::Directional => {
                format!("leave it out: the light of {noun} falls with distance by itself")
            }
            _ => format!("only {of} has `{key}`: correct `type`, or leave the key out"),
        };
        Err(self.error(start, format!("light `{name}` has a `{key}`"), &hint))
    }

    fn light_position(&self, start: usize, name: &str, position: [f64; 3]) -> Result<DVec3> {
        self.finite(start, "position", &position)?;
        if position.iter().any(|c| c.abs() > FARTHEST_LIGHT) {
            let what = format!("light `{name}` is beyond 1e100");
            return Err(self.error(start, what, "give it `type = \"directional\"` and a `direction`"));
        }
        Ok(position.into())
    }

    fn light_size(&self, start: usize, key: &str, size: f64) -> Result<f64> {
        if SIZES.contains(&size) {
            return Ok(size);
        }
        let hint = "give a length from 1e-100 to 1e100; a light without size is a `point` or a `spot`";
        Err(self.error(start, format!("`{key}` holds {size}"), hint))
    }

    fn light_up(&self, start: usize, up: Option<[f64; 3]>) -> Result<DVec3> {
        let up = DVec3::from(up.unwrap_or([0.0, 1.0, 0.0]));
        self.finite(start, "up", &up.to_array())?;
        if up == DVec3::ZERO {
            return Err(self.error(start, "`up` has no length", "give it one, or leave it out"));
        }
        Ok(up)
    }

    /// The normalised value of `key`.
    fn light_direction(&self, start: usize, key: &str, direction: DVec3) -> Result<DVec3> {
        self.unit(start, key, direction)?.ok_or_else(|| {
            let (what, hint) = match key {
                "look_at" => ("`look_at` is where the light is", "give another point for it to look at"),
                _ => ("`direction` has no length", "give the direction the light travels in"),
            };
            self.error(start, what, hint)
        })
    }

    /// Apparent diameter of a directional light in radians.
    fn angle(&self, start: usize, s: &LightSection) -> Result<f64> {
        let angle = s.angle.unwrap_or(0.0);
        if (0.0..=180.0).contains(&angle) {
            return Ok(angle.to_radians());
        }
        let hint = "give the apparent diameter in degrees, from 0 to 180; that of the sun is 0.53";
        Err(self.error(start, format!("`angle` is {angle}"), hint))
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
