//! Rounds in which all contenders take turns.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::super::{Clock, Mesh, Spread};
use super::{Contender, Facts, Kind, Label, Questions, Queue, Ready, Truth, rays};
use crate::bvh::Tests;
use crate::error::{Error, Result};
use crate::geometry::Ray;
use crate::render::Watch;

/// Rays that one thread takes at a time: whole batches, few enough to share, enough that it costs nothing.
const PORTION: usize = 64 * rays::BATCH;

/// How to measure.
pub struct Settings<'a> {
    /// Rounds that count, after one to warm up; at least 1.
    pub runs: u32,
    /// The threads to build and to ask on.
    pub pool: &'a rayon::ThreadPool,
}

impl Settings<'_> {
    fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }
}

/// What was measured of a contender.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Which.
    pub label: Label,
    /// Threads that built and asked.
    pub threads: usize,
    /// Milliseconds from triangles in memory to ready.
    pub build_ms: Spread,
    /// What the structure is like.
    pub facts: Facts,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Rays of each kind of [`Kind::ALL`].
    pub rays: [usize; 4],
    /// Million rays a second, of each kind; `None` where there are no rays.
    pub mrays_per_s: [Option<Spread>; 4],
    /// Tests that all rays of a kind took, where they are counted.
    pub tests: [Option<Tests>; 4],
    /// Answers that are wrong, of each kind.
    pub wrong: [u64; 4],
}

/// What is being measured of a contender.
struct Lane<'a> {
    contender: &'a dyn Contender,
    ready: Box<dyn Ready>,
    build_ms: Vec<f64>,
    seconds: [Vec<f64>; 4],
    tests: [Option<Tests>; 4],
    wrong: [u64; 4],
}

/// Measures every contender.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled; [`Error::Failed`] where a library could not build.
pub fn measure(
    contenders: &[Box<dyn Contender>],
    mesh: &Mesh,
    questions: &Questions,
    settings: &Settings,
    watch: &Watch,
) -> Result<Vec<Row>> {
    let truth = Truth::new(mesh, questions);
    let rounds = settings.runs as usize + 1;
    let steps = contenders.len() * rounds * (1 + Kind::ALL.len());
    let mut done = 0;
    let mut step = || {
        done += 1;
        (watch.progress)(done, steps);
        if watch.cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    };
    let mut lanes = Vec::with_capacity(contenders.len());
    for round in 0..rounds {
        for index in 0..contenders.len() {
            let place = (index + round) % contenders.len();
            if round == 0 {
                lanes.push(Lane::start(&*contenders[place], mesh, settings)?);
            } else {
                lanes[place].build(mesh, settings)?;
            }
            step()?;
        }
        for kind in Kind::ALL {
            for index in 0..lanes.len() {
                let place = (index + round) % lanes.len();
                lanes[place].ask(kind, questions.of(kind), (round == 0).then_some(&truth), settings);
                step()?;
            }
        }
    }
    Ok(lanes.iter().map(|lane| lane.row(mesh, questions, settings)).collect())
}

fn build(contender: &dyn Contender, mesh: &Mesh, settings: &Settings) -> Result<(Box<dyn Ready>, f64)> {
    settings.pool.install(|| {
        let clock = Clock::start(settings.threads());
        let ready = contender.build(mesh)?;
        Ok((ready, clock.seconds() * 1e3))
    })
}

impl<'a> Lane<'a> {
    /// The build that warms up is not counted.
    fn start(contender: &'a dyn Contender, mesh: &Mesh, settings: &Settings) -> Result<Self> {
        let (ready, _) = build(contender, mesh, settings)?;
        let (build_ms, seconds) = (Vec::new(), Default::default());
        Ok(Lane { contender, ready, build_ms, seconds, tests: [None; 4], wrong: [0; 4] })
    }

    fn build(&mut self, mesh: &Mesh, settings: &Settings) -> Result<()> {
        let (ready, ms) = build(self.contender, mesh, settings)?;
        self.ready = ready;
        self.build_ms.push(ms);
        Ok(())
    }

    /// Where `truth` is given the answers are compared with it, and otherwise the time counts.
    fn ask(&mut self, kind: Kind, rays: &[Ray], truth: Option<&Truth>, settings: &Settings) {
        let mut queues: Vec<Box<dyn Queue + '_>> =
            rays.chunks(PORTION).map(|rays| self.ready.queue(kind, rays)).collect();
        let seconds = settings.pool.install(|| {
            let clock = Clock::start(settings.threads());
            queues.par_iter_mut().for_each(|queue| queue.run());
            clock.seconds()
        });
        let Some(truth) = truth else {
            self.seconds[kind as usize].push(seconds);
            return;
        };
        let answers: Vec<Option<u32>> = queues.iter().flat_map(|queue| queue.answers()).collect();
        self.wrong[kind as usize] = truth.wrong(kind, &answers);
        let counted: Option<Vec<Tests>> = queues.iter().map(|queue| queue.tests()).collect();
        self.tests[kind as usize] = counted.map(|counted| {
            let mut sum = Tests::default();
            counted.into_iter().for_each(|tests| sum += tests);
            sum
        });
    }

    fn row(&self, mesh: &Mesh, questions: &Questions, settings: &Settings) -> Row {
        let rays = Kind::ALL.map(|kind| questions.of(kind).len());
        let rate = |kind: Kind| {
            let rays = rays[kind as usize];
            let rates: Vec<f64> =
                self.seconds[kind as usize].iter().map(|seconds| rays as f64 / seconds / 1e6).collect();
            Spread::of(&rates).filter(|_| rays > 0)
        };
        let nothing = Spread { lower: 0.0, median: 0.0, upper: 0.0 };
        Row {
            label: self.contender.label(),
            threads: settings.threads(),
            build_ms: Spread::of(&self.build_ms).unwrap_or(nothing),
            facts: self.ready.facts(),
            triangles: mesh.triangles.len(),
            rays,
            mrays_per_s: Kind::ALL.map(rate),
            tests: self.tests,
            wrong: self.wrong,
        }
    }
}
