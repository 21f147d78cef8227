//! Textures: lookups, mip maps and footprints, against what can be derived by hand.

use crate::common;
use crate::common::picture::{Prepared, bits, prepare};
use crate::common::repository;
use glam::{DMat4, DVec2, DVec3};
use kiln::bvh::{Ray, Sphere, Traversal};
use kiln::effects::{Plan, PlanSettings, id};
use kiln::film::{ColourPipeline, Window};
use kiln::render::{RenderControl, render};
use kiln::scene::EffectValue;
use kiln::scene::{
    Attribute, Camera, DecodedImage, Glaze, Interpolation, Material, MaterialId, Mesh, Minify, Numerics,
    Object, Phong, Projection, Scene, Sensor, Shape, TexelEncoding, Texture, TextureFilter, TextureSampler,
    TextureSlot, Wrap,
};
use kiln::shading::ShadingMode;
use kiln::shading::texture::look_up;
use kiln::world::TexturePoint;

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> DecodedImage {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y));
    DecodedImage { name: "picture".into(), width, height, pixels: pixels.collect() }
}

/// A square of side 2 `size` about the origin that faces +z before it is placed, with `repeats` of a picture on it.
fn square(size: f64, repeats: f64, world_from_square: DMat4) -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(DVec2::from);
    let uv = |c: &DVec2| DVec2::new(c.x + 1.0, 1.0 - c.y) / 2.0 * repeats;
    let mut mesh = Mesh {
        positions: corners.iter().map(|c| (*c * size).extend(0.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![Attribute::per_position(corners.iter().map(uv).collect())],
        ..Mesh::default()
    };
    mesh.transform(&world_from_square);
    mesh
}

fn textured(sampler: TextureSampler) -> Material {
    let texture = Texture { image: kiln::scene::ImageId(0), sampler, coordinates: 0 };
    let textures = [(TextureSlot::BaseColour, Some(texture))].into();
    Material::Phong(Phong { colour: kiln::film::Colour::from_u8([255; 3]), textures, ..Phong::default() })
}

fn object(shape: Shape, material: u32) -> Object {
    Object { name: "it".into(), input: 0, material: MaterialId(material), shape }
}

/// A camera in the origin that looks along -z and sees 2 `half` by 2 `half` at a distance of 1.
fn camera(half: f64, projection: Projection) -> Camera {
    Camera {
        name: "c".into(),
        position: DVec3::ZERO,
        target: DVec3::NEG_Z,
        up: DVec3::Y,
        projection,
        view_height: 2.0 * half,
        view_width: Some(2.0 * half),
        viewpoint_distance: 1.0,
        lens: None,
        sensor: Sensor::default(),
        fitted: false,
    }
}

fn scene(picture: DecodedImage, mesh: Mesh, camera: Camera) -> Scene {
    Scene {
        picture: kiln::scene::PictureSettings { colour: Some(ColourPipeline::Display), ..Default::default() },
        cameras: vec![camera],
        materials: vec![textured(TextureSampler::default())],
        images: vec![picture],
        objects: vec![object(Shape::Mesh(mesh), 0)],
        ..Scene::default()
    }
}

/// With a filter, and no shading.
fn flat(filter: TextureFilter) -> PlanSettings {
    let with = vec![format!("textures={}", filter.name())];
    PlanSettings { shading: ShadingMode::Flat, with, ..PlanSettings::default() }
}

fn red(prepared: &Prepared, filter: TextureFilter, x: u32, y: u32) -> f64 {
    f64::from(prepared.render(flat(filter)).0.pixel(x, y)[0])
}

/// Texels 10, 20, 30 in a row. Centres lie at (i + 1/2) / 3; texel -1 is the last, the first or the first again, texel
/// 3 the first, the last or the last again.
#[test]
fn texels_at_centres_and_edges_under_every_wrap_mode() {
    let scene = scene(
        image(3, 1, |x, _| [10 * (x as u8 + 1); 3]),
        square(1.0, 1.0, DMat4::IDENTITY),
        camera(1.0, Projection::Orthographic),
    );
    let prepared = prepare(scene, [4, 4], Numerics::Watertight);
    let image = &prepared.world.images[0];
    for (wrap, before, after) in
        [(Wrap::Repeat, 30.0, 10.0), (Wrap::MirroredRepeat, 10.0, 30.0), (Wrap::ClampToEdge, 10.0, 30.0)]
    {
        let sampler = TextureSampler { wrap_u: wrap, wrap_v: wrap, ..TextureSampler::default() };
        let at = |filter, thirds: f64| {
            let point = TexturePoint { uv: DVec2::new(thirds / 3.0, 0.5), footprint: [DVec2::ZERO; 2] };
            let filter = sampler.filter(Some(filter));
            look_up(image, TexelEncoding::Data, &sampler, &filter, &point).x * 255.0
        };
        let close = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-12 * 255.0, "{wrap:?}: {found}, not {expected}");
        };
        for (place, value) in [(-0.5, before), (0.5, 10.0), (1.5, 20.0), (2.5, 30.0), (3.5, after)] {
            close(at(TextureFilter::Nearest, place), value);
            close(at(TextureFilter::Nearest, place + 0.499), value);
            close(at(TextureFilter::Nearest, place - 0.499), value);
            close(at(TextureFilter::Bilinear, place), value);
            // A footprint of nothing magnifies.
            close(at(TextureFilter::Mipmap, place), value);
        }
        for (edge, value) in
            [(0.0, (before + 10.0) / 2.0), (1.0, 15.0), (2.0, 25.0), (3.0, (30.0 + after) / 2.0)]
        {
            close(at(TextureFilter::Bilinear, edge), value);
        }
        close(at(TextureFilter::Bilinear, 0.75), 12.5);
    }
}

