//! OFF (Geomview manual, "OFF Files"): text or binary, with `N` (normals), `C` (colours) and `ST` (texture coordinates)
//! of vertices, and colours of faces. Colours are display values: of 0 to 255, or of 0 to 1 where none is larger. As in
//! OBJ files, v points up in the image.
//!
//! Text is read by lines, since the number of colour values of a face is that of the words left on its line; a file
//! that is not whole by lines is read by words. No crate is used: those on crates.io (off-rs 1.0, meshio-rs) read
//! neither colours of faces nor comments, and have no line numbers.

use glam::{DVec2, DVec3};

use super::Source;
use super::colours::Colours;
use super::lines::{take_word, without_mark};
use super::polygon::Polygons;
use super::values::{Encoding, Read, ReadError, Scalar, Values};
use crate::error::{Result, Warnings};
use crate::film::ColourPipeline;
use crate::film::colour::srgb_encode;
use crate::scene::{Attribute, Mesh, Phong, Scene};

/// Whether the first word of a text is that of OFF files, of any dimension, also with a number right after it.
pub(super) fn is_start(mut text: &[u8]) -> bool {
    let word = take_word(&mut text).unwrap_or_default().to_ascii_uppercase();
    let Some(at) = word.windows(3).position(|letters| letters == b"OFF") else { return false };
    let is_whole = !word.get(at + 3).is_some_and(u8::is_ascii_alphabetic);
    is_whole && word[..at].iter().all(|letter| b"STCN4".contains(letter))
}

/// Reads an OFF file as one mesh.
pub(super) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let mut by_words = warnings.clone();
    let mut mesh = read_mesh(source, false, warnings);
    if !mesh.as_ref().is_ok_and(|(_, is_whole)| *is_whole)
        && let Ok((whole, true)) = read_mesh(source, true, &mut by_words)
    {
        (mesh, *warnings) = (Ok((whole, true)), by_words);
    }
    Ok(source.scene_of(vec![(None, mesh?.0)]))
}

/// The part of a line before a comment, without white space around it.
fn without_comment(line: &[u8]) -> &[u8] {
    let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
    line[..end].trim_ascii()
}

/// Reads the mesh of a file. Returns whether the file is whole, too.
fn read_mesh(source: &Source, is_by_words: bool, warnings: &mut Warnings) -> Result<(Mesh, bool)> {
    let text = without_mark(&source.bytes);
    let mut values = Values::of_text(source, text, 0, is_by_words, without_comment);
    let header = Header::read(&mut values)?;
    let mut mesh = Mesh::default();
    let mut too_long = 0;
    let vertices = read_vertices(&mut values, &header, &mut mesh, &mut too_long, warnings)?;
    if values.is_by_words && values.encoding == Encoding::Ascii && !values.rest.is_empty() {
        return Err(values.fault("a face on the line of a vertex"));
    }
    let mut faces = 0;
    if vertices == header.vertices {
        faces = read_faces(&mut values, &header, &mut mesh, warnings)?;
    }
    let file = source.file.display();
    for (name, there, declared) in [("vertices", vertices, header.vertices), ("faces", faces, header.faces)] {
        if there < declared {
            let what = format!("ends after {there} of {declared} {name}; the complete elements are drawn");
            warnings.left_out(format!("{file}: {what}"));
            break;
        }
    }
    if too_long > 0 {
        let what = "vertices have surplus values, which are left out";
        warnings.left_out(format!("{file}: {too_long} {what}"));
    }
    if mesh.triangles.is_empty() && vertices > 0 {
        warnings.left_out(format!("{file}: {vertices} vertices without faces; points are not drawn"));
    }
    let is_whole = (vertices, faces) == (header.vertices, header.faces);
    let is_read = if values.is_by_lines() { !header.has_values } else { values.next_line().is_err() };
    Ok((mesh, is_whole && is_read))
}

/// The words of the next line; `None` at the end of the file.
fn next_words<'a>(values: &mut Values<'a>) -> Option<Vec<&'a [u8]>> {
    values.next_line().ok()?;
    let mut row = values.rest;
    Some(std::iter::from_fn(|| take_word(&mut row)).collect())
}

/// Reads the values of the next vertex, `count` of them if lines do not say how many.
fn read_vertex(values: &mut Values, count: u64, numbers: &mut Vec<f64>) -> Read<()> {
    numbers.clear();
    if !values.is_by_lines() {
        return values.take(count, Scalar::F32, numbers);
    }
    values.next_line()?;
    values.rest_of_line(numbers)
}

