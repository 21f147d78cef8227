//! Tests of `stl`.

use crate::import::formats::stl::*;
use crate::scene::{Phong, Shape};

fn read_bytes(bytes: Vec<u8>) -> Result<(Vec<(String, Mesh)>, Warnings)> {
    let mut warnings = Warnings::default();
    let scene = read(&Source::of("a.stl", bytes), &mut warnings)?;
    let mesh = |shape: Shape| if let Shape::Mesh(mesh) = shape { mesh } else { panic!("a mesh") };
    Ok((scene.objects.into_iter().map(|object| (object.name, mesh(object.shape))).collect(), warnings))
}

/// Corners of the faces of a tetrahedron, with varying signs of zero.
fn tetrahedron() -> [[[f32; 3]; 3]; 4] {
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, -3.5]];
    [[a, b, c], [[-0.0, 0.0, 0.0], d, b], [[0.0, -0.0, 0.0], c, d], [b, d, c]]
}

fn binary(header: &[u8], count: u32) -> Vec<u8> {
    let mut out = header.to_vec();
    out.resize(80, b' ');
    out.extend(count.to_le_bytes());
    for facet in tetrahedron() {
        // The normal is 0, because it is ignored.
        out.extend([0; 12]);
        out.extend(facet.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

fn ascii(name: &str, end: &str) -> Vec<u8> {
    let mut text = format!("solid {name}\n");
    for facet in tetrahedron() {
        text += "  facet normal 0 0 nan\n    outer loop\n";
        for [x, y, z] in facet {
            text += &format!("      vertex {x:e} {y} {z:+}\n");
        }
        text += "    endloop\n  endfacet\n";
    }
    text += &format!("endsolid {name}\n");
    text.replace('\n', end).into_bytes()
}

#[test]
fn text_and_bytes_make_the_same_closed_mesh() {
    let whole = [
        binary(b"made by hand", 4),
        binary(b"solid as many exporters write", 4),
        binary(b"", 4),
        ascii("", "\n"),
        ascii("", "\r\n"),
        [b"\xEF\xBB\xBF", ascii("", "\r").as_slice()].concat(),
    ];
    for bytes in whole {
        let (meshes, warnings) = read_bytes(bytes).expect("a whole file");
        assert!(warnings.is_empty(), "{warnings:?}");
        let [(name, mesh)] = &meshes[..] else { panic!("one mesh") };
        assert_eq!((name.as_str(), mesh.positions.len()), ("a", 4));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]);
        assert_eq!(mesh.positions[3], DVec3::new(0.0, 0.0, -3.5));
        assert!(mesh.normals.is_none() && mesh.colours.is_none());
    }
}

#[test]
fn each_solid_is_an_object() {
    let both = [ascii("left wing", "\n"), ascii("", "\n"), b"solid empty\nendsolid\n".to_vec()].concat();
    let (meshes, _) = read_bytes(both).expect("two solids");
    let names: Vec<&str> = meshes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["left wing", "a"]);
    assert_eq!(meshes[0].1, meshes[1].1);
}

#[test]
fn faults_have_their_place() {
    let text = |text: &str| read_bytes(text.into()).map(drop).expect_err("it is broken").to_string();
    let head = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n";
    assert_eq!(text(&format!("{head}vertex 0 x 0")), "a.stl:5: a vertex without three numbers");
    assert_eq!(text(&format!("{head}endloop")), "a.stl:5: a facet of 1 vertices, not 3");
    assert_eq!(text(&format!("{head}facet")), "a.stl:5: neither `vertex` nor `endloop` in a facet");
    assert_eq!(text(head), "a.stl:4: the file ends within a facet");
    assert_eq!(text("solid\nfacets"), "a.stl:2: not a statement of STL files");
    let what = "ends within the header of binary STL; ASCII STL begins with `solid`";
    assert_eq!(text("\0sold"), format!("a.stl: byte 5: {what}"));
    assert_eq!(text("sold"), "a.stl:1: not a statement of STL files");
    // 84 + 4 * 50 = 284.
    let bytes = |bytes: Vec<u8>| read_bytes(bytes).map(|(_, warnings)| warnings);
    let e = bytes(binary(b"", 4)[..133].to_vec()).expect_err("it is cut off");
    assert_eq!(e.to_string(), "a.stl: byte 133: ends after 0 of 4 triangles");
    let warnings = bytes(binary(b"", 3)).expect("three triangles");
    assert_eq!(warnings.messages(), ["a.stl: left out 50 byte(s) after the last triangle"]);
}

