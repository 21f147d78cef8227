//! Films (pixel buffers filled tile by tile), colour pipelines, and image files.
//!
//! Renderers fill films, writers read them. Independent of scenes and rays.
//!
//! ```
//! use kiln::film::{ColourPipeline, Film, Window};
//!
//! let mut film: Film = Film::new(Window { x: 0, y: 0, width: 40, height: 20 })?;
//! for mut tile in film.tiles_mut() {
//!     tile.pixels.fill([0.5, 0.25, 1.0]);
//! }
//! assert_eq!(film.pixel(39, 19), [0.5, 0.25, 1.0]);
//! assert_eq!(film.to_rgb8(ColourPipeline::Display)[..3], [128, 64, 255]);
//! # Ok::<(), kiln::error::Error>(())
//! ```

pub mod channels;
pub mod check;
pub mod colour;
pub mod filter;

mod exr_attributes;
mod pages;
mod radiance;
pub mod read;
pub mod rounding;
#[doc(hidden)]
pub mod simd;
pub mod tone;
pub mod write;

pub use colour::{Colour, ColourPipeline};
pub use exr_attributes::{ExrAttributes, Matrix};
pub use filter::{FilterShape, ReconstructionFilter};
pub use tone::{DisplaySettings, DisplayTransform};

use glam::DVec3;
use pages::Pages;
use rayon::prelude::*;
use rounding::{Level, bits_of_pixel, dither};

use crate::error::{Error, Result};
use crate::limits::{self, Bytes, Excess};

/// The side of a tile in pixels.
pub const TILE: u32 = 16;

/// A rectangle of pixels. `x` and `y` count from the top left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// Leftmost column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl Window {
    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Column and row in the whole picture of the pixel of this index, row by row.
    #[inline(always)]
    fn place(&self, index: u32) -> [u32; 2] {
        [self.x + index % self.width, self.y + index / self.width]
    }
}

/// Pixel format of a film.
pub trait Pixel: bytemuck::Pod + Send + Sync {
    /// Whether pixels are display values, to which the display transform is applied.
    const IS_DISPLAYED: bool;

    /// Whether pixels have an alpha channel.
    const HAS_ALPHA: bool = false;

    /// Sets the alpha channel, if there is one, to the part of each pixel that surfaces cover.
    fn set_alpha(_pixels: &mut [Self], _coverage: &[f32]) {}

    /// Converts colours in the encoding of `pipeline` to pixels; both slices have the same length, and are the pixels of
    /// `window` of the whole picture, row by row. Display values are those after `display`.
    fn develop(
        colours: &[[f32; 3]],
        window: Window,
        pipeline: ColourPipeline,
        display: DisplayTransform,
        pixels: &mut [Self],
    );
}

/// The colour itself, in the encoding of its pipeline.
impl Pixel for [f32; 3] {
    const IS_DISPLAYED: bool = false;

    #[inline(always)]
    fn develop(colours: &[[f32; 3]], _: Window, _: ColourPipeline, _: DisplayTransform, pixels: &mut [Self]) {
        pixels.copy_from_slice(colours);
    }
}

/// The colour itself on a black background, and alpha.
impl Pixel for [f32; 4] {
    const IS_DISPLAYED: bool = false;
    const HAS_ALPHA: bool = true;

    fn set_alpha(pixels: &mut [Self], coverage: &[f32]) {
        pixels.iter_mut().zip(coverage).for_each(|(pixel, &alpha)| pixel[3] = alpha);
    }

    fn develop(colours: &[[f32; 3]], _: Window, _: ColourPipeline, _: DisplayTransform, pixels: &mut [Self]) {
        pixels.iter_mut().zip(colours).for_each(|(pixel, &[r, g, b])| *pixel = [r, g, b, pixel[3]]);
    }
}

/// Display values of 8 or 16 bits, in a quarter or half of the memory; sufficient for image files of as many bits.
impl<L: Level> Pixel for [L; 3] {
    const IS_DISPLAYED: bool = true;

