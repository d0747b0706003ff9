//! A fit with its error: it fits, measures what was packed, and writes the figures into the asset.

use crate::error::FitError;
use crate::input::rounds::Rounds;
use crate::input::tile_cache::read_images;
use crate::inspect::load::resident_in_parallel;
use crate::inspect::lobe_use::LobeUse;
#[cfg(doc)]
use crate::measure::compare::measure;
use crate::measure::compare::{CaptureImages, Comparison, MeasureParams, measure_decoder};
use crate::measure::image_decoder::ImageDecoder;
use crate::metrics::{ErrorSums, Metrics};
use crate::monitor::Monitor;
use crate::params::{ErrorMeasure, ValidFitParams};
use crate::pipeline::adapter::FitAdapter;
use crate::pipeline::choose_error::with_chosen_error;
use crate::pipeline::fit::fit_from;
use crate::pipeline::outcome::FitOutcome;
use crate::pipeline::prepare::check_layers;
use crate::provenance::{FitRecord, Material};
use crate::resume::checkpoint::Checkpoint;
#[cfg(doc)]
use crate::resume::checkpoint::remove_finished_stages;
use crate::spectral::basis::SpectralBasis;
use crate::spectral::measure::{BandedCaptures, measure_capture};
use crate::stages::lobe_dictionaries::LobeFigures;
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::{Asset, Resident, pack};

/// A finished asset with everything that is known about it.
pub struct Fitted {
    /// The asset, as [`Asset::parse`] reads it back.
    pub asset: Asset,
    /// Bytes of the asset: what is written to a file.
    pub bytes: Vec<u8>,
    /// Resident form of the asset.
    pub resident: Resident,
    /// Error of each layer against its capture.
    pub comparisons: Vec<Comparison>,
    /// Error of all layers together.
    pub metrics: Metrics,
    /// `psnr_db` of the pairs of the first capture that were held back; `None` without `leave_out`.
    pub psnr_left_out_db: Option<f64>,
    /// Number, role and bytes of the lobes of all layers.
    pub lobe_use: LobeUse,
    /// Error of the first layer's lobes alone.
    pub lobes: LobeFigures,
    /// Residual components of the first layer.
    pub components: usize,
    /// Clusters of the first layer.
    pub clusters: usize,
    /// Error that was minimised.
    pub error: ErrorMeasure,
    /// Root mean square error of the bands in the root curve that stays if the channels are exact; `None` for colours.
    pub spectral_rmse: Option<f64>,
}

/// Fits `captures`, one per layer, measures the packed asset against them (stage `measure`) and packs it
/// again with its description and error figures.
///
/// Deterministic: equal captures, parameters and seed give equal bytes on any number of threads, unless an adapter may
/// compute ([`crate::FitParams::gpu`]), also where a run goes
/// on from the stages that `params` tells to keep: [`remove_finished_stages`] once the asset is written.
///
/// # Errors
/// As [`crate::fit()`] and [`measure`]; [`FitError::Budget`] if the description does not fit into the bytes asked for.
pub fn fit_and_measure(captures: &[Capture], params: &ValidFitParams, monitor: &Monitor) -> Result<Fitted, FitError> {
    let basis = if params.fits_colours() { None } else { SpectralBasis::of_captures(captures, monitor)? };
    match &basis {
        None => fit_channels(captures, captures, None, params, monitor),
        Some(basis) => fit_channels(captures, &basis.channels(captures)?, Some(basis), params, monitor),
    }
}

