//! AOVs (arbitrary output variables): values of each pixel beside its colour, chosen by name, each written as one or
//! more channels.
//!
//! Geometric AOVs come from the closest hit of the ray through each pixel's centre, unfiltered, whatever samples the
//! picture takes; an added ground is background there. Albedo, shading normal and coverage are means over the pixel's samples
//! ([`super::features`]). The channels of an effect are the difference of two pictures: one with the effects up to this
//! one in the plan's order, and one with those before it. So the base and all effects add up to the picture.

use std::sync::Mutex;

use rayon::prelude::*;

use super::cryptomatte::{self, Matte};
use super::features::{FeatureSums, Features, filter_of, first_surfaces, plan_without_light};
use super::{RenderControl, render_displayed};
use crate::bvh::detail::{HitBuffer, Rays};
use crate::bvh::{Hit, Ray};
use crate::effects::Plan;
use crate::effects::tile::{RenderContext, Tile};
use crate::effects::variance::PixelStatistics;
use crate::error::{Error, Result, ended, nearest_name};
use crate::farm::Shard;
use crate::film::write::{Channel, DEPTH};
use crate::film::{DisplayTransform, Film, ReconstructionFilter, Window};
use crate::world::{Recentering, View, World};

/// The pixels of a tile, of which AOVs have values.
struct AovTile<'a> {
    source: &'a AovSource<'a>,
    /// The camera ray of each pixel.
    rays: Rays<'a>,
    /// Its closest hit, if that is on an object of the scene.
    hits: &'a [Option<Hit>],
    /// The number and variance of the samples of each pixel; empty if nothing reads them.
    samples: Vec<PixelStatistics>,
    /// The albedo and normal of each pixel; empty if nothing reads them.
    features: Vec<Features>,
    /// The ids of each [`Matte`].
    ids: &'a [Vec<u32>; 2],
    /// The number of boxes that each ray was tested against; empty if nothing reads them.
    node_tests: Vec<u64>,
}

/// An AOV.
pub struct Aov {
    /// The name as typed by users.
    pub name: &'static str,
    /// What it is, and its value for the background.
    pub summary: &'static str,
    /// The names of its channels in the file.
    pub channels: &'static [&'static str],
    /// Whether its values are integers.
    pub has_integers: bool,
    /// Writes the values of its channels for the pixels of a tile.
    write: fn(&AovTile, &mut [Vec<f32>]),
}

/// The name of the AOV with the channels of each effect that is on.
pub const EFFECTS: &str = "effects";

/// What [`EFFECTS`] is.
pub const EFFECTS_SUMMARY: &str = "the picture without effects, and what each effect adds to those before it";

const SHADING_NORMAL: &str = "shading-normal";

/// The names of the AOVs of surfaces behind mirrors and glass.
const DENOISING: [&str; 2] = ["denoising-albedo", "denoising-normal"];

