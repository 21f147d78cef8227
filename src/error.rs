//! Errors and warnings of the library.
//!
//! Library code returns them; only the command line prints them and maps them to exit codes. An error states the file
//! and the place in it, what is wrong, and how to fix it.

mod printable;

pub use printable::{printable, printable_json, printable_lines, shortened};

use std::cell::Cell;
use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An error that states what is wrong and how to fix it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An invalid input.
    #[error("{place}: {what}")]
    Input {
        /// File and, if known, line or item.
        place: Place,
        /// What is wrong.
        what: String,
        /// Hint for a fix; may be empty.
        hint: String,
    },
    /// An output that could not be written.
    #[error("{}: {what}", file.display())]
    Output {
        /// The output file.
        file: PathBuf,
        /// What went wrong.
        what: String,
    },
    /// An invalid request, such as a camera that the scene does not have.
    #[error("{what}")]
    Usage {
        /// What is wrong with the request.
        what: String,
        /// Hint for a fix; may be empty.
        hint: String,
    },
    /// Not enough memory for an operation.
    #[error("{what}")]
    Memory {
        /// The operation and the memory it needs.
        what: String,
        /// Hint for a fix; may be empty.
        hint: String,
    },
    /// A failure of the operation itself.
    #[error("{what}")]
    Failed {
        /// What failed.
        what: String,
        /// Hint for a fix; may be empty.
        hint: String,
    },
    /// The operation was cancelled by the caller.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// Creates [`Error::Input`] at `place`.
    pub fn input(place: impl Into<Place>, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Input { place: place.into(), what: what.into(), hint: hint.into() }
    }

    /// Creates [`Error::Usage`].
    pub fn usage(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Usage { what: what.into(), hint: hint.into() }
    }

    /// Creates [`Error::Output`] for `file`.
    pub fn output(file: &Path, what: impl fmt::Display) -> Self {
        Error::Output { file: file.to_owned(), what: what.to_string() }
    }

    /// Hint for a fix; empty if there is none.
    pub fn hint(&self) -> &str {
        match self {
            Error::Input { hint, .. }
            | Error::Usage { hint, .. }
            | Error::Memory { hint, .. }
            | Error::Failed { hint, .. } => hint,
            Error::Output { .. } | Error::Interrupted => "",
        }
    }
}

/// A place in an input file: a line or a named item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// File name as given by the user.
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

/// Warnings and notes about an operation that succeeded, in order of occurrence. *Warnings* report data that was
/// omitted or replaced; `--strict` makes them fatal. *Notes* report automatic decisions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Warnings {
    messages: Deduplicator,
    notes: Deduplicator,
    left_out: Deduplicator,
    /// Those notes that say what is so at every picture without options.
    usual: HashSet<String>,
}

/// Texts in order without duplicates, at most [`Deduplicator::MOST`] per kind, then a text with the number of the others.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Deduplicator {
    texts: Vec<String>,
    /// Hashes of all texts, including those only counted.
    known: HashSet<u64>,
    /// Number of texts per kind, and index of the text with the number of the others.
    kinds: BTreeMap<&'static str, (usize, Option<usize>)>,
}

impl Deduplicator {
    /// Maximum number of texts kept per kind.
    const MOST: usize = 100;

    /// Adds a text. `kind` is the noun after the number of the others: `warnings`.
    fn push(&mut self, text: String, kind: &'static str) {
        if !self.known.insert(BuildHasherDefault::<DefaultHasher>::default().hash_one(&text)) {
            return;
        }
        let (count, place) = self.kinds.entry(kind).or_default();
        *count += 1;
        let Some(rest @ 1..) = count.checked_sub(Self::MOST) else {
            self.texts.push(text);
            return;
        };
        let place = *place.get_or_insert(self.texts.len());
        let text = format!("{rest} more {kind}");
        match self.texts.get_mut(place) {
            Some(counted) => *counted = text,
            None => self.texts.push(text),
        }
    }
}

impl Warnings {
    /// Starts a new limit of texts per kind, for the next input file.
    pub(crate) fn begin_part(&mut self) {
        self.messages.kinds.clear();
        self.notes.kinds.clear();
    }

    /// Adds a warning, unless it was added before. The first ones are kept, the others only counted.
    pub fn push(&mut self, message: impl Into<String>) {
        self.messages.push(message.into(), "warnings");
    }

    /// Adds a note, unless it was added before. The first ones are kept, the others only counted.
    pub fn note(&mut self, message: impl Into<String>) {
        self.notes.push(message.into(), "notes");
    }

    /// Adds a note on what is so at every picture without options, which `kiln info` says and a render does not.
    pub fn note_usual(&mut self, message: impl Into<String>) {
        let message = message.into();
        self.usual.insert(message.clone());
        self.note(message);
    }

    /// Whether a note is one of those.
    pub fn is_usual(&self, note: &str) -> bool {
        self.usual.contains(note)
    }

    /// Adds a warning about content of an input that is not drawn or not used.
    pub fn left_out(&mut self, message: impl Into<String>) {
        let message = message.into();
        self.left_out.push(message.clone(), "warnings");
        self.push(message);
    }

