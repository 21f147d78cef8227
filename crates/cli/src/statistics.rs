//! `--stats`: statistics of a render as JSON.

use serde_json::{Map, Value, json};

use kiln::effects::{Decision, Plan};
use kiln::error::Warnings;
use kiln::limits;
use kiln::render::{EffectCost, Statistics};
use kiln::world::{Image, World};

/// Version of the JSON schema; increased when a field changes its meaning or is removed.
const SCHEMA: u32 = 1;

/// Time of each phase in seconds.
#[derive(Default)]
pub(crate) struct Seconds {
    pub load: f64,
    /// Resolving settings and fitting the camera.
    pub prepare: f64,
    pub build: f64,
    pub render: f64,
    pub write: f64,
}

/// The JSON object of `--stats`.
pub(crate) fn to_json(
    settings: &[(String, String)],
    seconds: &Seconds,
    world: &World,
    plan: &Plan,
    statistics: &Statistics,
    warnings: &Warnings,
) -> Value {
    let settings: Map<String, Value> = settings.iter().map(|(k, v)| (k.clone(), json!(v))).collect();
    let rays: Map<String, Value> = statistics
        .rays
        .iter()
        .map(|(kind, count)| (kind.name.to_owned(), json!({ "cast": count.cast, "hit": count.hit })))
        .collect();
    let effects: Map<String, Value> = plan
        .decisions
        .iter()
        .zip(&statistics.effect_costs)
        .map(|(decision, cost)| (decision.effect.name().to_owned(), effect(decision, cost)))
        .collect();
    let stages: Vec<Value> = statistics
        .stages
        .iter()
        .map(|s| json!({ "name": s.name, "effect": s.effect, "thread_seconds": s.time.as_secs_f64() }))
        .collect();
    let description = world.accelerator.describe();
    json!({
        "schema": SCHEMA,
        "kiln": env!("CARGO_PKG_VERSION"),
        "settings": settings,
        "seconds": {
            "load": seconds.load,
            "prepare": seconds.prepare,
            "build": seconds.build,
            "render": seconds.render,
            "write": seconds.write,
        },
        "threads": rayon::current_num_threads(),
        "primitives": world.primitive_count(),
        "numerics": world.numerics().name(),
        "structure": {
            "layout": description.layout,
            "nodes": description.nodes,
            "slots": description.slots,
            "bytes": description.bytes,
        },
        "instruction_set": description.isa,
        "effects": effects,
        "textures": {
            "count": world.images.len(),
            "bytes": world.images.iter().map(|image| image.pixels.as_bytes().len()).sum::<usize>(),
            "mip_map_bytes": world.images.iter().map(Image::mip_map_bytes).sum::<usize>(),
        },
        "rays": rays,
        "tests": { "nodes": statistics.tests.nodes, "primitives": statistics.tests.primitives },
        "stages": stages,
        "non_finite_pixels": statistics.non_finite.len(),
        "discarded_samples": statistics.discarded_samples,
        "noisy_pixels": statistics.noisy_pixels,
        "paths": { "traced": statistics.paths.traced, "cut": statistics.paths.cut },
        "peak_memory_bytes": limits::peak_memory(),
        "warnings": warnings.messages(),
        "notes": warnings.notes(),
    })
}

/// Decision about an effect, and its cost.
fn effect(decision: &Decision, cost: &EffectCost) -> Value {
    json!({
        "on": decision.on,
        "why": decision.why,
        "value": decision.value,
        "stages": cost.stages,
        "rays": cost.rays,
        "thread_seconds": cost.time.map(|time| time.as_secs_f64()),
        "bytes": cost.bytes,
    })
}
