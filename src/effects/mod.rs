//! Effects: each computed where the scene calls for it, and nowhere else.
//!
//! Rendering is a list of [`Stage`]s over arrays of rays (see [`tile::Tile`]). [`Plan::new`] makes the list from what the
//! scene calls for and from nothing else, so an effect that nobody calls for has no stage, casts no ray and holds no memory.
//!
//! One file an effect, and one line in [`EFFECTS`]. The file says all there is to say: what calls for the effect, what it
//! changes in the [`Outline`] of the plan, its stages at the [`Hook`]s, its kinds of rays, and the memory it holds (kept in the
//! tile by [`tile::Tile::with`], so that it exists only where the effect runs). A build without an effect:
//! `RUSTFLAGS='--cfg kiln_without="glaze"'`.

pub mod effort;
mod film;
mod leave;
mod local;
mod pictures;
mod plan;
mod primary;
pub mod random;
pub mod samples;
pub mod tile;
mod visible;

pub use plan::{Choices, Decision, Plan, Step, check_names, check_scene};

use crate::scene::file::SceneFile;
use crate::scene::{Sampling, TextureFilter};
use crate::shading::ShadingMode;
use crate::world::World;
use tile::{Context, Tile};

/// Names the files of effects, in the order of the plan.
macro_rules! registry {
    ($($name:tt => $file:ident,)*) => {
        $(#[cfg(not(kiln_without = $name))] pub mod $file;)*

        /// Every effect there is, in the order of the plan: each builds on those before it.
        pub const EFFECTS: &[Effect] = &[$(#[cfg(not(kiln_without = $name))] $file::EFFECT,)*];
    };
}

registry! {
    "textures" => textures,
    "normal-maps" => normal_maps,
    "shadows" => shadows,
    "terminator" => terminator,
    "glaze" => glaze,
    "antialiasing" => antialiasing,
    "adaptive" => adaptive,
}

/// A kind of ray, for counting, by its name in statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayKind(pub &'static str);

impl RayKind {
    /// From the camera.
    pub const PRIMARY: RayKind = RayKind("primary");

    /// Every kind: primary rays, then those of the effects.
    pub fn all() -> impl Iterator<Item = RayKind> {
        std::iter::once(RayKind::PRIMARY).chain(EFFECTS.iter().flat_map(|effect| effect.rays).copied())
    }
}

/// A step of the work on a tile.
pub trait Stage: Send + Sync {
    /// The name in statistics.
    fn name(&self) -> &'static str;

    /// Does the step, on the level [`Tile::depth`] where it is one of a level.
    fn run(&self, tile: &mut Tile, context: &Context);
}

/// An effect that scenes can call for: everything about it.
pub struct Effect {
    /// The name as typed by users.
    pub name: &'static str,
    /// One line on what it does.
    pub summary: &'static str,
    /// Whether it has a meaning only where lights shine.
    pub needs_lights: bool,
    /// Whether it is a part of shading, which pictures of single terms leave out.
    pub is_shading: bool,
    /// The kinds of rays that it casts.
    pub rays: &'static [RayKind],
    /// What it can be told beyond on and off.
    pub value: Option<Value>,
    /// What in the scene or its sampling calls for it, by name, or why nothing does.
    pub called_for: fn(&World, &Sampling) -> Result<String, String>,
    /// What it changes in the plan's outline.
    pub outline: fn(&Asked, &mut Outline),
    /// Its stages at a hook, in order.
    pub stages: fn(&Asked, Hook) -> Vec<Box<dyn Stage>>,
    /// Bytes of memory that it holds in a tile.
    pub bytes: fn(&Tile) -> usize,
}

/// A value that an effect takes: `--with NAME=VALUE`, and `NAME = VALUE` in a scene file.
pub struct Value {
    /// What it is, such as "samples a pixel".
    pub meaning: &'static str,
    /// Whether it can be used, or what is wrong with it.
    pub check: fn(&str) -> Result<(), String>,
}

/// What an effect may know when it lists its stages.
pub struct Asked<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// How pixels are sampled.
    pub sampling: &'a Sampling,
    /// The plan's outline: while that is being made, what earlier effects made of it.
    pub outline: Outline,
    /// The value that the effect was given.
    pub value: Option<String>,
}

/// What a plan is going to be, decided before any stage is listed. Effects change it, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outline {
    /// How far shading goes.
    pub shading: ShadingMode,
    /// Whether lights take part.
    pub lit: bool,
    /// How many samples a pixel takes: of several, each sees as much less of a picture.
    pub samples: u32,
    /// Which pictures are looked up, and how.
    pub pictures: Pictures,
    /// Whether smooth meshes are lit by their normals alone.
    pub smooth: bool,
    /// Whether surfaces ask what stands between them and the lights.
    pub shadow_rays: bool,
    /// On how many levels, from the first, rays leave the surfaces.
    pub leaving: u32,
    /// What the rays of levels beyond the first are; `None` where there are no such levels.
    pub further: Option<Further>,
    /// Whether an effect makes the camera's rays, instead of one through each pixel's centre.
    pub own_rays: bool,
    /// Whether pixels are sampled no further than it takes.
    pub adaptive: bool,
}

/// Pictures that are looked up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Pictures {
    /// Those that say what surfaces are of.
    pub textures: bool,
    /// Those that tilt normals.
    pub normal_maps: bool,
    /// How; `None` for each as its sampler says.
    pub filter: Option<TextureFilter>,
}

