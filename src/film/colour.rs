//! The three colour pipelines: the encoding in which light is summed, and its conversion to 8 bits.
//!
//! | pipeline  | a colour of the scene becomes | sums | the film becomes |
//! | --------- | ----------------------------- | ---- | ---------------- |
//! | `display` | 8-bit / 255, no transfer function | f64, clamped to 0..1 | round half up, once |
//! | `u8`      | 8-bit / 255                       | rounded to 8 bits and clamped after every step | as it is |
//! | `linear`  | decoded from sRGB                 | floating point | sRGB transfer function, clamp, round half up |

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::rounding::{Level, quantise};

/// Encoding in which light is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ColourPipeline {
    /// Floating-point display values, clamped to 0..1 after every operation; quantised once.
    Display,
    /// Display values, clamped and quantised to 8 bits after every operation.
    U8,
    /// Linear light; converted from and to sRGB.
    #[default]
    Linear,
}

/// A colour in the encoding of its source. Three channels, red, green and blue, nominally 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub enum Colour {
    /// Display values (sRGB-encoded): scene files, 8-bit images, MTL files.
    Display(DVec3),
    /// Linear light: glTF factors and vertex colours.
    Linear(DVec3),
}

impl Colour {
    /// A colour from 8-bit display values.
    pub fn from_u8(rgb: [u8; 3]) -> Self {
        Colour::Display(DVec3::from(rgb.map(|c| f64::from(c) / 255.0)))
    }

    /// Converts the colour to the encoding of `pipeline`.
    pub fn to_pipeline(self, pipeline: ColourPipeline) -> DVec3 {
        match (self, pipeline) {
            (Colour::Display(c), ColourPipeline::Linear) => per_channel(c, srgb_decode),
            (Colour::Linear(c), ColourPipeline::Display | ColourPipeline::U8) => per_channel(c, srgb_encode),
            (Colour::Display(c) | Colour::Linear(c), _) => c,
        }
    }
}

names!(ColourPipeline { Display = "display", U8 = "u8", Linear = "linear" });

impl ColourPipeline {
    /// Clamps a colour to the range of the pipeline: 8-bit values for `u8`, 0 to 1 for `display` (the range of
    /// `mix_light` in the report, without its rounding), finite f32 for `linear`, because irradiance near a light is
    /// unbounded.
    #[inline]
    pub fn clamp(self, c: DVec3) -> DVec3 {
        match self {
            ColourPipeline::U8 => per_channel(c, |x| f64::from(quantise::<u8>(x)) / 255.0),
            ColourPipeline::Display => per_channel(c, |x| x.clamp(0.0, 1.0)),
            ColourPipeline::Linear => per_channel(c, |x| x.clamp(f32::MIN.into(), f32::MAX.into())),
        }
    }

    /// The assignment's `mix_light`: colour times light, per channel.
    #[inline]
    pub fn mix_light(self, colour: DVec3, light: DVec3) -> DVec3 {
        // Clamping the light keeps black at 0 under infinite light.
        self.clamp(colour * per_channel(light, |x| x.clamp(f64::MIN, f64::MAX)))
    }

    /// The assignment's `weighted_combine`: `a * weight_a + b * weight_b`, per channel.
    #[inline]
    pub fn weighted_combine(self, a: DVec3, b: DVec3, weight_a: f64, weight_b: f64) -> DVec3 {
        self.clamp(a * weight_a + b * weight_b)
    }

    /// Display value of one channel, 0 to 1, before quantisation.
    #[inline]
    pub fn displayed(self, c: f64) -> f64 {
        match self {
            ColourPipeline::Linear => srgb_encode(c).clamp(0.0, 1.0),
            ColourPipeline::Display | ColourPipeline::U8 => c.clamp(0.0, 1.0),
        }
    }

    /// The 8-bit display values of a film value.
    #[inline(always)]
    pub fn encode(self, [r, g, b]: [f32; 3]) -> [u8; 3] {
        [self.encode_channel(r), self.encode_channel(g), self.encode_channel(b)]
    }

