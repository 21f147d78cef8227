//! Renders a file to a PNG, as `kiln render` does without options. The file is a scene (.toml) or a mesh (.obj, .gltf,
//! .glb, .ply, .stl, .off, .3mf).
//!
//! ```sh
//! cargo run --release --example render_file -- scenes/assignment.toml assignment.png
//! ```

use std::path::Path;

use kiln::error::{Error, Result, Warnings};
use kiln::film::write::{Format, OutputImage, write_picture};
use kiln::job::{RenderControl, RenderSettings, prepare};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = &arguments[..] else {
        return Err(Error::usage("two arguments are needed", "render_file INPUT OUTPUT.png"));
    };
    render_file(input.as_ref(), output.as_ref(), &RenderSettings::default())
}

/// Renders `input` to `output`, and prints what could not be drawn.
pub fn render_file(input: &Path, output: &Path, settings: &RenderSettings) -> Result<()> {
    let mut warnings = Warnings::default();
    let scene = kiln::import::load(&[input.to_owned()], &mut warnings)?;
    let job = prepare(scene, settings, &mut warnings)?;
    for warning in warnings.messages() {
        eprintln!("warning: {warning}");
    }
    let (film, _) = job.render(&RenderControl::default())?;
    let image = OutputImage::Rgb8(film, job.pipeline());
    write_picture(&image, &job.metadata, Format::from_path(output)?, output)
}
