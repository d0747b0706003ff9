//! What the table of an algorithmic leaf model costs a live leaf, and how far it is off: rows of docs/results/trade.md as Markdown.
//! `cargo run --release -p btf-tests -- leaf_table [RAYS]`
//!
//! Colours are those of all the light that leaves a face or passes the leaf, for light from several angles and several contents,
//! against rays at 31 wavelengths, each with its own ways and indices. Single directions are those of 72 patches of 15 by 30 degrees on
//! either side.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::ops::ControlFlow;

use crate::leaf::live::nanoseconds;
use crate::leaf::trade::{Spread, delta_e00_linear};
use btf_runtime::testing::{Random, direction_from_degrees};
use btf_runtime::{Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf};
use btf_synth::{
    Abm97, AbmB, AbmU, Face, Goniogram, Goniophotometer, LeafModel, LeafTable, MicrogramsPerSquareCentimetre,
    Nanometres, Parallel, RgbBands, RgbFromSpectrum, leaf_table, trace_path_lengths,
};
use btf_viewer::scattering_of;

/// Contents of chlorophyll and carotenoids in ug/cm2.
pub const CONTENTS: [[f32; 2]; 4] = [[5.0, 2.0], [20.0, 8.0], [45.0, 8.0], [80.0, 15.0]];
/// Angles of incidence in degrees.
pub const INCIDENCES_DEG: [f64; 3] = [8.0, 45.0, 70.0];
/// Both faces.
pub const FACES: [Face; 2] = [Face::Adaxial, Face::Abaxial];

/// Returns a model with other contents of chlorophyll and carotenoids in ug/cm2.
pub fn with_contents(model: &LeafModel, [chlorophyll, carotenoid]: [f32; 2]) -> LeafModel {
    let [chlorophyll, carotenoid] = [chlorophyll, carotenoid].map(|x| MicrogramsPerSquareCentimetre(f64::from(x)));
    let mut model = *model;
    let specimen = match &mut model {
        LeafModel::Abm97(leaf) => {
            (leaf.chlorophyll, leaf.carotenoid) = (chlorophyll, carotenoid);
            return model;
        }
        LeafModel::AbmB(leaf) => &mut leaf.specimen,
        LeafModel::AbmU(leaf) => &mut leaf.specimen,
        LeafModel::Plate(_) | LeafModel::TwoSided(_) => return model,
    };
    specimen.composition.chlorophyll = specimen.concentration(chlorophyll);
    specimen.composition.carotenoid = specimen.concentration(carotenoid);
    model
}

/// Traces the table of a model.
///
/// # Errors
/// Those of [`leaf_table`]; a model of plates.
pub fn table_of(model: &LeafModel, rays: u64) -> Result<LeafTable, Box<dyn Error>> {
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let table = leaf_table(&with_contents(model, [1.0; 2]), [0.0; 2], rays, 1, &go_on)?;
    table.ok_or_else(|| "plates have no table".into())
}

/// Makes a live leaf of a table, flat and without textures.
///
/// # Errors
/// A table without the bands of live leaves; those of [`Leaf::add_scattering`].
pub fn leaf_of(table: &LeafTable, [chlorophyll, carotenoid]: [f32; 2]) -> Result<Leaf, Box<dyn Error>> {
    let state =
        LeafState { chlorophyll_ug_per_cm2: chlorophyll, carotenoid_ug_per_cm2: carotenoid, ..LeafState::default() };
    let mut leaf = Leaf::new(&state, &LeafTexture::uniform(LeafTexel::default()))?;
    leaf.add_scattering(&scattering_of(table).ok_or("a table lacks a band")?)?;
    leaf.set_state(&LeafState { mode: LeafMode::Tissue, ..state })?;
    Ok(leaf)
}

/// Returns the colours of all the light that leaves the lit face again, and that passes the leaf.
pub fn live_colours(leaf: &Leaf, face: Face, incidence_deg: f64) -> [[f64; 3]; 2] {
    const COSINES: usize = 32;
    const AZIMUTHS: usize = 48;
    let up = if face == Face::Adaxial { 1.0 } else { -1.0 };
    let [x, y, z] = direction_from_degrees(incidence_deg, 0.0);
    let wi = [x, y, up as f32 * z];
    [up, -up].map(|side| {
        let mut sum = [0.0; 3];
        for i in 0..COSINES {
            let cosine = (i as f64 + 0.5) / COSINES as f64;
            let sine = (1.0 - cosine * cosine).sqrt();
            for j in 0..AZIMUTHS {
                let (sin, cos) = (TAU * (j as f64 + 0.5) / AZIMUTHS as f64).sin_cos();
                let wo = [sine * cos, sine * sin, side * cosine].map(|x| x as f32);
                let light = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], wo).light(wi);
                (0..3).for_each(|rgb| sum[rgb] += f64::from(light[rgb]) * cosine);
            }
        }
        let solid = TAU / (COSINES * AZIMUTHS) as f64;
        sum.map(|x| x * solid / (PI * f64::from(z)))
    })
}

