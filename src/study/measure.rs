//! The study itself: references, errors, then rounds of timing in which all settings take turns.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::ThreadPool;

use super::data::{Geometry, Quartiles, Row, SCHEMA, Study, Told};
use super::errors::PictureErrors;
use super::metrics::Picture;
use super::pictures::{Against, Pictures, Shown, png};
use super::reference::{Limit, halves};
use super::setting::{Setting, WorldKey};
use super::sweep::{Candidate, sweep};
use super::{advice, geometry, leaks, machine, steps};
use crate::bench::Clock;
use crate::effects::{Choices, Plan, RayKind};
use crate::error::{Error, Result};
use crate::film::{Film, FilterShape, Pixel, TILE, Window};
use crate::geometry::Numerics;
use crate::render::{self, Statistics, Watch, render_as};
use crate::scene::{Camera, Projection, Scene};
use crate::world::{View, World};

/// What is studied.
pub struct Subject {
    /// What to call it.
    pub name: String,
    /// The command that asked for it.
    pub command: String,
    /// The scene, with its lights.
    pub scene: Scene,
    /// Where it is seen from.
    pub camera: Camera,
    /// How.
    pub projection: Projection,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// The part of it that is rendered.
    pub window: Window,
    /// What is asked of effects.
    pub choices: Choices,
    /// How the picture is asked for.
    pub base: Setting,
    /// What made it, as names and values.
    pub settings: Vec<(String, String)>,
}

/// How thorough a study is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// How often everything is timed, after a round to warm up.
    pub rounds: u32,
    /// The most samples a pixel that are looked at.
    pub most_samples: u32,
    /// Samples a pixel of each half of a reference.
    pub reference_samples: u32,
    /// Rays across the longer side of the picture that geometry is compared by.
    pub rays_across: u32,
    /// Rays that are cast at closed meshes in each tier.
    pub leak_rays: u64,
}

impl Options {
    /// Samples a pixel of each half of a limit. The first is the base's; those of other filters are held against half of the most
    /// samples at most, so half are enough.
    fn samples_of_limit(&self, index: usize) -> u32 {
        if index == 0 { self.reference_samples } else { self.reference_samples.div_ceil(2) }
    }
}

/// Where the work is done.
pub struct Pools<'a> {
    /// What is timed.
    pub timed: &'a ThreadPool,
    /// Everything else.
    pub wide: &'a ThreadPool,
}

/// A setting that is measured; candidates with equal settings share one.
struct Cell {
    setting: Setting,
    build_ms: Vec<f64>,
    trace_ms: Vec<f64>,
    seen: Option<Seen>,
}

/// What the first picture of a setting showed.
struct Seen {
    statistics: Statistics,
    structure_bytes: usize,
    layout: &'static str,
    limit: Option<PictureErrors>,
    told: Told,
    twin: Option<PictureErrors>,
    fingerprint: String,
    shown: Shown,
}

