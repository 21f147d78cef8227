//! Lights in path tracing against closed forms and quadrature: directional lights with an apparent diameter, spheres,
//! rectangles, disks, point lights and spots.

use std::f64::consts::PI;

use crate::common::picture::{changed, parse, placed};
use crate::path::{FLOOR, SIZE, check, mean, render, settings};
use glam::{DVec3, dvec3};
use kiln::effects::id;
use kiln::error::Warnings;
use kiln::job::{RenderSettings, prepare};
use kiln::scene::{PictureSettings, Transport};

/// The floor of [`FLOOR`] under a light.
fn under(light: &str) -> String {
    format!("{FLOOR}[[light]]\n{light}\n")
}

/// A light of intensity I shows a facing white surface with the radiance I, whatever its diameter; turned by 60
/// degrees, half as much, as long as its disc is above the horizon. A diameter of 180 degrees straight above is a
/// hemisphere of radiance I.
#[test]
fn directional_lights_shine_alike_with_every_diameter() {
    for angle in [0.0, 0.53, 30.0, 180.0] {
        let light = format!("type = 'directional'\ndirection = [0, -1, 0]\nintensity = 0.7\nangle = {angle}");
        check(&under(&light), 256, 1, 0.7);
    }
    for angle in [0.0, 1e-12, 0.53, 59.0] {
        // The cosine of 60 degrees.
        let light = format!("type = 'directional'\ndirection = [0, -1, 1.7320508075688772]\nangle = {angle}");
        check(&under(&light), 256, 1, 0.5);
    }
}

/// A mirror shows the disc, of radiance I / sin^2 of its angular radius, and nothing beside it; the camera itself does
/// not see it. The reflection goes along (-40, 30, 0) / 50.
#[test]
fn the_disc_of_a_directional_light_is_seen_in_mirrors_alone() {
    let mirror =
        FLOOR.replace("[material.floor]\ncolour", "[material.floor]\nmetallic = 1\nroughness = 0\ncolour");
    let light = |direction: &str| {
        format!(
            "{mirror}[[light]]\ntype = 'directional'\nangle = 4\nintensity = 0.01\ndirection = {direction}\n"
        )
    };
    let radiance = 0.01 / 2f64.to_radians().sin().powi(2);
    check(&light("[40, -30, 0]"), 1, 1, radiance);
    // 1.9 degrees to the side, and 2.1.
    for (degrees, expected) in [(1.9f64, radiance), (2.1, 0.0)] {
        let sideways = 50.0 * degrees.to_radians().tan();
        let (seen, _) = mean(&render(parse(&light(&format!("[40, -30, {sideways}]"))), &settings(1, 1)));
        assert!((seen - expected).abs() < 1e-6 * radiance, "{degrees}: {seen}, expected {expected}");
    }
    let camera = "[image]\nbackground = '#000000'\n[[camera]]\nposition = [0, 9, 0]\nlook_at = [0, 10, 1]\n";
    let sky = format!(
        "{camera}[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n\
         [[light]]\ntype = 'directional'\nangle = 90\ndirection = [0, -1, -1]\n"
    );
    assert_eq!(mean(&render(parse(&sky), &settings(1, 1))), (0.0, 0.0));
}

/// Light samples and BSDF samples together, in a furnace: a white rough metal ball under a hemisphere of radiance 1 all
/// around, of two directional lights of 180 degrees, cannot be told from a white background.
#[test]
fn discs_all_around_are_a_furnace() {
    let sides =
        [-1, 1].map(|y| format!("[[light]]\ntype = 'directional'\nangle = 180\ndirection = [0, {y}, 0]\n"));
    for material in ["metallic = 1\nroughness = 0.3", "metallic = 1\nroughness = 1", "diffuse = 1"] {
        let scene = format!(
            "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 10\n{}\
             [material.m]\ncolour = '#ffffff'\n{material}\n\
             [[sphere]]\nmaterial = 'm'\ncentre = [0, 0, 0]\nradius = 1\n",
            sides.concat()
        );
        let (mean, error) = mean(&render(parse(&scene), &settings(256, 1)));
        assert!(error < 2e-3 && (mean - 1.0).abs() < 4.0 * error + 1e-3, "{material}: {mean} +- {error}");
    }
}

