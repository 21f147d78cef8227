//! Effects: the optional parts of rendering, each computed only where the scene calls for it.
//!
//! A picture is rendered by a list of [`Stage`]s over ray buffers (see [`tile::Tile`]). [`Plan::new`] makes the list from what
//! the scene calls for. An effect that nothing calls for has no stage, casts no ray and holds no memory.
//!
//! Each effect has one file and one line in `registry!`, which makes [`EFFECTS`]. Its file states what calls for it, what it
//! changes in the [`PlanSpec`], its stages at the [`Hook`]s, its ray kinds, and its buffers, which are kept in the tile by
//! [`tile::Tile::with_buffers`] and so exist only where the effect runs. A build without an effect:
//! `RUSTFLAGS='--cfg kiln_without="glaze"'`.
//!
//! A picture has one transport, which computes the light that surfaces send towards the camera. Each has one folder and
//! one line in `registry!`, which makes [`TRANSPORTS`]: [`whitted`] with the effects that only it has, and [`path`].

pub mod bounce_limits;
mod closest_hits;
pub mod convergence;
mod plan;
mod primary_rays;
pub mod random;
mod ray_origins;
pub mod record;
pub mod recorder;
pub mod region;
mod sample_pass;
pub mod samples;
mod shadow_catcher;
mod texture_points;
pub mod tile;
pub mod transparency;
pub(crate) mod unlit;
pub mod variance;
pub mod whitted;

pub use plan::{Decision, Plan, PlanSettings, PlannedStage, check_names, check_scene};
pub use ray_origins::shadow_ray;

use std::fmt;

use serde::Serialize;

use crate::scene::{Sampling, TextureFilter, Transport, ValueKind};
use crate::shading::ShadingMode;
use crate::world::World;
use bounce_limits::BounceLimits;
use tile::{RenderContext, Tile};
use transparency::{ContinuedRays, Transparency};

