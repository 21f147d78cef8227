//! Builds a scene in code, a red ball on a floor under a lamp, and renders it to a PNG.
//!
//! ```sh
//! cargo run --release --example build_scene -- ball.png
//! ```

use std::path::Path;

use kiln::error::{Error, Result, Warnings};
use kiln::film::Colour;
use kiln::film::write::{Format, OutputImage, write_picture};
use kiln::glam::DVec3;
use kiln::job::{RenderControl, RenderSettings, prepare};
use kiln::scene::{
    Camera, Falloff, Light, LightKind, Material, MaterialId, Mesh, Object, Phong, PictureSettings, Scene,
    Shape, Sphere,
};

fn main() -> Result<()> {
    let output = std::env::args().nth(1);
    let output = output.ok_or_else(|| Error::usage("an argument is needed", "build_scene OUTPUT.png"))?;
    render(build_scene(), output.as_ref(), &RenderSettings::default())
}

/// The scene. +y is up; there is no unit of length.
pub fn build_scene() -> Scene {
    let mut scene = Scene { picture: PictureSettings::of_size([640, 480]), ..Scene::default() };
    let red = scene.add_material(phong("red", [200, 40, 30]));
    let grey = scene.add_material(phong("grey", [180, 180, 180]));
    let corners = [[-4.0, 0.0, -4.0], [-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0]];
    let floor = Mesh {
        positions: corners.map(DVec3::from).into(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let ball = Sphere { centre: DVec3::new(0.0, 1.0, 0.0), radius: 1.0 };
    scene.objects.push(object("floor", grey, Shape::Mesh(floor)));
    scene.objects.push(object("ball", red, Shape::Analytic(ball.into())));
    scene.lights.push(Light {
        name: "lamp".into(),
        colour: Colour::from_u8([255; 3]),
        intensity: 1.0,
        kind: LightKind::Point { position: DVec3::new(3.0, 6.0, 4.0), falloff: Falloff::None },
    });
    let (position, target) = (DVec3::new(0.0, 2.5, 7.0), DVec3::new(0.0, 0.8, 0.0));
    let field_of_view = 40f64.to_radians();
    scene.cameras.push(Camera::from_field_of_view("front".into(), position, target, DVec3::Y, field_of_view));
    scene
}

fn phong(name: &str, rgb: [u8; 3]) -> Material {
    Material::Phong(Phong { name: name.into(), colour: Colour::from_u8(rgb), ..Phong::default() })
}

fn object(name: &str, material: MaterialId, shape: Shape) -> Object {
    Object { name: name.into(), input: 0, material, shape }
}

/// Renders a scene to a PNG.
pub fn render(scene: Scene, output: &Path, settings: &RenderSettings) -> Result<()> {
    let job = prepare(scene, settings, &mut Warnings::default())?;
    let (film, _) = job.render(&RenderControl::default())?;
    let image = OutputImage::Rgb8(film, job.pipeline());
    write_picture(&image, &job.metadata, Format::from_path(output)?, output)
}