#[test]
fn what_is_there_of_a_short_file_is_read() {
    let read = |bytes: Vec<u8>| {
        let (meshes, warnings) = read_bytes(bytes).expect("some triangles");
        (meshes[0].1.triangles.len(), warnings.messages().join("; "))
    };
    let (count, said) = read(binary(b"solid", 4)[..283].to_vec());
    assert_eq!(
        (count, said.as_str()),
        (3, "a.stl: ends after 3 of 4 triangles; the complete ones are drawn")
    );
    let (count, said) = read(binary(b"", u32::MAX));
    assert!(count == 4 && said.contains("ends after 4 of 4294967295 triangles"), "{count}: {said}");
    // The header of a streaming exporter.
    let (count, said) = read(binary(b"", 0));
    assert_eq!((count, said.as_str()), (4, "a.stl: the header says 0 triangles; 4 are drawn"));
    // Text truncated in its third facet.
    let text = ascii("a", "\n");
    let cut =
        text.windows(8).enumerate().filter(|(_, word)| word == b"endfacet").nth(1).expect("facets").0 + 60;
    let (count, said) = read(text[..cut].to_vec());
    assert_eq!((count, said.as_str()), (2, "a.stl: ends without `endsolid`, so it may not be whole"));
}

/// Two-word end keywords, all words on one line, words in any case, names of several words, and names with
/// keywords.
#[test]
fn text_is_words_and_not_lines() {
    let text = String::from_utf8(ascii("left facet wing", "\n")).expect("ASCII");
    let two_words = text.replace("end", "end ");
    for text in [
        text.clone(),
        two_words.clone(),
        text.to_uppercase().replace("LEFT FACET WING", "left facet wing").replace('E', "e"),
        text.replace('\n', " "),
        two_words.replace('\n', "\t"),
        text.replace(' ', "\n").replace("solid\nleft\nfacet\nwing", "solid left facet wing"),
        text.replace("facet normal 0 0 nan", "facet normal -1.#IND 0 nan(x)"),
        text.replace("facet normal 0 0 nan", "facet"),
        text.replace("endloop", "endloop 1").replace("endfacet", "endfacet and more"),
        format!("# by hand\n{}", text.replace("endloop", "endloop # the first").replace("nan", "nan # none")),
    ] {
        let (meshes, warnings) =
            read_bytes(text.repeat(2).into_bytes()).unwrap_or_else(|e| panic!("{e}: {text}"));
        let found: Vec<_> = meshes.iter().map(|(name, mesh)| (name.as_str(), mesh.triangles.len())).collect();
        assert_eq!(found, [("left facet wing", 4); 2], "{text}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    let (meshes, warnings) = read_bytes(ascii("solid part", "\n")).expect("a solid");
    assert_eq!((meshes[0].0.as_str(), meshes.len(), warnings.is_empty()), ("solid part", 1, true));
}

/// The time of a text in one line, of 10,000 facets, is that of the same text in lines.
#[test]
fn one_line_takes_the_time_of_many() {
    let lines = ascii("a", "\n");
    let facets = &lines[b"solid a\n".len()..lines.len() - b"endsolid a\n".len()];
    let text = [b"solid a\n".as_slice(), &facets.repeat(2500), b"endsolid a\n"].concat();
    let one_line = text.iter().map(|&b| if b == b'\n' { b' ' } else { b }).collect();
    let [many, one] = [text, one_line].map(|text| {
        let start = std::time::Instant::now();
        assert_eq!(read_bytes(text).expect("a solid").0[0].1.triangles.len(), 10_000);
        start.elapsed()
    });
    assert!(one < 10 * many + std::time::Duration::from_millis(100), "{one:?}, in lines {many:?}");
}

/// A binary file whose header begins as text does, with a wrong count or bytes after the last triangle; and text
/// with control characters in its name.
#[test]
fn headers_that_begin_as_text() {
    for header in ["solid facet of steel", "solid facet normal", "SOLID a vertex endsolid"] {
        for (count, length) in [(3, 284), (4, 286), (0, 284), (9, 284), (9, 250)] {
            let mut bytes = binary(header.as_bytes(), count);
            bytes.resize(length, 0);
            let (meshes, warnings) = read_bytes(bytes).expect("some triangles");
            let expected = if count == 3 || length == 250 { 3 } else { 4 };
            assert_eq!(meshes[0].1.triangles.len(), expected, "{header}, {count}: {warnings:?}");
            assert_eq!(warnings.messages().len(), 1, "{warnings:?}");
        }
    }
    let (meshes, warnings) = read_bytes(ascii("a \u{1}\u{1b}[0m", "\n")).expect("a solid");
    assert_eq!((meshes[0].1.triangles.len(), warnings.is_empty()), (4, true));
}

/// Four facets with the given attribute bytes.
fn coloured(header: &[u8], words: [u16; 4]) -> (Mesh, Phong) {
    let mut bytes = binary(header, 4);
    for (facet, word) in words.into_iter().enumerate() {
        let end = HEAD + FACET * (facet + 1);
        bytes[end - 2..end].copy_from_slice(&word.to_le_bytes());
    }
    let source = Source::of("a.stl", bytes);
    let mut scene = read(&source, &mut Warnings::default()).expect("a whole file");
    let Some(Shape::Mesh(mesh)) = scene.objects.pop().map(|object| object.shape) else { panic!("a mesh") };
    let Some(crate::scene::Material::Phong(material)) = scene.materials.pop() else { panic!("a material") };
    (mesh, material)
}

fn facets(mesh: &Mesh) -> Vec<DVec3> {
    let colours = mesh.colours.as_ref().expect("colours");
    let triangles = colours.triangles.as_ref().expect("colours of facets");
    triangles.iter().map(|t| colours.values[t[0] as usize]).collect()
}

#[test]
fn colours_of_both_dialects() {
    let grey = Phong::default().colour.to_pipeline(crate::film::ColourPipeline::Linear);
    // VisCAM: bit 15 marks a colour, blue lowest.
    let (mesh, material) = coloured(b"", [0x8000 | 31, 0x8000 | 31 << 5, 0x8000 | 31 << 10, 31]);
    assert_eq!(facets(&mesh), [DVec3::Z, DVec3::Y, DVec3::X, grey]);
    assert_eq!(material.colour, crate::film::Colour::Display(DVec3::ONE));
    // Magics: bit 15 selects the colour of the part, red lowest.
    let (mesh, material) = coloured(b"by hand COLOR=\xff\0\xff\x33", [31, 31 << 5, 31 << 10, 0x8000]);
    assert_eq!(facets(&mesh), [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 0.0, 1.0)]);
    // 0x33 = 51 = 0.2 * 255.
    assert_eq!(material.opacity.map(|opacity| opacity.factor), Some(0.2));
    // Only a part colour; of a material, the diffuse colour.
    let (mesh, material) = coloured(b"COLOR=\xff\0\0\xff", [0x8000; 4]);
    assert_eq!((mesh.colours, material.opacity), (None, None));
    assert_eq!(material.colour, crate::film::Colour::from_u8([255, 0, 0]));
    let header = b"COLOR=\xff\0\0\xff,MATERIAL=\0\0\xff\xff\x01\x02\x03\xff\x01\x02\x03\xff";
    assert_eq!(coloured(header, [0x8000; 4]).1.colour, crate::film::Colour::from_u8([0, 0, 255]));
    // Attribute bytes that are 0 throughout are not used; among others, 0 is black.
    let (mesh, material) = coloured(b"COLOR=\xff\0\0\xff", [0; 4]);
    assert_eq!((mesh.colours, material.colour), (None, crate::film::Colour::from_u8([255, 0, 0])));
    assert_eq!(facets(&coloured(b"COLOR=\xff\0\0\xff", [0, 0, 31, 0]).0)[1], DVec3::ZERO);
    assert_eq!(facets(&coloured(b"COLOR=\xff\0\0\xff", [0, 0, 0x8000, 0]).0)[1], DVec3::ZERO);
    assert_eq!(facets(&coloured(b"", [0x8000; 4]).0)[1], DVec3::ZERO);
    // A separator in the place of alpha.
    assert_eq!(
        coloured(b"COLOR=\x7f\x7f\x7f MATERIAL=\x7f\x7f\x7f \x7f\x7f\x7f \x7f\x7f\x7f ", [0x8000; 4])
            .1
            .opacity,
        None
    );
    // Neither convention.
    assert_eq!(coloured(b"", [0, 31, 0x7fff, 7]).0.colours, None);
}
