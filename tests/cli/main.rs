//! The command `kiln`: exit codes, messages, files, signals, `kiln info`, animations, farms, exposure, builds without the window.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/workshop.rs"]
mod workshop;

mod animation;
mod command;
mod farm;
mod info;
mod mistakes;
mod outputs;
mod tone;
mod untrusted_text;
mod viewer;
