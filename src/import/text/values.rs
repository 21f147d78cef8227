//! Values of PLY and OFF files: numbers of text, by lines or by words, or of binary data.

use crate::error::{Error, Place, Result};
use crate::import::Source;
use crate::import::text::lines::{Lines, parse_with_comma, take_word};
use crate::limits;

/// Encoding of values.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The type of a value.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Scalar {
    pub kind: Kind,
    /// Size in bytes in binary data.
    pub size: usize,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    Signed,
    Unsigned,
    Float,
}

impl Scalar {
    pub(crate) const I32: Scalar = Scalar { kind: Kind::Signed, size: 4 };
    pub(crate) const F32: Scalar = Scalar { kind: Kind::Float, size: 4 };

    /// The number in the lowest [`Scalar::size`] bytes of `bits`.
    fn of_bits(self, bits: u64) -> f64 {
        let unused = 64 - 8 * self.size;
        match self.kind {
            Kind::Signed => ((bits << unused) as i64 >> unused) as f64,
            Kind::Unsigned => bits as f64,
            Kind::Float if self.size == 4 => f64::from(f32::from_bits(bits as u32)),
            Kind::Float => f64::from_bits(bits),
        }
    }
}

/// Why a value cannot be read.
pub(crate) enum ReadError {
    /// The end of the file, which may cut the last number of a text.
    End,
    Fault(Error),
}

impl From<Error> for ReadError {
    fn from(error: Error) -> Self {
        ReadError::Fault(error)
    }
}

pub(crate) type Read<T> = std::result::Result<T, ReadError>;

/// Reader of the values of a file.
#[derive(Clone)]
pub(crate) struct Values<'a> {
    pub source: &'a Source,
    pub encoding: Encoding,
    /// Text: whether the values of an element may lie on several lines, or those of several on one.
    pub is_by_words: bool,
    /// Text: the part of a line that has values.
    without_comment: fn(&[u8]) -> &[u8],
    /// Text: the remaining lines, and the number of the current line.
    lines: Lines<'a>,
    line: usize,
    /// The remaining words of the current line, or the remaining bytes.
    pub rest: &'a [u8],
    /// Text: the first line with a decimal comma.
    pub comma: Option<usize>,
}

impl<'a> Values<'a> {
    /// The values of the text `text` of a file, which follows `before` lines.
    pub(crate) fn of_text(
        source: &'a Source,
        text: &'a [u8],
        before: usize,
        is_by_words: bool,
        without_comment: fn(&[u8]) -> &[u8],
    ) -> Self {
        let lines = Lines::new(text, before);
        Values {
            source,
            encoding: Encoding::Ascii,
            is_by_words,
            without_comment,
            lines,
            line: before,
            rest: &[],
            comma: None,
        }
    }

    /// Goes on with binary values after the current line.
    pub(crate) fn into_binary(self, encoding: Encoding) -> Self {
        Values { encoding, rest: self.lines.rest(), lines: Lines::new(&[], 0), ..self }
    }

    /// Whether each element is a line.
    pub(crate) fn is_by_lines(&self) -> bool {
        self.encoding == Encoding::Ascii && !self.is_by_words
    }

    /// An error at the current line or byte.
    pub(crate) fn fault(&self, what: impl Into<String>) -> Error {
        let file = &self.source.file;
        let (place, hint) = match self.encoding {
            Encoding::Ascii => (Place::line(file, self.line), "correct the line, or export the file again"),
            _ => {
                let byte = self.source.bytes.len() - self.rest.len();
                (Place::item(file, format!("byte {byte}")), "export the file again")
            }
        };
        Error::input(place, what, hint)
    }

    /// Number of elements to reserve: `count`, or what the rest of the file can hold at `least` bytes per element if that is
    /// less. Checks the memory limit for `bytes` per element; `line` declares them.
    pub(crate) fn capacity(&self, count: u64, least: u64, bytes: usize, line: usize) -> Result<usize> {
        // The last line may lack a terminator.
        let left =
            (self.lines.rest().len() + self.rest.len()) as u64 + u64::from(self.encoding == Encoding::Ascii);
        let count = count.min(left / least.max(1));
        limits::check(limits::product(&[count, bytes as u64])).map_err(|excess| {
            excess.at(Place::line(&self.source.file, line), format!("{count} elements: reading them"))
        })?;
        Ok(count as usize)
    }

