//! Reflection and refraction of unpolarised light at a smooth interface between two media.
//!
//! | parameter | symbol | unit | valid |
//! |---|---|---|---|
//! | index of the medium that the light comes from | eta_i | - | > 0 |
//! | index of the medium behind the interface | eta_t | - | > 0 |
//! | cosine between the way back and the normal | c_i | - | 0 to 1, clamped |
//!
//! Snell's law gives `c_t = sqrt(1 - (eta_i/eta_t)^2 (1 - c_i^2))`, and the mean of both polarisations is
//! `F = ((eta_i^2 - eta_t^2)^2 (c_i c_t)^2 + (c_i^2 - c_t^2)^2 (eta_i eta_t)^2) / (c_i c_t (eta_i^2 + eta_t^2) +
//! eta_i eta_t (c_i^2 + c_t^2))^2` [Baranoski & Rokne 1997, eq. 2]. Rays are bent by its eq. 3 and 4.
//!
//! Differs from the paper in: where `c_t` is imaginary, eq. 2 has no value, and here `F = 1` (total internal
//! reflection); eq. 4 returns a ray of unit length on the wrong side where the normal does not oppose the ray, and here
//! the normal is turned round first.
//!
//! When it is wrong: real indices only (in leaves the imaginary part is below 1e-4), no polarisation, no
//! thin films.

use crate::vector::dot;

/// Returns the reflectance of unpolarised light at an interface from air into `index` (>= 1), at an angle of cosine
/// `cosine` in [0, 1] [Cook & Torrance 1982].
pub fn fresnel(index: f64, cosine: f64) -> f64 {
    let c = cosine.clamp(0.0, 1.0);
    let g = (index * index + c * c - 1.0).max(0.0).sqrt();
    // No interface; the form below would be rounding noise over rounding noise at grazing angles.
    if index == 1.0 || g + c == 0.0 {
        return 0.0;
    }
    let ratio = (g - c) / (g + c);
    let other = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    0.5 * ratio * ratio * (1.0 + other * other)
}

/// Returns the squared cosine of the refracted ray; negative under total internal reflection.
#[inline]
fn refract_cos_squared(n_incident: f64, n_transmitted: f64, cos_incident: f64) -> f64 {
    let ratio = n_incident / n_transmitted;
    1.0 - ratio * ratio * (1.0 - cos_incident * cos_incident)
}

/// Returns the reflectance of unpolarised light that comes through a medium of index `n_incident` to one of
/// `n_transmitted` (both > 0) at `cos_incident` in [0, 1]; 1 under total internal reflection, 0 between equal indices,
/// always finite [Baranoski & Rokne 1997, eq. 2]. Costs a root and two divisions.
#[inline]
pub fn fresnel_between(n_incident: f64, n_transmitted: f64, cos_incident: f64) -> f64 {
    if n_incident == n_transmitted {
        return 0.0;
    }
    let ci = cos_incident.clamp(0.0, 1.0);
    let ct2 = refract_cos_squared(n_incident, n_transmitted, ci);
    if ct2 <= 0.0 {
        return 1.0;
    }
    let (ci2, i2, t2) = (ci * ci, n_incident * n_incident, n_transmitted * n_transmitted);
    let c_it = ci * ct2.sqrt();
    let n_it = n_incident * n_transmitted;
    let a = (i2 - t2) * c_it;
    let b = (ci2 - ct2) * n_it;
    let root = c_it * (i2 + t2) + n_it * (ci2 + ct2);
    (a * a + b * b) / (root * root)
}

/// Returns the cosine of the refracted ray against the normal on its side, 0 to 1; `None` under total internal
/// reflection [Baranoski & Rokne 1997, eq. 1]. The arguments are those of [`fresnel_between`].
#[inline]
pub fn refract_cos(n_incident: f64, n_transmitted: f64, cos_incident: f64) -> Option<f64> {
    let squared = refract_cos_squared(n_incident, n_transmitted, cos_incident.clamp(0.0, 1.0));
    (squared >= 0.0).then(|| squared.sqrt())
}

/// Returns [`fresnel_between`] and [`refract_cos`] (0 under total internal reflection) together, from the amplitudes of
/// both polarisations, for `cosine` in [0, 1]. A random walk needs both at every interface.
#[inline]
pub(crate) fn interface_optics(n_incident: f64, n_transmitted: f64, cosine: f64) -> (f64, f64) {
    let ratio = n_incident / n_transmitted;
    // 1 - ratio^2 (1 - cosine^2), without cancellation where the indices are near each other.
    let cos2_t = (1.0 - ratio) * (1.0 + ratio) + ratio * ratio * cosine * cosine;
    if cos2_t <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos2_t.sqrt();
    let (ii, it) = (n_incident * cosine, n_incident * cos_t);
    let (ti, tt) = (n_transmitted * cosine, n_transmitted * cos_t);
    let s = (ii - tt) / (ii + tt);
    let p = (it - ti) / (it + ti);
    (0.5 * (s * s + p * p), cos_t)
}

