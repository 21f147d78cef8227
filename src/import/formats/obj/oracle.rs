//! OBJ texts against `tobj`, and against themselves cut elsewhere.

use std::fmt::Write;

use glam::DVec3;

use crate::import::formats::obj::tests::{load, meshes, source};
use crate::import::formats::obj::*;
use crate::import::meshes::polygon::Triangulator;

/// Pseudorandom numbers below a bound (SplitMix64; Steele et al., "Fast Splittable Pseudorandom Number Generators",
/// 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) % bound as u64) as usize
    }

    fn one_of<'a>(&mut self, words: &[&'a str]) -> &'a str {
        words[self.below(words.len())]
    }
}

/// A well-formed text: triangles and parallelograms, with objects, groups, relative and absolute indices, comments, and
/// either all of texture coordinates, normals and colours or none of each.
fn well_formed(random: &mut Random) -> String {
    let mut text = String::new();
    let [with_uvs, with_normals, with_colours, with_carriage_returns] =
        [(); 4].map(|()| random.below(2) == 1);
    let mut counts = [0; 3];
    for face in 0..1 + random.below(60) {
        if face == 0 || random.below(3) == 0 {
            // A parallelogram, whose fan is its only triangulation from the first corner.
            let mut number = || (random.below(2_000_001) as f64 - 1e6) / [1.0, 1e3, 1e7][random.below(3)];
            let [a, b, c] = [(); 3].map(|()| DVec3::from([(); 3].map(|()| number())));
            for p in [a, b, b + c - a, c] {
                write!(text, "v {} {} {}", p.x, p.y, p.z).expect("a string");
                text += if with_colours { " 0.25 0.5 1\n" } else { "\n" };
                counts[0] += 1;
            }
        }
        if with_uvs && (counts[1] == 0 || random.below(2) == 0) {
            writeln!(text, "vt {} {:e}", random.below(1000) as f64 / 999.0, random.below(10))
                .expect("a string");
            counts[1] += 1;
        }
        if with_normals && (counts[2] == 0 || random.below(2) == 0) {
            writeln!(text, "vn\t{} -1 .5", random.below(9)).expect("a string");
            counts[2] += 1;
        }
        text += random.one_of(&["", "", "", "o a\n", "g  b c \n", "# f 1 2 3\n", "s off\n", "\n", "g\n"]);
        let first = 4 * random.below(counts[0] / 4);
        text += "f";
        for corner in 0..3 + random.below(2) {
            let mut index = |kind: usize, index: usize| match random.below(2) {
                0 => format!("{}", index + 1),
                _ => format!("{}", index as i64 - counts[kind] as i64),
            };
            let position = index(0, first + corner);
            let uv = if with_uvs { index(1, corner % counts[1]) } else { String::new() };
            let normal =
                if with_normals { format!("/{}", index(2, face % counts[2])) } else { String::new() };
            let slash = if with_uvs || with_normals { "/" } else { "" };
            write!(text, " {position}{slash}{uv}{normal}").expect("a string");
        }
        text += "\n";
    }
    if with_carriage_returns { text.replace('\n', "\r\n") } else { text }
}

/// The corners of a mesh: position, texture coordinate, normal, colour.
pub(super) type Corner = ([f64; 3], Option<[f64; 2]>, Option<[f64; 3]>, Option<[f64; 3]>);

pub(super) fn corners_of(mesh: &Mesh) -> Vec<Corner> {
    let index = |triangles: &Option<Vec<[u32; 3]>>, t: usize, c: usize| {
        triangles.as_ref().unwrap_or(&mesh.triangles)[t][c] as usize
    };
    let corner = |t: usize, c: usize| {
        let position = mesh.triangles[t][c] as usize;
        let uv = mesh.uvs.first().map(|uvs| uvs.values[index(&uvs.triangles, t, c)].to_array());
        let normal = mesh.normals.as_ref().map(|n| n.values[index(&n.triangles, t, c)].to_array());
        let colour = mesh.colours.as_ref().map(|colours| colours.values[position].to_array());
        (mesh.positions[position].to_array(), uv, normal, colour)
    };
    (0..mesh.triangles.len()).flat_map(|t| [0, 1, 2].map(|c| corner(t, c))).collect()
}

