//! Results as JSON. Keys and units are stable, as other programs read them.

use serde_json::{Map, Value, json};

use super::Report;
use kiln_lab::bench::Unavailable;
use kiln_lab::bench::speed::{Kind, SpeedRow};
use kiln_lab::timing::Clock;

/// One row per engine, and one with a reason per unavailable library.
pub(crate) fn rows(report: &Report) -> Value {
    let measured = report.rows.iter().map(|row| measured(row, report));
    measured.chain(report.absent.iter().map(skipped)).collect()
}

fn measured(row: &SpeedRow, report: &Report) -> Value {
    let label = &row.label;
    json!({
        "engine": label.engine,
        "layout": label.layout,
        "tier": label.tier,
        "preset": label.preset,
        "threads": row.threads,
        "isa": label.isa,
        "build_ms": row.build_ms,
        "nodes": row.facts.nodes,
        "depth": row.facts.depth,
        "sah_cost": row.facts.sah_cost,
        "bytes_per_triangle": row.bytes_per_triangle(),
        "mrays_per_s": by_kind(|kind| row.mrays_per_s(kind).map(|spread| json!(spread))),
        "tests_per_ray": by_kind(|kind| {
            row.tests_per_ray(kind).map(|[nodes, primitives]| json!({ "nodes": nodes, "primitives": primitives }))
        }),
        "wrong_hits": row.all_wrong(),
        "wrong_hits_by_kind": by_kind(|kind| Some(json!(row.wrong?[kind as usize]))),
        "rays": by_kind(|kind| Some(json!(row.rays[kind as usize]))),
        "triangles": row.triangles,
        "build_peak_bytes": row.build_peak_bytes,
        "subject": report.subject,
        "runs": report.runs,
        "clock": Clock::name(row.threads),
        "skipped_reason": null,
    })
}

fn skipped(absent: &Unavailable) -> Value {
    json!({
        "engine": absent.name, "layout": null, "tier": null, "preset": null, "threads": null, "isa": null,
        "build_ms": null, "nodes": null, "depth": null, "sah_cost": null, "bytes_per_triangle": null,
        "mrays_per_s": null, "tests_per_ray": null, "wrong_hits": null,
        "skipped_reason": absent.skipped_reason(),
    })
}

fn by_kind(value: impl Fn(Kind) -> Option<Value>) -> Value {
    let pairs = Kind::ALL.map(|kind| (kind.name().to_owned(), value(kind).unwrap_or(Value::Null)));
    Value::Object(Map::from_iter(pairs))
}
