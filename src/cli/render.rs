//! `kiln render`: files to a picture.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;

use super::Printer;
use super::progress::{Mode, Progress};
use super::statistics::{self, Seconds};
use crate::effects::{Choices, Plan, RayKind};
use crate::error::{Error, Result, Warnings};
use crate::film::output::{describe, write_whole};
use crate::film::write::{Format, write_picture, write_png};
use crate::film::{ColourPipeline, Film, Window};
use crate::import;
use crate::render::{Statistics, Watch, render};
use crate::scene::file::nearest_name;
use crate::scene::{Camera, Projection, Scene};
use crate::shading::ShadingMode;
use crate::world::{StandardView, Structure, View, World, fitted_camera, headlight};

/// Width and height of a picture where nothing says otherwise.
const DEFAULT_SIZE: [u32; 2] = [1024, 1024];

#[derive(Args)]
pub struct Arguments {
    /// Files to put into one scene: .toml, .obj, .gltf, .glb; `-` for a scene file or GLB on standard input
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// The picture to write: .png, .jpg or .exr; `-` for PNG on standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// A camera of the scene by name or by number, or `auto` for one that fits
    #[arg(long, value_name = "NAME|INDEX|auto")]
    camera: Option<String>,
    /// A camera that fits the scene, from a standard side
    #[arg(long, conflicts_with = "camera", value_parser = ["front", "back", "left", "right", "top", "bottom", "iso"])]
    view: Option<String>,
    /// Replace the camera's projection
    #[arg(long, value_parser = ["perspective", "orthographic"])]
    projection: Option<String>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Render only this part of the picture: left, top, width and height in pixels
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop)]
    crop: Option<Window>,
    /// Threads to work on [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// How far shading goes; below `phong` that term is shown alone, without effects
    #[arg(long, value_parser = ["flat", "ambient", "diffuse", "phong"], default_value = "phong")]
    shading: String,
    /// Have an effect that would be off; may be given several times
    #[arg(long, value_name = "EFFECT")]
    with: Vec<String>,
    /// Do without an effect; may be given several times
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    /// The numbers light is added up in [default: the scene's, or linear]
    #[arg(long, value_parser = ["display", "u8", "linear"])]
    colour: Option<String>,
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
        check_folder(output)?;
        Ok(Target::File(output.to_owned(), format))
    }
}

fn check_folder(output: &Path) -> Result<()> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        return Err(Error::output(output, "cannot be written: its folder does not exist"));
    }
    Ok(())
}

pub fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let target = Target::new(&arguments.output)?;
    if let Some(file) = &arguments.stats {
        if *file == arguments.output {
            let what = format!("{}: both the picture and its statistics", file.display());
            return Err(Error::usage(what, "give --stats another file than --output"));
        }
        check_folder(file)?;
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads.map_or(0, usize::from))
        .build()
        .map_err(|e| Error::Failed {
            what: format!("threads cannot be started: {e}"),
            hint: String::new(),
        })?;
    pool.install(|| render_to(arguments, &target, interrupted))
}

