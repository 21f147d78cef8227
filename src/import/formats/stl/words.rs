//! Tokenizer of ASCII STL files.

use crate::import::text::lines::{take_word, without_comments};

/// Maximum number of words of a name that is followed by `facet` on the same line.
const MAX_WORDS: usize = 64;

/// Words of a text across line ends.
pub(super) struct Words<'a> {
    rest: &'a [u8],
    /// Line of the last word, counted from 1.
    pub line: usize,
}

/// Removes and returns the first word of the current line; `None` at its end.
fn take_word_of_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
    let start = rest.iter().position(|b| is_end(b) || !b.is_ascii_whitespace()).unwrap_or(rest.len());
    *rest = &rest[start..];
    if rest.first().is_some_and(is_end) { None } else { take_word(rest) }
}

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Words { rest: text, line: 1 }
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.rest.trim_ascii_start().is_empty()
    }

    /// Moves `rest` to a later part of the text, counting lines. They end with `\n`, `\r\n` or `\r`.
    fn move_to(&mut self, rest: &'a [u8]) {
        let passed = &self.rest[..self.rest.len() - rest.len()];
        let ends = passed.iter().enumerate().filter(|&(i, &b)| match b {
            b'\r' => self.rest.get(i + 1) != Some(&b'\n'),
            _ => b == b'\n',
        });
        self.line += ends.count();
        self.rest = rest;
    }

    pub(super) fn next(&mut self) -> Option<&'a [u8]> {
        let text = without_comments(self.rest);
        if text.is_empty() {
            // Keeps the line of the last word.
            self.rest = text;
            return None;
        }
        self.move_to(text);
        let mut rest = self.rest;
        let word = take_word(&mut rest);
        self.move_to(rest);
        word
    }

    /// Next word; `end loop`, `end facet` and `end solid` count as one word.
    pub(super) fn next_statement(&mut self) -> Option<&'a [u8]> {
        let word = self.next()?;
        if !word.eq_ignore_ascii_case(b"end") {
            return Some(word);
        }
        let mut rest = self.rest;
        let joined: &[u8] = match take_word(&mut rest)?.to_ascii_lowercase().as_slice() {
            b"loop" => b"endloop",
            b"facet" => b"endfacet",
            b"solid" => b"endsolid",
            _ => return Some(word),
        };
        self.next();
        Some(joined)
    }

    /// Skips to the end of the line or the next statement.
    pub(super) fn skip_rest_of_line(&mut self) {
        self.name(&[b"endfacet", b"facet", b"endsolid", b"solid", b"end"]);
    }

    /// Skips a word if it is the next one.
    pub(super) fn skip(&mut self, expected: &[u8]) {
        let mut rest = self.rest;
        if take_word(&mut rest).is_some_and(|word| word.eq_ignore_ascii_case(expected)) {
            self.next();
        }
    }

    /// Skips `normal` and its numbers, which some exporters omit or write as invalid numbers.
    pub(super) fn skip_normal(&mut self) {
        const NEXT: [&[u8]; 6] = [b"outer", b"loop", b"vertex", b"endfacet", b"end", b"endsolid"];
        self.skip(b"normal");
        for _ in 0..3 {
            let mut rest = self.rest;
            let Some(word) = take_word(&mut rest) else { return };
            if NEXT.iter().any(|next| word.eq_ignore_ascii_case(next)) {
                return;
            }
            self.next();
        }
    }

    /// Name after `solid` or `endsolid`: up to the first keyword of `next` or the end of the line. Names may contain
    /// keywords, so `facet` counts only before `normal`, and `solid` only before a `facet`.
    pub(super) fn name(&mut self, next: &[&[u8]]) -> &'a [u8] {
        let text = self.rest;
        let mut rest = text;
        let length = loop {
            let Some(word) = take_word_of_line(&mut rest) else { break text.len() - rest.len() };
            let is_next = next.iter().any(|next| word.eq_ignore_ascii_case(next));
            let mut after = rest;
            let mut is_after = |wanted: &[u8]| {
                take_word_of_line(&mut after).is_some_and(|word| word.eq_ignore_ascii_case(wanted))
            };
            let is_statement = match word.to_ascii_lowercase().as_slice() {
                _ if !is_next => false,
                b"facet" => is_after(b"normal"),
                b"solid" => (0..MAX_WORDS).any(|_| is_after(b"facet")),
                _ => true,
            };
            if is_statement {
                break text.len() - rest.len() - word.len();
            }
        };
        self.move_to(&text[length..]);
        text[..length].trim_ascii()
    }
}
