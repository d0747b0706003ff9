//! Transmission of diffuse light through an absorbing layer, theta(k) = 2 E3(k): the exact value
//! and the forms that trade digits for time.
//!
//! | form | largest error for k >= 0 | source |
//! |---|---|---|
//! | [`ThetaForm::Exact`] | 1e-12 of the value | series and continued fraction |
//! | [`ThetaForm::Single`] | 3e-7 | fitted here, evaluated in single precision |
//! | [`ThetaForm::RationalP2Q3`] | 7.7e-5 | fitted here |
//! | [`ThetaForm::RationalP1Q2`] | 1.1e-3 | fitted here |
//! | [`ThetaForm::ThreePiece`] | 4.9e-2 | [Miao, the fit of eq. 5], as printed |
//!
//! The rational forms are `e^-k P(k) / Q(k)` with `P(0) = Q(0) = 1` and leading coefficients in the
//! ratio 2, so that theta(0) = 1 and the tail is `2 e^-k / k`, as they are in `2 E3(k)`; what is
//! left free was fitted to the least largest error over 0 <= k <= 14.
//!
//! When the three-piece fit is wrong: it gives 0.951 at k = 0 (a clear leaf loses light), jumps at
//! k = 1 (0.2202 to 0.2129) and k = 3 (0.0175 to 0.0100), which shows as contours in a smooth map of
//! pigment, and never falls below 0.01.

/// Euler's constant.
const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;

/// Absorption up to which the power series is used; beyond it cancellation costs digits, below it the continued
/// fraction converges slowly.
const SERIES_LIMIT: f64 = 2.0;

/// Number of terms of the series; at the limit the first one left out is below 1e-18.
const SERIES_TERMS: usize = 24;

/// Value below which a term no longer counts.
const SERIES_END: f64 = 1e-18;

/// Depth of the continued fraction times k. The fraction converges as exp(-4 sqrt(k depth)), and at this depth the
/// remainder is below 1e-14 of the value for every k beyond the series.
const FRACTION_DEPTH: f64 = 100.0;

/// Depth of the continued fraction that is added to that of [`FRACTION_DEPTH`].
const FRACTION_MIN_DEPTH: usize = 4;

/// Inverses 1 / j, because a division costs more than the rest of a term.
const INVERSES: [f64; SERIES_TERMS + 1] = {
    let mut inverses = [0.0; SERIES_TERMS + 1];
    let mut j = 1;
    while j <= SERIES_TERMS {
        inverses[j] = 1.0 / j as f64;
        j += 1;
    }
    inverses
};

/// Coefficients of k and k^2 in the denominator of the rational form P1/Q2.
const P1Q2: [f64; 2] = [2.333_055, 0.710_283];

/// Coefficient of k in the numerator of the rational form P2/Q3.
const P2: f64 = 7.243_35;

/// Coefficients of k, k^2 and k^3 in the denominator of the rational form P2/Q3.
const Q3: [f64; 3] = [8.220_059, 9.686_888, 2.157_773];

/// Absorption at which the single-precision form changes from its lower to its upper piece.
const SINGLE_LIMIT: f32 = 1.0;

/// Coefficients c_j of the piece up to [`SINGLE_LIMIT`], theta = 1 - 2k + k^2 (sum c_j k^j - ln k): the remainder after
/// the logarithm is smooth. Fitted to the smallest largest error, 1.1e-8 before rounding.
const SINGLE_LOW: [f32; 5] = [0.922_787_86, 0.333_296_85, -0.041_529_246, 0.005_312_009, -0.000_483_555];

/// Numerator a0, a1 of the piece beyond [`SINGLE_LIMIT`], theta = e^-k (2k^2 + a1 k + a0) / (k^3 + b2 k^2 + b1 k + b0).
/// Fitted to the smallest largest error, 2.8e-8 before rounding.
const SINGLE_HIGH_NUMERATOR: [f32; 2] = [6.263_321, 9.478_249];

/// Denominator b0, b1, b2 of the piece beyond [`SINGLE_LIMIT`].
const SINGLE_HIGH_DENOMINATOR: [f32; 3] = [6.347_897, 14.679_689, 7.722_814];

/// Absorption beyond which the single-precision form is 0, as is `e^-k` in single precision.
const SINGLE_END: f32 = 104.0;

/// Form in which theta(k) is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThetaForm {
    /// Form [`diffuse_transmission`].
    Exact,
    /// Form [`diffuse_transmission_f32`].
    Single,
    /// Form [`rational_p2q3`].
    RationalP2Q3,
    /// Form [`rational_p1q2`].
    RationalP1Q2,
    /// Form [`three_piece_fit`].
    ThreePiece,
}

