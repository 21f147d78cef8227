//! The painter: a thread that renders what was asked for last, coarse to fine.
//!
//! A new order stops what is being rendered within a tile. Only the first, coarse pass is let finish while it is quick: a mouse that
//! moves faster than that would otherwise never see a picture.

mod compare;
mod pass;
mod studio;

pub use compare::Comparison;
pub use studio::Prepared;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::ColorImage;

use super::false_colour::{Legend, Shown};
use super::look::{Order, Settings};
use super::refine::first_factor;
use crate::error::Error;
use crate::render::Statistics;
use crate::scene::Numerics;
use pass::Picture;
use studio::Studio;

/// How long a first pass may go on for an order that is no longer wanted.
const PATIENCE: Duration = Duration::from_millis(100);

/// Nice value of the threads that render: the interface comes first.
const NICENESS: i32 = 5;

/// What the painter has to say.
pub enum News {
    /// A tree is being built for an order.
    Building,
    /// A picture.
    Painted(Box<Painted>),
    /// How far the two sides of a comparison are apart.
    Compared(u64, Comparison),
    /// An order cannot be carried out: what is wrong, and what to do.
    Failed(u64, String),
}

/// A picture of an order.
pub struct Painted {
    /// Which order's.
    pub order: u64,
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
    news: Receiver<News>,
    thread: Option<std::thread::JoinHandle<()>>,
}

struct Shared {
    desk: Mutex<Desk>,
    wake: Condvar,
}

/// What interface and thread tell each other.
#[derive(Default)]
struct Desk {
    /// The order to be carried out next.
    wanted: Option<(u64, Order)>,
    orders: u64,
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
    fn desk(&self) -> std::sync::MutexGuard<'_, Desk> {
        // Nothing is half done at a desk.
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Painter {
    /// Starts the thread, which works on `threads` and calls `wake` whenever it has news.
    pub fn new(threads: Arc<rayon::ThreadPool>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let shared = Arc::new(Shared { desk: Mutex::default(), wake: Condvar::new() });
        let (sender, news) = channel();
        threads.broadcast(|_| yield_to_the_interface());
        let thread = {
            let shared = Arc::clone(&shared);
            let teller = Teller { sender, wake: Arc::new(wake) };
            std::thread::Builder::new().name("painter".into()).spawn(move || {
                yield_to_the_interface();
                work(&shared, &threads, &teller);
            })
        };
        Painter { shared, news, thread: thread.ok() }
    }

    /// Asks for a picture, instead of all that was asked for before. Returns the order's number.
    pub fn order(&self, order: Order) -> u64 {
        let mut desk = self.shared.desk();
        desk.orders += 1;
        let number = desk.orders;
        desk.wanted = Some((number, order));
        let stops = |running: &&Running| !running.is_first || running.since.elapsed() > PATIENCE;
        desk.running.iter().filter(stops).for_each(|running| running.cancel.store(true, Ordering::Relaxed));
        self.shared.wake.notify_one();
        number
    }

    /// Whether the thread has ended, which it does by a fault alone while there is a window.
    pub fn is_gone(&self) -> bool {
        self.thread.as_ref().is_none_or(std::thread::JoinHandle::is_finished)
    }

    /// Waits for what there is to say next, for a moment at most.
    pub fn wait(&self, until: Instant) -> Option<News> {
        self.news.recv_timeout(until.saturating_duration_since(Instant::now())).ok()
    }

    /// What there is to say since it was asked last, oldest first.
    pub fn news(&self) -> impl Iterator<Item = News> {
        self.news.try_iter()
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        let mut desk = self.shared.desk();
        desk.quits = true;
        desk.running.iter().for_each(|running| running.cancel.store(true, Ordering::Relaxed));
        self.shared.wake.notify_one();
        drop(desk);
        // A tree that is being built cannot be stopped; the process ends without it.
        self.thread.take();
    }
}

/// Lets the interface's thread go first where both want to run.
fn yield_to_the_interface() {
    // Of the calling thread alone, on Linux; elsewhere of the process, which has a window to itself.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, NICENESS);
}

/// Tells the interface what there is.
#[derive(Clone)]
struct Teller {
    sender: Sender<News>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Teller {
    fn tell(&self, news: News) {
        // Nobody listens to a window that closes.
        let _ = self.sender.send(news);
        (self.wake)();
    }
}

/// Carries out orders until it is told to stop.
fn work(shared: &Shared, threads: &Arc<rayon::ThreadPool>, teller: &Teller) {
    let mut studio = Studio::default();
    loop {
        let mut desk = shared.desk();
        desk.running = None;
        let (number, order) = loop {
            if desk.quits {
                return;
            }
            match desk.wanted.take() {
                Some(wanted) => break wanted,
                None => desk = shared.wake.wait(desk).unwrap_or_else(PoisonError::into_inner),
            }
        };
        drop(desk);
        let painting = Painting { shared, teller, number };
        let done = threads.install(|| painting.paint(&order, &mut studio));
        match done {
            Ok(Some([a, b])) => compare::tell(number, [a, b], threads, teller),
            Ok(None) | Err(Error::Interrupted) => {}
            Err(e) => teller.tell(News::Failed(number, super::say(&e))),
        }
    }
}

/// An order that is being carried out.
struct Painting<'a> {
    shared: &'a Shared,
    teller: &'a Teller,
    number: u64,
}

impl Painting<'_> {
    /// All passes of all sides, in turns. Returns the two pictures of a comparison.
    fn paint(&self, order: &Order, studio: &mut Studio) -> crate::error::Result<Option<[Picture; 2]>> {
        if !studio.has_all(order) {
            self.teller.tell(News::Building);
        }
        let pixels = order.size[0] as usize * order.size[1] as usize;
        let factor = first_factor(pixels * order.sides.len(), studio.seconds_a_pixel(order), order.plays);
        let mut sides = Vec::new();
        for settings in &order.sides {
            if self.is_outdated() {
                return Err(Error::Interrupted);
            }
            let exact = Settings { numerics: Numerics::Exact, ..settings.clone() };
            let exact = match order.shown {
                Shown::ErrorAgainstExact => Some(studio.prepare(order, &exact)?),
                _ => None,
            };
            sides.push(pass::Side::new(order, studio.prepare(order, settings)?, exact, settings, factor));
        }
        let passes = sides.iter().map(pass::Side::passes).max().unwrap_or(0);
        for index in 0..passes {
            for (side, painted) in sides.iter_mut().enumerate() {
                let is_first = index == 0;
                let cancel = self.begin(is_first)?;
                let Some(made) = painted.pass(index, &cancel)? else { continue };
                if let Some(seconds) = made.seconds_a_pixel {
                    studio.learn(order, seconds);
                }
                self.teller.tell(News::Painted(Box::new(made.painted(self.number, side))));
            }
        }
        let pictures: Vec<Picture> = sides.into_iter().filter_map(pass::Side::into_picture).collect();
        Ok(pictures.try_into().ok())
    }

    fn is_outdated(&self) -> bool {
        let desk = self.shared.desk();
        desk.wanted.is_some() || desk.quits
    }

    /// Begins a pass, unless there is a newer order.
    fn begin(&self, is_first: bool) -> crate::error::Result<Arc<AtomicBool>> {
        let mut desk = self.shared.desk();
        if desk.quits || desk.wanted.is_some() {
            return Err(Error::Interrupted);
        }
        let cancel = Arc::new(AtomicBool::new(false));
        desk.running = Some(Running { cancel: Arc::clone(&cancel), is_first, since: Instant::now() });
        Ok(cancel)
    }
}
