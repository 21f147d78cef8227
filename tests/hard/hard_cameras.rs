//! Numerically hard cameras: without a usable up vector, at the ends of f64, on surfaces and inside closed meshes, with
//! pixel lattices that meet edges and corners, and far from the origin.
//!
//! Not tested here: an orthonormal basis from one vector (F2), which kiln does not compute; its only basis is the
//! camera's.

use crate::common::Numbers;
use crate::common::borders::{CUBE, Folder, TIGHT, camera, field, films, scene, sound, tiers, under};
use crate::common::picture::{Prepared, prepare};
use glam::DVec3;
use kiln::bvh::detail::Precision;
use kiln::error::Error;
use kiln::scene::{Camera, Numerics, Projection, Scene};
use kiln::world::View;

/// The axes u, v and w of a camera, from the rays of four pixels of an orthographic view: u and v from their origins, w
/// from their direction.
fn axes(position: DVec3, target: DVec3, up: DVec3) -> Option<[DVec3; 3]> {
    // A viewing rectangle as large as the distance of the position, so that differences of origins keep their digits.
    let side = position.abs().max_element().max(1.0);
    let camera = Camera { up, ..camera(position, target, Projection::Orthographic, side, 1.0) };
    let view = View::new(&camera, camera.projection, [2, 2]).ok()?;
    let ray = |x, y| view.ray(x, y, Precision::Double);
    let step = |a: DVec3, b: DVec3| (a - b) / (side / 2.0);
    let [u, v] = [(1, 1), (0, 0)].map(|(x, y)| step(ray(x, y).origin(), ray(0, 1).origin()));
    Some([u, v, -ray(0, 0).direction()])
}

/// The axes have length 1, are perpendicular and right-handed, up to two f32 steps.
#[track_caller]
fn assert_orthonormal([u, v, w]: [DVec3; 3]) {
    let limit = 2.0 * f64::from(f32::EPSILON);
    let lengths = [u, v, w].map(|axis| (axis.length() - 1.0).abs());
    let angles = [u.dot(v), v.dot(w), w.dot(u), u.cross(v).dot(w) - 1.0].map(f64::abs);
    assert!(lengths.iter().chain(&angles).all(|x| *x <= limit), "{u} {v} {w}");
}

/// A scene file of a sphere of radius 1 and a camera at a distance of 5, which sees a width of 0.6 at a distance of 1.
fn ball(centre: [f64; 3], position: [f64; 3], look_at: [f64; 3], up: [f64; 3], lens: f64) -> String {
    let (side, distance) = (0.6 * lens, lens);
    format!(
        "[[camera]]\nposition = {position:?}\nlook_at = {look_at:?}\nup = {up:?}\n\
         viewing_rectangle = [{side:?}, {side:?}]\nviewpoint_distance = {distance:?}\n\
         [[sphere]]\ncentre = {centre:?}\nradius = 1\n"
    )
}

/// The sphere is seen as a disc in 33 x 33 pixels. Its outline is the cone of slope r / sqrt(D^2 - r^2) = 1 / sqrt(24),
/// which is 33 / 0.6 / sqrt(24) = 11.2268 pixels from the middle: 126.04 squared. Of the sums of two squares 125 is the
/// nearest.
#[track_caller]
fn assert_disc(prepared: &Prepared, text: &str) {
    for (index, hit) in (0..).zip(prepared.hits()) {
        let (x, y) = (index % 33 - 16, index / 33 - 16);
        assert_eq!(hit.is_some(), x * x + y * y <= 125, "({x}, {y}): {text}");
    }
}

#[test]
fn f1_cameras_without_a_direction_or_an_up_are_errors() {
    // A target at the position, up to rounding, and an up vector of zero.
    let base = |up, look_at| ball([0.0; 3], [1e6, 0.0, 0.0], look_at, up, 1.0);
    let y = [0.0, 1.0, 0.0];
    for (text, expected) in [
        (base(y, [1e6, 0.0, 0.0]), "camera `camera 0` looks at itself"),
        // The next f64 after 1e6 is 1.2e-10 away.
        (base(y, [1e6 + 1e-12, 0.0, 0.0]), "camera `camera 0` looks at itself"),
        (base([0.0; 3], [0.0; 3]), "camera `camera 0` has no up"),
    ] {
        let e = Folder::new().fails("scene.toml", text);
        assert!(matches!(e, Error::Input { .. }) && e.to_string().ends_with(expected), "{e}");
    }
    assert!(axes(DVec3::ONE, DVec3::ONE, DVec3::Y).is_none());
    assert!(axes(DVec3::ONE, DVec3::NAN, DVec3::Y).is_none());
}

