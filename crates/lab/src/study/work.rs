//! Steps of a study: geometry, limits, twins, comparison of pictures, timing rounds.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::data::{GeometryErrors, Significance};
use super::measure::{Options, StudySubject};
use super::pictures::{Comparison, SettingImages, png};
use super::reference::{ConvergedReference, halves};
use super::setting::Setting;
use super::{geometry, leaks};
use crate::timing::{Clock, Quartiles};
use kiln::bvh::Numerics;
use kiln::error::{Error, Result};
use kiln::film::{Film, FilterShape, Pixel, TILE, Window};
use kiln::job::{PreparedScene, RenderJob};
use kiln::metrics::{ComparedImage, Figures};
use kiln::render::{RenderControl, Statistics};
use kiln::scene::Scene;
use kiln::scene::animation::Moment;
use kiln::world::{View, WorldInputs};

/// Maximum number of rays along a side for the comparison of geometry, unless the picture is larger.
const MAX_RAYS_ACROSS: u32 = 2048;

/// A setting with its measurements, shared by candidates with equal settings.
pub(crate) struct MeasuredSetting {
    pub setting: Setting,
    pub build_ms: Vec<f64>,
    pub trace_ms: Vec<f64>,
    pub result: Option<RenderResult>,
}

/// Statistics and errors of a setting.
pub(crate) struct RenderResult {
    pub statistics: Statistics,
    pub structure_bytes: usize,
    pub layout: &'static str,
    pub limit: Option<Figures>,
    pub significance: Significance,
    pub twin: Option<Figures>,
    pub fingerprint: String,
    pub images: SettingImages,
}

/// The job of the subject in a setting.
pub(crate) fn prepare(subject: &StudySubject, setting: &Setting) -> Result<RenderJob> {
    job_of(subject, setting, setting.scene(subject.session.scene()))
}

/// The job of a scene in a setting.
fn job_of(subject: &StudySubject, setting: &Setting, scene: Scene) -> Result<RenderJob> {
    let Setting { pipeline, structure, numerics, .. } = *setting;
    let picture = &subject.picture;
    let inputs = picture.world_inputs();
    let ambient = setting.path.ambient.or(inputs.ambient);
    let inputs = WorldInputs { ambient, pipeline, structure, numerics, ..inputs };
    let moment = Moment::of_still(&scene);
    let scene = PreparedScene::new(scene, &inputs, false)?;
    let plan_settings = setting.plan_settings(&picture.plan_settings);
    let mut picture = picture.clone();
    picture.plan_settings = plan_settings;
    scene.at(moment)?.job_for(picture)
}

/// The distinct filters of all settings, beginning with that of the base.
pub(crate) fn filters(settings: &[MeasuredSetting]) -> Vec<(FilterShape, f64)> {
    distinct(settings.iter().map(|measured| measured.setting.sampling.shape_and_radius()))
}

/// The distinct values in order.
pub(crate) fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut distinct = Vec::new();
    for value in values {
        if !distinct.contains(&value) {
            distinct.push(value);
        }
    }
    distinct
}

/// Context of all steps.
pub(crate) struct StudyRun<'a> {
    /// Input of the study.
    pub subject: &'a StudySubject,
    /// Extent of the study.
    pub options: &'a Options,
    /// Setting of the limits, but for their samples.
    pub reference: Setting,
    /// Number of threads of timed renders, which determines the clock.
    pub timed_threads: usize,
    /// Cancellation, and receiver of the progress.
    pub control: &'a RenderControl<'a>,
    /// Progress so far and in total, in tiles times samples per pixel.
    pub progress: [AtomicUsize; 2],
}

/// Approximate work per tile, in samples per pixel.
fn effort(setting: &Setting) -> usize {
    let sampling = &setting.sampling;
    sampling.samples_taken() as usize
}

