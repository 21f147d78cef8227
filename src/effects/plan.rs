//! The plan: which effects are computed, and the list of stages that computes them.

use std::ops::Range;

use super::bounce_limits::BounceLimits;
use super::samples::TileSamples;
use super::tile::{RenderContext, Tile};
use super::transparency::{Transparency, closest_visible};
use super::variance::PixelStatistics;
use super::{
    EFFECTS, Effect, EffectContext, EffectId, EffectValue, Hook, LightTechnique, PathSettings, PlanSpec,
    RayClass, RayKind, Stage, TRANSPORTS, TransportEntry, closest_hits, primary_rays, ray_origins, unlit,
};
use crate::bvh::detail::{HitBuffer, Rays};
use crate::bvh::{Hit, Ray, Traversal};
use crate::error::{Error, Result, ended, nearest_name};
use crate::film::Window;
use crate::scene::EffectsSection;
use crate::scene::{Sampling, Transport};
use crate::shading::ShadingMode;
use crate::world::{HitOrder, World};

/// What a plan is made from, beside the world.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanSettings {
    /// Which terms are shaded.
    pub shading: ShadingMode,
    /// How often and where pixels are sampled.
    pub sampling: Sampling,
    /// The scene file's section on effects.
    pub scene: EffectsSection,
    /// The transport that is asked for; `None` leaves it to the scene.
    pub transport: Option<Transport>,
    /// Largest radiance that a path adds by indirect light; none if `None`.
    pub clamp: Option<f64>,
    /// Whether camera rays pass through back faces of single-sided materials.
    pub cull: bool,
    /// The lens of the camera, as text; `None` for a pinhole. Must be set with [`crate::world::View::set_lens`], since
    /// [`World`] has no cameras.
    pub lens: Option<String>,
    /// Effects that the user asks for, each as `NAME` or `NAME=VALUE`.
    pub with: Vec<String>,
    /// Effects that the user excludes.
    pub without: Vec<String>,
    /// Entry of `with` that another option adds, such as `--depth`, and that option as typed, for messages.
    pub stand_in: Option<(String, String)>,
    /// Whether effects in `with` get their stages also where nothing calls for them, which does not change the picture.
    pub force_stages: bool,
    /// Which samples of light count in path tracing.
    #[doc(hidden)]
    pub light_technique: LightTechnique,
    /// How paths are estimated.
    pub path: PathSettings,
}

impl PlanSettings {
    /// Whether options or the scene turn an effect on or off, and the value that they give it.
    pub fn switch(&self, effect: EffectId) -> (Option<bool>, Option<String>) {
        let said = self.scene.get(effect.name());
        let asked_for =
            self.with.iter().map(|typed| name_and_value(typed)).rfind(|(n, _)| *n == effect.name());
        let value = asked_for.and_then(|(_, value)| Some(value?.to_owned()));
        let value = value.or_else(|| said.and_then(|said| said.value()));
        let is_off = self.without.iter().any(|name| name == effect.name());
        let on = if is_off { Some(false) } else { asked_for.map(|_| true).or(said.map(|said| said.is_on())) };
        (on, value)
    }

    /// The last option that turns the effect on, as typed; `None` without one.
    pub fn option_of(&self, effect: EffectId) -> Option<String> {
        let typed = self.with.iter().rfind(|typed| name_and_value(typed).0 == effect.name())?;
        let stand_in = self.stand_in.as_ref().filter(|(entry, _)| entry == typed);
        Some(stand_in.map_or_else(|| format!("--with {typed}"), |(_, option)| option.clone()))
    }
}

/// Whether an effect is computed, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decision {
    /// The effect.
    pub effect: EffectId,
    /// Whether it is computed.
    pub on: bool,
    /// What calls for it, or why it is off.
    pub why: String,
    /// The value that it was given.
    pub value: Option<String>,
}

/// A stage of a plan.
pub struct PlannedStage {
    /// The stage.
    pub stage: Stage,
    /// The effect that needs it; `None` for the stages of every picture.
    pub effect: Option<EffectId>,
}