/// A sphere light of intensity I is a point light with inverse-square falloff at every distance, as long as all of it
/// is above the horizon: I cos / d^2. Point lights are without noise.
#[test]
fn spheres_and_points_follow_the_inverse_square_law() {
    for (y, z) in [(3.0, 0.0), (3.0, 4.0), (30.0, 40.0), (3e3, 0.0)] {
        let squared: f64 = y * y + z * z;
        let intensity = 0.8 * squared;
        let expected = 0.8 * y / squared.sqrt();
        let place = format!("position = [0, {y}, {z}]\nintensity = {intensity}");
        check(&under(&format!("type = 'point'\nfalloff = 'inverse-square'\n{place}")), 1, 1, expected);
        for radius in [1e-3, 0.5, 2.2] {
            check(&under(&format!("type = 'sphere'\nradius = {radius}\n{place}")), 64, 1, expected);
        }
    }
}

/// KHR_lights_punctual: between the cones the square of the ramp (cos a - cos outer) / (cos inner - cos outer).
#[test]
fn spots_have_their_profile() {
    let (inner, outer) = (20f64.to_radians(), 50f64.to_radians());
    for degrees in [0.0f64, 15.0, 25.0, 40.0, 49.0, 51.0] {
        let angle = degrees.to_radians();
        // From (0, 4, 0) along a direction that is turned away from the floor's origin by the angle.
        let light = under(&format!(
            "type = 'spot'\nposition = [0, 4, 0]\ndirection = [0, {}, {}]\n\
             inner_cone_angle = 20\nouter_cone_angle = 50\n\
             intensity = 12\nfalloff = 'inverse-square'",
            -angle.cos(),
            angle.sin()
        ));
        let ramp = ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
        let (seen, _) = mean(&render(parse(&light), &settings(1, 1)));
        // Seen from a narrow angle, the floor is not only its origin.
        let expected = 12.0 / 16.0 * ramp * ramp;
        assert!(
            (seen - expected).abs() < 2e-4 * expected.max(0.01),
            "{degrees}: {seen}, expected {expected}"
        );
    }
}

/// The irradiance of a polygon of radiance 1 at the origin with the normal +y, by Lambert's formula (1760): half the
/// sum over the edges of the angle that an edge subtends times the cosine between +y and the plane of edge and origin.
fn lambert(corners: &[DVec3]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let edges = corners.iter().zip(next).map(|(a, b)| a.angle_between(*b) * a.cross(*b).normalize().y);
    0.5 * edges.sum::<f64>().abs()
}

/// The corners of a rectangle light at `centre` that looks at the origin, for a centre with x = 0: width along x,
/// height perpendicular to both.
fn corners(centre: DVec3, [width, height]: [f64; 2]) -> [DVec3; 4] {
    let x = DVec3::X * 0.5 * width;
    let y = centre.cross(DVec3::X).normalize() * 0.5 * height;
    [centre - x - y, centre + x - y, centre + x + y, centre - x + y]
}

/// The radiance of a rectangle of intensity I is pi I / area; a white floor has its irradiance over pi.
#[test]
fn rectangles_have_the_irradiance_of_lamberts_formula() {
    for (centre, size) in [
        (dvec3(0.0, 2.0, 0.0), [1.0, 3.0]),
        (dvec3(0.0, 3.0, 4.0), [2.0, 1.0]),
        (dvec3(0.0, 2.0, -5.0), [4.0, 3.0]),
        (dvec3(0.0, 0.05, -0.3), [1.0, 0.08]),
        // Seen under 1e-4 steradians: sampled by area.
        (dvec3(0.0, 60.0, -80.0), [1.0, 1.0]),
        (dvec3(0.0, 6e4, 8e4), [1.0, 2.0]),
    ] {
        let expected = 0.9 * centre.length_squared();
        let irradiance = lambert(&corners(centre, size)) * PI * expected / (size[0] * size[1]);
        let [x, y, z] = centre.to_array();
        let light = format!(
            "type = 'rectangle'\nposition = [{x:?}, {y:?}, {z:?}]\nlook_at = [0, 0, 0]\n\
             size = {size:?}\nintensity = {expected:?}"
        );
        check(&under(&light), 64, 1, irradiance / PI);
        // Far away, the inverse-square law: cosine 0.6.
        if y > 50.0 {
            assert!((irradiance / PI / (0.9 * 0.6) - 1.0).abs() < 1e-3);
        }
    }
}

