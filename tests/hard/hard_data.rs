//! Hard data: NaN, infinite and extreme numbers, faces without area, duplicates, needles. What cannot be drawn is left
//! out with a warning, and everything else is drawn as without it.
//!
//! Sizes, positions and transforms are tested in `hard_transforms.rs`.

use crate::common;
use crate::common::Numbers;
use crate::common::borders::{CUBE, Folder, TIGHT, camera, films, scene, sound};
use crate::common::gltf::Model;
use crate::common::picture::{bits, equip, prepare};
use glam::DVec3;
use kiln::bvh::detail::Layout;
use kiln::bvh::{Hit, Ray, Traversal};
use kiln::film::ColourPipeline;
use kiln::scene::{Numerics, Projection, Scene};
use kiln::world::World;
use serde_json::json;

const SIZE: [u32; 2] = [16, 16];

/// The corners of the unit cube's triangles, one after the other.
fn cube() -> Vec<[f32; 3]> {
    let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| bit as f32);
    let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles = sides.into_iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]);
    triangles.map(corner).collect()
}

/// An OBJ file of triangles that share no vertices; coordinates are given as text.
fn obj(corners: &[[String; 3]]) -> String {
    let vertices: String = corners.iter().map(|c| format!("v {}\n", c.join(" "))).collect();
    let faces = (0..corners.len() / 3).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3));
    vertices + &faces.collect::<String>()
}

fn words(corners: &[[f32; 3]]) -> Vec<[String; 3]> {
    corners.iter().map(|c| c.map(|x| x.to_string())).collect()
}

/// The bits of a scene's pixels in every tier, with a fitted camera and light.
#[track_caller]
fn all_bits(scene: &Scene) -> Vec<Vec<[u32; 3]>> {
    films(scene, SIZE).iter().map(|film| bits(film, SIZE)).collect()
}

/// The primitive and the bits of the distance of every hit of a scene, for every preset and for brute force.
fn hits_by_every_structure(scene: &Scene) -> Vec<Vec<Option<(u32, u64)>>> {
    let mut scene = scene.clone();
    equip(&mut scene);
    let rays = prepare(scene.clone(), SIZE, Numerics::Watertight).rays();
    let structures = Layout::trees().chain([Layout::BruteForce]);
    let answers = structures.map(|structure| {
        let world = World::prepare(scene.clone(), ColourPipeline::Linear, structure, Numerics::Watertight);
        let mut traversal = Traversal::default();
        let mut hit = |ray| world.accelerator.closest_hit(ray, &mut traversal);
        rays.iter().map(|ray| hit(ray).map(|hit| (hit.prim.0, hit.t.to_bits()))).collect()
    });
    answers.collect()
}

const NOT_FINITE: &str = "left out 1 triangle(s) with a vertex that is not a finite number";
const TOO_LARGE: &str = "left out 1 primitive(s) with a coordinate beyond 1e18";

#[test]
fn i1_a_bad_number_in_an_obj_costs_its_triangle_and_nothing_else() {
    // The unit cube and one more triangle, the last, with a bad number in each of its nine coordinates in turn.
    let (good, _) = Folder::new().load("a.obj", obj(&words(&cube())));
    let (picture, hits) = (all_bits(&good), hits_by_every_structure(&good));
    for (bad, warning) in [
        ("nan", NOT_FINITE),
        ("-NaN", NOT_FINITE),
        ("inf", NOT_FINITE),
        ("-inf", NOT_FINITE),
        ("1e400", NOT_FINITE),
        ("1e39", TOO_LARGE),
        ("-1e19", TOO_LARGE),
        ("3e38", TOO_LARGE),
        ("1.0000001e18", TOO_LARGE),
    ] {
        for place in 0..9 {
            let mut corners = words(&cube());
            corners.extend(words(&[[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]]));
            corners[36 + place / 3][place % 3] = bad.into();
            let (scene, warnings) = Folder::new().load("a.obj", obj(&corners));
            assert_eq!(warnings, [format!("a.obj: {warning}")], "{bad}");
            assert!(all_bits(&scene) == picture, "{bad} in place {place}");
            assert!(hits_by_every_structure(&scene) == hits, "{bad} in place {place}");
        }
    }
}

