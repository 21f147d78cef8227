#![no_main]
mod common;

use kiln::film::write::Format;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let file = common::file("picture.part", data);
    for format in [Format::Png, Format::Exr] {
        let _ = kiln::farm::join(std::slice::from_ref(&file), format);
    }
});