impl ThetaForm {
    /// All forms, the most exact first.
    pub const ALL: [ThetaForm; 5] =
        [ThetaForm::Exact, ThetaForm::Single, ThetaForm::RationalP2Q3, ThetaForm::RationalP1Q2, ThetaForm::ThreePiece];

    /// Returns the name for tables and messages.
    pub fn name(self) -> &'static str {
        match self {
            ThetaForm::Exact => "exact 2 E3",
            ThetaForm::Single => "f32, two pieces",
            ThetaForm::RationalP2Q3 => "rational P2/Q3",
            ThetaForm::RationalP1Q2 => "rational P1/Q2",
            ThetaForm::ThreePiece => "three-piece fit",
        }
    }

    /// Returns theta for absorption `k >= 0`, 0 to 1.
    #[inline]
    pub fn at(self, k: f64) -> f64 {
        match self {
            ThetaForm::Exact => diffuse_transmission(k),
            ThetaForm::Single => f64::from(diffuse_transmission_f32(k as f32)),
            ThetaForm::RationalP2Q3 => rational_p2q3(k),
            ThetaForm::RationalP1Q2 => rational_p1q2(k),
            ThetaForm::ThreePiece => three_piece_fit(k),
        }
    }
}

/// Returns the transmission through an absorbing layer under diffuse light, `2 E3(k)` = `(1-k) e^-k + k^2 E1(k)`, for
/// absorption `k >= 0`: 1 at 0, falling to 0. Relative error below 1e-12.
///
/// Source: [Allen 1969]; series and continued fraction of the exponential integral
/// [Abramowitz & Stegun 1964, 5.1.11, 5.1.22].
pub fn diffuse_transmission(k: f64) -> f64 {
    diffuse_transmission_with_slope(k)[0]
}

/// Returns [`diffuse_transmission`] and its derivative by `k >= 0`, `-2 E2(k)`: -2 at 0, rising to 0. Relative error of
/// both below 1e-12.
///
/// Source: `E2(k) = e^-k - k E1(k)`, `2 E3(k) = e^-k - k E2(k)` [Abramowitz & Stegun 1964, 5.1.14].
pub fn diffuse_transmission_with_slope(k: f64) -> [f64; 2] {
    if k <= 0.0 {
        return [1.0, -2.0];
    }
    if k <= SERIES_LIMIT {
        // E1(k) = -gamma - ln k - sum_j (-k)^j / (j j!)
        let mut e1 = -EULER_GAMMA - k.ln();
        let mut power = 1.0;
        for j in 1..=SERIES_TERMS {
            let inverse = INVERSES[j];
            power *= -k * inverse;
            e1 -= power * inverse;
            if power.abs() < SERIES_END {
                break;
            }
        }
        let decay = (-k).exp();
        // k * k underflows to 0 before ln k becomes infinite, so the product is never NaN.
        return [(1.0 - k) * decay + k * k * e1, -2.0 * (decay - k * e1)];
    }
    let decay = (-k).exp();
    if decay == 0.0 {
        // Also keeps an infinite k out of the fraction.
        return [0.0, 0.0];
    }
    // E3 as a continued fraction, numerator and denominator by forward recurrence: no cancellation
    // for large k, and one division in all. The depth is set beforehand; neither overflows at it.
    const ORDER: f64 = 3.0;
    let depth = (FRACTION_DEPTH / k) as usize + FRACTION_MIN_DEPTH;
    let mut b = k + ORDER;
    let (mut numerator_before, mut numerator) = (0.0, 1.0);
    let (mut denominator_before, mut denominator) = (1.0, b);
    for i in 1..=depth {
        let i = i as f64;
        let a = -i * (ORDER - 1.0 + i);
        b += 2.0;
        (numerator_before, numerator) = (numerator, b * numerator + a * numerator_before);
        (denominator_before, denominator) = (denominator, b * denominator + a * denominator_before);
    }
    let share = 2.0 * numerator / denominator;
    [share * decay, -2.0 * (1.0 - share) / k * decay]
}

