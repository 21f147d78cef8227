//! Frames in parallel, taken in their order.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};

use crate::error::{Error, Result};

/// Makes every frame of `frames` on the pool, `in_flight` at once and no more, and hands them to `take` in order, on a thread
/// beside the pool's. Frames wait no longer for each other than memory asks: one that is made holds its place until it is
/// taken. What fails first ends it all.
///
/// # Errors
/// That of the first frame that failed to be made or taken; [`Error::Interrupted`] once `cancel` is set.
pub fn in_order<T: Send>(
    pool: &rayon::ThreadPool,
    frames: &[i32],
    in_flight: usize,
    cancel: &AtomicBool,
    make: &(dyn Fn(i32) -> Result<T> + Sync),
    take: &mut (dyn FnMut(i32, T) -> Result<()> + Send),
) -> Result<()> {
    let (made, arriving) = channel::<(usize, Result<T>)>();
    // As many permits as frames may be in flight; `take` gives them back.
    let (returned, permits) = sync_channel::<()>(in_flight.max(1));
    let give_back = returned.clone();
    (0..in_flight.max(1)).for_each(|_| {
        let _ = returned.send(());
    });
    drop(returned);
    std::thread::scope(|threads| {
        let taker = threads.spawn(move || {
            taken(frames, &arriving, &mut |frame, work| {
                take(frame, work)?;
                // Nobody waits for it at the end.
                let _ = give_back.try_send(());
                Ok(())
            })
        });
        pool.in_place_scope(|scope| dispatch(scope, frames, &permits, made, cancel, make));
        let result = taker.join().unwrap_or_else(|fault| std::panic::resume_unwind(fault));
        if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { result }
    })
}

/// Starts a frame whenever there is a permit, until there are no more frames or nobody takes them.
fn dispatch<'a, T: Send + 'a>(
    scope: &rayon::Scope<'a>,
    frames: &'a [i32],
    permits: &Receiver<()>,
    made: Sender<(usize, Result<T>)>,
    cancel: &AtomicBool,
    make: &'a (dyn Fn(i32) -> Result<T> + Sync),
) {
    for (index, &frame) in frames.iter().enumerate() {
        if permits.recv().is_err() || cancel.load(Ordering::Relaxed) {
            return;
        }
        let made = made.clone();
        scope.spawn(move |_| {
            // Whoever would take it may have failed.
            let _ = made.send((index, make(frame)));
        });
    }
    // Taking ends when nobody makes any more.
    drop(made);
}

/// Takes frames as they arrive, those that are early later.
fn taken<T>(
    frames: &[i32],
    arriving: &Receiver<(usize, Result<T>)>,
    take: &mut dyn FnMut(i32, T) -> Result<()>,
) -> Result<()> {
    let mut early = BTreeMap::new();
    let mut next = 0;
    for (index, work) in arriving {
        early.insert(index, work);
        while let Some(work) = early.remove(&next) {
            take(frames[next], work?)?;
            next += 1;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    fn pool() -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap()
    }

    #[test]
    fn frames_are_taken_in_order_and_few_are_in_flight() {
        let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let frames: Vec<i32> = (0..200).rev().collect();
        let mut seen = Vec::new();
        let make = |frame: i32| {
            most.fetch_max(1 + now.fetch_add(1, Ordering::SeqCst), Ordering::SeqCst);
            // Unevenly long.
            std::thread::sleep(std::time::Duration::from_micros(u64::from(frame as u32 * 7 % 13) * 100));
            Ok(frame * 2)
        };
        let mut take = |frame, twice| {
            now.fetch_sub(1, Ordering::SeqCst);
            assert_eq!(twice, frame * 2);
            seen.push(frame);
            Ok(())
        };
        in_order(&pool(), &frames, 5, &AtomicBool::new(false), &make, &mut take).unwrap();
        assert_eq!(seen, frames);
        let most = most.into_inner();
        assert!((2..=5).contains(&most), "{most}");
    }

    #[test]
    fn the_first_failure_ends_it() {
        let frames: Vec<i32> = (0..1000).collect();
        let fail = || Error::Failed { what: "seven".into(), hint: String::new() };
        let made = AtomicUsize::new(0);
        let make = |frame: i32| {
            made.fetch_add(1, Ordering::SeqCst);
            if frame == 7 { Err(fail()) } else { Ok(frame) }
        };
        let mut taken = Vec::new();
        let mut take = |frame, _| {
            taken.push(frame);
            Ok(())
        };
        let result = in_order(&pool(), &frames, 3, &AtomicBool::new(false), &make, &mut take);
        assert_eq!((result, taken), (Err(fail()), (0..7).collect()));
        assert!(made.into_inner() <= 7 + 3);
        // Also where taking fails.
        let mut take = |frame, _| if frame == 7 { Err(fail()) } else { Ok(()) };
        let result = in_order(&pool(), &frames, 3, &AtomicBool::new(false), &Ok, &mut take);
        assert_eq!(result, Err(fail()));
    }

    #[test]
    fn a_signal_ends_it() {
        let cancel = AtomicBool::new(false);
        let frames: Vec<i32> = (0..1000).collect();
        let mut take = |frame, ()| {
            cancel.store(frame == 3, Ordering::Relaxed);
            Ok(())
        };
        let make = |_| Ok(());
        // Set at the fourth, unset by the next ones: frames in flight are still taken.
        let result = in_order(&pool(), &frames[..4], 1, &cancel, &make, &mut take);
        assert_eq!(result, Err(Error::Interrupted));
    }
}
