//! Triangles, camera and light of a scene for the speed test.

use glam::DVec3;

use super::super::Mesh;
use super::ViewSetup;
use kiln::error::{Error, Result};
use kiln::scene::{self, Camera, LightKind, MaterialId, Object, Projection, Scene, Shape};
use kiln::world::{StandardView, View, fitted_camera};

/// Camera position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Viewpoint {
    /// The scene's first camera; outside if there is none.
    #[default]
    Scene,
    /// Outside, with the whole scene in view.
    Outside,
    /// In the centre of the bounds, along the longer horizontal axis.
    Inside,
}

kiln::names!(Viewpoint { Scene = "scene", Outside = "outside", Inside = "inside" });
kiln::named_values!(Viewpoint);

/// Vertical field of view inside in degrees.
const INSIDE_FIELD_OF_VIEW: f64 = 70.0;

/// Height of the light inside relative to that of the bounds; the camera is at 1/2.
const CEILING: f64 = 0.85;

/// The triangles of a scene.
pub struct Triangles {
    /// Triangles with f32 vertices, in the order of the description.
    pub mesh: Mesh,
    /// Number of analytic shapes in the scene, which are omitted, as most other libraries support triangles only.
    pub analytic_shapes: usize,
}

/// Extracts the triangles of a scene.
pub fn triangles(scene: &Scene) -> Triangles {
    let mut taken = Triangles { mesh: Mesh::default(), analytic_shapes: 0 };
    for object in &scene.objects {
        let baked;
        let mesh = match &object.shape {
            Shape::Mesh(mesh) => mesh,
            Shape::Placed(placed) => {
                baked = placed.bake();
                &baked
            }
            Shape::Analytic(_) => {
                taken.analytic_shapes += 1;
                continue;
            }
        };
        let first = taken.mesh.positions.len() as u32;
        let positions: Vec<_> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
        taken.mesh.triangles.extend(mesh.triangles.iter().map(|corners| corners.map(|index| first + index)));
        taken.mesh.positions.extend(positions);
    }
    taken
}

/// A scene that consists of a mesh.
pub fn scene(mesh: &Mesh) -> Scene {
    let positions = mesh.positions.iter().map(|p| p.as_dvec3()).collect();
    let shape = scene::Mesh { positions, triangles: mesh.triangles.clone(), ..scene::Mesh::default() };
    let object = Object { name: "mesh".into(), input: 0, material: MaterialId(0), shape: Shape::Mesh(shape) };
    Scene { objects: vec![object], ..Scene::default() }
}

/// Camera and light for a picture of `size` by `size` pixels. The light is the scene's first point light; if there is
/// none, a light above and to the right of the camera, or below the ceiling inside.
///
/// # Errors
/// [`Error::Usage`] if the scene is empty or its camera is invalid.
pub fn view_setup(scene: &Scene, from: Viewpoint, size: u32) -> Result<ViewSetup> {
    let nothing =
        || Error::usage("there is nothing in it to look at", "`kiln info` says what the file holds");
    let bounds = scene.bounds().ok_or_else(nothing)?;
    let outside =
        || fitted_camera(scene, StandardView::Auto, 1.0, Projection::Perspective).ok_or_else(nothing);
    let camera = match from {
        Viewpoint::Scene => scene.default_camera().cloned().map_or_else(outside, Ok)?,
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

/// To the right of and above the camera by half the size of the scene each.
fn light_outside(camera: &Camera, (min, max): (DVec3, DVec3)) -> DVec3 {
    let right = (camera.target - camera.position).cross(camera.up).normalize_or(DVec3::X);
    camera.position + (max - min).length() / 2.0 * (right + camera.up.normalize_or(DVec3::Y))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DMat4;

    use super::*;
    use kiln::scene::{Placed, Placement};

    /// A shared mesh is measured once for each of its placements.
    #[test]
    fn placed_meshes_are_measured() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = Arc::new(scene::Mesh {
            positions: corners.into(),
            triangles: vec![[0, 1, 2]],
            ..scene::Mesh::default()
        });
        let object = |x: f64| {
            let placement = Placement::new(DMat4::from_translation(DVec3::X * x));
            let shape = Shape::Placed(Placed::new(Arc::clone(&mesh), placement));
            Object { name: "copy".into(), input: 0, material: MaterialId(0), shape }
        };
        let found = triangles(&Scene { objects: vec![object(0.0), object(5.0)], ..Scene::default() });
        assert_eq!((found.analytic_shapes, found.mesh.triangles), (0, vec![[0, 1, 2], [3, 4, 5]]));
        assert_eq!(found.mesh.positions[4], glam::vec3(6.0, 0.0, 0.0));
    }
}
