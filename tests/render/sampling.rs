//! Sampling: convergence of the mean to the exact integral, and independence of pixels.

use crate::common::Numbers;
use crate::common::picture::{Prepared, parse, prepare};
use glam::{DVec3, Vec4};
use kiln::effects::convergence::{
    Criterion, FirstSamples, Integrand as SampleIntegrand, Neighbourhood, SampleEstimate, SampleGroups,
    displayed_error, is_displayed_within, missed_variance, unseen_variance, value_and_variance,
};
use kiln::effects::random::{Dimension, Point, Scramble, independent_pair};
use kiln::effects::region::SampledRegion;
use kiln::effects::samples::SampleSum;
use kiln::effects::tile::{RenderContext, Tile};
use kiln::effects::variance::SampleVariance;
use kiln::effects::{Plan, PlanSettings, RayKind};
use kiln::film::{ColourPipeline, Film, FilterShape, ReconstructionFilter, Window};
use kiln::render::{RenderControl, Statistics, render};
use kiln::scene::{Numerics, Sampling};
use kiln::shading::ShadingMode;

/// The area of the part `a x + b y < d` of the unit square around the origin: the integral of a ramp twice, which is a
/// sum of squares of what lies on the right side of each corner.
fn area(a: f64, b: f64, d: f64) -> f64 {
    let (a, b) = (a.abs(), b.abs());
    let above = |s: f64| s.max(0.0).powi(2);
    let s = d + (a + b) / 2.0;
    (above(s) - above(s - a) - above(s - b) + above(s - a - b)) / (2.0 * a * b)
}

/// A function over a pixel, and its integral over the unit square around the origin.
type Integrand = (Box<dyn Fn(f64, f64) -> f64>, f64);

fn edge(numbers: &mut Numbers) -> Integrand {
    // Never along an axis, which the formula does not have.
    let (angle, d) = ((numbers.unit() + 1e-3) * std::f64::consts::TAU, 0.6 * numbers.signed());
    let (a, b) = (angle.cos(), angle.sin());
    (Box::new(move |x, y| f64::from(u8::from(a * x + b * y < d))), area(a, b, d))
}

fn smooth(numbers: &mut Numbers) -> Integrand {
    let (a, b) = (0.5 + numbers.unit(), 0.5 + numbers.unit());
    let along = |a: f64| 2.0 * (a / 2.0).sinh() / a;
    (Box::new(move |x, y| (a * x + b * y).exp()), along(a) * along(b))
}

/// A fine texture: a few waves a pixel.
fn texture(numbers: &mut Numbers) -> Integrand {
    let (a, b, phase) =
        (numbers.unit() * 12.0 + 1.0, numbers.unit() * 12.0 + 1.0, numbers.unit() * std::f64::consts::TAU);
    let along = |a: f64| 2.0 * (a / 2.0).sin() / a;
    (Box::new(move |x, y| (a * x + b * y + phase).sin()), phase.sin() * along(a) * along(b))
}

const PIXELS: u32 = 300;

/// The root mean square over pixels of what the mean of the first n samples is off, for n from 1 to `most`.
fn errors(make: fn(&mut Numbers) -> Integrand, most: u32, is_random: bool) -> Vec<f64> {
    let filter = ReconstructionFilter::new(FilterShape::Box, 0.5);
    let mut numbers = Numbers::new(5);
    let mut squares = vec![0.0; most as usize];
    for pixel in 0..PIXELS {
        let (value, exact) = make(&mut numbers);
        let scramble = Scramble::new(pixel, 7, 0);
        let mut sum = 0.0;
        for sample in 0..most {
            let own = scramble.of(Point::new(sample));
            let other = [numbers.unit() as f32, numbers.unit() as f32];
            let ([x, y], _) = filter.sample(if is_random { other.map(|u| u.min(0.999_999)) } else { own });
            sum += value(x, y);
            squares[sample as usize] += (sum / f64::from(sample + 1) - exact).powi(2);
        }
    }
    squares.iter().map(|s| (s / f64::from(PIXELS)).sqrt()).collect()
}

/// The slope of the logarithm of the error over that of the count, by least squares.
fn slope(errors: &[f64], counts: &[usize]) -> f64 {
    let points: Vec<(f64, f64)> = counts.iter().map(|&n| ((n as f64).ln(), errors[n - 1].ln())).collect();
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let covariance: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    covariance / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>()
}

