//! Pictures and AOVs: values derived by hand, golden images, textures, sampling and effects.

#[path = "../common/mod.rs"]
mod common;

mod aov;
mod closed_form;
mod effects;
mod golden;
mod ground;
mod lights;
mod normal_maps;
mod path;
mod sampling;
mod soa;
mod textures;
