//! Colours of the live leaf's body and of the reference's. Promises hold one against the other.
//!
//! Prints what each mode of the live leaf costs and loses, as Markdown:
//! `cargo run --release -p btf-tests -- leaf_live`.
//!
//! Times are of one thread and of this run: compare them with each other.

use crate::leaf::trade::{Spread, delta_e00_linear};
use btf_runtime::testing::Random;
use btf_runtime::{Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf};
use btf_synth::{
    Face, LeafContents, PlateModel, RgbBands, RgbFromSpectrum, SpecificAbsorption, TwoHalves,
    mean_interface_transmittance, plate_spectrum,
};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// States of leaves within the ranges, two fifths of them without red and brown pigments; few pigments as often as
/// many.
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

/// Returns the contents of the state's leaf in the units of the reference.
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
    let leaf = dull_leaf(state, factors);
    [1.0, -1.0].map(|light| along_normal(&leaf, 1.0, light))
}

/// Makes a leaf without gloss.
fn dull_leaf(state: &LeafState, factors: [f32; 4]) -> Leaf {
    let texel = LeafTexel { factors, gloss: [0.0; 2], ..LeafTexel::default() };
    Leaf::new(state, &LeafTexture::uniform(texel)).expect("the state is finite")
}

/// Returns what an eye sees of a light, each along the normal, above (1) or below (-1) the leaf.
fn along_normal(leaf: &Leaf, eye: f32, light: f32) -> [f64; 3] {
    let viewed = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], [0.0, 0.0, eye]);
    viewed.light([0.0, 0.0, light]).map(f64::from)
}

/// Linear sRGB of what the live body reflects from its back, like [`body_colours`].
///
/// # Panics
/// For a state that is not finite.
pub fn back_colour(state: &LeafState, factors: [f32; 4]) -> [f64; 3] {
    along_normal(&dull_leaf(state, factors), -1.0, -1.0)
}

