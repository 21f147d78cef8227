//! The textures of materials: what each is for, how its texels are stored, and where files have it.

use std::ops::{Index, IndexMut};

use glam::DVec3;

use crate::scene::{Material, TexelEncoding, Texture, Transport};

/// The properties of a texture slot.
#[derive(Debug)]
pub struct SlotEntry {
    /// The slot.
    pub slot: TextureSlot,
    /// The name, for people.
    pub name: &'static str,
    /// How texels are decoded.
    pub encoding: TexelEncoding,
    /// The value without texture.
    pub default: DVec3,
    /// The transports that look it up with the textures of materials. None for normal maps and opacities, which have
    /// stages of their own.
    pub transports: &'static [Transport],
    /// The JSON pointer from a material of glTF.
    pub gltf: &'static str,
    /// Whether glTF stores it in the alpha channel, which becomes a grey image.
    pub is_gltf_alpha: bool,
}

const BOTH: &[Transport] = &[Transport::Whitted, Transport::Path];

/// Declares the slots: name for people, encoding, transports, pointer in glTF, and properties that are no defaults.
macro_rules! slots {
    ($($(#[$doc:meta])* $slot:ident = $name:literal, $encoding:ident, $transports:expr, $gltf:literal
        $(, $property:ident: $value:expr)*;)*) => {
        /// What a texture of a material is for.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum TextureSlot { $($(#[$doc])* $slot,)* }

        /// All texture slots, in the order of [`TextureSlot`].
        pub const TEXTURE_SLOTS: [SlotEntry; [$($name),*].len()] = [$(SlotEntry {
            $($property: $value,)*
            ..SlotEntry {
                slot: TextureSlot::$slot,
                name: $name,
                encoding: TexelEncoding::$encoding,
                default: DVec3::ONE,
                transports: $transports,
                gltf: $gltf,
                is_gltf_alpha: false,
            }
        }),*];
    };
}

slots! {
    /// Factor of the base colour, Phong's colour.
    BaseColour = "base colour", Colour, BOTH, "/pbrMetallicRoughness/baseColorTexture";
    /// Factors of the roughness (green) and of metallic (blue).
    MetallicRoughness = "metallic-roughness", Data, BOTH, "/pbrMetallicRoughness/metallicRoughnessTexture";
    /// Tangent-space normal map: red, green and blue encode x (along u), y (against v) and z (along the normal), each
    /// from -1 at 0 to 1 at the largest value (glTF 2.0, section 3.9.3).
    Normal = "normal", Normal, &[], "/normalTexture", default: DVec3::new(0.5, 0.5, 1.0);
    /// Factor of the emission.
    Emission = "emission", Colour, BOTH, "/emissiveTexture";
    /// Factor of the opacity: red.
    Opacity = "opacity", Data, &[], "/pbrMetallicRoughness/baseColorTexture", is_gltf_alpha: true;
    /// Factor of the ambient light, weighted by [`Textures::occlusion_strength`]: red. Paths compute what it stands for.
    Occlusion = "occlusion", Data, &[Transport::Whitted], "/occlusionTexture";
    /// Factor of [`crate::scene::Layers::specular`]: red.
    Specular = "specular", Data, BOTH, "/extensions/KHR_materials_specular/specularTexture", is_gltf_alpha: true;
    /// Factor of [`crate::scene::Layers::specular_colour`].
    SpecularColour = "specular colour", Colour, BOTH,
        "/extensions/KHR_materials_specular/specularColorTexture";
    /// Factor of [`crate::scene::Layers::transmission`]: red.
    Transmission = "transmission", Data, &[Transport::Path],
        "/extensions/KHR_materials_transmission/transmissionTexture";
    /// Factor of [`crate::scene::Layers::clearcoat`]: red.
    Clearcoat = "clear coat", Data, &[Transport::Path], "/extensions/KHR_materials_clearcoat/clearcoatTexture";
    /// Factor of [`crate::scene::Layers::clearcoat_roughness`]: green.
    ClearcoatRoughness = "clear coat roughness", Data, &[Transport::Path],
        "/extensions/KHR_materials_clearcoat/clearcoatRoughnessTexture";
    /// Factor of [`crate::scene::Layers::sheen_colour`].
    SheenColour = "sheen colour", Colour, &[Transport::Path],
        "/extensions/KHR_materials_sheen/sheenColorTexture";
    /// Factor of [`crate::scene::Layers::sheen_roughness`]: red.
    SheenRoughness = "sheen roughness", Data, &[Transport::Path],
        "/extensions/KHR_materials_sheen/sheenRoughnessTexture", is_gltf_alpha: true;
    /// The rougher direction (red and green: x and y in tangent space, from -1 at 0 to 1 at the largest value) and factor
    /// of [`crate::scene::Layers::anisotropy`] (blue).
    Anisotropy = "anisotropy", Data, BOTH,
        "/extensions/KHR_materials_anisotropy/anisotropyTexture", default: DVec3::new(1.0, 0.5, 1.0);
}

impl TextureSlot {
    /// Its properties.
    #[inline(always)]
    pub const fn entry(self) -> &'static SlotEntry {
        &TEXTURE_SLOTS[self as usize]
    }
}

impl<C> Material<C> {
    /// The texture coordinates that the tangents of its meshes follow; `None` where it needs no tangents.
    pub fn tangent_coordinates(&self) -> Option<u8> {
        let is_anisotropic =
            matches!(self, Material::MetallicRoughness(m) if m.layers.anisotropy > 0.0 && !m.unlit);
        let [normal, direction] =
            [TextureSlot::Normal, TextureSlot::Anisotropy].map(|slot| self.textures()[slot]);
        let coordinates = normal.or(direction).map(|texture| texture.coordinates);
        coordinates.or(is_anisotropic.then_some(0))
    }
}

/// The textures of a material, at most one for each slot, and the weights that some have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Textures {
    slots: [Option<Texture>; TEXTURE_SLOTS.len()],
    /// Factor of x and y of the normal map.
    pub normal_scale: f64,
    /// Weight of the occlusion, 0 to 1: the ambient light is multiplied by `1 + occlusion_strength * (texel - 1)`.
    pub occlusion_strength: f64,
}

impl Default for Textures {
    /// None, and weights of 1.
    fn default() -> Self {
        Textures { slots: [None; TEXTURE_SLOTS.len()], normal_scale: 1.0, occlusion_strength: 1.0 }
    }
}

impl Textures {
    /// The textures in the order of their slots.
    pub fn iter(&self) -> impl Iterator<Item = (TextureSlot, Texture)> + use<> {
        TEXTURE_SLOTS.iter().zip(self.slots).filter_map(|(entry, texture)| Some((entry.slot, texture?)))
    }

    /// The textures, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Texture> {
        self.slots.iter_mut().flatten()
    }
}

impl Index<TextureSlot> for Textures {
    type Output = Option<Texture>;

    #[inline(always)]
    fn index(&self, slot: TextureSlot) -> &Option<Texture> {
        &self.slots[slot as usize]
    }
}

impl IndexMut<TextureSlot> for Textures {
    fn index_mut(&mut self, slot: TextureSlot) -> &mut Option<Texture> {
        &mut self.slots[slot as usize]
    }
}

impl<const N: usize> From<[(TextureSlot, Option<Texture>); N]> for Textures {
    fn from(all: [(TextureSlot, Option<Texture>); N]) -> Self {
        let mut textures = Textures::default();
        all.into_iter().for_each(|(slot, texture)| textures[slot] = texture);
        textures
    }
}
