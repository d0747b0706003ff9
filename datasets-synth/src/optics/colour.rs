//! From a leaf's contents to linear sRGB over 31 wavelengths.

use crate::optics::plate::{diffuse_transmission, mean_interface_transmittance, plate_inside_of};
use crate::optics::tables::{
    BANDS, BROWN, CAROTENOID, CHLOROPHYLL, CIE_X, CIE_Y, CIE_Z, D65, DRY_MATTER, FIRST_NM, REFRACTIVE_INDEX, STEP_NM,
    WATER,
};

/// From CIE XYZ to linear sRGB [IEC 61966-2-1].
const RGB_FROM_XYZ: [[f64; 3]; 3] = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// What a leaf holds per area of leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafContents {
    /// Chlorophyll a + b in ug/cm2, 0 to 100.
    pub chlorophyll_ug_per_cm2: f64,
    /// Carotenoids in ug/cm2, 0 to 25.
    pub carotenoid_ug_per_cm2: f64,
    /// Brown pigment in arbitrary units, 0 to 1.
    pub brown: f64,
    /// Water in cm, 0 to 0.04.
    pub water_cm: f64,
    /// Dry matter in g/cm2, 0 to 0.02.
    pub dry_matter_g_per_cm2: f64,
    /// Structure parameter N, 1 to 3.
    pub structure: f64,
}

impl Default for LeafContents {
    /// A green leaf: 40 ug/cm2 chlorophyll, 8 ug/cm2 carotenoids, no brown pigment, 0.01 cm water,
    /// 0.005 g/cm2 dry matter, N = 1.5.
    fn default() -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: 40.0,
            carotenoid_ug_per_cm2: 8.0,
            brown: 0.0,
            water_cm: 0.01,
            dry_matter_g_per_cm2: 0.005,
            structure: 1.5,
        }
    }
}

impl LeafContents {
    /// Absorption `k = sum K C / N` at each of the [`wavelengths_nm`] [Miao, eq. 5].
    pub fn absorption(&self) -> [f64; BANDS] {
        std::array::from_fn(|band| {
            (CHLOROPHYLL[band] * self.chlorophyll_ug_per_cm2
                + CAROTENOID[band] * self.carotenoid_ug_per_cm2
                + BROWN[band] * self.brown
                + WATER[band] * self.water_cm
                + DRY_MATTER[band] * self.dry_matter_g_per_cm2)
                / self.structure
        })
    }
}

/// The wavelengths of all spectra in nanometres: 400, 410, ... 700.
pub fn wavelengths_nm() -> [f64; BANDS] {
    std::array::from_fn(|band| FIRST_NM + STEP_NM * band as f64)
}

/// Refractive index of the leaf's material at each of the [`wavelengths_nm`].
pub fn refractive_index() -> [f64; BANDS] {
    REFRACTIVE_INDEX
}

/// Turns reflectance spectra under D65 into linear sRGB (2-degree observer).
///
/// Each channel is divided by what a perfect reflector gives, so that one is (1, 1, 1) exactly;
/// the correction for the cut at 400 and 700 nm and the 10 nm steps is below 0.3 % in every
/// channel. Colours outside the gamut keep their negative values.
#[derive(Debug, Clone)]
pub struct SpectrumToRgb {
    /// `[channel][band]`.
    weights: [[f64; BANDS]; 3],
    /// What a perfect reflector gave before the correction.
    uncorrected_white: [f64; 3],
    /// Mean transmittance of the interface for diffuse light, by band.
    diffuse_entry: [f64; BANDS],
}

impl Default for SpectrumToRgb {
    fn default() -> SpectrumToRgb {
        SpectrumToRgb::new()
    }
}

