//! The painter: a thread that renders the newest request from coarse to fine.
//!
//! A new request cancels the current pass within a tile. The first, coarse pass is completed if it is fast: otherwise a
//! continuous mouse drag would cancel every pass, and no image would be shown.

mod pass;
mod render_cache;

pub(crate) use render_cache::{Prepared, RenderCache};

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::ColorImage;

use super::false_colour::Legend;
use super::refine::PassTime;
use super::request::RenderRequest;
use kiln::error::{Error, Result, Warnings};
use kiln::film::write::{Format, OutputImage};
use kiln::film::{DisplayTransform, Film};
use kiln::job::{Metadata, RenderControl, RenderJob};
use kiln::render::Statistics;

/// Duration after which the first pass of an outdated request is cancelled.
const FIRST_PASS_LIMIT: Duration = Duration::from_millis(100);

/// Nice value of the rendering threads, below the interface's priority.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 5;

/// Message of the painter to the interface.
pub(crate) enum Message {
    /// The tree of a request is being built.
    Building,
    /// The image of a pass.
    Image(Box<RenderedImage>),
    /// Number of a request that failed, and the message with its hint.
    Failed(u64, String),
}

/// Image of one pass of a request.
pub(crate) struct RenderedImage {
    /// Request number.
    pub request: u64,
    /// Pixels as displayed.
    pub image: Arc<ColorImage>,
    /// Display transform of the picture.
    pub display: DisplayTransform,
    /// Width and height of an image pixel, in pixels of the request.
    pub factor: u32,
    /// Samples per pixel so far, and in total; the mean of the picture and the maximum if sampling is adaptive.
    pub samples: (u32, u32),
    /// Whether this is the last pass.
    pub is_last: bool,
    /// The pixels of the finished picture, to be developed by `display`.
    pub film: Option<Arc<Film>>,
    /// Time of this pass and those before it.
    pub time: Duration,
    /// Statistics of the pass.
    pub statistics: Statistics,
    /// Warnings and notes about the finished picture.
    pub of_image: Warnings,
    /// Statistics of this pass and the passes before it, for what the picture has taken.
    pub spent: Statistics,
    /// Legend of false colours.
    pub legend: Option<Legend>,
    /// The prepared scene that was rendered.
    pub prepared: Arc<Prepared>,
    /// Its job with the metered exposure and clamp, if they are metered and this image shows them.
    pub metered: Option<Arc<RenderJob>>,
}

impl RenderedImage {
    /// Adds the warnings and notes about the picture before it is rendered.
    pub(crate) fn warn_of_picture(&self, warnings: &mut Warnings) {
        let Prepared { session, picture, of_look, .. } = &*self.prepared;
        warnings.extend(of_look);
        session.warn(picture, self.metered.as_deref().unwrap_or(&picture.job), warnings);
    }
}

/// Handle of the painter thread.
pub(crate) struct Painter {
    shared: Arc<Shared>,
    messages: Receiver<Message>,
    thread: Option<std::thread::JoinHandle<()>>,
}

struct Shared {
    state: Mutex<QueueState>,
    wake: Condvar,
}

/// State shared by the interface and the painter thread.
#[derive(Default)]
struct QueueState {
    /// The request to render next, and its number.
    wanted: Option<(u64, RenderRequest)>,
    requests: u64,
    /// The current pass.
    running: Option<Running>,
    quits: bool,
}

struct Running {
    cancel: Arc<AtomicBool>,
    is_first: bool,
    since: Instant,
}

impl Shared {
    fn lock(&self) -> std::sync::MutexGuard<'_, QueueState> {
        // Each critical section leaves the state consistent, also when it panics.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Painter {
    /// Starts the thread. It renders on `threads` and calls `wake` after each message.
    pub(crate) fn new(threads: Arc<rayon::ThreadPool>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let shared = Arc::new(Shared { state: Mutex::default(), wake: Condvar::new() });
        let (sender, messages) = channel();
        threads.broadcast(|_| lower_thread_priority());
        let thread = {
            let shared = Arc::clone(&shared);
            let sender = MessageSender { sender, wake: Arc::new(wake) };
            std::thread::Builder::new().name("painter".into()).spawn(move || {
                lower_thread_priority();
                work(&shared, &threads, &sender);
            })
        };
        Painter { shared, messages, thread: thread.ok() }
    }

    /// Posts a request, which replaces all earlier ones. Returns its number.
    pub(crate) fn request(&self, request: RenderRequest) -> u64 {
        let mut state = self.shared.lock();
        state.requests += 1;
        let number = state.requests;
        state.wanted = Some((number, request));
        let must_cancel =
            |running: &&Running| !running.is_first || running.since.elapsed() > FIRST_PASS_LIMIT;
        state
            .running
            .iter()
            .filter(must_cancel)
            .for_each(|running| running.cancel.store(true, Ordering::Relaxed));
        self.shared.wake.notify_one();
        number
    }

