//! Moving a camera by hand: pure functions of a [`Camera`], called by what mouse and keys ask for.
//!
//! Nothing here has a size of its own: whatever a scene measures, what a step does is a share of the distance to the target or
//! of the picture. Whatever is asked, the camera stays one that [`View::new`] takes: a step that would lead elsewhere is not made.
//!
//! Turning is that of a turntable, as in f3d and Blender: the camera goes round the target about the scene's vertical axis and
//! over it up to the poles, where it stops and from where it can go anywhere. The picture is level at every step, because
//! each begins with the axis itself; nothing is added up.
//!
//! The viewing rectangle is brought to the target's distance by what changes its size ([`zoom`] and the lens), so that the
//! projection can be switched at any time and shows the target as large. Turning and moving leave the lens as it is.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use crate::scene::{Camera, MaterialId, Mesh, Object, Projection, Scene, Shape};
use crate::world::{StandardView, View, basis, fitted_camera};

/// How close to a pole the camera comes, in radians: a hundredth of a pixel beside it, and far enough for the axis to say which
/// way is up: eleven of sixteen digits remain.
const POLE: f64 = 1e-5;

/// Sines below this are rounding: is a camera level, is its up at right angles to its direction.
const LEVEL: f64 = 1e-9;

/// How near the target the camera comes, relative to the target's coordinates: twenty of the 53 bits of f64 remain for its direction.
const NEAREST: f64 = 1.0 / (1u64 << 32) as f64;

/// Angles of view that can be set, in radians.
const ANGLES: [f64; 2] = [1e-4, 2.9];

/// The camera's place in the scene: its axes, to the right, up and backwards, and its distance from the target.
struct CameraPose {
    u: DVec3,
    v: DVec3,
    w: DVec3,
    distance: f64,
}

impl CameraPose {
    /// `None` for a camera that cannot be used.
    fn of(camera: &Camera) -> Option<Self> {
        let [u, v, w] = basis(camera.position, camera.target, camera.up)?;
        let distance = length(camera.position - camera.target);
        (distance > 0.0 && distance.is_finite()).then_some(CameraPose { u, v, w, distance })
    }
}

/// Goes round the target: by angles in radians, `x` to the right of the camera and `y` up. Stops at the poles.
pub fn orbit(camera: &mut Camera, by: DVec2) {
    change(camera, |camera, pose| {
        let (axis, w) = turned(camera, pose, by);
        camera.up = axis;
        camera.position = camera.target + pose.distance * w;
    });
}

/// Turns on the spot: by angles in radians, `x` to the right and `y` up. Stops at the poles.
pub fn look_around(camera: &mut Camera, by: DVec2) {
    change(camera, |camera, pose| {
        // To look to the right is to stand to the left of what is looked at.
        let (axis, w) = turned(camera, pose, -by);
        camera.up = axis;
        camera.target = camera.position - pose.distance * w;
    });
}

/// Moves the picture: what lies at the target's distance moves by `by`, `x` to the right and `y` up, in shares of the picture's
/// height, so that it stays under the mouse that drags it. `aspect` is the picture's width divided by its height.
pub fn pan(camera: &mut Camera, by: DVec2, aspect: f64) {
    change(camera, |camera, pose| {
        let by = by * height_at_target(camera, pose, aspect);
        let step = -(by.x * pose.u + by.y * pose.v);
        camera.position += step;
        camera.target += step;
    });
}

/// Shows the target `factor` times as large: nearer in perspective, by a smaller rectangle where rays are parallel.
pub fn zoom(camera: &mut Camera, factor: f64) {
    zoom_about(camera, factor, camera.target);
}

/// [`zoom`] that leaves under the mouse what is there at the target's distance. `at` is the mouse's place from the picture's
/// middle, `x` to the right and `y` up, in shares of the picture's height; `aspect` its width divided by its height.
pub fn zoom_at(camera: &mut Camera, factor: f64, at: DVec2, aspect: f64) {
    let Some(pose) = CameraPose::of(camera) else { return };
    let at = at * height_at_target(camera, &pose, aspect);
    zoom_about(camera, factor, camera.target + at.x * pose.u + at.y * pose.v);
}

