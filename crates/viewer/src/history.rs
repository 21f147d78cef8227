//! Undo and redo: the states between which the user changed something.

use std::time::{Duration, Instant};

/// Time without a change after which a state is kept, so that a drag is one step.
pub(crate) const SETTLE_TIME: Duration = Duration::from_millis(400);

/// Maximum number of states.
const STATES: usize = 100;

/// States before and after the current one.
pub(crate) struct History<T> {
    past: Vec<T>,
    future: Vec<T>,
    /// The last state that was kept, and a later one with the time of its first frame.
    kept: Option<T>,
    changing: Option<(T, Instant)>,
}

impl<T> Default for History<T> {
    fn default() -> Self {
        History { past: Vec::new(), future: Vec::new(), kept: None, changing: None }
    }
}

impl<T: PartialEq + Clone> History<T> {
    /// Records the state of a frame. Returns whether a change has yet to settle.
    pub(crate) fn record(&mut self, state: T, now: Instant) -> bool {
        if self.kept.is_none() || self.kept.as_ref() == Some(&state) {
            (self.kept, self.changing) = (Some(state), None);
            return false;
        }
        match &self.changing {
            Some((changing, since)) if *changing == state => {
                if now - *since < SETTLE_TIME {
                    return true;
                }
                self.keep();
                false
            }
            _ => {
                self.changing = Some((state, now));
                true
            }
        }
    }

    /// Keeps a change, after which nothing can be redone.
    fn keep(&mut self) {
        if let Some((state, _)) = self.changing.take() {
            self.past.extend(self.kept.replace(state));
            self.future.clear();
            let excess = self.past.len().saturating_sub(STATES);
            self.past.drain(..excess);
        }
    }

    /// The state before the last change, or after the last that was undone.
    pub(crate) fn go(&mut self, is_undo: bool) -> Option<T> {
        self.keep();
        let (from, to) = match is_undo {
            true => (&mut self.past, &mut self.future),
            false => (&mut self.future, &mut self.past),
        };
        let state = from.pop()?;
        to.extend(self.kept.replace(state.clone()));
        Some(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drag over 1 and 2 to 3 is one step; a change after an undo ends what can be redone.
    #[test]
    fn changes_are_undone_and_redone_in_steps() {
        let (mut history, start) = (History::default(), Instant::now());
        let record =
            |history: &mut History<i32>, state, ms| history.record(state, start + Duration::from_millis(ms));
        let states = [(0, 0, false), (1, 100, true), (2, 200, true), (3, 300, true), (3, 699, true)];
        for (state, ms, is_changing) in states {
            assert_eq!(record(&mut history, state, ms), is_changing, "{state} at {ms} ms");
        }
        assert!(!record(&mut history, 3, 700));
        // A change that has not settled yet is undone, too.
        assert!(record(&mut history, 4, 800));
        assert_eq!([true, true, true].map(|undo| history.go(undo)), [Some(3), Some(0), None]);
        assert!(!record(&mut history, 0, 900));
        assert_eq!([false, false, false].map(|undo| history.go(undo)), [Some(3), Some(4), None]);
        assert_eq!(history.go(true), Some(3));
        assert!(record(&mut history, 5, 1000));
        assert_eq!([false, true].map(|undo| history.go(undo)), [None, Some(3)]);
    }
}
