//! `plate-paper`: the plate as printed [Miao, eq. 6 and 9], to the printed digit. For reproducing the
//! paper and for measuring its error; use `plate-n` or `plate-exact` for anything else.
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | chlorophyll a + b | ug/cm2 | 40 | 0 to 100 |
//! | carotenoids | ug/cm2 | 8 | 0 to 25 |
//! | brown pigment | arbitrary | 0 | 0 to 1 |
//! | dry matter | g/cm2 (printed: g/cm) | 0.005 | 0 to 0.02 |
//! | structure N | - | 1.5 | 1 to 3 |
//! | thickness ratio V_t | - | 1 | 0 up |
//!
//! `k = (K_ab C_ab + K_r C_r + K_b C_b + K_m C_m) / N`, theta(k) in three pieces,
//! `rho_d = (0.031 + 0.240 th^2) / (1 - 0.296 th^2)`, `rho_t = V_t 0.44 th / (1 - 0.001 th^2)`, at
//! 675, 546 and 435 nm. Water and anthocyanins are not in the paper and have no effect.
//!
//! Differs from the paper in: nothing, its slips included. They are
//! - K_m at 435 nm, 1.481, a tenth of the 14.81 cm2/g of the table that it comes from;
//! - 0.001 in `rho_t`'s denominator, where the algebra gives 0.296: a clear leaf transmits 0.440
//!   instead of 0.628;
//! - 0.240 in `rho_d`'s numerator, where it gives 0.232 (0.2406 belongs to another form of the
//!   fraction);
//! - K_r at 435 nm rounded to 0.168, and 0.031 for 0.0301;
//! - theta(0) = 0.951 instead of 1 (see [`crate::three_piece_fit`]);
//! - V_t, a thickness, brightens transmitted light: above 1 / (rho_d + rho_t) more leaves the leaf
//!   than came in.
//!
//! When it is wrong: a leaf without any pigment absorbs a quarter of the light; the paper's own Table
//! 1 is off by up to 0.19; see also `plate-exact`, whose limits it shares.

use btf_models::LeafContents;

use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::theta::three_piece_fit;

/// Specific absorption of chlorophyll a + b at the three wavelengths as printed, in cm2/ug.
const CHLOROPHYLL: [f64; 3] = [0.05914, 0.01221, 0.0716];

/// Specific absorption of carotenoids in cm2/ug.
const CAROTENOID: [f64; 3] = [0.0, 0.0073, 0.168];

/// Specific absorption of brown pigment, per arbitrary unit.
const BROWN: [f64; 3] = [0.1572, 0.3568, 0.4912];

/// Specific absorption of dry matter in cm2/g; the last is a tenth of that in its source.
const DRY_MATTER: [f64; 3] = [2.3, 2.3, 1.481];

/// Returns the absorption k at the [`PAPER_WAVELENGTHS_NM`](crate::PAPER_WAVELENGTHS_NM) with the printed coefficients.
pub fn plate_paper_absorption(contents: &LeafContents) -> [f64; 3] {
    std::array::from_fn(|band| {
        (CHLOROPHYLL[band] * contents.chlorophyll_ug_per_cm2
            + CAROTENOID[band] * contents.carotenoid_ug_per_cm2
            + BROWN[band] * contents.brown
            + DRY_MATTER[band] * contents.dry_matter_g_per_cm2)
            / contents.structure
    })
}

/// Evaluates the printed eq. 6 for a given theta, which the paper takes from [`three_piece_fit`].
pub fn plate_paper_of_theta(theta: f64) -> PlateOptics {
    let theta2 = theta * theta;
    PlateOptics {
        reflectance: (0.031 + 0.240 * theta2) / (1.0 - 0.296 * theta2),
        transmittance: 0.44 * theta / (1.0 - 0.001 * theta2),
    }
}

