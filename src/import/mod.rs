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

mod edits;
mod files;
mod formats;
mod meshes;
mod text;

mod images;
mod options;

pub use files::names::FileNames;
pub use formats::scene_file::{SceneFile, inline_camera};
pub use images::environment::environment;

use files::contents;
use formats::{gltf, obj, off, ply, scene_file, stl, threemf};
pub use meshes::sharing;
use meshes::{sanitise, smooth};

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

pub use files::dependencies::{FileRead, Stamp};

use crate::error::{Error, Result, Warnings};
use crate::files::hint_for_missing;
use crate::files::{IS_FOLDER, unreadable};
use crate::film::Colour;
use crate::limits::{self, Counted};
use crate::scene::{
    ImportOptions, Material, MaterialId, Mesh, Object, Opacity, Phong, Scene, Shape, UpAxis, UpChoice,
};
use files::dependencies::Files;
use glam::DVec3;
use text::lines::decode;

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
    /// Whether the importer reads files by [`Source::stream`] rather than from [`Source::bytes`].
    streams: bool,
    read: fn(&Source, &mut Warnings) -> Result<Scene>,
}

/// A format of smooth meshes.
const MESHES: Importer = Importer {
    name: "",
    endings: &[],
    is_scene_file: false,
    is_flat: false,
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
    Importer { name: "glTF", endings: &["gltf", "glb"], is_flat: true, read: gltf::read, ..MESHES },
    Importer { name: "PLY", endings: &["ply"], read: ply::read, ..MESHES },
    Importer { name: "STL", endings: &["stl"], read: stl::read, ..MESHES },
    Importer { name: "OFF", endings: &["off"], read: off::read, ..MESHES },
    Importer { name: "3MF", endings: &["3mf"], read: threemf::read, ..MESHES },
];

/// The extensions of all supported formats: `.toml, .obj, ...`.
pub fn all_endings() -> String {
    list(IMPORTERS.iter(), ", ")
}

/// The extensions of mesh formats: `.obj, .gltf or .glb`.
pub fn mesh_endings() -> String {
    list(IMPORTERS.iter().filter(|importer| !importer.is_scene_file), " or ")
}

/// The files of a folder with the ending of a supported format, but hidden ones, in the order of their names.
///
/// # Errors
/// [`Error::Input`] for a folder that cannot be read, or without such a file.
pub fn files_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).and_then(|entries| {
        entries.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<Vec<PathBuf>>>()
    });
    let mut files = entries.map_err(|e| unreadable(folder, &e))?;
    let is_hidden =
        |file: &Path| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    files.retain(|file| importer_by_ending(&ending(file)).is_some() && file.is_file() && !is_hidden(file));
    files.sort();
    match files.is_empty() {
        true => Err(Error::input(
            folder,
            "has no file of a format that is read",
            format!("these are {}", all_endings()),
        )),
        false => Ok(files),
    }
}

/// The extensions of importers, joined by commas, and the last one by `last`.
fn list<'a>(importers: impl Iterator<Item = &'a Importer>, last: &str) -> String {
    let endings: Vec<String> = importers.flat_map(|i| i.endings).map(|ending| format!(".{ending}")).collect();
    match &endings[..] {
        [rest @ .., end] if !rest.is_empty() => format!("{}{last}{end}", rest.join(", ")),
        _ => endings.concat(),
    }
}

/// An input file: its bytes, and access to the files that it references.
pub(crate) struct Source {
    /// Path as given by the user; `-` for standard input.
    pub file: PathBuf,
    importer: &'static Importer,
    /// Its contents; text in UTF-8 without a byte order mark. Empty if the importer reads it by [`Source::stream`].
    pub bytes: Vec<u8>,
    /// Opens referenced files.
    files: Files,
    /// Import options.
    options: ImportOptions,
}

impl Source {
    fn open(file: &Path, files: &Files, options: &ImportOptions) -> Result<Self> {
        let failed = |e: io::Error| unreadable(file, &e);
        let is_piped = file == Path::new("-");
        let (mut bytes, length) = match is_piped {
            true => files.read_standard_input().map(|bytes| (bytes, None)),
            false => files
                .open(file)
                .and_then(|opened| start_of(opened).map(|(start, length)| (start, Some(length)))),
        }
        .map_err(failed)?;
        let length = length.unwrap_or(bytes.len() as u64);
        let start = &bytes[..bytes.len().min(contents::START)];
        // Headers of binary STL may be UTF-16.
        let is_text = !stl::has_length_of_binary(start, length);
        let text = if is_text { decode(start) } else { start.into() };
        let importer = importer_of(file, &text, length)?;
        let is_recoded = matches!(text, Cow::Owned(_));
        if is_recoded {
            // Two bytes of UTF-16 are at most three of UTF-8, in a vector that may have doubled.
            limits::check(limits::product(&[length, 4]))
                .map_err(|excess| excess.at(file, "decoding its text"))?;
        }
        drop(text);
        if !is_piped {
            bytes = if importer.streams && !is_recoded {
                Vec::new()
            } else {
                files.read(file).map_err(failed)?
            };
        }
        if is_text {
            match decode(&bytes) {
                Cow::Owned(text) => bytes = text,
                Cow::Borrowed(text) => drop(bytes.drain(..bytes.len() - text.len())),
            }
        }
        Ok(Source { file: file.to_owned(), importer, bytes, files: files.clone(), options: options.clone() })
    }

