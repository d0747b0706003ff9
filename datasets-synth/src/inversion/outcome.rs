//! Result of an inversion.

use crate::inversion::forward::MAX_UNKNOWNS;

/// What became of an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It was found.
    Found,
    /// It was found by the wavelengths that are its own, because the model errs elsewhere.
    FoundByDomain,
    /// It was found at an end of what is tried.
    AtBound,
    /// It was known.
    Held,
    /// The spectra do not tell it: it stayed where the search starts.
    Untold,
}

impl State {
    /// Returns the word of tables: `found`, `found-by-domain`, `at-bound`, `held`, `untold`.
    pub fn name(self) -> &'static str {
        match self {
            State::Found => "found",
            State::FoundByDomain => "found-by-domain",
            State::AtBound => "at-bound",
            State::Held => "held",
            State::Untold => "untold",
        }
    }
}

/// Contents of a leaf, found from its spectra.
#[derive(Debug, Clone, PartialEq)]
pub struct Inversion {
    /// Values of the unknowns, in the order of [`crate::Inverter::unknowns`].
    pub values: [f64; MAX_UNKNOWNS],
    /// Their standard errors, from the errors along the wavelengths; NaN for what was not found.
    pub standard_errors: [f64; MAX_UNKNOWNS],
    /// Their correlations: 0 beside what was not found, and between what different wavelengths told.
    pub correlations: [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    /// What became of each.
    pub states: [State; MAX_UNKNOWNS],
    /// Root mean square error of reflectance and transmittance, as far as measured.
    pub rmse: [Option<f64>; 2],
    /// Number of steps of all searches.
    pub steps: usize,
    /// What a reader must know, in words.
    pub remarks: Vec<String>,
}
