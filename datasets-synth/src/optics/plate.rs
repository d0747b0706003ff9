//! `plate-exact`: a leaf as one absorbing plate with rough faces [Allen 1969; Miao, eq. 3-5].
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | chlorophyll a + b | ug/cm2 | 40 | 0 to 100 |
//! | carotenoids | ug/cm2 | 8 | 0 to 25 |
//! | brown pigment | arbitrary | 0 | 0 to 1 |
//! | water | cm | 0.01 | 0 to 0.04 |
//! | dry matter | g/cm2 | 0.005 | 0 to 0.02 |
//! | structure N | - | 1.5 | 1 to 3 |
//!
//! Differs from the paper in: theta is the exact `2 E3(k)` instead of a three-piece fit, the two
//! misprinted constants of its eq. 6 are not used, and the index is spectral.
//!
//! When it is wrong: N only divides the contents (`k = sum K C / N`), the plate is not layered, so
//! transmittance is too high where absorption is strong (against 60 measured green leaves, 400 to
//! 700 nm, the median RMSE is 0.022 in reflectance and 0.011 in transmittance, where the N-layer
//! model reaches 0.005 and 0.008).

/// Euler's constant.
const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;

/// Up to this absorption the power series is used: beyond it cancellation eats digits, below it the
/// continued fraction converges slowly.
const SERIES_LIMIT: f64 = 2.0;

/// Terms of the series: at the limit the first one left out is below 1e-18.
const SERIES_TERMS: usize = 24;

/// 1 / j; a division costs more than the rest of a term.
const INVERSES: [f64; SERIES_TERMS + 1] = {
    let mut inverses = [0.0; SERIES_TERMS + 1];
    let mut j = 1;
    while j <= SERIES_TERMS {
        inverses[j] = 1.0 / j as f64;
        j += 1;
    }
    inverses
};

/// Below this half-angle the mean over the cone equals normal incidence to 1e-11, while the closed
/// form loses digits to cancellation.
const MIN_CONE_DEG: f64 = 0.1;

/// Indices nearer to 1 than this are taken as no interface at all.
const MIN_INDEX_STEP: f64 = 1e-9;

/// Share of incident light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateOptics {
    /// Reflected, the first surface's part included.
    pub reflectance: f64,
    /// Transmitted.
    pub transmittance: f64,
}

/// Transmission through an absorbing layer under diffuse light, `2 E3(k)` = `(1-k) e^-k +
/// k^2 E1(k)`, for absorption `k >= 0`: 1 at 0, falling to 0. Relative error below 1e-12.
///
/// Source: [Allen 1969]; series and continued fraction of the exponential integral
/// [Abramowitz & Stegun 1964, 5.1.11, 5.1.22].
pub fn diffuse_transmission(k: f64) -> f64 {
    if k <= 0.0 {
        return 1.0;
    }
    if k <= SERIES_LIMIT {
        // E1(k) = -gamma - ln k - sum_j (-k)^j / (j j!)
        let mut e1 = -EULER_GAMMA - k.ln();
        let mut power = 1.0;
        for j in 1..=SERIES_TERMS {
            let inverse = INVERSES[j];
            power *= -k * inverse;
            e1 -= power * inverse;
        }
        // k * k underflows to 0 before ln k becomes infinite, so the product is never NaN.
        return (1.0 - k) * (-k).exp() + k * k * e1;
    }
    let decay = (-k).exp();
    if decay == 0.0 {
        // Also keeps an infinite k out of the fraction.
        return 0.0;
    }
    // E3 by the modified Lentz method on its continued fraction: no cancellation for large k.
    const ORDER: f64 = 3.0;
    let mut b = k + ORDER;
    let mut c = f64::MAX;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for i in 1..200 {
        let i = f64::from(i);
        let a = -i * (ORDER - 1.0 + i);
        b += 2.0;
        d = 1.0 / (a * d + b);
        c = b + a / c;
        let factor = c * d;
        fraction *= factor;
        if (factor - 1.0).abs() < 1e-16 {
            break;
        }
    }
    2.0 * fraction * decay
}

