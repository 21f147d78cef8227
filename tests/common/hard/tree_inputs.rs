//! Primitives that are hard to build a tree over: equal, evenly spaced, nested, spread over many powers of two.

use glam::DVec3;

use super::Corners;
use super::meshes::{box_mesh, shuffle};
use crate::common::Numbers;

/// The same triangle over and over. Its centroid is (0, 0, 5).
pub fn coincident(count: usize) -> Vec<Corners> {
    vec![[DVec3::new(-3.0, -3.0, 5.0), DVec3::new(6.0, -3.0, 5.0), DVec3::new(-3.0, 6.0, 5.0)]; count]
}

/// A triangle of side 1, moved by 0, 1, 2, ... times `step`.
pub fn row(count: usize, step: DVec3) -> Vec<Corners> {
    (0..count).map(|i| [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| p + step * i as f64)).collect()
}

/// A square fence: triangles of side 1 standing upright in `n` rows of `n` at whole numbers.
pub fn fence(n: usize) -> Vec<Corners> {
    (0..n * n)
        .map(|i| {
            [DVec3::ZERO, DVec3::X, DVec3::Z].map(|p| p + DVec3::new((i % n) as f64, (i / n) as f64, 0.0))
        })
        .collect()
}

/// One triangle within the other, each larger than the one before by a factor, all about (0, 0, z) and all met by the z
/// axis; they lie at heights of their own, which grow as they do.
pub fn nested(count: usize, factor: f64, least: f64) -> Vec<Corners> {
    (0..count)
        .map(|i| {
            let size = least * factor.powi(i as i32);
            let corners =
                [DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::new(0.0, 2.0, 1.0)];
            corners.map(|p| super::single(p * size))
        })
        .collect()
}

/// Clusters of 8 needles that share a box, in a nest: each cluster's box is larger than the one before by 1.01. Every
/// needle runs along a diagonal of its cluster's box, and one more triangle, given first, lies across the innermost
/// one.
///
/// A tree over them is as deep as there are clusters, and a ray through the middle has every cluster waiting for it.
pub fn nested_clusters(clusters: usize) -> Vec<Corners> {
    let target = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)];
    let mut all = vec![target.map(|p| p * 0.25)];
    for cluster in 0..clusters {
        let size = 1.01f64.powi(cluster as i32);
        for needle in 0..8 {
            // From one corner of the box to the opposite one, a little to the side in the middle.
            let sign = |bit: usize| if needle >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let (y, z) = (sign(0), sign(1));
            let corner = DVec3::new(1.0, y, z);
            let side = DVec3::new(0.0, z, y) * if needle < 4 { 1e-3 } else { -1e-3 };
            all.push([corner, -corner, corner * 0.5 + side].map(|p| super::single(p * size)));
        }
    }
    all
}

/// Triangles of random sizes over the given powers of two, in random order, each with a corner near the origin.
pub fn octaves(count: usize, least: i32, greatest: i32, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    let mut all: Vec<Corners> = (0..count)
        .map(|i| {
            let exponent = least + (i as i32) % (greatest - least + 1);
            let size = f64::from(exponent).exp2();
            [(); 3].map(|()| super::single(numbers.vector() * size))
        })
        .collect();
    shuffle(&mut all, &mut numbers);
    all
}

/// Large triangles at odd angles through many small ones: what builders cut to pieces before they start.
pub fn to_be_split(large: usize, small: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    let mut all: Vec<Corners> =
        (0..large).map(|_| [(); 3].map(|()| super::single(numbers.vector() * 100.0))).collect();
    for _ in 0..small {
        let centre = numbers.vector() * 100.0;
        all.push([(); 3].map(|()| super::single(centre + numbers.vector() * 0.5)));
    }
    shuffle(&mut all, &mut numbers);
    all
}

/// Boxes whose extents are 255 times a power of two and up to two steps of f32 more or less.
pub fn extents_of_255(count: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .flat_map(|_| {
            let extent = |numbers: &mut Numbers| {
                let whole = 255.0 * f64::from(numbers.below(8) as i32 - 6).exp2() as f32;
                f64::from(f32::from_bits(whole.to_bits() + numbers.below(5) as u32 - 2))
            };
            let size = DVec3::new(extent(&mut numbers), extent(&mut numbers), extent(&mut numbers));
            let min = super::single(numbers.vector() * 100.0);
            box_mesh(min, super::single(min + size))
        })
        .collect()
}
