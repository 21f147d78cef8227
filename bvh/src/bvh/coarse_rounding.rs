//! [`CoarseRounding`]: triangles that the precision of a tier does not resolve.

use super::Primitive;
use crate::geometry::{Numerics, Precision, PrimId, Triangle};

/// Triangles of which rounding to the precision of a tier moves a corner by more than the length of the shortest edge.
/// Edges of length 0 do not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoarseRounding {
    numerics: Numerics,
    /// The number of these triangles.
    pub triangles: usize,
    /// The first of them.
    pub first: Option<PrimId>,
}

impl CoarseRounding {
    /// No triangles yet, of a structure of this tier.
    pub fn new(numerics: Numerics) -> Self {
        CoarseRounding { numerics, triangles: 0, first: None }
    }

    /// Adds a primitive, not rounded yet. Tiers that keep corners in f64 resolve every triangle.
    pub fn add(&mut self, id: PrimId, primitive: &Primitive) {
        let precision = self.numerics.precision();
        if let (Precision::Single, Primitive::Triangle(triangle)) = (precision, primitive)
            && is_coarse(triangle, precision)
        {
            self.triangles += 1;
            self.first.get_or_insert(id);
        }
    }
}

fn is_coarse(Triangle(corners): &Triangle, precision: Precision) -> bool {
    let moves = corners.map(|p| (p.map(|c| precision.round(c)) - p).length_squared());
    let most = moves.into_iter().fold(0.0, f64::max);
    if most == 0.0 {
        return false;
    }
    let [a, b, c] = *corners;
    let edges = [b - a, c - b, a - c].map(|edge| edge.length_squared());
    most > edges.into_iter().filter(|&edge| edge > 0.0).fold(f64::INFINITY, f64::min)
}

impl std::fmt::Display for CoarseRounding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let CoarseRounding { numerics, triangles, first } = self;
        write!(f, "rounding to f32, in tier {}, moves corners of {triangles} triangles", numerics.name())?;
        if let Some(PrimId(first)) = first {
            write!(f, " (the first is {first})")?;
        }
        f.write_str(
            " by more than their shortest edge; the tiers double and exact keep f64, or move the mesh to the origin",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coarse(numerics: Numerics, corners: [[f64; 3]; 3]) -> usize {
        let mut rounding = CoarseRounding::new(numerics);
        rounding.add(PrimId(7), &corners.into());
        assert_eq!(rounding.first, (rounding.triangles > 0).then_some(PrimId(7)));
        rounding.triangles
    }

    /// At 2^20, f32 has steps of 1/8, so a coordinate of 2^20 + 1/16 - 2^-10 moves by 1/16 - 2^-10 to 2^20.
    #[test]
    fn a_move_beyond_the_shortest_edge_is_coarse() {
        let far = 1048576.0;
        let (move_, o) = (0.0625 - 1.0 / 1024.0, far + 0.0625 - 1.0 / 1024.0);
        let triangle = |edge: f64| [[o, far, far], [o, far + edge, far], [o, far, far + 1.0]];
        for numerics in [Numerics::Fast, Numerics::Watertight] {
            // Edges of multiples of 1/8 round to themselves.
            assert_eq!(coarse(numerics, triangle(0.125)), 0);
            let short = 0.5 * move_;
            assert_eq!(coarse(numerics, [[o, far, far], [o, far + short, far], [o, far, far + 1.0]]), 1);
            // Corners that are f32 do not move, however short an edge is; an edge of length 0 does not count.
            assert_eq!(coarse(numerics, [[far, 0.0, 0.0], [far, 1e-30f32.into(), 0.0], [far, 0.0, 1.0]]), 0);
            assert_eq!(coarse(numerics, [[o, far, far], [o, far, far], [o, far, far + 1.0]]), 0);
        }
        for numerics in [Numerics::Double, Numerics::Exact] {
            assert_eq!(coarse(numerics, triangle(1e-9)), 0);
        }
    }
}
