//! Messages on standard error: lines for people, JSON lines, or the messages of Open Job Description. All output to
//! standard error goes through [`Message::print`], which escapes untrusted text.

use std::collections::HashSet;
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

use serde_json::json;

use kiln::error::{Warnings, printable, printable_json, shortened};

/// The syntax of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Syntax {
    Text,
    Json,
    Openjd,
}

static SYNTAX: OnceLock<Syntax> = OnceLock::new();

/// Whether the last message for a program was printed ([`Message::is_last`]).
static IS_ENDED: Mutex<bool> = Mutex::new(false);

/// Sets the syntax by the option `--progress`. It is read from the arguments as typed, so that errors about them have
/// the syntax, too.
pub(super) fn set_syntax(arguments: impl Iterator<Item = OsString>) {
    let _ = SYNTAX.set(syntax_of(arguments));
}

fn syntax_of(arguments: impl Iterator<Item = OsString>) -> Syntax {
    let mut arguments = arguments.take_while(|argument| argument != "--");
    let mut mode = None;
    while let Some(argument) = arguments.next() {
        if argument == "--progress" {
            mode = arguments.next();
        } else if let Some(value) = argument.to_str().and_then(|text| text.strip_prefix("--progress=")) {
            mode = Some(value.into());
        }
    }
    match mode.as_ref().and_then(|mode| mode.to_str()) {
        Some("json") => Syntax::Json,
        Some("openjd") => Syntax::Openjd,
        _ => Syntax::Text,
    }
}