/// The stages of a picture, in order.
pub struct Plan {
    /// Which terms are shaded.
    pub shading: ShadingMode,
    /// How pixels are sampled.
    pub sampling: Sampling,
    /// Largest radiance that a path adds by indirect light.
    clamp: Option<f64>,
    /// The decision on each of [`EFFECTS`].
    pub decisions: Vec<Decision>,
    /// The transport.
    pub transport: Transport,
    spec: PlanSpec,
    /// Whether camera rays pass through back faces.
    culls: bool,
    stages: Vec<PlannedStage>,
    /// The stages of the first generation, of each further generation, of the way back, and of the film.
    parts: [Range<usize>; 4],
}

impl Plan {
    /// Decides which effects are computed, and lists the stages.
    ///
    /// # Errors
    /// [`Error::Usage`] for an effect that does not exist or is both asked for and excluded, [`Error::Input`] where a scene file
    /// names one that does not exist.
    pub fn new(world: &World, plan_settings: &PlanSettings) -> Result<Plan> {
        check_names(&plan_settings.with, &plan_settings.without)?;
        check_scene(&plan_settings.scene)?;
        let mut decisions: Vec<Decision> =
            EFFECTS.iter().map(|effect| decide(effect, world, plan_settings)).collect();
        let transport = transport_of(&decisions);
        for other in TRANSPORTS.iter().filter(|other| other.transport != transport.transport) {
            let is_other = |decision: &Decision| {
                other.effects.contains(&decision.effect)
                    || decision.on && other.switch == Some(decision.effect)
            };
            for decision in decisions.iter_mut().filter(|decision| is_other(decision)) {
                (decision.on, decision.why) = (false, transport.reason.into());
            }
        }
        for (i, effect) in EFFECTS.iter().enumerate().filter(|_| !plan_settings.force_stages) {
            let Some(base) = effect.builds_on else { continue };
            if decisions[i].on && !decisions.iter().any(|d| d.effect == base && d.on) {
                (decisions[i].on, decisions[i].why) = (false, format!("there is no {base}"));
            }
        }
        let PlanSettings { shading, sampling, light_technique, clamp, path, .. } = *plan_settings;
        let culls = plan_settings.cull && world.has_single_sided();
        Ok(Plan::of(world, (shading, light_technique, path), (sampling, clamp, culls), decisions))
    }

    /// This plan with only those effects that `keep` accepts by their index in [`Plan::decisions`].
    pub fn keeping(&self, world: &World, keep: impl Fn(usize) -> bool) -> Plan {
        let mut decisions = self.decisions.clone();
        decisions.iter_mut().enumerate().for_each(|(i, decision)| decision.on &= keep(i));
        let shading = (self.shading, self.spec.light_technique, self.spec.path);
        Plan::of(world, shading, (self.sampling, self.clamp, self.culls), decisions)
    }

    /// The plan for a decision on each of [`EFFECTS`].
    fn of(
        world: &World,
        (shading, light_technique, path): (ShadingMode, LightTechnique, PathSettings),
        (sampling, clamp, culls): (Sampling, Option<f64>, bool),
        decisions: Vec<Decision>,
    ) -> Plan {
        let entry = transport_of(&decisions);
        let mut spec = PlanSpec { shading, samples: 1, light_technique, path, ..PlanSpec::default() };
        spec.texture_use.transport = Some(entry.transport);
        let on = EFFECTS.iter().zip(&decisions).filter(|(_, decision)| decision.on);
        let effects = on.map(|(effect, decision)| (Some(decision), effect.specify, effect.stages));
        let switch = decisions.iter().find(|decision| entry.switch == Some(decision.effect));
        let mut contributors = Vec::new();
        for (decision, specify, stages) in
            std::iter::once((switch, entry.specify, entry.stages)).chain(effects)
        {
            let value = decision.and_then(|decision| decision.value.clone());
            let context = EffectContext { world, sampling: &sampling, clamp, spec, value };
            specify(&context, &mut spec);
            contributors.push(Contributor { effect: decision.map(|d| d.effect), stages, context });
        }
        contributors.iter_mut().for_each(|contributor| contributor.context.spec = spec);
        let transparency = spec.transparency(&sampling);
        let of_camera_rays = if culls { Some(Transparency::culling(transparency)) } else { transparency };
        let mut builder =
            PlanBuilder { world, stages: Vec::new(), contributors, spec, transparency, of_camera_rays };
        let parts = builder.build();
        let (stages, transport) = (builder.stages, entry.transport);
        Plan { shading, sampling, clamp, decisions, transport, spec, culls, stages, parts }
    }

