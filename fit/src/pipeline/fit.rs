//! The fit, stage by stage: read, project, cluster, dictionary, weights, residual, encode.

use crate::error::FitError;
use crate::gpu::fit_gpu::FitGpu;
use crate::input::tile_cache::DecodedImages;
use crate::monitor::Monitor;
use crate::params::{Goal, ValidFitParams};
use crate::pipeline::adapter::FitAdapter;
use crate::pipeline::choose_error::with_chosen_error;
use crate::pipeline::choose_relief::choose_relief;
use crate::pipeline::description::byte_budget;
use crate::pipeline::match_energy::with_matched_energy;
use crate::pipeline::outcome::FitOutcome;
use crate::pipeline::prepare::{PreparedFit, check_layers};
use crate::pipeline::search::StepSearch;
use crate::resume::checkpoint::Checkpoint;
use crate::resume::stored::stored_structs;
use crate::spectral::measure::BandedCaptures;
use crate::stages::lobe_dictionaries::LobeFigures;
use btf_capture::Capture;
use btf_runtime::pack;

/// The step in the residual's curve without a goal, relative to the root of the number of samples: a third of it is the
/// error of a sample that each component's rounding leaves.
const DEFAULT_STEP: f64 = 0.001;

/// Fits captures (the layers of one asset) and packs them.
///
/// Deterministic: equal captures, parameters and seed give equal bytes on any number of threads, unless an adapter may
/// multiply ([`crate::FitParams::gpu`]). Memory: at most
/// `params.memory_bytes()`. One step size quantises all layers, so that a byte budget goes where it takes away most
/// error; a PSNR goal is one over all samples of all layers. The material text is empty: the caller describes the
/// asset and packs it again.
///
/// # Errors
/// A fault of a capture, or of several together; a budget or a memory limit that is too small.
pub fn fit(captures: &[Capture], params: &ValidFitParams, monitor: &Monitor) -> Result<FitOutcome, FitError> {
    let params = &with_chosen_error(captures, params)?;
    let checkpoint = Checkpoint::open(captures, params, monitor)?;
    check_layers(captures)?;
    let adapter = FitAdapter::new(captures, params, monitor);
    let outcome = fit_from(captures, None, params, &checkpoint, &adapter, monitor)?.0;
    adapter.tell();
    Ok(outcome)
}

/// Runs [`fit()`] from the finished stages in `checkpoint`, on `adapter` where that is quicker. Also returns the decoded images when
/// there is one capture and it was read. [`check_layers`] must have passed. `banded` is what channels are judged by.
pub(crate) fn fit_from(
    captures: &[Capture],
    banded: Option<&BandedCaptures>,
    params: &ValidFitParams,
    checkpoint: &Checkpoint,
    adapter: &FitAdapter,
    monitor: &Monitor,
) -> Result<(FitOutcome, Option<DecodedImages>), FitError> {
    let mut images = None;
    let encoded = checkpoint.whole().load_or("encode", || {
        let (encoded, decoded) = prepare_and_encode(captures, banded, params, checkpoint, adapter.gpu()?, monitor)?;
        images = decoded;
        Ok(encoded)
    })?;
    let Encoded { bytes, lobes, left_out } = encoded;
    Ok((FitOutcome::new(bytes, lobes, left_out)?, images))
}

/// A packed asset and what is not read off it.
struct Encoded {
    bytes: Vec<u8>,
    lobes: LobeFigures,
    left_out: Vec<usize>,
}

stored_structs! {
    Encoded { bytes, lobes, left_out }
}

fn prepare_and_encode(
    captures: &[Capture],
    banded: Option<&BandedCaptures>,
    params: &ValidFitParams,
    checkpoint: &Checkpoint,
    gpu: Option<&FitGpu>,
    monitor: &Monitor,
) -> Result<(Encoded, Option<DecodedImages>), FitError> {
    let mut prepared = PreparedFit::prepare_from(captures, params, checkpoint, gpu, monitor)?;
    let mut asset = monitor.stage("encode", || {
        // About which step it will be tells which directions are worth keeping.
        let step = match params.goal() {
            Goal::Bytes(bytes) => prepared.step_within_bytes(byte_budget(captures, params, bytes)),
            Goal::PsnrDb(db) => {
                StepSearch { captures, banded, prepared: &prepared, params, monitor }.draft_within_error(db)?
            }
            Goal::None => DEFAULT_STEP * (3.0 * captures[0].info().pair_count() as f64).sqrt(),
        };
        prepared.layers.iter_mut().for_each(|layer| layer.model.turn_to(step));
        let search = StepSearch { captures, banded, prepared: &prepared, params, monitor };
        match params.goal() {
            Goal::Bytes(bytes) => search.within_bytes(byte_budget(captures, params, bytes), step),
            Goal::PsnrDb(db) => search.within_error(db, step),
            Goal::None => Ok(search.assemble(step).asset),
        }
    })?;
    let search = StepSearch { captures, banded, prepared: &prepared, params, monitor };
    let left_out: Vec<&[usize]> = prepared.layers.iter().map(|layer| layer.left_out.as_slice()).collect();
    let matched = monitor.stage("energy", || {
        let (images, memory_bytes) = (prepared.images.as_ref(), params.memory_bytes());
        with_matched_energy(&asset, captures, &left_out, images, memory_bytes, monitor)
    })?;
    // A goal that is just reached is not given up for the mean.
    if !matches!(params.goal(), Goal::PsnrDb(db) if search.psnr_on_share(&matched)? < db) {
        asset = matched;
    }
    if asset.layers.iter().any(|layer| layer.relief.is_some()) {
        monitor.stage("relief", || choose_relief(&mut asset, monitor))?;
    }
    let bytes = pack(&asset)?;
    let first = &mut prepared.layers[0];
    let (lobes, left_out) = (first.figures, std::mem::take(&mut first.left_out));
    Ok((Encoded { bytes, lobes, left_out }, prepared.images))
}
