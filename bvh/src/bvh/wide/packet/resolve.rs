//! The hits of a packet that f32 does not decide: tested by the tier, a group of rays at once where it can
//! ([`Tier::hit_triangle_n`]), or by the side of a triangle's plane in f64 ([`TrianglePlane`]).

use super::Packet;
use super::hits::{BestHit, is_resolved, is_unresolved};
use crate::bvh::wide::layout::Wide;
use crate::bvh::wide::single::leaf::hit_triangle;
use crate::geometry::lanes::{HitN, LANES4, MAX_LANES};
use crate::geometry::simd::{Doubles, Simd, Vector};
use crate::geometry::{Hit, HitBuffer, NO_PRIMITIVE, PreparedRay, Ray, SlotId, Tier};

impl<T: Tier, S: Simd, const ANY: bool> Packet<'_, T, S, ANY> {
    /// Records certain hits of rays of a block between two depths, on a triangle given by slot, corners and the sign
    /// for [`TrianglePlane::new`]. Returns the rays that must still be tested, and whether a best hit changed.
    #[inline(always)]
    pub(super) fn record_certain(
        &mut self,
        block: usize,
        certain: u32,
        (slot, corners, sign): (SlotId, &[[f64; 3]; 3], f64),
        depths: [S::F; 2],
    ) -> (u32, bool) {
        let [nearer, farther] = self.scratch.best.compare(block, depths);
        // Nearer to the apex the hit may be outside of the ray.
        let within = certain & S::F::splat(self.frustum.inner_depth).le(depths[0]);
        let nearer = nearer & within;
        let mut unknown = certain & !(nearer | farther);
        if !ANY {
            if nearer != 0 {
                self.scratch.best.set_unresolved(block, nearer, slot.index(), depths);
            }
            return (unknown, nearer != 0);
        }
        let mut hit = nearer;
        if unknown & within != 0 {
            // Shadow rays start close to the surface that they leave: f64 decides on which side of the triangle.
            let plane = TrianglePlane::new(corners, sign);
            for half in 0..2 {
                let tested = unknown & within & (S::D::ALL << (half * S::D::LANES));
                if tested == 0 {
                    continue;
                }
                let origins = self.rays.origin_lanes::<S::D>(block * S::F::LANES + half * S::D::LANES);
                let [before, beyond] = plane.sides(origins);
                unknown &= !((before | beyond) << (half * S::D::LANES) & tested);
                hit |= beyond << (half * S::D::LANES) & tested;
            }
        }
        if hit != 0 {
            self.retire(block, hit);
        }
        (unknown, hit != 0)
    }

    /// Tests some rays of a block, half of it at once, and records their hits. `test` tests a group of rays from an
    /// index on; `hit` makes the hit of a ray from a lane of the result. Returns whether a best hit changed.
    #[inline(always)]
    pub(super) fn test_block(
        &mut self,
        wide: &Wide<T>,
        block: usize,
        rays: u32,
        test: impl Fn(&mut Self, usize) -> HitN<S::D>,
        hit: impl Fn(&Self, usize, &HitN<S::D>, usize) -> Option<Hit>,
    ) -> bool {
        let mut changed = false;
        for half in 0..2 {
            let tested = rays >> (half * S::D::LANES) & S::D::ALL;
            if tested == 0 {
                continue;
            }
            let first = block * S::F::LANES + half * S::D::LANES;
            let group = test(self, first);
            let mut lanes = (group.hit | group.undecided) & tested;
            while lanes != 0 {
                let place = lanes.trailing_zeros() as usize % S::D::LANES;
                lanes &= lanes - 1;
                let Some(hit) = hit(self, first + place, &group, place) else { continue };
                changed |= self.record(wide, first + place, &hit);
            }
        }
        changed
    }

    /// The given rays of a block without those whose best hit is already on triangle `prim`, which may be in several
    /// slots.
    #[inline(always)]
    pub(super) fn without_known(&self, wide: &Wide<T>, block: usize, mut rays: u32, prim: u32) -> u32 {
        if ANY {
            return rays;
        }
        let mut left = rays;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize % S::F::LANES;
            rays &= rays - 1;
            let is_known = match self.scratch.best.get(block * S::F::LANES + lane) {
                BestHit::None => false,
                BestHit::Unresolved(slot) => prim_in_slot(wide, slot) == prim,
                BestHit::Resolved(hit) => hit.prim.0 == prim,
            };
            left &= !(u32::from(is_known) << lane);
        }
        left
    }

    /// Records a hit found by the tier. Returns whether it is the new best hit.
    #[inline(always)]
    fn record(&mut self, wide: &Wide<T>, ray: usize, hit: &Hit) -> bool {
        if ANY {
            self.retire(ray / S::F::LANES, 1 << (ray % S::F::LANES));
            return true;
        }
        let best = match self.scratch.best.get(ray) {
            BestHit::None => None,
            BestHit::Resolved(hit) => Some(hit),
            BestHit::Unresolved(slot) => {
                let best = hit_in_slot(wide, &self.rays.get(ray), slot);
                match &best {
                    Some(best) => self.scratch.best.resolve(ray, best),
                    None => self.is_inconsistent = true,
                }
                best
            }
        };
        if !wide.is_better(|| self.rays.get(ray), hit, best.as_ref()) {
            return false;
        }
        let depths = self.scratch.rays.depths_at(ray, hit.t);
        self.scratch.best.set_resolved(ray, hit, depths);
        true
    }
}

