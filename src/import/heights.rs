//! Height maps (MTL's `bump`) made normal maps.

/// A normal map, red, green and blue a texel, and what its x and y are to be multiplied by.
pub struct NormalsOfHeights {
    /// Texels, row by row from the top.
    pub texels: Vec<[u8; 3]>,
    /// The steepest slope in the picture, which 8 bits are spread over.
    pub steepest: f64,
}

/// The normal map of `heights` from 0 to 1, by their index row by row from the top, `width` by `height` texels that repeat. Slopes are central differences, in heights
/// a texel: a step of the whole range from one texel to the next but one is a slope of 1/2.
///
/// MTL does not say how high its heights are; by texels the tilt does not depend on the picture's size in the world, and
/// programs that make normal maps of heights do the same.
pub fn normals_of_heights(heights: impl Fn(usize) -> f64, width: usize, height: usize) -> NormalsOfHeights {
    let at = |x: usize, y: usize| heights(y % height * width + x % width);
    // Computed twice rather than kept, which would take 16 bytes a texel.
    let slopes = |i: usize| {
        let (x, y) = (i % width, i / width);
        let right = (at(x + 1, y) - at(x + width - 1, y)) / 2.0;
        let up = (at(x, y + height - 1) - at(x, y + 1)) / 2.0;
        [right, up]
    };
    let count = width * height;
    let steepest = (0..count).flat_map(slopes).fold(0.0, |most: f64, slope| most.max(slope.abs()));
    // Normals lean away from what rises. Spread over 8 bits as far as they go, with z as 1.
    let encode = |slope: f64| {
        let share = if steepest > 0.0 { -slope / steepest } else { 0.0 };
        ((share + 1.0) / 2.0 * 255.0 + 0.5).floor() as u8
    };
    let texels = (0..count).map(slopes).map(|[x, y]| [encode(x), encode(y), 255]).collect();
    NormalsOfHeights { texels, steepest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_by_hand() {
        // Rising by 1/4 a texel to the right, and falling back at the seam: 1/4, 1/4, then (0 - 1/2) / 2 and so on.
        let row = [0.0, 0.25, 0.5, 0.75];
        let made = normals_of_heights(|i| row[i], 4, 1);
        // At x = 0 the neighbours are 0.25 and 0.75: -1/4; at 1 and 2 +1/4; at 3 they are 0 and 0.5: -1/4.
        assert_eq!(made.steepest, 0.25);
        assert_eq!(made.texels.iter().map(|t| t[0]).collect::<Vec<_>>(), [255, 0, 0, 255]);
        assert!(made.texels.iter().all(|t| t[1] == 128 && t[2] == 255));
        // The same down a column: rising downwards, normals lean up.
        let made = normals_of_heights(|i| row[i], 1, 4);
        assert_eq!(made.texels.iter().map(|t| t[1]).collect::<Vec<_>>(), [0, 255, 255, 0]);
        assert_eq!(normals_of_heights(|_| 0.5, 3, 2).steepest, 0.0);
    }
}
