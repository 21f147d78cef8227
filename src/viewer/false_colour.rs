//! False colours with legends, for AOVs and errors.
//!
//! Values are the AOVs of [`crate::render::aov`] at pixel centres, and the error map of [`crate::metrics`]. This
//! module only maps them to colours.

use crate::error::{Error, Result, printable};
use crate::film::write::Channel;
use crate::metrics::{ComparedImage, DECADES, error_map, heat_map};
use crate::render::RenderControl;
use crate::render::aov::{self, AovSelection, AovSource};
use crate::world::World;

/// Quantity that the window displays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum DisplayMode {
    /// The picture itself.
    #[default]
    Picture,
    /// Shading normals.
    Normals,
    /// Geometric normals.
    GeometricNormals,
    /// Depth: the distance from the camera.
    Depth,
    /// Object numbers.
    Objects,
    /// Material numbers.
    Materials,
    /// Primitive numbers.
    Primitives,
    /// Number of box tests per camera ray.
    NodeTests,
    /// Error of the picture against the tier `exact`.
    ErrorAgainstExact,
}

names!(DisplayMode {
    Picture = "picture",
    Normals = "normals",
    GeometricNormals = "geometric normals",
    Depth = "depth",
    Objects = "objects",
    Materials = "materials",
    Primitives = "primitives",
    NodeTests = "node tests",
    ErrorAgainstExact = "error against exact",
});

impl DisplayMode {
    /// What is displayed, and when one wants it.
    pub fn meaning(self) -> &'static str {
        match self {
            DisplayMode::Picture => "the rendered picture",
            DisplayMode::Normals => {
                "directions that surfaces are shaded with; shows seams and inverted normals"
            }
            DisplayMode::GeometricNormals => "directions that the triangles face; shows how fine a mesh is",
            DisplayMode::Depth => "distance from the camera, near light and far dark",
            DisplayMode::Objects => "a colour for each object; shows what the file calls them",
            DisplayMode::Materials => "a colour for each material; shows what has the same surface",
            DisplayMode::Primitives => "a colour for each triangle or analytic shape; shows the mesh",
            DisplayMode::NodeTests => "boxes that the camera ray is tested against; shows what takes long",
            DisplayMode::ErrorAgainstExact => {
                "difference from exact arithmetic; shows where rounding changes the picture"
            }
        }
    }

    /// The displayed AOV; `None` for modes that display rendered pictures.
    pub fn aov(self) -> Option<&'static str> {
        match self {
            DisplayMode::Picture | DisplayMode::ErrorAgainstExact => None,
            DisplayMode::Normals => Some("normal"),
            DisplayMode::GeometricNormals => Some("geometric-normal"),
            DisplayMode::Depth => Some("depth"),
            DisplayMode::Objects => Some("object"),
            DisplayMode::Materials => Some("material"),
            DisplayMode::Primitives => Some("primitive"),
            DisplayMode::NodeTests => Some("node-tests"),
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
    if mode == DisplayMode::Depth {
        // Which pixels are the ground.
        aovs.extend(DisplayMode::Objects.aov().map(str::to_owned));
    }
    let channels = aov::channels(source, &AovSelection::new(&aovs)?, control)?;
    Ok(of_channels(mode, source.world, &channels))
}

/// Maps the channels of a mode's AOV to false colours.
pub fn of_channels(mode: DisplayMode, world: &World, channels: &[Channel]) -> FalseColours {
    let first: &[f32] = channels.first().map_or(&[], |channel| &channel.values);
    match (mode, channels) {
        (DisplayMode::Normals | DisplayMode::GeometricNormals, [x, y, z]) => {
            normals(mode, &x.values, &y.values, &z.values)
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
        (DisplayMode::Primitives, _) => ids("each triangle and analytic shape has a colour", first, |_| None),
        _ => counts("boxes that the camera ray is tested against", first),
    }
}

/// Error map of a picture against the exact one.
///
/// # Errors
/// [`Error::Usage`] if the sizes differ.
pub fn error_against_exact(picture: &ComparedImage, exact: &ComparedImage) -> Result<FalseColours> {
    if (picture.width, picture.height) != (exact.width, exact.height) {
        return Err(Error::usage("the pictures have different sizes", "compare pictures of one size"));
    }
    let same = picture.displayed() == exact.displayed();
    let text = "largest difference of a channel as displayed, on a logarithmic scale";
    let legend = Legend {
        text: if same { format!("{text}; there is none") } else { text.into() },
        bar: heat_bar(),
        ends: Some([format!("1e{} or less", DECADES[0]), "1, white for black".into()]),
        swatches: Vec::new(),
    };
    Ok(FalseColours { pixels: error_map(picture, exact), legend })
}

fn normals(mode: DisplayMode, x: &[f32], y: &[f32], z: &[f32]) -> FalseColours {
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
        (NOTHING, "nothing".into()),
    ];
    let text = match mode {
        DisplayMode::Normals => "normals for shading, on the camera's side: n / 2 + 1/2",
        _ => "normals of the triangles and shapes, on the camera's side: n / 2 + 1/2",
    };
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
                format!(
                    "distance from the camera, from the {near}th to the {far}th percentile of the objects' pixels"
                )
            }
            false => "nothing is seen".into(),
        },
        bar: (0..BAR).map(|i| grey(i as f32 / (BAR - 1) as f32)).collect(),
        ends: is_something.then(|| [short(nearest), short(farthest)]),
        swatches: vec![(NOTHING, "nothing".into())],
    };
    FalseColours { pixels: depths.iter().map(colour).collect(), legend }
}

