#![no_main]
mod common;

// The first byte chooses between the formats.
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((first, data)) = data.split_first() else { return };
    let name = if first & 1 == 0 { "sky.hdr" } else { "sky.exr" };
    common::file(name, data);
    let scene = format!("[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n[environment]\nfile = '{name}'\n");
    common::render(&common::file("scene.toml", scene.as_bytes()));
});
