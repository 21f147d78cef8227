//! What tests of importers share: fixtures of `assets/import`, the content of meshes, what a camera sees of a scene.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::common::gltf::png;
use crate::common::repository;
use glam::DVec3;
use kiln::bvh::detail::Layout;
use kiln::effects::{Plan, PlanSettings};
use kiln::error::{Error, Warnings};
use kiln::film::{ColourPipeline, Window};
use kiln::render::{RenderControl, render};
use kiln::scene::Numerics;
use kiln::scene::{Camera, Mesh, Projection, Scene, Sensor, Shape};
use kiln::shading::ShadingMode;
use kiln::world::{View, World};

/// The message of an error, with the file name without its folder.
pub fn message(e: &Error) -> String {
    let text = e.to_string();
    match text.split_once(": ") {
        Some((place, rest)) => format!("{}: {rest}", Path::new(place).file_name().unwrap().to_string_lossy()),
        None => text,
    }
}

/// The scene of a file, and the warnings, with file names without their folder.
pub fn load(file: &Path) -> (Scene, Vec<String>) {
    let mut warnings = Warnings::default();
    let scene = kiln::import::load(&[file.to_owned()], &mut warnings)
        .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let folder = format!("{}/", file.parent().expect("files lie in folders").display());
    (scene, warnings.messages().iter().map(|m| m.replace(&folder, "")).collect())
}

pub fn fixture(name: &str) -> (Scene, Vec<String>) {
    load(&repository("assets/import").join(name))
}

pub fn mesh(scene: &Scene, object: usize) -> &Mesh {
    match &scene.objects[object].shape {
        Shape::Mesh(mesh) => mesh,
        Shape::Placed(placed) => &placed.mesh,
        Shape::Analytic(_) => panic!("object {object} is a sphere"),
    }
}

pub fn triangles(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// Unit normals at the corners of each triangle; zero where there is no vertex normal.
pub fn normals(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    let normals = mesh.normals.as_ref().expect("the mesh has normals");
    let indices = normals.triangles.as_ref().unwrap_or(&mesh.triangles);
    indices
        .iter()
        .map(|t| t.map(|i| normals.values[i as usize].try_normalize().unwrap_or(DVec3::ZERO)))
        .collect()
}

pub fn area(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).length() / 2.0).sum()
}

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Asserts equality up to a few rounding errors of f32, the precision of the files, for numbers of about 1.
#[track_caller]
pub fn assert_near(a: DVec3, b: DVec3) {
    assert!((a - b).abs().max_element() <= 1e-6, "{a} is not {b}");
}

/// The albedo that an orthographic camera along -z sees in the rectangle from `min` to `max`, row by row from the top.
pub fn seen(scene: Scene, min: [f64; 2], max: [f64; 2], size: [u32; 2]) -> Vec<[u8; 3]> {
    let middle = v((min[0] + max[0]) / 2.0, (min[1] + max[1]) / 2.0, 0.0);
    let camera = Camera {
        name: "test".into(),
        position: middle + v(0.0, 0.0, 100.0),
        target: middle,
        up: DVec3::Y,
        projection: Projection::Orthographic,
        view_height: max[1] - min[1],
        view_width: Some(max[0] - min[0]),
        viewpoint_distance: 100.0,
        lens: None,
        sensor: Sensor::default(),
        fitted: false,
    };
    let pipeline = ColourPipeline::Display;
    let world = World::prepare(scene, pipeline, Layout::default(), Numerics::default());
    let plan_settings = PlanSettings { shading: ShadingMode::Flat, ..PlanSettings::default() };
    let plan = Plan::new(&world, &plan_settings).expect("no effect is asked for");
    let view = View::new(&camera, Projection::Orthographic, size).expect("the camera has a direction");
    let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
    let control = RenderControl { cancel: &AtomicBool::new(false), progress: &|_, _| {}, time_stages: false };
    let (film, _) = render(&world, &view, &plan, window, |_, _| true, &control).expect("nobody interrupts");
    film.to_rgb8(pipeline).chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// The triangle of each of the unusual but valid files below.
pub const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

pub const OBJ_TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A PNG of 2 by 1 white pixels whose alpha is 0 on the left and 204 (0.8) on the right.
pub fn half_transparent_png() -> Vec<u8> {
    png(2, &[[255, 255, 255, 0], [255, 255, 255, 204]])
}

/// A 3MF file of one part.
pub fn three_mf(resources: &str, build: &str) -> Vec<u8> {
    let text = format!("<model><resources>{resources}</resources><build>{build}</build></model>");
    let mut out = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut out);
    let method = rawzip::CompressionMethod::DEFLATE;
    let start = archive.new_file("3D/3dmodel.model").compression_method(method).start();
    let (mut entry, config) = start.expect("a name");
    let encoder = flate2::write::DeflateEncoder::new(&mut entry, flate2::Compression::fast());
    let mut writer = config.wrap(encoder);
    writer.write_all(text.as_bytes()).expect("memory");
    let (encoder, descriptor) = writer.finish().expect("memory");
    encoder.finish().expect("memory");
    entry.finish(descriptor).expect("memory");
    archive.finish().expect("memory");
    out
}
