//! Files that an input names: as written or, if there is none, as exporters on other machines mean the name. What is
//! searched lies below the folder of the input; links that lead out of it are not followed.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

use super::Source;
use crate::error::Warnings;

/// Entries of folders that are searched for a name without its path. A folder with more, such as one of downloads, is
/// not searched: which of its files are found would depend on the order of listing.
const MOST_ENTRIES: usize = 20_000;

/// Levels of folders that are searched for a name without its path.
const DEEPEST: usize = 8;

/// Files that a message names where several could be meant.
const MOST_NAMED: usize = 4;

/// Contents of the folders that were searched, each listed once, and notes on what was found.
#[derive(Default)]
pub(super) struct Listings {
    folders: HashMap<PathBuf, Rc<Listing>>,
    /// The files below a folder by their names in lower case, relative to it.
    trees: HashMap<PathBuf, Rc<HashMap<String, Vec<PathBuf>>>>,
    notes: Vec<String>,
}

/// The entries of a folder by their names in lower case.
type Listing = HashMap<String, Vec<Entry>>;

#[derive(Clone)]
struct Entry {
    name: OsString,
    /// A folder itself, not a link to one.
    is_folder: bool,
}

impl Source {
    /// The path of a file that this one references by `name`: in its folder or below, unless the options allow others.
    ///
    /// That is the file as written; symbolic links are followed, as the contents of files do not make them. If there is
    /// none, it is the file whose path differs in case alone; then the one of the same name anywhere below the folder.
    /// For both, quotes, a comment and percent-encoding are also left off. A note names a file found so. If there is
    /// none either, the path is that of the name as written.
    ///
    /// # Errors
    /// What is wrong with the reference: it leads out of the folder, or several files could be meant.
    pub(super) fn resolve_reference(&self, name: &str) -> Result<PathBuf, String> {
        self.resolve_or(name, None)
    }

    /// The path of a file as [`Source::resolve_reference`] finds it; then, that of the file `other` in the folder.
    pub(super) fn resolve_or(&self, name: &str, other: Option<&str>) -> Result<PathBuf, String> {
        let written = self.as_written(name);
        if self.file == Path::new("-") || written.as_ref().is_ok_and(|path| self.files.has(path)) {
            return written;
        }
        let names = spellings(name);
        let by_case = names.iter().map(|name| self.differing_in_case(Path::new(name)));
        let anywhere = names.iter().map(|name| self.anywhere_below(Path::new(name)));
        let by_other = other.into_iter().map(|other| self.differing_in_case(Path::new(other)));
        let Some(found) = by_case.chain(anywhere).chain(by_other).find(|found| !found.is_empty()) else {
            return written;
        };
        if let [one] = &found[..] {
            let path = self.beside(one);
            let (file, path_text) = (self.file.display(), one.display());
            self.files
                .listings
                .borrow_mut()
                .notes
                .push(format!("{file}: `{name}` is read from `{path_text}`"));
            return Ok(path);
        }
        let named: Vec<String> =
            found.iter().take(MOST_NAMED).map(|path| format!("`{}`", path.display())).collect();
        let more = if found.len() > MOST_NAMED { ", …" } else { "" };
        Err(format!(
            "`{name}` is not there, and could be any of {}{more}; rename one to it",
            named.join(", ")
        ))
    }

    /// The path of a reference as written, whether or not there is such a file.
    ///
    /// # Errors
    /// It leads out of the folder.
    pub(super) fn as_written(&self, name: &str) -> Result<PathBuf, String> {
        let path = PathBuf::from(name.replace('\\', "/"));
        if !self.options.allow_outside_references && leaves_folder(&path) {
            return Err(format!(
                "`{name}` is outside the file's folder; --allow-outside-references reads it, too"
            ));
        }
        Ok(self.beside(path))
    }

    /// The path of an image that this file references; `None` with a warning if it is not followed.
    pub(super) fn resolve_image(&self, name: &str, warnings: &mut Warnings) -> Option<PathBuf> {
        let resolved = self.resolve_reference(name);
        let warn =
            |what| warnings.left_out_file(format!("{}: texture left out: {what}", self.file.display()));
        resolved.map_err(warn).ok()
    }

    /// Moves the notes on files that were found to the warnings.
    pub(super) fn note_references(&self, warnings: &mut Warnings) {
        self.files.listings.borrow_mut().notes.drain(..).for_each(|note| warnings.note(note));
    }

