//! The assertions that hard cases are used with. They count what differs, and show the first of it.
//!
//! What is asserted of which tier:
//! - all but `Fast`: every structure gives the hits of brute force, bit for bit; the closest is the first of them; a ray is occluded
//!   exactly if it has one.
//! - `Exact`: the hits are those of exact arithmetic on the given f64 numbers, and the closest is the exact closest.
//! - `Watertight` and `Double`, on data that f32 can hold, so that both are given the numbers that the oracle is given:
//!   where a hit is not the exact one, the ray passes an edge or starts off a plane within a derived rounding error
//!   ([`oracle::is_clear`]); distances are within a derived error of the exact ones.
//! - `Fast`: nothing.
//!
//! A tier is held against the oracle only where its numbers are the oracle's.

use std::collections::BTreeMap;

use glam::DVec3;
use kiln::bvh::detail::{Layout, Slot, build};
use kiln::bvh::{AnalyticShape, Disk, Numerics, Preset, PrimId, Primitive, Ray, Sphere, Traversal, Triangle};

use super::results::{Faults, RayResults, check_both, check_results};
use super::single;
use crate::common::oracle::{self, Distance};

/// Brute force, and the trees that differ most.
pub const STRUCTURES: [Layout; 7] = [
    Layout::BruteForce,
    Layout::Wide(Preset::Balanced),
    Layout::Wide(Preset::BestTrace),
    Layout::Avx2(Preset::Balanced),
    Layout::Portable(Preset::FastBuild),
    Layout::Portable(Preset::Balanced),
    Layout::Portable(Preset::BestTrace),
];

/// The tree that is built where nothing is asked for.
pub const DEFAULT_TREE: Layout = Layout::Wide(Preset::Balanced);

/// Tiers in which closed meshes do not leak.
pub const WATERTIGHT: [Numerics; 3] = [Numerics::Watertight, Numerics::Double, Numerics::Exact];

/// Brute force and every layout of every preset.
pub fn all_structures() -> Vec<Layout> {
    [Layout::BruteForce].into_iter().chain(Layout::trees()).collect()
}

/// Counts that let tests assert that the rays cover the intended cases.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Summary {
    pub rays: usize,
    /// Rays that hit anything.
    pub hit: usize,
    /// Rays whose two nearest hits are at exactly the same distance.
    pub tied: usize,
    /// Hits in `Watertight` and `Double` that are not the exact ones.
    pub not_exact: usize,
    /// The largest error of the closest hit's distance, in steps of f32, where the test knows it to one step or better;
    /// in `Watertight` and `Double`, and in `Exact`.
    pub ulps: [f64; 2],
}

/// Checks all tiers but `fast` and some structures against the oracle. The data must be f32 numbers.
pub fn judge(what: &str, slots: &[Slot], rays: &[Ray]) -> Summary {
    judge_in(what, slots, rays, &Numerics::STRICT, &STRUCTURES)
}

/// Judges the given tiers and structures by the oracle; the first structure is the one that the others are held to.
pub fn judge_in(
    what: &str,
    slots: &[Slot],
    rays: &[Ray],
    tiers: &[Numerics],
    structures: &[Layout],
) -> Summary {
    let all_single = slots.iter().all(is_single) && rays.iter().all(|r| r.origin() == single(r.origin()));
    assert!(all_single || tiers.iter().all(|tier| !rounds(*tier)), "{what}: not f32 numbers");
    let exact: Vec<Vec<(Distance, PrimId)>> = rays.iter().map(|ray| exact_hits(slots, ray)).collect();
    let mut summary = Summary { rays: rays.len(), ..Summary::default() };
    summary.hit = exact.iter().filter(|hits| !hits.is_empty()).count();
    summary.tied = exact.iter().filter(|hits| hits.len() > 1 && hits[0].0 == hits[1].0).count();
    let by_id: BTreeMap<PrimId, &Primitive> = slots.iter().map(|slot| (slot.id, &slot.primitive)).collect();
    for &tier in tiers {
        let mut faults = Faults::new(format!("{what}, {}", tier.name()));
        let all: Vec<_> = structures.iter().map(|s| build(slots.iter().copied(), *s, tier)).collect();
        let answers = RayResults::to_all(&*all[0], rays);
        for (structure, other) in structures.iter().zip(&all).skip(1) {
            check_results(&format!("{structure:?}"), &**other, rays, &answers, &mut faults);
        }
        for ((ray, exact), answer) in rays.iter().zip(&exact).zip(&answers) {
            let any = !answer.all.is_empty();
            let consistent = answer.occluded == any && answer.closest.is_some() == any;
            faults.check(consistent, || {
                format!("{ray:?}: closest {:?} of {}", answer.closest, answer.all.len())
            });
            if tier == Numerics::Exact {
                judge_exact(ray, exact, answer, &mut faults, &mut summary);
                continue;
            }
            // By the tier's own distances, the closest is the first.
            let order = |a: &(PrimId, u64)| (f64::from_bits(a.1), a.0);
            let first =
                answer.all.iter().copied().min_by(|a, b| order(a).partial_cmp(&order(b)).expect("numbers"));
            faults.check(answer.closest == first, || format!("{ray:?}: {first:?}, not {:?}", answer.closest));
            judge_rounded(ray, &by_id, exact, answer, &mut faults, &mut summary);
        }
        faults.none();
    }
    eprintln!("{what}: {summary:?}");
    summary
}

