//! Collects the faults of a file: all of them for an examination, the first for a reader.

use crate::error::FormatError;

/// Largest number of faults that are kept of one file.
pub(crate) const MAX_FAULTS: usize = 256;

/// A broken rule and its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub error: FormatError,
    /// Layer of the fault, where the section's name does not tell it.
    pub layer: Option<u32>,
    /// Byte of the file at which the fault is, where the section's place does not tell it.
    pub offset: Option<u64>,
}

/// Faults found so far, in the order in which a reader meets them.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    found: Vec<Fault>,
}

impl Faults {
    pub(crate) fn push(&mut self, error: FormatError) {
        self.push_at(error, None, None);
    }

    pub(crate) fn push_at(&mut self, error: FormatError, layer: Option<u32>, offset: Option<u64>) {
        if self.found.len() < MAX_FAULTS {
            self.found.push(Fault { error, layer, offset });
        }
    }

    /// Returns the value of a successful read; keeps the error of a failed one and returns `None`.
    pub(crate) fn keep<T>(&mut self, read: Result<T, FormatError>) -> Option<T> {
        read.map_err(|error| self.push(error)).ok()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        self.found.len()
    }

    pub(crate) fn found(&self) -> &[Fault] {
        &self.found
    }

    /// Returns `read`, or the first fault if there is one.
    ///
    /// # Panics
    /// If nothing was read and there is no fault.
    pub(crate) fn or_first<T>(self, read: Option<T>) -> Result<T, FormatError> {
        match self.found.into_iter().next() {
            Some(fault) => Err(fault.error),
            None => Ok(read.expect("what is not read has a fault")),
        }
    }
}
