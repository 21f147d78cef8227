//! Path tracing against closed forms. Every test states the expected radiance; the mean over pixels must lie within
//! four standard errors of it, and the standard error must be small enough for the test to mean something.

use crate::common::picture::{changed, parse};
use crate::common::repository;
use kiln::effects::{LightTechnique, PlanSettings};
use kiln::error::Warnings;
use kiln::film::{Film, Window};
use kiln::job::metadata::fingerprint_of;
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::scene::{Clamp, PictureSettings, Samples, Scene, Transport};

pub(crate) const SIZE: u32 = 48;

/// Settings for path tracing with `samples` samples a pixel and `depth` bounces.
pub(crate) fn settings(samples: u32, depth: u32) -> RenderSettings {
    let picture = PictureSettings {
        transport: Some(Transport::Path),
        samples: Some(Samples::clamped(samples)),
        filter: Some(kiln::film::FilterShape::Box),
        ..PictureSettings::of_size([SIZE; 2])
    };
    RenderSettings { with: vec![format!("path={depth}")], ..picture.into() }
}

pub(crate) fn render(scene: Scene, settings: &RenderSettings) -> Film {
    let job = prepare(scene, settings, &mut Warnings::default()).expect("a job");
    let (film, statistics) = job.render(&RenderControl::default()).expect("a picture");
    assert_eq!(statistics.non_finite, []);
    film
}

