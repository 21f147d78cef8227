//! The film: pixels while they are made, colour, and pictures on disk.
//!
//! Render fills it, writers read it. It knows nothing of scenes or rays.

pub mod colour;
pub mod output;
pub mod write;

pub use colour::{Colour, ColourPipeline};

use crate::error::{Error, Result};

/// The side of a tile in pixels.
pub const TILE: u32 = 16;

/// A rectangle of pixels. `x` and `y` count from the top left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// How many pixels it has.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// A picture in the numbers of its colour pipeline: three 32-bit channels a pixel, kept tile by tile so that each
/// tile can be filled by another thread without sharing.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    window: Window,
    /// Tile after tile, rows of tiles from the top; within a tile, row after row. In one piece: thousands of small pieces
    /// were measured to cost a tenth of a render in the system's allocator.
    pixels: Vec<[f32; 3]>,
}

/// One tile of a film: `window.width * window.height` pixels, row by row from the top.
pub struct FilmTile<'a> {
    /// The pixels of the picture that the tile covers.
    pub window: Window,
    /// Their values.
    pub pixels: &'a mut [[f32; 3]],
}

impl Film {
    /// A black film for the part `window` of a picture.
    ///
    /// # Errors
    /// [`Error::Failed`] where there is not enough memory for it.
    pub fn new(window: Window) -> Result<Self> {
        // Asked for first, because running out of memory in `vec!` ends the process.
        if Vec::<[f32; 3]>::new().try_reserve_exact(window.area()).is_err() {
            let gib = window.area() as f64 * size_of::<[f32; 3]>() as f64 / f64::from(1 << 30);
            return Err(Error::Failed {
                what: format!("a picture of {} x {} needs {gib:.1} GiB", window.width, window.height),
                hint: "give a smaller --size, or render it in parts with --crop".into(),
            });
        }
        Ok(Film { window, pixels: vec![[0.0; 3]; window.area()] })
    }

    /// The part of the picture this film holds.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The parts of the picture that the tiles cover, in the order they are kept.
    fn tile_windows(&self) -> impl Iterator<Item = Window> + use<> {
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

    /// The tiles, each with its own pixels.
    pub fn tiles_mut(&mut self) -> Vec<FilmTile<'_>> {
        let windows = self.tile_windows();
        let mut rest = self.pixels.as_mut_slice();
        windows
            .map(|window| {
                let pixels = rest.split_off_mut(..window.area()).expect("tiles cover the film once");
                FilmTile { window, pixels }
            })
            .collect()
    }

    /// The tiles, to look at.
    fn tiles(&self) -> impl Iterator<Item = (Window, &[[f32; 3]])> {
        self.tile_windows().scan(0, |start, window| {
            let tile = *start..*start + window.area();
            *start = tile.end;
            Some((window, &self.pixels[tile]))
        })
    }

    /// The pixel at column `x`, row `y` of the film, counted from its own top left corner.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        let Window { width, height, .. } = self.window;
        assert!(x < width && y < height, "pixel ({x}, {y}) is outside the film");
        let (left, top) = (x - x % TILE, y - y % TILE);
        let (tile_width, tile_height) = (TILE.min(width - left), TILE.min(height - top));
        // What comes before: whole rows of tiles, whole tiles of this row, whole rows of this tile.
        let before = [(top, width), (left, tile_height), (y - top, tile_width)];
        let index: usize = before.iter().map(|&(a, b)| a as usize * b as usize).sum();
        self.pixels[index + (x - left) as usize]
    }

    /// All pixels, row by row from the top.
    pub fn rows(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        (0..self.window.height).flat_map(move |y| (0..self.window.width).map(move |x| self.pixel(x, y)))
    }

    /// The picture in 8-bit display values, three a pixel, row by row from the top.
    pub fn to_rgb8(&self, pipeline: ColourPipeline) -> Vec<u8> {
        let mut bytes = vec![0; self.window.area() * 3];
        for (window, pixels) in self.tiles() {
            let (left, top) = (window.x - self.window.x, window.y - self.window.y);
            for (row, pixels) in (top..).zip(pixels.chunks_exact(window.width as usize)) {
                let start = (row as usize * self.window.width as usize + left as usize) * 3;
                for (out, &pixel) in bytes[start..].chunks_exact_mut(3).zip(pixels) {
                    out.copy_from_slice(&pipeline.encode(pixel));
                }
            }
        }
        bytes
    }

    /// Where the film holds something that is not a number or infinite: how many pixels, and the first ten of them.
    pub fn non_finite(&self) -> (usize, Vec<(u32, u32)>) {
        let mut found = Vec::new();
        for (window, pixels) in self.tiles() {
            // Zero times anything finite is zero; a sum over the tile is quicker than a question to each channel.
            if pixels.iter().flatten().map(|c| c * 0.0).sum::<f32>() == 0.0 {
                continue;
            }
            let places = (0..).zip(pixels).filter(|(_, pixel)| pixel.iter().any(|c| !c.is_finite()));
            found.extend(places.map(|(i, _)| (window.y + i / window.width, window.x + i % window.width)));
        }
        found.sort_unstable();
        let count = found.len();
        let first = found.into_iter().take(10).map(|(y, x)| (x, y)).collect();
        (count, first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_every_pixel_once() {
        let window = Window { x: 5, y: 9, width: 37, height: 18 };
        let mut film = Film::new(window).unwrap();
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
    }

    #[test]
    fn non_finite_pixels_are_found_where_they_are() {
        let mut film = Film::new(Window { x: 100, y: 200, width: 20, height: 20 }).unwrap();
        film.tiles_mut()[1].pixels[0][2] = f32::NAN;
        assert_eq!(film.non_finite(), (1, vec![(116, 200)]));
    }
}
