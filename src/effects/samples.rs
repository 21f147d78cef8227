//! The samples of a tile's pixels: where they lie, in which order they are taken, and what becomes of them.
//!
//! The stages are run as often as it takes, each time with as many rays as a tile has pixels: one through each pixel while all are
//! sampled, several through each where few are left ([`super::effort`]). A pixel's samples and their order depend on nothing but
//! the pixel. Where pixels are judged by their neighbours, too, those around a tile are sampled with it ([`Field`]) as often as
//! that takes, and thrown away: a crop or another tiling then has the same pixels.

use glam::DVec3;

use super::Asked;
use super::effort::Adaptive;
use super::random::{Point, Purpose, Scramble};
use super::tile::{Tile, vec_bytes};
use crate::film::{ColourPipeline, Filter, Window};
use crate::world::{LANES, widely};

/// How the pixels of a picture are sampled.
#[derive(Debug, Clone)]
pub struct Sampler {
    /// Samples a pixel; the most of them where effort is adaptive.
    pub samples: u32,
    /// The first of them that is taken.
    pub first: u32,
    /// What a pixel is seen through.
    pub filter: Filter,
    /// What the random numbers depend on besides pixel, sample and dimension.
    pub seed: u32,
    /// Samples that every pixel takes before it can be done.
    pub floor: u32,
    /// How many pixels around a tile take those, too, because pixels in it are judged by their neighbours.
    pub apron: u32,
    /// Whether all go through the pixel's centre, because nothing else is asked for.
    pub centred: bool,
}

impl Sampler {
    /// What the scene's settings say.
    pub fn new(asked: &Asked) -> Self {
        let sampling = asked.sampling;
        let (shape, radius) = sampling.shape_and_radius();
        let centred = !sampling.is_wanted();
        let samples = if centred { 1 } else { sampling.most_samples() };
        let is_adaptive = asked.outline.adaptive;
        let floor = if is_adaptive { Adaptive::new(sampling).floor.min(samples) } else { samples };
        Sampler {
            samples,
            first: sampling.first.unwrap_or(0),
            filter: Filter::new(shape, radius),
            seed: sampling.seed.unwrap_or(0),
            floor,
            // Nobody is judged where no level is given, or before all samples are taken.
            apron: u32::from(is_adaptive && sampling.noise.is_some() && floor < samples),
            centred,
        }
    }
}

/// What a tile keeps of its samples.
#[derive(Default)]
pub struct Samples {
    /// The tile's pixels and those around it that are sampled for their sake.
    field: Field,
    /// The sum of each pixel's samples.
    sums: Vec<Sum>,
    /// The pixels that are still sampled, in ascending order.
    live: Vec<u16>,
    /// Which samples they take next, from and up to.
    round: (u32, u32),
    /// How many samples of the round have been cast, those of all pixels.
    cast: usize,
    pass: Box<Pass>,
}

/// A tile and its apron: the pixels around it, within the picture, that its own pixels are judged by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// All of them. Pixels are counted row by row from the top.
    pub whole: Window,
    /// The tile's own.
    pub tile: Window,
}

impl Default for Field {
    fn default() -> Self {
        let nothing = Window { x: 0, y: 0, width: 0, height: 0 };
        Field { whole: nothing, tile: nothing }
    }
}

impl Field {
    /// A tile with so many pixels around it as there are in a picture of this width and height, `apron` at most.
    pub fn new(tile: Window, apron: u32, [width, height]: [u32; 2]) -> Self {
        let (x, y) = (tile.x.saturating_sub(apron), tile.y.saturating_sub(apron));
        let right = tile.x.saturating_add(tile.width).saturating_add(apron).min(width);
        let bottom = tile.y.saturating_add(tile.height).saturating_add(apron).min(height);
        Field { whole: Window { x, y, width: right - x, height: bottom - y }, tile }
    }

    /// Whether a pixel is one of the tile's own.
    #[inline(always)]
    pub fn is_own(&self, pixel: usize) -> bool {
        let Field { whole, tile } = self;
        let (x, y) = (whole.x + pixel as u32 % whole.width, whole.y + pixel as u32 / whole.width);
        // What lies before it wraps to more than any width.
        x.wrapping_sub(tile.x) < tile.width && y.wrapping_sub(tile.y) < tile.height
    }

