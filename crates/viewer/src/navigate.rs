//! Interactive camera navigation: pure functions of a [`Camera`].
//!
//! All amounts are relative to the distance to the target or to the picture's height, so they do not depend on the
//! scene's scale. A change after which [`View::new`] would reject the camera is discarded.
//!
//! Rotation is turntable rotation, as in f3d and Blender: azimuth about the scene's vertical axis, and elevation,
//! clamped at the poles. Each step starts from the axis itself, so the picture stays level without accumulated error.
//!
//! Functions that change the size of the viewing rectangle ([`zoom`] and the field of view) first move it to the
//! target's distance. The projection can then be switched without a change of the target's size in the picture.
//! Rotation and translation keep the field of view.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use kiln::scene::{Camera, Projection};
use kiln::world::{View, basis};

/// Minimum angle between camera and pole in radians: a hundredth of a pixel, and large enough that the direction of up
/// keeps eleven of sixteen digits.
const POLE: f64 = 1e-5;

/// Sines below this are rounding errors, in the tests whether a camera is level and whether its up is perpendicular to
/// its direction.
const LEVEL: f64 = 1e-9;

/// Minimum distance to the target, relative to the target's coordinates: the view direction keeps 20 of the 53 bits of
/// `f64`.
const NEAREST: f64 = 1.0 / (1u64 << 32) as f64;

/// Heights of the picture at the target's distance at which zooming ends, relative to the scene's size.
const HEIGHTS: [f64; 2] = [1e-5, 5.0];

/// Range of the vertical field of view that can be set, in radians.
const ANGLES: [f64; 2] = [1e-4, 2.9];

/// The camera's axes (right, up, backwards) and its distance from the target.
struct CameraPose {
    u: DVec3,
    v: DVec3,
    w: DVec3,
    distance: f64,
}

impl CameraPose {
    /// `None` for an invalid camera.
    fn of(camera: &Camera) -> Option<Self> {
        let [u, v, w] = basis(camera.position, camera.target, camera.up)?;
        let distance = length(camera.position - camera.target);
        (distance > 0.0 && distance.is_finite()).then_some(CameraPose { u, v, w, distance })
    }

    /// The coordinates of a vector along right, up and backwards.
    fn coordinates(&self, by: DVec3) -> DVec3 {
        DVec3::new(by.dot(self.u), by.dot(self.v), by.dot(self.w))
    }
}

/// Orbits around a point by angles in radians, `x` to the right of the camera and `y` up. Clamped at the poles. The point
/// keeps its position in the picture.
pub fn orbit(camera: &mut Camera, by: DVec2, around: DVec3) {
    change(camera, |camera, pose| {
        let (axis, w) = turned(camera, pose, by);
        let Some(after) = basis(w, DVec3::ZERO, axis) else { return };
        let from_target = pose.coordinates(around - camera.target);
        camera.up = axis;
        camera.target = around - at(after, from_target);
        camera.position = camera.target + pose.distance * w;
    });
}

/// Where a point goes with a camera: it keeps its direction from the target for the camera, and its distance relative to
/// that of the camera or the size of an orthographic picture. So a point that is orbited stays in the picture while the
/// camera is panned or zooms.
pub fn carried(point: DVec3, before: &Camera, after: &Camera) -> DVec3 {
    let (Some(old), Some(new)) = (CameraPose::of(before), CameraPose::of(after)) else { return point };
    let scale = match (before.projection.is_central(), after.projection.is_central()) {
        (true, true) => new.distance / old.distance,
        (false, false) => after.view_height / before.view_height,
        _ => 1.0,
    };
    after.target + at([new.u, new.v, new.w], scale * old.coordinates(point - before.target))
}

/// The vector of coordinates in a basis.
fn at([u, v, w]: [DVec3; 3], by: DVec3) -> DVec3 {
    by.x * u + by.y * v + by.z * w
}

/// Rotates about the eye by angles in radians, `x` to the right and `y` up. Clamped at the poles.
pub fn look_around(camera: &mut Camera, by: DVec2) {
    change(camera, |camera, pose| {
        // Looking to the right moves the camera to the left as seen from the target, hence the sign.
        let (axis, w) = turned(camera, pose, -by);
        camera.up = axis;
        camera.target = camera.position - pose.distance * w;
    });
}

