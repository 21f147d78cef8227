//! The light that limits leave out, against closed forms and against pictures without limits. Pictures have the same
//! bits with and without the measurement.

use crate::common::picture::{changed, parse};
use crate::path::settings;
use kiln::effects::light_left_out::Estimate;
use kiln::error::Warnings;
use kiln::film::colour::luminance;
use kiln::film::{Film, Window};
use kiln::job::{RenderControl, RenderJob, RenderSettings, notes_of_result, prepare};
use kiln::render::Statistics;
use kiln::render::aov::{AovSelection, channels};
use kiln::scene::{Bounces, Clamp, Noise};

const SEEDS: u32 = 20;

fn job(scene: &str, settings: &RenderSettings) -> RenderJob {
    prepare(parse(scene), settings, &mut Warnings::default()).expect("a job")
}

fn render(scene: &str, settings: &RenderSettings) -> (Film, Statistics) {
    job(scene, settings).render(&RenderControl::default()).expect("a picture")
}

fn by_depth(statistics: &Statistics) -> Estimate {
    statistics.left_out.as_ref().expect("it is measured").by_depth()
}

fn seeded(settings: &RenderSettings, seed: u32) -> RenderSettings {
    changed(settings.clone(), |picture| picture.seed = Some(seed))
}

/// Settings with the default limit of bounces and one of specular bounces.
fn specular(samples: u32, limit: u32) -> RenderSettings {
    let mut settings = changed(settings(samples, 0), |p| p.depth_specular = Some(Bounces::clamped(limit)));
    settings.with.clear();
    settings
}

/// The estimates of 20 seeds: their mean lies within two of its standard errors of the expected share, and the errors
/// themselves are right: the sum of the squared deviations over them is chi-squared with 20 degrees of freedom, which
/// is below 5.9 and above 45.3 with a probability of 1e-3 each.
fn check(name: &str, scene: &str, settings: &RenderSettings, expected: f64) {
    let of = |seed| by_depth(&render(scene, &seeded(settings, seed)).1);
    let estimates: Vec<Estimate> = (0..SEEDS).map(of).collect();
    let mean = estimates.iter().map(|e| e.mean).sum::<f64>() / f64::from(SEEDS);
    let error = estimates.iter().map(|e| e.error * e.error).sum::<f64>().sqrt() / f64::from(SEEDS);
    let squares: f64 = estimates.iter().map(|e| ((e.mean - expected) / e.error).powi(2)).sum();
    println!("{name}: {mean:.5} +- {error:.5}, expected {expected:.5}; {squares:.1}");
    assert!(error < 0.05 * expected, "{name}: an error of {error} shows nothing of {expected}");
    assert!((mean - expected).abs() < 2.0 * error, "{name}: {mean} +- {error}, expected {expected}");
    assert!((5.9..45.3).contains(&squares), "{name}: {squares}");
}

/// The inside of a closed surface that emits 1 and reflects half of what it receives: the radiance is 1 + 1/2 + 1/4 +
/// ..., of which n bounces show all but 2^-(n + 1).
const ROOM: &str = "[[camera]]\nposition = [0.1, 0.2, 0]\nlook_at = [1, 0.3, 0.2]\nvertical_fov = 90\n\
    [material.wall]\ncolour = '#ffffff'\ndiffuse = 0.5\nemission = '#ffffff'\n\
    [[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 2\n";

#[test]
fn a_furnace_leaves_out_its_geometric_tail() {
    for depth in [0, 1, 4] {
        check(&format!("furnace, {depth}"), ROOM, &settings(64, depth), 0.5_f64.powi(depth as i32 + 1));
    }
}

/// Two parallel mirrors that emit 1 and reflect 188 of 255, and a camera between them.
fn corridor() -> String {
    let mirror = |z: i32| {
        format!(
            "[[triangles]]\nmaterial = 'mirror'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
             vertices = [[-9, -9, {z}], [9, -9, {z}], [9, 9, {z}], [-9, 9, {z}]]\n"
        )
    };
    format!(
        "[[camera]]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\nvertical_fov = 0.1\n\
         [material.mirror]\ncolour = '#bcbcbc'\nmetallic = 1\nroughness = 0\nemission = '#ffffff'\n{}{}",
        mirror(0),
        mirror(2)
    )
}

