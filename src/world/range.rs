//! Scenes that f32 cannot hold well are moved and scaled before they are prepared.
//!
//! Geometry is kept in f32, which has 24 bits for a coordinate: a mesh a million times its own size away from the origin
//! has 4 of them left for its shape. And boxes of a size near the ends of f32's range have areas beyond it, which the
//! builder weighs. Both are cured in f64 beforehand: the scene's middle is moved to the origin, and everything is scaled
//! by a power of two, which changes no digit.

use glam::DVec3;

use crate::scene::{Camera, Falloff, LightKind, Scene, Shape, Step};

/// How far from the origin, in sizes of its own, a scene may lie and keep 20 of 24 bits.
const FAR: f64 = 16.0;

/// Sizes beyond these powers of two are scaled to 1: areas and their products then stay well within f32's range.
const LARGEST_EXPONENT: i32 = 40;

/// What was done to a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The point that is now the origin.
    pub middle: DVec3,
    /// The factor that everything was then scaled by.
    pub scale: f64,
}

/// Moves and scales a scene into the range that f32 holds well. `None` where it is there already.
pub fn bring_into_range(scene: &mut Scene) -> Option<Range> {
    let (min, max) = scene.bounds()?;
    let size = (max - min).max_element();
    let middle = min / 2.0 + max / 2.0;
    let far = middle.abs().max_element() > FAR * size;
    let exponent = if size > 0.0 { size.log2().round() as i32 } else { 0 };
    let extreme = exponent.abs() > LARGEST_EXPONENT;
    if !far && !extreme {
        return None;
    }
    let range = Range {
        middle: if far { middle } else { DVec3::ZERO },
        scale: if extreme { f64::from(-exponent).exp2() } else { 1.0 },
    };
    range.apply(scene);
    Some(range)
}

impl Range {
    /// Moves and scales a scene.
    pub fn apply(&self, scene: &mut Scene) {
        let place = |p: &mut DVec3| *p = (*p - self.middle) * self.scale;
        for object in &mut scene.objects {
            match &mut object.shape {
                Shape::Sphere { centre, radius } => {
                    place(centre);
                    *radius *= self.scale;
                }
                Shape::Mesh(mesh) => mesh.positions.iter_mut().for_each(place),
                Shape::Placed(placed) => {
                    placed.placement.then(Step::Shift { middle: self.middle, scale: self.scale });
                }
            }
        }
        scene.cameras.iter_mut().for_each(|camera| self.move_camera(camera));
        for light in &mut scene.lights {
            match &mut light.kind {
                LightKind::Directional { .. } => {}
                LightKind::Point { position, falloff } | LightKind::Spot { position, falloff, .. } => {
                    place(position);
                    if let Falloff::InverseSquare { range: reach } = falloff {
                        *reach = reach.map(|reach| reach * self.scale);
                        light.intensity *= self.scale * self.scale;
                    }
                }
            }
        }
    }

    /// The camera in the moved scene.
    pub fn moved(&self, camera: &Camera) -> Camera {
        let mut moved = camera.clone();
        self.move_camera(&mut moved);
        moved
    }

    /// The camera in the scene as it is described, of one in the moved scene. Rounded to what can be said there: what
    /// [`Range::moved`] makes of it may lie beside the camera by the last digits of the scene's own coordinates.
    pub fn moved_back(&self, camera: &Camera) -> Camera {
        let mut own = camera.clone();
        own.position = self.point_back(camera.position);
        own.target = self.point_back(camera.target);
        own.view_height /= self.scale;
        own.view_width = camera.view_width.map(|width| width / self.scale);
        own.viewpoint_distance /= self.scale;
        own
    }

    /// A point of the moved scene, in the scene's own coordinates.
    pub fn point_back(&self, point: DVec3) -> DVec3 {
        point / self.scale + self.middle
    }

    fn move_camera(&self, camera: &mut Camera) {
        camera.position = (camera.position - self.middle) * self.scale;
        camera.target = (camera.target - self.middle) * self.scale;
        camera.view_height *= self.scale;
        camera.view_width = camera.view_width.map(|width| width * self.scale);
        camera.viewpoint_distance *= self.scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{MaterialId, Mesh, Object};

    fn scene_of(positions: Vec<DVec3>) -> Scene {
        let shape = Shape::Mesh(Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() });
        Scene {
            objects: vec![Object { name: "m".into(), input: 0, material: MaterialId(0), shape }],
            ..Scene::default()
        }
    }

    #[test]
    fn ordinary_scenes_stay_as_they_are() {
        let mut scene = scene_of(vec![DVec3::ZERO, DVec3::new(1e5, 0.0, 0.0), DVec3::new(5e4, 3.0, 1e5)]);
        assert_eq!(bring_into_range(&mut scene), None);
        assert_eq!(bring_into_range(&mut Scene::default()), None);
    }

    #[test]
    fn far_scenes_keep_their_digits() {
        // Corners a thousandth apart at a million: f32's step there is 1/16.
        let far = DVec3::new(1e6, 0.0, -1e6);
        let corners = [DVec3::ZERO, DVec3::X * 1e-3, DVec3::Y * 1e-3];
        let mut scene = scene_of(corners.iter().map(|c| *c + far).collect());
        let range = bring_into_range(&mut scene).unwrap();
        assert_eq!(range.scale, 1.0);
        let Shape::Mesh(mesh) = &scene.objects[0].shape else { unreachable!() };
        let edge = mesh.positions[1] - mesh.positions[0];
        assert!((edge.x - 1e-3).abs() < 1e-9 && edge.x as f32 > 0.0);
        assert_eq!(mesh.positions[1], corners[1] + far - range.middle);
    }

    #[test]
    fn extreme_sizes_become_one_by_a_power_of_two() {
        for size in [1e-30, 1e17] {
            let mut scene = scene_of(vec![DVec3::ZERO, DVec3::X * size, DVec3::Y * size]);
            let range = bring_into_range(&mut scene).unwrap();
            assert_eq!(range.scale.to_bits() << 12, 0, "a power of two");
            let Shape::Mesh(mesh) = &scene.objects[0].shape else { unreachable!() };
            assert_eq!(mesh.positions[1].x, size * range.scale);
            assert!((0.7..1.5).contains(&mesh.positions[1].x));
        }
    }
}
