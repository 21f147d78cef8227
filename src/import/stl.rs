//! STL (3D Systems, "StereoLithography Interface Specification", 1989): ASCII and binary.
//!
//! Corners with equal coordinates are welded into one vertex, so that meshes are as closed as the file's corners are.
//! Facet normals and the two attribute bytes per facet are ignored: surfaces are two-sided, and colours in the
//! attribute bytes follow no standard.
//!
//! No crate is used: stl_io 0.11, the maintained one, reads every file that begins with `solid ` as ASCII, stops after
//! the first of several solids, rejects files with a non-finite number, does not weld -0 and 0, and its errors have no
//! line number.

use std::collections::HashMap;

use glam::DVec3;

use super::Source;
use super::lines::{Lines, parse_number, shown, take_word};
use crate::error::{Error, Place, Result, Warnings};
use crate::limits;
use crate::scene::{Mesh, Scene};

/// Sizes in bytes in binary files: header with the facet count; facet with normal and corners in f32 and two attribute
/// bytes.
const HEAD: usize = 84;
const FACET: usize = 50;

/// Reads an STL file into one mesh per solid.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let solids = if is_binary(&source.bytes) {
        vec![(None, read_binary(source, warnings)?)]
    } else {
        read_ascii(source, warnings)?
    };
    Ok(source.scene_of(solids))
}

/// Facet count in the header of a binary file.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEAD - 4..HEAD)?.first_chunk()?;
    Some(u32::from_le_bytes(*count) as usize)
}

/// Whether a file is binary: its length matches its facet count, even if its header begins with `solid`, or it does not
/// begin as ASCII files do.
fn is_binary(bytes: &[u8]) -> bool {
    if claimed(bytes).is_some_and(|count| bytes.len() == HEAD + count * FACET) {
        return true;
    }
    let text = without_mark(bytes);
    let start = &text[..text.len().min(512)];
    let is_solid = start.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let has_control = start.iter().any(|b| b.is_ascii_control() && !b.is_ascii_whitespace());
    !is_solid || has_control
}

/// Strips a byte order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

fn read_binary(source: &Source, warnings: &mut Warnings) -> Result<Mesh> {
    let bytes = source.bytes.as_slice();
    let place = Place::item(&source.file, format!("byte {}", bytes.len()));
    let fault = |what: String, hint: &str| Err(Error::input(place.clone(), what, hint));
    let Some(count) = claimed(bytes) else {
        let what = "ends within the header of binary STL; ASCII STL begins with `solid`";
        return fault(what.into(), "export the file again");
    };
    let facets = bytes[HEAD..].chunks_exact(FACET);
    if facets.len() < count {
        let what = format!("ends after {} of {count} triangles", facets.len());
        return fault(what, "export or copy the file again");
    }
    if bytes.len() > HEAD + count * FACET {
        let rest = bytes.len() - HEAD - count * FACET;
        warnings
            .left_out(format!("{}: left out {rest} byte(s) after the last triangle", source.file.display()));
    }
    let each = size_of::<[u32; 3]>() + 3 * size_of::<DVec3>();
    // The count was checked against the file size.
    if let Err(excess) = limits::check(limits::product(&[count as u64, each as u64])) {
        return fault(format!("{count} triangles: reading them {excess}"), &excess.hint());
    }
    let mut welder = Welder::default();
    welder.mesh.triangles.reserve(count);
    for facet in facets.take(count) {
        let number = |at: usize| {
            let bytes = facet[at..].first_chunk().copied().unwrap_or_default();
            f64::from(f32::from_le_bytes(bytes))
        };
        welder.add([12, 24, 36].map(|at| DVec3::new(number(at), number(at + 4), number(at + 8))));
    }
    Ok(welder.mesh)
}

/// Reads the solids of an ASCII file and their names.
fn read_ascii(source: &Source, warnings: &mut Warnings) -> Result<Vec<(Option<String>, Mesh)>> {
    let mut solids = Vec::new();
    let mut name = None;
    let mut welder = Welder::default();
    let mut corners: Vec<DVec3> = Vec::new();
    let (mut last, mut is_open) = (1, false);
    for (number, line) in Lines::new(without_mark(&source.bytes), 0) {
        let fault = |what: String| Error::input(Place::line(&source.file, number), what, "correct the line");
        let mut rest = line;
        let Some(word) = take_word(&mut rest) else { continue };
        last = number;
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                solids.push((name.take(), std::mem::take(&mut welder).mesh));
                name = Some(shown(rest.trim_ascii())).filter(|name| !name.is_empty());
                is_open = true;
            }
            b"endsolid" => is_open = false,
            b"facet" | b"outer" | b"endfacet" if corners.is_empty() => {}
            b"vertex" => {
                let mut next = || take_word(&mut rest).and_then(parse_number);
                let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
                    return Err(fault("a vertex without three numbers".into()));
                };
                corners.push(DVec3::new(x, y, z));
            }
            b"endloop" => match corners[..] {
                [a, b, c] => {
                    welder.add([a, b, c]);
                    corners.clear();
                }
                _ => return Err(fault(format!("a facet of {} vertices, not 3", corners.len()))),
            },
            _ if corners.is_empty() => return Err(fault("not a statement of STL files".into())),
            _ => return Err(fault("neither `vertex` nor `endloop` in a facet".into())),
        }
    }
    if !corners.is_empty() {
        let place = Place::line(&source.file, last);
        return Err(Error::input(place, "the file ends within a facet", "export or copy the file again"));
    }
    if is_open {
        let what = "ends without `endsolid`, so it may not be whole";
        warnings.push(format!("{}: {what}", source.file.display()));
    }
    solids.push((name, welder.mesh));
    solids.retain(|(_, mesh)| !mesh.triangles.is_empty());
    Ok(solids)
}

/// Builds a mesh, welding corners with equal coordinates.
#[derive(Default)]
struct Welder {
    mesh: Mesh,
    /// Vertex index by the bits of its coordinates.
    known: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn add(&mut self, corners: [DVec3; 3]) {
        let Welder { mesh, known } = self;
        mesh.triangles.push(corners.map(|corner| {
            // -0 + 0 = 0, so that -0 and 0 are welded.
            let place = corner + DVec3::ZERO;
            *known.entry(place.to_array().map(f64::to_bits)).or_insert_with(|| {
                mesh.positions.push(place);
                (mesh.positions.len() - 1) as u32
            })
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::dependencies::Files;
    use crate::scene::Shape;

    fn read_bytes(bytes: Vec<u8>) -> Result<(Vec<(String, Mesh)>, Warnings)> {
        let mut warnings = Warnings::default();
        let scene = read(
            &Source { file: "a.stl".into(), bytes, files: Files::default(), options: Default::default() },
            &mut warnings,
        )?;
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
            out.extend([0xff; 2]);
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
        assert_eq!(text("sold"), format!("a.stl: byte 4: {what}"));
        // 84 + 4 * 50 = 284.
        let bytes = |bytes: Vec<u8>| read_bytes(bytes).map(|(_, warnings)| warnings);
        let e = bytes(binary(b"solid", 4)[..283].to_vec()).expect_err("it is cut off");
        assert_eq!(e.to_string(), "a.stl: byte 283: ends after 3 of 4 triangles");
        let e = bytes(binary(b"", u32::MAX)).expect_err("it is cut off");
        assert_eq!(e.to_string(), "a.stl: byte 284: ends after 4 of 4294967295 triangles");
        let warnings = bytes(binary(b"", 3)).expect("three triangles");
        assert_eq!(warnings.messages(), ["a.stl: left out 50 byte(s) after the last triangle"]);
    }
}
