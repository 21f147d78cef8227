//! MTL files, by `tobj`.
//!
//! tobj 4.0.5 parses the common keys and returns the others as text, but panics on `Kd 0.5`, gives up the whole file for one
//! bad line, and takes the options of maps for parts of their names. The text is therefore normalised first: lines that
//! it would not understand are left out with a warning, and options are read here.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DVec2, dvec2};

use crate::error::{Warnings, contain};
use crate::files::unreadable;
use crate::import::Source;
use crate::import::files::references::unquoted;
use crate::import::formats::obj::text::decode_name;
use crate::import::formats::obj::{exporters, pbr};
use crate::import::text::lines::{Lines, decode};
use crate::scene::{ImageId, Texture, TextureSampler, Wrap};

/// A material of an MTL file.
#[derive(Debug, Default)]
pub(super) struct Definition {
    /// What tobj read.
    pub material: tobj::Material,
    /// Options of maps by the key of the map; those of bump maps by `bump`.
    options: BTreeMap<String, MapOptions>,
}

/// Options of a map that are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MapOptions {
    /// `-s`: factor of the texture coordinates.
    scale: DVec2,
    /// `-o`: added to them.
    offset: DVec2,
    /// `-clamp`.
    is_clamped: bool,
    /// `-bm`: factor of the heights of a bump map.
    pub multiplier: f64,
}

impl Default for MapOptions {
    fn default() -> Self {
        MapOptions { scale: DVec2::ONE, offset: DVec2::ZERO, is_clamped: false, multiplier: 1.0 }
    }
}

/// Maps that are read.
const MAPS: [&str; 7] = ["map_Kd", "map_d", "bump", "norm", "map_Pr", "map_Pm", "map_Ke"];

impl Definition {
    /// The options of a map.
    pub(super) fn options(&self, key: &str) -> MapOptions {
        self.options.get(key).copied().unwrap_or_default()
    }

    /// A texture of the map `key`.
    pub(super) fn texture(&self, image: ImageId, key: &str) -> Texture {
        let wrap = if self.options(key).is_clamped { Wrap::ClampToEdge } else { Wrap::Repeat };
        let sampler = TextureSampler { wrap_u: wrap, wrap_v: wrap, ..TextureSampler::default() };
        Texture { image, sampler, coordinates: 0 }
    }

    /// Factor of the texture coordinates of the first map, and what is added to them, if that changes them. All maps of
    /// a material have the same coordinates.
    pub(super) fn transform(&self, file: &Path, warnings: &mut Warnings) -> Option<(DVec2, DVec2)> {
        let of = |key: &&str| self.options.get(*key).map(|options| (options.scale, options.offset));
        let mut all = MAPS.iter().filter_map(of);
        let first = all.next()?;
        if all.any(|other| other != first) {
            let (file, name) = (file.display(), &self.material.name);
            let what = "has maps of several -s or -o; drawn with those of the first";
            warnings.left_out(format!("{file}: material `{name}` {what}"));
        }
        (first != (DVec2::ONE, DVec2::ZERO)).then_some(first)
    }
}

/// Reads the MTL files of a `mtllib` line, one after the other. Unreadable files are left out with a warning.
pub(super) fn read(source: &Source, line: &str, warnings: &mut Warnings) -> Vec<Vec<Definition>> {
    let names = if is_there(source, line) { vec![line] } else { names(line) };
    // The OBJ and its MTL file may have been renamed together.
    let own = source.file.file_stem().map(|stem| format!("{}.mtl", stem.to_string_lossy()));
    let own = own.as_deref().filter(|_| names.len() == 1);
    names.into_iter().map(|name| read_one(source, name, own, warnings)).collect()
}

/// File names of a line: each ends in `.mtl` and may contain spaces. The whole line if none does.
fn names(line: &str) -> Vec<&str> {
    const ENDING: &str = ".mtl";
    let lower_case = line.to_ascii_lowercase();
    let mut names = Vec::new();
    let mut start = 0;
    for (at, _) in lower_case.match_indices(ENDING) {
        let mut end = at + ENDING.len();
        end += usize::from(line[end..].starts_with(['"', '\'']));
        if line[end..].chars().next().is_none_or(char::is_whitespace) {
            names.push(line[start..end].trim());
            start = end;
        }
    }
    if names.is_empty() { vec![line] } else { names }
}