/// Blocks of 4 x 4 white texels with black ones all around: level 2 has alternating texels, level 3 is grey. At the
/// centre of a block the value falls from 1 in level 2 to 1/2 in level 3 as the level rises, so it tells the level.
///
/// A plane at distance 2, tilted by an angle about the x axis, is 2 / (half pixels a unit) wide a pixel across and that
/// by the angle's cosine up and down; the longer one decides. In f32 rays and 16-bit texels that holds to 1e-4 levels.
#[test]
fn the_level_of_a_tilted_plane_is_the_derived_one() {
    const PIXELS: u32 = 65;
    let (texels, repeats) = (256.0, 4.0);
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for degrees in [0.0f64, 30.0, 45.0, 60.0] {
            let tilt = degrees.to_radians();
            // Stripes where the picture is tilted would do; blocks make the axis count, too.
            let picture = image(256, 256, |x, y| [if (x / 4 + y / 4) % 2 == 0 { 255 } else { 0 }; 3]);
            // Moved along itself so that the ray through the middle of the picture hits the middle of a white block.
            let size = 20.0;
            let texel = 2.0 * size / (texels * repeats);
            let moved = DMat4::from_translation(DVec3::new(-2.0 * texel, 2.0 * texel, 0.0));
            let world_from_square =
                DMat4::from_translation(DVec3::new(0.0, 0.0, -2.0)) * DMat4::from_rotation_x(tilt) * moved;
            // So that a pixel sees `wanted` texels along the longer axis.
            for wanted in [4.5f64, 5.5, 7.0] {
                let distance = if projection == Projection::Perspective { 2.0 } else { 1.0 };
                let half = wanted * texel * tilt.cos() / distance * f64::from(PIXELS) / 2.0;
                let scene = scene(
                    picture.clone(),
                    square(size, repeats, world_from_square),
                    camera(half, projection),
                );
                let prepared = prepare(scene, [PIXELS, PIXELS], Numerics::Watertight);
                let value = red(&prepared, TextureFilter::Mipmap, PIXELS / 2, PIXELS / 2);
                let level = 2.0 + 2.0 * (1.0 - value);
                let derived = wanted.log2();
                assert!(
                    (level - derived).abs() < 1e-4,
                    "{projection:?}, {degrees} degrees: {level} instead of {derived}"
                );
            }
        }
    }
}

