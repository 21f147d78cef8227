//! False colours of AOVs ([`kiln::render::aov`]), with legends.

use kiln::error::{Error, Result, printable};
use kiln::film::write::Channel;
use kiln::metrics::heat_map;
use kiln::render::RenderControl;
use kiln::render::aov::{self, AovSelection, AovSource};
use kiln::world::World;

/// Quantity that the window displays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum DisplayMode {
    /// The picture itself.
    #[default]
    Picture,
    /// Shading normals.
    Normals,
    /// Depth: the distance from the camera along its line of sight.
    Depth,
    /// Surface colours without lighting.
    Albedo,
    /// Object numbers.
    Objects,
    /// Material numbers.
    Materials,
    /// Number of camera rays of each pixel.
    Rays,
}

kiln::names!(DisplayMode {
    Picture = "picture",
    Normals = "normals",
    Depth = "depth",
    Albedo = "albedo",
    Objects = "objects",
    Materials = "materials",
    Rays = "rays a pixel",
});

impl DisplayMode {
    /// What is displayed, and when one wants it.
    pub fn meaning(self) -> &'static str {
        match self {
            DisplayMode::Picture => "the rendered picture",
            DisplayMode::Normals => {
                "directions that surfaces are shaded with; shows seams and inverted normals"
            }
            DisplayMode::Depth => "distance from the camera along its line of sight, near light and far dark",
            DisplayMode::Albedo => "surface colours without light; shows textures as they are",
            DisplayMode::Objects => "a colour for each object; shows what the file calls them",
            DisplayMode::Materials => "a colour for each material; shows which objects share one",
            DisplayMode::Rays => "samples of each pixel; shows where a noise threshold takes long",
        }
    }

    /// The displayed AOV; `None` for the picture.
    pub fn aov(self) -> Option<&'static str> {
        match self {
            DisplayMode::Picture => None,
            DisplayMode::Normals => Some("shading-normal"),
            DisplayMode::Depth => Some("depth"),
            DisplayMode::Albedo => Some("albedo"),
            DisplayMode::Objects => Some("object"),
            DisplayMode::Materials => Some("material"),
            DisplayMode::Rays => Some("samples"),
        }
    }
}

/// An image in false colours.
#[derive(Debug, Clone, PartialEq)]
pub struct FalseColours {
    /// Pixels, row by row from the top, in display values.
    pub pixels: Vec<[u8; 3]>,
    /// Legend.
    pub legend: Legend,
}

/// Legend of false colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Legend {
    /// Short description.
    pub text: String,
    /// Colours of a continuous scale at even distances; empty without a scale.
    pub bar: Vec<[u8; 3]>,
    /// Values at both ends of the scale.
    pub ends: Option<[String; 2]>,
    /// Single colours and their meanings; if there are many, those with the most pixels.
    pub swatches: Vec<([u8; 3], String)>,
}

/// Colour of pixels without a hit, distinct from all other colours.
pub const NOTHING: [u8; 3] = [20, 24, 52];

/// Depths are grey levels from this, the farthest, to [`NEAREST`].
const FARTHEST: f32 = 40.0;
const NEAREST: f32 = 250.0;

/// Percentiles of the depths that have these grey levels, so that a few far pixels do not make all others equal.
const DEPTH_PERCENTILES: [usize; 2] = [5, 95];

/// Number of colours of a bar.
const BAR: usize = 64;

/// Maximum number of named colours of a legend.
const SWATCHES: usize = 12;

/// Computes an AOV and maps it to false colours.
///
/// # Errors
/// [`Error::Usage`] for modes without an AOV, [`Error::Interrupted`] when cancelled, [`Error::Failed`] without enough
/// memory.
pub fn false_colours(mode: DisplayMode, source: &AovSource, control: &RenderControl) -> Result<FalseColours> {
    let Some(aov) = mode.aov() else {
        let what = format!("{}: shown by pictures, not by what is known of their pixels", mode.name());
        return Err(Error::usage(what, ""));
    };
    let mut aovs = vec![aov.to_owned()];
    if let DisplayMode::Depth | DisplayMode::Albedo = mode {
        // Which pixels are the ground or the background.
        aovs.extend(DisplayMode::Objects.aov().map(str::to_owned));
    }
    let channels = aov::channels(source, &AovSelection::new(&aovs)?, control)?;
    Ok(of_channels(mode, source.world, &channels))
}

