//! Whole files or none: output is written to a temporary file beside its target and renamed over it.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use crate::error::{Error, Result};

/// The temporary files that are being written, for a process that has to end at once.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes the temporary files that are being written. For the end of the process: no file can be begun or finished after it.
pub fn discard_unfinished() {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        for path in unfinished.drain(..) {
            let _ = std::fs::remove_file(path);
        }
        // Other threads may be about to write; they wait at the lock.
        std::mem::forget(unfinished);
    }
}

/// A temporary file that is known as unfinished as long as this lives.
struct Unfinished(PathBuf);

impl Unfinished {
    /// Makes the file and knows it, in one step.
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

/// A file that is written under another name in the same folder, and takes its own name once it is whole and on the disk.
/// Until then, and where it never comes to that, a file of that name that was there before stays as it was.
pub struct WholeFile {
    name: PathBuf,
    // In this order: what is given up is removed before it is forgotten.
    writer: BufWriter<tempfile::NamedTempFile>,
    /// Why it could not be written to. Encoders pass on the words of an error and lose what it was.
    why: Option<String>,
    _unfinished: Unfinished,
}

impl WholeFile {
    /// Begins with nothing in it.
    ///
    /// # Errors
    /// [`Error::Output`] when the folder cannot be written to, or the name is that of a folder, a device or a pipe.
    pub fn create(name: &Path) -> Result<Self> {
        if name.is_dir() {
            return Err(Error::output(name, "is a folder; name a file in it"));
        }
        // Renaming would replace a device or a pipe.
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
        let (temporary, unfinished) = Unfinished::new(make).map_err(|e| Error::output(name, describe(&e)))?;
        let writer = BufWriter::with_capacity(1 << 18, temporary);
        Ok(WholeFile { name: name.to_owned(), writer, why: None, _unfinished: unfinished })
    }

    /// The name that it will have.
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be written or renamed.
    pub fn finish(self) -> Result<()> {
        let WholeFile { name, writer, why: _, _unfinished } = self;
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

/// The folder that a file is or will be in.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Writes `file` as a whole: what `fill` writes, or nothing ([`WholeFile`]).
///
/// # Errors
/// [`Error::Output`] when the folder cannot be written to or `fill` fails.
pub fn write_whole(file: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let mut whole = WholeFile::create(file)?;
    fill(&mut whole).map_err(|e| Error::output(file, whole.why.take().unwrap_or_else(|| describe(&e))))?;
    whole.finish()
}

/// Temporary files are private by default; the finished picture is a file like any other.
trait LikeAnyFile {
    fn permissions_like_any_file(&mut self) -> &mut Self;
}

impl LikeAnyFile for tempfile::Builder<'_, '_> {
    fn permissions_like_any_file(&mut self) -> &mut Self {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // The process's umask is applied to this, as for any new file.
            self.permissions(std::fs::Permissions::from_mode(0o666));
        }
        self
    }
}

/// What went wrong with writing, in words.
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