/// Stripes of 4 texels that run along the longer axis, so that all lookups along it see the same. A pixel that sees
/// `wanted` texels along it and that times the cosine across takes ceil(1 / cosine) lookups, each of the level for its
/// share.
#[test]
fn anisotropic_lookups_are_of_the_derived_level() {
    const PIXELS: u32 = 65;
    let picture = image(256, 256, |x, _| [if x / 4 % 2 == 0 { 255 } else { 0 }; 3]);
    let texel = 40.0 / (256.0 * 4.0);
    for (degrees, lookups) in [(50.0f64, 2.0), (55.0, 2.0), (63.0, 3.0), (70.0, 3.0)] {
        let tilt = degrees.to_radians();
        assert_eq!((1.0 / tilt.cos()).ceil(), lookups);
        let moved = DMat4::from_translation(DVec3::new(-2.0 * texel, 0.0, 0.0));
        let world_from_square =
            DMat4::from_translation(DVec3::new(0.0, 0.0, -2.0)) * DMat4::from_rotation_x(tilt) * moved;
        // Between 2 and 3 levels, where the value at the middle of a stripe tells.
        let wanted = 5.5 * lookups;
        let half = wanted * texel * tilt.cos() / 2.0 * f64::from(PIXELS) / 2.0;
        let mesh = square(20.0, 4.0, world_from_square);
        let scene = scene(picture.clone(), mesh, camera(half, Projection::Perspective));
        let prepared = prepare(scene, [PIXELS, PIXELS], Numerics::Watertight);
        let value = red(&prepared, TextureFilter::Anisotropic, PIXELS / 2, PIXELS / 2);
        let level = 2.0 + 2.0 * (1.0 - value);
        assert!((level - 5.5f64.log2()).abs() < 1e-4, "{degrees} degrees: {level}");
    }
}

/// In a flat mirror a picture is seen as from behind the mirror: the footprint is that of the whole way. The level is
/// told as above.
#[test]
fn mirrors_add_their_distance() {
    const PIXELS: u32 = 65;
    let picture = image(256, 256, |x, y| [if (x / 4 + y / 4) % 2 == 0 { 255 } else { 0 }; 3]);
    // The camera looks at a mirror at z = -1 and sees the square behind itself at z = 2: 1 + 3 away.
    let (size, repeats) = (20.0, 4.0);
    let texel = 2.0 * size / (256.0 * repeats);
    let behind = DMat4::from_translation(DVec3::new(-2.0 * texel, 2.0 * texel, 2.0));
    let half = 5.5 * texel / 4.0 * f64::from(PIXELS) / 2.0;
    let mut scene = scene(picture, square(size, repeats, behind), camera(half, Projection::Perspective));
    let mirror = Phong {
        colour: kiln::film::Colour::from_u8([0; 3]),
        glaze: Some(Glaze { weight: 1.0, own_weight: 0.0, bounces: 1 }),
        ..Phong::default()
    };
    scene.materials.push(Material::Phong(mirror));
    let at_one = DMat4::from_translation(DVec3::NEG_Z);
    scene.objects.push(object(Shape::Mesh(square(0.5, 1.0, at_one)), 1));
    let prepared = prepare(scene, [PIXELS, PIXELS], Numerics::Watertight);
    let mut plan_settings = flat(TextureFilter::Mipmap);
    plan_settings.with.push("glaze".into());
    let value = f64::from(prepared.render(plan_settings).0.pixel(PIXELS / 2, PIXELS / 2)[0]);
    let level = 2.0 + 2.0 * (1.0 - value);
    assert!((level - 5.5f64.log2()).abs() < 1e-4, "{level} instead of {}", 5.5f64.log2());
}

