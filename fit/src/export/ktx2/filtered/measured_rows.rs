//! Values of texels at all measured pairs, in the root curve: of an asset at one of its levels, or of a capture.

use crate::error::FitError;
use crate::input::tile_cache::{Mapping, TileCache};
use btf_runtime::{
    ASSET_LAYERS, Asset, DictionaryLobe, Edits, Layer, LobeRef, LobeRole, Resident, ResidualKind, block,
    lobe_sum_at_pairs, lobe_tables,
};
use half::f16;
use ndarray::{Array2, ArrayView2};
use std::ops::Range;

/// The curve in which textures add up: `x^(1 / 2.4)`.
pub const CURVE: ResidualKind = ResidualKind::Root;

/// Source of texels' values at all measured pairs.
pub trait MeasuredRows: Sync {
    /// Returns the texels in the order in which they are quickest read.
    fn order(&self) -> Vec<u32>;

    /// Returns the values of `texels`, `[texel, (view * lights + light) * 3 + channel]`, in [`CURVE`].
    ///
    /// # Errors
    /// If samples cannot be read.
    fn rows(&self, texels: &[u32]) -> Result<Array2<f32>, FitError>;
}

/// Texels of a level.
struct Texels<'a> {
    clusters: &'a [u8],
    refs: &'a [LobeRef],
    /// Range of each texel's references begins here; one more for the end.
    first_ref: Vec<usize>,
    /// Coefficient codes `[component][texel]`.
    codes: Vec<&'a [i8]>,
}

/// A level of a layer of an asset, edits included.
pub struct AssetRows<'a> {
    layer: &'a Layer,
    texels: Texels<'a>,
    edits: Edits,
    tables: &'a LobeTables,
    /// Expanded bases as pairs of halves, `[cluster, pair, channel, word]`; empty without residual.
    bases: &'a [u32],
    /// Words a pair and channel.
    stride: usize,
}

/// The lobes of a layer at all pairs: of its dictionaries, then of each edit's.
pub struct LobeTables(Vec<Vec<ClusterTables>>);

impl LobeTables {
    /// Evaluates the lobes of layer `number`. Memory: four bytes for each lobe and pair, for the dictionaries and each edit.
    pub fn new(asset: &Asset, number: usize) -> LobeTables {
        let layer = &asset.layers[number];
        let mut tables = vec![tables_of(layer, |entry| *entry)];
        tables.extend(asset.edits.list.iter().map(|edit| tables_of(layer, |entry| edit.lobe(entry))));
        LobeTables(tables)
    }
}

/// The lobes of a cluster at all pairs.
struct ClusterTables {
    values: Vec<Vec<f32>>,
    scales: Vec<f32>,
}

