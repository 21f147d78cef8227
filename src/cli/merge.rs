//! `kiln merge`: combines the parts of a picture.

use std::path::PathBuf;

use clap::Args;

use super::message::Message;
use super::output::{check_folder, same_file};
use crate::error::{Error, Result};
use crate::farm::join;
use crate::film::write::{Format, write_picture};

#[derive(Args)]
pub(crate) struct Command {
    /// The parts, in any order: what `kiln render --shard` wrote
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The picture to write: .png, .jpg or .exr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
}

pub(crate) fn run(command: &Command) -> Result<()> {
    let Command { parts, output } = command;
    let format = Format::from_path(output)?;
    check_folder(output)?;
    if let Some(part) = parts.iter().find(|part| same_file(part, output)) {
        return Err(Error::usage(
            format!("{}: both a part and the picture", part.display()),
            "give --output another name",
        ));
    }
    let (picture, metadata) = join(parts, format)?;
    write_picture(&picture, &metadata, format, output)?;
    Message::Done(&format!("wrote {} from {} part(s)", output.display(), parts.len())).print();
    Ok(())
}