/// Translates the camera so that points at the target's distance move by `by` in the picture, `x` to the right and `y`
/// up, in fractions of the picture's height: a dragged point stays under the mouse. `aspect` is the picture's width
/// divided by its height.
pub fn pan(camera: &mut Camera, by: DVec2, aspect: f64) {
    change(camera, |camera, pose| {
        let by = by * height_at_target(camera, pose, aspect);
        let step = -(by.x * pose.u + by.y * pose.v);
        camera.position += step;
        camera.target += step;
    });
}

/// Magnifies the target by `factor`: by a smaller distance in perspective, by a smaller viewing rectangle in
/// orthographic projection.
pub fn zoom(camera: &mut Camera, factor: f64) {
    zoom_about(camera, factor, camera.target);
}

/// [`zoom`] that keeps the point under the mouse, at the target's distance, in place. `at` is the mouse position
/// relative to the picture's centre, `x` to the right and `y` up, in fractions of the picture's height; `aspect` is its
/// width divided by its height.
pub fn zoom_at(camera: &mut Camera, factor: f64, at: DVec2, aspect: f64) {
    let Some(pose) = CameraPose::of(camera) else { return };
    let at = at * height_at_target(camera, &pose, aspect);
    zoom_about(camera, factor, camera.target + at.x * pose.u + at.y * pose.v);
}

/// The zoom factor, limited so that the height of the picture at the target's distance stays in proportion to the size
/// of the scene.
pub fn limited_zoom(camera: &Camera, factor: f64, size: f64) -> f64 {
    let Some(pose) = CameraPose::of(camera) else { return factor };
    // Of the widest picture, so that the viewing rectangle is not extended.
    let share = height_at_target(camera, &pose, f64::INFINITY) / size;
    let [least, most] = HEIGHTS;
    if share.is_finite() { factor.min((share / least).max(1.0)).max((share / most).min(1.0)) } else { factor }
}

/// [`zoom`] that keeps the position of a scene point in the picture.
pub fn zoom_about(camera: &mut Camera, factor: f64, point: DVec3) {
    if !(factor > 0.0 && factor.is_finite()) {
        return;
    }
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        let share = 1.0 - 1.0 / factor;
        let towards = point - camera.target;
        if camera.projection.is_central() {
            let distance = pose.distance / factor;
            let target = camera.target + share * towards;
            if distance < NEAREST * target.abs().max_element() && factor > 1.0 {
                return;
            }
            camera.target = target;
            camera.position = target + distance * pose.w;
            scale_lens(camera, 1.0 / factor);
        } else {
            let across = share * (towards - towards.dot(pose.w) * pose.w);
            camera.target += across;
            camera.position += across;
            scale_rectangle(camera, 1.0 / factor);
        }
    });
}

/// Moves camera and target to the right, up and forward by `by`, in units of the distance to the target.
pub fn fly(camera: &mut Camera, by: DVec3) {
    change(camera, |camera, pose| {
        let step = (by.x * pose.u + by.y * pose.v - by.z * pose.w) * pose.distance;
        camera.position += step;
        camera.target += step;
    });
}

/// Makes a point the target and moves it to the picture's centre, without rotation. In perspective, the new distance is
/// the point's depth, at most the old distance to the target and at least 1/1024 of it; for points beside or behind the
/// camera it is the old distance.
pub fn focus(camera: &mut Camera, point: DVec3) {
    change(camera, |camera, pose| {
        let depth = (camera.position - point).dot(pose.w);
        let nearest = pose.distance / 1024.0;
        let distance = if camera.projection.is_central() && depth > 0.0 {
            bring_rectangle_to_target(camera, pose);
            depth.clamp(nearest, pose.distance)
        } else {
            pose.distance
        };
        camera.target = point;
        camera.position = point + distance * pose.w;
        scale_lens(camera, distance / pose.distance);
    });
}

/// The vertical field of view in radians, of the perspective projection.
pub fn field_of_view(camera: &Camera) -> f64 {
    2.0 * (camera.view_height / camera.viewpoint_distance / 2.0).atan()
}

/// Sets the vertical field of view in radians. In perspective the eye keeps its position. In orthographic projection
/// the picture does not change; the value applies to the perspective projection that shows the target at the same size
/// ([`set_lens`]).
pub fn set_field_of_view(camera: &mut Camera, angle: f64) {
    if !camera.projection.is_central() {
        return set_lens(camera, angle);
    }
    let Some(height) = height_at_one(angle) else { return };
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        scale_rectangle(camera, height * pose.distance / camera.view_height);
    });
}

