//! Lobe weights that follow from a texel's residual coefficients, so that a texel has lobes of its own at no bytes, and
//! the part of the value that such lobes take over from the residual.
//!
//! The residual of a layer with predicted weights holds the whole value, as where lobes only guide: `g(X) ~ g(0) + R(z)`
//! with the texel's coefficients z. Its lobes S(z) become the base of the value without a change of what is stored: a
//! decoder subtracts from R the affine function of z that is nearest to `g(S(z)) - g(0)` over some texels of the
//! cluster, the *nodes*, and adds `g(S(z))`. What is left of the lobes in the value at measured directions is only
//! their departure from that affine function; between measured directions they are evaluated exactly.

use crate::asset::asset::Layer;
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::lobe::Lobe;
use crate::asset::lobe_tables::{lobe_sum_at_pairs, lobe_tables};
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
    /// Unit of each coefficient that weights depend on, in its codes, above 0; at most [`MAX_WEIGHT_INPUTS`].
    ///
    /// [`MAX_WEIGHT_INPUTS`]: crate::asset::limits::MAX_WEIGHT_INPUTS
    pub units: Vec<f32>,
    /// Codes q, `[lobe of all dictionaries][channel][1 + units]`.
    pub codes: Vec<i16>,
    /// Coefficient codes of the nodes of each cluster, `[cluster][node]`, each as long as `units`.
    pub nodes: Vec<Vec<Vec<i8>>>,
}

impl LobeWeights {
    /// Returns the nodes of a layer's clusters: at most `count` texels of each, evenly spaced among its texels in their
    /// order. `planes` are the coefficient codes of the components that weights depend on, `[component][texel]`.
    pub fn nodes_of_texels(
        clusters: usize,
        texel_clusters: &[u8],
        planes: &[&[i8]],
        count: usize,
    ) -> Vec<Vec<Vec<i8>>> {
        let mut members = vec![Vec::new(); clusters];
        for (texel, cluster) in texel_clusters.iter().enumerate() {
            members[usize::from(*cluster)].push(texel);
        }
        let node = |texel: usize| planes.iter().map(|plane| plane[texel]).collect();
        members
            .iter()
            .map(|texels: &Vec<usize>| {
                let nodes = count.min(texels.len());
                (0..nodes).map(|i| node(texels[i * texels.len() / nodes])).collect()
            })
            .collect()
    }

    /// Returns the references of a texel with the coefficient codes `inputs`, of which there may be fewer than units,
    /// to the lobes of its cluster. `first` is the number of the cluster's first lobe among those of all dictionaries.
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

impl Layer {
    /// Sets the lobe references of every texel to those that its coefficients predict. A layer without predicted
    /// weights stays as it is.
    ///
    /// Cost: a multiplication for each texel, lobe, channel and unit.
    pub fn predict_lobes(&mut self) {
        if let Some((counts, references)) = self.predicted_lobes() {
            (self.texel_lobe_counts, self.lobe_refs) = (counts, references);
        }
    }

    /// Returns whether the lobe references of all texels are those that their coefficients predict.
    pub(crate) fn has_predicted_lobes(&self) -> bool {
        let predicted = self.predicted_lobes();
        predicted.is_some_and(|(counts, references)| counts == self.texel_lobe_counts && references == self.lobe_refs)
    }

    fn predicted_lobes(&self) -> Option<(Vec<u8>, Vec<LobeRef>)> {
        let weights = self.lobe_weights.as_ref()?;
        let firsts = first_lobes(&self.dictionary);
        let planes = self.coefficient_planes(weights.units.len());
        let (mut counts, mut all) = (Vec::with_capacity(self.texel_clusters.len()), Vec::new());
        let mut inputs = Vec::new();
        for (texel, cluster) in self.texel_clusters.iter().enumerate() {
            inputs.clear();
            inputs.extend(planes.iter().map(|plane| plane[texel]));
            let cluster = usize::from(*cluster);
            let references = weights.references(firsts[cluster], self.dictionary[cluster].len(), &inputs);
            counts.push(references.len() as u8);
            all.extend(references);
        }
        Some((counts, all))
    }

    /// Returns the nodes that follow from the layer's texels, at most `count` of each cluster, without the clusters
    /// behind the last that has any.
    pub(crate) fn nodes_of_texels(&self, count: usize) -> Option<Vec<Vec<Vec<i8>>>> {
        let planes = self.coefficient_planes(self.lobe_weights.as_ref()?.units.len());
        let mut nodes = LobeWeights::nodes_of_texels(self.dictionary.len(), &self.texel_clusters, &planes, count);
        let used = nodes.iter().rposition(|nodes| !nodes.is_empty()).map_or(0, |last| last + 1);
        nodes.truncate(used);
        Some(nodes)
    }