/// Evaluates the printed eq. 9 without its specular lobe, at the
/// [`PAPER_WAVELENGTHS_NM`](crate::PAPER_WAVELENGTHS_NM): `thickness` V_t multiplies
/// the transmittance. The shares may add up to more than the incident light.
pub fn plate_paper(contents: &LeafContents, thickness: f64) -> [PlateOptics; 3] {
    plate_paper_absorption(contents).map(|k| {
        let PlateOptics { reflectance, transmittance } = plate_paper_of_theta(three_piece_fit(k));
        PlateOptics { reflectance, transmittance: thickness * transmittance }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clear_leaf_has_the_printed_values() {
        let clear = plate_paper_of_theta(1.0);
        assert!((clear.reflectance - 0.3849).abs() < 1e-4 && (clear.transmittance - 0.4404).abs() < 1e-4);
        // With the fit's own theta(0) = 0.951.
        let albino = LeafContents {
            chlorophyll_ug_per_cm2: 0.0,
            carotenoid_ug_per_cm2: 0.0,
            dry_matter_g_per_cm2: 0.0,
            ..LeafContents::default()
        };
        for band in plate_paper(&albino, 1.0) {
            assert!((band.reflectance - 0.3387).abs() < 5e-5 && (band.transmittance - 0.4188).abs() < 5e-5, "{band:?}");
        }
    }

    #[test]
    fn the_print_is_followed_to_the_bit_its_slip_included() {
        let contents = LeafContents { brown: 0.25, structure: 2.0, ..LeafContents::default() };
        // 435 nm: 0.0716 * 40 + 0.168 * 8 + 0.4912 * 0.25 + 1.481 * 0.005, halved.
        let k = plate_paper_absorption(&contents);
        assert_eq!(k[2], (0.0716 * 40.0 + 0.168 * 8.0 + 0.4912 * 0.25 + 1.481 * 0.005) / 2.0);
        assert!((k[2] - 2.1691025).abs() < 1e-12);
        let theta = 0.743 * (-1.25 * k[2]).exp();
        let blue = plate_paper(&contents, 1.0)[2];
        assert_eq!(blue.reflectance, (0.031 + 0.240 * (theta * theta)) / (1.0 - 0.296 * (theta * theta)));
        assert_eq!(blue.transmittance, 0.44 * theta / (1.0 - 0.001 * (theta * theta)));
        // Water and anthocyanins are not in the print.
        let other = LeafContents { water_cm: 0.04, anthocyanin_ug_per_cm2: 15.0, ..contents };
        assert_eq!(plate_paper(&other, 1.0), plate_paper(&contents, 1.0));
    }

    #[test]
    fn the_prints_jumps_reach_its_colours_at_k_1_and_3() {
        let at = |k: f64| plate_paper_of_theta(three_piece_fit(k));
        for (k, jump) in [(1.0f64, 3.2e-3), (3.0, 3.2e-3)] {
            let (below, above) = (at(k.next_down()), at(k.next_up()));
            assert!((below.transmittance - above.transmittance - jump).abs() < 2e-4, "{below:?} {above:?}");
        }
    }

    #[test]
    fn the_algebra_gives_other_constants_than_eq_6_prints() {
        use crate::optics::interface::mean_interface_transmittance;
        let n2 = 1.42f64 * 1.42;
        let (ta, t90) = (mean_interface_transmittance(0.0, 1.42), mean_interface_transmittance(90.0, 1.42));
        let inner = (n2 - t90) / n2;
        for (derived, expected, printed) in [
            (1.0 - ta, 0.030121, 0.031),
            (t90 * ta * inner / n2, 0.240620, 0.240),
            (inner * inner, 0.295575, 0.296),
            (t90 * ta / n2, 0.442587, 0.44),
        ] {
            assert!((derived - expected).abs() < 1e-6, "{derived} {expected}");
            assert!((derived - printed).abs() < 3e-3 && (derived - printed).abs() > 1e-4, "rounded in print");
        }
        // In one fraction the second constant is 0.2317, off by far more than rounding.
        let joined: f64 = 0.240620 - 0.030121 * 0.295575;
        assert!((joined - 0.2317).abs() < 1e-4 && 0.240 - joined > 8e-3);
    }
}
