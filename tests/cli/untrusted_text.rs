//! Names in files, and of files, are printed escaped, in one line.

use crate::workshop::{Workshop, text};

/// Escape sequences for a colour and a window title, C1, bidirectional override and marks, and a line separator.
const EVIL: &str = "e\u{1b}[31m\u{1b}]0;t\u{7}\u{9b}2J\u{7f}\u{202e}\u{2066}\u{200f}\u{2028}v";

const LINE: &str = "\nkiln: error: forged\r\nhint: forged";

/// Files of every format with these names wherever a name may be.
fn workshop() -> Workshop {
    let shop = Workshop::with(
        "a.obj",
        format!(
            "mtllib a.mtl {EVIL}.mtl\no {EVIL}\ng {EVIL}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl {EVIL}\nf 1/1 2/1 3/1\n"
        ),
    );
    shop.write("a.mtl", format!("newmtl {EVIL}\nmap_Kd {EVIL}.png\nillum {EVIL}\n"));
    let name = serde_json::json!(format!("{EVIL}{LINE}"));
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0", "generator": {name}, "copyright": {name}}},
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "a.bin"}}],
        "images": [{{"uri": "{EVIL_URI}", "name": {name}}}], "textures": [{{"source": 0, "name": {name}}}],
        "materials": [{{"name": {name}, "pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "cameras": [{{"name": {name}, "type": "perspective", "perspective": {{"yfov": 1, "znear": 1}}}}],
        "meshes": [{{"name": {name}, "primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}],
        "nodes": [{{"mesh": 0, "name": {name}}}, {{"camera": 0, "name": {name}, "translation": [0, 0, 5]}}],
        "scenes": [{{"nodes": [0, 1], "name": {name}}}], "scene": 0, "extensionsUsed": [{name}]}}"#,
        EVIL_URI = "e%1B%5B31m%0Akiln:%20error:%20forged.png"
    );
    shop.write("a.gltf", gltf);
    let positions = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    shop.write("a.bin", positions.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    shop.write(
        "a.ply",
        format!(
            "ply\nformat ascii 1.0\ncomment {EVIL}\ncomment TextureFile {EVIL}.png\nobj_info {EVIL}\nelement vertex 3\n\
             property float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int {EVIL}\n\
             property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 3 0 1 2\n"
        ),
    );
    shop.write(
        "a.stl",
        format!(
            "solid {EVIL}\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
             endsolid {EVIL}\n"
        ),
    );
    let toml = serde_json::json!(format!("{EVIL}{LINE}")).to_string().replace('\u{7f}', "\\u007f");
    let scene = format!(
        "[[camera]]\nname = {toml}\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n[material.{toml}]\ncolour = '#fff'\n\
         [[light]]\nname = {toml}\ntype = 'point'\nposition = [0, 0, 9]\n[[light]]\nname = {toml}\ntype = 'point'\n\
         position = [0, 0, 9]\n[[sphere]]\nname = {toml}\nmaterial = {toml}\ncentre = [0, 0, 0]\nradius = 1\n\
         [[sphere]]\nname = {toml}\ncentre = [0, 99, 0]\nradius = 1\n"
    );
    shop.write("a.toml", &scene);
    shop.write("key.toml", format!("{toml} = 1\n"));
    shop.write("value.toml", format!("[image]\nwidth = {toml}\n"));
    shop.write("syntax.toml", format!("[image]\nwidth = {EVIL}\n"));
    shop.write("missing.toml", format!("{scene}[[mesh]]\nfile = {toml}\n"));
    shop.write("effect.toml", format!("{scene}[effects]\n{toml} = true\n"));
    shop.write("bad.obj", format!("{EVIL} 1\nv {EVIL}\nf {EVIL}\n"));
    shop.write("bad.ply", format!("ply\nformat {EVIL}\n"));
    shop.write("bad.stl", format!("solid {EVIL}\nfacet {EVIL}\n"));
    shop.write("bad.gltf", format!("{{\"asset\": {{\"version\": {name}}}, {name}: 1"));
    shop
}

#[test]
fn names_are_printed_escaped_in_one_line() {
    let shop = workshop();
    let files = [
        "a.obj",
        "a.gltf",
        "a.ply",
        "a.stl",
        "a.toml",
        "key.toml",
        "value.toml",
        "syntax.toml",
        "missing.toml",
        "effect.toml",
        "bad.obj",
        "bad.ply",
        "bad.stl",
        "bad.gltf",
    ];
    let mut shown = 0;
    for file in files {
        for arguments in [
            format!("info {file}"),
            format!("info {file} --json"),
            format!("explain {file}"),
            format!("explain {file} --json"),
            format!("render {file} -o o.png --size 8x8 --samples 1 --progress plain"),
            format!("render {file} -o o.png --size 8x8 --samples 1 --progress json"),
            format!("render {file} -o o.png --size 8x8 --samples 1 --progress openjd"),
            format!("render {file} -o o.png --size 8x8 --samples 1 --camera nobody"),
            format!("animate {file} -o o_#.png --frames 0 --size 8x8 --samples 1 --progress plain"),
        ] {
            let output = shop.run(&arguments);
            let (result, said) = (text(&output.stdout), text(&output.stderr));
            for text in [&result, &said] {
                let raw = text.chars().find(|&c| {
                    c != '\n' && c.is_control()
                        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
                });
                assert_eq!(raw, None, "{arguments}: {text}");
                let forged = text.lines().find(|line| line.trim_start().starts_with("kiln: error: forged"));
                assert_eq!(forged, None, "{arguments}: {text}");
                let forged = text.lines().find(|line| line.trim_start().starts_with("hint: forged"));
                assert_eq!(forged, None, "{arguments}: {text}");
            }
            shown += usize::from(result.contains("\\u{1b}") || said.contains("\\u{1b}"));
        }
    }
    assert!(shown > 40, "the names are printed: {shown}");
}

/// Of names of two million letters, in files and arguments, the ends are printed.
#[test]
fn long_names_are_printed_in_part() {
    let long = |count: usize| "n".repeat(count);
    let shop = Workshop::with(
        "a.obj",
        format!("o {0}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {0}\nf 1 2 3\n", long(2_000_000)),
    );
    shop.write("a.toml", format!("[image]\n{} = 1\n", long(2_000_000)));
    shop.write("b.toml", format!("[[mesh]]\nfile = '{}.obj'\n", long(2_000_000)));
    let (known, other) = ("a".repeat(500_000), "b".repeat(500_000));
    let sphere = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    shop.write("c.toml", format!("[material.{known}]\ncolour = 'red'\n{sphere}material = '{other}'\n"));
    let picture = "-o o.png --size 8x8 --samples 1";
    for arguments in [
        "info a.obj".to_owned(),
        "explain a.obj".into(),
        format!("render a.obj {picture}"),
        format!("render a.obj {picture} --progress json"),
        format!("render a.obj {picture} --look-at x"),
        format!("render a.obj {picture} --camera {}", long(100_000)),
        format!("render a.obj {picture} --{}", long(100_000)),
        format!("render {} {picture}", long(100_000)),
        "info a.toml".into(),
        "info b.toml".into(),
        "info c.toml".into(),
        format!("animate a.obj -o o.gif --frames 0 --size 16x16 --with {}", long(100_000)),
    ] {
        let output = shop.run(&arguments);
        let (result, said) = (text(&output.stdout), text(&output.stderr));
        let longest = result.lines().chain(said.lines()).map(str::len).max();
        let start = arguments.get(..60).unwrap_or(&arguments);
        assert!(longest.is_some_and(|length| length < 3000), "{start}: {longest:?}");
        assert!(!said.contains("a fault in kiln"), "{start}");
    }
}

/// File names may come from a stranger as well.
#[cfg(unix)]
#[test]
fn names_of_files_are_printed_escaped() {
    let shop = workshop();
    let name = "e\u{1b}[31m\nkiln: error: forged.stl";
    std::fs::copy(shop.path("a.stl"), shop.path(name)).expect("any name");
    for arguments in ["info", "render -o o.png --size 8x8 --samples 1", "explain"] {
        let output = shop.command(arguments).arg(name).output().expect("the command starts");
        let said = text(&output.stdout) + &text(&output.stderr);
        assert!(output.status.success() && !said.contains('\u{1b}'), "{arguments}: {said}");
        assert!(!said.contains("\nkiln: error: forged"), "{arguments}: {said}");
    }
}
