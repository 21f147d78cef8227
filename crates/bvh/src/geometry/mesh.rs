//! Triangles that share vertices, with what is interpolated across them.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

/// An indexed triangle mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Three positions a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals; need not have length 1. A zero normal means "the triangle's own".
    pub normals: Option<Attribute<DVec3>>,
    /// Sets of texture coordinates, (0, 0) at the picture's top left corner.
    pub uvs: Vec<Attribute<DVec2>>,
    /// Vertex colours in linear light, multiplied with the material's.
    pub colours: Option<Attribute<DVec3>>,
    /// Vertex opacities, 0 to 1, multiplied with the material's.
    pub alphas: Option<Attribute<f64>>,
    /// Tangents, for normal maps: x, y, z point to where u grows, and w, 1 or -1, says on which side of that the picture goes
    /// up: the bitangent is `w * normal x tangent`.
    pub tangents: Option<Attribute<DVec4>>,
    /// Whether a transform mirrored it: triangles are then seen clockwise from the front (glTF 2.0, section 3.7.4).
    pub is_mirrored: bool,
}

/// Values at the corners of triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute<T> {
    /// The values.
    pub values: Vec<T>,
    /// Three values a triangle, or `None` where the values go with the positions.
    pub triangles: Option<Vec<[u32; 3]>>,
}

impl<T> Attribute<T> {
    /// Values that go with the positions, one each.
    pub fn per_position(values: Vec<T>) -> Self {
        Attribute { values, triangles: None }
    }
}

impl Mesh {
    /// The corners of triangle after triangle.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.triangles.iter().flatten().map(|&i| self.positions[i as usize])
    }

    /// The positions of a triangle, counterclockwise seen from the front.
    pub fn front(&self, [a, b, c]: [u32; 3]) -> [u32; 3] {
        if self.is_mirrored { [a, c, b] } else { [a, b, c] }
    }

    /// Moves the mesh. Normals follow by the cofactor matrix of `world_from_mesh`, which is finite even where the
    /// transform cannot be inverted, and keeps its side under mirroring (the sign of the determinant).
    pub fn transform(&mut self, world_from_mesh: &DMat4) {
        for position in &mut self.positions {
            *position = world_from_mesh.transform_point3(*position);
        }
        self.is_mirrored ^= is_mirror(world_from_mesh);
        if let Some(normals) = &mut self.normals {
            let cofactor = normal_matrix(world_from_mesh);
            for normal in &mut normals.values {
                *normal = cofactor * *normal;
            }
        }
        if let Some(tangents) = &mut self.tangents {
            for tangent in &mut tangents.values {
                *tangent = moved_tangent(world_from_mesh, *tangent);
            }
        }
    }

    /// Keeps the triangles for which `keep` says so, and their attributes.
    pub fn retain(&mut self, mut keep: impl FnMut(usize) -> bool) {
        let kept: Vec<bool> = (0..self.triangles.len()).map(&mut keep).collect();
        if kept.iter().all(|&k| k) {
            return;
        }
        retain_by(&mut self.triangles, &kept);
        let attributes = [
            self.tangents.as_mut().and_then(|a| a.triangles.as_mut()),
            self.normals.as_mut().and_then(|a| a.triangles.as_mut()),
            self.colours.as_mut().and_then(|a| a.triangles.as_mut()),
            self.alphas.as_mut().and_then(|a| a.triangles.as_mut()),
        ];
        let uvs = self.uvs.iter_mut().filter_map(|a| a.triangles.as_mut());
        for triangles in attributes.into_iter().flatten().chain(uvs) {
            retain_by(triangles, &kept);
        }
    }
}

fn retain_by<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    values.retain(|_| *kept.next().expect("one flag a value"));
}

/// The matrix that carries normals along with a transform: the cofactor matrix of its linear part, with the sign of
/// the determinant so that normals keep their side.
pub fn normal_matrix(world_from_mesh: &DMat4) -> DMat3 {
    let m = DMat3::from_mat4(*world_from_mesh);
    let cofactor =
        DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if is_mirror(world_from_mesh) { cofactor * -1.0 } else { cofactor }
}

