//! Pictures that textures read.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::pyramid::Pyramid;
use crate::film::ColourPipeline;
use crate::film::colour::srgb_decode;
use crate::scene::TextureImage;

/// What the 8-bit values of a picture stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// Display values: colours in the numbers of the pipeline.
    Colours,
    /// Plain numbers from 0 to 1.
    Numbers,
}

/// A picture with what its 8-bit values mean as colours.
pub struct Image {
    /// Where it came from.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: Arc<[[u8; 3]]>,
    /// The pipeline's number for each 8-bit display value.
    colours: [f32; 256],
    /// One for each meaning; made when one is first asked for.
    pyramids: [OnceLock<Pyramid>; 2],
}

impl Image {
    pub(super) fn new(image: TextureImage, pipeline: ColourPipeline) -> Self {
        let colour = |value: usize| {
            let display = value as f64 / 255.0;
            if pipeline == ColourPipeline::Linear { srgb_decode(display) as f32 } else { display as f32 }
        };
        Image {
            name: image.name,
            width: image.width,
            height: image.height,
            pixels: image.pixels,
            colours: std::array::from_fn(colour),
            pyramids: Default::default(),
        }
    }

    /// The values of the pixel at `index`, 0 to 1.
    #[inline]
    pub fn texel(&self, index: usize, meaning: Meaning) -> [f64; 3] {
        match meaning {
            Meaning::Colours => self.pixels[index].map(|c| f64::from(self.colours[c as usize])),
            Meaning::Numbers => self.pixels[index].map(|c| f64::from(c) / 255.0),
        }
    }

    /// Makes the pyramid where there is none yet. Not from within a parallel loop that looks pictures up.
    pub fn make_pyramid(&self, meaning: Meaning) -> &Pyramid {
        self.pyramids[meaning as usize].get_or_init(|| {
            Pyramid::new(self.width, self.height, |i| DVec3::from(self.texel(i, meaning)).as_vec3())
        })
    }

    /// The pyramid, where one was asked for.
    #[inline]
    pub fn pyramid(&self, meaning: Meaning) -> Option<&Pyramid> {
        self.pyramids[meaning as usize].get()
    }

    /// The size of its pyramids in bytes.
    pub fn pyramid_bytes(&self) -> usize {
        self.pyramids.iter().filter_map(OnceLock::get).map(Pyramid::bytes).sum()
    }
}
