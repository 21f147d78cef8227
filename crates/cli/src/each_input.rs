//! `kiln render` of several inputs to a picture each: `{name}` in the name of the output, or a folder as output.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::fs::create_dir_all;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::exit_code;
use super::message::Message;
use super::output::check_folder;
use super::prepare::Reporter;
use super::render::{Command, Outcome, render_still};
use kiln::error::{Error, Result};
use kiln::files::{check_output, file_key};
use kiln::film::check::{FileState, state_of};
use kiln::film::write::Format;
use kiln::import;

/// The place of an input's name, without its ending, in the name of an output.
const NAME: &str = "{name}";

/// A command for each input, and each file in those that are folders, where the name of the output has a place for that of the
/// input; otherwise none. A folder that is to be made for them may be missing ([`make_folder`]).
///
/// # Errors
/// [`Error::Usage`] for inputs without a name, and for two of one name; [`Error::Output`] for a folder that does not exist.
pub(super) fn commands(command: &Command) -> Result<Vec<Command>> {
    let ends_as_folder = command.output.to_string_lossy().ends_with(std::path::is_separator);
    let is_folder = ends_as_folder || command.output.extension().is_none() && command.output.is_dir();
    let pattern = if is_folder { command.output.join("{name}.png") } else { command.output.clone() };
    if !has_name(&pattern) {
        return Ok(Vec::new());
    }
    if !(ends_as_folder || pattern.parent().is_some_and(has_name)) {
        check_folder(&pattern)?;
    }
    let mut inputs: Vec<PathBuf> = Vec::new();
    for input in &command.arguments.inputs {
        match input.is_dir() {
            true => {
                let known: Vec<_> = inputs.iter().map(|input| file_key(input)).collect();
                let files = import::files_in(input)?.into_iter();
                inputs.extend(files.filter(|file| !known.contains(&file_key(file))));
            }
            false => inputs.push(input.clone()),
        }
    }
    if let Some(file) = command.stats.as_ref().filter(|file| inputs.len() > 1 && !has_name(file)) {
        let what = format!("{}: one file for the statistics of several pictures", file.display());
        return Err(Error::usage(what, "give its name a place for theirs, such as {name}.json"));
    }
    let of_input = |input: &PathBuf| {
        let name = input.file_stem().filter(|_| input != Path::new("-")).ok_or_else(|| {
            let what = format!("{}: no name for {NAME} of --output", input.display());
            Error::usage(what, "give --output the whole name, such as -o picture.png")
        })?;
        let mut one = command.clone();
        one.arguments.inputs = vec![input.clone()];
        one.output = with_name(&pattern, name);
        one.stats = command.stats.as_deref().map(|file| with_name(file, name));
        Ok(one)
    };
    let commands = inputs.iter().map(of_input).collect::<Result<Vec<_>>>()?;
    let mut known = HashMap::new();
    for (index, one) in commands.iter().enumerate() {
        for output in outputs(one) {
            if let Some((other, before)) = known.insert(file_key(output), (index, output))
                && other != index
            {
                let [a, b, first, second] =
                    [&inputs[other], &inputs[index], before, output].map(|file| file.display());
                let what = match before == output {
                    true => format!("{a} and {b} would both be written to {first}"),
                    false => format!(
                        "{a} and {b} would be written to {first} and {second}: one file, where case does not count"
                    ),
                };
                return Err(Error::usage(what, "render one of them by a command of its own"));
            }
        }
    }
    Ok(commands)
}

/// Makes the folder that an output names, if it ends as one.
///
/// # Errors
/// [`Error::Output`].
pub(super) fn make_folder(output: &Path) -> Result<()> {
    if !output.to_string_lossy().ends_with(std::path::is_separator) || has_name(output) || output.is_dir() {
        return Ok(());
    }
    create_dir_all(output).map_err(|e| match output.exists() {
        true => Error::output(output, "is a file, not a folder; name another folder"),
        false => Error::output(output, e),
    })
}

/// The files that a command writes.
fn outputs(command: &Command) -> impl Iterator<Item = &PathBuf> {
    std::iter::once(&command.output).chain(&command.stats)
}

