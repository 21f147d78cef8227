//! The samples of a tile's pixels: their positions, their order and their sums.
//!
//! The plan's stages run once per pass, each with at most [`RAYS_PER_BATCH`] rays: many through each pixel of a small block, so
//! that packets of camera rays are narrow ([`SamplePass`]). A round is the passes between two convergence tests. The
//! samples of a pixel and their order depend on the pixel alone. Where the test reads neighbours, the pixels around a tile are
//! sampled with it and discarded ([`SampledRegion`]), so that crops and tilings do not change a pixel.
//!
//! The test of a pixel reads the samples of its neighbours and none of its own, so that the mean of its first n samples
//! is unbiased, n being what the test chooses (Kirk and Arvo, Unbiased Sampling Techniques for Image Synthesis,
//! SIGGRAPH 1991). While a pixel is tested, its neighbours are sampled as well; samples beyond their own n only serve
//! the test.

use glam::DVec3;

use super::EffectContext;
use super::convergence::{self, Criterion};
use super::random::{self, Dimension};
use super::region::SampledRegion;
use super::sample_pass::SamplePass;
use super::tile::{Tile, vec_bytes};
use super::variance::SampleVariance;
use crate::bvh::detail::RayBuffer;
use crate::film::{ColourPipeline, ReconstructionFilter, Window};
use crate::scene::PixelSampler;
#[cfg(doc)]
use crate::world::RAYS_PER_BATCH;

/// How the pixels of a picture are sampled.
#[derive(Debug, Clone)]
pub struct PixelSampleSequence {
    /// Samples a pixel; the maximum where sampling is adaptive.
    pub samples: u32,
    /// The index of the first sample.
    pub first: u32,
    /// The reconstruction filter.
    pub filter: ReconstructionFilter,
    /// The seed of the random numbers.
    pub seed: u32,
    /// How the samples of a pixel are related.
    pub kind: PixelSampler,
    /// Samples that every pixel takes before the first convergence test.
    pub floor: u32,
    /// Width in pixels of the apron around a tile that is sampled for the convergence test.
    pub apron: u32,
    /// Whether all samples go through the pixel's centre, because none were asked for.
    pub centred: bool,
}

impl PixelSampleSequence {
    /// The sampler for the scene's settings.
    pub fn new(context: &EffectContext) -> Self {
        let sampling = context.sampling;
        let (shape, radius) = sampling.shape_and_radius();
        let samples = sampling.samples_taken();
        let is_adaptive = context.spec.adaptive;
        let floor = if is_adaptive { Criterion::new(sampling).min_samples.min(samples) } else { samples };
        PixelSampleSequence {
            samples,
            first: sampling.first_sample(),
            filter: ReconstructionFilter::new(shape, radius),
            seed: sampling.seed,
            kind: sampling.sampler,
            floor,
            // No pixel is tested where no noise level is given, or before it has all its samples.
            apron: match is_adaptive && sampling.noise.is_some() && floor < samples {
                true => convergence::neighbourhood_radius(context.spec.has_rare_light),
                false => 0,
            },
            centred: !sampling.is_wanted(),
        }
    }
}

/// Where a camera ray belongs: the seed of its random numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SampleIndex {
    /// Column and row of the pixel in the whole picture.
    pub(crate) x: u32,
    pub(crate) y: u32,
    /// The index of the sample.
    pub(crate) sample: u32,
}

impl SampleIndex {
    /// Its random numbers in a dimension.
    pub(crate) fn pair(&self, sampler: PixelSampler, seed: u32, dimension: Dimension) -> [f32; 2] {
        random::pair_of(sampler, [self.x, self.y], seed, self.sample, dimension)
    }
}

/// Lists the pixel and sample of each camera ray of a tile.
pub(crate) fn list_samples(tile: &Tile, into: &mut Vec<SampleIndex>) {
    match (tile.buffers::<TileSamples>(), tile.window) {
        (Some(samples), _) => {
            into.extend(samples.rays().map(|(x, y, sample)| SampleIndex { x, y, sample }));
        }
        (None, Some(window)) => into.extend((0..window.area() as u32).map(|i| SampleIndex {
            x: window.x + i % window.width,
            y: window.y + i / window.width,
            sample: 0,
        })),
        (None, None) => {}
    }
}

/// The random numbers of rays from the surfaces of a generation.
#[derive(Default)]
pub(crate) struct SurfaceNumbers {
    /// The samples of the camera rays; empty for other generations.
    samples: Vec<SampleIndex>,
}

impl SurfaceNumbers {
    /// Lists the samples of a tile's generation.
    pub(crate) fn start(&mut self, tile: &Tile) {
        self.samples.clear();
        if tile.depth == 0 {
            list_samples(tile, &mut self.samples);
        }
    }

