//! Images that textures read.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::mip_map::MipMap;
use crate::film::ColourPipeline;
use crate::film::colour::srgb_decode;
use crate::scene::{DecodedImage, TexelEncoding};

/// The value of each 8-bit value of data.
static DATA: [f64; 256] = {
    let (mut values, mut i) = ([0.0; 256], 0);
    while i < values.len() {
        values[i] = i as f64 / 255.0;
        i += 1;
    }
    values
};

/// An 8-bit RGB image with its mip maps.
pub struct Image {
    /// The file or item it came from.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: Arc<[[u8; 3]]>,
    /// The decoded value of each 8-bit value of a colour.
    colours: [f32; 256],
    /// One for each encoding, built by [`Image::make_mip_map`].
    mip_maps: [OnceLock<MipMap>; 2],
}

impl Image {
    pub(super) fn new(image: DecodedImage, pipeline: ColourPipeline) -> Self {
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
            mip_maps: Default::default(),
        }
    }

    /// The decoded texel at `index`, 0 to 1.
    #[inline]
    pub fn texel(&self, index: usize, encoding: TexelEncoding) -> [f64; 3] {
        match encoding {
            TexelEncoding::Colour => self.pixels[index].map(|c| f64::from(self.colours[c as usize])),
            TexelEncoding::Data => self.pixels[index].map(|c| DATA[usize::from(c)]),
        }
    }

    /// Builds the mip map if it does not exist, in parallel. Must not be called while other threads look textures up.
    pub fn make_mip_map(&self, encoding: TexelEncoding) -> &MipMap {
        self.mip_maps[encoding as usize].get_or_init(|| {
            MipMap::new(self.width, self.height, |i| DVec3::from(self.texel(i, encoding)).as_vec3())
        })
    }

    /// The mip map, if it was built.
    #[inline]
    pub fn mip_map(&self, encoding: TexelEncoding) -> Option<&MipMap> {
        self.mip_maps[encoding as usize].get()
    }

    /// Bytes of memory of the mip maps.
    pub fn mip_map_bytes(&self) -> usize {
        self.mip_maps.iter().filter_map(OnceLock::get).map(MipMap::bytes).sum()
    }
}
