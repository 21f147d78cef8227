//! `check-accuracy`: errors and times of pictures with an error target.

use std::path::{Path, PathBuf};

use crate::run::{Kiln, Result, number, two_digits};

/// Check that `kiln render --accuracy` reaches its targets, and measure its time
///
/// Each scene is rendered with --accuracy and compared with a reference of many samples and another seed. Its time is
/// compared with that of the least number of samples in a sweep (1, 2, 3, 4, 6, 8, ...) whose error is below the target.
/// Times are processor seconds of the whole command on one thread, minus those of a picture of one pixel (loading and
/// building); the least of --rounds, in which all settings take turns. The errors of the sweep are measured by
/// `kiln compare`, too. Pictures are EXR, compared in display values. The last column is the time relative to the faster
/// of that number of samples and of `--noise` with at most 512 samples.
///
/// KILN_MODELS names the folder of CornellBox.glb, Fox.glb and FlightHelmet.
#[derive(clap::Args)]
pub struct Options {
    /// Size of the pictures
    #[arg(long, default_value = "512x512")]
    size: String,
    /// Samples of the reference
    #[arg(long, default_value_t = 512)]
    reference: u32,
    /// Rounds of time measurement
    #[arg(long, default_value_t = 7)]
    rounds: u32,
    /// Folder that keeps the references; those that exist are used
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Measure only scenes whose path contains this text
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
}

const SWEEP: [&str; 18] = [
    "1", "2", "3", "4", "6", "8", "12", "16", "24", "32", "48", "64", "96", "128", "192", "256", "384", "512",
];
/// Noise levels. Adaptive sampling reaches a target in another way, often in less time.
const NOISE: [&str; 5] = ["0.04", "0.02", "0.01", "0.004", "0.002"];
/// Scenes and targets. They are a test set: `crates/cli/src/sample_count` was not tuned on them and must not be.
const CASES: [(&str, &str); 22] = [
    ("scenes/hard/close-sheets.toml", "FLIP=0.008"),
    ("scenes/hard/coarse-sphere.toml", "RMSE=0.004"),
    ("scenes/hard/coarse-sphere.toml", "MAX=0.15"),
    ("scenes/hard/crevice.toml", "FLIP=0.006"),
    ("scenes/hard/far.toml", "RMSE=0.006"),
    ("scenes/hard/grazing-plane.toml", "FLIP=0.004"),
    ("scenes/hard/sphere-on-plane.toml", "RMSE=0.008"),
    ("scenes/hard/tiny.toml", "FLIP=0.007"),
    ("scenes/hard/huge-sphere.toml", "RMSE=0.003"),
    ("scenes/hard/lamp-on-plane.toml", "FLIP=0.003"),
    ("scenes/hard/grazing-sphere.toml", "RMSE=0.005"),
    ("scenes/effects/adaptive.toml", "FLIP=0.006"),
    ("scenes/effects/antialiasing.toml", "RMSE=0.007"),
    ("scenes/effects/no-shadows.toml", "FLIP=0.003"),
    ("scenes/effects/no-textures.toml", "RMSE=0.004"),
    ("scenes/effects/no-glaze.toml", "FLIP=0.005"),
    ("CornellBox.glb", "FLIP=0.01"),
    ("CornellBox.glb", "RMSE=0.006"),
    ("Fox.glb", "FLIP=0.005"),
    ("Fox.glb", "RMSE=0.004"),
    ("FlightHelmet/FlightHelmet.gltf", "FLIP=0.015"),
    ("FlightHelmet/FlightHelmet.gltf", "RMSE=0.01"),
];

/// The pictures of one run.
struct Bench<'a> {
    kiln: &'a Kiln,
    options: &'a Options,
    /// Folder of the references.
    kept: &'a Path,
    /// Folder of the other pictures.
    folder: &'a Path,
}