/// A lamp in a bottle: a shell of glass, the inside of which is air.
const BOTTLE: &str = "[image]\nbackground = '#000000'\n[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 30\n\
    [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n\
    [material.glass]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\nlayers = { ior = 1.5, transmission = 1, volume = true }\n\
    [material.air]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\nlayers = { ior = 1.0, transmission = 1, volume = true }\n\
    [[sphere]]\nmaterial = 'air'\ncentre = [0, 0, 0]\nradius = 0.9\n\
    [[sphere]]\nmaterial = 'glass'\ncentre = [0, 0, 0]\nradius = 1\n\
    [[sphere]]\nmaterial = 'lamp'\ncentre = [0, 0, 0]\nradius = 0.5\n";

/// Between two parallel mirrors that emit 1 and reflect r = 0.5029 (188 in sRGB) the radiance is the sum of all r^k; at
/// the angles of this camera, below 0.1 degrees, Schlick's term adds less than 1e-12.
#[test]
fn a_corridor_of_mirrors_leaves_out_its_geometric_tail() {
    let scene = corridor();
    let r = ((188.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    check("corridor, 4 bounces", &scene, &settings(32, 4), r.powi(5));
    check("corridor, 3 specular bounces", &scene, &specular(32, 3), r.powi(4));
}

/// `count` thin panes before a wall of radiance 1.
fn panes(count: u32) -> String {
    let plate = |z: u32, material: &str| {
        format!(
            "[[triangles]]\nmaterial = '{material}'\nindices = [[0, 1, 2], [0, 2, 3]]\n\
             vertices = [[-20, -20, {z}], [20, -20, {z}], [20, 20, {z}], [-20, 20, {z}]]\n"
        )
    };
    let panes: String = (1..=count).map(|z| plate(z, "pane")).collect();
    format!(
        "[image]\nbackground = '#000000'\nheadlight = false\n[ambient]\nintensity = 0\n\
         [[camera]]\nposition = [0, 0, 400]\nlook_at = [0, 0, 0]\nvertical_fov = 0.2\n\
         [material.wall]\ncolour = '#000000'\nemission = '#ffffff'\n\
         [material.pane]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\nlayers = {{ ior = 1.5, transmission = 1 }}\n\
         {}{panes}",
        plate(0, "wall")
    )
}

/// The light of the wall after at most `bounces` events at panes that reflect R = ((1.5 - 1) / (1.5 + 1))^2 = 0.04 and
/// pass the rest: a walk along the panes, weighted by what goes down and up towards each.
fn seen_through(count: usize, bounces: u32) -> f64 {
    let reflected = 0.04;
    let mut down = vec![0.0; count + 2];
    let mut up = down.clone();
    down[count] = 1.0;
    let mut seen = 0.0;
    for _ in 0..bounces {
        let (mut next_down, mut next_up) = (vec![0.0; count + 2], vec![0.0; count + 2]);
        for i in 1..=count {
            next_down[i - 1] += (1.0 - reflected) * down[i] + reflected * up[i];
            next_up[i + 1] += reflected * down[i] + (1.0 - reflected) * up[i];
        }
        seen += next_down[0];
        (down, up) = (next_down, next_up);
    }
    seen
}

/// With all reflections between N panes they pass (1 - R) / (1 + (N - 1) R).
#[test]
fn panes_leave_out_what_the_bounces_do_not_reach() {
    let all = |count: usize| 0.96 / (1.0 + 0.04 * (count as f64 - 1.0));
    assert!((seen_through(10, 2000) - all(10)).abs() < 1e-9);
    for depth in [10, 12] {
        let expected = 1.0 - seen_through(10, depth) / all(10);
        check(&format!("10 panes, {depth} bounces"), &panes(10), &settings(64, depth), expected);
    }
    let expected = 1.0 - seen_through(10, 12) / all(10);
    check("10 panes, 12 specular bounces", &panes(10), &specular(64, 12), expected);
}

/// Where all rays of a batch are perfectly transmitted and no other bounce is allowed, every ray continues, and a share
/// of them is traced once more beside them: panes have no lobe that is left out.
#[test]
fn rays_that_all_continue_leave_room_for_those_that_are_repeated() {
    let settings = changed(settings(64, 0), |p| p.depth_specular = Some(Bounces::clamped(64)));
    let (film, statistics) = render(&panes(10), &settings);
    assert_eq!(by_depth(&statistics).mean, 0.0);
    let (mean, error) = crate::path::mean(&film);
    assert!((mean - 0.96 / 1.36).abs() < 4.0 * error && error < 0.01, "{mean} +- {error}");
}

/// The mean luminance of a picture.
fn light(film: &Film) -> f64 {
    let pixels: Vec<[f32; 3]> = film.rows().collect();
    let sum: f64 = pixels.iter().map(|p| luminance(glam::DVec3::from(p.map(f64::from)))).sum();
    sum / pixels.len() as f64
}

/// A room with diffuse, rough and smooth metal, glass that absorbs, and a mirror with a coat.
fn mixed_room() -> String {
    format!(
        "[[camera]]\nposition = [-1.8, 0.3, 1.7]\nlook_at = [0.5, -0.4, -0.5]\nvertical_fov = 70\n\
         [material.wall]\ncolour = '#d0b8a0'\n\
         [material.metal]\ncolour = '#e0c070'\nmetallic = 1\nroughness = 0.4\n\
         [material.mirror]\ncolour = '#e0e0e0'\nmetallic = 1\nroughness = 0\n\
         [material.gloss]\ncolour = '#4060a0'\nmetallic = 0\nroughness = 0\n\
         [material.glass]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\n\
         layers = {{ ior = 1.5, transmission = 1, volume = true, attenuation_colour = '#80ff80', attenuation_distance = 1 }}\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#fff0d0'\nemission_intensity = 6\n\
         [[mesh]]\nmaterial = 'wall'\nfile = '{}'\n\
         [[sphere]]\nmaterial = 'metal'\ncentre = [0.7, -1.1, -0.6]\nradius = 0.6\n\
         [[sphere]]\nmaterial = 'glass'\ncentre = [-0.7, -1.2, -0.4]\nradius = 0.5\n\
         [[sphere]]\nmaterial = 'mirror'\ncentre = [0, -0.2, -1]\nradius = 0.4\n\
         [[sphere]]\nmaterial = 'gloss'\ncentre = [0.2, -1.3, 0.4]\nradius = 0.4\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, -0.8], [0.8, 1.1, 0.8]]\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, 0.8], [-0.8, 1.1, 0.8]]\n",
        crate::path::room_file()
    )
}

/// Picture and light left out are together the picture of 1000 bounces: a t-test of 8 seeds each, in which |t| is above
/// 4.2 with a probability of 1e-3.
#[test]
fn picture_and_light_left_out_are_the_picture_of_all_bounces() {
    let scene = mixed_room();
    let values = |settings: &RenderSettings, seeds: std::ops::Range<u32>| -> [Vec<f64>; 2] {
        let all = |seed| {
            let (film, statistics) = render(&scene, &seeded(settings, seed));
            [light(&film), light(&film) / (1.0 - by_depth(&statistics).mean)]
        };
        let found: Vec<[f64; 2]> = seeds.map(all).collect();
        [0, 1].map(|k| found.iter().map(|values| values[k]).collect())
    };
    let moments = |values: &[f64]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    let (expected, variance) = moments(&values(&settings(64, 1000), 100..108)[1]);
    let mut both = settings(64, 2);
    both.picture.depth_specular = Some(Bounces::clamped(1));
    for (name, limits) in [
        ("no bounce", settings(64, 0)),
        ("1 bounce", settings(64, 1)),
        ("2 and 1 specular", both),
        ("8 and 0 specular", specular(64, 0)),
    ] {
        let [without, with] = values(&limits, 0..8).map(|values| {
            let (mean, own) = moments(&values);
            (mean - expected) / (variance + own).sqrt()
        });
        println!("{name}: t {with:.2}, of the picture alone {without:.1}");
        assert!(with.abs() < 4.2, "{name}: {with}");
        assert!(without < -8.4, "{name}: the test would not miss the light left out: {without}");
    }
}

/// What the clamp takes away is exactly what a picture without it has more, sample by sample.
#[test]
fn clamped_light_is_that_of_the_picture_without_a_clamp() {
    let all = |clamp: Option<f64>| {
        let settings = changed(settings(16, 5), |picture| picture.clamp = clamp.map(Clamp::clamped));
        let (film, statistics) = render(&mixed_room(), &settings);
        let left_out = statistics.left_out.expect("it is measured");
        let [depth, clamp] = [left_out.by_depth().mean, left_out.by_clamp().mean];
        (light(&film) / (1.0 - depth - clamp), clamp)
    };
    let ((without, none), (with, clamped)) = (all(None), all(Some(0.05)));
    assert!(none == 0.0 && clamped > 0.05, "{none} {clamped}");
    // Pictures are rounded to f32.
    assert!((with / without - 1.0).abs() < 1e-6, "{with} {without}");
}

/// Pictures have the same bits with and without the measurement, whatever they are sampled by; the measurement has
/// the same for any crop; without it there is none.
#[test]
fn pictures_are_the_same_without_the_measurement() {
    let plain = settings(4, 2);
    let adaptive = changed(settings(32, 2), |picture| picture.noise = Some(Noise::clamped(0.05)));
    let clamped = changed(settings(4, 3), |picture| picture.clamp = Some(Clamp::clamped(0.3)));
    for settings in [plain, adaptive, clamped, specular(4, 1), specular(4, 64)] {
        let (film, statistics) = render(&mixed_room(), &settings);
        let (again, same) = render(&mixed_room(), &settings);
        let mut off = settings.clone();
        off.without.push("left-out".into());
        let (other, none) = render(&mixed_room(), &off);
        assert!(film == other && film == again);
        assert_eq!(statistics.left_out, same.left_out);
        assert!(none.left_out.is_none());
    }
}

/// The AOV is 0 where nothing is left out; its mean is the light left out of the picture.
#[test]
fn the_aov_has_the_light_left_out_of_each_pixel() {
    let aov = |settings: &RenderSettings, window: Option<Window>| {
        let mut job = job(&mixed_room(), settings);
        if let Some(window) = window {
            job.window = window;
        }
        let (film, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        let selection = AovSelection::new(&["left-out".into()]).expect("an AOV");
        let found = channels(&job.aov_source(Some(&film)), &selection, &RenderControl::default());
        let rgb = found.expect("channels").into_iter().map(|channel| channel.values).collect::<Vec<_>>();
        (light(&film), by_depth(&statistics), rgb)
    };
    let (picture, share, rgb) = aov(&settings(64, 2), None);
    let mean = |k: usize| rgb[k].iter().map(|&v| f64::from(v)).sum::<f64>() / rgb[k].len() as f64;
    let left_out = luminance(glam::DVec3::new(mean(0), mean(1), mean(2)));
    let expected = picture * share.mean / (1.0 - share.mean);
    assert!(left_out > 0.0 && (left_out / expected - 1.0).abs() < 1e-5, "{left_out} {expected}");
    let crop = Window { x: 7, y: 5, width: 20, height: 30 };
    let (_, _, part) = aov(&settings(64, 2), Some(crop));
    for (i, value) in part[0].iter().enumerate() {
        let (x, y) = (7 + i % 20, 5 + i / 20);
        assert_eq!(value, &rgb[0][y * crate::path::SIZE as usize + x], "({x}, {y})");
    }
    let (_, _, whitted) = {
        let local = changed(settings(1, 2), |picture| picture.transport = None);
        let mut local = local;
        local.with.clear();
        let job = job(&mixed_room(), &local);
        let selection = AovSelection::new(&["left-out".into()]).expect("an AOV");
        let found = channels(&job.aov_source(None), &selection, &RenderControl::default()).expect("channels");
        (0, 0, found)
    };
    assert!(whitted.iter().all(|channel| channel.values.iter().all(|&value| value == 0.0)));
}

/// Panes, a corridor and a bottle at limits that cut them have a note with a share, its error and options that help;
/// not the furnace at a limit that suffices.
#[test]
fn a_note_says_what_is_left_out() {
    let note = |scene: &str, settings: &RenderSettings| {
        let job = job(scene, settings);
        let (_, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        notes_of_result(&job, &statistics).next()
    };
    let of_panes = note(&panes(10), &settings(64, 10)).expect("a note");
    assert!(of_panes.starts_with("10 bounces leave out ") && of_panes.contains(" ± "), "{of_panes}");
    assert!(of_panes.contains("; --depth ") && of_panes.contains(" times the time"), "{of_panes}");
    assert_eq!(note(ROOM, &settings(16, 12)), None);
    let corridor = note(&corridor(), &settings(64, 2)).expect("a note");
    assert!(corridor.starts_with("2 bounces leave out "), "{corridor}");
    let bottle = note(BOTTLE, &settings(64, 1)).expect("a note");
    assert!(bottle.starts_with("1 bounce leaves out "), "{bottle}");
    assert_eq!(note(BOTTLE, &specular(64, 64)), None);
    let limited = note(&panes(10), &specular(64, 8)).expect("a note");
    assert!(limited.contains("8 bounces and 8 specular ones leave out"), "{limited}");
    assert!(limited.contains("--depth-specular"), "{limited}");
}
