//! Spectra as an instrument with noise would measure them on leaves that are known, to judge an inversion by.

use btf_models::LeafContents;
use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::error::SynthError;
use crate::inversion::spectra::LeafSpectra;
use crate::optics::plates::model::{PROSPECT_CONE_DEG, PlateModel, plate_spectrum};
use crate::optics::specific_absorption::SpecificAbsorption;

/// Draws the contents of a leaf, each evenly from a range about as wide as that of measured leaves.
pub fn any_contents(random: &mut Xoshiro256PlusPlus) -> LeafContents {
    let mut between = |low: f64, high: f64| low + (high - low) * random.r#gen::<f64>();
    LeafContents {
        chlorophyll_ug_per_cm2: between(2.0, 90.0),
        carotenoid_ug_per_cm2: between(1.0, 20.0),
        anthocyanin_ug_per_cm2: between(0.0, 5.0),
        brown: between(0.0, 0.3),
        water_cm: between(0.004, 0.03),
        dry_matter_g_per_cm2: between(0.002, 0.015),
        structure: between(1.1, 2.5),
    }
}

/// Returns the reflectance and transmittance of `plate-n` at `wavelengths_nm`, ascending, with normal noise of standard
/// deviation `noise`.
///
/// # Errors
/// Those of [`plate_spectrum`].
pub fn simulated_spectra(
    contents: &LeafContents,
    wavelengths_nm: &[f64],
    noise: f64,
    random: &mut Xoshiro256PlusPlus,
) -> Result<LeafSpectra, SynthError> {
    let table = SpecificAbsorption::ProspectD;
    let optics = plate_spectrum(PlateModel::N, table, contents, PROSPECT_CONE_DEG, wavelengths_nm)?;
    let mut noisy = |share: f64| share + noise * normal(random);
    let reflectance = optics.iter().map(|optics| noisy(optics.reflectance)).collect();
    let transmittance = optics.iter().map(|optics| noisy(optics.transmittance)).collect();
    let shares = [reflectance, transmittance, vec![f64::NAN; optics.len()], vec![f64::NAN; optics.len()]];
    Ok(LeafSpectra { name: "leaf".to_owned(), wavelengths_nm: wavelengths_nm.to_vec(), shares })
}

/// Draws from the normal distribution of mean 0 and standard deviation 1 [Box & Muller 1958].
pub(crate) fn normal(random: &mut Xoshiro256PlusPlus) -> f64 {
    let (radius, turn) = ((-2.0 * (1.0 - random.r#gen::<f64>()).ln()).sqrt(), random.r#gen::<f64>());
    radius * (std::f64::consts::TAU * turn).cos()
}