/// The differential of a mirrored ray, on a sphere seen from outside and from inside and on a mesh with normals of its
/// own, is how the mirrored ray changes when the camera's ray does: by finite differences of 2^-20, in f64.
#[test]
fn mirrored_differentials_are_finite_differences() {
    let mut smooth =
        square(1.5, 1.0, DMat4::from_translation(DVec3::NEG_Z * 4.0) * DMat4::from_rotation_y(0.3));
    let bulge = |p: &DVec3| (*p - DVec3::new(-0.8, 0.1, -7.0)).normalize() * 3.0;
    smooth.normals = Some(Attribute::per_position(smooth.positions.iter().map(bulge).collect()));
    let shapes = [
        Shape::Analytic(Sphere { centre: DVec3::new(0.3, 0.2, -5.0), radius: 1.5 }.into()),
        Shape::Analytic(Sphere { centre: DVec3::new(0.3, 0.2, 1.0), radius: 4.0 }.into()),
        Shape::Mesh(smooth),
    ];
    for shape in shapes {
        let mut scene =
            scene(image(1, 1, |_, _| [9; 3]), Mesh::default(), camera(0.1, Projection::Perspective));
        scene.objects = vec![object(shape, 0)];
        let prepared = prepare(scene, [64, 48], Numerics::Double);
        let world = &prepared.world;
        let mut traversal = Traversal::default();
        // Where a ray is mirrored, and to where.
        let mut mirrored = |ray: &Ray| {
            let hit = world.accelerator.closest_hit(ray, &mut traversal).expect("it is hit");
            let surface = world.interaction(ray, &hit);
            let n = surface.shading_normal;
            (surface.point.position, ray.direction() - 2.0 * ray.direction().dot(n) * n, surface)
        };
        for (x, y) in [(20, 10), (32, 24), (50, 40)] {
            let ray = prepared.view.ray(x, y, prepared.world.numerics().ray_precision());
            let change = prepared.view.differential(ray.direction());
            let (point, direction, surface) = mirrored(&ray);
            let found = world.mirrored_differential(&surface, &ray, &change);
            let step = 2f64.powi(-20);
            for k in 0..2 {
                let beside = Ray::unchecked(
                    ray.origin() + step * change.origin[k],
                    (ray.direction() + step * change.direction[k]).normalize(),
                    ray.t_min(),
                    ray.t_max(),
                );
                let (other_point, other_direction, ..) = mirrored(&beside);
                let expected = [(other_point - point) / step, (other_direction - direction) / step];
                for (found, expected) in [found.origin[k], found.direction[k]].into_iter().zip(expected) {
                    // Second derivatives times the step, and rounding of f64 over the step.
                    assert!((found - expected).length() < 1e-6, "{found} instead of {expected}");
                    assert!(found.length() > 1e-4, "something must change");
                }
            }
        }
    }
}

/// A camera's differential is the difference of the rays of neighbouring pixels, but for what is quadratic in a pixel's
/// size.
#[test]
fn the_cameras_differential_is_that_of_its_pixels() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let picture = image(1, 1, |_, _| [9; 3]);
        let scene = scene(picture, square(1.0, 1.0, DMat4::IDENTITY), camera(0.5, projection));
        let view = prepare(scene, [1000, 500], Numerics::Double).view;
        let precision = Numerics::Double.precision();
        for (x, y) in [(0, 0), (500, 250), (998, 3)] {
            let [here, right, down] =
                [(x, y), (x + 1, y), (x, y + 1)].map(|(x, y)| view.ray(x, y, precision));
            let found = view.differential(here.direction());
            for (k, other) in [right, down].into_iter().enumerate() {
                let off = other.direction() - here.direction() - found.direction[k];
                assert!(off.length() < 2e-3 * 2e-3, "{off}");
                assert!((other.origin() - here.origin() - found.origin[k]).length() < 1e-12);
            }
        }
    }
}

/// A checkered floor, seen from 1 above it to the horizon.
fn floor(size: [u32; 2]) -> Prepared {
    let picture = image(64, 64, |x, y| [if (x / 32 + y / 32) % 2 == 0 { 255 } else { 0 }; 3]);
    let lying = DMat4::from_translation(DVec3::new(0.3, -1.0, 0.0))
        * DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let mut scene = scene(picture, square(4000.0, 4000.0, lying), camera(0.5, Projection::Perspective));
    scene.cameras[0].view_width = None;
    prepare(scene, size, Numerics::Watertight)
}

