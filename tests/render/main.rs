//! Pictures and AOVs: values derived by hand, golden images, textures, sampling and effects.

#[path = "../common/mod.rs"]
mod common;

mod adaptive;
mod alpha;
mod ambient_occlusion;
mod aov;
mod closed_form;
mod course;
mod depth_of_field;
mod effects;
mod exr_files;
mod golden;
mod ground;
mod layers;
mod left_out;
mod lights;
mod look;
mod many_lights;
mod noise;
mod normal_maps;
mod panorama;
mod path;
mod sampling;
mod soa;
mod t_test;
mod textures;
mod unbiased;
mod unlit;
mod volumes;
