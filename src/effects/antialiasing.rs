//! Antialiasing: a pixel is the filtered mean of several samples instead of what its centre sees.
//!
//! The stages between [`Scatter`] and [`Gather`] are run as often as it takes, each time with as many rays as a tile has
//! pixels: one through each pixel while all are sampled, several through each where few are left ([`super::effort`]). A
//! pixel's samples and their order depend on nothing but the pixel.

use glam::DVec3;

use super::effort::{Adaptive, Groups, displayed_error};
use super::random::{Point, Purpose, Scramble};
use super::tile::{Context, Tile, vec_bytes};
use super::{Asked, Effect, Hook, Stage};
use crate::film::{ColourPipeline, Filter, Window};
use crate::world::{LANES, World, widely};

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "antialiasing",
    summary: "a pixel is the filtered mean of several samples, not what its centre sees",
    needs_lights: false,
    rays: &[],
    value: None,
    called_for: |world: &World| {
        let sampling = &world.sampling;
        if !sampling.is_wanted() {
            return Err("one sample a pixel, through its centre; --samples asks for more".into());
        }
        let filter = sampling.shape_and_radius();
        let (samples, name, radius) = (sampling.most_samples(), filter.0.name(), filter.1);
        Ok(format!("{samples} sample(s) a pixel, {name} filter of radius {radius}"))
    },
    outline: |_, outline| outline.own_rays = true,
    stages: |asked: &Asked, hook| match hook {
        Hook::Rays => vec![Box::new(Scatter(Sampler::new(asked)))],
        Hook::Film => vec![Box::new(Gather(Sampler::new(asked)))],
        _ => Vec::new(),
    },
    bytes: |tile| tile.kept::<Samples>().map_or(0, Samples::bytes),
};

/// How the pixels of a picture are sampled.
#[derive(Debug, Clone)]
pub struct Sampler {
    /// Samples a pixel; the most of them where effort is adaptive.
    pub samples: u32,
    /// What a pixel is seen through.
    pub filter: Filter,
    /// What the random numbers depend on besides pixel, sample and dimension.
    pub seed: u32,
    /// When a pixel is done before that.
    pub adaptive: Option<Adaptive>,
}

impl Sampler {
    fn new(asked: &Asked) -> Self {
        let sampling = &asked.world.sampling;
        let (shape, radius) = sampling.shape_and_radius();
        Sampler {
            samples: sampling.most_samples(),
            filter: Filter::new(shape, radius),
            seed: sampling.seed.unwrap_or(0),
            adaptive: asked.outline.adaptive.then(|| Adaptive::new(sampling)),
        }
    }
}

/// What a tile keeps of its samples.
#[derive(Default)]
pub struct Samples {
    /// The sum of each pixel's samples.
    sums: Vec<Sum>,
    /// The same in groups, where effort is adaptive.
    groups: Vec<Groups>,
    /// The pixels that are still sampled, in ascending order.
    live: Vec<u16>,
    /// Which samples they take next, from and up to.
    round: (u32, u32),
    /// How many samples of the round have been cast, those of all pixels.
    cast: usize,
    pass: Box<Pass>,
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
            let ([right, down], sign) = sampler.filter.place(numbers);
            self.x[i] = f64::from(x) + 0.5 + right;
            self.y[i] = f64::from(y) + 0.5 + down;
            self.signs[i] = sign;
        }
    }
}

impl Samples {
    fn start(&mut self, window: Window, sampler: &Sampler) {
        let pixels = window.area();
        self.sums.clear();
        self.sums.resize(pixels, Sum::default());
        self.groups.clear();
        self.live.clear();
        self.live.extend(0..pixels as u16);
        let end = match &sampler.adaptive {
            Some(adaptive) => {
                self.groups.resize(pixels, Groups::default());
                adaptive.next_look(0, sampler.samples)
            }
            None => sampler.samples,
        };
        self.round = (0, end);
        self.cast = 0;
    }

