//! A leaf model as an inversion sees it: shares of light and their derivatives by some unknowns.

use crate::optics::abm::path_lengths::Face;

/// Number of unknowns at most, those of plates in two unequal halves.
pub const MAX_UNKNOWNS: usize = 10;

/// Values of unknowns; those beyond the number that a model has stay 0.
pub(crate) type Values = [f64; MAX_UNKNOWNS];

/// Faces of a leaf, in the order of spectra.
pub(crate) const FACES: [Face; 2] = [Face::Adaxial, Face::Abaxial];

/// Returns the place of a face among [`FACES`].
pub(crate) fn place_of(face: Face) -> usize {
    usize::from(face == Face::Abaxial)
}

/// Unknown of a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// Key in files, with the unit: that of a leaf file where it has one.
    pub key: &'static str,
    /// Option of the command line that holds it, without the dashes.
    pub option: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// Unit; empty for a number without one.
    pub unit: &'static str,
    /// Least and greatest value that is tried. Wider than a leaf's range, so that its end is no answer.
    pub bounds: [f64; 2],
    /// Least and greatest value of leaves.
    pub range: [f64; 2],
    /// Value of a usual leaf: where the search starts, and what holds where the spectra tell nothing.
    pub start: f64,
    /// Standard deviation of leaves about it: what is told badly stays that near.
    pub spread: f64,
}

impl Unknown {
    /// Returns how far the values go.
    pub(crate) fn span(&self) -> f64 {
        self.bounds[1] - self.bounds[0]
    }
}

/// Reflectance and transmittance of one face at one wavelength with their derivatives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sensitivity {
    /// Reflectance, transmittance.
    pub(crate) shares: [f64; 2],
    /// Their derivatives by each unknown.
    pub(crate) by: [Values; 2],
}

/// Wavelengths that tell some unknowns better than all wavelengths do.
pub(crate) struct Domain {
    /// Indices of the unknowns.
    pub(crate) tells: &'static [usize],
    /// Indices of unknowns that are free as well, but not told.
    pub(crate) with: &'static [usize],
    /// First and last wavelength in nanometres.
    pub(crate) nm: [f64; 2],
}

/// Leaf model at fixed wavelengths.
pub(crate) trait Forward: Sync + Send {
    /// Returns the unknowns.
    fn unknowns(&self) -> &[Unknown];

    /// Returns the index of the first unknown that only spectra of both faces tell: all after it are of that kind, too.
    fn first_of_both_faces(&self) -> usize {
        self.unknowns().len()
    }

    /// Returns the wavelengths that tell some of the unknowns by themselves, in the order in which they are searched.
    fn domains(&self) -> &[Domain] {
        &[]
    }

    /// Returns the shares of light that falls onto `face` at the wavelength of index `band`.
    fn at(&self, band: usize, face: Face, values: &Values) -> Sensitivity;
}
