//! `kiln bench price`: what each tier of numerics and each library costs, and what it gets wrong.

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::{Value, json};

use super::super::{pool, print};
use super::subject::Subject;
use super::{table, three_digits, with_progress};
use kiln::error::Result;
use kiln::files::{check_writable, write_whole};
use kiln::job::RenderSettings;
use kiln::scene::option::group;
use kiln::scene::{PictureSettings, Transport};
use kiln_lab::bench::price::{self, PicturePrice, PriceRow, TRANSPORTS, price};
use kiln_lab::bench::speed::{Kind, RaySets};
use kiln_lab::timing::Quartiles;

#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Number of rays aimed at closed meshes to count errors, from each side, per mesh size and placement
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "N", default_value_t = 100_000,
          value_parser = crate::numbers::whole(1..=100_000_000u64))]
    rays: u64,
    /// Number of timed rounds on one thread, after a warm-up round
    #[arg(long, help_heading = group::MEASUREMENT, allow_hyphen_values = true, value_name = "N", default_value_t = 5, value_parser = crate::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Write a plot of wrong answers against time as SVG
    #[arg(long, help_heading = group::OUTPUT, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let (scene, mesh, setup) = arguments.subject.load()?;
    arguments.plot.iter().try_for_each(|file| check_writable(file))?;
    let one = pool(Some(1))?;
    let rows = with_progress(None, "measuring", interrupted, |control| {
        let rays = RaySets::new(&mesh, &setup);
        let picture = RenderSettings::from(PictureSettings::of_size([arguments.subject.size / 2; 2]));
        let subject = price::Subject { mesh: &mesh, rays: &rays, scene: &scene, picture: &picture };
        price(&subject, arguments.rays, arguments.runs, &one, control)
    })?;
    if let Some(file) = &arguments.plot {
        let svg = price::plot(&rows);
        write_whole(file, |out| out.write_all(svg.as_bytes()))?;
    }
    let subject = arguments.subject.name();
    print(&if arguments.json { super::report(&subject, as_json(&rows, arguments)) } else { as_text(&rows) })
}

fn as_json(rows: &[PriceRow], arguments: &Arguments) -> Value {
    let row = |row: &PriceRow| {
        let ns = Kind::ALL.map(|kind| (kind.name().to_owned(), json!(row.ns[kind as usize])));
        let picture = |p: PicturePrice| json!({ "ms": p.ms, "rms": p.rms, "differing_pixels": p.differing });
        let pictures = TRANSPORTS.into_iter().enumerate().map(|(index, transport)| {
            (transport.name().to_owned(), json!(row.pictures.map(|p| picture(p[index]))))
        });
        json!({
            "engine": row.engine,
            "mode": row.mode,
            "isa": row.isa,
            "rays": arguments.rays,
            "runs": arguments.runs,
            "ns_per_ray": Value::Object(ns.into_iter().collect()),
            "leaks_aimed_per_million": row.errors.leaks_aimed,
            "leaks_random_per_million": row.errors.leaks_random,
            "leaks_secondary_per_million": row.errors.leaks_secondary,
            "wrong_per_million": row.errors.wrong,
            "worst_t_error_ulps": row.errors.worst_t,
            "pictures": Value::Object(pictures.collect()),
        })
    };
    rows.iter().map(row).collect()
}

fn as_text(rows: &[PriceRow]) -> String {
    let mut text =
        "Nanoseconds a ray, medians of one thread: kiln's default layout, and the fastest setting of each mode of other\n\
         libraries; on machines with AVX-512 also by AVX2.\n\n"
        .to_owned();
    let [primary, shadow, diffuse, random] = Kind::ALL.map(Kind::name);
    let titles = ["", primary, shadow, diffuse, random, "mean"];
    let ns = |ns: Option<f64>| ns.map_or("-".into(), three_digits);
    let times = |row: &PriceRow| {
        let kinds = row.ns.iter().map(|spread| ns(spread.map(|spread| spread.median)));
        [row.name()].into_iter().chain(kinds).chain([ns(row.mean_ns())]).collect()
    };
    text += &table(titles, rows.iter().map(times), 1);

    text += "\nErrors: leaks and wrong answers per million rays, the largest error of a distance in f32\n\
         ulp, of hits on a triangle that `exact` hits. `exact` judges.\n\n";
    let titles = ["", "leaks, aimed", "random", "secondary", "wrong", "distance"];
    let errors = |row: &PriceRow| {
        let errors = &row.errors;
        let rates = [errors.leaks_aimed, errors.leaks_random, errors.leaks_secondary, errors.wrong].map(rate);
        [row.name()].into_iter().chain(rates).chain([errors.worst_t.map_or("-".into(), rate)]).collect()
    };
    text += &table(titles, rows.iter().map(errors), 1);

    text +=
        "\nPictures: ms on one thread, RMS difference to `exact` in steps of 255, pixels that differ.\n\n";
    let [whitted, path] = TRANSPORTS.map(Transport::name);
    let titles = ["", whitted, "rms", "differ", path, "rms", "differ"];
    let pictures = |row: &PriceRow| {
        let cells = row.pictures?.map(|picture| {
            let Quartiles { median, .. } = picture.ms;
            [three_digits(median), rate(picture.rms), picture.differing.to_string()]
        });
        Some([row.name()].into_iter().chain(cells.into_iter().flatten()).collect())
    };
    text += &table(titles, rows.iter().filter_map(pictures), 1);

    text += "\nWhat each tier costs and buys:\n\n";
    let own: Vec<&PriceRow> = rows.iter().filter(|row| row.pictures.is_some()).collect();
    for pair in own.windows(2) {
        let _ = writeln!(text, "{}", step(pair[0], pair[1]));
    }
    text
}

/// A sentence about the step from a tier to the next.
fn step(before: &PriceRow, after: &PriceRow) -> String {
    let ratio =
        |a: Option<f64>, b: Option<f64>| b.zip(a).map_or("-".into(), |(b, a)| format!("{:.2}", b / a));
    let picture = |index: usize| {
        let ms = |row: &PriceRow| row.pictures.map(|pictures| pictures[index].ms.median);
        ratio(ms(before), ms(after))
    };
    format!(
        "{} -> {}: {} times the time a ray, {} a picture, {} with paths; leaks {} -> {}, wrong answers {} -> {}",
        before.mode,
        after.mode,
        ratio(before.mean_ns(), after.mean_ns()),
        picture(0),
        picture(1),
        rate(before.errors.leaks_aimed),
        rate(after.errors.leaks_aimed),
        rate(before.errors.wrong),
        rate(after.errors.wrong),
    )
}

/// A number that is 0 only if it is written as 0.
fn rate(x: f64) -> String {
    match x {
        0.0 => "0".into(),
        x if x < 0.01 => format!("{x:.0e}"),
        x => three_digits(x),
    }
}
