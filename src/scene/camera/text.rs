//! Cameras as text: a `[[camera]]` section of a scene file, or an inline table after `--camera`. Parsing the text
//! (`import::scene_file::camera`) restores the camera bit by bit. Also words of a command line.

use glam::{DVec2, DVec3};

use crate::scene::{Camera, Focus, Projection, Sensor};

/// Default name of cameras given as inline tables.
pub const INLINE_NAME: &str = "inline";

impl Camera {
    /// The `[[camera]]` section for a scene file, each line terminated by a newline.
    pub fn to_section(&self) -> String {
        let lines = self.entries(true).into_iter().map(|(key, value)| format!("{key} = {value}\n"));
        format!("[[camera]]\n{}", lines.collect::<String>())
    }

    /// The inline table for `--camera`, on one line. The name is omitted if it is [`INLINE_NAME`].
    pub fn to_inline(&self) -> String {
        let entries = self.entries(self.name != INLINE_NAME);
        let entries: Vec<String> =
            entries.into_iter().map(|(key, value)| format!("{key} = {value}")).collect();
        format!("{{ {} }}", entries.join(", "))
    }

    /// Keys and values of the camera, in the order of output.
    fn entries(&self, with_name: bool) -> Vec<(&'static str, String)> {
        let mut entries = Vec::new();
        if with_name {
            entries.push(("name", quoted(&self.name)));
        }
        entries.push(("position", list(&self.position.to_array())));
        entries.push(("look_at", list(&self.target.to_array())));
        if self.up != DVec3::Y || self.up.to_array().iter().any(|c| c.is_sign_negative()) {
            entries.push(("up", list(&self.up.to_array())));
        }
        if self.projection != Projection::default() {
            entries.push(("projection", quoted(self.projection.name())));
        }
        match (self.short_field_of_view(), self.view_width) {
            (Some(degrees), _) => entries.push(("vertical_fov", number(degrees))),
            (None, Some(width)) => {
                entries.push(("viewing_rectangle", list(&[width, self.view_height])));
                entries.push(("viewpoint_distance", number(self.viewpoint_distance)));
            }
            (None, None) => {
                entries.push(("viewing_height", number(self.view_height)));
                entries.push(("viewpoint_distance", number(self.viewpoint_distance)));
            }
        }
        if self.fitted {
            entries.push(("fitted", "true".into()));
        }
        let Sensor { shift, oblong_pixels } = self.sensor;
        if shift != DVec2::ZERO {
            entries.push(("lens_shift", list(&shift.to_array())));
        }
        if oblong_pixels {
            entries.push(("oblong_pixels", "true".into()));
        }
        if let Some(lens) = &self.lens {
            entries.push(("aperture_radius", number(lens.radius)));
            match lens.focus {
                Focus::Auto => {}
                Focus::Distance(distance) => entries.push(("focus_distance", number(distance))),
                Focus::Point(point) => entries.push(("focus_at", list(&point.to_array()))),
            }
            if lens.blades != 0 {
                entries.push(("blades", lens.blades.to_string()));
            }
            if lens.blade_rotation != 0.0 {
                entries.push(("blade_rotation", number(lens.blade_rotation)));
            }
        }
        entries
    }

    /// Vertical field of view in degrees, if it determines the viewing rectangle and its distance bit by bit and has at
    /// most six decimals.
    fn short_field_of_view(&self) -> Option<f64> {
        let radians = 2.0 * (self.view_height / (2.0 * self.viewpoint_distance)).atan();
        let degrees = (radians.to_degrees() * 1e6).round() / 1e6;
        if !(degrees > 0.0 && degrees < 180.0) {
            return None;
        }
        let again = Camera::from_field_of_view(
            String::new(),
            self.position,
            self.target,
            self.up,
            degrees.to_radians(),
        );
        let lens = |camera: &Camera| (camera.view_height, camera.view_width, camera.viewpoint_distance);
        (lens(&again) == lens(self)).then_some(degrees)
    }
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|&x| number(x)).collect();
    format!("[{}]", numbers.join(", "))
}

/// Shortest text that parses to the same number. Integers have no decimal point; large ones have an exponent, because
/// TOML integers end at 2^63.
fn number(x: f64) -> String {
    let is_whole = x.fract() == 0.0 && x.abs() < 1e15 && !(x == 0.0 && x.is_sign_negative());
    if is_whole { format!("{x}") } else { format!("{x:?}") }
}

/// A word quoted for a shell where it has to be: POSIX.1-2017, Shell Command Language, section 2.2.2, single quotes.
pub fn shell_quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A TOML basic string on one line: one of JSON, but for the control character that JSON does not escape.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string().replace('\u{7f}', "\\u007F")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_read_as_people_write_them() {
        let mut camera = Camera::from_field_of_view(
            "front \"door\"".into(),
            DVec3::new(0.0, 1.5, 6.0),
            DVec3::new(0.0, 1.0, -0.1),
            DVec3::Y,
            40f64.to_radians(),
        );
        assert_eq!(
            camera.to_section(),
            "[[camera]]\nname = \"front \\\"door\\\"\"\nposition = [0, 1.5, 6]\nlook_at = [0, 1, -0.1]\nvertical_fov = 40\n"
        );
        camera.name = INLINE_NAME.into();
        camera.projection = Projection::Orthographic;
        camera.view_height = 3.0;
        camera.viewpoint_distance = 1e20;
        assert_eq!(
            camera.to_inline(),
            "{ position = [0, 1.5, 6], look_at = [0, 1, -0.1], projection = \"orthographic\", viewing_height = 3, \
             viewpoint_distance = 1e20 }"
        );
        camera.view_width = Some(0.5);
        camera.up = -DVec3::Z;
        assert!(camera.to_inline().contains("up = [-0.0, -0.0, -1], "), "{}", camera.to_inline());
        assert!(camera.to_inline().contains("viewing_rectangle = [0.5, 3], "), "{}", camera.to_inline());
    }

    #[test]
    fn words_are_those_of_a_shell() {
        let words = ["", "a.obj", "a b", "it's"].map(shell_quoted);
        assert_eq!(words, ["''", "a.obj", "'a b'", r"'it'\''s'"]);
    }
}
