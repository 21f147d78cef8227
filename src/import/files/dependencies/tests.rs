//! Tests of `dependencies`.

use crate::error::Warnings;
use crate::import::files::dependencies::*;
use crate::import::load_and_list;

/// A folder with files.
fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    for (name, bytes) in files {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("files lie in folders")).expect("a folder");
        std::fs::write(file, bytes).expect("the temporary folder can be written to");
    }
    folder
}

/// Whether reading `inputs` of a folder succeeds, and the names of the files it depends on, with `!` before missing
/// ones.
fn listed(folder: &tempfile::TempDir, inputs: &[&str]) -> (bool, Vec<String>) {
    let inputs: Vec<PathBuf> = inputs.iter().map(|name| folder.path().join(name)).collect();
    let (scene, files) = load_and_list(&inputs, &Default::default(), &mut Warnings::default());
    let name = |read: &FileRead| {
        let name = read.file.strip_prefix(folder.path()).expect("a file of the folder").display();
        if read.stamp.is_some() { name.to_string() } else { format!("!{name}") }
    };
    (scene.is_ok(), files.iter().map(name).collect())
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";

#[test]
fn a_scene_is_made_of_what_its_meshes_name() {
    let obj = format!("mtllib m/a.mtl\nmtllib lost.mtl\n{TRIANGLE}usemtl red\nf 1/1 2/1 3/1\n");
    // Images are searched beside the MTL file, then beside the OBJ file.
    let mtl = "newmtl red\nmap_Kd beside.png\nbump heights.png\n";
    let plain = format!("{TRIANGLE}f 1 2 3\n");
    let folder = folder(&[
        ("a.obj", obj.as_bytes()),
        ("m/a.mtl", mtl.as_bytes()),
        ("m/beside.png", b"not a picture"),
        ("s/scene.toml", b"[[mesh]]\nfile = \"../b.obj\"\n[[mesh]]\nfile = \"../b.obj\"\n"),
        ("b.obj", plain.as_bytes()),
    ]);
    let expected = [
        "a.obj",
        "!heights.png",
        "!lost.mtl",
        "m/a.mtl",
        "m/beside.png",
        "!m/heights.png",
        "s/../b.obj",
        "s/scene.toml",
    ];
    let (read, names) = listed(&folder, &["s/scene.toml", "a.obj"]);
    assert!(read);
    let mut sorted = names.clone();
    sorted.sort_by_key(|name| name.trim_start_matches('!').to_owned());
    assert_eq!(sorted, expected);
}

#[test]
fn what_a_gltf_lacks_is_listed() {
    let json = |buffer: &str| {
        let triangle = r#""accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],"#;
        format!(
            r#"{{"asset": {{"version": "2.0"}}, {triangle} "buffers": [{{"byteLength": 36, "uri": "{buffer}"}}],
            "images": [{{"uri": "skin.png"}}, {{"uri": "data:image/png;base64,AAAA"}}, {{"uri": "tex/lost%20one.png"}}]}}"#
        )
    };
    let data = [0u8; 36];
    let folder = folder(&[
        ("a.gltf", json("a.bin").as_bytes()),
        ("a.bin", &data),
        ("skin.png", b"not a picture"),
        ("b.gltf", json("b.bin").as_bytes()),
    ]);
    assert_eq!(
        listed(&folder, &["a.gltf"]),
        (true, ["a.bin", "a.gltf", "skin.png", "!tex/lost one.png"].map(String::from).into())
    );
    // The missing buffer is an error, and no other file was opened.
    assert_eq!(
        listed(&folder, &["b.gltf", "a.gltf"]),
        (false, ["!b.bin", "b.gltf"].map(String::from).into())
    );
    assert_eq!(listed(&folder, &["nothing.obj"]), (false, vec!["!nothing.obj".into()]));
}

#[test]
fn stamps_tell_contents_apart() {
    let folder = folder(&[("a", b"one"), ("b", b"two"), ("empty", b"")]);
    let path = |name: &str| folder.path().join(name);
    let old = Stamp::of(&path("a"));
    assert_eq!(old, Stamp::of(&path("a")));
    assert_eq!(Stamp::of(&path("c")), None);
    assert!(Stamp::of(&path("empty")).expect("it is there").is_empty());
    assert!(!old.expect("it is there").is_empty());
    // Another file of the same size and time under the same name.
    let time = std::fs::metadata(path("a")).and_then(|about| about.modified()).expect("a time");
    let b = std::fs::File::options().write(true).open(path("b")).expect("it is there");
    b.set_modified(time).expect("times can be set");
    drop(b);
    std::fs::rename(path("b"), path("a")).expect("files can be renamed");
    if cfg!(unix) {
        assert_ne!(old, Stamp::of(&path("a")));
    }
    // Another size.
    let old = Stamp::of(&path("a"));
    std::fs::write(path("a"), "three").expect("it can be written");
    assert_ne!(old, Stamp::of(&path("a")));
}
