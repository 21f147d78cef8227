//! Objects that lie outside the picture, or are small in it.

use glam::{DVec2, DVec3};

use crate::bvh::detail::Bounds;
use crate::error::Warnings;
use crate::scene::mesh::support::{PointTrees, can_be_seen};
use crate::scene::{Camera, Object, Placed, Scene, Shape, bounds, shell_quoted};
use crate::world::{Recentering, View};

/// Names in a warning; the others are counted.
const NAMED: usize = 3;

/// Warns of the objects whose bounds lie wholly beyond one side of the picture, or behind the camera, where others do not.
pub(crate) fn warn(scene: &Scene, view: &View, recentering: Option<&Recentering>, warnings: &mut Warnings) {
    let trees = PointTrees::of(&scene.objects);
    let visible = scene.objects.iter().filter_map(|object| Some((object, outside_at(object, &trees, view)?)));
    let visible: Vec<(&Object, Option<DVec3>)> = visible.collect();
    let outside = visible.iter().filter_map(|&(object, at)| Some((object, at?)));
    let outside: Vec<(&Object, DVec3)> = outside.collect();
    if outside.is_empty() || outside.len() == visible.len() {
        return;
    }
    let place = |p: DVec3| recentering.map_or(p, |recentering| recentering.point_back(p));
    let named = outside.iter().map(|(object, at)| {
        let DVec3 { x, y, z } = place(*at);
        format!("`{}` at [{x:.3}, {y:.3}, {z:.3}]", object.name)
    });
    warnings.push(format!("outside the picture: {}; `--camera auto` sees everything", first_of(named)));
}

/// The first names of a list, and the number of the others.
fn first_of(names: impl ExactSizeIterator<Item = String>) -> String {
    let more = match names.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    names.take(NAMED).collect::<Vec<_>>().join(", ") + &more
}

/// Cells along each axis of the bounds.
const CELLS: u32 = u64::BITS;
/// Adjacent empty cells from which the objects beyond them are far.
const EMPTY: u32 = 60;

/// Notes objects, and triangles of an object, that lie so far from the rest that it is small in the picture of a fitted
/// camera, such as a marker at the origin beside a building at coordinates of a map.
pub(crate) fn note_distant(scene: &Scene, warnings: &mut Warnings) {
    let trees = PointTrees::of(&scene.objects);
    let Some((min, max)) = bounds(&trees, &scene.objects) else { return };
    let size = max - min;
    // The box of a placed mesh, or those of triangles where they may be far from one another, each with its number of
    // triangles.
    let boxes = || {
        scene.objects.iter().enumerate().flat_map(|(index, object)| {
            let is_small = |(min, max): &(DVec3, DVec3)| {
                (max - min).cmple(size * f64::from(EMPTY) / f64::from(CELLS)).all()
            };
            let one = Some(object).filter(|object| matches!(object.shape, Shape::Placed(_)));
            let one = one.and_then(|object| bounds(&trees, std::slice::from_ref(object))).filter(is_small);
            let visible = one.is_none().then(|| object.shape.primitives().filter(can_be_seen));
            let triangles = visible.into_iter().flatten().map(move |one| (index, 1, one.bounds()));
            let count = object.shape.primitive_count();
            triangles.chain(one.map(|(min, max)| (index, count, Bounds::rounded_out(min, max))))
        })
    };
    let cell = |x: f32, k: usize| ((f64::from(x) - min[k]) / size[k] * f64::from(CELLS)).min(63.0) as u32;
    let mut covered = [0, 1, 2].map(|k| if size[k] > 0.0 { 0 } else { u64::MAX });
    for (.., Bounds { min: low, max: high }) in boxes() {
        for (k, covered) in covered.iter_mut().enumerate() {
            *covered |= u64::MAX << cell(low[k], k) & u64::MAX >> (63 - cell(high[k], k));
        }
        if covered.iter().all(|covered| covered.count_zeros() < EMPTY) {
            return;
        }
    }
    for (axis, covered) in covered.into_iter().enumerate() {
        let below = covered.trailing_ones();
        if below == CELLS || (covered >> below).trailing_zeros() < EMPTY {
            continue;
        }
        let mut sides: [(usize, Vec<usize>, Option<Bounds>); 2] = Default::default();
        for (index, triangles, bounds) in boxes() {
            let (count, objects, all) = &mut sides[usize::from(cell(bounds.min[axis], axis) >= below)];
            *count += triangles;
            *all = Some(all.map_or(bounds, |all| all.union(bounds)));
            if objects.last() != Some(&index) {
                objects.push(index);
            }
        }
        sides.sort_by_key(|(count, ..)| *count);
        let [(_, far, _), (_, near, Some(rest))] = sides else { return };
        let times = size.length() / f64::from((rest.max - rest.min).length());
        // Not two parts as large as the gap, such as the walls of a corridor.
        if times * f64::from(CELLS - EMPTY) < f64::from(CELLS) {
            continue;
        }
        let mut names: Vec<&str> = far.iter().map(|&index| scene.objects[index].name.as_str()).collect();
        names.dedup();
        let is_far =
            |&index: &usize| names.iter().take(NAMED).any(|name| scene.objects[index].is_named(name));
        let hint = match names[..] {
            _ if near.iter().any(is_far) => "remove what lies there from the file, or give a --camera".into(),
            [name] => format!("--hide {} frames the rest", shell_quoted(name)),
            _ => "--hide NAME leaves out each of them".into(),
        };
        let names = first_of(names.iter().map(|name| format!("`{name}`")));
        warnings.note(format!("far from the rest, in a scene {times:.0} times its size: {names}; {hint}"));
        return;
    }
}

