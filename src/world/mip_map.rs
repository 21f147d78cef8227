//! Mip maps (Williams, Pyramidal Parametrics, SIGGRAPH 1983).
//!
//! A texel of a level is the mean of the area that it covers of the level above. A side of odd length is covered by three texels per
//! texel of the next level, the outer ones weighted by their overlap (Guthe and Heckbert, Non-Power-of-Two Mipmap Creation,
//! NVIDIA 2005). So every level has the mean of the image. Levels are computed in f32, in the decoded values of the image, and stored
//! in 16 bits.

use glam::Vec3;
use rayon::prelude::*;

use crate::scene::TexelEncoding;

/// The levels of an image below its full size.
pub struct MipMap {
    levels: Vec<MipLevel>,
}

/// A level of a mip map.
pub struct MipLevel {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// 65535 times the values, row by row from the top.
    texels: Vec<[u16; 3]>,
}

impl MipLevel {
    /// The values of the texel at `index`, 0 to 1; `encoding` is that of the image.
    #[inline]
    pub fn texel(&self, index: usize, encoding: TexelEncoding) -> [f64; 3] {
        encoding.numbers(self.texels[index], u16::MAX, |c| f64::from(c) * (1.0 / 65535.0))
    }
}

impl MipMap {
    /// The mip map of an image of `width` by `height` texels with the values `texel(index)`, 0 to 1.
    pub fn new(width: u32, height: u32, texel: impl Fn(usize) -> Vec3 + Sync) -> Self {
        let mut levels = Vec::new();
        let mut last: Option<(Vec<Vec3>, [u32; 2])> = None;
        let mut size = [width, height];
        while size != [1, 1] {
            let (texels, below) = match &last {
                None => halve(size, &texel),
                Some((above, _)) => halve(size, &|i: usize| above[i]),
            };
            let kept = texels.par_iter().map(|c| c.to_array().map(quantise)).collect();
            levels.push(MipLevel { width: below[0], height: below[1], texels: kept });
            size = below;
            last = Some((texels, below));
        }
        MipMap { levels }
    }

    /// The levels, beginning with that of half the image's size. Empty for an image of one texel.
    pub fn levels(&self) -> &[MipLevel] {
        &self.levels
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(level.texels.as_slice())).sum()
    }
}

fn quantise(value: f32) -> u16 {
    (value * 65535.0 + 0.5) as u16
}

/// The level below one of `size`, and its size.
fn halve([width, height]: [u32; 2], texel: &(impl Fn(usize) -> Vec3 + Sync)) -> (Vec<Vec3>, [u32; 2]) {
    let below = [(width / 2).max(1), (height / 2).max(1)];
    let mut texels = vec![Vec3::ZERO; below[0] as usize * below[1] as usize];
    let columns: Vec<[(usize, f32); 3]> = (0..below[0]).map(|x| shares(x, width)).collect();
    texels.par_chunks_mut(below[0] as usize).zip(0..below[1]).for_each(|(row, y)| {
        for (texel_below, columns) in row.iter_mut().zip(&columns) {
            for (y, share_y) in shares(y, height).into_iter().filter(|(_, share)| *share > 0.0) {
                for &(x, share_x) in columns.iter().filter(|(_, share)| *share > 0.0) {
                    *texel_below += texel(y * width as usize + x) * (share_x * share_y);
                }
            }
        }
    });
    (texels, below)
}

/// The texels along a side of length `size` that texel `i` of the level below covers, with their weights, which sum to 1.
fn shares(i: u32, size: u32) -> [(usize, f32); 3] {
    let first = 2 * i as usize;
    match (size, size % 2) {
        (1, _) => [(0, 1.0), (0, 0.0), (0, 0.0)],
        (_, 0) => [(first, 0.5), (first + 1, 0.5), (0, 0.0)],
        _ => {
            // With 2 m + 1 texels on this side, one of the level below covers (2 m + 1) / m and starts i / m into the first.
            let share = |part: u32| part as f32 / size as f32;
            [(first, share(size / 2 - i)), (first + 1, share(size / 2)), (first + 2, share(i + 1))]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image with known mean: texel k of n has the value k / (n - 1), so the mean is 1/2.
    fn ramp(width: u32, height: u32) -> MipMap {
        let last = (width * height - 1).max(1) as f32;
        MipMap::new(width, height, |i| Vec3::new(i as f32 / last, 1.0 - i as f32 / last, 0.25))
    }

    #[test]
    fn every_level_keeps_the_mean() {
        for (width, height) in
            [(8, 8), (7, 5), (1, 9), (9, 1), (13, 2), (255, 3), (31, 33), (2, 1), (640, 479)]
        {
            let mip_map = ramp(width, height);
            let mut size = [width, height];
            for level in mip_map.levels() {
                size = size.map(|side| (side / 2).max(1));
                assert_eq!([level.width, level.height], size);
                let count = size[0] as usize * size[1] as usize;
                let mut mean = [0.0; 3];
                for i in 0..count {
                    mean.iter_mut()
                        .zip(level.texel(i, TexelEncoding::Data))
                        .for_each(|(sum, c)| *sum += c / count as f64);
                }
                // Half a step of 16-bit quantisation, and f32 sums of at most 9 terms per level.
                let bound = 0.5 / 65535.0 + 12.0 * 20.0 * f64::from(f32::EPSILON);
                for (mean, expected) in mean.iter().zip([0.5, 0.5, 0.25]) {
                    assert!((mean - expected).abs() <= bound, "{width}x{height}: {mean} is not {expected}");
                }
            }
            assert_eq!(size, [1, 1]);
            assert_eq!(mip_map.levels().len(), (width.max(height) as f64).log2().floor() as usize);
        }
        assert!(ramp(1, 1).levels().is_empty());
    }

    #[test]
    fn three_texels_become_one_of_equal_shares_and_five_become_two_by_hand() {
        // 3 -> 1: a third each. 5 -> 2: a texel below covers 2.5: (1, 1, 1/2) / 2.5 and (1/2, 1, 1) / 2.5.
        assert_eq!(shares(0, 3).map(|(i, _)| i), [0, 1, 2]);
        assert!(shares(0, 3).iter().all(|(_, s)| (s - 1.0 / 3.0).abs() < 1e-7));
        assert_eq!(shares(0, 5), [(0, 0.4), (1, 0.4), (2, 0.2)]);
        assert_eq!(shares(1, 5), [(2, 0.2), (3, 0.4), (4, 0.4)]);
        let mip_map = MipMap::new(5, 1, |i| Vec3::splat([0.0, 0.5, 1.0, 0.5, 0.0][i]));
        // 0.4 * 0 + 0.4 * 0.5 + 0.2 * 1 = 0.4 on both sides, then 0.4.
        for level in mip_map.levels() {
            assert!((level.texel(0, TexelEncoding::Data)[0] - 0.4).abs() < 1e-5);
        }
    }
}
