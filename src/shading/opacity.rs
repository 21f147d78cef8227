//! Opacity of surfaces. It depends on the point alone: textures are looked up at full size.

use glam::DVec2;

use super::texture::look_at;
use crate::film::ColourPipeline;
use crate::scene::{Material, Scene, TexelEncoding, TextureFilter, TextureSlot};
use crate::world::Image;

/// The opacity from which a surface is visible where a ray has one surface: in AOVs and queries.
pub(crate) const VISIBLE_FROM: f64 = 0.5;

/// The opacity of a material at a point, 0 to 1. `filter` takes the place of that of the texture's sampler; `uv` are
/// texture coordinates of a set.
#[inline]
pub(crate) fn opacity<C>(
    material: &Material<C>,
    images: &[Image],
    filter: Option<TextureFilter>,
    uv: impl FnOnce(u8) -> Option<DVec2>,
    vertex_alpha: impl FnOnce() -> f64,
) -> f64 {
    let Some(opacity) = material.opacity() else { return 1.0 };
    let mut alpha = opacity.factor;
    if let Some(texture) = material.textures()[TextureSlot::Opacity]
        && let Some(uv) = uv(texture.coordinates)
    {
        let image = &images[texture.image.0 as usize];
        let magnify = texture.sampler.filter(filter).magnify;
        alpha *= look_at(image, TexelEncoding::Data, &texture.sampler, 0, magnify, uv).x;
    }
    alpha *= vertex_alpha();
    match opacity.cutoff {
        Some(cutoff) => f64::from(u8::from(alpha >= cutoff)),
        None => alpha.clamp(0.0, 1.0),
    }
}

/// Opacities of the surfaces of a scene, for queries of [`Scene::bvh`].
pub struct SceneOpacity {
    images: Vec<Image>,
}

impl SceneOpacity {
    /// The opacities of a scene. Texels are not copied.
    pub fn new(scene: &Scene) -> Self {
        let prepared = |image: &crate::scene::DecodedImage| Image::new(image.clone(), ColourPipeline::Linear);
        SceneOpacity { images: scene.images.iter().map(prepared).collect() }
    }

    /// Whether the surface at a point of an object of the scene is visible in AOVs: its opacity is at least 1/2, or the
    /// cutoff of its material. Rays of pictures pass others.
    pub fn is_visible(&self, scene: &Scene, object: usize, primitive: u32, barycentrics: [f64; 3]) -> bool {
        let object = &scene.objects[object];
        let opacity = opacity(
            &scene.materials[object.material.0 as usize],
            &self.images,
            None,
            |set| object.shape.uv(primitive, barycentrics, set),
            || object.shape.alpha(primitive, barycentrics),
        );
        opacity >= VISIBLE_FROM
    }
}