/// Returns [`diffuse_transmission`] in single precision, for `k >= 0`: absolute error below 3e-7, most of it rounding.
/// Costs one logarithm or one exponential.
pub fn diffuse_transmission_f32(k: f32) -> f32 {
    if k <= 0.0 {
        return 1.0;
    }
    if k <= SINGLE_LIMIT {
        let [c0, c1, c2, c3, c4] = SINGLE_LOW;
        let smooth = c0 + k * (c1 + k * (c2 + k * (c3 + k * c4)));
        return 1.0 - k * (2.0 - k * (smooth - k.ln()));
    }
    if k >= SINGLE_END {
        // Also keeps an infinite k out of the fraction.
        return 0.0;
    }
    let [a0, a1] = SINGLE_HIGH_NUMERATOR;
    let [b0, b1, b2] = SINGLE_HIGH_DENOMINATOR;
    (-k).exp() * (a0 + k * (a1 + k * 2.0)) / (b0 + k * (b1 + k * (b2 + k)))
}

/// Returns the rational approximation of [`diffuse_transmission`] with two fitted coefficients, for `k >= 0`: absolute
/// error at most 1.11e-3, falling with k, 1 at 0.
pub fn rational_p1q2(k: f64) -> f64 {
    let [b1, b2] = P1Q2;
    decayed(k, 1.0 + 2.0 * b2 * k, 1.0 + k * (b1 + k * b2))
}

/// Returns the rational approximation of [`diffuse_transmission`] with four fitted coefficients, for `k >= 0`: absolute
/// error at most 7.7e-5, falling with k, 1 at 0.
pub fn rational_p2q3(k: f64) -> f64 {
    let [b1, b2, b3] = Q3;
    decayed(k, 1.0 + k * (P2 + k * 2.0 * b3), 1.0 + k * (b1 + k * (b2 + k * b3)))
}

/// Returns `e^-k numerator / denominator`, 0 where the exponential is, so that no huge k gives inf / inf.
fn decayed(k: f64, numerator: f64, denominator: f64) -> f64 {
    let decay = (-k).exp();
    if decay == 0.0 { 0.0 } else { decay * numerator / denominator }
}

