//! Speed against accuracy against bytes, measured on one capture over a grid of settings.
//!
//! Everything up to the choice of a step is done once per number of lobes and role of theirs ([`PreparedFit`], which
//! `fit` searches in); each step and each limit of components is then encoded, packed, read back, measured and timed.

use crate::error::FitError;
use crate::input::tone_curve::ToneCurve;
use crate::inspect::load::resident_in_parallel;
use crate::measure::compare::{CaptureImages, MeasureParams, measure_decoder};
use crate::monitor::Monitor;
use crate::params::Role;
use crate::trade::gpu_clock::GpuClock;
use crate::trade::grid::{BETWEEN_PAIRS, Between, Grid, Images, decoder, options, singles_in_parallel, strided_pairs};
use crate::trade::params::TradeParams;
use crate::trade::pareto::{CostAndGain, pareto_front, spread};
use crate::trade::point::{Precision, Rule, TradePoint};
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::Asset;
use serde::Serialize;
use std::sync::Arc;

/// Points of each front that are measured over all pairs at most.
const MAX_SUMMARY: usize = 8;

/// Result of [`trade`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trade {
    /// Name of the capture.
    pub capture: String,
    /// Texels per row, rows.
    pub size: [usize; 2],
    /// Number of direction pairs of the capture.
    pub capture_pairs: usize,
    /// Number of pairs that each point was measured on.
    pub pairs: usize,
    /// Seed of the fits and of the random evaluations.
    pub seed: u64,
    /// Clusters asked for.
    pub clusters: usize,
    /// Evaluations per timed pass, and passes.
    pub timing: [usize; 2],
    /// Pairs that `psnr_between_db` was measured on, in words.
    pub between: String,
    /// Adapter of `gpu_ns`, or the reason why there are no such times, in words.
    pub gpu: String,
    /// Whether `gpu_ns` are times of a software driver, which computes on the CPU.
    pub gpu_is_software: bool,
    /// All points, in the order of the grid.
    pub points: Vec<TradePoint>,
    /// Indices of the points of the summary, by bytes, then time.
    pub summary: Vec<usize>,
}

/// Measures the trade of `capture`. `reference` is a capture of the same texels in other directions, on which
/// interpolation is measured; without one, interpolation is measured on a thinned grid.
///
/// Figures but times are the same for the same arguments. Cost: a fit per number of lobes and role, and per step and
/// limit an encoding, an expansion of bases in four forms, and six timings. Memory: as a fit, and all files of the
/// grid.
///
/// # Errors
/// As a fit and a measurement; parameters out of range; a reference of other texels; an adapter that is not there.
pub fn trade(
    capture: &Capture,
    reference: Option<&Capture>,
    params: &TradeParams,
    monitor: &Monitor,
) -> Result<Trade, FitError> {
    params.check()?;
    let info = capture.info();
    let gpu = GpuClock::open(&params.gpu)?;
    let strided = strided_pairs(info, params.pairs);
    let held = Images::read(capture, &strided, monitor)?;
    let tone_curve = ToneCurve::of_capture(info, &|view, light| Ok(capture.read(view, light)?))?;
    let between = match reference {
        Some(reference) => {
            check_reference(info, reference.info())?;
            let all: Vec<usize> = reference.info().present_pairs().collect();
            let pairs = spread(&all, BETWEEN_PAIRS);
            Some(Between { images: Images::read(reference, &pairs, monitor)?, pairs, info: reference.info() })
        }
        None => None,
    };
    let mut grid = Grid {
        capture,
        params,
        gpu: gpu.as_ref().ok(),
        held,
        strided,
        reference: between,
        thinned: None,
        tone_curve,
        points: Vec::new(),
        files: Vec::new(),
        monitor,
    };
    let sweeps: Vec<(usize, Role)> = sweeps(&params.lobes, &params.roles);
    for (number, (lobes, role)) in sweeps.iter().enumerate() {
        grid.sweep(*lobes, *role, [number, sweeps.len()])?;
    }
    let Grid { strided, mut points, files, reference, thinned, .. } = grid;
    mark_fronts(&mut points);
    let summary = summary(&points);
    monitor
        .stage("measure", || measure_summary(capture, tone_curve, &files, &mut points, &summary, params, monitor))?;
    Ok(Trade {
        capture: info.name.clone(),
        size: [info.width, info.height],
        capture_pairs: info.pair_count(),
        pairs: strided.len(),
        seed: params.fit.seed,
        clusters: params.fit.clusters,
        timing: [params.evaluations, params.repeats],
        between: match (&reference, &thinned) {
            (Some(reference), _) => format!("{} pairs of the capture {}", reference.pairs.len(), reference.info.name),
            (None, Some(between)) => format!(
                "{} pairs of this capture whose directions were taken out of the grid, with about a fifth of all directions inside it: the gaps are wider than the asset's own, so this is a pessimistic figure; --reference gives the real one",
                between.pairs.len()
            ),
            (None, None) => "not measured: the capture has too few directions to spare one; give --reference a capture in other directions".into(),
        },
        gpu: match &gpu {
            Ok(clock) => clock.words(),
            Err(reason) => reason.clone(),
        },
        gpu_is_software: gpu.as_ref().is_ok_and(GpuClock::is_software),
        points,
        summary,
    })
}

