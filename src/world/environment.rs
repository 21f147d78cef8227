//! The environment of a world: radiance by direction.

use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::{DVec3, DVec4, Vec4};

use super::bilinear_distribution::{BilinearDistribution, Cell};
use super::sky;
use super::turns::sin_cos_of_turns;
use crate::film::ColourPipeline;
use crate::film::colour::srgb_encode;
use crate::scene::{Environment, EnvironmentSource};

/// The environment of a world.
pub(crate) struct PreparedEnvironment {
    /// Whether camera rays do not see it.
    pub(crate) is_hidden: bool,
    /// Whether it is the sky, of whose light white surfaces are white.
    pub(crate) is_sky: bool,
    radiance: Radiance,
    /// [`PreparedEnvironment::diffuse_from_above`], once it is known.
    from_above: OnceLock<DVec3>,
}

/// Radiance by direction, in the values of the colour pipeline.
enum Radiance {
    /// The same from every direction.
    Uniform(DVec3),
    Image(Box<RadianceImage>),
}

/// An equirectangular image, and its sampling.
struct RadianceImage {
    width: usize,
    height: usize,
    /// RGB and, where the grid of the distribution is that of the image, the density's weight, row by row from the top.
    texels: Vec<[f32; 4]>,
    /// Cosine and sine of the rotation about +y.
    rotation: (f64, f64),
    distribution: BilinearDistribution,
    /// Whether texels have the density's weights.
    has_weights: bool,
}

/// The density per solid angle of directions sampled uniformly on the sphere.
pub(crate) const UNIFORM_DENSITY: f64 = 1.0 / (4.0 * PI);

/// A direction of that density.
#[inline(always)]
pub(crate) fn uniform_direction(numbers: [f64; 2]) -> DVec3 {
    let y = 1.0 - 2.0 * numbers[1];
    let sine = (1.0 - y * y).max(0.0).sqrt();
    let (sin, cos) = sin_cos_of_turns(numbers[0]);
    DVec3::new(sine * cos, y, sine * sin)
}

/// A sampled direction.
pub(crate) struct EnvironmentSample {
    /// The unit vector towards the environment.
    pub(crate) direction: DVec3,
    /// The radiance from there.
    pub(crate) radiance: DVec3,
    /// The density per solid angle.
    pub(crate) pdf: f64,
}

impl PreparedEnvironment {
    /// Prepares an environment for a colour pipeline: in `linear` the radiance as it is, otherwise display values, up to 1.
    pub(super) fn new(environment: &Environment, pipeline: ColourPipeline) -> Self {
        let Environment { source, rotation, intensity, is_hidden } = environment;
        let (width, height, mut texels) = match source {
            EnvironmentSource::Image(image) => {
                (image.width as usize, image.height as usize, image.pixels.clone())
            }
            EnvironmentSource::Sky => sky::image(),
            EnvironmentSource::Colour(colour) => {
                (1, 1, vec![colour.to_pipeline(ColourPipeline::Linear).as_vec3().to_array()])
            }
        };
        for value in texels.as_flattened_mut() {
            let radiance = f64::from(*value) * intensity;
            *value = match pipeline {
                ColourPipeline::Linear => radiance.min(f64::from(f32::MAX)) as f32,
                _ => srgb_encode(radiance).clamp(0.0, 1.0) as f32,
            };
        }
        let radiance = match texels[..] {
            [texel] => Radiance::Uniform(texel.map(f64::from).into()),
            _ => {
                let distribution = BilinearDistribution::new(width, height, &texels);
                let weights = distribution.weights_of(width, height);
                let has_weights = weights.is_some();
                let weights = weights.unwrap_or_default();
                let weights = weights.iter().copied().chain(std::iter::repeat(0.0));
                let texels =
                    texels.iter().zip(weights).map(|(&[r, g, b], weight)| [r, g, b, weight]).collect();
                let (sin, cos) = libm::sincos(*rotation);
                let rotation = (cos, sin);
                let image = RadianceImage { width, height, texels, rotation, distribution, has_weights };
                Radiance::Image(Box::new(image))
            }
        };
        let is_sky = matches!(source, EnvironmentSource::Sky);
        PreparedEnvironment { is_hidden: *is_hidden, is_sky, radiance, from_above: OnceLock::new() }
    }

