//! OFF (Geomview manual, "OFF Files"): text or binary, with `N` (normals), `C` (colours) and `ST` (texture coordinates)
//! of vertices, and colours of faces. Colours are display values: of 0 to 255, or of 0 to 1 where none is larger. As in
//! OBJ files, v points up in the image.
//!
//! Binary data is big-endian (Geomview), with a number of colour values behind each face. The pmp-library writes it
//! little-endian, without that number; such files are told by counts that fit the file's size in this order alone.
//!
//! Text is read by lines, since the number of colour values of a face is that of the words left on its line; a file
//! that is not whole by lines is read by words. No crate is used: those on crates.io (off-rs 1.0, meshio-rs) read
//! neither colours of faces nor comments, and have no line numbers.

use glam::{DVec2, DVec3};

use crate::error::{Result, Warnings};
use crate::film::ColourPipeline;
use crate::film::colour::srgb_encode;
use crate::import::Source;
use crate::import::meshes::colours::Colours;
use crate::import::meshes::polygon::Polygons;
use crate::import::text::lines::{Lines, take_word, warn_of_comma};
use crate::import::text::values::{Encoding, Read, ReadError, Scalar, Values};
use crate::scene::{Attribute, Mesh, Phong, Scene};

/// Whether the first word of a text is that of OFF files, of any dimension, followed by a number, `BINARY` or nothing
/// on its line. Headers of other files may begin with the word.
pub(crate) fn is_start(text: &[u8]) -> bool {
    let line = Lines::new(text, 0).next().unwrap_or_default().1.to_ascii_uppercase();
    let Some(at) = line.windows(3).position(|letters| letters == b"OFF") else { return false };
    let after = line[at + 3..].trim_ascii_start();
    let is_whole =
        after.first().is_none_or(|b| b.is_ascii_digit() || *b == b'#') || after.starts_with(b"BINARY");
    is_whole && line[..at].iter().all(|letter| b"STCN4".contains(letter))
}

/// Reads an OFF file as one mesh.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
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
    let mut values = Values::of_text(source, &source.bytes, 0, is_by_words, without_comment);
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
    warn_of_comma(values.comma, &source.file, warnings);
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
    if values.encoding == Encoding::LittleEndian {
        return Ok(());
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
            let of = |encoding| {
                let mut values = values.clone().into_binary(encoding);
                let mut counts = Vec::new();
                let is_there = values.take(3, Scalar::I32, &mut counts).is_ok();
                (is_there && counts.iter().all(|&count| count >= 0.0)).then_some((values, counts))
            };
            let (big, little) = (of(Encoding::BigEndian), of(Encoding::LittleEndian));
            // A vertex has three values at least, a face one.
            let fits = |(values, counts): &(Values, Vec<f64>)| {
                4.0 * (3.0 * counts[0] + counts[1]) <= values.bytes_left() as f64
            };
            let is_little = little.as_ref().is_some_and(fits) && !big.as_ref().is_some_and(fits);
            let Some((binary, counts)) = (if is_little { little } else { big }) else {
                return Err(values.clone().into_binary(Encoding::BigEndian).fault(NO_COUNTS));
            };
            *values = binary;
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
mod tests;
