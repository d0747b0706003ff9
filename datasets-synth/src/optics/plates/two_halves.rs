//! `plate-two-sided`: a leaf as two piles of plates, palisade tissue above and spongy tissue below, so that its faces
//! differ.
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | contents, index, cone, N | | those of [`crate::plate_n`] | |
//! | share of the N layers that is palisade | - | 0.9 | 0.05 to 0.95 |
//! | share of the pigments that is in them | - | 0.99 | 0 to 1 |
//! | share of water and dry matter that is in them | - | 0.95 | 0 to 1 |
//!
//! Each half is Stokes' pile (see [`crate::plate_n`]) with `k = sum K C / N` of its own contents and layers. Under diffuse
//! light the halves A, which is lit, and B give `R = R_A + T_A^2 R_B / (1 - R_A R_B)`, `T = T_A T_B / (1 - R_A R_B)`.
//! Halves that are alike are `plate-n` exactly, and T is the same from both faces, as it is measured to be.
//!
//! Source: unequal halves are the idea of the dorsiventral leaf model [Stuckens 2009] and of QSPECT, which has four
//! layers. Here both halves are made of plates of one kind, so that three numbers suffice. Their defaults fit 66 leaves of
//! oak, birch and goldenrod, seen from both faces, best [Noda 2013] (docs/results/leaf-optics.md).
//!
//! When it is wrong: palisade cells guide light along themselves, which plates do not; a half of less than one layer is
//! Stokes' solution continued to where it has no picture; hairs and wax of one face are in neither half.

use btf_models::LeafContents;

use crate::error::{SynthError, check_ranges};
use crate::optics::abm::path_lengths::Face;
use crate::optics::interface::{DiffuseFaces, mean_interface_transmittance};
use crate::optics::plates::pile::{Layers, check_structure};
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::theta::diffuse_transmission;
use crate::optics::specific_absorption::{Coefficients, SpecificAbsorption, absorption_of, check_wavelengths};

/// How layers and contents divide between the halves of a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoHalves {
    /// Share of the layers that is palisade, 0.05 to 0.95.
    pub layers: f64,
    /// Share of the pigments that is in them, 0 to 1.
    pub pigments: f64,
    /// Share of water and dry matter that is in them, 0 to 1.
    pub body: f64,
}

impl Default for TwoHalves {
    /// Returns the halves that fit measured broad leaves best: a lower tenth that scatters and hardly absorbs.
    fn default() -> TwoHalves {
        TwoHalves { layers: 0.9, pigments: 0.99, body: 0.95 }
    }
}

impl TwoHalves {
    /// Halves that are alike, which makes `plate-n`.
    pub const ALIKE: TwoHalves = TwoHalves { layers: 0.5, pigments: 0.5, body: 0.5 };

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("--palisade-layers", self.layers, 0.05, 0.95),
            ("--palisade-pigments", self.pigments, 0.0, 1.0),
            ("--palisade-body", self.body, 0.0, 1.0),
        ])
    }

    /// Returns the shares of the light that has entered through `face` at a wavelength of `table`: what leaves there again,
    /// and what leaves behind. They do not depend on the direction of the light.
    ///
    /// NaN outside of the table, and for halves or contents out of range whatever comes of them:
    /// [`two_sided_spectrum`] refuses those.
    pub fn entered(
        &self,
        table: SpecificAbsorption,
        contents: &LeafContents,
        face: Face,
        wavelength_nm: f64,
    ) -> PlateOptics {
        let thetas = self.absorptions(&table.coefficients(wavelength_nm), contents).map(diffuse_transmission);
        self.inside(thetas, DiffuseFaces::new(table.index(wavelength_nm)), contents.structure, face)
    }

    /// Returns the absorption of a layer of the palisade and of the spongy half of a leaf of `contents`.
    #[inline]
    pub(crate) fn absorptions(&self, coefficients: &Coefficients, contents: &LeafContents) -> [f64; 2] {
        let [pigments @ .., water, dry_matter] = coefficients;
        let body = water * contents.water_cm + dry_matter * contents.dry_matter_g_per_cm2;
        let pigments = absorption_of(&[pigments[0], pigments[1], pigments[2], pigments[3], 0.0, 0.0], contents);
        let share = |pigment_share: f64, body_share: f64, layers: f64| {
            (pigment_share * pigments + body_share * body) / (layers * contents.structure)
        };
        [share(self.pigments, self.body, self.layers), share(1.0 - self.pigments, 1.0 - self.body, 1.0 - self.layers)]
    }

    /// Returns the shares of the light that has entered through `face`: what leaves there again, and what leaves behind.
    /// `thetas` are the transmissions of a layer of the palisade and of the spongy half, `structure` is N.
    #[inline]
    pub(crate) fn inside(&self, thetas: [f64; 2], faces: DiffuseFaces, structure: f64, face: Face) -> PlateOptics {
        let counts = [self.layers * structure, (1.0 - self.layers) * structure];
        let [palisade, spongy] = [0, 1].map(|half| Layers::new(thetas[half], faces).pile(counts[half]));
        let [a, b] = if face == Face::Adaxial { [palisade, spongy] } else { [spongy, palisade] };
        let between = 1.0 / (1.0 - a.reflectance * b.reflectance);
        let reflectance = a.reflectance + a.transmittance * a.transmittance * b.reflectance * between;
        PlateOptics {
            // Less than one layer may reflect less than its own surface.
            reflectance: ((reflectance - (1.0 - faces.entry)) / faces.entry).max(0.0),
            transmittance: a.transmittance * b.transmittance * between / faces.entry,
        }
    }
}

