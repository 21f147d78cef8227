//! AOVs (arbitrary output variables): what else is known of a pixel, beside its colour.
//!
//! Those of the geometry are asked of the ray through each pixel's centre by itself, after the picture: the surface it hits first,
//! unfiltered, however many samples the picture takes. Those are counted by taking them again. The share of each effect is the difference of two pictures: with the
//! effects up to this one in the plan's order, and with those before it. So base and shares add up to the picture.

use std::sync::Mutex;

use rayon::prelude::*;

use super::{RenderControl, render};
use crate::effects::Plan;
use crate::effects::tile::{Context, Tile};
use crate::error::{Error, Result};
use crate::film::write::Channel;
use crate::film::{Film, Share, Window};
use crate::scene::file::nearest_name;
use crate::shading::{ShadingMode, shade};
use crate::world::{Range, Surface, View, World};

/// What is known of a camera ray.
struct Seen<'a> {
    world: &'a World,
    /// How the scene was moved before it was prepared.
    range: Option<Range>,
    /// Camera rays of the pixel.
    samples: u32,
    /// Boxes that this ray was tested against.
    node_tests: u64,
    /// The distance to what it hits, and that point.
    hit: Option<(f64, Surface)>,
}

/// A thing that can be known of a pixel.
pub struct Aov {
    /// The name as typed by users.
    pub name: &'static str,
    /// What it is, and what it is where nothing is hit.
    pub summary: &'static str,
    /// Its channels in the file.
    pub channels: &'static [&'static str],
    /// Their values.
    value: fn(&Seen) -> [f32; 3],
}

/// The name of the shares of the effects, which have channels for each effect that is on.
pub const EFFECTS: &str = "effects";

/// Every AOV but the shares of the effects.
pub const AOVS: &[Aov] = &[
    Aov {
        name: "depth",
        summary: "distance from the camera along the ray; infinite for the background",
        channels: &["Depth.Z"],
        value: |seen| {
            let scale = seen.range.map_or(1.0, |range| range.scale);
            [seen.hit.as_ref().map_or(f32::INFINITY, |(t, _)| (t / scale) as f32), 0.0, 0.0]
        },
    },
    Aov {
        name: "position",
        summary: "the point in the scene's own coordinates; 0 for the background",
        channels: &["Position.X", "Position.Y", "Position.Z"],
        value: |seen| {
            of_surface(seen, |surface| {
                let position = surface.point.position;
                seen.range
                    .map_or(position, |range| position / range.scale + range.middle)
                    .as_vec3()
                    .to_array()
            })
        },
    },
    Aov {
        name: "normal",
        summary: "the unit normal for shading, on the camera's side; 0 for the background",
        channels: &["Normal.X", "Normal.Y", "Normal.Z"],
        value: |seen| of_surface(seen, |surface| surface.shading_normal.as_vec3().to_array()),
    },
    Aov {
        name: "geometric-normal",
        summary: "the unit normal of the sphere or triangle, on the camera's side; 0 for the background",
        channels: &["GeometricNormal.X", "GeometricNormal.Y", "GeometricNormal.Z"],
        value: |seen| of_surface(seen, |surface| surface.geometric_normal.as_vec3().to_array()),
    },
    Aov {
        name: "albedo",
        summary: "the surface's own colour, without light; 0 for the background",
        channels: &["Albedo.R", "Albedo.G", "Albedo.B"],
        value: |seen| {
            of_surface(seen, |surface| {
                shade(seen.world, ShadingMode::Flat, surface, &[]).as_vec3().to_array()
            })
        },
    },
    Aov {
        name: "object",
        summary: "the number of the object, in the order of the description from 0; -1 for the background",
        channels: &["Object.X"],
        value: |seen| number(seen, |surface| surface.object),
    },
    Aov {
        name: "material",
        summary: "the number of the material; -1 for the background",
        channels: &["Material.X"],
        value: |seen| number(seen, |surface| surface.material),
    },
    Aov {
        name: "primitive",
        summary: "the number of the sphere or triangle; -1 for the background",
        channels: &["Primitive.X"],
        value: |seen| number(seen, |surface| surface.prim.0),
    },
    Aov {
        name: "samples",
        summary: "camera rays of the pixel",
        channels: &["Samples.X"],
        value: |seen| [seen.samples as f32, 0.0, 0.0],
    },
    Aov {
        name: "node-tests",
        summary: "boxes that the camera ray, cast by itself, is tested against",
        channels: &["NodeTests.X"],
        value: |seen| [seen.node_tests as f32, 0.0, 0.0],
    },
];

