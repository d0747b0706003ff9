//! Keeps images that are computed several at a time until their neighbours were asked for.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Block of images, computed once.
#[derive(Debug)]
pub(super) struct Block {
    key: (usize, usize),
    images: OnceLock<Vec<f32>>,
}

/// Blocks that were asked for last.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    /// Blocks that are kept, the newest last.
    kept: Mutex<Vec<Arc<Block>>>,
}

impl Blocks {
    /// Calls `read` with the block for `key` and returns its result. On a cache miss `make` computes the block. Threads
    /// that ask for the same block wait for the one that computes it; `make` must not wait for other threads itself.
    pub(super) fn with<T>(
        &self,
        key: (usize, usize),
        make: impl FnOnce() -> Vec<f32>,
        read: impl FnOnce(&[f32]) -> T,
    ) -> T {
        let block = {
            // A thread that panicked left the list whole.
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            let block = match kept.iter().position(|block| block.key == key) {
                Some(at) => kept.remove(at),
                None => Arc::new(Block { key, images: OnceLock::new() }),
            };
            kept.push(block.clone());
            // One for each thread and two that a neighbour may come back to.
            let most = rayon::current_num_threads() + 2;
            let surplus = kept.len().saturating_sub(most);
            kept.drain(..surplus);
            block
        };
        read(block.images.get_or_init(make))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_block_is_computed_once_until_many_others_came() {
        let (blocks, made) = (Blocks::default(), AtomicUsize::new(0));
        let get = |key: usize| {
            let make = || {
                made.fetch_add(1, Ordering::Relaxed);
                vec![key as f32]
            };
            blocks.with((key, 0), make, |images| images[0])
        };
        for key in [0, 0, 1, 0, 1] {
            assert_eq!(get(key), key as f32);
        }
        assert_eq!(made.load(Ordering::Relaxed), 2);
        (0..rayon::current_num_threads() + 9).for_each(|key| assert_eq!(get(key + 2), (key + 2) as f32));
        let before = made.load(Ordering::Relaxed);
        assert_eq!(get(0), 0.0);
        assert_eq!(made.load(Ordering::Relaxed), before + 1, "the oldest was dropped");
    }
}