    /// Lists the rays of the next pass: sample by sample, within a sample pixel by pixel.
    fn list(&mut self, window: Window, sampler: &Sampler) {
        let (from, to) = self.round;
        let all = self.live.len() * (to - from) as usize;
        let Samples { live, pass, .. } = self;
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
            || pass.place(window, sampler),
        );
    }

    /// Takes in what the rays of the pass saw.
    fn take(&mut self, colours: &[[f32; 3]]) {
        let Pass { len, pixels, signs, .. } = &*self.pass;
        for ((&pixel, &sign), &colour) in pixels[..*len].iter().zip(signs).zip(colours) {
            self.sums[pixel as usize].add(colour, sign);
            if let Some(groups) = self.groups.get_mut(pixel as usize) {
                groups.add(colour, sign as f32);
            }
        }
    }

    /// Whether there is more to cast, after a pass: in the round, or in a next one of the pixels that are not done.
    fn goes_on(&mut self, sampler: &Sampler, pipeline: ColourPipeline) -> bool {
        let (from, to) = self.round;
        if self.cast < self.live.len() * (to - from) as usize {
            return true;
        }
        let Some(adaptive) = sampler.adaptive.filter(|_| to < sampler.samples) else { return false };
        let mean_sign = sampler.filter.mean_sign();
        let Samples { sums, groups, live, .. } = self;
        live.retain(|&pixel| {
            let sum = &sums[pixel as usize];
            let error = groups[pixel as usize].standard_error(sum.mean(), mean_sign);
            displayed_error(sum.value(&sampler.filter), error, pipeline) > adaptive.level
        });
        self.round = (to, adaptive.next_look(to, sampler.samples));
        self.cast = 0;
        !self.live.is_empty()
    }

    /// How many samples each pixel of the tile has taken, row by row from the top.
    pub fn taken(&self) -> impl Iterator<Item = u32> + '_ {
        self.sums.iter().map(|sum| sum.taken)
    }

    fn bytes(&self) -> usize {
        let Samples { sums, groups, live, pass, .. } = self;
        size_of::<Samples>() + vec_bytes(sums) + vec_bytes(groups) + vec_bytes(live) + size_of_val(&**pass)
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

/// Fills level 0 with the rays of the next pass of samples.
pub struct Scatter(Sampler);

impl Stage for Scatter {
    fn name(&self) -> &'static str {
        "primary"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let Some(window) = tile.window else { return };
        tile.with(|samples: &mut Samples, tile| {
            if !tile.again {
                samples.start(window, &self.0);
            }
            samples.list(window, &self.0);
            let Pass { len, x, y, .. } = &*samples.pass;
            let precision = context.world.numerics().precision();
            let level = tile.level();
            context.view.rays_through(&x[..*len], &y[..*len], precision, &mut level.lanes);
            level.lanes.weave(*len, &mut level.rays);
            level.sources.clear();
            level.sources.extend(0..*len as u32);
            tile.pixels.clear();
        });
    }
}

/// Adds what the pass saw to the pixels, and gives them their values after the last.
pub struct Gather(Sampler);

impl Stage for Gather {
    fn name(&self) -> &'static str {
        "samples"
    }

    fn run(&self, tile: &mut Tile, context: &Context) {
        let pipeline = context.world.pipeline;
        tile.with(|samples: &mut Samples, tile| {
            samples.take(&tile.pixels);
            tile.again = samples.goes_on(&self.0, pipeline);
            if tile.again {
                return;
            }
            let value = |sum: &Sum| match pipeline {
                // What a film of 8 bits cannot hold is rounded.
                ColourPipeline::U8 => pipeline.hold(sum.value(&self.0.filter)),
                _ => sum.value(&self.0.filter),
            };
            tile.pixels.clear();
            tile.pixels.extend(samples.sums.iter().map(|sum| value(sum).as_vec3().to_array()));
        });
    }
}