impl<'a> AssetRows<'a> {
    /// Returns level `level` (0 the finest) of layer `number`. `resident` must be `asset`'s, bases not packed, and `tables` the layer's.
    pub fn new(
        asset: &'a Asset,
        resident: &'a Resident,
        tables: &'a LobeTables,
        level: usize,
        number: usize,
    ) -> AssetRows<'a> {
        let layer = &asset.layers[number];
        let finest = [asset.width, asset.height];
        let (clusters, counts, refs, codes, edits) = match level.checked_sub(1) {
            None => {
                let codes = layer.residual.iter().flat_map(|residual| &residual.coefficients);
                let codes = codes.map(|plane| &plane.codes[..]).collect();
                (&layer.texel_clusters, &layer.texel_lobe_counts, &layer.lobe_refs, codes, asset.edits.clone())
            }
            Some(coarse) => {
                let level = &asset.levels[coarse];
                let texels = &level.layers[number];
                let codes = texels.codes.iter().map(|plane| &plane[..]).collect();
                let edits = asset.edits.coarser(finest, [level.width, level.height]);
                (&texels.clusters, &texels.lobe_counts, &texels.lobe_refs, codes, edits)
            }
        };
        let mut first_ref = vec![0];
        counts.iter().for_each(|count| first_ref.push(first_ref[first_ref.len() - 1] + usize::from(*count)));
        let words = resident.words();
        let at = words[ASSET_LAYERS + number] as usize;
        let stride = words[at + block::CHANNEL_WORDS] as usize;
        let count = layer.dictionary.len() * layer.lights.len() * layer.views.len() * 3 * stride;
        let first = words[at + block::BASIS] as usize;
        AssetRows {
            layer,
            texels: Texels { clusters, refs, first_ref, codes },
            edits,
            tables,
            bases: if layer.residual.is_some() { &words[first..first + count] } else { &[] },
            stride,
        }
    }

    fn samples(&self) -> usize {
        self.layer.lights.len() * self.layer.views.len() * 3
    }

    /// Returns the first `count` bases of a cluster, `[basis, sample]`.
    fn bases_of(&self, cluster: usize, count: usize) -> Array2<f32> {
        let samples = self.samples();
        let words = &self.bases[cluster * samples * self.stride..][..samples * self.stride];
        let mut bases = Array2::zeros((count, samples));
        for (sample, words) in words.chunks_exact(self.stride).enumerate() {
            for basis in 0..count {
                let bits = (words[basis / 2] >> (16 * (basis % 2))) as u16;
                bases[[basis, sample]] = f16::from_bits(bits).to_f32();
            }
        }
        bases
    }

    /// Sums the lobes of a texel, with the dictionaries of `edit` (0: none).
    fn lobes(&self, texel: usize, edit: usize, out: &mut [f32]) {
        let tables = &self.tables.0[edit][usize::from(self.texels.clusters[texel])];
        let refs = &self.texels.refs[self.texels.first_ref[texel]..self.texels.first_ref[texel + 1]];
        lobe_sum_at_pairs(refs, &tables.scales, &tables.values, out);
    }

    /// Turns the residual of a texel into its value in [`CURVE`].
    fn finish(&self, texel: usize, row: &mut [f32], [lobes, scratch]: [&mut [f32]; 2]) {
        let (kind, epsilon) = (self.layer.residual_kind, self.layer.epsilon);
        let edit = self.edits.texels.get(texel).map_or(0, |edit| usize::from(*edit));
        let edit = if edit <= self.edits.list.len() { edit } else { 0 };
        let has_residual = !self.bases.is_empty();
        let guide = self.layer.lobe_role == LobeRole::Guide && has_residual;
        lobes.fill(0.0);
        if !guide || edit > 0 {
            self.lobes(texel, 0, lobes);
        }
        if has_residual {
            if guide {
                let nothing = kind.encode(0.0, epsilon);
                row.iter_mut().for_each(|y| *y += nothing);
            } else {
                scratch.copy_from_slice(lobes);
                kind.encode_slice(scratch, epsilon);
                row.iter_mut().zip(scratch.iter()).for_each(|(y, s)| *y += s);
            }
            kind.decode_slice(row, epsilon);
        } else {
            row.iter_mut().zip(lobes.iter()).for_each(|(x, s)| *x = s.max(0.0));
        }
        if edit > 0 {
            // docs/reference/format.md, "Edits".
            let told = &self.edits.list[edit - 1];
            self.lobes(texel, edit, scratch);
            for (i, (x, (s, edited))) in row.iter_mut().zip(lobes.iter().zip(scratch.iter())).enumerate() {
                let kept = told.keep() * (kind.encode(*x, epsilon) - kind.encode(*s, epsilon));
                *x = told.tint[i % 3] * kind.combine(*edited, kept, epsilon);
            }
        }
        CURVE.encode_slice(row, 0.0);
    }
}

/// Returns the lobes of all clusters of `layer`, each `changed`, at all pairs.
fn tables_of(layer: &Layer, changed: impl Fn(&DictionaryLobe) -> DictionaryLobe) -> Vec<ClusterTables> {
    let of_cluster = |dictionary: &Vec<DictionaryLobe>| {
        let entries: Vec<DictionaryLobe> = dictionary.iter().map(&changed).collect();
        let lobes: Vec<_> = entries.iter().map(|entry| entry.lobe).collect();
        let scales = entries.iter().map(|entry| entry.weight_scale).collect();
        ClusterTables { values: lobe_tables(&lobes, &layer.views, &layer.lights), scales }
    };
    layer.dictionary.iter().map(of_cluster).collect()
}