/// Studies `subject`. `load` reads the inputs again, to be timed, where they can be.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, and those of rendering.
pub fn study(
    subject: &Subject,
    options: &Options,
    load: Option<&(dyn Fn() -> Result<()> + Sync)>,
    pools: &Pools,
    watch: &Watch,
) -> Result<(Study, Pictures)> {
    let view = View::new(&subject.camera, subject.projection, subject.size)?;
    let (candidates, left_out, machine) = pools.wide.install(|| {
        let world = prepare(subject, &subject.base);
        let plan = Plan::new(&world, &subject.base.choices(&subject.choices))?;
        let (candidates, left_out) = sweep(&subject.scene, &subject.base, &plan, options.most_samples);
        Ok::<_, Error>((candidates, left_out, machine::machine(&*world.accelerator)))
    })?;
    let mut cells: Vec<Cell> = Vec::new();
    for Candidate { setting, .. } in &candidates {
        if !cells.iter().any(|cell| cell.setting == *setting) {
            let setting = setting.clone();
            cells.push(Cell { setting, build_ms: Vec::new(), trace_ms: Vec::new(), seen: None });
        }
    }
    let filters = filters(&cells);
    let work = Work { subject, options, view: &view, meter: Meter::new(watch) };
    work.meter.expect(&work, &cells, filters.len());

    let (limits, twins, geometry) = pools.wide.install(|| {
        let geometry = work.geometry(watch)?;
        let limits = work.limits(&filters)?;
        Ok::<_, Error>((limits, work.twins(&cells)?, geometry))
    })?;
    pools.wide.install(|| work.look(&mut cells, &limits, &twins))?;
    let load_ms = pools.timed.install(|| work.time(&mut cells, load))?;

    let threads = pools.timed.current_num_threads();
    let rows = rows(&candidates, &cells, &subject.base, pixels(subject.window));
    let pairs = |pairs: &[(String, String)]| pairs.iter().map(|(a, b)| [a.clone(), b.clone()]).collect();
    let base_limit = limits.iter().find(|limit| limit.filter == subject.base.sampling.shape_and_radius());
    let study = Study {
        schema: SCHEMA,
        kiln: env!("CARGO_PKG_VERSION").into(),
        subject: subject.name.clone(),
        command: subject.command.clone(),
        machine,
        settings: pairs(&subject.settings),
        size: [subject.window.width, subject.window.height],
        rounds: options.rounds,
        threads,
        clock: Clock::name(threads).into(),
        load_ms,
        floors: limits.iter().map(|limit| limit.floor.clone()).collect(),
        geometry,
        left_out: left_out.into_iter().map(|(knob, why)| [knob.to_owned(), why]).collect(),
        advice: advice(&rows),
        steps: steps(&rows),
        rows,
    };
    let shown = candidates.iter().map(|candidate| {
        let cell = cells.iter().position(|cell| cell.setting == candidate.setting)?;
        Some((cell, candidate.judge))
    });
    let pictures = Pictures::new(
        base_limit.map(|limit| png(&limit.picture)).transpose()?,
        &shown.collect::<Vec<_>>(),
        cells.into_iter().map(|cell| cell.seen.map(|seen| seen.shown)).collect(),
    );
    Ok((study, pictures))
}

fn pixels(window: Window) -> u64 {
    window.area() as u64
}

fn prepare(subject: &Subject, setting: &Setting) -> World {
    World::prepare(setting.scene(&subject.scene), setting.pipeline, setting.structure, setting.numerics)
}

/// The filters of all settings, each once, the base's first.
fn filters(cells: &[Cell]) -> Vec<(FilterShape, f64)> {
    let mut filters = Vec::new();
    for cell in cells {
        let filter = cell.setting.sampling.shape_and_radius();
        if !filters.contains(&filter) {
            filters.push(filter);
        }
    }
    filters
}

/// What all parts of the work need.
struct Work<'a> {
    subject: &'a Subject,
    options: &'a Options,
    view: &'a View,
    meter: Meter<'a>,
}

