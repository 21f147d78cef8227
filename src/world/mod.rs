//! The prepared scene.
//!
//! [`World::prepare`] makes it once from a [`Scene`]: all primitives in one acceleration structure, attributes in flat arrays,
//! colours in the numbers of the colour pipeline, defaults filled in. It is immutable and shared by all threads. Effects and
//! scheduling belong to the modules above.

mod area_lights;
mod attributes;
mod bilinear_distribution;
mod differential;
mod directional;
mod emission_texture;
mod emitters;
mod environment;
mod fill;
mod fit;
mod ground;
mod guide;
mod hit_order;
mod image;
mod interaction;
mod interactions;
mod lens;
mod light_tree;
mod mip_map;
mod recenter;
mod rectangle;
mod sampled_triangle;
mod shape_sampling;
mod sky;
mod soa;
mod texels;
mod touched;
mod turns;
mod view;
mod volumes;

pub(crate) use bilinear_distribution::Cell as EnvironmentCell;
pub use differential::{Differential, TexturePoint};
use environment::PreparedEnvironment;
pub(crate) use environment::{UNIFORM_DENSITY, uniform_direction};

pub(crate) use crate::film::simd::simd;
pub use crate::film::simd::simd_dispatch;
pub(crate) use area_lights::{AreaLights, has_radiance};
pub(crate) use directional::LightDisc;
pub(crate) use emitters::{EmitterSample, Emitters, sampled_emission};
pub(crate) use fill::PreparedFill;
pub use fit::{Framing, StandardView, fitted_camera, fitted_to_poses, headlight, turntable_camera};
pub(crate) use fit::{KEY_IRRADIANCE, key_light, opening};
pub use hit_order::HitOrder;
pub use image::Image;
pub use interaction::SurfaceInteraction;
pub use interactions::InteractionSoa;
pub use lens::ThinLens;
pub(crate) use light_tree::LightGroups;
pub use mip_map::{MipLevel, MipMap};
pub use recenter::{Recentering, recenter};
pub(crate) use sampled_triangle::{TriangleSample, TwoTriangles};
pub(crate) use soa::select;
pub use soa::{Flags, PerRay, RAYS_PER_BATCH, Vec3Soa};
pub use texels::Texels;
pub(crate) use turns::sin_cos_of_turns;
pub use view::{View, basis};
pub(crate) use volumes::Volumes;

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use crate::bvh::detail::{Accelerator, Instance, Layout, MeshSpace, Slot};
use crate::bvh::{self, Numerics, PrimId};
use crate::error::printable;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{
    AddedLight, DefaultLook, Environment, Fill, Ground, Light, LightKind, Material, MaterialId, Mesh, Object,
    Scene, Shape,
};

/// The intensity of the ambient light where no input sets it.
pub const DEFAULT_AMBIENT: f64 = 0.25;

/// A material whose colours are in the numbers of the colour pipeline.
pub type PreparedMaterial = Material<DVec3>;

/// A scene prepared for rendering. Clones share the large parts.
#[derive(Clone)]
pub struct World {
    /// The acceleration structure.
    pub accelerator: Arc<dyn Accelerator>,
    /// The objects, in the order of the description.
    pub objects: Arc<[WorldObject]>,
    /// The materials.
    pub materials: Vec<PreparedMaterial>,
    /// The images of the textures.
    pub images: Arc<[Image]>,
    /// The index of the object that is the ground put under the scene.
    pub ground: Option<u32>,
    /// Whether the ground shows its shadows alone before a backdrop.
    catches_shadows: bool,
    /// The lights with radiance above 0 that are not surfaces.
    pub lights: Vec<WorldLight>,
    /// How paths choose among these.
    pub(crate) light_groups: Arc<LightGroups>,
    /// The colour pipeline.
    pub pipeline: ColourPipeline,
    /// The intensity of the ambient light.
    pub ambient: f64,
    /// Further ambient light, of local shading.
    pub(crate) fill: Option<PreparedFill>,
    /// The diagonal of the box around the objects, without the ground and lights with an area.
    pub(crate) diagonal: f64,
    /// The colour of rays that hit nothing, in the numbers of the pipeline; black with a backdrop.
    pub background: DVec3,
    /// The colour behind the picture, in the numbers of the pipeline: [`DefaultLook::has_backdrop`].
    pub(crate) backdrop: Option<DVec3>,
    /// The environment.
    pub(crate) environment: Option<Arc<PreparedEnvironment>>,
    /// The emissive surfaces.
    pub(crate) emitters: Arc<Emitters>,
    /// The volumes that transmit light.
    pub(crate) volumes: Option<Arc<Volumes>>,
    /// The lights of the scene that are such surfaces.
    pub(crate) area_lights: Arc<AreaLights>,
    /// [`DefaultLook::path_tracing_reason`].
    pub(crate) path_tracing_reason: Option<Arc<str>>,
    /// The number of analytic shapes left out because they are empty in the tier's precision.
    pub too_small: usize,
    primitive_count: usize,
}

