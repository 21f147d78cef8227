//! Options by name, for programs: the names, and the messages of the command with these names.

use clap::Args;

use super::arguments::Arguments;
use super::synonyms;
use crate::effects::EFFECTS;
use crate::error::{Error, nearest_name};

/// Option of the command that is no option here: AOVs of pictures in memory are arrays of their own.
const AOV: &str = "aov";

/// The options, without inputs.
pub(super) fn command() -> clap::Command {
    let command = clap::Command::new("kiln").disable_help_flag(true);
    Arguments::augment_args(command).mut_arg("inputs", |inputs| inputs.required(false))
}

/// The option whose name on the command line fits.
pub(super) fn argument(command: &clap::Command, fits: impl Fn(&str) -> bool) -> Option<&clap::Arg> {
    command.get_arguments().find(|argument| argument.get_long().is_some_and(&fits))
}

/// The name of an option here.
pub(super) fn name_of(long: &str) -> String {
    match long {
        // A keyword of Python.
        "with" => "with_".to_owned(),
        AOV => "aovs".to_owned(),
        _ => long.replace('-', "_"),
    }
}

/// The error of a name that no option has.
pub(super) fn unknown(command: &clap::Command, name: &str) -> Error {
    let hint = synonyms::hint(name).map(|hint| hint_by_name(&hint)).filter(|hint| !hint.is_empty());
    let longs = command.get_arguments().filter_map(clap::Arg::get_long).chain([AOV]);
    let names: Vec<String> = longs.map(name_of).collect();
    let nearest = || nearest_name(name, &names.iter().map(String::as_str).collect::<Vec<_>>());
    Error::usage(format!("unknown option `{name}`"), hint.unwrap_or_else(nearest))
}

/// A message of the command with options by name: `--tone-map agx` becomes `tone_map="agx"`. Options that are not known
/// here stay as they are.
pub fn by_name(message: &str) -> String {
    // Making the options takes longer than a small picture.
    if !message.contains("--") {
        return message.to_owned();
    }
    let command = command();
    let mut said = String::new();
    let mut rest = message;
    while let Some(start) = rest.find("--") {
        let (before, option) = rest.split_at(start);
        let long =
            option[2..].split(|c: char| !c.is_ascii_lowercase() && c != '-').next().unwrap_or_default();
        rest = &option[2 + long.len()..];
        said.push_str(before);
        let known = argument(&command, |known| known == long);
        // Names of files may contain `--`, too.
        let is_option = said.is_empty() || said.ends_with([' ', '`', '\'', '(']);
        if !is_option || known.is_none() && long != AOV {
            said.push_str(&option[..2 + long.len()]);
            continue;
        }
        said.push_str(&name_of(long));
        // The form of the value, as in `--samples <N>`.
        if let Some((form, after)) = rest.split_once('>')
            && [" <", " [<", "[=<"].iter().any(|start| form.starts_with(start))
        {
            rest = after.trim_start_matches(']');
        } else if let Some((value, after)) = known.and_then(|argument| value_of(argument, rest)) {
            said.push_str(&format!("={value}"));
            rest = after;
        }
    }
    said + rest
}

/// The value at the start of `text`, which follows an option in a message, as Python writes it, and the text after it.
fn value_of<'a>(argument: &clap::Arg, text: &'a str) -> Option<(String, &'a str)> {
    if !argument.get_action().takes_values() {
        // In quotes it is the name.
        return (!text.starts_with('\'')).then(|| ("True".to_owned(), text));
    }
    let value = text.strip_prefix([' ', '='])?;
    if let Some((quoted, after)) = value.strip_prefix('\'').and_then(|quoted| quoted.split_once('\'')) {
        return Some((format!("'{quoted}'"), after));
    }
    let value = value.split_whitespace().next()?.trim_end_matches([',', ';', ':', '.', ')', '`', '\'']);
    // Other words go on with the sentence.
    let is_known = |word: &str| {
        ["auto", "none", "transparent"].contains(&word)
            || EFFECTS.iter().any(|effect| effect.name() == word)
            || argument.get_possible_values().iter().any(|possible| possible.get_name() == word)
    };
    let is_literal = value.starts_with(|c: char| c.is_uppercase() || c.is_numeric() || "+-.#".contains(c));
    if !(text.starts_with('=') || is_literal || is_known(value)) {
        return None;
    }
    // Numbers, and words such as DEG that stand for a value.
    let is_bare = value.parse::<f64>().is_ok() || value.starts_with(char::is_uppercase);
    let written = if is_bare { value.to_owned() } else { format!("\"{value}\"") };
    Some((written, &text[1 + value.len()..]))
}

/// A hint [`by_name`], up to the part that is for the command and its shell.
fn hint_by_name(hint: &str) -> String {
    let hint = by_name(hint);
    let Some(unknown) =
        ["--", "`kiln ", "raise the limit of the shell"].iter().filter_map(|start| hint.find(start)).min()
    else {
        return hint;
    };
    let end = [", ", "; "].iter().filter_map(|separator| hint[..unknown].rfind(separator)).max();
    hint[..end.unwrap_or(0)].to_owned()
}

/// The message and the hint of an error in one line, with options [`by_name`].
pub fn error_by_name(error: &Error) -> String {
    let message = by_name(&error.to_string());
    match hint_by_name(error.hint()) {
        hint if hint.is_empty() => message,
        hint => format!("{message}; {hint}"),
    }
}

#[cfg(test)]
mod tests {
    use clap::ArgAction;

