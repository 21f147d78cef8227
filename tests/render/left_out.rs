//! The light that limits leave out, against closed forms and against pictures without limits; the paths that limits
//! cut.

use crate::common::picture::{changed, parse};
use crate::path::settings;
use kiln::effects::tile::PathCount;
use kiln::error::Warnings;
use kiln::film::Film;
use kiln::film::colour::luminance;
use kiln::job::{RenderControl, RenderJob, RenderSettings, notes_of_result, prepare};
use kiln::scene::{Bounces, Clamp};
use kiln_lab::bench::light_left_out::{LightLeftOut, Share, measure, without_limits};

const SEEDS: u32 = 20;

fn job(scene: &str, settings: &RenderSettings) -> RenderJob {
    prepare(parse(scene), settings, &mut Warnings::default()).expect("a job")
}

fn render(job: &RenderJob) -> Film {
    job.render(&RenderControl::default()).expect("a picture").0
}

fn left_out(job: &RenderJob) -> LightLeftOut {
    measure(job, &RenderControl::default()).expect("pictures").expect("a picture of paths")
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
    let of = |seed| left_out(&job(scene, &seeded(settings, seed))).by_depth;
    let estimates: Vec<Share> = (0..SEEDS).map(of).collect();
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
            let job = job(&scene, &seeded(settings, seed));
            let light = light(&render(&job));
            [light, light / (1.0 - left_out(&job).by_depth.mean)]
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

/// The clamp takes what a picture without it has more, relative to the picture without any limits.
#[test]
fn clamped_light_is_that_of_the_picture_without_a_clamp() {
    let of = |clamp: Option<f64>| {
        let settings = changed(settings(64, 5), |picture| picture.clamp = clamp.map(Clamp::clamped));
        job(&mixed_room(), &settings)
    };
    let (clamped, without) = (of(Some(0.05)), of(None));
    assert_eq!(left_out(&without).by_clamp, Share { mean: 0.0, error: 0.0 });
    let all = light(&render(&without_limits(&without).expect("a job")));
    let expected = (light(&render(&without)) - light(&render(&clamped))) / all;
    let Share { mean, error } = left_out(&clamped).by_clamp;
    println!("{mean} +- {error}, expected {expected}");
    assert!(
        error < 0.05 * expected && (mean - expected).abs() < 4.0 * error,
        "{mean} +- {error}, {expected}"
    );
}

/// A path is the same with and without limits up to the vertex where one ends it: beyond it, only light is added. So no
/// pixel is darker without limits, up to the rounding of sums, and those of which no path was cut are equal.
#[test]
fn paths_are_the_same_up_to_the_limit() {
    for settings in [settings(2, 0), settings(2, 2), settings(2, 8), specular(2, 0), specular(2, 2)] {
        let job = job(&mixed_room(), &settings);
        let (limited, all) = (render(&job), render(&without_limits(&job).expect("a job")));
        let pixels = limited.rows().zip(all.rows()).map(|(a, b): ([f32; 3], [f32; 3])| (a, b));
        let (mut equal, mut brighter) = (0, 0);
        for (limited, all) in pixels {
            for (limited, all) in limited.into_iter().zip(all) {
                assert!(all >= limited * (1.0 - 1e-6), "{limited} {all}, {:?}", job.plan.bounce_limits());
            }
            equal += usize::from(limited == all);
            brighter += usize::from(limited != all);
        }
        assert!(equal > 0 && brighter > 0, "{equal} {brighter}, {:?}", job.plan.bounce_limits());
    }
}

/// Of the panes the first sends 0.04 of the paths back to the camera; all others are at a pane after one and after two
/// bounces, before roulette starts. Behind one pane is the wall, which scatters nothing.
#[test]
fn cut_paths_are_counted() {
    let count = |panes_: u32, settings: &RenderSettings| {
        let (_, statistics) =
            job(&panes(panes_), settings).render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        let PathCount { traced, cut } = statistics.paths;
        assert_eq!(traced, 64 * u64::from(crate::path::SIZE).pow(2));
        cut as f64 / traced as f64
    };
    assert_eq!((count(10, &settings(64, 0)), count(1, &settings(64, 1))), (1.0, 0.0));
    for settings in [settings(64, 1), settings(64, 2), specular(64, 1), specular(64, 2)] {
        // Ten times the standard error of independent paths.
        let share = count(10, &settings);
        assert!((share - 0.96).abs() < 0.005, "{share}");
    }
}

/// Panes, a corridor and a bottle at limits that cut them have a note with the share of cut paths and options that
/// help; not the furnace at a limit that suffices.
#[test]
fn a_note_says_that_paths_are_cut() {
    let note = |scene: &str, settings: &RenderSettings| {
        let job = job(scene, settings);
        let (_, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        notes_of_result(&job, &statistics).next()
    };
    let of_panes = note(&panes(10), &settings(64, 2)).expect("a note");
    assert!(of_panes.starts_with("the limit of 2 bounces cuts 96 % of the paths"), "{of_panes}");
    assert!(of_panes.contains("--depth 4;") && of_panes.contains("`kiln explain --measure`"), "{of_panes}");
    assert_eq!(note(ROOM, &settings(16, 12)), None);
    let corridor = note(&corridor(), &settings(64, 2)).expect("a note");
    assert!(corridor.starts_with("the limit of 2 bounces cuts 100 %"), "{corridor}");
    let bottle = note(BOTTLE, &settings(64, 1)).expect("a note");
    assert!(bottle.starts_with("the limit of 1 bounce cuts "), "{bottle}");
    assert_eq!(note(BOTTLE, &specular(64, 64)), None);
    let limited = note(&panes(10), &specular(64, 8)).expect("a note");
    assert!(limited.contains("8 bounces and 8 specular ones cuts "), "{limited}");
    assert!(limited.contains("--depth 16 --depth-specular 16"), "{limited}");
}
