//! Progressive rendering of a request.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use egui::{Color32, ColorImage};
use rayon::prelude::*;

use super::RenderedImage;
use super::render_cache::Prepared;
use crate::false_colour::{DisplayMode, FalseColours, Legend, false_colours};
use crate::refine::{Pass, PassTime, passes};
use crate::request::RenderRequest;
use kiln::effects::RayKind;
use kiln::error::{Result, Warnings};
use kiln::film::tone::{Exposure, auto_exposure};
use kiln::film::write::OutputImage;
use kiln::film::{ColourPipeline, DisplaySettings, DisplayTransform, Film, Pixel, Window};
use kiln::job::{Findings, RenderJob};
use kiln::render::{RenderControl, Statistics};
use kiln::scene::Sampling;

/// A coarse pass takes one of so many samples of a pixel: of rays that samples share, such as those of ambient occlusion, it
/// casts so many times less than a picture of one sample.
const COARSE_TOTAL: u32 = 4;

/// What a pass has drawn.
struct Drawn {
    image: ColorImage,
    legend: Option<Legend>,
    /// The pixels of a picture.
    film: Option<Arc<Film>>,
    display: DisplayTransform,
    statistics: Statistics,
    /// Warnings and notes about a finished picture.
    of_image: Warnings,
    /// Time of metering the exposure.
    metering: Duration,
}

/// A request with its progress.
pub(crate) struct Progress<'a> {
    request: &'a RenderRequest,
    prepared: Arc<Prepared>,
    passes: Vec<Pass>,
    /// The job with the metered exposure, once a pass of full size needs it.
    metered: Option<Arc<RenderJob>>,
    /// What the passes have taken so far.
    spent: Option<(Duration, Statistics)>,
}

impl<'a> Progress<'a> {
    /// Plans the passes, the first of them with pixels of `factor` by `factor`.
    pub(crate) fn new(request: &'a RenderRequest, prepared: Arc<Prepared>, factor: u32) -> Self {
        let is_picture = request.display_mode == DisplayMode::Picture;
        let passes = passes(factor, if is_picture { prepared.samples } else { 1 });
        let metered = prepared.known_exposed().filter(|_| is_picture).map(Arc::new);
        Progress { request, prepared, passes, metered, spent: None }
    }

    /// Number of passes.
    pub(crate) fn passes(&self) -> usize {
        self.passes.len()
    }

    fn is_picture(&self) -> bool {
        self.request.display_mode == DisplayMode::Picture
    }

    /// Renders a pass of the request of that number. Returns also its time, if each pixel had one sample.
    ///
    /// # Errors
    /// [`kiln::error::Error::Interrupted`] when cancelled, and the errors of rendering.
    pub(crate) fn pass(
        &mut self,
        index: usize,
        cancel: &AtomicBool,
        request: u64,
    ) -> Result<(RenderedImage, Option<PassTime>)> {
        let pass = self.passes[index];
        let control = RenderControl { cancel, progress: &|_, _| (), time_stages: true };
        let is_last = index + 1 == self.passes.len();
        let (start, factor) = (Instant::now(), if let Pass::Coarse(factor) = pass { factor } else { 1 });
        let size = self.request.size.map(|side| side.div_ceil(factor));
        let drawn = match self.request.display_mode {
            DisplayMode::Picture => self.picture(pass, is_last, size, &control)?,
            _ => self.false_colours(size, &control)?,
        };
        let Drawn { image, legend, film, display, statistics, of_image, metering } = drawn;
        let time = start.elapsed();
        let pixels = size[0] as usize * size[1] as usize;
        let most = if self.is_picture() { self.prepared.samples } else { 1 };
        let is_once = matches!(pass, Pass::Coarse(_)) || most == 1;
        let pass_time = is_once.then(|| {
            let of_threads: Duration = statistics.stages.iter().map(|stage| stage.time).sum();
            let threads = rayon::current_num_threads() as u32;
            PassTime::new(pixels, time - metering, self.is_picture().then(|| of_threads / threads))
        });
        let (time, spent) = match self.spent.take() {
            Some((before, mut spent)) => {
                spent.add(&statistics);
                (before + time, spent)
            }
            None => (time, statistics.clone()),
        };
        self.spent = Some((time, spent.clone()));
        let taken = (statistics.rays(RayKind::PRIMARY).cast as f64 / pixels as f64).round() as u32;
        let rendered = RenderedImage {
            request,
            image: Arc::new(image),
            display,
            factor,
            samples: (taken.clamp(1, most), most),
            is_last,
            film: film.filter(|_| is_last),
            time,
            statistics,
            of_image,
            spent,
            legend,
            prepared: Arc::clone(&self.prepared),
            metered: self.metered.clone(),
        };
        Ok((rendered, pass_time))
    }

