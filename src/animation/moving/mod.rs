//! Films: formats that hold many pictures in one file or stream.
//!
//! A frame goes through two steps. [`Form::of`] turns its picture into what the format takes, in parallel with everything
//! else; [`Recorder::add`] writes that, in order.

#[cfg(feature = "video")]
mod h264;
#[cfg(feature = "video")]
mod mp4;
mod stream;
pub mod yuv;

use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::error::{Error, Result};
#[cfg(feature = "video")]
use crate::film::output::folder_of;
use crate::film::output::{WholeFile, describe};
use crate::film::{ColourPipeline, Film};
use yuv::Yuv420;

/// How good a film is that loses something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// Hardly told from the pictures.
    High,
    /// A few times smaller.
    Low,
}

/// What a film is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// H.264 in MP4.
    Mp4(Quality),
    /// 256 colours a frame.
    Gif,
    /// Animated PNG: lossless.
    Apng,
    /// YUV4MPEG2, 4:4:4: for other programs to read from a pipe.
    Y4m,
    /// Red, green and blue of pixel after pixel: for other programs that are told the size.
    Rgb,
}

/// A picture in what a format takes of it.
pub enum Prepared {
    /// Subsampled planes.
    Yuv(Yuv420),
    /// A frame with its palette.
    #[cfg(feature = "video")]
    Gif(gif::Frame<'static>),
    /// Bytes as they are written.
    Bytes(Vec<u8>),
}

impl Form {
    /// What the ending of a file's name asks for; `None` for another.
    pub fn from_path(file: &Path, quality: Quality) -> Option<Self> {
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        match ending.as_str() {
            "mp4" | "m4v" => Some(Form::Mp4(quality)),
            "gif" => Some(Form::Gif),
            "png" | "apng" => Some(Form::Apng),
            "y4m" => Some(Form::Y4m),
            _ => None,
        }
    }

    /// Whether pictures of this size, and so many a second, can be written so.
    ///
    /// # Errors
    /// [`Error::Usage`] where they cannot.
    pub fn check(self, [width, height]: [u32; 2], fps: f64) -> Result<()> {
        let is_video = matches!(self, Form::Mp4(_) | Form::Gif);
        if is_video && cfg!(not(feature = "video")) {
            return Err(Error::usage(
                "this kiln was built without films",
                "build it with the feature `video`, or write frames: -o frame_####.png",
            ));
        }
        #[cfg(feature = "video")]
        if matches!(self, Form::Mp4(_)) {
            let [long, short] = h264::LARGEST;
            let fits = width.max(height) <= long && width.min(height) <= short;
            if !fits || width.min(height) < h264::SMALLEST {
                return Err(Error::usage(
                    format!("a film of {width} x {height} pixels cannot be an .mp4 of kiln's"),
                    format!("give --size, 16x16 to {long}x{short}, or write frames: -o frame_####.png"),
                ));
            }
        }
        if self == Form::Gif && width.max(height) > u32::from(u16::MAX) {
            return Err(Error::usage("the picture is too large for .gif", "give a smaller --size"));
        }
        // Players show what is to last a hundredth of a second for ten.
        if self == Form::Gif && fps > 50.0 {
            let what = format!("{fps} frames a second are more than a .gif can show");
            return Err(Error::usage(what, "give --fps 50 or fewer, or write an .mp4 or an animated .png"));
        }
        Ok(())
    }

    /// The picture in what the format takes of it.
    pub fn of(self, film: &Film<[u8; 3]>) -> Prepared {
        match self {
            Form::Mp4(_) => Prepared::Yuv(Yuv420::of(film)),
            #[cfg(feature = "video")]
            Form::Gif => {
                let crate::film::Window { width, height, .. } = film.window();
                // 1 to 30, by what is lost: the share of pixels that the palette is made from. With less than all of them, small
                // things change their colour from frame to frame.
                const SPEED: i32 = 1;
                let bytes = film.bytes();
                Prepared::Gif(gif::Frame::from_rgb_speed(width as u16, height as u16, &bytes, SPEED))
            }
            Form::Y4m => Prepared::Bytes(stream::y4m_frame(film)),
            _ => Prepared::Bytes(film.bytes()),
        }
    }
}

/// What there is to know of a film before its first frame.
#[derive(Debug, Clone, Copy)]
pub struct Outline {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames a second.
    pub fps: f64,
    /// How many frames there are.
    pub frames: usize,
    /// What the pictures' values are.
    pub pipeline: ColourPipeline,
}

/// Writes a film, frame after frame.
pub struct Recorder {
    writer: Writer,
    /// The file that is being written, where it is one.
    file: Option<Sink>,
}

enum Writer {
    #[cfg(feature = "video")]
    Mp4(Box<mp4::Mp4>, Box<h264::H264>),
    #[cfg(feature = "video")]
    Gif(Box<gif::Encoder<Sink>>, Delays),
    Apng(Box<png::Writer<Sink>>),
    Plain(Box<dyn Write + Send>),
}

/// How long the frames of a GIF are shown, in hundredths of a second, such that what is rounded does not add up.
#[cfg(feature = "video")]
struct Delays {
    fps: f64,
    frames: u32,
}

#[cfg(feature = "video")]
impl Delays {
    fn next(&mut self) -> u16 {
        let until = |n: u32| (f64::from(n) * 100.0 / self.fps).round();
        self.frames += 1;
        (until(self.frames) - until(self.frames - 1)).min(65535.0) as u16
    }
}

/// A file that an encoder writes to and that is ended when the encoder has gone.
#[derive(Clone)]
struct Sink(Arc<Mutex<WholeFile>>);

impl Sink {
    fn with<T>(&self, work: impl FnOnce(&mut WholeFile) -> io::Result<T>) -> io::Result<T> {
        work(&mut *self.0.lock().map_err(|_| io::Error::other("a writer failed"))?)
    }