/// Colours of the front, of the back and of the transmitted light by the reference's two halves, with the limit of the live leaf.
pub fn two_sided_reference(state: &LeafState) -> [[f64; 3]; 3] {
    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let of = |face: Face| {
        let at = |nm: &f64| TwoHalves::default().entered(SpecificAbsorption::ProspectD, &contents_of(state), face, *nm);
        let optics: Vec<_> = convert.wavelengths_nm().iter().map(at).collect();
        let rgb =
            |value: fn(&btf_synth::PlateOptics) -> f64| convert.rgb(&optics.iter().map(value).collect::<Vec<_>>());
        [rgb(|optics| optics.reflectance), rgb(|optics| optics.transmittance)]
    };
    let [[front, behind], [back, _]] = [Face::Adaxial, Face::Abaxial].map(of);
    let scale: [f64; 3] = std::array::from_fn(|c| 1.0 / (front[c].max(back[c]) + behind[c]).max(1.0));
    [front, back, behind].map(|rgb| std::array::from_fn(|c| rgb[c] * scale[c]))
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

/// Returns the colours of the reference spectra in front and behind, with the limit that the live leaf has: reflectance and transmittance together at most 1 in each
/// channel.
pub fn reference_colours(state: &LeafState) -> [[f64; 3]; 2] {
    limited(reference_spectra(state).map(|spectrum| RgbFromSpectrum::new(RgbBands::Spectral31).rgb(&spectrum)))
}

/// Reflectance and transmittance together at most 1 in each channel.
pub fn limited([front, behind]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
    let scale: [f64; 3] = std::array::from_fn(|c| 1.0 / (front[c] + behind[c]).max(1.0));
    [front, behind].map(|rgb| std::array::from_fn(|c| rgb[c] * scale[c]))
}

/// The modes of a state.
pub fn modes_of(state: &LeafState) -> [LeafState; LeafMode::ALL.len()] {
    LeafMode::ALL.map(|mode| LeafState { mode, ..*state })
}

/// Texels in a row and rows of the textures.
const SIDE: usize = 256;
/// Places that are looked at.
const PLACES: usize = 1 << 14;
/// Measurements of which the fastest counts.
const REPEATS: usize = 9;
/// States that colours are compared over.
const STATES: usize = 2000;

/// Nanoseconds per place of `work`, which treats `places` of them.
pub(crate) fn nanoseconds(places: usize, mut work: impl FnMut()) -> f64 {
    let mut once = || {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64()
    };
    once();
    (0..REPEATS).map(|_| once()).fold(f64::MAX, f64::min) * 1e9 / places as f64
}

fn textures(random: &mut Random) -> LeafTexture {
    let texels = (0..SIDE * SIDE)
        .map(|_| LeafTexel {
            factors: std::array::from_fn(|_| random.within(0.5, 1.5)),
            gloss: [random.within(0.5, 1.0), random.within(0.5, 1.0)],
            veins: [random.within(-1.0, 1.0), random.within(-1.0, 1.0)],
            tilt: std::array::from_fn(|_| random.within(-0.3, 0.3)),
            ..LeafTexel::default()
        })
        .collect();
    LeafTexture { width: SIDE, texels }
}

/// Runs the study.
pub fn run(_: &[String]) -> Result<(), Box<dyn Error>> {
    let mut random = Random::new(1);
    let texture = textures(&mut random);
    let direction = |random: &mut Random| {
        let [x, y, z] = random.direction();
        [x, y, if random.below(2) == 0 { z } else { -z }]
    };
    let places: Vec<([f32; 2], [f32; 3], [f32; 3])> = (0..PLACES)
        .map(|_| {
            let uv = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
            (uv, direction(&mut random), direction(&mut random))
        })
        .collect();

    println!("| mode | ns view half | ns light half | dE00 mean | p99 | max |");
    println!("|---|---|---|---|---|---|");
    let states = random_states(33, STATES);
    for (mode, state) in modes_of(&LeafState::default()).into_iter().enumerate() {
        let leaf = Leaf::new(&state, &texture).expect("the state is finite");
        let view = nanoseconds(PLACES, || {
            for (uv, _, wo) in &places {
                black_box(ViewedLeaf::new(leaf.words(), *uv, 0, [1.0; 4], *wo));
            }
        });
        let viewed: Vec<ViewedLeaf> =
            places.iter().map(|(uv, _, wo)| ViewedLeaf::new(leaf.words(), *uv, 0, [1.0; 4], *wo)).collect();
        let light = nanoseconds(PLACES, || {
            for (viewed, (_, wi, _)) in viewed.iter().zip(&places) {
                black_box(viewed.light(*wi));
            }
        });
        let mut errors: Vec<f64> = states
            .iter()
            .flat_map(|state| {
                let state = modes_of(state)[mode];
                let live = body_colours(&state, [1.0; 4]);
                if state.mode == LeafMode::TwoSided {
                    let [front, back, behind] = two_sided_reference(&state);
                    let pairs = [(live[0], front), (back_colour(&state, [1.0; 4]), back), (live[1], behind)];
                    return pairs.map(|(live, reference)| delta_e00_linear(live, reference)).to_vec();
                }
                let reference = reference_colours(&state);
                [0, 1].map(|side| delta_e00_linear(live[side], reference[side])).to_vec()
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let Spread { mean, max } = Spread::of(errors.iter().copied());
        let p99 = errors[errors.len() * 99 / 100];
        println!("| {} | {view:.0} | {light:.0} | {mean:.3} | {p99:.2} | {max:.2} |", state.mode.name());
    }

    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let unlimited = |state: &LeafState| reference_spectra(state).map(|spectrum| convert.rgb(&spectrum));
    let apart: Vec<f64> = states
        .iter()
        .map(unlimited)
        .filter(|colours| limited(*colours) != *colours)
        .flat_map(|colours| [0, 1].map(|side| delta_e00_linear(limited(colours)[side], colours[side])))
        .collect();
    let Spread { mean, max } = Spread::of(apart.iter().copied());
    println!(
        "\nThe limit of reflectance and transmittance to 1 in each channel touches {} of {STATES} leaves, by a dE00 of {mean:.1} \
         in the mean of these and {max:.1} at most.",
        apart.len() / 2
    );

    let mut leaf = Leaf::new(&LeafState::default(), &texture).expect("the state is finite");
    println!("\n| change | ms | words |\n|---|---|---|");
    let mut timed = |name: &str, state: LeafState| {
        let started = Instant::now();
        let touched = leaf.set_state(&state).expect("the state is finite");
        println!("| {name} | {:.2} | {} |", started.elapsed().as_secs_f64() * 1e3, touched.len());
    };
    let state = LeafState { chlorophyll_ug_per_cm2: 20.0, ..LeafState::default() };
    timed("contents", state);
    timed("structure", LeafState { structure: 2.0, ..state });
    timed("roughness", LeafState { gamma_along: 0.2, gamma_across: 0.2, ..state });
    timed("two roughnesses", LeafState { gamma_along: 0.5, gamma_across: 0.2, ..state });
    Ok(())
}
