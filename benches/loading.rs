//! Times and peak memory of reading a generated OBJ file by kiln, tobj and tinyobjloader, as a table:
//!
//! `cargo bench --bench loading -- --folder FOLDER [--triangles N] [--runs N] [--python FILE]`
//!
//! The file is written to FOLDER, of which it takes 0.5 to 1.2 GB for the default 10 million triangles, and deleted.
//! Each run is a process of its own, which prints its seconds, its peak memory and the size of its mesh. The first run
//! of each loader is not counted. `--python` names an interpreter with the package `tinyobjloader`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use kiln::error::Warnings;
use kiln::scene::{Attribute, Mesh};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// What tinyobjloader does for a file: the same output as [`load`].
const TINYOBJLOADER: &str = "
import resource, sys, time, tinyobjloader
start = time.perf_counter()
config = tinyobjloader.ObjReaderConfig()
config.triangulate = True
reader = tinyobjloader.ObjReader()
assert reader.ParseFromFile(sys.argv[1], config), reader.Error()
seconds = time.perf_counter() - start
triangles = sum(len(shape.mesh.num_face_vertices) for shape in reader.GetShapes())
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, 0, triangles)
";

/// Attributes of the vertices of a file.
const KINDS: [&str; 3] = ["v", "v//vn", "v/vt/vn"];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [loader, file] = &arguments[..]
        && ["kiln", "tobj"].contains(&loader.as_str())
    {
        return load(loader, Path::new(file));
    }
    let option = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1)
    };
    let Some(folder) = option("--folder").map(PathBuf::from) else {
        eprintln!("give --folder FOLDER, where 1.2 GB are free");
        return Ok(());
    };
    let triangles: usize = option("--triangles").map_or(Ok(10_000_000), |n| n.parse())?;
    let runs: usize = option("--runs").map_or(Ok(5), |n| n.parse())?;
    println!("| file | loader | seconds | MB/s | peak, MB | peak by mesh |");
    println!("| --- | --- | ---: | ---: | ---: | ---: |");
    for kind in KINDS {
        let file = folder.join(format!("loading-{}.obj", kind.replace('/', "")));
        write_grid(&file, triangles, kind)?;
        let table = table(&file, kind, runs, option("--python"));
        std::fs::remove_file(&file)?;
        table?;
    }
    Ok(())
}

/// Prints the rows of a file.
fn table(file: &Path, kind: &str, runs: usize, python: Option<&String>) -> Result<()> {
    let megabytes = std::fs::metadata(file)?.len() as f64 / 1e6;
    let this = std::env::current_exe()?;
    let mut size_of_mesh = 0.0;
    for loader in ["kiln", "tobj", "tinyobjloader"] {
        let command = || match (loader, python) {
            ("tinyobjloader", None) => None,
            ("tinyobjloader", Some(python)) => {
                let mut command = Command::new(python);
                command.args(["-c", TINYOBJLOADER]);
                Some(command)
            }
            _ => {
                let mut command = Command::new(&this);
                command.arg(loader);
                Some(command)
            }
        };
        let (mut seconds, mut peaks) = (Vec::new(), Vec::new());
        for run in 0..=runs {
            let Some(mut command) = command() else { break };
            let done = command.arg(file).output()?;
            let said = String::from_utf8(done.stdout)?;
            let figures: Vec<f64> =
                said.split_whitespace().map(str::parse).collect::<std::result::Result<_, _>>()?;
            let &[time, peak, mesh, _] = &figures[..] else {
                return Err(format!("{loader}: {}", String::from_utf8_lossy(&done.stderr)).into());
            };
            if run > 0 {
                seconds.push(time);
                peaks.push(peak / 1e6);
            }
            if mesh > 0.0 {
                size_of_mesh = mesh / 1e6;
            }
        }
        if seconds.is_empty() {
            continue;
        }
        seconds.sort_by(f64::total_cmp);
        let (median, peak) = (seconds[runs / 2], peaks.iter().fold(0.0, |a: f64, &b| a.max(b)));
        let (least, most) = (seconds[0], seconds[runs - 1]);
        println!(
            "| `{kind}`, {megabytes:.0} MB | {loader} | {median:.2} ({least:.2} to {most:.2}) | {} | {peak:.0} | {} |",
            (megabytes / median).round(),
            (peak / size_of_mesh * 100.0).round() / 100.0,
        );
    }
    Ok(())
}

