//! Materials of MTL files. They become Phong: colour `Kd`, k_d = 1, k_s = maximum of `Ks`, n = `Ns`, k_a = 1. Colours
//! are display values. `illum 0` becomes an unlit material, `illum 1` has no highlight. Materials with `Pr`, `Pm`, `Ps`
//! or `Pc` become metallic-roughness ([`pbr`]). `norm` and `bump` become normal maps.

use crate::error::{Result, Warnings};
use crate::film::Colour;
use crate::import::Source;
use crate::import::formats::obj::mtl::Definition;
use crate::import::formats::obj::pbr;
use crate::import::images::{Channels, ImageLoader};
use crate::scene::{
    ImageId, Material, MetallicRoughness, Opacity, Phong, Scene, Texture, TextureSlot, Textures,
};

/// Converts materials, and adds their images to the scene. An image that exceeds the memory limit is an error.
pub(super) struct Converter<'a> {
    pub source: &'a Source,
    pub scene: &'a mut Scene,
    pub images: ImageLoader<'a>,
    pub warnings: &'a mut Warnings,
}

impl Converter<'_> {
    /// The image of a name in an MTL file; `None` without a name, or with a warning if it cannot be read.
    pub(super) fn image(&mut self, name: Option<&String>, channels: Channels) -> Result<Option<ImageId>> {
        let file = name.and_then(|name| self.source.resolve_image(name, self.warnings));
        file.map_or(Ok(None), |file| self.images.of_file(self.scene, &file, channels, self.warnings))
    }

    /// The texture of the map `key`, whose image has this name.
    fn texture(
        &mut self,
        definition: &Definition,
        key: &str,
        name: Option<&String>,
        channels: Channels,
    ) -> Result<Option<Texture>> {
        Ok(self.image(name, channels)?.map(|image| definition.texture(image, key)))
    }

    /// The start of a message about a material.
    fn about(&self, m: &tobj::Material) -> String {
        format!("{}: material `{}` has", self.source.file.display(), m.name)
    }

    /// Converts a material.
    pub(super) fn convert(&mut self, definition: &Definition) -> Result<Material> {
        let m = &definition.material;
        let texture = self.texture(definition, "map_Kd", m.diffuse_texture.as_ref(), Channels::Colour)?;
        // MTL does not define a default of Kd; with a texture, white leaves it unchanged.
        let default = if texture.is_some() { [1.0; 3] } else { [0.8; 3] };
        let colour = Colour::Display(m.diffuse.unwrap_or(default).into());
        let mut textures: Textures = [(TextureSlot::BaseColour, texture)].into();
        let opacity = self.opacity(definition, &mut textures)?;
        let has_opacities = textures[TextureSlot::Opacity].is_some();
        let unmapped = textures;
        self.normal_map(definition, &mut textures)?;
        if pbr::is_physically_based(m) {
            let material = self.physically_based(definition, textures)?;
            // What lets light through by `Tf` has no opacity by `d`, too.
            let opacity = opacity.filter(|_| material.layers.transmission == 0.0 || has_opacities);
            let unlit = is_unlit(m);
            return Ok(Material::MetallicRoughness(MetallicRoughness { opacity, unlit, ..material }));
        }
        if m.unknown_param.contains_key("map_Ke") {
            let about = self.about(m);
            self.warnings.left_out(format!("{about} a map_Ke without Pr or Pm; drawn without it"));
        }
        if is_unlit(m) {
            return Ok(Material::MetallicRoughness(MetallicRoughness {
                name: m.name.clone(),
                base_colour: colour,
                unlit: true,
                opacity,
                textures: unmapped,
                ..MetallicRoughness::default()
            }));
        }
        let emission = m.emissive.filter(is_above_0);
        let refraction = pbr::refraction(m);
        let shininess = m.shininess.unwrap_or(1.0).max(0.0);
        // An exponent of 0 would spread the highlight over the lit side; exporters write it for no highlight.
        let strength = if has_highlight(m) { shininess.min(1.0) } else { 0.0 };
        let specular = strength * m.specular.map_or(0.0, |ks| ks.into_iter().fold(0.0, f64::max));
        Ok(Material::Phong(Phong {
            name: m.name.clone(),
            colour,
            specular,
            shininess,
            emission: Colour::Display(emission.unwrap_or([0.0; 3]).into()),
            opacity: opacity.filter(|_| refraction.is_none() || has_opacities),
            refraction,
            textures,
            ..Phong::default()
        }))
    }

    /// Opacity from `d` (or `Tr`, which is 1 - `d`) and `map_d`.
    fn opacity(&mut self, definition: &Definition, textures: &mut Textures) -> Result<Option<Opacity>> {
        let m = &definition.material;
        let factor = m.dissolve.or_else(|| Some(1.0 - pbr::number(m, "Tr")?)).unwrap_or(1.0).clamp(0.0, 1.0);
        if factor == 0.0 {
            let about = self.about(m);
            self.warnings.push(format!("{about} the opacity 0 (`d`) and cannot be seen"));
        }
        let name = m.dissolve_texture.as_ref();
        let texture = self.texture(definition, "map_d", name, Channels::AlphaOrGrey)?;
        textures[TextureSlot::Opacity] = texture;
        Ok((factor < 1.0 || texture.is_some()).then_some(Opacity { factor, cutoff: None }))
    }

    /// Normal map from `norm`, or from the heights of `map_Bump` or `bump`, scaled by `-bm`.
    fn normal_map(&mut self, definition: &Definition, textures: &mut Textures) -> Result<()> {
        let m = &definition.material;
        if let Some(name) = m.unknown_param.get("norm") {
            if m.normal_texture.is_some() {
                let about = self.about(m);
                self.warnings.left_out(format!("{about} a normal map; drawn without its bump map"));
            }
            textures[TextureSlot::Normal] = self.texture(definition, "norm", Some(name), Channels::Colour)?;
            return Ok(());
        }
        let name = m.normal_texture.as_ref();
        let Some(file) = name.and_then(|name| self.source.resolve_image(name, self.warnings)) else {
            return Ok(());
        };
        if let Some((image, steepest)) = self.images.bump_of_file(self.scene, &file, self.warnings)? {
            textures[TextureSlot::Normal] = Some(definition.texture(image, "bump"));
            textures.normal_scale = steepest * definition.options("bump").multiplier;
        }
        Ok(())
    }
}

fn is_above_0(colour: &[f64; 3]) -> bool {
    colour.iter().any(|&c| c > 0.0)
}

/// Whether the illumination model has a highlight: all but 0 and 1.
pub(super) fn has_highlight(m: &tobj::Material) -> bool {
    !matches!(m.illumination_model, Some(0 | 1))
}

/// Whether a material is unlit: `illum 0` without emission. Some programs write `illum 0` for lamps.
fn is_unlit(m: &tobj::Material) -> bool {
    let emits = m.emissive.as_ref().is_some_and(is_above_0) || m.unknown_param.contains_key("map_Ke");
    m.illumination_model == Some(0) && !emits
}
