//! Registry of the files that are read and written. Outputs must not overwrite inputs under any name, nor be read.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use same_file::Handle;

use super::{Refused, WholeFile};
use crate::error::{Error, Result};

/// Inputs of this process; `None` before [`protect_inputs`].
static PROTECTED: Mutex<Option<InputFiles>> = Mutex::new(None);

/// Outputs of this process by their canonical paths; `None` before [`separate_outputs`].
static WRITTEN: Mutex<Option<BTreeSet<PathBuf>>> = Mutex::new(None);

/// Calls `work` with a registry that is in use.
fn with<S, T>(registry: &Mutex<Option<S>>, work: impl FnOnce(&mut S) -> T) -> Option<T> {
    registry.lock().unwrap_or_else(PoisonError::into_inner).as_mut().map(work)
}

/// A set of input files.
#[derive(Debug, Clone, Default)]
pub struct InputFiles {
    /// Absolute and canonical paths.
    paths: BTreeSet<PathBuf>,
    /// Those of the files when they were added.
    identities: BTreeSet<[u64; 2]>,
}

/// Device and inode.
#[cfg(unix)]
fn identity(file: &Path) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(file).ok().map(|about| [about.dev(), about.ino()])
}

/// Not known without opening the file.
#[cfg(not(unix))]
fn identity(_: &Path) -> Option<[u64; 2]> {
    None
}

impl InputFiles {
    /// Adds a file.
    pub fn add(&mut self, file: &Path) {
        self.paths.insert(std::path::absolute(file).unwrap_or_else(|_| file.to_owned()));
        self.paths.extend(file.canonicalize());
        self.identities.extend(identity(file));
    }

    /// Checks that writing `output` overwrites none of the files. Files are the same if they have the same device and
    /// inode, or file index on Windows: hard links, symbolic links and other spellings of a path are recognised.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is one of them.
    pub fn check(&self, output: &Path) -> Result<()> {
        // A shortcut, as a look at all inputs for each of many outputs takes long.
        let has_identity = identity(output).is_none_or(|identity| self.identities.contains(&identity));
        if !has_identity && !output.canonicalize().is_ok_and(|path| self.paths.contains(&path)) {
            return Ok(());
        }
        // Opening a pipe would wait for its other end.
        let handle = |file: &Path| file.is_file().then(|| Handle::from_path(file).ok()).flatten();
        let Some(existing) = handle(output) else { return Ok(()) };
        match self.paths.iter().find(|input| handle(input).as_ref() == Some(&existing)) {
            None => Ok(()),
            Some(_) => Err(Error::usage(
                format!("{}: read as an input, and would be overwritten", output.display()),
                "give the output another name",
            )),
        }
    }
}

impl<P: AsRef<Path>> FromIterator<P> for InputFiles {
    fn from_iter<I: IntoIterator<Item = P>>(files: I) -> Self {
        let mut inputs = InputFiles::default();
        files.into_iter().for_each(|file| inputs.add(file.as_ref()));
        inputs
    }
}

/// Protects all files that this process reads as inputs from now on. For processes of one command; a program that runs
/// longer checks its own [`InputFiles`].
pub fn protect_inputs() {
    PROTECTED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
}

/// From now on files that this process has written are not read as inputs, so that no picture depends on which of
/// several is rendered first.
pub fn separate_outputs() {
    WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
}

/// Records an input if inputs are protected.
///
/// # Errors
/// [`Refused`] if this process wrote it ([`separate_outputs`]).
pub(super) fn record(file: &Path) -> io::Result<()> {
    let is_written =
        |outputs: &mut BTreeSet<_>| file.canonicalize().is_ok_and(|path| outputs.contains(&path));
    if with(&WRITTEN, is_written) == Some(true) {
        return Err(io::Error::other(Refused {
            what: "was written by this command, which reads none of its outputs".into(),
            hint: "give the output another name".into(),
        }));
    }
    with(&PROTECTED, |inputs| inputs.add(file));
    Ok(())
}

/// Records an output if outputs are separate.
pub(super) fn record_output(file: &Path) {
    with(&WRITTEN, |outputs| outputs.extend(file.canonicalize()));
}

/// Checks that an output is none of the protected inputs so far, for a check before rendering. [`WholeFile`] checks it
/// again.
///
/// # Errors
/// [`Error::Usage`] if it is.
pub fn check_output(output: &Path) -> Result<()> {
    with(&PROTECTED, |inputs| inputs.check(output)).unwrap_or(Ok(()))
}

/// Checks that an output can be written, and is none of the protected inputs so far.
///
/// # Errors
/// Those of [`WholeFile::create`].
pub fn check_writable(output: &Path) -> Result<()> {
    WholeFile::create(output).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_recognised_by_every_name() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("sub")).expect("a folder");
        std::fs::write(path("a.png"), "a").expect("a file");
        std::fs::write(path("b.png"), "a").expect("a file of the same contents");
        std::fs::hard_link(path("a.png"), path("hard.png")).expect("a link");
        let mut names = vec!["a.png", "sub/../a.png", "./a.png", "hard.png"];
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("a.png", path("soft.png")).expect("a link");
            std::os::unix::fs::symlink(".", path("here")).expect("a link");
            names.extend(["soft.png", "here/a.png"]);
        }
        for input in &names {
            let inputs: InputFiles = [path(input)].into_iter().collect();
            for output in &names {
                let refused = inputs.check(&path(output));
                assert!(matches!(refused, Err(Error::Usage { .. })), "{input} is {output}: {refused:?}");
            }
            for other in ["b.png", "new.png", "sub", "a.png/below"] {
                assert_eq!(inputs.check(&path(other)), Ok(()), "{input} is not {other}");
            }
        }
        // A path stays an input after its file was replaced.
        let inputs: InputFiles = [path("a.png")].into_iter().collect();
        std::fs::rename(path("b.png"), path("a.png")).expect("files can be renamed");
        assert!(inputs.check(&path("a.png")).is_err());
        assert_eq!(inputs.check(&path("hard.png")), Ok(()));
    }
}
