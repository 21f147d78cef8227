//! [`CoarseRounding`]: triangles that the precision of a tier does not resolve.

use std::collections::HashMap;

use glam::DVec3;

use super::Primitive;
use crate::geometry::{Numerics, Precision, PrimId, Triangle};

/// Triangles that rounding to the precision of a tier changes in kind: a corner then coincides with another vertex, the
/// plane with another plane of constant x, y or z, or the front becomes the back. So thin walls and small parts vanish
/// far from the origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoarseRounding {
    numerics: Numerics,
    /// The number of these triangles.
    pub triangles: usize,
    /// The first of them.
    pub first: Option<PrimId>,
}

/// Numbers that differ by less, relative to the coordinates, are not distinct: the rounding of some operations in f64.
const SAME: f64 = 32.0 * f64::EPSILON;

impl CoarseRounding {
    /// Those of primitives, not rounded yet, with consecutive ids. Tiers that keep corners in f64 resolve every
    /// triangle.
    pub fn of<I: IntoIterator<Item = Primitive>>(numerics: Numerics, primitives: impl Fn() -> I) -> Self {
        let mut coarse = CoarseRounding { numerics, triangles: 0, first: None };
        let triangles = || {
            (0..).zip(primitives()).filter_map(|(id, primitive)| match primitive {
                Primitive::Triangle(Triangle(corners)) => Some((PrimId(id), corners)),
                Primitive::Analytic(_) => None,
            })
        };
        let rounded = |p: DVec3| p.map(|x| numerics.precision().round(x));
        let is_kept = |corners: [DVec3; 3]| corners.iter().all(|&p| rounded(p) == p);
        if numerics.precision() == Precision::Double || triangles().all(|(_, corners)| is_kept(corners)) {
            return coarse;
        }
        // The corners of a triangle, and its plane if that has a constant coordinate.
        let parts = |corners: [DVec3; 3]| {
            let axis = (0..3).find(|&axis| corners.iter().all(|p| p[axis] == corners[0][axis]));
            let plane = axis.map(|axis| (1 + axis, DVec3::AXES[axis] * corners[0][axis]));
            corners.map(|p| (0, p)).into_iter().chain(plane)
        };
        // -0 + 0 is 0.
        let key = |(kind, p)| (kind, rounded(p).to_array().map(|x| (x + 0.0).to_bits()));
        // Of each rounded part the first that is rounded to it, and whether a distinct one is, too.
        let mut known: HashMap<(usize, [u64; 3]), (DVec3, bool)> = HashMap::new();
        for (kind, p) in triangles().flat_map(|(_, corners)| parts(corners)) {
            let (first, coincides) = known.entry(key((kind, p))).or_insert((p, false));
            *coincides |= (*first - p).abs().max_element() > SAME * p.abs().max_element();
        }
        for (id, corners) in triangles() {
            let coincides = parts(corners).any(|part| known[&key(part)].1);
            if coincides || is_turned(corners, corners.map(rounded)) {
                coarse.triangles += 1;
                coarse.first.get_or_insert(id);
            }
        }
        coarse
    }
}

/// Whether rounding takes the front of a triangle to its back, or its area, unless that is within [`SAME`] of 0.
fn is_turned(before: [DVec3; 3], after: [DVec3; 3]) -> bool {
    let [normal, rounded] = [before, after].map(|corners| Triangle(corners).normal());
    let [a, b, c] = before;
    let size = before.iter().fold(0.0, |size: f64, p| size.max(p.abs().max_element()));
    normal.dot(rounded) <= 0.0 && normal.length() > SAME * size * ((b - a).length() + (c - a).length())
}

impl std::fmt::Display for CoarseRounding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let CoarseRounding { numerics, triangles, first } = self;
        let name = numerics.name();
        write!(f, "rounding to f32, in tier {name}, merges vertices or planes of {triangles} triangles")?;
        if let Some(PrimId(first)) = first {
            write!(f, " (the first is {first})")?;
        }
        f.write_str(
            " or turns them over; the tiers double and exact keep f64, or move the mesh to the origin",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coarse(numerics: Numerics, triangles: &[[[f64; 3]; 3]]) -> (usize, Option<u32>) {
        let found =
            CoarseRounding::of(numerics, || triangles.iter().map(|&corners| Primitive::from(corners)));
        (found.triangles, found.first.map(|id| id.0))
    }

    /// At 2^20, f32 has steps of 1/8. The first triangle of each case is far from the others.
    #[test]
    fn what_coincides_or_turns_over_is_coarse() {
        let far = 1_048_576.0;
        let away = [[-far, 0.0, 0.0], [-far, 1.0, 0.0], [-far, 0.0, 1.0]];
        let square = |x: f64| [[x, far, far], [x, far + 1.0, far], [x, far, far + 1.0]];
        let larger = |x: f64| [[x, far - 8.0, far], [x, far + 9.0, far], [x, far, far + 17.0]];
        // Both sides of a wall, of the same triangles and of others, and of a tilted one.
        let tilted =
            |d: f64| [[far + d, 0.0, far], [far + d, far, far + 1.0], [far + 1.0 + d, 0.0, far + 1.0]];
        let sides = [
            ([square(far), square(far + 1e-3)], 2),
            ([square(far), larger(far + 1e-3)], 2),
            ([tilted(0.0), tilted(1e-3)], 2),
            // Distinct after rounding.
            ([square(far), square(far + 0.125)], 0),
            // Equal but for rounding in f64, whose steps are 2^-32 there.
            ([square(far), larger(far + 4e-9)], 0),
            ([square(far), square(far + 4e-9)], 0),
        ];
        // An edge of 1/100 becomes 0, and a height of 1/32. In the third, the cross product of the edges is
        // 0.06 * 1.1 - 0.065 * 1 > 0 and becomes 0 * 1.125 - 0.125 * 1. The last changes its shape only.
        let alone = [
            ([[far, far, far], [far, far + 0.01, far], [far, far, far + 1.0]], 1),
            ([[far, far, 0.5], [far + 1.0, far, 0.5], [far + 2.0, far + 1.0 / 32.0, 0.5]], 1),
            ([[far, far, 0.0], [far + 0.06, far + 0.065, 0.0], [far + 1.0, far + 1.1, 0.0]], 1),
            ([[far, far, 0.0], [far + 0.25, far, 0.0], [far, far + 0.26, 0.0]], 0),
        ];
        let none = (0, None);
        for numerics in [Numerics::Fast, Numerics::Watertight] {
            let is = |count: usize| if count > 0 { (count, Some(1)) } else { none };
            for ([a, b], count) in sides {
                assert_eq!(coarse(numerics, &[away, a, b]), is(count), "{a:?} {b:?}");
            }
            for (triangle, count) in alone {
                assert_eq!(coarse(numerics, &[away, triangle]), is(count), "{triangle:?}");
            }
            // Corners that are f32 do not move, however short an edge is; an edge of length 0 does not count.
            assert_eq!(
                coarse(numerics, &[[[far, 0.0, 0.0], [far, 1e-30f32.into(), 0.0], [far, 0.0, 1.0]]]),
                none
            );
            assert_eq!(coarse(numerics, &[[[0.1, far, far], [0.1, far, far], [0.1, far, far + 1.0]]]), none);
        }
        for numerics in [Numerics::Double, Numerics::Exact] {
            assert_eq!(coarse(numerics, &[square(far), square(far + 1e-3)]), none);
        }
    }
}
