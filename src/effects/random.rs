//! Random numbers as a pure function of pixel, sample, purpose and seed, so that threads, tiles and crops do not change them.
//!
//! Each pixel has its own Owen-scrambled Sobol sequence (Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020; crate
//! `sobol_burley`): the points of the Sobol sequence, shared by all pixels, scrambled by a hash of the pixel's position in the
//! whole picture. For every k, the first 2^k points lie in different cells of every grid of 2^k equal rectangles, so the points are
//! evenly distributed at every count.

use sobol_burley::parts::{hash, owen_scramble_rev, u32_to_f32_norm};

use super::PathSettings;
use crate::bvh::Ray;
use crate::film::rounding::pcg3d;
use crate::scene::{MAX_SAMPLES, PixelSampler};

/// A use of random numbers; the numbers of a sample in different dimensions are independent. All uses are listed here.
/// Their values determine pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Dimension(u32);

impl Dimension {
    /// The film position of a camera ray.
    pub const PIXEL: Dimension = Dimension(0);

    /// The point of the camera's lens.
    pub const LENS: Dimension = Dimension(1 << 30);

    /// Rays of ambient occlusion. Not for paths.
    pub const AMBIENT_OCCLUSION: Dimension = Dimension(u32::MAX - 1);

    /// Points on the disc of a directional light, by its index. Not for paths.
    pub fn disc(light: u32) -> Self {
        Dimension(u32::MAX - 2 - light)
    }

    /// Which surfaces a ray passes by their opacity; after bounces for paths alone.
    pub fn opacity(bounces: u32) -> Self {
        Dimension(u32::MAX - bounces)
    }

    /// The direction in which a path continues.
    pub fn direction(bounces: u32) -> Self {
        Dimension(1 + 4 * bounces)
    }

    /// The lobe of that direction, and Russian roulette.
    pub fn lobe_and_roulette(bounces: u32) -> Self {
        Dimension(2 + 4 * bounces)
    }

    /// The choice of a light, and of a point on it, for light sample `index` of a path vertex, below
    /// [`PathSettings::MAX_LIGHT_SAMPLES`].
    pub fn light(bounces: u32, index: u32) -> [Self; 2] {
        let further = FURTHER_LIGHT_SAMPLES + 2 * (bounces * PathSettings::MAX_LIGHT_SAMPLES + index);
        match index {
            0 => [Dimension(4 + 4 * bounces), Dimension(3 + 4 * bounces)],
            _ => [Dimension(further), Dimension(further + 1)],
        }
    }
}

/// The first dimension of further light samples, beyond those of the longest path.
const FURTHER_LIGHT_SAMPLES: u32 = 1 << 20;

/// The seed at a time in seconds: `seed` itself at 0, at each other time another one. It depends on every bit of the time,
/// so frames at different times have independent noise.
pub fn seed_at(seed: u32, seconds: f64) -> u32 {
    if seconds == 0.0 {
        return seed;
    }
    let bits = seconds.to_bits();
    pcg3d([seed, bits as u32, (bits >> 32) as u32])[0]
}

/// The seed of a second sequence of samples, independent of those of `seed`.
pub fn other_seed(seed: u32) -> u32 {
    pcg3d([seed, u32::MAX, u32::MAX])[1]
}

/// Two numbers from 0 to below 1 for a pixel's sample in a dimension other than [`Dimension::PIXEL`]: [`pair`] or
/// [`independent_pair`].
pub(crate) fn pair_of(
    sampler: PixelSampler,
    pixel: [u32; 2],
    seed: u32,
    sample: u32,
    dimension: Dimension,
) -> [f32; 2] {
    match sampler {
        PixelSampler::Sobol => pair(pixel, seed, sample, dimension),
        PixelSampler::Independent => independent_pair(pixel, seed, sample, dimension),
    }
}

/// Two independent uniform numbers from 0 to below 1 for a pixel's sample in a dimension: two applications of a hash, the first to
/// pixel, seed and dimension, the second to its result and the sample.
#[inline(always)]
pub fn independent_pair([x, y]: [u32; 2], seed: u32, sample: u32, dimension: Dimension) -> [f32; 2] {
    let [a, b, c] = pcg3d([x, y, seed.rotate_left(SEED_BITS) ^ hash(dimension.0)]);
    let [a, b, _] = pcg3d([a, b, c.wrapping_add(sample)]);
    [u32_to_f32_norm(a), u32_to_f32_norm(b)]
}

/// The bits that a seed is rotated by before it is mixed with a dimension.
const SEED_BITS: u32 = 4;

/// A point of the Sobol sequence in the unit square, with reversed bits: of [`Dimension::PIXEL`]. Samples of one index
/// share it in all pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Point([u32; 2]);

