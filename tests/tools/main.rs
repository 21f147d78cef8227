//! `kiln bench`, `kiln compare`, `kiln explain` and `kiln study`.

#[path = "../common/mod.rs"]
mod common;

mod bench;
mod compare;
mod contains;
mod explain;
mod leaks;
mod study;
mod t_test;
