//! Weights of lobes as functions of a texel's residual coefficients. What a layer makes of them: `predicted_lobes.rs`.

use crate::asset::dictionary::LobeRef;
use crate::numeric::algebra::inverse_of_positive;
use crate::numeric::quantize::byte_from_weight;

/// Added to the diagonal of the nodes' normal matrix, for each node: a direction in which nodes do not differ gets the
/// slope 0.
const RIDGE: f64 = 1e-3;

/// Weights of the lobes of all clusters as functions of a texel's first coefficients.
///
/// With the coefficient codes `c_i`, the weight of a lobe in a channel is its weight scale times `min(1, max(0, u))`,
/// `u = step * (q_0 + sum over i of q_i c_i / unit_i)`.
#[derive(Debug, Clone, PartialEq)]
pub struct LobeWeights {
    /// Step of the codes, relative to the lobes' weight scales.
    pub step: f32,
    /// Unit of each coefficient that weights depend on, in its codes, above 0; at most 16.
    pub units: Vec<f32>,
    /// Codes q, `[lobe of all dictionaries][channel][1 + units]`.
    pub codes: Vec<i16>,
    /// Coefficient codes of the nodes of each cluster, `[cluster][node]`, each as long as `units`.
    pub nodes: Vec<Vec<Vec<i8>>>,
}

impl LobeWeights {
    /// Returns the nodes that follow from a layer's texels: of each cluster at most `count`, evenly spaced among its
    /// texels in their order, without the clusters behind the last that has any. `planes` as in
    /// [`crate::Layer::predict_lobes`].
    pub fn nodes_of_texels(&self, texel_clusters: &[u8], planes: &[&[i8]], count: usize) -> Vec<Vec<Vec<i8>>> {
        let clusters = texel_clusters.iter().map(|cluster| usize::from(*cluster) + 1).max().unwrap_or(0);
        let mut members = vec![Vec::new(); if count == 0 { 0 } else { clusters }];
        if count > 0 {
            texel_clusters.iter().enumerate().for_each(|(texel, k)| members[usize::from(*k)].push(texel));
        }
        members
            .iter()
            .map(|texels: &Vec<usize>| {
                let nodes = count.min(texels.len());
                (0..nodes).map(|i| self.inputs(planes, texels[i * texels.len() / nodes])).collect()
            })
            .collect()
    }

    /// Returns the coefficient codes of a texel that weights depend on, 0 for those that `planes` lacks.
    pub(crate) fn inputs(&self, planes: &[&[i8]], texel: usize) -> Vec<i8> {
        (0..self.units.len()).map(|i| planes.get(i).map_or(0, |plane| plane[texel])).collect()
    }

    /// Returns the references of a texel with the coefficient codes `inputs` to the lobes of its cluster. `first` is the
    /// number of the cluster's first lobe among those of all dictionaries.
    pub fn references(&self, first: usize, lobes: usize, inputs: &[i8]) -> Vec<LobeRef> {
        let scaled: Vec<f64> =
            inputs.iter().zip(&self.units).map(|(code, unit)| f64::from(*code) / f64::from(*unit)).collect();
        let columns = 1 + self.units.len();
        let mut references = Vec::with_capacity(lobes);
        for lobe in 0..lobes {
            let rows = &self.codes[3 * (first + lobe) * columns..];
            let weight = [0, 1, 2].map(|channel| {
                let row = &rows[channel * columns..(channel + 1) * columns];
                let slopes = row[1..].iter().zip(&scaled).map(|(q, z)| f64::from(*q) * z);
                let relative = f64::from(self.step) * slopes.fold(f64::from(row[0]), |sum, x| sum + x);
                byte_from_weight(relative.clamp(0.0, 1.0) as f32, 1.0)
            });
            if weight != [0; 3] {
                references.push(LobeRef { lobe: lobe as u8, weight });
            }
        }
        references
    }
}

/// Returns the weights `[node][1 + inputs]` by which values at the nodes give the nearest affine function of the first
/// `inputs` codes: its constant and its slopes.
pub(crate) fn nearest_affine(nodes: &[Vec<i8>], inputs: usize) -> Vec<f32> {
    let count = nodes.len() as f64;
    let means: Vec<f64> =
        (0..inputs).map(|i| nodes.iter().map(|node| f64::from(node[i])).sum::<f64>() / count).collect();
    let centred: Vec<Vec<f64>> =
        nodes.iter().map(|node| (0..inputs).map(|i| f64::from(node[i]) - means[i]).collect()).collect();
    let mut normal = vec![0.0f64; inputs * inputs];
    for node in &centred {
        for i in 0..inputs {
            for j in 0..inputs {
                normal[i * inputs + j] += node[i] * node[j];
            }
        }
    }
    (0..inputs).for_each(|i| normal[i * inputs + i] += RIDGE * count);
    let inverse = inverse_of_positive(&normal, inputs);
    let mut weights = Vec::with_capacity(nodes.len() * (1 + inputs));
    for node in &centred {
        let slopes: Vec<f64> =
            (0..inputs).map(|i| (0..inputs).map(|j| inverse[i * inputs + j] * node[j]).sum()).collect();
        let back: f64 = slopes.iter().zip(&means).map(|(slope, mean)| slope * mean).sum();
        weights.push((1.0 / count - back) as f32);
        weights.extend(slopes.iter().map(|slope| *slope as f32));
    }
    weights
}
