//! From a scene to what is timed: its triangles, and where they are seen and lit from.

use glam::DVec3;

use super::super::Mesh;
use super::ViewSetup;
use crate::error::{Error, Result};
use crate::scene::{self, Camera, LightKind, MaterialId, Object, Projection, Scene, Shape};
use crate::world::{StandardView, View, fitted_camera};

/// Where a mesh is seen from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Viewpoint {
    /// From the scene's first camera, or from outside where it has none.
    #[default]
    Scene,
    /// From where the whole of it is in the picture.
    Outside,
    /// From the middle of its bounds, along the longer of the two horizontal axes.
    Inside,
}

impl Viewpoint {
    /// The names of all.
    pub const NAMES: [&str; 3] = ["scene", "outside", "inside"];

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "scene" => Some(Viewpoint::Scene),
            "outside" => Some(Viewpoint::Outside),
            "inside" => Some(Viewpoint::Inside),
            _ => None,
        }
    }
}

/// The vertical field of view from inside, in degrees.
const INSIDE_FIELD_OF_VIEW: f64 = 70.0;

/// How high the light hangs from inside, as a share of the height; the eye is at one half.
const CEILING: f64 = 0.85;

/// The triangles of a scene.
pub struct Triangles {
    /// With f32 corners, numbered in the order of the description.
    pub mesh: Mesh,
    /// How many spheres the scene has; they are left out, because most of the others know only triangles.
    pub spheres: usize,
}

/// Takes the triangles out of a scene.
pub fn triangles(scene: &Scene) -> Triangles {
    let mut taken = Triangles { mesh: Mesh::default(), spheres: 0 };
    for object in &scene.objects {
        let Shape::Mesh(mesh) = &object.shape else {
            taken.spheres += 1;
            continue;
        };
        let first = taken.mesh.positions.len() as u32;
        let positions: Vec<_> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
        taken.mesh.triangles.extend(mesh.triangles.iter().map(|corners| corners.map(|index| first + index)));
        taken.mesh.positions.extend(positions);
    }
    taken
}

/// A scene of nothing but a mesh.
pub fn scene(mesh: &Mesh) -> Scene {
    let positions = mesh.positions.iter().map(|p| p.as_dvec3()).collect();
    let shape = scene::Mesh { positions, triangles: mesh.triangles.clone(), ..scene::Mesh::default() };
    let object = Object { name: "mesh".into(), input: 0, material: MaterialId(0), shape: Shape::Mesh(shape) };
    Scene { objects: vec![object], ..Scene::default() }
}

/// The eye of a picture of `size` by `size` pixels. Its light is the scene's first point light; where there is none, one
/// behind the camera's right shoulder, or below the ceiling.
///
/// # Errors
/// [`Error::Usage`] where there is nothing to look at, or the scene's camera cannot be used.
pub fn eye(scene: &Scene, from: Viewpoint, size: u32) -> Result<ViewSetup> {
    let nothing =
        || Error::usage("there is nothing in it to look at", "`kiln info` says what the file holds");
    let bounds = scene.bounds().ok_or_else(nothing)?;
    let outside =
        || fitted_camera(scene, StandardView::Auto, 1.0, Projection::Perspective).ok_or_else(nothing);
    let camera = match from {
        Viewpoint::Scene => scene.cameras.first().cloned().map_or_else(outside, Ok)?,
        Viewpoint::Outside => outside()?,
        Viewpoint::Inside => inside(bounds),
    };
    let of_scene = scene.lights.iter().find_map(|light| match light.kind {
        LightKind::Point { position, .. } => Some(position),
        _ => None,
    });
    let light = of_scene.unwrap_or_else(|| match from {
        Viewpoint::Inside => light_inside(bounds),
        Viewpoint::Scene | Viewpoint::Outside => light_outside(&camera, bounds),
    });
    Ok(ViewSetup { view: View::new(&camera, camera.projection, [size; 2])?, size, light })
}

fn inside((min, max): (DVec3, DVec3)) -> Camera {
    let (middle, size) = (min / 2.0 + max / 2.0, max - min);
    let along = if size.x >= size.z { DVec3::X * size.x } else { DVec3::Z * size.z };
    let angle = INSIDE_FIELD_OF_VIEW.to_radians();
    Camera::from_field_of_view("inside".into(), middle, middle + along, DVec3::Y, angle)
}

fn light_inside((min, max): (DVec3, DVec3)) -> DVec3 {
    let mut light = min / 2.0 + max / 2.0;
    light.y = min.y + CEILING * (max.y - min.y);
    light
}

/// As far to the right of the camera, and above it, as half the size of the scene.
fn light_outside(camera: &Camera, (min, max): (DVec3, DVec3)) -> DVec3 {
    let right = (camera.target - camera.position).cross(camera.up).normalize_or(DVec3::X);
    camera.position + (max - min).length() / 2.0 * (right + camera.up.normalize_or(DVec3::Y))
}
