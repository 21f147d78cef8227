//! Atomic writing of files: output goes to a temporary file beside its target, which is then renamed.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::check_output;
use crate::error::{Error, Result};

/// Temporary files in use, to be removed if the process is interrupted.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

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
    fn new(
        make: impl FnOnce() -> std::io::Result<tempfile::NamedTempFile>,
    ) -> std::io::Result<(tempfile::NamedTempFile, Self)> {
        let mut unfinished = UNFINISHED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
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
/// Until then, or on failure, an existing file of that name is unchanged.
pub struct WholeFile {
    name: PathBuf,
    // Field order: on drop, the temporary file is removed before it is unregistered.
    writer: BufWriter<tempfile::NamedTempFile>,
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
        let make = || {
            tempfile::Builder::new()
                .prefix(".kiln-")
                .suffix(".part")
                .permissions_like_any_file()
                .tempfile_in(folder_of(name))
        };
        let (temporary, unfinished) = Unfinished::new(make).map_err(|e| {
            // Folders such as /proc exist, and report that a new file in them does not.
            let is_refused = e.kind() == std::io::ErrorKind::NotFound && folder_of(name).is_dir();
            let refused = || "cannot be written: its folder takes no files; name another folder".to_owned();
            Error::output(name, if is_refused { refused() } else { describe(&e) })
        })?;
        let writer = BufWriter::with_capacity(1 << 18, temporary);
        Ok(WholeFile { name: name.to_owned(), writer, why: None, _unfinished: unfinished })
    }

    /// The final name.
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Syncs the file and renames it to its final name.
    ///
    /// # Errors
    /// [`Error::Output`] if it cannot be written or renamed, [`Error::Usage`] if the name is that of a protected input
    /// by now.
    pub fn finish(self) -> Result<()> {
        let WholeFile { name, writer, why: _, _unfinished } = self;
        check_output(&name)?;
        let finish = || -> std::io::Result<()> {
            let temporary = writer.into_inner().map_err(std::io::IntoInnerError::into_error)?;
            temporary.as_file().sync_data()?;
            temporary.persist(&name).map_err(|e| e.error)?;
            Ok(())
        };
        finish().map_err(|e| Error::output(&name, describe(&e)))
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes).inspect_err(|e| self.why = Some(describe(e)))
    }

    fn flush(&mut self) -> std::io::Result<()> {
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
pub fn write_whole(file: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let mut whole = WholeFile::create(file)?;
    fill(&mut whole).map_err(|e| Error::output(file, whole.why.take().unwrap_or_else(|| describe(&e))))?;
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
pub fn describe(e: &std::io::Error) -> String {
    match e.kind() {
        std::io::ErrorKind::NotFound => "cannot be written: its folder does not exist".into(),
        std::io::ErrorKind::PermissionDenied => "cannot be written: permission denied".into(),
        std::io::ErrorKind::StorageFull => "cannot be written: the disk is full".into(),
        _ => format!("cannot be written: {e}"),
    }
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
