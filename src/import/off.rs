//! OFF (Geomview manual, "OFF Files"): text, with `N` (normals), `C` (colours) and `ST` (texture coordinates) of
//! vertices, and colours of faces. Colours are display values from 0 to 255, or from 0 to 1 if none is larger. As in
//! OBJ files, v points up in the image.
//!
//! Parsed line by line: a face has as many colour values as words are left on its line. No crate is used: those on
//! crates.io (off-rs 1.0, meshio-rs) support neither face colours nor comments nor line numbers in errors.

use glam::{DVec2, DVec3};

use super::Source;
use super::colours::Colours;
use super::lines::{Lines, parse_number, take_word, without_mark};
use super::polygon::{Cuts, Triangulator};
use crate::error::{Error, Place, Result, Warnings};
use crate::film::ColourPipeline;
use crate::film::colour::srgb_encode;
use crate::limits;
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
    let mut rows = Rows::new(source);
    let header = Header::read(&mut rows)?;
    let mut mesh = Mesh::default();
    let mut too_long = 0;
    read_vertices(&mut rows, &header, &mut mesh, &mut too_long, warnings)?;
    let mut faces = 0;
    if mesh.positions.len() as u64 == header.vertices {
        faces = read_faces(&mut rows, &header, &mut mesh, warnings)?;
    }
    let file = source.file.display();
    for (name, there, declared) in
        [("vertices", mesh.positions.len() as u64, header.vertices), ("faces", faces, header.faces)]
    {
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
    if mesh.triangles.is_empty() && !mesh.positions.is_empty() {
        let points = mesh.positions.len();
        warnings.left_out(format!("{file}: {points} vertices without faces; points are not drawn"));
    }
    Ok(source.scene_of(vec![(None, mesh)]))
}

/// Non-empty lines without comments.
struct Rows<'a> {
    source: &'a Source,
    lines: Lines<'a>,
    line: usize,
}

impl<'a> Rows<'a> {
    fn new(source: &'a Source) -> Self {
        Rows { source, lines: Lines::new(without_mark(&source.bytes), 0), line: 1 }
    }

    fn fault(&self, what: impl Into<String>) -> Error {
        Error::input(
            Place::line(&self.source.file, self.line),
            what,
            "correct the line, or export the file again",
        )
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            let (number, line) = self.lines.next()?;
            self.line = number;
            let comment = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
            let row = line[..comment].trim_ascii();
            if !row.is_empty() {
                return Some(row);
            }
        }
    }

    /// Reads the numbers of the next line into `values`. Returns `false` at the end of the file.
    fn numbers(&mut self, values: &mut Vec<f64>) -> Result<bool> {
        values.clear();
        let Some(mut row) = self.next() else { return Ok(false) };
        while let Some(word) = take_word(&mut row) {
            values.push(parse_number(word).ok_or_else(|| self.fault("not a number"))?);
        }
        Ok(true)
    }

    /// Whether this is the last line, which may be truncated.
    fn is_last(&self) -> bool {
        self.lines.rest().trim_ascii().is_empty()
    }

    /// Number of elements to reserve: `count`, or what the rest of the file can hold at `least` bytes per element if
    /// that is less. Checks the memory limit for `bytes` per element.
    fn capacity(&self, count: u64, least: u64, bytes: usize) -> Result<usize> {
        let count = count.min((self.lines.rest().len() as u64 + 1) / least);
        limits::check(limits::product(&[count, bytes as u64])).map_err(|excess| {
            let what = format!("{count} elements: reading them {excess}");
            Error::input(Place::line(&self.source.file, self.line), what, excess.hint())
        })?;
        Ok(count as usize)
    }
}

/// Attributes of vertices, and numbers of vertices and faces.
struct Header {
    has_normals: bool,
    has_colours: bool,
    has_uvs: bool,
    vertices: u64,
    faces: u64,
}

