//! Reading of whole regular files and of standard input within the memory limits.

use std::io::{self, Read, Seek};
use std::path::Path;

use super::inputs;
use crate::error::{Error, nearest_name};
use crate::limits::{Bytes, available, check, in_use};

/// First line of a Git LFS pointer, and the largest size of one in bytes (Git LFS Specification, "The Pointer").
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/v1";
const LARGEST_LFS_POINTER: u64 = 1024;

/// Refuses the contents of a file that Git LFS has not fetched yet.
fn refuse_lfs_pointer(start: &[u8]) -> io::Result<()> {
    if !start.starts_with(LFS_POINTER) {
        return Ok(());
    }
    Err(io::Error::other(Refused {
        what: "is a Git LFS pointer; `git lfs pull` fetches the file itself".into(),
        hint: "run `git lfs pull` in the folder of the file; Git LFS must be installed".into(),
    }))
}

/// Reads a regular file and records it as an input ([`super::check_output`]). Pipes, devices and sockets may be endless
/// and are rejected.
///
/// # Errors
/// Errors of the system; [`Refused`] as the cause of [`io::ErrorKind::Other`].
pub fn read_file(file: &Path) -> io::Result<Vec<u8>> {
    read_all(RegularFile::open(file)?)
}

/// Reads a file that may be overwritten, such as a finished frame, as [`read_file`] does. It is not recorded as an
/// input.
///
/// # Errors
/// Those of [`read_file`].
pub fn read_output(file: &Path) -> io::Result<Vec<u8>> {
    read_all(RegularFile::open_any(file)?)
}

fn read_all(mut open: RegularFile) -> io::Result<Vec<u8>> {
    check(open.length).map_err(|excess| {
        io::Error::other(Refused { what: format!("reading it {excess}"), hint: excess.hint() })
    })?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(open.length as usize + 1)?;
    open.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A regular file, open for reading. More bytes than the system states are an error: virtual files may report a length
/// of 0 and contain data.
#[derive(Debug)]
pub struct RegularFile {
    file: std::fs::File,
    length: u64,
    read: u64,
}

impl RegularFile {
    /// Opens a regular file and records it as an input ([`super::check_output`]). Its memory is not checked.
    ///
    /// # Errors
    /// Those of [`read_file`].
    pub fn open(file: &Path) -> io::Result<Self> {
        let opened = RegularFile::open_any(file)?;
        inputs::record(file)?;
        Ok(opened)
    }

    /// Opens a regular file that may be overwritten. Its memory is not checked.
    ///
    /// # Errors
    /// Those of [`read_file`].
    pub fn open_any(file: &Path) -> io::Result<Self> {
        let metadata = std::fs::metadata(file)?;
        if metadata.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        if !metadata.is_file() {
            return Err(io::Error::other(Refused {
                what: format!("is {}, not a regular file", kind_of(metadata.file_type())),
                hint: "write what it holds to a file first; `-` reads standard input".into(),
            }));
        }
        let mut opened = std::fs::File::open(file)?;
        if metadata.len() <= LARGEST_LFS_POINTER {
            let mut start = Vec::new();
            (&mut opened).take(LFS_POINTER.len() as u64).read_to_end(&mut start)?;
            refuse_lfs_pointer(&start)?;
            opened.rewind()?;
        }
        Ok(RegularFile { file: opened, length: metadata.len(), read: 0 })
    }

    /// Length in bytes.
    pub fn length(&self) -> u64 {
        self.length
    }
}

impl Read for RegularFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read += count as u64;
        if self.read > self.length {
            return Err(io::Error::other(Refused {
                what: format!("is longer than the {} bytes that the system states", self.length),
                hint: "copy it to a file first; if it is being written, wait for that".into(),
            }));
        }
        Ok(count)
    }
}

/// Reads all of standard input, up to a third of the available memory.
///
/// # Errors
/// Errors of the system; [`Refused`] as the cause of [`io::ErrorKind::Other`].
pub fn read_standard_input() -> io::Result<Vec<u8>> {
    // The buffer doubles as it grows, and old and new buffer exist at once while it is copied.
    let available = available(&in_use());
    let most = available.as_ref().map_or(u64::MAX, |available| available.left / 3);
    // Finds a redirected file, on systems with this name.
    inputs::record(Path::new("/dev/stdin"))?;
    let mut bytes = Vec::new();
    io::stdin().lock().take(most).read_to_end(&mut bytes)?;
    refuse_lfs_pointer(&bytes)?;
    match available {
        Some(available) if bytes.len() as u64 == most => Err(io::Error::other(Refused {
            what: format!(
                "is longer than {}, a third of the memory left ({})",
                Bytes(most),
                available.set_by
            ),
            hint: "write it to a file and name that, or raise the limit".into(),
        })),
        _ => Ok(bytes),
    }
}

#[cfg(unix)]
fn kind_of(kind: std::fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if kind.is_fifo() => "a pipe",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () if kind.is_socket() => "a socket",
        () => "something else",
    }
}

#[cfg(not(unix))]
fn kind_of(_: std::fs::FileType) -> &'static str {
    "something else"
}

/// A file that is rejected although the system could read it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Refused {
    pub(super) what: String,
    pub(super) hint: String,
}

/// A hint for a file that the user named and that is missing: a file of its folder with a similar name, the same in
/// another case before others.
pub fn hint_for_missing(file: &Path) -> String {
    let whole = file.to_string_lossy();
    if whole.contains("://") {
        return "kiln reads files; download it first".into();
    }
    if whole.contains(['*', '?']) {
        return "`*` and `?` match files only in a shell, where they are not quoted".into();
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let typed = file.file_name().unwrap_or_default().to_string_lossy();
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().take(MOST_NAMES);
    let mut names: Vec<String> =
        names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort_unstable();
    if let Some(same) = names.iter().find(|name| name.to_lowercase() == typed.to_lowercase()) {
        return format!("did you mean `{same}`?");
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let hint = Some(nearest_name(&typed, &names)).filter(|hint| hint.starts_with("did you mean"));
    hint.unwrap_or_else(|| MISSING.1.into())
}

/// The most names of a folder that are compared with a missing one.
const MOST_NAMES: usize = 10_000;

/// Message and hint for a missing file.
const MISSING: (&str, &str) = ("no such file", "check the name and the folder");

/// Message for a folder where a file is to be read.
pub const IS_FOLDER: &str = "is a folder";

/// A message and a hint for a file that cannot be read.
pub fn explain(e: &io::Error) -> (String, String) {
    if let Some(refused) = e.get_ref().and_then(|cause| cause.downcast_ref::<Refused>()) {
        return (refused.what.clone(), refused.hint.clone());
    }
    let (what, hint) = match e.kind() {
        io::ErrorKind::NotFound => MISSING,
        io::ErrorKind::PermissionDenied => ("permission denied", "make the file readable for this user"),
        io::ErrorKind::IsADirectory => (IS_FOLDER, "name a file in it"),
        _ => return (format!("cannot be read: {e}"), String::new()),
    };
    (what.into(), hint.into())
}

/// An error for a file that cannot be read.
pub fn unreadable(file: &Path, e: &io::Error) -> Error {
    let (what, hint) = explain(e);
    Error::input(file, what, hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn devices_and_folders_are_not_read() {
        let said = |file: &str| read_file(Path::new(file)).map_err(|e| explain(&e).0).unwrap_err();
        assert_eq!(said("/dev/zero"), "is a device, not a regular file");
        assert_eq!(said("/"), "is a folder");
        assert_eq!(said("/no/such/file"), "no such file");
    }
}
