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
