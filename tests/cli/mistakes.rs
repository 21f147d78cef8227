//! The commonest mistakes in scene files, on the command line and in input files: message, hint and exit
//! code. To add one, add a row to [`MISTAKES`].

use super::helpers::{SCENE, check_error};
use crate::workshop::{Workshop, text};

/// Where a mistake is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum In {
    /// The text of the scene file `a.toml`, which is rendered.
    Scene,
    /// The arguments of kiln, where `scene.toml` is a valid scene.
    Command,
    /// The name of an input file and, after a line break, its contents.
    Input,
    /// The same, of a texture of a mesh.
    Texture,
}

use In::{Command, Input, Scene, Texture};

/// What is written, the message, words of the hint, and the exit code. At exit code 0 the message is a warning with the
/// words of the hint.
type Mistake = (In, &'static str, &'static str, &'static str, i32);

/// The hint of errors of syntax.
const TOML: &str = "a scene file is TOML";

const POINTER: &str = "is a Git LFS pointer; `git lfs pull` fetches the file itself";

const MISTAKES: &[Mistake] = &[
    // Scene files: syntax, in the words of the parser.
    (Scene, "[image]\nwidth = 640px", "a.toml:2: ", TOML, 3),
    (Scene, "[ambient]\nintensity = 1.1.1", "a.toml:2: ", TOML, 3),
    (Scene, "[ambient]\nintensity = .5", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\nwidth = 0640", "a.toml:2: ", TOML, 3),
    (Scene, "[ambient]\nintensity = 0,5", "a.toml:2: ", TOML, 3),
    (Scene, "[[sphere]]\ncentre = [0, 0 0]\nradius = 1", "a.toml:2: ", TOML, 3),
    (Scene, "[[sphere]]\ncentre = (0, 0, 0)\nradius = 1", "a.toml:2: ", TOML, 3),
    (Scene, "[[sphere]]\ncentre = [0, 0, 0\nradius = 1", "a.toml:3: ", TOML, 3),
    (Scene, "[image]\nbackground = #ff0000", "a.toml:2: ", TOML, 3),
    (Scene, "[[mesh]]\nfile = a.obj", "a.toml:2: ", TOML, 3),
    (Scene, "[[mesh]]\nfile = \"m\\cow.obj\"", "a.toml:2: ", TOML, 3),
    (Scene, "[[mesh]]\nfile = \"a.obj", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\nheadlight = True", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\nwidth: 640", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\n// big", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\nwidth = 4 height = 3", "a.toml:2: ", TOML, 3),
    (Scene, "[image]\nwidth =\nheight = 3", "a.toml:2: ", TOML, 3),
    (Scene, "[[sphere]\nradius = 1", "a.toml:1: ", TOML, 3),
    // Numbers.
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0, 7]\nradius = 1",
        "a.toml:2: `centre` has 4 numbers, expected 3",
        "leave out all but 3",
        3,
    ),
    (
        Scene,
        "[[camera]]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\nviewing_rectangle = [1, 2, 3]",
        "a.toml:4: `viewing_rectangle` has 3 numbers, expected 2",
        "leave out all but 2",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = 'big'",
        "a.toml:3: `radius` is 'big', expected a number",
        "such as 1.5",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = \"75\"",
        "a.toml:3: `radius` is \"75\", expected a number",
        "without quotes",
        3,
    ),
    (
        Scene,
        "[image]\nwidth = \"640\"",
        "a.toml:2: `width` is \"640\", expected a whole number that is 0 or more",
        "without quotes",
        3,
    ),
    (
        Scene,
        "[image]\nwidth = 480.5",
        "a.toml:2: `width` is 480.5, expected a whole number that is 0 or more",
        "such as 3",
        3,
    ),
    (
        Scene,
        "[image]\nwidth = -640",
        "a.toml:2: `width` is -640, expected a whole number that is 0 or more",
        "such as 3",
        3,
    ),
    (Scene, "[image]\nsamples = 1.5", "a.toml:2: `samples` is 1.5, expected a whole number", "such as 3", 3),
    // Lists of numbers.
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0]\nradius = 1",
        "a.toml:2: `centre` is [0, 0], expected 3 numbers",
        "write them in brackets: [0, 0, 0]",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = 0\nradius = 1",
        "a.toml:2: `centre` is 0, expected 3 numbers",
        "[0, 0, 0]",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 'a', 0]\nradius = 1",
        "a.toml:2: `centre` holds 'a', expected a number",
        "such as 1.5",
        3,
    ),
    (
        Scene,
        "[[camera]]\nposition = { x = 0, y = 1, z = 2 }\nlook_at = [0, 0, 0]",
        "a.toml:2: `position` is { x = 0, y = 1, z = 2 }, expected 3 numbers",
        "[0, 0, 0]",
        3,
    ),
    (
        Scene,
        "[[mesh]]\nfile = 'a.obj'\nplacements = [3]",
        "a.toml:3: `placements` holds 3, expected keys in braces",
        "write { KEY = VALUE }",
        3,
    ),
    // Colours.
    (
        Scene,
        "[image]\nbackground = [0.5, 0.2, 0.1]",
        "a.toml:2: `background` is [0.5, 0.2, 0.1], expected a colour",
        "whole numbers from 0 to 255, \"#rrggbb\" or a CSS name",
        3,
    ),
    (
        Scene,
        "[image]\nbackground = 'reddish'",
        "a.toml:2: `background` is 'reddish', expected a colour",
        "write [r, g, b] in whole numbers from 0 to 255, \"#rrggbb\" or a CSS name",
        3,
    ),
    (
        Scene,
        "[image]\nbackground = [1, 2, 256]",
        "a.toml:2: `background` is [1, 2, 256], expected a colour",
        "from 0 to 255",
        3,
    ),
    // Texts, switches and names.
    (
        Scene,
        "[[mesh]]\nfile = ['a.obj']",
        "a.toml:2: `file` is ['a.obj'], expected a text",
        "write one text in quotes",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 3",
        "a.toml:4: `material` is 3, expected a text",
        "in quotes",
        3,
    ),
    (
        Scene,
        "[image]\nheadlight = 1",
        "a.toml:2: `headlight` is 1, expected true or false",
        "without quotes",
        3,
    ),
    (Scene, "[image]\ncolour = 3", "a.toml:2: `colour` is 3, expected a name", "in quotes", 3),
    (Scene, "[image]\ncolour = 'lineal'", "a.toml:2: unknown value `lineal`", "did you mean `linear`?", 3),
    (
        Scene,
        "[[mesh]]\nfile = 'a.obj'\nscale = '2'",
        "a.toml:3: `scale` is '2', expected a number or [x, y, z]",
        "",
        3,
    ),
    // Keys and sections.
    (Scene, "[image]\nheigth = 480", "a.toml:2: unknown key `heigth`", "did you mean `height`?", 3),
    (Scene, "[[spheres]]\nradius = 1", "a.toml:1: unknown key `spheres`", "did you mean `sphere`?", 3),
    (Scene, "[[sphere]]\nradius = 1", "a.toml:1: missing key `centre`", "add an entry `centre = ...`", 3),
    (Scene, "[image]\nwidth = 3\nwidth = 4", "a.toml:3: `width` is given twice", "keep one", 3),
    (
        Scene,
        "[light]\ntype = 'point'",
        "a.toml:1: `[light]` is one table, expected a list",
        "write [[light]] for each",
        3,
    ),
    (
        Scene,
        "[camera]\nname = 'a'",
        "a.toml:1: `[camera]` is one table, expected a list",
        "write [[camera]]",
        3,
    ),
    (
        Scene,
        "[sphere]\nradius = 1",
        "a.toml:1: `[sphere]` is one table, expected a list",
        "write [[sphere]]",
        3,
    ),
    (
        Scene,
        "[mesh]\nfile = 'a.obj'",
        "a.toml:1: `[mesh]` is one table, expected a list",
        "write [[mesh]]",
        3,
    ),
    (
        Scene,
        "[triangles]\nindices = []",
        "a.toml:1: `[triangles]` is one table, expected a list",
        "[[triangles]]",
        3,
    ),
    (
        Scene,
        "[light]\ntype = 'point'\n[light]\ntype = 'point'",
        "a.toml:3: `light` is given twice",
        "[[NAME]]",
        3,
    ),
    (
        Scene,
        "[[image]]\nwidth = 3",
        "a.toml:1: `[[image]]` is a list, expected one table",
        "write [image], once",
        3,
    ),
    (
        Scene,
        "[material]\ncolour = '#ff0000'",
        "a.toml:2: a material without a name",
        "write [material.NAME]",
        3,
    ),
    (Scene, "[[material]]\nname = 'a'", "a.toml:1: a material without a name", "write [material.NAME]", 3),
    (
        Scene,
        "[material.clay]\ncolour = '#808080'\nglaze = 0.3",
        "a.toml:3: `glaze` is 0.3, expected keys in braces",
        "write { KEY = VALUE }",
        3,
    ),
    (
        Scene,
        "[material.clay]\ncolour = '#808080'\nglaze = { weight = 3 }",
        "a.toml:1: `glaze.weight` is 3",
        "give a number from 0 to 1",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0]\nposition = [0, 0, 0]\nradius = 1",
        "a.toml:1: `centre` is given twice",
        "keep one",
        3,
    ),
    (
        Scene,
        "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'clay'",
        "a.toml:1: there is no material `clay`",
        "add [material.clay]",
        3,
    ),
    (
        Scene,
        "[[sphere]]\nname = 'a'\nposition = [0, 0, 0]\nradius = 1\n\
         [[sphere]]\nname = 'a'\ncenter = [3, 0, 0]\nradius = 1",
        "a.toml:5: a second object named `a`, like that of line 1",
        "give each its own name",
        0,
    ),
    (
        Scene,
        "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n[[light]]\nname = 'a'\ntype = 'point'\nposition = [0, 9, 0]\n\
         [[light]]\nname = 'a'\ntype = 'point'\nposition = [0, 8, 0]",
        "a.toml:8: a second light named `a`, like that of line 4",
        "give each its own name",
        0,
    ),
    // The command line.
    (Command, "rendr scene.toml", "unrecognized subcommand 'rendr'", "render", 2),
    (Command, "scene.toml", "unrecognized subcommand 'scene.toml'", "kiln render INPUT -o picture.png", 2),
    (
        Command,
        "render scene.toml",
        "were not provided: --output <OUT>",
        "name the file to write, such as -o",
        2,
    ),
    (Command, "render scene.toml -o a.png --siz 3x3", "unexpected argument '--siz'", "--size", 2),
    (
        Command,
        "render scene.toml -o a.png --vertical-fov 40",
        "unexpected argument '--vertical-fov'",
        "--fov DEG",
        2,
    ),
    (
        Command,
        "render scene.toml -o a.png --denoise",
        "unexpected argument '--denoise'",
        "--aov denoising-albedo",
        2,
    ),
    (
        Command,
        "animate scene.toml -o a.gif --dof=2",
        "unexpected argument '--dof'",
        "--with depth-of-field",
        2,
    ),
    (Command, "render scene.toml -o a.png --size big", "give it as WIDTHxHEIGHT, such as 640x480", "", 2),
    (
        Command,
        "render scene.toml -o a.png --camera frnt",
        "there is no camera `frnt`",
        "did you mean `front`?",
        2,
    ),
    (
        Command,
        "render scene.toml -o a.png --camera {position=[0,0,'5'],look_at=[0,0,0]}",
        "--camera {...} is not valid: `position` holds '5', expected a number",
        "without quotes",
        2,
    ),
    (
        Command,
        "render scene.toml -o a.gif",
        "a.gif: not a picture format that can be written",
        ".png, .jpg or .exr",
        2,
    ),
    (
        Command,
        "render scene.toml -o gone/a.png",
        "gone/a.png: cannot be written: its folder does not exist; make it with mkdir -p gone",
        "",
        4,
    ),
    (
        Command,
        "render scene.toml -o f_####.png --frames all",
        "write the frames as a list, such as 0-299; without --frames, `kiln animate` makes all",
        "",
        2,
    ),
    (
        Command,
        "render scene.toml -o f_####.png --frames 1to9",
        "write frames as 1-10, 1-10:2 or 3,7,9-12",
        "",
        2,
    ),
    (Command, "render scene.toml -o f.png --frames 1-3", "f.png: one name for 3 frames", "frame_####.png", 2),
    (Command, "render scene.toml -o f.png --shard 5/4", "such as 2/7", "", 2),
    (
        Command,
        "animate scene.toml -o f.mp4 --shard 1/4",
        "--shard is for numbered frames, not for a film",
        "`kiln animate scene.toml --shard 1/4 -o f_####.png`",
        2,
    ),
    (
        Command,
        "animate scene.toml -o out/f.gif --skip-existing",
        "--skip-existing is for numbered frames",
        "`kiln animate scene.toml --skip-existing -o out/f_####.png`",
        2,
    ),
    (
        Command,
        "animate scene.toml -o - --shard 2/2",
        "--shard is for numbered frames",
        "-o frame_####.png`",
        2,
    ),
    (Command, "animate scene.toml -o f_##.jpg --skip-existing", "f_##.jpg: a JPEG has no", ".png or .exr", 2),
    (Command, "render scene.toml -o f.png --fps 24", "--fps is for animations", "--frames 0-59", 2),
    (Command, "render scene.toml -o f.png --duration 2", "--duration is for animations", "--frames 0-59", 2),
    (Command, "render gone.obj -o a.png", "gone.obj: no such file", "check the name and the folder", 3),
    // Input files.
    (
        Input,
        "a.fbx\nx",
        "a.fbx: not a kind of file that kiln reads",
        "`assimp export in.fbx out.glb -fglb2`",
        3,
    ),
    (
        Input,
        "a.dae\nx",
        "a.dae: not a kind of file that kiln reads",
        "`assimp export in.dae out.glb -fglb2`",
        3,
    ),
    (
        Input,
        "a.3DS\nx",
        "a.3DS: not a kind of file that kiln reads",
        "`assimp export in.3ds out.glb -fglb2`",
        3,
    ),
    (Input, "a.3mf\nx", "a.3mf: not a whole ZIP archive, as 3MF files are", "export or copy it again", 3),
    (Input, "a.x3d\nx", "a.x3d: not a kind of file that kiln reads", "assimp", 3),
    (Input, "a.blend\nx", "a.blend: not a kind of file that kiln reads", "Blender", 3),
    (Input, "a.usd\nx", "a.usd: not a kind of file that kiln reads", "Blender", 3),
    (Input, "a.usda\nx", "a.usda: not a kind of file that kiln reads", "Blender", 3),
    (Input, "a.usdz\nx", "a.usdz: not a kind of file that kiln reads", "Blender", 3),
    (Input, "a.step\nx", "a.step: not a kind of file that kiln reads", "FreeCAD", 3),
    (Input, "a.stp\nx", "a.stp: not a kind of file that kiln reads", "FreeCAD", 3),
    (Input, "a.zip\nx", "a.zip: not a kind of file that kiln reads", "unpack it first", 3),
    (Input, "a.hdr\nx", "a.hdr: not a kind of file that kiln reads", "--environment", 3),
    (
        Input,
        "a.gltf\n{\"asset\": {\"version\": \"1.0\"}, \"meshes\": {}}",
        "a.gltf: a file of glTF 1.0; kiln reads glTF 2.0",
        "gltf-pipeline -i in.gltf -o out.glb",
        3,
    ),
    (Input, "a.glb\nglTF\x01\0\0\0", "a.glb: a file of glTF 1.0; kiln reads glTF 2.0", "gltf-pipeline", 3),
    (
        Input,
        "a.gltf\n{\"asset\":",
        "a.gltf: not a usable glTF file: its JSON ends or is damaged at line 1",
        "export",
        3,
    ),
    (Input, "a.obj\nglTF\u{2}\0\0\0", "a.obj: not a usable glTF file", "export", 3),
    (Input, "a.stl\nOFF\n3 1 0\n", "a.stl: has no triangles to draw", "kiln info", 3),
    (Input, "a.glb\nply\nformat ascii 1.0\n", "a.glb:2: the header does not end with", "export", 3),
    (Input, "a.stl\n", "a.stl: is empty", "copy it again", 3),
    (Input, "a.glb\n", "a.glb: is empty", "copy it again", 3),
    (Input, "a\n", "a: is empty", "copy it again", 3),
    (Input, "a.stl\nsome text", "a.stl:1: not a statement of STL files", "correct the line", 3),
    (Input, "a\nsome text", "a: not a kind of file that kiln reads", "kiln reads .toml", 3),
    (Input, "a.glb\n<!DOCTYPE html><html>", "a.glb: its content is a web page, not glTF", "download", 3),
    (Input, "a.stl\nISO-10303-21;\nHEADER;", "a.stl: its content is STEP, not STL", "FreeCAD", 3),
    (Input, "a.obj\nKaydara FBX Binary", "a.obj: its content is FBX, not Wavefront OBJ", "Blender", 3),
    (Input, "a\nRIFF1234WEBP", "a: its content is a picture, not a format that kiln reads", "a texture", 3),
    (Input, "a.obj\n#?RADIANCE\n", "a.obj: its content is a picture, not Wavefront OBJ", "--environment", 3),
    (Input, "a.mtl\n# x\nnewmtl a\n", "a.mtl: its content is materials of OBJ files", "name the OBJ", 3),
    (Input, "a.mtl\nKd 1 1 1\n", "a.mtl: not a kind of file that kiln reads", "name the OBJ", 3),
    (Input, "a\n<?xml version='1.0'?><COLLADA>", "a: its content is XML", "Blender", 3),
    (Command, "render Scene.toml -o a.png", "Scene.toml: no such file", "did you mean `scene.toml`?", 3),
    (Command, "render scene -o a.png", "scene: no such file", "did you mean `scene.toml`?", 3),
    (Command, "render scene.toml -o film.mp4", "not a picture format", "`kiln animate` makes films", 2),
    (Command, "render scene.toml -o a.png --color red", "'--colour <PIPELINE>'", "display, u8, linear", 2),
    (Command, "render scene.toml -o a.png --without alpha,shadow", "no effect `shadow`", "`shadows`", 2),
    (
        Command,
        "render scene.toml -o a.png --with left-out",
        "no effect `left-out`",
        "`kiln explain --measure`",
        2,
    ),
    (
        Command,
        "render scene.toml -o a.exr --aov left-out",
        "no AOV `left-out`",
        "`kiln explain --measure`",
        2,
    ),
    (Command, "animate scene.toml -o a.gif --seconds 2", "'--seconds'", "--duration S", 2),
    (Command, "animate scene.toml -o a.gif --duration 2m", "'2m' for '--duration <S>': give seconds", "", 2),
    (Command, "animate scene.toml -o a.gif --fps 0", "'0' for '--fps <N>': give frames per second", "", 2),
    (Command, "animate scene.toml -o a.gif --fps 24fps", "'24fps' for '--fps <N>': give frames", "", 2),
    (Command, "animate a_1.png a_2.png -o a.gif", "a_1.png: several pictures", "'frame_####.png'", 2),
    (Command, "animate a_##.png -o a.gif", "a_##.png: no such frame", "each # is a digit", 3),
    (Command, "render . -o a.png", ".: is a folder", "`kiln render . -o out/`", 3),
    (Command, "render a/*.stl -o a.png", "a/*.stl: no such file", "match files only in a shell", 3),
    (Command, "render https://a.org/b.glb -o a.png", "b.glb: no such file", "download it first", 3),
    (Command, "render scene.toml -o a.png --camera position=[0,0,5]", "no camera `position=", "in braces", 2),
    (
        Command,
        "render scene.toml -o a.png --camera auto --look-at 0,1,0",
        "`0,1,0`",
        "`look_at` of a camera",
        2,
    ),
    (Command, "render scene.toml -o a.png --dpi 300", "'--dpi'", "--size 2480x3508", 2),
    (Command, "verify .", ".: is a folder", "####.png", 2),
    (Command, "verify scene.toml", "scene.toml: not a picture of kiln", ".png or .exr", 2),
    (Command, "bench pirce", "pirce: neither a file nor a benchmark", "did you mean `price`?", 2),
    (Command, "render scene.toml -o a.png --time 1", "no input has clips", "leave out --time", 2),
    (Scene, "[ambient]\ncolour = 'white'", "a.toml:2: unknown key `colour`", "ambient light is white", 3),
    (Scene, "[ambient]\ncolor = 'white'", "a.toml:2: unknown key `color`", "ambient light is white", 3),
    (
        Scene,
        "[material.a]\ncolor = 'red'\ncolour = 'red'",
        "a.toml:2: unknown key `color`",
        "did you mean `colour`?",
        3,
    ),
    (Input, "a.obj\nLFS", "a.obj: is a Git LFS pointer", "`git lfs pull`", 3),
    (Input, "a.gltf\nLFS", "a.gltf: is a Git LFS pointer", "`git lfs pull`", 3),
    (Input, "a.glb\nLFS", "a.glb: is a Git LFS pointer", "`git lfs pull`", 3),
    (Input, "a.ply\nLFS", "a.ply: is a Git LFS pointer", "`git lfs pull`", 3),
    (Input, "a.stl\nLFS", "a.stl: is a Git LFS pointer", "`git lfs pull`", 3),
    (Input, "a.toml\nLFS", "a.toml: is a Git LFS pointer", "`git lfs pull`", 3),
    (Texture, "t.png\nLFS", "t.png: texture left out: is a Git LFS pointer", "`git lfs pull`", 0),
    (
        Texture,
        "t.dds\nDDS |",
        "t.dds: texture left out: a .dds picture, which is not read here",
        "`magick in.dds out.png`",
        0,
    ),
    (
        Texture,
        "t.tif\nII*\0",
        "t.tif: texture left out: a .tiff picture, which is not read here",
        "`magick in.tiff out.png`",
        0,
    ),
    (
        Texture,
        "t.tga\n\0\0\x02",
        "t.tga: texture left out: not a picture of a format that is read",
        "ImageMagick",
        0,
    ),
    (
        Texture,
        "t.avif\n\0\0\0 ftypavif\0\0\0\0",
        "t.avif: texture left out: a .avif picture",
        "ImageMagick",
        0,
    ),
    (Texture, "t.png\n", "t.png: texture left out: not a picture of a format that is read", "ImageMagick", 0),
];

