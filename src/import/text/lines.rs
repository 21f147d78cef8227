//! Lines, words and numbers of text files with line numbers for error messages. The text need not be UTF-8.

use std::borrow::Cow;
use std::path::Path;

use crate::error::Warnings;

/// Iterator over lines and their numbers, counted from 1, without terminators (`\n`, `\r\n` or `\r`).
#[derive(Clone)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    /// The lines of `text`, which follows `before` other lines.
    pub(crate) fn new(text: &'a [u8], before: usize) -> Self {
        Lines { rest: text, number: before }
    }

    /// The remaining lines.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest.strip_prefix(b"\r\n").or_else(|| rest.get(1..)).unwrap_or_default();
        self.number += 1;
        Some((self.number, line))
    }
}

/// A text without a byte order mark, in UTF-8 if it is in UTF-16. Without a mark, UTF-16 begins with two characters of
/// ASCII.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, [u8]> {
    let is_ascii = |byte: u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    let (unit, text): (fn([u8; 2]) -> u16, _) = match bytes {
        [0xFF, 0xFE, 0, 0, ..] => return Cow::Borrowed(bytes),
        [0xFF, 0xFE, text @ ..] => (u16::from_le_bytes, text),
        [0xFE, 0xFF, text @ ..] => (u16::from_be_bytes, text),
        &[a, 0, b, 0, ..] if is_ascii(a) && is_ascii(b) => (u16::from_le_bytes, bytes),
        &[0, a, 0, b, ..] if is_ascii(a) && is_ascii(b) => (u16::from_be_bytes, bytes),
        _ => return Cow::Borrowed(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)),
    };
    let units = text.as_chunks().0.iter().map(|bytes| unit(*bytes));
    let chars = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    Cow::Owned(chars.collect::<String>().into_bytes())
}

/// Text from its first word, without leading comments (`#` to the end of the line).
pub(crate) fn without_comments(mut text: &[u8]) -> &[u8] {
    loop {
        text = text.trim_ascii_start();
        if text.first() != Some(&b'#') {
            return text;
        }
        let end = text.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(text.len());
        text = &text[end..];
    }
}

/// Removes and returns the first word of a line.
pub(crate) fn take_word<'a>(line: &mut &'a [u8]) -> Option<&'a [u8]> {
    let text = line.trim_ascii_start();
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    let (word, rest) = text.split_at(end);
    *line = rest;
    (!word.is_empty()).then_some(word)
}

/// Parses a number, which may be infinite or NaN.
pub(crate) fn parse_number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Parses a number as [`parse_number`] does, or one with a decimal comma. `comma` keeps the first `line` that has one.
pub(crate) fn parse_with_comma(word: &[u8], line: usize, comma: &mut Option<usize>) -> Option<f64> {
    parse_number(word).or_else(|| {
        let at = word.iter().position(|&byte| byte == b',')?;
        let number = parse_number(&[&word[..at], b".", &word[at + 1..]].concat())?;
        comma.get_or_insert(line);
        Some(number)
    })
}

/// Warns of the first line with a decimal comma.
pub(crate) fn warn_of_comma(comma: Option<usize>, file: &Path, warnings: &mut Warnings) {
    if let Some(line) = comma {
        warnings.push(format!("{}:{line}: a decimal comma is read as a point", file.display()));
    }
}

/// A word for display in messages: its first 32 characters, without control characters.
pub(crate) fn shown(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(word);
    text.chars().take(32).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_line_end_counts_once() {
        let lines: Vec<_> = Lines::new(b"a\r\n\nb\rc \n", 2).collect();
        assert_eq!(lines, [(3, &b"a"[..]), (4, b""), (5, b"b"), (6, b"c ")]);
        let mut line = &b"  1.5\t-nan x\xff "[..];
        assert_eq!(take_word(&mut line).and_then(parse_number), Some(1.5));
        assert!(take_word(&mut line).and_then(parse_number).is_some_and(f64::is_nan));
        let word = take_word(&mut line).expect("a third word");
        assert_eq!((parse_number(word), shown(word).as_str()), (None, "x\u{fffd}"));
        assert_eq!(take_word(&mut line), None);
    }
}
