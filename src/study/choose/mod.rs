//! Rendering to a target: as many samples as an error or a time allows, and an estimate of the error that is left.
//!
//! The truth is the antialiased picture: that of ever more samples through the same filter, with the same effects, bounces and
//! numerics. First the pixels' centres are rendered, and a few squares sampled: often that is enough (`look`). Then samples are taken
//! in stretches of their sequence, each as long as all before it, of the whole picture; both halves are kept apart until they have
//! been held against each other. So measuring casts no ray that the picture does not need; and it takes a few squares, those where the
//! halves differ most with the greatest chance (`survey`).
//!
//! What the halves say: let v(n) be the variance of the mean of n samples, r = v(2n) / v(n), and A and B the halves of 2n. From
//! v(2n) = (v(n) + cov) / 2 and E|A - B|^2 = 2 (v(n) - cov) follows v(2n) = E|A - B|^2 * r / (4 (1 - r)). Independent samples have
//! r = 1/2; those stratified over edges have r = 2^(-3/2) (Mitchell, Consequences of Stratified Sampling in Graphics, SIGGRAPH 1996,
//! section 3). r is measured, as that by which E|A - B|^2 falls from one doubling to the next, and held between both.
//! Errors other than mean squares are those between the picture and itself moved by that share of A - B.

mod halves;
mod look;
mod survey;
mod taker;

use crate::error::Result;
use crate::job::RenderJob;
use crate::render::{RenderControl, Statistics};
use crate::metrics::mean_flip;
use halves::{Level, Range};
use look::{Look, Probe};
use survey::Squares;
use taker::Taker;

/// The most samples a pixel that are taken.
const MOST: u32 = 1 << 14;

/// How much lower than the target an estimate has to be, since it is one.
const MARGIN: f64 = 1.05;

/// The same for a largest error: that of the few pixels with the largest, whose halves may agree by chance.
const MARGIN_OF_MAX: f64 = 1.5;

/// At most by how much half as many samples more lower an error. By the exponent -3/4 of stratified samples it would be 0.74;
/// but these lie less evenly than a power of two of them.
const HALF_MORE: f64 = 0.87;

/// How much lower than expected an error may turn out; where also that would be too much, it is not measured.
const PATIENCE: f64 = 0.8;

/// The same for what is expected of some squares.
const FAR: f64 = 0.5;

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

    /// What a part of a picture adds to its error.
    fn amount(self, a: &[[f32; 3]], b: &[[f32; 3]], width: u32) -> f64 {
        match self {
            Metric::Flip => mean_flip(a, b, width) * a.len() as f64,
            Metric::Rmse => squares_between(a, b),
            Metric::Max => {
                let apart = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
                a.as_flattened().iter().zip(b.as_flattened()).map(apart).fold(0.0, f64::max)
            }
        }
    }

    /// The error, of the amounts of all parts: their largest or their sum.
    fn of(self, amount: f64, squares: &Squares) -> f64 {
        match self {
            Metric::Flip => amount / squares.pixels(),
            Metric::Rmse => (amount / (3.0 * squares.pixels())).sqrt(),
            Metric::Max => amount,
        }
    }

    /// About what becomes of a difference: FLIP's exponent is 0.7.
    #[inline(always)]
    fn guess(self, difference: f32) -> f32 {
        let root = difference.abs().sqrt();
        if self == Metric::Flip { root * root.sqrt() } else { difference * difference }
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

/// A picture, and what it took.
pub struct Chosen {
    /// Its pixels, row by row from the top, in the numbers of the pipeline.
    pub pixels: Vec<[f32; 3]>,
    /// Of all stretches together.
    pub statistics: Statistics,
    /// Samples that each pixel took; 1 is its centre.
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
        let samples = match self.samples {
            1 => "1 sample a pixel, through its centre".into(),
            samples => format!("{samples} samples a pixel"),
        };
        format!("{samples}: {name} to the truth is about {error:.2e}{target}{why}")
    }
}

/// The sum of the squares of what lies between the channels of two pictures.
fn squares_between(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum()
}

/// An error that is not to be exceeded.
#[derive(Debug, Clone, Copy)]
struct Target {
    metric: Metric,
    value: f64,
}

impl Target {
    fn is_enough(&self, error: &Range) -> bool {
        error.most * self.metric.margin() <= self.value
    }

    /// Whether measuring more would not change the answer.
    fn is_clear(&self, error: &Range) -> bool {
        self.is_enough(error) || error.least * self.metric.margin() > self.value
    }

    /// Whether an error that is only expected is so far beyond that it need not be measured.
    fn is_far(&self, expected: &Range) -> bool {
        expected.least * FAR > self.value
    }
}

/// The most bytes for each pixel that rendering to a target takes: nine pictures of 12 bytes at most. By peak memory, up to 90.
pub const BYTES_A_PIXEL: u64 = 108;

