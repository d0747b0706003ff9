//! The three plate models behind one function: reflectance and transmittance of a whole leaf.

use btf_models::LeafContents;

use crate::error::SynthError;
use crate::optics::colour::PAPER_WAVELENGTHS_NM;
use crate::optics::contents::check_contents;
use crate::optics::plates::exact::plate;
use crate::optics::plates::paper::plate_paper;
use crate::optics::plates::pile::{check_structure, plate_n};
use crate::optics::plates::shares::PlateOptics;
use crate::optics::specific_absorption::{SpecificAbsorption, check_wavelengths};

/// Half-angle of the cone of incident light that PROSPECT assumes, in degrees [Jacquemoud 1990].
pub const PROSPECT_CONE_DEG: f64 = 40.0;

/// Kind of plate model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PlateModel {
    /// Model `plate-paper`, [`crate::plate_paper`]: one plate as printed, misprints included.
    Paper,
    /// Model `plate-exact`, [`crate::plate`]: one plate.
    Exact,
    /// Model `plate-n`, [`crate::plate_n`]: N plates, PROSPECT.
    #[default]
    N,
}

impl PlateModel {
    /// All models, the simplest first.
    pub const ALL: [PlateModel; 3] = [PlateModel::Paper, PlateModel::Exact, PlateModel::N];

    /// Returns the name: `plate-paper`, `plate-exact`, `plate-n`.
    pub fn name(self) -> &'static str {
        match self {
            PlateModel::Paper => "plate-paper",
            PlateModel::Exact => "plate-exact",
            PlateModel::N => "plate-n",
        }
    }

    /// Returns the half-angle of the cone of incident light in degrees that the authors of the model assume: 0 or
    /// [`PROSPECT_CONE_DEG`].
    pub fn default_cone_deg(self) -> f64 {
        match self {
            PlateModel::Paper | PlateModel::Exact => 0.0,
            PlateModel::N => PROSPECT_CONE_DEG,
        }
    }

    /// Returns the table that the authors of the model use. `plate-paper` has its own numbers and needs none.
    pub fn default_table(self) -> SpecificAbsorption {
        match self {
            PlateModel::Paper | PlateModel::Exact => SpecificAbsorption::Prospect5,
            PlateModel::N => SpecificAbsorption::ProspectD,
        }
    }

    /// Checks the ranges of the contents, and that the model knows all their pigments.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range, and for anthocyanins that the model would
    /// ignore silently.
    pub fn check(self, table: SpecificAbsorption, contents: &LeafContents) -> Result<(), SynthError> {
        check_contents(contents)?;
        let anthocyanin = contents.anthocyanin_ug_per_cm2;
        let colourless = self == PlateModel::Paper || table == SpecificAbsorption::Prospect5;
        if anthocyanin > 0.0 && colourless {
            let place = if self == PlateModel::Paper { self.name() } else { table.name() };
            let allowed = format!("0, as {place} has no anthocyanins, or take plate-n or plate-exact with prospect-d");
            return Err(SynthError::BadParameter { name: "--cant", value: anthocyanin.to_string(), allowed });
        }
        Ok(())
    }
}