/// What tobj makes of a text, with polygons triangulated as elsewhere: the name, the corners and the number of
/// positions of each model.
fn by_tobj(text: &str) -> Vec<(String, Vec<Corner>, usize)> {
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let read = tobj::load_obj_buf(&mut text.as_bytes(), &tobj::LoadOptions::default(), no_materials);
    let (models, _) = read.expect("it is well-formed");
    let triple = |values: &[f64], i: u32| std::array::from_fn(|k| values[3 * i as usize + k]);
    let mut triangulator = Triangulator::new();
    let mut model = |model: tobj::Model| {
        let m = &model.mesh;
        let corner = |i: usize| {
            let uv = m.texcoord_indices.get(i).map(|&i| 2 * i as usize);
            let uv = uv.map(|i| [m.texcoords[i], 1.0 - m.texcoords[i + 1]]);
            let normal = m.normal_indices.get(i).map(|&i| triple(&m.normals, i));
            let decoded = |colour: [f64; 3]| colour.map(crate::film::colour::srgb_decode);
            let colour = (!m.vertex_color.is_empty()).then(|| decoded(triple(&m.vertex_color, m.indices[i])));
            (triple(&m.positions, m.indices[i]), uv, normal, colour)
        };
        let mut corners = Vec::new();
        let mut first = 0;
        let triangles = vec![3; m.indices.len() / 3];
        for &arity in if m.face_arities.is_empty() { &triangles } else { &m.face_arities } {
            let polygon = &m.indices[first..first + arity as usize];
            let polygon: Vec<DVec3> = polygon.iter().map(|&i| triple(&m.positions, i).into()).collect();
            triangulator.triangulate(&polygon, |t| corners.extend(t.map(|i| corner(first + i))));
            first += arity as usize;
        }
        (model.name, corners, m.positions.len() / 3)
    };
    models.into_iter().filter(|model| !model.mesh.indices.is_empty()).map(&mut model).collect()
}

fn by_us(text: &str) -> Vec<(String, Vec<Corner>, usize)> {
    let (scene, warnings) = load(text);
    assert!(warnings.is_empty(), "{warnings:?}");
    let object = |object: &Object| {
        let mesh = object.shape.mesh().expect("a mesh");
        (object.name.clone(), corners_of(mesh), mesh.positions.len())
    };
    scene.objects.iter().map(object).collect()
}

#[test]
fn well_formed_texts_are_read_as_by_tobj() {
    let mut random = Random(1);
    for i in 0..500 {
        let text = well_formed(&mut random);
        assert!(by_us(&text) == by_tobj(&text), "text {i}:\n{text}");
    }
}

/// The same for real files; colours, groups and materials included.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_files_are_read_as_by_tobj() {
    let folder = std::env::var_os("KILN_MODELS").expect("KILN_MODELS names the folder of the models");
    let folder = std::path::PathBuf::from(folder);
    for name in ["stanford-bunny.obj", "suzanne.obj", "teapot.obj", "spot.obj"] {
        let text = std::fs::read_to_string(folder.join(name)).expect("a model");
        assert!(by_us(&text) == by_tobj(&text), "{name}");
    }
    // Runs of materials that are not read here: tobj makes one model of several.
    let text = std::fs::read_to_string(folder.join("kitchen.obj")).expect("a model");
    let (scene, _) = load(text.as_str());
    let ours: Vec<Corner> = meshes(&scene).into_iter().flat_map(corners_of).collect();
    let theirs: Vec<Corner> = by_tobj(&text).into_iter().flat_map(|(_, corners, _)| corners).collect();
    assert!(ours == theirs && ours.len() == 3 * 56939);
}