/// Maps the channels of a mode's AOV to false colours.
pub fn of_channels(mode: DisplayMode, world: &World, channels: &[Channel]) -> FalseColours {
    let first: &[f32] = channels.first().map_or(&[], |channel| &channel.values);
    match (mode, channels) {
        (DisplayMode::Normals, [x, y, z]) => normals(&x.values, &y.values, &z.values),
        (DisplayMode::Albedo, [r, g, b, objects]) => {
            let channels = [&r.values, &g.values, &b.values];
            let colour = |i: usize| world.pipeline.encode(channels.map(|channel| channel[i]));
            let colour = |i: usize| if objects.values[i] < 0.0 { NOTHING } else { colour(i) };
            let swatches = vec![(NOTHING, "background".into())];
            let text = "surface colours without light".into();
            let legend = Legend { text, bar: Vec::new(), ends: None, swatches };
            FalseColours { pixels: (0..first.len()).map(colour).collect(), legend }
        }
        (DisplayMode::Depth, [_, objects, ..]) => {
            let ground = world.ground.map(|ground| ground as f32);
            depths(first, |i| objects.values.get(i).copied() == ground)
        }
        (DisplayMode::Depth, _) => depths(first, |_| false),
        (DisplayMode::Objects, _) => {
            let name = |id: usize| world.objects.get(id).map(|object| printable(&object.name).into_owned());
            ids("each object has a colour", first, name)
        }
        (DisplayMode::Materials, _) => ids("each material has a colour", first, |id| {
            world.materials.get(id).map(|material| printable(material.name()).into_owned())
        }),
        _ => counts("camera rays of each pixel: the samples that it took", first),
    }
}

fn normals(x: &[f32], y: &[f32], z: &[f32]) -> FalseColours {
    let colour = |n: [f32; 3]| {
        if n == [0.0; 3] { NOTHING } else { n.map(|c| ((c / 2.0 + 0.5) * 255.0).round() as u8) }
    };
    let pixels = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| colour([x, y, z])).collect();
    let axis = |name: &str, n| (colour(n), name.to_owned());
    let swatches = vec![
        axis("+x", [1.0, 0.0, 0.0]),
        axis("-x", [-1.0, 0.0, 0.0]),
        axis("+y", [0.0, 1.0, 0.0]),
        axis("-y", [0.0, -1.0, 0.0]),
        axis("+z", [0.0, 0.0, 1.0]),
        axis("-z", [0.0, 0.0, -1.0]),
        (NOTHING, "background".into()),
    ];
    let text = "normals for shading, on the camera's side: n / 2 + 1/2";
    FalseColours { pixels, legend: Legend { text: text.into(), bar: Vec::new(), ends: None, swatches } }
}