    use super::*;
    use crate::scene::ImportOptions;

    const TYPES: &str = "python/kiln/_options.py";

    /// The first lines of [`TYPES`].
    const HEAD: &str = r#""""The options of `kiln render` for type checkers, from the command. After a change of them,
`KILN_BLESS=1 cargo test --lib options_of_python` writes this file again."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Union

if TYPE_CHECKING:
    from typing import TypeAlias

    import numpy as np
    from numpy.typing import NDArray

    _Value: TypeAlias = Union[
        str, float, os.PathLike[str], Sequence[Any], Mapping[str, Any], np.generic, NDArray[Any], None
    ]
"#;

    /// The type of an option's value in Python; `None` is as if it were not given.
    fn python_type(argument: &clap::Arg) -> String {
        let values = argument.get_possible_values();
        let names: Vec<&str> = values.iter().map(clap::builder::PossibleValue::get_name).collect();
        match names[..] {
            _ if !argument.get_action().takes_values() => "bool | None".to_owned(),
            ["true", "false"] => "bool | None".to_owned(),
            _ if matches!(argument.get_action(), ArgAction::Append) => {
                "str | int | Sequence[str | int] | None".to_owned()
            }
            [] if argument.get_num_args().is_some_and(|count| count.min_values() == 0) => {
                "bool | _Value".to_owned()
            }
            [] => "_Value".to_owned(),
            _ => format!(
                "Literal[{}] | None",
                names.iter().map(|name| literal(name)).collect::<Vec<_>>().join(", ")
            ),
        }
    }

    /// A value as a literal: a number is one in Python, too.
    fn literal(name: &str) -> String {
        if name.parse::<u32>().is_ok() { name.to_owned() } else { format!("{name:?}") }
    }

    /// Type checkers refuse options that the command does not have.
    #[test]
    fn options_of_python_are_those_of_the_command() {
        let (command, import) = (command(), ImportOptions::augment_args(clap::Command::new("import")));
        let is_import = |long: &str| argument(&import, |own| own == long).is_some();
        // Functions have parameters for some.
        let of_pictures = |long: &str| !is_import(long) && !["camera", "size", "samples"].contains(&long);
        type Class<'a> = (&'a str, &'a str, &'a str, &'a dyn Fn(&str) -> bool);
        let classes: [Class; 4] = [
            ("ReadOptions", "TypedDict", "How files are read.", &is_import),
            (
                "ViewOptions",
                "ReadOptions",
                "Those of pictures but for camera, size and samples.",
                &of_pictures,
            ),
            ("SizedOptions", "ViewOptions", "Those of pictures but for the camera.", &|long| {
                ["size", "samples"].contains(&long)
            }),
            ("RenderOptions", "SizedOptions", "All.", &|long| long == "camera"),
        ];
        let mut text = HEAD.to_owned();
        for (name, base, what, is_its) in classes {
            text += &format!("\n\nclass {name}({base}, total=False):\n    \"\"\"{what}\"\"\"\n\n");
            for argument in command.get_arguments() {
                if let Some(long) = argument.get_long().filter(|long| is_its(long)) {
                    text += &format!("    {}: {}\n", name_of(long), python_type(argument));
                }
            }
        }
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(TYPES);
        if std::env::var_os("KILN_BLESS").is_some() {
            std::fs::write(&file, &text).expect("a file that can be written");
        }
        let stored = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(stored == text, "{TYPES} is not that of the command: KILN_BLESS=1 writes it");
    }

    #[test]
    fn messages_name_options_as_parse_does() {
        for (message, said) in [
            ("noise; try --samples 64", "noise; try samples=64"),
            ("`--camera auto` sees everything", "`camera=\"auto\"` sees everything"),
            ("leave --camera out, or use --view", "leave camera out, or use view"),
            (
                "give --colour linear, or --exposure 0 --tone-map none",
                "give colour=\"linear\", or exposure=0 tone_map=\"none\"",
            ),
            ("only --transport path draws", "only transport=\"path\" draws"),
            ("--draft uses a headlight", "draft=True uses a headlight"),
            ("--with shadows; --with turns it on", "with_=\"shadows\"; with_ turns it on"),
            ("for '--size <WxH>': give it", "for 'size': give it"),
            ("use --smooth, or --smooth DEG", "use smooth, or smooth=DEG"),
            (": --camera '{ fov = 40 }', or", ": camera='{ fov = 40 }', or"),
            ("add `--time SECONDS`", "add `time=SECONDS`"),
            ("--aov primitive writes", "aovs primitive writes"),
            ("--camera {...} is not valid", "camera {...} is not valid"),
            ("leave --ground (`ground` of [image]) out", "leave ground (`ground` of [image]) out"),
            ("cannot be used with '--draft'", "cannot be used with 'draft'"),
            ("a--samples.obj, --frames 1-3, é--", "a--samples.obj, --frames 1-3, é--"),
        ] {
            assert_eq!(by_name(message), said);
        }
    }

    #[test]
    fn hints_end_before_what_only_the_command_has() {
        for (hint, said) in [
            ("give a smaller --size, or give --memory-limit 3G", "give a smaller size"),
            (
                "give a smaller --size, or raise the limit of the shell: ulimit -v unlimited",
                "give a smaller size",
            ),
            ("--view iso; `kiln view` finds a camera", "view=\"iso\""),
            ("`kiln help` lists the commands, `kiln help COMMAND` its options", ""),
        ] {
            assert_eq!(hint_by_name(hint), said);
        }
    }
}
