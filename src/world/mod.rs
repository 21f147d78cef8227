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

use crate::bvh::{self, Accelerator, Instance, MeshSpace, Primitive, Slot, Structure};
use crate::film::ColourPipeline;
use crate::geometry::{Numerics, Precision, PrimId, Sphere, Triangle};
use crate::scene::{Light, LightKind, Mesh, Object, Placed, Sampling, Scene, Shape, Thin};

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
    /// How often and where pixels are sampled.
    pub sampling: Sampling,
    /// Primitives left out because the tier's numbers cannot hold them: triangles whose corners, rounded, lie on one line,
    /// spheres of no size.
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
    pub fn prepare(
        scene: Scene,
        pipeline: ColourPipeline,
        structure: Structure,
        numerics: Numerics,
    ) -> World {
        let images = scene.images.iter().map(|image| Image::new(image.clone(), pipeline)).collect();
        World::with_images(scene, images, pipeline, structure, numerics)
    }

    /// [`World::prepare`] for a scene that has this world's pictures, which are shared.
    pub fn prepare_another(&self, scene: Scene, structure: Structure) -> World {
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
        structure: Structure,
        numerics: Numerics,
    ) -> World {
        let Parts { instances, shared, firsts, too_thin } = instances(&scene.objects, structure, numerics);
        let mut kept = 0;
        let slots = slots(&scene.objects, &firsts, &shared, numerics).inspect(|_| kept += 1);
        let of_instances: usize = instances.iter().map(|i| i.placed.triangle_count()).sum();
        let accelerator = bvh::build_with_instances(slots, instances, structure, numerics);
        let primitive_count = scene.primitive_count();
        let too_small = primitive_count - of_instances - kept + too_thin;
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
            sampling: scene.sampling,
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
    /// How many triangles of instances the tier's numbers cannot hold.
    too_thin: usize,
}

/// Finds the objects that share their mesh with others, where the structure has a place for them.
fn instances(objects: &[Object], structure: Structure, numerics: Numerics) -> Parts {
    let mut parts = Parts { instances: Vec::new(), shared: Vec::new(), firsts: Vec::new(), too_thin: 0 };
    let mut meshes: HashMap<*const Mesh, (Thin, Option<MeshSpace>)> = HashMap::new();
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
        let look = || (Thin::of(mesh), MeshSpace::of(mesh));
        let (thin, space) = meshes.entry(Arc::as_ptr(mesh)).or_insert_with(look);
        let fits = space.is_some_and(|space| bvh::can_be_instance(placed, &space, numerics));
        parts.shared.push(fits);
        if !fits {
            continue;
        }
        parts.too_thin += too_thin(placed, thin, numerics);
        let first = *parts.firsts.last().expect("the object's own");
        parts.instances.push(Instance { placed: placed.clone(), first });
    }
    parts
}

/// How many triangles of a placed mesh have corners that, rounded to the tier's numbers, lie on one line.
///
/// A corner moves by what placing it rounds and by half a step of the tier's numbers, so a height changes by no more than
/// twice that; on three axes, less than four times the largest.
fn too_thin(placed: &Placed, thin: &Thin, numerics: Numerics) -> usize {
    let moved = placed.placement.error(thin.reach())
        + placed.placement.reach(thin.reach()) * numerics.precision().epsilon()
        + f64::from(f32::MIN_POSITIVE);
    let is_lost = |&triangle: &u32| {
        placed.left_out.binary_search(&triangle).is_err()
            && lowered(placed.corners_of(triangle), numerics).is_none()
    };
    thin.below(4.0 * moved.max_element(), &placed.placement.as_one().0).filter(is_lost).count()
}

/// A triangle in the numbers of a tier; `None` where these cannot hold it.
fn lowered(corners: [DVec3; 3], numerics: Numerics) -> Option<Primitive> {
    let triangle = Triangle(corners.map(|p| p.map(|c| numerics.precision().round(c))));
    (!triangle.is_degenerate()).then_some(Primitive::Triangle(triangle))
}

/// The primitives of all objects but the shared ones. Those that the tier's numbers cannot hold have their number but no
/// slot: no ray can hit them.
fn slots(
    objects: &[Object],
    firsts: &[PrimId],
    shared: &[bool],
    numerics: Numerics,
) -> impl Iterator<Item = Slot> {
    let own = objects.iter().zip(firsts).zip(shared).filter(|(_, shared)| !**shared);
    own.flat_map(move |((object, first), _)| {
        let primitives: Box<dyn Iterator<Item = Option<Primitive>> + '_> = match &object.shape {
            Shape::Mesh(mesh) => Box::new(
                mesh.triangles.iter().map(move |t| lowered(t.map(|i| mesh.positions[i as usize]), numerics)),
            ),
            Shape::Placed(placed) => {
                Box::new(placed.triangles().map(move |t| lowered(placed.corners_of(t), numerics)))
            }
            Shape::Sphere { centre, radius } => {
                let centre = centre.map(|c| Precision::Double.round(c));
                let sphere = Primitive::Sphere(Sphere { centre, radius: *radius });
                Box::new(std::iter::once((numerics.precision().round(*radius) > 0.0).then_some(sphere)))
            }
        };
        (first.0..)
            .zip(primitives)
            .filter_map(|(id, primitive)| Some(Slot { primitive: primitive?, id: PrimId(id) }))
    })
}
