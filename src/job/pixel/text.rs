//! The report of a pixel as lines of text.

use std::fmt::{Display, Write};

use glam::DVec3;

use super::{ColourReport, PixelReport};
use crate::effects::record::{HitRecord, LocalRecord, PathRecord, RayRecord, SampleRecord, ShadowRayRecord};
use crate::film::ColourPipeline;
use crate::film::rounding::quantise;

/// Columns of the labels.
const LABEL: usize = 16;

impl PixelReport {
    /// The report as text: the first of its samples, and how all become the displayed values. `name` shortens the
    /// names of objects and lights.
    pub fn text(&self, name: &dyn Fn(&str) -> String) -> String {
        let mut text = Text { lines: String::new(), pipeline: self.colour.pipeline, name };
        let ([x, y], [width, height], [r, g, b]) = (self.pixel, self.size, self.displayed);
        text.line(format_args!("pixel {x},{y} of {width} x {height}, from the top left: {r} {g} {b}"));
        let first = self.samples.iter().take_while(|sample| sample.index == self.samples[0].index);
        for (index, sample) in first.enumerate() {
            text.sample(self.samples_taken, index, sample);
        }
        text.colour(self);
        for what in &self.not_listed {
            text.line(format_args!("not listed: {what}"));
        }
        text.lines
    }
}

/// Lines of text.
struct Text<'a> {
    lines: String,
    pipeline: &'static str,
    name: &'a dyn Fn(&str) -> String,
}

/// A number with six significant digits, at most six of them after the point.
pub(crate) fn digits(x: f64) -> String {
    let before = if x.abs() >= 1.0 && x.is_finite() { x.abs().log10() as usize + 1 } else { 0 };
    let text = format!("{x:.*}", 6usize.saturating_sub(before.max(1)));
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if x != 0.0 && matches!(text, "0" | "-0") {
        format!("{x:.2e}")
    } else {
        text.replacen("-0", "0", usize::from(text == "-0"))
    }
}

fn vector(v: impl Into<[f64; 3]>) -> String {
    v.into().map(digits).join("  ")
}

/// A density per solid angle.
fn pdf(pdf: f64) -> String {
    if pdf.is_finite() { digits(pdf) } else { "of a delta".into() }
}

/// Light: one number if it is grey.
fn light(v: DVec3) -> String {
    if v.x == v.y && v.y == v.z { digits(v.x) } else { vector(v) }
}

fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

