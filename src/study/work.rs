//! The parts of a study: geometry, limits, twins, a look at every picture, and the rounds of timing.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use super::data::{Geometry, Quartiles, Told};
use super::errors::PictureErrors;
use super::measure::{Options, Subject};
use super::meter::{effort, Meter};
use super::pictures::{png, Against, Shown};
use super::reference::{halves, Limit};
use super::setting::{Setting, WorldKey};
use super::{geometry, leaks};
use crate::bench::Clock;
use crate::error::{Error, Result};
use crate::film::{Film, FilterShape, Pixel, Window, TILE};
use crate::geometry::Numerics;
use crate::job::RenderJob;
use crate::metrics::ComparedImage;
use crate::render::{RenderControl, Statistics};
use crate::scene::Scene;
use crate::world::{View, World};

/// Rays across a side of the picture that geometry is compared in are no more than this, where the picture has not more itself.
const MOST_ACROSS: u32 = 2048;

/// A setting that is measured; candidates with equal settings share one.
pub struct Cell {
    pub setting: Setting,
    pub build_ms: Vec<f64>,
    pub trace_ms: Vec<f64>,
    pub seen: Option<Seen>,
}

/// What the first picture of a setting showed.
pub struct Seen {
    pub statistics: Statistics,
    pub structure_bytes: usize,
    pub layout: &'static str,
    pub limit: Option<PictureErrors>,
    pub told: Told,
    pub twin: Option<PictureErrors>,
    pub fingerprint: String,
    pub shown: Shown,
}

/// The picture in a setting.
pub fn prepare(subject: &Subject, setting: &Setting) -> Result<RenderJob> {
    job_of(subject, setting, setting.scene(&subject.scene))
}

/// The picture of a scene in a setting.
fn job_of(subject: &Subject, setting: &Setting, scene: Scene) -> Result<RenderJob> {
    let world = World::prepare(scene, setting.pipeline, setting.structure, setting.numerics);
    let (camera, choices) = (subject.camera.clone(), setting.choices(&subject.choices));
    let job = RenderJob::new(Arc::new(world), None, camera, subject.size, choices)?;
    Ok(RenderJob { window: subject.window, ..job })
}

/// The filters of all settings, each once, the base's first.
pub fn filters(cells: &[Cell]) -> Vec<(FilterShape, f64)> {
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
pub struct Work<'a> {
    /// What is studied.
    pub subject: &'a Subject,
    /// How thoroughly.
    pub options: &'a Options,
    /// How far it is.
    pub meter: Meter<'a>,
}

