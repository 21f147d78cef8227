//! `kiln render`: files to a picture.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;

use super::progress::{Mode, Progress};
use super::sampling::{SamplingArguments, TargetArguments};
use super::statistics::{self, Seconds};
use super::{Printer, picture};
use crate::bvh::{Preset, Structure};
use crate::effects::{Choices, Plan, RayKind, check_names, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::film::output::{describe, write_whole};
use crate::film::write::{Format, Picture, encode, write_picture};
use crate::film::{ColourPipeline, Film, Pixel, Window};
use crate::import;
use crate::render::aov::{self, LARGEST_NUMBER, Subject, Wanted};
use crate::render::{Clock, Statistics, Watch, render_as};
use crate::scene::{Camera, Numerics, Projection, Scene};
use crate::shading::ShadingMode;
use crate::study::choose::{self, End, Wish};
use crate::world::{Range, View, World, bring_into_range, headlight};

/// What there is to see, and how: what every command that makes pictures is told.
#[derive(Args)]
pub struct Arguments {
    /// Files to put into one scene: .toml, .obj, .gltf, .glb; `-` for a scene file or GLB on standard input
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// A camera of the scene by name or by number, or `auto` for one that fits
    #[arg(long, value_name = "NAME|INDEX|auto")]
    pub camera: Option<String>,
    /// A camera that fits the scene, from a standard side
    #[arg(long, conflicts_with = "camera", value_parser = ["front", "back", "left", "right", "top", "bottom", "iso"])]
    pub view: Option<String>,
    /// Replace the camera's projection
    #[arg(long, value_parser = ["perspective", "orthographic"])]
    projection: Option<String>,
    /// Size of the picture in pixels
    #[arg(long, allow_hyphen_values = true, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Render only this part of the picture: left, top, width and height in pixels
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,W,H", value_parser = parse_crop)]
    pub crop: Option<Window>,
    /// Threads to work on [default: all]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    pub threads: Option<u16>,
    /// How exactly it is decided what a ray hits [default: the scene's, or watertight]
    #[arg(long, value_name = "TIER", value_parser = ["fast", "watertight", "double", "exact"])]
    numerics: Option<String>,
    /// How much work is spent on building the tree that rays go through; the picture does not depend on it
    #[arg(long, value_name = "PRESET", value_parser = Preset::ALL.map(Preset::name), default_value = Preset::default().name())]
    bvh: String,
    /// How far shading goes; below `phong` that term is shown alone, without effects
    #[arg(long, value_parser = ["flat", "ambient", "diffuse", "phong"], default_value = "phong")]
    shading: String,
    #[command(flatten)]
    sampling: SamplingArguments,
    /// Have an effect that would be off; may be given several times
    #[arg(long, value_name = "EFFECT")]
    with: Vec<String>,
    /// Do without an effect; may be given several times
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    /// The numbers light is added up in [default: the scene's, or linear]
    #[arg(long, value_parser = ["display", "u8", "linear"])]
    colour: Option<String>,
}

#[derive(Args)]
pub struct Command {
    #[command(flatten)]
    what: Arguments,
    #[command(flatten)]
    target: TargetArguments,
    /// The picture to write: .png, .jpg or .exr; `-` for PNG on standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// What else to keep of each pixel, as layers of an .exr: depth, position, normal, geometric-normal, albedo, object,
    /// material, primitive, samples, node-tests, effects (what each of them adds), or all
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    aov: Vec<String>,
    /// How to show progress, on standard error
    #[arg(long, value_enum, default_value = "auto")]
    progress: Mode,
    /// Write what was done to a JSON file
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Fail where there would only be warnings
    #[arg(long)]
    strict: bool,
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give it as WIDTHxHEIGHT, such as 640x480")?;
    let number = |s: &str| match s.parse::<u32>() {
        Ok(n) if (1..=65_535).contains(&n) => Ok(n),
        _ => Err(format!("`{s}` is not a number of pixels from 1 to 65535")),
    };
    Ok([number(width)?, number(height)?])
}

fn parse_crop(text: &str) -> std::result::Result<Window, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Window { x, y, width, height }),
        _ => Err("give it as X,Y,WIDTH,HEIGHT in pixels, width and height above 0".into()),
    }
}

