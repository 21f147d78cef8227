//! The TOML form of a scene: what is typed. Turning it into what it means ([`super::Scene`]) is `import`'s work,
//! because a scene file may name meshes.
//!
//! Unknown keys are errors. The types here are also the JSON schema that editors complete from.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use super::animation::file::AnimationSection;
pub use super::colour_value::ColourValue;
pub use super::effects::{EffectValue, EffectsSection};
use super::{Numerics, Projection};
use crate::error::{Error, Place, Result};
use crate::film::{ColourPipeline, FilterShape};

/// A scene file.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// The picture.
    #[schemars(with = "Option<ImageSection>")]
    pub image: Option<Spanned<ImageSection>>,
    /// Cameras; the first is the default.
    #[serde(default)]
    #[schemars(with = "Vec<CameraSection>")]
    pub camera: Vec<Spanned<CameraSection>>,
    /// Ambient light.
    #[schemars(with = "Option<AmbientSection>")]
    pub ambient: Option<Spanned<AmbientSection>>,
    /// Lights.
    #[serde(default)]
    #[schemars(with = "Vec<LightSection>")]
    pub light: Vec<Spanned<LightSection>>,
    /// Materials by name.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, MaterialSection>")]
    pub material: std::collections::BTreeMap<String, Spanned<MaterialSection>>,
    /// Analytic spheres.
    #[serde(default)]
    #[schemars(with = "Vec<SphereSection>")]
    pub sphere: Vec<Spanned<SphereSection>>,
    /// Triangle lists.
    #[serde(default)]
    #[schemars(with = "Vec<TrianglesSection>")]
    pub triangles: Vec<Spanned<TrianglesSection>>,
    /// Meshes from files.
    #[serde(default)]
    #[schemars(with = "Vec<MeshSection>")]
    pub mesh: Vec<Spanned<MeshSection>>,
    /// Effects turned on or off against what the scene's contents imply.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, EffectValue>")]
    pub effects: std::collections::BTreeMap<String, Spanned<EffectValue>>,
    /// What moves.
    #[schemars(with = "Option<AnimationSection>")]
    pub animation: Option<Spanned<AnimationSection>>,
}

/// The picture.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSection {
    /// Width in pixels.
    pub width: Option<u32>,
    /// Height in pixels.
    pub height: Option<u32>,
    /// What a ray that hits nothing sees; black if not given.
    pub background: Option<ColourValue>,
    /// The colour pipeline; `linear` if not given.
    pub colour: Option<ColourPipeline>,
    /// How exactly it is decided what a ray hits; `watertight` if not given.
    pub numerics: Option<Numerics>,
    /// Samples a pixel, 1 to 65536; 1, at the pixel's centre, if not given. With `noise` the most of them.
    #[schemars(with = "Option<u32>")]
    pub samples: Option<Spanned<i64>>,
    /// The filter that pixels are seen through; `gaussian` if not given.
    pub filter: Option<FilterShape>,
    /// How far the filter reaches from the pixel's centre, in pixels; its usual radius if not given.
    #[schemars(with = "Option<f64>")]
    pub filter_radius: Option<Spanned<f64>>,
    /// The standard error of a pixel's displayed value, 1 being white, below which it is sampled no further.
    #[schemars(with = "Option<f64>")]
    pub noise: Option<Spanned<f64>>,
    /// Samples that every pixel takes before its error is looked at; 4 if not given.
    #[schemars(with = "Option<u32>")]
    pub min_samples: Option<Spanned<i64>>,
    /// What the random numbers depend on besides the pixel; 0 if not given.
    pub seed: Option<u32>,
}

/// A camera: either a viewing rectangle, or its height alone, at a distance, or a vertical field of view.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// What `--camera` calls it.
    pub name: Option<String>,
    /// Where it stands.
    pub position: [f64; 3],
    /// A point it looks at.
    pub look_at: [f64; 3],
    /// Roughly where up is; (0, 1, 0) if not given.
    pub up: Option<[f64; 3]>,
    /// Perspective if not given.
    #[serde(default)]
    pub projection: Projection,
    /// Width and height of the viewing rectangle in world units.
    pub viewing_rectangle: Option<[f64; 2]>,
    /// Height of the viewing rectangle in world units, instead of the whole of it: its width follows the picture's shape.
    pub viewing_height: Option<f64>,
    /// Distance from the position to the viewing rectangle.
    pub viewpoint_distance: Option<f64>,
    /// Vertical field of view in degrees, instead of rectangle and distance; 40 if neither is given.
    pub vertical_fov: Option<f64>,
}

