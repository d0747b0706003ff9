//! Small assets of random content, for tests.

use crate::asset::asset::{Asset, Layer, LobeRole, SurfaceSide};
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::edit::Edits;
use crate::asset::heights::Heights;
use crate::asset::lobe::{Lobe, LobeFamily};
use crate::asset::lobe_weights::LobeWeights;
use crate::asset::relief::Relief;
use crate::asset::residual::{Basis, Coefficients, Factors, PredictedGroup, Residual, ResidualKind, SharedBases};
use crate::asset::spectrum::{Channels, Spectrum};
use crate::asset::sphere::Sphere;
use crate::testing::random::{Random, direction_from_cos, ring_directions};
use half::f16;

/// Returns a random lobe of `family`, with normal, tangent and parameters anywhere in their ranges, rounded by the file
/// form. One parameter in eight is at a bound.
pub fn random_lobe(random: &mut Random, family: LobeFamily) -> Lobe {
    let mut params = [0.0; 4];
    for (param, (least, most)) in params.iter_mut().zip(family.ranges()) {
        *param = match random.below(16) {
            0 => least,
            1 => most,
            // Exponents: as likely below as above the geometric middle.
            _ if least > 0.0 => least * (most / least).powf(random.within(0.0, 1.0)),
            _ => random.within(least, most),
        };
    }
    let tilt = random.within(0.0, 1.0).powi(2);
    let [x, y, _] = direction_from_cos((1.0 - 0.98 * tilt).sqrt(), random.within(0.0, 360.0));
    Lobe { family, normal_xy: [x, y], tangent_rad: random.within(-3.2, 3.2), params }.rounded()
}

pub(super) fn halves(random: &mut Random, count: usize, amplitude: f32) -> Vec<f16> {
    (0..count).map(|_| f16::from_f32(random.within(-amplitude, amplitude))).collect()
}

/// Number of clusters of a sample asset.
const CLUSTERS: usize = 3;
/// Number of residual components of a sample asset.
const COMPONENTS: usize = 4;
/// Number of shared bases of a sample asset.
const SHARED: usize = 3;

/// Returns a one-layer asset of random content that [`crate::pack`] writes and [`Asset::parse`] reads back equal: three
/// clusters, 20 lights and 17 views in three rings each, every lobe family, 1 to 4 lobes a texel and 4 residual
/// components of different steps and ranks up to 5.
pub fn sample_asset(seed: u64, width: usize, height: usize, kind: ResidualKind) -> Asset {
    let mut random = Random::new(seed);
    let random = &mut random;
    let sphere = |rings: &[(f64, usize)]| Sphere::new(&ring_directions(rings)).expect("the rings are distinct");
    let lights = sphere(&[(25.0, 4), (50.0, 6), (75.0, 9)]);
    let views = sphere(&[(30.0, 3), (55.0, 5), (70.0, 8)]);

    let texels = width * height;
    let texel_clusters: Vec<u8> = (0..texels).map(|_| random.below(CLUSTERS) as u8).collect();
    let texel_lobe_counts: Vec<u8> = (0..texels).map(|_| 1 + random.below(4) as u8).collect();
    let dictionary = sample_dictionary(random);
    let mut lobe_refs = Vec::new();
    for count in &texel_lobe_counts {
        for slot in 0..*count {
            // Every texel has a diffuse part, as real ones do.
            let lobe = if slot == 0 { 0 } else { 1 + random.below(8) as u8 };
            lobe_refs.push(LobeRef { lobe, weight: [0; 3].map(|_| random.below(256) as u8) });
        }
    }

    let residual = sample_residual(random, [views.len(), lights.len()], texels, kind);
    let layer = Layer {
        light_side: SurfaceSide::Front,
        view_side: SurfaceSide::Front,
        lobe_role: LobeRole::Base,
        residual_kind: kind,
        epsilon: 0.01,
        lights,
        views,
        heights: None,
        relief: None,
        texel_clusters,
        texel_lobe_counts,
        dictionary,
        lobe_refs,
        lobe_weights: None,
        residual: Some(residual),
    };
    let material = format!("{{\"name\":\"sample {seed}\"}}");
    Asset {
        width,
        height,
        size_mm: Some([30.0, 25.0]),
        seamless: [true, false],
        spectrum: None,
        material,
        layers: vec![layer],
        levels: Vec::new(),
        edits: Edits::default(),
    }
}

/// Returns an asset like [`sample_asset`] whose lobes have weights that follow from two coefficients: 3 lobes a cluster
/// and at most 20 nodes.
pub fn sample_predicted_asset(seed: u64, width: usize, height: usize, kind: ResidualKind) -> Asset {
    let mut asset = sample_asset(seed, width, height, kind);
    let mut random = Random::new(seed + 100);
    let layer = &mut asset.layers[0];
    layer.dictionary.iter_mut().for_each(|lobes| lobes.truncate(3));
    let lobes: usize = layer.dictionary.iter().map(Vec::len).sum();
    let codes = (0..3 * 3 * lobes).map(|i| if i % 3 == 0 { 30 } else { random.below(21) as i16 - 10 }).collect();
    let mut weights = LobeWeights { step: 1.0 / 64.0, units: vec![40.0, 60.0], codes, nodes: Vec::new() };
    weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), 20);
    layer.lobe_weights = Some(weights);
    layer.predict_lobes();
    asset
}