/// Whether a file that `source` references exists as written.
fn is_there(source: &Source, name: &str) -> bool {
    source.as_written(name).is_ok_and(|file| source.files.has(&file))
}

fn read_one(source: &Source, name: &str, own: Option<&str>, warnings: &mut Warnings) -> Vec<Definition> {
    let read = source.resolve_or(name, own).and_then(|path| {
        let bytes = source.files.read(&path).map_err(|e| unreadable(&path, &e).to_string())?;
        Ok((path, bytes))
    });
    let (path, bytes) = match read {
        Ok(read) => read,
        Err(what) => {
            warnings.left_out_file(format!("{}: materials left out: {what}", source.file.display()));
            return Vec::new();
        }
    };
    let (text, options) = normalise(&bytes, &path.display().to_string(), warnings);
    let read = contain(|| tobj::load_mtl_buf(&mut text.as_bytes()));
    let mut materials = match read.unwrap_or(Err(tobj::LoadError::GenericFailure)) {
        Ok((materials, _)) => materials,
        Err(e) => {
            warnings.left_out(format!("{}: materials left out: {e}", path.display()));
            return Vec::new();
        }
    };
    exporters::convert(&mut materials, &path, warnings);
    let folder = source.file.parent().unwrap_or(Path::new(""));
    find_images(&mut materials, path.strip_prefix(folder).unwrap_or(&path), source);
    let options = options.into_iter().chain(std::iter::repeat_with(BTreeMap::new));
    materials.into_iter().zip(options).map(|(material, options)| Definition { material, options }).collect()
}

/// Searches images beside the MTL file `name`, then beside the OBJ, because exporters write paths relative to either.
fn find_images(materials: &mut [tobj::Material], name: &Path, source: &Source) {
    let Some(folder) = name.parent().filter(|folder| !folder.as_os_str().is_empty()) else { return };
    let images = materials.iter_mut().flat_map(|m| {
        let others = m.unknown_param.iter_mut();
        let others = others.filter(|(key, _)| *key == "norm" || pbr::MAPS.contains(&key.as_str()));
        let textures = [m.diffuse_texture.as_mut(), m.dissolve_texture.as_mut(), m.normal_texture.as_mut()];
        let textures = textures.into_iter().flatten();
        textures.chain(others.map(|(_, image)| image))
    });
    for image in images {
        let beside = folder.join(&*image).to_string_lossy().into_owned();
        if is_there(source, &beside) {
            *image = beside;
        }
    }
}