#[test]
fn i1_a_bad_number_in_a_gltf_costs_its_triangle_and_nothing_else() {
    // The same in a binary file, whose stated bounds of positions are wrong, too.
    let (good, _) = Folder::new().load("a.glb", Model::new(&cube()).binary());
    let picture = all_bits(&good);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e19, -1e19, 3e38, -3e38] {
        let warning = if bad.is_finite() { TOO_LARGE } else { NOT_FINITE };
        for place in 0..9 {
            let mut corners = cube();
            corners.extend([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]]);
            corners[36 + place / 3][place % 3] = bad;
            let (scene, warnings) = Folder::new().load("a.glb", Model::new(&corners).binary());
            assert_eq!(warnings, [format!("a.glb: {warning}")], "{bad}");
            assert!(all_bits(&scene) == picture, "{bad} in place {place}");
        }
    }
}

#[test]
fn i1_a_bad_number_leaves_the_cameras_of_its_file_where_they_are() {
    // A camera at a distance of 4 from the cube; the picture is the same with and without a bad triangle beside the
    // cube.
    let with_camera = |corners: &[[f32; 3]]| {
        let mut model = Model::new(corners);
        model.json["scenes"][0]["nodes"] = json!([0, 1]);
        model.json["nodes"] = json!([{ "mesh": 0 }, { "camera": 0, "translation": [0.5, 0.5, 5] }]);
        model.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 1 } }]);
        Folder::new().load("a.glb", model.binary()).0
    };
    let picture = all_bits(&with_camera(&cube()));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38] {
        for place in 0..9 {
            let mut corners = cube();
            corners.extend([[0.0, 0.0, -3.0], [1.0, 0.0, -3.0], [0.0, 1.0, -3.0]]);
            corners[36 + place / 3][place % 3] = bad;
            assert!(all_bits(&with_camera(&corners)) == picture, "{bad} in place {place}");
        }
    }
}

#[test]
fn i1_attributes_that_are_no_numbers_are_as_good_as_none() {
    // Normals, texture coordinates and colours of a cube, each with one bad number. The vertex then has no normal, the
    // texture coordinate of a mesh without texture, or white: the picture is that of the cube without attributes.
    let picture = all_bits(&Folder::new().load("a.glb", Model::new(&cube()).binary()).0);
    let warning =
        "a.glb: left out 36 normal(s), texture coordinate(s) or colour(s) that are not usable numbers";
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for (name, good) in [("NORMAL", [0.6, 0.0, 0.8]), ("COLOR_0", [0.5; 3])] {
            for place in 0..3 {
                let mut value = good;
                value[place] = bad;
                let mut model = Model::new(&cube());
                model.attribute(name, &[value; 36]);
                let (scene, warnings) = Folder::new().load("a.glb", model.binary());
                assert_eq!(warnings, [warning], "{name} {bad}");
                assert!(all_bits(&scene) == picture, "{name} {bad}");
            }
        }
        let mut model = Model::new(&cube());
        model.attribute("TEXCOORD_0", &[[0.5, bad]; 36]);
        let (scene, warnings) = Folder::new().load("a.glb", model.binary());
        assert_eq!(warnings, [warning]);
        assert!(all_bits(&scene) == picture);
    }
    // A negative colour, and one whose linear value exceeds f32: 1e30 to the power of 2.4.
    for (line, kind) in
        [("v 0 0 0 -1 0 0", "negative"), ("v 0 0 0 1e30 0 0", "too bright"), ("v 0 0 0 nan 0 0", "")]
    {
        let text = format!("{line}\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nf 1 2 3\n");
        let (scene, warnings) = Folder::new().load("a.obj", text);
        assert_eq!(warnings, [warning.replace("a.glb", "a.obj").replace("36", "1")], "{kind}");
        films(&scene, SIZE);
    }
}

