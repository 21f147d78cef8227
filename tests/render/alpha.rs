//! Surfaces of opacity below 1 against closed forms.

use crate::common::picture::{changed, parse};
use kiln::bvh::Numerics;
use kiln::error::Warnings;
use kiln::film::{Film, FilterShape};
use kiln::job::{RenderControl, RenderSettings, Statistics, prepare};
use kiln::scene::{PictureSettings, Samples, Scene, Transport};

/// An odd size, so that the diagonal of a square goes through the centres of pixels.
const SIZE: u32 = 33;

fn settings(samples: u32, transport: Transport) -> RenderSettings {
    let picture = PictureSettings {
        transport: Some(transport),
        colour: Some(kiln::film::ColourPipeline::Linear),
        samples: (samples > 1).then(|| Samples::clamped(samples)),
        filter: (samples > 1).then_some(FilterShape::Box),
        ..PictureSettings::of_size([SIZE; 2])
    };
    picture.into()
}

fn render(scene: Scene, settings: &RenderSettings) -> (Film, Statistics) {
    let job = prepare(scene, settings, &mut Warnings::default()).expect("a job");
    let (film, statistics) = job.render(&RenderControl::default()).expect("a picture");
    assert_eq!(statistics.non_finite, []);
    (film, statistics)
}

fn red(film: &Film) -> Vec<f64> {
    film.rows().map(|[red, ..]: [f32; 3]| red.into()).collect()
}

fn assert_every_pixel(scene: &str, settings: &RenderSettings, expected: f64) {
    let film = render(parse(scene), settings).0;
    for (i, value) in red(&film).into_iter().enumerate() {
        // The film holds f32; every pixel is a sum of a few products of f64.
        assert!((value - expected).abs() < 2e-7, "pixel {i}: {value}, expected {expected}");
    }
}

/// Looks along -z at panes of 4 by 4 units, of which the picture shows the middle 2 by 2. Surfaces show their colour.
const VIEW: &str = "[ambient]\nintensity = 1\n[image]\nheadlight = false\nbackground = '#ffffff'\n\
    [[camera]]\nprojection = 'orthographic'\nposition = [0, 0, 10]\nlook_at = [0, 0, 0]\nviewing_height = 2\nviewpoint_distance = 1\n";

/// A pane at height `z`, grey of 8-bit value `grey`.
fn pane(name: &str, z: f64, grey: u8, opacity: f64) -> String {
    format!(
        "[material.{name}]\ncolour = '#{grey:02x}{grey:02x}{grey:02x}'\nopacity = {opacity}\n\
         [[triangles]]\nname = '{name}'\nmaterial = '{name}'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
         vertices = [[-2, -2, {z}], [2, -2, {z}], [2, 2, {z}], [-2, 2, {z}]]\n"
    )
}

fn linear(grey: u8) -> f64 {
    kiln::film::colour::srgb_decode(f64::from(grey) / 255.0)
}

/// `over` from the nearest to the farthest pane, then the white background, whatever the order in the file. The pixels on
/// the diagonal hit the shared edge of two triangles; they too see each pane once.
#[test]
fn panes_are_blended_by_depth_and_once_each() {
    let panes = [("a", 1.0, 40, 0.3), ("b", 0.0, 200, 0.6), ("c", -1.0, 120, 0.25)];
    let mut expected = 1.0;
    for (_, _, grey, opacity) in panes.iter().rev() {
        expected = opacity * linear(*grey) + (1.0 - opacity) * expected;
    }
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        let panes: String = order.iter().map(|&i| panes[i]).map(|(n, z, g, o)| pane(n, z, g, o)).collect();
        for numerics in Numerics::STRICT {
            let own = settings(1, Transport::Whitted);
            let settings = changed(own, |picture| picture.numerics = Some(numerics));
            assert_every_pixel(&format!("{VIEW}{panes}"), &settings, expected);
        }
    }
}

/// The ray through a sphere of opacity a crosses it twice, so a part of (1 - a)^2 of the background is left.
#[test]
fn a_ball_covers_by_both_of_its_sides() {
    let ball = "[material.ball]\ncolour = '#000000'\nopacity = 0.4\n\
        [[sphere]]\nmaterial = 'ball'\ncentre = [0, 0, 0]\nradius = 3\n";
    assert_every_pixel(&format!("{VIEW}{ball}"), &settings(1, Transport::Whitted), 0.36);
}