    /// The files whose paths, relative to the folder, differ from `path` in case alone. If one does not differ, it is
    /// the only one.
    fn differing_in_case(&self, path: &Path) -> Vec<PathBuf> {
        if leaves_folder(path) {
            return Vec::new();
        }
        let mut all = vec![PathBuf::new()];
        for component in path.components() {
            all = match component {
                Component::Normal(name) => {
                    let entries = all.iter().map(|folder| (folder, self.listing(folder)));
                    let named = entries.flat_map(|(folder, listing)| {
                        let entries = listing.get(&lower_case(Path::new(name))).cloned().unwrap_or_default();
                        entries.into_iter().map(|entry| folder.join(entry.name))
                    });
                    same_name_first(named.collect(), name)
                }
                // The paths so far have the same length, and the folder above all is the same.
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

    /// The files below the folder with the name of `path`, whatever its folder.
    fn anywhere_below(&self, path: &Path) -> Vec<PathBuf> {
        let named = self.tree().get(&lower_case(path)).cloned().unwrap_or_default();
        self.files_inside(same_name_first(named, path_name(path)))
    }

    /// Those of `paths`, relative to the folder, that are files inside it when links are followed.
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

    /// The entries of a folder below that of the file.
    fn listing(&self, below: &Path) -> Rc<Listing> {
        let folder = self.folder().join(below);
        let mut listings = self.files.listings.borrow_mut();
        let listing = listings.folders.entry(folder).or_insert_with_key(|folder| Rc::new(list(folder)));
        listing.clone()
    }

    /// The files below the folder, of at most [`MOST_ENTRIES`]; hidden folders and links to folders are left out.
    fn tree(&self) -> Rc<HashMap<String, Vec<PathBuf>>> {
        if let Some(tree) = self.files.listings.borrow().trees.get(self.folder()) {
            return tree.clone();
        }
        let mut tree: HashMap<String, Vec<PathBuf>> = HashMap::new();
        let (mut level, mut count) = (vec![PathBuf::new()], 0);
        for _ in 0..DEEPEST {
            let mut next = Vec::new();
            for folder in level {
                let listing = self.listing(&folder);
                count += listing.values().map(Vec::len).sum::<usize>();
                if count > MOST_ENTRIES {
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
        if count > MOST_ENTRIES {
            tree.clear();
        }
        tree.values_mut().for_each(|paths| paths.sort_unstable());
        let tree = Rc::new(tree);
        self.files.listings.borrow_mut().trees.insert(self.folder().to_owned(), tree.clone());
        tree
    }
}

/// The entries of a folder; none if it cannot be listed, or has more than [`MOST_ENTRIES`].
fn list(folder: &Path) -> Listing {
    let mut listing = Listing::new();
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for (index, entry) in entries.enumerate() {
        if index == MOST_ENTRIES {
            return Listing::new();
        }
        let (name, is_folder) = (entry.file_name(), entry.file_type().is_ok_and(|kind| kind.is_dir()));
        listing.entry(lower_case(Path::new(&name))).or_default().push(Entry { name, is_folder });
    }
    listing.values_mut().for_each(|entries| entries.sort_by(|a, b| a.name.cmp(&b.name)));
    listing
}

/// What exporters mean by a name, with `/` between folders: without quotes, without a comment behind it, with spaces
/// that are not quoted by backslashes, with percent-encoding decoded.
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

/// A text without spaces and quotes around it.
pub(super) fn unquoted(text: &str) -> &str {
    let text = text.trim();
    let inner = |quote| text.strip_prefix(quote).and_then(|text| text.strip_suffix(quote));
    inner('"').or_else(|| inner('\'')).unwrap_or(text).trim()
}

/// The last component of a path; empty if that is no name.
fn path_name(path: &Path) -> &OsStr {
    path.file_name().unwrap_or_default()
}

fn lower_case(path: &Path) -> String {
    path_name(path).to_string_lossy().to_lowercase()
}

/// Those of `paths` whose last component is `name`, if there are any, and otherwise all.
fn same_name_first(paths: Vec<PathBuf>, name: &OsStr) -> Vec<PathBuf> {
    let same: Vec<PathBuf> = paths.iter().filter(|path| path_name(path) == name).cloned().collect();
    if same.is_empty() { paths } else { same }
}

/// Whether a relative path leads to a parent of the folder it starts from, or the path is absolute.
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
