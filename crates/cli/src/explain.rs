//! `kiln explain`: the effects of a picture, the reason for each, and its cost.

use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::{Value, json};

use super::arguments::{self, Arguments};
use super::numbers::aligned;
use super::prepare::Reporter;
use super::progress::{Mode, Progress};
use super::{json_text, print};
use kiln::effects::{Decision, EFFECTS};
use kiln::error::Result;
use kiln::film::ColourPipeline;
use kiln::job::{RenderControl, RenderJob, RenderSettings};
use kiln::scene::option::group;
use kiln::scene::{MAX_SAMPLES, Numerics};
use kiln_lab::bench::effects::{Cost, Costs, Part, measure};
use kiln_lab::bench::errors::{self, PictureError};

/// Versions of the JSON schemas, of effects and of a pixel; increased when a field changes its meaning or is removed.
const SCHEMA: u32 = 2;
const PIXEL_SCHEMA: u32 = 2;

/// Characters of a name in the text of a pixel.
const NAME_LENGTH: usize = 24;

#[derive(Args)]
pub(crate) struct Command {
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Measure the cost of each effect by rendering with and without it, on one thread unless --threads is given, and the
    /// errors of the picture by their causes, of at most 256 pixels (128 of traced paths) unless --size is given
    #[arg(long, help_heading = group::MEASUREMENT)]
    measure: bool,
    /// Number of measured rounds [default: 9, at least 3 within 20 seconds]
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "N", requires = "measure",
        value_parser = crate::numbers::whole(1..=1000u16))]
    rounds: Option<u16>,
    /// Explain one pixel: its rays, the terms at each surface and its 8-bit values; column and row from the top left,
    /// from 0
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "X,Y", allow_hyphen_values = true, value_parser = parse_pixel, conflicts_with = "measure")]
    pixel: Option<[u32; 2]>,
    /// Sample of the pixel that is printed, from 0; JSON lists up to 64 samples from it on
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "N", default_value = "0", allow_hyphen_values = true, requires = "pixel",
        value_parser = crate::numbers::whole(0..=MAX_SAMPLES - 1))]
    sample: u32,
    #[command(flatten)]
    pub arguments: Arguments,
}

fn parse_pixel(text: &str) -> std::result::Result<[u32; 2], String> {
    let wrong = "give column and row, from 0, as X,Y, such as 400,300";
    let (x, y) = text.split_once(',').ok_or(wrong)?;
    let number = |text: &str| text.trim().parse().map_err(|_| wrong);
    Ok([number(x)?, number(y)?])
}

pub(crate) fn run(command: &Command, interrupted: &AtomicBool) -> Result<()> {
    arguments::check(&command.arguments)?;
    if let Some(pixel) = command.pixel {
        return explain_pixel(command, pixel, interrupted);
    }
    let threads = command.arguments.options.thread_count().or(command.measure.then_some(1));
    let (job, measured) = super::pool(threads)?.install(|| {
        let settings = command.arguments.options.settings()?;
        let job = prepare(command, &settings)?;
        let measured = command.measure.then(|| -> Result<(Costs, Vec<PictureError>)> {
            let progress = Progress::on_terminal();
            let steps = |done, total| progress.tiles(done, total);
            let control = RenderControl { cancel: interrupted, progress: &steps, time_stages: false };
            progress.phase("measuring effects");
            let costs = measure(&job, command.rounds.map(usize::from), &control)?;
            progress.phase("measuring errors");
            let errors = picture_errors(&command.arguments, &control)?;
            progress.clear();
            Ok((costs, errors))
        });
        measured.transpose().map(|measured| (job, measured))
    })?;
    let costs = measured.as_ref().map(|(costs, _)| costs);
    let errors = measured.as_ref().map(|(_, errors)| &errors[..]);
    if command.json {
        print(&json_text(&to_json(&job, costs, errors)))
    } else {
        print(&to_text(&job.plan.decisions, costs, errors))
    }
}