#[test]
fn i1_texture_coordinates_of_any_size_find_a_pixel() {
    // Coordinates at the ends of f32 and beyond, with a texture that repeats.
    let folder = Folder::new();
    folder.write("four.png", std::fs::read(common::repository("assets/import/four.png")).expect("a picture"));
    folder.write("a.mtl", "newmtl a\nKd 1 1 1\nmap_Kd four.png\n");
    for u in ["0", "-0.25", "1e10", "-1e19", "3e38", "1e39", "1e300", "nan", "inf", "1e-300"] {
        let text = format!(
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt {u} 0\nvt 0 {u}\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\n"
        );
        films(&folder.load("a.obj", text).0, SIZE);
    }
}

#[test]
fn i1_materials_of_absurd_numbers_are_left_out_or_drawn() {
    // Each statement of an MTL file with numbers at the ends of f64, NaN, or negative ones.
    let folder = Folder::new();
    for key in ["Kd", "Ks", "Ke", "Ns", "Pr", "Pm", "d"] {
        for value in ["1e308", "-1e308", "-1", "0", "1e-320", "nan", "inf", "1e400", "1e12"] {
            folder.write("a.mtl", format!("newmtl a\nKd 1 0 0.5\nKs 1 1 1\n{key} {value}\n"));
            let corners = obj(&words(&cube()));
            let (scene, warnings) = folder.load("a.obj", format!("mtllib a.mtl\nusemtl a\n{corners}"));
            let bad_colour = key.starts_with('K') && !["0", "1e-320", "1e12"].contains(&value);
            let left_out = format!("a.mtl:4: `{key}` left out: an invalid value");
            assert!(!bad_colour || warnings.contains(&left_out), "{key} {value}: {warnings:?}");
            films(&scene, SIZE);
        }
    }
}

#[test]
fn i1_gltf_factors_beyond_the_format_make_light_or_none() {
    // Factors and lights below 0, above 1 and at the ends of f32, on a cube beside a light.
    let material = |key: &str, value: serde_json::Value| json!({ key: value });
    for x in [-1.0, 0.0, 1.0, 2.0, 3e38, 1e39, -1e39, 1e300] {
        let rough = |key: &str| material("pbrMetallicRoughness", json!({ key: x }));
        let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": x } });
        let materials = [
            material("pbrMetallicRoughness", json!({ "baseColorFactor": [x, 0.5, 0, 1] })),
            rough("metallicFactor"),
            rough("roughnessFactor"),
            material("emissiveFactor", json!([x, 1, 0])),
            json!({ "emissiveFactor": [1, 1, 1], "extensions": strength }),
        ];
        let spot = json!({ "innerConeAngle": 0.1, "outerConeAngle": x });
        let lights = [
            json!({ "type": "point", "intensity": x }),
            json!({ "type": "point", "color": [1, x, 0], "intensity": 100 }),
            json!({ "type": "point", "range": x, "intensity": 100 }),
            json!({ "type": "spot", "spot": spot, "intensity": 100 }),
        ];
        let plain = json!({ "type": "point", "intensity": 100 });
        let pairs = materials.into_iter().map(|material| (material, plain.clone()));
        for (material, light) in pairs.chain(lights.map(|light| (json!({}), light))) {
            let mut model = Model::new(&cube());
            model.primitive()["material"] = json!(0);
            model.json["materials"] = json!([material]);
            model.json["scenes"][0]["nodes"] = json!([0, 1]);
            let lamp = json!({ "KHR_lights_punctual": { "light": 0 } });
            model.json["nodes"] = json!([{ "mesh": 0 }, { "translation": [3, 4, 2], "extensions": lamp }]);
            model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
            model.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_emissive_strength"]);
            let (scene, warnings) = Folder::new().load("a.glb", model.binary());
            let negative = format!("a.glb: light node 1 has a negative intensity ({x}); left out");
            assert_eq!(warnings.contains(&negative), light["intensity"] == -1.0, "{warnings:?}");
            films(&scene, SIZE);
        }
    }
}

