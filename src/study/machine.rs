//! Description of the machine.

use std::fs::read_to_string;

use crate::bvh::{Accelerator, compiled_isa};

/// Properties of the machine that the system provides, as names and values.
pub(crate) fn machine(accelerator: &dyn Accelerator) -> Vec<[String; 2]> {
    let mut facts: Vec<[String; 2]> = Vec::new();
    let mut add =
        |name: &str, value: Option<String>| facts.extend(value.map(|value| [name.to_owned(), value]));
    let cpuinfo = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = cpuinfo.lines().find(|line| line.starts_with(name))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    add("processor", field("model name").or_else(|| Some(std::env::consts::ARCH.to_owned())));
    add("logical processors", std::thread::available_parallelism().ok().map(|count| count.to_string()));
    add("system", Some(format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)));
    let governor = read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    add("frequency governor", governor.ok().map(|name| name.trim().to_owned()));
    add("others at work (load average)", load());
    add("instructions of the traversal", Some(accelerator.describe().isa.to_owned()));
    add("instructions the compiler may use", Some(compiled_isa().to_owned()));
    add("build", Some(if cfg!(debug_assertions) { "with debug assertions" } else { "release" }.to_owned()));
    facts
}

/// Load average of the last minute.
fn load() -> Option<String> {
    Some(read_to_string("/proc/loadavg").ok()?.split(' ').next()?.to_owned())
}
