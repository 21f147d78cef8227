//! Reader of PLY data after the header.

use crate::error::{Error, Place, Result};
use crate::import::Source;
use crate::import::formats::ply::header::{Element, Header, Property};
use crate::import::text::lines::take_word;
use crate::import::text::values::{Encoding, Read, Scalar, Values, brief};

/// Reader of the elements after the header.
#[derive(Clone)]
pub(super) struct Body<'a> {
    pub values: Values<'a>,
    /// Number of lines with more values than declared.
    pub surplus_lines: usize,
    /// Set if the file ends early: element name, number of elements read, declared number.
    pub truncation: Option<(&'static str, u64, u64)>,
}

/// The line; nothing if it is a comment.
fn without_comment(line: &[u8]) -> &[u8] {
    let first = take_word(&mut { line }).unwrap_or_default();
    let is_comment = first.starts_with(b"#") || first == b"comment" || first == b"obj_info";
    if is_comment { &[] } else { line.trim_ascii() }
}

impl<'a> Body<'a> {
    pub(super) fn new(source: &'a Source, header: &Header, is_by_words: bool) -> Self {
        let text = &source.bytes[header.bytes..];
        let values = Values::of_text(source, text, header.lines, is_by_words, without_comment);
        let values = match header.encoding {
            Encoding::Ascii => values,
            binary => values.into_binary(binary),
        };
        Body { values, surplus_lines: 0, truncation: None }
    }

    /// An error in the declaration of an element.
    pub(super) fn fault_of(&self, element: &Element, what: impl Into<String>) -> Error {
        Error::input(Place::line(&self.values.source.file, element.line), what, "export the file again")
    }

    /// Number of elements to reserve. Checks the memory limit for `bytes` per element.
    pub(super) fn count(&self, element: &Element, bytes: usize) -> Result<usize> {
        let least = element.least_bytes(self.values.encoding);
        self.values.capacity(element.count, least, bytes, element.line)
    }

    /// Calls `read` once per element, unless elements have no properties and hence no data. An early end of file sets
    /// [`Body::truncation`] and is no error.
    pub(super) fn each(
        &mut self,
        element: &Element,
        mut read: impl FnMut(&mut Values<'a>) -> Read<()>,
    ) -> Result<()> {
        if element.properties.is_empty() {
            return Ok(());
        }
        let Body { values, surplus_lines, .. } = self;
        let mut end_line = |values: &mut Values| {
            if values.is_by_lines() {
                *surplus_lines += usize::from(!std::mem::take(&mut values.rest).trim_ascii().is_empty());
            }
        };
        let there = values.each(element.count, |values| {
            end_line(values);
            if values.is_by_lines() {
                values.next_line()?;
            }
            read(values)
        })?;
        if there < element.count {
            self.truncation = Some((known_name(element), there, element.count));
            values.rest = &[];
        } else {
            end_line(values);
        }
        Ok(())
    }

    /// Whether all values that the header declares are there, and no others.
    pub(super) fn is_whole(&self) -> bool {
        self.truncation.is_none()
            && self.surplus_lines == 0
            && self.values.rest.trim_ascii().is_empty()
            && self.values.bytes_left() == 0
    }

    pub(super) fn skip(&mut self, element: &Element) -> Result<()> {
        self.each(element, |values| {
            if values.is_by_lines() {
                values.rest = &[];
                return Ok(());
            }
            element.properties.iter().try_for_each(|property| skip_property(values, property))
        })
    }
}

/// Reads a list into `list`.
pub(super) fn read_list(
    values: &mut Values,
    length: Scalar,
    scalar: Scalar,
    list: &mut Vec<f64>,
) -> Read<()> {
    list.clear();
    let count = read_length(values, length)?;
    values.take(count, scalar, list)
}

/// Reads the length of a list.
pub(super) fn read_length(values: &mut Values, scalar: Scalar) -> Read<u64> {
    let length = values.next(scalar)?;
    if length >= 0.0 && length.fract() == 0.0 {
        Ok(length as u64)
    } else {
        Err(values.fault(format!("a list of {} values", brief(length))).into())
    }
}

pub(super) fn skip_property(values: &mut Values, property: &Property) -> Read<()> {
    let count = property.length.map_or(Ok(1), |length| read_length(values, length))?;
    (0..count).try_for_each(|_| values.next(property.scalar).map(drop))
}

/// The name of an element for messages, which do not repeat what a file says.
fn known_name(element: &Element) -> &'static str {
    const KNOWN: [&str; 3] = ["vertex", "face", "tristrips"];
    KNOWN.into_iter().find(|name| *name == element.name).unwrap_or("of another name")
}
