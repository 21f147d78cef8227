#![no_main]

// Images given to `kiln compare`.
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = kiln::film::read::decode_pixels(data.to_vec());
});
