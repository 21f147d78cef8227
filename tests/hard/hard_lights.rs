//! Numerically hard lights of local shading: on surfaces, in corners, at the shaded point, inside closed meshes, behind
//! surfaces, with an empty cone or range, very near and very far.
//!
//! Not tested here: lights with an area (G2), which path tracing samples; `tests/render/lights.rs` has them.

use crate::common::Numbers;
use crate::common::borders::{CUBE, Folder, TIGHT, assert_sound, camera, films, scene, sound, tiers};
use crate::common::gltf::Model;
use crate::common::picture::{Prepared, picture, prepare};
use glam::{DQuat, DVec3};
use kiln::bvh::Hit;
use kiln::bvh::detail::Precision;
use kiln::film::Colour;
use kiln::scene::{Falloff, Light, LightKind, Numerics, Projection};

/// Ambient light of 0.25, linear values (which are not clamped, unlike those of `display`), a white diffuse material.
const WHITE: &str =
    "[image]\ncolour = 'linear'\n[ambient]\nintensity = 0.25\n[material.white]\ncolour = '#ffffff'\n";

/// A white floor from -4 to 4 at y = 0 under a point light, seen from above by 32 x 32 parallel rays with a spacing of
/// 1/4, one of them through the origin.
fn floor(lamp: [f64; 3], falloff: &str) -> String {
    format!(
        "{WHITE}[[camera]]\nposition = [0.125, 4, 0.125]\nlook_at = [0.125, 0, 0.125]\nup = [0, 0, -1]\n\
         projection = 'orthographic'\nviewing_rectangle = [8, 8]\nviewpoint_distance = 4\n\
         [[triangles]]\nvertices = [[-4, 0, -4], [4, 0, -4], [4, 0, 4], [-4, 0, 4.0]]\nindices = [[0, 1, 2], [0, 2, 3]]\n\
         material = 'white'\n[[light]]\ntype = 'point'\nposition = {lamp:?}\nfalloff = '{falloff}'\n"
    )
}

/// The hit, the point and the radiance of each pixel whose ray hits; the pictures here are grey.
fn pixels(prepared: &Prepared) -> Vec<(Hit, DVec3, f64)> {
    let film = sound(prepared);
    let mut pixels = Vec::new();
    for ((ray, hit), [r, g, b]) in prepared.rays().iter().zip(prepared.hits()).zip(film.rows()) {
        assert!(r == g && g == b, "the picture is grey");
        if let Some(hit) = hit {
            pixels.push((hit, ray.at(hit.t), f64::from(r)));
        }
    }
    pixels
}

#[test]
fn g1_a_lamp_on_a_plane_does_not_light_it() {
    // The light is on the floor, at its corner, on its edge, at a point that a ray hits, and beside the floor: N.L is 0
    // everywhere, so the radiance is exactly the ambient light.
    for lamp in
        [[0.3, 0.0, 0.2], [4.0, 0.0, 4.0], [-4.0, 0.0, 0.0], [0.0; 3], [0.25, -0.0, 1.5], [1e6, 0.0, 0.0]]
    {
        for falloff in ["none", "inverse-square"] {
            for film in films(&scene(&floor(lamp, falloff)), [32, 32]) {
                assert!(film.rows().all(|pixel| pixel == [0.25; 3]), "{lamp:?}");
            }
        }
    }
}

#[test]
fn g1_a_lamp_behind_a_surface_does_not_light_it() {
    // The light is under the floor, from a millionth of an f32 step to 1e30 below it.
    for depth in [1e-20, 1e-7, 1.0, 1e30] {
        for film in films(&scene(&floor([0.3, -depth, 0.2], "none")), [32, 32]) {
            assert!(film.rows().all(|pixel| pixel == [0.25; 3]), "{depth:e}");
        }
    }
}

#[test]
fn g1_a_lamp_inside_a_closed_body_stays_inside() {
    // A cube or a sphere on a floor, with the light inside, seen from outside: both show ambient light only. Points
    // within two rounding steps of the light, relative to the distance, are left out, as the surface there may be the
    // one that the light touches: at up to 16 units that is 4e-6 in f32 and less than 4e-14 in f64.
    let ball = "[[sphere]]\ncentre = [0.5, 0.5, 0.5]\nradius = 0.5\n";
    for (body, numerics) in [CUBE, ball].into_iter().flat_map(|body| TIGHT.map(|numerics| (body, numerics))) {
        let under = if numerics.precision() == Precision::Single { 1e-5 } else { 1e-13 };
        for lamp in [[0.5, 0.5, 0.5], [0.7, 0.3, 0.6], [0.5, 0.5, 1.0 - under], [0.5, under, 0.5]] {
            let text = format!(
                "{WHITE}[[camera]]\nposition = [4, 3, 5]\nlook_at = [0.5, 0.5, 0.5]\nvertical_fov = 30\n\
                 [[triangles]]\nvertices = [[-8, 0, -8], [8, 0, -8], [0, 0, 8]]\nmaterial = 'white'\n\
                 {body}material = 'white'\n[[light]]\ntype = 'point'\nposition = {lamp:?}\n"
            );
            let film = sound(&prepare(scene(&text), [32, 32], numerics));
            let lit = film.rows().filter(|pixel| pixel[0] > 0.25).count();
            assert_eq!(lit, 0, "{}: {lamp:?}", numerics.name());
        }
    }
}

