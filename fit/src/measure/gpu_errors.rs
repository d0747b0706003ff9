//! Error of tiles of texels on an adapter, a batch of pairs at a time. Twin of the shader: gpu_errors.wgsl; the CPU's loops are in
//! tile_errors.rs.

use crate::gpu::device::{GpuDevice, Readback};
use crate::measure::batch_sizes::BatchSizes;
use crate::measure::image_decoder::{ImageDecoder, PlainImage};
use crate::measure::texel_tiles::TILE_TEXELS;
use crate::measure::tile_errors::{Coding, PairWork, TileErrors, TiledImage};
use btf_runtime::{LobeRole, WGSL};
use rayon::prelude::*;
use wgpu::BufferUsages;

/// Pairs of a batch at most. Twin: `MAX_PAIRS`.
pub const MAX_PAIRS: usize = 64;
/// Pairs that share what is read of a texel's codes. Twin: `PAIRS_AT_ONCE`.
const PAIRS_AT_ONCE: usize = 4;
/// Numbers of a texel's sums. Twin: `SUMS`.
const SUMS: usize = 6;
/// Words of a pair in front of the lobes' values. Twin: `HEADER`.
const HEADER: usize = 4;
/// Workgroups in a row. Twin: the factor in `errors`.
const ROW: usize = 65_535;
/// Place of an image whose codes are not wanted.
const UNWANTED: u32 = u32::MAX;

/// An adapter with the texels of a layer, ready to measure.
pub(crate) struct GpuErrors<'a> {
    gpu: &'a GpuDevice,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    buffers: Buffers,
    layer: LayerSizes,
}

/// What the shader must know of a layer.
struct LayerSizes {
    tiles: usize,
    /// Quads of bases.
    quads: usize,
    clusters: usize,
    /// Lobes of all clusters.
    lobes: usize,
    /// Number of the residual's curve.
    kind: u32,
    epsilon: f32,
    /// Whether lobes are part of the value.
    adds_lobes: bool,
}

/// Buffers that are written for each batch, and the one that the shader writes.
struct Buffers {
    batch: wgpu::Buffer,
    pairs: wgpu::Buffer,
    rows: wgpu::Buffer,
    images: wgpu::Buffer,
    found: wgpu::Buffer,
}

/// A batch that an adapter is measuring.
pub(crate) struct Pending {
    readback: Readback,
    /// Whether the driver took everything.
    is_sound: bool,
}

impl<'a> GpuErrors<'a> {
    /// Copies the texels of `decoder`'s layer to `gpu`.
    ///
    /// # Errors
    /// A verb phrase that says why not: no room, or a driver that refuses.
    pub fn new(
        gpu: &'a GpuDevice,
        decoder: &ImageDecoder,
        coding: &Coding,
        sizes: BatchSizes,
    ) -> Result<GpuErrors<'a>, &'static str> {
        const NO_ROOM: &str = "has no room for it";
        let [clusters, lobes, words] = decoder.counts();
        let layer = decoder.layer();
        let layer = LayerSizes {
            tiles: decoder.tiles().len(),
            quads: words.div_ceil(2),
            clusters,
            lobes,
            kind: layer.residual_kind as u32,
            epsilon: layer.epsilon,
            adds_lobes: layer.lobe_role != LobeRole::Guide,
        };
        let texels = (layer.tiles * TILE_TEXELS) as u64;
        let slot_count: usize = decoder.tiles().iter().map(|tile| tile.slot_count()).sum();
        let pairs = sizes.batch.next_multiple_of(PAIRS_AT_ONCE) as u64;
        let bytes_of_texels = [4 * texels * layer.quads as u64, 16 * (slot_count * TILE_TEXELS) as u64];
        let of_pairs = 4 * ((MAX_PAIRS * HEADER) as u64 + pairs * lobes as u64);
        let of_rows = 4 * pairs * (clusters * layer.quads * 12) as u64;
        let (of_images, of_found) = (3 * pairs * texels, 4 * texels * (SUMS as u64 + 1 + pairs));
        let all = [bytes_of_texels[0], bytes_of_texels[1], of_pairs, of_rows, of_images, of_found];
        if all.iter().any(|bytes| *bytes > gpu.largest_buffer()) || all.iter().sum::<u64>() > sizes.memory_bytes {
            return Err(NO_ROOM);
        }
        let wgsl: String = WGSL.iter().filter(|(name, _)| *name == "residual.wgsl").map(|(_, text)| *text).collect();
        let pipeline = gpu.pipeline("errors", &(wgsl + include_str!("gpu_errors.wgsl")), "errors", &[]);
        if gpu.fault().is_some() {
            return Err("refuses the shader that measures");
        }
        let fixed = fixed_buffers(gpu, decoder, coding, sizes.lights);
        let buffers = Buffers {
            batch: gpu.buffer(32, BufferUsages::UNIFORM),
            pairs: gpu.buffer(of_pairs, BufferUsages::STORAGE),
            rows: gpu.buffer(of_rows, BufferUsages::STORAGE),
            images: gpu.buffer(of_images, BufferUsages::STORAGE),
            found: gpu.buffer(of_found, BufferUsages::STORAGE | BufferUsages::COPY_SRC),
        };
        let [tiles, codes, slots, tables] = &fixed;
        let Buffers { batch, pairs, rows, images, found } = &buffers;
        let group = gpu.bind(&pipeline, &[batch, tiles, codes, slots, tables, pairs, rows, images, found]);
        let sound = gpu.fault().is_none();
        sound.then_some(GpuErrors { gpu, pipeline, group, buffers, layer }).ok_or(NO_ROOM)
    }

