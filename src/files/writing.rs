//! Atomic writing of files: output goes to a temporary file beside its target, which is then renamed.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::{NamedTempFile, TempPath};

use super::{check_output, inputs};
use crate::error::{Error, Result};

/// Temporary files in use, to be removed if the process is interrupted.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Start and end of the names of temporary files.
const TEMPORARY: [&str; 2] = [".kiln-", ".part"];

/// Names of temporary files in a folder that are not this process's: another one is writing them, or was killed.
pub fn unfinished_in(folder: &Path) -> Vec<String> {
    let unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    let own: Vec<_> = unfinished.iter().filter_map(|path| path.file_name()).collect();
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let names = names.filter(|name| !own.contains(&name.as_os_str()));
    let names = names.map(|name| name.to_string_lossy().into_owned());
    let [start, end] = TEMPORARY;
    let mut names: Vec<String> =
        names.filter(|name| name.starts_with(start) && name.ends_with(end)).collect();
    names.sort_unstable();
    names
}

/// Symbolic links that are followed, as many as Linux does (path_resolution(7)).
const MOST_LINKS: usize = 40;

/// The file that a name denotes, which need not exist: the target of symbolic links, others stay as they are.
pub fn target_of(name: &Path) -> PathBuf {
    let mut target = name.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(link) = std::fs::read_link(&target) else { break };
        target = folder_of(&target).join(link);
    }
    target
}

/// Whether two names denote the same file, which need not exist. Names that differ in case alone do, on all systems,
/// because they do on macOS and Windows.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    a == b || a != Path::new("-") && b != Path::new("-") && file_key(a) == file_key(b)
}

/// A key that names have in common if they denote the same file ([`is_same_file`]).
pub fn file_key(file: &Path) -> PathBuf {
    let target = target_of(file);
    let folder = folder_of(&target);
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let whole = folder.join(target.file_name().unwrap_or_default());
    whole.to_str().map(str::to_lowercase).map_or(whole, PathBuf::from)
}

/// Removes all temporary files. Only for the end of the process: afterwards no file can be created or finished.
pub fn discard_unfinished() {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        for path in unfinished.drain(..) {
            let _ = std::fs::remove_file(path);
        }
        // Keeps the lock, so that other threads do not create or finish files.
        std::mem::forget(unfinished);
    }
}

/// Registration of a temporary file in [`UNFINISHED`] for the lifetime of this value.
struct Unfinished(PathBuf);

impl Unfinished {
    /// Creates and registers the file while holding the lock.
    fn new(make: impl FnOnce() -> io::Result<NamedTempFile>) -> io::Result<(NamedTempFile, Self)> {
        let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        let file = make()?;
        unfinished.push(file.path().to_owned());
        let path = file.path().to_owned();
        Ok((file, Unfinished(path)))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Ok(mut unfinished) = UNFINISHED.lock() {
            unfinished.retain(|path| *path != self.0);
        }
    }
}

/// A file that is written under a temporary name in the same folder and renamed once it is complete and synced to disk.
/// Until then, or on failure, an existing file of that name is unchanged. Of a symbolic link the target is written.
pub struct WholeFile {
    name: PathBuf,
    target: PathBuf,
    writer: BufWriter<File>,
    // Field order: on drop, the temporary file is removed before it is unregistered.
    temporary: TempPath,
    /// Message of the first failed write. Encoders pass on only the text of an error.
    why: Option<String>,
    _unfinished: Unfinished,
}

