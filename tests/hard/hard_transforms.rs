//! Numerically hard transforms (mirrored, singular, non-uniform, tiny), and scenes of sizes from 1e-30 to 1e17 or far
//! from the origin.
//!
//! Instances (J1, J3) are tested in `tests/accel/instances.rs`. Not tested: seams between tiles whose transforms round
//! common corners differently (J3). Those are gaps in the data, and kiln does not weld vertices.

use crate::common::Numbers;
use crate::common::borders::{CUBE, Folder, TIGHT, camera, films, scene, sound, tiers};
use crate::common::gltf::Model;
use crate::common::picture::{bits, placed, prepare};
use glam::{DMat3, DMat4, DQuat, DVec3};
use kiln::film::ColourPipeline;
use kiln::scene::{Attribute, Mesh, Projection, Scene, Shape, normal_matrix};
use serde_json::json;

const SIZE: [u32; 2] = [16, 16];

/// A tetrahedron with a vertex normal at each corner, all edges of different lengths, as OBJ.
const SMOOTH: &str = "v 0 0 0\nv 4 1 0\nv 1 5 1\nv 1 1 3\nvn -1 -1 -1\nvn 3 0 -1\nvn 0 3 0\nvn 0 1 3\n\
    f 1//1 3//3 2//2\nf 1//1 2//2 4//4\nf 2//2 3//3 4//4\nf 1//1 4//4 3//3\n";

/// That mesh, placed by keys of a scene file, with `rest` after it.
fn mesh(keys: &str, rest: &str) -> (Scene, Vec<String>) {
    let folder = Folder::new();
    folder.write("a.obj", SMOOTH);
    folder.load("a.toml", format!("[[mesh]]\nfile = 'a.obj'\n{keys}\n{rest}"))
}

#[test]
fn j1_a_mesh_scaled_by_a_power_of_two_is_the_mesh_written_so() {
    // Scales from 2^-40 to 2^40, more than rays in the mesh's own space allow (1e-5 to 1e6). Every product with a power
    // of two is exact, so positions and pixels are bit for bit those of a file with the scaled numbers.
    for exponent in [-40, -17, -3, 5, 23, 40] {
        let scale = f64::from(exponent).exp2();
        let line = |line: &str| match line.strip_prefix("v ") {
            None => format!("{line}\n"),
            Some(rest) => {
                let numbers =
                    rest.split(' ').map(|x| (x.parse::<f64>().expect("a number") * scale).to_string());
                format!("v {}\n", numbers.collect::<Vec<_>>().join(" "))
            }
        };
        let folder = Folder::new();
        folder.write("a.obj", SMOOTH);
        folder.write("b.obj", SMOOTH.lines().map(line).collect::<String>());
        // A floor of size 8 beside it, so that the scene is not rescaled as a whole.
        let floor = "[[triangles]]\nvertices = [[-8, -1, -8], [8, -1, -8], [0, -1, 8]]\n";
        let [a, b] = [format!("file = 'a.obj'\nscale = {scale:?}"), "file = 'b.obj'".into()].map(|keys| {
            let mut scene = folder.load("s.toml", format!("[[mesh]]\n{keys}\n{floor}")).0;
            let eye = DVec3::new(5.0, 6.0, 7.0) * scale;
            scene.cameras = vec![camera(eye, DVec3::ONE * scale, Projection::Perspective, 0.8, 1.0)];
            scene
        });
        for (a, b) in films(&a, SIZE).iter().zip(films(&b, SIZE)) {
            assert!(bits(a, SIZE) == bits(&b, SIZE), "2^{exponent}");
        }
    }
}

