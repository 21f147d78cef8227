//! One pixel of a picture in words and numbers: its rays, the terms at each surface, and the way to its 8-bit values.
//!
//! [`RenderJob::explain_pixel`] renders the pixel as the picture does, with a [`Recorder`]. Lengths and positions of
//! the report are in scene coordinates, before recentering; colours are in the numbers of the pipeline.

mod report;
mod text;

pub use report::{
    ColourReport, FilterReport, HitReport, LayerReport, LightReport, LightSampleReport, LocalReport,
    NoiseReport, Occluder, PathReport, PixelReport, RayReport, SampleReport, ShadowRayReport, Steps8Bit,
    TermReport, TracedRay,
};

use glam::DVec3;

use super::{RenderControl, RenderJob};
use crate::bvh::{Primitive, Traversal};
use crate::effects::id;
use crate::effects::record::{
    ContinuationRecord, LightSource, LocalRecord, OcclusionTest, PathVertex, RayRecord, Recorder, Roulette,
    SampleRecord,
};
use crate::effects::tile::RenderContext;
use crate::error::{Error, Result, printable};
use crate::film::rounding::{Rounding, quantise};
use crate::film::tone::ToneMap;
use crate::film::write::OutputImage;
use crate::film::{ColourPipeline, DisplayTransform, Film, ReconstructionFilter, Window};
use crate::render::record_pixel;
use crate::world::SurfaceInteraction;

/// The most samples whose rays a report lists.
pub const MAX_LISTED_SAMPLES: u32 = 64;

impl RenderJob {
    /// Explains a pixel of the picture as `kiln render` writes it to a PNG file. The rays of up to
    /// [`MAX_LISTED_SAMPLES`] samples are listed, from the sample `first` on.
    ///
    /// # Errors
    /// [`Error::Usage`] for a pixel outside the picture or a sample that it does not take; those of
    /// [`RenderJob::render`].
    pub fn explain_pixel(&self, pixel: [u32; 2], first: u32, control: &RenderControl) -> Result<PixelReport> {
        let Window { x, y, width, height } = self.window;
        let [column, row] = pixel;
        if column.wrapping_sub(x) >= width || row.wrapping_sub(y) >= height {
            let columns = format!("{x} to {} and rows {y} to {}", x + width - 1, y + height - 1);
            let what = format!("--pixel {column},{row}: outside the picture, which has columns {columns}");
            return Err(Error::usage(what, "count columns from the left and rows from the top, from 0"));
        }
        let display = self.display_transform(control)?;
        let report = self.pixel_report(pixel, first, [display; 2], true)?;
        if report.samples.is_empty() {
            let what = format!("--sample {first}: the pixel has {} sample(s)", report.samples_taken);
            return Err(Error::usage(what, "count samples from 0"));
        }
        Ok(report)
    }

