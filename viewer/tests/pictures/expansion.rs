//! Bases that the GPU expands are those that the CPU does, wherever they lie. See `gpu.rs` for what a missing adapter
//! means.

use crate::support::{count_differences, gpu};
use btf_runtime::testing::{Random, sample_asset, sample_predicted_asset};
use btf_runtime::{
    Asset, Basis, Edit, Edits, Factors, Resident, ResidualKind, SharedBases, SurfaceSide, serial, with_levels,
};
use btf_viewer::testing::gpu_expand;
use btf_viewer::{
    CpuPicture, Expansion, FrameRequest, Gpu, GpuTracer, MeshChoice, Scene, SceneAsset, SceneChange, ShadeOptions,
    Tracer, Updated,
};
use half::f16;
use std::sync::Arc;

/// Rounding of f32 sums in another order, relative to the largest basis value of a layer.
const OF_PEAK: f32 = 2e-6;

/// Asset words that differ, but for the bases; and halves of the bases that differ by more than one step at their size
/// and [`OF_PEAK`].
fn differences(expected: &Resident, found: &[u32]) -> (usize, usize) {
    let words = expected.words();
    assert_eq!(words.len(), found.len());
    let (mut elsewhere, mut of_bases, mut at) = (0, 0, 0);
    let other = |a: &[u32], b: &[u32]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    for layer in 0..expected.layers() {
        let place = expected.bases_of(layer);
        if place.is_empty() {
            continue;
        }
        elsewhere += other(&words[at..place.start], &found[at..place.start]);
        at = place.end;
        let halves = |words: &[u32]| -> Vec<f32> {
            words
                .iter()
                .flat_map(|word| [*word as u16, (*word >> 16) as u16])
                .map(|x| f16::from_bits(x).to_f32())
                .collect()
        };
        let (expected, found) = (halves(&words[place.clone()]), halves(&found[place]));
        let peak = expected.iter().fold(0.0f32, |peak, x| peak.max(x.abs()));
        assert!(peak > 0.0);
        let close = |a: f32, b: f32| (a - b).abs() <= (a.abs() * 2f32.powi(-10)).max(2f32.powi(-24)) + OF_PEAK * peak;
        of_bases += expected.iter().zip(&found).filter(|(a, b)| !close(**a, **b)).count();
    }
    (elsewhere + other(&words[at..], &found[at..]), of_bases)
}

/// A residual of other ranks, one of them 0, of many clusters and an even or odd number of bases.
fn enlarge(asset: &mut Asset, seed: u64, clusters: usize, components: usize) {
    let mut random = Random::new(seed);
    let layer = &mut asset.layers[0];
    let lobes = layer.dictionary[0].clone();
    layer.dictionary = vec![lobes; clusters];
    layer.texel_clusters.iter_mut().for_each(|cluster| *cluster = random.below(clusters) as u8);
    let residual = layer.residual.as_mut().unwrap();
    let ranks = [[9, 7], [3, 0], [1, 12]];
    let shape = residual.factors.shape;
    let mut matrix = |rows: usize, rank: usize| {
        (0..rows * rank).map(|_| f16::from_f32(random.within(-1.0, 1.0))).collect::<Vec<_>>()
    };
    residual.factors = Factors {
        shape,
        ranks,
        view: ranks.map(|[rank, _]| matrix(shape[0], rank)),
        light: ranks.map(|[_, rank]| matrix(shape[1], rank)),
    };
    const SHARED: usize = 17;
    // Most codes of real cores are 0.
    let mut codes = |count: usize| -> Vec<i16> {
        (0..count).map(|_| if random.below(4) == 0 { random.below(201) as i16 - 100 } else { 0 }).collect()
    };
    let steps = (0..SHARED).map(|number| 0.01 / (1.0 + number as f32)).collect();
    residual.shared = SharedBases { steps, values: codes(SHARED * residual.factors.core_len()) };
    residual.bases = (0..=components)
        .map(|index| {
            let steps = (0..clusters).map(|cluster| 0.01 / (1.0 + (index + cluster) as f32)).collect();
            Basis { steps, values: codes(clusters * SHARED) }
        })
        .collect();
    let plane = residual.coefficients[0].clone();
    residual.coefficients = vec![plane; components];
}