/// What a world depends on besides the objects, materials, images and lights of its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct WorldInputs {
    /// Colour of rays that hit nothing.
    pub background: Option<Colour>,
    /// [`DefaultLook::has_backdrop`].
    pub has_backdrop: bool,
    /// Light from infinitely far away.
    pub environment: Option<Environment>,
    /// The light that is added, and follows the camera.
    pub light: Option<AddedLight>,
    /// The ground under the scene.
    pub ground: Option<Ground>,
    /// Intensity of the ambient light.
    pub ambient: Option<f64>,
    /// Fill light of local shading.
    pub fill: Option<Fill>,
    /// [`DefaultLook::path_tracing_reason`].
    pub path_tracing_reason: Option<String>,
    /// The colour pipeline.
    pub pipeline: ColourPipeline,
    /// The acceleration structure.
    pub structure: Layout,
    /// The tier of numerics.
    pub numerics: Numerics,
}

impl WorldInputs {
    /// Those of a look, in whose coordinates they are.
    pub fn new(look: &DefaultLook, pipeline: ColourPipeline, structure: Layout, numerics: Numerics) -> Self {
        WorldInputs {
            background: look.background(),
            has_backdrop: look.has_backdrop,
            environment: look.environment.clone(),
            light: look.light,
            ground: look.ground,
            ambient: look.ambient,
            fill: look.fill,
            path_tracing_reason: look.path_tracing_reason.clone(),
            pipeline,
            structure,
            numerics,
        }
    }
}

/// An object of the world.
pub struct WorldObject {
    /// Its name.
    pub name: String,
    /// The index of the input file it came from.
    pub input: usize,
    /// The index of its material.
    pub material: u32,
    /// The first of its primitives.
    pub first: PrimId,
    /// Whether its triangles are seen clockwise from the front.
    pub is_mirrored: bool,
    /// Whether it is an analytic shape, not triangles.
    pub is_analytic: bool,
    /// Its vertex attributes.
    pub(crate) attributes: attributes::Attributes,
}

impl WorldObject {
    /// Whether it has tangents for its material's normal map.
    pub fn has_tangents(&self) -> bool {
        self.attributes.has_tangents()
    }

    /// Whether it has vertex normals.
    pub fn is_smooth(&self) -> bool {
        self.attributes.is_smooth()
    }
}

/// A prepared light.
#[derive(Debug, Clone)]
pub struct WorldLight {
    /// Its name.
    pub name: String,
    /// Colour times intensity, in the numbers of the pipeline.
    pub radiance: DVec3,
    /// Position or direction, falloff and cone.
    pub kind: LightKind,
    /// The disc of a directional light with an apparent diameter.
    pub(crate) disc: Option<LightDisc>,
    /// The planes of the surfaces that it lies on, up to rounding.
    pub(crate) touched: Vec<touched::TouchedPlane>,
}

impl World {
    /// Prepares a scene for rendering in `pipeline`, with the geometry in the precision of `numerics`. Nothing is added to
    /// what the scene says.
    pub fn prepare(scene: Scene, pipeline: ColourPipeline, structure: Layout, numerics: Numerics) -> World {
        let look = DefaultLook::of_files(&scene, scene.picture);
        World::prepare_with(scene, &WorldInputs::new(&look, pipeline, structure, numerics))
    }

    /// The name of a light, for text.
    pub fn light_name(&self, index: usize) -> String {
        printable(&self.lights[index].name).into_owned()
    }

    /// Prepares a scene for rendering, with what is added to it.
    pub fn prepare_with(scene: Scene, inputs: &WorldInputs) -> World {
        let images = scene.images.iter().map(|image| Image::new(image.clone(), inputs.pipeline)).collect();
        World::with_images(scene, inputs, images)
    }

    /// [`World::prepare_with`] for a scene with the same images as this world, which are shared.
    pub fn prepare_another(&self, scene: Scene, inputs: &WorldInputs) -> World {
        World::with_images(scene, inputs, self.images.clone())
    }

