//! Files of shards of a picture: film values of some of its tiles; and merging them.
//!
//! A shard is one file: the line `kiln shard 1`; a line of JSON ([`Header`]); for each
//! tile of the shard, in order, red, green and blue of each pixel, then each further channel, as little-endian f32; the
//! BLAKE3 hash of all that, 32 bytes. Shards hold film values, not 8-bit values, so that the joined picture is quantised
//! and encoded once, like that of a single run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Shard;
use crate::error::{Error, Result};
use crate::files;
use crate::files::write_whole;
use crate::film::check::{FileState, PictureIdentity};
use crate::film::rounding::Rounding;
use crate::film::tone::{Exposure, ToneMap};
use crate::film::write::{ALPHA, Channel, FINGERPRINT, Format, Metadata, OutputImage, encode};
use crate::film::{ColourPipeline, DisplayTransform, ExrAttributes, Film, TILE, Window};
use crate::limits;

const FIRST_LINE: &[u8] = b"kiln shard 1\n";
const HASH: usize = blake3::OUT_LEN;

/// Header of a shard: properties of the whole picture, and the shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Header {
    shard: u32,
    of: u32,
    /// Left, top, width, height.
    window: [u32; 4],
    pipeline: String,
    /// Exposure in EV, as text because JSON numbers are not read back to the bit; and the tone map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    display: Option<(String, ToneMap)>,
    /// How display values are rounded, unless it is the default.
    #[serde(default, skip_serializing_if = "is_default")]
    rounding: Rounding,
    channels: Vec<String>,
    metadata: Vec<(String, String)>,
    attributes: ExrAttributes,
}

impl Header {
    /// The display transform. An error if there is none of these values.
    fn display(&self) -> std::result::Result<DisplayTransform, String> {
        let Some((exposure, map)) = &self.display else {
            return Ok(DisplayTransform::default().rounded(self.rounding));
        };
        match exposure.parse() {
            Ok(Exposure::Ev(ev)) if self.pipeline == ColourPipeline::Linear.name() => {
                Ok(DisplayTransform::new(ev, *map).rounded(self.rounding))
            }
            _ => Err("has an unknown exposure".into()),
        }
    }

    fn fingerprint(&self) -> Option<&str> {
        self.metadata.iter().find(|(key, _)| key == FINGERPRINT).map(|(_, value)| value.as_str())
    }
}

fn is_default(rounding: &Rounding) -> bool {
    *rounding == Rounding::default()
}

/// File name of a shard of the picture `output`: `still.2of7.shard` beside `still.png`.
pub fn shard_name(output: &Path, shard: Shard) -> PathBuf {
    output.with_extension(format!("{}of{}.shard", shard.index(), shard.of()))
}

/// Writes a shard of a picture atomically. Film and channels are those of the whole picture; only the tiles of the
/// shard need be filled.
///
/// # Errors
/// [`Error::Output`] if the file cannot be written.
pub fn write_shard(
    (film, channels, attributes): (&Film, &[Channel], &ExrAttributes),
    (pipeline, display): (ColourPipeline, DisplayTransform),
    metadata: &Metadata,
    shard: Shard,
    file: &Path,
) -> Result<()> {
    let window = film.window();
    let head = Header {
        shard: shard.index(),
        of: shard.of(),
        window: [window.x, window.y, window.width, window.height],
        pipeline: pipeline.name().into(),
        display: (!display.is_identity()).then(|| (display.ev().to_string(), display.tone_map())),
        rounding: display.rounding(),
        channels: channels.iter().map(|channel| channel.name.clone()).collect(),
        metadata: metadata.to_vec(),
        attributes: attributes.clone(),
    };
    write_whole(file, |out| {
        let mut hash = blake3::Hasher::new();
        let mut put = |bytes: &[u8]| {
            hash.update(bytes);
            out.write_all(bytes)
        };
        put(FIRST_LINE)?;
        put(format!("{}\n", serde_json::to_string(&head)?).as_bytes())?;
        for (_, tile) in film.tile_windows().enumerate().filter(|(i, _)| shard.has(*i)) {
            let mut bytes = Vec::with_capacity(tile.area() * 4 * (3 + channels.len()));
            for (x, y) in pixels_of(window, tile) {
                film.pixel(x, y).iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            }
            for channel in channels {
                for (x, y) in pixels_of(window, tile) {
                    bytes.extend(
                        channel.values[y as usize * window.width as usize + x as usize].to_le_bytes(),
                    );
                }
            }
            put(&bytes)?;
        }
        let hash = *hash.finalize().as_bytes();
        out.write_all(&hash)
    })
}

