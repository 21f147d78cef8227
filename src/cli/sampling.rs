//! The options of `kiln render` that say how pixels are sampled.

use clap::Args;

use crate::film::FilterShape;
use crate::scene::Sampling;

#[derive(Args)]
pub struct SamplingArguments {
    /// Samples a pixel; with --noise the most of them [default: the scene's, or 1 at the pixel's centre]
    #[arg(long, value_name = "N", value_parser = |text: &str| number(text).and_then(Sampling::check_samples))]
    samples: Option<u32>,
    /// The filter that pixels are seen through [default: the scene's, or gaussian]
    #[arg(long, value_name = "FILTER", value_parser = FilterShape::ALL.map(FilterShape::name))]
    filter: Option<String>,
    /// How far the filter reaches from a pixel's centre, in pixels [default: box 0.5, tent 1, gaussian 1.5, mitchell 2]
    #[arg(long, value_name = "PIXELS", value_parser = |text: &str| number(text).and_then(Sampling::check_radius))]
    filter_radius: Option<f64>,
    /// Sample a pixel no further once the standard error of its displayed value is below this; 1 is white
    #[arg(long, value_name = "LEVEL", value_parser = |text: &str| number(text).and_then(Sampling::check_noise))]
    noise: Option<f64>,
    /// Samples that every pixel takes before --noise may end it [default: the scene's, or 4]
    #[arg(long, value_name = "N", value_parser = |text: &str| number(text).and_then(Sampling::check_samples))]
    min_samples: Option<u32>,
    /// What random numbers depend on besides pixel, sample and dimension [default: the scene's, or 0]
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
}

fn number<T: std::str::FromStr<Err: std::fmt::Display>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|e: T::Err| e.to_string())
}

impl SamplingArguments {
    /// What was typed.
    pub fn said(&self) -> Sampling {
        let shape = |name: &String| FilterShape::ALL.into_iter().find(|shape| shape.name() == name);
        Sampling {
            samples: self.samples,
            filter: self.filter.as_ref().and_then(shape),
            filter_radius: self.filter_radius,
            noise: self.noise,
            min_samples: self.min_samples,
            seed: self.seed,
        }
    }
}
