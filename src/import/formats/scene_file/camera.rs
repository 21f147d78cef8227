//! Conversion of cameras of scene files and of `--camera`.

use glam::{DMat3, DMat4, DVec2, DVec3};

use crate::error::{Error, Result};
use crate::import::formats::scene_file::fault::{Fault, parse_inline};
use crate::import::formats::scene_file::sections::{Axes, CameraSection, IntrinsicMatrix, LensSection};
use crate::scene::camera::lens::{field_of_view, radius_of};
use crate::scene::{Camera, Focus, INLINE_NAME, Intrinsics, Lens, Projection, Sensor};

/// Converts a camera section; `name` is the default name, `size` that of the picture, where one is set.
pub(crate) fn camera(
    section: &CameraSection,
    name: &str,
    size: Option<[u32; 2]>,
) -> std::result::Result<Camera, Fault> {
    let s = section;
    let name = s.name.clone().unwrap_or_else(|| name.to_owned());
    let [position, target, up] = orientation(s, &name)?;
    let lens_shift = DVec2::from(s.lens_shift.unwrap_or_default());
    if !lens_shift.is_finite() {
        return Err(Fault::new("`lens_shift` is not finite", "give two shares of the rectangle"));
    }
    let sensor = Sensor { shift: lens_shift, oblong_pixels: s.oblong_pixels };
    let rectangle = match (s.viewing_rectangle, s.viewing_height) {
        (Some([width, height]), None) => Some((Some(width), height)),
        (None, Some(height)) => Some((None, height)),
        _ => None,
    };
    let is_one_at_most = s.viewing_rectangle.is_none() || s.viewing_height.is_none();
    let fov = match (s.vertical_fov, s.focal_length) {
        (None, Some(millimetres)) => Some(field_of_view(millimetres)),
        (degrees, _) => degrees.map(f64::to_radians),
    };
    let is_one_at_most = is_one_at_most && (s.vertical_fov.is_none() || s.focal_length.is_none());
    let intrinsics = intrinsics(s, &name, size)?;
    let camera = match (rectangle, s.viewpoint_distance, fov) {
        (None, None, None) if is_one_at_most && let Some(intrinsics) = intrinsics => {
            let (rectangle, sensor) = intrinsics.rectangle();
            Camera {
                name,
                position,
                target,
                up,
                projection: s.projection,
                view_height: rectangle.y,
                view_width: Some(rectangle.x),
                viewpoint_distance: 1.0,
                lens: None,
                sensor,
                fitted: false,
            }
        }
        (Some((width, height)), Some(distance), None) if intrinsics.is_none() => {
            if [width.unwrap_or(1.0), height, distance].iter().any(|&x| !(x > 0.0 && x.is_finite())) {
                let what = format!("camera `{name}` has a viewing rectangle or distance that is not above 0");
                let hint = "give `viewing_rectangle` or `viewing_height`, and `viewpoint_distance`, above 0";
                return Err(Fault::new(what, hint));
            }
            Camera {
                name,
                position,
                target,
                up,
                projection: s.projection,
                view_height: height,
                view_width: width,
                viewpoint_distance: distance,
                lens: None,
                sensor,
                fitted: false,
            }
        }
        (None, None, fov) if is_one_at_most && intrinsics.is_none() => {
            let fov = fov.unwrap_or(40f64.to_radians());
            if !(fov > 0.0 && fov < std::f64::consts::PI) {
                let what =
                    format!("camera `{name}` has a field of view of {} degrees", fov.to_degrees() as f32);
                return Err(Fault::new(
                    what,
                    "give `vertical_fov` above 0 and below 180, or `focal_length` above 0",
                ));
            }
            let camera = Camera::from_field_of_view(name, position, target, up, fov);
            Camera { projection: s.projection, sensor, ..camera }
        }
        _ => {
            let what = format!("camera `{name}` says too much or too little of its lens");
            let hint = "give `viewing_rectangle` or `viewing_height` with `viewpoint_distance`, or `vertical_fov` alone, or \
                        `focal_length` alone, or `K` alone";
            return Err(Fault::new(what, hint));
        }
    };
    let lens = lens(&s.lens(), &camera)?;
    Ok(Camera { lens, fitted: s.fitted, ..camera })
}

