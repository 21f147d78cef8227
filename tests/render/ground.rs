//! The ground under a scene: where it lies, what it shows, and that cameras are not fitted to it.

use crate::common::picture::{parse, placed};
use crate::path::{check_settings, mean, render, settings};
use glam::DVec3;
use kiln::error::Warnings;
use kiln::film::ColourPipeline;
use kiln::job::metadata::fingerprint_of;
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::scene::{Background, ColourValue, Look, PictureSettings, Scene, Transport};

/// A ball of radius 1 that touches the plane y = 0, under a light straight above. Its box has the radius sqrt 3.
const BALL: &str = "[[sphere]]\ncentre = [0, 1, 0]\nradius = 1\n\
    [[light]]\ntype = 'directional'\ndirection = [0, -1, 0]\nintensity = 0.8\n";

/// The ball with a ground, of which a camera sees next to nothing but the point (x, 0, 0).
fn at(x: f64) -> String {
    format!(
        "[image]\nground = true\nbackground = '#ffffff'\n[[camera]]\nposition = [{x}, 30, 40]\nlook_at = [{x}, 0, 0]\n\
         vertical_fov = 0.001\n{BALL}"
    )
}

fn job(scene: Scene, settings: &RenderSettings) -> RenderJob {
    prepare(scene, settings, &mut Warnings::default()).expect("a job")
}

/// Of albedo 0.5 and lit straight down: half the light's intensity, 0 in the shadow of the ball, and the background
/// beyond 20 radii, which are 34.64.
#[test]
fn the_ground_is_lit_shadowed_and_ends() {
    for (x, expected) in [(1.01, 0.4), (-34.6, 0.4), (34.6, 0.4), (34.7, 1.0)] {
        check_settings(&at(x), &settings(1, 1), expected);
    }
    // It is no shadow on a backdrop, also where an exposure would change the background.
    let exposed = |x| at(x).replace("[image]\n", "[image]\nexposure = 1\n");
    check_settings(&exposed(1.01), &settings(1, 1), 0.4);
    // The white background stays white: that is light of 1/2.
    check_settings(&exposed(34.7), &settings(1, 1), 0.5);
    // Seen from the side, below the ball.
    let shadow = at(0.0).replace("position = [0, 30, 40]", "position = [0, 1, 9]");
    assert_eq!(mean(&render(parse(&shadow), &settings(1, 1))).0, 0.0);
    // Local shading with the ambient light of 0.25, too.
    let local = crate::common::picture::changed(settings(1, 1), |picture| picture.transport = None);
    let whitted = RenderSettings { with: Vec::new(), ..local };
    check_settings(&at(1.01), &whitted, 0.4 + 0.5 * 0.25);
}

#[test]
fn cameras_are_fitted_to_the_objects_alone() {
    let settings = |ground| PictureSettings { ground, ..PictureSettings::default() }.into();
    let of = |ground| job(parse(BALL), &settings(ground));
    let (with, without) = (of(Some(true)), of(None));
    assert_eq!(with.camera, without.camera);
    assert_eq!((with.world.primitive_count(), without.world.primitive_count()), (3, 1));
    let is_ground =
        |(key, value): &(String, String)| (key.as_str(), value.as_str()) == ("kiln:ground", "true");
    assert!(with.metadata.iter().any(is_ground) && !without.metadata.iter().any(is_ground));
    assert_ne!(fingerprint_of(&with.metadata), fingerprint_of(&without.metadata));
    // The option and the key of a scene file are the same; the option comes first.
    let file = |text: &str, ground| job(parse(&format!("[image]\n{text}{BALL}")), &settings(ground));
    let (of_file, typed) = (file("ground = true\n", None), file("", Some(true)));
    assert_eq!(fingerprint_of(&of_file.metadata), fingerprint_of(&typed.metadata));
    assert_eq!(file("ground = true\n", Some(false)).world.primitive_count(), 1);
}

/// A ground that lies in the plane of a sheet of the scene does not show through it: the picture has no speckle. Beside
/// it the sheet hides the ground's grey.
#[test]
fn a_sheet_in_the_lowest_plane_hides_the_ground() {
    let scene = "[image]\nground = true\n[material.white]\ncolour = '#ffffff'\n\
        [[camera]]\nposition = [3, 2, 5]\nlook_at = [0, 0.3, 0]\nvertical_fov = 2\n\
        [[light]]\ntype = 'directional'\ndirection = [0, -1, 0]\nintensity = 0.5\n\
        [[triangles]]\nmaterial = 'white'\nvertices = [[-9, 0.3, -9], [9, 0.3, -9], [0, 0.3, 18]]\n";
    for far in [0.0, 200.0] {
        let scene = placed(parse(scene), 1.0, DVec3::new(far, far, 0.0));
        let film = render(scene, &settings(1, 1));
        let speckled = film.rows().filter(|[red, ..]: &[f32; 3]| (red - 0.5).abs() > 1e-4).count();
        assert_eq!(speckled, 0, "{far}");
    }
}

