//! Rendering to a target: as many samples as an error or a time allows, and an estimate of the error that is left.
//!
//! The truth is the antialiased picture: that of ever more samples through the same filter, with the same effects, bounces and
//! numerics. Samples are taken in stretches of their sequence, each as long as all before it, of the whole picture; both halves are
//! kept apart until they have been held against each other. So measuring casts no ray that the picture does not need, and sees
//! every pixel, not only some crops whose error need not be the picture's.
//!
//! What the halves say: let v(n) be the variance of the mean of n samples, r = v(2n) / v(n), and A and B the halves of 2n. From
//! v(2n) = (v(n) + cov) / 2 and E|A - B|^2 = 2 (v(n) - cov) follows v(2n) = E|A - B|^2 * r / (4 (1 - r)). Independent samples have
//! r = 1/2; those stratified over edges have r = 2^(-3/2) (Mitchell, Consequences of Stratified Sampling in Graphics, SIGGRAPH 1996,
//! section 3). r is measured, as that by which E|A - B|^2 falls from one doubling to the next, and held between both.
//! Errors other than mean squares are those between the picture and itself moved by that share of A - B.

use std::time::Instant;

use crate::effects::{Choices, Plan};
use crate::error::{Error, Result};
use crate::film::{ColourPipeline, Film, Window};
use crate::render::{Clock, Statistics, Watch, render_as};
use crate::scene::Sampling;
use crate::study::metrics::{Values, displayed, mean_flip, mean_over};
use crate::world::{View, World};

/// The most samples a pixel that are taken.
const MOST: u32 = 1 << 14;

/// The range of r, see above.
const RATIOS: (f64, f64) = (0.353_553_390_593_273_8, 0.5);

/// How much lower than the target an estimate has to be, since it is one.
const MARGIN: f64 = 1.05;

/// The same for a largest error: that of the few pixels with the largest, whose halves may agree by chance.
const MARGIN_OF_MAX: f64 = 1.5;

/// At most by how much half as many samples more lower an error. By the exponent -3/4 of stratified samples it would be 0.74;
/// but these lie less evenly than a power of two of them.
const HALF_MORE: f64 = 0.87;

/// How much lower than expected an error may turn out; where also that would be too much, it is not measured.
const PATIENCE: f64 = 0.8;

/// An error between what a display shows of two pictures, 1 being white, before it is rounded to 8 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// Mean LDR-FLIP.
    Flip,
    /// Root of the mean square difference over pixels and channels.
    Rmse,
    /// Largest difference of any channel.
    Max,
}

impl Metric {
    /// Every one.
    pub const ALL: [Metric; 3] = [Metric::Flip, Metric::Rmse, Metric::Max];

    /// The name, as typed.
    pub fn name(self) -> &'static str {
        match self {
            Metric::Flip => "FLIP",
            Metric::Rmse => "RMSE",
            Metric::Max => "MAX",
        }
    }

    fn between(self, a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> f64 {
        match self {
            Metric::Flip => mean_flip(a, b, width),
            Metric::Rmse => mean_over(a, b, |a, b| (a - b).powi(2)).sqrt(),
            Metric::Max => {
                let apart = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
                a.as_flattened().iter().zip(b.as_flattened()).map(apart).fold(0.0, f64::max)
            }
        }
    }

    fn margin(self) -> f64 {
        if self == Metric::Max { MARGIN_OF_MAX } else { MARGIN }
    }
}

/// What a picture is to reach: an error, or the most that a time allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// The error, and how large it may be.
    pub accuracy: Option<(Metric, f64)>,
    /// Seconds that rendering may take.
    pub seconds: Option<f64>,
}

/// What is rendered.
pub struct Subject<'a> {
    /// The scene; its sampling is set to what was taken in the end.
    pub world: &'a mut World,
    /// The camera.
    pub view: &'a View,
    /// The effects.
    pub choices: &'a Choices,
    /// The part of the picture.
    pub window: Window,
}

/// A picture, and what it took.
pub struct Chosen {
    /// Its pixels, row by row from the top, in the numbers of the pipeline.
    pub pixels: Vec<[f32; 3]>,
    /// Of all stretches together.
    pub statistics: Statistics,
    /// The plan of as many samples.
    pub plan: Plan,
    /// Samples that each pixel took.
    pub samples: u32,
    /// The error asked for, else FLIP, and the estimate of it.
    pub estimate: (Metric, f64),
    /// Why it ended there.
    pub end: End,
}

/// Why no more samples were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The error is below the target.
    Reached,
    /// The time is over.
    Time,
    /// There are no more samples.
    Most,
    /// Pixels are not finite: there is no error to estimate.
    NotFinite,
}

