//! How near traced canopies come to a turbid medium and to SAIL, as Markdown: `cargo run --release -p btf-tests -- canopies [PHOTONS]`
//!
//! Small leaves strewn at random stand in for the turbid medium. The peers' values are those of
//! `python tests/peers/turbid_medium.py 1e6` and of `prosail.run_sail` 2.0.5 with a spherical distribution of leaf angles,
//! `lidfa=-0.35, lidfb=-0.15, typelidf=1, hspot=0.01`.

use btf_viewer::{CanopyCell, CanopyOptics, CanopyParams, Control, measure_canopy};
use std::error::Error;

/// Leaf area index, size of the leaves and of the cell in metres.
const LEAF_AREA_INDEX: f64 = 3.0;
const SIDE_M: f32 = 0.01;
const SIZE_M: [f32; 3] = [0.5, 1.0, 0.5];
const EYES_DEG: [f64; 6] = [-60.0, -30.0, 0.0, 15.0, 45.0, 60.0];
/// Directional-hemispherical and bihemispherical reflectance, then towards the eyes, for each band.
const TURBID: [[f64; 8]; 2] = [
    [0.04023, 0.04547, 0.03348, 0.03476, 0.04058, 0.04363, 0.04770, 0.04902],
    [0.44107, 0.48989, 0.44158, 0.39888, 0.40773, 0.42468, 0.47005, 0.49525],
];
const SAIL: [[f64; 8]; 2] = [
    [0.0399, 0.0516, 0.0334, 0.03461, 0.04088, 0.04456, 0.04852, 0.04901],
    [0.43825, 0.53166, 0.41913, 0.38378, 0.39651, 0.41494, 0.45456, 0.47088],
];

/// Prints the table.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let photons = arguments.first().map_or(Ok(400_000), |text| text.parse())?;
    let cell = CanopyCell::strewn(LEAF_AREA_INDEX, SIDE_M, SIZE_M, 1)?;
    let leaf = [vec![0.10, 0.45], vec![0.08, 0.48]];
    let optics = CanopyOptics {
        gloss: None,
        wavelengths_nm: vec![670.0, 800.0],
        leaf: [leaf.clone(), leaf],
        other: vec![0.0; 2],
        soil: vec![0.15, 0.30],
    };
    let params = CanopyParams { photons, sky: true, view_zeniths_deg: EYES_DEG.to_vec(), ..CanopyParams::default() };
    let told = measure_canopy(&cell, &optics, &params, &Control::SILENT)?;
    println!("| band | reflectance | traced | turbid medium | SAIL |\n|---|---|---|---|---|");
    let [sun, sky] = &told.light[..] else { return Err("two lights are measured".into()) };
    for band in 0..2 {
        let figures = [&sun.reflectance, &sky.reflectance];
        let figures = figures.into_iter().chain(sun.views.iter().map(|view| &view.reflectance_factor));
        for (i, figures) in figures.enumerate() {
            let name = match i {
                0 => "sun at 30 degrees, hemisphere".to_owned(),
                1 => "white sky, hemisphere".to_owned(),
                _ => format!("sun at 30 degrees, eye at {} degrees", EYES_DEG[i - 2]),
            };
            let (value, error) = (figures.value[band], figures.standard_error[band]);
            let off = |peer: f64| format!("{peer:.4} ({:+.1} %)", 100.0 * (peer / TURBID[band][i] - 1.0));
            println!(
                "| {} nm | {name} | {value:.4} +- {error:.4} ({:+.1} %) | {:.4} | {} |",
                told.wavelengths_nm[band],
                100.0 * (value / TURBID[band][i] - 1.0),
                TURBID[band][i],
                off(SAIL[band][i])
            );
        }
    }
    Ok(())
}
