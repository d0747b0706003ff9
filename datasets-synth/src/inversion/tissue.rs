//! The algorithmic models as an inversion sees them: traced once without absorption, then functions of the optical depth.

use rayon::prelude::*;

use crate::error::SynthError;
use crate::instruments::spectrophotometer::Spectrophotometer;
use crate::inversion::forward::{FACES, Forward, MAX_UNKNOWNS, Sensitivity, Unknown, Values, place_of};
use crate::inversion::plates::plate_unknowns;
use crate::leaf::model::LeafModel;
use crate::optics::abm::abm_b::AbmB;
use crate::optics::abm::abm_u::AbmU;
use crate::optics::abm::path_lengths::{Face, PathLengths, TracedBeam, trace_path_lengths};
use crate::optics::abm::tissue::DepthParts;
use crate::optics::units::{MicrogramsPerSquareCentimetre, Nanometres};

/// Distance in nanometres of the wavelengths that are traced where indices change with the wavelength; shares of light
/// are linear in between.
const TRACE_STEP_NM: f64 = 50.0;
/// Optical depths that shares of light are tabulated at, denser where little is absorbed.
const NODES: usize = 160;
/// Largest optical depth of the table: chlorophyll of 200 ug/cm2 in the red, through the thinnest model.
const MAX_DEPTH: f64 = 40.0;
/// Depth at which the nodes turn from evenly spaced to evenly spaced in the logarithm.
const TURN_DEPTH: f64 = 0.05;

/// Returns the unknowns of an algorithmic model: two of a plate's, and what else a leaf holds, which is known in its shares only.
pub(crate) fn tissue_unknowns() -> [Unknown; 3] {
    let [chlorophyll, carotenoids, ..] = plate_unknowns();
    let rest = Unknown {
        key: "rest",
        option: "rest",
        name: "everything else that absorbs, over that of the model's leaf",
        unit: "",
        bounds: [0.0, 10.0],
        range: [0.0, 3.0],
        start: 1.0,
        spread: 1.0,
    };
    [chlorophyll, carotenoids, rest]
}

/// Algorithmic model at fixed wavelengths.
pub(crate) struct TissueForward {
    unknowns: [Unknown; 3],
    bands: Vec<Band>,
    /// Traces onto the adaxial and the abaxial face; empty for a face that is not asked for.
    traces: [Vec<[Shares; 2]>; 2],
}

/// Wavelength of a [`TissueForward`].
struct Band {
    /// Optical depths per unit of each unknown.
    depths: [f64; 3],
    /// Index of the trace below the wavelength, and how far towards the next one it lies, 0 to 1.
    trace: usize,
    towards: f64,
}

impl TissueForward {
    /// Traces `model` with `rays` rays at 8 degrees onto those of `faces`, adaxial and abaxial, that are asked for, in
    /// parallel on the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for a plate model, which has nothing to trace.
    pub(crate) fn new(
        model: &LeafModel,
        faces: [bool; 2],
        wavelengths_nm: &[f64],
        rays: u64,
        seed: u64,
    ) -> Result<TissueForward, SynthError> {
        let unit = with_unit_pigments(model);
        let tissue = unit.tissue().ok_or_else(|| SynthError::BadParameter {
            name: "--model",
            value: model.name().to_owned(),
            allowed: "plate-n, plate-two-sided, abm97, abm-b or abm-u: the contents of others cannot be told"
                .to_owned(),
        })?;
        let (first, last) =
            wavelengths_nm.iter().fold((f64::MAX, f64::MIN), |(low, high), nm| (low.min(*nm), high.max(*nm)));
        let constant = tissue.has_constant_indices();
        let count = if constant { 1 } else { ((last - first) / TRACE_STEP_NM).ceil() as usize + 1 };
        let trace = |face: Face, i: usize| {
            let beam = Spectrophotometer { face, ..Spectrophotometer::parallel() };
            let nm = if constant { 550.0 } else { (first + TRACE_STEP_NM * i as f64).min(last) };
            let traced = trace_path_lengths(&tissue.stack(Nanometres(nm)), &beam, rays, seed);
            let TracedBeam { rays, reflected, transmitted, .. } = traced;
            [Shares::new(&reflected, rays as f64), Shares::new(&transmitted, rays as f64)]
        };
        let onto = |face: Face| (0..count).into_par_iter().map(|i| trace(face, i)).collect::<Vec<_>>();
        let traces = FACES.map(|face| if faces[place_of(face)] { onto(face) } else { Vec::new() });
        let band = |nm: &f64| {
            let DepthParts { chlorophyll, carotenoid, rest } = tissue.depth_parts(Nanometres(*nm));
            let depths = [chlorophyll.0, carotenoid.0, rest.0];
            if constant {
                return Band { depths, trace: 0, towards: 0.0 };
            }
            let trace = (((nm - first) / TRACE_STEP_NM) as usize).min(count.saturating_sub(2));
            let from = first + TRACE_STEP_NM * trace as f64;
            let step = ((from + TRACE_STEP_NM).min(last) - from).max(1e-9);
            Band { depths, trace, towards: ((nm - from) / step).clamp(0.0, 1.0) }
        };
        Ok(TissueForward { unknowns: tissue_unknowns(), bands: wavelengths_nm.iter().map(band).collect(), traces })
    }
}

