//! The lobe dictionaries of all clusters, each fitted to representative texels, and what the lobes achieve.

use crate::error::FitError;
use crate::input::holdout::Holdout;
use crate::input::pair_stride::stride_over_pairs;
use crate::input::tile_cache::TileCache;
use crate::monitor::Monitor;
use crate::resume::stored::stored_structs;
use crate::stages::candidates::candidate_lobes;
use crate::stages::dictionary::{Dictionary, Pairs, Target, build_dictionary};
use crate::stages::sparse::ClusterLobes;
use btf_runtime::{ResidualKind, Sphere, lobe_tables};
use ndarray::Array2;
use rayon::prelude::*;

/// Lobes per dictionary.
pub const DICTIONARY_SIZE: usize = 32;
/// Added to a reflectance before its tone weight is taken.
const TONE_EPSILON: f32 = 0.02;

/// Tone-weighted squared error of the lobes alone, relative to the energy of what they predict.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LobeFigures {
    /// Representatives, dictionary as the Lasso selected it.
    pub selected: f64,
    /// Representatives, after the refinement of parameters and normals.
    pub refined: f64,
    /// Every texel with its own sparse selection, mean.
    pub sparse: f64,
}

stored_structs! {
    LobeFigures { selected, refined, sparse }
}

fn tone_weight(kind: ResidualKind, mean: f32) -> f32 {
    let x = mean.max(0.0) + TONE_EPSILON;
    match kind {
        ResidualKind::Additive => 1.0,
        ResidualKind::Log => x.powi(-2),
        ResidualKind::Root => x.powf(2.0 / btf_runtime::ROOT - 2.0),
    }
}

pub fn dictionaries(
    cache: &TileCache,
    representatives: &[Vec<usize>],
    views: &Sphere,
    lights: &Sphere,
    holdout: &Holdout,
    kind: ResidualKind,
    lobes: usize,
    most_pairs: usize,
    monitor: &Monitor,
) -> Result<(Vec<ClusterLobes>, LobeFigures), FitError> {
    let pairs = cache.pair_count();
    let mut functions: Vec<Array2<f32>> =
        representatives.iter().map(|chosen| Array2::zeros((pairs, 3 * chosen.len()))).collect();
    let mut chosen: Vec<usize> = representatives.iter().flatten().copied().collect();
    chosen.sort_unstable();
    let block = cache.gather(&chosen)?;
    functions.par_iter_mut().zip(representatives).for_each(|(functions, own)| {
        let mut row = vec![0.0; 3 * pairs];
        for (slot, texel) in own.iter().enumerate() {
            // Clusters share no texel.
            let number = chosen.partition_point(|other| other < texel);
            block.texel_linear(number, &mut row);
            for (p, rgb) in row.chunks_exact(3).enumerate() {
                for c in 0..3 {
                    functions[[p, 3 * slot + c]] = rgb[c];
                }
            }
        }
    });
    drop(block);
    monitor.check()?;

    // A stride that shares no factor with the number of lights visits all of them.
    let stride = stride_over_pairs(pairs.div_ceil(most_pairs), lights.len());
    let used: Vec<usize> = (0..pairs).step_by(stride).collect();
    let light_count = lights.len();
    let sampled = Pairs {
        wi: used.iter().map(|pair| lights.direction((pair % light_count) as u32)).collect(),
        wo: used.iter().map(|pair| views.direction((pair / light_count) as u32)).collect(),
    };
    let candidates = if lobes == 0 { Vec::new() } else { candidate_lobes() };
    let columns: Vec<Vec<f32>> = candidates.par_iter().map(|lobe| sampled.table(lobe)).collect();
    let tables = Array2::from_shape_fn((used.len(), candidates.len()), |(p, i)| columns[i][p]);
    drop(columns);

    let done = std::sync::atomic::AtomicUsize::new(0);
    let built: Vec<(ClusterLobes, Dictionary)> = functions
        .par_iter()
        .map(|functions| {
            monitor.check()?;
            let mut weights: Vec<f32> = functions
                .rows()
                .into_iter()
                .map(|row| tone_weight(kind, if row.is_empty() { 0.0 } else { row.mean().unwrap_or(0.0) }))
                .collect();
            holdout.zero(&mut weights);
            let mean = weights.iter().map(|w| f64::from(*w)).sum::<f64>() / weights.len() as f64;
            weights.iter_mut().for_each(|w| *w /= mean.max(1e-12) as f32);
            let found = if candidates.is_empty() || functions.ncols() == 0 {
                Dictionary { lobes: Vec::new(), energy: 0.0, error_selected: 0.0, error_refined: 0.0 }
            } else {
                let target = Target {
                    root_weights: used.iter().map(|pair| weights[*pair].sqrt()).collect(),
                    functions: Array2::from_shape_fn((used.len(), functions.ncols()), |(p, column)| {
                        functions[[used[p], column]]
                    }),
                };
                build_dictionary(&target, &sampled, &candidates, &tables, DICTIONARY_SIZE)
            };
            let tables = lobe_tables(&found.lobes, views, lights);
            let count = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            monitor.report("dictionary", count, representatives.len())?;
            Ok((ClusterLobes::new(found.lobes.clone(), tables, weights), found))
        })
        .collect::<Result<_, FitError>>()?;
    let total = |part: fn(&Dictionary) -> f64| built.iter().map(|(_, found)| part(found)).sum::<f64>();
    let energy = total(|found| found.energy).max(1e-30);
    let figures = LobeFigures {
        selected: total(|found| found.error_selected) / energy,
        refined: total(|found| found.error_refined) / energy,
        sparse: 0.0,
    };
    Ok((built.into_iter().map(|(lobes, _)| lobes).collect(), figures))
}
