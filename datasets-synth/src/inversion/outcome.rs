//! Result of an inversion.

use crate::inversion::forward::MAX_UNKNOWNS;
use crate::inversion::spectra::SHARES;

/// What became of an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// State of an unknown that all wavelengths told.
    Found,
    /// State of an unknown that the wavelengths of its own absorption told, because the model errs elsewhere.
    FoundByDomain,
    /// State of an unknown that ended at a bound of what is tried.
    AtBound,
    /// State of an unknown whose value was given.
    Held,
    /// State of an unknown that the spectra do not tell, which stayed at its usual value.
    Untold,
}

impl State {
    /// Returns whether the spectra told the unknown, so that it has a standard error.
    pub fn is_found(self) -> bool {
        matches!(self, State::Found | State::FoundByDomain)
    }

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
    /// Root mean square errors of the shares of light, in the order of [`crate::LeafSpectra::shares`], as far as measured.
    pub rmse: [Option<f64>; SHARES],
    /// Number of steps of all searches.
    pub steps: usize,
    /// What a reader must know, in words.
    pub remarks: Vec<String>,
}
