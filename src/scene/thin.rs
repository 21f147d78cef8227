//! Which triangles of a mesh may lose their area where it is placed.
//!
//! Rounding makes a line of a triangle that is thinner than the error of its corners. Most are far from it, and a mesh
//! may have thousands of places: so the triangles are put in order of their heights once, and each place looks at those
//! that are thin enough only.

use glam::{DMat3, DVec3};

use super::Mesh;

/// The triangles of a mesh, the thinnest first.
pub struct Thin {
    /// A height that the triangle has at least, and the triangle.
    by_height: Vec<(f64, u32)>,
    reach: DVec3,
}

impl Thin {
    /// Looks at every triangle of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let height = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            let height = (b - a).cross(c - a).length() / longest;
            // The cross product is off by a few roundings of the products of edges, each of that length at most.
            let least = height - 32.0 * f64::EPSILON * longest;
            // What is not a number is as good as none.
            if least > 0.0 && least.is_finite() { least } else { 0.0 }
        };
        let mut by_height: Vec<(f64, u32)> = mesh.triangles.iter().map(height).zip(0..).collect();
        by_height.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let reach = mesh.corners().fold(DVec3::ZERO, |reach, p| p.abs().max(reach));
        Thin { by_height, reach }
    }

    /// The largest coordinates of the mesh.
    pub fn reach(&self) -> DVec3 {
        self.reach
    }

    /// The triangles whose height may be `error` or less after a linear map, in no order.
    ///
    /// A point at a distance from a line is at no less than the least singular value times that from the line's image,
    /// and the smallest height is that over the longest side, whichever that is.
    pub fn below(&self, error: f64, linear: &DMat3) -> impl Iterator<Item = u32> + '_ {
        let limit = error / least_stretch(linear);
        let count = self.by_height.partition_point(|(height, _)| height.is_nan() || *height <= limit);
        // Without a limit, all.
        let count = if limit.is_finite() { count } else { self.by_height.len() };
        self.by_height[..count].iter().map(|&(_, triangle)| triangle)
    }
}

/// A factor that a linear map shortens nothing by more than; 0 where none is sure.
fn least_stretch(linear: &DMat3) -> f64 {
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let inverse = linear.inverse();
    let condition = norm(linear) * norm(&inverse);
    // The least singular value is one over the norm of the inverse. Of 53 bits the condition takes this many.
    if condition < (1u64 << 40) as f64 { 0.5 / norm(&inverse) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_thin_triangles_are_looked_at() {
        // Heights over the longest side: 1 / sqrt 2, 1e-6, and 0.
        let positions =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.5, 1e-6, 0.0), DVec3::new(0.5, 0.0, 0.0)];
        let triangles = vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]];
        let thin = Thin::of(&Mesh { positions: positions.to_vec(), triangles, ..Mesh::default() });
        let below = |error, scale| {
            let mut found: Vec<u32> = thin.below(error, &DMat3::from_diagonal(scale)).collect();
            found.sort_unstable();
            found
        };
        assert_eq!(below(1e-9, DVec3::ONE), [2]);
        assert_eq!(below(1e-5, DVec3::ONE), [1, 2]);
        // Squeezed a thousandfold along an axis, a height of 1e-6 may become 1e-9.
        assert_eq!(below(1e-9, DVec3::new(1.0, 1e-3, 1.0)), [1, 2]);
        assert_eq!(below(1e-9, DVec3::new(1.0, 0.0, 1.0)), [0, 1, 2]);
        assert_eq!(below(1e-9, DVec3::splat(f64::NAN)), [0, 1, 2]);
    }
}
