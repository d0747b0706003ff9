//! How many residual components, which ranks and how many bits: the plan of least predicted error
//! within a byte budget, or of least bytes for a predicted PSNR.

use crate::factor::Rotated;
use crate::local_pca::LocalPca;
use btf_runtime::ALIGNMENT;

/// Ranks that a plan may give to luma and to each chroma channel.
const LUMA_RANKS: [usize; 10] = [6, 8, 12, 16, 20, 24, 32, 40, 48, 64];
const CHROMA_RANKS: [usize; 8] = [2, 4, 6, 8, 12, 16, 24, 32];
/// Bits of a coefficient with the share of its variance that their quantisation leaves: measured on
/// Laplacian coefficients with the step search of `quantize_plane`.
const BITS: [(u32, f64); 6] = [(2, 0.176), (3, 0.063), (4, 0.0205), (5, 0.0066), (6, 0.0021), (8, 0.00019)];

/// A residual's settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Ranks of luma and the two chroma channels.
    pub ranks: [usize; 3],
    /// Bits per component; its length is the number of components.
    pub bits: Vec<u32>,
    /// Predicted sum of squared errors in the residual's domain.
    pub error: f64,
    /// Bytes of the residual's sections and table entries.
    pub bytes: usize,
}

/// What the plan's prediction needs.
pub struct Planner<'a> {
    models: &'a [LocalPca],
    rotated: &'a Rotated,
    texels: usize,
    /// Variance of component `j` over all texels.
    variances: Vec<f64>,
    /// Energy that no component takes.
    energy: f64,
}

fn aligned(bytes: usize) -> usize {
    bytes.next_multiple_of(ALIGNMENT)
}

