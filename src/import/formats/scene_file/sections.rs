//! TOML form of a scene, as typed. The other files of this folder convert it to a [`crate::scene::Scene`].
//!
//! Unknown keys are errors. The JSON schema for editors is generated from these types and their doc comments.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;
use toml::de::DeTable;

use crate::error::{Error, Place, Result};
use crate::import::formats::scene_file::animation_sections::AnimationSection;
use crate::import::formats::scene_file::metallic_roughness::LayersSection;
use crate::import::formats::scene_file::spelling;
use crate::import::formats::scene_file::toml_error::{TomlError, check_lists, explain};
use crate::limits;
use crate::scene::{ColourValue, Degrees, EffectValue, PictureSettings, Projection, UpAxis};

/// A scene file.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// The picture.
    #[schemars(with = "Option<PictureSettings>")]
    pub image: Option<Spanned<PictureSettings>>,
    /// Cameras; the first is the default.
    #[serde(default)]
    #[schemars(with = "Vec<CameraSection>")]
    pub camera: Vec<Spanned<CameraSection>>,
    /// Ambient light.
    #[schemars(with = "Option<AmbientSection>")]
    pub ambient: Option<Spanned<AmbientSection>>,
    /// Environment light. It turns path tracing on.
    #[schemars(with = "Option<EnvironmentSection>")]
    pub environment: Option<Spanned<EnvironmentSection>>,
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
    /// Analytic disks.
    #[serde(default)]
    #[schemars(with = "Vec<DiskSection>")]
    pub disk: Vec<Spanned<DiskSection>>,
    /// Triangle lists.
    #[serde(default)]
    #[schemars(with = "Vec<TrianglesSection>")]
    pub triangles: Vec<Spanned<TrianglesSection>>,
    /// Meshes from files.
    #[serde(default)]
    #[schemars(with = "Vec<MeshSection>")]
    pub mesh: Vec<Spanned<MeshSection>>,
    /// Effects turned on or off explicitly, overriding what the scene's contents imply.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, EffectValue>")]
    pub effects: std::collections::BTreeMap<String, Spanned<EffectValue>>,
    /// Animation tracks.
    #[schemars(with = "Option<AnimationSection>")]
    pub animation: Option<Spanned<AnimationSection>>,
    /// Byte offsets of colours such as [1, 1, 0], which are nearly black.
    #[serde(skip)]
    pub(super) dark_colours: Vec<usize>,
}

/// A camera, defined by a viewing rectangle (or only its height) at a distance, by a vertical field of view, or by its
/// intrinsic matrix; its place by `position` and `look_at`, or by `pose`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// Name, as used by `--camera`.
    pub name: Option<String>,
    /// Position.
    pub position: Option<[f64; 3]>,
    /// A point that the camera looks at.
    pub look_at: Option<[f64; 3]>,
    /// Up vector, not necessarily perpendicular to the view direction; (0, 1, 0) if not given.
    pub up: Option<[f64; 3]>,
    /// Projection; perspective if not given.
    #[serde(default)]
    pub projection: Projection,
    /// Width and height of the viewing rectangle in world units.
    pub viewing_rectangle: Option<[f64; 2]>,
    /// Height of the viewing rectangle in world units, instead of `viewing_rectangle`; the width follows the aspect
    /// ratio of the picture.
    pub viewing_height: Option<f64>,
    /// Distance from the position to the viewing rectangle.
    pub viewpoint_distance: Option<f64>,
    /// Vertical field of view in degrees, instead of rectangle and distance; 40 if neither is given. `fov` is another name
    /// of this key.
    #[serde(alias = "fov")]
    pub vertical_fov: Option<f64>,
    /// Focal length in millimetres on film of 36 x 24 mm, instead of the field of view.
    pub focal_length: Option<f64>,
    /// Intrinsic matrix in pixels, as OpenCV defines it, instead of the field of view: the centre of the first pixel, top
    /// left, is (0, 0). Or [fx, fy, cx, cy].
    #[serde(rename = "K")]
    pub intrinsics: Option<IntrinsicMatrix>,
    /// Width and height of the picture that `K` is for, in pixels. If not given, those of `[image]`, or of `--size` for
    /// `--camera`.
    pub image_size: Option<[u32; 2]>,
    /// Rows of the matrix from the camera's coordinates to the world's, a rotation and a position, instead of `position`,
    /// `look_at` and `up`.
    pub pose: Option<[[f64; 4]; 4]>,
    /// The axes of `pose`.
    pub axes: Option<Axes>,
    /// The middle of the viewing rectangle, right of and above the line of sight, in shares of its width and height;
    /// (0, 0) if not given.
    pub lens_shift: Option<[f64; 2]>,
    /// Whether a picture shows exactly the viewing rectangle, with oblong pixels where their aspect ratios differ. If not
    /// given, pixels are square and it shows more.
    #[serde(default)]
    pub oblong_pixels: bool,
    /// Radius of the lens in world units; what is not in focus is blurred. 0 if not given.
    pub aperture_radius: Option<f64>,
    /// f-number of the lens, instead of its radius; a world unit is a metre.
    pub f_stop: Option<f64>,
    /// Distance of the plane of focus along the view direction; the first surface in the centre of the picture if not given.
    pub focus_distance: Option<f64>,
    /// A point in the plane of focus, instead of its distance.
    pub focus_at: Option<[f64; 3]>,
    /// Corners of the aperture; a circle if 0 or not given.
    pub blades: Option<u32>,
    /// Rotation of the corners in degrees, counterclockwise; at 0, one is to the right.
    pub blade_rotation: Option<f64>,
    /// Whether the camera was fitted to frame the scene, as in metadata of pictures by automatic cameras.
    #[serde(default)]
    pub fitted: bool,
}