impl StudyRun<'_> {
    /// Adds to the progress.
    fn step(&self, effort: usize) {
        let [done, total] = &self.progress;
        let done = effort + done.fetch_add(effort, Ordering::Relaxed);
        (self.control.progress)(done, total.load(Ordering::Relaxed).max(done));
    }

    /// Sets the total work of the progress.
    pub(crate) fn set_total_work(&self, settings: &[MeasuredSetting], limits: usize) {
        let Window { width, height, .. } = self.subject.picture.window;
        let tiles = (width.div_ceil(TILE) * height.div_ceil(TILE)) as usize;
        let once: usize = settings.iter().map(|measured| effort(&measured.setting)).sum();
        let rounds = self.options.rounds as usize;
        let twins: usize = self.twin_settings(settings).iter().map(effort).sum();
        let references: usize =
            (0..limits).map(|index| 2 * self.options.samples_of_limit(index) as usize).sum();
        let samples = references + twins + once * (1 + rounds) + groups(settings).len() * rounds;
        let total = tiles * samples + self.steps_of_a_tier() * Numerics::ALL.len();
        self.progress[1].store(total, Ordering::Relaxed);
    }

    /// Picture size for the comparison of geometry.
    fn size_of_geometry(&self) -> [u32; 2] {
        let size = self.subject.picture.size();
        let most = MAX_RAYS_ACROSS / size[0].max(size[1]).max(1);
        size.map(|side| side * self.options.rays_across.min(most).max(1))
    }

    /// Approximate work for the comparison of a tier, in tiles of one sample: its rays and those of `exact`.
    fn steps_of_a_tier(&self) -> usize {
        let [width, height] = self.size_of_geometry().map(|side| side.div_ceil(TILE) as usize);
        2 * width * height
    }

    /// Differences in ray hits between each tier and `exact`.
    pub(crate) fn geometry(&self) -> Result<Vec<GeometryErrors>> {
        let StudySubject { session, picture, base, .. } = self.subject;
        let camera = &picture.camera;
        let size = self.size_of_geometry();
        let view = View::new(camera, camera.projection, size)?;
        let closed = leaks::closed_meshes(session.recentered().0);
        let world = |numerics| prepare(self.subject, &Setting { numerics, ..base.clone() });
        let exact = world(Numerics::Exact)?.world;
        let mut tiers = Vec::new();
        for numerics in Numerics::ALL {
            let tier = world(numerics)?.world;
            let leak_rays = self.options.leak_rays;
            tiers.push(geometry::compare([&tier, &exact], (&view, size), &closed, leak_rays, self.control)?);
            self.step(self.steps_of_a_tier());
        }
        Ok(tiers)
    }

    /// Renders a setting that shares the prepared scene of `job`.
    fn render_setting<P: Pixel>(&self, job: &RenderJob, setting: &Setting) -> Result<(Film<P>, Statistics)> {
        self.render(
            &job.with_plan_settings(setting.plan_settings(&self.subject.picture.plan_settings))?,
            setting,
        )
    }

    /// Renders a prepared setting.
    pub(crate) fn render<P: Pixel>(
        &self,
        job: &RenderJob,
        setting: &Setting,
    ) -> Result<(Film<P>, Statistics)> {
        let step = |_: usize, _: usize| self.step(effort(setting));
        let cancel = self.control.cancel;
        job.render(&RenderControl { cancel, progress: &step, time_stages: false })
    }

    /// Renders the limit of every filter; returns them with the render time of the first in ms.
    pub(crate) fn limits(
        &self,
        filters: &[(FilterShape, f64)],
    ) -> Result<(Vec<ConvergedReference>, Option<f64>)> {
        let (mut limits, mut first_ms) = (Vec::new(), None);
        for (index, &filter) in filters.iter().enumerate() {
            let samples = self.options.samples_of_limit(index);
            let mut milliseconds = 0.0;
            let [a, b] = halves(&self.reference, filter, samples).map(|half| {
                let job = prepare(self.subject, &half)?;
                let clock = Clock::start(self.timed_threads);
                let (film, _) = self.render::<[f32; 3]>(&job, &half)?;
                milliseconds += 1e3 * clock.seconds();
                Ok::<_, Error>(ComparedImage::of_film(&film, half.pipeline))
            });
            first_ms.get_or_insert(milliseconds);
            limits.extend(ConvergedReference::new(filter, (samples, self.reference.path.depth), &[a?, b?])?);
        }
        Ok((limits, first_ms))
    }

    /// Renders every distinct twin.
    pub(crate) fn twins(&self, settings: &[MeasuredSetting]) -> Result<Vec<(Setting, ComparedImage)>> {
        let twins = self.twin_settings(settings);
        let Some(first) = twins.first() else { return Ok(Vec::new()) };
        // Twins differ in their sampling only.
        let job = prepare(self.subject, first)?;
        let render = |twin: Setting| {
            let (film, _) = self.render_setting::<[f32; 3]>(&job, &twin)?;
            let picture = ComparedImage::of_film(&film, twin.pipeline);
            Ok::<_, Error>((twin, picture))
        };
        twins.into_iter().map(render).collect()
    }

    fn twin_settings(&self, settings: &[MeasuredSetting]) -> Vec<Setting> {
        distinct(settings.iter().map(|measured| measured.setting.twin(&self.subject.base)))
    }

    /// Renders every setting once, and compares it with its limit and its twin.
    pub(crate) fn compare_images(
        &self,
        settings: &mut [MeasuredSetting],
        limits: &[ConvergedReference],
        twins: &[(Setting, ComparedImage)],
    ) -> Result<()> {
        for group in groups(settings) {
            let job = prepare(self.subject, &settings[group[0]].setting)?;
            let description = job.world.accelerator.describe();
            for index in group {
                let setting = settings[index].setting.clone();
                let (film, statistics) = self.render_setting::<[f32; 3]>(&job, &setting)?;
                let picture = ComparedImage::of_film(&film, setting.pipeline);
                let filter = setting.sampling.shape_and_radius();
                let limit = limits.iter().find(|limit| limit.filter == filter);
                let twin = setting.twin(&self.subject.base);
                let twin = twins.iter().find(|(setting, _)| *setting == twin).map(|(_, picture)| picture);
                let against = |reference: Option<&ComparedImage>| -> Result<Option<Comparison>> {
                    Ok(reference.map(|r| Comparison::new(r, &picture)).transpose()?.flatten())
                };
                let (to_limit, to_twin) = (against(limit.map(|limit| &limit.picture))?, against(twin)?);
                let errors = to_limit.as_ref().map(|against| against.errors);
                settings[index].result = Some(RenderResult {
                    statistics,
                    structure_bytes: description.bytes,
                    layout: description.layout,
                    significance: limit
                        .zip(errors)
                        .map_or(Significance::Insignificant, |(limit, errors)| limit.significance(&errors)),
                    limit: errors,
                    twin: to_twin.as_ref().map(|against| against.errors),
                    fingerprint: fingerprint(&picture),
                    images: SettingImages { png: png(&picture)?, limit: to_limit, twin: to_twin },
                });
            }
        }
        Ok(())
    }

    /// Times all settings once per round; returns the time for reading the inputs.
    pub(crate) fn time_renders(
        &self,
        settings: &mut [MeasuredSetting],
        load: Option<&(dyn Fn() -> Result<()> + Sync)>,
    ) -> Result<Option<Quartiles>> {
        let threads = rayon::current_num_threads();
        let mut load_ms = Vec::new();
        let groups = groups(settings);
        for round in 0..self.options.rounds as usize {
            if let Some(load) = load {
                let clock = Clock::start(threads);
                load()?;
                load_ms.push(1e3 * clock.seconds());
            }
            // Rounds are rotated, as a render may affect the time of the next one.
            for turn in 0..groups.len() {
                let group = &groups[(round + turn) % groups.len()];
                let mut first = settings[group[0]].setting.clone();
                let scene = first.scene(self.subject.session.scene());
                let clock = Clock::start(threads);
                let job = job_of(self.subject, &first, scene)?;
                let build = 1e3 * clock.seconds();
                // Untimed render to warm up caches and branch predictors.
                (first.sampling.samples, first.sampling.noise) = (Some(1), None);
                self.render_setting::<[u8; 3]>(&job, &first)?;
                for turn in 0..group.len() {
                    let measured = &mut settings[group[(round + turn) % group.len()]];
                    let job = job.with_plan_settings(
                        measured.setting.plan_settings(&self.subject.picture.plan_settings),
                    )?;
                    let clock = Clock::start(threads);
                    self.render::<[u8; 3]>(&job, &measured.setting)?;
                    measured.trace_ms.push(1e3 * clock.seconds());
                    measured.build_ms.push(build);
                }
            }
        }
        Ok(Quartiles::of(&load_ms))
    }
}

/// Indices of settings that share a prepared scene.
fn groups(settings: &[MeasuredSetting]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, MeasuredSetting { setting, .. }) in settings.iter().enumerate() {
        match groups.iter_mut().find(|group| settings[group[0]].setting.shares_world(setting)) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Hash of a picture's bits, the same in every run.
fn fingerprint(picture: &ComparedImage) -> String {
    let mut hasher = DefaultHasher::new();
    picture.pixels.iter().flatten().for_each(|channel| channel.to_bits().hash(&mut hasher));
    format!("{:016x}", hasher.finish())
}
