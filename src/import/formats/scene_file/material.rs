//! Conversion of the materials of scene files and of `--material`.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::film::{Colour, ColourPipeline};
use crate::import::formats::scene_file::fault::{Fault, not_negative, parse_inline, unit};
use crate::import::formats::scene_file::metallic_roughness::metallic_roughness;
use crate::import::formats::scene_file::sections::{GlazeSection, MaterialSection};
use crate::scene::{Glaze, INLINE_NAME, Material, MaterialChange, Opacity, Phong};

/// Maximum number of glaze bounces. Each bounce that a path reaches needs buffers of about a tenth of a megabyte per
/// thread; with a weight below 0.991 paths end earlier (`effects::whitted::glaze`).
const MAX_BOUNCES: u32 = 4096;

/// Parses a material with the keys of `[material]`, `{ colour = "#c33", metallic = 1 }`, and whether it has a colour; without,
/// it is white.
///
/// # Errors
/// [`Error::Usage`] if it is invalid.
pub(crate) fn inline_material(text: &str) -> Result<(Material, bool)> {
    let has_colour =
        parse_inline::<toml::Table>(text).map_or(true, |keys| keys.is_empty() || keys.contains_key("colour"));
    let whole = if has_colour { text.to_owned() } else { text.replacen('{', "{ colour = '#ffffff', ", 1) };
    parse_inline(&whole)
        .and_then(|section| Ok((material(INLINE_NAME, &section)?, has_colour)))
        .map_err(|fault| Error::usage(format!("--material {{...}} is not valid: {}", fault.what), fault.hint))
}

/// Parses values of a material that take the place of its own: `{ metallic = 1, roughness = 0.2 }`.
///
/// # Errors
/// [`Error::Usage`] if they are invalid.
pub(crate) fn inline_change(text: &str) -> Result<MaterialChange> {
    let parsed = parse_inline(text).and_then(|change: MaterialChange| {
        change.metallic.map(|value| unit("metallic", value)).transpose()?;
        change.roughness.map(|value| unit("roughness", value)).transpose()?;
        Ok(change)
    });
    parsed.map_err(|fault| {
        Error::usage(format!("--material NAME+={{...}} is not valid: {}", fault.what), fault.hint)
    })
}

/// Converts a material section.
pub(super) fn material(name: &str, s: &MaterialSection) -> std::result::Result<Material, Fault> {
    if s.metallic.is_some() || s.roughness.is_some() || s.layers.is_some() {
        return metallic_roughness(name, s).map(Material::MetallicRoughness);
    }
    let number = |key, value: Option<f64>, default| not_negative(key, value.unwrap_or(default));
    Ok(Material::Phong(Phong {
        name: name.to_owned(),
        colour: Colour::from_u8(s.colour.0),
        ambient: number("ambient", s.ambient, 1.0)?,
        diffuse: number("diffuse", s.diffuse, 1.0)?,
        specular: number("specular", s.specular, 0.0)?,
        shininess: number("shininess", s.shininess, 16.0)?,
        emission: emission(s)?,
        glaze: s.glaze.as_ref().map(|section| glaze(name, section)).transpose()?,
        refraction: None,
        opacity: opacity(s)?,
        double_sided: s.double_sided.unwrap_or(true),
        ..Phong::default()
    }))
}

fn glaze(name: &str, s: &GlazeSection) -> std::result::Result<Glaze, Fault> {
    let default = Glaze::default();
    let weight = not_negative("glaze.weight", s.weight.unwrap_or(default.weight))?;
    if s.own_weight.is_none() {
        unit("glaze.weight", weight)?;
    }
    let own_weight = not_negative("glaze.own_weight", s.own_weight.unwrap_or(1.0 - weight))?;
    if weight + own_weight > 1.0 {
        let what = format!("the glaze of `{name}` adds light: its weights sum to {}", weight + own_weight);
        return Err(Fault::new(what, "let `weight` and `own_weight` sum to at most 1"));
    }
    let bounces = s.bounces.unwrap_or(default.bounces);
    if bounces > MAX_BOUNCES {
        let what = format!("the glaze of `{name}` asks for {bounces} bounces");
        return Err(Fault::new(what, "give at most 4096; what is mirrored so often is not seen"));
    }
    Ok(Glaze { weight, own_weight, bounces })
}

/// The opacity of a material; `None` for an opaque one.
pub(super) fn opacity(s: &MaterialSection) -> std::result::Result<Option<Opacity>, Fault> {
    let factor = unit("opacity", s.opacity.unwrap_or(1.0))?;
    Ok((factor < 1.0).then_some(Opacity { factor, cutoff: None }))
}

/// The emitted radiance of a material.
pub(super) fn emission(s: &MaterialSection) -> std::result::Result<Colour, Fault> {
    let intensity = not_negative("emission_intensity", s.emission_intensity.unwrap_or(1.0))?;
    let colour = s.emission.map_or(Colour::Linear(DVec3::ZERO), |colour| Colour::from_u8(colour.0));
    Ok(Colour::Linear(colour.to_pipeline(ColourPipeline::Linear) * intensity))
}
