//! Reader of PLY data after the header.

use super::super::Source;
use super::super::lines::{Lines, parse_number, take_word};
use super::header::{Element, Encoding, Header, Property, Scalar};
use crate::error::{Error, Place, Result};
use crate::limits;

/// Why a value cannot be read.
pub(super) enum ReadError {
    End,
    Fault(Error),
}

impl From<Error> for ReadError {
    fn from(error: Error) -> Self {
        ReadError::Fault(error)
    }
}

pub(super) type Read<T> = std::result::Result<T, ReadError>;

/// Reader of the values after the header.
#[derive(Clone)]
pub(super) struct Body<'a> {
    pub source: &'a Source,
    encoding: Encoding,
    /// Binary data: offset of the next byte.
    at: usize,
    /// ASCII data: the remaining lines, the number of the current line, and its remaining words.
    lines: Lines<'a>,
    line: usize,
    words: &'a [u8],
    /// ASCII data: whether the values of an element may lie on several lines, or those of several on one.
    is_by_words: bool,
    /// Number of lines with more values than declared.
    pub surplus_lines: usize,
    /// Set if the file ends early: element name, number of elements read, declared number.
    pub truncation: Option<(&'static str, u64, u64)>,
}

impl<'a> Body<'a> {
    pub(super) fn new(source: &'a Source, header: &Header, is_by_words: bool) -> Self {
        Body {
            source,
            encoding: header.encoding,
            at: header.bytes,
            lines: Lines::new(&source.bytes[header.bytes..], header.lines),
            line: header.lines,
            words: &[],
            is_by_words,
            surplus_lines: 0,
            truncation: None,
        }
    }

    /// An error at the current line or byte.
    pub(super) fn fault(&self, what: impl Into<String>) -> ReadError {
        let place = match self.encoding {
            Encoding::Ascii => Place::line(&self.source.file, self.line),
            _ => Place::item(&self.source.file, format!("byte {}", self.at)),
        };
        ReadError::Fault(Error::input(place, what, "export the file again"))
    }

    /// An error in the declaration of an element.
    pub(super) fn fault_of(&self, element: &Element, what: impl Into<String>) -> Error {
        Error::input(Place::line(&self.source.file, element.line), what, "export the file again")
    }

    /// Number of elements to reserve: the declared number, or what the rest of the file can hold if that is less.
    /// Checks the memory limit for `bytes` per element.
    pub(super) fn count(&self, element: &Element, bytes: usize) -> Result<usize> {
        let left = match self.encoding {
            // The last line may lack a terminator.
            Encoding::Ascii => self.lines.rest().len() as u64 + 1,
            _ => self.bytes_left() as u64,
        };
        let least = element.least_bytes(self.encoding).max(1);
        let count = element.count.min(left / least);
        limits::check(limits::product(&[count, bytes as u64])).map_err(|excess| {
            let what = format!("{count} elements: reading them {excess}");
            Error::input(Place::line(&self.source.file, element.line), what, excess.hint())
        })?;
        Ok(count as usize)
    }

    /// Bytes after those that were read; without lines that are empty or comments before them.
    pub(super) fn bytes_left(&self) -> usize {
        if self.encoding != Encoding::Ascii {
            return self.source.bytes.len() - self.at;
        }
        let mut lines = self.lines.clone();
        let mut rest = lines.rest();
        while lines.next().is_some_and(|(_, line)| !has_values(line)) {
            rest = lines.rest();
        }
        rest.trim_ascii().len()
    }

