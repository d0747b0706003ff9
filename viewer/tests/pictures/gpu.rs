//! What the GPU draws is what the CPU reference draws. A missing adapter is a failure, unless `BTF_SKIP_GPU=1` is set;
//! then each test prints one line `skipped: ...` and passes.

use crate::support::{ABSOLUTE, RELATIVE, backends, count_differences, difference, gpu, tracers};
use btf_runtime::testing::{
    Random, dense_asset, sample_asset, sample_grouped_spectrum, sample_heights, sample_relief_asset,
    sample_spectral_asset,
};
use btf_runtime::{
    Asset, DecodeOptions, Edit, Edits, HeightUse, Heights, Interpolation, LobeRole, PackedGoal, Resident, ResidualKind,
    decode, pack, serial, with_levels,
};
use btf_viewer::testing::{DecodeQuery, gpu_decode, random_queries};
use btf_viewer::{
    BackendChoice, Camera, Control, CpuPicture, Environment, FrameRequest, GpuTracer, Material, MeshChoice, NO_HIT,
    PointLight, RenderMode, RenderParams, Rendered, Scene, SceneAsset, SceneObject, ShadeOptions, Tracer, render,
};
use std::sync::Arc;

fn asset(seed: u64, kind: ResidualKind) -> Asset {
    // Through the file form, as a user's asset goes.
    Asset::parse(&pack(&sample_asset(seed, 24, 16, kind)).unwrap()).unwrap()
}

#[test]
fn gpu_decodes_100_000_samples_like_the_cpu() {
    let Some(gpu) = gpu("gpu_decodes_100_000_samples_like_the_cpu") else { return };
    let tracers = tracers("gpu_decodes_100_000_samples_like_the_cpu");
    const SAMPLES: usize = 100_000;
    for (seed, kind, role, with_heights, packed) in [
        (1, ResidualKind::Additive, LobeRole::Base, false, false),
        (2, ResidualKind::Log, LobeRole::Base, false, false),
        (3, ResidualKind::Root, LobeRole::Base, false, false),
        (4, ResidualKind::Additive, LobeRole::Guide, false, false),
        (5, ResidualKind::Root, LobeRole::Guide, false, false),
        (5, ResidualKind::Root, LobeRole::Guide, true, false),
        (2, ResidualKind::Log, LobeRole::Base, true, false),
        (3, ResidualKind::Root, LobeRole::Base, false, true),
        (4, ResidualKind::Additive, LobeRole::Guide, true, true),
    ] {
        // A ray that grazes an edge of rough heights may hit it on one machine and miss it on another.
        let allowed = if with_heights { SAMPLES / 100 } else { 0 };
        let in_role = |role: LobeRole| {
            let mut asset = asset(seed, kind);
            asset.layers[0].lobe_role = role;
            asset.layers[0].heights = with_heights.then(|| sample_heights(seed, asset.texel_count()));
            // A quarter of the texels is edited.
            let edit = Edit { tint: [0.9, 0.4, 1.5], roughness: 1.5, tilt: [0.1, 0.2], ..Edit::default() };
            let texels = (0..asset.texel_count()).map(|texel| u8::from(texel % 4 == 1)).collect();
            asset.edits = Edits { list: vec![edit], texels };
            let asset = with_levels(&asset, &serial);
            match packed {
                true => Resident::packed_on(&asset, PackedGoal::Noise(0.01), &serial),
                false => Resident::from_asset(&asset),
            }
        };
        let resident = in_role(role);
        let other_role = in_role(if role == LobeRole::Base { LobeRole::Guide } else { LobeRole::Base });
        let queries = random_queries(&resident, seed, SAMPLES);
        for interpolation in [Interpolation::Fast, Interpolation::Exact] {
            let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
            let cpu = |resident: &Resident, options: &DecodeOptions| -> Vec<[f32; 3]> {
                queries.iter().map(|q| decode(resident, q.layer, q.texel, q.wi, q.wo, options)).collect()
            };
            let expected = cpu(&resident, &options);
            for &tracer in &tracers {
                let found = gpu_decode(&gpu, tracer, &resident, &options, &queries).unwrap();
                let worst = expected.iter().zip(&found).map(|(a, b)| difference(a, b)).fold(0.0, f32::max);
                println!("{kind:?} {role:?} {interpolation:?} {}: worst {worst:.4} of the tolerance", tracer.name());
                let differences = count_differences(&expected, &found);
                assert!(differences <= allowed, "{kind:?} {role:?} {interpolation:?} {}: {differences}", tracer.name());
                // Planted differences: one component less, lobes in the other role, one value off by two tolerances.
                let fewer = cpu(&resident, &DecodeOptions { components: 3, ..options });
                assert!(count_differences(&fewer, &found) > SAMPLES / 100);
                assert!(count_differences(&cpu(&other_role, &options), &found) > SAMPLES / 100);
                let flat = cpu(&resident, &DecodeOptions { heights: HeightUse::None, ..options });
                assert_eq!(count_differences(&flat, &found) > SAMPLES / 20, with_heights);
                let mut off = expected.clone();
                off[777][1] += 2.0 * (ABSOLUTE + RELATIVE * off[777][1]);
                assert_eq!(count_differences(&off, &found), differences + 1);
            }
        }
    }
}

