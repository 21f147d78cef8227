//! Cost and errors of the numerics tiers.
//!
//! Vertices and rays have f32 values, so that all tiers have the same input without rounding. The reference is the tier
//! `exact`.

use std::time::Instant;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::leaks::{Counts, measure_through};
use super::{Icosphere, LEVEL, LeakRayKind, Mesh, Numbers, PLACEMENTS, is_nearest, kiln, ray};
use crate::bvh::{Accelerator, Layout, Traversal};
use crate::error::Result;
use crate::geometry::{Hit, HitBuffer, Numerics, Precision, Ray, RayBuffer, Rays};
use crate::render::RenderControl;
use crate::timing::Spread;

/// Cost and errors of a tier.
#[derive(Debug, Clone, PartialEq)]
pub struct TierRow {
    /// The tier.
    pub numerics: Numerics,
    /// Time per ray relative to `fast` in the same run, for primary rays: quartiles over all runs.
    pub picture: Spread,
    /// The same for incoherent rays from inside at vertices and edges.
    pub aimed: Spread,
    /// Leaking rays per million through closed meshes, over all placements and from both sides.
    pub leaks: f64,
    /// False hits, false misses and hits of a wrong primitive per million rays.
    pub wrong: f64,
    /// Largest error of a distance in f32 ulp.
    pub worst: f64,
}

/// Number of timed rays.
const TIMED: u64 = 200_000;

/// Rays per batch, as in a render tile.
const BATCH: usize = 256;

/// Casts `rays` aimed rays from each side at each placement to count errors, and times `runs` runs on one thread.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] when cancelled.
pub fn tiers(rays: u64, runs: u32, control: &RenderControl) -> Result<Vec<TierRow>> {
    let spheres = PLACEMENTS.map(|placement| Icosphere::new(LEVEL, placement));
    let mut rows = Vec::new();
    let mut done = 0;
    for numerics in Numerics::ALL {
        let (mut leaks, mut cast, mut wrong, mut compared, mut worst) = (0, 0, 0, 0, 0.0f64);
        for sphere in &spheres {
            let counts = Counts::of_rays(rays);
            leaks += measure_through(numerics, sphere, counts, control)?.primary();
            cast += counts.primary();
            let ray_sets = LeakRayKind::ALL.map(|kind| aimed(sphere, kind, rays));
            let hits = compare(&sphere.mesh, numerics, &ray_sets.concat());
            (wrong, compared) = (wrong + hits.wrong, compared + hits.compared);
            worst = worst.max(hits.worst);
            done += 1;
            (control.progress)(done, Numerics::ALL.len() * (spheres.len() + 1));
        }
        // A giant plane at grazing angles, where errors of distances are largest.
        let plane = giant_plane();
        let hits = compare(&plane, numerics, &grazing(rays));
        (wrong, compared) = (wrong + hits.wrong, compared + hits.compared);
        done += 1;
        (control.progress)(done, Numerics::ALL.len() * (spheres.len() + 1));
        rows.push(TierRow {
            numerics,
            picture: Spread::exact(1.0),
            aimed: Spread::exact(1.0),
            leaks: leaks as f64 * 1e6 / cast as f64,
            wrong: wrong as f64 * 1e6 / compared as f64,
            worst: worst.max(hits.worst),
        });
    }
    let (picture, aimed) = times(&spheres[0], runs);
    for ((row, picture), aimed) in rows.iter_mut().zip(picture).zip(aimed) {
        (row.picture, row.aimed) = (picture, aimed);
    }
    Ok(rows)
}

/// Rays of one kind with f32 values.
fn aimed(sphere: &Icosphere, kind: LeakRayKind, rays: u64) -> Vec<Ray> {
    let count = *{ Counts::of_rays(rays) }.of(kind);
    let single = |(origin, direction)| Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
    (0..count).into_par_iter().map(|index| single(ray(sphere, kind, index))).collect()
}

/// A plane of 20,000 x 110,000 at a height of -500, as in the assignment, rotated: axis-aligned distances are easier.
fn giant_plane() -> Mesh {
    let [x, z, far, y] = [-1e4, -1e4, 1e5, -500.0];
    let positions =
        [(x, z), (x, far), (-x, z), (-x, far)].map(|(x, z)| (tilt() * DVec3::new(x, y, z)).as_vec3());
    Mesh { positions: positions.to_vec(), triangles: vec![[0, 1, 2], [3, 2, 1]] }
}

/// A rotation after which no edge and no face is axis-aligned.
fn tilt() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), 0.4)
}

/// Rays from 2^-14 to 200 above the plane to points up to 90,000 away; a quarter of them at the plane's diagonal.
fn grazing(rays: u64) -> Vec<Ray> {
    let one = |index: u64| {
        let mut numbers = Numbers::new(4, index);
        let heights = [200.0, 1.0, 1e-2, 1e-3, 2f64.powi(-14)];
        let origin =
            DVec3::new(0.0, -500.0 + heights[numbers.below(heights.len())], 0.0).as_vec3().as_dvec3();
        let target = if index.is_multiple_of(4) {
            DVec3::new(-1e4, -500.0, 1e5).lerp(DVec3::new(1e4, -500.0, -1e4), numbers.unit())
        } else {
            DVec3::new(1e4 * (2.0 * numbers.unit() - 1.0), -500.0, 9e4 * numbers.unit())
        };
        let direction = tilt() * (target - origin).normalize();
        Precision::Single.ray(tilt() * origin, direction, 0.0, f64::INFINITY)
    };
    (0..rays).map(one).collect()
}

/// Error counts of a set of rays.
#[derive(Default)]
struct HitErrors {
    wrong: u64,
    compared: u64,
    worst: f64,
}