/// Ambient light.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AmbientSection {
    /// Its intensity, I_a.
    pub intensity: Option<f64>,
}

/// The kinds of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LightType {
    /// From `position` in all directions.
    Point,
    /// From infinitely far away along `direction`.
    Directional,
    /// From `position` in a cone, along `direction` or towards `look_at`.
    Spot,
}

/// How a light weakens with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FalloffValue {
    /// Not at all.
    #[default]
    None,
    /// With the square of the distance.
    InverseSquare,
}

/// A light.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightSection {
    /// What messages call it.
    pub name: Option<String>,
    /// The kind of light.
    #[serde(rename = "type")]
    pub kind: LightType,
    /// Where a point light or a spot is.
    pub position: Option<[f64; 3]>,
    /// The direction a directional light or a spot shines in.
    pub direction: Option<[f64; 3]>,
    /// A point on the axis of a spot's cone, instead of a direction.
    pub look_at: Option<[f64; 3]>,
    /// Degrees from a spot's axis within which it has its full intensity, up to the outer angle; 0 if not given. Between the angles
    /// the intensity falls with the square of a linear ramp in the cosine (KHR_lights_punctual).
    pub inner_cone_angle: Option<f64>,
    /// Degrees from a spot's axis beyond which it lights nothing, up to 90; 45 if not given.
    pub outer_cone_angle: Option<f64>,
    /// Its intensity, I; 1 if not given.
    pub intensity: Option<f64>,
    /// Its colour; white if not given.
    pub colour: Option<ColourValue>,
    /// How a point light or a spot weakens with distance; not at all if not given.
    #[serde(default)]
    pub falloff: FalloffValue,
}

/// A Phong material.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialSection {
    /// The object's own colour.
    pub colour: ColourValue,
    /// Coefficient of ambient light, k_a; 1 if not given.
    pub ambient: Option<f64>,
    /// Coefficient of diffuse light, k_d; 1 if not given.
    pub diffuse: Option<f64>,
    /// Coefficient of the highlight, k_s; 0 if not given.
    pub specular: Option<f64>,
    /// Exponent of the highlight, n; 16 if not given.
    pub shininess: Option<f64>,
    /// A faint mirror over the surface.
    pub glaze: Option<GlazeSection>,
}

/// A faint mirror.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlazeSection {
    /// Weight of what is seen in the mirror, 0 to 1; 0.25 if not given.
    pub weight: Option<f64>,
    /// Weight of the object's own colour; `1 - weight` if not given.
    pub own_weight: Option<f64>,
    /// How often a ray may be reflected; 1 if not given.
    pub bounces: Option<u32>,
}

/// An analytic sphere.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereSection {
    /// What messages call it.
    pub name: Option<String>,
    /// Its centre.
    pub centre: [f64; 3],
    /// Its radius, above 0.
    pub radius: f64,
    /// The name of its material; a light grey if not given.
    pub material: Option<String>,
}

/// A triangle list.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrianglesSection {
    /// What messages call it.
    pub name: Option<String>,
    /// Vertex positions.
    pub vertices: Vec<[f64; 3]>,
    /// Three vertices a triangle, counted from 0; the vertices in order, three by three, if not given.
    pub indices: Option<Vec<[u32; 3]>>,
    /// The name of its material; a light grey if not given.
    pub material: Option<String>,
}

/// A mesh from a file: scaled, then rotated, then translated.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshSection {
    /// What tracks and messages call it; the file's own names if not given.
    pub name: Option<String>,
    /// The file, beside the scene file unless absolute, of any format of meshes that `kiln render --help` lists.
    pub file: String,
    /// Where its origin goes.
    pub translate: Option<[f64; 3]>,
    /// Rotation about the x, then the y, then the z axis, in degrees.
    pub rotate: Option<[f64; 3]>,
    /// One factor, or one for each axis.
    pub scale: Option<ScaleValue>,
    /// The places where the mesh stands, instead of a single one. However many there are, its triangles are kept once.
    #[schemars(with = "Option<Vec<PlacementValue>>")]
    pub placements: Option<Vec<Spanned<PlacementValue>>>,
    /// The name of a material that replaces the file's own.
    pub material: Option<String>,
}

/// A place of a mesh: scaled, then rotated, then translated.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacementValue {
    /// Where its origin goes.
    pub translate: Option<[f64; 3]>,
    /// Rotation about the x, then the y, then the z axis, in degrees.
    pub rotate: Option<[f64; 3]>,
    /// One factor, or one for each axis.
    pub scale: Option<ScaleValue>,
}

