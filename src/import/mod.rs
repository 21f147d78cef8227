//! Importers: read OBJ, glTF, PLY, STL, OFF, 3MF and scene files, alone or together, into a [`Scene`].
//!
//! Input is validated here once. The returned scene is finite and consistent; invalid data is an error with its place,
//! or is omitted with a warning. To add a format, write an importer in its own file and list it in [`IMPORTERS`].
//!
//! ```
//! use kiln::error::Warnings;
//!
//! let mut warnings = Warnings::default();
//! let scene = kiln::import::load(&["assets/import/tetrahedron.stl".into()], &mut warnings)?;
//! assert_eq!(scene.primitive_count(), 4);
//! warnings.messages().iter().for_each(|warning| eprintln!("{warning}"));
//! # Ok::<(), kiln::error::Error>(())
//! ```

mod colours;
mod converters;
mod dependencies;
mod edits;
mod environment;

mod gltf;
mod heights;
mod images;
#[cfg(feature = "codecs")]
mod ktx2;
mod lines;
#[cfg(feature = "cli")]
mod names;
mod obj;
mod off;
mod options;
mod parts;
mod ply;
mod polygon;
mod references;
mod sanitise;
mod scene_file;
pub(crate) mod sharing;
mod smooth;
mod stl;
mod tangents;
mod threemf;
mod untextured;
mod up;
mod uri;
mod values;

#[cfg(feature = "viewer")]
pub(crate) use edits::edit;
pub use environment::environment;
#[cfg(feature = "cli")]
pub(crate) use names::FileNames;
#[cfg(feature = "viewer")]
pub(crate) use scene_file::inline_change;
pub use scene_file::{SceneFile, inline_camera};

use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

pub use dependencies::{FileRead, Stamp};

use crate::error::{Error, Result, Warnings};
use crate::files::hint_for_missing;
use crate::files::{IS_FOLDER, unreadable};
use crate::film::Colour;
use crate::limits::Counted;
use crate::scene::{
    ImportOptions, Material, MaterialId, Mesh, Object, Opacity, Phong, Scene, Shape, UpAxis, UpChoice,
};
use dependencies::Files;
use glam::DVec3;
use lines::{without_comments, without_mark};

/// A supported file format.
pub struct Importer {
    /// Display name.
    pub name: &'static str,
    /// File name extensions, in lower case.
    pub endings: &'static [&'static str],
    /// Whether the format describes a whole scene (cameras, lights, settings) rather than a mesh.
    pub is_scene_file: bool,
    /// Whether the format specifies flat shading for a mesh without normals.
    is_flat: bool,
    /// Whether standard input, from its first word after comments, has the format. A format without this cannot be read
    /// from there, except scene files, which are the fallback.
    is_start: Option<fn(&[u8]) -> bool>,
    /// Whether the importer reads files by [`Source::stream`] rather than from [`Source::bytes`].
    streams: bool,
    read: fn(&Source, &mut Warnings) -> Result<Scene>,
}

/// A format of smooth meshes that cannot be read from standard input.
const MESHES: Importer = Importer {
    name: "",
    endings: &[],
    is_scene_file: false,
    is_flat: false,
    is_start: None,
    streams: false,
    read: |_, _| Ok(Scene::default()),
};

/// All supported file formats.
pub const IMPORTERS: &[Importer] = &[
    Importer {
        name: "scene file",
        endings: &["toml"],
        is_scene_file: true,
        read: scene_file::read,
        ..MESHES
    },
    Importer { name: "Wavefront OBJ", endings: &["obj"], streams: true, read: obj::read, ..MESHES },
    // Scene files (TOML) cannot begin with a brace, so `{` identifies JSON.
    Importer {
        name: "glTF",
        endings: &["gltf", "glb"],
        is_flat: true,
        is_start: Some(|text| text.starts_with(b"glTF") || text.starts_with(b"{")),
        read: gltf::read,
        ..MESHES
    },
    Importer { name: "PLY", endings: &["ply"], is_start: Some(ply::is_start), read: ply::read, ..MESHES },
    Importer { name: "STL", endings: &["stl"], read: stl::read, ..MESHES },
    Importer { name: "OFF", endings: &["off"], is_start: Some(off::is_start), read: off::read, ..MESHES },
    Importer {
        name: "3MF",
        endings: &["3mf"],
        is_start: Some(|text| text.starts_with(b"PK\x03\x04")),
        read: threemf::read,
        ..MESHES
    },
];