/// Columns and rows of a tile's pixels, relative to the top left corner of the film.
fn pixels_of(window: Window, tile: Window) -> impl Iterator<Item = (u32, u32)> {
    let (left, top) = (tile.x - window.x, tile.y - window.y);
    (0..tile.height).flat_map(move |y| (0..tile.width).map(move |x| (left + x, top + y)))
}

/// Checks a shard and parses its header; returns the bytes of the values too.
fn open(bytes: &[u8]) -> std::result::Result<(Header, Shard, &[u8]), String> {
    let rest = bytes.strip_prefix(FIRST_LINE).ok_or("not a shard of a picture")?;
    let end = bytes.len().checked_sub(HASH).filter(|&end| end >= FIRST_LINE.len());
    let (said, hash) = bytes.split_at(end.ok_or("the shard ends too early")?);
    if blake3::hash(said).as_bytes() != hash {
        return Err("the shard is damaged; render it again".into());
    }
    let line = rest.iter().position(|&b| b == b'\n').ok_or("the shard has no header")?;
    let head: Header = serde_json::from_slice(&rest[..line])
        .map_err(|e| format!("not a shard of this version of kiln: {e}"))?;
    let shard = Shard::new(head.shard, head.of).ok_or("the index of the shard is out of range")?;
    let numbers = rest.get(line + 1..rest.len() - HASH).ok_or("the shard ends too early")?;
    Ok((head, shard, numbers))
}

/// Maximum width and height: those of JPEG; PNG and OpenEXR allow more.
const MAX_SIDE: u32 = 65_535;

/// Checks that kiln can have written the header, and that `format` can store it.
fn check_head(head: &Header, format: Format) -> std::result::Result<(), String> {
    let [x, y, width, height] = head.window;
    let ends = [(x, width), (y, height)].map(|(start, side)| start.checked_add(side));
    if ends.iter().any(|end| end.is_none_or(|end| end > MAX_SIDE)) || width == 0 || height == 0 {
        return Err(format!("is {width} x {height} pixels at ({x}, {y}), which kiln does not make"));
    }
    let [across, down] = head.attributes.size;
    let is_part = x + width <= across && y + height <= down && across.max(down) <= MAX_SIDE;
    if !is_part {
        return Err(format!("is no part of its picture of {across} x {down} pixels"));
    }
    let shown = |name: &str| name.chars().take(40).collect::<String>().escape_default().to_string();
    let is_name = |name: &String| {
        (1..80).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_graphic() || b == b' ')
    };
    let is_of_kiln =
        |key: &str| key == "Software" || key.starts_with("kiln:") || key.starts_with("cryptomatte/");
    let is_key = |key: &String| is_name(key) && is_of_kiln(key);
    let mut texts = head.metadata.iter().chain(&head.attributes.texts);
    if let Some((key, _)) = texts.find(|(key, value)| !is_key(key) || value.contains('\0')) {
        return Err(format!("has a setting `{}`, which kiln does not write", shown(key)));
    }
    if let Some(name) = head.channels.iter().find(|name| !is_name(name)) {
        return Err(format!("has a channel `{}`, which kiln does not write", shown(name)));
    }
    // Encoding a single pixel detects metadata that the encoder rejects as a fault of the shard, not of the output.
    let window = Window { x: 0, y: 0, width: 1, height: 1 };
    let film = |e: Error| e.to_string();
    let picture = if format == Format::Exr {
        let channel = |name: &String| Channel { name: name.clone(), values: vec![0.0] };
        OutputImage::Float(
            Film::new(window).map_err(film)?,
            head.channels.iter().map(channel).collect(),
            head.attributes.clone(),
        )
    } else {
        OutputImage::Rgb8(Film::new(window).map_err(film)?, ColourPipeline::Display)
    };
    encode(&picture, &head.metadata, format, &mut std::io::sink())
        .map_err(|e| format!("has settings or channels that cannot be written: {e}"))
}

