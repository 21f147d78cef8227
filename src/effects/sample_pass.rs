//! [`SamplePass`]: the camera rays of one pass of a tile's samples, and their order.
//!
//! All samples of a small block of pixels are taken together, because packets of their camera and shadow rays are narrow.
//! A pixel's own samples are in ascending order, so pictures do not depend on blocks.

use super::random::{Dimension, Point, Scramble, independent_pair};
use super::samples::PixelSampleSequence;
use crate::scene::PixelSampler;
use crate::world::{PerRay, RAYS_PER_BATCH, simd};

/// The fewest pixels of a block, but for those at the end: 4 x 4. Measurements: docs/decisions.md.
const MIN_PIXELS_PER_BLOCK: usize = 16;

/// The pixels whose `samples` samples each are taken together: as few as fill a batch.
fn pixels_per_block(samples: usize) -> usize {
    (RAYS_PER_BATCH / samples.max(1)).max(MIN_PIXELS_PER_BLOCK)
}

/// The rays of a pass.
#[derive(Default)]
pub(super) struct SamplePass {
    pub(super) len: usize,
    /// For each ray, its pixel of the region, and the column and row of that in the picture.
    pub(super) pixels: PerRay<u16>,
    pub(super) columns: PerRay<u32>,
    pub(super) rows: PerRay<u32>,
    /// For each ray, the index of its sample.
    pub(super) samples: PerRay<u32>,
    /// For each ray, its point of the sequence.
    points: PerRay<Point>,
    /// Film positions in pixels, right of and below the picture's top left corner.
    pub(super) x: PerRay<f64>,
    pub(super) y: PerRay<f64>,
    /// Signs of the filter weights, 1 or -1.
    pub(super) signs: PerRay<f64>,
}

impl SamplePass {
    /// Lists the rays that follow the first `cast` rays of a round of samples `from` to `to` of the pixels `live`: block
    /// by block, in a block sample by sample. `places` are the columns and rows of the region's pixels.
    pub(super) fn list(&mut self, live: &[u16], places: &[[u32; 2]], (from, to): (u32, u32), cast: usize) {
        let samples = (to - from) as usize;
        self.len = RAYS_PER_BATCH.min(live.len() * samples - cast);
        let pixels = pixels_per_block(samples);
        let block_at = |start: usize| start..live.len().min(start + pixels);
        let mut block = block_at(cast / (pixels * samples) * pixels);
        let cast_of_block = cast - block.start * samples;
        let mut pixel = block.start + cast_of_block % block.len();
        let mut sample = from + (cast_of_block / block.len()) as u32;
        let mut point = Point::new(sample);
        for i in 0..self.len {
            (self.pixels[i], self.samples[i], self.points[i]) = (live[pixel], sample, point);
            [self.columns[i], self.rows[i]] = places[usize::from(live[pixel])];
            pixel += 1;
            if pixel == block.end && i + 1 < self.len {
                sample += 1;
                if sample == to {
                    (block, sample) = (block_at(block.end), from);
                }
                pixel = block.start;
                point = Point::new(sample);
            }
        }
    }

    /// Computes the film positions and signs.
    pub(super) fn set_positions(&mut self, sampler: &PixelSampleSequence) {
        match sampler.filter.box_radius() {
            // Without the table of other filters, whose look-ups take longer than the rest.
            Some(radius) => simd!(self.set_positions_by(
                sampler,
                #[inline(always)]
                |[x, y]| ([x, y].map(|u| (2.0 * f64::from(u) - 1.0) * radius), 1.0)
            )),
            None => simd!(self.set_positions_by(
                sampler,
                #[inline(always)]
                |numbers| sampler.filter.sample(numbers)
            )),
        }
    }

    /// [`SamplePass::place`]; `filter` is [`ReconstructionFilter::place`](crate::film::ReconstructionFilter::place).
    #[inline(always)]
    fn set_positions_by(
        &mut self,
        sampler: &PixelSampleSequence,
        filter: impl Fn([f32; 2]) -> ([f64; 2], f64),
    ) {
        for i in 0..self.len.min(RAYS_PER_BATCH) {
            let (x, y) = (self.columns[i], self.rows[i]);
            let numbers = match sampler.kind {
                PixelSampler::Sobol => Scramble::new(x, y, sampler.seed).of(self.points[i]),
                PixelSampler::Independent => {
                    independent_pair([x, y], sampler.seed, self.samples[i], Dimension::PIXEL)
                }
            };
            let ([right, down], sign) = if sampler.centred { ([0.0; 2], 1.0) } else { filter(numbers) };
            self.x[i] = f64::from(x) + 0.5 + right;
            self.y[i] = f64::from(y) + 0.5 + down;
            self.signs[i] = sign;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounds of 1 to 600 samples of 1 to 324 pixels: every sample once, those of a pixel in order, passes full but for the
    /// last, and no more pixels in a packet of 256 rays than its block and the next have.
    #[test]
    fn passes_list_every_sample_once_in_the_order_of_its_pixel() {
        let places: Vec<[u32; 2]> = (0..324).map(|i| [100 + i % 18, 200 + i / 18]).collect();
        let mut pass = Box::<SamplePass>::default();
        for count in [1, 3, 15, 16, 17, 100, 256, 324] {
            // Every third pixel is done if they are few.
            let step = if count <= 100 { 3 } else { 1 };
            let live: Vec<u16> = (0..count as u16).map(|i| i * step).collect();
            for (from, to) in [(0, 1), (0, 2), (4, 7), (1, 33), (2, 66), (64, 664)] {
                let all = count * (to - from) as usize;
                let mut next = vec![from; 324];
                let mut cast = 0;
                while cast < all {
                    pass.list(&live, &places, (from, to), cast);
                    assert_eq!(pass.len, RAYS_PER_BATCH.min(all - cast));
                    for i in 0..pass.len {
                        let pixel = usize::from(pass.pixels[i]);
                        assert_eq!(pass.samples[i], next[pixel], "{count} pixels, samples {from} to {to}");
                        assert_eq!(pass.points[i], Point::new(next[pixel]));
                        assert_eq!([pass.columns[i], pass.rows[i]], places[pixel]);
                        next[pixel] += 1;
                    }
                    if to - from >= 32 {
                        for packet in pass.pixels[..pass.len].chunks(256) {
                            let mut pixels = packet.to_vec();
                            pixels.sort_unstable();
                            pixels.dedup();
                            assert!(pixels.len() <= 32, "{} pixels in a packet", pixels.len());
                        }
                    }
                    cast += pass.len;
                }
                for (pixel, &next) in next.iter().enumerate() {
                    let is_live = live.contains(&(pixel as u16));
                    assert_eq!(next, if is_live { to } else { from });
                }
            }
        }
    }
}
