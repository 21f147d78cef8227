//! Counts wrong answers to whether a closed mesh contains a point.
//!
//! The points lie on lines through vertices and edge midpoints, in the direction of the test ray, where rounding or
//! counting a crossing twice does most harm. They keep away from the facets of an icosphere, so that their distance
//! from its centre says whether they are inside.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::leaks::count;
use super::{Engine, Icosphere, LEVEL, Label, Numbers, PLACEMENTS, Quartiles, Unavailable, embree, own};
use crate::timing::Clock;
use kiln::bvh::detail::{Layout, RayBuffer};
use kiln::bvh::{Bvh, CONTAINS_DIRECTION, Numerics, Preset, Primitive, Side, Traversal, Triangle};
use kiln::error::{Error, Result};
use kiln::render::RenderControl;

/// What the line of a point and the direction of its test ray passes through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// A vertex, in the direction of [`Bvh::contains`].
    Vertex,
    /// An edge midpoint, in that direction.
    Edge,
    /// A vertex or an edge midpoint, along an axis.
    Axis,
}

impl Aim {
    /// All of them.
    pub const ALL: [Aim; 3] = [Aim::Vertex, Aim::Edge, Aim::Axis];
}

/// A point, the direction of its test ray, and whether it is inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestPoint {
    /// The point, whose ray passes exactly through the target if f64 can hold such a point.
    pub point: DVec3,
    /// The direction, of any length.
    pub direction: DVec3,
    /// Whether the mesh contains it.
    pub is_inside: bool,
}

/// Steps of a radius along the line of a point.
const STEPS: f64 = 1024.0;

/// Point `index` of a kind.
pub fn test_point(sphere: &Icosphere, aim: Aim, index: u64) -> TestPoint {
    let (centre, radius) = (sphere.placement.centre, sphere.placement.radius);
    let mut numbers = Numbers::new(16 + aim as u64, index);
    let corners = sphere.mesh.corners(numbers.below(sphere.mesh.triangles.len()) as u32);
    let [from, to, _] = corners.map(|corner| corner.as_dvec3());
    let is_edge = aim == Aim::Edge || aim == Aim::Axis && index.is_multiple_of(2);
    let target = if is_edge { (from + to) / 2.0 } else { from };
    let axis = DVec3::AXES[numbers.below(3)] * numbers.sign();
    let direction = if aim == Aim::Axis { axis } else { CONTAINS_DIRECTION };
    // A power of two, so that the sum below has few digits.
    let unit = radius.log2().floor().exp2() / STEPS;
    // Facets are nearer to the centre than the sphere by a sixth of the square of an edge, and vertices are rounded.
    let rounding = f64::from(f32::EPSILON) * centre.abs().max_element() / radius;
    let margin = sphere.longest_edge * sphere.longest_edge + 2.0 * rounding;
    loop {
        let steps = (numbers.unit() * 5.0 * STEPS - 2.5 * STEPS).round();
        let point = target - direction * (steps * unit);
        let distance = point.distance(centre) / radius;
        if (distance - 1.0).abs() > margin {
            return TestPoint { point, direction, is_inside: distance < 1.0 };
        }
    }
}