/// Mean and standard error of the red channel over the pixels.
pub(crate) fn mean(film: &Film) -> (f64, f64) {
    let Window { width, height, .. } = film.window();
    let values: Vec<f64> = film.rows().map(|[red, ..]: [f32; 3]| red.into()).collect();
    let count = f64::from(width * height);
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

pub(crate) fn check(scene: &str, samples: u32, depth: u32, expected: f64) {
    check_settings(scene, &settings(samples, depth), expected);
}

pub(crate) fn check_settings(scene: &str, settings: &RenderSettings, expected: f64) {
    let (mean, error) = mean(&render(parse(scene), settings));
    assert!(error < 0.004 * expected, "a standard error of {error} shows nothing of {expected}");
    // The film rounds to f32.
    let slack = 4.0 * error + 1e-6 * expected;
    let with = &settings.with;
    assert!((mean - expected).abs() < slack, "{with:?}: {mean} +- {error}, expected {expected}");
}

/// The inside of a closed surface that emits 1 and reflects half of what it receives.
const ROOM: &str = "[[camera]]\nposition = [0.1, 0.2, 0]\nlook_at = [1, 0.3, 0.2]\nvertical_fov = 90\n\
    [material.wall]\ncolour = '#ffffff'\ndiffuse = 0.5\nemission = '#ffffff'\n";

/// Inside a closed surface of emission 1 and albedo 1/2 the radiance is 1 + 1/2 + ... + 2^-N for N bounces, in every
/// direction and at every point. With 40 bounces roulette ends nearly all paths.
#[test]
fn a_closed_room_has_the_radiance_of_its_geometric_series() {
    let sphere = format!("{ROOM}[[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n");
    let boxed = format!("{ROOM}[[mesh]]\nmaterial = 'wall'\nfile = '{}'\n", room_file());
    for scene in [&sphere, &boxed] {
        check(scene, 1, 0, 1.0);
        for (samples, depth) in [(64, 1), (64, 2), (64, 5), (64, 40)] {
            check(scene, samples, depth, 2.0 - 0.5f64.powi(depth as i32));
        }
    }
}

/// A box from -2 to 2 as an OBJ file, in a folder that stays until the tests end.
pub fn room_file() -> String {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let file = folder.join("room.obj");
    let vertices: String = (0..8)
        .map(|i| {
            let side = |bit: i32| if i >> bit & 1 == 0 { -2 } else { 2 };
            format!("v {} {} {}\n", side(0), side(1), side(2))
        })
        .collect();
    let faces = "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n";
    std::fs::write(&file, vertices + faces).expect("a file");
    file.display().to_string()
}

/// A white floor seen at its origin alone, from the side.
pub(crate) const FLOOR: &str = "[[camera]]\nposition = [40, 30, 0]\nlook_at = [0, 0, 0]\nvertical_fov = 0.001\n\
    [material.floor]\ncolour = '#ffffff'\n[material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = 5\n\
    [[triangles]]\nmaterial = 'floor'\nvertices = [[-90, 0, -90], [90, 0, -90], [0, 0, 180]]\n";

/// A sphere of radiance L and radius r at a distance d straight above: irradiance pi L (r / d)^2, so a white diffuse floor has
/// the radiance L (r / d)^2. Rotated to an angle a from the normal, its cosine more, as long as it is wholly above the horizon.
#[test]
fn a_sphere_light_has_its_irradiance() {
    let lamp = |x: f64, y: f64| {
        format!("{FLOOR}[[sphere]]\nmaterial = 'lamp'\ncentre = [0, {y}, {x}]\nradius = 1\n")
    };
    check(&lamp(0.0, 3.0), 64, 1, 5.0 / 9.0);
    check(&lamp(4.0, 3.0), 64, 1, 5.0 / 25.0 * 0.6);
}

/// Lambert's formula (1760): a polygon of radiance L has the irradiance L / 2 times the sum over its edges of the angle that an
/// edge subtends times the cosine between the normal of the receiver and that of the plane through point and edge.
#[test]
fn a_polygon_light_has_the_irradiance_of_lamberts_formula() {
    let corners = [[-1.0, 2.0, -1.0], [2.0, 2.5, -0.5], [0.0, 1.5, 2.0]].map(glam::DVec3::from);
    let irradiance: f64 = (0..3)
        .map(|i| {
            let (a, b) = (corners[i].normalize(), corners[(i + 1) % 3].normalize());
            a.angle_between(b) * a.cross(b).normalize().y
        })
        .sum();
    let radiance = 5.0 * irradiance.abs() / 2.0 / std::f64::consts::PI;
    let vertices = corners.map(|c| format!("[{}, {}, {}]", c.x, c.y, c.z)).join(", ");
    let scene = format!("{FLOOR}[[triangles]]\nmaterial = 'lamp'\nvertices = [{vertices}]\n");
    check(&scene, 64, 1, radiance);
    // A second one without effect on the first: behind the floor.
    let below = "[[triangles]]\nmaterial = 'lamp'\nvertices = [[-1, -2, -1], [2, -2, -1], [0, -2, 2]]\n";
    check(&format!("{scene}{below}"), 128, 1, radiance);
}

/// The irradiance at the origin of a floor that faces +y under a polygon above it, of radiance 1 (Lambert's formula).
fn irradiance(corners: &[glam::DVec3]) -> f64 {
    let sum: f64 = (0..corners.len())
        .map(|i| {
            let (a, b) = (corners[i].normalize(), corners[(i + 1) % corners.len()].normalize());
            a.angle_between(b) * a.cross(b).normalize().y
        })
        .sum();
    sum.abs() / 2.0
}

/// A square of 2 by 2 at a height of 1, its centre at (-1/2, 1, 0), which emits 0 and 2 in a checker of 3 by 3 texels.
/// Each texel is a polygon of one radiance, so the sum of their irradiances is exact. The checker is the same from each
/// side. A square of the mean radiance, 10/9, would give another value. Without light samples the standard error would
/// be too large: 147456 samples, a tenth of which hits the bright texels, have one of 0.8 %.
#[test]
fn a_textured_light_has_the_irradiance_of_its_texels() {
    let bright = |x: usize, y: usize| (x + y).is_multiple_of(2);
    let texels: Vec<[u8; 4]> =
        (0..9).map(|i| if bright(i % 3, i / 3) { [255; 4] } else { [0, 0, 0, 255] }).collect();
    let material = serde_json::json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, 1] },
        "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 },
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 2 } },
    });
    let file = super::layers::square(&material, &[crate::common::gltf::png_uri(3, &texels)]);
    let lamp = format!(
        "{FLOOR}[[mesh]]\nfile = '{}'\nrotate = [90, 0, 0]\ntranslate = [-0.5, 1, 0]\n",
        file.display()
    );
    let at = |i: usize| 2.0 / 3.0 * i as f64 - 1.0;
    let corner = |x: usize, z: usize| glam::DVec3::new(at(x) - 0.5, 1.0, at(z));
    let rectangle = |x: usize, z: usize, side: usize| {
        irradiance(&[corner(x, z), corner(x + side, z), corner(x + side, z + side), corner(x, z + side)])
    };
    let sum: f64 = (0..9).filter(|i| bright(i % 3, i / 3)).map(|i| 2.0 * rectangle(i % 3, i / 3, 1)).sum();
    let mean = 10.0 / 9.0 * rectangle(0, 0, 3);
    assert!((sum / mean - 1.0).abs() > 0.02, "{sum} {mean}");
    check(&lamp, 64, 1, sum / std::f64::consts::PI);
    // Without the texture the square emits 2 everywhere; it is chosen as a light as before.
    let settings = RenderSettings { without: vec!["textures".into()], ..settings(64, 1) };
    let (plain, error) = self::mean(&render(parse(&lamp), &settings));
    let expected = 2.0 * rectangle(0, 0, 3) / std::f64::consts::PI;
    assert!((plain - expected).abs() < 4.0 * error && error < 0.004 * expected, "{plain}, {expected}");
}

