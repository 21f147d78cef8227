//! Reading of image files: for comparisons, as display values, and OpenEXR as stored; for textures, in the pixel format
//! of the file.
//!
//! Sizes are checked against [`limits`] before a decoder allocates memory, and panics of decoders are caught.

use std::io::Cursor;
use std::path::Path;

use exr::meta::header::LayerAttributes;
use exr::prelude::{AttributeValue, IntegerBounds, ReadChannels, ReadLayers, Text, Vec2, read};
use image::{ColorType, DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader};

use super::write::CROP;
use super::{ColourPipeline, radiance};
use crate::error::{Error, Result, contain};
use crate::files;
use crate::limits::{self, Excess};

/// Pixels of an image file and their encoding.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue, row by row from the top.
    pub values: Vec<[f32; 3]>,
    /// Alpha per pixel; `None` if all are opaque. Colours are associated (multiplied by alpha) in OpenEXR only.
    pub alpha: Option<Vec<f32>>,
    /// Whether it is an OpenEXR image.
    pub is_exr: bool,
    /// `Linear` for linear light; otherwise display values.
    pub pipeline: ColourPipeline,
}

/// Reason why an image cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ReadError {
    /// The data is damaged or not of a supported format; a message.
    Damaged(String),
    /// The size in the header exceeds the memory limit.
    TooLarge {
        /// Size, memory needed and limit.
        what: String,
        /// Hint.
        hint: String,
    },
}

/// Calls a decoder; its panic is reported as damage, as is its error.
pub(super) fn contained<T>(parse: impl FnOnce() -> std::result::Result<T, String>) -> Read<T> {
    contain(parse)
        .unwrap_or_else(|| Err("damaged: its decoder failed".to_owned()))
        .map_err(ReadError::Damaged)
}

impl ReadError {
    /// The error for an image of `width` by `height` pixels.
    pub(crate) fn too_large(width: u64, height: u64, excess: &Excess) -> Self {
        ReadError::TooLarge {
            what: format!("a picture of {width} x {height} pixels {excess}"),
            hint: excess.hint(),
        }
    }

    /// Converts to an error for `file`.
    pub fn into_error(self, file: &Path) -> Error {
        match self {
            ReadError::Damaged(what) => Error::input(file, what, "give a .png, .jpg or .exr picture"),
            ReadError::TooLarge { what, hint } => Error::input(file, what, hint),
        }
    }
}

/// The result of decoding.
pub type Read<T> = std::result::Result<T, ReadError>;

/// Reads an image file. PNG and JPEG give display values from 0 to 1. EXR gives its channels `R`, `G` and `B` as
/// stored: linear light, unless kiln's metadata names another pipeline. The picture is its display window, black and
/// transparent outside of the data window; for a crop by kiln, nothing is known there, and it is the data window.
///
/// # Errors
/// [`Error::Input`] if the file is missing, damaged, too large, or of another format.
pub fn read_picture(file: &Path) -> Result<Pixels> {
    let bytes = files::read_file(file).map_err(|e| files::unreadable(file, &e))?;
    decode_pixels(bytes).map_err(|e| e.into_error(file))
}

/// Decodes an image as [`read_picture`] does; Radiance HDR, too, as linear light.
pub fn decode_pixels(bytes: Vec<u8>) -> Read<Pixels> {
    // The magic number of OpenEXR, Technical Introduction to OpenEXR, "File Layout".
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) { read_exr(bytes) } else { read_bytes(&bytes) }
}

fn read_bytes(bytes: &[u8]) -> Read<Pixels> {
    // Values of 8 and 16 bits are divided by their maximum.
    let picture = decode(bytes, |_| size_of::<[f32; 4]>() as u64)?;
    let alpha = alpha_of(&picture);
    let picture = picture.into_rgb32f();
    let (width, height) = picture.dimensions();
    let values = bytemuck::cast_vec(picture.into_raw());
    let pipeline =
        if radiance::is_radiance(bytes) { ColourPipeline::Linear } else { ColourPipeline::Display };
    Ok(Pixels { width, height, values, alpha, is_exr: false, pipeline })
}

