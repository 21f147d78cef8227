//! `kiln bench`: comparison of kiln's acceleration structures with other libraries, and the price of accuracy.

mod contains;
mod leaks;
mod price;
mod scaling;
mod speed;
mod subject;

use std::sync::atomic::AtomicBool;

use clap::{Args, Subcommand};
use serde_json::Value;

use super::progress::Progress;
use super::typed;
use kiln::error::Result;
use kiln::render::RenderControl;
use kiln::scene::ImportOptions;
use kiln_lab::bench::ResultFile;
use kiln_lab::bench::three_digits;
use kiln_lab::timing::Quartiles;

#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Command {
    #[command(subcommand)]
    test: Option<Test>,
    #[command(flatten)]
    pub speed: speed::Arguments,
}

impl Command {
    /// The import options.
    pub(crate) fn import(&mut self) -> &mut ImportOptions {
        match &mut self.test {
            Some(Test::Price(arguments)) => &mut arguments.subject.import,
            _ => &mut self.speed.subject.import,
        }
    }
}

#[derive(Subcommand)]
enum Test {
    /// Count wrong answers of point containment in closed meshes
    Contains(contains::Arguments),
    /// Count rays that leak through closed meshes
    Leaks(leaks::Arguments),
    /// Measure time and errors of each numerics tier, and of other libraries
    Price(Box<price::Arguments>),
    /// Measure build time, memory and speed against the number of triangles
    Scaling(scaling::Arguments),
}

pub(crate) fn run(arguments: &Command, interrupted: &AtomicBool) -> Result<()> {
    match &arguments.test {
        None => {
            arguments
                .speed
                .subject
                .refuse_misspelled(&<Test as Subcommand>::augment_subcommands(clap::Command::new("bench")))?;
            speed::run(&arguments.speed, interrupted)
        }
        Some(Test::Contains(arguments)) => contains::run(arguments, interrupted),
        Some(Test::Leaks(arguments)) => leaks::run(arguments, interrupted),
        Some(Test::Price(arguments)) => price::run(arguments, interrupted),
        Some(Test::Scaling(arguments)) => scaling::run(arguments, interrupted),
    }
}

/// Version of the JSON schema of all benchmarks, incremented when a field is removed or changes its meaning.
const SCHEMA: u32 = 1;

/// The JSON of a benchmark: its rows in an [`ResultFile`].
fn report(subject: &str, rows: Value) -> String {
    // Instruction sets are stated by row.
    super::json_text(&ResultFile::new(SCHEMA, subject.to_owned(), typed(), None).around(rows))
}

/// Runs `work` on a thread pool, with a progress bar on a terminal.
fn with_progress<T: Send>(
    threads: Option<u16>,
    phase: &str,
    interrupted: &AtomicBool,
    work: impl FnOnce(&RenderControl) -> Result<T> + Send,
) -> Result<T> {
    let pool = super::pool(threads)?;
    let progress = Progress::on_terminal();
    progress.phase(phase);
    let steps = |done, total| progress.tiles(done, total);
    let control = RenderControl { cancel: interrupted, progress: &steps, time_stages: false };
    let result = pool.install(|| work(&control));
    progress.clear();
    result
}

/// A median with its quartiles.
fn quartiles(Quartiles { lower, median, upper }: Quartiles) -> String {
    format!("{median:.2} ({lower:.2}-{upper:.2})")
}

/// A table with the first `left` columns aligned to the left, the others to the right.
fn table<'a>(
    titles: impl IntoIterator<Item = &'a str>,
    rows: impl IntoIterator<Item = Vec<String>>,
    left: usize,
) -> String {
    let titles = titles.into_iter().map(str::to_owned).collect();
    let lines: Vec<Vec<String>> = std::iter::once(titles).chain(rows).collect();
    super::numbers::aligned(&lines, |column| column < left)
}

/// The number with groups of three digits separated by commas.
fn grouped(number: u64) -> String {
    kiln::render::grouped(number, ',')
}