    /// A file of these contents without options, by its ending.
    #[cfg(test)]
    fn of(file: impl Into<PathBuf>, bytes: impl Into<Vec<u8>>) -> Self {
        let (file, options) = (file.into(), ImportOptions::default());
        let importer = importer_by_ending(&ending(&file)).unwrap_or(&MESHES);
        Source { importer, bytes: decode(&bytes.into()).into_owned(), file, files: Files::default(), options }
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

    /// The contents as text; invalid UTF-8 is replaced.
    fn text(&self) -> std::borrow::Cow<'_, str> {
        String::from_utf8_lossy(&self.bytes)
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

/// Reads an input from memory, as `-` is read from standard input. Files that it references are relative to the working
/// directory.
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
pub fn list_files(inputs: &[PathBuf], options: &ImportOptions) -> Result<()> {
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
        let crease = options::crease(&source, None, options.smooths_meshes);
        let format = source.importer.name;
        drop(source);
        // The meshes of a scene file are turned one by one.
        if !one.has_settings {
            let (chosen, turns) = (options.up.and_then(UpChoice::axis), options.up.is_some());
            let is_alone = inputs.len() == 1;
            let up =
                chosen.unwrap_or_else(|| options::up_axis(&one, file, format, turns, is_alone, warnings));
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
    let (importer, ending) = (source.importer, ending(&source.file));
    let read = (importer.read)(source, warnings);
    source.note_references(warnings);
    let has_none = read.as_ref().is_ok_and(|scene| scene.objects.is_empty() && !importer.is_scene_file);
    if (read.is_err() || has_none) && source.bytes.is_empty() && !importer.streams {
        return Err(empty(&source.file));
    }
    if read.is_ok() && !ending.is_empty() && !importer.endings.contains(&ending.as_str()) {
        let name = importer.name;
        warnings
            .note(format!("{}: read as {name} by its contents, not by its ending", source.file.display()));
    }
    read
}

fn empty(file: &Path) -> Error {
    Error::input(file, "is empty", "export or copy it again")
}

/// An error of an input that is missing, with a hint to one of a similar name.
fn hinted(e: Error, input: &Path) -> Error {
    match e {
        Error::Input { place, what, .. } if what == "no such file" && place == input.into() => {
            Error::input(place, what, hint_for_missing(input))
        }
        Error::Input { place, what, hint } if what == IS_FOLDER && place == input.into() => {
            let hint = format!("{hint}; `kiln render {} -o out/` renders each", input.display());
            Error::input(place, what, hint)
        }
        e => e,
    }
}

/// The endings of environments.
const ENVIRONMENTS: [&str; 2] = ["hdr", "exr"];

/// Whether a file is an image that lights a scene as its environment.
pub fn is_environment_file(file: &Path) -> bool {
    ENVIRONMENTS.contains(&kind_of_file(file).as_str())
}

/// Whether a file can be opened, alone or as an environment.
pub fn is_known(file: &Path) -> bool {
    let is = |kind: &str| importer_by_ending(kind).is_some() || ENVIRONMENTS.contains(&kind);
    is(&ending(file)) || is(&kind_of_file(file))
}

/// The kind of a file by its contents, else its ending.
fn kind_of_file(file: &Path) -> String {
    let opened = crate::files::RegularFile::open_any(file).and_then(start_of);
    let kind = opened.ok().and_then(|(start, length)| contents::kind(&decode(&start), length));
    kind.map_or_else(|| ending(file), |(ending, _)| ending.to_owned())
}

/// The beginning of a file, by which its kind is recognised, and its length.
fn start_of(file: crate::files::RegularFile) -> io::Result<(Vec<u8>, u64)> {
    let (mut start, length) = (Vec::new(), file.length());
    file.take(contents::START as u64).read_to_end(&mut start)?;
    Ok((start, length))
}

fn ending(file: &Path) -> String {
    file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

fn importer_by_ending(ending: &str) -> Option<&'static Importer> {
    IMPORTERS.iter().find(|importer| importer.endings.contains(&ending))
}

/// The importer of a file by its contents, of which `start` is the beginning, else by its ending.
///
/// # Errors
/// [`Error::Input`] if it is of none.
fn importer_of(file: &Path, start: &[u8], length: u64) -> Result<&'static Importer> {
    let own = ending(file);
    let (ending, name) = contents::kind(start, length).unwrap_or((own.as_str(), ""));
    importer_by_ending(ending).ok_or_else(|| {
        let advice = contents::advice_on(ending);
        if start.is_empty() {
            return empty(file);
        }
        if name.is_empty() {
            let hint = format!("kiln reads {}; {advice}", all_endings());
            return Error::input(file, "not a kind of file that kiln reads", hint);
        }
        let expected = importer_by_ending(&own).map_or("a format that kiln reads", |importer| importer.name);
        Error::input(file, format!("its content is {name}, not {expected}"), advice)
    })
}