    #[inline(always)]
    fn develop(
        colours: &[[f32; 3]],
        window: Window,
        pipeline: ColourPipeline,
        display: DisplayTransform,
        pixels: &mut [Self],
    ) {
        if display.rounding().is_dithered {
            for ((i, pixel), &colour) in (0..).zip(pixels).zip(colours) {
                let bits = bits_of_pixel(window.place(i));
                let shown = display.displayed(pipeline, DVec3::from(colour.map(f64::from))).to_array();
                *pixel = std::array::from_fn(|channel| dither(shown[channel], bits[channel]));
            }
            return;
        }
        if !display.is_identity() {
            let pairs = pixels.iter_mut().zip(colours);
            return pairs.for_each(|(pixel, &colour)| *pixel = display.encode_mapped(colour));
        }
        for (channel, &colour) in pixels.as_flattened_mut().iter_mut().zip(colours.as_flattened()) {
            *channel = pipeline.encode_channel(colour);
        }
    }
}

/// A picture of three channels per pixel, stored tile by tile, so that threads can fill tiles without sharing memory.
#[derive(Debug, PartialEq)]
pub struct Film<P: Pixel = [f32; 3]> {
    window: Window,
    /// Tiles in rows from the top; within a tile, pixels in rows from the top. One allocation: thousands of small ones
    /// cost a tenth of a render in the system allocator.
    pixels: Pages<P>,
}

/// One tile of a film: `window.width * window.height` pixels, row by row from the top.
pub struct FilmTile<'a, P = [f32; 3]> {
    /// The region of the picture that the tile covers.
    pub window: Window,
    /// Pixel values.
    pub pixels: &'a mut [P],
}

/// The error for a requested picture that exceeds the memory limit.
pub fn too_large(picture: &str, excess: &Excess) -> Error {
    Error::Memory { what: format!("{picture} {excess}"), hint: format!("{SMALLER}, or {}", excess.remedy()) }
}

const SMALLER: &str = "give a smaller --size, render it in parts with --crop";

impl<P: Pixel> Film<P> {
    /// A black film for the region `window` of a picture.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough memory for it.
    pub fn new(window: Window) -> Result<Self> {
        let bytes = limits::product(&[window.width.into(), window.height.into(), size_of::<P>() as u64]);
        let size = format!("a picture of {} x {} pixels", window.width, window.height);
        limits::check(bytes).map_err(|excess| too_large(&size, &excess))?;
        let pixels = Pages::new(window.area()).map_err(|_| Error::Memory {
            what: format!("{size} needs {} of memory, which the system does not give", Bytes(bytes)),
            hint: SMALLER.into(),
        })?;
        Ok(Film { window, pixels })
    }

    /// The region of the picture that the film holds.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The regions of the picture that the tiles cover, in storage order.
    pub(crate) fn tile_windows(&self) -> impl Iterator<Item = Window> + use<P> {
        let whole = self.window;
        let starts = move |size: u32| (0..size).step_by(TILE as usize);
        starts(whole.height).flat_map(move |y| {
            starts(whole.width).map(move |x| Window {
                x: whole.x + x,
                y: whole.y + y,
                width: TILE.min(whole.width - x),
                height: TILE.min(whole.height - y),
            })
        })
    }

