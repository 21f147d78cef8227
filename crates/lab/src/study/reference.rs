//! Converged references and their noise.
//!
//! A limit is the mean of two halves, rendered in the tier `exact` with different seeds. The halves are independent:
//! their difference has twice the variance of one half, their mean has half of it. So the standard error of the limit
//! is half the RMS difference of the halves.

use super::data::{NoiseFloor, Significance};
use super::setting::Setting;
use kiln::bvh::Numerics;
use kiln::error::Result;
use kiln::film::FilterShape;
use kiln::metrics::{ComparedImage, Errors, Figures};

/// Ratio of an error to the noise of the reference from which on it is significant: as squares add up, the noise then
/// changes it by half a per cent at most.
const SIGNIFICANT_RATIO: f64 = 10.0;

/// A converged picture.
pub(crate) struct ConvergedReference {
    /// Reconstruction filter and its radius in pixels.
    pub filter: (FilterShape, f64),
    /// The picture.
    pub picture: ComparedImage,
    /// Noise of the picture.
    pub floor: NoiseFloor,
}

/// Settings of the two halves, of `samples` samples per pixel each.
pub(crate) fn halves(base: &Setting, filter: (FilterShape, f64), samples: u32) -> [Setting; 2] {
    [1, 2].map(|more| {
        let mut half = Setting { numerics: Numerics::Exact, ..base.clone() }.unrounded();
        let own = &mut half.sampling;
        own.seed = own.seed.wrapping_add(more);
        (own.samples, own.noise) = (Some(samples), None);
        (own.filter, own.filter_radius) = (Some(filter.0), Some(filter.1));
        half
    })
}

impl ConvergedReference {
    /// The mean of two halves, of `samples` samples per pixel and at most `bounces` bounces of paths each; `None` if a pixel is not finite.
    ///
    /// # Errors
    /// Those of the metrics.
    pub(crate) fn new(
        filter: (FilterShape, f64),
        (samples, bounces): (u32, Option<u32>),
        [a, b]: &[ComparedImage; 2],
    ) -> Result<Option<Self>> {
        let Some(errors) = Errors::between(a, b)?.figures else { return Ok(None) };
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| {
            std::array::from_fn(|c| ((f64::from(a[c]) + f64::from(b[c])) / 2.0) as f32)
        };
        let picture =
            ComparedImage { pixels: a.pixels.iter().zip(&b.pixels).map(mean).collect(), ..a.clone() };
        let floor = NoiseFloor {
            filter: filter.0.name().into(),
            samples: 2 * samples,
            rmse: errors.rmse / 2.0,
            bounces,
        };
        Ok(Some(ConvergedReference { filter, picture, floor }))
    }

    /// Whether an error against this reference exceeds its noise.
    pub(crate) fn significance(&self, errors: &Figures) -> Significance {
        if errors.rmse >= SIGNIFICANT_RATIO * self.floor.rmse {
            Significance::Significant
        } else {
            Significance::Insignificant
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln::metrics::Values;

    fn uniform(value: f32) -> ComparedImage {
        ComparedImage {
            width: 2,
            height: 1,
            values: Values::Display,
            pixels: vec![[value; 3]; 2],
            alpha: None,
        }
    }

    #[test]
    fn the_noise_is_half_the_difference_of_the_halves() {
        let filter = (FilterShape::Box, 0.5);
        let limit =
            ConvergedReference::new(filter, (8, None), &[uniform(0.25), uniform(0.75)]).unwrap().unwrap();
        assert_eq!((limit.floor.rmse, limit.floor.samples), (0.25, 16));
        assert_eq!(limit.picture, uniform(0.5));
        assert!(
            ConvergedReference::new(filter, (8, None), &[uniform(0.25), uniform(f32::NAN)])
                .unwrap()
                .is_none()
        );
    }
}