fn compare(mesh: &Mesh, numerics: Numerics, rays: &[Ray]) -> HitErrors {
    let tier = kiln::accelerator(mesh, Layout::default(), numerics);
    let exact = kiln::accelerator(mesh, Layout::default(), Numerics::Exact);
    let one = |ray: &Ray| {
        let mut traversal = Traversal::default();
        let found = tier.closest_hit(ray, &mut traversal);
        let mut reference = Vec::new();
        exact.all_hits(ray, &mut reference, &mut traversal);
        let (wrong, error) = check_hit(found, &reference);
        HitErrors { wrong: u64::from(wrong), compared: 1, worst: error }
    };
    rays.par_iter().map(one).reduce(HitErrors::default, |a, b| HitErrors {
        wrong: a.wrong + b.wrong,
        compared: a.compared + b.compared,
        worst: a.worst.max(b.worst),
    })
}

/// Whether a hit is wrong, given all hits in `exact`, and the error of its distance in f32 ulp. A hit of a closest
/// triangle ([`is_nearest`]) is correct whatever its distance.
fn check_hit(found: Option<Hit>, reference: &[Hit]) -> (bool, f64) {
    let Some(hit) = found else { return (!reference.is_empty(), 0.0) };
    let error = reference.iter().find(|t| t.prim == hit.prim).map_or(0.0, |true_hit| {
        let single = true_hit.t as f32;
        let ulp = f64::from(single.next_up()) - f64::from(single);
        (hit.t - true_hit.t).abs() / ulp
    });
    (!is_nearest(hit.prim.0, reference), error)
}

/// Quartiles of the times of all tiers relative to the first, in alternating runs on this thread, for primary rays and
/// for aimed rays.
fn times(sphere: &Icosphere, runs: u32) -> (Vec<Spread>, Vec<Spread>) {
    let accelerators =
        Numerics::ALL.map(|numerics| kiln::accelerator(&sphere.mesh, Layout::default(), numerics));
    let aimed: Vec<_> = (0..TIMED).map(|index| ray(sphere, LeakRayKind::Inside, index)).collect();
    let picture = picture(sphere);
    let of_tier = |rays: &[(DVec3, DVec3)], accelerator: &dyn Accelerator| -> Vec<Ray> {
        let precision = accelerator.numerics().ray_precision();
        rays.iter().map(|&(o, d)| precision.ray(o, d, 0.0, f64::INFINITY)).collect()
    };
    [&picture, &aimed]
        .map(|rays| {
            let rays = accelerators
                .each_ref()
                .map(|accelerator| RayBuffer::from_iter(of_tier(rays, &**accelerator)));
            let mut ratios = vec![Vec::new(); accelerators.len()];
            for _ in 0..=runs {
                let times: Vec<f64> = accelerators
                    .iter()
                    .zip(&rays)
                    .map(|(accelerator, rays)| seconds(&**accelerator, rays.rays()))
                    .collect();
                times.iter().zip(&mut ratios).for_each(|(time, ratios)| ratios.push(time / times[0]));
            }
            // Run 0 is the warm-up.
            ratios
                .into_iter()
                .map(|ratios| Spread::of(&ratios[1..]).unwrap_or(Spread::exact(1.0)))
                .collect::<Vec<_>>()
        })
        .into()
}

fn seconds(accelerator: &dyn Accelerator, rays: Rays) -> f64 {
    let (mut traversal, mut hits) = (Traversal::default(), HitBuffer::default());
    hits.reserve(rays.len());
    let start = Instant::now();
    for tile in rays.chunks(BATCH) {
        accelerator.closest_hits(tile, &mut hits, &mut traversal);
    }
    std::hint::black_box(&hits);
    start.elapsed().as_secs_f64()
}

/// Primary rays of a picture of the sphere, tile by tile: a pinhole camera three radii away with the sphere in view.
fn picture(sphere: &Icosphere) -> Vec<(DVec3, DVec3)> {
    let side = ((TIMED as f64).sqrt() as u32).next_multiple_of(16);
    let eye = sphere.placement.centre + DVec3::Z * (3.0 * sphere.placement.radius);
    let tiles = (0..side / 16).flat_map(|y| (0..side / 16).map(move |x| (16 * x, 16 * y)));
    let pixels = tiles.flat_map(|(x, y)| (0..256).map(move |i| (x + i % 16, y + i / 16)));
    let ray = |(x, y): (u32, u32)| {
        let place = |i: u32| (2.0 * (f64::from(i) + 0.5) / f64::from(side) - 1.0) * 0.36;
        (eye, DVec3::new(place(x), place(y), -1.0).normalize())
    };
    pixels.map(ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{PrimId, SlotId};

    fn hit(t: f64, prim: u32) -> Hit {
        Hit { t, prim: PrimId(prim), slot: SlotId::new(0), barycentrics: [0.0; 2] }
    }

    #[test]
    fn hits_are_compared_with_the_closest_exact_hit() {
        let reference = [hit(2.0, 7), hit(1.0, 3), hit(1.0, 4)];
        assert_eq!(check_hit(Some(hit(1.0, 3)), &reference), (false, 0.0));
        assert_eq!(check_hit(Some(hit(1.0 + 3.0 * f64::from(f32::EPSILON), 4)), &reference), (false, 3.0));
        assert!(check_hit(Some(hit(2.0, 7)), &reference).0, "slipped through the front");
        assert!(check_hit(Some(hit(1.0, 9)), &reference).0, "not hit at all");
        assert!(check_hit(None, &reference).0 && check_hit(Some(hit(1.0, 3)), &[]).0);
        assert_eq!(check_hit(None, &[]), (false, 0.0));
    }
}
