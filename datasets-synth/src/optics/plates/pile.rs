//! `plate-n`, the default: a leaf as a pile of N absorbing plates, PROSPECT [Jacquemoud 1990; Feret
//! 2008; Feret 2017].
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | absorption of one layer, k = sum K C / N | - | from the contents | 0 up |
//! | index n | - | PROSPECT-D, spectral | 1 to 1.6 |
//! | half-angle of the cone of incident light, alpha | degree | 40 | 0 to 90 |
//! | structure N, number of layers, need not be whole | - | 1.5 | 1 to 3 |
//!
//! One layer is the plate of [`crate::plate`]; below the first, light is diffuse, so the other N - 1
//! have its reflectance r and transmittance t under diffuse light. Their pile is Stokes' solution
//! for whole N, continued to any N [Stokes 1862; Jacquemoud 1990]:
//!
//! `D = sqrt((1+r+t)(1+r-t)(1-r+t)(1-r-t))`, `g = 2r / (1+r^2-t^2+D)`, `c = 2t / (1-r^2+t^2+D)`,
//! `R' = g (1-c^2m) / (1-g^2 c^2m)`, `T' = c^m (1-g^2) / (1-g^2 c^2m)` with `m = N - 1`,
//! `tau = T_a T' / (1 - R' r)`, `rho = R_a + T_a R' t / (1 - R' r)`
//!
//! with `R_a`, `T_a` of the first layer lit over the cone.
//!
//! Differs from the papers in: g = 1/a and c = 1/b of their a and b, which grow without bound where
//! this g and c fall to 0, so that strong absorption (t underflows) and n = 1 (r = 0) need no
//! branch; and `1 - r - t` is taken as `t_90 (1-th) / (1 - (1-t_21) th)`, which keeps its digits
//! where absorption vanishes. Without any, D = 0 and the limit `T' = t / (t + (1-t) m)` is taken.
//!
//! When it is wrong: between 0 and 1 layers beyond the first it interpolates what has no picture in
//! tissue; both faces are alike, so it cannot tell a pale lower face from the upper one; the index
//! and absorptions are one table for all species; surfaces are not glossy (couple
//! [`crate::CookTorrance`] to [`plate_n_inside`]).

use crate::error::SynthError;
use crate::optics::interface::{DiffuseFaces, mean_interface_transmittance};
use crate::optics::plates::exact::plate_inside_of;
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::theta::diffuse_transmission;

/// Returns reflectance and transmittance of a pile of `structure` (N, at least 1) plates, each of absorption `k >= 0`
/// and index `index` (>= 1), lit over a cone of half-angle `cone_deg`.
///
/// # Errors
/// [`SynthError::BadParameter`] for an N below 1 or not a number.
pub fn plate_n(k: f64, index: f64, cone_deg: f64, structure: f64) -> Result<PlateOptics, SynthError> {
    let inside = plate_n_inside(k, index, structure)?;
    let entering = mean_interface_transmittance(cone_deg, index);
    Ok(PlateOptics {
        reflectance: (1.0 - entering) + entering * inside.reflectance,
        transmittance: entering * inside.transmittance,
    })
}

/// Returns the shares of the light that has *entered* the pile through its first surface: what leaves again in front,
/// and what leaves behind. They do not depend on the direction of the light; at `k = 0` they add up to 1.
///
/// # Errors
/// [`SynthError::BadParameter`] for an N below 1 or not a number.
pub fn plate_n_inside(k: f64, index: f64, structure: f64) -> Result<PlateOptics, SynthError> {
    check_structure(structure)?;
    Ok(plate_n_inside_of(diffuse_transmission(k), DiffuseFaces::new(index), structure))
}

/// Refuses an N that is no pile.
pub(crate) fn check_structure(structure: f64) -> Result<(), SynthError> {
    // Not `<`, so that a NaN is refused, too.
    if (1.0..f64::INFINITY).contains(&structure) {
        return Ok(());
    }
    let allowed = "a number of layers from 1".to_owned();
    Err(SynthError::BadParameter { name: "--n", value: structure.to_string(), allowed })
}

/// Evaluates [`plate_n_inside`] from `theta = 2 E3(k)`, which depends on the pigments, and from the faces, which do
/// not. `structure` must have been checked.
#[inline]
pub(crate) fn plate_n_inside_of(theta: f64, faces: DiffuseFaces, structure: f64) -> PlateOptics {
    Layers::new(theta, faces).inside(structure)
}