/// Where the picture goes.
enum Target {
    File(PathBuf, Format),
    StandardOutput,
}

impl Target {
    /// Looks at the name, and whether its folder is there, before any work is done.
    fn new(output: &Path) -> Result<Self> {
        if output == Path::new("-") {
            return Ok(Target::StandardOutput);
        }
        let format = Format::from_path(output)?;
        let name = output.to_string_lossy();
        if name.contains("####") || name.contains("%0") {
            let what = format!("{name}: the name of a series of pictures, and there is one");
            return Err(Error::usage(what, "give the picture a name of its own"));
        }
        check_folder(output)?;
        Ok(Target::File(output.to_owned(), format))
    }
}

/// Whether two names, of files that need not exist, name one file.
fn same_file(a: &Path, b: &Path) -> bool {
    let place = |file: &Path| {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        (folder.canonicalize().ok(), file.file_name().map(std::ffi::OsStr::to_owned))
    };
    a == b || (a != Path::new("-") && b != Path::new("-") && place(a) == place(b))
}

fn check_folder(output: &Path) -> Result<()> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        return Err(Error::output(output, "cannot be written: its folder does not exist"));
    }
    Ok(())
}

/// Whether names and inputs are such as can be used at all.
pub fn check(arguments: &Arguments) -> Result<()> {
    check_names(&arguments.with, &arguments.without)?;
    if arguments.inputs.iter().filter(|input| *input == Path::new("-")).count() > 1 {
        return Err(Error::usage("standard input can be read once", "give `-` once"));
    }
    Ok(())
}

pub fn run(command: &Command, interrupted: &AtomicBool) -> Result<()> {
    check(&command.what)?;
    let target = Target::new(&command.output)?;
    let wanted = Wanted::new(&command.aov)?;
    if !command.aov.is_empty() && !matches!(target, Target::File(_, Format::Exr)) {
        let what = format!("{}: only .exr has layers for --aov", command.output.display());
        return Err(Error::usage(what, "name a file that ends in .exr"));
    }
    if let Some(file) = &command.stats {
        if same_file(file, &command.output) {
            let what = format!("{}: both the picture and its statistics", file.display());
            return Err(Error::usage(what, "give --stats another file than --output"));
        }
        check_folder(file)?;
    }
    let pool = super::pool(command.what.threads)?;
    pool.install(|| render_to(command, &target, &wanted, interrupted))
}

/// A scene that is ready for its picture.
pub struct Ready {
    pub world: World,
    /// How the scene was moved before it was prepared.
    pub range: Option<Range>,
    pub view: View,
    pub window: Window,
    pub plan: Plan,
    pub choices: Choices,
    pub pipeline: ColourPipeline,
    /// What made the picture.
    pub settings: Vec<(String, String)>,
}

/// A scene with all that was said of its picture, before anything is prepared.
pub struct Described {
    pub scene: Scene,
    /// How the scene was moved.
    pub range: Option<Range>,
    pub camera: Camera,
    pub projection: Projection,
    pub size: [u32; 2],
    pub view: View,
    pub window: Window,
    pub choices: Choices,
    pub pipeline: ColourPipeline,
    pub numerics: Numerics,
    pub structure: Structure,
    /// What makes the picture.
    pub settings: Vec<(String, String)>,
}