/// Counts that are no powers of two, about evenly spaced in their logarithm.
const ODD: &[usize] = &[9, 13, 21, 35, 51, 85, 133, 211, 341, 541, 871, 1401];
const POWERS: &[usize] = &[8, 16, 32, 64, 128, 256, 512, 1024];

#[test]
fn the_areas_of_half_planes() {
    // Halves; a corner of legs 1/2 cut off: 1/8; nothing, and all.
    assert!((area(0.6, -0.8, 0.0) - 0.5).abs() < 1e-12);
    assert!((area(1.0, 1.0, -0.5) - 0.125).abs() < 1e-12);
    assert_eq!(area(0.6, 0.8, -0.8), 0.0);
    assert!((area(0.6, 0.8, 0.8) - 1.0).abs() < 1e-12);
}

#[test]
fn the_error_falls_as_the_sequence_promises() {
    // Random points: n^-0.5 whatever there is to see. Stratified ones: n^-0.75 where there are edges (Mitchell 1996).
    // Scrambled Sobol sequences: n^-1.5 on smooth functions at powers of two, n^-1 in between, where the last points
    // are few.
    for (name, make, odd, powers) in [
        ("edge", edge as fn(&mut Numbers) -> Integrand, -0.68, -0.70),
        ("smooth", smooth, -0.95, -1.4),
        ("texture", texture, -0.95, -1.2),
    ] {
        let own = errors(make, 1401, false);
        let random = errors(make, 1401, true);
        let slopes = [slope(&own, ODD), slope(&own, POWERS), slope(&random, ODD)];
        println!("{name}: slopes {slopes:.2?}, errors of 16 samples {:.4} and {:.4}", own[15], random[15]);
        assert!(slopes[0] < odd, "{name}: {slopes:?}");
        assert!(slopes[1] < powers, "{name}: {slopes:?}");
        // The measure itself tells.
        assert!((slopes[2] + 0.5).abs() < 0.1, "{name}: {slopes:?}");
        // From 16 on: before, the texture's waves are finer than the samples.
        for n in 16..=own.len() {
            assert!(
                own[n - 1] < 0.95 * random[n - 1],
                "{name}: {n} samples: {} {}",
                own[n - 1],
                random[n - 1]
            );
        }
    }
}

#[test]
fn every_filter_finds_its_own_moments() {
    // The mean of x^2 + x through a filter is its second moment: by 2^16 samples to 1e-3, negative lobes and all. Of
    // the box r^2/3, of the tent r^2/6, of Mitchell and Netravali's (2 B / 3) / 2 = 1/9 of a quarter of its radius'
    // square.
    let gaussian = |r: f64| {
        // By the midpoint rule over exp(-9/2 x^2) - exp(-9/2), the filter of radius 1.
        let sums = (0..100_000).map(|i| (f64::from(i) + 0.5) / 1e5).fold((0.0, 0.0), |(one, two), x| {
            let value = (-4.5 * x * x).exp() - (-4.5f64).exp();
            (one + value, two + value * x * x)
        });
        sums.1 / sums.0 * r * r
    };
    for (shape, radius, moment) in [
        (FilterShape::Box, 0.5, 0.25 / 3.0),
        (FilterShape::Box, 2.0, 4.0 / 3.0),
        (FilterShape::Tent, 1.0, 1.0 / 6.0),
        (FilterShape::Gaussian, 1.5, gaussian(1.5)),
        (FilterShape::Mitchell, 2.0, 1.0 / 9.0),
        (FilterShape::Mitchell, 3.0, 1.0 / 4.0),
    ] {
        let filter = ReconstructionFilter::new(shape, radius);
        let scramble = Scramble::new(1, 2, 3);
        let mut sum = SampleSum::default();
        for sample in 0..1 << 16 {
            let ([x, y], sign) = filter.sample(scramble.of(Point::new(sample)));
            sum.add([x * x + x, y * y, x * y].map(|c| c as f32), sign);
        }
        let value = sum.value(&filter);
        assert!((value - DVec3::new(moment, moment, 0.0)).abs().max_element() < 1e-3, "{shape:?} {value}");
    }
}

