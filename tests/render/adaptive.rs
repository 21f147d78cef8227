//! Adaptive sampling is unbiased: mean radiances beside those of uniform sampling.

use crate::common::picture::{load, or, parse};
use crate::common::repository;
use crate::path::room_file;
use kiln::error::Warnings;
use kiln::film::Film;
use kiln::film::tone::Exposure;
use kiln::job::{PlanSettings, RenderControl, RenderSettings, notes_of_result, prepare};
use kiln::render::aov::{self, AovSelection};
use kiln::scene::{PictureSettings, Sampling, Scene};

/// A box with a glass ball and a small bright lamp: a caustic.
fn caustic() -> Scene {
    room(
        "[material.glass]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\nlayers = { transmission = 1, ior = 1.5 }\n\
         [[sphere]]\nmaterial = 'glass'\ncentre = [0.2, -0.6, -0.3]\nradius = 0.7\n\
         [[sphere]]\nmaterial = 'lamp'\ncentre = [0.5, 1.6, 0.2]\nradius = 0.08\n",
        60.0,
    )
}

/// A lamp behind a panel: indirect light alone.
fn hidden_lamp() -> Scene {
    hidden_lamp_of(50.0)
}

fn hidden_lamp_of(emission: f64) -> Scene {
    room(
        "[[triangles]]\nmaterial = 'wall'\nvertices = [[-1.2, 1, -1.5], [1.2, 1, -1.5], [1.2, 1, 1.5], [-1.2, 1, 1.5]]\n\
         indices = [[0, 1, 2], [0, 2, 3]]\n\
         [[sphere]]\nmaterial = 'lamp'\ncentre = [0, 1.5, 0]\nradius = 0.1\n",
        emission,
    )
}

/// A box lit by a rectangle below its ceiling.
fn lit_box() -> Scene {
    room(
        "[[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.6, 1.9, -0.6], [0.6, 1.9, -0.6], [0.6, 1.9, 0.6], [-0.6, 1.9, 0.6]]\n\
         indices = [[0, 1, 2], [0, 2, 3]]\n\
         [[sphere]]\nmaterial = 'wall'\ncentre = [0.6, -1.3, -0.4]\nradius = 0.7\n",
        4.0,
    )
}

/// A ball and a floor of rough metal below a lamp.
fn metal() -> Scene {
    room(
        "[material.metal]\ncolour = '#e0c070'\nmetallic = 1\nroughness = 0.3\n\
         [[sphere]]\nmaterial = 'metal'\ncentre = [0, -0.8, -0.4]\nradius = 1\n\
         [[sphere]]\nmaterial = 'lamp'\ncentre = [0.9, 1.3, 0.4]\nradius = 0.3\n",
        8.0,
    )
}

fn room(objects: &str, emission: f64) -> Scene {
    parse(&format!(
        "[image]\ntransport = 'path'\n\
         [[camera]]\nposition = [-1.8, 0.3, 1.7]\nlook_at = [0.5, -0.4, -0.5]\nvertical_fov = 70\n\
         [material.wall]\ncolour = '#d0b8a0'\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#fff0d0'\nemission_intensity = {emission}\n\
         [[mesh]]\nmaterial = 'wall'\nfile = '{}'\n{objects}",
        room_file()
    ))
}

/// A ball on a floor below a grey environment in which 2 of 2,048 texels are a sun.
fn sun() -> Scene {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let mut texels = vec![[128u8, 128, 128, 128]; 64 * 32];
    // Values (r + 1/2) 2^(e - 136): about 1/2, and 384.
    (texels[8 * 64 + 20], texels[8 * 64 + 21]) = ([192, 192, 160, 137], [192, 192, 160, 137]);
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n".to_vec();
    file.extend(texels.as_flattened());
    std::fs::write(folder.join("sun.hdr"), file).expect("a file");
    parse(&format!(
        "[[camera]]\nposition = [0, 2, 5]\nlook_at = [0, 0.5, 0]\nvertical_fov = 40\n\
         [environment]\nfile = '{}'\n[material.clay]\ncolour = '#b5651d'\nmetallic = 0\nroughness = 0.6\n\
         [[sphere]]\nmaterial = 'clay'\ncentre = [0, 0.8, 0]\nradius = 0.8\n\
         [[triangles]]\nmaterial = 'clay'\nvertices = [[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]]\n\
         indices = [[0, 1, 2], [0, 2, 3]]\n",
        folder.join("sun.hdr").display()
    ))
}

