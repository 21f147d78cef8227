//! Pictures for textures: decoded once each, and replaced by a plain colour where they cannot be.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use image::{DynamicImage, GenericImageView};

use super::Source;
use super::files::Files;
use super::heights::normals_of_heights;
use crate::error::{Error, Place, Result, Warnings};
use crate::film::read::{self, Unread};
use crate::limits;
use crate::scene::{ImageId, Scene, TextureImage};

/// Decodes pictures into a scene, each file once.
pub struct Pictures {
    files: Files,
    known: HashMap<PathBuf, Option<ImageId>>,
    /// Height maps as normal maps, with the steepest slope in each; `None` where it is a normal map already.
    heights: HashMap<PathBuf, Option<(ImageId, f64)>>,
}

impl Pictures {
    /// The pictures that `source` names; none yet.
    pub fn new(source: &Source) -> Self {
        Pictures { files: source.files.clone(), known: HashMap::new(), heights: HashMap::new() }
    }

    /// The picture in `file`, or `None` with a warning where it is missing or cannot be decoded.
    ///
    /// # Errors
    /// [`Error::Input`] where it is too large: what is drawn does not depend on the machine's memory.
    pub fn of_file(
        &mut self,
        scene: &mut Scene,
        file: &Path,
        warnings: &mut Warnings,
    ) -> Result<Option<ImageId>> {
        if let Some(&known) = self.known.get(file) {
            return Ok(known);
        }
        let name = file.display().to_string();
        let decoded = open(&self.files, file, TEXTURE).map(|picture| into_texture(&name, &picture));
        let image = keep(scene, decoded, file, warnings)?;
        self.known.insert(file.to_owned(), image);
        Ok(image)
    }

    /// The bump map in `file`, and what x and y of its normals are to be multiplied by. A grey picture holds heights; one in
    /// colours is a normal map already, as exporters write under this name, too.
    ///
    /// # Errors
    /// As those of [`Pictures::of_file`].
    pub fn bump_of_file(
        &mut self,
        scene: &mut Scene,
        file: &Path,
        warnings: &mut Warnings,
    ) -> Result<Option<(ImageId, f64)>> {
        let heights = match self.heights.get(file) {
            Some(known) => *known,
            None => {
                let grey = match open(&self.files, file, HEIGHTS) {
                    Ok(picture) => Some(picture).filter(is_grey),
                    Err(Unread::TooLarge { what, hint }) => return Err(Error::input(file, what, hint)),
                    // Warned of below.
                    Err(Unread::Damaged(_)) => None,
                };
                let made = grey.map(|picture| {
                    let (image, steepest) = of_heights(&file.display().to_string(), picture);
                    (scene.add_image(image), steepest)
                });
                self.heights.insert(file.to_owned(), made);
                made
            }
        };
        if heights.is_some() {
            return Ok(heights);
        }
        let Some(image) = self.of_file(scene, file, warnings)? else { return Ok(None) };
        warnings.note(format!("{}: a bump map in colours; taken as a normal map", file.display()));
        Ok(Some((image, 1.0)))
    }
}

/// Bytes a pixel of a texture, beside the decoded picture.
const TEXTURE: u64 = 3;

/// The same of a height map: 16-bit heights, the normals made of them, and the texture.
const HEIGHTS: u64 = 2 + 3 + TEXTURE;

fn open(files: &Files, file: &Path, bytes_each: u64) -> std::result::Result<DynamicImage, Unread> {
    let bytes = files.read(file).map_err(|e| Unread::Damaged(limits::explain(&e).0))?;
    read::decode(&bytes, bytes_each)
}

fn is_grey(picture: &DynamicImage) -> bool {
    let mut pixels = picture.pixels().map(|(_, _, p)| p.0);
    !picture.color().has_color() || pixels.all(|[r, g, b, _]| r == g && g == b)
}

fn of_heights(name: &str, picture: DynamicImage) -> (TextureImage, f64) {
    let grey = picture.into_luma16();
    let (width, height) = grey.dimensions();
    let heights = grey.into_raw();
    let made = normals_of_heights(|i| f64::from(heights[i]) / 65535.0, width as usize, height as usize);
    (TextureImage { name: name.to_owned(), width, height, pixels: made.texels.into() }, made.steepest)
}

/// A picture from bytes in memory, or `None` with a warning where it cannot be decoded. `place` is where it is.
///
/// # Errors
/// [`Error::Input`] where it is too large.
pub fn of_bytes(
    scene: &mut Scene,
    place: Place,
    bytes: &[u8],
    warnings: &mut Warnings,
) -> Result<Option<ImageId>> {
    let name = place.to_string();
    keep(scene, read::decode(bytes, TEXTURE).map(|picture| into_texture(&name, &picture)), place, warnings)
}

fn keep(
    scene: &mut Scene,
    decoded: std::result::Result<TextureImage, Unread>,
    place: impl Into<Place>,
    warnings: &mut Warnings,
) -> Result<Option<ImageId>> {
    match decoded {
        Ok(image) => Ok(Some(scene.add_image(image))),
        Err(Unread::TooLarge { what, hint }) => Err(Error::input(place, what, hint)),
        Err(Unread::Damaged(why)) => {
            warnings.push(format!("{}: texture left out: {why}", place.into()));
            Ok(None)
        }
    }
}

fn into_texture(name: &str, picture: &DynamicImage) -> TextureImage {
    let (width, height) = picture.dimensions();
    // The usual kinds go straight to their place, without a second picture between.
    let pixels = match picture {
        DynamicImage::ImageLuma8(grey) => grey.as_raw().iter().map(|&l| [l; 3]).collect(),
        DynamicImage::ImageRgba8(rgba) => {
            rgba.as_raw().as_chunks().0.iter().map(|&[r, g, b, _]| [r, g, b]).collect()
        }
        DynamicImage::ImageRgb8(rgb) => rgb.as_raw().as_chunks().0.into(),
        _ => picture.to_rgb8().as_raw().as_chunks().0.into(),
    };
    TextureImage { name: name.to_owned(), width, height, pixels }
}
