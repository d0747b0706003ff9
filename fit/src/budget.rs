//! How many residual components, which ranks and how many bits: the plan of least predicted error
//! within a byte budget, of one layer or of several together, or of least bytes for a predicted PSNR.

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

/// The plans, one per planner, that together have the least error within `bytes` as far as the lower convex
/// hulls of size against error tell: equal slopes everywhere [shoham1988]. What is left over goes to the
/// first layer that can use it. `None` if not even the smallest plans fit. For one planner this is
/// [`Planner::within_bytes`].
pub fn plans_within_bytes(planners: &[Planner], bytes: usize) -> Option<Vec<Plan>> {
    let hulls: Vec<Vec<(usize, f64)>> =
        planners.iter().map(|planner| lower_hull(planner.candidates(planner.most_components()))).collect();
    let mut at = vec![0; hulls.len()];
    let mut left = bytes.checked_sub(hulls.iter().map(|hull| hull[0].0).sum())?;
    // Steps along the hulls, steepest first; a step that does not fit ends its layer's walk.
    let mut open: Vec<usize> = (0..hulls.len()).collect();
    let step = |layer: usize, at: usize| {
        let (from, to) = (hulls[layer].get(at)?, hulls[layer].get(at + 1)?);
        Some((to.0 - from.0, (from.1 - to.1) / (to.0 - from.0) as f64))
    };
    loop {
        open.retain(|&layer| step(layer, at[layer]).is_some_and(|(cost, _)| cost <= left));
        let slope = |layer: usize| step(layer, at[layer]).map_or(0.0, |(_, slope)| slope);
        // The first of equally steep ones.
        let Some(&best) = open.iter().rev().max_by(|a, b| slope(**a).total_cmp(&slope(**b))) else { break };
        left -= step(best, at[best]).map_or(0, |(cost, _)| cost);
        at[best] += 1;
    }
    planners
        .iter()
        .zip(&hulls)
        .zip(&at)
        .map(|((planner, hull), &at)| {
            let room = hull[at].0 + left;
            let plan = planner.within_bytes(room, planner.most_components())?;
            left = room - plan.bytes;
            Some(plan)
        })
        .collect()
}

/// Bytes and error of the plans on the lower convex hull, bytes rising and error falling.
fn lower_hull(mut plans: Vec<Plan>) -> Vec<(usize, f64)> {
    plans.sort_by(|a, b| a.bytes.cmp(&b.bytes).then(a.error.total_cmp(&b.error)));
    let mut hull: Vec<(usize, f64)> = Vec::new();
    for plan in plans {
        let point = (plan.bytes, plan.error);
        if hull.last().is_some_and(|last| last.0 == point.0 || last.1 <= point.1) {
            continue;
        }
        while let [.., a, b] = hull[..] {
            // `b` lies on or above the line from `a` to the new point.
            let through = (b.0 - a.0) as f64 * (point.1 - a.1) - (point.0 - a.0) as f64 * (b.1 - a.1);
            if through > 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, Array2};

    /// One cluster of 1,000 texels, 6 views x 5 lights, components of falling variance times `strength`.
    fn models(strength: f64) -> Vec<LocalPca> {
        let samples = 6 * 5 * 3;
        let wave = |i: usize, j: usize| ((i * (2 * j + 3)) as f32 * 0.37 + j as f32).sin() / (samples as f32).sqrt();
        let variances: Vec<f64> = (0..6).map(|j| strength * 400.0 * 0.5f64.powi(j)).collect();
        vec![LocalPca {
            count: 1000,
            mean: Array1::from_shape_fn(samples, |i| strength.sqrt() as f32 * wave(i, 9)),
            components: Array2::from_shape_fn((samples, 6), |(i, j)| wave(i, j)),
            energy: variances.iter().sum::<f64>() * 1.05,
            variances,
        }]
    }

    fn point(bytes: usize, error: f64) -> Plan {
        Plan { ranks: [1; 3], bits: Vec::new(), error, bytes }
    }

    #[test]
    fn the_hull_keeps_what_no_mixture_of_others_beats() {
        let plans = [(10, 9.0), (20, 8.5), (30, 4.0), (30, 5.0), (40, 4.5), (50, 3.9), (70, 1.0), (80, 1.0)];
        let hull = lower_hull(plans.map(|(bytes, error)| point(bytes, error)).to_vec());
        assert_eq!(hull, [(10, 9.0), (30, 4.0), (70, 1.0)]);
    }

    #[test]
    fn one_layer_alone_gets_what_it_always_got() {
        let models = models(1.0);
        let rotated = Rotated::new(&models, [6, 5]);
        let planner = Planner::new(&models, &rotated, 1000);
        for bytes in [2_000, 3_500, 5_000, 9_000, 1_000_000] {
            let alone = planner.within_bytes(bytes, 6);
            let together = plans_within_bytes(std::slice::from_ref(&planner), bytes).map(|plans| plans[0].clone());
            assert_eq!(alone.is_some(), together.is_some());
            assert_eq!(alone, together);
        }
    }

    #[test]
    fn bytes_go_where_the_error_is_and_the_sum_beats_equal_shares() {
        let (hard, easy) = (models(100.0), models(0.1));
        let (a, b) = (Rotated::new(&hard, [6, 5]), Rotated::new(&easy, [6, 5]));
        let planners = [Planner::new(&hard, &a, 1000), Planner::new(&easy, &b, 1000)];
        let total = 9_000;
        let plans = plans_within_bytes(&planners, total).unwrap();
        assert!(plans[0].bytes + plans[1].bytes <= total && plans[0].bytes > 2 * plans[1].bytes, "{plans:?}");
        let error = |plans: &[Plan]| plans.iter().map(|plan| plan.error).sum::<f64>();
        let equal = [0, 1].map(|layer| planners[layer].within_bytes(total / 2, 6).unwrap());
        assert!(error(&plans) < 0.7 * error(&equal), "{} {}", error(&plans), error(&equal));
        // Every pair of plans: none is much better.
        let best = planners[0].candidates(6).into_iter().filter(|plan| plan.bytes < total).filter_map(|plan| {
            let other = planners[1].within_bytes(total - plan.bytes, 6)?;
            Some(plan.error + other.error)
        });
        let best = best.fold(f64::INFINITY, f64::min);
        assert!(error(&plans) <= 1.15 * best, "{} {best}", error(&plans));
        assert!(plans_within_bytes(&planners, 1_500).is_none());
    }
}
