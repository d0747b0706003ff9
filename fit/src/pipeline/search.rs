//! The step of a fit: the finest that a size allows, or the coarsest that reaches an error.

use crate::error::FitError;
use crate::input::pair_stride::pairs_at_stride;
use crate::input::tile_cache::read_images;
use crate::inspect::load::resident_in_parallel;
use crate::measure::compare::{Comparison, MeasureParams, colour_pair_stride, measure_images};
use crate::monitor::Monitor;
use crate::params::ValidFitParams;
use crate::pipeline::assemble::{Assembled, assemble};
use crate::pipeline::description::description_bytes;
use crate::pipeline::prepare::PreparedFit;
use crate::spectral::measure::{BandedCaptures, measure_bands};
use crate::stages::budget::{Candidate, SEARCH_ROUNDS, error_for_psnr, within_bytes};
use crate::stages::encode::Coding;
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::{Asset, MAX_COMPONENTS, packed_len};

/// Rounds of encoding and measurement that a PSNR goal gets.
const PSNR_ROUNDS: usize = 8;
/// How far above a PSNR goal the figure over a share of the pairs must lie, so that the figure over all pairs reaches
/// it, in dB.
const PSNR_MARGIN_DB: f64 = 0.03;
/// Evaluations of the predicted error that choose the first step for a PSNR goal.
const PREDICTION_ROUNDS: usize = 8;
/// log2 of the finest and of the coarsest step, relative to the greatest coefficient, that a PSNR is looked for with.
const FINEST_EXPONENT: f64 = -16.0;
const COARSEST_EXPONENT: f64 = 2.0;

/// A prepared fit whose step is searched for.
pub struct StepSearch<'a> {
    /// Captures, one for each layer, in the asset's order.
    pub captures: &'a [Capture],
    /// What a fit of channels is judged by.
    pub banded: Option<&'a BandedCaptures<'a>>,
    /// The layers.
    pub prepared: &'a PreparedFit,
    /// Parameters of the fit.
    pub params: &'a ValidFitParams,
    /// Receiver of progress.
    pub monitor: &'a Monitor,
}

