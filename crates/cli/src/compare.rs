//! `kiln compare`: errors between two pictures.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value, json};

use super::message::Message;
use super::{json_text, print, t_test};
use kiln::error::{Error, Result, printable};
use kiln::files::check_writable;
use kiln::film::write::{Format, OutputImage as Written, write_picture};
use kiln::film::{ColourPipeline, Film, Window};
use kiln::limits;
use kiln::metrics::{
    BYTES_PER_PIXEL, BYTES_PER_PIXEL_OF_ALPHA, ComparedImage, Errors, Figures, definitions, heat_map,
};
use kiln::scene::option::group;

#[derive(Args)]
#[command(
    after_help = "Exit codes: 0 identical; 1 different, but within all limits; 2 above a limit, of different sizes, or with \
pixels that are not finite; 3 a picture cannot be read. With --t-test: 0 no difference found; 2 the pictures converge to different \
values; 3 a picture cannot be read, or has no samples and variance.\n\n\
PNG and JPEG are compared in display values from 0 to 1, two EXR in the values of the files: linear light, unless kiln stored \
display values. FLIP and PSNR compare display values: linear light is clamped to 0..1 and encoded as sRGB, without exposure and tone \
map. With --display, or if only one picture is linear, all metrics do.\n\n\
Alpha counts as a fourth channel of max, rmse, relmse and differing if either picture has it; a picture without alpha is opaque. \
PSNR, FLIP and the error map are then the worse of those over black and over white. OpenEXR stores associated (premultiplied) colours, \
PNG does not; one of each is compared in display values, unassociated. The t-test leaves alpha out."
)]
pub(crate) struct Arguments {
    /// Reference picture: .png, .jpg or .exr
    #[arg(value_name = "A")]
    reference: PathBuf,
    /// Picture to compare with the reference
    #[arg(value_name = "B")]
    test: PathBuf,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Exit with code 2 if max, rmse, relmse, flip or differing (fraction of pixels) is above a limit; may be repeated
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "METRIC=VALUE", value_parser = parse_limit)]
    fail_above: Vec<(&'static str, f64)>,
    /// Write a FLIP error map: black is no error, then purple, orange and light yellow
    #[arg(long, help_heading = group::OUTPUT, value_name = "FILE.png")]
    heat_map: Option<PathBuf>,
    /// Compare display values also of two pictures in linear light
    #[arg(long, help_heading = group::MEASUREMENT)]
    display: bool,
    /// Test whether two noisy .exr converge to the same picture by Welch's t-test of each pixel; both must be rendered with
    /// --sampler independent --aov samples,variance
    #[arg(long, help_heading = group::MEASUREMENT, conflicts_with_all = ["fail_above", "heat_map", "display"])]
    t_test: bool,
    /// Block size of the t-test in pixels: larger blocks give fewer p-values with less noise
    #[arg(long, help_heading = group::MEASUREMENT, allow_hyphen_values = true, value_name = "PIXELS", default_value_t = 1, requires = "t_test", value_parser = super::numbers::whole(1..=1024_u32))]
    block: u32,
}

/// Metrics that can be limited.
const METRICS: [&str; 5] = ["max", "rmse", "relmse", "flip", "differing"];

fn parse_limit(text: &str) -> std::result::Result<(&'static str, f64), String> {
    let form = || format!("give it as METRIC=VALUE, such as flip=0.01; there are {}", METRICS.join(", "));
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    let name = METRICS.into_iter().find(|m| m.eq_ignore_ascii_case(name.trim())).ok_or_else(form)?;
    match value.trim().parse::<f64>() {
        Ok(value) if value >= 0.0 => Ok((name, value)),
        _ => Err(format!("`{value}` is not a number from 0 upwards")),
    }
}

fn figure(figures: &Figures, name: &str) -> f64 {
    match name {
        "max" => figures.max,
        "rmse" => figures.rmse,
        "relmse" => figures.rel_mse,
        "flip" => figures.flip,
        "beyond_step" => figures.beyond_step,
        _ => figures.differing,
    }
}

