//! Meshes: closed ones with many edges to be met exactly, and open ones that are thin, giant, doubled or nearly so.

use std::collections::HashMap;

use glam::DVec3;

use super::{Corners, single};
use crate::common::Numbers;

/// A sphere made of `20 * 4^level` triangles, closed, its corners in f64.
pub fn icosphere(level: u32, centre: DVec3, radius: f64) -> Vec<Corners> {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    // The twelve points (0, ±1, ±g) and their cyclic permutations; two of them are neighbours at distance 2.
    let mut points: Vec<DVec3> = Vec::new();
    for [y, z] in [[-1.0, -g], [-1.0, g], [1.0, -g], [1.0, g]] {
        points.extend([DVec3::new(0.0, y, z), DVec3::new(z, 0.0, y), DVec3::new(y, z, 0.0)]);
    }
    let near = |i: usize, j: usize| (points[i].distance(points[j]) - 2.0).abs() < 1e-9;
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            faces.extend((j + 1..12).filter(|&k| near(i, j) && near(j, k) && near(k, i)).map(|k| [i, j, k]));
        }
    }
    for _ in 0..level {
        let mut middles: HashMap<[usize; 2], usize> = HashMap::new();
        let mut middle = |i: usize, j: usize| {
            *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                points.push((points[i] + points[j]) / 2.0);
                points.len() - 1
            })
        };
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    // One rounding for every point, whatever triangles it belongs to.
    let points: Vec<DVec3> = points.into_iter().map(|p| centre + radius * p.normalize()).collect();
    faces.into_iter().map(|face| face.map(|i| points[i])).collect()
}

