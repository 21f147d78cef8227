//! Rays that have nothing in common, among so few primitives that looking for the right ones takes longer than testing all.

use super::{NONE, Step, Wide, hit_sphere, hit_triangle};
use crate::bvh::Tests;
use crate::geometry::bundle::{RAYS, WoopBundle};
use crate::geometry::quad::LANES;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, Ray, SlotId, Tier};

/// How many groups of triangles, and how many spheres, are few.
const FEW: usize = 4;

impl<T: Tier> Wide<T> {
    /// Whether there are so few primitives.
    pub fn has_few(&self) -> bool {
        T::HAS_BUNDLES && self.groups.len() <= FEW && self.spheres.len() <= FEW
    }

    /// Calls `found` with every hit of every ray, until it says that this is enough of one.
    #[inline(always)]
    pub(super) fn each_of_few<S: Simd>(
        &self,
        rays: &[Ray],
        bundle: &mut WoopBundle,
        tests: &mut Tests,
        mut found: impl FnMut(usize, Hit) -> Step,
    ) {
        for (index, four) in rays.chunks(RAYS).enumerate() {
            let first = index * RAYS;
            let mut asked = (1 << four.len()) - 1;
            bundle.fill::<S>(four);
            let triangles = self.groups.iter().enumerate().flat_map(|(index, group)| {
                let held = (0..LANES).filter(|&lane| group.ids[lane] != NONE);
                held.map(move |lane| (group, lane, SlotId((index * LANES + lane) as u32)))
            });
            for (group, lane, slot) in triangles {
                tests.primitives += u64::from(u32::count_ones(asked));
                let four_hits = T::hit_bundle::<S>(bundle, &group.quad.raised(lane));
                let mut lanes = (four_hits.hit | four_hits.unsure) & asked;
                while lanes != 0 {
                    let place = lanes.trailing_zeros() as usize % RAYS;
                    lanes &= lanes - 1;
                    let ray = &four[place % four.len()];
                    let hit = if four_hits.unsure >> place & 1 == 0 {
                        four_hits.at(place, PrimId(group.ids[lane]), slot)
                    } else {
                        match hit_triangle::<T>(&T::prepare(ray), ray, group, slot) {
                            Some(hit) => hit,
                            None => continue,
                        }
                    };
                    if let Step::Stop = found(first + place, hit) {
                        asked &= !(1 << place);
                    }
                }
            }
            for (index, (sphere, prim)) in (0..).zip(&self.spheres) {
                for (place, ray) in four.iter().enumerate() {
                    if asked >> place & 1 == 0 {
                        continue;
                    }
                    tests.primitives += 1;
                    let Some(t) = hit_sphere::<T>(ray, sphere) else { continue };
                    let hit = Hit { t, prim: *prim, slot: self.slot_of_sphere(index), weights: [0.0; 2] };
                    if let Step::Stop = found(first + place, hit) {
                        asked &= !(1 << place);
                    }
                }
            }
        }
    }
}