impl SpectrumToRgb {
    /// Tabulates the weights.
    pub fn new() -> SpectrumToRgb {
        let luminance: f64 = (0..BANDS).map(|band| D65[band] * CIE_Y[band]).sum();
        let mut weights: [[f64; BANDS]; 3] = std::array::from_fn(|channel| {
            let row = RGB_FROM_XYZ[channel];
            std::array::from_fn(|band| {
                D65[band] * (row[0] * CIE_X[band] + row[1] * CIE_Y[band] + row[2] * CIE_Z[band]) / luminance
            })
        });
        let uncorrected_white = weights.map(|row| row.iter().sum());
        for (row, white) in weights.iter_mut().zip(uncorrected_white) {
            row.iter_mut().for_each(|weight| *weight /= white);
        }
        let diffuse_entry = REFRACTIVE_INDEX.map(|index| mean_interface_transmittance(90.0, index));
        SpectrumToRgb { weights, uncorrected_white, diffuse_entry }
    }

    /// Linear sRGB of a reflectance spectrum, signed.
    pub fn rgb(&self, reflectance: &[f64; BANDS]) -> [f64; 3] {
        self.weights.map(|row| row.iter().zip(reflectance).map(|(w, r)| w * r).sum())
    }

    /// Linear sRGB of a perfect reflector before the correction that makes it (1, 1, 1).
    pub fn uncorrected_white(&self) -> [f64; 3] {
        self.uncorrected_white
    }

    /// Linear sRGB of the share of entered light that leaves a plate in front again, for
    /// absorption `k` times `thickness`: [`crate::plate_inside`] over the bands.
    pub fn plate_rgb(&self, absorption: &[f64; BANDS], thickness: f64) -> [f64; 3] {
        let spectrum = std::array::from_fn(|band| {
            let theta = diffuse_transmission(absorption[band] * thickness);
            plate_inside_of(theta, REFRACTIVE_INDEX[band], self.diffuse_entry[band]).reflectance
        });
        self.rgb(&spectrum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_reflector_is_white_and_the_correction_is_small() {
        let convert = SpectrumToRgb::new();
        for channel in convert.rgb(&[1.0; BANDS]) {
            assert!((channel - 1.0).abs() < 1e-12);
        }
        for channel in convert.uncorrected_white() {
            assert!((channel - 1.0).abs() < 3e-3, "{:?}", convert.uncorrected_white());
        }
    }

    #[test]
    fn a_band_of_green_light_lies_outside_the_gamut_and_stays_signed() {
        let wavelengths = wavelengths_nm();
        let spectrum = std::array::from_fn(|band| if (wavelengths[band] - 520.0).abs() < 25.0 { 1.0 } else { 0.0 });
        let [r, g, b] = SpectrumToRgb::new().rgb(&spectrum);
        assert!(g > 0.2 && r < 0.0, "{r} {g} {b}");
    }

    #[test]
    fn a_green_leaf_is_green_a_yellow_one_yellow_and_more_chlorophyll_is_darker() {
        let convert = SpectrumToRgb::new();
        let rgb = |contents: LeafContents| convert.plate_rgb(&contents.absorption(), 1.0);
        let green = rgb(LeafContents::default());
        assert!(green[1] > 1.3 * green[0] && green[1] > 2.0 * green[2], "{green:?}");
        let yellow = rgb(LeafContents { chlorophyll_ug_per_cm2: 1.0, ..LeafContents::default() });
        assert!(yellow[0] > 0.8 * yellow[1] && yellow[1] > 2.0 * yellow[2], "{yellow:?}");
        let dark = rgb(LeafContents { chlorophyll_ug_per_cm2: 80.0, ..LeafContents::default() });
        assert!(dark[1] < green[1]);
        let thick = convert.plate_rgb(&LeafContents::default().absorption(), 1.5);
        assert!(thick[1] < green[1], "thicker is darker in front");
    }

    #[test]
    fn the_tables_hold_the_published_values_at_550_nm() {
        let band = 15;
        assert_eq!(wavelengths_nm()[band], 550.0);
        assert_eq!(CIE_Y[band], 0.9949501);
        assert_eq!(CHLOROPHYLL[band], 0.01286);
        assert_eq!(CAROTENOID[band], 0.003816);
        assert_eq!(refractive_index()[band], 1.4303);
    }
}
