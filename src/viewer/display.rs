//! Machines without a display.
use crate::error::Error;
/// What went wrong in words.
pub fn explain(e: &eframe::Error) -> Error {
    Error::Failed { what: format!("no window can be opened: {e}"), hint: String::new() }
}