/// Layers of a pile: the first, and what all others are under diffuse light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layers {
    /// Shares of the light that has entered the first layer.
    first: PlateOptics,
    /// Reflectance of one layer under diffuse light.
    pub(crate) r: f64,
    /// Transmittance of one layer under diffuse light.
    pub(crate) t: f64,
    /// Absorbed share, `1 - r - t`; kept because the difference loses its digits.
    absorbed: f64,
}

impl Layers {
    /// Returns the layers of transmission `theta` between `faces`.
    #[inline]
    pub(crate) fn new(theta: f64, faces: DiffuseFaces) -> Layers {
        let first = plate_inside_of(theta, faces);
        Layers {
            first,
            r: (1.0 - faces.entry) + faces.entry * first.reflectance,
            t: faces.entry * first.transmittance,
            absorbed: faces.entry * (1.0 - theta) / (1.0 - faces.inner_reflectance() * theta),
        }
    }

    /// Returns the shares of the light that has entered `structure >= 1` layers.
    #[inline]
    pub(crate) fn inside(&self, structure: f64) -> PlateOptics {
        let Layers { first, r, t, .. } = *self;
        if structure == 1.0 {
            return first;
        }
        let rest = self.pile(structure - 1.0);
        let between = 1.0 / (1.0 - rest.reflectance * r);
        PlateOptics {
            reflectance: first.reflectance + first.transmittance * rest.reflectance * t * between,
            transmittance: first.transmittance * rest.transmittance * between,
        }
    }

    /// Returns reflectance and transmittance of `count > 0` layers under diffuse light.
    #[inline]
    pub(crate) fn pile(&self, count: f64) -> PlateOptics {
        if self.absorbed <= 0.0 {
            let transmittance = self.t / (self.t + (1.0 - self.t) * count);
            return PlateOptics { reflectance: 1.0 - transmittance, transmittance };
        }
        self.stokes(count).optics()
    }

    /// Returns the terms of Stokes' solution for `count > 0` layers that absorb something.
    #[inline]
    pub(crate) fn stokes(&self, count: f64) -> Stokes {
        let Layers { r, t, absorbed, .. } = *self;
        let d = ((1.0 + r + t) * (1.0 + r - t) * (1.0 - r + t) * absorbed).sqrt();
        let g_denominator = 1.0 + r * r - t * t + d;
        let c_denominator = 1.0 - r * r + t * t + d;
        let g = 2.0 * r / g_denominator;
        // 1 - g and 1 - c without the cancellation: both near 0 where little is absorbed.
        let one_minus_g = (absorbed * (1.0 - r + t) + d) / g_denominator;
        let one_minus_c = (absorbed * (1.0 - t + r) + d) / c_denominator;
        // At t = 0 the logarithm is -inf. Rounding may put 1 - c above 1.
        let ln_c = (-one_minus_c.min(1.0)).ln_1p();
        // c^count - 1.
        let power_minus_1 = (count * ln_c).exp_m1();
        let power = 1.0 + power_minus_1;
        let one_minus_power2 = -power_minus_1 * (1.0 + power);
        let one_minus_g2 = one_minus_g * (1.0 + g);
        let one_minus_q2 = one_minus_g2 + one_minus_power2 - one_minus_g2 * one_minus_power2;
        Stokes { d, g, ln_c, power, one_minus_power2, one_minus_g2, one_minus_q2 }
    }
}

/// Terms of Stokes' solution for a pile: D, g and c of the notes of the module, c to the power of the number of layers,
/// and what is small where little is absorbed. `q = g c^m`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stokes {
    pub(crate) d: f64,
    pub(crate) g: f64,
    pub(crate) ln_c: f64,
    pub(crate) power: f64,
    one_minus_power2: f64,
    one_minus_g2: f64,
    pub(crate) one_minus_q2: f64,
}