/// From behind, a rectangle is dark to the floor and to the camera; from the front the camera sees pi I / area.
#[test]
fn rectangles_shine_from_one_side() {
    let light = |y: f64| {
        format!(
            "type = 'rectangle'\nposition = [0, 2, 0]\ndirection = [0, {y}, 0]\nsize = [2, 3]\nintensity = 0.6"
        )
    };
    assert_eq!(mean(&render(parse(&under(&light(1.0))), &settings(16, 2))).0, 0.0);
    let seen = |y: f64| {
        let camera = FLOOR.replace("position = [40, 30, 0]", "position = [4, 5, 0]");
        let scene = format!(
            "{}[[light]]\n{}\n",
            camera.replace("look_at = [0, 0, 0]", "look_at = [0, 2, 0]"),
            light(y)
        );
        mean(&render(parse(&scene), &settings(1, 0))).0
    };
    assert_eq!(seen(-1.0), 0.0);
    assert!((seen(1.0) - 0.1 * PI).abs() < 1e-6);
}

/// The factor of a disk of radius r parallel to a surface element at the distance h, with its centre aside by a: its
/// radiance times this is the radiance of a white diffuse element (Howell, Catalog of Radiation Heat Transfer
/// Configuration Factors, B-13). On the axis, r^2 / (r^2 + h^2).
fn disk_factor(radius: f64, height: f64, aside: f64) -> f64 {
    let [r, h, a] = [radius, height, aside].map(|x| x * x);
    0.5 * (1.0 - (h + a - r) / ((h + a + r).powi(2) - 4.0 * a * r).sqrt())
}

/// A disk of intensity I has the radiance I / r^2: on its axis a white floor has the radiance I / (r^2 + d^2).
#[test]
fn disks_have_the_irradiance_of_their_closed_form() {
    for (radius, height, aside) in [
        (1.0, 2.0, 0.0),
        (0.6, 0.5, 0.0),
        (1e-3, 1.0, 0.0),
        (1.0, 0.4, 0.9),
        (0.5, 3.0, 4.0),
        (1.0, 6e4, 8e4),
    ] {
        let intensity: f64 = height * height + aside * aside + radius * radius;
        let expected = intensity / (radius * radius) * disk_factor(radius, height, aside);
        if aside == 0.0 {
            assert!((expected - 1.0).abs() < 1e-9, "{radius} {height}");
        }
        let light = format!(
            "type = 'disk'\nposition = [0, {height:?}, {aside:?}]\ndirection = [0, -1, 0]\nradius = {radius:?}\n\
             intensity = {intensity:?}"
        );
        check(&under(&light), 256, 1, expected);
        // An emissive disk, whose two sides shine, of the same radiance; turned over, it is the same.
        let radiance = intensity / (radius * radius);
        for y in [-1, 1] {
            let disk = format!(
                "{FLOOR}[material.shine]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = {radiance:?}\n\
                 [[disk]]\nmaterial = 'shine'\ncentre = [0, {height:?}, {aside:?}]\nnormal = [0, {y}, 0]\n\
                 radius = {radius:?}\n"
            );
            check(&disk, 256, 1, expected);
        }
    }
}

/// From behind, a disk is dark to the floor and to the camera; from the front the camera sees I / r^2.
#[test]
fn disks_shine_from_one_side() {
    let light = |y: f64| {
        format!("type = 'disk'\nposition = [0, 2, 0]\ndirection = [0, {y}, 0]\nradius = 2\nintensity = 0.6")
    };
    assert_eq!(mean(&render(parse(&under(&light(1.0))), &settings(16, 2))).0, 0.0);
    let seen = |y: f64| {
        let camera = FLOOR.replace("position = [40, 30, 0]", "position = [4, 5, 0]");
        let camera = camera.replace("look_at = [0, 0, 0]", "look_at = [0, 2, 0]");
        mean(&render(parse(&format!("{camera}[[light]]\n{}\n", light(y))), &settings(1, 0))).0
    };
    assert_eq!(seen(-1.0), 0.0);
    assert!((seen(1.0) - 0.15).abs() < 1e-6);
}

