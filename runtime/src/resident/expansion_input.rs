//! The input of the compute pass `resident/expansion.wgsl`: the numbers of `expansion.rs` in the layout of its
//! bindings.

use crate::asset::asset::Layer;
use crate::asset::limits::channel_words;
use crate::asset::lobe::Lobe;
use crate::asset::lobe_tables::lobe_tables;
use crate::asset::predicted_lobes::LobeNodes;
use crate::asset::residual::Residual;
use crate::resident::expansion::{Expansion, LANES};
use bytemuck::{Pod, Zeroable};

/// The compute pass in WGSL: a program with bindings and the entry points `cores_main`, `viewed_main` and `lit_main`,
/// to be dispatched in this order for each slice of clusters. The header of the text says what they count.
///
/// The text is core WGSL with seven storage buffers. It packs with `pack2x16float`, naga's `SHADER_FLOAT16_IN_FLOAT32`.
pub const EXPANSION_WGSL: &str = concat!(include_str!("expansion.wgsl"), "\n", include_str!("../asset/residual.wgsl"));
/// Number of invocations of a workgroup. Twin: `WORKGROUP`.
pub const EXPANSION_WORKGROUP: u32 = 64;
/// Number of bases, views or lights that an invocation has side by side.
const SIDE_BY_SIDE: usize = 4;

/// One channel of the colour frame. Twin: `Channel` in `expansion.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ExpansionChannel {
    /// View rank.
    pub view_rank: u32,
    /// Light rank.
    pub light_rank: u32,
    /// Number of the channel's first core entry among those of all channels.
    pub first_core: u32,
    /// Number of the channel's first light rank among those of all channels.
    pub first_row: u32,
    /// Index of the first view factors, in fours.
    pub view_at: u32,
    /// Index of the first light factors, in fours.
    pub light_at: u32,
    /// Padding: zero.
    pub pad0: u32,
    /// Padding: zero.
    pub pad1: u32,
}

/// The counts of an expansion. Twin: `Shape` in `expansion.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct ExpansionShape {
    /// Channels of the colour frame.
    pub channels: [ExpansionChannel; 3],
    /// Number of measured views.
    pub views: u32,
    /// Number of measured lights.
    pub lights: u32,
    /// Number of words of a pair and colour.
    pub channel_words: u32,
    /// Number of bases in fours, rounded up.
    pub quads: u32,
    /// Number of shared bases.
    pub shared_bases: u32,
    /// Number of core entries of all channels.
    pub cores: u32,
    /// Number of light ranks of all channels.
    pub rows: u32,
    /// Number of quads of bases from which predicted lobes take a part.
    pub taken_quads: u32,
    /// Number of the residual's curve, [`crate::ResidualKind`].
    pub residual_kind: u32,
    /// Epsilon of the residual's curve.
    pub epsilon: f32,
    /// Padding: zero.
    pub pad0: u32,
    /// Padding: zero.
    pub pad1: u32,
}

/// The part that a dispatch makes. Twin: `Slice` in `expansion.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ExpansionSlice {
    /// Number of the slice's first cluster.
    pub first_cluster: u32,
    /// Word of the whole array at which the layer's bases begin.
    pub bases_at: u32,
    /// Word of the whole array at which the bound buffer begins.
    pub piece_from: u32,
    /// Number of words of the bound buffer.
    pub piece_words: u32,
}

impl ExpansionShape {
    /// Returns the number of items of `cores_main`, `viewed_main` and `lit_main` for one cluster.
    pub fn items(&self) -> [u64; 3] {
        let fours = |count: u32| u64::from(count.div_ceil(SIDE_BY_SIDE as u32));
        let [views, quads] = [self.views, self.quads].map(u64::from);
        [
            u64::from(self.cores) * quads,
            fours(self.views) * u64::from(self.rows) * quads,
            views * fours(self.lights) * quads,
        ]
    }

    /// Returns the bytes of `cores` and of `viewed` for one cluster.
    pub fn scratch_bytes(&self) -> [u64; 2] {
        [self.cores.into(), u64::from(self.views) * u64::from(self.rows)]
            .map(|rows: u64| 16 * rows * u64::from(self.quads))
    }

    /// Returns the number of words of a cluster's bases.
    pub fn cluster_words(&self) -> u64 {
        u64::from(self.views) * u64::from(self.lights) * 3 * u64::from(self.channel_words)
    }
}

/// The contents of the bindings from which a layer's bases are expanded. `expansion.wgsl` says the lengths at the
/// bindings of these names.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpansionInput {
    /// Counts.
    pub shape: ExpansionShape,
    /// Number of clusters.
    pub clusters: u32,
    /// Shared cores, entry by entry, without their zeros.
    pub terms: Vec<u32>,
    /// View and light factors, four views or lights side by side.
    pub factors: Vec<f32>,
    /// `[cluster, shared basis, basis]`, bases padded to fours.
    pub mixtures: Vec<f32>,
    /// What predicted lobes take from the bases is made from this; a word where there are none.
    pub nodes: Vec<u32>,
}

impl ExpansionInput {
    /// Prepares the input for a layer; `None` where it has no residual. Cost: a pass over the shared cores and the
    /// mixtures, and the predicted lobes at all pairs.
    pub fn of_layer(layer: &Layer) -> Option<ExpansionInput> {
        let input = ExpansionInput::new(layer.residual.as_ref()?, layer.dictionary.len());
        Some(input.with_lobes(layer))
    }