/// Unlit surfaces show their base colour and scatter nothing: in an environment of 1 and at any depth 0.25 stays 0.25.
#[test]
fn unlit_surfaces_emit_their_base_colour() {
    let material = serde_json::json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.25, 0.25, 0.25, 1] },
        "extensions": { "KHR_materials_unlit": {} },
    });
    let scene = format!(
        "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 10\n[environment]\ncolour = '#ffffff'\n\
         [[mesh]]\nfile = '{}'\n",
        super::layers::square(&material, &[]).display()
    );
    let (mean, error) = mean(&render(parse(&scene), &settings(2, 8)));
    assert!((mean - 0.25).abs() < 1e-7 && error < 1e-7, "{mean} +- {error}");
}

/// A box of glass as an MTL material with `illum 7`, without index an invisible one: Kd is not seen, the filter is,
/// twice.
#[test]
fn glass_of_mtl_filters_light() {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let cube = std::fs::read_to_string(room_file()).expect("a file");
    std::fs::write(folder.join("a.mtl"), "newmtl a\nKd 1 0 0\nillum 7\nNi 1.000001\nTf 0.5 0.5 0.5\n")
        .expect("a file");
    std::fs::write(folder.join("a.obj"), format!("mtllib a.mtl\nusemtl a\n{cube}")).expect("a file");
    let scene = format!(
        "[[camera]]\nposition = [0, 0, 9]\nlook_at = [0, 0, 0]\nvertical_fov = 10\n[environment]\ncolour = '#ffffff'\n\
         [[mesh]]\nfile = '{}'\n",
        folder.join("a.obj").display()
    );
    let (mean, error) = mean(&render(parse(&scene), &settings(2, 8)));
    assert!((mean - 0.25).abs() < 1e-6 && error < 1e-6, "{mean} +- {error}");
}

/// A point light of intensity 1 without falloff shows a facing diffuse surface in its own colour in both transports.
#[test]
fn punctual_lights_are_as_bright_as_in_local_shading() {
    let scene = format!(
        "{FLOOR}[ambient]\nintensity = 0\n[[light]]\ntype = 'point'\nposition = [0, 8, 6]\nintensity = 0.5\n"
    );
    let (path, _) = mean(&render(parse(&scene), &settings(1, 1)));
    let whitted =
        RenderSettings { with: Vec::new(), ..changed(settings(1, 1), |picture| picture.transport = None) };
    let (local, _) = mean(&render(parse(&scene), &whitted));
    // The cosine is 8/10.
    assert!((local - 0.4).abs() < 1e-6 && (path - local).abs() < 1e-5, "{path} {local}");
}

