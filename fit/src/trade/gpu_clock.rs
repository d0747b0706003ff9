//! Cost of one evaluation of the resident decoder on a GPU: the library's WGSL over a list of queries.

use crate::error::FitError;
use crate::gpu::device::{GpuChoice, GpuDevice};
use crate::trade::evaluation_time::Query;
use btf_runtime::{DecodeOptions, Resident, wgsl_library};
use std::time::Instant;
use wgpu::BufferUsages;

/// Queries per workgroup. Twin: `@workgroup_size` of `time_main`.
const GROUP: usize = 64;
/// Evaluations per dispatch and dispatches per timed submission: enough to fill a GPU and to take far longer than the
/// submission itself (some 0.05 ms). A software driver runs on the CPU, where much less is enough.
const HARDWARE: [usize; 2] = [1 << 20, 8];
const SOFTWARE: [usize; 2] = [1 << 13, 1];
/// A query as the shader reads it. Twin: `Query` in `time_queries.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuQuery {
    wi: [f32; 3],
    texel: u32,
    wo: [f32; 3],
    pad: u32,
}

/// An open adapter that decoders are timed on.
pub(crate) struct GpuClock {
    gpu: GpuDevice,
    pipeline: wgpu::ComputePipeline,
}

/// A resident asset and queries in the adapter's memory.
pub(crate) struct GpuAsset {
    words: wgpu::Buffer,
    queries: wgpu::Buffer,
    decoded: wgpu::Buffer,
    count: usize,
}

impl GpuClock {
    /// Opens the adapter of `choice`; `Ok(Err(...))` says in words why there is none.
    ///
    /// # Errors
    /// A named adapter that does not exist, with the names of those that do.
    pub(crate) fn open(choice: &GpuChoice) -> Result<Result<GpuClock, String>, FitError> {
        if *choice == GpuChoice::Off {
            return Ok(Err("not measured: --gpu none".into()));
        }
        let opened = GpuDevice::open(choice)?.map_err(|reason| format!("empty: {reason}"));
        Ok(opened.and_then(|gpu| {
            let pipeline = gpu.pipeline("trade", &module_text(), "time_main", &[]);
            match gpu.fault() {
                Some(fault) => Err(format!("empty: the adapter {} refuses the decoder ({fault})", gpu.name)),
                None => Ok(GpuClock { gpu, pipeline }),
            }
        }))
    }

    /// Tells whether the adapter is a driver that computes on the CPU.
    pub(crate) fn is_software(&self) -> bool {
        self.gpu.software
    }

    /// Returns the name and kind of the adapter, in words.
    pub(crate) fn words(&self) -> String {
        let [count, dispatches] = self.amount();
        let kind = if self.gpu.software {
            "a software driver, which runs on the CPU's cores: no figure of a GPU, good for ratios at most"
        } else {
            "wall clock from submission to completion"
        };
        format!(
            "{} ({kind}); {dispatches} x {count} random evaluations a pass, half precision (the shader reads no other); empty where the resident form is larger than the adapter binds",
            self.gpu.name
        )
    }

    fn amount(&self) -> [usize; 2] {
        if self.gpu.software { SOFTWARE } else { HARDWARE }
    }

    /// Returns the number of queries that [`GpuClock::upload`] expects.
    pub(crate) fn query_count(&self) -> usize {
        self.amount()[0]
    }