    /// Line number of the current line.
    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// Whether no line follows, so that the current one may be cut.
    pub(crate) fn is_last_line(&self) -> bool {
        self.lines.rest().trim_ascii().is_empty()
    }

    /// Bytes after those that were read; without lines that have no values before them.
    pub(crate) fn bytes_left(&self) -> usize {
        if self.encoding != Encoding::Ascii {
            return self.rest.len();
        }
        let mut lines = self.lines.clone();
        let mut rest = lines.rest();
        while lines.next().is_some_and(|(_, line)| (self.without_comment)(line).is_empty()) {
            rest = lines.rest();
        }
        rest.trim_ascii().len()
    }

    /// Moves to the next line that has values.
    pub(crate) fn next_line(&mut self) -> Read<()> {
        loop {
            let (number, line) = self.lines.next().ok_or(ReadError::End)?;
            (self.line, self.rest) = (number, (self.without_comment)(line));
            if !self.rest.is_empty() {
                return Ok(());
            }
        }
    }

    /// The next value; of text, the next number of the current line.
    pub(crate) fn next(&mut self, scalar: Scalar) -> Read<f64> {
        if self.encoding == Encoding::Ascii {
            if self.is_by_words && self.rest.trim_ascii().is_empty() {
                self.next_line()?;
            }
            let is_last = self.lines.rest().is_empty();
            let Some(word) = take_word(&mut self.rest) else {
                let few = || self.fault("fewer values than the header says").into();
                return Err(if is_last { ReadError::End } else { few() });
            };
            let is_cut = is_last && self.rest.is_empty() && !self.source.bytes.ends_with(b"\n");
            return parse_with_comma(word, self.line, &mut self.comma)
                .ok_or_else(|| if is_cut { ReadError::End } else { self.fault("not a number").into() });
        }
        let (bytes, rest) = self.rest.split_at_checked(scalar.size).ok_or(ReadError::End)?;
        self.rest = rest;
        let join = |bits: u64, &byte: &u8| bits << 8 | u64::from(byte);
        Ok(scalar.of_bits(match self.encoding {
            Encoding::BigEndian => bytes.iter().fold(0, join),
            _ => bytes.iter().rev().fold(0, join),
        }))
    }

    /// Appends `count` values.
    pub(crate) fn take(&mut self, count: u64, scalar: Scalar, values: &mut Vec<f64>) -> Read<()> {
        (0..count).try_for_each(|_| self.next(scalar).map(|value| values.push(value)))
    }

    /// Appends the numbers left on the current line.
    pub(crate) fn rest_of_line(&mut self, values: &mut Vec<f64>) -> Read<()> {
        while !self.rest.trim_ascii().is_empty() {
            values.push(self.next(Scalar::F32)?);
        }
        Ok(())
    }

    /// Calls `read` for `count` elements. Returns how many there are before the end of the file.
    pub(crate) fn each(&mut self, count: u64, mut read: impl FnMut(&mut Self) -> Read<()>) -> Result<u64> {
        for index in 0..count {
            match read(self) {
                Ok(()) => {}
                Err(ReadError::Fault(error)) => return Err(error),
                Err(ReadError::End) => return Ok(index),
            }
        }
        Ok(count)
    }

    /// The index of one of `count` vertices; `among` follows their number in the message.
    pub(crate) fn index(&self, index: f64, count: usize, among: &str) -> Read<u32> {
        if index >= 0.0 && index < count as f64 && index.fract() == 0.0 && index <= f64::from(u32::MAX) {
            return Ok(index as u32);
        }
        let index = brief(index);
        let what = format!("vertex {index} does not exist; there are {count}{among}, counted from 0");
        Err(self.fault(what).into())
    }
}

/// A number for display, with an exponent if it is long.
pub(crate) fn brief(number: f64) -> String {
    if number.abs() < 1e16 { number.to_string() } else { format!("{number:e}") }
}
