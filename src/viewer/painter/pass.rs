//! Progressive rendering of one side of a request.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use egui::{Color32, ColorImage};
use rayon::prelude::*;

use super::RenderedImage;
use super::render_cache::Prepared;
use crate::effects::RayKind;
use crate::error::Result;
use crate::film::tone::{Exposure, auto_exposure, mean_exposure};
use crate::film::{ColourPipeline, DisplaySettings, DisplayTransform, Film, Pixel, TILE, Window};
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
    /// The job with the metered exposure, once a pass of full size needs it.
    metered: Option<Arc<RenderJob>>,
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
        Side {
            request,
            prepared,
            exact,
            passes,
            kind,
            spent: None,
            picture: None,
            centres: None,
            metered: None,
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
        let final_sampling = self.prepared.job.plan_settings.sampling;
        let Sampling { seed, sampler, .. } = final_sampling;
        let (factor, sampling) = match pass {
            Pass::Coarse(factor) => (factor, Sampling { seed, sampler, ..Sampling::default() }),
            Pass::Samples(from, to) => (1, final_sampling.part(from, to)),
            Pass::Whole | Pass::Tiles(_) => (1, final_sampling),
        };
        // Metering would delay the first image after a change, if that is coarse.
        let display = match pass {
            Pass::Coarse(_) if !is_last => None,
            _ => Some(self.final_display(&control)?),
        };
        let size = self.request.size.map(|side| side.div_ceil(factor));
        let is_selected = |tile: usize| !matches!(pass, Pass::Tiles(batch) if tile % BATCHES != batch);
        let (film, statistics) = self.render(self.job(), size, sampling, &is_selected, &control)?;
        let mut pixels = rows(&film);
        if let Pass::Tiles(_) = pass {
            let before = self.picture.take().map(|picture| picture.pixels).or(self.centres.take());
            if let Some(before) = before {
                keep_unselected(&mut pixels, &before, size, &is_selected);
            }
        }
        if let (Pass::Samples(from, to), Some(before)) = (pass, &self.picture) {
            let display = self.job().display().known();
            mix(&mut pixels, &before.pixels, f64::from(from) / f64::from(to), display);
        }
        let display = match display {
            Some(display) => display,
            None => self.display_of(&pixels, size, &control)?,
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
            SamplingKind::Tiles => final_sampling.max_samples(),
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
            metered: self.metered.clone(),
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

    /// The job of the picture, with its exposure once that is metered.
    fn job(&self) -> &RenderJob {
        self.metered.as_deref().unwrap_or(&self.prepared.job)
    }

    /// Whether the exposure of the final image is metered. False colours do not depend on it.
    fn meters(&self) -> bool {
        self.prepared.meters && self.request.display_mode == DisplayMode::Picture
    }

    /// The display transform of the final image. The exposure is metered at the first call.
    fn final_display(&mut self, control: &RenderControl) -> Result<DisplayTransform> {
        if self.meters() && self.metered.is_none() {
            let mut job = self.prepared.job.with_plan_settings(self.prepared.job.plan_settings.clone())?;
            job.meter(control)?;
            self.metered = Some(Arc::new(job));
        }
        self.job().display_transform(control)
    }

    /// The display transform for pixels of a coarse pass: its exposure is that of these pixels.
    fn display_of(
        &self,
        pixels: &[[f32; 3]],
        size: [u32; 2],
        control: &RenderControl,
    ) -> Result<DisplayTransform> {
        let display = self.job().display();
        if self.is_exposed() {
            return Ok(display.known());
        }
        let job = self.job().with_size(size)?;
        let subject = job.subject_colours(pixels.iter().copied(), control)?;
        let ev = match self.meters() {
            true => mean_exposure(&subject, display.tone_map.unwrap_or_default()),
            false => auto_exposure(subject.into_iter()),
        };
        Ok(DisplaySettings { exposure: Some(Exposure::Auto), ..display }.transform(ev))
    }

    /// Whether the exposure is known before the picture is rendered.
    fn is_exposed(&self) -> bool {
        !self.job().display().is_auto() && self.meters() == self.metered.is_some()
    }

    /// False colours of the requested display mode.
    fn false_colours(&self, film: &Film, size: [u32; 2], control: &RenderControl) -> Result<FalseColours> {
        let mut job = self.job().with_size(size)?;
        if let Some(exact) = &self.exact {
            let (exact, _) = self.render(&exact.job, size, Sampling::default(), &|_| true, control)?;
            let [picture, exact] =
                [film, &exact].map(|film| metrics::ComparedImage::of_film(film, job.pipeline()));
            return error_against_exact(&picture, &exact);
        }
        job.set_sampling(Sampling::default())?;
        false_colours(self.request.display_mode, &job.aov_source(None), control)
    }

    fn render(
        &self,
        job: &RenderJob,
        size: [u32; 2],
        sampling: Sampling,
        is_selected: &(dyn Fn(usize) -> bool + Sync),
        control: &RenderControl,
    ) -> Result<(Film, Statistics)> {
        let control = RenderControl { time_stages: true, ..*control };
        let mut sized = job.with_size(size)?;
        if sampling != sized.plan_settings.sampling {
            sized.set_sampling(sampling)?;
        }
        if let Some(&ev) = job.auto_exposure.get() {
            sized.auto_exposure.get_or_init(|| ev);
        }
        let is_selected = |tile: usize, _: Window| is_selected(tile);
        match self.request.display_mode {
            DisplayMode::Picture if self.is_exposed() => sized.render_to_develop(is_selected, &control),
            _ => sized.render_selected(is_selected, &control),
        }
    }

    /// All passes, and the picture of the job that they show, in 8-bit display values. Their last image is
    /// that picture, within a step where it is the mean of parts, which are rounded.
    #[cfg(test)]
    pub(crate) fn final_picture(mut self) -> Result<Vec<[u8; 3]>> {
        let control = RenderControl::default();
        let mut index = 0;
        let mut shown = None;
        while let Some((rendered, _)) = self.pass(index, control.cancel, (0, 0))? {
            (shown, index) = (Some(rendered), index + 1);
        }
        let (film, _) = self.job().render::<[u8; 3]>(&control)?;
        let picture: Vec<[u8; 3]> = film.rows().collect();
        let shown = shown.expect("a pass");
        assert_eq!(Some(shown.display), self.picture.as_ref().map(|picture| picture.display));
        let bytes = shown.image.pixels.iter().map(|colour| [colour.r(), colour.g(), colour.b()]);
        let most = if let SamplingKind::Samples(_) = self.kind { 1 } else { 0 };
        let is_near = |(a, b): (&[u8; 3], [u8; 3])| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= most);
        let far = picture.iter().zip(bytes).find(|pair| !is_near(*pair));
        let file = &self.request.opened.scene.inputs;
        assert_eq!(far, None, "the last pass shows the picture: {file:?}, {:?}", self.kind);
        Ok(picture)
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
    let rows = colours.par_chunks_mut(width).zip(pixels.par_chunks(width)).zip(0..size[1]);
    rows.for_each(|((colours, row), y)| {
        let mut bytes = vec![[0u8; 3]; row.len()];
        let window = Window { x: 0, y, width: size[0], height: 1 };
        Pixel::develop(row, window, pipeline, display, &mut bytes);
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
