//! Reading pictures back, to compare them: PNG and JPEG as a display shows them, OpenEXR as the numbers in it.

use std::path::Path;

use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, Text, read};

use super::ColourPipeline;
use crate::error::{Error, Result};

/// The pixels of a picture file, and the numbers that they are in.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue, row by row from the top.
    pub values: Vec<[f32; 3]>,
    /// `Linear` for linear light, any other for display values.
    pub pipeline: ColourPipeline,
}

/// Reads a picture. PNG and JPEG give display values from 0 to 1; an EXR gives its channels `R`, `G` and `B` as they are: linear
/// light, but where kiln wrote it in another pipeline and says so in it. Transparency is left out.
///
/// # Errors
/// [`Error::Input`] where the file is missing, damaged, or not such a picture.
pub fn read_picture(file: &Path) -> Result<Pixels> {
    let wrong = |what: String| Error::input(file, what, "give a .png, .jpg or .exr picture");
    let bytes = std::fs::read(file).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => wrong("no such file".into()),
        _ => wrong(format!("cannot be read: {e}")),
    })?;
    // The magic number of OpenEXR, Technical Introduction to OpenEXR, "File Layout".
    let pixels =
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) { read_exr(bytes) } else { read_bytes(&bytes) };
    pixels.map_err(wrong)
}

fn read_bytes(bytes: &[u8]) -> std::result::Result<Pixels, String> {
    let picture = image::load_from_memory(bytes).map_err(|e| match e {
        image::ImageError::Unsupported(_) => "not a PNG, JPEG or EXR picture".to_owned(),
        other => format!("damaged picture: {other}"),
    })?;
    // 8 and 16 bits alike become fractions of their largest value.
    let picture = picture.into_rgb32f();
    let (width, height) = picture.dimensions();
    let values = picture.pixels().map(|p| p.0).collect();
    Ok(Pixels { width, height, values, pipeline: ColourPipeline::Display })
}

fn read_exr(bytes: Vec<u8>) -> std::result::Result<Pixels, String> {
    type Rows = (usize, Vec<[f32; 3]>);
    let picture = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| -> Rows { (size.width(), vec![[0.0; 3]; size.area()]) },
            |(width, rows): &mut Rows, at, (r, g, b): (f32, f32, f32)| {
                rows[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(|e| format!("damaged, or without the channels R, G and B: {e}"))?;
    let layer = picture.layer_data;
    let said = layer.attributes.other.get(&Text::from("kiln:colour"));
    let display = matches!(said, Some(AttributeValue::Text(name)) if name.eq("display") || name.eq("u8"));
    Ok(Pixels {
        width: layer.size.width() as u32,
        height: layer.size.height() as u32,
        values: layer.channel_data.pixels.1,
        pipeline: if display { ColourPipeline::Display } else { ColourPipeline::Linear },
    })
}
