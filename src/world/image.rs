//! Images that textures read.

use std::sync::{LazyLock, OnceLock};

use glam::DVec3;

use super::mip_map::MipMap;
use crate::film::ColourPipeline;
use crate::film::colour::srgb_decode;
use crate::scene::{DecodedImage, TexelEncoding, TexelValues};

/// Decoded values of one bit depth, by stored value.
struct DecodingTable {
    /// Colours in the pipeline `linear`, and in the others.
    linear: Vec<f32>,
    display: Vec<f32>,
    data: Vec<f64>,
}

/// Tables for 8 and 16 bits; 1 MiB, made for the first image of the bit depth.
static TABLES: [LazyLock<DecodingTable>; 2] =
    [LazyLock::new(|| DecodingTable::new(u8::MAX.into())), LazyLock::new(|| DecodingTable::new(u16::MAX))];

impl DecodingTable {
    fn new(largest: u16) -> Self {
        let data: Vec<f64> = (0..=largest).map(|value| f64::from(value) / f64::from(largest)).collect();
        DecodingTable {
            linear: data.iter().map(|&display| srgb_decode(display) as f32).collect(),
            display: data.iter().map(|&display| display as f32).collect(),
            data,
        }
    }
}

/// An RGB image with its mip maps.
pub struct Image {
    /// The file or item it came from.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: TexelValues,
    /// Decoded values of colours and of data, by stored value.
    colours: &'static [f32],
    data: &'static [f64],
    /// One for each encoding, built by [`Image::make_mip_map`].
    mip_maps: [OnceLock<MipMap>; 3],
}

impl Image {
    /// The image for a colour pipeline. Texels are not copied.
    pub(crate) fn new(image: DecodedImage, pipeline: ColourPipeline) -> Self {
        let table = &TABLES[usize::from(matches!(image.pixels, TexelValues::U16(_)))];
        let is_linear = pipeline == ColourPipeline::Linear;
        Image {
            name: image.name,
            width: image.width,
            height: image.height,
            pixels: image.pixels,
            colours: if is_linear { &table.linear } else { &table.display },
            data: &table.data,
            mip_maps: Default::default(),
        }
    }

    /// The decoded texel at `index`, 0 to 1.
    #[inline]
    pub fn texel(&self, index: usize, encoding: TexelEncoding) -> [f64; 3] {
        let texel = self.pixels.get(index);
        if encoding == TexelEncoding::Colour {
            return texel.map(|c| f64::from(self.colours[usize::from(c)]));
        }
        encoding.numbers(texel, self.pixels.largest(), |c| self.data[usize::from(c)])
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
