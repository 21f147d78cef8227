//! The public interface of `kiln-bvh` is that of `tests/project/kiln-bvh-interface.txt`.
//!
//! Read from the sources: the lint `unreachable_pub`, which the gate denies, leaves `pub` to what users reach. Listed
//! are items, fields, variants, methods and implemented traits, derived ones included, but for what macros write. `pub use`
//! is listed of the crate and its module `detail`, the only ones that are public.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::repository;

const LIST: &str = "tests/project/kiln-bvh-interface.txt";

/// The text without comments, unit tests and the contents of literals.
fn code_of(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let text: String = lines.flat_map(|line| [line.split(" // ").next().unwrap_or_default(), "\n"]).collect();
    let (mut code, mut rest) = (String::new(), text.chars().peekable());
    while let Some(c) = rest.next() {
        code.push(c);
        let mut ahead = rest.clone();
        let is_char = c == '\'' && (ahead.next() == Some('\\') || ahead.next() == Some('\''));
        if c != '"' && !is_char {
            continue;
        }
        while let Some(inside) = rest.next() {
            match inside {
                '\\' => drop(rest.next()),
                _ if inside == c => break,
                _ => {}
            }
        }
        code.push(c);
    }
    code
}

/// The number of brackets that are open, those of generic arguments included.
struct Nesting(i32);

impl Nesting {
    /// That after the character at a place. Operators have spaces around them, and arrows a dash or an equals sign.
    fn after(&mut self, code: &str, at: usize, c: char) -> i32 {
        let (before, behind) = (&code[..at], &code[at + c.len_utf8()..]);
        let is_operator = match c {
            '<' => behind.starts_with([' ', '=']) || behind.starts_with("< ") || behind.starts_with("<="),
            _ => before.ends_with([' ', '-', '=']) || before.ends_with(" >"),
        };
        self.0 += match c {
            '(' | '[' => 1,
            ')' | ']' => -1,
            '<' if !is_operator => 1,
            '>' if !is_operator => -1,
            _ => 0,
        };
        self.0
    }
}

/// An item without its value, or a type without its private fields.
fn without_value(item: &str) -> String {
    let mut nesting = Nesting(0);
    let mut places = item.char_indices();
    let end = places.find(|&(at, c)| nesting.after(item, at, c) == 0 && item[at..].starts_with(" = "));
    let item = end.map_or(item, |(at, _)| &item[..at]);
    let is_private = item.starts_with("pub struct ") && !item[4..].contains("pub ");
    let item = if is_private { item.split('(').next().unwrap_or_default() } else { item };
    // As on one line.
    item.replace("( ", "(").replace(", )", ")")
}

/// A piece of code at one level of braces: up to a brace, a semicolon, or a comma if `by_commas`; and which that was.
fn next_piece<'a>(code: &mut &'a str, by_commas: bool) -> Option<(&'a str, char)> {
    let is_use = |piece: &str| {
        piece.contains("use ") && piece.trim_start().trim_start_matches("pub ").starts_with("use ")
    };
    let mut nesting = Nesting(0);
    for (at, c) in code.char_indices() {
        let piece = &code[..at];
        let nested = nesting.after(code, at, c);
        let ends = match c {
            '{' | '}' => nested == 0 && !is_use(piece),
            ';' => nested == 0,
            ',' => by_commas && nested == 0,
            _ => false,
        };
        if ends {
            *code = &code[at + 1..];
            return Some((piece.trim(), c));
        }
    }
    None
}

/// Leaves out the rest of a block in braces.
fn skip_block(code: &mut &str) {
    let mut depth = 1;
    let end = code.char_indices().find(|(_, c)| {
        depth += i32::from(*c == '{') - i32::from(*c == '}');
        depth == 0
    });
    *code = end.map_or("", |(at, _)| &code[at + 1..]);
}

/// The attributes before an item that are part of the interface, and the item, in single spaces.
fn attributes(piece: &str) -> (String, String) {
    let (mut kept, mut rest) = (String::new(), piece);
    while let Some(after) = rest.strip_prefix("#[").or_else(|| rest.strip_prefix("#![")) {
        let mut depth = 1;
        let end = after.find(|c| {
            depth += i32::from(c == '[') - i32::from(c == ']');
            depth == 0
        });
        let (attribute, after) = after.split_at(end.unwrap_or(after.len()));
        let is_kept =
            ["derive", "non_exhaustive", "deprecated"].iter().any(|name| attribute.starts_with(name));
        if is_kept {
            kept += &format!("#[{attribute}] ");
        }
        rest = after.trim_start_matches(']').trim_start();
    }
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    (words(&kept), words(rest))
}