    /// Renders a pass of the picture.
    fn picture(
        &mut self,
        pass: Pass,
        is_last: bool,
        size: [u32; 2],
        control: &RenderControl,
    ) -> Result<Drawn> {
        let start = Instant::now();
        let pipeline = self.prepared.job().pipeline();
        let whole = self.prepared.job().plan_settings.sampling;
        let Sampling { seed, sampler, noise, min_samples, .. } = whole;
        let sampling = match pass {
            Pass::Coarse(_) => Sampling { seed, sampler, total: Some(COARSE_TOTAL), ..Sampling::default() },
            Pass::Samples(count) if count < self.prepared.samples => {
                Sampling { first: None, noise, min_samples, ..whole.part(0, count) }
            }
            Pass::Samples(_) => whole,
        };
        // Metering would delay the first image after a change, if that is coarse.
        let display = match pass {
            Pass::Coarse(_) if !is_last => None,
            _ => Some(self.final_display(control)?),
        };
        let metering = start.elapsed();
        let (film, statistics) = self.render(display.is_some(), size, sampling, control)?;
        let pixels = rows(&film);
        let display = match display {
            Some(display) => display,
            None => self.display_of(&pixels, size, control)?,
        };
        let mut of_image = Warnings::default();
        if is_last {
            let developed = OutputImage::displayed(&film, None, pipeline, display)?;
            Findings::of(self.job(), &developed, &statistics, control)?.warn(&mut of_image);
        }
        let image = image(&pixels, size, pipeline, display);
        Ok(Drawn { image, legend: None, film: Some(film.into()), display, statistics, of_image, metering })
    }

    /// The job of the picture, with its exposure once that is metered.
    fn job(&self) -> &RenderJob {
        self.metered.as_deref().unwrap_or(self.prepared.job())
    }

