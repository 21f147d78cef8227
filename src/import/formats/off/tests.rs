//! Tests of `off`.

use crate::import::formats::off::*;
use crate::scene::{Object, Shape};

fn read_text(text: &str) -> Result<(Mesh, Warnings)> {
    read_whole(text.as_bytes().to_vec())
}

fn read_whole(bytes: Vec<u8>) -> Result<(Mesh, Warnings)> {
    let mut warnings = Warnings::default();
    let source = Source::of("a.off", bytes);
    let mut scene = read(&source, &mut warnings)?;
    let Some(Object { shape: Shape::Mesh(mesh), .. }) = scene.objects.pop() else { panic!("one mesh") };
    Ok((mesh, warnings))
}

const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn headers_of_all_exporters() {
    for head in [
        "OFF\n4 1 0\n",
        "OFF 4 1 4\n",
        "off\n# by hand\n\n4 1\n",
        "OFF4 1 0\n",
        "\u{feff}OFF # x\r\n4 1 0\r\n",
    ] {
        let (mesh, warnings) = read_text(&format!("{head}{SQUARE}4 0 1 2 3 # the face\n")).expect("a square");
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{head}");
        assert!(mesh.colours.is_none() && warnings.is_empty(), "{head}: {warnings:?}");
    }
}

/// 0.2 as a display value is ((0.2 + 0.055) / 1.055)^2.4 in linear light; 51 is 0.2 of 255.
#[test]
fn colours_of_vertices_and_faces() {
    let linear = (0.255f64 / 1.055).powf(2.4);
    for value in ["51 0 255", "0.2 0 1", "51 0 255 255", "0.2 0.0 1.0 1.0"] {
        let (mesh, warnings) =
            read_text(&format!("OFF\n4 1 0\n{SQUARE}4 0 1 2 3 {value}\n")).expect("a square");
        let colours = mesh.colours.expect("colours");
        assert!((colours.values[0] - DVec3::new(linear, 0.0, 1.0)).length() < 1e-15, "{value}");
        assert_eq!(colours.triangles, Some(vec![[0; 3]; 2]));
        assert!(mesh.alphas.is_none() && warnings.is_empty(), "{warnings:?}");
        let rows: String = SQUARE.lines().map(|row| format!("{row} 0 0 1 {value} 0.5 0.25\n")).collect();
        let (mesh, _) = read_text(&format!("STCNOFF\n4 1 0\n{rows}4 0 1 2 3\n")).expect("a square");
        let colours = mesh.colours.expect("colours");
        assert!((colours.values[3] - DVec3::new(linear, 0.0, 1.0)).length() < 1e-15, "{value}");
        assert_eq!(mesh.normals.expect("normals").values, [DVec3::Z; 4]);
        assert_eq!(mesh.uvs[0].values, [DVec2::new(0.5, 0.75); 4]);
    }
    let (mesh, _) =
        read_text(&format!("OFF\n4 2 0\n{SQUARE}3 0 1 2 255 0 0 51\n3 0 2 3\n")).expect("a square");
    assert_eq!(mesh.alphas.expect("opacities").values, [0.2, 1.0]);
}

/// Floating-point colours are of 0 to 1 up to 2, and of 0 to 255 beyond, with a note; whole numbers are of 0 to 255,
/// as the format says. Faces without a colour keep the default grey, 204 of 255 (0.8).
#[test]
fn scales_of_colours() {
    let linear = |x: f64| ((x + 0.055) / 1.055).powf(2.4);
    for (value, green, noted) in [
        ("1.001 0.5 0.2", 0.5, None),
        ("2 0.5 0.2", 0.5, None),
        ("2.5 127.5 0", 0.5, Some(127.5)),
        ("2 51 0", 0.2, None),
        ("inf 0.5 0.2", 0.5, None),
    ] {
        let (mesh, warnings) =
            read_text(&format!("OFF\n4 2 0\n{SQUARE}3 0 1 2 {value}\n3 0 2 3\n")).expect("a square");
        let [first, second, ..] = mesh.colours.expect("colours").values[..] else { panic!("two colours") };
        assert!((first.y - linear(green)).abs() < 1e-12, "{value}: {first}");
        assert!((second - linear(0.8)).length() < 1e-12, "{value}: {second}");
        let note = |most| format!("a.off: colours up to {most} are read on a scale of 0 to 255");
        assert_eq!(warnings.notes(), noted.map(note).as_slice(), "{value}");
    }
}