    /// The radiance from a unit direction.
    pub(crate) fn eval(&self, direction: DVec3) -> DVec3 {
        match &self.radiance {
            Radiance::Uniform(radiance) => *radiance,
            Radiance::Image(image) => image.at(image.image_place(direction)).0.truncate(),
        }
    }

    /// The radiance, if it is the same from every direction and above 0: directions are sampled by [`uniform_direction`].
    pub(crate) fn uniform_radiance(&self) -> Option<DVec3> {
        match &self.radiance {
            Radiance::Uniform(radiance) => Some(*radiance).filter(|&radiance| radiance != DVec3::ZERO),
            Radiance::Image(_) => None,
        }
    }

    /// The irradiance of a surface that faces up, over pi: what it reflects if it is white and diffuse. Summed over the
    /// texels at the first call.
    pub(crate) fn diffuse_from_above(&self) -> DVec3 {
        *self.from_above.get_or_init(|| match &self.radiance {
            Radiance::Uniform(radiance) => *radiance,
            Radiance::Image(image) => image.diffuse_from_above(),
        })
    }

    /// Samples a direction; the density is 0 where the environment is black. `numbers` are in [0, 1).
    pub(crate) fn sample(&self, numbers: [f64; 2]) -> EnvironmentSample {
        match &self.radiance {
            Radiance::Uniform(_) => {
                let direction = uniform_direction(numbers);
                let (radiance, pdf) = self.eval_pdf(direction, [0.0; 2]);
                EnvironmentSample { direction, radiance, pdf }
            }
            Radiance::Image(image) => image.sample(&image.distribution.cell(numbers)),
        }
    }

    /// Samples a direction for each pair of numbers, and calls `found` with its index and the sample: searches first, then
    /// what depends on their results, so that reads of memory overlap.
    pub(crate) fn sample_each(
        &self,
        numbers: impl Iterator<Item = [f64; 2]>,
        cells: &mut Vec<Cell>,
        mut found: impl FnMut(usize, EnvironmentSample),
    ) {
        let Radiance::Image(image) = &self.radiance else {
            return numbers.enumerate().for_each(|(index, numbers)| found(index, self.sample(numbers)));
        };
        cells.clear();
        cells.extend(numbers.map(|numbers| image.distribution.cell(numbers)));
        cells.iter().enumerate().for_each(|(index, cell)| found(index, image.sample(cell)));
    }

    /// The place of a unit direction in the image; anything without one.
    pub(crate) fn map_position(&self, direction: DVec3) -> [f64; 2] {
        match &self.radiance {
            Radiance::Uniform(_) => [0.0; 2],
            Radiance::Image(image) => image.image_place(direction),
        }
    }

    /// The radiance from a unit direction, and the density per solid angle with which [`PreparedEnvironment::sample`]
    /// chooses it. `place` is its [`PreparedEnvironment::place`].
    #[inline]
    pub(crate) fn eval_pdf(&self, direction: DVec3, place: [f64; 2]) -> (DVec3, f64) {
        match &self.radiance {
            Radiance::Uniform(DVec3::ZERO) => (DVec3::ZERO, 0.0),
            Radiance::Uniform(radiance) => (*radiance, UNIFORM_DENSITY),
            Radiance::Image(image) => image.eval_pdf(place, direction.y),
        }
    }
}

impl RadianceImage {
    /// The texel at a place of the image, interpolated between the four nearest ones, and the row of cells that it is
    /// in: 0 above the centres of the first row.
    #[inline]
    fn at(&self, [u, v]: [f64; 2]) -> (DVec4, usize) {
        let (x, y) = (u * self.width as f64 - 0.5, v * self.height as f64 - 0.5);
        // Columns wrap around, `left` and `top` are from -1 on; rows end at the poles. `f64::floor` would be a call.
        let floor = |x: f64| x as i64 - i64::from(x < 0.0);
        let (left, top) = (floor(x), floor(y));
        let (right_weight, bottom_weight) = (x - left as f64, y - top as f64);
        let row = ((top + 1) as usize).min(self.height);
        let left = if left < 0 { self.width - 1 } else { (left as usize).min(self.width - 1) };
        let right = if left + 1 == self.width { 0 } else { left + 1 };
        let texels = |row: usize| {
            let row = &self.texels[row * self.width..][..self.width];
            let [a, b] = [Vec4::from(row[left]).as_dvec4(), Vec4::from(row[right]).as_dvec4()];
            a.lerp(b, right_weight)
        };
        (texels(row.saturating_sub(1)).lerp(texels(row.min(self.height - 1)), bottom_weight), row)
    }

