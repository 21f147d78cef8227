//! Progressive rendering of one side of a request.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use egui::{Color32, ColorImage};
use rayon::prelude::*;

use super::RenderedImage;
use super::render_cache::Prepared;
use crate::effects::RayKind;
use crate::error::Result;
use crate::film::tone::auto_exposure;
use crate::film::{ColourPipeline, DisplayTransform, Film, Pixel, TILE, Window};
use crate::job::RenderJob;
use crate::metrics;
use crate::render::{RenderControl, Statistics};
use crate::scene::Sampling;
use crate::viewer::false_colour::{DisplayMode, FalseColours, error_against_exact, false_colours};
use crate::viewer::refine::{BATCHES, Pass, SamplingKind, passes};
use crate::viewer::request::RenderRequest;

/// An image in the values of its colour pipeline, row by row from the top.
pub(crate) struct PipelineImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Pixels.
    pub pixels: Vec<[f32; 3]>,
    /// Colour pipeline of the pixels.
    pub pipeline: ColourPipeline,
    /// Display transform of the image.
    pub display: DisplayTransform,
}

/// One side of a request, with its progress.
pub(crate) struct Side<'a> {
    request: &'a RenderRequest,
    prepared: Arc<Prepared>,
    /// The same scene in the tier `exact`, for [`DisplayMode::ErrorAgainstExact`].
    exact: Option<Arc<Prepared>>,
    passes: Vec<Pass>,
    kind: SamplingKind,
    /// Sum of time and statistics of all passes of full size.
    spent: Option<(Duration, Statistics)>,
    picture: Option<PipelineImage>,
    /// The pixels of a coarse pass of full size.
    centres: Option<Vec<[f32; 3]>>,
    /// An automatic exposure, metered by the first pass that needs it.
    auto_exposure: OnceLock<f64>,
}

impl<'a> Side<'a> {
    /// Plans the passes, the first of them with pixels of `factor` by `factor`.
    pub(crate) fn new(
        request: &'a RenderRequest,
        prepared: Arc<Prepared>,
        exact: Option<Arc<Prepared>>,
        factor: u32,
    ) -> Self {
        // AOVs are computed at pixel centres.
        let kind =
            if request.display_mode == DisplayMode::Picture { prepared.kind } else { SamplingKind::Centres };
        let passes = passes(factor, kind);
        let auto_exposure = OnceLock::new();
        Side {
            request,
            prepared,
            exact,
            passes,
            kind,
            spent: None,
            picture: None,
            centres: None,
            auto_exposure,
        }
    }

    /// Number of passes.
    pub(crate) fn passes(&self) -> usize {
        self.passes.len()
    }

    /// The last image of full size.
    pub(crate) fn into_picture(self) -> Option<PipelineImage> {
        self.picture
    }

