//! Inspection of one pixel of a render: the report of `kiln explain --pixel`, and its rays as line segments.

use glam::DVec3;

use kiln::bvh::{Tests, Traversal};
use kiln::effects::RayKind;
use kiln::effects::record::HitRecord;
use kiln::error::{Result, printable};
use kiln::film::DisplayTransform;
use kiln::job::RenderJob;
use kiln::job::pixel::PixelReport;
use kiln::scene::{Glaze, Material};
use kiln::world::{PreparedMaterial, World};

/// Result of inspecting a pixel.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// The pixel with its samples.
    pub report: PixelReport,
    /// The rays of the first sample, each before the shadow rays from its surface.
    pub rays: Vec<RaySegment>,
    /// Name and value of each parameter of the material that is hit first, in the values of the colour pipeline.
    pub material_values: Vec<(&'static str, String)>,
    /// Numbers of box and primitive tests of the first sample's camera ray, traced as a single ray.
    pub tests: Tests,
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
    let (mut traversal, mut rays) = (Traversal::default(), Vec::new());
    for ray in report.samples.first().into_iter().flat_map(|sample| &sample.rays) {
        let segment = |kind, origin: DVec3, direction: DVec3, length: f64, hit| {
            let length = if length.is_finite() { length } else { way_out(origin, bounds) };
            RaySegment { kind, from: origin, to: origin + direction * length, hit }
        };
        if ray.depth == 0 {
            let precision = job.world.numerics().ray_precision();
            let ray = precision.ray(ray.origin, ray.direction, 0.0, f64::INFINITY);
            job.world.accelerator.closest_hit(&ray, &mut traversal);
        }
        let t = ray.hit.as_ref().map_or(f64::INFINITY, |hit| hit.t);
        rays.push(segment(ray.kind, ray.origin, ray.direction, t, ray.hit.is_some()));
        rays.extend(ray.occlusion_tests().map(|test| {
            let t = test.occluder.as_ref().map_or(test.length, |occluder| occluder.t);
            segment(test.kind, test.origin, test.direction, t, test.is_occluded)
        }));
    }
    job.move_back(&mut report);
    let mut inspection = Inspection { report, rays, material_values: Vec::new(), tests: traversal.tests };
    let material = inspection.surface().map(|hit| &job.world.materials[hit.material_index as usize]);
    inspection.material_values =
        material.map_or(Vec::new(), |material| material_values(&job.world, material));
    Ok(inspection)
}

/// Names and values of a material's parameters and textures.
fn material_values(world: &World, material: &PreparedMaterial) -> Vec<(&'static str, String)> {
    let colour = |c: DVec3| {
        let [r, g, b] = world.pipeline.encode(c.as_vec3().to_array());
        format!("#{r:02x}{g:02x}{b:02x}")
    };
    let mut values = match material {
        Material::Phong(m) => {
            let mut values = vec![
                ("colour", colour(m.colour)),
                ("ambient", m.ambient.to_string()),
                ("diffuse", m.diffuse.to_string()),
                ("specular", m.specular.to_string()),
                ("shininess", m.shininess.to_string()),
            ];
            values.extend(m.glaze.map(|Glaze { weight, own_weight, bounces }| {
                let times = if bounces == 1 { "bounce" } else { "bounces" };
                ("glaze", format!("{weight} of what is mirrored, {own_weight} of its own, {bounces} {times}"))
            }));
            values
        }
        Material::MetallicRoughness(m) => {
            let mut values = vec![
                ("base colour", colour(m.base_colour)),
                ("metallic", m.metallic.to_string()),
                ("roughness", m.roughness.to_string()),
            ];
            let layers = m.layers.numbers().into_iter().filter(|(_, value, none)| value != none);
            values.extend(layers.map(|(name, value, _)| (name, value.to_string())));
            if m.emission != DVec3::ZERO {
                values.push(("emission", format!("{} {} {}", m.emission.x, m.emission.y, m.emission.z)));
            }
            if m.unlit {
                values.push(("unlit", "yes".into()));
            }
            values
        }
    };
    values.extend(material.textures().iter().filter_map(|(slot, texture)| {
        let image = world.images.get(texture.image.0 as usize)?;
        let size = format!("{} x {}", image.width, image.height);
        Some((slot.entry().name, format!("picture {} ({size})", printable(&image.name))))
    }));
    values
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