/// Whether a transform turns front sides of triangles to the back: its determinant is below 0. Columns are scaled, so
/// that it neither overflows nor underflows.
pub fn is_mirror(world_from_mesh: &DMat4) -> bool {
    let m = DMat3::from_mat4(*world_from_mesh);
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|column| column / column.abs().max_element());
    DMat3::from_cols(x, y, z).determinant() < 0.0
}

/// A tangent carried along with a transform. Under a mirror normals keep their side, so that bitangents change theirs.
pub fn moved_tangent(world_from_mesh: &DMat4, tangent: DVec4) -> DVec4 {
    let m = DMat3::from_mat4(*world_from_mesh);
    let side = if is_mirror(world_from_mesh) { -tangent.w } else { tangent.w };
    (m * tangent.truncate()).extend(side)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_stay_perpendicular_under_any_scale() {
        // A plane with tangents x and z + y has the normal (0, 1, -1); scaled by (1e-4, 1, 1e4) its tangents are x and
        // (0, 1, 1e4), so its normal is (0, 1e4, -1) up to length. M n, the usual mistake, gives (0, 1, -1e4).
        let m = DMat4::from_scale(DVec3::new(1e-4, 1.0, 1e4));
        let n = (normal_matrix(&m) * DVec3::new(0.0, 1.0, -1.0)).normalize();
        let t = m.transform_vector3(DVec3::new(0.0, 1.0, 1.0)).normalize();
        assert!(n.dot(t).abs() < 4.0 * f64::EPSILON);
        assert!(n.y > 0.99);
    }

    #[test]
    fn a_mirror_keeps_the_outside_outside() {
        // Mirroring x: the outward normal of the +x side becomes the outward normal of the -x side.
        let m = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        assert_eq!(normal_matrix(&m) * DVec3::X, -DVec3::X);
        assert_eq!(normal_matrix(&m) * DVec3::Y, DVec3::Y);
    }

    /// The determinant of a scale of -1e-120 is -1e-360, which f64 does not have. Two mirrors are none.
    #[test]
    fn mirrors_are_found_at_every_scale() {
        for scale in [1e-120, 1.0, 1e120] {
            let m = DMat4::from_scale(DVec3::new(-scale, scale, scale));
            let mut mesh = Mesh::default();
            mesh.transform(&m);
            assert!(mesh.is_mirrored && mesh.front([0, 1, 2]) == [0, 2, 1], "{scale}");
            mesh.transform(&m);
            assert!(!mesh.is_mirrored, "{scale}");
        }
        assert!(!is_mirror(&DMat4::from_scale(DVec3::new(-1.0, 0.0, 1.0))));
    }

    #[test]
    fn bitangents_follow_mirrors() {
        // A picture on the plane z = 0, seen from +z: u to +x, up to +y. Mirrored in x, u goes to -x and up stays up.
        let m = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let (n, t) = (normal_matrix(&m) * DVec3::Z, moved_tangent(&m, DVec3::X.extend(1.0)));
        assert_eq!((n, t.truncate()), (DVec3::Z, -DVec3::X));
        assert_eq!(t.w * n.cross(t.truncate()), DVec3::Y);
    }

    #[test]
    fn retain_drops_triangles_with_their_attributes() {
        let mut mesh = Mesh {
            positions: vec![DVec3::ZERO; 3],
            triangles: vec![[0, 1, 2], [1, 2, 0], [2, 0, 1]],
            uvs: vec![Attribute {
                values: vec![DVec2::ZERO; 9],
                triangles: Some(vec![[0; 3], [1; 3], [2; 3]]),
            }],
            ..Mesh::default()
        };
        mesh.retain(|i| i != 1);
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 0, 1]]);
        assert_eq!(mesh.uvs[0].triangles, Some(vec![[0; 3], [2; 3]]));
    }
}
