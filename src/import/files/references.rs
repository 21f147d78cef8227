//! Resolution of file names in inputs: as written, else by a search below the folder of the input that ignores case,
//! Unicode normalization and folders. The search does not follow links that lead out of the folder.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

use unicode_normalization::UnicodeNormalization;

use crate::error::Warnings;
use crate::import::Source;

/// Maximum number of directory entries in a search. Larger folders, such as one of downloads, are not searched, because
/// the result would depend on the listing order.
const MAX_ENTRIES: usize = 20_000;

/// Maximum depth of the search.
const MAX_DEPTH: usize = 8;

/// Maximum number of candidates in a message.
const MAX_NAMED: usize = 4;

/// Cached directory listings, and notes about files found.
#[derive(Default)]
pub(crate) struct DirectoryCache {
    folders: HashMap<PathBuf, Rc<Listing>>,
    /// Files below each folder: relative paths by [`key`].
    trees: HashMap<PathBuf, Rc<HashMap<String, Vec<PathBuf>>>>,
    notes: Vec<String>,
}

/// Directory entries by [`key`].
type Listing = HashMap<String, Vec<Entry>>;

#[derive(Clone)]
struct Entry {
    name: OsString,
    /// `false` for links to folders.
    is_folder: bool,
}

impl Source {
    /// Resolves a file reference to a path in the folder of this file or below, unless the options allow others.
    ///
    /// Candidates in order: the path as written, following symbolic links; a path that differs only in case or Unicode
    /// normalization; a file of the same name anywhere below the folder. The latter two are also tried without quotes,
    /// without a trailing comment and percent-decoded, and a note names the file found. If no file exists, the path as
    /// written is returned.
    ///
    /// # Errors
    /// A message if the reference leads out of the folder or is ambiguous.
    pub(crate) fn resolve_reference(&self, name: &str) -> Result<PathBuf, String> {
        self.resolve_or(name, None)
    }

    /// As [`Source::resolve_reference`], with the file `other` in the folder as the last candidate.
    pub(crate) fn resolve_or(&self, name: &str, other: Option<&str>) -> Result<PathBuf, String> {
        let written = self.as_written(name);
        if written.as_ref().is_ok_and(|path| self.files.has(path)) {
            return written;
        }
        let missing = || match names_tiles(name) {
            true => Err(format!("`{name}`: UDIM tiles are not read; bake them into one image")),
            false => written,
        };
        if self.file == Path::new("-") {
            return missing();
        }
        let names = spellings(name);
        let by_case = names.iter().map(|name| self.spelled_alike(Path::new(name)));
        let anywhere = names.iter().map(|name| self.anywhere_below(Path::new(name)));
        let by_other = other.into_iter().map(|other| self.spelled_alike(Path::new(other)));
        let Some(found) = by_case.chain(anywhere).chain(by_other).find(|found| !found.is_empty()) else {
            return missing();
        };
        if let [one] = &found[..] {
            return Ok(self.noted(name, one));
        }
        let named: Vec<String> =
            found.iter().take(MAX_NAMED).map(|path| format!("`{}`", path.display())).collect();
        let more = if found.len() > MAX_NAMED { ", …" } else { "" };
        Err(format!("`{name}` does not exist; candidates: {}{more}; rename one of them", named.join(", ")))
    }

    /// Path of a reference of a scene file, which may lead anywhere: as written, or a path in its folder or below that
    /// differs only in case or Unicode normalization, with a note.
    pub(crate) fn resolve_scene_reference(&self, name: &str) -> PathBuf {
        let written = self.beside(name);
        if self.files.has(&written) {
            return written;
        }
        match &self.spelled_alike(Path::new(name))[..] {
            [one] => self.noted(name, one),
            _ => written,
        }
    }

    /// The path of a file, with a note that it is read in place of `name`.
    fn noted(&self, name: &str, found: &Path) -> PathBuf {
        let note = format!("{}: `{name}` is read from `{}`", self.file.display(), found.display());
        self.files.listings.borrow_mut().notes.push(note);
        self.beside(found)
    }