/// The extensions of all supported formats: `.toml, .obj, ...`.
pub fn all_endings() -> String {
    list(IMPORTERS.iter(), ", ")
}

/// The extensions of mesh formats: `.obj, .gltf or .glb`.
pub fn mesh_endings() -> String {
    list(IMPORTERS.iter().filter(|importer| !importer.is_scene_file), " or ")
}

/// The names of formats that can be read from standard input: `scene file, glTF or ...`.
pub fn names_on_standard_input() -> String {
    let known = IMPORTERS.iter().filter(|importer| importer.is_scene_file || importer.is_start.is_some());
    join(&known.map(|importer| importer.name.to_owned()).collect::<Vec<_>>(), " or ")
}

fn list<'a>(importers: impl Iterator<Item = &'a Importer>, last: &str) -> String {
    let endings: Vec<String> = importers.flat_map(|i| i.endings).map(|ending| format!(".{ending}")).collect();
    join(&endings, last)
}

/// Joins names by commas, and the last one by `last`.
fn join(names: &[String], last: &str) -> String {
    match names {
        [rest @ .., end] if !rest.is_empty() => format!("{}{last}{end}", rest.join(", ")),
        _ => names.concat(),
    }
}

/// An input file: its bytes, and access to the files that it references.
pub(crate) struct Source {
    /// Path as given by the user; `-` for standard input.
    pub file: PathBuf,
    /// Its contents; empty if the importer reads it by [`Source::stream`].
    pub bytes: Vec<u8>,
    /// Opens referenced files.
    files: Files,
    /// Import options.
    options: ImportOptions,
}

impl Source {
    fn open(file: &Path, files: &Files, options: &ImportOptions) -> Result<Self> {
        let read = match importer_by_ending(file) {
            _ if file == Path::new("-") => files.read_standard_input(),
            Some(importer) if importer.streams => Ok(Vec::new()),
            _ => files.read(file),
        };
        let bytes = read.map_err(|e| unreadable(file, &e))?;
        Ok(Source { file: file.to_owned(), bytes, files: files.clone(), options: options.clone() })
    }

    /// A stream of the contents from the beginning, and their length in bytes.
    ///
    /// # Errors
    /// [`Error::Input`] if the file cannot be opened.
    fn stream(&self) -> Result<(Box<dyn Read + Send + '_>, u64)> {
        if !self.bytes.is_empty() {
            return Ok((Box::new(self.bytes.as_slice()), self.bytes.len() as u64));
        }
        let file = self.files.open(&self.file).map_err(|e| unreadable(&self.file, &e))?;
        let length = file.length();
        Ok((Box::new(file), length))
    }

    /// A path relative to the folder of the file, wherever it leads: for paths that the user wrote.
    fn beside(&self, name: impl AsRef<Path>) -> PathBuf {
        match self.file.parent() {
            Some(folder) if self.file != Path::new("-") => folder.join(name),
            _ => name.as_ref().to_owned(),
        }
    }

    /// Adds an object. An unnamed one takes the name of the file.
    fn add_object(&self, scene: &mut Scene, name: Option<String>, mesh: Mesh, material: MaterialId) {
        let stem = self.file.file_stem().filter(|_| self.file != Path::new("-"));
        let file_name = || stem.map_or_else(|| "mesh".into(), |stem| stem.to_string_lossy().into_owned());
        let name = name.unwrap_or_else(file_name);
        scene.objects.push(Object { name, input: 0, material, shape: Shape::Mesh(mesh) });
    }

    /// Scene of meshes with default materials. Unnamed meshes take the name of the file.
    fn scene_of(&self, meshes: Vec<(Option<String>, Mesh)>) -> Scene {
        let mut scene = Scene::default();
        let mut materials = DefaultMaterials::default();
        for (name, mesh) in meshes {
            let material = materials.of(&mesh, &mut scene);
            self.add_object(&mut scene, name, mesh, material);
        }
        scene
    }

    /// The contents as text without a byte order mark; invalid UTF-8 is replaced.
    fn text(&self) -> std::borrow::Cow<'_, str> {
        String::from_utf8_lossy(without_mark(&self.bytes))
    }
}