    /// See [`PreparedEnvironment::eval_pdf`]: of the direction of a place, whose height is `y`.
    fn eval_pdf(&self, place: [f64; 2], y: f64) -> (DVec3, f64) {
        let (texel, row) = self.at(place);
        let density = match self.has_weights {
            true => texel.w * self.distribution.factor(row),
            false => self.distribution.density(place),
        };
        let pdf = density / (2.0 * PI * PI * (1.0 - y * y).max(0.0).sqrt());
        // At the poles a cell has no solid angle.
        (texel.truncate(), if pdf.is_finite() { pdf } else { 0.0 })
    }

    /// See [`PreparedEnvironment::diffuse_from_above`]. A ring of the sphere between the angles a and b from the pole has
    /// the weight sin^2 b - sin^2 a. Radiance is linear between the middles of rows, so each row is taken in eight rings.
    fn diffuse_from_above(&self) -> DVec3 {
        const RINGS: usize = 8;
        let mean = |row: usize| {
            let texels = &self.texels[row * self.width..][..self.width];
            texels.iter().map(|&texel| Vec4::from(texel).truncate().as_dvec3()).sum::<DVec3>()
                / self.width as f64
        };
        let means: Vec<DVec3> = (0..self.height).map(mean).collect();
        let rings = self.height * RINGS;
        let sine = |ring: usize| (PI * ring as f64 / rings as f64).min(0.5 * PI).sin();
        let of_ring = |ring: usize| {
            let (top, weight) = {
                let place = (ring as f64 + 0.5) / RINGS as f64 - 0.5;
                (place.floor(), place - place.floor())
            };
            let row = |at: f64| means[at.clamp(0.0, self.height as f64 - 1.0) as usize];
            let (from, to) = (sine(ring), sine(ring + 1));
            row(top).lerp(row(top + 1.0), weight) * (to * to - from * from)
        };
        (0..rings.div_ceil(2)).map(of_ring).sum()
    }

    /// Samples a direction of a cell.
    fn sample(&self, cell: &Cell) -> EnvironmentSample {
        let place = match self.has_weights {
            true => self.distribution.sample(cell, |index| self.texels[index][3]),
            false => self.distribution.sample(cell, |index| self.distribution.weight(index)),
        };
        let direction = self.direction_of(place);
        let (radiance, pdf) = self.eval_pdf(place, direction.y);
        EnvironmentSample { direction, radiance, pdf }
    }

    /// The place in the image of a direction, from 0 at the left and top to 1.
    fn image_place(&self, direction: DVec3) -> [f64; 2] {
        let v = libm::acos(direction.y.clamp(-1.0, 1.0)) / PI;
        // An image of one column does not depend on the azimuth.
        if self.width == 1 {
            return [0.5, v];
        }
        let (cos, sin) = self.rotation;
        let (x, z) = (direction.x * cos - direction.z * sin, direction.x * sin + direction.z * cos);
        [0.5 + libm::atan2(z, x) / (2.0 * PI), v]
    }

