//! Plate model prepared for millions of texels: from contents to the colour of a leaf's body.

use btf_models::LeafContents;

use crate::error::SynthError;
use crate::optics::abm::path_lengths::Face;
use crate::optics::colour::{RgbBands, RgbFromSpectrum};
use crate::optics::interface::DiffuseFaces;
use crate::optics::plates::exact::plate_inside_of;
use crate::optics::plates::model::PlateModel;
use crate::optics::plates::paper::plate_paper;
use crate::optics::plates::pile::plate_n_inside_of;
use crate::optics::plates::theta::ThetaForm;
use crate::optics::plates::two_halves::TwoHalves;
use crate::optics::specific_absorption::{Coefficients, SpecificAbsorption, absorption_of};

/// Colour of a leaf's body in linear sRGB, signed.
///
/// For `plate-exact` and `plate-n` the colours are shares of the light that *entered* the leaf, without the reflection
/// of the surface, so that a specular lobe that says how much enters can be coupled. For `plate-paper` they are shares
/// of the incident light, the surface included, as printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyRgb {
    /// Share that leaves in front.
    pub reflectance: [f32; 3],
    /// Share that leaves behind.
    pub transmittance: [f32; 3],
}

/// Properties at one wavelength.
#[derive(Debug, Clone)]
struct Band {
    coefficients: Coefficients,
    faces: DiffuseFaces,
    /// Weights of the wavelength in each channel.
    weights: [f64; 3],
}

/// Model that a body is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum BodyModel {
    Plates(PlateModel),
    /// Unequal halves, and the face that is seen.
    TwoSided(TwoHalves, Face),
}

/// Plate model with everything looked up that does not depend on the contents.
#[derive(Debug, Clone)]
pub struct PlateBody {
    model: BodyModel,
    theta: ThetaForm,
    bands: Vec<Band>,
}

impl PlateBody {
    /// Prepares `model` over `table` (which `plate-paper` does not read) at `bands`.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for `plate-paper` at other than its three wavelengths.
    pub fn new(model: PlateModel, table: SpecificAbsorption, bands: RgbBands) -> Result<PlateBody, SynthError> {
        if model == PlateModel::Paper && bands != RgbBands::ThreeWavelength {
            let allowed = format!("{}: plate-paper is printed for no other", RgbBands::ThreeWavelength.name());
            return Err(SynthError::BadParameter { name: "--bands", value: bands.name().to_owned(), allowed });
        }
        Ok(PlateBody::of(BodyModel::Plates(model), table, bands))
    }

    /// Prepares unequal halves, of which `face` is seen, over PROSPECT-D at `bands`.
    pub fn two_sided(halves: TwoHalves, face: Face, bands: RgbBands) -> PlateBody {
        PlateBody::of(BodyModel::TwoSided(halves, face), SpecificAbsorption::ProspectD, bands)
    }

    fn of(model: BodyModel, table: SpecificAbsorption, bands: RgbBands) -> PlateBody {
        let convert = RgbFromSpectrum::new(bands);
        let bands = convert
            .wavelengths_nm()
            .iter()
            .zip(convert.weights())
            .map(|(&nm, &weights)| Band {
                coefficients: table.coefficients(nm),
                faces: DiffuseFaces::new(table.index(nm)),
                weights,
            })
            .collect();
        PlateBody { model, theta: ThetaForm::Single, bands }
    }

    /// Returns the model with theta(k) computed in another form than [`ThetaForm::Single`], whose error no image can
    /// hold, to measure what a form costs and loses. `plate-paper` keeps its own form.
    pub fn with_theta(self, theta: ThetaForm) -> PlateBody {
        PlateBody { theta, ..self }
    }

    /// Returns the colour of the body where the leaf holds `contents` and is `thickness` times as thick as they say:
    /// `k = thickness sum K C / N`. For `plate-paper`, `thickness` multiplies the transmittance instead, as printed.
    ///
    /// The colour is finite for any contents and thickness from 0 up and N from 1 up; the caller checks them once with
    /// [`PlateModel::check`]. Cost: see docs/results/trade.md.
    pub fn rgb(&self, contents: &LeafContents, thickness: f64) -> BodyRgb {
        let structure = contents.structure;
        match self.model {
            BodyModel::Plates(PlateModel::Paper) => {
                let printed = plate_paper(contents, thickness);
                BodyRgb {
                    reflectance: printed.map(|band| band.reflectance as f32),
                    transmittance: printed.map(|band| band.transmittance as f32),
                }
            }
            BodyModel::Plates(PlateModel::Exact) => self.sum(|band| {
                let k = thickness / structure * absorption_of(&band.coefficients, contents);
                plate_inside_of(self.theta.at(k), band.faces)
            }),
            BodyModel::Plates(PlateModel::N) => self.sum(|band| {
                let k = thickness / structure * absorption_of(&band.coefficients, contents);
                plate_n_inside_of(self.theta.at(k), band.faces, structure)
            }),
            BodyModel::TwoSided(halves, face) => self.sum(|band| {
                let thetas = halves.absorptions(&band.coefficients, contents).map(|k| self.theta.at(thickness * k));
                halves.inside(thetas, band.faces, structure, face)
            }),
        }
    }