    /// The file, once nobody else writes to it.
    fn end(self) -> Result<()> {
        match Arc::into_inner(self.0).and_then(|file| file.into_inner().ok()) {
            Some(file) => file.finish(),
            None => Err(Error::Failed { what: "a film is still being written".into(), hint: String::new() }),
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

impl Recorder {
    /// A film in a file, which is there once it is whole.
    ///
    /// # Errors
    /// Those of the file and of the encoder.
    pub fn to_file(file: &Path, form: Form, outline: Outline) -> Result<Self> {
        let sink = Sink(Arc::new(Mutex::new(WholeFile::create(file)?)));
        let writer = writer_for(file, form, &outline, sink.clone());
        let writer = writer.map_err(|e| Error::output(file, describe(&e)))?;
        Ok(Recorder { writer, file: Some(sink) })
    }

    /// A film for a pipe: [`Form::Y4m`] or [`Form::Rgb`].
    ///
    /// # Errors
    /// Those of the stream.
    pub fn to_stream(mut out: Box<dyn Write + Send>, form: Form, outline: Outline) -> io::Result<Self> {
        if form == Form::Y4m {
            stream::y4m_header(&outline, &mut out)?;
        }
        Ok(Recorder { writer: Writer::Plain(out), file: None })
    }

    /// Adds the next frame.
    ///
    /// # Errors
    /// Those of the encoder and of what is written to.
    pub fn add(&mut self, frame: Prepared) -> io::Result<()> {
        match (&mut self.writer, frame) {
            #[cfg(feature = "video")]
            (Writer::Mp4(film, codec), Prepared::Yuv(planes)) => {
                film.add(&codec.encode(&planes).map_err(|e| refused(&e))?)
            }
            #[cfg(feature = "video")]
            (Writer::Gif(encoder, delays), Prepared::Gif(mut frame)) => {
                frame.delay = delays.next();
                encoder.write_frame(&frame).map_err(io::Error::other)
            }
            (Writer::Apng(writer), Prepared::Bytes(bytes)) => Ok(writer.write_image_data(&bytes)?),
            (Writer::Plain(out), Prepared::Bytes(bytes)) => out.write_all(&bytes),
            _ => Err(io::Error::other("a frame in another form")),
        }
    }

    /// Ends the film. Only now is there a file.
    ///
    /// # Errors
    /// Those of what is written to.
    pub fn finish(self) -> Result<()> {
        let Recorder { writer, file } = self;
        let ended = match writer {
            #[cfg(feature = "video")]
            Writer::Mp4(film, codec) => match file.clone() {
                Some(mut file) => film.finish(&codec.parameter_sets, &mut file),
                None => Ok(()),
            },
            #[cfg(feature = "video")]
            Writer::Gif(encoder, _) => encoder.into_inner().map(drop).map_err(io::Error::other),
            Writer::Apng(writer) => writer.finish().map_err(io::Error::from),
            Writer::Plain(mut out) => out.flush(),
        };
        let name = file.as_ref().and_then(|file| file.with(|file| Ok(file.name().to_owned())).ok());
        ended.map_err(|e| Error::output(name.as_deref().unwrap_or(Path::new("-")), describe(&e)))?;
        file.map_or(Ok(()), Sink::end)
    }
}

/// What OpenH264 says, in a line.
#[cfg(feature = "video")]
fn refused(e: &openh264::Error) -> io::Error {
    let text = e.to_string();
    io::Error::other(format!("OpenH264: {}", text.lines().next().unwrap_or("failed")))
}

fn writer_for(file: &Path, form: Form, outline: &Outline, mut sink: Sink) -> io::Result<Writer> {
    Ok(match form {
        #[cfg(feature = "video")]
        Form::Mp4(quality) => {
            let even = outline.size.map(|side| side.next_multiple_of(2) as u16);
            let film = mp4::Mp4::new(folder_of(file), even, outline.fps)?;
            let codec = h264::H264::new(outline.fps, quality).map_err(|e| refused(&e))?;
            Writer::Mp4(Box::new(film), Box::new(codec))
        }
        #[cfg(feature = "video")]
        Form::Gif => {
            let [width, height] = outline.size.map(|side| side as u16);
            let mut encoder = gif::Encoder::new(sink, width, height, &[]).map_err(io::Error::other)?;
            encoder.set_repeat(gif::Repeat::Infinite).map_err(io::Error::other)?;
            Writer::Gif(Box::new(encoder), Delays { fps: outline.fps, frames: 0 })
        }
        #[cfg(not(feature = "video"))]
        Form::Mp4(_) | Form::Gif => {
            return Err(io::Error::other(format!("{}: this kiln was built without films", file.display())));
        }
        Form::Apng => Writer::Apng(Box::new(stream::apng(sink, outline)?)),
        Form::Y4m => {
            stream::y4m_header(outline, &mut sink)?;
            Writer::Plain(Box::new(sink))
        }
        Form::Rgb => Writer::Plain(Box::new(sink)),
    })
}
