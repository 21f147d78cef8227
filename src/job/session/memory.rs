//! Memory checks of a scene before it is prepared for rendering.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use crate::bvh::detail::Precision;
use crate::effects::{Plan, PlanSettings, TextureUse, id};
use crate::error::{Error, Result};
use crate::limits;
use crate::scene::{DecodedImage, Numerics, Object, Scene, Shape, TextureFilter};
use crate::shading::LightSoa;
use crate::world::World;

/// Checks the memory limit for the acceleration structure and the mip maps of a scene.
///
/// # Errors
/// [`Error::Input`] for the largest texture, [`Error::Memory`] for the acceleration structure.
pub fn check_memory(scene: &Scene, plan_settings: &PlanSettings, numerics: Numerics) -> Result<()> {
    check_mip_maps(scene, plan_settings)?;
    // Peak address space per primitive in bytes in addition to the scene, measured on grids and on random triangles
    // with every preset.
    let each = if numerics.precision() == Precision::Single { 344 } else { 416 };
    let mut shared = HashSet::new();
    let of_object = |object: &Object| match &object.shape {
        Shape::Analytic(_) => 1,
        Shape::Mesh(mesh) => mesh.triangles.len(),
        Shape::Placed(placed) if shared.insert(Arc::as_ptr(&placed.mesh)) => 1 + placed.mesh.triangles.len(),
        Shape::Placed(_) => 1,
    };
    // Of an object, measured as the peak of pictures of 20,000 and 40,000 meshes and placements of a triangle.
    const OBJECT: u64 = 1600;
    let count = scene.objects.iter().map(of_object).sum::<usize>() as u64;
    let objects = limits::product(&[scene.objects.len() as u64, OBJECT]);
    limits::check(limits::product(&[count, each]).saturating_add(objects)).map_err(|excess| Error::Memory {
        what: format!("the acceleration structure over {count} primitives {excess}"),
        hint: format!("give fewer of them, or {}", excess.remedy()),
    })
}

/// Checks the memory limit for the per-thread light buffers of local shading.
///
/// # Errors
/// [`Error::Memory`].
pub(crate) fn check_lights(world: &World, plan: &Plan) -> Result<()> {
    if plan.transport.traces_paths() || !plan.shading.uses_lights() {
        return Ok(());
    }
    let (lights, threads) = (world.lights.len() as u64, rayon::current_num_threads() as u64);
    let fewer = if threads > 1 { "--threads 1, " } else { "" };
    limits::check(limits::product(&[lights, threads, size_of::<LightSoa>() as u64])).map_err(|excess| {
        Error::Memory {
            what: format!("local shading by {lights} lights on {threads} thread(s) {excess}"),
            hint: format!("give fewer lights, {fewer}--transport path, or {}", excess.remedy()),
        }
    })
}