/// Returns reflectance and transmittance of a whole leaf at each of `wavelengths_nm` (400 to 2500; for `plate-paper` any
/// of [`PAPER_WAVELENGTHS_NM`]), lit over a cone of half-angle `cone_deg` (0 to 90). `plate-paper` is printed for 0 and
/// ignores `cone_deg` and `table`.
///
/// Contents beyond the ranges of a leaf are computed as they stand: [`PlateModel::check`] refuses them.
///
/// # Errors
/// [`SynthError::BadParameter`] for a wavelength or a cone out of range, and an N below 1.
///
/// Cost: well below a microsecond per wavelength.
pub fn plate_spectrum(
    model: PlateModel,
    table: SpecificAbsorption,
    contents: &LeafContents,
    cone_deg: f64,
    wavelengths_nm: &[f64],
) -> Result<Vec<PlateOptics>, SynthError> {
    check_structure(contents.structure)?;
    if !(0.0..=90.0).contains(&cone_deg) {
        let allowed = "a half-angle from 0 to 90 degrees".to_owned();
        return Err(SynthError::BadParameter { name: "the cone of light", value: cone_deg.to_string(), allowed });
    }
    if model == PlateModel::Paper {
        let printed = plate_paper(contents, 1.0);
        let at = |nm: &f64| match PAPER_WAVELENGTHS_NM.iter().position(|x| x == nm) {
            Some(band) => Ok(printed[band]),
            None => Err(SynthError::BadParameter {
                name: "a wavelength",
                value: format!("{nm} nm"),
                allowed: "675, 546 or 435 nm, the only ones that plate-paper is printed for".to_owned(),
            }),
        };
        return wavelengths_nm.iter().map(at).collect();
    }
    check_wavelengths(wavelengths_nm)?;
    let at = |nm: &f64| {
        let (k, index) = (table.absorption(contents, *nm) / contents.structure, table.index(*nm));
        match model {
            PlateModel::Paper | PlateModel::Exact => Ok(plate(k, index, cone_deg)),
            PlateModel::N => plate_n(k, index, cone_deg, contents.structure),
        }
    };
    wavelengths_nm.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use SpecificAbsorption::{Prospect5, ProspectD};

    fn single(model: PlateModel, table: SpecificAbsorption, contents: &LeafContents, nm: f64) -> (f64, f64) {
        let optics = plate_spectrum(model, table, contents, model.default_cone_deg(), &[nm]).unwrap()[0];
        (optics.reflectance, optics.transmittance)
    }

    /// Returns the contents in PROSPECT's order: N, chlorophyll, carotenoids, brown, water, dry matter.
    fn prospect(structure: f64, cab: f64, car: f64, brown: f64, cw: f64, cm: f64) -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: cab,
            carotenoid_ug_per_cm2: car,
            anthocyanin_ug_per_cm2: 0.0,
            brown,
            water_cm: cw,
            dry_matter_g_per_cm2: cm,
            structure,
        }
    }

    #[test]
    fn published_prospect_d_values_are_met_to_1e_5() {
        let two = prospect(1.5, 40.0, 8.0, 0.0, 0.01, 0.005);
        let one = LeafContents { structure: 1.0, ..two };
        for (contents, nm, r, t) in [
            (two, 435.0, 0.04154, 0.00063),
            (two, 550.0, 0.15384, 0.15316),
            (two, 675.0, 0.03590, 0.00480),
            (one, 550.0, 0.10251, 0.22110),
        ] {
            let (reflectance, transmittance) = single(PlateModel::N, ProspectD, &contents, nm);
            assert!((reflectance - r).abs() < 1e-5 && (transmittance - t).abs() < 1e-5, "{nm}");
            // Planted difference: the other table is another leaf.
            let (other, _) = single(PlateModel::N, Prospect5, &contents, nm);
            assert!((other - r).abs() > 1e-5, "{nm}: {other}");
        }
    }

    #[test]
    fn the_published_prospect_5_leaf_is_met_at_550_nm() {
        let leaf = prospect(2.1, 40.0, 10.0, 0.1, 0.015, 0.009);
        let (reflectance, transmittance) = single(PlateModel::N, Prospect5, &leaf, 550.0);
        assert!((reflectance - 0.1488).abs() < 1e-4 && (transmittance - 0.0773).abs() < 1e-4);
    }

    /// Reflectance and transmittance that the Python package prosail 2.0.5 gives for PROSPECT-D.
    #[test]
    fn the_near_infrared_is_that_of_another_implementation() {
        let thin = prospect(1.5, 40.0, 8.0, 0.0, 0.01, 0.005);
        let thick = LeafContents { anthocyanin_ug_per_cm2: 2.0, ..prospect(2.1, 30.0, 7.0, 0.3, 0.02, 0.008) };
        for (contents, nm, r, t) in [
            (thin, 800.0, 0.459699, 0.492143),
            (thin, 1000.0, 0.450486, 0.487043),
            (thin, 1450.0, 0.173383, 0.219734),
            (thin, 1940.0, 0.038578, 0.051530),
            (thin, 2500.0, 0.039804, 0.072811),
            (thick, 400.0, 0.043872, 0.000307),
            (thick, 1200.0, 0.479491, 0.365407),
            (thick, 1650.0, 0.337180, 0.277336),
            (thick, 2200.0, 0.156642, 0.138641),
        ] {
            let (reflectance, transmittance) = single(PlateModel::N, ProspectD, &contents, nm);
            assert!((reflectance - r).abs() < 2e-6 && (transmittance - t).abs() < 2e-6, "{nm} {reflectance}");
            // Planted difference: a tenth more water.
            let wet = LeafContents { water_cm: 1.1 * contents.water_cm, ..contents };
            let (other, _) = single(PlateModel::N, ProspectD, &wet, nm);
            assert!(nm < 900.0 || (other - r).abs() > 2e-5, "{nm} {other}");
        }
    }

    #[test]
    fn without_absorption_nothing_is_lost_for_any_number_of_layers() {
        for structure in [1.0, 1.5, 3.0] {
            let clear = prospect(structure, 0.0, 0.0, 0.0, 0.0, 0.0);
            for nm in [400.0, 550.0, 675.0, 780.0, 1450.0, 2500.0] {
                for model in [PlateModel::Exact, PlateModel::N] {
                    let (reflectance, transmittance) = single(model, ProspectD, &clear, nm);
                    assert!((reflectance + transmittance - 1.0).abs() < 1e-12, "{model:?} N {structure}, {nm} nm");
                }
            }
        }
        // Planted difference: the print loses a quarter.
        let (r, t) = single(PlateModel::Paper, Prospect5, &prospect(1.5, 0.0, 0.0, 0.0, 0.0, 0.0), 675.0);
        assert!((r + t - 0.7576).abs() < 1e-4, "{r} {t}");
    }

    #[test]
    fn ever_more_pigment_leaves_the_first_surface_alone() {
        for (chlorophyll, near) in [(400.0, 1e-2), (4000.0, 1e-12)] {
            let dark = prospect(1.5, chlorophyll, 8.0, 0.0, 0.01, 0.005);
            for model in [PlateModel::Exact, PlateModel::N] {
                let cone = model.default_cone_deg();
                let (reflectance, transmittance) = single(model, ProspectD, &dark, 675.0);
                let surface = 1.0 - crate::mean_interface_transmittance(cone, ProspectD.index(675.0));
                assert!(transmittance >= 0.0 && transmittance < near, "{model:?} {transmittance}");
                assert!((reflectance - surface).abs() < near && reflectance >= surface, "{model:?}");
            }
        }
    }

    #[test]
    fn dry_matter_in_the_wrong_unit_is_refused_by_the_check_and_survived_by_the_models() {
        let slip = prospect(1.5, 40.0, 8.0, 0.0, 0.01, 20.0);
        assert!(PlateModel::N.check(ProspectD, &slip).unwrap_err().to_string().contains("--cm is 20"));
        let wavelengths: Vec<f64> = (400..=780).map(f64::from).collect();
        for model in [PlateModel::Exact, PlateModel::N] {
            for table in [Prospect5, ProspectD] {
                for optics in plate_spectrum(model, table, &slip, model.default_cone_deg(), &wavelengths).unwrap() {
                    let PlateOptics { reflectance, transmittance } = optics;
                    assert!((0.0..0.1).contains(&reflectance) && (0.0..1e-10).contains(&transmittance), "{optics:?}");
                }
            }
        }
        for nm in PAPER_WAVELENGTHS_NM {
            let (reflectance, transmittance) = single(PlateModel::Paper, Prospect5, &slip, nm);
            assert!(reflectance > 0.0 && transmittance > 0.0);
        }
    }

    #[test]
    fn what_a_model_cannot_answer_is_refused() {
        let green = LeafContents::default();
        let message = |model, contents: &LeafContents, cone, nm: f64| {
            plate_spectrum(model, ProspectD, contents, cone, &[nm]).unwrap_err().to_string()
        };
        assert!(message(PlateModel::Paper, &green, 0.0, 550.0).contains("675, 546 or 435 nm"));
        assert!(message(PlateModel::N, &green, 40.0, 2501.0).contains("400 to 2500"));
        assert!(message(PlateModel::N, &green, 91.0, 550.0).contains("0 to 90 degrees"));
        for structure in [0.999, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            let contents = LeafContents { structure, ..green };
            for model in PlateModel::ALL {
                assert!(message(model, &contents, 0.0, 675.0).contains("--n is"), "{structure}");
            }
        }
        let red = LeafContents { anthocyanin_ug_per_cm2: 5.0, ..green };
        PlateModel::N.check(ProspectD, &red).unwrap();
        for (model, table) in
            [(PlateModel::N, Prospect5), (PlateModel::Exact, Prospect5), (PlateModel::Paper, ProspectD)]
        {
            assert!(model.check(table, &red).unwrap_err().to_string().contains("--cant is 5"));
            model.check(table, &green).unwrap();
        }
    }
}
