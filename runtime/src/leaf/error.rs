//! Errors of a leaf's state and textures.

use thiserror::Error;

/// Error that refuses a leaf. Each message is one sentence.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum LeafError {
    /// A quantity has a value that no leaf has. Remedy: a value in the range, in the unit that the message names.
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
    /// The table of an algorithmic model has another number of cells, or numbers that no table has. Remedy: a table that `btf-synth
    /// scatter` wrote.
    #[error("a table of {cells} cells is none of an algorithmic model; make one with `btf-synth scatter`")]
    Scattering {
        /// Number of cells found.
        cells: usize,
    },
    /// The mode asks for the table of an algorithmic model, which the leaf does not have. Remedy: a leaf with a table, or another mode.
    #[error("the leaf has no table of an algorithmic model; make one with `btf-synth scatter`, or choose another mode")]
    NoTable,
    /// The textures have no texels, more than the words can address, or another number of texels than their sides give.
    #[error(
        "the leaf's textures have {texels} texels for {width} x {height}; give as many as that, at most {most} a side"
    )]
    Texels {
        /// Number of texels in a row.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Number of texels found.
        texels: usize,
        /// Largest number of texels in a row or column.
        most: usize,
    },
}