/// Fits `channels`, which are those of `basis` where there is one, and measures against `captures`.
fn fit_channels(
    captures: &[Capture],
    channels: &[Capture],
    basis: Option<&SpectralBasis>,
    params: &ValidFitParams,
    monitor: &Monitor,
) -> Result<Fitted, FitError> {
    let asked = params;
    // The same for a material in bands as in colours.
    let judged = if basis.is_some_and(|basis| basis.has_colours) { captures } else { channels };
    let params = &with_chosen_error(judged, &params.leaving(basis.map_or(0, spectrum_bytes)))?;
    let checkpoint = Checkpoint::open(channels, params, monitor)?;
    check_layers(channels)?;
    let adapter = FitAdapter::new(channels, params, monitor);
    let spectrum = basis.map(SpectralBasis::spectrum);
    let banded = spectrum.as_ref().map(|spectrum| BandedCaptures { captures, spectrum });
    let (outcome, images) = fit_from(channels, banded.as_ref(), params, &checkpoint, &adapter, monitor)?;
    let FitOutcome { mut asset, lobe_use, lobes, components, clusters, left_out, .. } = outcome;
    asset.spectrum = spectrum;
    let resident = resident_in_parallel(&asset);
    let comparisons: Vec<Comparison> = checkpoint.whole().run("measure", || {
        let gpu = adapter.gpu()?;
        let comparisons = captures.iter().enumerate().map(|(layer, capture)| {
            let measuring = MeasureParams { layer, memory_bytes: params.memory_bytes(), ..MeasureParams::default() };
            if basis.is_some() {
                return measure_capture(capture, &asset, &resident, &measuring, monitor);
            }
            let read = read_images(capture, images.as_ref());
            let images = CaptureImages::new(capture.info(), &read)?;
            let decoder = ImageDecoder::new(&asset, &resident, layer, &measuring.options);
            measure_decoder(&images, &asset, &decoder, &measuring, gpu, monitor)
        });
        comparisons.collect()
    })?;
    adapter.tell();
    drop(images);
    let mut sums = ErrorSums::default();
    for comparison in &comparisons {
        sums.add(&comparison.sums);
    }
    let metrics = sums.metrics();
    let infos: Vec<&CaptureInfo> = captures.iter().map(Capture::info).collect();
    let material =
        Material::new(&infos, FitRecord { bytes: asked.bytes(), ..FitRecord::new(params.asked(), components) });
    asset.size_mm = captures.iter().find_map(|capture| capture.info().size_mm);
    asset.material = Material { error: Some(metrics.rounded()), ..material }.to_json();
    let bytes = pack(&asset)?;
    if asked.bytes().is_some_and(|most| bytes.len() as u64 > most) {
        return Err(FitError::Budget(format!(
            "the asset has {} bytes with its description, more than --bytes allows; raise --bytes",
            bytes.len()
        )));
    }
    let rounds = Rounds::of(&channels[0].info().lights);
    let left_out = left_out.into_iter().filter_map(|pair| rounds.in_first(pair));
    let psnr_left_out_db = comparisons.first().and_then(|comparison| comparison.psnr_of_pairs(left_out));
    let error = params.error();
    Ok(Fitted {
        asset,
        bytes,
        resident,
        comparisons,
        metrics,
        psnr_left_out_db,
        lobe_use,
        lobes,
        components,
        clusters,
        error,
        spectral_rmse: basis.map(|basis| basis.root_rmse),
    })
}