impl MeasuredRows for AssetRows<'_> {
    /// Texels of a cluster together: its bases are unpacked for all of them.
    fn order(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.texels.clusters.len() as u32).collect();
        order.sort_by_key(|texel| self.texels.clusters[*texel as usize]);
        order
    }

    fn rows(&self, texels: &[u32]) -> Result<Array2<f32>, FitError> {
        let samples = self.samples();
        let mut rows = Array2::zeros((texels.len(), samples));
        let mut scratch = [vec![0.0; samples], vec![0.0; samples]];
        let mut done = 0;
        for members in texels.chunk_by(|a, b| self.cluster(*a) == self.cluster(*b)) {
            let mut part = rows.slice_mut(ndarray::s![done..done + members.len(), ..]);
            if !self.bases.is_empty() {
                let count = self.texels.codes.len() + 1;
                let codes = Array2::from_shape_fn((members.len(), count), |(i, basis)| match basis {
                    0 => 1.0,
                    _ => f32::from(self.texels.codes[basis - 1][members[i] as usize]),
                });
                let bases = self.bases_of(self.cluster(members[0]), count);
                ndarray::linalg::general_mat_mul(1.0, &codes, &bases, 0.0, &mut part);
            }
            for (texel, mut row) in members.iter().zip(part.rows_mut()) {
                let [lobes, other] = &mut scratch;
                self.finish(*texel as usize, row.as_slice_mut().unwrap_or_default(), [lobes, other]);
            }
            done += members.len();
        }
        Ok(rows)
    }
}

impl AssetRows<'_> {
    fn cluster(&self, texel: u32) -> usize {
        self.texels.clusters[texel as usize].into()
    }
}

/// A capture whose directions are those of the layer, in its order.
pub struct CaptureRows<'a> {
    cache: &'a TileCache<'a>,
    mapping: Mapping,
}

impl<'a> CaptureRows<'a> {
    /// Returns the rows of the capture in `cache`.
    pub fn new(cache: &'a TileCache<'a>) -> CaptureRows<'a> {
        CaptureRows { cache, mapping: Mapping::new(cache, |x| CURVE.encode(x, 0.0)) }
    }
}

impl MeasuredRows for CaptureRows<'_> {
    fn order(&self) -> Vec<u32> {
        (0..self.cache.texel_count() as u32).collect()
    }

    fn rows(&self, texels: &[u32]) -> Result<Array2<f32>, FitError> {
        let mut rows = Array2::zeros((texels.len(), self.cache.pair_count() * 3));
        // The cache gathers texels in ascending order.
        let mut sorted: Vec<usize> = texels.iter().map(|texel| *texel as usize).collect();
        sorted.sort_unstable();
        let tile = self.cache.gather(&sorted)?;
        for (texel, mut row) in texels.iter().zip(rows.rows_mut()) {
            let index = sorted.binary_search(&(*texel as usize)).unwrap_or_default();
            tile.texel_mapped(index, row.as_slice_mut().unwrap_or_default(), &self.mapping);
        }
        Ok(rows)
    }
}

/// Returns the mean of the rows of `source` over ranges of its order.
pub fn mean_row(source: &dyn MeasuredRows, blocks: &[Range<usize>]) -> Result<Vec<f32>, FitError> {
    let order = source.order();
    let mut sum: Vec<f64> = Vec::new();
    let mut count = 0;
    for block in blocks {
        let rows = source.rows(&order[block.clone()])?;
        sum.resize(rows.ncols(), 0.0);
        add_rows(&mut sum, rows.view());
        count += rows.nrows();
    }
    Ok(sum.into_iter().map(|sum| (sum / count.max(1) as f64) as f32).collect())
}

fn add_rows(sum: &mut [f64], rows: ArrayView2<f32>) {
    for row in rows.rows() {
        sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += f64::from(*x));
    }
}