    /// [`RenderJob::explain_pixel`] without checks. `displays` are the display transforms that are known before the
    /// picture is, and that of the displayed picture; `is_displayed` is [`RenderContext::is_displayed`].
    pub(crate) fn pixel_report(
        &self,
        pixel: [u32; 2],
        first: u32,
        [known, shown]: [DisplayTransform; 2],
        is_displayed: bool,
    ) -> Result<PixelReport> {
        let (world, view) = (&*self.world, &self.view);
        let context = RenderContext { world, view, display: known, is_displayed };
        let traced = first..first.saturating_add(MAX_LISTED_SAMPLES);
        let (film, alpha, recorder) = if self.is_transparent() {
            let ([r, g, b, alpha], recorder) = record_pixel::<[f32; 4]>(&context, &self.plan, pixel, traced);
            ([r, g, b], Some(alpha), recorder)
        } else {
            let (film, recorder) = record_pixel::<[f32; 3]>(&context, &self.plan, pixel, traced);
            (film, None, recorder)
        };
        let (mut straight, mut displayed) = (film, [0; 3]);
        let mut alpha_8_bit = None;
        let window = Window { x: pixel[0], y: pixel[1], width: 1, height: 1 };
        let one = Film::from_rows(window, &[film])?;
        let of_8_bits = shown.rounded(Rounding { is_16_bit: false, ..shown.rounding() });
        match OutputImage::displayed(
            &one,
            alpha.as_ref().map(std::slice::from_ref),
            world.pipeline,
            of_8_bits,
        )? {
            OutputImage::Rgba8(film, alphas, _) => {
                (displayed, alpha_8_bit) = (film.pixel(0, 0), Some(alphas[0]));
            }
            OutputImage::Rgb8(film, _) => displayed = film.pixel(0, 0),
            _ => {}
        }
        if let Some(alpha) = alpha.filter(|&alpha| alpha > 0.0 && !DisplayTransform::is_kept(straight)) {
            straight = straight.map(|channel| channel / alpha);
        }
        let samples = Reporter { job: self, recorder: &recorder }.samples();
        let taken =
            recorder.samples.iter().filter(|sample| sample.layer.is_none_or(|[before, _]| before == 1.0));
        let samples_taken = taken.count();
        let listed =
            samples.iter().map(|sample| sample.index).collect::<std::collections::BTreeSet<_>>().len();
        Ok(PixelReport {
            pixel,
            size: view.size(),
            displayed,
            alpha: alpha_8_bit,
            colour: colour_report(&recorder, straight, shown, world.pipeline),
            transport: self.plan.transport.name(),
            samples_taken,
            filter: self.plan.takes_samples().then(|| self.filter_report()),
            noise: noise(&recorder),
            samples_left_out: samples_taken.saturating_sub(listed),
            samples,
            not_listed: self.not_listed(),
            traced: self.traced_rays(&recorder, first),
        })
    }

    fn filter_report(&self) -> FilterReport {
        let (shape, radius) = self.plan.sampling.shape_and_radius();
        let mean_sign = ReconstructionFilter::new(shape, radius).mean_sign();
        FilterReport { shape: shape.name(), radius, mean_sign }
    }

    /// What a report does not list.
    fn not_listed(&self) -> Vec<String> {
        let mut list = Vec::new();
        let has = |effect| self.plan.effects_on().any(|on| on == effect);
        if has(id::AMBIENT_OCCLUSION) {
            list.push("rays of ambient occlusion: their result is the factor `unoccluded` of L_a".to_owned());
        }
        if has(id::ALPHA) {
            list.push(
                "surfaces that a ray passes by their opacity: t is the distance to the one that it hits"
                    .to_owned(),
            );
        }
        if self.world.shadow_catcher().is_some() {
            list.push(
                "the shadow catcher: the ground's light becomes the sample's coverage, and its colour 0"
                    .to_owned(),
            );
        }
        list
    }

    /// The rays of the sample `index`, or of its first layer.
    fn traced_rays(&self, recorder: &Recorder, index: u32) -> Vec<TracedRay> {
        let root = recorder.samples.iter().find(|sample| sample.index == index).and_then(|sample| sample.ray);
        let roots = roots(&recorder.rays);
        let own = recorder.rays.iter().zip(&roots).filter(|(_, of)| Some(**of) == root).map(|(ray, _)| ray);
        let mut traversal = Traversal::default();
        own.flat_map(|record| {
            let hit = record.surface.map(|surface| surface.hit.t);
            let (origin, direction) = (record.ray.origin(), record.ray.direction());
            let length = hit.unwrap_or(f64::INFINITY);
            let is_hit = hit.is_some();
            let ray = TracedRay { kind: record.kind, origin, direction, length, is_hit };
            let tests = record.tests.iter().map(|test| {
                let occluder = self.occluder(test, &mut traversal);
                let (kind, is_hit) = (test.kind, test.is_occluded);
                let (origin, direction) = (test.ray.origin(), test.ray.direction());
                let length = occluder.map_or(test.ray.t_max(), |(_, t)| t);
                TracedRay { kind, origin, direction, length, is_hit }
            });
            std::iter::once(ray).chain(tests.collect::<Vec<_>>())
        })
        .collect()
    }

    /// The object nearest to the origin of an occlusion test that is occluded, and its distance. The test itself does
    /// not find it.
    fn occluder(&self, test: &OcclusionTest, traversal: &mut Traversal) -> Option<(u32, f64)> {
        let hit = self.world.accelerator.closest_hit(&test.ray, traversal).filter(|_| test.is_occluded)?;
        Some((self.world.object_of(hit.prim), hit.t))
    }
}

