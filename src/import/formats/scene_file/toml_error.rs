//! Errors of the TOML parser and of serde in one line: the key and the value as typed, what is expected, and how to write
//! it. Called by `file` for scene files and for cameras of the command line.

use toml::Spanned;
use toml::de::DeValue;

use crate::error::nearest_name;

/// An error in a text.
pub(super) struct TomlError {
    /// Byte offset in the text.
    pub offset: usize,
    /// What is wrong, in one line.
    pub what: String,
    /// How to write it.
    pub hint: String,
}

/// Translates an error of parsing `text`: names and types in the words of scene files; errors of syntax as they are.
pub(super) fn explain(mut e: toml::de::Error, text: &str) -> TomlError {
    let span = e.span().unwrap_or_default();
    let message = e.message().to_owned();
    // The path of keys, such as `sphere.radius`, is displayed only if the error has no input. It is not accessible
    // otherwise.
    e.set_input(None);
    let shown = e.to_string();
    let path = shown.trim_end().rsplit_once("\nin `").map_or("", |(_, path)| path.trim_end_matches('`'));
    let is_value = text.get(..span.start).is_some_and(|before| before.trim_end().ends_with('='));
    let typed = text.get(span.clone()).unwrap_or_default();
    let out_of_range = || {
        let what = || format!("`{}` is {}", path.rsplit('.').next().unwrap_or_default(), shortened(typed));
        message.starts_with("give ").then(|| (what(), message.clone()))
    };
    let (what, hint) = of_name(&message, typed)
        .or_else(|| of_type(&message, path, typed, is_value))
        .or_else(out_of_range)
        .unwrap_or_else(|| of_syntax(&message, path, typed));
    TomlError { offset: span.start, what, hint }
}

/// Checks that no list of numbers has more than are read: serde ignores the rest.
pub(super) fn check_lists(key: &str, value: &Spanned<DeValue>) -> Result<(), TomlError> {
    match value.get_ref() {
        DeValue::Table(table) => table.iter().try_for_each(|(key, value)| check_lists(key.get_ref(), value)),
        DeValue::Array(list) => {
            let is_number =
                |item: &Spanned<DeValue>| matches!(item.get_ref(), DeValue::Integer(_) | DeValue::Float(_));
            let most = match key {
                key if PAIRS.contains(&key) => 2,
                "K" | "pose" => 4,
                _ => 3,
            };
            if list.len() > most && list.iter().all(is_number) {
                let what = format!("`{key}` has {} numbers, expected {most}", list.len());
                let hint = format!("leave out all but {most}");
                return Err(TomlError { offset: value.span().start, what, hint });
            }
            list.iter().try_for_each(|item| check_lists(key, item))
        }
        _ => Ok(()),
    }
}

/// Keys of lists of two numbers.
const PAIRS: [&str; 4] = ["viewing_rectangle", "size", "image_size", "lens_shift"];

/// Keys and names that are unknown, missing or given twice.
fn of_name(message: &str, typed: &str) -> Option<(String, String)> {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let name = names.first().copied().unwrap_or(typed);
    let starts = |kind: &str| message.starts_with(kind);
    Some(if starts("unknown field") {
        let hint = match (name, &names[1..]) {
            // Of [ambient].
            ("colour", ["intensity"]) => {
                "ambient light is white; `colour` of [environment] is light from all around".into()
            }
            (_, known) => nearest_name(name, known),
        };
        let shown = if typed.replace("color", "colour") == name { typed } else { name };
        (format!("unknown key `{shown}`"), hint)
    } else if starts("unknown variant") {
        (format!("unknown value `{name}`"), nearest_name(name, &names[1..]))
    } else if starts("missing field") {
        (format!("missing key `{name}`"), format!("add an entry `{name} = ...`"))
    } else if starts("duplicate") {
        let hint = "keep one; sections of which there may be several are written [[NAME]]";
        (format!("`{name}` is given twice"), hint.into())
    } else {
        return None;
    })
}

/// Values of another type or length than expected.
fn of_type(message: &str, path: &str, typed: &str, is_value: bool) -> Option<(String, String)> {
    let kinds = ["invalid type", "invalid value", "invalid length"];
    let expected = match message.split_once(", expected ") {
        Some((_, expected)) if kinds.iter().any(|kind| message.starts_with(kind)) => expected,
        _ if message == "wanted string or table" => "an enum",
        _ => message.strip_prefix("expected ")?,
    };
    if path == "material" || expected == "struct MaterialSection" {
        let hint = "write [material.NAME], such as [material.clay]";
        return Some(("a material without a name".into(), hint.into()));
    }
    if typed.starts_with('[') && typed.trim_matches(['[', ']', ' ']) == path {
        return Some(if typed.starts_with("[[") {
            (format!("`{typed}` is a list, expected one table"), format!("write [{path}], once"))
        } else {
            (format!("`{typed}` is one table, expected a list"), format!("write [[{path}]] for each"))
        });
    }
    let (expected, hint) = expectation(expected);
    let (key, verb) = (path.rsplit('.').next().unwrap_or_default(), if is_value { "is" } else { "holds" });
    Some((format!("`{key}` {verb} {}, expected {expected}", shortened(typed)), hint.into()))
}

/// What serde expects, and how to write it.
fn expectation(expected: &str) -> (&str, &'static str) {
    match expected {
        "f64" => ("a number", "write it without quotes, such as 1.5"),
        "u8" | "u16" | "u32" | "u64" | "usize" => {
            ("a whole number that is 0 or more", "write it without quotes, such as 3")
        }
        "i32" | "i64" => ("a whole number", "write it without quotes, such as 3"),
        "a boolean" => ("true or false", "write true or false without quotes"),
        "a string" => ("a text", "write one text in quotes"),
        "an enum" => ("a name", "write the name in quotes; `kiln schema` lists the names"),
        "a sequence" => ("a list", "write it in brackets: [...]"),
        "a colour" => (
            "a colour",
            "write [r, g, b] in whole numbers from 0 to 255, \"#rrggbb\" or a CSS name, such as \"white\"",
        ),
        "an array of length 2" => ("2 numbers", "write them in brackets: [0, 0]"),
        "an array of length 3" => ("3 numbers", "write them in brackets: [0, 0, 0]"),
        "an array of length 4" => ("4 of them", "write them in brackets: [0, 0, 0, 1]"),
        _ if expected.starts_with("struct ") => {
            ("keys in braces", "write { KEY = VALUE }; `kiln schema` lists the keys")
        }
        _ => (expected, "`kiln schema` describes the values of each key"),
    }
}

/// Text that is not TOML, by the message of the parser; messages about the value of a key are passed on.
fn of_syntax(message: &str, path: &str, typed: &str) -> (String, String) {
    let line = message.lines().next().unwrap_or_default();
    if !path.is_empty() {
        return (line.to_owned(), String::new());
    }
    let typed = shortened(typed);
    let what = if typed.is_empty() { line.to_owned() } else { format!("`{typed}`: {line}") };
    let hint = "a scene file is TOML: [SECTION] and KEY = VALUE on lines of their own, texts in quotes, lists in brackets, \
                decimals with a point, comments after #";
    (what, hint.into())
}

/// A value as typed, in one line of limited length.
fn shortened(typed: &str) -> String {
    const MOST: usize = 40;
    let line = typed.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}
