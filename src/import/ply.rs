//! PLY (Turk, "The PLY Polygon File Format", 1994): ASCII and binary in either byte order.
//!
//! Read are the position, normal (`nx ny nz`), texture coordinates (`u v`, `s t` or `texture_u texture_v`) and colour
//! (`red green blue`) of vertices, the polygon (`vertex_indices` or `vertex_index`) of faces, and triangle strips
//! (`tristrips`), in which a negative index begins a new strip. All other elements and properties are skipped. Colours
//! are display values, as in OBJ files: integers are divided by 255 (16 bits by 65535) and decoded from sRGB. As in OBJ
//! files, v points up in the image.
//!
//! No crate is used: ply-rs-bw 3.0.3, the maintained one, rejects files with `nan`, `.5` or `1.` in a vertex, property
//! names with a bracket (as CloudCompare writes) and headers that are not UTF-8, and its errors have no byte offset for
//! binary data.

mod header;

use glam::{DVec2, DVec3};

use super::Source;
use super::lines::{Lines, parse_number, take_word};
use super::polygon::{Cuts, Triangulator};
use crate::error::{Error, Place, Result, Warnings};
use crate::film::colour::srgb_decode;
use crate::limits;
use crate::scene::{Attribute, Mesh, Scene};
use header::{Element, Encoding, Header, Property, Scalar};

/// Reads a PLY file as one mesh.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let header = Header::parse(source)?;
    let mut body = Body::new(source, &header);
    let (mut mesh, mut faces) = (Mesh::default(), Faces::default());
    for element in &header.elements {
        body.check_count(element)?;
        match element.name.as_str() {
            "vertex" if mesh != Mesh::default() => {
                return Err(body.fault_of(element, "a second element `vertex`"));
            }
            "vertex" => body.vertices(element, &mut mesh)?,
            "face" => body.faces(element, &mut mesh, &mut faces)?,
            "tristrips" => body.strips(element, &mut mesh)?,
            _ => body.skip(element)?,
        }
    }
    body.end();
    let file = source.file.display();
    let (points, Faces { cuts, too_small, has_uvs }) = (mesh.positions.len(), faces);
    let mut say = |is_said: bool, what: String| {
        if is_said {
            warnings.left_out(format!("{file}: {what}"));
        }
    };
    let what = "vertices without faces; points are not drawn";
    say(mesh.triangles.is_empty() && points > 0, format!("{points} {what}"));
    say(too_small > 0, format!("left out {too_small} face(s) of fewer than three corners"));
    let what =
        "texture coordinates of faces (`texcoord`) are left out; those of vertices (`u`, `v`) are read";
    say(has_uvs, what.into());
    let what = "line(s) hold more values than the header says; the rest of them is left out";
    say(body.longer > 0, format!("{} {what}", body.longer));
    cuts.warn(&source.file, warnings);
    Ok(source.scene_of(vec![(None, mesh)]))
}

/// Counts of unusual faces.
#[derive(Default)]
struct Faces {
    cuts: Cuts,
    too_small: usize,
    /// Whether faces have texture coordinates of their own.
    has_uvs: bool,
}

/// Reader of the values after the header.
struct Body<'a> {
    source: &'a Source,
    encoding: Encoding,
    /// Binary data: offset of the next byte.
    at: usize,
    /// ASCII data: the remaining lines, the number of the current line, and its remaining words.
    lines: Lines<'a>,
    line: usize,
    words: &'a [u8],
    /// Number of lines with more values than declared.
    longer: usize,
}

impl<'a> Body<'a> {
    fn new(source: &'a Source, header: &Header) -> Self {
        Body {
            source,
            encoding: header.encoding,
            at: header.bytes,
            lines: Lines::new(&source.bytes[header.bytes..], header.lines),
            line: header.lines,
            words: &[],
            longer: 0,
        }
    }

    /// An error at the current line or byte.
    fn fault(&self, what: impl Into<String>) -> Error {
        let place = match self.encoding {
            Encoding::Ascii => Place::line(&self.source.file, self.line),
            _ => Place::item(&self.source.file, format!("byte {}", self.at)),
        };
        Error::input(place, what, "export the file again")
    }

    /// An error in the declaration of an element.
    fn fault_of(&self, element: &Element, what: impl Into<String>) -> Error {
        Error::input(Place::line(&self.source.file, element.line), what, "export the file again")
    }