#[test]
fn f1_a_ball_is_a_disc_however_the_camera_is_turned() {
    // Up along the line of sight, up to 1e-20 beside it, a target 1e25 away, one 1e-23 away, one 1e-3 away at 1e6.
    let (o, y) = ([0.0; 3], [0.0, 1.0, 0.0]);
    for (centre, position, look_at, up) in [
        (o, [0.0, 5.0, 0.0], o, y),
        (o, [0.0, -5.0, 0.0], o, y),
        (o, [0.0, 5.0, 0.0], o, [0.0, -1.0, 0.0]),
        (o, [5.0, 0.0, 0.0], o, [1.0, 0.0, 0.0]),
        (o, [0.0, 0.0, -5.0], o, [0.0, 0.0, 1e-200]),
        (o, [0.0, 5.0, 0.0], o, [1e-20, 1.0, 0.0]),
        (o, [0.0, 5.0, 0.0], o, [1e-7, -1.0, 1e-9]),
        (o, [0.0, 0.0, 5.0], [0.0, 0.0, -1e25], y),
        (o, [0.0, 0.0, 5.0], [0.0, 0.0, -1e25], [0.0, 0.0, 1e200]),
        ([0.0, 0.0, -5.0], o, [0.0, 0.0, -1e-23], y),
        ([0.0, 0.0, -5.0], o, [0.0, 0.0, -1e-200], y),
        ([1e6 - 5.0, 0.0, 0.0], [1e6, 0.0, 0.0], [1e6 - 1e-3, 0.0, 0.0], y),
    ] {
        let text = ball(centre, position, look_at, up, 1.0);
        for prepared in tiers(&scene(&text), [33, 33]) {
            sound(&prepared);
            assert_disc(&prepared, &text);
        }
    }
}

#[test]
fn f1_a_ball_is_a_disc_through_a_lens_of_any_size() {
    // A perspective camera depends on the ratio of rectangle and distance only; both go from 1e-300 to 1e300.
    for exponent in [-300, -200, -160, -23, 0, 25, 160, 200, 300] {
        let lens = format!("1e{exponent}").parse().expect("a number");
        let text = ball([0.0; 3], [0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], lens);
        for prepared in tiers(&scene(&text), [33, 33]) {
            sound(&prepared);
            assert_disc(&prepared, &text);
        }
    }
}

#[test]
fn f1_hundred_thousand_cameras_have_an_orthonormal_basis() {
    // Positions from 1e-20 to 1e20, targets from 1e-25 to 1e25 away, up from any side to 1e-20 beside the line of
    // sight.
    let mut numbers = Numbers::new(1);
    let mut refused = 0;
    for _ in 0..100_000 {
        let mut power = |most: f64| 10f64.powf(most * numbers.signed());
        let (far, near, beside) = (power(20.0), power(25.0), power(20.0).min(1.0));
        let position = numbers.vector() * far;
        let target = position + numbers.vector() * near;
        let along = (target - position).normalize_or(DVec3::X);
        let up = along * numbers.signed() + numbers.vector() * beside;
        match axes(position, target, up) {
            Some(axes) => {
                assert_orthonormal(axes);
                let gone = (target - position) / (target - position).abs().max_element();
                assert!((axes[2] + gone.normalize()).length() < 4.0 * f64::EPSILON, "{position} {target}");
            }
            // So near that the target rounds to the position.
            None => {
                assert_eq!(position, target);
                refused += 1;
            }
        }
    }
    assert!(refused < 50_000, "{refused}");
}

#[test]
fn f2_directions_near_the_axes_have_an_orthonormal_basis() {
    // Every axis and its opposite, tilted by 1 to 1e-20 to either side, against every axis as up.
    let all = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    for direction in all {
        for (tilt, up) in all.into_iter().flat_map(|tilt| all.map(|up| (tilt, up))) {
            for exponent in 0..=20 {
                let aim = direction + tilt * 10f64.powi(-exponent);
                if aim != DVec3::ZERO {
                    assert_orthonormal(axes(DVec3::ZERO, aim, up).expect("a direction"));
                }
            }
        }
    }
}

