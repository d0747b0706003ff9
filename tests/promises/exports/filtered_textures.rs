//! Block-compressed textures of an asset, evaluated on a GPU by the published decoders in GLSL and in HLSL, show what the
//! asset shows: at measured directions with the error that the export tells, between them, between texels and at coarser
//! levels.

use crate::exports::gltf_export::{judge, packages};
use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::{FilteredExport, FilteredParams, FitParams, Monitor, export_filtered};
use btf_runtime::testing::Random;
use btf_runtime::{Asset, DecodeOptions, Levels, Resident, decode, open, pack, serial};
use btf_tests::{capture_of, fitted, small_fit};
use btf_textures::{FEATURES, GLSL, HLSL, TextureError, Textures, limits, read_textures, upload};
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, OnceLock};
use wgpu::util::DeviceExt;

/// Texels along a side.
const SIZE: usize = 16;
/// Queries of a run, whole workgroups of 64.
const QUERIES: usize = 64 * 64;

/// A place, a level and two directions, padded as shaders have them.
type Query = [[f32; 4]; 3];

const GLSL_MAIN: &str = "
layout(local_size_x = 64) in;
layout(std430, set = 1, binding = 0) readonly buffer Queries { vec4 queries[]; };
layout(std430, set = 1, binding = 1) buffer Answers { vec4 answers[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    answers[i] = vec4(btf(queries[3 * i].xy, queries[3 * i].z, queries[3 * i + 1].xyz, queries[3 * i + 2].xyz), 1.0);
}";

const HLSL_MAIN: &str = "
StructuredBuffer<float4> queries : register(t0, space1);
RWStructuredBuffer<float4> answers : register(u1, space1);
[numthreads(64, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {
    uint i = id.x;
    answers[i] = float4(btf(queries[3 * i].xy, queries[3 * i].z, queries[3 * i + 1].xyz, queries[3 * i + 2].xyz), 1.0);
}";

/// Flakes of gloss, of which no two texels have the same slope and width, on two colours.
fn capture(folder: &Path) -> Capture {
    let set = DirectionSet::bonn81();
    let mut random = Random::new(2);
    let flakes: Vec<[f32; 4]> = (0..SIZE * SIZE)
        .map(|_| [(-0.4, 0.4), (-0.4, 0.4), (0.15, 0.5), (0.3, 0.6)].map(|(least, most)| random.within(least, most)))
        .collect();
    capture_of(folder, SIZE, &set, &set, ImageFormat::Png, |texel, wi, wo| {
        let [slope_x, slope_y, width, blue] = flakes[texel];
        let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let off = [half[0] / half[2] - slope_x, half[1] / half[2] - slope_y];
        let gloss = 0.5 * (-(off[0].powi(2) + off[1].powi(2)) / width.powi(2)).exp();
        let body = if texel % SIZE < SIZE / 2 { [0.4, 0.1, 0.1] } else { [0.1, 0.2, blue] };
        body.map(|colour| (colour + gloss) * wi[2])
    })
}

struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

/// Opens a device; `None` if GPU tests are left out on purpose.
fn gpu() -> Option<Gpu> {
    if std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1") {
        btf_tests::skip("block-compressed textures on a GPU (BTF_SKIP_GPU=1)");
        return None;
    }
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    // The software driver where there is one: the same on every machine.
    let adapter = adapters
        .into_iter()
        .min_by_key(|adapter| adapter.get_info().device_type != wgpu::DeviceType::Cpu)
        .expect("no Vulkan driver answers: `cargo xtask setup` installs one, BTF_SKIP_GPU=1 leaves GPU tests out");
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: FEATURES | wgpu::Features::PASSTHROUGH_SHADERS,
        required_limits: limits(),
        ..Default::default()
    }))
    .expect("the driver has block-compressed textures and takes SPIR-V");
    Some(Gpu { device, queue })
}