/// Position, target and up vector.
fn orientation(s: &CameraSection, name: &str) -> std::result::Result<[DVec3; 3], Fault> {
    let (position, target, up) = match (s.pose, s.axes) {
        (Some(pose), axes) => {
            if s.position.is_some() || s.look_at.is_some() || s.up.is_some() {
                let what = format!("camera `{name}` has a `pose`, and `position`, `look_at` or `up`");
                return Err(Fault::new(what, "leave out `position`, `look_at` and `up`"));
            }
            return of_pose(pose, axes, name);
        }
        (None, Some(_)) => {
            let what = format!("camera `{name}` has `axes`, but no `pose`");
            return Err(Fault::new(what, "leave them out, or give `pose`"));
        }
        (None, None) => {
            let missing = |key: &str| Fault::new(format!("missing key `{key}`"), "give it, or a `pose`");
            let position = s.position.ok_or_else(|| missing("position"))?;
            (position, s.look_at.ok_or_else(|| missing("look_at"))?, s.up.unwrap_or([0.0, 1.0, 0.0]))
        }
    };
    for (key, values) in [("position", &position), ("look_at", &target), ("up", &up)] {
        if let Some(v) = values.iter().find(|v| !v.is_finite()) {
            return Err(Fault::new(format!("`{key}` holds {v}"), "give a finite number"));
        }
    }
    if position == target {
        return Err(Fault::new(format!("camera `{name}` looks at itself"), "move `look_at` or `position`"));
    }
    if up == [0.0; 3] {
        let hint = "give `up` a length, or leave it out";
        return Err(Fault::new(format!("camera `{name}` has no up"), hint));
    }
    Ok([position, target, up].map(DVec3::from))
}

/// How far lengths and products of the axes of a pose may be from those of a rotation: rotations of data sets have few
/// decimals.
const ROTATION_ERROR: f64 = 1e-3;

/// Position, target and up vector of a pose.
fn of_pose(rows: [[f64; 4]; 4], axes: Option<Axes>, name: &str) -> std::result::Result<[DVec3; 3], Fault> {
    let fault = |what: &str, hint| Err(Fault::new(format!("the `pose` of camera `{name}` {what}"), hint));
    let Some(axes) = axes else {
        let hint = "give `axes = \"opencv\"` (y down, z ahead) or `axes = \"opengl\"` (y up, z backwards)";
        return fault("has no `axes`", hint);
    };
    let pose = DMat4::from_cols_array_2d(&rows).transpose();
    let [right, y, z, position] =
        [pose.x_axis, pose.y_axis, pose.z_axis, pose.w_axis].map(|column| column.truncate());
    let products = DMat3::from_cols(right, y, z).transpose() * DMat3::from_cols(right, y, z);
    let is_rotation = (products - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() <= ROTATION_ERROR)
        && right.cross(y).dot(z) > 0.0;
    if !pose.is_finite() || !is_rotation || rows[3] != [0.0, 0.0, 0.0, 1.0] {
        let hint =
            "give rows of a rotation without scale or mirror, a position, and 0, 0, 0, 1: world from camera";
        return fault("is no rotation and position", hint);
    }
    let (up, ahead) = match axes {
        Axes::OpenCv => (-y, z),
        Axes::OpenGl => (y, -z),
    };
    // As far away as the position is from the origin, so that the direction keeps its precision.
    let distance = position.abs().max_element().max(1.0);
    Ok([position, position + ahead * distance, up])
}