impl Header {
    fn read(rows: &mut Rows) -> Result<Self> {
        const BEGINNING: &str = "an OFF file begins with `OFF`, or with ST, C or N before it";
        let mut row = rows.next().ok_or_else(|| rows.fault(BEGINNING))?;
        let word = take_word(&mut row).unwrap_or_default().to_ascii_uppercase();
        // ModelNet files have the first number directly after the keyword.
        let letters = word.iter().position(u8::is_ascii_digit).filter(|&at| at > 1).unwrap_or(word.len());
        let (kind, glued) = word.split_at(letters);
        let mut kind = kind.strip_suffix(b"OFF").ok_or_else(|| rows.fault(BEGINNING))?;
        let (mut has_normals, mut has_colours, mut has_uvs) = (false, false, false);
        while let Some(&first) = kind.first() {
            let (flag, length) = match first {
                b'N' => (&mut has_normals, 1),
                b'C' => (&mut has_colours, 1),
                b'S' if kind.starts_with(b"ST") => (&mut has_uvs, 2),
                _ => return Err(rows.fault("not three-dimensional")),
            };
            *flag = true;
            kind = &kind[length..];
        }
        let mut counts: Vec<Vec<u8>> =
            Some(glued).filter(|word| !word.is_empty()).map(<[u8]>::to_vec).into_iter().collect();
        while let Some(word) = take_word(&mut row) {
            counts.push(word.to_vec());
        }
        if counts.first().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
            return Err(rows.fault("binary OFF is not read; export it as text"));
        }
        if counts.len() < 2 {
            let mut row =
                rows.next().ok_or_else(|| rows.fault("ends before the numbers of vertices and faces"))?;
            while let Some(word) = take_word(&mut row) {
                counts.push(word.to_vec());
            }
        }
        let count = |index: usize| {
            let word = counts.get(index).and_then(|word| std::str::from_utf8(word).ok());
            word.and_then(|word| word.parse().ok())
        };
        let (Some(vertices), Some(faces)) = (count(0), count(1)) else {
            return Err(rows.fault("no numbers of vertices and faces after `OFF`"));
        };
        Ok(Header { has_normals, has_colours, has_uvs, vertices, faces })
    }
}

/// Decodes colours. Whole numbers above 1 are on the scale of 0 to 255 of the format. NaN becomes the default grey, in
/// alpha opaque.
fn decoded(
    values: Vec<[f64; 4]>,
    source: &Source,
    warnings: &mut Warnings,
) -> (Vec<DVec3>, Option<Vec<f64>>) {
    let mut colours = Colours { values, white: [1.0; 4] };
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
    colours.decoded(&source.file, warnings)
}

/// Colour of three or four values; without alpha, alpha is NaN.
fn colour(values: &[f64]) -> Option<[f64; 4]> {
    match *values {
        [r, g, b] => Some([r, g, b, f64::NAN]),
        [r, g, b, a] => Some([r, g, b, a]),
        _ => None,
    }
}

fn read_vertices(
    rows: &mut Rows,
    header: &Header,
    mesh: &mut Mesh,
    too_long: &mut usize,
    warnings: &mut Warnings,
) -> Result<()> {
    let Header { has_normals, has_colours, has_uvs, vertices, .. } = *header;
    let capacity = rows.capacity(vertices, 6, 2 * size_of::<DVec3>() + size_of::<[f64; 6]>())?;
    mesh.positions.reserve(capacity);
    let (mut normals, mut colours, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    let least = 3 + if has_normals { 3 } else { 0 } + if has_uvs { 2 } else { 0 };
    let mut values = Vec::new();
    for _ in 0..vertices {
        if !rows.numbers(&mut values)? {
            break;
        }
        if values.len() < least {
            if rows.is_last() {
                break;
            }
            return Err(rows.fault(format!("a vertex of {} values, not {least}", values.len())));
        }
        mesh.positions.push(DVec3::from_slice(&values));
        let mut rest = &values[3..];
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
        } else {
            *too_long += usize::from(!rest.is_empty());
        }
    }
    mesh.normals = has_normals.then(|| Attribute::per_position(normals));
    mesh.uvs.extend(has_uvs.then(|| Attribute::per_position(uvs)));
    if has_colours {
        let (colours, alphas) = decoded(colours, rows.source, warnings);
        mesh.colours = Some(Attribute::per_position(colours));
        mesh.alphas = alphas.map(Attribute::per_position);
    }
    Ok(())
}