/// An intrinsic matrix.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "3 rows of 3 numbers, or [fx, fy, cx, cy]")]
pub enum IntrinsicMatrix {
    /// Its rows.
    Rows([[f64; 3]; 3]),
    /// fx, fy, cx and cy.
    Numbers([f64; 4]),
}

/// The axes of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axes {
    /// x to the right, y down, z ahead, as in OpenCV and COLMAP.
    OpenCv,
    /// x to the right, y up, z backwards, as in OpenGL, Blender and NeRF data sets.
    OpenGl,
}

/// The lens of a camera: keys of [`CameraSection`], and of the `extras` of glTF's cameras.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
pub(crate) struct LensSection {
    pub(super) aperture_radius: Option<f64>,
    pub(super) f_stop: Option<f64>,
    pub(super) focus_distance: Option<f64>,
    pub(super) focus_at: Option<[f64; 3]>,
    pub(super) blades: Option<u32>,
    pub(super) blade_rotation: Option<f64>,
}

impl CameraSection {
    /// The keys of the lens.
    pub(super) fn lens(&self) -> LensSection {
        let CameraSection {
            aperture_radius, f_stop, focus_distance, focus_at, blades, blade_rotation, ..
        } = *self;
        LensSection { aperture_radius, f_stop, focus_distance, focus_at, blades, blade_rotation }
    }
}

/// Ambient light.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AmbientSection {
    /// Its intensity, I_a.
    pub intensity: Option<f64>,
}

/// Environment light and background: one of `file`, `sky` and `colour`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentSection {
    /// An equirectangular image in .hdr or .exr, relative to the scene file. Its centre is the direction +x, to the right of
    /// it lies +z, and its top row is +y.
    pub file: Option<String>,
    /// A sky with a hazy sun 40 degrees high.
    #[serde(default)]
    pub sky: bool,
    /// Constant radiance; white is 1.
    pub colour: Option<ColourValue>,
    /// Rotation about +y in degrees, counterclockwise seen from above; 0 if not given.
    pub rotation: Option<f64>,
    /// Factor of the radiance; 1 if not given.
    pub intensity: Option<f64>,
    /// Whether the background colour is shown instead of the environment.
    #[serde(default)]
    pub hide: bool,
}

/// The kinds of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LightType {
    /// A point light at `position`.
    Point,
    /// A directional light along `direction`.
    Directional,
    /// A point light at `position`, restricted to a cone along `direction` or towards `look_at`.
    Spot,
    /// A spherical area light of `radius` around `position`, for path tracing.
    Sphere,
    /// A rectangular area light of `size` around `position`, along `direction` or towards `look_at`, for path tracing.
    Rectangle,
    /// A circular area light of `radius` around `position`, along `direction` or towards `look_at`, for path tracing.
    Disk,
}

/// Falloff of a light's intensity with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FalloffValue {
    /// No falloff.
    #[default]
    None,
    /// Inverse square of the distance.
    InverseSquare,
}

