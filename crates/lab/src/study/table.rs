//! Rows as CSV, with one column per JSON value; names of nested values are joined by dots.

use serde_json::Value;

use super::data::SettingRow;
use super::work::distinct;

/// Rows as CSV with a header line; missing values are empty cells.
pub fn to_csv(rows: &[SettingRow]) -> String {
    let flat: Vec<Vec<(String, String)>> = rows.iter().map(flattened).collect();
    // The columns of all rows; rows without errors have fewer.
    let names = distinct(flat.iter().flatten().map(|(name, _)| name));
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
    flatten("", &serde_json::json!(row), &mut cells);
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
