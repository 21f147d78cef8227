//! What a render did: rays, tests, and the time of each stage.

use std::time::Duration;

use super::{Clock, Worker};
use crate::bvh::Tests;
use crate::effects::tile::RayCount;
use crate::effects::{Plan, RayKind};

/// What a render did.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    /// Thread time of each stage, in the plan's order, stages of one name added up; empty where the clock stood.
    pub stages: Vec<StageTime>,
    /// Rays cast and rays that hit, for each of [`RayKind::ALL`].
    pub rays: [RayCount; RayKind::ALL.len()],
    /// Boxes and primitives tested.
    pub tests: Tests,
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
    /// The time.
    pub time: Duration,
}

impl Statistics {
    pub(super) fn gather(plan: &Plan, workers: &[Box<Worker>], clock: Clock) -> Self {
        let mut sum = Statistics {
            stages: Vec::new(),
            rays: Default::default(),
            tests: Tests::default(),
            seen: Vec::new(),
            non_finite: Default::default(),
        };
        let timed = if clock == Clock::EveryStage { plan.stages() } else { &[] };
        for (index, stage) in timed.iter().enumerate() {
            let time = workers.iter().map(|worker| worker.times[index]).sum();
            match sum.stages.iter_mut().find(|s| s.name == stage.name()) {
                Some(same) => same.time += time,
                None => sum.stages.push(StageTime { name: stage.name(), time }),
            }
        }
        let mut non_finite: Vec<(u32, u32)> = workers.iter().flat_map(|w| &w.non_finite).copied().collect();
        non_finite.sort_unstable_by_key(|&(x, y)| (y, x));
        sum.non_finite = (non_finite.len(), non_finite.into_iter().take(10).collect());
        for worker in workers {
            let tile = &worker.tile;
            for (sum, count) in sum.rays.iter_mut().zip(&tile.rays) {
                sum.cast += count.cast;
                sum.hit += count.hit;
            }
            sum.tests += tile.traversal.tests;
            sum.seen.resize(sum.seen.len().max(tile.seen.len()), false);
            sum.seen.iter_mut().zip(&tile.seen).for_each(|(sum, &seen)| *sum |= seen);
        }
        sum
    }

    /// Rays of a kind.
    pub fn rays(&self, kind: RayKind) -> RayCount {
        self.rays[kind as usize]
    }
}