    /// Adds a warning about a referenced file that is not used. These are counted separately, so that they do not
    /// displace other warnings.
    pub(crate) fn left_out_file(&mut self, message: String) {
        const KIND: &str = "files are missing or cannot be used";
        self.left_out.push(message.clone(), KIND);
        self.messages.push(message, KIND);
    }

    /// Adds a note about content of an input that is not drawn or not used.
    pub fn note_left_out(&mut self, message: impl Into<String>) {
        let message = message.into();
        self.left_out.push(message.clone(), "notes");
        self.note(message);
    }

    /// Adds all warnings and notes of `other`.
    pub fn extend(&mut self, other: &Warnings) {
        other.messages().iter().for_each(|text| self.push(text.as_str()));
        other.notes().iter().for_each(|text| self.note(text.as_str()));
        other.left_out.texts.iter().for_each(|text| self.left_out.push(text.clone(), "warnings"));
        self.usual.extend(other.usual.iter().cloned());
    }

    /// The warnings and notes so far about content that is not drawn or not used.
    pub fn all_left_out(&self) -> &[String] {
        &self.left_out.texts
    }

    /// The warnings so far.
    pub fn messages(&self) -> &[String] {
        &self.messages.texts
    }

    /// The notes so far.
    pub fn notes(&self) -> &[String] {
        &self.notes.texts
    }

    /// Whether there are no warnings; notes are not counted.
    pub fn is_empty(&self) -> bool {
        self.messages.texts.is_empty()
    }
}

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Calls a third-party parser on external data. Returns `None` if it panics, which is then reported as invalid data.
pub fn contain<T>(parse: impl FnOnce() -> T) -> Option<T> {
    let before = CONTAINED.replace(true);
    // Unwind safety: the caller drops the arguments of the parser or does not use them again.
    let result = catch_unwind(AssertUnwindSafe(parse));
    CONTAINED.set(before);
    result.ok()
}

/// Whether panics of this thread are caught by [`contain`]; panic hooks should then not report them.
pub fn is_contained() -> bool {
    CONTAINED.get()
}

/// Options, effects and AOVs that ended, without hyphens in front, and what serves instead.
pub const ENDED: &[(&str, &str)] = &[
    ("edit-light", "it ended; edit [[light]] in a scene file, or change the brightness by --exposure EV"),
    ("geometric-normal", "it is --aov normal; --aov shading-normal has vertex normals and normal maps"),
    ("left-out", "it ended; `kiln explain --measure` measures the light that limits leave out"),
];

/// What serves instead of an option, an effect or an AOV that ended; `None` for all other names.
pub fn ended(name: &str) -> Option<&'static str> {
    ENDED.iter().find(|(ended, _)| *ended == name).map(|(_, hint)| *hint)
}

/// "did you mean `x`?" if a known name is similar to `typed`, else the list of all known names.
pub fn nearest_name(typed: &str, known: &[&str]) -> String {
    // Comparing takes time in proportion to the product of the lengths.
    const LONGEST: usize = 200;
    let is_short = |name: &str| name.len() <= LONGEST;
    let similarity = |name: &&&str| match is_short(typed) && is_short(name) {
        true => (strsim::jaro_winkler(typed, name) * 1e6) as u64,
        false => 0,
    };
    match known.iter().max_by_key(similarity) {
        Some(name) if similarity(&name) >= 800_000 => format!("did you mean `{name}`?"),
        _ => format!("known here: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_a_warning_or_a_note_too() {
        let mut warnings = Warnings::default();
        warnings.push("replaced");
        warnings.left_out("curves");
        warnings.note_left_out("map_Ka");
        warnings.left_out("curves");
        assert_eq!(warnings.all_left_out(), ["curves", "map_Ka"]);
        assert_eq!(
            (warnings.messages(), warnings.notes()),
            (&["replaced".into(), "curves".into()][..], &["map_Ka".into()][..])
        );
    }

    #[test]
    fn many_warnings_are_counted_by_their_kind() {
        let mut warnings = Warnings::default();
        for i in 0..100_000 {
            warnings.left_out_file(format!("{i}.png: no such file"));
            warnings.left_out_file("5.png: no such file".into());
        }
        warnings.push("another");
        // The first 100, and 99,900 more, each file once.
        let texts = warnings.messages();
        assert_eq!((texts.len(), texts[99].as_str()), (102, "99.png: no such file"));
        assert_eq!(texts[100..], ["99900 more files are missing or cannot be used", "another"]);
        assert_eq!(warnings.all_left_out(), &texts[..101]);
    }

    /// Warnings of a file do not displace those of the next one, nor those of the render.
    #[test]
    fn each_part_has_its_first_warnings() {
        let mut warnings = Warnings::default();
        (0..150).for_each(|i| warnings.push(format!("line {i}")));
        warnings.begin_part();
        warnings.push("nothing is in the picture");
        let texts = warnings.messages();
        assert_eq!(texts[100..], ["50 more warnings", "nothing is in the picture"]);
    }

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
