//! The course of a study: references, errors, then timing rounds with all settings interleaved.

use std::sync::atomic::AtomicUsize;

use rayon::ThreadPool;

use super::data::{ReferenceKind, SCHEMA, SettingRow, Study};
use super::pictures::{PageImages, png};
use super::reference::ConvergedReference;
use super::selection::select;
use super::setting::Setting;
use super::sweep::{Candidate, sweep};
use super::work::{MeasuredSetting, StudyRun, distinct, filters, prepare};
use super::{advice, ambient, path_sweep, steps, techniques};
use crate::bench::ResultFile;
use crate::timing::{Clock, Quartiles};
use kiln::bvh::Numerics;
use kiln::effects::RayKind;
use kiln::error::{Error, Result};
use kiln::job::{ResolvedPicture, Session};
use kiln::render::RenderControl;

/// Input of a study.
pub struct StudySubject {
    /// Name in the report.
    pub name: String,
    /// The command line.
    pub command: String,
    /// The command line of `kiln render` with the same inputs and options, in words.
    pub render_command: Vec<String>,
    /// The scene, camera, size and settings of the picture.
    pub session: Session,
    /// The picture.
    pub picture: ResolvedPicture,
    /// The base setting.
    pub base: Setting,
}

/// Extent of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Timing rounds.
    pub rounds: u32,
    /// Maximum number of samples per pixel.
    pub most_samples: u32,
    /// Samples per pixel of each half of a converged reference.
    pub reference_samples: u32,
    /// Rays per pixel in each direction for the comparison of geometry.
    pub rays_across: u32,
    /// Rays per tier for the search of leaks.
    pub leak_rays: u64,
    /// Parameters to vary, from [`super::parameters`]; all if empty.
    pub parameters: Vec<&'static str>,
}

impl Options {
    /// Samples per pixel of each half of the limit of a filter. Index 0 is the filter of the base. Settings with other
    /// filters have fewer samples, so half as many suffice for their limits.
    pub(super) fn samples_of_limit(&self, index: usize) -> u32 {
        if index == 0 { self.reference_samples } else { self.reference_samples.div_ceil(2) }
    }
}

/// Thread pools of a study.
pub struct Pools<'a> {
    /// For timed renders.
    pub timed: &'a ThreadPool,
    /// For everything else.
    pub wide: &'a ThreadPool,
}

/// Runs a study. `load` reads the inputs again for timing.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, and those of rendering.
pub fn study(
    subject: &StudySubject,
    options: &Options,
    load: Option<&(dyn Fn() -> Result<()> + Sync)>,
    pools: &Pools,
    control: &RenderControl,
) -> Result<(Study, PageImages)> {
    let (mut candidates, mut left_out, reference, envelope) = pools.wide.install(|| {
        let job = prepare(subject, &subject.base)?;
        let (candidates, left_out) = sweep(
            (subject.session.scene(), &subject.picture.look),
            &subject.base,
            &job.plan,
            options.most_samples,
        );
        let reference = path_sweep::reference(&subject.base, &job.plan);
        let left_out = left_out.into_iter().filter(|(parameter, _)| {
            // Of a picture without paths, the page does not list what paths have, unless it was asked for.
            let is_of_paths = path_sweep::PARAMETERS.contains(parameter);
            !is_of_paths || path_sweep::traces_paths(&job.plan) || options.parameters.contains(parameter)
        });
        Ok::<_, Error>((
            candidates,
            left_out.collect::<Vec<_>>(),
            reference,
            ResultFile::new(
                SCHEMA,
                subject.name.clone(),
                subject.command.clone(),
                Some(job.world.accelerator.describe().isa),
            ),
        ))
    })?;
    let is_wanted =
        |parameter: &str| options.parameters.is_empty() || options.parameters.contains(&parameter);
    candidates.retain(|candidate| candidate.base || is_wanted(candidate.parameter));
    left_out.retain(|(parameter, _)| is_wanted(parameter));
    let settings = distinct(candidates.iter().map(|candidate| candidate.setting.clone()));
    let measured =
        |setting| MeasuredSetting { setting, build_ms: Vec::new(), trace_ms: Vec::new(), result: None };
    let mut settings: Vec<MeasuredSetting> = settings.into_iter().map(measured).collect();
    // The limit takes most of the time; it is not needed for the base alone.
    let needs_limit =
        candidates.iter().any(|candidate| !candidate.base && candidate.reference == ReferenceKind::Limit);
    let filters = if needs_limit { filters(&settings) } else { Vec::new() };
    let threads = pools.timed.current_num_threads();
    let progress = [AtomicUsize::new(0), AtomicUsize::new(1)];
    let work = StudyRun { subject, options, reference, timed_threads: threads, control, progress };
    work.set_total_work(&settings, filters.len());

    let (limits, limit_ms, twins, geometry) = pools.wide.install(|| {
        let geometry = work.geometry()?;
        let (limits, limit_ms) = work.limits(&filters)?;
        let base_filter = subject.base.sampling.shape_and_radius();
        if let Some(limit) = limits.iter().find(|limit| limit.filter == base_filter) {
            ambient::fit(&work, &mut candidates, &mut settings, &limit.picture)?;
        }
        Ok::<_, Error>((limits, limit_ms, work.twins(&settings)?, geometry))
    })?;
    pools.wide.install(|| work.compare_images(&mut settings, &limits, &twins))?;
    let has_techniques = candidates.iter().any(|candidate| candidate.parameter == path_sweep::TECHNIQUE);
    let technique_tests =
        if has_techniques { pools.wide.install(|| techniques::agreement(&work))? } else { Vec::new() };
    let load_ms = pools.timed.install(|| work.time_renders(&mut settings, load))?;

    let rows = rows(&candidates, &settings, subject);
    let pairs = |pairs: &[(String, String)]| pairs.iter().map(|(a, b)| [a.clone(), b.clone()]).collect();
    let base_limit = limits.iter().find(|limit| limit.filter == subject.base.sampling.shape_and_radius());
    let study = Study {
        envelope,
        settings: pairs(&subject.picture.metadata),
        size: [subject.picture.window.width, subject.picture.window.height],
        rounds: options.rounds,
        threads,
        clock: Clock::name(threads).into(),
        load_ms,
        floors: limits.iter().map(|limit| limit.floor.clone()).collect(),
        geometry,
        errors: Vec::new(),
        left_out: left_out.into_iter().map(|(parameter, why)| [parameter.to_owned(), why]).collect(),
        advice: advice(&rows),
        steps: steps(&rows),
        technique_tests,
        limit_ms,
        limit_options: limit_options(&work, limits.first()),
        render_command: subject.render_command.clone(),
        rows,
    };
    let shown = candidates.iter().map(|candidate| {
        let measured = settings.iter().position(|measured| measured.setting == candidate.setting)?;
        Some((measured, candidate.reference))
    });
    let place = select(&study).and_then(|selection| {
        let candidate = candidates.get(selection.quick)?;
        let measured = settings.iter().find(|measured| measured.setting == candidate.setting)?;
        measured.result.as_ref()?.images.limit.as_ref()?.worst_place()
    });
    let pictures = PageImages::new(
        base_limit.map(|limit| png(&limit.picture)).transpose()?,
        &shown.collect::<Vec<_>>(),
        &settings.into_iter().map(|measured| measured.result.map(|result| result.images)).collect::<Vec<_>>(),
    );
    Ok((study, PageImages { place, ..pictures }))
}