/// Assets of every kind: odd sizes, with the levels' own cluster, edits, three layers of which one has no residual,
/// many clusters.
fn assets() -> Vec<Asset> {
    let kinds = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];
    let mut assets: Vec<Asset> = kinds
        .iter()
        .zip([[7, 5], [6, 6], [1, 3]])
        .map(|(kind, [w, h])| sample_asset(*kind as u64, w, h, *kind))
        .collect();
    let mut leveled = with_levels(&sample_asset(8, 12, 9, ResidualKind::Root), &serial);
    leveled.edits = Edits { list: vec![Edit { tint: [0.5; 3], ..Edit::default() }], texels: vec![1; 108] };
    assets.push(leveled);
    for (seed, clusters, components) in [(11, 40, 12), (12, 1, 1), (13, 256, 3)] {
        let mut asset = sample_asset(seed, 5, 5, ResidualKind::Root);
        enlarge(&mut asset, seed, clusters, components);
        assets.push(asset);
    }
    assets.extend(kinds.map(|kind| sample_predicted_asset(20 + kind as u64, 9, 7, kind)));
    let mut layers = assets[4].clone();
    let [mut bare, mut back] = [5, 6].map(|number: usize| Asset::clone(&assets[number]).layers[0].clone());
    bare.residual = None;
    bare.view_side = SurfaceSide::Back;
    (back.light_side, back.view_side) = (SurfaceSide::Back, SurfaceSide::Back);
    layers.layers.extend([bare, back]);
    assets.push(layers);
    assets
}

#[test]
fn the_gpu_expands_bases_like_the_cpu() {
    let Some(gpu) = gpu("the_gpu_expands_bases_like_the_cpu") else { return };
    for (number, asset) in assets().iter().enumerate() {
        let found = gpu_expand(&gpu, asset).unwrap();
        assert_eq!(differences(&Resident::from_asset(asset), &found), (0, 0), "{number}");
        // Planted differences: the clusters' mixtures exchanged, a factor transposed, a factor's last number changed.
        let planted = |change: &dyn Fn(&mut btf_runtime::Residual)| {
            let mut other = asset.clone();
            change(other.layers[0].residual.as_mut().unwrap());
            differences(&Resident::from_asset(&other), &found).1
        };
        let exchanged = planted(&|residual| {
            let shared = residual.shared.steps.len();
            residual.bases.iter_mut().for_each(|basis| basis.values.rotate_left(shared));
        });
        assert_eq!(exchanged > 0, asset.layers[0].dictionary.len() > 1, "{number}");
        let transposed = planted(&|residual| {
            let rank = residual.factors.ranks[0][0];
            let old = residual.factors.view[0].clone();
            let rows = old.len() / rank;
            residual.factors.view[0] = (0..old.len()).map(|i| old[i % rows * rank + i / rows]).collect();
        });
        assert_eq!(transposed > 0, asset.layers[0].residual.as_ref().unwrap().factors.ranks[0][0] > 1, "{number}");
        let last = planted(&|residual| {
            if let Some(x) = residual.factors.light[0].last_mut() {
                *x = f16::from_f32(x.to_f32() + 0.5);
            }
        });
        assert!(last > 0, "{number}");
        // Planted difference: nothing is taken by the lobes.
        if asset.layers[0].lobe_weights.is_some() {
            let mut other = asset.clone();
            other.layers[0].lobe_weights = None;
            assert!(differences(&Resident::from_asset(&other), &found).1 > 0, "{number}");
        }
    }
}

#[test]
fn values_beyond_halves_are_clamped_as_the_cpu_does() {
    let Some(gpu) = gpu("values_beyond_halves_are_clamped_as_the_cpu_does") else { return };
    let mut asset = sample_asset(4, 3, 3, ResidualKind::Additive);
    let residual = asset.layers[0].residual.as_mut().unwrap();
    residual.bases[0].steps.iter_mut().for_each(|step| *step *= 1e8);
    let found = gpu_expand(&gpu, &asset).unwrap();
    let expected = Resident::from_asset(&asset);
    assert_eq!(differences(&expected, &found), (0, 0));
    let largest = |words: &[u32]| words.iter().filter(|word| **word as u16 & 0x7fff == 0x7bff).count();
    let place = expected.bases_of(0);
    assert!(largest(&found[place]) > 100);
}