/// The first lines of a Git LFS pointer.
const LFS: &str = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";

/// Words of parsers and of Rust, which are not those of a user.
const FOREIGN: &[&str] = &[
    "f64",
    "u32",
    "i64",
    "struct ",
    "Section",
    "map,",
    "sequence",
    "variant",
    "field `",
    "invalid type",
    "integer",
];

/// What is wrong with the answer to a mistake, if anything.
fn fault((place, typed, message, hint, code): &Mistake) -> Option<String> {
    let workshop = Workshop::with("scene.toml", SCENE);
    let file =
        typed.split_once('\n').map(|(name, contents)| (name, if contents == "LFS" { LFS } else { contents }));
    let arguments = match (place, file) {
        (Command, _) => (*typed).to_owned(),
        (Scene, _) => {
            workshop.write("a.toml", format!("{typed}\n"));
            "render a.toml -o a.png --size 4x4".into()
        }
        (_, None) => return Some(format!("{typed}: no contents")),
        (Input, Some((name, contents))) => {
            workshop.write(name, contents);
            format!("render {name} -o a.png --size 4x4")
        }
        (Texture, Some((name, contents))) => {
            workshop.write(name, contents);
            workshop.write("a.mtl", format!("newmtl m\nmap_Kd {name}\n"));
            let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
            workshop.write("a.obj", obj);
            "render a.obj -o a.png --size 4x4".into()
        }
    };
    let output = workshop.run(&arguments);
    let said = text(&output.stderr);
    let (what, advice) = match code {
        0 => {
            let warning =
                said.lines().find_map(|line| line.strip_prefix("kiln: warning: ")).unwrap_or_default();
            (warning, warning)
        }
        _ => check_error(&said),
    };
    let is_foreign = FOREIGN.iter().any(|word| what.contains(word) || advice.contains(word));
    // Messages about files begin with their name; those of options have it behind.
    let is_said = if *place == Command { what.contains(message) } else { what.starts_with(message) };
    let is_right = is_said && advice.contains(hint) && output.status.code() == Some(*code) && !is_foreign;
    (!is_right).then(|| format!("{place:?} {typed}\n{said}\nnot {message} | {hint} | {code}\n"))
}