impl Text<'_> {
    fn line(&mut self, line: impl Display) {
        let _ = writeln!(self.lines, "{line}");
    }

    fn row(&mut self, label: impl Display, value: impl Display) {
        self.line(format_args!("  {:<LABEL$}  {value}", label.to_string()));
    }

    fn optional_row(&mut self, label: &str, value: Option<impl Display>) {
        value.into_iter().for_each(|value| self.row(label, value));
    }

    /// A colour: of 255 in the pipelines of display values.
    fn in_pipeline(&self, colour: DVec3) -> String {
        if self.pipeline == ColourPipeline::U8.name() {
            return colour.to_array().map(|c| quantise::<u8>(c).to_string()).join("  ");
        }
        self.of_255(colour)
    }

    /// A colour that is not rounded to 8 bits.
    fn of_255(&self, colour: DVec3) -> String {
        if self.pipeline == ColourPipeline::Linear.name() {
            return vector(colour);
        }
        (colour * 255.0).to_array().map(|c| format!("{c:.3}")).join("  ")
    }

    fn sample(&mut self, taken: usize, index: usize, sample: &SampleRecord) {
        if taken > 1 {
            let [x, y] = sample.film_position;
            self.line(format_args!("\nsample {} of {taken}, at {x:.3},{y:.3}", sample.index));
        }
        if let Some(layer) = sample.layer.as_ref().filter(|layer| layer.transmittance * layer.opacity < 1.0) {
            self.line(format_args!("\nlayer {index} of transparent surfaces"));
            let transmittance = digits(layer.transmittance);
            self.row("transmittance", format_args!("{transmittance} of the layers before it"));
            self.row("opacity", digits(layer.opacity));
        }
        for ray in &sample.rays {
            self.ray(ray);
        }
    }

    fn ray(&mut self, ray: &RayRecord) {
        let of = if ray.depth == 0 { String::new() } else { format!(", bounce {}", ray.depth) };
        self.line(format_args!("\n{} ray{of}", ray.kind.name));
        self.row("origin", vector(ray.origin));
        self.row("direction", vector(ray.direction));
        match &ray.hit {
            Some(hit) => self.hit(hit),
            None => self.row("hits", "nothing"),
        }
        if let Some(local) = &ray.local {
            self.local(local, &ray.shadow_rays);
        }
        if let Some(path) = &ray.path {
            self.path(path, &ray.shadow_rays);
        }
    }

    fn hit(&mut self, hit: &HitRecord) {
        let HitRecord { shape, primitive, primitive_of_object, .. } = hit;
        self.row("hits", (self.name)(&hit.object));
        self.row(shape, format_args!("{primitive} ({primitive_of_object} of the object)"));
        self.row("distance t", digits(hit.t));
        self.row("position", vector(hit.position));
        if hit.shading_normal == hit.geometric_normal {
            self.row("normal N", vector(hit.geometric_normal));
        } else {
            self.row("geometric normal", vector(hit.geometric_normal));
            self.row("shading normal N", vector(hit.shading_normal));
        }
        self.optional_row("barycentrics", hit.barycentrics.map(vector));
        self.optional_row("texture", hit.uv.map(|uv| uv.to_array().map(digits).join("  ")));
        self.row("material", (self.name)(&hit.material));
    }

    fn shadow_ray(&mut self, label: impl Display, ray: &ShadowRayRecord) {
        let to = ray.light.as_ref().map_or(String::new(), |light| format!("to {}: ", (self.name)(light)));
        let result = match &ray.occluder {
            Some(occluder) => {
                format!("occluded by {} at t {}", (self.name)(&occluder.object), digits(occluder.t))
            }
            None if ray.is_occluded => "occluded".into(),
            None if ray.length.is_finite() => format!("unoccluded over {}", digits(ray.length)),
            None => "unoccluded".into(),
        };
        self.row(label, to + &result);
    }

    fn local(&mut self, local: &LocalRecord, shadow_rays: &[ShadowRayRecord]) {
        let is_phong = local.terms.light.is_some();
        if is_phong {
            let of = if self.pipeline == ColourPipeline::Linear.name() { "" } else { "  of 255" };
            self.row("colour C", self.in_pipeline(local.terms.own) + of);
        }
        for ray in shadow_rays {
            self.shadow_ray(format_args!("{} ray", ray.kind.name), ray);
        }
        for light in local.lights.iter().filter(|light| !light.reaches && light.cosine <= 0.0) {
            let (name, cosine) = ((self.name)(&light.light), digits(light.cosine));
            self.row("light", format_args!("{name} is below the horizon: N.L {cosine}"));
        }
        let mut last = None;
        for term in &local.terms.terms {
            let at = term.light_index.filter(|index| last != Some(*index)).map(|index| &local.lights[index]);
            if let Some(at) = at {
                let (name, radiance, cosine) =
                    ((self.name)(&at.light), light(at.radiance), digits(at.cosine));
                self.row("light", format_args!("{name}: I {radiance}, N.L {cosine}"));
            }
            last = term.light_index;
            let factors = term.factors.iter().map(|(name, value)| format!("{name} {}", digits(*value)));
            let row = format!("{:<12}  {}", light(term.value), factors.collect::<Vec<_>>().join(", "));
            self.row(term.name, row.trim_end());
        }
        let sum = local.terms.light.map(|sum| format!("{:<12}  sum of the terms", light(sum)));
        self.optional_row("L", sum);
        self.row(if is_phong { "C_P = C L" } else { "colour" }, self.in_pipeline(local.colour));
        if let Some(glaze) = &local.glaze {
            let [own, weight] = glaze.weights;
            let (mirrored, colour) = (self.in_pipeline(glaze.mirrored), self.in_pipeline(glaze.colour));
            self.row("C_I", mirrored + "  the mirrored colour: the ray below");
            self.row("glazed C_P", format_args!("{colour}  {own} C_P + {weight} C_I"));
        }
    }

    fn path(&mut self, path: &PathRecord, shadow_rays: &[ShadowRayRecord]) {
        self.row("throughput", light(path.throughput));
        if let Some(emission) = &path.emission {
            let (radiance, weight) = (light(emission.radiance), digits(emission.weight));
            self.row("finds L_e", format_args!("{radiance}, MIS weight {weight}"));
            self.row("  adds", light(emission.adds));
        }
        for ray in shadow_rays {
            self.shadow_ray(format_args!("{} ray", ray.kind.name), ray);
        }
        for sample in &path.light_samples {
            let (bsdf, bsdf_pdf) = (light(sample.bsdf), pdf(sample.bsdf_pdf));
            self.row("light sample", (self.name)(&sample.light));
            self.row("  L", format_args!("{}, density {}", light(sample.radiance), pdf(sample.pdf)));
            self.row("  BSDF x cos", format_args!("{bsdf}, density {bsdf_pdf}"));
            self.row("  MIS weight", digits(sample.weight));
            self.shadow_ray("  shadow ray", &sample.shadow_ray);
            self.row("  adds", light(sample.adds));
        }
        let bsdf = path.bsdf_sample.as_ref();
        if let Some(sample) = bsdf.and_then(|bsdf| bsdf.sample.as_ref()) {
            let (pdf, weight) = (pdf(sample.pdf), light(sample.weight));
            self.row("BSDF sample", format_args!("density {pdf}, BSDF x cos / density {weight}"));
        }
        if let Some(roulette) = bsdf.and_then(|bsdf| bsdf.roulette.as_ref()) {
            let (number, probability) = (digits(roulette.number), digits(roulette.probability));
            self.row("roulette", format_args!("number {number}, goes on below {probability}"));
        }
        self.optional_row("path ends", path.end);
    }

    fn colour(&mut self, report: &PixelReport) {
        let ColourReport { filtered, film, exposure, exposed, tone_map, tone_mapped, encoded, .. } =
            &report.colour;
        let (pipeline, taken, is_mean) = (self.pipeline, report.samples_taken, report.samples_taken > 1);
        self.line(format_args!("\npixel, colour pipeline {pipeline}"));
        if let Some(filter) = &report.filter {
            let (shape, radius) = (filter.shape, digits(filter.radius));
            self.row("samples", format_args!("{taken}, filter {shape} of radius {radius}"));
        }
        if let Some(sample) = report.samples.first().filter(|_| is_mean) {
            let (colour, weight) = (self.in_pipeline(wide(sample.colour)), sample.weight);
            self.row(format_args!("sample {}", sample.index), format_args!("{colour}, weight {weight}"));
        }
        self.row(if is_mean { "filtered mean" } else { "colour" }, self.in_pipeline(wide(*filtered)));
        let error = report.noise.as_ref().map(|noise| self.of_255(noise.standard_error));
        self.optional_row("standard error", error);
        match film {
            Some(film) if film == filtered => {}
            Some(film) => self.row("composited", self.in_pipeline(wide(*film))),
            None => self.row("composited", "displayed colours, past exposure and tone map"),
        }
        let exposed = exposed.filter(|_| *exposure != 0.0);
        let exposed = exposed.map(|exposed| format!("{}, by {} EV", vector(exposed), digits(*exposure)));
        self.optional_row("exposed", exposed);
        if *tone_map != "none" {
            self.row("tone mapped", format_args!("{}, by {tone_map}", vector(*tone_mapped)));
        }
        if self.pipeline == ColourPipeline::Linear.name() {
            self.row("encoded", vector(*encoded) + ", by the sRGB curve");
        }
        let [r, g, b] = report.displayed;
        self.row("displayed", format_args!("{r}  {g}  {b}"));
        self.optional_row("alpha", report.alpha);
    }
}
