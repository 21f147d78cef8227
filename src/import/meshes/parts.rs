//! Splits a mesh whose triangles have several materials.

use std::collections::{BTreeMap, HashMap};

use crate::scene::{Attribute, Mesh};

/// Splits a mesh by the key of each triangle. The parts are sorted by key.
pub(crate) fn split<K: Copy + Ord>(mesh: Mesh, keys: &[K]) -> Vec<(K, Mesh)> {
    let mut groups: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    for (triangle, key) in keys.iter().enumerate() {
        groups.entry(*key).or_default().push(triangle);
    }
    if groups.len() < 2 {
        return groups.into_keys().next().map(|key| (key, mesh)).into_iter().collect();
    }
    groups.into_iter().map(|(key, group)| (key, part(&mesh, &group))).collect()
}

/// Mesh of the triangles in `group` with the vertices in use.
fn part(mesh: &Mesh, group: &[usize]) -> Mesh {
    let (triangles, used) = renumbered(&mesh.triangles, group);
    Mesh {
        positions: values(&mesh.positions, &used),
        triangles,
        normals: mesh.normals.as_ref().map(|a| attribute(a, group, &used)),
        uvs: mesh.uvs.iter().map(|a| attribute(a, group, &used)).collect(),
        colours: mesh.colours.as_ref().map(|a| attribute(a, group, &used)),
        alphas: mesh.alphas.as_ref().map(|a| attribute(a, group, &used)),
        tangents: mesh.tangents.as_ref().map(|a| attribute(a, group, &used)),
        is_mirrored: mesh.is_mirrored,
    }
}

fn attribute<T: Copy>(of: &Attribute<T>, group: &[usize], used: &[u32]) -> Attribute<T> {
    match &of.triangles {
        None => Attribute::per_position(values(&of.values, used)),
        Some(triangles) => {
            let (triangles, used) = renumbered(triangles, group);
            Attribute { values: values(&of.values, &used), triangles: Some(triangles) }
        }
    }
}

fn values<T: Copy>(of: &[T], used: &[u32]) -> Vec<T> {
    used.iter().map(|&index| of[index as usize]).collect()
}

/// Renumbered triangles of a group, and the old index of each new one.
fn renumbered(triangles: &[[u32; 3]], group: &[usize]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let (mut used, mut known) = (Vec::new(), HashMap::new());
    let mut new = |old: u32| {
        *known.entry(old).or_insert_with(|| {
            used.push(old);
            (used.len() - 1) as u32
        })
    };
    let triangles = group.iter().map(|&triangle| triangles[triangle].map(&mut new)).collect();
    (triangles, used)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Two triangles of a square with one colour each: their parts have three vertices and one colour each.
    #[test]
    fn parts_keep_their_corners_and_values() {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let positions = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        let mesh = Mesh {
            normals: Some(Attribute::per_position(positions.clone())),
            positions,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            colours: Some(Attribute {
                values: vec![DVec3::X, DVec3::Y],
                triangles: Some(vec![[0; 3], [1; 3]]),
            }),
            ..Mesh::default()
        };
        let parts = split(mesh.clone(), &[7, 3]);
        assert_eq!(parts.iter().map(|(key, _)| *key).collect::<Vec<_>>(), [3, 7]);
        let (_, first) = &parts[0];
        assert_eq!(first.positions, [corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
        assert_eq!(first.triangles, [[0, 1, 2]]);
        assert_eq!(first.normals.as_ref().map(|n| n.values.clone()), Some(first.positions.clone()));
        let colours = Attribute { values: vec![DVec3::Y], triangles: Some(vec![[0; 3]]) };
        assert_eq!(first.colours, Some(colours));
        assert_eq!(split(mesh.clone(), &[5, 5]), [(5, mesh)]);
    }
}