/// Declares the effects, in the order of the plan: name as typed by users, source file, constant in [`id`]. A transport
/// that calls for something is an effect, too. The modules of `FOLDER` are declared there.
macro_rules! registry {
    (
        effects { $($a:tt => $a_file:ident $a_id:ident,)* }
        transports { $($b:tt => $b_file:ident $b_id:ident,)* }
        $(in $folder:ident { $($c:tt => $c_file:ident $c_id:ident,)* })*
        effects { $($d:tt => $d_file:ident $d_id:ident,)* }
    ) => {
        $(#[cfg(not(kiln_without = $a))] pub mod $a_file;)*
        $(#[cfg(not(kiln_without = $b))] pub mod $b_file;)*
        $(#[cfg(not(kiln_without = $d))] pub mod $d_file;)*

        /// The ids of all effects, also of those that this build leaves out.
        pub mod id {
            use super::EffectId;
            $(#[doc = concat!("`", $a, "`")] pub const $a_id: EffectId = EffectId($a);)*
            $(#[doc = concat!("`", $b, "`")] pub const $b_id: EffectId = EffectId($b);)*
            $($(#[doc = concat!("`", $c, "`")] pub const $c_id: EffectId = EffectId($c);)*)*
            $(#[doc = concat!("`", $d, "`")] pub const $d_id: EffectId = EffectId($d);)*
        }

        /// All effects of this build, in the order of the plan: each may build on those before it.
        pub const EFFECTS: &[Effect] = &[
            $(#[cfg(not(kiln_without = $a))] $a_file::EFFECT,)*
            $(#[cfg(not(kiln_without = $b))] $b_file::EFFECT,)*
            $($(#[cfg(not(kiln_without = $c))] $folder::$c_file::EFFECT,)*)*
            $(#[cfg(not(kiln_without = $d))] $d_file::EFFECT,)*
        ];

        /// All transports of this build. A picture has the first that is called for; nothing has to call for the last.
        pub const TRANSPORTS: &[TransportEntry] =
            &[$(#[cfg(not(kiln_without = $b))] $b_file::TRANSPORT,)* whitted::TRANSPORT];
    };
}

registry! {
    effects {
        "textures" => textures TEXTURES,
        "normal-maps" => normal_maps NORMAL_MAPS,
        "alpha" => alpha ALPHA,
    }
    transports {
        "path" => path PATH,
    }
    in whitted {
        "shadows" => shadows SHADOWS,
        "soft-shadows" => soft_shadows SOFT_SHADOWS,
        "ambient-occlusion" => ambient_occlusion AMBIENT_OCCLUSION,
        "glaze" => glaze GLAZE,
    }
    effects {
        "terminator" => terminator TERMINATOR,
        "antialiasing" => antialiasing ANTIALIASING,
        "depth-of-field" => depth_of_field DEPTH_OF_FIELD,
        "adaptive" => adaptive ADAPTIVE,
    }
}

/// Identifies an effect. The constants are in [`id`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct EffectId(&'static str);

impl EffectId {
    /// The name as typed by users.
    pub const fn name(self) -> &'static str {
        self.0
    }

    /// `NAME=VALUE`, as `--with` takes it.
    pub fn with_value(self, value: impl fmt::Display) -> String {
        format!("{}={value}", self.0)
    }
}

impl fmt::Display for EffectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0)
    }
}

/// A kind of ray, counted by itself in statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayKind {
    /// The name in statistics.
    pub name: &'static str,
    /// Whether these are occlusion tests between a surface and a light.
    pub is_shadow: bool,
    /// The 8-bit sRGB colour that the window draws these rays in.
    pub colour: [u8; 3],
}

impl RayKind {
    /// Camera rays.
    pub const PRIMARY: RayKind = RayKind { name: "primary", is_shadow: false, colour: [255, 220, 90] };

    /// Every kind: primary rays, then those of the effects.
    pub fn all() -> impl Iterator<Item = RayKind> {
        std::iter::once(RayKind::PRIMARY).chain(EFFECTS.iter().flat_map(|effect| effect.rays).copied())
    }
}

type Run = dyn Fn(&mut Tile, &RenderContext) + Send + Sync;

/// A stage of rendering a tile. A stage of a ray generation works on the generation [`Tile::current`].
pub struct Stage {
    /// The name in statistics.
    pub name: &'static str,
    run: Box<Run>,
}

impl Stage {
    /// A stage that calls `run`.
    pub fn new(name: &'static str, run: impl Fn(&mut Tile, &RenderContext) + Send + Sync + 'static) -> Self {
        Stage { name, run: Box::new(run) }
    }

    /// A stage that calls `run` with buffers of type `T` ([`Tile::with_buffers`]).
    pub fn with_buffers<T: Default + Send + 'static>(
        name: &'static str,
        run: impl Fn(&mut T, &mut Tile, &RenderContext) + Send + Sync + 'static,
    ) -> Self {
        Stage::new(name, move |tile, context| tile.with_buffers(|buffers, tile| run(buffers, tile, context)))
    }

    /// Runs the stage.
    pub fn run(&self, tile: &mut Tile, context: &RenderContext) {
        (self.run)(tile, context);
    }
}

/// An effect: its properties, what calls for it, and its stages.
pub struct Effect {
    /// The id, which holds the name as typed by users.
    pub id: EffectId,
    /// One line that says what it does.
    pub summary: &'static str,
    /// Where its method is published.
    pub source: &'static str,
    /// The effect without which this one does nothing.
    pub builds_on: Option<EffectId>,
    /// Whether it does nothing without lights.
    pub needs_lights: bool,
    /// Whether it is part of shading. The modes below [`ShadingMode::Full`] show one term alone, without such effects.
    pub is_shading: bool,
    /// Whether it decides where or how often pixels are sampled.
    pub decides_samples: bool,
    /// Whether `kiln study` varies it by switching it on and off. It varies the others by their values or by the sampling.
    pub is_study_switch: bool,
    /// The kinds of rays that it casts.
    pub rays: &'static [RayKind],
    /// The value it takes, if any.
    pub value: Option<EffectValue>,
    /// What in the scene or the plan settings calls for it, by name; `Err` with the reason where nothing does.
    pub called_for: fn(&World, &PlanSettings) -> Result<String, String>,
    /// Enters into the plan's specification what it needs.
    pub specify: fn(&EffectContext, &mut PlanSpec),
    /// Its stages at a hook, in order.
    pub stages: fn(&EffectContext, Hook) -> Vec<Stage>,
    /// Bytes of memory that it holds in a tile.
    pub bytes: fn(&Tile) -> usize,
}

impl Effect {
    /// What an entry does not state.
    const NONE: Effect = Effect {
        id: EffectId(""),
        summary: "",
        source: "",
        builds_on: None,
        needs_lights: false,
        is_shading: false,
        decides_samples: false,
        is_study_switch: false,
        rays: &[],
        value: None,
        called_for: |_, _| Err("nothing calls for it".into()),
        specify: |_, _| {},
        stages: |_, _| Vec::new(),
        bytes: |_| 0,
    };

    /// The name as typed by users.
    pub const fn name(&self) -> &'static str {
        self.id.name()
    }
}

/// A value that an effect takes: `--with NAME=VALUE`, and `NAME = VALUE` in a scene file.
pub struct EffectValue {
    /// What it is, such as "filter".
    pub meaning: &'static str,
    /// The value in the help, such as "FILTER".
    pub placeholder: &'static str,
    /// What its values are, for controls; `check` decides.
    pub kind: fn() -> ValueKind,
    /// Checks a value; `Err` says what is wrong with it.
    pub check: fn(&str) -> Result<(), String>,
}

/// A transport: how the light that surfaces send towards the camera is computed.
pub struct TransportEntry {
    /// The transport.
    pub transport: Transport,
    /// The effect by which users switch it, which states what calls for it, its rays and its value; its stages are
    /// those of the transport. `None` for the transport of pictures that call for no other.
    pub switch: Option<EffectId>,
    /// The effects that only it has, off with other transports.
    pub effects: &'static [EffectId],
    /// Why effects of other transports are off.
    pub reason: &'static str,
    /// As [`Effect::specify`], before all effects.
    pub specify: fn(&EffectContext, &mut PlanSpec),
    /// As [`Effect::stages`], before those of all effects.
    pub stages: fn(&EffectContext, Hook) -> Vec<Stage>,
}

/// The input of an effect's [`Effect::specify`] and [`Effect::stages`].
pub struct EffectContext<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// How pixels are sampled.
    pub sampling: &'a Sampling,
    /// Largest radiance that a path adds by indirect light; none if `None`.
    pub clamp: Option<f64>,
    /// The plan's specification: in [`Effect::specify`] as left by earlier effects, in [`Effect::stages`] complete.
    pub spec: PlanSpec,
    /// The value that the effect, or that of the transport, was given.
    pub value: Option<String>,
}

impl EffectContext<'_> {
    /// How rays find the surfaces that they hit; `None` where all surfaces are opaque. For [`Effect::stages`].
    pub(crate) fn transparency(&self) -> Option<Transparency> {
        self.spec.transparency(self.sampling)
    }
}

/// The specification of a plan, complete before any stage is listed. Effects change it in their order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PlanSpec {
    /// Which terms are shaded.
    pub shading: ShadingMode,
    /// Whether the layers of transparent surfaces along a camera ray are shaded one after the other, where a pixel has
    /// one sample.
    pub layers: bool,
    /// The kinds of rays that are continued behind surfaces; `None` where all surfaces are opaque.
    pub continued: Option<ContinuedRays>,
    /// Whether every light is evaluated at every surface: [`Hook::Lighting`] and [`Hook::AfterLighting`].
    pub lit: bool,
    /// Samples a pixel. Texture footprints shrink with it.
    pub samples: u32,
    /// Which textures are looked up, and how.
    pub texture_use: TextureUse,
    /// Whether smooth meshes are lit by their shading normals alone, also from below the horizon of the triangle.
    pub smooth: bool,
    /// Whether shadow rays are cast.
    pub shadow_rays: bool,
    /// Whether shadow rays go to sampled points of lights with an apparent diameter, not to their centres.
    pub soft_shadows: bool,
    /// On how many ray generations, from the first, rays leave the surfaces.
    pub generations_with_origins: u32,
    /// The secondary rays; `None` for a plan with primary rays only.
    pub secondary: Option<SecondaryRays>,
    /// Whether an effect makes the camera rays, instead of one through each pixel's centre.
    pub own_camera_rays: bool,
    /// Whether the number of samples differs from pixel to pixel.
    pub adaptive: bool,
    /// Whether the colour of a sample depends on random numbers beside its film position.
    pub is_random: bool,
    /// Whether light may come to a pixel in few of its samples, through a lens or clear glass.
    pub has_rare_light: bool,
    /// Which samples of light count in path tracing.
    #[doc(hidden)]
    pub light_technique: LightTechnique,
    /// How paths are estimated.
    pub path: PathSettings,
    /// The limits on the bounces of paths.
    pub bounce_limits: BounceLimits,
}

/// How paths are estimated. Roulette and light samples change noise and time, not the expected picture; they are for the library
/// and `kiln study`, without an option of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PathSettings {
    /// The bounces of a path before Russian roulette starts; [`u32::MAX`] for none.
    pub roulette_from: u32,
    /// Light samples, each with a shadow ray, at a surface: 1 to [`PathSettings::MAX_LIGHT_SAMPLES`]. Other numbers count as
    /// the nearest of these.
    pub light_samples: u32,
    /// The most perfectly specular bounces of a path, which then do not count towards the others. `None`:
    /// [`PathSettings::DEFAULT_DEPTH_SPECULAR`], or, where a number of bounces is given, that for all.
    pub depth_specular: Option<u32>,
}

impl PathSettings {
    /// The most light samples at a surface.
    pub const MAX_LIGHT_SAMPLES: u32 = 64;

    /// The limit of bounces that can be asked for.
    pub const MAX_DEPTH: u32 = 1000;

    /// The bounces of a path where none are asked for.
    pub const DEFAULT_DEPTH: u32 = 8;

    /// The perfectly specular bounces of a path where no limit is asked for.
    pub const DEFAULT_DEPTH_SPECULAR: u32 = 64;
}

impl Default for PathSettings {
    fn default() -> Self {
        PathSettings { roulette_from: 3, light_samples: 1, depth_specular: None }
    }
}

/// Which samples count of the light that both BSDF samples and light samples reach. The expected picture is the same; tests compare
/// them. Not an option, since both together are the best choice.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LightTechnique {
    /// Both, weighted by the power heuristic.
    #[default]
    Both,
    /// The light that paths in directions of the BSDF find.
    BsdfSamples,
    /// That of sampled lights.
    LightSamples,
}

impl PlanSpec {
    /// Whether the transport traces paths.
    fn traces_paths(&self) -> bool {
        self.texture_use.transport.is_some_and(Transport::traces_paths)
    }

    /// See [`EffectContext::transparency`].
    fn transparency(&self, sampling: &Sampling) -> Option<Transparency> {
        let Sampling { seed, sampler, .. } = *sampling;
        let is_layered = self.layers && !self.own_camera_rays;
        let filter = self.texture_use.filter;
        let of = |ContinuedRays { rays: kind, .. }| Transparency {
            is_layered,
            culls: false,
            filter,
            sampler,
            seed,
            kind,
        };
        self.continued.map(of)
    }
}

/// Which textures are looked up, and how.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TextureUse {
    /// The textures of materials but their normal maps and opacities.
    pub material_textures: bool,
    /// The normal maps.
    pub normal_maps: bool,
    /// The transport whose textures are looked up; `None` for those of all.
    pub transport: Option<Transport>,
    /// The filter; `None` for that of each texture's sampler.
    pub filter: Option<TextureFilter>,
}

/// The rays of all generations beyond the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SecondaryRays {
    /// The kind they are counted as.
    pub kind: RayKind,
    /// The name of the stage that finds their closest hits.
    pub hits: &'static str,
    /// The effect that casts them.
    pub effect: EffectId,
    /// Whether surfaces mirror them, so that their differentials follow from those of the rays before.
    pub are_mirrored: bool,
}

/// Whether stages belong to the first ray generation or to all later ones, which share one list of stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayClass {
    /// The camera rays.
    Primary,
    /// Every generation beyond.
    Secondary,
}