/// A light.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightSection {
    /// Name, used in messages.
    pub name: Option<String>,
    /// The kind of light.
    #[serde(rename = "type")]
    pub kind: LightType,
    /// Position of a light other than a directional one; the centre of an area light.
    pub position: Option<[f64; 3]>,
    /// Direction in which a directional light, a spot, a rectangle or a disk shines.
    pub direction: Option<[f64; 3]>,
    /// A point that a spot, a rectangle or a disk shines at, instead of a direction.
    pub look_at: Option<[f64; 3]>,
    /// Apparent diameter of a directional light in degrees, 0 to 180, for path tracing; 0 if not given. The sun's is
    /// 0.53. The light on a surface that faces it does not depend on it.
    pub angle: Option<f64>,
    /// Radius of a sphere or a disk, above 0.
    pub radius: Option<f64>,
    /// Width and height of a rectangle, above 0.
    pub size: Option<[f64; 2]>,
    /// Up vector of a rectangle, not necessarily perpendicular to its direction: its height lies in the plane of both;
    /// (0, 1, 0) if not given.
    pub up: Option<[f64; 3]>,
    /// Half angle of a spot's inner cone in degrees, inside which the intensity is full, at most the outer angle; 0 if
    /// not given. Between the cones the intensity falls with the square of a linear ramp in the cosine
    /// (KHR_lights_punctual).
    pub inner_cone_angle: Option<f64>,
    /// Half angle of a spot's outer cone in degrees, outside which the intensity is zero, up to 90; 45 if not given.
    pub outer_cone_angle: Option<f64>,
    /// Intensity, I; 1 if not given. That of an area light is the intensity of a point light with
    /// inverse-square falloff that it looks like from far away (in front), whatever its size.
    pub intensity: Option<f64>,
    /// Colour; white if not given.
    pub colour: Option<ColourValue>,
    /// Falloff of a point light or a spot with distance; none if not given.
    #[serde(default)]
    pub falloff: FalloffValue,
}

/// A material: metallic-roughness (glTF) if it has `roughness` or `metallic`, otherwise Phong.
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
    /// Colour of the emitted light; none if not given. With path tracing the surface is a light.
    pub emission: Option<ColourValue>,
    /// Factor of the emitted light; 1 if not given.
    pub emission_intensity: Option<f64>,
    /// Mirror reflection, blended with the surface's own colour.
    pub glaze: Option<GlazeSection>,
    /// 0 for a dielectric, 1 for a metal; 0 if not given.
    pub metallic: Option<f64>,
    /// 0 for a mirror, 1 for a fully rough surface; 1 if not given.
    pub roughness: Option<f64>,
    /// Opacity, 0 to 1; 1 if not given.
    pub opacity: Option<f64>,
    /// Whether both sides of the surface are seen with `--cull`; true if not given.
    pub double_sided: Option<bool>,
    /// Layers and medium, as in extensions of glTF; used by path tracing.
    pub layers: Option<LayersSection>,
}

/// Mirror reflection, blended with a surface's own colour.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlazeSection {
    /// Weight of the reflected colour, 0 to 1; 0.25 if not given.
    pub weight: Option<f64>,
    /// Weight of the object's own colour; `1 - weight` if not given.
    pub own_weight: Option<f64>,
    /// Maximum number of reflections of a ray; 1 if not given.
    pub bounces: Option<u32>,
}

/// An analytic sphere.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = add_names_of_centre)]
pub struct SphereSection {
    /// Name, used in messages.
    pub name: Option<String>,
    /// Its centre; `center` and `position` are other names of this key.
    #[serde(alias = "center", alias = "position")]
    pub centre: [f64; 3],
    /// Its radius, above 0.
    pub radius: f64,
    /// The name of its material; a light grey if not given.
    pub material: Option<String>,
}

/// An analytic disk, flat and seen from both sides.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = add_names_of_centre)]
pub struct DiskSection {
    /// Name, used in messages.
    pub name: Option<String>,
    /// Its centre; `center` and `position` are other names of this key.
    #[serde(alias = "center", alias = "position")]
    pub centre: [f64; 3],
    /// The normal of its front, of any length but 0.
    pub normal: [f64; 3],
    /// Its radius, above 0.
    pub radius: f64,
    /// The name of its material; a light grey if not given.
    pub material: Option<String>,
}