/// A height field over `size` x `size` squares of side 1, of whole heights below 4; every edge and corner can be met.
pub fn height_field(size: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    let heights: Vec<f64> = (0..(size + 1) * (size + 1)).map(|_| numbers.below(4) as f64).collect();
    let point = |x: usize, y: usize| DVec3::new(x as f64, y as f64, heights[y * (size + 1) + x]);
    (0..size * size)
        .flat_map(|i| {
            let (x, y) = (i % size, i / size);
            let [a, b, c, d] = [point(x, y), point(x + 1, y), point(x + 1, y + 1), point(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// The surface of a cube from `-n` to `n`, of squares of side 1 with corners at whole numbers, cut along diagonals.
/// Closed.
pub fn cube(n: i32) -> Vec<Corners> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for side in [-n, n] {
            let point = |u: i32, v: i32| {
                let mut p = DVec3::splat(f64::from(side));
                p[(axis + 1) % 3] = f64::from(u);
                p[(axis + 2) % 3] = f64::from(v);
                p
            };
            for u in -n..n {
                for v in -n..n {
                    let [a, b, c, d] = [point(u, v), point(u + 1, v), point(u + 1, v + 1), point(u, v + 1)];
                    all.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    all
}

/// Two cones with a common rim of `valence` points of a circle, their tips at (0, 0, ±0.7). Closed.
pub fn bicone(valence: usize) -> Vec<Corners> {
    let rim = |i: usize| {
        let angle = (i % valence) as f64 / valence as f64 * std::f64::consts::TAU;
        single(DVec3::new(angle.cos(), angle.sin(), 0.0))
    };
    let tip = single(DVec3::new(0.0, 0.0, 0.7));
    (0..valence).flat_map(|i| [[tip, rim(i), rim(i + 1)], [-tip, rim(i + 1), rim(i)]]).collect()
}

/// A fan or cap: triangles around (0, 0, 0) over a circle of `count` points, all in a plane.
pub fn fan(count: usize) -> Vec<Corners> {
    bicone(count)
        .into_iter()
        .step_by(2)
        .map(|corners| corners.map(|p| p * DVec3::new(1.0, 1.0, 0.0)))
        .collect()
}

/// Triangles of length 1 and the given width around `centre`, turned at random.
pub fn slivers(count: usize, width: f64, centre: DVec3, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .map(|_| {
            let along = numbers.direction();
            let across = along.any_orthonormal_vector();
            let start = centre + numbers.vector();
            [start, start + along, start + along * 0.5 + across * width].map(single)
        })
        .collect()
}

/// A square of `n` x `n` tiles of two triangles at z = 0, every triangle given twice, the copies after all others.
pub fn doubled_tiles(n: usize) -> Vec<Corners> {
    let flat = |p: DVec3| p * DVec3::new(1.0, 1.0, 0.0);
    let once: Vec<Corners> = height_field(n, 0).into_iter().map(|corners| corners.map(flat)).collect();
    [once.clone(), once].concat()
}

/// Squares of side 2 around the z axis, at z = 1 and then each the given number of f32 steps above the one before, in
/// shuffled order; each is two triangles.
pub fn sheets(count: usize, steps: u32, seed: u64) -> Vec<Corners> {
    let mut heights: Vec<u32> = (0..count as u32).map(|i| 1f32.to_bits() + i * steps).collect();
    shuffle(&mut heights, &mut Numbers::new(seed));
    heights
        .into_iter()
        .flat_map(|bits| {
            let z = f64::from(f32::from_bits(bits));
            let [a, b, c, d] =
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z));
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// The floor of a scene of a few hundred units: a triangle two hundred times as large, at y = -500.
pub const GIANT: Corners = [
    DVec3::new(-10_000.0, -500.0, -10_000.0),
    DVec3::new(-10_000.0, -500.0, 100_000.0),
    DVec3::new(10_000.0, -500.0, -10_000.0),
];

/// The twelve triangles of the box from `min` to `max`.
pub fn box_mesh(min: DVec3, max: DVec3) -> Vec<Corners> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for side in [min, max] {
            let point = |u: DVec3, v: DVec3| {
                let mut p = side;
                p[(axis + 1) % 3] = u[(axis + 1) % 3];
                p[(axis + 2) % 3] = v[(axis + 2) % 3];
                p
            };
            let [a, b, c, d] = [point(min, min), point(max, min), point(max, max), point(min, max)];
            all.extend([[a, b, c], [a, c, d]]);
        }
    }
    all
}

/// Boxes of 100 x 100 x 1e-4 and the like, their thin side along each axis in turn. Each is closed.
pub fn thin_boxes(count: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .flat_map(|i| {
            let mut half = DVec3::splat(50.0);
            half[i % 3] = 0.5e-4;
            let centre = numbers.vector() * 100.0;
            box_mesh(single(centre - half), single(centre + half))
        })
        .collect()
}

/// Triangles of sizes from 1e-6 to 1e6, each about as far from the origin as it is large.
pub fn mixed_scales(count: usize, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .map(|_| {
            let size = 10f64.powf(numbers.signed() * 6.0);
            let centre = numbers.vector() * size;
            [(); 3].map(|()| single(centre + numbers.vector() * (size * 0.5)))
        })
        .collect()
}

/// Triangles of about the given size anywhere in the cube from -1 to 1.
pub fn soup(count: usize, size: f64, seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    (0..count)
        .map(|_| {
            let centre = numbers.vector();
            [(); 3].map(|()| single(centre + numbers.vector() * size))
        })
        .collect()
}

/// Puts `items` into an order of chance.
pub fn shuffle<T>(items: &mut [T], numbers: &mut Numbers) {
    for i in (1..items.len()).rev() {
        items.swap(i, numbers.below(i + 1));
    }
}

/// A closed mesh with T-vertices: of every other triangle one edge is split at a share of its length and the triangle
/// cut in two there, and a triangle with that edge and the new vertex, which has no area but for rounding, closes the
/// gap to the neighbour.
pub fn with_t_vertices(mesh: &[Corners], seed: u64) -> Vec<Corners> {
    let mut numbers = Numbers::new(seed);
    let mut split = Vec::new();
    for (index, &[a, b, c]) in mesh.iter().enumerate() {
        if index % 2 == 1 {
            split.push([a, b, c]);
            continue;
        }
        let share = if index % 4 == 0 { 0.5 } else { numbers.fine_unit() };
        let middle = single(a + share * (b - a));
        split.extend([[a, middle, c], [middle, b, c], [a, b, middle]]);
    }
    split
}