impl Gpu {
    fn glsl(&self) -> wgpu::ShaderModule {
        let text = format!("#version 450\n{GLSL}{GLSL_MAIN}");
        let source =
            wgpu::ShaderSource::Glsl { shader: text.into(), stage: wgpu::naga::ShaderStage::Compute, defines: &[] };
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("GLSL"), source })
    }

    /// Compiles the HLSL with glslang; `None` where that is not installed.
    fn hlsl(&self) -> Option<wgpu::ShaderModule> {
        if std::env::var_os("BTF_SKIP_PEERS").is_some_and(|value| value == "1") {
            btf_tests::skip("the HLSL decoder (BTF_SKIP_PEERS=1)");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        let [text, out] = ["decoder.hlsl", "decoder.spv"].map(|name| folder.path().join(name));
        std::fs::write(&text, format!("{HLSL}{HLSL_MAIN}")).unwrap();
        let mut command = Command::new("glslangValidator");
        command.args(["-D", "-V", "-S", "comp", "-e", "main", "-o"]).arg(&out).arg(&text);
        let Ok(output) = command.output() else {
            btf_tests::absent("glslangValidator is not here (`cargo xtask setup` installs it)");
            return None;
        };
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
        let bytes = std::fs::read(&out).unwrap();
        let words: Vec<u32> = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
            label: Some("HLSL"),
            entry_points: vec![wgpu::PassthroughShaderEntryPoint { name: "main".into(), workgroup_size: (64, 1, 1) }]
                .into(),
            spirv: Some((&words[..]).into()),
            ..Default::default()
        };
        // SAFETY: glslang made it of the text above, which reads and writes three and one words of each query.
        #[allow(unsafe_code, reason = "SPIR-V that wgpu does not read takes this call")]
        Some(unsafe { self.device.create_shader_module_passthrough(descriptor) })
    }

    /// Evaluates the textures at whole workgroups of queries.
    fn values(&self, module: &wgpu::ShaderModule, textures: &Textures, queries: &[Query]) -> Vec<[f32; 3]> {
        assert!(queries.len().is_multiple_of(64));
        let device = &self.device;
        let material = upload(textures, device, &self.queue, wgpu::ShaderStages::COMPUTE);
        let buffer = |bytes: &[u8], usage| {
            let usage = usage | wgpu::BufferUsages::STORAGE;
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents: bytes, usage })
        };
        let questions = buffer(bytemuck::cast_slice(queries), wgpu::BufferUsages::empty());
        let answers = buffer(&vec![0; 16 * queries.len()], wgpu::BufferUsages::COPY_SRC);
        let entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let group_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[entry(0, true), entry(1, false)],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&material.layout), Some(&group_layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&layout),
            module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let bound = [&questions, &answers];
        let entries: Vec<_> = (0..)
            .zip(bound)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &group_layout,
            entries: &entries,
        });
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: answers.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &material.group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups((queries.len() / 64) as u32, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&answers, 0, &staging, 0, answers.size());
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("answers can be mapped"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
        let bytes = staging.get_mapped_range(..).expect("answers are mapped").to_vec();
        let answers: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        answers.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect()
    }
}

/// An asset, its textures in a folder, and what the asset itself shows.
struct Exported {
    folder: tempfile::TempDir,
    asset: Asset,
    resident: Resident,
    export: FilteredExport,
}

/// Returns the textures of the fitted weave, which is fitted once.
fn exported(bytes: u64) -> Exported {
    static ASSET: OnceLock<Asset> = OnceLock::new();
    let asset = ASSET.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let capture = capture(&folder.path().join("WEAVE"));
        let cache_directory = folder.path().to_path_buf();
        fitted(&capture, &FitParams { bytes: Some(150_000), cache_directory, ..FitParams::default() }).asset
    });
    let folder = tempfile::tempdir().unwrap();
    let export = write(folder.path(), asset, &[], bytes);
    let resident = open(Arc::new(pack(asset).unwrap()), Levels::All, &serial).unwrap().resident;
    Exported { folder, asset: asset.clone(), resident, export }
}

fn write(folder: &Path, asset: &Asset, captures: &[Capture], bytes: u64) -> FilteredExport {
    let params = FilteredParams { bytes: Some(bytes), memory_bytes: 1 << 30 };
    let export = export_filtered(asset, "weave", captures, &params, &Monitor::default()).unwrap();
    export.files.iter().for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes).unwrap());
    export
}

fn code(x: f32) -> f64 {
    let x = f64::from(x.clamp(0.0, 1.0));
    (255.0 * if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }).round()
}

/// Returns the PSNR of 8-bit sRGB values.
fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (code(*a) - code(*b)).powi(2));
    10.0 * (255.0f64.powi(2) * (3 * a.len()) as f64 / squares.sum::<f64>().max(1e-9)).log10()
}

/// Returns the query of a texel's middle at a level.
fn query(texel: usize, side: usize, level: f32, wi: [f32; 3], wo: [f32; 3]) -> Query {
    let uv = [texel % side, texel / side].map(|i| (i as f32 + 0.5) / side as f32);
    [[uv[0], uv[1], level, 0.0], [wi[0], wi[1], wi[2], 0.0], [wo[0], wo[1], wo[2], 0.0]]
}

