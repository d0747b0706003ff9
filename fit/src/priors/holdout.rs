//! Direction pairs that a fit does not use, and how they are predicted from the pairs that it uses: those that are held back so
//! that their error can be measured (`--leave-out`), and those that have no image.

use crate::input::rounds::Rounds;
use crate::priors::predict::Prediction;
use btf_capture::CaptureInfo;
use ndarray::ArrayViewMut2;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Held-back and missing pairs and how their samples are filled from the others.
#[derive(Debug, Clone, Default)]
pub struct Holdout {
    /// Held-back and missing pairs, ascending (`view * lights + light`).
    pub pairs: Vec<usize>,
    /// How the samples of these pairs follow from the others; `None` before that is known.
    pub prediction: Option<Prediction>,
}

impl Holdout {
    /// Holds back `share` of the pairs that have an image, chosen by `seed`, beside those that have none: in every round of
    /// lights the same.
    pub fn new(info: &CaptureInfo, share: f64, seed: u64) -> Holdout {
        let rounds = Rounds::of(&info.lights);
        let mut all: Vec<usize> = info.present_pairs().filter_map(|pair| rounds.in_first(pair)).collect();
        // At least one pair stays, from which the others follow.
        let count = ((all.len() as f64 * share).round() as usize).min(all.len().saturating_sub(1));
        if count == 0 && info.missing.is_empty() {
            return Holdout::default();
        }
        all.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5eed_0f0e));
        let held = all[..count].iter().flat_map(|pair| (0..rounds.count).map(|round| rounds.place(*pair, round)));
        let mut pairs: Vec<usize> = held.chain(info.missing.iter().copied()).collect();
        pairs.sort_unstable();
        Holdout { pairs, prediction: None }
    }

    /// Returns the pairs of `pair_count` that are neither held back nor missing, ascending.
    pub fn seen(&self, pair_count: usize) -> Vec<usize> {
        let mut held = vec![false; pair_count];
        self.pairs.iter().for_each(|pair| held[*pair] = true);
        (0..pair_count).filter(|pair| !held[*pair]).collect()
    }

    /// Replaces the held-back samples of texels' rows `[texel, pair x channel]` by what the others predict.
    pub fn fill(&self, rows: ArrayViewMut2<f32>) {
        if let Some(prediction) = &self.prediction {
            prediction.fill(rows);
        }
    }

    /// Sets the held-back pairs of a per-pair array to 0.
    pub fn zero(&self, weights: &mut [f32]) {
        self.pairs.iter().for_each(|pair| weights[*pair] = 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{DirectionSet, ImageFormat};

    #[test]
    fn a_share_is_held_back_beside_what_is_missing_and_one_pair_stays() {
        let set = |count, seed| DirectionSet::random(count, seed).unwrap();
        let info = CaptureInfo::new("test", 1, 1, set(12, 3), set(14, 4), ImageFormat::Png);
        let holdout = Holdout::new(&info, 0.2, 1);
        assert_eq!((holdout.pairs.len(), holdout.seen(168).len()), (34, 134));
        assert_ne!(Holdout::new(&info, 0.2, 2).pairs, holdout.pairs);
        let missing = CaptureInfo { missing: (3..168).collect(), ..info.clone() };
        assert_eq!(Holdout::new(&missing, 0.0, 1).seen(168), [0, 1, 2]);
        assert_eq!(Holdout::new(&missing, 0.9, 1).seen(168).len(), 1);
        assert!(Holdout::new(&info, 0.0, 1).pairs.is_empty());
    }
}