    /// Path of a reference as written; the file need not exist.
    ///
    /// # Errors
    /// A message if it leads out of the folder.
    pub(crate) fn as_written(&self, name: &str) -> Result<PathBuf, String> {
        let path = PathBuf::from(name.replace('\\', "/"));
        if !self.options.allow_outside_references && leaves_folder(&path) {
            return Err(format!(
                "`{name}` is outside the file's folder; --allow-outside-references reads it, too"
            ));
        }
        Ok(self.beside(path))
    }

    /// Path of a referenced image; `None` with a warning if it cannot be resolved.
    pub(crate) fn resolve_image(&self, name: &str, warnings: &mut Warnings) -> Option<PathBuf> {
        let resolved = self.resolve_reference(name);
        let warn =
            |what| warnings.left_out_file(format!("{}: texture left out: {what}", self.file.display()));
        resolved.map_err(warn).ok()
    }

    /// Moves the collected notes to `warnings`.
    pub(crate) fn note_references(&self, warnings: &mut Warnings) {
        self.files.listings.borrow_mut().notes.drain(..).for_each(|note| warnings.note(note));
    }

    /// Files whose relative path equals `path` except for case and Unicode normalization. An exact match is the only
    /// result.
    fn spelled_alike(&self, path: &Path) -> Vec<PathBuf> {
        if leaves_folder(path) {
            return Vec::new();
        }
        let mut all = vec![PathBuf::new()];
        for component in path.components() {
            all = match component {
                Component::Normal(name) => {
                    let entries = all.iter().map(|folder| (folder, self.listing(folder)));
                    let named = entries.flat_map(|(folder, listing)| {
                        let entries = listing.get(&key(Path::new(name))).cloned().unwrap_or_default();
                        entries.into_iter().map(|entry| folder.join(entry.name))
                    });
                    same_name_first(named.collect(), name)
                }
                // All candidates have the same depth and root.
                _ => {
                    if component == Component::ParentDir {
                        all.iter_mut().for_each(|path| _ = path.pop());
                        all.dedup();
                    }
                    all
                }
            };
        }
        self.files_inside(all)
    }

    /// Files with the name of `path` anywhere below the folder.
    fn anywhere_below(&self, path: &Path) -> Vec<PathBuf> {
        let named = self.tree().get(&key(path)).cloned().unwrap_or_default();
        self.files_inside(same_name_first(named, path_name(path)))
    }

    /// Keeps the relative paths to files inside the folder after following links.
    fn files_inside(&self, mut paths: Vec<PathBuf>) -> Vec<PathBuf> {
        let folder = self.folder().canonicalize().ok();
        paths.retain(|path| {
            let real = self.folder().join(path).canonicalize();
            real.is_ok_and(|real| {
                real.is_file() && folder.as_ref().is_some_and(|folder| real.starts_with(folder))
            })
        });
        paths
    }

    fn folder(&self) -> &Path {
        let folder = self.file.parent().unwrap_or(Path::new(""));
        if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
    }

    /// Cached listing of a subfolder.
    fn listing(&self, below: &Path) -> Rc<Listing> {
        let folder = self.folder().join(below);
        let mut listings = self.files.listings.borrow_mut();
        let listing = listings.folders.entry(folder).or_insert_with_key(|folder| Rc::new(list(folder)));
        listing.clone()
    }

    /// Files below the folder, without hidden folders and links to folders. Empty above [`MAX_ENTRIES`].
    fn tree(&self) -> Rc<HashMap<String, Vec<PathBuf>>> {
        if let Some(tree) = self.files.listings.borrow().trees.get(self.folder()) {
            return tree.clone();
        }
        let mut tree: HashMap<String, Vec<PathBuf>> = HashMap::new();
        let (mut level, mut count) = (vec![PathBuf::new()], 0);
        for _ in 0..MAX_DEPTH {
            let mut next = Vec::new();
            for folder in level {
                let listing = self.listing(&folder);
                count += listing.values().map(Vec::len).sum::<usize>();
                if count > MAX_ENTRIES {
                    break;
                }
                for (key, entries) in listing.iter() {
                    let is_hidden = key.starts_with('.');
                    for Entry { name, is_folder } in entries {
                        let path = folder.join(name);
                        match is_folder {
                            true if is_hidden => {}
                            true => next.push(path),
                            false => tree.entry(key.clone()).or_default().push(path),
                        }
                    }
                }
            }
            level = next;
        }
        if count > MAX_ENTRIES {
            tree.clear();
        }
        tree.values_mut().for_each(|paths| paths.sort_unstable());
        let tree = Rc::new(tree);
        self.files.listings.borrow_mut().trees.insert(self.folder().to_owned(), tree.clone());
        tree
    }
}