#[test]
fn equal_samples_have_their_own_colour_as_their_mean() {
    for shape in FilterShape::ALL {
        let filter = ReconstructionFilter::new(shape, shape.default_radius());
        for count in 1..200 {
            let colour = [0.1f32, 1.0 / 3.0, 7e-9];
            let scramble = Scramble::new(count, 2, 3);
            let (mut sum, mut samples) = (SampleSum::default(), Samples::default());
            for sample in 0..count {
                let (_, sign) = filter.sample(scramble.of(Point::new(sample)));
                sum.add(colour, sign);
                samples.add(colour, sign as f32);
            }
            assert_eq!(sum.value(&filter).as_vec3().to_array(), colour, "{shape:?} {count}");
            if count > 1 {
                let estimate = samples.estimate(filter.mean_sign());
                for integrand in [SampleIntegrand::Stratified, SampleIntegrand::Random] {
                    let (value, variance) =
                        value_and_variance([estimate].iter(), integrand, &Neighbourhood::default());
                    assert!(variance.max_element() < 1e-12);
                    assert!((value - DVec3::from(colour.map(f64::from))).abs().max_element() < 1e-7);
                }
            }
        }
    }
}

/// What became of pixels with an edge, black beside white, at any angle through them or close by.
struct Stopped {
    /// The share of those that are off by more than three times the level.
    wrong: f64,
    rms: f64,
    samples: f64,
}

/// Samples pixels as the effect does; without what first samples of neighbours show where `by_first` is false.
fn stop(adaptive: Criterion, most: u32, by_first: bool) -> Stopped {
    let filter = ReconstructionFilter::new(FilterShape::Gaussian, 1.5);
    let mut numbers = Numbers::new(11);
    let (mut wrong, mut squares, mut taken) = (0, 0.0, 0);
    let pixels = 2000;
    for pixel in 0..pixels {
        let (value, _) = edge(&mut numbers);
        let (left, top) = (3 * pixel, 1);
        // Adds the samples `from` up to `to` of a pixel of the three by three.
        let take = |i: u32, from: u32, to: u32, samples: &mut Samples| {
            let (column, row) = (i % 3, i / 3);
            let scramble = Scramble::new(left + column, top + row, 0);
            for sample in from..to {
                let ([x, y], sign) = filter.sample(scramble.of(Point::new(sample)));
                let colour = [value(x + f64::from(column) - 1.0, y + f64::from(row) - 1.0) as f32; 3];
                samples.add(colour, sign as f32);
            }
        };
        let mut near = [Samples::default(); 9];
        let (mut around, mut count) = (Neighbourhood::default(), 0);
        loop {
            let next = adaptive.next_test(count, most);
            (0..9).zip(&mut near).for_each(|(i, samples)| take(i, count, next, samples));
            if count == 0 && by_first {
                let first: Vec<_> =
                    near.iter().map(|samples| FirstSamples::from(&samples.variance)).collect();
                around = Neighbourhood::new(
                    first.iter().enumerate().filter(|(i, _)| *i != 4).map(|(_, first)| first),
                );
            }
            count = next;
            let others: Vec<_> = (0..9).filter(|&i| i != 4).map(|i| near[i].estimate(1.0)).collect();
            let (value, variance) = value_and_variance(others.iter(), SampleIntegrand::Stratified, &around);
            let error = (variance + missed_variance(around.deviation, count)).x.sqrt();
            let error = displayed_error(value, DVec3::splat(error), |c| c.clamp(DVec3::ZERO, DVec3::ONE));
            if count == most || error <= adaptive.max_error {
                break;
            }
        }
        let mut exact = Samples::default();
        take(4, 0, 1 << 14, &mut exact);
        let off = (near[4].variance.mean().x - exact.variance.mean().x).abs();
        wrong += u32::from(off > 3.0 * adaptive.max_error);
        squares += off * off;
        taken += count;
    }
    let share = |of: f64| of / f64::from(pixels);
    Stopped { wrong: share(f64::from(wrong)), rms: share(squares).sqrt(), samples: share(f64::from(taken)) }
}