    /// Runs all stages on a tile that was started. Calls `done` with the index of each stage after it ran.
    #[inline]
    pub fn run(&self, tile: &mut Tile, context: &RenderContext, mut done: impl FnMut(usize, &Tile)) {
        let [first, secondary, back, film] = &self.parts;
        let mut each = |part: &Range<usize>, tile: &mut Tile| {
            for index in part.clone() {
                self.stages[index].stage.run(tile, context);
                done(index, tile);
            }
        };
        each(first, tile);
        while !secondary.is_empty() && tile.descend(!back.is_empty()) {
            each(secondary, tile);
        }
        while tile.ascend() {
            each(back, tile);
        }
        each(film, tile);
    }

    /// Whether a stage, by its index, is the last of the camera rays: their surfaces are shaded, and still in the tile.
    pub fn ends_camera_rays(&self, stage: usize) -> bool {
        stage + 1 == self.parts[0].end
    }

    /// Fills generation 0 of a tile that was started with the rays through the centres of its pixels, whatever rays the picture
    /// takes.
    pub fn centre_rays(&self, tile: &mut Tile, context: &RenderContext) {
        primary_rays::fill(tile, context);
    }

    /// Renders a tile. Returns the number of samples that each pixel takes, and their variance. Each time the stages
    /// have run, calls `after_pass` with what `camera_rays` returned when these were shaded.
    pub fn sample_statistics<T: Default>(
        &self,
        tile: &mut Tile,
        context: &RenderContext,
        window: Window,
        camera_rays: impl Fn(&Tile) -> T,
        mut after_pass: impl FnMut(&mut Tile, T),
    ) -> Vec<PixelStatistics> {
        tile.start(window);
        let takes_samples = self.takes_samples();
        if takes_samples {
            tile.with_buffers(|samples: &mut TileSamples, _| samples.measure_variances(true));
        }
        loop {
            let mut found = T::default();
            self.run(tile, context, |stage, tile| {
                if self.ends_camera_rays(stage) {
                    found = camera_rays(tile);
                }
            });
            after_pass(tile, found);
            if !tile.needs_more_samples {
                break;
            }
        }
        if !takes_samples {
            return vec![PixelStatistics::of_one(); window.area()];
        }
        tile.with_buffers(|samples: &mut TileSamples, _| {
            let statistics = samples.variances().map(PixelStatistics::from).collect();
            samples.measure_variances(false);
            statistics
        })
    }

    /// The limits on the bounces of paths.
    pub fn bounce_limits(&self) -> BounceLimits {
        self.spec.bounce_limits
    }

    /// Whether an effect makes the camera rays, instead of one through each pixel's centre.
    pub fn takes_samples(&self) -> bool {
        self.spec.own_camera_rays
    }

    /// Closest hit of a camera ray on a surface that AOVs show: not culled, and with an opacity of at least 1/2.
    pub fn visible_hit(&self, world: &World, ray: &Ray, traversal: &mut Traversal) -> Option<Hit> {
        match self.spec.continued.is_some() || self.culls {
            true => closest_visible(world, ray, traversal, (self.culls, self.spec.texture_use.filter)),
            false => world.accelerator.closest_hit(ray, traversal),
        }
    }

    /// [`Plan::visible_hit`] of every ray, as a batch where nothing is transparent or culled.
    pub(crate) fn visible_hits(
        &self,
        world: &World,
        rays: Rays,
        hits: &mut HitBuffer,
        traversal: &mut Traversal,
    ) {
        if self.spec.continued.is_some() || self.culls {
            rays.iter().for_each(|ray| hits.push(self.visible_hit(world, &ray, traversal).as_ref()));
        } else {
            world.accelerator.closest_hits(rays, hits, traversal);
        }
    }

    /// The rays that a tile has cast, and those of them that were continued behind transparent surfaces.
    pub(crate) fn rays_cast(&self, tile: &Tile) -> [u64; 2] {
        let is_continued =
            |kind| self.spec.continued.is_some_and(|own| [own.rays, own.shadow_rays].contains(&kind));
        tile.rays.iter().fold([0; 2], |[all, continued], (kind, count)| {
            [all + count.cast, continued + if is_continued(*kind) { count.cast } else { 0 }]
        })
    }

