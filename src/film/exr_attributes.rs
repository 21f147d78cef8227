//! What an OpenEXR file states of its picture beside the pixels, in the attributes that OpenEXR defines.

use exr::meta::attribute::{Chromaticities, IntegerBounds};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{Text, Vec2};
use serde::{Deserialize, Serialize};

use super::Window;
use super::write::Metadata;

/// The attributes of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExrAttributes {
    /// Width and height in pixels of the whole picture, of which the file may hold a part: the display window.
    pub size: [u32; 2],
    /// Width divided by height of a pixel.
    pub pixel_aspect: f32,
    /// `worldToCamera` and `worldToNDC`; `None` for projections that are no matrix.
    pub matrices: Option<[Matrix; 2]>,
    /// Whether colours are linear light with the primaries and the white of sRGB.
    pub is_linear: bool,
    /// Whether colours and alpha are stored as half floats.
    pub has_half_floats: bool,
    /// Further text attributes.
    pub texts: Vec<(String, String)>,
}

/// A matrix of 4 x 4 numbers, row by row, by which row vectors are multiplied. It is stored bit by bit, because JSON
/// numbers are not read back to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[u32; 16]", into = "[u32; 16]")]
pub struct Matrix(pub [f32; 16]);

impl From<[u32; 16]> for Matrix {
    fn from(bits: [u32; 16]) -> Self {
        Matrix(bits.map(f32::from_bits))
    }
}

impl From<Matrix> for [u32; 16] {
    fn from(matrix: Matrix) -> Self {
        matrix.0.map(f32::to_bits)
    }
}

/// Primaries and white of Rec. ITU-R BT.709-6, table 1, which sRGB has, too.
fn rec_709() -> Chromaticities {
    Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    }
}

impl ExrAttributes {
    /// Those of a picture of which nothing but its size is known.
    pub fn of_size(size: [u32; 2]) -> Self {
        ExrAttributes {
            size,
            pixel_aspect: 1.0,
            matrices: None,
            is_linear: false,
            has_half_floats: false,
            texts: Vec::new(),
        }
    }

    /// The header of a file that holds the part `window`, and `metadata` as text.
    pub(super) fn header(&self, window: Window, metadata: &Metadata) -> (ImageAttributes, LayerAttributes) {
        let [width, height] = self.size.map(|side| side as usize);
        let display = IntegerBounds::new(Vec2(0, 0), Vec2(width, height));
        let mut image = ImageAttributes::new(display);
        image.pixel_aspect = self.pixel_aspect;
        image.chromaticities = self.is_linear.then(rec_709);
        let mut layer = LayerAttributes::named("kiln");
        layer.layer_position = Vec2(window.x as i32, window.y as i32);
        if let Some([camera, ndc]) = self.matrices {
            layer.world_to_camera = Some(camera.0);
            layer.world_to_normalized_device = Some(ndc.0);
        }
        for (key, value) in metadata.iter().chain(&self.texts) {
            // Non-ASCII text is stored as UTF-8; OpenEXR does not define an encoding of text.
            let text = Text::from_slice_unchecked(value.as_bytes());
            let value = exr::meta::attribute::AttributeValue::Text(text);
            layer.other.insert(Text::from_slice_unchecked(key.as_bytes()), value);
        }
        (image, layer)
    }
}