/// Levels beyond the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Further {
    /// What their rays count as.
    pub kind: RayKind,
    /// The name of the stage that finds what they hit.
    pub hits: &'static str,
    /// The effect that sends them.
    pub effect: &'static str,
}

/// Whether a list of stages is the first level's or that of all others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// The level of the pixels' own rays.
    First,
    /// Every level beyond.
    Further,
}

/// The places in a plan where effects have stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hook {
    /// The camera's rays are made; nothing is asked yet.
    Rays,
    /// A level's surfaces are found, and where rays leave them; lights are not looked at yet.
    BeforeLighting(Depth),
    /// It is known which lights shine on the side of each surface of a level. Only where lights take part.
    AfterLighting(Depth),
    /// A level's surfaces have their colours. Who sends rays out fills the next level ([`Tile::this_and_next`]).
    AfterShading(Depth),
    /// All levels are done. Once for each level that sent rays out, the deepest first.
    AfterLevels,
    /// The pixels have their colours.
    Film,
}

/// What calls for an effect: things of a kind, the first few by name. `None` for none.
pub fn named(kind: &str, names: &[&str]) -> Option<String> {
    let mut shown: Vec<&str> = Vec::new();
    for name in names {
        if shown.len() < 3 && !shown.contains(name) {
            shown.push(name);
        }
    }
    let quoted = shown.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match names.len() - shown.len() {
        _ if names.is_empty() => None,
        0 if shown.len() == 1 => Some(format!("{kind} {quoted}")),
        0 => Some(format!("{kind}s {quoted}")),
        more => Some(format!("{kind}s {quoted} and {more} more")),
    }
}

/// The JSON schema of scene files, with the names of the effects.
pub fn schema() -> serde_json::Value {
    let mut schema = SceneFile::schema();
    let mut names = serde_json::Map::new();
    for effect in EFFECTS {
        let kinds =
            if effect.value.is_some() { ["boolean", "number", "string"].as_slice() } else { &["boolean"] };
        let entry = serde_json::json!({ "description": effect.summary, "type": kinds });
        names.insert(effect.name.into(), entry);
    }
    if let Some(section) = schema.pointer_mut("/properties/effects").and_then(|s| s.as_object_mut()) {
        section.insert("properties".into(), names.into());
        section.insert("additionalProperties".into(), false.into());
    }
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_can_be_said_in_a_scene_file() {
        let schema = schema();
        for effect in EFFECTS {
            let text = format!("[effects]\n{} = true\n", effect.name);
            let file = SceneFile::parse(&text, std::path::Path::new("a.toml")).unwrap();
            assert!(file.effects[effect.name].get_ref().is_on());
            assert!(schema["properties"]["effects"]["properties"][effect.name].is_object());
            assert!(!effect.summary.is_empty());
        }
    }

    #[test]
    fn what_calls_is_named() {
        assert_eq!(named("light", &[]), None);
        assert_eq!(named("light", &["a"]).unwrap(), "light `a`");
        assert_eq!(named("light", &["a", "b"]).unwrap(), "lights `a`, `b`");
        assert_eq!(named("light", &["a", "a", "b"]).unwrap(), "lights `a`, `b` and 1 more");
        assert_eq!(named("light", &["a", "b", "c", "d", "e"]).unwrap(), "lights `a`, `b`, `c` and 2 more");
    }

    #[test]
    fn names_are_told_apart() {
        let kinds: Vec<&str> = RayKind::all().map(|kind| kind.0).collect();
        let effects: Vec<&str> = EFFECTS.iter().map(|effect| effect.name).collect();
        for names in [kinds, effects] {
            assert!(names.iter().enumerate().all(|(i, name)| !names[..i].contains(name)), "{names:?}");
        }
    }
}
