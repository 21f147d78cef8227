//! The files that a scene depends on.
//!
//! Importers open and look up files only through [`Files`], which records them for detecting changes.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::SystemTime;

use crate::files::{RegularFile, read_file, read_standard_input};
use crate::import::files::references::DirectoryCache;
use crate::scene::{DecodedImage, Scene};

/// A file that was opened or looked up.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileRead {
    /// Path, whether or not the file exists.
    pub file: PathBuf,
    /// Stamp just before the file was opened; `None` if it did not exist.
    pub stamp: Option<Stamp>,
}

/// File metadata that identifies its contents. Equal stamps mean equal contents, unless a writer restored the metadata
/// deliberately.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    length: u64,
    modified: Option<SystemTime>,
    identity: Identity,
}

/// Device, inode and change time. The change time detects files that were replaced by one of equal size and
/// modification time, and changed permissions.
#[cfg(unix)]
type Identity = [i128; 4];
/// Creation time.
#[cfg(not(unix))]
type Identity = Option<SystemTime>;

impl Stamp {
    /// Stamp of `file`, or `None` if it does not exist.
    pub fn of(file: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(file).ok()?;
        Some(Stamp {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            identity: identity(&metadata),
        })
    }

    /// Whether the file is empty.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }
}

#[cfg(unix)]
fn identity(metadata: &Metadata) -> Identity {
    use std::os::unix::fs::MetadataExt;
    [metadata.dev().into(), metadata.ino().into(), metadata.ctime().into(), metadata.ctime_nsec().into()]
}

#[cfg(not(unix))]
fn identity(metadata: &Metadata) -> Identity {
    metadata.created().ok()
}

/// Opens files and records them. Clones share the record.
#[derive(Clone, Default)]
pub(crate) struct Files {
    record: Rc<RefCell<BTreeMap<PathBuf, Option<Stamp>>>>,
    /// Images that were decoded when the same files were read before, by their names.
    images: Rc<HashMap<String, DecodedImage>>,
    /// What is read in place of standard input.
    standard_input: Option<Rc<Vec<u8>>>,
    /// Whether images are recorded, but not read.
    pub(crate) skips_images: bool,
    /// Cache of searches for misplaced files.
    pub(crate) listings: Rc<RefCell<DirectoryCache>>,
}

impl Files {
    /// Files with these contents in place of standard input.
    pub(crate) fn with_standard_input(bytes: Vec<u8>) -> Self {
        Files { standard_input: Some(Rc::new(bytes)), ..Files::default() }
    }

    /// Files without the contents of images.
    pub(crate) fn without_images() -> Self {
        Files { skips_images: true, ..Files::default() }
    }

    /// Files that were read before into a scene, whose images need not be decoded again.
    pub(crate) fn of_scene(scene: &Scene) -> Self {
        let images = scene.images.iter().map(|image| (image.name.clone(), image.clone()));
        Files { images: Rc::new(images.collect()), ..Files::default() }
    }

    /// The image of this name that was decoded before.
    pub(crate) fn image(&self, name: &str) -> Option<DecodedImage> {
        self.images.get(name).cloned()
    }

    /// Reads a file.
    pub(crate) fn read(&self, file: &Path) -> std::io::Result<Vec<u8>> {
        self.add(file);
        read_file(file)
    }

    /// Reads standard input.
    pub(crate) fn read_standard_input(&self) -> std::io::Result<Vec<u8>> {
        self.standard_input.as_ref().map_or_else(read_standard_input, |bytes| Ok(bytes.to_vec()))
    }

    /// Opens a file for reading.
    pub(crate) fn open(&self, file: &Path) -> std::io::Result<RegularFile> {
        self.add(file);
        RegularFile::open(file)
    }

    /// Whether the file exists.
    pub(crate) fn has(&self, file: &Path) -> bool {
        self.add(file);
        file.is_file()
    }

    /// Records the stamp of a file before its first use. If the file changes between stamp and read, it is read again.
    fn add(&self, file: &Path) {
        self.record.borrow_mut().entry(file.to_owned()).or_insert_with(|| Stamp::of(file));
    }

    /// The recorded files, ordered by path.
    pub(crate) fn list(&self) -> Vec<FileRead> {
        let record = self.record.borrow();
        record.iter().map(|(file, &stamp)| FileRead { file: file.clone(), stamp }).collect()
    }
}

#[cfg(test)]
mod tests;