/// Renders to a target, on the current rayon pool. In the end the job's sampling is the one that was taken.
///
/// # Errors
/// Those of [`RenderJob::render`]; [`crate::error::Error::Usage`] where antialiasing is turned off.
pub fn render(job: &mut RenderJob, wish: &Wish, control: &RenderControl) -> Result<Chosen> {
    let mut taker = Taker::new(job, control)?;
    let target = wish.accuracy.map(|(metric, value)| Target { metric, value });
    // The largest error of a picture is not one of a few squares.
    let Some(target) = target.filter(|target| target.metric != Metric::Max) else {
        let first = taker.take(0, 1)?;
        let second = taker.take(1, 2)?;
        return climb(taker, wish, Level::of_one(first).joined_by(second), None);
    };
    let (probe, look) = Probe::new(&mut taker, target)?;
    if !taker.is_finite() {
        return taker.done(probe.into_centres(), 1, (target.metric, f64::NAN), End::NotFinite);
    }
    match look {
        Look::Enough(0, error) => {
            taker.done(probe.into_centres(), 1, (target.metric, error.middle), End::Reached)
        }
        Look::Enough(samples, error) if taker.has_time_for(samples, wish) => {
            let pixels = probe.into_few(&mut taker, samples)?;
            let end = if taker.is_finite() { End::Reached } else { End::NotFinite };
            taker.done(pixels, samples, (target.metric, error.middle), end)
        }
        Look::Beyond(error) if taker.has_time_for(4, wish) => {
            let level = probe.into_four(&mut taker)?;
            // What is only expected saves measuring where it is far off.
            let is_far = target.is_far(&error);
            let known = is_far.then(|| (error.middle, level.off()));
            climb(taker, wish, level, known)
        }
        Look::Enough(_, error) | Look::Beyond(error) => {
            // Less than four samples are hardly better than the centres, which are there.
            taker.done(probe.into_centres(), 1, (target.metric, 2.0 * error.middle), End::Time)
        }
    }
}

/// Takes samples from those of `level` on. `known` is the last error that was measured or is expected of it, and how far the
/// picture was off then.
fn climb(mut taker: Taker, wish: &Wish, mut level: Level, mut known: Option<(f64, f64)>) -> Result<Chosen> {
    let metric = wish.accuracy.map_or(Metric::Flip, |(metric, _)| metric);
    let target = wish.accuracy.map(|(metric, value)| Target { metric, value });
    let is_enough = |error: &Range| target.is_some_and(|target| target.is_enough(error));
    let (squares, values) = (taker.squares, taker.values);
    // Also of half as many more it has to be clear whether they are enough.
    let is_clear = |range: &Range| {
        target.is_none_or(|target| {
            target.is_enough(range) || target.is_clear(range) && target.is_clear(&range.times(HALF_MORE))
        })
    };
    let measure = |level: &Level| level.error((metric, values), &squares, is_clear);
    let (error, end) = loop {
        let samples = level.samples;
        if !taker.is_finite() {
            break (f64::NAN, End::NotFinite);
        }

        // Measuring costs as much as some samples: first where it may be enough, if errors fall as mean squares do; perceived ones
        // fall more slowly, or hardly faster.
        let soon = |(error, off): (f64, f64)| Range::exactly(error * level.off() / off * HALF_MORE);
        let is_near =
            |known: Option<(f64, f64)>| known.is_none_or(|known| is_enough(&soon(known).times(PATIENCE)));
        let measured = (target.is_some() && is_near(known)).then(|| measure(&level));
        if let Some(error) = measured {
            known = Some((error.middle, level.off()));
        }
        if let Some(error) = measured.filter(is_enough) {
            break (error.middle, End::Reached);
        }
        if samples >= MOST {
            break (measured.unwrap_or_else(|| measure(&level)).middle, End::Most);
        }
        // Samples that there is time for, if they take as long as those before.
        let fit = taker.samples_in_time(samples, wish);
        let few = (samples / 2).max(1);
        let is_last = measured.is_some_and(|error| is_enough(&error.times(HALF_MORE)));
        if !is_last && f64::from(samples) <= fit {
            let more = taker.take(samples, 2 * samples)?;
            level = level.joined_by(more);
            continue;
        }
        let error = measured.unwrap_or_else(|| measure(&level));
        let end = if is_last && f64::from(few) <= fit { End::Reached } else { End::Time };
        let rest = if end == End::Reached { few } else { fit as u32 };
        if rest > 0 {
            let more = taker.take(samples, samples + rest)?;
            level.extended_by(&more, rest);
        }
        // Of fewer, their share of what half as many more bring.
        let gain = (1.0 - HALF_MORE) * f64::from(rest.min(few)) / f64::from(few);
        break (error.middle * (1.0 - gain), end);
    };
    let Level { pixels, samples, .. } = level;
    taker.done(pixels, samples, (metric, error), end)
}
