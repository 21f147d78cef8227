//! The samples of a choice: rendered part by part, and what they took added up.

use std::time::Instant;

use super::survey::Squares;
use super::{Chosen, End, Metric, Wish};
use crate::effects::id;
use crate::error::{Error, Result};
use crate::film::{ColourPipeline, Film, TILE, Window};
use crate::job::RenderJob;
use crate::render::{RenderControl, Statistics};
use crate::scene::Sampling;
use crate::metrics::Values;

/// Renders parts of the picture's samples, and adds up what they took.
pub struct Taker<'a> {
    job: &'a mut RenderJob,
    control: &'a RenderControl<'a>,
    start: Instant,
    asked: Sampling,
    /// What the film's numbers are.
    pub values: Values,
    pub squares: Squares,
    statistics: Option<Statistics>,
}

impl<'a> Taker<'a> {
    pub fn new(job: &'a mut RenderJob, control: &'a RenderControl<'a>) -> Result<Self> {
        let asked = job.choices.sampling;
        let values = match job.pipeline() {
            ColourPipeline::Linear => Values::Linear,
            ColourPipeline::Display | ColourPipeline::U8 => Values::Display,
        };
        let squares = Squares::new(job.window.width, job.window.height);
        let start = Instant::now();
        job.set_sampling(asked.part(0, 1))?;
        if !job.plan.takes_samples() {
            let effect = id::ANTIALIASING;
            let what = format!("an error or a time is reached by samples, and there is no {effect}");
            let hint = format!("leave out --without {effect}, or --accuracy and --budget");
            return Err(Error::usage(what, hint));
        }
        Ok(Taker { job, control, start, asked, values, squares, statistics: None })
    }

    /// The pixels' centres.
    pub fn take_centres(&mut self) -> Result<Vec<[f32; 3]>> {
        let mut pixels = self.black();
        self.render(Sampling { seed: self.asked.seed, ..Sampling::default() }, &|_| true, &mut pixels)?;
        Ok(pixels)
    }

    /// The mean of the samples from one number up to another, of the whole picture.
    pub fn take(&mut self, from: u32, to: u32) -> Result<Vec<[f32; 3]>> {
        let mut pixels = self.black();
        self.take_some((from, to), &|_| true, &mut pixels)?;
        Ok(pixels)
    }

    /// The same of some squares, into a picture of which the rest stays as it is.
    pub fn take_some(
        &mut self,
        (from, to): (u32, u32),
        wanted: &(dyn Fn(usize) -> bool + Sync),
        pixels: &mut [[f32; 3]],
    ) -> Result<()> {
        self.render(self.asked.part(from, to), wanted, pixels)
    }

    pub fn black(&self) -> Vec<[f32; 3]> {
        vec![[0.0; 3]; self.job.window.area()]
    }

    fn render(
        &mut self,
        sampling: Sampling,
        wanted: &(dyn Fn(usize) -> bool + Sync),
        pixels: &mut [[f32; 3]],
    ) -> Result<()> {
        self.job.set_sampling(sampling)?;
        let (window, squares) = (self.job.window, self.squares);
        let is_wanted = |tile: Window| wanted(squares.at(tile.x - window.x, tile.y - window.y));
        let (film, statistics): (Film, _) =
            self.job.render_selected(|_, tile| is_wanted(tile), self.control)?;
        match &mut self.statistics {
            Some(sum) => sum.add(&statistics),
            none => *none = Some(statistics),
        }
        for (y, row) in (0..).zip(pixels.chunks_mut(window.width as usize)) {
            // The parts of a row are those of tiles.
            for (i, (own, part)) in (0..).zip(row.chunks_mut(TILE as usize).zip(film.row(y))) {
                if wanted(squares.at(i * TILE, y)) {
                    own.copy_from_slice(part);
                }
            }
        }
        Ok(())
    }

    pub fn is_finite(&self) -> bool {
        self.statistics.as_ref().is_none_or(|statistics| statistics.non_finite.0 == 0)
    }

    /// How many samples there is time for, if they take as long as so many took.
    pub fn samples_in_time(&self, samples: u32, wish: &Wish) -> f64 {
        let spent = self.start.elapsed().as_secs_f64();
        let left = wish.seconds.map(|seconds| (seconds - spent).max(0.0));
        left.map_or(f64::INFINITY, |left| 0.9 * left * f64::from(samples) / spent)
    }

    /// Whether there is time for so many samples after the first look, which took about two.
    pub fn has_time_for(&self, samples: u32, wish: &Wish) -> bool {
        f64::from(samples) <= self.samples_in_time(2, wish)
    }

    /// The picture, and what it took.
    pub fn done(
        self,
        pixels: Vec<[f32; 3]>,
        samples: u32,
        estimate: (Metric, f64),
        end: End,
    ) -> Result<Chosen> {
        let seed = self.asked.seed;
        self.job.set_sampling(match samples {
            1 => Sampling { seed, ..Sampling::default() },
            samples => Sampling { first: None, ..self.asked.part(0, samples) },
        })?;
        let Some(statistics) = self.statistics else {
            let hint = String::new();
            return Err(Error::Failed { what: "nothing was rendered".into(), hint });
        };
        Ok(Chosen { pixels, statistics, samples, estimate, end })
    }
}