/// One factor, or one for each axis.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number or [x, y, z]")]
pub enum ScaleValue {
    /// The same along every axis.
    Uniform(f64),
    /// One for each axis.
    PerAxis([f64; 3]),
}

impl CameraSection {
    /// Reads a camera that is typed as an inline table: `{ position = [0, 0, 5], look_at = [0, 0, 0] }`.
    ///
    /// # Errors
    /// What is wrong, and a hint, which names the nearest known key for an unknown one.
    pub fn parse_inline(text: &str) -> std::result::Result<Self, (String, String)> {
        toml::de::ValueDeserializer::parse(text.trim())
            .and_then(CameraSection::deserialize)
            .map_err(|e| explain(e.message()))
    }
}

impl SceneFile {
    /// Reads the text of a scene file; `file` is named in errors.
    ///
    /// # Errors
    /// [`Error::Input`] with the line, and for an unknown key the nearest known one.
    pub fn parse(text: &str, file: &Path) -> Result<Self> {
        toml::from_str(text).map_err(|e| {
            let line = line_of(text, e.span().map_or(0, |span| span.start));
            let (what, hint) = explain(e.message());
            Error::input(Place::line(file, line), what, hint)
        })
    }

    /// The JSON schema of scene files.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(SceneFile).to_value()
    }
}

/// The line, counted from 1, that holds the byte at `offset`.
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&b| b == b'\n').count()
}

/// The parser's message, and for an unknown key a hint that names the nearest known one.
fn explain(message: &str) -> (String, String) {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let what = message.split(", expected").next().unwrap_or(message).lines().next().unwrap_or(message);
    let known = names.get(1..).unwrap_or(&[]);
    let unknown = message.starts_with("unknown field") || message.starts_with("unknown variant");
    match names.first() {
        Some(typed) if unknown && !known.is_empty() => {
            let what = what.replacen("unknown field", "unknown key", 1).replacen(
                "unknown variant",
                "unknown value",
                1,
            );
            (what, nearest_name(typed, known))
        }
        _ => (
            message.lines().next().unwrap_or(message).replacen("missing field", "missing key", 1),
            String::new(),
        ),
    }
}

/// "did you mean `x`?" where a name comes close to `typed`, and all names otherwise.
pub fn nearest_name(typed: &str, known: &[&str]) -> String {
    let similarity = |name: &&&str| (strsim::jaro_winkler(typed, name) * 1e6) as u64;
    match known.iter().max_by_key(similarity) {
        Some(name) if similarity(&name) >= 800_000 => format!("did you mean `{name}`?"),
        _ => format!("known here: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error_of(text: &str) -> Error {
        SceneFile::parse(text, Path::new("a.toml")).unwrap_err()
    }

    #[test]
    fn unknown_keys_name_line_key_and_nearest() {
        let e = error_of("[image]\nwidth = 3\nheigth = 4\n");
        assert_eq!(e.to_string(), "a.toml:3: unknown key `heigth`");
        assert_eq!(e.hint(), "did you mean `height`?");
    }

    #[test]
    fn unknown_values_too() {
        let e = error_of("[[light]]\ntype = \"pint\"\n");
        assert_eq!(e.to_string(), "a.toml:2: unknown value `pint`");
        assert_eq!(e.hint(), "did you mean `point`?");
    }

    #[test]
    fn missing_keys_and_wrong_types_have_a_line() {
        let e = error_of("[image]\nwidth = 1\n\n[[sphere]]\nradius = 1.0\n");
        assert_eq!(e.to_string(), "a.toml:4: missing key `centre`");
        let e = error_of("[[sphere]]\ncentre = [0, 0]\nradius = 1.0\n");
        assert!(e.to_string().starts_with("a.toml:2: "), "{e}");
    }

    #[test]
    fn colours_both_ways() {
        let parse =
            |value: &str| SceneFile::parse(&format!("[image]\nbackground = {value}\n"), Path::new("a.toml"));
        let red = Some(ColourValue([124, 10, 2]));
        let background = |value: &str| parse(value).unwrap().image.unwrap().get_ref().background;
        assert_eq!(background("[124, 10, 2]"), red);
        assert_eq!(background("\"#7c0A02\""), red);
        for bad in ["[1, 2]", "[256, 0, 0]", "[0.5, 0.5, 0.5]", "\"#12345\"", "\"#12345é\"", "\"red\""] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
