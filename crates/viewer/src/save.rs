//! Saving of pictures.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::mpsc::Sender;

use egui::{ColorImage, Context, DragValue, Key, TextEdit, Window};

use super::name_of;
use super::request::RenderRequest;
use kiln::error::{Result, Warnings, printable};
use kiln::film::write::{Format, OutputImage, write_picture};
use kiln::film::{self, ColourPipeline, DisplayTransform, Film};
use kiln::job::Metadata;
use kiln::job::metadata::set_frame;
use kiln::render::RenderControl;
use kiln::render::aov::AovSelection;

/// Largest width or height in pixels that the window saves.
const MAX_SIDE: u32 = 32_768;

/// The first of `STEM.ENDING`, `STEM-2.ENDING`, ... that neither exists nor is being saved.
pub(crate) fn free_name(stem: &str, ending: &str, saving: &[Saving]) -> PathBuf {
    let plain = PathBuf::from(format!("{stem}.{ending}"));
    let numbered = (2..).map(|number| PathBuf::from(format!("{stem}-{number}.{ending}")));
    std::iter::once(plain)
        .chain(numbered)
        .find(|name| !name.exists() && !saving.iter().any(|saving| saving.file == *name))
        .unwrap_or_default()
}

/// Stem of the names of saved files: the first input without its ending.
pub(crate) fn stem(inputs: &[PathBuf]) -> String {
    let name = inputs.first().map_or("kiln".into(), |input| name_of(input));
    Path::new(&name).file_stem().map_or(name.clone(), |stem| stem.to_string_lossy().into_owned())
}

/// Writes a file by `work` on a thread, and sends the result.
pub(crate) fn beside(
    file: PathBuf,
    tell: Sender<(PathBuf, Result<()>)>,
    wake: impl FnOnce() + Send + 'static,
    work: impl FnOnce(&Path) -> Result<()> + Send + 'static,
) {
    std::thread::spawn(move || {
        let done = work(&file);
        // The receiver is dropped when the window closes.
        let _ = tell.send((file, done));
        wake();
    });
}

/// A finished picture: its pixels, and how they are displayed.
pub(crate) struct Finished {
    pub film: Arc<Film>,
    pub display: DisplayTransform,
}

/// A picture to be saved.
pub(crate) struct SavedPicture {
    pub request: RenderRequest,
    /// Its frame, if the scene has an animation.
    pub frame: Option<i32>,
    /// The picture, if it is finished on the screen.
    pub finished: Option<Finished>,
    /// The command that renders it.
    pub command: String,
}

impl SavedPicture {
    /// Writes the picture in the format of the name's ending.
    ///
    /// # Errors
    /// The errors of rendering, and [`kiln::error::Error::Output`] if the file cannot be written.
    pub(crate) fn write(&self, file: &Path, control: &RenderControl) -> Result<()> {
        let format = Format::from_path(file)?;
        let (image, metadata) = self.image(format, control)?;
        write_picture(&image, &metadata, format, file)
    }

    /// The picture of `kiln render` with its metadata. What is finished on the screen is not rendered again, except for
    /// floating point and alpha.
    ///
    /// # Errors
    /// The errors of rendering.
    pub(crate) fn image(&self, format: Format, control: &RenderControl) -> Result<(OutputImage, Metadata)> {
        let SavedPicture { request, frame, finished, command } = self;
        let session = &request.opened.session;
        let settings = request.render_settings();
        let resolved = session.resolve(&settings, &mut Warnings::default())?;
        let picture = session.picture(&resolved, request.time)?;
        // Values of OpenEXR do not depend on an automatic exposure; frames keep their own, as those of the command.
        let is_displayed = format != Format::Exr || frame.is_none();
        let mut job = session.job(&picture, is_displayed, control)?;
        let finished = finished.as_ref().filter(|_| format != Format::Exr && !job.is_transparent());
        let image = match finished {
            Some(Finished { film, display }) => OutputImage::displayed(film, None, job.pipeline(), *display)?,
            None if format == Format::Exr => {
                let (film, alpha, _) = job.render_float(false, control)?;
                let attributes = job.exr_attributes(&AovSelection::new(&[])?);
                OutputImage::Float(film, alpha.into_iter().collect(), attributes)
            }
            None => job.render_image(control)?.0,
        };
        let mut metadata = std::mem::take(&mut job.metadata);
        frame.iter().for_each(|&frame| set_frame(&mut metadata, frame));
        metadata.push(("kiln:command".to_owned(), command.clone()));
        Ok((image, metadata))
    }
}

/// The first view of opened files as it is saved in a size that the window does not have. `frame` is that of an animation.
///
/// # Errors
/// Those of rendering.
pub fn saved_picture(
    opened: &Arc<super::Opened>,
    size: [u32; 2],
    frame: Option<i32>,
    format: Format,
) -> Result<(OutputImage, Metadata)> {
    let request = super::painter::request_at(opened, size, frame.unwrap_or(0));
    let picture = SavedPicture { request, frame, finished: None, command: String::new() };
    picture.image(format, &RenderControl::default())
}

/// A file that is being written.
pub(crate) struct Saving {
    pub file: PathBuf,
    /// Part of the tiles that are rendered, in percent.
    pub percent: Arc<AtomicUsize>,
}