    /// Returns the input with what the layer's predicted lobes take.
    fn with_lobes(mut self, layer: &Layer) -> ExpansionInput {
        let bases = layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
        let clusters: Vec<Option<LobeNodes>> =
            (0..layer.dictionary.len()).map(|cluster| layer.lobe_nodes(cluster)).collect();
        let Some(inputs) = clusters.iter().flatten().map(|nodes| nodes.inputs).max() else { return self };
        let quads = (1 + inputs).min(bases).div_ceil(SIDE_BY_SIDE);
        self.shape.taken_quads = quads as u32;
        self.shape.residual_kind = layer.residual_kind as u32;
        self.shape.epsilon = layer.epsilon;
        self.nodes = vec![0; 4 * clusters.len()];
        for (cluster, nodes) in clusters.iter().enumerate() {
            let Some(nodes) = nodes else { continue };
            let count = nodes.weights.len() / nodes.lobes;
            let head = [count as u32, nodes.lobes as u32, self.nodes.len() as u32, 0];
            self.nodes[4 * cluster..4 * cluster + 4].copy_from_slice(&head);
            let lobes: Vec<Lobe> = layer.dictionary[cluster].iter().map(|entry| entry.lobe).collect();
            let tables = lobe_tables(&lobes, &layer.views, &layer.lights);
            let numbers = tables.iter().flatten().chain(nodes.weights.as_flattened());
            self.nodes.extend(numbers.map(|x| x.to_bits()));
            for row in nodes.rows.chunks_exact(1 + nodes.inputs) {
                let padded = row.iter().take(bases).copied().chain(std::iter::repeat(0.0));
                self.nodes.extend(padded.take(SIDE_BY_SIDE * quads).map(f32::to_bits));
            }
        }
        self
    }

    /// Prepares the input of a residual with `clusters` clusters as it is stored.
    fn new(residual: &Residual, clusters: usize) -> ExpansionInput {
        let expansion = Expansion::new(residual);
        let bases = residual.bases.len();
        let mut shape = ExpansionShape {
            views: residual.factors.shape[0] as u32,
            lights: residual.factors.shape[1] as u32,
            channel_words: channel_words(bases) as u32,
            quads: bases.div_ceil(SIDE_BY_SIDE) as u32,
            shared_bases: residual.shared.steps.len() as u32,
            ..ExpansionShape::default()
        };
        let (mut terms, mut pairs, mut factors) = (vec![0], Vec::new(), Vec::new());
        for (channel, out) in expansion.channels.iter().zip(&mut shape.channels) {
            let [view_rank, light_rank] = channel.ranks;
            let before = (pairs.len() / 2) as u32;
            terms.extend(channel.starts[1..].iter().map(|end| before + *end as u32));
            pairs.extend(channel.terms.iter().flat_map(|(value, number)| [value.to_bits(), *number as u32]));
            let view_at = (factors.len() / SIDE_BY_SIDE) as u32;
            push_side_by_side(&mut factors, &channel.view, view_rank);
            let light_at = (factors.len() / SIDE_BY_SIDE) as u32;
            push_side_by_side(&mut factors, &channel.light, light_rank);
            *out = ExpansionChannel {
                view_rank: view_rank as u32,
                light_rank: light_rank as u32,
                first_core: shape.cores,
                first_row: shape.rows,
                view_at,
                light_at,
                ..ExpansionChannel::default()
            };
            shape.cores += (view_rank * light_rank) as u32;
            shape.rows += light_rank as u32;
        }
        terms.append(&mut pairs);
        let mut mixtures = Vec::with_capacity(clusters * SIDE_BY_SIDE * (shape.shared_bases * shape.quads) as usize);
        for cluster in 0..clusters {
            for row in expansion.mixtures(cluster).chunks_exact(bases.next_multiple_of(LANES)) {
                mixtures.extend_from_slice(&row[..SIDE_BY_SIDE * shape.quads as usize]);
            }
        }
        ExpansionInput { shape, clusters: clusters as u32, terms, factors, mixtures, nodes: vec![0] }
    }
}

/// Appends a matrix with rows of `rank` numbers, four rows side by side; the last rows beside zeros.
fn push_side_by_side(factors: &mut Vec<f32>, matrix: &[f32], rank: usize) {
    if rank == 0 {
        return;
    }
    for rows in matrix.chunks(SIDE_BY_SIDE * rank) {
        factors.extend(
            (0..rank).flat_map(|r| (0..SIDE_BY_SIDE).map(move |i| rows.get(i * rank + r).copied().unwrap_or(0.0))),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_lie_four_by_four_and_the_last_beside_zeros() {
        let matrix: Vec<f32> = (0..10).map(|i| i as f32).collect();
        let mut factors = Vec::new();
        push_side_by_side(&mut factors, &matrix, 2);
        assert_eq!(factors, [0.0, 2.0, 4.0, 6.0, 1.0, 3.0, 5.0, 7.0, 8.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0]);
        push_side_by_side(&mut factors, &[], 0);
        assert_eq!(factors.len(), 16);
    }
}