/// Numbers up to this one are kept exactly; programs that open pictures expect floats.
pub const LARGEST_NUMBER: usize = 1 << 24;

fn of_surface(seen: &Seen, value: impl Fn(&Surface) -> [f32; 3]) -> [f32; 3] {
    seen.hit.as_ref().map_or([0.0; 3], |(_, surface)| value(surface))
}

fn number(seen: &Seen, value: impl Fn(&Surface) -> u32) -> [f32; 3] {
    [seen.hit.as_ref().map_or(-1.0, |(_, surface)| value(surface) as f32), 0.0, 0.0]
}

/// What the user asks for.
pub struct Wanted {
    aovs: Vec<&'static Aov>,
    effects: bool,
}

impl Wanted {
    /// From names; `all` stands for every one.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that is none, with the nearest one that is.
    pub fn new(names: &[String]) -> Result<Self> {
        let known: Vec<&str> = AOVS.iter().map(|aov| aov.name).chain([EFFECTS, "all"]).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(Error::usage(format!("there is no AOV `{name}`"), nearest_name(name, &known)));
        }
        let asked = |name: &str| names.iter().any(|n| n == name || n == "all");
        Ok(Wanted { aovs: AOVS.iter().filter(|aov| asked(aov.name)).collect(), effects: asked(EFFECTS) })
    }

    /// How many channels there are beside the picture's own, where so many effects are on.
    pub fn channel_count(&self, effects_on: usize) -> usize {
        let effects = if self.effects { 3 * (1 + effects_on) } else { 0 };
        self.aovs.iter().map(|aov| aov.channels.len()).sum::<usize>() + effects
    }

    /// The most bytes for each pixel that making the channels takes beside the picture and the channels themselves: a film of bytes for
    /// the tiles, or a film without an effect, its pixels in rows, and those of the film before.
    pub fn bytes_a_pixel(&self) -> u64 {
        if self.effects { 3 * 12 } else { 3 }
    }

    /// Whether numbers of primitives are asked for.
    pub fn has_primitives(&self) -> bool {
        self.aovs.iter().any(|aov| aov.name == "primitive")
    }
}

/// A picture that is to be told more of.
pub struct Subject<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// How it was moved before.
    pub range: Option<Range>,
    /// The camera.
    pub view: &'a View,
    /// What the picture takes.
    pub plan: &'a Plan,
    /// The part of it that was made.
    pub window: Window,
    /// The tiles of it that were made.
    pub share: Share,
    /// The picture itself, where there is one; only the shares of effects ask for it, and render it where there is none.
    pub film: Option<&'a Film>,
}

/// The channels that are wanted beside the picture's own, row by row from the top.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Failed`] where there is not enough memory.
pub fn channels(subject: &Subject, wanted: &Wanted, watch: &RenderControl) -> Result<Vec<Channel>> {
    let mut channels = Vec::new();
    if !wanted.aovs.is_empty() {
        channels.extend(geometry(subject, &wanted.aovs, watch)?);
    }
    if wanted.effects {
        channels.extend(shares(subject, watch)?);
    }
    Ok(channels)
}

