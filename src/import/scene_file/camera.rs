//! Conversion of cameras of scene files and of `--camera`.

use glam::DVec3;

use super::sections::CameraSection;
use crate::error::{Error, Result};
use crate::scene::{Camera, INLINE_NAME};

/// An error in a camera and a hint.
#[derive(Debug)]
pub(crate) struct Fault {
    pub what: String,
    pub hint: &'static str,
}

impl Fault {
    fn new(what: String, hint: &'static str) -> Self {
        Fault { what, hint }
    }
}

/// Converts a camera section; `name` is the default name.
pub(crate) fn camera(section: &CameraSection, name: &str) -> std::result::Result<Camera, Fault> {
    let s = section;
    let name = s.name.clone().unwrap_or_else(|| name.to_owned());
    let up = s.up.unwrap_or([0.0, 1.0, 0.0]);
    for (key, values) in [("position", &s.position), ("look_at", &s.look_at), ("up", &up)] {
        if let Some(v) = values.iter().find(|v| !v.is_finite()) {
            return Err(Fault::new(format!("`{key}` holds {v}"), "give a finite number"));
        }
    }
    let (position, target, up) = (DVec3::from(s.position), DVec3::from(s.look_at), DVec3::from(up));
    if position == target {
        return Err(Fault::new(format!("camera `{name}` looks at itself"), "move `look_at` or `position`"));
    }
    if up == DVec3::ZERO {
        let hint = "give `up` a length, or leave it out";
        return Err(Fault::new(format!("camera `{name}` has no up"), hint));
    }
    let rectangle = match (s.viewing_rectangle, s.viewing_height) {
        (Some([width, height]), None) => Some((Some(width), height)),
        (None, Some(height)) => Some((None, height)),
        _ => None,
    };
    let is_one_at_most = s.viewing_rectangle.is_none() || s.viewing_height.is_none();
    match (rectangle, s.viewpoint_distance, s.vertical_fov) {
        (Some((width, height)), Some(distance), None) => {
            if [width.unwrap_or(1.0), height, distance].iter().any(|&x| !(x > 0.0 && x.is_finite())) {
                let what = format!("camera `{name}` has a viewing rectangle or distance that is not above 0");
                let hint = "give `viewing_rectangle` or `viewing_height`, and `viewpoint_distance`, above 0";
                return Err(Fault::new(what, hint));
            }
            Ok(Camera {
                name,
                position,
                target,
                up,
                projection: s.projection,
                view_height: height,
                view_width: width,
                viewpoint_distance: distance,
            })
        }
        (None, None, fov) if is_one_at_most => {
            let degrees = fov.unwrap_or(40.0);
            if !(degrees > 0.0 && degrees < 180.0) {
                let what = format!("camera `{name}` has a field of view of {degrees} degrees");
                return Err(Fault::new(what, "give `vertical_fov` above 0 and below 180"));
            }
            let camera = Camera::from_field_of_view(name, position, target, up, degrees.to_radians());
            Ok(Camera { projection: s.projection, ..camera })
        }
        _ => {
            let what = format!("camera `{name}` says too much or too little of its lens");
            let hint = "give `viewing_rectangle` or `viewing_height` with `viewpoint_distance`, or `vertical_fov` alone";
            Err(Fault::new(what, hint))
        }
    }
}