    /// Checks that the rest of the file can hold the declared elements.
    fn check_count(&self, element: &Element) -> Result<()> {
        let left = match self.encoding {
            // The last line may lack a terminator.
            Encoding::Ascii => self.lines.bytes_left() as u64 + 1,
            _ => (self.source.bytes.len() - self.at) as u64,
        };
        let least = limits::product(&[element.count, element.least_bytes(self.encoding)]);
        if least > left {
            let what = format!("{} elements take at least {least} bytes; {left} are left", element.count);
            return Err(self.fault_of(element, what));
        }
        Ok(())
    }

    /// Checks the memory limit for `bytes` per element, after [`Body::check_count`].
    fn check_memory(&self, element: &Element, bytes: usize) -> Result<()> {
        limits::check(limits::product(&[element.count, bytes as u64])).map_err(|excess| {
            let what = format!("{} elements: reading them {excess}", element.count);
            Error::input(Place::line(&self.source.file, element.line), what, excess.hint())
        })
    }

    /// Ends an element; in ASCII data, counts the line if it has values left.
    fn end(&mut self) {
        self.longer += usize::from(take_word(&mut self.words).is_some());
        self.words = &[];
    }

    /// Starts the next element; in ASCII data, moves to the next line that is not empty.
    fn begin(&mut self) -> Result<()> {
        if self.encoding != Encoding::Ascii {
            return Ok(());
        }
        self.end();
        loop {
            let Some((number, line)) = self.lines.next() else {
                return Err(self.fault("the file ends before the last of the elements that its header names"));
            };
            (self.line, self.words) = (number, line);
            if !line.trim_ascii().is_empty() {
                return Ok(());
            }
        }
    }

    fn next(&mut self, scalar: Scalar) -> Result<f64> {
        if self.encoding == Encoding::Ascii {
            let Some(word) = take_word(&mut self.words) else {
                return Err(self.fault("fewer values than the header says"));
            };
            return parse_number(word).ok_or_else(|| self.fault("not a number"));
        }
        let Some(bytes) = self.source.bytes.get(self.at..self.at + scalar.size()) else {
            return Err(self.fault("the file ends before the last of the elements that its header names"));
        };
        let join = |bits: u64, &byte: &u8| bits << 8 | u64::from(byte);
        let bits = match self.encoding {
            Encoding::BigEndian => bytes.iter().fold(0, join),
            _ => bytes.iter().rev().fold(0, join),
        };
        self.at += scalar.size();
        Ok(scalar.of_bits(bits))
    }

    /// Reads the length of a list.
    fn length(&mut self, scalar: Scalar) -> Result<u64> {
        let length = self.next(scalar)?;
        if length >= 0.0 && length.fract() == 0.0 {
            Ok(length as u64)
        } else {
            Err(self.fault(format!("a list of {} values", brief(length))))
        }
    }

    fn skip_property(&mut self, property: &Property) -> Result<()> {
        let count = property.length.map_or(Ok(1), |length| self.length(length))?;
        (0..count).try_for_each(|_| self.next(property.scalar).map(drop))
    }

