//! Textures of glTF's material extensions, in path tracing, against the same values as factors and against closed
//! forms.

use std::path::PathBuf;

use crate::common::gltf::{Model, png_uri};
use crate::common::picture::parse;
use kiln::error::Warnings;
use kiln::film::Film;
use kiln::job::{RenderControl, RenderJob, prepare};
use kiln::scene::{PictureSettings, Samples, Scene, Transport};
use serde_json::{Value, json};

const SIZE: u32 = 16;

/// A glTF file with one square of corners (-1, -1, 0) and (1, 1, 0) that faces +z, with the images as textures in
/// order, all sampled without interpolation. Texture coordinates begin at the upper left corner. The file stays until
/// the tests end.
pub fn square(material: &Value, images: &[String]) -> PathBuf {
    let mut model = Model::new(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    model.attribute("TEXCOORD_0", &[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    let indices = model.shorts(&[0, 1, 2, 0, 2, 3], "SCALAR", 6);
    (model.primitive()["indices"], model.primitive()["material"]) = (json!(indices), json!(0));
    let used: Vec<&String> =
        material["extensions"].as_object().map(|e| e.keys().collect()).unwrap_or_default();
    let model = model
        .with("extensionsUsed", json!(used))
        .with("materials", json!([material]))
        .with("images", images.iter().map(|uri| json!({ "uri": uri })).collect())
        .with("samplers", json!([{ "magFilter": 9728, "minFilter": 9728 }]))
        .with("textures", (0..images.len()).map(|i| json!({ "source": i, "sampler": 0 })).collect());
    let path = tempfile::tempdir().expect("a folder").keep().join("square.gltf");
    std::fs::write(&path, model.text()).expect("a file");
    path
}

/// A camera along -z that sees the square from corner to corner, and `more`.
fn scene(material: &Value, images: &[String], more: &str) -> Scene {
    parse(&format!(
        "[[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\nprojection = 'orthographic'\nviewing_height = 2\nviewpoint_distance = 5\n{more}\n\
         [[mesh]]\nfile = '{}'\n",
        square(material, images).display()
    ))
}

fn job(scene: Scene, transport: Transport) -> RenderJob {
    job_of(scene, transport, 4)
}

fn job_of(scene: Scene, transport: Transport, samples: u32) -> RenderJob {
    let settings = PictureSettings {
        transport: Some(transport),
        samples: Some(Samples::clamped(samples)),
        filter: Some(kiln::film::FilterShape::Box),
        ..PictureSettings::of_size([SIZE; 2])
    }
    .into();
    prepare(scene, &settings, &mut Warnings::default()).expect("a job")
}

fn render(scene: Scene) -> Film {
    let (film, statistics) =
        job(scene, Transport::Path).render(&RenderControl::default()).expect("a picture");
    assert_eq!(statistics.non_finite, []);
    film
}

fn pixels(film: &Film) -> Vec<[u32; 3]> {
    let places = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
    places.map(|(x, y)| film.pixel(x, y).map(f32::to_bits)).collect()
}

/// The sky from all sides, so that each layer shows.
const SKY: &str = "[environment]\nsky = true\n";

/// A value of a slot: extension, key of the factor, key of the texture, and the texel with which the factor 1 is the
/// same as the other factor.
type Case = (&'static str, &'static str, &'static str, [u8; 4], Value);

/// The decoded value of an 8-bit colour, rounded as textures are.
fn decoded(value: u8) -> f64 {
    f64::from(kiln::film::colour::srgb_decode(f64::from(value) / 255.0) as f32)
}

fn cases() -> Vec<Case> {
    let (half, colour) = (128.0 / 255.0, [200, 90, 30].map(decoded));
    vec![
        ("KHR_materials_specular", "specularFactor", "specularTexture", [9, 8, 7, 128], json!(half)),
        (
            "KHR_materials_specular",
            "specularColorFactor",
            "specularColorTexture",
            [200, 90, 30, 0],
            json!(colour),
        ),
        (
            "KHR_materials_transmission",
            "transmissionFactor",
            "transmissionTexture",
            [128, 3, 4, 5],
            json!(half),
        ),
        ("KHR_materials_clearcoat", "clearcoatFactor", "clearcoatTexture", [128, 3, 4, 5], json!(half)),
        (
            "KHR_materials_clearcoat",
            "clearcoatRoughnessFactor",
            "clearcoatRoughnessTexture",
            [3, 128, 4, 5],
            json!(half),
        ),
        ("KHR_materials_sheen", "sheenColorFactor", "sheenColorTexture", [200, 90, 30, 0], json!(colour)),
        ("KHR_materials_sheen", "sheenRoughnessFactor", "sheenRoughnessTexture", [9, 8, 7, 128], json!(half)),
    ]
}

/// A material in which each layer shows.
fn layered() -> Value {
    json!({
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0.4, "baseColorFactor": [0.5, 0.3, 0.2, 1] },
        "extensions": {
            "KHR_materials_specular": { "specularFactor": 1, "specularColorFactor": [1, 1, 1] },
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatRoughnessFactor": 1 },
            "KHR_materials_sheen": { "sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 1 },
        },
    })
}

/// A texture of one value gives the bits of that value as the factor: the product is the same, with the channel and
/// encoding of the extension. It differs from the picture without.
#[test]
fn a_texture_of_one_value_is_a_factor() {
    let plain = pixels(&render(scene(&layered(), &[], SKY)));
    for (extension, factor, texture, texel, value) in cases() {
        let mut by_texture = layered();
        by_texture["extensions"][extension][texture] = json!({ "index": 0 });
        let image = png_uri(2, &[texel; 4]);
        let mut by_factor = layered();
        by_factor["extensions"][extension][factor] = value;
        let textured = pixels(&render(scene(&by_texture, &[image], SKY)));
        assert_eq!(textured, pixels(&render(scene(&by_factor, &[], SKY))), "{texture}");
        assert_ne!(textured, plain, "{texture} shows");
    }
}

/// A thin wall without interface (index of refraction 1) before a lamp of radiance 1, and nothing else: where the
/// texture of the transmission is 0, it is white paper that no light reaches; where it is 1, the lamp is seen as if
/// there were nothing.
#[test]
fn transmission_by_halves() {
    let material = json!({
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0 },
        "extensions": {
            "KHR_materials_ior": { "ior": 1 },
            "KHR_materials_transmission": { "transmissionFactor": 1, "transmissionTexture": { "index": 0 } },
        },
    });
    let image = png_uri(2, &[[0, 255, 255, 255], [255, 0, 0, 0]]);
    let lamp = "[material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n[[triangles]]\nmaterial = 'lamp'\n\
        vertices = [[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]]\nindices = [[0, 1, 2], [0, 2, 3]]\n";
    let film = render(scene(&material, &[image], lamp));
    for y in 0..SIZE {
        assert!((0..SIZE / 2).all(|x| film.pixel(x, y) == [0.0; 3]), "row {y}: the paper is dark");
        assert!((SIZE / 2..SIZE).all(|x| film.pixel(x, y) == [1.0; 3]), "row {y}: the lamp is seen");
    }
}

/// White furnace: a diffuse white base under layers whose weights vary from texel to texel. Layers are scaled so that
/// nothing is gained; with the weights 0 and 1 in a checker, no pixel may be brighter than the environment.
#[test]
fn layers_by_texture_gain_nothing() {
    let mut material = layered();
    material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, 1]);
    for (extension, _, texture, ..) in cases() {
        material["extensions"][extension][texture] = json!({ "index": 0 });
    }
    let texels: Vec<[u8; 4]> =
        (0..64).map(|i| if (i + i / 8) % 2 == 0 { [255; 4] } else { [0; 4] }).collect();
    let film = render(scene(&material, &[png_uri(8, &texels)], "[environment]\ncolour = '#ffffff'\n"));
    let mean = (0..SIZE * SIZE).map(|i| f64::from(film.pixel(i % SIZE, i / SIZE)[1])).sum::<f64>();
    let mean = mean / f64::from(SIZE * SIZE);
    // Samples of 0 to some 2 in 1024 pixels and samples: a standard error below 0.02.
    assert!(mean > 0.8 && mean < 1.06, "{mean}");
}

/// Local shading has no layers: it looks none of their textures up.
#[test]
fn local_shading_pays_nothing_for_textures_of_layers() {
    let mut material = layered();
    material["extensions"]["KHR_materials_clearcoat"]["clearcoatTexture"] = json!({ "index": 0 });
    let image = png_uri(1, &[[0; 4]]);
    let on = |transport| {
        let job = job(scene(&material, std::slice::from_ref(&image), ""), transport);
        job.plan.effects_on().any(|effect| effect == kiln::effects::id::TEXTURES)
    };
    assert!(on(Transport::Path) && !on(Transport::Whitted));
}

/// Local shading multiplies the ambient light by 1 + strength (texel - 1), and nothing else; path tracing does not look
/// it up. A square of white metal, f0 = 1, under an ambient light of 1/2 alone is 1/2 times that; the light of a lamp
/// is added whole.
#[test]
fn occlusion_attenuates_the_ambient_light() {
    let image = png_uri(2, &[[0, 255, 255, 255], [51, 0, 0, 255]]);
    for (strength, lamp, expected) in [
        (1.0, false, [0.0, 0.1]),
        (0.5, false, [0.25, 0.3]),
        // A diffuse white square would return 1 of the lamp; metal as rough as 1 returns F0 / 4, see
        // `metallic_roughness`.
        (1.0, true, [0.25, 0.35]),
    ] {
        let material = json!({ "occlusionTexture": { "index": 0, "strength": strength } });
        let lamp = if lamp { "[[light]]\ntype = 'directional'\ndirection = [0, 0, -1]\n" } else { "" };
        let more = format!("[ambient]\nintensity = 0.5\n[image]\nheadlight = false\n{lamp}");
        let scene = || scene(&material, std::slice::from_ref(&image), &more);
        let whitted = job(scene(), Transport::Whitted);
        let (film, _): (Film, _) = whitted.render(&RenderControl::default()).expect("a picture");
        for (x, expected) in [(2, expected[0]), (SIZE - 2, expected[1])] {
            let [red, ..] = film.pixel(x, SIZE / 2).map(f64::from);
            assert!((red - expected).abs() < 1e-6, "strength {strength}: {red}, expected {expected}");
        }
        let path = job(scene(), Transport::Path);
        assert!(path.plan.effects_on().all(|effect| effect != kiln::effects::id::TEXTURES));
    }
}

/// Specular-glossiness: the reflectance at normal incidence is `specular`, in both transports. A smooth square seen
/// straight on mirrors s of a uniform environment of 1, and its diffuse part d is scaled by 1 - max(s): s + d (1 -
/// max(s)). Path tracing estimates it from 128 pixels of 256 samples, whose standard deviation is below 0.3: a standard
/// error below 0.002. Local shading under an ambient light of 1/2 shows half of that. Specular colours by texture are
/// decoded from sRGB: 255 is 1 and 0 is 0.
#[test]
fn specular_glossiness_has_its_reflectance() {
    let image = png_uri(2, &[[255, 255, 255, 255], [0, 0, 0, 255]]);
    for (diffuse, specular) in [(0.0, 0.7), (0.5, 0.04), (0.5, 0.5), (1.0, 0.3), (0.8, 1.0)] {
        let material = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [diffuse, diffuse, diffuse, 1], "specularFactor": [specular, specular, specular],
            "glossinessFactor": 1, "specularGlossinessTexture": { "index": 0 },
        } } });
        for (transport, factor, slack, more) in [
            (Transport::Path, 1.0, 6e-3, "[environment]\ncolour = '#ffffff'\n"),
            (Transport::Whitted, 0.5, 1e-6, "[ambient]\nintensity = 0.5\n[image]\nheadlight = false\n"),
        ] {
            let job = job_of(scene(&material, std::slice::from_ref(&image), more), transport, 256);
            let (film, _): (Film, _) = job.render(&RenderControl::default()).expect("a picture");
            let half = SIZE / 2;
            for (first, s) in [(0, specular), (half, 0.0)] {
                let pixels = (0..SIZE).flat_map(|y| (first..first + half).map(move |x| (x, y)));
                let sum: f64 = pixels.map(|(x, y)| f64::from(film.pixel(x, y)[0])).sum();
                let (mean, expected) = (sum / f64::from(SIZE * half), factor * (s + diffuse * (1.0 - s)));
                assert!((mean - expected).abs() < slack, "{diffuse} {s}: {mean}, expected {expected}");
            }
        }
    }
}