impl WholeFile {
    /// Creates an empty temporary file for `name`.
    ///
    /// # Errors
    /// [`Error::Output`] if the folder cannot be written to, or the name is that of a folder, a device or a pipe;
    /// [`Error::Usage`] for a protected input ([`check_output`]).
    pub fn create(name: &Path) -> Result<Self> {
        check_output(name)?;
        if name.is_dir() {
            return Err(Error::output(name, "is a folder; name a file in it"));
        }
        // Renaming would replace the device or pipe itself.
        if std::fs::metadata(name).is_ok_and(|about| !about.is_file()) {
            return Err(Error::output(name, "is a device or a pipe; name a file"));
        }
        let target = target_of(name);
        if target.is_symlink() {
            return Err(Error::output(name, "is a symbolic link that leads to itself; name a file"));
        }
        let folder = folder_of(&target);
        let make = || {
            let [start, end] = TEMPORARY;
            let mut builder = tempfile::Builder::new();
            builder.prefix(start).suffix(end).permissions_like_any_file().tempfile_in(folder)
        };
        let (temporary, _unfinished) = Unfinished::new(make).map_err(|e| {
            // Folders such as /proc exist, and report that a new file in them does not.
            let is_refused = e.kind() == ErrorKind::NotFound && folder.is_dir();
            let refused = || "cannot be written: its folder takes no files; name another folder".to_owned();
            Error::output(name, if is_refused { refused() } else { describe(&e) })
        })?;
        let (file, temporary) = temporary.into_parts();
        let writer = BufWriter::with_capacity(1 << 18, file);
        Ok(WholeFile { name: name.to_owned(), target, writer, temporary, why: None, _unfinished })
    }

    /// The error of writing the file, where an encoder failed with `e`: that of the first failed write, if one did.
    pub fn error(&mut self, e: &io::Error) -> Error {
        Error::output(&self.name, self.why.take().unwrap_or_else(|| describe(e)))
    }

    /// Syncs the file and renames it to its final name.
    ///
    /// # Errors
    /// [`Error::Output`] if it cannot be written or renamed, [`Error::Usage`] if the name is that of a protected input
    /// by now.
    pub fn finish(self) -> Result<()> {
        let WholeFile { name, target, writer, temporary, why: _, _unfinished } = self;
        check_output(&name)?;
        let finish = || -> io::Result<()> {
            let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.sync_data()?;
            // Windows does not rename open files.
            drop(file);
            temporary.persist(&target).map_err(|e| e.error)
        };
        finish().map_err(|e| Error::output(&name, describe(&e)))?;
        inputs::record_output(&target);
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes).inspect_err(|e| self.why = Some(describe(e)))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().inspect_err(|e| self.why = Some(describe(e)))
    }
}

/// The folder of a file.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Writes `file` atomically with the contents that `fill` writes ([`WholeFile`]).
///
/// # Errors
/// [`Error::Output`] if the folder cannot be written to or `fill` fails.
pub fn write_whole(file: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let mut whole = WholeFile::create(file)?;
    fill(&mut whole).map_err(|e| whole.error(&e))?;
    whole.finish()
}

/// Sets the permissions of ordinary new files, because temporary files are private by default.
trait LikeAnyFile {
    fn permissions_like_any_file(&mut self) -> &mut Self;
}

impl LikeAnyFile for tempfile::Builder<'_, '_> {
    fn permissions_like_any_file(&mut self) -> &mut Self {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // The umask of the process is applied, as for any new file.
            self.permissions(std::fs::Permissions::from_mode(0o666));
        }
        self
    }
}

/// Message for a write error.
pub fn describe(e: &io::Error) -> String {
    // Errors of temporary files state their paths beside the cause, and the system's its number.
    let cause = || e.get_ref().and_then(|e| e.source()).map_or_else(|| e.to_string(), ToString::to_string);
    let why = match e.kind() {
        ErrorKind::NotFound => "its folder does not exist".into(),
        ErrorKind::PermissionDenied => "permission denied".into(),
        ErrorKind::StorageFull => "the disk is full".into(),
        _ => cause().split(" (os error").next().unwrap_or_default().to_owned(),
    };
    format!("cannot be written: {why}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.txt");
        std::fs::write(&target, "old").unwrap();
        let result = write_whole(&target, |w| {
            w.write_all(b"new")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(matches!(result, Err(Error::Output { .. })));
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&target, |w| w.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