#[test]
fn rows_that_are_read_in_quads_decode_like_the_cpu() {
    let Some(gpu) = gpu("rows_that_are_read_in_quads_decode_like_the_cpu") else { return };
    const SAMPLES: usize = 20_000;
    for components in [21, 23, 30] {
        let resident = Resident::from_asset(&dense_asset(components as u64, 16, components));
        assert!(!resident.has_uneven_rows(), "{components}");
        let queries = random_queries(&resident, 3, SAMPLES);
        // Every number of bases begins its last quad elsewhere.
        for used in [components as u32, 11, 8, 7, 1] {
            let options = DecodeOptions { components: used, ..DecodeOptions::default() };
            let cpu = |options: &DecodeOptions| -> Vec<[f32; 3]> {
                queries.iter().map(|q| decode(&resident, q.layer, q.texel, q.wi, q.wo, options)).collect()
            };
            let found = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap();
            assert_eq!(count_differences(&cpu(&options), &found), 0, "{used} of {components}");
            // Planted difference: half of the components.
            let fewer = cpu(&DecodeOptions { components: used / 2, ..options });
            assert!(count_differences(&fewer, &found) > SAMPLES / 10, "{used} of {components}");
        }
    }
}

#[test]
fn gpu_decodes_relief_like_the_cpu() {
    let Some(gpu) = gpu("gpu_decodes_relief_like_the_cpu") else { return };
    const SAMPLES: usize = 20_000;
    let resident = Resident::from_asset(&with_levels(&sample_relief_asset(8, 24, 16), &serial));
    let queries = random_queries(&resident, 9, SAMPLES);
    let options = DecodeOptions::default();
    let cpu = |options: &DecodeOptions| -> Vec<[f32; 3]> {
        queries.iter().map(|q| decode(&resident, q.layer, q.texel, q.wi, q.wo, options)).collect()
    };
    for tracer in tracers("gpu_decodes_relief_like_the_cpu") {
        let found = gpu_decode(&gpu, tracer, &resident, &options, &queries).unwrap();
        // A ray that grazes an edge of the heights may hit it on one machine and miss it on another.
        let differences = count_differences(&cpu(&options), &found);
        assert!(differences <= SAMPLES / 100, "{}: {differences}", tracer.name());
        // Planted difference: no relief.
        let plain = cpu(&DecodeOptions { heights: HeightUse::Parallax, ..options });
        assert!(count_differences(&plain, &found) > SAMPLES / 10, "{}", tracer.name());
    }
}

#[test]
fn gpu_decodes_a_spectrum_like_the_cpu() {
    let Some(gpu) = gpu("gpu_decodes_a_spectrum_like_the_cpu") else { return };
    const SAMPLES: usize = 20_000;
    for asset in [sample_spectral_asset(8, 24, 16), sample_grouped_spectrum(8, 24, 16)] {
        let asset = with_levels(&asset, &serial);
        let resident = Resident::from_asset(&asset);
        let queries = random_queries(&resident, 9, SAMPLES);
        let options = DecodeOptions::default();
        let cpu = |resident: &Resident| -> Vec<[f32; 3]> {
            queries.iter().map(|q| decode(resident, q.layer, q.texel, q.wi, q.wo, &options)).collect()
        };
        let found = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap();
        assert_eq!(count_differences(&cpu(&resident), &found), 0);
        // Planted differences: other weights, and the channels as colours.
        let mut other = resident.clone();
        let half = std::array::from_fn(|i| if i < 2 { 0.5 } else { 0.0 });
        assert!(!other.set_shown([half; 3]).is_empty());
        let colours = Resident::from_asset(&Asset { spectrum: None, ..asset });
        for planted in [&other, &colours] {
            assert!(count_differences(&cpu(planted), &found) > SAMPLES / 3);
        }
    }
}

