//! The prepared scene: *how* things are, ready to be rendered.
//!
//! [`World::prepare`] turns a [`Scene`] into this once: every primitive in one acceleration structure, attributes
//! flattened, colours lowered to the numbers of the colour pipeline, defaults decided. It is immutable and shared by all
//! threads. It knows nothing of effects or of how rays are scheduled.

mod differential;
mod fit;
mod image;
mod lanes;
mod lower;
mod pyramid;
mod range;
mod surface;
mod surfaces;
mod view;

pub use differential::{Differential, TexturePoint};
pub use fit::{StandardView, fitted_camera, headlight, turntable_camera};
pub use image::{Image, Meaning};
pub use lanes::{LANES, Lanes, RayLanes, widely};
pub use lower::{LoweredMaterial, LoweredNormalMap, LoweredTexture, MetallicRoughnessValues, PhongValues};
pub use pyramid::{Level as PyramidLevel, Pyramid};
pub use range::{Range, bring_into_range};
pub use surface::{Surface, Texels};
pub use surfaces::Surfaces;
pub use view::{View, basis};

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use crate::bvh::{self, Accelerator, Instance, Layout, MeshSpace, Primitive, Slot};
use crate::film::ColourPipeline;
use crate::geometry::{Numerics, PrimId, Sphere, Triangle};
use crate::scene::{Light, LightKind, Mesh, Object, Scene, Shape};

/// The ambient intensity where no input gives one.
pub const DEFAULT_AMBIENT: f64 = 0.25;

/// A scene that is ready to be rendered. A copy shares what is large.
#[derive(Clone)]
pub struct World {
    /// What answers rays.
    pub accelerator: Arc<dyn Accelerator>,
    /// The objects, in the order of the description.
    pub objects: Arc<[WorldObject]>,
    /// The materials.
    pub materials: Vec<LoweredMaterial>,
    /// Their names.
    pub material_names: Vec<String>,
    /// The pictures that textures read.
    pub images: Arc<[Image]>,
    /// The lights.
    pub lights: Vec<WorldLight>,
    /// The numbers that light is added up in.
    pub pipeline: ColourPipeline,
    /// Intensity of the ambient light.
    pub ambient: f64,
    /// What a ray that hits nothing sees.
    pub background: DVec3,
    /// Spheres left out because their radius rounds to 0 in the tier's numbers.
    pub too_small: usize,
    primitive_count: usize,
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
    /// Whether it has tangents, for a normal map of its material.
    pub fn has_tangents(&self) -> bool {
        self.attributes.has_tangents()
    }

