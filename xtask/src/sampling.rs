//! `compare-sampling`: errors and times of adaptive and of uniform sampling.

use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers, read};

use crate::run::{Kiln, Result, json, mean, median, number};

/// Compare the times of adaptive and of uniform sampling at the same error
///
/// Renders view 2 of the assignment and scenes/effects/adaptive.toml on one thread, uniformly with 4 to 256 samples a
/// pixel, and with several levels of `--noise`; with KILN_MODELS also kitchen.obj from inside, the Stanford bunny and the
/// flight helmet. The error is the root mean square difference of display values (white is 1) to a reference of another
/// seed, over all rounds, each with its own seed. Times are processor seconds of the process minus those of a picture of
/// one pixel, medians of all rounds, in which all settings take turns. The time of uniform sampling at an error is
/// interpolated between its measurements, on logarithmic scales; `-` stands for errors outside of them. `far` is the
/// share of pixels whose error exceeds three times the level.
#[derive(clap::Args)]
pub struct Options {
    /// Rounds, each with its own seed
    #[arg(long, default_value_t = 5)]
    rounds: u32,
    /// Size of the pictures
    #[arg(long, default_value = "400x300")]
    size: String,
    /// Names of scenes, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    scenes: Vec<String>,
    /// Samples a pixel of the reference
    #[arg(long, default_value_t = 2048)]
    reference: u32,
}

const KITCHEN: &str = r##"
[image]
background = "#87a5c8"
[ambient]
intensity = 0.25
[[camera]]
position = [0.841908, 1.244645, 0.05684]
look_at = [6.38724, 1.244645, 0.05684]
vertical_fov = 70
[[light]]
type = "point"
position = [0.841908, 2.139743, 0.05684]
[[mesh]]
file = {file}
"##;
/// Also for scene files with adaptive sampling.
const UNIFORMLY: [&str; 2] = ["--without", "adaptive"];
const UNIFORM: [&str; 7] = ["4", "8", "16", "32", "64", "128", "256"];
const LEVELS: [&str; 5] = ["0.05", "0.02", "0.01", "0.004", "0.002"];

/// A scene, and whether its pictures have linear values.
struct Scene {
    name: &'static str,
    file: PathBuf,
    is_linear: bool,
}

fn scenes(folder: &Path) -> Result<Vec<Scene>> {
    let scene = |name, file: PathBuf, is_linear| Scene { name, file, is_linear };
    let mut all = vec![
        scene("assignment", "scenes/assignment.toml".into(), false),
        scene("adaptive", "scenes/effects/adaptive.toml".into(), true),
    ];
    if let Some(models) = std::env::var_os("KILN_MODELS") {
        let models = std::path::absolute(models)?;
        let kitchen = folder.join("kitchen.toml");
        let mesh = serde_json::to_string(&models.join("kitchen.obj"))?;
        std::fs::write(&kitchen, KITCHEN.replace("{file}", &mesh))?;
        all.push(scene("kitchen", kitchen, true));
        all.push(scene("bunny", models.join("stanford-bunny.obj"), true));
        all.push(scene("helmet", models.join("FlightHelmet/FlightHelmet.gltf"), true));
    }
    Ok(all)
}

/// The display values of an EXR, not rounded.
fn displayed(file: &Path, is_linear: bool) -> Result<Vec<[f64; 3]>> {
    let encode = move |value: f32| {
        let light = f64::from(value).max(0.0);
        let curve = if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
        if is_linear { curve.min(1.0) } else { light.min(1.0) }
    };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0; 3]; size.area()]),
            move |(width, pixels), at, (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b].map(encode);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(file)?;
    Ok(image.layer_data.channel_data.pixels.1)
}

/// One way to sample, and its measurements of all rounds.
struct Setting {
    title: String,
    options: Vec<&'static str>,
    /// The noise level of adaptive sampling.
    level: Option<f64>,
    seconds: Vec<f64>,
    squares: Vec<f64>,
    rays: Vec<f64>,
    far: Vec<f64>,
}

impl Setting {
    fn new(title: String, options: Vec<&'static str>, level: Option<f64>) -> Self {
        Self { title, options, level, seconds: vec![], squares: vec![], rays: vec![], far: vec![] }
    }