/// Reads `file` and prints seconds, peak memory in bytes, size of the mesh in bytes (0 if unknown) and triangles.
fn load(loader: &str, file: &Path) -> Result<()> {
    let start = Instant::now();
    let (seconds, bytes, triangles) = if loader == "kiln" {
        let scene = kiln::import::load(&[file.to_owned()], &mut Warnings::default())?;
        let seconds = start.elapsed();
        let bytes: usize = scene.objects.iter().filter_map(|object| object.shape.mesh()).map(size).sum();
        (seconds, bytes, scene.primitive_count())
    } else {
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let (models, _) = tobj::load_obj(file, &options)?;
        (start.elapsed(), 0, models.iter().map(|model| model.mesh.indices.len() / 3).sum())
    };
    println!("{} {} {bytes} {triangles}", seconds.as_secs_f64(), peak()?);
    Ok(())
}

/// Size of a mesh in bytes.
fn size(mesh: &Mesh) -> usize {
    fn of<'a, T: 'a>(attributes: impl IntoIterator<Item = &'a Attribute<T>>) -> usize {
        let of_one = |attribute: &Attribute<T>| {
            let triangles = attribute.triangles.as_ref().map_or(0, |t| size_of_val(&t[..]));
            size_of_val(&attribute.values[..]) + triangles
        };
        attributes.into_iter().map(of_one).sum()
    }
    let own = size_of_val(&mesh.positions[..]) + size_of_val(&mesh.triangles[..]);
    own + of(&mesh.normals) + of(&mesh.uvs) + of(&mesh.colours)
}

/// Peak resident memory of this process in bytes (Linux: proc_pid_status(5)).
fn peak() -> Result<u64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).ok_or("no VmHWM")?;
    Ok(line.trim().trim_end_matches("kB").trim().parse::<u64>()? * 1024)
}

/// Writes a grid of about `triangles` triangles.
fn write_grid(file: &Path, triangles: usize, kind: &str) -> Result<()> {
    let side = (triangles as f64 / 2.0).sqrt().round() as usize;
    let mut out = BufWriter::with_capacity(1 << 20, File::create(file)?);
    let points = || (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y)));
    let at = |i: usize| i as f64 / side as f64;
    for (x, y) in points() {
        let (x, y) = (at(x), at(y));
        let z = 0.1 * (37.0 * x).sin() * (23.0 * y).cos();
        writeln!(out, "v {:.6} {:.6} {z:.6}", 2.0 * x - 1.0, 2.0 * y - 1.0)?;
    }
    if kind.contains("vt") {
        for (x, y) in points() {
            writeln!(out, "vt {:.6} {:.6}", at(x), at(y))?;
        }
    }
    if kind.contains("vn") {
        for (x, y) in points() {
            let (a, b) = (37.0 * at(x), 23.0 * at(y));
            let [x, y] = [-1.85 * a.cos() * b.cos(), 1.15 * a.sin() * b.sin()];
            let length = (x * x + y * y + 1.0).sqrt();
            writeln!(out, "vn {:.6} {:.6} {:.6}", x / length, y / length, 1.0 / length)?;
        }
    }
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let a = y * (side + 1) + x + 1;
        let [b, c, d] = [a + 1, a + side + 2, a + side + 1];
        for [a, b, c] in [[a, b, c], [a, c, d]] {
            match kind {
                "v" => writeln!(out, "f {a} {b} {c}")?,
                "v//vn" => writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?,
                _ => writeln!(out, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?,
            }
        }
    }
    Ok(out.flush()?)
}
