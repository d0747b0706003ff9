//! What can be wrong with a leaf's state and textures, by name.

use thiserror::Error;

/// Why a leaf was refused. Each message is one sentence.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum LeafError {
    /// A value that no leaf has. Remedy: a value in the range, in the unit that the message names.
    #[error("{key} is {value}; give a number from {least} to {most}{}{unit}", if .unit.is_empty() { "" } else { " " })]
    OutOfRange {
        /// Key of the quantity, as in [`crate::LEAF_QUANTITIES`].
        key: &'static str,
        /// Value found.
        value: f32,
        /// Lower end of the range.
        least: f32,
        /// Upper end of the range.
        most: f32,
        /// Unit; empty where there is none.
        unit: &'static str,
    },
    /// Textures without texels, larger than the words can address, or of another number of texels than their sides say.
    #[error(
        "the leaf's textures have {texels} texels for {width} x {height}; give as many as that, at most {most} a side"
    )]
    Texels {
        /// Texels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Texels found.
        texels: usize,
        /// Largest number of texels in a row or column.
        most: usize,
    },
}
