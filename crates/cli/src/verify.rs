//! `kiln verify`: lists frames that are missing, broken, or rendered with other settings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use serde_json::json;

use super::arguments::{self, Arguments};
use super::frames::LengthArguments;
use super::prepare::Reporter;
use super::progress::Mode;
use kiln::animation::{FileNames, FrameList, FrameRequest};
use kiln::error::{Error, Result, printable};
use kiln::farm::Shard;
use kiln::files::IS_FOLDER;
use kiln::film::check::{FileState, PictureIdentity, state_of};
use kiln::film::write::{FINGERPRINT, FRAME, Format};
use kiln::job::metadata::fingerprint_of;
use kiln::job::{Metadata, RenderSettings};
use kiln::render::aov::AovSelection;
use kiln::scene::Seconds;
use kiln::scene::option::group;

#[derive(Args)]
#[command(
    after_help = "Without --output, INPUT is the pattern of the pictures; all must have the same scene and settings:\n  \
    kiln verify frame_####.png --frames 0-99\n\
    With --output, the pictures must be those that `kiln render` would write with the same options:\n  \
    kiln verify scene.toml -o frame_####.png --frames 0-99\n\
    Exit code: 0 if every picture is valid, else 1."
)]
pub(crate) struct Command {
    /// Pictures to check, .png or .exr, as a pattern such as frame_####.png or frame_%04d.png
    #[arg(short, long, help_heading = group::OUTPUT, display_order = 0, value_name = "PATTERN")]
    output: Option<PathBuf>,
    #[command(flatten)]
    pub arguments: Arguments,
    #[command(flatten)]
    length: LengthArguments,
    /// Expected frames [default: all of the animation, if a scene is given]
    #[arg(long, help_heading = group::ANIMATION, display_order = 0, value_name = "LIST", allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// AOVs of the pictures, as for `kiln render`
    #[arg(long, help_heading = group::OUTPUT, value_name = "LIST", value_delimiter = ',')]
    aov: Vec<String>,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
}

/// A missing, broken or different picture.
#[derive(serde::Serialize)]
struct Fault {
    frame: Option<i32>,
    file: String,
    #[serde(skip)]
    kind: &'static str,
    why: String,
}

pub(crate) fn run(command: &Command) -> Result<u8> {
    let Some(output) = &command.output else {
        let [name] = command.arguments.inputs.as_slice() else {
            return Err(Error::usage(
                "several patterns of pictures",
                "give one, or a scene and the pattern as --output",
            ));
        };
        let files = files(name, command.frames.as_ref())?;
        return report(command, &files, &check(&files, Format::from_path(name)?, None));
    };
    arguments::check(&command.arguments)?;
    AovSelection::new(&command.aov)?;
    let format = Format::from_path(output)?;
    let (metadata, list) =
        super::pool(command.arguments.options.thread_count())?.install(|| expected(command, output))?;
    let files = files(output, list.as_ref())?;
    report(command, &files, &check(&files, format, Some(&metadata)))
}

/// The expected metadata and frames.
fn expected(command: &Command, output: &Path) -> Result<(Metadata, Option<FrameList>)> {
    let mut reporter = Reporter::silent(Mode::None);
    let settings = RenderSettings { aovs: command.aov.clone(), ..command.arguments.options.settings()? };
    let is_series = FileNames::parse(output).is_ok_and(|names| names.is_some());
    if command.frames.is_none() && !is_series {
        let (_, picture) = reporter.load_and_resolve(&command.arguments, &settings, true)?;
        return Ok((picture.metadata.clone(), None));
    }
    // All frames are reported as existing, so that no tree is built.
    let request = FrameRequest {
        fps: command.length.fps,
        duration: command.length.duration.map(Seconds::get),
        list: command.frames.as_ref(),
        shard: Shard::ALL,
        is_displayed: true,
        film: None,
        is_there: &|_, _| true,
    };
    let animation = reporter.load_animation(&command.arguments, &settings, &request)?;
    let list = command.frames.clone().unwrap_or_else(|| FrameList::range(0, animation.timeline.last()));
    Ok((animation.picture.metadata.clone(), Some(list)))
}

/// The expected files with their frames.
fn files(name: &Path, list: Option<&FrameList>) -> Result<Vec<(Option<i32>, PathBuf)>> {
    let of = |what: &str| format!("{}: {what}", name.display());
    match Format::from_path(name) {
        Ok(Format::Jpeg) => {
            let what = of("a JPEG has no fingerprint and no checksum");
            return Err(Error::usage(what, "name .png or .exr pictures"));
        }
        Err(_) if name.is_dir() => {
            let hint = format!("name its pictures: {} --frames 1-9", name.join("frame_####.png").display());
            return Err(Error::usage(of(IS_FOLDER), hint));
        }
        Err(_) => return Err(Error::usage(of("not a picture of kiln"), "name .png or .exr pictures")),
        Ok(_) => {}
    }
    let names = FileNames::parse(name).map_err(|what| Error::usage(what, "give the name one ####"))?;
    match (names, list) {
        (Some(names), Some(list)) => Ok(list.frames().iter().map(|&f| (Some(f), names.of(f))).collect()),
        (None, None) => Ok(vec![(None, name.to_owned())]),
        (None, Some(list)) if list.frames().len() == 1 => Ok(vec![(Some(list.frames()[0]), name.to_owned())]),
        (Some(_), None) => Err(Error::usage("the expected frames are not known", "give --frames")),
        (None, Some(_)) => {
            let what = format!("{}: one name for several frames", name.display());
            Err(Error::usage(what, "give the name a place for their number, such as frame_####.png"))
        }
    }
}