#[test]
fn g1_inside_a_cube_every_wall_is_lit_by_a_lamp_in_it() {
    // Camera and light are inside the unit cube: nothing occludes the light, so the radiance is 0.25 + N.L everywhere.
    let lamp = DVec3::new(0.25, 0.5, 0.75);
    for look_at in [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]] {
        let text = format!(
            "{WHITE}[[camera]]\nposition = [0.5, 0.5, 0.5]\nlook_at = {:?}\nvertical_fov = 90\n\
             {CUBE}material = 'white'\n[[light]]\ntype = 'point'\nposition = {:?}\n",
            look_at.map(|c| f64::from(c) * 0.5 + 0.5),
            lamp.to_array()
        );
        for prepared in tiers(&scene(&text), [32, 32]) {
            for (hit, point, light) in pixels(&prepared) {
                // Four triangles perpendicular to z, then to y, then to x.
                let axis = 2 - hit.prim.0 as usize / 4;
                let to_lamp = lamp - point;
                let expected = 0.25 + to_lamp[axis].abs() / to_lamp.length();
                let numerics = prepared.world.numerics().name();
                assert!((light - expected).abs() < 1e-5, "{numerics}: {light}, not {expected} at {point}");
            }
        }
    }
}

/// A regular tetrahedron around the origin; its corners are four of the corners of a cube.
const TETRAHEDRON: &str = "[[triangles]]\nvertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]\n\
    indices = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]\nmaterial = 'white'\n";

#[test]
fn g1_a_lamp_on_a_wall_lights_the_walls_opposite() {
    // Inside a tetrahedron, with the light on a face, on an edge and at a corner: 0.25 + N.L on the faces that do not
    // contain the light. Because of rounding, a shadow ray may hit the face of the light if it rises from that face by
    // less than a quarter, and one that starts near an edge may start behind the other face: there the light may be
    // occluded. In `fast` the error of the distance to the light's face exceeds the margin by which shadow rays are
    // shortened.
    let corner = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from);
    let [a, b, c, _] = corner;
    // The face of each triangle, by the corner opposite, to which its normal points: all its points have N.p = -d.
    let inwards = [3, 2, 1, 0].map(|opposite: usize| corner[opposite].normalize());
    let height = |wall: usize, p: DVec3| inwards[wall].dot(p) + 1.0 / 3f64.sqrt();
    for lamp in
        [(a + b + c) / 3.0, (2.0 * a + 3.0 * b + 5.0 * c) / 10.0, (a + b) / 2.0, (a + 2.0 * b) / 3.0, a]
    {
        let stands_on = |wall: usize| height(wall, lamp) < 1e-9;
        let mut scene = scene(&format!(
            "{WHITE}{TETRAHEDRON}[[light]]\ntype = 'point'\nposition = {:?}\n",
            lamp.to_array()
        ));
        for look_at in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z] {
            scene.cameras = vec![camera(DVec3::ZERO, look_at, Projection::Perspective, 2.0, 1.0)];
            for prepared in tiers(&scene, [32, 32]) {
                for (hit, point, light) in pixels(&prepared) {
                    let wall = hit.prim.0 as usize;
                    let to_lamp = (lamp - point).normalize();
                    let (expected, numerics) = (0.25 + inwards[wall].dot(to_lamp), prepared.world.numerics());
                    let seen = (light - expected).abs() < 1e-5;
                    let rises = |w: usize| !stands_on(w) || -inwards[w].dot(to_lamp) > 0.25;
                    let apart =
                        |w: usize| w == wall || height(w, point) > 64.0 * numerics.precision().epsilon();
                    let right = seen || (light == 0.25 && !(0..4).all(|w| rises(w) && apart(w)));
                    let right = right || numerics == Numerics::Fast;
                    assert!(stands_on(wall) || right, "{}: {light} at {point}, lamp {lamp}", numerics.name());
                }
            }
        }
    }
}

