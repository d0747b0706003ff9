//! Fits a coarse texel: decodes the finest level at a sample of the measured pairs and finds the cluster, lobes and
//! coefficients nearest to a mean of such values.

use crate::asset::asset::{Layer, LobeRole};
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::lobe::LobeSetup;
use crate::asset::lobe_tables::lobe_sum_at_pairs;
use crate::levels::cluster::{Candidate, Cluster, OwnLobes, bases_at};
use crate::levels::footprint::spread;
use crate::numeric::algebra::{descend, gram_of};
use crate::numeric::in_vectors::in_vectors;
use crate::numeric::quantize::byte_from_weight;
use crate::numeric::vector::dot_slices;
use crate::resident::expansion::Expansion;
use crate::threads::{Threads, map};
use pulp::{Simd, WithSimd};

/// Largest number of measured pairs at which a level is fitted, chosen evenly. They give three numbers each, against at
/// most 128 unknowns: with half as many pairs leather's levels are 1.2 to 2.1 dB worse, with half as many more 0.5 to
/// 1.3 dB better and take 1.6 times as long.
const MAX_PAIRS: usize = 768;
/// Number added to a value before its tone weighs the errors of the lobes, as in `btf-fit`.
const TONE_FLOOR: f32 = 0.02;
/// Number of sweeps of coordinate descent over lobes.
const LOBE_SWEEPS: usize = 40;
/// Number of sweeps of coordinate descent over coefficients, which are nearly orthogonal.
const COEFFICIENT_SWEEPS: usize = 8;
/// Largest code of a coefficient.
pub(super) const MAX_CODE: f32 = 127.0;

/// A fitted texel of a level.
#[derive(Debug, Clone)]
pub(super) struct MipTexel {
    /// Linear values at the sampled pairs, `[pair, rgb]`; empty when no coarser level needs them any more.
    pub mean: Vec<f32>,
    pub cluster: u8,
    pub lobe_refs: Vec<LobeRef>,
    /// Codes of the coefficients.
    pub codes: Vec<i8>,
}

/// A layer prepared for fitting: its clusters evaluated at the sampled pairs.
pub(super) struct Fitter<'a> {
    pub layer: &'a Layer,
    pub first_refs: Vec<usize>,
    /// Weight of each pair's errors where lobes are fitted: the slope of the root curve.
    pub tones: Vec<f32>,
    pub clusters: Vec<Cluster>,
    /// Largest number of lobes that a texel has.
    pub most_lobes: usize,
    pub samples: usize,
    pub pairs: Vec<usize>,
    /// Lobes of the levels' own cluster, which is the last one; `None` until it has its bases.
    pub own: Option<OwnLobes>,
}