    /// Renders a pass of the request of that number, as its side `side`; `None` if the index is out of range. Returns
    /// also the render time in seconds per pixel, if each had one sample.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when cancelled, and the errors of rendering.
    pub(crate) fn pass(
        &mut self,
        index: usize,
        cancel: &AtomicBool,
        (request, side): (u64, usize),
    ) -> Result<Option<(RenderedImage, Option<f64>)>> {
        let Some(&pass) = self.passes.get(index) else { return Ok(None) };
        let start = Instant::now();
        let control = RenderControl { cancel, progress: &|_, _| (), time_stages: false };
        let is_last = index + 1 == self.passes.len();
        let pipeline = self.prepared.job.pipeline();
        let (factor, sampling) = match pass {
            Pass::Coarse(factor) => (factor, Sampling::default()),
            Pass::Samples(from, to) => (1, self.prepared.choices.sampling.part(from, to)),
            Pass::Whole => (1, Sampling::default()),
            Pass::Tiles(_) => (1, self.prepared.choices.sampling),
        };
        let size = self.request.size.map(|side| side.div_ceil(factor));
        let is_selected = |tile: usize| !matches!(pass, Pass::Tiles(batch) if tile % BATCHES != batch);
        let (film, statistics) = self.render(&self.prepared, size, sampling, &is_selected, &control)?;
        let mut pixels = rows(&film);
        if let Pass::Tiles(_) = pass {
            let before = self.picture.take().map(|picture| picture.pixels).or(self.centres.take());
            if let Some(before) = before {
                keep_unselected(&mut pixels, &before, size, &is_selected);
            }
        }
        if let (Pass::Samples(from, to), Some(before)) = (pass, &self.picture) {
            let display = self.prepared.job.display().known();
            mix(&mut pixels, &before.pixels, f64::from(from) / f64::from(to), display);
        }
        let display = match pass {
            // Metering would delay the first image after a change.
            Pass::Coarse(_) if !is_last && self.prepared.job.display().is_auto() => {
                let job = self.prepared.job.with_size(size)?;
                let subject = job.subject_colours(pixels.iter().copied(), &control)?;
                job.display().transform(auto_exposure(subject.into_iter()))
            }
            _ => self.metered(&self.prepared.job, |job| job.display_transform(&control))?,
        };
        let (image, legend) = match self.request.display_mode {
            DisplayMode::Picture => (image(&pixels, size, pipeline, display), None),
            _ => {
                let FalseColours { pixels, legend } = self.false_colours(&film, size, &control)?;
                (ColorImage::from_rgb(size.map(|side| side as usize), pixels.as_flattened()), Some(legend))
            }
        };
        let time = start.elapsed();
        let most = match self.kind {
            SamplingKind::Centres => 1,
            SamplingKind::Samples(samples) => samples,
            SamplingKind::Adaptive => self.prepared.choices.sampling.max_samples(),
        };
        let is_once = matches!(pass, Pass::Coarse(_)) || most == 1;
        let seconds_per_pixel = is_once.then(|| time.as_secs_f64() / (pixels.len() as f64));
        let (time, statistics) = if let Pass::Coarse(factor) = pass {
            self.centres = (factor == 1).then_some(pixels);
            (time, statistics)
        } else {
            self.picture = Some(PipelineImage { size, pixels, pipeline, display });
            self.spend(time, statistics)
        };
        let (image, prepared) = (Arc::new(image), Arc::clone(&self.prepared));
        let taken = match pass {
            Pass::Coarse(_) | Pass::Whole => 1,
            Pass::Samples(_, to) => to,
            Pass::Tiles(_) => {
                let cast = statistics.rays(RayKind::PRIMARY).cast as f64;
                (cast / f64::from(size[0]) / f64::from(size[1])).round() as u32
            }
        };
        let samples = (taken.clamp(1, most), most);
        let rendered = RenderedImage {
            request,
            side,
            image,
            display,
            factor,
            samples,
            is_last,
            time,
            statistics,
            legend,
            prepared,
        };
        Ok(Some((rendered, seconds_per_pixel)))
    }

    /// Adds the cost of a pass of full size. Returns the sum.
    fn spend(&mut self, time: Duration, statistics: Statistics) -> (Duration, Statistics) {
        let spent = match self.spent.take() {
            Some((before, mut sum)) => {
                sum.add(&statistics);
                (before + time, sum)
            }
            None => (time, statistics),
        };
        self.spent = Some(spent.clone());
        spent
    }

    /// False colours of the requested display mode.
    fn false_colours(&self, film: &Film, size: [u32; 2], control: &RenderControl) -> Result<FalseColours> {
        let job = &self.prepared.job;
        if let Some(exact) = &self.exact {
            let (exact, _) = self.render(exact, size, Sampling::default(), &|_| true, control)?;
            let [picture, exact] =
                [film, &exact].map(|film| metrics::ComparedImage::of_film(film, job.pipeline()));
            return error_against_exact(&picture, &exact);
        }
        false_colours(self.request.display_mode, &job.with_size(size)?.aov_source(None), control)
    }