/// Default materials: light grey, or white for meshes with colours, which stay unchanged; translucent for meshes with
/// alpha. Each is added to the scene on first use.
#[derive(Default)]
pub(crate) struct DefaultMaterials(HashMap<[bool; 2], MaterialId>);

impl DefaultMaterials {
    /// Default material of a mesh of `scene`.
    pub(crate) fn of(&mut self, mesh: &Mesh, scene: &mut Scene) -> MaterialId {
        *self
            .0
            .entry([mesh.colours.is_some(), mesh.alphas.is_some()])
            .or_insert_with(|| scene.add_material(Material::Phong(default_material(mesh))))
    }
}

/// Default material of a mesh.
fn default_material(mesh: &Mesh) -> Phong {
    let grey = Phong::default();
    let colour = if mesh.colours.is_some() { Colour::Display(DVec3::ONE) } else { grey.colour };
    let opacity = mesh.alphas.is_some().then_some(Opacity { factor: 1.0, cutoff: None });
    Phong { colour, opacity, ..grey }
}

/// Reads all inputs into one scene, in the given order.
///
/// # Errors
/// [`Error::Input`] if a file cannot be used.
pub fn load(inputs: &[PathBuf], warnings: &mut Warnings) -> Result<Scene> {
    load_with(inputs, &ImportOptions::default(), warnings)
}

/// Reads all inputs as [`load`] does, with options.
///
/// # Errors
/// [`Error::Input`] if a file cannot be used, [`Error::Usage`] if none of them has the clip or the variant.
pub fn load_with(inputs: &[PathBuf], options: &ImportOptions, warnings: &mut Warnings) -> Result<Scene> {
    load_by(inputs, &Files::default(), options, warnings)
}

/// Reads an input from memory, as `-` is read from standard input: a scene file, glTF, PLY, OFF or 3MF. Files that it
/// references are relative to the working directory.
///
/// # Errors
/// As those of [`load_with`].
pub fn load_bytes(bytes: Vec<u8>, options: &ImportOptions, warnings: &mut Warnings) -> Result<Scene> {
    load_by(&["-".into()], &Files::with_standard_input(bytes), options, warnings)
}

/// Removes what cannot be rendered from a scene that was built in code, as from files. `name` is the scene in warnings.
pub fn sanitise(scene: &mut Scene, name: &str, warnings: &mut Warnings) {
    sanitise::sanitise(scene, Path::new(name), warnings);
}

/// Reads the inputs of a scene again, in another pose or variant. Images that it has by the same names are not decoded
/// again.
///
/// # Errors
/// As those of [`load_with`].
pub fn reload(scene: &Scene, options: &ImportOptions, warnings: &mut Warnings) -> Result<Scene> {
    load_by(&scene.inputs, &Files::of_scene(scene), options, warnings)
}

/// Poses a scene by clips at a time in seconds. Imports objects, cameras, lights, materials and images again, and keeps
/// all else, such as settings, default look and added cameras.
pub fn pose(scene: &mut Scene, seconds: f64) -> Result<()> {
    let moment = crate::scene::ClipTime { clip: scene.import_options.clip(), time: seconds };
    let options = scene.import_options.clone().posed(moment);
    let Scene { objects, mut cameras, lights, materials, images, .. } =
        reload(scene, &options, &mut Warnings::default())?;
    cameras.extend(scene.cameras.drain(..).skip(cameras.len()));
    (scene.objects, scene.cameras, scene.lights) = (objects, cameras, lights);
    (scene.materials, scene.images) = (materials, images);
    Ok(())
}

/// Reads all inputs as [`load`] does, and lists the files that the result depends on, whether a scene or an error: the
/// inputs and the files that they reference, missing ones included. Standard input is not listed.
pub fn load_and_list(
    inputs: &[PathBuf],
    options: &ImportOptions,
    warnings: &mut Warnings,
) -> (Result<Scene>, Vec<FileRead>) {
    let files = Files::default();
    let scene = load_by(inputs, &files, options, warnings);
    (scene, files.list())
}

/// Reads all inputs but not their images, so that all files that they refer to are known to [`crate::files`].
///
/// # Errors
/// As those of [`load_with`].
#[cfg(feature = "cli")]
pub(crate) fn list_files(inputs: &[PathBuf], options: &ImportOptions) -> Result<()> {
    load_by(inputs, &Files::without_images(), options, &mut Warnings::default()).map(drop)
}