    /// Returns the coefficient codes of the first `most` components, `[component][texel]`.
    fn coefficient_planes(&self, most: usize) -> Vec<&[i8]> {
        let planes = self.residual.iter().flat_map(|residual| &residual.coefficients);
        planes.take(most).map(|plane| plane.codes.as_slice()).collect()
    }

    /// Returns what a decoder subtracts from the bases of `cluster` because its lobes give it: `[pair, rgb][1 +
    /// inputs]`, for the mean and for a code of 1 of each component, with the number of inputs. `None` where nothing is
    /// subtracted.
    ///
    /// Cost: with n nodes of the cluster, m lobes and p inputs, `n (m + p)` multiply-adds and n powers a pair and
    /// channel.
    pub(crate) fn taken_by_lobes(&self, cluster: usize) -> Option<(usize, Vec<f32>)> {
        self.lobe_weights.as_ref()?;
        let lobes: Vec<Lobe> = self.dictionary[cluster].iter().map(|entry| entry.lobe).collect();
        self.taken_at(cluster, &lobe_tables(&lobes, &self.views, &self.lights))
    }

    /// Returns what [`Layer::taken_by_lobes`] does at some pairs; `tables` are the lobes' values there, `[lobe][pair]`.
    pub(crate) fn taken_at(&self, cluster: usize, tables: &[Vec<f32>]) -> Option<(usize, Vec<f32>)> {
        let weights = self.lobe_weights.as_ref()?;
        let lobes = &self.dictionary[cluster];
        let nodes = weights.nodes.get(cluster).filter(|nodes| !nodes.is_empty() && !lobes.is_empty())?;
        let components = self.residual.as_ref()?.coefficients.len();
        let inputs = weights.units.len().min(components);
        let solve = nearest_affine(nodes, inputs);
        let first = first_lobes(&self.dictionary)[cluster];
        let scales: Vec<f32> = lobes.iter().map(|entry| entry.weight_scale).collect();
        let samples = 3 * tables[0].len();
        let columns = 1 + inputs;
        let mut taken = vec![0.0f32; samples * columns];
        let mut values = vec![0.0f32; samples];
        let nothing = self.residual_kind.encode(0.0, self.epsilon);
        for (node, row) in nodes.iter().zip(solve.chunks_exact(columns)) {
            let references = weights.references(first, lobes.len(), &node[..inputs]);
            lobe_sum_at_pairs(&references, &scales, tables, &mut values);
            self.residual_kind.encode_slice(&mut values, self.epsilon);
            for (taken, value) in taken.chunks_exact_mut(columns).zip(&values) {
                taken.iter_mut().zip(row).for_each(|(sum, weight)| *sum += weight * (value - nothing));
            }
        }
        Some((inputs, taken))
    }
}

/// Returns the number of each cluster's first lobe among those of all dictionaries.
pub(crate) fn first_lobes(dictionary: &[Vec<DictionaryLobe>]) -> Vec<usize> {
    dictionary
        .iter()
        .scan(0, |next, lobes| {
            let first = *next;
            *next += lobes.len();
            Some(first)
        })
        .collect()
}

/// Returns the weights `[node][1 + inputs]` by which values at the nodes give the nearest affine function of the first
/// `inputs` codes: its constant and its slopes.
fn nearest_affine(nodes: &[Vec<i8>], inputs: usize) -> Vec<f32> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::{Asset, LobeRole};
    use crate::asset::residual::ResidualKind;
    use crate::decode::measured::{TexelPlace, decode_from_file_form, decode_measured};
    use crate::decode::options::DecodeOptions;
    use crate::file::pack::pack;
    use crate::resident::resident::Resident;
    use crate::testing::{Random, sample_asset};

