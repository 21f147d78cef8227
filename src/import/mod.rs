//! Files become a [`Scene`]: OBJ, glTF and scene files, alone or together.
//!
//! Data from outside is checked here once. The scene that is returned is finite and consistent; anything else is an error with its
//! place, or is left out with a warning. One file an importer; to add one, write it and give it a line in [`IMPORTERS`].

mod files;
mod gltf;
mod heights;
mod lines;
mod obj;
mod obj_text;
mod pictures;
mod ply;
mod polygon;
mod sanitise;
mod scene_file;
mod sharing;
mod stl;
mod tangents;
mod uri;

pub use scene_file::inline_camera;

use std::path::{Path, PathBuf};

pub use files::{FileRead, Stamp};

use crate::error::{Error, Result, Warnings};
use crate::limits::{self, unreadable};
use crate::scene::{Material, Mesh, Object, Phong, Scene, Shape};
use files::Files;

/// A kind of file that can be read.
pub struct Importer {
    /// What people call it.
    pub name: &'static str,
    /// Endings of its files, in lower case.
    pub endings: &'static [&'static str],
    /// Whether it describes a whole picture (cameras, lights, settings) rather than a mesh.
    pub is_scene_file: bool,
    /// First bytes of its files, by which it is known on standard input. Without any it is not read from there, but for scene files,
    /// which are what nothing else matches.
    starts: &'static [&'static [u8]],
    read: fn(&Source, &mut Warnings) -> Result<Scene>,
}

/// Every kind of file that can be read.
pub const IMPORTERS: &[Importer] = &[
    Importer {
        name: "scene file",
        endings: &["toml"],
        is_scene_file: true,
        starts: &[],
        read: scene_file::read,
    },
    Importer { name: "Wavefront OBJ", endings: &["obj"], is_scene_file: false, starts: &[], read: obj::read },
    // A scene file cannot begin with a brace, JSON does.
    Importer {
        name: "glTF",
        endings: &["gltf", "glb"],
        is_scene_file: false,
        starts: &[b"glTF", b"{"],
        read: gltf::read,
    },
    Importer {
        name: "PLY",
        endings: &["ply"],
        is_scene_file: false,
        starts: &[b"ply\n", b"ply\r"],
        read: ply::read,
    },
    Importer { name: "STL", endings: &["stl"], is_scene_file: false, starts: &[], read: stl::read },
];

/// The endings of all files that can be read: `.toml, .obj, ...`.
pub fn all_endings() -> String {
    list(IMPORTERS.iter(), ", ")
}

/// The endings of meshes: `.obj, .gltf or .glb`.
pub fn mesh_endings() -> String {
    list(IMPORTERS.iter().filter(|importer| !importer.is_scene_file), " or ")
}

/// What can be read from standard input: `scene file, glTF or ...`.
pub fn names_on_standard_input() -> String {
    let known = IMPORTERS.iter().filter(|importer| importer.is_scene_file || !importer.starts.is_empty());
    join(&known.map(|importer| importer.name.to_owned()).collect::<Vec<_>>(), " or ")
}

fn list<'a>(importers: impl Iterator<Item = &'a Importer>, last: &str) -> String {
    let endings: Vec<String> = importers.flat_map(|i| i.endings).map(|ending| format!(".{ending}")).collect();
    join(&endings, last)
}

/// The names, separated by commas and, before the last, by `last`.
fn join(names: &[String], last: &str) -> String {
    match names {
        [rest @ .., end] if !rest.is_empty() => format!("{}{last}{end}", rest.join(", ")),
        _ => names.concat(),
    }
}

/// The bytes of an input, and where files it names are looked for.
pub(crate) struct Source {
    /// As the user named it; `-` for standard input.
    pub file: PathBuf,
    /// Its contents.
    pub bytes: Vec<u8>,
    /// Opens what it names.
    files: Files,
}

impl Source {
    fn open(file: &Path, files: &Files) -> Result<Self> {
        let read = if file == Path::new("-") { limits::read_standard_input() } else { files.read(file) };
        let bytes = read.map_err(|e| unreadable(file, &e))?;
        Ok(Source { file: file.to_owned(), bytes, files: files.clone() })
    }

    /// The path of a file that this one names.
    fn sibling(&self, name: impl AsRef<Path>) -> PathBuf {
        match self.file.parent() {
            Some(folder) if self.file != Path::new("-") => folder.join(name),
            _ => name.as_ref().to_owned(),
        }
    }

    /// A scene of meshes in plain grey. Those without a name are called by the file's.
    fn scene_of(&self, meshes: Vec<(Option<String>, Mesh)>) -> Scene {
        let stem = self.file.file_stem().filter(|_| self.file != Path::new("-"));
        let file_name = stem.map_or_else(|| "mesh".into(), |stem| stem.to_string_lossy().into_owned());
        let mut scene = Scene::default();
        let material = scene.add_material(Material::Phong(Phong::default()));
        let object = |(name, mesh): (Option<String>, Mesh)| Object {
            name: name.unwrap_or_else(|| file_name.clone()),
            input: 0,
            material,
            shape: Shape::Mesh(mesh),
        };
        scene.objects.extend(meshes.into_iter().map(object));
        scene
    }