    /// A pixel and the up to eight around it, row by row from the top.
    #[inline(always)]
    pub fn near(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        let Window { width, height, .. } = self.whole;
        let (x, y) = (pixel as u32 % width, pixel as u32 / width);
        let (left, right) = (x.saturating_sub(1), (x + 2).min(width));
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |row| (row * width + left) as usize..(row * width + right) as usize)
    }

    /// The tile's own pixels, row by row from the top.
    pub fn own(&self) -> impl Iterator<Item = usize> + use<> {
        let Field { whole, tile } = *self;
        (tile.y - whole.y..tile.y - whole.y + tile.height).flat_map(move |row| {
            let start = (row * whole.width + tile.x - whole.x) as usize;
            start..start + tile.width as usize
        })
    }
}

/// The rays of a pass.
struct Pass {
    len: usize,
    /// For each ray, its pixel.
    pixels: [u16; LANES],
    /// For each ray, its point of the sequence.
    points: [Point; LANES],
    /// Where they go through the picture, in pixels from its top left corner.
    x: [f64; LANES],
    y: [f64; LANES],
    /// The signs that they count with.
    signs: [f64; LANES],
}

impl Default for Pass {
    fn default() -> Self {
        Pass {
            len: 0,
            pixels: [0; LANES],
            points: [Point::default(); LANES],
            x: [0.0; LANES],
            y: [0.0; LANES],
            signs: [1.0; LANES],
        }
    }
}

impl Pass {
    /// Finds where the rays go.
    #[inline(always)]
    fn place(&mut self, window: Window, sampler: &Sampler) {
        for i in 0..self.len.min(LANES) {
            let pixel = u32::from(self.pixels[i]);
            let (x, y) = (window.x + pixel % window.width, window.y + pixel / window.width);
            let numbers = Scramble::new(x, y, sampler.seed, Purpose::Pixel).of(self.points[i]);
            let ([right, down], sign) =
                if sampler.centred { ([0.0; 2], 1.0) } else { sampler.filter.place(numbers) };
            self.x[i] = f64::from(x) + 0.5 + right;
            self.y[i] = f64::from(y) + 0.5 + down;
            self.signs[i] = sign;
        }
    }
}

impl Samples {
    /// Begins with a tile.
    pub fn start(&mut self, field: Field, sampler: &Sampler) {
        let pixels = field.whole.area();
        self.field = field;
        self.sums.clear();
        self.sums.resize(pixels, Sum::default());
        self.live.clear();
        self.live.extend(0..pixels as u16);
        self.round = (sampler.first, sampler.floor);
        self.cast = 0;
    }

    /// Lists the rays of the next pass: sample by sample, within a sample pixel by pixel.
    pub fn list(&mut self, sampler: &Sampler) {
        let (from, to) = self.round;
        let all = self.live.len() * (to - from) as usize;
        let Samples { live, pass, field, .. } = self;
        pass.len = LANES.min(all - self.cast);
        let mut pixel = self.cast % live.len();
        let mut sample = from + (self.cast / live.len()) as u32;
        let mut point = Point::new(sample, Purpose::Pixel);
        for i in 0..pass.len {
            (pass.pixels[i], pass.points[i]) = (live[pixel], point);
            pixel += 1;
            if pixel == live.len() && i + 1 < pass.len {
                (pixel, sample) = (0, sample + 1);
                point = Point::new(sample, Purpose::Pixel);
            }
        }
        self.cast += pass.len;
        widely(
            #[inline(always)]
            || pass.place(field.whole, sampler),
        );
    }

    /// Where the rays of the pass go through the picture: right of and below its top left corner, in pixels.
    pub fn places(&self) -> (&[f64], &[f64]) {
        let Pass { len, x, y, .. } = &*self.pass;
        (&x[..*len], &y[..*len])
    }

    /// Takes in what the rays of the pass saw.
    pub fn take(&mut self, colours: &[[f32; 3]]) {
        let Samples { pass, sums, .. } = self;
        for ((&pixel, &sign), &colour) in pass.pixels[..pass.len].iter().zip(&pass.signs).zip(colours) {
            sums[usize::from(pixel)].add(colour, sign);
        }
    }

