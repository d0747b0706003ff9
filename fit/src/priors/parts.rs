//! The parts of a covariance that the priors of a fit give.

use crate::error::FitError;
use crate::input::residual_curve::Curve;
use crate::inspect::load::load_asset;
use crate::params::Priors;
use crate::priors::functions::PriorFunctions;
use btf_runtime::{Asset, Sphere, SurfaceSide};
use ndarray::Array2;

/// The priors that come with the program: woven cloths, leathers and leaves of `btf-synth`, 300 kB.
const BUILT_IN: &[u8] = include_bytes!("priors.spmm");

/// Returns the functions of every cluster of `priors` at the pairs of `views` and `lights`, `[function, pair]` each, in `curve`.
/// Of an asset that layer counts whose light and view are on `sides`, else its first.
///
/// # Errors
/// An asset that cannot be read.
pub fn prior_parts(
    priors: &Priors,
    sides: (SurfaceSide, SurfaceSide),
    [views, lights]: [&Sphere; 2],
    curve: &Curve,
) -> Result<Vec<Array2<f32>>, FitError> {
    let assets = match priors {
        Priors::BuiltIn => vec![Asset::parse(BUILT_IN)?],
        Priors::Assets(paths) => paths.iter().map(|path| Ok(load_asset(path)?.1)).collect::<Result<_, FitError>>()?,
    };
    let functions: Vec<PriorFunctions> = assets
        .iter()
        .map(|asset| {
            let own = asset.layers.iter().position(|layer| (layer.light_side, layer.view_side) == sides);
            PriorFunctions::of_layer(asset, own.unwrap_or(0), curve)
        })
        .collect::<Result<_, FitError>>()?;
    let clusters = functions.iter().map(PriorFunctions::clusters).sum();
    Ok(functions.iter().flat_map(|functions| functions.spread(views, lights, clusters)).collect())
}