/// Loads and prepares the scene, with warnings and notes.
fn prepare(command: &Command, settings: &RenderSettings) -> Result<RenderJob> {
    let mut reporter = Reporter::silent(Mode::None);
    (reporter.prints_warnings, reporter.prints_notes) = (true, true);
    let (session, picture) = reporter.load_and_resolve(&command.arguments, settings, true)?;
    let job = session.into_job(&picture, false, &RenderControl::default(), &mut reporter.warnings)?;
    reporter.show();
    Ok(job)
}

/// The longer side of the picture whose errors are measured, in pixels, unless its size is given; of traced paths.
pub(crate) const LONGEST: u32 = 256;
const LONGEST_OF_PATHS: u32 = 128;

/// The errors of a picture by their causes. None of standard input, which is read once.
pub(crate) fn picture_errors(arguments: &Arguments, control: &RenderControl) -> Result<Vec<PictureError>> {
    if arguments.inputs.iter().any(|input| input == Path::new("-")) {
        return Ok(Vec::new());
    }
    let job = |longest: u32, numerics: Option<Numerics>, pipeline: Option<ColourPipeline>| {
        let own = arguments.options.settings()?;
        let mut settings = RenderSettings { longest_side: Some(longest), ..own };
        settings.picture.numerics = numerics.or(settings.picture.numerics);
        settings.picture.colour = pipeline.or(settings.picture.colour);
        let mut silent = Reporter::silent(Mode::None);
        let (session, picture) = silent.load_and_resolve(arguments, &settings, true)?;
        session.into_job(&picture, false, &RenderControl::default(), &mut silent.warnings)
    };
    let mut own = job(LONGEST, None, None)?;
    let longest = if own.plan.transport.traces_paths() { LONGEST_OF_PATHS } else { LONGEST };
    if longest != LONGEST {
        own = job(longest, None, None)?;
    }
    errors::measure(&own, &|numerics, pipeline| job(longest, numerics, pipeline), control)
}

fn explain_pixel(command: &Command, pixel: [u32; 2], interrupted: &AtomicBool) -> Result<()> {
    let text = super::pool(command.arguments.options.thread_count())?.install(|| {
        let job = prepare(command, &command.arguments.options.settings()?)?;
        let control = RenderControl { cancel: interrupted, ..RenderControl::default() };
        let report = job.explain_pixel(pixel, command.sample, &control)?;
        if !command.json {
            return Ok(report.text(&shortened));
        }
        let mut fields = json!({
            "schema": PIXEL_SCHEMA,
            "kiln": env!("CARGO_PKG_VERSION"),
            "settings": settings_of(&job),
        });
        if let (Some(fields), Value::Object(report)) = (fields.as_object_mut(), json!(report)) {
            fields.extend(report);
        }
        Ok(json_text(&fields))
    })?;
    print(&text)
}

/// A name as it fits into a line.
fn shortened(name: &str) -> String {
    let (start, end) = (name.chars().take(NAME_LENGTH - 1), name.chars().nth(NAME_LENGTH));
    if end.is_some() { start.chain(['…']).collect() } else { name.to_owned() }
}

/// The settings that the metadata of pictures hold.
fn settings_of(job: &RenderJob) -> Value {
    job.metadata.iter().map(|(key, value)| (key.clone(), json!(value))).collect()
}

fn to_json(job: &RenderJob, costs: Option<&Costs>, errors: Option<&[PictureError]>) -> Value {
    let effects: Vec<Value> = EFFECTS
        .iter()
        .zip(&job.plan.decisions)
        .map(|(effect, decision)| {
            let part = costs.and_then(|costs| part_of(costs, decision));
            json!({
                "name": effect.id,
                "summary": effect.summary,
                "source": effect.source,
                "on": decision.on,
                "why": decision.why,
                "value": decision.value,
                "stages": job.plan.stages().iter().filter(|stage| stage.effect == Some(effect.id)).count(),
                "adds": part.map(|part| &part.adds),
                "share": part.zip(costs).map(|(part, costs)| part.adds.ms.median / costs.whole.ms.median),
                "alone_ms": part.map(|part| part.alone),
            })
        })
        .collect();
    json!({
        "schema": SCHEMA,
        "kiln": env!("CARGO_PKG_VERSION"),
        "settings": settings_of(job),
        "effects": effects,
        "errors": errors,
        "measured": costs.map(|costs| json!({
            "whole": costs.whole,
            "base": costs.base,
            "sum_ms": costs.sum_ms(),
            "rounds": costs.rounds,
            "clock": costs.clock,
            "threads": costs.threads,
        })),
    })
}