    /// The text, with what is not UTF-8 replaced and without a byte order mark.
    fn text(&self) -> std::borrow::Cow<'_, str> {
        let bytes = self.bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&self.bytes);
        String::from_utf8_lossy(bytes)
    }
}

/// Reads every input and puts them into one scene, in the order given.
///
/// # Errors
/// [`Error::Input`] when a file cannot be used.
pub fn load(inputs: &[PathBuf], warnings: &mut Warnings) -> Result<Scene> {
    load_by(inputs, &Files::default(), warnings)
}

/// Reads every input as [`load`] does, and lists the files that what came of it depends on, be it a scene or an error: the
/// inputs, and what those name, also where it is missing. Standard input is no file.
pub fn load_and_list(inputs: &[PathBuf], warnings: &mut Warnings) -> (Result<Scene>, Vec<FileRead>) {
    let files = Files::default();
    let scene = load_by(inputs, &files, warnings);
    (scene, files.list())
}

fn load_by(inputs: &[PathBuf], files: &Files, warnings: &mut Warnings) -> Result<Scene> {
    let mut scene = Scene { inputs: inputs.to_vec(), ..Scene::default() };
    for (index, file) in inputs.iter().enumerate() {
        let mut one = read_one(&Source::open(file, files)?, warnings)?;
        sharing::bake_small(&mut one);
        sanitise::sanitise(&mut one, file, warnings);
        warn_of_lost_pictures(&one, file, warnings);
        if inputs.len() > 1 && one.objects.is_empty() && one.cameras.is_empty() && one.lights.is_empty() {
            warnings.push(format!("{}: {NO_TRIANGLES}", file.display()));
        }
        for object in &mut one.objects {
            object.input = index;
        }
        scene.append(one);
        // Also those that have no area in a place: the acceleration structure has numbers for them.
        let count = |object: &Object| object.shape.mesh().map_or(1, |mesh| mesh.triangles.len() as u64);
        let count: u64 = scene.objects.iter().map(count).sum();
        if u32::try_from(count).is_err() {
            let what = format!("{count} triangles and spheres are more than kiln can number");
            let hint = "give at most 4,294,967,295: fewer placements, or meshes of fewer triangles";
            return Err(Error::input(file.as_path(), what, hint));
        }
    }
    // What a track cannot do, it cannot do at the beginning either.
    if scene.animation.is_some() {
        scene.at(0.0)?;
    }
    Ok(scene)
}

/// Of a file without anything that can be drawn.
const NO_TRIANGLES: &str = "has no triangles to draw";

/// Checks that mesh files hold anything that can be drawn. A scene file may be of a background alone.
///
/// # Errors
/// [`Error::Input`] for the first of them.
pub fn check_drawable(scene: &Scene) -> Result<()> {
    let is_mesh = |file: &PathBuf| file != Path::new("-") && !is_scene_file(file);
    match scene.inputs.first() {
        Some(file) if scene.objects.is_empty() && scene.inputs.iter().all(is_mesh) => {
            let hint = "kiln draws faces, not points and lines; `kiln info` says what the file holds";
            Err(Error::input(file.as_path(), NO_TRIANGLES, hint))
        }
        _ => Ok(()),
    }
}

/// Warns of materials with pictures on meshes without texture coordinates.
fn warn_of_lost_pictures(scene: &Scene, file: &Path, warnings: &mut Warnings) {
    for object in &scene.objects {
        let material = &scene.materials[object.material.0 as usize];
        if material.is_textured() && object.shape.mesh().is_none_or(|mesh| mesh.uvs.is_none()) {
            warnings.push(format!(
                "{}: `{}` has no texture coordinates; drawn without the pictures of its material `{}`",
                file.display(),
                object.name,
                material.name()
            ));
        }
    }
}

/// Reads an input, or a file that one names. What is in it is checked once everything stands where it belongs.
fn read_one(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    (importer_for(source)?.read)(source, warnings)
}

/// Whether an input describes a whole picture rather than a mesh, going by its name.
pub fn is_scene_file(file: &Path) -> bool {
    IMPORTERS
        .iter()
        .any(|importer| importer.is_scene_file && importer.endings.contains(&ending(file).as_str()))
}

fn ending(file: &Path) -> String {
    file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

fn importer_for(source: &Source) -> Result<&'static Importer> {
    let found = if source.file == Path::new("-") {
        let text = source.bytes.trim_ascii_start();
        let starts = |importer: &&Importer| importer.starts.iter().any(|start| text.starts_with(start));
        IMPORTERS.iter().find(starts).or_else(|| IMPORTERS.iter().find(|importer| importer.is_scene_file))
    } else {
        let wanted = ending(&source.file);
        IMPORTERS.iter().find(|importer| importer.endings.contains(&wanted.as_str()))
    };
    found.ok_or_else(|| {
        let hint = format!("it reads {}; convert the file to one of them", all_endings());
        Error::input(source.file.as_path(), "not a kind of file that kiln reads", hint)
    })
}