/// In the closed room of albedo 1/2, where BSDF samples alone find light, every path adds 1, 1/2, 1/4, 1/8: no roulette ends
/// it before. The first two are direct light; a clamp of 0.2 leaves the last as it is, one of 0.1 neither.
#[test]
fn a_clamp_limits_what_paths_add_beyond_the_first_surface() {
    let room = format!("{ROOM}[[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n");
    for clamp in [f64::MAX, 0.2, 0.1] {
        let settings = changed(settings(1, 3), |picture| picture.clamp = Some(Clamp::clamped(clamp)));
        let job = prepare(parse(&room), &settings, &mut Warnings::default()).expect("a job");
        let plan_settings =
            PlanSettings { light_technique: LightTechnique::BsdfSamples, ..job.plan_settings.clone() };
        let job = job.with_plan_settings(plan_settings).expect("the job with another technique");
        let (seen, error) = mean(&job.render(&RenderControl::default()).expect("a picture").0);
        let expected: f64 = [1.0, 0.5, 0.25f64.min(clamp), 0.125f64.min(clamp)].iter().sum();
        assert!((seen - expected).abs() < 1e-5 && error < 1e-6, "{clamp}: {seen}, expected {expected}");
    }
}

/// Where every direction is reflected into itself, in the centre of an emissive spherical mirror of metal with the
/// albedo 1/2, every path adds 1, 1/2, 1/4, 1/8. What smooth mirrors show is not limited.
#[test]
fn a_clamp_leaves_what_mirrors_show_as_it_is() {
    let scene = "[[camera]]\nposition = [0, 0, 0]\nlook_at = [1, 0, 0]\nvertical_fov = 90\n\
        [material.wall]\ncolour = '#bcbcbc'\nmetallic = 1\nroughness = 0\nemission = '#ffffff'\n\
        [[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n";
    // 0xbc decodes to 0.5028865.
    let albedo = 0.502_886_5f64;
    let settings = changed(settings(1, 3), |picture| picture.clamp = Some(Clamp::clamped(0.1)));
    let (seen, error) = mean(&render(parse(scene), &settings));
    let expected: f64 = (0..4).map(|k| albedo.powi(k)).sum();
    assert!((seen - expected).abs() < 1e-5 && error < 1e-6, "{seen}, expected {expected}");
}

/// In the closed room of albedo 1/2 a clamp of next to nothing leaves 1 + 1/2. Emitted and direct light are the same to
/// the bit, and a limit that nothing reaches changes no bit.
#[test]
fn a_clamp_leaves_direct_light_as_it_is() {
    let room = format!("{ROOM}[[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n");
    let clamped =
        |clamp: Option<f64>| move |picture: &mut PictureSettings| picture.clamp = clamp.map(Clamp::clamped);
    let film = |depth, clamp| render(parse(&room), &changed(settings(64, depth), clamped(clamp)));
    let bits = |film: &Film| film.rows().map(|pixel: [f32; 3]| pixel.map(f32::to_bits)).collect::<Vec<_>>();
    for depth in [0, 1] {
        assert_eq!(bits(&film(depth, None)), bits(&film(depth, Some(1e-9))), "{depth} bounces");
    }
    assert_eq!(bits(&film(9, None)), bits(&film(9, Some(1e9))));
    let (seen, error) = mean(&film(9, Some(1e-9)));
    assert!(error < 2e-3 && (seen - 1.5).abs() < 4.0 * error, "{seen} +- {error}");
}

/// The bill and the metadata of pictures name the clamp; without path tracing there is a warning.
#[test]
fn a_clamp_is_named() {
    let scene = "[image]\nclamp = 2.5\n[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n\
        [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let job = |transport, clamp: Option<f64>| {
        let clamp = clamp.map(Clamp::clamped);
        let settings = PictureSettings { transport, clamp, ..PictureSettings::of_size([8; 2]) }.into();
        let mut warnings = Warnings::default();
        let job = prepare(parse(scene), &settings, &mut warnings).expect("a job");
        (job, warnings.messages().join("\n"))
    };
    let (of_scene, warnings) = job(Some(Transport::Path), None);
    assert_eq!(warnings, "");
    let named = |job: &RenderJob| {
        job.metadata.iter().find(|(key, _)| key == "kiln:clamp").map(|(_, value)| value.clone())
    };
    assert_eq!(named(&of_scene), Some("2.5".into()));
    let path = of_scene.plan.decisions.iter().find(|decision| decision.effect == kiln::effects::id::PATH);
    assert_eq!(path.expect("one of each").why, "the transport is `path`; indirect light is clamped to 2.5");
    let (typed, _) = job(Some(Transport::Path), Some(3.0));
    assert_eq!(named(&typed), Some("3".into()));
    assert_ne!(fingerprint_of(&typed.metadata), fingerprint_of(&of_scene.metadata));
    assert_eq!(job(None, None).1, "a clamp of 2.5 changes nothing without path tracing");
}

