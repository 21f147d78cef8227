//! The media that paths run through.

use glam::DVec3;

use crate::bvh::Traversal;
use crate::effects::tile::vec_bytes;
use crate::world::{InteractionSoa, Volumes, World};

/// The most volumes of which a path knows that they hold its vertex. Beyond, those that enclose most are forgotten; a
/// hit from inside recalls them.
const CAPACITY: usize = 8;

/// No volume.
const NONE: u32 = u32::MAX;

/// The closed volumes that hold a point, in the order of their precedence, those entered several times as often.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MediumStack([u32; CAPACITY]);

impl MediumStack {
    /// Outside of all volumes.
    const EMPTY: MediumStack = MediumStack([NONE; CAPACITY]);

    /// The volume that is the medium.
    fn medium(self) -> Option<u32> {
        Some(self.0[0]).filter(|&volume| volume != NONE)
    }

    /// Whether there are no volumes: empty entries are last.
    #[inline]
    fn is_empty(&self) -> bool {
        self.0[0] == NONE
    }

    fn with(mut self, volume: u32) -> Self {
        if self.is_empty() {
            self.0[0] = volume;
            return self;
        }
        let at = self.0.partition_point(|&other| other < volume);
        if at < CAPACITY {
            self.0.copy_within(at..CAPACITY - 1, at + 1);
            self.0[at] = volume;
        }
        self
    }

    fn without(mut self, volume: u32) -> Self {
        if self.0[..2] == [volume, NONE] {
            return MediumStack::EMPTY;
        }
        if let Some(at) = self.0.iter().position(|&other| other == volume) {
            self.0.copy_within(at + 1.., at);
            self.0[CAPACITY - 1] = NONE;
        }
        self
    }

    /// The volumes, in order.
    fn volumes(&self) -> impl Iterator<Item = u32> {
        self.0.into_iter().take_while(|&volume| volume != NONE)
    }

    /// Those of the volumes that may hold a point. Drops volumes that were left unseen: by a surface that coincides with
    /// another, or that was passed by its opacity.
    fn around(self, volumes: &Volumes, point: DVec3) -> Self {
        let may_hold = |volume: &u32| volumes.get(*volume).may_hold(point);
        if self.volumes().all(|volume| may_hold(&volume)) {
            self
        } else {
            self.volumes().filter(may_hold).fold(MediumStack::EMPTY, MediumStack::with)
        }
    }

    /// The volumes that hold a point: those whose nearest surface along a ray is met from inside.
    fn at(world: &World, point: DVec3, traversal: &mut Traversal) -> Self {
        let Some(volumes) = world.volumes.as_ref().filter(|volumes| volumes.may_hold(point)) else {
            return MediumStack::EMPTY;
        };
        // Any direction will do; few edges of models lie in this one.
        let direction = DVec3::new(0.3637, 0.7219, 0.5887).normalize();
        let ray = world.numerics().ray_precision().ray(point, direction, 0.0, f64::INFINITY);
        let mut hits = Vec::new();
        world.accelerator.all_hits(&ray, &mut hits, traversal);
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let (mut media, mut seen) = (MediumStack::EMPTY, Vec::new());
        for hit in hits {
            let object = world.object_of(hit.prim);
            let Some(volume) =
                volumes.of_object(object).filter(|v| volumes.get(*v).is_closed && !seen.contains(v))
            else {
                continue;
            };
            seen.push(volume);
            if world.is_back(object, &hit, ray.at(hit.t), -ray.direction()) {
                media = media.with(volume);
            }
        }
        media
    }
}

/// A set of volumes in a [`MediaTable`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MediumStackId(u32);

impl MediumStackId {
    /// Outside of all volumes.
    pub(super) const EMPTY: MediumStackId = MediumStackId(0);
}