/// Light samples and BSDF samples together, in a furnace: between two disks of radiance 1 so close and so large that
/// next to nothing is seen beside them, white rough metal and diffuse sheets are as bright as the disks. A disk of
/// radius R at the height h leaves the part h^2 / (R^2 + h^2) of a floor's light, 1e-4.
#[test]
fn disks_close_by_are_a_furnace() {
    for material in ["metallic = 1\nroughness = 0.3", "metallic = 1\nroughness = 1", "diffuse = 1"] {
        let scene = format!(
            "[[camera]]\nposition = [0, 0.9, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, 1]\nvertical_fov = 10\n\
             [material.m]\ncolour = '#ffffff'\n{material}\n\
             [[disk]]\nmaterial = 'm'\ncentre = [0, 0, 0]\nnormal = [0, 1, 0]\nradius = 1\n\
             [[light]]\ntype = 'disk'\nposition = [0, 1, 0]\ndirection = [0, -1, 0]\nradius = 100\nintensity = 1e4\n"
        );
        let (mean, error) = mean(&render(parse(&scene), &settings(1024, 1)));
        assert!(error < 4e-3 && (mean - 1.0).abs() < 4.0 * error + 1e-3, "{material}: {mean} +- {error}");
    }
}

/// The irradiance at the origin of a horizontal floor, in a plane at height 1 above it: of radiance 1 from the points
/// of a rectangle for which `shines` holds, by the midpoint rule. A point (p, 1, q) at a distance d has the cosine 1 /
/// d, and its area element the solid angle 1 / d^3.
fn quadrature(p: [f64; 2], q: [f64; 2], shines: impl Fn(f64, f64) -> bool) -> f64 {
    const COUNT: u32 = 2000;
    let step = |[from, to]: [f64; 2]| (to - from) / f64::from(COUNT);
    let places = |side: [f64; 2]| (0..COUNT).map(move |i| side[0] + (f64::from(i) + 0.5) * step(side));
    let row = |q: f64| {
        let seen = places(p).filter(|&p| shines(p, q));
        seen.map(|p| (1.0 + p * p + q * q).powi(-2)).sum::<f64>()
    };
    places(q).map(row).sum::<f64>() * step(p) * step(q)
}

/// Lights partly behind the edge of a sheet at the height 1 that covers all x below `edge`; half of the light for an
/// edge at 0.
#[test]
fn penumbrae_have_the_light_of_the_part_that_is_seen() {
    let sheet = |edge: f64| {
        format!(
            "[[triangles]]\nvertices = [[{edge}, 1, -60], [{edge}, 1, 60], [-60, 1, 0]]\n\
             material = 'lamp_black'\n[material.lamp_black]\ncolour = '#000000'\n"
        )
    };
    // A sphere of radius 1 at the height 3: of directions with a sine below 1/3, a tangent below 1 / sqrt 8.
    let tangent = 0.125f64.sqrt();
    for edge in [0.0, 0.1, -0.2] {
        let seen = quadrature([edge, tangent], [-tangent, tangent], |p, q| p * p + q * q < 0.125) / PI;
        if edge == 0.0 {
            assert!((seen * 2.0 * 9.0 - 1.0).abs() < 1e-4, "half of 1 / d^2");
        }
        let light = "type = 'sphere'\nposition = [0, 3, 0]\nradius = 1\n";
        check(&format!("{}{}", under(light), sheet(edge)), 256, 1, seen);
        // A rectangle of 2 by 1.2 at the height 2, with its centre at (0.3, 0.2), and of the radiance pi / 2.4.
        let seen = quadrature([edge, 0.65], [-0.2, 0.4], |_, _| true) / 2.4;
        let light = "type = 'rectangle'\nposition = [0.3, 2, 0.2]\ndirection = [0, -1, 0]\nsize = [2, 1.2]\n";
        check(&format!("{}{}", under(light), sheet(edge)), 256, 1, seen);
        // A disk of radius 1 at the height 2, of the radiance 1.
        let seen = quadrature([edge, 0.5], [-0.5, 0.5], |p, q| p * p + q * q < 0.25) / PI;
        let light = "type = 'disk'\nposition = [0, 2, 0]\ndirection = [0, -1, 0]\nradius = 1\n";
        check(&format!("{}{}", under(light), sheet(edge)), 256, 1, seen);
    }
}

