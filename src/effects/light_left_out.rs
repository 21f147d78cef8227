//! The light that the limits of a picture leave out: of the bounces of paths, and the clamp.
//!
//! The effect `left-out` switches it on. The transport estimates it for each sample ([`LeftOutSample`]), without bias
//! and apart from the picture, which does not change. Here samples become pixels, and these the totals of the picture
//! with their standard errors.

use std::fmt;

use glam::DVec3;

use super::PathSettings;
use super::samples::{SampleIndex, TileSamples};
use super::tile::{Tile, vec_bytes};
use crate::film::colour::luminance;

/// The radiance left out of a sample that lacks some.
pub(super) struct LeftOutSample {
    /// The sample.
    pub(super) index: SampleIndex,
    /// By the limits on bounces: an estimate, mostly 0.
    pub(super) by_depth: DVec3,
    /// By the clamp.
    pub(super) by_clamp: DVec3,
}

/// The light left out of a tile, and the totals of the tiles of a thread.
#[derive(Default)]
pub struct LeftOut {
    /// The samples of the current pass that lack light.
    pub(super) samples: Vec<LeftOutSample>,
    /// For each pixel of the tile, the sums of its samples; the means once the tile is complete.
    pixels: Vec<PixelSums>,
    /// Whether `pixels` are those of a tile whose samples are not complete.
    is_open: bool,
    /// The totals of each tile, with the column and row of its first pixel: in this order, sums do not depend on
    /// threads.
    tiles: Vec<([u32; 2], LeftOutLight)>,
    /// The light and the rays of paths beyond the limits, of the current tile.
    pub(super) bounces: ByBounces,
}

/// The sums of a pixel's samples.
#[derive(Clone, Copy, Default)]
struct PixelSums {
    radiance: DVec3,
    /// Luminance and its square, by limits on bounces and by the clamp.
    causes: [[f64; 2]; 2],
}

impl LeftOut {
    pub(super) fn bytes(&self) -> usize {
        let LeftOut { samples, pixels, tiles, .. } = self;
        vec_bytes(samples) + vec_bytes(pixels) + vec_bytes(tiles)
    }

    /// Adds the samples of a pass, and, after the last, those of the tile to the totals.
    pub(super) fn end_pass(&mut self, tile: &Tile) {
        let Some(window) = tile.window else { return };
        if !std::mem::replace(&mut self.is_open, true) {
            self.pixels.clear();
            self.pixels.resize(window.area(), PixelSums::default());
        }
        let pixels = tile.buffers::<TileSamples>();
        for &LeftOutSample { index, by_depth, by_clamp } in &self.samples {
            // Some samples serve the convergence test alone, as all of the pixels around the tile do.
            let (x, y) = (index.x.wrapping_sub(window.x), index.y.wrapping_sub(window.y));
            let is_own = x < window.width && y < window.height;
            if !is_own || pixels.is_some_and(|pixels| !pixels.is_counted(index)) {
                continue;
            }
            let sums = &mut self.pixels[(y * window.width + x) as usize];
            sums.radiance += by_depth + by_clamp;
            for ([sum, squares], radiance) in sums.causes.iter_mut().zip([by_depth, by_clamp]) {
                let value = luminance(radiance);
                *sum += value;
                *squares += value * value;
            }
        }
        if !tile.needs_more_samples {
            self.is_open = false;
            let totals = LeftOutTotals::of_tile(&mut self.pixels, tile);
            let bounces = std::mem::take(&mut self.bounces);
            self.tiles.push(([window.y, window.x], LeftOutLight { totals, bounces }));
        }
    }

    /// The radiance left out of each pixel of the last tile, row by row: the mean of its samples.
    pub(crate) fn of_pixels(&self) -> impl Iterator<Item = [f32; 3]> {
        self.pixels.iter().map(|sums| sums.radiance.as_vec3().to_array())
    }
}

/// The light left out of a picture, in luminance, and where deeper limits would find it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LeftOutLight {
    /// The totals of its pixels.
    totals: LeftOutTotals,
    bounces: ByBounces,
}