    /// This world with other lights that are not surfaces. `objects` are those of the scene; without them, only lights
    /// at the positions of this world's lights are known to lie on surfaces.
    pub fn under(&self, lights: Vec<Light>, objects: &[Object]) -> World {
        let mut lights = world_lights(lights, self.pipeline);
        match objects {
            [] => touched::copy(&mut lights, &self.lights),
            _ => touched::find(&mut lights, objects, self.numerics()),
        }
        World { light_groups: LightGroups::new(&lights).into(), lights, ..self.clone() }
    }

    fn with_images(mut scene: Scene, inputs: &WorldInputs, images: Arc<[Image]>) -> World {
        let WorldInputs {
            background,
            has_backdrop,
            environment,
            // It follows the camera: pictures add it.
            light: _,
            ground,
            ambient,
            fill,
            path_tracing_reason,
            pipeline,
            structure,
            numerics,
        } = inputs;
        let (pipeline, structure, numerics) = (*pipeline, *structure, *numerics);
        let background = background.unwrap_or(fit::BACKGROUND).to_pipeline(pipeline);
        let backdrop = has_backdrop.then_some(background);
        let diagonal = scene.bounds().map_or(0.0, |(min, max)| min.distance(max));
        let to_pipeline = |material: Material| material.map_colours(|colour| colour.to_pipeline(pipeline));
        let mut materials: Vec<PreparedMaterial> =
            std::mem::take(&mut scene.materials).into_iter().map(to_pipeline).collect();
        let catches_shadows = ground.is_some_and(|ground| ground.catches_shadows);
        let ground_object = ground.map(|_| scene.objects.len() as u32);
        if let Some(ground) = ground {
            materials.push(to_pipeline(ground::material(ground)));
            scene.objects.push(ground::object(ground, MaterialId((materials.len() - 1) as u32)));
        }
        let mut area_lights = AreaLights::add_surfaces(&mut scene, &mut materials, pipeline);
        let has_tangents: Vec<bool> = materials.iter().map(|m| m.tangent_coordinates().is_some()).collect();
        let Partition { instances, shared, firsts } = instances(&scene.objects, structure, numerics);
        let mut kept = 0;
        let slots = slots(&scene.objects, &firsts, &shared, numerics).inspect(|_| kept += 1);
        let instanced: usize = instances.iter().map(|i| i.placed.triangle_count()).sum();
        let accelerator = bvh::detail::build_with_instances(slots, instances, structure, numerics);
        let primitive_count = scene.primitive_count();
        let environment =
            environment.as_ref().map(|environment| PreparedEnvironment::new(environment, pipeline).into());
        let of_lights = (area_lights.one_sided, std::mem::take(&mut area_lights.rectangles));
        let looks = (&materials[..], &images[..]);
        let emitters = Emitters::new(&scene.objects, &firsts, looks, of_lights, numerics.precision());
        let volumes = Volumes::new(&scene.objects, &materials).map(Arc::new);
        let too_small = primitive_count - instanced - kept;
        let mut lights = world_lights(scene.lights, pipeline);
        touched::find(&mut lights, &scene.objects, numerics);
        let mut attributes = attributes::SharedAttributes::default();
        let objects = scene.objects.into_iter().zip(firsts).map(|(object, first)| WorldObject {
            name: object.name,
            input: object.input,
            material: object.material.0,
            first,
            is_mirrored: object.shape.is_mirrored(),
            is_analytic: matches!(object.shape, Shape::Analytic(_)),
            attributes: attributes.attributes(object.shape, has_tangents[object.material.0 as usize]),
        });
        let objects = objects.collect();
        World {
            accelerator: accelerator.into(),
            objects,
            materials,
            ground: ground_object,
            catches_shadows,
            environment,
            emitters: emitters.into(),
            volumes,
            area_lights: area_lights.into(),
            images,
            light_groups: LightGroups::new(&lights).into(),
            lights,
            pipeline,
            ambient: ambient.unwrap_or(DEFAULT_AMBIENT),
            fill: fill.as_ref().map(PreparedFill::new),
            diagonal,
            background: if backdrop.is_some() { DVec3::ZERO } else { background },
            backdrop,
            path_tracing_reason: path_tracing_reason.as_deref().map(Into::into),
            too_small,
            primitive_count,
        }
    }

    /// The tier of numerics.
    pub fn numerics(&self) -> Numerics {
        self.accelerator.numerics()
    }

    /// Whether there is ambient light.
    pub fn has_ambient(&self) -> bool {
        self.ambient > 0.0 || self.fill.is_some()
    }

    /// The ambient light that a white diffuse surface with this shading normal reflects where nothing is near.
    #[inline]
    pub(crate) fn ambient_at(&self, normal: DVec3) -> f64 {
        self.ambient + self.fill.as_ref().map_or(0.0, |fill| fill.diffuse(normal.y))
    }

