//! Words, numbers and corners of faces in a part of an OBJ text. Bytes up to the space separate words, `#` begins a
//! comment, and `\` before the end of a line continues it; `\n`, `\r\n` and `\r` end a line.

use crate::import::text::lines::{parse_number, parse_with_comma};

/// Position in a text.
pub(super) struct Scanner<'a> {
    text: &'a [u8],
    at: usize,
    /// Line ends passed.
    pub lines: usize,
    /// The line of the first number that is followed by something else.
    pub odd_number: Option<usize>,
    /// The line of the first number with a decimal comma.
    pub comma: Option<usize>,
}

/// The next word is not what it should be.
#[derive(Debug, PartialEq)]
pub(super) struct Unreadable;

/// An index in a face that is not given.
pub(super) const NONE: i64 = i64::MIN;

impl<'a> Scanner<'a> {
    /// The start of `text`.
    pub(super) fn new(text: &'a [u8]) -> Self {
        Scanner { text, at: 0, lines: 0, odd_number: None, comma: None }
    }

    /// Whether all lines have been passed.
    pub(super) fn is_at_end(&self) -> bool {
        self.at >= self.text.len()
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            match byte {
                b'\n' | b'\r' => return,
                b'\\' if self.continues(self.at) => {
                    self.at += 1 + line_end(self.text, self.at + 1);
                    self.lines += 1;
                }
                _ if byte <= b' ' => self.at += 1,
                _ => return,
            }
        }
    }

    /// Whether the backslash at `at` ends its line.
    fn continues(&self, at: usize) -> bool {
        at + 1 >= self.text.len() || line_end(self.text, at + 1) > 0
    }

    /// The next word of the line.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let rest = &self.text[self.at..];
        let mut end = rest.iter().position(|&b| b <= b' ' || b == b'#').unwrap_or(rest.len());
        if end > 0 && rest[end - 1] == b'\\' && self.continues(self.at + end - 1) {
            end -= 1;
        }
        self.at += end;
        (end > 0).then_some(&rest[..end])
    }

    /// The rest of the line as a name, which may contain spaces, `#` and `\`.
    pub(super) fn name(&mut self) -> &'a [u8] {
        let rest = &self.text[self.at..];
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
        self.at += end;
        rest[..end].trim_ascii()
    }

    /// Passes the rest of the line.
    pub(super) fn end_line(&mut self) {
        while self.word().is_some() {}
        self.name();
        let end = line_end(self.text, self.at);
        self.at += end;
        self.lines += usize::from(end > 0);
    }

    /// The next number of the line. A sign ends it, as for C's `strtod`: `3.1+e2` is 3.1, and noted.
    pub(super) fn number(&mut self) -> Result<Option<f64>, Unreadable> {
        self.skip_blanks();
        let rest = &self.text[self.at..];
        if let Ok((number, length)) = fast_float2::parse_partial(rest)
            && rest.get(length).is_none_or(|&byte| byte <= b' ')
        {
            self.at += length;
            return Ok(Some(number));
        }
        if let Some(length) = not_a_number(rest) {
            self.at += length;
            return Ok(Some(f64::NAN));
        }
        let Some(word) = self.word() else { return Ok(None) };
        if let Some(number) = parse_with_comma(word, self.lines, &mut self.comma) {
            return Ok(Some(number));
        }
        let sign = word.iter().rposition(|byte| matches!(byte, b'+' | b'-')).unwrap_or(0);
        let number = parse_number(&word[..sign]).ok_or(Unreadable)?;
        self.odd_number.get_or_insert(self.lines);
        Ok(Some(number))
    }

    /// The next corner of a face, `v`, `v/vt`, `v//vn` or `v/vt/vn`: three indices, [`NONE`] where there is none.
    pub(super) fn corner(&mut self) -> Result<Option<[i64; 3]>, Unreadable> {
        self.skip_blanks();
        let start = self.at;
        let mut corner = [NONE; 3];
        for (part, index) in corner.iter_mut().enumerate() {
            *index = self.index();
            if self.text.get(self.at) != Some(&b'/') || part == 2 {
                break;
            }
            self.at += 1;
        }
        let is_whole = match self.text.get(self.at) {
            None => true,
            Some(b'\\') => self.continues(self.at),
            Some(&byte) => byte <= b' ' || byte == b'#',
        };
        if is_whole && corner[0] != NONE {
            return Ok(Some(corner));
        }
        self.at = start;
        self.word().map_or(Ok(None), |_| Err(Unreadable))
    }

    /// Reads an integer; [`NONE`], having passed nothing, if there is none that fits.
    #[inline]
    fn index(&mut self) -> i64 {
        let rest = &self.text[self.at..];
        let sign = rest.first().copied().unwrap_or(0);
        let start = usize::from(matches!(sign, b'-' | b'+'));
        let mut at = start;
        let mut value: i64 = 0;
        while let Some(digit) = rest.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            // 18 digits fit in any case.
            if at < 18 {
                value = value * 10 + i64::from(digit);
            } else {
                match value.checked_mul(10).and_then(|value| value.checked_add(i64::from(digit))) {
                    Some(more) => value = more,
                    None => return NONE,
                }
            }
            at += 1;
        }
        if at == start {
            return NONE;
        }
        self.at += at;
        if sign == b'-' { -value } else { value }
    }
}