impl StepSearch<'_> {
    /// Returns the asset of least error within `bytes`, everything but the description included. The search begins with
    /// `step`.
    ///
    /// # Errors
    /// [`FitError::Budget`] if even the coarsest step gives more.
    pub fn within_bytes(&self, bytes: usize, step: f64) -> Result<Asset, FitError> {
        let greatest = self.prepared.greatest_coefficient();
        let exponent = (step / greatest.max(1e-12)).log2();
        let mut round = 0;
        let mut search = |most: usize| {
            within_bytes(bytes, greatest, exponent, |step| {
                self.monitor.report("encode", round, 2 * SEARCH_ROUNDS)?;
                round += 1;
                let made = self.assemble_with(step, most, Coding::Predicted);
                Ok::<_, FitError>(Candidate { bytes: packed_len(&made.asset, &made.group_bytes)?, value: made })
            })
        };
        let mut found = search(self.params.components().unwrap_or(MAX_COMPONENTS))?;
        // A component more is a jump in size: what is left in front of it goes to a smaller step.
        if let Ok(best) = &mut found {
            let residuals = best.value.asset.layers.iter().flat_map(|layer| &layer.residual);
            let components = residuals.map(|residual| residual.coefficients.len()).max().unwrap_or(0);
            if best.bytes < bytes - bytes / 50
                && let Ok(other) = search(components)?
                && other.value.error < best.value.error
            {
                *best = other;
            }
        }
        found.map(|best| best.value.asset).map_err(|least| self.too_small(least))
    }

    /// Says that even `least` bytes and the description are more than is allowed, and what to do.
    fn too_small(&self, least: usize) -> FitError {
        let [width, height] = self.prepared.grid;
        let texels = width * height * self.prepared.layers.len();
        let least = least + description_bytes(self.captures, self.params.asked());
        FitError::Budget(format!(
            "--bytes is too small for {texels} texels: the smallest asset has about {least} bytes; raise --bytes or lower --clusters"
        ))
    }

    /// Returns the smallest asset whose measured `psnr_db` over all layers is at least `db`: the first step is `step`, the
    /// others follow from what was measured.
    ///
    /// # Errors
    /// [`FitError::Budget`] if no step reaches it.
    pub fn within_error(&self, db: f64, step: f64) -> Result<Asset, FitError> {
        let greatest = self.prepared.greatest_coefficient();
        let mut exponent = (step / greatest.max(1e-12)).log2().clamp(FINEST_EXPONENT, COARSEST_EXPONENT);
        let mut found: Option<(usize, Asset)> = None;
        // What meets the goal without the margin, if nothing does with it.
        let mut nearest: Option<Asset> = None;
        let mut reached = 0.0f64;
        let mut bracket = Bracket { goal: db + 3.0 * PSNR_MARGIN_DB, ..Bracket::default() };
        for round in 0..PSNR_ROUNDS {
            self.monitor.report("encode", round, PSNR_ROUNDS)?;
            let assembled = self.assemble(greatest * exponent.exp2());
            let bytes = packed_len(&assembled.asset, &assembled.group_bytes)?;
            let asset = assembled.asset;
            let last_resort = exponent <= FINEST_EXPONENT;
            let measured = self.psnr_on_share(&asset)?;
            let enough = measured >= db + PSNR_MARGIN_DB;
            if enough && found.as_ref().is_none_or(|(least, _)| bytes < *least) {
                found = Some((bytes, asset));
            } else if measured >= db && measured > reached {
                nearest = Some(asset);
            }
            reached = reached.max(measured);
            if (measured < db && last_resort) || (enough && measured <= db + 6.0 * PSNR_MARGIN_DB) {
                break;
            }
            // What misses the margin counts as too little: steps beside it would only meet it by chance.
            exponent =
                bracket.next((exponent, measured), db + PSNR_MARGIN_DB).clamp(FINEST_EXPONENT, COARSEST_EXPONENT);
        }
        found.map(|(_, asset)| asset).or(nearest).ok_or_else(|| {
            FitError::Budget(format!(
                "--psnr {db} cannot be reached with these clusters and components (the best was {reached:.2} dB); lower it or raise --clusters"
            ))
        })
    }

    /// Returns the asset of `step` with as many components as the parameters allow.
    pub fn assemble(&self, step: f64) -> Assembled {
        self.assemble_with(step, self.params.most_components(), Coding::Predicted)
    }

    fn assemble_with(&self, step: f64, most_components: usize, coding: Coding) -> Assembled {
        assemble(&self.prepared.layers, step, self.prepared.grid, most_components, coding)
    }

    /// Returns the number of samples of all captures.
    fn samples(&self) -> f64 {
        self.captures.iter().map(|c| (c.info().texel_count() * c.info().pair_count() * 3) as f64).sum()
    }

    /// Measures `psnr_db` of `asset` over all layers on a share of the pairs: of bands where they are what is judged.
    pub fn psnr_on_share(&self, asset: &Asset) -> Result<f64, FitError> {
        let mut errors = (0.0, 0.0);
        let mut add = |info: &CaptureInfo, found: Comparison| {
            let weight = (info.texel_count() * info.pair_count()) as f64;
            errors = (errors.0 + weight * 10f64.powf(-found.metrics().psnr_db / 10.0), errors.1 + weight);
        };
        match self.banded {
            Some(banded) => {
                let asset = Asset { spectrum: Some(banded.spectrum.clone()), ..asset.clone() };
                let resident = resident_in_parallel(&asset);
                for (layer, capture) in banded.captures.iter().enumerate() {
                    let params = MeasureParams { colour_stride: Some(0), ..self.share_of(layer, capture.info()) };
                    let found = measure_bands(capture, &asset, &resident, banded.spectrum, &params, self.monitor)?;
                    add(capture.info(), found);
                }
            }
            None => {
                let resident = resident_in_parallel(asset);
                for (layer, capture) in self.captures.iter().enumerate() {
                    let read = read_images(capture, self.prepared.images.as_ref());
                    let params = self.share_of(layer, capture.info());
                    let found = measure_images(capture.info(), &read, asset, &resident, &params, self.monitor)?;
                    add(capture.info(), found);
                }
            }
        }
        Ok(-10.0 * (errors.0 / errors.1).log10())
    }

    /// Returns what measures a layer on a share of the pairs of its capture.
    fn share_of(&self, layer: usize, info: &CaptureInfo) -> MeasureParams {
        let stride = colour_pair_stride(info.views.len(), info.lights.len());
        MeasureParams {
            layer,
            pairs: Some(pairs_at_stride(info, stride)),
            memory_bytes: self.params.memory_bytes() / 8,
            ..MeasureParams::default()
        }
    }

    /// Returns the coarsest step at which a draft's predicted error is that of the PSNR `db`; the finest step where none
    /// is.
    pub fn draft_within_error(&self, db: f64) -> Result<f64, FitError> {
        let (greatest, target) = (self.prepared.greatest_coefficient(), error_for_psnr(db) * self.samples());
        let mut exponents = [FINEST_EXPONENT, COARSEST_EXPONENT];
        let most = self.params.most_components();
        for _ in 0..PREDICTION_ROUNDS {
            self.monitor.check()?;
            let middle = 0.5 * (exponents[0] + exponents[1]);
            let candidate = self.assemble_with(greatest * middle.exp2(), most, Coding::Draft);
            exponents[usize::from(candidate.error > target)] = middle;
        }
        Ok(greatest * exponents[0].exp2())
    }
}

/// Two quantisation steps whose PSNRs enclose the wanted one, each as log2 of the step and the PSNR in dB.
#[derive(Debug, Default)]
struct Bracket {
    /// The PSNR that the next step is chosen for, in dB: a little above the goal.
    goal: f64,
    above: Option<(f64, f64)>,
    below: Option<(f64, f64)>,
    /// Whether the last step gave too much.
    last_above: Option<bool>,
    /// Factor of the last move that no line led.
    stride: f64,
}

impl Bracket {
    /// Takes in `point` and returns log2 of the next step for the goal `db`: on the line between what was too much and
    /// what was too little; else as if halving the step halved the error. (Near the rounding of 8-bit captures the
    /// error falls much faster.)
    fn next(&mut self, point: (f64, f64), db: f64) -> f64 {
        let measured = point.1;
        if measured > db {
            self.above = Some(point)
        } else {
            self.below = Some(point)
        }
        let next = match (self.above, self.below) {
            (Some(above), Some(below)) if above.1 > below.1 && self.goal > below.1 => {
                let along = ((self.goal - below.1) / (above.1 - below.1)).clamp(0.05, 0.95);
                // Twice on one side: the line misleads.
                let along = if self.last_above == Some(measured > db) { 0.5 } else { along };
                below.0 + along * (above.0 - below.0)
            }
            _ => {
                // Again on that side: the error hardly follows the step, as where texels are equal.
                self.stride = if self.last_above == Some(measured > db) { 2.0 * self.stride } else { 1.0 };
                point.0 + (self.stride * (measured - self.goal) / (20.0 * 2f64.log10())).clamp(-4.0, 4.0)
            }
        };
        self.last_above = Some(measured > db);
        next
    }
}
