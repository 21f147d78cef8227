//! Image files of a few hundred bytes whose headers state a large size.

/// A PNG with 16 bits in four channels whose header is whole and gives this size; nothing is in it.
pub fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Sixteen);
    drop(encoder.write_header().expect("a header can be written"));
    bytes
}

/// An OpenEXR picture with `channels` of f32 in one tile of its whole size, which is empty. Technical Introduction to
/// OpenEXR, "File Layout"; "OpenEXR File Layout", "Attribute Types".
pub fn exr(width: i32, height: i32, channels: &[&str]) -> Vec<u8> {
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        let size = (value.len() as i32).to_le_bytes();
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", size.as_slice(), value].concat()
    };
    let numbers = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let mut list: Vec<u8> = Vec::new();
    for name in channels {
        // Type 2 is f32; not linear, three bytes reserved; sampled at every pixel.
        list.extend([name.as_bytes(), b"\0", &numbers(&[2, 0, 1, 1])].concat());
    }
    list.push(0);
    let window = numbers(&[0, 0, width - 1, height - 1]);
    let one = 1f32.to_le_bytes();
    let mut bytes = [
        // The magic number, version 2 with the bit for tiles.
        numbers(&[20_000_630, 2 | 0x200]),
        attribute("channels", "chlist", &list),
        attribute("compression", "compression", &[3]),
        attribute("dataWindow", "box2i", &window),
        attribute("displayWindow", "box2i", &window),
        attribute("lineOrder", "lineOrder", &[0]),
        attribute("pixelAspectRatio", "float", &one),
        attribute("screenWindowCenter", "v2f", &[0; 8]),
        attribute("screenWindowWidth", "float", &one),
        attribute("tiles", "tiledesc", &[numbers(&[width, height]), vec![0]].concat()),
        vec![0],
    ]
    .concat();
    // The offset of the one tile, its place and level, and eight bytes of it.
    let offset = bytes.len() as u64 + 8;
    bytes.extend(offset.to_le_bytes());
    bytes.extend(numbers(&[0, 0, 0, 0, 8]));
    bytes.extend([0x78, 0x9c, 3, 0, 0, 0, 0, 1]);
    bytes
}