    /// Uniform numbers of ray `k` of `count` from a surface, which the ray `index` of `rays` has hit.
    pub(crate) fn pair(
        &self,
        (sampler, seed, dimension): (PixelSampler, u32, Dimension),
        (rays, index): (&RayBuffer, usize),
        (k, count): (u32, u32),
    ) -> [f64; 2] {
        let (pixel, sample) = match self.samples.get(index) {
            Some(&SampleIndex { x, y, sample }) => ([x, y], sample),
            None => (random::bits_of_ray(&rays.get(index), seed), 0),
        };
        let number = sample.wrapping_mul(count).wrapping_add(k);
        random::pair_of(sampler, pixel, seed, number, dimension).map(f64::from)
    }

    /// Bytes of memory held.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Self>() + vec_bytes(&self.samples)
    }
}

/// The samples of a tile.
#[derive(Default)]
pub struct TileSamples {
    region: SampledRegion,
    /// For each pixel of the region, the sum of its samples.
    sums: Vec<SampleSum>,
    /// The same of the coverage of its samples; empty for pictures without an alpha channel.
    coverage: Vec<SampleSum>,
    /// The same of [`Tile::shown`]: colours and coverage; empty without.
    shown: [Vec<SampleSum>; 2],
    /// For each pixel of the region, the number of its samples that are part of the mean; [`u32::MAX`] while the pixel
    /// is tested.
    counts: Vec<u32>,
    /// The pixels that are still sampled, along a Morton curve.
    live: Vec<u16>,
    /// For each pixel of the region, its column and row in the picture.
    places: Vec<[u32; 2]>,
    /// The samples of the current round: first index, and end.
    round: (u32, u32),
    /// Rays of the round that were cast, over all pixels.
    cast: usize,
    pass: Box<SamplePass>,
    /// For each pixel of the region, the variance of its samples; `None` where nothing reads it.
    variances: Option<Vec<SampleVariance>>,
}

impl TileSamples {
    /// Begins a tile.
    pub fn start(&mut self, region: SampledRegion, sampler: &PixelSampleSequence, tile: &Tile) {
        let pixels = region.whole.area();
        self.region = region;
        self.sums.clear();
        self.sums.resize(pixels, SampleSum::default());
        self.coverage.clear();
        self.coverage.resize(if tile.coverage.is_some() { pixels } else { 0 }, SampleSum::default());
        for sums in &mut self.shown {
            sums.clear();
            sums.resize(if tile.shown.is_some() { pixels } else { 0 }, SampleSum::default());
        }
        if let Some(variances) = &mut self.variances {
            variances.clear();
            variances.resize(pixels, SampleVariance::default());
        }
        self.counts.clear();
        self.counts.resize(pixels, u32::MAX);
        region.list_along_curve(&mut self.live);
        let Window { x, y, width, height } = region.whole;
        self.places.clear();
        self.places.extend((y..y + height).flat_map(|row| (x..x + width).map(move |column| [column, row])));
        self.round = (sampler.first, sampler.floor);
        self.cast = 0;
    }

    /// Begins the next pass.
    pub fn next_pass(&mut self, sampler: &PixelSampleSequence) {
        let TileSamples { live, places, pass, .. } = self;
        pass.list(live, places, self.round, self.cast);
        self.cast += pass.len;
        pass.set_positions(sampler);
    }

    /// The film positions of the pass's rays in pixels, right of and below the picture's top left corner.
    pub fn film_positions(&self) -> (&[f64], &[f64]) {
        let SamplePass { len, x, y, .. } = &*self.pass;
        (&x[..*len], &y[..*len])
    }

    /// For each ray of the pass, the column and row of its pixel, and the index of its sample.
    pub fn rays(&self) -> impl Iterator<Item = (u32, u32, u32)> {
        let SamplePass { len, columns, rows, samples, .. } = &*self.pass;
        let places = columns[..*len].iter().zip(&**rows);
        places.zip(&**samples).map(|((&x, &y), &sample)| (x, y, sample))
    }

