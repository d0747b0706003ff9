//! Expands an asset's bases on the GPU, straight into the words that decoders bind: what goes to it is what they are
//! made from, 7 to 16 % of their bytes on three materials of 2 MB. The passes are `btf_runtime::EXPANSION_WGSL`.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::layout::{READ, WRITE, bind, buffer_entry};
use crate::gpu::pieces::Pieces;
use btf_runtime::{
    Asset, EXPANSION_WGSL, EXPANSION_WORKGROUP, ExpansionInput, ExpansionShape, ExpansionSlice, Resident,
};
use std::ops::Range;
use wgpu::BufferUsages;

/// Bytes that the passes may hold between them: clusters are taken together while theirs fit, so that small ones fill a
/// GPU.
const MAX_SCRATCH_BYTES: u64 = 32 << 20;
/// Workgroups per row of a dispatch, below the least limit of 65535.
const ROW: u64 = 32768;
/// Items of a pass a cluster, which it numbers in 32 bits.
const MAX_ITEMS: u64 = 1 << 31;

/// The factored PCA bases of a layer, which the GPU multiplies out.
pub(crate) struct LayerBases {
    /// The range of the asset's words that the bases fill.
    place: Range<usize>,
    input: ExpansionInput,
}

impl LayerBases {
    /// Returns the bases of all layers of `asset`; `head` is [`Resident::without_bases`] of it. `None` where a single
    /// cluster takes more than the adapter binds at once, which no asset of sensible ranks does. Cost: that of
    /// [`ExpansionInput::of_layer`].
    pub(crate) fn of_asset(gpu: &Gpu, head: &Resident, asset: &Asset) -> Option<Vec<LayerBases>> {
        let layers = asset.layers.iter().enumerate().filter_map(|(number, layer)| {
            Some(LayerBases { place: head.bases_of(number as u32), input: ExpansionInput::of_layer(layer)? })
        });
        let layers: Vec<LayerBases> = layers.collect();
        layers.iter().all(|layer| layer.fits(gpu)).then_some(layers)
    }

    fn fits(&self, gpu: &Gpu) -> bool {
        let ExpansionInput { shape, terms, factors, mixtures, nodes, .. } = &self.input;
        let inputs = [terms.len(), factors.len(), mixtures.len(), nodes.len()].map(|count| 4 * count as u64);
        let most = gpu.max_binding_bytes();
        inputs.iter().chain(&shape.scratch_bytes()).all(|bytes| *bytes <= most)
            && shape.items().iter().all(|items| *items < MAX_ITEMS)
    }

    /// Returns how many clusters are expanded together.
    fn slice(&self, gpu: &Gpu) -> u32 {
        let most = MAX_SCRATCH_BYTES.min(gpu.max_binding_bytes());
        let largest = self.input.shape.scratch_bytes().into_iter().fold(1, u64::max);
        ((most / largest) as u32).clamp(1, self.input.clusters.max(1))
    }
}

/// Returns the parts of `words` without the bases of `layers`, which are in order.
pub(crate) fn other_words(words: usize, layers: &[LayerBases]) -> Vec<Range<usize>> {
    let ends = std::iter::once(0).chain(layers.iter().map(|layer| layer.place.end));
    let starts = layers.iter().map(|layer| layer.place.start).chain(std::iter::once(words));
    ends.zip(starts).map(|(from, to)| from..to).collect()
}

/// The passes, compiled.
pub(crate) struct Expander {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    /// The pipelines in the order in which they run.
    pipelines: [wgpu::ComputePipeline; 3],
}

impl Expander {
    pub(crate) fn new(gpu: &Gpu) -> Expander {
        const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
        let kinds = [UNIFORM, UNIFORM, READ, READ, READ, WRITE, WRITE, WRITE, READ];
        let entries: Vec<_> = (0..).zip(kinds).map(|(binding, kind)| buffer_entry(binding, kind)).collect();
        let layout = gpu
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("expansion"), entries: &entries });
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("expansion"),
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("expansion"),
            source: wgpu::ShaderSource::Wgsl(EXPANSION_WGSL.into()),
        });
        let pipelines = ["cores_main", "viewed_main", "lit_main"].map(|entry| {
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        });
        Expander { gpu: gpu.clone(), layout, pipelines }
    }

    /// Submits the passes that fill in a layer's bases; the asset's words begin at word `asset_at` of `pieces`.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for what lies between the passes.
    pub(crate) fn expand(&self, layer: &LayerBases, asset_at: u32, pieces: &Pieces) -> Result<(), ViewerError> {
        let gpu = &self.gpu;
        let ExpansionInput { shape, clusters, terms, factors, mixtures, nodes } = &layer.input;
        let bases_at = asset_at as usize + layer.place.start;
        let slice = layer.slice(gpu);
        let uniform = |bytes: &[u8]| gpu.buffer("counts of the bases", bytes, BufferUsages::UNIFORM);
        let input = |bytes: &[u8]| gpu.buffer("factors of the bases", bytes, BufferUsages::STORAGE);
        let counts = uniform(bytemuck::bytes_of(shape))?;
        let inputs = [
            input(bytemuck::cast_slice(terms))?,
            input(bytemuck::cast_slice(factors))?,
            input(bytemuck::cast_slice(mixtures))?,
            input(bytemuck::cast_slice(nodes))?,
        ];
        let scratch =
            |bytes: u64| gpu.empty_buffer("bases between passes", u64::from(slice) * bytes, BufferUsages::STORAGE);
        let [cores, viewed] = shape.scratch_bytes().map(scratch);
        let (cores, viewed) = (cores?, viewed?);
        let cluster_words = shape.cluster_words() as usize;
        for first in (0..*clusters).step_by(slice as usize) {
            let count = slice.min(clusters - first);
            let from = bases_at + first as usize * cluster_words;
            let words = from..from + count as usize * cluster_words;
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            // A slice that lies in two pieces is lit for each of them.
            let mut passes = 0..3;
            for (buffer, piece) in pieces.buffers.iter().zip(pieces.places()) {
                if piece.start >= words.end || piece.end <= words.start {
                    continue;
                }
                let of_piece = uniform(bytemuck::bytes_of(&ExpansionSlice {
                    first_cluster: first,
                    bases_at: bases_at as u32,
                    piece_from: piece.start as u32,
                    piece_words: piece.len() as u32,
                }))?;
                let [terms, factors, mixtures, nodes] = &inputs;
                let bound = [&counts, &of_piece, terms, factors, mixtures, &cores, &viewed, buffer, nodes];
                let resources: Vec<_> = (0..).zip(bound.map(wgpu::Buffer::as_entire_binding)).collect();
                let group = bind(gpu, &self.layout, &resources);
                let mut compute = encoder.begin_compute_pass(&Default::default());
                compute.set_bind_group(0, &group, &[]);
                for pass in passes {
                    compute.set_pipeline(&self.pipelines[pass]);
                    let [x, y] = groups(shape, pass);
                    compute.dispatch_workgroups(x, y, count);
                }
                passes = 2..3;
            }
            gpu.queue.submit([encoder.finish()]);
        }
        Ok(())
    }
}

/// Workgroups of a pass along x and y.
fn groups(shape: &ExpansionShape, pass: usize) -> [u32; 2] {
    let groups = shape.items()[pass].div_ceil(EXPANSION_WORKGROUP.into());
    [groups.min(ROW) as u32, groups.div_ceil(ROW) as u32]
}
