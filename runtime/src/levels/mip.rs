//! Coarser levels of an asset, each half as wide and high as the one before, for pictures that show several texels in a
//! pixel.
//!
//! A coarse texel shows the mean of the linear values of the texels that it covers, whatever their clusters. This mean is
//! decoded at a sample of the measured pairs and fitted as a texel of one cluster: lobes' weights, then the residual's
//! coefficients by least squares on the cluster's bases. The cluster is one of those of the covered texels or one that all
//! levels have together, whose bases are the principal ones of a sample of coarse texels, mixed from the layer's shared
//! bases: what lies between two clusters is foreign to both. Levels share directions, dictionaries and bases; what a level
//! adds is its texels. Each level's means come from the finest level's values, so that errors do not add up.

use crate::asset::asset::{Asset, Layer, Level, LevelTexels, LobeRole, level_sizes};
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::heights::Heights;
use crate::asset::limits::{MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, basis_words};
use crate::asset::lobe::LobeSetup;
use crate::asset::residual::{Residual, expand_core};
use crate::decode::measured::lobe_sum_at_pairs;
use crate::numeric::algebra::{cholesky, descend, dot, gram_of, principal, solve};
use crate::numeric::quantize::{byte_from_weight, weight_from_byte};
use crate::resident::expansion::Expansion;
use crate::threads::{Threads, map};

/// Measured pairs at which a level is fitted, at most; evenly chosen. Three numbers each, against at most 128 unknowns: with half as
/// many pairs leather's levels are 1.2 to 2.1 dB worse, with half as many more 0.5 to 1.3 dB better and take 1.6 times as long.
const MAX_PAIRS: usize = 768;
/// A level does without its last components as long as all that they add has less than this root mean square, in the
/// residual's curve: 56 dB below white for the root curve.
const MIN_RMS: f64 = 1.5e-3;
/// Added to a value whose tone weighs the lobes' errors, as the fitter does.
const TONE_FLOOR: f32 = 0.02;
/// Sweeps of coordinate descent over lobes, and over coefficients, which are nearly orthogonal.
const LOBE_SWEEPS: usize = 40;
const COEFFICIENT_SWEEPS: usize = 8;
/// Largest code of a coefficient.
const MAX_CODE: f32 = 127.0;
/// Lobes in the dictionary of the levels' own cluster.
const OWN_LOBES: usize = 32;
/// Squares from which that cluster's bases are made, how many and of which side, texels: of the first and second level, and
/// of coarse ones, in whose means differences are lost that finer ones have.
const OWN_SAMPLES: [(usize, usize); 4] = [(640, 2), (256, 4), (128, 16), (64, 64)];
/// Texels of such a square that are averaged, along a side.
const SQUARE_TEXELS: usize = 6;
/// Coefficients may go beyond those of the sample by this factor.
const OWN_RANGE: f32 = 1.3;
/// Largest code of a mixture.
const MAX_MIXTURE_CODE: f32 = 32_000.0;
/// Added to the diagonal of the shared bases' products, relative to its mean.
const RIDGE: f32 = 1e-4;

/// One texel of a level in the making.
#[derive(Debug, Clone)]
struct MipTexel {
    /// Linear values at the sampled pairs, `[pair, rgb]`; empty when no coarser level needs them any more.
    mean: Vec<f32>,
    cluster: u8,
    lobe_refs: Vec<LobeRef>,
    /// Coefficient codes.
    codes: Vec<i8>,
}

/// `asset` with its coarser levels, from half its width and height down to one texel; as it is if it has levels. Each layer with
/// a residual gets one more cluster, which the levels use, if the format has room for it.
///
/// Cost: the expansion of all bases; then each texel is decoded at up to 768 pairs, and each coarse texel projected onto
/// the bases of a few clusters: about 1.2 MFLOP a texel with 60 components.
pub fn with_levels(asset: &Asset, threads: Threads) -> Asset {
    let mut wider = asset.clone();
    let finest = [asset.width, asset.height];
    let sizes = level_sizes(finest);
    if sizes.is_empty() || !asset.levels.is_empty() {
        return wider;
    }
    let mut levels: Vec<Level> =
        sizes.iter().map(|[width, height]| Level { width: *width, height: *height, layers: Vec::new() }).collect();
    for layer in &mut wider.layers {
        let own_lobes = make_room(layer);
        let mut fitter = Fitter::new(layer, threads);
        let mut with_own = None;
        if let (Some(own_lobes), Some(residual)) = (own_lobes, &layer.residual) {
            let residual = fitter.with_own_cluster(residual.clone(), finest, threads);
            fitter.take_own_cluster(own_lobes, &residual);
            with_own = Some(residual);
        }
        let grids = fitter.grids(finest, &sizes, threads);
        for (level, texels) in levels.iter_mut().zip(grids) {
            let size = [level.width, level.height];
            level.layers.push(fitter.texels_of(&texels, finest, size));
        }
        if with_own.is_some() {
            layer.residual = with_own;
        }
    }
    wider.levels = levels;
    wider
}

