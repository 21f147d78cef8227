//! `kiln render`: renders files to a picture.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::arguments::{self, Arguments};
use super::each_input;
use super::frames::{self, FrameSeries, LengthArguments, file_names};
use super::output::{self, OutputTarget, check_folder, render_target, render_to_accuracy};
use super::prepare::{Reporter, timed};
use super::progress::Mode;
use super::sampling::AccuracyArguments;
use super::statistics;
use kiln::animation::{FileNames, FrameList};
use kiln::error::{Error, Result, Warnings};
use kiln::farm::Shard;
use kiln::files::{is_same_file, write_whole};
use kiln::film::write::Format;
use kiln::job::{Findings, metadata};
use kiln::render::RenderControl;
use kiln::render::aov::{AOVS, AovSelection, EFFECTS, EFFECTS_SUMMARY};
use kiln::scene::option::group;

#[derive(Args, Clone)]
#[command(after_long_help = aov_help())]
pub(crate) struct Command {
    /// Picture to write: .png, .jpg or .exr; `-` for PNG on standard output. {name} in it makes a picture of each INPUT,
    /// with its name, as a folder does: out/ is out/{name}.png. With --frames a pattern such as frame_####.png
    #[arg(short, long, help_heading = group::OUTPUT, display_order = 0, value_name = "OUT")]
    pub output: PathBuf,
    #[command(flatten)]
    pub arguments: Arguments,
    #[command(flatten)]
    accuracy: AccuracyArguments,
    /// Frames to render, such as 1-10, 1-10:2 or 3,7,9-12, one file each; if nothing moves, the camera orbits once
    #[arg(long, help_heading = group::ANIMATION, display_order = 0, value_name = "LIST", allow_hyphen_values = true, conflicts_with_all = ["accuracy", "budget"])]
    frames: Option<FrameList>,
    #[command(flatten)]
    length: LengthArguments,
    /// Render only shard I of N, from 1: with --frames every N-th frame, else every N-th tile, into OUT with the ending
    /// .IofN.shard, for `kiln merge`
    #[arg(long, help_heading = group::OUTPUT, allow_hyphen_values = true, value_name = "I/N", conflicts_with_all = ["accuracy", "budget"])]
    shard: Option<Shard>,
    /// Skip finished files of the same scene and settings (a fingerprint is stored in .png and .exr)
    #[arg(long, help_heading = group::OUTPUT)]
    skip_existing: bool,
    /// Print the names of the output files without rendering
    #[arg(long, help_heading = group::OUTPUT)]
    pub(super) list_outputs: bool,
    /// AOVs to write to an .exr, separated by commas, such as depth,normal; listed below
    #[arg(long, help_heading = group::OUTPUT, display_order = 2, value_name = "LIST", value_delimiter = ',')]
    aov: Vec<String>,
    /// Progress on standard error
    #[arg(long, help_heading = group::OUTPUT, value_enum, default_value = "auto")]
    progress: Mode,
    /// Write statistics (times, rays, memory) to a JSON file
    #[arg(long, help_heading = group::OUTPUT, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Exit with an error if there are warnings
    #[arg(long, help_heading = group::OUTPUT)]
    strict: bool,
}

/// The names of `--aov` and their summaries, a line each.
fn aov_help() -> String {
    let all = [(EFFECTS, EFFECTS_SUMMARY), ("all", "all of these")];
    let lines = AOVS.iter().map(|aov| (aov.name, aov.summary)).chain(all);
    let width = lines.clone().map(|(name, _)| name.len()).max().unwrap_or(0);
    let lines = lines.map(|(name, summary)| format!("\n  {name:width$}  {summary}"));
    format!("AOVs:{}", lines.collect::<String>())
}