#[test]
fn both_decoders_show_what_the_asset_shows() {
    let Some(gpu) = gpu() else { return };
    let Exported { folder, asset, resident, export } = exported(700_000);
    let figures = &export.layers[0];
    assert!(export.memory_bytes <= 700_000 && export.memory_bytes > 650_000, "{}", export.memory_bytes);
    assert!(figures.error.psnr_to_asset_db > 34.0, "{figures:?}");
    let path = folder.path().join("weave.ktx2");
    let textures = read_textures(&path, "front").unwrap();
    let memory: usize = textures.all.iter().flat_map(|texture| &texture.levels).map(Vec::len).sum();
    assert_eq!(memory, export.memory_bytes);
    let glsl = gpu.glsl();

    let mut random = Random::new(5);
    let layer = &asset.layers[0];
    let (mut queries, mut wanted) = (Vec::new(), Vec::new());
    let mut ask = |level: u32, wi, wo, random: &mut Random| {
        let side = SIZE >> level;
        let texel = random.below(side * side);
        wanted.push(decode(&resident, level, texel as u32, wi, wo, &DecodeOptions::default()));
        queries.push(query(texel, side, level as f32, wi, wo));
    };
    for _ in 0..QUERIES {
        let [light, view] = [random.below(81), random.below(81)].map(|id| id as u32);
        ask(0, layer.lights.direction(light), layer.views.direction(view), &mut random);
    }
    for number in 0..QUERIES {
        let [wi, wo] = [random.direction(), random.direction()].map(|[x, y, z]: [f32; 3]| [x, y, z.abs()]);
        ask(number as u32 % 3, wi, wo, &mut random);
    }
    let found = gpu.values(&glsl, &textures, &queries);
    let at_pairs = psnr(&found[..QUERIES], &wanted[..QUERIES]);
    assert!((at_pairs - figures.error.psnr_to_asset_db).abs() < 0.5, "{at_pairs} {figures:?}");
    let between = psnr(&found[QUERIES..], &wanted[QUERIES..]);
    println!("{at_pairs:.2} dB at measured pairs, {between:.2} dB at any directions and three levels");
    assert!(between > 28.0, "{between}");
    if let Some(hlsl) = gpu.hlsl() {
        let others = gpu.values(&hlsl, &textures, &queries);
        let far = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-3 + 1e-3 * a.abs();
        let count = found.as_flattened().iter().zip(others.as_flattened()).filter(|pair| far(*pair)).count();
        assert_eq!(count, 0);
    }

    // Planted: the planes of another order, and bases of which one block is another.
    let mut broken = textures.clone();
    let layer_bytes = broken.all[1].levels[0].len() / broken.all[1].layers.unwrap() as usize;
    broken.all[1].levels[0].rotate_left(layer_bytes);
    assert!(psnr(&gpu.values(&glsl, &broken, &queries)[..QUERIES], &wanted[..QUERIES]) < at_pairs - 5.0);
    let mut broken = textures;
    broken.all[3].levels[0][..16].fill(0);
    let damaged = gpu.values(&glsl, &broken, &queries);
    assert!(damaged.iter().zip(&found).any(|(a, b)| (a[0] - b[0]).abs() > 0.02));
}

#[test]
fn filtering_between_texels_and_levels_keeps_the_mean() {
    let Some(gpu) = gpu() else { return };
    let Exported { folder, asset, resident, .. } = exported(400_000);
    let textures = read_textures(&folder.path().join("weave.ktx2"), "front").unwrap();
    let mut random = Random::new(9);
    let layer = &asset.layers[0];
    let (mut queries, mut means) = (Vec::new(), Vec::new());
    let levels = resident.levels();
    for number in 0..256 {
        let [wi, wo] =
            [layer.lights.direction(random.below(81) as u32), layer.views.direction(random.below(81) as u32)];
        // Between texels of the finest level; between two levels; the level of one texel.
        let level = [0.0, random.within(0.0, 2.0), (levels - 1) as f32][number % 3];
        for _ in 0..4 {
            let uv = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
            queries.push([[uv[0], uv[1], level, 0.0], [wi[0], wi[1], wi[2], 0.0], [wo[0], wo[1], wo[2], 0.0]]);
        }
        let texels =
            (0..SIZE * SIZE).map(|texel| decode(&resident, 0, texel as u32, wi, wo, &DecodeOptions::default()));
        let sum = texels.fold([0.0; 3], |sum, value| [0, 1, 2].map(|c| sum[c] + value[c]));
        means.push(sum.map(|x| x / (SIZE * SIZE) as f32));
    }
    let found = gpu.values(&gpu.glsl(), &textures, &queries);
    let energy = |kind: usize| {
        let of = |i: &usize| i % 3 == kind;
        let shown: f32 =
            (0..256).filter(of).map(|i| found[4 * i..4 * i + 4].as_flattened().iter().sum::<f32>() / 4.0).sum();
        let wanted: f32 = (0..256).filter(of).map(|i| means[i].iter().sum::<f32>()).sum();
        shown / wanted
    };
    let ratios = [0, 1, 2].map(energy);
    println!("shown over mean, between texels, between levels, at the last level: {ratios:?}");
    // Four places of 256 texels: a few per cent of noise.
    assert!((ratios[0] - 1.0).abs() < 0.08 && (ratios[1] - 1.0).abs() < 0.08, "{ratios:?}");
    assert!((ratios[2] - 1.0).abs() < 0.03, "{ratios:?}");
}