#[test]
fn j2_normals_stay_perpendicular_and_outside_under_any_transform() {
    // 10,000 random transforms, stretched by up to 1e4 each way, mirrored half the time; tangents and normals at
    // random. Each component of a cofactor is off by 3 u of its two products, a sum of three by 3 u more: n.t is off by
    // less than 16 u of the sum of all absolute products. A point on the outer side of a plane stays there.
    let mut numbers = Numbers::new(11);
    let mut mirrored = 0;
    for _ in 0..10_000 {
        let turn = |numbers: &mut Numbers| {
            DMat3::from_quat(DQuat::from_axis_angle(
                numbers.vector().normalize_or(DVec3::X),
                7.0 * numbers.unit(),
            ))
        };
        let stretch =
            DVec3::from([0; 3].map(|_| {
                10f64.powf(4.0 * numbers.signed()) * if numbers.below(2) == 0 { 1.0 } else { -1.0 }
            }));
        let m = turn(&mut numbers) * DMat3::from_diagonal(stretch) * turn(&mut numbers);
        mirrored += usize::from(m.determinant() < 0.0);
        let (normal, aside) = (numbers.vector().normalize_or(DVec3::Y), numbers.vector());
        let tangent = normal.cross(aside);
        let mesh = Mesh {
            positions: vec![DVec3::ZERO, tangent, normal],
            triangles: vec![[0, 1, 2]],
            normals: Some(Attribute::per_position(vec![normal; 3])),
            ..Mesh::default()
        };
        let mut moved = mesh.clone();
        moved.transform(&DMat4::from_mat3(m));
        let n = moved.normals.as_ref().expect("it has normals").values[0];
        let [_, t, outside] = moved.positions[..] else { panic!("three corners") };
        let all =
            |m: DMat3, v: DVec3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs()) * v.abs();
        let cofactor = {
            let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::abs);
            let permanent = |a: DVec3, b: DVec3| {
                DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
            };
            DMat3::from_cols(permanent(y, z), permanent(z, x), permanent(x, y))
        };
        let bound = 16.0 * f64::EPSILON * (cofactor * normal.abs()).dot(all(m, tangent));
        assert!(n.dot(t).abs() <= bound, "{m}: {} beyond {bound}", n.dot(t));
        let doubt = 16.0 * f64::EPSILON * (cofactor * normal.abs()).dot(all(m, normal));
        assert!(n.dot(outside) > -doubt, "{m}");
    }
    assert!((4000..6000).contains(&mirrored));
}

#[test]
fn j2_a_mirrored_scene_gives_the_mirrored_picture() {
    // The scene with its light is mirrored at x = 0, the middle of the picture: numbers differ in their signs only, so
    // the picture is the mirrored one, bit for bit, with sides, normals and shadow terminators.
    let rest = |side: i32| {
        format!(
            "[[triangles]]\nvertices = [[{}, -1, -8], [{}, -1, -8], [0, -1, 8]]\n\
             [[light]]\ntype = 'point'\nposition = [{}, 7, 4]\n",
            -8 * side,
            8 * side,
            3 * side
        )
    };
    let (plain, mirrored) = (mesh("", &rest(1)).0, mesh("scale = [-1, 1, 1]", &rest(-1)).0);
    let eye = DVec3::new(0.0, 3.0, 12.0);
    let camera = camera(eye, DVec3::Y, Projection::Perspective, 1.0, 1.0);
    let [plain, mirrored] = [plain, mirrored].map(|mut scene| {
        scene.cameras = vec![camera.clone()];
        films(&scene, [32, 32]).map(|film| bits(&film, [32, 32]))
    });
    for (plain, mirrored) in plain.iter().zip(&mirrored) {
        let turned: Vec<[u32; 3]> = plain.chunks(32).flat_map(|row| row.iter().rev().copied()).collect();
        assert!(turned == *mirrored && turned != *plain);
    }
}

/// The cube of corners 0 and 1 under a node's transform.
fn node(transform: &serde_json::Value) -> (Scene, Vec<String>) {
    let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| bit as f32);
    let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let corners: Vec<[f32; 3]> =
        sides.into_iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).map(corner).collect();
    let mut model = Model::new(&corners);
    model.attribute("NORMAL", &corners.iter().map(|c| c.map(|x| 2.0 * x - 1.0)).collect::<Vec<_>>());
    model.json["nodes"] = json!([transform]);
    model.json["nodes"][0]["mesh"] = json!(0);
    Folder::new().load("a.glb", model.binary())
}

#[test]
fn j2_singular_transforms_show_what_has_area_and_say_where_nothing_has() {
    // Flattened to a plane, the two parallel faces remain, and eight triangles have no area. Flattened to a line or a
    // point, no triangle has any.
    let nothing = "no triangle has an area, so nothing of it can be seen";
    for (transform, is_seen) in [
        (json!({ "scale": [1, 1, 0] }), true),
        (json!({ "scale": [0, 2, -1] }), true),
        (json!({ "scale": [1, 0, 0] }), false),
        (json!({ "scale": [0, 0, 0] }), false),
        (json!({ "matrix": [1,0,0,0, 0,1,0,0, 1,1,0,0, 0,0,0,1] }), true),
        (json!({ "matrix": [1,0,0,0, 2,0,0,0, 3,0,0,0, 0,0,0,1] }), false),
    ] {
        let (mut scene, warnings) = node(&transform);
        let is_said = warnings.iter().any(|warning| warning.ends_with(nothing));
        assert_eq!((is_said, warnings.len()), (!is_seen, usize::from(!is_seen)), "{transform}: {warnings:?}");
        let eye = DVec3::new(3.0, 4.0, 5.0);
        scene.cameras = vec![camera(eye, DVec3::splat(0.5), Projection::Perspective, 0.6, 1.0)];
        for prepared in tiers(&scene, SIZE) {
            sound(&prepared);
            assert_eq!(prepared.hits().iter().any(Option::is_some), is_seen, "{transform}");
        }
    }
    // In a scene file a scale of 0 is an error.
    let folder = Folder::new();
    folder.write("a.obj", SMOOTH);
    for scale in ["0", "[1, 0, 1]", "-0.0"] {
        let e = folder.fails("a.toml", format!("[[mesh]]\nfile = 'a.obj'\nscale = {scale}\n"));
        assert!(e.to_string().ends_with("a.toml:1: `scale` is 0"), "{e}");
    }
}