/// Bytes of the values in a shard of a picture.
fn bytes_of_shard(window: Window, channels: usize, shard: Shard) -> u64 {
    let columns = window.width.div_ceil(TILE) as usize;
    let tiles = columns * window.height.div_ceil(TILE) as usize;
    let side = |whole: u32, tile: usize| TILE.min(whole - tile as u32 * TILE) as usize;
    let pixels: usize = (shard.index() as usize - 1..tiles)
        .step_by(shard.of() as usize)
        .map(|tile| side(window.width, tile % columns) * side(window.height, tile / columns))
        .sum();
    limits::product(&[pixels as u64, 3 + channels as u64, size_of::<f32>() as u64])
}

/// State of the file of a shard.
pub fn shard_state(file: &Path, shard: Shard) -> FileState {
    let bytes = match files::read_output(file) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return FileState::Missing,
        Err(e) => return FileState::Broken(files::explain(&e).0),
    };
    match open(&bytes) {
        Ok((head, found, _)) if found == shard => FileState::Whole(PictureIdentity {
            fingerprint: head.fingerprint().map(str::to_owned),
            frame: None,
            texts: Vec::new(),
        }),
        Ok((_, found, _)) => FileState::Broken(format!("is shard {found}")),
        Err(what) => FileState::Broken(what),
    }
}

/// A joined picture and its metadata.
pub type Joined = (OutputImage, Vec<(String, String)>);

/// Joins the shards of a picture, in the pixel format of `format`.
///
/// # Errors
/// [`Error::Input`] if a shard is missing, damaged, or of another picture; [`Error::Usage`] if the shards have further
/// channels and the format does not support them.
pub fn join(files: &[PathBuf], format: Format) -> Result<Joined> {
    let mut merger: Option<ShardMerger> = None;
    let there = files.iter().filter_map(|file| std::fs::metadata(file).ok()).map(|about| about.len()).sum();
    for file in files {
        let wrong = |what: String| {
            Error::input(file.as_path(), what, "give the shards that `kiln render --shard` wrote")
        };
        let bytes = files::read_file(file).map_err(|e| files::unreadable(file, &e))?;
        let (head, shard, numbers) = open(&bytes).map_err(wrong)?;
        let merger = match &mut merger {
            Some(merger) => merger,
            none => none.insert(ShardMerger::new((file, there), head.clone(), shard, numbers, format)?),
        };
        merger.add(&head, shard, numbers).map_err(wrong)?;
    }
    let Some(merger) = merger else {
        return Err(Error::usage("no shard is given", "give the shards that `kiln render --shard` wrote"));
    };
    merger.finish(format)
}

/// Maximum number of missing shards listed in a message.
const MAX_NAMED: usize = 20;

/// Maximum bytes per pixel while shards are joined and the picture is encoded: film and channels, and the buffers of the
/// encoder ([`crate::film::write::bytes_per_pixel`]), or for other formats the rows in f32 and three buffers of integers.
fn bytes_per_pixel(format: Format, channels: u64) -> u64 {
    let kept = 4 * (3 + channels);
    kept + if format == Format::Exr {
        crate::film::write::bytes_per_pixel(format, channels)
    } else {
        12 + 2 * (3 + 3 + 3)
    }
}

/// A picture that is being joined.
struct ShardMerger {
    /// File of the first shard.
    file: PathBuf,
    head: Header,
    pipeline: ColourPipeline,
    display: DisplayTransform,
    window: Window,
    film: Film,
    channels: Vec<Channel>,
    /// Indices of the shards added.
    has: BTreeSet<u32>,
}

