//! The plan: which effects there are to compute, and the stages that compute them, in the order they run.

use std::ops::Range;

use super::tile::{Context, Tile};
use super::{
    Asked, Depth, EFFECTS, Effect, Hook, Outline, Pictures, RayKind, Stage, Value, film, leave, local,
    primary, visible,
};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::scene::Sampling;
use crate::scene::file::{EffectsSection, nearest_name};
use crate::shading::ShadingMode;
use crate::world::World;

/// Effects that mean nothing without another: each with that one.
const BUILDS_ON: &[(&str, &str)] = &[("adaptive", "antialiasing")];

/// What the user asks for, over what the scene says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choices {
    /// How far shading goes.
    pub shading: ShadingMode,
    /// How often and where pixels are sampled.
    pub sampling: Sampling,
    /// What the scene file says of effects.
    pub scene: EffectsSection,
    /// Effects to have, each as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects to do without.
    pub without: Vec<String>,
    /// Whether effects to have get their stages also where there is nothing for them to do. The picture is the same.
    pub even_idle: bool,
}

/// Whether an effect is computed, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decision {
    /// The effect's name.
    pub effect: &'static str,
    /// Whether it is computed.
    pub on: bool,
    /// What calls for it, or what keeps it off.
    pub why: String,
    /// The value that it was given.
    pub value: Option<String>,
}

/// A stage, and whose it is.
pub struct Step {
    /// What is done.
    pub stage: Box<dyn Stage>,
    /// The effect that it is there for; `None` for what every picture takes.
    pub effect: Option<&'static str>,
}

/// The stages that a picture takes, in order.
pub struct Plan {
    /// How far shading goes.
    pub shading: ShadingMode,
    /// How pixels are sampled.
    pub sampling: Sampling,
    /// What was decided of each effect.
    pub decisions: Vec<Decision>,
    /// Whether an effect makes the camera's rays.
    own_rays: bool,
    steps: Vec<Step>,
    /// Those of the first level, those of every further one, those on the way back, and those of the film.
    parts: [Range<usize>; 4],
}

impl Plan {
    /// Decides which effects there is anything to do for, and lists the stages.
    ///
    /// # Errors
    /// [`Error::Usage`] for an effect that does not exist or is both asked for and not, [`Error::Input`] where a scene file names
    /// one that does not exist.
    pub fn new(world: &World, choices: &Choices) -> Result<Plan> {
        check_names(&choices.with, &choices.without)?;
        check_scene(&choices.scene)?;
        let mut decisions: Vec<Decision> =
            EFFECTS.iter().map(|effect| decide(effect, world, choices)).collect();
        for (effect, base) in BUILDS_ON.iter().filter(|_| !choices.even_idle) {
            let stands = decisions.iter().any(|d| d.effect == *base && d.on);
            for decision in decisions.iter_mut().filter(|d| d.effect == *effect && d.on && !stands) {
                (decision.on, decision.why) = (false, format!("there is no {base}"));
            }
        }
        Ok(Plan::of(world, choices.shading, choices.sampling, decisions))
    }

    /// This plan with those effects only that `keep` accepts by their index in [`Plan::decisions`].
    pub fn keeping(&self, world: &World, keep: impl Fn(usize) -> bool) -> Plan {
        let mut decisions = self.decisions.clone();
        decisions.iter_mut().enumerate().for_each(|(i, decision)| decision.on &= keep(i));
        Plan::of(world, self.shading, self.sampling, decisions)
    }

    /// The plan that follows from decisions about each of [`EFFECTS`].
    fn of(world: &World, shading: ShadingMode, sampling: Sampling, decisions: Vec<Decision>) -> Plan {
        let outline = Outline {
            shading,
            lit: shading.uses_lights() && !world.lights.is_empty(),
            samples: 1,
            pictures: Pictures::default(),
            smooth: false,
            shadow_rays: false,
            leaving: 0,
            further: None,
            own_rays: false,
            adaptive: false,
        };
        let mut asked: Vec<(&Effect, Asked)> = Vec::new();
        let mut made = outline;
        for (effect, decision) in EFFECTS.iter().zip(&decisions).filter(|(_, decision)| decision.on) {
            let own = Asked { world, sampling: &sampling, outline: made, value: decision.value.clone() };
            (effect.outline)(&own, &mut made);
            asked.push((effect, own));
        }
        asked.iter_mut().for_each(|(_, own)| own.outline = made);
        let mut list = List { steps: Vec::new(), asked, outline: made };
        if !made.own_rays {
            list.add(primary::Primary, None);
        }
        list.hook(Hook::Rays);
        let parts = list.fill();
        let steps = list.steps;
        Plan { shading, sampling, decisions, own_rays: made.own_rays, steps, parts }
    }