/// Returns the colours that [`live_colours`] should have, by rays.
pub fn traced_colours(model: &LeafModel, face: Face, incidence_deg: f64, rays: u64) -> [[f64; 3]; 2] {
    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let Some(tissue) = model.tissue() else { return [[0.0; 3]; 2] };
    let beam = Parallel::onto(face, incidence_deg);
    let of = |nm: f64| trace_path_lengths(&tissue.stack(Nanometres(nm)), &beam, rays, 7);
    let one = tissue.has_constant_indices().then(|| of(550.0));
    let mut spectra = [Vec::new(), Vec::new()];
    for &nm in convert.wavelengths_nm() {
        let depth = tissue.optical_depth(Nanometres(nm)).0;
        let own = if one.is_none() { Some(of(nm)) } else { None };
        if let Some(traced) = one.as_ref().or(own.as_ref()) {
            spectra[0].push(traced.reflectance(depth).mean);
            spectra[1].push(traced.transmittance(depth).mean);
        }
    }
    spectra.map(|spectrum| convert.rgb(&spectrum))
}

/// Nanoseconds of the view half and of the light half at random directions, the fastest of some measurements.
fn times(leaf: &Leaf) -> [f64; 2] {
    const PLACES: usize = 1 << 13;
    let mut random = Random::new(3);
    let mut direction = || {
        let [x, y, z] = random.direction();
        [x, y, if random.below(2) == 0 { z } else { -z }]
    };
    let places: Vec<([f32; 3], [f32; 3])> = (0..PLACES).map(|_| (direction(), direction())).collect();
    let viewed = |wo: [f32; 3]| ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], wo);
    let seen: Vec<ViewedLeaf> = places.iter().map(|(wo, _)| viewed(*wo)).collect();
    let view = nanoseconds(PLACES, || {
        for (wo, _) in &places {
            black_box(viewed(*wo));
        }
    });
    let light = nanoseconds(PLACES, || {
        for (seen, (_, wi)) in seen.iter().zip(&places) {
            black_box(seen.light(*wi));
        }
    });
    [view, light]
}

/// Prints the table.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let rays = arguments.first().map_or(Ok(1_000_000), |rays| rays.parse())?;
    let models =
        [LeafModel::Abm97(Abm97::default()), LeafModel::AbmB(AbmB::default()), LeafModel::AbmU(AbmU::default())];
    println!("| model | bytes | R, Delta E00 mean | max | T, Delta E00 mean | max | ns view half | ns light half |");
    println!("|---|---|---|---|---|---|---|---|");
    let plates = Leaf::new(&LeafState::default(), &LeafTexture::uniform(LeafTexel::default()))?;
    let [view, light] = times(&plates);
    println!("| plates, `n-layers` | | | | | | {view:.0} | {light:.0} |");
    for model in &models {
        let table = table_of(model, rays)?;
        let mut errors = [Vec::new(), Vec::new()];
        for contents in CONTENTS {
            let leaf = leaf_of(&table, contents)?;
            for face in FACES {
                for incidence_deg in INCIDENCES_DEG {
                    let live = live_colours(&leaf, face, incidence_deg);
                    let traced = traced_colours(&with_contents(model, contents), face, incidence_deg, rays / 5);
                    (0..2).for_each(|side| errors[side].push(delta_e00_linear(live[side], traced[side])));
                }
            }
        }
        let [r, t] = errors.map(Spread::of);
        let leaf = leaf_of(&table, CONTENTS[2])?;
        let [view, light] = times(&leaf);
        println!(
            "| `{}` | {} | {:.2} | {:.2} | {:.2} | {:.2} | {view:.0} | {light:.0} |",
            model.name(),
            8 * table.cells.len(),
            r.mean,
            r.max,
            t.mean,
            t.max
        );
    }
    println!(
        "\n| model, side | incidence, degrees | RMS difference of patches over RMS | noise of the rays | Delta E00 of patches, mean |"
    );
    println!("|---|---|---|---|---|");
    for model in &models {
        let table = table_of(model, rays)?;
        let leaf = leaf_of(&table, CONTENTS[2])?;
        for incidence_deg in INCIDENCES_DEG {
            for (side, told) in
                patches(&with_contents(model, CONTENTS[2]), &leaf, incidence_deg, 2 * rays)?.iter().enumerate()
            {
                let name = ["back to the light", "through"][side];
                let Patches { difference, noise, delta_e00 } = told;
                println!(
                    "| `{}`, {name} | {incidence_deg} | {difference:.3} | {noise:.3} | {delta_e00:.2} |",
                    model.name()
                );
            }
        }
    }
    Ok(())
}