/// Returns the number of lobes and the role of each fit that the grid needs: without lobes one fit.
fn sweeps(lobes: &[usize], roles: &[Role]) -> Vec<(usize, Role)> {
    let mut found = Vec::new();
    for &lobes in lobes {
        for &role in if lobes == 0 { &[Role::Guide] } else { roles } {
            if !found.contains(&(lobes, role)) {
                found.push((lobes, role));
            }
        }
    }
    found
}

fn check_reference(info: &CaptureInfo, other: &CaptureInfo) -> Result<(), FitError> {
    if (info.width, info.height, info.side) == (other.width, other.height, other.side) {
        return Ok(());
    }
    Err(FitError::Params(format!(
        "--reference {} shows {} x {} texels of the side `{}` and the capture {} x {} of `{}`; give a capture of the same sample in other directions",
        other.name, other.width, other.height, other.side, info.width, info.height, info.side
    )))
}

/// Marks the points on the three fronts.
fn mark_fronts(points: &mut [TradePoint]) {
    let front = |points: &[TradePoint], cost: &dyn Fn(&TradePoint) -> f64, gain: &dyn Fn(&TradePoint) -> f64| {
        pareto_front(&points.iter().map(|p| CostAndGain { cost: cost(p), gain: gain(p) }).collect::<Vec<_>>())
    };
    let of_file = |p: &TradePoint| {
        let first = p.interpolation == Rule::Fast && p.precision == Precision::Half;
        if first { p.bytes as f64 } else { f64::NAN }
    };
    let by_bytes = front(points, &of_file, &|p| p.metrics.psnr_db);
    let by_time = front(points, &|p| p.cpu_ns, &|p| p.metrics.psnr_db);
    let between = front(points, &|p| p.cpu_ns, &|p| p.psnr_between_db.unwrap_or(f64::NAN));
    for (i, point) in points.iter_mut().enumerate() {
        (point.front_bytes_psnr, point.front_ns_psnr, point.front_ns_between) = (by_bytes[i], by_time[i], between[i]);
    }
}

