//! Preprocessing of OBJ and MTL text for `tobj`.
//!
//! tobj 4.0.5 rejects files with a byte order mark, a continued line, a comment after a face, a tab after `mtllib` or
//! colours on only some vertices, panics on `Kd 0.5`, and reports errors without line numbers. The text is therefore
//! normalised first, keeping line numbers, and searched for the fault if parsing still fails.

use crate::error::Warnings;

/// Normalises the text of an OBJ file. Line numbers are preserved.
pub(crate) fn clean_obj(text: &str) -> String {
    let coloured = lines(text).any(|(_, line)| is_coloured_vertex(&line));
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    let mut written = 1;
    for (number, line) in lines(text) {
        while written < number {
            out.push('\n');
            written += 1;
        }
        clean_obj_line(&line, coloured, &mut out);
    }
    out.push('\n');
    out
}

/// Logical lines with the number of their first physical line. Continued lines are joined; `\n`, `\r\n` and `\r` end a
/// line.
fn lines(text: &str) -> impl Iterator<Item = (usize, std::borrow::Cow<'_, str>)> {
    // `\r\n` is split in two; the second, `\n`, is skipped.
    let mut number = 0;
    let mut physical = text.split_inclusive(['\n', '\r']).filter_map(move |line| {
        if line == "\n" && text_before(text, line).ends_with('\r') {
            return None;
        }
        number += 1;
        Some((number, line.trim_end_matches(['\n', '\r'])))
    });
    std::iter::from_fn(move || {
        let (number, line) = physical.next()?;
        let mut line = std::borrow::Cow::Borrowed(line);
        while line.ends_with('\\') && has_numbers(&line) {
            line.to_mut().pop();
            line.to_mut().push(' ');
            match physical.next() {
                Some((_, more)) => line.to_mut().push_str(more),
                None => break,
            }
        }
        Some((number, line))
    })
}

/// The part of `text` before `part`, which must be a slice of it.
fn text_before<'a>(text: &'a str, part: &str) -> &'a str {
    &text[..part.as_ptr() as usize - text.as_ptr() as usize]
}

/// Whether a line holds numbers rather than a name. Only in such lines `\` continues the line and `#` starts a comment.
fn has_numbers(line: &str) -> bool {
    matches!(line.split_whitespace().next(), Some("v" | "vn" | "vt" | "vp" | "f" | "l" | "p"))
}

/// Whether a line is a point (`p`) or line (`l`) element, which are not drawn; tobj makes triangles of polylines of
/// three points.
pub(crate) fn is_point_or_line(line: &str) -> bool {
    matches!(line.split_whitespace().next(), Some("l" | "p"))
}

fn is_coloured_vertex(line: &str) -> bool {
    let mut words = numbers_of(line).split_whitespace();
    words.next() == Some("v") && words.count() >= 6
}

fn numbers_of(line: &str) -> &str {
    line.split('#').next().unwrap_or("")
}

fn clean_obj_line(line: &str, coloured: bool, out: &mut String) {
    let line = line.trim();
    if line.starts_with('#') || is_point_or_line(line) {
        return;
    }
    if !has_numbers(line) {
        let mut words = line.splitn(2, char::is_whitespace);
        out.push_str(words.next().unwrap_or(""));
        if let Some(rest) = words.next() {
            out.push(' ');
            out.push_str(rest.trim());
        }
        if out.ends_with("usemtl") {
            // A `usemtl` without a name is dropped.
            out.truncate(out.len() - "usemtl".len());
        }
        return;
    }
    let mut count = 0;
    for word in numbers_of(line).split_whitespace() {
        if count > 0 {
            out.push(' ');
        }
        out.push_str(word);
        count += 1;
    }
    // Vertices without colour in a coloured file become white (a fourth number is a weight); a missing v becomes 0.
    match line.as_bytes() {
        [b'v', b' ' | b'\t', ..] if coloured && (4..7).contains(&count) => {
            if count > 4 {
                let extra = count - 4;
                for _ in 0..extra {
                    let cut = out.rfind(' ').unwrap_or(out.len());
                    out.truncate(cut);
                }
            }
            out.push_str(" 1 1 1");
        }
        [b'v', b't', ..] if count == 2 => out.push_str(" 0"),
        _ => {}
    }
}

