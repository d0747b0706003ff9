//! Expands the bases of a residual over all measured pairs, from the file form to the resident form.
//!
//! A basis of cluster k is `sum_q m_kq U S_q W^T` for each channel of the colour frame, with the mixture m, the shared
//! cores S and the factors U and W. The bases of a cluster are made together: first their cores, from the few entries
//! of S that are not 0, then the view factor, then the light factor and RGB. Each step sums weighted rows with the
//! basis as the innermost index, which is also the order of the resident form. Twin, as a compute pass:
//! `resident/expansion.wgsl`, over `expansion_input.rs`.

use crate::asset::asset::Layer;
use crate::asset::limits::channel_words;
use crate::asset::residual::{COLOUR_FRAME, Residual};
use crate::numeric::in_vectors::in_vectors;
use pulp::{Simd, WithSimd};

/// Unit of the length of rows: a multiple of this fills SIMD vectors of every width.
pub(crate) const LANES: usize = 16;
/// Number of SIMD vectors that one pass over the terms of a sum keeps in registers.
const BLOCK: usize = 6;

/// Largest size of a number of a basis in the colour frame, so that what follows from it is finite.
const MAX_VALUE: f32 = 65504.0;

/// The parts of an expansion that all clusters share.
pub(crate) struct Expansion<'a> {
    residual: &'a Residual,
    /// Layer whose lobes give a part of the residual that they are to be subtracted from.
    layer: Option<&'a Layer>,
    pub channels: [Channel; 3],
    /// Length of a row: the bases, padded.
    row: usize,
}

/// One channel of the colour frame.
pub(crate) struct Channel {
    /// View rank, light rank.
    pub ranks: [usize; 2],
    /// View factors, `[view, view rank]`; the light factors follow, `[light, light rank]`.
    pub view: Vec<f32>,
    pub light: Vec<f32>,
    /// Index of the first term of each core entry, and at last the number of all terms.
    pub starts: Vec<usize>,
    /// Terms: value of a shared core that is not 0, and number of the shared basis.
    pub terms: Vec<(f32, usize)>,
}