/// [`zoom`] that leaves a point of the scene where it is in the picture, such as the one that the mouse points at.
pub fn zoom_about(camera: &mut Camera, factor: f64, point: DVec3) {
    if !(factor > 0.0 && factor.is_finite()) {
        return;
    }
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        let share = 1.0 - 1.0 / factor;
        let towards = point - camera.target;
        match camera.projection {
            Projection::Perspective => {
                let distance = pose.distance / factor;
                let target = camera.target + share * towards;
                if distance < NEAREST * target.abs().max_element() && factor > 1.0 {
                    return;
                }
                camera.target = target;
                camera.position = target + distance * pose.w;
                scale_lens(camera, 1.0 / factor);
            }
            Projection::Orthographic => {
                let across = share * (towards - towards.dot(pose.w) * pose.w);
                camera.target += across;
                camera.position += across;
                scale_rectangle(camera, 1.0 / factor);
            }
        }
    });
}

/// Flies: to the right, up and forward by `by`, in distances to the target, which goes along.
pub fn fly(camera: &mut Camera, by: DVec3) {
    change(camera, |camera, pose| {
        let step = (by.x * pose.u + by.y * pose.v - by.z * pose.w) * pose.distance;
        camera.position += step;
        camera.target += step;
    });
}

/// Makes a point the target and brings it to the middle of the picture, looking the same way. In perspective the camera comes
/// no farther from it than it was from its target, and no nearer than it is, but for what lies beside or behind it; so do the sizes
/// of things that are as far as the target was.
pub fn focus(camera: &mut Camera, point: DVec3) {
    change(camera, |camera, pose| {
        let depth = (camera.position - point).dot(pose.w);
        let nearest = pose.distance / 1024.0;
        let distance = match camera.projection {
            Projection::Perspective if depth > 0.0 => {
                bring_rectangle_to_target(camera, pose);
                depth.clamp(nearest, pose.distance)
            }
            _ => pose.distance,
        };
        camera.target = point;
        camera.position = point + distance * pose.w;
        scale_lens(camera, distance / pose.distance);
    });
}

/// The angle of view from the bottom to the top of the viewing rectangle, in radians, as perspective has it.
pub fn field_of_view(camera: &Camera) -> f64 {
    2.0 * (camera.view_height / camera.viewpoint_distance / 2.0).atan()
}

/// Sets the vertical angle of view, in radians. In perspective the eye stays; where rays are parallel the picture does, and the
/// angle is that of the perspective that shows the target as large ([`set_lens`]).
pub fn set_field_of_view(camera: &mut Camera, angle: f64) {
    if camera.projection == Projection::Orthographic {
        return set_lens(camera, angle);
    }
    let Some(height) = height_at_one(angle) else { return };
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        scale_rectangle(camera, height * pose.distance / camera.view_height);
    });
}

/// Sets the vertical angle of view, in radians, and moves the eye so that the target is as large as before ("dolly zoom").
pub fn set_lens(camera: &mut Camera, angle: f64) {
    let Some(height) = height_at_one(angle) else { return };
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        let distance = camera.view_height / height;
        camera.position = camera.target + distance * pose.w;
        camera.viewpoint_distance = distance;
    });
}

/// Switches the projection; the target stays as large. Coming back to perspective the angle of view becomes `angle`, that of the
/// last perspective: what was zoomed in between would else have made a telescope or a fish-eye of it.
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

