//! Translates errors of the TOML parser and of serde into the words of scene files: the key and the value as typed, what
//! is expected, and how to write it. Called by `file` for scene files and for cameras of the command line.

use toml::Spanned;
use toml::de::DeValue;

use super::file::{SceneFile, nearest_name};

/// An error in a text.
pub(super) struct TomlError {
    /// Byte offset in the text.
    pub offset: usize,
    /// What is wrong, in one line.
    pub what: String,
    /// How to write it.
    pub hint: String,
}

/// Translates an error of parsing `text`.
pub(super) fn explain(mut e: toml::de::Error, text: &str) -> TomlError {
    let span = e.span().unwrap_or_default();
    let message = e.message().to_owned();
    // The path of keys, such as `sphere.radius`, is displayed only if the error has no input. It is not accessible
    // otherwise.
    e.set_input(None);
    let shown = e.to_string();
    let path = shown.trim_end().rsplit_once("\nin `").map_or("", |(_, path)| path.trim_end_matches('`'));
    let at = At {
        before: text.get(..span.start).unwrap_or(text),
        typed: text.get(span.clone()).unwrap_or_default(),
        after: text.get(span.end..).unwrap_or_default(),
        path,
    };
    let out_of_range = || {
        let what = || format!("`{}` is {}", at.key(), shortened(at.typed));
        message.starts_with("give ").then(|| (what(), message.clone()))
    };
    let explained = of_name(&message, &at).or_else(|| of_type(&message, &at)).or_else(out_of_range);
    let (what, hint) = explained.unwrap_or_else(|| of_syntax(&message, &at));
    TomlError { offset: span.start, what, hint }
}