    /// Mutable tiles with disjoint pixels.
    pub fn tiles_mut(&mut self) -> Vec<FilmTile<'_, P>> {
        let windows = self.tile_windows();
        let mut rest = self.pixels.as_mut_slice();
        windows
            .map(|window| {
                let pixels = rest.split_off_mut(..window.area()).expect("tiles cover the film once");
                FilmTile { window, pixels }
            })
            .collect()
    }

    /// Storage index of the pixel at column `x`, row `y` of the film.
    fn pixel_index(&self, x: u32, y: u32) -> usize {
        let Window { width, height, .. } = self.window;
        assert!(x < width && y < height, "pixel ({x}, {y}) is outside the film");
        let (left, top) = (x - x % TILE, y - y % TILE);
        let (tile_width, tile_height) = (TILE.min(width - left), TILE.min(height - top));
        // Pixels stored before: whole rows of tiles, whole tiles of this row, whole rows of this tile.
        let before = [(top, width), (left, tile_height), (y - top, tile_width)];
        let index: usize = before.iter().map(|&(a, b)| a as usize * b as usize).sum();
        index + (x - left) as usize
    }

    /// The pixel at column `x`, row `y`, counted from the top left corner of the film.
    pub fn pixel(&self, x: u32, y: u32) -> P {
        self.pixels.as_slice()[self.pixel_index(x, y)]
    }

    /// The pixels of row `y` of the film, tile by tile from the left.
    pub fn row(&self, y: u32) -> impl Iterator<Item = &[P]> {
        let width = self.window.width;
        (0..width).step_by(TILE as usize).map(move |left| {
            let start = self.pixel_index(left, y);
            &self.pixels.as_slice()[start..start + TILE.min(width - left) as usize]
        })
    }

    /// All pixels, tile by tile.
    pub fn stored(&self) -> &[P] {
        self.pixels.as_slice()
    }

    /// All pixels, row by row from the top.
    pub fn rows(&self) -> impl Iterator<Item = P> + '_ {
        (0..self.window.height).flat_map(move |y| (0..self.window.width).map(move |x| self.pixel(x, y)))
    }
}

impl Film {
    /// The picture in another pixel format, on the current rayon pool.
    ///
    /// # Errors
    /// As those of [`Film::new`].
    pub fn developed<P: Pixel>(
        &self,
        pipeline: ColourPipeline,
        display: DisplayTransform,
    ) -> Result<Film<P>> {
        let mut film = Film::new(self.window)?;
        let mut rest = self.stored();
        let tiles = film.tiles_mut().into_iter().map(|tile| {
            let colours = rest.split_off(..tile.pixels.len()).expect("tiles cover the film once");
            (tile, colours)
        });
        let tiles: Vec<_> = tiles.collect();
        tiles.into_par_iter().for_each(|(tile, colours)| {
            P::develop(colours, tile.window, pipeline, display, tile.pixels);
        });
        Ok(film)
    }

    /// The picture in 8-bit display values without exposure and tone map, three per pixel, row by row from the top.
    pub fn to_rgb8(&self, pipeline: ColourPipeline) -> Vec<u8> {
        self.rows().flat_map(|pixel| pipeline.encode(pixel)).collect()
    }
}

impl<P: Pixel> Film<P> {
    /// Creates a film from pixels row by row from the top, `window.area()` of them.
    ///
    /// # Errors
    /// As those of [`Film::new`].
    pub fn from_rows(window: Window, rows: &[P]) -> Result<Self> {
        assert_eq!(rows.len(), window.area(), "as many pixels as the window has");
        let mut film = Film::new(window)?;
        for tile in film.tiles_mut() {
            let left = (tile.window.x - window.x) as usize;
            for (i, row) in tile.pixels.chunks_mut(tile.window.width as usize).enumerate() {
                let start = (tile.window.y - window.y) as usize + i;
                let start = start * window.width as usize + left;
                row.copy_from_slice(&rows[start..start + row.len()]);
            }
        }
        Ok(film)
    }
}

impl Film<[f32; 4]> {
    /// The colours, and the alpha channel row by row from the top.
    ///
    /// # Errors
    /// As those of [`Film::new`].
    pub fn split_alpha(&self) -> Result<(Film, Vec<f32>)> {
        let colours: Vec<[f32; 3]> = self.rows().map(|[r, g, b, _]| [r, g, b]).collect();
        Ok((Film::from_rows(self.window, &colours)?, self.rows().map(|[.., alpha]| alpha).collect()))
    }
}

