//! Saving of pictures and cameras.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;

use egui::ColorImage;

use super::name_of;
use super::painter::Prepared;
use super::request::RenderRequest;
use crate::error::{Result, Warnings};
use crate::files::write_whole;
use crate::film::write::{Format, OutputImage, write_picture};
use crate::film::{ColourPipeline, Film, Window};
use crate::job::metadata::{add_to_fingerprint, replace, set_auto_exposure};
use crate::job::resolve;
use crate::render::RenderControl;

/// The first of `STEM.ENDING`, `STEM-2.ENDING`, ... that neither exists nor is being saved.
pub(crate) fn free_name(stem: &str, ending: &str, saving: &[PathBuf]) -> PathBuf {
    let plain = PathBuf::from(format!("{stem}.{ending}"));
    let numbered = (2..).map(|number| PathBuf::from(format!("{stem}-{number}.{ending}")));
    std::iter::once(plain)
        .chain(numbered)
        .find(|name| !name.exists() && !saving.contains(name))
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

/// Renders the picture of a side as `kiln render` does, and writes it as a PNG.
///
/// # Errors
/// The errors of rendering, and [`crate::error::Error::Output`] if the file cannot be written.
pub(crate) fn picture(
    prepared: &Prepared,
    (request, side): (&RenderRequest, usize),
    command: String,
    file: &Path,
) -> Result<()> {
    let RenderRequest { opened, time, sides, .. } = request;
    let control = RenderControl::default();
    let mut job = prepared.job.with_plan_settings(prepared.job.plan_settings.clone())?;
    if prepared.meters {
        job.meter(&control)?;
    }
    let (image, statistics) = job.render_image(&control)?;
    let settings = request.render_settings(&sides[side]);
    let mut metadata = resolve(opened.scene.clone(), &settings, &mut Warnings::default())?.picture.metadata;
    if time.part != 0.0 {
        add_to_fingerprint(&mut metadata, "time", &time.part);
    }
    if prepared.meters {
        replace(&mut metadata, &job.settings.picture);
    }
    if let Some(ev) = statistics.auto_exposure {
        set_auto_exposure(&mut metadata, ev);
    }
    metadata.push(("kiln:command".to_owned(), command));
    write_picture(&image, &metadata, Format::Png, file)
}

/// Writes a text file, such as a camera for a scene file.
///
/// # Errors
/// [`crate::error::Error::Output`] if the file cannot be written.
pub(crate) fn text(file: &Path, text: &str) -> Result<()> {
    write_whole(file, |out| out.write_all(text.as_bytes()))
}

/// Writes displayed colours as a PNG.
///
/// # Errors
/// [`crate::error::Error::Output`] if the file cannot be written, [`crate::error::Error::Failed`] without enough
/// memory.
pub(crate) fn colours(image: &ColorImage, file: &Path) -> Result<()> {
    let [width, height] = image.size.map(|side| side as u32);
    let pixels: Vec<[u8; 3]> =
        image.pixels.iter().map(|colour| [colour.r(), colour.g(), colour.b()]).collect();
    let film = Film::from_rows(Window { x: 0, y: 0, width, height }, &pixels)?;
    let made_by = vec![("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION")))];
    write_picture(&OutputImage::Rgb8(film, ColourPipeline::Display), &made_by, Format::Png, file)
}
