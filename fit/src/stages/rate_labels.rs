//! Clusters by error and bytes: at a given quantisation step a texel goes where its error and the bits of its
//! coefficients and of its cluster id together are least.

use crate::stages::local_pca::{LocalPca, local_pca, renumber};
use ndarray::{ArrayView2, s};
use rayon::prelude::*;

/// Components of a cluster that are looked at.
const COMPONENTS: usize = 48;
/// Root mean square, in steps, of a component's coefficients from which on it is coded.
const MIN_RMS: f64 = 0.45;
/// Squared error, in squared steps, that a bit must take away.
const BIT: f32 = 0.07;
/// Price, in squared steps, of each of the four next texels that is of another cluster.
const CHANGE: f32 = 0.7;
/// Squared error of a rounded coefficient, in squared steps.
const ROUNDING: f32 = 1.0 / 12.0;
/// Clusters that a texel chooses from: those of least error and bits.
const CANDIDATES: usize = 4;
/// Rounds of models and labels, and sweeps over the texels in each.
const ROUNDS: usize = 2;
const SWEEPS: usize = 4;
/// Bits of predicted coefficients relative to those of Gaussian ones.
const PREDICTED_SHARE: f64 = 0.6;
/// Share of the bits of coefficients in a file.
const COEFFICIENT_SHARE: f64 = 0.5;

/// Goal of a fit, per texel.
#[derive(Debug, Clone, Copy)]
pub enum TexelGoal {
    /// Bytes of the file.
    Bytes(f64),
    /// Squared error over all samples, in the residual's curve.
    Error(f64),
}

/// Returns about the step at which clusters with these models reach a goal.
pub fn step_for<'a>(models: impl IntoIterator<Item = &'a LocalPca>, goal: TexelGoal) -> f64 {
    let models: Vec<&LocalPca> = models.into_iter().collect();
    let texels = models.iter().map(|model| model.members.len()).sum::<usize>().max(1) as f64;
    let greatest = models.iter().flat_map(|model| &model.variances).fold(1e-12f64, |most, x| most.max(*x));
    // log2 of a step that is too fine, and of one that is too coarse.
    let mut exponents = [greatest.log2() / 2.0 - 24.0, greatest.log2() / 2.0];
    for _ in 0..40 {
        let middle = 0.5 * (exponents[0] + exponents[1]);
        let square = (2.0 * middle).exp2();
        let (mut bits, mut error) = (0.0, 0.0);
        for model in &models {
            let members = model.members.len() as f64;
            for variance in &model.variances {
                let of_texel = variance / members.max(1.0) / square;
                bits += members * 0.5 * (1.0 + 12.0 * of_texel).log2() * f64::from(u8::from(of_texel > 0.2));
                error += members * square * of_texel.min(1.0 / 12.0);
            }
        }
        let is_fine = match goal {
            TexelGoal::Bytes(bytes) => PREDICTED_SHARE * bits / texels > 8.0 * COEFFICIENT_SHARE * bytes,
            TexelGoal::Error(most) => error / texels < most,
        };
        exponents[usize::from(!is_fine)] = middle;
    }
    exponents[1].exp2()
}

/// Moves texels, in rows of `width`, to the clusters where they cost least at `step`; clusters that lose all their texels
/// vanish. Returns the number of clusters.
///
/// Cost: `4 texels x dimensions x clusters x components` floating-point operations a round.
pub fn assign_by_rate(scores: ArrayView2<f32>, labels: &mut [u32], clusters: usize, width: usize, step: f64) -> usize {
    let mut clusters = clusters;
    for _ in 0..ROUNDS {
        let models = local_pca(scores, labels, clusters, COMPONENTS);
        let candidates = candidates(scores, &models, step);
        for sweep in 0..SWEEPS {
            let before = labels.to_vec();
            labels.par_chunks_mut(width).enumerate().for_each(|(row, labels)| {
                for (column, label) in
                    labels.iter_mut().enumerate().filter(|(column, _)| (column + row + sweep) % 2 == 0)
                {
                    let at = row * width + column;
                    let others = [
                        (column > 0).then(|| at - 1),
                        (column + 1 < width).then_some(at + 1),
                        at.checked_sub(width),
                        Some(at + width).filter(|below| *below < before.len()),
                    ];
                    let cost = |(cluster, cost): &(u32, f32)| {
                        let alike = others.iter().flatten().filter(|other| before[**other] == *cluster).count();
                        cost - CHANGE * alike as f32
                    };
                    let best = candidates[at].iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
                    *label = best.map_or(*label, |best| best.0);
                }
            });
        }
        clusters = renumber(labels, clusters);
    }
    clusters
}

