//! Names of options in Python, and messages of the library with these names.

use super::synonyms;
use kiln::error::{Error, Result, nearest_name};
use kiln::job::PictureOptions;

/// Option of the command that is no option here: AOVs of pictures in memory are arrays of their own.
const AOV: &str = "aov";

/// The name of an option here.
fn name_of(option: &str) -> String {
    match option {
        // A keyword of Python.
        "with" => "with_".to_owned(),
        AOV => "aovs".to_owned(),
        _ => option.replace('-', "_"),
    }
}

/// The option with a name.
///
/// # Errors
/// [`Error::Usage`] if no option has it.
pub(super) fn option_named(name: &str) -> Result<String> {
    let options = PictureOptions::names();
    options.iter().find(|option| name_of(option) == name).cloned().ok_or_else(|| {
        let hint = synonyms::hint(name).map(|hint| hint_by_name(&hint)).filter(|hint| !hint.is_empty());
        let names: Vec<String> = options.iter().map(String::as_str).chain([AOV]).map(name_of).collect();
        let nearest = || nearest_name(name, &names.iter().map(String::as_str).collect::<Vec<_>>());
        Error::usage(format!("unknown option `{name}`"), hint.unwrap_or_else(nearest))
    })
}

/// A message of the library with options by name: `--tone-map` becomes `tone_map`. Options that are not known here stay
/// as they are.
pub fn by_name(message: &str) -> String {
    let options = PictureOptions::names();
    let mut parts = message.split("--");
    let mut named = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        let (option, rest) = part.split_at(end);
        // Names of files may contain `--`, too.
        let is_option = named.is_empty() || named.ends_with([' ', '`', '\'', '(']);
        match is_option && (option == AOV || options.iter().any(|name| name == option)) {
            true => named += &(name_of(option) + rest),
            false => named += &format!("--{part}"),
        }
    }
    named
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
    use clap::{ArgAction, Args};

    use super::*;
    use kiln::scene::ImportOptions;

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
        let command = crate::options::Table::<PictureOptions>::augment_args(clap::Command::new("kiln"));
        assert!(command.get_arguments().filter_map(clap::Arg::get_long).eq(PictureOptions::names()));
        let is_import = |long: &str| ImportOptions::kind(long).is_some();
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
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(TYPES);
        if std::env::var_os("KILN_BLESS").is_some() {
            std::fs::write(&file, &text).expect("a file that can be written");
        }
        let stored = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(stored == text, "{TYPES} is not that of the command: KILN_BLESS=1 writes it");
    }

    #[test]
    fn messages_name_options_as_parse_does() {
        for (message, said) in [
            ("noise; try --samples 64", "noise; try samples 64"),
            ("`--camera auto` sees everything", "`camera auto` sees everything"),
            ("leave --camera out, or use --view", "leave camera out, or use view"),
            (
                "give --colour linear, or --exposure 0 --tone-map none",
                "give colour linear, or exposure 0 tone_map none",
            ),
            ("only --transport path draws", "only transport path draws"),
            ("--draft uses a headlight", "draft uses a headlight"),
            ("--with shadows; --with turns it on", "with_ shadows; with_ turns it on"),
            ("use --smooth, or --smooth DEG", "use smooth, or smooth DEG"),
            (": --camera '{ fov = 40 }', or", ": camera '{ fov = 40 }', or"),
            ("add `--time SECONDS`", "add `time SECONDS`"),
            ("--aov primitive writes", "aovs primitive writes"),
            ("--camera {...} is not valid", "camera {...} is not valid"),
            ("leave --ground (`ground` of [image]) out", "leave ground (`ground` of [image]) out"),
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
            ("--view iso; `kiln view` finds a camera", "view iso"),
            ("`kiln help` lists the commands, `kiln help COMMAND` its options", ""),
        ] {
            assert_eq!(hint_by_name(hint), said);
        }
    }
}