/// The variances of the brightness of a square along x and y, lit by a small lamp in front of its centre.
fn spread_of_highlight(material: &Value, images: &[String], transport: Transport) -> [f64; 2] {
    let kind = if transport == Transport::Path { "'sphere'\nradius = 0.1" } else { "'point'" };
    let lamp = format!("[[light]]\ntype = {kind}\nposition = [0, 0, 2]\nintensity = 1");
    let more = format!("[image]\nheadlight = false\n[ambient]\nintensity = 0\n{lamp}");
    let job = job_of(scene(material, images, &more), transport, 64);
    let (film, _): (Film, _) = job.render(&RenderControl::default()).expect("a picture");
    let (mut sum, mut variances) = (0.0, [0.0; 2]);
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let value = f64::from(film.pixel(x, y)[1]);
        sum += value;
        let from_centre = [x, y].map(|at| f64::from(at) + 0.5 - f64::from(SIZE) / 2.0);
        (0..2).for_each(|axis| variances[axis] += value * from_centre[axis].powi(2));
    }
    variances.map(|variance| variance / sum)
}

/// The highlight of brushed metal is longer along the tangent, here x, than across. Rotation and texture turn the
/// direction and add up, from the tangent towards the bitangent, against v, which is y here: a quarter of a turn
/// exchanges the axes, and two of them, in either direction, change nothing. Without strength, or where its texel is 0,
/// both are alike.
#[test]
fn highlights_of_anisotropic_metal_follow_its_direction() {
    for transport in [Transport::Path, Transport::Whitted] {
        highlights_follow_their_direction(transport);
    }
}