impl Stokes {
    /// Returns reflectance and transmittance of the pile.
    #[inline]
    pub(crate) fn optics(&self) -> PlateOptics {
        PlateOptics {
            reflectance: self.g * self.one_minus_power2 / self.one_minus_q2,
            transmittance: self.power * self.one_minus_g2 / self.one_minus_q2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::plates::exact::{plate, plate_inside};

    fn of(k: f64, index: f64, cone_deg: f64, structure: f64) -> PlateOptics {
        plate_n(k, index, cone_deg, structure).unwrap()
    }

    /// Computes a whole number of layers one above the other, the slow and obvious way.
    fn layer_by_layer(k: f64, index: f64, cone_deg: f64, layers: usize) -> PlateOptics {
        let layer = plate(k, index, 90.0);
        // From the bottom up: `below` is what lies under the layer that is put on.
        let put_on = |top: PlateOptics, below: PlateOptics| {
            let between = 1.0 / (1.0 - layer.reflectance * below.reflectance);
            PlateOptics {
                reflectance: top.reflectance + top.transmittance * below.reflectance * layer.transmittance * between,
                transmittance: top.transmittance * below.transmittance * between,
            }
        };
        let nothing = PlateOptics { reflectance: 0.0, transmittance: 1.0 };
        let below = (1..layers).fold(nothing, |below, _| put_on(layer, below));
        put_on(plate(k, index, cone_deg), below)
    }

    #[test]
    fn whole_numbers_of_layers_equal_layers_put_one_above_the_other() {
        for layers in 1..=5usize {
            for k in [0.0, 1e-12, 1e-6, 0.01, 0.3, 2.0, 20.0] {
                let (closed, slow) = (of(k, 1.42, 40.0, layers as f64), layer_by_layer(k, 1.42, 40.0, layers));
                let apart = (closed.reflectance - slow.reflectance)
                    .abs()
                    .max((closed.transmittance - slow.transmittance).abs());
                assert!(apart < 1e-12, "{layers} layers, k {k}: {apart:e}");
            }
        }
        // Planted difference: half a layer more.
        let apart = of(0.3, 1.42, 40.0, 2.5).transmittance - layer_by_layer(0.3, 1.42, 40.0, 2).transmittance;
        assert!(apart.abs() > 0.01);
    }

    #[test]
    fn one_layer_is_the_single_plate() {
        for k in [0.0, 1e-300, 1e-8, 0.1, 1.0, 10.0, 1000.0] {
            for cone in [0.0, 1e-3, 40.0, 90.0] {
                let (one, single) = (of(k, 1.42, cone, 1.0), plate(k, 1.42, cone));
                assert!((one.reflectance - single.reflectance).abs() < 1e-15, "{k} {cone}");
                assert!((one.transmittance - single.transmittance).abs() < 1e-15, "{k} {cone}");
                // And the limit towards it.
                let near = of(k, 1.42, cone, 1.0f64.next_up());
                assert!((near.transmittance - plate(k, 1.42, cone).transmittance).abs() < 1e-12, "{k} {cone}");
            }
            let difference = plate_n_inside(k, 1.42, 1.0).unwrap().reflectance - plate_inside(k, 1.42).reflectance;
            assert!(difference.abs() < 1e-15, "{k}");
        }
    }

    #[test]
    fn nothing_is_lost_without_absorption_and_nothing_gained_with_it() {
        for structure in [1.0, 1.0f64.next_up(), 1.5, 3.0, 50.0] {
            for index in [1.0, 1.3, 1.42, 1.6] {
                for cone in [0.0, 1e-3, 40.0, 90.0] {
                    for k in [0.0, 1e-300] {
                        let clear = of(k, index, cone, structure);
                        let sum = clear.reflectance + clear.transmittance;
                        assert!((sum - 1.0).abs() < 1e-12, "N {structure}, n {index}, {cone}: {sum}");
                    }
                    for k in [1e-17, 1e-14, 1e-12, 1e-8, 0.1, 1.0, 10.0, 30.0, 100.0, 700.0, 1000.0] {
                        let optics = of(k, index, cone, structure);
                        assert!(optics.reflectance >= 0.0 && optics.transmittance >= 0.0, "{k} {optics:?}");
                        let sum = optics.reflectance + optics.transmittance;
                        assert!(sum <= 1.0 + 1e-12, "k {k}, N {structure}, n {index}: {sum}");
                    }
                    let black = of(1000.0, index, cone, structure);
                    let surface = 1.0 - mean_interface_transmittance(cone, index);
                    assert!((black.reflectance - surface).abs() < 1e-12 && black.transmittance == 0.0);
                }
            }
        }
    }

    #[test]
    fn the_limit_of_no_absorption_is_reached_without_a_jump() {
        let clear = of(0.0, 1.42, 40.0, 1.5);
        for exponent in 6..=20 {
            let k = 10f64.powi(-exponent);
            let optics = of(k, 1.42, 40.0, 1.5);
            let lost = (clear.reflectance - optics.reflectance).abs().max(clear.transmittance - optics.transmittance);
            assert!(lost < 10.0 * k + 1e-13, "1e-{exponent}: {lost:e}");
        }
    }

    #[test]
    fn fewer_than_one_layer_is_refused() {
        for structure in [0.0, 1.0f64.next_down(), -2.0, f64::NAN, f64::INFINITY] {
            let message = plate_n(0.1, 1.42, 40.0, structure).unwrap_err().to_string();
            assert!(message.contains("--n is") && message.contains("from 1"), "{message}");
            assert!(plate_n_inside(0.1, 1.42, structure).is_err());
        }
    }
}
