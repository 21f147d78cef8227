//! A note with a camera inside, for scenes such as a closed house, which hide most of their objects.

use std::collections::HashSet;
use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{CameraChoice, RenderControl, RenderJob};
use crate::bvh::Traversal;
use crate::error::{Result, Warnings};
use crate::render::aov::{self, AovSelection};
use crate::scene::{Camera, INLINE_NAME};
use crate::world::StandardView;

/// The least number of objects of such a scene, and the part of them that is seen from outside at most.
const LEAST_OBJECTS: usize = 8;
const MOST_SEEN: f64 = 0.25;

/// Rays from the middle of the scene in all directions, and the part of them that hits something at least.
const RAYS: u32 = 64;
const LEAST_HIT: f64 = 0.9;

/// Horizontal directions in which the camera may stand, how far out it stands of the free distance, and its vertical field of
/// view in degrees.
const SIDES: u32 = 16;
const FAR_OUT: f64 = 0.85;
const FIELD_OF_VIEW: f64 = 60.0;

/// Notes a camera inside, where an automatic one looks at walls about the middle of the scene and sees few of its objects.
pub(super) fn note(job: &RenderJob, warnings: &mut Warnings) -> Result<()> {
    let is_chosen = matches!(job.settings.camera, CameraChoice::Named(_) | CameraChoice::Given(_));
    let of_files = job.world.objects.len() - usize::from(job.world.ground.is_some());
    if is_chosen || job.camera.name != StandardView::Auto.name() || of_files < LEAST_OBJECTS {
        return Ok(());
    }
    let middle = job.camera.target;
    let free = |direction: DVec3| {
        let ray = job.world.numerics().ray_precision().ray(middle, direction, 0.0, f64::INFINITY);
        job.world.accelerator.closest_hit(&ray, &mut Traversal::default()).map(|hit| hit.t)
    };
    // A Fibonacci lattice on the sphere.
    let spiral = |i: u32| {
        let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(RAYS);
        let (sin, cos) = (f64::from(i) * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let radius = (1.0 - y * y).sqrt();
        DVec3::new(radius * sin, y, radius * cos)
    };
    let hits = (0..RAYS).filter(|&i| free(spiral(i)).is_some()).count();
    if (hits as f64) < LEAST_HIT * f64::from(RAYS) {
        return Ok(());
    }
    let seen = seen_objects(job)?;
    if seen as f64 > MOST_SEEN * of_files as f64 {
        return Ok(());
    }
    let side = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(SIDES)).sin_cos();
        DVec3::new(sin, 0.0, cos)
    };
    let free_sides: Vec<f64> = (0..SIDES).map(|i| free(side(i)).unwrap_or(0.0)).collect();
    let Some(best) = (0..SIDES as usize).max_by(|&a, &b| free_sides[a].total_cmp(&free_sides[b])) else {
        return Ok(());
    };
    let position = middle + FAR_OUT * free_sides[best] * side(best as u32);
    let place = |point: DVec3| job.recentering.map_or(point, |by| by.point_back(point));
    let [position, target] = [position, middle].map(place);
    let digit = 10f64.powf(position.distance(target).log10().floor() - 3.0);
    // Divided, so that the decimal numbers are short.
    let rounded = |point: DVec3| (point / digit).round() / digit.recip().round().max(1.0);
    let [position, target] = match digit < 1.0 {
        true => [position, target].map(rounded),
        false => [position, target].map(DVec3::round),
    };
    let fov = FIELD_OF_VIEW.to_radians();
    let camera = Camera::from_field_of_view(INLINE_NAME.into(), position, target, DVec3::Y, fov);
    warnings.note(format!(
        "the scene is closed: {seen} of {of_files} objects are seen from outside; --camera '{}' is inside",
        camera.to_inline()
    ));
    Ok(())
}

/// The number of objects in a small picture, whose AOVs leave out the ground.
fn seen_objects(job: &RenderJob) -> Result<usize> {
    let small = job.to_be_metered(None)?;
    let selection = AovSelection::new(&["object".to_owned()])?;
    let objects = aov::channels(&small.aov_source(None), &selection, &RenderControl::default())?;
    let seen: HashSet<u32> = objects[0].values.iter().filter(|&&o| o >= 0.0).map(|&o| o as u32).collect();
    Ok(seen.len())
}
