//! The command line: parsing, calls into the library, and printing. One file per command. Tests cover output and exit
//! codes.
//!
//! Standard output contains only results; everything else is written to standard error. Exit codes: 0 success, 1
//! failure, 2 wrong usage, 3 unusable input, 4 output cannot be written, 128 + signal number if interrupted. `compare`
//! returns 0 for equal pictures, 1 within the limits and 2 beyond them; `verify` returns 0 if all frames are valid,
//! else 1.

mod animate;
mod arguments;
mod bench;
mod compare;
mod each_input;
mod explain;
mod frames;
mod info;
mod interrupt;
mod merge;
mod message;
mod names;
mod numbers;
mod options;
mod output;
pub mod picture;
mod prepare;
mod progress;
mod render;
#[cfg(all(test, feature = "viewer"))]
#[path = "same_picture/tests.rs"]
mod same_picture;
mod sample_count;
mod sampling;
mod schema;
mod statistics;
mod study;
mod synonyms;
mod t_test;
mod verify;
#[cfg(feature = "viewer")]
mod view;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::Ordering;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use message::{Message, WarningPrinter};

use kiln::error::{Error, Result, is_contained, printable_json, printable_lines};
use kiln::files;
use kiln::limits;
use kiln::scene::option::group;
use kiln::scene::{ImportOptions, shell_quoted};

#[derive(Parser)]
#[command(
    name = "kiln",
    version,
    about = "A BVH-accelerated ray tracer for OBJ, glTF and its own scene files",
    after_help = "Examples:\n  kiln render scenes/assignment.toml -o assignment.png\n  \
                  kiln render model.glb -o model.png --view iso\n  kiln render *.stl -o '{name}.png'\n  kiln animate model.glb -o turntable.mp4\n  kiln info model.obj"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Maximum memory, such as 16G, at least 128M [default: the available memory; 4G for the sizes in one input file]
    #[arg(long, global = true, help_heading = group::LIMITS, display_order = 900, value_name = "SIZE", value_parser = limits::parse_limit)]
    memory_limit: Option<u64>,
    /// Maximum contents of input files: triangles=N (with spheres and disks), texels=N or nodes=N; may be repeated
    /// [default: triangles=4294967295, texels=4294967296, nodes=16777216]
    #[arg(long, global = true, help_heading = group::LIMITS, display_order = 900, value_name = "KIND=N", value_parser = limits::parse_count)]
    limit: Vec<(limits::Counted, u64)>,
}

#[derive(Subcommand)]
enum Command {
    /// Render a picture
    Render(Box<render::Command>),
    /// Render an animation, or a turntable of a mesh, to a film or numbered frames
    Animate(Box<animate::Command>),
    /// Open an interactive viewer
    #[cfg(feature = "viewer")]
    View(Box<view::Command>),
    /// Open an interactive viewer (not in this build: it needs the feature `viewer`)
    #[cfg(not(feature = "viewer"))]
    #[command(disable_help_flag = true)]
    View {
        #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
        _arguments: Vec<std::ffi::OsString>,
    },
    /// Combine the shards of a picture that `kiln render --shard` wrote
    Merge(merge::Command),
    /// List frames that are missing, damaged or rendered with different settings
    Verify(Box<verify::Command>),
    /// List the effects of a picture, why each is on or off, and its cost
    Explain(Box<explain::Command>),
    /// Describe input files: contents, bounds, memory and defects
    Info(info::Arguments),
    /// Measure render time and error of a scene over many settings, as an HTML page
    Study(Box<study::Command>),
    /// Benchmark speed, memory and errors of ray queries, beside other libraries
    Bench(Box<bench::Command>),
    /// Compare two pictures: maximum difference, RMSE, PSNR, FLIP
    Compare(compare::Arguments),
    /// Print the JSON schema of scene files, for editors
    Schema,
    /// Print shell completions
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
}

