//! Numbers of operations, by kind.

use serde::Serialize;
use std::ops::AddAssign;

/// Kinds of operations that are counted apart.
pub(crate) const KINDS: usize = 7;
/// Parts of a shader whose operations are counted apart, at most.
pub(crate) const PARTS: usize = 4;
/// Counters of a thread.
pub(crate) const COUNTERS: usize = PARTS * KINDS;

/// Operations of shaders. A vector of three counts as three; what is known before the shader runs counts nothing, nor do moves,
/// bit casts and calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(crate) struct OperationCounts {
    /// Sums, products, comparisons, choices and rounding of floating-point numbers, each 1; a multiply-add is 2.
    pub float: u64,
    /// Divisions, roots, exponentials, logarithms, sines and arc tangents.
    pub special: u64,
    /// Operations on integers and conversions; half-precision numbers that are unpacked among them.
    pub integer: u64,
    /// 4-byte words that are read from storage buffers.
    pub loaded_words: u64,
    /// 4-byte words that are written to storage buffers.
    pub stored_words: u64,
    /// 4-byte words of arrays of one thread that are read or written by a computed index, which no register holds.
    pub array_words: u64,
    /// Conditions and iterations of loops.
    pub branches: u64,
}

impl OperationCounts {
    /// Returns the numbers in the order of the fields.
    pub(crate) fn numbers(self) -> [u64; KINDS] {
        let OperationCounts { float, special, integer, loaded_words, stored_words, array_words, branches } = self;
        [float, special, integer, loaded_words, stored_words, array_words, branches]
    }

    /// Returns the counts of numbers in the order of the fields.
    pub(crate) fn of_numbers(numbers: [u64; KINDS]) -> OperationCounts {
        let [float, special, integer, loaded_words, stored_words, array_words, branches] = numbers;
        OperationCounts { float, special, integer, loaded_words, stored_words, array_words, branches }
    }
}

impl AddAssign for OperationCounts {
    fn add_assign(&mut self, other: OperationCounts) {
        let (own, other) = (self.numbers(), other.numbers());
        *self = OperationCounts::of_numbers(std::array::from_fn(|kind| own[kind] + other[kind]));
    }
}
