//! Images of the HTML page: the picture of each setting, its reference and error map, and the worst pixels.

use std::collections::HashMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde::Serialize;

use super::data::ReferenceKind;
use kiln::error::{Error, Result};
use kiln::metrics::{ComparedImage, Errors, Figures, error_map};

/// Number of worst pixels to show enlarged.
const WORST: usize = 3;

/// Size limit of the PNG data of a page in bytes, for browsers; further images are left out.
const MAX_BYTES: usize = 24 << 20;

/// Comparison of a picture with a reference.
pub struct Comparison {
    /// Error figures.
    pub errors: Figures,
    /// The reference as PNG.
    reference: Vec<u8>,
    /// Error map as PNG; `None` if the pictures are equal.
    heat: Option<Vec<u8>>,
    /// Columns and rows of the worst pixels, in descending order of difference.
    worst: Vec<[u32; 2]>,
}

impl Comparison {
    /// Column and row of the worst pixel; `None` if the pictures are equal.
    pub(crate) fn worst_place(&self) -> Option<[u32; 2]> {
        self.worst.first().copied()
    }

    /// `None` if a pixel is not finite.
    ///
    /// # Errors
    /// Those of [`Errors::between`] and [`png`].
    pub fn new(reference: &ComparedImage, test: &ComparedImage) -> Result<Option<Self>> {
        let Errors { figures: Some(errors), worst, .. } = Errors::between(reference, test)? else {
            return Ok(None);
        };
        let worst = worst.iter().take(WORST).map(|worst| [worst.x, worst.y]).collect();
        let heat = if errors.are_none() { None } else { Some(heat(reference, test)?) };
        Ok(Some(Comparison { errors, reference: png(reference)?, heat, worst }))
    }
}

/// Error map as PNG.
fn heat(a: &ComparedImage, b: &ComparedImage) -> Result<Vec<u8>> {
    encode(a.width, a.height, error_map(a, b).as_flattened())
}

/// Display values of a picture as PNG.
///
/// # Errors
/// [`Error::Failed`] if the encoder fails.
pub(crate) fn png(picture: &ComparedImage) -> Result<Vec<u8>> {
    let byte = |c: &f32| kiln::film::rounding::quantise::<u8>((*c).into());
    let bytes: Vec<u8> = picture.displayed().iter().flatten().map(byte).collect();
    encode(picture.width, picture.height, &bytes)
}

fn encode(width: u32, height: u32, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    // The data URIs of a page are smaller than with the encoder of `film`, which is faster.
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive);
    let done = encoder.write_image(bytes, width, height, ExtendedColorType::Rgb8);
    done.map_err(|e| Error::Failed { what: format!("a picture cannot be made: {e}"), hint: String::new() })?;
    Ok(file)
}

/// The picture of a setting with its comparisons.
pub struct SettingImages {
    /// The picture as PNG.
    pub png: Vec<u8>,
    /// Comparison with the limit.
    pub limit: Option<Comparison>,
    /// Comparison with the twin.
    pub twin: Option<Comparison>,
}

/// All images of a page, without duplicates.
#[derive(Debug, Default, PartialEq, Serialize)]
pub struct PageImages {
    /// PNG files as data URIs.
    pub files: Vec<String>,
    /// File index of the limit of the base.
    pub limit: Option<usize>,
    /// Column and row where the quick setting of the page differs most from the limit.
    pub place: Option<[u32; 2]>,
    /// Images of each row; `None` if left out.
    pub rows: Vec<Option<RowImages>>,
}

/// Images of a row, as file indices.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowImages {
    /// Picture of the setting.
    pub own: usize,
    /// Reference.
    pub reference: usize,
    /// Error map; `None` if the pictures are equal.
    pub heat: Option<usize>,
    /// Columns and rows of the worst pixels.
    pub worst: Vec<[u32; 2]>,
}

impl PageImages {
    /// `rows` gives for each row the index in `settings` and the reference.
    pub fn new(
        limit: Option<Vec<u8>>,
        rows: &[Option<(usize, ReferenceKind)>],
        settings: &[Option<SettingImages>],
    ) -> Self {
        let mut files = Files::default();
        let limit = limit.map(|limit| files.number(limit));
        let mut pictures = Vec::new();
        for row in rows {
            let compared = row.and_then(|(index, reference)| {
                let shown = settings.get(index)?.as_ref()?;
                let comparison = match reference {
                    ReferenceKind::Limit => shown.limit.as_ref(),
                    ReferenceKind::SameSamples => shown.twin.as_ref(),
                };
                Some((shown, comparison?))
            });
            let picture = compared.filter(|_| files.bytes < MAX_BYTES).map(|(shown, comparison)| RowImages {
                own: files.number(shown.png.clone()),
                reference: files.number(comparison.reference.clone()),
                heat: comparison.heat.clone().map(|heat| files.number(heat)),
                worst: comparison.worst.clone(),
            });
            pictures.push(picture);
        }
        PageImages { files: files.list, limit, place: None, rows: pictures }
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
    use kiln::metrics::Values;

    #[test]
    fn files_are_unique_and_equal_pictures_have_no_error_map() {
        let uniform = |value: f32| ComparedImage {
            width: 4,
            height: 4,
            values: Values::Display,
            pixels: vec![[value; 3]; 16],
            alpha: None,
        };
        let shown = |value: f32| {
            let twin = Comparison::new(&uniform(0.5), &uniform(value)).unwrap();
            Some(SettingImages { png: png(&uniform(value)).unwrap(), limit: None, twin })
        };
        let rows = [
            Some((0, ReferenceKind::SameSamples)),
            Some((1, ReferenceKind::SameSamples)),
            Some((1, ReferenceKind::Limit)),
            None,
        ];
        let pictures = PageImages::new(None, &rows, &[shown(0.5), shown(0.25)]);
        // Grey, dark grey, and their error map.
        assert_eq!(pictures.files.len(), 3);
        assert_eq!(pictures.rows[0], Some(RowImages { own: 0, reference: 0, heat: None, worst: Vec::new() }));
        let [_, Some(second), None, None] = &pictures.rows[..] else { panic!("{:?}", pictures.rows) };
        assert_eq!((second.own, second.reference, second.heat, second.worst.len()), (1, 0, Some(2), 1));
    }
}