/// Adds the other names of `centre` to the schema, which has to name every accepted key; exactly one is required.
fn add_names_of_centre(schema: &mut schemars::Schema) {
    const NAMES: [&str; 3] = ["centre", "center", "position"];
    let Some(properties) = schema.get_mut("properties") else { return };
    let centre = properties["centre"].clone();
    NAMES.iter().for_each(|name| properties[*name] = centre.clone());
    if let Some(required) = schema.get_mut("required").and_then(|required| required.as_array_mut()) {
        required.retain(|name| name != "centre");
    }
    schema
        .insert("oneOf".into(), NAMES.map(|name| serde_json::json!({ "required": [name] })).to_vec().into());
}

/// A triangle list.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrianglesSection {
    /// Name, used in messages.
    pub name: Option<String>,
    /// Vertex positions.
    pub vertices: Vec<[f64; 3]>,
    /// Three vertex indices per triangle, from 0; if not given, consecutive vertices form triangles.
    pub indices: Option<Vec<[u32; 3]>>,
    /// The name of its material; a light grey if not given.
    pub material: Option<String>,
}

/// A mesh from a file: scaled, then rotated, then translated.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshSection {
    /// Name, used by animation tracks and messages; the file's own names if not given.
    pub name: Option<String>,
    /// Mesh file, relative to the scene file unless absolute, in any mesh format that `kiln render --help` lists.
    pub file: String,
    /// The axis of the file that points up; y if not given. `--up` takes its place.
    pub up: Option<UpAxis>,
    /// Smooth normals for a file without normals, up to this crease angle in degrees, 0 to 180; 0 is flat shading. If not
    /// given, 30 with `look = "studio"`, except for glTF, else 0. `--smooth` takes its place.
    pub smooth: Option<Degrees>,
    /// Point that the mesh is moved to, instead of `translate`: the centre of the lower side of its bounds lies there.
    pub at: Option<[f64; 3]>,
    /// Size to which the longest side of its bounds is scaled, after `scale` and `rotate`. The mesh stands on the origin, or on `at`.
    pub fit: Option<f64>,
    /// Translation.
    pub translate: Option<[f64; 3]>,
    /// Rotation about the x, then the y, then the z axis, in degrees.
    pub rotate: Option<[f64; 3]>,
    /// Uniform scale factor, or one factor per axis.
    pub scale: Option<ScaleValue>,
    /// Placements of the mesh, instead of a single one. Its triangles are stored once.
    #[schemars(with = "Option<Vec<PlacementValue>>")]
    pub placements: Option<Vec<Spanned<PlacementValue>>>,
    /// Name of a material that replaces those of the file.
    pub material: Option<String>,
}

/// A placement of a mesh: scaled, then rotated, then translated.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacementValue {
    /// Translation.
    pub translate: Option<[f64; 3]>,
    /// Rotation about the x, then the y, then the z axis, in degrees.
    pub rotate: Option<[f64; 3]>,
    /// Uniform scale factor, or one factor per axis.
    pub scale: Option<ScaleValue>,
}

/// Uniform scale factor, or one factor per axis.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number or [x, y, z]")]
pub enum ScaleValue {
    /// The same factor on every axis.
    Uniform(f64),
    /// One factor per axis.
    PerAxis([f64; 3]),
}

impl SceneFile {
    /// Parses the text of a scene file; errors name `file`.
    ///
    /// # Errors
    /// [`Error::Input`] with the line; for an unknown key also the nearest known key.
    pub fn parse(text: &str, file: &Path) -> Result<Self> {
        let fault = |e: TomlError| Error::input(Place::line(file, line_of(text, e.offset)), e.what, e.hint);
        limits::check(parsing_bytes(text)).map_err(|excess| excess.at(file, "reading it"))?;
        let mut table = DeTable::parse(text).map_err(|e| fault(explain(e, text)))?;
        table
            .get_ref()
            .iter()
            .try_for_each(|(key, value)| check_lists(key.get_ref(), value))
            .map_err(fault)?;
        let mut dark_colours = Vec::new();
        spelling::unify(table.get_mut(), &mut dark_colours);
        let file =
            SceneFile::deserialize(toml::Deserializer::from(table)).map_err(|e| fault(explain(e, text)))?;
        Ok(SceneFile { dark_colours, ..file })
    }

    /// The JSON schema of scene files.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(SceneFile).to_value()
    }
}

