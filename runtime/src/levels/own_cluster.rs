//! The cluster that all coarser levels share: a mean of texels of two clusters of the finest level fits neither of the
//! two.

use crate::asset::asset::Layer;
use crate::asset::limits::{MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, basis_words};
use crate::asset::residual::{Residual, expand_core};
use crate::levels::bases::Bases;
use crate::levels::cluster::{OwnLobes, bases_at};
use crate::levels::fitter::{Fitter, MAX_CODE};
use crate::levels::footprint::spread;
use crate::numeric::algebra::{cholesky, principal, solve};
use crate::numeric::vector::dot_slices;
use crate::resident::expansion::Expansion;
use crate::threads::{Threads, map};

/// Number of lobes in the dictionary of the levels' own cluster.
const OWN_LOBES: usize = 32;
/// Squares of texels from which the bases of the levels' own cluster are made: (number, side in texels). The first two
/// are of the first and second level; the coarse ones follow, whose means lack the differences that finer ones have.
const OWN_SAMPLES: [(usize, usize); 4] = [(640, 2), (256, 4), (128, 16), (64, 64)];
/// Number of texels along a side of such a square that are averaged.
const SQUARE_TEXELS: usize = 6;
/// Factor by which coefficients may exceed those of the sample.
const OWN_RANGE: f32 = 1.3;
/// Largest code of a mixture.
const MAX_MIXTURE_CODE: f32 = 32_000.0;
/// Ridge added to the diagonal of the shared bases' products, relative to the mean of the diagonal.
const RIDGE: f32 = 1e-4;

/// Adds a cluster to a layer, with the lobes that its texels use most and bases of 0; `None` if the format has no room
/// for another cluster.
pub(super) fn make_room(layer: &mut Layer) -> Option<OwnLobes> {
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
    // Bases that hold the whole value do not span what lobes would take from it, so there the cluster has none.
    ranked.truncate(if layer.lobe_weights.is_some() { 0 } else { OWN_LOBES });
    let mut own: OwnLobes = used.iter().map(|counts| vec![None; counts.len()]).collect();
    ranked.iter().enumerate().for_each(|(number, (cluster, lobe))| own[*cluster][*lobe] = Some(number as u8));
    let dictionary = ranked.iter().map(|(cluster, lobe)| layer.dictionary[*cluster][*lobe]).collect();
    layer.dictionary.push(dictionary);
    // Its own lobes are where they are.
    own.push((0..ranked.len()).map(|lobe| Some(lobe as u8)).collect());
    Some(own)
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

impl Fitter<'_> {
    /// Averages the linear values of a square of `side` x `side` texels of the finest level, or of a sample of them.
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

    /// Returns the residual with the bases of its last cluster: mean and components are the principal bases of coarse
    /// texels, as mixtures of shared bases.
    pub(super) fn with_own_cluster(&self, mut residual: Residual, size: [usize; 2], threads: Threads) -> Residual {
        let own = &self.clusters[self.clusters.len() - 1];
        let shared = map(threads, residual.shared.steps.len(), |basis| {
            let expanded = expand_core(&residual.factors, &residual.shared.core(basis));
            self.pairs.iter().flat_map(|pair| [0, 1, 2].map(|c| expanded[3 * pair + c])).collect::<Vec<f32>>()
        });
        let count = shared.len();
        let shared = Bases::new(&shared);
        let mut gram = shared.gram.clone();
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
                let left = self.left_by_lobes(own, &refs, &self.encoded(mean));
                solve(&factor, shared.products(count, &left))
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
            let peak = points.iter().map(|point| dot_slices(point, component).abs()).fold(0.0, f32::max);
            // Coefficients share their step with the other clusters'; where its range is too small, the basis is
            // longer.
            let reach = MAX_CODE * residual.coefficients[j].step;
            let longer = if reach > 0.0 { (OWN_RANGE * peak / reach).max(1.0) } else { 1.0 };
            write_mixture(&mut residual, j + 1, &component.iter().map(|x| x * longer).collect::<Vec<_>>());
        }
        residual
    }

    /// Lets texels choose the levels' own cluster from now on; `residual` has its bases.
    pub(super) fn take_own_cluster(&mut self, lobes: OwnLobes, residual: &Residual) {
        let last = self.clusters.len() - 1;
        let (expansion, lights) = (Expansion::new(residual), self.layer.lights.len());
        self.clusters[last].set_bases(bases_at(&expansion, residual.bases.len(), last, &self.pairs, lights));
        self.own = Some(lobes);
    }
}
