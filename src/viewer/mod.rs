//! The window: a scene that one can walk around in, and see what each effect does and costs.

pub mod false_colour;
pub mod inspect;
pub mod navigate;
pub mod words;
