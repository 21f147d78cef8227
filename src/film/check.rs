//! Checks that image files are complete, and reads their metadata.
//!
//! JPEG is not supported: it has no checksum, and decoders fill in missing data, so that truncation cannot be detected.
//!
//! Images are decoded by rows or blocks, so that memory does not grow with their height; only rows and blocks are
//! checked against [`limits`].

use std::io::{BufReader, Cursor};
use std::path::Path;

use exr::block::reader::ChunksReader;
use exr::prelude::{AttributeValue, Text};

use super::read::{ReadError, exr_reader};
use super::write::{FINGERPRINT, FRAME, Format};
use crate::error::contain;
use crate::files;
use crate::limits;

/// State of an output file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileState {
    /// The file does not exist.
    Missing,
    /// The file is unreadable or incomplete; the reason.
    Broken(String),
    /// The file is complete; its metadata.
    Whole(PictureIdentity),
}

/// Metadata that identifies a picture.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PictureIdentity {
    /// Fingerprint of scene and settings, if present.
    pub fingerprint: Option<String>,
    /// Frame number, if present.
    pub frame: Option<i32>,
    /// All entries.
    pub texts: Vec<(String, String)>,
}

impl FileState {
    /// Whether it is the complete picture of this fingerprint and frame.
    pub fn is(&self, fingerprint: &str, frame: Option<i32>) -> bool {
        let wanted = (Some(fingerprint), frame);
        matches!(self, FileState::Whole(found) if (found.fingerprint.as_deref(), found.frame) == wanted)
    }
}

/// Checks all of a file: a PNG with the checksums of all its chunks, or an OpenEXR with all of its pixels.
pub fn state_of(file: &Path, format: Format) -> FileState {
    let bytes = match files::read_output(file) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return FileState::Missing,
        Err(e) => return FileState::Broken(files::explain(&e).0),
    };
    let texts = || match format {
        Format::Png => png_texts(&bytes),
        Format::Exr => exr_texts(&bytes),
        Format::Jpeg => Err(ReadError::Damaged("a JPEG does not say whether it is whole".into())),
    };
    match contain(texts) {
        None => FileState::Broken("damaged: its decoder failed".into()),
        Some(Err(ReadError::Damaged(what))) => FileState::Broken(what),
        Some(Err(ReadError::TooLarge { what, hint })) => FileState::Broken(format!("{what}; {hint}")),
        Some(Ok(texts)) => {
            let text = |name: &str| texts.iter().find(|(key, _)| key == name).map(|(_, value)| value);
            let frame = text(FRAME).and_then(|frame| frame.parse().ok());
            FileState::Whole(PictureIdentity { fingerprint: text(FINGERPRINT).cloned(), frame, texts })
        }
    }
}

type Texts = Result<Vec<(String, String)>, ReadError>;

/// Maximum size of a decompressed text chunk. kiln's are uncompressed and a few hundred bytes long.
const MAX_TEXT_BYTES: usize = 1 << 20;

fn png_texts(bytes: &[u8]) -> Texts {
    let damaged = |e: png::DecodingError| match e {
        png::DecodingError::IoError(_) => ReadError::Damaged("ends too early".to_owned()),
        other => ReadError::Damaged(format!("damaged: {other}")),
    };
    let mut options = png::DecodeOptions::default();
    options.set_skip_ancillary_crc_failures(false);
    let mut decoder = png::Decoder::new_with_options(BufReader::new(Cursor::new(bytes)), options);
    let header = decoder.read_header_info().map_err(damaged)?;
    let (width, height) = (u64::from(header.width), u64::from(header.height));
    // The current and the previous row as stored, and the output row.
    let rows = limits::product(&[header.raw_row_length() as u64, 3]);
    limits::check_claim(rows).map_err(|excess| ReadError::too_large(width, height, &excess))?;
    // In addition to rows; profiles and text are no longer than the file.
    let most = rows.saturating_add(64 << 20).saturating_add(bytes.len() as u64);
    decoder.set_limits(png::Limits { bytes: usize::try_from(most).unwrap_or(usize::MAX) });
    let mut reader = decoder.read_info().map_err(damaged)?;
    while reader.next_row().map_err(damaged)?.is_some() {}
    reader.finish().map_err(damaged)?;
    if png_length(bytes) != Some(bytes.len()) {
        return Err(ReadError::Damaged("damaged: goes on after its end".to_owned()));
    }
    let text = |chunk: &png::text_metadata::ITXtChunk| {
        let mut chunk = chunk.clone();
        chunk.decompress_text_with_limit(MAX_TEXT_BYTES).ok()?;
        Some((chunk.keyword.clone(), chunk.get_text().ok()?))
    };
    Ok(reader.info().utf8_text.iter().filter_map(text).collect())
}

