//! Finds the contents of a leaf from its measured spectra: a leaf model's least squares, with what the result is worth.
//!
//! The search is damped Gauss-Newton with the model's exact derivatives, first over some 64 wavelengths, then over all.
//! Then errors are looked at along the wavelengths, and the search goes on with errors that hang together as these do
//! ([`Whitening`]), which is what makes standard errors more than noise. Where they do hang together, the model itself
//! errs, and a content is told best by the wavelengths that it absorbs most by itself: those are searched last, each
//! content with N alone ([`Domain`]). Spectra whose errors are noise tell everything best by all wavelengths.
//!
//! Sources: the task and its usual way [Jacquemoud 1990; Feret 2017]; the wavelengths of chlorophyll, carotenoids, water
//! and dry matter [Feret 2019; Spafford 2021].

use crate::error::SynthError;
use crate::inversion::forward::{Domain, FACES, Forward, MAX_UNKNOWNS, Unknown, Values};
use crate::inversion::halves::{HalvesForward, halves_unknowns};
use crate::inversion::least_squares::{Minimum, Normal, minimum, movable};
use crate::inversion::outcome::{Inversion, State};
use crate::inversion::plates::{PlateForward, plate_unknowns};
use crate::inversion::remarks::remarks;
use crate::inversion::spectra::{LeafSpectra, SHARES};
use crate::inversion::tissue::{TissueForward, tissue_unknowns};
use crate::inversion::whitening::{Errors, Row, Rows, Whitener, Whitening};
use crate::leaf::model::LeafModel;
use crate::optics::abm::path_lengths::Face;
use crate::optics::plates::model::{PROSPECT_CONE_DEG, PlateModel};
use crate::optics::specific_absorption::LEAF_TABLE_NM;

/// Standard deviation of errors before anything is known of them.
const FIRST_ERROR: f64 = 5e-3;
/// Wavelengths that the first search looks at, about.
const COARSE_BANDS: usize = 64;
/// Root mean square change of the shares of light over the whole range of leaves below which an unknown is not told.
const TELLS: f64 = 2e-3;
/// Measurements above the number of unknowns that are needed to look at errors along the wavelengths.
const MIN_FREEDOM: usize = 24;
/// Distance in nanometres over which errors hang together at most: beyond, the level of a spectrum would tell nothing.
const MAX_LENGTH_NM: f64 = 60.0;
/// Times that errors are looked at anew.
const LOOKS: usize = 2;

/// Share of an error that its neighbour has, above which the model errs and not the instrument.
const MODEL_ERRS: f64 = 0.5;
/// Distance in nanometres for which [`MODEL_ERRS`] is told.
const NEIGHBOUR_NM: f64 = 5.0;
/// Standard deviation of errors below which the model is right, whatever they look like.
const MIN_MODEL_ERROR: f64 = 5e-4;
/// Wavelengths that a domain needs, and how far in nanometres its ends may be from the nearest of them.
const MIN_DOMAIN_BANDS: usize = 4;
const DOMAIN_END_NM: f64 = 10.0;

/// Options of an inversion.
#[derive(Debug, Clone, PartialEq)]
pub struct InversionParams {
    /// Model of the leaf: `plate-n`, `plate-two-sided` or an algorithmic one.
    pub model: LeafModel,
    /// Values that are known, in the order of [`Inverter::unknowns`].
    pub held: [Option<f64>; MAX_UNKNOWNS],
    /// Faces that spectra are of, adaxial and abaxial: an algorithmic model is traced for each.
    pub faces: [bool; 2],
    /// Half-angle of the cone of incident light in degrees, for plates.
    pub cone_deg: f64,
    /// Rays of each trace of an algorithmic model.
    pub rays: u64,
    /// Seed of the rays.
    pub seed: u64,
    /// Whether errors of neighbouring wavelengths may hang together, and contents are told by their own wavelengths where
    /// they do; else all wavelengths count alike.
    pub correlated: bool,
}

