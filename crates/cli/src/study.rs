//! `kiln study`: error against render time in many settings, as a page, a table and JSON.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::arguments::{self, Arguments};
use super::explain::{LONGEST, errors_to_text, picture_errors};
use super::prepare::Reporter;
use super::progress::Mode;
use super::{print, typed};
use kiln::error::{Error, Result, Warnings, printable};
use kiln::files::{describe, write_whole};
use kiln::import;
use kiln::job::{PictureOptions, RenderSettings, ResolvedPicture, Session};
use kiln::render::RenderControl;
use kiln::scene::option::group;
use kiln::scene::{Look, Side, shell_quoted};
use kiln_lab::study::{
    Options, PathVariation, Pools, Setting, Study, StudySubject, error_against_time, facts, headline, page,
    study, to_csv, to_json,
};

/// The files of a study: its page, table, data and plot.
const FILES: [&str; 4] = ["index.html", "study.csv", "study.json", "study.svg"];

/// The longer side of the pictures of a quick study, in pixels.
const QUICK_LONGEST: u32 = 192;

/// Parameters that a quick study varies.
const QUICK_PARAMETERS: [&str; 4] = ["numerics", "samples", "texture filter", "path bounces"];

#[derive(Args)]
pub(crate) struct Command {
    /// Folder for index.html, study.csv, study.json and study.svg, created if it does not exist
    #[arg(short, long, help_heading = group::OUTPUT, display_order = 0, value_name = "DIR")]
    output: PathBuf,
    /// Number of timed rounds after a warm-up round [default: 7, with --full 15, with --quick 3]
    #[arg(long, help_heading = group::MEASUREMENT, allow_hyphen_values = true, value_name = "N", value_parser = crate::numbers::whole(1..=1000u16))]
    rounds: Option<u16>,
    /// Full picture size and many more samples, instead of a small picture in about a minute
    #[arg(long, help_heading = group::MEASUREMENT)]
    full: bool,
    /// Fewer settings, samples and rounds, in a quarter of the time
    #[arg(long, help_heading = group::MEASUREMENT, conflicts_with = "full")]
    quick: bool,
    /// Vary only this parameter, such as numerics or samples; may be repeated
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "NAME")]
    parameter: Vec<String>,
    /// Progress on standard error
    #[arg(long, help_heading = group::OUTPUT, value_enum, default_value = "auto")]
    progress: Mode,
    #[command(flatten)]
    pub arguments: Arguments,
}

pub(crate) fn run(command: &Command, interrupted: &AtomicBool) -> Result<()> {
    arguments::check(&command.arguments)?;
    let parameters = parameters(&command.parameter)?;
    let _folder = Folder::new(&command.output)?;
    let arguments = &command.arguments;
    let threads = arguments.options.thread_count();
    let (timed, wide) = (super::pool(threads.or(Some(1)))?, super::pool(threads)?);
    let mut reporter = Reporter::new(command.progress);
    let longest = (!command.full).then_some(if command.quick { QUICK_LONGEST } else { LONGEST });
    let settings =
        RenderSettings { longest_side: longest, mesh_look: Look::Draft, ..arguments.options.settings()? };
    let (session, picture) = wide.install(|| reporter.load_and_resolve(arguments, &settings, true))?;
    reporter.check_outputs(FILES.map(|name| command.output.join(name)))?;
    if !picture.settings.picture.display().is_identity() {
        reporter.warnings.note("the study compares displayed values without exposure and tone map");
        reporter.show();
    }
    let subject = subject(arguments, session, ResolvedPicture::clone(&picture));
    let load = || {
        import::load_with(&arguments.inputs, &arguments.options.import, &mut Warnings::default()).map(drop)
    };
    let is_file = arguments.inputs.iter().all(|input| input != Path::new("-"));
    let load: Option<&(dyn Fn() -> Result<()> + Sync)> = if is_file { Some(&load) } else { None };

    let progress = &reporter.progress;
    progress.phase("studying");
    let control = RenderControl {
        cancel: interrupted,
        progress: &|done, total| progress.steps(done, total, ("steps", 1)),
        time_stages: false,
    };
    let pools = Pools { timed: &timed, wide: &wide };
    let (mut study, pictures) = study(&subject, &options(command, parameters), load, &pools, &control)?;

    // A study of named parameters is about these alone.
    if command.parameter.is_empty() {
        progress.phase("measuring errors");
        study.errors = timed.install(|| picture_errors(arguments, &control))?;
    }

    let write = |name: &str, text: &str| {
        write_whole(&command.output.join(name), |out| out.write_all(text.as_bytes()))
    };
    let json = to_json(&study);
    let texts = [page(&json, &pictures), to_csv(&study.rows), json, error_against_time(&study)];
    FILES.iter().zip(&texts).try_for_each(|(name, text)| write(name, text))?;
    progress.clear();
    print(&text(&study))?;
    progress.finish(&format!("wrote {}", command.output.join("index.html").display()));
    Ok(())
}

