//! Parses the parts of an OBJ text in parallel and appends them in the order of the text. Indices relative to the
//! parts before, names, materials and smoothing groups are resolved there, so that the result does not depend on the
//! cuts or the number of threads.

use std::collections::BTreeSet;
use std::path::Path;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Place, Result, Warnings};
use crate::import::Source;
use crate::import::formats::obj::chunk::{Chunk, Fault, NO_COLOUR, Range, Statement};
use crate::import::formats::obj::faces::{
    Count, Faces, INHERITED, INVALID_INDEX, MISSING, Polygon, RELATIVE, RELATIVE_BIAS,
};
use crate::import::formats::obj::oddities::Oddities;
use crate::import::formats::obj::text::{READING, Windows, parts};
use crate::limits;

/// Maximum number of elements of one kind, as indices have 31 bits and the last is [`INVALID_INDEX`].
const MOST: usize = INVALID_INDEX as usize;

/// Half of the bytes of a run and its object, with names and short lists: what is needed is twice what is there.
const RUN: usize = (size_of::<Run>() + size_of::<crate::scene::Object>() + 256) / 2;

/// Sizes in which a text is read and parsed, in bytes; its meshes do not depend on them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Read at a time.
    pub window: usize,
    /// Parsed by one thread.
    pub part: usize,
}

impl Default for Sizes {
    fn default() -> Self {
        Sizes { window: 8 << 20, part: 512 << 10 }
    }
}

/// The faces between two statements that name an object or a material.
#[derive(Debug)]
pub(super) struct Run {
    pub name: String,
    pub material: Option<String>,
    pub faces: Faces,
}

/// An OBJ text as vectors. Indices count from the first element of the text.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    pub positions: Vec<DVec3>,
    /// Display values per position, [`NO_COLOUR`] if missing; empty if no position has a colour.
    pub colours: Vec<DVec3>,
    /// Display values of ZBrush comments (`#MRGB`), in the order of positions.
    pub zbrush_colours: Vec<[u8; 3]>,
    pub uvs: Vec<DVec2>,
    pub normals: Vec<DVec3>,
    pub runs: Vec<Run>,
    /// MTL files in their order, each once.
    pub libraries: Vec<String>,
    known_libraries: BTreeSet<String>,
    /// The run that is being appended to.
    name: String,
    material: Option<String>,
    faces: Faces,
    group: u32,
    /// Lines of the parts so far.
    lines: usize,
    needed: [u64; 3],
    oddities: Oddities,
}

/// Parses the text of `source`.
///
/// # Errors
/// [`Error::Input`] with the first line that is at fault; if only indices are, of those.
pub(super) fn parse(source: &Source, sizes: Sizes, warnings: &mut Warnings) -> Result<Assembly> {
    let file = source.file.as_path();
    let mut windows = Windows::open(source, sizes.window)?;
    let mut assembly = Assembly { name: "unnamed_object".into(), ..Assembly::default() };
    let (mut window, mut next) = (Vec::new(), Vec::new());
    let (mut chunks, mut parsed) = (Vec::new(), Vec::new());
    let (mut consumed, mut checked) = (0, 0);
    windows.next(&mut window)?;
    // While a window is parsed, the next one is read and the one before is appended.
    while !window.is_empty() {
        consumed += window.len() as u64;
        let append = || assembly.append_all(&parsed, file);
        let (read, (appended, ())) = rayon::join(
            || windows.next(&mut next),
            || rayon::join(append, || parse_parts(&window, sizes.part, &mut chunks)),
        );
        appended?;
        read?;
        std::mem::swap(&mut chunks, &mut parsed);
        std::mem::swap(&mut window, &mut next);
        // Appended so far are the windows before this one.
        assembly.check_memory(&parsed, consumed, windows.length, &mut checked, source)?;
    }
    assembly.append_all(&parsed, file)?;
    assembly.end_run();
    let totals = [assembly.positions.len(), assembly.uvs.len(), assembly.normals.len()].map(|n| n as u64);
    if assembly.needed.iter().zip(totals).any(|(&needed, total)| needed > total) {
        let first = find_fault(source, sizes, totals.map(|n| n as i64))?;
        let mut left_out = Count::default();
        for run in &mut assembly.runs {
            left_out.add(run.faces.leave_out(totals));
        }
        assembly.runs.retain(|run| run.faces.count() != Count::default());
        let faces = match left_out.triangles + left_out.polygons {
            0 => String::new(),
            count => format!(" and {count} face(s)"),
        };
        warnings.left_out(format!("{first}; invalid indices{faces} are left out"));
    }
    if assembly.colours.is_empty() && !assembly.zbrush_colours.is_empty() {
        let colours =
            assembly.zbrush_colours.iter().map(|&colour| DVec3::from(colour.map(f64::from)) / 255.0);
        assembly.colours = colours.take(assembly.positions.len()).collect();
        assembly.colours.resize(assembly.positions.len(), NO_COLOUR);
    }
    assembly.oddities.warn(file, warnings);
    Ok(assembly)
}