impl Work<'_> {
    /// Says how much there is to do.
    pub fn announce(&self, cells: &[Cell], limits: usize) {
        let Window { width, height, .. } = self.subject.window;
        let tiles = (width.div_ceil(TILE) * height.div_ceil(TILE)) as usize;
        let once: usize = cells.iter().map(|cell| effort(&cell.setting)).sum();
        let rounds = self.options.rounds as usize;
        let mut twins: Vec<Setting> = Vec::new();
        cells.iter().map(|cell| cell.setting.twin(&self.subject.base)).for_each(|twin| {
            if !twins.contains(&twin) {
                twins.push(twin);
            }
        });
        let twins: usize = twins.iter().map(effort).sum();
        let references: usize =
            (0..limits).map(|index| 2 * self.options.samples_of_limit(index) as usize).sum();
        let samples = references + twins + once * (1 + rounds) + groups(cells).len() * rounds;
        self.meter.expect(tiles * samples + self.steps_of_a_tier() * Numerics::ALL.len());
    }

    /// How large a picture geometry is compared in.
    fn size_of_geometry(&self) -> [u32; 2] {
        let size = self.subject.size;
        let most = MOST_ACROSS / size[0].max(size[1]).max(1);
        size.map(|side| side * self.options.rays_across.min(most).max(1))
    }

    /// About how much work it is to compare a tier, in tiles of one sample: its own rays and those of `exact`.
    fn steps_of_a_tier(&self) -> usize {
        let [width, height] = self.size_of_geometry().map(|side| side.div_ceil(TILE) as usize);
        2 * width * height
    }

    /// What each tier decides otherwise than `exact`.
    pub fn geometry(&self, watch: &RenderControl) -> Result<Vec<Geometry>> {
        let Subject { scene, camera, base, .. } = self.subject;
        let size = self.size_of_geometry();
        let view = View::new(camera, camera.projection, size)?;
        let closed = leaks::closed(scene);
        let world = |numerics| prepare(self.subject, &Setting { numerics, ..base.clone() });
        let exact = world(Numerics::Exact)?.world;
        let mut found = Vec::new();
        for numerics in Numerics::ALL {
            let tier = world(numerics)?.world;
            found.push(geometry::compare(
                [&tier, &exact],
                (&view, size),
                &closed,
                self.options.leak_rays,
                watch,
            )?);
            self.meter.step(self.steps_of_a_tier());
        }
        Ok(found)
    }

    /// The picture of a job in a setting that shares its world.
    fn picture<P: Pixel>(&self, job: &RenderJob, setting: &Setting) -> Result<(Film<P>, Statistics)> {
        self.made(&job.with_choices(setting.choices(&self.subject.choices))?, setting)
    }

    fn made<P: Pixel>(&self, job: &RenderJob, setting: &Setting) -> Result<(Film<P>, Statistics)> {
        let step = |_: usize, _: usize| self.meter.step(effort(setting));
        let cancel = self.meter.watch.cancel;
        job.render(&RenderControl { cancel, progress: &step, time_stages: false })
    }

    /// Both halves of every limit.
    pub fn limits(&self, filters: &[(FilterShape, f64)]) -> Result<Vec<Limit>> {
        let mut limits = Vec::new();
        for (index, &filter) in filters.iter().enumerate() {
            let samples = self.options.samples_of_limit(index);
            let [a, b] = halves(&self.subject.base, filter, samples).map(|half| {
                let (film, _) = self.made::<[f32; 3]>(&prepare(self.subject, &half)?, &half)?;
                Ok::<_, Error>(ComparedImage::of_film(&film, half.pipeline))
            });
            limits.extend(Limit::new(filter, samples, &[a?, b?])?);
        }
        Ok(limits)
    }

    /// Every twin once.
    pub fn twins(&self, cells: &[Cell]) -> Result<Vec<(Setting, ComparedImage)>> {
        let mut twins: Vec<(Setting, ComparedImage)> = Vec::new();
        let mut job: Option<RenderJob> = None;
        for cell in cells {
            let twin = cell.setting.twin(&self.subject.base);
            if twins.iter().any(|(setting, _)| *setting == twin) {
                continue;
            }
            // They differ in nothing but their samples.
            let job = match &mut job {
                Some(job) => job,
                none => none.insert(prepare(self.subject, &twin)?),
            };
            let (film, _) = self.picture::<[f32; 3]>(job, &twin)?;
            let picture = ComparedImage::of_film(&film, twin.pipeline);
            twins.push((twin, picture));
        }
        Ok(twins)
    }

    /// Makes every picture once, and holds it against its limit and its twin.
    pub fn look(
        &self,
        cells: &mut [Cell],
        limits: &[Limit],
        twins: &[(Setting, ComparedImage)],
    ) -> Result<()> {
        for group in groups(cells) {
            let job = prepare(self.subject, &cells[group[0]].setting)?;
            let description = job.world.accelerator.describe();
            for index in group {
                let setting = cells[index].setting.clone();
                let (film, statistics) = self.picture::<[f32; 3]>(&job, &setting)?;
                let picture = ComparedImage::of_film(&film, setting.pipeline);
                let filter = setting.sampling.shape_and_radius();
                let limit = limits.iter().find(|limit| limit.filter == filter);
                let twin = setting.twin(&self.subject.base);
                let twin = twins.iter().find(|(setting, _)| *setting == twin).map(|(_, picture)| picture);
                let against = |reference: Option<&ComparedImage>| -> Result<Option<Against>> {
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
    pub fn time(
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
                let job = job_of(self.subject, &first, scene)?;
                let build = 1e3 * clock.seconds();
                // Caches and predictors get to know the tree; nobody counts this.
                (first.sampling.samples, first.sampling.noise) = (Some(1), None);
                self.picture::<[u8; 3]>(&job, &first)?;
                for turn in 0..group.len() {
                    let cell = &mut cells[group[(round + turn) % group.len()]];
                    let job = job.with_choices(cell.setting.choices(&self.subject.choices))?;
                    let clock = Clock::start(threads);
                    self.made::<[u8; 3]>(&job, &cell.setting)?;
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

/// A hash of a picture's bits, the same in every run.
fn fingerprint(picture: &ComparedImage) -> String {
    let mut hasher = DefaultHasher::new();
    picture.pixels.iter().flatten().for_each(|channel| channel.to_bits().hash(&mut hasher));
    format!("{:016x}", hasher.finish())
}