/// Sets the vertical field of view in radians, and moves the eye so that the target keeps its size ("dolly zoom").
fn set_lens(camera: &mut Camera, angle: f64) {
    let Some(height) = height_at_one(angle) else { return };
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        let distance = camera.view_height / height;
        camera.position = camera.target + distance * pose.w;
        camera.viewpoint_distance = distance;
    });
}

/// Switches the projection; the target keeps its size. Perspective gets the vertical field of view `angle`, that of the
/// last perspective: otherwise orthographic zooming in between would change it.
pub fn switch_projection(camera: &mut Camera, projection: Projection, angle: f64) {
    if camera.projection == projection {
        return;
    }
    let before = camera.clone();
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        camera.projection = projection;
    });
    if projection == Projection::Perspective && *camera != before {
        set_lens(camera, angle);
    }
}

/// Applies a change, unless the resulting camera is invalid in either projection.
fn change(camera: &mut Camera, step: impl FnOnce(&mut Camera, &CameraPose)) {
    let Some(pose) = CameraPose::of(camera) else { return };
    let mut next = camera.clone();
    step(&mut next, &pose);
    // At any aspect ratio.
    let usable = |projection, size| View::new(&next, projection, size).is_ok();
    let both = [Projection::Perspective, Projection::Orthographic];
    let sizes = [[65_535, 1], [1, 65_535]];
    if CameraPose::of(&next).is_some() && both.iter().all(|&p| sizes.iter().all(|&size| usable(p, size))) {
        *camera = next;
    }
}

/// The vertical axis, and the backward direction after a rotation about it by `by.x` to the right and an elevation by
/// `by.y`.
fn turned(camera: &Camera, pose: &CameraPose, by: DVec2) -> (DVec3, DVec3) {
    let axis = vertical(camera, pose);
    // The horizontal backward direction, from `u`, which is perpendicular to the axis also near the poles.
    let level = pose.u.cross(axis).normalize_or(pose.v);
    let elevation = pose.w.dot(axis).atan2(pose.w.dot(level)) + by.y;
    let limit = FRAC_PI_2 - POLE;
    let ((sin, cos), (rise, reach)) = (by.x.sin_cos(), elevation.clamp(-limit, limit).sin_cos());
    let level = level * cos + axis.cross(level) * sin;
    (axis, (level * reach + axis * rise).normalize())
}

/// The axis of rotation. An up vector that is not perpendicular to the view direction is the axis itself. A
/// perpendicular one may come from a matrix or a fitted camera: then the axis is the scene's y axis if the camera is
/// level, else the up vector.
fn vertical(camera: &Camera, pose: &CameraPose) -> DVec3 {
    let up = camera.up / camera.up.abs().max_element();
    let up = up.normalize_or(DVec3::Y);
    let says_more = up.dot(pose.w).abs() > LEVEL;
    let is_level = pose.u.y.abs() <= LEVEL;
    match (says_more, is_level) {
        (false, true) if pose.v.y < -LEVEL => -DVec3::Y,
        (false, true) => DVec3::Y,
        _ => up,
    }
}

/// Height of the visible area at the target's distance.
fn height_at_target(camera: &Camera, pose: &CameraPose, aspect: f64) -> f64 {
    // As in `View`: the viewing rectangle is extended along one axis, never cropped.
    let height = camera.view_width.map_or(camera.view_height, |width| camera.view_height.max(width / aspect));
    if camera.projection.is_central() { height * (pose.distance / camera.viewpoint_distance) } else { height }
}

/// Moves the viewing rectangle to the target's distance, without a change of the picture.
fn bring_rectangle_to_target(camera: &mut Camera, pose: &CameraPose) {
    if camera.projection.is_central() {
        scale_rectangle(camera, pose.distance / camera.viewpoint_distance);
    }
    camera.viewpoint_distance = pose.distance;
}

fn scale_rectangle(camera: &mut Camera, factor: f64) {
    camera.view_height *= factor;
    camera.view_width = camera.view_width.map(|width| width * factor);
}

fn scale_lens(camera: &mut Camera, factor: f64) {
    scale_rectangle(camera, factor);
    camera.viewpoint_distance *= factor;
}

/// The height of a viewing rectangle at a distance of 1.
fn height_at_one(angle: f64) -> Option<f64> {
    angle.is_finite().then(|| 2.0 * (angle.clamp(ANGLES[0], ANGLES[1]) / 2.0).tan())
}

/// The length of a vector, without overflow of its square.
fn length(v: DVec3) -> f64 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).length() * largest } else { largest }
}

#[cfg(test)]
mod tests;