/// Returns the model with 1 ug/cm2 of each pigment, so that its optical depths are those of a unit.
fn with_unit_pigments(model: &LeafModel) -> LeafModel {
    const UNIT: MicrogramsPerSquareCentimetre = MicrogramsPerSquareCentimetre(1.0);
    let mut model = *model;
    match &mut model {
        LeafModel::Plate(_) | LeafModel::TwoSided(_) => {}
        LeafModel::Abm97(leaf) => (leaf.chlorophyll, leaf.carotenoid) = (UNIT, UNIT),
        LeafModel::AbmB(AbmB { specimen, .. }) | LeafModel::AbmU(AbmU { specimen, .. }) => {
            specimen.composition.chlorophyll = specimen.concentration(UNIT);
            specimen.composition.carotenoid = specimen.concentration(UNIT);
        }
    }
    model
}

impl Forward for TissueForward {
    fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    fn at(&self, band: usize, face: Face, values: &Values) -> Sensitivity {
        let traces = &self.traces[place_of(face)];
        let Band { depths, trace, towards } = &self.bands[band];
        let depth: f64 = depths.iter().zip(values).map(|(depth, value)| depth * value).sum();
        let mut shares = [0.0; 2];
        let mut by = [[0.0; MAX_UNKNOWNS]; 2];
        for side in 0..2 {
            let near = traces[*trace][side].at(depth);
            let far = if *towards > 0.0 { traces[trace + 1][side].at(depth) } else { near };
            let [share, slope] = [0, 1].map(|i| near[i] + towards * (far[i] - near[i]));
            shares[side] = share;
            for (by, depth) in by[side].iter_mut().zip(depths) {
                *by = slope * depth;
            }
        }
        Sensitivity { shares, by }
    }
}

/// Returns the number of nodes for each unit of `ln(1 + depth / TURN_DEPTH)`.
fn nodes_per_unit() -> f64 {
    (NODES - 1) as f64 / (MAX_DEPTH / TURN_DEPTH).ln_1p()
}

/// Returns the optical depth of a node.
fn depth_at(node: f64) -> f64 {
    TURN_DEPTH * (node / nodes_per_unit()).exp_m1()
}

/// Share of light that leaves on one side, as a function of the optical depth.
struct Shares {
    /// Share and its derivative at each node.
    nodes: Vec<[f64; 2]>,
}

impl Shares {
    fn new(lengths: &PathLengths, rays: f64) -> Shares {
        let node = |i: usize| {
            let depth = depth_at(i as f64);
            lengths.ways().fold([0.0; 2], |[share, slope], (way, weight)| {
                let left = weight / rays * (-depth * way).exp();
                [share + left, slope - way * left]
            })
        };
        Shares { nodes: (0..NODES).map(node).collect() }
    }

