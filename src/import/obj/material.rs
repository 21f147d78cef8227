//! Materials of MTL files. They become Phong: colour `Kd`, k_d = 1, k_s = maximum of `Ks`, n = `Ns`, k_a = 1. Colours
//! are display values. Materials with `Pr`, `Pm`, `Ps` or `Pc` become metallic-roughness ([`pbr`]). `norm` and `bump`
//! become normal maps.

use super::mtl::Definition;
use super::pbr;
use crate::error::{Result, Warnings};
use crate::film::Colour;
use crate::import::Source;
use crate::import::images::{Channels, ImageLoader};
use crate::scene::{Material, MetallicRoughness, NormalMap, Opacity, Phong, Scene};

/// Converts a material.
///
/// # Errors
/// [`Error::Input`](crate::error::Error::Input) if an image exceeds the memory limit.
pub(super) fn convert(
    definition: &Definition,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Material> {
    let m = &definition.material;
    let file = m.diffuse_texture.as_ref().and_then(|name| source.resolve_image(name, warnings));
    let image = match file {
        Some(file) => images.of_file(scene, &file, Channels::Colour, warnings)?,
        None => None,
    };
    let texture = image.map(|image| definition.texture(image, "map_Kd"));
    // MTL does not define a default of Kd; with a texture, white leaves it unchanged.
    let default = if texture.is_some() { [1.0; 3] } else { [0.8; 3] };
    let colour = Colour::Display(m.diffuse.unwrap_or(default).into());
    let opacity = convert_opacity(definition, source, scene, images, warnings)?;
    let normal_map = convert_normal_map(definition, source, scene, images, warnings)?;
    if pbr::is_physically_based(m) {
        let textures = (texture, normal_map);
        let material = pbr::convert(definition, textures, source, scene, images, warnings)?;
        // What lets light through by `Tf` has no opacity by `d`, too.
        let opacity =
            opacity.filter(|opacity| material.layers.transmission == 0.0 || opacity.texture.is_some());
        return Ok(Material::MetallicRoughness(MetallicRoughness { opacity, ..material }));
    }
    if m.unknown_param.contains_key("map_Ke") {
        let (file, name) = (source.file.display(), &m.name);
        warnings
            .left_out(format!("{file}: material `{name}` has a map_Ke without Pr or Pm; drawn without it"));
    }
    let emission = m.emissive.filter(|ke| ke.iter().any(|&c| c > 0.0));
    let refraction = pbr::refraction(m);
    let specular = m.specular.map_or(0.0, |ks| ks.into_iter().fold(0.0, f64::max));
    Ok(Material::Phong(Phong {
        name: m.name.clone(),
        colour,
        texture,
        specular,
        shininess: m.shininess.unwrap_or(1.0).max(0.0),
        emission: Colour::Display(emission.unwrap_or([0.0; 3]).into()),
        normal_map,
        opacity: opacity.filter(|opacity| refraction.is_none() || opacity.texture.is_some()),
        refraction,
        ..Phong::default()
    }))
}

/// A number of a key that `tobj` does not read.
fn parameter(m: &tobj::Material, key: &str) -> Option<f64> {
    m.unknown_param.get(key)?.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// Opacity from `d` (or `Tr`, which is 1 - `d`) and `map_d`.
fn convert_opacity(
    definition: &Definition,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Option<Opacity>> {
    let m = &definition.material;
    let factor = m.dissolve.or_else(|| Some(1.0 - parameter(m, "Tr")?)).unwrap_or(1.0).clamp(0.0, 1.0);
    if factor == 0.0 {
        let (file, name) = (source.file.display(), &m.name);
        warnings
            .push(format!("{file}: material `{name}` has the opacity 0 (`d` or `Tr`) and cannot be seen"));
    }
    let file = m.dissolve_texture.as_ref().and_then(|name| source.resolve_image(name, warnings));
    let image = match file {
        Some(file) => images.of_file(scene, &file, Channels::AlphaOrGrey, warnings)?,
        None => None,
    };
    let texture = image.map(|image| definition.texture(image, "map_d"));
    Ok((factor < 1.0 || texture.is_some()).then_some(Opacity { factor, texture, cutoff: None }))
}

/// Normal map from `norm`, or from the heights of `map_Bump` or `bump`, scaled by `-bm`.
fn convert_normal_map(
    definition: &Definition,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Option<NormalMap>> {
    let m = &definition.material;
    if let Some(name) = m.unknown_param.get("norm") {
        if m.normal_texture.is_some() {
            let (file, name) = (source.file.display(), &m.name);
            warnings
                .left_out(format!("{file}: material `{name}` has a normal map; drawn without its bump map"));
        }
        let Some(file) = source.resolve_image(name, warnings) else { return Ok(None) };
        let image = images.of_file(scene, &file, Channels::Colour, warnings)?;
        return Ok(image.map(|image| NormalMap { texture: definition.texture(image, "norm"), scale: 1.0 }));
    }
    let file = m.normal_texture.as_ref().and_then(|name| source.resolve_image(name, warnings));
    let Some(file) = file else { return Ok(None) };
    let bump = images.bump_of_file(scene, &file, warnings)?;
    Ok(bump.map(|(image, steepest)| NormalMap {
        texture: definition.texture(image, "bump"),
        scale: steepest * definition.options("bump").multiplier,
    }))
}
