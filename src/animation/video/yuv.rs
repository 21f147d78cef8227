//! Conversion to Y'CbCr for video codecs.

use rayon::prelude::*;

use crate::film::Film;

/// A frame as Y'CbCr 4:2:0, 8 bits, in limited range (16 to 235, 16 to 240), by the matrix of ITU-R BT.709.
///
/// Chroma samples lie at H.264's default location (ITU-T H.264, figure E-1, type 0): on the left one of two columns,
/// between two rows. So they are filtered over three columns, weighted 1 2 1, and two rows. In integers, so the bits
/// are the same on every machine.
pub struct Yuv420 {
    /// Width and height of the luma plane: those of the frame, rounded up to even numbers.
    pub size: [usize; 2],
    /// Luma, row by row from the top.
    pub y: Vec<u8>,
    /// Blue difference, at half the width and height.
    pub u: Vec<u8>,
    /// Red difference, at half the width and height.
    pub v: Vec<u8>,
}

/// The weights of red, green and blue in luma (ITU-R BT.709-6, item 3.2).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// A weight in units of 1/65536, rounded.
const fn fixed(weight: f64) -> i32 {
    (weight * 65536.0 + if weight < 0.0 { -0.5 } else { 0.5 }) as i32
}

/// Luma weights of 8-bit values, with 219 steps from black to white.
const Y: [i32; 3] =
    [fixed(LUMA[0] * 219.0 / 255.0), fixed(LUMA[1] * 219.0 / 255.0), fixed(LUMA[2] * 219.0 / 255.0)];

/// The weights of (B - Y') / 1.8556 in 224 steps. That of green makes the sum exactly 0, so that greys have no chroma.
const U: [i32; 3] = {
    let [r, b] = [fixed(-LUMA[0] / 1.8556 * 224.0 / 255.0), fixed(0.5 * 224.0 / 255.0)];
    [r, -r - b, b]
};

/// The weights of (R - Y') / 1.5748 in 224 steps, likewise.
const V: [i32; 3] = {
    let [r, b] = [fixed(0.5 * 224.0 / 255.0), fixed(-LUMA[2] / 1.5748 * 224.0 / 255.0)];
    [r, -r - b, b]
};

fn dot(weights: [i32; 3], rgb: [i32; 3]) -> i32 {
    weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2]
}

/// Luma of a pixel.
#[inline(always)]
pub fn luma(rgb: [u8; 3]) -> u8 {
    ((dot(Y, rgb.map(i32::from)) + (16 << 16) + (1 << 15)) >> 16) as u8
}

/// Blue and red difference of a pixel.
#[inline(always)]
pub fn chroma(rgb: [u8; 3]) -> [u8; 2] {
    of_sum(rgb.map(i32::from), 0)
}

/// Blue and red difference of the mean of `2^shift` pixels, from their sum.
#[inline(always)]
fn of_sum(sum: [i32; 3], shift: u32) -> [u8; 2] {
    [U, V].map(|weights| {
        let whole = dot(weights, sum) + (128 << (16 + shift)) + (1 << (15 + shift));
        (whole >> (16 + shift)) as u8
    })
}

impl Yuv420 {
    /// Converts a frame. Where width or height is odd, the last column or row is repeated.
    pub fn of(film: &Film<[u8; 3]>) -> Self {
        let window = film.window();
        let [width, height] = [window.width, window.height].map(|n| n as usize);
        let size @ [wide, high] = [width.next_multiple_of(2), height.next_multiple_of(2)];
        let mut planes = Yuv420 {
            size,
            y: vec![0; wide * high],
            u: vec![0; wide * high / 4],
            v: vec![0; wide * high / 4],
        };
        let half = wide / 2;
        let rows = planes.y.par_chunks_mut(2 * wide * BAND);
        let rows = rows.zip(planes.u.par_chunks_mut(half * BAND)).zip(planes.v.par_chunks_mut(half * BAND));
        rows.enumerate().for_each(|(band, ((y, u), v))| {
            let (mut above, mut below) = (Vec::new(), Vec::new());
            let luma_rows = y.chunks_mut(2 * wide).zip(u.chunks_mut(half)).zip(v.chunks_mut(half));
            for (i, ((y, u), v)) in luma_rows.enumerate() {
                let row = 2 * (band * BAND + i);
                read_row(film, row.min(height - 1), wide, &mut above);
                read_row(film, (row + 1).min(height - 1), wide, &mut below);
                let (first, second) = y.split_at_mut(wide);
                first.iter_mut().zip(&above).for_each(|(y, &rgb)| *y = luma(rgb));
                second.iter_mut().zip(&below).for_each(|(y, &rgb)| *y = luma(rgb));
                for (x, (u, v)) in u.iter_mut().zip(v).enumerate() {
                    let columns = [(2 * x).saturating_sub(1), 2 * x, 2 * x, 2 * x + 1];
                    let mut sum = [0; 3];
                    for column in columns {
                        for c in 0..3 {
                            sum[c] += i32::from(above[column][c]) + i32::from(below[column][c]);
                        }
                    }
                    [*u, *v] = of_sum(sum, 3);
                }
            }
        });
        planes
    }
}

