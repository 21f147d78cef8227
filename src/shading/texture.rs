//! Texture lookups: nearest, bilinear, trilinear and anisotropic.
//!
//! The footprint of a pixel in the texture is an ellipse, the image of a circle of one pixel's diameter. Where its longer axis is
//! longer than a texel, a level of the mip map is chosen whose texels are that long (Williams, Pyramidal Parametrics, SIGGRAPH
//! 1983). Anisotropic lookups average several lookups along that axis, in a level for the shorter axis (McCormack, Perry, Farkas
//! and Jouppi, Feline, SIGGRAPH 1999, section 3).

use glam::{DVec2, DVec3};

use crate::scene::{Interpolation, ResolvedTextureFilter, TexelEncoding, TextureSampler};
use crate::world::{Image, TexturePoint};

/// The limit on lookups along the longer axis, as in graphics hardware.
const MOST_LOOKUPS: f64 = 16.0;

/// The filtered value of a texture at a point, 0 to 1. A mip map that was not built is not used.
pub fn look_up(
    image: &Image,
    encoding: TexelEncoding,
    sampler: &TextureSampler,
    filter: &ResolvedTextureFilter,
    point: &TexturePoint,
) -> DVec3 {
    let at_full_size = |lookup| look_at(image, encoding, sampler, 0, lookup, point.uv);
    if !filter.needs_footprint() {
        return at_full_size(filter.magnify);
    }
    let ellipse = Ellipse::new(point.footprint, DVec2::new(image.width.into(), image.height.into()));
    // A footprint of NaN fails this test and gets the last level, like an infinite one.
    if ellipse.longer <= 1.0 {
        return at_full_size(filter.magnify);
    }
    let (Some(between), Some(mip_map)) = (filter.minify.between, image.mip_map(encoding)) else {
        return at_full_size(filter.minify.within);
    };
    let last = mip_map.levels().len();
    let in_level = |uv: DVec2, level: f64| {
        let texel = |level: usize| look_at(image, encoding, sampler, level, filter.minify.within, uv);
        match between {
            Interpolation::Nearest => texel((level + 0.5).floor() as usize),
            Interpolation::Linear => {
                let lower = level.floor();
                let (near, share) = (texel(lower as usize), level - lower);
                if share > 0.0 { near.lerp(texel((lower as usize + 1).min(last)), share) } else { near }
            }
        }
    };
    if !filter.anisotropic {
        return in_level(point.uv, level_of(ellipse.longer, last));
    }
    let count = ellipse.lookups();
    let level = level_of(ellipse.longer / count, last);
    let mut sum = DVec3::ZERO;
    for k in 0..count as u32 {
        let place = (f64::from(k) + 0.5) / count - 0.5;
        sum += in_level(point.uv + place * ellipse.axis, level);
    }
    sum / count
}

/// The level whose texels are `size` times as long as the image's, 0 (the image) to `last`.
fn level_of(size: f64, last: usize) -> f64 {
    // NaN gives `last`.
    let level = size.log2();
    if level < last as f64 { level.max(0.0) } else { last as f64 }
}

/// The footprint of a pixel in a texture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ellipse {
    /// The full lengths of its axes in texels.
    longer: f64,
    shorter: f64,
    /// The longer axis in texture coordinates.
    axis: DVec2,
}

impl Ellipse {
    /// The image of a circle of one pixel's diameter under the matrix with columns `footprint`. The lengths of its axes are the
    /// singular values, in closed form from the product of the matrix and its transpose.
    fn new(footprint: [DVec2; 2], size: DVec2) -> Self {
        let [a, b] = footprint.map(|change| change * size);
        let (xx, xy, yy) = (a.x * a.x + b.x * b.x, a.x * a.y + b.x * b.y, a.y * a.y + b.y * b.y);
        let (mean, half) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
        let spread = (half * half + xy * xy).sqrt();
        let (longer, determinant) = ((mean + spread).sqrt(), (a.x * b.y - a.y * b.x).abs());
        // Of the two forms of the eigenvector, the one without cancellation.
        let axis = if half > 0.0 { DVec2::new(half + spread, xy) } else { DVec2::new(xy, spread - half) };
        let axis = axis.try_normalize().unwrap_or(DVec2::X) * longer / size;
        Ellipse { longer, shorter: determinant / longer, axis }
    }

