//! The ground of a scene as an object and its material.

use glam::DVec3;

use crate::film::Colour;
use crate::scene::{Ground, Material, MaterialId, Mesh, Object, Phong, Shape};

/// The square, counterclockwise as seen from above.
pub(super) fn object(ground: &Ground, material: MaterialId) -> Object {
    let corner = |x: f64, z: f64| ground.centre + ground.half_side * DVec3::new(x, 0.0, z);
    let positions = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
    Object { name: "ground".into(), input: 0, material, shape: Shape::Mesh(mesh) }
}

/// Its material, which is diffuse.
pub(super) fn material(ground: &Ground) -> Material {
    let colour = Colour::Linear(DVec3::splat(ground.albedo));
    Material::Phong(Phong { name: "ground".into(), colour, ..Phong::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ground_is_counterclockwise_from_above() {
        let ground = Ground { centre: DVec3::ONE, half_side: 2.0, ..Ground::default() };
        let Shape::Mesh(mesh) = object(&ground, MaterialId(0)).shape else { panic!("a mesh") };
        for triangle in mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            // Two edges of half the square: their cross product is its area, 4 by 4.
            assert_eq!((b - a).cross(c - a), DVec3::new(0.0, 16.0, 0.0));
        }
    }
}