/// Parses the parts of a window into as many chunks.
fn parse_parts(window: &[u8], size: usize, chunks: &mut Vec<Chunk>) {
    let parts = parts(window, size);
    chunks.resize_with(parts.len(), Chunk::default);
    chunks.par_iter_mut().zip(parts).for_each(|(chunk, part)| chunk.parse(part, None));
}

/// Message about the first invalid index in a text without other faults.
fn find_fault(source: &Source, sizes: Sizes, totals: [i64; 3]) -> Result<String> {
    let mut windows = Windows::open(source, sizes.window)?;
    let (mut window, mut chunk) = (Vec::new(), Chunk::default());
    let (mut before, mut lines) = ([0; 3], 0);
    loop {
        windows.next(&mut window)?;
        if window.is_empty() {
            let what = "was changed while it was read";
            return Err(Error::input(source.file.as_path(), what, "try again"));
        }
        for part in parts(&window, sizes.part) {
            chunk.parse(part, Some(Range { before, totals }));
            if let Some(fault) = &chunk.fault {
                return Ok(error(&source.file, lines, fault).to_string());
            }
            lines += chunk.lines;
            let counts = [chunk.positions.len(), chunk.uvs.len(), chunk.normals.len()];
            before = std::array::from_fn(|kind| before[kind] + counts[kind] as i64);
        }
    }
}

fn error(file: &Path, lines_before: usize, fault: &Fault) -> Error {
    let place = Place::line(file, lines_before + fault.line + 1);
    Error::input(place, fault.what.as_str(), "correct the line")
}

impl Assembly {
    fn append_all(&mut self, chunks: &[Chunk], file: &Path) -> Result<()> {
        for chunk in chunks {
            if let Some(fault) = &chunk.fault {
                return Err(error(file, self.lines, fault));
            }
            self.append(chunk);
            if [self.positions.len(), self.uvs.len(), self.normals.len()].into_iter().any(|n| n > MOST) {
                let what = format!("more than {MOST} vertices");
                return Err(Error::input(file, what, "split the file"));
            }
        }
        Ok(())
    }

    fn append(&mut self, chunk: &Chunk) {
        let bases = [self.positions.len(), self.uvs.len(), self.normals.len()].map(|base| base as i64);
        let mut resolver = Resolver { bases, group: self.group, precedes_the_text: false };
        let mut from = Count::default();
        for (until, statement) in &chunk.statements {
            self.append_faces(chunk, from, *until, &mut resolver);
            from = *until;
            match statement {
                Statement::Object(name) => {
                    self.end_run();
                    self.name.clone_from(name);
                }
                Statement::Material(name) if self.material.as_ref() != Some(name) => {
                    self.end_run();
                    self.material = Some(name.clone());
                }
                Statement::Material(_) => {}
                Statement::Library(name) => {
                    if self.known_libraries.insert(name.clone()) {
                        self.libraries.push(name.clone());
                    }
                }
            }
        }
        self.append_faces(chunk, from, chunk.faces.count(), &mut resolver);
        if !chunk.colours.is_empty() || !self.colours.is_empty() {
            self.colours.resize(self.positions.len(), NO_COLOUR);
            self.colours.extend_from_slice(&chunk.colours);
            self.colours.resize(self.positions.len() + chunk.positions.len(), NO_COLOUR);
        }
        self.positions.extend_from_slice(&chunk.positions);
        self.zbrush_colours.extend_from_slice(&chunk.zbrush_colours);
        self.uvs.extend_from_slice(&chunk.uvs);
        self.normals.extend_from_slice(&chunk.normals);
        self.needed = std::array::from_fn(|kind| self.needed[kind].max(chunk.needed[kind]));
        if resolver.precedes_the_text {
            self.needed[0] = u64::MAX;
        }
        self.oddities.append(&chunk.oddities, self.lines);
        self.group = chunk.group.unwrap_or(self.group);
        self.lines += chunk.lines;
    }