    /// Uploads an asset and queries to the adapter; `None` where they do not fit.
    pub(crate) fn upload(&self, resident: &Resident, queries: &[Query]) -> Option<GpuAsset> {
        let listed: Vec<GpuQuery> =
            queries.iter().map(|(texel, wi, wo)| GpuQuery { wi: *wi, texel: *texel, wo: *wo, pad: 0 }).collect();
        let most = self.gpu.largest_buffer();
        let bytes = 4 * resident.words().len() as u64;
        if bytes > most || queries.is_empty() || 32 * queries.len() as u64 > most {
            return None;
        }
        let words = self.gpu.stored(bytemuck::cast_slice(resident.words()));
        let listed = self.gpu.stored(bytemuck::cast_slice(&listed));
        let decoded = self.gpu.buffer(16 * queries.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        self.gpu.fault().is_none().then_some(GpuAsset { words, queries: listed, decoded, count: queries.len() })
    }

    fn bind(&self, asset: &GpuAsset, options: &DecodeOptions) -> wgpu::BindGroup {
        let options = [options.components, options.lobes, options.interpolation as u32, 0];
        let uniform = self.gpu.buffer(16, BufferUsages::UNIFORM);
        self.gpu.queue.write_buffer(&uniform, 0, bytemuck::cast_slice(&options));
        let buffers = [&asset.words, &uniform, &asset.queries, &asset.decoded];
        let entries: Vec<wgpu::BindGroupEntry> = buffers
            .iter()
            .enumerate()
            .map(|(number, buffer)| wgpu::BindGroupEntry {
                binding: number as u32,
                resource: match number {
                    // The list's own length, which the shader asks for.
                    2 => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer,
                        offset: 0,
                        size: std::num::NonZeroU64::new(32 * asset.count as u64),
                    }),
                    _ => buffer.as_entire_binding(),
                },
            })
            .collect();
        let layout = self.pipeline.get_bind_group_layout(0);
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        })
    }

    /// Submits `dispatches` passes over all queries and waits for them; `false` after an error.
    fn run(&self, asset: &GpuAsset, group: &wgpu::BindGroup, dispatches: usize) -> bool {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        for _ in 0..dispatches {
            GpuDevice::dispatch(&mut encoder, &self.pipeline, group, [asset.count.div_ceil(GROUP), 1]);
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait() && self.gpu.fault().is_none()
    }

    /// Returns the nanoseconds of an evaluation: the least of `repeats` passes after one that is not counted; `None`
    /// after an error of the driver.
    pub(crate) fn nanoseconds(&self, asset: &GpuAsset, options: &DecodeOptions, repeats: usize) -> Option<f64> {
        let group = self.bind(asset, options);
        let dispatches = self.amount()[1];
        let pass = || {
            let start = Instant::now();
            let done = self.run(asset, &group, dispatches);
            done.then(|| start.elapsed().as_secs_f64() * 1e9 / (dispatches * asset.count) as f64)
        };
        pass()?;
        let times: Vec<f64> = (0..repeats.max(1)).map(|_| pass()).collect::<Option<_>>()?;
        times.into_iter().reduce(f64::min)
    }
}

/// Returns the decoder's WGSL with the entry point that is timed.
fn module_text() -> String {
    format!("{}\n{}", wgsl_library(), include_str!("time_queries.wgsl"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::gpu_is_left_out;
    use crate::sample_asset::sample_asset;
    use crate::trade::evaluation_time::random_queries;
    use btf_runtime::{Interpolation, decode};

    /// Returns what the last pass decoded.
    fn values(clock: &GpuClock, asset: &GpuAsset) -> Vec<[f32; 4]> {
        clock.gpu.read(&asset.decoded, 16 * asset.count as u64).unwrap()
    }

    #[test]
    fn what_is_timed_decodes_as_the_cpu_does() {
        if gpu_is_left_out("what_is_timed_decodes_as_the_cpu_does") {
            return;
        }
        let clock = match GpuClock::open(&GpuChoice::Best).unwrap() {
            Ok(clock) => clock,
            Err(reason) => panic!("{reason}; BTF_SKIP_GPU=1 skips this test"),
        };
        let asset = sample_asset();
        let resident = Resident::from_asset(&asset);
        // A count that is no multiple of a workgroup.
        let queries = random_queries(301, asset.texel_count(), &asset.layers[0], 3);
        let on_gpu = clock.upload(&resident, &queries).unwrap();
        for (components, interpolation) in [(0, Interpolation::Fast), (u32::MAX, Interpolation::Exact)] {
            let options = DecodeOptions { components, interpolation, ..DecodeOptions::default() };
            assert!(clock.nanoseconds(&on_gpu, &options, 1).unwrap() > 0.0);
            for ((texel, wi, wo), found) in queries.iter().zip(values(&clock, &on_gpu)) {
                let expected = decode(&resident, 0, *texel, *wi, *wo, &options);
                let near = (0..3).all(|c| (found[c] - expected[c]).abs() <= 1e-3 + 1e-3 * expected[c].abs());
                assert!(near, "{expected:?} {found:?}");
            }
        }
        assert!(clock.words().contains(&clock.gpu.name) && clock.words().contains("software") == clock.is_software());
    }

    #[test]
    fn an_adapter_that_is_not_there_is_named_and_none_is_none() {
        let named = GpuClock::open(&GpuChoice::Named("no such adapter".into())).map(|_| ());
        let message = named.unwrap_err().to_string();
        assert!(message.contains("no such adapter") && !message.contains('\n'), "{message}");
        assert!(GpuClock::open(&GpuChoice::Off).unwrap().is_err());
    }
}
