//! Statistics of a render: rays, tests, the time of each stage, and the cost of each effect.

use std::time::Duration;

use super::Worker;
use crate::bvh::detail::Tests;
use crate::effects::tile::{PathCount, RayCount, Tile};
use crate::effects::{EFFECTS, EffectId, Plan, RayKind, id};

/// The statistics of a render.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statistics {
    /// The processor time of each stage summed over threads, in the plan's order. Stages with the same name and effect
    /// are merged. Empty unless [`RenderControl::time_stages`](super::RenderControl::time_stages) is set.
    pub stages: Vec<StageTime>,
    /// Rays cast and rays that hit, for each of [`RayKind::all`].
    pub rays: Vec<(RayKind, RayCount)>,
    /// Box and primitive tests.
    pub tests: Tests,
    /// The cost of each of [`EFFECTS`].
    pub effect_costs: Vec<EffectCost>,
    /// The maximum over threads of the bytes of a tile, without those of effects.
    pub base_bytes: usize,
    /// For each object, whether a primary ray has hit it.
    pub visible_objects: Vec<bool>,
    /// Columns and rows of non-finite pixels, without duplicates, in the order of rows.
    pub non_finite: Vec<(u32, u32)>,
    /// The number of samples of light that were left out because they were not finite.
    pub discarded_samples: u64,
    /// The number of pixels that depend on random numbers and whose standard error, by their own samples, is above three
    /// times the level of adaptive sampling.
    pub noisy_pixels: u64,
    /// Paths traced, and those that a limit on bounces cut; 0 without path tracing.
    pub paths: PathCount,
}

/// The processor time of the stages with one name and effect, summed over threads; wall time where a system does not
/// measure it ([`super::HAS_THREAD_TIME`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageTime {
    /// The name of the stage.
    pub name: &'static str,
    /// The effect that needs it; `None` for the stages of every picture. A stage whose rays continue behind transparent
    /// surfaces is listed for alpha, too, with the share of its time that these are of its rays.
    pub effect: Option<EffectId>,
    /// The time.
    pub time: Duration,
}

/// The cost of an effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EffectCost {
    /// The effect.
    pub effect: EffectId,
    /// The number of its stages in the plan.
    pub stages: usize,
    /// The number of rays of its kinds.
    pub rays: u64,
    /// The time of its stages, as of [`StageTime`]; `None` where times are not measured.
    pub time: Option<Duration>,
    /// The maximum over threads of the bytes that a tile holds for it.
    pub bytes: usize,
}

impl Statistics {
    /// Sums the statistics of all threads.
    pub(super) fn gather(plan: &Plan, workers: &[Box<Worker>], time_stages: bool) -> Self {
        let mut non_finite: Vec<(u32, u32)> = workers.iter().flat_map(|w| &w.non_finite).copied().collect();
        sort_pixels(&mut non_finite);
        let mut sum = Statistics {
            stages: if time_stages { stage_times(plan, workers) } else { Vec::new() },
            rays: RayKind::all().map(|kind| (kind, RayCount::default())).collect(),
            tests: Tests::default(),
            effect_costs: Vec::new(),
            base_bytes: workers.iter().map(|worker| worker.tile.bytes()).max().unwrap_or(0),
            visible_objects: Vec::new(),
            non_finite,
            discarded_samples: workers.iter().map(|worker| worker.tile.discarded_samples).sum(),
            noisy_pixels: workers.iter().map(|worker| worker.tile.noisy_pixels).sum(),
            paths: PathCount::default(),
        };
        for Tile { rays, paths, traversal, visible_objects, .. } in workers.iter().map(|worker| &worker.tile)
        {
            for &(kind, count) in rays {
                let Some((_, sum)) = sum.rays.iter_mut().find(|(known, _)| *known == kind) else { continue };
                sum.cast += count.cast;
                sum.hit += count.hit;
            }
            sum.paths += *paths;
            sum.tests += traversal.tests;
            sum.add_visible(visible_objects);
        }
        sum.effect_costs = EFFECTS
            .iter()
            .map(|effect| {
                let own = |owner: Option<EffectId>| owner == Some(effect.id);
                let times = sum.stages.iter().filter(|stage| own(stage.effect)).map(|stage| stage.time);
                EffectCost {
                    effect: effect.id,
                    stages: plan.stages().iter().filter(|stage| own(stage.effect)).count(),
                    rays: effect.rays.iter().map(|&kind| sum.rays(kind).cast).sum(),
                    time: time_stages.then(|| times.sum()),
                    bytes: workers.iter().map(|worker| (effect.bytes)(&worker.tile)).max().unwrap_or(0),
                }
            })
            .collect();
        sum
    }

