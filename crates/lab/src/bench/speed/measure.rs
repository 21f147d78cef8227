//! Timing rounds with all engines interleaved.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::super::{Built, Engine, Facts, Label, Mesh, RayQueue, own};
use super::{Kind, RaySets, ReferenceHits, rays};
use crate::timing::{Clock, Quartiles};
use kiln::bvh::detail::{Layout, Tests};
use kiln::bvh::{Numerics, Preset, Ray};
use kiln::error::{Error, Result};
use kiln::limits;
use kiln::render::RenderControl;

/// Rays per parallel task, a multiple of the batch size.
const PORTION: usize = 64 * rays::BATCH;

/// Parallel tasks of an engine and thread until it is the next engine's turn: other load on a machine changes within
/// seconds, and falls on all engines alike if turns take some milliseconds.
const PORTIONS_PER_TURN: usize = 4;

/// Settings of a measurement.
pub struct Settings<'a> {
    /// Timed rounds, after one to warm up; 1 or more.
    pub runs: u32,
    /// Threads for building and tracing.
    pub pool: &'a rayon::ThreadPool,
    /// Whether hits are compared with the reference.
    pub check: bool,
}

impl Settings<'_> {
    fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }
}

/// Results of an engine.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedRow {
    /// The engine.
    pub label: Label,
    /// Number of threads.
    pub threads: usize,
    /// Build time in ms.
    pub build_ms: Quartiles,
    /// Properties of the structure.
    pub facts: Facts,
    /// Number of triangles of the mesh.
    pub triangles: usize,
    /// Number of rays of each kind of [`Kind::ALL`].
    pub rays: [usize; 4],
    /// Million rays per second of each kind in every round; empty if there are no rays.
    pub rates: [Vec<f64>; 4],
    /// Intersection tests of all rays of a kind, if counted.
    pub tests: [Option<Tests>; 4],
    /// Wrong hits of each kind; `None` if not compared.
    pub wrong: Option<[u64; 4]>,
    /// Peak memory of building in bytes, including the structure, where the system provides it.
    pub build_peak_bytes: Option<u64>,
}

impl SpeedRow {
    /// Wrong hits of all kinds.
    pub fn all_wrong(&self) -> Option<u64> {
        self.wrong.map(|wrong| wrong.iter().sum())
    }

    /// Million rays per second; `None` if there are no rays of the kind.
    pub fn mrays_per_s(&self, kind: Kind) -> Option<Quartiles> {
        Quartiles::of(&self.rates[kind as usize])
    }

    /// Throughput relative to another row, round by round.
    pub fn ratio(&self, other: &SpeedRow, kind: Kind) -> Option<Quartiles> {
        let rounds = self.rates[kind as usize].iter().zip(&other.rates[kind as usize]);
        Quartiles::of(&rounds.map(|(own, other)| own / other).collect::<Vec<_>>())
    }

    /// Average number of box and primitive tests per ray of a kind.
    pub fn tests_per_ray(&self, kind: Kind) -> Option<[f64; 2]> {
        let Tests { nodes, primitives, .. } = self.tests[kind as usize]?;
        let rays = self.rays[kind as usize];
        (rays > 0).then(|| [nodes, primitives].map(|count| count as f64 / rays as f64))
    }

    /// Bytes of the structure per triangle of the mesh, including the triangles.
    pub fn bytes_per_triangle(&self) -> Option<f64> {
        Some(self.facts.bytes? as f64 / self.triangles as f64)
    }
}

/// The fastest of `rows` of a library for a kind of rays; for kiln, among those in the default tier.
pub fn best<'a>(
    rows: impl IntoIterator<Item = &'a SpeedRow>,
    engine: &str,
    kind: Kind,
) -> Option<&'a SpeedRow> {
    let median = |row: &SpeedRow| row.mrays_per_s(kind).map_or(0.0, |spread| spread.median);
    let default = Some(Numerics::default().name());
    let of_engine = rows
        .into_iter()
        .filter(|row| row.label.engine == engine && (engine != "kiln" || row.label.tier == default));
    of_engine.max_by(|a, b| median(a).total_cmp(&median(b)))
}

/// Measurements of an engine.
struct Measurement<'a> {
    engine: &'a Engine,
    ready: Box<dyn Built>,
    build_ms: Vec<f64>,
    seconds: [Vec<f64>; 4],
    tests: [Option<Tests>; 4],
    wrong: Option<[u64; 4]>,
    peak: Option<u64>,
}