/// Reads the values of the next face: the number of its vertices, these, and its colour.
fn read_face(values: &mut Values, numbers: &mut Vec<f64>) -> Read<()> {
    if values.is_by_lines() {
        return read_vertex(values, 0, numbers);
    }
    numbers.clear();
    values.take(1, Scalar::I32, numbers)?;
    values.take(numbers[0] as u64, Scalar::I32, numbers)?;
    if values.encoding == Encoding::Ascii {
        return values.rest_of_line(numbers);
    }
    let colours = values.next(Scalar::I32)?;
    values.take(colours as u64, Scalar::F32, numbers)
}

/// Attributes of vertices, and numbers of vertices and faces.
struct Header {
    has_normals: bool,
    has_colours: bool,
    has_uvs: bool,
    vertices: u64,
    faces: u64,
    /// Whether values follow on the line of the counts.
    has_values: bool,
}

impl Header {
    fn read(values: &mut Values) -> Result<Self> {
        const BEGINNING: &str = "an OFF file begins with `OFF`, or with ST, C or N before it";
        let words = next_words(values).ok_or_else(|| values.fault(BEGINNING))?;
        let (word, after) = words.split_first().ok_or_else(|| values.fault(BEGINNING))?;
        let word = word.to_ascii_uppercase();
        // Files of ModelNet have the first count right behind the word.
        let letters = word.iter().position(u8::is_ascii_digit).filter(|&at| at > 1).unwrap_or(word.len());
        let (kind, glued) = word.split_at(letters);
        let mut kind = kind.strip_suffix(b"OFF").ok_or_else(|| values.fault(BEGINNING))?;
        let (mut has_normals, mut has_colours, mut has_uvs) = (false, false, false);
        while let Some(&first) = kind.first() {
            let (flag, length) = match first {
                b'N' => (&mut has_normals, 1),
                b'C' => (&mut has_colours, 1),
                b'S' if kind.starts_with(b"ST") => (&mut has_uvs, 2),
                _ => return Err(values.fault("not three-dimensional")),
            };
            *flag = true;
            kind = &kind[length..];
        }
        const ENDS: &str = "ends before the numbers of vertices and faces";
        const NO_COUNTS: &str = "no numbers of vertices and faces after `OFF`";
        if after.first().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
            *values = values.clone().into_binary(Encoding::BigEndian);
            let mut counts = Vec::new();
            let is_there = values.take(3, Scalar::I32, &mut counts).is_ok();
            if !is_there || counts.iter().any(|&count| count < 0.0) {
                return Err(values.fault(NO_COUNTS));
            }
            let (vertices, faces) = (counts[0] as u64, counts[1] as u64);
            return Ok(Header { has_normals, has_colours, has_uvs, vertices, faces, has_values: false });
        }
        let mut counts: Vec<&[u8]> = Some(glued).filter(|word| !word.is_empty()).into_iter().collect();
        counts.extend(after);
        let mut on_row = words.len();
        while counts.len() < 2 {
            let missing = if counts.is_empty() { ENDS } else { NO_COUNTS };
            let row = next_words(values).ok_or_else(|| values.fault(missing))?;
            on_row = row.len();
            counts.extend(row);
        }
        // The number of edges, where each number has a line.
        let mut ahead = values.clone();
        if counts.len() == 2 && on_row == 1 && next_words(&mut ahead).is_some_and(|row| row.len() == 1) {
            *values = ahead;
        }
        // Values behind the three numbers, in files of words.
        let behind = counts.len().saturating_sub(3);
        (0..on_row.saturating_sub(behind)).for_each(|_| _ = take_word(&mut values.rest));
        let count = |index: usize| std::str::from_utf8(counts[index]).ok()?.parse().ok();
        let (Some(vertices), Some(faces)) = (count(0), count(1)) else {
            return Err(values.fault(NO_COUNTS));
        };
        Ok(Header { has_normals, has_colours, has_uvs, vertices, faces, has_values: behind > 0 })
    }
}

