//! Build time, memory and throughput against the number of triangles.

use std::sync::atomic::Ordering;

use super::super::Engine;
use super::super::generate::Family;
use super::super::plot::{Line, Panel, panels};
use super::{Kind, RaySets, Settings, SpeedRow, Viewpoint, measure, scene, view_setup};
use crate::timing::Quartiles;
use kiln::error::{Error, Result};
use kiln::limits;
use kiln::render::RenderControl;

/// Results for a mesh of a kind and size.
#[derive(Debug, Clone)]
pub struct ScalingStep {
    /// Kind of mesh.
    pub family: Family,
    /// One row per engine.
    pub rows: Vec<SpeedRow>,
    /// Peak memory of the process in bytes, including the mesh, the rays and the structures of all engines.
    pub peak_bytes: Option<u64>,
}

/// Powers of ten from 1000 triangles up to `largest`.
pub fn sizes(largest: usize) -> Vec<usize> {
    std::iter::successors(Some(1000usize), |size| size.checked_mul(10))
        .take_while(|size| *size <= largest)
        .collect()
}

/// Measures every engine with every kind and size of mesh, with the rays of a picture of `pixels` by `pixels`.
///
/// # Errors
/// As `measure`.
pub fn scaling(
    engines: &[Engine],
    sizes: &[usize],
    pixels: u32,
    settings: &Settings,
    control: &RenderControl,
) -> Result<Vec<ScalingStep>> {
    let mut steps = Vec::new();
    let total = Family::ALL.len() * sizes.len();
    for family in Family::ALL {
        for &size in sizes {
            limits::reset_peak_memory();
            let mesh = family.mesh(size);
            let setup = view_setup(&scene(&mesh), Viewpoint::Outside, pixels)?;
            let ray_sets = RaySets::new(&mesh, &setup);
            let inner = RenderControl { cancel: control.cancel, progress: &|_, _| {}, time_stages: false };
            let rows = measure(engines, &mesh, &ray_sets, settings, &inner)?;
            steps.push(ScalingStep { family, rows, peak_bytes: limits::peak_memory() });
            (control.progress)(steps.len(), total);
            if control.cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
        }
    }
    Ok(steps)
}

/// Title of the memory panel, whose axis is linear.
const BYTES: &str = "bytes a triangle";

/// Plot of the steps, with a colour per kind of mesh and a line style per engine.
pub fn plot(steps: &[ScalingStep]) -> String {
    let median = |spread: Option<Quartiles>| spread.map(|spread| spread.median);
    let panel = |title: &str, unit, value: &dyn Fn(&SpeedRow) -> Option<f64>| Panel {
        title: title.to_owned(),
        unit,
        linear: unit == BYTES,
        lines: lines(steps, value),
    };
    let drawn = [
        panel("Building", "milliseconds", &|row| Some(row.build_ms.median)),
        panel("Memory", BYTES, &SpeedRow::bytes_per_triangle),
        panel("Primary rays", "million a second", &|row| median(row.mrays_per_s(Kind::Primary))),
        panel("Diffuse rays", "million a second", &|row| median(row.mrays_per_s(Kind::Diffuse))),
    ];
    panels("triangles", &drawn)
}

fn lines(steps: &[ScalingStep], value: &dyn Fn(&SpeedRow) -> Option<f64>) -> Vec<Line> {
    let mut lines = Vec::new();
    for (family, colour) in Family::ALL.into_iter().zip([0, 5, 2]) {
        let steps = || steps.iter().filter(|step| step.family == family);
        let count = steps().map(|step| step.rows.len()).min().unwrap_or(0);
        for place in 0..count {
            let rows = || steps().map(|step| &step.rows[place]);
            let Some(first) = rows().next() else { continue };
            let points = rows().filter_map(|row| Some([row.triangles as f64, value(row)?])).collect();
            let name = format!("{}, {}", family.name(), first.label.engine);
            lines.push(Line { name, colour, is_dashed: first.label.engine != "kiln", points });
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_powers_of_ten() {
        assert!(sizes(999).is_empty());
        assert_eq!(sizes(10_000), [1000, 10_000]);
        assert_eq!(sizes(10_000_000).len(), 5);
    }
}