    /// Adds the colours, the coverage and the unlit surfaces of the pass's rays to their pixels.
    pub fn add(&mut self, tile: &Tile) {
        let TileSamples { pass, sums, coverage: covered, shown: shown_sums, counts, variances, .. } = self;
        let (colours, coverage) = (&tile.pixels, tile.coverage.as_deref().unwrap_or_default());
        let shown = tile.shown.as_deref().unwrap_or_default();
        let counted = |(pixel, index): (&u16, &u32)| {
            let pixel = usize::from(*pixel);
            (*index < counts[pixel]).then_some(pixel)
        };
        let pixels = || pass.pixels[..pass.len].iter().zip(&*pass.samples).map(counted);
        if let Some(variances) = variances {
            for (pixel, &colour) in pixels().zip(colours) {
                pixel.into_iter().for_each(|pixel| variances[pixel].add(colour));
            }
        }
        for ((pixel, &sign), &colour) in pixels().zip(&*pass.signs).zip(colours) {
            pixel.into_iter().for_each(|pixel| sums[pixel].add(colour, sign));
        }
        for ((pixel, &sign), &part) in pixels().zip(&*pass.signs).zip(coverage) {
            pixel.into_iter().for_each(|pixel| covered[pixel].add([part; 3], sign));
        }
        let [shown_colours, shown_parts] = shown_sums;
        for ((pixel, &sign), &[r, g, b, part]) in pixels().zip(&*pass.signs).zip(shown) {
            let Some(pixel) = pixel else { continue };
            shown_colours[pixel].add([r, g, b], sign);
            shown_parts[pixel].add([part; 3], sign);
        }
    }

    /// Sets whether the variance of each pixel's samples is computed from the next tile on.
    pub fn measure_variances(&mut self, on: bool) {
        self.variances = on.then(Vec::new);
    }

    /// For each of the tile's own pixels, the variance of its samples; empty unless [`TileSamples::measure_variances`].
    pub fn variances(&self) -> impl Iterator<Item = &SampleVariance> {
        let variances = self.variances.iter();
        variances.flat_map(|variances| self.region.tile_pixels().map(|pixel| &variances[pixel]))
    }

    /// Whether a sample is part of the mean of its pixel, if this is one of the region.
    pub(super) fn is_counted(&self, SampleIndex { x, y, sample }: SampleIndex) -> bool {
        let Window { x: left, y: top, width, .. } = self.region.whole;
        self.counts.get(((y - top) * width + x - left) as usize).is_some_and(|&count| sample < count)
    }

    /// For each ray of the pass whose sample is part of the mean, its pixel, its sign and its entry of `values`.
    pub fn counted_of_pass<'a, T>(&'a self, values: &'a [T]) -> impl Iterator<Item = (usize, f64, &'a T)> {
        let samples = self.of_pass(values).zip(&*self.pass.samples);
        samples.filter(|((pixel, ..), sample)| **sample < self.counts[*pixel]).map(|(values, _)| values)
    }

    /// For each ray of the pass, its pixel, its sign and its entry of `values`.
    pub fn of_pass<'a, T>(&'a self, values: &'a [T]) -> impl Iterator<Item = (usize, f64, &'a T)> {
        let SamplePass { len, pixels, signs, .. } = &*self.pass;
        let rays = pixels[..*len].iter().zip(&**signs).zip(values);
        rays.map(|((&pixel, &sign), value)| (usize::from(pixel), sign, value))
    }

    /// The pixel of a ray of the pass.
    pub fn pixel_of(&self, ray: u32) -> usize {
        usize::from(self.pass.pixels[ray as usize])
    }

    /// The pixels that are sampled.
    pub fn region(&self) -> SampledRegion {
        self.region
    }

    /// For each pixel of the region, the sum of its samples.
    pub fn sums(&self) -> &[SampleSum] {
        &self.sums
    }

    /// The pixels that are sampled.
    pub fn live(&self) -> impl Iterator<Item = usize> {
        self.live.iter().map(|&pixel| usize::from(pixel))
    }

    /// Whether the pass is the first of its tile.
    pub fn is_first_pass(&self) -> bool {
        self.round.0 == 0 && self.cast == self.pass.len
    }

    /// Whether the pass is the last of its round.
    pub fn is_round_done(&self) -> bool {
        self.cast == self.live.len() * (self.round.1 - self.round.0) as usize
    }

    /// The number of samples that live pixels have at the end of the round.
    pub fn round_end(&self) -> u32 {
        self.round.1
    }

    /// Begins another round, up to `end` samples, for the tile's own pixels that are not accurate, and for those that
    /// their test reads ([`SampledRegion::tested_by`]). `is_accurate` tests a pixel.
    pub fn start_round(&mut self, end: u32, is_accurate: impl Fn(usize) -> bool) {
        let TileSamples { live, counts, region, round, .. } = self;
        let is_open = |counts: &[u32], pixel| region.is_own(pixel) && counts[pixel] == u32::MAX;
        for pixel in live.iter().map(|&pixel| usize::from(pixel)) {
            if is_open(counts, pixel) && is_accurate(pixel) {
                counts[pixel] = round.1;
            }
        }
        live.retain(|&pixel| {
            let pixel = usize::from(pixel);
            is_open(counts, pixel) || region.tested_by(pixel).any(|near| is_open(counts, near))
        });
        self.round = (self.round.1, end);
        self.cast = 0;
    }

    /// Whether no pixel is sampled any further.
    pub fn is_finished(&self) -> bool {
        self.live.is_empty()
    }

    /// Ends the tile: writes the values, coverage and sample counts of its pixels.
    pub fn finish(&self, tile: &mut Tile, sampler: &PixelSampleSequence, pipeline: ColourPipeline) {
        let value = |sum: &SampleSum| match pipeline {
            // This pipeline rounds every value to 8 bits.
            ColourPipeline::U8 => pipeline.clamp(sum.value(&sampler.filter)),
            _ => sum.value(&sampler.filter),
        };
        let sums = || self.region.tile_pixels().map(|pixel| &self.sums[pixel]);
        tile.needs_more_samples = false;
        tile.pixels.clear();
        tile.pixels.extend(sums().map(|sum| value(sum).as_vec3().to_array()));
        tile.sample_counts.clear();
        tile.sample_counts.extend(sums().map(|sum| sum.count));
        if let Some(coverage) = &mut tile.coverage {
            coverage.clear();
            let covered =
                self.region.tile_pixels().map(|pixel| self.coverage[pixel].value(&sampler.filter).x as f32);
            // Filters with negative lobes can leave the range.
            coverage.extend(covered.map(|part| part.clamp(0.0, 1.0)));
        }
        if let Some(shown) = &mut tile.shown {
            shown.clear();
            let [colours, parts] = [0, 1].map(|k| {
                self.region
                    .tile_pixels()
                    .map(move |pixel| self.shown[k][pixel].value(&sampler.filter).as_vec3())
            });
            shown.extend(colours.zip(parts).map(|(colour, part)| colour.extend(part.x).to_array()));
        }
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        let TileSamples { sums, coverage, shown, counts, live, places, pass, variances, .. } = self;
        size_of::<TileSamples>()
            + vec_bytes(places)
            + vec_bytes(counts)
            + vec_bytes(sums)
            + vec_bytes(coverage)
            + shown.iter().map(vec_bytes).sum::<usize>()
            + variances.as_ref().map_or(0, vec_bytes)
            + vec_bytes(live)
            + size_of_val(&**pass)
    }
}

