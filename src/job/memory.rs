//! Memory checks of a scene before it is prepared for rendering.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use crate::effects::{Choices, id};
use crate::error::{Error, Result};
use crate::geometry::Precision;
use crate::limits;
use crate::scene::{DecodedImage, Numerics, Object, Scene, Shape, TextureFilter};

/// Checks the memory limit for the acceleration structure and the mip maps of a scene.
///
/// # Errors
/// [`Error::Input`] for the largest texture, [`Error::Memory`] for the acceleration structure.
pub fn check_memory(scene: &Scene, choices: &Choices, numerics: Numerics) -> Result<()> {
    check_mip_maps(scene, choices)?;
    // Peak address space per primitive in bytes in addition to the scene, measured on grids and on random triangles
    // with every preset.
    let each = if numerics.precision() == Precision::Single { 320 } else { 416 };
    let mut shared = HashSet::new();
    let of_object = |object: &Object| match &object.shape {
        Shape::Analytic(_) => 1,
        Shape::Mesh(mesh) => mesh.triangles.len(),
        Shape::Placed(placed) if shared.insert(Arc::as_ptr(&placed.mesh)) => 1 + placed.mesh.triangles.len(),
        Shape::Placed(_) => 1,
    };
    let count = scene.objects.iter().map(of_object).sum::<usize>() as u64;
    limits::check(limits::product(&[count, each])).map_err(|excess| Error::Memory {
        what: format!("the acceleration structure over {count} primitives {excess}"),
        hint: format!("give fewer of them, or {}", excess.remedy()),
    })
}

/// Checks the memory limit for mip maps, which all filters but `nearest` and `bilinear` use.
///
/// # Errors
/// [`Error::Input`] for the largest texture.
fn check_mip_maps(scene: &Scene, choices: &Choices) -> Result<()> {
    let without = [TextureFilter::Nearest, TextureFilter::Bilinear].map(TextureFilter::name);
    let without = without.map(|filter| id::TEXTURES.with_value(filter));
    if choices.with.iter().any(|typed| without.contains(typed)) {
        return Ok(());
    }
    let area = |image: &DecodedImage| limits::product(&[image.width.into(), image.height.into()]);
    let Some(largest) = scene.images.iter().max_by_key(|image| area(image)) else { return Ok(()) };
    // Mip levels are a third of the texels, of 6 bytes; building the largest needs levels of a quarter and a sixteenth,
    // of 12 bytes.
    let kept = scene.images.iter().map(|image| limits::product(&[area(image), 2]));
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