/// Mean transmittance of the interface between air and a medium of index `index` (>= 1) for light
/// that fills a cone of half-angle `cone_deg` (0 to 90 degrees) about the normal, `t_av(alpha, n)`
/// [Stern 1964; Allen 1973, closed form].
pub fn mean_interface_transmittance(cone_deg: f64, index: f64) -> f64 {
    let n = index;
    if n - 1.0 < MIN_INDEX_STEP {
        return 1.0;
    }
    if cone_deg < MIN_CONE_DEG {
        return 4.0 * n / ((n + 1.0) * (n + 1.0));
    }
    let n2 = n * n;
    let np = n2 + 1.0;
    let nm = n2 - 1.0;
    let a = (n + 1.0) * (n + 1.0) / 2.0;
    let k = -nm * nm / 4.0;
    let sin2 = cone_deg.to_radians().sin().powi(2);
    let b2 = sin2 - np / 2.0;
    // At 90 degrees the root is exactly 0; rounding may push it below.
    let b1 = (b2 * b2 + k).max(0.0).sqrt();
    let b = b1 - b2;
    let s_part = |x: f64| k * k / (6.0 * x.powi(3)) + k / x - x / 2.0;
    let perpendicular = s_part(b) - s_part(a);
    let shifted = |x: f64| 2.0 * np * x - nm * nm;
    let parallel = -2.0 * n2 * (b - a) / (np * np) - 2.0 * n2 * np * (b / a).ln() / (nm * nm)
        + n2 * (1.0 / b - 1.0 / a) / 2.0
        + 16.0 * n2 * n2 * (n2 * n2 + 1.0) * (shifted(b) / shifted(a)).ln() / (np.powi(3) * nm * nm)
        + 16.0 * n2.powi(3) * (1.0 / shifted(b) - 1.0 / shifted(a)) / np.powi(3);
    (perpendicular + parallel) / (2.0 * sin2)
}

/// Reflectance and transmittance of a plate of absorption `k >= 0` and index `index`, lit over a
/// cone of half-angle `cone_deg` [Miao, eq. 3-4].
pub fn plate(k: f64, index: f64, cone_deg: f64) -> PlateOptics {
    let inside = plate_inside(k, index);
    let entering = mean_interface_transmittance(cone_deg, index);
    PlateOptics {
        reflectance: (1.0 - entering) + entering * inside.reflectance,
        transmittance: entering * inside.transmittance,
    }
}

/// Shares of the light that has *entered* the plate through its first surface: what leaves again
/// in front, and what leaves behind. Independent of how the light fell in, so it couples to a
/// gloss lobe that says how much enters. At `k = 0` the two add up to 1.
pub fn plate_inside(k: f64, index: f64) -> PlateOptics {
    plate_inside_of(diffuse_transmission(k), index, mean_interface_transmittance(90.0, index))
}