/// Returns the weights of the first group's channels as those of all.
fn three(weights: [f32; 3]) -> Channels {
    std::array::from_fn(|i| weights.get(i).copied().unwrap_or(0.0))
}

/// Returns an asset like [`sample_asset`] of five bands, whose shown values mix the channels and are cut at 0 at times.
pub fn sample_spectral_asset(seed: u64, width: usize, height: usize) -> Asset {
    let spectrum = Spectrum {
        wavelengths_nm: vec![450.0, 550.0, 650.0, 750.0, 950.5],
        groups: 1,
        weights: [[0.0, 0.1, 0.9], [0.1, 0.9, 0.1], [0.8, 0.1, -0.3], [1.5, 0.0, 0.0], [0.0, 0.5, 0.0]]
            .map(three)
            .to_vec(),
        shown: [[1.2, -0.6, 0.0], [-0.1, 0.9, 0.2], [0.0, 0.3, 0.7]].map(three),
    };
    Asset { spectrum: Some(spectrum), ..sample_asset(seed, width, height, ResidualKind::Root) }
}

/// Returns an asset of two groups of channels: the lights of [`sample_asset`] twice, and bands of both.
pub fn sample_grouped_spectrum(seed: u64, width: usize, height: usize) -> Asset {
    let row = |weights: [f32; 6]| std::array::from_fn(|i| weights.get(i).copied().unwrap_or(0.0));
    let spectrum = Spectrum {
        wavelengths_nm: vec![450.0, 550.0, 650.0, 850.0],
        groups: 2,
        weights: vec![
            row([0.0, 0.1, 0.9, 0.0, 0.0, 0.0]),
            row([0.1, 0.9, 0.1, 0.0, 0.2, 0.0]),
            row([0.8, 0.1, 0.0, 0.0, 0.0, -0.3]),
            row([0.0, 0.0, 0.0, 1.5, 0.2, 0.0]),
        ],
        shown: [
            row([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            row([0.0, 0.8, 0.0, 0.0, 0.3, 0.0]),
            row([0.0, 0.0, 0.7, 0.4, -0.2, 0.0]),
        ],
    };
    let mut random = Random::new(seed);
    let mut asset = sample_asset(seed, width, height, ResidualKind::Root);
    let texels = asset.texel_count();
    let layer = &mut asset.layers[0];
    let once: Vec<[f32; 3]> = (0..layer.lights.len()).map(|id| layer.lights.direction(id as u32)).collect();
    layer.lights = Sphere::of_rounds(&once.repeat(2), 2).unwrap_or_else(|error| unreachable!("{error}"));
    let shape = [layer.views.len(), layer.lights.len()];
    layer.residual = Some(sample_residual(&mut random, shape, texels, ResidualKind::Root));
    Asset { spectrum: Some(spectrum), ..asset }
}

/// Returns an asset like [`sample_predicted_asset`] whose coefficients are smooth over the texels and are predicted in two
/// groups, with factors that few digits tell. One cluster lacks the last component.
pub fn sample_grouped_asset(seed: u64, width: usize, height: usize, kind: ResidualKind) -> Asset {
    let mut asset = sample_predicted_asset(seed, width, height, kind);
    let layer = &mut asset.layers[0];
    let place = |texel: usize| [(texel % width) as f32, (texel / width) as f32];
    let patch = |texel: usize| (place(texel)[0] / 5.0 + (0.4 * place(texel)[1]).sin()) as usize % CLUSTERS;
    layer.texel_clusters = (0..width * height).map(|texel| patch(texel) as u8).collect();
    let Some(residual) = &mut layer.residual else { return asset };
    residual.bases[COMPONENTS].values[SHARED..2 * SHARED].fill(0);
    for (j, plane) in residual.coefficients.iter_mut().enumerate() {
        let size = [100.0, 25.0, 6.0, 1.5][j];
        for (texel, (code, cluster)) in plane.codes.iter_mut().zip(&layer.texel_clusters).enumerate() {
            let [x, y] = place(texel);
            let has = j + 1 < COMPONENTS || *cluster != 1;
            let smooth = size * ((0.3 * x + j as f32).sin() + (0.25 * y).cos());
            *code = if has { (0.6 * smooth) as i8 + *code / 16 } else { 0 };
        }
    }
    let factors = &mut residual.factors;
    for x in factors.view.iter_mut().chain(&mut factors.light).flatten() {
        *x = f16::from_f32((x.to_f32() * 64.0).round() / 64.0);
    }
    residual.groups = vec![
        PredictedGroup { components: 2, inputs: [2, 2, 1, 0], own: 0 },
        PredictedGroup { components: 2, inputs: [4, 3, 1, 2], own: 2 },
    ];
    if let Some(mut weights) = layer.lobe_weights.take() {
        weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), 20);
        layer.lobe_weights = Some(weights);
    }
    layer.predict_lobes();
    asset
}

