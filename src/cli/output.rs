//! Renders a job and writes its picture to a file or to standard output.

use std::path::{Path, PathBuf};

use crate::effects::RayKind;
use crate::error::{Error, Result, Warnings};
use crate::film::check::{self, Found};
use crate::film::output::describe;
use crate::film::part::{self, part_name, write_part};
use crate::film::write::{self, Format, OutputImage, encode, write_picture};
use crate::film::{self, Film, Pixel, Share, Window};
use crate::job::RenderJob;
use crate::limits;
use crate::render::aov::{self, AovSelection};
use crate::render::{RenderControl, Statistics};
use crate::study::choose::{self, End, Wish};
use crate::world::World;

/// Where the picture goes.
pub enum Target {
    File(PathBuf, Format),
    /// A share of a picture of that format.
    Part(PathBuf, Format, Share),
    StandardOutput,
}

impl Target {
    /// Looks at the name, and whether its folder is there, before any work is done.
    pub fn new(output: &Path) -> Result<Self> {
        if output == Path::new("-") {
            return Ok(Target::StandardOutput);
        }
        let format = Format::from_path(output)?;
        let name = output.to_string_lossy();
        if name.contains("####") || name.contains("%0") {
            let what = format!("{name}: the name of a series of pictures, and there is one");
            let hint = "give the picture a name of its own, or the frames of an animation with --frames";
            return Err(Error::usage(what, hint));
        }
        check_folder(output)?;
        Ok(Target::File(output.to_owned(), format))
    }

    /// The file for a share of the picture.
    pub fn part(self, share: Share) -> Result<Self> {
        match self {
            Target::File(file, format) => Ok(Target::Part(part_name(&file, share), format, share)),
            _ => {
                Err(Error::usage("a part of a picture is a file", "give --output a name, such as still.png"))
            }
        }
    }

    /// The picture's format.
    pub fn format(&self) -> Format {
        match self {
            Target::File(_, format) | Target::Part(_, format, _) => *format,
            Target::StandardOutput => Format::Png,
        }
    }

    /// The format that decides what is kept of the picture: of parts the film's own numbers.
    pub fn kept(&self) -> Format {
        if let Target::Part(..) = self { Format::Exr } else { self.format() }
    }

    /// The file.
    pub fn file(&self) -> &Path {
        match self {
            Target::File(file, _) | Target::Part(file, ..) => file,
            Target::StandardOutput => Path::new("-"),
        }
    }

    /// What is there already.
    pub fn look(&self) -> Found {
        match self {
            Target::File(file, format) => check::look(file, *format),
            Target::Part(file, _, share) => part::look(file, *share),
            Target::StandardOutput => Found::Missing,
        }
    }
}

/// Whether two names, of files that need not exist, name one file.
pub fn same_file(a: &Path, b: &Path) -> bool {
    let place = |file: &Path| {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        (folder.canonicalize().ok(), file.file_name().map(std::ffi::OsStr::to_owned))
    };
    a == b || (a != Path::new("-") && b != Path::new("-") && place(a) == place(b))
}

/// Whether there is a folder to write the file to.
pub fn check_folder(output: &Path) -> Result<()> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        return Err(Error::output(output, "cannot be written: its folder does not exist"));
    }
    Ok(())
}

/// Checks that there is memory for a picture, before any time is spent on it.
///
/// # Errors
/// [`Error::Failed`] with what it needs.
pub fn check_memory(job: &RenderJob, target: &Target, wanted: &AovSelection, has_wish: bool) -> Result<()> {
    let channels = wanted.channel_count(job.plan.effects_on().count()) as u64;
    let writing = match target {
        // Written tile by tile.
        Target::Part(..) => 0,
        // The encoded file is kept whole; at worst it is a little longer than its pixels.
        Target::StandardOutput => 3,
        Target::File(_, format) => write::bytes_per_pixel(*format, channels),
    };
    let wish = if has_wish { choose::BYTES_A_PIXEL } else { 0 };
    let each = bytes_per_pixel(target.kept(), wanted, channels).max(wish) + writing;
    check_memory_of(job.window, channels, each)
}

/// The most bytes for each pixel of a picture while it is rendered.
pub fn bytes_per_pixel(format: Format, wanted: &AovSelection, channels: u64) -> u64 {
    match format {
        Format::Exr => 4 * (3 + channels) + if channels > 0 { wanted.bytes_per_pixel() } else { 0 },
        Format::Png | Format::Jpeg => 3,
    }
}

