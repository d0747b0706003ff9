//! Learns the constants of a fit's cost from fits that were timed: non-negative least squares, stage by stage, of errors relative to
//! the time of the whole fit.

use crate::cost::model::{CostModel, SIZE_QUANTITIES, StageConstants, VERSION, size_quantities};
use crate::cost::work::{FitWork, OTHER, Recipe};
use crate::stages::lasso::non_negative_weights;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Power of the time of a whole fit that its errors are divided by: with 1 relative errors count, and long fits are told as too short.
const WEIGHT_POWER: f64 = 0.6;
/// Added to the diagonal of the normal equations of sizes, relative to the number of rows.
const RIDGE: f64 = 1e-9;

/// Fits of a PSNR from which on sizes are learnt: three times as many as constants.
const MIN_SIZES: usize = 3 * SIZE_QUANTITIES;

/// A fit that was timed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasuredFit {
    /// Number of threads.
    pub threads: usize,
    /// Seconds of the whole fit.
    pub seconds: f64,
    /// Processor time of the whole fit, seconds.
    pub processor_s: f64,
    /// Seconds and processor time of each stage, seconds.
    pub stages: BTreeMap<String, [f64; 2]>,
    /// Greatest memory, bytes; `None` where the system does not tell.
    pub memory_bytes: Option<f64>,
    /// Size of the asset, bytes.
    pub bytes: f64,
}

impl MeasuredFit {
    /// Returns the fit as on a processor that is slower by `factor`.
    pub fn as_if_slower(&self, factor: f64) -> MeasuredFit {
        let stages = self.stages.iter().map(|(stage, both)| (stage.clone(), both.map(|seconds| factor * seconds)));
        MeasuredFit {
            seconds: factor * self.seconds,
            processor_s: factor * self.processor_s,
            stages: stages.collect(),
            ..self.clone()
        }
    }

    /// Returns the seconds and the processor time of `stage`, `None` where it did not run.
    fn stage(&self, stage: &str) -> Option<[f64; 2]> {
        if stage != OTHER {
            return self.stages.get(stage).copied();
        }
        let rest =
            |number: usize, whole: f64| (whole - self.stages.values().map(|both| both[number]).sum::<f64>()).max(0.0);
        Some([rest(0, self.seconds), rest(1, self.processor_s)])
    }

    /// Returns the seconds in which one thread works alone, of `[seconds, processor time]`: every other thread idles then.
    fn alone(&self, [seconds, processor]: [f64; 2]) -> f64 {
        match self.threads {
            0 | 1 => 0.0,
            threads => ((threads as f64 * seconds - processor) / (threads - 1) as f64).clamp(0.0, processor),
        }
    }
}

/// Learns the constants from fits with their work, on a processor of `product_gflops`, of which `limit` was the memory limit in bytes.
/// What the fits do not tell is missing in the result ([`CostModel::completed_by`]).
pub fn learn_cost(fits: &[(FitWork, MeasuredFit)], product_gflops: f64, limit: u64) -> CostModel {
    let mut stages: BTreeMap<String, BTreeMap<Recipe, StageConstants>> = BTreeMap::new();
    let names: BTreeSet<&str> = fits.iter().flat_map(|(work, _)| work.stages()).collect();
    for stage in names {
        for recipe in [Recipe::Stored, Recipe::Bytes, Recipe::Psnr] {
            // Only what follows the goal tells a size and an error apart.
            let own = recipe == Recipe::Stored || [OTHER, "encode"].contains(&stage);
            let is_like = |other: Recipe| if own { other == recipe } else { other != Recipe::Stored };
            let rows: Vec<_> = fits
                .iter()
                .filter(|(work, _)| is_like(work.recipe))
                .filter_map(|(work, fit)| Some((work.quantities(stage, fit.bytes), fit, fit.stage(stage)?)))
                .collect();
            if rows.is_empty() {
                continue;
            }
            let solve = |value: &dyn Fn(&MeasuredFit, [f64; 2]) -> f64| {
                let weighted = rows.iter().map(|(quantities, fit, both)| {
                    let weight = fit.processor_s.max(1e-3).powf(-WEIGHT_POWER);
                    (quantities.iter().map(|q| q * weight).collect(), value(fit, *both) * weight)
                });
                non_negative(&weighted.collect::<Vec<_>>())
            };
            let (processor, alone) = (solve(&|_, both| both[1]), solve(&|fit, both| fit.alone(both)));
            stages.entry(stage.to_string()).or_default().insert(recipe, StageConstants { processor, alone });
        }
    }
    let memory = fits.iter().filter_map(|(work, fit)| {
        let (parts, bytes) = (work.memory_parts(fit.threads, limit), fit.memory_bytes?.max(1.0));
        Some((parts.iter().map(|part| part / bytes).collect(), 1.0))
    });
    let memory = non_negative(&memory.collect::<Vec<_>>());
    let (bytes_for_psnr, bytes_deviation) = learn_sizes(fits);
    let without_goal: Vec<f64> = fits
        .iter()
        .filter(|(work, _)| work.bytes.is_none() && work.psnr_db.is_none())
        .map(|(work, fit)| (fit.bytes / (work.texels * work.layers) as f64).ln())
        .collect();
    CostModel {
        version: VERSION,
        fits: fits.len(),
        product_gflops,
        stages,
        memory,
        bytes_for_psnr,
        bytes_without_goal: match without_goal.len() {
            0 => 0.0,
            count => (without_goal.iter().sum::<f64>() / count as f64).exp(),
        },
        bytes_deviation,
    }
}

