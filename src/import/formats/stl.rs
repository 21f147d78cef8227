//! STL (3D Systems, "StereoLithography Interface Specification", 1989): ASCII and binary.
//!
//! Corners with equal coordinates are welded into one vertex, so that meshes are as closed as the file's corners are.
//! Facet normals are ignored: surfaces are two-sided. Colours of binary files are read in both conventions
//! ([`colours`]). ASCII files are parsed word by word; line ends matter only in names of solids.
//!
//! No crate is used: stl_io 0.11, the maintained one, reads every file that begins with `solid ` as ASCII, stops after
//! the first of several solids, rejects files with a non-finite number, does not weld -0 and 0, and its errors have no
//! line number.

mod colours;
mod words;

use std::collections::HashMap;

use glam::DVec3;

use crate::error::{Error, Place, Result, Warnings};
use crate::import::Source;
use crate::import::text::lines::{parse_with_comma, shown, warn_of_comma, without_comments};
use crate::limits;
use crate::scene::{Mesh, Scene};
use colours::FacetColours;
use words::Words;

/// Sizes in bytes in binary files: header with the facet count; facet with normal and corners in f32 and two attribute
/// bytes.
const HEAD: usize = 84;
const FACET: usize = 50;

/// Keywords of ASCII statements.
const STATEMENTS: [&[u8]; 8] =
    [b"solid", b"endsolid", b"facet", b"outer", b"loop", b"endfacet", b"vertex", b"endloop"];

/// Reads an STL file into one mesh per solid.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    if is_binary(&source.bytes) {
        return read_binary(source, warnings);
    }
    Ok(source.scene_of(read_ascii(source, warnings)?))
}

/// Facet count in the header of a binary file.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEAD - 4..HEAD)?.first_chunk()?;
    Some(u32::from_le_bytes(*count) as usize)
}

/// Whether the length of a file that begins with `start` is that of a binary one with its facet count, or less than a
/// facet more.
pub(crate) fn has_length_of_binary(start: &[u8], length: u64) -> bool {
    claimed(start).is_some_and(|count| {
        let rest = length.checked_sub((HEAD + count * FACET) as u64);
        rest.is_some_and(|rest| rest == 0 || count > 0 && rest < FACET as u64)
    })
}

/// Whether a file is binary: its length matches its facet count, even if its header begins with `solid`, or it is no
/// text.
fn is_binary(bytes: &[u8]) -> bool {
    if has_length_of_binary(bytes, bytes.len() as u64) {
        return true;
    }
    let start = &bytes[..bytes.len().min(512)];
    let is_solid = without_comments(start).get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let has_control = start.iter().any(|b| b.is_ascii_control() && !b.is_ascii_whitespace());
    // Names of solids may have control characters, and headers of binary files may have keywords.
    let body = start.get(HEAD..).unwrap_or_default();
    let has_keyword = body.windows(5).any(|word| word.eq_ignore_ascii_case(b"facet"))
        || body.windows(6).any(|word| word.eq_ignore_ascii_case(b"vertex"));
    has_control && !(is_solid && has_keyword)
}

/// Number of facets of a binary file as stated in its header. If fewer are complete, or the header says 0, as written
/// by streaming exporters, the number of complete facets, with a warning.
fn facet_count(source: &Source, warnings: &mut Warnings) -> Result<usize> {
    let (bytes, file) = (source.bytes.as_slice(), source.file.display());
    let place = Place::item(&source.file, format!("byte {}", bytes.len()));
    let Some(count) = claimed(bytes) else {
        let what = "ends within the header of binary STL; ASCII STL begins with `solid`";
        return Err(Error::input(place, what, "export the file again"));
    };
    let (whole, rest) = ((bytes.len() - HEAD) / FACET, bytes.len() - HEAD);
    if count > whole {
        let what = format!("ends after {whole} of {count} triangles");
        if whole == 0 {
            return Err(Error::input(place, what, "export or copy the file again"));
        }
        warnings.left_out(format!("{file}: {what}; the complete ones are drawn"));
    } else if count == 0 && whole > 0 {
        warnings.push(format!("{file}: the header says 0 triangles; {whole} are drawn"));
    } else if rest > count * FACET {
        let rest = rest - count * FACET;
        warnings.left_out(format!("{file}: left out {rest} byte(s) after the last triangle"));
    }
    let count = if count == 0 { whole } else { count.min(whole) };
    let each = size_of::<[u32; 3]>() + 3 * size_of::<DVec3>();
    limits::check(limits::product(&[count as u64, each as u64]))
        .map_err(|excess| excess.at(place, format!("{count} triangles: reading them")))?;
    Ok(count)
}

