//! One pixel of a picture in words and numbers: its rays, the terms at each surface, and the way to its 8-bit values.
//!
//! [`RenderJob::explain_pixel`] renders the pixel as the picture does, with a recorder; the report has what it records
//! ([`crate::effects::record`]). Lengths and positions are in scene coordinates, before recentering; colours are in the
//! numbers of the pipeline.

mod text;

use std::collections::BTreeSet;

use glam::DVec3;
use serde::Serialize;

use super::{RenderControl, RenderJob};
use crate::effects::id;
use crate::effects::record::SampleRecord;
use crate::effects::tile::RenderContext;
use crate::effects::variance::SampleVariance;
use crate::error::{Error, Result};
use crate::film::rounding::Rounding;
use crate::film::tone::ToneMap;
use crate::film::write::OutputImage;
use crate::film::{ColourPipeline, DisplayTransform, Film, ReconstructionFilter, Window};
use crate::render::record_pixel;

/// The most samples whose rays a report lists.
pub const MAX_LISTED_SAMPLES: u32 = 64;

/// A pixel of a picture.
#[derive(Debug, Clone, Serialize)]
pub struct PixelReport {
    /// Column and row, from the top left corner of the whole picture.
    pub pixel: [u32; 2],
    /// Width and height of the whole picture.
    pub size: [u32; 2],
    /// The 8-bit values of the pixel.
    pub displayed: [u8; 3],
    /// The 8-bit alpha, of pictures with a transparent background.
    pub alpha: Option<u8>,
    /// How the samples become these.
    pub colour: ColourReport,
    /// The transport.
    pub transport: &'static str,
    /// The number of samples.
    pub samples_taken: usize,
    /// The reconstruction filter; `None` for the one sample at the pixel's centre.
    pub filter: Option<FilterReport>,
    /// Mean and standard error of the samples' colours, without their signs; `None` for a single sample.
    pub noise: Option<NoiseReport>,
    /// The first samples, or those from the chosen one on, with their rays. Of a pixel that shows layers of transparent
    /// surfaces, one entry a layer.
    pub samples: Vec<SampleRecord>,
    /// The number of samples that are not listed.
    pub samples_left_out: usize,
    /// What the report does not list.
    pub not_listed: Vec<&'static str>,
}

/// The steps from the samples of a pixel to its 8-bit values.
#[derive(Debug, Clone, Serialize)]
pub struct ColourReport {
    /// The colour pipeline.
    pub pipeline: &'static str,
    /// The filtered sum of the samples.
    pub filtered: [f32; 3],
    /// The same with unlit surfaces and backdrop: the value of the film. `None` where the film holds displayed colours,
    /// which exposure and tone map leave as they are.
    pub film: Option<[f32; 3]>,
    /// Exposure in EV.
    pub exposure: f64,
    /// The film value times 2^EV.
    pub exposed: Option<DVec3>,
    /// The tone map.
    pub tone_map: &'static str,
    /// Displayed linear light; in the pipelines of display values the film value.
    pub tone_mapped: DVec3,
    /// Display values from 0 to 1, before they are rounded to 8 bits.
    pub encoded: DVec3,
}

/// A reconstruction filter. The pixel is the mean of the samples; for a filter with negative lobes the mean m of the
/// colours c plus the mean of weight (c - m), divided by the mean sign.
#[derive(Debug, Clone, Serialize)]
pub struct FilterReport {
    /// Its shape.
    pub shape: &'static str,
    /// Its radius in pixels.
    pub radius: f64,
    /// The expected weight of a sample, which has the weight 1 or -1.
    pub mean_sign: f64,
}

/// What all samples of a pixel say of its noise.
#[derive(Debug, Clone, Serialize)]
pub struct NoiseReport {
    /// The mean of the colours.
    pub mean: DVec3,
    /// Their standard deviation over the square root of their number.
    pub standard_error: DVec3,
}

impl RenderJob {
    /// Explains a pixel of the picture as `kiln render` writes it to a PNG file. The rays of up to
    /// [`MAX_LISTED_SAMPLES`] samples are listed, from the sample `first` on.
    ///
    /// # Errors
    /// [`Error::Usage`] for a pixel outside the picture or a sample that it does not take; those of
    /// [`RenderJob::render`].
    pub fn explain_pixel(&self, pixel: [u32; 2], first: u32, control: &RenderControl) -> Result<PixelReport> {
        let Window { x, y, width, height } = self.window;
        let [column, row] = pixel;
        if column.wrapping_sub(x) >= width || row.wrapping_sub(y) >= height {
            let columns = format!("{x} to {} and rows {y} to {}", x + width - 1, y + height - 1);
            let what = format!("--pixel {column},{row}: outside the picture, which has columns {columns}");
            return Err(Error::usage(what, "count columns from the left and rows from the top, from 0"));
        }
        let display = self.display_transform(control)?;
        let mut report = self.pixel_report(pixel, first, [display; 2], true)?;
        if report.samples.is_empty() {
            let what = format!("--sample {first}: the pixel has {} sample(s)", report.samples_taken);
            return Err(Error::usage(what, "count samples from 0"));
        }
        self.move_back(&mut report);
        Ok(report)
    }