    /// The display transform of the final image. The exposure is metered at the first call.
    fn final_display(&mut self, control: &RenderControl) -> Result<DisplayTransform> {
        if self.prepared.picture.is_metered() && self.metered.is_none() {
            self.metered = Some(Arc::new(self.prepared.exposed(control)?));
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
        let ev = match self.prepared.picture.resolved.meters {
            true => self.job().exposure_of(&subject),
            false => auto_exposure(subject.into_iter()),
        };
        Ok(DisplaySettings { exposure: Some(Exposure::Auto), ..display }.transform(ev))
    }

    /// Whether the exposure is known before the picture is rendered.
    fn is_exposed(&self) -> bool {
        !self.job().display().is_auto() && self.prepared.picture.is_metered() == self.metered.is_some()
    }

    /// False colours of the requested display mode.
    fn false_colours(&mut self, size: [u32; 2], control: &RenderControl) -> Result<Drawn> {
        let mode = self.request.display_mode;
        // Samples are those of the picture, with its exposure; other AOVs are computed at pixel centres.
        let has_samples = mode == DisplayMode::Rays;
        let display = if has_samples { self.final_display(control)? } else { self.job().display().known() };
        let mut job = self.job().with_size(size)?;
        job.expose_as(self.job());
        if !has_samples {
            job.set_sampling(Sampling::default())?;
        }
        let FalseColours { pixels, legend } = false_colours(mode, &job.aov_source(None), control)?;
        let image = ColorImage::from_rgb(size.map(|side| side as usize), pixels.as_flattened());
        let (statistics, of_image) = (Statistics::default(), Warnings::default());
        let (legend, metering) = (Some(legend), Duration::ZERO);
        Ok(Drawn { image, legend, film: None, display, statistics, of_image, metering })
    }

    /// Renders the job in a size, to be developed by its display transform if that is known.
    fn render(
        &self,
        is_developed: bool,
        size: [u32; 2],
        sampling: Sampling,
        control: &RenderControl,
    ) -> Result<(Film, Statistics)> {
        let mut sized = self.job().with_size(size)?;
        if sampling != sized.plan_settings.sampling {
            sized.set_sampling(sampling)?;
        }
        sized.expose_as(self.job());
        match is_developed || self.is_exposed() {
            true => sized.render_to_develop(|_, _| true, control),
            false => sized.render_selected(|_, _| true, control),
        }
    }

    /// The image of the last pass. It is the picture of the job.
    pub(crate) fn final_image(mut self) -> Result<RenderedImage> {
        let control = RenderControl::default();
        let (mut shown, mut cast) = (None, 0);
        for index in 0..self.passes() {
            let (rendered, _) = self.pass(index, control.cancel, 0)?;
            cast += rendered.statistics.rays(RayKind::PRIMARY).cast;
            assert_eq!(rendered.spent.rays(RayKind::PRIMARY).cast, cast, "in all passes so far");
            shown = Some(rendered);
        }
        let (film, _) = self.job().render::<[u8; 3]>(&control)?;
        let picture: Vec<[u8; 3]> = film.rows().collect();
        let shown = shown.expect("a pass");
        assert_eq!(shown.display, self.job().display_transform(&control)?);
        let bytes = shown.image.pixels.iter().map(|colour| [colour.r(), colour.g(), colour.b()]);
        let other = picture.iter().zip(bytes).find(|(a, b)| *a != b);
        let file = &self.request.opened.scene().inputs;
        assert_eq!(other, None, "the last pass shows the picture: {file:?}, {:?}", self.passes);
        Ok(shown)
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
    use crate::controls::Controls;
    use crate::painter::RenderCache;
    use crate::request::{CameraSource, Opened};
    use kiln::bvh::Sphere;
    use kiln::film::tone::ToneMap;
    use kiln::glam::DVec3;
    use kiln::job::{RenderSettings, Session};
    use kiln::scene::{Scene, Shape};
    use kiln::world::StandardView;

    /// No picture is developed for what is known of its pixels.
    #[test]
    fn false_colours_have_no_film() {
        let ball = Sphere { centre: DVec3::ZERO, radius: 1.0 };
        let scene = Scene::from_iter([Shape::Analytic(ball.into())]);
        let opened = Arc::new(Opened {
            session: Session::playing(scene).expect("a scene").into(),
            camera_source: CameraSource::Fitted(StandardView::Front),
            projection: None,
            settings: RenderSettings::default(),
        });
        let mut controls = Controls::new(&opened);
        for mode in DisplayMode::ALL {
            controls.display_mode = mode;
            let request = controls.request(&opened, [16, 16]);
            let prepared = RenderCache::default().prepare(&request).expect("a picture");
            let mut progress = Progress::new(&request, prepared, 1);
            let cancel = AtomicBool::new(false);
            let (rendered, _) = progress.pass(progress.passes() - 1, &cancel, 0).expect("an image");
            let is_picture = mode == DisplayMode::Picture;
            assert_eq!((rendered.film.is_some(), rendered.legend.is_none()), (is_picture, is_picture));
        }
    }

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
