//! Moving a camera.
use glam::{DVec2, DVec3};
use crate::scene::Camera;
pub fn orbit(camera: &mut Camera, by: DVec2) { let d = camera.position - camera.target; camera.position = camera.target + glam::DQuat::from_rotation_y(-by.x) * d; }
pub fn pan(_camera: &mut Camera, _by: DVec2) {}
pub fn zoom(_camera: &mut Camera, _factor: f64) {}
pub fn fly(_camera: &mut Camera, _by: DVec3) {}
pub fn look_around(_camera: &mut Camera, _by: DVec2) {}
pub fn focus(_camera: &mut Camera, _point: DVec3) {}
pub fn field_of_view(_camera: &Camera) -> f64 { 0.7 }
pub fn set_field_of_view(_camera: &mut Camera, _angle: f64) {}