/// [`plate_inside`] of what depends on the pigments, `theta = 2 E3(k)`, and what does not, the
/// interface's mean transmittance `t90` for diffuse light.
pub(crate) fn plate_inside_of(theta: f64, index: f64, t90: f64) -> PlateOptics {
    let n2 = index * index;
    let inner = n2 - t90;
    let denominator = n2 * n2 - (theta * inner).powi(2);
    PlateOptics {
        reflectance: t90 * theta * theta * inner / denominator,
        transmittance: t90 * theta * n2 / denominator,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `2 E3(k)` computed in extended precision outside this project's code.
    const THETA: [(f64, f64); 18] = [
        (0.0, 1.0),
        (1e-8, 0.9999999800000019),
        (1e-4, 0.9998001013315804),
        (1e-3, 0.9980078308729058),
        (0.01, 0.9805531283693302),
        (0.05, 0.9098376994969534),
        (0.1, 0.8325829158165576),
        (0.2, 0.7038906242297411),
        (0.5, 0.4432087285503569),
        (1.0, 0.2193839343955204),
        (1.5, 0.11347898034070865),
        (2.0, 0.06026675959563182),
        (3.0, 0.017861293112045453),
        (4.0, 0.005522721891379964),
        (5.0, 0.0017556017855412775),
        (7.0, 0.00018731305557947528),
        (10.0, 7.097525106168764e-6),
        (20.0, 1.8018233626692803e-10),
    ];

    #[test]
    fn diffuse_transmission_agrees_with_the_table_to_1e_12() {
        for (k, expected) in THETA {
            let relative = (diffuse_transmission(k) - expected).abs() / expected;
            assert!(relative < 1e-12, "k {k}: {relative:e}");
        }
        // Planted difference: the published three-piece fit is another function.
        let fit = 0.951 * (-1.463f64 * 0.5).exp();
        assert!((fit - diffuse_transmission(0.5)).abs() > 1e-3);
    }

    #[test]
    fn diffuse_transmission_is_continuous_monotone_and_finite_at_the_extremes() {
        assert_eq!(diffuse_transmission(1e-300), 1.0);
        assert_eq!(diffuse_transmission(f64::MIN_POSITIVE / 1e10), 1.0);
        let (below, above) = (diffuse_transmission(SERIES_LIMIT), diffuse_transmission(SERIES_LIMIT.next_up()));
        assert!((below - above).abs() < 1e-14, "where series and fraction meet");
        let hundred = diffuse_transmission(100.0);
        assert!(hundred > 0.0 && hundred < 1e-40, "{hundred:e}");
        for k in [1000.0, 1e300, f64::INFINITY] {
            assert_eq!(diffuse_transmission(k), 0.0, "{k}");
        }
        let mut last = 1.0;
        for i in 1..3000 {
            let value = diffuse_transmission(f64::from(i) * 0.01);
            assert!(value < last && value > 0.0);
            last = value;
        }
    }

    #[test]
    fn mean_interface_transmittance_agrees_with_the_published_closed_form() {
        for (cone, index, expected) in [
            (0.0, 1.33, 0.9799406878004752),
            (0.0, 1.42, 0.9698791066184004),
            (0.0, 1.45, 0.9662640566430651),
            (0.0, 1.5, 0.96),
            (0.0, 1.6, 0.9467455621301775),
            (40.0, 1.33, 0.9788357088780981),
            (40.0, 1.42, 0.9684958520522525),
            (40.0, 1.45, 0.9648025308928443),
            (40.0, 1.5, 0.9584240357068678),
            (40.0, 1.6, 0.9449975551072355),
            (59.0, 1.33, 0.9729803557687204),
            (59.0, 1.42, 0.961525999297885),
            (59.0, 1.45, 0.9575401498174361),
            (59.0, 1.5, 0.9507532833229858),
            (59.0, 1.6, 0.9367711544498675),
            (90.0, 1.33, 0.9340691507005985),
            (90.0, 1.42, 0.920147257806706),
            (90.0, 1.45, 0.9156330408147857),
            (90.0, 1.5, 0.9082220406576504),
            (90.0, 1.6, 0.8937544321611375),
        ] {
            let value = mean_interface_transmittance(cone, index);
            assert!((value - expected).abs() < 1e-9, "{cone} {index}: {value}");
        }
        let tiny = mean_interface_transmittance(1e-3, 1.42);
        assert!((tiny - mean_interface_transmittance(0.0, 1.42)).abs() < 1e-9);
        // No jump where the closed form takes over.
        let (below, above) = (0.1f64.next_down(), 0.1);
        let jump = mean_interface_transmittance(below, 1.42) - mean_interface_transmittance(above, 1.42);
        assert!(jump.abs() < 1e-8, "{jump:e}");
        assert_eq!(mean_interface_transmittance(40.0, 1.0), 1.0);
    }

    #[test]
    fn mean_interface_transmittance_is_the_cosine_weighted_mean_of_fresnel() {
        use crate::optics::fresnel::fresnel;
        // Midpoint rule over sin^2, which carries the cosine weight.
        let count = 20_000;
        for cone in [40.0f64, 90.0] {
            let limit = cone.to_radians().sin().powi(2);
            let mean: f64 = (0..count)
                .map(|i| 1.0 - fresnel(1.42, (1.0 - limit * (f64::from(i) + 0.5) / f64::from(count)).sqrt()))
                .sum::<f64>()
                / f64::from(count);
            assert!((mean - mean_interface_transmittance(cone, 1.42)).abs() < 1e-5, "{cone}: {mean}");
        }
    }

    /// Table 1 of the paper: contents inferred by least squares, conditions N = 1.5, no brown
    /// pigment or dry matter, normal incidence, PROSPECT-5 index at its three wavelengths.
    #[test]
    fn table_1_of_miao_is_reproduced_in_all_24_numbers() {
        const INDEX: [f64; 3] = [1.4830, 1.4310, 1.5267];
        const CHLOROPHYLL: [f64; 3] = [0.05914, 0.01221, 0.0716];
        const CAROTENOID: [f64; 3] = [0.0, 0.0073, 0.1682];
        // Chlorophyll, carotenoids (ug/cm2), published reflectance and transmittance R, G, B.
        const ROWS: [(f64, f64, [f64; 3], [f64; 3]); 4] = [
            (31.683, 10.573, [0.0437, 0.1252, 0.0436], [0.0632, 0.2875, 0.0095]),
            (59.204, 7.284, [0.0382, 0.0788, 0.0435], [0.0159, 0.1990, 0.0031]),
            (0.0, 9.081, [0.3933, 0.3041, 0.0540], [0.6067, 0.5378, 0.0808]),
            (11.622, 3.167, [0.0940, 0.2329, 0.0578], [0.2034, 0.4464, 0.0942]),
        ];
        let worst = |index: [f64; 3], cone: f64| {
            let mut worst = 0f64;
            for (chlorophyll, carotenoid, reflectance, transmittance) in ROWS {
                for band in 0..3 {
                    let k = (CHLOROPHYLL[band] * chlorophyll + CAROTENOID[band] * carotenoid) / 1.5;
                    let optics = plate(k, index[band], cone);
                    worst = worst
                        .max((optics.reflectance - reflectance[band]).abs())
                        .max((optics.transmittance - transmittance[band]).abs());
                }
            }
            worst
        };
        assert!(worst(INDEX, 0.0) < 5e-5, "{:e}", worst(INDEX, 0.0));
        // Planted differences: the index that the paper's text states, and another cone.
        assert!(worst([1.42; 3], 0.0) > 1e-2);
        assert!(worst(INDEX, 40.0) > 5e-5);
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