fn effect(name: &str) -> Scene {
    load(&repository(&format!("scenes/effects/{name}.toml")))
}

/// Mean and standard error of the mean radiance of pictures, one of each seed.
pub struct Mean {
    pub value: f64,
    pub error: f64,
}

pub fn mean_of(scene: &Scene, size: [u32; 2], sampling: Sampling, seeds: std::ops::Range<u32>) -> Mean {
    let settings = RenderSettings::from(PictureSettings::of_size(size));
    let job = prepare(scene.clone(), &settings, &mut Warnings::default()).expect("a job");
    let count = f64::from(seeds.end - seeds.start);
    let means: Vec<f64> = seeds
        .map(|seed| {
            let sampling = Sampling {
                min_samples: None,
                noise: sampling.noise,
                ..or(Sampling { seed, ..sampling }, job.plan_settings.sampling)
            };
            let job = job.with_plan_settings(PlanSettings { sampling, ..job.plan_settings.clone() });
            let film: Film = job.expect("a plan").render(&RenderControl::default()).expect("a picture").0;
            film.rows().map(|pixel: [f32; 3]| f64::from(pixel.iter().sum::<f32>())).sum::<f64>()
                / f64::from(3 * size[0] * size[1])
        })
        .collect();
    let value = means.iter().sum::<f64>() / count;
    let squares: f64 = means.iter().map(|mean| (mean - value).powi(2)).sum();
    Mean { value, error: (squares / (count * (count - 1.0))).sqrt() }
}

/// The difference of adaptive pictures at a level, of at most `most` samples a pixel, from uniform ones, over the mean,
/// with its standard error.
fn bias(scene: &Scene, size: [u32; 2], (level, most): (f64, u32), seeds: u32, uniform: &Mean) -> [f64; 2] {
    let sampling = Sampling { noise: Some(level), samples: Some(most), ..Sampling::default() };
    let adaptive = mean_of(scene, size, sampling, 1..seeds + 1);
    [adaptive.value - uniform.value, adaptive.error.hypot(uniform.error)].map(|x| x / uniform.value)
}

/// Of small pictures, where sampling that stops by its own samples is 3 to 8 % too dark: 3.5 standard errors, which
/// differ by chance once in 2,000 tests.
#[test]
fn adaptive_pictures_are_as_bright_as_uniform_ones() {
    let size = [24, 18];
    let cases = [("hidden lamp", hidden_lamp(), 0.05), ("box", lit_box(), 0.05), ("sun", sun(), 0.025)];
    for (name, scene, level) in cases {
        let uniform = Sampling { samples: Some(128), ..Sampling::default() };
        let uniform = mean_of(&scene, size, uniform, 1001..1017);
        let [bias, error] = bias(&scene, size, (level, 512), 32, &uniform);
        println!("{name}: {:.2} % +- {:.2} %", 100.0 * bias, 100.0 * error);
        assert!(bias.abs() < 3.5 * error && error < 0.008, "{name}: {bias} +- {error}");
    }
}

