//! One part of an OBJ text, whole lines, as vectors. Nothing in it depends on the parts before; what does is encoded,
//! and resolved by [`crate::import::formats::obj::assembly`].

use glam::{DVec2, DVec3};

use crate::import::files::references::unquoted;
use crate::import::formats::obj::faces::{
    Count, Faces, INHERITED, INVALID_INDEX, MISSING, Polygon, RELATIVE, RELATIVE_BIAS,
};
use crate::import::formats::obj::oddities::{Oddities, Oddity};
use crate::import::formats::obj::scanner::{NONE, Scanner};
use crate::import::formats::obj::text::decode_name;

/// Placeholder for a missing colour.
pub(super) const NO_COLOUR: DVec3 = DVec3::NAN;

/// A statement that applies to the faces after it.
#[derive(Debug)]
pub(super) enum Statement {
    /// `o` or `g`.
    Object(String),
    /// `usemtl`.
    Material(String),
    /// `mtllib`.
    Library(String),
}

/// What is wrong in a line.
#[derive(Debug)]
pub(super) struct Fault {
    /// Line ends before it in the part.
    pub line: usize,
    pub what: String,
}

/// Counts of the elements of a whole file, and of those before the part, by which indices are checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    pub before: [i64; 3],
    pub totals: [i64; 3],
}

/// A parsed part of a text. Its vectors are reused for further parts.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub positions: Vec<DVec3>,
    /// Display values per position, [`NO_COLOUR`] if missing; empty if no position has a colour.
    pub colours: Vec<DVec3>,
    /// Display values of ZBrush comments (`#MRGB`), in the order of positions.
    pub zbrush_colours: Vec<[u8; 3]>,
    /// (0, 0) is the upper left corner of the image.
    pub uvs: Vec<DVec2>,
    pub normals: Vec<DVec3>,
    pub faces: Faces,
    /// Statements, with the number of faces before each.
    pub statements: Vec<(Count, Statement)>,
    /// Smoothing group at the end; `None` if it is that of the beginning.
    pub group: Option<u32>,
    /// Whether indices of each kind are used as they are.
    pub is_plain: [bool; 3],
    /// Counts of positions, texture coordinates and normals that the indices need; [`u64::MAX`] for one that cannot be.
    pub needed: [u64; 3],
    pub lines: usize,
    pub oddities: Oddities,
    pub fault: Option<Fault>,
    corners: Vec<[u32; 3]>,
    range: Option<Range>,
}

impl Chunk {
    /// Parses `text`. Indices are checked against `range` if it is given, and otherwise by the caller, against
    /// `needed`.
    pub(super) fn parse(&mut self, text: &[u8], range: Option<Range>) {
        self.clear();
        self.range = range;
        let mut scanner = Scanner::new(text);
        while !scanner.is_at_end() {
            if let Some(key) = scanner.word() {
                let line = scanner.lines;
                if let Err(what) = self.statement(key, &mut scanner) {
                    self.fault = Some(Fault { line, what });
                    return;
                }
            } else if let Some(colours) = scanner.name().strip_prefix(b"#MRGB ") {
                self.read_zbrush_colours(colours);
            }
            scanner.end_line();
        }
        self.lines = scanner.lines;
        for (oddity, line) in [(Oddity::Number, scanner.odd_number), (Oddity::Comma, scanner.comma)] {
            if let Some(line) = line {
                self.oddities.note(oddity, line);
            }
        }
        if !self.colours.is_empty() {
            self.colours.resize(self.positions.len(), NO_COLOUR);
        }
    }

    fn clear(&mut self) {
        let Chunk { positions, colours, uvs, normals, faces, corners, .. } = std::mem::take(self);
        let Faces { mut triangles, mut polygons, corners: mut of_polygons } = faces;
        triangles.iter_mut().for_each(Vec::clear);
        polygons.clear();
        of_polygons.clear();
        self.faces = Faces { triangles, polygons, corners: of_polygons };
        (self.positions, self.colours, self.uvs) = (positions, colours, uvs);
        (self.normals, self.corners) = (normals, corners);
        self.positions.clear();
        self.colours.clear();
        self.uvs.clear();
        self.normals.clear();
        self.is_plain = [true; 3];
    }