/// Shows all of a box, looking the same way through the same lens, with a twentieth of the picture free on the tightest sides.
/// `aspect` is the picture's width divided by its height.
pub fn frame(camera: &mut Camera, (min, max): (DVec3, DVec3), aspect: f64) {
    const FREE: f64 = 0.9;
    change(camera, |camera, pose| {
        bring_rectangle_to_target(camera, pose);
        let seen = height_at_target(camera, pose, aspect) * FREE;
        let middle = min / 2.0 + max / 2.0;
        // Of each corner, how far right of and above the middle, and how much nearer.
        let corners = (0..8).map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
            let p = DVec3::new(pick(0), pick(1), pick(2)) - middle;
            (DVec2::new(p.dot(pose.u), p.dot(pose.v)).abs() / DVec2::new(aspect, 1.0), p.dot(pose.w))
        });
        let needed = |(across, nearer): (DVec2, f64)| match camera.projection {
            // A corner is within when `across <= slope (distance - nearer)`.
            Projection::Perspective => nearer + across.max_element() / (seen / 2.0 / pose.distance),
            Projection::Orthographic => across.max_element() * 2.0 / seen,
        };
        let needed = corners.map(needed).fold(0.0, f64::max);
        if !(needed > 0.0 && needed.is_finite()) {
            return;
        }
        let distance = match camera.projection {
            Projection::Perspective => {
                scale_lens(camera, needed / pose.distance);
                needed
            }
            Projection::Orthographic => {
                scale_rectangle(camera, needed);
                // In front of everything: what is behind the camera is not seen in parallel either.
                let distance = pose.distance.max((max - min).length());
                camera.viewpoint_distance = distance;
                distance
            }
        };
        camera.target = middle;
        camera.position = middle + distance * pose.w;
    });
}

/// A camera that looks at all of a box from a standard side, as [`fitted_camera`] does at a scene, where only the scene's
/// bounds are at hand. `None` where the box has no extent.
pub fn standard(
    (min, max): (DVec3, DVec3),
    view: StandardView,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let positions = (0..8).map(corner).collect();
    let shape =
        Shape::Mesh(Mesh { positions, triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 0]], ..Mesh::default() });
    let object = Object { name: String::new(), input: 0, material: MaterialId(0), shape };
    fitted_camera(&Scene { objects: vec![object], ..Scene::default() }, view, aspect, projection)
}

/// Makes a step, unless it leads to where no camera can be.
fn change(camera: &mut Camera, step: impl FnOnce(&mut Camera, &CameraPose)) {
    let Some(pose) = CameraPose::of(camera) else { return };
    let mut next = camera.clone();
    step(&mut next, &pose);
    // In pictures of any shape.
    let usable = |projection, size| View::new(&next, projection, size).is_ok();
    let both = [Projection::Perspective, Projection::Orthographic];
    let sizes = [[65_535, 1], [1, 65_535]];
    if CameraPose::of(&next).is_some() && both.iter().all(|&p| sizes.iter().all(|&size| usable(p, size))) {
        *camera = next;
    }
}

/// The vertical axis, and the direction backwards of a camera that is turned about it to the right by `by.x` and up by `by.y`.
fn turned(camera: &Camera, pose: &CameraPose, by: DVec2) -> (DVec3, DVec3) {
    let axis = vertical(camera, pose);
    // Backwards, level. To the right is at right angles to the axis also where backwards is nearly along it.
    let level = pose.u.cross(axis).normalize_or(pose.v);
    let elevation = pose.w.dot(axis).atan2(pose.w.dot(level)) + by.y;
    let limit = FRAC_PI_2 - POLE;
    let ((sin, cos), (rise, reach)) = (by.x.sin_cos(), elevation.clamp(-limit, limit).sin_cos());
    let level = level * cos + axis.cross(level) * sin;
    (axis, (level * reach + axis * rise).normalize())
}

/// The axis that the camera is turned about. Its own up, where that says more than the picture's: it is the scene's +y where the
/// camera was fitted, or came as a matrix, and is level.
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

/// How much of the scene the picture shows from its bottom to its top, at the target's distance.
fn height_at_target(camera: &Camera, pose: &CameraPose, aspect: f64) -> f64 {
    // As `View` has it: more is seen along one axis, never less.
    let height = camera.view_width.map_or(camera.view_height, |width| camera.view_height.max(width / aspect));
    match camera.projection {
        Projection::Perspective => height * (pose.distance / camera.viewpoint_distance),
        Projection::Orthographic => height,
    }
}

/// Moves the viewing rectangle to the target; what is seen stays.
fn bring_rectangle_to_target(camera: &mut Camera, pose: &CameraPose) {
    if camera.projection == Projection::Perspective {
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

/// The length of a vector whose square may be beyond f64.
fn length(v: DVec3) -> f64 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).length() * largest } else { largest }
}

#[cfg(test)]
mod tests;
