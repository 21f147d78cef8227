//! What pictures are held against, and how far that may be from the truth itself.
//!
//! A limit is the mean of two halves, rendered in the tier `exact` with seeds of their own. They are independent, so the variance
//! of their difference is twice that of either, and their mean has half of either's: the standard error of the limit is half
//! the difference. A badly chosen reference skews everything that is measured against it, so this is stated with every figure.

use super::data::{Floor, Told};
use super::errors::PictureErrors;
use super::setting::Setting;
use crate::error::Result;
use crate::film::FilterShape;
use crate::geometry::Numerics;
use crate::metrics::ComparedImage;

/// An error is told from the reference's own where it is so many times that: then it is off by half a per cent at most,
/// the two adding up by squares.
const APART: f64 = 10.0;

/// A picture of so many samples that more would change little.
pub struct Limit {
    /// Through which filter, and its radius.
    pub filter: (FilterShape, f64),
    /// The picture.
    pub picture: ComparedImage,
    /// How far off it is.
    pub floor: Floor,
}

/// The settings of the two halves, of `samples` samples a pixel each.
pub fn halves(base: &Setting, filter: (FilterShape, f64), samples: u32) -> [Setting; 2] {
    [1, 2].map(|more| {
        let mut half = Setting { numerics: Numerics::Exact, ..base.clone() }.unrounded();
        let own = &mut half.sampling;
        own.seed = Some(own.seed.unwrap_or(0).wrapping_add(more));
        (own.samples, own.noise) = (Some(samples), None);
        (own.filter, own.filter_radius) = (Some(filter.0), Some(filter.1));
        half
    })
}

impl Limit {
    /// Of two halves. `None` where one has a pixel that is no finite number: nothing can be measured against it.
    ///
    /// # Errors
    /// Those of the metrics.
    pub fn new(
        filter: (FilterShape, f64),
        samples: u32,
        [a, b]: &[ComparedImage; 2],
    ) -> Result<Option<Self>> {
        let Some(errors) = PictureErrors::between(a, b)? else { return Ok(None) };
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| {
            std::array::from_fn(|c| ((f64::from(a[c]) + f64::from(b[c])) / 2.0) as f32)
        };
        let picture =
            ComparedImage { pixels: a.pixels.iter().zip(&b.pixels).map(mean).collect(), ..a.clone() };
        let floor = Floor { filter: filter.0.name().into(), samples: 2 * samples, rmse: errors.rmse / 2.0 };
        Ok(Some(Limit { filter, picture, floor }))
    }

    /// Whether an error against this can be told from its own.
    pub fn told(&self, errors: &PictureErrors) -> Told {
        if errors.rmse >= APART * self.floor.rmse {
            Told::Apart
        } else {
            Told::Within
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Values;

    fn even(value: f32) -> ComparedImage {
        ComparedImage { width: 2, height: 1, values: Values::Display, pixels: vec![[value; 3]; 2] }
    }

    #[test]
    fn the_floor_is_half_the_difference_of_the_halves() {
        let filter = (FilterShape::Box, 0.5);
        let limit = Limit::new(filter, 8, &[even(0.25), even(0.75)]).unwrap().unwrap();
        assert_eq!((limit.floor.rmse, limit.floor.samples), (0.25, 16));
        assert_eq!(limit.picture, even(0.5));
        assert!(Limit::new(filter, 8, &[even(0.25), even(f32::NAN)]).unwrap().is_none());
    }
}
