//! The study itself: references, errors, then rounds of timing in which all settings take turns.

use rayon::ThreadPool;

use super::data::{Judge, Quartiles, Row, Study, SCHEMA};
use super::meter::Meter;
use super::pictures::{png, Pictures};
use super::setting::Setting;
use super::sweep::{sweep, Candidate};
use super::work::{filters, prepare, Cell, Work};
use super::{advice, machine, steps};
use crate::bench::Clock;
use crate::effects::{Choices, RayKind};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::job::Metadata;
use crate::render::RenderControl;
use crate::scene::{Camera, Scene};

/// What is studied.
pub struct Subject {
    /// What to call it.
    pub name: String,
    /// The command that asked for it.
    pub command: String,
    /// The scene, with its lights.
    pub scene: Scene,
    /// Where it is seen from, with the projection that is used.
    pub camera: Camera,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// The part of it that is rendered.
    pub window: Window,
    /// What is asked of effects.
    pub choices: Choices,
    /// How the picture is asked for.
    pub base: Setting,
    /// What made it, as names and values.
    pub metadata: Metadata,
}

/// How thorough a study is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How often everything is timed, after a round to warm up.
    pub rounds: u32,
    /// The most samples a pixel that are looked at.
    pub most_samples: u32,
    /// Samples a pixel of each half of a reference.
    pub reference_samples: u32,
    /// Rays across a pixel of the picture that geometry is compared by.
    pub rays_across: u32,
    /// Rays that are cast at closed meshes in each tier.
    pub leak_rays: u64,
    /// The knobs that are varied, some of [`super::knobs`]; all of them where none is named.
    pub knobs: Vec<&'static str>,
}

impl Options {
    /// Samples a pixel of each half of a limit. The first is the base's; those of other filters are held against half of the most
    /// samples at most, so half are enough.
    pub(super) fn samples_of_limit(&self, index: usize) -> u32 {
        if index == 0 {
            self.reference_samples
        } else {
            self.reference_samples.div_ceil(2)
        }
    }
}

/// Where the work is done.
pub struct Pools<'a> {
    /// What is timed.
    pub timed: &'a ThreadPool,
    /// Everything else.
    pub wide: &'a ThreadPool,
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
    watch: &RenderControl,
) -> Result<(Study, Pictures)> {
    let (mut candidates, mut left_out, machine) = pools.wide.install(|| {
        let job = prepare(subject, &subject.base)?;
        let (candidates, left_out) = sweep(&subject.scene, &subject.base, &job.plan, options.most_samples);
        Ok::<_, Error>((candidates, left_out, machine::machine(&*job.world.accelerator)))
    })?;
    let is_wanted = |knob: &str| options.knobs.is_empty() || options.knobs.contains(&knob);
    candidates.retain(|candidate| candidate.base || is_wanted(candidate.knob));
    left_out.retain(|(knob, _)| is_wanted(knob));
    let mut cells: Vec<Cell> = Vec::new();
    for Candidate { setting, .. } in &candidates {
        if !cells.iter().any(|cell| cell.setting == *setting) {
            let setting = setting.clone();
            cells.push(Cell { setting, build_ms: Vec::new(), trace_ms: Vec::new(), seen: None });
        }
    }
    // What the base is off the limit is of no interest where nothing else is judged by it, and takes most of the time.
    let needs_limit = candidates.iter().any(|candidate| !candidate.base && candidate.judge == Judge::Limit);
    let filters = if needs_limit { filters(&cells) } else { Vec::new() };
    let work = Work { subject, options, meter: Meter::new(watch) };
    work.announce(&cells, filters.len());

    let (limits, twins, geometry) = pools.wide.install(|| {
        let geometry = work.geometry(watch)?;
        let limits = work.limits(&filters)?;
        Ok::<_, Error>((limits, work.twins(&cells)?, geometry))
    })?;
    pools.wide.install(|| work.look(&mut cells, &limits, &twins))?;
    let load_ms = pools.timed.install(|| work.time(&mut cells, load))?;

    let threads = pools.timed.current_num_threads();
    let rows = rows(&candidates, &cells, subject);
    let pairs = |pairs: &[(String, String)]| pairs.iter().map(|(a, b)| [a.clone(), b.clone()]).collect();
    let base_limit = limits.iter().find(|limit| limit.filter == subject.base.sampling.shape_and_radius());
    let study = Study {
        schema: SCHEMA,
        kiln: env!("CARGO_PKG_VERSION").into(),
        subject: subject.name.clone(),
        command: subject.command.clone(),
        machine,
        settings: pairs(&subject.metadata),
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
        &cells.into_iter().map(|cell| cell.seen.map(|seen| seen.shown)).collect::<Vec<_>>(),
    );
    Ok((study, pictures))
}

fn rows(candidates: &[Candidate], cells: &[Cell], subject: &Subject) -> Vec<Row> {
    let pixels = subject.window.area() as f64;
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
        let options = setting.options(&subject.base, &subject.choices);
        let primary_rays = statistics.rays(RayKind::PRIMARY).cast;
        rows.push(Row {
            id: rows.len(),
            knob: candidate.knob.into(),
            setting: candidate.name.clone(),
            base: candidate.base,
            has_options: options.is_some(),
            options: options.unwrap_or_default(),
            numerics: setting.numerics.name().into(),
            layout: seen.layout.into(),
            preset: setting.structure.preset().map(|preset| preset.name().into()),
            colour: setting.pipeline.name().into(),
            filter: format!("{} {radius}", shape.name()),
            build_ms,
            trace_ms,
            rays: statistics.rays.iter().map(|(_, count)| count.cast).sum(),
            primary_rays,
            samples_per_pixel: primary_rays as f64 / pixels,
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
