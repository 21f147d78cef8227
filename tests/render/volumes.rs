//! Volumes in path tracing against closed forms: mirrored glass, media that absorb light on its way to what is inside,
//! nested and overlapping volumes, cameras and lights in a medium.

use std::path::PathBuf;

use crate::common::gltf::Model;
use crate::common::picture::parse;
use crate::path::{check, check_settings, mean, render, settings};
use kiln::effects::{LightTechnique, PlanSettings};
use kiln::error::Warnings;
use kiln::job::{RenderControl, prepare};
use kiln::scene::Numerics;
use serde_json::json;

/// The linear value of #808080, what the volumes below let through over the distance 1.
const GREY: f64 = 0.215_860_5;

/// The reflectance of an interface between the indices `a` and `b` seen straight on.
fn fresnel(a: f64, b: f64) -> f64 {
    ((a - b) / (a + b)).powi(2)
}

/// The corners of a box, and its triangles counterclockwise seen from outside.
fn box_of(low: [f64; 3], high: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

/// A box in a scene file.
fn box_in(material: &str, low: [f64; 3], high: [f64; 3]) -> String {
    let (vertices, indices) = box_of(low, high);
    format!("[[triangles]]\nmaterial = '{material}'\nvertices = {vertices:?}\nindices = {indices:?}\n")
}

/// The material of a smooth volume that absorbs 1 - [`GREY`] over a distance.
fn volume(name: &str, ior: f64, distance: f64) -> String {
    format!(
        "[material.{name}]\ncolour = '#ffffff'\nroughness = 0\nlayers = {{ transmission = 1, volume = true, \
         ior = {ior}, attenuation_colour = '#808080', attenuation_distance = {distance:e} }}\n"
    )
}

/// A camera that looks at the origin in nearly one direction, in an environment.
fn seen_from(position: [f64; 3], environment: &str) -> String {
    format!(
        "[[camera]]\nposition = {position:?}\nlook_at = [0, 0, 0]\nvertical_fov = 0.01\n\
         [environment]\ncolour = '{environment}'\n"
    )
}

/// A cube from -1 to 1 as an OBJ file with the material `name` of `library`, in a folder that stays until the tests
/// end.
fn cube_file(library: &str) -> PathBuf {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let (vertices, triangles) = box_of([-1.0; 3], [1.0; 3]);
    let vertices: String = vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces: String =
        triangles.iter().map(|t| t.map(|i| i + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
    std::fs::write(folder.join("cube.mtl"), library).expect("a file");
    let head = if library.is_empty() { "" } else { "mtllib cube.mtl\nusemtl glass\n" };
    std::fs::write(folder.join("cube.obj"), format!("{head}{vertices}{faces}")).expect("a file");
    folder.join("cube.obj")
}

/// A glTF file of that cube in a material of glass that absorbs, placed by the nodes of a scene.
fn cube_gltf(nodes: &serde_json::Value) -> PathBuf {
    let (vertices, triangles) = box_of([-1.0; 3], [1.0; 3]);
    let vertices: Vec<[f32; 3]> = vertices.iter().map(|v| v.map(|c| c as f32)).collect();
    let corners: Vec<u16> = triangles.as_flattened().iter().map(|&i| i as u16).collect();
    let mut model = Model::new(&vertices);
    let indices = model.shorts(&corners, "SCALAR", corners.len());
    (model.primitive()["indices"], model.primitive()["material"]) = (json!(indices), json!(0));
    let material = json!({
        "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0 },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 1,
                "attenuationColor": [GREY, GREY, GREY] },
        },
    });
    let model = model
        .with("nodes", nodes.clone())
        .with("extensionsUsed", json!(["KHR_materials_transmission", "KHR_materials_volume"]))
        .with("materials", json!([material]));
    let path = tempfile::tempdir().expect("a folder").keep().join("cube.gltf");
    std::fs::write(&path, model.text()).expect("a file");
    path
}

/// What a slab of index 1.5 that lets `a` through shows of a white environment, seen straight on: with F = 0.04 at
/// either side, F + (1 - F)^2 F a^2 / (1 - F^2 a^2) is reflected and (1 - F)^2 a / (1 - F^2 a^2) transmitted.
fn slab(a: f64) -> f64 {
    let f = fresnel(1.0, 1.5);
    let inside = (1.0 - f).powi(2) / (1.0 - (f * a).powi(2));
    f + inside * f * a * a + inside * a
}

/// A cube of side 2 of glass that absorbs looks the same in a mirror: its front is where the corners of its triangles
/// are seen clockwise (glTF 2.0, section 3.7.4).
#[test]
fn mirrored_volumes_have_their_outside_outside() {
    let expected = slab(GREY * GREY);
    assert!((expected - 0.08302).abs() < 1e-5, "{expected}");
    let head = seen_from([0.2, 0.1, 9.0], "#ffffff");
    let file = cube_file("").display().to_string();
    let glass = volume("glass", 1.5, 1.0);
    for scale in ["1", "-1", "[-1, 1, 1]", "[-1, -1, 1]"] {
        let cube = format!("{head}{glass}[[mesh]]\nmaterial = 'glass'\nfile = '{file}'\nscale = {scale}\n");
        check(&cube, 64, 40, expected);
        // Instances of one mesh, of which one is seen.
        let placed = format!(
            "{head}{glass}[[mesh]]\nmaterial = 'glass'\nfile = '{file}'\n\
             placements = [{{ scale = {scale} }}, {{ translate = [90, 0, 0], scale = {scale} }}]\n"
        );
        check(&placed, 64, 40, expected);
    }
    for nodes in [
        json!([{ "mesh": 0, "scale": [-1, 1, 1] }]),
        json!([{ "mesh": 0, "matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1] }]),
        json!([{ "children": [1], "scale": [-1, 1, 1] }, { "mesh": 0, "scale": [1, -1, 1] }]),
        json!([{ "children": [1, 2], "scale": [-1, 1, 1] }, { "mesh": 0 }, { "mesh": 0, "translation": [90, 0, 0] }]),
    ] {
        check(&format!("{head}[[mesh]]\nfile = '{}'\n", cube_gltf(&nodes).display()), 64, 40, expected);
    }
}

/// Glass of MTL that filters by t, as a wide plate seen at 60 degrees from its normal, in a white environment: F is
/// reflected, and of what enters, (1 - F) t, all leaves by either side and is filtered again: F + (1 - F) t^2. F is
/// Fresnel's reflectance at an index of 1.5; from the denser side the angle would be beyond total reflection.
#[test]
fn mirrored_glass_of_mtl_has_its_outside_outside() {
    let (cos, n) = (0.5f64, 1.5f64);
    let refracted = (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
    let s = (cos - n * refracted) / (cos + n * refracted);
    let p = (n * cos - refracted) / (n * cos + refracted);
    let f = (s * s + p * p) / 2.0;
    let file = cube_file("newmtl glass\nKd 1 0 0\nillum 7\nNi 1.5\nTf 0.5 0.5 0.5\n").display().to_string();
    for scale in ["[99, 1, 99]", "[-99, 1, 99]", "[99, -1, 99]"] {
        let head = seen_from([3f64.sqrt() * 9.0, 9.0, 0.0], "#ffffff");
        let plate = format!("{head}[[mesh]]\nfile = '{file}'\nscale = {scale}\n");
        check(&plate, 256, 40, f + (1.0 - f) * 0.25);
    }
}

/// A ball of radius 1 without interface that absorbs, around another of radius 1/2: light passes 1/2 on its way in, a
/// factor of sqrt(GREY), and as much on its way out. The inner ball emits 1, is a mirror, or is clear and replaces the
/// medium.
#[test]
fn a_medium_absorbs_light_on_its_way_to_what_is_inside() {
    for (inner, environment, expected) in [
        ("colour = '#000000'\nemission = '#ffffff'", "#000000", GREY.sqrt()),
        ("metallic = 1\nroughness = 0\ncolour = '#ffffff'", "#ffffff", GREY),
        (
            "colour = '#ffffff'\nroughness = 0\nlayers = { transmission = 1, volume = true, ior = 1 }",
            "#ffffff",
            GREY,
        ),
    ] {
        let scene = format!(
            "{}{}[material.inner]\n{inner}\n[[sphere]]\nmaterial = 'outer'\ncentre = [0, 0, 0]\nradius = 1\n\
             [[sphere]]\nmaterial = 'inner'\ncentre = [0, 0, 0]\nradius = 0.5\n",
            seen_from([0.0, 0.0, 5.0], environment),
            volume("outer", 1.0, 1.0)
        );
        for numerics in Numerics::ALL {
            let own = settings(16, 20);
            let settings = crate::common::picture::changed(own, |picture| picture.numerics = Some(numerics));
            check_settings(&scene, &settings, expected);
        }
    }
}

/// A camera in a medium looks through it: at a white environment, at an emissive ball beside the centre, and out of the
/// inner of two media. The camera stands at z = 2.5, in the ball of radius 3 around the origin, and looks along -z.
#[test]
fn cameras_stand_in_media() {
    let ball = |material: &str, centre: f64, radius: f64| {
        format!("[[sphere]]\nmaterial = '{material}'\ncentre = [0, 0, {centre}]\nradius = {radius}\n")
    };
    let head = |environment| seen_from([0.0, 0.0, 2.5], environment) + &volume("outer", 1.0, 4.0);
    let outer = |environment| head(environment) + &ball("outer", 0.0, 3.0);
    let over = |distance: f64| GREY.powf(distance / 4.0);
    check(&outer("#ffffff"), 16, 20, over(5.5));
    let lamp = "[material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n";
    check(&format!("{}{lamp}{}", outer("#000000"), ball("lamp", 0.0, 0.5)), 16, 20, over(2.0));
    // In the inner one, of half the distance, from z = 2.5 to 1.5.
    let inner = volume("inner", 1.0, 2.0) + &ball("inner", 2.0, 0.5);
    check(&format!("{}{inner}{lamp}{}", outer("#000000"), ball("lamp", 0.0, 0.5)), 16, 20, over(3.0));
    // The same where each ray has an origin of its own.
    let parallel = outer("#ffffff").replace(
        "vertical_fov = 0.01",
        "projection = 'orthographic'\nviewing_height = 0.001\nviewpoint_distance = 1",
    );
    check(&parallel, 16, 20, over(5.5));
    // A camera between two balls is in neither, and sees one of them.
    let beside = format!("{}{}{}", head("#ffffff"), ball("outer", 0.0, 1.0), ball("outer", 9.0, 1.0));
    check(&beside, 16, 20, over(2.0));
}

/// A floor in a medium, under a lamp in it and seen from outside. The camera's ray runs 3 through the medium. The point
/// light without falloff, of intensity 1 at (0, 0.8, 0.6), is at the distance 1 and the cosine 0.8. The sphere of
/// radiance 5 and radius 1/2 stands 1.5 above: light comes from a cone of sine 1/3 and runs 1.5 cos - sqrt(1/4 - 1.5^2
/// sin^2).
#[test]
fn shadow_rays_run_through_media() {
    // The direction of the camera's ray is (0.8, 0.6, 0), so it enters the top of the box at 3 * 0.6 = 1.8.
    let scene = format!(
        "{}{}[material.floor]\ncolour = '#ffffff'\n[material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n\
         emission_intensity = 5\n{}\
         [[triangles]]\nmaterial = 'floor'\nvertices = [[-7, 0, -7], [7, 0, -7], [0, 0, 7]]\n",
        seen_from([40.0, 30.0, 0.0], "#000000"),
        volume("outer", 1.0, 1.5),
        box_in("outer", [-9.0, -1.0, -9.0], [9.0, 1.8, 9.0]),
    );
    let over = |distance: f64| GREY.powf(distance / 1.5);
    let point = "[[light]]\ntype = 'point'\nposition = [0, 0.8, 0.6]\n";
    check(&format!("{scene}{point}"), 16, 4, 0.8 * over(4.0));
    // Above the medium it lights nothing: shadow rays do not pass interfaces.
    let outside = "[[light]]\ntype = 'point'\nposition = [0, 4, 3]\n";
    assert_eq!(mean(&render(parse(&format!("{scene}{outside}")), &settings(4, 4))).0, 0.0);

    let count = 20_000;
    let expected: f64 = (0..count)
        .map(|i| {
            let sin2 = (f64::from(i) + 0.5) / f64::from(count) / 9.0;
            let distance = 1.5 * (1.0 - sin2).sqrt() - (0.25 - 2.25 * sin2).sqrt();
            // The integral of L T cos / pi over solid angles is that of L T over the squared sine.
            5.0 * over(distance + 3.0) / 9.0 / f64::from(count)
        })
        .sum();
    let sphere = format!("{scene}[[sphere]]\nmaterial = 'lamp'\ncentre = [0, 1.5, 0]\nradius = 0.5\n");
    // The sphere's top is above the box; what is seen of it from the floor is not.
    let highest: f64 = 1.5 - 0.5 / 3.0;
    assert!(highest < 1.8);
    let job = prepare(parse(&sphere), &settings(256, 4), &mut Warnings::default()).expect("a job");
    for technique in [LightTechnique::Both, LightTechnique::BsdfSamples, LightTechnique::LightSamples] {
        let plan_settings = PlanSettings { light_technique: technique, ..job.plan_settings.clone() };
        let job = job.with_plan_settings(plan_settings).expect("the job with another technique");
        let (film, _) = job.render(&RenderControl::default()).expect("a picture");
        let (mean, error) = mean(&film);
        assert!(error < 0.01 * expected, "{technique:?}: {error}");
        assert!(
            (mean - expected).abs() < 4.0 * error,
            "{technique:?}: {mean} +- {error}, expected {expected}"
        );
    }
}

/// An opaque body of glass, seen straight on through a plate of index n around it: F of the plate is reflected, and of
/// what enters, G at the inner interface between both indices, some of it again at the plate: F + (1 - F)^2 G / (1 - F
/// G).
#[test]
fn nested_interfaces_have_the_relative_index() {
    for (outer, inner) in [(1.5, 2.0), (1.5, 1.5), (1.5, 1.0), (2.0, 1.5), (1.0, 1.5)] {
        let (f, g) = (fresnel(1.0, outer), fresnel(outer, inner));
        let plate = volume("outer", outer, 1e30) + &volume("inner", inner, 1e-3);
        let scene = format!(
            "{}{plate}{}{}",
            seen_from([0.2, 0.1, 9.0], "#ffffff"),
            box_in("outer", [-2.0, -2.0, -2.0], [2.0; 3]),
            box_in("inner", [-1.0, -1.0, -1.0], [1.0; 3])
        );
        let expected = f + (1.0 - f).powi(2) * g / (1.0 - f * g);
        let samples = if expected < 0.05 { 1024 } else { 512 };
        check(&scene, samples, 40, expected);
    }
}

/// Two plates that overlap, 4 and 2 thick, of the index 1.5: the smaller one takes the place of the other, whichever is
/// seen first. Light runs 2 through each, without an interface between. Two boxes of one object are one volume.
#[test]
fn overlapping_volumes_are_the_same_from_both_sides() {
    let large = box_in("large", [-3.0, -3.0, -3.0], [3.0, 3.0, 1.0]);
    let small = box_in("small", [-2.0, -2.0, -1.0], [2.0, 2.0, 1.5]);
    let materials = volume("large", 1.5, 4.0) + &volume("small", 1.5, 2.5);
    // From z = -3 to -1, then 2.5 to 1.5.
    let through = GREY.powf(2.0 / 4.0) * GREY;
    for z in [9.0, -9.0] {
        for objects in [[&large, &small], [&small, &large]] {
            let scene =
                format!("{}{materials}{}{}", seen_from([0.2, 0.1, z], "#ffffff"), objects[0], objects[1]);
            check(&scene, 64, 40, slab(through));
        }
    }
    let ((mut vertices, mut indices), (more, of_more)) =
        (box_of([-3.0, -3.0, -3.0], [3.0, 3.0, 1.0]), box_of([-2.0, -2.0, -1.0], [2.0, 2.0, 1.5]));
    indices.extend(of_more.iter().map(|t| t.map(|i| i + vertices.len())));
    vertices.extend(more);
    let both = format!("[[triangles]]\nmaterial = 'large'\nvertices = {vertices:?}\nindices = {indices:?}\n");
    for z in [9.0, -9.0] {
        let scene = format!("{}{materials}{both}", seen_from([0.2, 0.1, z], "#ffffff"));
        check(&scene, 64, 40, slab(GREY.powf(4.5 / 4.0)));
    }
}

/// A sheet that is not closed holds nothing: what is beyond its box is seen without absorption.
#[test]
fn open_sheets_hold_nothing() {
    let scene = format!(
        "{}{}[material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\n\
         [[triangles]]\nmaterial = 'sheet'\nvertices = [[-9, -9, 1], [9, -9, 1], [0, 9, 1]]\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-9, -9, -1], [9, -9, -1], [0, 9, -1]]\n",
        seen_from([0.2, 0.1, 9.0], "#ffffff"),
        volume("sheet", 1.0, 1.0)
    );
    check(&scene, 4, 20, 1.0);
}

/// A medium of index 1 that absorbs nothing changes nothing of what is inside. Two bounces more pass its surface.
#[test]
fn a_clear_medium_changes_nothing() {
    let body = "[material.body]\ncolour = '#c08040'\nmetallic = 0\nroughness = 0.4\n\
        [[sphere]]\nmaterial = 'body'\ncentre = [0, 0, 0]\nradius = 0.5\n";
    let head = seen_from([0.0, 0.0, 5.0], "#ffffff").replace("vertical_fov = 0.01", "vertical_fov = 9");
    let (bare, error) = mean(&render(parse(&format!("{head}{body}")), &settings(64, 12)));
    let around = format!(
        "{head}{body}{}[[sphere]]\nmaterial = 'clear'\ncentre = [0, 0, 0]\nradius = 1\n",
        volume("clear", 1.0, 1e30)
    );
    let (inside, of_inside) = mean(&render(parse(&around), &settings(64, 14)));
    let slack = 4.0 * error.hypot(of_inside);
    assert!(slack < 0.02 * bare && (bare - inside).abs() < slack, "{bare} {inside} +- {slack}");
}