impl<'a> Expansion<'a> {
    /// Prepares the expansion of a layer's bases, from which the part that predicted lobes give is subtracted. Returns
    /// `None` where the layer has no residual.
    pub(crate) fn of_layer(layer: &'a Layer) -> Option<Expansion<'a>> {
        Some(Expansion { layer: Some(layer), ..Expansion::new(layer.residual.as_ref()?) })
    }

    /// Prepares the expansion of a residual as it is stored. Cost: a pass over the shared cores.
    pub(crate) fn new(residual: &'a Residual) -> Expansion<'a> {
        let (factors, shared) = (&residual.factors, &residual.shared);
        let core_len = factors.core_len();
        let mut first = 0;
        let channels = [0, 1, 2].map(|channel| {
            let ranks = factors.ranks[channel];
            let (mut starts, mut terms) = (vec![0], Vec::new());
            for entry in first..first + ranks[0] * ranks[1] {
                let values = shared.values.iter().skip(entry).step_by(core_len).zip(&shared.steps).enumerate();
                let products = values.map(|(q, (code, step))| (step * f32::from(*code), q));
                terms.extend(products.filter(|(value, _)| *value != 0.0));
                starts.push(terms.len());
            }
            first += ranks[0] * ranks[1];
            let singles = |halves: &[half::f16]| halves.iter().map(|x| x.to_f32()).collect();
            let [view, light] = [&factors.view[channel], &factors.light[channel]].map(|halves| singles(halves));
            Channel { ranks, view, light, starts, terms }
        });
        Expansion { residual, layer: None, channels, row: residual.bases.len().next_multiple_of(LANES) }
    }

    /// Returns the number of bases that [`Expansion::rows`] gives for each pair and channel, padded by zeros.
    pub(crate) fn padded(&self) -> usize {
        2 * channel_words(self.residual.bases.len())
    }

    /// Returns the number of pairs times that of channels.
    pub(crate) fn entries(&self) -> usize {
        self.residual.factors.shape[0] * self.residual.factors.shape[1] * 3
    }

    /// Returns the mixtures of one cluster, `[shared, row]`; the step of a component's codes is multiplied in.
    pub(crate) fn mixtures(&self, cluster: usize) -> Vec<f32> {
        let shared = self.residual.shared.steps.len();
        let mut mixtures = vec![0.0; shared * self.row];
        for (index, basis) in self.residual.bases.iter().enumerate() {
            let step = if index == 0 { 1.0 } else { self.residual.coefficients[index - 1].step };
            let codes = &basis.values[cluster * shared..(cluster + 1) * shared];
            for (row, code) in mixtures.chunks_exact_mut(self.row).zip(codes) {
                row[index] = step * basis.steps[cluster] * f32::from(*code);
            }
        }
        mixtures
    }

    /// Expands the bases of one cluster, view after view: `take(view, rows)` gets `[light, rgb, basis]`, bases padded.
    ///
    /// Cost: for B bases, V views, L lights, ranks rv and rl and E entries of the shared cores that are not 0, `B (E +
    /// V rl (rv + L))` multiply-adds a channel.
    pub(crate) fn rows(&self, cluster: usize, take: impl FnMut(usize, &[f32])) {
        in_vectors(Rows { expansion: self, cluster, take });
    }

    /// Expands the bases of one cluster into the colour frame: `take(pair, values)` gets `[channel, basis]`, bases padded.
    ///
    /// Cost: that of [`Expansion::rows`], and nine multiply-adds a basis and pair.
    pub(crate) fn frame_rows(&self, cluster: usize, mut take: impl FnMut(usize, &[f32])) {
        let (padded, lights) = (self.padded(), self.residual.factors.shape[1]);
        let mut turned = vec![0.0f32; 3 * padded];
        self.rows(cluster, |view, rows| {
            for (light, rgb) in rows.chunks_exact(3 * padded).enumerate() {
                for (out, frame) in turned.chunks_exact_mut(padded).zip(COLOUR_FRAME) {
                    for (i, out) in out.iter_mut().enumerate() {
                        let value = frame[0] * rgb[i] + frame[1] * rgb[padded + i] + frame[2] * rgb[2 * padded + i];
                        *out = value.clamp(-MAX_VALUE, MAX_VALUE);
                    }
                }
                take(view * lights + light, &turned);
            }
        });
    }
}

struct Rows<'a, T> {
    expansion: &'a Expansion<'a>,
    cluster: usize,
    take: T,
}

impl<T: FnMut(usize, &[f32])> WithSimd for Rows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let Expansion { residual, channels, row, .. } = self.expansion;
        let ([views, lights], row, padded) = (residual.factors.shape, *row, self.expansion.padded());
        let mixtures = self.expansion.mixtures(self.cluster);
        // Of each channel [view, light rank, row]. (Loops, not closures: those would be compiled for narrow vectors.)
        let mut viewed: [Vec<f32>; 3] = Default::default();
        for (channel, viewed) in channels.iter().zip(&mut viewed) {
            let [view_rank, light_rank] = channel.ranks;
            let mut cores = vec![0.0f32; view_rank * light_rank * row];
            for (core, ends) in cores.chunks_exact_mut(row).zip(channel.starts.windows(2)) {
                weighted_rows(simd, channel.terms[ends[0]..ends[1]].iter().copied(), &mixtures, core);
            }
            viewed.resize(views * light_rank * row, 0.0);
            for s in 0..light_rank {
                for view in 0..views {
                    let weights = channel.view[view * view_rank..(view + 1) * view_rank].iter();
                    let terms = weights.enumerate().map(|(r, weight)| (*weight, r * light_rank + s));
                    let at = (view * light_rank + s) * row;
                    weighted_rows(simd, terms, &cores, &mut viewed[at..at + row]);
                }
            }
        }
        let taken = self.expansion.layer.and_then(|layer| layer.taken_by_lobes(self.cluster));
        let stored = self.expansion.residual.bases.len();
        let mut lit = vec![0.0f32; 3 * row];
        let mut rgb = vec![0.0f32; lights * 3 * padded];
        for view in 0..views {
            for (light, rgb) in rgb.chunks_exact_mut(3 * padded).enumerate() {
                for ((channel, viewed), lit) in channels.iter().zip(&viewed).zip(lit.chunks_exact_mut(row)) {
                    let rank = channel.ranks[1];
                    let weights = channel.light[light * rank..(light + 1) * rank].iter();
                    let terms = weights.enumerate().map(|(s, weight)| (*weight, view * rank + s));
                    weighted_rows(simd, terms, viewed, lit);
                }
                for (c, out) in rgb.chunks_exact_mut(padded).enumerate() {
                    let [a, b, d] = [0, 1, 2].map(|channel| COLOUR_FRAME[channel][c]);
                    let (first, others) = lit.split_at(row);
                    let of_channels = first.iter().zip(others).zip(&others[row..]);
                    out.iter_mut().zip(of_channels).for_each(|(out, ((x, y), z))| *out = a * x + b * y + d * z);
                }
            }
            if let Some((inputs, taken)) = &taken {
                let of_view = taken.chunks_exact(1 + inputs).skip(3 * lights * view);
                for (bases, taken) in rgb.chunks_exact_mut(padded).zip(of_view) {
                    bases.iter_mut().zip(taken).take(stored).for_each(|(basis, taken)| *basis -= taken);
                }
            }
            (self.take)(view, &rgb);
        }
    }
}

