//! The prepared scene: *how* things are, ready to be rendered.
//!
//! [`World::prepare`] turns a [`Scene`] into this once: every primitive in one acceleration structure, attributes
//! flattened, colours lowered to the numbers of the colour pipeline, defaults decided. It is immutable and shared by all
//! threads. It knows nothing of effects or of how rays are scheduled.

mod fit;
mod lanes;
mod lower;
mod range;
mod surface;
mod surfaces;
mod view;

pub use fit::{StandardView, fitted_camera, headlight};
pub use lanes::{LANES, Lanes, RayLanes, widely};
pub use lower::{Image, LoweredMaterial, LoweredTexture, MetallicRoughnessValues, PhongValues};
pub use range::{Range, bring_into_range};
pub use surface::Surface;
pub use surfaces::Surfaces;
pub use view::View;

use glam::DVec3;

use crate::bvh::{self, Accelerator, Primitive, Slot, Structure};
use crate::film::ColourPipeline;
use crate::geometry::{Numerics, Precision, PrimId, Sphere, Triangle};
use crate::scene::{LightKind, Object, Scene, Shape};

/// The ambient intensity where no input gives one.
pub const DEFAULT_AMBIENT: f64 = 0.25;

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
    /// Primitives left out because the tier's numbers cannot hold them: triangles whose corners, rounded, lie on one line,
    /// spheres of no size.
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

impl WorldObject {
    /// Whether it has normals of its own to be shaded by.
    pub fn is_smooth(&self) -> bool {
        self.attributes.normals.is_some()
    }
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
    /// Prepares a scene for rendering in `pipeline`, its geometry in the numbers of `numerics`.
    pub fn prepare(
        scene: Scene,
        pipeline: ColourPipeline,
        structure: Structure,
        numerics: Numerics,
    ) -> World {
        let mut kept = 0;
        let slots = slots(&scene.objects, numerics).inspect(|_| kept += 1);
        let accelerator = bvh::build(slots, structure, numerics);
        let mut object_of = Vec::with_capacity(scene.primitive_count());
        let mut objects = Vec::with_capacity(scene.objects.len());
        for object in scene.objects {
            let first = PrimId(object_of.len() as u32);
            object_of.resize(object_of.len() + object.shape.primitive_count(), objects.len() as u32);
            objects.push(WorldObject {
                name: object.name,
                input: object.input,
                material: object.material.0,
                first,
                attributes: lower::attributes(object.shape),
            });
        }
        let too_small = object_of.len() - kept;
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

    /// How exactly it is decided what a ray hits.
    pub fn numerics(&self) -> Numerics {
        self.accelerator.numerics()
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

/// The primitives of all objects, numbered in order. Those that the tier's numbers cannot hold have their number but no
/// slot: no ray can hit them.
fn slots(objects: &[Object], numerics: Numerics) -> impl Iterator<Item = Slot> + '_ {
    let round = move |p: DVec3| p.map(|c| numerics.precision().round(c));
    let triangle = move |corners: [DVec3; 3]| {
        let triangle = Triangle(corners.map(round));
        (!triangle.is_degenerate()).then_some(Primitive::Triangle(triangle))
    };
    let sphere = move |centre: DVec3, radius: f64| {
        let sphere = Sphere { centre: centre.map(|c| Precision::Double.round(c)), radius };
        (numerics.precision().round(radius) > 0.0).then_some(Primitive::Sphere(sphere))
    };
    let primitives = objects.iter().flat_map(move |object| {
        let (mesh, ball) = match &object.shape {
            Shape::Mesh(mesh) => (Some(mesh), None),
            Shape::Sphere { centre, radius } => (None, Some(sphere(*centre, *radius))),
        };
        let of_mesh = mesh.into_iter().flat_map(move |mesh| {
            mesh.triangles.iter().map(move |t| triangle(t.map(|i| mesh.positions[i as usize])))
        });
        of_mesh.chain(ball)
    });
    (0..).zip(primitives).filter_map(|(id, primitive)| Some(Slot { primitive: primitive?, id: PrimId(id) }))
}
