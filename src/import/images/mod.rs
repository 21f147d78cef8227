//! Texture images: each file is decoded once; materials do without images that cannot be decoded.

pub(crate) mod environment;
pub(crate) mod heights;
#[cfg(feature = "codecs")]
pub(crate) mod ktx2;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, GenericImageView, ImageBuffer, Pixel};

use super::Source;
use crate::error::{Error, Place, Result, Warnings};
use crate::files;
use crate::film::read::{self, ReadError};
use crate::import::files::dependencies::Files;
use crate::import::images::heights::normals_of_heights;
use crate::limits::{self, Counted};
use crate::scene::{DecodedImage, ImageId, Scene, TexelValues};

/// What of an image becomes a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Channels {
    /// Its colours, without alpha.
    Colour,
    /// Its alpha channel, or its grey values where it is opaque everywhere.
    AlphaOrGrey,
}

/// Decodes image files into a scene, each once.
pub(crate) struct ImageLoader<'a> {
    source: &'a Source,
    known: HashMap<(PathBuf, Channels), Option<ImageId>>,
    /// Roughness and metallic in one image, by the images of each.
    combined: HashMap<[Option<ImageId>; 2], ImageId>,
    /// Normal maps converted from height maps, with the steepest slope of each; `None` for a file that is a normal map.
    heights: HashMap<PathBuf, Option<(ImageId, f64)>>,
}

impl<'a> ImageLoader<'a> {
    /// A loader for the images referenced by `source`.
    pub(crate) fn new(source: &'a Source) -> Self {
        ImageLoader { source, known: HashMap::new(), combined: HashMap::new(), heights: HashMap::new() }
    }

    /// Loads an image file; returns `None` with a warning if it is missing or cannot be decoded.
    ///
    /// # Errors
    /// [`Error::Input`] if it exceeds the memory limit, so that the rendered picture does not depend on the machine's
    /// memory.
    pub(crate) fn of_file(
        &mut self,
        scene: &mut Scene,
        file: &Path,
        channels: Channels,
        warnings: &mut Warnings,
    ) -> Result<Option<ImageId>> {
        let key = (file.to_owned(), channels);
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let name = match channels {
            Channels::Colour => file.display().to_string(),
            Channels::AlphaOrGrey => format!("{}, alpha or grey", file.display()),
        };
        let decode = || {
            open(&self.source.files, file, texture_bytes).map(|image| into_texture(&name, &image, channels))
        };
        let decoded = self.source.files.image(&name).map_or_else(decode, Ok);
        let image = keep(scene, self.source, decoded, file, warnings)?;
        self.known.insert(key, image);
        Ok(image)
    }

    /// Loads a bump map; returns it as a normal map with the factor of its x and y. A grey image is a height map; a
    /// coloured one is taken as a normal map, which some exporters also write under this key.
    pub(crate) fn bump_of_file(
        &mut self,
        scene: &mut Scene,
        file: &Path,
        warnings: &mut Warnings,
    ) -> Result<Option<(ImageId, f64)>> {
        let heights = match self.heights.get(file) {
            Some(known) => *known,
            None => {
                let grey = match open(&self.source.files, file, height_bytes) {
                    Ok(image) => Some(image).filter(is_grey),
                    Err(ReadError::TooLarge { what, hint }) => return Err(Error::input(file, what, hint)),
                    // `of_file` warns below.
                    Err(ReadError::Damaged(_)) => None,
                };
                let made = grey.map(|image| {
                    let (image, steepest) = of_heights(&format!("{}, normals", file.display()), image);
                    (scene.add_image(image), steepest)
                });
                self.heights.insert(file.to_owned(), made);
                made
            }
        };
        if heights.is_some() {
            return Ok(heights);
        }
        let Some(image) = self.of_file(scene, file, Channels::Colour, warnings)? else { return Ok(None) };
        warnings.note(format!("{}: a bump map in colours; taken as a normal map", file.display()));
        Ok(Some((image, 1.0)))
    }
}

