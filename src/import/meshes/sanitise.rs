//! Removes and counts primitives with non-finite coordinates or coordinates beyond 1e18. Counts triangles with two
//! equal corners, which no ray hits, and keeps them: indices are those of the input. Called once per input, after its
//! importer.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4};

use crate::error::Warnings;
use crate::import::meshes::sharing::shared;
use crate::scene::mesh::support::can_be_seen;
use crate::scene::{Attribute, Mesh, Object, Placed, Scene, Shape};

/// Largest coordinate that is kept. Its square, as in the area of f32 boxes, does not overflow; the builder is tested
/// up to it.
const LARGEST_COORDINATE: f64 = 1e18;

#[derive(Default)]
struct Count {
    non_finite: usize,
    too_large: usize,
    /// Normals, texture coordinates and colours.
    attributes: usize,
    equal_corners: usize,
}

/// Removes invalid primitives and replaces invalid attributes; adds warnings with their counts.
/// [`Scene::has_left_out`] says whether there were any of the former.
pub(crate) fn sanitise(scene: &mut Scene, file: &Path, warnings: &mut Warnings) {
    let mut count = Count::default();
    clean_placed(&mut scene.objects, &mut count);
    for object in &mut scene.objects {
        if let Shape::Mesh(mesh) = &mut object.shape {
            clean_mesh(mesh, LARGEST_COORDINATE, &mut count);
        }
    }
    scene.objects.retain(|object| match &object.shape {
        Shape::Analytic(shape) => {
            let (centre, radius) = shape.bounding_sphere();
            let fits = (centre.abs() + radius).max_element() <= LARGEST_COORDINATE;
            count.too_large += usize::from(!fits);
            fits
        }
        Shape::Mesh(mesh) => !mesh.triangles.is_empty(),
        Shape::Placed(placed) => placed.triangle_count() > 0,
    });
    warn_of_degenerate_objects(scene, file, warnings);
    scene.has_left_out = count.non_finite + count.too_large > 0;
    let mut say = |n: usize, what: &str| {
        if n > 0 {
            warnings.left_out(format!("{}: left out {n} {what}", file.display()));
        }
    };
    say(count.non_finite, "triangle(s) with a vertex that is not a finite number");
    say(count.too_large, "primitive(s) with a coordinate beyond 1e18");
    say(count.attributes, "normal(s), texture coordinate(s) or colour(s) that are not usable numbers");
    if let n @ 1.. = count.equal_corners {
        let what = format!("{n} triangle(s) with two equal corners, which no ray hits");
        warnings.note(format!("{}: {what}", file.display()));
    }
}

fn warn_of_degenerate_objects(scene: &Scene, file: &Path, warnings: &mut Warnings) {
    let degenerate =
        scene.objects.iter().filter(|object| !object.shape.primitives().any(|one| can_be_seen(&one)));
    let names: Vec<&str> = degenerate.map(|object| object.name.as_str()).collect();
    if let [first, others @ ..] = names.as_slice() {
        let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
        let what = "no triangle has an area, so nothing of it can be seen";
        warnings.push(format!("{}: object `{first}`{more}: {what}", file.display()));
    }
}

/// Removes triangles that are invalid: with a corner that is not finite or farther out than `most`. Those with two
/// equal corners begin with one of these: the tier `fast`, too, misses them if an edge from the first corner has no
/// length. Their attributes, which no hit reads, keep their order.
fn clean_mesh(mesh: &mut Mesh, most: f64, count: &mut Count) {
    let (positions, triangles) = (&mesh.positions, &mut mesh.triangles);
    let mut keep = vec![true; triangles.len()];
    for (keep, triangle) in keep.iter_mut().zip(triangles) {
        let corners = triangle.map(|i| positions[i as usize]);
        let counter = if corners.iter().any(|p| !p.is_finite()) {
            &mut count.non_finite
        } else if corners.iter().any(|p| p.abs().max_element() > most) {
            &mut count.too_large
        } else {
            count.equal_corners += usize::from(has_equal_corners(corners));
            if corners[1] == corners[2] {
                triangle.rotate_left(1);
            }
            continue;
        };
        *counter += 1;
        *keep = false;
    }
    mesh.retain(|i| keep[i]);
    count.attributes += replace_unusable(mesh);
}

/// Applies [`clean_mesh`] to shared meshes.
fn clean_placed(objects: &mut [Object], count: &mut Count) {
    for group in shared(objects).into_values() {
        let mut placed: Vec<&mut Placed> = objects_at(objects, &group);
        let [first, others @ ..] = placed.as_mut_slice() else { continue };
        // Leaves a single reference, so that the mesh is not copied.
        let nothing = Arc::default();
        others.iter_mut().for_each(|other| other.mesh = Arc::clone(&nothing));
        let mut mesh = Arc::unwrap_or_clone(std::mem::replace(&mut first.mesh, nothing));
        let mut own = Count::default();
        clean_mesh(&mut mesh, f64::INFINITY, &mut own);
        count.non_finite += own.non_finite * group.len();
        count.equal_corners += own.equal_corners * group.len();
        count.attributes += own.attributes * group.len();
        let reach = mesh.corners().fold(DVec3::ZERO, |reach, p| p.abs().max(reach));
        let mesh = Arc::new(mesh);
        for placed in placed {
            placed.mesh = mesh.clone();
        }
        // If a placement may exceed the range, the mesh is baked and its triangles are checked one by one.
        for &index in &group {
            let Shape::Placed(placed) = &objects[index].shape else { continue };
            let reach = placed.placement.reach(reach).max_element();
            if reach > LARGEST_COORDINATE || !reach.is_finite() {
                objects[index].shape = Shape::Mesh(placed.bake());
            }
        }
    }
}

fn objects_at<'a>(objects: &'a mut [Object], group: &[usize]) -> Vec<&'a mut Placed> {
    let mut group = group.iter().peekable();
    let placed = objects.iter_mut().enumerate().filter_map(|(index, object)| match &mut object.shape {
        Shape::Placed(placed) if group.next_if(|&&wanted| wanted == index).is_some() => Some(placed),
        _ => None,
    });
    placed.collect()
}

/// Replaces attributes that are not finite in f32 by neutral values: no normal (the geometric normal is used), uv (0,
/// 0), white, opaque. Negative colours and opacities beyond 0 to 1 are also replaced. Returns the number of
/// replacements.
fn replace_unusable(mesh: &mut Mesh) -> usize {
    fn replace<'a, T: Copy + 'a>(
        attribute: impl IntoIterator<Item = &'a mut Attribute<T>>,
        usable: impl Fn(T) -> bool,
        neutral: T,
    ) -> usize {
        let values = attribute.into_iter().flat_map(|attribute| &mut attribute.values);
        values.filter(|value| !usable(**value)).map(|value| *value = neutral).count()
    }
    replace(&mut mesh.normals, |n| n.is_finite(), DVec3::ZERO)
        + replace(&mut mesh.tangents, |t| t.as_vec4().is_finite(), DVec4::ZERO)
        + replace(&mut mesh.uvs, |uv| uv.as_vec2().is_finite(), DVec2::ZERO)
        + replace(&mut mesh.alphas, |alpha| (0.0..=1.0).contains(&alpha), 1.0)
        + replace(&mut mesh.colours, |c| c.as_vec3().is_finite() && c.min_element() >= 0.0, DVec3::ONE)
}

/// Whether two corners coincide. Such a triangle is a line segment and closes no gap, unlike those with three distinct
/// collinear corners.
fn has_equal_corners([a, b, c]: [DVec3; 3]) -> bool {
    a == b || b == c || c == a
}