/// Several samples choose one layer each, with the probability of its weight: the mean is that of the exact picture, and the
/// variance of a pixel's mean is at most that of independent samples.
#[test]
fn samples_converge_to_the_blended_colour() {
    let panes = format!("{VIEW}{}{}", pane("a", 1.0, 0, 0.3), pane("b", 0.0, 0, 0.5));
    let expected = 0.7 * 0.5;
    for transport in [Transport::Whitted, Transport::Path] {
        let samples = 64;
        let values = red(&render(parse(&panes), &settings(samples, transport)).0);
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let independent = expected * (1.0 - expected) / f64::from(samples);
        assert!((mean - expected).abs() < 4.0 * (independent / count).sqrt(), "{transport:?}: {mean}");
        assert!(variance < 0.25 * independent, "{transport:?}: {variance} is not stratified ({independent})");
    }
}

/// A directional light through panes of opacity 0.5 and 0.2 lights the floor with 0.4 of its strength, without noise: the
/// camera, below the panes, sees the floor alone.
#[test]
fn shadows_of_panes_are_the_product_of_their_transmittances() {
    let scene = |panes: &str| {
        format!(
            "[ambient]\nintensity = 0\n[[camera]]\nprojection = 'orthographic'\nposition = [0, 0, 1]\n\
             look_at = [0, 0, 0]\nviewing_height = 2\nviewpoint_distance = 1\n\
             [[light]]\nname = 'sun'\ntype = 'directional'\ndirection = [0, 0, -1]\nintensity = 0.5\n{}{panes}",
            pane("floor", 0.0, 255, 1.0)
        )
    };
    let panes = pane("a", 3.0, 10, 0.5) + &pane("b", 2.0, 10, 0.2);
    for transport in [Transport::Whitted, Transport::Path] {
        let mut settings = settings(1, transport);
        settings.with = vec!["path=1".into()];
        assert_every_pixel(&scene(""), &settings, 0.5);
        assert_every_pixel(&scene(&panes), &settings, 0.2);
        assert_every_pixel(&scene(&(panes.clone() + &pane("c", 2.5, 10, 1.0))), &settings, 0.0);
    }
}

/// Under a uniform sky of radiance 1 white diffuse surfaces of any opacity have the radiance 1: what they cover they reflect,
/// and what they let through is 1 again.
#[test]
fn the_white_furnace_holds_for_every_opacity() {
    for opacity in [0.0, 0.3, 0.9] {
        let scene = format!(
            "[environment]\ncolour = '#ffffff'\n[[camera]]\nposition = [0, 0, 6]\nlook_at = [0, 0, 0]\n\
             vertical_fov = 30\n[material.ball]\ncolour = '#ffffff'\nopacity = {opacity}\n\
             [[sphere]]\nmaterial = 'ball'\ncentre = [0, 0, 0]\nradius = 1.2\n{}",
            pane("pane", -0.3, 255, opacity)
        );
        let mut settings = settings(64, Transport::Path);
        settings.with = vec!["path=100".into()];
        let values = red(&render(parse(&scene), &settings).0);
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        assert!((mean - 1.0).abs() < 4.0 * (variance / count).sqrt() + 1e-6, "{opacity}: {mean}");
    }
}

/// The closest surface of an opacity of at least one half.
#[test]
fn depth_is_that_of_the_first_surface_that_covers_more_than_half() {
    let scene = format!("{VIEW}{}{}", pane("thin", 1.0, 9, 0.4), pane("thick", 0.0, 9, 0.6));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, scene).expect("a file");
    let picture = folder.path().join("depth.exr");
    let kiln = std::process::Command::new(env!("CARGO_BIN_EXE_kiln"))
        .args(["render", "--aov", "depth", "-o"])
        .args([&picture, &file])
        .output()
        .expect("kiln runs");
    assert!(kiln.status.success(), "{}", String::from_utf8_lossy(&kiln.stderr));
    let image = exr::prelude::read_first_flat_layer_from_file(&picture).expect("an EXR file");
    let depth = image.layer_data.channel_data.list.iter().find(|c| c.name.to_string().ends_with('Z'));
    let values: Vec<f32> = depth.expect("a depth").sample_data.values_as_f32().collect();
    assert!(values.iter().all(|&depth| depth == 10.0), "{:?}", &values[..4]);
}