impl Bench<'_> {
    /// Renders on one thread. Returns processor seconds and what kiln wrote.
    fn render(&self, scene: &Path, size: &str, options: &[&str], picture: &Path) -> Result<(f64, String)> {
        self.kiln.render(scene, &[&["--size", size, "--threads", "1"], options].concat(), picture)
    }

    /// The error of a picture to the reference, which is rendered on all threads unless it exists.
    fn error(&self, scene: &Path, picture: &Path, metric: &str) -> Result<f64> {
        let (size, samples) = (&self.options.size, self.options.reference.to_string());
        let reference = self.kept.join(format!("{}-{size}-{samples}.exr", stem(scene)));
        if !reference.exists() {
            let new = self.kept.join("new.exr");
            self.kiln.render(scene, &["--size", size, "--samples", &samples, "--seed", "7"], &new)?;
            std::fs::rename(new, &reference)?;
        }
        number(&self.kiln.compare(&reference, picture)?[metric.to_lowercase()])
    }

    /// The first of the values of an option whose error is below the target.
    fn first<'v>(
        &self,
        scene: &Path,
        wish: Wish,
        values: &[&'v str],
        others: &[&str],
    ) -> Result<Option<&'v str>> {
        for value in values {
            let picture = self.folder.join(format!("{}-{value}.exr", stem(scene)));
            if !picture.exists() {
                self.render(scene, &self.options.size, &[others, &[*value]].concat(), &picture)?;
            }
            if self.error(scene, &picture, wish.metric)? < wish.target {
                return Ok(Some(*value));
            }
        }
        Ok(None)
    }

    /// The least seconds of each setting in all rounds, minus those of one pixel.
    fn seconds(&self, scene: &Path, all: &[Vec<&str>]) -> Result<Vec<f64>> {
        let picture = self.folder.join("timed.exr");
        let (mut floor, mut least) = (f64::INFINITY, vec![f64::INFINITY; all.len()]);
        for _ in 0..self.options.rounds {
            floor = self.render(scene, "1x1", &[], &picture)?.0.min(floor);
            for (least, options) in least.iter_mut().zip(all) {
                *least = self.render(scene, &self.options.size, options, &picture)?.0.min(*least);
            }
        }
        Ok(least.iter().map(|seconds| seconds - floor).collect())
    }

    /// Measures a scene, prints its row, and returns whether the target is reached, and whether the time is at most twice
    /// that of the sweep, and of the faster of both alternatives.
    fn case(&self, scene: &Path, text: &str) -> Result<[bool; 3]> {
        let wish = Wish::read(text)?;
        let picture = self.folder.join("accuracy.exr");
        let said = self.render(scene, &self.options.size, &["--accuracy", text], &picture)?.1;
        let (samples, estimate) = chosen(&said).ok_or_else(|| format!("no number of samples in: {said}"))?;
        let reached = self.error(scene, &picture, wish.metric)?;
        let cheapest = self.first(scene, wish, &SWEEP, &["--samples"])?;
        let noise = self.first(scene, wish, &NOISE, &["--samples", "512", "--noise"])?;
        let mut settings = vec![vec!["--accuracy", text]];
        settings.extend(cheapest.map(|samples| vec!["--samples", samples]));
        settings.extend(noise.map(|noise| vec!["--samples", "512", "--noise", noise]));
        let seconds = self.seconds(scene, &settings)?;
        let others = &seconds[1..];
        let relative_to = |other: f64| seconds[0] / other.max(1e-3);
        let to_cheapest = cheapest.map(|_| relative_to(others[0]));
        let to_both = others.iter().copied().reduce(f64::min).map(relative_to);
        let text_of = |ratio: Option<f64>| ratio.map_or("-".into(), |ratio| format!("{ratio:.2}"));
        println!(
            "| {} | {text} | {samples} | {} | {} | {} | {:.3} s | {} | {}{} |",
            stem(scene),
            two_digits(&format!("{estimate:.2e}")),
            two_digits(&format!("{reached:.2e}")),
            cheapest.unwrap_or("-"),
            seconds[0],
            text_of(to_cheapest),
            text_of(to_both),
            noise.map_or(String::new(), |noise| format!(" ({noise})")),
        );
        let in_time = |ratio: Option<f64>| ratio.is_some_and(|ratio| ratio <= 2.0);
        Ok([reached < wish.target, in_time(to_cheapest), in_time(to_both)])
    }
}

/// An error target.
#[derive(Clone, Copy)]
struct Wish<'a> {
    metric: &'a str,
    target: f64,
}

impl<'a> Wish<'a> {
    fn read(text: &'a str) -> Result<Self> {
        let (metric, target) = text.split_once('=').ok_or("METRIC=VALUE expected")?;
        Ok(Self { metric, target: target.parse()? })
    }
}

/// The number of samples and the estimated error that `--accuracy` reports.
fn chosen(said: &str) -> Option<(&str, f64)> {
    let line = said.lines().find(|line| line.contains("a pixel"))?;
    let samples = line.split(" sample").next()?.split_whitespace().last()?;
    let estimate = line.split("about ").nth(1)?.split(';').next()?.trim().parse().ok()?;
    Some((samples, estimate))
}

fn stem(scene: &Path) -> String {
    scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Prints a row for each scene and target, and the counts.
pub fn run(kiln: &Kiln, options: &Options) -> Result<()> {
    let models = std::env::var_os("KILN_MODELS").map(PathBuf::from);
    let folder = tempfile::tempdir()?;
    let kept = options.keep.as_deref().unwrap_or(folder.path());
    std::fs::create_dir_all(kept)?;
    let bench = Bench { kiln, options, kept, folder: folder.path() };
    println!(
        "| scene | target | samples | estimate | reached | cheapest | time | to cheapest | also of --noise |"
    );
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    let (mut count, mut sums) = (0, [0; 3]);
    for (scene, wish) in CASES.iter().filter(|case| case.0.contains(&options.only)) {
        let file = match &models {
            _ if scene.starts_with("scenes/") => PathBuf::from(scene),
            Some(models) => models.join(scene),
            None => {
                println!("| {scene} | skipped: KILN_MODELS is not set |");
                continue;
            }
        };
        let met = bench.case(&file, wish)?;
        count += 1;
        sums.iter_mut().zip(met).for_each(|(sum, met)| *sum += u32::from(met));
    }
    let [below, in_time, in_time_of_both] = sums;
    println!(
        "\n{below} of {count} are below their target; {in_time} of {count} take at most twice the cheapest \
         number of samples, {in_time_of_both} also of the cheapest level of noise"
    );
    Ok(())
}
