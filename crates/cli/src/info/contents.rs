//! What a scene consists of.

use std::path::PathBuf;

use glam::DVec3;
use serde_json::{Value, json};

use super::{FileNames, Lines, geometry, lights, materials, objects};
use kiln::bvh::{Primitive, Triangle};
use kiln::error::Result;
use kiln::import::sharing::shared;
use kiln::scene::mesh::topology::Topology;
use kiln::scene::{AnalyticShape, Camera, Focus, Object, Projection, Scene, Shape};

pub(super) fn to_json(inputs: &[PathBuf], scene: &Scene, topology: &Result<Topology>) -> Value {
    let objects = scene.objects.iter().zip(objects::closed(scene, topology));
    let mut report = json!({
        "schema": 1,
        "inputs": inputs.iter().map(|i| i.display().to_string()).collect::<Vec<_>>(),
        "primitives": scene.primitive_count(),
        "triangles": triangles(scene),
        "triangles_without_area": degenerate_triangles(scene),
        "bounds": scene.bounds().map(|(min, max)| json!({ "min": point(min), "max": point(max) })),
        "objects": objects.map(|(object, closed)| object_to_json(inputs, scene, object, closed)).collect::<Vec<_>>(),
        "materials": materials::to_json(scene),
        "textures": scene.images.iter().map(|i| json!({ "name": i.name, "width": i.width, "height": i.height,
            "bytes": i.pixels.as_bytes().len() })).collect::<Vec<_>>(),
        "cameras": scene.cameras.iter().map(camera_to_json).collect::<Vec<_>>(),
        "lights": scene.lights.iter().map(|l| json!({ "name": l.name, "type": l.kind.name(),
            "intensity": l.intensity })).collect::<Vec<_>>(),
        "environment": scene.environment.as_ref().map(lights::environment_to_json),
        "clips": scene.clips.iter().map(|c| json!({ "name": c.name, "duration": c.duration, "channels": c.channels }))
            .collect::<Vec<_>>(),
        "variants": scene.variants,
        "geometry": geometry::to_json(scene, topology),
        "metadata": scene.metadata.iter().map(|(key, value)| json!({ "name": key, "value": value }))
            .collect::<Vec<_>>(),
    });
    for (name, count) in analytic_shapes(scene) {
        report[format!("{name}s")] = count.into();
    }
    report
}

fn object_to_json(inputs: &[PathBuf], scene: &Scene, object: &Object, closed: Option<bool>) -> Value {
    let kind = if let Shape::Analytic(shape) = &object.shape { shape.name() } else { "mesh" };
    let attributes = object.shape.mesh().map_or(json!({}), |mesh| {
        json!({
            "normals": mesh.normals.is_some(),
            "texture_coordinates": !mesh.uvs.is_empty(),
            "colours": mesh.colours.is_some(),
        })
    });
    json!({
        "name": object.name,
        "input": inputs[object.input].display().to_string(),
        "kind": kind,
        "primitives": object.shape.primitive_count(),
        "triangles": objects::triangles(object),
        "closed": closed,
        "material": scene.materials[object.material.0 as usize].name(),
        "attributes": attributes,
        "shared": matches!(object.shape, Shape::Placed(_)),
    })
}

/// The vertical field of view of a perspective camera in degrees.
fn field_of_view(camera: &Camera) -> Option<f64> {
    let half = camera.view_height / 2.0 / camera.viewpoint_distance;
    (camera.projection == Projection::Perspective).then(|| 2.0 * half.atan().to_degrees())
}

fn camera_to_json(camera: &Camera) -> Value {
    json!({
        "name": camera.name,
        "projection": camera.projection.name(),
        "position": point(camera.position),
        "target": point(camera.target),
        "field_of_view": field_of_view(camera),
        "view_height": camera.view_height,
        "lens": camera.lens,
    })
}

fn camera_text(camera: &Camera) -> String {
    let (name, projection) = (&camera.name, camera.projection.name());
    let lens = camera.lens.map_or(String::new(), |lens| {
        let focus = match lens.focus {
            Focus::Auto => "what is in the centre".into(),
            Focus::Distance(distance) => format!("a distance of {}", distance as f32),
            Focus::Point(point) => short(point),
        };
        format!(", aperture of radius {}, focus on {focus}", lens.radius as f32)
    });
    match field_of_view(camera) {
        Some(degrees) => format!("{name} ({projection}, {degrees:.1} degrees high{lens})"),
        None => format!("{name} ({projection}, {} high)", camera.view_height as f32),
    }
}

