//! Lights with an area as surfaces of the world: emissive objects behind those of the scene.

use glam::DVec3;

use super::PreparedMaterial;
use super::rectangle::Rectangle;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{Light, LightSurface, Material, MaterialId, Object, Phong, Scene, Shape};

/// The lights with an area that a scene has.
#[derive(Debug, Clone, Default)]
pub(crate) struct AreaLights {
    /// Their names.
    pub(crate) names: Vec<String>,
    /// The number of those that emit from the front alone: the last objects of the scene.
    pub(super) one_sided: usize,
    /// The rectangles among these: the last, in this order, two triangles each.
    pub(super) rectangles: Vec<Rectangle>,
}

impl AreaLights {
    /// Adds the surfaces of a scene's lights to its objects, and their materials to `materials`. Lights without
    /// radiance are left out, as punctual lights are. The surfaces are black, and both sides of a rectangle look alike
    /// in local shading.
    pub(super) fn add_surfaces(
        scene: &mut Scene,
        materials: &mut Vec<PreparedMaterial>,
        pipeline: ColourPipeline,
    ) -> Self {
        let mut lights = AreaLights::default();
        let mut surfaces = Vec::new();
        for light in &scene.lights {
            let Some((surface, factor)) = light.kind.surface() else { continue };
            let (shape, is_one_sided, rectangle) = match surface {
                LightSurface::Analytic { shape, is_one_sided } => {
                    (Shape::Analytic(shape), is_one_sided, None)
                }
                LightSurface::Rectangle { centre, normal, up, size } => {
                    let Some(rectangle) = Rectangle::new(centre, normal, up, size) else { continue };
                    (Shape::Mesh(rectangle.mesh()), true, Some(rectangle))
                }
            };
            let radiance = light.colour.to_pipeline(pipeline) * light.intensity * factor;
            if radiance == DVec3::ZERO || !radiance.is_finite() {
                continue;
            }
            materials.push(material(light, radiance));
            let material = MaterialId((materials.len() - 1) as u32);
            let object = Object { name: light.name.clone(), input: 0, material, shape };
            surfaces.push((is_one_sided, rectangle, object));
        }
        surfaces.sort_by_key(|(is_one_sided, rectangle, _)| (*is_one_sided, rectangle.is_some()));
        for (is_one_sided, rectangle, object) in surfaces {
            lights.one_sided += usize::from(is_one_sided);
            lights.names.push(object.name.clone());
            lights.rectangles.extend(rectangle);
            scene.objects.push(object);
        }
        lights
    }
}

/// Whether a light that has an area, and is not black or off, has a radiance that is finite and not zero.
pub(crate) fn has_radiance(light: &Light) -> bool {
    let is_off = light.intensity == 0.0 || light.colour.to_pipeline(ColourPipeline::Linear) == DVec3::ZERO;
    let Some((surface, factor)) = light.kind.surface() else { return true };
    let has_surface = match surface {
        LightSurface::Rectangle { centre, normal, up, size } => {
            Rectangle::new(centre, normal, up, size).is_some()
        }
        LightSurface::Analytic { .. } => {
            light.kind.clone().direction_mut().is_none_or(|direction| *direction != DVec3::ZERO)
        }
    };
    let radiance = light.intensity * factor;
    is_off || has_surface && radiance.is_finite() && radiance != 0.0
}

/// A black material of the given emission, in the numbers of the pipeline.
fn material(light: &Light, emission: DVec3) -> PreparedMaterial {
    let material = Material::Phong(Phong {
        name: light.name.clone(),
        colour: Colour::Linear(DVec3::ZERO),
        ambient: 0.0,
        diffuse: 0.0,
        emission: Colour::Linear(emission),
        ..Phong::default()
    });
    material.map_colours(|colour| colour.to_pipeline(ColourPipeline::Linear))
}