/// Returns the points of the fronts, thinned, by bytes and then by time.
fn summary(points: &[TradePoint]) -> Vec<usize> {
    let mut chosen = Vec::new();
    let fronts: [&dyn Fn(&TradePoint) -> bool; 3] =
        [&|p| p.front_bytes_psnr, &|p| p.front_ns_psnr, &|p| p.front_ns_between];
    for on in fronts {
        let mut front: Vec<usize> = (0..points.len()).filter(|i| on(&points[*i])).collect();
        front.sort_by(|a, b| points[*a].metrics.psnr_db.total_cmp(&points[*b].metrics.psnr_db));
        chosen.extend(spread(&front, MAX_SUMMARY));
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen.sort_by(|a, b| {
        let (a, b) = (&points[*a], &points[*b]);
        a.bytes.cmp(&b.bytes).then(a.cpu_ns.total_cmp(&b.cpu_ns))
    });
    chosen
}

/// Measures the points of the summary over all pairs; of points that decode alike only one is measured.
fn measure_summary(
    capture: &Capture,
    tone_curve: Option<ToneCurve>,
    files: &[Arc<Vec<u8>>],
    points: &mut [TradePoint],
    summary: &[usize],
    params: &TradeParams,
    monitor: &Monitor,
) -> Result<(), FitError> {
    for (number, &i) in summary.iter().enumerate() {
        let alike = |other: usize| {
            let (a, b) = (&points[other], &points[i]);
            Arc::ptr_eq(&files[other], &files[i]) && (a.components, a.precision) == (b.components, b.precision)
        };
        let known = summary[..number].iter().find(|other| alike(**other)).and_then(|other| points[*other].all_pairs);
        let metrics = match known {
            Some(metrics) => metrics,
            None => {
                let asset = Asset::parse(&files[i])?;
                let (resident, precision) = (resident_in_parallel(&asset), points[i].precision);
                let singles = singles_in_parallel(&asset);
                let options = options(points[i].components, Rule::Exact);
                let decoder = decoder(&asset, &resident, &singles, &options, precision);
                let measuring = MeasureParams { memory_bytes: params.fit.memory_bytes, ..MeasureParams::default() };
                let read = |view, light| Ok(capture.read(view, light)?);
                let images = CaptureImages { info: capture.info(), read: &read, tone_curve };
                measure_decoder(&images, &asset, &decoder, &measuring, None, monitor)?.metrics()
            }
        };
        points[i].all_pairs = Some(metrics);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Metrics;
    use crate::trade::point::Limit;

    fn point(bytes: usize, psnr_db: f64, cpu_ns: f64, interpolation: Rule, precision: Precision) -> TradePoint {
        let metrics = Metrics {
            psnr_db,
            psnr_linear_db: 0.0,
            rel_rmse: 0.0,
            worst_texel_rmse: 0.0,
            energy_ratio: 1.0,
            delta_e00_mean: None,
            tone_curve: None,
        };
        TradePoint {
            lobes: 0,
            role: Role::Guide,
            lobes_per_texel_mean: 0.0,
            lobes_per_cluster_mean: 0.0,
            bits: Some(5.0),
            bits_per_coefficient: None,
            limit: Limit::None,
            components: 1,
            interpolation,
            precision,
            bytes,
            file_bytes: bytes,
            resident_bytes: 1,
            metrics,
            psnr_between_db: (interpolation == Rule::Exact).then_some(20.0),
            cpu_ns,
            gpu_ns: None,
            front_bytes_psnr: false,
            front_ns_psnr: false,
            front_ns_between: false,
            all_pairs: None,
        }
    }

    #[test]
    fn each_front_has_its_own_measures_and_a_planted_dominated_point_is_on_none() {
        let mut points = vec![
            point(100, 30.0, 50.0, Rule::Fast, Precision::Half),
            // The same file: on no front of sizes; the only kind with a figure between directions.
            point(100, 30.0, 200.0, Rule::Exact, Precision::Half),
            point(100, 30.001, 60.0, Rule::Fast, Precision::Single),
            point(200, 33.0, 40.0, Rule::Fast, Precision::Half),
            point(201, 32.9, 41.0, Rule::Fast, Precision::Half),
        ];
        mark_fronts(&mut points);
        let marks: Vec<[bool; 3]> =
            points.iter().map(|p| [p.front_bytes_psnr, p.front_ns_psnr, p.front_ns_between]).collect();
        assert_eq!(marks, [[true, false, false], [false, false, true], [false; 3], [true, true, false], [false; 3]]);
        assert_eq!(summary(&points), [0, 1, 3]);
    }

    #[test]
    fn every_number_of_lobes_is_fitted_in_every_role_and_none_once() {
        use Role::{Base, Guide};
        assert_eq!(sweeps(&[0, 2, 0], &[Guide, Base]), [(0, Guide), (2, Guide), (2, Base)]);
        assert_eq!(sweeps(&[0, 2], &[Base]), [(0, Guide), (2, Base)]);
    }
}
