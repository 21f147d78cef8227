//! Files that an input references: which paths are followed, and that no message quotes what a file holds.

use std::path::{Path, PathBuf};

use kiln::error::Warnings;
use kiln::import::load_and_list;
use kiln::scene::{ImportOptions, Scene};

use crate::common::repository;

/// A folder with the folder `in` of an input, and files beside it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = Folder(tempfile::tempdir().expect("a temporary folder can be made"));
        for (name, bytes) in files {
            let file = folder.path(name);
            std::fs::create_dir_all(file.parent().expect("files lie in folders")).expect("a folder");
            std::fs::write(file, bytes).expect("the temporary folder can be written to");
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The scene of a file or its error, all messages, and the names of all files that were opened or looked up.
    fn load(&self, name: &str, is_outside_allowed: bool) -> (Result<Scene, String>, String, Vec<String>) {
        let options =
            ImportOptions { allow_outside_references: is_outside_allowed, ..ImportOptions::default() };
        let mut warnings = Warnings::default();
        let (scene, files) = load_and_list(&[self.path(name)], &options, &mut warnings);
        let said = [warnings.messages(), warnings.notes()].concat().join("\n");
        let scene = scene.map_err(|e| format!("{e}: {}", e.hint()));
        let own = |file: &Path| file.strip_prefix(self.0.path()).unwrap_or(file).display().to_string();
        (scene, said, files.iter().map(|read| own(&read.file)).collect())
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";

fn picture() -> Vec<u8> {
    std::fs::read(repository("assets/import/four.png")).expect("a picture")
}

/// The libraries of an OBJ and the images of an MTL outside of the OBJ's folder are neither opened nor looked up, unless
/// that is asked for.
#[test]
fn obj_and_mtl_stay_in_their_folder() {
    let picture = picture();
    let outside = Folder::new(&[("a.mtl", b"newmtl a\nKd 1 0 0\n"), ("a.png", &picture)]);
    for by in ["../", "m/../../", "..\\", &format!("{}/", outside.0.path().display())] {
        let obj = format!("mtllib {by}a.mtl\n{TRIANGLE}");
        let mtl = format!("newmtl a\nKd 1 0 0\nmap_Kd {by}a.png\nbump {by}a.png\nmap_Pr {by}a.png\n");
        let folder = Folder::new(&[
            ("a.mtl", b"newmtl a\nKd 1 0 0\n"),
            ("a.png", &picture),
            ("in/m/empty", b""),
            ("in/library.obj", obj.as_bytes()),
            ("in/images.obj", format!("mtllib own.mtl\n{TRIANGLE}").as_bytes()),
            ("in/own.mtl", mtl.as_bytes()),
        ]);
        let (scene, said, files) = folder.load("in/library.obj", false);
        assert_eq!(scene.expect("it is drawn in grey").materials.len(), 1, "{by}");
        assert_eq!(files, ["in/library.obj"], "{by}");
        assert!(said.contains("outside the file's folder; --allow-outside-references"), "{by}: {said}");
        let (scene, said, files) = folder.load("in/images.obj", false);
        assert_eq!(scene.expect("it is drawn without images").images.len(), 0, "{by}");
        assert_eq!(files, ["in/images.obj", "in/own.mtl"], "{by}");
        // The three maps name the same file.
        assert_eq!(said.matches("outside the file's folder").count(), 1, "{by}: {said}");
        let (scene, said, _) = folder.load("in/library.obj", true);
        assert_eq!((scene.expect("a scene").materials[0].name(), said.as_str()), ("a", ""), "{by}");
        let (scene, said, _) = folder.load("in/images.obj", true);
        assert!(!scene.expect("a scene").images.is_empty() && !said.contains("outside"), "{by}: {said}");
    }
}

/// Images beside the folder of an MTL are below the folder of the OBJ.
#[test]
fn an_mtl_reaches_the_folder_of_its_obj() {
    let folder = Folder::new(&[
        ("in/a.obj", format!("mtllib materials/a.mtl\n{TRIANGLE}").as_bytes()),
        ("in/materials/a.mtl", b"newmtl a\nmap_Kd ../textures/a.png\n"),
        ("in/textures/a.png", &picture()),
    ]);
    let (scene, said, _) = folder.load("in/a.obj", false);
    assert_eq!((scene.expect("a scene").images.len(), said.as_str()), (1, ""));
    // Beyond it, the warning names the path as the MTL gives it.
    std::fs::write(folder.path("in/materials/a.mtl"), "newmtl a\nmap_Kd ../../b.png\n").expect("a file");
    let (_, said, _) = folder.load("in/a.obj", false);
    assert!(said.contains("`../../b.png` is outside the file's folder"), "{said}");
}

/// The same option applies to glTF; without it, a buffer outside is an error, an image a warning.
#[test]
fn gltf_stays_in_its_folder() {
    let json = r#"{"asset": {"version": "2.0"}, "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3,
        "type": "VEC3"}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": 36, "uri": "../a.bin"}], "images": [{"uri": "../a.png"}]}"#;
    let positions: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect();
    let folder = Folder::new(&[("in/a.gltf", json.as_bytes()), ("a.bin", &positions), ("a.png", &picture())]);
    let (scene, _, files) = folder.load("in/a.gltf", false);
    let e = scene.expect_err("the buffer is outside");
    assert!(
        e.contains("buffer 0: `../a.bin` is outside the file's folder; --allow-outside-references"),
        "{e}"
    );
    assert_eq!(files, ["in/a.gltf"]);
    let (scene, said, files) = folder.load("in/a.gltf", true);
    assert_eq!((scene.expect("a scene").images.len(), said.as_str()), (1, ""));
    assert_eq!(files.len(), 3, "{files:?}");
}

/// A scene file is the user's own text: its meshes lie anywhere. What these reference does not.
#[test]
fn a_scene_file_names_meshes_anywhere() {
    let folder = Folder::new(&[
        ("in/a.toml", b"[[mesh]]\nfile = '../models/a.obj'\n"),
        ("models/a.obj", format!("mtllib ../a.mtl\n{TRIANGLE}").as_bytes()),
        ("a.mtl", b"newmtl a\n"),
    ]);
    let (scene, said, files) = folder.load("in/a.toml", false);
    assert_eq!(scene.expect("a scene").objects.len(), 1);
    assert_eq!(files, ["in/../models/a.obj", "in/a.toml"]);
    assert!(
        said.contains("models/a.obj: materials left out: `../a.mtl` is outside the file's folder"),
        "{said}"
    );
}

/// A file that is not what its name says may hold secrets, and messages end up in logs: they quote keywords of the
/// format alone. Each text has the secret where a keyword or a number should be.
#[test]
fn messages_do_not_quote_what_a_file_holds() {
    let secret = "hunter2";
    let obj = |line: &str| (format!("{TRIANGLE}{line}\n"), "a.obj");
    let mtl = |line: &str| (format!("newmtl a\n{line}\n"), "a.mtl");
    let ply = |header: &str, data: &str| {
        let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
        (format!("ply\nformat ascii 1.0\n{vertex}{header}end_header\n{data}"), "a.ply")
    };
    let stl = |line: &str| (format!("solid\n{line}\nendsolid\n"), "a.stl");
    let texts = [
        obj("hunter2"),
        obj("hunter2 1 2 3"),
        obj("v hunter2 0 0"),
        obj("v 0 0 0 hunter2"),
        obj("v 0 0 -hunter2"),
        obj("f 1 hunter2 3"),
        obj("s hunter2"),
        mtl("hunter2"),
        mtl("hunter2 0.5"),
        mtl("Kd hunter2"),
        mtl("map_hunter2 a.png"),
        mtl("map_hunter2"),
        mtl("illum hunter2"),
        (format!("{secret}\n"), "a.ply"),
        (format!("ply\n{secret}\n"), "a.ply"),
        (format!("ply\nformat {secret} 1.0\nend_header\n"), "a.ply"),
        (format!("ply\nelement vertex {secret}\nend_header\n"), "a.ply"),
        ply("property hunter2 a\n", ""),
        ply("", "0 0 hunter2\n"),
        ply("element hunter2 1000\nproperty float a\n", "0 0 0\n"),
        stl("hunter2"),
        stl("facet normal 0 0 1\nouter loop\nvertex 0 0 hunter2"),
        stl("facet normal 0 0 1\nouter loop\nvertex 0 0 0\nhunter2"),
        (format!("{secret}\n"), "a.gltf"),
        (format!(r#"{{"asset": "{secret}"}}"#), "a.gltf"),
        (format!(r#"{{"{secret}": 1}}"#), "a.gltf"),
    ];
    for (text, name) in texts {
        let folder = Folder::new(&[
            ("in/a.obj", format!("mtllib a.mtl\n{TRIANGLE}").as_bytes()),
            (&format!("in/{name}"), text.as_bytes()),
        ]);
        let input = if name == "a.mtl" { "in/a.obj" } else { &format!("in/{name}") };
        let (scene, said, _) = folder.load(input, false);
        let said = format!("{said}\n{}", scene.err().unwrap_or_default());
        assert!(!said.contains(secret), "{name}: {text}: {said}");
    }
}

/// Names from exporters on other machines: of an MTL file, its image, and an image of a glTF file.
#[test]
fn files_are_found_by_what_their_names_mean() {
    let picture = picture();
    let folder = Folder::new(&[
        ("in/two.mtl", b"newmtl a\n"),
        ("in/tex/my two.png", &picture),
        ("in/one/twice.png", &picture),
        ("in/other/Twice.png", &picture),
        ("in/.hidden/hidden.png", &picture),
        ("outside.png", &picture),
    ]);
    let found = [
        ("mtllib", "TWO.MTL", "two.mtl"),
        ("mtllib", "resources/two.mtl", "two.mtl"),
        ("mtllib", "C:\\Users\\me\\Two.mtl", "two.mtl"),
        ("mtllib", "/home/x/two.mtl", "two.mtl"),
        ("mtllib", "\"two.mtl\"", "two.mtl"),
        ("mtllib", "two.mtl # of a tool", ""),
        ("mtllib", "./two.mtl", ""),
        ("map_Kd", "tex/My Two.PNG", "tex/my two.png"),
        ("map_Kd", "TEX\\my two.png", "tex/my two.png"),
        ("map_Kd", "my two.png", "tex/my two.png"),
        ("map_Kd", "\"C:\\a b\\my two.png\"", "tex/my two.png"),
        ("map_Kd", "-s 1 1 1 '/x/my two.png'", "tex/my two.png"),
        ("map_Kd", "tex/my%20two.png", "tex/my two.png"),
        ("map_Kd", "tex/my\\ two.png", ""),
        ("map_Kd", "../../my two.png", "tex/my two.png"),
        ("uri", "TEX/my%20two.png", "tex/my two.png"),
        ("uri", "file:///C:/Users/me/my%20two.png", "tex/my two.png"),
        ("uri", "tex\\\\my two.png", ""),
    ];
    let write = |key: &str, name: &str| {
        let (library, map) = match key {
            "mtllib" => (name, String::new()),
            _ => ("own.mtl", format!("newmtl a\n{key} {name}\n")),
        };
        std::fs::write(folder.path("in/a.obj"), format!("mtllib {library}\n{TRIANGLE}")).expect("a file");
        std::fs::write(folder.path("in/own.mtl"), map).expect("a file");
        let gltf = format!(r#"{{"asset": {{"version": "2.0"}}, "images": [{{"uri": "{name}"}}]}}"#);
        std::fs::write(folder.path("in/a.gltf"), gltf).expect("a file");
        if key == "uri" { "in/a.gltf" } else { "in/a.obj" }
    };
    for (key, name, expected) in found {
        let (scene, said, _) = folder.load(write(key, name), false);
        let scene = scene.unwrap_or_else(|e| panic!("{key} {name}: {e}"));
        let is_read =
            if key == "mtllib" { scene.materials[0].name() == "a" } else { scene.images.len() == 1 };
        assert!(is_read, "{key} {name}: {said}");
        assert_eq!(
            said.contains(&format!("is read from `{expected}`")),
            !expected.is_empty(),
            "{key} {name}: {said}"
        );
    }
    // Two files of the name differ in case. The hidden one and the one outside are not searched.
    for (name, expected) in [
        ("twice.PNG", "candidates: `one/twice.png`, `other/Twice.png`"),
        ("hidden.png", "hidden.png: texture left out: no such file"),
        ("/x/outside.png", "`/x/outside.png` is outside the file's folder"),
    ] {
        let (scene, said, _) = folder.load(write("map_Kd", name), false);
        assert_eq!(scene.expect("a scene").images.len(), 0);
        assert!(said.contains(expected), "{name}: {said}");
    }
    // An exact match is preferred to one that differs in case.
    let (scene, said, _) = folder.load(write("map_Kd", "C:\\Twice.png"), false);
    assert!(scene.expect("a scene").images.len() == 1 && said.contains("`other/Twice.png`"), "{said}");
    // An OBJ and its MTL file that were renamed together.
    std::fs::write(folder.path("in/pair.obj"), format!("mtllib untitled.mtl\n{TRIANGLE}")).expect("a file");
    std::fs::write(folder.path("in/Pair.mtl"), "newmtl a\n").expect("a file");
    let (scene, said, _) = folder.load("in/pair.obj", false);
    assert_eq!(scene.expect("a scene").materials[0].name(), "a");
    assert!(said.contains("`untitled.mtl` is read from `Pair.mtl`"), "{said}");
    // Several on a line, with spaces in their names; the second is there.
    let obj = format!("mtllib not there.mtl two.mtl\n{TRIANGLE}");
    std::fs::write(folder.path("in/several.obj"), obj).expect("a file");
    let (scene, said, _) = folder.load("in/several.obj", false);
    assert_eq!(scene.expect("a scene").materials[0].name(), "a");
    assert!(said.contains("materials left out") && said.contains("not there.mtl"), "{said}");
}

/// Names in NFC of files in NFD, as macOS stores them, and the other way round: of an MTL file, images, a buffer, and
/// the mesh and the environment of a scene file; also in other folders and in another case. A name as written goes
/// first.
#[test]
fn files_are_found_in_either_normalization() {
    let (composed, decomposed) = ("caf\u{e9}", "cafe\u{301}");
    let picture = picture();
    for (written, stored) in [(composed, decomposed), (decomposed, composed)] {
        let obj = format!("mtllib {written}.mtl\n{TRIANGLE}");
        let mtl = format!("newmtl a\nmap_Kd {written}/{written}.png\n");
        let gltf = format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}], "images": [{{"uri": "{written}.PNG"}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
            "buffers": [{{"uri": "{}.bin", "byteLength": 36}}]}}"#,
            percent_encoding::utf8_percent_encode(written, percent_encoding::NON_ALPHANUMERIC)
        );
        let toml = format!("[environment]\nfile = '{written}.hdr'\n[[mesh]]\nfile = '{written}.obj'\n");
        let corners = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let buffer: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81";
        let folder = Folder::new(&[
            (&format!("in/{stored}.obj"), obj.as_bytes()),
            (&format!("in/{stored}.mtl"), mtl.as_bytes()),
            (&format!("in/{stored}/{stored}.png"), &picture),
            (&format!("in/{stored}.bin"), &buffer),
            (&format!("in/{stored}.hdr"), hdr),
            ("in/a.gltf", gltf.as_bytes()),
            ("in/a.toml", toml.as_bytes()),
        ]);
        for (input, found) in [
            (format!("in/{stored}.obj"), vec![format!("{stored}.mtl"), format!("{stored}/{stored}.png")]),
            ("in/a.gltf".into(), vec![format!("{stored}.bin"), format!("{stored}/{stored}.png")]),
            ("in/a.toml".into(), vec![format!("{stored}.obj"), format!("{stored}.hdr")]),
        ] {
            let (scene, said, _) = folder.load(&input, false);
            let scene = scene.unwrap_or_else(|e| panic!("{input}: {e}"));
            assert_eq!((scene.objects.len(), scene.images.len()), (1, 1), "{input}: {said}");
            for file in found {
                assert!(said.contains(&format!("is read from `{file}`")), "{input}: {said}");
            }
        }
        std::fs::write(folder.path(&format!("in/{written}.mtl")), "newmtl a\n").expect("a file");
        let (scene, said, _) = folder.load(&format!("in/{stored}.obj"), false);
        assert_eq!((scene.expect("a scene").images.len(), said.as_str()), (0, ""));
    }
}

/// Links that lead out of the folder are followed if a file names them, but not in a search.
#[cfg(unix)]
#[test]
fn searching_stays_in_the_folder() {
    let mtl = b"newmtl a\nmap_Kd C:\\x\\link.png\nbump C:\\x\\a.png\n";
    let folder = Folder::new(&[
        ("in/a.obj", format!("mtllib a.mtl\n{TRIANGLE}").as_bytes()),
        ("in/a.mtl", mtl),
        ("out/a.png", &picture()),
    ]);
    std::os::unix::fs::symlink(folder.path("out/a.png"), folder.path("in/link.png")).expect("a link");
    std::os::unix::fs::symlink(folder.path("out"), folder.path("in/folder")).expect("a link");
    let (scene, said, _) = folder.load("in/a.obj", false);
    assert_eq!(scene.expect("a scene").images.len(), 0, "{said}");
    std::fs::write(folder.path("in/a.mtl"), "newmtl a\nmap_Kd link.png\n").expect("a file");
    let (scene, said, _) = folder.load("in/a.obj", false);
    assert_eq!((scene.expect("a scene").images.len(), said.as_str()), (1, ""));
}

#[test]
fn many_missing_files_are_counted() {
    let mtl: String = (0..1000).map(|i| format!("newmtl m{i}\nmap_Kd {i}.png\n")).collect();
    let folder = Folder::new(&[
        ("in/a.obj", format!("mtllib a.mtl\n{TRIANGLE}").as_bytes()),
        ("in/a.mtl", mtl.as_bytes()),
    ]);
    let (_, said, _) = folder.load("in/a.obj", false);
    // 100 of 1000 by name.
    assert_eq!(said.matches("texture left out").count(), 100);
    assert!(said.contains("900 more files are missing or cannot be used"), "{said}");
}