/// A pixel depends on its own samples alone.
#[test]
fn crops_have_the_pixels_of_the_whole() {
    let scene = format!("{ROOM}[[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n");
    let whole = render(parse(&scene), &settings(3, 4));
    let crop = Window { x: 7, y: 13, width: 21, height: 9 };
    let part = render(parse(&scene), &RenderSettings { crop: Some(crop), ..settings(3, 4) });
    // A film's pixels are numbered from its own corner.
    for (x, y) in [(0, 0), (13, 4), (20, 8)] {
        let of_whole = whole.pixel(crop.x + x, crop.y + y);
        assert_eq!(of_whole.map(f32::to_bits), part.pixel(x, y).map(f32::to_bits), "{x} {y}");
    }
}

/// White furnace: an object of albedo 1 in a uniform environment of radiance 1 cannot be told from it.
#[test]
fn a_white_object_vanishes_in_a_white_environment() {
    let camera = "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 30\n";
    let scene = format!(
        "{camera}[environment]\ncolour = '#ffffff'\n[material.white]\ncolour = '#ffffff'\n\
         [[sphere]]\nmaterial = 'white'\ncentre = [0, 0, 0]\nradius = 1\n"
    );
    check(&scene, 64, 1, 1.0);
    // Every bounce sees the environment. Hidden, it lights the same, and the background is seen beside the object.
    let hidden = scene.replace("colour = '#ffffff'\n[mat", "colour = '#ffffff'\nhide = true\n[mat");
    let film = render(parse(&hidden), &settings(64, 1));
    assert_eq!(film.pixel(0, 0), [0.0; 3]);
    assert!((f64::from(film.pixel(SIZE / 2, SIZE / 2)[0]) - 1.0).abs() < 0.1);
}

/// The same of a ball of few triangles with the normals of a sphere, in an environment and in a box of lamps 0.03 from
/// the ball: no direction that it reflects in is lost below the horizon of a triangle, and samples of lights and of
/// directions agree on the point that they are taken from.
#[test]
fn a_smooth_white_mesh_vanishes_in_white_light() {
    let ball = format!(
        "[[camera]]\nposition = [1, 1, 1]\nlook_at = [0, 0, 0]\nvertical_fov = 60\n[material.white]\ncolour = '#ffffff'\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n[[mesh]]\nmaterial = 'white'\nfile = '{}'\n",
        repository("scenes/effects/ball-smooth.obj").display()
    );
    check(&format!("{ball}[environment]\ncolour = '#ffffff'\n"), 64, 1000, 1.0);
    let lamps = format!("[[mesh]]\nmaterial = 'lamp'\nscale = 0.515\nfile = '{}'\n", room_file());
    check(&format!("{ball}{lamps}"), 64, 1000, 1.0);
}

/// Whatever calls for it, an environment decides the transport, and `whitted` decides against it.
#[test]
fn an_environment_calls_for_paths() {
    let scene = "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n[environment]\nsky = true\n\
        [[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let traced = |transport| {
        let settings = PictureSettings { transport, ..PictureSettings::of_size([8; 2]) }.into();
        let job = prepare(parse(scene), &settings, &mut Warnings::default()).expect("a job");
        job.plan.effects_on().any(|effect| effect == kiln::effects::id::PATH)
    };
    assert!(traced(None) && traced(Some(Transport::Path)) && !traced(Some(Transport::Whitted)));
}