    /// The display value of one channel of a film value.
    #[inline(always)]
    pub fn encode_channel<L: Level>(self, c: f32) -> L {
        match self {
            ColourPipeline::Linear => quantise(srgb_encode(f64::from(c))),
            ColourPipeline::Display | ColourPipeline::U8 => quantise(f64::from(c)),
        }
    }
}

/// The sRGB transfer function, display value to linear light (IEC 61966-2-1), extended to negative `x` as an odd
/// function.
pub fn srgb_decode(x: f64) -> f64 {
    let a = x.abs();
    let y = if a <= 0.04045 { a / 12.92 } else { ((a + 0.055) / 1.055).powf(2.4) };
    y.copysign(x)
}

/// The sRGB transfer function, linear light to display value (IEC 61966-2-1), extended to negative `x` as an odd
/// function.
pub fn srgb_encode(x: f64) -> f64 {
    let a = x.abs();
    let y = if a <= 0.003_130_8 { a * 12.92 } else { 1.055 * a.powf(1.0 / 2.4) - 0.055 };
    y.copysign(x)
}

#[inline(always)]
fn per_channel(c: DVec3, f: impl Fn(f64) -> f64) -> DVec3 {
    DVec3::new(f(c.x), f(c.y), f(c.z))
}

/// The luminance of a linear sRGB colour (Rec. ITU-R BT.709-6, section 3.2).
pub fn luminance(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mix_light_clamps_to_what_a_display_shows() {
        // 200 * 4 = 800: `display` and `u8` stop at 255 / 255, `linear` keeps 800 / 255.
        let colour = DVec3::splat(200.0 / 255.0);
        let light = DVec3::splat(4.0);
        for pipeline in [ColourPipeline::Display, ColourPipeline::U8] {
            assert_eq!(pipeline.mix_light(colour, light), DVec3::ONE);
        }
        let kept = ColourPipeline::Linear.mix_light(colour, light).x * 255.0;
        assert!((kept - 800.0).abs() < 800.0 * f64::EPSILON * 4.0);
        // `display` clamps without rounding: 201 * 1.1 = 221.1.
        let unrounded = ColourPipeline::Display.mix_light(DVec3::splat(201.0 / 255.0), DVec3::splat(1.1));
        assert!((unrounded.x * 255.0 - 221.1).abs() < 1e-12);
    }

    #[test]
    fn the_blend_of_the_assignment() {
        // 0.75 * 100 + 0.25 * 201 = 125.25: u8 rounds to 125.
        let (a, b) = (DVec3::splat(100.0 / 255.0), DVec3::splat(201.0 / 255.0));
        let u8_value = ColourPipeline::U8.weighted_combine(a, b, 0.75, 0.25);
        assert_eq!(u8_value, DVec3::splat(125.0 / 255.0));
        let display = ColourPipeline::Display.weighted_combine(a, b, 0.75, 0.25) * 255.0;
        assert!((display.x - 125.25).abs() < 1e-12 * 125.25);
    }

    #[test]
    fn srgb_is_its_own_inverse_for_every_8_bit_value() {
        for value in 0..=255u8 {
            let linear = Colour::from_u8([value; 3]).to_pipeline(ColourPipeline::Linear);
            assert_eq!(ColourPipeline::Linear.encode([linear.x as f32; 3]), [value; 3]);
            let display = Colour::Linear(linear).to_pipeline(ColourPipeline::Display);
            assert_eq!(quantise::<u8>(display.x), value);
        }
    }

    #[test]
    fn srgb_meets_the_standards_own_numbers() {
        // IEC 61966-2-1: 18 % grey is displayed as 0.4613561.
        assert!((srgb_encode(0.18) - 0.461_356_1).abs() < 1e-6);
        assert!((srgb_encode(1.0) - 1.0).abs() <= f64::EPSILON);
        assert_eq!(srgb_decode(0.0), 0.0);
    }
}