    /// Returns whether the adapter can measure `batch`: plain sums, and images of 8-bit values.
    pub fn takes(batch: &[PairWork]) -> bool {
        let is_plain =
            |work: &PairWork| work.plan.plain().is_some() && matches!(work.images[..], [TiledImage::Codes(_)]);
        batch.len() <= MAX_PAIRS && batch.iter().all(is_plain)
    }

    /// Begins to measure `batch`, which [`GpuErrors::takes`] and which has no more pairs than [`BatchSizes::batch`].
    pub fn submit(&self, batch: &[PairWork]) -> Pending {
        let GpuErrors { gpu, buffers, layer, .. } = self;
        let LayerSizes { tiles, quads, clusters, lobes, kind, epsilon, adds_lobes } = *layer;
        let [of_tiles, of_pairs, of_quads, of_clusters, of_lobes] =
            [tiles, batch.len(), quads, clusters, lobes].map(|number| number as u32);
        let uniform =
            [of_tiles, of_pairs, of_quads, of_clusters, of_lobes, kind, epsilon.to_bits(), u32::from(adds_lobes)];
        gpu.queue.write_buffer(&buffers.batch, 0, bytemuck::cast_slice(&uniform));
        let mut heads = vec![0u32; MAX_PAIRS * HEADER];
        let mut wanted = 0;
        for (work, head) in batch.iter().zip(heads.chunks_mut(HEADER)) {
            let fade = work.plan.plain().map_or(1.0, |plain| plain.fade);
            let place = if work.colour_every.is_some() { wanted } else { UNWANTED };
            wanted += u32::from(work.colour_every.is_some());
            head.copy_from_slice(&[work.light as u32, fade.to_bits(), place, 0]);
        }
        let plain: Vec<PlainImage> = batch.iter().filter_map(|work| work.plan.plain()).collect();
        heads.extend(plain.iter().flat_map(|plain| plain.values).map(|value| value.to_bits()));
        gpu.queue.write_buffer(&buffers.pairs, 0, bytemuck::cast_slice(&heads));
        let rows: Vec<Vec<f32>> = plain.par_iter().map(|plain| self.rows_by_quad(plain)).collect();
        let mut at = 0;
        for rows in &rows {
            gpu.queue.write_buffer(&buffers.rows, at, bytemuck::cast_slice(rows));
            at += 4 * rows.len() as u64;
        }
        let mut at = 0;
        for work in batch {
            if let TiledImage::Codes(tiles) = &work.images[0] {
                let bytes = tiles.as_flattened().as_flattened();
                gpu.queue.write_buffer(&buffers.images, at, bytes);
                at += bytes.len() as u64;
            }
        }
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        GpuDevice::dispatch(&mut encoder, &self.pipeline, &self.group, [tiles.min(ROW), tiles.div_ceil(ROW)]);
        let words = tiles * (TILE_TEXELS * (SUMS + wanted as usize) + MAX_PAIRS);
        let readback = gpu.read_back(&mut encoder, &buffers.found, 4 * words as u64);
        gpu.queue.submit([encoder.finish()]);
        Pending { readback, is_sound: gpu.fault().is_none() }
    }

