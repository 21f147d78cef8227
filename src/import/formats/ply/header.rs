//! Headers of PLY files.

use crate::error::{Error, Place, Result};
use crate::import::Source;
use crate::import::text::values::{Encoding, Kind, Scalar};

impl Scalar {
    /// The type of this name in headers.
    fn named(name: &str) -> Option<Self> {
        let (kind, size) = match name {
            "char" | "int8" => (Kind::Signed, 1),
            "short" | "int16" => (Kind::Signed, 2),
            "int" | "int32" => (Kind::Signed, 4),
            // Those of 8 bytes are written by trimesh and VTK.
            "int64" => (Kind::Signed, 8),
            "uchar" | "uint8" => (Kind::Unsigned, 1),
            "ushort" | "uint16" => (Kind::Unsigned, 2),
            "uint" | "uint32" => (Kind::Unsigned, 4),
            "uint64" => (Kind::Unsigned, 8),
            "float" | "float32" => (Kind::Float, 4),
            "double" | "float64" => (Kind::Float, 8),
            _ => return None,
        };
        Some(Scalar { kind, size })
    }

    /// Value of a colour channel that stands for white.
    pub(crate) fn white(self) -> f64 {
        match (self.kind, self.size) {
            (Kind::Float, _) => 1.0,
            (Kind::Unsigned, 2) => 65535.0,
            _ => 255.0,
        }
    }

    /// Unsigned value of a colour channel; some exporters declare bytes as `char`.
    pub(crate) fn unsigned(self, value: f64) -> f64 {
        if (self.kind, self.size) == (Kind::Signed, 1) && value < 0.0 { value + 256.0 } else { value }
    }
}

/// A property of an element: a value, or a list of values.
pub(crate) struct Property {
    pub name: String,
    /// The type of a list's length; `None` for a single value.
    pub length: Option<Scalar>,
    pub scalar: Scalar,
}

/// A kind of element: vertices, faces, or others.
pub(crate) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
    /// Line number of its declaration.
    pub line: usize,
}

impl Element {
    /// Minimum size of one element in bytes. An ASCII value takes a digit and a separator.
    pub(crate) fn least_bytes(&self, encoding: Encoding) -> u64 {
        let of = |property: &Property| match encoding {
            Encoding::Ascii => 2,
            _ => property.length.unwrap_or(property.scalar).size as u64,
        };
        self.properties.iter().map(of).sum()
    }
}

/// A parsed header.
pub(crate) struct Header {
    /// Encoding of the values.
    pub encoding: Encoding,
    /// The elements in their order.
    pub elements: Vec<Element>,
    /// Image names in `comment TextureFile`, as written by MeshLab.
    pub texture_files: Vec<String>,
    /// Number of lines that are no statements, and the first of them.
    pub unknown: Option<(usize, usize)>,
    /// Length of the header in bytes.
    pub bytes: usize,
    /// Length of the header in lines.
    pub lines: usize,
}

impl Header {
    /// Parses the header of a file.
    pub(crate) fn parse(source: &Source) -> Result<Self> {
        let bytes = source.bytes.as_slice();
        let error = |line: usize, what: String, hint: &str| {
            Err(Error::input(Place::line(&source.file, line), what, hint))
        };
        // If the first line ends with a lone `\r`, all lines do: a `\n` after the last may be the first byte of binary
        // data. Otherwise lines end with `\n`, and a `\r` before it is white space.
        let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(bytes.len());
        let (end, skipped) = match bytes[first..] {
            [b'\r', b'\n', ..] => (b'\n', 2),
            [b'\r', ..] => (b'\r', 1),
            _ => (b'\n', 1),
        };
        if bytes[..first].trim_ascii_end() != b"ply" {
            return error(1, "a PLY file begins with `ply`".into(), "export the file again, as PLY");
        }
        let (mut at, mut lines) = (first + skipped, 1);
        let (mut encoding, mut elements, mut texture_files) = (None, Vec::new(), Vec::new());
        let mut unknown = None;
        loop {
            let rest = bytes.get(at..).unwrap_or_default();
            let Some(length) = rest.iter().position(|&b| b == end) else {
                let what = "the header does not end with a line `end_header`";
                return error(lines, what.into(), "export the file again");
            };
            at += length + 1;
            lines += 1;
            let line = String::from_utf8_lossy(&rest[..length]);
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if words.first() == Some(&"end_header") {
                break;
            }
            if let ["comment", key, ..] = words[..]
                && key.eq_ignore_ascii_case("TextureFile")
            {
                // The name may have spaces.
                let name = line.split_once(key).map_or("", |(_, name)| name.trim());
                texture_files.extend((!name.is_empty()).then(|| name.to_owned()));
            }
            match take_line(&words, lines, &mut encoding, &mut elements) {
                Ok(true) => {}
                Ok(false) => {
                    let (count, first) = unknown.unwrap_or((0, lines));
                    unknown = Some((count + 1, first));
                }
                Err(what) => return error(lines, what, "correct the header"),
            }
        }
        let Some(encoding) = encoding else {
            return error(lines, "the header has no line `format`".into(), "export the file again");
        };
        Ok(Header { encoding, elements, texture_files, unknown, bytes: at, lines })
    }
}

/// Parses the words of a header line. Returns whether it is a statement.
///
/// # Errors
/// It is invalid, or none but like one that changes the layout of the values.
fn take_line(
    words: &[&str],
    line: usize,
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> std::result::Result<bool, String> {
    match words {
        [] | ["comment" | "obj_info", ..] => {}
        ["format", name, ..] => {
            *encoding = Some(match *name {
                "ascii" => Encoding::Ascii,
                "binary_little_endian" => Encoding::LittleEndian,
                "binary_big_endian" => Encoding::BigEndian,
                _ => return Err("not a format of PLY files after `format`".into()),
            });
        }
        ["element", name, count, ..] => {
            let Ok(count) = count.parse() else {
                return Err("`element` without a number of elements".into());
            };
            elements.push(Element { name: (*name).into(), count, properties: Vec::new(), line });
        }
        ["property", property @ ..] => {
            let Some(element) = elements.last_mut() else {
                return Err("a property before the first element".into());
            };
            let scalar =
                |name: &str| Scalar::named(name).ok_or("`property` of a type that PLY files do not have");
            let (length, scalar, name) = match property {
                ["list", length, value, name, ..] => (Some(scalar(length)?), scalar(value)?, name),
                [value, name, ..] if *value != "list" => (None, scalar(value)?, name),
                _ => return Err("a property without a type or a name".into()),
            };
            element.properties.push(Property { name: (*name).into(), length, scalar });
        }
        [word, ..] => {
            let word = word.to_ascii_lowercase();
            if ["format", "element", "propert", "end"].iter().any(|statement| word.starts_with(statement)) {
                return Err("not a statement of PLY headers".into());
            }
            return Ok(false);
        }
    }
    Ok(true)
}
