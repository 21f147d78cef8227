//! Videos: formats that hold many frames in one file or stream.
//!
//! [`VideoFormat::convert`] turns a rendered frame into the input of the encoder, in parallel; [`VideoWriter::add`]
//! encodes and writes it, in order.

#[cfg(feature = "video")]
mod h264;
#[cfg(feature = "video")]
mod mp4;
mod stream;
pub mod yuv;

use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
#[cfg(feature = "video")]
use crate::files::folder_of;
use crate::files::{WholeFile, describe};
use crate::film::write::{OutputImage, PngForm};
use yuv::Yuv420;

/// The quality of lossy formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// Almost indistinguishable from the rendered frames.
    High,
    /// Several times smaller.
    Low,
}

/// A video format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VideoFormat {
    /// H.264 in MP4.
    Mp4(Quality),
    /// GIF: 256 colours per frame.
    Gif,
    /// Animated PNG: lossless, also with alpha and with 16 bits per channel.
    Apng,
    /// YUV4MPEG2, 4:4:4, for pipes.
    Y4m,
    /// Raw 8-bit RGB without header, for pipes.
    Rgb,
}

/// A frame as the input of an encoder.
pub enum FrameData {
    /// Planes with subsampled chroma.
    Yuv(Yuv420),
    /// A frame with its palette.
    Gif(gif::Frame<'static>),
    /// Bytes to write unchanged.
    Bytes(Vec<u8>),
}

impl VideoFormat {
    /// The format for the extension of a file name; `None` for an unknown one.
    pub fn from_path(file: &Path, quality: Quality) -> Option<Self> {
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        match ending.as_str() {
            "mp4" | "m4v" => Some(VideoFormat::Mp4(quality)),
            "gif" => Some(VideoFormat::Gif),
            "png" | "apng" => Some(VideoFormat::Apng),
            "y4m" => Some(VideoFormat::Y4m),
            _ => None,
        }
    }

    /// Checks whether the format supports frames of this size and rate.
    ///
    /// # Errors
    /// [`Error::Usage`] where it does not.
    pub fn check(self, [width, height]: [u32; 2], fps: f64) -> Result<()> {
        if matches!(self, VideoFormat::Mp4(_)) && cfg!(not(feature = "video")) {
            return Err(Error::usage(
                "this kiln was built without .mp4",
                "`cargo install --path crates/cli --features full` has it; .gif, .apng and frame_####.png work without",
            ));
        }
        #[cfg(feature = "video")]
        if matches!(self, VideoFormat::Mp4(_)) {
            let [long, short] = h264::LARGEST;
            let fits = width.max(height) <= long && width.min(height) <= short;
            if !fits || width.min(height) < h264::SMALLEST {
                return Err(Error::usage(
                    format!("kiln cannot write an .mp4 of {width} x {height} pixels"),
                    format!("give --size, 16x16 to {long}x{short}, or write frames: -o frame_####.png"),
                ));
            }
        }
        if self == VideoFormat::Gif && width.max(height) > u32::from(u16::MAX) {
            return Err(Error::usage("the picture is too large for .gif", "give a smaller --size"));
        }
        // Players show frames of 1/100 s for 1/10 s.
        if self == VideoFormat::Gif && fps > 50.0 {
            let what = format!("{fps} frames per second are too many for a .gif");
            return Err(Error::usage(what, "give --fps 50 or fewer, or write an .mp4 or an animated .png"));
        }
        Ok(())
    }

