//! The media that paths run through.

use glam::DVec3;

use crate::bvh::Traversal;
use crate::world::{InteractionSoa, World};

/// The most volumes of which a path knows that they hold its vertex. Beyond, those that enclose most are forgotten; a
/// hit from inside recalls them.
const CAPACITY: usize = 8;

/// No volume.
const NONE: u32 = u32::MAX;

/// The closed volumes that hold a point, in the order of their precedence, those entered several times as often.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Media([u32; CAPACITY]);

impl Media {
    /// Outside of all volumes.
    pub(super) const EMPTY: Media = Media([NONE; CAPACITY]);

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
            return Media::EMPTY;
        }
        if let Some(at) = self.0.iter().position(|&other| other == volume) {
            self.0.copy_within(at + 1.., at);
            self.0[CAPACITY - 1] = NONE;
        }
        self
    }

    /// Those of the volumes that may hold a point. Drops volumes that were left unseen: by a surface that coincides with
    /// another, or that was passed by its opacity.
    pub(super) fn around(self, world: &World, point: DVec3) -> Self {
        let Some(volumes) = world.volumes.as_ref().filter(|_| !self.is_empty()) else { return self };
        let held = || self.0.into_iter().take_while(|&v| v != NONE);
        let may_hold = |v: &u32| volumes.get(*v).may_hold(point);
        if held().all(|v| may_hold(&v)) {
            self
        } else {
            held().filter(may_hold).fold(Media::EMPTY, Media::with)
        }
    }

    /// The transmittance of the medium over a distance.
    pub(super) fn transmittance(self, world: &World, distance: f64) -> DVec3 {
        transmittance(world, self.medium(), distance)
    }

    /// Lists the volumes that hold each of some points, of which consecutive ones may be equal.
    pub(super) fn at_each(world: &World, points: impl Iterator<Item = DVec3>, media: &mut Vec<Media>) {
        let mut traversal = Traversal::default();
        let mut last = (DVec3::NAN, Media::EMPTY);
        media.extend(points.map(|point| {
            if point != last.0 {
                last = (point, Media::at(world, point, &mut traversal));
            }
            last.1
        }));
    }

    /// The volumes that hold a point: those whose nearest surface along a ray is met from inside.
    fn at(world: &World, point: DVec3, traversal: &mut Traversal) -> Self {
        let Some(volumes) = world.volumes.as_ref().filter(|volumes| volumes.may_hold(point)) else {
            return Media::EMPTY;
        };
        // Any direction will do; few edges of models lie in this one.
        let direction = DVec3::new(0.3637, 0.7219, 0.5887).normalize();
        let ray = world.numerics().ray_precision().ray(point, direction, 0.0, f64::INFINITY);
        let mut hits = Vec::new();
        world.accelerator.all_hits(&ray, &mut hits, traversal);
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let (mut media, mut seen) = (Media::EMPTY, Vec::new());
        for hit in hits {
            let object = world.object_of(hit.prim);
            let Some(volume) =
                volumes.of_object(object).filter(|v| volumes.get(*v).is_closed && !seen.contains(v))
            else {
                continue;
            };
            seen.push(volume);
            if world.is_back(object, &hit, ray.at(hit.t), -ray.direction) {
                media = media.with(volume);
            }
        }
        media
    }
}

/// A surface that a path meets, as far as media are concerned.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// The medium that the path came through.
    passed: Option<u32>,
    /// The closed volumes in front of the surface, on the path's side, and behind it.
    pub(super) sides: [Media; 2],
    /// Whether the surface bounds a volume and the path came through that.
    pub(super) from_inside: bool,
    /// Whether a volume that goes before that of the surface is on both sides, so that there is no interface.
    pub(super) is_hidden: bool,
    /// The index of refraction of the medium around the object.
    pub(super) ior_around: f64,
}

impl Crossing {
    /// A surface with no medium on either side.
    pub(super) const NONE: Crossing = Crossing {
        passed: None,
        sides: [Media::EMPTY; 2],
        from_inside: false,
        is_hidden: false,
        ior_around: 1.0,
    };

    /// Surface `i`, which a path from `media` meets.
    pub(super) fn new(world: &World, media: Media, surfaces: &InteractionSoa, i: usize) -> Self {
        let Some(volumes) = &world.volumes else { return Crossing::NONE };
        let own = volumes.of_object(surfaces.objects()[i]);
        if own.is_none() && media.is_empty() {
            return Crossing::NONE;
        }
        let around = media.around(world, surfaces.position.get(i));
        let from_inside = own.is_some() && world.is_seen_from_back(&surfaces.get(i));
        let closed = own.filter(|&own| volumes.get(own).is_closed);
        let outside = closed.filter(|_| from_inside).map_or(around, |own| around.without(own));
        let inside = closed.map_or(outside, |own| outside.with(own));
        let medium = outside.medium();
        Crossing {
            passed: own.filter(|_| from_inside).map_or(around, |own| outside.with(own)).medium(),
            sides: if from_inside { [inside, outside] } else { [outside, inside] },
            from_inside,
            is_hidden: medium.zip(closed).is_some_and(|(medium, own)| medium <= own),
            ior_around: medium.map_or(1.0, |medium| volumes.get(medium).ior),
        }
    }

    /// The transmittance of what the path came through, over a distance.
    pub(super) fn transmittance(&self, world: &World, distance: f64) -> DVec3 {
        transmittance(world, self.passed, distance)
    }
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

    /// Volumes come in their order of precedence and leave one at a time; of too many the last are forgotten.
    #[test]
    fn media_are_sorted() {
        let media = [3, 1, 7, 3].into_iter().fold(Media::EMPTY, Media::with);
        assert_eq!(media.0[..5], [1, 3, 3, 7, NONE]);
        assert_eq!(media.without(3).0[..4], [1, 3, 7, NONE]);
        assert_eq!(media.without(2), media);
        assert_eq!(media.without(1).medium(), Some(3));
        assert_eq!(Media::EMPTY.medium(), None);
        let full = (0..20).rev().fold(Media::EMPTY, Media::with);
        assert_eq!(full.0, [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(full.with(9), full);
    }
}