/// Local shading: the background is the environment, and so is what a perfect mirror shows, also where it is hidden. The
/// pixels besides are the scene's background.
#[test]
fn local_shading_sees_the_environment() {
    let pixel = |hide: bool, x: u32| {
        let scene = format!(
            "[image]\ntransport = 'whitted'\ncolour = 'linear'\nbackground = '#000000'\n\
             [[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 30\n\
             [environment]\ncolour = '#ffffff'\nintensity = 0.5\nhide = {hide}\n[ambient]\nintensity = 0\n\
             [material.mirror]\ncolour = '#000000'\nspecular = 0\nglaze = {{ weight = 1, own_weight = 0 }}\n\
             [[sphere]]\nmaterial = 'mirror'\ncentre = [0, 0, 0]\nradius = 0.5\n"
        );
        let light = Some(kiln::scene::Headlight::None);
        let settings = PictureSettings { light, ..PictureSettings::of_size([9; 2]) }.into();
        let job = prepare(parse(&scene), &settings, &mut Warnings::default()).expect("a job");
        job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture").0.pixel(x, 4)
    };
    assert_eq!([pixel(false, 0), pixel(false, 4)], [[0.5; 3]; 2]);
    assert_eq!([pixel(true, 0), pixel(true, 4)], [[0.0; 3], [0.5; 3]]);
}

/// A ball of a material in a white environment, seen so that it fills most of the picture.
fn furnace(material: &str, environment: &str) -> String {
    format!(
        "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nvertical_fov = 24\n[environment]\ncolour = '{environment}'\n\
         [material.m]\ncolour = '#ffffff'\n{material}\n\
         [[sphere]]\nmaterial = 'm'\ncentre = [0, 0, 0]\nradius = 1\n"
    )
}

/// White furnace: what absorbs nothing cannot be seen. A path in glass needs many bounces inside before it has left.
#[test]
fn glass_and_metal_vanish_in_a_white_environment() {
    let glass = |roughness: f64, ior: f64| {
        format!("roughness = {roughness}\nlayers = {{ transmission = 1, volume = true, ior = {ior} }}")
    };
    for material in [
        "metallic = 1\nroughness = 0".to_owned(),
        "metallic = 1\nroughness = 0.4".into(),
        "metallic = 0\nroughness = 0.3".into(),
        glass(0.0, 1.5),
        glass(0.0, 2.4),
        "roughness = 0\nlayers = { transmission = 1 }".into(),
        "roughness = 0.5\nlayers = { clearcoat = 1 }".into(),
    ] {
        let (mean, error) = mean(&render(parse(&furnace(&material, "#ffffff")), &settings(48, 400)));
        assert!(error < 1e-3 && (mean - 1.0).abs() < 4.0 * error + 2e-3, "{material}: {mean} +- {error}");
    }
}

/// What light meets of nearly smooth glass adds up: a path meets the surface three times on average, and loses less
/// than
/// 0.02 % each time.
#[test]
fn nearly_smooth_glass_loses_nothing() {
    for ior in [1.1, 1.5, 2.4] {
        let material =
            format!("roughness = 0.05\nlayers = {{ transmission = 1, volume = true, ior = {ior} }}");
        let scene = furnace(&material, "#ffffff").replace("vertical_fov = 24", "vertical_fov = 18");
        let (mean, error) = mean(&render(parse(&scene), &settings(64, 1000)));
        assert!(error < 3e-4 && (mean - 1.0).abs() < 4.0 * error + 6e-4, "{ior}: {mean} +- {error}");
    }
}

/// A ball of an absorbing medium without interface (index of refraction 1) of radius 1, seen through its centre: white light
/// loses as much as over the distance 2. The narrow field of view sees chords of at least 1.9999.
#[test]
fn a_medium_attenuates_as_beer_and_lambert_say() {
    let medium = "roughness = 0\nlayers = { transmission = 1, volume = true, ior = 1, attenuation_colour = '#bcbcbc', attenuation_distance = 0.5 }";
    let scene = furnace(medium, "#ffffff").replace("vertical_fov = 24", "vertical_fov = 0.05");
    let (mean, error) = mean(&render(parse(&scene), &settings(4, 20)));
    // 0xbc decodes to 0.5028865; four times the attenuation distance.
    let expected = 0.502_886_5f64.powi(4);
    assert!((mean / expected - 1.0).abs() < 1e-3 && error < 1e-4, "{mean} +- {error}, expected {expected}");
}
