//! The report of a pixel as lines of text.

use std::fmt::Write;

use glam::DVec3;

use super::{
    ColourReport, HitReport, LocalReport, PathReport, PixelReport, RayReport, SampleReport, ShadowRayReport,
};
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
        text.line(0, &format!("pixel {x},{y} of {width} x {height}, from the top left: {r} {g} {b}"));
        for (index, sample) in
            self.samples.iter().take_while(|s| s.index == self.samples[0].index).enumerate()
        {
            text.sample(self, index, sample);
        }
        text.colour(self);
        for what in &self.not_listed {
            text.line(0, &format!("not listed: {what}"));
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
    fn line(&mut self, indent: usize, line: &str) {
        let _ = writeln!(self.lines, "{:indent$}{line}", "");
    }

    fn row(&mut self, label: &str, value: &str) {
        self.line(2, &format!("{label:<LABEL$}  {value}"));
    }

    /// A colour: of 255 in the pipelines of display values.
    fn in_pipeline(&self, colour: DVec3) -> String {
        if self.pipeline == ColourPipeline::Linear.name() {
            return vector(colour);
        }
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

    fn sample(&mut self, report: &PixelReport, index: usize, sample: &SampleReport) {
        if report.samples_taken > 1 {
            let [x, y] = sample.film_position;
            let of = report.samples_taken;
            self.line(0, &format!("\nsample {} of {of}, at {x:.3},{y:.3}", sample.index));
        }
        if let Some(layer) = sample.layer.as_ref().filter(|layer| layer.transmittance * layer.opacity < 1.0) {
            self.line(0, &format!("\nlayer {index} of transparent surfaces"));
            self.row("transmittance", &format!("{} of the layers before it", digits(layer.transmittance)));
            self.row("opacity", &digits(layer.opacity));
        }
        for ray in &sample.rays {
            self.ray(ray);
        }
    }

    fn ray(&mut self, ray: &RayReport) {
        let of = if ray.depth == 0 { String::new() } else { format!(", bounce {}", ray.depth) };
        self.line(0, &format!("\n{} ray{of}", ray.kind));
        self.row("origin", &vector(ray.origin));
        self.row("direction", &vector(ray.direction));
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

    fn hit(&mut self, hit: &HitReport) {
        let HitReport { shape, primitive, primitive_of_object, .. } = hit;
        self.row("hits", &(self.name)(&hit.object));
        self.row(shape, &format!("{primitive} ({primitive_of_object} of the object)"));
        self.row("distance t", &digits(hit.t));
        self.row("position", &vector(hit.position));
        if hit.shading_normal == hit.geometric_normal {
            self.row("normal N", &vector(hit.geometric_normal));
        } else {
            self.row("geometric normal", &vector(hit.geometric_normal));
            self.row("shading normal N", &vector(hit.shading_normal));
        }
        if let Some(weights) = hit.barycentrics {
            self.row("barycentrics", &vector(weights));
        }
        if let Some(uv) = hit.uv {
            self.row("texture", &uv.to_array().map(digits).join("  "));
        }
        self.row("material", &(self.name)(&hit.material));
    }

    fn shadow_ray(&mut self, label: &str, ray: &ShadowRayReport) {
        let (to, length) = (ray.light.as_deref().map(self.name), digits(ray.length));
        let to = to.map_or(String::new(), |light| format!("to {light}: "));
        let result = match &ray.occluder {
            Some(occluder) => {
                format!("occluded by {} at t {}", (self.name)(&occluder.object), digits(occluder.t))
            }
            None if ray.is_occluded => "occluded".into(),
            None if ray.length.is_finite() => format!("unoccluded over {length}"),
            None => "unoccluded".into(),
        };
        self.row(label, &format!("{to}{result}"));
    }

    fn local(&mut self, local: &LocalReport, shadow_rays: &[ShadowRayReport]) {
        let is_phong = local.light.is_some();
        if is_phong {
            let of = if self.pipeline == ColourPipeline::Linear.name() { "" } else { "  of 255" };
            let colour = self.in_pipeline(local.own);
            self.row("colour C", &format!("{colour}{of}"));
        }
        for ray in shadow_rays {
            self.shadow_ray(&format!("{} ray", ray.kind), ray);
        }
        for light in local.lights.iter().filter(|light| !light.reaches && light.cosine <= 0.0) {
            let name = (self.name)(&light.light);
            self.row("light", &format!("{name} is below the horizon: N.L {}", digits(light.cosine)));
        }
        let mut last = None;
        for term in &local.terms {
            let at = term.light_index.filter(|index| last != Some(*index)).map(|index| &local.lights[index]);
            if let Some(at) = at {
                let name = (self.name)(&at.light);
                let (radiance, cosine) = (light(at.radiance), digits(at.cosine));
                self.row("light", &format!("{name}: I {radiance}, N.L {cosine}"));
            }
            last = term.light_index;
            let factors: Vec<String> =
                term.factors.iter().map(|(name, value)| format!("{name} {}", digits(*value))).collect();
            let row = format!("{:<12}  {}", light(term.value), factors.join(", "));
            self.row(term.name, row.trim_end());
        }
        if let Some(sum) = local.light {
            self.row("L", &format!("{:<12}  sum of the terms", light(sum)));
        }
        let colour = self.in_pipeline(local.colour);
        match is_phong {
            true => self.row("C_P = C L", &colour),
            false => self.row("colour", &colour),
        }
        if let Some(glaze) = &local.glaze {
            let [own, weight] = glaze.weights;
            let (mirrored, colour) = (self.in_pipeline(glaze.mirrored), self.in_pipeline(glaze.colour));
            self.row("C_I", &format!("{mirrored}  the mirrored colour: the ray below"));
            self.row("glazed C_P", &format!("{colour}  {own} C_P + {weight} C_I"));
        }
    }

    fn path(&mut self, path: &PathReport, shadow_rays: &[ShadowRayReport]) {
        self.row("throughput", &light(path.throughput));
        if let Some(emission) = &path.emission {
            self.row(
                "finds L_e",
                &format!("{}, MIS weight {}", light(emission.radiance), digits(emission.weight)),
            );
            self.row("  adds", &light(emission.adds));
        }
        // Those of light samples are last.
        let others = shadow_rays.len().saturating_sub(path.light_samples.len());
        let (others, tests) = shadow_rays.split_at(others);
        others.iter().for_each(|ray| self.shadow_ray(&format!("{} ray", ray.kind), ray));
        for (sample, ray) in path.light_samples.iter().zip(tests) {
            let found = &sample.sample;
            self.row("light sample", &(self.name)(&sample.light));
            self.row("  L", &format!("{}, density {}", light(found.radiance), pdf(found.pdf)));
            self.row("  BSDF x cos", &format!("{}, density {}", light(found.bsdf), pdf(found.bsdf_pdf)));
            self.row("  MIS weight", &digits(found.weight));
            self.shadow_ray("  shadow ray", ray);
            self.row("  adds", &light(found.adds));
        }
        if let Some(bsdf) = &path.bsdf_sample {
            if let Some(sample) = &bsdf.sample {
                let weight = light(sample.weight);
                self.row(
                    "BSDF sample",
                    &format!("density {}, BSDF x cos / density {weight}", pdf(sample.pdf)),
                );
            }
            if let Some(roulette) = &bsdf.roulette {
                let (number, probability) = (digits(roulette.number), digits(roulette.probability));
                self.row("roulette", &format!("number {number}, goes on below {probability}"));
            }
        }
        if let Some(end) = path.end {
            self.row("path ends", end);
        }
    }

    fn colour(&mut self, report: &PixelReport) {
        let ColourReport { filtered, film, exposure, exposed, tone_map, tone_mapped, encoded, .. } =
            &report.colour;
        self.line(0, &format!("\npixel, colour pipeline {}", self.pipeline));
        if let Some(filter) = &report.filter {
            let (taken, shape, radius) = (report.samples_taken, filter.shape, digits(filter.radius));
            self.row("samples", &format!("{taken}, filter {shape} of radius {radius}"));
        }
        if let Some(sample) = report.samples.first().filter(|_| report.samples_taken > 1) {
            let colour = self.in_pipeline(wide(sample.colour));
            self.row(&format!("sample {}", sample.index), &format!("{colour}, weight {}", sample.weight));
        }
        let colour = self.in_pipeline(wide(*filtered));
        self.row(if report.samples_taken > 1 { "filtered mean" } else { "colour" }, &colour);
        if let Some(noise) = &report.noise {
            let error = self.of_255(noise.standard_error);
            self.row("standard error", &error);
        }
        match film {
            Some(film) if film != filtered => {
                let colour = self.in_pipeline(wide(*film));
                self.row("composited", &colour);
            }
            Some(_) => {}
            None => self.row("composited", "displayed colours, past exposure and tone map"),
        }
        if let (true, Some(exposed)) = (*exposure != 0.0, exposed) {
            self.row("exposed", &format!("{}, by {} EV", vector(*exposed), digits(*exposure)));
        }
        if *tone_map != "none" {
            self.row("tone mapped", &format!("{}, by {tone_map}", vector(*tone_mapped)));
        }
        if self.pipeline == ColourPipeline::Linear.name() {
            self.row("encoded", &format!("{}, by the sRGB curve", vector(*encoded)));
        }
        let [r, g, b] = report.displayed;
        self.row("displayed", &format!("{r}  {g}  {b}"));
        if let Some(alpha) = report.alpha {
            self.row("alpha", &alpha.to_string());
        }
    }
}