/// Every AOV except [`EFFECTS`].
pub const AOVS: &[Aov] = &[
    Aov {
        name: "depth",
        summary: "distance from the camera along its line of sight; infinite for the background",
        channels: &[DEPTH],
        has_integers: false,
        write: |tile, out| tile.write_lengths(out, |ray, hit| tile.source.view.depth(ray, hit.t)),
    },
    Aov {
        name: "distance",
        summary: "distance from the camera along the ray; infinite for the background",
        channels: &["Distance.X"],
        has_integers: false,
        write: |tile, out| tile.write_lengths(out, |_, hit| hit.t),
    },
    Aov {
        name: "position",
        summary: "hit point in scene coordinates; 0 for the background",
        channels: &["Position.X", "Position.Y", "Position.Z"],
        has_integers: false,
        write: |tile, out| {
            let of_scene =
                |point| tile.source.recentering.map_or(point, |recentering| recentering.point_back(point));
            let world = tile.source.world;
            tile.write_hits(out, [0.0; 3], |ray, hit| {
                of_scene(world.position(ray, hit)).as_vec3().to_array()
            });
        },
    },
    Aov {
        name: "normal",
        summary: "unit normal of the triangle or shape, towards the camera; 0 for the background",
        channels: &["Normal.X", "Normal.Y", "Normal.Z"],
        has_integers: false,
        write: |tile, out| {
            let world = tile.source.world;
            tile.write_hits(out, [0.0; 3], |ray, hit| world.geometric_normal(ray, hit).as_vec3().to_array());
        },
    },
    Aov {
        name: SHADING_NORMAL,
        summary: "shading normal towards the camera, mean of the samples; 0 for the background",
        channels: &["ShadingNormal.X", "ShadingNormal.Y", "ShadingNormal.Z"],
        has_integers: false,
        write: |tile, out| write(out, &tile.features, |features| features.first[1]),
    },
    Aov {
        name: "albedo",
        summary: "surface colour without lighting, mean of the samples; 0 for the background",
        channels: &["Albedo.R", "Albedo.G", "Albedo.B"],
        has_integers: false,
        write: |tile, out| write(out, &tile.features, |features| features.first[0]),
    },
    Aov {
        name: DENOISING[0],
        summary: "`albedo` of the first surface that is neither a smooth mirror nor clear glass",
        channels: &["DenoisingAlbedo.R", "DenoisingAlbedo.G", "DenoisingAlbedo.B"],
        has_integers: false,
        write: |tile, out| write(out, &tile.features, |features| features.behind_mirrors[0]),
    },
    Aov {
        name: DENOISING[1],
        summary: "`shading-normal` of that surface",
        channels: &["DenoisingNormal.X", "DenoisingNormal.Y", "DenoisingNormal.Z"],
        has_integers: false,
        write: |tile, out| write(out, &tile.features, |features| features.behind_mirrors[1]),
    },
    Aov {
        name: "object",
        summary: "index of the object, from 0; -1 for the background",
        channels: &["Object.X"],
        has_integers: true,
        write: |tile, out| tile.write_indices(out, |world, hit| world.object_of(hit.prim)),
    },
    Aov {
        name: "material",
        summary: "index of the material; -1 for the background",
        channels: &["Material.X"],
        has_integers: true,
        write: |tile, out| {
            tile.write_indices(out, |world, hit| world.objects[world.object_of(hit.prim) as usize].material);
        },
    },
    Aov {
        name: "primitive",
        summary: "index of the triangle or analytic shape; -1 for the background",
        channels: &["Primitive.X"],
        has_integers: true,
        write: |tile, out| tile.write_indices(out, |_, hit| hit.prim.0),
    },
    Aov {
        name: Matte::Objects.aov(),
        summary: "Cryptomatte of the names of objects: ids with the part of the pixel that each covers",
        channels: Matte::Objects.channels(),
        has_integers: false,
        write: |tile, out| tile.write_mattes(out, Matte::Objects),
    },
    Aov {
        name: Matte::Materials.aov(),
        summary: "Cryptomatte of the names of materials",
        channels: Matte::Materials.channels(),
        has_integers: false,
        write: |tile, out| tile.write_mattes(out, Matte::Materials),
    },
    Aov {
        name: "samples",
        summary: "number of samples of the pixel",
        channels: &["Samples.X"],
        has_integers: true,
        write: |tile, out| write(out, &tile.samples, |samples| [samples.count as f32]),
    },
    Aov {
        name: "variance",
        summary: "unbiased variance of the pixel's samples; infinite for one sample",
        channels: &["Variance.R", "Variance.G", "Variance.B"],
        has_integers: false,
        write: |tile, out| write(out, &tile.samples, |samples| samples.variance),
    },
    Aov {
        name: "node-tests",
        summary: "number of boxes of the acceleration structure tested by the camera ray",
        channels: &["NodeTests.X"],
        has_integers: true,
        write: |tile, out| write(out, &tile.node_tests, |&count| [count as f32]),
    },
];

/// The name of the AOV of a channel; for a channel of an effect, its layer.
pub fn name_of(channel: &str) -> &str {
    let aov = AOVS.iter().find(|aov| aov.channels.contains(&channel));
    aov.map_or_else(|| channel.split('.').next().unwrap_or(channel), |aov| aov.name)
}

/// Whether the values of the AOV of this name are integers: indices, and counts.
pub fn has_integers(name: &str) -> bool {
    AOVS.iter().any(|aov| aov.name == name && aov.has_integers)
}

/// The largest index up to which all are exact in the f32 channels.
pub const LARGEST_EXACT_INDEX: usize = 1 << 24;

/// Writes the channels of pixels, of as many values as there are channels.
fn write_all<const N: usize>(out: &mut [Vec<f32>], pixels: impl ExactSizeIterator<Item = [f32; N]>) {
    out.iter_mut().for_each(|channel| channel.resize(pixels.len(), 0.0));
    let mut channels = out.iter_mut();
    let mut channels: [&mut [f32]; N] =
        std::array::from_fn(|_| channels.next().map(Vec::as_mut_slice).unwrap_or_default());
    for (i, values) in pixels.enumerate() {
        channels.iter_mut().zip(values).for_each(|(channel, value)| channel[i] = value);
    }
}