fn render_to(arguments: &Arguments, target: &Target, interrupted: &AtomicBool) -> Result<()> {
    let progress = Progress::new(arguments.progress);
    let mut warnings = Warnings::default();
    let mut printer = Printer::default();
    let with_notes = arguments.progress != Mode::None;
    let mut seconds = Seconds::default();

    progress.phase("loading");
    let mut scene = timed(&mut seconds.load, || import::load(&arguments.inputs, &mut warnings))?;
    let size = picture_size(arguments, &scene);
    let camera = choose_camera(arguments, &scene, size)?;
    if scene.lights.is_empty() && shading(arguments).uses_lights() {
        scene.lights.extend(headlight(&camera));
        warnings.note("no light in the scene; added a headlight");
    }
    progress.clear();
    printer.print(&warnings, with_notes);

    let pipeline = colour(arguments).or(scene.colour).unwrap_or_default();
    let choices = Choices {
        shading: shading(arguments),
        scene: scene.effects,
        with: arguments.with.clone(),
        without: arguments.without.clone(),
    };
    let projection = projection(arguments).unwrap_or(camera.projection);
    let view = View::new(&camera, projection, size)?;
    let window = window(arguments, size)?;
    let settings = settings(arguments, &camera, projection, size, pipeline);

    progress.phase("building");
    let world = timed(&mut seconds.build, || World::prepare(scene, pipeline, Structure::default()));
    let plan = Plan::new(&world, &choices)?;

    progress.phase("rendering");
    let watch = Watch { cancel: interrupted, progress: &|done, total| progress.tiles(done, total) };
    let (film, statistics) = timed(&mut seconds.render, || render(&world, &view, &plan, window, &watch))?;
    let (non_finite, first) = film.non_finite();
    warn_of_the_picture(arguments, &world, &statistics, non_finite, &first, &mut warnings);
    progress.clear();
    printer.print(&warnings, with_notes);

    timed(&mut seconds.write, || write(&film, pipeline, &settings, target))?;
    if let Some(file) = &arguments.stats {
        let report =
            statistics::to_json(&settings, &seconds, &world, &plan, &statistics, non_finite, &warnings);
        write_whole(file, |out| writeln!(out, "{report:#}"))?;
    }
    if arguments.strict && !warnings.is_empty() {
        return Err(Error::Failed {
            what: format!("{} warning(s), and --strict was given", warnings.messages().len()),
            hint: "the picture was written; mend what the warnings name, or leave --strict out".into(),
        });
    }
    progress.finish(&format!(
        "wrote {} ({} x {}; load {:.2} s, build {:.2} s, render {:.2} s, write {:.2} s)",
        arguments.output.display(),
        window.width,
        window.height,
        seconds.load,
        seconds.build,
        seconds.render,
        seconds.write
    ));
    Ok(())
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

fn projection(arguments: &Arguments) -> Option<Projection> {
    let projections = [Projection::Perspective, Projection::Orthographic];
    projections.into_iter().find(|p| Some(p.name()) == arguments.projection.as_deref())
}

/// The user's size, the scene's, or one in the shape of the file's camera.
fn picture_size(arguments: &Arguments, scene: &Scene) -> [u32; 2] {
    let from_camera = || {
        let camera =
            scene.cameras.first().filter(|_| arguments.view.is_none() && arguments.camera.is_none())?;
        let aspect = camera.view_width? / camera.view_height;
        let [width, height] = DEFAULT_SIZE.map(f64::from);
        let shape = if aspect >= 1.0 { [width, width / aspect] } else { [height * aspect, height] };
        Some(shape.map(|pixels| pixels.round().max(1.0) as u32))
    };
    arguments.size.or(scene.size).or_else(from_camera).unwrap_or(DEFAULT_SIZE)
}

fn choose_camera(arguments: &Arguments, scene: &Scene, [width, height]: [u32; 2]) -> Result<Camera> {
    let fitted = |view: StandardView| {
        fitted_camera(scene, view, f64::from(width) / f64::from(height)).ok_or_else(|| {
            let file = arguments.inputs.first().map_or(Path::new("-"), PathBuf::as_path);
            Error::input(file, "there is nothing in it to look at", "`kiln info` says what the file holds")
        })
    };
    if let Some(name) = &arguments.view {
        let view = StandardView::ALL.into_iter().find(|view| view.name() == name);
        return fitted(view.unwrap_or(StandardView::Auto));
    }
    match arguments.camera.as_deref() {
        Some("auto") => fitted(StandardView::Auto),
        Some(name) => {
            let by_name = || scene.cameras.iter().find(|camera| camera.name == name);
            let by_index = || scene.cameras.get(name.parse::<usize>().ok()?);
            by_name().or_else(by_index).cloned().ok_or_else(|| {
                let known: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
                let hint = match known.as_slice() {
                    [] => "the scene has none; leave --camera out, or use --view".into(),
                    known => nearest_name(name, known),
                };
                Error::usage(format!("there is no camera `{name}`"), hint)
            })
        }
        None => scene.cameras.first().cloned().map_or_else(|| fitted(StandardView::Auto), Ok),
    }
}

fn window(arguments: &Arguments, [width, height]: [u32; 2]) -> Result<Window> {
    let Some(crop) = arguments.crop else { return Ok(Window { x: 0, y: 0, width, height }) };
    let inside = |start: u32, size: u32, limit: u32| start.checked_add(size).is_some_and(|end| end <= limit);
    if inside(crop.x, crop.width, width) && inside(crop.y, crop.height, height) {
        return Ok(crop);
    }
    Err(Error::usage(
        format!("the crop reaches outside the picture of {width} x {height} pixels"),
        "make it smaller, or give a larger --size",
    ))
}

/// What made the picture, for its metadata; nothing that differs between two runs of the same.
fn settings(
    arguments: &Arguments,
    camera: &Camera,
    projection: Projection,
    [width, height]: [u32; 2],
    pipeline: ColourPipeline,
) -> Vec<(String, String)> {
    let inputs: Vec<String> = arguments.inputs.iter().map(|i| i.display().to_string()).collect();
    let mut settings = vec![
        ("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION"))),
        ("kiln:inputs".into(), inputs.join(" ")),
        ("kiln:camera".into(), camera.name.clone()),
        ("kiln:projection".into(), projection.name().into()),
        ("kiln:size".into(), format!("{width}x{height}")),
        ("kiln:colour".into(), pipeline.name().into()),
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

/// A picture that shows less than was asked for does not pass in silence.
fn warn_of_the_picture(
    arguments: &Arguments,
    world: &World,
    statistics: &Statistics,
    non_finite: usize,
    first: &[(u32, u32)],
    warnings: &mut Warnings,
) {
    if non_finite > 0 {
        let places: Vec<String> = first.iter().map(|(x, y)| format!("({x}, {y})")).collect();
        warnings
            .push(format!("{non_finite} pixel(s) are not finite numbers, the first at {}", places.join(" ")));
    }
    let primary = statistics.rays(RayKind::Primary);
    if primary.hit == 0 {
        warnings.push(format!(
            "nothing is in the picture: none of {} primary rays hits anything; try `--camera auto`",
            primary.cast
        ));
        return;
    }
    let shadow = statistics.rays(RayKind::Shadow);
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

fn write(
    film: &Film,
    pipeline: ColourPipeline,
    settings: &[(String, String)],
    target: &Target,
) -> Result<()> {
    match target {
        Target::File(file, format) => write_picture(film, pipeline, settings, *format, file),
        Target::StandardOutput => {
            let mut bytes = Vec::new();
            let fail = |e| Error::output(Path::new("-"), describe(&e));
            write_png(film, pipeline, settings, &mut bytes).map_err(fail)?;
            std::io::Write::write_all(&mut std::io::stdout().lock(), &bytes).map_err(fail)
        }
    }
}