/// Errors of filters on the floor below the horizon, against 256 samples a pixel: root of mean square.
///
/// A pixel of bilinear lookups shows one of its samples, black or white, whatever lies around it: where a pixel sees
/// many fields its error is that of a coin, 1/2. A pyramid shows their mean; by the longer axis alone it is blurred
/// across as well, which is an error, too, where fields are wide and flat; anisotropic lookups mend that. Measured:
/// bilinear 0.206, mipmap 0.101, anisotropic 0.031, that is 2.0 and 6.7 times less. Held to three quarters of that.
#[test]
fn a_floor_to_the_horizon() {
    const TIMES: u32 = 16;
    let size = [96, 96];
    let prepared = floor(size);
    let fine = floor(size.map(|side| side * TIMES)).render(flat(TextureFilter::Nearest)).0;
    let reference = |x: u32, y: u32| {
        let samples = (0..TIMES * TIMES).map(|i| (x * TIMES + i % TIMES, y * TIMES + i / TIMES));
        samples.map(|(x, y)| f64::from(fine.pixel(x, y)[0])).sum::<f64>() / f64::from(TIMES * TIMES)
    };
    let errors = [TextureFilter::Bilinear, TextureFilter::Mipmap, TextureFilter::Anisotropic].map(|filter| {
        let film = prepared.render(flat(filter)).0;
        let (mut sum, mut count): (f64, f64) = (0.0, 0.0);
        for (x, y) in (size[1] / 2..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))) {
            sum += (f64::from(film.pixel(x, y)[0]) - reference(x, y)).powi(2);
            count += 1.0;
        }
        // The row below the horizon sees hundreds of fields a pixel: the mean of black and white.
        if filter != TextureFilter::Bilinear {
            for x in 0..size[0] {
                let far = f64::from(film.pixel(x, size[1] / 2)[0]);
                assert!((far - 0.5).abs() < 0.01, "{filter:?}: {far}");
            }
        }
        (sum / count).sqrt()
    });
    println!("bilinear, mipmap, anisotropic: {errors:?}");
    let [bilinear, mipmap, anisotropic] = errors;
    assert!(bilinear > 1.5 * mipmap, "{errors:?}");
    assert!(bilinear > 5.0 * anisotropic, "{errors:?}");
}

#[test]
fn pyramids_are_made_where_a_filter_asks() {
    let scene = scene(
        image(64, 64, |x, y| [x as u8, y as u8, 0]),
        square(1.0, 1.0, DMat4::from_translation(DVec3::NEG_Z)),
        camera(1.0, Projection::Perspective),
    );
    let prepared = prepare(scene.clone(), [8, 8], Numerics::Watertight);
    let image = &prepared.world.images[0];
    for filter in [TextureFilter::Nearest, TextureFilter::Bilinear] {
        let (_, statistics) = prepared.render(flat(filter));
        assert_eq!(image.mip_map_bytes(), 0);
        assert!(statistics.bytes() > 0);
    }
    prepared.render(PlanSettings { without: vec!["textures".into()], ..PlanSettings::default() });
    assert_eq!(image.mip_map_bytes(), 0);
    prepared.render(flat(TextureFilter::Mipmap));
    // 32^2 + 16^2 + 8^2 + 4^2 + 2^2 + 1 = 1365 texels of three 16-bit numbers; none for plain numbers.
    assert_eq!(image.mip_map_bytes(), 1365 * 6);
    assert!(image.mip_map(TexelEncoding::Data).is_none());
    // A sampler of the file that wants none gets none.
    let mut scene = scene;
    let minify = Some(Minify { within: Interpolation::Linear, between: None });
    scene.materials[0] = textured(TextureSampler { minify, ..TextureSampler::default() });
    let prepared = prepare(scene, [8, 8], Numerics::Watertight);
    prepared.render(PlanSettings::default());
    assert_eq!(prepared.world.images[0].mip_map_bytes(), 0);
}

