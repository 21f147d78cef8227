//! Reading pictures: to compare them, PNG and JPEG as a display shows them, OpenEXR as the numbers in it; for textures, PNG and
//! JPEG as they are.
//!
//! Sizes are checked against [`limits`] before a decoder allocates memory for them, and a decoder that panics is contained.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, Text, Vec2, read};
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader};

use super::ColourPipeline;
use crate::error::{Error, Result, contain};
use crate::limits::{self, Excess};

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

/// Why a picture cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unread {
    /// Its bytes are not those of such a picture; what is wrong.
    Damaged(String),
    /// Its header gives a size that is beyond the limits.
    TooLarge {
        /// How large it is, what it needs and what the limit is.
        what: String,
        /// What to do about it.
        hint: String,
    },
}

impl Unread {
    /// A picture of `width` by `height` pixels that needs too much.
    pub(super) fn too_large(width: u64, height: u64, excess: &Excess) -> Self {
        Unread::TooLarge {
            what: format!("a picture of {width} x {height} pixels {excess}"),
            hint: excess.hint(),
        }
    }

    /// As an error for `file`.
    pub fn into_error(self, file: &Path) -> Error {
        match self {
            Unread::Damaged(what) => Error::input(file, what, "give a .png, .jpg or .exr picture"),
            Unread::TooLarge { what, hint } => Error::input(file, what, hint),
        }
    }
}

type Read<T> = std::result::Result<T, Unread>;

/// Reads a picture. PNG and JPEG give display values from 0 to 1; an EXR gives its channels `R`, `G` and `B` as they are: linear
/// light, but where kiln wrote it in another pipeline and says so in it. Transparency is left out.
///
/// # Errors
/// [`Error::Input`] where the file is missing, damaged, too large, or not such a picture.
pub fn read_picture(file: &Path) -> Result<Pixels> {
    let bytes = limits::read_file(file).map_err(|e| limits::unreadable(file, &e))?;
    // The magic number of OpenEXR, Technical Introduction to OpenEXR, "File Layout".
    let pixels =
        if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) { read_exr(bytes) } else { read_bytes(&bytes) };
    pixels.map_err(|e| e.into_error(file))
}

fn read_bytes(bytes: &[u8]) -> Read<Pixels> {
    // 8 and 16 bits alike become fractions of their largest value.
    let picture = decode(bytes, size_of::<[f32; 3]>() as u64)?.into_rgb32f();
    let (width, height) = picture.dimensions();
    let values = bytemuck::cast_vec(picture.into_raw());
    Ok(Pixels { width, height, values, pipeline: ColourPipeline::Display })
}

/// Decodes a PNG or JPEG picture, of which the caller makes another `bytes_each` a pixel.
///
/// # Errors
/// [`Unread`].
pub fn decode(bytes: &[u8], bytes_each: u64) -> Read<DynamicImage> {
    let unsupported = || Unread::Damaged("not a PNG, JPEG or EXR picture".to_owned());
    let damaged = |e: image::ImageError| match e {
        image::ImageError::Unsupported(_) => unsupported(),
        other => Unread::Damaged(format!("damaged picture: {other}")),
    };
    let format = image::guess_format(bytes).map_err(|_| unsupported())?;
    if format == ImageFormat::Png
        && let Some((width, height)) = png_size(bytes)
    {
        // The decoder allocates rows before it tells a size. At least a byte a pixel is decoded, and 4 for most.
        let needed = limits::product(&[width, height, 1 + bytes_each]);
        limits::check_claim(needed).map_err(|excess| Unread::too_large(width, height, &excess))?;
    }
    let parse = || -> Read<DynamicImage> {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        // Beside what is checked here, this limits colour profiles and text.
        let mut most = image::Limits::no_limits();
        most.max_alloc = Some(limits::MOST_CLAIMED);
        reader.limits(most);
        let mut decoder = reader.into_decoder().map_err(damaged)?;
        let _ = decoder.set_limits(image::Limits::no_limits());
        let (width, height) = decoder.dimensions();
        // A progressive JPEG is held as coefficients of 16 bits, for up to 4 channels, until it is whole.
        let while_decoding = if format == ImageFormat::Jpeg { 8 } else { 0 };
        let area = limits::product(&[width.into(), height.into()]);
        let needed =
            decoder.total_bytes().saturating_add(limits::product(&[area, bytes_each + while_decoding]));
        limits::check_claim(needed)
            .map_err(|excess| Unread::too_large(width.into(), height.into(), &excess))?;
        DynamicImage::from_decoder(decoder).map_err(damaged)
    };
    let picture = contain(parse)
        .unwrap_or_else(|| Err(Unread::Damaged("damaged picture: its decoder failed".to_owned())))?;
    match picture.dimensions() {
        (0, _) | (_, 0) => Err(Unread::Damaged("a picture without pixels".to_owned())),
        _ => Ok(picture),
    }
}

/// Width and height of a PNG. The header comes first, and its sizes first in it (PNG, third edition, 5.6 and 11.2.1).
fn png_size(bytes: &[u8]) -> Option<(u64, u64)> {
    bytes.get(12..16).filter(|name| *name == b"IHDR")?;
    let number = |at: usize| Some(u64::from(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?)));
    Some((number(16)?, number(20)?))
}

/// The headers of an OpenEXR picture.
///
/// # Errors
/// What is wrong with it.
pub(super) fn exr_reader(bytes: &[u8]) -> Read<exr::block::reader::Reader<Cursor<&[u8]>>> {
    let damaged = |e: &dyn std::fmt::Display| Unread::Damaged(format!("damaged: {e}"));
    match contain(|| exr::block::read(Cursor::new(bytes), false)) {
        Some(Ok(reader)) => Ok(reader),
        Some(Err(e)) => Err(damaged(&e)),
        None => Err(damaged(&"its decoder failed")),
    }
}

fn read_exr(bytes: Vec<u8>) -> Read<Pixels> {
    type Rows = (usize, Vec<[f32; 3]>);
    // Whichever layer it is that has the channels.
    for header in exr_reader(&bytes)?.headers() {
        let [width, height] = [header.layer_size.width(), header.layer_size.height()].map(|side| side as u64);
        let needed = limits::product(&[width, height, size_of::<[f32; 3]>() as u64]);
        limits::check_claim(needed.saturating_add(most_of_a_block(header)))
            .map_err(|excess| Unread::too_large(width, height, &excess))?;
    }
    let parse = || {
        read()
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
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| format!("damaged, or without the channels R, G and B: {e}"))
    };
    let picture = contain(parse)
        .unwrap_or_else(|| Err("damaged: its decoder failed".to_owned()))
        .map_err(Unread::Damaged)?;
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

/// The most memory that decoding one block of a layer takes: as it is in the file, as it is in the picture, and one more while it
/// is put in order.
pub(super) fn most_of_a_block(header: &exr::meta::header::Header) -> u64 {
    let Vec2(width, height) = header.max_block_pixel_size();
    limits::product(&[width as u64, height as u64, header.channels.bytes_per_pixel as u64, 3])
}