#[test]
fn assets_in_pieces_decode_like_assets_in_one() {
    let Some(mut gpu) = gpu("assets_in_pieces_decode_like_assets_in_one") else { return };
    let resident = Resident::from_asset(&asset(1, ResidualKind::Root));
    let options = DecodeOptions::default();
    let mut random = Random::new(9);
    let queries: Vec<DecodeQuery> = (0..2000)
        .map(|_| DecodeQuery {
            layer: 0,
            texel: random.below(24 * 16) as u32,
            wi: random.direction(),
            wo: random.direction(),
        })
        .collect();
    let whole = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap();
    let bytes = 4 * resident.words().len() as u64;
    gpu.limit_bindings(bytes / 3);
    let cut = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap();
    assert_eq!(whole, cut);
    assert!(whole.iter().any(|value| value[1] > 0.01));
    // More pieces than the adapter binds are refused with a remedy.
    gpu.limit_bindings(bytes / 100);
    let message = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap_err().to_string();
    assert!(message.contains("btf-fit fit --bytes"), "{message}");
}

fn scene(mesh: MeshChoice) -> Scene {
    let assets = vec![Arc::new(SceneAsset::new("sample", asset(5, ResidualKind::Root)))];
    let mut scene = Scene::built_in(&mesh, assets, [1.0; 2]).unwrap();
    scene.place_lights(3);
    scene
}

fn draw(scene: &Scene, backend: BackendChoice, frames: u32) -> Rendered {
    let params = RenderParams { size: [160, 120], frames, backend, ..RenderParams::default() };
    render(scene, &params, &Control::SILENT).unwrap()
}