impl Default for InversionParams {
    /// Returns `plate-n` under PROSPECT's cone of light with nothing known.
    fn default() -> InversionParams {
        InversionParams {
            model: LeafModel::default(),
            held: [None; MAX_UNKNOWNS],
            faces: [true, false],
            cone_deg: PROSPECT_CONE_DEG,
            rays: 200_000,
            seed: 1,
            correlated: true,
        }
    }
}

impl InversionParams {
    /// Returns what the model's inversion looks for.
    pub fn unknowns(&self) -> Vec<Unknown> {
        match &self.model {
            LeafModel::Plate(_) => plate_unknowns().to_vec(),
            LeafModel::TwoSided(halves) => halves_unknowns(halves).to_vec(),
            _ => tissue_unknowns().to_vec(),
        }
    }
}

/// Model that is ready for spectra at given wavelengths.
pub struct Inverter {
    forward: Box<dyn Forward>,
    held: [Option<f64>; MAX_UNKNOWNS],
    correlated: bool,
    /// Faces that the model is ready for.
    faces: [bool; 2],
    /// All wavelengths of the spectra, and those that the model covers, as indices.
    wavelengths_nm: Vec<f64>,
    covered: Vec<usize>,
}

impl Inverter {
    /// Prepares the model of `params` for spectra at `wavelengths_nm`, ascending; those outside of [`LEAF_TABLE_NM`] are
    /// passed over. An algorithmic model is traced here, on the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for a model whose contents cannot be told, for no wavelength within the range, and
    /// for a value that is held outside of its bounds.
    pub fn new(params: &InversionParams, wavelengths_nm: &[f64]) -> Result<Inverter, SynthError> {
        let within = |i: &usize| (LEAF_TABLE_NM[0]..=LEAF_TABLE_NM[1]).contains(&wavelengths_nm[*i]);
        let covered: Vec<usize> = (0..wavelengths_nm.len()).filter(within).collect();
        let nm: Vec<f64> = covered.iter().map(|i| wavelengths_nm[*i]).collect();
        if nm.is_empty() {
            let value = wavelengths_nm.first().map_or_else(|| "missing".to_owned(), |nm| format!("{nm} nm"));
            let allowed = format!("some from {} to {} nm", LEAF_TABLE_NM[0], LEAF_TABLE_NM[1]);
            return Err(SynthError::BadParameter { name: "the first wavelength", value, allowed });
        }
        let forward: Box<dyn Forward> = match &params.model {
            LeafModel::Plate(PlateModel::N) => Box::new(PlateForward::new(&nm, params.cone_deg)),
            LeafModel::TwoSided(halves) => {
                halves.check()?;
                Box::new(HalvesForward::new(halves, &nm, params.cone_deg))
            }
            model => Box::new(TissueForward::new(model, params.faces, &nm, params.rays, params.seed)?),
        };
        for (unknown, held) in forward.unknowns().iter().zip(params.held) {
            let [least, most] = unknown.bounds;
            if let Some(value) = held.filter(|value| !(least..=most).contains(value)) {
                let (name, allowed) = (unknown.name, format!("a number from {least} to {most} {}", unknown.unit));
                return Err(SynthError::BadParameter {
                    name,
                    value: value.to_string(),
                    allowed: allowed.trim_end().to_owned(),
                });
            }
        }
        let traced = params.model.tissue().is_some();
        let faces = if traced { params.faces } else { [true; 2] };
        let (held, correlated) = (params.held, params.correlated);
        Ok(Inverter { forward, held, correlated, faces, wavelengths_nm: wavelengths_nm.to_vec(), covered })
    }

    /// Returns what is looked for, in the order of an [`Inversion`]'s values.
    pub fn unknowns(&self) -> &[Unknown] {
        self.forward.unknowns()
    }