/// Length of a PNG up to the end of its last chunk, `IEND` (PNG, 3rd edition, section 5.3).
fn png_length(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    loop {
        let (length, kind) = (bytes.get(at..at + 4)?, bytes.get(at + 4..at + 8)?);
        at += 12 + u32::from_be_bytes(length.try_into().ok()?) as usize;
        if kind == b"IEND" {
            return Some(at);
        }
    }
}

fn exr_texts(bytes: &[u8]) -> Texts {
    let damaged = |e: exr::error::Error| ReadError::Damaged(format!("damaged: {e}"));
    let reader = exr_reader(bytes, |_| 0)?;
    let Some(first) = reader.headers().first() else {
        return Err(ReadError::Damaged("damaged: without a layer".into()));
    };
    let attributes = first.own_attributes.other.clone();
    let blocks = reader.all_chunks(true).map_err(damaged)?;
    blocks.decompress_sequential(true, |_, _| Ok(())).map_err(damaged)?;
    let text = |(name, value): (&Text, &AttributeValue)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    };
    Ok(attributes.iter().filter_map(text).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::write::{OutputImage, encode};
    use crate::film::{ColourPipeline, ExrAttributes, Film, Window};

    fn picture(format: Format) -> Vec<u8> {
        let window = Window { x: 0, y: 0, width: 19, height: 17 };
        let picture = match format {
            Format::Exr => {
                let rows: Vec<[f32; 3]> =
                    (0..19 * 17).map(|i| [i as f32, 0.25, 1.0 / (1.0 + i as f32)]).collect();
                OutputImage::Float(
                    Film::from_rows(window, &rows).unwrap(),
                    Vec::new(),
                    ExrAttributes::of_size([19, 17]),
                )
            }
            _ => {
                let rows: Vec<[u8; 3]> = (0..19 * 17).map(|i| [i as u8, 7, (i * i) as u8]).collect();
                OutputImage::Rgb8(Film::from_rows(window, &rows).unwrap(), ColourPipeline::Linear)
            }
        };
        let metadata = [(FINGERPRINT.to_owned(), "abc".to_owned()), (FRAME.to_owned(), "-7".to_owned())];
        let mut bytes = Vec::new();
        encode(&picture, &metadata, format, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn whole_pictures_are_known_and_no_beginning_of_one_is_taken_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        for format in [Format::Png, Format::Exr] {
            assert_eq!(state_of(&file, format), FileState::Missing);
            let bytes = picture(format);
            std::fs::write(&file, &bytes).unwrap();
            let found = state_of(&file, format);
            assert!(found.is("abc", Some(-7)), "{found:?}");
            assert!(!found.is("abd", Some(-7)) && !found.is("abc", Some(7)) && !found.is("abc", None));
            for length in 0..bytes.len() {
                std::fs::write(&file, &bytes[..length]).unwrap();
                let found = state_of(&file, format);
                assert!(matches!(found, FileState::Broken(_)), "{format:?}, {length} bytes: {found:?}");
            }
            for rest in [&b"\0"[..], b"GIF89a", &bytes] {
                std::fs::write(&file, [&bytes, rest].concat()).unwrap();
                let found = state_of(&file, format);
                assert!(matches!(found, FileState::Broken(_)), "{format:?}, longer: {found:?}");
            }
            std::fs::remove_file(&file).unwrap();
        }
    }

    #[test]
    fn a_wrong_byte_in_a_png_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        let bytes = picture(Format::Png);
        for at in 0..bytes.len() {
            let mut wrong = bytes.clone();
            wrong[at] ^= 4;
            std::fs::write(&file, &wrong).unwrap();
            assert!(!state_of(&file, Format::Png).is("abc", Some(-7)), "byte {at} of {}", bytes.len());
        }
    }
}
