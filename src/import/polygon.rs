//! Polygons become triangles.
//!
//! Convex quadrilaterals, by far the most common, are cut along a diagonal here; everything else goes to `earcut`
//! (ear clipping with z-order hashing) in the plane of the polygon.

use glam::{DVec2, DVec3};

/// Cuts polygons into triangles; keeps its buffers from one to the next.
pub struct Triangulator {
    earcut: earcut::Earcut<f64>,
    flat: Vec<[f64; 2]>,
    out: Vec<u32>,
}

impl Triangulator {
    /// A triangulator with empty buffers.
    pub fn new() -> Self {
        Triangulator { earcut: earcut::Earcut::new(), flat: Vec::new(), out: Vec::new() }
    }

    /// Calls `emit` with the corners (counted from 0) of each triangle of the polygon. Returns whether the triangles
    /// cover the polygon; where they do not (it crosses itself) it is cut into a fan instead.
    pub fn triangulate(&mut self, corners: &[DVec3], mut emit: impl FnMut([usize; 3])) -> bool {
        let n = corners.len();
        if n <= 3 {
            if n == 3 {
                emit([0, 1, 2]);
            }
            return true;
        }
        let normal = newell_normal(corners);
        if n == 4 && is_convex(corners, normal) {
            emit([0, 1, 2]);
            emit([0, 2, 3]);
            return true;
        }
        self.flat.clear();
        self.flat.extend(corners.iter().map(|&p| project(p, normal).to_array()));
        self.out.clear();
        self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.out);
        let area = |a: usize, b: usize, c: usize| {
            let [a, b, c] = [a, b, c].map(|i| DVec2::from(self.flat[i]));
            (b - a).perp_dot(c - a)
        };
        let whole: f64 = (1..n - 1).map(|i| area(0, i, i + 1)).sum::<f64>().abs();
        let cut: f64 =
            self.out.chunks_exact(3).map(|t| area(t[0] as usize, t[1] as usize, t[2] as usize).abs()).sum();
        // Both are sums of n rounded areas; a self-crossing polygon differs in the first digits.
        let covers = self.out.len() >= 3 && (cut - whole).abs() <= whole * 1e-6;
        if covers {
            self.out.chunks_exact(3).for_each(|t| emit([t[0] as usize, t[1] as usize, t[2] as usize]));
        } else {
            (1..n - 1).for_each(|i| emit([0, i, i + 1]));
        }
        covers
    }
}

/// Twice the area vector of a polygon (Newell's method): its direction is the normal of the best plane.
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&a, &b)| (a - origin).cross(b - origin)).sum()
}

fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let n = corners.len();
    (0..n).all(|i| {
        let [a, b, c] = [corners[i], corners[(i + 1) % n], corners[(i + 2) % n]];
        (b - a).cross(c - b).dot(normal) > 0.0
    })
}

/// Drops the axis that the normal is nearest to, keeping the orientation.
fn project(p: DVec3, normal: DVec3) -> DVec2 {
    let a = normal.abs();
    if a.x >= a.y && a.x >= a.z {
        DVec2::new(p.y, p.z)
    } else if a.y >= a.z {
        DVec2::new(p.z, p.x)
    } else {
        DVec2::new(p.x, p.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area_of(corners: &[DVec3]) -> (f64, usize, bool) {
        let (mut area, mut count) = (0.0, 0);
        let covers = Triangulator::new().triangulate(corners, |[a, b, c]| {
            area += (corners[b] - corners[a]).cross(corners[c] - corners[a]).length() / 2.0;
            count += 1;
        });
        (area, count, covers)
    }

    /// Tilted out of every axis plane, so that the projection is exercised.
    fn tilted(flat: &[[f64; 2]]) -> Vec<DVec3> {
        let (u, v) = (DVec3::new(2.0, 1.0, 2.0) / 3.0, DVec3::new(-2.0, 2.0, 1.0) / 3.0);
        flat.iter().map(|[x, y]| *x * u + *y * v + DVec3::new(5.0, -3.0, 1.0)).collect()
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        // An L of three unit squares; an arrow head: the triangle (0,0) (4,0) (2,3) of area 6 less (0,0) (4,0) (2,1)
        // of area 2.
        let l = tilted(&[[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]]);
        let arrow = tilted(&[[0., 0.], [2., 1.], [4., 0.], [2., 3.]]);
        for (corners, expected, triangles) in [(l, 3.0, 4), (arrow, 4.0, 2)] {
            let (area, count, covers) = area_of(&corners);
            assert!((area - expected).abs() < 1e-12 * expected, "{area}");
            assert_eq!((count, covers), (triangles, true));
        }
    }

    #[test]
    fn a_convex_quad_is_cut_from_its_first_corner() {
        let mut triangles = Vec::new();
        let quad = tilted(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
        assert!(Triangulator::new().triangulate(&quad, |t| triangles.push(t)));
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_bow_tie_is_reported_and_still_drawn() {
        let (_, count, covers) = area_of(&tilted(&[[0., 0.], [2., 2.], [2., 0.], [0., 1.]]));
        assert!(!covers);
        assert_eq!(count, 2);
    }
}