/// The sum of a pixel's samples. In f64, in which the rounding of [`crate::scene::MAX_SAMPLES`] sums of f32 values does not
/// show in f32, and equal samples add up exactly.
#[derive(Debug, Clone, Copy, Default)]
pub struct SampleSum {
    count: u32,
    /// The samples with negative sign.
    negative_count: u32,
    colours: DVec3,
    negative_colours: DVec3,
}

impl SampleSum {
    /// Adds a sample whose filter weight has this sign.
    #[inline(always)]
    pub fn add(&mut self, colour: [f32; 3], sign: f64) {
        let colour = DVec3::from(colour.map(f64::from));
        self.count += 1;
        self.colours += colour;
        if sign < 0.0 {
            self.negative_count += 1;
            self.negative_colours += colour;
        }
    }

    /// The mean of the samples without their signs.
    pub fn mean(&self) -> DVec3 {
        self.colours / f64::from(self.count)
    }

    /// The pixel's value through `filter`.
    ///
    /// For a filter with negative lobes: the mean, plus the mean of `sign * (colour - mean)` divided by the expected sign. This
    /// never divides by a sum of signs that may vanish, and equal samples give exactly their colour.
    pub fn value(&self, filter: &ReconstructionFilter) -> DVec3 {
        let mean = self.mean();
        if !filter.is_signed() {
            return mean;
        }
        let count = f64::from(self.count);
        let (signed, signs) =
            (self.colours - 2.0 * self.negative_colours, count - 2.0 * f64::from(self.negative_count));
        mean + (signed - mean * signs) / (count * filter.mean_sign())
    }

    /// The part of the pixel, through `filter`, of `count` of its samples, of which `negative_count` have negative sign.
    pub fn part(&self, [count, negative_count]: [u32; 2], filter: &ReconstructionFilter) -> f64 {
        let [colours, negative_colours] = [count, negative_count].map(|count| DVec3::splat(f64::from(count)));
        SampleSum { colours, negative_colours, ..*self }.value(filter).x
    }
}

/// For each light with an apparent diameter, the directions of its shadow rays from the surfaces of a generation.
#[derive(Default)]
pub(super) struct DiscPoints {
    pub(super) numbers: SurfaceNumbers,
    /// For each light, unit directions; empty for lights without a diameter.
    pub(super) directions: Vec<Vec<DVec3>>,
}

impl DiscPoints {
    /// The directions to a light; `None` for one without a diameter.
    pub(super) fn of_light(&self, index: usize) -> Option<&[DVec3]> {
        self.directions.get(index).map(Vec::as_slice).filter(|directions| !directions.is_empty())
    }

    pub(super) fn bytes(&self) -> usize {
        let directions: usize = self.directions.iter().map(vec_bytes).sum();
        self.numbers.bytes() + vec_bytes(&self.directions) + directions
    }
}