#[test]
fn g1_a_light_right_behind_a_smooth_surface_is_a_number() {
    // A triangle seen almost edge on, whose vertex normals point away from the camera, and a directional light along
    // the rays: the directions to camera and light are opposite, so the half vector of the highlight is zero.
    let corners = [[0.1f32, -1.0, -1.0], [-0.1, -1.0, 1.0], [0.0, 1.0, 0.0]];
    let mut model = Model::new(&corners);
    model.attribute("NORMAL", &[[1.0f32, 0.0, -0.1]; 3]);
    let (mut scene, warnings) = Folder::new().load("a.glb", model.binary());
    assert_eq!(warnings, [""; 0]);
    scene.cameras = vec![camera(DVec3::Z * 9.0, DVec3::ZERO, Projection::Orthographic, 0.4, 9.0)];
    let sun = LightKind::Directional { direction: DVec3::Z, angle: 0.0 };
    scene.lights =
        vec![Light { name: "sun".into(), colour: Colour::Linear(DVec3::ONE), intensity: 1.0, kind: sun }];
    for prepared in tiers(&scene, [32, 32]) {
        assert!(prepared.hits().iter().flatten().count() > 100, "it is seen");
        sound(&prepared);
    }
}

#[test]
fn g1_hundred_thousand_points_under_lights_anywhere_are_numbers() {
    // A floor, a cube, a sphere and a tetrahedron with vertex normals under two lights of every type: at corners, on
    // edges and faces, inside, behind, at the camera, at random. 400 pictures of 16 x 16 pixels.
    let mut numbers = Numbers::new(3);
    let ball = "[[sphere]]\ncentre = [-1, 0.5, 0]\nradius = 0.5\nmaterial = 'white'\n";
    let text = format!(
        "{WHITE}specular = 0.5\nglaze = {{ bounces = 2 }}\n{}{CUBE}material = 'white'\n{TETRAHEDRON}{ball}",
        "[[triangles]]\nvertices = [[-8, 0, -8], [8, 0, -8], [0, 0, 8]]\nmaterial = 'white'\n"
    );
    let mut scene = scene(&text);
    let places =
        [[0.0; 3], [1.0; 3], [0.5, 1.0, 0.5], [0.5; 3], [-1.0, 1.0, 0.0], [-1.0, 0.5, 0.0], [0.0, 1e30, 0.0]];
    for _ in 0..400 {
        let eye = numbers.vector() * 3.0;
        scene.cameras = vec![camera(eye, DVec3::ZERO, Projection::Perspective, 1.0, 1.0)];
        scene.lights.clear();
        for _ in 0..2 {
            let position = match numbers.below(10) {
                7 => eye,
                8 => numbers.vector() * 2.0,
                9 => numbers.vector() * 10f64.powf(60.0 * numbers.signed()),
                place => DVec3::from(places[place]),
            };
            let range = [None, Some(0.0), Some(1.0), Some(1e200)][numbers.below(4)];
            let falloff = [Falloff::None, Falloff::InverseSquare { range }][numbers.below(2)];
            let direction = numbers.vector().normalize_or(DVec3::Y);
            let [inner_angle, outer_angle] = [numbers.below(3), numbers.below(3)].map(|a| a as f64 * 0.5);
            let kind = match numbers.below(3) {
                0 => LightKind::Directional { direction, angle: 0.0 },
                1 => LightKind::Point { position, falloff },
                _ => LightKind::Spot { position, direction, falloff, inner_angle, outer_angle },
            };
            let colour = Colour::Linear(DVec3::ONE);
            scene.lights.push(Light { name: "lamp".into(), colour, intensity: 1.0, kind });
        }
        films(&scene, [16, 16]);
    }
}

#[test]
fn g2_lights_and_spheres_without_size_light_nothing_or_are_errors() {
    // A cone with an angle of 0, and a range of 0: both are empty, so all light is ambient.
    let mut scene = scene(&floor([0.0, 2.0, 0.0], "none"));
    let (position, direction) = (DVec3::Y * 2.0, -DVec3::Y);
    let falloff = Falloff::InverseSquare { range: Some(0.0) };
    for (inner_angle, outer_angle, falloff) in [(0.0, 0.0, Falloff::None), (1.0, 1.5, falloff)] {
        scene.lights[0].kind = LightKind::Spot { position, direction, falloff, inner_angle, outer_angle };
        for film in films(&scene, [32, 32]) {
            assert!(film.rows().all(|pixel| pixel == [0.25; 3]));
        }
    }
    for radius in ["0", "-1", "-0.0", "nan"] {
        let text = format!("[[sphere]]\ncentre = [0, 0, 0]\nradius = {radius}\n");
        let e = Folder::new().fails("scene.toml", text).to_string();
        assert!(e.contains("scene.toml:1: a sphere of radius"), "{e}");
    }
}