/// Parses an inline camera with the keys of `[[camera]]`: `{ position = [0, 0, 5], look_at = [0, 0, 0] }`.
///
/// # Errors
/// [`Error::Usage`] if it is invalid.
pub fn inline_camera(text: &str) -> Result<Camera> {
    let section = CameraSection::parse_inline(text)
        .map_err(|(what, hint)| Error::usage(format!("--camera {{...}} is not valid: {what}"), hint))?;
    camera(&section, INLINE_NAME).map_err(|fault| Error::usage(fault.what, fault.hint))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use crate::import::SceneFile;
    use crate::scene::Projection;

    fn back(camera: &Camera) -> [Camera; 2] {
        let section = camera.to_section();
        let file =
            SceneFile::parse(&section, Path::new("a.toml")).unwrap_or_else(|e| panic!("{e}: {section}"));
        assert_eq!(file.camera.len(), 1, "{section}");
        let of_file = super::camera(file.camera[0].get_ref(), "none").expect("a camera");
        [
            of_file,
            inline_camera(&camera.to_inline()).unwrap_or_else(|e| panic!("{e}: {}", camera.to_inline())),
        ]
    }

    /// Distinguishes 0 from -0, which compare equal.
    fn bits(camera: &Camera) -> String {
        format!("{camera:?}")
    }

    /// Numbers of all magnitudes, and short decimal numbers.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            3 => prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
            1 => -1000.0..1000.0,
            1 => (-1000i32..1000).prop_map(f64::from),
            1 => prop::sample::select(vec![1e300, 1e15, 1e16, 9_007_199_254_740_993.0, 1e-5, 1e-300, 5e-324, f64::MAX]),
        ]
    }

    fn above_zero() -> impl Strategy<Value = f64> {
        number().prop_map(f64::abs).prop_filter("above 0", |&x| x > 0.0)
    }

    fn point() -> impl Strategy<Value = DVec3> {
        [number(), number(), number()].prop_map(DVec3::from)
    }

    fn any_camera() -> impl Strategy<Value = Camera> {
        let up = prop_oneof![Just(DVec3::Y), point()].prop_filter("has a length", |&up| up != DVec3::ZERO);
        let lens = (above_zero(), prop::option::of(above_zero()), above_zero());
        let name = prop_oneof!["[a-z]{0,8}", any::<String>(), Just(INLINE_NAME.to_owned())];
        (name, point(), point(), up, any::<bool>(), lens).prop_filter_map(
            "looks somewhere",
            |(name, position, target, up, parallel, (view_height, view_width, viewpoint_distance))| {
                let projection = if parallel { Projection::Orthographic } else { Projection::Perspective };
                let camera = Camera {
                    name,
                    position,
                    target,
                    up,
                    projection,
                    view_height,
                    view_width,
                    viewpoint_distance,
                };
                (position != target).then_some(camera)
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_printed_is_read_back_to_the_bit(camera in any_camera()) {
            for read in back(&camera) {
                prop_assert_eq!(bits(&read), bits(&camera));
            }
        }

        #[test]
        fn an_angle_is_read_back_too(
            position in [-1e3..1e3, -1e3..1e3, -1e3..1e3], target in [-1e3..1e3, -1e3..1e3, -1e3..1e3],
            degrees in prop_oneof![(1i32..180).prop_map(f64::from), 0.001..179.9],
        ) {
            let camera = Camera::from_field_of_view(
                "c".into(), position.into(), target.into(), DVec3::Y, degrees.to_radians());
            for read in back(&camera) {
                prop_assert_eq!(bits(&read), bits(&camera));
            }
        }
    }

    #[test]
    fn an_inline_camera_says_what_is_wrong_with_it() {
        for (text, what, hint) in [
            ("{ position = [0, 0, 5], look_at = [0, 0, 0], fov = 3 }", "unknown key `fov`", "known here"),
            (
                "{ positon = [0, 0, 5], look_at = [0, 0, 0] }",
                "unknown key `positon`",
                "did you mean `position`?",
            ),
            ("{ position = [0, 0, 5] }", "missing key `look_at`", ""),
            ("{ position = [0, 0, 5]", "--camera {...} is not valid: ", ""),
            ("{ position = [0, 0], look_at = [0, 0, 5] }", "--camera {...} is not valid: ", ""),
            ("{ position = [0, 0, 1], look_at = [0, 0, 5] } [[sphere]]", "--camera {...} is not valid: ", ""),
            (
                "{ position = [0, 0, 1], look_at = [0, 0, 5], viewing_height = 3 }",
                "too much or too little of its lens",
                "`viewing_height`",
            ),
        ] {
            let e = inline_camera(text).expect_err(text);
            assert!(e.to_string().contains(what) && !e.to_string().contains('\n'), "{text}: {e}");
            assert!(e.hint().contains(hint) && !e.hint().contains('\n'), "{text}: {}", e.hint());
            assert!(matches!(e, Error::Usage { .. }), "{text}");
        }
    }
}