fn geometry(subject: &Subject, aovs: &[&Aov], watch: &RenderControl) -> Result<Vec<Channel>> {
    let names: Vec<&str> = aovs.iter().flat_map(|aov| aov.channels).copied().collect();
    let Window { x, y, width, .. } = subject.window;
    let area = subject.window.area();
    let all: Vec<Mutex<Vec<f32>>> = names.iter().map(|_| Mutex::new(vec![0.0; area])).collect();
    // The film is asked for its tiles, so that they are those of the picture.
    let mut tiles: Film<[u8; 3]> = Film::new(subject.window)?;
    tiles.tiles_mut().into_par_iter().enumerate().for_each_init(Tile::default, |tile, (place, part)| {
        if !subject.share.has(place) || watch.cancel.load(std::sync::atomic::Ordering::Relaxed) {
            return;
        }
        let values = of_tile(subject, aovs, tile, part.window);
        for (channel, values) in all.iter().zip(values) {
            let Ok(mut channel) = channel.lock() else { continue };
            for (row, values) in values.chunks(part.window.width as usize).enumerate() {
                let start = (part.window.y - y) as usize + row;
                let start = start * width as usize + (part.window.x - x) as usize;
                channel[start..start + values.len()].copy_from_slice(values);
            }
        }
    });
    if watch.cancel.load(std::sync::atomic::Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    let channels = names.into_iter().zip(all);
    Ok(channels
        .map(|(name, values)| Channel { name: name.into(), values: values.into_inner().unwrap_or_default() })
        .collect())
}

/// For each channel, the values of a tile's pixels.
fn of_tile(subject: &Subject, aovs: &[&Aov], tile: &mut Tile, window: Window) -> Vec<Vec<f32>> {
    let world = subject.world;
    tile.start(window);
    let context = Context { world, view: subject.view };
    let is_counted = aovs.iter().any(|aov| aov.name == "samples");
    let samples =
        if is_counted { subject.plan.samples(tile, &context, window) } else { vec![1; window.area()] };
    tile.start(window);
    subject.plan.centre_rays(tile, &context);
    let count = aovs.iter().map(|aov| aov.channels.len()).sum();
    let mut values = vec![vec![0.0; window.area()]; count];
    let Tile { levels, traversal, .. } = tile;
    for (&pixel, ray) in levels[0].sources.iter().zip(&levels[0].rays) {
        let before = traversal.tests.nodes;
        let hit = world.accelerator.closest_hit(ray, traversal);
        let seen = Seen {
            world,
            range: subject.range,
            samples: samples[pixel as usize],
            node_tests: traversal.tests.nodes - before,
            hit: hit.map(|hit| (hit.t, world.surface(ray, &hit))),
        };
        let all = aovs.iter().flat_map(|aov| (aov.value)(&seen).into_iter().take(aov.channels.len()));
        values.iter_mut().zip(all).for_each(|(channel, value)| channel[pixel as usize] = value);
    }
    values
}

/// What the picture is without effects, and what each effect adds.
fn shares(subject: &Subject, watch: &RenderControl) -> Result<Vec<Channel>> {
    let &Subject { world, view, plan, window, share, film, .. } = subject;
    let on: Vec<usize> = (0..plan.decisions.len()).filter(|&i| plan.decisions[i].on).collect();
    let mut before: Option<Vec<[f32; 3]>> = None;
    let mut channels = Vec::new();
    for count in 0..=on.len() {
        let whole = film.filter(|_| count == on.len());
        let pixels: Vec<[f32; 3]> = if let Some(film) = whole {
            film.rows().collect()
        } else {
            let plan = plan.keeping(world, |i| on[..count].contains(&i));
            let is_selected = |place: usize, _: Window| share.has(place);
            let control = RenderControl { time_stages: false, ..*watch };
            render::<[f32; 3]>(world, view, &plan, window, is_selected, &control)?.0.rows().collect()
        };
        let layer = match count {
            0 => "Base".to_owned(),
            _ => layer(plan.decisions[on[count - 1]].effect),
        };
        for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let values = match &before {
                None => pixels.iter().map(|pixel| pixel[c]).collect(),
                Some(before) => pixels.iter().zip(before).map(|(now, before)| now[c] - before[c]).collect(),
            };
            channels.push(Channel { name: format!("{layer}.{letter}"), values });
        }
        before = Some(pixels);
    }
    Ok(channels)
}

/// `normal-maps` becomes `EffectNormalMaps`, which is no other AOV's name.
fn layer(effect: &str) -> String {
    let words = effect.split('-').map(|word| {
        let (first, rest) = word.split_at(word.chars().next().map_or(0, char::len_utf8));
        first.to_uppercase() + rest
    });
    format!("Effect{}", words.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_or_have_a_neighbour() {
        let wanted = |names: &[&str]| Wanted::new(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(wanted(&["all"]).unwrap().aovs.len(), AOVS.len());
        let some = wanted(&["depth", "effects"]).unwrap();
        assert!(some.effects && some.aovs.len() == 1 && !some.has_primitives());
        let error = wanted(&["depht"]).err().unwrap();
        assert_eq!(
            (error.to_string().as_str(), error.hint()),
            ("there is no AOV `depht`", "did you mean `depth`?")
        );
    }

    #[test]
    fn layers_have_names_of_their_own() {
        assert_eq!(layer("normal-maps"), "EffectNormalMaps");
    }
}