    /// Does all the work on a tile that was started, and calls `done` with the index of each step that is.
    #[inline]
    pub fn run(&self, tile: &mut Tile, context: &Context, mut done: impl FnMut(usize)) {
        let [first, further, back, film] = &self.parts;
        let mut each = |part: &Range<usize>, tile: &mut Tile| {
            for index in part.clone() {
                self.steps[index].stage.run(tile, context);
                done(index);
            }
        };
        each(first, tile);
        while !further.is_empty() && tile.descend() {
            each(further, tile);
        }
        while tile.ascend() {
            each(back, tile);
        }
        each(film, tile);
    }

    /// Makes the rays through the centres of a tile's pixels, and nothing else, whatever rays the picture takes: on the first level
    /// of a tile that was started.
    pub fn centre_rays(&self, tile: &mut Tile, context: &Context) {
        primary::Primary.run(tile, context);
    }

    /// Finds how many samples each pixel of a tile takes: by taking them, where it is not one.
    pub fn samples(&self, tile: &mut Tile, context: &Context, window: Window) -> Vec<u32> {
        tile.start(window);
        if self.own_rays {
            self.run(tile, context, |_| {});
            while tile.again {
                self.run(tile, context, |_| {});
            }
        }
        if tile.taken.is_empty() { vec![1; window.area()] } else { tile.taken.clone() }
    }

    /// The steps in the order they run; those of further levels run once for each.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The names of the effects that are computed.
    pub fn effects_on(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.decisions.iter().filter(|d| d.on).map(|d| d.effect)
    }
}

/// A plan in the making.
struct List<'a> {
    steps: Vec<Step>,
    asked: Vec<(&'static Effect, Asked<'a>)>,
    outline: Outline,
}

impl List<'_> {
    fn fill(&mut self) -> [Range<usize>; 4] {
        let mut end = 0;
        let mut part = |list: &Self| {
            let start = std::mem::replace(&mut end, list.steps.len());
            start..end
        };
        self.level(Depth::First);
        let first = part(self);
        if self.outline.further.is_some() {
            self.level(Depth::Further);
        }
        let further = part(self);
        self.hook(Hook::AfterLevels);
        let back = part(self);
        self.add(film::Expose, None);
        self.hook(Hook::Film);
        [first, further, back, part(self)]
    }

    fn level(&mut self, depth: Depth) {
        let Outline { shading, lit, smooth, leaving, further, .. } = self.outline;
        let further = further.filter(|_| depth == Depth::Further);
        let owner = further.map(|further| further.effect);
        let kind = further.map_or(RayKind::PRIMARY, |further| further.kind);
        let name = further.map_or("primary hits", |further| further.hits);
        self.add(visible::Visible { kind, name }, owner);
        if leaving > u32::from(depth == Depth::Further) {
            self.add(leave::Origins { levels: leaving }, owner);
        }
        self.hook(Hook::BeforeLighting(depth));
        if lit {
            self.add(local::Illuminate { smooth, mode: shading }, owner);
            self.hook(Hook::AfterLighting(depth));
        }
        self.add(local::Shade { mode: shading }, owner);
        self.hook(Hook::AfterShading(depth));
    }

    fn add(&mut self, stage: impl Stage + 'static, effect: Option<&'static str>) {
        self.steps.push(Step { stage: Box::new(stage), effect });
    }

    fn hook(&mut self, hook: Hook) {
        for (effect, asked) in &self.asked {
            let stages = (effect.stages)(asked, hook).into_iter();
            self.steps.extend(stages.map(|stage| Step { stage, effect: Some(effect.name) }));
        }
    }
}

/// The name and the value of what was typed as `NAME` or `NAME=VALUE`.
fn name_and_value(typed: &str) -> (&str, Option<&str>) {
    typed.split_once('=').map_or((typed, None), |(name, value)| (name, Some(value)))
}