fn load_by(
    inputs: &[PathBuf],
    files: &Files,
    options: &ImportOptions,
    warnings: &mut Warnings,
) -> Result<Scene> {
    let mut scene = Scene { inputs: inputs.to_vec(), import_options: options.clone(), ..Scene::default() };
    let edits = edits::parse(options)?;
    for (index, file) in inputs.iter().enumerate() {
        warnings.begin_part();
        let source = Source::open(file, files, options).map_err(|e| hinted(e, file))?;
        let mut one = read_one(&source, warnings).map_err(|e| hinted(e, file))?;
        let crease = options::crease(&source, None, options.smooths_meshes)?;
        drop(source);
        // The meshes of a scene file are turned one by one.
        if !one.has_settings {
            let (chosen, turns) = (options.reading.up.and_then(UpChoice::axis), options.reading.up.is_some());
            let up =
                chosen.unwrap_or_else(|| options::up_axis(&one, file, turns, inputs.len() == 1, warnings));
            if up != UpAxis::Y {
                one.turn(up);
            }
        }
        if let Some(crease) = crease.filter(|_| !one.has_settings) {
            smooth::smooth(&mut one, crease);
        }
        sharing::bake_small(&mut one);
        sanitise::sanitise(&mut one, file, warnings);
        warn_of_unused_textures(&one, file, warnings);
        if inputs.len() > 1 && one.objects.is_empty() && one.cameras.is_empty() && one.lights.is_empty() {
            warnings.push(format!("{}: {NO_TRIANGLES}", file.display()));
        }
        for object in &mut one.objects {
            object.input = index;
        }
        scene.append(one);
        // Degenerate triangles count, because the acceleration structure numbers them too.
        let count = |object: &Object| object.shape.mesh().map_or(1, |mesh| mesh.triangles.len() as u64);
        let count: u64 = scene.objects.iter().map(count).sum();
        let texels = scene.images.iter().map(|image| image.pixels.len() as u64).sum();
        let placements = scene.objects.len() as u64;
        for (counted, count) in
            [(Counted::Triangles, count), (Counted::Texels, texels), (Counted::Nodes, placements)]
        {
            counted.check(count, &options.limits, file.as_path())?;
        }
    }
    warnings.begin_part();
    // Applying the tracks at time 0 reports invalid tracks.
    if scene.animation.is_some() {
        scene.at(0.0)?;
    }
    options::check_names(&scene, options)?;
    options::pose_tracks(&mut scene, options)?;
    edits::apply(&mut scene, edits, warnings)?;
    let read = files.list().into_iter().filter(|read| read.stamp.is_some());
    scene.files_read = read.filter_map(|read| std::path::absolute(read.file).ok()).collect();
    Ok(scene)
}

/// Message for a file without triangles.
const NO_TRIANGLES: &str = "has no triangles to draw";

/// Checks that at least one of several mesh files contains a triangle. Scene files may consist of a background alone, but
/// not of objects that are all left out.
///
/// # Errors
/// [`Error::Input`] for the first file.
pub fn check_drawable(scene: &Scene) -> Result<()> {
    match scene.inputs.first() {
        Some(file) if scene.objects.is_empty() && !scene.has_settings => {
            let hint = "kiln draws faces, not points and lines; `kiln info` says what the file holds";
            Err(Error::input(file.as_path(), NO_TRIANGLES, hint))
        }
        Some(file) if scene.objects.is_empty() && scene.has_left_out => {
            let hint = "the warnings say why; correct their coordinates";
            Err(Error::input(file.as_path(), "all its objects are left out", hint))
        }
        _ => Ok(()),
    }
}

/// Warns of textured materials on meshes without texture coordinates.
fn warn_of_unused_textures(scene: &Scene, file: &Path, warnings: &mut Warnings) {
    for object in &scene.objects {
        let material = &scene.materials[object.material.0 as usize];
        if material.is_textured() && object.shape.mesh().is_none_or(|mesh| mesh.uvs.is_empty()) {
            warnings.left_out(format!(
                "{}: `{}` lacks the texture coordinates of its material `{}`; drawn without its textures",
                file.display(),
                object.name,
                material.name()
            ));
        }
    }
}

