//! How building, memory and speed change with the number of triangles.

use std::sync::atomic::Ordering;

use super::super::generate::Family;
use super::super::plot::{Line, Panel, panels};
use super::super::{Spread, memory};
use super::{Contender, Kind, RaySets, Settings, SpeedRow, Viewpoint, eye, measure, scene};
use crate::error::{Error, Result};
use crate::render::RenderControl;

/// What was measured over the meshes of one kind and about one size.
#[derive(Debug, Clone)]
pub struct ScalingStep {
    /// The kind of mesh.
    pub family: Family,
    /// A row for each contender.
    pub rows: Vec<SpeedRow>,
    /// The most memory that the process held meanwhile, with all contenders' structures, rays and the mesh.
    pub peak_bytes: Option<u64>,
}

/// Powers of ten from 1000 triangles up to `largest`.
pub fn sizes(largest: usize) -> Vec<usize> {
    std::iter::successors(Some(1000usize), |size| size.checked_mul(10))
        .take_while(|size| *size <= largest)
        .collect()
}

/// Measures every contender over every kind of mesh in every size, with the rays of a picture of `pixels` by `pixels`.
///
/// # Errors
/// As [`measure`].
pub fn scaling(
    contenders: &[Box<dyn Contender>],
    sizes: &[usize],
    pixels: u32,
    settings: &Settings,
    control: &RenderControl,
) -> Result<Vec<ScalingStep>> {
    let mut steps = Vec::new();
    let total = Family::ALL.len() * sizes.len();
    for family in Family::ALL {
        for &size in sizes {
            memory::forget_peak();
            let mesh = family.mesh(size);
            let eye = eye(&scene(&mesh), Viewpoint::Outside, pixels)?;
            let ray_sets = RaySets::new(&mesh, &eye);
            let inner = RenderControl { cancel: control.cancel, progress: &|_, _| {}, time_stages: false };
            let rows = measure(contenders, &mesh, &ray_sets, settings, &inner)?;
            steps.push(ScalingStep { family, rows, peak_bytes: memory::peak() });
            (control.progress)(steps.len(), total);
            if control.cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
        }
    }
    Ok(steps)
}

/// What hardly changes with size, so that its axis is linear.
const BYTES: &str = "bytes a triangle";

/// The steps as a plot: a colour for each kind of mesh, and a kind of line for each engine.
///
/// # Errors
/// [`Error::Failed`] where it cannot be drawn.
pub fn plot(steps: &[ScalingStep]) -> Result<String> {
    let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
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
            lines.push(Line { name, colour, broken: first.label.engine != "kiln", points });
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