/// Checks that no picture overwrites a file that any of the inputs refers to. The inputs are read to find these. If one
/// cannot be read, only pictures made by kiln are overwritten.
fn check_outputs(commands: &[Command], interrupted: &AtomicBool) -> Result<()> {
    // No output exists, so none is overwritten.
    if commands.iter().any(|one| one.list_outputs)
        || !commands.iter().flat_map(outputs).any(|output| output.exists())
    {
        return Ok(());
    }
    let mut unread = None;
    for one in commands {
        let read = import::list_files(&one.arguments.inputs, &one.arguments.options.reading());
        unread = unread.or(read.err().map(|e| one.of_input(&e)));
        if interrupted.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
    }
    commands.iter().flat_map(outputs).try_for_each(|output| check_output(output))?;
    let is_foreign = |output: &&PathBuf| {
        let state = Format::from_path(output).map(|format| state_of(output, format));
        output.exists() && !matches!(state, Ok(FileState::Whole(picture)) if picture.fingerprint.is_some())
    };
    if let Some(unread) = unread
        && let Some(output) = commands.iter().map(|one| &one.output).find(is_foreign)
    {
        let what = format!("{}: may belong to an input that cannot be read ({unread})", output.display());
        return Err(Error::usage(what, "leave that input out, or give --output another folder"));
    }
    Ok(())
}

fn has_name(file: &Path) -> bool {
    file.to_string_lossy().contains(NAME)
}

fn with_name(file: &Path, name: &OsStr) -> PathBuf {
    let text = file.to_string_lossy();
    let mut parts = text.split(NAME);
    let mut whole = OsString::from(parts.next().unwrap_or_default());
    for part in parts {
        whole.push(name);
        whole.push(part);
    }
    whole.into()
}

/// Renders all pictures, each by itself. Those that fail are reported, and the others rendered. Returns the greatest of
/// the exit codes.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn run(commands: &[Command], reporter: &mut Reporter, interrupted: &AtomicBool) -> Result<u8> {
    let start = Instant::now();
    check_outputs(commands, interrupted)?;
    let (mut outcomes, mut worst) = (Vec::new(), 0);
    for (index, one) in commands.iter().enumerate() {
        if let Some(input) = one.arguments.inputs.first() {
            reporter.begin(input, index, commands.len());
        }
        match render_still(one, reporter, interrupted) {
            Ok(outcome) => outcomes.push(outcome),
            Err(_) if interrupted.load(Ordering::Relaxed) => {
                let (done, all) = (outcomes.len(), commands.len());
                let note = format!("{done} of {all} pictures are finished; --skip-existing goes on");
                reporter.warnings.note(note);
                reporter.show();
                return Err(Error::Interrupted);
            }
            Err(e) => {
                worst = worst.max(exit_code(&e));
                let (what, hint) = (one.of_input(&e), e.hint());
                reporter.progress.pause(|| Message::Failure { what: &what, hint }.print());
            }
        }
    }
    reporter.progress.end_parts();
    let count = |wanted: Outcome| outcomes.iter().filter(|outcome| **outcome == wanted).count();
    if count(Outcome::Listed) == commands.len() {
        return Ok(0);
    }
    let (written, existed, failed) =
        (count(Outcome::Written), count(Outcome::Existed), commands.len() - outcomes.len());
    let seconds = start.elapsed().as_secs_f64();
    let existed = if existed > 0 { format!("; {existed} existed") } else { String::new() };
    let written = format!("wrote {written} picture(s) in {seconds:.2} s{existed}");
    if failed == 0 {
        reporter.progress.finish(&written);
    } else {
        let what = format!("{failed} of {} pictures failed; {written}", commands.len());
        Message::Error { what: &what, hint: "", exit_code: worst }.print();
    }
    Ok(worst)
}

impl Command {
    /// An error as a message that names the input.
    fn of_input(&self, e: &Error) -> String {
        let input =
            self.arguments.inputs.first().map(|input| input.display().to_string()).unwrap_or_default();
        let text = e.to_string();
        if text.contains(&input) { text } else { format!("{input}: {text}") }
    }
}