impl<T: Tier, S: Simd> Packet<'_, T, S, false> {
    /// Tests the unresolved best hits and appends the best hits of all rays. `false`, with nothing appended, if the
    /// tier missed a triangle that f32 certainly hit.
    #[inline(always)]
    pub(super) fn resolve_all(&mut self, wide: &Wide<T>, hits: &mut HitBuffer) -> bool {
        let before = hits.len();
        hits.reserve(self.rays.len());
        for first in (0..self.rays.len()).step_by(S::D::LANES) {
            self.prefetch_following(
                #[inline(always)]
                |index| hits.prefetch(before + index),
            );
            self.resolve_group(wide, first, hits);
        }
        if self.is_inconsistent {
            hits.resize(before);
        }
        !self.is_inconsistent
    }

    /// Tests the unresolved best hits of a group of rays, and appends their best hits.
    #[inline(always)]
    fn resolve_group(&mut self, wide: &Wide<T>, first: usize, hits: &mut HitBuffer) {
        let count = S::D::LANES.min(self.rays.len() - first);
        let (mut slots, mut unresolved, mut resolved) = ([0; MAX_LANES], 0u32, 0u32);
        for (lane, to) in slots.iter_mut().enumerate().take(S::D::LANES) {
            let slot = self.scratch.best.slot(first + lane);
            unresolved |= u32::from(is_unresolved(slot)) << lane;
            resolved |= u32::from(is_resolved(slot)) << lane;
            *to = slot;
        }
        let all = u32::MAX >> (u32::BITS as usize - count);
        unresolved &= all;
        let (mut group, mut prims) = (HitN::NONE, [NO_PRIMITIVE; MAX_LANES]);
        if unresolved != 0 {
            // Other lanes are tested against any of the triangles.
            let some = slots[unresolved.trailing_zeros() as usize % MAX_LANES];
            let mut is_one = true;
            for (lane, slot) in slots.iter_mut().enumerate() {
                *slot = if unresolved >> lane & 1 != 0 { *slot } else { some };
                is_one &= *slot == some;
            }
            let place = |slot: u32| (&wide.triangles[slot as usize / LANES4], slot as usize % LANES4);
            let prepared = self.prepared(first / S::D::LANES);
            if is_one {
                let (leaf, lane) = place(some);
                group = T::hit_triangle_n(prepared, &leaf.corners.corners_f64(lane), true);
                prims = [leaf.ids[lane]; MAX_LANES];
            } else {
                let triangles = slots.map(place);
                group = T::hit_triangles_n(
                    prepared,
                    #[inline(always)]
                    |lane| (&triangles[lane].0.corners, triangles[lane].1),
                );
                prims = triangles.map(|(leaf, lane)| leaf.ids[lane]);
            }
            group.hit &= unresolved;
            for (lane, prim) in prims.iter_mut().enumerate() {
                *prim = if group.hit >> lane & 1 != 0 { *prim } else { NO_PRIMITIVE };
            }
        }
        let before = hits.len();
        hits.append(count, &prims, &slots, &group);
        // One by one: what the tier found before, and what it must decide by the test for one ray.
        let mut others = (resolved | unresolved & !group.hit) & all;
        while others != 0 {
            let lane = others.trailing_zeros() as usize % MAX_LANES;
            others &= others - 1;
            let hit = match self.scratch.best.get(first + lane) {
                BestHit::None => None,
                BestHit::Resolved(hit) => Some(hit),
                BestHit::Unresolved(slot) => {
                    let hit = hit_in_slot(wide, &self.rays.get(first + lane), slot);
                    self.is_inconsistent |= hit.is_none();
                    hit
                }
            };
            hits.set(before + lane, hit.as_ref());
        }
    }
}