pub(crate) fn run(command: &Command, interrupted: &AtomicBool) -> Result<u8> {
    arguments::check(&command.arguments)?;
    let each = each_input::commands(command)?;
    if let Some(list) = &command.frames {
        if !each.is_empty() {
            let what = format!("--frames with {}: frames of several files", command.output.display());
            return Err(Error::usage(what, "give one file and a name with ####, such as frame_####.png"));
        }
        return render_frames(command, list, interrupted).map(|()| 0);
    }
    check_still(&command.length)?;
    let mut reporter = Reporter::new(command.progress);
    note_plain_name(&command.output, each.is_empty(), &mut reporter.warnings);
    let has_input = each.iter().flat_map(|one| &one.arguments.inputs).any(|input| input.exists());
    if has_input && !command.list_outputs {
        each_input::make_folder(&command.output)?;
    }
    let pool = super::pool(command.arguments.options.thread_count())?;
    pool.install(|| match each.as_slice() {
        [] => render_still(command, &mut reporter, interrupted).map(|_| 0),
        [one] => render_still(one, &mut reporter, interrupted).map(|_| 0),
        several => each_input::run(several, &mut reporter, interrupted),
    })
}

/// Notes that the name of a picture has places for numbers or names that nothing fills.
fn note_plain_name(output: &Path, is_one: bool, warnings: &mut Warnings) {
    let name = output.display();
    if matches!(FileNames::parse(output), Ok(Some(_))) {
        warnings.note(format!("{name} names one picture; --frames numbers several"));
    } else if is_one && output.to_string_lossy().contains(['{', '}']) {
        warnings.note(format!("{name} names one picture; {{name}} in it stands for the name of each input"));
    }
}

/// What became of the picture of a command.
#[derive(PartialEq)]
pub(super) enum Outcome {
    Written,
    /// A complete file of the same scene and settings was there.
    Existed,
    /// Its name was printed.
    Listed,
}

/// Renders one picture.
pub(super) fn render_still(
    command: &Command,
    reporter: &mut Reporter,
    interrupted: &AtomicBool,
) -> Result<Outcome> {
    let mut target = OutputTarget::new(&command.output)?;
    if command.skip_existing {
        output::check_skipping(&command.output, target.format())?;
    }
    if let Some(shard) = command.shard {
        target = target.shard(shard)?;
    }
    if command.list_outputs {
        return super::print(&format!("{}\n", target.file().display())).map(|()| Outcome::Listed);
    }
    check_folder(&command.output)?;
    let selection = AovSelection::new(&command.aov)?;
    check_aov_format(command, target.format())?;
    if let Some(file) = &command.stats {
        if is_same_file(file, target.file()) {
            let what = format!("{}: both the picture and its statistics", file.display());
            return Err(Error::usage(what, "give --stats another file than --output"));
        }
        check_folder(file)?;
    }
    render_to(command, &target, &selection, reporter, interrupted)
}

/// Checks that a single picture has neither a frame rate nor a duration.
fn check_still(length: &LengthArguments) -> Result<()> {
    let given = [("--fps", length.fps.is_some()), ("--duration", length.duration.is_some())];
    match given.iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((option, _)) => {
            let what = format!("{option} is for animations, and this is a single picture");
            let hint = "give --frames, such as --frames 0-59 -o frame_####.png, or --time for one picture";
            Err(Error::usage(what, hint))
        }
    }
}

fn check_aov_format(command: &Command, format: Format) -> Result<()> {
    if !command.aov.is_empty() && format != Format::Exr {
        let what = format!("{}: only .exr holds AOVs", command.output.display());
        return Err(Error::usage(what, "name a file that ends in .exr"));
    }
    Ok(())
}

/// Renders frames of an animation to one file each.
fn render_frames(command: &Command, list: &FrameList, interrupted: &AtomicBool) -> Result<()> {
    if command.stats.is_some() {
        return Err(Error::usage(
            "--stats is for single pictures, not for --frames",
            "leave one of them out",
        ));
    }
    let format = Format::from_path(&command.output)?;
    check_aov_format(command, format)?;
    if command.skip_existing {
        output::check_skipping(&command.output, format)?;
    }
    let shard = command.shard.unwrap_or(Shard::ALL);
    let names = file_names(&command.output, list)?;
    if command.list_outputs {
        let mine = list.frames().iter().enumerate().filter(|(place, _)| shard.has(*place));
        let text: String = mine.map(|(_, &frame)| format!("{}\n", names.of(frame).display())).collect();
        return super::print(&text);
    }
    let pictures = FrameSeries {
        names,
        format,
        selection: AovSelection::new(&command.aov)?,
        aovs: command.aov.clone(),
        shard,
        skip_existing: command.skip_existing,
        progress: command.progress,
        strict: command.strict,
    };
    check_folder(&command.output)?;
    frames::write_frames(&command.arguments, &command.length, Some(list), &pictures, interrupted)
}

