//! Pictures: PNG, JPEG and OpenEXR, each with the settings that made it.

use std::io::{Seek, Write};
use std::path::Path;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, Text, WritableImage};

use super::output::write_whole;
use super::{ColourPipeline, Film};
use crate::error::{Error, Result};

/// The picture formats that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 8 bits a channel, lossless, metadata in text chunks.
    Png,
    /// 8 bits a channel, quality 95.
    Jpeg,
    /// 32-bit floating point: the film's own numbers.
    Exr,
}

impl Format {
    /// The format that a file name's ending asks for.
    ///
    /// # Errors
    /// [`Error::Usage`] when the ending is missing or not one that can be written.
    pub fn from_path(file: &Path) -> Result<Self> {
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        match ending.as_str() {
            "png" => Ok(Format::Png),
            "jpg" | "jpeg" => Ok(Format::Jpeg),
            "exr" => Ok(Format::Exr),
            _ => Err(Error::usage(
                format!("{}: not a picture format that can be written", file.display()),
                "name a file that ends in .png, .jpg or .exr",
            )),
        }
    }
}

/// The settings that made a picture, as names and values, to be kept in its metadata.
pub type Metadata = [(String, String)];

/// A rendered picture, in what its format keeps of a pixel.
pub enum Picture {
    /// 8-bit display values, to be written as PNG or JPEG, with the pipeline that they come from.
    Bytes(Film<[u8; 3]>, ColourPipeline),
    /// The film's own numbers, to be written as OpenEXR.
    Numbers(Film),
}

/// Writes a picture to `file`, whole or not at all.
///
/// # Errors
/// [`Error::Output`] when the file cannot be written.
pub fn write_picture(picture: &Picture, metadata: &Metadata, format: Format, file: &Path) -> Result<()> {
    write_whole(file, |out| encode(picture, metadata, format, out))
}

/// Writes a picture to any stream: numbers as OpenEXR, bytes as JPEG where `format` says so and as PNG otherwise.
///
/// # Errors
/// Those of the stream.
pub fn encode(
    picture: &Picture,
    metadata: &Metadata,
    format: Format,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    match picture {
        Picture::Bytes(film, _) if format == Format::Jpeg => write_jpeg(film, out),
        Picture::Bytes(film, pipeline) => write_png(film, *pipeline, metadata, out),
        Picture::Numbers(film) => write_exr(film, metadata, out),
    }
}

fn write_png(
    film: &Film<[u8; 3]>,
    pipeline: ColourPipeline,
    metadata: &Metadata,
    out: impl Write,
) -> std::io::Result<()> {
    let window = film.window();
    let mut encoder = png::Encoder::new(out, window.width, window.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    if pipeline == ColourPipeline::Linear {
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    }
    for (key, value) in metadata {
        encoder.add_itxt_chunk(key.clone(), value.clone())?;
    }
    let mut writer = encoder.write_header()?;
    // Row by row: the picture is not copied as a whole.
    let mut rows = writer.stream_writer()?;
    let mut row = Vec::with_capacity(window.width as usize * 3);
    for y in 0..window.height {
        row.clear();
        film.row(y).for_each(|part| row.extend_from_slice(part.as_flattened()));
        rows.write_all(&row)?;
    }
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

fn write_exr(film: &Film, metadata: &Metadata, out: &mut dyn Write) -> std::io::Result<()> {
    let window = film.window();
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = film.pixel(at.x() as u32, at.y() as u32);
        (r, g, b)
    });
    let mut attributes = LayerAttributes::named("kiln");
    for (key, value) in metadata {
        // Text of other alphabets is kept as UTF-8; OpenEXR does not say what the bytes of a text mean.
        let text = Text::from_slice_unchecked(value.as_bytes());
        let value = exr::meta::attribute::AttributeValue::Text(text);
        attributes.other.insert(Text::from_slice_unchecked(key.as_bytes()), value);
    }
    let size = (window.width as usize, window.height as usize);
    let picture = Image::from_layer(Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels));
    // The format wants to seek back to its offset table, a stream need not be able to.
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write().to_buffered(&mut bytes).map_err(std::io::Error::other)?;
    bytes.rewind()?;
    out.write_all(bytes.get_ref())
}