/// Local shading, under a directional light of 40 degrees and the same sheet: the part of the disc's solid angle that is
/// seen, half of it for an edge at 0; without the effect all or nothing.
#[test]
fn soft_shadows_have_the_part_of_the_disc_that_is_seen() {
    let tangent = 20f64.to_radians().tan();
    let whole = 2.0 * PI * (1.0 - 20f64.to_radians().cos());
    let local = |without: &[&str]| RenderSettings {
        with: Vec::new(),
        without: without.iter().map(|name| (*name).to_owned()).collect(),
        ..changed(settings(256, 1), |picture| picture.transport = Some(Transport::Whitted))
    };
    let light = "type = 'directional'\ndirection = [0, -1, 0]\nangle = 40\n";
    let no_ambient = "[ambient]\nintensity = 0\n";
    let scene = |edge: f64| {
        format!(
            "{}{no_ambient}[[triangles]]\nvertices = [[{edge}, 1, -60], [{edge}, 1, 60], [-60, 1, 0]]\n\
             material = 'lamp_black'\n[material.lamp_black]\ncolour = '#000000'\n",
            under(light)
        )
    };
    let open = mean(&render(parse(&format!("{}{no_ambient}", under(light))), &local(&[]))).0;
    for edge in [0.0, 0.1, -0.2, 0.3] {
        // A solid angle is (1 + p^2 + q^2)^(-3/2) dp dq in the tangents p and q.
        let count = 2000;
        let at = |i: i32| tangent * ((2.0 * f64::from(i) + 1.0) / f64::from(count) - 1.0);
        let cell = (2.0 * tangent / f64::from(count)).powi(2);
        let points = (0..count).flat_map(|i| (0..count).map(move |j| (at(i), at(j))));
        let inside = points.filter(|(p, q)| p.hypot(*q) < tangent && *p > edge);
        let seen = inside.map(|(p, q)| (1.0 + p * p + q * q).powf(-1.5)).sum::<f64>() * cell / whole;
        assert!(edge != 0.0 || (seen - 0.5).abs() < 1e-3, "{seen}");
        let (mean, error) = mean(&render(parse(&scene(edge)), &local(&[])));
        assert!(error < 0.004 * open, "{error}");
        assert!(
            (mean / open - seen).abs() < 4.0 * error / open + 1e-3,
            "{edge}: {mean} of {open}, expected {seen}"
        );
    }
    let hard = mean(&render(parse(&scene(0.1)), &local(&["soft-shadows"]))).0;
    assert_eq!(hard, 0.0, "the centre of the light is behind the sheet");
}

/// Many lights of every kind add up.
#[test]
fn lights_of_all_kinds_add_up() {
    let lights = [
        "type = 'directional'\ndirection = [0, -1, 0]\nangle = 20\nintensity = 0.1",
        "type = 'directional'\ndirection = [0, -1, 0]\nintensity = 0.05",
        "type = 'sphere'\nposition = [0, 3, 0]\nradius = 0.5\nintensity = 1.8",
        "type = 'point'\nposition = [0, 3, 0]\nintensity = 0.2",
    ];
    // The sphere casts a shadow of the point light in its own centre.
    let scene = format!("{FLOOR}{}", lights.map(|light| format!("[[light]]\n{light}\n")).concat());
    // Its directions have a sine below 1/6, a tangent below 1 / sqrt 35.
    let tangent = (1f64 / 35.0).sqrt();
    let blocked =
        quadrature([-tangent, tangent], [-tangent, tangent], |p, q| p * p + q * q < 1.0 / 35.0) / PI;
    assert!((blocked * 36.0 - 1.0).abs() < 1e-4, "the square of the sine");
    // The sphere covers the middle of the disc of 20 degrees; the other light straight above is hidden by it.
    let disc = 0.1 * (1.0 - blocked / 10f64.to_radians().sin().powi(2));
    check(&scene, 512, 1, disc + 0.2);
}