/// The tier's hit of a ray on the triangle in a slot.
pub(crate) fn hit_in_slot<T: Tier>(wide: &Wide<T>, ray: &Ray, slot: SlotId) -> Option<Hit> {
    hit_triangle::<T>(&T::Prepared::new(ray), ray, &wide.triangles[slot.index() as usize / LANES4], slot)
}

/// The primitive id of the triangle in a slot.
#[inline(always)]
fn prim_in_slot<T: Tier>(wide: &Wide<T>, slot: SlotId) -> u32 {
    wide.triangles[slot.index() as usize / LANES4].ids[slot.index() as usize % LANES4]
}

/// The plane of a triangle, which decides on which side of the triangle rays start.
///
/// For a point o, H = n . (A - o) with n = (B - A) x (C - A) is the signed distance to the plane times twice the area.
/// In max norms, let M = |A - o|, p = |B - A| and q = |C - A|: no corner is farther from o than M, M + p and M + q.
/// H as computed here is off by less than 48 u M p q: six products of three differences, with 8 roundings each.
/// The tier's test has the sign of H if that is above 168 u M (M + p) (M + q) (see `side` in `geometry::woop_n`);
/// u = 2^-53.
struct TrianglePlane {
    corner: [f64; 3],
    /// n, oriented so that H of the apex is positive.
    normal: [f64; 3],
    /// p and q.
    sizes: [f64; 2],
}

/// 256 u, more than the sum of both bounds.
const SIDE_SLACK: f64 = 128.0 * f64::EPSILON;

impl TrianglePlane {
    /// The plane of a triangle; `sign` is the sign of H at the apex.
    #[inline(always)]
    fn new([a, b, c]: &[[f64; 3]; 3], sign: f64) -> Self {
        let minus = |p: &[f64; 3], q: &[f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let size = |p: &[f64; 3]| p[0].abs().max(p[1].abs()).max(p[2].abs());
        let (p, q) = (minus(b, a), minus(c, a));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        TrianglePlane {
            corner: *a,
            normal: [normal[0] * sign, normal[1] * sign, normal[2] * sign],
            sizes: [size(&p), size(&q)],
        }
    }

    /// The rays that certainly start on the apex's side of the plane, and those that certainly start on the other side.
    #[inline(always)]
    fn sides<D: Doubles>(&self, origins: [D; 3]) -> [u32; 2] {
        let nothing = D::splat(0.0);
        let (mut height, mut reach) = (nothing, nothing);
        for ((corner, normal), origin) in self.corner.iter().zip(&self.normal).zip(origins) {
            let to_corner = D::splat(*corner) - origin;
            height = D::splat(*normal) * to_corner + height;
            reach = to_corner.abs().max(reach);
        }
        let [p, q] = self.sizes.map(|size| reach + D::splat(size));
        let error = reach * D::splat(SIDE_SLACK) * (p * q);
        [error.lt(height), height.lt(nothing - error)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::expansion::Expansion;
    use crate::geometry::sign_of_determinant;
    use crate::geometry::simd::Portable;
    use glam::DVec3;

    /// The sign of H in exact arithmetic.
    fn exact([a, b, c]: &[[f64; 3]; 3], o: DVec3) -> i32 {
        let side = |p: &[f64; 3], q: &[f64; 3]| [0, 1, 2].map(|k| Expansion::difference(p[k], q[k]));
        sign_of_determinant(&[side(a, &o.to_array()), side(b, a), side(c, a)])
    }

    #[test]
    fn a_side_that_is_sure_is_right() {
        let mut state = 7u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut sure, mut unsure) = (0, 0);
        for i in 0..20_000 {
            let away = [0.0, 3.0, 1e3][i % 3];
            let mut corner = || [away + unit(), away + unit(), away + unit()];
            let corners = [corner(), corner(), corner()];
            let [a, b, c] = corners.map(DVec3::from);
            // In the plane up to f64's rounding, or off it by a few units in the last place of f64 or f32.
            let beside = [0.0, 1e-16, 1e-15, 1e-13, 1e-7][i / 3 % 5] * (away + 1.0) * unit();
            let (v, w) = (unit(), unit());
            let origin = a + v * (b - a) + w * (c - a) + beside * (b - a).cross(c - a).normalize();
            let [before, beyond] =
                TrianglePlane::new(&corners, 1.0).sides(origin.to_array().map(<Portable as Simd>::D::splat));
            match exact(&corners, origin) {
                sign if before & 1 != 0 => assert!(sign > 0, "{corners:?} {origin:?}"),
                sign if beyond & 1 != 0 => assert!(sign < 0, "{corners:?} {origin:?}"),
                _ => unsure += 1,
            }
            sure += i32::from((before | beyond) & 1 != 0);
        }
        assert!(sure > 2000 && unsure > 2000, "{sure} sure, {unsure} not");
    }
}
