//! What the targets share: a folder for the file that a target reads, and rendering of what was read.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use kiln::error::Warnings;
use kiln::job;
use kiln::render::RenderControl;
use kiln::scene::{ClipChoice, ClipTime, ImportOptions, PictureSettings};

/// Writes the data to a file of this name in a folder of this process; the file.
///
/// kiln contains panics of decoders, so a panic must not end the process before it is caught. One that is not caught does.
pub fn file(name: &str, data: &[u8]) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
        let memory = Path::new("/dev/shm");
        let base = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = base.join(format!("kiln-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("no folder for the input");
        folder
    });
    let file = folder.join(name);
    std::fs::write(&file, data).expect("the input cannot be written");
    file
}

/// Imports a file, poses it by its first clip, and renders what can be rendered at 8 x 8 pixels.
#[allow(dead_code)]
pub fn render(file: &Path) {
    let mut warnings = Warnings::default();
    let Ok(scene) = kiln::import::load(&[file.to_owned()], &mut warnings) else { return };
    if !scene.clips.is_empty() {
        let options = ImportOptions::default().posed(ClipTime { clip: ClipChoice::First, time: 0.5 });
        let _ = kiln::import::reload(&scene, &options, &mut warnings);
    }
    let settings = PictureSettings::of_size([8, 8]).into();
    if let Ok(job) = job::prepare(scene, &settings, &mut warnings) {
        let _ = job.render::<[f32; 3]>(&RenderControl::default());
    }
}
