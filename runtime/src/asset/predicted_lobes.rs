//! Lobes whose weights follow from a texel's residual coefficients, so that a texel has lobes of its own at no bytes, and
//! the part of the value that such lobes take over from the residual.
//!
//! The residual of a layer with predicted weights holds the whole value, as where lobes only guide: `g(X) ~ g(0) + R(z)`
//! with the texel's coefficients z. Its lobes S(z) become the base of the value without a change of what is stored: a
//! decoder subtracts from R the affine function of z that is nearest to `g(S(z)) - g(0)` over some texels of the
//! cluster, the *nodes*, and adds `g(S(z))`. What is left of the lobes in the value at measured directions is only
//! their departure from that affine function; between measured directions they are evaluated exactly.

use crate::asset::asset::Layer;
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::limits::MAX_REFS_PER_BYTE;
use crate::asset::lobe::Lobe;
use crate::asset::lobe_tables::lobe_tables;
use crate::asset::lobe_weights::{LobeWeights, nearest_affine};
use crate::numeric::quantize::weight_from_byte;

impl Layer {
    /// Sets the lobe references of every texel to those that its coefficients predict. A layer without predicted
    /// weights stays as it is.
    ///
    /// Cost: a multiplication for each texel, lobe, channel and unit.
    pub fn predict_lobes(&mut self) {
        if let Some(weights) = &self.lobe_weights {
            (self.texel_lobe_counts, self.lobe_refs) = self.predicted_lobes(weights, &self.coefficient_planes());
        }
    }

    /// Returns whether references may follow from weights, where cluster ids, dictionary and weights take `bytes` bytes.
    pub(crate) fn may_predict_lobes(&self, bytes: usize) -> bool {
        let most = |cluster: &u8| self.dictionary.get(usize::from(*cluster)).map_or(0, Vec::len);
        self.texel_clusters.iter().map(most).sum::<usize>() <= MAX_REFS_PER_BYTE * bytes
    }

    /// Returns whether the lobe references of all texels are those that their coefficients predict.
    pub(crate) fn has_predicted_lobes(&self) -> bool {
        self.lobe_weights.as_ref().is_some_and(|weights| {
            let (counts, references) = self.predicted_lobes(weights, &self.coefficient_planes());
            counts == self.texel_lobe_counts && references == self.lobe_refs
        })
    }

    /// Returns how many lobes each texel refers to, and the references, where `weights` predict them. `planes` are the
    /// codes of the first components, `[component][texel]`, as many as are at hand; others count as 0.
    pub(crate) fn predicted_lobes(&self, weights: &LobeWeights, planes: &[&[i8]]) -> (Vec<u8>, Vec<LobeRef>) {
        let firsts = first_lobes(&self.dictionary);
        let (mut counts, mut all) = (Vec::with_capacity(self.texel_clusters.len()), Vec::new());
        for (texel, cluster) in self.texel_clusters.iter().enumerate() {
            let cluster = usize::from(*cluster);
            let inputs = weights.inputs(planes, texel);
            let references = weights.references(firsts[cluster], self.dictionary[cluster].len(), &inputs);
            counts.push(references.len() as u8);
            all.extend(references);
        }
        (counts, all)
    }

    /// Returns the coefficient codes of the layer's components, `[component][texel]`.
    pub fn coefficient_planes(&self) -> Vec<&[i8]> {
        let planes = self.residual.iter().flat_map(|residual| &residual.coefficients);
        planes.map(|plane| plane.codes.as_slice()).collect()
    }

    /// Returns the nodes of `cluster`; `None` where its lobes take nothing from the bases.
    ///
    /// Cost: with n nodes, m lobes and p inputs `n (m p + p^2) + p^3` multiply-adds.
    pub(crate) fn lobe_nodes(&self, cluster: usize) -> Option<LobeNodes> {
        let weights = self.lobe_weights.as_ref()?;
        let lobes = &self.dictionary[cluster];
        let nodes = weights.nodes.get(cluster).filter(|nodes| !nodes.is_empty() && !lobes.is_empty())?;
        self.residual.as_ref()?;
        let first = first_lobes(&self.dictionary)[cluster];
        let mut of_lobes = vec![[0.0f32; 3]; nodes.len() * lobes.len()];
        for (node, of_lobes) in nodes.iter().zip(of_lobes.chunks_exact_mut(lobes.len())) {
            for reference in weights.references(first, lobes.len(), node) {
                let lobe = usize::from(reference.lobe);
                of_lobes[lobe] = reference.weight.map(|q| weight_from_byte(q.into(), lobes[lobe].weight_scale));
            }
        }
        let inputs = weights.units.len();
        Some(LobeNodes { lobes: lobes.len(), inputs, weights: of_lobes, rows: nearest_affine(nodes, inputs) })
    }