/// Returns of each texel the clusters where it costs least, with the costs in squared steps.
fn candidates(scores: ArrayView2<f32>, models: &[LocalPca], step: f64) -> Vec<[(u32, f32); CANDIDATES]> {
    let mut all = vec![[(0, f32::INFINITY); CANDIDATES]; scores.nrows()];
    let scale = (1.0 / step) as f32;
    all.par_chunks_mut(1024).enumerate().for_each(|(chunk, all)| {
        let rows = scores.slice(s![chunk * 1024..chunk * 1024 + all.len(), ..]);
        for (cluster, model) in models.iter().enumerate().filter(|(_, model)| !model.members.is_empty()) {
            let texels = model.members.len() as f64;
            let coded = |variance: &&f64| (**variance / texels).sqrt() > MIN_RMS * step;
            let count = model.variances.iter().take_while(coded).count();
            let centred = (&rows - &model.mean) * scale;
            let taken = centred.dot(&model.components.slice(s![.., ..count]));
            for ((row, taken), best) in centred.rows().into_iter().zip(taken.rows()).zip(all.iter_mut()) {
                let mut cost = row.dot(&row) - taken.dot(&taken);
                for x in taken {
                    cost += (x * x).min(ROUNDING + BIT * (1.0 + 2.0 * (1.0 + x.abs()).log2()));
                }
                // Sorted, the least first.
                let at = best.partition_point(|(_, other)| *other <= cost);
                if at < CANDIDATES {
                    best[at..].rotate_right(1);
                    best[at] = (cluster as u32, cost);
                }
            }
        }
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// Two clusters of flat texels with noise, in two halves; every ninth texel begins in the wrong one.
    #[test]
    fn a_texel_between_two_clusters_goes_with_its_neighbours() {
        let width = 30;
        let truth = |texel: usize| u32::from(texel % width >= width / 2);
        let noise = |texel: usize| ((texel * 7919 % 101) as f32 - 50.0) / 50.0;
        let scores = Array2::from_shape_fn((width * 20, 2), |(texel, c)| {
            if c == 0 { 2.0 * truth(texel) as f32 + 1.2 * noise(texel) } else { noise(texel * 31 + 5) }
        });
        let start: Vec<u32> = (0..width * 20).map(|texel| truth(texel) ^ u32::from(texel % 9 == 0)).collect();
        let wrong = |labels: &[u32]| {
            let count = labels.iter().enumerate().filter(|(texel, label)| **label != truth(*texel)).count();
            count.min(labels.len() - count)
        };
        let mut labels = start.clone();
        assert_eq!(assign_by_rate(scores.view(), &mut labels, 2, width, 1.5), 2);
        assert!(wrong(&labels) < 10, "{}", wrong(&labels));
        // Planted difference: the same texels, scattered, have no neighbours to go with.
        let at = |texel: usize| texel * 37 % (width * 20);
        let scattered = Array2::from_shape_fn((width * 20, 2), |(texel, c)| scores[[at(texel), c]]);
        let mut labels: Vec<u32> = (0..width * 20).map(|texel| start[at(texel)]).collect();
        assign_by_rate(scattered.view(), &mut labels, 2, width, 1.5);
        let mut back = vec![0; labels.len()];
        labels.iter().enumerate().for_each(|(texel, label)| back[at(texel)] = *label);
        assert!(wrong(&back) > 20, "{}", wrong(&back));
    }

    #[test]
    fn the_step_follows_the_goal() {
        let scores =
            Array2::from_shape_fn((500, 3), |(i, c)| ((i * (c + 3) * 37 % 101) as f32 - 50.0) / (c + 1) as f32);
        let models = local_pca(scores.view(), &[0; 500], 1, 3);
        let [few, many] = [2.0, 4.0].map(|bytes| step_for(&models, TexelGoal::Bytes(bytes)));
        assert!(many < 0.7 * few, "{few} {many}");
        let [rough, exact] = [10.0, 0.1].map(|error| step_for(&models, TexelGoal::Error(error)));
        // Three coefficients, a twelfth of a squared step each.
        assert!((exact - (0.1f64 * 4.0).sqrt()).abs() < 0.02 && exact < rough, "{exact} {rough}");
    }
}