    /// Returns the model's shares of light for `values`, in the order of [`LeafSpectra::shares`], at every wavelength of
    /// the spectra; NaN outside of the model, and for a face that it is not ready for.
    pub fn spectra_of(&self, values: &[f64; MAX_UNKNOWNS]) -> [Vec<f64>; SHARES] {
        let mut shares: [Vec<f64>; SHARES] = std::array::from_fn(|_| vec![f64::NAN; self.wavelengths_nm.len()]);
        for (band, at) in self.covered.iter().enumerate() {
            for (place, face) in FACES.into_iter().enumerate().filter(|(place, _)| self.faces[*place]) {
                let here = self.forward.at(band, face, values).shares;
                shares[2 * place..].iter_mut().zip(here).for_each(|(shares, here)| shares[*at] = here);
            }
        }
        shares
    }

    /// Finds the contents of a leaf.
    ///
    /// Cost: about 10 passes over 64 wavelengths and 8 over all of them, of some 0.2 us a wavelength.
    ///
    /// # Panics
    /// If `leaf` has other wavelengths or faces than the inverter was made for.
    pub fn invert(&self, leaf: &LeafSpectra) -> Inversion {
        assert_eq!(leaf.wavelengths_nm, self.wavelengths_nm, "spectra at the wavelengths of the inverter");
        let faces = leaf.faces();
        assert!((0..2).all(|face| self.faces[face] || !faces[face]), "spectra of the faces of the inverter");
        let bands: Vec<usize> = (0..self.covered.len())
            .filter(|band| leaf.shares.iter().any(|shares| shares[self.covered[*band]].is_finite()))
            .collect();
        let all = Search { inverter: self, leaf, faces, bands, usual: true };
        let coarse = all.every(all.bands.len().div_ceil(COARSE_BANDS).max(1));
        let (start, free, untold) = self.start(&coarse);
        let mut search = coarse.minimum(&free, start, &Whitening::even(FIRST_ERROR));
        let mut steps = search.steps;
        let measured = all.bands.len() * (0..SHARES).filter(|side| leaf.has(*side)).count();
        let mut whitening =
            Whitening::even(coarse.errors(&search.values).deviation(free.iter().filter(|x| **x).count(), FIRST_ERROR));
        let looks = if self.correlated && measured > MIN_FREEDOM + self.unknowns().len() { LOOKS } else { 0 };
        for _ in 0..looks.max(1) {
            if looks > 0 {
                whitening = all.errors(&search.values).learn(MAX_LENGTH_NM);
            }
            search = all.minimum(&free, search.values, &whitening);
            steps += search.steps;
        }
        let mut found = self.told(&search, &free, &untold);
        let mut errors = all.errors(&found.values);
        let errs = errors.deviation(0, 0.0) > MIN_MODEL_ERROR;
        if errs && (-NEIGHBOUR_NM / whitening.length_nm.max(1e-9)).exp() > MODEL_ERRS {
            for domain in self.forward.domains() {
                steps += self.refine(&all, domain, &mut found);
            }
            errors = all.errors(&found.values);
        }
        found.rmse = errors.rmse();
        let nm = |band: Option<&usize>| band.map_or(f64::NAN, |band| self.wavelengths_nm[self.covered[*band]]);
        let span_nm = [nm(all.bands.first()), nm(all.bands.last())];
        let needs_faces = if faces == [true; 2] { MAX_UNKNOWNS } else { self.forward.first_of_both_faces() };
        found.remarks = remarks(self.unknowns(), &found, needs_faces, span_nm);
        found.steps = steps;
        found
    }