    /// Converts a rendered frame to the encoder's input.
    ///
    /// # Errors
    /// [`Error::Failed`] for alpha, 16 bits and floating-point numbers, where the format does not have them.
    pub fn convert(self, picture: &OutputImage) -> Result<FrameData> {
        if self == VideoFormat::Apng {
            let mut bytes = Vec::new();
            let collected = picture.png_rows(|row| {
                bytes.extend_from_slice(row);
                Ok(())
            });
            return collected.map(|()| FrameData::Bytes(bytes)).map_err(|e| failed(describe(&e)));
        }
        let OutputImage::Rgb8(film, _) = picture else {
            return Err(failed(
                "this film format has 8 bits per channel and no alpha; write an animated .png",
            ));
        };
        Ok(match self {
            VideoFormat::Mp4(_) => FrameData::Yuv(Yuv420::of(film)),
            VideoFormat::Gif => {
                let crate::film::Window { width, height, .. } = film.window();
                // 1 to 30: the palette is made from every n-th pixel. With fewer than all of them, small objects change
                // their colour from frame to frame.
                const SPEED: i32 = 1;
                let bytes = film.bytes();
                FrameData::Gif(gif::Frame::from_rgb_speed(width as u16, height as u16, &bytes, SPEED))
            }
            VideoFormat::Y4m => FrameData::Bytes(stream::y4m_frame(film)),
            _ => FrameData::Bytes(film.bytes()),
        })
    }
}

fn failed(what: impl Into<String>) -> Error {
    Error::Failed { what: what.into(), hint: String::new() }
}

/// The properties of a video, fixed before its first frame.
#[derive(Debug, Clone, Copy)]
pub struct VideoSpec {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames per second.
    pub fps: f64,
    /// The number of frames.
    pub frames: usize,
    /// The form of the frames in an animated PNG.
    pub form: PngForm,
}

/// Encodes and writes a video.
pub struct VideoWriter {
    encoder: Encoder,
    /// The output file; `None` for a stream.
    file: Option<Sink>,
}

enum Encoder {
    #[cfg(feature = "video")]
    Mp4(Box<mp4::Mp4>, Box<h264::H264>),
    Gif(Box<gif::Encoder<Sink>>, Delays),
    Apng(Box<png::Writer<Sink>>),
    Plain(Box<dyn Write + Send>),
}

/// The delays of GIF frames in 1/100 s, rounded so that errors do not accumulate.
struct Delays {
    fps: f64,
    frames: u32,
}

impl Delays {
    fn next(&mut self) -> u16 {
        let until = |n: u32| (f64::from(n) * 100.0 / self.fps).round();
        self.frames += 1;
        (until(self.frames) - until(self.frames - 1)).min(65535.0) as u16
    }
}

/// A file shared with the encoder, which is completed after the encoder was dropped.
#[derive(Clone)]
struct Sink(Arc<Mutex<WholeFile>>);

impl Sink {
    fn with<T>(&self, work: impl FnOnce(&mut WholeFile) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Completes the file. The encoder must have been dropped.
    fn end(self) -> Result<()> {
        match Arc::into_inner(self.0).and_then(|file| file.into_inner().ok()) {
            Some(file) => file.finish(),
            None => Err(failed("a film is still being written")),
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|file| file.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.with(WholeFile::flush)
    }
}

impl VideoWriter {
    /// A writer to a file, which appears under its name when the video is complete.
    ///
    /// # Errors
    /// [`Error::Output`] for those of the file and of the encoder.
    pub fn to_file(file: &Path, format: VideoFormat, spec: VideoSpec) -> Result<Self> {
        let sink = Sink(Arc::new(Mutex::new(WholeFile::create(file)?)));
        let encoder = encoder_for(file, format, &spec, sink.clone());
        let file = Some(sink);
        Ok(VideoWriter { encoder: encoder.map_err(|e| error(file.as_ref(), &e))?, file })
    }

    /// A writer to a stream: [`VideoFormat::Y4m`] or [`VideoFormat::Rgb`].
    ///
    /// # Errors
    /// [`Error::Output`] for those of the stream.
    pub fn to_stream(mut out: Box<dyn Write + Send>, format: VideoFormat, spec: VideoSpec) -> Result<Self> {
        if format == VideoFormat::Y4m {
            stream::y4m_header(&spec, &mut out).map_err(|e| error(None, &e))?;
        }
        Ok(VideoWriter { encoder: Encoder::Plain(out), file: None })
    }

    /// Adds the next frame.
    ///
    /// # Errors
    /// [`Error::Output`] for those of the file and of the encoder.
    pub fn add(&mut self, frame: FrameData) -> Result<()> {
        let added = match (&mut self.encoder, frame) {
            #[cfg(feature = "video")]
            (Encoder::Mp4(film, codec), FrameData::Yuv(planes)) => {
                codec.encode(&planes).map_err(|e| refused(&e)).and_then(|frame| film.add(&frame))
            }
            (Encoder::Gif(encoder, delays), FrameData::Gif(mut frame)) => {
                frame.delay = delays.next();
                encoder.write_frame(&frame).map_err(io::Error::other)
            }
            (Encoder::Apng(writer), FrameData::Bytes(bytes)) => {
                writer.write_image_data(&bytes).map_err(io::Error::from)
            }
            (Encoder::Plain(out), FrameData::Bytes(bytes)) => out.write_all(&bytes),
            _ => Err(io::Error::other("a frame in another form")),
        };
        added.map_err(|e| error(self.file.as_ref(), &e))
    }

    /// Completes the video and its file.
    pub fn finish(self) -> Result<()> {
        let VideoWriter { encoder, file } = self;
        let ended = match encoder {
            #[cfg(feature = "video")]
            Encoder::Mp4(film, codec) => match file.clone() {
                Some(mut file) => film.finish(&codec.parameter_sets, &mut file),
                None => Ok(()),
            },
            Encoder::Gif(encoder, _) => encoder.into_inner().map(drop).map_err(io::Error::other),
            Encoder::Apng(writer) => writer.finish().map_err(io::Error::from),
            Encoder::Plain(mut out) => out.flush(),
        };
        ended.map_err(|e| error(file.as_ref(), &e))?;
        file.map_or(Ok(()), Sink::end)
    }
}

/// The error of a file, or of standard output without one.
fn error(file: Option<&Sink>, e: &io::Error) -> Error {
    file.map_or_else(|| Error::output(Path::new("-"), describe(e)), |file| file.with(|file| file.error(e)))
}

/// OpenH264's message, in one line.
#[cfg(feature = "video")]
fn refused(e: &openh264::Error) -> io::Error {
    let text = e.to_string();
    io::Error::other(format!("OpenH264: {}", text.lines().next().unwrap_or("failed")))
}

fn encoder_for(file: &Path, format: VideoFormat, spec: &VideoSpec, mut sink: Sink) -> io::Result<Encoder> {
    Ok(match format {
        #[cfg(feature = "video")]
        VideoFormat::Mp4(quality) => {
            let even = spec.size.map(|side| side.next_multiple_of(2) as u16);
            let film = mp4::Mp4::new(folder_of(file), even, spec.fps)?;
            let codec = h264::H264::new(spec.fps, quality).map_err(|e| refused(&e))?;
            Encoder::Mp4(Box::new(film), Box::new(codec))
        }
        VideoFormat::Gif => {
            let [width, height] = spec.size.map(|side| side as u16);
            let mut encoder = gif::Encoder::new(sink, width, height, &[]).map_err(io::Error::other)?;
            encoder.set_repeat(gif::Repeat::Infinite).map_err(io::Error::other)?;
            Encoder::Gif(Box::new(encoder), Delays { fps: spec.fps, frames: 0 })
        }
        #[cfg(not(feature = "video"))]
        VideoFormat::Mp4(_) => {
            return Err(io::Error::other(format!("{}: this kiln was built without .mp4", file.display())));
        }
        VideoFormat::Apng => Encoder::Apng(Box::new(stream::apng(sink, spec)?)),
        VideoFormat::Y4m => {
            stream::y4m_header(spec, &mut sink)?;
            Encoder::Plain(Box::new(sink))
        }
        VideoFormat::Rgb => Encoder::Plain(Box::new(sink)),
    })
}
