//! What a render did: rays, tests, the time of each stage, and what each effect was billed for.

use std::time::Duration;

use super::Worker;
use crate::bvh::Tests;
use crate::effects::tile::RayCount;
use crate::effects::{EFFECTS, Plan, RayKind};

/// What a render did.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    /// Thread time of each stage, in the plan's order, stages of one name and one effect added up; empty where the clock
    /// stood.
    pub stages: Vec<StageTime>,
    /// Rays cast and rays that hit, of each of [`RayKind::all`].
    pub rays: Vec<(RayKind, RayCount)>,
    /// Boxes and primitives tested.
    pub tests: Tests,
    /// What each of [`EFFECTS`] took.
    pub bills: Vec<Bill>,
    /// Bytes that the tile of a thread holds at most for what every picture takes.
    pub base_bytes: usize,
    /// For each object, whether a primary ray has seen it.
    pub seen: Vec<bool>,
    /// Pixels that are not a number or infinite: how many, and columns and rows of the first ten of them.
    pub non_finite: (usize, Vec<(u32, u32)>),
}

/// Thread time spent in the stages of one name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageTime {
    /// The stage.
    pub name: &'static str,
    /// The effect that it is there for; `None` for what every picture takes.
    pub effect: Option<&'static str>,
    /// The time.
    pub time: Duration,
}

/// What an effect took.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bill {
    /// The effect.
    pub effect: &'static str,
    /// Its stages in the plan.
    pub stages: usize,
    /// Rays of its kinds.
    pub rays: u64,
    /// Thread time of its stages; `None` where the clock stood.
    pub time: Option<Duration>,
    /// Bytes that the tile of a thread holds for it at most.
    pub bytes: usize,
}

impl Statistics {
    pub(super) fn gather(plan: &Plan, workers: &[Box<Worker>], time_stages: bool) -> Self {
        let count = |kind| (kind, RayCount::default());
        let mut sum = Statistics {
            stages: Vec::new(),
            rays: RayKind::all().map(count).collect(),
            tests: Tests::default(),
            bills: Vec::new(),
            base_bytes: workers.iter().map(|worker| worker.tile.bytes()).max().unwrap_or(0),
            seen: Vec::new(),
            non_finite: Default::default(),
        };
        let timed = if time_stages { plan.steps() } else { &[] };
        for (index, step) in timed.iter().enumerate() {
            let time = workers.iter().map(|worker| worker.times[index]).sum();
            let (name, effect) = (step.stage.name(), step.effect);
            match sum.stages.iter_mut().find(|s| s.name == name && s.effect == effect) {
                Some(same) => same.time += time,
                None => sum.stages.push(StageTime { name, effect, time }),
            }
        }
        let mut non_finite: Vec<(u32, u32)> = workers.iter().flat_map(|w| &w.non_finite).copied().collect();
        non_finite.sort_unstable_by_key(|&(x, y)| (y, x));
        sum.non_finite = (non_finite.len(), non_finite.into_iter().take(10).collect());
        for worker in workers {
            let tile = &worker.tile;
            for &(kind, count) in &tile.rays {
                let Some((_, sum)) = sum.rays.iter_mut().find(|(known, _)| *known == kind) else { continue };
                sum.cast += count.cast;
                sum.hit += count.hit;
            }
            sum.tests += tile.traversal.tests;
            sum.seen.resize(sum.seen.len().max(tile.seen.len()), false);
            sum.seen.iter_mut().zip(&tile.seen).for_each(|(sum, &seen)| *sum |= seen);
        }
        sum.bills = EFFECTS
            .iter()
            .map(|effect| {
                let own = |owner: Option<&'static str>| owner == Some(effect.name);
                let times = sum.stages.iter().filter(|stage| own(stage.effect)).map(|stage| stage.time);
                Bill {
                    effect: effect.name,
                    stages: plan.steps().iter().filter(|step| own(step.effect)).count(),
                    rays: effect.rays.iter().map(|&kind| sum.rays(kind).cast).sum(),
                    time: (time_stages).then(|| times.sum()),
                    bytes: workers.iter().map(|worker| (effect.bytes)(&worker.tile)).max().unwrap_or(0),
                }
            })
            .collect();
        sum
    }

    /// Takes in another part of the same picture: as of other samples of the same pixels, by a plan that may have other stages.
    pub fn add(&mut self, other: &Statistics) {
        for stage in &other.stages {
            match self.stages.iter_mut().find(|own| own.name == stage.name && own.effect == stage.effect) {
                Some(own) => own.time += stage.time,
                None => self.stages.push(stage.clone()),
            }
        }
        for ((_, own), (_, other)) in self.rays.iter_mut().zip(&other.rays) {
            own.cast += other.cast;
            own.hit += other.hit;
        }
        self.tests += other.tests;
        for (own, other) in self.bills.iter_mut().zip(&other.bills) {
            own.stages = own.stages.max(other.stages);
            own.rays += other.rays;
            own.time = own.time.zip(other.time).map(|(a, b)| a + b);
            own.bytes = own.bytes.max(other.bytes);
        }
        self.base_bytes = self.base_bytes.max(other.base_bytes);
        self.seen.resize(self.seen.len().max(other.seen.len()), false);
        self.seen.iter_mut().zip(&other.seen).for_each(|(own, &other)| *own |= other);
        if other.non_finite.0 > self.non_finite.0 {
            self.non_finite = other.non_finite.clone();
        }
    }

    /// Bytes that the tile of a thread holds at most.
    pub fn bytes(&self) -> usize {
        self.base_bytes + self.bills.iter().map(|bill| bill.bytes).sum::<usize>()
    }

    /// Rays of a kind.
    pub fn rays(&self, kind: RayKind) -> RayCount {
        self.rays.iter().find(|(known, _)| *known == kind).map_or(RayCount::default(), |(_, count)| *count)
    }
}

/// A count in decimal digits, with `separator` between every three.
pub fn grouped(number: u64, separator: char) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(separator);
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_three_digits_are_apart() {
        let counts = [0, 999, 1000, 1_048_576].map(|number| grouped(number, ' '));
        assert_eq!(counts, ["0", "999", "1 000", "1 048 576"]);
    }
}
