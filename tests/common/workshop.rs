//! A temporary folder in which the command runs, for the test binaries that have the command.
#![allow(dead_code)]

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// A temporary folder, deleted at the end of the test.
pub struct Workshop(pub tempfile::TempDir);

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("the command writes UTF-8")
}

impl Workshop {
    /// A folder with a file.
    pub fn with(name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let workshop = Workshop(tempfile::tempdir().expect("a temporary folder can be made"));
        workshop.write(name, bytes);
        workshop
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("the temporary folder can be written to");
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The names of all files, in order.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).expect("the folder can be read");
        let mut names: Vec<String> =
            entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        command.current_dir(self.0.path()).args(arguments.split_whitespace()).stdin(Stdio::null());
        command.env("RUST_BACKTRACE", "1").env_remove("SLURM_CPUS_PER_TASK");
        command
    }

    pub fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().expect("the command starts")
    }

    /// Exit code, standard output and standard error of a run.
    pub fn said(&self, arguments: &str) -> (i32, String, String) {
        let Output { status, stdout, stderr } = self.run(arguments);
        (status.code().expect("no signal"), text(&stdout), text(&stderr))
    }

    /// Runs a command that must end with `code`. Returns standard output and standard error.
    #[track_caller]
    pub fn code(&self, arguments: &str, code: i32) -> (String, String) {
        let (found, out, err) = self.said(arguments);
        assert_eq!(found, code, "{arguments}: {out}{err}");
        (out, err)
    }

    /// Runs a command that must succeed. Returns its standard error.
    #[track_caller]
    pub fn succeed(&self, arguments: &str) -> String {
        self.code(arguments, 0).1
    }
}