#[test]
fn j2_transforms_of_any_size_are_seen_or_said() {
    // Uniform scales from 1e-38 to 1e38, nested so that the products reach 1e-76 and 1e76, which f32 cannot invert.
    // Primitives beyond 1e18 are left out; the fitted camera shows all others as at scale 1.
    let place = |scale: f32, nested: bool| {
        let scale = json!(vec![scale; 3]);
        let nodes = json!([{ "scale": scale.clone(), "children": [1] }, { "scale": scale, "mesh": 0 }]);
        let mut model = Model::new(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]]);
        model.attribute("NORMAL", &[[0.0, 0.0, 1.0]; 3]);
        model.json["nodes"] = if nested { nodes } else { json!([{ "scale": scale, "mesh": 0 }]) };
        Folder::new().load("a.glb", model.binary())
    };
    let masks = |scene: &Scene| {
        tiers(scene, SIZE).map(|prepared| {
            sound(&prepared);
            prepared.hits().iter().map(Option::is_some).collect::<Vec<_>>()
        })
    };
    let own_size = masks(&place(1.0, false).0);
    assert!(own_size.iter().all(|mask| mask.contains(&true)));
    for exponent in [-38, -30, -15, -7, 0, 7, 15, 19, 30, 38] {
        for nested in [false, true] {
            let (scene, warnings) = place(10f32.powi(exponent), nested);
            if exponent * if nested { 2 } else { 1 } > 18 {
                assert_eq!(warnings, ["a.glb: left out 1 primitive(s) with a coordinate beyond 1e18"]);
                assert_eq!(scene.primitive_count(), 0);
            } else {
                assert_eq!((scene.primitive_count(), warnings), (1, vec![]), "1e{exponent}");
                assert!(masks(&scene) == own_size, "1e{exponent}");
            }
        }
    }
}

#[test]
fn j2_uneven_transforms_turn_normals_the_other_way() {
    // The scale (1e-4, 1, 1e4): a normal (1, 1, 1) becomes (1e4, 1, 1e-4) up to length, not (1e-4, 1, 1e4).
    let n = normal_matrix(&DMat4::from_scale(DVec3::new(1e-4, 1.0, 1e4))) * DVec3::ONE;
    assert!((n / n.y - DVec3::new(1e4, 1.0, 1e-4)).abs().max_element() <= 1e4 * 4.0 * f64::EPSILON, "{n}");
    let (scene, warnings) = node(&json!({ "scale": [1e-4, 1, 1e4] }));
    assert_eq!(warnings, [""; 0]);
    let Shape::Mesh(mesh) = &scene.objects[0].shape else { panic!("a mesh") };
    let normals = &mesh.normals.as_ref().expect("it has normals").values;
    let middle = DVec3::new(0.5e-4, 0.5, 0.5e4);
    assert!(mesh.positions.iter().zip(normals).all(|(p, n)| n.dot(*p - middle) > 0.0));
    films(&scene, SIZE);
}