impl Command {
    /// The import options, if the command reads input files.
    fn import(&mut self) -> Option<&mut ImportOptions> {
        Some(match self {
            Command::Render(command) => &mut command.arguments.options.import,
            Command::Animate(command) => &mut command.arguments.options.import,
            #[cfg(feature = "viewer")]
            Command::View(command) => &mut command.arguments.options.import,
            Command::Verify(command) => &mut command.arguments.options.import,
            Command::Explain(command) => &mut command.arguments.options.import,
            Command::Study(command) => &mut command.arguments.options.import,
            Command::Info(arguments) => &mut arguments.import,
            Command::Bench(arguments) => arguments.import(),
            _ => return None,
        })
    }
}

/// The options of pictures that `-h` lists, beside those of measurement; `--help` lists all.
const SHORT_HELP: [&str; 11] = [
    "output",
    "size",
    "view",
    "camera",
    "samples",
    "noise",
    "transport",
    "numerics",
    "environment",
    "threads",
    "help",
];

/// The command with a short `-h` where it takes the options of pictures.
fn with_short_help(command: clap::Command) -> clap::Command {
    // `--limit` and `--memory-limit` belong to the root command.
    let is_long =
        command.get_arguments().any(|argument| ["camera", "limit"].contains(&argument.get_id().as_str()));
    let command = command.mut_args(|argument| {
        let own = argument.is_positional() || argument.get_help_heading() == Some(group::MEASUREMENT);
        let is_short = own || argument.get_long().is_some_and(|name| SHORT_HELP.contains(&name));
        argument.hide_short_help(is_long && !is_short)
    });
    command.mut_subcommands(with_short_help)
}

/// The words of the command line after the command's name.
static TYPED: OnceLock<Vec<OsString>> = OnceLock::new();

/// The typed command, quoted for a shell.
fn typed() -> String {
    let words = TYPED.get().into_iter().flatten();
    let rest = words.map(|argument| shell_quoted(&argument.to_string_lossy()));
    std::iter::once("kiln".to_owned()).chain(rest).collect::<Vec<_>>().join(" ")
}

/// Runs the command of this process and returns its exit code.
pub fn main() -> ExitCode {
    ExitCode::from(run(std::env::args_os().skip(1).collect()))
}

/// Parses the words after the command's name, runs the command and returns its exit code. For one call a process.
pub fn run(words: Vec<OsString>) -> u8 {
    let words = TYPED.get_or_init(|| words);
    message::set_syntax(words.iter().cloned());
    let words = [OsString::from("kiln")].into_iter().chain(words.iter().cloned());
    let parsed = with_short_help(Arguments::command()).try_get_matches_from(words);
    let arguments = match parsed.and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(e) => return report_usage_error(&e),
    };
    if let Some(bytes) = arguments.memory_limit {
        limits::set_memory_limit(bytes);
    }
    let Arguments { mut command, limit, .. } = arguments;
    if let Some(import) = command.import() {
        let with = |limits: limits::Limits, &(counted, most): &_| limits.with(counted, most);
        import.limits = limit.iter().fold(import.limits, with);
    }
    std::panic::set_hook(Box::new(|panic| {
        if is_contained() {
            return;
        }
        let place = panic.location().map(|l| format!(" ({}:{})", l.file(), l.line())).unwrap_or_default();
        let hint = "please report it with the command and the input";
        Message::Error { what: &format!("a fault in kiln itself{place}"), hint, exit_code: 1 }.print();
    }));
    files::protect_inputs();
    if !matches!(command, Command::View { .. }) {
        files::separate_outputs();
    }
    let interrupted = interrupt::install();
    let result = std::panic::catch_unwind(|| {
        let done = match command {
            Command::Render(arguments) => return render::run(&arguments, interrupted),
            Command::Animate(arguments) => animate::run(&arguments, interrupted),
            #[cfg(feature = "viewer")]
            Command::View(arguments) => view::run(&arguments),
            #[cfg(not(feature = "viewer"))]
            Command::View { .. } => Err(Error::usage(
                "this build has no viewer",
                "install it with `cargo install --path crates/cli --features full`, or use `kiln render`",
            )),
            Command::Merge(arguments) => merge::run(&arguments),
            Command::Verify(arguments) => return verify::run(&arguments),
            Command::Explain(arguments) => explain::run(&arguments, interrupted),
            Command::Info(arguments) => info::run(&arguments),
            Command::Study(arguments) => study::run(&arguments, interrupted),
            Command::Bench(arguments) => bench::run(&arguments, interrupted),
            Command::Compare(arguments) => return compare::run(&arguments),
            Command::Schema => print(&json_text(&schema::schema())),
            Command::Completions { shell } => {
                let mut text = Vec::new();
                clap_complete::generate(shell, &mut Arguments::command(), "kiln", &mut text);
                print_raw(&text)
            }
        };
        done.map(|()| 0)
    });
    match result {
        Ok(Ok(code)) => code,
        // Errors after an interrupt are consequences of it.
        Ok(Err(e)) if e == Error::Interrupted || interrupted.load(Ordering::Relaxed) => {
            Message::Interrupted { exit_code: interrupt::exit_code() }.print();
            interrupt::exit_code()
        }
        Ok(Err(e)) => {
            Message::Error { what: &e.to_string(), hint: e.hint(), exit_code: exit_code(&e) }.print();
            exit_code(&e)
        }
        Err(_) => 1,
    }
}