/// Reads the inputs and finds out which picture of them is wanted; `show` is called with what is done next, and with what
/// there is to say of what was done. `longest` limits the picture's sides, in pixels, where no size is given.
pub fn take_in(
    arguments: &Arguments,
    longest: Option<u32>,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<Described> {
    show("loading", warnings);
    let mut scene = timed(&mut seconds.load, || import::load(&arguments.inputs, warnings))?;
    show("preparing", warnings);
    check_scene(&scene.effects)?;
    let range = bring_into_range(&mut scene);
    if let Some(range) = &range {
        warnings.note(match range.scale {
            1.0 => "the scene lies far from the origin; moved to it, to keep its digits",
            _ => "the scene's size is beyond what f32 holds well; scaled by a power of two",
        });
    }
    let (camera, mut size) = picture::choose(arguments, &scene)?;
    if let Some(longest) = longest.filter(|_| arguments.size.is_none() && arguments.crop.is_none()) {
        size = picture::no_longer_than(longest, size);
    }
    if scene.lights.is_empty() && shading(arguments).uses_lights() {
        scene.lights.extend(headlight(&camera));
        warnings.note("no light in the scene; added a headlight");
    }
    scene.sampling = arguments.sampling.said().or(scene.sampling);
    let most = scene.sampling.most_samples();
    if let Some(least) =
        scene.sampling.min_samples.filter(|&least| scene.sampling.noise.is_some() && least > most)
    {
        let what = format!("at least {least} samples a pixel were asked for, and at most {most}");
        return Err(Error::usage(what, "give a lower --min-samples or a higher --samples"));
    }
    let pipeline = colour(arguments).or(scene.colour).unwrap_or_default();
    let numerics = numerics(arguments).or(scene.numerics).unwrap_or_default();
    let choices = Choices {
        shading: shading(arguments),
        scene: std::mem::take(&mut scene.effects),
        with: arguments.with.clone(),
        without: arguments.without.clone(),
        even_idle: false,
    };
    let projection = arguments.projection().unwrap_or(camera.projection);
    let view = View::new(&camera, projection, size)?;
    let window = picture::window(arguments.crop, size)?;
    let mut settings = settings(arguments, &camera, projection, size, pipeline, numerics);
    settings.extend(scene.sampling.settings());
    let structure = Structure::Wide(Preset::named(&arguments.bvh).unwrap_or_default());
    Ok(Described {
        scene,
        range,
        camera,
        projection,
        size,
        view,
        window,
        choices,
        pipeline,
        numerics,
        structure,
        settings,
    })
}

/// Reads the inputs and prepares all that a picture of them takes; `show` is called with what is done next, and with what
/// there is to say of what was done.
pub fn make_ready(
    arguments: &Arguments,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<Ready> {
    let described = take_in(arguments, None, seconds, warnings, show)?;
    let Described { scene, range, view, window, choices, pipeline, numerics, structure, settings, .. } =
        described;
    show("building", warnings);
    let world = timed(&mut seconds.build, || World::prepare(scene, pipeline, structure, numerics));
    let plan = Plan::new(&world, &choices)?;
    warn_of_the_world(&world, &plan, &choices, warnings);
    Ok(Ready { world, range, view, window, plan, choices, pipeline, settings })
}

fn render_to(command: &Command, target: &Target, wanted: &Wanted, interrupted: &AtomicBool) -> Result<()> {
    let progress = Progress::new(command.progress);
    let mut warnings = Warnings::default();
    let mut printer = Printer::default();
    let with_notes = command.progress != Mode::None;
    let mut seconds = Seconds::default();

    let mut ready = make_ready(&command.what, &mut seconds, &mut warnings, &mut |phase, said| {
        progress.pause(|| printer.print(said, with_notes));
        progress.phase(phase);
    })?;
    let has_target = command.target.wish().is_some();
    let without = &command.what.without;
    command.what.sampling.warn_of_idle(&ready.world.sampling, without, has_target, &mut warnings);
    progress.pause(|| printer.print(&warnings, with_notes));

    progress.phase("rendering");
    let watch = Watch { cancel: interrupted, progress: &|done, total| progress.tiles(done, total) };
    let clock = if command.stats.is_some() { Clock::EveryStage } else { Clock::Stopped };
    let rendered = timed(&mut seconds.render, || match command.target.wish() {
        Some(wish) => render_to_wish(&mut ready, &wish, target, &watch, clock, &mut warnings).map(Some),
        None => Ok(None),
    })?;
    let Ready { world, range, view, window, plan, pipeline, settings, .. } = &ready;
    let window = *window;
    let mut plainly = || {
        timed(&mut seconds.render, || match target {
            Target::File(_, Format::Exr) => {
                render_as(world, view, plan, window, &watch, clock).and_then(|(film, statistics)| {
                    let subject = Subject { world, range: *range, view, plan, window, film: &film };
                    let channels = aov::channels(&subject, wanted, &watch)?;
                    Ok((Picture::Numbers(film, channels), statistics))
                })
            }
            _ => render_as(world, view, plan, window, &watch, clock)
                .map(|(film, statistics)| (Picture::Bytes(film, *pipeline), statistics)),
        })
    };
    let (picture, statistics) = rendered.map_or_else(&mut plainly, Ok)?;
    if wanted.has_primitives() && world.primitive_count() > LARGEST_NUMBER {
        warnings.push(format!("--aov primitive: numbers above {LARGEST_NUMBER} are rounded"));
    }
    warn_of_the_picture(&command.what, world, &statistics, &mut warnings);
    progress.clear();
    printer.print(&warnings, with_notes);

    timed(&mut seconds.write, || write(&picture, settings, target))?;
    if let Some(file) = &command.stats {
        let report = statistics::to_json(settings, &seconds, world, plan, &statistics, &warnings);
        write_whole(file, |out| writeln!(out, "{report:#}"))?;
    }
    if command.strict && !warnings.is_empty() {
        return Err(Error::Failed {
            what: format!("{} warning(s), and --strict was given", warnings.messages().len()),
            hint: "the picture was written; mend what the warnings name, or leave --strict out".into(),
        });
    }
    progress.finish(&format!(
        "wrote {} ({} x {}; load {:.2} s, build {:.2} s, render {:.2} s, write {:.2} s)",
        command.output.display(),
        window.width,
        window.height,
        seconds.load,
        seconds.build,
        seconds.render,
        seconds.write
    ));
    Ok(())
}

/// Renders as many samples as the user's target takes, and says how many.
fn render_to_wish(
    ready: &mut Ready,
    wish: &Wish,
    target: &Target,
    watch: &Watch,
    clock: Clock,
    warnings: &mut Warnings,
) -> Result<(Picture, Statistics)> {
    let Ready { world, view, choices, window, pipeline, .. } = ready;
    let (window, pipeline) = (*window, *pipeline);
    let mut subject = choose::Subject { world, view, choices, window };
    // How many tiles there are to come is not known; progress would begin anew with each stretch.
    let watch = Watch { cancel: watch.cancel, progress: &|_, _| () };
    let chosen = choose::render(&mut subject, wish, &watch, clock)?;
    match chosen.end {
        End::Time if wish.accuracy.is_some() => warnings.push(chosen.line(wish)),
        End::Most | End::NotFinite => warnings.push(chosen.line(wish)),
        _ => warnings.note(chosen.line(wish)),
    }
    ready.settings.retain(|(key, _)| !["kiln:samples", "kiln:filter", "kiln:seed"].contains(&key.as_str()));
    ready.settings.extend(ready.world.sampling.settings());
    ready.plan = chosen.plan;
    let picture = match target {
        Target::File(_, Format::Exr) => Picture::Numbers(Film::of_rows(window, &chosen.pixels)?, Vec::new()),
        _ => {
            let mut bytes = vec![[0; 3]; chosen.pixels.len()];
            Pixel::develop(&chosen.pixels, pipeline, &mut bytes);
            Picture::Bytes(Film::of_rows(window, &bytes)?, pipeline)
        }
    };
    Ok((picture, chosen.statistics))
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

// The parser lets nothing else through than the names below.

fn shading(arguments: &Arguments) -> ShadingMode {
    let modes = [ShadingMode::Flat, ShadingMode::Ambient, ShadingMode::Diffuse, ShadingMode::Phong];
    modes.into_iter().find(|mode| mode.name() == arguments.shading).unwrap_or_default()
}

fn colour(arguments: &Arguments) -> Option<ColourPipeline> {
    let pipelines = [ColourPipeline::Display, ColourPipeline::U8, ColourPipeline::Linear];
    pipelines.into_iter().find(|p| Some(p.name()) == arguments.colour.as_deref())
}

fn numerics(arguments: &Arguments) -> Option<Numerics> {
    Numerics::ALL.into_iter().find(|tier| Some(tier.name()) == arguments.numerics.as_deref())
}

impl Arguments {
    /// The projection that the user wants instead of the camera's own.
    pub fn projection(&self) -> Option<Projection> {
        let projections = [Projection::Perspective, Projection::Orthographic];
        projections.into_iter().find(|p| Some(p.name()) == self.projection.as_deref())
    }
}

/// What made the picture, for its metadata; nothing that differs between two runs of the same.
fn settings(
    arguments: &Arguments,
    camera: &Camera,
    projection: Projection,
    [width, height]: [u32; 2],
    pipeline: ColourPipeline,
    numerics: Numerics,
) -> Vec<(String, String)> {
    let inputs: Vec<String> = arguments.inputs.iter().map(|i| i.display().to_string()).collect();
    let mut settings = vec![
        ("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION"))),
        ("kiln:inputs".into(), inputs.join(" ")),
        ("kiln:camera".into(), camera.name.clone()),
        ("kiln:projection".into(), projection.name().into()),
        ("kiln:size".into(), format!("{width}x{height}")),
        ("kiln:colour".into(), pipeline.name().into()),
        ("kiln:numerics".into(), numerics.name().into()),
        ("kiln:shading".into(), arguments.shading.clone()),
    ];
    if let Some(Window { x, y, width, height }) = arguments.crop {
        settings.push(("kiln:crop".into(), format!("{x},{y},{width},{height}")));
    }
    for (key, names) in [("kiln:with", &arguments.with), ("kiln:without", &arguments.without)] {
        if !names.is_empty() {
            settings.push((key.into(), names.join(" ")));
        }
    }
    settings
}

/// Nothing that was asked for is left out in silence.
fn warn_of_the_world(world: &World, plan: &Plan, choices: &Choices, warnings: &mut Warnings) {
    if world.too_small > 0 {
        warnings.push(format!(
            "{} primitive(s) are too small or too thin for the numbers of `--numerics {}`; left out",
            world.too_small,
            world.numerics().name()
        ));
    }
    for decision in
        plan.decisions.iter().filter(|d| !d.on && choices.with.iter().any(|name| name == d.effect))
    {
        warnings.push(format!("--with {} changes nothing: {}", decision.effect, decision.why));
    }
}

/// A picture that shows less than was asked for does not pass in silence.
fn warn_of_the_picture(
    arguments: &Arguments,
    world: &World,
    statistics: &Statistics,
    warnings: &mut Warnings,
) {
    let (non_finite, first) = &statistics.non_finite;
    if *non_finite > 0 {
        let places: Vec<String> = first.iter().map(|(x, y)| format!("({x}, {y})")).collect();
        warnings
            .push(format!("{non_finite} pixel(s) are not finite numbers, the first at {}", places.join(" ")));
    }
    let primary = statistics.rays(RayKind::PRIMARY);
    // A part of a picture may well be of nothing.
    if primary.hit == 0 && arguments.crop.is_none() {
        warnings.push(format!(
            "nothing is in the picture: none of {} primary rays hits anything; try `--camera auto`",
            primary.cast
        ));
        return;
    }
    let shadow = statistics.rays(RayKind("shadow"));
    if shadow.cast > 0 && shadow.hit == shadow.cast {
        warnings.push("no light reaches anything in the picture: every shadow ray is blocked");
    }
    if arguments.inputs.len() > 1 && arguments.crop.is_none() {
        for (index, file) in arguments.inputs.iter().enumerate() {
            let mut objects =
                world.objects.iter().zip(&statistics.seen).filter(|(o, _)| o.input == index).peekable();
            if objects.peek().is_some() && objects.all(|(_, seen)| !seen) {
                warnings.push(format!(
                    "{} is nowhere in the picture; place it with [[mesh]] in a scene file, or try `--camera auto`",
                    file.display()
                ));
            }
        }
    }
}

fn write(picture: &Picture, settings: &[(String, String)], target: &Target) -> Result<()> {
    match target {
        Target::File(file, format) => write_picture(picture, settings, *format, file),
        Target::StandardOutput => {
            let mut bytes = Vec::new();
            let fail = |e| Error::output(Path::new("-"), describe(&e));
            encode(picture, settings, Format::Png, &mut bytes).map_err(fail)?;
            std::io::Write::write_all(&mut std::io::stdout().lock(), &bytes).map_err(fail)
        }
    }
}
