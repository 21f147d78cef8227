//! Import of PLY, STL, OFF, 3MF and environments; files of any format that are missing or unknown.

use std::path::{Path, PathBuf};

use crate::common::borders::Folder;
use crate::common::gltf::Model;
use crate::common::repository;
use crate::helpers::*;
use glam::DVec3;
use kiln::error::{Error, Warnings};
use kiln::scene::{Degrees, ImportOptions, Scene};

/// By default the look smooths meshes of formats that say nothing of normals that are missing; in glTF they are flat.
#[test]
fn meshes_without_normals_are_smooth_by_default() {
    let folder = Folder::new();
    let obj = folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let glb = folder.write("a.glb", Model::triangle().binary());
    let has_normals = |file: &Path, smooths_meshes, degrees: Option<f64>| {
        let smooth = degrees.map(Degrees::clamped);
        let options = ImportOptions { smooth, smooths_meshes, ..ImportOptions::default() };
        let scene =
            kiln::import::load_with(&[file.to_owned()], &options, &mut Warnings::default()).expect("a scene");
        scene.objects[0].shape.mesh().expect("a mesh").normals.is_some()
    };
    assert!(has_normals(&obj, true, None) && !has_normals(&obj, false, None));
    assert!(!has_normals(&obj, true, Some(0.0)) && has_normals(&obj, false, Some(30.0)));
    assert!(!has_normals(&glb, true, None) && has_normals(&glb, true, Some(30.0)));
}

#[test]
fn environments_are_read_or_refused() {
    let scene =
        |section: &str| Folder::new().load("a.toml", format!("[environment]\n{section}\n").as_bytes()).0;
    let environment = |section: &str| scene(section).environment.expect("an environment");
    let sky = environment("sky = true\nrotation = 180\nintensity = 2\nhide = true");
    assert_eq!(sky.source, kiln::scene::EnvironmentSource::Sky);
    assert_eq!((sky.rotation, sky.intensity, sky.is_hidden), (std::f64::consts::PI, 2.0, true));
    let fails = |section: &str| {
        let e = Folder::new().fails("a.toml", format!("[environment]\n{section}\n").as_bytes());
        (message(&e), e.hint().to_owned())
    };
    let one = "give one of `file`, `sky = true` and `colour`";
    for section in ["", "sky = true\ncolour = '#808080'"] {
        assert_eq!(
            fails(section),
            ("a.toml:1: an environment without one source".to_owned(), one.to_owned())
        );
    }
    let (missing, _) = fails("file = 'no.hdr'");
    assert!(missing.starts_with("no.hdr: "), "{missing}");
    let e = kiln::import::environment("#12345", &mut Warnings::default()).expect_err("five digits");
    assert!(matches!(e, Error::Usage { .. }), "{e:?}");
    assert_eq!(e.to_string(), "`#12345` is neither a colour nor a file");
}

/// An 8-bit image is an environment, decoded from sRGB, with a note: 188 is ((188 / 255 + 0.055) / 1.055)^2.4 = 0.5029.
#[test]
fn environments_of_eight_bits() {
    let folder = Folder::new();
    let file = folder.0.path().join("a.png");
    image::RgbImage::from_pixel(2, 1, image::Rgb([188; 3])).save(&file).expect("a file");
    let mut warnings = Warnings::default();
    let source = kiln::import::environment(file.to_str().expect("UTF-8"), &mut warnings).expect("an image");
    let kiln::scene::EnvironmentSource::Image(image) = source else { panic!("{source:?}") };
    assert!((image.pixels[0][0] - 0.5029).abs() < 1e-4, "{:?}", image.pixels);
    assert!(warnings.notes()[0].contains("no light brighter than white"), "{:?}", warnings.notes());
}

/// An ASCII PLY file with `count` vertices, from its fourth line on `rest`: line 7.
fn ply(count: &str, rest: &str) -> String {
    let xyz = "property float x\nproperty float y\nproperty float z";
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{xyz}\n{rest}")
}