#[test]
fn few_pixels_are_stopped_too_early() {
    // Edges cross the pixel or pass close by, and its neighbours show what is in it: the samples of a filter overlap
    // theirs. All these pixels together may be off by somewhat more than the level, though not by half as much again.
    let level = 0.01;
    for (floor, share) in [(4, 0.02), (16, 0.02)] {
        let adaptive = Criterion { max_error: level, min_samples: floor };
        let [without, with] = [false, true].map(|by_first| stop(adaptive, 1024, by_first));
        for (name, Stopped { wrong, rms, samples }) in [("without", &without), ("with", &with)] {
            println!(
                "{floor} first, {name}: {wrong:.4} stopped wrongly; rms {rms:.4}; {samples:.1} samples a pixel"
            );
        }
        assert!(with.wrong < share && with.rms < 1.5 * level, "{} {}", with.wrong, with.rms);
        // The measure itself tells, where samples are few.
        let is_worse = without.wrong > with.wrong && without.rms > with.rms;
        assert!(is_worse || floor > 4, "{} {}", without.wrong, without.rms);
    }
}

#[test]
fn first_samples_lie_apart_by_their_mean_squares() {
    let first = |colours: &[f32]| {
        let mut samples = SampleVariance::default();
        colours.iter().for_each(|&colour| samples.add([colour, 0.0, 1.0]));
        FirstSamples::from(&samples)
    };
    // 0, 0, 1, 1 has a variance of 4 (1/2)^2 / 3 = 1/3 and the mean 1/2, 1/4 off that of both pixels, as black is: (0 +
    // 1/3) / 2 + 1/16 = 11/48.
    let (black, half) = (first(&[0.0; 4]), first(&[0.0, 0.0, 1.0, 1.0]));
    let spread = Neighbourhood::new([&black, &half].into_iter()).deviation;
    assert!((spread.x - 11.0 / 48.0).abs() < 1e-6 && spread.y == 0.0 && spread.z == 0.0, "{spread}");
    // What is no number is left out, and does not hide the others.
    let broken = first(&[f32::NAN; 4]);
    assert_eq!(Neighbourhood::new([&black, &broken, &half].into_iter()).deviation, spread);
    // Isolated is what varies more than all around together.
    assert!(
        half.isolated_variance([&black, &black]) == half.isolated_variance([])
            && !half.isolated_variance([]).eq(&Vec4::ZERO)
    );
    assert_eq!([half.isolated_variance([&half, &half]), broken.isolated_variance([&black])], [Vec4::ZERO; 2]);
    // It counts for less and less: by the third power of the samples taken.
    let [few, many] = [4, 8].map(|taken| missed_variance(spread, taken));
    assert!((few.x / many.x - 8.0).abs() < 1e-9 && few.y == 0.0);
}

/// Uniform numbers of independent samples decide: an event of probability p with the value h, as an occlusion ray is,
/// or light of a heavy tail, uniform to the power of 8, whose mean is h / 9 and whose variance h^2 (1 / 17 - 1 / 81).
const LIGHTS: [fn(f64) -> f64; 5] = [
    |u| f64::from(u8::from(u < 0.5)),
    |u| f64::from(u8::from(u < 0.05)),
    |u| f64::from(u8::from(u < 0.01)) * 2.0,
    |u| u.powi(8) * 9.0,
    |u| 0.5 + 0.1 * u,
];

/// The mean and the variance of a sample of each of [`LIGHTS`]: p h and p (1 - p) h^2; 1 and 81 / 17 - 1; of a uniform
/// number 1/2 and 1/12.
const MOMENTS: [[f64; 2]; 5] =
    [[0.5, 0.25], [0.05, 0.0475], [0.02, 0.0396], [1.0, 64.0 / 17.0], [0.55, 0.01 / 12.0]];

fn light(kind: usize, seed: u32, pixel: u32, sample: u32) -> f64 {
    LIGHTS[kind](f64::from(independent_pair([pixel, seed], 1, sample, Dimension::light(0, 0)[1])[0]))
}

/// The samples of a pixel in both forms.
#[derive(Clone, Copy, Default)]
struct Samples {
    variance: SampleVariance,
    groups: SampleGroups,
}

impl Samples {
    fn add(&mut self, colour: [f32; 3], sign: f32) {
        self.variance.add(colour);
        self.groups.add(colour, sign);
    }

    /// Takes the samples `from..to` of a pixel.
    fn take(&mut self, (kind, seed, pixel): (usize, u32, u32), from: u32, to: u32) {
        for sample in from..to {
            self.add([light(kind, seed, pixel, sample) as f32; 3], 1.0);
        }
    }

    fn estimate(&self, mean_sign: f64) -> SampleEstimate {
        SampleEstimate::new(&self.variance, &self.groups, mean_sign)
    }
}