impl Chosen {
    /// What was chosen and why, in a line.
    pub fn line(&self, wish: &Wish) -> String {
        let (metric, error) = self.estimate;
        if self.end == End::NotFinite {
            return format!("{} samples a pixel: no estimate of a picture that is not finite", self.samples);
        }
        let target = wish.accuracy.map(|(_, value)| format!("; asked for {value}")).unwrap_or_default();
        let why = match (self.end, wish.seconds) {
            (End::Time, Some(seconds)) => format!("; more do not fit into {seconds} s"),
            (End::Most, _) => "; there are no more".into(),
            _ => String::new(),
        };
        let name = metric.name();
        format!("{} samples a pixel: {name} to the truth is about {error:.2e}{target}{why}", self.samples)
    }
}

/// Renders to a target, on the current rayon pool.
///
/// # Errors
/// As those of [`crate::render::render`] and [`Plan::new`]; [`Error::Usage`] where antialiasing is turned off.
pub fn render(subject: &mut Subject, wish: &Wish, watch: &Watch, clock: Clock) -> Result<Chosen> {
    let metric = wish.accuracy.map_or(Metric::Flip, |(metric, _)| metric);
    let is_enough = |error: f64| wish.accuracy.is_some_and(|(_, target)| error * metric.margin() <= target);
    let values = match subject.world.pipeline {
        ColourPipeline::Linear => Values::Linear,
        ColourPipeline::Display | ColourPipeline::U8 => Values::Display,
    };
    let start = Instant::now();
    let width = subject.window.width;
    let asked = subject.world.sampling;
    let mut stretch = |from: u32, to: u32| {
        subject.world.sampling = part_of(&asked, from, to);
        let plan = Plan::new(subject.world, subject.choices)?;
        if !plan.effects_on().any(|effect| effect == "antialiasing") {
            let what = "an error or a time is reached by samples, and there is no antialiasing";
            return Err(Error::usage(what, "leave out --without antialiasing, or --accuracy and --budget"));
        }
        let (film, statistics): (Film, _) =
            render_as(subject.world, subject.view, &plan, subject.window, watch, clock)?;
        Ok((film.rows().collect::<Vec<_>>(), statistics))
    };

    let (first, mut statistics) = stretch(0, 1)?;
    let mut level = Level { samples: 1, pixels: first, halves: Default::default(), apart: None, share: 0.0 };
    // The last error that was measured, and how far the picture was off then.
    let mut known: Option<(f64, f64)> = None;
    let (error, end) = loop {
        let (more, of_more) = stretch(level.samples, 2 * level.samples)?;
        statistics.add(&of_more);
        level = level.joined_by(more);
        let samples = level.samples;
        if statistics.non_finite.0 > 0 {
            break (f64::NAN, End::NotFinite);
        }

        // Measuring costs as much as some samples: first where it may be enough, if errors fall as mean squares do; perceived ones
        // fall more slowly, or hardly faster.
        let soon = |(error, off): (f64, f64)| error * level.off() / off * HALF_MORE;
        let is_near = |known: Option<(f64, f64)>| known.is_none_or(|known| is_enough(PATIENCE * soon(known)));
        let measured =
            (wish.accuracy.is_some() && is_near(known)).then(|| level.error(metric, values, width));
        if let Some(error) = measured {
            known = Some((error, level.off()));
        }
        if let Some(error) = measured.filter(|&error| is_enough(error)) {
            break (error, End::Reached);
        }
        if samples >= MOST {
            break (measured.unwrap_or_else(|| level.error(metric, values, width)), End::Most);
        }
        // Samples that there is time for, if they take as long as those before.
        let spent = start.elapsed().as_secs_f64();
        let left = wish.seconds.map(|seconds| (seconds - spent).max(0.0));
        let fit = left.map_or(f64::INFINITY, |left| 0.9 * left * f64::from(samples) / spent);
        let few = (samples / 2).max(1);
        let is_last = measured.is_some_and(|error| is_enough(error * HALF_MORE));
        if !is_last && f64::from(samples) <= fit {
            continue;
        }
        let error = measured.unwrap_or_else(|| level.error(metric, values, width));
        let end = if is_last && f64::from(few) <= fit { End::Reached } else { End::Time };
        let rest = if end == End::Reached { few } else { fit as u32 };
        if rest > 0 {
            let (more, of_more) = stretch(samples, samples + rest)?;
            statistics.add(&of_more);
            level.pixels = joined(&level.pixels, samples, &more, rest);
            level.samples += rest;
        }
        // Of fewer, their share of what half as many more bring.
        let gain = (1.0 - HALF_MORE) * f64::from(rest.min(few)) / f64::from(few);
        break (error * (1.0 - gain), end);
    };
    let Level { pixels, samples, .. } = level;
    subject.world.sampling = Sampling { first: None, ..part_of(&asked, 0, samples) };
    let plan = Plan::new(subject.world, subject.choices)?;
    Ok(Chosen { pixels, statistics, plan, samples, estimate: (metric, error), end })
}

