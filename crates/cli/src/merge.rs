//! `kiln merge`: combines the shards of a picture.

use std::path::PathBuf;

use clap::Args;

use super::message::Message;
use super::output::check_folder;
use kiln::error::{Error, Result};
use kiln::farm::join;
use kiln::files::is_same_file;
use kiln::film::write::{Format, write_picture};
use kiln::scene::option::group;

#[derive(Args)]
pub(crate) struct Command {
    /// All shards of the picture, written by `kiln render --shard`, in any order
    #[arg(required = true, value_name = "SHARD")]
    shards: Vec<PathBuf>,
    /// Picture to write: .png, .jpg or .exr
    #[arg(help_heading = group::OUTPUT, short, long, value_name = "OUT")]
    output: PathBuf,
}

pub(crate) fn run(command: &Command) -> Result<()> {
    let Command { shards, output } = command;
    let format = Format::from_path(output)?;
    check_folder(output)?;
    if let Some(shard) = shards.iter().find(|shard| is_same_file(shard, output)) {
        return Err(Error::usage(
            format!("{}: both a shard and the picture", shard.display()),
            "give --output another name",
        ));
    }
    let (picture, metadata) = join(shards, format)?;
    write_picture(&picture, &metadata, format, output)?;
    Message::Done(&format!("wrote {} from {} shard(s)", output.display(), shards.len())).print();
    Ok(())
}