    /// Appends the faces of a part between two counts to the run.
    fn append_faces(&mut self, chunk: &Chunk, from: Count, until: Count, resolver: &mut Resolver) {
        let (faces, source) = (&mut self.faces, &chunk.faces);
        let before = faces.triangles[0].len();
        let polygons = &source.polygons[from.polygons..until.polygons];
        let corners = source.first_corner(from.polygons)..source.first_corner(until.polygons);
        let shift = |polygon: &Polygon| Polygon {
            triangles_before: before + polygon.triangles_before - from.triangles,
            first_corner: faces.corners.len() + polygon.first_corner - corners.start,
        };
        faces.polygons.extend(polygons.iter().map(shift));
        let resolved = |corner: &[u32; 3]| [0, 1, 2].map(|kind| resolver.resolve(kind, corner[kind]));
        faces.corners.extend(source.corners[corners].iter().map(resolved));
        let added = until.triangles - from.triangles;
        for kind in (0..3).filter(|_| added > 0) {
            let all = &source.triangles[kind];
            let none = resolver.resolve(kind, if kind == 2 { INHERITED } else { MISSING });
            let indices = all.get(from.triangles..until.triangles).unwrap_or_default();
            let is_missing = if indices.is_empty() {
                none == MISSING
            } else {
                indices.iter().flatten().all(|&index| resolver.resolve(kind, index) == MISSING)
            };
            let mine = &mut faces.triangles[kind];
            if kind > 0 && mine.is_empty() && is_missing {
                continue;
            }
            if kind > 0 && mine.len() < before {
                mine.resize(before, [MISSING; 3]);
            }
            if all.is_empty() {
                mine.resize(before + added, [none; 3]);
            } else if chunk.is_plain[kind] {
                mine.extend_from_slice(indices);
            } else {
                mine.extend(indices.iter().map(|t| t.map(|index| resolver.resolve(kind, index))));
            }
        }
    }

    /// Begins a new run, if the current one has faces.
    fn end_run(&mut self) {
        if self.faces.count() != Count::default() {
            let faces = std::mem::take(&mut self.faces);
            self.runs.push(Run { name: self.name.clone(), material: self.material.clone(), faces });
        }
    }

    /// Checks the memory for the whole text, projected from the windows so far, whenever that grows by a quarter.
    fn check_memory(
        &self,
        parsed: &[Chunk],
        consumed: u64,
        length: u64,
        checked: &mut u64,
        source: &Source,
    ) -> Result<()> {
        let vertices = |positions: usize, colours: usize, uvs: usize, normals: usize| {
            24 * (positions + colours + normals) + 16 * uvs
        };
        let of_chunk = |chunk: &Chunk| {
            let Chunk { positions, colours, zbrush_colours, uvs, normals, faces, statements, .. } = chunk;
            RUN * statements.len()
                + vertices(positions.len(), colours.len() + zbrush_colours.len(), uvs.len(), normals.len())
                + faces.bytes()
        };
        let colours = self.colours.len() + self.zbrush_colours.len();
        let present = vertices(self.positions.len(), colours, self.uvs.len(), self.normals.len())
            + self.faces.bytes()
            + self.runs.iter().map(|run| RUN + run.faces.bytes()).sum::<usize>();
        let all = (present + parsed.iter().map(of_chunk).sum::<usize>()) as u64;
        // Each mesh is a copy of what it uses.
        let needed = 2 * (all as f64 * (length as f64 / consumed.max(1) as f64).max(1.0)) as u64;
        if needed > *checked + *checked / 4 {
            *checked = needed;
            limits::check(needed.saturating_sub(present as u64))
                .map_err(|excess| excess.at(source.file.as_path(), READING))?;
        }
        Ok(())
    }
}

/// Resolves the indices of a part.
struct Resolver {
    /// Numbers of elements before the part.
    bases: [i64; 3],
    /// Smoothing group at its beginning.
    group: u32,
    /// Whether a relative index was before the first element of the text.
    precedes_the_text: bool,
}

impl Resolver {
    #[inline]
    fn resolve(&mut self, kind: usize, index: u32) -> u32 {
        match index {
            0..RELATIVE => index,
            RELATIVE..MISSING => {
                let index = self.bases[kind] + i64::from(index - RELATIVE) - RELATIVE_BIAS;
                self.precedes_the_text |= index < 0;
                u32::try_from(index).unwrap_or(INVALID_INDEX)
            }
            INHERITED => MISSING | self.group,
            _ => index,
        }
    }
}
