//! The command `kiln`: exit codes, messages, files, signals, `kiln info`, animations, farms, exposure, builds without the window.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/workshop.rs"]
mod workshop;

mod animation;
mod bits;
mod cameras;
mod each_input;
mod exit_codes;
mod farm;
mod grain;
mod helpers;
mod info;
mod limits;
mod mistakes;
mod outputs;
mod pictures;
mod progress;
mod streams;
mod tone;
mod untrusted_text;
mod viewer;
