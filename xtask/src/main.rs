//! `cargo xtask NAME`: measurements, checks and generated pages that need only kiln and cargo.

mod accuracy;
mod effects;
mod licences;
mod make_accuracy;
mod run;
mod sampling;
mod studies;
mod wheel;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Measurements, checks and generated pages of the kiln repository
///
/// Relative paths are relative to the root of the repository. Without --kiln and KILN, the release binary is built.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    /// The kiln binary [default: KILN, or the release binary]
    #[arg(long, global = true, value_name = "FILE")]
    kiln: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Task {
    CheckAccuracy(accuracy::Options),
    CompareSampling(sampling::Options),
    CompareTwoStudies(studies::Options),
    MakeAccuracy(make_accuracy::Options),
    MakeEffects(effects::Options),
    ThirdPartyLicences(licences::Options),
    Wheel(wheel::Options),
}

/// Runs the task. Returns `false` if a check failed.
fn task(arguments: &Arguments) -> run::Result<bool> {
    std::env::set_current_dir(run::ROOT)?;
    let kiln = || run::Kiln::find(arguments.kiln.as_deref());
    match &arguments.task {
        Task::CheckAccuracy(options) => accuracy::run(&kiln()?, options).map(|()| true),
        Task::CompareSampling(options) => sampling::run(&kiln()?, options).map(|()| true),
        Task::CompareTwoStudies(options) => studies::run(&kiln()?, options),
        Task::MakeAccuracy(options) => make_accuracy::run(&kiln()?, options).map(|()| true),
        Task::MakeEffects(_) => effects::run(&kiln()?).map(|()| true),
        Task::ThirdPartyLicences(options) => licences::run(options).map(|()| true),
        Task::Wheel(options) => wheel::run_all(options).map(|()| true),
    }
}

fn main() -> ExitCode {
    match task(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