    #[inline]
    fn sum(&self, inside: impl Fn(&Band) -> crate::PlateOptics) -> BodyRgb {
        let (mut front, mut behind) = ([0.0; 3], [0.0; 3]);
        for band in &self.bands {
            let optics = inside(band);
            for channel in 0..3 {
                front[channel] += band.weights[channel] * optics.reflectance;
                behind[channel] += band.weights[channel] * optics.transmittance;
            }
        }
        BodyRgb { reflectance: front.map(|x| x as f32), transmittance: behind.map(|x| x as f32) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::interface::mean_interface_transmittance;
    use crate::optics::plates::model::plate_spectrum;

    fn body(model: PlateModel, bands: RgbBands) -> PlateBody {
        PlateBody::new(model, model.default_table(), bands).unwrap()
    }

    #[test]
    fn the_body_is_the_whole_leaf_less_its_surface() {
        let contents = LeafContents { brown: 0.1, ..LeafContents::default() };
        for model in [PlateModel::Exact, PlateModel::N] {
            let table = model.default_table();
            for bands in [RgbBands::Spectral31, RgbBands::ThreeWavelength] {
                let convert = RgbFromSpectrum::new(bands);
                let entered = |nm: f64| mean_interface_transmittance(40.0, table.index(nm));
                let whole = plate_spectrum(model, table, &contents, 40.0, convert.wavelengths_nm()).unwrap();
                let (front, behind): (Vec<f64>, Vec<f64>) = whole
                    .iter()
                    .zip(convert.wavelengths_nm())
                    .map(|(optics, &nm)| {
                        let surface = 1.0 - entered(nm);
                        ((optics.reflectance - surface) / entered(nm), optics.transmittance / entered(nm))
                    })
                    .unzip();
                let rgb = body(model, bands).with_theta(ThetaForm::Exact).rgb(&contents, 1.0);
                for channel in 0..3 {
                    let (r, t) = (convert.rgb(&front)[channel] as f32, convert.rgb(&behind)[channel] as f32);
                    assert!((rgb.reflectance[channel] - r).abs() < 1e-6, "{model:?} {bands:?} {rgb:?} {r}");
                    assert!((rgb.transmittance[channel] - t).abs() < 1e-6, "{model:?} {bands:?} {rgb:?} {t}");
                }
            }
        }
    }

    #[test]
    fn no_image_can_tell_the_usual_theta_from_the_exact_one() {
        for model in [PlateModel::Exact, PlateModel::N] {
            let usual = body(model, RgbBands::Spectral31);
            let exact = usual.clone().with_theta(ThetaForm::Exact);
            let planted = usual.clone().with_theta(ThetaForm::ThreePiece);
            let mut planted_worst = 0f32;
            for i in 0..200 {
                let chlorophyll_ug_per_cm2 = 0.5 * f64::from(i);
                let contents = LeafContents { chlorophyll_ug_per_cm2, ..LeafContents::default() };
                let apart = |x: &PlateBody| {
                    let (x, y) = (x.rgb(&contents, 0.7), exact.rgb(&contents, 0.7));
                    let both = |c: usize| {
                        (x.reflectance[c] - y.reflectance[c]).abs().max((x.transmittance[c] - y.transmittance[c]).abs())
                    };
                    both(0).max(both(1)).max(both(2))
                };
                assert!(apart(&usual) < 1e-6, "{model:?} {chlorophyll_ug_per_cm2}: {}", apart(&usual));
                planted_worst = planted_worst.max(apart(&planted));
            }
            assert!(planted_worst > 1e-3);
        }
    }

    #[test]
    fn a_two_sided_bodys_back_is_paler_and_alike_halves_have_the_colour_of_plates() {
        let contents = LeafContents::default();
        let plates = body(PlateModel::N, RgbBands::Spectral31).rgb(&contents, 0.8);
        for face in [Face::Adaxial, Face::Abaxial] {
            let alike = PlateBody::two_sided(TwoHalves::ALIKE, face, RgbBands::Spectral31).rgb(&contents, 0.8);
            for channel in 0..3 {
                assert!(
                    (alike.reflectance[channel] - plates.reflectance[channel]).abs() < 1e-5,
                    "{alike:?} {plates:?}"
                );
                assert!((alike.transmittance[channel] - plates.transmittance[channel]).abs() < 1e-5);
            }
        }
        let [face, back] = [Face::Adaxial, Face::Abaxial]
            .map(|face| PlateBody::two_sided(TwoHalves::default(), face, RgbBands::Spectral31).rgb(&contents, 1.0));
        assert!((0..3).all(|c| back.reflectance[c] > face.reflectance[c] + 0.01), "{face:?} {back:?}");
        assert!((0..3).all(|c| (back.transmittance[c] - face.transmittance[c]).abs() < 1e-6));
    }

    #[test]
    fn a_green_leaf_is_green_a_yellow_one_yellow_and_a_red_one_red() {
        let body = body(PlateModel::N, RgbBands::Spectral31);
        let front = |contents: LeafContents| body.rgb(&contents, 1.0).reflectance;
        let green = front(LeafContents::default());
        assert!(green[1] > 1.3 * green[0] && green[1] > 2.0 * green[2], "{green:?}");
        let yellow = front(LeafContents { chlorophyll_ug_per_cm2: 1.0, ..LeafContents::default() });
        assert!(yellow[0] > 0.8 * yellow[1] && yellow[1] > 2.0 * yellow[2], "{yellow:?}");
        let red = front(LeafContents {
            chlorophyll_ug_per_cm2: 3.0,
            anthocyanin_ug_per_cm2: 12.0,
            ..LeafContents::default()
        });
        assert!(red[0] > 1.3 * red[1], "{red:?}");
        let dark = front(LeafContents { chlorophyll_ug_per_cm2: 80.0, ..LeafContents::default() });
        assert!(dark[1] < green[1]);
    }

    #[test]
    fn thicker_is_darker_on_both_sides_except_behind_the_printed_plate() {
        let green = LeafContents::default();
        for model in PlateModel::ALL {
            let body = body(model, RgbBands::ThreeWavelength);
            let (thin, thick) = (body.rgb(&green, 0.8), body.rgb(&green, 1.6));
            if model == PlateModel::Paper {
                assert_eq!(thin.reflectance, thick.reflectance);
                assert_eq!(thick.transmittance[1], 2.0 * thin.transmittance[1], "the printed gain");
            } else {
                assert!(thick.reflectance[1] < thin.reflectance[1], "{model:?}");
                assert!(thick.transmittance[1] < thin.transmittance[1], "{model:?}");
            }
        }
        // As printed a thick clear leaf gives more light than it gets.
        let clear = LeafContents { chlorophyll_ug_per_cm2: 0.0, carotenoid_ug_per_cm2: 0.0, ..green };
        let printed = body(PlateModel::Paper, RgbBands::ThreeWavelength).rgb(&clear, 2.0);
        assert!(printed.reflectance[0] + printed.transmittance[0] > 1.0);
    }

    #[test]
    fn colours_are_finite_at_every_extreme() {
        for model in PlateModel::ALL {
            for bands in [RgbBands::Spectral31, RgbBands::ThreeWavelength] {
                let Ok(body) = PlateBody::new(model, model.default_table(), bands) else {
                    assert!(model == PlateModel::Paper && bands == RgbBands::Spectral31);
                    continue;
                };
                for chlorophyll_ug_per_cm2 in [0.0, 1e-300, 400.0, 4000.0, 1e300] {
                    for dry_matter_g_per_cm2 in [0.0, 20.0] {
                        for structure in [1.0, 1.0f64.next_up(), 1.5, 3.0, 100.0] {
                            for thickness in [0.0, 1e-300, 1.0, 100.0] {
                                let contents = LeafContents {
                                    chlorophyll_ug_per_cm2,
                                    dry_matter_g_per_cm2,
                                    structure,
                                    ..LeafContents::default()
                                };
                                let BodyRgb { reflectance, transmittance } = body.rgb(&contents, thickness);
                                let fine = reflectance.iter().chain(&transmittance).all(|x| (-0.1..=50.0).contains(x));
                                assert!(fine, "{model:?} {contents:?} {reflectance:?} {transmittance:?}");
                            }
                        }
                    }
                }
            }
        }
    }
}