/// The intrinsic matrix, if there is one.
fn intrinsics(
    s: &CameraSection,
    name: &str,
    size: Option<[u32; 2]>,
) -> std::result::Result<Option<Intrinsics>, Fault> {
    let fault = |what: &str, hint| Err(Fault::new(format!("camera `{name}` {what}"), hint));
    let Some(matrix) = s.intrinsics else {
        return match s.image_size {
            Some(_) => {
                fault("has an `image_size`, but no `K`", "leave it out; `[image]` has the picture's size")
            }
            None => Ok(None),
        };
    };
    let [fx, fy, cx, cy] = match matrix {
        IntrinsicMatrix::Numbers(numbers) => numbers,
        IntrinsicMatrix::Rows([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]) => [fx, fy, cx, cy],
        IntrinsicMatrix::Rows(_) => {
            let hint = "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; remove skew from the pictures beforehand";
            return fault("has a `K` that is no intrinsic matrix without skew", hint);
        }
    };
    if [fx, fy].iter().any(|&f| !(f > 0.0 && f.is_finite())) || !(cx.is_finite() && cy.is_finite()) {
        return fault("has an unusable `K`", "give finite numbers, focal lengths above 0");
    }
    if s.lens_shift.is_some() || s.oblong_pixels || s.projection != Projection::Perspective {
        let hint = "leave out `lens_shift`, `oblong_pixels` and `projection`";
        return fault("has a `K`, which says where the middle is and that it is a pinhole", hint);
    }
    let Some(size) = s.image_size.or(size).filter(|size| !size.contains(&0)) else {
        return fault("has a `K` for a picture of unknown size", "give `image_size = [WIDTH, HEIGHT]`");
    };
    Ok(Some(Intrinsics { focal: DVec2::new(fx, fy), principal: DVec2::new(cx, cy), size }))
}

/// Converts the keys of the lens of a camera; `None` where none is given.
pub(crate) fn lens(section: &LensSection, camera: &Camera) -> std::result::Result<Option<Lens>, Fault> {
    let LensSection { aperture_radius, f_stop, focus_distance, focus_at, blades, blade_rotation } = *section;
    let fault = |what: &str, hint| Err(Fault::new(format!("camera `{}` {what}", camera.name), hint));
    let radius = match (aperture_radius, f_stop) {
        (Some(_), Some(_)) => return fault("has two apertures", "give `aperture_radius` or `f_stop`"),
        (radius, None) => radius.unwrap_or(0.0),
        (None, Some(number)) if number.is_nan() || number <= 0.0 => {
            return fault("has no f-number", "give `f_stop` above 0");
        }
        (None, Some(number)) => radius_of(number, camera.view_height / camera.viewpoint_distance),
    };
    let focus = match (focus_distance, focus_at) {
        (Some(_), Some(_)) => return fault("focuses twice", "give `focus_distance` or `focus_at`"),
        (Some(distance), None) => Focus::Distance(distance),
        (None, Some(point)) => Focus::Point(point.into()),
        (None, None) => Focus::Auto,
    };
    let blade_rotation = blade_rotation.unwrap_or(0.0);
    if !(radius >= 0.0 && radius.is_finite()) {
        return fault("has an unusable aperture", "give a finite `aperture_radius`, 0 or more, or `f_stop`");
    }
    let is_usable = focus_distance.is_none_or(|distance| distance > 0.0 && distance.is_finite())
        && focus_at.is_none_or(|point| point.iter().all(|c| c.is_finite()));
    if !is_usable {
        return fault("has an unusable focus", "give a finite `focus_distance` above 0, or `focus_at`");
    }
    if matches!(blades, Some(1 | 2)) || !blade_rotation.is_finite() {
        return fault(
            "has no shape of an aperture",
            "give `blades` of 3 or more, or 0, and a finite `blade_rotation`",
        );
    }
    if radius > 0.0 && !camera.projection.has_lens() {
        return fault(
            "has an aperture, which only perspective cameras have",
            "leave out the aperture, or give `projection = \"perspective\"`",
        );
    }
    let lens = Lens { radius, focus, blades: blades.unwrap_or(0), blade_rotation };
    let is_given = aperture_radius.or(f_stop).or(focus_distance).is_some() || lens != Lens::default();
    Ok(is_given.then_some(lens))
}