/// Measures every engine.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled; [`Error::Failed`] if a library cannot build.
pub fn measure(
    engines: &[Engine],
    mesh: &Mesh,
    ray_sets: &RaySets,
    settings: &Settings,
    control: &RenderControl,
) -> Result<Vec<SpeedRow>> {
    let structure = Layout::Portable(Preset::default());
    let exact = settings.check.then(|| own::accelerator(mesh, structure, Numerics::Exact));
    let reference = exact
        .as_deref()
        .map(|exact| Kind::ALL.map(|kind| ReferenceHits::new(exact, ray_sets.of(kind), kind.is_any_hit())));
    let rounds = settings.runs as usize + 1;
    let steps = engines.len() * rounds * (1 + Kind::ALL.len());
    let mut done = 0;
    let mut step = || {
        done += 1;
        (control.progress)(done, steps);
        if control.cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    };
    let mut measurements = Vec::with_capacity(engines.len());
    for round in 0..rounds {
        for index in 0..engines.len() {
            let place = (index + round) % engines.len();
            if round == 0 {
                measurements.push(Measurement::start(&engines[place], mesh, settings)?);
            } else {
                measurements[place].build(mesh, settings)?;
            }
            step()?;
        }
        for kind in Kind::ALL {
            let rays = ray_sets.of(kind);
            if round == 0 {
                let reference = reference.as_ref().map(|reference| &reference[kind as usize]);
                for measurement in &mut measurements {
                    measurement.warm_up(kind, rays, reference, settings);
                    step()?;
                }
                continue;
            }
            let mut seconds = vec![0.0; measurements.len()];
            let turns = rays.chunks(PORTIONS_PER_TURN * PORTION * settings.threads());
            for (turn, rays) in turns.enumerate() {
                for index in 0..measurements.len() {
                    let place = (index + round + turn) % measurements.len();
                    seconds[place] += measurements[place].time(kind, rays, settings);
                }
            }
            for (measurement, seconds) in measurements.iter_mut().zip(seconds) {
                measurement.seconds[kind as usize].push(seconds);
                step()?;
            }
        }
    }
    Ok(measurements.iter().map(|lane| lane.row(mesh, ray_sets, settings)).collect())
}

fn build(engine: &Engine, mesh: &Mesh, settings: &Settings) -> Result<(Box<dyn Built>, f64)> {
    settings.pool.install(|| {
        let clock = Clock::start(settings.threads());
        let ready = engine.build(mesh)?;
        Ok((ready, clock.seconds() * 1e3))
    })
}

impl<'a> Measurement<'a> {
    /// Builds once to warm up, untimed, and measures the peak memory.
    fn start(engine: &'a Engine, mesh: &Mesh, settings: &Settings) -> Result<Self> {
        limits::reset_peak_memory();
        let before = limits::resident_memory();
        let (ready, _) = build(engine, mesh, settings)?;
        let peak = limits::peak_memory().zip(before).map(|(peak, before)| peak.saturating_sub(before));
        let (build_ms, seconds) = (Vec::new(), Default::default());
        Ok(Measurement { engine, ready, build_ms, seconds, tests: [None; 4], wrong: None, peak })
    }

    fn build(&mut self, mesh: &Mesh, settings: &Settings) -> Result<()> {
        let (ready, ms) = build(self.engine, mesh, settings)?;
        self.ready = ready;
        self.build_ms.push(ms);
        Ok(())
    }

    /// Traces rays; returns the finished queues and the time in seconds.
    fn trace<'q>(
        &'q self,
        rays: &'q [Ray],
        kind: Kind,
        settings: &Settings,
    ) -> (Vec<Box<dyn RayQueue + 'q>>, f64) {
        let mut queues: Vec<_> = rays.chunks(PORTION).map(|rays| self.ready.queue(kind, rays)).collect();
        let seconds = settings.pool.install(|| {
            let clock = Clock::start(settings.threads());
            queues.par_iter_mut().for_each(|queue| queue.run());
            clock.seconds()
        });
        (queues, seconds)
    }

    /// The time of rays in seconds. Some of them are traced before, untimed, as the caches hold other engines' structures.
    fn time(&self, kind: Kind, rays: &[Ray], settings: &Settings) -> f64 {
        let first = rays.len().min(PORTION);
        drop(self.trace(&rays[..first], kind, settings));
        self.trace(rays, kind, settings).1
    }

    /// The untimed round. Hits and numbers of tests are taken from it, as they are the same in all rounds.
    fn warm_up(&mut self, kind: Kind, rays: &[Ray], reference: Option<&ReferenceHits>, settings: &Settings) {
        let (queues, _) = self.trace(rays, kind, settings);
        let counted: Option<Vec<Tests>> = queues.iter().map(|queue| queue.tests()).collect();
        let wrong = reference.map(|reference| {
            let hits: Vec<Option<u32>> = queues.iter().flat_map(|queue| queue.hits()).collect();
            reference.wrong(&hits)
        });
        drop(queues);
        self.tests[kind as usize] = counted.map(|counted| {
            let mut sum = Tests::default();
            counted.into_iter().for_each(|tests| sum += tests);
            sum
        });
        if let Some(wrong) = wrong {
            self.wrong.get_or_insert_default()[kind as usize] = wrong;
        }
    }

    fn row(&self, mesh: &Mesh, ray_sets: &RaySets, settings: &Settings) -> SpeedRow {
        let rays = Kind::ALL.map(|kind| ray_sets.of(kind).len());
        let rate = |kind: Kind| {
            let rays = rays[kind as usize];
            let seconds = self.seconds[kind as usize].iter().filter(|_| rays > 0);
            seconds.map(|seconds| rays as f64 / seconds / 1e6).collect()
        };
        SpeedRow {
            label: self.engine.label.clone(),
            threads: settings.threads(),
            build_ms: Quartiles::of(&self.build_ms).unwrap_or(Quartiles::exact(0.0)),
            facts: self.ready.facts(),
            triangles: mesh.triangles.len(),
            rays,
            rates: Kind::ALL.map(rate),
            tests: self.tests,
            wrong: self.wrong,
            build_peak_bytes: self.peak,
        }
    }
}
