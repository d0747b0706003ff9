//! The lobe dictionaries of all clusters, each fitted to representative texels, and what the lobes achieve.

use crate::error::FitError;
use crate::input::pair_stride::stride_over_pairs;
use crate::input::tile_cache::TileCache;
use crate::monitor::Monitor;
use crate::priors::holdout::Holdout;
use crate::resume::stored::stored_structs;
use crate::stages::candidates::candidate_lobes;
use crate::stages::dictionary::{Dictionary, Pairs, Target, build_dictionary};
use crate::stages::sparse::ClusterLobes;
use btf_runtime::{Lobe, ResidualKind, Sphere, lobe_tables};
use ndarray::Array2;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Returns the weight of a pair whose functions have the mean `mean`: the slope of the residual's curve, squared.
fn tone_weight(kind: ResidualKind, mean: f32) -> f32 {
    let x = mean.max(0.0) + TONE_EPSILON;
    match kind {
        ResidualKind::Additive => 1.0,
        ResidualKind::Log => x.powi(-2),
        ResidualKind::Root => x.powf(2.0 / btf_runtime::ROOT - 2.0),
    }
}

/// Samples and clusters to which the dictionaries of a layer are fitted.
pub struct DictionaryTask<'a> {
    /// The capture.
    pub cache: &'a TileCache<'a>,
    /// Representative texels of each cluster.
    pub representatives: &'a [Vec<usize>],
    /// Directions of the eye.
    pub views: &'a Sphere,
    /// Directions of the light.
    pub lights: &'a Sphere,
    /// Held-back pairs, which have no weight.
    pub holdout: &'a Holdout,
    /// The residual's curve, whose slope weights the pairs.
    pub kind: ResidualKind,
    /// Most lobes of a texel; 0 for empty dictionaries.
    pub lobes: usize,
    /// Direction pairs that a dictionary is fitted on at most.
    pub max_pairs: usize,
}

/// All candidate lobes on the pairs that dictionaries are fitted on.
struct TabulatedCandidates {
    /// The pairs' numbers.
    used: Vec<usize>,
    /// The pairs' directions.
    pairs: Pairs,
    lobes: Vec<Lobe>,
    /// `[pair, lobe]`.
    tables: Array2<f32>,
}

impl DictionaryTask<'_> {
    /// Fits the dictionaries of all clusters; also returns what they achieve on the representatives.
    pub fn build(&self, monitor: &Monitor) -> Result<(Vec<ClusterLobes>, LobeFigures), FitError> {
        let functions = self.functions()?;
        monitor.check()?;
        let candidates = self.tabulated_candidates();
        let done = AtomicUsize::new(0);
        let built: Vec<(ClusterLobes, Dictionary)> = functions
            .par_iter()
            .map(|functions| {
                monitor.check()?;
                let weights = self.pair_weights(functions);
                let found = candidates.fit(functions, &weights);
                let tables = lobe_tables(&found.lobes, self.views, self.lights);
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                monitor.report("dictionary", count, self.representatives.len())?;
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

    /// Reads the representatives: for each cluster `[pair, 3 * representative + channel]`.
    fn functions(&self) -> Result<Vec<Array2<f32>>, FitError> {
        let pairs = self.cache.pair_count();
        let mut functions: Vec<Array2<f32>> =
            self.representatives.iter().map(|chosen| Array2::zeros((pairs, 3 * chosen.len()))).collect();
        let mut chosen: Vec<usize> = self.representatives.iter().flatten().copied().collect();
        chosen.sort_unstable();
        let block = self.cache.gather(&chosen)?;
        functions.par_iter_mut().zip(self.representatives).for_each(|(functions, own)| {
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
        Ok(functions)
    }

    fn tabulated_candidates(&self) -> TabulatedCandidates {
        // A stride that shares no factor with the number of lights visits all of them.
        let (pairs, light_count) = (self.cache.pair_count(), self.lights.len());
        let stride = stride_over_pairs(pairs.div_ceil(self.max_pairs), light_count);
        let used: Vec<usize> = (0..pairs).step_by(stride).collect();
        let sampled = Pairs {
            wi: used.iter().map(|pair| self.lights.direction((pair % light_count) as u32)).collect(),
            wo: used.iter().map(|pair| self.views.direction((pair / light_count) as u32)).collect(),
        };
        let lobes = if self.lobes == 0 { Vec::new() } else { candidate_lobes() };
        let columns: Vec<Vec<f32>> = lobes.par_iter().map(|lobe| sampled.table(lobe)).collect();
        let tables = Array2::from_shape_fn((used.len(), lobes.len()), |(p, i)| columns[i][p]);
        TabulatedCandidates { used, pairs: sampled, lobes, tables }
    }

    /// Returns the tone weight of each pair for a cluster with these `functions`, 1 on average and 0 for pairs that are
    /// held back.
    fn pair_weights(&self, functions: &Array2<f32>) -> Vec<f32> {
        let mut weights: Vec<f32> = functions
            .rows()
            .into_iter()
            .map(|row| tone_weight(self.kind, if row.is_empty() { 0.0 } else { row.mean().unwrap_or(0.0) }))
            .collect();
        self.holdout.zero(&mut weights);
        let mean = weights.iter().map(|w| f64::from(*w)).sum::<f64>() / weights.len() as f64;
        weights.iter_mut().for_each(|w| *w /= mean.max(1e-12) as f32);
        weights
    }
}

impl TabulatedCandidates {
    /// Fits the dictionary of a cluster with these `functions`, `[pair, 3 * representative + channel]`.
    fn fit(&self, functions: &Array2<f32>, weights: &[f32]) -> Dictionary {
        if self.lobes.is_empty() || functions.ncols() == 0 {
            return Dictionary { lobes: Vec::new(), energy: 0.0, error_selected: 0.0, error_refined: 0.0 };
        }
        let target = Target {
            root_weights: self.used.iter().map(|pair| weights[*pair].sqrt()).collect(),
            functions: Array2::from_shape_fn((self.used.len(), functions.ncols()), |(p, column)| {
                functions[[self.used[p], column]]
            }),
        };
        build_dictionary(&target, &self.pairs, &self.lobes, &self.tables, DICTIONARY_SIZE)
    }
}