fn exit_code(e: &Error) -> u8 {
    match e {
        Error::Failed { .. } | Error::Memory { .. } => 1,
        Error::Usage { .. } => 2,
        Error::Input { .. } => 3,
        Error::Output { .. } => 4,
        Error::Interrupted => interrupt::exit_code(),
    }
}

/// Prints help and version to standard output; other parse errors to standard error, as one line and a hint.
fn report_usage_error(e: &clap::Error) -> u8 {
    use clap::error::ErrorKind;
    if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        return if e.print().is_ok() { 0 } else { 4 };
    }
    let (what, hint) = match e.kind() {
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            ("no command given".to_owned(), "`kiln --help` lists them".to_owned())
        }
        _ => usage_error(e),
    };
    Message::Error { what: &what, hint: &hint, exit_code: 2 }.print();
    2
}

/// What is wrong with the arguments, and a hint.
fn usage_error(e: &clap::Error) -> (String, String) {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let texts = |kind| match e.get(kind) {
        Some(ContextValue::String(text)) => std::slice::from_ref(text),
        Some(ContextValue::Strings(texts)) => texts,
        _ => &[],
    };
    let text = e.render().to_string();
    let mut what = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    let invalid = texts(ContextKind::InvalidArg);
    let listed = match (e.kind(), e.get(ContextKind::PriorArg)) {
        (ErrorKind::MissingRequiredArgument, _) => invalid,
        (ErrorKind::ArgumentConflict, Some(ContextValue::Strings(others))) => others,
        _ => &[],
    };
    if !listed.is_empty() {
        let listed: Vec<&str> = listed.iter().map(|one| one.trim_end_matches('.')).collect();
        what = format!("{what} {}", listed.join(", "));
    }
    let suggested =
        [ContextKind::SuggestedArg, ContextKind::SuggestedValue, ContextKind::SuggestedSubcommand];
    let (similar, valid) = (suggested.map(texts).concat(), texts(ContextKind::ValidValue));
    let hint = match (e.kind(), invalid) {
        (ErrorKind::UnknownArgument, [typed]) => synonyms::hint(typed),
        // In the order of their definition.
        (ErrorKind::MissingRequiredArgument, [.., last]) if last.split(' ').next() == Some("--output") => {
            Some("name the file to write, such as -o picture.png".to_owned())
        }
        _ => None,
    };
    let is_file = texts(ContextKind::InvalidSubcommand).iter().any(|typed| typed.contains('.'));
    let hint = hint.unwrap_or_else(|| match (&similar[..], valid) {
        ([], []) if is_file => "name the command first: kiln render INPUT -o picture.png".to_owned(),
        ([], []) => "`kiln help` lists the commands, `kiln help COMMAND` its options".to_owned(),
        ([], valid) => format!("possible values: {}", valid.join(", ")),
        (similar, _) => format!("did you mean '{}'?", similar.join("' or '")),
    });
    (what, hint)
}

/// Indented JSON of a result.
fn json_text(value: &serde_json::Value) -> String {
    printable_json(&format!("{value:#}\n")).into_owned()
}

/// Writes a result to standard output. Escapes control characters except line breaks; callers escape untrusted text
/// within a line by [`printable`].
fn print(text: &str) -> Result<()> {
    print_raw(printable_lines(text).as_bytes())
}