/// Length of the word at the start of `rest` if it is a C library's text for a non-finite number: `1.#IND`, `-1.#INF`,
/// `nan(ind)`.
fn not_a_number(rest: &[u8]) -> Option<usize> {
    let length = rest.iter().position(|&byte| byte <= b' ').unwrap_or(rest.len());
    let word = rest[..length].strip_prefix(b"-").unwrap_or(&rest[..length]);
    let is_one =
        word.starts_with(b"1.#") || word.get(..4).is_some_and(|start| start.eq_ignore_ascii_case(b"nan("));
    is_one.then_some(length)
}

/// Length of the line end at `at`; 0 if there is none.
fn line_end(text: &[u8], at: usize) -> usize {
    match text.get(at) {
        Some(b'\n') => 1,
        Some(b'\r') => 1 + usize::from(text.get(at + 1) == Some(&b'\n')),
        _ => 0,
    }
}

/// The start of the first line that begins at or after `from`, is not a continuation, and is not the first of the text;
/// `None` if there is none, or if only what follows the text can tell.
pub(super) fn next_line(text: &[u8], from: usize) -> Option<usize> {
    (from.max(1)..text.len()).find(|&i| is_line_start(text, i))
}

/// The start of the last line of `text`, which may be its end; `None` if that is the start of the text.
pub(super) fn last_line(text: &[u8]) -> Option<usize> {
    (1..=text.len()).rev().find(|&i| is_line_start(text, i))
}

fn is_line_start(text: &[u8], i: usize) -> bool {
    let before = match text[i - 1] {
        b'\n' if text[..i - 1].ends_with(b"\r") => i - 2,
        b'\n' => i - 1,
        b'\r' if text.get(i).is_some_and(|next| *next != b'\n') => i - 1,
        _ => return false,
    };
    !text[..before].ends_with(b"\\")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<&[u8]> {
        let mut scanner = Scanner::new(line.as_bytes());
        std::iter::from_fn(|| scanner.word()).collect()
    }

    #[test]
    fn words_end_at_comments_and_go_on_behind_backslashes() {
        assert_eq!(words("f 1\t2  3# 4\n5"), [b"f", b"1", b"2", b"3"]);
        assert_eq!(words("f 1\\\n2 \\\r\n 3 \\\r4\\\n\n5"), [b"f", b"1", b"2", b"3", b"4"]);
        assert_eq!(words("a\\b c\\"), [&b"a\\b"[..], b"c"]);
        let mut scanner = Scanner::new(b"f 1 \\\n2 # note \\\nf 3\r\n\r# 4");
        let mut lines = Vec::new();
        while !scanner.is_at_end() {
            lines.push((scanner.lines, scanner.word()));
            scanner.end_line();
        }
        assert_eq!(lines, [(0, Some(&b"f"[..])), (2, Some(b"f")), (3, None), (4, None)]);
    }

    #[test]
    fn numbers_of_other_libraries() {
        let mut scanner = Scanner::new(b"1.#IND -1.#QNAN 1.#INF -nan(ind) nan 0,5 -1,25e1");
        let mut next = || scanner.number();
        for _ in 0..5 {
            assert!(next().is_ok_and(|number| number.is_some_and(f64::is_nan)));
        }
        assert_eq!([next(), next()], [Ok(Some(0.5)), Ok(Some(-12.5))]);
        for bad in ["1,2,3", ",", "a,1"] {
            assert_eq!(Scanner::new(bad.as_bytes()).number(), Err(Unreadable), "{bad}");
        }
        // A comment after a number.
        assert_eq!(Scanner::new(b"2.#comment").number(), Ok(Some(2.0)));
    }

    #[test]
    fn corners_have_up_to_three_indices() {
        let corner = |text: &str| Scanner::new(text.as_bytes()).corner();
        assert_eq!(corner(" 1 2"), Ok(Some([1, NONE, NONE])));
        assert_eq!(corner("-1/+2#"), Ok(Some([-1, 2, NONE])));
        assert_eq!(corner("1//3\\\n4"), Ok(Some([1, NONE, 3])));
        assert_eq!(corner("1/2/3\n"), Ok(Some([1, 2, 3])));
        assert_eq!(corner("1/\n"), Ok(Some([1, NONE, NONE])));
        assert_eq!(corner("9223372036854775807"), Ok(Some([i64::MAX, NONE, NONE])));
        assert_eq!(corner(" # 1"), Ok(None));
        for bad in ["x", "1/2/3/4", "1/x", "/1", "1.0", "-", "1/-", "9223372036854775808", "1\\2", "1/2/3/"] {
            assert_eq!(corner(bad), Err(Unreadable), "{bad}");
        }
    }
}
