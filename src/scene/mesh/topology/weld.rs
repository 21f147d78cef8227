//! Welding of vertices by exact position.

use glam::DVec3;
use rayon::prelude::*;

/// The triangles with each corner replaced by the first position that equals it.
pub(super) fn welded_corners(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let first = first_equal(positions);
    triangles.par_iter().map(|triangle| triangle.map(|corner| first[corner as usize])).collect()
}

/// For each position, the index of the first that equals it.
fn first_equal(positions: &[DVec3]) -> Vec<u32> {
    // Sorted by a hash, so that most comparisons are of one integer.
    let keyed = positions.par_iter().enumerate().map(|(index, &position)| (hash(position), index as u32));
    let mut keyed: Vec<(u64, u32)> = keyed.collect();
    let rest = |index: u32| (bits(positions[index as usize]), index);
    keyed.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| rest(a.1).cmp(&rest(b.1))));
    let mut first = vec![0; positions.len()];
    let is_equal = |a: &(u64, u32), b: &(u64, u32)| a.0 == b.0 && rest(a.1).0 == rest(b.1).0;
    for equal in keyed.chunk_by(is_equal) {
        equal.iter().for_each(|&(_, index)| first[index as usize] = equal[0].1);
    }
    first
}

/// The number of distinct vertices.
pub(super) fn count_vertices(corners: &[[u32; 3]], positions: usize) -> usize {
    let mut is_used = vec![false; positions];
    corners.as_flattened().iter().for_each(|&corner| is_used[corner as usize] = true);
    is_used.into_iter().filter(|&used| used).count()
}

fn bits(position: DVec3) -> [u64; 3] {
    // -0 + 0 is 0.
    (position + 0.0).to_array().map(f64::to_bits)
}

fn hash(position: DVec3) -> u64 {
    // The finaliser of SplitMix64 (Steele, Lea and Flood, Fast Splittable Pseudorandom Number Generators, 2014).
    bits(position).into_iter().fold(0, |hash: u64, bits| {
        let mut z = hash.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ bits;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}