/// Writes trusted bytes to standard output.
fn print_raw(bytes: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        // A reader such as `head` may close the pipe early.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::output(std::path::Path::new("-"), files::describe(&e))),
    }
}

/// Creates the thread pool. The default number of threads is [`std::thread::available_parallelism`], which respects
/// affinity and cgroup quota, limited by Slurm's allocation, for clusters that do not enforce it.
///
/// # Errors
/// [`Error::Failed`] where threads cannot be started.
pub fn pool(threads: Option<u16>) -> Result<rayon::ThreadPool> {
    let allocated =
        std::env::var("SLURM_CPUS_PER_TASK").ok().and_then(|n| n.parse::<usize>().ok()).filter(|&n| n > 0);
    let number = match (threads, allocated) {
        (Some(threads), _) => usize::from(threads),
        (None, Some(allocated)) => {
            std::thread::available_parallelism().map_or(allocated, |n| allocated.min(n.get()))
        }
        (None, None) => 0,
    };
    let builder = rayon::ThreadPoolBuilder::new().num_threads(number).stack_size(STACK as usize);
    let pool = has_room_for_stacks(number as u64).then(|| builder.build().ok()).flatten();
    pool.ok_or_else(|| Error::Failed {
        what: "the system cannot start that many threads".into(),
        hint: "give a smaller number as --threads, or raise the limits on memory and threads".into(),
    })
}

/// Runs `work` in a pool of so many threads; without a number in that of the caller, if it is in one.
///
/// # Errors
/// As [`pool`].
fn in_pool<R: Send>(threads: Option<u16>, work: impl FnOnce() -> R + Send) -> Result<R> {
    match threads {
        None if rayon::current_thread_index().is_some() => Ok(work()),
        _ => Ok(pool(threads)?.install(work)),
    }
}

/// Bytes of a thread's stack: the default of the standard library.
const STACK: u64 = 2 << 20;

/// Whether the stacks of so many threads take at most half of the address space, where that is limited. A thread that
/// starts while nothing is left ends the process.
fn has_room_for_stacks(threads: u64) -> bool {
    #[cfg(unix)]
    let most = rustix::process::getrlimit(rustix::process::Resource::As).current;
    #[cfg(not(unix))]
    let most: Option<u64> = None;
    most.is_none_or(|most| threads * STACK <= most / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All commands and subcommands.
    pub(super) fn commands() -> Vec<clap::Command> {
        let mut all = vec![Arguments::command()];
        let mut next = 0;
        while let Some(command) = all.get(next) {
            all.extend(command.get_subcommands().cloned().collect::<Vec<_>>());
            next += 1;
        }
        all
    }

    /// The options of a command.
    pub(super) fn options(command: &clap::Command) -> Vec<clap::Arg> {
        command
            .get_opts()
            .chain(command.get_arguments().filter(|a| !a.get_action().takes_values()))
            .cloned()
            .collect()
    }

    /// clap itself checks this in builds with debug assertions alone. A group is named after the type of its options.
    #[test]
    fn groups_of_options_have_names_of_their_own() {
        for command in &commands() {
            let mut names: Vec<_> = command.get_groups().map(clap::ArgGroup::get_id).collect();
            names.sort();
            assert!(names.is_sorted_by(|a, b| a < b), "{}: {names:?}", command.get_name());
        }
    }

    #[test]
    fn the_short_help_is_short() {
        let mut command = with_short_help(Arguments::command()).term_width(100);
        command.build();
        for name in ["render", "explain", "study"] {
            let command = command.find_subcommand_mut(name).expect("a command");
            let [short, long] = [command.render_help(), command.render_long_help()];
            let [short, long] = [short, long].map(|help| help.to_string().lines().count());
            assert!(short <= 60 && long > 150, "{name}: {short} lines of {long}");
        }
    }

    #[test]
    fn every_option_has_a_group() {
        let commands = commands();
        assert!(commands.len() > 15);
        for command in &commands {
            for option in options(command) {
                assert!(option.get_help_heading().is_some(), "{} --{}", command.get_name(), option.get_id());
            }
        }
    }
}