impl<L: Level> Film<[L; 3]> {
    /// The picture in display values, three per pixel, row by row from the top.
    pub fn bytes(&self) -> Vec<L> {
        let mut bytes = Vec::with_capacity(self.window.area() * 3);
        for y in 0..self.window.height {
            self.row(y).for_each(|part| bytes.extend_from_slice(part.as_flattened()));
        }
        bytes
    }
}

/// Columns and rows of the pixels of a tile that are NaN or infinite.
#[inline(always)]
pub fn non_finite(window: Window, pixels: &[[f32; 3]]) -> Vec<(u32, u32)> {
    // Non-finite values have all exponent bits set.
    const EXPONENT: u32 = 0x7f80_0000;
    let finite = |all: bool, c: &f32| all & (c.to_bits() & EXPONENT != EXPONENT);
    if pixels.as_flattened().iter().fold(true, finite) {
        return Vec::new();
    }
    let places = (0..).zip(pixels).filter(|(_, pixel)| pixel.iter().any(|c| !c.is_finite()));
    places.map(|(i, _)| (window.x + i % window.width, window.y + i / window.width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_every_pixel_once() {
        let window = Window { x: 5, y: 9, width: 37, height: 18 };
        let mut film: Film = Film::new(window).unwrap();
        for tile in film.tiles_mut() {
            let w = tile.window;
            for (i, pixel) in (0..).zip(tile.pixels) {
                let (x, y) = (w.x + i % w.width, w.y + i / w.width);
                pixel[0] += (y * 1000 + x) as f32;
            }
        }
        for y in 0..window.height {
            for x in 0..window.width {
                let expected = ((y + window.y) * 1000 + x + window.x) as f32;
                assert_eq!(film.pixel(x, y)[0], expected);
            }
        }
        let bytes = film.to_rgb8(ColourPipeline::Display);
        assert_eq!(bytes.len(), 37 * 18 * 3);
        for y in 0..window.height {
            let row: Vec<_> = film.row(y).flatten().copied().collect();
            let pixels: Vec<_> = (0..window.width).map(|x| film.pixel(x, y)).collect();
            assert_eq!(row, pixels);
        }
    }

    #[test]
    fn a_film_of_bytes_holds_what_a_display_shows() {
        let window = Window { x: 3, y: 0, width: 37, height: 18 };
        let colour = |x: u32, y: u32| [x as f32 / 40.0, y as f32 / 20.0, 2.0];
        let (mut floats, mut bytes): (Film, Film<[u8; 3]>) =
            (Film::new(window).unwrap(), Film::new(window).unwrap());
        for (a, b) in floats.tiles_mut().into_iter().zip(bytes.tiles_mut()) {
            (0..).zip(a.pixels.iter_mut()).for_each(|(i, pixel)| *pixel = colour(i, i / 2));
            Pixel::develop(a.pixels, b.window, ColourPipeline::Linear, DisplayTransform::default(), b.pixels);
        }
        assert_eq!(floats.to_rgb8(ColourPipeline::Linear), bytes.bytes());
        let display = DisplayTransform::new(-1.0, tone::ToneMap::Agx);
        let developed: Film<[u8; 3]> = floats.developed(ColourPipeline::Linear, display).unwrap();
        for (x, y) in [(0, 0), (15, 3), (36, 17)] {
            let encoded = display.encode(ColourPipeline::Linear, floats.pixel(x, y));
            assert_eq!(developed.pixel(x, y), encoded);
            assert_ne!(encoded, bytes.pixel(x, y));
        }
    }

    #[test]
    fn non_finite_pixels_are_found_where_they_are() {
        let window = Window { x: 100, y: 200, width: 4, height: 4 };
        let mut pixels = [[0.5; 3]; 16];
        assert_eq!(non_finite(window, &pixels), []);
        // The tenth pixel: third row, second column.
        pixels[9][2] = f32::NAN;
        assert_eq!(non_finite(window, &pixels), [(101, 202)]);
    }
}