    /// Returns what a decoder subtracts from the bases of `cluster` because its lobes give it: `[pair, rgb][1 +
    /// inputs]`, for the mean and for a code of 1 of each component that weights depend on, with the number of these.
    /// `None` where nothing is subtracted.
    ///
    /// Cost: with n nodes of the cluster, m lobes and p inputs, `n (m + p)` multiply-adds and n powers a pair and
    /// channel.
    pub(crate) fn taken_by_lobes(&self, cluster: usize) -> Option<(usize, Vec<f32>)> {
        self.lobe_weights.as_ref()?;
        let lobes: Vec<Lobe> = self.dictionary[cluster].iter().map(|entry| entry.lobe).collect();
        self.taken_at(cluster, &lobe_tables(&lobes, &self.views, &self.lights))
    }

    /// Returns what a decoder subtracts at some pairs, as `Layer::taken_by_lobes` does at all; `tables` are the lobes'
    /// values there, `[lobe][pair]`.
    pub fn taken_at(&self, cluster: usize, tables: &[Vec<f32>]) -> Option<(usize, Vec<f32>)> {
        let nodes = self.lobe_nodes(cluster)?;
        let columns = 1 + nodes.inputs;
        let mut values = vec![0.0f32; 3 * tables[0].len()];
        let mut taken = vec![0.0f32; values.len() * columns];
        let nothing = self.residual_kind.encode(0.0, self.epsilon);
        for (weights, row) in nodes.weights.chunks_exact(nodes.lobes).zip(nodes.rows.chunks_exact(columns)) {
            values.fill(0.0);
            for (weights, table) in weights.iter().zip(tables) {
                for (sum, lobe) in values.chunks_exact_mut(3).zip(table) {
                    (0..3).for_each(|c| sum[c] += weights[c] * lobe);
                }
            }
            self.residual_kind.encode_slice(&mut values, self.epsilon);
            for (taken, value) in taken.chunks_exact_mut(columns).zip(&values) {
                taken.iter_mut().zip(row).for_each(|(sum, weight)| *sum += weight * (value - nothing));
            }
        }
        Some((nodes.inputs, taken))
    }
}

/// The nodes of a cluster, as the bases' expansion takes them.
pub(crate) struct LobeNodes {
    /// Number of lobes.
    pub lobes: usize,
    /// Number of coefficients that weights depend on.
    pub inputs: usize,
    /// Weights of the lobes, `[node][lobe]`, linear RGB.
    pub weights: Vec<[f32; 3]>,
    /// Factors by which values at the nodes give the nearest affine function of the coefficients, `[node][1 + inputs]`.
    pub rows: Vec<f32>,
}

/// Returns the number of each cluster's first lobe among those of all dictionaries.
pub fn first_lobes(dictionary: &[Vec<DictionaryLobe>]) -> Vec<usize> {
    dictionary
        .iter()
        .scan(0, |next, lobes| {
            let first = *next;
            *next += lobes.len();
            Some(first)
        })
        .collect()
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
    use crate::testing::sample_predicted_asset;

    fn predicted(seed: u64) -> Asset {
        sample_predicted_asset(seed, 16, 12, ResidualKind::Root)
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
    fn lobes_do_not_depend_on_the_components_that_are_kept() {
        let asset = predicted(2);
        let trimmed = asset.trimmed(1, usize::MAX);
        assert_eq!(trimmed.layers[0].lobe_refs, asset.layers[0].lobe_refs);
        assert_eq!(trimmed.layers[0].lobe_weights, asset.layers[0].lobe_weights);
        assert_eq!(Asset::parse(&pack(&trimmed).unwrap()).unwrap(), trimmed);
    }

    #[test]
    fn fewer_lobes_take_less_from_the_residual() {
        let asset = predicted(4);
        let trimmed = asset.trimmed(usize::MAX, 1);
        assert!(trimmed.layers[0].has_predicted_lobes() && trimmed.most_lobes() == 1);
        let (_, all) = asset.layers[0].taken_by_lobes(0).unwrap();
        let (_, some) = trimmed.layers[0].taken_by_lobes(0).unwrap();
        assert!(some[0] < all[0], "{} {}", some[0], all[0]);
    }

    /// The coefficients that weights depend on come first in a file: with every one of them the lobes come nearer to
    /// those of the whole file.
    #[test]
    fn tiers_without_a_residual_have_lobes_of_the_coefficients_at_hand() {
        let asset = predicted(5);
        let bytes = pack(&asset).unwrap();
        let tiers = crate::read_directory(&bytes).unwrap().tiers;
        let at = |tier: usize| Asset::parse(&bytes[..tiers[tier] as usize]).unwrap().layers.remove(0);
        assert!((0..3).all(|tier| at(tier).residual.is_none()));
        assert_ne!(at(0).lobe_refs, at(1).lobe_refs);
        assert_ne!(at(1).lobe_refs, asset.layers[0].lobe_refs);
        for tier in 2..tiers.len() {
            assert_eq!(at(tier).lobe_refs, asset.layers[0].lobe_refs, "{tier}");
            assert_eq!(at(tier).lobe_weights, asset.layers[0].lobe_weights, "{tier}");
            assert_eq!(at(tier).residual.map_or(0, |residual| residual.bases.len()), tier - 2, "{tier}");
        }
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