impl<'a> Fitter<'a> {
    pub(super) fn new(layer: &'a Layer, threads: Threads) -> Fitter<'a> {
        let all = layer.views.len() * layer.lights.len();
        let count = all.min(MAX_PAIRS);
        let pairs: Vec<usize> = (0..count).map(|i| spread(i, count, all)).collect();
        let lobe_at = |setup: &LobeSetup, pair: usize| {
            let (view, light) = ((pair / layer.lights.len()) as u32, (pair % layer.lights.len()) as u32);
            setup.eval(layer.lights.direction(light), layer.views.direction(view))
        };
        let table = |setup: LobeSetup| pairs.iter().map(|pair| lobe_at(&setup, *pair)).collect();
        let expansion = Expansion::of_layer(layer);
        let bases = layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
        let clusters = map(threads, layer.dictionary.len(), |cluster| {
            let dictionary: &Vec<DictionaryLobe> = &layer.dictionary[cluster];
            let mut made = Cluster {
                lobes: dictionary.iter().map(|entry| table(entry.lobe.setup())).collect(),
                scales: dictionary.iter().map(|entry| entry.weight_scale).collect(),
                ..Cluster::default()
            };
            if let Some(expansion) = &expansion {
                made.set_bases(bases_at(expansion, bases, cluster, &pairs, layer.lights.len()));
            }
            made
        });
        let mut first = 0;
        let first_refs = layer.texel_lobe_counts.iter().map(|count| {
            first += usize::from(*count);
            first - usize::from(*count)
        });
        let mut fitter = Fitter {
            layer,
            first_refs: first_refs.collect(),
            tones: Vec::new(),
            clusters,
            most_lobes: layer.most_lobes(),
            samples: 3 * count,
            pairs,
            own: None,
        };
        fitter.weigh_tones();
        fitter
    }

    /// Weighs every pair by the slope of the root curve at the mean of some texels, so that highlights do not dominate.
    fn weigh_tones(&mut self) {
        let texels = self.layer.texel_clusters.len();
        let some = texels.min(256);
        let mut mean = vec![0.0f32; self.samples / 3];
        for i in 0..some {
            let values = self.decoded(spread(i, some, texels));
            mean.iter_mut().zip(values.chunks_exact(3)).for_each(|(mean, rgb)| *mean += rgb.iter().sum::<f32>());
        }
        let tone = |sum: &f32| (sum / (3 * some.max(1)) as f32 + TONE_FLOOR).powf(1.0 / 2.4 - 1.0);
        self.tones = mean.iter().map(tone).collect();
        for cluster in &mut self.clusters {
            let toned = |lobe: &Vec<f32>| lobe.iter().zip(&self.tones).map(|(x, tone)| x * tone).collect();
            cluster.toned = cluster.lobes.iter().map(toned).collect();
            cluster.toned_gram = gram_of(&cluster.toned);
        }
    }

    /// Encodes linear values in the residual's curve.
    pub(super) fn encoded(&self, values: Vec<f32>) -> Vec<f32> {
        in_vectors(Encoded { layer: self.layer, values })
    }

    /// Subtracts the lobes from encoded values.
    pub(super) fn left_by_lobes(&self, cluster: &Cluster, refs: &[LobeRef], encoded: &[f32]) -> Vec<f32> {
        let mut left = self.encoded(self.lobe_sums(cluster, refs));
        left.iter_mut().zip(encoded).for_each(|(left, x)| *left = x - *left);
        left
    }

    /// Returns whether lobes are part of the value, and do not only guide.
    pub(super) fn lobes_count(&self) -> bool {
        self.layer.lobe_role != LobeRole::Guide || self.layer.residual.is_none()
    }

    /// Sums lobes, as far as they are part of the value: `[pair, rgb]`.
    #[inline(always)]
    fn lobe_sums(&self, cluster: &Cluster, refs: &[LobeRef]) -> Vec<f32> {
        let mut sum = vec![0.0; self.samples];
        if self.lobes_count() {
            lobe_sum_at_pairs(refs, &cluster.scales, &cluster.lobes, &mut sum);
        }
        sum
    }

    pub(super) fn refs(&self, texel: usize) -> &[LobeRef] {
        let first = self.first_refs[texel];
        &self.layer.lobe_refs[first..first + usize::from(self.layer.texel_lobe_counts[texel])]
    }

    /// Decodes a texel of the finest level to linear values.
    pub(super) fn decoded(&self, texel: usize) -> Vec<f32> {
        let layer = self.layer;
        let cluster = &self.clusters[usize::from(layer.texel_clusters[texel])];
        let weighted: Vec<(usize, f32)> = layer.residual.as_ref().map_or_else(Vec::new, |residual| {
            let codes = residual.coefficients.iter().map(|plane| f32::from(plane.codes[texel]));
            codes.enumerate().filter(|(_, code)| *code != 0.0).collect()
        });
        in_vectors(Decoded { fitter: self, cluster, refs: self.refs(texel), weighted: &weighted })
    }

    /// Returns the weights of a cluster's lobes that approximate the values best, RGB.
    pub(super) fn nearest_weights(&self, cluster: &Cluster, values: &[f32]) -> Vec<[f32; 3]> {
        let count = cluster.lobes.len();
        let products: [Vec<f32>; 3] = [0, 1, 2].map(|channel| {
            let toned: Vec<f32> =
                values.chunks_exact(3).zip(&self.tones).map(|(rgb, tone)| rgb[channel] * tone).collect();
            cluster.toned.iter().map(|lobe| dot_slices(lobe, &toned)).collect()
        });
        let mut weights = vec![[0.0; 3]; count];
        // The second time with the most important ones alone.
        for _ in 0..2 {
            let kept = self.most_important(cluster, &weights);
            for channel in 0..3 {
                let within =
                    |_, i: usize, x: f32| if kept.contains(&i) { x.clamp(0.0, cluster.scales[i]) } else { 0.0 };
                let (found, _) = descend(&cluster.toned_gram, &products[channel], LOBE_SWEEPS, within);
                weights.iter_mut().zip(found).for_each(|(weight, x)| weight[channel] = x);
            }
        }
        weights
    }

    /// Returns the numbers of the most important lobes, as many as a texel of the finest level may have; all lobes
    /// where none has a weight.
    fn most_important(&self, cluster: &Cluster, weights: &[[f32; 3]]) -> Vec<usize> {
        let count = weights.len();
        let importance =
            |i: &usize| weights[*i].iter().sum::<f32>() * cluster.toned_gram[i * count + i].max(0.0).sqrt();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| importance(b).total_cmp(&importance(a)).then(a.cmp(b)));
        if weights.iter().any(|weight| *weight != [0.0; 3]) {
            order.truncate(self.most_lobes);
        }
        order
    }