/// Three by three pixels with such light, of `first` samples, and what those around the middle say.
fn nine(kind: usize, seed: u32, first: u32) -> ([Samples; 9], Neighbourhood) {
    let nine = std::array::from_fn(|pixel| {
        let mut samples = Samples::default();
        samples.take((kind, seed, pixel as u32), 0, first);
        samples
    });
    let near: Vec<FirstSamples> =
        nine.iter().map(|pixel: &Samples| FirstSamples::from(&pixel.variance)).collect();
    (nine, Neighbourhood::new(near.iter().skip(1)))
}

/// The predicted variance of the mean against the squared error measured over many seeds. The own and the pooled
/// variance, and that of groups, have the mean of the true one, of which the prediction is the mean of the last and the
/// maximum of the others: no less than the truth. The maximum of two numbers exceeds their mean by half their
/// difference: for four samples of a rare event by less than the variance itself.
#[test]
fn predicted_variances_are_those_measured_over_many_seeds() {
    let seeds = 20_000;
    for (kind, [mean, variance]) in MOMENTS.into_iter().enumerate() {
        for count in [4, 16, 64] {
            let (mut predicted, mut squares) = (0.0, 0.0);
            for seed in 0..seeds {
                let (nine, around) = nine(kind, seed, 4);
                let mut samples = nine[0];
                samples.take((kind, seed, 0), 4, count);
                let estimate = samples.estimate(1.0);
                predicted += f64::from(estimate.variance_of_mean(SampleIntegrand::Random, &around).x)
                    / f64::from(seeds);
                squares += (samples.variance.mean().x - mean).powi(2) / f64::from(seeds);
            }
            let exact = variance / f64::from(count);
            println!("{kind} {count}: predicted {:.3}, measured {:.3}", predicted / exact, squares / exact);
            assert!((squares / exact - 1.0).abs() < 0.1, "the measure itself: {}", squares / exact);
            assert!((1.0..2.0).contains(&(predicted / exact)), "{kind} {count}: {}", predicted / exact);
        }
    }
}

/// Pixels of random light, as many of each kind, sampled as the effect does, to the level of 0.02: of those that end
/// below the limit, fewer than 1 % are off by more than three times the level, none by more than ten times. An error of
/// three standard errors has a probability of 0.0027 by the normal distribution; ending at the first low estimate adds
/// to that. Black of many samples does not end a pixel that has light in one of a hundred.
#[test]
fn pixels_of_random_light_end_when_they_are_accurate() {
    let (level, most, first) = (0.02, 1024, 4);
    let criterion = Criterion { max_error: level, min_samples: first };
    let shown = |c: DVec3| c.clamp(DVec3::ZERO, DVec3::ONE).powf(1.0 / 2.2);
    let seeds = 20_000;
    let (mut all, mut all_beyond) = (0, 0);
    for (kind, [mean, _]) in MOMENTS.into_iter().enumerate() {
        let (mut ended, mut beyond, mut far, mut taken) = (0, 0, 0, 0.0);
        for seed in 0..seeds {
            let ((mut nine, around), mut count) = (nine(kind, seed, first), first);
            loop {
                let others: Vec<_> = nine[1..].iter().map(|samples| samples.estimate(1.0)).collect();
                let (value, variance) = value_and_variance(others.iter(), SampleIntegrand::Random, &around);
                let variance = variance
                    + missed_variance(around.deviation, count)
                    + unseen_variance(value, 1.0, 8 * count, count);
                if is_displayed_within(level, (value, variance), others.iter(), shown) || count == most {
                    break;
                }
                let next = criterion.next_test(count, most);
                (0..)
                    .zip(&mut nine)
                    .for_each(|(pixel, samples)| samples.take((kind, seed, pixel), count, next));
                count = next;
            }
            taken += f64::from(count) / f64::from(seeds);
            if count < most {
                let off = (shown(nine[0].variance.mean()) - shown(DVec3::splat(mean))).abs().x;
                (ended, beyond, far) =
                    (ended + 1, beyond + u32::from(off > 3.0 * level), far + u32::from(off > 10.0 * level));
            }
        }
        println!("{kind}: {ended} ended, {beyond} beyond 3, {far} beyond 10; {taken:.1} samples");
        assert_eq!(far, 0, "{kind}");
        (all, all_beyond) = (all + ended, all_beyond + beyond);
    }
    assert!(all_beyond * 100 < all, "{all_beyond} of {all}");
}