/// A surface that a path meets, as far as media are concerned.
#[derive(Debug, Clone, Copy)]
pub(super) struct MediumTransition {
    /// The medium that the path came through.
    passed: Option<u32>,
    /// The closed volumes in front of the surface, on the path's side, and behind it.
    pub(super) sides: [MediumStackId; 2],
    /// Whether the surface bounds a volume and the path came through that.
    pub(super) from_inside: bool,
    /// Whether a volume that goes before that of the surface is on both sides, so that there is no interface.
    pub(super) is_hidden: bool,
    /// The index of refraction of the medium around the object.
    pub(super) ior_around: f64,
}

impl MediumTransition {
    /// A surface with no medium on either side.
    pub(super) const NONE: MediumTransition = MediumTransition {
        passed: None,
        sides: [MediumStackId::EMPTY; 2],
        from_inside: false,
        is_hidden: false,
        ior_around: 1.0,
    };

    /// The transmittance of what the path came through, over a distance.
    #[inline]
    pub(super) fn transmittance(&self, world: &World, distance: f64) -> DVec3 {
        transmittance(world, self.passed, distance)
    }
}

/// What a [`MediumTransition`] depends on: the volumes around the surface, its own, and whether the path is inside that.
type MediumTransitionKey = (MediumStackId, Option<u32>, bool);

/// The sets of volumes that hold the vertices of some paths, and the surfaces between them. Few are different.
#[derive(Default)]
pub(super) struct MediaTable {
    sets: Vec<MediumStack>,
    crossings: Vec<(MediumTransitionKey, MediumTransition)>,
}

/// The latest entries of a [`MediaTable`] that are searched. One that is not found there is added again, so that a search
/// takes few steps and there are no more entries than vertices.
const SEARCHED: usize = 8;

impl MediaTable {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        vec_bytes(&self.sets) + vec_bytes(&self.crossings)
    }

    /// Begins new paths, and lists the volumes that hold their origins, of which consecutive ones may be equal.
    pub(super) fn start(&mut self, world: &World, [x, y, z]: [&[f64]; 3], media: &mut Vec<MediumStackId>) {
        self.crossings.clear();
        self.sets.clear();
        self.sets.push(MediumStack::EMPTY);
        let mut traversal = Traversal::default();
        let mut last = (DVec3::NAN, MediumStackId::EMPTY);
        media.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| {
            let point = DVec3::new(x, y, z);
            if point != last.0 {
                last = (point, self.id(MediumStack::at(world, point, &mut traversal)));
            }
            last.1
        }));
    }

    fn id(&mut self, media: MediumStack) -> MediumStackId {
        if media.is_empty() {
            return MediumStackId::EMPTY;
        }
        let known = latest_indices(self.sets.len()).find(|&id| self.sets[id] == media);
        let id = known.unwrap_or_else(|| {
            self.sets.push(media);
            self.sets.len() - 1
        });
        MediumStackId(id as u32)
    }

    /// The entry of surface `i`, which a path within `media` meets.
    #[inline]
    pub(super) fn meet(
        &mut self,
        world: &World,
        media: MediumStackId,
        surfaces: &InteractionSoa,
        i: usize,
    ) -> u32 {
        let volume = world.volumes.as_ref().and_then(|volumes| volumes.of_object(surfaces.objects()[i]));
        let from_inside = volume.is_some() && world.is_seen_from_back(surfaces, i);
        let key = (self.around(world, media, surfaces.position.get(i)), volume, from_inside);
        let known = latest_indices(self.crossings.len()).find(|&entry| self.crossings[entry].0 == key);
        known.unwrap_or_else(|| self.add_crossing(world, key)) as u32
    }

    /// Those of the volumes that may hold a point.
    #[inline]
    fn around(&mut self, world: &World, media: MediumStackId, point: DVec3) -> MediumStackId {
        let Some(volumes) = world.volumes.as_ref().filter(|_| media != MediumStackId::EMPTY) else {
            return media;
        };
        let all = self.sets[media.0 as usize];
        let around = all.around(volumes, point);
        if around == all { media } else { self.id(around) }
    }

    #[cold]
    fn add_crossing(&mut self, world: &World, key: MediumTransitionKey) -> usize {
        let (around, volume, from_inside) = key;
        let crossing = world.volumes.as_ref().map_or(MediumTransition::NONE, |volumes| {
            let around = self.sets[around.0 as usize];
            let closed = volume.filter(|&volume| volumes.get(volume).is_closed);
            let outside = closed.filter(|_| from_inside).map_or(around, |volume| around.without(volume));
            let inside = closed.map_or(outside, |volume| outside.with(volume));
            let medium = outside.medium();
            let sides = if from_inside { [inside, outside] } else { [outside, inside] };
            MediumTransition {
                passed: volume.filter(|_| from_inside).map_or(around, |volume| outside.with(volume)).medium(),
                sides: sides.map(|side| self.id(side)),
                from_inside,
                is_hidden: medium.zip(closed).is_some_and(|(medium, volume)| medium <= volume),
                ior_around: medium.map_or(1.0, |medium| volumes.get(medium).ior),
            }
        });
        self.crossings.push((key, crossing));
        self.crossings.len() - 1
    }

    /// A surface by its entry.
    #[inline]
    pub(super) fn crossing(&self, entry: u32) -> &MediumTransition {
        &self.crossings[entry as usize].1
    }

    /// The transmittance over a ray that starts within `media` and ends at a point at a distance.
    #[inline]
    pub(super) fn transmittance(
        &self,
        world: &World,
        media: MediumStackId,
        end: DVec3,
        distance: f64,
    ) -> DVec3 {
        let Some(volumes) = world.volumes.as_ref().filter(|_| media != MediumStackId::EMPTY) else {
            return DVec3::ONE;
        };
        transmittance(world, self.sets[media.0 as usize].around(volumes, end).medium(), distance)
    }
}

