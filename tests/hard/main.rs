//! Numerically hard rays, geometry, cameras, lights and scenes, in every tier of numerics.

#[path = "../common/mod.rs"]
mod common;

mod hard_boxes;
mod hard_builds;
mod hard_cameras;
mod hard_data;
mod hard_determinism;
mod hard_lights;
mod hard_lit;
mod hard_meshes;
mod hard_paths;
mod hard_rays;
mod hard_scale;
mod hard_scenes;
mod hard_secondary;
mod hard_spheres;
mod hard_transforms;
mod hard_triangles;