/// Compares two pictures. Returns the exit code.
pub(crate) fn run(arguments: &Arguments) -> Result<u8> {
    if let Some(file) = &arguments.heat_map
        && Format::from_path(file)? != Format::Png
    {
        let what = format!("{}: heat maps are PNG", file.display());
        return Err(Error::usage(what, "name a file that ends in .png"));
    }
    if [&arguments.reference, &arguments.test].iter().any(|file| file.as_path() == Path::new("-")) {
        let what = "pictures are compared from files, not from standard input";
        return Err(Error::usage(what, "write it to a file first, or name one `./-`"));
    }
    if arguments.t_test {
        let Arguments { reference, test, block, json, .. } = arguments;
        let (report, code) = t_test::run(reference, test, *block, *json)?;
        print(&report)?;
        return Ok(code);
    }
    let open = |file: &PathBuf| {
        let picture = ComparedImage::open(file)?;
        Ok(if arguments.display { picture.into_displayed() } else { picture })
    };
    let (reference, test) = (open(&arguments.reference)?, open(&arguments.test)?);
    arguments.heat_map.iter().try_for_each(|file| check_writable(file))?;
    let (width, height) = (reference.width, reference.height);
    let has_alpha = reference.alpha.is_some() || test.alpha.is_some();
    let of_alpha = if has_alpha { BYTES_PER_PIXEL_OF_ALPHA } else { 0 };
    let needed = limits::product(&[width.into(), height.into(), BYTES_PER_PIXEL + of_alpha]);
    limits::check(needed).map_err(|excess| {
        let what = format!("comparing pictures of {width} x {height} pixels");
        excess.at(arguments.reference.as_path(), what)
    })?;
    let (errors, map) = Errors::with_map(&reference, &test)?;
    let beyond: Vec<(&str, f64, f64)> = errors
        .figures
        .iter()
        .flat_map(|figures| {
            let all = arguments.fail_above.iter().map(|&(name, limit)| (name, figure(figures, name), limit));
            all.filter(|(_, value, limit)| value > limit).collect::<Vec<_>>()
        })
        .collect();
    let code = match () {
        () if errors.figures.is_none() || !beyond.is_empty() => 2,
        () if errors.same => 0,
        () => 1,
    };
    print(&if arguments.json { as_json(arguments, &errors, code) } else { as_text(arguments, &errors) })?;
    for (name, value, limit) in beyond {
        Message::Done(&format!("{name} is {value:.6}, above the limit of {limit}")).print();
    }
    match (&arguments.heat_map, map) {
        (Some(file), Some(map)) => {
            let window = Window { x: 0, y: 0, width: errors.width, height: errors.height };
            let film = Film::from_rows(window, &heat_map(&map))?;
            write_picture(&Written::Rgb8(film, ColourPipeline::Display), &[], Format::Png, file)?;
        }
        (Some(file), None) => {
            let what = format!("{}: no heat map of pictures that are not finite", file.display());
            Message::Warning(&what).print();
        }
        (None, _) => {}
    }
    Ok(code)
}

fn as_json(arguments: &Arguments, errors: &Errors, code: u8) -> String {
    let definitions: Map<String, Value> =
        definitions().into_iter().map(|(name, text)| (name.into(), text.into())).collect();
    let verdict = ["same", "within_limits", "above_limits"][usize::from(code)];
    let mut report = json!({
        "schema": 1,
        "reference": arguments.reference.display().to_string(),
        "test": arguments.test.display().to_string(),
        "verdict": verdict,
        "errors": errors,
        "definitions": definitions,
    });
    if errors.figures.is_some() {
        report["errors"]["figures"]["worst"] = json!(errors.worst);
    }
    json_text(&report)
}

fn as_text(arguments: &Arguments, errors: &Errors) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} and {}: {} x {} pixels, {} values{}",
        printable(&arguments.reference.to_string_lossy()),
        printable(&arguments.test.to_string_lossy()),
        errors.width,
        errors.height,
        errors.values.name(),
        if errors.same { ", all the same" } else { "" }
    );
    let bad = &errors.non_finite;
    if let Some((x, y)) = bad.first {
        let _ = writeln!(
            text,
            "not finite: {} pixel(s) of the first and {} of the second, the first at ({x}, {y}); so there are no figures",
            bad.reference, bad.test
        );
    }
    let Some(figures) = &errors.figures else { return text };
    for (name, definition) in definitions() {
        let value = match (name, figures.psnr) {
            ("psnr", Some(psnr)) => format!("{psnr:.4}"),
            ("psnr", None) => "infinite".into(),
            _ => format!("{:.6}", figure(figures, name)),
        };
        let _ = writeln!(text, "  {name:<10} {value:>10}  {definition}");
    }
    if let Some(alpha) = errors.alpha {
        let what =
            "largest |b - a| of alpha (a fourth channel above); psnr, flip: the worse of black and white";
        let _ = writeln!(text, "  {:<10} {alpha:>10.6}  {what}", "alpha");
    }
    for (i, place) in errors.worst.iter().enumerate() {
        let head = if i == 0 { "worst" } else { "" };
        let colour = |c: [f32; 3], alpha: Option<f32>| {
            c.into_iter().chain(alpha).map(|c| format!("{c:.4}")).collect::<Vec<_>>().join(" ")
        };
        let reference = colour(place.reference, place.alpha.map(|alpha| alpha[0]));
        let test = colour(place.test, place.alpha.map(|alpha| alpha[1]));
        let _ = writeln!(
            text,
            "  {head:<10} {:>10.6}  at ({}, {}): {reference} became {test}",
            place.difference, place.x, place.y
        );
    }
    text
}