    /// Finds what `domain` tells anew, from its wavelengths alone. Returns the number of steps.
    fn refine(&self, all: &Search, domain: &Domain, found: &mut Inversion) -> usize {
        let [first, last] = domain.nm;
        let nm = |band: &usize| self.wavelengths_nm[self.covered[*band]];
        let bands: Vec<usize> = all.bands.iter().copied().filter(|band| (first..=last).contains(&nm(band))).collect();
        let reaches = bands.first().is_some_and(|band| nm(band) <= first + DOMAIN_END_NM)
            && bands.last().is_some_and(|band| nm(band) >= last - DOMAIN_END_NM);
        if bands.len() < MIN_DOMAIN_BANDS || !reaches {
            return 0;
        }
        let mut free = [false; MAX_UNKNOWNS];
        // One share of light alone does not tell what goes with a content from the content itself.
        let both = all.faces == [true; 2] || [0, 2].iter().any(|face| all.leaf.has(*face) && all.leaf.has(face + 1));
        for i in domain.tells.iter().chain(domain.with.iter().filter(|_| both)).copied() {
            free[i] = matches!(found.states[i], State::Found | State::AtBound);
        }
        if !domain.tells.iter().any(|i| free[*i]) {
            return 0;
        }
        let search = Search { bands, usual: false, ..*all };
        let at = search.minimum(&free, found.values, &Whitening::even(1.0));
        // What the result is worth, by errors that hang together.
        let whitening = search.errors(&at.values).learn(MAX_LENGTH_NM);
        let worth = Minimum { normal: search.normal(&at.values, &free, &whitening), ..at };
        let refined = self.told(&worth, &free, &[false; MAX_UNKNOWNS]);
        for i in domain.tells.iter().copied().filter(|i| free[*i]) {
            found.values[i] = refined.values[i];
            found.standard_errors[i] = refined.standard_errors[i];
            found.states[i] = if refined.states[i] == State::Found { State::FoundByDomain } else { refined.states[i] };
            for j in 0..MAX_UNKNOWNS {
                let together = if domain.tells.contains(&j) && free[j] { refined.correlations[i][j] } else { 0.0 };
                (found.correlations[i][j], found.correlations[j][i]) = (together, together);
            }
        }
        at.steps
    }

    /// Returns the values to start from, which are free, and which the spectra do not tell.
    fn start(&self, search: &Search) -> (Values, [bool; MAX_UNKNOWNS], [bool; MAX_UNKNOWNS]) {
        let (mut start, mut free, mut untold) = ([0.0; MAX_UNKNOWNS], [false; MAX_UNKNOWNS], [false; MAX_UNKNOWNS]);
        for (i, unknown) in self.unknowns().iter().enumerate() {
            start[i] = self.held[i].unwrap_or(unknown.start);
            free[i] = self.held[i].is_none();
        }
        let normal = search.normal(&start, &[false; MAX_UNKNOWNS], &Whitening::even(1.0));
        for (i, unknown) in self.unknowns().iter().enumerate() {
            let [least, most] = unknown.range;
            let change =
                (normal.products[(i, i)] / normal.count.max(1) as f64).sqrt() / unknown.span() * (most - least);
            let needs_faces = i >= self.forward.first_of_both_faces() && search.faces != [true; 2];
            if free[i] && (change < TELLS || needs_faces) {
                (free[i], untold[i]) = (false, true);
            }
        }
        (start, free, untold)
    }

    /// Returns the result with its standard errors, without remarks.
    fn told(&self, found: &Minimum, free: &[bool; MAX_UNKNOWNS], untold: &[bool; MAX_UNKNOWNS]) -> Inversion {
        let unknowns = self.unknowns();
        let moves = movable(unknowns, free, found);
        let moving = moves.iter().filter(|moves| **moves).count();
        // Errors are in units of their own standard deviation; where that was learnt too small, it shows here.
        let freedom = found.normal.count.saturating_sub(moving).max(1) as f64;
        let variance = (found.normal.squares / freedom).max(1.0);
        let covariance = found.covariance(&moves);
        let mut inversion = Inversion {
            values: found.values,
            standard_errors: [f64::NAN; MAX_UNKNOWNS],
            correlations: [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS],
            states: [State::Held; MAX_UNKNOWNS],
            rmse: [None; SHARES],
            steps: found.steps,
            remarks: Vec::new(),
        };
        for (i, unknown) in unknowns.iter().enumerate() {
            inversion.states[i] = match (untold[i], free[i], moves[i]) {
                (true, ..) => State::Untold,
                (_, false, _) => State::Held,
                (_, _, false) => State::AtBound,
                (_, _, true) => State::Found,
            };
            if moves[i] {
                inversion.standard_errors[i] = (variance * covariance[(i, i)]).sqrt() * unknown.span();
                for j in (0..unknowns.len()).filter(|j| moves[*j]) {
                    let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
                    inversion.correlations[i][j] = covariance[(i, j)] / scale;
                }
            }
        }
        inversion
    }
}