#[test]
fn a_field_is_a_tile_and_what_is_around_it() {
    let tile = Window { x: 16, y: 0, width: 5, height: 3 };
    // No row above; a column on either side; a row below.
    let field = SampledRegion::new(tile, 1, [48, 48]);
    assert_eq!(field.whole, Window { x: 15, y: 0, width: 7, height: 4 });
    let own: Vec<usize> = field.tile_pixels().collect();
    assert_eq!(own, [1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 15, 16, 17, 18, 19]);
    assert_eq!((0..28).filter(|&pixel| field.is_own(pixel)).collect::<Vec<_>>(), own);
    assert_eq!(field.neighbourhood(8, 1).collect::<Vec<_>>(), [0, 1, 2, 7, 8, 9, 14, 15, 16]);
    assert_eq!(field.neighbourhood(0, 1).collect::<Vec<_>>(), [0, 1, 7, 8]);
    assert_eq!(field.neighbourhood(27, 1).collect::<Vec<_>>(), [19, 20, 26, 27]);
    // Of the block right of column 15 alone.
    assert_eq!(field.tested_by(8).collect::<Vec<_>>(), [1, 2, 9, 15, 16]);
    // Nothing beyond the picture.
    assert_eq!(SampledRegion::new(tile, 1, [21, 3]).whole, Window { x: 15, y: 0, width: 6, height: 3 });
    assert_eq!(SampledRegion::new(tile, 0, [48, 48]).whole, tile);
}

#[test]
fn pixels_are_looked_at_at_the_floor_and_at_growing_counts() {
    let looks = |floor: u32, most: u32| {
        let adaptive = Criterion { max_error: 0.1, min_samples: floor };
        let mut taken = 0;
        std::iter::from_fn(move || {
            taken = (taken < most).then(|| adaptive.next_test(taken, most))?;
            Some(taken)
        })
        .collect::<Vec<_>>()
    };
    assert_eq!(looks(16, 100), [16, 32, 48, 64, 96, 100]);
    assert_eq!(looks(1, 5), [1, 2, 4, 5]);
    assert_eq!(looks(4, 50), [4, 8, 16, 32, 48, 50]);
    assert_eq!(looks(6, 40), [6, 12, 24, 40]);
    assert_eq!(looks(5, 5), [5]);
    // No samples at least, or at most, count as one.
    let none = |samples| Sampling { noise: Some(0.1), min_samples: Some(0), samples, ..Sampling::default() };
    assert_eq!([None, Some(0)].map(|samples| Criterion::new(&none(samples)).min_samples), [1; 2]);
}

/// Black, and white below a slanted line, 16 by 16 pixels of unit size; with a shadowed, glazed ball where asked for.
fn scene(image: &str, with_ball: bool) -> Prepared {
    let ball = "[[sphere]]\ncentre = [2.0, -3.0, 2.0]\nradius = 2.5\nmaterial = \"white\"\n";
    let text = format!(
        "[image]\nwidth = 48\nheight = 48\ncolour = \"display\"\n{image}\n\
         [[camera]]\nposition = [0, 0, 10]\nlook_at = [0, 0, 0]\nprojection = \"orthographic\"\n\
         viewing_rectangle = [48, 48]\nviewpoint_distance = 1\n\
         [material.white]\ncolour = [255, 255, 255]\nglaze = {{ weight = 0.25 }}\n\
         [[light]]\ntype = \"point\"\nposition = [-5, 9, 9]\n\
         [[triangles]]\nmaterial = \"white\"\nvertices = [[-100, -29.7, 0], [100, 31.3, 0], [0, -300, 0]]\n{}",
        if with_ball { ball } else { "" }
    );
    prepare(parse(&text), [48, 48], Numerics::Watertight)
}

fn picture(prepared: &Prepared, window: Window, threads: usize) -> (Film, Statistics) {
    let plan = Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
    let control = RenderControl { time_stages: true, ..RenderControl::default() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| render(&prepared.world, &prepared.view, &plan, window, |_, _| true, &control))
        .expect("a picture")
}

const WHOLE: Window = Window { x: 0, y: 0, width: 48, height: 48 };