/// Where each cluster's lobes stand in the dictionary of the levels' own cluster: `[cluster][lobe]`.
type OwnLobes = Vec<Vec<Option<u8>>>;

/// Adds a cluster to a layer, with the lobes that its texels use most and bases of 0; `None` if the format has no room for
/// one more.
fn make_room(layer: &mut Layer) -> Option<OwnLobes> {
    let clusters = layer.dictionary.len();
    let residual = layer.residual.as_mut()?;
    let shared = residual.shared.steps.len();
    if clusters == MAX_CLUSTERS
        || shared == 0
        || basis_words(residual.factors.shape, clusters + 1, residual.bases.len()) > MAX_BASIS_WORDS
    {
        return None;
    }
    for basis in &mut residual.bases {
        basis.steps.push(0.0);
        basis.values.resize(basis.values.len() + shared, 0);
    }
    let mut used: Vec<Vec<u32>> = layer.dictionary.iter().map(|dictionary| vec![0; dictionary.len()]).collect();
    let mut refs = layer.lobe_refs.iter();
    for (cluster, count) in layer.texel_clusters.iter().zip(&layer.texel_lobe_counts) {
        for reference in refs.by_ref().take(usize::from(*count)) {
            used[usize::from(*cluster)][usize::from(reference.lobe)] += 1;
        }
    }
    let lobes =
        |(cluster, counts): (usize, &Vec<u32>)| (0..counts.len()).map(move |lobe| (cluster, lobe)).collect::<Vec<_>>();
    let mut ranked: Vec<(usize, usize)> = used.iter().enumerate().flat_map(lobes).collect();
    ranked.sort_by_key(|(cluster, lobe)| std::cmp::Reverse(used[*cluster][*lobe]));
    ranked.truncate(OWN_LOBES);
    let mut own: OwnLobes = used.iter().map(|counts| vec![None; counts.len()]).collect();
    ranked.iter().enumerate().for_each(|(number, (cluster, lobe))| own[*cluster][*lobe] = Some(number as u8));
    let dictionary = ranked.iter().map(|(cluster, lobe)| layer.dictionary[*cluster][*lobe]).collect();
    layer.dictionary.push(dictionary);
    // Its own lobes are where they are.
    own.push((0..ranked.len()).map(|lobe| Some(lobe as u8)).collect());
    Some(own)
}

/// Number `i` of `count` of 0 to `all`, one from each of as many equal parts, anywhere in it: evenly chosen ones would walk in
/// step with the rows that they are numbered by.
fn spread(i: usize, count: usize, all: usize) -> usize {
    // Knuth's multiplicative hash, its upper bits.
    let part = ((i as u32).wrapping_mul(0x9e37_79b1) ^ 0x5bd1_e995).wrapping_mul(0x85eb_ca6b) >> 8;
    if count == all { i } else { (i * all + ((part as usize * all) >> 24)) / count }
}

/// Cells of a line of `finer` that cell `index` of `count` covers, with their shares, which sum up to 1.
fn footprint(index: usize, count: usize, finer: usize) -> Vec<(usize, f32)> {
    // In cells of the finer line times `count`, so that everything is whole.
    let (begin, end) = (index * finer, (index + 1) * finer);
    (begin / count..end.div_ceil(count))
        .map(|cell| {
            let covered = end.min((cell + 1) * count) - begin.max(cell * count);
            (cell, covered as f32 / finer as f32)
        })
        .collect()
}

/// Quantises the last cluster's mixture of basis `index`.
fn write_mixture(residual: &mut Residual, index: usize, mixture: &[f32]) {
    let peak = mixture.iter().fold(0.0f32, |peak, x| peak.max(x.abs()));
    let step = (peak / MAX_MIXTURE_CODE).clamp(1e-20, MAX_BASIS_STEP);
    let basis = &mut residual.bases[index];
    let first = basis.values.len() - mixture.len();
    basis.values[first..].iter_mut().zip(mixture).for_each(|(q, x)| *q = (x / step).round() as i16);
    if let Some(last) = basis.steps.last_mut() {
        *last = step;
    }
}