#[test]
fn faults_of_ply_files_have_their_line_and_advice() {
    let folder = Folder::new();
    let one = |text: &str| format!("ply\nelement vertex 1\n{text}\n");
    let faces = |text: &str| {
        ply("3", &format!("element face 1\nproperty {text}\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"))
    };
    let cases = [
        (String::new(), "a.ply: is empty", "copy it again"),
        ("plyx\n".into(), "a.ply:1: a PLY file begins with `ply`", "as PLY"),
        ("ply".into(), "a.ply:1: the header does not end with a line `end_header`", "again"),
        ("ply\nend_header\n".into(), "a.ply:2: the header has no line `format`", "again"),
        (
            "ply\nformat asci 1.0\n".into(),
            "a.ply:2: not a format of PLY files after `format`",
            "correct the header",
        ),
        ("ply\nelement vertex -1\n".into(), "a.ply:2: `element` without a number of elements", "correct"),
        ("ply\nproperty int x\n".into(), "a.ply:2: a property before the first element", "correct"),
        ("ply\nelements 3\n".into(), "a.ply:2: not a statement of PLY headers", "correct"),
        (one("property list int"), "a.ply:3: a property without a type or a name", "correct"),
        (one("property half x"), "a.ply:3: `property` of a type that PLY files do not have", "correct"),
        (
            one("property list half int x"),
            "a.ply:3: `property` of a type that PLY files do not have",
            "correct",
        ),
        (one("format ascii 1.0\nend_header"), "a.ply:2: its vertices have no `x`, `y` and `z`", "again"),
        // Three digits and three separators each, the last of which may be missing; three lines of six bytes and that
        // one.
        (ply("2", "end_header\n1e 0 0\n0 0 0\n"), "a.ply:8: not a number", "again"),
        (ply("2", "end_header\n0 0\n0 0 0 0 0\n"), "a.ply:8: fewer values than the header says", "again"),
        (ply("0", "element vertex 1\nend_header\n"), "a.ply:7: its vertices have no", "again"),
        (
            ply("1", "element vertex 0\nproperty int x\nend_header\n0 0 0\n"),
            "a.ply:7: a second element `vertex`",
            "again",
        ),
        (
            faces("list uchar int vertex_index"),
            "a.ply:13: vertex 3 does not exist; there are 3 before the faces, counted from 0",
            "again",
        ),
        (faces("list uchar int vertices"), "a.ply:7: its faces have no `vertex_indices`", "again"),
    ];
    for (text, expected, hint) in cases {
        let e = folder.fails("a.ply", &text);
        let said = e.to_string().replace(&format!("{}/", folder.0.path().display()), "");
        assert!(
            said.starts_with(expected) && said.lines().count() == 1,
            "{text}\nsaid {said}\nnot  {expected}"
        );
        assert!(e.hint().contains(hint), "{text}\nhint {}", e.hint());
    }
    // Errors in binary data name the byte: after 3 f32 a vertex, the list's length and an index.
    let text = faces("list uchar int vertex_index").replace("ascii", "binary_little_endian");
    let header = text.find("end_header\n").expect("a header") + "end_header\n".len();
    let mut bytes = text.as_bytes()[..header].to_vec();
    bytes.extend([0; 36]);
    bytes.extend([3, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let e = folder.fails("a.ply", &bytes);
    let place = format!("a.ply: byte {}: vertex 9 does not exist", header + 36 + 1 + 3 * 4);
    assert!(e.to_string().contains(&place), "{e}");
}

/// Files with fewer elements than declared: the complete ones are used, with a warning.
#[test]
fn ply_files_that_are_shorter_than_their_header() {
    let folder = Folder::new();
    for (count, rows, there) in
        [("4", "0 0 0\n0 0 0\n0 0 0\n", 3), ("18446744073709551615", "0 0 0\n", 1), ("2", "0 0 0 0 0\n", 1)]
    {
        let (_, warnings) = folder.load("a.ply", ply(count, &format!("end_header\n{rows}")));
        let what = format!(
            "a.ply: ends after {there} of {count} elements (vertex); the complete elements are drawn"
        );
        assert_eq!(warnings[0], what);
    }
}

#[test]
fn ply_and_stl_become_meshes_as_obj_does() {
    let (scene, warnings) = fixture("square.ply");
    assert_eq!(warnings, [""; 0]);
    let square = mesh(&scene, 0);
    assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    assert_eq!(scene.objects[0].name, "square");
    let colours = &square.colours.as_ref().expect("colours").values;
    assert_eq!(colours[1..4], [DVec3::Y, DVec3::Z, DVec3::ONE]);
    // The same in OBJ: the same mesh and material.
    let folder = Folder::new();
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nv 2 0 0 1 0 0\nv 3 0 0 1 0 0\nv 2 1 0 1 0 0\n\
               f 1 2 3 4\nf 5 6 7\n";
    let (of_obj, _) = folder.load("square.obj", obj);
    assert_eq!(mesh(&of_obj, 0), square);
    let material = |scene: &Scene| format!("{:?}", scene.materials[scene.objects[0].material.0 as usize]);
    assert_eq!(material(&of_obj), material(&scene));

    let (scene, warnings) = fixture("tetrahedron.stl");
    assert_eq!((warnings.len(), scene.objects[0].name.as_str()), (0, "tetrahedron"));
    let tetrahedron = mesh(&scene, 0);
    assert_eq!((tetrahedron.positions.len(), tetrahedron.triangles.len()), (4, 4));
    // Every edge has one triangle on each side.
    let edges = tetrahedron.triangles.iter().flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut passed: Vec<_> = edges.map(|(a, b)| if a < b { (a, b, 1) } else { (b, a, -1) }).collect();
    passed.sort_unstable();
    assert!(passed.chunks(2).all(|pair| pair[0].2 + pair[1].2 == 0), "{passed:?}");

    // In a scene file, together with other objects.
    let fixtures = repository("assets/import").display().to_string();
    let toml =
        format!("[[mesh]]\nfile = '{fixtures}/square.ply'\n[[mesh]]\nfile = '{fixtures}/tetrahedron.stl'\n");
    assert_eq!(folder.load("a.toml", toml).0.primitive_count(), 3 + 4);
}

/// Colours of faces are linear in a scene: red and blue are 1, 0, 0 and 0, 0, 1 in any encoding.
#[test]
fn off_and_3mf_become_meshes() {
    let (scene, warnings) = fixture("square.off");
    assert_eq!(warnings, [""; 0]);
    let square = mesh(&scene, 0);
    assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(square.colours.as_ref().expect("colours").values, [DVec3::X, DVec3::Z]);
    assert_eq!(seen(scene, [0.0, 0.0], [1.0, 1.0], [2, 2])[3], [255, 0, 0]);

    let (scene, warnings) = fixture("tetrahedron.3mf");
    assert_eq!((warnings, scene.objects[0].name.as_str()), (Vec::new(), "tetrahedron"));
    // Twice as large, and moved by 5 in x.
    assert_eq!(scene.bounds(), Some((v(5.0, 0.0, 0.0), v(7.0, 2.0, 2.0))));
    assert_eq!(mesh(&scene, 0).colours.as_ref().expect("colours").values.len(), 1);
}

/// Pairs of a file's ending and its contents.
type Files<T> = Vec<(&'static str, T)>;

/// One triangle in each format: text and other contents.
fn triangles_of_all_formats() -> (Files<String>, Files<Vec<u8>>) {
    let obj = format!("# made by hand\no one\n{OBJ_TRIANGLE}f 1 2 3\n");
    let facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let rows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let of_ply =
        ply("3", &format!("element face 1\nproperty list uchar int vertex_index\nend_header\n{rows}"));
    let text = vec![
        ("obj", obj),
        ("stl", format!("solid a\n{facet}endsolid a\n")),
        ("stl", facet.to_owned()),
        ("ply", of_ply),
        ("off", format!("# x\nOFF\n3 1 0\n{rows}")),
        ("gltf", Model::triangle().text()),
        ("toml", "# x\n[[triangles]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n".into()),
    ];
    // Headers of binary STL may begin as other files do, or be UTF-16. A facet: normal, corners, two bytes.
    let binary_stl = |header: &[u8], more: usize| {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend([1, 0, 0, 0]);
        let numbers: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(vec![0; 2 + more]);
        bytes
    };
    let object = "<object id=\"1\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\
                  <vertex x=\"0\" y=\"1\" z=\"0\"/></vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/>\
                  </triangles></mesh></object>";
    let mut other: Vec<(&str, Vec<u8>)> =
        vec![("glb", Model::triangle().binary()), ("3mf", three_mf(object, "<item objectid=\"1\"/>"))];
    for header in
        [&b""[..], b"solid a", b"off-centre part", b"OFF the shelf", b"{", b"v 1", b"a=1", b"a\0b\0c\0"]
    {
        other.push(("stl", binary_stl(header, 0)));
    }
    other.push(("stl", binary_stl(b"with a line end", 1)));
    (text, other)
}

/// Every format is read by its contents under every name, from memory, and as text in UTF-8 and UTF-16, with a byte
/// order mark and without. A note names an ending of another format.
#[test]
fn contents_decide_what_a_file_is() {
    let folder = Folder::new();
    let (text, mut all) = triangles_of_all_formats();
    for (kind, text) in text {
        all.push((kind, format!("\u{feff}{text}").into()));
        for mark in ["", "\u{feff}"] {
            let units = || mark.encode_utf16().chain(text.encode_utf16());
            all.push((kind, units().flat_map(u16::to_le_bytes).collect()));
            all.push((kind, units().flat_map(u16::to_be_bytes).collect()));
        }
        all.push((kind, text.into()));
    }
    for (kind, bytes) in all {
        let start = String::from_utf8_lossy(&bytes[..20]).into_owned();
        let of_memory =
            kiln::import::load_bytes(bytes.clone(), &ImportOptions::default(), &mut Warnings::default());
        assert_eq!(of_memory.unwrap_or_else(|e| panic!("{start}: {e}")).primitive_count(), 1, "{start}");
        for name in ["a", "a.obj", "a.stl", "a.ply", "a.glb", "a.toml", "a.3mf", "a.off", "a.png", "a.vrm"] {
            let file = folder.write(name, &bytes);
            let mut warnings = Warnings::default();
            let scene = kiln::import::load(&[file], &mut warnings).unwrap_or_else(|e| panic!("{start}: {e}"));
            assert_eq!(scene.primitive_count(), 1, "{start} as {name}");
            let is_noted = warnings.notes().iter().any(|note| note.contains("by its contents"));
            let format = |ending: &str| ending.replace("gltf", "glb");
            let agrees = name == "a" || name.ends_with(&format(kind));
            assert_eq!(is_noted, !agrees, "{start} as {name}: {:?}", warnings.notes());
        }
    }
}

/// Meshes of scene files are known by their contents, too. Scene files are none.
#[test]
fn meshes_of_scene_files_are_known_by_their_contents() {
    let folder = Folder::new();
    folder.write("mesh", format!("{OBJ_TRIANGLE}f 1 2 3\n"));
    assert_eq!(folder.load("a.toml", "[[mesh]]\nfile = 'mesh'\n").0.primitive_count(), 1);
    folder.write("b.obj", "[[mesh]]\nfile = 'b.obj'\n");
    let e = folder.fails("a.toml", "[[mesh]]\nfile = 'b.obj'\n");
    assert_eq!(message(&e), "a.toml:1: `b.obj` is not a mesh");
}

/// A decimal comma is read as a point, in every text format of meshes, with a warning of the first line.
#[test]
fn decimal_commas_are_read_as_points() {
    let folder = Folder::new();
    let (text, _) = triangles_of_all_formats();
    let lines = [("obj", 3), ("stl", 4), ("ply", 10), ("off", 4)];
    for (kind, text) in text.into_iter().filter(|(_, text)| !text.starts_with("facet")) {
        let Some(&(_, line)) = lines.iter().find(|(known, _)| *known == kind) else { continue };
        // The first vertex: 0 0 0.
        let name = format!("a.{kind}");
        let (scene, warnings) = folder.load(&name, text.replacen("0 0 0", "0,0 -0,5 2,5e-1", 1));
        assert_eq!(warnings, [format!("{name}:{line}: a decimal comma is read as a point")]);
        assert_eq!(scene.bounds().map(|(min, _)| min.y), Some(-0.5), "{kind}");
        let e = folder.fails(&name, text.replacen("0 0 0", "0,0,0 0 0", 1));
        assert!(e.to_string().contains(&format!("{name}:{line}: ")), "{e}");
    }
}

/// Standard input has no name, so its first bytes tell the format.
#[test]
fn formats_are_known_by_their_first_word() {
    let body = "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let read = |text: &str| {
        kiln::import::load_bytes(
            text.as_bytes().to_vec(),
            &ImportOptions::default(),
            &mut Warnings::default(),
        )
    };
    for head in ["OFF\n", "off\n", "# by hand\n\n  # again\r\nOFF # x\n", "\u{feff}Off\n", "OFF", "cOff#x\n"]
    {
        let scene = read(&format!("{head}{body}")).unwrap_or_else(|e| panic!("{head}: {e}"));
        assert_eq!(scene.primitive_count(), 1, "{head}");
    }
    let fault = |text: &str| read(text).expect_err("it is no mesh").to_string();
    assert!(fault("# x\n4OFF\n").contains("not three-dimensional"), "{}", fault("4OFF\n"));
    let [header, rows] =
        ["element face 1\nproperty list uchar int vertex_index\n", "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"];
    let of_ply = ply("3", &format!("{header}end_header\n{rows}")).replacen("ply\n", "ply  \n", 1);
    assert_eq!(read(&of_ply).expect("a triangle").primitive_count(), 1);
    assert!(fault(&of_ply.replacen("ply", "PLY", 1)).contains("begins with `ply`"));
    assert_eq!(read("\u{feff}{\"asset\": {\"version\": \"2.0\"}}").expect("no mesh").primitive_count(), 0);
    // Scene files may begin with a comment, too, and keys may begin with the word.
    assert!(fault("# x\noffset = 1\n").contains("offset"), "{}", fault("# x\noffset = 1\n"));
}

/// Lists of a 3MF file are refused before they exceed the memory limit, of which 64 MiB are left. A reference takes
/// 168 bytes, and an empty object as much: 400,000 take 64 MiB.
#[test]
fn lists_of_3mf_files_are_checked_before_memory_is_allocated() {
    let folder = Folder::new();
    let mesh = "<object id=\"1\"><mesh/></object>";
    let many = |text: &str| text.repeat(400_000);
    let components = many("<component objectid=\"1\"/>");
    let objects: String = (0..400_000).map(|id| format!("<object id=\"{id}\"><mesh/></object>")).collect();
    for (resources, build) in [
        (mesh.to_owned(), many("<item objectid=\"1\"/>")),
        (format!("{mesh}<object id=\"2\"><components>{components}</components></object>"), String::new()),
        (objects, String::new()),
    ] {
        let file = folder.write("a.3mf", three_mf(&resources, &build));
        let kiln = std::process::Command::new(env!("CARGO_BIN_EXE_kiln"))
            .args(["info", "--memory-limit", "128M"])
            .arg(&file)
            .output()
            .expect("kiln runs");
        let said = String::from_utf8_lossy(&kiln.stderr);
        assert_eq!(kiln.status.code(), Some(3), "{said}");
        assert!(said.contains("a.3mf: 3D/3dmodel.model: more than "), "{said}");
        assert!(said.contains(" of 128 MiB are left (--memory-limit)"), "{said}");
    }
}

#[test]
fn what_ply_and_stl_files_lack_is_said() {
    let folder = Folder::new();
    let (scene, warnings) = folder.load("a.ply", ply("1", "end_header\n0 0 0\n"));
    assert_eq!(scene.primitive_count(), 0);
    assert_eq!(warnings, ["a.ply: 1 vertices without faces; points are not drawn"]);
    let two = "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 1\n1 0 0\nnan 1 0\n2 0 1 7\n";
    let (_, warnings) = folder.load("a.ply", ply("3", two));
    assert_eq!(
        warnings,
        [
            "a.ply: 2 line(s) have surplus values, which are left out",
            "a.ply: 3 vertices without faces; points are not drawn",
            "a.ply: left out 1 face(s) of fewer than three corners",
        ]
    );
    let (scene, warnings) = folder.load("a.stl", "solid a\n");
    assert_eq!(scene.primitive_count(), 0);
    assert_eq!(warnings, ["a.stl: ends without `endsolid`, so it may not be whole"]);
}

#[test]
fn every_importer_has_a_row_in_the_docs_and_a_fixture() {
    let page =
        std::fs::read_to_string(repository("docs/command-line.md")).expect("the page of the command line");
    let mut files = Vec::new();
    for folder in ["assets/import", "scenes"] {
        let entries = std::fs::read_dir(repository(folder)).expect("a folder of fixtures");
        files.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    for importer in kiln::import::IMPORTERS {
        let endings: Vec<String> = importer.endings.iter().map(|ending| format!("`.{ending}`")).collect();
        let row = format!("\n| {} | {} | ", importer.name, endings.join(", "));
        assert!(page.contains(&row), "docs/command-line.md has no row {row:?}");
        let is_its = |file: &&PathBuf| {
            file.extension().is_some_and(|e| importer.endings.iter().any(|ending| e == *ending))
        };
        let fixture = files.iter().find(is_its);
        let fixture = fixture.unwrap_or_else(|| panic!("no fixture of {} in assets/import", importer.name));
        assert!(load(fixture).0.primitive_count() > 0, "{} is empty", fixture.display());
    }
}

#[test]
fn inputs_that_are_not_there_or_not_known() {
    let folder = Folder::new();
    let fails = |name: &str| {
        let file = folder.0.path().join(name);
        kiln::import::load(&[file], &mut Warnings::default()).expect_err("it cannot be read")
    };
    assert_eq!(message(&fails("gone.obj")), "gone.obj: no such file");
    folder.write("a.3ds", "MM");
    let e = fails("a.3ds");
    assert_eq!(message(&e), "a.3ds: not a kind of file that kiln reads");
    assert!(e.hint().contains(".toml, .obj, .gltf, .glb, .ply, .stl, .off, .3mf"), "{}", e.hint());
    std::fs::create_dir(folder.0.path().join("folder.obj")).expect("the folder can be made");
    assert_eq!(message(&fails("folder.obj")), "folder.obj: is a folder");
}

/// The display window of an OpenEXR file is the picture: 0 beside the data window, which may reach beyond it.
#[test]
fn exr_files_are_placed_by_their_windows() {
    use exr::prelude::WritableImage;
    use exr::prelude::{Encoding, Image, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Vec2};
    let folder = Folder::new();
    let file = folder.0.path().join("a.exr");
    // Two pixels, 1 and 2, the first at (x, y).
    let red = |at: (i32, i32), display: IntegerBounds| {
        let attributes = LayerAttributes { layer_position: Vec2(at.0, at.1), ..LayerAttributes::default() };
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32 + 1.0, 0.0f32, 0.0f32));
        let mut image = Image::from_layer(Layer::new((2, 1), attributes, Encoding::UNCOMPRESSED, channels));
        image.attributes.display_window = display;
        image.write().to_file(&file).expect("the file is written");
        let read = kiln::film::read::read_picture(&file).map_err(|e| e.to_string())?;
        Ok::<_, String>((read.width, read.height, read.values.iter().map(|[r, ..]| *r).collect::<Vec<_>>()))
    };
    let window = |x: i32, y: i32, width: usize, height: usize| IntegerBounds::new((x, y), (width, height));
    assert_eq!(red((5, -3), window(5, -3, 2, 1)), Ok((2, 1, vec![1.0, 2.0])));
    assert_eq!(red((1, 1), window(0, 0, 4, 2)), Ok((4, 2, vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0])));
    assert_eq!(red((-1, 0), window(0, 0, 2, 1)), Ok((2, 1, vec![2.0, 0.0])));
    assert_eq!(red((0, 0), window(0, 0, 1, 1)), Ok((1, 1, vec![1.0])));
    assert_eq!(red((7, 9), window(0, 0, 2, 1)), Ok((2, 1, vec![0.0, 0.0])));
    // Outside of an opaque data window the picture is transparent.
    red((1, 1), window(0, 0, 4, 2)).expect("a picture");
    let alpha = kiln::film::read::read_picture(&file).map(|read| read.alpha);
    assert_eq!(alpha.unwrap(), Some(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]));
    red((5, -3), window(5, -3, 2, 1)).expect("a picture");
    assert_eq!(kiln::film::read::read_picture(&file).map(|read| read.alpha).unwrap(), None);
    let huge = red((0, 0), window(0, 0, 1 << 20, 1 << 20)).expect_err("too large");
    assert!(huge.contains("a picture of 1048576 x 1048576 pixels"), "{huge}");
}