/// The name after a keyword.
fn name_after<'a>(item: &'a str, keyword: &str) -> Option<&'a str> {
    item.strip_prefix(keyword)?.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// The last name of the type that an `impl` is of, and whether it is of a trait.
fn implemented(header: &str) -> (&str, bool) {
    let (of_trait, owner) = match header.rsplit_once(" for ") {
        Some((_, owner)) => (true, owner),
        None => (false, header.trim_start_matches("impl").trim_start()),
    };
    let owner =
        if owner.starts_with('<') { owner.split_once("> ").map_or(owner, |parts| parts.1) } else { owner };
    let path = owner.trim_start_matches(['&', ' ']).split(['<', ' ']).next().unwrap_or_default();
    (path.rsplit("::").next().unwrap_or_default(), of_trait)
}

/// The lines of the list for the text of a file; `public` are the names of public types and traits.
fn items(file: &str, mut code: &str, public: &BTreeSet<String>, lines: &mut BTreeSet<String>) {
    let exported = match file {
        "lib.rs" => Some("pub use"),
        "detail.rs" => Some("detail: pub use"),
        _ => None,
    };
    while let Some((piece, end)) = next_piece(&mut code, false) {
        let (kept, item) = attributes(piece);
        let listed = |item: &str| format!("{item} {kept}").trim_end().to_owned();
        if let Some(paths) = item.strip_prefix("pub use ") {
            let names =
                paths.split(['{', '}', ',', ' ']).map(|path| path.rsplit("::").next().unwrap_or_default());
            let names = names.filter(|name| exported.is_some() && !name.is_empty());
            lines.extend(names.map(|name| format!("{} {name}", exported.unwrap_or_default())));
        } else if item.starts_with("impl") && end == '{' {
            let (owner, of_trait) = implemented(&item);
            let mut body = code;
            skip_block(&mut code);
            if !public.contains(owner) || of_trait && item.contains("pub(crate)") {
                continue;
            }
            if of_trait {
                lines.insert(item.split(" where ").next().unwrap_or_default().to_owned());
                continue;
            }
            members(&mut body, owner, "pub ", lines);
        } else if item.starts_with("pub ") {
            let is_open = end == '{';
            lines.insert(listed(&without_value(&item)));
            let of = |keyword| name_after(&item, keyword).filter(|_| is_open);
            if let Some(name) = of("pub trait ") {
                members(&mut code, name, "", lines);
            } else if let Some(name) = of("pub enum ") {
                fields(&mut code, name, "", lines);
            } else if let Some(name) = of("pub struct ") {
                fields(&mut code, name, "pub ", lines);
            } else if is_open && of("pub mod ").is_none() {
                skip_block(&mut code);
            }
        } else if end == '{' {
            skip_block(&mut code);
        }
    }
}

/// Lists the functions, types and constants of a block.
fn members(code: &mut &str, owner: &str, prefix: &str, lines: &mut BTreeSet<String>) {
    while let Some((piece, end)) = next_piece(code, false) {
        if end == '}' {
            return;
        }
        let (_, item) = attributes(piece);
        if item.starts_with(prefix) {
            lines.insert(format!("{owner}: {}", without_value(&item)));
        }
        if end == '{' {
            skip_block(code);
        }
    }
}

/// Lists the fields or variants of a block.
fn fields(code: &mut &str, owner: &str, prefix: &str, lines: &mut BTreeSet<String>) {
    while let Some((piece, end)) = next_piece(code, true) {
        let (_, item) = attributes(piece);
        if !item.is_empty() && item.starts_with(prefix) {
            lines.insert(format!("{owner}: {item}"));
        }
        match end {
            '}' => return,
            // The fields of a variant.
            '{' => fields(code, &format!("{owner}::{item}"), "", lines),
            _ => {}
        }
    }
}

/// The names and texts of all files.
fn sources(folder: &Path, found: &mut Vec<[String; 2]>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if let Some(name) = path.file_name().filter(|name| *name != "tests.rs") {
            let text = std::fs::read_to_string(&path).expect("a source file");
            found.push([name.to_string_lossy().into_owned(), code_of(&text)]);
        }
    }
}

/// The public interface of the sources.
fn interface(sources: &[[String; 2]]) -> BTreeSet<String> {
    let names = sources.iter().flat_map(|[_, code]| code.lines()).filter_map(|line| {
        let line = line.trim_start();
        ["pub struct ", "pub enum ", "pub trait ", "pub type "]
            .iter()
            .find_map(|keyword| name_after(line, keyword))
    });
    let public: BTreeSet<String> = names.map(str::to_owned).collect();
    let mut lines = BTreeSet::new();
    sources.iter().for_each(|[file, code]| items(file, code, &public, &mut lines));
    lines
}

