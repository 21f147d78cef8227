//! The pixels that are sampled together with a tile.

use crate::film::{TILE, Window};

/// A tile and its apron: the pixels around it, within the picture, that the convergence test of its own pixels reads. Pixels are
/// numbered row by row from the top of `whole`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampledRegion {
    /// The tile with its apron.
    pub whole: Window,
    /// The tile.
    pub tile: Window,
}

impl Default for SampledRegion {
    fn default() -> Self {
        let empty = Window { x: 0, y: 0, width: 0, height: 0 };
        SampledRegion { whole: empty, tile: empty }
    }
}

impl SampledRegion {
    /// A tile with an apron of `apron` pixels, cut off at the borders of a picture of this width and height.
    pub fn new(tile: Window, apron: u32, [width, height]: [u32; 2]) -> Self {
        let (x, y) = (tile.x.saturating_sub(apron), tile.y.saturating_sub(apron));
        let right = tile.x.saturating_add(tile.width).saturating_add(apron).min(width);
        let bottom = tile.y.saturating_add(tile.height).saturating_add(apron).min(height);
        SampledRegion { whole: Window { x, y, width: right - x, height: bottom - y }, tile }
    }

    /// Whether a pixel belongs to the tile.
    #[inline(always)]
    pub fn is_own(&self, pixel: usize) -> bool {
        let SampledRegion { whole, tile } = self;
        let (x, y) = (whole.x + pixel as u32 % whole.width, whole.y + pixel as u32 / whole.width);
        // Left of and above the tile the differences wrap around to more than any width.
        x.wrapping_sub(tile.x) < tile.width && y.wrapping_sub(tile.y) < tile.height
    }

    /// The pixels up to `radius` columns and rows from a pixel, with itself, row by row from the top.
    #[inline(always)]
    pub fn neighbourhood(&self, pixel: usize, radius: u32) -> impl Iterator<Item = usize> + Clone + use<> {
        let Window { width, height, .. } = self.whole;
        let range = |at: u32, length: u32| [at.saturating_sub(radius), (at + radius + 1).min(length)];
        self.rectangle(range(pixel as u32 % width, width), range(pixel as u32 / width, height))
    }

    /// The up to eight pixels around a pixel.
    #[inline(always)]
    pub fn around(&self, pixel: usize) -> impl Iterator<Item = usize> + Clone + use<> {
        self.neighbourhood(pixel, 1).filter(move |&near| near != pixel)
    }

    /// The pixels whose further samples the test of a pixel reads: those of the up to eight around it that are in the
    /// same block of the picture. A tile of a whole picture is one block, so nothing is sampled beyond its first
    /// samples for other tiles.
    #[inline(always)]
    pub fn tested_by(&self, pixel: usize) -> impl Iterator<Item = usize> + Clone + use<> {
        let Window { x, y, width, height } = self.whole;
        let range = |at: u32, start: u32, length: u32| {
            let in_block = (start + at) % TILE;
            [at - u32::from(in_block > 0 && at > 0), (at + 1 + u32::from(in_block + 1 < TILE)).min(length)]
        };
        let (columns, rows) = (range(pixel as u32 % width, x, width), range(pixel as u32 / width, y, height));
        self.rectangle(columns, rows).filter(move |&near| near != pixel)
    }

    /// The pixels of ranges of columns and rows.
    #[inline(always)]
    fn rectangle(
        &self,
        [left, right]: [u32; 2],
        [top, bottom]: [u32; 2],
    ) -> impl Iterator<Item = usize> + Clone + use<> {
        let width = self.whole.width;
        (top..bottom).flat_map(move |row| (row * width + left) as usize..(row * width + right) as usize)
    }

    /// Lists all pixels along a Morton curve (Morton 1966): consecutive ones are in compact blocks.
    pub fn list_along_curve(&self, into: &mut Vec<u16>) {
        let Window { width, height, .. } = self.whole;
        let side = width.max(height).next_power_of_two();
        // The even bits of a number below 2^16.
        let coordinate = |code: u32| {
            let pairs = code & 0x5555;
            let fours = (pairs | pairs >> 1) & 0x3333;
            let eights = (fours | fours >> 2) & 0x0f0f;
            (eights | eights >> 4) & 0xff
        };
        into.clear();
        let places = (0..side * side).map(|code| (coordinate(code), coordinate(code >> 1)));
        let places = places.filter(|&(x, y)| x < width && y < height);
        into.extend(places.map(|(x, y)| (y * width + x) as u16));
    }

    /// The pixels of the tile, row by row from the top.
    pub fn tile_pixels(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        let SampledRegion { whole, tile } = *self;
        (tile.y - whole.y..tile.y - whole.y + tile.height).flat_map(move |row| {
            let start = (row * whole.width + tile.x - whole.x) as usize;
            start..start + tile.width as usize
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_lists_every_pixel_once_in_compact_blocks() {
        for [width, height] in [[1, 1], [16, 16], [18, 18], [5, 17], [16, 3]] {
            let tile = Window { x: 32, y: 48, width, height };
            let mut pixels = vec![7];
            SampledRegion { whole: tile, tile }.list_along_curve(&mut pixels);
            let mut sorted = pixels.clone();
            sorted.sort_unstable();
            assert!(sorted.iter().copied().eq(0..(width * height) as u16), "{width} x {height}");
            if [width, height] == [16, 16] {
                // Of a square with sides of a power of two, 4^n consecutive pixels are a square of 2^n.
                for (length, side) in [(4, 2), (16, 4), (64, 8)] {
                    for block in pixels.chunks(length) {
                        let first = block[0];
                        assert!(
                            block.iter().all(|i| i % 16 - first % 16 < side && i / 16 - first / 16 < side)
                        );
                    }
                }
            }
        }
    }
}
