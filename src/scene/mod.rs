//! Scene description: plain data in double precision, without acceleration structures or render settings. Scene files,
//! OBJ, glTF, PLY, STL, OFF and 3MF files are all imported into a [`Scene`].
//!
//! Conventions: right-handed, +y up, no physical unit, column vectors; transforms are named `b_from_a`; angles are in
//! radians (degrees in files). Primitives are numbered in the order of the description: objects as written, triangles
//! as listed.
//!
//! ```
//! use kiln::scene::{Camera, Material, Mesh, Object, Phong, Scene, Shape, Sphere};
//!
//! let mut scene = Scene::default();
//! let grey = scene.add_material(Material::Phong(Phong::default()));
//! let floor = Mesh {
//!     positions: [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]].map(Into::into).into(),
//!     triangles: vec![[0, 1, 2]],
//!     ..Mesh::default()
//! };
//! let ball = Sphere { centre: [0.0, 1.0, 0.0].into(), radius: 1.0 };
//! for (name, shape) in [("floor", Shape::Mesh(floor)), ("ball", Shape::Analytic(ball.into()))] {
//!     scene.objects.push(Object { name: name.into(), input: 0, material: grey, shape });
//! }
//! assert_eq!(scene.primitive_count(), 2);
//! assert_eq!(scene.bounds().map(|(min, max)| (min.y, max.y)), Some((0.0, 2.0)));
//! ```

pub mod animation;
pub(crate) mod camera;
mod default_look;
pub mod mesh;

mod fingerprint;
mod ground;
mod hidden;
mod light;
mod material;
pub mod option;
mod up;

pub use crate::bvh::detail::{Attribute, Step, is_mirror, moved_tangent, normal_matrix};
pub use crate::bvh::{AnalyticShape, Disk, Mesh, Numerics, Placed, Placement, Sphere};
pub use crate::limits::{Counted, Limits};
pub use animation::Animation;
pub use animation::clip::{Clip, ClipChoice, ClipTime};
pub use camera::lens::{Focus, Lens};
pub use camera::text::{INLINE_NAME, shell_quoted};
pub use camera::{Camera, Intrinsics, Projection, Sensor, default_size};
pub use default_look::{AddedLight, DefaultLook};
pub use fingerprint::Fingerprint;
pub use ground::Ground;
pub use hidden::HiddenObject;
pub use light::environment::{Environment, EnvironmentImage, EnvironmentSource};
pub use light::fill::{Fill, FillZone};
pub use light::{Falloff, Light, LightKind, LightSurface};
pub use material::change::MaterialChange;
pub use material::layers::{Layers, Volume};
pub use material::sampler::{
    Interpolation, Minify, ResolvedTextureFilter, TextureFilter, TextureSampler, Wrap,
};
pub use material::texels::TexelValues;
pub use material::texture_slot::{SlotEntry, TEXTURE_SLOTS, TextureSlot, Textures};
pub use material::{
    DecodedImage, Glaze, Material, MetallicRoughness, Opacity, Phong, Refraction, TexelEncoding, Texture,
};
pub use option::bit_depth::BitDepth;
pub use option::colour_value::ColourValue;
pub use option::effects::{EffectValue, EffectsSection};
pub use option::import_options::{Degrees, ImportOptions, MaterialChoice, Seconds};
pub use option::picture::{
    Background, Bounces, Clamp, FieldOfView, FilterRadius, Headlight, Intensity, Look, Noise,
    PictureSettings, Rotation, Samples, Side, Zoom,
};
pub use option::sampling::{MAX_SAMPLES, PixelSampler, Sampling};
pub use option::shading_mode::ShadingMode;
pub use option::transport::{Transport, TransportReason};
pub use option::{GivenValue, OptionSpec, OptionValue, Options, ValueCount, ValueKind, group};
pub use up::{UpAxis, UpChoice};

use mesh::support::{AffineFunction, PointTrees, can_be_seen};

use crate::bvh::{Bvh, NotFinite, Preset, PrimId, Primitive, Triangle};
use crate::film::Colour;
use glam::DVec3;
use mesh::support;

/// Index of a material in [`Scene::materials`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
pub struct MaterialId(pub u32);

/// Index of an image in [`Scene::images`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct ImageId(pub u32);