/// How many times the size of all others an object has from which they are small in a picture of all.
const MUCH_LARGER: f64 = 10.0;

/// Warns of an object so large that all others are small in the picture of a camera that is fitted to a scene file, such as a
/// plane below them.
pub(crate) fn warn_of_large(scene: &Scene, warnings: &mut Warnings) {
    let trees = PointTrees::of(&scene.objects);
    let mut sized: Vec<(&str, (DVec3, DVec3))> = Vec::new();
    for object in &scene.objects {
        sized.extend(bounds(&trees, std::slice::from_ref(object)).map(|of| (object.name.as_str(), of)));
    }
    let size = |(min, max): (DVec3, DVec3)| min.distance(max);
    sized.sort_by(|a, b| size(b.1).total_cmp(&size(a.1)));
    let [(large, whole), (name, first), ref rest @ ..] = sized[..] else { return };
    let all = rest.iter().fold(first, |(min, max), (_, other)| (min.min(other.0), max.max(other.1)));
    let times = size(whole) / size(all);
    if times >= MUCH_LARGER && name != large {
        warnings.push(format!(
            "`{large}` is {times:.0} times as large as all other objects together, which are small in the picture; \
             --look-at {} frames one of them",
            shell_quoted(name)
        ));
    }
}

/// The middle of an object's bounds, if they are outside the picture; `None` for an object that cannot be seen.
fn outside_at(object: &Object, trees: &PointTrees, view: &View) -> Option<Option<DVec3>> {
    let [width, height] = view.size().map(f64::from);
    // With one of its vertices in the picture, a mesh is not outside.
    if let Shape::Placed(Placed { mesh, placement }) = &object.shape
        && let Some(vertex) = mesh.corners().next()
        && let (DVec2 { x, y }, true) = view.project(placement.point(vertex))
        && (0.0..=width).contains(&x)
        && (0.0..=height).contains(&y)
    {
        return Some(None);
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
    Some((is_behind || is_beside).then_some(min / 2.0 + max / 2.0))
}

/// The least share of the picture that the visible part of the bounds covers, and the least share of the bounds that is
/// visible, without a note.
const LEAST_COVERED: f64 = 0.15;
const LEAST_VISIBLE: f64 = 0.8;

/// Points of a regular grid along each side of the bounds, whose places in the picture stand for those of the bounds.
const GRID: usize = 9;

/// Notes that a camera sees the objects from their edge, and that one of a mesh file leaves them small or mostly outside the
/// picture. A camera within the bounds, such as one in a room, does not see all of them.
pub(crate) fn note_framing(
    scene: &Scene,
    camera: &Camera,
    view: &View,
    is_of_mesh_file: bool,
    warnings: &mut Warnings,
) {
    let Some((min, max)) = scene.bounds() else { return };
    if (camera.position.cmpge(min) & camera.position.cmple(max)).all() {
        return;
    }
    let size = DVec2::from(view.size().map(f64::from));
    let along = |i: usize, k: usize| {
        let t = (i / GRID.pow(k as u32) % GRID) as f64 / (GRID - 1) as f64;
        min[k] * (1.0 - t) + max[k] * t
    };
    let all = (0..GRID.pow(3)).map(|i| view.project(DVec3::from_array([0, 1, 2].map(|k| along(i, k)))));
    let before: Vec<DVec2> = all.filter_map(|(p, is_before)| is_before.then_some(p)).collect();
    let is_in_picture = |p: &DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(size).all();
    let visible: Vec<DVec2> = before.iter().copied().filter(is_in_picture).collect();
    let extent = |points: &[DVec2]| {
        let corner =
            |pick: fn(DVec2, DVec2) -> DVec2| points.iter().copied().reduce(pick).unwrap_or_default();
        corner(DVec2::max) - corner(DVec2::min)
    };
    let covered = extent(&visible);
    let name = &camera.name;
    // Of bounds that reach far out of the picture, a single point may be in it.
    if !visible.is_empty() && extent(&before).min_element() < 1.0 {
        warnings.note(format!(
            "camera `{name}` sees the objects from their edge, less than a pixel wide; try `--camera auto`"
        ));
    } else if is_of_mesh_file && (visible.len() as f64) < LEAST_VISIBLE * GRID.pow(3) as f64 {
        warnings.note(format!(
            "camera `{name}` sees less than {} % of the objects' bounds; `--camera auto` sees everything",
            100.0 * LEAST_VISIBLE
        ));
    } else if is_of_mesh_file && covered.x * covered.y < LEAST_COVERED * size.x * size.y {
        warnings.note(format!(
            "camera `{name}` shows the objects on less than {} % of the picture; `--camera auto` fills it",
            100.0 * LEAST_COVERED
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Sphere;
    use crate::scene::MaterialId;

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

    /// The same camera sees a ball of radius 1.5, whose bounds cover (1.5 / 3.5)^2 = 18 % of the picture at their near side,
    /// and one of 0.7, where it is (0.7 / 4.3)^2 = 2.6 %; 88 % of the grid in the bounds of one of radius 2 at x = 3 (71 of
    /// 81 points at each height); of one of radius 1 at x = 6, less than half. Within the bounds it does not count.
    #[test]
    fn a_camera_that_shows_little_is_named() {
        let noted = |x: f64, radius: f64| {
            let shape = Shape::Analytic(Sphere { centre: DVec3::new(x, 0.0, 0.0), radius }.into());
            let object = Object { name: "ball".into(), input: 0, material: MaterialId(0), shape };
            let half = std::f64::consts::FRAC_PI_2;
            let camera = Camera::from_field_of_view("c".into(), DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, half);
            let view = View::new(&camera, camera.projection, [80, 80]).unwrap();
            let mut warnings = Warnings::default();
            let scene = Scene { objects: vec![object], ..Scene::default() };
            note_framing(&scene, &camera, &view, true, &mut warnings);
            warnings.notes().concat()
        };
        assert_eq!((noted(0.0, 1.5), noted(3.0, 2.0), noted(6.0, 7.0)), Default::default());
        assert!(noted(0.0, 0.7).contains("`c` shows the objects on less than 15 %"), "{}", noted(0.0, 0.7));
        assert!(noted(6.0, 1.0).contains("less than 80 % of the objects' bounds"), "{}", noted(6.0, 1.0));
        assert!(noted(99.0, 1.0).contains("`--camera auto`"));
        // 80 pixels show 10 units: a ball of 0.12 is less than one of them, which stands for a shape seen from its edge.
        assert!(noted(0.0, 0.06).contains("`c` sees the objects from their edge"), "{}", noted(0.0, 0.06));
        // At z = -40, the picture reaches to x = 45: of the grid at x = 40, 50, ... 120 it shows points of one column alone.
        assert!(!noted(80.0, 40.0).contains("edge"), "{}", noted(80.0, 40.0));
    }
}
