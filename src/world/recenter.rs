//! Recentering: moves and scales scenes into the range that f32 represents well.
//!
//! Geometry is stored in f32, with 24 bits per coordinate: a mesh at a distance of a million times its size from the origin has 4
//! of them left for its shape. The surface areas of boxes near the ends of f32's range overflow or vanish in the builder. Both are
//! avoided in f64 beforehand: the centre of the scene is moved to the origin, and the scene is scaled by a power of two, which
//! does not round.

use glam::DVec3;

use super::WorldInputs;
use crate::scene::mesh::support::PointTrees;
use crate::scene::{Camera, DefaultLook, Ground, Scene, Shape, Step, bounds};

/// The largest distance from the origin, in sizes of the scene, at which 20 of 24 bits are left for its shape.
const FAR: f64 = 16.0;

/// Scenes whose size is beyond 2 to plus or minus this are scaled to about 1, so that areas and their products stay within
/// f32's range.
const LARGEST_EXPONENT: i32 = 40;

/// No coordinate is scaled beyond 2 to this, also of triangles that cannot be seen and do not count for the size.
const FARTHEST_EXPONENT: i32 = 59;

/// The translation and scale that were applied to a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recentering {
    /// The point of the original scene that is the origin of the recentered one.
    pub middle: DVec3,
    /// The scale after the translation, a power of two.
    pub scale: f64,
}

/// Recenters a scene. `None` where it already lies in the range that f32 represents well.
pub fn recenter(scene: &mut Scene) -> Option<Recentering> {
    let recentering = Recentering::of(scene)?;
    recentering.apply(scene);
    Some(recentering)
}

impl Recentering {
    /// The recentering of a scene; `None` where it already lies in the range that f32 represents well.
    pub fn of(scene: &Scene) -> Option<Self> {
        let (min, max) = scene.bounds()?;
        let size = (max - min).max_element();
        let middle = min / 2.0 + max / 2.0;
        let far = middle.abs().max_element() > FAR * size;
        let mut exponent = if size > 0.0 { size.log2().round() as i32 } else { 0 };
        let extreme = exponent.abs() > LARGEST_EXPONENT;
        if extreme {
            let (low, high) = bounds(&PointTrees::counting(&scene.objects, |_| true), &scene.objects)?;
            let farthest = (low - middle).abs().max((high - middle).abs()).max_element();
            exponent = exponent.max(farthest.log2().ceil() as i32 - FARTHEST_EXPONENT);
        }
        if !far && !extreme {
            return None;
        }
        Some(Recentering {
            middle: if far { middle } else { DVec3::ZERO },
            scale: if extreme { f64::from(-exponent).exp2() } else { 1.0 },
        })
    }

    /// Applies the translation and scale to a scene.
    pub fn apply(&self, scene: &mut Scene) {
        let place = |p: &mut DVec3| *p = (*p - self.middle) * self.scale;
        for object in &mut scene.objects {
            match &mut object.shape {
                Shape::Analytic(shape) => *shape = shape.recentred(self.middle, self.scale),
                Shape::Mesh(mesh) => mesh.positions.iter_mut().for_each(place),
                Shape::Placed(placed) => {
                    placed.placement.then(Step::Shift { middle: self.middle, scale: self.scale });
                }
            }
        }
        scene.cameras.iter_mut().for_each(|camera| self.move_camera(camera));
        for light in &mut scene.lights {
            light.kind.position_mut().into_iter().for_each(|position| *position -= self.middle);
            light.scale(self.scale);
        }
    }

    /// The camera in the recentered scene.
    pub fn moved(&self, camera: &Camera) -> Camera {
        let mut moved = camera.clone();
        self.move_camera(&mut moved);
        moved
    }

    /// The camera in original coordinates, from one in the recentered scene. [`Recentering::moved`] reverses this up to
    /// rounding in the original coordinates.
    pub fn moved_back(&self, camera: &Camera) -> Camera {
        let mut own = camera.clone();
        own.position = self.point_back(camera.position);
        own.target = self.point_back(camera.target);
        own.view_height /= self.scale;
        own.view_width = camera.view_width.map(|width| width / self.scale);
        own.viewpoint_distance /= self.scale;
        own.lens = camera.lens.map(|lens| lens.moved(1.0 / self.scale, |point| self.point_back(point)));
        own
    }

    /// A point in original coordinates, from one in the recentered scene.
    pub fn point_back(&self, point: DVec3) -> DVec3 {
        point / self.scale + self.middle
    }

    fn move_camera(&self, camera: &mut Camera) {
        camera.position = (camera.position - self.middle) * self.scale;
        camera.target = (camera.target - self.middle) * self.scale;
        camera.view_height *= self.scale;
        camera.view_width = camera.view_width.map(|width| width * self.scale);
        camera.viewpoint_distance *= self.scale;
        camera.lens = camera.lens.map(|lens| lens.moved(self.scale, |p| (p - self.middle) * self.scale));
    }
}

impl Ground {
    /// The ground under the recentered scene.
    fn recentered(self, &Recentering { middle, scale }: &Recentering) -> Self {
        Ground { centre: (self.centre - middle) * scale, half_side: self.half_side * scale, ..self }
    }
}

impl DefaultLook {
    /// The look of the recentered scene.
    pub(crate) fn recentered(&self, recentering: Option<&Recentering>) -> Self {
        let ground = self.ground.map(|ground| recentering.map_or(ground, |by| ground.recentered(by)));
        DefaultLook { ground, ..self.clone() }
    }
}

impl WorldInputs {
    /// Those of the recentered scene.
    pub(crate) fn recentered(&self, recentering: Option<&Recentering>) -> Self {
        let ground = self.ground.map(|ground| recentering.map_or(ground, |by| ground.recentered(by)));
        WorldInputs { ground, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    fn scene_of(positions: Vec<DVec3>) -> Scene {
        let triangles = vec![[0, 1, 2]];
        Scene::from_iter([Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() })])
    }

    /// A point at 1e18 beside a triangle of 1e-30, which would be at 1e48.
    #[test]
    fn triangles_that_cannot_be_seen_stay_in_range() {
        let mut scene = scene_of(vec![DVec3::ZERO, DVec3::X * 1e-30, DVec3::Y * 1e-30, DVec3::X * 1e18]);
        let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { unreachable!() };
        mesh.triangles.push([3; 3]);
        assert_eq!(scene.bounds(), Some((DVec3::ZERO, DVec3::new(1e-30, 1e-30, 0.0))));
        recenter(&mut scene);
        let Shape::Mesh(mesh) = &scene.objects[0].shape else { unreachable!() };
        assert!(mesh.positions[3].x.abs() <= 1e18);
    }

    #[test]
    fn extreme_sizes_become_one_by_a_power_of_two() {
        for size in [1e-30, 1e17] {
            let mut scene = scene_of(vec![DVec3::ZERO, DVec3::X * size, DVec3::Y * size]);
            let recentering = recenter(&mut scene).unwrap();
            assert_eq!(recentering.scale.to_bits() << 12, 0, "a power of two");
            let Shape::Mesh(mesh) = &scene.objects[0].shape else { unreachable!() };
            assert_eq!(mesh.positions[1].x, size * recentering.scale);
            assert!((0.7..1.5).contains(&mesh.positions[1].x));
        }
    }
}
