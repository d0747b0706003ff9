//! An asset of random content that is as large as those of measured materials, for measurements of speed.

use crate::asset::asset::Asset;
use crate::asset::residual::{Basis, Coefficients, Factors, Residual, ResidualKind, SharedBases};
use crate::asset::sphere::Sphere;
use crate::testing::assets::{halves, sample_asset};
use crate::testing::random::{Random, ring_directions};

/// Number of clusters, as a fit makes them for 256 x 256 texels.
const CLUSTERS: usize = 32;
/// Number of shared bases, and rank of their factors.
const SHARED: usize = 8;
/// Texels per side of a patch of one cluster: neighbours usually share theirs.
const PATCH: usize = 8;
/// Rings of the University of Bonn's 81 directions, polar angle in degrees and count, besides the pole.
const RINGS: [(f64, usize); 5] = [(15.0, 6), (30.0, 12), (45.0, 18), (60.0, 20), (75.0, 24)];

/// Returns an asset of one layer with `side` x `side` texels, 81 lights and 81 views, 32 clusters and `components`
/// residual components. Its bases take 1.3 MB in memory for every component.
pub fn dense_asset(seed: u64, side: usize, components: usize) -> Asset {
    let mut asset = sample_asset(seed, side, side, ResidualKind::Root);
    let mut random = Random::new(seed + 1);
    let layer = &mut asset.layers[0];
    let directions = Sphere::new(&ring_directions(&RINGS)).expect("the rings are distinct");
    (layer.lights, layer.views) = (directions.clone(), directions);
    let patches = side.div_ceil(PATCH);
    let patch = |texel: usize| texel / side / PATCH * patches + texel % side / PATCH;
    layer.texel_clusters = (0..side * side).map(|texel| (patch(texel) % CLUSTERS) as u8).collect();
    layer.dictionary = layer.dictionary.iter().cycle().take(CLUSTERS).cloned().collect();
    let shape = [layer.views.len(), layer.lights.len()];
    let factors = Factors {
        shape,
        ranks: [[SHARED; 2]; 3],
        view: [0; 3].map(|_| halves(&mut random, shape[0] * SHARED, 1.0)),
        light: [0; 3].map(|_| halves(&mut random, shape[1] * SHARED, 1.0)),
    };
    let mut codes = |count: usize, most: usize| -> Vec<i16> {
        (0..count).map(|_| random.below(2 * most + 1) as i16 - most as i16).collect()
    };
    let shared = SharedBases { steps: vec![0.01; SHARED], values: codes(SHARED * factors.core_len(), 20) };
    // Sizes fall with the component, as those of a principal component analysis do.
    let share = |index: usize| 1.0 / (1.0 + index as f32);
    let bases = (0..=components)
        .map(|index| Basis { steps: vec![3e-3 * share(index); CLUSTERS], values: codes(CLUSTERS * SHARED, 50) })
        .collect();
    let coefficients = (0..components)
        .map(|index| {
            let most = (127.0 * share(index)).max(2.0);
            let codes = codes(side * side, most as usize).into_iter().map(|code| code as i8).collect();
            Coefficients { step: 0.7 / most, codes }
        })
        .collect();
    layer.residual = Some(Residual { factors, shared, bases, coefficients, groups: Vec::new() });
    asset
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resident::resident::Resident;
    use crate::{DecodeOptions, decode, pack};

    #[test]
    fn a_dense_asset_is_whole_and_every_component_counts() {
        let asset = dense_asset(1, 16, 12);
        assert_eq!(Asset::parse(&pack(&asset).unwrap()).unwrap(), asset);
        let resident = Resident::from_asset(&asset);
        assert_eq!(resident.components(0), 12);
        let mut random = Random::new(3);
        let mut differing = |components| {
            let differs = |_: &u32| {
                let (wi, wo) = (random.direction(), random.direction());
                let options = |components| DecodeOptions { components, ..DecodeOptions::default() };
                let [all, fewer] = [12, components].map(|c| decode(&resident, 0, 77, wi, wo, &options(c)));
                assert!(all.iter().all(|x| x.is_finite() && *x < 100.0), "{all:?}");
                all != fewer
            };
            (0..100).filter(differs).count()
        };
        let counts = [0, 6, 12].map(&mut differing);
        assert!(counts[0] > 80 && counts[1] > 80 && counts[2] == 0, "{counts:?}");
    }
}