    /// For each ray of the pass its pixel, its sign and, of `colours`, what it saw.
    pub fn seen<'a>(&'a self, colours: &'a [[f32; 3]]) -> impl Iterator<Item = (usize, f64, &'a [f32; 3])> {
        let Pass { len, pixels, signs, .. } = &*self.pass;
        let rays = pixels[..*len].iter().zip(signs).zip(colours);
        rays.map(|((&pixel, &sign), colour)| (usize::from(pixel), sign, colour))
    }

    /// The pixels that are sampled.
    pub fn field(&self) -> Field {
        self.field
    }

    /// What each pixel's samples add up to.
    pub fn sums(&self) -> &[Sum] {
        &self.sums
    }

    /// Whether the pass is the first of its tile.
    pub fn is_first_pass(&self) -> bool {
        self.round.0 == 0 && self.cast == self.pass.len
    }

    /// Whether the round's last pass is through.
    pub fn is_round_done(&self) -> bool {
        self.cast == self.live.len() * (self.round.1 - self.round.0) as usize
    }

    /// How many samples the pixels have that are still sampled, at the end of the round.
    pub fn round_end(&self) -> u32 {
        self.round.1
    }

    /// Begins another round, up to `end` samples, of those of the tile's own pixels that `goes_on` says so of.
    pub fn go_on_where(&mut self, end: u32, goes_on: impl Fn(usize, &Sum) -> bool) {
        let Samples { live, sums, field, .. } = self;
        live.retain(|&pixel| {
            let pixel = usize::from(pixel);
            field.is_own(pixel) && goes_on(pixel, &sums[pixel])
        });
        self.round = (self.round.1, end);
        self.cast = 0;
    }

    /// Whether no pixel is sampled any further.
    pub fn is_over(&self) -> bool {
        self.live.is_empty()
    }

    /// Gives the pixels of the tile their values.
    pub fn finish(&self, tile: &mut Tile, sampler: &Sampler, pipeline: ColourPipeline) {
        let value = |sum: &Sum| match pipeline {
            // What a film of 8 bits cannot hold is rounded.
            ColourPipeline::U8 => pipeline.hold(sum.value(&sampler.filter)),
            _ => sum.value(&sampler.filter),
        };
        tile.again = false;
        tile.pixels.clear();
        tile.pixels.extend(self.field.own().map(|pixel| value(&self.sums[pixel]).as_vec3().to_array()));
        tile.taken.clear();
        tile.taken.extend(self.field.own().map(|pixel| self.sums[pixel].taken));
    }

    /// Bytes of memory that it holds.
    pub fn bytes(&self) -> usize {
        let Samples { sums, live, pass, .. } = self;
        size_of::<Samples>() + vec_bytes(sums) + vec_bytes(live) + size_of_val(&**pass)
    }
}

/// The samples of a pixel, added up. In f64, where so many numbers of f32 as a pixel can have add up with no rounding that f32
/// shows; those that are equal, with none at all.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sum {
    taken: u32,
    /// Those that count with a negative sign.
    negative: u32,
    colours: DVec3,
    of_negative: DVec3,
}

impl Sum {
    /// Takes in a sample that counts with a sign.
    #[inline(always)]
    pub fn add(&mut self, colour: [f32; 3], sign: f64) {
        let colour = DVec3::from(colour.map(f64::from));
        self.taken += 1;
        self.colours += colour;
        if sign < 0.0 {
            self.negative += 1;
            self.of_negative += colour;
        }
    }

    /// The plain mean of the samples.
    pub fn mean(&self) -> DVec3 {
        self.colours / f64::from(self.taken)
    }

    /// The pixel's value through `filter`.
    ///
    /// With signs, the mean of `sign * (colour - mean)` over the signs' expected mean is added to the plain mean: no division by a
    /// sum of signs that may vanish, and where all samples are equal exactly their colour.
    pub fn value(&self, filter: &Filter) -> DVec3 {
        let mean = self.mean();
        if !filter.is_signed() {
            return mean;
        }
        let (signed, signs) =
            (self.colours - 2.0 * self.of_negative, f64::from(self.taken) - 2.0 * f64::from(self.negative));
        mean + (signed - mean * signs) / (f64::from(self.taken) * filter.mean_sign())
    }
}
