//! What accuracy costs: how far two pictures are apart.
//!
//! Commands above call it; it knows nothing of command lines and prints nothing.

pub mod metrics;