/// The first faulty line of a cleaned OBJ text: its number and the error.
pub(crate) fn find_obj_fault(text: &str) -> Option<(usize, String)> {
    let [mut v, mut vt, mut vn] = [0i64; 3];
    // Faces may refer to later vertices, so indices are checked against the counts of the whole file.
    let count = |key: &str| text.lines().filter(|l| l.split_whitespace().next() == Some(key)).count() as i64;
    let totals = [count("v"), count("vt"), count("vn")];
    for (index, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let key = words.next().unwrap_or("");
        let needed = match key {
            "v" => {
                v += 1;
                3
            }
            "vn" => {
                vn += 1;
                3
            }
            "vt" => {
                vt += 1;
                2
            }
            "f" => {
                if let Some(fault) = words.find_map(|w| corner_fault(w, [v, vt, vn], totals)) {
                    return Some((index + 1, fault));
                }
                continue;
            }
            _ => continue,
        };
        let words: Vec<&str> = words.collect();
        if let Some(bad) = words.iter().find(|w| w.parse::<f64>().is_err()) {
            return Some((index + 1, format!("`{bad}` is not a number")));
        }
        if words.len() < needed {
            return Some((index + 1, format!("`{key}` with {} of {needed} numbers", words.len())));
        }
    }
    None
}

/// The error in a corner of a face, `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner_fault(corner: &str, so_far: [i64; 3], totals: [i64; 3]) -> Option<String> {
    for (((part, so_far), total), what) in
        corner.split('/').zip(so_far).zip(totals).zip(["vertex", "texture coordinate", "normal"])
    {
        if part.is_empty() && what != "vertex" {
            continue;
        }
        let Ok(i) = part.parse::<i64>() else {
            return Some(format!("`{corner}` is not a corner of a face"));
        };
        let resolved = if i < 0 { so_far + i + 1 } else { i };
        if resolved < 1 || resolved > total {
            return Some(format!("{what} {i} does not exist; the file has {total}"));
        }
    }
    (corner.split('/').count() > 3).then(|| format!("`{corner}` is not a corner of a face"))
}

/// Normalises the text of an MTL file. Invalid lines are dropped with a warning.
pub(crate) fn clean_mtl(text: &str, name: &str, warnings: &mut Warnings) -> String {
    let mut out = String::with_capacity(text.len());
    for (number, line) in lines(text) {
        let line = line.trim();
        let mut words = line.splitn(2, char::is_whitespace);
        let key = words.next().unwrap_or("");
        let rest = words.next().unwrap_or("").trim();
        match clean_mtl_value(key, rest) {
            Ok(value) => {
                out.push_str(key);
                out.push(' ');
                out.push_str(&value);
                out.push('\n');
                if let Some(multiplier) = is_bump(key).then(|| bump_multiplier(rest)).flatten() {
                    out.push_str(&format!("{BUMP_MULTIPLIER} {multiplier}\n"));
                }
            }
            Err(()) => warnings.push(format!("{name}:{number}: `{line}` left out: not understood")),
        }
    }
    out
}

fn clean_mtl_value(key: &str, rest: &str) -> Result<String, ()> {
    let numbers = || -> Result<Vec<f64>, ()> {
        numbers_of(rest).split_whitespace().map(|w| w.parse::<f64>().map_err(|_| ())).collect()
    };
    match key {
        // tobj fails on the whole file for `newmtl` or a map without a name.
        "" => Ok(String::new()),
        _ if rest.is_empty() => Err(()),
        "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => match numbers()?.as_slice() {
            // MTL allows omitting green and blue, which then equal red.
            [r] | [r, _] if is_colour(r) => Ok(format!("{r} {r} {r}")),
            [r, g, b, ..] if [r, g, b].into_iter().all(is_colour) => Ok(format!("{r} {g} {b}")),
            _ => Err(()),
        },
        "Ns" | "Ni" | "d" | "Tr" => match numbers()?.as_slice() {
            [x, ..] if x.is_finite() => Ok(x.to_string()),
            _ => Err(()),
        },
        "illum" => match numbers()?.as_slice() {
            [x, ..] if (0.0..=10.0).contains(x) => Ok((*x as u8).to_string()),
            _ => Err(()),
        },
        _ if key.starts_with("map_") || is_bump(key) || key == "norm" => Ok(file_of_map(rest)),
        _ => Ok(rest.to_owned()),
    }
}

/// Key for the bump multiplier of a material in a cleaned MTL text.
pub(crate) const BUMP_MULTIPLIER: &str = "kiln:bm";