/// Pixels whose primitives differ, and of those the ones that do not lie on an edge. On an edge, within rounding, a ray
/// may go to either side: the two triangles have a corner in common, or (silhouettes) a pixel beside this one hits the
/// other.
fn primitive_differences(scene: &Scene, a: &Rendered, b: &Rendered) -> (usize, usize) {
    let (width, height) = (a.report.width as usize, a.report.height as usize);
    let mut differences = (0, 0);
    for (pixel, (p, q)) in a.hits.iter().zip(&b.hits).map(|(a, b)| (a.primitive, b.primitive)).enumerate() {
        if p == q {
            continue;
        }
        let corners_touch = p != NO_HIT
            && q != NO_HIT
            && scene.geometry.corners(p).iter().any(|corner| scene.geometry.corners(q).contains(corner));
        let (x, y) = (pixel % width, pixel / width);
        let beside = (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
            .any(|near| a.hits[near].primitive == q);
        differences.0 += 1;
        differences.1 += usize::from(!corners_touch && !beside);
    }
    differences
}

/// Share of pixels that may lie on an edge within rounding, on a processor and on a GPU, which fuses other products: of 19,200
/// an H200 had 45 in the Cornell box.
const EDGE_SHARE: usize = 500;
const EDGE_SHARE_OF_A_GPU: usize = 300;

#[test]
fn ray_query_bvh_and_cpu_agree_on_the_hit_primitive_of_every_pixel() {
    let Some(gpu) = gpu("ray_query_bvh_and_cpu_agree_on_the_hit_primitive_of_every_pixel") else { return };
    let tracers = tracers("ray_query_bvh_and_cpu_agree_on_the_hit_primitive_of_every_pixel");
    let is_software = gpu.device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    let edge_share = if is_software { EDGE_SHARE } else { EDGE_SHARE_OF_A_GPU };
    for mesh in [MeshChoice::Sphere, MeshChoice::Plane, MeshChoice::Cornell] {
        let scene = scene(mesh.clone());
        let cpu = draw(&scene, BackendChoice::Cpu, 1);
        let traced = tracers.iter().map(|tracer| (tracer.name(), draw(&scene, BackendChoice::Gpu(*tracer), 1)));
        let drawn: Vec<_> = traced.chain([("cpu", cpu)]).collect();
        assert!(drawn[0].1.hits.iter().any(|hit| hit.primitive != NO_HIT));
        let pairs = (0..drawn.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        for ((a_name, a), (b_name, b)) in pairs.map(|(i, j)| (&drawn[i], &drawn[j])) {
            let name = format!("{b_name}, {a_name}");
            let (edges, faults) = primitive_differences(&scene, a, b);
            println!("{mesh:?}, {name}: {edges} edge pixels differ, {faults} pixels elsewhere");
            assert!(edges <= a.hits.len() / edge_share && faults == 0, "{mesh:?}, {name}");
        }
        // Planted difference: a camera that is half a pixel further.
        let mut moved = scene.clone();
        moved.camera.pan(0.5 / 120.0, 0.0);
        let (edges, faults) =
            primitive_differences(&scene, &drawn[0].1, &draw(&moved, BackendChoice::Gpu(GpuTracer::Bvh), 1));
        assert!(edges > drawn[0].1.hits.len() / edge_share || faults > 0, "{mesh:?}");
    }
}

/// Pixels whose radiance differs. Nearest texels and shadow edges flip where rounding does.
fn picture_differences(a: &Rendered, b: &Rendered) -> usize {
    count_differences(&a.picture.radiance, &b.picture.radiance)
}

#[test]
fn gpu_pictures_equal_the_cpu_picture() {
    let Some(_gpu) = gpu("gpu_pictures_equal_the_cpu_picture") else { return };
    let tracers = tracers("gpu_pictures_equal_the_cpu_picture");
    for mesh in [MeshChoice::Sphere, MeshChoice::Cornell] {
        let scene = scene(mesh.clone());
        let cpu = draw(&scene, BackendChoice::Cpu, 2);
        assert!(cpu.report.spmm_evaluations > 0 && cpu.report.rays > 0);
        let allowed = cpu.hits.len() / 200;
        for &tracer in &tracers {
            let found = draw(&scene, BackendChoice::Gpu(tracer), 2);
            let differences = picture_differences(&cpu, &found);
            println!("{mesh:?}, {}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
            assert!(differences <= allowed, "{mesh:?} {}: {differences}", tracer.name());
            let share = found.report.spmm_evaluations as f64 / cpu.report.spmm_evaluations as f64;
            assert!((share - 1.0).abs() < 0.002, "{share}");
        }
        // Planted differences: a light that moves a little, and one sample less per pixel.
        let mut moved = scene.clone();
        moved.lights[0].position.x += 0.02 * moved.lights[0].position.length();
        assert!(picture_differences(&cpu, &draw(&moved, BackendChoice::Gpu(GpuTracer::Bvh), 2)) > allowed);
        assert!(picture_differences(&cpu, &draw(&scene, BackendChoice::Gpu(GpuTracer::Bvh), 1)) > allowed);
    }
}

/// The Cornell box with lamps all over it, of uneven power.
fn box_of_lamps(count: u64) -> Scene {
    let mut scene = scene(MeshChoice::Cornell);
    let mut random = Random::new(count);
    let mut lamp = |number: u64| {
        let position = [(); 3].map(|_| random.within(-0.9, 0.9)).into();
        PointLight { position, intensity: [(if number.is_multiple_of(7) { 10.0 } else { 1.0 }) / count as f32; 3] }
    };
    scene.lights = (0..count).map(&mut lamp).collect();
    scene
}

#[test]
fn drawn_lights_are_the_cpus() {
    let Some(gpu) = gpu("drawn_lights_are_the_cpus") else { return };
    // With a grid, and where candidates are enough for all lights.
    for (count, light_samples) in [(300, 3), (60, 10)] {
        let scene = box_of_lamps(count);
        let shade = ShadeOptions { light_samples, ..ShadeOptions::default() };
        let draw = |scene: &Scene, backend| {
            let params = RenderParams { size: [64, 64], frames: 2, backend, shade, ..RenderParams::default() };
            render(scene, &params, &Control::SILENT).unwrap()
        };
        let cpu = draw(&scene, BackendChoice::Cpu);
        // Many lights have many edges of shadows, where rays go either way.
        let allowed = cpu.hits.len() / 50;
        for tracer in tracers("drawn_lights_are_the_cpus") {
            let differences = picture_differences(&cpu, &draw(&scene, BackendChoice::Gpu(tracer)));
            println!("{count} lights, {}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
            assert!(differences <= allowed, "{count} {}: {differences}", tracer.name());
        }
        // Planted difference: a light is brighter, and they have another order, so that all are drawn by other numbers.
        let mut other = scene.clone();
        other.lights.rotate_left(7);
        other.lights[0].intensity = other.lights[0].intensity.map(|x| 1.1 * x);
        let differences = picture_differences(&cpu, &draw(&other, BackendChoice::Gpu(GpuTracer::Bvh)));
        assert!(differences > 10 * allowed, "{count}: {differences}");
    }
    // Lights change under a tracer: more and fewer, all of them, and as many as before.
    let mut tracer = Tracer::new(&gpu, &scene(MeshChoice::Cornell), GpuTracer::Bvh).unwrap();
    let size = [32, 32];
    for (count, light_samples) in [(300, 3), (400, 64), (300, 3), (299, 3), (2000, 3)] {
        let scene = box_of_lamps(count);
        let options = ShadeOptions { light_samples, ..ShadeOptions::default() };
        let mut cpu = CpuPicture::new(size);
        cpu.add_sample(&scene, &options, &|| true);
        tracer.sample(&FrameRequest { scene: &scene, size, options, sample: 0 }, None).unwrap();
        let differences = count_differences(&cpu.radiance(), &tracer.read_radiance().unwrap());
        assert!(differences <= cpu.sums.len() / 50, "{count} {light_samples}: {differences}");
    }
}

#[test]
fn mirrors_and_ambient_occlusion_are_the_cpu_pictures() {
    let Some(_gpu) = gpu("mirrors_and_ambient_occlusion_are_the_cpu_pictures") else { return };
    let mut scene = scene(MeshChoice::Cornell);
    scene.ambient = scene.usual_ambient();
    let dull = scene.clone();
    scene.materials.iter_mut().filter(|material| material.asset().is_some()).for_each(|m| m.mirror = [0.5, 0.4, 0.3]);
    let cpu = draw(&scene, BackendChoice::Cpu, 3);
    // Occlusion rays near an edge go either way, and a mirror doubles what the eye sees.
    let allowed = cpu.hits.len() / 100;
    for tracer in tracers("mirrors_and_ambient_occlusion_are_the_cpu_pictures") {
        let found = draw(&scene, BackendChoice::Gpu(tracer), 3);
        let differences = picture_differences(&cpu, &found);
        println!("{}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
        assert!(differences <= allowed, "{}: {differences}", tracer.name());
        let share = found.report.rays as f64 / cpu.report.rays as f64;
        assert!((share - 1.0).abs() < 0.002, "{share}");
        let passes = found.report.passes.unwrap();
        assert!(passes.camera_ms > 0.0 && passes.light_ms > 0.0 && passes.bounce_ms > 0.0);
    }
    // Planted differences: no mirrors, no ambient light, and it from another distance.
    assert!(picture_differences(&cpu, &draw(&dull, BackendChoice::Gpu(GpuTracer::Bvh), 3)) > 5 * allowed);
    let mut other = scene.clone();
    other.ambient.distance *= 0.5;
    assert!(picture_differences(&cpu, &draw(&other, BackendChoice::Gpu(GpuTracer::Bvh), 3)) > allowed);
    other.ambient = btf_viewer::Ambient::NONE;
    assert!(picture_differences(&cpu, &draw(&other, BackendChoice::Gpu(GpuTracer::Bvh), 3)) > 5 * allowed);
}

#[test]
fn traced_paths_are_the_cpus() {
    let Some(_gpu) = gpu("traced_paths_are_the_cpus") else { return };
    let mut scene = scene(MeshChoice::Cornell);
    scene.ambient = scene.usual_ambient();
    scene.materials[0].mirror = [0.5, 0.4, 0.3];
    let path = |backend, depth| {
        let shade = ShadeOptions { mode: RenderMode::Path, depth, ..ShadeOptions::default() };
        let params = RenderParams { size: [96, 72], frames: 2, backend, shade, ..RenderParams::default() };
        render(&scene, &params, &Control::SILENT).unwrap()
    };
    let cpu = path(BackendChoice::Cpu, 4);
    // A path of several rays goes the other way at an edge or a choice that rounding moves, and all after it differs.
    let allowed = cpu.hits.len() / 100;
    for tracer in tracers("traced_paths_are_the_cpus") {
        let found = path(BackendChoice::Gpu(tracer), 4);
        let differences = picture_differences(&cpu, &found);
        println!("{}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
        assert!(differences <= allowed, "{}: {differences}", tracer.name());
        let share = found.report.rays as f64 / cpu.report.rays as f64;
        assert!((share - 1.0).abs() < 0.005, "{share}");
    }
    // Planted difference: paths that end earlier.
    assert!(picture_differences(&cpu, &path(BackendChoice::Gpu(GpuTracer::Bvh), 3)) > 5 * allowed);
}

#[test]
fn a_surrounding_picture_lights_as_on_the_cpu() {
    let Some(_gpu) = gpu("a_surrounding_picture_lights_as_on_the_cpu") else { return };
    let tracers = tracers("a_surrounding_picture_lights_as_on_the_cpu");
    let mut scene = scene(MeshChoice::Sphere);
    let mut rgb = vec![0.3; 64 * 32 * 3];
    rgb[(8 * 64 + 20) * 3..][..3].copy_from_slice(&[400.0, 300.0, 200.0]);
    scene.surround(Environment::new(64, 32, &rgb));
    for mode in [RenderMode::Direct, RenderMode::Path] {
        let picture = |scene: &Scene, backend| {
            let shade = ShadeOptions { mode, depth: 3, ..ShadeOptions::default() };
            let params = RenderParams { size: [96, 72], frames: 2, backend, shade, ..RenderParams::default() };
            render(scene, &params, &Control::SILENT).unwrap()
        };
        let cpu = picture(&scene, BackendChoice::Cpu);
        let allowed = cpu.hits.len() / 100;
        for &tracer in &tracers {
            let differences = picture_differences(&cpu, &picture(&scene, BackendChoice::Gpu(tracer)));
            println!("{mode:?}, {}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
            assert!(differences <= allowed, "{mode:?} {}: {differences}", tracer.name());
        }
        // Planted difference: a pixel of the picture to the right.
        let mut moved = scene.clone();
        let mut rgb = vec![0.3; 64 * 32 * 3];
        rgb[(8 * 64 + 21) * 3..][..3].copy_from_slice(&[400.0, 300.0, 200.0]);
        moved.surround(Environment::new(64, 32, &rgb));
        assert!(picture_differences(&cpu, &picture(&moved, BackendChoice::Cpu)) > 5 * allowed);
    }
}

#[test]
fn progressive_occlusion_converges_to_the_share_of_the_sky() {
    let Some(_gpu) = gpu("progressive_occlusion_converges_to_the_share_of_the_sky") else { return };
    // Under a wide ceiling at height h, occlusion within D leaves (h / D)^2 of the cosine-weighted sky.
    let mut parts = vec![btf_viewer::plane(), btf_viewer::plane()];
    parts[1]
        .transform(glam::Mat4::from_translation(glam::Vec3::Z * 0.5) * glam::Mat4::from_scale(glam::Vec3::splat(40.0)));
    let objects = parts.into_iter().map(|part| SceneObject { part, material: Material::plain([0.8; 3]) }).collect();
    let mut scene = Scene::from_objects(std::path::Path::new("ceiling"), objects, Vec::new()).unwrap();
    scene.camera =
        Camera { eye: glam::Vec3::new(0.0, -0.6, 0.3), target: glam::Vec3::ZERO, up: glam::Vec3::Z, fov_deg: 20.0 };
    scene.lights.clear();
    scene.ambient = btf_viewer::Ambient { radiance: [0.5; 3], distance: 0.5 / 0.3f32.sqrt() };
    let expected = 0.8 * 0.5 * 0.3;
    for backend in backends("progressive_occlusion_converges_to_the_share_of_the_sky") {
        let error = |frames| {
            let rendered = draw(&scene, backend, frames);
            let sum: f64 = rendered.picture.radiance.iter().map(|c| (f64::from(c[1]) - expected).powi(2)).sum();
            (sum / rendered.picture.radiance.len() as f64).sqrt() / expected
        };
        // Stratified: the error falls faster than the root of the samples, by which it would be a quarter.
        let (few, many) = (error(4), error(64));
        println!("{backend:?}: {few:.4} after 4 samples, {many:.4} after 64");
        assert!(few > 0.1 && many < few / 6.0, "{few} {many}");
    }
}

#[test]
fn a_picture_in_short_bands_is_the_same() {
    let Some(gpu) = gpu("a_picture_in_short_bands_is_the_same") else { return };
    let scene = scene(MeshChoice::Cornell);
    let request = FrameRequest { scene: &scene, size: [96, 72], options: ShadeOptions::default(), sample: 0 };
    let picture = |band_ms: Option<f64>| {
        let mut tracer = Tracer::new(&gpu, &scene, GpuTracer::Bvh).unwrap();
        let pixels = band_ms.map(|ms| tracer.limit_bands(&request, ms).unwrap());
        tracer.sample(&request, None).unwrap();
        (pixels, tracer.read_radiance().unwrap())
    };
    let (_, whole) = picture(None);
    // Bands of no time are as short as bands may be; those of hours are the whole picture.
    let (short, in_short) = picture(Some(0.0));
    assert!(short.unwrap() < 96 * 72 / 32, "{short:?}");
    assert_eq!(count_differences(&whole, &in_short), 0);
    let (long, in_long) = picture(Some(1e9));
    assert!(long.unwrap() > 96 * 72, "{long:?}");
    assert_eq!(count_differences(&whole, &in_long), 0);
}

#[test]
fn two_assets_share_one_arena() {
    let Some(_gpu) = gpu("two_assets_share_one_arena") else { return };
    let load = |seed| Arc::new(SceneAsset::new("sample", asset(seed, ResidualKind::Log)));
    let both = Scene::built_in(&MeshChoice::Plane, vec![load(1), load(2)], [1.0; 2]).unwrap();
    let cpu = draw(&both, BackendChoice::Cpu, 1);
    let swapped = Scene { assets: both.assets.iter().rev().cloned().collect(), ..both.clone() };
    let allowed = cpu.hits.len() / 200;
    assert!(picture_differences(&cpu, &draw(&swapped, BackendChoice::Cpu, 1)) > allowed);
    for tracer in tracers("two_assets_share_one_arena") {
        assert!(picture_differences(&cpu, &draw(&both, BackendChoice::Gpu(tracer), 1)) <= allowed);
    }
}

#[test]
fn displaced_surfaces_are_the_cpus() {
    let Some(_gpu) = gpu("displaced_surfaces_are_the_cpus") else { return };
    let mut asset = asset(7, ResidualKind::Root);
    // Hills, not noise: a ray that grazes noise is another one on every machine.
    let wave = |i: usize, of: usize| (std::f32::consts::TAU * i as f32 / of as f32).cos();
    let (width, height) = (asset.width, asset.height);
    let codes = (0..width * height).map(|i| (60.0 * wave(i % width, width) * wave(i / width, height)) as i8);
    asset.layers[0].heights = Some(Heights { step: 1.0 / 32.0, codes: codes.collect() });
    let with = |scale: f32| {
        let asset = Arc::new(SceneAsset::new("hills", asset.clone()));
        let mut scene = Scene::built_in(&MeshChoice::Sphere, vec![asset], [4.0; 2]).unwrap();
        scene.displace(scale);
        scene.materials[0].mirror = [0.2; 3];
        scene
    };
    let cpu = draw(&with(2.0), BackendChoice::Cpu, 2);
    let allowed = cpu.hits.len() / 100;
    for tracer in tracers("displaced_surfaces_are_the_cpus") {
        let differences = picture_differences(&cpu, &draw(&with(2.0), BackendChoice::Gpu(tracer), 2));
        println!("{}: {differences} of {} pixels differ", tracer.name(), cpu.hits.len());
        assert!(differences <= allowed, "{}: {differences}", tracer.name());
    }
    // Planted differences: no relief, and hills of another height.
    for scale in [0.0, 1.5] {
        assert!(picture_differences(&cpu, &draw(&with(scale), BackendChoice::Cpu, 2)) > 5 * allowed, "{scale}");
    }
}