/// It moves with scenes that are brought into the range of f32.
#[test]
fn the_ground_of_a_recentered_scene() {
    for (scale, offset) in [(1e-20, DVec3::ZERO), (1e20, DVec3::ZERO), (1.0, DVec3::splat(1e5))] {
        let scene = placed(parse(&at(1.05)), scale, offset);
        let (seen, _) = mean(&render(scene, &settings(1, 1)));
        assert!((seen - 0.4).abs() < 1e-6, "{scale} {offset}: {seen}");
    }
}

/// The transparent picture of a mesh's default look, also of glass, over a colour is the picture before that background: the light is
/// the same, and so are the shadows on the ground. Alpha is of displayed linear light, so the sum is exact but for f32,
/// and for white, which stands for 0.9975: 0.0025.
#[test]
fn a_transparent_picture_over_a_colour_is_that_before_the_colour() {
    let studio = |mesh: &str, background: Option<Background>, transport| {
        let size = PictureSettings::of_size([32, 32]);
        let picture = PictureSettings { background, transport, ..size };
        job(as_mesh(mesh), &RenderSettings { mesh_look: Look::Studio, ..picture.into() })
    };
    let ball = BALL.split("[[light]]").next().unwrap();
    let glass = format!(
        "[material.glass]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\n\
         layers = {{ transmission = 1, volume = true }}\n{ball}material = 'glass'\n"
    );
    for (mesh, transport) in [(ball, None), (ball, Some(Transport::Path)), (&glass, None)] {
        let transparent = studio(mesh, Some(Background::Transparent), transport);
        let (film, _) = transparent.render::<[f32; 4]>(&RenderControl::default()).unwrap();
        let display = transparent.display().known();
        let shadows = film.rows().filter(|&[r, g, b, alpha]| [r, g, b] == [0.0; 3] && alpha > 0.1).count();
        assert!(shadows > 10, "{shadows} pixels of shadow");
        for colour in [[0; 3], [255; 3], [70, 130, 180]] {
            let background = Background::Colour(ColourValue(colour));
            let before = studio(mesh, Some(background), transport);
            let (before, _) = before.render::<[f32; 3]>(&RenderControl::default()).unwrap();
            let backdrop = background.colour().to_pipeline(ColourPipeline::Linear);
            let mut free = 0;
            for ([r, g, b, alpha], before) in film.rows().zip(before.rows()) {
                let alpha = f64::from(alpha);
                let own = DVec3::new(r.into(), g.into(), b.into());
                let own = if alpha > 0.0 { display.apply(own / alpha) * alpha } else { DVec3::ZERO };
                let expected = own + backdrop * (1.0 - alpha);
                let shown = display.apply(DVec3::from(before.map(f64::from)));
                assert!((shown - expected).abs().max_element() < 0.0026, "{colour:?}: {shown} {expected}");
                // Where nothing is missing, the colour itself is shown: 1e-4 is less than a tenth of half a step of 255.
                if alpha < 1e-4 {
                    assert_eq!(display.encode(ColourPipeline::Linear, before), colour);
                    free += 1;
                }
            }
            assert!(free > 10, "{free} pixels without shadow");
        }
    }
}

/// Objects as a scene without a scene file.
fn as_mesh(objects: &str) -> Scene {
    Scene { has_settings: false, picture: PictureSettings::default(), ..parse(objects) }
}

/// Before a transparent background the alpha of the ground is the part of its light that is missing: none beside the
/// ball, the part of the light in its shadow. Without ambient light, all of it.
#[test]
fn the_alpha_of_a_shadow_is_the_missing_light() {
    let alpha = |text: &str, settings: &RenderSettings| {
        let text = text.replace("[image]\n", "[image]\nlook = 'studio'\n").replace("#ffffff", "transparent");
        let job = job(parse(&text), settings);
        let (film, _) = job.render::<[f32; 4]>(&RenderControl::default()).unwrap();
        let count = film.rows().count();
        film.rows().map(|pixel| f64::from(pixel[3])).sum::<f64>() / count as f64
    };
    // Past the ball: the line is 9.4 / 9.01 from its centre.
    let shadow = at(0.8).replace("position = [0.8, 30, 40]", "position = [9.8, 0.5, 0]");
    let paths = settings(1, 1);
    let local = crate::common::picture::changed(settings(1, 1), |picture| picture.transport = None);
    let whitted = RenderSettings { with: Vec::new(), ..local };
    for (settings, expected) in [(&paths, 1.0), (&whitted, 0.8 / (0.8 + 0.25))] {
        let found = alpha(&shadow, settings);
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        assert!(alpha(&at(1.01), settings).abs() < 1e-6);
    }
}