/// Differences between a live leaf and rays over the patches of a side.
struct Patches {
    /// Root mean square difference over the root mean square, over projected solid angle and colours.
    difference: f64,
    /// Standard error of the rays, the same way.
    noise: f64,
    /// Mean colour difference.
    delta_e00: f64,
}

/// Returns the differences for light on the adaxial face, on the side of the light and on the other.
fn patches(model: &LeafModel, leaf: &Leaf, incidence_deg: f64, rays: u64) -> Result<[Patches; 2], Box<dyn Error>> {
    const RINGS: usize = 6;
    const AZIMUTHS: usize = 12;
    const COUNT: usize = RINGS * AZIMUTHS;
    /// Directions along either side of a patch that the leaf is evaluated at.
    const SAMPLES: usize = 6;
    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let tissue = model.tissue().ok_or("plates have no tissue")?;
    let goniophotometer =
        Goniophotometer { latitudes: 2 * RINGS, longitudes: AZIMUTHS, incidence_deg, ..Goniophotometer::default() };
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let nm = convert.wavelengths_nm().iter();
    let grams: Vec<Goniogram> =
        nm.map(|nm| goniophotometer.measure(&*tissue, Nanometres(*nm), rays, 5, &go_on)).collect::<Result<_, _>>()?;
    // Rays of one seed err alike at neighbouring wavelengths.
    let rgb = |of: &dyn Fn(&Goniogram) -> f64| convert.rgb(&grams.iter().map(|gram| PI * of(gram)).collect::<Vec<_>>());
    let wi = direction_from_degrees(incidence_deg, 0.0);
    let mut found = Vec::new();
    for side in 0..2 {
        let mut sums = [0.0; 4];
        for patch in 0..COUNT {
            let (ring, azimuth) = (patch / AZIMUTHS, patch % AZIMUTHS);
            let truth = rgb(&|gram| [&gram.brdf, &gram.btdf][side][patch]);
            let error = rgb(&|gram| [&gram.brdf_error, &gram.btdf_error][side][patch]);
            let edge = |at: f64| (at * PI / 2.0 / RINGS as f64).sin().powi(2);
            let (mut told, inner) = ([0.0; 3], edge(ring as f64));
            let width = edge(ring as f64 + 1.0) - inner;
            for i in 0..SAMPLES * SAMPLES {
                // Even in the projected solid angle.
                let sine = (inner + width * ((i / SAMPLES) as f64 + 0.5) / SAMPLES as f64).sqrt();
                let phi = TAU * (azimuth as f64 + ((i % SAMPLES) as f64 + 0.5) / SAMPLES as f64) / AZIMUTHS as f64;
                let up = if side == 0 { 1.0 } else { -1.0 };
                let wo = [sine * phi.cos(), sine * phi.sin(), up * (1.0 - sine * sine).sqrt()].map(|x| x as f32);
                let light = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], wo).light(wi);
                (0..3).for_each(|rgb| {
                    told[rgb] += f64::from(light[rgb]) / f64::from(wi[2]) / (SAMPLES * SAMPLES) as f64;
                });
            }
            for rgb in 0..3 {
                sums[0] += width * (told[rgb] - truth[rgb]).powi(2);
                sums[1] += width * truth[rgb].powi(2);
                sums[2] += width * error[rgb].powi(2);
            }
            sums[3] += delta_e00_linear(told, truth) / COUNT as f64;
        }
        let [difference, square, noise, delta_e00] = sums;
        found.push(Patches { difference: (difference / square).sqrt(), noise: (noise / square).sqrt(), delta_e00 });
    }
    found.try_into().map_err(|_| "two sides".into())
}