/// Options for a picture of the samples of both halves of the limit.
fn limit_options(work: &StudyRun, limit: Option<&ConvergedReference>) -> Option<String> {
    let StudySubject { base, picture, .. } = work.subject;
    let mut setting = Setting { numerics: Numerics::Exact, ..work.reference.clone() };
    (setting.sampling.samples, setting.sampling.noise) = (Some(limit?.floor.samples), None);
    setting.options(base, &picture.plan_settings)
}

fn rows(candidates: &[Candidate], settings: &[MeasuredSetting], subject: &StudySubject) -> Vec<SettingRow> {
    let pixels = subject.picture.window.area() as f64;
    let mut rows = Vec::new();
    for candidate in candidates {
        let Some(measured) = settings.iter().find(|measured| measured.setting == candidate.setting) else {
            continue;
        };
        let Some(result) = &measured.result else { continue };
        let (Some(build_ms), Some(trace_ms)) =
            (Quartiles::of(&measured.build_ms), Quartiles::of(&measured.trace_ms))
        else {
            continue;
        };
        let (setting, statistics) = (&measured.setting, &result.statistics);
        let (shape, radius) = setting.sampling.shape_and_radius();
        let options = setting.options(&subject.base, &subject.picture.plan_settings);
        let primary_rays = statistics.rays(RayKind::PRIMARY).cast;
        rows.push(SettingRow {
            id: rows.len(),
            parameter: candidate.parameter.into(),
            setting: candidate.name.clone(),
            base: candidate.base,
            has_options: options.is_some(),
            options: options.unwrap_or_default(),
            has_effect_off: setting.has_effect_off(&subject.base),
            numerics: setting.numerics.name().into(),
            layout: result.layout.into(),
            preset: setting.structure.preset().map(|preset| preset.name().into()),
            colour: setting.pipeline.name().into(),
            filter: format!("{} {radius}", shape.name()),
            build_ms,
            trace_ms,
            rays: statistics.rays.iter().map(|(_, count)| count.cast).sum(),
            primary_rays,
            samples_per_pixel: primary_rays as f64 / pixels,
            structure_bytes: result.structure_bytes,
            tile_bytes: statistics.bytes(),
            reference: candidate.reference,
            non_finite: statistics.non_finite.len(),
            limit: result.limit,
            significance: result.significance,
            twin: result.twin,
            fingerprint: result.fingerprint.clone(),
        });
    }
    rows
}