fn render_to(
    command: &Command,
    target: &OutputTarget,
    selection: &AovSelection,
    reporter: &mut Reporter,
    interrupted: &AtomicBool,
) -> Result<Outcome> {
    let mut settings = command.arguments.options.settings()?;
    settings.shard = command.shard.unwrap_or_default();
    settings.aovs = command.aov.clone();
    let is_rounded = target.format() != Format::Exr;
    let (mut session, mut resolved) = reporter.load_and_resolve(&command.arguments, &settings, is_rounded)?;
    let file = Some(target.file()).filter(|_| !matches!(target, OutputTarget::StandardOutput));
    reporter.check_outputs(command.stats.iter().map(PathBuf::as_path).chain(file))?;
    if let Some(target) = command.accuracy.target() {
        metadata::add_to_fingerprint(&mut Arc::make_mut(&mut resolved).metadata, "sampling_target", &target);
    }
    if command.skip_existing && target.existing().is(metadata::fingerprint_of(&resolved.metadata), None) {
        reporter.show();
        reporter
            .progress
            .finish(&format!("{} exists with the same scene and settings", target.file().display()));
        return Ok(Outcome::Existed);
    }
    let is_transparent = resolved.settings.picture.is_transparent();
    output::check_bits_of(resolved.settings.picture.bits, target.format())?;
    output::check_alpha(is_transparent, ".jpg", target.format() != Format::Jpeg)?;
    let has_target = command.accuracy.target().is_some();
    output::check_accuracy_alpha(is_transparent, has_target)?;
    target.check_writable()?;
    reporter.progress.phase("building");
    let Reporter { progress, seconds, warnings, .. } = &mut *reporter;
    let control = RenderControl { cancel: interrupted, ..RenderControl::default() };
    timed(&mut seconds.build, || session.consume(&resolved))?;
    progress.phase("rendering");
    let job = || session.first_job(&resolved, true, &control, warnings);
    let mut job = timed(&mut seconds.render, job)?;
    output::check_memory(&job, target, selection, has_target)?;
    reporter.show();
    let Reporter { progress, seconds, warnings, .. } = &mut *reporter;
    let control = RenderControl {
        cancel: interrupted,
        progress: &|done, total| progress.tiles(done, total),
        time_stages: command.stats.is_some(),
    };
    let (picture, statistics) = timed(&mut seconds.render, || match command.accuracy.target() {
        Some(error_target) => {
            render_to_accuracy(&mut job, &error_target, target.format(), &control, warnings)
        }
        None => render_target(&job, target, selection, &control),
    })?;
    let findings = timed(&mut seconds.render, || Findings::of(&job, &picture, &statistics, &control))?;
    findings.warn(warnings);
    progress.clear();
    reporter.show();

    timed(&mut reporter.seconds.write, || output::write(&picture, &job, target))?;
    let Reporter { progress, seconds, warnings, .. } = &*reporter;
    let (world, window) = (&job.world, job.window);
    if let Some(file) = &command.stats {
        let report = statistics::to_json(&job.metadata, seconds, world, &job.plan, &statistics, warnings);
        write_whole(file, |out| writeln!(out, "{report:#}"))?;
    }
    reporter.check(command.strict, "the picture was")?;
    progress.finish(&format!(
        "wrote {} ({} x {}; load {:.2} s, prepare {:.2} s, build {:.2} s, render {:.2} s, write {:.2} s)",
        target.file().display(),
        window.width,
        window.height,
        seconds.load,
        seconds.prepare,
        seconds.build,
        seconds.render,
        seconds.write
    ));
    Ok(Outcome::Written)
}
