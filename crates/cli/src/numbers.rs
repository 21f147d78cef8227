//! Parsing of numeric options, with error messages that name the valid values.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Parser for an integer in a range.
pub(crate) fn whole<N>(
    range: RangeInclusive<N>,
) -> impl Fn(&str) -> Result<N, String> + Clone + Send + Sync + 'static
where
    N: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text| match text.trim().parse::<N>() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!("give a whole number from {} to {}", range.start(), range.end())),
    }
}

/// A count with its noun in singular or plural.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// A table with aligned columns: to the left or to the right.
pub(crate) fn aligned(lines: &[Vec<String>], is_left: impl Fn(usize) -> bool) -> String {
    let printable = |cell: &String| kiln::error::printable(cell).into_owned();
    let lines: Vec<Vec<String>> = lines.iter().map(|line| line.iter().map(printable).collect()).collect();
    let mut widths = Vec::new();
    for (column, cell) in lines.iter().flat_map(|line| line.iter().enumerate()) {
        widths.resize(widths.len().max(column + 1), 0);
        widths[column] = cell.chars().count().max(widths[column]);
    }
    let mut text = String::new();
    for line in &lines {
        let cells = line.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if is_left(column) { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_told_which_there_may_be() {
        let parse = whole(1..=16u16);
        assert_eq!(parse("16"), Ok(16));
        for bad in ["0", "17", "-1", "1.5", "", "99999999999999999999"] {
            assert_eq!(parse(bad), Err("give a whole number from 1 to 16".into()), "{bad}");
        }
    }

    #[test]
    fn one_is_no_plural() {
        assert_eq!(
            (counted(1, "round", "rounds"), counted(7, "round", "rounds")),
            ("1 round".into(), "7 rounds".into())
        );
    }
}