    fn statement(&mut self, key: &[u8], scanner: &mut Scanner) -> Result<(), String> {
        match key {
            b"v" => self.vertex(scanner)?,
            b"vt" => {
                let [u] = numbers(scanner, "vt")?;
                let v = number(scanner, "vt", 1)?.unwrap_or(0.0);
                // v points up in OBJ.
                self.uvs.push(DVec2::new(u, 1.0 - v));
            }
            b"vn" => self.normals.push(DVec3::from(numbers(scanner, "vn")?)),
            b"f" => self.face(scanner)?,
            b"s" => self.group = Some(smoothing_group(scanner)),
            b"o" | b"g" => {
                let name = decode_name(scanner.name());
                let name = if name.is_empty() { "unnamed_object".into() } else { name };
                self.statements.push((self.faces.count(), Statement::Object(name)));
            }
            b"usemtl" | b"mtllib" => {
                let name = decode_name(scanner.name());
                if !name.is_empty() {
                    let made = match key {
                        b"usemtl" => Statement::Material(unquoted(&name).into()),
                        _ => Statement::Library(name),
                    };
                    self.statements.push((self.faces.count(), made));
                }
            }
            b"l" | b"p" => self.oddities.note(Oddity::Element, scanner.lines),
            b"curv" | b"curv2" | b"surf" => self.oddities.note(Oddity::FreeForm, scanner.lines),
            _ if OTHERS.split(' ').any(|other| other.as_bytes() == key) => {}
            _ if key.iter().any(u8::is_ascii_uppercase) => {
                return self.statement(&key.to_ascii_lowercase(), scanner);
            }
            _ => {
                self.oddities.note(Oddity::Unknown, scanner.lines);
                scanner.name();
            }
        }
        Ok(())
    }

    /// Reads ZBrush colours: mask, red, green and blue per vertex, in two hexadecimal digits each.
    fn read_zbrush_colours(&mut self, text: &[u8]) {
        for digits in text.trim_ascii().as_chunks::<8>().0 {
            let number =
                std::str::from_utf8(digits).ok().and_then(|digits| u32::from_str_radix(digits, 16).ok());
            let Some(number) = number else { return };
            let [_, r, g, b] = number.to_be_bytes();
            self.zbrush_colours.push([r, g, b]);
        }
    }

    /// Reads `x y z`, `x y z w` or `x y z r g b`.
    fn vertex(&mut self, scanner: &mut Scanner) -> Result<(), String> {
        let line = scanner.lines;
        let [x, y] = numbers(scanner, "v")?;
        let z = number(scanner, "v", 2)?;
        if z.is_none() {
            self.oddities.note(Oddity::Flat, line);
        }
        let mut position = DVec3::new(x, y, z.unwrap_or(0.0));
        let mut more = [0.0; 4];
        let mut count = 0;
        while let Some(number) = number(scanner, "v", 3 + count)? {
            more[count.min(3)] = number;
            count += 1;
        }
        let [r, g, b, _] = more;
        match count {
            0 | 2 => {}
            1 => position /= r,
            _ => {
                self.colours.resize(self.positions.len(), NO_COLOUR);
                self.colours.push(DVec3::new(r, g, b));
            }
        }
        if !matches!(count, 0 | 1 | 3) {
            self.oddities.note_count(Oddity::Surplus, line, 3 + count);
        }
        if !position.is_finite() {
            self.oddities.note(Oddity::NotFinite, line);
        }
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self, scanner: &mut Scanner) -> Result<(), String> {
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        let fault = |before: usize| format!("corner {} of `f` is not v, v/vt, v//vn or v/vt/vn", before + 1);
        while let Some([v, vt, vn]) = scanner.corner().map_err(|_| fault(corners.len()))? {
            self.check([v, vt, vn])?;
            let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
            corners.push([0, 1, 2].map(|kind| self.encode(kind, [v, vt, vn][kind], counts[kind])));
        }
        // A texture coordinate or normal missing at one corner is dropped at all corners.
        if corners.iter().any(|corner| corner[1] == MISSING) {
            corners.iter_mut().for_each(|corner| corner[1] = MISSING);
        }
        if corners.iter().any(|corner| corner[2] == MISSING) {
            let missing = self.group.map_or(INHERITED, |group| MISSING | group);
            corners.iter_mut().for_each(|corner| corner[2] = missing);
            self.is_plain[2] &= missing != INHERITED;
        }
        match corners[..] {
            [] | [_] | [_, _] => {
                self.oddities.note_count(Oddity::FewCorners, scanner.lines, corners.len());
            }
            [a, b, c] => self.triangle(a, b, c),
            _ => {
                let first_corner = self.faces.corners.len();
                let triangles_before = self.faces.triangles[0].len();
                self.faces.polygons.push(Polygon { triangles_before, first_corner });
                self.faces.corners.extend_from_slice(&corners);
            }
        }
        self.corners = corners;
        Ok(())
    }