/// The paths beyond the limits, by the number of bounces that count beyond the limit on these; first those beyond that
/// of specular bounces. Sums of samples: of pixels with more samples more counts, unlike in the totals.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ByBounces {
    /// The luminance that they find.
    pub(super) light: Vec<f64>,
    /// Their rays.
    pub(super) rays: Vec<f64>,
}

impl ByBounces {
    pub(super) fn add(&mut self, other: &Self) {
        for (own, other) in [(&mut self.light, &other.light), (&mut self.rays, &other.rays)] {
            own.resize(own.len().max(other.len()), 0.0);
            own.iter_mut().zip(other).for_each(|(own, other)| *own += other);
        }
    }
}

/// The light left out of some pixels, in luminance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct LeftOutTotals {
    /// Pixels.
    pixels: f64,
    /// Samples.
    samples: f64,
    /// The sum of the picture's pixels.
    light: f64,
    /// By limits on bounces, and by the clamp.
    causes: [PixelTotal; 2],
}

/// The sum of pixels, and its variance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct PixelTotal {
    sum: f64,
    variance: f64,
}

/// An estimate with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl LeftOutTotals {
    /// The totals of a complete tile. Divides the sums of radiance by the number of samples.
    fn of_tile(pixels: &mut [PixelSums], tile: &Tile) -> Self {
        let light = tile.pixels.iter().map(|p| luminance(DVec3::from(p.map(f64::from)))).sum();
        let mut totals = LeftOutTotals { pixels: pixels.len() as f64, light, ..LeftOutTotals::default() };
        for (i, PixelSums { radiance, causes }) in pixels.iter_mut().enumerate() {
            let n = tile.sample_counts.get(i).map_or(1.0, |&count| f64::from(count));
            totals.samples += n;
            *radiance /= n;
            for (total, [sum, squares]) in totals.causes.iter_mut().zip(causes) {
                total.sum += *sum / n;
                // The variance of one sample is unknown; its square is an upper bound in expectation.
                let deviations = if n > 1.0 { (*squares - *sum * *sum / n) / (n - 1.0) } else { *squares };
                total.variance += deviations.max(0.0) / n;
            }
        }
        totals
    }

    /// Adds `factor` times other totals.
    fn add(&mut self, other: &Self, factor: f64) {
        self.light += factor * other.light;
        for (total, other) in self.causes.iter_mut().zip(&other.causes) {
            total.sum += factor * other.sum;
            total.variance += factor * factor * other.variance;
        }
    }
}

impl LeftOutLight {
    /// The light left out of the tiles of all threads.
    pub(crate) fn of_threads<'a>(threads: impl Iterator<Item = &'a LeftOut>) -> Option<Self> {
        let mut tiles: Vec<_> = threads.flat_map(|thread| &thread.tiles).collect();
        tiles.sort_unstable_by_key(|(place, _)| *place);
        let mut all = LeftOutLight::default();
        for (_, LeftOutLight { totals, bounces }) in &tiles {
            all.totals.pixels += totals.pixels;
            all.totals.samples += totals.samples;
            all.totals.add(totals, 1.0);
            all.bounces.add(bounces);
        }
        (!tiles.is_empty()).then_some(all)
    }

    /// Adds other samples of the same pixels.
    pub(crate) fn add_samples(&mut self, other: &Self) {
        let (own, others) = (self.totals, other.totals);
        let samples = own.samples + others.samples;
        if samples > 0.0 {
            self.totals =
                LeftOutTotals { samples, pixels: own.pixels.max(others.pixels), ..LeftOutTotals::default() };
            self.totals.add(&own, own.samples / samples);
            self.totals.add(&others, others.samples / samples);
        }
        self.bounces.add(&other.bounces);
    }

    /// The light left out by limits on bounces, over all light.
    pub fn by_depth(&self) -> Estimate {
        self.share(0)
    }

    /// The light left out by the clamp, over all light.
    pub fn by_clamp(&self) -> Estimate {
        self.share(1)
    }

    fn share(&self, cause: usize) -> Estimate {
        let LeftOutTotals { light, causes, .. } = &self.totals;
        let all = light + causes.iter().map(|total| total.sum).sum::<f64>();
        if all <= 0.0 {
            return Estimate { mean: 0.0, error: 0.0 };
        }
        let PixelTotal { sum, variance } = causes[cause];
        // The derivative of x / (x + rest).
        Estimate { mean: sum / all, error: variance.sqrt() * (all - sum) / (all * all) }
    }

    /// The share of all light that is left out where `more` bounces are added to the limit, and the rays that those
    /// take beside the samples.
    fn with_more_bounces(&self, more: usize) -> (f64, f64) {
        let ByBounces { light, rays } = &self.bounces;
        let all: f64 = light.iter().sum();
        let found: f64 = light.iter().skip(1).take(more).sum();
        let part = if all > 0.0 { 1.0 - found / all } else { 0.0 };
        (part * self.by_depth().mean, rays.iter().take(1 + more).sum())
    }
}