#[test]
fn f3_directions_have_length_one_and_highlights_make_no_light() {
    // Camera and light are at the centre of a sphere: the mirrored light reaches the camera in every pixel, so its
    // radiance is k_a I_a + k_d I + k_s I (R.V)^n with R.V = 1, and rounding does not exceed it.
    for shininess in ["16", "1000", "1e6", "1e9", "1e18", "1e99"] {
        let text = format!(
            "[image]\ncolour = 'display'\n[[camera]]\nposition = [1, 2, 3]\nlook_at = [4, -3, 1]\n\
             [ambient]\nintensity = 0.125\n[[light]]\ntype = 'point'\nposition = [1, 2, 3]\nintensity = 0.5\n\
             [material.m]\ncolour = '#ffffff'\nspecular = 0.5\nshininess = {shininess}\n\
             [[sphere]]\ncentre = [1, 2, 3]\nradius = 10\nmaterial = 'm'\n"
        );
        for prepared in tiers(&scene(&text), [32, 32]) {
            let numerics = prepared.world.numerics();
            // Of length 1 up to the rounding of each component.
            let steps = |d: DVec3| (d.length() - 1.0).abs() / numerics.ray_precision().epsilon();
            assert!(prepared.rays().iter().all(|ray| steps(ray.direction()) <= 1.0));
            for [r, g, b] in sound(&prepared).rows() {
                let rounding = 1.0 + 2.0 * f32::EPSILON;
                let light = 0.625 / rounding..=0.875 * rounding;
                assert!(r == g && g == b && light.contains(&r), "{shininess}: {r}");
            }
        }
    }
}

/// The plane of the assignment, with the camera `height` above a point of it.
fn on_the_plane(height: f64) -> Scene {
    let y = -500.0 + height;
    scene(&format!(
        "[image]\nbackground = '#ffffff'\n[[camera]]\nposition = [-5000, {y:?}, 200]\nlook_at = [0, -600, 9000]\n\
         vertical_fov = 90\n[[triangles]]\nvertices = [[-10000, -500, -10000], [-10000, -500, 100000], \
         [10000, -500, -10000]]\n"
    ))
}

#[test]
fn f4_a_camera_on_a_plane_does_not_see_it() {
    // The camera is on the plane: the only common point is at t = 0, which a ray does not include.
    for prepared in tiers(&on_the_plane(0.0), [32, 32]) {
        sound(&prepared);
        assert!(prepared.hits().iter().all(Option::is_none), "{}", prepared.world.numerics().name());
    }
    // From one f32 step above it, the plane fills the lower half.
    let step = f64::from((-500f32).next_up()) + 500.0;
    for prepared in tiers(&on_the_plane(step), [32, 32]) {
        sound(&prepared);
        for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
            let exact = -step / ray.direction().y;
            // Rays downwards hit it before its hypotenuse, thousands of units away; rays upwards miss.
            assert_eq!(hit.is_some(), exact > 0.0, "{ray:?}");
            // In `fast`, t has the error of a triangle of this size.
            let is_right = hit.is_none_or(|hit| (hit.t - exact).abs() <= f64::from(f32::EPSILON) * exact);
            assert!(is_right || prepared.world.numerics() == Numerics::Fast);
        }
    }
}

#[test]
fn f4_a_camera_on_an_oblique_plane_sees_what_is_behind_it() {
    // The camera is at the middle of a triangle in x + y + z = 0 with integer corners, before a sphere that fills the
    // view: every tier hits the sphere in every pixel. (The distance to the triangle is 0; for one pixel in five it
    // rounds to a positive number.)
    let text = "[[camera]]\nposition = [0, 0, 0]\nlook_at = [1, 2, 3]\n\
        [[triangles]]\nvertices = [[3, -3, 0], [0, 3, -3], [-3, 0, 3]]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 9\n";
    for prepared in tiers(&scene(text), [32, 32]) {
        sound(&prepared);
        for hit in prepared.hits() {
            let hit = hit.expect("the ball is all around");
            assert!(hit.prim.0 == 1 && (hit.t - 9.0).abs() < 1e-5, "{hit:?}");
        }
    }
}

#[test]
fn f4_a_camera_on_a_corner_of_a_cube_sees_the_three_faces_opposite() {
    // The camera is at corner 0 of the unit cube, and all its rays run inside. Each leaves through the face of its
    // greatest direction component c, at t = 1 / c.
    let text = format!(
        "[[camera]]\nposition = [0, 0, 0]\nlook_at = [1, 1, 1]\nviewing_rectangle = [0.8, 0.8]\n\
         viewpoint_distance = 1\n{CUBE}"
    );
    for prepared in tiers(&scene(&text), [32, 32]) {
        sound(&prepared);
        for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
            assert!(ray.direction().min_element() > 0.0);
            let exact = 1.0 / ray.direction().max_element();
            let t = hit.expect("the cube is closed").t;
            let limit = 4.0 * prepared.world.numerics().ray_precision().epsilon();
            assert!((t - exact).abs() <= limit * exact, "{t} {exact}");
        }
    }
}

