//! What can go wrong, and what it means for the caller.
//!
//! Every room returns these; only the command line prints them and turns them into exit codes. An error names the
//! file and the place in it, what is wrong there, and what to do about it.

use std::cell::Cell;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The result of anything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// A failure, with enough in it to be mended by who reads it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An input that cannot be used as it is; trying again will not help.
    #[error("{place}: {what}")]
    Input {
        /// The file and, where known, the line or item in it.
        place: Place,
        /// What is wrong there.
        what: String,
        /// What to do about it; may be empty.
        hint: String,
    },
    /// An output that cannot be written.
    #[error("{}: {what}", file.display())]
    Output {
        /// The file that was to be written.
        file: PathBuf,
        /// What went wrong.
        what: String,
    },
    /// A request that contradicts itself or the scene, such as a camera the scene does not have.
    #[error("{what}")]
    Usage {
        /// What is wrong with the request.
        what: String,
        /// What to do about it; may be empty.
        hint: String,
    },
    /// The work itself failed.
    #[error("{what}")]
    Failed {
        /// What failed.
        what: String,
        /// What to do about it; may be empty.
        hint: String,
    },
    /// The caller asked for the work to stop.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// An input error at `place`.
    pub fn input(place: impl Into<Place>, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Input { place: place.into(), what: what.into(), hint: hint.into() }
    }

    /// A wrong request.
    pub fn usage(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Usage { what: what.into(), hint: hint.into() }
    }

    /// An output error for `file`.
    pub fn output(file: &Path, what: impl fmt::Display) -> Self {
        Error::Output { file: file.to_owned(), what: what.to_string() }
    }

    /// What to do about it; empty where there is nothing to say.
    pub fn hint(&self) -> &str {
        match self {
            Error::Input { hint, .. } | Error::Usage { hint, .. } | Error::Failed { hint, .. } => hint,
            Error::Output { .. } | Error::Interrupted => "",
        }
    }
}

/// A place in an input: the file, and a line or a named item in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: PathBuf,
    /// The line, counted from 1.
    pub line: Option<usize>,
    /// A named item, such as `node 3 "wheel"`.
    pub item: Option<String>,
}

impl Place {
    /// A line of a file, counted from 1.
    pub fn line(file: &Path, line: usize) -> Self {
        Place { file: file.to_owned(), line: Some(line), item: None }
    }

    /// A named item of a file.
    pub fn item(file: &Path, item: impl Into<String>) -> Self {
        Place { file: file.to_owned(), line: None, item: Some(item.into()) }
    }
}

impl From<&Path> for Place {
    fn from(file: &Path) -> Self {
        Place { file: file.to_owned(), line: None, item: None }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(item) = &self.item {
            write!(f, ": {item}")?;
        }
        Ok(())
    }
}

/// What there is to say about an input or a picture that was made all the same, in the order it came up. The command
/// line prints it. *Warnings* name what was left out or replaced, and `--strict` makes them fatal; *notes* name what was
/// decided for the user.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Warnings {
    messages: Vec<String>,
    notes: Vec<String>,
}

impl Warnings {
    /// Adds a warning, once.
    pub fn push(&mut self, message: impl Into<String>) {
        push_once(&mut self.messages, message.into());
    }

    /// Adds a note, once.
    pub fn note(&mut self, message: impl Into<String>) {
        push_once(&mut self.notes, message.into());
    }

    /// The warnings so far.
    pub fn messages(&self) -> &[String] {
        &self.messages
    }

    /// The notes so far.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Whether nothing was warned of.
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }
}

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Calls a library's parser on data from outside. `None` where it panics: the data is then at fault as far as the user can tell.
pub fn contain<T>(parse: impl FnOnce() -> T) -> Option<T> {
    let before = CONTAINED.replace(true);
    // What the parser was given is dropped by the caller, or not looked at again.
    let result = catch_unwind(AssertUnwindSafe(parse));
    CONTAINED.set(before);
    result.ok()
}

/// Whether a panic of this thread will be caught by [`contain`], and is not to be reported by a panic hook.
pub fn is_contained() -> bool {
    CONTAINED.get()
}

fn push_once(messages: &mut Vec<String>, message: String) {
    if !messages.contains(&message) {
        messages.push(message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_of_parsers_end_where_they_are_called() {
        assert_eq!(contain(|| 7), Some(7));
        let nested = contain(|| {
            assert!(contain(|| -> u32 { panic!("by a parser") }).is_none());
            is_contained()
        });
        assert_eq!((nested, is_contained()), (Some(true), false));
    }
}