/// Description of everything to render. A field that is `None` was not set by any input; it takes its default when the
/// scene is prepared.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Settings of the picture. Those of a render take precedence.
    pub picture: PictureSettings,
    /// Colour of rays that hit nothing, where the settings give no background.
    pub background: Option<Colour>,
    /// Intensity of the ambient light, per unit of a material's ambient coefficient.
    pub ambient: Option<f64>,
    /// Light from infinitely far away.
    pub environment: Option<Environment>,
    /// Named cameras; the first is the default.
    pub cameras: Vec<Camera>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Materials, referred to by [`MaterialId`].
    pub materials: Vec<Material>,
    /// Images referenced by textures, by [`ImageId`].
    pub images: Vec<DecodedImage>,
    /// Spheres and meshes.
    pub objects: Vec<Object>,
    /// Objects that are hidden ([`Scene::set_visible`]), in ascending order of their indices.
    pub hidden: std::sync::Arc<Vec<HiddenObject>>,
    /// Input files in order; [`Object::input`] is an index into this list.
    pub inputs: Vec<std::path::PathBuf>,
    /// Absolute paths of all files that the scene was read from: the inputs and the files that they reference. Outputs
    /// must not overwrite them ([`crate::files::InputFiles`]).
    pub files_read: Vec<std::path::PathBuf>,
    /// Effects that the scene turns on or off explicitly, overriding what its contents imply.
    pub effects: EffectsSection,
    /// Animation tracks, if any.
    pub animation: Option<Animation>,
    /// Clips of the input files. Objects, cameras and lights are posed by one of them, or at rest.
    pub clips: Vec<Clip>,
    /// The names of the variants of its materials (KHR_materials_variants), those of each input once.
    pub variants: Vec<String>,
    /// What the input files say of themselves, such as their generator and copyright: names and values.
    pub metadata: Vec<(String, String)>,
    /// What was asked of the input files.
    pub import_options: ImportOptions,
    /// Whether primitives were left out because of their coordinates.
    pub has_left_out: bool,
    /// Whether a scene file is among the inputs. Such scenes are rendered as they say.
    pub has_settings: bool,
    /// Whether lights are in physical units (candela, lux), so that pictures may need an exposure.
    pub has_physical_lights: bool,
}

/// An object of the scene: a shape and its material.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name from the file, or one derived from its position there.
    pub name: String,
    /// Index of the input file in [`Scene::inputs`].
    pub input: usize,
    /// Its material.
    pub material: MaterialId,
    /// Its geometry.
    pub shape: Shape,
}

impl Object {
    /// Whether it has this name, or is a part of what has it: `NAME/...`.
    pub fn is_named(&self, name: &str) -> bool {
        is_named(&self.name, name)
    }
}

/// [`Object::is_named`] for the name of an object.
pub fn is_named(object: &str, name: &str) -> bool {
    object.strip_prefix(name).is_some_and(|part| part.is_empty() || part.starts_with('/'))
}

/// The supported shapes.
#[derive(Debug, Clone)]
// Objects are few compared with triangles, so the unused bytes of small variants do not matter.
#[allow(clippy::large_enum_variant)]
pub enum Shape {
    /// An analytic shape, such as a sphere.
    Analytic(AnalyticShape),
    /// Triangles that share vertices.
    Mesh(Mesh),
    /// An instance of a mesh shared by several placements.
    Placed(Placed),
}

impl FromIterator<Shape> for Scene {
    /// Objects without names, of the default material.
    fn from_iter<I: IntoIterator<Item = Shape>>(shapes: I) -> Self {
        let mut scene = Scene::default();
        let material = scene.add_material(Material::Phong(Phong::default()));
        let object = |shape| Object { name: String::new(), input: 0, material, shape };
        scene.objects.extend(shapes.into_iter().map(object));
        scene
    }
}