/// Writes to `out` the sum of `weight * row` over `terms`, which are (weight, number of the row in `rows`). Rows are as
/// long as `out`, a multiple of [`LANES`].
#[inline(always)]
fn weighted_rows<S: Simd>(simd: S, terms: impl Iterator<Item = (f32, usize)> + Clone, rows: &[f32], out: &mut [f32]) {
    let (rows, _) = S::as_simd_f32s(rows);
    let (out, _) = S::as_mut_simd_f32s(out);
    let row = out.len();
    let mut blocks = out.chunks_exact_mut(BLOCK);
    let mut first = 0;
    for block in &mut blocks {
        weighted_block::<S, BLOCK>(simd, terms.clone(), rows, row, first, block);
        first += BLOCK;
    }
    let rest = blocks.into_remainder();
    match rest.len() {
        1 => weighted_block::<S, 1>(simd, terms, rows, row, first, rest),
        2 => weighted_block::<S, 2>(simd, terms, rows, row, first, rest),
        3 => weighted_block::<S, 3>(simd, terms, rows, row, first, rest),
        4 => weighted_block::<S, 4>(simd, terms, rows, row, first, rest),
        5 => weighted_block::<S, 5>(simd, terms, rows, row, first, rest),
        _ => {}
    }
}

/// Sums SIMD vectors `first` to `first + N` of the rows for [`weighted_rows`].
#[inline(always)]
fn weighted_block<S: Simd, const N: usize>(
    simd: S,
    terms: impl Iterator<Item = (f32, usize)>,
    rows: &[S::f32s],
    row: usize,
    first: usize,
    out: &mut [S::f32s],
) {
    let mut sums = [simd.splat_f32s(0.0); N];
    for (weight, number) in terms {
        let weight = simd.splat_f32s(weight);
        let values = &rows[number * row + first..number * row + first + N];
        for i in 0..N {
            sums[i] = simd.mul_add_e_f32s(weight, values[i], sums[i]);
        }
    }
    out.copy_from_slice(&sums);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::{ResidualKind, expand_core};
    use crate::testing::sample_asset;

    #[test]
    fn expanded_bases_are_the_cores_expanded_one_by_one() {
        let asset = sample_asset(11, 6, 5, ResidualKind::Root);
        let residual = asset.layers[0].residual.as_ref().unwrap();
        let expansion = Expansion::new(residual);
        let (bases, lights) = (residual.bases.len(), residual.factors.shape[1]);
        for cluster in 0..asset.layers[0].dictionary.len() {
            let slow: Vec<Vec<f32>> = (0..bases)
                .map(|index| {
                    let step = if index == 0 { 1.0 } else { residual.coefficients[index - 1].step };
                    let expanded = expand_core(&residual.factors, &residual.core(index, cluster));
                    expanded.iter().map(|x| step * x).collect()
                })
                .collect();
            let peak = slow.iter().flatten().fold(0.0f32, |peak, x| peak.max(x.abs()));
            let (mut views, mut foreign) = (0, 0);
            expansion.rows(cluster, |view, rows| {
                views += 1;
                for (entry, row) in rows.chunks_exact(expansion.padded()).enumerate() {
                    for (index, x) in row.iter().enumerate() {
                        let expected = slow.get(index).map_or(0.0, |basis| basis[view * lights * 3 + entry]);
                        assert!(
                            (x - expected).abs() <= 1e-5 * peak,
                            "{cluster} {view} {entry} {index}: {x} {expected}"
                        );
                        // Planted difference: the next view's.
                        let other = slow
                            .get(index)
                            .map_or(0.0, |basis| basis[(view + 1) % residual.factors.shape[0] * lights * 3 + entry]);
                        foreign += usize::from((x - other).abs() > 1e-5 * peak);
                    }
                }
            });
            assert_eq!(views, residual.factors.shape[0]);
            assert!(foreign > 1000, "{foreign}");
        }
    }
}
