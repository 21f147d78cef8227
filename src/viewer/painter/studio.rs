//! What the painter keeps from one picture to the next: worlds, and how long pixels take.

use std::sync::Arc;

use crate::animation::{FrameWorld, PreparedAnimation};
use crate::bvh::Layout;
use crate::effects::{Choices, Decision, EFFECTS, Plan};
use crate::error::{Error, Result};
use crate::film::ColourPipeline;
use crate::job::RenderJob;
use crate::scene::{Camera, Numerics, Sampling, Scene};
use crate::viewer::false_colour::Shown;
use crate::viewer::look::{From, Opened, Order, Settings};
use crate::viewer::refine::Kind;
use crate::world::{Recentering, StandardView, fitted_camera, headlight};

/// Worlds that are kept: those of two sides and of what they are held against.
const KEPT: usize = 3;

/// What a world depends on besides the scene.
type Key = (Numerics, ColourPipeline);

/// A scene that is ready for its picture.
pub struct Prepared {
    /// The picture with one sample a pixel, at its centre.
    pub job: RenderJob,
    /// The camera, in the scene's own coordinates.
    pub camera: Camera,
    /// What was decided of each effect, in the whole picture, and whether anything calls for it.
    pub decisions: Vec<(Decision, bool)>,
    /// How the picture's pixels are sampled in the end.
    pub kind: Kind,
}

/// What is kept.
#[derive(Default)]
pub struct Studio {
    opened: Option<Arc<Opened>>,
    animations: Vec<(Key, Arc<PreparedAnimation>)>,
    frames: Vec<(Key, f64, Arc<FrameWorld>)>,
    /// The scene moved as its worlds are, where it is.
    moved: Option<Arc<Scene>>,
    /// Cameras that fit, and the width by height of their pictures.
    fitted: Vec<(StandardView, f64, Camera)>,
    /// Seconds that a pixel takes, looked at once.
    seconds: Vec<(Shown, f64)>,
}

