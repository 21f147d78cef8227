//! Cost of each effect of a picture, from renders with and without it in every round.
//!
//! There are two figures. *Cumulative*: effects are added in the order of the plan; the cost of an effect is its
//! difference to the picture with all previous effects, so that the costs sum up to the whole. *Alone*: the time that
//! the whole picture saves without this effect. They differ if effects interact: a mirrored surface needs shadow rays,
//! too.

use std::time::{Duration, Instant};

use crate::timing::{Clock, Quartiles};
use kiln::effects::{EffectId, Plan};
use kiln::error::Result;
use kiln::film::Film;
use kiln::job::RenderJob;
use kiln::render::{RenderControl, Statistics, render};

/// Cost of a picture.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Number of rays of all kinds.
    pub rays: i64,
    /// Time in ms.
    pub ms: Quartiles,
    /// Size of a thread's tile buffers in bytes.
    pub bytes: i64,
}

/// Cost of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The effect.
    pub effect: EffectId,
    /// Cost added to the picture with all previous effects of the plan.
    pub adds: Cost,
    /// Time in ms that the whole picture saves without it.
    pub alone: Quartiles,
}

/// Costs of a picture and its effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Costs {
    /// The whole picture.
    pub whole: Cost,
    /// The picture without any effect.
    pub base: Cost,
    /// Effects that are on, in the order of the plan.
    pub parts: Vec<Part>,
    /// Number of rounds.
    pub rounds: usize,
    /// Clock: `processor` or `wall`.
    pub clock: &'static str,
    /// Number of threads.
    pub threads: usize,
}

impl Costs {
    /// Sum of the base and all effects in ms.
    pub fn sum_ms(&self) -> f64 {
        self.base.ms.median + self.parts.iter().map(|part| part.adds.ms.median).sum::<f64>()
    }
}

/// Rounds of measurement, and the least of them where they take longer than [`LONG`].
const ROUNDS: usize = 9;
const LEAST_ROUNDS: usize = 3;
const LONG: Duration = Duration::from_secs(20);

/// Measures a picture on the current pool, `rounds` times; 9 or fewer by default. Progress is counted in renders.
///
/// # Errors
/// Those of [`render`].
pub fn measure(job: &RenderJob, rounds: Option<usize>, control: &RenderControl) -> Result<Costs> {
    let RenderJob { world, view, window, plan, .. } = job;
    let on: Vec<usize> = (0..plan.decisions.len()).filter(|&i| plan.decisions[i].on).collect();
    // Plans with the first k effects for every k, then the whole plan without each effect.
    let firsts = (0..=on.len()).map(|k| plan.keeping(world, |i| on[..k].contains(&i)));
    let withouts = on.iter().map(|&one| plan.keeping(world, |i| i != one));
    let plans: Vec<Plan> = firsts.chain(withouts).collect();
    let threads = rayon::current_num_threads();

    let mut ms: Vec<Vec<f64>> = vec![Vec::new(); plans.len()];
    let mut statistics: Vec<Option<Statistics>> = vec![None; plans.len()];
    let (most, start) = (rounds.unwrap_or(ROUNDS), Instant::now());
    let single = RenderControl { cancel: control.cancel, ..RenderControl::default() };
    for round in 0..=most {
        if rounds.is_none() && round > LEAST_ROUNDS && start.elapsed() > LONG {
            break;
        }
        // Rounds are rotated, as a render may affect the time of the next one.
        for turn in 0..plans.len() {
            let index = (round + turn) % plans.len();
            let clock = Clock::start(threads);
            let made: Result<(Film<[u8; 3]>, Statistics)> =
                render(world, view, &plans[index], *window, |_, _| true, &single);
            let seconds = clock.seconds();
            statistics[index] = Some(made?.1);
            // Round 0 is the warm-up.
            if round > 0 {
                ms[index].push(seconds * 1e3);
            }
            (control.progress)(plans.len() * round + turn + 1, plans.len() * (most + 1));
        }
    }
    let of = |a: usize, b: Option<usize>| -> Cost {
        let total = |index: usize| {
            statistics[index].as_ref().map_or((0, 0), |s| {
                let rays: u64 = s.rays.iter().map(|(_, count)| count.cast).sum();
                (rays as i64, s.bytes() as i64)
            })
        };
        let (more, less) = (total(a), b.map_or((0, 0), total));
        let paired = ms[a].iter().enumerate().map(|(round, ms_a)| ms_a - b.map_or(0.0, |b| ms[b][round]));
        Cost { rays: more.0 - less.0, ms: spread(paired), bytes: more.1 - less.1 }
    };
    let part = |(k, &index): (usize, &usize)| Part {
        effect: plan.decisions[index].effect,
        adds: of(k + 1, Some(k)),
        alone: of(on.len(), Some(on.len() + 1 + k)).ms,
    };
    Ok(Costs {
        whole: of(on.len(), None),
        base: of(0, None),
        parts: on.iter().enumerate().map(part).collect(),
        rounds: ms[0].len(),
        clock: Clock::name(threads),
        threads,
    })
}

fn spread(measurements: impl Iterator<Item = f64>) -> Quartiles {
    let measurements: Vec<f64> = measurements.collect();
    Quartiles::of(&measurements).unwrap_or(Quartiles::exact(0.0))
}