impl Point {
    /// The point of a sample, 0 to below [`MAX_SAMPLES`].
    pub fn new(sample: u32) -> Self {
        Point(sobol_rev((sample % MAX_SAMPLES).reverse_bits()))
    }
}

/// The scrambling of a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scramble([u32; 2]);

impl Scramble {
    /// The scrambling of the pixel in column `x`, row `y` of the whole picture.
    #[inline(always)]
    pub fn new(x: u32, y: u32, seed: u32) -> Self {
        // Rotated instead of shifted, so that no bit of the seed is lost.
        let [a, b, _] = pcg3d([x, y, seed.rotate_left(SEED_BITS)]);
        Scramble([a, b])
    }

    /// The scrambled point: two numbers from 0 to below 1.
    #[inline(always)]
    pub fn of(self, point: Point) -> [f32; 2] {
        let number = |i: usize| u32_to_f32_norm(owen_scramble_rev(point.0[i], self.0[i]).reverse_bits());
        [number(0), number(1)]
    }
}

/// Two numbers from 0 to below 1 for a pixel's sample in a dimension other than 0, which is that of
/// [`Dimension::PIXEL`]. The points of each dimension are a sequence as above, shuffled independently (padding; pbrt,
/// 4th edition, section 8.7.2).
#[inline(always)]
pub fn pair([x, y]: [u32; 2], seed: u32, sample: u32, dimension: Dimension) -> [f32; 2] {
    let key = hash(dimension.0);
    let index = owen_scramble_rev((sample % MAX_SAMPLES).reverse_bits(), key);
    let [a, b, c] = pcg3d([x, y, seed.rotate_left(SEED_BITS) ^ key]);
    // The order of the points, too, is the pixel's own.
    let [first, second] = sobol_rev(owen_scramble_rev(index, c));
    [(first, a), (second, b)]
        .map(|(point, scramble)| u32_to_f32_norm(owen_scramble_rev(point, scramble).reverse_bits()))
}

/// The first two dimensions of the Sobol sequence for the top 16 bits of an index with reversed bits, with reversed bits. The first
/// is the index itself. The generator matrix of the second is Pascal's triangle modulo 2 (Sobol, 1967), the Kronecker power of
/// [1 1; 0 1], so that one step a factor multiplies by it.
#[inline(always)]
fn sobol_rev(index_rev: u32) -> [u32; 2] {
    let index = (index_rev & 0xffff_0000).reverse_bits();
    let mut second = index;
    second ^= (second & 0xaaaa) >> 1;
    second ^= (second & 0xcccc) >> 2;
    second ^= (second & 0xf0f0) >> 4;
    second ^= (second & 0xff00) >> 8;
    [index, second]
}

/// A number from 0 to below 1 for a ray. Equal rays have equal numbers.
pub(crate) fn of_ray(ray: &Ray, seed: u32) -> f32 {
    u32_to_f32_norm(hash_of_ray(ray, seed)[0])
}

/// Random bits for a ray. Equal rays have equal bits.
pub(crate) fn bits_of_ray(ray: &Ray, seed: u32) -> [u32; 2] {
    let [x, y, _] = hash_of_ray(ray, seed);
    [x, y]
}