/// Returns an asset like [`sample_predicted_asset`] with heights and relief.
pub fn sample_relief_asset(seed: u64, width: usize, height: usize) -> Asset {
    let mut asset = sample_predicted_asset(seed, width, height, ResidualKind::Root);
    let layer = &mut asset.layers[0];
    // Waves: rays through noise would meet it at another place with every rounding.
    let wave = |texel: usize| (((texel % width) as f32 * 0.9).sin() + ((texel / width) as f32 * 1.1).cos()) * 6.0;
    layer.heights = Some(Heights { step: 0.125, codes: (0..width * height).map(|texel| wave(texel) as i8).collect() });
    layer.relief = Some(Relief { likeness: 100.0, shading: 0.5, gloss: 0.4 });
    asset
}

/// Returns a dictionary with a lobe of every family for each cluster.
fn sample_dictionary(random: &mut Random) -> Vec<Vec<DictionaryLobe>> {
    (0..CLUSTERS)
        .map(|_| {
            let entry = |family| DictionaryLobe {
                lobe: random_lobe(random, family),
                // Narrow peaks are tall: keep the sum near reflectances.
                weight_scale: f16::from_f32(if family == LobeFamily::Lambertian { 0.5 } else { 0.05 }).to_f32(),
            };
            LobeFamily::ALL.map(entry).to_vec()
        })
        .collect()
}

/// Returns a residual over `shape` views and lights, with coefficients of `texels` texels.
fn sample_residual(random: &mut Random, shape: [usize; 2], texels: usize, kind: ResidualKind) -> Residual {
    // The additive curve adds reflectances, the others steps of their own.
    let amplitude = match kind {
        ResidualKind::Additive => 0.05,
        ResidualKind::Log => 0.25,
        ResidualKind::Root => 0.08,
    };
    let ranks = [0; 3].map(|_| [1 + random.below(5), 1 + random.below(5)]);
    let factors = Factors {
        shape,
        ranks,
        view: ranks.map(|[rank, _]| halves(random, shape[0] * rank, 1.0)),
        light: ranks.map(|[_, rank]| halves(random, shape[1] * rank, 1.0)),
    };
    let mut codes = |count: usize, most: usize| -> Vec<i16> {
        (0..count).map(|_| random.below(2 * most + 1) as i16 - most as i16).collect()
    };
    // Rank-1 to rank-5 cores of +-1, mixed by weights that fall with the component.
    let shared = SharedBases { steps: vec![0.01; SHARED], values: codes(SHARED * factors.core_len(), 100) };
    let bases = (0..=COMPONENTS)
        .map(|index| {
            let step = amplitude / (1.0 + index as f32) / 50.0;
            Basis { steps: vec![step, 0.5 * step, 0.7 * step], values: codes(CLUSTERS * SHARED, 50) }
        })
        .collect();
    let coefficients = (0..COMPONENTS)
        .map(|component| {
            let most = [127, 20, 3, 1][component];
            let codes = codes(texels, most).into_iter().map(|code| code as i8).collect();
            Coefficients { step: 0.7 / most as f32, codes }
        })
        .collect();
    Residual { factors, shared, bases, coefficients, groups: Vec::new() }
}

/// Returns a small asset whose bases would take more than 1 GiB when expanded with some more components than its four:
/// factors of rank 0 take no bytes in the file, but expanded bases do.
pub fn huge_asset() -> Asset {
    let mut asset = sample_asset(9, 1, 1, ResidualKind::Root);
    let layer = &mut asset.layers[0];
    let set = ring_directions(&[(20.0, 64), (40.0, 64), (60.0, 64), (75.0, 64)]);
    layer.lights = Sphere::new(&set).expect("the rings are distinct");
    layer.views = layer.lights.clone();
    layer.texel_clusters = vec![0];
    layer.dictionary = vec![layer.dictionary[0].clone(); 256];
    let residual = layer.residual.as_mut().unwrap();
    residual.factors.shape = [set.len(); 2];
    residual.factors.ranks = [[0; 2]; 3];
    residual.factors.view = Default::default();
    residual.factors.light = Default::default();
    residual.shared.steps.clear();
    residual.shared.values.clear();
    for basis in &mut residual.bases {
        basis.steps = vec![0.0; 256];
        basis.values.clear();
    }
    asset
}

/// Returns a rough displacement of `texels` texels, up to three texel widths either way.
pub fn sample_heights(seed: u64, texels: usize) -> Heights {
    let mut random = Random::new(seed);
    Heights { step: 0.125, codes: (0..texels).map(|_| random.below(49) as i8 - 24).collect() }
}

/// Returns the index of a texel's first lobe reference.
pub fn first_ref(layer: &Layer, texel: usize) -> usize {
    layer.texel_lobe_counts[..texel].iter().map(|count| usize::from(*count)).sum()
}
