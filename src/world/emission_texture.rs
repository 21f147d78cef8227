//! The mean emission of textured triangles, by which they are chosen as lights.

use glam::{DVec2, DVec3};

use super::Image;
use super::mip_map::MipMap;
use crate::film::colour::luminance;
use crate::scene::{TexelEncoding, TextureSampler};

/// The most parts of a triangle's side, the square of which are its lookups.
const MOST_PARTS: f64 = 8.0;

/// An emission texture times a factor, prepared for means over triangles. The means are approximate: they decide how
/// often a triangle is sampled, not what it emits.
pub(super) struct MeanEmission<'a> {
    image: &'a Image,
    /// Made here where the image has none: that of the image belongs to the plan, which may be made at the same time.
    made: Option<MipMap>,
    sampler: TextureSampler,
    emission: DVec3,
}

impl<'a> MeanEmission<'a> {
    pub(super) fn new(image: &'a Image, sampler: TextureSampler, emission: DVec3) -> Self {
        let texel = |index: usize| DVec3::from(image.texel(index, TexelEncoding::Colour)).as_vec3();
        let made = image.mip_map(TexelEncoding::Colour).is_none();
        let made = made.then(|| MipMap::new(image.width, image.height, texel));
        MeanEmission { image, made, sampler, emission }
    }

    /// The luminance of the mean radiance over a triangle with these texture coordinates: the mean over the centres of
    /// up to 8 x 8 equal triangles, in a level of the mip map whose texels are as large as those. 0 for coordinates
    /// that are not finite.
    pub(super) fn over(&self, [a, b, c]: [DVec2; 3]) -> f64 {
        let size = DVec2::new(self.image.width.into(), self.image.height.into());
        let longest =
            [b - a, c - b, a - c].map(|side| (side * size).length()).into_iter().fold(0.0, f64::max);
        // `f64::max` ignores NaN.
        if !(longest.is_finite() && [a, b, c].iter().all(|uv| uv.is_finite())) {
            return 0.0;
        }
        let parts = longest.ceil().clamp(1.0, MOST_PARTS);
        let level = (longest / parts).log2().ceil().max(0.0) as usize;
        let (mut sum, side) = (DVec3::ZERO, 1.0 / parts);
        for i in 0..parts as u32 {
            for j in 0..parts as u32 - i {
                let corner = |third: f64| (DVec2::new(i.into(), j.into()) + third) * side;
                let mut add = |place: DVec2| {
                    sum += self.texel(a + place.x * (b - a) + place.y * (c - a), level);
                };
                add(corner(1.0 / 3.0));
                // The triangle that points the other way, except in the last of a row.
                if i + j + 1 < parts as u32 {
                    add(corner(2.0 / 3.0));
                }
            }
        }
        luminance(self.emission * sum * side * side)
    }

    /// The nearest texel of a level; level 0 is the image.
    fn texel(&self, uv: DVec2, level: usize) -> DVec3 {
        let encoding = TexelEncoding::Colour;
        let mip_map = self.made.as_ref().or_else(|| self.image.mip_map(encoding));
        let levels = mip_map.map_or(&[][..], MipMap::levels);
        let below = level.min(levels.len()).checked_sub(1).map(|below| &levels[below]);
        let (width, height) =
            below.map_or((self.image.width, self.image.height), |level| (level.width, level.height));
        let index = |at: f64, side: u32, wrap: crate::scene::Wrap| {
            wrap.index((at * f64::from(side)).floor() as i64, side.into()) as usize
        };
        let row = index(uv.y, height, self.sampler.wrap_v);
        let at = row * width as usize + index(uv.x, width, self.sampler.wrap_u);
        DVec3::from(below.map_or_else(|| self.image.texel(at, encoding), |level| level.texel(at, encoding)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::ColourPipeline;
    use crate::scene::DecodedImage;

    /// Texels k of n by 1 of the value `values(k)`, in display numbers.
    fn image(side: u32, value: impl Fn(u32) -> u8) -> Image {
        let pixels = (0..side * side).map(|i| [value(i); 3]).collect();
        let decoded = DecodedImage { name: "a".into(), width: side, height: side, pixels };
        Image::new(decoded, ColourPipeline::Display)
    }

    /// A checker of 0 and 1 has the mean 1/2 over any triangle of many texels; over texels of one kind it has their
    /// value; and repeated a thousand times it has the mean again, from the last level.
    #[test]
    fn means_of_a_checker() {
        let checker = image(64, |i| if (i / 8 + i / 64 / 8) % 2 == 0 { 255 } else { 0 });
        let mean = MeanEmission::new(&checker, TextureSampler::default(), DVec3::splat(3.0));
        let [a, b, c] = [DVec2::ZERO, DVec2::X, DVec2::Y];
        for scale in [1.0, 1e3, 1e12] {
            let of = mean.over([a, b * scale, c * scale]);
            assert!((of - 1.5).abs() < 0.2, "{scale}: {of}");
        }
        let [bright, dark] = [DVec2::ZERO, DVec2::new(0.125, 0.0)];
        let within = |corner: DVec2| mean.over([a, b, c].map(|p| corner + p * 0.1));
        assert!((within(bright) - 3.0).abs() < 1e-12);
        assert_eq!(within(dark), 0.0);
        assert_eq!(mean.over([a, b, DVec2::NAN]), 0.0);
        assert_eq!(mean.over([a, b, DVec2::splat(f64::INFINITY)]), 0.0);
    }
}