#[test]
fn g3_lamps_almost_touching_what_they_light() {
    // The light is above the point that one ray hits, at heights h from 1e-320 to 1. That point has N.L = 1
    // without falloff, unless the square of h underflows, and 1 / h^2 with falloff, up to the largest f32, each in
    // addition to the ambient light. Elsewhere N.L is h over the distance.
    for exponent in [-320, -300, -200, -160, -150, -100, -60, -45, -40, -30, -20, -19, -10, -7, -3, 0] {
        let h = 10f64.powi(exponent);
        for falloff in ["none", "inverse-square"] {
            for prepared in tiers(&scene(&floor([0.0, h, 0.0], falloff)), [32, 32]) {
                let mut under = 0;
                for (_, point, light) in pixels(&prepared) {
                    let distance = point.length().hypot(h);
                    let strength = if falloff == "none" { 1.0 } else { 1.0 / (distance * distance) };
                    let expected = (0.25 + strength * h / distance).min(f64::from(f32::MAX));
                    under += usize::from(point == DVec3::ZERO);
                    if exponent <= -160 && point == DVec3::ZERO {
                        continue;
                    }
                    let near = (light - expected).abs() <= 2.0 * f64::from(f32::EPSILON) * expected;
                    assert!(near, "{}, {h:e}: {light}, not {expected}", prepared.world.numerics().name());
                }
                assert_eq!(under, 1, "one ray hits the point under the lamp");
            }
        }
    }
}

#[test]
fn g4_lamps_far_away_shine_as_from_their_direction() {
    // Lights at distances of 1e30 and 1e100, with shadows, with and without falloff; directions differ by at most
    // 1e-30.
    let light = |light: String| {
        scene(&format!(
            "{WHITE}[[camera]]\nposition = [4, 3, 5]\nlook_at = [0.5, 0.5, 0.5]\nvertical_fov = 30\n\
             [[triangles]]\nvertices = [[-8, 0, -8], [8, 0, -8], [0, 0, 8]]\nmaterial = 'white'\n\
             {CUBE}material = 'white'\n{light}"
        ))
    };
    let sun = light("[[light]]\ntype = 'directional'\ndirection = [-2, -3, -1]\n".into());
    // The length of that direction is the square root of 14.
    for (far, falloff, intensity) in [
        (1e30, "none", 1.0),
        (1e99, "none", 1.0),
        (1e15, "inverse-square", 14e30),
        (1e45, "inverse-square", 14e90),
    ] {
        let [x, y, z] = [2.0, 3.0, 1.0].map(|c| c * far);
        let lamp = light(format!(
            "[[light]]\ntype = 'point'\nposition = [{x:?}, {y:?}, {z:?}]\nfalloff = '{falloff}'\nintensity = {intensity:?}\n"
        ));
        for (a, b) in films(&sun, [48, 48]).iter().zip(films(&lamp, [48, 48])) {
            // Only pixels in shadow have exactly 0.25.
            let differ =
                a.rows().zip(b.rows()).filter(|(a, b)| (a[0] - b[0]).abs() > 4.0 * f32::EPSILON).count();
            assert_eq!(differ, 0, "{far:e}");
        }
    }
}

#[test]
fn g4_directions_of_any_length_shine_alike() {
    // An integer direction of length 3, scaled to lengths from 1e-23 to 1e25.
    let film = |length: f64, numerics: Numerics| {
        let [x, y, z] = [1.0, -2.0, -2.0].map(|c| c * length);
        let text = format!(
            "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n\
             [[light]]\ntype = 'directional'\ndirection = [{x:?}, {y:?}, {z:?}]\n"
        );
        picture(scene(&text), [24, 24], numerics)
    };
    for numerics in Numerics::ALL {
        for length in [1e-200, 1e-23, 1e-20, 1e25, 1e200] {
            let near = |a: f32, b: f32| (a - b).abs() <= 4.0 * f32::EPSILON;
            let (one, other) = (film(1.0, numerics), film(length, numerics));
            assert_sound(&other, numerics);
            let mut pairs = one.rows().zip(other.rows());
            assert!(pairs.all(|(a, b)| a.iter().zip(b).all(|(a, b)| near(*a, b))), "{length:e}");
        }
    }
}