/// Upper bound of the bytes of parsing and of the resulting scene, from the number of keys, lists, tables and values.
/// Measured as peak memory of `kiln info` on 4 MB files of one construct each: at most 210 bytes per value of a list,
/// 410 per key, 710 per list, 1430 per inline table with a key, and 2600 per section of a sphere with 3 numbers.
fn parsing_bytes(text: &str) -> u64 {
    const ITEM: u64 = 220;
    const KEY_OR_LIST: u64 = 450;
    const TABLE: u64 = 900;
    let mut bytes = 2 * text.len() as u64;
    // Each dot of a key makes a table; a number has at most one.
    let (mut dots, mut is_header) = (0u64, false);
    let mut previous = b'\n';
    for byte in text.bytes() {
        match byte {
            b'.' => dots += 1,
            b',' | b'\n' => dots = 0,
            _ => {}
        }
        match byte {
            b',' => bytes = bytes.saturating_add(ITEM),
            b'{' => bytes = bytes.saturating_add(TABLE),
            b'[' => {
                is_header |= previous == b'\n';
                bytes = bytes.saturating_add(KEY_OR_LIST);
            }
            b'=' => {
                bytes = bytes.saturating_add(KEY_OR_LIST + TABLE * dots);
                dots = 0;
            }
            b']' => {
                bytes =
                    bytes.saturating_add(TABLE * if is_header { dots + 1 } else { dots.saturating_sub(1) });
                (dots, is_header) = (0, false);
            }
            _ => {}
        }
        if !matches!(byte, b' ' | b'\t') {
            previous = byte;
        }
    }
    bytes
}

/// Line number, counted from 1, of the byte at `offset`.
fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&b| b == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Background, Clamp, FilterRadius, Noise, OptionValue, Samples, Side};

    fn error_of(text: &str) -> Error {
        SceneFile::parse(text, Path::new("a.toml")).unwrap_err()
    }

    #[test]
    fn a_centre_has_three_names() {
        let parse =
            |keys: &str| SceneFile::parse(&format!("[[sphere]]\nradius = 1\n{keys}"), Path::new("a.toml"));
        for name in ["centre", "center", "position"] {
            let file = parse(&format!("{name} = [1, 2, 3]\n")).unwrap();
            assert_eq!(file.sphere[0].get_ref().centre, [1.0, 2.0, 3.0]);
            let schema = &SceneFile::schema()["$defs"]["SphereSection"];
            assert!(schema["properties"][name].is_object(), "{schema}");
        }
        assert_eq!(SceneFile::schema()["$defs"]["SphereSection"]["required"], serde_json::json!(["radius"]));
        let e = parse("centre = [1, 2, 3]\nposition = [1, 2, 3]\n").unwrap_err();
        assert_eq!(e.to_string(), "a.toml:1: `centre` is given twice");
    }

    #[test]
    fn colours_both_ways() {
        let parse =
            |value: &str| SceneFile::parse(&format!("[image]\nbackground = {value}\n"), Path::new("a.toml"));
        let red = Some(Background::Colour(ColourValue([124, 10, 2])));
        let background = |value: &str| parse(value).unwrap().image.unwrap().get_ref().background;
        assert_eq!(background("[124, 10, 2]"), red);
        assert_eq!(background("\"#7c0A02\""), red);
        assert_eq!(background("\"Navy\""), Some(Background::Colour(ColourValue([0, 0, 128]))));
        for bad in ["[1, 2]", "[256, 0, 0]", "[0.5, 0.5, 0.5]", "\"#12345\"", "\"#12345é\"", "\"reddish\""] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    /// A value out of range has the same message in scene files and as text.
    #[test]
    fn ranges_have_one_message() {
        let fault = |key: &str, value: &str| {
            let e = error_of(&format!("[image]\n\n{key} = {value}\n"));
            assert_eq!(e.to_string(), format!("a.toml:3: `{key}` is {value}"));
            e.hint().to_owned()
        };
        assert_eq!(Err(fault("samples", "0")), Samples::parse("0"));
        assert_eq!(Err(fault("width", "65536")), Side::parse("65536"));
        assert_eq!(Err(fault("filter_radius", "-1")), FilterRadius::parse("-1"));
        assert_eq!(Err(fault("noise", "2.0")), Noise::parse("NaN"));
        assert_eq!(Err(fault("clamp", "0")), Clamp::parse("x"));
    }
}
