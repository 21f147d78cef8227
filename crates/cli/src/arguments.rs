//! Options shared by all commands that render.

use std::path::{Path, PathBuf};

use clap::Args;

use super::options::Table;
use kiln::error::{Error, Result};
use kiln::import::all_endings;
use kiln::job::PictureOptions;

/// Help text of `INPUT`: purpose and readable formats.
pub(crate) fn inputs_help(purpose: &str) -> String {
    format!("{purpose}: {}; `-` reads one of them from standard input", all_endings())
}

/// Inputs, camera and render settings: options of all commands that render.
#[derive(Args, Clone)]
pub(crate) struct Arguments {
    /// Input files, combined into one scene.
    #[arg(required = true, value_name = "INPUT", help = inputs_help("Input files, combined into one scene"))]
    pub inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub options: Table<PictureOptions>,
}

/// Checks options and inputs before any file is read.
pub(crate) fn check(arguments: &Arguments) -> Result<()> {
    arguments.options.settings()?;
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}
