//! What the tasks share: the kiln binary, commands and their processor seconds, `kiln compare --json`, statistics.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// The root of the repository, the working directory of every task.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// A result with an error for the user.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Runs a command and returns its output. An exit code other than 0 is an error.
pub fn output(command: &mut Command) -> Result<Output> {
    let done = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(format!("{command:?}: {}\n{said}", done.status).into());
    }
    Ok(done)
}

/// A JSON file.
pub fn json(file: &Path) -> Result<Value> {
    let text = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(serde_json::from_slice(&text)?)
}

/// The elements of a JSON array; none for any other value.
pub fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// A JSON number.
pub fn number(value: &Value) -> Result<f64> {
    value.as_f64().ok_or_else(|| format!("{value} is not a number").into())
}

/// A number in the exponent notation of Rust, with an exponent of at least two digits, as in C.
pub fn two_digits(text: &str) -> String {
    match text.split_once("e-") {
        Some((mantissa, exponent)) => format!("{mantissa}e-{exponent:0>2}"),
        None => text.into(),
    }
}

/// The median.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 { values[half] } else { (values[half - 1] + values[half]) / 2.0 }
}

/// The arithmetic mean.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// User and system seconds of all child processes that have ended.
#[allow(unsafe_code)]
fn child_seconds() -> f64 {
    // SAFETY: `rusage` consists of integers, for which zeros are valid; `getrusage` writes to it alone.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_CHILDREN, &mut usage);
        usage
    };
    let seconds = |time: libc::timeval| time.tv_sec as f64 + time.tv_usec as f64 * 1e-6;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

/// A kiln binary.
pub struct Kiln(PathBuf);

impl Kiln {
    /// The binary that the option or the variable KILN names, else the release binary, which is built first.
    pub fn find(named: Option<&Path>) -> Result<Self> {
        if let Some(file) = named.map(Path::to_owned).or_else(|| std::env::var_os("KILN").map(PathBuf::from))
        {
            return Ok(Self(std::path::absolute(file)?));
        }
        output(Command::new("cargo").args(["build", "--release", "--quiet", "--locked", "--bin", "kiln"]))?;
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
        Ok(Self(std::path::absolute(target.join("release/kiln"))?))
    }

    /// A command of kiln.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.0);
        command.args(arguments);
        command
    }

    /// Renders a picture. Returns processor seconds of the whole process, and what it wrote to standard error.
    pub fn render(&self, scene: &Path, options: &[&str], picture: &Path) -> Result<(f64, String)> {
        let before = child_seconds();
        let done = output(self.command(&["render"]).arg(scene).args(options).arg("-o").arg(picture))?;
        Ok((child_seconds() - before, String::from_utf8_lossy(&done.stderr).into_owned()))
    }

    /// The figures of `kiln compare` for the displayed values of two pictures.
    pub fn compare(&self, reference: &Path, picture: &Path) -> Result<Value> {
        let mut command = self.command(&["compare", "--display", "--json"]);
        // Pictures that differ are exit code 1.
        let done = command.args([reference, picture]).output()?;
        let found: Value = serde_json::from_slice(&done.stdout)
            .map_err(|error| format!("{command:?}: {error}\n{}", String::from_utf8_lossy(&done.stderr)))?;
        Ok(found["errors"]["figures"].clone())
    }
}