/// Scenes far away or of extreme size are moved and scaled, and their lights with them.
#[test]
fn lights_scale_with_their_scene() {
    let lights = "type = 'sphere'\nposition = [3, 5, 1]\nradius = 1\nintensity = 9\n\
        [[light]]\ntype = 'rectangle'\nposition = [-2, 4, 1]\nlook_at = [0, 0, 0]\nsize = [2, 1]\nintensity = 6\n\
        [[light]]\ntype = 'disk'\nposition = [1, 4, -3]\nlook_at = [0, 0, 0]\nradius = 1\nintensity = 7\n";
    let (expected, error) = mean(&render(parse(&under(lights)), &settings(64, 1)));
    for scale in [1e-20, 1e20] {
        let scene = placed(parse(&under(lights)), scale, DVec3::ZERO);
        let (seen, _) = mean(&render(scene, &settings(64, 1)));
        assert!((seen - expected).abs() < 4.0 * error, "{scale}: {seen}, expected {expected} +- {error}");
    }
}

/// Rectangles that the tier's numbers do not resolve, at corners, in the plane and through other surfaces give no NaN.
#[test]
fn degenerate_area_lights_are_numbers() {
    let mut rectangles = String::new();
    for (position, direction, size) in [
        ("[5, 3, 5]", "[0, -1, 0]", "[1e-30, 1]"),
        ("[5, 3, 5]", "[1, -1, 0]", "[1e-100, 1e-100]"),
        ("[0, 0, 0]", "[0, 1, 0]", "[1, 1]"),
        ("[0, 0, 0]", "[1, 0, 0]", "[3, 1e-6]"),
        ("[0, 1e-9, 0]", "[1, -1e-9, 0]", "[1e3, 1e3]"),
        ("[1e30, 1e30, 0]", "[-1, -1, 0]", "[1e20, 1e20]"),
        ("[0, 1, 0]", "[0, -1, 0]", "[1e100, 1e-100]"),
    ] {
        rectangles += &format!(
            "[[light]]\ntype = 'rectangle'\nposition = {position}\ndirection = {direction}\nsize = {size}\n"
        );
    }
    let spheres = "[[light]]\ntype = 'sphere'\nposition = [0, 0, 0]\nradius = 1e-100\n\
        [[light]]\ntype = 'sphere'\nposition = [0, 1, 0]\nradius = 1\n\
        [[light]]\ntype = 'disk'\nposition = [5, 3, 5]\ndirection = [1, -1, 0]\nradius = 1e-100\n\
        [[light]]\ntype = 'disk'\nposition = [0, 0, 0]\ndirection = [0, 1, 0]\nradius = 1\n\
        [[light]]\ntype = 'disk'\nposition = [0, 1e-9, 0]\ndirection = [1, -1e-9, 0]\nradius = 1e3\n\
        [[light]]\ntype = 'disk'\nposition = [1e30, 1e30, 0]\ndirection = [-1, -1, 0]\nradius = 1e20\n";
    for numerics in kiln::scene::Numerics::ALL {
        let scene =
            format!("{FLOOR}{rectangles}{spheres}").replace("vertical_fov = 0.001", "vertical_fov = 5");
        let settings = changed(settings(8, 3), |picture| picture.numerics = Some(numerics));
        // `render` asserts that no sample is not finite.
        assert!(mean(&render(parse(&scene), &settings)).0.is_finite());
    }
}

/// Spheres and rectangles call for path tracing; local shading shows them, with a warning that they light nothing.
#[test]
fn area_lights_call_for_paths() {
    let scene = under(
        "name = 'panel'\ntype = 'rectangle'\nposition = [0, 2, 0]\ndirection = [0, -1, 0]\nsize = [1, 1]",
    );
    let decide = |transport, scene: &str| {
        let settings = PictureSettings { transport, ..PictureSettings::of_size([SIZE; 2]) }.into();
        let mut warnings = Warnings::default();
        let job = prepare(parse(scene), &settings, &mut warnings).expect("a job");
        let path =
            job.plan.decisions.iter().find(|decision| decision.effect == id::PATH).expect("one of each");
        (path.on, path.why.clone(), warnings.messages().join("\n"))
    };
    let (on, why, warnings) = decide(None, &scene);
    assert_eq!((on, why.as_str(), warnings.as_str()), (true, "area light `panel`", ""));
    let (on, _, warnings) = decide(Some(Transport::Whitted), &scene);
    assert_eq!(
        (on, warnings.as_str()),
        (false, "area lights such as `panel` give no light without path tracing")
    );
    // A light without intensity calls for nothing.
    assert!(!decide(None, &format!("{scene}intensity = 0\n")).0);
}