/// Search over some wavelengths of a leaf.
struct Search<'a> {
    inverter: &'a Inverter,
    leaf: &'a LeafSpectra,
    /// Faces that were measured.
    faces: [bool; 2],
    /// Indices among the wavelengths that the model covers.
    bands: Vec<usize>,
    /// Whether it is known that leaves are near usual ones.
    usual: bool,
}

impl<'a> Search<'a> {
    /// Returns the search over every `stride`-th wavelength.
    fn every(&self, stride: usize) -> Search<'a> {
        Search { bands: self.bands.iter().copied().step_by(stride).collect(), ..*self }
    }

    /// Returns the values of least squares from `start` on.
    fn minimum(&self, free: &[bool; MAX_UNKNOWNS], start: Values, whitening: &Whitening) -> Minimum {
        minimum(self.inverter.unknowns(), free, start, |values| self.normal(values, free, whitening))
    }

    /// Returns the faces that were measured, with their places.
    fn faces(&self) -> impl Iterator<Item = (usize, Face)> {
        let measured = self.faces;
        FACES.into_iter().enumerate().filter(move |(place, _)| measured[*place])
    }

    /// Returns the sums of least squares, in units of errors. What is `free` may be known to be near usual leaves.
    fn normal(&self, values: &Values, free: &[bool; MAX_UNKNOWNS], whitening: &Whitening) -> Normal {
        let unknowns = self.inverter.unknowns();
        let mut spans = [0.0; MAX_UNKNOWNS];
        spans.iter_mut().zip(unknowns).for_each(|(span, unknown)| *span = unknown.span());
        let mut normal = Normal::new(unknowns.len());
        let mut whitener = Whitener::new(whitening);
        for band in &self.bands {
            let at = self.inverter.covered[*band];
            let mut rows: Rows = [None; SHARES];
            for (place, face) in self.faces() {
                let here = self.inverter.forward.at(*band, face, values);
                for side in 0..2 {
                    let measured = self.leaf.shares[2 * place + side][at];
                    if measured.is_finite() {
                        let mut row = Row { error: here.shares[side] - measured, by: here.by[side] };
                        row.by.iter_mut().zip(&spans).for_each(|(by, span)| *by *= span);
                        rows[2 * place + side] = Some(row);
                    }
                }
            }
            whitener.whiten(self.inverter.wavelengths_nm[at], &mut rows);
            rows.iter().flatten().for_each(|row| normal.add(row.error, &row.by));
        }
        let measured = normal.count;
        for (i, unknown) in unknowns.iter().enumerate().filter(|(i, _)| self.usual && free[*i]) {
            let mut by = [0.0; MAX_UNKNOWNS];
            by[i] = spans[i] / unknown.spread;
            normal.add((values[i] - unknown.start) / unknown.spread, &by);
        }
        normal.count = measured;
        normal.mirrored()
    }

    /// Returns the errors along the wavelengths.
    fn errors(&self, values: &Values) -> Errors {
        let row = |band: &usize| {
            let at = self.inverter.covered[*band];
            let mut errors = [None; SHARES];
            for (place, face) in self.faces() {
                let here = self.inverter.forward.at(*band, face, values);
                for side in 0..2 {
                    let measured = self.leaf.shares[2 * place + side][at];
                    errors[2 * place + side] = measured.is_finite().then(|| here.shares[side] - measured);
                }
            }
            (self.inverter.wavelengths_nm[at], errors)
        };
        Errors { rows: self.bands.iter().map(row).collect() }
    }
}

#[cfg(test)]
mod tests;