pub(super) fn point(p: DVec3) -> Value {
    json!(p.to_array())
}

fn triangles(scene: &Scene) -> usize {
    scene.objects.iter().map(objects::triangles).sum()
}

/// Names of the kinds of analytic shapes, with their numbers.
fn analytic_shapes(scene: &Scene) -> Vec<(&'static str, usize)> {
    let is_of = |name: &str, object: &Object| matches!(&object.shape, Shape::Analytic(s) if s.name() == name);
    let count = |name| (name, scene.objects.iter().filter(|object| is_of(name, object)).count());
    AnalyticShape::NAMES.map(count).to_vec()
}

/// Number of triangles with three distinct collinear vertices. Those that close a T-vertex can be hit.
fn degenerate_triangles(scene: &Scene) -> usize {
    let is_flat = |primitive: &Primitive| match primitive {
        Primitive::Triangle(triangle @ Triangle([a, b, c])) => {
            a != b && b != c && c != a && triangle.is_degenerate()
        }
        Primitive::Analytic(_) => false,
    };
    scene.primitives().filter(is_flat).count()
}

/// Adds counts and bounds.
pub(super) fn add_sizes(lines: &mut Lines, names: &FileNames, scene: &Scene) {
    lines.add("input", names.inputs());
    let mut counts = format!("{} ({} triangles", scene.objects.len(), triangles(scene));
    for (kind, (name, count)) in analytic_shapes(scene).into_iter().enumerate() {
        if kind == 0 || count > 0 {
            counts += &format!(", {count} {name}s");
        }
    }
    lines.add("objects", counts + ")");
    let groups = shared(&scene.objects);
    if !groups.is_empty() {
        let places: usize = groups.values().map(Vec::len).sum();
        let kept: usize = groups.keys().map(|&first| objects::triangles(&scene.objects[first])).sum();
        let meshes = groups.len();
        lines.add(
            "shared",
            format!("{places} objects are placements of {meshes} mesh(es) with {kept} triangles"),
        );
    }
    if let flat @ 1.. = degenerate_triangles(scene) {
        lines.add("no area", format!("{flat} triangle(s), kept because they may close T-vertices"));
    }
    match scene.bounds() {
        None => lines.add("bounds", "none: nothing can be seen"),
        Some((min, max)) => {
            lines.add("bounds", format!("{} to {}", short(min), short(max)));
            lines.add("size", short(max - min));
        }
    }
}

/// Adds the names of materials, textures, cameras, lights and clips, with what matters of each.
pub(super) fn add_names(lines: &mut Lines, names: &FileNames, scene: &Scene) {
    lines.add("materials", list(scene.materials.iter().map(|m| m.name().to_owned())));
    materials::add(lines, scene);
    let textures = scene.images.iter();
    lines.add(
        "textures",
        list(textures.map(|i| format!("{} ({} x {})", names.shorten(&i.name), i.width, i.height))),
    );
    lines.add("cameras", list(scene.cameras.iter().map(camera_text)));
    lines.add("lights", list(scene.lights.iter().map(lights::text)));
    if let Some(environment) = &scene.environment {
        lines.add("environment", names.shorten(&lights::environment_text(environment)));
    }
    if !scene.clips.is_empty() {
        lines.add("clips", list(scene.clips.iter().map(|c| format!("{} ({} s)", c.name, c.duration as f32))));
    }
    if !scene.variants.is_empty() {
        lines.add("variants", list(scene.variants.iter().cloned()));
    }
    for (name, value) in &scene.metadata {
        lines.add("metadata", format!("{name}: {value}"));
    }
    let smooth = scene.objects.iter().filter(|o| o.shape.mesh().is_some_and(|m| m.normals.is_some())).count();
    lines.add("normals", format!("{smooth} object(s) with normals, the others are flat or analytic shapes"));
}

pub(super) fn short(v: DVec3) -> String {
    format!("({}, {}, {})", v.x as f32, v.y as f32, v.z as f32)
}

/// The first names of a list, and the number of the others.
fn list(names: impl ExactSizeIterator<Item = String>) -> String {
    const MOST: usize = 8;
    let count = names.len();
    let shown: Vec<String> = names.take(MOST).collect();
    match count {
        0 => "none".into(),
        n if n > MOST => format!("{n}: {}, …", shown.join(", ")),
        n => format!("{n}: {}", shown.join(", ")),
    }
}