impl Studio {
    /// Whether there is a tree for every picture of an order.
    pub fn has_all(&self, order: &Order) -> bool {
        let same = self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &order.opened));
        let has = |settings: &Settings| self.animations.iter().any(|(key, _)| *key == key_of(settings));
        same && order.sides.iter().all(has)
    }

    /// Seconds that a pixel takes, looked at once, where that is known.
    pub fn seconds_a_pixel(&self, order: &Order) -> Option<f64> {
        self.seconds.iter().find(|(shown, _)| *shown == order.shown).map(|(_, seconds)| *seconds)
    }

    /// Learns how long a pixel takes. What else the machine does makes single times long: they count half.
    pub fn learn(&mut self, order: &Order, seconds: f64) {
        let seconds = self.seconds_a_pixel(order).map_or(seconds, |before| (before * seconds).sqrt());
        self.seconds.retain(|(shown, _)| *shown != order.shown);
        self.seconds.push((order.shown, seconds));
    }

    /// Makes a scene ready for a picture.
    pub fn prepare(&mut self, order: &Order, settings: &Settings) -> Result<Arc<Prepared>> {
        if !self.opened.as_ref().is_some_and(|opened| Arc::ptr_eq(opened, &order.opened)) {
            *self = Studio { opened: Some(Arc::clone(&order.opened)), ..Studio::default() };
        }
        let animation = self.animation(&order.opened, settings)?;
        let frame = self.frame(&animation, settings, order.time)?;
        let recentering = frame.recentering;
        let mut lens = match &order.from {
            From::Scene(index) => frame.cameras.get(*index).unwrap_or(&frame.camera).clone(),
            From::Fitted(view) => self.fit(order, *view, animation.range())?,
            From::Free(camera) => {
                recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved(camera))
            }
        };
        lens.projection = order.projection.unwrap_or(lens.projection);
        let mut world = Arc::clone(&frame.world);
        if world.lights.is_empty() && settings.choices.shading.uses_lights() {
            world = Arc::new(world.under(headlight(&lens).into_iter().collect()));
        }
        let sampling = settings.choices.sampling;
        let whole = Plan::new(&world, &settings.choices)?;
        let kind = match (whole.takes_samples(), whole.is_adaptive()) {
            (false, _) => Kind::Centres,
            (true, false) => Kind::Samples(sampling.max_samples()),
            (true, true) => Kind::Adaptive,
        };
        let decisions = EFFECTS.iter().zip(whole.decisions);
        let decisions = decisions
            .map(|(effect, decision)| (decision, (effect.called_for)(&world, &sampling).is_ok()))
            .collect();
        let camera = match &order.from {
            From::Free(camera) => Camera { projection: lens.projection, ..camera.clone() },
            _ => recentering.map_or_else(|| lens.clone(), |recentering| recentering.moved_back(&lens)),
        };
        let centres = Choices { sampling: Sampling::default(), ..settings.choices.clone() };
        let job = RenderJob::new(world, recentering, lens, order.size, centres)?;
        Ok(Arc::new(Prepared { job, camera, decisions, kind }))
    }

    fn animation(&mut self, opened: &Arc<Opened>, settings: &Settings) -> Result<Arc<PreparedAnimation>> {
        let key = key_of(settings);
        if let Some(at) = self.animations.iter().position(|(known, _)| *known == key) {
            let found = self.animations.remove(at);
            self.animations.push(found);
        } else {
            self.animations.drain(..self.animations.len().saturating_sub(KEPT - 1));
            let scene = opened.scene.clone();
            let camera = scene.cameras.first().cloned().unwrap_or_else(|| nowhere(&scene));
            let (pipeline, structure) = (settings.pipeline, Layout::Wide(opened.preset));
            let animation =
                PreparedAnimation::new(scene, &camera, false, pipeline, structure, settings.numerics)?;
            self.animations.push((key, Arc::new(animation)));
        }
        Ok(Arc::clone(&self.animations[self.animations.len() - 1].1))
    }

    fn frame(
        &mut self,
        animation: &PreparedAnimation,
        settings: &Settings,
        time: f64,
    ) -> Result<Arc<FrameWorld>> {
        let key = key_of(settings);
        let is_it = |(known, at, _): &(Key, f64, Arc<FrameWorld>)| (*known, *at) == (key, time);
        if let Some((_, _, frame)) = self.frames.iter().find(|frame| is_it(frame)) {
            return Ok(Arc::clone(frame));
        }
        self.frames.retain(|(known, ..)| *known != key);
        self.frames.drain(..self.frames.len().saturating_sub(KEPT - 1));
        let frame = Arc::new(animation.at(time)?);
        self.frames.push((key, time, Arc::clone(&frame)));
        Ok(frame)
    }

    /// A camera that fits the scene at rest, in the world's coordinates: as commands find it.
    fn fit(&mut self, order: &Order, view: StandardView, recentering: Option<Recentering>) -> Result<Camera> {
        let aspect = f64::from(order.size[0]) / f64::from(order.size[1]);
        if let Some((.., camera)) = self.fitted.iter().find(|(known, at, _)| (*known, *at) == (view, aspect))
        {
            return Ok(camera.clone());
        }
        if let (None, Some(recentering)) = (&self.moved, recentering) {
            let mut scene = order.opened.scene.clone();
            recentering.apply(&mut scene);
            self.moved = Some(Arc::new(scene));
        }
        let scene = self.moved.as_deref().unwrap_or(&order.opened.scene);
        let projection = order.projection.unwrap_or_default();
        let camera = fitted_camera(scene, view, aspect, projection).ok_or_else(|| Error::Failed {
            what: "there is nothing to look at".into(),
            hint: "`kiln info` says what the file holds".into(),
        })?;
        self.fitted.retain(|(known, ..)| *known != view);
        self.fitted.push((view, aspect, camera.clone()));
        Ok(camera)
    }
}

fn key_of(settings: &Settings) -> Key {
    (settings.numerics, settings.pipeline)
}

/// A camera for stages of scenes that have none. Nothing is seen by it.
fn nowhere(scene: &Scene) -> Camera {
    let (target, up) = (scene.bounds().map_or(glam::DVec3::ZERO, |(min, _)| min), glam::DVec3::Y);
    let back = target + glam::DVec3::Z * target.abs().max_element().max(1.0);
    Camera::from_field_of_view("none".into(), back, target, up, 1.0)
}