#[test]
fn i1_strengths_at_the_ends_of_f64_are_errors_or_light() {
    // A material colour with components of 0 and 1: infinite light times 0 must stay 0.
    for strength in ["1e99", "1e-320", "0", "1e101", "1e308"] {
        for key in ["ambient", "diffuse", "specular", "shininess", "intensity"] {
            let [material, light] = if key == "intensity" { ["", "intensity"] } else { [key, ""] }
                .map(|key| if key.is_empty() { String::new() } else { format!("{key} = {strength}\n") });
            let text = format!(
                "[ambient]\n{light}\n[[light]]\ntype = 'point'\nposition = [2, 3, 4]\ncolour = '#ff0080'\n{light}\
                 [material.m]\ncolour = '#ff00ff'\nspecular = 1\n{material}{CUBE}material = 'm'\n"
            );
            // `specular` is in the file twice if it is the key under test.
            let text = if key == "specular" { text.replace("specular = 1\n", "") } else { text };
            if strength == "1e101" || strength == "1e308" {
                let e = Folder::new().fails("a.toml", text);
                assert_eq!(e.hint(), "give at most 1e100", "{e}");
            } else {
                films(&scene(&text), SIZE);
            }
        }
    }
}

#[test]
fn i1_spheres_beyond_the_numbers_are_left_out_with_a_warning() {
    let text = |centre: &str, radius: &str| {
        format!("{CUBE}[[sphere]]\ncentre = [{centre}, 0, 0]\nradius = {radius}\n")
    };
    let picture = all_bits(&scene(CUBE));
    for (centre, radius) in
        [("1e19", "1"), ("-1e300", "1"), ("0", "1e19"), ("9e17", "2e17"), ("1e308", "1e308")]
    {
        let (scene, warnings) = Folder::new().load("a.toml", text(centre, radius));
        assert_eq!(warnings, [format!("a.toml: {TOO_LARGE}")]);
        assert!(all_bits(&scene) == picture);
    }
}