    /// Whether camera rays that hit nothing see the environment.
    pub fn shows_environment(&self) -> bool {
        self.environment.as_ref().is_some_and(|environment| !environment.is_hidden)
    }

    /// The world with a black background instead of its backdrop, if it has one.
    pub fn without_backdrop(&self) -> Option<World> {
        self.backdrop.is_some().then(|| World { backdrop: None, ..self.clone() })
    }

    /// The world whose fill light is that of an exposure in EV ([`Fill::is_exposed`]); `None` where it is already.
    pub(crate) fn with_exposed_fill(&self, ev: Option<f64>) -> Option<World> {
        let fill = self.fill.as_ref()?.exposed(ev)?;
        Some(World { fill: Some(fill), ..self.clone() })
    }

    /// The index of the object that shows its shadows alone, the ground before a backdrop.
    pub(crate) fn shadow_catcher(&self) -> Option<u32> {
        self.ground.filter(|_| self.catches_shadows && self.backdrop.is_some())
    }

    /// The materials that objects use.
    pub fn materials_in_use(&self) -> impl Iterator<Item = &PreparedMaterial> {
        let mut used = vec![false; self.materials.len()];
        self.objects.iter().for_each(|object| used[object.material as usize] = true);
        self.materials.iter().zip(used).filter(|(_, used)| *used).map(|(material, _)| material)
    }

    /// The index of the object that a primitive belongs to.
    pub fn object_of(&self, prim: PrimId) -> u32 {
        // Of objects with the same first primitive all but the last are empty.
        (self.objects.partition_point(|object| object.first <= prim) - 1) as u32
    }

    /// The radiance that a camera ray in this direction sees if it hits nothing. `place` is that of the direction in the
    /// environment, if there is one.
    pub(crate) fn background_towards(&self, direction: DVec3, place: [f64; 2]) -> DVec3 {
        match &self.environment {
            Some(environment) if !environment.is_hidden => environment.eval_pdf(direction, place).0,
            _ => self.background,
        }
    }

    /// The place of a unit direction in the environment; anything without one.
    pub(crate) fn environment_position(&self, direction: DVec3) -> [f64; 2] {
        self.environment.as_ref().map_or([0.0; 2], |environment| environment.map_position(direction))
    }

    /// The number of primitives in the scene.
    pub fn primitive_count(&self) -> usize {
        self.primitive_count
    }
}

/// Prepares the lights that are not surfaces. Those without radiance are left out.
fn world_lights(lights: Vec<Light>, pipeline: ColourPipeline) -> Vec<WorldLight> {
    let lights = lights.into_iter().filter(|light| !light.kind.is_area()).map(|light| {
        let radiance = light.colour.to_pipeline(pipeline) * light.intensity;
        let disc = match light.kind {
            LightKind::Directional { direction, angle } => LightDisc::new(direction, angle, radiance),
            _ => None,
        };
        WorldLight { name: light.name, radiance, kind: light.kind, disc, touched: Vec::new() }
    });
    lights.filter(|light| light.radiance != DVec3::ZERO).collect()
}

/// How the objects enter the acceleration structure.
struct Partition {
    /// The objects that are instances of a shared mesh.
    instances: Vec<Instance>,
    /// For each object, whether it is an instance.
    shared: Vec<bool>,
    /// For each object, its first primitive.
    firsts: Vec<PrimId>,
}

/// Finds the objects that can be instances of a shared mesh, where the structure supports instances.
fn instances(objects: &[Object], structure: Layout, numerics: Numerics) -> Partition {
    let mut parts = Partition { instances: Vec::new(), shared: Vec::new(), firsts: Vec::new() };
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
        let fits = space.is_some_and(|space| bvh::detail::can_be_instance(placed, &space, numerics));
        parts.shared.push(fits);
        if !fits {
            continue;
        }
        let first = *parts.firsts.last().expect("the object's own");
        parts.instances.push(Instance { placed: placed.clone(), first });
    }
    parts
}

/// The primitives of all objects that are not instances, in the precision of the tier. A shape that is empty in that
/// precision keeps its number and gets no slot.
fn slots(
    objects: &[Object],
    firsts: &[PrimId],
    shared: &[bool],
    numerics: Numerics,
) -> impl Iterator<Item = Slot> {
    let own = objects.iter().zip(firsts).zip(shared).filter(|(_, shared)| !**shared);
    own.flat_map(move |((object, first), _)| {
        let precision = numerics.precision();
        (first.0..).zip(object.shape.primitives()).filter_map(move |(id, primitive)| {
            Some(Slot { primitive: primitive.rounded(precision)?, id: PrimId(id) })
        })
    })
}
