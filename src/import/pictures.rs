//! Pictures for textures: decoded once each, and replaced by a plain colour where they cannot be.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::Source;
use super::files::Files;
use super::heights::normals_of_heights;
use crate::error::Warnings;
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
    pub fn of_file(&mut self, scene: &mut Scene, file: &Path, warnings: &mut Warnings) -> Option<ImageId> {
        if let Some(&known) = self.known.get(file) {
            return known;
        }
        let name = file.display().to_string();
        let decoded = open(&self.files, file).map(|picture| into_texture(&name, picture));
        let image = keep(scene, decoded, &name, warnings);
        self.known.insert(file.to_owned(), image);
        image
    }

    /// The bump map in `file`, and what x and y of its normals are to be multiplied by. A grey picture holds heights; one in
    /// colours is a normal map already, as exporters write under this name, too.
    pub fn bump_of_file(
        &mut self,
        scene: &mut Scene,
        file: &Path,
        warnings: &mut Warnings,
    ) -> Option<(ImageId, f64)> {
        let heights = match self.heights.get(file) {
            Some(known) => *known,
            None => {
                // What cannot be read is warned of by the other way.
                let grey = open(&self.files, file).ok().filter(is_grey);
                let made = grey.map(|picture| {
                    let (image, steepest) = of_heights(&file.display().to_string(), &picture);
                    (scene.add_image(image), steepest)
                });
                self.heights.insert(file.to_owned(), made);
                made
            }
        };
        if heights.is_some() {
            return heights;
        }
        let image = self.of_file(scene, file, warnings)?;
        warnings.note(format!("{}: a bump map in colours; taken as a normal map", file.display()));
        Some((image, 1.0))
    }
}

fn open(files: &Files, file: &Path) -> Result<image::DynamicImage, String> {
    let bytes = files.read(file).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "no such file".to_owned(),
        _ => e.to_string(),
    })?;
    decode(&bytes)
}

fn is_grey(picture: &image::DynamicImage) -> bool {
    !picture.color().has_color() || picture.to_rgb8().pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2])
}

fn of_heights(name: &str, picture: &image::DynamicImage) -> (TextureImage, f64) {
    let grey = picture.to_luma16();
    let (width, height) = grey.dimensions();
    let heights: Vec<f64> = grey.pixels().map(|p| f64::from(p.0[0]) / 65535.0).collect();
    let made = normals_of_heights(&heights, width as usize, height as usize);
    (TextureImage { name: name.to_owned(), width, height, pixels: made.texels.into() }, made.steepest)
}

/// A picture from bytes in memory, or `None` with a warning where it cannot be decoded.
pub fn of_bytes(scene: &mut Scene, name: &str, bytes: &[u8], warnings: &mut Warnings) -> Option<ImageId> {
    keep(scene, decode(bytes).map(|picture| into_texture(name, picture)), name, warnings)
}

fn keep(
    scene: &mut Scene,
    decoded: Result<TextureImage, String>,
    name: &str,
    warnings: &mut Warnings,
) -> Option<ImageId> {
    match decoded {
        Ok(image) => Some(scene.add_image(image)),
        Err(why) => {
            warnings.push(format!("{name}: texture left out: {why}"));
            None
        }
    }
}

fn decode(bytes: &[u8]) -> Result<image::DynamicImage, String> {
    let picture = image::load_from_memory(bytes).map_err(|e| match e {
        image::ImageError::Unsupported(_) => "not a PNG or JPEG picture".to_owned(),
        other => format!("damaged picture: {other}"),
    })?;
    if picture.width() == 0 || picture.height() == 0 {
        return Err("a picture without pixels".into());
    }
    Ok(picture)
}

fn into_texture(name: &str, picture: image::DynamicImage) -> TextureImage {
    let rgb = picture.into_rgb8();
    let (width, height) = rgb.dimensions();
    TextureImage { name: name.to_owned(), width, height, pixels: rgb.pixels().map(|p| p.0).collect() }
}
