//! Spreads work over threads that end with the call. A pool of rayon's would stay in the caller's process for ever.

use std::num::NonZero;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{Builder, JoinHandle, available_parallelism};

/// Threads that are joined in any case. `std::thread::scope` would do the same, but it makes a handle of the calling
/// thread that a C program's main thread never frees: valgrind reports it.
struct Helpers(Vec<JoinHandle<()>>);

impl Drop for Helpers {
    fn drop(&mut self) {
        for helper in self.0.drain(..) {
            // There is another panic on its way.
            let _ = helper.join();
        }
    }
}

/// Runs `work(0)`, ..., `work(count - 1)` on at most `threads` threads, the calling one among them; 0 for as many as
/// there are processors. If no further thread can be started, those that run do all the work.
pub fn spread(threads: u32, count: usize, work: &(dyn Fn(usize) + Sync)) {
    let threads = match threads {
        0 => available_parallelism().map_or(1, NonZero::get),
        threads => threads as usize,
    };
    let next = AtomicUsize::new(0);
    let take = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            work(number);
        }
    };
    let mut helpers = Helpers(Vec::new());
    for _ in 1..threads.min(count) {
        // SAFETY: what a helper borrows outlives `helpers`, which waits for all of them, after a panic too.
        match unsafe { Builder::new().spawn_unchecked(take) } {
            Ok(helper) => helpers.0.push(helper),
            Err(_) => break,
        }
    }
    take();
    while let Some(helper) = helpers.0.pop() {
        helper.join().unwrap_or_else(|panic| resume_unwind(panic));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_done_once_by_any_number_of_threads() {
        for threads in [0, 1, 2, 7, 100] {
            for count in [0, 1, 2, 50] {
                let done: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
                spread(threads, count, &|i| {
                    done[i].fetch_add(1, Ordering::Relaxed);
                });
                assert!(done.iter().all(|times| times.load(Ordering::Relaxed) == 1), "{threads} {count}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "planted")]
    fn a_panic_of_a_thread_is_the_caller_s() {
        spread(3, 9, &|i| assert!(i != 5, "planted"));
    }
}