    /// The number of lookups along the longer axis whose distance is at most the length of the shorter axis.
    fn lookups(&self) -> f64 {
        let ratio = self.longer / self.shorter.max(1.0);
        if ratio < MOST_LOOKUPS { ratio.ceil().max(1.0) } else { MOST_LOOKUPS }
    }
}

/// The value of a level at `uv`, 0 to 1; level 0 is the image.
pub(crate) fn look_at(
    image: &Image,
    encoding: TexelEncoding,
    sampler: &TextureSampler,
    level: usize,
    lookup: Interpolation,
    uv: DVec2,
) -> DVec3 {
    let level = level.checked_sub(1).and_then(|below| image.mip_map(encoding)?.levels().get(below));
    let (width, height) = level.map_or((image.width, image.height), |level| (level.width, level.height));
    let (w, h) = (i64::from(width), i64::from(height));
    let column = |x: i64| sampler.wrap_u.index(x, w);
    let row = |y: i64| sampler.wrap_v.index(y, h) * w;
    let texel = |row: i64, column: i64| {
        let index = (row + column) as usize;
        DVec3::from(level.map_or_else(|| image.texel(index, encoding), |level| level.texel(index, encoding)))
    };
    let place = uv * DVec2::new(w as f64, h as f64);
    // Casts of coordinates beyond i64 saturate; wrapping then still gives a texel of the image.
    match lookup {
        Interpolation::Nearest => texel(row(place.y.floor() as i64), column(place.x.floor() as i64)),
        Interpolation::Linear => {
            // Texel centres lie at half-integers.
            let place = place - 0.5;
            let (corner, share) = (place.floor(), place - place.floor());
            let (x, y) = (corner.x as i64, corner.y as i64);
            let (left, right) = (column(x), column(x.saturating_add(1)));
            let (above, below) = (row(y), row(y.saturating_add(1)));
            let top = texel(above, left).lerp(texel(above, right), share.x);
            let bottom = texel(below, left).lerp(texel(below, right), share.x);
            top.lerp(bottom, share.y)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle stretched to 8 by 2 1/8 texels and turned by any angle, before and after, is an ellipse of 8 by 2 1/8 texels.
    #[test]
    fn axes_of_ellipses() {
        for k in 0..100 {
            let (before, after) = (f64::from(k) * 0.7, f64::from(k) * 0.37);
            let turned = DVec2::from_angle(after);
            let step = |v: DVec2| turned.rotate(DVec2::new(8.0, 2.125) * DVec2::from_angle(before).rotate(v));
            let size = DVec2::new(64.0, 256.0);
            let ellipse = Ellipse::new([step(DVec2::X) / size, step(DVec2::Y) / size], size);
            assert!((ellipse.longer - 8.0).abs() < 1e-13 && (ellipse.shorter - 2.125).abs() < 1e-13);
            let along = (ellipse.axis * size).dot(turned).abs();
            assert!((along - 8.0).abs() < 1e-13, "{along}");
            // 8 / 2.125 is 3.76.
            assert_eq!(ellipse.lookups(), 4.0);
        }
    }

    #[test]
    fn levels_end_where_the_mip_map_does() {
        assert_eq!(level_of(4.0, 9), 2.0);
        assert_eq!(level_of(0.5, 9), 0.0);
        for endless in [1e300, f64::INFINITY, f64::NAN] {
            assert_eq!(level_of(endless, 9), 9.0);
        }
        let nothing = Ellipse::new([DVec2::NAN; 2], DVec2::ONE);
        assert_eq!(nothing.lookups(), MOST_LOOKUPS);
        let line = Ellipse::new([DVec2::X, DVec2::ZERO], DVec2::splat(512.0));
        assert_eq!((line.longer, line.shorter, line.lookups()), (512.0, 0.0, MOST_LOOKUPS));
    }
}
