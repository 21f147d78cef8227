//! `wheel`: the package for Python, built and tested in a virtual environment of its own.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::run::Result;

/// Build the Python wheel, install it in a new virtual environment and run its tests
///
/// Needs Python 3.10 or later, with venv, and packages of PyPI.
#[derive(clap::Args)]
pub struct Options {
    /// Copy of trimesh's repository, whose tests of rays are run with kiln in the place of trimesh's intersectors
    #[arg(long, value_name = "FOLDER")]
    trimesh: Option<PathBuf>,
    /// Call queries 100,000 times with arguments of any kind, and measure the memory of 10,000 builds
    #[arg(long)]
    fuzz: bool,
    /// Print the table of docs/python.md: queries beside embreex and trimesh, Open3D and libigl
    #[arg(long)]
    benchmark: bool,
}

/// What the tests need beside the wheel; trimesh's tests need the second list, too.
const PACKAGES: [&str; 9] =
    ["maturin>=1.9,<2", "numpy", "pytest", "hypothesis", "trimesh", "rtree", "scipy", "shapely", "mypy"];
const PACKAGES_OF_BENCHMARK: [&str; 2] = ["open3d", "libigl"];
const PACKAGES_OF_TRIMESH: [&str; 6] =
    ["embreex==4.4.*", "networkx", "manifold3d", "lxml", "jsonschema", "pillow"];

/// Runs a command whose output is shown. An exit code other than 0 is an error.
fn run(command: &mut Command) -> Result<()> {
    let status = command.status().map_err(|error| format!("{command:?}: {error}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?}: {status}").into()) }
}

pub fn run_all(options: &Options) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let bin = folder.path().join(if cfg!(windows) { "venv/Scripts" } else { "venv/bin" });
    let python = |arguments: &[&str]| {
        let mut command = Command::new(bin.join("python"));
        command.args(arguments);
        command
    };
    let interpreter = if cfg!(windows) { "python" } else { "python3" };
    run(Command::new(interpreter).args(["-m", "venv"]).arg(folder.path().join("venv")))?;
    let install = |packages: &[&str]| run(python(&["-m", "pip", "install", "--quiet"]).args(packages));
    install(&PACKAGES)?;
    if options.trimesh.is_some() || options.benchmark {
        install(&PACKAGES_OF_TRIMESH)?;
    }
    if options.benchmark {
        install(&PACKAGES_OF_BENCHMARK)?;
    }
    let wheels = folder.path().join("wheels");
    let build =
        ["-m", "maturin", "build", "--release", "--locked", "--manifest-path", "python/Cargo.toml", "--out"];
    run(python(&build).arg(&wheels))?;
    let wheel = std::fs::read_dir(&wheels)?.next().ok_or("maturin made no wheel")??.path();
    run(python(&["-m", "pip", "install", "--quiet"]).arg(&wheel))?;
    run(&mut python(&["-m", "mypy", "--strict", "--ignore-missing-imports", "python/kiln"]))?;
    run(&mut python(&["-m", "pytest", "--quiet", "python/tests"]))?;
    if let Some(trimesh) = &options.trimesh {
        let tests = ["test_ray.py", "test_ray_upstream.py"].map(|file| trimesh.join("tests").join(file));
        let plugin = Path::new("python/tests/trimesh").canonicalize()?;
        let pytest = ["-m", "pytest", "--quiet", "-p", "kiln_backend"];
        run(python(&pytest).args(tests).env("PYTHONPATH", plugin))?;
    }
    if options.fuzz {
        run(&mut python(&["python/tests/fuzz.py"]))?;
        run(&mut python(&["python/tests/memory.py"]))?;
    }
    if options.benchmark {
        run(&mut python(&["python/tests/benchmark.py"]))?;
    }
    println!("{} works", wheel.file_name().unwrap_or_default().display());
    Ok(())
}