#[test]
fn textures_fitted_to_the_capture_are_nearer_to_it_and_any_reader_takes_them() {
    let Exported { folder, asset, export, .. } = exported(400_000);
    let capture = capture(&folder.path().join("WEAVE"));
    let bytes: Vec<(String, Vec<u8>)> = export.files.clone();
    let again = write(folder.path(), &asset, &[], 400_000);
    assert_eq!(again, export, "the same asset gives the same bytes");
    if let Some(packages) = packages() {
        for (name, bytes) in &bytes {
            let path = folder.path().join(name);
            let report = judge(&packages, "read_ktx2.mjs", &path).unwrap_or_else(|text| panic!("{name}: {text}"));
            assert_eq!((&report["again"], report["notes"].is_null()), (&true.into(), name != "weave.ktx2"), "{name}");
            std::fs::write(&path, &bytes[..bytes.len() - 16]).unwrap();
            assert!(judge(&packages, "read_ktx2.mjs", &path).is_err(), "{name}: cut short");
            std::fs::write(&path, bytes).unwrap();
        }
    }
    let fitted = write(folder.path(), &asset, std::slice::from_ref(&capture), 400_000);
    let error = fitted.layers[0].error;
    let [textures, of_asset] = [error.psnr_to_capture_db, error.asset_psnr_to_capture_db].map(Option::unwrap);
    println!(
        "to the capture: {textures:.2} dB, the asset {of_asset:.2} dB, both to each other {:.2}",
        error.psnr_to_asset_db
    );
    assert!(
        error.psnr_to_asset_db < export.layers[0].error.psnr_to_asset_db && textures > error.psnr_to_asset_db - 0.2
    );

    let refused = |captures: &[Capture], bytes| {
        let params = FilteredParams { bytes: Some(bytes), memory_bytes: 1 << 30 };
        export_filtered(&asset, "weave", captures, &params, &Monitor::default()).unwrap_err().to_string()
    };
    assert!(refused(&[], 1000).contains("allow at least"), "{}", refused(&[], 1000));
    let set = DirectionSet::random(9, 2).unwrap();
    let other = capture_of(&folder.path().join("OTHER"), SIZE, &set, &set, ImageFormat::Png, |_, _, _| [0.2; 3]);
    let sentence = refused(std::slice::from_ref(&other), 400_000);
    assert!(sentence.contains("other texels or directions"), "{sentence}");
}

#[test]
fn a_single_view_has_textures_too() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (view, lights) = (DirectionSet::random(1, 4).unwrap(), DirectionSet::bonn81());
    let value =
        |texel: usize, wi: [f32; 3], _: [f32; 3]| [0.2 + 0.6 * (texel % 7) as f32 / 7.0, 0.3, 0.1].map(|x| x * wi[2]);
    let capture = capture_of(&folder.path().join("ONE"), SIZE, &view, &lights, ImageFormat::Png, value);
    let asset = fitted(&capture, &small_fit(folder.path())).asset;
    write(folder.path(), &asset, &[], 200_000);
    let textures = read_textures(&folder.path().join("weave.ktx2"), "front").unwrap();
    let layer = &asset.layers[0];
    let queries: Vec<Query> = (0..64)
        .map(|i| query(i * 3, SIZE, 0.0, layer.lights.direction(i as u32), [0.1 * (i % 9) as f32, 0.0, 0.6]))
        .collect();
    let found = gpu.values(&gpu.glsl(), &textures, &queries);
    let wanted: Vec<[f32; 3]> = (0..64).map(|i| value(i * 3, layer.lights.direction(i as u32), [0.0; 3])).collect();
    assert!(psnr(&found, &wanted) > 25.0 && found.as_flattened().iter().all(|x| x.is_finite()), "{found:?}");
    let wrong = gpu.values(&gpu.glsl(), &textures, &queries[..1].repeat(64));
    assert!(psnr(&wrong, &wanted) < 20.0, "planted: one query for all");
}

#[test]
fn a_missing_or_wrong_file_is_named() {
    let Exported { folder, export, .. } = exported(300_000);
    let first = folder.path().join("weave.ktx2");
    let sentence = |path: &Path, side: &str| read_textures(path, side).unwrap_err().to_string();
    assert!(sentence(&first, "back").contains("no layer of the side back"));
    assert!(sentence(&folder.path().join("weave.mean-front.ktx2"), "front").contains("does not name the other files"));
    let (name, bytes) = export.files.iter().find(|(name, _)| name.contains("bases")).unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(sentence(&first, "front").contains("bases-front.ktx2"));
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(read_textures(&first, "front").unwrap_err(), TextureError::File { .. }));
}
