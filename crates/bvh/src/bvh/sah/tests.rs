use std::ops::Range;

use glam::{DVec3, Vec3};
use obvhs::bvh2::Bvh2;

use super::{Areas, Budget, MAX_LEVELS, build, clip};
use crate::bvh::splitmix64::{GOLDEN, splitmix64};
use crate::geometry::Bounds;

type Triangles = Vec<[DVec3; 3]>;

/// Pseudorandom whole numbers.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        splitmix64(self.0) % end
    }

    /// A vector of whole numbers from -`most` to `most`.
    fn vector(&mut self, most: u64) -> DVec3 {
        DVec3::from([0; 3].map(|_| self.below(2 * most + 1) as f64 - most as f64))
    }
}

fn bounds(corners: &[DVec3; 3]) -> Bounds {
    let [a, b, c] = *corners;
    Bounds::rounded_out(a.min(b).min(c), a.max(b).max(c))
}

fn tree(triangles: &Triangles, budget: f32) -> Bvh2 {
    let boxes: Vec<Bounds> = triangles.iter().map(bounds).collect();
    build(&boxes, &|slot| Some(triangles[slot as usize]), Budget(budget))
}

fn holds(b: &Bounds, p: DVec3) -> bool {
    b.min.as_dvec3().cmple(p).all() && p.cmple(b.max.as_dvec3()).all()
}

/// Long triangles with whole coordinates, flat or thin ones among them.
fn large(count: usize, most: u64, numbers: &mut Numbers) -> Triangles {
    let one = |numbers: &mut Numbers| {
        let (a, b) = (numbers.vector(most), numbers.vector(most));
        let c = match numbers.below(3) {
            0 => numbers.vector(most),
            1 => b + numbers.vector(1),
            _ => ((a + b) / 2.0).round() + numbers.vector(2),
        };
        let mut corners = [a, b, c];
        if numbers.below(4) == 0 {
            let axis = numbers.below(3) as usize;
            corners.iter_mut().for_each(|corner| corner[axis] = a[axis]);
        }
        corners
    };
    (0..count).map(|_| one(numbers)).collect()
}

/// Points with weights of sixteenths: exact if coordinates are whole.
fn points(corners: &[DVec3; 3]) -> impl Iterator<Item = DVec3> {
    let [a, b, c] = *corners;
    let weights = |range: Range<i32>| range.map(f64::from);
    weights(0..17).flat_map(move |v| {
        weights(0..17 - v as i32).map(move |w| (a * (16.0 - v - w) + b * v + c * w) / 16.0)
    })
}

/// Where an edge crosses a plane, in whole numbers: the exact point is a quotient, compared with the boxes of both
/// sides.
///
/// The least error matters where that point is close to an f32 number, but is none: beside a corner of an edge whose
/// other corner is far away on the axis of the plane.
#[test]
fn cut_edges_are_within_the_parts_to_the_last_bit() {
    /// The scale that makes f32 from 2^-16 to 2^24 whole.
    const WHOLE: f64 = (1u64 << 40) as f64;
    let mut numbers = Numbers(1);
    for round in 0..40_000 {
        let most = [30, 1 << 12, 1 << 22][round % 3];
        // Not around 0, where f32 is finer than that.
        let mut corners = [0; 3].map(|_| numbers.vector(most) + (most + 1) as f64);
        let axis = numbers.below(3) as usize;
        let mut far = || if numbers.below(2) == 0 { 1.0 } else { f64::from(53 - most.ilog2()).exp2() };
        corners.iter_mut().for_each(|corner| corner[axis] *= far());
        let whole = bounds(&corners);
        let beside = corners[numbers.below(3) as usize][axis] as f32 + numbers.below(5) as f32 - 2.0;
        let at = beside.clamp(whole.min[axis], whole.max[axis]);
        let parts = [(whole.min[axis], at), (at, whole.max[axis])];
        let parts = parts.map(|(low, high)| clip::between(&corners, axis, low, high));
        for i in 0..3 {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            let at = f64::from(at);
            if (p[axis] < at) == (q[axis] < at) || q[axis] == at {
                continue;
            }
            let (along, across) = ((at - p[axis]) as i128, (q[axis] - p[axis]) as i128);
            for k in (0..3).filter(|&k| k != axis) {
                // The point times `across`, which is made positive.
                let sign = across.signum();
                let point = ((p[k] as i128 * across + (q[k] - p[k]) as i128 * along) * sign) << 40;
                for part in &parts {
                    assert!(part.min[axis] <= at as f32 && at as f32 <= part.max[axis]);
                    let low = (f64::from(part.min[k]) * WHOLE).ceil() as i128 * across * sign;
                    let high = (f64::from(part.max[k]) * WHOLE).floor() as i128 * across * sign;
                    assert!(low <= point && point <= high, "{corners:?}, axis {axis} at {at}, {part:?}");
                }
            }
        }
    }
}

