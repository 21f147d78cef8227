//! What kiln measures of itself and of other libraries: speed, leaks and errors ([`mod@bench`]), and what accuracy costs in
//! time ([`study`]).

pub mod bench;
mod page;
pub mod study;
pub mod timing;
