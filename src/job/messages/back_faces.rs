//! Notes on visible back faces of single-sided materials, which `--cull` hides.

use crate::bvh::Traversal;
use crate::error::Warnings;
use crate::job::RenderJob;

/// Camera rays per side of the picture that look for back faces. As a grid they find objects that cover 1/1000 of the
/// picture, in less than a millisecond.
const GRID: u32 = 32;

/// Minimum share of back faces among the hits for a note.
const LEAST_SHARE: f64 = 0.01;

/// Adds a note about `--cull` if back faces are visible, and a warning if `--cull` changes nothing.
pub(crate) fn report(job: &RenderJob, warnings: &mut Warnings) {
    let RenderJob { world, view, plan_settings, .. } = job;
    if !world.has_single_sided() {
        if plan_settings.cull {
            warnings.push("--cull changes nothing: no material is single-sided (`doubleSided: false` of glTF, `double_sided = false`)");
        }
        return;
    }
    if plan_settings.cull {
        return;
    }
    let ([width, height], precision) = (view.size(), world.numerics().ray_precision());
    // Centres of the grid cells.
    let at =
        |cell: u32, side: u32| ((2 * u64::from(cell) + 1) * u64::from(side) / (2 * u64::from(GRID))) as u32;
    let mut traversal = Traversal::default();
    let (mut hits, mut backs) = (0, 0);
    for (x, y) in (0..GRID).flat_map(|y| (0..GRID).map(move |x| (x, y))) {
        let ray = view.ray(at(x, width), at(y, height), precision);
        let Some(hit) = job.plan.visible_hit(world, &ray, &mut traversal) else { continue };
        hits += 1;
        backs += u32::from(world.is_culled(&ray, &hit));
    }
    if backs > 0 && f64::from(backs) >= LEAST_SHARE * f64::from(hits) {
        let percent = (100.0 * f64::from(backs) / f64::from(hits)).round();
        let what = "of what is seen are back faces of single-sided materials";
        warnings.note(format!("{percent} % {what}; --cull hides these"));
    }
}