#[test]
fn an_edge_is_where_it_should_be() {
    // The line y = 0.8 + 0.305 x; pixel (i, j) from the top has its centre at (i - 23.5, 23.5 - j).
    let prepared = scene("samples = 256\nfilter = \"box\"", false);
    let plan_settings = PlanSettings { shading: ShadingMode::Flat, ..PlanSettings::default() };
    let (film, statistics) = prepared.render(plan_settings);
    assert_eq!(statistics.rays(RayKind::PRIMARY).cast, 48 * 48 * 256);
    let (mut squares, mut crossed) = (0.0, 0);
    for j in 0..48 {
        for i in 0..48 {
            let (x, y) = (f64::from(i) - 23.5, 23.5 - f64::from(j));
            let exact = area(-0.305, 1.0, 0.8 + 0.305 * x - y);
            let off = f64::from(film.pixel(i, j)[0]) - exact;
            let is_crossed = exact > 0.0 && exact < 1.0;
            assert!(is_crossed || off.abs() < 1e-12, "({i}, {j}): {off}");
            squares += off * off;
            crossed += u32::from(is_crossed);
        }
    }
    // 256 samples at random are off by up to 1/32; those of this sequence by an eighth of that (256^-0.25 and less).
    assert!(crossed > 48 && (squares / f64::from(crossed)).sqrt() < 0.25 / 32.0, "{crossed} {squares}");
}

#[test]
fn crops_and_threads_change_no_bit() {
    for image in [
        "samples = 7\nfilter = \"mitchell\"",
        "samples = 5\nfilter = \"gaussian\"\nfilter_radius = 3.3",
        "samples = 70\nnoise = 0.01\nfilter = \"tent\"\nmin_samples = 6",
        "noise = 0.02\nfilter = \"mitchell\"\nseed = 9",
    ] {
        let prepared = scene(image, true);
        let (film, statistics) = picture(&prepared, WHOLE, 1);
        let (other, same) = picture(&prepared, WHOLE, 3);
        assert_eq!(film, other, "{image}");
        assert_eq!(statistics.rays(RayKind::PRIMARY), same.rays(RayKind::PRIMARY));
        // Tiles of the crop lie across those of the whole.
        let crop = Window { x: 5, y: 11, width: 33, height: 21 };
        let (part, _) = picture(&prepared, crop, 2);
        for y in 0..crop.height {
            for x in 0..crop.width {
                assert_eq!(part.pixel(x, y), film.pixel(crop.x + x, crop.y + y), "{image}: ({x}, {y})");
            }
        }
    }
}

#[test]
fn single_pixels_have_the_picture_s_bits() {
    // A crop of one pixel is a tile of its own: all its neighbours are beyond it. Along the edge, at the borders and
    // corners of tiles and of the picture.
    let prepared = scene("noise = 0.01", true);
    let (film, _) = picture(&prepared, WHOLE, 1);
    for (x, y) in (0..48).map(|x| (x, (23 - (x * 3 / 10 - 7)) as u32)).chain([
        (0, 0),
        (47, 47),
        (0, 47),
        (15, 16),
        (16, 15),
    ]) {
        let x = x as u32;
        let (one, _) = picture(&prepared, Window { x, y, width: 1, height: 1 }, 1);
        assert_eq!(one.pixel(0, 0), film.pixel(x, y), "({x}, {y})");
    }
}

/// The number of samples of each pixel of a window within a tile.
fn counts(plan: &Plan, context: &RenderContext, window: Window) -> Vec<u32> {
    let statistics = plan.sample_statistics(&mut Tile::default(), context, window, |_| (), |_, ()| {});
    statistics.iter().map(|pixel| pixel.count).collect()
}

#[test]
fn samples_around_a_tile_are_counted_but_are_no_samples_of_its_pixels() {
    let prepared = scene("noise = 0.01\nmin_samples = 4", true);
    let plan = Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
    let context = RenderContext {
        world: &prepared.world,
        view: &prepared.view,
        display: Default::default(),
        is_displayed: false,
    };
    // Black all around: four samples a pixel, of nine pixels, and in the picture's corner of four.
    for (x, y, cast) in [(3, 3, 36), (0, 0, 16)] {
        let window = Window { x, y, width: 1, height: 1 };
        let (_, statistics) = picture(&prepared, window, 1);
        assert_eq!(statistics.rays(RayKind::PRIMARY).cast, cast);
        assert_eq!(counts(&plan, &context, window), [4]);
    }
    // A whole tile in the middle of the picture: 18 squared less 16 squared pixels around it.
    let window = Window { x: 16, y: 16, width: 16, height: 16 };
    let taken = counts(&plan, &context, window);
    assert!(taken.len() == 256 && taken.iter().any(|&n| n > 4));
    let (_, statistics) = picture(&prepared, window, 1);
    let own: u64 = taken.iter().map(|&n| u64::from(n)).sum();
    // Beside those, samples beside pixels that are tested further.
    let (cast, least) = (statistics.rays(RayKind::PRIMARY).cast, own + 4 * (18 * 18 - 16 * 16));
    assert!(cast >= least && cast < 2 * least, "{cast}, at least {least}");
}

