//! Transmission of diffuse light through an absorbing layer, theta(k) = 2 E3(k): exact, by a rational form, and as
//! printed. Twin of the last two: `leaf/theta.wgsl`.

/// Absorption above which the single-precision forms of theta are 0.
pub const MAX_ABSORPTION: f32 = 80.0;

/// Coefficient of k in the numerator of [`rational_theta`]; the numerator's k^2 has twice the last of [`THETA_Q`].
/// Fitted to the least largest error by `cargo run --release -p btf-tests -- leaf_fits`.
pub const THETA_P: f32 = 7.24335;
/// Coefficients of k, k^2 and k^3 in the denominator of [`rational_theta`], fitted together with [`THETA_P`].
pub const THETA_Q: [f32; 3] = [8.220058, 9.686885, 2.157772];

/// Returns `2 E3(k)` for `k >= 0`, 1 at 0 and falling to 0, with a relative error below 1e-12. For tables.
///
/// Source: power series and continued fraction of the exponential integrals [Abramowitz & Stegun 1964, 5.1.11, 5.1.22].
pub(crate) fn exact_theta(k: f64) -> f64 {
    const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;
    // Beyond it the series cancels, below it the fraction converges slowly.
    const SERIES_LIMIT: f64 = 1.0;
    const SERIES_TERMS: i32 = 20;
    const FRACTION_DEPTH: i32 = 80;
    if k <= 0.0 {
        return 1.0;
    }
    if k <= SERIES_LIMIT {
        let (mut e1, mut power) = (-EULER_GAMMA - k.ln(), 1.0);
        for j in 1..=SERIES_TERMS {
            power *= -k / f64::from(j);
            e1 -= power / f64::from(j);
        }
        return (1.0 - k) * (-k).exp() + k * k * e1;
    }
    // E3(k) = e^-k / (k + 3 / (1 + 1 / (k + 4 / (1 + 2 / (k + ...))))).
    let mut rest = k;
    for j in (1..=FRACTION_DEPTH).rev() {
        let j = f64::from(j);
        rest = k + (j + 2.0) / (1.0 + j / rest);
    }
    2.0 * (-k).exp() / rest
}

/// Returns theta as printed, in three pieces [Miao, after eq. 5]: 0.951 at 0, jumps at 1 and 3, never below 0.01.
pub fn three_piece_theta(k: f32) -> f32 {
    if k <= 1.0 {
        return 0.951 * (-1.463 * k).exp();
    }
    if k <= 3.0 {
        return 0.743 * (-1.25 * k).exp();
    }
    0.01
}

/// Returns theta by `e^-k P(k) / Q(k)`: 1 at 0, falling everywhere, largest error 7.7e-5.
pub fn rational_theta(k: f32) -> f32 {
    let k = k.min(MAX_ABSORPTION);
    let [q1, q2, q3] = THETA_Q;
    (-k).exp() * (1.0 + k * (THETA_P + k * 2.0 * q3)) / (1.0 + k * (q1 + k * (q2 + k * q3)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `2 E3(k)`, computed in extended precision outside of this project's code.
    const THETA: [(f64, f64); 9] = [
        (1e-8, 0.9999999800000019),
        (0.01, 0.9805531283693302),
        (0.1, 0.8325829158165576),
        (0.5, 0.4432087285503569),
        (1.0, 0.2193839343955204),
        (1.5, 0.11347898034070865),
        (3.0, 0.017861293112045453),
        (10.0, 7.097525106168764e-6),
        (100.0, 7.225454214045769e-46),
    ];

    #[test]
    fn the_exact_form_is_the_exponential_integral() {
        for (k, expected) in THETA {
            let relative = (exact_theta(k) - expected).abs() / expected;
            assert!(relative < 1e-12, "{k}: {relative:e}");
        }
        let (below, above) = (exact_theta(1.0), exact_theta(1.0f64.next_up()));
        assert!((below - above).abs() < 1e-14);
        assert_eq!((exact_theta(0.0), exact_theta(1e300)), (1.0, 0.0));
    }

    #[test]
    fn the_rational_form_is_as_near_as_promised_and_falls_everywhere() {
        let error = |k: f32| (f64::from(rational_theta(k)) - exact_theta(f64::from(k))).abs();
        let worst = (0..40_000).map(|i| error(14.0 * (i as f32 / 40_000.0).powi(2))).fold(0.0, f64::max);
        assert!((7.3e-5..7.7e-5).contains(&worst), "{worst:e}");
        let falls = (0..4000).all(|i| rational_theta(i as f32 * 0.005) > rational_theta((i + 1) as f32 * 0.005));
        assert!(falls && rational_theta(0.0) == 1.0);
        for k in [80.0, 1e3, 1e30, f32::MAX] {
            assert!((0.0..1e-30).contains(&rational_theta(k)), "{k}");
        }
        // Planted difference: the printed form is another function.
        let printed = |k: f32| (f64::from(three_piece_theta(k)) - exact_theta(f64::from(k))).abs();
        assert!(printed(0.0) > 0.04 && printed(0.5) > 1e-3);
    }
}