    fn skip(&mut self, element: &Element) -> Result<()> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for _ in 0..element.count {
            self.begin()?;
            if self.encoding == Encoding::Ascii {
                self.words = &[];
            } else {
                element.properties.iter().try_for_each(|property| self.skip_property(property))?;
            }
        }
        Ok(())
    }

    fn vertices(&mut self, element: &Element, mesh: &mut Mesh) -> Result<()> {
        let slot = |property: &Property| {
            let slot = match property.name.as_str() {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                "nx" => 3,
                "ny" => 4,
                "nz" => 5,
                "red" | "diffuse_red" => 6,
                "green" | "diffuse_green" => 7,
                "blue" | "diffuse_blue" => 8,
                "u" | "s" | "texture_u" => 9,
                "v" | "t" | "texture_v" => 10,
                _ => return None,
            };
            Some(slot).filter(|_| property.length.is_none())
        };
        let slots: Vec<Option<usize>> = element.properties.iter().map(slot).collect();
        let has = |of: &[usize]| of.iter().all(|slot| slots.contains(&Some(*slot)));
        if !has(&[0, 1, 2]) {
            return Err(self.fault_of(element, "its vertices have no `x`, `y` and `z`"));
        }
        let white = |slot: usize| {
            let property = slots.iter().position(|other| *other == Some(slot));
            property.map_or(1.0, |index| element.properties[index].scalar.white())
        };
        let white = DVec3::new(white(6), white(7), white(8));
        let (has_normals, has_colours, has_uvs) = (has(&[3, 4, 5]), has(&[6, 7, 8]), has(&[9, 10]));
        let vectors = 1 + usize::from(has_normals) + usize::from(has_colours);
        let uv_bytes = if has_uvs { size_of::<DVec2>() } else { 0 };
        self.check_memory(element, vectors * size_of::<DVec3>() + uv_bytes)?;
        // The count was checked against the file size and the memory limit.
        let count = element.count as usize;
        let list = |is_there: bool| Vec::with_capacity(if is_there { count } else { 0 });
        let (mut positions, mut normals, mut colours) = (list(true), list(has_normals), list(has_colours));
        let mut uvs = Vec::with_capacity(if has_uvs { count } else { 0 });
        for _ in 0..count {
            self.begin()?;
            let mut values = [0.0; 11];
            for (property, slot) in element.properties.iter().zip(&slots) {
                match slot {
                    Some(slot) => values[*slot] = self.next(property.scalar)?,
                    None => self.skip_property(property)?,
                }
            }
            positions.push(DVec3::from_slice(&values));
            if has_normals {
                normals.push(DVec3::from_slice(&values[3..]));
            }
            if has_colours {
                let display = DVec3::from_slice(&values[6..]) / white;
                colours.push(DVec3::from(display.to_array().map(srgb_decode)));
            }
            if has_uvs {
                uvs.push(DVec2::new(values[9], 1.0 - values[10]));
            }
        }
        mesh.positions = positions;
        mesh.normals = has_normals.then(|| Attribute::per_position(normals));
        mesh.colours = has_colours.then(|| Attribute::per_position(colours));
        mesh.uvs.extend(has_uvs.then(|| Attribute::per_position(uvs)));
        Ok(())
    }

    fn faces(&mut self, element: &Element, mesh: &mut Mesh, faces: &mut Faces) -> Result<()> {
        let is_polygon = |property: &Property| {
            property.length.is_some() && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
        };
        if element.count > 0 && !element.properties.iter().any(is_polygon) {
            return Err(self.fault_of(element, "its faces have no `vertex_indices`"));
        }
        let is_uv = |property: &Property| property.name == "texcoord";
        faces.has_uvs |= element.count > 0 && element.properties.iter().any(is_uv);
        self.check_memory(element, size_of::<[u32; 3]>())?;
        mesh.triangles.reserve(element.count as usize);
        let mut triangulator = Triangulator::new();
        let (mut polygon, mut corners) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            self.begin()?;
            for property in &element.properties {
                let Some(length) = property.length.filter(|_| is_polygon(property)) else {
                    self.skip_property(property)?;
                    continue;
                };
                polygon.clear();
                corners.clear();
                for _ in 0..self.length(length)? {
                    let index = self.next(property.scalar)?;
                    let index = self.checked(index, mesh.positions.len())?;
                    polygon.push(index);
                    corners.push(mesh.positions[index as usize]);
                }
                faces.too_small += usize::from(corners.len() < 3);
                let triangles = &mut mesh.triangles;
                faces
                    .cuts
                    .count(triangulator.triangulate(&corners, |t| triangles.push(t.map(|i| polygon[i]))));
            }
        }
        Ok(())
    }

    /// Reads triangle strips, of which every second triangle is turned.
    fn strips(&mut self, element: &Element, mesh: &mut Mesh) -> Result<()> {
        for _ in 0..element.count {
            self.begin()?;
            for property in &element.properties {
                let Some(length) = property.length.filter(|_| property.name == "vertex_indices") else {
                    self.skip_property(property)?;
                    continue;
                };
                let mut strip = Vec::new();
                for _ in 0..self.length(length)? {
                    let index = self.next(property.scalar)?;
                    if index < 0.0 {
                        strip.clear();
                        continue;
                    }
                    strip.push(self.checked(index, mesh.positions.len())?);
                    if let &[.., a, b, c] = strip.as_slice() {
                        mesh.triangles.push(if strip.len() % 2 == 1 { [a, b, c] } else { [b, a, c] });
                    }
                }
            }
        }
        Ok(())
    }

    /// A vertex index, below `count`.
    fn checked(&self, index: f64, count: usize) -> Result<u32> {
        if index >= 0.0 && index < count as f64 && index.fract() == 0.0 && index <= f64::from(u32::MAX) {
            Ok(index as u32)
        } else {
            let index = brief(index);
            Err(self.fault(format!(
                "vertex {index} does not exist; there are {count} before the faces, counted from 0"
            )))
        }
    }
}

/// A number for display, with an exponent if it is long.
fn brief(number: f64) -> String {
    if number.abs() < 1e16 { number.to_string() } else { format!("{number:e}") }
}

#[cfg(test)]
mod tests;
