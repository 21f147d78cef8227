//! Reading of whole files within the memory limits, and atomic writing.

mod inputs;
mod reading;
mod writing;

pub use inputs::{InputFiles, check_output, check_writable, protect_inputs, separate_outputs};
pub use reading::{
    IS_FOLDER, Refused, RegularFile, explain, hint_for_missing, read_file, read_output, read_standard_input,
    unreadable,
};
pub use writing::{
    WholeFile, describe, discard_unfinished, file_key, folder_of, is_same_file, target_of, unfinished_in,
    write_whole,
};
