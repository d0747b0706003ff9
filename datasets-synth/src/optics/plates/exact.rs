//! `plate-exact`: a leaf as one absorbing plate with rough faces [Allen 1969; Miao, eq. 3-5].
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | absorption k = sum K C / N | - | from the contents | 0 up |
//! | index n | - | PROSPECT-5, spectral | 1 to 1.6 |
//! | half-angle of the cone of incident light, alpha | degree | 0 | 0 to 90 |
//!
//! With `th = 2 E3(k)`, `t_a = t_av(alpha, n)`, `t_90 = t_av(90, n)`:
//!
//! `rho = (1 - t_a) + t_90 t_a th^2 (n^2 - t_90) / (n^4 - th^2 (n^2 - t_90)^2)`,
//! `tau = t_90 t_a th n^2 / (n^4 - th^2 (n^2 - t_90)^2)` [Miao, eq. 3-4].
//!
//! Differs from the paper in: theta is the exact `2 E3(k)` instead of a three-piece fit, the two
//! misprinted constants of its eq. 6 are not used, and the index is spectral. In this form the
//! paper's Table 1 is reproduced; in the printed form it is not.
//!
//! When it is wrong: N only divides the contents, the plate is not layered, so transmittance is too high where absorption is
//! strong; the N-layer model is nearer to measured leaves.

use crate::optics::interface::{DiffuseFaces, mean_interface_transmittance};
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::theta::diffuse_transmission;

/// Returns reflectance and transmittance of a plate of absorption `k >= 0` and index `index`, lit over a cone of
/// half-angle `cone_deg` [Miao, eq. 3-4].
pub fn plate(k: f64, index: f64, cone_deg: f64) -> PlateOptics {
    let inside = plate_inside(k, index);
    let entering = mean_interface_transmittance(cone_deg, index);
    PlateOptics {
        reflectance: (1.0 - entering) + entering * inside.reflectance,
        transmittance: entering * inside.transmittance,
    }
}

/// Returns the shares of the light that has *entered* the plate through its first surface: what leaves again in front,
/// and what leaves behind. They do not depend on the direction of the light, so they couple to a specular lobe that
/// says how much enters. At `k = 0` the two add up to 1.
pub fn plate_inside(k: f64, index: f64) -> PlateOptics {
    plate_inside_of(diffuse_transmission(k), DiffuseFaces::new(index))
}