    /// Returns the rows of a pair as `[cluster, quad, channel, basis]`.
    fn rows_by_quad(&self, plain: &PlainImage) -> Vec<f32> {
        let words = plain.rows.len() / self.layer.clusters.max(1);
        let mut rows = Vec::with_capacity(self.layer.clusters * self.layer.quads * 12);
        for cluster in plain.rows.chunks(words.max(1)) {
            for quad in cluster.chunks(2) {
                let at = |word: usize, c: usize| quad.get(word).map_or([0.0; 2], |row| row[c]);
                (0..3).for_each(|c| rows.extend([at(0, c), at(1, c)].as_flattened()));
            }
        }
        rows
    }

    /// Waits for `pending`, adds the sums of every tile to `errors` and returns the squared differences of 8-bit values of each
    /// pair; `None`, and nothing added, after an error of the driver.
    pub fn collect(
        &self,
        pending: Pending,
        batch: &[PairWork],
        decoder: &ImageDecoder,
        coding: &Coding,
        errors: &mut [TileErrors],
    ) -> Option<Vec<u64>> {
        let found: Option<Vec<u32>> = pending.readback.numbers(self.gpu);
        let is_sound = self.gpu.fault().is_none() && pending.is_sound;
        let found = found.filter(|_| is_sound)?;
        let row = self.layer.tiles * TILE_TEXELS;
        let (sums, rest) = found.split_at_checked(SUMS * row)?;
        let (of_pairs, colours) = rest.split_at_checked(self.layer.tiles * MAX_PAIRS)?;
        if sums[row..].iter().any(|bits| !f32::from_bits(*bits).is_finite()) {
            return None;
        }
        errors.par_iter_mut().enumerate().for_each(|(number, errors)| {
            for i in 0..TILE_TEXELS {
                let sum = |which: usize| sums[which * row + number * TILE_TEXELS + i];
                errors.add_sums(i, sum(0), [1, 2, 3, 4, 5].map(|which| f32::from_bits(sum(which))));
            }
            let chosen = batch.iter().filter(|work| work.colour_every.is_some());
            for (work, image) in chosen.zip(colours.chunks(row)) {
                let codes = &image[number * TILE_TEXELS..(number + 1) * TILE_TEXELS];
                let decoded = [0, 1, 2].map(|c| std::array::from_fn(|i| (codes[i] >> (8 * c)) as u8));
                errors.add_colours_of(work, number, decoder, coding, &decoded);
            }
        });
        let of_pair = |pair: usize| of_pairs.chunks(MAX_PAIRS).map(|tile| u64::from(tile[pair])).sum();
        Some((0..batch.len()).map(of_pair).collect())
    }

    /// Makes every later batch fail, as a driver does that lost its memory.
    #[cfg(test)]
    pub fn break_for_test(&self) {
        self.buffers.found.destroy();
    }
}

/// Copies what all batches share to `gpu`: tiles, codes, lobes of the texels, and tables of the lights.
fn fixed_buffers(gpu: &GpuDevice, decoder: &ImageDecoder, coding: &Coding, lights: usize) -> [wgpu::Buffer; 4] {
    let (mut heads, mut codes, mut slots) = (Vec::new(), Vec::new(), Vec::new());
    for tile in decoder.tiles() {
        let first = slots.len() / TILE_TEXELS;
        heads.push([tile.cluster, tile.texels.len(), first, tile.slot_count()].map(|number| number as u32));
        tile.push_slots(decoder.first_lobe(tile.cluster) as u32, &mut slots);
        tile.push_quads(&mut codes);
    }
    let tables: Vec<f32> = (0..lights).flat_map(|light| coding.light_table(light)).collect();
    [
        gpu.stored(bytemuck::cast_slice(&heads)),
        gpu.stored(bytemuck::cast_slice(&codes)),
        gpu.stored(bytemuck::cast_slice(&slots)),
        gpu.stored(bytemuck::cast_slice(&tables)),
    ]
}
