//! Normals for meshes without: smooth where neighbouring triangles meet at less than an angle, as `--smooth` asks.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::mesh::topology::Sets;
use crate::scene::{Attribute, Mesh, Scene, Shape};

/// Gives every mesh without normals such of its own, `crease` being the greatest angle in radians between the normals of
/// two triangles whose edge is smooth. Returns the number of meshes. Meshes that objects share stay shared.
pub(crate) fn smooth(scene: &mut Scene, crease: f64) -> usize {
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

/// The normals of the corners of a mesh. Corners at one position share a normal if smooth edges connect their triangles
/// there: the sum of the triangles' normals, weighted by their angles at the position (Thürmer and Wüthrich, Computing
/// Vertex Normals from Polygonal Facets, 1998). Two triangles share an edge if they are the only ones that have it, in
/// opposite directions.
fn normals(mesh: &Mesh, crease: f64) -> Attribute<DVec3> {
    let positions = distinct(mesh);
    let face = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let faces: Vec<DVec3> = mesh.triangles.par_iter().map(face).collect();
    let is_smooth = |a: u32, b: u32| faces[a as usize / 3].dot(faces[b as usize / 3]) >= crease.cos();
    let position = |corner: u32| positions[mesh.triangles[corner as usize / 3][corner as usize % 3] as usize];
    let (corners, ends) = corners_by_position(mesh, &positions);
    let side = if mesh.is_mirrored { -1.0 } else { 1.0 };
    let mut values = Vec::with_capacity(mesh.positions.len());
    let mut triangles = vec![[0; 3]; mesh.triangles.len()];
    let (mut edges, mut values_of_sets, mut start) = (Vec::new(), Vec::new(), 0);
    for end in ends {
        let around = &corners[start..end];
        start = end;
        // The edges that begin here and those that end here: their other end, and the triangle's index among those here.
        edges.clear();
        for (i, &corner) in (0u32..).zip(around) {
            edges.push((position(next(corner)), true, i));
            edges.push((position(next(next(corner))), false, i));
        }
        edges.sort_unstable();
        let mut sets = Sets::new(around.len());
        for shared in edges.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, false, ended), (_, true, begun)] = *shared
                && is_smooth(around[ended as usize], around[begun as usize])
            {
                sets.join(ended, begun);
            }
        }
        values_of_sets.clear();
        values_of_sets.resize(around.len(), u32::MAX);
        for (i, &corner) in (0u32..).zip(around) {
            let value = &mut values_of_sets[sets.find(i) as usize];
            if *value == u32::MAX {
                *value = values.len() as u32;
                values.push(DVec3::ZERO);
            }
            let (triangle, k) = (corner as usize / 3, corner as usize % 3);
            let at = mesh.triangles[triangle].map(|i| mesh.positions[i as usize]);
            values[*value as usize] += side * weighted_normal(at, k);
            triangles[triangle][k] = *value;
        }
    }
    Attribute { values, triangles: Some(triangles) }
}

/// The corners of a mesh by their position, in order, and where each position's corners end.
fn corners_by_position(mesh: &Mesh, positions: &[u32]) -> (Vec<u32>, Vec<usize>) {
    let of_corners = || mesh.triangles.as_flattened().iter().map(|&i| positions[i as usize] as usize);
    let mut ends = vec![0; positions.len() + 1];
    of_corners().for_each(|position| ends[position + 1] += 1);
    for i in 0..positions.len() {
        ends[i + 1] += ends[i];
    }
    let mut corners = vec![0; 3 * mesh.triangles.len()];
    for (corner, position) in (0..).zip(of_corners()) {
        corners[ends[position]] = corner;
        ends[position] += 1;
    }
    // Each start has moved to its end.
    ends.pop();
    (corners, ends)
}

/// The unit normal of a triangle times its angle at each corner; zero where it has none.
pub(crate) fn weighted_normals(corners: [DVec3; 3]) -> [DVec3; 3] {
    std::array::from_fn(|i| weighted_normal(corners, i))
}

/// The unit normal of a triangle times its angle at one corner.
fn weighted_normal(corners: [DVec3; 3], i: usize) -> DVec3 {
    let [a, b, c] = [0, 1, 2].map(|k| corners[(i + k) % 3]);
    let (b, c) = ((b - a).normalize_or_zero(), (c - a).normalize_or_zero());
    let normal = b.cross(c);
    // An angle of 0 or 180 degrees has no normal.
    normal.normalize_or_zero() * normal.length().atan2(b.dot(c))
}

/// The next corner of a triangle.
fn next(corner: u32) -> u32 {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// For each position of a mesh, the first that is equal.
fn distinct(mesh: &Mesh) -> Vec<u32> {
    // Adding 0 turns -0 into 0.
    let bits = |p: &DVec3| (*p + 0.0).to_array().map(f64::to_bits);
    let mut sorted: Vec<([u64; 3], u32)> = mesh.positions.iter().map(bits).zip(0..).collect();
    sorted.par_sort_unstable();
    let mut first = vec![0; sorted.len()];
    for equal in sorted.chunk_by(|a, b| a.0 == b.0) {
        equal.iter().for_each(|&(_, index)| first[index as usize] = equal[0].1);
    }
    first
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