/// A text of pieces that a parser may stumble over.
fn soup(random: &mut Random) -> String {
    let starts = [
        "v 0 0 0",
        "v 1 0 0 1 0 0",
        "v 0 1 0",
        "v 2 3 -1 2",
        "vt 0.5 1",
        "vt 1",
        "vn 0 0 1",
        "f 1 2 3",
        "f -1 -2 -3",
        "f 1/1 2/1 3/-1",
        "f 1//1 2//1 3//1",
        "f 1 2 4 3",
        "f -1//-1 -2//-1 1 2 3",
        "s 1",
        "s 2",
        "s off",
        "o a",
        "g b",
        "usemtl m",
        "usemtl n",
        "l 1 2",
        "# note",
        "curv 0 1",
        "word",
        "v 0 nan 1",
        "f 1 2",
        "f 1/1/1 2/1/1 3/1/1",
    ];
    let rare = ["f 1 2 99", "f 1 2 -99", "v 1 x 1", "f 1 2 x", "vn 1", "f 0 1 2", "f 99999999999 1 2"];
    let mut text: String = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n".into();
    for _ in 0..random.below(40) {
        text += if random.below(150) == 0 { random.one_of(&rare) } else { random.one_of(&starts) };
        text += random.one_of(&["\n", "\n", "\r\n", "\r", " \\\n", "\\\r\n0.5 \n", " # c\\\n", "\n\n"]);
    }
    text
}

/// Windows and parts of any size give the same elements, faults and warnings.
#[test]
fn cuts_do_not_change_what_is_read() {
    let mut random = Random(2);
    let (mut good, mut bad) = (0, 0);
    for i in 0..500 {
        let text = if i % 5 == 0 { well_formed(&mut random) } else { soup(&mut random) };
        let source = source(text.as_str());
        let read = |window, part| {
            let mut warnings = Warnings::default();
            let read = assembly::parse(&source, Sizes { window, part }, &mut warnings);
            (read.map(|assembly| format!("{assembly:?}")), warnings)
        };
        let whole = read(1 << 20, 1 << 20);
        if whole.0.is_ok() {
            good += 1;
        } else {
            bad += 1;
        }
        for (window, part) in [(1, 1), (7, 3), (40, 1 << 20), (1 << 20, 25), (300, 20)] {
            assert!(read(window, part) == whole, "window {window}, part {part}, text {i}:\n{text:?}");
        }
    }
    assert!(good > 100 && bad > 50, "{good} {bad}");
}

#[test]
fn threads_do_not_change_what_is_read() {
    let mut random = Random(4);
    let text: String = (0..40).map(|_| well_formed(&mut random)).collect();
    let read = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let sizes = Sizes { window: 5000, part: 200 };
            format!("{:?}", assembly::parse(&source(text.as_str()), sizes, &mut Warnings::default()))
        })
    };
    let one = read(1);
    assert!(one.starts_with("Ok(") && one == read(2) && one == read(5));
}

/// A file of several windows of the usual size, each with indices relative to the one before.
#[test]
fn large_files_are_read_in_windows() {
    const BLOCKS: usize = 400_000;
    let text: String = (0..BLOCKS).map(|i| format!("v {i} 1 0\nf -1 1 -2 # {i}\n")).collect();
    let text = format!("v 0 0 1\n{text}");
    assert!(text.len() > Sizes::default().window);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.obj");
    std::fs::write(&file, &text).expect("a file");
    let source = Source::of(file, []);
    let scene = read(&source, &mut Warnings::default()).unwrap_or_else(|e| panic!("{e}"));
    let [mesh] = meshes(&scene)[..] else { panic!("one mesh") };
    let expected = (0..BLOCKS as u32).map(|i| [i + 1, 0, i]);
    assert!(mesh.triangles.iter().copied().eq(expected));
    assert!(mesh.positions[1..].iter().zip(0..).all(|(p, i)| *p == DVec3::new(f64::from(i), 1.0, 0.0)));
    assert_eq!(mesh.positions.len(), BLOCKS + 1);
}

#[test]
fn soups_become_meshes_or_faults() {
    let mut random = Random(3);
    for _ in 0..3000 {
        let text = soup(&mut random);
        let Ok(scene) = read(&source(text.as_str()), &mut Warnings::default()) else { continue };
        for mesh in meshes(&scene) {
            // Reading the corners checks every index.
            assert_eq!(corners_of(mesh).len(), 3 * mesh.triangles.len());
            let used = mesh.triangles.iter().flatten().collect::<BTreeSet<_>>();
            assert_eq!(used.len(), mesh.positions.len(), "{text}");
        }
    }
}
