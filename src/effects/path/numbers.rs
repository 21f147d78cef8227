//! The random numbers of path vertices, those that most vertices take computed for a generation at once.

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

impl Sequence {
    /// The dimensions that are computed at once: the light, the point on it, the direction, lobe and roulette.
    fn dimensions(self) -> [Dimension; 4] {
        let [light, point] = Dimension::light(self.depth, 0);
        [light, point, Dimension::direction(self.depth), Dimension::lobe_and_roulette(self.depth)]
    }
}

/// The random numbers of the vertices of a generation, as structures of arrays.
#[derive(Default)]
pub(super) struct GenerationNumbers {
    pixels: [PerRay<u32>; 2],
    samples: PerRay<u32>,
    /// For each of [`Sequence::dimensions`], two numbers of each vertex.
    pairs: [[PerRay<f32>; 2]; 4],
}

impl GenerationNumbers {
    /// Computes the numbers of vertices with the given pixels and samples.
    pub(super) fn fill(&mut self, vertices: impl Iterator<Item = SampleIndex>, sequence: Sequence) {
        let mut count = 0;
        for (i, SampleIndex { x, y, sample }) in vertices.enumerate() {
            (self.pixels[0][i], self.pixels[1][i], self.samples[i]) = (x, y, sample);
            count = i + 1;
        }
        let Sequence { seed, sampler, .. } = sequence;
        for (which, dimension) in sequence.dimensions().into_iter().enumerate() {
            match sampler {
                PixelSampler::Sobol => {
                    simd!(self.fill_pairs(which, count, |pixel, sample| random::pair(
                        pixel, seed, sample, dimension
                    )));
                }
                PixelSampler::Independent => simd!(self.fill_pairs(which, count, |pixel, sample| {
                    random::independent_pair(pixel, seed, sample, dimension)
                })),
            }
        }
    }

    #[inline(always)]
    fn fill_pairs(&mut self, which: usize, count: usize, pair: impl Fn([u32; 2], u32) -> [f32; 2]) {
        let GenerationNumbers { pixels: [x, y], samples, pairs } = self;
        let [first, second] = &mut pairs[which];
        for i in 0..count.min(RAYS_PER_BATCH) {
            [first[i], second[i]] = pair([x[i], y[i]], samples[i]);
        }
    }

    fn pair(&self, which: usize, vertex: usize) -> [f64; 2] {
        self.pairs[which].each_ref().map(|numbers| numbers[vertex].into())
    }
}

/// The random numbers of a path vertex, each from 0 to below 1.
pub(super) struct Numbers<'a> {
    pub(super) sequence: Sequence,
    pub(super) sample: SampleIndex,
    pub(super) generation: &'a GenerationNumbers,
    /// The index of the vertex in its generation.
    pub(super) vertex: usize,
}

impl Numbers<'_> {
    /// The choice of a light, and of a point on it, for light sample `index`.
    pub(super) fn light(&self, index: u32) -> [[f64; 2]; 2] {
        if index == 0 {
            return [0, 1].map(|which| self.generation.pair(which, self.vertex));
        }
        let Sequence { seed, sampler, depth } = self.sequence;
        Dimension::light(depth, index)
            .map(|dimension| self.sample.pair(sampler, seed, dimension).map(f64::from))
    }

    /// The direction in which the path continues.
    pub(super) fn direction(&self) -> [f64; 2] {
        self.generation.pair(2, self.vertex)
    }

    /// The lobe of that direction, and Russian roulette.
    pub(super) fn lobe_and_roulette(&self) -> [f64; 2] {
        self.generation.pair(3, self.vertex)
    }
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
            generation.fill((0..RAYS_PER_BATCH as u32).map(sample), sequence);
            generation.fill((0..100).map(sample), sequence);
            for i in 0..RAYS_PER_BATCH as u32 {
                let numbers =
                    Numbers { sequence, sample: sample(i), generation: &generation, vertex: i as usize };
                let of = |dimension| sample(i).pair(sampler, 5, dimension).map(f64::from);
                assert_eq!(numbers.light(0), Dimension::light(2, 0).map(of));
                assert_eq!(numbers.light(1), Dimension::light(2, 1).map(of));
                assert_eq!(numbers.direction(), of(Dimension::direction(2)));
                assert_eq!(numbers.lobe_and_roulette(), of(Dimension::lobe_and_roulette(2)));
            }
        }
    }
}
