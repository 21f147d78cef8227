//! Trees, layouts, presets and tiers of numerics against brute force and exact arithmetic.

#[path = "../common/mod.rs"]
mod common;

mod crossings;
mod exact;
mod exact_oracle;
mod instances;
mod library;
mod oracle;
mod packets;
mod refit;
mod shapes;