fn hash_of_ray(ray: &Ray, seed: u32) -> [u32; 3] {
    let [origin, direction] = [ray.origin(), ray.direction()].map(|v| v.to_array().map(f64::to_bits));
    let halves = |bits: [u64; 3], shift: u32| bits.map(|b| (b >> shift) as u32);
    let parts = [halves(origin, 0), halves(origin, 32), halves(direction, 0), halves(direction, 32)];
    parts.into_iter().fold([seed, 0, 0], |[a, b, c], [x, y, z]| pcg3d([a ^ x, b ^ y, c ^ z]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::distributions::chi_squared_upper;

    /// The p-value of the chi-squared test of pairs of numbers against uniform ones, on a grid of 16 x 16.
    fn uniformity(pairs: impl Iterator<Item = [f32; 2]>) -> f64 {
        let (mut cells, mut count) = ([0.0; 256], 0.0);
        for [a, b] in pairs {
            cells[(a * 16.0) as usize * 16 + (b * 16.0) as usize] += 1.0;
            count += 1.0;
        }
        let expected = count / 256.0;
        let squares = cells.iter().map(|observed: &f64| (observed - expected).powi(2));
        chi_squared_upper(squares.sum::<f64>() / expected, 255.0)
    }

    /// Numbers of consecutive samples, dimensions, pixels and seeds fill the square evenly: none of ten p-values of 65,536 pairs is
    /// below 1e-4, which has a probability of 1e-3, nor above 1 - 1e-4, as those of evenly distributed points would be. The same for
    /// the numbers of three samples in a cube, projected on their sum.
    #[test]
    fn independent_numbers_show_no_dependence() {
        let number =
            |x: u32, seed, sample, dimension| independent_pair([x, 7], seed, sample, Dimension(dimension))[0];
        let all = || (0..256).flat_map(|i| (0..256).map(move |j| (i, j)));
        let tests = [
            uniformity((0..65_536).map(|s| independent_pair([3, 5], 0, s, Dimension(2)))),
            uniformity(all().map(|(i, j)| [number(i, 0, j, 1), number(i, 0, j + 1, 1)])),
            uniformity(all().map(|(i, j)| [number(i, 0, j, 1), number(i, 0, j + 64, 1)])),
            uniformity(all().map(|(i, j)| [number(9, 0, i, j), number(9, 0, i, j + 1)])),
            uniformity(all().map(|(i, j)| [number(9, 0, i, j), number(9, 0, i, j + 4)])),
            uniformity(all().map(|(i, j)| [number(i, 0, j, 1), number(i + 1, 0, j, 1)])),
            uniformity(all().map(|(i, j)| [number(i, 3, j, 1), number(i, 4, j, 1)])),
            uniformity(all().map(|(i, j)| [number(i, j, 0, 1), number(i, j + 1, 0, 1)])),
            uniformity(all().map(|(i, j)| [number(i, 0, j, 0), number(i + 1, 0, j + 1, 0)])),
            uniformity(all().map(|(i, j)| {
                let sum = number(i, 0, j, 1) + number(i, 0, j + 1, 1);
                [sum.fract(), number(i, 0, j + 2, 1)]
            })),
        ];
        assert!(tests.iter().all(|p| (1e-4..1.0 - 1e-4).contains(p)), "{tests:?}");
        // The test itself: Sobol points are too even, and equal numbers on the diagonal.
        assert!(uniformity((0..65_536).map(|s| pair([3, 5], 0, s, Dimension(2)))) > 1.0 - 1e-4);
        assert!(uniformity((0..65_536).map(|s| [number(3, 0, s, 1); 2])) < 1e-100);
    }

    /// No two uses that a picture of either transport has share a dimension, up to the longest path and thousands of
    /// lights.
    #[test]
    fn every_use_has_its_own_dimension() {
        let of_vertex = |bounces| {
            let lights = (0..PathSettings::MAX_LIGHT_SAMPLES).flat_map(move |i| Dimension::light(bounces, i));
            let own = [Dimension::opacity, Dimension::direction, Dimension::lobe_and_roulette];
            own.map(|of| of(bounces)).into_iter().chain(lights)
        };
        let path: Vec<Dimension> =
            (0..=1000).flat_map(of_vertex).chain([Dimension::PIXEL, Dimension::LENS]).collect();
        let own = [Dimension::PIXEL, Dimension::LENS, Dimension::AMBIENT_OCCLUSION, Dimension::opacity(0)];
        let whitted: Vec<Dimension> = (0..10_000).map(Dimension::disc).chain(own).collect();
        for uses in [path, whitted] {
            let different: std::collections::HashSet<Dimension> = uses.iter().copied().collect();
            assert_eq!(different.len(), uses.len());
        }
    }

    /// The bits of the crate's table.
    #[test]
    fn the_sequence_is_that_of_sobol() {
        for index in 0..1u32 << 16 {
            let index_rev = index.reverse_bits();
            let expected = [0, 1].map(|dimension| sobol_burley::parts::sobol_rev(index_rev, dimension));
            assert_eq!(sobol_rev(index_rev | 0x1234), expected);
        }
    }

    /// Time 0 keeps the seed. A million frames have 1e12 / 2 / 2^32 = 116 equal pairs of 32-bit seeds, within 5 standard
    /// deviations of a Poisson distribution; frames after each other never.
    #[test]
    fn each_time_has_its_own_seed() {
        assert_eq!([seed_at(7, 0.0), seed_at(7, -0.0)], [7, 7]);
        assert_ne!(seed_at(0, 0.5), seed_at(0, f64::from_bits(0.5f64.to_bits() + 1)));
        for (seed, fps) in [(0, 30.0), (3, 24.0), (u32::MAX, 29.97)] {
            let seeds: Vec<u32> = (0..1_000_000).map(|frame| seed_at(seed, f64::from(frame) / fps)).collect();
            assert!(seeds.windows(2).all(|pair| pair[0] != pair[1]));
            let different: std::collections::HashSet<u32> = seeds.iter().copied().collect();
            let equal = (seeds.len() - different.len()) as f64;
            assert!((equal - 116.4).abs() < 5.0 * 116.4f64.sqrt(), "{equal}");
        }
    }

    #[test]
    fn every_bit_of_a_seed_counts() {
        let of = |seed| Scramble::new(3, 5, seed);
        for bit in 0..32 {
            assert_ne!(of(0), of(1 << bit), "bit {bit}");
        }
    }
}
