//! Recognises the format of a file by its contents: by a signature at the start, else by the structure, else by the
//! ending ([`crate::import::importer_of`]). Formats are identified by an ending, also those that are not read.

use crate::import::formats::{off, ply, stl};
use crate::import::text::lines::{Lines, take_word, without_comments};

/// Bytes at the start of a file by which it is recognised.
pub(crate) const START: usize = 1 << 16;

/// What to do with a file of a format that is not read, by its ending: the programs that convert it.
pub(crate) fn advice_on(ending: &str) -> String {
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
        "mtl" => "name the OBJ file that uses these materials".into(),
        "html" => "download the file itself".into(),
        "utf-32" => "save it as UTF-8".into(),
        "png" | "jpg" | "jpeg" | "tif" | "tiff" | "tga" | "dds" | "webp" | "bmp" => {
            "a picture becomes a texture by a material of a mesh file".into()
        }
        _ => "convert the file to one of them, for example with Blender".into(),
    }
}

/// Signatures, the names of formats that are not read, and an ending of each.
const SIGNATURES: &[(&[u8], &str, &str)] = &[
    (b"glTF", "", "glb"),
    (b"PK\x03\x04", "", "3mf"),
    (b"PK\x05\x06", "", "3mf"),
    (b"ISO-10303-21", "STEP", "step"),
    (b"Kaydara FBX", "FBX", "fbx"),
    (b"; FBX", "FBX", "fbx"),
    (b"BLENDER", "a Blender file", "blend"),
    (b"#usda", "USD", "usd"),
    (b"PXR-USDC", "USD", "usd"),
    (b"#VRML", "VRML", "wrl"),
    (b"xof 0", "DirectX", "x"),
    (b"\x89PNG", "a picture", "png"),
    (b"\xff\xd8\xff", "a picture", "png"),
    (b"GIF8", "a picture", "png"),
    (b"RIFF", "a picture", "webp"),
    (b"II*\0", "a picture", "tif"),
    (b"MM\0*", "a picture", "tif"),
    (b"DDS ", "a picture", "dds"),
    (b"#?RADIANCE", "a picture", "hdr"),
    (b"#?RGBE", "a picture", "hdr"),
    (b"v/1\x01", "a picture", "exr"),
    (b"\x1f\x8b", "compressed by gzip", "gz"),
    (b"BZh", "compressed by bzip2", "zip"),
    (b"\xfd7zXZ", "compressed by xz", "xz"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "zst"),
    (b"7z\xbc\xaf", "a 7z archive", "7z"),
    (b"Rar!", "a RAR archive", "rar"),
    (b"\xff\xfe\0\0", "text in UTF-32", "utf-32"),
    (b"\0\0\xfe\xff", "text in UTF-32", "utf-32"),
];

/// As [`SIGNATURES`], in any case after white space.
const TAGS: &[(&[u8], &str, &str)] = &[
    (b"<!doctype html", "a web page", "html"),
    (b"<html", "a web page", "html"),
    (b"<svg", "a picture", "png"),
    (b"<?xml", "XML, as of COLLADA and X3D", "dae"),
    (b"<collada", "COLLADA", "dae"),
];

/// The ending of files whose contents begin with `start` and have `length` bytes, and the name of the format if it is
/// not read. Texts are in UTF-8 without a byte order mark.
pub(crate) fn kind(start: &[u8], length: u64) -> Option<(&'static str, &'static str)> {
    let begins = |text: &[u8], word: &[u8]| {
        text.get(..word.len()).is_some_and(|beginning| beginning.eq_ignore_ascii_case(word))
    };
    let (text, tag) = (without_comments(start), start.trim_ascii_start());
    let mut signatures = SIGNATURES.iter().filter(|(magic, ..)| start.starts_with(magic));
    let mut tags = TAGS.iter().filter(|(word, ..)| begins(tag, word));
    if let Some((_, name, ending)) = signatures.next().or_else(|| tags.next()) {
        return Some((ending, name));
    }
    let has_facet = || text.windows(5).any(|word| word.eq_ignore_ascii_case(b"facet"));
    let ending = match () {
        () if stl::has_length_of_binary(start, length) => "stl",
        () if ply::is_start(start) => "ply",
        () if off::is_start(text) => "off",
        () if text.starts_with(b"{") => "gltf",
        () if begins(text, b"facet normal") || begins(text, b"solid") && has_facet() => "stl",
        () if start.contains(&0) => return None,
        () => return Lines::new(text, 0).find_map(|(_, line)| kind_of_line(line)),
    };
    Some((ending, ""))
}

/// The kind of a text by one of its lines: a statement of OBJ or MTL, a section or a key of TOML.
fn kind_of_line(line: &[u8]) -> Option<(&'static str, &'static str)> {
    let mut rest = line;
    let word = take_word(&mut rest)?;
    let next = rest.trim_ascii_start().first().copied().unwrap_or(b'=');
    let is_key = |key: &[u8]| {
        let key = key.trim_ascii();
        !key.is_empty() && key.iter().all(|b| b.is_ascii_alphanumeric() || b"_-.'\"".contains(b))
    };
    let equals = line.iter().position(|&b| b == b'=');
    match word.to_ascii_lowercase().as_slice() {
        b"v" | b"vt" | b"vn" | b"f" if next.is_ascii_digit() || b"+-.".contains(&next) => Some(("obj", "")),
        b"mtllib" | b"usemtl" if next != b'=' => Some(("obj", "")),
        b"newmtl" if next != b'=' => Some(("mtl", "materials of OBJ files (MTL)")),
        _ if word.starts_with(b"[") && line.contains(&b']') => Some(("toml", "")),
        _ => equals.filter(|&end| is_key(&line[..end])).map(|_| ("toml", "")),
    }
}