/// Reads the faces; returns their number.
fn read_faces(rows: &mut Rows, header: &Header, mesh: &mut Mesh, warnings: &mut Warnings) -> Result<u64> {
    let capacity = rows.capacity(header.faces, 2, size_of::<[u32; 3]>() + size_of::<[f64; 5]>())?;
    mesh.triangles.reserve(capacity);
    let (mut cuts, mut too_small) = (Cuts::default(), 0);
    let (mut colours, mut face_of, mut has_colours) = (Vec::new(), Vec::new(), false);
    let mut triangulator = Triangulator::new();
    let (mut values, mut polygon, mut corners) = (Vec::new(), Vec::new(), Vec::new());
    let count = mesh.positions.len();
    let mut there = 0;
    while there < header.faces && rows.numbers(&mut values)? {
        let length = values[0];
        if !(length >= 0.0 && length.fract() == 0.0) {
            return Err(rows.fault("a face begins with the number of its vertices"));
        }
        if length > (values.len() - 1) as f64 {
            if rows.is_last() {
                break;
            }
            let what = format!("a face of {length} vertices with {} values", values.len() - 1);
            return Err(rows.fault(what));
        }
        let (indices, rest) = values[1..].split_at(length as usize);
        polygon.clear();
        corners.clear();
        for &index in indices {
            if !(index >= 0.0 && index < count as f64 && index.fract() == 0.0 && index <= f64::from(u32::MAX))
            {
                let what = format!("vertex {index} does not exist; there are {count}, counted from 0");
                return Err(rows.fault(what));
            }
            polygon.push(index as u32);
            corners.push(mesh.positions[index as usize]);
        }
        too_small += usize::from(corners.len() < 3);
        let before = mesh.triangles.len();
        let triangles = &mut mesh.triangles;
        cuts.count(triangulator.triangulate(&corners, |t| triangles.push(t.map(|i| polygon[i]))));
        let colour = colour(rest);
        has_colours |= colour.is_some();
        face_of.extend(std::iter::repeat_n([colours.len() as u32; 3], mesh.triangles.len() - before));
        colours.push(colour.unwrap_or([f64::NAN; 4]));
        there += 1;
    }
    let file = rows.source.file.display();
    if too_small > 0 {
        warnings.left_out(format!("{file}: left out {too_small} face(s) of fewer than three corners"));
    }
    cuts.warn(&rows.source.file, warnings);
    if has_colours && mesh.colours.is_some() {
        let what = "colours of faces beside those of vertices are left out";
        warnings.left_out(format!("{file}: {what}"));
    } else if has_colours {
        let (values, alphas) = decoded(colours, rows.source, warnings);
        mesh.alphas = alphas.map(|values| Attribute { values, triangles: Some(face_of.clone()) });
        mesh.colours = Some(Attribute { values, triangles: Some(face_of) });
    }
    Ok(there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::dependencies::Files;
    use crate::scene::{Object, Shape};

    fn read_text(text: &str) -> Result<(Mesh, Warnings)> {
        let mut warnings = Warnings::default();
        let bytes = text.as_bytes().to_vec();
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

    #[test]
    fn faults_have_their_line() {
        let text = |text: &str| read_text(text).map(drop).expect_err("it is broken").to_string();
        assert!(text("OFX\n").starts_with("a.off:1: an OFF file begins with `OFF`"));
        assert_eq!(text("4OFF\n1 1 1\n"), "a.off:1: not three-dimensional");
        assert_eq!(text("OFF BINARY\n"), "a.off:1: binary OFF is not read; export it as text");
        assert_eq!(text("OFF\nx\n"), "a.off:2: no numbers of vertices and faces after `OFF`");
        let text_of = |face: &str| text(&format!("OFF\n4 2 0\n{SQUARE}{face}\n3 0 1 2\n"));
        assert_eq!(text_of("3 0 1 4"), "a.off:7: vertex 4 does not exist; there are 4, counted from 0");
        assert_eq!(text_of("3 0 1"), "a.off:7: a face of 3 vertices with 2 values");
        assert_eq!(text_of("3 0 1 x"), "a.off:7: not a number");
        assert_eq!(text_of("-1 0"), "a.off:7: a face begins with the number of its vertices");
    }
}
