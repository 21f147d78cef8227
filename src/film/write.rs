//! Image file writers: PNG, JPEG and OpenEXR, with the render settings as metadata.

use std::io::{Seek, Write};
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, WritableImage, f16};

use super::rounding::{Level, Rounding, bits_of_alpha, dither, quantise};
use super::{ColourPipeline, DisplayTransform, ExrAttributes, Film, Window};
use crate::error::{Error, Result};
use crate::files::write_whole;

/// The image formats that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 8 or 16 bits per channel, lossless, metadata in text chunks.
    Png,
    /// 8 bits per channel, quality 95.
    Jpeg,
    /// Floating point of 32 bits, or of 16 for colours, in the encoding of the film.
    Exr,
}

impl Format {
    /// The format for the extension of a file name.
    ///
    /// # Errors
    /// [`Error::Usage`] if the extension is missing or not supported.
    pub fn from_path(file: &Path) -> Result<Self> {
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("");
        Format::from_ending(ending).ok_or_else(|| {
            let is_film = ["mp4", "m4v", "gif", "y4m", "webm", "mov", "mkv", "avi"].contains(&ending.to_ascii_lowercase().as_str());
            let hint = match is_film {
                true => "`kiln animate` makes films: .mp4, .gif, animated .png; a picture ends in .png, .jpg or .exr",
                false => "name a file that ends in .png, .jpg or .exr",
            };
            Error::usage(format!("{}: not a picture format that can be written", file.display()), hint)
        })
    }

    /// The format for the ending of a file name, such as `png`.
    pub fn from_ending(ending: &str) -> Option<Self> {
        match ending.to_ascii_lowercase().as_str() {
            "png" => Some(Format::Png),
            "jpg" | "jpeg" => Some(Format::Jpeg),
            "exr" => Some(Format::Exr),
            _ => None,
        }
    }
}

/// Metadata key of the fingerprint: the hash of everything that determines the picture except the frame.
pub const FINGERPRINT: &str = "kiln:fingerprint";

/// Metadata key of the region of a picture that is a part of another.
pub const CROP: &str = "kiln:crop";

/// Metadata key of the frame number in an animation.
pub const FRAME: &str = "kiln:frame";

/// Metadata of a picture: names and values of the settings that made it.
pub type Metadata = [(String, String)];

/// A rendered picture in the pixel format of its file.
pub enum OutputImage {
    /// 8-bit display values for PNG or JPEG, and the pipeline that they come from.
    Rgb8(Film<[u8; 3]>, ColourPipeline),
    /// The same with alpha, row by row from the top, for PNG. Colours are not multiplied by it.
    Rgba8(Film<[u8; 3]>, Vec<u8>, ColourPipeline),
    /// 16-bit display values for PNG.
    Rgb16(Film<[u16; 3]>, ColourPipeline),
    /// The same with alpha.
    Rgba16(Film<[u16; 3]>, Vec<u16>, ColourPipeline),
    /// Floating-point values for OpenEXR, further channels, and what the file states of them.
    Float(Film, Vec<Channel>, ExrAttributes),
}

impl OutputImage {
    /// The display values of a picture, rounded as `display` says, on the current rayon pool. With alpha, row by row from
    /// the top, the picture is on a black background, and its colours are divided by alpha before they are displayed.
    ///
    /// # Errors
    /// As those of [`Film::new`].
    pub fn displayed(
        film: &Film,
        alpha: Option<&[f32]>,
        pipeline: ColourPipeline,
        display: DisplayTransform,
    ) -> Result<Self> {
        Ok(match (alpha, display.rounding().is_16_bit) {
            (None, false) => OutputImage::Rgb8(film.developed(pipeline, display)?, pipeline),
            (None, true) => OutputImage::Rgb16(film.developed(pipeline, display)?, pipeline),
            (Some(alpha), false) => {
                let (colours, alpha) = unassociated(film, alpha, pipeline, display)?;
                OutputImage::Rgba8(colours, alpha, pipeline)
            }
            (Some(alpha), true) => {
                let (colours, alpha) = unassociated(film, alpha, pipeline, display)?;
                OutputImage::Rgba16(colours, alpha, pipeline)
            }
        })
    }

    /// Whether the picture has an alpha channel beside display values.
    pub fn is_rgba(&self) -> bool {
        matches!(self, OutputImage::Rgba8(..) | OutputImage::Rgba16(..))
    }
}

