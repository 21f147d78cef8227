//! `kiln animate`: renders files to a film or to numbered frames.

mod frame_files;

use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::arguments::{self, Arguments};
use crate::frames::{self, FrameFindings, FrameSeries, LengthArguments};
use crate::output::{PNG_BITS, bytes_per_pixel, check_alpha, check_bits, check_folder, check_skipping};
use crate::prepare::{Reporter, timed};
use crate::progress::Mode;
use kiln::animation::{
    FileNames, FilmDefaults, FrameData, FrameList, FrameRequest, Quality, VideoFormat, VideoSpec, VideoWriter,
};
use kiln::error::{Error, Result};
use kiln::farm::Shard;
use kiln::film::write::{Format, PngForm};
use kiln::job::RenderJob;
use kiln::render::RenderControl;
use kiln::render::aov::AovSelection;
use kiln::scene::Seconds;
use kiln::scene::animation::Animation;
use kiln::scene::option::group;

#[derive(Args)]
#[command(mut_arg("inputs", |inputs| inputs.help(inputs_help())))]
pub(crate) struct Command {
    /// Film to write: .mp4, .gif, .png (animated) or .y4m; a pattern such as frame_####.png for one file per frame; `-` for
    /// uncompressed frames on standard output
    #[arg(short, long, help_heading = group::OUTPUT, display_order = 0, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    pub arguments: Arguments,
    #[command(flatten)]
    length: LengthArguments,
    /// Quality of an .mp4
    #[arg(long, help_heading = group::OUTPUT, value_enum, default_value = "high")]
    quality: QualityName,
    /// Frames to render, such as 1-10, 1-10:2 or 3,7,9-12 [default: all]
    #[arg(long, help_heading = group::ANIMATION, value_name = "LIST", allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Render only shard I of N of numbered frames, from 1: every N-th frame
    #[arg(long, help_heading = group::OUTPUT, allow_hyphen_values = true, value_name = "I/N")]
    shard: Option<Shard>,
    /// Skip finished numbered frames of the same scene and settings (a fingerprint is stored in .png and .exr)
    #[arg(long, help_heading = group::OUTPUT)]
    skip_existing: bool,
    /// Format of frames on standard output
    #[arg(long, help_heading = group::OUTPUT, value_enum, default_value = "y4m")]
    raw: RawName,
    /// Progress on standard error
    #[arg(long, help_heading = group::OUTPUT, value_enum, default_value = "auto")]
    progress: Mode,
    /// Exit with an error if there are warnings
    #[arg(long, help_heading = group::OUTPUT)]
    strict: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum QualityName {
    /// Near the quality of the pictures
    High,
    /// Smaller files
    Low,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum RawName {
    /// YUV4MPEG2, with a header of size and frame rate
    Y4m,
    /// 8-bit RGB without a header
    Rgb,
}

fn inputs_help() -> String {
    let pictures = "for a film of pictures that exist, their pattern: frame_####.png";
    format!("{}; {pictures}", arguments::inputs_help("Input files, combined into one scene"))
}

pub(crate) fn run(command: &Command, interrupted: &AtomicBool) -> Result<()> {
    arguments::check(&command.arguments)?;
    let names = FileNames::parse(&command.output).map_err(|what| Error::usage(what, "give one ####"))?;
    let pictures = frame_files::pattern(&command.arguments.inputs)?;
    if let Some(names) = names {
        if let Some(pattern) = pictures {
            let what = format!("{}: frames that are rendered already", pattern.display());
            return Err(Error::usage(what, "name a film as output: an .mp4, .gif, .png or .y4m"));
        }
        let format = Format::from_path(&command.output)?;
        if command.skip_existing {
            check_skipping(&command.output, format)?;
        }
        check_folder(&command.output)?;
        let selection = AovSelection::new(&[])?;
        let series = FrameSeries {
            names,
            format,
            selection,
            aovs: Vec::new(),
            shard: command.shard.unwrap_or(Shard::ALL),
            skip_existing: command.skip_existing,
            progress: command.progress,
            strict: command.strict,
        };
        let (arguments, length, list) = (&command.arguments, &command.length, command.frames.as_ref());
        return frames::write_frames(arguments, length, list, &series, interrupted);
    }
    check_whole(command)?;
    let frames = match pictures {
        Some(pattern) => Some(frame_files::files(pattern, command.frames.as_ref())?),
        None => None,
    };
    let quality = match command.quality {
        QualityName::High => Quality::High,
        QualityName::Low => Quality::Low,
    };
    let is_stream = command.output == Path::new("-");
    let format = match (is_stream, command.raw) {
        (true, RawName::Y4m) => VideoFormat::Y4m,
        (true, RawName::Rgb) => VideoFormat::Rgb,
        (false, _) => VideoFormat::from_path(&command.output, quality).ok_or_else(|| {
            let what = format!("{}: not a film that can be written", command.output.display());
            Error::usage(what, "name an .mp4, .gif, .png or .y4m, or numbered frames: frame_####.png")
        })?,
    };
    if !is_stream {
        check_folder(&command.output)?;
    }
    match frames {
        Some(frames) => frame_files::film(command, &frames, format, is_stream, interrupted),
        None => film(command, format, is_stream, interrupted),
    }
}

/// A film of the command that is begun.
fn recorder(command: &Command, format: VideoFormat, spec: VideoSpec, is_stream: bool) -> Result<VideoWriter> {
    format.check(spec.size, spec.fps)?;
    if is_stream {
        let out = Box::new(BufWriter::with_capacity(1 << 20, std::io::stdout()));
        return VideoWriter::to_stream(out, format, spec);
    }
    VideoWriter::to_file(&command.output, format, spec)
}

/// What was written, in `took` seconds.
fn summary(command: &Command, spec: VideoSpec, took: f64) -> String {
    let VideoSpec { size: [width, height], frames, fps, .. } = spec;
    format!(
        "wrote {} ({width} x {height}, {frames} frames, {:.2} s at {fps} frames per second) in {took:.2} s",
        command.output.display(),
        frames as f64 / fps,
    )
}

/// Checks that a film is made as a whole: options of single frames are errors that name the command for frames.
fn check_whole(command: &Command) -> Result<()> {
    let (option, given) = match (command.shard, command.skip_existing) {
        (Some(shard), _) => ("--shard", format!("--shard {shard}")),
        (None, true) => ("--skip-existing", "--skip-existing".to_owned()),
        (None, false) => return Ok(()),
    };
    let inputs: Vec<_> = command.arguments.inputs.iter().map(|input| input.display().to_string()).collect();
    let stem = command.output.file_stem().filter(|stem| *stem != "-").unwrap_or("frame".as_ref());
    let names = command.output.with_file_name(format!("{}_####.png", stem.to_string_lossy()));
    let hint =
        format!("write numbered frames: `kiln animate {} {given} -o {}`", inputs.join(" "), names.display());
    Err(Error::usage(format!("{option} is for numbered frames, not for a film"), hint))
}

/// The longer side of the pictures of films that have no size, in pixels.
const LONGEST_SIDE: u32 = 512;

fn film(command: &Command, format: VideoFormat, is_stream: bool, interrupted: &AtomicBool) -> Result<()> {
    let pool = super::pool(command.arguments.options.thread_count())?;
    let mut reporter = Reporter::new(command.progress);
    let LengthArguments { fps, duration } = command.length;
    if let Some([frame]) = command.frames.as_ref().map(FrameList::frames) {
        reporter
            .warnings
            .note(format!("--frames {frame} is one frame; --frames 0-{frame} are those up to it"));
    }
    // Files of these formats are large, and browsers play few of their frames a second.
    let is_animated_picture = matches!(format, VideoFormat::Gif | VideoFormat::Apng);
    let turntable = if is_animated_picture { [15.0, 5.0] } else { [Animation::FPS, Animation::TURN] };
    let film = Some(FilmDefaults { longest_side: LONGEST_SIDE, turntable });
    let all = FrameRequest::all(fps, duration.map(Seconds::get), command.frames.as_ref());
    let request = FrameRequest { film, ..all };
    let settings = command.arguments.options.settings()?;
    let animation = pool.install(|| reporter.load_animation(&command.arguments, &settings, &request))?;
    reporter.check_outputs((!is_stream).then_some(&command.output))?;
    let picture = &animation.picture.settings.picture;
    let is_png = format == VideoFormat::Apng;
    check_alpha(picture.is_transparent(), "a film", is_png)?;
    let (film, bits) = if is_png { ("an animated .png", &PNG_BITS[..]) } else { ("a film", &PNG_BITS[..1]) };
    check_bits(picture.bits, film, bits)?;
    let form = PngForm::new(picture.is_transparent(), picture.display().rounding, picture.pipeline());
    frames::first_frame(&mut reporter, &pool, &animation, interrupted)?;
    let window = animation.picture.window;
    let size = [window.width, window.height];
    let spec = VideoSpec { size, fps: animation.timeline.fps(), frames: animation.frames.len(), form };
    let mut recorder = recorder(command, format, spec, is_stream)?;
    let findings = FrameFindings::default();
    let make = |frame: i32, job: &RenderJob, control: &RenderControl| {
        let (picture, statistics) = job.render_image(control)?;
        findings.add(frame, (&picture, &statistics), &animation, job, control)?;
        format.convert(&picture)
    };
    let mut take = |_, frame: FrameData| recorder.add(frame);
    let mut took = 0.0;
    let picture = &animation.picture.settings.picture;
    // At least 12 bytes for a pixel of three `f32`, and up to 8 for the converted frame.
    let needs = (0, bytes_per_pixel(Format::Png, &AovSelection::new(&[])?, 0, picture).max(12) + 8);
    timed(&mut took, || {
        frames::render_all(&animation, &pool, needs, interrupted, &reporter.progress, &make, &mut take)
    })?;
    recorder.finish()?;
    frames::finish(&mut reporter, &findings, command.strict)?;
    reporter.progress.finish(&summary(command, spec, took));
    Ok(())
}