/// A cluster at the sampled pairs.
#[derive(Default)]
struct Cluster {
    /// `[pair, rgb]`: the residual's mean.
    mean: Vec<f32>,
    /// `[component][pair, rgb]`, for a code of 1.
    components: Vec<Vec<f32>>,
    gram: Vec<f32>,
    /// `[lobe][pair]`.
    lobes: Vec<Vec<f32>>,
    /// The same times the pair's tone weight, and their products.
    toned: Vec<Vec<f32>>,
    toned_gram: Vec<f32>,
    scales: Vec<f32>,
}

/// A cluster that some of the covered texels have.
struct Candidate {
    cluster: u8,
    /// Those texels' share.
    share: f32,
    /// Weights of the cluster's lobes: the sum over those texels, by share, and then their mean.
    weights: Vec<[f32; 3]>,
}

impl Candidate {
    fn new(cluster: u8, lobes: usize) -> Candidate {
        Candidate { cluster, share: 0.0, weights: vec![[0.0; 3]; lobes] }
    }

    fn add(&mut self, share: f32, refs: &[LobeRef], scales: &[f32]) {
        self.share += share;
        for reference in refs {
            let lobe = usize::from(reference.lobe);
            let weights = reference.weight.map(|q| weight_from_byte(q.into(), scales[lobe]));
            (0..3).for_each(|c| self.weights[lobe][c] += share * weights[c]);
        }
    }
}

/// The bases of a cluster at the sampled pairs, which ascend: `[basis][pair, rgb]`, the mean and the components for a code of 1.
fn bases_at(expansion: &Expansion, bases: usize, cluster: usize, pairs: &[usize], lights: usize) -> Vec<Vec<f32>> {
    let padded = expansion.padded();
    let mut samples = vec![Vec::with_capacity(3 * pairs.len()); bases];
    let mut wanted = pairs.iter().peekable();
    expansion.rows(cluster, |view, rows| {
        while let Some(pair) = wanted.next_if(|pair| **pair / lights == view) {
            for row in rows.chunks_exact(padded).skip(pair % lights * 3).take(3) {
                samples.iter_mut().zip(row).for_each(|(values, x)| values.push(*x));
            }
        }
    });
    samples
}

impl Cluster {
    fn set_bases(&mut self, mut bases: Vec<Vec<f32>>) {
        self.components = bases.split_off(bases.len().min(1));
        self.mean = bases.pop().unwrap_or_default();
        self.gram = gram_of(&self.components);
    }
}

/// A layer at the sampled pairs.
struct Fitter<'a> {
    layer: &'a Layer,
    first_refs: Vec<usize>,
    /// Weight of each pair's errors where lobes are fitted: the slope of the root curve.
    tones: Vec<f32>,
    clusters: Vec<Cluster>,
    /// Lobes of the texel that has most.
    most_lobes: usize,
    samples: usize,
    pairs: Vec<usize>,
    /// Of the levels' own cluster, the last one, once it has its bases.
    own: Option<OwnLobes>,
}