/// Returns reflectance and transmittance of a leaf of unequal `halves` at each of `wavelengths_nm` (400 to 2500), lit over a
/// cone of half-angle `cone_deg` (0 to 90) from the side of `face`.
///
/// # Errors
/// [`SynthError::BadParameter`] for halves, a wavelength or a cone out of range, and an N below 1.
pub fn two_sided_spectrum(
    halves: &TwoHalves,
    table: SpecificAbsorption,
    contents: &LeafContents,
    cone_deg: f64,
    face: Face,
    wavelengths_nm: &[f64],
) -> Result<Vec<PlateOptics>, SynthError> {
    halves.check()?;
    check_structure(contents.structure)?;
    check_wavelengths(wavelengths_nm)?;
    check_ranges(&[("--cone-deg", cone_deg, 0.0, 90.0)])?;
    let at = |nm: &f64| {
        let inside = halves.entered(table, contents, face, *nm);
        let entering = mean_interface_transmittance(cone_deg, table.index(*nm));
        PlateOptics {
            reflectance: (1.0 - entering) + entering * inside.reflectance,
            transmittance: entering * inside.transmittance,
        }
    };
    Ok(wavelengths_nm.iter().map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::plates::model::{PlateModel, plate_spectrum};
    use SpecificAbsorption::ProspectD;

    const NM: [f64; 6] = [440.0, 550.0, 680.0, 780.0, 1450.0, 2200.0];

    fn of(halves: &TwoHalves, contents: &LeafContents, face: Face) -> Vec<PlateOptics> {
        two_sided_spectrum(halves, ProspectD, contents, 40.0, face, &NM).unwrap()
    }

    #[test]
    fn halves_that_are_alike_are_the_pile_of_plates() {
        for structure in [1.0, 1.5, 2.7] {
            let contents = LeafContents { structure, ..LeafContents::default() };
            let pile = plate_spectrum(PlateModel::N, ProspectD, &contents, 40.0, &NM).unwrap();
            let third = TwoHalves { layers: 0.3, pigments: 0.3, body: 0.3 };
            for halves in [TwoHalves::ALIKE, third] {
                for face in [Face::Adaxial, Face::Abaxial] {
                    for (x, y) in of(&halves, &contents, face).iter().zip(&pile) {
                        assert!((x.reflectance - y.reflectance).abs() < 1e-9, "{structure} {x:?} {y:?}");
                        assert!((x.transmittance - y.transmittance).abs() < 1e-9, "{structure} {x:?} {y:?}");
                    }
                }
            }
            // Planted difference: the usual halves are another leaf.
            let usual = of(&TwoHalves::default(), &contents, Face::Abaxial);
            assert!((usual[1].reflectance - pile[1].reflectance).abs() > 0.02);
        }
    }

    /// Means of 66 leaves of three species, face and back [Noda 2013].
    #[test]
    fn the_back_is_as_much_paler_as_it_is_measured_and_transmits_as_much() {
        let contents = LeafContents { chlorophyll_ug_per_cm2: 33.0, ..LeafContents::default() };
        let [face, back] = [Face::Adaxial, Face::Abaxial].map(|face| of(&TwoHalves::default(), &contents, face));
        let paler = |i: usize| back[i].reflectance - face[i].reflectance;
        assert!((paler(1) - 0.057).abs() < 0.02 && (paler(2) - 0.034).abs() < 0.02, "{} {}", paler(1), paler(2));
        assert!(paler(3).abs() < 0.02, "{}", paler(3));
        for (x, y) in face.iter().zip(&back) {
            assert!((x.transmittance - y.transmittance).abs() < 1e-12);
            assert!(x.reflectance + x.transmittance < 1.0 && y.reflectance + y.transmittance < 1.0);
        }
    }

    #[test]
    fn nothing_is_lost_without_absorption_and_everything_is_finite_at_the_extremes() {
        for layers in [0.05, 0.5, 0.95] {
            for share in [0.0, 0.5, 1.0] {
                let halves = TwoHalves { layers, pigments: share, body: share };
                for structure in [1.0, 1.5, 3.0, 50.0] {
                    let clear = LeafContents { structure, ..LeafContents::default() }.without_pigments();
                    let clear = LeafContents { water_cm: 0.0, dry_matter_g_per_cm2: 0.0, ..clear };
                    let dark = LeafContents { chlorophyll_ug_per_cm2: 1e4, dry_matter_g_per_cm2: 20.0, ..clear };
                    for face in [Face::Adaxial, Face::Abaxial] {
                        for x in of(&halves, &clear, face) {
                            assert!(
                                (x.reflectance + x.transmittance - 1.0).abs() < 1e-9,
                                "{halves:?} {structure} {x:?}"
                            );
                        }
                        for x in of(&halves, &dark, face) {
                            let fine = (0.0..=1.0).contains(&x.reflectance) && (0.0..=1.0).contains(&x.transmittance);
                            assert!(
                                fine && x.reflectance + x.transmittance <= 1.0 + 1e-12,
                                "{halves:?} {structure} {x:?}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn halves_out_of_range_are_named() {
        let message = |halves: TwoHalves| halves.check().unwrap_err().to_string();
        assert!(message(TwoHalves { layers: 0.0, ..TwoHalves::default() }).contains("--palisade-layers is 0"));
        assert!(message(TwoHalves { pigments: 1.1, ..TwoHalves::default() }).contains("--palisade-pigments"));
        assert!(message(TwoHalves { body: f64::NAN, ..TwoHalves::default() }).contains("--palisade-body"));
        TwoHalves::ALIKE.check().unwrap();
    }
}
