//! Parts of the HTML pages of `kiln bench` and `kiln study`.

use std::fmt::Write;

/// The style sheet of all pages.
pub(crate) const STYLE: &str = include_str!("page.css");

/// A page with the names in double braces replaced by the parts of these names.
pub(crate) fn filled(page: &str, parts: &[(&str, String)]) -> String {
    let mut pieces = page.split("{{");
    let mut html = pieces.next().unwrap_or_default().to_owned();
    for (name, text) in pieces.filter_map(|piece| piece.split_once("}}")) {
        html += parts.iter().find(|(own, _)| *own == name).map_or(name, |(_, part)| part);
        html += text;
    }
    html
}

/// Attributes and HTML of a cell.
pub(crate) type Cell = (&'static str, String);

/// A table of rows, each with the attributes of its element. `titles` are separated by `|`; those of columns aligned to
/// the left begin with `<`.
pub(crate) fn table(titles: &str, rows: impl IntoIterator<Item = (String, Vec<Cell>)>) -> String {
    let alignment = |title: &str| if title.starts_with('<') { " class=\"left\"" } else { "" };
    let mut html = "<div class=\"scroll\"><table><tr>".to_owned();
    for title in titles.split('|') {
        let _ = write!(html, "<th{}>{}</th>", alignment(title), title.trim_start_matches('<'));
    }
    html += "</tr>\n";
    for (attributes, cells) in rows {
        let _ = write!(html, "<tr{attributes}>");
        for ((attributes, cell), title) in cells.iter().zip(titles.split('|')) {
            let attributes = if attributes.is_empty() { alignment(title) } else { attributes };
            let _ = write!(html, "<td{attributes}>{cell}</td>");
        }
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

/// Text with HTML special characters escaped.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