fn part_of<'a>(costs: &'a Costs, decision: &Decision) -> Option<&'a Part> {
    costs.parts.iter().find(|part| part.effect == decision.effect)
}

fn to_text(decisions: &[Decision], costs: Option<&Costs>, errors: Option<&[PictureError]>) -> String {
    let titles: &[&str] = if costs.is_some() { &["rays", "ms", "share", "bytes", "alone ms"] } else { &[] };
    let line = |name: &str, on: &str, numbers: Vec<String>, why: &str| {
        let numbers = numbers.into_iter().chain(std::iter::repeat(String::new())).take(titles.len());
        [name, on].map(str::to_owned).into_iter().chain(numbers).chain([why.to_owned()]).collect::<Vec<_>>()
    };
    let titles = titles.iter().map(|title| (*title).to_owned()).collect();
    let mut lines = vec![line("effect", "", titles, "why")];
    if let Some(costs) = costs {
        lines.push(line("base", "on", numbers(&costs.base, costs, None), "the picture without effects"));
    }
    for decision in decisions {
        let part = costs.and_then(|costs| Some((part_of(costs, decision)?, costs)));
        let numbers =
            part.map_or(Vec::new(), |(part, costs)| numbers(&part.adds, costs, Some(part.alone.median)));
        let on = if decision.on { "on" } else { "off" };
        lines.push(line(decision.effect.name(), on, numbers, &decision.why));
    }
    if let Some(costs) = costs {
        lines.push(line("whole", "", numbers(&costs.whole, costs, None), ""));
    }
    let mut text = aligned(&lines, |column| column < 2 || column + 1 == lines[0].len());
    if let Some(costs) = costs {
        let share = costs.sum_ms() / costs.whole.ms.median * 100.0;
        let _ = write!(
            text,
            "\nrays, ms, bytes: cost of an effect added to the effects above it; the costs add up to {share:.1} % of the whole\n\
             picture. alone ms: time that the whole picture saves without this effect. bytes: memory per thread. Medians of\n\
             {}, {} time; quartiles of the whole picture: {:.2} to {:.2} ms.\n",
            super::numbers::counted(costs.rounds, "round", "rounds"),
            costs.clock,
            costs.whole.ms.lower,
            costs.whole.ms.upper
        );
    }
    if let Some(errors) = errors.filter(|errors| !errors.is_empty()) {
        text.push('\n');
        text.push_str(&errors_to_text(errors));
    }
    let meanings = EFFECTS.iter().map(|effect| [effect.name(), effect.summary]);
    let meanings = [["effect", "what it does"]].into_iter().chain(meanings);
    let meanings: Vec<Vec<String>> = meanings.map(|line| line.map(str::to_owned).to_vec()).collect();
    text + "\n" + &aligned(&meanings, |_| true)
}

/// The table of errors.
pub(crate) fn errors_to_text(errors: &[PictureError]) -> String {
    let titles = ["cause", "error", "type", "error then", "time", ""].map(str::to_owned).to_vec();
    let line = |error: &PictureError| {
        let time = format!("x {}", errors::ratio(&error.time));
        let PictureError { cause, now, options, then, note, .. } = error;
        vec![cause.clone(), now.text(), options.clone(), then.text(), time, note.clone()]
    };
    let lines: Vec<Vec<String>> = std::iter::once(titles).chain(errors.iter().map(line)).collect();
    aligned(&lines, |_| true)
        + "\nerrors: pixels off by more than one step of 255 in a channel (largest difference in steps), as displayed,\n\
           before rounding; time: with the options, relative to the picture\n"
}

fn numbers(cost: &Cost, costs: &Costs, alone: Option<f64>) -> Vec<String> {
    let share = cost.ms.median / costs.whole.ms.median * 100.0;
    let alone = alone.map_or(String::new(), |alone| format!("{alone:.2}"));
    let ms = format!("{:.2}", cost.ms.median);
    vec![cost.rays.to_string(), ms, format!("{share:.1} %"), cost.bytes.to_string(), alone]
}
