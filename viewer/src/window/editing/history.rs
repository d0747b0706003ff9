//! What was changed in the window, step by step, and the way back.

/// Steps that can be taken back.
const MAX_STEPS: usize = 200;

/// States before and after a step of the history.
#[derive(Debug)]
struct Step<T> {
    of: usize,
    before: T,
    after: T,
}

/// Steps back and forth over numbered things, each with a state of its own.
#[derive(Debug)]
pub(crate) struct History<T> {
    steps: Vec<Step<T>>,
    /// Steps that are in force; the others can be done again.
    done: usize,
    /// State before the current gesture.
    open: Option<(usize, T)>,
}

impl<T> Default for History<T> {
    fn default() -> History<T> {
        History { steps: Vec::new(), done: 0, open: None }
    }
}

impl<T: Clone + PartialEq> History<T> {
    /// Notes that a thing was changed that was `before`; what follows belongs to the same step until
    /// [`History::close`].
    pub(crate) fn begin(&mut self, of: usize, before: T) {
        self.open.get_or_insert((of, before));
    }

    /// Ends a step, if one is open and changed anything; `now` tells the state of a thing.
    pub(crate) fn close(&mut self, now: impl Fn(usize) -> Option<T>) {
        let Some((of, before)) = self.open.take() else { return };
        let Some(after) = now(of).filter(|after| *after != before) else { return };
        self.steps.truncate(self.done);
        self.steps.push(Step { of, before, after });
        if self.steps.len() > MAX_STEPS {
            self.steps.remove(0);
        }
        self.done = self.steps.len();
    }

    pub(crate) fn can_undo(&self) -> bool {
        self.done > 0
    }

    pub(crate) fn can_redo(&self) -> bool {
        self.done < self.steps.len()
    }

    /// Takes the last step back: which thing it changed, and what that was before.
    pub(crate) fn undo(&mut self) -> Option<(usize, T)> {
        let step = self.steps.get(self.done.checked_sub(1)?)?;
        self.done -= 1;
        Some((step.of, step.before.clone()))
    }

    /// Does a step again that was taken back: which thing it changed, and what that was after.
    pub(crate) fn redo(&mut self) -> Option<(usize, T)> {
        let step = self.steps.get(self.done)?;
        self.done += 1;
        Some((step.of, step.after.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_steps_are_forgotten_and_gestures_are_one_step() {
        let mut history = History::default();
        for step in 0..MAX_STEPS as u32 + 10 {
            history.begin(3, step);
            // The second change of a gesture.
            history.begin(3, 1_000_000);
            history.close(|_| Some(step + 1));
        }
        let undone: Vec<(usize, u32)> = std::iter::from_fn(|| history.undo()).collect();
        assert_eq!((undone.len(), undone.last()), (MAX_STEPS, Some(&(3, 10))));
        assert_eq!(history.redo(), Some((3, 11)));
    }
}
