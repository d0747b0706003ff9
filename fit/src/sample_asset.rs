//! A small hand-made asset for the tests of this crate: every section, odd counts, all within the ranges of the format.

use btf_capture::DirectionSet;
use btf_runtime::{
    Asset, Basis, Coefficients, DictionaryLobe, Factors, Layer, Lobe, LobeFamily, LobeRef, LobeRole, Residual,
    ResidualKind, SharedBases, Sphere, SurfaceSide,
};
use half::f16;

/// Returns a number in [-1, 1) that looks random and depends on `seed` alone.
pub(crate) fn number(seed: usize) -> f32 {
    let mut x = (seed as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5851_F42D_4C95_7F2D;
    x ^= x >> 31;
    x = x.wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^= x >> 29;
    (x >> 40) as f32 / (1 << 23) as f32 - 1.0
}

/// Returns an asset of 5 x 3 texels, 7 views, 9 lights, 3 clusters, 0 to 3 lobes a texel, and 3 components mixed from 5
/// shared bases.
pub(crate) fn sample_asset() -> Asset {
    let views = DirectionSet::random(7, 3).unwrap_or_else(|error| panic!("{error}"));
    let lights = DirectionSet::random(9, 4).unwrap_or_else(|error| panic!("{error}"));
    sample_asset_with(5, 3, &views, &lights, ResidualKind::Root)
}

/// Returns an asset as [`sample_asset`] does, of another size, other directions and another curve.
pub(crate) fn sample_asset_with(
    width: usize,
    height: usize,
    views: &DirectionSet,
    lights: &DirectionSet,
    kind: ResidualKind,
) -> Asset {
    const CLUSTERS: usize = 3;
    let sphere = |set: &DirectionSet| {
        Sphere::new(&crate::input::layer_frame::layer_directions(set, btf_capture::Side::Front))
            .unwrap_or_else(|error| panic!("{error}"))
    };
    let lobe = |family, x, y, params| DictionaryLobe {
        lobe: Lobe { family, normal_xy: [x, y], tangent_rad: 0.3, params }.rounded(),
        weight_scale: 0.75,
    };
    let dictionary: Vec<Vec<DictionaryLobe>> = (0..CLUSTERS)
        .map(|cluster| {
            let tilt = 0.1 * cluster as f32;
            vec![
                lobe(LobeFamily::Lambertian, tilt, 0.0, [0.0; 4]),
                lobe(LobeFamily::Ggx, 0.0, tilt, [0.3, 0.5, 0.0, 0.0]),
                lobe(LobeFamily::WindowedCosine, -tilt, 0.1, [4.0, 0.2, -0.1, 0.0]),
            ]
        })
        .collect();
    let texels = width * height;
    let texel_clusters: Vec<u8> = (0..texels).map(|texel| (texel * 5 % CLUSTERS) as u8).collect();
    let texel_lobe_counts: Vec<u8> = (0..texels).map(|texel| (texel * 7 % 4) as u8).collect();
    let lobe_refs = texel_lobe_counts
        .iter()
        .enumerate()
        .flat_map(|(texel, count)| {
            (0..*count).map(move |lobe| LobeRef {
                lobe,
                weight: [0, 1, 2].map(|c| (120.0 + 100.0 * number(texel * 9 + usize::from(lobe) * 3 + c)) as u8),
            })
        })
        .collect();
    let ranks = [[3, 4], [2, 2], [1, 2]];
    let halves = |count: usize, salt: usize| (0..count).map(|i| f16::from_f32(number(i + salt))).collect::<Vec<_>>();
    let factors = Factors {
        shape: [views.len(), lights.len()],
        ranks,
        view: [0, 1, 2].map(|c: usize| halves(views.len() * ranks[c][0], 1000 * c)),
        light: [0, 1, 2].map(|c: usize| halves(lights.len() * ranks[c][1], 1000 * c + 500)),
    };
    const SHARED: usize = 5;
    let codes = |count: usize, most: f32, salt: usize| -> Vec<i16> {
        (0..count).map(|i| (most * number(i + salt)) as i16).collect()
    };
    let shared = SharedBases { steps: vec![0.01; SHARED], values: codes(SHARED * factors.core_len(), 100.0, 31) };
    let bases = (0..4)
        .map(|index: usize| {
            let size = if index == 0 { 0.1 } else { 0.02 };
            Basis { steps: vec![size / 50.0; CLUSTERS], values: codes(CLUSTERS * SHARED, 50.0, 10_000 * index) }
        })
        .collect();
    let coefficients = [8.0f32, 127.0, 4.0]
        .into_iter()
        .enumerate()
        .map(|(index, most)| Coefficients {
            step: 1.0 / most,
            codes: codes(texels, most, 777 * index).into_iter().map(|code| code as i8).collect(),
        })
        .collect();
    Asset {
        width,
        height,
        size_mm: None,
        seamless: [false; 2],
        spectrum: None,
        levels: Vec::new(),
        material: "{}".into(),
        edits: Default::default(),
        layers: vec![Layer {
            light_side: SurfaceSide::Front,
            view_side: SurfaceSide::Front,
            lobe_role: LobeRole::Base,
            residual_kind: kind,
            epsilon: 0.001,
            lights: sphere(lights),
            views: sphere(views),
            heights: None,
            relief: None,
            texel_clusters,
            texel_lobe_counts,
            dictionary,
            lobe_refs,
            lobe_weights: None,
            residual: Some(Residual { factors, shared, bases, coefficients, groups: Vec::new() }),
        }],
    }
}