/// Normalises the text of an MTL file. Returns it without invalid lines, of which it warns, and the options of the maps
/// of each material.
fn normalise(
    bytes: &[u8],
    file: &str,
    warnings: &mut Warnings,
) -> (String, Vec<BTreeMap<String, MapOptions>>) {
    let mut out = String::with_capacity(bytes.len());
    let mut options: Vec<BTreeMap<String, MapOptions>> = Vec::new();
    let mut unused = BTreeSet::new();
    let mut spelled = None;
    for (number, line) in Lines::new(&decode(bytes), 0) {
        let line = decode_name(line.trim_ascii());
        let (written, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let rest = rest.trim();
        let key = canonical(written);
        if key != written {
            spelled.get_or_insert_with(|| (number, key.to_owned()));
        }
        let Some(value) = normalise_value(key, rest) else {
            let what = match is_known(key) {
                true => format!("`{key}` left out: an invalid value"),
                false => "left out: not a statement of MTL files".into(),
            };
            warnings.left_out(format!("{file}:{number}: {what}"));
            continue;
        };
        out.push_str(&format!("{key} {value}\n"));
        let map = if matches!(key, "map_Bump" | "map_bump") { "bump" } else { key };
        if key == "newmtl" {
            options.push(BTreeMap::new());
        } else if MAPS.contains(&map) {
            let (made, left_out, _) = split_options(rest);
            for option in left_out {
                warnings.left_out(format!("{file}:{number}: the option -{option} of `{key}` is left out"));
            }
            options.last_mut().map(|options| options.insert(map.into(), made));
        } else if is_map(key) || key == "sharpness" {
            unused.insert(if is_known(key) { key.to_owned() } else { "unknown maps".into() });
        }
        if key == "d" && rest.starts_with("-halo") {
            warnings.left_out(format!("{file}:{number}: the option -halo of `d` is left out"));
        }
    }
    if let Some((number, key)) = spelled {
        warnings.note(format!("{file}:{number}: `{key}` in another case; keywords are read in any case"));
    }
    if !unused.is_empty() {
        let unused: Vec<String> = unused.into_iter().collect();
        warnings.note_left_out(format!("{file}: not used: {}", unused.join(", ")));
    }
    (out, options)
}

/// The value of a line as tobj reads it; `None` if it is invalid.
fn normalise_value(key: &str, rest: &str) -> Option<String> {
    let numbers = |rest: &str| -> Option<Vec<f64>> {
        let numbers = rest.split('#').next().unwrap_or("");
        numbers.split_whitespace().map(|word| word.parse().ok()).collect()
    };
    match key {
        // tobj fails on the whole file for `newmtl` or a map without a name.
        _ if key.is_empty() || key.starts_with('#') => Some(String::new()),
        _ if rest.is_empty() => None,
        "newmtl" => Some(unquoted(rest).to_owned()),
        "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => match numbers(rest)?.as_slice() {
            // MTL allows omitting green and blue, which then equal red.
            [r] | [r, _] if is_colour(r) => Some(format!("{r} {r} {r}")),
            [r, g, b, ..] if [r, g, b].into_iter().all(is_colour) => Some(format!("{r} {g} {b}")),
            _ => None,
        },
        "Ns" | "Ni" | "d" | "Tr" => match numbers(rest.strip_prefix("-halo").unwrap_or(rest))?.as_slice() {
            [x, ..] if x.is_finite() => Some(x.to_string()),
            _ => None,
        },
        "illum" => match numbers(rest)?.as_slice() {
            [x, ..] if (0.0..=10.0).contains(x) => Some((*x as u8).to_string()),
            _ => None,
        },
        _ if is_map(key) => Some(split_options(rest).2),
        _ => Some(rest.to_owned()),
    }
}

/// Keys that messages may quote: those of the format (Wavefront, "MTL material format", 1995), of its extension by
/// physically based materials, and common misspellings of maps. Other text may be anything.
const KEYS: &str = "newmtl Ka Kd Ks Ke Tf Ns Ni d Tr illum sharpness Pr Pm Ps Pc Pcr aniso anisor map_Ka map_Kd map_Ks \
    map_Ke map_Ns map_Ni map_d map_Tr map_aat map_Bump map_bump map_opacity map_refl map_disp map_Disp map_Pr map_Pm \
    map_Ps map_Pc map_Pcr map_RMA map_ORM bump norm disp decal refl";

/// Canonical spelling of a known key, ignoring case; other keys as they are.
fn canonical(key: &str) -> &str {
    if is_known(key) {
        return key;
    }
    KEYS.split(' ').find(|known| known.eq_ignore_ascii_case(key)).unwrap_or(key)
}

fn is_known(key: &str) -> bool {
    KEYS.split(' ').any(|known| known == key)
}

/// Whether the value of a key is a file, with options before it.
fn is_map(key: &str) -> bool {
    key.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("map_"))
        || matches!(key, "bump" | "norm" | "disp" | "decal" | "refl")
}

/// Whether a value is a valid colour component. It may exceed 1 within the range of f32.
fn is_colour(c: &f64) -> bool {
    (0.0..=1e12).contains(c)
}

/// Maximum number of arguments of a map option; `None` for unknown options.
fn arity(option: &str) -> Option<usize> {
    match option {
        "s" | "o" | "t" => Some(3),
        "mm" => Some(2),
        "blendu" | "blendv" | "cc" | "clamp" | "imfchan" | "texres" | "bm" | "boost" | "type"
        | "colorspace" => Some(1),
        _ => None,
    }
}

/// Offset of the first map option after a space in `text`; the length of `text` if there is none.
fn next_option(text: &str) -> usize {
    let is_option = |&(at, _): &(usize, &str)| {
        text[at + 2..].split_whitespace().next().is_some_and(|name| arity(name).is_some())
            && !text[at + 2..].starts_with(char::is_whitespace)
    };
    text.match_indices(" -").find(is_option).map_or(text.len(), |(at, _)| at)
}