impl Scene {
    /// Adds a material and returns its index.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId((self.materials.len() - 1) as u32)
    }

    /// Whether its animation plays clips of the input files.
    pub fn plays_clips(&self) -> bool {
        self.animation.as_ref().is_some_and(|animation| !animation.clips.is_empty())
    }

    /// Adds an image and returns its index.
    pub fn add_image(&mut self, image: DecodedImage) -> ImageId {
        self.images.push(image);
        ImageId((self.images.len() - 1) as u32)
    }

    /// Appends another scene, except its `inputs`. Settings of the whole picture that both set keep the value of
    /// `self`.
    pub fn append(&mut self, other: Scene) {
        // Every field is named, so that a new one that is not merged fails to compile.
        let Scene {
            picture,
            background,
            ambient,
            environment,
            cameras,
            lights,
            materials,
            images,
            objects,
            hidden,
            inputs: _,
            files_read,
            effects,
            animation,
            clips,
            variants,
            metadata,
            // Of the whole scene.
            import_options: _,
            has_left_out,
            has_settings,
            has_physical_lights,
        } = other;
        let (first_material, first_image) = (self.materials.len() as u32, self.images.len() as u32);
        self.picture = self.picture.or(picture);
        self.background = self.background.or(background);
        self.ambient = self.ambient.or(ambient);
        self.environment = self.environment.take().or(environment);
        self.cameras.extend(cameras);
        self.lights.extend(lights);
        self.effects = std::mem::take(&mut self.effects).or(effects);
        self.animation = self.animation.take().or(animation);
        let files = self.clips.last().map_or(0, |clip| clip.file + 1);
        self.clips.extend(clips.into_iter().map(|clip| Clip { file: clip.file + files, ..clip }));
        self.variants.extend(variants);
        self.files_read.extend(files_read);
        self.metadata.extend(metadata);
        self.has_left_out |= has_left_out;
        self.has_settings |= has_settings;
        self.has_physical_lights |= has_physical_lights;
        self.images.extend(images);
        self.materials.extend(materials.into_iter().map(|mut material| {
            for texture in material.textures_mut().iter_mut() {
                texture.image.0 += first_image;
            }
            material
        }));
        let moved = |mut object: Object| {
            object.material.0 += first_material;
            object
        };
        let first = self.objects.len() + self.hidden.len();
        let hidden = std::sync::Arc::unwrap_or_clone(hidden).into_iter();
        let hidden = hidden.map(|HiddenObject { index, object }| HiddenObject {
            index: first + index,
            object: moved(object),
        });
        std::sync::Arc::make_mut(&mut self.hidden).extend(hidden);
        self.objects.extend(objects.into_iter().map(moved));
    }

    /// Whether an object is unlit.
    pub fn has_unlit(&self) -> bool {
        self.objects.iter().any(|o| self.materials.get(o.material.0 as usize).is_some_and(Material::is_unlit))
    }

    /// Number of primitives: triangles and analytic shapes.
    pub fn primitive_count(&self) -> usize {
        self.objects.iter().map(|object| object.shape.primitive_count()).sum()
    }

    /// All primitives in order, so that the index of each is its [`PrimId`]. Placed meshes are expanded.
    pub fn primitives(&self) -> impl Iterator<Item = Primitive> + '_ {
        self.objects.iter().flat_map(|object| object.shape.primitives())
    }

    /// An acceleration structure over [`Scene::primitives`] for ray queries, with the scene's tier or the default one.
    /// Coordinates are those of the scene. Every triangle of a placed mesh is stored, so scenes with many places take
    /// more memory than to render. Mirrored meshes have their outside as they are seen ([`Bvh::set_clockwise`]).
    ///
    /// # Errors
    /// [`NotFinite::Primitive`] for coordinates and radii that are not finite in f32.
    pub fn bvh(&self) -> Result<Bvh, NotFinite> {
        self.bvh_with(Preset::default(), self.picture.numerics())
    }

    /// [`Scene::bvh`] with a preset and a tier.
    ///
    /// # Errors
    /// As [`Scene::bvh`].
    pub fn bvh_with(&self, preset: Preset, numerics: Numerics) -> Result<Bvh, NotFinite> {
        let mut bvh = Bvh::with(self.primitives(), preset, numerics)?;
        let shapes = self.objects.iter().map(|object| &object.shape);
        bvh.set_clockwise(shapes.map(|shape| (shape.primitive_count(), shape.is_mirrored())));
        Ok(bvh)
    }

    /// The object that a primitive belongs to, as an index into [`Scene::objects`], and the primitive's index in it;
    /// `None` if there is no such primitive. Takes time in proportion to the number of objects.
    pub fn object_of(&self, prim: PrimId) -> Option<(usize, usize)> {
        let mut index = prim.0 as usize;
        for (object, count) in self.objects.iter().map(|object| object.shape.primitive_count()).enumerate() {
            if index < count {
                return Some((object, index));
            }
            index -= count;
        }
        None
    }

    /// Whether an object emits light.
    pub fn emits(&self) -> bool {
        self.objects.iter().any(|object| self.materials[object.material.0 as usize].emits())
    }

    /// Bounding box of what can be seen: analytic shapes, and triangles with an area, not stray vertices. `None` if
    /// nothing can.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(&PointTrees::of(&self.objects), &self.objects)
    }

    /// Calls `each` with the corners of every triangle that can be seen, counterclockwise seen from the front, in the
    /// order of the scene.
    pub(crate) fn for_each_triangle(&self, mut each: impl FnMut([DVec3; 3])) {
        for Object { shape, .. } in &self.objects {
            let is_mirrored = shape.is_mirrored();
            for primitive in shape.primitives().filter(can_be_seen) {
                if let Primitive::Triangle(Triangle([a, b, c])) = primitive {
                    each(if is_mirrored { [a, c, b] } else { [a, b, c] });
                }
            }
        }
    }

    /// Replaces every placed mesh for which `is_baked` holds by a mesh with its own transformed triangles.
    pub fn bake(&mut self, is_baked: impl Fn(&Placed) -> bool) {
        for object in &mut self.objects {
            if let Shape::Placed(placed) = &object.shape
                && is_baked(placed)
            {
                object.shape = Shape::Mesh(placed.bake());
            }
        }
    }
}