    /// Returns the share and its derivative at an optical depth: a cubic between the nodes. Beyond the table, those of
    /// its end, without slope.
    fn at(&self, depth: f64) -> [f64; 2] {
        let place = (depth.max(0.0) / TURN_DEPTH).ln_1p() * nodes_per_unit();
        if place >= (NODES - 1) as f64 {
            return [self.nodes[NODES - 1][0], 0.0];
        }
        let node = place as usize;
        let (low, high) = (depth_at(node as f64), depth_at((node + 1) as f64));
        let (step, u) = (high - low, ((depth - low) / (high - low)).clamp(0.0, 1.0));
        let ([y0, s0], [y1, s1]) = (self.nodes[node], self.nodes[node + 1]);
        let (s0, s1, rise) = (step * s0, step * s1, y1 - y0);
        // Hermite's cubic by its powers of u.
        let (c2, c3) = (3.0 * rise - 2.0 * s0 - s1, s0 + s1 - 2.0 * rise);
        [y0 + u * (s0 + u * (c2 + u * c3)), (s0 + u * (2.0 * c2 + 3.0 * u * c3)) / step]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruments::spectrophotometer::{Method, Rays};
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::plates::model::PlateModel;
    use std::ops::ControlFlow;

    const NM: [f64; 4] = [450.0, 550.0, 680.0, 760.0];

    fn values_of(three: [f64; 3]) -> Values {
        let mut values = [0.0; MAX_UNKNOWNS];
        values[..3].copy_from_slice(&three);
        values
    }

    #[test]
    fn shares_are_those_that_the_instrument_measures() {
        for model in
            [LeafModel::Abm97(Abm97::default()), LeafModel::AbmB(AbmB::default()), LeafModel::AbmU(AbmU::default())]
        {
            let tissue = model.tissue().unwrap();
            let forward = TissueForward::new(&model, [false, true], &NM, 100_000, 1).unwrap();
            let own = |i: usize| {
                let [depth, unit] = [tissue, with_unit_pigments(&model).tissue().unwrap()].map(|t| {
                    let parts = t.depth_parts(Nanometres(550.0));
                    [parts.chlorophyll.0, parts.carotenoid.0][i]
                });
                depth / unit
            };
            let values = values_of([own(0), own(1), 1.0]);
            let instrument = Spectrophotometer { face: Face::Abaxial, ..Spectrophotometer::parallel() };
            let go_on = |_: usize, _: usize| ControlFlow::Continue(());
            let measured =
                instrument.measure(tissue, &NM, Rays::Count(100_000), Method::PathLengths, 7, &go_on).unwrap();
            for (band, nm) in NM.iter().enumerate() {
                let [r, t] = forward.at(band, Face::Abaxial, &values).shares;
                let (by_r, by_t) = (measured.reflectance[band].mean, measured.transmittance[band].mean);
                assert!(
                    (r - by_r).abs() < 0.008 && (t - by_t).abs() < 0.008,
                    "{} {nm}: {r} {by_r}, {t} {by_t}",
                    model.name()
                );
                // Planted difference: half the chlorophyll.
                let mut pale = values;
                pale[0] *= 0.5;
                let [_, other] = forward.at(band, Face::Abaxial, &pale).shares;
                assert!(*nm != 550.0 || (other - by_t).abs() > 0.02, "{other}");
            }
        }
        assert!(TissueForward::new(&LeafModel::Plate(PlateModel::Exact), [true, false], &NM, 10, 1).is_err());
    }

    #[test]
    fn derivatives_are_differences_and_a_depth_beyond_the_table_is_its_end() {
        let forward = TissueForward::new(&LeafModel::AbmB(AbmB::default()), [true, false], &NM, 20_000, 1).unwrap();
        for values in [[30.0, 6.0, 1.0], [0.5, 0.1, 0.0]].map(values_of) {
            for band in 0..NM.len() {
                for i in 0..3 {
                    let moved = |by: f64| {
                        let mut values = values;
                        values[i] += by;
                        forward.at(band, Face::Adaxial, &values).shares
                    };
                    let (low, high) = (moved(0.0), moved(1e-5));
                    for side in 0..2 {
                        let expected = (high[side] - low[side]) / 1e-5;
                        let by = forward.at(band, Face::Adaxial, &values).by[side][i];
                        assert!((by - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{band} {i}: {by} {expected}");
                    }
                }
            }
        }
        let far = forward.at(2, Face::Adaxial, &values_of([1e6, 0.0, 0.0]));
        assert!(far.by.iter().flatten().all(|by| *by == 0.0) && far.shares[1] < 1e-3, "{far:?}");
    }
}