#[test]
fn j3_tiles_side_by_side_have_no_seams() {
    // 4 x 4 copies of a square, each moved by whole multiples of its side, a power of two: their common corners are the
    // same numbers. Parallel rays through all corners and along all edges hit one or the other.
    for exponent in [-20, -1, 0, 10] {
        let side = f64::from(exponent).exp2();
        let folder = Folder::new();
        folder.write("tile.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
        let tile = |(i, j): (i32, i32)| {
            let [x, y] = [i, j].map(|k| f64::from(k) * side);
            format!("[[mesh]]\nfile = 'tile.obj'\nscale = {side:?}\ntranslate = [{x:?}, {y:?}, 0]\n")
        };
        let text: String = (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).map(tile).collect();
        let mut scene = folder.load("a.toml", text).0;
        // 64 x 64 rays an eighth of a side apart, every eighth on an edge, from -2 to 6 sides.
        let eye = DVec3::new(2.0 + 1.0 / 16.0, 2.0 + 1.0 / 16.0, 3.0) * side;
        scene.cameras = vec![camera(eye, eye - DVec3::Z * side, Projection::Orthographic, 8.0 * side, side)];
        for numerics in TIGHT {
            let prepared = prepare(scene.clone(), [64, 64], numerics);
            let mut on_edges = 0;
            for (ray, hit) in prepared.rays().iter().zip(prepared.hits()) {
                let [x, y] = [ray.origin().x, ray.origin().y].map(|c| c / side);
                let inside = (0.0..=4.0).contains(&x) && (0.0..=4.0).contains(&y);
                assert_eq!(hit.is_some(), inside, "{}: ({x}, {y})", numerics.name());
                on_edges += usize::from(inside && (x.fract() == 0.0 || y.fract() == 0.0));
            }
            // 33 x 33 rays from 0 to 4, of which 28 x 28 lie between the edges.
            assert_eq!(on_edges, 33 * 33 - 28 * 28);
        }
    }
}

/// A cube, a sphere on it and a light, seen from a corner, of about size 1.
fn still_life() -> Scene {
    let mut scene = scene(&format!(
        "[image]\nbackground = '#203040'\n{CUBE}[[sphere]]\ncentre = [0.4, 1.3, 0.5]\nradius = 0.3\n\
         [[light]]\ntype = 'point'\nposition = [1.7, 3.1, 2.9]\n"
    ));
    scene.cameras =
        vec![camera(DVec3::new(2.9, 2.2, 3.7), DVec3::splat(0.6), Projection::Perspective, 0.5, 1.0)];
    scene
}

/// The number of pixels of two pictures, in each tier, that differ by more than one of 255 steps.
fn differences(a: &Scene, b: &Scene) -> [usize; 4] {
    let pipeline = ColourPipeline::Linear;
    let eight = |scene: &Scene| films(scene, [48, 48]).map(|film| film.to_rgb8(pipeline));
    let (a, b) = (eight(a), eight(b));
    let pixels = |bytes: &[u8]| bytes.as_chunks::<3>().0.to_vec();
    std::array::from_fn(|tier| {
        let far = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 1);
        pixels(&a[tier]).iter().zip(&pixels(&b[tier])).filter(|pair| far(*pair)).count()
    })
}

#[test]
fn c6_coordinates_from_1e_minus_30_to_1e17_draw_the_same() {
    // Decimal sizes round every coordinate; none of the 48 x 48 rays is so near to an outline that this changes its
    // hit.
    let one = still_life();
    for exponent in [-30, -27, -20, -12, -9, -3, 3, 9, 12, 15, 17] {
        let scaled = placed(still_life(), 10f64.powi(exponent), DVec3::ZERO);
        assert_eq!(differences(&one, &scaled), [0; 4], "1e{exponent}");
    }
}

#[test]
fn c6_coordinates_beyond_1e18_are_left_out_with_a_warning() {
    for exponent in [19, 25, 30, 200, 308] {
        let cube = CUBE.replace(",1", &format!(",1e{exponent}")).replace("[1,", &format!("[1e{exponent},"));
        let text = format!("[[camera]]\nposition = [4, 4, 4]\nlook_at = [0, 0, 0]\n{cube}");
        // Index lists hold no coordinates and are not scaled.
        let text = text.replace(
            &cube[cube.find("indices").expect("it has them")..],
            &CUBE[CUBE.find("indices").unwrap()..],
        );
        let (scene, warnings) = Folder::new().load("a.toml", text);
        assert_eq!(warnings, ["a.toml: left out 12 primitive(s) with a coordinate beyond 1e18"]);
        for prepared in tiers(&scene, SIZE) {
            sound(&prepared);
            assert!(prepared.hits().iter().all(Option::is_none));
        }
    }
}

#[test]
fn h2_scenes_from_a_millionth_to_a_hundred_million_draw_the_same() {
    let one = still_life();
    for exponent in -6..=8 {
        let scaled = placed(still_life(), 10f64.powi(exponent), DVec3::ZERO);
        assert_eq!(differences(&one, &scaled), [0; 4], "1e{exponent}");
    }
}

#[test]
fn h3_scenes_a_million_away_draw_the_same() {
    // There f64 has steps of 1.2e-10, at most 1e-8 of sizes from 0.01 on. Coordinates of a scene of size 1e-6 keep four
    // digits, so up to one pixel in a hundred, on outlines and shadow edges, may change.
    let one = still_life();
    for far in [DVec3::X * 1e6, DVec3::new(-1e6, 1e6, 3e5), DVec3::new(0.0, -1e6, 0.0)] {
        for exponent in [-2, 0, 2, 8] {
            let moved = placed(still_life(), 10f64.powi(exponent), far);
            assert_eq!(differences(&one, &moved), [0; 4], "1e{exponent} at {far}");
        }
        let most = differences(&one, &placed(still_life(), 1e-6, far)).into_iter().max();
        assert!(most <= Some(48 * 48 / 100), "{most:?} pixels at {far}");
    }
}
