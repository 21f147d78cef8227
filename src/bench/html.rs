//! Parts of the HTML pages of `kiln bench` and `kiln study`.

use std::fmt::Write;

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