/// Light that is dimmer by a power of two has the same digits, and is displayed alike under that exposure.
#[test]
fn dim_light_under_an_exposure_takes_as_many_samples() {
    let counts = |stops: i32| {
        let picture = PictureSettings {
            exposure: Some(Exposure::Ev(f64::from(stops))),
            ..PictureSettings::of_size([24, 18])
        };
        let scene = hidden_lamp_of(50.0 * 0.5f64.powi(stops));
        let job = prepare(scene, &picture.into(), &mut Warnings::default()).expect("a job");
        let sampling = Sampling { noise: Some(0.05), samples: Some(256), ..Sampling::default() };
        let sampling = Sampling { min_samples: None, ..or(sampling, job.plan_settings.sampling) };
        let job = job.with_plan_settings(PlanSettings { sampling, ..job.plan_settings.clone() });
        let job = job.expect("a plan");
        let film: Film = job.render(&RenderControl::default()).expect("a picture").0;
        let selection = AovSelection::new(&["samples".to_owned()]).expect("an AOV");
        let channels = aov::channels(&job.aov_source(Some(&film)), &selection, &RenderControl::default());
        channels.expect("channels").swap_remove(0).values
    };
    let bright = counts(0);
    assert!(bright.iter().any(|&count| count < 256.0), "{bright:?}");
    assert_eq!(counts(14), bright);
}

/// Too few samples leave most pixels with a larger error: 16 have one of 0.04 in the mean, eight levels of 0.005.
#[test]
fn noisy_pixels_are_counted() {
    let count = |level, most| {
        let job =
            prepare(effect("path"), &PictureSettings::of_size([24, 18]).into(), &mut Warnings::default())
                .expect("a job");
        let sampling = Sampling { noise: Some(level), samples: Some(most), ..Sampling::default() };
        let sampling = or(sampling, job.plan_settings.sampling);
        let job = job.with_plan_settings(PlanSettings { sampling, ..job.plan_settings.clone() });
        let job = job.expect("a plan");
        let (_, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
        (statistics.noisy_pixels, notes_of_result(&job, &statistics).find(|note| note.contains("--noise")))
    };
    let (noisy, note) = count(0.005, 16);
    assert!(noisy > 24 * 18 / 2 && note.is_some_and(|note| note.contains("0.015")), "{noisy}");
    let (noisy, note) = count(0.1, 1024);
    assert!(noisy < 24 * 18 / 50 && note.is_none(), "{noisy}");
}

/// [`adaptive_pictures_are_as_bright_as_uniform_ones`] of ten scenes at levels from 0.1 to 0.005: `cargo test --release
/// --test render adaptive:: -- --ignored --nocapture`. `KILN_CASES=caustic,metal` selects some.
#[test]
#[ignore = "takes half an hour"]
fn adaptive_pictures_of_ten_scenes_are_as_bright_as_uniform_ones() {
    let cases = [
        ("caustic", caustic()),
        ("hidden lamp", hidden_lamp()),
        ("box", lit_box()),
        ("metal", metal()),
        ("sun", sun()),
        ("alpha", effect("alpha")),
        ("depth of field", effect("depth-of-field")),
        ("textures", effect("textures")),
        ("occlusion", effect("ambient-occlusion")),
        ("penumbra", effect("soft-shadows")),
    ];
    let wanted = |name: &str| {
        std::env::var("KILN_CASES").map_or(true, |names| names.split(',').any(|part| name.contains(part)))
    };
    let mut failed = Vec::new();
    for (name, scene) in cases.into_iter().filter(|(name, _)| wanted(name)) {
        let size = [64, 48];
        let uniform = Sampling { samples: Some(512), ..Sampling::default() };
        let uniform = mean_of(&scene, size, uniform, 1001..1049);
        for level in [0.1, 0.05, 0.02, 0.005] {
            let [bias, error] = bias(&scene, size, (level, 512), 48, &uniform);
            println!("{name:>15} {level:5}: {:6.2} % +- {:.2} %", 100.0 * bias, 100.0 * error);
            let most = if name == "caustic" { 0.006 } else { 0.003 };
            if bias.abs() >= 3.5 * error || error > most {
                failed.push(format!("{name} {level}: {bias} +- {error}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}
