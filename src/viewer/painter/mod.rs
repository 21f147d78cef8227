//! The painter: a thread that renders what was asked for last, coarse to fine.
//!
//! A new order stops what is being rendered within a tile. Only the first, coarse pass is let finish while it is quick: a mouse that
//! moves faster than that would otherwise never see a picture.

mod compare;
mod pass;
mod render_cache;

pub use compare::Comparison;
pub use render_cache::Prepared;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::ColorImage;

use super::false_colour::{Legend, DisplayMode};
use super::request::{RenderRequest, Settings};
use super::refine::first_factor;
use crate::error::Error;
use crate::render::Statistics;
use crate::scene::Numerics;
use pass::PipelineImage;
use render_cache::RenderCache;

/// How long a first pass may go on for an order that is no longer wanted.
const FIRST_PASS_LIMIT: Duration = Duration::from_millis(100);

/// Nice value of the threads that render: the interface comes first.
const NICENESS: i32 = 5;

/// What the painter has to say.
pub enum Message {
    /// A tree is being built for an order.
    Building,
    /// A picture.
    Image(Box<RenderedImage>),
    /// How far the two sides of a comparison are apart.
    Compared(u64, Comparison),
    /// An order cannot be carried out: what is wrong, and what to do.
    Failed(u64, String),
}

/// A picture of an order.
pub struct RenderedImage {
    /// Which order's.
    pub request: u64,
    /// Which of its sides.
    pub side: usize,
    /// The picture.
    pub image: Arc<ColorImage>,
    /// It has a pixel for so many of the order's, on each axis.
    pub factor: u32,
    /// Samples a pixel so far, and in the end; the most where that depends on the pixel.
    pub samples: (u32, u32),
    /// Whether it is what was asked for.
    pub is_last: bool,
    /// Time spent on pictures of the full size so far; of a coarse one, on itself.
    pub time: Duration,
    /// What was done for it.
    pub statistics: Statistics,
    /// What the colours mean, where they are not those of the picture.
    pub legend: Option<Legend>,
    /// What it was made with.
    pub prepared: Arc<Prepared>,
}

/// The painter, seen from the interface.
pub struct Painter {
    shared: Arc<Shared>,
    messages: Receiver<Message>,
    thread: Option<std::thread::JoinHandle<()>>,
}

struct Shared {
    state: Mutex<QueueState>,
    wake: Condvar,
}

/// What interface and thread tell each other.
#[derive(Default)]
struct QueueState {
    /// The order to be carried out next.
    wanted: Option<(u64, RenderRequest)>,
    requests: u64,
    /// What is being rendered.
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
        // Nothing is half done at a desk.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Painter {
    /// Starts the thread, which works on `threads` and calls `wake` whenever it has news.
    pub fn new(threads: Arc<rayon::ThreadPool>, wake: impl Fn() + Send + Sync + 'static) -> Self {
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

    /// Asks for a picture, instead of all that was asked for before. Returns the order's number.
    pub fn request(&self, request: RenderRequest) -> u64 {
        let mut state = self.shared.lock();
        state.requests += 1;
        let number = state.requests;
        state.wanted = Some((number, request));
        let must_cancel = |running: &&Running| !running.is_first || running.since.elapsed() > FIRST_PASS_LIMIT;
        state.running.iter().filter(must_cancel).for_each(|running| running.cancel.store(true, Ordering::Relaxed));
        self.shared.wake.notify_one();
        number
    }

    /// Whether the thread has ended, which it does by a fault alone while there is a window.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(std::thread::JoinHandle::is_finished)
    }

    /// Waits for what there is to say next, for a moment at most.
    pub fn wait(&self, until: Instant) -> Option<Message> {
        self.messages.recv_timeout(until.saturating_duration_since(Instant::now())).ok()
    }

    /// What there is to say since it was asked last, oldest first.
    pub fn messages(&self) -> impl Iterator<Item = Message> {
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
        // A tree that is being built cannot be stopped; the process ends without it.
        self.thread.take();
    }
}

/// Lets the interface's thread go first where both want to run.
fn lower_thread_priority() {
    // Of the calling thread alone, on Linux; elsewhere of the process, which has a window to itself.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, NICENESS);
}

/// Tells the interface what there is.
#[derive(Clone)]
struct MessageSender {
    sender: Sender<Message>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl MessageSender {
    fn send(&self, message: Message) {
        // Nobody listens to a window that closes.
        let _ = self.sender.send(message);
        (self.wake)();
    }
}

/// Carries out orders until it is told to stop.
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
            Ok(Some([a, b])) => compare::compare_sides(number, [a, b], threads, sender),
            Ok(None) | Err(Error::Interrupted) => {}
            Err(e) => sender.send(Message::Failed(number, super::message_with_hint(&e))),
        }
    }
}

/// An order that is being carried out.
struct RenderTask<'a> {
    shared: &'a Shared,
    sender: &'a MessageSender,
    number: u64,
}

impl RenderTask<'_> {
    /// All passes of all sides, in turns. Returns the two pictures of a comparison.
    fn paint(&self, request: &RenderRequest, cache: &mut RenderCache) -> crate::error::Result<Option<[PipelineImage; 2]>> {
        if !cache.has_worlds(request) {
            self.sender.send(Message::Building);
        }
        let pixels = request.size[0] as usize * request.size[1] as usize;
        let factor = first_factor(pixels * request.sides.len(), cache.seconds_per_pixel(request), request.is_playing);
        let mut sides = Vec::new();
        for settings in &request.sides {
            if self.is_outdated() {
                return Err(Error::Interrupted);
            }
            let exact = Settings { numerics: Numerics::Exact, ..settings.clone() };
            let exact = match request.display_mode {
                DisplayMode::ErrorAgainstExact => Some(cache.prepare(request, &exact)?),
                _ => None,
            };
            sides.push(pass::Side::new(request, cache.prepare(request, settings)?, exact, settings, factor));
        }
        let passes = sides.iter().map(pass::Side::passes).max().unwrap_or(0);
        for index in 0..passes {
            for (side, rendered) in sides.iter_mut().enumerate() {
                let is_first = index == 0;
                let cancel = self.begin(is_first)?;
                let Some(made) = rendered.pass(index, &cancel)? else { continue };
                if let Some(seconds) = made.seconds_per_pixel {
                    cache.record_seconds(request, seconds);
                }
                self.sender.send(Message::Image(Box::new(made.rendered(self.number, side))));
            }
        }
        let pictures: Vec<PipelineImage> = sides.into_iter().filter_map(pass::Side::into_picture).collect();
        Ok(pictures.try_into().ok())
    }

    fn is_outdated(&self) -> bool {
        let state = self.shared.lock();
        state.wanted.is_some() || state.quits
    }

    /// Begins a pass, unless there is a newer order.
    fn begin(&self, is_first: bool) -> crate::error::Result<Arc<AtomicBool>> {
        let mut state = self.shared.lock();
        if state.quits || state.wanted.is_some() {
            return Err(Error::Interrupted);
        }
        let cancel = Arc::new(AtomicBool::new(false));
        state.running = Some(Running { cancel: Arc::clone(&cancel), is_first, since: Instant::now() });
        Ok(cancel)
    }
}