/// A height field of 20 x 20 cells with a bump, as a list of triangles.
fn field() -> Vec<[DVec3; 3]> {
    let corner = |i: i32, j: i32| {
        DVec3::new(f64::from(i), f64::from((i * i + 3 * j * j + i * j) % 7) / 4.0, f64::from(j))
    };
    let cells = (0..20).flat_map(|i| (0..20).map(move |j| (i, j)));
    cells
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// A scene file of triangles.
fn file_of(triangles: &[[DVec3; 3]]) -> String {
    let vertices: Vec<[f64; 3]> = triangles.iter().flatten().map(|p| p.to_array()).collect();
    format!("[[triangles]]\nvertices = {vertices:?}\n")
}

#[test]
fn b5_a_mesh_half_of_degenerates_renders_as_the_clean_one() {
    // Each of 800 triangles is followed by one without area, whose corners are integers on a line; in a scene file, and
    // in OBJ, with additional triangles with equal corners and faces of two corners.
    let clean = field();
    let mut mixed = Vec::new();
    for &[a, b, c] in &clean {
        let step = DVec3::new(1.0, 2.0, -5.0);
        mixed.extend([[a, b, c], [a, a + step, a + 3.0 * step]]);
    }
    // In the tiers that round, a ray within rounding error of such a line may hit it, mostly at corners shared with the
    // field, at the depth of the field; in `exact` no ray does. Corners and camera lie within 64 of the origin:
    // rounding to f32 moves a coordinate by at most 64 x 2^-24, and so does each of the few operations of a test.
    const NEAR: f64 = 16.0 * 64.0 / (1 << 24) as f64;
    let lines: Vec<[DVec3; 3]> = mixed.iter().skip(1).step_by(2).copied().collect();
    // In `fast` the ray passes near the line, but t is the quotient of two rounding errors: the hit may be anywhere on
    // the ray.
    let near_its_line = |found: &Hit, ray: &Ray, numerics: Numerics| {
        let [start, _, end] = lines[found.prim.0 as usize / 2];
        let along = (end - start).normalize();
        let passes = (start - ray.origin()).dot(ray.direction().cross(along).normalize()).abs();
        assert!(passes <= NEAR, "{}: the ray passes {passes} from the line", numerics.name());
        if numerics == Numerics::Fast {
            return;
        }
        let from_start = ray.origin() + found.t * ray.direction() - start;
        let (away, at) = (from_start.cross(along).length(), from_start.dot(along));
        assert!(away <= NEAR, "{}: {away} from its line", numerics.name());
        let length = (end - start).length();
        assert!((-NEAR..=length + NEAR).contains(&at), "{}: {at} along {length}", numerics.name());
    };
    let same_as_clean = |mixed: &Scene, clean: &Scene| {
        // The lines extend beyond the field; both files use the camera that fits the field.
        let eye = DVec3::new(9.3, 30.2, 20.1);
        let cameras = vec![camera(eye, DVec3::new(9.5, 0.5, 9.5), Projection::Perspective, 24.0, 31.0)];
        let [mixed, clean] = [mixed, clean].map(|scene| Scene { cameras: cameras.clone(), ..scene.clone() });
        let (mixed, clean) = (&mixed, &clean);
        assert!(all_bits(mixed)[3] == all_bits(clean)[3]);
        for numerics in Numerics::ALL {
            let prepared = prepare(mixed.clone(), SIZE, numerics);
            let [mixed, clean] = [prepared.hits(), prepare(clean.clone(), SIZE, numerics).hits()];
            let mut on_lines = 0;
            for ((found, expected), ray) in mixed.iter().zip(&clean).zip(prepared.rays()) {
                match (found, expected) {
                    (Some(found), expected) if found.prim.0 % 2 == 1 => {
                        on_lines += 1;
                        near_its_line(found, &ray, numerics);
                        assert!(
                            expected.is_none_or(|e| found.t <= e.t * (1.0 + 1e-6)),
                            "{found:?} {expected:?}"
                        );
                    }
                    (found, expected) => {
                        let key = |hit: &Option<kiln::bvh::Hit>, by: u32| {
                            hit.map(|hit| (hit.t.to_bits(), hit.prim.0 / by))
                        };
                        assert_eq!(key(found, 2), key(expected, 1), "{}", numerics.name());
                    }
                }
            }
            assert!(on_lines * 100 <= clean.len(), "{}: {on_lines}", numerics.name());
            // Rays at the lines themselves, some of which are in front of the field.
            let mut traversal = Traversal::default();
            let mut hits = 0;
            for (line, part) in
                lines.iter().flat_map(|line| (0..=24).map(move |i| (line, f64::from(i) / 24.0)))
            {
                let target = line[0].lerp(line[2], part);
                let direction = (target - eye).normalize();
                let ray = numerics.ray_precision().ray(eye, direction, 0.0, f64::INFINITY);
                let found = prepared.world.accelerator.closest_hit(&ray, &mut traversal);
                if let Some(found) = found.filter(|found| found.prim.0 % 2 == 1) {
                    hits += 1;
                    near_its_line(&found, &ray, numerics);
                }
            }
            // `exact` never hits a triangle without area; the others may, within rounding error of it.
            assert_eq!(hits == 0, numerics == Numerics::Exact, "{}: {hits}", numerics.name());
        }
    };
    let picture = scene(&file_of(&clean));
    let (scene, warnings) = Folder::new().load("a.toml", file_of(&mixed));
    assert_eq!((scene.primitive_count(), warnings), (1600, vec![]));
    same_as_clean(&scene, &picture);
    let text = |triangles: &[[DVec3; 3]]| {
        let corners = triangles.iter().flatten().map(|p| p.to_array().map(|x| x.to_string()));
        obj(&corners.collect::<Vec<_>>())
    };
    let picture = Folder::new().load("a.obj", text(&clean)).0;
    let (scene, warnings) =
        Folder::new().load("a.obj", text(&mixed) + "f 1 2\nl 1 2\nl 1 2 3\np 1\nf 1 2 2\nf 3 3 3\nf 1 2 1\n");
    // The face of two corners follows the vertices and faces of the mesh.
    let line = text(&mixed).lines().count() + 1;
    let expected = vec![
        "a.obj: points and lines are not drawn".to_owned(),
        format!("a.obj:{line}: a face of 2 corner(s); such faces are not drawn"),
    ];
    // The last three faces have two equal corners: they keep their numbers, and no ray hits them.
    assert_eq!((scene.primitive_count(), warnings), (1603, expected));
    same_as_clean(&scene, &picture);
}

/// Rays at the segments that triangles with two equal corners are. None hits one, not even in `fast`, whose test
/// divides rounding errors by each other where both edges from the first corner have a length.
#[test]
fn b5_triangles_with_equal_corners_are_hit_in_no_tier() {
    let mut numbers = Numbers::new(9);
    let segments: Vec<[DVec3; 2]> =
        (0..300).map(|_| [numbers.vector() * 5.0, numbers.vector() * 5.0]).collect();
    let of = |(i, &[a, b]): (usize, &[DVec3; 2])| [[a, b, b], [a, a, b], [a, b, a]][i % 3];
    let mut triangles = vec![[DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis + 90.0)];
    triangles.extend(segments.iter().enumerate().map(of));
    let scene = scene(&file_of(&triangles));
    assert_eq!(scene.primitive_count(), 301);
    for numerics in Numerics::ALL {
        let world = World::prepare(scene.clone(), ColourPipeline::Linear, Layout::default(), numerics);
        let (mut hits, mut traversal) = (Vec::new(), Traversal::default());
        for [a, b] in &segments {
            for part in 0..40 {
                let (from, to) = (numbers.vector() * 15.0, a.lerp(*b, f64::from(part) / 40.0));
                let direction = (to - from).normalize();
                let ray = numerics.ray_precision().ray(from, direction, 0.0, f64::INFINITY);
                world.accelerator.all_hits(&ray, &mut hits, &mut traversal);
            }
        }
        assert_eq!(hits.len(), 0, "{}: {:?}", numerics.name(), hits.first());
    }
}

#[test]
fn b6_copies_of_triangles_show_the_first() {
    // The field three times in three colours: every pixel shows the first, as if it were alone. In `exact` the later
    // ones may have the opposite winding.
    let colours = "[material.first]\ncolour = '#ff8000'\n[material.later]\ncolour = '#0000ff'\n";
    let (first, later) = ("material = 'first'\n", "material = 'later'\n");
    let field = field();
    let turned: Vec<[DVec3; 3]> = field.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let alone = format!("{colours}{}{first}", file_of(&field));
    let copies = format!("{alone}{}{later}{}{later}", file_of(&field), file_of(&field));
    let all_turned = format!("{alone}{}{later}", file_of(&turned));
    // In `fast` any of the three is shown.
    assert!(all_bits(&scene(&copies))[1..] == all_bits(&scene(&alone))[1..]);
    assert!(all_bits(&scene(&all_turned))[3] == all_bits(&scene(&alone))[3]);
    let hits = hits_by_every_structure(&scene(&copies));
    assert!(
        hits.iter().all(|answer| *answer == hits[0] && answer.iter().flatten().all(|(prim, _)| *prim < 800))
    );
}

#[test]
fn b4_needles_are_hit_along_their_edge() {
    // A needle along x from 0 to 8, with one edge on y = 0, and rays at a spacing of 1/4 of which one row has y = 0:
    // each of that row from 0 to 8 hits the edge, and no other row hits. Where the width underflows in the tier's
    // precision, the needle has no area and lies in the plane of that row: those rays miss.
    for exponent in [-1, -4, -7, -20, -37, -50, -80] {
        let mut scene =
            scene(&format!("[[triangles]]\nvertices = [[0, 0, 0], [8, 0, 0], [8, 1e{exponent}, 0]]\n"));
        let eye = DVec3::new(4.125, 0.125, 5.0);
        scene.cameras = vec![camera(eye, eye - DVec3::Z * 5.0, Projection::Orthographic, 16.0, 5.0)];
        for numerics in Numerics::ALL {
            let prepared = prepare(scene.clone(), [64, 64], numerics);
            sound(&prepared);
            let least = if TIGHT[1..].contains(&numerics) { -75 } else { -44 };
            for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
                let on_edge = ray.origin().y == 0.0 && (0.0..=8.0).contains(&ray.origin().x);
                assert!(hit.is_none() || on_edge, "{ray:?}");
                let owed = on_edge && exponent >= least && TIGHT.contains(&numerics);
                assert!(hit.is_none() || exponent >= least, "{}: 1e{exponent}: {ray:?}", numerics.name());
                assert!(hit.is_some() || !owed, "{}: 1e{exponent}: {ray:?}", numerics.name());
            }
        }
    }
}