/// Alpha channel of an image; `None` without one, or if it is opaque everywhere.
fn alpha_of(image: &DynamicImage) -> Option<Vec<f32>> {
    let of_8 = |alpha: u8| f32::from(alpha) / 255.0;
    let of_16 = |alpha: u16| f32::from(alpha) / 65535.0;
    let alpha: Vec<f32> = match image {
        DynamicImage::ImageLumaA8(image) => image.pixels().map(|pixel| of_8(pixel.0[1])).collect(),
        DynamicImage::ImageRgba8(image) => image.pixels().map(|pixel| of_8(pixel.0[3])).collect(),
        DynamicImage::ImageLumaA16(image) => image.pixels().map(|pixel| of_16(pixel.0[1])).collect(),
        DynamicImage::ImageRgba16(image) => image.pixels().map(|pixel| of_16(pixel.0[3])).collect(),
        DynamicImage::ImageRgba32F(image) => image.pixels().map(|pixel| pixel.0[3]).collect(),
        _ => return None,
    };
    not_opaque(alpha)
}

/// `None` if alpha is 1 everywhere.
fn not_opaque(alpha: Vec<f32>) -> Option<Vec<f32>> {
    alpha.iter().any(|&alpha| alpha != 1.0).then_some(alpha)
}

/// Decodes a PNG, JPEG, WebP, TGA, BMP, GIF (its first frame) or Radiance HDR image. `bytes_each`: bytes per pixel, by
/// image type, that the caller will allocate in addition.
pub fn decode(bytes: &[u8], bytes_each: impl Fn(ColorType) -> u64) -> Read<DynamicImage> {
    if !radiance::is_radiance(bytes) {
        return decode_stored(bytes, bytes_each);
    }
    let (header, standard) = radiance::standard(bytes).map_err(ReadError::Damaged)?;
    // Reorientation takes a second picture.
    let bytes_each = |kind| bytes_each(kind) + size_of::<[f32; 3]>() as u64;
    Ok(header.apply(decode_stored(&standard, bytes_each)?))
}

/// Maximum number of texels of an image of any file size: 8192 x 8192.
const ANY_CONTENT: u64 = 1 << 26;

/// Maximum number of texels per byte of larger images; photographs have about 8. PNG and JPEG need no such limit.
const TEXELS_A_BYTE: u64 = 256;

