//! Programs that convert files of formats that are not read.

/// What to do with a file of a format that is not read, by its ending: the programs that convert it.
pub(super) fn advice_on(ending: &str) -> String {
    match ending {
        "fbx" | "dae" | "3ds" | "x3d" | "wrl" | "lwo" | "x" | "ase" | "ac" | "md5mesh" => {
            format!("convert it with Blender or assimp: `assimp export in.{ending} out.glb -fglb2`")
        }
        "blend" | "usd" | "usda" | "usdc" | "usdz" | "abc" => {
            "open it in Blender and export it as glTF: File > Export > glTF 2.0".into()
        }
        "step" | "stp" | "iges" | "igs" | "brep" | "fcstd" => {
            "open it in FreeCAD and export it as glTF or STL".into()
        }
        "max" | "ma" | "mb" | "c4d" | "skp" | "hip" | "3dm" | "dwg" | "dxf" => {
            "export it as glTF (.glb) from the program that made it".into()
        }
        "zip" | "gz" | "7z" | "rar" | "tar" | "xz" | "zst" => "unpack it first".into(),
        "hdr" | "exr" => "--environment takes pictures of the surroundings".into(),
        "png" | "jpg" | "jpeg" | "tif" | "tiff" | "tga" | "dds" | "webp" | "bmp" => {
            "a picture becomes a texture by a material of a mesh file".into()
        }
        _ => "convert the file to one of them, for example with Blender".into(),
    }
}

/// How files of formats that are not read begin, the names of the formats, and an ending of them.
const OTHERS: &[(&[u8], &str, &str)] = &[
    (b"ISO-10303-21", "STEP", "step"),
    (b"Kaydara FBX", "FBX", "fbx"),
    (b"BLENDER", "a Blender file", "blend"),
    (b"#usda", "USD", "usd"),
    (b"PXR-USDC", "USD", "usd"),
    (b"\x89PNG", "a picture", "png"),
    (b"\xff\xd8\xff", "a picture", "png"),
    (b"\x1f\x8b", "compressed by gzip", "gz"),
];

/// The name of the format of a file that begins with `start`, and what to do with it, where it is known and not read.
pub(super) fn other_format(start: &[u8]) -> Option<(&'static str, String)> {
    let text = start.trim_ascii_start();
    let is_page = [&b"<!doctype html"[..], b"<html"]
        .iter()
        .any(|tag| text.get(..tag.len()).is_some_and(|beginning| beginning.eq_ignore_ascii_case(tag)));
    if is_page {
        return Some(("a web page", "download the file itself".into()));
    }
    let (_, name, ending) = OTHERS.iter().find(|(magic, ..)| start.starts_with(magic))?;
    Some((name, advice_on(ending)))
}