fn is_bump(key: &str) -> bool {
    matches!(key, "bump" | "map_Bump" | "map_bump")
}

/// Value of the option `-bm` of a bump map.
fn bump_multiplier(rest: &str) -> Option<f64> {
    let mut words = rest.split_whitespace().skip_while(|word| *word != "-bm");
    words.nth(1)?.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Whether a value is a valid colour component. It may exceed 1 within the range of f32.
fn is_colour(c: &f64) -> bool {
    (0.0..=1e12).contains(c)
}

/// File name of a texture map, without the options before it (`-s 1 1 1 wood.png`).
fn file_of_map(rest: &str) -> String {
    let mut rest = rest;
    while let Some(option) = rest.strip_prefix('-') {
        let mut words = option.split_whitespace();
        let name = words.next().unwrap_or("");
        let most = match name {
            "s" | "o" | "t" => 3,
            "mm" => 2,
            "blendu" | "blendv" | "cc" | "clamp" | "imfchan" | "texres" | "bm" | "boost" | "type" => 1,
            _ => break,
        };
        let is_value = |w: &&str| most == 1 || w.parse::<f64>().is_ok();
        let values = words.take(most).take_while(is_value);
        let end = values.last().unwrap_or(name);
        rest = rest[end.as_ptr() as usize - rest.as_ptr() as usize + end.len()..].trim_start();
    }
    rest.replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_their_numbers() {
        let text = "v 0 0 0 # first\r\nf 1 2 \\\r\n3\r\n# note\r\nv 1\t2  3\n\nusemtl\ta b\n";
        assert_eq!(clean_obj(text), "v 0 0 0\nf 1 2 3\n\n\nv 1 2 3\n\nusemtl a b\n");
        // Classic Mac OS line ends.
        assert_eq!(clean_obj("v 0 0 0\rv 1 1 1\r"), "v 0 0 0\nv 1 1 1\n");
    }

    #[test]
    fn a_backslash_in_a_name_continues_nothing() {
        assert_eq!(clean_obj("usemtl a\\\nf 1 2 3\n"), "usemtl a\\\nf 1 2 3\n");
    }

    #[test]
    fn partly_coloured_vertices_become_white() {
        let text = "v 0 0 0 0.5 0.5 0.5\nv 1 0 0\nv 0 1 0 1\n";
        assert_eq!(clean_obj(text), "v 0 0 0 0.5 0.5 0.5\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\n");
        assert_eq!(clean_obj("v 0 0 0 1\n"), "v 0 0 0 1\n");
    }

    #[test]
    fn faults_have_a_line() {
        let fault = |text: &str| find_obj_fault(text).map(|(line, what)| format!("{line}: {what}"));
        let with = |line: &str| fault(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\n"));
        assert_eq!(with("f 1 2 4").unwrap(), "4: vertex 4 does not exist; the file has 3");
        assert_eq!(with("f 1 2 -4").unwrap(), "4: vertex -4 does not exist; the file has 3");
        assert_eq!(with("f 1 2 0").unwrap(), "4: vertex 0 does not exist; the file has 3");
        assert_eq!(with("f 1/1 2/1 3/1").unwrap(), "4: texture coordinate 1 does not exist; the file has 0");
        assert_eq!(with("f 1 2 x").unwrap(), "4: `x` is not a corner of a face");
        assert_eq!(with("v 1.0D+00 0 0").unwrap(), "4: `1.0D+00` is not a number");
        assert_eq!(with("vn 0 1").unwrap(), "4: `vn` with 2 of 3 numbers");
        assert_eq!(with("f 1 2 -1"), None);
    }

    #[test]
    fn mtl_values() {
        let mut warnings = Warnings::default();
        let text = "newmtl a b\nKd 0.5\nKs xyz 1 1\nKa spectral f.rfl\nillum 2\nmap_Kd -s 1 1 1 -clamp on d\\my tex.png\n";
        let clean = clean_mtl(text, "m.mtl", &mut warnings);
        assert_eq!(clean, "newmtl a b\nKd 0.5 0.5 0.5\nillum 2\nmap_Kd d/my tex.png\n");
        assert_eq!(
            warnings.messages(),
            [
                "m.mtl:3: `Ks xyz 1 1` left out: not understood",
                "m.mtl:4: `Ka spectral f.rfl` left out: not understood"
            ]
        );
    }
}