/// Returns the ray of direction `direction` (unit, the direction of travel) after a mirror of unit normal `normal`,
/// which may point to either side [Baranoski & Rokne 1997, eq. 3].
#[inline]
pub fn reflect(direction: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let twice = 2.0 * dot(direction, normal);
    std::array::from_fn(|k| direction[k] - twice * normal[k])
}

/// Returns the ray of direction `direction` (unit, the direction of travel) behind an interface of unit normal
/// `normal`, which may point to either side; `None` under total internal reflection [Baranoski & Rokne 1997, eq. 4].
#[inline]
pub fn refract(direction: [f64; 3], normal: [f64; 3], n_incident: f64, n_transmitted: f64) -> Option<[f64; 3]> {
    let along = dot(direction, normal);
    // The normal that opposes the ray; with the other one eq. 4 ends on the wrong side.
    let normal = if along > 0.0 { normal.map(|c| -c) } else { normal };
    let cos_incident = along.abs().min(1.0);
    let cos_transmitted = refract_cos(n_incident, n_transmitted, cos_incident)?;
    let ratio = n_incident / n_transmitted;
    let share = ratio * cos_incident - cos_transmitted;
    Some(std::array::from_fn(|k| ratio * direction[k] + share * normal[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const INDICES: [f64; 7] = [1.0, 1.1, 1.33, 1.41, 1.42, 1.6, 3.0];
    const THETAS_DEG: [f64; 11] = [0.0, 1e-3, 10.0, 30.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.9, 90.0];

    /// Returns the textbook form, from the amplitudes of both polarisations.
    fn mean_of_polarisations(ni: f64, nt: f64, theta_deg: f64) -> f64 {
        let sin = theta_deg.to_radians().sin() * ni / nt;
        if sin >= 1.0 {
            return 1.0;
        }
        let (ci, ct) = (theta_deg.to_radians().cos(), sin.asin().cos());
        let s = (ni * ci - nt * ct) / (ni * ci + nt * ct);
        let p = (nt * ci - ni * ct) / (nt * ci + ni * ct);
        0.5 * (s * s + p * p)
    }

    #[test]
    fn the_walks_form_is_the_same_function() {
        for ni in INDICES {
            for nt in INDICES {
                for theta in THETAS_DEG {
                    let cos = theta.to_radians().cos();
                    let (f, cos_t) = interface_optics(ni, nt, cos);
                    assert!((f - fresnel_between(ni, nt, cos)).abs() < 1e-12, "{ni} {nt} {theta}");
                    assert!((cos_t - refract_cos(ni, nt, cos).unwrap_or(0.0)).abs() < 1e-7, "{ni} {nt} {theta}");
                }
            }
        }
    }

    /// Returns a ray at `theta_deg` against a normal that opposes it; both turned out of the axes.
    fn ray_and_normal(theta_deg: f64, turn: f64) -> ([f64; 3], [f64; 3]) {
        let (s, c) = theta_deg.to_radians().sin_cos();
        let rotate = |v: [f64; 3]| {
            let (sx, cx) = turn.sin_cos();
            let [x, y, z] = [v[0], cx * v[1] - sx * v[2], sx * v[1] + cx * v[2]];
            let (sy, cy) = (2.3 * turn).sin_cos();
            [cy * x + sy * z, y, cy * z - sy * x]
        };
        (rotate([s * turn.cos(), s * turn.sin(), -c]), rotate([0.0, 0.0, 1.0]))
    }

    #[test]
    fn reflectance_is_the_mean_of_both_polarisations() {
        let mut worst = 0f64;
        let mut swapped = 0f64;
        for ni in INDICES {
            for nt in INDICES {
                if ni == nt {
                    continue;
                }
                for theta in THETAS_DEG {
                    let expected = mean_of_polarisations(ni, nt, theta);
                    worst = worst.max((fresnel_between(ni, nt, theta.to_radians().cos()) - expected).abs());
                    // Planted difference: the media swapped.
                    swapped = swapped.max((fresnel_between(nt, ni, theta.to_radians().cos()) - expected).abs());
                }
            }
        }
        assert!(worst < 1e-12, "{worst:e}");
        assert!(swapped > 0.1);
    }

    #[test]
    fn both_forms_agree_from_air() {
        for index in INDICES {
            for theta in THETAS_DEG {
                let c = theta.to_radians().cos();
                assert!((fresnel_between(1.0, index, c) - fresnel(index, c)).abs() < 1e-12, "{index} {theta}");
            }
        }
    }

    #[test]
    fn fresnel_is_right_at_normal_grazing_and_brewster_incidence() {
        assert!((fresnel(1.42, 1.0) - (0.42f64 / 2.42).powi(2)).abs() < 1e-15);
        assert!((fresnel(1.42, 0.0) - 1.0).abs() < 1e-15);
        // At Brewster's angle only the perpendicular part is left: ((n^2-1)/(n^2+1))^2 / 2.
        let brewster = 1.0 / (1.0 + 1.42f64 * 1.42).sqrt();
        let expected = ((1.42f64.powi(2) - 1.0) / (1.42f64.powi(2) + 1.0)).powi(2) / 2.0;
        assert!((fresnel(1.42, brewster) - expected).abs() < 1e-15);
        assert_eq!(fresnel(1.0, 0.0), 0.0);
        assert_eq!(fresnel_between(1.0, 1.42, 0.0), 1.0);
    }

    #[test]
    fn beyond_the_critical_angle_everything_is_reflected() {
        let critical = (1.0f64 / 1.42).asin();
        for beyond in [1e-9, 1e-3, 0.5] {
            let c = (critical + beyond).min(std::f64::consts::FRAC_PI_2).cos();
            assert_eq!(fresnel_between(1.42, 1.0, c), 1.0);
            assert_eq!(refract_cos(1.42, 1.0, c), None);
            let (s, c) = (critical + beyond).sin_cos();
            assert_eq!(refract([s, 0.0, -c], [0.0, 0.0, 1.0], 1.42, 1.0), None);
        }
        let before = (critical - 1e-3).cos();
        assert!(fresnel_between(1.42, 1.0, before) < 1.0 && refract_cos(1.42, 1.0, before).is_some());
        // The way back refracts into the way there.
        let inside = refract_cos(1.0, 1.42, 0.3).unwrap();
        assert!((refract_cos(1.42, 1.0, inside).unwrap() - 0.3).abs() < 1e-12);
        assert!((fresnel_between(1.42, 1.0, inside) - fresnel_between(1.0, 1.42, 0.3)).abs() < 1e-12);
    }

    #[test]
    fn equal_indices_are_no_interface_at_any_angle() {
        for theta in THETAS_DEG {
            let c = theta.to_radians().cos();
            assert_eq!(fresnel_between(1.4, 1.4, c), 0.0);
            assert!((refract_cos(1.4, 1.4, c).unwrap() - c).abs() < 1e-12);
            let (v, n) = ray_and_normal(theta, 0.7);
            let r = refract(v, n, 1.4, 1.4).unwrap();
            assert!((0..3).all(|k| (r[k] - v[k]).abs() < 1e-12));
        }
        assert_eq!(fresnel_between(1.4, 1.4, 0.0), 0.0);
    }

    #[test]
    fn rays_keep_unit_length_and_obey_snell_on_either_side_of_the_normal() {
        for (step, theta) in THETAS_DEG.into_iter().enumerate() {
            for (ni, nt) in [(1.0, 1.42), (1.42, 1.0), (1.6, 1.41), (1.41, 1.6)] {
                let (v, n) = ray_and_normal(theta, 0.4 + step as f64);
                for normal in [n, n.map(|c| -c)] {
                    let mirrored = reflect(v, normal);
                    assert!((dot(mirrored, mirrored) - 1.0).abs() < 1e-12);
                    assert!((dot(mirrored, n) + dot(v, n)).abs() < 1e-12);
                    let Some(r) = refract(v, normal, ni, nt) else {
                        assert!(ni > nt && theta > (nt / ni).asin().to_degrees());
                        continue;
                    };
                    assert!((dot(r, r) - 1.0).abs() < 1e-12, "{theta} {ni} {nt}");
                    // On the far side, in the plane of incidence, at Snell's angle.
                    assert!(dot(r, n) <= 1e-12);
                    let tangent = |d: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| d[k] - dot(d, n) * n[k]) };
                    let (before, after) = (tangent(v), tangent(r));
                    assert!((0..3).all(|k| (ni * before[k] - nt * after[k]).abs() < 1e-12), "{theta} {ni} {nt}");
                    assert!((refract_cos(ni, nt, -dot(v, n)).unwrap() + dot(r, n)).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn cosines_that_rounding_pushed_over_their_range_are_clamped() {
        assert_eq!(fresnel_between(1.0, 1.5, 1.0 + 1e-15), fresnel_between(1.0, 1.5, 1.0));
        assert_eq!(fresnel_between(1.0, 1.5, -1e-18), 1.0);
        assert_eq!(refract_cos(1.0, 1.5, 1.0 + 1e-15), Some(1.0));
    }
}
