//! The plan: which effects there are to compute, and the stages that compute them.
//!
//! Rendering is a list of [`Stage`]s over arrays of rays (see [`tile::Tile`]). The list is made from what the scene calls
//! for and from nothing else, so an effect that nobody calls for has no stage, casts no ray and holds no memory. One
//! file an effect; to add one, write it, give it a line in [`EFFECTS`], a key in
//! [`crate::scene::file::EffectsSection`], and a place in [`Plan::new`].

mod film;
pub mod glaze;
mod local;
pub mod normal_maps;
mod primary;
pub mod shadows;
pub mod terminator;
pub mod textures;
pub mod tile;
mod visible;

use crate::error::{Error, Result};
use crate::scene::TextureFilter;
use crate::scene::file::{EffectsSection, TexturesValue, nearest_name};
use crate::shading::ShadingMode;
use crate::world::World;
use tile::{Context, Tile};

/// A kind of ray, for counting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RayKind {
    /// From the camera.
    Primary,
    /// Towards a light.
    Shadow,
    /// Mirrored by a glazed surface.
    Glaze,
}

impl RayKind {
    /// Every kind.
    pub const ALL: [RayKind; 3] = [RayKind::Primary, RayKind::Shadow, RayKind::Glaze];

    /// The name in statistics.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Primary => "primary",
            RayKind::Shadow => "shadow",
            RayKind::Glaze => "glaze",
        }
    }
}

/// A step of the work on a tile.
pub trait Stage: Send + Sync {
    /// The name in statistics.
    fn name(&self) -> &'static str;

    /// Does the step.
    fn run(&self, tile: &mut Tile, context: &Context);
}

/// An effect that scenes can call for.
pub struct Effect {
    /// The name as typed by users.
    pub name: &'static str,
    /// One line on what it does.
    pub summary: &'static str,
    /// Whether it has a meaning only where lights shine.
    needs_lights: bool,
    /// What in the world calls for it, or why nothing does.
    called_for: fn(&World) -> std::result::Result<String, String>,
}

/// Every effect there is.
pub const EFFECTS: &[Effect] =
    &[textures::EFFECT, normal_maps::EFFECT, shadows::EFFECT, terminator::EFFECT, glaze::EFFECT];

/// What the user asks for, over what the scene says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choices {
    /// How far shading goes.
    pub shading: ShadingMode,
    /// What the scene file says of effects.
    pub scene: EffectsSection,
    /// Effects to have.
    pub with: Vec<String>,
    /// Effects to do without.
    pub without: Vec<String>,
}

impl Choices {
    /// The filter that the scene asks for.
    fn filter(&self) -> Option<TextureFilter> {
        match self.scene.textures {
            Some(TexturesValue::Filter(filter)) => Some(filter),
            _ => None,
        }
    }
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
}

/// The stages that a picture takes, in order.
pub struct Plan {
    /// How far shading goes.
    pub shading: ShadingMode,
    /// What was decided of each effect.
    pub decisions: Vec<Decision>,
    stages: Vec<Box<dyn Stage>>,
}