    /// [`RenderJob::explain_pixel`] without checks and in world coordinates. `displays` are the display transforms that
    /// are known before the picture is, and that of the displayed picture; `is_displayed` is
    /// [`RenderContext::is_displayed`].
    pub fn pixel_report(
        &self,
        pixel: [u32; 2],
        first: u32,
        [known, shown]: [DisplayTransform; 2],
        is_displayed: bool,
    ) -> Result<PixelReport> {
        let (world, view) = (&*self.world, &self.view);
        let context = RenderContext { world, view, display: known, is_displayed };
        let traced = first..first.saturating_add(MAX_LISTED_SAMPLES);
        let (film, alpha, recorder) = if self.is_transparent() {
            let ([r, g, b, alpha], recorder) = record_pixel::<[f32; 4]>(&context, &self.plan, pixel, traced);
            ([r, g, b], Some(alpha), recorder)
        } else {
            let (film, recorder) = record_pixel::<[f32; 3]>(&context, &self.plan, pixel, traced);
            (film, None, recorder)
        };
        let window = Window { x: pixel[0], y: pixel[1], width: 1, height: 1 };
        let one = Film::from_rows(window, &[film])?;
        let of_8_bits = shown.rounded(Rounding { is_16_bit: false, ..shown.rounding() });
        let alphas = alpha.as_ref().map(std::slice::from_ref);
        let (displayed, alpha_8_bit) = match OutputImage::displayed(&one, alphas, world.pipeline, of_8_bits)?
        {
            OutputImage::Rgba8(film, alphas, _) => (film.pixel(0, 0), Some(alphas[0])),
            OutputImage::Rgb8(film, _) => (film.pixel(0, 0), None),
            _ => ([0; 3], None),
        };
        let straight = match alpha {
            Some(alpha) if alpha > 0.0 && !DisplayTransform::is_kept(film) => film.map(|c| c / alpha),
            _ => film,
        };
        let mut samples = recorder.samples;
        let (samples_taken, noise) = (count(&samples), noise(&samples));
        samples.retain(|sample| !sample.rays.is_empty());
        if world.pipeline == ColourPipeline::U8 {
            let rays = samples.iter_mut().flat_map(|sample| &mut sample.rays);
            rays.filter_map(|ray| ray.local.as_mut()).for_each(|local| local.round());
        }
        Ok(PixelReport {
            pixel,
            size: view.size(),
            displayed,
            alpha: alpha_8_bit,
            colour: ColourReport::new(recorder.filtered, straight, shown, world.pipeline),
            transport: self.plan.transport.name(),
            samples_taken,
            filter: self.plan.takes_samples().then(|| self.filter_report()),
            noise,
            samples_left_out: samples_taken - count(&samples),
            samples,
            not_listed: self.not_listed(),
        })
    }

    /// Converts positions and lengths of a report to scene coordinates.
    pub fn move_back(&self, report: &mut PixelReport) {
        if let Some(recentering) = &self.recentering {
            report.samples.iter_mut().for_each(|sample| sample.move_back(recentering));
        }
    }

    fn filter_report(&self) -> FilterReport {
        let (shape, radius) = self.plan.sampling.shape_and_radius();
        let mean_sign = ReconstructionFilter::new(shape, radius).mean_sign();
        FilterReport { shape: shape.name(), radius, mean_sign }
    }

    /// What a report does not list.
    fn not_listed(&self) -> Vec<&'static str> {
        let has = |effect| self.plan.effects_on().any(|on| on == effect);
        let occlusion = "rays of ambient occlusion: their result is the factor `unoccluded` of L_a";
        let alpha = "surfaces that a ray passes by their opacity: t is the distance to the one that it hits";
        let catcher =
            "the shadow catcher: the ground's light becomes the sample's coverage, and its colour 0";
        let parts = [
            has(id::AMBIENT_OCCLUSION).then_some(occlusion),
            has(id::ALPHA).then_some(alpha),
            self.world.shadow_catcher().map(|_| catcher),
        ];
        parts.into_iter().flatten().collect()
    }
}

impl ColourReport {
    fn new(filtered: [f32; 3], film: [f32; 3], display: DisplayTransform, pipeline: ColourPipeline) -> Self {
        let colour = DVec3::from(film.map(f64::from));
        let is_light = !DisplayTransform::is_kept(film);
        let exposed = DisplayTransform::new(display.ev(), ToneMap::None).apply(colour);
        ColourReport {
            pipeline: pipeline.name(),
            filtered,
            film: is_light.then_some(film),
            exposure: display.ev(),
            exposed: is_light.then_some(exposed),
            tone_map: display.tone_map().name(),
            tone_mapped: display.apply(colour),
            encoded: display.displayed(pipeline, colour),
        }
    }
}

/// The number of samples, layers of one sample counted once.
fn count(samples: &[SampleRecord]) -> usize {
    samples.iter().map(|sample| sample.index).collect::<BTreeSet<_>>().len()
}

/// Mean and standard error of the samples of a pixel.
fn noise(samples: &[SampleRecord]) -> Option<NoiseReport> {
    let mut colours = SampleVariance::default();
    samples.iter().for_each(|sample| colours.add(sample.colour));
    let variance = colours.unbiased().filter(|_| samples.iter().all(|sample| sample.layer.is_none()))?;
    let standard_error = (variance / f64::from(colours.count())).map(f64::sqrt);
    Some(NoiseReport { mean: colours.mean(), standard_error })
}