/// Sets colours. Whole numbers above 1 are on the scale of 0 to 255 of the format. NaN becomes the default grey, in alpha
/// opaque.
fn set_colours(mut colours: Colours, mesh: &mut Mesh, source: &Source, warnings: &mut Warnings) {
    for channels in [0..3, 3..4] {
        let (largest, are_whole) = colours.range(channels.clone());
        if largest > 1.0 && are_whole {
            colours.white[channels].fill(255.0);
        }
    }
    colours.rescale(&source.file, warnings);
    let grey = Phong::default().colour.to_pipeline(ColourPipeline::Linear).to_array().map(srgb_encode);
    let default = [grey[0], grey[1], grey[2], 1.0];
    for value in &mut colours.values {
        for channel in 0..4 {
            if value[channel].is_nan() {
                value[channel] = default[channel] * colours.white[channel];
            }
        }
    }
    colours.set(mesh, &source.file, warnings);
}

/// Colour of three or four values; without alpha, alpha is NaN.
fn colour(values: &[f64]) -> Option<[f64; 4]> {
    match *values {
        [r, g, b] => Some([r, g, b, f64::NAN]),
        [r, g, b, a] => Some([r, g, b, a]),
        _ => None,
    }
}

/// Whether the values at the ends of the lines of `count` vertices, those that are three or four, are colours without
/// `C` on the first line: at all vertices, of the same number, and none of them negative, unlike normals.
fn are_unnamed(values: &[[f64; 4]], count: usize) -> bool {
    let is_colour = |value: &f64| value.is_nan() || (0.0..=255.0).contains(value);
    let has_alpha = |colour: &[f64; 4]| !colour[3].is_nan();
    !values.is_empty()
        && values.len() == count
        && values
            .iter()
            .all(|colour| colour.iter().all(is_colour) && has_alpha(colour) == has_alpha(&values[0]))
}