/// Writes the channels of what each pixel has.
fn write<T, const N: usize>(out: &mut [Vec<f32>], pixels: &[T], value: impl Fn(&T) -> [f32; N]) {
    write_all(out, pixels.iter().map(value));
}

impl AovTile<'_> {
    /// Writes the channels of the pixels' hits; those of other pixels are `background`.
    fn write_hits<const N: usize>(
        &self,
        out: &mut [Vec<f32>],
        background: [f32; N],
        value: impl Fn(&Ray, &Hit) -> [f32; N],
    ) {
        let of_pixel = |(i, hit): (usize, &Option<Hit>)| {
            hit.as_ref().map_or(background, |hit| value(&self.rays.get(i), hit))
        };
        write_all(out, self.hits.iter().enumerate().map(of_pixel));
    }

    /// Writes the channel of a length in world units; infinite for the background.
    fn write_lengths(&self, out: &mut [Vec<f32>], length: impl Fn(&Ray, &Hit) -> f64) {
        let scale = self.source.recentering.map_or(1.0, |recentering| recentering.scale);
        self.write_hits(out, [f32::INFINITY], |ray, hit| [(length(ray, hit) / scale) as f32]);
    }

    /// Writes the channels of a Cryptomatte.
    fn write_mattes(&self, out: &mut [Vec<f32>], matte: Matte) {
        let ids = &self.ids[matte as usize];
        write(out, &self.features, |features| cryptomatte::pairs(&features.covered, ids));
    }

    /// Writes the channel of an index.
    fn write_indices(&self, out: &mut [Vec<f32>], index: impl Fn(&World, &Hit) -> u32) {
        self.write_hits(out, [-1.0], |_, hit| [index(self.source.world, hit) as f32]);
    }
}

/// The AOVs chosen by name.
pub struct AovSelection {
    aovs: Vec<&'static Aov>,
    effects: bool,
}

impl AovSelection {
    /// The AOVs of these names; `all` selects every one.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown name, with the nearest known one.
    pub fn new(names: &[String]) -> Result<Self> {
        let known: Vec<&str> = AOVS.iter().map(|aov| aov.name).chain([EFFECTS, "all"]).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            let hint = ended(name).map_or_else(|| nearest_name(name, &known), str::to_owned);
            return Err(Error::usage(format!("there is no AOV `{name}`"), hint));
        }
        let is_selected = |name: &str| names.iter().any(|n| n == name || n == "all");
        Ok(AovSelection {
            aovs: AOVS.iter().filter(|aov| is_selected(aov.name)).collect(),
            effects: is_selected(EFFECTS),
        })
    }

    /// The number of channels, for a plan with this many effects on.
    pub fn channel_count(&self, effects_on: usize) -> usize {
        let effects = if self.effects { 3 * (1 + effects_on) } else { 0 };
        self.aovs.iter().map(|aov| aov.channels.len()).sum::<usize>() + effects
    }

    /// The most bytes per pixel of temporary memory, beside the picture and the channels: a film of bytes for the
    /// tiles, or a film without an effect, its pixels in rows, and those of the film before.
    pub fn bytes_per_pixel(&self) -> u64 {
        if self.effects { 3 * 12 } else { 3 }
    }

    /// Whether values depend on the exposure, and the clamp that may come with it: those of light, and those of samples
    /// of which adaptive sampling takes as many as that needs.
    pub fn depends_on_exposure(&self, plan: &Plan) -> bool {
        let is_of_light = self.effects || has(&self.aovs, &["samples", "variance"]);
        is_of_light || plan.is_adaptive() && has(&self.aovs, &FILTERED)
    }

    /// The text attributes that describe the channels in a file.
    pub fn texts(&self, world: &World) -> Vec<(String, String)> {
        let selected = Matte::ALL.into_iter().filter(|matte| has(&self.aovs, &[matte.aov()]));
        selected.flat_map(|matte| matte.texts(world)).collect()
    }

    /// Whether the indices of primitives are selected.
    pub fn has_primitives(&self) -> bool {
        self.aovs.iter().any(|aov| aov.name == "primitive")
    }
}

