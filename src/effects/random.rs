//! Random numbers: a function of pixel, sample, purpose and seed, and of nothing else. So no thread, tile or crop changes
//! them.
//!
//! Each pixel has an Owen-scrambled Sobol sequence of its own (Burley, Practical Hash-based Owen Scrambling, JCGT 9(4),
//! 2020; crate `sobol_burley`): the points of Sobol's sequence are the same for all, and scrambled by a hash of the pixel's place
//! in the whole picture. The first 2^k points lie in different cells of every grid of 2^k equal rectangles, for every k: so
//! they are spread evenly at every count, not only at the last.

use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev, u32_to_f32_norm};

use crate::scene::MOST_SAMPLES;

/// What numbers are drawn for. Those of different purposes have nothing in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Where in the pixel a primary ray goes through.
    Pixel,
}

/// How many bits of a seed make room for a purpose.
const BITS_OF_PURPOSES: u32 = 4;

/// A point of Sobol's sequence in the unit square, its bits in reverse: what a sample of all pixels has in common.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Point([u32; 2]);

impl Point {
    /// That of a sample, counted from 0 to below [`MOST_SAMPLES`].
    pub fn new(sample: u32, purpose: Purpose) -> Self {
        let index = (sample % MOST_SAMPLES).reverse_bits();
        // In an order of its own for each purpose, in which a stretch of 2^k points at a multiple of 2^k is still such a stretch.
        let shuffled = match purpose as u32 {
            0 => index,
            other => owen_scramble_rev(index, hash(other)),
        };
        Point([sobol_rev(shuffled, 0), sobol_rev(shuffled, 1)])
    }
}

/// What a pixel makes of points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scramble([u32; 2]);

impl Scramble {
    /// That of the pixel in column `x`, row `y` of the whole picture.
    #[inline(always)]
    pub fn new(x: u32, y: u32, seed: u32, purpose: Purpose) -> Self {
        // Turned and not shifted: no bit of a seed is lost.
        let [a, b, _] = pcg3d([x, y, seed.rotate_left(BITS_OF_PURPOSES) ^ purpose as u32]);
        Scramble([a, b])
    }

    /// A point scrambled: two numbers from 0 to below 1.
    #[inline(always)]
    pub fn of(self, point: Point) -> [f32; 2] {
        let number = |i: usize| u32_to_f32_norm(owen_scramble_rev(point.0[i], self.0[i]).reverse_bits());
        [number(0), number(1)]
    }
}

/// Jarzynski and Olano, Hash Functions for GPU Rendering (JCGT 9(3), 2020), listing `pcg3d`: each bit of the input changes
/// each of the output with a chance of about a half.
#[inline(always)]
fn pcg3d(v: [u32; 3]) -> [u32; 3] {
    let mixed = |[x, y, z]: [u32; 3]| {
        let x = x.wrapping_add(y.wrapping_mul(z));
        let y = y.wrapping_add(z.wrapping_mul(x));
        [x, y, z.wrapping_add(x.wrapping_mul(y))]
    };
    let spread = v.map(|c| c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mixed(mixed(spread).map(|c| c ^ (c >> 16)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_a_seed_counts() {
        let of = |seed| Scramble::new(3, 5, seed, Purpose::Pixel);
        for bit in 0..32 {
            assert_ne!(of(0), of(1 << bit), "bit {bit}");
        }
    }
}