    fn direction_of(&self, [u, v]: [f64; 2]) -> DVec3 {
        let (sin_longitude, cos_longitude) = sin_cos_of_turns(u - 0.5);
        let (sine, y) = sin_cos_of_turns(0.5 * v);
        let (x, z) = (sine * cos_longitude, sine * sin_longitude);
        let (cos, sin) = self.rotation;
        DVec3::new(x * cos + z * sin, y, z * cos - x * sin)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::film::Colour;
    use crate::scene::EnvironmentImage;

    fn prepared(
        width: u32,
        height: u32,
        texel: impl Fn(u32, u32) -> f32,
        rotation: f64,
    ) -> PreparedEnvironment {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let pixels = pixels.map(|(x, y)| [texel(x, y); 3]).collect();
        let image = EnvironmentImage { name: "test".into(), width, height, pixels };
        let source = EnvironmentSource::Image(Arc::new(image));
        let environment = Environment { source, rotation, intensity: 1.0, is_hidden: false };
        PreparedEnvironment::new(&environment, ColourPipeline::Linear)
    }

    /// Integral over the sphere by the midpoint rule in longitude and angle from the pole, where densities are smooth.
    fn integral(count: u32, value: impl Fn(DVec3) -> f64) -> f64 {
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(count);
        let places = (0..count).flat_map(|i| (0..count).map(move |j| (place(i), place(j))));
        let term = |(x, y): (f64, f64)| {
            let ((sine, height), (sin, cos)) = ((PI * x).sin_cos(), (2.0 * PI * y).sin_cos());
            value(DVec3::new(sine * cos, height, sine * sin)) * sine
        };
        places.map(term).sum::<f64>() / f64::from(count * count) * 2.0 * PI * PI
    }

    /// The irradiance from above by quadrature over the sphere, for even and odd numbers of rows. The rule has errors of
    /// 1e-4 at the kinks of the interpolation.
    #[test]
    fn the_light_from_above_is_the_integral() {
        for height in [5, 8] {
            let environment = prepared(8, height, |x, y| ((x * 5 + y * 3) % 7) as f32, 0.4);
            let expected = integral(1200, |d| environment.eval(d).x * d.y.max(0.0)) / PI;
            let found = environment.diffuse_from_above().x;
            assert!((found - expected).abs() < 3e-3 * expected, "{height}: {found} {expected}");
        }
        let mut environment = prepared(4, 2, |_, _| 0.7, 0.0);
        let found = environment.diffuse_from_above();
        assert!((found.x - f64::from(0.7f32)).abs() < 1e-12);
        // Each sample of a shadow catcher asks for it: texels are read for the first alone.
        environment.radiance = Radiance::Uniform(DVec3::ZERO);
        assert_eq!(environment.diffuse_from_above(), found);
    }

    /// Directions of the image's centre, right edge of the middle, top and left, by the stated convention.
    #[test]
    fn the_centre_is_x_and_z_is_to_its_right() {
        let bright =
            |column: u32, row: u32| move |x: u32, y: u32| f32::from(u8::from(x == column && y == row));
        let seen = |column: u32, row: u32, rotation: f64, direction: DVec3| {
            prepared(64, 33, bright(column, row), rotation).eval(direction.normalize())
        };
        // Column 32 begins at u = 1/2; row 16 is the middle one. Half a texel is 2.8 degrees.
        let middle = |longitude: f64| DVec3::new(longitude.cos(), 0.0, longitude.sin());
        let half = PI / 64.0;
        assert!((seen(32, 16, 0.0, middle(half)) - DVec3::ONE).length() < 1e-6);
        assert!((seen(48, 16, 0.0, middle(PI / 2.0 + half)) - DVec3::ONE).length() < 1e-6);
        assert!((seen(0, 16, 0.0, middle(PI + half)) - DVec3::ONE).length() < 1e-6);
        // The top row is around +y.
        let top = prepared(64, 33, |_, y| f32::from(u8::from(y == 0)), 0.0);
        assert!((top.eval(DVec3::Y) - DVec3::ONE).length() < 1e-6 && top.eval(DVec3::NEG_Y) == DVec3::ZERO);
        // Turned by 90 degrees counterclockwise seen from above, what was at +x is at -z.
        let turned = seen(32, 16, PI / 2.0, middle(half - PI / 2.0));
        assert!((turned - DVec3::ONE).length() < 1e-6, "{turned}");
    }

    /// The density integrates to 1, and the mean of radiance / density over samples is the integral of the radiance.
    #[test]
    fn samples_have_their_density() {
        let blotchy =
            |x: u32, y: u32| if (x / 5 + y / 3).is_multiple_of(4) { 1.0 + (x * y % 7) as f32 } else { 0.0 };
        for environment in [
            prepared(40, 20, blotchy, 0.7),
            prepared(1, 1, |_, _| 2.0, 0.0),
            prepared(1, 64, |_, y| 1.0 + y as f32, 0.4),
            prepared(1, 2, |_, _| 2.0, 0.0),
            prepared(2, 1, |_, _| 2.0, 0.0),
            prepared(7, 3, |x, _| x as f32, 2.0),
        ] {
            let total = integral(1200, |direction| {
                environment.eval_pdf(direction, environment.map_position(direction)).1
            });
            assert!((total - 1.0).abs() < 2e-3, "{total}");
            let expected = integral(1200, |direction| environment.eval(direction).x);
            let count = 400;
            let number = |i: u32| (f64::from(i) + 0.5) / f64::from(count);
            let numbers = (0..count).flat_map(|i| (0..count).map(move |j| [number(i), number(j)]));
            let estimate = numbers.map(|numbers| {
                let EnvironmentSample { direction, radiance, pdf } = environment.sample(numbers);
                assert!((direction.length() - 1.0).abs() < 1e-12 && pdf >= 0.0);
                if pdf > 0.0 { radiance.x / pdf } else { 0.0 }
            });
            let estimate = estimate.sum::<f64>() / f64::from(count * count);
            assert!((estimate / expected - 1.0).abs() < 5e-3, "{estimate} {expected}");
        }
    }

    /// In every pipeline, a colour is one radiance, sampled uniformly on the sphere: the mean of the directions is 0, that
    /// of each squared component 1/3, and the mean of |y| is 1/2.
    #[test]
    fn a_colour_is_sampled_uniformly() {
        let of = |colour: DVec3, pipeline| {
            let source = EnvironmentSource::Colour(Colour::Linear(colour));
            let environment = Environment { source, rotation: 0.3, intensity: 0.5, is_hidden: false };
            PreparedEnvironment::new(&environment, pipeline)
        };
        let uniform = of(DVec3::new(0.0, 1.0, 0.5), ColourPipeline::Linear);
        let count = 400;
        let number = |i: u32| (f64::from(i) + 0.5) / f64::from(count);
        let (mut mean, mut squares, mut height) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            let EnvironmentSample { direction, radiance, pdf } = uniform.sample([number(i), number(j)]);
            assert!((radiance, pdf) == (DVec3::new(0.0, 0.5, 0.25), UNIFORM_DENSITY));
            assert!((pdf * 4.0 * PI - 1.0).abs() < 1e-15 && (direction.length() - 1.0).abs() < 1e-12);
            mean += direction / f64::from(count * count);
            squares += direction * direction / f64::from(count * count);
            height += direction.y.abs() / f64::from(count * count);
        }
        assert!(mean.abs().max_element() < 1e-12, "{mean}");
        // The midpoint rule of y^2 over the interval from -1 to 1 is off by 1 / (3 count^2).
        assert!((squares - 1.0 / 3.0).abs().max_element() < 1e-5, "{squares}");
        assert!((height - 0.5).abs() < 1e-12, "{height}");
        for pipeline in [ColourPipeline::Linear, ColourPipeline::Display, ColourPipeline::U8] {
            let (black, white) = (of(DVec3::ZERO, pipeline), of(DVec3::ONE, pipeline));
            let expected = match pipeline {
                ColourPipeline::Linear => 0.5,
                _ => f64::from(srgb_encode(0.5) as f32),
            };
            assert_eq!(white.eval(DVec3::Y), DVec3::splat(expected));
            assert_eq!(
                (black.eval(DVec3::Y), black.eval_pdf(DVec3::Y, black.map_position(DVec3::Y)).1),
                (DVec3::ZERO, 0.0)
            );
        }
    }

    #[test]
    fn a_black_environment_is_sampled_without_density() {
        for black in [prepared(8, 4, |_, _| 0.0, 0.0), prepared(1, 1, |_, _| 0.0, 0.0)] {
            let sample = black.sample([0.3, 0.9]);
            assert!(sample.direction.is_finite() && sample.radiance == DVec3::ZERO && sample.pdf == 0.0);
        }
    }
}
