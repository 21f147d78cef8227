//! The ZIP archive of a 3MF file (Open Packaging Conventions).
//!
//! rawzip reads the archive's structure from memory without allocation, flate2 inflates. The stated size of a part is
//! checked before inflating and bounds the bytes read.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};

use flate2::bufread::DeflateDecoder;
use quick_xml::events::{BytesStart, Event};
use rawzip::{CompressionMethod, ZipArchive, ZipArchiveEntryWayfinder, ZipSliceArchive};
use unicode_normalization::UnicodeNormalization;

use crate::error::{Error, Place, Result};
use crate::import::files::contents::advice_on;
use crate::import::formats::threemf::model::attributes;
use crate::import::{Source, ending};
use crate::limits;

/// The relationship that leads to the model (Core Specification, section 2.1.1).
const MODEL: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

pub(super) struct Package<'a> {
    source: &'a Source,
    archive: ZipSliceArchive<&'a [u8]>,
    /// Entries by [`key`].
    entries: HashMap<String, (ZipArchiveEntryWayfinder, CompressionMethod)>,
}

/// Lookup key of a part: lower case, in NFC, without a leading slash, percent-decoded.
fn key(part: &str) -> String {
    let part = percent_encoding::percent_decode_str(part).decode_utf8_lossy();
    part.replace('\\', "/").trim_start_matches('/').nfc().collect::<String>().to_ascii_lowercase()
}

impl<'a> Package<'a> {
    pub(super) fn open(source: &'a Source) -> Result<Self> {
        let file = source.file.as_path();
        let broken = |e: rawzip::Error| {
            Error::input(
                file,
                format!("not a whole ZIP archive, as 3MF files are: {e}"),
                "export or copy it again",
            )
        };
        let archive = ZipArchive::from_slice(source.bytes.as_slice()).map_err(broken)?;
        let mut entries = HashMap::new();
        let mut all = archive.entries();
        while let Some(entry) = all.next_entry().map_err(broken)? {
            let name = String::from_utf8_lossy(entry.file_path().as_bytes()).into_owned();
            entries.entry(key(&name)).or_insert((entry.wayfinder(), entry.compression_method()));
        }
        Ok(Package { source, archive, entries })
    }

    /// An error in a part.
    pub(super) fn broken(&self, part: &str, what: impl std::fmt::Display) -> Error {
        Error::input(Place::item(&self.source.file, part), what.to_string(), "export or copy the file again")
    }

    /// The size of a part in bytes. Checks the memory limit for a number of times as many.
    pub(super) fn check(&self, part: &str, times: u64) -> Result<u64> {
        let size =
            self.entries.get(&key(part)).map_or(0, |(wayfinder, _)| wayfinder.uncompressed_size_hint());
        limits::check_claim(limits::product(&[size, times])).map_err(|excess| {
            excess.at(Place::item(&self.source.file, part), format!("{size} bytes inflated: reading them"))
        })?;
        Ok(size)
    }

    /// The stream of a part, and its size; `None` if there is no such part.
    pub(super) fn stream(&self, part: &str) -> Result<Option<(Box<dyn BufRead + '_>, u64)>> {
        let Some(&(wayfinder, method)) = self.entries.get(&key(part)) else { return Ok(None) };
        let size = self.check(part, 1)?;
        let entry = self.archive.get_entry(wayfinder).map_err(|e| self.broken(part, e))?;
        let bytes: &[u8] = entry.data();
        let read: Box<dyn Read> = match method {
            CompressionMethod::STORE => Box::new(bytes),
            CompressionMethod::DEFLATE => Box::new(DeflateDecoder::new(bytes)),
            other => {
                return Err(self.broken(part, format!("compressed by {other}; 3MF files use DEFLATE")));
            }
        };
        // One byte more than stated makes the verification fail.
        let whole = entry.verifying_reader(read.take(size.saturating_add(1)));
        Ok(Some((Box::new(BufReader::with_capacity(1 << 16, whole)), size)))
    }

    /// The contents of a part; `None` if there is no such part.
    pub(super) fn bytes(&self, part: &str) -> Result<Option<Vec<u8>>> {
        let Some((mut stream, size)) = self.stream(part)? else { return Ok(None) };
        // The stated size was checked; memory grows with the actual size.
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).map_err(|e| self.broken(part, e))?;
        debug_assert!(bytes.len() as u64 <= size.saturating_add(1));
        Ok(Some(bytes))
    }

    /// Calls `visit` with the start of each element of a part. Without the part, there are none.
    pub(super) fn for_each_element(&self, part: &str, mut visit: impl FnMut(&BytesStart)) -> Result<()> {
        // What is kept of an element is smaller than 16 times its text.
        self.check(part, 16)?;
        let Some((stream, _)) = self.stream(part)? else { return Ok(()) };
        let mut reader = quick_xml::Reader::from_reader(stream);
        let mut buffer = Vec::new();
        loop {
            buffer.clear();
            match reader.read_event_into(&mut buffer).map_err(|e| self.broken(part, e))? {
                Event::Eof => return Ok(()),
                Event::Start(e) | Event::Empty(e) => visit(&e),
                _ => {}
            }
        }
    }

    /// Part of the root model: by relationships, else `3D/3dmodel.model`, the usual name.
    pub(super) fn root(&self) -> Result<String> {
        let mut target = None;
        self.for_each_element("_rels/.rels", |e| {
            let of = |wanted: &[u8]| {
                attributes(e).find(|(key, _)| key.eq_ignore_ascii_case(wanted)).map(|(_, value)| value)
            };
            if target.is_none() && of(b"type").as_deref() == Some(MODEL) {
                target = of(b"target");
            }
        })?;
        let named = target.filter(|part| self.entries.contains_key(&key(part)));
        let usual = || "3D/3dmodel.model".to_owned();
        let part = named.unwrap_or_else(usual);
        if self.entries.contains_key(&key(&part)) {
            return Ok(part);
        }
        let what = "a ZIP archive without a 3D model (`3D/3dmodel.model`)";
        let hint = match ending(&self.source.file).as_str() {
            "3mf" => "export the file again, as 3MF".into(),
            "usdz" => advice_on("usdz"),
            _ => advice_on("zip"),
        };
        Err(Error::input(self.source.file.as_path(), what, hint))
    }
}