/// Checks that there is memory for a picture of `bytes_each` a pixel; `channels` are named in the error.
///
/// # Errors
/// [`Error::Failed`] with what it needs.
pub fn check_memory_of(window: Window, channels: u64, bytes_each: u64) -> Result<()> {
    let Window { width, height, .. } = window;
    let bytes = limits::product(&[width.into(), height.into(), bytes_each]);
    let layers = match channels {
        0 => String::new(),
        count => format!(" with {count} more channels"),
    };
    limits::check(bytes).map_err(|excess| {
        film::too_large(&format!("a picture of {width} x {height} pixels{layers}"), &excess)
    })
}

/// Renders the picture, in what its format keeps of it.
pub fn render_plainly(
    job: &RenderJob,
    format: Format,
    wanted: &AovSelection,
    control: &RenderControl,
) -> Result<(OutputImage, Statistics)> {
    if format != Format::Exr {
        let (film, statistics) = job.render(control)?;
        return Ok((OutputImage::Rgb8(film, job.pipeline()), statistics));
    }
    let (film, statistics) = job.render(control)?;
    let channels = aov::channels(&job.aov_source(Some(&film)), wanted, control)?;
    Ok((OutputImage::Float(film, channels), statistics))
}

/// Renders as many samples as the user's target takes, and says how many.
pub fn render_to_wish(
    job: &mut RenderJob,
    wish: &Wish,
    format: Format,
    control: &RenderControl,
    warnings: &mut Warnings,
) -> Result<(OutputImage, Statistics)> {
    // How many tiles there are to come is not known; progress would begin anew with each stretch.
    let control = RenderControl { progress: &|_, _| (), ..*control };
    let chosen = choose::render(job, wish, &control)?;
    match chosen.end {
        End::Time if wish.accuracy.is_some() => warnings.push(chosen.line(wish)),
        End::Most | End::NotFinite => warnings.push(chosen.line(wish)),
        _ => warnings.note(chosen.line(wish)),
    }
    job.metadata.retain(|(key, _)| !["kiln:samples", "kiln:filter", "kiln:seed"].contains(&key.as_str()));
    job.metadata.extend(job.choices.sampling.settings());
    let (window, pipeline) = (job.window, job.pipeline());
    let picture = match format {
        Format::Exr => OutputImage::Float(Film::from_rows(window, &chosen.pixels)?, Vec::new()),
        _ => {
            let mut bytes = vec![[0; 3]; chosen.pixels.len()];
            Pixel::develop(&chosen.pixels, pipeline, &mut bytes);
            OutputImage::Rgb8(Film::from_rows(window, &bytes)?, pipeline)
        }
    };
    Ok((picture, chosen.statistics))
}

/// Warns of pixels that are not finite, of an empty picture, of blocked lights and of inputs that are not visible.
pub fn warn_of_the_picture(
    inputs: &[PathBuf],
    world: &World,
    statistics: &Statistics,
    is_part: bool,
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
    if is_part {
        return;
    }
    if world.primitive_count() == 0 {
        warnings.push("nothing is in the picture: the scene has no triangles and no spheres");
        return;
    }
    if primary.hit == 0 {
        warnings.push(format!(
            "nothing is in the picture: none of {} primary rays hits anything; try `--camera auto`",
            primary.cast
        ));
        return;
    }
    let mut shadow = statistics.rays.iter().filter(|(kind, _)| kind.is_shadow);
    if shadow.any(|(_, count)| count.cast > 0 && count.hit == count.cast) {
        warnings.push("no light reaches anything in the picture: every shadow ray is blocked");
    }
    if inputs.len() > 1 {
        for (index, file) in inputs.iter().enumerate() {
            let mut objects = world
                .objects
                .iter()
                .zip(&statistics.visible_objects)
                .filter(|(o, _)| o.input == index)
                .peekable();
            if objects.peek().is_some() && objects.all(|(_, seen)| !seen) {
                warnings.push(format!(
                    "{} is nowhere in the picture; place it with [[mesh]] in a scene file, or try `--camera auto`",
                    file.display()
                ));
            }
        }
    }
}

/// Writes the picture where it goes.
pub fn write(picture: &OutputImage, job: &RenderJob, target: &Target) -> Result<()> {
    let metadata = &job.metadata;
    match (target, picture) {
        (Target::Part(file, _, share), OutputImage::Float(film, channels)) => {
            write_part(film, channels, job.pipeline(), metadata, *share, file)
        }
        (Target::File(file, format) | Target::Part(file, format, _), _) => {
            write_picture(picture, metadata, *format, file)
        }
        (Target::StandardOutput, _) => {
            let mut bytes = Vec::new();
            let fail = |e| Error::output(Path::new("-"), describe(&e));
            encode(picture, metadata, Format::Png, &mut bytes).map_err(fail)?;
            std::io::Write::write_all(&mut std::io::stdout().lock(), &bytes).map_err(fail)
        }
    }
}