/// The places in a plan where effects have stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hook {
    /// Before the first generation: camera rays are made.
    Rays,
    /// A generation's surface interactions and ray origins are known; lights are not evaluated yet.
    BeforeLighting(RayClass),
    /// The transport evaluates lights. Only with [`PlanSpec::lit`].
    Lighting(RayClass),
    /// The lights above each surface's horizon are known. Only with [`PlanSpec::lit`].
    AfterLighting(RayClass),
    /// The transport computes the light of a generation's surfaces.
    Shading(RayClass),
    /// A generation is shaded. A stage that casts secondary rays fills the next generation ([`Tile::this_and_next`]).
    AfterShading(RayClass),
    /// All generations are shaded. Runs once for each generation that cast secondary rays, the deepest first. Without
    /// stages here, generations are not kept.
    AfterGenerations,
    /// The transport gives the pixels their colours, then effects change them.
    Film,
}

/// A list of names for [`Effect::called_for`]: "lights `a`, `b` and 1 more". `None` for an empty list.
pub fn named<'a>(noun: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let (mut shown, mut more) = (Vec::new(), 0);
    for name in names {
        if shown.len() < 3 && !shown.contains(&name) { shown.push(name) } else { more += 1 }
    }
    let quoted = shown.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match (shown.len(), more) {
        (0, _) => None,
        (1, 0) => Some(format!("{noun} {quoted}")),
        (_, 0) => Some(format!("{noun}s {quoted}")),
        _ => Some(format!("{noun}s {quoted} and {more} more")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_names_are_cut_off_after_three() {
        assert_eq!(named("light", []), None);
        assert_eq!(named("light", ["a"]).unwrap(), "light `a`");
        assert_eq!(named("light", ["a", "b"]).unwrap(), "lights `a`, `b`");
        assert_eq!(named("light", ["a", "a", "b"]).unwrap(), "lights `a`, `b` and 1 more");
        assert_eq!(named("light", ["a", "b", "c", "d", "e"]).unwrap(), "lights `a`, `b`, `c` and 2 more");
    }

    #[test]
    fn names_are_unique_and_effects_stand_behind_those_they_build_on() {
        let kinds: Vec<&str> = RayKind::all().map(|kind| kind.name).collect();
        let effects: Vec<&str> = EFFECTS.iter().map(Effect::name).collect();
        for names in [&kinds, &effects] {
            assert!(names.iter().enumerate().all(|(i, name)| !names[..i].contains(name)), "{names:?}");
        }
        for (i, effect) in EFFECTS.iter().enumerate() {
            let base = effect.builds_on.and_then(|base| EFFECTS.iter().position(|other| other.id == base));
            assert!(base.is_none_or(|base| base < i), "{}", effect.id);
        }
    }
}