/// Wrong answers of a method at a placement.
#[derive(Debug, Clone, PartialEq)]
pub struct ContainsRow {
    /// The library, with its layout or mode.
    pub engine: [&'static str; 2],
    /// Numerics tier, if the library has several.
    pub tier: Option<&'static str>,
    /// `contains`, or `parity`: whether the ray has an odd number of hits.
    pub method: &'static str,
    /// Name of one of [`PLACEMENTS`].
    pub placement: &'static str,
    /// Points of each [`Aim`].
    pub points: u64,
    /// Wrong answers of each [`Aim`].
    pub wrong: [u64; 3],
}

/// Million queries a second of a tier on one thread.
#[derive(Debug, Clone, PartialEq)]
pub struct ContainsRate {
    /// The tier.
    pub numerics: Numerics,
    /// Random points by [`Bvh::par_contains`].
    pub contains: Quartiles,
    /// Points whose rays pass through vertices and edge midpoints.
    pub aimed: Quartiles,
    /// The rays of the random points by [`Bvh::par_closest_hits`].
    pub closest_hits: Quartiles,
    /// The ratio of random points to their rays in the same run.
    pub ratio: Quartiles,
}

/// Tests `points` points in all with each method, evenly spread over [`PLACEMENTS`] and [`Aim`]s.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Failed`] if a library cannot build its structure.
pub fn wrong_points(points: u64, control: &RenderControl) -> Result<(Vec<ContainsRow>, Option<Unavailable>)> {
    let (peers, absent) = match embree::leak_engines() {
        Ok(engines) => (engines, None),
        Err(absent) => (Vec::new(), Some(absent)),
    };
    let of_kiln = Numerics::ALL.map(|numerics| own::engine(Layout::default(), numerics));
    let parities: Vec<Engine> = of_kiln.into_iter().chain(peers).collect();
    let points = points.div_ceil((PLACEMENTS.len() * Aim::ALL.len()) as u64);
    let steps = (Numerics::ALL.len() + parities.len()) * PLACEMENTS.len() * Aim::ALL.len();
    let done = AtomicU64::new(0);
    let step = |count: u64| {
        let done = count + done.fetch_add(count, Ordering::Relaxed);
        (control.progress)(done as usize, steps * points as usize);
    };
    let spheres = PLACEMENTS.map(|placement| Icosphere::new(LEVEL, placement));
    let wrong = |sphere: &Icosphere, is_right: &(dyn Fn(&TestPoint, &mut Vec<u32>) -> bool + Sync)| {
        let mut wrong = [0; 3];
        for aim in Aim::ALL {
            let is_wrong = |index, found: &mut Vec<u32>| !is_right(&test_point(sphere, aim, index), found);
            wrong[aim as usize] = count(points, control, &step, is_wrong)?;
        }
        Ok::<_, Error>(wrong)
    };
    let mut rows = Vec::new();
    for numerics in Numerics::ALL {
        for sphere in &spheres {
            let bvh = bvh(sphere, numerics)?;
            let wrong = wrong(sphere, &|test, _| is_right(&bvh, test))?;
            let (engine, tier) = (["kiln", "bvh8"], Some(numerics.name()));
            let placement = sphere.placement.name;
            rows.push(ContainsRow { engine, tier, method: "contains", placement, points, wrong });
        }
    }
    for engine in &parities {
        let Label { engine: name, layout, tier, .. } = engine.label;
        for sphere in &spheres {
            let built = engine.build(&sphere.mesh)?;
            let wrong = wrong(sphere, &|test, found| {
                found.clear();
                built.crossings(test.point, test.direction.normalize(), found);
                (found.len() % 2 == 1) == test.is_inside
            })?;
            let placement = sphere.placement.name;
            rows.push(ContainsRow {
                engine: [name, layout],
                tier,
                method: "parity",
                placement,
                points,
                wrong,
            });
        }
    }
    Ok((rows, absent))
}

/// Whether the winding number of a point is right, and for a ray along an axis also its crossings: their number and
/// their sides.
fn is_right(bvh: &Bvh, test: &TestPoint) -> bool {
    let expected = i32::from(test.is_inside);
    let crosses_right = || {
        let ray = bvh.ray(test.point, test.direction).expect("finite");
        let sides = bvh.crossings(&ray, &mut Traversal::default()).into_iter().map(|crossing| crossing.side);
        let of_side = |side| if side == Side::Leaving { 1 } else { -1 };
        let (sum, count) = sides.fold((0, 0), |(sum, count), side| (sum + of_side(side), count + 1));
        sum == expected && count % 2 == expected
    };
    (test.direction == CONTAINS_DIRECTION || crosses_right())
        && bvh.winding_number(test.point, &mut Traversal::default()) == expected
}

fn bvh(sphere: &Icosphere, numerics: Numerics) -> Result<Bvh> {
    let triangles = (0..sphere.mesh.triangles.len() as u32)
        .map(|id| Primitive::Triangle(Triangle(sphere.mesh.corners(id).map(|corner| corner.as_dvec3()))));
    Bvh::with(triangles, Preset::default(), numerics)
        .map_err(|error| Error::Failed { what: error.to_string(), hint: String::new() })
}

/// Points that are timed.
const TIMED: u64 = 200_000;

/// Times random points in and around a mesh on one thread, each tier `runs` times after one run to warm up, containment
/// and closest hits in turns.
///
/// # Errors
/// [`Error::Failed`] if there are no threads.
pub fn rates(runs: u32) -> Result<Vec<ContainsRate>> {
    let sphere = Icosphere::new(LEVEL, PLACEMENTS[0]);
    let aimed: Vec<DVec3> = (0..TIMED)
        .into_par_iter()
        .map(|index| test_point(&sphere, Aim::ALL[index as usize % 2], index).point)
        .collect();
    let points: Vec<DVec3> = (0..TIMED)
        .into_par_iter()
        .map(|index| {
            let mut numbers = Numbers::new(20, index);
            DVec3::new(numbers.unit(), numbers.unit(), numbers.unit()) * 2.2 - 1.1
        })
        .collect();
    let failed = |what: String| Error::Failed { what, hint: String::new() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| failed(e.to_string()))?;
    Numerics::ALL
        .into_iter()
        .map(|numerics| {
            let bvh = bvh(&sphere, numerics)?;
            let ray = |&point: &DVec3| bvh.ray(point, CONTAINS_DIRECTION).map_err(|e| failed(e.to_string()));
            let rays: RayBuffer = points.iter().map(ray).collect::<Result<Vec<_>>>()?.into_iter().collect();
            let rate = |work: &(dyn Fn() + Sync)| {
                let clock = Clock::start(1);
                pool.install(work);
                TIMED as f64 / 1e6 / clock.seconds()
            };
            bvh.closedness();
            let run = |_| {
                let contains = rate(&|| drop(std::hint::black_box(bvh.par_contains(&points))));
                let closest = rate(&|| drop(std::hint::black_box(bvh.par_closest_hits(rays.rays()))));
                let aimed = rate(&|| drop(std::hint::black_box(bvh.par_contains(&aimed))));
                [contains, aimed, closest, contains / closest]
            };
            let runs: Vec<[f64; 4]> = (0..=runs).map(run).skip(1).collect();
            let [contains, aimed, closest_hits, ratio] = [0, 1, 2, 3].map(|k| {
                let of_runs: Vec<f64> = runs.iter().map(|run| run[k]).collect();
                Quartiles::of(&of_runs).unwrap_or(Quartiles::exact(f64::NAN))
            });
            Ok(ContainsRate { numerics, contains, aimed, closest_hits, ratio })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points are on lines through the sphere, on a length of 5 radii. The mean chord from a point of the sphere is 1
    /// radius, along the axis of a target's largest coordinate 2 / 3 to 2: a fifth to two fifths of the points are inside.
    #[test]
    fn points_are_where_they_should_be() {
        for placement in PLACEMENTS {
            let sphere = Icosphere::new(3, placement);
            for aim in Aim::ALL {
                let tests: Vec<_> = (0..2000).map(|index| test_point(&sphere, aim, index)).collect();
                let inside = tests.iter().filter(|test| test.is_inside).count();
                assert!((300..900).contains(&inside), "{}, {aim:?}: {inside}", placement.name);
                // Outside of all tangent planes, or inside of all.
                for test in &tests {
                    let distance = |id: u32| {
                        let corner = sphere.mesh.corners(id)[0].as_dvec3();
                        (test.point - corner).dot(sphere.mesh.normal(id))
                    };
                    let is_inside = (0..sphere.mesh.triangles.len() as u32).all(|id| distance(id) < 0.0);
                    assert_eq!(is_inside, test.is_inside, "{}, {aim:?}", placement.name);
                }
            }
        }
    }

    #[test]
    fn parity_is_wrong_and_containment_is_not() {
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
        let (rows, _) = wrong_points(12_000, &control).expect("nothing cancels it");
        for row in rows.iter().filter(|row| row.engine[0] == "kiln") {
            let wrong: u64 = row.wrong.iter().sum();
            assert!(if row.method == "contains" { wrong == 0 } else { wrong > 100 }, "{row:?}");
        }
    }
}
