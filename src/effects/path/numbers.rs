//! The random numbers of path vertices, computed for a generation at once.

use crate::effects::random::{self, Dimension};
use crate::effects::samples::SampleIndex;
use crate::scene::PixelSampler;
use crate::world::{PerRay, RAYS_PER_BATCH, simd};

/// What the random numbers of a generation depend on, besides pixel and sample.
#[derive(Clone, Copy)]
pub(super) struct Sequence {
    pub(super) seed: u32,
    pub(super) sampler: PixelSampler,
    /// The bounces of the paths.
    pub(super) depth: u32,
}

/// The random numbers of the vertices of a generation, each from 0 to below 1, as structures of arrays.
#[derive(Default)]
pub(super) struct GenerationNumbers {
    count: usize,
    pixels: [PerRay<u32>; 2],
    samples: PerRay<u32>,
    /// Two numbers of each vertex: for the choice of a light, the point on it, the direction, lobe and roulette.
    light: [PerRay<f32>; 2],
    point: [PerRay<f32>; 2],
    direction: [PerRay<f32>; 2],
    lobe_and_roulette: [PerRay<f32>; 2],
}

impl GenerationNumbers {
    /// Computes the numbers of vertices with the given pixels and samples, but for those of light samples.
    pub(super) fn fill(&mut self, vertices: impl Iterator<Item = SampleIndex>, sequence: Sequence) {
        self.count = 0;
        for (i, SampleIndex { x, y, sample }) in vertices.enumerate() {
            (self.pixels[0][i], self.pixels[1][i], self.samples[i]) = (x, y, sample);
            self.count = i + 1;
        }
        self.fill_pairs(sequence, Dimension::direction(sequence.depth), |numbers| &mut numbers.direction);
        self.fill_pairs(sequence, Dimension::lobe_and_roulette(sequence.depth), |numbers| {
            &mut numbers.lobe_and_roulette
        });
    }

    /// Computes the numbers of light sample `index` of the same vertices.
    pub(super) fn fill_light(&mut self, sequence: Sequence, index: u32) {
        let [light, point] = Dimension::light(sequence.depth, index);
        self.fill_pairs(sequence, light, |numbers| &mut numbers.light);
        self.fill_pairs(sequence, point, |numbers| &mut numbers.point);
    }

    fn fill_pairs(
        &mut self,
        Sequence { seed, sampler, .. }: Sequence,
        dimension: Dimension,
        of: impl Fn(&mut Self) -> &mut [PerRay<f32>; 2],
    ) {
        match sampler {
            PixelSampler::Sobol => {
                let pair = |pixel, sample| random::pair(pixel, seed, sample, dimension);
                simd!(self.compute(&of, pair));
            }
            PixelSampler::Independent => {
                let pair = |pixel, sample| random::independent_pair(pixel, seed, sample, dimension);
                simd!(self.compute(&of, pair));
            }
        }
    }

    #[inline(always)]
    fn compute(
        &mut self,
        of: impl Fn(&mut Self) -> &mut [PerRay<f32>; 2],
        pair: impl Fn([u32; 2], u32) -> [f32; 2],
    ) {
        for i in 0..self.count.min(RAYS_PER_BATCH) {
            let [first, second] = pair([self.pixels[0][i], self.pixels[1][i]], self.samples[i]);
            let pairs = of(self);
            (pairs[0][i], pairs[1][i]) = (first, second);
        }
    }

    /// The choice of a light, and of a point on it.
    #[inline(always)]
    pub(super) fn light_and_point(&self, vertex: usize) -> [[f64; 2]; 2] {
        [&self.light, &self.point].map(|pair| at(pair, vertex))
    }

    /// The direction in which the path continues.
    #[inline(always)]
    pub(super) fn direction(&self, vertex: usize) -> [f64; 2] {
        at(&self.direction, vertex)
    }

    /// The lobe of that direction, and Russian roulette.
    #[inline(always)]
    pub(super) fn lobe_and_roulette(&self, vertex: usize) -> [f64; 2] {
        at(&self.lobe_and_roulette, vertex)
    }
}

#[inline(always)]
fn at([first, second]: &[PerRay<f32>; 2], vertex: usize) -> [f64; 2] {
    [first[vertex].into(), second[vertex].into()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers computed at once are those of each vertex alone, with either sampler.
    #[test]
    fn numbers_of_a_generation_are_those_of_its_vertices() {
        let sample = |i: u32| SampleIndex { x: i % 7, y: i / 7, sample: 3 * i };
        let mut generation = Box::<GenerationNumbers>::default();
        for sampler in [PixelSampler::Sobol, PixelSampler::Independent] {
            let sequence = Sequence { seed: 5, sampler, depth: 2 };
            generation.fill((0..100).map(sample), sequence);
            generation.fill((0..RAYS_PER_BATCH as u32).map(sample), sequence);
            for index in [0, 1] {
                generation.fill_light(sequence, index);
                for i in 0..RAYS_PER_BATCH as u32 {
                    let of = |dimension| sample(i).pair(sampler, 5, dimension).map(f64::from);
                    let vertex = i as usize;
                    assert_eq!(generation.light_and_point(vertex), Dimension::light(2, index).map(of));
                    assert_eq!(generation.direction(vertex), of(Dimension::direction(2)));
                    assert_eq!(generation.lobe_and_roulette(vertex), of(Dimension::lobe_and_roulette(2)));
                }
            }
        }
    }
}