/// Returns the constants of sizes, and the standard deviation of what they do not explain.
fn learn_sizes(fits: &[(FitWork, MeasuredFit)]) -> (Vec<f64>, f64) {
    let rows: Vec<([f64; SIZE_QUANTITIES], f64)> = fits
        .iter()
        .filter_map(|(work, fit)| Some((size_quantities(work)?, (fit.bytes / (work.texels * work.layers) as f64).ln())))
        .collect();
    if rows.len() < MIN_SIZES {
        return (Vec::new(), 0.0);
    }
    let (matrix, values) = (
        DMatrix::from_fn(rows.len(), SIZE_QUANTITIES, |i, j| rows[i].0[j]),
        DVector::from_fn(rows.len(), |i, _| rows[i].1),
    );
    let mut normal = matrix.tr_mul(&matrix);
    for i in 0..SIZE_QUANTITIES {
        normal[(i, i)] += RIDGE * rows.len() as f64;
    }
    let found = normal
        .cholesky()
        .map(|factor| factor.solve(&matrix.tr_mul(&values)))
        .unwrap_or_else(|| DVector::zeros(SIZE_QUANTITIES));
    let left = &matrix * &found - values;
    let free = rows.len().saturating_sub(SIZE_QUANTITIES).max(1) as f64;
    (found.iter().copied().collect(), (left.norm_squared() / free).sqrt())
}

