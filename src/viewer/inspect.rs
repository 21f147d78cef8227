//! Inspection of one pixel: its surface, its rays and its colour.
//!
//! The render plan is executed on a tile of one pixel, with a [`RayRecorder`]. The colour is that of the picture with
//! all its samples. The surface and the rays are those of one camera ray through the pixel's centre.

use glam::{DVec2, DVec3};

use crate::bvh::{Primitive, Tests, Traversal};
use crate::effects::tile::{RayRecorder, RecordedRay, RenderContext, Tile, TraceResult};
use crate::effects::{EFFECTS, EffectId, Plan, RayKind};
use crate::error::printable;
use crate::film::{DisplayTransform, Window};
use crate::geometry::Ray;
use crate::scene::{Glaze, Material};
use crate::world::{PreparedMaterial, Recentering, SurfaceInteraction, View, World};

/// Result of inspecting a pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// Column and row, from the top left.
    pub pixel: [u32; 2],
    /// Colour in the values of the colour pipeline.
    pub colour: [f32; 3],
    /// Display colour.
    pub displayed: [u8; 3],
    /// Number of camera rays of the colour.
    pub samples: u32,
    /// Surface hit by the camera ray through the pixel's centre.
    pub surface: Option<SurfaceInfo>,
    /// That camera ray and all its secondary and shadow rays, in the order of tracing.
    pub rays: Vec<RaySegment>,
    /// Numbers of box and primitive tests of the camera ray, traced as a single ray.
    pub tests: Tests,
}

/// Surface at a hit. Lengths and positions are in scene coordinates, before recentering.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceInfo {
    /// Object index, in the order of the description.
    pub object: u32,
    /// Object name.
    pub object_name: String,
    /// Primitive number.
    pub primitive: u32,
    /// Primitive number within its object.
    pub primitive_of_object: u32,
    /// `triangle`, or the name of an analytic shape.
    pub kind: &'static str,
    /// Distance along the ray.
    pub distance: f64,
    /// Hit position.
    pub position: DVec3,
    /// Unit geometric normal, on the side of the ray origin.
    pub geometric_normal: DVec3,
    /// Unit shading normal: interpolated vertex normals and normal maps applied.
    pub shading_normal: DVec3,
    /// The barycentrics u, v and w, on a triangle.
    pub barycentrics: Option<[f64; 3]>,
    /// Texture coordinates, if the object has any.
    pub uv: Option<DVec2>,
    /// Material name.
    pub material: String,
    /// Name and value of each material parameter, in the values of the colour pipeline.
    pub material_values: Vec<(&'static str, String)>,
}

/// A recorded ray as a line segment, in world coordinates for [`View::project_segment`].
#[derive(Debug, Clone, PartialEq)]
pub struct RaySegment {
    /// Ray kind.
    pub kind: RayKind,
    /// The effect that traces the ray; `None` for the camera ray.
    pub effect: Option<EffectId>,
    /// Number of bounces before the ray.
    pub depth: usize,
    /// Name of the light, for a shadow ray.
    pub light: Option<String>,
    /// Origin.
    pub from: DVec3,
    /// End point: the hit, the light, or a point outside the scene.
    pub to: DVec3,
    /// Whether the ray hits anything.
    pub hit: bool,
    /// Name of the object that is hit.
    pub object: Option<String>,
}

/// Inspects a pixel of the picture that `plan` renders with `view`. `recentering` is that of `world`; `bounds` is the
/// bounding box of the recentered scene, outside which rays that miss end. `displays` are the display transforms that the
/// render and the displayed image used.
pub fn inspect(
    world: &World,
    view: &View,
    plan: &Plan,
    recentering: Option<&Recentering>,
    bounds: Option<(DVec3, DVec3)>,
    displays: [DisplayTransform; 2],
    [x, y]: [u32; 2],
) -> Inspection {
    let [known, shown] = displays;
    let context = RenderContext { world, view, display: known, is_displayed: false };
    let window = Window { x, y, width: 1, height: 1 };
    let mut tile = Tile::default();
    // Returns the surface that the first camera ray hits.
    let run = |plan: &Plan, tile: &mut Tile| {
        tile.start(window);
        let mut first = None;
        loop {
            plan.run(tile, &context, |stage, tile| {
                let surfaces = &tile.generations[tile.current].surfaces;
                if plan.ends_camera_rays(stage) && !surfaces.is_empty() {
                    first.get_or_insert_with(|| surfaces.get(0));
                }
            });
            if !tile.needs_more_samples {
                return first;
            }
        }
    };
    run(plan, &mut tile);
    let colour = tile.pixels.first().copied().unwrap_or_default();
    let samples = tile.sample_counts.first().copied().unwrap_or(1);

    let mut tile = Tile::default();
    tile.recorder = Some(Box::new(RayRecorder::default()));
    let interaction = run(&one_ray_per_pixel(world, plan), &mut tile);
    let casts = tile.recorder.take().map_or(Vec::new(), |recorder| recorder.rays);
    let first = casts.first();
    let surface = interaction
        .zip(first)
        .map(|(interaction, cast)| surface_info(world, recentering, &interaction, &cast.ray));
    let mut traversal = Traversal::default();
    if let Some(cast) = first {
        world.accelerator.closest_hit(&cast.ray, &mut traversal);
    }
    let tests = traversal.tests;
    let rays = casts.iter().map(|cast| ray_segment(world, bounds, cast, &mut traversal)).collect();
    let displayed = shown.encode(world.pipeline, colour);
    Inspection { pixel: [x, y], colour, displayed, samples, surface, rays, tests }
}