    /// Returns an asset whose lobe weights depend on two coefficients.
    fn predicted(seed: u64) -> Asset {
        let mut asset = sample_asset(seed, 16, 12, ResidualKind::Root);
        let mut random = Random::new(seed + 100);
        let layer = &mut asset.layers[0];
        layer.lobe_role = LobeRole::Base;
        for lobes in &mut layer.dictionary {
            lobes.truncate(3);
        }
        let lobes: usize = layer.dictionary.iter().map(Vec::len).sum();
        let codes = (0..3 * 3 * lobes).map(|i| if i % 3 == 0 { 30 } else { random.below(21) as i16 - 10 }).collect();
        layer.lobe_weights = Some(LobeWeights { step: 1.0 / 64.0, units: vec![40.0, 60.0], codes, nodes: Vec::new() });
        let nodes = layer.nodes_of_texels(20).unwrap_or_default();
        if let Some(weights) = &mut layer.lobe_weights {
            weights.nodes = nodes;
        }
        layer.predict_lobes();
        asset
    }

    #[test]
    fn predicted_references_and_nodes_of_texels_are_not_stored_and_come_back() {
        let asset = predicted(1);
        let bytes = pack(&asset).unwrap();
        assert_eq!(Asset::parse(&bytes).unwrap(), asset);
        // References and nodes of others are stored.
        let mut own = asset.clone();
        own.layers[0].lobe_refs[5].weight[1] ^= 1;
        if let Some(weights) = &mut own.layers[0].lobe_weights {
            weights.nodes[1][3][0] ^= 1;
        }
        let stored = pack(&own).unwrap();
        assert_eq!(Asset::parse(&stored).unwrap(), own);
        assert!(stored.len() > bytes.len() + 100, "{} {}", stored.len(), bytes.len());
    }

    #[test]
    fn fewer_components_predict_anew() {
        let asset = predicted(2);
        let trimmed = asset.trimmed(1, usize::MAX);
        assert_ne!(trimmed.layers[0].lobe_refs, asset.layers[0].lobe_refs);
        assert!(trimmed.layers[0].has_predicted_lobes());
        assert_eq!(Asset::parse(&pack(&trimmed).unwrap()).unwrap(), trimmed);
    }

    /// The lobes' departure from the affine function that is subtracted is 0 on average over the nodes, because that
    /// function is one of least squares: the mean of the encoded values there is that of the residual alone.
    #[test]
    fn lobes_take_from_the_residual_what_they_give_on_average_over_the_nodes() {
        let asset = predicted(3);
        let layer = &asset.layers[0];
        let mut guide = asset.clone();
        guide.layers[0].lobe_role = LobeRole::Guide;
        guide.layers[0].lobe_weights = None;
        // Planted difference: lobes beside a residual from which nothing was subtracted.
        let mut doubled = asset.clone();
        doubled.layers[0].lobe_weights = None;
        let members: Vec<usize> = (0..asset.texel_count()).filter(|texel| layer.texel_clusters[*texel] == 0).collect();
        let nodes: Vec<usize> =
            (0..20.min(members.len())).map(|i| members[i * members.len() / 20.min(members.len())]).collect();
        let lobes: Vec<_> = layer.dictionary[0].iter().map(|entry| entry.lobe).collect();
        let tables = lobe_tables(&lobes, &layer.views, &layer.lights);
        let encoded = |asset: &Asset| -> Vec<f64> {
            let resident = Resident::from_asset(asset);
            let mut sums = vec![0.0f64; 3 * layer.views.len() * layer.lights.len()];
            let mut values = vec![0.0f32; sums.len()];
            for texel in &nodes {
                let counts = &asset.layers[0].texel_lobe_counts[..*texel];
                let first_ref = counts.iter().map(|count| usize::from(*count)).sum();
                let place = TexelPlace { layer: 0, texel: *texel, first_ref };
                decode_measured(&resident, asset, place, &tables, &DecodeOptions::default(), &mut values);
                layer.residual_kind.encode_slice(&mut values, layer.epsilon);
                sums.iter_mut().zip(&values).for_each(|(sum, x)| *sum += f64::from(*x) / nodes.len() as f64);
                let at = decode_from_file_form(asset, place, 3, 2);
                let pair = 3 * (3 * layer.lights.len() + 2);
                let close =
                    |c: usize| (layer.residual_kind.encode(at[c], layer.epsilon) - values[pair + c]).abs() < 4e-3;
                assert!((0..3).all(close), "{texel}: {at:?} {:?}", &values[pair..pair + 3]);
            }
            sums
        };
        let [own, alone, twice] = [&asset, &guide, &doubled].map(encoded);
        let mean = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - y).abs()).sum::<f64>() / a.len() as f64;
        assert!(mean(&own, &alone) < 5e-3, "{}", mean(&own, &alone));
        assert!(mean(&twice, &alone) > 5e-2, "{}", mean(&twice, &alone));
    }
}