/// Parses an inline camera with the keys of `[[camera]]`: `{ position = [0, 0, 5], look_at = [0, 0, 0] }`. `size` is that
/// of the picture, where one is set.
///
/// # Errors
/// [`Error::Usage`] if it is invalid.
pub fn inline_camera(text: &str, size: Option<[u32; 2]>) -> Result<Camera> {
    let section = parse_inline(text).map_err(|Fault { what, hint }| {
        Error::usage(format!("--camera {{...}} is not valid: {what}"), hint)
    })?;
    camera(&section, INLINE_NAME, size).map_err(|fault| Error::usage(fault.what, fault.hint))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use crate::import::SceneFile;

    fn back(camera: &Camera) -> [Camera; 2] {
        let section = camera.to_section();
        let file =
            SceneFile::parse(&section, Path::new("a.toml")).unwrap_or_else(|e| panic!("{e}: {section}"));
        assert_eq!(file.camera.len(), 1, "{section}");
        let of_file = super::camera(file.camera[0].get_ref(), "none", None).expect("a camera");
        [
            of_file,
            inline_camera(&camera.to_inline(), None)
                .unwrap_or_else(|e| panic!("{e}: {}", camera.to_inline())),
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

    fn any_lens() -> impl Strategy<Value = Option<Lens>> {
        let focus = prop_oneof![
            Just(Focus::Auto),
            above_zero().prop_map(Focus::Distance),
            point().prop_map(Focus::Point),
        ];
        let blades = prop_oneof![Just(0u32), 3..u32::MAX];
        let lens = (number().prop_map(f64::abs), focus, blades, number());
        prop::option::of(lens.prop_map(|(radius, focus, blades, rotation)| {
            // A rotation by -0 is not printed.
            Lens { radius, focus, blades, blade_rotation: rotation + 0.0 }
        }))
    }

    fn any_camera() -> impl Strategy<Value = Camera> {
        let up = prop_oneof![Just(DVec3::Y), point()].prop_filter("has a length", |&up| up != DVec3::ZERO);
        let rectangle = (above_zero(), prop::option::of(above_zero()), above_zero());
        let name = prop_oneof!["[a-z]{0,8}", any::<String>(), Just(INLINE_NAME.to_owned())];
        let shift = prop_oneof![Just([0.0; 2]), [number(), number()]];
        let sensor = (shift, any::<bool>())
            .prop_map(|(shift, oblong_pixels)| Sensor { shift: DVec2::from(shift) + 0.0, oblong_pixels });
        let optics = (rectangle, any_lens(), sensor, any::<bool>());
        (name, point(), point(), up, any::<bool>(), optics).prop_filter_map(
            "looks somewhere",
            |(name, position, target, up, parallel, (rectangle, lens, sensor, fitted))| {
                let (view_height, view_width, viewpoint_distance) = rectangle;
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
                    lens: lens.map(|lens| Lens { radius: if parallel { 0.0 } else { lens.radius }, ..lens }),
                    sensor,
                    fitted,
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

    /// On a film of 24 mm height: 24 mm see 1 high at a distance of 1, and f/2 has an aperture of 12 mm.
    #[test]
    fn millimetres_and_f_numbers_are_those_of_full_frame_film() {
        let text = "{ position = [0, 0, 5], look_at = [0, 0, 0], focal_length = 24, f_stop = 2, focus_distance = 3 }";
        let camera = inline_camera(text, None).expect("a camera");
        assert!((camera.view_height / camera.viewpoint_distance - 1.0).abs() < 1e-15, "{camera:?}");
        let lens = camera.lens.expect("a lens");
        assert!((lens.radius / 0.006 - 1.0).abs() < 1e-15, "{lens:?}");
        assert_eq!((lens.focus, lens.blades), (Focus::Distance(3.0), 0));
    }

    /// A pose of OpenCV looks along its third column, with the second down; of OpenGL against the third, with the second up.
    /// Both here look along +x from (1, 2, 3) with +z up.
    #[test]
    fn poses_have_the_axes_that_are_named() {
        for (pose, axes) in [
            ("[[0, 0, 1, 1], [-1, 0, 0, 2], [0, -1, 0, 3], [0, 0, 0, 1]]", "opencv"),
            ("[[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]", "opengl"),
        ] {
            let text =
                format!("{{ pose = {pose}, axes = '{axes}', K = [2, 4, 0.5, 1], image_size = [4, 8] }}");
            let camera = inline_camera(&text, None).expect("a camera");
            let ahead = (camera.target - camera.position).normalize();
            assert_eq!((camera.position, ahead, camera.up), (DVec3::new(1.0, 2.0, 3.0), DVec3::X, DVec3::Z));
            // 4 pixels of 1 / 2, 8 of 1 / 4; the middle, (1.5, 3.5), is right of and below the principal point.
            assert_eq!(
                (camera.view_width, camera.view_height, camera.viewpoint_distance),
                (Some(2.0), 2.0, 1.0)
            );
            let shift = DVec2::new(1.0 / 4.0, -2.5 / 8.0);
            assert_eq!(camera.sensor, Sensor { shift, oblong_pixels: true });
            let of_rows = text.replace("[2, 4, 0.5, 1]", "[[2, 0, 0.5], [0, 4, 1], [0, 0, 1]]");
            let of_picture = of_rows.replace(", image_size = [4, 8]", "");
            assert_eq!(inline_camera(&of_rows, Some([1, 1])).expect("a camera"), camera);
            assert_eq!(inline_camera(&of_picture, Some([4, 8])).expect("a camera"), camera);
        }
    }

    #[test]
    fn intrinsics_and_poses_say_what_is_wrong_with_them() {
        const POSE: &str = "pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
        const MIRROR: &str =
            "pose = [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], axes = 'opencv'";
        let at = |keys: &str| format!("position = [0, 0, 5], look_at = [0, 0, 0], {keys}");
        for (keys, what, hint) in [
            (POSE.into(), "no `axes`", "opencv"),
            (MIRROR.into(), "no rotation", "mirror"),
            (MIRROR.replace("-1", "2"), "no rotation", "scale"),
            (at(POSE), "has a `pose`, and", "leave out"),
            (at("axes = 'opengl'"), "no `pose`", "leave them out"),
            (at("K = [9, 9, 5, 5]"), "unknown size", "image_size"),
            (at("K = [0, 9, 5, 5], image_size = [9, 9]"), "unusable `K`", "above 0"),
            (at("K = [[9, 1, 5], [0, 9, 5], [0, 0, 1]], image_size = [9, 9]"), "without skew", "skew"),
            (at("K = [9, 9, 5, 5], image_size = [9, 9], vertical_fov = 40"), "too much", "`K` alone"),
            (
                at("K = [9, 9, 5, 5], image_size = [9, 9], lens_shift = [0, 0]"),
                "where the middle is",
                "lens_shift",
            ),
            (at("image_size = [9, 9]"), "no `K`", "leave it out"),
            (at("lens_shift = [inf, 0]"), "not finite", "shares"),
        ] {
            let e = inline_camera(&format!("{{ {keys} }}"), None).expect_err(&keys);
            assert!(e.to_string().contains(what), "{keys}: {e}");
            assert!(e.hint().contains(hint), "{keys}: {}", e.hint());
        }
    }

    #[test]
    fn a_lens_says_what_is_wrong_with_it() {
        for (keys, what, hint) in [
            ("aperture_radius = 1, f_stop = 2", "two apertures", "`aperture_radius` or `f_stop`"),
            ("aperture_radius = -1", "unusable aperture", "0 or more"),
            ("f_stop = 0", "no f-number", "above 0"),
            ("focus_distance = 1, focus_at = [0, 0, 0]", "focuses twice", "`focus_distance` or `focus_at`"),
            ("focus_distance = 0", "unusable focus", "above 0"),
            ("focus_at = [0, inf, 0]", "unusable focus", "finite"),
            ("aperture_radius = 1, blades = 2", "no shape of an aperture", "3 or more"),
            ("blade_rotation = nan", "no shape of an aperture", "finite"),
            ("aperture_radius = 1, projection = 'orthographic'", "only perspective", "perspective"),
            ("focal_length = 0", "a field of view of 180 degrees", "`focal_length` above 0"),
            ("focal_length = 50, vertical_fov = 40", "too much or too little", "`focal_length` alone"),
        ] {
            let text = format!("{{ position = [0, 0, 5], look_at = [0, 0, 0], {keys} }}");
            let e = inline_camera(&text, None).expect_err(&text);
            assert!(e.to_string().contains(what) && !e.to_string().contains('\n'), "{text}: {e}");
            assert!(e.hint().contains(hint) && !e.hint().contains('\n'), "{text}: {}", e.hint());
        }
    }

    #[test]
    fn an_inline_camera_says_what_is_wrong_with_it() {
        for (text, what, hint) in [
            ("{ position = [0, 0, 5], look_at = [0, 0, 0], zoom = 3 }", "unknown key `zoom`", "known here"),
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
            let e = inline_camera(text, None).expect_err(text);
            assert!(e.to_string().contains(what) && !e.to_string().contains('\n'), "{text}: {e}");
            assert!(e.hint().contains(hint) && !e.hint().contains('\n'), "{text}: {}", e.hint());
            assert!(matches!(e, Error::Usage { .. }), "{text}");
        }
    }
}