impl<'a> Planner<'a> {
    /// A planner over `models`, of `texels` texels.
    pub fn new(models: &'a [LocalPca], rotated: &'a Rotated, texels: usize) -> Planner<'a> {
        let most = models.iter().map(|model| model.variances.len()).max().unwrap_or(0);
        let variances = (0..most).map(|j| models.iter().filter_map(|model| model.variances.get(j)).sum()).collect();
        Planner { models, rotated, texels, variances, energy: models.iter().map(|model| model.energy).sum() }
    }

    /// Components that the models hold.
    pub fn most_components(&self) -> usize {
        self.variances.len()
    }

    /// Energy lost by rank cuts: `[channel][rank index][basis]`, clusters summed, weighted by what each basis carries.
    fn rank_losses(&self, ranks: &[usize], channel: usize) -> Vec<Vec<f64>> {
        ranks
            .iter()
            .map(|&rank| {
                (0..=self.most_components())
                    .map(|index| {
                        self.models
                            .iter()
                            .enumerate()
                            .map(|(cluster, model)| {
                                let carried = if index == 0 {
                                    model.count as f64
                                } else {
                                    model.variances.get(index - 1).copied().unwrap_or(0.0)
                                };
                                carried * self.rotated.lost(cluster, index, channel, rank)
                            })
                            .sum()
                    })
                    .collect()
            })
            .collect()
    }

    /// Bytes of all residual sections with these settings.
    pub fn bytes(&self, ranks: [usize; 3], bits: &[u32]) -> usize {
        let [views, lights] = self.rotated.shape;
        let clusters = self.models.len();
        let even = |count: usize| count.next_multiple_of(2);
        let ranks = ranks.map(|rank| [rank.min(views), rank.min(lights)]);
        let factors = 32 + ranks.iter().map(|[rv, rl]| 2 * (even(views * rv) + even(lights * rl))).sum::<usize>();
        let rows: usize = ranks.iter().map(|rank| rank[0]).sum();
        let core: usize = ranks.iter().map(|rank| rank[0] * rank[1]).sum();
        let basis = 4 + 2 * even(clusters * rows) + (clusters * core).next_multiple_of(4);
        let planes: usize = bits
            .iter()
            .map(|&bits| aligned(8 + 2 * even(clusters) + 4 * self.texels.div_ceil((32 / bits) as usize)))
            .sum();
        // Table entries: 32 bytes a section, 4 bytes a tier; rounded up with the header's own alignment.
        let entries = 32 * (2 + 2 * bits.len()) + 4 * (1 + bits.len());
        aligned(factors) + (1 + bits.len()) * aligned(basis) + planes + entries.next_multiple_of(ALIGNMENT) + ALIGNMENT
    }

    /// A plan with given settings.
    pub fn fixed(&self, ranks: [usize; 3], bits: Vec<u32>) -> Plan {
        let losses: Vec<f64> =
            (0..3).map(|c| self.rank_losses(&[ranks[c]], c)[0][..=bits.len()].iter().sum::<f64>()).collect();
        let error = self.coding_error(&bits) + losses.iter().sum::<f64>();
        Plan { bytes: self.bytes(ranks, &bits), ranks, bits, error }
    }

    fn coding_error(&self, bits: &[u32]) -> f64 {
        let noise = |bits: u32| BITS.iter().find(|(b, _)| *b == bits).map_or(1.0, |(_, share)| *share);
        let kept: f64 = bits.iter().zip(&self.variances).map(|(&b, variance)| variance * (1.0 - noise(b))).sum();
        (self.energy - kept).max(0.0)
    }

    /// Every reasonable plan with at most `most` components: for each noise level the components above it
    /// with just enough bits [reverse water-filling], at each pair of ranks.
    fn candidates(&self, most: usize) -> Vec<Plan> {
        let side = self.rotated.shape[0].max(self.rotated.shape[1]);
        let reachable = |ranks: &[usize]| -> Vec<usize> {
            let mut list: Vec<usize> = ranks.iter().copied().filter(|rank| *rank < side).collect();
            if list.len() < ranks.len() {
                list.push(side);
            }
            list
        };
        let (luma, chroma) = (reachable(&LUMA_RANKS), reachable(&CHROMA_RANKS));
        let luma_losses = self.rank_losses(&luma, 0);
        let chroma_losses: Vec<Vec<f64>> = {
            let (a, b) = (self.rank_losses(&chroma, 1), self.rank_losses(&chroma, 2));
            a.iter().zip(&b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a + b).collect()).collect()
        };
        let top = self.variances.iter().fold(0.0f64, |top, x| top.max(*x)).max(1e-30);
        let mut bit_lists: Vec<Vec<u32>> = vec![Vec::new()];
        for step in 0..60 {
            let level = top * 0.8f64.powi(step) * 0.5;
            let bits: Vec<u32> = self
                .variances
                .iter()
                .take(most)
                .take_while(|variance| BITS[0].1 * **variance > level * 0.35)
                .map(|variance| BITS.iter().find(|(_, share)| share * variance <= level).map_or(8, |(bits, _)| *bits))
                .collect();
            if !bit_lists.contains(&bits) {
                bit_lists.push(bits);
            }
        }
        let mut plans = Vec::new();
        for bits in &bit_lists {
            for (i, &luma) in luma.iter().enumerate() {
                for (k, &chroma) in chroma.iter().enumerate() {
                    if chroma > luma {
                        continue;
                    }
                    let ranks = [luma, chroma, chroma];
                    let lost = |losses: &[f64]| losses[..=bits.len()].iter().sum::<f64>();
                    let error = self.coding_error(bits) + lost(&luma_losses[i]) + lost(&chroma_losses[k]);
                    plans.push(Plan { ranks, bits: bits.clone(), error, bytes: self.bytes(ranks, bits) });
                }
            }
        }
        plans
    }

    /// The plan of least error within `bytes`, if any fits.
    pub fn within_bytes(&self, bytes: usize, most: usize) -> Option<Plan> {
        self.candidates(most)
            .into_iter()
            .filter(|plan| plan.bytes <= bytes)
            .min_by(|a, b| a.error.total_cmp(&b.error).then(a.bytes.cmp(&b.bytes)))
    }

    /// The smallest plan with at most `error`, if any reaches it.
    pub fn within_error(&self, error: f64, most: usize) -> Option<Plan> {
        self.candidates(most)
            .into_iter()
            .filter(|plan| plan.error <= error)
            .min_by(|a, b| a.bytes.cmp(&b.bytes).then(a.error.total_cmp(&b.error)))
    }

    /// The plan of least error whatever its size.
    pub fn best(&self, most: usize) -> Option<Plan> {
        self.candidates(most).into_iter().min_by(|a, b| a.error.total_cmp(&b.error))
    }
}