/// Checks the memory limit for the mip maps that the picture may need.
///
/// # Errors
/// [`Error::Input`] for the largest texture.
fn check_mip_maps(scene: &Scene, plan_settings: &PlanSettings) -> Result<()> {
    let texture_use = TextureUse::left_on(plan_settings);
    let (mut used, mut made) = (HashSet::new(), HashSet::new());
    let materials = scene.objects.iter().filter(|object| used.insert(object.material));
    let materials = materials.filter_map(|object| scene.materials.get(object.material.0 as usize));
    let mip_maps =
        materials.flat_map(|material| texture_use.mip_maps(material)).filter(|key| made.insert(*key));
    let images: Vec<&DecodedImage> = mip_maps.filter_map(|(id, _)| scene.images.get(id.0 as usize)).collect();
    let area = |image: &DecodedImage| limits::product(&[image.width.into(), image.height.into()]);
    let Some(largest) = images.iter().max_by_key(|image| area(image)) else { return Ok(()) };
    // Mip levels are a third of the texels, of 6 bytes; building the largest needs levels of a quarter and a sixteenth,
    // of 12 bytes.
    let kept = images.iter().map(|image| limits::product(&[area(image), 2]));
    let needed = kept.fold(limits::product(&[area(largest), 4]), u64::saturating_add);
    limits::check(needed).map_err(|excess| {
        let DecodedImage { name, width, height, .. } = largest;
        let what =
            format!("making mip maps of this texture of {width} x {height} pixels and all others {excess}");
        let hint = format!(
            "make it smaller, render --with {}, which uses none, or {}",
            id::TEXTURES.with_value(TextureFilter::Bilinear.name()),
            excess.remedy()
        );
        Error::input(Path::new(name), what, hint)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Sphere;
    use crate::scene::{
        EffectValue, Interpolation, Material, Minify, Phong, ResolvedTextureFilter, Texture, TextureSampler,
        TextureSlot,
    };

    /// A sphere with a texture of 2^40 texels, whose mip maps would need 6 TiB, and a normal map of the same.
    fn scene(sampler: TextureSampler) -> Scene {
        let mut scene = Scene::default();
        let side = 1 << 20;
        let pixels = std::iter::empty::<[u8; 3]>().collect();
        let image = scene.add_image(DecodedImage { name: "a.png".into(), width: side, height: side, pixels });
        let texture = Texture { image, sampler, coordinates: 0 };
        let textures =
            [TextureSlot::BaseColour, TextureSlot::Normal].map(|slot| (slot, Some(texture))).into();
        let material = scene.add_material(Material::Phong(Phong { textures, ..Phong::default() }));
        let shape = Shape::Analytic(Sphere { centre: glam::DVec3::ZERO, radius: 1.0 }.into());
        scene.objects.push(Object { name: "ball".into(), input: 0, material, shape });
        scene
    }

    fn plan_settings(with: &[&str], without: &[&str], scene: &[(&str, EffectValue)]) -> PlanSettings {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let mut plan_settings =
            PlanSettings { with: names(with), without: names(without), ..PlanSettings::default() };
        scene.iter().for_each(|(name, value)| plan_settings.scene.set(name, value.clone(), None));
        plan_settings
    }

    /// Only mip maps that a lookup may need count, whichever setting turns the effects on or off.
    #[test]
    fn memory_of_mip_maps_that_are_not_made_is_not_checked() {
        let text = |name: &str| EffectValue::Text(name.into());
        let off = EffectValue::Switch(false);
        let cases: [(&str, PlanSettings, bool); 11] = [
            ("default", plan_settings(&[], &[], &[]), false),
            ("--with", plan_settings(&["textures=bilinear"], &[], &[]), true),
            ("--with a mip map", plan_settings(&["textures=mipmap"], &[], &[]), false),
            ("the last counts", plan_settings(&["textures=bilinear", "textures=mipmap"], &[], &[]), false),
            ("--without", plan_settings(&[], &["textures", "normal-maps"], &[]), true),
            ("--without textures, not normal maps", plan_settings(&[], &["textures"], &[]), false),
            ("scene file", plan_settings(&[], &[], &[("textures", off.clone()), ("normal-maps", off)]), true),
            ("bilinear", plan_settings(&[], &[], &[("textures", text("bilinear"))]), true),
            ("nearest", plan_settings(&[], &[], &[("textures", text("nearest"))]), true),
            ("anisotropic", plan_settings(&[], &[], &[("textures", text("anisotropic"))]), false),
            (
                "over the file",
                plan_settings(&["textures=mipmap"], &[], &[("textures", text("nearest"))]),
                false,
            ),
        ];
        for (name, plan_settings, is_allowed) in cases {
            assert_eq!(
                check_mip_maps(&scene(TextureSampler::default()), &plan_settings).is_ok(),
                is_allowed,
                "{name}"
            );
        }
        let linear = Minify { within: Interpolation::Linear, between: None };
        let sampler = TextureSampler { minify: Some(linear), ..TextureSampler::default() };
        assert!(!ResolvedTextureFilter::needs_mip_map(&sampler.filter(None)));
        assert!(check_mip_maps(&scene(sampler), &plan_settings(&[], &[], &[])).is_ok());
        let mut unused = scene(TextureSampler::default());
        unused.objects.clear();
        assert!(check_mip_maps(&unused, &plan_settings(&[], &[], &[])).is_ok());
    }
}