/// Every point of a triangle is in one of its parts, at every scale; and no part leaves the bounds of its triangle.
#[test]
fn parts_cover_their_triangles() {
    let mut numbers = Numbers(2);
    for exponent in [-20, 0, 20, 90] {
        let scale = f64::from(exponent).exp2();
        let mut triangles = large(300, 1000, &mut numbers);
        // Small ones between them, in two rows, one of them at a corner of each large one.
        let small: Vec<DVec3> = triangles.iter().map(|corners| corners[0]).collect();
        triangles.extend(small.iter().map(|&p| [p, p + DVec3::X, p + DVec3::Y]));
        triangles.iter_mut().flatten().for_each(|corner| *corner *= scale);
        let tree = tree(&triangles, 2.0);
        assert!(tree.nodes.len() > 3 * triangles.len(), "hardly anything was split");
        let mut parts = vec![Vec::new(); triangles.len()];
        for leaf in tree.nodes.iter().filter(|node| node.is_leaf()) {
            parts[leaf.first_index as usize].push(Bounds { min: leaf.min, max: leaf.max });
        }
        for (corners, parts) in triangles.iter().zip(parts) {
            let whole = bounds(corners);
            assert!(parts.iter().all(|part| part.union(whole) == whole), "{corners:?}: {parts:?}");
            for point in points(corners) {
                assert!(parts.iter().any(|part| holds(part, point)), "{point} of {corners:?}: {parts:?}");
            }
        }
    }
}

/// A tree's leaves are `slots`, each at least once and at most `most` in all; parents are before their children and
/// hold exactly them. Returns the number of levels.
fn checked(tree: &Bvh2, slots: usize, most: usize) -> u32 {
    let mut levels = vec![0; tree.nodes.len()];
    let mut found = vec![false; slots];
    for (index, node) in tree.nodes.iter().enumerate() {
        if node.is_leaf() {
            assert_eq!(node.prim_count, 1);
            found[tree.primitive_indices[node.first_index as usize] as usize] = true;
            continue;
        }
        let first = node.first_index as usize;
        assert!(first > index);
        let below = levels[index] + 1;
        levels[first..first + 2].fill(below);
        let [a, b] = [&tree.nodes[first], &tree.nodes[first + 1]];
        assert_eq!((node.min, node.max), (a.min.min(b.min), a.max.max(b.max)));
    }
    assert!(found.into_iter().all(|found| found) && tree.nodes.len() < 2 * most);
    levels.into_iter().max().unwrap_or(0)
}

