//! Differences in ray hits between a tier and `exact`: hits and misses, primitives, distances, normals.
//!
//! The rays go through the pixel centres. Each tier uses its own precision, so that the errors of `naive` and
//! `watertight` include the rounding of vertices to f32. `kiln bench numerics` uses the same f32 input for all tiers
//! instead.

use glam::DVec3;
use rayon::prelude::*;

use super::data::GeometryErrors;
use super::leaks::ClosedMesh;
use crate::bvh::Traversal;
use crate::error::Result;
use crate::geometry::{Hit, HitBuffer, Ray, RayBuffer};
use crate::render::RenderControl;
use crate::world::{View, World};

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
/// [`crate::error::Error::Interrupted`] when cancelled.
pub(crate) fn compare(
    [tier, exact]: [&World; 2],
    (view, size): (&View, [u32; 2]),
    closed: &[ClosedMesh],
    leak_rays: u64,
    control: &RenderControl,
) -> Result<GeometryErrors> {
    let pixels: Vec<u32> = (0..size[0] * size[1]).collect();
    let parts: Vec<(Tally, Vec<f64>, Vec<f64>)> = pixels
        .par_chunks(BATCH * 16)
        .map(|pixels| {
            let [own, exact_hits] = [tier, exact].map(|world| trace(world, view, size[0], pixels));
            let (mut tally, mut ulps, mut degrees) = (Tally::default(), Vec::new(), Vec::new());
            for (own, exact) in own.into_iter().zip(exact_hits) {
                if let Some((error, angle)) = tally.compare(own, exact) {
                    ulps.push(error);
                    degrees.push(angle);
                }
            }
            (tally, ulps, degrees)
        })
        .collect();
    let (mut tally, mut ulps, mut degrees) = (Tally::default(), Vec::new(), Vec::new());
    for (part, more_ulps, more_degrees) in parts {
        tally.add(&part);
        ulps.extend(more_ulps);
        degrees.extend(more_degrees);
    }
    let (leaks, cast) = super::leaks::count_leaks(closed, tier.numerics(), leak_rays, control)?;
    Ok(GeometryErrors {
        numerics: tier.numerics().name().into(),
        rays: pixels.len() as u64,
        false_hits: tally.false_hits,
        false_misses: tally.false_misses,
        wrong_primitives: tally.wrong,
        non_finite: tally.non_finite,
        t_ulps: quantiles(ulps),
        normal_degrees: quantiles(degrees),
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

/// Counts of differing hits.
#[derive(Debug, Default, PartialEq)]
struct Tally {
    false_hits: u64,
    false_misses: u64,
    wrong: u64,
    non_finite: u64,
}

impl Tally {
    /// Counts a hit; for the correct primitive, returns the error of the distance in f32 ulp and the angle between the
    /// normals in degrees.
    fn compare(&mut self, own: Option<GeometryHit>, truth: Option<GeometryHit>) -> Option<(f64, f64)> {
        let (own, truth) = match (own, truth) {
            (None, None) => return None,
            (Some(_), None) => {
                self.false_hits += 1;
                return None;
            }
            (None, Some(_)) => {
                self.false_misses += 1;
                return None;
            }
            (Some(own), Some(truth)) => (own, truth),
        };
        if own.prim != truth.prim {
            self.wrong += 1;
            return None;
        }
        if !(own.t.is_finite() && own.normal.is_finite()) {
            self.non_finite += 1;
            return None;
        }
        let single = truth.t as f32;
        let ulp = f64::from(single.next_up()) - f64::from(single);
        // From the chord, which is precise for small angles.
        let angle = 2.0 * ((own.normal - truth.normal).length() / 2.0).min(1.0).asin().to_degrees();
        Some(((own.t - truth.t).abs() / ulp, angle))
    }

    fn add(&mut self, other: &Tally) {
        self.false_hits += other.false_hits;
        self.false_misses += other.false_misses;
        self.wrong += other.wrong;
        self.non_finite += other.non_finite;
    }
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
        let found = |t: f64, prim: u32| Some(GeometryHit { t, prim, normal: DVec3::Z });
        let mut tally = Tally::default();
        assert_eq!(tally.compare(None, None), None);
        assert_eq!(tally.compare(found(1.0, 3), None), None);
        assert_eq!(tally.compare(None, found(1.0, 3)), None);
        assert_eq!(tally.compare(found(1.0, 4), found(1.0, 3)), None);
        assert_eq!(tally.compare(found(f64::NAN, 3), found(1.0, 3)), None);
        // The ulp of f32 above 1 is 2^-23.
        assert_eq!(
            tally.compare(found(1.0 + 3.0 * f64::from(f32::EPSILON), 3), found(1.0, 3)),
            Some((3.0, 0.0))
        );
        assert_eq!(tally, Tally { false_hits: 1, false_misses: 1, wrong: 1, non_finite: 1 });
    }

    #[test]
    fn a_right_angle_has_ninety_degrees() {
        let one = |normal| Some(GeometryHit { t: 1.0, prim: 0, normal });
        let (_, angle) = Tally::default().compare(one(DVec3::X), one(DVec3::Z)).unwrap();
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