/// Faults of the files. Without given metadata, the most frequent fingerprint is expected.
fn check(files: &[(Option<i32>, PathBuf)], format: Format, metadata: Option<&Metadata>) -> Vec<Fault> {
    let fingerprint = metadata.map(|metadata| fingerprint_of(metadata));
    let found: Vec<FileState> = files.par_iter().map(|(_, file)| state_of(file, format)).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for found in &found {
        if let FileState::Whole(PictureIdentity { fingerprint: Some(fingerprint), .. }) = found {
            *counts.entry(fingerprint).or_default() += 1;
        }
    }
    let most = counts.iter().max_by_key(|(_, count)| **count).map(|(fingerprint, _)| *fingerprint);
    let wanted = fingerprint.or(most);
    let fault = |(frame, file): &(Option<i32>, PathBuf), found: &FileState| {
        let (kind, why) = match found {
            FileState::Missing => ("missing", "no such file".to_owned()),
            FileState::Broken(why) => ("broken", why.clone()),
            FileState::Whole(PictureIdentity { fingerprint: None, .. }) => {
                ("different", "no fingerprint of kiln in the file".into())
            }
            FileState::Whole(made) if made.fingerprint.as_deref() != wanted => (
                "different",
                metadata.map_or_else(|| UNKNOWN.into(), |expected| difference(&made.texts, expected)),
            ),
            // A single file without an expected fingerprint may be any frame.
            FileState::Whole(made) if made.frame != *frame && (frame.is_some() || fingerprint.is_some()) => {
                ("different", made.frame.map_or("not a frame".into(), |frame| format!("is frame {frame}")))
            }
            FileState::Whole(_) => return None,
        };
        Some(Fault { frame: *frame, file: file.display().to_string(), kind, why })
    };
    files.iter().zip(&found).filter_map(|(file, found)| fault(file, found)).collect()
}

/// Reported difference of a picture with another fingerprint and unknown settings.
const UNKNOWN: &str = "rendered from another scene, with other settings or by another version of kiln";

/// Reported difference of a picture with another fingerprint and the same settings.
const OTHER: &str = "rendered from another scene or by another version of kiln";

/// The settings in which a picture differs from what is expected.
fn difference(found: &[(String, String)], expected: &Metadata) -> String {
    let value = |texts: &[(String, String)], key: &str| {
        let entry = texts.iter().find(|(name, _)| name == key);
        entry.map_or("the default", |(_, value)| value).to_owned()
    };
    let settings = expected.iter().chain(found).map(|(key, _)| key.as_str());
    let mut names: Vec<&str> = settings.filter(|key| ![FINGERPRINT, FRAME].contains(key)).collect();
    names.sort_unstable();
    names.dedup();
    let pairs = names.iter().map(|key| (key, value(found, key), value(expected, key)));
    // Exposures that are metered are not known before the picture.
    let pairs = pairs
        .filter(|(_, found, expected)| found != expected && !found.starts_with(&format!("{expected} (")));
    let different: Vec<String> = pairs
        .map(|(key, found, expected)| format!("{}: {found}, not {expected}", key.trim_start_matches("kiln:")))
        .collect();
    if different.is_empty() { OTHER.into() } else { different.join("; ") }
}

/// Prints the faults. Returns the exit code.
fn report(command: &Command, files: &[(Option<i32>, PathBuf)], faults: &[Fault]) -> Result<u8> {
    let of = |kind: &str| faults.iter().filter(|fault| fault.kind == kind).collect::<Vec<_>>();
    let [missing, broken, different] = ["missing", "broken", "different"].map(of);
    let valid = files.len() - faults.len();
    let again: Vec<String> = faults.iter().filter_map(|fault| fault.frame).map(|f| f.to_string()).collect();
    let again = again.join(",").parse::<FrameList>().map(|list| list.to_string()).unwrap_or_default();
    let text = if command.json {
        let report = json!({
            "schema": 1,
            "pictures": files.len(),
            "valid": valid,
            "missing": missing,
            "broken": broken,
            "different": different,
            "to_render": again,
        });
        super::json_text(&report)
    } else {
        let mut text: String = faults
            .iter()
            .map(|f| printable(&format!("{}: {}: {}", f.file, f.kind, f.why)).into_owned() + "\n")
            .collect();
        let [missing, broken, different] = [missing, broken, different].map(|faults| faults.len());
        text += &format!(
            "{valid} of {} valid, {missing} missing, {broken} broken, {different} with different settings\n",
            files.len()
        );
        if !again.is_empty() {
            text += &format!("to render again: --frames {again}\n");
        }
        text
    };
    super::print(&text)?;
    Ok(u8::from(!faults.is_empty()))
}
