//! Statistics, progress and signals.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::common::repository;
use crate::helpers::SCENE;
use crate::workshop::Workshop;

/// The phases of `--stats` cover a run. Of 2,000 instances, fitting the camera was the longest, and in none of them.
#[test]
fn statistics_cover_all_of_the_time() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let side = 50;
    let mut obj = String::new();
    for i in 0..=side {
        for j in 0..=side {
            let [x, z] = [i, j].map(|k| f64::from(k) / f64::from(side));
            obj += &format!("v {x} {} {z}\n", (7.0 * x).sin() * (5.0 * z).cos());
        }
    }
    for i in 0..side {
        for j in 1..=side {
            let a = i * (side + 1) + j;
            let [b, c, d] = [a + 1, a + side + 1, a + side + 2];
            obj += &format!("f {a} {b} {d}\nf {a} {d} {c}\n");
        }
    }
    workshop.write("mesh.obj", obj);
    let places: String = (0..2000).map(|i| format!("{{ translate = [{i}, {}, 0] }},\n", i % 7)).collect();
    workshop.write("many.toml", format!("[[mesh]]\nfile = 'mesh.obj'\nplacements = [\n{places}]\n"));
    let start = Instant::now();
    workshop.succeed("render many.toml -o a.png --size 32x32 --stats a.json");
    let all = start.elapsed().as_secs_f64();
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    let seconds = stats["seconds"].as_object().expect("an object").values();
    let known: f64 = seconds.map(|s| s.as_f64().expect("a number")).sum();
    assert!(known > 0.5 * all, "{known} of {all} seconds: {}", stats["seconds"]);
}

#[test]
fn statistics_are_json_with_the_documented_fields() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.succeed("render scene.toml -o a.png --stats a.json --threads 2");
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    assert_eq!(stats["schema"], 1);
    for pointer in [
        "/seconds/load",
        "/seconds/prepare",
        "/seconds/build",
        "/seconds/render",
        "/seconds/write",
        "/rays/primary/hit",
        "/rays/shadow/cast",
        "/rays/glaze/cast",
        "/tests/nodes",
        "/tests/primitives",
        "/peak_memory_bytes",
    ] {
        let value = stats.pointer(pointer);
        assert!(value.is_some_and(|v| v.as_f64().is_some_and(|x| x >= 0.0)), "{pointer}: {value:?}");
    }
    for pointer in ["/numerics", "/structure/layout", "/instruction_set", "/settings/kiln:camera", "/kiln"] {
        assert!(stats.pointer(pointer).is_some_and(Value::is_string), "{pointer}");
    }
    // One primary ray a pixel: 24 * 16.
    assert_eq!(stats["rays"]["primary"]["cast"], 24 * 16);
    assert_eq!((&stats["threads"], &stats["primitives"]), (&2.into(), &1.into()));
    assert_eq!(stats["non_finite_pixels"], 0);
    assert_eq!(stats["effects"]["shadows"]["on"], true);
    // Rays and time of each effect, and its stages.
    for (effect, is_on) in [("shadows", true), ("terminator", false), ("glaze", false)] {
        for key in ["stages", "rays", "bytes", "thread_seconds"] {
            let figure = stats["effects"][effect][key].as_f64();
            let fits = if is_on { figure > Some(0.0) } else { figure == Some(0.0) };
            assert!(fits, "{effect} {key}: {figure:?}");
        }
        let stages = stats["stages"].as_array().expect("a list");
        assert_eq!(stages.iter().any(|stage| stage["effect"] == effect), is_on, "{effect}");
        assert!(stats["effects"][effect]["why"].is_string(), "{effect}");
    }
    // Without glaze there are no mirror rays and no stage for them.
    assert_eq!(
        (&stats["effects"]["glaze"]["on"], &stats["rays"]["glaze"]["cast"]),
        (&false.into(), &0.into())
    );
    workshop.succeed("render scene.toml -o a.png --stats a.json --without shadows");
    let stats: Value = serde_json::from_slice(&workshop.bytes("a.json")).expect("it is JSON");
    assert_eq!(
        (&stats["effects"]["shadows"]["on"], &stats["rays"]["shadow"]["cast"]),
        (&false.into(), &0.into())
    );
}

#[test]
fn progress_is_fit_for_a_log() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for mode in ["auto", "plain", "json", "none"] {
        let said = workshop.succeed(&format!("render scene.toml -o a.png --progress {mode}"));
        assert!(!said.contains(['\u{1b}', '\r']), "{mode}: {said:?}");
        match mode {
            "none" => assert_eq!(said, ""),
            "json" => assert!(said.starts_with("{\"event\":\"done\""), "{said}"),
            _ => assert!(said.starts_with("kiln: wrote a.png (24 x 16; "), "{said}"),
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_that_cannot_be_written_does_not_stop_the_work() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("bad.obj", "f 1 2 3\n");
    for (arguments, code) in [("render scene.toml -o a.png", 0), ("render bad.obj -o b.png", 3), ("rendr", 2)]
    {
        let full = std::fs::File::create("/dev/full").expect("Linux has it");
        let status = workshop.command("").args(arguments.split_whitespace()).stderr(full).status();
        assert_eq!(status.expect("the command starts").code(), Some(code), "{arguments}");
    }
    assert_eq!(workshop.pixels("a.png").dimensions(), (24, 16));
}

/// Waits for the end of the process, up to a time limit.
fn wait(child: &mut Child, limit: Duration) -> Option<std::process::ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if let Some(status) = child.try_wait().expect("the child can be waited for") {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let _ = child.kill();
    let _ = child.wait();
    None
}

#[cfg(unix)]
#[test]
fn signals_stop_a_long_render_and_leave_nothing_behind() {
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130)] {
        let workshop = Workshop::with("scene.toml", SCENE);
        workshop.write("a.png", "an earlier picture");
        let scene = repository("scenes/assignment.toml");
        let mut command = workshop.command("");
        command.args(["render", "-o", "a.png", "--size", "16000x16000", "--progress", "none"]).arg(&scene);
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the command starts");
        std::thread::sleep(Duration::from_millis(600));
        assert!(child.try_wait().expect("the child can be waited for").is_none(), "the render is long");
        kill_process(Pid::from_child(&child), signal).expect("the command runs");
        let start = Instant::now();
        let status = wait(&mut child, Duration::from_secs(2));
        assert_eq!(status.and_then(|s| s.code()), Some(code), "{signal:?} after {:?}", start.elapsed());
        assert_eq!(workshop.names(), ["a.png", "scene.toml"]);
        assert_eq!(workshop.bytes("a.png"), b"an earlier picture");
    }
}