/// The output folder. It is created before the study, so that errors occur early. Created folders that are empty at the
/// end are removed.
struct Folder {
    /// Created folders, innermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    fn new(folder: &Path) -> Result<Self> {
        let above = folder.ancestors().filter(|above| !above.as_os_str().is_empty());
        let made = above.take_while(|above| !above.exists()).map(Path::to_owned).collect();
        let own = Folder { made };
        std::fs::create_dir_all(folder).map_err(|e| Error::output(folder, describe(&e)))?;
        Ok(own)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Folders that are not empty cannot be removed by `remove_dir`.
        self.made.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
}

/// The parameters named by `typed`. [`Error::Usage`] for an unknown one.
fn parameters(typed: &[String]) -> Result<Vec<&'static str>> {
    let known = kiln_lab::study::parameters();
    let named = typed.iter().map(|typed| {
        known.iter().copied().find(|parameter| parameter == typed).ok_or_else(|| {
            Error::usage(
                format!("there is no parameter `{typed}`"),
                format!("parameters are {}", known.join(", ")),
            )
        })
    });
    named.collect()
}

fn options(command: &Command, parameters: Vec<&'static str>) -> Options {
    let (rounds, most_samples, reference_samples, rays_across, leak_rays) =
        match (command.full, command.quick) {
            (true, _) => (15, 128, 4096, 2, 4_000_000),
            (_, true) => (3, 16, 128, 2, 100_000),
            _ => (7, 32, 512, 4, 400_000),
        };
    let rounds = command.rounds.map_or(rounds, u32::from);
    let are_chosen = command.quick && parameters.is_empty();
    let parameters = if are_chosen { QUICK_PARAMETERS.to_vec() } else { parameters };
    Options { rounds, most_samples, reference_samples, rays_across, leak_rays, parameters }
}

/// What is studied: pictures without exposure and tone map.
fn subject(arguments: &Arguments, session: Session, mut picture: ResolvedPicture) -> StudySubject {
    let name =
        |input: &PathBuf| input.file_name().map_or("-".into(), |name| name.to_string_lossy().into_owned());
    let inputs: Vec<String> = arguments.inputs.iter().map(name).collect();
    (picture.settings.picture.exposure, picture.settings.picture.tone_map) = (None, None);
    let base = Setting {
        numerics: picture.numerics(),
        structure: picture.structure(),
        pipeline: picture.settings.picture.pipeline(),
        sampling: picture.plan_settings.sampling,
        bounces: None,
        textures: None,
        without: Vec::new(),
        path: PathVariation::of(&picture.plan_settings),
    };
    StudySubject {
        name: inputs.join(" "),
        command: typed(),
        render_command: render_command(arguments, &session, &picture),
        session,
        picture,
        base,
    }
}

/// The words of the command line that renders the same inputs with the same options, at the study's size. The study adds
/// no light but a headlight.
fn render_command(arguments: &Arguments, session: &Session, picture: &ResolvedPicture) -> Vec<String> {
    let options = PictureOptions {
        size: arguments.options.size.or(Some(picture.size().map(Side::clamped))),
        draft: arguments.options.draft || !session.scene().has_settings,
        ..arguments.options.0.clone()
    };
    let inputs = arguments.inputs.iter().map(|input| input.display().to_string());
    let words = ["kiln", "render"].map(str::to_owned).into_iter().chain(inputs).chain(options.words());
    let words = words.chain(["-o", "picture.png"].map(str::to_owned));
    words.map(|word| shell_quoted(&word)).collect()
}

/// The result, the table of errors, the advice and the notes of a study as text.
fn text(study: &Study) -> String {
    let advice = study.advice.iter().map(|advice| advice.text.clone());
    let left_out = study.left_out.iter().map(|[parameter, why]| format!("left out: {parameter}: {why}"));
    let lines = advice.chain(facts(study)).chain(left_out);
    let lines: String = lines.map(|line| printable(&line).into_owned() + "\n").collect();
    let errors = match &study.errors[..] {
        [] => String::new(),
        errors => format!("\n{}\n", errors_to_text(errors)),
    };
    format!("{}\n{errors}{lines}", printable(&headline(study)))
}
