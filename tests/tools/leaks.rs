//! Closed meshes have no leaks at any size or position, and the test detects rays that leak.

use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use kiln::render::RenderControl;
use kiln_lab::bench::PLACEMENTS;
use kiln_lab::bench::leaks::{LeakRow, NAMES, engines, measure};
use serde_json::Value;

const RAYS: u64 = 5_000;

fn rows(engine: &str) -> Vec<LeakRow> {
    assert!(NAMES.contains(&engine));
    let mut engines = engines().0;
    engines.retain(|e| e.label.engine == engine);
    let cancel = AtomicBool::new(false);
    let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
    let rows = measure(&engines, RAYS, &control).expect("every structure can be built");
    assert!(!rows.is_empty() && rows.len() == engines.len() * PLACEMENTS.len());
    rows
}

/// Tiers that promise it keep it; a tier that promises less may lose rays.
#[test]
fn no_ray_slips_through_kilns_structures() {
    for row in rows("kiln") {
        match row.tier {
            Some("fast") => assert!(row.leaks.total() > RAYS / 20, "{row:?}"),
            _ => assert_eq!(row.leaks.total(), 0, "{row:?}"),
        }
    }
}

/// The rays are hard enough to find the gaps of a test that has some. Möller and Trumbore's, which loses about a tenth
/// of the rays that meet an edge from behind, is one.
#[test]
fn rays_slip_through_where_there_are_gaps() {
    for row in rows("obvhs") {
        assert!(row.leaks.aimed > RAYS / 20 && row.leaks.outside > RAYS / 20, "{row:?}");
        assert!(row.leaks.secondary > RAYS / 100, "{row:?}");
    }
}

#[test]
#[ignore = "needs KILN_EMBREE=/path/to/libembree4.so"]
fn with_embree_the_robust_mode_loses_fewer_rays_than_the_default() {
    let rows = rows("embree");
    let leaks = |layout: &str| -> u64 {
        rows.iter().filter(|row| row.layout == layout).map(|row| row.leaks.primary()).sum()
    };
    // Without secondary rays, whose origins are this measurement's and not Embree's.
    assert!(leaks("robust") * 10 < leaks("default"), "{} {}", leaks("robust"), leaks("default"));
}

/// Runs `kiln bench leaks`, with KILN_EMBREE as given.
fn run(arguments: &str, embree: Option<&str>) -> Output {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    command.args(["bench", "leaks"]).args(arguments.split_whitespace()).env_remove("KILN_EMBREE");
    if let Some(file) = embree {
        command.env("KILN_EMBREE", file);
    }
    command.output().expect("the command starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("the command writes UTF-8")
}

/// The rows of a report.
fn rows_of(output: &Output) -> Vec<Value> {
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&report["schema"], &report["subject"]), (&1.into(), &"generated meshes".into()));
    report["rows"].as_array().expect("rows").clone()
}

#[test]
fn the_command_prints_json_with_a_row_for_each_layout_and_placement() {
    let output = run("--rays 1000 --json --engine kiln --engine obvhs", None);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""));
    let rows = rows_of(&output);
    for (engine, layout, triangles) in [
        // 20 * 4^2 and 20 * 4^6.
        ("kiln", "brute-force", 320),
        ("kiln", "bvh8", 81_920),
        ("obvhs", "bvh2", 81_920),
        ("obvhs", "cwbvh", 81_920),
    ] {
        for placement in PLACEMENTS {
            let is_it = |row: &&Value| {
                row["engine"] == engine && row["layout"] == layout && row["placement"] == placement.name
            };
            let row = rows.iter().find(is_it).unwrap_or_else(|| panic!("{engine} {layout} {placement:?}"));
            assert_eq!(row["triangles"], triangles);
            // 1000 and 60 from inside, 1000 from outside, 1000 secondary, 1000 random.
            assert_eq!((&row["rays"], &row["rays_inside"]), (&4060.into(), &1060.into()));
            assert_eq!(row["tier"].is_string(), engine == "kiln");
            let leaks = |key: &str| row[key].as_u64().unwrap_or_else(|| panic!("{key}: {row}"));
            assert_eq!(
                leaks("leaks"),
                ["inside", "outside", "secondary", "random"]
                    .map(|kind| leaks(&format!("leaks_{kind}")))
                    .iter()
                    .sum::<u64>()
            );
            assert!(leaks("leaks_axis_aligned") <= leaks("leaks_inside"));
            assert_eq!(row["skipped_reason"], Value::Null);
        }
    }
    assert!(rows.iter().all(|row| row["engine"] == "kiln" || row["engine"] == "obvhs"));
}

#[test]
fn the_command_prints_the_same_for_any_number_of_threads() {
    let on = |threads: u32| run(&format!("--rays 6000 --engine obvhs --threads {threads}"), None).stdout;
    let one = on(1);
    assert_eq!(text(&one), text(&on(3)));
    // Counts, and what they would be of a million.
    assert_eq!(text(&one).matches("\nobvhs   cwbvh   -        81,920  ").count(), 2, "{}", text(&one));
}

#[test]
fn engines_that_are_not_there_are_named_with_the_reason() {
    let output = run("--rays 1", Some("/gone/libembree4.so"));
    assert_eq!(output.status.code(), Some(0));
    let said = text(&output.stdout);
    assert!(said.contains("\nembree: not measured: /gone/libembree4.so: "), "{said}");
    let output = run("--rays 1 --json", None);
    let rows = rows_of(&output);
    let embree = rows.iter().find(|row| row["engine"] == "embree").expect("a row all the same");
    assert_eq!((&embree["rays"], &embree["leaks"]), (&0.into(), &Value::Null));
    let reason = embree["skipped_reason"].as_str().expect("a reason");
    assert!(reason.starts_with("KILN_EMBREE names no library; set KILN_EMBREE to "), "{reason}");
}

#[test]
fn asking_for_what_is_not_there_is_an_error() {
    let errors = [
        ("--engine embree", 1, "embree: KILN_EMBREE names no library\nhint: set KILN_EMBREE to "),
        ("--engine emrbee", 2, "invalid value 'emrbee' for '--engine <NAME>'\nhint: "),
        (
            "--rays 0",
            2,
            "invalid value '0' for '--rays <N>': give a whole number from 1 to 1000000000\nhint: ",
        ),
        ("--threads 0", 2, "invalid value '0' for '--threads <N>': "),
    ];
    for (arguments, code, error) in errors {
        let output = run(arguments, None);
        let said = text(&output.stderr);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(code), ""), "{arguments}: {said}");
        assert!(said.starts_with(&format!("kiln: error: {error}")), "{arguments}: {said}");
        assert_eq!(said.lines().count(), 2, "{arguments}: {said}");
    }
}
