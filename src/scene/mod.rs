//! The description: *what* there is, as plain data in double precision.
//!
//! A scene file, an OBJ and a glTF all become this. It has no acceleration and no cleverness, and knows nothing of how
//! it will be rendered. Conventions: right-handed, +y up, no physical unit, column vectors; transforms are named
//! `b_from_a`; angles are in radians here (degrees in files). Primitives are numbered in the order of the description:
//! objects as written, triangles as listed.

pub mod animation;
mod camera;
mod camera_text;
mod colour_value;
mod effects;
pub mod extreme;
pub mod file;
mod fingerprint;
mod material;
mod sampler;
mod sampling;

pub use crate::geometry::{Attribute, Mesh, Numerics, Placed, Placement, Step, moved_tangent, normal_matrix};
pub use animation::Animation;
pub use camera::{Camera, Projection, usual_size};
pub use camera_text::INLINE_NAME;
pub use fingerprint::Fingerprint;
pub use material::{Glaze, Material, MetallicRoughness, NormalMap, Phong, Texture, TextureImage};
pub use sampler::{Filter, Lookup, Minify, Sampler, TextureFilter, Wrap};
pub use sampling::{MOST_SAMPLES, Sampling};

use extreme::Measure;

use crate::film::{Colour, ColourPipeline};
use glam::DVec3;

/// Index of a material in [`Scene::materials`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// Index of a picture in [`Scene::images`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ImageId(pub u32);

/// Everything there is to render. What is `None` was not said by any input and takes its default when the scene is
/// prepared.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
    /// What a ray that hits nothing sees.
    pub background: Option<Colour>,
    /// The numbers that light is added up in.
    pub colour: Option<ColourPipeline>,
    /// How exactly it is decided what a ray hits.
    pub numerics: Option<Numerics>,
    /// How often and where pixels are sampled.
    pub sampling: Sampling,
    /// Intensity of the ambient light, per unit of a material's ambient coefficient.
    pub ambient: Option<f64>,
    /// Named cameras; the first is the default.
    pub cameras: Vec<Camera>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Materials, referred to by [`MaterialId`].
    pub materials: Vec<Material>,
    /// Pictures that textures read, referred to by [`ImageId`].
    pub images: Vec<TextureImage>,
    /// Spheres and meshes.
    pub objects: Vec<Object>,
    /// The files that it was read from, in order; [`Object::input`] is an index of them.
    pub inputs: Vec<std::path::PathBuf>,
    /// Effects that the scene turns on or off against what its contents imply.
    pub effects: file::EffectsSection,
    /// What moves.
    pub animation: Option<Animation>,
}

/// A thing in the scene: a shape and what it is made of.
#[derive(Debug, Clone)]
pub struct Object {
    /// The name its file gave it, or one made from its place there.
    pub name: String,
    /// Which of the inputs it came from, counted from 0.
    pub input: usize,
    /// What it is made of.
    pub material: MaterialId,
    /// What it looks like.
    pub shape: Shape,
}

/// The shapes kiln knows.
#[derive(Debug, Clone)]
// Objects are few beside their triangles, so the unused bytes of small variants do not matter.
#[allow(clippy::large_enum_variant)]
pub enum Shape {
    /// An analytic sphere.
    Sphere {
        /// Its centre.
        centre: DVec3,
        /// Its radius, positive.
        radius: f64,
    },
    /// Triangles that share vertices.
    Mesh(Mesh),
    /// One of the places of a mesh that stands in many.
    Placed(Placed),
}

/// A light.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The name its file gave it, or one made from its place there.
    pub name: String,
    /// Its colour, multiplied by the intensity.
    pub colour: Colour,
    /// Its strength: a white, fully diffuse surface that faces a light of intensity 1 shows its own colour.
    pub intensity: f64,
    /// Where it shines from and how it spreads.
    pub kind: LightKind,
}

/// Where a light shines from and how it spreads.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// From a point, in all directions.
    Point {
        /// Where it is.
        position: DVec3,
        /// How it weakens with distance.
        falloff: Falloff,
    },
    /// From infinitely far away.
    Directional {
        /// The direction the light travels in, of length 1.
        direction: DVec3,
    },
    /// From a point, in a cone.
    Spot {
        /// Where it is.
        position: DVec3,
        /// The axis of the cone, of length 1.
        direction: DVec3,
        /// How it weakens with distance.
        falloff: Falloff,
        /// Half the opening angle within which it is at full strength, in radians.
        inner_angle: f64,
        /// Half the opening angle beyond which there is nothing, in radians.
        outer_angle: f64,
    },
}

