//! Frames made in parallel and consumed in order.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};

use crate::error::{Error, Result};

/// Calls `make` for every frame on the pool, and `take` with the results in order, on a thread outside the pool. At
/// most `in_flight` frames are being made or wait to be taken. The first error ends the run.
///
/// # Errors
/// The error of the first frame that could not be made or taken; [`Error::Interrupted`] once `cancel` is set.
pub fn in_order<T: Send>(
    pool: &rayon::ThreadPool,
    frames: &[i32],
    in_flight: usize,
    cancel: &AtomicBool,
    make: &(dyn Fn(i32) -> Result<T> + Sync),
    take: &mut (dyn FnMut(i32, T) -> Result<()> + Send),
) -> Result<()> {
    let (made, arriving) = channel::<(usize, Result<T>)>();
    // One permit per frame in flight; it is returned when the frame was taken.
    let (returned, permits) = sync_channel::<()>(in_flight.max(1));
    let give_back = returned.clone();
    (0..in_flight.max(1)).for_each(|_| {
        let _ = returned.send(());
    });
    drop(returned);
    std::thread::scope(|threads| {
        let taker = threads.spawn(move || {
            take_in_order(frames, &arriving, &mut |frame, work| {
                take(frame, work)?;
                // Fails at the end, when no frame waits for a permit.
                let _ = give_back.try_send(());
                Ok(())
            })
        });
        pool.in_place_scope(|scope| dispatch(scope, frames, &permits, made, cancel, make));
        let result = taker.join().unwrap_or_else(|fault| std::panic::resume_unwind(fault));
        if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { result }
    })
}

/// Starts a frame for each permit, until all are started, `take` has failed, or `cancel` is set.
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
            // Fails where `take` has failed.
            let _ = made.send((index, make(frame)));
        });
    }
    // The receiver ends when all senders are dropped.
    drop(made);
}

/// Takes arriving frames in order; those that arrive early wait.
fn take_in_order<T>(
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
        // Set at the last of four frames.
        let result = in_order(&pool(), &frames[..4], 1, &cancel, &make, &mut take);
        assert_eq!(result, Err(Error::Interrupted));
    }
}