/// The picture whose AOVs are computed.
pub struct AovSource<'a> {
    /// The prepared scene.
    pub world: &'a World,
    /// How the scene was recentered.
    pub recentering: Option<Recentering>,
    /// The camera.
    pub view: &'a View,
    /// The plan of the picture.
    pub plan: &'a Plan,
    /// The part of the picture that was rendered.
    pub window: Window,
    /// The shard of its tiles that was rendered.
    pub shard: Shard,
    /// The picture, if it exists. It saves rendering it again for the AOV of the effects.
    pub film: Option<&'a Film>,
    /// The display transform of the picture, which adaptive sampling reads.
    pub display: DisplayTransform,
}

/// Computes the selected channels, row by row from the top.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Memory`] where there is not enough memory.
pub fn channels(
    source: &AovSource,
    selection: &AovSelection,
    control: &RenderControl,
) -> Result<Vec<Channel>> {
    let mut channels = Vec::new();
    if !selection.aovs.is_empty() {
        channels.extend(pixel_channels(source, &selection.aovs, control)?);
    }
    if selection.effects {
        channels.extend(effect_channels(source, control)?);
    }
    Ok(channels)
}

/// The channels of the AOVs that are computed pixel by pixel.
fn pixel_channels(source: &AovSource, aovs: &[&Aov], control: &RenderControl) -> Result<Vec<Channel>> {
    let names: Vec<&str> = aovs.iter().flat_map(|aov| aov.channels).copied().collect();
    let Window { x, y, width, .. } = source.window;
    let area = source.window.area();
    let all: Vec<Mutex<Vec<f32>>> = names.iter().map(|_| Mutex::new(vec![0.0; area])).collect();
    let of_features = plan_without_light(source.plan, source.world, has(aovs, &DENOISING));
    let is_filtered = has(aovs, &FILTERED);
    let filter = is_filtered.then(|| filter_of(of_features.as_ref().unwrap_or(source.plan))).flatten();
    // A film of the same window has the same tiles as the picture.
    let mut tiles: Film<[u8; 3]> = Film::new(source.window)?;
    let ids = Matte::ALL.map(|matte| match has(aovs, &[matte.aov()]) {
        true => matte.ids(source.world),
        false => Vec::new(),
    });
    let plans = AovPlans { of_features: of_features.as_ref(), filter: filter.as_ref(), ids };
    tiles.tiles_mut().into_par_iter().enumerate().for_each_init(
        TileBuffers::default,
        |buffers, (place, part)| {
            if !source.shard.has(place) || control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
                return;
            }
            plans.compute(source, aovs, buffers, part.window);
            for (channel, values) in all.iter().zip(&buffers.values) {
                let Ok(mut channel) = channel.lock() else { continue };
                for (row, values) in values.chunks(part.window.width as usize).enumerate() {
                    let start = (part.window.y - y) as usize + row;
                    let start = start * width as usize + (part.window.x - x) as usize;
                    channel[start..start + values.len()].copy_from_slice(values);
                }
            }
        },
    );
    if control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    let channels = names.into_iter().zip(all);
    Ok(channels
        .map(|(name, values)| Channel { name: name.into(), values: values.into_inner().unwrap_or_default() })
        .collect())
}

/// The AOVs of [`Features`].
const FILTERED: [&str; 6] = ["albedo", SHADING_NORMAL, DENOISING[0], DENOISING[1], MATTES[0], MATTES[1]];

/// The AOVs of [`Matte`].
const MATTES: [&str; 2] = [Matte::Objects.aov(), Matte::Materials.aov()];

/// The AOVs of the hit through each pixel's centre.
const OF_HITS: [&str; 7] = ["depth", "distance", "position", "normal", "object", "material", "primitive"];

fn has(aovs: &[&Aov], names: &[&str]) -> bool {
    aovs.iter().any(|aov| names.contains(&aov.name))
}

/// The working set of a thread.
#[derive(Default)]
struct TileBuffers {
    tile: Tile,
    found: HitBuffer,
    hits: Vec<Option<Hit>>,
    /// For each channel, the values of the tile's pixels.
    values: Vec<Vec<f32>>,
}

/// What all tiles share.
struct AovPlans<'a> {
    /// The plan for albedo and normal, if it is not the picture's.
    of_features: Option<&'a Plan>,
    /// The filter of its samples.
    filter: Option<&'a ReconstructionFilter>,
    /// The ids of each [`Matte`] that is selected.
    ids: [Vec<u32>; 2],
}