/// The pairs of rows in one parallel task.
const BAND: usize = 32;

/// Reads a row, its last pixel repeated up to `width`.
fn read_row(film: &Film<[u8; 3]>, row: usize, width: usize, pixels: &mut Vec<[u8; 3]>) {
    pixels.clear();
    film.row(row as u32).for_each(|part| pixels.extend_from_slice(part));
    while pixels.len() < width {
        pixels.push(*pixels.last().expect("a picture has a column"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn film(width: u32, height: u32, pixels: &[[u8; 3]]) -> Film<[u8; 3]> {
        Film::from_rows(Window { x: 0, y: 0, width, height }, pixels).unwrap()
    }

    /// Against the formulas of BT.709-6, items 3.2 to 3.5, in floating point.
    #[test]
    fn colours_are_those_of_the_standard() {
        for r in (0..=255u8).step_by(15) {
            for g in (0..=255u8).step_by(15) {
                for b in (0..=255u8).step_by(15) {
                    let [red, green, blue] = [r, g, b].map(|c| f64::from(c) / 255.0);
                    let y = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
                    let exact = [
                        219.0 * y + 16.0,
                        224.0 * (blue - y) / 1.8556 + 128.0,
                        224.0 * (red - y) / 1.5748 + 128.0,
                    ];
                    let [u, v] = chroma([r, g, b]);
                    for (ours, exact) in [luma([r, g, b]), u, v].into_iter().zip(exact) {
                        assert!((f64::from(ours) - exact).abs() < 0.505, "{r} {g} {b}: {ours} {exact}");
                    }
                }
            }
        }
        assert_eq!((luma([0; 3]), luma([255; 3])), (16, 235));
        assert!((0..=255).all(|grey| chroma([grey; 3]) == [128, 128]));
    }

    #[test]
    fn chroma_is_of_three_columns_and_two_rows() {
        // One red pixel at column 1, row 0 of 4 x 2. The sample at column 0 sees it with 1/8, that at column 2 with
        // 1/8; a red pixel at column 2 counts a quarter there, and nothing at column 0.
        let black = [0; 3];
        let red = [255, 0, 0];
        let at = |column: usize| {
            let mut pixels = [black; 8];
            pixels[column] = red;
            Yuv420::of(&film(4, 2, &pixels)).v
        };
        // (224 / 2) * share + 128, rounded: 112 / 8 = 14, 112 / 4 = 28.
        assert_eq!(at(1), [142, 142]);
        assert_eq!(at(2), [128, 156]);
        // At the left edge the column beyond is the first again: (1 + 2) / 8 of 112 = 42.
        assert_eq!(at(0), [170, 128]);
    }

    #[test]
    fn odd_pictures_are_filled_up() {
        let pixels: Vec<[u8; 3]> = (0..15).map(|i| [i * 16; 3]).collect();
        let planes = Yuv420::of(&film(5, 3, &pixels));
        assert_eq!(planes.size, [6, 4]);
        let y = |x: usize, row: usize| planes.y[row * 6 + x];
        assert_eq!(
            (y(4, 1), y(5, 1), y(5, 2), y(5, 3)),
            (luma([144; 3]), luma([144; 3]), luma([224; 3]), luma([224; 3]))
        );
        assert_eq!((planes.u.len(), planes.v.len()), (6, 6));
        assert!(planes.u.iter().chain(&planes.v).all(|&c| c == 128));
    }
}