impl ImageLoader<'_> {
    /// Puts the red values of a roughness and a metallic image into green and blue of one image, as large as the larger
    /// of both; of an image that is not given 1. Two times the same image is that image.
    ///
    /// # Errors
    /// [`Error::Input`], for the file that names them, if it exceeds the memory limit.
    pub(crate) fn metallic_roughness(
        &mut self,
        scene: &mut Scene,
        roughness: Option<ImageId>,
        metallic: Option<ImageId>,
        file: &Path,
    ) -> Result<Option<ImageId>> {
        if roughness == metallic {
            return Ok(roughness);
        }
        if let Some(&known) = self.combined.get(&[roughness, metallic]) {
            return Ok(Some(known));
        }
        let image = |id: Option<ImageId>| id.map(|id| scene.images[id.0 as usize].clone());
        let parts = [image(roughness), image(metallic)];
        let most = |side: fn(&DecodedImage) -> u32| parts.iter().flatten().map(side).max().unwrap_or(1);
        let (width, height) = (most(|image| image.width), most(|image| image.height));
        let largest =
            parts.iter().flatten().map(|part| part.pixels.largest()).max().unwrap_or(u8::MAX.into());
        let each = if largest > u8::MAX.into() { 6 } else { 3 };
        limits::check_claim(limits::product(&[width.into(), height.into(), each])).map_err(|excess| {
            excess.at(file, format!("a picture of roughness and metallic of {width} x {height} pixels"))
        })?;
        // The nearest texel of an image that is smaller.
        let value = |part: &Option<DecodedImage>, x: u32, y: u32| {
            let Some(part) = part else { return largest };
            let scaled =
                |at: u32, side: u32, of: u32| (u64::from(at) * u64::from(of) / u64::from(side)) as usize;
            let (column, row) = (scaled(x, width, part.width), scaled(y, height, part.height));
            // 65535 is 257 times 255.
            part.pixels.get(row * part.width as usize + column)[0] * (largest / part.pixels.largest())
        };
        let texel = |i: usize| {
            let (x, y) = (i as u32 % width, i as u32 / width);
            [largest, value(&parts[0], x, y), value(&parts[1], x, y)]
        };
        let pixels = TexelValues::collect(largest, width as usize * height as usize, texel);
        let names: Vec<&str> = parts.iter().flatten().map(|part| part.name.as_str()).collect();
        let name = names.join(" and ");
        let made = scene.add_image(DecodedImage { name, width, height, pixels });
        self.combined.insert([roughness, metallic], made);
        Ok(Some(made))
    }
}

/// Bytes per pixel of a texture in addition to the decoded image; floating-point images are converted first.
fn texture_bytes(image: ColorType) -> u64 {
    match image.bytes_per_pixel() / image.channel_count() {
        1 => 3,
        2 => 6,
        _ => 8 + 6,
    }
}

/// Bytes per pixel of a height map: 16-bit heights and the texture.
fn height_bytes(image: ColorType) -> u64 {
    2 + texture_bytes(image)
}

fn open(
    files: &Files,
    file: &Path,
    bytes_each: impl Fn(ColorType) -> u64,
) -> std::result::Result<DynamicImage, ReadError> {
    let read = if files.skips_images { files.open(file).map(|_| Vec::new()) } else { files.read(file) };
    let bytes = read.map_err(|e| ReadError::Damaged(files::explain(&e).0))?;
    decode(&bytes, bytes_each)
}

/// Decodes an image. `bytes_each`: bytes per pixel, by image type, that the caller will allocate in addition.
fn decode(
    bytes: &[u8],
    bytes_each: impl Fn(ColorType) -> u64,
) -> std::result::Result<DynamicImage, ReadError> {
    #[cfg(feature = "codecs")]
    if crate::import::images::ktx2::is_ktx2(bytes) {
        return crate::import::images::ktx2::decode(bytes, bytes_each(ColorType::Rgba8));
    }
    read::decode(bytes, bytes_each)
}

fn is_grey(image: &DynamicImage) -> bool {
    let mut pixels = image.pixels().map(|(_, _, p)| p.0);
    !image.color().has_color() || pixels.all(|[r, g, b, _]| r == g && g == b)
}

fn of_heights(name: &str, image: DynamicImage) -> (DecodedImage, f64) {
    let largest = if texture_bytes(image.color()) > 3 { u16::MAX } else { u8::MAX.into() };
    let grey = image.into_luma16();
    let (width, height) = grey.dimensions();
    let heights = grey.into_raw();
    let made =
        normals_of_heights(|i| f64::from(heights[i]) / 65535.0, width as usize, height as usize, largest);
    (DecodedImage { name: name.to_owned(), width, height, pixels: made.texels }, made.steepest)
}

