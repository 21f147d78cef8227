//! `kiln explain`: the effects that are on, the reasons, and the sum of their costs.

use crate::common::repository;
use assert_cmd::Command;
use kiln::effects::EFFECTS;
use serde_json::Value;

fn explain(arguments: &str) -> String {
    let run = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
        .current_dir(repository("."))
        .arg("explain")
        .args(arguments.split_whitespace())
        .assert()
        .success();
    String::from_utf8_lossy(&run.get_output().stdout).into_owned()
}

fn json(arguments: &str) -> Value {
    serde_json::from_str(&explain(&format!("{arguments} --json"))).expect("it is JSON")
}

#[test]
fn every_effect_is_there_with_its_reason() {
    let said = explain("scenes/assignment.toml --without glaze");
    for effect in EFFECTS {
        assert!(
            said.lines().any(|line| line.starts_with(effect.name())),
            "{} is not in {said}",
            effect.name()
        );
    }
    let line = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned();
    assert!(line("shadows").contains(" on ") && line("shadows").ends_with("light `lamp`"), "{said}");
    assert!(line("glaze").contains(" off ") && line("glaze").ends_with("--without glaze"), "{said}");
    assert!(line("terminator").ends_with("no mesh has vertex normals"), "{said}");
}

#[test]
fn json_has_the_documented_fields() {
    let report = json("scenes/effects/glaze.toml --camera auto");
    assert_eq!(report["schema"], 2);
    let camera = report["settings"]["kiln:camera"].as_str().unwrap_or_default();
    assert!(report["measured"].is_null() && camera.starts_with("{ name = \"auto\", position"), "{report:#}");
    let effects = report["effects"].as_array().expect("a list");
    assert_eq!(effects.len(), EFFECTS.len());
    for (said, effect) in effects.iter().zip(EFFECTS) {
        assert_eq!((&said["name"], &said["summary"]), (&effect.name().into(), &effect.summary.into()));
        assert!(said["on"].is_boolean() && said["why"].is_string() && said["adds"].is_null(), "{said:#}");
        assert_eq!(said["stages"].as_u64() > Some(0), said["on"].as_bool().expect("on or off"));
    }
}

#[test]
fn what_effects_cost_adds_up() {
    // Rays and bytes to the last one; times, which scatter, within a tenth. A machine that is busy with other things
    // gets three attempts.
    let attempts = (0..3).any(|_| {
        let report = json("scenes/assignment.toml --size 384x384 --measure --rounds 7");
        let number = |value: &Value| value.as_f64().expect("a number");
        let measured = &report["measured"];
        let parts: Vec<&Value> =
            report["effects"].as_array().expect("a list").iter().filter(|e| e["on"] == true).collect();
        for what in ["rays", "bytes"] {
            let sum: f64 = parts.iter().map(|part| number(&part["adds"][what])).sum();
            assert_eq!(number(&measured["base"][what]) + sum, number(&measured["whole"][what]), "{what}");
        }
        // A ray a pixel without effects.
        assert_eq!(number(&measured["base"]["rays"]), 384.0 * 384.0);
        let sum: f64 = parts.iter().map(|part| number(&part["adds"]["ms"]["median"])).sum();
        let sum = sum + number(&measured["base"]["ms"]["median"]);
        assert!((sum - number(&measured["sum_ms"])).abs() < 1e-9 * sum);
        let whole = number(&measured["whole"]["ms"]["median"]);
        parts.iter().all(|part| part["alone_ms"]["median"].is_f64()) && (sum / whole - 1.0).abs() < 0.1
    });
    assert!(attempts, "the parts are not within a tenth of the whole, three times over");
}
