//! [`ResultFile`]: what a measurement was made of, by and on, at the start of its JSON.

use std::fs::read_to_string;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use kiln::bvh::detail::compiled_isa;

/// The fields that `study.json` and the JSON of `kiln bench` begin with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResultFile {
    /// Version of the JSON schema of the report, incremented when a field is removed or changes its meaning.
    pub schema: u32,
    /// Version of kiln.
    pub kiln: String,
    /// Name of what was measured, such as the input files.
    pub subject: String,
    /// The command line.
    pub command: String,
    /// Properties of the machine that the system provides, as names and values.
    pub machine: Vec<[String; 2]>,
}

impl ResultFile {
    /// Describes this machine, and a report. `isa`: the instruction set of the traversal, if there is one alone.
    pub fn new(schema: u32, subject: String, command: String, isa: Option<&str>) -> Self {
        ResultFile { schema, kiln: env!("CARGO_PKG_VERSION").into(), subject, command, machine: machine(isa) }
    }

    /// The envelope around an array of rows, as `rows`.
    pub fn around(&self, rows: Value) -> Value {
        let mut report = serde_json::json!(self);
        report["rows"] = rows;
        report
    }
}

/// Properties of the machine that the system provides, as names and values.
fn machine(isa: Option<&str>) -> Vec<[String; 2]> {
    let mut facts: Vec<[String; 2]> = Vec::new();
    let mut add =
        |name: &str, value: Option<String>| facts.extend(value.map(|value| [name.to_owned(), value]));
    add("processor", Some(processor()));
    add("logical processors", std::thread::available_parallelism().ok().map(|count| count.to_string()));
    add("system", Some(format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)));
    let governor = read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    add("frequency governor", governor.ok().map(|name| name.trim().to_owned()));
    add("others at work (load average)", load());
    add("instructions of the traversal", isa.map(str::to_owned));
    add("instructions the compiler may use", Some(compiled_isa().to_owned()));
    add("build", Some(if cfg!(debug_assertions) { "with debug assertions" } else { "release" }.to_owned()));
    facts
}

/// Name of the processor.
fn processor() -> String {
    let file = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = file.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

/// Load average of the last minute.
fn load() -> Option<String> {
    Some(read_to_string("/proc/loadavg").ok()?.split(' ').next()?.to_owned())
}