/// Decodes an image in memory; returns `None` with a warning if that fails. `place` is named in messages.
pub(crate) fn of_bytes(
    scene: &mut Scene,
    source: &Source,
    place: Place,
    bytes: &[u8],
    warnings: &mut Warnings,
) -> Result<Option<ImageId>> {
    if source.files.skips_images {
        return Ok(None);
    }
    let name = place.to_string();
    let decode = || decode(bytes, texture_bytes).map(|image| into_texture(&name, &image, Channels::Colour));
    let decoded = source.files.image(&name).map_or_else(decode, Ok);
    keep(scene, source, decoded, place, warnings)
}

/// Decodes the alpha channel of an image in memory into a grey image called `name`, mapped by `value(alpha, largest)`.
/// Returns `None` if the image is opaque or cannot be decoded, of which [`of_bytes`] warns.
pub(crate) fn alpha_of_bytes(
    scene: &mut Scene,
    place: Place,
    name: String,
    bytes: &[u8],
    value: impl Fn(u16, u16) -> u16,
) -> Result<Option<ImageId>> {
    // The alpha channel, and its mapped values.
    let image = match decode(bytes, |image| 2 * texture_bytes(image)) {
        Ok(image) => image,
        Err(ReadError::TooLarge { what, hint }) => return Err(Error::input(place, what, hint)),
        Err(ReadError::Damaged(_)) => return Ok(None),
    };
    if !image.color().has_alpha() {
        return Ok(None);
    }
    let (width, height) = image.dimensions();
    let alpha = texels_of(&image, Picked::Alpha);
    if !is_transparent(&alpha) {
        return Ok(None);
    }
    let largest = alpha.largest();
    let pixels = TexelValues::collect(largest, alpha.len(), |i| alpha.get(i).map(|a| value(a, largest)));
    Ok(Some(scene.add_image(DecodedImage { name, width, height, pixels })))
}

fn keep(
    scene: &mut Scene,
    source: &Source,
    decoded: std::result::Result<DecodedImage, ReadError>,
    place: impl Into<Place>,
    warnings: &mut Warnings,
) -> Result<Option<ImageId>> {
    match decoded {
        Ok(image) => {
            let before: u64 = scene.images.iter().map(|image| image.pixels.len() as u64).sum();
            let texels = before.saturating_add(image.pixels.len() as u64);
            Counted::Texels.check(texels, &source.options.limits, place)?;
            Ok(Some(scene.add_image(image)))
        }
        Err(ReadError::TooLarge { what, hint }) => Err(Error::input(place, what, hint)),
        Err(ReadError::Damaged(why)) => {
            warnings.left_out_file(format!("{}: texture left out: {why}", place.into()));
            Ok(None)
        }
    }
}

fn into_texture(name: &str, image: &DynamicImage, channels: Channels) -> DecodedImage {
    let (width, height) = image.dimensions();
    let made = |pixels| DecodedImage { name: name.to_owned(), width, height, pixels };
    made(match channels {
        Channels::Colour => texels_of(image, Picked::Colour),
        Channels::AlphaOrGrey => {
            let alpha = image.color().has_alpha().then(|| texels_of(image, Picked::Alpha));
            alpha.filter(is_transparent).unwrap_or_else(|| texels_of(image, Picked::Grey))
        }
    })
}

/// Whether any texel is below 1.
fn is_transparent(alpha: &TexelValues) -> bool {
    alpha.iter().any(|texel| texel[0] < alpha.largest())
}

/// Channel of an image that becomes a texture.
#[derive(Debug, Clone, Copy)]
enum Picked {
    Colour,
    Alpha,
    Grey,
}