    /// Whether the thread has ended. While the window is open, only a panic ends it.
    pub(crate) fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(std::thread::JoinHandle::is_finished)
    }

    /// Waits for the next message, until the given time.
    pub(crate) fn wait(&self, until: Instant) -> Option<Message> {
        self.messages.recv_timeout(until.saturating_duration_since(Instant::now())).ok()
    }

    /// Pending messages, oldest first.
    pub(crate) fn messages(&self) -> impl Iterator<Item = Message> {
        self.messages.try_iter()
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        state.quits = true;
        state.running.iter().for_each(|running| running.cancel.store(true, Ordering::Relaxed));
        self.shared.wake.notify_one();
        drop(state);
        // A tree build cannot be cancelled, so the thread is not joined.
        self.thread.take();
    }
}

/// Gives the calling thread a lower priority than the interface's thread.
fn lower_thread_priority() {
    // On Linux `setpriority` applies to the calling thread; elsewhere it would apply to the whole process.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, NICENESS);
}

/// Sends messages to the interface and wakes it.
#[derive(Clone)]
struct MessageSender {
    sender: Sender<Message>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl MessageSender {
    fn send(&self, message: Message) {
        // The receiver is dropped when the window closes.
        let _ = self.sender.send(message);
        (self.wake)();
    }
}

/// Main loop of the painter thread: renders requests until the painter is dropped.
fn work(shared: &Shared, threads: &Arc<rayon::ThreadPool>, sender: &MessageSender) {
    let mut cache = RenderCache::default();
    loop {
        let mut state = shared.lock();
        state.running = None;
        let (number, request) = loop {
            if state.quits {
                return;
            }
            match state.wanted.take() {
                Some(wanted) => break wanted,
                None => state = shared.wake.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        };
        drop(state);
        let task = RenderTask { shared, sender, number };
        let done = threads.install(|| task.paint(&request, &mut cache));
        match done {
            Ok(()) | Err(Error::Interrupted) => {}
            Err(e) => sender.send(Message::Failed(number, super::message_with_hint(&e))),
        }
    }
}

/// A request that is being rendered.
struct RenderTask<'a> {
    shared: &'a Shared,
    sender: &'a MessageSender,
    number: u64,
}

impl RenderTask<'_> {
    /// Renders all passes.
    fn paint(&self, request: &RenderRequest, cache: &mut RenderCache) -> Result<()> {
        if !cache.has_world(request) {
            self.sender.send(Message::Building);
        }
        let factor = PassTime::first_factor(cache.pass_time(request), request.size, request.is_playing);
        let mut progress = pass::Progress::new(request, cache.prepare(request)?, factor);
        for index in 0..progress.passes() {
            let cancel = self.begin(index == 0)?;
            let (rendered, time) = progress.pass(index, &cancel, self.number)?;
            if let Some(time) = time {
                cache.record_time(request, time);
            }
            rendered.metered.iter().for_each(|job| cache.record_exposure(job));
            self.sender.send(Message::Image(Box::new(rendered)));
        }
        Ok(())
    }

    /// Registers a pass and returns its cancel flag. [`Error::Interrupted`] if there is a newer request.
    fn begin(&self, is_first: bool) -> Result<Arc<AtomicBool>> {
        let mut state = self.shared.lock();
        if state.quits || state.wanted.is_some() {
            return Err(Error::Interrupted);
        }
        let cancel = Arc::new(AtomicBool::new(false));
        state.running = Some(Running { cancel: Arc::clone(&cancel), is_first, since: Instant::now() });
        Ok(cancel)
    }
}

/// The picture that the window ends with and saves, at a frame of an animation, with the messages that it shows.
///
/// # Errors
/// Those of rendering.
pub fn final_picture(
    opened: &Arc<super::Opened>,
    size: [u32; 2],
    frame: Option<i32>,
    warnings: &mut Warnings,
) -> Result<(OutputImage, Metadata)> {
    let request = request_at(opened, size, frame.unwrap_or(0));
    let prepared = RenderCache::default().prepare(&request)?;
    let shown = pass::Progress::new(&request, prepared, 4).final_image()?;
    shown.warn_of_picture(warnings);
    warnings.extend(&shown.of_image);
    let film = shown.film.expect("a finished picture");
    let finished = Some(super::save::Finished { film, display: shown.display });
    let picture = super::save::SavedPicture { request, frame, finished, command: String::new() };
    picture.image(Format::Png, &RenderControl::default())
}

/// The first request of opened files, at a frame of their animation if they have one.
pub(crate) fn request_at(opened: &Arc<super::Opened>, size: [u32; 2], frame: i32) -> RenderRequest {
    use kiln::scene::animation::Timeline;
    let mut request = super::controls::Controls::new(opened).request(opened, size);
    if let (1.., Some(animation)) = (frame, &opened.scene().animation) {
        let timeline = Timeline::new(animation.fps, animation.duration, animation.repeat);
        request.time = timeline.expect("frames").moment(frame);
    }
    request
}