/// The indices of the latest of some entries, the last first.
fn latest_indices(count: usize) -> impl Iterator<Item = usize> {
    (count.saturating_sub(SEARCHED)..count).rev()
}

/// The transmittance of a volume over a distance; 1 outside of all.
fn transmittance(world: &World, medium: Option<u32>, distance: f64) -> DVec3 {
    match (&world.volumes, medium) {
        (Some(volumes), Some(medium)) => volumes.get(medium).transmittance(distance),
        _ => DVec3::ONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets have the numbers of the volumes that they were given, also where there are more than a search finds, and the empty one
    /// has one number.
    #[test]
    fn sets_are_found_by_their_numbers() {
        let mut table = MediaTable { sets: vec![MediumStack::EMPTY], ..MediaTable::default() };
        let set = |volume: u32| {
            (0..volume % 3).fold(MediumStack::EMPTY.with(volume), |set, more| set.with(100 + more))
        };
        let ids: Vec<MediumStackId> = (0..60).map(|k| table.id(set(k % 25))).collect();
        for (k, id) in (0..).zip(&ids) {
            assert_eq!(table.sets[id.0 as usize], set(k % 25));
        }
        // The latest are found again; nothing is a set of its own.
        let count = table.sets.len();
        assert_eq!((table.id(set(59 % 25)), table.id(MediumStack::EMPTY)), (ids[59], MediumStackId::EMPTY));
        assert_eq!(table.sets.len(), count);
    }

    /// Volumes come in their order of precedence and leave one at a time; of too many the last are forgotten.
    #[test]
    fn media_are_sorted() {
        let media = [3, 1, 7, 3].into_iter().fold(MediumStack::EMPTY, MediumStack::with);
        assert_eq!(media.0[..5], [1, 3, 3, 7, NONE]);
        assert_eq!(media.without(3).0[..4], [1, 3, 7, NONE]);
        assert_eq!(media.without(2), media);
        assert_eq!(media.without(1).medium(), Some(3));
        assert_eq!(MediumStack::EMPTY.medium(), None);
        let full = (0..20).rev().fold(MediumStack::EMPTY, MediumStack::with);
        assert_eq!(full.0, [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(full.with(9), full);
    }
}