    /// Calls `read` once per element, unless elements have no properties and hence no data. An early end of file sets
    /// [`Body::truncation`] and is no error.
    pub(super) fn each(
        &mut self,
        element: &Element,
        mut read: impl FnMut(&mut Self) -> Read<()>,
    ) -> Result<()> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for index in 0..element.count {
            match self.begin().and_then(|()| read(self)) {
                Ok(()) => {}
                Err(ReadError::Fault(error)) => return Err(error),
                Err(ReadError::End) => {
                    self.truncation = Some((known_name(element), index, element.count));
                    self.words = &[];
                    return Ok(());
                }
            }
        }
        if !self.is_by_words {
            self.end();
        }
        Ok(())
    }

    /// Whether all values that the header declares are there, and no others.
    pub(super) fn is_whole(&self) -> bool {
        self.truncation.is_none()
            && self.surplus_lines == 0
            && self.words.trim_ascii().is_empty()
            && self.bytes_left() == 0
    }

    /// The same data from the place of `earlier` on.
    pub(super) fn from(&self, earlier: &Self) -> Self {
        Body { surplus_lines: self.surplus_lines, ..earlier.clone() }
    }

    /// Ends an element; in ASCII data, counts the line if it has values left.
    fn end(&mut self) {
        self.surplus_lines += usize::from(take_word(&mut self.words).is_some());
        self.words = &[];
    }

    /// Starts the next element; in ASCII data, moves to the next line of values.
    fn begin(&mut self) -> Read<()> {
        if self.encoding != Encoding::Ascii || self.is_by_words {
            return Ok(());
        }
        self.end();
        self.next_line()
    }

    /// Moves to the next line that is neither empty nor a comment.
    fn next_line(&mut self) -> Read<()> {
        loop {
            let (number, line) = self.lines.next().ok_or(ReadError::End)?;
            (self.line, self.words) = (number, line);
            if has_values(line) {
                return Ok(());
            }
        }
    }

    pub(super) fn next(&mut self, scalar: Scalar) -> Read<f64> {
        if self.encoding == Encoding::Ascii {
            if self.is_by_words && self.words.trim_ascii().is_empty() {
                self.next_line()?;
            }
            let is_last = self.lines.rest().is_empty();
            let Some(word) = take_word(&mut self.words) else {
                return Err(if is_last {
                    ReadError::End
                } else {
                    self.fault("fewer values than the header says")
                });
            };
            // The last number of the file may be truncated.
            let is_cut = is_last && self.words.is_empty();
            return parse_number(word)
                .ok_or_else(|| if is_cut { ReadError::End } else { self.fault("not a number") });
        }
        let bytes = self.source.bytes.get(self.at..self.at + scalar.size()).ok_or(ReadError::End)?;
        let join = |bits: u64, &byte: &u8| bits << 8 | u64::from(byte);
        let bits = match self.encoding {
            Encoding::BigEndian => bytes.iter().fold(0, join),
            _ => bytes.iter().rev().fold(0, join),
        };
        self.at += scalar.size();
        Ok(scalar.of_bits(bits))
    }

    /// Reads the length of a list.
    pub(super) fn length(&mut self, scalar: Scalar) -> Read<u64> {
        let length = self.next(scalar)?;
        if length >= 0.0 && length.fract() == 0.0 {
            Ok(length as u64)
        } else {
            Err(self.fault(format!("a list of {} values", brief(length))))
        }
    }

    /// Reads a list into `values`.
    pub(super) fn list(&mut self, length: Scalar, scalar: Scalar, values: &mut Vec<f64>) -> Read<()> {
        values.clear();
        for _ in 0..self.length(length)? {
            values.push(self.next(scalar)?);
        }
        Ok(())
    }

    pub(super) fn skip_property(&mut self, property: &Property) -> Read<()> {
        let count = property.length.map_or(Ok(1), |length| self.length(length))?;
        (0..count).try_for_each(|_| self.next(property.scalar).map(drop))
    }

    pub(super) fn skip(&mut self, element: &Element) -> Result<()> {
        let is_text = self.encoding == Encoding::Ascii;
        self.each(element, |body| {
            if is_text && !body.is_by_words {
                body.words = &[];
                return Ok(());
            }
            element.properties.iter().try_for_each(|property| body.skip_property(property))
        })
    }

    /// A vertex index, below `count`.
    pub(super) fn checked(&self, index: f64, count: usize) -> Read<u32> {
        if index >= 0.0 && index < count as f64 && index.fract() == 0.0 && index <= f64::from(u32::MAX) {
            Ok(index as u32)
        } else {
            let index = brief(index);
            Err(self.fault(format!(
                "vertex {index} does not exist; there are {count} before the faces, counted from 0"
            )))
        }
    }
}

/// Whether a line is neither empty nor a comment.
fn has_values(mut line: &[u8]) -> bool {
    let first = take_word(&mut line);
    first.is_some_and(|word| !word.starts_with(b"#") && word != b"comment" && word != b"obj_info")
}

/// The name of an element for messages, which do not repeat what a file says.
fn known_name(element: &Element) -> &'static str {
    const KNOWN: [&str; 3] = ["vertex", "face", "tristrips"];
    KNOWN.into_iter().find(|name| *name == element.name).unwrap_or("of another name")
}

/// A number for display, with an exponent if it is long.
fn brief(number: f64) -> String {
    if number.abs() < 1e16 { number.to_string() } else { format!("{number:e}") }
}