#[test]
fn bases_that_lie_across_pieces_are_the_same() {
    let Some(mut gpu) = gpu("bases_that_lie_across_pieces_are_the_same") else { return };
    let assets = assets();
    let asset = &assets[4];
    let whole = gpu_expand(&gpu, asset).unwrap();
    let bytes = 4 * whole.len() as u64;
    // Pieces that end within a cluster, and slices of fewer clusters.
    gpu.limit_bindings(bytes / 5);
    assert_eq!(gpu_expand(&gpu, asset).unwrap(), whole);
    gpu.limit_bindings(bytes / 1000);
    assert!(gpu_expand(&gpu, asset).unwrap_err().to_string().contains("a cluster of this asset"));
}

/// A scene of the asset alone, on a plane.
fn scene(asset: &Asset) -> Scene {
    let loaded = vec![Arc::new(SceneAsset::new("sample", asset.clone()))];
    Scene::built_in(&MeshChoice::Plane, loaded, [1.0; 2]).unwrap()
}

/// The asset as a device draws it that expands bases itself or has the CPU do it, with edits that come later.
fn drawn(gpu: &mut Gpu, expansion: Expansion, asset: &Asset, edits: &Edits) -> Vec<[f32; 3]> {
    gpu.expand_bases(expansion);
    let mut scene = scene(asset);
    let mut tracer = Tracer::new(gpu, &scene, GpuTracer::Bvh).unwrap();
    Arc::make_mut(&mut scene.assets[0]).set_edits(edits.clone());
    assert_eq!(tracer.update(&scene, &SceneChange::Edits(0)).unwrap(), Updated::InPlace);
    let request = FrameRequest { scene: &scene, size: [64, 48], options: ShadeOptions::default(), sample: 0 };
    tracer.sample(&request, None).unwrap();
    assert_eq!(scene.assets[0].is_expanded(), expansion == Expansion::OnCpu);
    let picture = tracer.read_radiance().unwrap();
    // The CPU can still draw what the GPU has expanded, edits included.
    let mut cpu = CpuPicture::new([64, 48]);
    cpu.add_sample(&scene, &ShadeOptions::default(), &|| true);
    assert!(count_differences(&cpu.radiance(), &picture) <= picture.len() / 200);
    picture
}

#[test]
fn pictures_of_bases_expanded_by_the_gpu_are_those_of_the_cpus() {
    let Some(mut gpu) = gpu("pictures_of_bases_expanded_by_the_gpu_are_those_of_the_cpus") else { return };
    let asset = sample_asset(5, 24, 16, ResidualKind::Root);
    let edits = Edits { list: vec![Edit { tint: [0.2, 0.9, 1.4], ..Edit::default() }], texels: vec![1; 24 * 16] };
    let by_cpu = drawn(&mut gpu, Expansion::OnCpu, &asset, &edits);
    assert_eq!(count_differences(&by_cpu, &drawn(&mut gpu, Expansion::OnGpu, &asset, &edits)), 0);
    // Planted difference: another asset's bases.
    let mut other = asset.clone();
    other.layers[0].residual.as_mut().unwrap().bases[0].steps.rotate_left(1);
    assert!(count_differences(&by_cpu, &drawn(&mut gpu, Expansion::OnGpu, &other, &edits)) > by_cpu.len() / 50);
}

#[test]
fn the_cpu_expands_what_a_gpu_cannot_bind() {
    let Some(mut gpu) = gpu("the_cpu_expands_what_a_gpu_cannot_bind") else { return };
    gpu.expand_bases(Expansion::OnGpu);
    let mut asset = sample_asset(5, 24, 16, ResidualKind::Root);
    enlarge(&mut asset, 3, 2, 20);
    let expanded = |gpu: &Gpu| {
        let scene = scene(&asset);
        Tracer::new(gpu, &scene, GpuTracer::Bvh).unwrap();
        scene.assets[0].is_expanded()
    };
    assert!(!expanded(&gpu));
    gpu.limit_bindings(1 << 14);
    assert!(expanded(&gpu));
}
