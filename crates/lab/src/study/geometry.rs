//! Differences in ray hits between a tier and `exact`: hits and misses, primitives, distances, normals.
//!
//! The rays go through the pixel centres. Each tier uses its own precision, so that the errors of `fast` and
//! `watertight` include the rounding of vertices to f32. `kiln bench price` uses the same f32 input for all tiers
//! instead.

use glam::DVec3;
use rayon::prelude::*;

use super::data::GeometryErrors;
use super::leaks::ClosedMesh;
use kiln::bvh::detail::{HitBuffer, RayBuffer};
use kiln::bvh::{Hit, Ray, Traversal};
use kiln::error::Result;
use kiln::render::RenderControl;
use kiln::world::{View, World};

/// Rays per batch, as many as in a render tile.
const BATCH: usize = 256;

/// Closest hit of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
struct GeometryHit {
    t: f64,
    prim: u32,
    normal: DVec3,
}

/// Compares a tier with `exact` on the rays of a picture of `size` pixels, and casts `leak_rays` rays at closed meshes.
///
/// # Errors
/// [`kiln::error::Error::Interrupted`] when cancelled.
pub(crate) fn compare(
    [tier, exact]: [&World; 2],
    (view, size): (&View, [u32; 2]),
    closed: &[ClosedMesh],
    leak_rays: u64,
    control: &RenderControl,
) -> Result<GeometryErrors> {
    let pixels: Vec<u32> = (0..size[0] * size[1]).collect();
    let differences = pixels.par_chunks(BATCH * 16).flat_map_iter(|pixels| {
        let [own, exact_hits] = [tier, exact].map(|world| trace(world, view, size[0], pixels));
        own.into_iter().zip(exact_hits).map(|(own, exact)| compare_hits(own, exact))
    });
    let differences: Vec<Difference> = differences.collect();
    let count = |kind| differences.iter().filter(|difference| **difference == kind).count() as u64;
    let errors = |of: fn((f64, f64)) -> f64| {
        let errors = differences.iter().filter_map(|difference| match difference {
            Difference::Errors(ulps, degrees) => Some(of((*ulps, *degrees))),
            _ => None,
        });
        quantiles(errors.collect())
    };
    let (leaks, cast) = super::leaks::count_leaks(closed, tier.numerics(), leak_rays, control)?;
    Ok(GeometryErrors {
        numerics: tier.numerics().name().into(),
        rays: pixels.len() as u64,
        false_hits: count(Difference::FalseHit),
        false_misses: count(Difference::FalseMiss),
        wrong_primitives: count(Difference::WrongPrimitive),
        non_finite: count(Difference::NonFinite),
        t_ulps: errors(|(ulps, _)| ulps),
        normal_degrees: errors(|(_, degrees)| degrees),
        leaks_per_million: (cast > 0).then(|| leaks as f64 * 1e6 / cast as f64),
        leak_rays: cast,
    })
}

fn trace(world: &World, view: &View, width: u32, pixels: &[u32]) -> Vec<Option<GeometryHit>> {
    let precision = world.numerics().ray_precision();
    let rays: RayBuffer =
        pixels.iter().map(|pixel| view.ray(pixel % width, pixel / width, precision)).collect();
    let (mut traversal, mut hits) = (Traversal::default(), HitBuffer::default());
    rays.rays()
        .chunks(BATCH)
        .for_each(|rays| world.accelerator.closest_hits(rays, &mut hits, &mut traversal));
    let found = |(ray, hit): (Ray, Option<Hit>)| {
        let hit = hit?;
        let normal = world.interaction(&ray, &hit).geometric_normal;
        Some(GeometryHit { t: hit.t, prim: hit.prim.0, normal })
    };
    rays.rays().iter().zip(hits.iter()).map(found).collect()
}

/// Difference of a hit from that of `exact`.
#[derive(Debug, PartialEq)]
enum Difference {
    /// Both miss.
    None,
    FalseHit,
    FalseMiss,
    WrongPrimitive,
    NonFinite,
    /// Equal primitives: error of the distance in f32 ulp, angle between the normals in degrees.
    Errors(f64, f64),
}

fn compare_hits(own: Option<GeometryHit>, truth: Option<GeometryHit>) -> Difference {
    let (own, truth) = match (own, truth) {
        (None, None) => return Difference::None,
        (Some(_), None) => return Difference::FalseHit,
        (None, Some(_)) => return Difference::FalseMiss,
        (Some(own), Some(truth)) if own.prim != truth.prim => return Difference::WrongPrimitive,
        (Some(own), Some(truth)) => (own, truth),
    };
    if !(own.t.is_finite() && own.normal.is_finite()) {
        return Difference::NonFinite;
    }
    let single = truth.t as f32;
    let ulp = f64::from(single.next_up()) - f64::from(single);
    // From the chord, which is precise for small angles.
    let angle = 2.0 * ((own.normal - truth.normal).length() / 2.0).min(1.0).asin().to_degrees();
    Difference::Errors((own.t - truth.t).abs() / ulp, angle)
}

/// Median, 99.9 % quantile (nearest rank) and maximum; `None` for an empty list.
fn quantiles(mut numbers: Vec<f64>) -> Option<[f64; 3]> {
    numbers.sort_unstable_by(f64::total_cmp);
    let last = numbers.len().checked_sub(1)?;
    let rank = |share: f64| ((share * numbers.len() as f64).ceil() as usize).clamp(1, last + 1) - 1;
    Some([numbers[rank(0.5)], numbers[rank(0.999)], numbers[last]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differing_hits_are_classified() {
        let found = |t: f64, prim: u32, normal| Some(GeometryHit { t, prim, normal });
        let truth = found(1.0, 3, DVec3::Z);
        // The ulp of f32 above 1 is 2^-23.
        let far = 1.0 + 3.0 * f64::from(f32::EPSILON);
        for (own, truth, expected) in [
            (None, None, Difference::None),
            (truth, None, Difference::FalseHit),
            (None, truth, Difference::FalseMiss),
            (found(1.0, 4, DVec3::Z), truth, Difference::WrongPrimitive),
            (found(f64::NAN, 3, DVec3::Z), truth, Difference::NonFinite),
            (found(far, 3, DVec3::Z), truth, Difference::Errors(3.0, 0.0)),
        ] {
            assert_eq!(compare_hits(own, truth), expected);
        }
        let Difference::Errors(_, angle) = compare_hits(found(1.0, 3, DVec3::X), truth) else {
            panic!("equal hits")
        };
        assert!((angle - 90.0).abs() < 1e-12, "{angle}");
    }

    #[test]
    fn quantiles_have_the_nearest_rank() {
        // Of 1 to 2000, the 1000th and the 1998th.
        assert_eq!(quantiles((1..=2000).map(f64::from).rev().collect()), Some([1000.0, 1998.0, 2000.0]));
        assert_eq!(quantiles(vec![7.0]), Some([7.0; 3]));
        assert_eq!(quantiles(Vec::new()), None);
    }
}