/// How a light weakens with distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Falloff {
    /// Not at all: the assignment's light.
    None,
    /// With the square of the distance, and smoothly to nothing at `range` where there is one
    /// (glTF, KHR_lights_punctual).
    InverseSquare {
        /// The distance at which it ends.
        range: Option<f64>,
    },
}

impl Scene {
    /// Adds a material and returns what to call it by.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId((self.materials.len() - 1) as u32)
    }

    /// Adds a picture and returns what to call it by.
    pub fn add_image(&mut self, image: TextureImage) -> ImageId {
        self.images.push(image);
        ImageId((self.images.len() - 1) as u32)
    }

    /// Adds another scene, except its `inputs`. Where both set a property of the whole picture, this one's is kept.
    pub fn append(&mut self, other: Scene) {
        // All fields by name: the compiler reports a new one that is not merged.
        let Scene {
            size,
            background,
            colour,
            numerics,
            sampling,
            ambient,
            cameras,
            lights,
            materials,
            images,
            objects,
            inputs: _,
            effects,
            animation,
        } = other;
        let (first_material, first_image) = (self.materials.len() as u32, self.images.len() as u32);
        self.size = self.size.or(size);
        self.background = self.background.or(background);
        self.colour = self.colour.or(colour);
        self.numerics = self.numerics.or(numerics);
        self.sampling = self.sampling.or(sampling);
        self.ambient = self.ambient.or(ambient);
        self.cameras.extend(cameras);
        self.lights.extend(lights);
        self.effects = std::mem::take(&mut self.effects).or(effects);
        self.animation = self.animation.take().or(animation);
        self.images.extend(images);
        self.materials.extend(materials.into_iter().map(|mut material| {
            for texture in material.textures_mut() {
                texture.image.0 += first_image;
            }
            material
        }));
        self.objects.extend(objects.into_iter().map(|mut object| {
            object.material.0 += first_material;
            object
        }));
    }

    /// How many primitives the scene has: spheres and triangles.
    pub fn primitive_count(&self) -> usize {
        self.objects.iter().map(|object| object.shape.primitive_count()).sum()
    }

    /// The smallest box that holds everything, or `None` for an empty scene.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let value = |axis: usize, sign: f64| move |p: DVec3| sign * p[axis];
        let of_sphere =
            |axis: usize, sign: f64| move |centre: DVec3, radius: f64| sign * (centre[axis] + sign * radius);
        let sides = [0, 1, 2].map(|axis| [1.0, -1.0].map(|sign| (axis, sign)));
        let functions = sides.as_flattened().iter().map(|&(axis, sign)| {
            let weight = DVec3::AXES[axis];
            (value(axis, sign), of_sphere(axis, sign), weight * sign, weight)
        });
        let functions: Vec<_> = functions.collect();
        let measures: Vec<Measure> = functions
            .iter()
            .map(|(value, of_sphere, gradient, weight)| Measure {
                value,
                of_sphere,
                gradient: *gradient,
                weight: *weight,
                offset: DVec3::ZERO,
            })
            .collect();
        let far = extreme::greatest(&self.objects, &measures);
        let [max, min] = [0, 1].map(|k| DVec3::new(far[k], far[2 + k], far[4 + k]));
        (max.x > f64::NEG_INFINITY).then_some((-min, max))
    }

    /// Gives every placed mesh for which `is_baked` says so triangles of its own.
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

impl Shape {
    /// How many primitives the shape has: one for a sphere, its triangles for a mesh.
    pub fn primitive_count(&self) -> usize {
        match self {
            Shape::Sphere { .. } => 1,
            Shape::Mesh(mesh) => mesh.triangles.len(),
            Shape::Placed(placed) => placed.triangle_count(),
        }
    }

    /// Its mesh where it has one, not yet in its place where it is shared.
    pub fn mesh(&self) -> Option<&Mesh> {
        match self {
            Shape::Sphere { .. } => None,
            Shape::Mesh(mesh) => Some(mesh),
            Shape::Placed(placed) => Some(&placed.mesh),
        }
    }
}
