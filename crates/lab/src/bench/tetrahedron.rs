//! A subdivided tetrahedron, a closed mesh with acute edges, and secondary rays from its edges.

use std::collections::HashMap;

use glam::{DQuat, DVec3};

use super::{Mesh, Numbers, Placement};
use kiln::bvh::Numerics;
use kiln::bvh::detail::SurfacePoint;

/// A regular tetrahedron with subdivided faces, rotated so that no face is axis-aligned. Its dihedral angles of 70.5
/// degrees are acute: a point on an edge that is offset along the normal of one face is behind the other face.
pub(crate) struct Tetrahedron {
    /// Triangles.
    pub mesh: Mesh,
    /// The triangles at its six edges, each with the first of its two corners on that edge.
    at_edges: Vec<(u32, usize)>,
}

impl Tetrahedron {
    /// `4 * 4^level` triangles, with the four vertices on the sphere of `placement`, rounded to f32.
    pub(crate) fn new(level: u32, placement: Placement) -> Self {
        let n = 1u32 << level;
        let turn = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(1.9);
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
            .map(|corner| turn * DVec3::from(corner).normalize());
        let mut made = Tetrahedron { mesh: Mesh::default(), at_edges: Vec::new() };
        // Vertices by their barycentrics, in units of 1 / n.
        let mut indices: HashMap<[u32; 4], u32> = HashMap::new();
        // Counter-clockwise, seen from outside.
        for face in [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]] {
            let key = |i: u32, j: u32| {
                let mut key = [0; 4];
                (key[face[0]], key[face[1]], key[face[2]]) = (n - i - j, i, j);
                key
            };
            let mut add = |keys: [[u32; 4]; 3]| {
                let triangle = keys.map(|key| {
                    *indices.entry(key).or_insert_with(|| {
                        let weighted =
                            corners.iter().zip(key).map(|(&corner, weight)| corner * f64::from(weight));
                        let point = weighted.sum::<DVec3>() / f64::from(n);
                        made.mesh.positions.push((placement.centre + placement.radius * point).as_vec3());
                        made.mesh.positions.len() as u32 - 1
                    })
                });
                let on_one_edge =
                    |k: usize| (0..4).filter(|&c| keys[k][c] == 0 && keys[(k + 1) % 3][c] == 0).count() == 2;
                let index = made.mesh.triangles.len() as u32;
                made.at_edges.extend((0..3).filter(|&k| on_one_edge(k)).map(|k| (index, k)));
                made.mesh.triangles.push(triangle);
            };
            for i in 0..n {
                for j in 0..n - i {
                    add([key(i, j), key(i + 1, j), key(i, j + 1)]);
                    if i + j + 1 < n {
                        add([key(i + 1, j), key(i + 1, j + 1), key(i, j + 1)]);
                    }
                }
            }
        }
        made
    }

    /// Origin and direction of a ray from a face inwards. It starts on one of the six edges of the tetrahedron: at a
    /// vertex, an edge midpoint or another point of an edge, one third each. Its slope to the face is 1 to 1e-8. The
    /// origin has kiln's offset in the tier `origins`; for `None`, that of pbrt (4th edition, section 6.8.6) in f32.
    pub(crate) fn secondary_ray(&self, index: u64, origins: Option<Numerics>) -> (DVec3, DVec3) {
        /// Seed of the random numbers, different from those of the kinds of rays.
        const STREAM: u64 = 7;
        let mut numbers = Numbers::new(STREAM, index);
        let (triangle, first) = self.at_edges[numbers.below(self.at_edges.len())];
        let along_edge = match index % 3 {
            0 => 0.0,
            1 => 0.5,
            _ => numbers.unit(),
        };
        let mut barycentrics = [1.0 - along_edge, along_edge, 0.0];
        barycentrics.rotate_right(first);
        let corners = self.mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let inwards = -self.mesh.normal(triangle).normalize();
        let tier = origins.unwrap_or(Numerics::Fast);
        let mut point = SurfacePoint::on_triangle(corners, barycentrics, tier);
        if origins.is_none() {
            point.start = point.position;
        }
        let origin = point.origin_towards(inwards, tier);
        let along = inwards.cross(numbers.direction()).normalize_or(inwards.any_orthonormal_vector());
        let rise = 10f64.powi(-(numbers.below(9) as i32));
        (origin, (along + rise * inwards).normalize())
    }
}

#[cfg(test)]
mod tests {
    use super::super::PLACEMENTS;
    use super::*;

    #[test]
    fn it_is_closed_and_faces_outwards_and_its_edges_are_listed() {
        let tetrahedron = Tetrahedron::new(3, PLACEMENTS[0]);
        let mesh = &tetrahedron.mesh;
        assert_eq!(mesh.triangles.len(), 4 * 64);
        assert!(mesh.is_closed());
        assert!(
            (0..mesh.triangles.len() as u32).all(|t| mesh.normal(t).dot(mesh.corners(t)[0].as_dvec3()) > 0.0)
        );
        // 8 edges of triangles along each of 6 edges, on both sides.
        assert_eq!(tetrahedron.at_edges.len(), 6 * 8 * 2);
        // The neighbour across such an edge leans by 180 - 70.5 degrees, whose cosine is -1/3.
        for &(triangle, first) in &tetrahedron.at_edges {
            let [from, to] = [first, (first + 1) % 3].map(|k| mesh.triangles[triangle as usize][k]);
            let across = (0..mesh.triangles.len()).find(|&t| {
                let corners = mesh.triangles[t];
                (0..3).any(|k| [corners[k], corners[(k + 1) % 3]] == [to, from])
            });
            let normals = [triangle, across.expect("a neighbour") as u32].map(|t| mesh.normal(t).normalize());
            assert!((normals[0].dot(normals[1]) + 1.0 / 3.0).abs() < 1e-5);
        }
    }
}