fn counts(text: &str, counts: &[f32]) -> FalseColours {
    let largest = counts.iter().copied().fold(0.0, f32::max);
    let shares: Vec<f32> = counts.iter().map(|count| count / largest.max(1.0)).collect();
    let legend = Legend {
        text: text.into(),
        bar: heat_bar(),
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
    swatches.push((NOTHING, "nothing".into()));
    let text = format!("{text}; {} to be seen", most.len());
    FalseColours {
        pixels: ids.iter().map(colour).collect(),
        legend: Legend { text, bar: Vec::new(), ends: None, swatches },
    }
}

/// The colour of a number, distinct from those of adjacent numbers.
///
/// Hue and lightness are points of a low-discrepancy sequence: powers of the inverse of the plastic number, the real
/// root of x^3 = x + 1 (Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018). The colour space is
/// OKLab (Ottosson, A perceptual color space for image processing, 2020), where equal distances are perceived as equal
/// differences.
pub fn colour_of(id: u32) -> [u8; 3] {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let point = |power: i32| (0.5 + f64::from(id) * PLASTIC.powi(-power)).fract();
    let (hue, lightness) = (std::f64::consts::TAU * point(1), 0.55 + 0.35 * point(2));
    let (a, b) = (0.12 * hue.cos(), 0.12 * hue.sin());
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ];
    linear.map(|c| crate::film::colour::quantise(crate::film::colour::srgb_encode(c)))
}