/// Returns the paper's fit of theta in three pieces, as printed [Miao, after eq. 5]: for reproducing the paper and for
/// measuring its error (see the notes of the module), not for use.
pub fn three_piece_fit(k: f64) -> f64 {
    if k <= 1.0 {
        0.951 * (-1.463 * k).exp()
    } else if k <= 3.0 {
        0.743 * (-1.25 * k).exp()
    } else {
        0.01
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `2 E3(k)` computed in extended precision outside this project's code.
    const THETA: [(f64, f64); 22] = [
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
        (2.015625, 0.059105666972683024),
        (2.5, 0.03259073875333765),
        (100.0, 7.225454214045769e-46),
        (700.0, 2.805045868149276e-307),
    ];

    #[test]
    fn diffuse_transmission_agrees_with_the_table_to_1e_12() {
        for (k, expected) in THETA {
            let relative = (diffuse_transmission(k) - expected).abs() / expected;
            assert!(relative < 1e-12, "k {k}: {relative:e}");
        }
        // Planted difference: the published three-piece fit is another function.
        assert!((three_piece_fit(0.5) - diffuse_transmission(0.5)).abs() > 1e-3);
    }

    #[test]
    fn the_slope_is_that_of_the_value_and_has_the_tables_values() {
        // E2 at 0.5, 1, 2 and 10 [Abramowitz & Stegun 1964, Table 5.4, 5.5].
        for (k, e2) in [(0.5, 0.3266439), (1.0, 0.1484955), (2.0, 0.0375343), (10.0, 3.8302405e-6)] {
            let [_, slope] = diffuse_transmission_with_slope(k);
            assert!((slope / (-2.0 * e2) - 1.0).abs() < 2e-6, "{k}: {slope}");
        }
        for k in [1e-6, 1e-3, 0.1, 0.7, 1.999, 2.001, 5.0, 20.0, 80.0] {
            let [value, slope] = diffuse_transmission_with_slope(k);
            assert_eq!(value, diffuse_transmission(k));
            let step = 1e-4 * k.min(1.0);
            let across = (diffuse_transmission(k + step) - diffuse_transmission(k - step)) / (2.0 * step);
            assert!((slope / across - 1.0).abs() < 1e-5, "{k}: {slope} {across}");
        }
        let [below, above] = [2.0, 2.0f64.next_up()].map(|k| diffuse_transmission_with_slope(k)[1]);
        assert!((below / above - 1.0).abs() < 1e-12, "{below} {above}");
        for (k, slope) in [(0.0, -2.0), (1e-300, -2.0), (1e300, 0.0), (f64::INFINITY, 0.0)] {
            assert_eq!(diffuse_transmission_with_slope(k)[1], slope, "{k}");
        }
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
    fn the_single_precision_form_agrees_with_the_table_to_1e_6() {
        let error = |k: f64| (f64::from(diffuse_transmission_f32(k as f32)) - diffuse_transmission(k)).abs();
        for (k, expected) in THETA {
            assert!((f64::from(diffuse_transmission_f32(k as f32)) - expected).abs() < 1e-6, "k {k}");
        }
        let worst = (0..120_000).map(|i| error(f64::from(f32::from_bits(0x3000_0000 + i * 3000)))).fold(0.0, f64::max);
        assert!(worst < 3e-7, "{worst:e}");
        let (below, above) = (SINGLE_LIMIT, SINGLE_LIMIT.next_up());
        assert!((diffuse_transmission_f32(below) - diffuse_transmission_f32(above)).abs() < 3e-7);
        for k in [0.0, -0.0, 1e-38, f32::from_bits(1)] {
            assert_eq!(diffuse_transmission_f32(k), 1.0, "{k:e}");
        }
        for k in [103.9, 104.0, 1e30, f32::INFINITY] {
            let value = diffuse_transmission_f32(k);
            assert!((0.0..1e-40).contains(&value), "{k}: {value:e}");
        }
    }

    /// Returns the largest and mean error of a form over `0 <= k <= end`, dense near 0.
    fn errors(form: ThetaForm, end: f64) -> (f64, f64) {
        let count = 20_000;
        let error = |k: f64| (form.at(k) - diffuse_transmission(k)).abs();
        let (mut worst, mut sum) = (0f64, 0.0);
        for i in 0..=count {
            let u = f64::from(i) / f64::from(count);
            worst = worst.max(error(end * u)).max(error(end * u.powi(4)));
            sum += error(end * u);
        }
        (worst, sum / f64::from(count + 1))
    }

    #[test]
    fn the_rational_forms_are_as_near_as_promised_and_fall_everywhere() {
        for (form, promised) in [(ThetaForm::RationalP1Q2, 1.11e-3), (ThetaForm::RationalP2Q3, 7.7e-5)] {
            let (worst, mean) = errors(form, 14.0);
            assert!(worst < promised && worst > 0.95 * promised && mean < 0.3 * promised, "{worst:e} {mean:e}");
            assert_eq!(form.at(0.0), 1.0);
            let mut last = 1.0;
            for i in 1..=100_000 {
                let value = form.at(f64::from(i) * 2e-4);
                assert!(value < last && value > 0.0, "{form:?} {i}");
                last = value;
            }
            // The tail: 2 e^-k / k.
            assert!((form.at(300.0) / diffuse_transmission(300.0) - 1.0).abs() < 0.02);
        }
    }

    #[test]
    fn every_form_is_finite_at_every_extreme() {
        for form in ThetaForm::ALL {
            for k in [0.0, f64::from_bits(1), 1e-300, 1e-8, 1.0, 3.0, 100.0, 1000.0, 1e300, f64::INFINITY] {
                let value = form.at(k);
                assert!((0.0..=1.0).contains(&value), "{form:?} {k:e}: {value}");
            }
        }
    }

    #[test]
    fn the_three_piece_fit_jumps_where_and_as_much_as_the_print_does() {
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 6e-6, "{value} {expected}");
        near(three_piece_fit(0.0), 0.951);
        near(three_piece_fit(1.0f64.next_down()), 0.22020);
        near(three_piece_fit(1.0), 0.22020);
        near(three_piece_fit(1.0f64.next_up()), 0.21287);
        near(three_piece_fit(3.0f64.next_down()), 0.01747);
        near(three_piece_fit(3.0), 0.01747);
        assert_eq!(three_piece_fit(3.0f64.next_up()), 0.01);
        assert_eq!(three_piece_fit(1000.0), 0.01);
        // The exact function has no jump there.
        for k in [1.0f64, 3.0] {
            assert!((diffuse_transmission(k.next_down()) - diffuse_transmission(k.next_up())).abs() < 1e-14);
        }
    }

    #[test]
    fn the_three_piece_fit_is_as_wrong_as_was_measured() {
        let (worst, mean) = errors(ThetaForm::ThreePiece, 10.0);
        assert!((worst - 0.0490).abs() < 5e-5 && (mean - 0.0071).abs() < 1e-4, "{worst} {mean}");
        let (worst, mean) = errors(ThetaForm::ThreePiece, 1.0);
        assert!((worst - 0.0490).abs() < 5e-5 && (mean - 0.0110).abs() < 1e-4, "{worst} {mean}");
    }
}