/// Display values of the colours of a picture divided by alpha, and of alpha.
fn unassociated<L: Level>(
    film: &Film,
    alpha: &[f32],
    pipeline: ColourPipeline,
    display: DisplayTransform,
) -> Result<(Film<[L; 3]>, Vec<L>)> {
    let straight = |(pixel, &alpha): ([f32; 3], &f32)| match alpha > 0.0 {
        true if DisplayTransform::is_kept(pixel) => pixel,
        true => pixel.map(|channel| channel / alpha),
        false => [0.0; 3],
    };
    let window = film.window();
    let pixels: Vec<[f32; 3]> = film.rows().zip(alpha).map(straight).collect();
    let colours = Film::from_rows(window, &pixels)?.developed(pipeline, display)?;
    let rounded = |(index, &alpha): (u32, &f32)| match display.rounding().is_dithered {
        true => dither(alpha.into(), bits_of_alpha(window.place(index))),
        false => quantise(alpha.into()),
    };
    Ok((colours, (0..).zip(alpha).map(rounded).collect()))
}

/// The name of the alpha channel.
pub const ALPHA: &str = "A";

/// The name of the depth channel. In a file, `Z`, by which programs find the depth of a picture, has its values, too.
pub const DEPTH: &str = "Depth.Z";

/// A further channel: one value per pixel, row by row from the top.
pub struct Channel {
    /// Name, `LAYER.CHANNEL` as in OpenEXR.
    pub name: String,
    /// Values.
    pub values: Vec<f32>,
}

/// Writes a picture to `file` atomically.
///
/// # Errors
/// [`Error::Output`] if the file cannot be written.
pub fn write_picture(picture: &OutputImage, metadata: &Metadata, format: Format, file: &Path) -> Result<()> {
    write_whole(file, |out| encode(picture, metadata, format, out))
}

/// Encodes a picture to a stream: floating point as OpenEXR, 8 bits as PNG or JPEG, 16 bits or alpha as PNG.
///
/// # Errors
/// Errors of the stream; [`std::io::ErrorKind::InvalidInput`] for a picture that the format cannot hold.
pub fn encode(
    picture: &OutputImage,
    metadata: &Metadata,
    format: Format,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let unfit = |what: &str| Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what));
    match (picture, format) {
        (OutputImage::Rgb8(film, _), Format::Jpeg) => write_jpeg(film, out),
        (OutputImage::Float(film, more, attributes), Format::Exr) => {
            write_exr(film, more, attributes, metadata, out)
        }
        (OutputImage::Float(..), Format::Png | Format::Jpeg) => {
            unfit("a picture in floating point, and the format has integers; write .exr, or render 8 bits")
        }
        (_, Format::Png) => write_png(picture, metadata, out),
        (OutputImage::Rgb16(..), Format::Jpeg) => unfit("JPEG has 8 bits per channel; write .png, or 8 bits"),
        (OutputImage::Rgba8(..) | OutputImage::Rgba16(..), Format::Jpeg) => {
            unfit("JPEG has no alpha channel for a transparent background; write .png or .exr")
        }
        (_, Format::Exr) => unfit(
            "a picture of integers, and OpenEXR has floating point; write .png, or render floating point",
        ),
    }
}

/// Maximum bytes per pixel that encoding allocates in addition to the picture with `channels` further channels.
pub fn bytes_per_pixel(format: Format, channels: u64) -> u64 {
    match format {
        // PNG is encoded row by row.
        Format::Png => 0,
        // JPEG needs all rows in one buffer.
        Format::Jpeg => 3,
        // OpenEXR needs a buffer per channel and for the second one of the depth, and one for the file, which
        // compression does not enlarge.
        Format::Exr => 2 * 4 * (3 + channels + 1),
    }
}

/// How PNG stores a picture: its type of colour, its bits, and whether it is sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PngForm {
    has_alpha: bool,
    is_16_bit: bool,
    is_srgb: bool,
}

impl PngForm {
    /// The form of a picture of display values from a pipeline.
    pub fn new(has_alpha: bool, rounding: Rounding, pipeline: ColourPipeline) -> Self {
        PngForm { has_alpha, is_16_bit: rounding.is_16_bit, is_srgb: pipeline == ColourPipeline::Linear }
    }