/// Decodes an image with the `image` crate.
fn decode_stored(bytes: &[u8], bytes_each: impl Fn(ColorType) -> u64) -> Read<DynamicImage> {
    let unsupported = || ReadError::Damaged(not_read(bytes));
    let damaged = |e: image::ImageError| match e {
        image::ImageError::Unsupported(_) => unsupported(),
        other => ReadError::Damaged(format!("damaged picture: {other}")),
    };
    let tga = is_tga(bytes).then_some(ImageFormat::Tga);
    let format = image::guess_format(bytes).ok().or(tga).ok_or_else(unsupported)?;
    if format == ImageFormat::Png
        && let Some((width, height)) = png_size(bytes)
    {
        // The decoder allocates rows before it reports a size. Decoding takes at least 1 byte per pixel, and 4 for most
        // images.
        let needed = limits::product(&[width, height, 1 + bytes_each(ColorType::L8)]);
        limits::check_claim(needed).map_err(|excess| ReadError::too_large(width, height, &excess))?;
    }
    let parse = || -> Read<DynamicImage> {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        // This limits colour profiles and text; pixels are checked below.
        let mut most = image::Limits::no_limits();
        most.max_alloc = Some(limits::MAX_CLAIM);
        reader.limits(most);
        let mut decoder = reader.into_decoder().map_err(damaged)?;
        let mut most = image::Limits::no_limits();
        let (width, height) = decoder.dimensions();
        let while_decoding = match format {
            // A progressive JPEG is stored as 16-bit coefficients, for up to 4 channels, until decoding ends.
            ImageFormat::Jpeg => 8,
            // The frame, not larger than the image.
            ImageFormat::Gif => {
                most.max_alloc = Some(decoder.total_bytes());
                4
            }
            // Indices of colours.
            ImageFormat::Tga => 2,
            _ => 0,
        };
        let _ = decoder.set_limits(most);
        let area = limits::product(&[width.into(), height.into()]);
        let each = bytes_each(decoder.color_type()) + while_decoding;
        let needed = decoder.total_bytes().saturating_add(limits::product(&[area, each]));
        limits::check_claim(needed)
            .map_err(|excess| ReadError::too_large(width.into(), height.into(), &excess))?;
        // A few bytes may encode any number of equal texels, which take long to decode.
        let most = limits::product(&[bytes.len() as u64, TEXELS_A_BYTE]).max(ANY_CONTENT);
        if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg) && area > most {
            let what = format!("{width} x {height} texels in {} bytes: damaged", bytes.len());
            return Err(ReadError::Damaged(what));
        }
        DynamicImage::from_decoder(decoder).map_err(damaged)
    };
    let picture = contain(parse)
        .unwrap_or_else(|| Err(ReadError::Damaged("damaged picture: its decoder failed".to_owned())))?;
    match picture.dimensions() {
        (0, _) | (_, 0) => Err(ReadError::Damaged("a picture without pixels".to_owned())),
        _ => Ok(picture),
    }
}

/// Whether bytes begin with a header of TGA, which has no signature: a known type of image, and unused bits of 0
/// (Truevision, TGA File Format Specification 2.0, 1991).
fn is_tga(bytes: &[u8]) -> bool {
    matches!(bytes, [_, 0 | 1, 1..=3 | 9..=11, _, _, _, _, _, _, _, _, _, _, _, _, _, _, 0..64, ..])
}

/// The message for a picture of a format that is not read.
fn not_read(bytes: &[u8]) -> String {
    let ending = image::guess_format(bytes).ok().and_then(|format| format.extensions_str().first());
    let what = match ending {
        Some(ending) => format!("a .{ending} picture, which is not read here"),
        None => "not a picture of a format that is read".to_owned(),
    };
    format!(
        "{what}; convert it to .png, for example with ImageMagick: `magick in.{} out.png`",
        ending.unwrap_or(&"psd")
    )
}

/// Width and height of a PNG, the first fields of its first chunk (PNG, third edition, 5.6 and 11.2.1).
fn png_size(bytes: &[u8]) -> Option<(u64, u64)> {
    bytes.get(12..16).filter(|name| *name == b"IHDR")?;
    let number = |at: usize| Some(u64::from(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?)));
    Some((number(16)?, number(20)?))
}

/// Reads the headers of an OpenEXR image, and checks the memory for `bytes_each` per pixel of a layer and for decoding a
/// block: compressed, decompressed, and reordered.
pub(super) fn exr_reader(
    bytes: &[u8],
    bytes_each: impl Fn(&exr::meta::header::Header) -> usize,
) -> Read<exr::block::reader::Reader<Cursor<&[u8]>>> {
    let parse = || exr::block::read(Cursor::new(bytes), false).map_err(|e| format!("damaged: {e}"));
    let reader = contained(parse)?;
    for header in reader.headers() {
        let [width, height] = [header.layer_size.width(), header.layer_size.height()].map(|side| side as u64);
        let Vec2(block_width, block_height) = header.max_block_pixel_size();
        let of_block = [block_width, block_height, header.channels.bytes_per_pixel, 3].map(|n| n as u64);
        let needed = limits::product(&[width, height, bytes_each(header) as u64]);
        limits::check_claim(needed.saturating_add(limits::product(&of_block)))
            .map_err(|excess| ReadError::too_large(width, height, &excess))?;
    }
    Ok(reader)
}

