//! Colours of the live leaf's body and of the reference's, for the promises that hold one against the other and for the
//! examples that print what each mode loses.

use btf_runtime::{Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf};
use btf_synth::{
    LeafContents, PlateModel, RgbBands, RgbFromSpectrum, SpecificAbsorption, mean_interface_transmittance,
    plate_spectrum,
};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// States of leaves within the ranges, two fifths of them without red and brown pigments; few pigments as often as many.
pub fn random_states(seed: u64, count: usize) -> Vec<LeafState> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let mut within = |least: f32, most: f32| random.gen_range(least..most);
            let (dense, red, brown) = (within(0.0, 1.0), within(0.0, 1.0), within(0.0, 1.0));
            let plain = within(0.0, 1.0) < 0.4;
            LeafState {
                chlorophyll_ug_per_cm2: 100.0 * dense.powf(1.5),
                carotenoid_ug_per_cm2: within(0.0, 25.0),
                anthocyanin_ug_per_cm2: if plain { 0.0 } else { 15.0 * red * red },
                brown: if plain { 0.0 } else { brown * brown },
                water_cm: within(0.001, 0.04),
                dry_matter_g_per_cm2: within(0.001, 0.02),
                structure: within(1.0, 3.0),
                ..LeafState::default()
            }
        })
        .collect()
}

/// What the state's leaf holds, for the reference.
pub fn contents_of(state: &LeafState) -> LeafContents {
    LeafContents {
        chlorophyll_ug_per_cm2: state.chlorophyll_ug_per_cm2.into(),
        carotenoid_ug_per_cm2: state.carotenoid_ug_per_cm2.into(),
        anthocyanin_ug_per_cm2: state.anthocyanin_ug_per_cm2.into(),
        brown: state.brown.into(),
        water_cm: state.water_cm.into(),
        dry_matter_g_per_cm2: state.dry_matter_g_per_cm2.into(),
        structure: state.structure.into(),
    }
}

/// Linear sRGB of the live body's reflectance and transmittance: a dull leaf along its normal.
///
/// # Panics
/// For a state that is not finite.
pub fn body_colours(state: &LeafState, factors: [f32; 4]) -> [[f64; 3]; 2] {
    let texel = LeafTexel { factors, gloss: [0.0; 2], ..LeafTexel::default() };
    let leaf = Leaf::new(state, &LeafTexture::uniform(texel)).expect("the state is finite");
    let viewed = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], [0.0, 0.0, 1.0]);
    [1.0, -1.0].map(|z| viewed.light([0.0, 0.0, z]).map(f64::from))
}

/// Spectra of the reference's body at 400, 410 ... 700 nm: shares of the light that has entered N layers.
///
/// # Panics
/// For contents out of range.
pub fn reference_spectra(state: &LeafState) -> [Vec<f64>; 2] {
    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let table = SpecificAbsorption::ProspectD;
    let cone_deg = PlateModel::N.default_cone_deg();
    let whole = plate_spectrum(PlateModel::N, table, &contents_of(state), cone_deg, convert.wavelengths_nm());
    let bodies =
        whole.expect("the contents are in range").into_iter().zip(convert.wavelengths_nm()).map(|(whole, nm)| {
            let entering = mean_interface_transmittance(cone_deg, table.index(*nm));
            ((whole.reflectance - (1.0 - entering)) / entering, whole.transmittance / entering)
        });
    let (front, behind) = bodies.unzip();
    [front, behind]
}

/// Their colours, with the limit that the live leaf has: reflectance and transmittance together at most 1 in each channel.
pub fn reference_colours(state: &LeafState) -> [[f64; 3]; 2] {
    limited(reference_spectra(state).map(|spectrum| RgbFromSpectrum::new(RgbBands::Spectral31).rgb(&spectrum)))
}

/// Reflectance and transmittance together at most 1 in each channel.
pub fn limited([front, behind]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
    let scale: [f64; 3] = std::array::from_fn(|c| 1.0 / (front[c] + behind[c]).max(1.0));
    [front, behind].map(|rgb| std::array::from_fn(|c| rgb[c] * scale[c]))
}

/// The three modes of a state.
pub fn modes_of(state: &LeafState) -> [LeafState; 3] {
    LeafMode::ALL.map(|mode| LeafState { mode, ..*state })
}