#[test]
fn mistakes_are_answered_in_the_words_of_users() {
    assert!(MISTAKES.len() >= 40);
    let faults: Vec<String> = MISTAKES.iter().filter_map(fault).collect();
    assert!(faults.is_empty(), "{} of {}:\n{}", faults.len(), MISTAKES.len(), faults.join("\n"));
}

#[test]
fn a_wrong_answer_is_noticed() {
    let right = &(Command, "render gone.obj -o a.png", "gone.obj: no such file", "check the name", 3);
    assert_eq!(fault(right), None);
    let (place, typed, message, hint, code) = *right;
    for wrong in [
        (place, typed, "gone", "no hint", code),
        (place, typed, "no words", hint, code),
        (place, typed, message, hint, 2),
    ] {
        assert!(fault(&wrong).is_some(), "{wrong:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn folders_that_take_no_files_are_named() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let output = workshop.run("render scene.toml -o /proc/x.png");
    let said = text(&output.stderr);
    let expected = "/proc/x.png: cannot be written: its folder takes no files; name another folder";
    assert_eq!((check_error(&said).0, output.status.code()), (expected, Some(4)));
}

#[test]
fn standard_input_is_no_pointer() {
    let output = Workshop::with("scene.toml", SCENE).run_with("render - -o a.png", LFS.as_bytes());
    assert_eq!(check_error(&text(&output.stderr)).0, format!("-: {POINTER}"));
}