/// Reads an input or a referenced file. The caller validates the result.
fn read_one(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let importer = importer_for(source)?;
    let read = (importer.read)(source, warnings);
    source.note_references(warnings);
    match read {
        Ok(scene) if !scene.objects.is_empty() || importer.is_scene_file => Ok(scene),
        Ok(scene) => misnamed(importer, source).map_or(Ok(scene), Err),
        Err(_) if start(source).is_some_and(|start| start.is_empty()) => {
            Err(Error::input(source.file.as_path(), "is empty", "export or copy it again"))
        }
        Err(e) => Err(misnamed(importer, source).unwrap_or(e)),
    }
}

/// An error of an input that is missing, with a hint to one of a similar name.
fn hinted(e: Error, input: &Path) -> Error {
    match e {
        Error::Input { place, what, .. } if what == "no such file" && place == input.into() => {
            Error::input(place, what, hint_for_missing(input))
        }
        Error::Input { place, what, hint } if what == IS_FOLDER && place == input.into() => {
            let files = input.join("*.stl");
            let hint = format!("{hint}; `kiln render {} -o '{{name}}.png'` renders all", files.display());
            Error::input(place, what, hint)
        }
        e => e,
    }
}

/// The error for a file that has another format than its ending says, if it is recognised.
fn misnamed(importer: &Importer, source: &Source) -> Option<Error> {
    let start = start(source)?;
    if let Some((what, advice)) = converters::other_format(&start) {
        return Some(Error::input(
            source.file.as_path(),
            format!("its content is {what}, not {}", importer.name),
            advice,
        ));
    }
    let text = without_comments(without_mark(&start));
    let is_start = |other: &&Importer| other.is_start.is_some_and(|is_start| is_start(text));
    let other = IMPORTERS.iter().find(is_start).filter(|other| other.name != importer.name)?;
    let ending = if start.starts_with(b"glTF") { "glb" } else { other.endings.first()? };
    let what = format!("its content is {}, not {}", other.name, importer.name);
    Some(Error::input(source.file.as_path(), what, format!("rename it, so that it ends in .{ending}")))
}

/// The beginning of a file, if it can be read.
fn start(source: &Source) -> Option<Vec<u8>> {
    let mut start = source.bytes.get(..START.min(source.bytes.len())).unwrap_or_default().to_vec();
    if start.is_empty() {
        source.stream().ok()?.0.take(START as u64).read_to_end(&mut start).ok()?;
    }
    Some(start)
}

/// Bytes at the beginning of a file by which its format is recognised.
const START: usize = 1024;

/// Whether an input is a scene file rather than a mesh, by its extension.
pub fn is_scene_file(file: &Path) -> bool {
    IMPORTERS
        .iter()
        .any(|importer| importer.is_scene_file && importer.endings.contains(&ending(file).as_str()))
}

/// Whether a file has the extension of a format.
#[cfg(feature = "viewer")]
pub(crate) fn has_known_ending(file: &Path) -> bool {
    importer_by_ending(file).is_some()
}

/// Whether a file has the extension of an image that lights a scene as its environment.
#[cfg(feature = "viewer")]
pub(crate) fn is_environment_file(file: &Path) -> bool {
    ["hdr", "exr"].contains(&ending(file).as_str())
}

fn ending(file: &Path) -> String {
    file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

fn importer_by_ending(file: &Path) -> Option<&'static Importer> {
    let wanted = ending(file);
    IMPORTERS.iter().find(|importer| importer.endings.contains(&wanted.as_str()))
}

fn importer_for(source: &Source) -> Result<&'static Importer> {
    let found = if source.file == Path::new("-") {
        let text = without_comments(without_mark(&source.bytes));
        let is_start = |importer: &&Importer| importer.is_start.is_some_and(|is_start| is_start(text));
        IMPORTERS.iter().find(is_start).or_else(|| IMPORTERS.iter().find(|importer| importer.is_scene_file))
    } else {
        importer_by_ending(&source.file)
    };
    found.ok_or_else(|| {
        let advice = converters::advice_on(&ending(&source.file));
        let hint = format!("kiln reads {}; {advice}", all_endings());
        Error::input(source.file.as_path(), "not a kind of file that kiln reads", hint)
    })
}
