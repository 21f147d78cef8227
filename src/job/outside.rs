//! Objects that lie outside the picture.

use glam::{DVec2, DVec3};

use crate::error::Warnings;
use crate::scene::support::PointTrees;
use crate::scene::{Object, Placed, Scene, Shape, bounds};
use crate::world::{Recentering, View};

/// Names in a warning; the others are counted.
const NAMED: usize = 3;

/// Warns of the objects whose bounds lie wholly beyond one side of the picture, or behind the camera, where others do not.
pub(super) fn warn(scene: &Scene, view: &View, recentering: Option<&Recentering>, warnings: &mut Warnings) {
    let trees = PointTrees::of(&scene.objects);
    let outside = scene.objects.iter().filter_map(|object| Some((object, outside_at(object, &trees, view)?)));
    let outside: Vec<(&Object, DVec3)> = outside.collect();
    if outside.is_empty() || outside.len() == scene.objects.len() {
        return;
    }
    let place = |p: DVec3| recentering.map_or(p, |recentering| recentering.point_back(p));
    let named = outside.iter().take(NAMED).map(|(object, at)| {
        let DVec3 { x, y, z } = place(*at);
        format!("`{}` at [{x:.3}, {y:.3}, {z:.3}]", object.name)
    });
    let more = match outside.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let named = named.collect::<Vec<_>>().join(", ");
    warnings.push(format!("outside the picture: {named}{more}; `--camera auto` sees everything"));
}

/// The middle of an object's bounds, if they are outside the picture.
fn outside_at(object: &Object, trees: &PointTrees, view: &View) -> Option<DVec3> {
    let [width, height] = view.size().map(f64::from);
    // With one of its vertices in the picture, a mesh is not outside.
    if let Shape::Placed(Placed { mesh, placement }) = &object.shape
        && let Some(vertex) = mesh.corners().next()
        && let (DVec2 { x, y }, true) = view.project(placement.point(vertex))
        && (0.0..=width).contains(&x)
        && (0.0..=height).contains(&y)
    {
        return None;
    }
    let (min, max) = bounds(trees, std::slice::from_ref(object))?;
    let corner =
        |i: usize| DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { max[k] } else { min[k] }));
    let places: Vec<(DVec2, bool)> = (0..8).map(|i| view.project(corner(i))).collect();
    let is_behind = places.iter().all(|(_, before)| !before);
    let is_beside = places.iter().all(|(_, before)| *before)
        && [
            places.iter().all(|(p, _)| p.x < 0.0),
            places.iter().all(|(p, _)| p.x > width),
            places.iter().all(|(p, _)| p.y < 0.0),
            places.iter().all(|(p, _)| p.y > height),
        ]
        .contains(&true);
    (is_behind || is_beside).then_some(min / 2.0 + max / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Sphere;
    use crate::scene::{Camera, MaterialId};

    /// Seen from (0, 0, 5) along -z with 90 degrees: at z = 0 the picture reaches to 5 on every side.
    #[test]
    fn what_lies_beyond_a_side_is_named_with_its_place() {
        let ball = |name: &str, x: f64, z: f64| {
            let shape = Shape::Analytic(Sphere { centre: DVec3::new(x, 0.0, z), radius: 1.0 }.into());
            Object { name: name.into(), input: 0, material: MaterialId(0), shape }
        };
        let half = std::f64::consts::FRAC_PI_2;
        let camera = Camera::from_field_of_view("c".into(), DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, half);
        let view = View::new(&camera, camera.projection, [8, 8]).unwrap();
        let warned = |objects: Vec<Object>| {
            let mut warnings = Warnings::default();
            warn(&Scene { objects, ..Scene::default() }, &view, None, &mut warnings);
            warnings.messages().concat()
        };
        let seen = || ball("seen", 0.0, 0.0);
        assert_eq!(warned(vec![seen(), ball("at the edge", 5.0, 0.0)]), "");
        let text = warned(vec![seen(), ball("right", 9.0, 0.0), ball("behind", 0.0, 8.0)]);
        assert!(
            text.contains("`right` at [9.000, 0.000, 0.000], `behind` at [0.000, 0.000, 8.000];"),
            "{text}"
        );
        assert!(
            warned((0..5).map(|_| ball("far", 99.0, 0.0)).chain([seen()]).collect()).contains(" and 2 more")
        );
        // Nothing at all in the picture is reported with the picture.
        assert_eq!(warned(vec![ball("right", 9.0, 0.0)]), "");
    }
}
