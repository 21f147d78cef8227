//! The pictures of a report: what each setting made, where it differs, and the three worst places.

use std::collections::HashMap;

use base64::engine::general_purpose::STANDARD;
use base64::Engine;
use serde::Serialize;

use super::data::Judge;
use super::errors::PictureErrors;
use crate::error::{Error, Result};
use crate::metrics::{error_map, ComparedImage, Errors};

/// Places that are shown enlarged.
const WORST: usize = 3;

/// Bytes of PNG that a report holds at most; pictures beyond are left out. A browser copes with as much at once.
const BUDGET: usize = 24 << 20;

/// A picture held against another.
pub struct Against {
    /// How far they are apart.
    pub errors: PictureErrors,
    /// The other, as PNG.
    reference: Vec<u8>,
    /// Where they differ, as PNG; missing where they do not.
    heat: Option<Vec<u8>>,
    /// Columns and rows of the worst pixels, the worst first.
    worst: Vec<[u32; 2]>,
}

impl Against {
    /// `None` where a pixel of either is no finite number.
    ///
    /// # Errors
    /// Those of the comparison, and where a PNG cannot be made.
    pub fn new(reference: &ComparedImage, test: &ComparedImage) -> Result<Option<Self>> {
        let Some(figures) = Errors::between(reference, test)?.figures else { return Ok(None) };
        let errors = PictureErrors::of(&figures);
        let worst = figures.worst.iter().take(WORST).map(|worst| [worst.x, worst.y]).collect();
        let heat = if errors.are_none() { None } else { Some(heat(reference, test)?) };
        Ok(Some(Against { errors, reference: png(reference)?, heat, worst }))
    }
}

/// Where they differ, as colours.
fn heat(a: &ComparedImage, b: &ComparedImage) -> Result<Vec<u8>> {
    encode(a.width, a.height, error_map(a, b).as_flattened())
}

/// What a display shows of a picture, as PNG.
///
/// # Errors
/// [`Error::Failed`] where it cannot be made.
pub fn png(picture: &ComparedImage) -> Result<Vec<u8>> {
    let byte = |c: &f32| crate::film::colour::quantise((*c).into());
    let bytes: Vec<u8> = picture.displayed().iter().flatten().map(byte).collect();
    encode(picture.width, picture.height, &bytes)
}

fn encode(width: u32, height: u32, bytes: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Failed {
        what: format!("a picture cannot be made: {e}"),
        hint: String::new(),
    };
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(file)
}

/// What a setting made.
pub struct Shown {
    /// Its picture, as PNG.
    pub png: Vec<u8>,
    /// Against its limit.
    pub limit: Option<Against>,
    /// Against its twin.
    pub twin: Option<Against>,
}

/// All pictures of a report, each file once.
#[derive(Debug, Default, PartialEq, Serialize)]
pub struct Pictures {
    /// The files, as data URIs.
    pub files: Vec<String>,
    /// The limit of the picture that was asked for.
    pub limit: Option<usize>,
    /// For each row, its pictures; missing where they are left out.
    pub rows: Vec<Option<Picture>>,
}

/// The pictures of a row, as numbers of files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// What the setting made.
    pub own: usize,
    /// What it is held against.
    pub reference: usize,
    /// Where it differs; missing where it does not.
    pub heat: Option<usize>,
    /// Columns and rows of the worst pixels.
    pub worst: Vec<[u32; 2]>,
}

impl Pictures {
    /// Of each row the number of its cell and what judges it; and the cells.
    pub fn new(limit: Option<Vec<u8>>, rows: &[Option<(usize, Judge)>], cells: &[Option<Shown>]) -> Self {
        let mut files = Files::default();
        let limit = limit.map(|limit| files.number(limit));
        let mut pictures = Vec::new();
        for row in rows {
            let shown = row.and_then(|(cell, judge)| Some((cells.get(cell)?.as_ref()?, judge)));
            let against = shown.and_then(|(shown, judge)| {
                let against = match judge {
                    Judge::Limit => shown.limit.as_ref(),
                    Judge::Twin => shown.twin.as_ref(),
                };
                Some((shown, against?))
            });
            let picture = against.filter(|_| files.bytes < BUDGET).map(|(shown, against)| Picture {
                own: files.number(shown.png.clone()),
                reference: files.number(against.reference.clone()),
                heat: against.heat.clone().map(|heat| files.number(heat)),
                worst: against.worst.clone(),
            });
            pictures.push(picture);
        }
        Pictures { files: files.list, limit, rows: pictures }
    }
}

#[derive(Default)]
struct Files {
    list: Vec<String>,
    known: HashMap<Vec<u8>, usize>,
    bytes: usize,
}

impl Files {
    fn number(&mut self, file: Vec<u8>) -> usize {
        if let Some(&number) = self.known.get(&file) {
            return number;
        }
        self.bytes += file.len();
        self.list.push(format!("data:image/png;base64,{}", STANDARD.encode(&file)));
        self.known.insert(file, self.list.len() - 1);
        self.list.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Values;

    #[test]
    fn equal_files_are_kept_once_and_equal_pictures_have_no_heat() {
        let even = |value: f32| ComparedImage {
            width: 4,
            height: 4,
            values: Values::Display,
            pixels: vec![[value; 3]; 16],
        };
        let shown = |value: f32| {
            let twin = Against::new(&even(0.5), &even(value)).unwrap();
            Some(Shown { png: png(&even(value)).unwrap(), limit: None, twin })
        };
        let rows = [Some((0, Judge::Twin)), Some((1, Judge::Twin)), Some((1, Judge::Limit)), None];
        let pictures = Pictures::new(None, &rows, &[shown(0.5), shown(0.25)]);
        // Grey, darker grey, and the map of their difference.
        assert_eq!(pictures.files.len(), 3);
        assert_eq!(pictures.rows[0], Some(Picture { own: 0, reference: 0, heat: None, worst: Vec::new() }));
        let [_, Some(second), None, None] = &pictures.rows[..] else { panic!("{:?}", pictures.rows) };
        assert_eq!((second.own, second.reference, second.heat, second.worst.len()), (1, 0, Some(2), 1));
    }
}