    fn add_visible(&mut self, objects: &[bool]) {
        self.visible_objects.resize(self.visible_objects.len().max(objects.len()), false);
        self.visible_objects.iter_mut().zip(objects).for_each(|(own, &other)| *own |= other);
    }

    /// Adds the statistics of another part of the same picture, such as other samples of its pixels, whose plan may
    /// have other stages.
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
        self.discarded_samples += other.discarded_samples;
        self.noisy_pixels += other.noisy_pixels;
        self.paths += other.paths;
        for (own, other) in self.effect_costs.iter_mut().zip(&other.effect_costs) {
            own.stages = own.stages.max(other.stages);
            own.rays += other.rays;
            own.time = own.time.zip(other.time).map(|(a, b)| a + b);
            own.bytes = own.bytes.max(other.bytes);
        }
        self.base_bytes = self.base_bytes.max(other.base_bytes);
        self.add_visible(&other.visible_objects);
        if !other.non_finite.is_empty() {
            self.non_finite.extend(&other.non_finite);
            sort_pixels(&mut self.non_finite);
        }
    }

    /// An upper bound of the bytes that the tile of a thread holds.
    pub fn bytes(&self) -> usize {
        self.base_bytes + self.effect_costs.iter().map(|cost| cost.bytes).sum::<usize>()
    }

    /// The count of rays of a kind.
    pub fn rays(&self, kind: RayKind) -> RayCount {
        self.rays.iter().find(|(known, _)| *known == kind).map_or(RayCount::default(), |(_, count)| *count)
    }
}

/// Sorts pixels by rows and removes duplicates.
fn sort_pixels(pixels: &mut Vec<(u32, u32)>) {
    pixels.sort_unstable_by_key(|&(x, y)| (y, x));
    pixels.dedup();
}

/// Adds the times of all threads, stage by stage; stages with the same name and effect are merged.
fn stage_times(plan: &Plan, workers: &[Box<Worker>]) -> Vec<StageTime> {
    let mut times: Vec<StageTime> = Vec::new();
    let mut add = |name, effect, time| match times
        .iter_mut()
        .find(|known| known.name == name && known.effect == effect)
    {
        Some(known) => known.time += time,
        None => times.push(StageTime { name, effect, time }),
    };
    for (index, stage) in plan.stages().iter().enumerate() {
        let all = workers.iter().map(|worker| worker.costs[index]);
        let StageCost { time, rays, continued } = all.fold(StageCost::default(), StageCost::plus);
        let of_alpha = time.mul_f64(continued as f64 / rays.max(1) as f64);
        add(stage.stage.name, stage.effect, time - of_alpha);
        if continued > 0 {
            add(stage.stage.name, Some(id::ALPHA), of_alpha);
        }
    }
    times
}

/// What a stage took on a thread.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StageCost {
    time: Duration,
    /// The rays that it has cast.
    rays: u64,
    /// Those of them that were continued behind transparent surfaces.
    continued: u64,
}

impl StageCost {
    /// Adds a run of the stage; `before` and `after` are the rays of the tile then, as of [`Plan::rays_cast`].
    pub(super) fn add(&mut self, time: Duration, before: [u64; 2], after: [u64; 2]) {
        let [rays, continued] = [0, 1].map(|kind| after[kind] - before[kind]);
        *self = self.plus(StageCost { time, rays, continued });
    }

    fn plus(self, other: Self) -> Self {
        StageCost {
            time: self.time + other.time,
            rays: self.rays + other.rays,
            continued: self.continued + other.continued,
        }
    }
}

/// A number in decimal digits, with `separator` between groups of three.
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

    fn of_pixels(pixels: &[(u32, u32)]) -> Statistics {
        Statistics {
            stages: Vec::new(),
            rays: Vec::new(),
            tests: Tests::default(),
            effect_costs: Vec::new(),
            base_bytes: 0,
            visible_objects: Vec::new(),
            non_finite: pixels.to_vec(),
            discarded_samples: 0,
            noisy_pixels: 0,
            paths: PathCount::default(),
        }
    }

    #[test]
    fn pixels_that_are_not_finite_in_any_part_are_counted_once() {
        // The union of {(1, 0), (5, 2)} and {(0, 1), (1, 0)}, by rows.
        let parts = [&[(1, 0), (5, 2)][..], &[(0, 1), (1, 0)], &[]];
        let mut sum = of_pixels(&[]);
        parts.iter().for_each(|part| sum.add(&of_pixels(part)));
        assert_eq!(sum.non_finite, [(1, 0), (0, 1), (5, 2)]);
    }

    #[test]
    fn every_three_digits_are_apart() {
        let counts = [0, 999, 1000, 1_048_576].map(|number| grouped(number, ' '));
        assert_eq!(counts, ["0", "999", "1 000", "1 048 576"]);
    }
}