fn highlights_follow_their_direction(transport: Transport) {
    let spread = |strength: f64, rotation: f64, texel: Option<[u8; 4]>| {
        let mut anisotropy = json!({ "anisotropyStrength": strength, "anisotropyRotation": rotation });
        if texel.is_some() {
            anisotropy["anisotropyTexture"] = json!({ "index": 0 });
        }
        let material = json!({
            "pbrMetallicRoughness": { "metallicFactor": 1, "roughnessFactor": 0.4 },
            "extensions": { "KHR_materials_anisotropy": anisotropy },
        });
        let images: Vec<String> = texel.map(|texel| png_uri(1, &[texel])).into_iter().collect();
        let [x, y] = spread_of_highlight(&material, &images, transport);
        x / y
    };
    let along = spread(0.5, 0.0, None);
    assert!(along > 1.5, "{along}");
    let quarter = std::f64::consts::FRAC_PI_2;
    let (right, up, none) = ([255, 128, 255, 255], [128, 255, 255, 255], [255, 128, 0, 255]);
    for (turns, rotation, texel) in [
        (1, quarter, None),
        (1, -quarter, None),
        (2, 2.0 * quarter, None),
        (0, 0.0, Some(right)),
        (1, 0.0, Some(up)),
        (2, quarter, Some(up)),
        (2, -quarter, Some(up)),
    ] {
        let ratio = spread(0.5, rotation, texel);
        let expected = if turns % 2 == 0 { along } else { 1.0 / along };
        assert!((ratio / expected - 1.0).abs() < 0.1, "{turns}, {rotation}, {texel:?}: {ratio}, {expected}");
    }
    for ratio in [spread(0.0, 0.0, None), spread(0.5, 0.0, Some(none))] {
        assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    }
}
