//! `btf.leaf.invert`: the contents of leaves from their spectra.

use crate::faults::value_error;
use btf_synth::{
    Abm97, AbmB, AbmU, Inversion, InversionParams, Inverter, LeafModel, LeafSpectra, MAX_UNKNOWNS, PlateModel, SHARES,
    TwoHalves,
};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Leaves between two looks for Control-C.
const LEAVES_AT_ONCE: usize = 512;

/// Finds contents; `btf.leaf.invert` says what it takes and gives.
#[allow(clippy::too_many_arguments, reason = "each is an argument of the Python function")]
#[pyfunction]
pub fn invert_leaves<'py>(
    py: Python<'py>,
    wavelengths_nm: PyReadonlyArray1<'py, f64>,
    reflectance: Option<PyReadonlyArray2<'py, f64>>,
    transmittance: Option<PyReadonlyArray2<'py, f64>>,
    abaxial_reflectance: Option<PyReadonlyArray2<'py, f64>>,
    abaxial_transmittance: Option<PyReadonlyArray2<'py, f64>>,
    model: &str,
    side: &str,
    held: BTreeMap<String, f64>,
    independent: bool,
    cone_deg: f64,
    rays: u64,
    seed: u64,
    threads: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let nm = wavelengths_nm.as_array().to_vec();
    if !(0.0..=90.0).contains(&cone_deg) || rays == 0 {
        return Err(value_error(format!("cone_deg is {cone_deg} and rays {rays}: take 0 to 90, and 1 or more")));
    }
    let mut shares = [reflectance, transmittance, abaxial_reflectance, abaxial_transmittance];
    match side {
        "adaxial" => {}
        "abaxial" if shares[2].is_none() && shares[3].is_none() => shares.rotate_left(2),
        "abaxial" => return Err(value_error("side is 'abaxial' beside abaxial shares of light: leave it out")),
        other => return Err(value_error(format!("side is '{other}': take 'adaxial' or 'abaxial'"))),
    }
    let leaves = leaves_of(&nm, shares.each_ref().map(Option::as_ref))?;
    let faces = [0, 1].map(|face| leaves.iter().any(|leaf| leaf.faces()[face]));
    let params = params(
        model,
        &held,
        InversionParams { faces, correlated: !independent, cone_deg, rays, seed, ..Default::default() },
    )?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("no threads to work on: {error}")))?;
    let inverter = py.detach(|| pool.install(|| Inverter::new(&params, &nm)));
    let inverter = inverter.map_err(|error| value_error(error.to_string().replace("--", "")))?;
    let mut found: Vec<Inversion> = Vec::with_capacity(leaves.len());
    for some in leaves.chunks(LEAVES_AT_ONCE) {
        py.check_signals()?;
        found.extend(
            py.detach(|| pool.install(|| some.par_iter().map(|leaf| inverter.invert(leaf)).collect::<Vec<_>>())),
        );
    }
    let result = PyDict::new(py);
    let numbers = |of: &dyn Fn(&Inversion) -> f64| PyArray1::from_iter(py, found.iter().map(of));
    for (i, unknown) in inverter.unknowns().iter().enumerate() {
        result.set_item(unknown.key, numbers(&|found| found.values[i]))?;
        result.set_item(format!("{}_standard_error", unknown.key), numbers(&|found| found.standard_errors[i]))?;
        // Words, which numpy holds badly.
        let states: Vec<&str> = found.iter().map(|found| found.states[i].name()).collect();
        result.set_item(format!("{}_state", unknown.key), states)?;
    }
    let count = inverter.unknowns().len();
    let correlations = found.iter().flat_map(|found| found.correlations[..count].iter().flat_map(|row| &row[..count]));
    let correlations = PyArray1::from_iter(py, correlations.copied());
    result.set_item("correlations", correlations.reshape([found.len(), count, count])?)?;
    let shares = ["reflectance", "transmittance", "abaxial_reflectance", "abaxial_transmittance"];
    for (share, name) in shares.into_iter().enumerate() {
        result.set_item(format!("rmse_{name}"), numbers(&|found| found.rmse[share].unwrap_or(f64::NAN)))?;
    }
    result.set_item("unknowns", inverter.unknowns().iter().map(|unknown| unknown.key).collect::<Vec<_>>())?;
    result.set_item("remarks", found.iter().map(|found| found.remarks.clone()).collect::<Vec<_>>())?;
    Ok(result)
}

/// Makes spectra of arrays (leaves, wavelengths).
fn leaves_of(nm: &[f64], shares: [Option<&PyReadonlyArray2<'_, f64>>; SHARES]) -> PyResult<Vec<LeafSpectra>> {
    let shapes: Vec<[usize; 2]> =
        shares.into_iter().flatten().map(|shares| [shares.as_array().nrows(), shares.as_array().ncols()]).collect();
    let [first, rest @ ..] = &shapes[..] else {
        return Err(value_error("give reflectance, transmittance or both"));
    };
    if rest.iter().any(|shape| shape != first) || first[1] != nm.len() {
        return Err(value_error(format!(
            "{} wavelengths and shares of light of the shapes {shapes:?}: each must be (leaves, wavelengths)",
            nm.len()
        )));
    }
    let row = |shares: Option<&PyReadonlyArray2<'_, f64>>, i: usize| {
        shares.map_or_else(Vec::new, |shares| shares.as_array().row(i).to_vec())
    };
    let leaf = |i| {
        let rows = shares.map(|shares| row(shares, i));
        LeafSpectra::of_faces(&format!("leaf {i}"), nm, rows.each_ref().map(Vec::as_slice))
    };
    (0..first[0]).map(|i| leaf(i).map_err(value_error)).collect()
}

fn params(model: &str, held: &BTreeMap<String, f64>, usual: InversionParams) -> PyResult<InversionParams> {
    let model = match model {
        "plate-n" => LeafModel::Plate(PlateModel::N),
        "plate-two-sided" => LeafModel::TwoSided(TwoHalves::default()),
        "abm97" => LeafModel::Abm97(Abm97::default()),
        "abm-b" => LeafModel::AbmB(AbmB::default()),
        "abm-u" => LeafModel::AbmU(AbmU::default()),
        other => {
            return Err(value_error(format!(
                "model is '{other}': take 'plate-n', 'plate-two-sided', 'abm97', 'abm-b' or 'abm-u'"
            )));
        }
    };
    let mut params = InversionParams { model, held: [None; MAX_UNKNOWNS], ..usual };
    let unknowns = params.unknowns();
    for (key, value) in held {
        let at = unknowns.iter().position(|unknown| unknown.key == key).ok_or_else(|| {
            let keys: Vec<&str> = unknowns.iter().map(|unknown| unknown.key).collect();
            value_error(format!(
                "held has '{key}', which this model does not look for: take one of {}",
                keys.join(", ")
            ))
        })?;
        params.held[at] = Some(*value);
    }
    Ok(params)
}
