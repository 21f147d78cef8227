//! Rays that have nothing in common, among so few primitives that looking for the right ones takes longer than testing all.

use super::{NONE, Step, Wide, hit_sphere, hit_sphere_by_four, hit_triangle};
use crate::bvh::Tests;
use crate::geometry::bundle::{Gathered, RAYS, WoopBundle};
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
                let four_hits = T::hit_bundle::<S>(bundle, &group.quad.raised(lane), false);
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
            let gathered = Gathered::<S>::new(four, 0);
            for (index, (sphere, prim)) in (0..).zip(&self.spheres) {
                tests.primitives += u64::from(u32::count_ones(asked));
                let four_hits = hit_sphere_by_four::<T, S>(&gathered, sphere);
                let mut lanes = (four_hits.hit | four_hits.unsure) & asked;
                while lanes != 0 {
                    let place = lanes.trailing_zeros() as usize % RAYS;
                    lanes &= lanes - 1;
                    let mut hit = four_hits.at(place, *prim, self.slot_of_sphere(index));
                    if four_hits.unsure >> place & 1 != 0 {
                        match hit_sphere::<T>(&four[place % four.len()], sphere) {
                            Some(t) => hit.t = t,
                            None => continue,
                        }
                    }
                    if let Step::Stop = found(first + place, hit) {
                        asked &= !(1 << place);
                    }
                }
            }
        }
    }
}
