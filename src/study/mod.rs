//! What accuracy costs: how far two pictures are apart, and rendering to a target.
//!
//! Commands above call it; it knows nothing of command lines and prints nothing.

pub mod choose;
pub mod metrics;