    /// Whether the number of samples differs from pixel to pixel.
    pub fn is_adaptive(&self) -> bool {
        self.spec.adaptive
    }

    /// The stages in the order they run. Those of secondary rays run once per generation.
    pub fn stages(&self) -> &[PlannedStage] {
        &self.stages
    }

    /// The effects that are computed.
    pub fn effects_on(&self) -> impl Iterator<Item = EffectId> + '_ {
        self.decisions.iter().filter(|d| d.on).map(|d| d.effect)
    }
}

/// The transport, or an effect that is on.
struct Contributor<'a> {
    /// The effect that its stages are counted for.
    effect: Option<EffectId>,
    stages: fn(&EffectContext, Hook) -> Vec<Stage>,
    context: EffectContext<'a>,
}

/// Collects the stages of a plan.
struct PlanBuilder<'a> {
    world: &'a World,
    stages: Vec<PlannedStage>,
    contributors: Vec<Contributor<'a>>,
    spec: PlanSpec,
    transparency: Option<Transparency>,
    /// Transparency of camera rays.
    of_camera_rays: Option<Transparency>,
}

impl PlanBuilder<'_> {
    /// Lists all stages; returns [`Plan::parts`].
    fn build(&mut self) -> [Range<usize>; 4] {
        let mut end = 0;
        let mut part = |builder: &Self| {
            let start = std::mem::replace(&mut end, builder.stages.len());
            start..end
        };
        if !self.spec.own_camera_rays {
            self.add(Stage::new("primary", primary_rays::fill), None);
        }
        self.add_hook(Hook::Rays, None);
        self.add_generation(RayClass::Primary);
        if unlit::has_unlit(self.world) {
            self.add(Stage::new("unlit", unlit::find), None);
        }
        let first = part(self);
        if self.spec.secondary.is_some() {
            self.add_generation(RayClass::Secondary);
        }
        let secondary = part(self);
        self.add_hook(Hook::AfterGenerations, None);
        let back = part(self);
        self.add_hook(Hook::Film, None);
        [first, secondary, back, part(self)]
    }

    /// Adds the stages of a ray generation.
    fn add_generation(&mut self, class: RayClass) {
        let PlanSpec { lit, generations_with_origins: generations, secondary, .. } = self.spec;
        let secondary = secondary.filter(|_| class == RayClass::Secondary);
        let owner = secondary.map(|rays| rays.effect);
        let kind = secondary.map_or(RayKind::PRIMARY, |rays| rays.kind);
        let name = secondary.map_or("primary hits", |rays| rays.hits);
        let is_incoherent = secondary.is_some_and(|rays| !rays.are_mirrored);
        let order = if is_incoherent { HitOrder::Primitives } else { HitOrder::Rays };
        let transparency = match class {
            RayClass::Primary => self.of_camera_rays,
            RayClass::Secondary => self.transparency,
        };
        let stage = closest_hits::ClosestHits { kind, order, transparency };
        self.add(Stage::new(name, move |tile, context| stage.run(tile, context)), owner);
        if generations > u32::from(class == RayClass::Secondary) {
            self.add(ray_origins::stage(generations), owner);
        }
        self.add_hook(Hook::BeforeLighting(class), owner);
        if lit {
            self.add_hook(Hook::Lighting(class), owner);
            self.add_hook(Hook::AfterLighting(class), owner);
        }
        self.add_hook(Hook::Shading(class), owner);
        self.add_hook(Hook::AfterShading(class), owner);
    }

    fn add(&mut self, stage: Stage, effect: Option<EffectId>) {
        self.stages.push(PlannedStage { stage, effect });
    }

    /// Adds the stages of the transport and of all effects at a hook. `owner` is the effect that those of a transport
    /// without an effect are counted for.
    fn add_hook(&mut self, hook: Hook, owner: Option<EffectId>) {
        for Contributor { effect, stages, context } in &self.contributors {
            let effect = effect.or(owner);
            self.stages.extend(stages(context, hook).into_iter().map(|stage| PlannedStage { stage, effect }));
        }
    }
}

/// Splits `NAME` or `NAME=VALUE`.
fn name_and_value(typed: &str) -> (&str, Option<&str>) {
    typed.split_once('=').map_or((typed, None), |(name, value)| (name, Some(value)))
}