    fn triangle(&mut self, a: [u32; 3], b: [u32; 3], c: [u32; 3]) {
        let [positions, uvs, normals] = &mut self.faces.triangles;
        let count = positions.len();
        positions.push([a[0], b[0], c[0]]);
        for (k, indices, none) in [(1, uvs, [MISSING; 3]), (2, normals, [INHERITED; 3])] {
            let triangle = [a[k], b[k], c[k]];
            if indices.is_empty() && triangle != none {
                indices.resize(count, none);
                self.is_plain[2] &= k != 2 || count == 0;
            }
            if !indices.is_empty() || triangle != none {
                indices.push(triangle);
            }
        }
    }

    /// Checks the indices of a corner against the range, if it is given.
    fn check(&self, corner: [i64; 3]) -> Result<(), String> {
        let Some(range) = self.range else { return Ok(()) };
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (kind, index) in corner.into_iter().enumerate().filter(|(_, index)| *index != NONE) {
            let so_far = range.before[kind] + counts[kind] as i64;
            let resolved = if index < 0 { so_far.saturating_add(index) + 1 } else { index };
            let total = range.totals[kind];
            if resolved < 1 || resolved > total {
                let what = ["vertex", "texture coordinate", "normal"][kind];
                return Err(format!("{what} {index} does not exist; the file has {total}"));
            }
        }
        Ok(())
    }

    /// The form in which an index of kind `kind` is kept, where `count` elements of it precede the face in this part.
    #[inline]
    fn encode(&mut self, kind: usize, index: i64, count: usize) -> u32 {
        if index > 0 && index <= i64::from(INVALID_INDEX) {
            self.needed[kind] = self.needed[kind].max(index as u64);
            return (index - 1) as u32;
        }
        let relative = index.saturating_add(RELATIVE_BIAS + count as i64);
        if index == NONE {
            MISSING
        } else if index < 0 && (0..i64::from(MISSING - RELATIVE)).contains(&relative) {
            self.is_plain[kind] = false;
            RELATIVE + relative as u32
        } else {
            self.needed[kind] = u64::MAX;
            INVALID_INDEX
        }
    }
}

/// The next `N` numbers of a line.
fn numbers<const N: usize>(scanner: &mut Scanner, key: &str) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (i, next) in numbers.iter_mut().enumerate() {
        *next = number(scanner, key, i)?.ok_or_else(|| format!("`{key}` with {i} of {N} numbers"))?;
    }
    Ok(numbers)
}

/// The next number of a line, after `before` others of the statement `key`.
fn number(scanner: &mut Scanner, key: &str, before: usize) -> Result<Option<f64>, String> {
    scanner.number().map_err(|_| format!("number {} of `{key}` cannot be read", before + 1))
}

/// The group of an `s` statement; 0 for `off`, and for what is not a number.
fn smoothing_group(scanner: &mut Scanner) -> u32 {
    let word = scanner.word().and_then(|word| std::str::from_utf8(word).ok());
    let group: u32 = word.and_then(|word| word.parse().ok()).unwrap_or(0);
    group.min(INHERITED - MISSING - 1)
}

/// Statements of OBJ, superseded ones included, that do not change what is drawn or belong to curves and surfaces
/// (Wavefront, "Object Files", Advanced Visualizer manual, appendix B1, 1995).
const OTHERS: &str = "vp deg bmat step cstype parm trim hole scrv sp end con mg bevel c_interp d_interp lod usemap \
    maplib shadow_obj trace_obj ctech stech call csh res bsp bzp cdc cdp";
