//! The shadow catcher: the ground before a backdrop covers it by its shadows alone.
//!
//! Where a camera ray hits the ground, its colour is black and its coverage 1 - L / L0, where L is the luminance of the
//! ground and L0 that without any object above it. Light that objects throw onto the ground reduces the coverage; the
//! mean of a pixel's samples is limited to 0 to 1.

use glam::{DVec3, Vec3};

use super::tile::Tile;
use crate::film::colour::luminance;
use crate::scene::Material;
use crate::shading::LightSample;
use crate::world::World;

/// Gives the camera rays that hit the catcher, whose colours are in [`Tile::pixels`], their colour and coverage.
/// `is_path`: whether paths are traced, of which the environment is light, and ambient light is not.
pub(crate) fn catch_shadows(tile: &mut Tile, world: &World, is_path: bool) {
    let Tile { caught, coverage: Some(coverage), pixels, .. } = tile else { return };
    for (ray, position) in caught.drain(..) {
        let (pixel, whole) = (&mut pixels[ray as usize], unshadowed(world, position, is_path));
        let seen = luminance(Vec3::from(*pixel).as_dvec3());
        coverage[ray as usize] = if whole > 0.0 { (1.0 - seen / whole) as f32 } else { 0.0 };
        *pixel = [0.0; 3];
    }
}

/// The luminance of a point of the ground without objects above it, and without area lights and emissive surfaces.
fn unshadowed(world: &World, position: DVec3, is_path: bool) -> f64 {
    let material = world
        .shadow_catcher()
        .map(|ground| &world.materials[world.objects[ground as usize].material as usize]);
    let Some(Material::Phong(material)) = material else { return 0.0 };
    let mut light = match &world.environment {
        Some(environment) if is_path => environment.diffuse_from_above(),
        _ if is_path => DVec3::ZERO,
        _ => DVec3::splat(material.ambient * world.ambient_at(DVec3::Y)),
    };
    for sample in world.lights.iter().filter_map(|light| LightSample::towards(light, position)) {
        light += sample.radiance * (material.diffuse * sample.direction.y.max(0.0));
    }
    luminance(world.pipeline.mix_light(material.colour, light))
}