    fn all() -> Vec<Self> {
        let uniform =
            |n: &&'static str| Self::new((*n).into(), [&UNIFORMLY[..], &["--samples", n]].concat(), None);
        let adaptive = |level: &&'static str| {
            let options = vec!["--samples", "1024", "--noise", level];
            Self::new(format!("--noise {level}"), options, level.parse().ok())
        };
        UNIFORM.iter().map(uniform).chain(LEVELS.iter().map(adaptive)).collect()
    }

    fn error(&self) -> f64 {
        mean(&self.squares).sqrt()
    }

    fn took(&self) -> f64 {
        median(self.seconds.clone())
    }

    fn cast(&self) -> f64 {
        mean(&self.rays)
    }

    /// Adds the errors of a picture.
    fn compare(&mut self, reference: &[[f64; 3]], picture: &[[f64; 3]]) {
        let off = |(a, b): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|c| (b[c] - a[c]).abs());
        let limit = 3.0 * self.level.unwrap_or(1.0);
        let (mut squares, mut far) = (0.0, 0.0);
        for off in reference.iter().zip(picture).map(off) {
            squares += off.iter().map(|value| value * value).sum::<f64>();
            far += f64::from(u8::from(off.iter().any(|value| *value > limit)));
        }
        self.squares.push(squares / (3 * reference.len()) as f64);
        self.far.push(far / reference.len() as f64);
    }
}

/// The figure of uniform sampling at the error of a setting, relative to that of the setting; `-` outside the measurements.
fn relative(uniform: &[Setting], setting: &Setting, figure: fn(&Setting) -> f64) -> String {
    let error = setting.error();
    let pair = uniform.windows(2).find(|pair| pair[0].error() >= error && error >= pair[1].error());
    pair.map_or("-".into(), |pair| {
        let [a, b] = [0, 1].map(|side| (pair[side].error().ln(), figure(&pair[side]).ln()));
        let share = if a.0 == b.0 { 0.0 } else { (error.ln() - a.0) / (b.0 - a.0) };
        format!("{:.2}", (a.1 + share * (b.1 - a.1)).exp() / figure(setting))
    })
}

/// Measures all settings of a scene.
fn measure(kiln: &Kiln, options: &Options, scene: &Scene, folder: &Path) -> Result<Vec<Setting>> {
    let (picture, stats) = (folder.join("picture.exr"), folder.join("stats.json"));
    let render = |more: &[&str]| -> Result<f64> {
        let own = ["--size", &options.size, "--threads", "1", "--progress", "none", "--stats"];
        let own = [&own[..], &[stats.to_str().ok_or("a folder whose name is not UTF-8")?], more].concat();
        Ok(kiln.render(&scene.file, &own, &picture)?.0)
    };
    render(&[&UNIFORMLY[..], &["--samples", &options.reference.to_string(), "--seed", "1000"]].concat())?;
    let reference = displayed(&picture, scene.is_linear)?;
    let mut settings = Setting::all();
    for seed in 0..options.rounds {
        let nothing = render(&["--crop", "0,0,1,1"])?;
        for setting in &mut settings {
            let took = render(&[&setting.options[..], &["--seed", &seed.to_string()]].concat())?;
            setting.seconds.push(took - nothing);
            let cast = number(&json(&stats)?["rays"]["primary"]["cast"])?;
            setting.rays.push(cast / reference.len() as f64);
            setting.compare(&reference, &displayed(&picture, scene.is_linear)?);
        }
    }
    Ok(settings)
}

/// Prints a table for each scene.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let wanted =
        |scene: &Scene| options.scenes.is_empty() || options.scenes.iter().any(|name| name == scene.name);
    for scene in scenes(folder.path())?.into_iter().filter(wanted) {
        let settings = measure(kiln, options, &scene, folder.path())?;
        let heads = ["rays", "seconds", "error"];
        println!(
            "{:<10} {:>6} {:>8} {:>8}   of level    far   uniform: rays   time",
            scene.name, heads[0], heads[1], heads[2]
        );
        for setting in &settings {
            let (title, error) = (&setting.title, setting.error());
            print!("{title:>14} {:6.1} {:8.2} {error:8.5}", setting.cast(), setting.took());
            if let Some(level) = setting.level {
                let uniform = &settings[..UNIFORM.len()];
                let times = [Setting::cast, Setting::took].map(|figure| relative(uniform, setting, figure));
                let share = 100.0 * mean(&setting.far);
                print!("{:11.2} {share:6.2}% {:>14} {:>6}", error / level, times[0], times[1]);
            }
            println!();
        }
    }
    Ok(())
}