    /// Whether it has normals of its own to be shaded by.
    pub fn is_smooth(&self) -> bool {
        self.attributes.is_smooth()
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
    pub fn prepare(scene: Scene, pipeline: ColourPipeline, structure: Layout, numerics: Numerics) -> World {
        let images = scene.images.iter().map(|image| Image::new(image.clone(), pipeline)).collect();
        World::with_images(scene, images, pipeline, structure, numerics)
    }

    /// [`World::prepare`] for a scene that has this world's pictures, which are shared.
    pub fn prepare_another(&self, scene: Scene, structure: Layout) -> World {
        World::with_images(scene, self.images.clone(), self.pipeline, structure, self.numerics())
    }

    /// This world under other lights.
    pub fn under(&self, lights: Vec<Light>) -> World {
        World { lights: world_lights(lights, self.pipeline), ..self.clone() }
    }

    fn with_images(
        scene: Scene,
        images: Arc<[Image]>,
        pipeline: ColourPipeline,
        structure: Layout,
        numerics: Numerics,
    ) -> World {
        let Parts { instances, shared, firsts } = instances(&scene.objects, structure, numerics);
        let mut kept = 0;
        let slots = slots(&scene.objects, &firsts, &shared, numerics).inspect(|_| kept += 1);
        let of_instances: usize = instances.iter().map(|i| i.placed.triangle_count()).sum();
        let accelerator = bvh::build_with_instances(slots, instances, structure, numerics);
        let primitive_count = scene.primitive_count();
        let too_small = primitive_count - of_instances - kept;
        let mut lowered = lower::Shared::default();
        let objects = scene.objects.into_iter().zip(firsts).map(|(object, first)| WorldObject {
            name: object.name,
            input: object.input,
            material: object.material.0,
            first,
            attributes: lowered
                .attributes(object.shape, scene.materials[object.material.0 as usize].normal_map().is_some()),
        });
        let objects = objects.collect();
        World {
            accelerator: accelerator.into(),
            objects,
            materials: scene.materials.iter().map(|m| lower::material(m, pipeline)).collect(),
            material_names: scene.materials.iter().map(|m| m.name().to_owned()).collect(),
            images,
            lights: world_lights(scene.lights, pipeline),
            pipeline,
            ambient: scene.ambient.unwrap_or(DEFAULT_AMBIENT),
            background: scene.background.unwrap_or(fit::BACKGROUND).lower(pipeline),
            too_small,
            primitive_count,
        }
    }

    /// How exactly it is decided what a ray hits.
    pub fn numerics(&self) -> Numerics {
        self.accelerator.numerics()
    }

    /// The materials that objects are made of, with their names.
    pub fn materials_in_use(&self) -> impl Iterator<Item = (&str, &LoweredMaterial)> {
        let mut used = vec![false; self.materials.len()];
        self.objects.iter().for_each(|object| used[object.material as usize] = true);
        let all = self.material_names.iter().zip(&self.materials).zip(used);
        all.filter(|(_, used)| *used).map(|((name, material), _)| (name.as_str(), material))
    }

    /// The index of the object that a primitive belongs to.
    pub fn object_of(&self, prim: PrimId) -> u32 {
        // Of those that begin at the same number all but the last are empty.
        (self.objects.partition_point(|object| object.first <= prim) - 1) as u32
    }

    /// How many primitives there are.
    pub fn primitive_count(&self) -> usize {
        self.primitive_count
    }
}

/// Lights in the numbers of the pipeline. Those that give no light are none to anyone.
fn world_lights(lights: Vec<Light>, pipeline: ColourPipeline) -> Vec<WorldLight> {
    let lights = lights.into_iter().map(|light| WorldLight {
        name: light.name,
        radiance: light.colour.lower(pipeline) * light.intensity,
        kind: light.kind,
    });
    lights.filter(|light| light.radiance != DVec3::ZERO).collect()
}

/// Objects, and how they are kept.
struct Parts {
    /// Those that share their mesh.
    instances: Vec<Instance>,
    /// For each object, whether it is among them.
    shared: Vec<bool>,
    /// The number of its first primitive.
    firsts: Vec<PrimId>,
}

/// Finds the objects that share their mesh with others, where the structure has a place for them.
fn instances(objects: &[Object], structure: Layout, numerics: Numerics) -> Parts {
    let mut parts = Parts { instances: Vec::new(), shared: Vec::new(), firsts: Vec::new() };
    let mut meshes: HashMap<*const Mesh, Option<MeshSpace>> = HashMap::new();
    let mut first = 0;
    for object in objects {
        parts.firsts.push(PrimId(first as u32));
        first += object.shape.primitive_count();
        let placed = match &object.shape {
            Shape::Placed(placed) if structure.preset().is_some() => placed,
            _ => {
                parts.shared.push(false);
                continue;
            }
        };
        let mesh = &placed.mesh;
        let space = meshes.entry(Arc::as_ptr(mesh)).or_insert_with(|| MeshSpace::of(mesh));
        let fits = space.is_some_and(|space| bvh::can_be_instance(placed, &space, numerics));
        parts.shared.push(fits);
        if !fits {
            continue;
        }
        let first = *parts.firsts.last().expect("the object's own");
        parts.instances.push(Instance { placed: placed.clone(), first });
    }
    parts
}

/// The primitives of all objects but the shared ones, in the numbers of the tier. Spheres whose radius rounds to 0 have their number but
/// no slot.
fn slots(
    objects: &[Object],
    firsts: &[PrimId],
    shared: &[bool],
    numerics: Numerics,
) -> impl Iterator<Item = Slot> {
    let own = objects.iter().zip(firsts).zip(shared).filter(|(_, shared)| !**shared);
    own.flat_map(move |((object, first), _)| {
        let triangle = |corners| Primitive::Triangle(Triangle(corners));
        let primitives: Box<dyn Iterator<Item = Primitive> + '_> = match &object.shape {
            Shape::Mesh(mesh) => {
                Box::new(mesh.triangles.iter().map(move |t| triangle(t.map(|i| mesh.positions[i as usize]))))
            }
            Shape::Placed(placed) => {
                Box::new((0..placed.triangle_count() as u32).map(move |t| triangle(placed.corners_of(t))))
            }
            Shape::Sphere { centre, radius } => {
                Box::new(std::iter::once(Primitive::Sphere(Sphere { centre: *centre, radius: *radius })))
            }
        };
        let precision = numerics.precision();
        (first.0..).zip(primitives).filter_map(move |(id, primitive)| {
            Some(Slot { primitive: primitive.rounded(precision)?, id: PrimId(id) })
        })
    })
}
