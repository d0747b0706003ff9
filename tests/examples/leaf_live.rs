//! Prints what each mode of the live leaf costs and loses, as Markdown: `cargo run --release -p btf-tests --example leaf_live`.
//!
//! Times are of one thread and of this run: compare them with each other.

use btf_runtime::testing::Random;
use btf_runtime::{Leaf, LeafState, LeafTexel, LeafTexture, ViewedLeaf};
use btf_tests::leaf_live::{body_colours, limited, modes_of, random_states, reference_colours, reference_spectra};
use btf_tests::leaf_trade::{Spread, delta_e00_linear};
use std::hint::black_box;
use std::time::Instant;

/// Texels in a row and rows of the textures.
const SIDE: usize = 256;
/// Places that are looked at.
const PLACES: usize = 1 << 14;
/// Measurements of which the fastest counts.
const REPEATS: usize = 9;
/// States that colours are compared over.
const STATES: usize = 2000;

/// Nanoseconds per place of `work`, which treats all of them.
fn nanoseconds(mut work: impl FnMut()) -> f64 {
    let mut once = || {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64()
    };
    once();
    (0..REPEATS).map(|_| once()).fold(f64::MAX, f64::min) * 1e9 / PLACES as f64
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

fn main() {
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
        let view = nanoseconds(|| {
            for (uv, _, wo) in &places {
                black_box(ViewedLeaf::new(leaf.words(), *uv, 0, [1.0; 4], *wo));
            }
        });
        let viewed: Vec<ViewedLeaf> =
            places.iter().map(|(uv, _, wo)| ViewedLeaf::new(leaf.words(), *uv, 0, [1.0; 4], *wo)).collect();
        let light = nanoseconds(|| {
            for (viewed, (_, wi, _)) in viewed.iter().zip(&places) {
                black_box(viewed.light(*wi));
            }
        });
        let mut errors: Vec<f64> = states
            .iter()
            .flat_map(|state| {
                let (live, reference) = (body_colours(&modes_of(state)[mode], [1.0; 4]), reference_colours(state));
                [0, 1].map(|side| delta_e00_linear(live[side], reference[side]))
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let Spread { mean, max } = Spread::of(errors.iter().copied());
        let p99 = errors[errors.len() * 99 / 100];
        println!("| {} | {view:.0} | {light:.0} | {mean:.3} | {p99:.2} | {max:.2} |", state.mode.name());
    }

    let convert = btf_synth::RgbFromSpectrum::new(btf_synth::RgbBands::Spectral31);
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
}
