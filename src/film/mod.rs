//! The film: pixels while they are made, colour, and pictures on disk.
//!
//! Render fills it, writers read it. It knows nothing of scenes or rays.

pub mod colour;
pub mod output;
pub mod write;

pub use colour::{Colour, ColourPipeline};

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

/// A picture in the numbers of its colour pipeline: three 32-bit channels a pixel, kept tile by tile so that each
/// tile can be filled by another thread without sharing.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    window: Window,
    tiles: Vec<FilmTile>,
}

/// One tile of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmTile {
    /// The pixels of the picture that the tile covers.
    pub window: Window,
    /// `window.width * window.height` pixels, row by row from the top.
    pub pixels: Vec<[f32; 3]>,
}

impl Film {
    /// A black film for the part `window` of a picture.
    pub fn new(window: Window) -> Self {
        let mut tiles = Vec::new();
        for y in (0..window.height).step_by(TILE as usize) {
            for x in (0..window.width).step_by(TILE as usize) {
                let tile = Window {
                    x: window.x + x,
                    y: window.y + y,
                    width: TILE.min(window.width - x),
                    height: TILE.min(window.height - y),
                };
                let pixels = vec![[0.0; 3]; (tile.width * tile.height) as usize];
                tiles.push(FilmTile { window: tile, pixels });
            }
        }
        Film { window, tiles }
    }

    /// The part of the picture this film holds.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The tiles, each with its own pixels.
    pub fn tiles_mut(&mut self) -> &mut [FilmTile] {
        &mut self.tiles
    }

    /// The pixel at column `x`, row `y` of the film, counted from its own top left corner.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        assert!(x < self.window.width && y < self.window.height, "pixel ({x}, {y}) is outside the film");
        let across = self.window.width.div_ceil(TILE);
        let tile = &self.tiles[(y / TILE * across + x / TILE) as usize];
        tile.pixels[(y % TILE * tile.window.width + x % TILE) as usize]
    }

    /// All pixels, row by row from the top.
    pub fn rows(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        (0..self.window.height).flat_map(move |y| (0..self.window.width).map(move |x| self.pixel(x, y)))
    }

    /// The picture in 8-bit display values, three a pixel, row by row from the top.
    pub fn to_rgb8(&self, pipeline: ColourPipeline) -> Vec<u8> {
        let mut bytes = vec![0; self.window.width as usize * self.window.height as usize * 3];
        for tile in &self.tiles {
            let (left, top) = (tile.window.x - self.window.x, tile.window.y - self.window.y);
            let rows = tile.pixels.chunks_exact(tile.window.width as usize);
            for (row, pixels) in (top..).zip(rows) {
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
        for FilmTile { window, pixels } in &self.tiles {
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
        let mut film = Film::new(window);
        for tile in film.tiles_mut() {
            let w = tile.window;
            for (i, pixel) in (0..).zip(&mut tile.pixels) {
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
        let mut film = Film::new(Window { x: 100, y: 200, width: 20, height: 20 });
        film.tiles_mut()[1].pixels[0][2] = f32::NAN;
        assert_eq!(film.non_finite(), (1, vec![(116, 200)]));
    }
}
