//! Errors of readers and writers of volumetric textures.

use super::rule;
use crate::error::{FormatError, Names};
use crate::rule::Rule;
use std::fmt::{self, Display, Formatter};

/// Words for volumetric textures (`.voltex`).
pub(crate) const VOLTEX_NAMES: Names = Names {
    magic: *b"VTEX",
    a_file: "a volumetric texture",
    noun: "volumetric texture",
    make: "make one with btf-fit voltex",
    again: "build it again with btf-fit voltex",
};

/// Error that refuses a volumetric texture: the faults of [`FormatError`] in the words of this format. Each message is
/// one sentence; the caller prefixes the file's name.
#[derive(Debug, Clone, PartialEq)]
pub struct VoltexError(pub FormatError);

impl VoltexError {
    /// Returns the rule that is broken; `None` for a volume that cannot be packed.
    pub fn rule(&self) -> Option<Rule> {
        self.0.rule().map(rule::of_voltex)
    }
}

impl From<FormatError> for VoltexError {
    fn from(error: FormatError) -> VoltexError {
        VoltexError(error)
    }
}

impl std::error::Error for VoltexError {}

impl Display for VoltexError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.say(&VOLTEX_NAMES, f)
    }
}