fn judge_exact(
    ray: &Ray,
    exact: &[(Distance, PrimId)],
    answer: &RayResults,
    faults: &mut Faults,
    summary: &mut Summary,
) {
    let mut expected: Vec<PrimId> = exact.iter().map(|hit| hit.1).collect();
    expected.sort_unstable();
    let found: Vec<PrimId> = answer.all.iter().map(|hit| hit.0).collect();
    let unlike = || {
        let only = |a: &[PrimId], b: &[PrimId]| {
            a.iter().filter(|id| !b.contains(id)).map(|id| id.0).collect::<Vec<_>>()
        };
        format!(
            "{ray:?}: hit but should not be {:?}, the other way {:?}",
            only(&found, &expected),
            only(&expected, &found)
        )
    };
    faults.check(found == expected, unlike);
    let first = exact.first().map(|hit| hit.1);
    let closest = answer.closest.map(|hit| hit.0);
    faults.check(closest == first, || format!("{ray:?}: closest {closest:?}, not {first:?}"));
    if let (Some((distance, _)), Some((_, t))) = (exact.first(), answer.closest) {
        let ulps = oracle::f32_ulps(f64::from_bits(t), distance);
        faults.check(ulps <= 1.0, || format!("{ray:?}: {ulps} ulps off {distance:?}"));
        summary.ulps[1] = summary.ulps[1].max(ulps);
    }
}

fn judge_rounded(
    ray: &Ray,
    by_id: &BTreeMap<PrimId, &Primitive>,
    exact: &[(Distance, PrimId)],
    answer: &RayResults,
    faults: &mut Faults,
    summary: &mut Summary,
) {
    let expected: BTreeMap<PrimId, &Distance> = exact.iter().map(|(t, id)| (*id, t)).collect();
    let found: BTreeMap<PrimId, f64> = answer.all.iter().map(|(id, t)| (*id, f64::from_bits(*t))).collect();
    let false_hits = found.keys().filter(|id| !expected.contains_key(id));
    let false_misses = expected.keys().filter(|id| !found.contains_key(id));
    for id in false_hits.chain(false_misses) {
        summary.not_exact += 1;
        let clear = is_clear(ray, by_id[id]);
        faults.check(!clear, || format!("{ray:?}: {:?} decided wrong, and not by rounding", by_id[id]));
    }
    for (id, t) in &found {
        if let Some(distance) = expected.get(id) {
            let allowed = distance_error(ray, by_id[id]);
            let exact = distance.to_f64();
            let off = off_by(ray, by_id[id], *t, exact);
            faults
                .check(off <= allowed, || format!("{ray:?}: {id:?} at {t}, off by {off}, allowed {allowed}"));
            let step = oracle::f32_step(exact);
            if allowed <= step {
                summary.ulps[0] = summary.ulps[0].max(off / step);
            }
        }
    }
}

/// How far a distance is off. Where the ray starts on a sphere, up to rounding, either end of its chord may be the
/// first.
fn off_by(ray: &Ray, primitive: &Primitive, t: f64, exact: f64) -> f64 {
    let off = (t - exact).abs();
    match primitive {
        Primitive::Analytic(AnalyticShape::Sphere(Sphere { centre, radius }))
            if !is_clear(ray, primitive) =>
        {
            let ends = oracle::line_sphere(ray, *centre, *radius).into_iter().flatten();
            ends.map(|end| (t - end.to_f64()).abs()).fold(off, f64::min)
        }
        _ => off,
    }
}

/// All exact hits, in the order of their distance and number.
pub fn exact_hits(slots: &[Slot], ray: &Ray) -> Vec<(Distance, PrimId)> {
    let hit = |slot: &Slot| match &slot.primitive {
        Primitive::Triangle(Triangle(corners)) => oracle::triangle(ray, corners),
        Primitive::Analytic(AnalyticShape::Sphere(Sphere { centre, radius })) => {
            oracle::sphere(ray, *centre, *radius)
        }
        Primitive::Analytic(AnalyticShape::Disk(Disk { centre, normal, radius })) => {
            oracle::disk(ray, *centre, *normal, *radius)
        }
        Primitive::Analytic(shape) => panic!("another shape: {shape:?}"),
    };
    let mut hits: Vec<_> = slots.iter().filter_map(|slot| Some((hit(slot)?, slot.id))).collect();
    hits.sort_unstable();
    hits
}

