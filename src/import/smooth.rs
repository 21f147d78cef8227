//! Normals for meshes without: smooth where neighbouring triangles meet at less than an angle, as `--smooth` asks.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use crate::scene::topology::Sets;
use crate::scene::{Attribute, Mesh, Scene, Shape};

/// Gives every mesh without normals such of its own, `crease` being the greatest angle in radians between the normals of
/// two triangles whose edge is smooth. Returns the number of meshes. Meshes that objects share stay shared.
pub(super) fn smooth(scene: &mut Scene, crease: f64) -> usize {
    let mut shared: HashMap<*const Mesh, Arc<Mesh>> = HashMap::new();
    let mut count = 0;
    for object in &mut scene.objects {
        match &mut object.shape {
            Shape::Mesh(mesh) if mesh.normals.is_none() => {
                mesh.normals = Some(normals(mesh, crease));
                count += 1;
            }
            Shape::Placed(placed) if placed.mesh.normals.is_none() => {
                let known = shared.entry(Arc::as_ptr(&placed.mesh)).or_insert_with(|| {
                    count += 1;
                    let normals = Some(normals(&placed.mesh, crease));
                    Arc::new(Mesh { normals, ..(*placed.mesh).clone() })
                });
                placed.mesh = Arc::clone(known);
            }
            _ => {}
        }
    }
    count
}

/// The normals of the corners of a mesh. Corners at one position, to the bit, share a normal if smooth edges connect
/// their triangles there: the sum of the triangles' normals, weighted by their angles at the position (Thürmer and
/// Wüthrich, Computing Vertex Normals from Polygonal Facets, 1998). Two triangles share an edge if they are the only ones
/// that have it, in opposite directions.
fn normals(mesh: &Mesh, crease: f64) -> Attribute<DVec3> {
    let positions = distinct(mesh);
    let corners: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|i| positions[i as usize])).collect();
    let face = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let faces: Vec<DVec3> = mesh.triangles.iter().map(face).collect();
    // Half edges by their ends: the corner that each starts from, and whether there are several.
    let mut edges: HashMap<[u32; 2], (u32, bool)> = HashMap::with_capacity(3 * corners.len());
    for (triangle, of_triangle) in corners.iter().enumerate() {
        for k in 0..3 {
            let corner = (3 * triangle + k) as u32;
            let edge = [of_triangle[k], of_triangle[(k + 1) % 3]];
            edges.entry(edge).and_modify(|(_, several)| *several = true).or_insert((corner, false));
        }
    }
    let mut sets = Sets::new(3 * corners.len());
    for (&[from, to], &(corner, several)) in &edges {
        let Some(&(opposite, opposite_several)) = edges.get(&[to, from]) else { continue };
        let cosine = faces[corner as usize / 3].dot(faces[opposite as usize / 3]);
        if several || opposite_several || from > to || cosine < crease.cos() {
            continue;
        }
        sets.join(corner, next(opposite));
        sets.join(next(corner), opposite);
    }
    let side = if mesh.is_mirrored { -1.0 } else { 1.0 };
    let mut values = vec![DVec3::ZERO; 3 * corners.len()];
    for (triangle, of_triangle) in mesh.triangles.iter().enumerate() {
        let weighted = weighted_normals(of_triangle.map(|i| mesh.positions[i as usize]));
        for (corner, normal) in (3 * triangle as u32..).zip(weighted) {
            values[sets.find(corner) as usize] += side * normal;
        }
    }
    let triangles = (0..corners.len() as u32).map(|t| [0, 1, 2].map(|k| sets.find(3 * t + k))).collect();
    Attribute { values, triangles: Some(triangles) }
}

