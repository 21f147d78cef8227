//! What rendered pictures warn of: single ones, and those of an animation together.

use std::path::PathBuf;
use std::sync::Arc;

use crate::effects::RayKind;
use crate::error::{Result, Warnings};
use crate::farm::Shard;
use crate::film::write::OutputImage;
use crate::job::messages::notes;
use crate::job::{RenderControl, RenderJob};
use crate::render::Statistics;
use crate::render::aov::{AovSelection, LARGEST_EXACT_INDEX};
use crate::scene::is_named;

/// What a picture was made of, for its messages.
#[derive(Default)]
pub(crate) struct Source {
    pub(crate) inputs: Vec<PathBuf>,
    pub(crate) has_physical_lights: bool,
    /// The object that the camera was fitted to.
    pub(crate) look_at: Option<String>,
}

/// Places of pixels in a warning.
const PLACES: usize = 10;

/// What rendered pictures of a scene warn of.
pub struct Findings {
    /// The number of the picture, and of pictures.
    frame: Option<i32>,
    is_series: bool,
    /// The number of non-finite pixels, where the first are, and in which frame.
    non_finite: (usize, String, Option<i32>),
    discarded_samples: u64,
    /// Camera rays, and how many of them hit something.
    rays: [u64; 2],
    /// Whether light is blocked everywhere, and what is seen nowhere; not of parts of pictures, which may be empty.
    is_part: bool,
    has_objects: bool,
    is_dark: bool,
    unseen: Vec<Unseen>,
    /// An exposure for a picture that is clipped.
    exposure: Option<f64>,
    /// Warnings and notes of the first picture alone.
    of_first: Warnings,
    source: Arc<Source>,
}

/// What a picture should show and does not.
#[derive(PartialEq)]
enum Unseen {
    /// An input, by its index.
    Input(usize),
    /// The object that the camera frames.
    Object(String),
}

impl Findings {
    /// Those of a picture that was rendered.
    pub fn new(job: &RenderJob, statistics: &Statistics) -> Self {
        let RenderJob { world, settings, source, .. } = job;
        let Statistics { non_finite, discarded_samples, visible_objects, .. } = statistics;
        let places: Vec<String> =
            non_finite.iter().take(PLACES).map(|(x, y)| format!("({x}, {y})")).collect();
        let primary = statistics.rays(RayKind::PRIMARY);
        let mut shadow = statistics.rays.iter().filter(|(kind, _)| kind.is_shadow);
        let is_seen = |is_it: &dyn Fn(usize) -> bool| {
            visible_objects.iter().enumerate().any(|(index, is_seen)| *is_seen && is_it(index))
        };
        let has_input = |input: usize| world.objects.iter().any(|object| object.input == input);
        let inputs = 0..if source.inputs.len() > 1 { source.inputs.len() } else { 0 };
        let inputs = inputs
            .filter(|&input| has_input(input) && !is_seen(&|index| world.objects[index].input == input));
        let object = source
            .look_at
            .iter()
            .filter(|name| !is_seen(&|index| is_named(&world.objects[index].name, name)));
        let mut of_first = Warnings::default();
        notes::notes_of_result(job, statistics).for_each(|note| of_first.note(note));
        warn_of_indices(job, &mut of_first);
        Findings {
            frame: None,
            is_series: false,
            non_finite: (non_finite.len(), format!("at {}", places.join(" ")), None),
            discarded_samples: *discarded_samples,
            rays: [primary.cast, primary.hit],
            is_part: settings.crop.is_some() || settings.shard != Shard::ALL,
            has_objects: world.primitive_count() > 0,
            is_dark: world.fill.is_none()
                && shadow.any(|(_, count)| count.cast > 0 && count.hit == count.cast),
            unseen: inputs.map(Unseen::Input).chain(object.cloned().map(Unseen::Object)).collect(),
            exposure: None,
            of_first,
            source: Arc::clone(source),
        }
    }

    /// Those of a picture that was rendered, with whether lights in physical units clip it, which takes a small render.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn of(
        job: &RenderJob,
        picture: &OutputImage,
        statistics: &Statistics,
        control: &RenderControl,
    ) -> Result<Self> {
        let exposure = match job.source.has_physical_lights {
            true => job.exposure_for_clipped(picture, control)?,
            false => None,
        };
        Ok(Findings { exposure, ..Findings::new(job, statistics) })
    }

    /// The same, of a frame of an animation.
    pub fn of_frame(self, frame: i32) -> Self {
        let non_finite = (self.non_finite.0, format!("in frame {frame}"), Some(frame));
        Findings { frame: Some(frame), is_series: true, non_finite, ..self }
    }

    /// Adds those of another frame. What is in some frames is not missed in others; exposure and notes are those of the first.
    pub fn add(&mut self, other: Findings) {
        let (own, count, [cast, hit]) = (self.non_finite.0, other.non_finite.0, other.rays);
        if own == 0 || count > 0 && other.non_finite.2 < self.non_finite.2 {
            self.non_finite = other.non_finite;
        }
        self.non_finite.0 = own + count;
        if other.frame < self.frame {
            (self.frame, self.exposure) = (other.frame, other.exposure);
            self.of_first = other.of_first;
        }
        self.has_objects |= other.has_objects;
        self.discarded_samples += other.discarded_samples;
        self.rays = [self.rays[0] + cast, self.rays[1] + hit];
        self.is_dark &= other.is_dark;
        self.unseen.retain(|one| other.unseen.contains(one));
    }

    /// Adds the warnings and notes.
    pub fn warn(&self, warnings: &mut Warnings) {
        if let Some(ev) = self.exposure {
            warnings.push(format!(
                "most of the picture is clipped, because lights are in physical units; try `--exposure {ev}`"
            ));
        }
        warnings.extend(&self.of_first);
        if let (count @ 1.., places, _) = &self.non_finite {
            warnings.push(format!("{count} pixel(s) are not finite numbers, the first {places}"));
        }
        if let count @ 1.. = self.discarded_samples {
            warnings.push(format!("{count} sample(s) of light are not finite numbers and were left out"));
        }
        let (place, [cast, hit]) = (if self.is_series { "any frame" } else { "the picture" }, self.rays);
        if self.is_part {
            return;
        }
        if !self.has_objects {
            warnings.push(format!("nothing is in {place}: the scene has no triangles, spheres or disks"));
            return;
        }
        if hit == 0 {
            warnings.push(format!(
                "nothing is in {place}: none of {cast} primary rays hits anything; try `--camera auto`"
            ));
            return;
        }
        if self.is_dark {
            warnings.push("no light reaches any visible surface: every shadow ray is blocked");
        }
        for unseen in &self.unseen {
            warnings.push(match unseen {
                Unseen::Input(index) => format!(
                    "{} is nowhere in {place}; place it with [[mesh]] in a scene file, or try `--camera auto`",
                    self.source.inputs[*index].display()
                ),
                Unseen::Object(name) => {
                    format!("`{name}` is hidden by other objects; try another --view or --azimuth")
                }
            });
        }
    }
}

/// Warns of indices that channels of AOVs cannot hold.
pub fn warn_of_indices(job: &RenderJob, warnings: &mut Warnings) {
    let selects = || AovSelection::new(&job.settings.aovs).is_ok_and(|selection| selection.has_primitives());
    if job.world.primitive_count() > LARGEST_EXACT_INDEX && selects() {
        warnings.push(format!("--aov primitive: indices above {LARGEST_EXACT_INDEX} are rounded"));
    }
}
