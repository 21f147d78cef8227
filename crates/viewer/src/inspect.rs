//! Inspection of one pixel of a render: the report of `kiln explain --pixel`, and its rays as line segments.

use glam::DVec3;

use kiln::effects::RayKind;
use kiln::effects::record::HitRecord;
use kiln::error::Result;
use kiln::film::DisplayTransform;
use kiln::job::RenderJob;
use kiln::job::pixel::PixelReport;

/// Result of inspecting a pixel.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// The pixel with its samples.
    pub report: PixelReport,
    /// The rays of the first sample, each before the shadow rays from its surface.
    pub rays: Vec<RaySegment>,
}

impl Inspection {
    /// The surface that the first sample's camera ray hits.
    pub fn surface(&self) -> Option<&HitRecord> {
        self.report.samples.first()?.rays.first()?.hit.as_ref()
    }
}

/// A traced ray as a line segment, in world coordinates for [`kiln::world::View::project_segment`].
#[derive(Debug, Clone, PartialEq)]
pub struct RaySegment {
    /// Ray kind.
    pub kind: RayKind,
    /// Origin.
    pub from: DVec3,
    /// End point: the hit, the light, or a point outside the scene.
    pub to: DVec3,
    /// Whether the ray hits anything.
    pub hit: bool,
}

/// Inspects a pixel of the picture of `job`. `bounds` is the bounding box of the recentered scene, outside which rays
/// that miss end. `displays` are the display transforms that the render and the displayed image used.
///
/// # Errors
/// [`kiln::error::Error::Memory`] if there is no memory for a pixel.
pub fn inspect(
    job: &RenderJob,
    bounds: Option<(DVec3, DVec3)>,
    displays: [DisplayTransform; 2],
    pixel: [u32; 2],
) -> Result<Inspection> {
    let first = job.plan.sampling.first_sample();
    let mut report = job.pixel_report(pixel, first, displays, false)?;
    let mut rays = Vec::new();
    for ray in report.samples.first().into_iter().flat_map(|sample| &sample.rays) {
        let segment = |kind, origin: DVec3, direction: DVec3, length: f64, hit| {
            let length = if length.is_finite() { length } else { way_out(origin, bounds) };
            RaySegment { kind, from: origin, to: origin + direction * length, hit }
        };
        let t = ray.hit.as_ref().map_or(f64::INFINITY, |hit| hit.t);
        rays.push(segment(ray.kind, ray.origin, ray.direction, t, ray.hit.is_some()));
        rays.extend(ray.occlusion_tests().map(|test| {
            let t = test.occluder.as_ref().map_or(test.length, |occluder| occluder.t);
            segment(test.kind, test.origin, test.direction, t, test.is_occluded)
        }));
    }
    job.move_back(&mut report);
    Ok(Inspection { report, rays })
}

/// A distance at which a ray from `origin` in any direction is outside the bounding sphere, by at least a quarter of
/// its radius.
fn way_out(origin: DVec3, bounds: Option<(DVec3, DVec3)>) -> f64 {
    let (min, max) = bounds.unwrap_or((-DVec3::ONE, DVec3::ONE));
    let (middle, radius) = (min / 2.0 + max / 2.0, (max / 2.0 - min / 2.0).length());
    (origin - middle).length() + 1.25 * radius
}

#[cfg(test)]
mod tests;