/// The unit normal of a triangle times its angle at each corner; zero where it has none.
pub(super) fn weighted_normals(corners: [DVec3; 3]) -> [DVec3; 3] {
    std::array::from_fn(|i| {
        let [a, b, c] = [0, 1, 2].map(|k| corners[(i + k) % 3]);
        let (b, c) = ((b - a).normalize_or_zero(), (c - a).normalize_or_zero());
        let normal = b.cross(c);
        // An angle of 0 or 180 degrees has no normal.
        normal.normalize_or_zero() * normal.length().atan2(b.dot(c))
    })
}

/// The next corner of a triangle.
fn next(corner: u32) -> u32 {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// For each position of a mesh, the first that is equal to the bit.
fn distinct(mesh: &Mesh) -> Vec<u32> {
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let bits = |p: &DVec3| p.to_array().map(f64::to_bits);
    mesh.positions.iter().zip(0..).map(|(p, i)| *known.entry(bits(p)).or_insert(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A roof: two unit squares that meet at an angle along x, as triangles with positions of their own.
    fn roof(angle: f64) -> Mesh {
        let (sin, cos) = angle.sin_cos();
        let left = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, -1.0], [0.0, 0.0, -1.0]];
        let right = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -sin, cos], [1.0, -sin, cos]];
        let positions = left.iter().chain(&right).map(|&p| p.into()).collect();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        Mesh { positions, triangles, ..Mesh::default() }
    }

    fn at(mesh: &Mesh, crease_in_degrees: f64, triangle: usize, corner: usize) -> DVec3 {
        let Attribute { values, triangles } = normals(mesh, crease_in_degrees.to_radians());
        values[triangles.expect("of corners")[triangle][corner] as usize].normalize()
    }

    /// At the ridge, the angles of both sides are right ones, so the normal is the mean of both; at the eaves each has
    /// its own. Beyond the crease angle every corner has its triangle's.
    #[test]
    fn edges_are_smooth_below_the_crease_angle() {
        let turn = 40f64.to_radians();
        let mesh = roof(turn);
        let (left, right) = (DVec3::Y, DVec3::new(0.0, turn.cos(), turn.sin()));
        for (triangle, corner) in [(0, 0), (0, 1), (2, 0), (2, 1)] {
            let normal = at(&mesh, 41.0, triangle, corner);
            assert!((normal - (left + right).normalize()).length() < 1e-12, "{normal}");
        }
        assert!((at(&mesh, 41.0, 1, 2) - left).length() < 1e-12);
        assert!((at(&mesh, 39.0, 0, 0) - left).length() < 1e-12);
        assert!((at(&mesh, 39.0, 2, 0) - right).length() < 1e-12);
    }

    /// A third triangle at an edge leaves it sharp, as there is no saying which two belong together.
    #[test]
    fn edges_of_three_triangles_are_sharp() {
        let mut mesh = roof(0.1);
        mesh.positions.push(DVec3::new(0.5, 1.0, 0.0));
        mesh.triangles.push([0, 1, 8]);
        assert!((at(&mesh, 90.0, 0, 0) - DVec3::Y).length() < 1e-12);
    }

    #[test]
    fn shared_meshes_stay_shared_and_normals_stay() {
        use crate::scene::{Placed, Placement};
        let placed = Placed::new(Arc::new(roof(0.3)), Placement::default());
        let own = Mesh { normals: Some(Attribute::per_position(vec![DVec3::X; 8])), ..roof(0.3) };
        let shapes = [Shape::Placed(placed.clone()), Shape::Placed(placed), Shape::Mesh(own)];
        let mut scene = Scene::from_iter(shapes);
        assert_eq!(smooth(&mut scene, 1.0), 1);
        let [Shape::Placed(a), Shape::Placed(b), Shape::Mesh(own)] =
            [0, 1, 2].map(|i| &scene.objects[i].shape)
        else {
            panic!("two placed meshes and one of its own")
        };
        assert!(Arc::ptr_eq(&a.mesh, &b.mesh) && a.mesh.normals.is_some());
        assert_eq!(own.normals.as_ref().unwrap().values, [DVec3::X; 8]);
    }
}