#[test]
fn a_floor_as_high_as_the_ceiling_is_uniform() {
    let (uniform, _) = picture(&scene("samples = 33", true), WHOLE, 1);
    // Through the registry adaptive effort is then off; so once more with it on, at a level that nothing reaches.
    for image in
        ["samples = 33\nnoise = 0.5\nmin_samples = 33", "samples = 33\nnoise = 0.000001\nmin_samples = 1"]
    {
        let prepared = scene(image, true);
        let (film, _) = picture(&prepared, WHOLE, 1);
        let equal =
            (0..48 * 48).filter(|i| film.pixel(i % 48, i / 48) == uniform.pixel(i % 48, i / 48)).count();
        match prepared.sampling.min_samples {
            Some(33) => assert_eq!(film, uniform),
            // One sample is no ground to stop on, and with equal ones after it there is nothing to gain: those differ
            // by less than what one sample in 33 can be seen to be.
            _ => assert!(equal > 48 * 48 * 3 / 4, "{equal}"),
        }
    }
}

#[test]
fn effort_goes_where_it_is_needed() {
    let uniform = "samples = 256\nfilter = \"box\"";
    let (reference, _) = picture(&scene("samples = 4096\nfilter = \"box\"\nseed = 1", true), WHOLE, 3);
    let error = |film: &Film| {
        let off =
            reference.rows().zip(film.rows()).map(|(a, b)| f64::from(a[0].min(1.0) - b[0].min(1.0)).powi(2));
        (off.sum::<f64>() / f64::from(48 * 48)).sqrt()
    };
    let (_, all) = picture(&scene(uniform, true), WHOLE, 3);
    let prepared = scene("samples = 256\nnoise = 0.004\nfilter = \"box\"", true);
    let (film, some) = picture(&prepared, WHOLE, 3);
    let (cast, most) = (some.rays(RayKind::PRIMARY).cast, all.rays(RayKind::PRIMARY).cast);
    assert!(cast >= 48 * 48 * 4 && cast < most / 4, "{cast} of {most}");
    // The level is the standard error of one pixel: all of them together are not farther off.
    assert!(error(&film) < 0.004, "{}", error(&film));
}

#[test]
fn one_sample_and_no_filter_is_the_pixels_centre() {
    let (plain, statistics) = picture(&scene("", true), WHOLE, 1);
    let (one, same) = picture(&scene("samples = 1", true), WHOLE, 1);
    assert_eq!(plain, one);
    let names = |s: &Statistics| s.stages.iter().map(|stage| stage.name).collect::<Vec<_>>();
    assert_eq!(names(&statistics), names(&same));
    assert!(!names(&one_with_filter()).is_empty() && names(&one_with_filter()) != names(&same));
}

fn one_with_filter() -> Statistics {
    picture(&scene("samples = 1\nfilter = \"box\"", true), WHOLE, 1).1
}

#[test]
fn nothing_is_kept_where_nothing_is_asked_for() {
    assert!(!Sampling::default().is_wanted());
    assert!(!Sampling { samples: Some(1), seed: 3, min_samples: Some(4), ..Default::default() }.is_wanted());
    assert!(Sampling { samples: Some(2), ..Default::default() }.is_wanted());
}

#[test]
fn eight_bit_samples_are_averaged_and_rounded_once_more() {
    // Every value of the film is a 256th, also of pixels that an edge crosses.
    let mut text = scene("samples = 9", true);
    text.world.pipeline = ColourPipeline::U8;
    let (film, _) = picture(&text, WHOLE, 1);
    for pixel in film.rows() {
        for channel in pixel.map(|c| f64::from(c) * 255.0) {
            assert!((channel - channel.round()).abs() < 1e-4, "{channel}");
        }
    }
}
