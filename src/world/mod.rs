//! The prepared scene: *how* things are, ready to be rendered.
//!
//! [`World::prepare`] turns a [`Scene`] into this once: every primitive in one acceleration structure, attributes
//! flattened, colours lowered to the numbers of the colour pipeline, defaults decided. It is immutable and shared by all
//! threads. It knows nothing of effects or of how rays are scheduled.

mod fit;
mod lower;
mod range;
mod surface;
mod view;

pub use fit::{StandardView, fitted_camera, headlight};
pub use lower::{Image, LoweredMaterial, LoweredTexture, MetallicRoughnessValues, PhongValues};
pub use range::{Range, bring_into_range};
pub use surface::Surface;
pub use view::View;

use glam::DVec3;

use crate::bvh::{self, Accelerator, BruteForce, Preset, Primitive, Slot};
use crate::film::ColourPipeline;
use crate::geometry::{PrimId, Sphere, Triangle};
use crate::scene::{LightKind, Scene, Shape};

/// The ambient intensity where no input gives one.
pub const DEFAULT_AMBIENT: f64 = 0.25;

/// How rays find what they hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Structure {
    /// obvhs's binary tree, built with a preset.
    Tree(Preset),
    /// No structure: every primitive is tested.
    BruteForce,
}

impl Default for Structure {
    fn default() -> Self {
        Structure::Tree(Preset::default())
    }
}

/// A scene that is ready to be rendered.
pub struct World {
    /// What answers rays.
    pub accelerator: Box<dyn Accelerator>,
    /// The objects, in the order of the description.
    pub objects: Vec<WorldObject>,
    /// The materials.
    pub materials: Vec<LoweredMaterial>,
    /// The pictures that textures read.
    pub images: Vec<Image>,
    /// The lights.
    pub lights: Vec<WorldLight>,
    /// The numbers that light is added up in.
    pub pipeline: ColourPipeline,
    /// Intensity of the ambient light.
    pub ambient: f64,
    /// What a ray that hits nothing sees.
    pub background: DVec3,
    /// Triangles left out because their corners lie on one line once they are rounded to f32.
    pub too_small: usize,
    /// The object that each primitive belongs to.
    object_of: Vec<u32>,
}

/// An object of the world.
pub struct WorldObject {
    /// Its name.
    pub name: String,
    /// Which of the inputs it came from.
    pub input: usize,
    /// Index of its material.
    pub material: u32,
    /// The first of its primitives.
    pub first: PrimId,
    /// What is interpolated across its triangles.
    pub(crate) attributes: lower::Attributes,
}

/// A light with its colour in the numbers of the pipeline.
#[derive(Debug, Clone)]
pub struct WorldLight {
    /// Its name.
    pub name: String,
    /// Colour times intensity.
    pub radiance: DVec3,
    /// Where it shines from and how it spreads.
    pub kind: LightKind,
}

impl World {
    /// Prepares a scene for rendering in `pipeline`.
    pub fn prepare(scene: Scene, pipeline: ColourPipeline, structure: Structure) -> World {
        let count = scene.primitive_count();
        let mut slots = Vec::with_capacity(count);
        let mut object_of = Vec::with_capacity(count);
        let mut objects = Vec::with_capacity(scene.objects.len());
        for object in scene.objects {
            let first = PrimId(object_of.len() as u32);
            push_primitives(&object.shape, first, &mut slots);
            object_of.resize(object_of.len() + object.shape.primitive_count(), objects.len() as u32);
            objects.push(WorldObject {
                name: object.name,
                input: object.input,
                material: object.material.0,
                first,
                attributes: lower::attributes(object.shape),
            });
        }
        let too_small = object_of.len() - slots.len();
        let accelerator: Box<dyn Accelerator> = match structure {
            Structure::Tree(preset) => Box::new(bvh::build(&slots, preset)),
            Structure::BruteForce => Box::new(BruteForce::new(slots)),
        };
        World {
            accelerator,
            objects,
            materials: scene.materials.iter().map(|m| lower::material(m, pipeline)).collect(),
            images: scene.images.into_iter().map(|image| Image::new(image, pipeline)).collect(),
            lights: scene
                .lights
                .into_iter()
                .map(|light| WorldLight {
                    name: light.name,
                    radiance: light.colour.lower(pipeline) * light.intensity,
                    kind: light.kind,
                })
                .collect(),
            pipeline,
            ambient: scene.ambient.unwrap_or(DEFAULT_AMBIENT),
            background: scene.background.unwrap_or(fit::BACKGROUND).lower(pipeline),
            too_small,
            object_of,
        }
    }

    /// The index of the object that a primitive belongs to.
    pub fn object_of(&self, prim: PrimId) -> u32 {
        self.object_of[prim.0 as usize]
    }

    /// How many primitives there are.
    pub fn primitive_count(&self) -> usize {
        self.object_of.len()
    }
}

/// Adds the primitives of a shape in f32, numbered from `first`. A triangle whose corners lie on one line in f32 has its
/// number but no slot: no ray can hit it, and it has no normal.
fn push_primitives(shape: &Shape, first: PrimId, slots: &mut Vec<Slot>) {
    match shape {
        Shape::Sphere { centre, radius } => {
            let sphere = Sphere { centre: *centre, radius: *radius };
            slots.push(Slot { primitive: Primitive::Sphere(sphere), id: first });
        }
        Shape::Mesh(mesh) => {
            for (id, triangle) in (first.0..).zip(&mesh.triangles) {
                let triangle = Triangle(triangle.map(|i| mesh.positions[i as usize].as_vec3()));
                if triangle.normal() != DVec3::ZERO {
                    slots.push(Slot { primitive: Primitive::Triangle(triangle), id: PrimId(id) });
                }
            }
        }
    }
}