impl Work<'_> {
    /// What each tier decides otherwise than `exact`.
    fn geometry(&self, watch: &Watch) -> Result<Vec<Geometry>> {
        let Subject { scene, camera, projection, size, base, .. } = self.subject;
        let scale = f64::from(self.options.rays_across) / f64::from(size[0].max(size[1]));
        let size = size.map(|side| ((f64::from(side) * scale).round() as u32).max(1));
        let view = View::new(camera, *projection, size)?;
        let closed = leaks::closed(scene);
        let world = |numerics| prepare(self.subject, &Setting { numerics, ..base.clone() });
        let exact = world(Numerics::Exact);
        let mut found = Vec::new();
        for numerics in Numerics::ALL {
            let tier = world(numerics);
            found.push(geometry::compare(
                [&tier, &exact],
                (&view, size),
                &closed,
                self.options.leak_rays,
                watch,
            )?);
        }
        Ok(found)
    }

    /// A picture, with a plan of its own.
    fn picture<P: Pixel>(&self, world: &mut World, setting: &Setting) -> Result<(Film<P>, Statistics)> {
        world.sampling = setting.sampling;
        let plan = Plan::new(world, &setting.choices(&self.subject.choices))?;
        self.made(world, &plan, setting)
    }

    fn made<P: Pixel>(&self, world: &World, plan: &Plan, setting: &Setting) -> Result<(Film<P>, Statistics)> {
        let step = |_: usize, _: usize| self.meter.step(effort(setting));
        let watch = Watch { cancel: self.meter.watch.cancel, progress: &step };
        render_as(world, self.view, plan, self.subject.window, &watch, render::Clock::Stopped)
    }

    fn limits(&self, filters: &[(FilterShape, f64)]) -> Result<Vec<Limit>> {
        let mut limits = Vec::new();
        for (index, &filter) in filters.iter().enumerate() {
            let samples = self.options.samples_of_limit(index);
            let [a, b] = halves(&self.subject.base, filter, samples).map(|half| {
                let mut world = prepare(self.subject, &half);
                let (film, _) = self.picture::<[f32; 3]>(&mut world, &half)?;
                Ok::<_, Error>(Picture::of_film(&film, half.pipeline))
            });
            limits.extend(Limit::new(filter, samples, &[a?, b?])?);
        }
        Ok(limits)
    }

    /// Every twin once.
    fn twins(&self, cells: &[Cell]) -> Result<Vec<(Setting, Picture)>> {
        let mut twins: Vec<(Setting, Picture)> = Vec::new();
        let mut world: Option<World> = None;
        for cell in cells {
            let twin = cell.setting.twin(&self.subject.base);
            if twins.iter().any(|(setting, _)| *setting == twin) {
                continue;
            }
            // They differ in nothing but their samples.
            let world = world.get_or_insert_with(|| prepare(self.subject, &twin));
            let (film, _) = self.picture::<[f32; 3]>(world, &twin)?;
            let picture = Picture::of_film(&film, twin.pipeline);
            twins.push((twin, picture));
        }
        Ok(twins)
    }

    /// Makes every picture once, and holds it against its limit and its twin.
    fn look(&self, cells: &mut [Cell], limits: &[Limit], twins: &[(Setting, Picture)]) -> Result<()> {
        for group in groups(cells) {
            let mut world = prepare(self.subject, &cells[group[0]].setting);
            let description = world.accelerator.describe();
            for index in group {
                let setting = cells[index].setting.clone();
                let (film, statistics) = self.picture::<[f32; 3]>(&mut world, &setting)?;
                let picture = Picture::of_film(&film, setting.pipeline);
                let filter = setting.sampling.shape_and_radius();
                let limit = limits.iter().find(|limit| limit.filter == filter);
                let twin = setting.twin(&self.subject.base);
                let twin = twins.iter().find(|(setting, _)| *setting == twin).map(|(_, picture)| picture);
                let against = |reference: Option<&Picture>| -> Result<Option<Against>> {
                    Ok(reference.map(|r| Against::new(r, &picture)).transpose()?.flatten())
                };
                let (to_limit, to_twin) = (against(limit.map(|limit| &limit.picture))?, against(twin)?);
                let errors = to_limit.as_ref().map(|against| against.errors);
                cells[index].seen = Some(Seen {
                    statistics,
                    structure_bytes: description.bytes,
                    layout: description.layout,
                    told: limit.zip(errors).map_or(Told::Within, |(limit, errors)| limit.told(&errors)),
                    limit: errors,
                    twin: to_twin.as_ref().map(|against| against.errors),
                    fingerprint: fingerprint(&picture),
                    shown: Shown { png: png(&picture)?, limit: to_limit, twin: to_twin },
                });
            }
        }
        Ok(())
    }

    /// Times all settings, each once a round; says how long reading the inputs takes.
    fn time(
        &self,
        cells: &mut [Cell],
        load: Option<&(dyn Fn() -> Result<()> + Sync)>,
    ) -> Result<Option<Quartiles>> {
        let threads = rayon::current_num_threads();
        let mut load_ms = Vec::new();
        let groups = groups(cells);
        for round in 0..self.options.rounds as usize {
            if let Some(load) = load {
                let clock = Clock::start(threads);
                load()?;
                load_ms.push(1e3 * clock.seconds());
            }
            // Each round begins with another, so that none is always the one that comes after the same other.
            for turn in 0..groups.len() {
                let group = &groups[(round + turn) % groups.len()];
                let mut first = cells[group[0]].setting.clone();
                let scene = first.scene(&self.subject.scene);
                let clock = Clock::start(threads);
                let mut world = World::prepare(scene, first.pipeline, first.structure, first.numerics);
                let build = 1e3 * clock.seconds();
                // Caches and predictors get to know the tree; nobody counts this.
                (first.sampling.samples, first.sampling.noise) = (Some(1), None);
                self.picture::<[u8; 3]>(&mut world, &first)?;
                for turn in 0..group.len() {
                    let cell = &mut cells[group[(round + turn) % group.len()]];
                    world.sampling = cell.setting.sampling;
                    let plan = Plan::new(&world, &cell.setting.choices(&self.subject.choices))?;
                    let clock = Clock::start(threads);
                    self.made::<[u8; 3]>(&world, &plan, &cell.setting)?;
                    cell.trace_ms.push(1e3 * clock.seconds());
                    cell.build_ms.push(build);
                }
            }
        }
        Ok(Quartiles::of(&load_ms))
    }
}