/// A lamp that lies on the plane, or in that of a disk, above a floor lights all of the floor, in every tier: the
/// plane's rounded corners and the end of a shadow ray are too close to tell which comes first. The picture is the
/// square from -1 to 1 of the floor y = -1, seen from between the two. A point light of intensity 1 at (x, h, z) above
/// it gives the radiance cos = h / d, over d^2 with falloff; so does a spot within its inner angle. Its mean over the
/// square is that of 400 x 400 points, within 1e-4; a floor of which 1 % is black would show.
#[test]
fn lamps_on_planes_light_what_is_below() {
    let (x, z) = (0.37, 0.21);
    for y in [0.1, 0.3, 0.5, 0.7, 1.1] {
        let height: f64 = y + 1.0;
        let count = 400;
        let at = |i: i32| (2.0 * f64::from(i) + 1.0) / f64::from(count) - 1.0;
        let average = |power: i32| {
            let of = |i, j| {
                height / (height * height + (at(i) - x).powi(2) + (at(j) - z).powi(2)).sqrt().powi(power)
            };
            let sum: f64 =
                (0..count).flat_map(|i| (0..count).map(move |j| (i, j))).map(|(i, j)| of(i, j)).sum();
            sum / f64::from(count * count)
        };
        for (kind, falloff, power) in [
            ("type = 'point'", "none", 1),
            ("type = 'point'", "inverse-square", 3),
            (
                "type = 'spot'\ndirection = [0, -1, 0]\ninner_cone_angle = 70\nouter_cone_angle = 80",
                "none",
                1,
            ),
            (
                "type = 'spot'\ndirection = [0, -1, 0]\ninner_cone_angle = 70\nouter_cone_angle = 80",
                "inverse-square",
                3,
            ),
        ] {
            let scene = format!(
                "[[camera]]\nprojection = 'orthographic'\nposition = [0, 0, 0]\nlook_at = [0, -1, 0]\nup = [0, 0, 1]\n\
                 viewing_height = 2\nviewpoint_distance = 1\n[ambient]\nintensity = 0\n\
                 [material.white]\ncolour = '#ffffff'\nspecular = 0\n\
                 [[light]]\n{kind}\nposition = [{x}, {y}, {z}]\nfalloff = '{falloff}'\n\
                 [[triangles]]\nmaterial = 'white'\nvertices = [[-9, -1, -9], [9, -1, -9], [0, -1, 18]]\n"
            );
            let ceiling = format!(
                "[[triangles]]\nmaterial = 'white'\nvertices = [[-9, {y}, -9], [9, {y}, -9], [0, {y}, 18]]\n"
            );
            // A slanted disk with the lamp far from its centre, seen from right above the floor, which it crosses: (40,
            // -125,
            // -30) . (2, 1, -1.5) = 0.
            let (cx, cy, cz) = (x + 40.0, y - 125.0, z - 30.0);
            let disk = format!(
                "[[disk]]\nmaterial = 'white'\ncentre = [{cx}, {cy}, {cz}]\nnormal = [2, 1, -1.5]\nradius = 500\n"
            );
            let near = scene.replace("position = [0, 0, 0]", "position = [0, -0.9999, 0]");
            let scenes = [scene + &ceiling, near + &disk];
            let expected = average(power);
            for (numerics, scene) in
                kiln::scene::Numerics::ALL.into_iter().flat_map(|n| scenes.each_ref().map(|s| (n, s)))
            {
                for transport in [Transport::Path, Transport::Whitted] {
                    let with = if transport == Transport::Path { vec!["path=1".into()] } else { Vec::new() };
                    let own = |picture: &mut PictureSettings| {
                        (picture.numerics, picture.transport) = (Some(numerics), Some(transport));
                    };
                    let settings = RenderSettings { with, ..changed(settings(1, 1), own) };
                    let seen = mean(&render(parse(scene), &settings)).0;
                    assert!(
                        (seen / expected - 1.0).abs() < 2e-3,
                        "{scene}{y}, {numerics:?}, {transport:?}: {seen}, expected {expected}"
                    );
                }
            }
        }
    }
}