impl<'a> Fitter<'a> {
    fn new(layer: &'a Layer, threads: Threads) -> Fitter<'a> {
        let all = layer.views.len() * layer.lights.len();
        let count = all.min(MAX_PAIRS);
        let pairs: Vec<usize> = (0..count).map(|i| spread(i, count, all)).collect();
        let lobe_at = |setup: &LobeSetup, pair: usize| {
            let (view, light) = ((pair / layer.lights.len()) as u32, (pair % layer.lights.len()) as u32);
            setup.eval(layer.lights.direction(light), layer.views.direction(view))
        };
        let table = |setup: LobeSetup| pairs.iter().map(|pair| lobe_at(&setup, *pair)).collect();
        let expansion = layer.residual.as_ref().map(Expansion::new);
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

    /// Weighs every pair by the slope of the root curve at the mean of some texels, so that highlights do not outweigh
    /// everything.
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

    /// What the lobes leave of encoded values.
    fn left_by_lobes(&self, cluster: &Cluster, refs: &[LobeRef], encoded: &[f32]) -> Vec<f32> {
        let mut left = self.encoded_lobes(cluster, refs);
        left.iter_mut().zip(encoded).for_each(|(left, x)| *left = x - *left);
        left
    }

    /// Whether lobes are part of the value, and do not only guide.
    fn lobes_count(&self) -> bool {
        self.layer.lobe_role == LobeRole::Base || self.layer.residual.is_none()
    }

    /// What the lobes are in the residual's curve, `[pair, rgb]`.
    fn encoded_lobes(&self, cluster: &Cluster, refs: &[LobeRef]) -> Vec<f32> {
        let mut sum = vec![0.0; self.samples];
        if self.lobes_count() {
            lobe_sum_at_pairs(refs, &cluster.scales, &cluster.lobes, &mut sum);
        }
        self.layer.residual_kind.encode_slice(&mut sum, self.layer.epsilon);
        sum
    }

    fn refs(&self, texel: usize) -> &[LobeRef] {
        let first = self.first_refs[texel];
        &self.layer.lobe_refs[first..first + usize::from(self.layer.texel_lobe_counts[texel])]
    }

    /// Linear values of a texel of the finest level.
    fn decoded(&self, texel: usize) -> Vec<f32> {
        let layer = self.layer;
        let cluster = &self.clusters[usize::from(layer.texel_clusters[texel])];
        let mut values = self.encoded_lobes(cluster, self.refs(texel));
        let mut add = |weight: f32, basis: &[f32]| {
            values.iter_mut().zip(basis).for_each(|(sum, x)| *sum += weight * x);
        };
        if let Some(residual) = &layer.residual {
            add(1.0, &cluster.mean);
            for (plane, component) in residual.coefficients.iter().zip(&cluster.components) {
                if plane.codes[texel] != 0 {
                    add(plane.codes[texel].into(), component);
                }
            }
        }
        layer.residual_kind.decode_slice(&mut values, layer.epsilon);
        values
    }

    /// Weights of a cluster's lobes nearest to the values, RGB.
    fn nearest_weights(&self, cluster: &Cluster, values: &[f32]) -> Vec<[f32; 3]> {
        let count = cluster.lobes.len();
        let products: [Vec<f32>; 3] = [0, 1, 2].map(|channel| {
            let toned: Vec<f32> =
                values.chunks_exact(3).zip(&self.tones).map(|(rgb, tone)| rgb[channel] * tone).collect();
            cluster.toned.iter().map(|lobe| dot(lobe, &toned)).collect()
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

    /// Numbers of the lobes that count most, as many as a texel of the finest level may have; all where none has a weight.
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

    /// The most important lobes first, quantised.
    fn refs_of(&self, cluster: &Cluster, weights: &[[f32; 3]]) -> Vec<LobeRef> {
        let refs = self.most_important(cluster, weights).into_iter().map(|i| LobeRef {
            lobe: i as u8,
            weight: weights[i].map(|weight| byte_from_weight(weight, cluster.scales[i])),
        });
        refs.filter(|reference| reference.weight != [0; 3]).collect()
    }

    /// The cluster among `candidates` that comes nearest to the values, with its lobes and coefficients. Lobes that only
    /// guide are the mean of the covered texels' lobes in that cluster; others those, or the nearest to the values, whichever
    /// the residual follows better.
    fn fit(&self, mean: Vec<f32>, candidates: &[Candidate]) -> MipTexel {
        let mut encoded = mean.clone();
        self.layer.residual_kind.encode_slice(&mut encoded, self.layer.epsilon);
        let mut best: Option<(f32, u8, Vec<LobeRef>, Vec<i8>)> = None;
        for candidate in candidates {
            let cluster = &self.clusters[usize::from(candidate.cluster)];
            let mut choices = vec![self.refs_of(cluster, &candidate.weights)];
            if self.lobes_count() {
                choices.push(self.refs_of(cluster, &self.nearest_weights(cluster, &mean)));
            }
            for refs in choices {
                let mut left = self.left_by_lobes(cluster, &refs, &encoded);
                left.iter_mut().zip(&cluster.mean).for_each(|(left, x)| *left -= x);
                let products: Vec<f32> = cluster.components.iter().map(|component| dot(component, &left)).collect();
                let (codes, gain) = descend(&cluster.gram, &products, COEFFICIENT_SWEEPS, |sweep, _, x| {
                    let x = x.clamp(-MAX_CODE, MAX_CODE);
                    if sweep + 1 == COEFFICIENT_SWEEPS { x.round() } else { x }
                });
                let error = dot(&left, &left) - gain;
                if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                    best = Some((error, candidate.cluster, refs, codes.iter().map(|x| *x as i8).collect()));
                }
            }
        }
        let (_, cluster, lobe_refs, codes) = best.unwrap_or_default();
        MipTexel { mean, cluster, lobe_refs, codes }
    }

    /// Texel `index` of a grid of `size` over the grid `finer`, which is the finest level where `texels` is `None`.
    fn texel(&self, index: usize, size: [usize; 2], finer: [usize; 2], texels: Option<&[MipTexel]>) -> MipTexel {
        let columns = footprint(index % size[0], size[0], finer[0]);
        let rows = footprint(index / size[0], size[1], finer[1]);
        let mut mean = vec![0.0f32; self.samples];
        let mut candidates: Vec<Candidate> = Vec::new();
        for (row, tall) in &rows {
            for (column, wide) in &columns {
                let at = row * finer[0] + column;
                let share = wide * tall;
                let mut add = |values: &[f32], cluster: u8, refs: &[LobeRef]| {
                    mean.iter_mut().zip(values).for_each(|(sum, x)| *sum += share * x);
                    let known = candidates.iter().position(|candidate| candidate.cluster == cluster);
                    let candidate = known.unwrap_or_else(|| {
                        candidates.push(Candidate::new(cluster, self.clusters[usize::from(cluster)].lobes.len()));
                        candidates.len() - 1
                    });
                    candidates[candidate].add(share, refs, &self.clusters[usize::from(cluster)].scales);
                };
                match texels {
                    None => add(&self.decoded(at), self.layer.texel_clusters[at], self.refs(at)),
                    Some(texels) => add(&texels[at].mean, texels[at].cluster, &texels[at].lobe_refs),
                }
            }
        }
        if let Some(own_lobes) = &self.own {
            let cluster = self.clusters.len() - 1;
            let mut own = Candidate::new(cluster as u8, self.clusters[cluster].lobes.len());
            for candidate in candidates.iter().filter(|candidate| usize::from(candidate.cluster) < cluster) {
                own.share += candidate.share;
                for (weights, place) in candidate.weights.iter().zip(&own_lobes[usize::from(candidate.cluster)]) {
                    if let Some(place) = place {
                        (0..3).for_each(|c| own.weights[usize::from(*place)][c] += weights[c]);
                    }
                }
            }
            match candidates.iter_mut().find(|candidate| usize::from(candidate.cluster) == cluster) {
                Some(known) => {
                    known.share += own.share;
                    let sums = known.weights.iter_mut().flatten().zip(own.weights.iter().flatten());
                    sums.for_each(|(sum, x)| *sum += x);
                }
                None => candidates.push(own),
            }
        }
        // Sums become means.
        for candidate in &mut candidates {
            candidate.weights.iter_mut().flatten().for_each(|weight| *weight /= candidate.share);
        }
        self.fit(mean, &candidates)
    }

    /// Mean of the linear values of a square of `side` x `side` texels of the finest level, or of some of them.
    fn square(&self, index: usize, size: [usize; 2], side: usize) -> Vec<f32> {
        let across = size[0].div_ceil(side);
        let [column, row] = [index % across * side, index / across * side];
        let taken = side.min(SQUARE_TEXELS);
        let (mut mean, mut count) = (vec![0.0f32; self.samples], 0.0);
        for (y, x) in
            (0..taken).flat_map(|y| (0..taken).map(move |x| (row + y * side / taken, column + x * side / taken)))
        {
            if y < size[1] && x < size[0] {
                mean.iter_mut().zip(self.decoded(y * size[0] + x)).for_each(|(sum, x)| *sum += x);
                count += 1.0;
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= count);
        mean
    }

    /// The residual whose last cluster's mean and components are the principal bases of coarse texels, as mixtures of shared
    /// bases.
    fn with_own_cluster(&self, mut residual: Residual, size: [usize; 2], threads: Threads) -> Residual {
        let own = &self.clusters[self.clusters.len() - 1];
        let shared = map(threads, residual.shared.steps.len(), |basis| {
            let expanded = expand_core(&residual.factors, &residual.shared.core(basis));
            self.pairs.iter().flat_map(|pair| [0, 1, 2].map(|c| expanded[3 * pair + c])).collect::<Vec<f32>>()
        });
        let count = shared.len();
        let mut gram = gram_of(&shared);
        let ridge = RIDGE * (0..count).map(|i| gram[i * count + i]).sum::<f32>() / count as f32;
        (0..count).for_each(|i| gram[i * count + i] += ridge);
        let Some(factor) = cholesky(&gram, count) else { return residual };

        // Coordinates of coarse texels along the shared bases.
        let mut points: Vec<Vec<f32>> = Vec::new();
        for (samples, side) in OWN_SAMPLES {
            let squares = size[0].div_ceil(side) * size[1].div_ceil(side);
            let taken = squares.min(samples);
            points.extend(map(threads, taken, |i| {
                let mean = self.square(spread(i, taken, squares), size, side);
                let refs =
                    if self.lobes_count() { self.refs_of(own, &self.nearest_weights(own, &mean)) } else { Vec::new() };
                let mut encoded = mean;
                self.layer.residual_kind.encode_slice(&mut encoded, self.layer.epsilon);
                let left = self.left_by_lobes(own, &refs, &encoded);
                solve(&factor, shared.iter().map(|basis| dot(basis, &left)).collect())
            }));
        }
        let mut mean = vec![0.0f32; count];
        for point in &points {
            mean.iter_mut().zip(point).for_each(|(sum, x)| *sum += x / points.len() as f32);
        }
        points.iter_mut().for_each(|point| point.iter_mut().zip(&mean).for_each(|(x, mean)| *x -= mean));
        let components = principal(&points, residual.coefficients.len());

        write_mixture(&mut residual, 0, &mean);
        for (j, component) in components.iter().enumerate() {
            let peak = points.iter().map(|point| dot(point, component).abs()).fold(0.0, f32::max);
            // Coefficients share their step with the other clusters'; where its range is too small, the basis is longer.
            let reach = MAX_CODE * residual.coefficients[j].step;
            let longer = if reach > 0.0 { (OWN_RANGE * peak / reach).max(1.0) } else { 1.0 };
            write_mixture(&mut residual, j + 1, &component.iter().map(|x| x * longer).collect::<Vec<_>>());
        }
        residual
    }

    /// From now on texels may be of the own cluster, whose bases `residual` has.
    fn take_own_cluster(&mut self, lobes: OwnLobes, residual: &Residual) {
        let last = self.clusters.len() - 1;
        let (expansion, lights) = (Expansion::new(residual), self.layer.lights.len());
        self.clusters[last].set_bases(bases_at(&expansion, residual.bases.len(), last, &self.pairs, lights));
        self.own = Some(lobes);
    }

    /// The texels of all levels. Rows of the first level are made in order, and rows of the others as soon as they can,
    /// so that the values of a few rows of each level are in memory.
    fn grids(&self, finest: [usize; 2], sizes: &[[usize; 2]], threads: Threads) -> Vec<Vec<MipTexel>> {
        let mut grids: Vec<Vec<MipTexel>> = vec![Vec::new(); sizes.len()];
        for _ in 0..sizes.first().map_or(0, |size| size[1]) {
            for level in 0..sizes.len() {
                let size = sizes[level];
                let (finer, grid) = grids.split_at_mut(level);
                let (finer_size, finer) = match finer.last_mut() {
                    None => (finest, None),
                    Some(texels) => (sizes[level - 1], Some(texels)),
                };
                let row = grid[0].len() / size[0];
                // Rows of the finer grid before this one's and before the next one's.
                let [begin, end] = [row * finer_size[1] / size[1], ((row + 1) * finer_size[1]).div_ceil(size[1])];
                let there = finer.as_ref().is_none_or(|texels| texels.len() >= end * finer_size[0]);
                if row == size[1] || !there {
                    break;
                }
                let known = finer.as_ref().map(|texels| texels.as_slice());
                let made = map(threads, size[0], |x| self.texel(row * size[0] + x, size, finer_size, known));
                grid[0].extend(made);
                if let Some(texels) = finer {
                    // The last row may be the next one's first.
                    let done = if ((row + 1) * finer_size[1]).is_multiple_of(size[1]) { end } else { end - 1 };
                    texels[begin * finer_size[0]..done * finer_size[0]]
                        .iter_mut()
                        .for_each(|texel| texel.mean = Vec::new());
                }
            }
        }
        grids
    }

    /// Components that a level's texels cannot do without.
    fn components_of(&self, texels: &[MipTexel]) -> usize {
        let count = texels.first().map_or(0, |texel| texel.codes.len());
        let mut energies = vec![0.0f64; count];
        for texel in texels {
            let gram = &self.clusters[usize::from(texel.cluster)].gram;
            for (j, code) in texel.codes.iter().enumerate() {
                energies[j] += f64::from(*code).powi(2) * f64::from(gram[j * count + j]);
            }
        }
        let most = MIN_RMS * MIN_RMS * (texels.len() * self.samples) as f64;
        let mut left = 0.0;
        let dropped = energies.iter().rev().take_while(|energy| {
            left += **energy;
            left < most
        });
        count - dropped.count()
    }

    fn texels_of(&self, texels: &[MipTexel], finest: [usize; 2], size: [usize; 2]) -> LevelTexels {
        LevelTexels {
            // Heights are in widths of square texels.
            heights: (size[0] * finest[1] == size[1] * finest[0])
                .then(|| self.layer.heights.as_ref().map(|heights| coarser_heights(heights, finest, size)))
                .flatten(),
            clusters: texels.iter().map(|texel| texel.cluster).collect(),
            lobe_counts: texels.iter().map(|texel| texel.lobe_refs.len() as u8).collect(),
            lobe_refs: texels.iter().flat_map(|texel| texel.lobe_refs.iter().copied()).collect(),
            codes: (0..self.components_of(texels))
                .map(|j| texels.iter().map(|texel| texel.codes[j]).collect())
                .collect(),
        }
    }
}

/// Mean heights of the covered texels, in the level's texel widths.
fn coarser_heights(heights: &Heights, finest: [usize; 2], size: [usize; 2]) -> Heights {
    let codes = (0..size[0] * size[1]).map(|texel| {
        let mut mean = 0.0;
        for (row, tall) in footprint(texel / size[0], size[1], finest[1]) {
            for (column, wide) in footprint(texel % size[0], size[0], finest[0]) {
                mean += tall * wide * f32::from(heights.codes[row * finest[0] + column]);
            }
        }
        mean.round() as i8
    });
    Heights { step: heights.step * size[0] as f32 / finest[0] as f32, codes: codes.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::decode;
    use crate::decode::options::DecodeOptions;
    use crate::pack;
    use crate::resident::resident::Resident;
    use crate::testing::{sample_asset, sample_heights};
    use crate::threads::serial;

    fn levels_of(asset: &Asset) -> (Resident, Vec<Asset>) {
        let wider = with_levels(asset, &serial);
        (Resident::from_asset(&wider), (1..=wider.levels.len()).map(|number| wider.level(number)).collect())
    }

    /// An asset whose residual seldom makes a value negative, which no decoder shows.
    fn tame_asset(seed: u64, width: usize, height: usize, kind: ResidualKind, role: LobeRole) -> Asset {
        let mut asset = sample_asset(seed, width, height, kind);
        let layer = &mut asset.layers[0];
        layer.lobe_role = role;
        let residual = layer.residual.as_mut().unwrap();
        residual.shared.steps.iter_mut().for_each(|step| *step *= 0.2);
        asset
    }

    #[test]
    fn footprints_cover_every_cell_once() {
        for (count, finer) in [(1, 1), (3, 6), (3, 7), (2, 5), (1, 9)] {
            let mut covered = vec![0.0; finer];
            for index in 0..count {
                let cells = footprint(index, count, finer);
                let sum: f32 = cells.iter().map(|(_, share)| share).sum();
                assert!((sum - 1.0).abs() < 1e-6);
                cells.iter().for_each(|(cell, share)| covered[*cell] += share);
            }
            let even = count as f32 / finer as f32;
            assert!(covered.iter().all(|x| (x - even).abs() < 1e-6), "{covered:?}");
        }
        assert_eq!(footprint(1, 2, 5), [(2, 0.2), (3, 0.4), (4, 0.4)]);
    }

    /// Mean squared error, root domain, of a level's texels against the mean of what they cover at measured pairs.
    fn error_of(resident: &Resident, asset: &Asset, level: u32, texel_of: impl Fn(usize) -> (u32, u32)) -> f64 {
        let options = DecodeOptions { parallax: false, ..DecodeOptions::default() };
        let layer = &asset.layers[0];
        let [width, height] = resident.size(level).map(|side| side as usize);
        let (mut sum, mut count) = (0.0, 0);
        for texel in 0..width * height {
            for pair in (0..layer.views.len() * layer.lights.len()).step_by(7) {
                let wo = layer.views.direction((pair / layer.lights.len()) as u32);
                let wi = layer.lights.direction((pair % layer.lights.len()) as u32);
                let mut mean = [0.0f32; 3];
                for (row, tall) in footprint(texel / width, height, asset.height) {
                    for (column, wide) in footprint(texel % width, width, asset.width) {
                        let value = decode(resident, 0, (row * asset.width + column) as u32, wi, wo, &options);
                        (0..3).for_each(|c| mean[c] += tall * wide * value[c]);
                    }
                }
                let (layer_number, shown) = texel_of(texel);
                let value = decode(resident, layer_number, shown, wi, wo, &options);
                for c in 0..3 {
                    let curve = |x: f32| f64::from(x + 0.01).powf(1.0 / 2.4);
                    sum += (curve(mean[c]) - curve(value[c])).powi(2);
                    count += 1;
                }
            }
        }
        sum / f64::from(count)
    }

    #[test]
    fn a_level_shows_the_mean_of_what_it_covers() {
        for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
            for role in [LobeRole::Base, LobeRole::Guide] {
                let asset = tame_asset(50 + seed as u64, 12, 10, kind, role);
                let (resident, levels) = levels_of(&asset);
                assert_eq!(
                    levels.iter().map(|level| [level.width, level.height]).collect::<Vec<_>>(),
                    [[6, 5], [3, 2], [1, 1]]
                );
                for level in 1..=3u32 {
                    let error = error_of(&resident, &asset, level, |texel| (level, texel as u32));
                    // Planted difference: the texel in the middle of the footprint.
                    let [width, height] = resident.size(level).map(|side| side as usize);
                    let nearest = error_of(&resident, &asset, level, |texel| {
                        let middle = |index: usize, count: usize, finer: usize| (2 * index + 1) * finer / (2 * count);
                        let row = middle(texel / width, height, asset.height);
                        (0, (row * asset.width + middle(texel % width, width, asset.width)) as u32)
                    });
                    eprintln!("{kind:?} {role:?} level {level}: {error:.2e}, nearest texel {nearest:.2e}");
                    assert!(error < 0.85 * nearest, "{kind:?} {role:?} {level}: {error} {nearest}");
                }
            }
        }
    }

    #[test]
    fn what_is_chosen_keeps_no_step_with_rows() {
        for (count, all, row) in
            [(384, 64 * 64, 64), (384, 128 * 128, 128), (256, 256 * 256, 256), (640, 128 * 128, 128)]
        {
            let chosen: Vec<usize> = (0..count).map(|i| spread(i, count, all)).collect();
            assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]) && chosen[count - 1] < all);
            let columns: std::collections::BTreeSet<usize> = chosen.iter().map(|at| at % row).collect();
            assert!(columns.len() > row / 2, "{} of {row} columns", columns.len());
            // Planted difference: even steps.
            let even: std::collections::BTreeSet<usize> = (0..count).map(|i| i * all / count % row).collect();
            assert!(even.len() < row / 2, "{}", even.len());
        }
        assert_eq!((0..5).map(|i| spread(i, 5, 5)).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn an_even_asset_is_the_same_at_every_level() {
        let mut asset = tame_asset(7, 8, 8, ResidualKind::Root, LobeRole::Base);
        let layer = &mut asset.layers[0];
        layer.texel_clusters.fill(1);
        layer.texel_lobe_counts.fill(2);
        let pair = [layer.lobe_refs[0], LobeRef { lobe: 3, weight: [40, 50, 60] }];
        layer.lobe_refs = (0..64).flat_map(|_| pair).collect();
        for plane in &mut layer.residual.as_mut().unwrap().coefficients {
            plane.codes.fill(9);
        }
        let (resident, levels) = levels_of(&asset);
        for level in 1..=3u32 {
            let error = error_of(&resident, &asset, level, |texel| (level, texel as u32));
            eprintln!("level {level}: {error:.2e}");
            assert!(error < 2e-6);
        }
        // Each is an asset that can be written and read.
        for level in &levels {
            assert_eq!(&Asset::parse(&pack(level).unwrap()).unwrap(), level);
        }
    }

    #[test]
    fn heights_keep_their_size_in_the_world() {
        let mut asset = sample_asset(4, 16, 16, ResidualKind::Root);
        asset.layers[0].heights = Some(sample_heights(4, 256));
        asset.layers[0].heights.as_mut().unwrap().codes.fill(40);
        let step = asset.layers[0].heights.as_ref().unwrap().step;
        let (_, levels) = levels_of(&asset);
        let coarse = levels[1].layers[0].heights.as_ref().unwrap();
        assert_eq!((coarse.step, coarse.codes.as_slice()), (step / 4.0, &[40i8; 16][..]));
    }

    #[test]
    fn threads_change_nothing() {
        let asset = sample_asset(9, 7, 9, ResidualKind::Root);
        let backwards = with_levels(&asset, &|n, work| (0..n).rev().for_each(work));
        assert_eq!(with_levels(&asset, &serial), backwards);
    }
}