#[test]
fn f4_nothing_is_seen_through_a_closed_body_from_inside() {
    // Six views of 90 degrees, from inside a cube and from inside a sphere. No pixel shows the red background, and the
    // light outside does not reach the walls.
    for look_at in [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]] {
        for body in [CUBE.to_owned(), "[[sphere]]\ncentre = [0.5, 0.5, 0.5]\nradius = 0.5\n".into()] {
            let target = look_at.map(|c| f64::from(c) + 0.5);
            let text = format!(
                "[image]\nbackground = '#ff0000'\n[[camera]]\nposition = [0.5, 0.5, 0.5]\nlook_at = {target:?}\n\
                 vertical_fov = 90\n[ambient]\nintensity = 0.5\n\
                 [[light]]\ntype = 'point'\nposition = [3, 4, 5]\n{body}"
            );
            // The default grey is 0.8 of white; half of it is ambient.
            let dark = (kiln::film::colour::srgb_decode(0.8) / 2.0) as f32;
            for (film, numerics) in films(&scene(&text), [32, 32]).iter().zip(Numerics::ALL) {
                let light = film.rows().filter(|pixel| *pixel != [dark; 3]).count();
                assert!(light == 0 || !TIGHT.contains(&numerics), "{}: {light}", numerics.name());
            }
        }
    }
}

#[test]
fn f5_parallel_rays_through_corners_and_edges_of_a_lattice_hit_what_whole_numbers_say() {
    // 64 x 64 parallel rays onto a height field with integer corners, at four offsets: through its corners, along its
    // edges and between them. Their direction is -z, with zeros of both signs. The first corner is in pixel row 64 from
    // the top.
    let field = field();
    let vertices: Vec<[i64; 3]> = field.iter().flatten().copied().collect();
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let [cx, cy] = [dx, dy].map(|d: i64| 32.0 + d as f64 / 2.0);
        let text = format!(
            "[[camera]]\nposition = [{cx:?}, {cy:?}, 16]\nlook_at = [{cx:?}, {cy:?}, 0]\n\
             projection = 'orthographic'\nviewing_rectangle = [64, 64]\nviewpoint_distance = 16\n\
             [[triangles]]\nvertices = {vertices:?}\n"
        );
        for prepared in tiers(&scene(&text), [64, 64]) {
            sound(&prepared);
            let numerics = prepared.world.numerics();
            for (index, hit) in (0i64..).zip(prepared.hits()) {
                // Pixel centres in units of 1/2: 2 * (column + 0.5) + offset, rows counted from the bottom.
                let (x, y) = (2 * (index % 64) + 1 + dx, 2 * (63 - index / 64) + 1 + dy);
                let expected = under(&field, x, y);
                let found = hit.map(|hit| (hit.prim.0, hit.t));
                match (expected, found) {
                    (Some((id, depth)), Some((prim, t))) => {
                        assert!((t - depth).abs() <= 16.0 * numerics.precision().epsilon());
                        // Triangles that share the point tie; their rounded distances may differ.
                        assert!(prim == id || numerics != Numerics::Exact, "({x}, {y}): {prim}, not {id}");
                    }
                    (None, None) => {}
                    // Only in the tier that decides in f32 may a ray pass through an edge.
                    _ => assert_eq!(numerics, Numerics::Fast, "({x}, {y}): {expected:?} {found:?}"),
                }
            }
        }
    }
}

#[test]
fn f5_pictures_of_odd_and_even_sizes_have_no_holes() {
    // The same field, seen from above within its outline, in both projections and in odd and even sizes.
    let vertices: Vec<[i64; 3]> = field().into_iter().flatten().collect();
    let mut scene = scene(&format!("[[triangles]]\nvertices = {vertices:?}\n"));
    let middle = DVec3::new(32.0, 32.0, 0.0);
    for projection in [Projection::Perspective, Projection::Orthographic] {
        // From 64 above, the view is 48 wide at z = 0: 24 to each side of the middle, and the field reaches 32.
        scene.cameras = vec![camera(middle + DVec3::Z * 64.0, middle, projection, 48.0, 64.0)];
        for (size, numerics) in [31, 32, 63, 64, 65].iter().flat_map(|size| TIGHT.map(|tier| (*size, tier))) {
            let prepared = prepare(scene.clone(), [size, size], numerics);
            assert!(prepared.hits().iter().all(Option::is_some), "{size}: {}", numerics.name());
        }
    }
}