/// Entries of a folder; empty if it cannot be listed or has more than [`MAX_ENTRIES`].
fn list(folder: &Path) -> Listing {
    let mut listing = Listing::new();
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for (index, entry) in entries.enumerate() {
        if index == MAX_ENTRIES {
            return Listing::new();
        }
        let (name, is_folder) = (entry.file_name(), entry.file_type().is_ok_and(|kind| kind.is_dir()));
        listing.entry(key(Path::new(&name))).or_default().push(Entry { name, is_folder });
    }
    listing.values_mut().for_each(|entries| entries.sort_by(|a, b| a.name.cmp(&b.name)));
    listing
}

/// Candidate spellings of a name with `/` as separator: without quotes, without a trailing comment, with unescaped
/// spaces, percent-decoded.
fn spellings(name: &str) -> Vec<String> {
    let plain = unquoted(name);
    let without_comment = plain.split(" #").next().unwrap_or(plain);
    let decoded = percent_encoding::percent_decode_str(plain).decode_utf8_lossy();
    let mut all: Vec<String> = Vec::new();
    for spelling in [plain, unquoted(without_comment), &plain.replace("\\ ", " "), &decoded] {
        let spelling = spelling.replace('\\', "/");
        if !all.contains(&spelling) {
            all.push(spelling);
        }
    }
    all
}

/// Whether the name of a missing image stands for tiles: `<UDIM>`, `%(UDIM)d`, `<UVTILE>`, `u<U>_v<V>` or `u1_v1`.
fn names_tiles(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let is_digit = |c: char| c.is_ascii_digit();
    let is_tile = |(at, _): (usize, &str)| {
        let column = name[..at].trim_end_matches(is_digit);
        let before = column.strip_suffix('u').filter(|_| column.len() < at);
        before.is_some_and(|before| !before.ends_with(char::is_alphanumeric))
            && name[at + 2..].starts_with(is_digit)
    };
    ["<udim>", "(udim)", "<uvtile>", "u<u>_v<v>"].iter().any(|token| name.contains(token))
        || name.match_indices("_v").any(is_tile)
}

/// Text without surrounding white space and quotes.
pub(crate) fn unquoted(text: &str) -> &str {
    let text = text.trim();
    let inner = |quote| text.strip_prefix(quote).and_then(|text| text.strip_suffix(quote));
    inner('"').or_else(|| inner('\'')).unwrap_or(text).trim()
}

/// Last component of a path; empty for `..` and roots.
fn path_name(path: &Path) -> &OsStr {
    path.file_name().unwrap_or_default()
}

/// The last component of a path in NFC and lower case: some systems store names decomposed (NFD).
fn key(path: &Path) -> String {
    path_name(path).to_string_lossy().nfc().collect::<String>().to_lowercase()
}

/// Paths whose last component equals `name`; all paths if there are none.
fn same_name_first(paths: Vec<PathBuf>, name: &OsStr) -> Vec<PathBuf> {
    let same: Vec<PathBuf> = paths.iter().filter(|path| path_name(path) == name).cloned().collect();
    if same.is_empty() { paths } else { same }
}

/// Whether a path is absolute or leads to a parent of the folder it starts from.
fn leaves_folder(path: &Path) -> bool {
    let mut depth = 0i64;
    path.components().any(|component| {
        match component {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return true,
        }
        depth < 0
    })
}