fn is_clear(ray: &Ray, primitive: &Primitive) -> bool {
    match primitive {
        Primitive::Triangle(Triangle(corners)) => oracle::is_clear(ray, corners),
        Primitive::Analytic(AnalyticShape::Sphere(Sphere { centre, radius })) => {
            oracle::is_clear_of_sphere(ray, *centre, *radius)
        }
        Primitive::Analytic(AnalyticShape::Disk(Disk { centre, normal, radius })) => {
            oracle::is_clear_of_disk(ray, *centre, *normal, *radius)
        }
        Primitive::Analytic(shape) => panic!("another shape: {shape:?}"),
    }
}

fn distance_error(ray: &Ray, primitive: &Primitive) -> f64 {
    match primitive {
        Primitive::Triangle(Triangle(corners)) => oracle::distance_error(ray, corners),
        Primitive::Analytic(AnalyticShape::Sphere(Sphere { centre, radius })) => {
            oracle::sphere_distance_error(ray, *centre, *radius)
        }
        Primitive::Analytic(AnalyticShape::Disk(Disk { centre, normal, radius })) => {
            oracle::disk_distance_error(ray, *centre, *normal, *radius)
        }
        Primitive::Analytic(shape) => panic!("another shape: {shape:?}"),
    }
}

fn rounds(tier: Numerics) -> bool {
    tier == Numerics::Watertight
}

fn is_single(slot: &Slot) -> bool {
    match &slot.primitive {
        Primitive::Triangle(Triangle(corners)) => corners.iter().all(|p| *p == single(*p)),
        // Stored in f64 in every tier.
        Primitive::Analytic(_) => true,
    }
}

/// Every one of the rays hits something: in tiers that do not leak, with every structure given.
pub fn none_gets_out(what: &str, slots: &[Slot], rays: &[Ray], tiers: &[Numerics], structures: &[Layout]) {
    let mut traversal = Traversal::default();
    for &tier in tiers {
        for &structure in structures {
            let accelerator = build(slots.iter().copied(), structure, tier);
            let mut faults = Faults::new(format!("{what}, {}, {structure:?}", tier.name()));
            for ray in rays {
                let hit = accelerator.closest_hit(ray, &mut traversal);
                faults.check(hit.is_some(), || format!("{ray:?} gets out"));
                faults.check(hit.is_none_or(|hit| hit.t.is_finite() && hit.t > 0.0), || {
                    format!("{ray:?}: {hit:?}")
                });
            }
            faults.none();
        }
    }
    eprintln!("{what}: {} rays, none got out", rays.len());
}

/// Scaling everything by a power of two changes no digit of any answer.
pub fn scales_to_the_bit(what: &str, slots: &[Slot], rays: &[Ray], exponents: &[i32], tiers: &[Numerics]) {
    for &tier in tiers {
        for structure in [Layout::BruteForce, DEFAULT_TREE] {
            let here = build(slots.iter().copied(), structure, tier);
            let alone = RayResults::to_all(&*here, rays);
            // Among hits at equal t, `fast` may find another in a batch.
            let in_batches =
                if tier == Numerics::Fast { RayResults::in_batches(&*here, rays) } else { alone.clone() };
            let answers = [alone, in_batches];
            for &exponent in exponents {
                let scale = f64::from(exponent).exp2();
                let there = build(slots.iter().map(|slot| scaled(slot, scale)), structure, tier);
                let mut faults = Faults::new(format!("{what}, {}, {structure:?}, 2^{exponent}", tier.name()));
                let times = |answers: &Vec<RayResults>| -> Vec<RayResults> {
                    answers.iter().map(|answer| answer.times(scale)).collect()
                };
                let expected = [times(&answers[0]), times(&answers[1])];
                let moved: Vec<Ray> = rays.iter().map(|ray| scaled_ray(ray, scale)).collect();
                check_both("scaled", &*there, &moved, [&expected[0], &expected[1]], &mut faults);
                faults.none();
            }
        }
    }
}

/// A ray of everything times a power of two: the same direction from further away.
pub fn scaled_ray(ray: &Ray, scale: f64) -> Ray {
    Ray::unchecked(ray.origin() * scale, ray.direction(), ray.t_min() * scale, ray.t_max() * scale)
}

/// A primitive times a power of two.
pub fn scaled(slot: &Slot, scale: f64) -> Slot {
    let primitive = match slot.primitive {
        Primitive::Triangle(Triangle(corners)) => Primitive::Triangle(Triangle(corners.map(|p| p * scale))),
        Primitive::Analytic(shape) => Primitive::Analytic(shape.recentred(DVec3::ZERO, scale)),
    };
    Slot { primitive, ..*slot }
}