/// Returns the bytes that the spectrum of an asset takes at most, with its entry in the table of sections.
fn spectrum_bytes(basis: &SpectralBasis) -> usize {
    let (bands, channels) = (basis.wavelengths_nm.len(), 3 * basis.analysis.len());
    4 * (2 + 3 * channels + bands * (1 + channels)) + 32 + 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::GpuChoice;
    use crate::gpu::speed::open_for_test;
    use crate::measure::compare::measure;
    use crate::measure::expand::{ExpandParams, expand};
    use crate::params::{FitParams, Role};
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::{ResidualKind, SurfaceSide};

    #[test]
    fn a_fitted_asset_holds_its_own_figures_and_those_are_what_measuring_it_gives() {
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = (DirectionSet::random(9, 3).unwrap(), DirectionSet::random(10, 4).unwrap());
        let source = sample_asset_with(12, 9, &views, &lights, ResidualKind::Root);
        let source = Asset::parse(&pack(&source).unwrap()).unwrap();
        let (monitor, dir) = (Monitor::default(), folder.path().join("capture"));
        expand(&source, &Resident::from_asset(&source), &dir, &ExpandParams::default(), &monitor).unwrap();
        let captures = [Capture::open(&dir).unwrap()];
        let params = FitParams {
            clusters: 3,
            components: Some(2),
            leave_out: 0.2,
            cache_directory: folder.path().to_path_buf(),
            ..FitParams::default()
        }
        .check()
        .unwrap();
        let fitted = fit_and_measure(&captures, &params, &monitor).unwrap();
        let read = Asset::parse(&fitted.bytes).unwrap();
        let material = Material::from_asset(&read).unwrap();
        assert_eq!(material.error, Some(fitted.metrics.rounded()));
        assert_eq!(material.fit.as_ref().map(|fit| (fit.clusters, fit.components)), Some((3, fitted.components)));
        let again = measure(&captures[0], &read, &Resident::from_asset(&read), &MeasureParams::default(), &monitor);
        assert_eq!(again.unwrap(), fitted.comparisons[0]);
        assert!(monitor.stages().iter().any(|stage| stage.name == "measure"));
        let left_out = fitted.psnr_left_out_db.unwrap();
        assert!(left_out.is_finite() && left_out != fitted.metrics.psnr_db);
        assert_eq!(fit_and_measure(&captures, &params, &monitor).unwrap().bytes, fitted.bytes);
    }

    #[test]
    fn a_goal_in_decibels_is_one_of_all_layers() {
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = (DirectionSet::random(9, 3).unwrap(), DirectionSet::random(10, 4).unwrap());
        let monitor = Monitor::default();
        let captures = [SurfaceSide::Front, SurfaceSide::Back].map(|side| {
            let mut source = sample_asset_with(12, 9, &views, &lights, ResidualKind::Root);
            (source.layers[0].light_side, source.layers[0].view_side) = (side, side);
            if side == SurfaceSide::Back {
                // Another material.
                source.layers[0].texel_clusters.reverse();
            }
            let source = Asset::parse(&pack(&source).unwrap()).unwrap();
            let dir = folder.path().join(format!("{side:?}"));
            expand(&source, &Resident::from_asset(&source), &dir, &ExpandParams::default(), &monitor).unwrap();
            Capture::open(&dir).unwrap()
        });
        let params = FitParams { psnr_db: Some(36.0), ..FitParams::default() }.check().unwrap();
        let fitted = fit_and_measure(&captures, &params, &monitor).unwrap();
        assert_eq!(fitted.comparisons.len(), 2);
        assert!(fitted.metrics.psnr_db >= 36.0, "{:?}", fitted.metrics);
    }

    #[test]
    fn a_fit_on_an_adapter_is_that_of_the_cpu_within_a_fiftieth_of_a_decibel() {
        let Some(products) = open_for_test("a_fit_on_an_adapter_is_that_of_the_cpu_within_a_fiftieth_of_a_decibel")
        else {
            return;
        };
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = (DirectionSet::random(9, 3).unwrap(), DirectionSet::random(10, 4).unwrap());
        let source = sample_asset_with(40, 30, &views, &lights, ResidualKind::Root);
        let capture = folder.path().join("capture");
        let monitor = Monitor::default();
        expand(&source, &Resident::from_asset(&source), &capture, &ExpandParams::default(), &monitor).unwrap();
        let captures = [Capture::open(&capture).unwrap()];
        let remarks = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
        let heard = remarks.clone();
        let hearing = Monitor::default().on_remark(move |remark| heard.lock().unwrap().push(remark.to_string()));
        let fitted = |gpu: GpuChoice| {
            let params =
                FitParams { clusters: 1, role: Some(Role::Guide), components: Some(6), gpu, ..FitParams::default() };
            fit_and_measure(&captures, &params.check().unwrap(), &hearing).unwrap().metrics.psnr_db
        };
        let on_cpu = fitted(GpuChoice::Off);
        assert!(remarks.lock().unwrap().is_empty());
        let name = products.gpu().name.clone();
        let on_gpu = fitted(GpuChoice::Named(name.clone()));
        assert!((on_gpu - on_cpu).abs() < 0.02, "{on_gpu} {on_cpu}");
        let told = remarks.lock().unwrap().join("; ");
        assert!(told.contains("matrices were multiplied") && told.contains(&name), "{told}");
        assert!(told.contains(&format!("the error was measured on {name}")), "{told}");
        // As few operations as here are never worth an adapter that nobody named.
        remarks.lock().unwrap().clear();
        assert_eq!(fitted(GpuChoice::Best), on_cpu);
        assert!(remarks.lock().unwrap().is_empty());
    }
}
