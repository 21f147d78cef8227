//! Which way is up in a file: a guess from its format and the shape of its meshes.

use glam::DVec3;

use crate::scene::{Scene, UpAxis};

/// The share of the bounds' cross-section that a base covers, and the most that the lower side in y covers beside it.
const BASE: f64 = 0.1;
const NO_BASE: f64 = 0.01;

/// The least share of its area by which a surface faces an axis, for a height field above it.
const HEIGHT_FIELD: f64 = 0.7;

/// How far a base's corners are from the lowest point, in sizes of the bounds.
const THICKNESS: f64 = 1e-3;

/// The axis that a mesh seems to stand upright in, where that is not y: it has a flat base at its lower end in that axis,
/// and none in y; or it is a height field above it.
pub(super) fn guess(scene: &Scene) -> Option<UpAxis> {
    let (min, max) = scene.bounds()?;
    let size = max - min;
    let cross_section = |up: DVec3| {
        let sides = size * (DVec3::ONE - up.abs());
        sides.x * sides.y + sides.y * sides.z + sides.z * sides.x
    };
    let axes = UpAxis::ALL.map(UpAxis::vector);
    let (mut bases, mut sum, mut area) = ([0.0; 4], DVec3::ZERO, 0.0);
    scene.for_each_triangle(|corners| {
        let [a, b, c] = corners;
        let twice = (b - a).cross(c - a);
        sum += twice;
        area += twice.length();
        for (axis, base) in axes.iter().zip(&mut bases) {
            let (positive, negative) = (axis.max(DVec3::ZERO), axis.min(DVec3::ZERO));
            let lowest = min.dot(positive) + max.dot(negative);
            let thickness = THICKNESS * size.dot(axis.abs());
            if corners.iter().all(|corner| corner.dot(*axis) - lowest <= thickness) {
                *base += 0.5 * twice.dot(*axis).abs();
            }
        }
    });
    let is_solid = size.min_element() > 0.0;
    let is_height_field = |up: &UpAxis| sum.dot(up.vector()) > HEIGHT_FIELD * area;
    if let Some(up) = UpAxis::ALL.into_iter().find(is_height_field).filter(|_| is_solid) {
        return Some(up).filter(|&up| up != UpAxis::Y);
    }
    let share = |k: usize| bases[k] / cross_section(axes[k]);
    let (_, best) = (0..4).filter(|&k| UpAxis::ALL[k] != UpAxis::Y).map(|k| (share(k), k)).fold(
        (BASE, None),
        |(most, best), (share, k)| if share > most { (share, Some(k)) } else { (most, best) },
    );
    let has_base_in_y = share(1) > NO_BASE;
    best.map(|k| UpAxis::ALL[k]).filter(|_| !has_base_in_y && is_solid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mesh, Shape};

    /// A pyramid with its tip along an axis.
    fn pyramid(up: UpAxis) -> Scene {
        let corners =
            [[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [0.0, 3.0, 0.0]];
        let file_from_world = up.world_from_file().transpose();
        let positions = corners.map(|c| file_from_world.transform_point3(c.into())).into();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        Scene::from_iter([Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() })])
    }

    #[test]
    fn a_base_says_where_up_is() {
        for up in UpAxis::ALL {
            let expected = (up != UpAxis::Y).then_some(up);
            assert_eq!(guess(&pyramid(up)), expected, "{}", up.name());
        }
        assert_eq!(guess(&Scene::default()), None);
    }

    /// The sides of a pyramid 0.3 high without its base, which slope by at most 17 degrees, face up.
    #[test]
    fn a_height_field_faces_up() {
        for up in UpAxis::ALL {
            let mut scene = pyramid(up);
            let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { unreachable!() };
            mesh.triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
            mesh.positions[4] *= 0.1;
            assert_eq!(guess(&scene), (up != UpAxis::Y).then_some(up), "{}", up.name());
        }
    }

    /// A box stands on any side.
    #[test]
    fn a_box_says_nothing() {
        let mut scene = pyramid(UpAxis::Z);
        scene.objects.extend(pyramid(UpAxis::Y).objects);
        assert_eq!(guess(&scene), None);
    }
}