/// Whether a layer is a crop by kiln: a part of a picture of which nothing else is known.
fn is_crop(layer: &LayerAttributes) -> bool {
    layer.other.contains_key(&Text::from(CROP))
}

/// Checks the memory limit for the display window of an OpenEXR image.
fn check_display(bytes: &[u8]) -> Read<()> {
    let reader = exr_reader(bytes, |_| size_of::<[f32; 4]>())?;
    for header in reader.headers().iter().filter(|header| !is_crop(&header.own_attributes)) {
        let Vec2(width, height) = header.shared_attributes.display_window.size;
        let (width, height) = (width as u64, height as u64);
        let bytes = limits::product(&[width, height, size_of::<[f32; 4]>() as u64]);
        limits::check_claim(bytes).map_err(|excess| ReadError::too_large(width, height, &excess))?;
        if width == 0 || height == 0 || width.max(height) > u64::from(u32::MAX) {
            return Err(ReadError::Damaged("its display window has no pixels".to_owned()));
        }
    }
    Ok(())
}

/// Copies `rows` into a window of `size` that begins `offset` pixels right of and below them; 0 elsewhere.
fn in_window<T: Copy + Default>(rows: &[T], width: usize, offset: [i64; 2], size: [usize; 2]) -> Vec<T> {
    let mut pixels = vec![T::default(); size[0] * size[1]];
    let height = rows.len().checked_div(width).unwrap_or(0);
    // Start of the overlap in the window and in `rows`, and its length.
    let overlap = |axis: usize, side: usize| {
        let (to, from) = ((-offset[axis]).max(0) as usize, offset[axis].max(0) as usize);
        (to, from, size[axis].saturating_sub(to).min(side.saturating_sub(from)))
    };
    let ((left, first, columns), (top, first_row, lines)) = (overlap(0, width), overlap(1, height));
    for line in (0..lines).filter(|_| columns > 0) {
        let source = &rows[(first_row + line) * width + first..][..columns];
        pixels[(top + line) * size[0] + left..][..columns].copy_from_slice(source);
    }
    pixels
}

fn read_exr(bytes: Vec<u8>) -> Read<Pixels> {
    type Rows = (usize, Vec<[f32; 3]>, Vec<f32>);
    // Any layer may be the one with the channels.
    check_display(&bytes)?;
    let parse = || {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                |size, _| -> Rows { (size.width(), vec![[0.0; 3]; size.area()], vec![1.0; size.area()]) },
                |(width, rows, alpha): &mut Rows, at, (r, g, b, a): (f32, f32, f32, f32)| {
                    rows[at.y() * *width + at.x()] = [r, g, b];
                    alpha[at.y() * *width + at.x()] = a;
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| format!("damaged, or without the channels R, G and B: {e}"))
    };
    let picture = contained(parse)?;
    let layer = picture.layer_data;
    let said = layer.attributes.other.get(&Text::from("kiln:colour"));
    let display = matches!(said, Some(AttributeValue::Text(name)) if name.eq("display") || name.eq("u8"));
    let at = layer.attributes.layer_position;
    let shown = match is_crop(&layer.attributes) {
        true => IntegerBounds::new(at, layer.size),
        false => picture.attributes.display_window,
    };
    let (_, mut values, mut alpha) = layer.channel_data.pixels;
    if (shown.size, shown.position) != (layer.size, at) {
        let offset = [[shown.position.0, at.0], [shown.position.1, at.1]];
        let offset = offset.map(|[shown, data]| i64::from(shown) - i64::from(data));
        let (width, size) = (layer.size.width(), [shown.size.0, shown.size.1]);
        values = in_window(&values, width, offset, size);
        alpha = in_window(&alpha, width, offset, size);
    }
    Ok(Pixels {
        width: shown.size.0 as u32,
        height: shown.size.1 as u32,
        values,
        alpha: not_opaque(alpha),
        is_exr: true,
        pipeline: if display { ColourPipeline::Display } else { ColourPipeline::Linear },
    })
}