/// The dialog for the name and the size of a picture.
pub(crate) struct SaveDialog {
    /// Absolute path as typed.
    file: String,
    size: [u32; 2],
    /// Whether another size can be chosen: false colours are saved as displayed.
    has_size: bool,
    /// Whether the picture has an alpha channel.
    has_alpha: bool,
    is_new: bool,
}

/// What the user did.
pub(crate) enum SaveAnswer {
    Open,
    Save(PathBuf, [u32; 2]),
    Closed,
}

impl SaveDialog {
    /// Proposes a file name and the size of the window's picture.
    pub(crate) fn new(file: &Path, size: [u32; 2], [has_size, has_alpha]: [bool; 2]) -> Self {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let file = file.to_string_lossy().into_owned();
        SaveDialog { file, size, has_size, has_alpha, is_new: true }
    }

    /// What prevents that the file is written.
    fn problem(&self) -> Option<String> {
        let file = Path::new(self.file.trim());
        let format = match Format::from_path(file) {
            Ok(format) => format,
            Err(_) => return Some("name a file that ends in .png, .jpg or .exr".to_owned()),
        };
        if !self.has_size && format != Format::Png {
            return Some("false colours are saved as .png".to_owned());
        }
        if self.has_alpha && format == Format::Jpeg {
            return Some("JPEG has no alpha channel: name a .png or .exr, or choose a background".to_owned());
        }
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let lacks = folder.filter(|folder| !folder.is_dir())?;
        Some(printable(&format!("there is no folder {}", lacks.display())).into_owned())
    }

    /// Shows the dialog.
    pub(crate) fn show(&mut self, context: &Context) -> SaveAnswer {
        let (mut is_open, mut saves, mut cancels) = (true, false, false);
        let width = (context.viewport_rect().width() - 60.0).min(420.0);
        let window = Window::new("Save the picture").open(&mut is_open).collapsible(false);
        window.default_width(width).default_pos([20.0, 40.0]).show(context, |ui| {
            ui.set_max_width(width);
            let edit = TextEdit::singleline(&mut self.file).hint_text("a path").desired_width(f32::INFINITY);
            let field = ui.add(edit);
            if std::mem::take(&mut self.is_new) {
                field.request_focus();
            }
            let [is_entered, is_closed] =
                [Key::Enter, Key::Escape].map(|key| ui.input(|input| input.key_pressed(key)));
            (saves, cancels) = (field.lost_focus() && is_entered, is_closed);
            if self.has_size {
                ui.horizontal(|ui| {
                    let [x, y] = &mut self.size;
                    ui.add(DragValue::new(x).range(1..=MAX_SIDE));
                    ui.label("x");
                    ui.add(DragValue::new(y).range(1..=MAX_SIDE));
                    ui.label("pixels")
                        .on_hover_text("the window's size is not rendered again once it is finished");
                });
            }
            let problem = self.problem();
            let exists = problem.is_none() && Path::new(self.file.trim()).exists();
            if let Some(problem) = &problem {
                ui.colored_label(ui.visuals().error_fg_color, problem);
            }
            ui.horizontal(|ui| {
                let name = if exists { "Replace the file" } else { "Save" };
                saves |= ui.add_enabled(problem.is_none(), egui::Button::new(name)).clicked();
                saves &= problem.is_none();
                cancels |= ui.button("Cancel").clicked();
            });
        });
        match (saves, is_open && !cancels) {
            (true, _) => SaveAnswer::Save(PathBuf::from(self.file.trim()), self.size),
            (false, true) => SaveAnswer::Open,
            (false, false) => SaveAnswer::Closed,
        }
    }
}

/// Writes displayed colours as a PNG.
///
/// # Errors
/// [`kiln::error::Error::Output`] if the file cannot be written, [`kiln::error::Error::Failed`] without enough
/// memory.
pub(crate) fn colours(image: &ColorImage, file: &Path) -> Result<()> {
    let [width, height] = image.size.map(|side| side as u32);
    let pixels: Vec<[u8; 3]> =
        image.pixels.iter().map(|colour| [colour.r(), colour.g(), colour.b()]).collect();
    let film = Film::from_rows(film::Window { x: 0, y: 0, width, height }, &pixels)?;
    let made_by = vec![("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION")))];
    write_picture(&OutputImage::Rgb8(film, ColourPipeline::Display), &made_by, Format::Png, file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_written_is_named_before_it_is_rendered() {
        let folder = tempfile::tempdir().expect("a folder");
        let problem = |name: &str, kind| {
            SaveDialog::new(&folder.path().join(name), [4, 4], kind).problem().unwrap_or_default()
        };
        let (opaque, transparent, false_colours) = ([true, false], [true, true], [false, false]);
        for name in ["a.png", "a.JPG", "a.exr"] {
            assert_eq!(problem(name, opaque), "");
            assert_eq!(problem(name, transparent).is_empty(), name != "a.JPG");
        }
        assert!(problem("a.gif", opaque).contains(".png, .jpg or .exr"));
        assert!(problem("none/a.png", opaque).starts_with("there is no folder"));
        assert!(problem("a.exr", false_colours).contains(".png"));
    }
}
