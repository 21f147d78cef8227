//! Pictures for textures: decoded once each, and replaced by a plain colour where they cannot be.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::error::Warnings;
use crate::scene::{ImageId, Scene, TextureImage};

/// Decodes pictures into a scene, each file once.
#[derive(Default)]
pub struct Pictures {
    known: HashMap<PathBuf, Option<ImageId>>,
}

impl Pictures {
    /// The picture in `file`, or `None` with a warning where it is missing or cannot be decoded.
    pub fn of_file(&mut self, scene: &mut Scene, file: &Path, warnings: &mut Warnings) -> Option<ImageId> {
        if let Some(&known) = self.known.get(file) {
            return known;
        }
        let decoded = std::fs::read(file)
            .map_err(|e| match e.kind() {
                std::io::ErrorKind::NotFound => "no such file".to_owned(),
                _ => e.to_string(),
            })
            .and_then(|bytes| decode(&file.display().to_string(), &bytes));
        let image = keep(scene, decoded, &file.display().to_string(), warnings);
        self.known.insert(file.to_owned(), image);
        image
    }
}

/// A picture from bytes in memory, or `None` with a warning where it cannot be decoded.
pub fn of_bytes(scene: &mut Scene, name: &str, bytes: &[u8], warnings: &mut Warnings) -> Option<ImageId> {
    keep(scene, decode(name, bytes), name, warnings)
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

fn decode(name: &str, bytes: &[u8]) -> Result<TextureImage, String> {
    let picture = image::load_from_memory(bytes).map_err(|e| match e {
        image::ImageError::Unsupported(_) => "not a PNG or JPEG picture".to_owned(),
        other => format!("damaged picture: {other}"),
    })?;
    let rgb = picture.into_rgb8();
    let (width, height) = rgb.dimensions();
    if width == 0 || height == 0 {
        return Err("a picture without pixels".into());
    }
    let pixels = rgb.pixels().map(|p| p.0).collect();
    Ok(TextureImage { name: name.to_owned(), width, height, pixels })
}
