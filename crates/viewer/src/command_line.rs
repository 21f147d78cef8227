//! The `kiln render` command that renders the displayed picture, as one line for a POSIX shell.
//!
//! Options are written only where they differ from the defaults of `kiln render INPUT…`. Numbers are the shortest
//! decimal texts that parse to the same value, so the rendered picture is identical to the bit.

use std::path::{Path, PathBuf};

use super::request::{CameraSource, given};
use kiln::job::{PictureOptions, RenderSettings};
use kiln::scene::{
    Camera, ImportOptions, Look, PictureSettings, Projection, Scene, Side, default_size, shell_quoted,
};
use kiln::world::StandardView;

/// Settings of a `kiln render` command.
#[derive(Debug, Clone, Copy)]
pub struct RenderCommand<'a> {
    /// Input files as typed.
    pub inputs: &'a [PathBuf],
    /// The scene as loaded: before recentering, and before lights or cameras are added. `kiln render` uses its settings by
    /// default.
    pub scene: &'a Scene,
    /// Camera. Its own projection is overridden by `projection`.
    pub viewpoint: &'a CameraSource,
    /// Projection.
    pub projection: Projection,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// All other settings; camera, projection and size of these are not used.
    pub settings: &'a RenderSettings,
    /// What was asked of the input files.
    pub import_options: &'a ImportOptions,
    /// Output file.
    pub output: &'a Path,
}

impl RenderCommand<'_> {
    /// The camera, unless it is fitted.
    fn camera(&self) -> Option<&Camera> {
        match self.viewpoint {
            CameraSource::Scene(index) => self.scene.cameras.get(*index),
            CameraSource::Free(camera) => Some(camera),
            CameraSource::Fitted(_) | CameraSource::FittedAt(..) => None,
        }
    }

    /// Width and height in pixels that `kiln render` uses without `--size`.
    pub fn default_size(&self) -> [u32; 2] {
        default_size(self.scene.picture.size(), self.camera(), self.projection)
    }
}

/// The command as one line, quoted for any POSIX shell.
pub fn command_line(command: &RenderCommand) -> String {
    let words: Vec<String> = arguments(command).iter().map(|word| shell_quoted(word)).collect();
    words.join(" ")
}

/// The arguments of the command including `kiln`, unquoted.
pub fn arguments(command: &RenderCommand) -> Vec<String> {
    let (scene, settings) = (command.scene, command.settings);
    let colour = settings.picture.colour.or(scene.picture.colour);
    let own =
        PictureSettings { width: None, height: None, look: None, colour, ..settings.picture }.displayable();
    let defaults = scene.picture.or(PictureSettings::defaults()).entries();
    let mut picture = PictureSettings::default();
    for (name, text) in own.entries().into_iter().filter(|entry| !defaults.contains(entry)) {
        // It is the text of a value.
        let _ = picture.set(&name, Some(&*text));
    }
    let default = if scene.has_settings { Look::Draft } else { Look::Studio };
    let is_draft = settings.picture.look.unwrap_or(settings.mesh_look) == Look::Draft;
    let mut options = PictureOptions {
        size: (command.size != command.default_size()).then(|| command.size.map(Side::clamped)),
        import: command.import_options.clone(),
        environment: settings.environment.clone(),
        with: settings.with.clone(),
        without: settings.without.clone(),
        picture,
        draft: is_draft && scene.picture.look.unwrap_or(default) == Look::Studio,
        ..PictureOptions::default()
    };
    let projection = choose_camera(command, &mut options);
    options.projection = (command.projection != projection).then_some(command.projection);
    let mut words = vec!["kiln".to_owned(), "render".to_owned()];
    words.extend(command.inputs.iter().map(|input| as_operand(&input.to_string_lossy())));
    words.extend(["-o".to_owned(), as_operand(&command.output.to_string_lossy())]);
    words.extend(options.words());
    words
}

/// Sets the options of the camera, and returns the projection that the command has without `--projection`.
fn choose_camera(command: &RenderCommand, options: &mut PictureOptions) -> Projection {
    let cameras = &command.scene.cameras;
    match (command.viewpoint, command.camera()) {
        (CameraSource::Fitted(view) | CameraSource::FittedAt(view, _), _) => {
            match view {
                StandardView::Auto if command.scene.default_camera().is_none() => {}
                StandardView::Auto => options.camera = Some(view.name().to_owned()),
                view => options.view = Some(*view),
            }
            options.look_at.clone_from(&command.settings.look_at);
            Projection::default()
        }
        (_, None) => Projection::default(),
        (_, Some(camera)) => {
            let same = |known: &&Camera| {
                let Camera { name, projection, fitted, .. } = known;
                Camera { name: name.clone(), projection: *projection, fitted: *fitted, ..camera.clone() }
                    == **known
            };
            match cameras.iter().find(same) {
                Some(known) if command.scene.default_camera() == Some(known) => known.projection,
                Some(known) if is_found_by_name(cameras, known) => {
                    options.camera = Some(known.name.clone());
                    known.projection
                }
                _ => {
                    let own = Camera { projection: command.projection, ..given(camera) };
                    options.camera = Some(own.to_inline());
                    command.projection
                }
            }
        }
    }
}

/// Whether `--camera` with the camera's name selects this camera.
fn is_found_by_name(cameras: &[Camera], camera: &Camera) -> bool {
    let first = cameras.iter().find(|other| other.name == camera.name);
    let means_another = camera.name == "auto" || camera.name.trim_start().starts_with('{');
    first == Some(camera) && !means_another
}

/// A file name that is not parsed as an option; `-` stays, as it means standard input.
fn as_operand(file: &str) -> String {
    if file.starts_with('-') && file != "-" { format!("./{file}") } else { file.to_owned() }
}

#[cfg(test)]
mod tests;
