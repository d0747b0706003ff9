//! theta(k) and its derivative from a table, for fits that ask for them by the million.
//!
//! Nodes are even in the root of k, in which both are smooth: near 0 they hold `k^2 ln k` and `k ln k`. Between nodes a
//! cubic meets values and derivatives [Hermite]. Errors, which a test measures: below 2e-9 of theta, 2e-5 of the derivative.

use std::sync::LazyLock;

use crate::optics::plates::theta::diffuse_transmission_with_slope;

/// Nodes per unit of the root of k.
const PER_UNIT: f64 = 128.0;
/// Root of k up to which the table goes; beyond, theta is below 1e-28.
const MAX_ROOT: f64 = 8.0;
/// Number of intervals of the table.
const INTERVALS: usize = (PER_UNIT * MAX_ROOT) as usize;

/// Theta and its derivative by k, each with its derivative by the root of k over a node's distance.
static NODES: LazyLock<Vec<[f64; 4]>> = LazyLock::new(|| {
    let node = |i: usize| {
        let root = i as f64 / PER_UNIT;
        let k = root * root;
        let [theta, slope] = diffuse_transmission_with_slope(k);
        // The second derivative is 2 E1(k) = 2 (e^-k - E2) / k, and the root's own derivative is 2 root.
        let bend = if k > 0.0 { 2.0 * ((-k).exp() + 0.5 * slope) / k } else { 0.0 };
        [theta, slope * 2.0 * root / PER_UNIT, slope, bend * 2.0 * root / PER_UNIT]
    };
    (0..=INTERVALS).map(node).collect()
});

/// Returns `2 E3(k)` and its derivative by `k >= 0`.
#[inline]
pub(crate) fn theta_with_slope(k: f64) -> [f64; 2] {
    let place = k.sqrt() * PER_UNIT;
    let node = place as usize;
    // Not `<` of the place, so that a NaN and infinity take the exact way.
    if node >= INTERVALS || !place.is_finite() {
        return diffuse_transmission_with_slope(k);
    }
    let u = place - node as f64;
    let ([y0, d0, s0, e0], [y1, d1, s1, e1]) = (NODES[node], NODES[node + 1]);
    [cubic(u, [y0, d0, y1, d1]), cubic(u, [s0, e0, s1, e1])]
}

/// Returns Hermite's cubic at `u`, 0 to 1, between values and derivatives at both ends.
#[inline]
fn cubic(u: f64, [y0, d0, y1, d1]: [f64; 4]) -> f64 {
    let rise = y1 - y0;
    y0 + u * (d0 + u * ((3.0 * rise - 2.0 * d0 - d1) + u * (d0 + d1 - 2.0 * rise)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_as_near_as_promised_everywhere() {
        let mut worst = [0.0f64; 2];
        for i in 0..200_000 {
            let k = 70.0 * (f64::from(i) / 200_000.0).powi(4);
            let (table, exact) = (theta_with_slope(k), diffuse_transmission_with_slope(k));
            for (worst, (table, exact)) in worst.iter_mut().zip(table.iter().zip(exact)) {
                *worst = worst.max((table - exact).abs());
            }
        }
        assert!(worst[0] < 2e-9 && worst[1] < 2e-5, "{worst:?}");
        // Planted difference: half a node away is another value.
        assert!((theta_with_slope(0.01)[0] - diffuse_transmission_with_slope(0.0104)[0]).abs() > 2e-6);
        assert_eq!(theta_with_slope(0.0), [1.0, -2.0]);
        for k in [64.0, 1e4, 1e300, f64::INFINITY] {
            assert_eq!(theta_with_slope(k), diffuse_transmission_with_slope(k), "{k}");
        }
    }
}