impl AovPlans<'_> {
    /// Computes the values of a tile.
    fn compute(&self, source: &AovSource, aovs: &[&Aov], buffers: &mut TileBuffers, window: Window) {
        let TileBuffers { tile, found, hits, values } = buffers;
        let world = source.world;
        let context =
            RenderContext { world, view: source.view, display: source.display, is_displayed: false };
        let reads_samples = has(aovs, &["samples", "variance"]);
        let (mut samples, mut features) = (Vec::new(), Vec::new());
        if has(aovs, &FILTERED) {
            let plan = self.of_features.unwrap_or(source.plan);
            let mut sums = FeatureSums::new(tile, has(aovs, &MATTES));
            let first = |tile: &Tile| first_surfaces(tile, world);
            samples = plan.sample_statistics(tile, &context, window, first, |tile, first| {
                sums.add_pass(plan, tile, first);
            });
            features = sums.finish(self.filter, tile);
        }
        let is_sampled = !features.is_empty() && self.of_features.is_none();
        if reads_samples && !is_sampled {
            samples = source.plan.sample_statistics(tile, &context, window, |_| (), |_, ()| {});
        }
        tile.start(window);
        source.plan.centre_rays(tile, &context);
        let Tile { generations, traversal, .. } = tile;
        let (rays, mut node_tests) = (generations[0].rays.rays(), Vec::new());
        found.clear();
        if has(aovs, &["node-tests"]) {
            for ray in rays.iter() {
                let before = traversal.tests.nodes;
                found.push(source.plan.visible_hit(world, &ray, traversal).as_ref());
                node_tests.push(traversal.tests.nodes - before);
            }
        } else if has(aovs, &OF_HITS) {
            source.plan.visible_hits(world, rays, found, traversal);
        }
        // An added ground is no object of the scene.
        let is_of_scene = |hit: &Hit| world.ground.is_none_or(|ground| world.object_of(hit.prim) != ground);
        hits.clear();
        hits.extend(found.iter().map(|hit| hit.filter(is_of_scene)));
        let ids = &self.ids;
        let tile = AovTile { source, rays, hits, samples, features, ids, node_tests };
        values.resize_with(aovs.iter().map(|aov| aov.channels.len()).sum(), Vec::new);
        let mut rest = &mut values[..];
        for aov in aovs {
            let (channels, further) = rest.split_at_mut(aov.channels.len());
            (aov.write)(&tile, channels);
            rest = further;
        }
    }
}

/// The picture without effects, and what each effect adds.
fn effect_channels(source: &AovSource, control: &RenderControl) -> Result<Vec<Channel>> {
    let &AovSource { world, view, plan, window, shard, film, display, .. } = source;
    let context = RenderContext { world, view, display, is_displayed: false };
    let on: Vec<usize> = (0..plan.decisions.len()).filter(|&i| plan.decisions[i].on).collect();
    let mut before: Option<Vec<[f32; 3]>> = None;
    let mut channels = Vec::new();
    for count in 0..=on.len() {
        let whole = film.filter(|_| count == on.len());
        let pixels: Vec<[f32; 3]> = if let Some(film) = whole {
            film.rows().collect()
        } else {
            let plan = plan.keeping(world, |i| on[..count].contains(&i));
            let is_selected = |place: usize, _: Window| shard.has(place);
            let control = RenderControl { time_stages: false, ..*control };
            render_displayed::<[f32; 3]>(&context, &plan, window, is_selected, &control)?.0.rows().collect()
        };
        let layer = match count {
            0 => "Base".to_owned(),
            _ => layer_of(plan.decisions[on[count - 1]].effect.name()),
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

/// The layer of an effect's channels, in camel case: `EffectNormalMaps`. `Effect` keeps it apart from other AOVs.
fn layer_of(effect: &str) -> String {
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
        let select =
            |names: &[&str]| AovSelection::new(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(select(&["all"]).unwrap().aovs.len(), AOVS.len());
        let some = select(&["depth", "effects"]).unwrap();
        assert!(some.effects && some.aovs.len() == 1 && !some.has_primitives());
        let error = select(&["depht"]).err().unwrap();
        assert_eq!(
            (error.to_string().as_str(), error.hint()),
            ("there is no AOV `depht`", "did you mean `depth`?")
        );
    }

    #[test]
    fn layers_have_names_of_their_own() {
        assert_eq!(layer_of("normal-maps"), "EffectNormalMaps");
    }
}
