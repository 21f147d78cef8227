//! [`Environment`]: light from infinitely far away, from every direction.

use std::sync::Arc;

use crate::film::Colour;

/// Light from infinitely far away. It is the background, too, unless hidden.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    /// Where the radiance of a direction comes from.
    pub source: EnvironmentSource,
    /// Rotation about +y in radians, counterclockwise seen from above: from +x towards -z.
    pub rotation: f64,
    /// Factor of the radiance.
    pub intensity: f64,
    /// Whether camera rays that hit nothing see the background of the scene instead.
    pub is_hidden: bool,
}

/// The source of an environment's radiance.
#[derive(Debug, Clone, PartialEq)]
pub enum EnvironmentSource {
    /// An equirectangular image: its centre is the direction +x, to the right of it lies +z, and its top row is +y. This is
    /// the convention of Blender, converted to +y up, and of three.js.
    Image(Arc<EnvironmentImage>),
    /// A sky with a hazy sun 40 degrees high.
    Sky,
    /// One radiance in every direction.
    Colour(Colour),
}

/// An image of linear radiance.
pub struct EnvironmentImage {
    /// The file's name, without its folder.
    pub name: String,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// Red, green and blue, finite and at least 0, row by row from the top.
    pub pixels: Vec<[f32; 3]>,
}

impl PartialEq for EnvironmentImage {
    fn eq(&self, other: &Self) -> bool {
        let EnvironmentImage { name, width, height, pixels } = self;
        std::ptr::eq(self, other)
            || (name, width, height, pixels) == (&other.name, &other.width, &other.height, &other.pixels)
    }
}

/// Without pixels.
impl std::fmt::Debug for EnvironmentImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let EnvironmentImage { name, width, height, .. } = self;
        write!(f, "{name} ({width} x {height})")
    }
}