/// A message on standard error.
pub(super) enum Message<'a> {
    /// Completed and total number of a unit, seconds so far and estimated seconds to the end.
    Progress {
        done: usize,
        total: usize,
        unit: &'a str,
        percent: usize,
        elapsed: f64,
        eta: Option<f64>,
    },
    Note(&'a str),
    Warning(&'a str),
    /// A frame and its file, which was written. Not for people, whom progress serves.
    Frame(i32, &'a Path),
    /// A picture of several is finished. Not for people, whom progress serves.
    Picture(&'a str),
    /// A picture of several failed: what is wrong and a hint, which may be empty. The others go on.
    Failure {
        what: &'a str,
        hint: &'a str,
    },
    /// What is wrong, a hint, which may be empty, and the exit code.
    Error {
        what: &'a str,
        hint: &'a str,
        exit_code: u8,
    },
    /// A signal ended the process, with the exit code. Not for people, who sent it.
    Interrupted {
        exit_code: u8,
    },
    Done(&'a str),
}

impl Message<'_> {
    /// Prints the message. Programs get nothing after the last one, which other threads may still try to add to.
    pub(super) fn print(&self) {
        let syntax = SYNTAX.get().copied().unwrap_or(Syntax::Text);
        let mut is_ended = IS_ENDED.lock().unwrap_or_else(PoisonError::into_inner);
        if *is_ended {
            return;
        }
        *is_ended = syntax != Syntax::Text && self.is_last();
        let lines = match syntax {
            Syntax::Text => self.text(),
            Syntax::Json => Some(printable_json(&self.json().to_string()).into_owned()),
            Syntax::Openjd => Some(self.openjd()),
        };
        if let Some(lines) = lines {
            print_stderr(&lines);
        }
    }

    fn is_last(&self) -> bool {
        matches!(self, Message::Error { .. } | Message::Interrupted { .. } | Message::Done(_))
    }

    fn text(&self) -> Option<String> {
        Some(match self {
            Message::Progress { done, total, unit, percent, eta, .. } => {
                let left = eta.map(|seconds| format!(", {} left", duration_text(seconds)));
                format!("kiln: {percent} % ({done} of {total} {unit}){}", left.unwrap_or_default())
            }
            Message::Note(text) => format!("kiln: note: {}", printable(text)),
            Message::Warning(text) => format!("kiln: warning: {}", printable(text)),
            Message::Error { what, hint: "", .. } | Message::Failure { what, hint: "" } => {
                format!("kiln: error: {}", printable(what))
            }
            Message::Failure { what, hint } => {
                format!("kiln: error: {}; {}", printable(what), printable(hint))
            }
            Message::Error { what, hint, .. } => {
                format!("kiln: error: {}\nhint: {}", printable(what), printable(hint))
            }
            Message::Done(text) => format!("kiln: {}", printable(text)),
            Message::Frame(..) | Message::Picture(_) | Message::Interrupted { .. } => return None,
        })
    }

    fn json(&self) -> serde_json::Value {
        let tenths = |seconds: f64| (seconds * 10.0).round() / 10.0;
        let hinted = |hint: &str| (!hint.is_empty()).then(|| shortened(hint).into_owned());
        match self {
            Message::Progress { done, total, unit, elapsed, eta, .. } => json!({
                "event": "progress", "done": done, "total": total, "unit": unit,
                "elapsed": tenths(*elapsed), "eta": eta.map(tenths),
            }),
            Message::Note(text) => json!({ "event": "note", "message": shortened(text) }),
            Message::Warning(text) => json!({ "event": "warning", "message": shortened(text) }),
            Message::Frame(frame, file) => {
                json!({ "event": "frame", "frame": frame, "file": file.display().to_string() })
            }
            Message::Picture(text) => json!({ "event": "picture", "message": shortened(text) }),
            Message::Failure { what, hint } => {
                json!({ "event": "failure", "message": shortened(what), "hint": hinted(hint) })
            }
            Message::Error { what, hint, exit_code } => {
                let (what, hint) = (shortened(what), hinted(hint));
                json!({ "event": "error", "message": what, "hint": hint, "exit_code": exit_code })
            }
            Message::Interrupted { exit_code } => json!({ "event": "interrupted", "exit_code": exit_code }),
            Message::Done(text) => json!({ "event": "done", "message": shortened(text) }),
        }
    }

    /// Open Job Description, How Jobs Are Run, Stdout/Stderr Messages. Other lines are lines of its log. A line break
    /// in a message, as in the name of a file, would begin another one.
    fn openjd(&self) -> String {
        let line = printable;
        match self {
            Message::Progress { percent, .. } => format!("openjd_progress: {percent}"),
            Message::Note(text) => format!("kiln: note: {}", line(text)),
            Message::Warning(text) => format!("kiln: warning: {}", line(text)),
            Message::Frame(_, file) => format!("openjd_status: wrote {}", line(&file.display().to_string())),
            Message::Picture(text) => format!("openjd_status: {}", line(text)),
            Message::Failure { .. } => self.text().unwrap_or_default(),
            Message::Error { what, hint: "", .. } => format!("openjd_fail: {}", line(what)),
            Message::Error { what, hint, .. } => format!("openjd_fail: {}\nhint: {}", line(what), line(hint)),
            // The sender of the signal knows; a task that it cancelled has not failed.
            Message::Interrupted { .. } => "openjd_status: interrupted".into(),
            Message::Done(text) => format!("openjd_progress: 100\nopenjd_status: {}", line(text)),
        }
    }
}

/// A duration in seconds, minutes or hours.
pub(super) fn duration_text(seconds: f64) -> String {
    match seconds.round() {
        ..120.0 => format!("{seconds:.0} s"),
        ..7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

/// Writes a line to standard error, in one piece, and ignores errors, unlike `eprintln!`, which panics on a closed pipe
/// or a full disk.
fn print_stderr(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}

/// Prints new warnings and notes, each once.
#[derive(Default)]
pub(super) struct WarningPrinter {
    /// Numbers of those already printed.
    warnings: usize,
    notes: usize,
    /// The input that they are about, of several, and the notes on those before.
    subject: Option<String>,
    known_notes: HashSet<String>,
}

impl WarningPrinter {
    /// Begins the warnings about another input of several, which they name. A note that several inputs
    /// share is printed once.
    pub(super) fn begin(&mut self, subject: String) {
        (self.warnings, self.notes, self.subject) = (0, 0, Some(subject));
    }

    pub(super) fn print(&mut self, warnings: &Warnings, with_notes: bool) {
        for text in &warnings.messages()[self.warnings..] {
            match self.subject.as_ref().filter(|subject| !text.contains(subject.as_str())) {
                Some(subject) => Message::Warning(&format!("{subject}: {text}")).print(),
                None => Message::Warning(text).print(),
            }
        }
        if with_notes {
            let new = warnings.notes()[self.notes..].iter().filter(|text| !warnings.is_usual(text));
            let is_one = self.subject.is_none();
            new.filter(|text| self.known_notes.insert((*text).clone()) || is_one)
                .for_each(|text| Message::Note(text).print());
        }
        (self.warnings, self.notes) = (warnings.messages().len(), warnings.notes().len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_syntax_is_found_in_any_arguments() {
        for (typed, syntax) in [
            ("render a.obj -o a.png --progress json", Syntax::Json),
            ("--progress=json rendr", Syntax::Json),
            ("animate --progress openjd --bad", Syntax::Openjd),
            ("render --progress jsn", Syntax::Text),
            ("render --progress", Syntax::Text),
            ("render -- --progress json", Syntax::Text),
            ("render json", Syntax::Text),
        ] {
            assert_eq!(syntax_of(typed.split(' ').map(OsString::from)), syntax, "{typed}");
        }
    }

    #[test]
    fn a_message_of_open_job_description_stays_one_line() {
        let what = "a\nopenjd_env: A=b.png: no such file";
        let said = Message::Error { what, hint: "look\rthere", exit_code: 3 }.openjd();
        assert_eq!(said, "openjd_fail: a\\u{a}openjd_env: A=b.png: no such file\nhint: look\\u{d}there");
    }
}