    /// An encoder of pictures of `size`.
    pub(crate) fn encoder<'a, W: Write>(self, out: W, [width, height]: [u32; 2]) -> png::Encoder<'a, W> {
        let mut encoder = png::Encoder::new(out, width, height);
        encoder.set_color(if self.has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
        encoder.set_depth(if self.is_16_bit { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
        encoder.set_compression(png::Compression::Fast);
        if self.is_srgb {
            encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
        }
        encoder
    }
}

impl OutputImage {
    /// Size, and the form in PNG; `None` for floating-point pictures.
    pub(crate) fn png_form(&self) -> Option<([u32; 2], PngForm)> {
        let form = |window: Window, has_alpha, is_16_bit, pipeline: &ColourPipeline| {
            let rounding = Rounding { is_16_bit, is_dithered: false };
            Some(([window.width, window.height], PngForm::new(has_alpha, rounding, *pipeline)))
        };
        match self {
            OutputImage::Rgb8(film, pipeline) => form(film.window(), false, false, pipeline),
            OutputImage::Rgba8(film, _, pipeline) => form(film.window(), true, false, pipeline),
            OutputImage::Rgb16(film, pipeline) => form(film.window(), false, true, pipeline),
            OutputImage::Rgba16(film, _, pipeline) => form(film.window(), true, true, pipeline),
            OutputImage::Float(..) => None,
        }
    }

    /// Calls `write` with the bytes of each row as in PNG, from the top: red, green, blue and, if there is one, alpha of
    /// each pixel, 16 bits with the high byte first. A picture in floating point has no rows.
    ///
    /// # Errors
    /// Those of `write`.
    pub(crate) fn png_rows(&self, write: impl FnMut(&[u8]) -> std::io::Result<()>) -> std::io::Result<()> {
        match self {
            OutputImage::Rgb8(film, _) => png_rows(film, None, |c| [c], write),
            OutputImage::Rgba8(film, alpha, _) => png_rows(film, Some(alpha), |c| [c], write),
            OutputImage::Rgb16(film, _) => png_rows(film, None, u16::to_be_bytes, write),
            OutputImage::Rgba16(film, alpha, _) => png_rows(film, Some(alpha), u16::to_be_bytes, write),
            OutputImage::Float(..) => Ok(()),
        }
    }
}

fn png_rows<L: Level, const BYTES: usize>(
    film: &Film<[L; 3]>,
    alpha: Option<&[L]>,
    to_bytes: impl Fn(L) -> [u8; BYTES],
    mut write: impl FnMut(&[u8]) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let Window { width, height, .. } = film.window();
    let mut row = Vec::with_capacity(width as usize * 4 * BYTES);
    for y in 0..height {
        row.clear();
        let pixels = film.row(y).flatten();
        match alpha {
            None => pixels.for_each(|pixel| row.extend(pixel.iter().flat_map(|&c| to_bytes(c)))),
            Some(alpha) => {
                let alpha = &alpha[y as usize * width as usize..];
                for (pixel, &alpha) in pixels.zip(alpha) {
                    row.extend(pixel.iter().chain([&alpha]).flat_map(|&c| to_bytes(c)));
                }
            }
        }
        write(&row)?;
    }
    Ok(())
}

/// Writes a picture of display values.
fn write_png(picture: &OutputImage, metadata: &Metadata, out: &mut dyn Write) -> std::io::Result<()> {
    let Some((size, form)) = picture.png_form() else { return Ok(()) };
    let mut encoder = form.encoder(out, size);
    for (key, value) in metadata {
        encoder.add_itxt_chunk(key.clone(), value.clone())?;
    }
    let mut writer = encoder.write_header()?;
    // Encoding row by row avoids a copy of the picture.
    let mut rows = writer.stream_writer()?;
    picture.png_rows(|row| rows.write_all(row))?;
    rows.finish()?;
    writer.finish()?;
    Ok(())
}

fn write_jpeg(film: &Film<[u8; 3]>, out: &mut dyn Write) -> std::io::Result<()> {
    let window = film.window();
    image::codecs::jpeg::JpegEncoder::new_with_quality(out, 95)
        .encode(&film.bytes(), window.width, window.height, image::ExtendedColorType::Rgb8)
        .map_err(std::io::Error::other)
}

/// Whether a channel holds colours or alpha, whose values half floats represent well enough for pictures. Variances are
/// squares of small numbers; all other channels are data: lengths, vectors, indices, ids.
fn is_colour(name: &str) -> bool {
    let letter = name.rsplit('.').next().unwrap_or(name);
    ["R", "G", "B", ALPHA].contains(&letter) && !name.starts_with("Variance.")
}

/// The nearest half floats; finite values beyond the largest one become that.
fn half_floats(values: &[f32]) -> Vec<f16> {
    let largest = f32::from(f16::MAX);
    let limited = |value: f32| if value.is_finite() { value.clamp(-largest, largest) } else { value };
    values.iter().map(|&value| f16::from_f32(limited(value))).collect()
}

fn write_exr(
    film: &Film,
    more: &[Channel],
    attributes: &ExrAttributes,
    metadata: &Metadata,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let window = film.window();
    let (of_image, of_layer) = attributes.header(window, metadata);
    let channel = |name: &str, values: Vec<f32>| {
        let is_half = attributes.has_half_floats && is_colour(name);
        let samples = if is_half { FlatSamples::F16(half_floats(&values)) } else { FlatSamples::F32(values) };
        AnyChannel::new(name, samples)
    };
    let own = ["R", "G", "B"].into_iter().enumerate();
    let own = own.map(|(c, name)| channel(name, film.rows().map(|pixel| pixel[c]).collect()));
    let depth = more.iter().filter(|more| more.name == DEPTH).map(|depth| channel("Z", depth.values.clone()));
    let more = more.iter().map(|more| channel(&more.name, more.values.clone())).chain(depth);
    let channels = AnyChannels::sort(own.chain(more).collect());
    let size = (window.width as usize, window.height as usize);
    let layer = Layer::new(size, of_layer, Encoding::SMALL_LOSSLESS, channels);
    let picture = Image::new(of_image, layer);
    // The writer seeks back to the offset table, which `out` may not support.
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write().to_buffered(&mut bytes).map_err(std::io::Error::other)?;
    bytes.rewind()?;
    let mut bytes = bytes.into_inner();
    sort_header(&mut bytes);
    out.write_all(&bytes)
}

/// Sorts the attributes in the single header of an EXR file by name, because the writer's order, of a hash map, is not
/// deterministic. Nothing else changes. Technical Introduction to OpenEXR, "File Layout": magic number and version,
/// four bytes each, then attributes (name, 0, type, 0, size in four bytes, value) and a 0.
fn sort_header(bytes: &mut [u8]) {
    const START: usize = 8;
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut rest = &bytes[START..];
    while rest.first().is_some_and(|&first| first != 0) {
        let text = |from: usize| rest[from..].iter().position(|&b| b == 0).map(|end| from + end + 1);
        let Some(size_at) = text(0).and_then(text) else { return };
        let Some(size) = rest.get(size_at..size_at + 4) else { return };
        let size = u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
        let Some((attribute, after)) = rest.split_at_checked(size_at + 4 + size) else { return };
        attributes.push(attribute);
        rest = after;
    }
    attributes.sort_unstable();
    let sorted = attributes.concat();
    bytes[START..START + sorted.len()].copy_from_slice(&sorted);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The format of the bytes is always that of the file name.
    #[test]
    fn formats_that_cannot_hold_a_picture_are_errors() {
        let window = Window { x: 0, y: 0, width: 1, height: 1 };
        let wide = || Film::from_rows(window, &[[0; 3]]).unwrap();
        let bytes = || Film::from_rows(window, &[[0; 3]]).unwrap();
        let linear = ColourPipeline::Linear;
        let pictures = [
            OutputImage::Rgb8(bytes(), linear),
            OutputImage::Rgba8(bytes(), vec![0], linear),
            OutputImage::Rgb16(wide(), linear),
            OutputImage::Rgba16(wide(), vec![0], linear),
            OutputImage::Float(
                Film::from_rows(window, &[[0.0; 3]]).unwrap(),
                Vec::new(),
                ExrAttributes::of_size([1, 1]),
            ),
        ];
        let held = pictures.each_ref().map(|picture| {
            [Format::Png, Format::Jpeg, Format::Exr].map(|format| {
                let mut out = Vec::new();
                let made = encode(picture, &Vec::new(), format, &mut out);
                assert_eq!(made.is_ok(), !out.is_empty(), "{made:?}");
                made.is_ok()
            })
        });
        let png = [true, false, false];
        assert_eq!(held, [[true, true, false], png, png, png, [false, false, true]]);
    }

    #[test]
    fn headers_are_sorted_and_nothing_else_is_touched() {
        let attribute = |name: &str, value: &[u8]| -> Vec<u8> {
            let size = (value.len() as u32).to_le_bytes();
            [name.as_bytes(), b"\0string\0", size.as_slice(), value].concat()
        };
        let (a, b, c) = (attribute("a", b"zz\0"), attribute("b", b""), attribute("c", b"x"));
        let file = |parts: [&[u8]; 3]| [b"magicver", parts[0], parts[1], parts[2], b"\0zap"].concat();
        let mut mixed = file([&c, &a, &b]);
        sort_header(&mut mixed);
        assert_eq!(mixed, file([&a, &b, &c]));
        // A truncated header is unchanged.
        let mut broken = b"magicverc\0string\0\xff\0\0\0".to_vec();
        let before = broken.clone();
        sort_header(&mut broken);
        assert_eq!(broken, before);
    }
}