fn heat_bar() -> Vec<[u8; 3]> {
    let shares: Vec<f32> = (0..BAR).map(|i| i as f32 / (BAR - 1) as f32).collect();
    heat_map(&shares)
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
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::bvh::Layout;
    use crate::effects::{Choices, Plan};
    use crate::error::Warnings;
    use crate::farm::Shard;
    use crate::film::Window;
    use crate::metrics::Values;
    use crate::scene::Numerics;
    use crate::world::View;

    /// False colours of the assignment scene from view 2, at `size` x `size` pixels.
    fn false_colours_of_scene(mode: DisplayMode, size: u32) -> FalseColours {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/assignment.toml");
        let scene = crate::import::load(&[file], &mut Warnings::default()).unwrap();
        let camera = scene.cameras[0].clone();
        let view = View::new(&camera, camera.projection, [size, size]).unwrap();
        let world = World::prepare(scene, Default::default(), Layout::default(), Numerics::default());
        let plan = Plan::new(&world, &Choices::default()).unwrap();
        let window = Window { x: 0, y: 0, width: size, height: size };
        let source = AovSource {
            world: &world,
            recentering: None,
            view: &view,
            plan: &plan,
            window,
            shard: Shard::ALL,
            film: None,
            display: Default::default(),
        };
        let control =
            RenderControl { cancel: &AtomicBool::new(false), progress: &|_, _| {}, time_stages: false };
        false_colours(mode, &source, &control).unwrap()
    }

    #[test]
    fn the_plane_is_green_from_above_and_the_sky_is_nothing() {
        let normals = false_colours_of_scene(DisplayMode::Normals, 32);
        // The bottom row sees the plane, whose normal is (0, 1, 0); the top row sees above its horizon.
        assert_eq!(normals.pixels[31 * 32], [128, 255, 128]);
        assert_eq!(normals.pixels[0], NOTHING);
        assert_eq!(
            false_colours_of_scene(DisplayMode::GeometricNormals, 32).pixels[31 * 32],
            [128, 255, 128]
        );
    }

    #[test]
    fn near_is_light() {
        let depths = false_colours_of_scene(DisplayMode::Depth, 32);
        let [bottom, higher] = [31, 24].map(|row| depths.pixels[row * 32][0]);
        assert!(bottom > higher, "{bottom} {higher}");
        assert_eq!(depths.pixels.iter().map(|p| p[0]).max(), Some(250));
        assert_eq!(depths.pixels.iter().filter(|p| **p != NOTHING).map(|p| p[0]).min(), Some(40));
        let even = super::depths(&[2.0, 2.0, f32::INFINITY], |_| false);
        assert_eq!(even.pixels, [[250; 3], [250; 3], NOTHING]);
        assert_eq!(even.legend.ends, Some(["2".into(), "2".into()]));
        assert_eq!(super::depths(&[f32::INFINITY], |_| false).legend.ends, None);
        // Of 101 depths the percentiles 5 and 95 have the indices 5 and 95: a far pixel does not change them.
        let mut ramp: Vec<f32> = (0..=100).map(|i| i as f32).collect();
        ramp[100] = 1e9;
        let scaled = super::depths(&ramp, |_| false);
        assert_eq!(scaled.legend.ends, Some(["5".into(), "95".into()]));
        // Half-way between them: 250 - 210 / 2.
        let grey = [0, 5, 50, 95, 100].map(|i| scaled.pixels[i][0]);
        assert_eq!(grey, [250, 250, 145, 40, 40]);
        // Where all from 21 on are the ground, the 21 others have their indices 1 and 19 at the ends.
        assert_eq!(super::depths(&ramp, |i| i > 20).legend.ends, Some(["1".into(), "19".into()]));
        // A ground alone is scaled by its own depths.
        assert_eq!(super::depths(&ramp, |_| true).pixels, scaled.pixels);
    }

    #[test]
    fn objects_are_named_and_have_their_colours() {
        let objects = false_colours_of_scene(DisplayMode::Objects, 64);
        let names: Vec<&str> = objects.legend.swatches.iter().map(|(_, name)| name.as_str()).collect();
        // The plane covers the most pixels.
        assert_eq!(names[0], "plane");
        for name in ["left sphere", "right sphere", "tetrahedron", "nothing"] {
            assert!(names.contains(&name), "{names:?}");
        }
        for (colour, name) in &objects.legend.swatches {
            assert!(objects.pixels.contains(colour), "{name}");
        }
        // Object 0 is the left sphere, 1 the right sphere, 2 the plane.
        assert_eq!(objects.legend.swatches[0].0, colour_of(2));
        assert!(
            false_colours_of_scene(DisplayMode::Materials, 64)
                .legend
                .swatches
                .iter()
                .any(|(_, name)| name == "patriarch")
        );
        assert_eq!(false_colours_of_scene(DisplayMode::Primitives, 64).legend.swatches.len(), 1);
    }

    #[test]
    fn node_tests_end_at_their_largest_number() {
        let counts = super::counts("boxes", &[0.0, 8.0, 16.0]);
        assert_eq!(counts.pixels, heat_map(&[0.0, 0.5, 1.0]));
        assert_eq!(counts.legend.ends, Some(["0".into(), "16".into()]));
        assert!(
            false_colours_of_scene(DisplayMode::NodeTests, 16)
                .pixels
                .iter()
                .any(|p| *p == heat_map(&[1.0])[0])
        );
    }

    #[test]
    fn numbers_have_colours_far_apart() {
        // Any two of 24 consecutive numbers: a channel differs by at least 12 of 255; all are far from `NOTHING`.
        let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap();
        for start in [0, 1000, 123_456] {
            let colours: Vec<_> = (start..start + 24).map(colour_of).collect();
            for (i, &a) in colours.iter().enumerate() {
                assert!(apart(a, NOTHING) > 60, "{a:?}");
                colours[..i].iter().for_each(|&b| assert!(apart(a, b) >= 12, "{a:?} {b:?}"));
            }
        }
    }

    #[test]
    fn errors_are_on_the_scale_of_the_study() {
        let even = |value: f32, width: u32| ComparedImage {
            width,
            height: 1,
            values: Values::Display,
            pixels: vec![[value; 3]; width as usize],
            alpha: None,
        };
        // 1e-4 is half-way from 1e-8 to 1.
        let map = error_against_exact(&even(1e-4, 2), &even(0.0, 2)).unwrap();
        assert_eq!(map.pixels, [heat_map(&[0.5])[0]; 2]);
        assert!(
            error_against_exact(&even(0.5, 2), &even(0.5, 2)).unwrap().legend.text.contains("there is none")
        );
        assert!(error_against_exact(&even(0.5, 2), &even(0.5, 3)).is_err());
    }

    #[test]
    fn numbers_are_short() {
        for (x, text) in
            [(0.0, "0"), (2.0, "2"), (1234.5, "1234"), (100.0, "100"), (0.25, "0.25"), (1e-9, "1.000e-9")]
        {
            assert_eq!(short(x), text);
        }
    }
}