impl ShardMerger {
    /// Starts with the first shard. Memory for the whole picture is allocated after the size of the shard's values and
    /// the memory limit are checked. `there` is the total size of all shards.
    fn new(
        (file, there): (&Path, u64),
        head: Header,
        shard: Shard,
        numbers: &[u8],
        format: Format,
    ) -> Result<Self> {
        let wrong =
            |what: String| Error::input(file, what, "give the shards that `kiln render --shard` wrote");
        check_head(&head, format).map_err(wrong)?;
        let [x, y, width, height] = head.window;
        let window = Window { x, y, width, height };
        let pipeline = ColourPipeline::ALL.into_iter().find(|p| p.name() == head.pipeline);
        let pipeline = pipeline.ok_or_else(|| wrong("has an unknown colour arithmetic".into()))?;
        let display = head.display().map_err(wrong)?;
        let expected = bytes_of_shard(window, head.channels.len(), shard);
        if expected != numbers.len() as u64 {
            let what = if expected > numbers.len() as u64 { "few" } else { "many" };
            return Err(wrong(format!("the shard has too {what} pixels")));
        }
        let channels = head.channels.len() as u64;
        let times_area = |each: u64| limits::product(&[width.into(), height.into(), each]);
        let needed = times_area(bytes_per_pixel(format, channels));
        // If the shards are as large as the picture, its size is not merely claimed by a header.
        let is_there = times_area(4 * (3 + channels)) <= there;
        let checked = if is_there { limits::check(needed) } else { limits::check_claim(needed) };
        checked.map_err(|excess| {
            let with = if channels > 0 { format!(" with {channels} more channels") } else { String::new() };
            excess.at(file, format!("a picture of {width} x {height} pixels{with}"))
        })?;
        let film = Film::new(window)?;
        let channel = |name: &String| Channel { name: name.clone(), values: vec![0.0; window.area()] };
        let channels = head.channels.iter().map(channel).collect();
        Ok(ShardMerger {
            file: file.to_owned(),
            head,
            pipeline,
            display,
            window,
            film,
            channels,
            has: BTreeSet::new(),
        })
    }

    fn add(&mut self, head: &Header, shard: Shard, numbers: &[u8]) -> std::result::Result<(), String> {
        let first = self.file.display();
        if head.fingerprint() != self.head.fingerprint() {
            return Err(format!("a shard of another scene or with other settings than {first}"));
        }
        if head.of != self.head.of {
            return Err(format!("one of {} shards; {first} is one of {}", head.of, self.head.of));
        }
        // Equal fingerprints imply equal headers, unless a file was edited.
        if *head != (Header { shard: head.shard, ..self.head.clone() }) {
            return Err(format!("has a different header than {first}"));
        }
        let window = self.window;
        let mut numbers =
            numbers.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
        let mut number = || numbers.next().ok_or("the shard has too few pixels");
        for (_, tile) in self.film.tiles_mut().into_iter().enumerate().filter(|(i, _)| shard.has(*i)) {
            for channel in tile.pixels.as_flattened_mut() {
                *channel = number()?;
            }
            for channel in &mut self.channels {
                for (x, y) in pixels_of(window, tile.window) {
                    channel.values[y as usize * window.width as usize + x as usize] = number()?;
                }
            }
        }
        if number().is_ok() {
            return Err("the shard has too many pixels".into());
        }
        self.has.insert(shard.index());
        Ok(())
    }

    fn finish(self, format: Format) -> Result<Joined> {
        let missing = (1..=self.head.of).filter(|shard| !self.has.contains(shard));
        let mut named: Vec<String> = missing.clone().take(MAX_NAMED).map(|shard| shard.to_string()).collect();
        if !named.is_empty() {
            let more = missing.count() - named.len();
            if more > 0 {
                named.push(format!("and {more} more"));
            }
            let what = format!("shard {} of {} is missing", named.join(", "), self.head.of);
            let hint = "render it with --shard, and give all shards";
            return Err(Error::input(self.file.as_path(), what, hint));
        }
        let metadata = self.head.metadata;
        if format == Format::Exr {
            if self.film.rows().any(DisplayTransform::is_kept) {
                return Err(Error::usage(
                    "the shards have displayed colours of unlit surfaces or of a background, which are no radiance",
                    "name a file that ends in .png, or render the shards for an .exr",
                ));
            }
            return Ok((OutputImage::Float(self.film, self.channels, self.head.attributes), metadata));
        }
        if let [Channel { name, values }] = &self.channels[..]
            && name == ALPHA
        {
            if format == Format::Jpeg {
                return Err(Error::usage(
                    "the shards have an alpha channel, and only .png and .exr hold it",
                    "name a file that ends in .png or .exr",
                ));
            }
            let picture = OutputImage::displayed(&self.film, Some(values), self.pipeline, self.display)?;
            return Ok((picture, metadata));
        }
        if !self.channels.is_empty() {
            return Err(Error::usage(
                "the shards have AOVs, and only .exr holds them",
                "name a file that ends in .exr",
            ));
        }
        Ok((OutputImage::displayed(&self.film, None, self.pipeline, self.display)?, metadata))
    }
}
