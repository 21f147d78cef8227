//! Rows as CSV, one column for each number: those of JSON, with the names of what they are in joined by dots.

use serde_json::{Map, Value};

use super::data::Row;
use crate::error::{Error, Result};

/// The rows under a line of names; what is missing is empty.
///
/// # Errors
/// [`Error::Failed`] where it cannot be made.
pub fn to_csv(rows: &[Row]) -> Result<String> {
    let flat: Vec<Vec<(String, String)>> = rows.iter().map(flattened).collect();
    let mut names: Vec<&String> = Vec::new();
    // A row that lacks errors has one column where another has several: every column that any row fills.
    for (name, _) in flat.iter().flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let is_parent = |name: &str| names.iter().any(|other| other.len() > name.len() && other.starts_with(&format!("{name}.")));
    let names: Vec<&String> = names.iter().filter(|name| !is_parent(name)).copied().collect();
    let mut table = csv::Writer::from_writer(Vec::new());
    let failed = |e: csv::Error| Error::Failed { what: format!("the table cannot be made: {e}"), hint: String::new() };
    table.write_record(&names).map_err(failed)?;
    for row in &flat {
        let cell = |name: &&String| row.iter().find(|(own, _)| own == *name).map_or("", |(_, value)| value.as_str());
        table.write_record(names.iter().map(cell)).map_err(failed)?;
    }
    let bytes = table.into_inner().map_err(|e| failed(e.into_error().into()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn flattened(row: &Row) -> Vec<(String, String)> {
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

/// The rows of a table that [`to_csv`] made; or what is wrong with it.
///
/// # Errors
/// A line, and what was expected of it.
pub fn from_csv(text: &str) -> std::result::Result<Vec<Row>, String> {
    let mut table = csv::Reader::from_reader(text.as_bytes());
    let names = table.headers().map_err(|e| e.to_string())?.clone();
    let row = |(number, cells): (usize, csv::Result<csv::StringRecord>)| {
        let cells = cells.map_err(|e| e.to_string())?;
        let mut whole = Map::new();
        for (name, cell) in names.iter().zip(&cells).filter(|(_, cell)| !cell.is_empty()) {
            insert(&mut whole, name, cell);
        }
        // Text that may be empty, which CSV does not tell from missing.
        whole.entry("options").or_insert_with(|| Value::String(String::new()));
        serde_json::from_value(Value::Object(whole)).map_err(|e| format!("row {number}: {e}"))
    };
    table.records().enumerate().map(|(index, cells)| row((index + 1, cells))).collect()
}

/// Columns of text, whatever it looks like.
const TEXTS: [&str; 10] =
    ["knob", "setting", "options", "numerics", "layout", "preset", "colour", "filter", "fingerprint", "judge"];

fn insert(into: &mut Map<String, Value>, name: &str, cell: &str) {
    match name.split_once('.') {
        Some((first, rest)) => {
            let inner = into.entry(first).or_insert_with(|| Value::Object(Map::new()));
            if let Value::Object(inner) = inner {
                insert(inner, rest, cell);
            }
        }
        None => {
            let text = || Value::String(cell.to_owned());
            let value = if TEXTS.contains(&name) { text() } else { serde_json::from_str(cell).unwrap_or_else(|_| text()) };
            into.insert(name.to_owned(), value);
        }
    }
}