    fn render(
        &self,
        prepared: &Prepared,
        size: [u32; 2],
        sampling: Sampling,
        is_selected: &(dyn Fn(usize) -> bool + Sync),
        control: &RenderControl,
    ) -> Result<(Film, Statistics)> {
        let control = RenderControl { time_stages: true, ..*control };
        let mut job = prepared.job.with_size(size)?;
        if sampling != Sampling::default() {
            job.set_sampling(sampling)?;
        }
        let is_selected = |tile: usize, _: Window| is_selected(tile);
        self.metered(&job, |job| match self.request.display_mode {
            // An automatic exposure is metered after the first images.
            DisplayMode::Picture if !job.display().is_auto() => job.render_to_develop(is_selected, &control),
            _ => job.render_selected(is_selected, &control),
        })
    }

    /// Runs `work` with a job of this picture. The automatic exposure is metered once for all passes.
    fn metered<T>(&self, job: &RenderJob, work: impl FnOnce(&RenderJob) -> Result<T>) -> Result<T> {
        if let Some(&metered) = self.auto_exposure.get() {
            job.auto_exposure.get_or_init(|| metered);
        }
        let result = work(job);
        if let Some(&metered) = job.auto_exposure.get() {
            self.auto_exposure.get_or_init(|| metered);
        }
        result
    }
}

/// The pixels of a film, row by row from the top.
fn rows(film: &Film) -> Vec<[f32; 3]> {
    let window = film.window();
    let mut pixels = vec![[0.0; 3]; window.area()];
    pixels.par_chunks_mut(window.width as usize).zip(0..window.height).for_each(|(row, y)| {
        let mut rest = row;
        for part in film.row(y) {
            let (own, after) = rest.split_at_mut(part.len());
            own.copy_from_slice(part);
            rest = after;
        }
    });
    pixels
}

/// Copies the tiles that were not rendered from the picture `before`.
fn keep_unselected(
    pixels: &mut [[f32; 3]],
    before: &[[f32; 3]],
    [width, height]: [u32; 2],
    is_selected: &(dyn Fn(usize) -> bool + Sync),
) {
    let (tile, columns) = (TILE as usize, width.div_ceil(TILE) as usize);
    for y in 0..height as usize {
        let row = y * width as usize..(y + 1) * width as usize;
        let pairs = pixels[row.clone()].chunks_mut(tile).zip(before[row].chunks(tile));
        for (column, (new, old)) in pairs.enumerate() {
            if !is_selected(y / tile * columns + column) {
                new.copy_from_slice(old);
            }
        }
    }
}

/// Weighted mean: `before` has weight `share` (0 to 1), `pixels` the rest.
fn mix(pixels: &mut [[f32; 3]], before: &[[f32; 3]], share: f64, display: DisplayTransform) {
    pixels.par_iter_mut().zip(before).for_each(|(new, old)| *new = display.mean(*old, *new, share));
}

/// The image as a display shows it.
fn image(
    pixels: &[[f32; 3]],
    size: [u32; 2],
    pipeline: ColourPipeline,
    display: DisplayTransform,
) -> ColorImage {
    let width = size[0] as usize;
    let mut colours = vec![Color32::BLACK; pixels.len()];
    colours.par_chunks_mut(width).zip(pixels.par_chunks(width)).for_each(|(colours, row)| {
        let mut bytes = vec![[0; 3]; row.len()];
        Pixel::develop(row, pipeline, display, &mut bytes);
        colours.iter_mut().zip(bytes).for_each(|(colour, [r, g, b])| *colour = Color32::from_rgb(r, g, b));
    });
    ColorImage::new(size.map(|side| side as usize), colours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::tone::ToneMap;

    #[test]
    fn an_image_shows_what_a_png_holds() {
        let pixels = [[0.1, 0.5, 4.0], [0.0, 1.0, 0.2]];
        for display in [DisplayTransform::default(), DisplayTransform::new(1.5, ToneMap::PbrNeutral)] {
            let image = image(&pixels, [2, 1], ColourPipeline::Linear, display);
            for (shown, pixel) in image.pixels.iter().zip(pixels) {
                assert_eq!([shown.r(), shown.g(), shown.b()], display.encode(ColourPipeline::Linear, pixel));
            }
        }
    }
}
