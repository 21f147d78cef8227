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
    let end = hit.map_or(ray.t_max, |hit| hit.t);
    let end = if end.is_finite() { end } else { way_out(ray.origin, bounds) };
    let effect = EFFECTS.iter().find(|effect| *kind != RayKind::PRIMARY && effect.rays.contains(kind));
    RaySegment {
        kind: *kind,
        effect: effect.map(|effect| effect.id),
        depth: *depth,
        light: light.and_then(|light| Some(printable(&world.lights.get(light)?.name).into_owned())),
        from: ray.origin,
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
mod tests {
    use super::*;
    use crate::bvh::Layout;
    use crate::effects::Choices;
    use crate::error::Warnings;
    use crate::scene::{Camera, Numerics, Projection, Scene};
    use crate::world::recenter;

    struct Ready {
        world: World,
        view: View,
        plan: Plan,
        bounds: Option<(DVec3, DVec3)>,
        recentering: Option<Recentering>,
    }

    fn assignment() -> Scene {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/assignment.toml");
        crate::import::load(&[file], &mut Warnings::default()).unwrap()
    }

    /// The scene in the tier `double`, at 101 x 101 pixels.
    fn ready(mut scene: Scene, camera: &Camera) -> Ready {
        let recentering = recenter(&mut scene);
        let camera = recentering.map_or(camera.clone(), |recentering| recentering.moved(camera));
        let view = View::new(&camera, camera.projection, [101, 101]).unwrap();
        let bounds = scene.bounds();
        let pipeline = scene.picture.pipeline();
        let choices = Choices { sampling: scene.picture.sampling(), ..Choices::default() };
        let world = World::prepare(scene, pipeline, Layout::default(), Numerics::Double);
        let plan = Plan::new(&world, &choices).unwrap();
        Ready { world, view, plan, bounds, recentering }
    }

    impl Ready {
        fn inspect(&self, pixel: [u32; 2]) -> Inspection {
            let displays = [DisplayTransform::default(); 2];
            inspect(
                &self.world,
                &self.view,
                &self.plan,
                self.recentering.as_ref(),
                self.bounds,
                displays,
                pixel,
            )
        }
    }

    /// A camera whose middle pixel has its centre at `target`.
    fn towards(position: DVec3, target: DVec3) -> Camera {
        Camera::from_field_of_view("c".into(), position, target, DVec3::Y, 0.2)
    }

    /// From (100, -400, 350) towards the middle of the right sphere, (100, -400, 1350) of radius 100: along +z, hit at
    /// 1250 in a distance of 900, where the normal is -z.
    fn middle_of_the_right_sphere() -> Camera {
        towards(DVec3::new(100.0, -400.0, 350.0), DVec3::new(100.0, -400.0, 1350.0))
    }

    #[test]
    fn the_pixel_in_the_middle_of_a_sphere() {
        let ready = ready(assignment(), &middle_of_the_right_sphere());
        let pixel = ready.inspect([50, 50]);
        let surface = pixel.surface.clone().unwrap();
        assert_eq!(
            (surface.object_name.as_str(), surface.primitive, surface.kind),
            ("right sphere", 1, "sphere")
        );
        assert_eq!((surface.object, surface.primitive_of_object, surface.barycentrics), (1, 0, None));
        assert!((surface.distance - 900.0).abs() < 1e-9);
        assert!((surface.position - DVec3::new(100.0, -400.0, 1250.0)).length() < 1e-9);
        assert!((surface.geometric_normal + DVec3::Z).length() < 1e-9);
        assert_eq!(surface.material, "midnight-blue");
        assert!(
            surface.material_values.contains(&("colour", "#191970".into())),
            "{:?}",
            surface.material_values
        );
        assert!(surface.material_values.contains(&("specular", "3".into())));

        // One light: one shadow ray. The camera ray is reflected into itself, along -z above the plane at -500, and
        // misses, so the reflection has no shadow ray.
        let kinds: Vec<&str> = pixel.rays.iter().map(|ray| ray.kind.name).collect();
        assert_eq!(kinds, ["primary", "shadow", "glaze"]);
        let [primary, shadow, glaze] = &pixel.rays[..] else { unreachable!() };
        assert_eq!(
            (primary.hit, primary.effect, primary.object.as_deref()),
            (true, None, Some("right sphere"))
        );
        assert_eq!(primary.to, surface.position);
        // The lamp, at (-400, 100, 850).
        assert_eq!(
            (shadow.effect.map(EffectId::name), shadow.light.as_deref(), shadow.hit),
            (Some("shadows"), Some("lamp"), false)
        );
        assert!((shadow.to - DVec3::new(-400.0, 100.0, 850.0)).length() < 1e-6);
        assert!((shadow.from - surface.position).length() < 1e-6);
        assert_eq!((glaze.effect.map(EffectId::name), glaze.depth, glaze.hit), (Some("glaze"), 1, false));
        assert!(((glaze.to - glaze.from).normalize() + DVec3::Z).length() < 1e-9);
        let (min, max) = ready.bounds.unwrap();
        assert!(glaze.to.cmplt(min).any() || glaze.to.cmpgt(max).any(), "it leaves the scene: {}", glaze.to);
    }

    #[test]
    fn a_mirrored_ray_leaves_as_it_came() {
        // Down on the plane y = -500 at (-600, -500, 1000) at 45 degrees along +z: hit at 100 sqrt 2.
        let ready = ready(
            assignment(),
            &towards(DVec3::new(-600.0, -400.0, 900.0), DVec3::new(-600.0, -500.0, 1000.0)),
        );
        let pixel = ready.inspect([50, 50]);
        let surface = pixel.surface.clone().unwrap();
        assert_eq!((surface.object_name.as_str(), surface.kind, surface.primitive), ("plane", "triangle", 2));
        assert!((surface.distance - 100.0 * 2f64.sqrt()).abs() < 1e-9);
        // Corners at (-10000, -10000), (-10000, 100000) and (10000, -10000) in x and z: of the way from the first,
        // 11000 / 110000 are towards the second, 9400 / 20000 towards the third.
        for (weight, expected) in surface.barycentrics.unwrap().iter().zip([0.43, 0.1, 0.47]) {
            assert!((weight - expected).abs() < 1e-12, "{weight} {expected}");
        }
        // Mirrored about +y: at 45 degrees upwards along +z.
        let glaze = pixel.rays.iter().find(|ray| ray.kind.name == "glaze").unwrap();
        let direction = (glaze.to - glaze.from).normalize();
        assert!((direction - DVec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-9, "{direction}");
        // The inspected colour is that of the rendered picture.
        let whole = Window { x: 0, y: 0, width: 101, height: 101 };
        let control = crate::render::RenderControl::default();
        let (film, _): (crate::film::Film, _) =
            crate::render::render(&ready.world, &ready.view, &ready.plan, whole, |_, _| true, &control)
                .unwrap();
        for [x, y] in [[50, 50], [0, 0], [100, 3], [17, 80]] {
            let pixel = ready.inspect([x, y]);
            assert_eq!(pixel.colour, film.pixel(x, y), "{x} {y}");
            assert_eq!(pixel.displayed, ready.world.pipeline.encode(film.pixel(x, y)));
        }
    }

    /// An occluded shadow ray ends at its occluder.
    #[test]
    fn a_shadow_ray_ends_at_what_is_in_its_way() {
        // Where the line from the lamp (-400, 100, 850) through the middle of the left sphere (-300, -425, 1200) meets
        // the plane, at y = -500: 600 / 525 of the way.
        let (lamp, middle) = (DVec3::new(-400.0, 100.0, 850.0), DVec3::new(-300.0, -425.0, 1200.0));
        let shaded = lamp + (middle - lamp) * (600.0 / 525.0);
        let ready = ready(assignment(), &towards(shaded + DVec3::new(-300.0, 200.0, 200.0), shaded));
        let pixel = ready.inspect([50, 50]);
        let shadow = pixel.rays.iter().find(|ray| ray.kind.is_shadow).unwrap();
        assert!(shadow.hit);
        assert_eq!(shadow.object.as_deref(), Some("left sphere"));
        assert!(((shadow.to - middle).length() - 75.0).abs() < 1e-6, "on the sphere");
        assert!((shadow.to - shadow.from).length() < 2.0 * 75.0, "the near side");
    }

    #[test]
    fn a_pixel_that_sees_nothing() {
        let ready = ready(assignment(), &towards(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.0, 1.0, -0.1)));
        let pixel = ready.inspect([50, 50]);
        assert_eq!((pixel.surface.as_ref(), pixel.displayed, pixel.rays.len()), (None, [0; 3], 1));
        assert!(!pixel.rays[0].hit);
    }

    /// The rays do not depend on the number of samples of the picture.
    #[test]
    fn samples_make_the_colour_and_the_centre_the_rays() {
        let mut scene = assignment();
        let camera = scene.cameras[0].clone();
        let one = ready(scene.clone(), &camera);
        scene.picture.samples = Some(crate::scene::Samples::clamped(9));
        let nine = ready(scene, &camera);
        let (a, b) = (one.inspect([40, 60]), nine.inspect([40, 60]));
        assert_eq!((a.samples, b.samples), (1, 9));
        assert_eq!((&a.rays, &a.surface), (&b.rays, &b.surface));
    }

    /// Positions and distances are in scene coordinates, also if the scene was recentered: a sphere of radius 2 at a
    /// distance of 1e6.
    #[test]
    fn a_moved_scene_speaks_of_its_own_places() {
        let text = "[[sphere]]\ncentre = [1e6, 0, 1e6]\nradius = 2\n";
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.toml");
        std::fs::write(&file, text).unwrap();
        let scene = crate::import::load(&[file], &mut Warnings::default()).unwrap();
        let far = DVec3::new(1e6, 0.0, 1e6);
        let mut camera = towards(far + DVec3::Z * 10.0, far);
        camera.projection = Projection::Orthographic;
        let ready = ready(scene, &camera);
        assert!(ready.recentering.is_some());
        let pixel = ready.inspect([50, 50]);
        let surface = pixel.surface.unwrap();
        assert!(
            (surface.position - (far + DVec3::Z * 2.0)).length() < 1e-9
                && (surface.distance - 8.0).abs() < 1e-9
        );
        let [from, to] = ready.view.project_segment(pixel.rays[0].from, pixel.rays[0].to).unwrap();
        assert!((from - DVec2::splat(50.5)).length() < 1e-9 && (to - from).length() < 1e-9, "{from} {to}");
    }
}
