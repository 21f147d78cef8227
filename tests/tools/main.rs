//! `kiln bench`, `kiln compare`, `kiln explain` and `kiln study`.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/workshop.rs"]
mod workshop;

mod bench;
mod compare;
mod contains;
mod explain;
mod leaks;
mod pixel;
mod study;
mod t_test;
