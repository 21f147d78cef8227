//! Texture images: each file is decoded once; materials do without images that cannot be decoded.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::{DynamicImage, GenericImageView};

use super::Source;
use super::dependencies::Files;
use super::heights::normals_of_heights;
use crate::error::{Error, Place, Result, Warnings};
use crate::files;
use crate::film::read::{self, ReadError};
use crate::limits::{self, Counted};
use crate::scene::{DecodedImage, ImageId, Scene};

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
        let decode =
            || open(&self.source.files, file, TEXTURE).map(|image| into_texture(&name, &image, channels));
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
                let grey = match open(&self.source.files, file, HEIGHTS) {
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
        limits::check_claim(limits::product(&[width.into(), height.into(), TEXTURE])).map_err(|excess| {
            let what = format!("a picture of roughness and metallic of {width} x {height} pixels {excess}");
            Error::input(file, what, excess.hint())
        })?;
        // The nearest texel of an image that is smaller.
        let value = |part: &Option<DecodedImage>, x: u32, y: u32| {
            let Some(part) = part else { return 255 };
            let scaled =
                |at: u32, side: u32, of: u32| (u64::from(at) * u64::from(of) / u64::from(side)) as usize;
            let (column, row) = (scaled(x, width, part.width), scaled(y, height, part.height));
            part.pixels[row * part.width as usize + column][0]
        };
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let pixels = places.map(|(x, y)| [255, value(&parts[0], x, y), value(&parts[1], x, y)]).collect();
        let names: Vec<&str> = parts.iter().flatten().map(|part| part.name.as_str()).collect();
        let name = names.join(" and ");
        let made = scene.add_image(DecodedImage { name, width, height, pixels });
        self.combined.insert([roughness, metallic], made);
        Ok(Some(made))
    }
}

/// Bytes per pixel of a texture, in addition to the decoded image.
const TEXTURE: u64 = 3;

/// Bytes per pixel of a height map: 16-bit heights, their normals, and the texture.
const HEIGHTS: u64 = 2 + 3 + TEXTURE;

fn open(files: &Files, file: &Path, bytes_each: u64) -> std::result::Result<DynamicImage, ReadError> {
    let bytes = files.read(file).map_err(|e| ReadError::Damaged(files::explain(&e).0))?;
    decode(&bytes, bytes_each)
}

/// Decodes an image; the caller will allocate another `bytes_each` per pixel.
fn decode(bytes: &[u8], bytes_each: u64) -> std::result::Result<DynamicImage, ReadError> {
    #[cfg(feature = "codecs")]
    if super::ktx2::is_ktx2(bytes) {
        return super::ktx2::decode(bytes, bytes_each);
    }
    read::decode(bytes, bytes_each)
}

fn is_grey(image: &DynamicImage) -> bool {
    let mut pixels = image.pixels().map(|(_, _, p)| p.0);
    !image.color().has_color() || pixels.all(|[r, g, b, _]| r == g && g == b)
}

fn of_heights(name: &str, image: DynamicImage) -> (DecodedImage, f64) {
    let grey = image.into_luma16();
    let (width, height) = grey.dimensions();
    let heights = grey.into_raw();
    let made = normals_of_heights(|i| f64::from(heights[i]) / 65535.0, width as usize, height as usize);
    (DecodedImage { name: name.to_owned(), width, height, pixels: made.texels.into() }, made.steepest)
}

/// Decodes an image in memory; returns `None` with a warning if that fails. `place` is named in messages.
pub(crate) fn of_bytes(
    scene: &mut Scene,
    source: &Source,
    place: Place,
    bytes: &[u8],
    warnings: &mut Warnings,
) -> Result<Option<ImageId>> {
    let name = place.to_string();
    let decode = || decode(bytes, TEXTURE).map(|image| into_texture(&name, &image, Channels::Colour));
    let decoded = source.files.image(&name).map_or_else(decode, Ok);
    keep(scene, source, decoded, place, warnings)
}

/// Decodes the alpha channel of an image in memory into a grey image called `name`, `value` of each; returns `None` if all are opaque (255), as
/// without an alpha channel, or it cannot be decoded, of which [`of_bytes`] warns.
pub(crate) fn alpha_of_bytes(
    scene: &mut Scene,
    place: Place,
    name: String,
    bytes: &[u8],
    value: impl Fn(u8) -> u8,
) -> Result<Option<ImageId>> {
    // Other formats than 8-bit RGBA are converted first.
    const RGBA: u64 = 4;
    let image = match decode(bytes, RGBA + TEXTURE) {
        Ok(image) => image,
        Err(ReadError::TooLarge { what, hint }) => return Err(Error::input(place, what, hint)),
        Err(ReadError::Damaged(_)) => return Ok(None),
    };
    if !image.color().has_alpha() {
        return Ok(None);
    }
    let (width, height) = image.dimensions();
    let rgba = image.into_rgba8();
    let alphas = || rgba.as_raw().as_chunks().0.iter().map(|&[_, _, _, a]: &[u8; 4]| a);
    if alphas().all(|alpha| alpha == 255) {
        return Ok(None);
    }
    let pixels: Arc<[[u8; 3]]> = alphas().map(|alpha| [value(alpha); 3]).collect();
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
            let checked = Counted::Texels.check(texels, &source.options.limits);
            checked.map_err(|(what, hint)| Error::input(place, what, hint))?;
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
    if channels == Channels::AlphaOrGrey {
        let alpha = image.color().has_alpha().then(|| image.to_rgba8());
        return match alpha.filter(|alpha| alpha.pixels().any(|p| p.0[3] < 255)) {
            Some(alpha) => made(alpha.pixels().map(|p| [p.0[3]; 3]).collect()),
            None => made(image.to_luma8().as_raw().iter().map(|&l| [l; 3]).collect()),
        };
    }
    // Common formats are converted without an intermediate image.
    let pixels = match image {
        DynamicImage::ImageLuma8(grey) => grey.as_raw().iter().map(|&l| [l; 3]).collect(),
        DynamicImage::ImageRgba8(rgba) => {
            rgba.as_raw().as_chunks().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect()
        }
        DynamicImage::ImageRgb8(rgb) => rgb.as_raw().as_chunks().0.into(),
        _ => image.to_rgb8().as_raw().as_chunks().0.into(),
    };
    made(pixels)
}