/// For each ray, the index of the camera ray that it comes from.
fn roots(rays: &[RayRecord]) -> Vec<usize> {
    let mut roots: Vec<usize> = Vec::with_capacity(rays.len());
    for (index, ray) in rays.iter().enumerate() {
        roots.push(ray.parent.map_or(index, |parent| roots[parent]));
    }
    roots
}

fn colour_report(
    recorder: &Recorder,
    film: [f32; 3],
    display: DisplayTransform,
    pipeline: ColourPipeline,
) -> ColourReport {
    let colour = DVec3::from(film.map(f64::from));
    let is_light = !DisplayTransform::is_kept(film);
    let exposed = DisplayTransform::new(display.ev(), ToneMap::None).apply(colour);
    ColourReport {
        pipeline: pipeline.name(),
        filtered: recorder.filtered,
        film: is_light.then_some(film),
        exposure: display.ev(),
        exposed: is_light.then_some(exposed),
        tone_map: display.tone_map().name(),
        tone_mapped: display.apply(colour),
        encoded: display.displayed(pipeline, colour),
    }
}

/// Mean and standard error of the samples of a pixel.
fn noise(recorder: &Recorder) -> Option<NoiseReport> {
    let samples = &recorder.samples;
    if samples.len() < 2 || samples.iter().any(|sample| sample.layer.is_some()) {
        return None;
    }
    let colours = || samples.iter().map(|sample| DVec3::from(sample.colour.map(f64::from)));
    let count = samples.len() as f64;
    let mean = colours().sum::<DVec3>() / count;
    let variance = colours().map(|colour| (colour - mean) * (colour - mean)).sum::<DVec3>() / (count - 1.0);
    let standard_error = DVec3::from((variance / count).to_array().map(f64::sqrt));
    Some(NoiseReport { mean, standard_error })
}

/// Makes the reports of samples.
struct Reporter<'a> {
    job: &'a RenderJob,
    recorder: &'a Recorder,
}