#[test]
fn f5_parallel_rays_that_touch_a_sphere_hit_it_and_those_beside_it_do_not() {
    // A sphere of radius 8 and rays with integer coordinates x and y, so that their squared distances from the
    // centre are integers; those at a distance of 8 touch it.
    let text = "[[camera]]\nposition = [0.5, 0.5, 20]\nlook_at = [0.5, 0.5, 0]\nprojection = 'orthographic'\n\
        viewing_rectangle = [32, 32]\nviewpoint_distance = 20\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 8\n";
    for prepared in tiers(&scene(text), [32, 32]) {
        sound(&prepared);
        for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
            let aside = ray.origin().x * ray.origin().x + ray.origin().y * ray.origin().y;
            assert_eq!(aside.fract(), 0.0, "whole distances");
            assert_eq!(hit.is_some(), aside <= 64.0, "{}: {ray:?}", prepared.world.numerics().name());
        }
    }
}

#[test]
fn f5_parallel_rays_in_a_plane_miss_it() {
    // A plane edge on: of 33 rows of rays the middle one lies in it, the others pass above and below; none hits it.
    let text = "[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\nprojection = 'orthographic'\n\
        viewing_rectangle = [33, 33]\nviewpoint_distance = 9\n\
        [[triangles]]\nvertices = [[-9, 0, -9], [9, 0, -9], [0, 0, 8]]\n";
    for prepared in tiers(&scene(text), [33, 33]) {
        sound(&prepared);
        assert!(prepared.hits().iter().all(Option::is_none));
        assert!(prepared.rays().iter().any(|ray| ray.origin().y == 0.0), "a row of rays lies in the plane");
    }
}

#[test]
fn f6_from_a_million_away_the_outline_is_that_of_the_rounded_rays() {
    // A ball of radius 1 at the origin, 1e6 from the eye, through a lens that shows 4 there. In f32 the rays are
    // rounded by up to 0.03 at the ball, so they are held to their own numbers; in f64 to the picture itself.
    let mut scene = scene("[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n");
    let eye = DVec3::new(6e5, 0.0, 8e5);
    scene.cameras = vec![camera(eye, DVec3::ZERO, Projection::Perspective, 4.0, 1e6)];
    for prepared in tiers(&scene, [33, 33]) {
        sound(&prepared);
        let numerics = prepared.world.numerics();
        for (index, (ray, hit)) in (0..).zip(prepared.rays().iter().zip(prepared.hits())) {
            let (d, f) = (ray.direction(), ray.origin());
            // How far the ray passes from the centre: |d x f| / |d|, to a few roundings of 1e6.
            let aside = d.cross(f).length() / d.length();
            if numerics != Numerics::Fast && (aside - 1.0).abs() > 1e-8 {
                assert_eq!(hit.is_some(), aside < 1.0, "{}: {aside}", numerics.name());
            }
            if numerics.ray_precision() == Precision::Double {
                // Pixels are 4 / 33 wide: the outline is 8.25 pixels from the middle, 68.06 squared, and 68 = 64 + 4.
                let (x, y) = (index % 33 - 16, index / 33 - 16);
                assert_eq!(hit.is_some(), x * x + y * y <= 68, "{}: ({x}, {y})", numerics.name());
            }
        }
    }
}

#[test]
fn f6_a_camera_beyond_the_numbers_of_its_tier_is_an_error() {
    // At 1e39 and more there are no f32 numbers; behind the border no ray may hold anything else.
    for far in [1e30, 1e37, 1e39, 1e100, 1e300] {
        let text = ball([0.0; 3], [0.0, 0.0, far], [0.0; 3], [0.0, 1.0, 0.0], 1.0);
        let scene = scene(&text);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let error = View::new(&scene.cameras[0], projection, [16, 16]).err();
            assert_eq!(error.is_some(), far > 1e38, "{far:e}");
            match error {
                None => drop(films(&scene, [16, 16])),
                Some(e) => assert!(matches!(e, Error::Usage { .. }) && !e.hint().is_empty()),
            }
        }
    }
}