impl Plan {
    /// Decides which effects there is anything to do for, and lists the stages.
    ///
    /// # Errors
    /// [`Error::Usage`] for an effect that does not exist or is both asked for and not.
    pub fn new(world: &World, choices: &Choices) -> Result<Plan> {
        check_names(choices.with.iter().chain(&choices.without))?;
        if let Some(both) = choices.with.iter().find(|name| choices.without.contains(name)) {
            return Err(Error::usage(format!("both with and without `{both}`"), "ask for one of the two"));
        }
        let decisions: Vec<Decision> = EFFECTS.iter().map(|effect| decide(effect, world, choices)).collect();
        let on = |name: &str| decisions.iter().any(|d| d.effect == name && d.on);
        let (shadows, glaze) = (on(shadows::EFFECT.name), on(glaze::EFFECT.name));
        let smooth = on(terminator::EFFECT.name);

        let lit = choices.shading.uses_lights() && !world.lights.is_empty();
        let (textures, normal_maps) = (on(textures::EFFECT.name), on(normal_maps::EFFECT.name));
        let pictures = (textures || normal_maps)
            .then(|| textures::Pictures::new(world, textures, normal_maps, choices.filter(), 1));
        let bounces = if glaze { glaze::most_bounces(world) } else { 0 };
        let mut stages: Vec<Box<dyn Stage>> = vec![Box::new(primary::Primary)];
        for level in 0..=bounces as usize {
            if level > 0 {
                stages.push(Box::new(glaze::Reflect { from: level - 1 }));
                if let Some(pictures) = pictures.clone().filter(|pictures| pictures.footprints) {
                    stages.push(Box::new(textures::Follow { from: level - 1, pictures }));
                }
            }
            let kind = if level == 0 { RayKind::Primary } else { RayKind::Glaze };
            stages.push(Box::new(visible::Visible { level, kind }));
            if let Some(pictures) = pictures.clone() {
                stages.push(Box::new(textures::Locate { level, pictures }));
            }
            if let Some(pictures) = pictures.clone().filter(|_| normal_maps) {
                stages.push(Box::new(normal_maps::NormalMaps { level, pictures }));
            }
            if (lit && shadows) || level < bounces as usize {
                stages.push(Box::new(visible::Origins { level }));
            }
            if lit {
                stages.push(Box::new(local::Illuminate { level, smooth }));
                if shadows {
                    if smooth {
                        stages.push(Box::new(terminator::Lift { level }));
                    }
                    stages.push(Box::new(shadows::Shadows { level }));
                }
            }
            if let Some(pictures) = pictures.clone().filter(|_| textures) {
                stages.push(Box::new(textures::Textures { level, pictures }));
            }
            stages.push(Box::new(local::Shade { level, mode: choices.shading }));
        }
        for level in (1..=bounces as usize).rev() {
            stages.push(Box::new(glaze::Combine { into: level - 1 }));
        }
        stages.push(Box::new(film::Expose));
        Ok(Plan { shading: choices.shading, decisions, stages })
    }

    /// The stages in the order they run.
    pub fn stages(&self) -> &[Box<dyn Stage>] {
        &self.stages
    }

    /// The names of the effects that are computed.
    pub fn effects_on(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.decisions.iter().filter(|d| d.on).map(|d| d.effect)
    }
}

/// Whether every name is that of an effect.
///
/// # Errors
/// [`Error::Usage`] for the first that is not, with the nearest one that is.
pub fn check_names<'a>(names: impl IntoIterator<Item = &'a String>) -> Result<()> {
    let known: Vec<&str> = EFFECTS.iter().map(|effect| effect.name).collect();
    match names.into_iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(Error::usage(format!("there is no effect `{name}`"), nearest_name(name, &known))),
        None => Ok(()),
    }
}

/// The user's word first, then the scene's, then the shading mode's, then what there is to do. An effect with nothing
/// to do stays off whoever asks: it could not change the picture.
fn decide(effect: &Effect, world: &World, choices: &Choices) -> Decision {
    let name = effect.name;
    let decision = |on, why: String| Decision { effect: name, on, why };
    let calls = match (effect.called_for)(world) {
        Ok(calls) => calls,
        Err(nothing) => return decision(false, nothing),
    };
    if !choices.shading.uses_lights() && effect.needs_lights {
        return decision(false, format!("{} shading has no lights", choices.shading.name()));
    }
    if choices.without.iter().any(|n| n == name) {
        return decision(false, format!("--without {name}"));
    }
    if choices.with.iter().any(|n| n == name) {
        return decision(true, format!("--with {name}; {calls}"));
    }
    match choices.scene.get(name) {
        Some(false) => return decision(false, "the scene file turns it off".into()),
        Some(true) => return decision(true, format!("the scene file turns it on; {calls}")),
        None => {}
    }
    // A surface's own looks are there however far shading goes.
    let is_surface = name == textures::EFFECT.name || name == normal_maps::EFFECT.name;
    if choices.shading < ShadingMode::Phong && !is_surface {
        return decision(false, format!("--shading {} shows that term alone", choices.shading.name()));
    }
    decision(true, calls)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_can_be_said_in_a_scene_file() {
        let schema = crate::scene::file::SceneFile::schema().to_string();
        for effect in EFFECTS {
            let text = format!("[effects]\n{} = true\n", effect.name);
            let file = crate::scene::file::SceneFile::parse(&text, std::path::Path::new("a.toml")).unwrap();
            assert_eq!(file.effects.get(effect.name), Some(true), "{} has no key", effect.name);
            assert!(schema.contains(&format!("\"{}\"", effect.name)));
            assert!(!effect.summary.is_empty());
        }
    }
}
