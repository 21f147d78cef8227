//! The vertices of a generation of paths, as structures of arrays: their frames, views, throughputs and ray origins.
//! Entry i belongs to surface interaction i. Loops compute all entries, also those that mean nothing, from whatever an
//! earlier generation left there; which ones count is said with each array.

use std::ops::Range;

use glam::DVec3;

use super::Path;
use super::media::{MediaTable, MediumStackId, MediumTransition};
use crate::effects::ray_origins::find_origins;
use crate::effects::tile::{StartPoints, vec_bytes};
use crate::scene::{Material, TextureSlot};
use crate::world::{Flags, InteractionSoa, PerRay, RAYS_PER_BATCH, Vec3Soa, World, select, simd};

/// The vertices of a generation.
#[derive(Default)]
pub(super) struct Vertices {
    len: usize,
    /// The throughput of each path, with the transmittance up to the surface.
    pub(super) throughput: Vec3Soa,
    /// Tangents, bitangents and shading normals.
    pub(super) frame: [Vec3Soa; 3],
    /// Unit vectors towards the rays' origins, in the frames; see [`Vertices::is_visible`].
    pub(super) view: Vec3Soa,
    /// The points that rays leave on the side of the geometric normal.
    starts: StartPoints,
    /// The media on both sides of surfaces.
    pub(super) media: MediaTable,
    /// The entry of each surface in that; empty in worlds without volumes.
    crossings: Vec<u32>,
}

impl Vertices {
    /// The number of vertices.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len.min(RAYS_PER_BATCH)
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Vertices>() + self.media.bytes() + vec_bytes(&self.crossings)
    }

    /// Begins a generation: `paths` and `media` are those of its rays, `media` empty in worlds without volumes.
    pub(super) fn begin(
        &mut self,
        world: &World,
        surfaces: &InteractionSoa,
        paths: &[Path],
        media: &[MediumStackId],
    ) {
        self.len = surfaces.len();
        self.crossings.clear();
        for (i, &ray) in surfaces.ray_of().iter().enumerate() {
            let mut throughput = paths[ray as usize].throughput;
            if let Some(&media) = media.get(ray as usize) {
                let entry = self.media.meet(world, media, surfaces, i);
                throughput *= self.media.crossing(entry).transmittance(world, surfaces.hit(i).t);
                self.crossings.push(entry);
            }
            self.throughput.set(i, throughput);
        }
    }

    /// Computes frames, views and, unless they are `lifted`, ray origins.
    pub(super) fn find_frames(
        &mut self,
        world: &World,
        surfaces: &InteractionSoa,
        lifted: Option<&StartPoints>,
    ) {
        if let Some(lifted) = lifted {
            self.starts.clone_from(lifted);
        } else {
            self.starts.position.clone_from(&surfaces.position);
            find_origins(surfaces, &mut self.starts.origin, world.numerics());
        }
        simd!(self.compute_frames(surfaces));
        for (material, range) in surfaces.by_material() {
            if let Material::MetallicRoughness(m) = &world.materials[*material as usize]
                && m.layers.anisotropy > 0.0
            {
                let rotation = m.layers.anisotropy_rotation;
                range.clone().for_each(|i| self.turn_frame(world, surfaces, rotation, i));
            }
        }
    }

    /// Turns a frame until its first axis is the direction in which an anisotropic surface is rougher.
    fn turn_frame(&mut self, world: &World, surfaces: &InteractionSoa, rotation: f64, i: usize) {
        let (normal, is_back) = (self.frame[2].get(i), world.is_seen_from_back(surfaces, i));
        let texel = surfaces.texels.get(TextureSlot::Anisotropy, i);
        let at = (surfaces.objects()[i], &surfaces.hit(i));
        let Some(along) = world.rougher_direction(at, is_back, normal, texel, rotation) else { return };
        let (across, view) = (normal.cross(along), surfaces.view.get(i));
        self.frame[0].set(i, along);
        self.frame[1].set(i, across);
        self.view.set(i, DVec3::new(view.dot(along), view.dot(across), self.view.get(i).z));
    }

    #[inline(always)]
    fn compute_frames(&mut self, surfaces: &InteractionSoa) {
        for i in 0..self.len() {
            let (shading, geometric) = (surfaces.shading_normal.get(i), surfaces.geometric_normal.get(i));
            let view = surfaces.view.get(i);
            // A bent normal that is turned away from the view has no local frame.
            let normal = select(shading.dot(view) > 0.0, shading, geometric);
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            self.frame[0].set(i, tangent);
            self.frame[1].set(i, bitangent);
            self.frame[2].set(i, normal);
            self.view.set(i, DVec3::new(view.dot(tangent), view.dot(bitangent), view.dot(normal)));
        }
    }

    /// A world direction in the frame of a vertex.
    #[inline(always)]
    pub(super) fn to_local(&self, i: usize, v: DVec3) -> DVec3 {
        let [tangent, bitangent, normal] = &self.frame;
        DVec3::new(v.dot(tangent.get(i)), v.dot(bitangent.get(i)), v.dot(normal.get(i)))
    }

    /// A direction in the frame of a vertex as a unit vector of the world.
    #[inline(always)]
    pub(super) fn to_world(&self, i: usize, v: DVec3) -> DVec3 {
        let [tangent, bitangent, normal] = &self.frame;
        (tangent.get(i) * v.x + bitangent.get(i) * v.y + normal.get(i) * v.z).normalize()
    }

    /// Whether a surface may scatter light: the view is above its shading normal's horizon.
    #[inline(always)]
    pub(super) fn is_visible(&self, i: usize) -> bool {
        self.view.get(i).z > 0.0
    }

    /// The point that light samples and BSDF samples are taken from: both must have the densities of one point.
    #[inline(always)]
    pub(super) fn position(&self, i: usize) -> DVec3 {
        self.starts.position.get(i)
    }

    /// Whether a ray leaves from [`Vertices::origin_above`]: on the side of the geometric normal, from lifted points in
    /// any direction.
    #[inline(always)]
    pub(super) fn leaves_above(&self, i: usize, surfaces: &InteractionSoa, direction: DVec3) -> bool {
        self.starts.is_lifted.get(i) | (direction.dot(surfaces.geometric_normal.get(i)) > 0.0)
    }

    /// The origin of a ray that leaves on the side of the geometric normal.
    #[inline(always)]
    pub(super) fn origin_above(&self, i: usize) -> DVec3 {
        self.starts.origin.get(i)
    }

    /// The origin of a ray that leaves in a direction.
    #[inline]
    pub(super) fn origin(
        &self,
        i: usize,
        world: &World,
        surfaces: &InteractionSoa,
        direction: DVec3,
    ) -> DVec3 {
        if self.leaves_above(i, surfaces, direction) {
            self.origin_above(i)
        } else {
            world.origin_below(surfaces, i, direction)
        }
    }

    /// The media at a surface.
    #[inline]
    pub(super) fn crossing(&self, i: usize) -> &MediumTransition {
        self.crossings.get(i).map_or(&MediumTransition::NONE, |&entry| self.media.crossing(entry))
    }

    /// Whether the crossings of two vertices are the same entry of the table.
    #[inline]
    pub(super) fn have_same_crossing(&self, i: usize, j: usize) -> bool {
        self.crossings.get(i) == self.crossings.get(j)
    }

    /// The volumes on the side of a direction.
    #[inline]
    pub(super) fn media_towards(
        &self,
        i: usize,
        surfaces: &InteractionSoa,
        direction: DVec3,
    ) -> MediumStackId {
        self.crossing(i).sides[usize::from(!self.leaves_above(i, surfaces, direction))]
    }
}