/// The indices of cells that share a prepared scene.
fn groups(cells: &[Cell]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(WorldKey, Vec<usize>)> = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let key = cell.setting.world();
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(index),
            None => groups.push((key, vec![index])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// About how much work a tile of a picture is, in samples a pixel.
fn effort(setting: &Setting) -> usize {
    let sampling = &setting.sampling;
    if sampling.is_wanted() { sampling.most_samples() as usize } else { 1 }
}

/// How far the whole work is, in tiles times samples.
struct Meter<'a> {
    watch: &'a Watch<'a>,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl<'a> Meter<'a> {
    fn new(watch: &'a Watch<'a>) -> Self {
        Meter { watch, done: AtomicUsize::new(0), total: AtomicUsize::new(1) }
    }

    fn expect(&self, work: &Work, cells: &[Cell], limits: usize) {
        let Window { width, height, .. } = work.subject.window;
        let tiles = (width.div_ceil(TILE) * height.div_ceil(TILE)) as usize;
        let once: usize = cells.iter().map(|cell| effort(&cell.setting)).sum();
        let rounds = work.options.rounds as usize;
        let mut twins: Vec<Setting> = Vec::new();
        cells.iter().map(|cell| cell.setting.twin(&work.subject.base)).for_each(|twin| {
            if !twins.contains(&twin) {
                twins.push(twin);
            }
        });
        let twins: usize = twins.iter().map(effort).sum();
        let references: usize =
            (0..limits).map(|index| 2 * work.options.samples_of_limit(index) as usize).sum();
        let samples = references + twins + once * (1 + rounds) + groups(cells).len() * rounds;
        self.total.store(tiles * samples, Ordering::Relaxed);
    }

    fn step(&self, effort: usize) {
        let done = effort + self.done.fetch_add(effort, Ordering::Relaxed);
        (self.watch.progress)(done, self.total.load(Ordering::Relaxed).max(done));
    }
}

/// A hash of a picture's bits, the same in every run.
fn fingerprint(picture: &Picture) -> String {
    let mut hasher = DefaultHasher::new();
    picture.pixels.iter().flatten().for_each(|channel| channel.to_bits().hash(&mut hasher));
    format!("{:016x}", hasher.finish())
}

fn rows(candidates: &[Candidate], cells: &[Cell], base: &Setting, pixels: u64) -> Vec<Row> {
    let mut rows = Vec::new();
    for candidate in candidates {
        let Some(cell) = cells.iter().find(|cell| cell.setting == candidate.setting) else { continue };
        let Some(seen) = &cell.seen else { continue };
        let (Some(build_ms), Some(trace_ms)) = (Quartiles::of(&cell.build_ms), Quartiles::of(&cell.trace_ms))
        else {
            continue;
        };
        let (setting, statistics) = (&cell.setting, &seen.statistics);
        let (shape, radius) = setting.sampling.shape_and_radius();
        let primary_rays = statistics.rays(RayKind::PRIMARY).cast;
        rows.push(Row {
            id: rows.len(),
            knob: candidate.knob.into(),
            setting: candidate.name.clone(),
            base: candidate.base,
            options: setting.options(base),
            numerics: setting.numerics.name().into(),
            layout: seen.layout.into(),
            preset: setting.structure.preset().map(|preset| preset.name().into()),
            colour: setting.pipeline.name().into(),
            filter: format!("{} {radius}", shape.name()),
            build_ms,
            trace_ms,
            rays: statistics.rays.iter().map(|(_, count)| count.cast).sum(),
            primary_rays,
            samples_per_pixel: primary_rays as f64 / pixels as f64,
            structure_bytes: seen.structure_bytes,
            tile_bytes: statistics.bytes(),
            judge: candidate.judge,
            non_finite: statistics.non_finite.0,
            limit: seen.limit,
            told: seen.told,
            twin: seen.twin,
            fingerprint: seen.fingerprint.clone(),
        });
    }
    rows
}
