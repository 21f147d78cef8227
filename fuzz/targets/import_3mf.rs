#![no_main]
mod common;

libfuzzer_sys::fuzz_target!(|data: &[u8]| common::render(&common::file("model.3mf", data)));
