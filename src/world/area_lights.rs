//! Lights with an area as surfaces of the world: emissive objects behind those of the scene.

use glam::DVec3;

use super::PreparedMaterial;
use super::rectangle::Rectangle;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{Light, LightKind, Material, MaterialId, Mesh, Object, Phong, Scene, Shape, Sphere};

/// The lights with an area that a scene has.
#[derive(Debug, Clone, Default)]
pub(crate) struct AreaLights {
    /// Their names.
    pub(crate) names: Vec<String>,
    /// The rectangles among them: the last objects of the scene, in this order, two triangles each.
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
        for light in scene.lights.iter().filter(|light| light.kind.is_area()) {
            let Some((shape, rectangle, factor)) = surface(&light.kind) else { continue };
            let radiance = light.colour.to_pipeline(pipeline) * light.intensity * factor;
            if radiance == DVec3::ZERO || !radiance.is_finite() {
                continue;
            }
            materials.push(material(light, radiance));
            let material = MaterialId((materials.len() - 1) as u32);
            surfaces.push((rectangle, Object { name: light.name.clone(), input: 0, material, shape }));
        }
        surfaces.sort_by_key(|(rectangle, _)| rectangle.is_some());
        for (rectangle, object) in surfaces {
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
    let factor = surface(&light.kind).map_or(0.0, |(.., factor)| factor);
    let radiance = light.intensity * factor;
    !light.kind.is_area() || is_off || radiance.is_finite() && radiance != 0.0
}

/// The surface of a light, and its radiance for an intensity of 1. A point light of intensity I with inverse-square
/// falloff gives a facing surface at a distance d the irradiance pi I / d^2; far away, a sphere of radiance L gives pi
/// L radius^2 / d^2 and a rectangle L area / d^2.
fn surface(kind: &LightKind) -> Option<(Shape, Option<Rectangle>, f64)> {
    match *kind {
        LightKind::Sphere { position, radius } => {
            let sphere = Sphere { centre: position, radius };
            Some((Shape::Analytic(sphere.into()), None, 1.0 / (radius * radius)))
        }
        LightKind::Rectangle { position, direction, up, size } => {
            let rectangle = Rectangle::new(position, direction, up, size)?;
            let mesh = Mesh {
                positions: rectangle.corners().to_vec(),
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            };
            Some((Shape::Mesh(mesh), Some(rectangle), std::f64::consts::PI / rectangle.area()))
        }
        LightKind::Point { .. } | LightKind::Directional { .. } | LightKind::Spot { .. } => None,
    }
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