/// Splits the value of a map, such as `-s 1 1 1 wood.png`, into its options, the names of those that are left out and
/// change the image, and the file name, which may contain spaces. Some exporters write options after the name.
fn split_options(value: &str) -> (MapOptions, Vec<&str>, String) {
    let mut rest = value.trim();
    let (mut options, mut left_out, mut file) = (MapOptions::default(), Vec::new(), "");
    while !rest.is_empty() {
        let mut words = rest.strip_prefix('-').unwrap_or("").split_whitespace();
        let name = words.next().unwrap_or("");
        let Some(most) = arity(name) else {
            if !file.is_empty() {
                break;
            }
            let (before, behind) = rest.split_at(next_option(rest));
            (file, rest) = (before.trim_end(), behind.trim_start());
            continue;
        };
        let is_value = |word: &&str| most == 1 || word.parse::<f64>().is_ok();
        let values: Vec<&str> = words.take(most).take_while(is_value).collect();
        let number = |i: usize, default: f64| {
            let number = values.get(i).and_then(|word| word.parse().ok());
            number.filter(|number: &f64| number.is_finite()).unwrap_or(default)
        };
        // What is not given of `-s` is 1, and of `-o` and `-t` 0.
        match (name, values.first().copied()) {
            ("s", _) => options.scale = dvec2(number(0, 1.0), number(1, 1.0)),
            ("o", _) => options.offset = dvec2(number(0, 0.0), number(1, 0.0)),
            ("bm", _) => options.multiplier = number(0, 1.0),
            ("clamp", value) => options.is_clamped = value == Some("on"),
            ("t", _) if (0..3).all(|i| number(i, 0.0) == 0.0) => {}
            ("mm", _) if (number(0, 0.0), number(1, 1.0)) == (0.0, 1.0) => {}
            ("blendu" | "blendv", Some("on"))
            | ("cc", Some("off"))
            | ("texres" | "type" | "colorspace", _) => {}
            _ => left_out.push(name),
        }
        let end = values.last().unwrap_or(&name);
        rest = rest[end.as_ptr() as usize - rest.as_ptr() as usize + end.len()..].trim_start();
    }
    (options, left_out, unquoted(file).replace("\\ ", " ").replace('\\', "/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_a_line() {
        assert_eq!(names("a b.mtl  c.MTL"), ["a b.mtl", "c.MTL"]);
        assert_eq!(names(r#""a b.mtl" c.mtl # both"#), [r#""a b.mtl""#, "c.mtl"]);
        assert_eq!(names("a.mtl.bak"), ["a.mtl.bak"]);
        assert_eq!(names("a.mat"), ["a.mat"]);
    }

    #[test]
    fn options_of_maps() {
        let split = |value| {
            let (MapOptions { scale, offset, is_clamped, multiplier }, left_out, file) = split_options(value);
            (scale.to_array(), offset.to_array(), is_clamped, multiplier, left_out.join(" "), file)
        };
        let plain = ([1.0, 1.0], [0.0, 0.0], false, 1.0, String::new());
        let with = |file: &str| (plain.0, plain.1, plain.2, plain.3, plain.4.clone(), file.to_owned());
        assert_eq!(split("a b.png"), with("a b.png"));
        assert_eq!(split("-blendu on -blendv on -mm 0 1 -t 0 -cc off -type sphere 2 a.png"), with("2 a.png"));
        assert_eq!(split("-x.png"), with("-x.png"));
        assert_eq!(split(r#"-colorspace sRGB "a - b -sky.png""#), with("a - b -sky.png"));
        assert_eq!(split(r"C:\a\my\ b.png"), with("C:/a/my b.png"));
        let behind = ([1.0, 1.0], [0.0, 0.0], true, 1.5, "imfchan".into(), "a b.png".into());
        assert_eq!(split("-imfchan r a b.png -bm 1.5 -clamp on"), behind);
        // A number after the least that an option takes is an argument of it.
        let all =
            "-s 2 -o 0.25 -0.5 0 -clamp on -bm 0.3 -mm 0 2 -t 1 -imfchan r -boost 2 -blendu off d\\a.png";
        let left_out = "mm t imfchan boost blendu";
        assert_eq!(split(all), ([2.0, 1.0], [0.25, -0.5], true, 0.3, left_out.into(), "d/a.png".into()));
    }
}
