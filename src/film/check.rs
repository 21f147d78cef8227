//! Whether a picture on disk is whole, and what made it, going by what is written in it.
//!
//! JPEG is not asked: it has no checksum, and decoders fill up what is missing, so that whole ones cannot be told from others.

use std::io::{BufReader, Cursor};
use std::path::Path;

use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, Text, read};

use super::write::{FINGERPRINT, FRAME, Format};

/// What there is where a picture should be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// No file.
    Missing,
    /// A file that cannot be read, or not to its end; why.
    Broken(String),
    /// A whole picture.
    Whole(Made),
}

/// What a picture says of how it was made.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Made {
    /// The fingerprint of scene and settings, where it says one.
    pub fingerprint: Option<String>,
    /// The frame, where it is one.
    pub frame: Option<i32>,
}

impl Found {
    /// Whether it is the whole picture of this fingerprint and frame.
    pub fn is(&self, fingerprint: &str, frame: Option<i32>) -> bool {
        let wanted = Made { fingerprint: Some(fingerprint.to_owned()), frame };
        *self == Found::Whole(wanted)
    }
}

/// Reads a PNG to its end, with the checksums of all its parts, or an OpenEXR with all of its pixels.
pub fn look(file: &Path, format: Format) -> Found {
    let bytes = match std::fs::read(file) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Found::Missing,
        Err(e) => return Found::Broken(format!("cannot be read: {e}")),
    };
    let texts = match format {
        Format::Png => png_texts(&bytes),
        Format::Exr => exr_texts(bytes),
        Format::Jpeg => Err("a JPEG does not say whether it is whole".into()),
    };
    match texts {
        Err(what) => Found::Broken(what),
        Ok(texts) => {
            let text = |name: &str| texts.iter().find(|(key, _)| key == name).map(|(_, value)| value);
            let frame = text(FRAME).and_then(|frame| frame.parse().ok());
            Found::Whole(Made { fingerprint: text(FINGERPRINT).cloned(), frame })
        }
    }
}

type Texts = Result<Vec<(String, String)>, String>;

fn png_texts(bytes: &[u8]) -> Texts {
    let damaged = |e: png::DecodingError| match e {
        png::DecodingError::IoError(_) => "ends too early".to_owned(),
        other => format!("damaged: {other}"),
    };
    let mut options = png::DecodeOptions::default();
    options.set_skip_ancillary_crc_failures(false);
    let mut decoder = png::Decoder::new_with_options(BufReader::new(Cursor::new(bytes)), options);
    decoder.set_limits(png::Limits { bytes: usize::MAX });
    let mut reader = decoder.read_info().map_err(damaged)?;
    // Row by row: the picture is not needed as a whole.
    while reader.next_row().map_err(damaged)?.is_some() {}
    reader.finish().map_err(damaged)?;
    let texts = &reader.info().utf8_text;
    Ok(texts.iter().filter_map(|chunk| Some((chunk.keyword.clone(), chunk.get_text().ok()?))).collect())
}

fn exr_texts(bytes: Vec<u8>) -> Texts {
    let picture = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| format!("damaged: {e}"))?;
    let attributes = &picture.layer_data.attributes.other;
    let text = |name: &str| match attributes.get(&Text::from(name)) {
        Some(AttributeValue::Text(text)) => Some((name.to_owned(), text.to_string())),
        _ => None,
    };
    Ok([FINGERPRINT, FRAME].into_iter().filter_map(text).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::write::{Picture, encode};
    use crate::film::{ColourPipeline, Film, Window};

    fn picture(format: Format) -> Vec<u8> {
        let window = Window { x: 0, y: 0, width: 19, height: 17 };
        let picture = match format {
            Format::Exr => {
                let rows: Vec<[f32; 3]> =
                    (0..19 * 17).map(|i| [i as f32, 0.25, 1.0 / (1.0 + i as f32)]).collect();
                Picture::Numbers(Film::of_rows(window, &rows).unwrap(), Vec::new())
            }
            _ => {
                let rows: Vec<[u8; 3]> = (0..19 * 17).map(|i| [i as u8, 7, (i * i) as u8]).collect();
                Picture::Bytes(Film::of_rows(window, &rows).unwrap(), ColourPipeline::Linear)
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
            assert_eq!(look(&file, format), Found::Missing);
            let bytes = picture(format);
            std::fs::write(&file, &bytes).unwrap();
            let found = look(&file, format);
            assert!(found.is("abc", Some(-7)), "{found:?}");
            assert!(!found.is("abd", Some(-7)) && !found.is("abc", Some(7)) && !found.is("abc", None));
            for length in 0..bytes.len() {
                std::fs::write(&file, &bytes[..length]).unwrap();
                let found = look(&file, format);
                assert!(matches!(found, Found::Broken(_)), "{format:?}, {length} bytes: {found:?}");
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
            assert!(!look(&file, Format::Png).is("abc", Some(-7)), "byte {at} of {}", bytes.len());
        }
    }
}