/// The effect of this name.
fn find(name: &str) -> std::result::Result<&'static Effect, String> {
    let known: Vec<&str> = EFFECTS.iter().map(|effect| effect.name).collect();
    EFFECTS.iter().find(|effect| effect.name == name).ok_or_else(|| nearest_name(name, &known))
}

/// Whether an effect can use a value; what is wrong and what to do about it where not.
fn check_value(effect: &Effect, value: &str) -> std::result::Result<(), (String, String)> {
    let name = effect.name;
    match &effect.value {
        None => Err((format!("`{name}` takes no value, and `{value}` was given"), "leave it out".into())),
        Some(Value { meaning, check }) => check(value).map_err(|what| {
            (format!("`{value}` cannot be the {meaning} of `{name}`: {what}"), String::new())
        }),
    }
}

/// Whether every name of `--with` and `--without` is that of an effect, and none is in both.
///
/// # Errors
/// [`Error::Usage`] for the first that is not, with the nearest one that is.
pub fn check_names(with: &[String], without: &[String]) -> Result<()> {
    for typed in with.iter().chain(without) {
        let (name, value) = name_and_value(typed);
        let effect = find(name).map_err(|hint| Error::usage(format!("there is no effect `{name}`"), hint))?;
        if let Some(value) = value {
            check_value(effect, value).map_err(|(what, hint)| Error::usage(what, hint))?;
        }
    }
    if let Some(typed) = without.iter().find(|typed| typed.contains('=')) {
        let name = name_and_value(typed).0;
        let hint = format!("ask for `--without {name}`, or for another value by `--with`");
        return Err(Error::usage(format!("`{typed}` is a value to do without"), hint));
    }
    match with.iter().find(|typed| without.iter().any(|other| other == name_and_value(typed).0)) {
        Some(both) => Err(Error::usage(format!("both with and without `{both}`"), "ask for one of the two")),
        None => Ok(()),
    }
}

/// Whether every key of a scene file's `[effects]` is an effect.
///
/// # Errors
/// [`Error::Input`] for the first that is not, with the nearest one that is.
pub fn check_scene(scene: &EffectsSection) -> Result<()> {
    for (name, said, place) in scene.iter() {
        let fail = |what: String, hint: String| match place {
            Some(place) => Error::input(place.clone(), what, hint),
            None => Error::usage(what, hint),
        };
        let effect = find(name).map_err(|hint| fail(format!("unknown key `{name}`"), hint))?;
        if let Some(value) = said.value() {
            check_value(effect, &value).map_err(|(what, hint)| fail(what, hint))?;
        }
    }
    Ok(())
}

/// The user's word first, then the scene's, then the shading mode's, then what there is to do. An effect with nothing
/// to do stays off whoever asks: it could not change the picture.
fn decide(effect: &Effect, world: &World, choices: &Choices) -> Decision {
    let name = effect.name;
    let said = choices.scene.get(name);
    let asked_for = choices.with.iter().map(|typed| name_and_value(typed)).rfind(|(n, _)| *n == name);
    let value = asked_for.and_then(|(_, value)| Some(value?.to_owned()));
    let value = value.or_else(|| said.and_then(|said| said.value()));
    let decision = |on, why: String| Decision { effect: name, on, why, value: value.clone() };
    let calls = match (effect.called_for)(world, &choices.sampling) {
        Err(nothing) if choices.even_idle && asked_for.is_some() => {
            return decision(true, format!("--with {name}, though {nothing}"));
        }
        Err(nothing) => return decision(false, nothing),
        Ok(calls) => calls,
    };
    if !choices.shading.uses_lights() && effect.needs_lights {
        return decision(false, format!("{} shading has no lights", choices.shading.name()));
    }
    if choices.without.iter().any(|n| n == name) {
        return decision(false, format!("--without {name}"));
    }
    if asked_for.is_some() {
        return decision(true, format!("--with {name}; {calls}"));
    }
    match said.map(|said| said.is_on()) {
        Some(false) => return decision(false, "the scene file turns it off".into()),
        Some(true) => return decision(true, format!("the scene file turns it on; {calls}")),
        None => {}
    }
    if effect.is_shading && choices.shading < ShadingMode::Phong {
        return decision(false, format!("--shading {} shows that term alone", choices.shading.name()));
    }
    decision(true, calls)
}