fn read_binary(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let count = facet_count(source, warnings)?;
    let mut welder = Welder::default();
    welder.mesh.triangles.reserve(count);
    let mut colours = FacetColours::of_header(&source.bytes[..HEAD - 4]);
    for facet in source.bytes[HEAD..].as_chunks::<FACET>().0.iter().take(count) {
        let number = |at: usize| {
            let bytes = facet[at..].first_chunk().copied().unwrap_or_default();
            f64::from(f32::from_le_bytes(bytes))
        };
        welder.add([12, 24, 36].map(|at| DVec3::new(number(at), number(at + 4), number(at + 8))));
        colours.push(u16::from_le_bytes([facet[FACET - 2], facet[FACET - 1]]));
    }
    let mut scene = source.scene_of(Vec::new());
    let material = colours.add_to(&mut scene, &mut welder.mesh);
    source.add_object(&mut scene, None, welder.mesh, material);
    Ok(scene)
}

/// Solids and their names.
type Solids = Vec<(Option<String>, Mesh)>;

/// Whether a word is a truncated keyword.
fn is_truncated_keyword(word: &[u8]) -> bool {
    STATEMENTS.iter().any(|whole| whole.starts_with(word)) && !STATEMENTS.contains(&word)
}

fn has_triangles(solids: &Solids, welder: &Welder) -> bool {
    let is_filled = |mesh: &Mesh| !mesh.triangles.is_empty();
    is_filled(&welder.mesh) || solids.iter().any(|(_, mesh)| is_filled(mesh))
}

/// Reads the solids of an ASCII file and their names.
fn read_ascii(source: &Source, warnings: &mut Warnings) -> Result<Solids> {
    let mut solids = Solids::new();
    let mut name = None;
    let mut welder = Welder::default();
    let mut corners: Vec<DVec3> = Vec::new();
    let (mut is_open, mut comma) = (false, None);
    let mut words = Words::new(&source.bytes);
    while let Some(word) = words.next_statement() {
        let line = words.line;
        let fault =
            |what: String| Err(Error::input(Place::line(&source.file, line), what, "correct the line"));
        match word.to_ascii_lowercase().as_slice() {
            b"solid" if corners.is_empty() => {
                solids.push((name.take(), std::mem::take(&mut welder).mesh));
                name = Some(shown(words.name(&[b"facet", b"endsolid"]))).filter(|name| !name.is_empty());
                is_open = true;
            }
            b"endsolid" if corners.is_empty() => {
                words.name(&[b"solid"]);
                is_open = false;
            }
            b"facet" if corners.is_empty() => words.skip_normal(),
            b"outer" if corners.is_empty() => words.skip(b"loop"),
            b"loop" if corners.is_empty() => {}
            b"endfacet" if corners.is_empty() => words.skip_rest_of_line(),
            b"vertex" => {
                let mut next = || parse_with_comma(words.next()?, line, &mut comma);
                let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
                    if words.is_at_end() && has_triangles(&solids, &welder) {
                        break;
                    }
                    return fault("a vertex without three numbers".into());
                };
                corners.push(DVec3::new(x, y, z));
            }
            b"endloop" => match corners[..] {
                [a, b, c] => {
                    welder.add([a, b, c]);
                    corners.clear();
                    words.skip_rest_of_line();
                }
                _ => return fault(format!("a facet of {} vertices, not 3", corners.len())),
            },
            // The file may end within a keyword.
            cut if words.is_at_end() && has_triangles(&solids, &welder) && is_truncated_keyword(cut) => break,
            _ if corners.is_empty() => return fault("not a statement of STL files".into()),
            _ => return fault("neither `vertex` nor `endloop` in a facet".into()),
        }
    }
    solids.push((name, welder.mesh));
    solids.retain(|(_, mesh)| !mesh.triangles.is_empty());
    if solids.is_empty() && !corners.is_empty() {
        let place = Place::line(&source.file, words.line);
        return Err(Error::input(place, "the file ends within a facet", "export or copy the file again"));
    }
    warn_of_comma(comma, &source.file, warnings);
    if is_open {
        let what = "ends without `endsolid`, so it may not be whole";
        warnings.push(format!("{}: {what}", source.file.display()));
    }
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
mod tests;
