//! Text of files: lines, words and values.

pub(crate) mod lines;
pub(crate) mod values;
