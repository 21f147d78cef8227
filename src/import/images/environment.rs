//! Reading of environments: `.hdr` and `.exr` images, `sky`, or a colour.

use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, Result, Warnings};
use crate::files::unreadable;
use crate::film::{Colour, ColourPipeline, read};
use crate::import::files::dependencies::Files;
use crate::scene::ColourValue;
use crate::scene::{EnvironmentImage, EnvironmentSource};

/// The source of an environment as typed: `sky`, a colour ([`ColourValue::of_argument`]), or a file.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be used, [`Error::Usage`] for a colour that is none.
pub fn environment(typed: &str, warnings: &mut Warnings) -> Result<EnvironmentSource> {
    if typed.eq_ignore_ascii_case("sky") {
        return Ok(EnvironmentSource::Sky);
    }
    if let Some(colour) = ColourValue::of_argument(typed) {
        return Ok(EnvironmentSource::Colour(Colour::from_u8(colour.0)));
    }
    let file = Path::new(typed);
    if typed.starts_with('#') && !file.exists() {
        let what = format!("`{typed}` is neither a colour nor a file");
        return Err(Error::usage(
            what,
            "give a .hdr or .exr file, `sky`, or a colour as #rrggbb or by a CSS name, such as grey",
        ));
    }
    image(&Files::default(), file, warnings)
}

/// An equirectangular image. Values of 8 and 16 bits are decoded from sRGB, with a note, because they end at white.
///
/// # Errors
/// [`Error::Input`] if it is missing, damaged, too large, or of another format.
pub(crate) fn image(files: &Files, file: &Path, warnings: &mut Warnings) -> Result<EnvironmentSource> {
    let bytes = files.read(file).map_err(|e| unreadable(file, &e))?;
    let read::Pixels { width, height, mut values, pipeline, .. } =
        read::decode_pixels(bytes).map_err(|e| match e.into_error(file) {
            Error::Input { place, what, .. } => Error::input(place, what, "give an image in .hdr or .exr"),
            other => other,
        })?;
    if pipeline != ColourPipeline::Linear {
        let what = "an 8-bit environment has no light brighter than white; .hdr and .exr have";
        warnings.note(format!("{}: {what}", file.display()));
    }
    let mut unusable = 0;
    for value in values.as_flattened_mut() {
        if pipeline != ColourPipeline::Linear {
            *value = crate::film::colour::srgb_decode((*value).into()) as f32;
        }
        if !(value.is_finite() && *value >= 0.0) {
            *value = 0.0;
            unusable += 1;
        }
    }
    if unusable > 0 {
        let what = "values of the environment are negative or not finite numbers; taken as 0";
        warnings.push(format!("{}: {unusable} {what}", file.display()));
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(EnvironmentSource::Image(Arc::new(EnvironmentImage { name, width, height, pixels: values })))
}