/// Checks that no list of numbers has more than are read: serde ignores the rest.
pub(super) fn check_lists(key: &str, value: &Spanned<DeValue>) -> Result<(), TomlError> {
    match value.get_ref() {
        DeValue::Table(table) => table.iter().try_for_each(|(key, value)| check_lists(key.get_ref(), value)),
        DeValue::Array(list) => {
            let is_number =
                |item: &Spanned<DeValue>| matches!(item.get_ref(), DeValue::Integer(_) | DeValue::Float(_));
            let most = if PAIRS.contains(&key) { 2 } else { 3 };
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

/// Keys of lists of two numbers; all others have three.
const PAIRS: [&str; 2] = ["viewing_rectangle", "size"];

/// The place of an error: the text in question, what surrounds it, and the path of its key, which is empty for errors
/// of syntax.
struct At<'a> {
    before: &'a str,
    typed: &'a str,
    after: &'a str,
    path: &'a str,
}

impl<'a> At<'a> {
    /// The key of the value.
    fn key(&self) -> &'a str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// Whether the text is the whole value of its key rather than an item of it.
    fn is_all(&self) -> bool {
        self.before.trim_end().ends_with('=')
    }

    /// Whether the text is the header of the section at the path, such as `[[sphere]]`.
    fn is_header(&self) -> bool {
        self.typed.starts_with('[') && self.typed.trim_matches(['[', ']', ' ']) == self.path
    }

    /// The text and what surrounds it up to blanks, brackets and punctuation.
    fn word(&self) -> String {
        let ends = |c: char| c.is_whitespace() || "[]{}=,#".contains(c);
        let start = self.before.trim_end_matches(|c| !ends(c)).len();
        let end = self.after.find(ends).unwrap_or(self.after.len());
        format!("{}{}{}", &self.before[start..], self.typed, &self.after[..end])
    }

    /// The line of the text, split at its first `=`.
    fn key_and_value(&self) -> (String, String) {
        let before = self.before.rsplit('\n').next().unwrap_or_default();
        let after = self.after.lines().next().unwrap_or_default();
        let line = format!("{before}{}{after}", self.typed);
        let (key, value) = line.split_once('=').unwrap_or((&line, ""));
        (key.trim().to_owned(), value.trim().to_owned())
    }
}

/// A value as typed, in one line of limited length.
fn shortened(typed: &str) -> String {
    const MOST: usize = 40;
    let words: Vec<&str> = typed.split_whitespace().collect();
    let line = words.join(" ");
    match line.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// Keys and names that are unknown, missing or given twice.
fn of_name(message: &str, at: &At) -> Option<(String, String)> {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let name = names.first().copied().unwrap_or_default();
    let starts = |kind: &str| message.starts_with(kind);
    Some(if starts("unknown field") {
        (format!("unknown key `{name}`"), nearest_name(name, &names[1..]))
    } else if starts("unknown variant") {
        (format!("unknown value `{name}`"), nearest_name(name, &names[1..]))
    } else if starts("missing field") {
        let section = if at.is_header() { at.typed } else { "it" };
        (format!("missing key `{name}`"), format!("give {section} a line or an entry `{name} = ...`"))
    } else if starts("duplicate field") {
        let hint = format!("keep one of `{name}` and its other names");
        (format!("`{name}` is given twice"), hint)
    } else if starts("duplicate key") && at.before.ends_with('[') {
        let hint = format!("keep one, or write [[{0}]] for each if there may be several", at.typed);
        (format!("`[{}]` is given twice", at.typed), hint)
    } else if starts("duplicate key") {
        (format!("`{}` is given twice", at.typed), "keep one of them".into())
    } else {
        return None;
    })
}

/// Values of another type or length than expected.
fn of_type(message: &str, at: &At) -> Option<(String, String)> {
    let is_type =
        ["invalid type", "invalid value", "invalid length"].iter().any(|kind| message.starts_with(kind));
    let expected = match message.split_once(", expected ") {
        Some((_, expected)) if is_type => expected,
        _ if message == "wanted string or table" => "an enum",
        _ => message.strip_prefix("expected ")?,
    };
    if at.path == "material" || expected == "struct MaterialSection" {
        let hint = "write [material.NAME], such as [material.clay]";
        return Some(("a material without a name".into(), hint.into()));
    }
    if at.is_header() {
        let (name, is_list) = (at.path, at.typed.starts_with("[["));
        let what = if is_list { "is a list, expected one table" } else { "is one table, expected a list" };
        let hint =
            if is_list { format!("write [{name}], once") } else { format!("write [[{name}]] for each") };
        return Some((format!("`{}` {what}", at.typed), hint));
    }
    let (expected, hint) = expectation(expected, at);
    let verb = if at.is_all() { "is" } else { "holds" };
    Some((format!("`{}` {verb} {}, expected {expected}", at.key(), shortened(at.typed)), hint))
}

/// What serde expects, and how to write it.
fn expectation(expected: &str, at: &At) -> (String, String) {
    let (key, typed) = (at.key(), at.typed);
    let unquoted = typed.trim_matches(['"', '\'']);
    let is_quoted = unquoted.len() < typed.len();
    let number = |noun: &str, example: &str| {
        let hint = match unquoted.parse::<f64>() {
            Ok(_) if is_quoted => format!("write the number without quotes: {unquoted}"),
            _ => format!("write {noun}, such as {example}"),
        };
        (noun.to_owned(), hint)
    };
    match expected {
        "f64" => number("a number", "1.5"),
        "u8" | "u16" | "u32" | "u64" | "usize" => number("a whole number that is 0 or more", "3"),
        "i32" | "i64" => number("a whole number", "3"),
        "a boolean" => ("true or false".into(), "write true or false without quotes".into()),
        "a string" if typed.starts_with(['[', '{']) => ("one text".into(), format!("write {key} = \"...\"")),
        "a string" => ("a text".into(), format!("write it in quotes: \"{typed}\"")),
        "an enum" => ("a name".into(), "write the name in quotes; `kiln schema` lists the names".into()),
        "a sequence" => ("a list".into(), format!("write {key} = [...]")),
        "a colour" => ("a colour".into(), colour_hint(typed)),
        _ => {
            if let Some(length) = expected.strip_prefix("an array of length ") {
                let zeros = vec!["0"; length.parse().unwrap_or(3)].join(", ");
                return (format!("{length} numbers"), format!("write them in brackets: [{zeros}]"));
            }
            if let Some(keys) = expected.strip_prefix("struct ").map(keys_of) {
                let key = if at.is_all() { format!("{key} = ") } else { String::new() };
                return (
                    "keys in braces".into(),
                    format!("write {key}{{ KEY = VALUE }}, of the keys {keys}"),
                );
            }
            (expected.to_owned(), format!("write {expected}"))
        }
    }
}

/// How to write a colour; fractions from 0 to 1 are converted.
fn colour_hint(typed: &str) -> String {
    let numbers = typed.trim_matches(['[', ']']).split(',').map(|number| number.trim().parse::<f64>());
    let example = match numbers.collect::<Result<Vec<_>, _>>().as_deref() {
        Ok([r, g, b]) if [r, g, b].iter().all(|part| (0.0..=1.0).contains(*part)) => {
            [r, g, b].map(|part| (part * 255.0).round() as u8)
        }
        _ => [255, 128, 0],
    };
    let [r, g, b] = example;
    format!(
        "write [r, g, b] in whole numbers from 0 to 255, or \"#rrggbb\": {example:?} or \"#{r:02x}{g:02x}{b:02x}\""
    )
}

/// The keys of a section by the name of its type, from the JSON schema.
fn keys_of(section: &str) -> String {
    let schema = SceneFile::schema();
    let keys = schema["$defs"][section]["properties"].as_object();
    keys.map(|keys| keys.keys().cloned().collect::<Vec<_>>().join(", ")).unwrap_or_default()
}

/// Text that is not TOML, by the messages of the crate `toml_parser`; other messages are passed on.
fn of_syntax(message: &str, at: &At) -> (String, String) {
    let (key, value) = at.key_and_value();
    let (word, line) = (at.word(), message.lines().next().unwrap_or_default());
    let (what, hint) = match line.split(", expected").next().unwrap_or_default() {
        "invalid float" | "invalid mantissa" | "invalid fraction" | "unexpected leading zero" => {
            return not_a_number(&word);
        }
        "string values must be quoted" => return unquoted(at.typed, &key, &value),
        "unexpected key or value" if at.after.starts_with(',') => (
            format!("`{key}` has more than one value: {}", shortened(&value)),
            "write decimals with a point, 0.5, and lists in brackets, [1, 2, 3]",
        ),
        "unexpected key or value" => (
            format!("the line goes on after the value of `{key}`"),
            "write one KEY = VALUE in each line, and comments after #",
        ),
        "key with no value" | "invalid key-value pair" => (
            format!("`{}` has no `=` and no value", shortened(&key)),
            "write KEY = VALUE, and comments after #; a scene file is TOML",
        ),
        "missing comma between array elements" => (
            "a list without its end, or without a comma".into(),
            "put commas between its items, and ] at its end",
        ),
        "unclosed array table" | "unclosed table" => {
            (format!("`{key}` is not closed"), "write [NAME], or [[NAME]] where there may be several")
        }
        "invalid basic string" | "invalid literal string" => {
            ("a text without its closing quote".into(), "put a quote at both ends")
        }
        "missing escaped value" => (
            format!("the text of `{key}` has a backslash"),
            "write / instead of \\, or put the text in single quotes: 'models\\cow.obj'",
        ),
        "invalid boolean" => {
            (format!("`{word}` is neither true nor false"), "write true or false, in small letters")
        }
        "floating-point number overflowed" => (format!("`{word}` is too large"), "give a number below 1e308"),
        syntax if at.path.is_empty() => {
            (syntax.to_owned(), "a scene file is TOML: sections in brackets, and lines KEY = VALUE")
        }
        _ => (line.to_owned(), ""),
    };
    (what, hint.into())
}

/// A value, empty if there is none, that is neither a number nor in quotes.
fn unquoted(typed: &str, key: &str, value: &str) -> (String, String) {
    match typed {
        "" if value.starts_with('#') => (
            format!("`{key}` has no value, because # begins a comment"),
            format!("write it in quotes: \"{value}\""),
        ),
        "" => (format!("`{key}` has no value"), format!("write {key} = VALUE")),
        _ if typed.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => not_a_number(typed),
        _ if typed.contains('\\') => (format!("`{typed}` is not in quotes"), format!("write '{typed}'")),
        _ => (format!("`{typed}` is not in quotes"), format!("write \"{typed}\"")),
    }
}

/// A word that begins like a number.
fn not_a_number(word: &str) -> (String, String) {
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    let parts: Vec<&str> = word.trim_start_matches(['+', '-']).split('.').collect();
    let (what, hint) = match parts.as_slice() {
        [_, _, _, ..] if parts.iter().all(|part| digits(part)) => {
            ("is a number with two points", "write one point; commas separate the numbers of a list")
        }
        ["", part] | [part, ""] if digits(part) => {
            ("lacks a digit", "write digits on both sides of the point, such as 0.5")
        }
        _ if parts[0].len() > 1 && parts[0].starts_with('0') && digits(parts[0]) => {
            ("begins with 0", "leave out the zeros in front")
        }
        _ => (
            "is not a number",
            "write digits alone, such as 3, 0.5 or 1e-3; commas separate the numbers of a list",
        ),
    };
    (format!("`{word}` {what}"), hint.to_owned())
}
