//! `kiln info`: contents, sizes and warnings of files.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};

use super::arguments::inputs_help;
use super::print;
use crate::effects::check_scene;
use crate::error::{Result, Warnings};
use crate::geometry::Triangle;
use crate::import;
use crate::scene::{LightKind, Material, Mesh, Scene, Shape};

#[derive(Args)]
pub(crate) struct Arguments {
    /// Files to look at.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Files to look at"))]
    inputs: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut warnings = Warnings::default();
    let scene = import::load(&arguments.inputs, &mut warnings)?;
    check_scene(&scene.effects)?;
    let report = describe(&arguments.inputs, &scene, &warnings);
    if arguments.json {
        print(&format!("{report:#}\n"))
    } else {
        print(&as_text(&arguments.inputs, &scene, &warnings))
    }
}

fn describe(inputs: &[PathBuf], scene: &Scene, warnings: &Warnings) -> Value {
    let point = |p: DVec3| json!(p.to_array());
    let attributes = |mesh: &Mesh| {
        json!({
            "normals": mesh.normals.is_some(),
            "texture_coordinates": !mesh.uvs.is_empty(),
            "colours": mesh.colours.is_some(),
        })
    };
    let objects: Vec<Value> = scene
        .objects
        .iter()
        .map(|object| {
            let (kind, attributes) = match &object.shape {
                Shape::Analytic(shape) => (shape.name(), json!({})),
                Shape::Mesh(mesh) => ("mesh", attributes(mesh)),
                Shape::Placed(placed) => ("mesh", attributes(&placed.mesh)),
            };
            json!({
                "name": object.name,
                "input": inputs[object.input].display().to_string(),
                "kind": kind,
                "primitives": object.shape.primitive_count(),
                "material": scene.materials[object.material.0 as usize].name(),
                "attributes": attributes,
                "shared": matches!(object.shape, Shape::Placed(_)),
            })
        })
        .collect();
    json!({
        "schema": 1,
        "inputs": inputs.iter().map(|i| i.display().to_string()).collect::<Vec<_>>(),
        "primitives": scene.primitive_count(),
        "triangles": triangles(scene),
        "triangles_without_area": degenerate_triangles(scene),
        "spheres": scene.primitive_count() - triangles(scene),
        "bounds": scene.bounds().map(|(min, max)| json!({ "min": point(min), "max": point(max) })),
        "objects": objects,
        "materials": scene.materials.iter().map(|m| json!({ "name": m.name(), "model": model(m) })).collect::<Vec<_>>(),
        "textures": scene.images.iter().map(|i| json!({ "name": i.name, "width": i.width, "height": i.height }))
            .collect::<Vec<_>>(),
        "cameras": scene.cameras.iter().map(|c| json!({ "name": c.name, "projection": c.projection.name(),
            "position": point(c.position), "target": point(c.target) })).collect::<Vec<_>>(),
        "lights": scene.lights.iter().map(|l| json!({ "name": l.name, "type": light_type(&l.kind),
            "intensity": l.intensity })).collect::<Vec<_>>(),
        "clips": scene.clips.iter().map(|c| json!({ "name": c.name, "duration": c.duration, "channels": c.channels }))
            .collect::<Vec<_>>(),
        "warnings": warnings.messages(),
        "notes": warnings.notes(),
    })
}

fn triangles(scene: &Scene) -> usize {
    scene.objects.iter().filter(|o| o.shape.mesh().is_some()).map(|o| o.shape.primitive_count()).sum()
}

/// Number of triangles with collinear vertices. They are kept, because those that close a T-vertex can be hit.
fn degenerate_triangles(scene: &Scene) -> usize {
    let of_shape = |shape: &Shape| match shape {
        Shape::Analytic(_) => 0,
        Shape::Mesh(mesh) => {
            let corners = |t: &[u32; 3]| Triangle(t.map(|i| mesh.positions[i as usize]));
            mesh.triangles.iter().filter(|t| corners(t).is_degenerate()).count()
        }
        Shape::Placed(placed) => {
            let all = 0..placed.triangle_count() as u32;
            all.filter(|&t| Triangle(placed.corners_of(t)).is_degenerate()).count()
        }
    };
    scene.objects.iter().map(|object| of_shape(&object.shape)).sum()
}

/// Meshes with placed instances: number of instances, and triangles per instance.
fn instanced_meshes(scene: &Scene) -> HashMap<*const Mesh, (usize, usize)> {
    let mut shared = HashMap::new();
    for object in &scene.objects {
        if let Shape::Placed(placed) = &object.shape {
            let entry = shared.entry(Arc::as_ptr(&placed.mesh)).or_insert((0, placed.mesh.triangles.len()));
            entry.0 += 1;
        }
    }
    shared
}

fn model(material: &Material) -> &'static str {
    match material {
        Material::Phong(_) => "phong",
        Material::MetallicRoughness(_) => "metallic-roughness",
    }
}

fn light_type(kind: &LightKind) -> &'static str {
    match kind {
        LightKind::Point { .. } => "point",
        LightKind::Directional { .. } => "directional",
        LightKind::Spot { .. } => "spot",
        LightKind::Sphere { .. } => "sphere",
        LightKind::Rectangle { .. } => "rectangle",
    }
}

fn as_text(inputs: &[PathBuf], scene: &Scene, warnings: &Warnings) -> String {
    let mut text = String::new();
    let names: Vec<String> = inputs.iter().map(|i| i.display().to_string()).collect();
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "{label:<12}{value}");
    };
    let spheres = scene.primitive_count() - triangles(scene);
    line("input", names.join(" "));
    line("objects", format!("{} ({} triangles, {spheres} spheres)", scene.objects.len(), triangles(scene)));
    let shared = instanced_meshes(scene);
    if !shared.is_empty() {
        let (places, kept) = shared.values().fold((0, 0), |(p, k), (places, mesh)| (p + places, k + mesh));
        let meshes = shared.len();
        line("shared", format!("{places} objects are places of {meshes} mesh(es) of {kept} triangles"));
    }
    if let flat @ 1.. = degenerate_triangles(scene) {
        line("no area", format!("{flat} triangle(s), kept because they may close T-vertices"));
    }
    match scene.bounds() {
        None => line("bounds", "nothing that can be seen".into()),
        Some((min, max)) => {
            line("bounds", format!("{} to {}", short(min), short(max)));
            line("size", short(max - min));
        }
    }
    line("materials", list(scene.materials.iter().map(|m| m.name().to_owned())));
    line("textures", list(scene.images.iter().map(|i| format!("{} ({} x {})", i.name, i.width, i.height))));
    line("cameras", list(scene.cameras.iter().map(|c| format!("{} ({})", c.name, c.projection.name()))));
    line("lights", list(scene.lights.iter().map(|l| format!("{} ({})", l.name, light_type(&l.kind)))));
    if !scene.clips.is_empty() {
        line("clips", list(scene.clips.iter().map(|c| format!("{} ({} s)", c.name, c.duration as f32))));
    }
    let smooth = scene.objects.iter().filter(|o| o.shape.mesh().is_some_and(|m| m.normals.is_some())).count();
    line("normals", format!("{smooth} object(s) with normals, the others are flat or spheres"));
    for message in warnings.messages() {
        line("warning", message.clone());
    }
    for message in warnings.notes() {
        line("note", message.clone());
    }
    text
}

fn short(v: DVec3) -> String {
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