/// The effect of this name; `Err` with a hint at the nearest name, or at what serves instead.
fn find(name: &str) -> std::result::Result<&'static Effect, String> {
    let known: Vec<&str> = EFFECTS.iter().map(Effect::name).collect();
    let hint = || ended(name).map_or_else(|| nearest_name(name, &known), str::to_owned);
    EFFECTS.iter().find(|effect| effect.name() == name).ok_or_else(hint)
}

/// Checks the value of an effect; `Err` says what is wrong and what to do.
fn check_value(effect: &Effect, value: &str) -> std::result::Result<(), (String, String)> {
    let name = effect.id;
    match &effect.value {
        None => Err((format!("`{name}` takes no value, and `{value}` was given"), "leave it out".into())),
        Some(EffectValue { meaning, check, .. }) => check(value).map_err(|what| {
            (format!("`{value}` cannot be the {meaning} of `{name}`: {what}"), String::new())
        }),
    }
}

/// Checks that every name of `--with` and `--without` is that of an effect, and that none is in both.
///
/// # Errors
/// [`Error::Usage`] for the first that is not, with the nearest name.
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
        let hint = format!("give `--without {name}`, or another value by `--with`");
        return Err(Error::usage(format!("--without takes no value: `{typed}`"), hint));
    }
    match with.iter().find(|typed| without.iter().any(|other| other == name_and_value(typed).0)) {
        Some(both) => Err(Error::usage(format!("both with and without `{both}`"), "give one of the two")),
        None => Ok(()),
    }
}

/// Checks that every key of a scene file's `[effects]` is the name of an effect, and its values.
///
/// # Errors
/// [`Error::Input`] for the first that is not, with the nearest name.
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

/// The transport that some decisions call for.
fn transport_of(decisions: &[Decision]) -> &'static TransportEntry {
    let is_on = |effect| decisions.iter().any(|decision| decision.effect == effect && decision.on);
    let found = TRANSPORTS.iter().find(|entry| entry.switch.is_none_or(is_on));
    found.expect("the last transport needs no effect")
}

/// The transport of a picture, for the decisions on effects.
pub(super) fn transport_for(world: &World, plan_settings: &PlanSettings) -> &'static TransportEntry {
    let is_switch = |effect: &&Effect| TRANSPORTS.iter().any(|entry| entry.switch == Some(effect.id));
    let switches = EFFECTS.iter().filter(is_switch).map(|effect| decide(effect, world, plan_settings));
    transport_of(&switches.collect::<Vec<_>>())
}

/// Decides whether an effect is computed. In this order: it needs something that calls for it, `--without` and `--with`, the scene
/// file, the shading mode. An effect that nothing calls for stays off even if asked for: it could not change the picture.
fn decide(effect: &Effect, world: &World, plan_settings: &PlanSettings) -> Decision {
    let name = effect.name();
    let said = plan_settings.scene.get(name);
    let asked_for = plan_settings.option_of(effect.id);
    let (_, value) = plan_settings.switch(effect.id);
    let decision = |on, why: String| Decision { effect: effect.id, on, why, value: value.clone() };
    let calls = match (effect.called_for)(world, plan_settings) {
        Err(nothing) => {
            return match &asked_for {
                Some(option) if plan_settings.force_stages => {
                    decision(true, format!("{option}, though {nothing}"))
                }
                _ => decision(false, nothing),
            };
        }
        Ok(calls) => calls,
    };
    if !plan_settings.shading.uses_lights() && effect.needs_lights {
        return decision(false, format!("{} shading has no lights", plan_settings.shading.name()));
    }
    if plan_settings.without.iter().any(|n| n == name) {
        return decision(false, format!("--without {name}"));
    }
    if let Some(option) = asked_for {
        return decision(true, format!("{option}; {calls}"));
    }
    match said.map(|said| said.is_on()) {
        Some(false) => return decision(false, "the scene file turns it off".into()),
        Some(true) => return decision(true, format!("the scene file turns it on; {calls}")),
        None => {}
    }
    if effect.is_shading && plan_settings.shading < ShadingMode::Full {
        return decision(false, format!("{} shading shows that term alone", plan_settings.shading.name()));
    }
    decision(true, calls)
}