#[test]
fn what_is_there_of_a_short_file_is_read() {
    let (mesh, warnings) =
        read_text(&format!("OFF\n4 3 0\n{SQUARE}3 0 1 2\n3 0 2 3\n3 0")).expect("two faces");
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(warnings.messages(), ["a.off: ends after 2 of 3 faces; the complete elements are drawn"]);
}

/// Words wherever lines end: the same square as by lines, with the colour on the line of the last index.
#[test]
fn values_over_several_lines() {
    let (square, _) =
        read_text(&format!("OFF\n4 2 0\n{SQUARE}3 0 1 2 255 0 0\n3 0 2 3\n")).expect("a square");
    let each = "0 0 0 1 0 0 1 1 0 0 1 0".replace(' ', "\n");
    for text in [
        format!("OFF\n4 2 0\n{SQUARE}3\n0 1\n2 255 0 0\n3 0\n\n2 # the last is 3\n3\n"),
        "OFF\n4 2 0\n0 0\n0 1 0 0 1\n1 0 0 1 0\n3 0 1 2 255 0 0\n3 0 2\n3\n".to_owned(),
        "OFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0\n3 0 1 2 255 0 0\n3 0 2 3\n".to_owned(),
        format!("OFF\r\n4\r\n2\r\n0\r\n{each}\n3\n0\n1\n2 255 0 0\n3\n0\n2\n3"),
        "OFF\n4 2 0 0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3\n".to_owned(),
        "OFF 4 2 0 0 0 0 1 0 0 1 1 0 0 1 0\n3 0 1 2 255 0 0\n3 0 2 3\n".to_owned(),
    ] {
        let (mesh, warnings) = read_text(&text).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(mesh, square, "{text}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    // Normals, a colour of four values and texture coordinates, each on a line.
    let rows: String = SQUARE.lines().map(|row| format!("{row}\n0 0 1\n51 0 255 255\n0.5 0.25\n")).collect();
    let (mesh, warnings) = read_text(&format!("STCNOFF\n4 1 0\n{rows}4 0 1 2 3\n")).expect("a square");
    let lines = rows.replace('\n', " ").replace(" 0.25 ", " 0.25\n");
    assert_eq!(mesh, read_text(&format!("STCNOFF\n4 1 0\n{lines}4 0 1 2 3\n")).expect("a square").0);
    assert_eq!(mesh.normals.expect("normals").values, [DVec3::Z; 4]);
    assert!(warnings.is_empty(), "{warnings:?}");
    // A value too few, or words that end within a face: the fault by lines.
    let few = read_text("OFF\n4 1 0\n0 0 0\n1 0\n1 1 0\n0 1 0\n4 0 1 2 3\n").map(drop).expect_err("a fault");
    assert_eq!(few.to_string(), "a.off:4: a vertex of 2 values, not 3");
}

/// Colours behind positions or normals of an `OFF` or `NOFF` that names none are those of `COFF` and `CNOFF`; what
/// differs in number, or is negative as normals are, is left out as before.
#[test]
fn colours_that_the_first_line_does_not_name() {
    let of = |head: &str, ends: [&str; 4]| {
        let rows: String = SQUARE.lines().zip(ends).map(|(row, end)| format!("{row} {end}\n")).collect();
        read_text(&format!("{head}\n4 1 0\n{rows}4 0 1 2 3\n")).expect("a square")
    };
    for value in ["51 0 255", "51 0 255 102", "0.2 0 1", "0.2 0 1 0.4"] {
        for (head, before) in [("OFF", ""), ("NOFF", "0 0 1 ")] {
            let end = format!("{before}{value}");
            let ends = [end.as_str(); 4];
            let (mesh, warnings) = of(head, ends);
            assert_eq!(mesh, of(&format!("C{head}"), ends).0, "{head} {value}");
            assert!(mesh.colours.is_some() && warnings.is_empty(), "{warnings:?}");
            assert_eq!(
                warnings.notes(),
                ["a.off: vertices have colours, which the first line does not name"]
            );
        }
    }
    for ends in [["0 0 1", "0 0 1", "0 0 1", "0 0 -1"], ["1 2 3", "1 2 3 4", "1 2 3", "1 2 3"], ["1 2"; 4]] {
        let (mesh, warnings) = of("OFF", ends);
        assert!(mesh.colours.is_none() && warnings.messages()[0].contains("surplus values"), "{warnings:?}");
    }
}

/// The binary form: big-endian counts and indices of 32 bits, and a count before the colour of a face.
#[test]
fn binary_files_are_the_same_as_text() {
    let ints = |values: &[i32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let faces = [ints(&[3, 0, 1, 2, 3]), floats(&[1.0, 0.0, 0.5]), ints(&[3, 0, 2, 3, 0])].concat();
    let text = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 1 0 0.5\n3 0 2 3\n";
    let whole = [b"OFF BINARY\n", &*ints(&[4, 2, 0]), &floats(corners.as_flattened()), &faces].concat();
    let (mesh, warnings) = read_whole(whole.clone()).expect("a square");
    assert_eq!(mesh, read_text(text).expect("a square").0);
    assert!(warnings.is_empty(), "{warnings:?}");
    let vertex = |corner: &[f32; 3]| floats(&[corner, &[0.0, 0.0, 1.0][..], &[1.0, 0.0, 0.5, 1.0]].concat());
    let vertices: Vec<u8> = corners.iter().flat_map(vertex).collect();
    let of_vertices =
        [b"CNOFF binary\r\n", &*ints(&[4, 1, 0]), &vertices, &ints(&[4, 0, 1, 2, 3, 0])].concat();
    let rows: String = SQUARE.lines().map(|row| format!("{row} 0 0 1 1 0 0.5 1\n")).collect();
    let (mesh, _) = read_whole(of_vertices).expect("a square");
    assert_eq!(mesh, read_text(&format!("CNOFF\n4 1 0\n{rows}4 0 1 2 3\n")).expect("a square").0);
    // Cut anywhere after the counts it is read as far as it goes.
    for length in 23..whole.len() {
        let (mesh, warnings) = read_whole(whole[..length].to_vec()).expect("what is there");
        assert!(mesh.triangles.len() < 2 && warnings.messages()[0].contains("ends after"), "{length}");
    }
    let mut wrong = whole;
    let index = wrong.len() - 5;
    wrong[index] = 9;
    let e = read_whole(wrong).map(drop).expect_err("no such vertex").to_string();
    assert_eq!(e, "a.off: byte 123: vertex 9 does not exist; there are 4, counted from 0");
}

/// Little-endian files have no number of colours behind a face. Their counts in the other order, 4 << 24 vertices, do not
/// fit the file.
#[test]
fn little_endian_files_of_the_pmp_library_are_read() {
    let ints = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    let corners: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
    let faces = ints(&[4, 0, 1, 2, 3, 3, 0, 2, 3]);
    let (mesh, warnings) =
        read_whole([b"OFF BINARY\n", &*ints(&[4, 2, 0]), &corners, &faces].concat()).expect("a square");
    assert_eq!(mesh, read_text(&format!("OFF\n4 2 0\n{SQUARE}4 0 1 2 3\n3 0 2 3\n")).expect("a square").0);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn faults_have_their_line() {
    let text = |text: &str| read_text(text).map(drop).expect_err("it is broken").to_string();
    assert!(text("OFX\n").starts_with("a.off:1: an OFF file begins with `OFF`"));
    assert_eq!(text("4OFF\n1 1 1\n"), "a.off:1: not three-dimensional");
    let cut = text("OFF BINARY\n\0\0");
    assert_eq!(cut, "a.off: byte 11: no numbers of vertices and faces after `OFF`");
    assert_eq!(text("OFF\nx\n"), "a.off:2: no numbers of vertices and faces after `OFF`");
    let text_of = |face: &str| text(&format!("OFF\n4 2 0\n{SQUARE}{face}\n3 0 1 2\n"));
    assert_eq!(text_of("3 0 1 4"), "a.off:7: vertex 4 does not exist; there are 4, counted from 0");
    assert_eq!(text_of("3 0 1"), "a.off:7: a face of 3 vertices with 2 values");
    assert_eq!(text_of("3 0 1 x"), "a.off:7: not a number");
    assert_eq!(text_of("-1 0"), "a.off:7: a face begins with the number of its vertices");
}
