//! What calls for path tracing in the default look: glass, and surfaces that light others.

use std::f64::consts::PI;

use glam::DVec3;

use crate::bvh::Primitive;
use crate::film::ColourPipeline;
use crate::film::colour::{luminance, srgb_decode};
use crate::job::look::default_look::LIGHT_FROM_ABOVE;
use crate::scene::{DecodedImage, Material, Object, Scene, TextureSlot};

/// The least part of the power of the other lights that surfaces must emit to count as lights. A lamp emits a multiple
/// of it, an indicator light a thousandth.
const LEAST_POWER: f64 = 0.05;

/// The names of the materials in use that transmit light along rays that they bend, or into a volume.
pub(crate) fn transmitting(scene: &Scene) -> Vec<&str> {
    let materials = scene.objects.iter().filter_map(|object| scene.materials.get(object.material.0 as usize));
    materials.filter(|material| material.transmits()).map(Material::name).collect()
}

/// The names of the materials in use that emit light, if all of them together emit at least [`LEAST_POWER`] of the power
/// of the lights of the scene, or, where it has none, of the default look.
pub(crate) fn lighting(scene: &Scene) -> Vec<&str> {
    let (mut names, mut power) = (Vec::new(), 0.0);
    let mut radiances = vec![None; scene.materials.len()];
    for object in &scene.objects {
        let index = object.material.0 as usize;
        let Some(material) = scene.materials.get(index) else { continue };
        let radiance = *radiances[index].get_or_insert_with(|| mean_radiance(material, &scene.images));
        if radiance > 0.0 {
            // A diffuse emitter, of one side.
            power += PI * radiance * area(object);
            names.push(material.name());
        }
    }
    let radius = scene.bounds().map_or(0.0, |(min, max)| 0.5 * min.distance(max));
    let others = if scene.lights.is_empty() {
        PI * LIGHT_FROM_ABOVE * PI * radius * radius
    } else {
        scene.lights.iter().map(|light| received(light, radius)).sum()
    };
    if power > LEAST_POWER * others { names } else { Vec::new() }
}

/// The power of a light that can reach a scene of this radius. A light of intensity 1 has the irradiance pi where it
/// does not fall off, or at the distance 1.
fn received(light: &crate::scene::Light, radius: f64) -> f64 {
    let intensity = luminance(light.colour.to_pipeline(ColourPipeline::Linear)) * light.intensity;
    if light.kind.falls_off() { PI * intensity * 4.0 * PI } else { PI * intensity * PI * radius * radius }
}

/// The luminance of the mean radiance of an opaque material: the emission times the mean of its texture.
fn mean_radiance(material: &Material, images: &[DecodedImage]) -> f64 {
    let emission = material.emission().to_pipeline(ColourPipeline::Linear);
    if material.is_unlit() || luminance(emission) <= 0.0 {
        return 0.0;
    }
    let texture = material.textures()[TextureSlot::Emission];
    let mean = texture.map_or(DVec3::ONE, |texture| mean(&images[texture.image.0 as usize]));
    luminance(emission * mean)
}

fn mean(image: &DecodedImage) -> DVec3 {
    let largest = image.pixels.largest();
    let decode = |value: u16| srgb_decode(f64::from(value) / f64::from(largest));
    let decoded: Vec<f64> = (0..=largest).map(decode).collect();
    let sum: DVec3 =
        image.pixels.iter().map(|pixel| DVec3::from(pixel.map(|c| decoded[usize::from(c)]))).sum();
    sum / image.pixels.len().max(1) as f64
}

fn area(object: &Object) -> f64 {
    let of = |primitive| match primitive {
        Primitive::Triangle(triangle) => {
            let [a, b, c] = triangle.0;
            0.5 * (b - a).cross(c - a).length()
        }
        Primitive::Analytic(shape) => shape.area(),
    };
    object.shape.primitives().map(of).filter(|area| area.is_finite()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Sphere;
    use crate::film::Colour;
    use crate::scene::{Layers, Light, LightKind, MaterialId, MetallicRoughness, Phong, Shape};

    /// Balls of these radii and emissions.
    fn balls(balls: &[(f64, f64)]) -> Scene {
        let mut scene = Scene::default();
        for (index, &(radius, emission)) in balls.iter().enumerate() {
            let emission = Colour::Linear(DVec3::splat(emission));
            let name = format!("ball {index}");
            let material = scene.add_material(Material::Phong(Phong {
                name: name.clone(),
                emission,
                ..Phong::default()
            }));
            let shape = Shape::Analytic(Sphere { centre: DVec3::ZERO, radius }.into());
            scene.objects.push(Object { name, input: 0, material, shape });
        }
        scene
    }

    /// A ball of radius 1 is in a box of radius sqrt 3, through whose sphere the light of the look sends
    /// pi LIGHT_FROM_ABOVE pi 3. A lamp of radius r and emission L sends pi L 4 pi r^2: 0.05 of it for
    /// L r^2 = 0.05 * 3 / 4 LIGHT_FROM_ABOVE = 0.0366.
    #[test]
    fn emissive_surfaces_call_for_paths_by_their_power() {
        let least = 0.05 * 0.75 * LIGHT_FROM_ABOVE;
        for (radius, emission, is_light) in
            [(0.1, 101.0 * least, true), (0.1, 99.0 * least, false), (0.01, 1.0, false), (1.0, 1.0, true)]
        {
            let scene = balls(&[(1.0, 0.0), (radius, emission)]);
            assert_eq!(
                lighting(&scene),
                if is_light { vec!["ball 1"] } else { vec![] },
                "{radius} {emission}"
            );
        }
        // Beside a sun of intensity 2174 the largest of these is decoration.
        let mut scene = balls(&[(1.0, 1.0)]);
        let kind = LightKind::Directional { direction: -DVec3::Y, angle: 0.0 };
        scene.lights =
            vec![Light { name: "sun".into(), colour: Colour::Linear(DVec3::ONE), intensity: 2174.0, kind }];
        assert!(lighting(&scene).is_empty());
    }

    #[test]
    fn glass_that_an_object_has_calls_for_paths() {
        let mut scene = balls(&[(1.0, 0.0)]);
        let layers = Layers { transmission: 1.0, ..Layers::default() };
        let glass = MetallicRoughness { name: "glass".into(), layers, ..MetallicRoughness::default() };
        let id = scene.add_material(Material::MetallicRoughness(glass));
        assert!(transmitting(&scene).is_empty());
        scene.objects[0].material = MaterialId(id.0);
        assert_eq!(transmitting(&scene), ["glass"]);
    }
}