#[test]
fn the_interface_of_the_ray_queries_is_the_accepted_one() {
    let mut all = Vec::new();
    sources(&repository("crates/bvh/src"), &mut all);
    let now: String = interface(&all).into_iter().flat_map(|line| [line, "\n".into()]).collect();
    let accepted = std::fs::read_to_string(repository(LIST)).unwrap_or_default();
    if now == accepted {
        return;
    }
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<BTreeSet<String>>();
    let (before, after) = (lines(&accepted), lines(&now));
    let marked = |mark: &str, a: &BTreeSet<String>, b: &BTreeSet<String>| -> String {
        a.difference(b).map(|line| format!("{mark} {line}\n")).collect()
    };
    let candidate = Path::new(env!("CARGO_TARGET_TMPDIR")).join("kiln-bvh-interface.txt");
    std::fs::write(&candidate, &now).expect("a file in the target folder");
    panic!(
        "the public interface of kiln-bvh has changed:\n{}{}If that is meant, say so in CHANGELOG.md, and: cp {} {LIST}",
        marked("-", &before, &after),
        marked("+", &after, &before),
        candidate.display()
    );
}

#[test]
fn the_front_page_is_short() {
    let list = std::fs::read_to_string(repository(LIST)).expect("the list");
    let names = list.lines().filter(|line| line.starts_with("pub use ") || line.starts_with("pub mod "));
    assert!(names.count() <= 60, "what few need belongs into `kiln_bvh::detail`");
}

#[test]
fn items_of_all_kinds_are_listed() {
    let code = code_of(
        r#"
//! pub fn not_this() {}
#![warn(unreachable_pub)]
pub mod first;
const SHIFTED: usize = 1 << 5;
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Kind<T: Into<f64>> {
    /// One.
    One(T, u32), // pub
    Two { a: [f64; 2], b: Option<Box<dyn Fn(u8) -> u8>> },
}
pub struct Pair(pub f64, u8);
pub struct Point {
    #[allow(unused)]
    pub x: f64,
    y: f64,
}
struct Hidden { pub x: f64 }
impl Hidden { pub fn f(&self) {} }
impl std::fmt::Display for Hidden { fn fmt(&self) {} }
impl<T> From<T> for Kind<T> where T: Into<f64> { fn from(x: T) -> Self { Kind::One(x, 0) } }
impl Point {
    pub const ORIGIN: Point = Point { x: 0.0, y: 0.0 };
    pub fn f<'a>(&'a self, text: &str) -> Vec<&'a f64> { if text == "}" || '{' == '\'' { return vec![]; } loop {} }
    pub fn all(
        it: impl Iterator<Item = u8>,
        most: usize,
    ) -> [u8; 1 << 3] {
        if 1 < 2 && 3 >= most { it >> 2 }
    }
    pub(crate) fn g(&self) {}
    fn h(&self) {}
}
pub trait Shape: Send {
    fn bounds(&self) -> [f64; 2];
    fn is_closed(&self) -> bool { false }
}
pub const LIST: [f64; 2] = [1.0, 2.0];
pub use inner::{First, deep::Second};
pub mod inner;
#[deprecated(note = "old")]
pub type Old = Point;
fn private() { pub_fn(); }
#[cfg(test)]
mod tests {
    pub fn test() {}
}
"#,
    );
    let expected = [
        "Kind: One(T, u32)",
        "Kind: Two",
        "Kind::Two: a: [f64; 2]",
        "Kind::Two: b: Option<Box<dyn Fn(u8) -> u8>>",
        "Point: pub const ORIGIN: Point",
        "Point: pub fn all(it: impl Iterator<Item = u8>, most: usize) -> [u8; 1 << 3]",
        "Point: pub fn f<'a>(&'a self, text: &str) -> Vec<&'a f64>",
        "Point: pub x: f64",
        "Shape: fn bounds(&self) -> [f64; 2]",
        "Shape: fn is_closed(&self) -> bool",
        "impl<T> From<T> for Kind<T>",
        "pub const LIST: [f64; 2]",
        "pub enum Kind<T: Into<f64>> #[derive(Debug, Clone)] #[non_exhaustive]",
        "pub mod first",
        "pub mod inner",
        "pub struct Pair(pub f64, u8)",
        "pub struct Point",
        "pub trait Shape: Send",
        "pub type Old #[deprecated(note = \"\")]",
        "pub use First",
        "pub use Second",
    ];
    assert_eq!(interface(&[["lib.rs".into(), code]]).into_iter().collect::<Vec<_>>(), expected);
}
