//! Rows as CSV, with one column per JSON value; names of nested values are joined by dots.

use serde_json::{Map, Value};

use super::data::SettingRow;

/// Rows as CSV with a header line; missing values are empty cells.
pub fn to_csv(rows: &[SettingRow]) -> String {
    let flat: Vec<Vec<(String, String)>> = rows.iter().map(flattened).collect();
    let mut names: Vec<&String> = Vec::new();
    // The columns of all rows; rows without errors have fewer.
    for (name, _) in flat.iter().flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let is_parent = |name: &str| {
        names.iter().any(|other| other.len() > name.len() && other.starts_with(&format!("{name}.")))
    };
    let names: Vec<&String> = names.iter().filter(|name| !is_parent(name)).copied().collect();
    let mut text = line(names.iter().map(|name| name.as_str()));
    for row in &flat {
        let cell =
            |name: &&String| row.iter().find(|(own, _)| own == *name).map_or("", |(_, value)| value.as_str());
        text += &line(names.iter().map(cell));
    }
    text
}

fn flattened(row: &SettingRow) -> Vec<(String, String)> {
    let mut cells = Vec::new();
    if let Ok(value) = serde_json::to_value(row) {
        flatten("", &value, &mut cells);
    }
    cells
}

fn flatten(name: &str, value: &Value, cells: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(&name, value, cells);
            }
        }
        Value::Null => cells.push((name.to_owned(), String::new())),
        Value::String(text) => cells.push((name.to_owned(), text.clone())),
        other => cells.push((name.to_owned(), other.to_string())),
    }
}

/// A line by RFC 4180, section 2: cells with a comma, a quote or a line break are quoted, and quotes are doubled.
fn line<'a>(cells: impl Iterator<Item = &'a str>) -> String {
    let quoted = |cell: &str| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.to_owned(),
    };
    cells.map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

/// Parses the result of [`to_csv`].
///
/// # Errors
/// The number of the invalid row and the reason.
pub fn from_csv(text: &str) -> Result<Vec<SettingRow>, String> {
    let mut lines = records(text).into_iter();
    let names = lines.next().ok_or("there is no line of names")?;
    let row = |(number, cells): (usize, Vec<String>)| {
        if cells.len() != names.len() {
            return Err(format!("row {number}: {} cells under {} names", cells.len(), names.len()));
        }
        let mut whole = Map::new();
        for (name, cell) in names.iter().zip(&cells).filter(|(_, cell)| !cell.is_empty()) {
            insert(&mut whole, name, cell);
        }
        // Empty text is not distinguished from a missing value in CSV.
        whole.entry("options").or_insert_with(|| Value::String(String::new()));
        serde_json::from_value(Value::Object(whole)).map_err(|e| format!("row {number}: {e}"))
    };
    lines.enumerate().map(|(index, cells)| row((index + 1, cells))).collect()
}

/// Columns with text, which may look like a number.
const TEXT_COLUMNS: [&str; 10] = [
    "knob",
    "setting",
    "options",
    "numerics",
    "layout",
    "preset",
    "colour",
    "filter",
    "fingerprint",
    "judge",
];

/// A number, exact to the last bit unlike that of serde_json's parser, a Boolean or text.
fn value(cell: &str) -> Value {
    let whole = || cell.parse::<u64>().ok().map(Value::from);
    let number = || cell.parse::<f64>().ok().map(Value::from);
    let word = || cell.parse::<bool>().ok().map(Value::from);
    whole().or_else(number).or_else(word).unwrap_or_else(|| cell.into())
}

fn insert(into: &mut Map<String, Value>, name: &str, cell: &str) {
    match name.split_once('.') {
        Some((first, rest)) => {
            let inner = into.entry(first).or_insert_with(|| Value::Object(Map::new()));
            if let Value::Object(inner) = inner {
                insert(inner, rest, cell);
            }
        }
        None => {
            let value = if TEXT_COLUMNS.contains(&name) { cell.into() } else { value(cell) };
            into.insert(name.to_owned(), value);
        }
    }
}

fn records(text: &str) -> Vec<Vec<String>> {
    let (mut records, mut record, mut cell, mut is_quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if is_quoted && chars.peek() == Some(&'"') => {
                chars.next();
                cell.push('"');
            }
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => record.push(std::mem::take(&mut cell)),
            '\n' if !is_quoted => {
                record.push(std::mem::take(&mut cell));
                records.push(std::mem::take(&mut record));
            }
            '\r' if !is_quoted => {}
            c => cell.push(c),
        }
    }
    records
}