/// Bounding box of what can be seen of objects among those of `trees`; `None` if nothing can.
pub(crate) fn bounds(trees: &PointTrees, objects: &[Object]) -> Option<(DVec3, DVec3)> {
    let side = |axis: usize, sign: f64| AffineFunction {
        of_sphere: Box::new(move |centre, radius| sign * centre[axis] + radius),
        gradient: DVec3::AXES[axis] * sign,
        weight: DVec3::AXES[axis],
        offset: DVec3::ZERO,
    };
    let functions: [_; 6] = std::array::from_fn(|i| side(i % 3, [1.0, -1.0][i / 3]));
    let [x, y, z, u, v, w] = support::maxima(trees, objects, &functions);
    let (max, min) = (DVec3::new(x, y, z), DVec3::new(u, v, w));
    // Not -0.
    (max.x > f64::NEG_INFINITY).then_some((DVec3::ZERO - min, max))
}

/// A triangle as a primitive.
fn triangle(corners: [DVec3; 3]) -> Primitive {
    Primitive::Triangle(Triangle(corners))
}

impl Shape {
    /// Number of primitives: one for an analytic shape, the triangle count for a mesh.
    pub fn primitive_count(&self) -> usize {
        match self {
            Shape::Analytic(_) => 1,
            Shape::Mesh(mesh) => mesh.triangles.len(),
            Shape::Placed(placed) => placed.triangle_count(),
        }
    }

    /// The primitives in order, with instances placed.
    pub fn primitives(&self) -> Box<dyn Iterator<Item = Primitive> + '_> {
        match self {
            Shape::Analytic(shape) => Box::new(std::iter::once(Primitive::Analytic(*shape))),
            Shape::Mesh(mesh) => {
                Box::new(mesh.triangles.iter().map(move |t| triangle(t.map(|i| mesh.positions[i as usize]))))
            }
            Shape::Placed(placed) => {
                Box::new((0..placed.triangle_count() as u32).map(move |t| triangle(placed.corners_of(t))))
            }
        }
    }

    /// Whether triangles are seen clockwise from the front.
    pub fn is_mirrored(&self) -> bool {
        match self {
            Shape::Analytic(_) => false,
            Shape::Mesh(mesh) => mesh.is_mirrored,
            Shape::Placed(placed) => placed.is_mirrored(),
        }
    }

    /// The mesh, if any; for an instance the shared mesh before its placement is applied.
    pub fn mesh(&self) -> Option<&Mesh> {
        match self {
            Shape::Analytic(_) => None,
            Shape::Mesh(mesh) => Some(mesh),
            Shape::Placed(placed) => Some(&placed.mesh),
        }
    }
}
