//! Runs work on threads that the caller provides: this crate starts none.

use std::sync::{Mutex, OnceLock};

/// A caller's way to run `work(0)`, ..., `work(count - 1)` once each, in any order and on any threads, and to return
/// when all are done. Results do not depend on the order. With rayon: `&|count, work|
/// (0..count).into_par_iter().for_each(work)`.
pub type Threads<'a> = &'a dyn Fn(usize, &(dyn Fn(usize) + Sync));

/// Runs all work on the calling thread: [`Threads`] for callers without threads.
pub fn serial(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).for_each(work);
}

/// Returns `[make(0), ..., make(count - 1)]`, made on `threads`.
///
/// # Panics
/// If `threads` leaves a number out.
pub(crate) fn map<T: Send + Sync>(threads: Threads, count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let slots: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
    threads(count, &|i| {
        slots[i].get_or_init(|| make(i));
    });
    slots.into_iter().map(|slot| slot.into_inner().expect("threads run every number")).collect()
}

/// Calls `fill(i, chunk)` on `threads` for each chunk of `values`; a chunk has `length` values, the last one maybe
/// fewer.
pub(crate) fn fill<T: Send>(threads: Threads, values: &mut [T], length: usize, fill: impl Fn(usize, &mut [T]) + Sync) {
    let chunks: Vec<Mutex<&mut [T]>> = values.chunks_mut(length.max(1)).map(Mutex::new).collect();
    threads(chunks.len(), &|i| {
        // Each chunk has one writer; the lock only says so to the compiler.
        if let Ok(mut chunk) = chunks[i].lock() {
            fill(i, &mut chunk);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs work on two threads, which start at opposite ends.
    fn two(count: usize, work: &(dyn Fn(usize) + Sync)) {
        std::thread::scope(|scope| {
            scope.spawn(|| (0..count / 2).for_each(work));
            scope.spawn(|| (count / 2..count).rev().for_each(work));
        });
    }

    #[test]
    fn results_stand_in_order_whoever_makes_them() {
        for threads in [&serial as Threads, &two] {
            assert_eq!(map(threads, 5, |i| i * i), [0, 1, 4, 9, 16]);
            let mut values = [0; 7];
            fill(threads, &mut values, 3, |i, chunk| chunk.fill(i + 1));
            assert_eq!(values, [1, 1, 1, 2, 2, 2, 3]);
        }
    }

    #[test]
    #[should_panic(expected = "threads run every number")]
    fn a_number_left_out_is_noticed() {
        map(&|count, work| (1..count).for_each(work), 3, |i| i);
    }
}
