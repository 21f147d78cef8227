//! Whether the techniques of direct light converge to the same picture: t-tests of BSDF samples and of light samples
//! against both with multiple importance sampling, after a control of two seeds of the latter.

use super::data::TechniqueTest;
use super::path_sweep::technique_named;
use super::setting::{PathVariation, Setting};
use super::work::{StudyRun, prepare};
use kiln::effects::LightTechnique;
use kiln::error::{Error, Result};
use kiln::film::channels::ExrChannels;
use kiln::film::{ColourPipeline, Film, FilterShape};
use kiln::metrics::t_test::{CHANNELS, Estimate, TTest};
use kiln::render::aov::{self, AovSelection};
use kiln::scene::PixelSampler;

/// Side in pixels of the blocks that are tested: their means are closer to normal than those of pixels.
const BLOCK: u32 = 4;

/// The least samples a pixel.
const MIN_SAMPLES: u32 = 16;

/// The t-tests. Samples are independent, and light is added linearly: where colours are clamped before the mean is
/// taken, techniques differ.
///
/// # Errors
/// Those of rendering.
pub(crate) fn agreement(run: &StudyRun) -> Result<Vec<TechniqueTest>> {
    let samples = (run.options.reference_samples / 8).max(MIN_SAMPLES);
    let both = estimate(run, LightTechnique::Both, samples, 1)?;
    let pairs = [
        ("control", LightTechnique::Both),
        ("", LightTechnique::BsdfSamples),
        ("", LightTechnique::LightSamples),
    ];
    let test = |(seed, (name, technique)): (u32, (&str, LightTechnique))| {
        let tested = estimate(run, technique, samples, seed)?;
        let name = if name.is_empty() { technique_named(technique) } else { name };
        Ok(TechniqueTest { name: name.into(), samples, test: TTest::between(&both, &tested, BLOCK)? })
    };
    (2..).zip(pairs).map(test).collect()
}

/// The picture of a technique with the statistics of its samples.
fn estimate(run: &StudyRun, technique: LightTechnique, samples: u32, seed: u32) -> Result<Estimate> {
    let base = &run.subject.base;
    let mut setting = Setting {
        pipeline: ColourPipeline::Linear,
        path: PathVariation { technique, clamp: None, ..base.path },
        ..base.clone()
    };
    let sampling = &mut setting.sampling;
    sampling.seed = sampling.seed.wrapping_add(seed);
    (sampling.samples, sampling.noise) = (Some(samples), None);
    (sampling.filter, sampling.filter_radius) = (Some(FilterShape::Box), None);
    sampling.sampler = PixelSampler::Independent;
    let job = prepare(run.subject, &setting)?;
    let (film, _): (Film, _) = run.render(&job, &setting)?;
    let selection = AovSelection::new(&["samples".into(), "variance".into()])?;
    let channels = aov::channels(&job.aov_source(Some(&film)), &selection, run.control)?;
    let own = CHANNELS.into_iter().enumerate();
    let own = own.map(|(c, name)| (name.to_owned(), film.rows().map(|pixel: [f32; 3]| pixel[c]).collect()));
    let channels = channels.into_iter().map(|channel| (channel.name, channel.values));
    let channels = ExrChannels {
        width: film.window().width,
        height: film.window().height,
        channels: own.chain(channels).collect(),
        settings: Vec::new(),
    };
    let estimate =
        Estimate::unchecked(&channels).map_err(|what| Error::Failed { what, hint: String::new() })?;
    Ok(Estimate { seed: Some(setting.sampling.seed), ..estimate })
}