#[test]
fn hard_inputs_have_shallow_trees() {
    let unit = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let scaled = |by: f64| unit.map(|corner| corner * by);
    let row = |count: u32| (0..count).map(|i| unit.map(|corner| corner + DVec3::X * f64::from(i))).collect();
    let cases: [(&str, Triangles); 8] = [
        ("one", vec![unit]),
        ("two", vec![unit, scaled(2.0)]),
        ("five", row(5)),
        ("coincident", vec![unit; 100_000]),
        ("points", vec![[DVec3::ONE; 3]; 1000]),
        ("a row", row(10_000)),
        // Each object split would take one from the rest.
        ("nested", (0..200).map(|i| scaled(f64::from(i - 100).exp2())).collect()),
        ("areas beyond f32", (0..1000).map(|i| scaled(1e30 * f64::from(i + 1))).collect()),
    ];
    for (what, triangles) in cases {
        for budget in [0.0, 0.5] {
            let tree = tree(&triangles, budget);
            let most = triangles.len() + (triangles.len() as f32 * budget) as usize;
            let levels = checked(&tree, triangles.len(), most);
            assert!(levels <= MAX_LEVELS, "{what}: {levels} levels");
            if what == "coincident" {
                // 2^17 is the least power of two above them.
                assert_eq!(levels, 17);
            }
        }
    }
    assert!(tree(&Vec::new(), 0.5).nodes.is_empty());
}

#[test]
fn the_tree_does_not_depend_on_threads() {
    let mut numbers = Numbers(3);
    let triangles = large(40_000, 1 << 20, &mut numbers);
    let tree_by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| tree(&triangles, 0.3))
    };
    let [one, many] = [1, 5].map(tree_by);
    assert!(one.nodes.len() > 2 * triangles.len(), "nothing was split");
    assert_eq!(bytemuck::cast_slice::<_, u8>(&one.nodes), bytemuck::cast_slice::<_, u8>(&many.nodes));
}

/// The same triangles times a power of two have the same tree.
#[test]
fn the_tree_does_not_depend_on_scale() {
    let mut numbers = Numbers(4);
    let triangles = large(2000, 1 << 10, &mut numbers);
    let shape = |exponent: i32| {
        let scale = f64::from(exponent).exp2();
        let triangles = triangles.iter().map(|corners| corners.map(|corner| corner * scale)).collect();
        tree(&triangles, 0.3).nodes.iter().map(|node| (node.prim_count, node.first_index)).collect::<Vec<_>>()
    };
    let expected = shape(0);
    assert!([-60, 40, 80].into_iter().all(|exponent| shape(exponent) == expected));
}

/// Areas are those of boxes, times a common factor.
#[test]
fn areas_are_relative_to_the_root() {
    let cube = |side: f32| super::Aabb::new(Vec3::ZERO.into(), Vec3::splat(side).into());
    for side in [1e-40, 1e-20, 1.0, 1e20, 3e38] {
        let areas = Areas::of_root(&cube(side));
        let ratio = areas.of(&cube(side)) / areas.of(&cube(side / 2.0));
        // A side of 1e-40 has 17 bits.
        assert!((ratio - 4.0).abs() < 1e-3, "{side}: {ratio}");
    }
}

/// Triangles with the same centre, which no object split divides.
#[test]
fn triangles_of_one_centre_are_split_only_where_it_pays() {
    let leaves = |tree: &Bvh2| tree.nodes.iter().filter(|node| node.is_leaf()).count();
    // Between any two planes across x, the longest axis, the parts of both kinds together reach to all other sides of
    // their box of 3 x 2 x 2. Its half area is 6 + 6 + 4 = 16; those of the two sides of a plane sum up to 12 + 2 * 4 =
    // 20, and every triangle is on both. Halves of the list cost 16 per leaf.
    let corners = |side: f64| [[-1.5, side, side], [1.5, side, side], [side * 1.5, -side, -side]];
    let triangles: Triangles = (0..64).map(|i| corners([1.0, -1.0][i % 2]).map(DVec3::from)).collect();
    assert_eq!(leaves(&tree(&triangles, 4.0)), triangles.len());
    // Halves of a unit square cost 1 per leaf; a plane through the middle of its lower right triangle leaves 1/4 and 1/2.
    let flat: Triangles = vec![[DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y]; 64];
    assert!(leaves(&tree(&flat, 4.0)) > flat.len());
}