/// The limits on the bounces of paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BounceLimits {
    /// The most bounces that count.
    pub depth: u32,
    /// The most perfectly specular bounces; `None` where these count as all others.
    pub specular: Option<u32>,
}

impl BounceLimits {
    /// `depth` and `specular` are those asked for: a limit of all bounces alone limits all, otherwise perfectly
    /// specular ones have a limit of their own.
    pub(super) fn new(depth: Option<u32>, specular: Option<u32>) -> Self {
        let default_specular = depth.is_none().then_some(PathSettings::DEFAULT_DEPTH_SPECULAR);
        let depth = depth.unwrap_or(PathSettings::DEFAULT_DEPTH);
        BounceLimits { depth, specular: specular.or(default_specular) }
    }

    /// Whether vertices of a generation may be limited.
    pub(super) fn may_end(&self, generation: u32) -> bool {
        generation >= self.depth.min(self.specular.unwrap_or(u32::MAX))
    }

    /// Whether a bounce counts towards `depth`.
    #[inline]
    pub(super) fn counts(&self, is_delta: bool) -> bool {
        !is_delta || self.specular.is_none()
    }

    /// The bounces that count beyond `depth`.
    pub(super) fn beyond(&self, counted: u16) -> usize {
        u32::from(counted).saturating_sub(self.depth) as usize
    }

    /// The options that set a limit of `depth`, and `factor` times that of specular bounces.
    pub fn options(&self, depth: u32, factor: u32) -> String {
        let larger = |limit: u32| (limit.max(1) * factor).min(PathSettings::MAX_DEPTH);
        let specular = self.specular.map(|limit| if factor == 1 { limit } else { larger(limit) });
        let specular = specular.map(|limit| format!(" --depth-specular {limit}"));
        format!("--depth {}{}", depth.min(PathSettings::MAX_DEPTH), specular.unwrap_or_default())
    }

    /// The options of the least of some larger limits that leaves out at most a share of the light, that share, and the
    /// time over that of a picture that took `rays` rays.
    pub fn deeper(&self, left_out: &LeftOutLight, most: f64, rays: u64) -> Option<(String, f64, f64)> {
        let base = self.depth.max(4);
        let depths = (0..9).flat_map(|k| [(base << k) * 3 / 2, base << (k + 1)]);
        depths.filter(|&depth| depth <= PathSettings::MAX_DEPTH).find_map(|depth| {
            let (share, more) = left_out.with_more_bounces((depth - self.depth) as usize);
            (share <= most).then(|| (self.options(depth, 1), share, 1.0 + more / rays.max(1) as f64))
        })
    }
}

impl fmt::Display for BounceLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.depth == 1 { "" } else { "s" };
        write!(f, "{} bounce{plural}", self.depth)?;
        self.specular.map_or(Ok(()), |specular| write!(f, " and {specular} specular ones"))
    }
}
