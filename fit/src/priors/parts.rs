//! The parts of a covariance that the priors of a fit give.

use crate::error::FitError;
use crate::input::residual_curve::Curve;
use crate::inspect::load::load_asset;
use crate::params::Priors;
use crate::priors::functions::PriorFunctions;
use btf_runtime::{Asset, Sphere};
use ndarray::Array2;

/// The priors that come with the program: woven cloths, leathers and leaves of `btf-synth`, 300 kB.
const BUILT_IN: &[u8] = include_bytes!("priors.spmm");

/// Returns the functions of every cluster of `priors` at the pairs of `views` and `lights`, `[function, pair]` each, in `curve`.
///
/// # Errors
/// An asset that cannot be read.
pub fn prior_parts(
    priors: &Priors,
    views: &Sphere,
    lights: &Sphere,
    curve: &Curve,
) -> Result<Vec<Array2<f32>>, FitError> {
    let assets = match priors {
        Priors::BuiltIn => vec![Asset::parse(BUILT_IN)?],
        Priors::Assets(paths) => paths.iter().map(|path| Ok(load_asset(path)?.1)).collect::<Result<_, FitError>>()?,
    };
    Ok(assets.iter().flat_map(|asset| PriorFunctions::of_asset(asset, curve).spread(views, lights)).collect())
}
