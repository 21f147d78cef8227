//! Scores the engines of `kiln bench`, and any that implements [`kiln_lab::bench::Built`], on the hard cases of
//! `benches/hard-cases`.
//!
//! ```sh
//! cargo run --release --example hard_cases    # Embree: KILN_EMBREE names its library
//! ```

use std::error::Error;
use std::fs::read_to_string;
use std::path::Path;

use kiln::bvh::Ray;
use kiln::bvh::detail::Precision;
use kiln::glam::{DVec3, Vec3};
use kiln_lab::bench::speed::{Kind, engines};
use kiln_lab::bench::{Engine, Mesh};

fn main() -> Result<(), Box<dyn Error>> {
    let cases = read_cases(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../benches/hard-cases"))?;
    println!("{:<52} {:<12} {:>6} {:>6} {:>7} {:>5}", "engine", "case", "rays", "missed", "phantom", "wrong");
    for engine in engines(1).0 {
        let label = &engine.label;
        let name = [Some(label.engine), Some(label.layout), label.tier, label.preset];
        let name = name.into_iter().flatten().collect::<Vec<_>>().join(" ");
        for case in &cases {
            let (rays, [missed, phantom, wrong]) = (case.rays.len(), score(&engine, case)?);
            println!("{name:<52} {:<12} {rays:>6} {missed:>6} {phantom:>7} {wrong:>5}", case.name);
        }
    }
    Ok(())
}

/// A mesh and rays with their answers.
pub struct Case {
    /// The name of its files.
    pub name: String,
    mesh: Mesh,
    rays: Vec<Ray>,
    /// The triangles that each ray hits first, in the interior or at the border.
    answers: Vec<Vec<u32>>,
}

/// Builds a structure over the mesh of a case. The numbers of rays that miss although there is something to hit, that
/// hit although there is nothing, and that hit a triangle which is not among the first.
pub fn score(engine: &Engine, case: &Case) -> kiln::error::Result<[usize; 3]> {
    let built = engine.build(&case.mesh)?;
    let mut queue = built.queue(Kind::Random, &case.rays);
    queue.run();
    let (hits, mut wrong) = (queue.hits(), [0; 3]);
    for (hit, answer) in hits.iter().zip(&case.answers) {
        match hit {
            None => wrong[0] += usize::from(!answer.is_empty()),
            Some(_) if answer.is_empty() => wrong[1] += 1,
            Some(triangle) => wrong[2] += usize::from(!answer.contains(triangle)),
        }
    }
    Ok(wrong)
}

/// Reads all cases of a folder, in the order of their names.
pub fn read_cases(folder: &Path) -> Result<Vec<Case>, Box<dyn Error>> {
    let mut cases = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let rays = entry?.path();
        if rays.extension().is_some_and(|extension| extension == "csv") {
            cases.push(read_case(&rays).map_err(|error| format!("{}: {error}", rays.display()))?);
        }
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(cases)
}

fn read_case(file: &Path) -> Result<Case, Box<dyn Error>> {
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut case = Case { name, mesh: Mesh::default(), rays: Vec::new(), answers: Vec::new() };
    for line in read_to_string(file.with_extension("obj"))?.lines() {
        let [kind, numbers @ ..] = &line.split(' ').collect::<Vec<_>>()[..] else { continue };
        match *kind {
            "v" => case.mesh.positions.push(Vec3::from(numbers_of(numbers)?)),
            "f" => case.mesh.triangles.push(numbers_of::<u32>(numbers)?.map(|index| index - 1)),
            _ => {}
        }
    }
    for line in read_to_string(file)?.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [origin, direction] =
            [numbers_of::<f64>(&cells[..3])?, numbers_of(&cells[3..6])?].map(DVec3::from);
        case.rays.push(Precision::Single.ray(origin, direction, 0.0, f64::INFINITY));
        case.answers.push(cells[7].split_whitespace().map(str::parse).collect::<Result<_, _>>()?);
    }
    Ok(case)
}

fn numbers_of<T: std::str::FromStr + Copy + Default>(words: &[&str]) -> Result<[T; 3], String> {
    let mut numbers = [T::default(); 3];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().map_err(|_| format!("not a number: {word}"))?;
    }
    Ok(numbers)
}
