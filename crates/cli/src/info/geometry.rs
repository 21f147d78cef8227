//! Defects of the meshes.

use serde_json::{Value, json};

use super::Lines;
use super::contents::{point, short};
use kiln::error::Result;
use kiln::scene::Scene;
use kiln::scene::mesh::topology::{Location, Topology};

pub(super) fn to_json(scene: &Scene, topology: &Result<Topology>) -> Value {
    let Ok(topology) = topology else { return Value::Null };
    let mut report = json!({
        "vertices": topology.vertices,
        "edges": topology.edges,
        "components": topology.components,
        "closed_components": topology.closed_components,
        "holes": topology.holes,
        "t_junctions_cut_off": topology.t_junctions_cut_off,
        "first": {},
    });
    for (key, findings, _) in topology.findings() {
        report[key] = json!(findings.count);
        if let Some(Location { object, triangle, position }) = findings.first {
            let name = &scene.objects[object].name;
            report["first"][key] =
                json!({ "object": name, "triangle": triangle, "position": point(position) });
        }
    }
    report
}

/// Adds a line on what the triangles are connected to, and one for each kind of defect.
pub(super) fn add(lines: &mut Lines, scene: &Scene, topology: &Result<Topology>) {
    let topology = match topology {
        Ok(topology) if topology.components == 0 => return,
        Ok(topology) => topology,
        Err(error) => return lines.add("geometry", format!("not analysed: {error}")),
    };
    let Topology { vertices, edges, components, closed_components, holes, .. } = topology;
    let parts = format!("{components} connected component(s), {closed_components} of them closed");
    lines.add("geometry", format!("{vertices} vertices, {edges} edges, {parts}"));
    if topology.t_junctions_cut_off {
        lines.add("geometry", "not all T-junctions are found: too many long edges lie along one line");
    }
    for (key, findings, what) in topology.findings() {
        let Some(Location { object, position, .. }) = findings.first else { continue };
        let (least, holes) = match key {
            "boundary_edges" => ("", format!(", around {holes} hole(s) or open side(s)")),
            "t_junctions" if topology.t_junctions_cut_off => ("at least ", String::new()),
            _ => ("", String::new()),
        };
        let first = format!("the first in `{}` at {}", scene.objects[object].name, short(position));
        lines.add("geometry", format!("{least}{} {what}{holes}; {first}", findings.count));
    }
}