#[test]
fn g4_lamps_beyond_f32_cast_shadows_as_others_do() {
    // A light 1e60 above a floor with a sphere over it: the shadow is the disc under the sphere, in every tier.
    let text = format!(
        "{}[[sphere]]\ncentre = [0, 2, 0]\nradius = 1\nmaterial = 'white'\n",
        floor([0.0, 1e60, 0.0], "none")
            .replace("position = [0.125, 4, 0.125]", "position = [0.125, 1, 0.125]")
    );
    for prepared in tiers(&scene(&text), [32, 32]) {
        for (_, point, light) in pixels(&prepared) {
            // The camera is under the sphere, so that its rays hit the floor only.
            let dark = point.length() < 1.0;
            let reach = if prepared.world.numerics().precision() == Precision::Single { 1e-5 } else { 1e-12 };
            if (point.length() - 1.0).abs() > reach {
                assert_eq!(light, if dark { 0.25 } else { 1.25 }, "{point}");
            }
        }
    }
}

/// A floor from -4 to 4 with a wall that stands on it, and a light `above` the floor; all corners are placed by
/// `place`. The picture shows the wall up to 2 above the floor.
fn wall_and_lamp(lamp: DVec3, place: impl Fn(DVec3) -> DVec3, up: DVec3, scale: f64) -> String {
    let at = |x: f64, y: f64, z: f64| place(DVec3::new(x, y, z)).to_array();
    let floor = [at(-4., 0., -4.), at(4., 0., -4.), at(4., 0., 4.), at(-4., 0., 4.)];
    let wall = [at(-2., 0., -3.), at(-2., 0., 3.), at(-2., 4., 3.), at(-2., 4., -3.)];
    let [eye, target, lamp] = [at(3., 1., 0.), at(-2., 1., 0.), place(lamp).to_array()];
    let (up, width, height) = (up.to_array(), 0.25 * scale, 2.0 * scale);
    format!(
        "[image]\ncolour = 'linear'\n[ambient]\nintensity = 0\n[material.white]\ncolour = '#ffffff'\n\
         [[camera]]\nposition = {eye:?}\nlook_at = {target:?}\nup = {up:?}\nprojection = 'orthographic'\n\
         viewing_rectangle = [{width:?}, {height:?}]\nviewpoint_distance = {:?}\n\
         [[triangles]]\nvertices = {floor:?}\nindices = [[0, 1, 2], [0, 2, 3]]\nmaterial = 'white'\n\
         [[triangles]]\nvertices = {wall:?}\nindices = [[0, 1, 2], [0, 2, 3]]\nmaterial = 'white'\n\
         [[light]]\ntype = 'point'\nposition = {lamp:?}\n",
        5.0 * scale
    )
}

/// The light lies on the floor in the scene file, at random heights, also with tilted floors, far from the origin and
/// beyond the range of f32. The whole wall is lit, except for the rounding of the scene file to f64. A light below the
/// floor lights nothing.
#[test]
fn g1_a_lamp_on_a_plane_lights_what_stands_on_it() {
    let mut numbers = Numbers::new(11);
    let mut dark = [0; 4];
    for round in 0..400 {
        let tilt = match round % 2 {
            0 => DQuat::IDENTITY,
            _ => DQuat::from_axis_angle(numbers.direction(), 3.0 * numbers.fine_unit()),
        };
        let scale = [1.0, 1.0, 50f64.exp2(), (-50f64).exp2()][round / 2 % 4];
        let far = if round % 16 == 8 { 1e5 } else { 3.0 };
        let offset = DVec3::new(far * numbers.signed(), 1.1 * numbers.signed(), 3.0 * numbers.signed());
        let place = |p: DVec3| (tilt * p + offset) * scale;
        let lamp = DVec3::new(1.0 + 2.0 * numbers.fine_unit(), 0.0, 2.0 * numbers.signed());
        let on = scene(&wall_and_lamp(lamp, place, tilt * DVec3::Y, scale));
        for (tier, film) in films(&on, [6, 48]).iter().enumerate() {
            dark[tier] += film.rows().filter(|pixel| pixel[0] <= 0.0).count();
        }
        let below = scene(&wall_and_lamp(lamp - DVec3::Y * 1e-3, place, tilt * DVec3::Y, scale));
        for film in films(&below, [6, 48]) {
            assert!(film.rows().all(|pixel| pixel == [0.0; 3]), "round {round}");
        }
    }
    // In `fast` rays are rounded as well: fewer than 1 % of the 400 x 288 pixels.
    assert!(dark[1..] == [0; 3] && dark[0] < 1152, "{dark:?}");
}