/// The effect is off where no material has a picture, and then the picture is the same; off by choice, only factors
/// remain.
#[test]
fn without_textures() {
    let mut scene = scene(
        image(2, 2, |_, _| [0; 3]),
        square(1.0, 1.0, DMat4::from_translation(DVec3::NEG_Z)),
        camera(1.0, Projection::Perspective),
    );
    let prepared = prepare(scene.clone(), [4, 4], Numerics::Watertight);
    assert_eq!(red(&prepared, TextureFilter::Nearest, 1, 1), 0.0);
    let without = PlanSettings {
        shading: ShadingMode::Flat,
        without: vec!["textures".into()],
        ..PlanSettings::default()
    };
    assert_eq!(prepared.render(without).0.pixel(1, 1)[0], 1.0);
    // A mesh without texture coordinates has its material's colour.
    if let Shape::Mesh(mesh) = &mut scene.objects[0].shape {
        mesh.uvs.clear();
    }
    let bare = prepare(scene.clone(), [4, 4], Numerics::Watertight);
    assert_eq!(red(&bare, TextureFilter::Mipmap, 1, 1), 1.0);
    scene.materials[0] = Material::Phong(Phong::default());
    let plain = prepare(scene, [4, 4], Numerics::Watertight);
    let plan = Plan::new(&plain.world, &plain.plan_settings(PlanSettings::default())).expect("a plan");
    assert!(plan.decisions.iter().all(|d| d.effect != id::TEXTURES || !d.on));
    assert!(plan.stages().iter().all(|stage| stage.stage.name != "texture coordinates"));
}

/// Any thread count, any part: the same bits; with footprints that pass mirrors, in every tier.
#[test]
fn the_same_bits_for_threads_and_crops() {
    let file = repository("scenes/effects/textures.toml");
    let scene = common::picture::load(&file);
    for numerics in Numerics::ALL {
        let size = [60, 44];
        let prepared = prepare(scene.clone(), size, numerics);
        let whole = prepared.render(PlanSettings::default()).0;
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let alone = one.install(|| prepared.render(PlanSettings::default()).0);
        assert!(bits(&whole, size) == bits(&alone, size));
        // In `fast`, rays of a crop make other packets.
        if numerics == Numerics::Fast {
            continue;
        }
        let plan =
            Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
        let window = Window { x: 13, y: 17, width: 29, height: 20 };
        let never = std::sync::atomic::AtomicBool::new(false);
        let control = RenderControl { cancel: &never, progress: &|_, _| {}, time_stages: false };
        let (part, _) =
            render(&prepared.world, &prepared.view, &plan, window, |_, _| true, &control).expect("a picture");
        for (x, y) in (0..20).flat_map(|y| (0..29).map(move |x| (13 + x, 17 + y))) {
            let [of_part, of_whole] = [part.pixel(x - 13, y - 17), whole.pixel(x, y)];
            assert_eq!(of_part.map(f32::to_bits), of_whole.map(f32::to_bits));
        }
    }
}

/// A scene file's word, and the command line's over it.
#[test]
fn a_filter_can_be_said_in_the_scene_and_on_the_command_line() {
    let mut scene = scene(
        image(2, 1, |x, _| [255 * x as u8; 3]),
        square(1.0, 1.0, DMat4::from_translation(DVec3::NEG_Z)),
        camera(1.0, Projection::Perspective),
    );
    scene.effects.set("textures", EffectValue::Text("nearest".into()), None);
    let prepared = prepare(scene, [10, 10], Numerics::Watertight);
    let flat_as_is = PlanSettings { shading: ShadingMode::Flat, ..PlanSettings::default() };
    // In column 3 at u = 0.35: nearest the first texel, bilinear 0.35 * 2 - 0.5 = 0.2 of the way to the second.
    assert_eq!(prepared.render(flat_as_is).0.pixel(3, 5)[0], 0.0);
    assert!((red(&prepared, TextureFilter::Bilinear, 3, 5) - 0.2).abs() < 1e-6);
}
