//! `kiln bench contains` prints wrong answers and rates of every tier. That it counts right is tested in
//! `bench::contains`.

use serde_json::Value;

#[test]
fn the_command_prints_a_row_for_each_tier_and_method() {
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    command.args(["bench", "contains", "--points", "1200", "--runs", "1", "--json"]);
    let output = command.env_remove("KILN_EMBREE").output().expect("the command starts");
    assert_eq!(output.status.code(), Some(0));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let rows = report["rows"].as_array().expect("rows");
    for tier in ["fast", "watertight", "double", "exact"] {
        for method in ["contains", "parity"] {
            let is_it = |row: &&Value| row["tier"] == tier && row["method"] == method;
            let of_method: Vec<_> = rows.iter().filter(is_it).collect();
            assert_eq!(of_method.len(), 4, "{tier}, {method}");
            let sum = |row: &&Value| {
                row["wrong"].as_object().expect("counts").values().filter_map(Value::as_u64).sum::<u64>()
            };
            let wrong: u64 = of_method.iter().map(sum).sum();
            assert_eq!(wrong == 0, method == "contains", "{tier}, {method}: {wrong}");
            assert_eq!(of_method[0]["points"], 300);
            assert_eq!(of_method[0]["mpoints_per_s"]["median"].is_number(), method == "contains");
        }
    }
    assert!(rows.iter().any(|row| row["engine"] == "embree" && row["wrong"].is_null()));
}