    /// Quantises the most important lobes, the most important first.
    pub(super) fn refs_of(&self, cluster: &Cluster, weights: &[[f32; 3]]) -> Vec<LobeRef> {
        let refs = self.most_important(cluster, weights).into_iter().map(|i| LobeRef {
            lobe: i as u8,
            weight: weights[i].map(|weight| byte_from_weight(weight, cluster.scales[i])),
        });
        refs.filter(|reference| reference.weight != [0; 3]).collect()
    }

    /// Fits a texel: chooses the cluster among `candidates` that approximates the values best, with its lobes and
    /// coefficients. Its lobes are the mean of the covered texels' lobes in that cluster or, where that is better and the
    /// bases do not hold the whole value, the nearest to the values. The first components tell what is better.
    pub(super) fn fit(&self, mean: Vec<f32>, candidates: &[Candidate]) -> MipTexel {
        let encoded = self.encoded(mean.clone());
        let mut best: Option<Choice> = None;
        let mut offer = |cluster: u8, refs: Vec<LobeRef>| {
            let choice = self.choice(cluster, refs, &encoded);
            if best.as_ref().is_none_or(|best| choice.error < best.error) {
                best = Some(choice);
            }
        };
        for candidate in candidates {
            let cluster = &self.clusters[usize::from(candidate.cluster)];
            offer(candidate.cluster, self.refs_of(cluster, &candidate.weights));
            if self.lobes_count() && !cluster.lobes.is_empty() && self.layer.lobe_weights.is_none() {
                offer(candidate.cluster, self.refs_of(cluster, &self.nearest_weights(cluster, &mean)));
            }
        }
        let Some(Choice { cluster, lobe_refs, left, .. }) = best else {
            return MipTexel { mean, cluster: 0, lobe_refs: Vec::new(), codes: Vec::new() };
        };
        let components = &self.clusters[usize::from(cluster)].components;
        let products = components.products(components.count, &left);
        let (codes, _) = descend_to_codes(&components.gram, &products);
        MipTexel { mean, cluster, lobe_refs, codes: codes.iter().map(|x| *x as i8).collect() }
    }

    /// Tells how well the first components of a cluster follow encoded values beside its lobes.
    fn choice(&self, number: u8, lobe_refs: Vec<LobeRef>, encoded: &[f32]) -> Choice {
        let cluster = &self.clusters[usize::from(number)];
        let mut left = self.left_by_lobes(cluster, &lobe_refs, encoded);
        left.iter_mut().zip(&cluster.mean).for_each(|(left, x)| *left -= x);
        let products = cluster.components.products(cluster.first_gram.len().isqrt(), &left);
        let (_, gain) = descend_to_codes(&cluster.first_gram, &products);
        Choice { error: dot_slices(&left, &left) - gain, cluster: number, lobe_refs, left }
    }
}

/// Returns the codes of the coefficients that follow encoded values best, given their products with the components, and by
/// how much they reduce the squared error.
fn descend_to_codes(gram: &[f32], products: &[f32]) -> (Vec<f32>, f32) {
    descend(gram, products, COEFFICIENT_SWEEPS, |sweep, _, x| {
        let x = x.clamp(-MAX_CODE, MAX_CODE);
        if sweep + 1 == COEFFICIENT_SWEEPS { x.round() } else { x }
    })
}

/// The arguments of [`Fitter::encoded`], for [`pulp`].
struct Encoded<'a> {
    layer: &'a Layer,
    values: Vec<f32>,
}

impl WithSimd for Encoded<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Vec<f32> {
        let Layer { residual_kind, epsilon, .. } = self.layer;
        residual_kind.encode_slice(&mut self.values, *epsilon);
        self.values
    }
}

/// What [`Fitter::decoded`] sums, for [`pulp`].
struct Decoded<'a> {
    fitter: &'a Fitter<'a>,
    cluster: &'a Cluster,
    refs: &'a [LobeRef],
    /// Components and their codes, where these are not 0.
    weighted: &'a [(usize, f32)],
}

impl WithSimd for Decoded<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let Layer { residual_kind, epsilon, .. } = self.fitter.layer;
        let mut values = self.fitter.lobe_sums(self.cluster, self.refs);
        residual_kind.encode_slice(&mut values, *epsilon);
        values.iter_mut().zip(&self.cluster.mean).for_each(|(sum, x)| *sum += x);
        self.cluster.components.add(simd, self.weighted, &mut values);
        residual_kind.decode_slice(&mut values, *epsilon);
        values
    }
}

/// A cluster and its lobes, one of those that a coarse texel may have.
struct Choice {
    /// Squared error that the first components leave.
    error: f32,
    cluster: u8,
    lobe_refs: Vec<LobeRef>,
    /// Encoded values without the lobes and the cluster's mean.
    left: Vec<f32>,
}
