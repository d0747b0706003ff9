//! Interface between air and leaf material under light that fills a cone, and its two faces under diffuse light.

/// Half-angle in degrees below which the mean over the cone equals normal incidence to 1e-11, while the closed form
/// loses digits to cancellation.
const MIN_CONE_DEG: f64 = 0.1;

/// Distance of an index from 1 below which there is no interface at all.
const MIN_INDEX_STEP: f64 = 1e-9;

/// Returns the mean transmittance of the interface between air and a medium of index `index` (>= 1) for light that
/// fills a cone of half-angle `cone_deg` (0 to 90 degrees) about the normal, `t_av(alpha, n)` [Stern 1964; Allen 1973,
/// closed form].
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

/// Diffuse transmittances of the interface of a plate from either side: all that the optics of a plate need of its
/// index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DiffuseFaces {
    /// Transmittance from the air, `t_av(90, n)`.
    pub(crate) entry: f64,
    /// Transmittance from inside, `t_av(90, n) / n^2` [Stern 1964]. The rest is reflected, most of it totally.
    pub(crate) exit: f64,
}

impl DiffuseFaces {
    /// Returns the interface of a medium of index `index` (>= 1).
    pub(crate) fn new(index: f64) -> DiffuseFaces {
        let entry = mean_interface_transmittance(90.0, index);
        DiffuseFaces { entry, exit: entry / (index * index) }
    }

    /// Returns the reflectance from inside.
    pub(crate) fn inner_reflectance(self) -> f64 {
        1.0 - self.exit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