impl Reporter<'_> {
    fn samples(&self) -> Vec<SampleReport> {
        let Recorder { samples, rays, .. } = self.recorder;
        let roots = roots(rays);
        let mut traversal = Traversal::default();
        let listed = samples.iter().filter_map(|sample| Some((sample, sample.ray?)));
        listed
            .map(|(sample, root)| {
                let own: Vec<usize> = (0..rays.len()).filter(|&ray| roots[ray] == root).collect();
                let rays = own.iter().map(|&ray| self.ray(&rays[ray], &own, &mut traversal)).collect();
                let &SampleRecord { index, film_position, sign, layer, colour, coverage, unlit, .. } = sample;
                let layer = layer.map(|[transmittance, opacity]| LayerReport { transmittance, opacity });
                SampleReport { index, film_position, weight: sign, layer, colour, coverage, unlit, rays }
            })
            .collect()
    }

    /// A length in scene coordinates.
    fn length(&self, length: f64) -> f64 {
        length / self.job.recentering.map_or(1.0, |recentering| recentering.scale)
    }

    /// A point in scene coordinates.
    fn point(&self, point: DVec3) -> DVec3 {
        self.job.recentering.map_or(point, |recentering| recentering.point_back(point))
    }

    fn object(&self, index: u32) -> String {
        printable(&self.job.world.objects[index as usize].name).into_owned()
    }

    fn light(&self, index: usize) -> String {
        self.job.world.lights.get(index).map_or_else(String::new, |light| printable(&light.name).into_owned())
    }

    /// The report of a ray; `own` are the rays of its sample.
    fn ray(&self, record: &RayRecord, own: &[usize], traversal: &mut Traversal) -> RayReport {
        let shadow_ray = |test: &OcclusionTest| ShadowRayReport {
            kind: test.kind.name,
            light: test.light.map(|light| self.light(light)),
            origin: self.point(test.ray.origin()),
            direction: test.ray.direction(),
            length: self.length(test.ray.t_max()),
            is_occluded: test.is_occluded,
            occluder: self
                .job
                .occluder(test, traversal)
                .map(|(object, t)| Occluder { object: self.object(object), t: self.length(t) }),
        };
        RayReport {
            kind: record.kind.name,
            depth: record.depth,
            parent: record.parent.and_then(|parent| own.iter().position(|&ray| ray == parent)),
            origin: self.point(record.ray.origin()),
            direction: record.ray.direction(),
            shadow_rays: record.tests.iter().map(shadow_ray).collect(),
            hit: record.surface.as_ref().map(|surface| self.hit(surface, record)),
            local: record.local.as_ref().map(|local| self.local(local)),
            path: record.vertex.as_ref().map(|vertex| self.path(vertex, record.surface.is_some())),
        }
    }

    fn hit(&self, surface: &SurfaceInteraction, record: &RayRecord) -> HitReport {
        let (world, hit) = (&self.job.world, &surface.hit);
        let [v, w] = hit.barycentrics;
        let (shape, barycentrics) = match world.accelerator.primitive(hit.slot) {
            Primitive::Analytic(shape) => (shape.name(), None),
            Primitive::Triangle(_) => ("triangle", Some([1.0 - v - w, v, w])),
        };
        let at = (surface.object, hit, surface.geometric_normal);
        HitReport {
            t: self.length(hit.t),
            object: self.object(surface.object),
            shape,
            primitive: hit.prim.0,
            primitive_of_object: hit.prim.0 - world.objects[surface.object as usize].first.0,
            material: printable(world.materials[surface.material as usize].name()).into_owned(),
            material_index: surface.material,
            position: self.point(surface.point.position),
            geometric_normal: surface.geometric_normal,
            shading_normal: surface.shading_normal,
            barycentrics,
            uv: world.texture_point(at, &record.ray, None, 0).map(|point| point.uv),
        }
    }

    fn local(&self, local: &LocalRecord) -> LocalReport {
        let LocalRecord { lights, terms, colour, blend } = local;
        let bytes = |colour: DVec3| colour.to_array().map(quantise::<u8>);
        let is_u8 = self.job.pipeline() == ColourPipeline::U8;
        LocalReport {
            model: terms.model,
            own: terms.own,
            lights: (0..)
                .zip(lights)
                .map(|(index, light)| LightReport {
                    light: self.light(index),
                    cosine: light.cosine,
                    radiance: light.radiance,
                    reaches: light.reaches,
                })
                .collect(),
            terms: terms
                .terms
                .iter()
                .map(|term| TermReport {
                    name: term.name,
                    light: term.light.map(|light| self.light(light)),
                    light_index: term.light,
                    factors: term.factors.clone(),
                    value: term.value,
                })
                .collect(),
            light: terms.light,
            colour: *colour,
            glaze: *blend,
            steps_8_bit: is_u8.then(|| Steps8Bit {
                own: bytes(terms.own),
                colour: bytes(*colour),
                mirrored: blend.map(|blend| bytes(blend.mirrored)),
                glazed: blend.map(|blend| bytes(blend.colour)),
            }),
        }
    }

    fn path(&self, vertex: &PathVertex, is_surface: bool) -> PathReport {
        let PathVertex { throughput, emission, lights, continuation } = vertex;
        let light_samples = lights.iter().map(|sample| LightSampleReport {
            light: match sample.source {
                LightSource::Light(index) => self.light(index),
                LightSource::Emitters => "emissive surfaces".into(),
                LightSource::Environment => "environment".into(),
            },
            sample: *sample,
        });
        let end = match continuation {
            _ if !is_surface => Some("nothing is hit"),
            None => Some("the limit of bounces"),
            Some(ContinuationRecord { throughput: Some(_), .. }) => None,
            Some(ContinuationRecord { sample: None, .. }) => Some("the surface scatters nothing"),
            Some(ContinuationRecord { roulette: Some(Roulette { probability, number }), .. })
                if number >= probability =>
            {
                Some("Russian roulette")
            }
            Some(_) => Some("the sampled direction is on the wrong side, or carries nothing"),
        };
        PathReport {
            throughput: *throughput,
            emission: *emission,
            light_samples: light_samples.collect(),
            bsdf_sample: *continuation,
            end,
        }
    }
}