/// Reads the vertices; returns their number.
fn read_vertices(
    values: &mut Values,
    header: &Header,
    mesh: &mut Mesh,
    too_long: &mut usize,
    warnings: &mut Warnings,
) -> Result<u64> {
    let Header { has_normals, has_colours, has_uvs, vertices, .. } = *header;
    let bytes = 2 * size_of::<DVec3>() + size_of::<[f64; 6]>();
    mesh.positions.reserve(values.capacity(vertices, 6, bytes, values.line())?);
    let (mut normals, mut colours, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    let least = 3 + if has_normals { 3 } else { 0 } + if has_uvs { 2 } else { 0 };
    let mut numbers = Vec::new();
    // Where lines do not say how many values a colour has, it has four (Geomview).
    let count = least as u64 + if has_colours { 4 } else { 0 };
    let there = values.each(vertices, |values| {
        read_vertex(values, count, &mut numbers)?;
        if numbers.len() < least {
            if values.is_last_line() {
                return Err(ReadError::End);
            }
            return Err(values.fault(format!("a vertex of {} values, not {least}", numbers.len())).into());
        }
        mesh.positions.push(DVec3::from_slice(&numbers));
        let mut rest = &numbers[3..];
        if has_normals {
            normals.push(DVec3::from_slice(rest));
            rest = &rest[3..];
        }
        if has_uvs {
            let (before, uv) = rest.split_at(rest.len() - 2);
            uvs.push(DVec2::new(uv[0], 1.0 - uv[1]));
            rest = before;
        }
        if has_colours {
            colours.push(colour(rest).unwrap_or([f64::NAN; 4]));
        } else if !rest.is_empty() {
            *too_long += 1;
            colours.extend(colour(rest));
        }
        Ok(())
    })?;
    let has_colours = has_colours || are_unnamed(&colours, mesh.positions.len());
    if has_colours && *too_long > 0 {
        *too_long = 0;
        let file = values.source.file.display();
        warnings.note(format!("{file}: vertices have colours, which the first line does not name"));
    }
    mesh.normals = has_normals.then(|| Attribute::per_position(normals));
    mesh.uvs.extend(has_uvs.then(|| Attribute::per_position(uvs)));
    if has_colours {
        let colours = Colours { values: colours, white: [1.0; 4], triangles: None };
        set_colours(colours, mesh, values.source, warnings);
    }
    Ok(there)
}

/// Reads the faces; returns their number.
fn read_faces(values: &mut Values, header: &Header, mesh: &mut Mesh, warnings: &mut Warnings) -> Result<u64> {
    let bytes = size_of::<[u32; 3]>() + size_of::<[f64; 5]>();
    mesh.triangles.reserve(values.capacity(header.faces, 2, bytes, values.line())?);
    let (mut polygons, mut colours) = (Polygons::default(), Colours::of_faces([1.0; 4]));
    let (mut numbers, mut polygon, mut has_colours) = (Vec::new(), Vec::new(), false);
    let there = values.each(header.faces, |values| {
        read_face(values, &mut numbers)?;
        let length = numbers[0];
        if !(length >= 0.0 && length.fract() == 0.0) {
            return Err(values.fault("a face begins with the number of its vertices").into());
        }
        let rest = &numbers[1..];
        if length > rest.len() as f64 {
            if values.is_last_line() {
                return Err(ReadError::End);
            }
            let what = format!("a face of {length} vertices with {} values", rest.len());
            return Err(values.fault(what).into());
        }
        let (indices, rest) = rest.split_at(length as usize);
        polygon.clear();
        for &index in indices {
            polygon.push(values.index(index, mesh.positions.len(), "")?);
        }
        let made = polygons.add(mesh, &polygon, |_| ());
        let colour = colour(rest);
        has_colours |= colour.is_some();
        colours.push_face(colour.unwrap_or([f64::NAN; 4]), made);
        Ok(())
    })?;
    polygons.warn(&values.source.file, warnings);
    if has_colours && mesh.colours.is_some() {
        let what = "colours of faces beside those of vertices are left out";
        warnings.left_out(format!("{}: {what}", values.source.file.display()));
    } else if has_colours {
        set_colours(colours, mesh, values.source, warnings);
    }
    Ok(there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::dependencies::Files;
    use crate::scene::{Object, Shape};

    fn read_text(text: &str) -> Result<(Mesh, Warnings)> {
        read_whole(text.as_bytes().to_vec())
    }

    fn read_whole(bytes: Vec<u8>) -> Result<(Mesh, Warnings)> {
        let mut warnings = Warnings::default();
        let source =
            Source { file: "a.off".into(), bytes, files: Files::default(), options: Default::default() };
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
            let (mesh, warnings) =
                read_text(&format!("{head}{SQUARE}4 0 1 2 3 # the face\n")).expect("a square");
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
            let [first, second, ..] = mesh.colours.expect("colours").values[..] else {
                panic!("two colours")
            };
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
        let rows: String =
            SQUARE.lines().map(|row| format!("{row}\n0 0 1\n51 0 255 255\n0.5 0.25\n")).collect();
        let (mesh, warnings) = read_text(&format!("STCNOFF\n4 1 0\n{rows}4 0 1 2 3\n")).expect("a square");
        let lines = rows.replace('\n', " ").replace(" 0.25 ", " 0.25\n");
        assert_eq!(mesh, read_text(&format!("STCNOFF\n4 1 0\n{lines}4 0 1 2 3\n")).expect("a square").0);
        assert_eq!(mesh.normals.expect("normals").values, [DVec3::Z; 4]);
        assert!(warnings.is_empty(), "{warnings:?}");
        // A value too few, or words that end within a face: the fault by lines.
        let few =
            read_text("OFF\n4 1 0\n0 0 0\n1 0\n1 1 0\n0 1 0\n4 0 1 2 3\n").map(drop).expect_err("a fault");
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
        for ends in
            [["0 0 1", "0 0 1", "0 0 1", "0 0 -1"], ["1 2 3", "1 2 3 4", "1 2 3", "1 2 3"], ["1 2"; 4]]
        {
            let (mesh, warnings) = of("OFF", ends);
            assert!(
                mesh.colours.is_none() && warnings.messages()[0].contains("surplus values"),
                "{warnings:?}"
            );
        }
    }

    /// The binary form: big-endian counts and indices of 32 bits, and a count before the colour of a face.
    #[test]
    fn binary_files_are_the_same_as_text() {
        let ints = |values: &[i32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
        let floats =
            |values: &[f32]| values.iter().flat_map(|value| value.to_be_bytes()).collect::<Vec<u8>>();
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let faces = [ints(&[3, 0, 1, 2, 3]), floats(&[1.0, 0.0, 0.5]), ints(&[3, 0, 2, 3, 0])].concat();
        let text = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 1 0 0.5\n3 0 2 3\n";
        let whole = [b"OFF BINARY\n", &*ints(&[4, 2, 0]), &floats(corners.as_flattened()), &faces].concat();
        let (mesh, warnings) = read_whole(whole.clone()).expect("a square");
        assert_eq!(mesh, read_text(text).expect("a square").0);
        assert!(warnings.is_empty(), "{warnings:?}");
        let vertex =
            |corner: &[f32; 3]| floats(&[corner, &[0.0, 0.0, 1.0][..], &[1.0, 0.0, 0.5, 1.0]].concat());
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
}