/// Depths, scaled by those of the pixels that are not `ground`, unless they all are.
fn depths(depths: &[f32], is_ground: impl Fn(usize) -> bool) -> FalseColours {
    let finite = |with_ground: bool| -> Vec<f32> {
        let counts = |&(i, depth): &(usize, f32)| depth.is_finite() && (with_ground || !is_ground(i));
        depths.iter().copied().enumerate().filter(counts).map(|(_, depth)| depth).collect()
    };
    let mut scaled = finite(false);
    if scaled.is_empty() {
        scaled = finite(true);
    }
    scaled.sort_unstable_by(f32::total_cmp);
    let at = |percentile: usize| {
        let index = scaled.len().saturating_sub(1) * percentile / 100;
        scaled.get(index).copied().unwrap_or(f32::INFINITY)
    };
    let [nearest, farthest] = DEPTH_PERCENTILES.map(at);
    let grey = |share: f32| [(NEAREST + (FARTHEST - NEAREST) * share).round() as u8; 3];
    // A single depth is drawn as the nearest.
    let share = |depth: f32| match farthest > nearest {
        true => ((depth - nearest) / (farthest - nearest)).clamp(0.0, 1.0),
        false => 0.0,
    };
    let colour = |depth: &f32| if depth.is_finite() { grey(share(*depth)) } else { NOTHING };
    let is_something = nearest.is_finite();
    let legend = Legend {
        text: match is_something {
            true => {
                let [near, far] = DEPTH_PERCENTILES;
                format!("depth, from the {near}th to the {far}th percentile of the objects' pixels")
            }
            false => "no object is in the picture".into(),
        },
        bar: (0..BAR).map(|i| grey(i as f32 / (BAR - 1) as f32)).collect(),
        ends: is_something.then(|| [short(nearest), short(farthest)]),
        swatches: vec![(NOTHING, "background".into())],
    };
    FalseColours { pixels: depths.iter().map(colour).collect(), legend }
}

fn counts(text: &str, counts: &[f32]) -> FalseColours {
    let largest = counts.iter().copied().fold(0.0, f32::max);
    let shares: Vec<f32> = counts.iter().map(|count| count / largest.max(1.0)).collect();
    let bar: Vec<f32> = (0..BAR).map(|i| i as f32 / (BAR - 1) as f32).collect();
    let legend = Legend {
        text: text.into(),
        bar: heat_map(&bar),
        ends: Some(["0".into(), short(largest.max(1.0))]),
        swatches: Vec::new(),
    };
    FalseColours { pixels: heat_map(&shares), legend }
}

fn ids(text: &str, ids: &[f32], name: impl Fn(usize) -> Option<String>) -> FalseColours {
    let colour = |&id: &f32| if id < 0.0 { NOTHING } else { colour_of(id as u32) };
    let mut pixels_of = std::collections::BTreeMap::<u32, usize>::new();
    ids.iter().filter(|&&id| id >= 0.0).for_each(|&id| *pixels_of.entry(id as u32).or_default() += 1);
    let mut most: Vec<(u32, usize)> = pixels_of.into_iter().collect();
    // Stable: equal counts stay in ascending order of numbers.
    most.sort_by_key(|&(_, pixels)| std::cmp::Reverse(pixels));
    let named = most.iter().filter_map(|&(id, _)| Some((colour_of(id), name(id as usize)?)));
    let mut swatches: Vec<([u8; 3], String)> = named.take(SWATCHES).collect();
    swatches.push((NOTHING, "background".into()));
    let text = format!("{text}; {} in the picture", most.len());
    FalseColours {
        pixels: ids.iter().map(colour).collect(),
        legend: Legend { text, bar: Vec::new(), ends: None, swatches },
    }
}

/// The colour of a number. Hues of adjacent numbers are at least 100 degrees apart.
///
/// The hue is the golden ratio's sequence, which keeps any first numbers far from each other, the lightness another
/// low-discrepancy sequence, the square root of 1/2. The colour space is OKLab (Ottosson, A perceptual color space for
/// image processing, 2020), where equal distances are perceived as equal differences.
pub fn colour_of(id: u32) -> [u8; 3] {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let point = |offset: f64, step: f64| (offset + f64::from(id) * step).fract();
    let hue = std::f64::consts::TAU * point(0.0, GOLDEN);
    let lightness = 0.45 + 0.45 * point(0.5, std::f64::consts::FRAC_1_SQRT_2);
    let (a, b) = (0.16 * hue.cos(), 0.16 * hue.sin());
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ];
    linear.map(|c| kiln::film::rounding::quantise(kiln::film::colour::srgb_encode(c)))
}

/// The number with four significant digits.
fn short(x: f32) -> String {
    if x != 0.0 && !(1e-3..1e6).contains(&x.abs()) {
        return format!("{x:.3e}");
    }
    let digits = 3 - x.abs().max(1.0).log10().floor() as i32;
    let text = format!("{x:.*}", digits.max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests;