/// A picture of so many samples, and its halves.
struct Level {
    samples: u32,
    pixels: Vec<[f32; 3]>,
    halves: [Vec<[f32; 3]>; 2],
    /// The mean square of the difference of its halves, in the film's numbers up to 1.
    apart: Option<f64>,
    /// By which share of that difference it is off.
    share: f64,
}

impl Level {
    /// The picture of twice as many samples, by another half.
    fn joined_by(self, more: Vec<[f32; 3]>) -> Self {
        let pixels = joined(&self.pixels, self.samples, &more, self.samples);
        let held = |c: f64| c.clamp(0.0, 1.0);
        let apart = mean_over(&self.pixels, &more, |a, b| (held(a) - held(b)).powi(2));
        let share = share_of_difference(self.apart, apart);
        Level { samples: 2 * self.samples, pixels, halves: [self.pixels, more], apart: Some(apart), share }
    }

    /// How far it is off: root mean square, in the film's numbers.
    fn off(&self) -> f64 {
        // Not 0, to be divided by.
        (self.share * self.apart.unwrap_or(0.0).sqrt()).max(f64::MIN_POSITIVE)
    }

    /// The estimate of an error.
    fn error(&self, metric: Metric, values: Values, width: u32) -> f64 {
        let picture = displayed(&self.pixels, values);
        let halves = [displayed(&self.halves[0], values), displayed(&self.halves[1], values)];
        metric.between(&picture, &moved(&picture, &halves, self.share), width)
    }
}

/// The same sampling, of the samples from one number up to another, the same for all pixels.
fn part_of(asked: &Sampling, from: u32, to: u32) -> Sampling {
    let (shape, radius) = asked.shape_and_radius();
    Sampling {
        samples: Some(to),
        first: Some(from),
        // Said, so that also one sample is one of the filter's and not the pixel's centre.
        filter: Some(shape),
        filter_radius: Some(radius),
        noise: None,
        min_samples: None,
        seed: asked.seed,
    }
}

/// The mean of two means of so many.
fn joined(a: &[[f32; 3]], of_a: u32, b: &[[f32; 3]], of_b: u32) -> Vec<[f32; 3]> {
    let (of_a, of_b) = (f64::from(of_a), f64::from(of_b));
    let mean = |a: f32, b: f32| ((f64::from(a) * of_a + f64::from(b) * of_b) / (of_a + of_b)) as f32;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| mean(a[c], b[c]))).collect()
}

/// By which share of the difference of its halves a picture is off. `before` and `now` are the mean squares of that difference at
/// half as many samples, and at these.
fn share_of_difference(before: Option<f64>, now: f64) -> f64 {
    let measured = before.filter(|&before| before > 0.0).map_or(RATIOS.1, |before| now / before);
    let r = measured.clamp(RATIOS.0, RATIOS.1);
    (r / (4.0 * (1.0 - r))).sqrt()
}

/// A picture moved by a share of the difference of its halves.
fn moved(shown: &[[f32; 3]], halves: &[Vec<[f32; 3]>; 2], share: f64) -> Vec<[f32; 3]> {
    let share = share as f32;
    let pixel = |i: usize| {
        std::array::from_fn(|c| (shown[i][c] + share * (halves[0][i][c] - halves[1][i][c])).clamp(0.0, 1.0))
    };
    (0..shown.len()).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_follows_from_how_variance_falls() {
        // Independent halves: the mean of two is off by half of what lies between them, on average.
        assert_eq!(share_of_difference(None, 1.0), 0.5);
        assert_eq!(share_of_difference(Some(2.0), 1.0), 0.5);
        // Variance that does not fall at all is not believed, nor one that falls faster than theory says.
        assert_eq!(share_of_difference(Some(1.0), 1.0), 0.5);
        // r / (4 (1 - r)) of 2^-1.5 is 0.136729.
        assert!((share_of_difference(Some(10.0), 1.0).powi(2) - 0.136_729).abs() < 1e-6);
    }

    #[test]
    fn means_are_joined_by_how_many_they_are_of() {
        // (4 * 1 + 2 * 4) / 6 = 2.
        assert_eq!(joined(&[[1.0; 3]], 4, &[[4.0; 3]], 2), [[2.0; 3]]);
    }

    #[test]
    fn a_picture_stays_on_the_display_when_moved() {
        let halves = [vec![[1.0, 0.5, 0.0]], vec![[0.0, 0.25, 1.0]]];
        assert_eq!(moved(&[[0.75; 3]], &halves, 0.5), [[1.0, 0.875, 0.25]]);
    }
}