/// The plan without effects that decide sample positions: one camera ray through each pixel's centre.
fn one_ray_per_pixel(world: &World, plan: &Plan) -> Plan {
    plan.keeping(world, |i| !EFFECTS[i].decides_samples)
}

fn surface_info(
    world: &World,
    recentering: Option<&Recentering>,
    surface: &SurfaceInteraction,
    ray: &Ray,
) -> SurfaceInfo {
    let (object, hit) = (&world.objects[surface.object as usize], &surface.hit);
    let position = surface.point.position;
    let [v, w] = hit.barycentrics;
    let (kind, barycentrics) = match world.accelerator.primitive(hit.slot) {
        Primitive::Analytic(shape) => (shape.name(), None),
        Primitive::Triangle(_) => ("triangle", Some([1.0 - v - w, v, w])),
    };
    SurfaceInfo {
        object: surface.object,
        object_name: printable(&object.name).into_owned(),
        primitive: hit.prim.0,
        primitive_of_object: hit.prim.0 - object.first.0,
        kind,
        distance: hit.t / recentering.map_or(1.0, |recentering| recentering.scale),
        position: recentering.map_or(position, |recentering| recentering.point_back(position)),
        geometric_normal: surface.geometric_normal,
        shading_normal: surface.shading_normal,
        barycentrics,
        uv: world
            .texture_point((surface.object, &surface.hit, surface.geometric_normal), ray, None, 0)
            .map(|point| point.uv),
        material: printable(world.materials[surface.material as usize].name()).into_owned(),
        material_values: material_values(world, &world.materials[surface.material as usize]),
    }
}

/// Names and values of a material's parameters and textures.
fn material_values(world: &World, material: &PreparedMaterial) -> Vec<(&'static str, String)> {
    let colour = |c: DVec3| {
        let [r, g, b] = world.pipeline.encode(c.as_vec3().to_array());
        format!("#{r:02x}{g:02x}{b:02x}")
    };
    let mut values = match material {
        Material::Phong(m) => {
            let mut values = vec![
                ("colour", colour(m.colour)),
                ("ambient", m.ambient.to_string()),
                ("diffuse", m.diffuse.to_string()),
                ("specular", m.specular.to_string()),
                ("shininess", m.shininess.to_string()),
            ];
            values.extend(m.glaze.map(|Glaze { weight, own_weight, bounces }| {
                let times = if bounces == 1 { "bounce" } else { "bounces" };
                ("glaze", format!("{weight} of what is mirrored, {own_weight} of its own, {bounces} {times}"))
            }));
            values
        }
        Material::MetallicRoughness(m) => {
            let mut values = vec![
                ("base colour", colour(m.base_colour)),
                ("metallic", m.metallic.to_string()),
                ("roughness", m.roughness.to_string()),
            ];
            let layers = m.layers.numbers().into_iter().filter(|(_, value, none)| value != none);
            values.extend(layers.map(|(name, value, _)| (name, value.to_string())));
            if m.emission != DVec3::ZERO {
                values.push(("emission", format!("{} {} {}", m.emission.x, m.emission.y, m.emission.z)));
            }
            if m.unlit {
                values.push(("unlit", "yes".into()));
            }
            values
        }
    };
    values.extend(material.textures().iter().filter_map(|(slot, texture)| {
        let image = world.images.get(texture.image.0 as usize)?;
        let size = format!("{} x {}", image.width, image.height);
        Some((slot.entry().name, format!("picture {} ({size})", printable(&image.name))))
    }));
    values
}

fn ray_segment(
    world: &World,
    bounds: Option<(DVec3, DVec3)>,
    cast: &RecordedRay,
    traversal: &mut Traversal,
) -> RaySegment {
    let RecordedRay { kind, depth, light, ray, result, .. } = cast;
    // An any-hit test returns no hit point, so the closest hit is traced.
    let hit = match result {
        TraceResult::Miss => None,
        TraceResult::Closest(hit) => Some(*hit),
        TraceResult::Occluded => world.accelerator.closest_hit(ray, traversal),
    };
    let end = hit.map_or(ray.t_max(), |hit| hit.t);
    let end = if end.is_finite() { end } else { way_out(ray.origin(), bounds) };
    let effect = EFFECTS.iter().find(|effect| *kind != RayKind::PRIMARY && effect.rays.contains(kind));
    RaySegment {
        kind: *kind,
        effect: effect.map(|effect| effect.id),
        depth: *depth,
        light: light.and_then(|light| Some(printable(&world.lights.get(light)?.name).into_owned())),
        from: ray.origin(),
        to: ray.at(end),
        hit: *result != TraceResult::Miss,
        object: hit
            .map(|hit| printable(&world.objects[world.object_of(hit.prim) as usize].name).into_owned()),
    }
}

/// A distance at which a ray from `origin` in any direction is outside the bounding sphere, by at least a quarter of
/// its radius.
fn way_out(origin: DVec3, bounds: Option<(DVec3, DVec3)>) -> f64 {
    let (min, max) = bounds.unwrap_or((-DVec3::ONE, DVec3::ONE));
    let (middle, radius) = (min / 2.0 + max / 2.0, (max / 2.0 - min / 2.0).length());
    (origin - middle).length() + 1.25 * radius
}

#[cfg(test)]
mod tests;