/// Texels of an image in the bit depth of its file; floating-point values in 16 bits.
fn texels_of(image: &DynamicImage, picked: Picked) -> TexelValues {
    fn of<P: Pixel>(image: &ImageBuffer<P, Vec<P::Subpixel>>, picked: Picked) -> TexelValues
    where
        TexelValues: FromIterator<[P::Subpixel; 3]>,
    {
        // The iterator has an exact length, so texels are collected without a copy.
        let pixels = image.as_raw().chunks_exact(P::CHANNEL_COUNT.into()).map(P::from_slice);
        match picked {
            Picked::Colour => pixels.map(|pixel| pixel.to_rgb().0).collect(),
            Picked::Alpha => pixels.map(|pixel| [pixel.to_rgba().0[3]; 3]).collect(),
            Picked::Grey => pixels.map(|pixel| [pixel.to_luma().0[0]; 3]).collect(),
        }
    }
    match image {
        DynamicImage::ImageLuma8(image) => of(image, picked),
        DynamicImage::ImageLumaA8(image) => of(image, picked),
        DynamicImage::ImageRgb8(image) => of(image, picked),
        DynamicImage::ImageRgba8(image) => of(image, picked),
        DynamicImage::ImageLuma16(image) => of(image, picked),
        DynamicImage::ImageLumaA16(image) => of(image, picked),
        DynamicImage::ImageRgb16(image) => of(image, picked),
        DynamicImage::ImageRgba16(image) => of(image, picked),
        other => of(&other.to_rgba16(), picked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, LumaA, Rgb, Rgb32FImage, Rgba};

    /// Images of one pixel in every format: the depth of the file stays, and no value changes.
    #[test]
    fn every_format_keeps_its_depth() {
        use DynamicImage as D;
        let cases = [
            (D::ImageLuma8(ImageBuffer::from_pixel(1, 1, Luma([7]))), 255, [7; 3], None),
            (D::ImageLumaA8(ImageBuffer::from_pixel(1, 1, LumaA([7, 9]))), 255, [7; 3], Some(9)),
            (D::ImageRgb8(ImageBuffer::from_pixel(1, 1, Rgb([7, 8, 9]))), 255, [7, 8, 9], None),
            (D::ImageRgba8(ImageBuffer::from_pixel(1, 1, Rgba([7, 8, 9, 1]))), 255, [7, 8, 9], Some(1)),
            (D::ImageLuma16(ImageBuffer::from_pixel(1, 1, Luma([515]))), 65535, [515; 3], None),
            (D::ImageLumaA16(ImageBuffer::from_pixel(1, 1, LumaA([515, 258]))), 65535, [515; 3], Some(258)),
            (D::ImageRgb16(ImageBuffer::from_pixel(1, 1, Rgb([515, 3, 1]))), 65535, [515, 3, 1], None),
            (
                D::ImageRgba16(ImageBuffer::from_pixel(1, 1, Rgba([515, 3, 1, 2]))),
                65535,
                [515, 3, 1],
                Some(2),
            ),
            // 0.5 and 0.25 of 65535, rounded.
            (
                D::ImageRgb32F(Rgb32FImage::from_pixel(1, 1, Rgb([0.5, 1.0, 0.25]))),
                65535,
                [32768, 65535, 16384],
                None,
            ),
        ];
        for (image, largest, colour, alpha) in cases {
            let texture = into_texture("a", &image, Channels::Colour);
            assert_eq!(
                (texture.pixels.largest(), texture.pixels.get(0)),
                (largest, colour),
                "{:?}",
                image.color()
            );
            // 3 or 6 bytes a texel.
            assert_eq!(texture.pixels.as_bytes().len(), if largest == 255 { 3 } else { 6 });
            if let Some(alpha) = alpha {
                let texture = into_texture("a", &image, Channels::AlphaOrGrey);
                assert_eq!((texture.pixels.largest(), texture.pixels.get(0)), (largest, [alpha; 3]));
            }
        }
    }

    /// A roughness of 16 bits beside a metallic of 8: 128 of 255 is 128 * 257 of 65535.
    #[test]
    fn roughness_and_metallic_of_two_depths() {
        let source = Source::of("a.mtl", []);
        let mut scene = Scene::default();
        let image = |pixels| DecodedImage { name: "a".into(), width: 1, height: 1, pixels };
        let roughness = scene.add_image(image([[1001u16; 3]].into_iter().collect()));
        let metallic = scene.add_image(image([[128u8; 3]].into_iter().collect()));
        let mut loader = ImageLoader::new(&source);
        let made = loader.metallic_roughness(&mut scene, Some(roughness), Some(metallic), Path::new("a.mtl"));
        let made = made.expect("small").expect("an image");
        assert_eq!(scene.images[made.0 as usize].pixels.get(0), [65535, 1001, 128 * 257]);
    }
}
