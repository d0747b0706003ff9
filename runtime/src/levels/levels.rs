//! Makes the coarser levels of an asset (a mip chain), each half as wide and high as the one before, for pictures in
//! which a pixel covers several texels.
//!
//! A coarse texel shows the mean of the linear values of the texels that it covers, whatever their clusters. This mean
//! is decoded at a sample of the measured pairs and fitted as a texel of one cluster: lobes' weights, then the
//! residual's coefficients by least squares on the cluster's bases. The cluster is one of those of the covered texels,
//! or one that all levels share, whose bases are the principal ones of a sample of coarse texels, mixed from the
//! layer's shared bases: a mean of texels of two clusters fits neither of the two. Levels share directions,
//! dictionaries and bases; each level adds only its texels. The means of each level come from the values of the finest
//! level, so that errors do not add up.

use crate::asset::asset::{Asset, Level, LevelTexels, level_sizes};
use crate::asset::dictionary::LobeRef;
use crate::asset::heights::Heights;
use crate::levels::cluster::Candidate;
use crate::levels::fitter::{Fitter, MipTexel};
use crate::levels::footprint::footprint;
use crate::levels::own_cluster::make_room;
use crate::threads::{Threads, map};

/// Largest root mean square of the last components that a level leaves out, in the residual's curve: 56 dB below white
/// for the root curve.
const MIN_RMS: f64 = 1.5e-3;

/// Adds the coarser levels to an asset, from half its width and height down to one texel. An asset with levels is
/// returned as it is. Each layer with a residual gets one more cluster, which the levels use, if the format has room
/// for it.
///
/// Cost: the expansion of all bases; then each texel is decoded at up to 768 pairs, and each coarse texel projected
/// onto the bases of a few clusters: about 1.2 MFLOP a texel with 60 components.
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

impl Fitter<'_> {
    /// Makes texel `index` of a grid of `size` from the grid `finer`, which is the finest level where `texels` is
    /// `None`.
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

    /// Makes the texels of all levels. Rows of the first level are made in order, and rows of the others as soon as
    /// they can be, so that only a few rows of each level have their values in memory.
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

    /// Returns the number of components that a level's texels need.
    fn components_of(&self, texels: &[MipTexel]) -> usize {
        let count = texels.first().map_or(0, |texel| texel.codes.len());
        let mut energies = vec![0.0f64; count];
        for texel in texels {
            let gram = &self.clusters[usize::from(texel.cluster)].components.gram;
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

/// Averages the heights of the covered texels, in the level's texel widths.
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