/// The filter of textures is that of opacities, too. A leaf over x from -2 to 2 has a hole in its left half; `nearest`
/// gives it a hard edge at x = 0, which bilinear interpolation smooths from -1 to 1 or, with a cutoff of 1/2 between
/// 100 and 255, moves to x = -2 + 4 (1/4 + (127.5 - 100) / (255 - 100) / 2) = -0.65. Seen from above before white, and
/// as the shadow on a floor below it.
#[test]
fn nearest_texels_of_opacity_have_hard_edges() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("leaf.mtl", "newmtl leaf\nKd 0 0 0\nmap_d leaf.png\n");
    write(
        "leaf.obj",
        "mtllib leaf.mtl\nv -2 -2 2\nv 2 -2 2\nv 2 2 2\nv -2 2 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl leaf\n\
         f 1/1 2/2 3/3 4/4\n",
    );
    let leaf = "[[mesh]]\nfile = 'leaf.obj'\n";
    let floor = "[ambient]\nintensity = 0\n[[camera]]\nprojection = 'orthographic'\nposition = [0, 0, 1]\n\
         look_at = [0, 0, 0]\nviewing_height = 2\nviewpoint_distance = 1\n\
         [[light]]\nname = 'sun'\ntype = 'directional'\ndirection = [0, 0, -1]\nintensity = 1\n";
    write("above.toml", &format!("{VIEW}{leaf}"));
    write("below.toml", &format!("{floor}{}{leaf}", pane("floor", 0.0, 255, 1.0)));
    for (cutoff, hole) in [(None, 0), (Some(0.5), 100)] {
        let image =
            image::GrayAlphaImage::from_fn(2, 1, |x, _| image::LumaA([0, if x == 0 { hole } else { 255 }]));
        image.save(folder.path().join("leaf.png")).expect("a picture");
        for (file, transport) in ["above.toml", "below.toml"]
            .into_iter()
            .flat_map(|file| [(file, Transport::Whitted), (file, Transport::Path)])
        {
            let mut scene = crate::common::picture::load(&folder.path().join(file));
            for material in &mut scene.materials {
                if let kiln::scene::Material::Phong(kiln::scene::Phong { opacity: Some(opacity), .. }) =
                    material
                {
                    opacity.cutoff = cutoff;
                }
            }
            let mut settings = settings(1, transport);
            settings.with = vec!["path=1".into(), "textures=nearest".into()];
            for (i, value) in red(&render(scene, &settings).0).into_iter().enumerate() {
                // The centre of column 16 is at x = 0.
                let column = i as u32 % SIZE;
                let expected = if column < SIZE / 2 { 1.0 } else { 0.0 };
                let is_right = column == SIZE / 2 || (value - expected).abs() < 2e-7;
                assert!(is_right, "{file}, {transport:?}, {cutoff:?}: pixel {i} is {value}");
            }
        }
    }
}

/// Opaque surfaces call for no effect: no stage, no ray, no byte.
#[test]
fn an_opacity_of_one_costs_nothing() {
    let scene = format!("{VIEW}{}", pane("a", 0.0, 10, 1.0));
    let job = prepare(parse(&scene), &settings(1, Transport::Whitted), &mut Warnings::default()).unwrap();
    let alpha = |job: &kiln::job::RenderJob| {
        job.plan.decisions.iter().find(|d| d.effect == kiln::effects::id::ALPHA).expect("it exists").on
    };
    assert!(!alpha(&job));
    let scene = scene.replace("opacity = 1", "opacity = 0.5");
    let job = prepare(parse(&scene), &settings(1, Transport::Whitted), &mut Warnings::default()).unwrap();
    assert!(alpha(&job));
}

/// Which surfaces a path passes depends on its pixel and sample, not on how the tier rounds what it hits: `double` and
/// `exact` differ by rounding alone.
#[test]
fn paths_pass_the_same_surfaces_in_double_and_exact() {
    let scene = || crate::common::picture::load(&crate::common::repository("scenes/effects/alpha.toml"));
    let film = |numerics| {
        let settings = changed(settings(6, Transport::Path), |picture| {
            let own = PictureSettings { numerics: Some(numerics), ..PictureSettings::of_size([160, 120]) };
            *picture = own.or(*picture);
        });
        red(&render(scene(), &settings).0)
    };
    let (double, exact) = (film(Numerics::Double), film(Numerics::Exact));
    let differing = double.iter().zip(&exact).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
    // A path next to an edge may find the face beyond it.
    assert!(differing <= 2, "{differing} pixels differ");
}