/// Returns the non-negative constants by which the quantities of `rows` come nearest to their values.
fn non_negative(rows: &[(Vec<f64>, f64)]) -> Vec<f64> {
    let n = rows.first().map_or(0, |(quantities, _)| quantities.len());
    // Each quantity is scaled to unit length.
    let lengths: Vec<f64> =
        (0..n).map(|i| rows.iter().map(|(q, _)| q[i] * q[i]).sum::<f64>().sqrt().max(1e-300)).collect();
    let gram: Vec<f64> = (0..n * n)
        .map(|at| rows.iter().map(|(q, _)| q[at / n] / lengths[at / n] * q[at % n] / lengths[at % n]).sum())
        .collect();
    let correlation: Vec<f64> = (0..n).map(|i| rows.iter().map(|(q, value)| q[i] / lengths[i] * value).sum()).collect();
    let active: Vec<usize> = (0..n).collect();
    let found = non_negative_weights(&gram, n, &correlation, &active);
    found.iter().zip(&lengths).map(|(weight, length)| weight / length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texels, and views and lights, of captures that are learnt from.
    const KNOWN: [(usize, usize); 16] = [
        (1024, 81),
        (4096, 40),
        (65536, 81),
        (16384, 151),
        (262144, 16),
        (4096, 81),
        (65536, 24),
        (9216, 60),
        (256, 20),
        (36864, 60),
        (16384, 40),
        (2304, 100),
        (147456, 24),
        (10000, 33),
        (40000, 52),
        (65536, 45),
    ];

    fn work(texels: usize, directions: usize, recipe: Recipe) -> FitWork {
        FitWork {
            texels,
            directions: [directions; 2],
            layers: 1,
            pairs: directions * directions,
            missing: 0,
            sample_bytes: 1,
            shared_bases: 280,
            sample: texels.min(8192),
            clusters: 16,
            bytes: (recipe == Recipe::Bytes).then_some(4 * texels as u64),
            psnr_db: (recipe == Recipe::Psnr).then_some(30.0 + (directions % 7) as f64),
            recipe,
            predicts_lobes: recipe != Recipe::Stored,
            heights: false,
            in_file: false,
            detail: 0.01 + 0.001 * (texels % 13) as f64,
            decoding_s: 1e-8 * (texels * directions * directions) as f64,
        }
    }

    /// Fits whose times are what constants of 1, 2, 3, ... give.
    fn fits(sizes: &[(usize, usize)]) -> Vec<(FitWork, MeasuredFit)> {
        let of = |(texels, directions): (usize, usize), recipe: Recipe| {
            let work = work(texels, directions, recipe);
            let bytes =
                work.bytes.map_or(0.01 * work.texels as f64 * work.psnr_db.unwrap_or(30.0).exp2().sqrt(), |b| b as f64);
            let mut stages = BTreeMap::new();
            for stage in work.stages() {
                let processor: f64 =
                    work.quantities(stage, bytes).iter().enumerate().map(|(i, q)| (i + 1) as f64 * q).sum();
                // A tenth of it is done by one thread of two.
                stages.insert(stage.to_string(), [0.55 * processor, processor]);
            }
            let sum = |number: usize| stages.values().map(|both: &[f64; 2]| both[number]).sum();
            let (seconds, processor_s) = (sum(0), sum(1));
            stages.remove(OTHER);
            let fit = MeasuredFit {
                threads: 2,
                seconds,
                processor_s,
                stages,
                memory_bytes: Some(work.memory_parts(2, 4_000_000_000).iter().sum()),
                bytes,
            };
            (work, fit)
        };
        let recipes = [Recipe::Stored, Recipe::Bytes, Recipe::Psnr];
        sizes.iter().flat_map(|size| recipes.map(|recipe| of(*size, recipe))).collect()
    }

    #[test]
    fn constants_that_made_the_times_tell_the_times_of_other_sizes() {
        let model = learn_cost(&fits(&KNOWN), 50.0, 4_000_000_000);
        for (work, fit) in fits(&[(40000, 64), (147456, 50), (2304, 100)]) {
            let cost = model.cost(&work, 50.0, 2, 4_000_000_000);
            for (told, truth) in [
                (cost.processor_s, fit.processor_s),
                (cost.seconds(2), fit.seconds),
                (cost.memory_bytes, fit.memory_bytes.unwrap()),
                (cost.core_seconds(4), fit.processor_s * 1.3),
            ] {
                assert!((told / truth - 1.0).abs() < 0.03, "{work:?}: {told} for {truth}");
            }
            if work.recipe != Recipe::Stored {
                assert!(
                    (cost.asset_bytes / fit.bytes - 1.0).abs() < 0.05,
                    "{work:?}: {} for {}",
                    cost.asset_bytes,
                    fit.bytes
                );
            }
            // Half as quick a processor: all takes twice as long but decoding, which was timed; it costs `1 x decoding_s` here.
            let slow = model.cost(&work, 25.0, 2, 4_000_000_000);
            let decoding = work.decoding_s;
            assert!(
                (slow.processor_s - decoding - 2.0 * (cost.processor_s - decoding)).abs() < 0.02 * slow.processor_s
            );
        }
        assert_eq!(toml::from_str::<CostModel>(&model.to_toml()).unwrap(), model);
    }

    #[test]
    fn what_few_fits_do_not_tell_is_taken_from_a_table_that_is_known() {
        let known = learn_cost(&fits(&KNOWN), 50.0, 4_000_000_000);
        let few: Vec<_> = fits(&KNOWN[..2])
            .into_iter()
            .filter(|(work, _)| work.recipe == Recipe::Bytes)
            .map(|(work, fit)| {
                // Twice as slow, and on a system that does not tell the memory.
                (work, MeasuredFit { memory_bytes: None, ..fit.as_if_slower(2.0) })
            })
            .collect();
        let bare = learn_cost(&few, 25.0, 4_000_000_000);
        assert!(bare.memory.is_empty() && bare.bytes_for_psnr.is_empty());
        let model = bare.completed_by(&known);
        assert_eq!((&model.memory, &model.bytes_for_psnr), (&known.memory, &known.bytes_for_psnr));
        for (work, fit) in fits(&[(40000, 64)]) {
            let [told, truth] = [model.cost(&work, 25.0, 2, 4_000_000_000).processor_s, 2.0 * fit.processor_s];
            if work.recipe == Recipe::Stored {
                assert!((told / truth - 1.0).abs() < 0.05, "{told} {truth}");
            }
            assert!(told > 0.0);
        }
    }

    #[test]
    fn odd_tables_are_refused_with_the_remedy() {
        let good = learn_cost(&fits(&KNOWN), 50.0, 4_000_000_000);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cost.toml");
        let refused = |change: &dyn Fn(&mut CostModel)| {
            let mut model = good.clone();
            change(&mut model);
            std::fs::write(&path, model.to_toml()).unwrap();
            CostModel::read(&path).unwrap_err().to_string()
        };
        std::fs::write(&path, good.to_toml()).unwrap();
        assert_eq!(CostModel::read(&path).unwrap(), good);
        let changes: [&dyn Fn(&mut CostModel); 6] = [
            &|model| model.version = 2,
            &|model| model.product_gflops = 0.0,
            &|model| model.memory.clear(),
            &|model| model.bytes_for_psnr[0] = f64::NAN,
            &|model| model.bytes_deviation = -1.0,
            &|model| {
                model.stages.values_mut().for_each(|recipes| {
                    recipes.values_mut().for_each(|constants| constants.alone.truncate(0));
                })
            },
        ];
        for change in changes {
            let told = refused(change);
            assert!(told.contains("cost.toml") && told.contains("btf-fit bench cost"), "{told}");
        }
    }

    #[test]
    fn the_table_that_is_built_in_is_sound() {
        let model = CostModel::built_in().unwrap();
        let cost = model.cost(&work(65536, 81, Recipe::Bytes), model.product_gflops, 2, 4_000_000_000);
        assert!((5.0..500.0).contains(&cost.processor_s) && cost.memory_bytes > 1e8, "{cost:?}");
    }
}
