//! Conversion of height maps (MTL's `bump`) to normal maps.

#[cfg(doc)]
use crate::scene::TexelEncoding;
use crate::scene::TexelValues;

/// A normal map and the factor of its x and y.
pub(crate) struct NormalsOfHeights {
    /// Texels, row by row from the top.
    pub texels: TexelValues,
    /// Steepest slope of the height map, the unit of x and y. Texels encode slopes within a 255th or a 65,535th of it;
    /// zero slopes are exact ([`TexelEncoding::Normal`]).
    pub steepest: f64,
}

/// Computes the normal map of `heights`, values from 0 to 1 by texel index, row by row from the top; `width` by
/// `height` texels that repeat. `largest` is the largest value of the bit depth of the result. Slopes are central
/// differences in heights per texel: a rise by 1 over two texels is a slope of 1/2.
///
/// MTL does not specify a unit of height. Measuring in texels makes the tilt independent of the texture's size in world
/// space, as tools that convert height maps do.
pub(crate) fn normals_of_heights(
    heights: impl Fn(usize) -> f64,
    width: usize,
    height: usize,
    largest: u16,
) -> NormalsOfHeights {
    let at = |x: usize, y: usize| heights(y % height * width + x % width);
    // Slopes are computed twice, because storing them would take 16 bytes per texel.
    let slopes = |i: usize| {
        let (x, y) = (i % width, i / width);
        let right = (at(x + 1, y) - at(x + width - 1, y)) / 2.0;
        let up = (at(x, y + height - 1) - at(x, y + 1)) / 2.0;
        [right, up]
    };
    let count = width * height;
    let steepest = (0..count).flat_map(slopes).fold(0.0, |most: f64, slope| most.max(slope.abs()));
    // Normals tilt away from rising heights. x and y are scaled to the full range of values, with z = 1.
    let encode = |slope: f64| {
        let share = if steepest > 0.0 { -slope / steepest } else { 0.0 };
        ((share + 1.0) / 2.0 * f64::from(largest) + 0.5).floor() as u16
    };
    let texel = |i: usize| {
        let [x, y] = slopes(i);
        [encode(x), encode(y), largest]
    };
    let texels = TexelValues::collect(largest, count, texel);
    NormalsOfHeights { texels, steepest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_by_hand() {
        // Rising by 1/4 a texel to the right, and falling back at the seam: 1/4, 1/4, then (0 - 1/2) / 2 and so on.
        let row = [0.0, 0.25, 0.5, 0.75];
        let made = normals_of_heights(|i| row[i], 4, 1, 255);
        // At x = 0 the neighbours are 0.25 and 0.75: -1/4; at 1 and 2 +1/4; at 3 they are 0 and 0.5: -1/4.
        assert_eq!(made.steepest, 0.25);
        assert_eq!(made.texels.iter().map(|t| t[0]).collect::<Vec<_>>(), [255, 0, 0, 255]);
        assert!(made.texels.iter().all(|t: [u16; 3]| t[1] == 128 && t[2] == 255));
        // The same down a column: rising downwards, normals lean up.
        let made = normals_of_heights(|i| row[i], 1, 4, 255);
        assert_eq!(made.texels.iter().map(|t| t[1]).collect::<Vec<_>>(), [0, 255, 255, 0]);
        assert_eq!(normals_of_heights(|_| 0.5, 3, 2, 65535).steepest, 0.0);
    }
}
