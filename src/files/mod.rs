//! Reading of whole files within the memory limits, and atomic writing.

mod inputs;
mod reading;
mod writing;

pub use inputs::{InputFiles, check_output, check_writable, protect_inputs};
pub use reading::{
    IS_FOLDER, Refused, RegularFile, explain, hint_for_missing, read_file, read_output, read_standard_input,
    unreadable,
};
pub use writing::{WholeFile, describe, discard_unfinished, folder_of, write_whole};