/// Indices of vertices or rays of a generation, in ascending order.
#[derive(Default)]
pub(super) struct IndexList {
    len: usize,
    indices: PerRay<u32>,
}

impl IndexList {
    /// The number of indices.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len.min(RAYS_PER_BATCH)
    }

    /// The index at `k`, below [`IndexList::len`].
    #[inline(always)]
    pub(super) fn get(&self, k: usize) -> usize {
        self.indices[k] as usize % RAYS_PER_BATCH
    }

    /// The indices.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> {
        (0..self.len()).map(|k| self.get(k))
    }

    /// Lists the indices below `count` that `is_listed` accepts. Without branches, which would be mispredicted.
    #[inline(always)]
    pub(super) fn fill(&mut self, count: usize, is_listed: impl Fn(usize) -> bool) {
        self.len = 0;
        for i in 0..count.min(RAYS_PER_BATCH) {
            self.indices[self.len % RAYS_PER_BATCH] = i as u32;
            self.len += usize::from(is_listed(i));
        }
    }

    /// Keeps the indices that `is_kept` accepts. Returns the number of the others.
    #[inline(always)]
    pub(super) fn retain(&mut self, mut is_kept: impl FnMut(usize) -> bool) -> u64 {
        let before = self.len();
        self.len = 0;
        for k in 0..before {
            let i = self.get(k);
            self.indices[self.len % RAYS_PER_BATCH] = i as u32;
            self.len += usize::from(is_kept(i));
        }
        (before - self.len) as u64
    }
}

/// The vertices with a class of BSDF. Loops compute all vertices of the range from the first to the last of them.
#[derive(Default)]
pub(super) struct ClassPartition {
    start: usize,
    end: usize,
    is_member: Flags,
}

impl ClassPartition {
    /// Removes all.
    pub(super) fn clear(&mut self) {
        (self.start, self.end) = (0, 0);
    }

    /// Adds vertices, after those of lower index.
    pub(super) fn push(&mut self, range: Range<usize>) {
        if self.end == 0 {
            (self.start, self.end) = (range.start, range.start);
        }
        (self.end..range.start).for_each(|between| self.is_member.set(between, false));
        range.clone().for_each(|i| self.is_member.set(i, true));
        self.end = range.end;
    }

    /// The vertices from the first to the last member.
    #[inline(always)]
    pub(super) fn range(&self) -> Range<usize> {
        self.start..self.end.min(RAYS_PER_BATCH)
    }

    /// Whether a vertex of the range is a member.
    #[inline(always)]
    pub(super) fn has(&self, i: usize) -> bool {
        self.is_member.get(i)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaps between members are none, whatever was there before.
    #[test]
    fn members_are_those_of_the_ranges() {
        let mut members = ClassPartition::default();
        for ranges in [vec![0..3, 3..RAYS_PER_BATCH], vec![3..5, 9..10, 10..14], vec![], vec![7..8, 8..9]] {
            members.clear();
            ranges.iter().for_each(|range| members.push(range.clone()));
            let found: Vec<usize> = members.range().filter(|&i| members.has(i)).collect();
            assert_eq!(found, ranges.into_iter().flatten().collect::<Vec<_>>());
        }
    }
}