/// Evaluates [`plate_inside`] from `theta = 2 E3(k)`, which depends on the pigments, and from the faces, which do not.
///
/// The expressions are eq. 3-4 divided by `n^4`: every crossing of the plate costs theta, every meeting with a face
/// either [`DiffuseFaces::exit`] or [`DiffuseFaces::inner_reflectance`].
#[inline]
pub(crate) fn plate_inside_of(theta: f64, faces: DiffuseFaces) -> PlateOptics {
    let back = theta * faces.inner_reflectance();
    let out_behind = theta * faces.exit / (1.0 - back * back);
    PlateOptics { reflectance: back * out_behind, transmittance: out_behind }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Table 1 of the paper: contents inferred by least squares, conditions N = 1.5, no brown pigment
    // or dry matter, normal incidence, PROSPECT-5 index. Specific absorptions as printed, with the
    // table's 0.1682 for the paper's 0.168.
    const INDEX: [f64; 3] = [1.4830, 1.4310, 1.5267];
    const CHLOROPHYLL: [f64; 3] = [0.05914, 0.01221, 0.0716];
    const CAROTENOID: [f64; 3] = [0.0, 0.0073, 0.1682];
    // Chlorophyll and carotenoids in ug/cm2.
    const SAMPLES: [(f64, f64); 4] = [(31.683, 10.573), (59.204, 7.284), (0.0, 9.081), (11.622, 3.167)];
    // Published reflectance and transmittance, R, G, B each.
    const TABLE_1: [[f64; 6]; 4] = [
        [0.0437, 0.1252, 0.0436, 0.0632, 0.2875, 0.0095],
        [0.0382, 0.0788, 0.0435, 0.0159, 0.1990, 0.0031],
        [0.3933, 0.3041, 0.0540, 0.6067, 0.5378, 0.0808],
        [0.0940, 0.2329, 0.0578, 0.2034, 0.4464, 0.0942],
    ];

    fn table_1_row(sample: usize, index: [f64; 3], cone_deg: f64) -> [f64; 6] {
        let (chlorophyll, carotenoid) = SAMPLES[sample];
        let bands: [PlateOptics; 3] = std::array::from_fn(|band| {
            let k = (CHLOROPHYLL[band] * chlorophyll + CAROTENOID[band] * carotenoid) / 1.5;
            plate(k, index[band], cone_deg)
        });
        std::array::from_fn(|i| if i < 3 { bands[i].reflectance } else { bands[i - 3].transmittance })
    }

    #[test]
    fn table_1_of_miao_is_reproduced_in_all_24_numbers() {
        let worst = |index: [f64; 3], cone: f64| {
            let apart = |sample: usize| {
                let row = table_1_row(sample, index, cone);
                (0..6).map(|i| (row[i] - TABLE_1[sample][i]).abs()).fold(0.0, f64::max)
            };
            (0..4).map(apart).fold(0.0, f64::max)
        };
        assert!(worst(INDEX, 0.0) < 5e-5, "{:e}", worst(INDEX, 0.0));
        // Planted differences: the index that the paper's text states, and another cone.
        assert!(worst([1.42; 3], 0.0) > 1e-2);
        assert!(worst(INDEX, 40.0) > 5e-5);
    }

    #[test]
    fn table_1_is_out_of_reach_of_the_printed_equations() {
        use crate::optics::plates::paper::plate_paper_of_theta;
        use crate::optics::plates::theta::three_piece_fit;
        // Whatever the samples held: the nearest that printed eq. 6 can come to the first one's green.
        let nearest = (0..5000)
            .map(|i| plate_paper_of_theta(three_piece_fit(f64::from(i) * 1e-3)))
            .map(|x| (x.reflectance - 0.1252).abs().max((x.transmittance - 0.2875).abs()))
            .fold(1.0, f64::min);
        assert!(nearest > 0.01, "{nearest}");
        // And to the clear red of the third: no theta transmits more than 0.44.
        assert!(0.6067 - plate_paper_of_theta(1.0).transmittance > 0.16);
    }

    /// The paper's Table 2, the absolute differences between Table 1's simulated and real columns:
    /// 22 of its 24 numbers follow from Table 1, two are misprints.
    #[test]
    fn table_2_of_miao_is_recomputed_and_its_two_misprints_are_named() {
        const REAL: [[f64; 6]; 4] = [
            [0.0627, 0.1137, 0.0000, 0.0106, 0.1961, 0.0156],
            [0.0745, 0.1255, 0.0078, 0.0627, 0.1373, 0.0039],
            [0.4117, 0.3490, 0.0510, 0.5255, 0.4863, 0.0352],
            [0.1059, 0.1961, 0.0311, 0.1686, 0.2980, 0.0274],
        ];
        const PUBLISHED: [[f64; 6]; 4] = [
            [0.019, 0.015, 0.0436, 0.0526, 0.0914, 0.0061],
            [0.0363, 0.0467, 0.0357, 0.0468, 0.0617, 0.0008],
            [0.0184, 0.0450, 0.0030, 0.0812, 0.0515, 0.0456],
            [0.0119, 0.0368, 0.0267, 0.0348, 0.1484, 0.0668],
        ];
        let mut misprints = Vec::new();
        for sample in 0..4 {
            let simulated = table_1_row(sample, INDEX, 0.0);
            for column in 0..6 {
                let difference = ((simulated[column] * 1e4).round() / 1e4 - REAL[sample][column]).abs();
                if (difference - PUBLISHED[sample][column]).abs() > 5e-5 {
                    misprints.push((sample + 1, ["R", "G", "B", "R'", "G'", "B'"][column], difference));
                }
            }
        }
        let named: Vec<(usize, &str)> = misprints.iter().map(|&(sample, column, _)| (sample, column)).collect();
        assert_eq!(named, [(1, "G"), (3, "G")], "{misprints:?}");
        assert!((misprints[0].2 - 0.0115).abs() < 1e-6 && (misprints[1].2 - 0.0449).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_lost_without_absorption_and_nothing_gained_with_it() {
        for index in [1.0, 1.3, 1.42, 1.6] {
            for cone in [0.0, 1e-3, 40.0, 90.0] {
                for k in [0.0, 1e-300] {
                    let clear = plate(k, index, cone);
                    assert!((clear.reflectance + clear.transmittance - 1.0).abs() < 1e-12, "{index} {cone}");
                }
                for k in [1e-8, 0.1, 1.0, 10.0, 100.0, 1000.0] {
                    let optics = plate(k, index, cone);
                    assert!(optics.reflectance >= 0.0 && optics.transmittance >= 0.0);
                    assert!(optics.reflectance + optics.transmittance <= 1.0 + 1e-12);
                }
                let black = plate(1000.0, index, cone);
                let surface = 1.0 - mean_interface_transmittance(cone, index);
                assert!((black.reflectance - surface).abs() < 1e-12 && black.transmittance == 0.0);
            }
        }
    }
}
