//! OBJ and MTL texts in UTF-8 or Latin-1. A large text is read in windows of whole lines.

use std::io::Read;
use std::path::Path;

use crate::error::Result;
use crate::files::unreadable;
use crate::import::Source;
use crate::import::formats::obj::scanner::{last_line, next_line};
use crate::limits;

/// A name in UTF-8; if it is not, in Latin-1.
pub(super) fn decode_name(name: &[u8]) -> String {
    match std::str::from_utf8(name) {
        Ok(name) => name.into(),
        Err(_) => name.iter().copied().map(char::from).collect(),
    }
}

/// Reads a text in windows of whole lines.
pub(super) struct Windows<'a> {
    file: &'a Path,
    reader: Box<dyn Read + Send + 'a>,
    size: usize,
    /// Bytes read beyond the last window.
    rest: Vec<u8>,
    is_done: bool,
    /// Length of the text in bytes.
    pub length: u64,
}

impl<'a> Windows<'a> {
    /// The text of `source`, in windows of `size` bytes or more.
    pub(super) fn open(source: &'a Source, size: usize) -> Result<Self> {
        let file = source.file.as_path();
        let (mut reader, length) = source.stream()?;
        let mut rest = Vec::new();
        reader.by_ref().take(3).read_to_end(&mut rest).map_err(|e| unreadable(file, &e))?;
        if rest == b"\xEF\xBB\xBF" {
            rest.clear();
        }
        Ok(Windows { file, reader, size, rest, is_done: false, length })
    }

    /// Replaces the contents of `window` by the next lines; by nothing at the end of the text.
    pub(super) fn next(&mut self, window: &mut Vec<u8>) -> Result<()> {
        window.clear();
        window.append(&mut self.rest);
        while !self.is_done {
            // A line that is longer than a window doubles it.
            let wanted = self.size.max(window.len());
            if wanted > self.size {
                limits::check(2 * wanted as u64).map_err(|excess| excess.at(self.file, READING))?;
            }
            window.reserve_exact(wanted + 1);
            let read = self.reader.by_ref().take(wanted as u64).read_to_end(window);
            self.is_done = read.map_err(|e| unreadable(self.file, &e))? < wanted;
            if let Some(end) = last_line(window).filter(|_| !self.is_done) {
                self.rest.extend_from_slice(&window[end..]);
                window.truncate(end);
                break;
            }
        }
        Ok(())
    }
}

/// What takes memory, in messages.
pub(super) const READING: &str = "reading its meshes";

/// Splits a window into parts of whole lines, of `size` bytes or more.
pub(super) fn parts(window: &[u8], size: usize) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    let mut rest = window;
    while let Some(end) = next_line(rest, size).filter(|_| rest.len() > size) {
        let (part, more) = rest.split_at(end);
        parts.push(part);
        rest = more;
    }
    parts.push(rest);
    parts
}
