//! Exact derivatives of `plate-n` by the absorption of a layer and by the number of layers, for fits to measured spectra.
//!
//! With `g = e^-a` and `c = e^-b` the pile of [`crate::plate_n`] is `R' = sinh(m b) / sinh(a + m b)`,
//! `T' = sinh(a) / sinh(a + m b)`, whose derivatives stay finite where g and c approach 1, and
//! `cosh a = (1 + r^2 - t^2) / 2r`, `cosh b = (1 - r^2 + t^2) / 2t` give those of a and b.

use crate::error::SynthError;
use crate::optics::interface::{DiffuseFaces, mean_interface_transmittance};
use crate::optics::plates::exact::plate_inside_of;
use crate::optics::plates::pile::{Layers, check_structure};
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::theta_table::theta_with_slope;

/// Absorption of a layer below which the derivatives are those at this absorption: their terms cancel to `1e-16 / k`,
/// while the derivatives themselves change by `k ln k`.
const MIN_ABSORPTION: f64 = 1e-7;

/// Transmittance of a layer below which no light reaches the second one.
const OPAQUE: f64 = 1e-15;

/// Reflectance and transmittance with their derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateSlopes {
    /// Reflectance and transmittance.
    pub optics: PlateOptics,
    /// Derivatives by the absorption k of one layer, at constant N.
    pub by_absorption: PlateOptics,
    /// Derivatives by the number of layers N, at constant k.
    pub by_structure: PlateOptics,
}

/// Returns [`crate::plate_n`] within 1e-8 with its derivatives, for the same arguments.
///
/// Cost: about an evaluation of [`crate::plate_n`], whose theta takes as long as the table's and the derivatives here.
///
/// # Errors
/// [`SynthError::BadParameter`] for an N below 1 or not a number.
pub fn plate_n_slopes(k: f64, index: f64, cone_deg: f64, structure: f64) -> Result<PlateSlopes, SynthError> {
    check_structure(structure)?;
    Ok(LitSurface::new(index, cone_deg).slopes(k, structure))
}

/// Everything about a pile of plates at one wavelength but its absorption and its number of layers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitSurface {
    faces: DiffuseFaces,
    /// Share of the incident light that enters.
    entering: f64,
}

impl LitSurface {
    /// Prepares a pile of index `index` (>= 1) lit over a cone of half-angle `cone_deg`.
    pub(crate) fn new(index: f64, cone_deg: f64) -> LitSurface {
        LitSurface { faces: DiffuseFaces::new(index), entering: mean_interface_transmittance(cone_deg, index) }
    }

    /// Prepares the body of a pile, whose shares are of the light that has entered.
    pub(crate) fn entered(index: f64) -> LitSurface {
        LitSurface { faces: DiffuseFaces::new(index), entering: 1.0 }
    }

    /// Returns a pile of `count >= 0` layers of absorption `k >= 0` under diffuse light, as it is within the leaf, with its
    /// derivatives.
    pub(crate) fn diffuse_pile(&self, k: f64, count: f64) -> PlateSlopes {
        let [theta, slope] = theta_with_slope(k.max(MIN_ABSORPTION));
        let LayerSlopes { layers, under_diffuse, .. } = layer_slopes(theta, self.faces);
        let pile = pile_slopes(&layers, under_diffuse, count);
        let by_theta = pile.by_absorption;
        PlateSlopes {
            optics: match k < MIN_ABSORPTION {
                true => Layers::new(theta_with_slope(k)[0], self.faces).pile(count),
                false => pile.optics,
            },
            by_absorption: PlateOptics {
                reflectance: slope * by_theta.reflectance,
                transmittance: slope * by_theta.transmittance,
            },
            ..pile
        }
    }

    /// Returns the shares of the incident light of a body whose shares under diffuse light are `body`, of which the face
    /// that is lit is a part; what less than one layer reflects below its own surface is none.
    pub(crate) fn uncovered(&self, body: PlateOptics) -> PlateOptics {
        let PlateOptics { reflectance, transmittance } = body;
        let inside = ((reflectance - (1.0 - self.faces.entry)) / self.faces.entry).max(0.0);
        PlateOptics {
            reflectance: (1.0 - self.entering) + self.entering * inside,
            transmittance: self.entering * transmittance / self.faces.entry,
        }
    }

    /// Returns a derivative of [`LitSurface::uncovered`] from that of the body.
    pub(crate) fn uncovered_by(&self, body: PlateOptics, by: PlateOptics) -> PlateOptics {
        let scale = self.entering / self.faces.entry;
        let is_inside = body.reflectance > 1.0 - self.faces.entry;
        PlateOptics {
            reflectance: if is_inside { scale * by.reflectance } else { 0.0 },
            transmittance: scale * by.transmittance,
        }
    }

    /// Returns the whole leaf with its derivatives. `k >= 0` is the absorption of one layer, `structure >= 1`.
    pub(crate) fn slopes(&self, k: f64, structure: f64) -> PlateSlopes {
        let [theta, slope] = theta_with_slope(k.max(MIN_ABSORPTION));
        let inside = inside_slopes(theta, self.faces, structure);
        // The value itself has its digits at any absorption.
        let optics = if k < MIN_ABSORPTION {
            Layers::new(theta_with_slope(k)[0], self.faces).inside(structure)
        } else {
            inside.optics
        };
        let scaled = |by: PlateOptics, factor: f64| PlateOptics {
            reflectance: self.entering * factor * by.reflectance,
            transmittance: self.entering * factor * by.transmittance,
        };
        PlateSlopes {
            optics: PlateOptics {
                reflectance: (1.0 - self.entering) + self.entering * optics.reflectance,
                transmittance: self.entering * optics.transmittance,
            },
            by_absorption: scaled(inside.by_absorption, slope),
            by_structure: scaled(inside.by_structure, 1.0),
        }
    }
}

/// A layer with its derivatives by theta.
struct LayerSlopes {
    layers: Layers,
    /// Reflectance and transmittance under diffuse light, by theta.
    under_diffuse: [f64; 2],
    /// The layer lit from outside, and its reflectance and transmittance by theta.
    first: PlateOptics,
    first_by: [f64; 2],
}

fn layer_slopes(theta: f64, faces: DiffuseFaces) -> LayerSlopes {
    let first = plate_inside_of(theta, faces);
    let back = theta * faces.inner_reflectance();
    let through = 1.0 - back * back;
    let first_t = faces.exit * (1.0 + back * back) / (through * through);
    let first_r = faces.inner_reflectance() * first.transmittance + back * first_t;
    LayerSlopes {
        layers: Layers::new(theta, faces),
        under_diffuse: [faces.entry * first_r, faces.entry * first_t],
        first,
        first_by: [first_r, first_t],
    }
}

/// Returns the shares of the light that has entered, with their derivatives; `by_absorption` is by theta.
fn inside_slopes(theta: f64, faces: DiffuseFaces, structure: f64) -> PlateSlopes {
    let LayerSlopes { layers, under_diffuse: [r_by, t_by], first, first_by: [first_r, first_t] } =
        layer_slopes(theta, faces);
    let Layers { r, t, .. } = layers;
    let count = structure - 1.0;
    let rest = pile_slopes(&layers, [r_by, t_by], count);
    let between = 1.0 / (1.0 - rest.optics.reflectance * r);
    let PlateOptics { reflectance: rest_r, transmittance: rest_t } = rest.optics;
    let optics = PlateOptics {
        reflectance: first.reflectance + first.transmittance * rest_r * t * between,
        transmittance: first.transmittance * rest_t * between,
    };
    // Of `between`, by theta and by N.
    let between_by = |rest_by: f64, r_by: f64| between * between * (rest_by * r + rest_r * r_by);
    let total = |by: PlateOptics, [first_r, first_t, r_by, t_by]: [f64; 4]| {
        let between_by = between_by(by.reflectance, r_by);
        PlateOptics {
            reflectance: first_r
                + first_t * rest_r * t * between
                + first.transmittance
                    * (by.reflectance * t * between + rest_r * t_by * between + rest_r * t * between_by),
            transmittance: first_t * rest_t * between
                + first.transmittance * (by.transmittance * between + rest_t * between_by),
        }
    };
    PlateSlopes {
        optics,
        by_absorption: total(rest.by_absorption, [first_r, first_t, r_by, t_by]),
        by_structure: total(rest.by_structure, [0.0; 4]),
    }
}

/// Returns the pile of `count >= 0` layers under diffuse light with its derivatives, by what r and t are derived by.
fn pile_slopes(layers: &Layers, [r_by, t_by]: [f64; 2], count: f64) -> PlateSlopes {
    let Layers { r, t, .. } = *layers;
    let none = PlateOptics { reflectance: 0.0, transmittance: 0.0 };
    if t < OPAQUE {
        let optics = if count > 0.0 {
            PlateOptics { reflectance: r, ..none }
        } else {
            PlateOptics { transmittance: 1.0, ..none }
        };
        return PlateSlopes { optics, by_absorption: none, by_structure: none };
    }
    if r <= 0.0 {
        // No interface: layers that only absorb.
        let transmittance = t.powf(count);
        return PlateSlopes {
            optics: PlateOptics { transmittance, ..none },
            by_absorption: PlateOptics { transmittance: count * transmittance / t * t_by, ..none },
            by_structure: PlateOptics { transmittance: transmittance * t.ln(), ..none },
        };
    }
    let stokes = layers.stokes(count);
    let optics = stokes.optics();
    let common = r * r + t * t - 1.0;
    let a_by = (common * r_by - 2.0 * r * t * t_by) / (r * stokes.d);
    let b_by = (common * t_by - 2.0 * r * t * r_by) / (t * stokes.d);
    // 1 / sinh and coth of a + m b.
    let q = stokes.g * stokes.power;
    let (csch, coth) = (2.0 * q / stokes.one_minus_q2, (1.0 + q * q) / stokes.one_minus_q2);
    let by_b = PlateOptics { reflectance: optics.transmittance * csch, transmittance: -optics.transmittance * coth };
    PlateSlopes {
        optics,
        by_absorption: PlateOptics {
            reflectance: -optics.reflectance * coth * a_by + count * by_b.reflectance * b_by,
            transmittance: optics.reflectance * csch * a_by + count * by_b.transmittance * b_by,
        },
        by_structure: PlateOptics {
            reflectance: -stokes.ln_c * by_b.reflectance,
            transmittance: -stokes.ln_c * by_b.transmittance,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::plates::pile::plate_n;

    fn of(k: f64, index: f64, structure: f64) -> PlateOptics {
        plate_n(k, index, 40.0, structure).unwrap()
    }

    fn across(low: PlateOptics, high: PlateOptics, step: f64) -> [f64; 2] {
        [(high.reflectance - low.reflectance) / step, (high.transmittance - low.transmittance) / step]
    }

    #[test]
    fn values_are_those_of_the_model_and_slopes_are_its_differences() {
        for index in [1.27, 1.42, 1.52] {
            for structure in [1.0, 1.2, 1.5, 2.0, 3.0] {
                for k in [1e-5, 1e-3, 0.03, 0.3, 1.0, 1.9, 2.1, 5.0, 12.0] {
                    let slopes = plate_n_slopes(k, index, 40.0, structure).unwrap();
                    let value = of(k, index, structure);
                    assert!((slopes.optics.reflectance - value.reflectance).abs() < 1e-8, "{index} {structure} {k}");
                    assert!((slopes.optics.transmittance - value.transmittance).abs() < 1e-8);
                    let step = 1e-4 * k;
                    let by_k = across(of(k - step, index, structure), of(k + step, index, structure), 2.0 * step);
                    let step = 1e-5;
                    // One-sided at a single layer.
                    let below = if structure > 1.0 { step } else { 0.0 };
                    let [low, high] = [structure - below, structure + step].map(|n| of(k, index, n));
                    let by_n = across(low, high, step + below);
                    let got = [slopes.by_absorption, slopes.by_structure];
                    for (by, expected) in got.iter().zip([by_k, by_n]) {
                        let apart = [by.reflectance - expected[0], by.transmittance - expected[1]];
                        let scale = 1.0 + expected[0].abs().max(expected[1].abs());
                        assert!(
                            apart.iter().all(|x| x.abs() < 3e-5 * scale),
                            "n {index}, N {structure}, k {k}: {by:?} {expected:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_slopes_are_finite_at_every_extreme_and_continuous_where_absorption_ends() {
        for index in [1.0, 1.0 + 1e-12, 1.3, 1.6] {
            for structure in [1.0, 1.0f64.next_up(), 1.5, 3.0, 100.0] {
                for k in [0.0, 1e-300, 1e-12, 1e-7, 1.0, 30.0, 100.0, 745.0, 1e4, f64::INFINITY] {
                    let slopes = plate_n_slopes(k, index, 40.0, structure).unwrap();
                    for x in [slopes.optics, slopes.by_absorption, slopes.by_structure] {
                        assert!(
                            x.reflectance.is_finite() && x.transmittance.is_finite(),
                            "{index} {structure} {k} {x:?}"
                        );
                    }
                }
            }
        }
        let at = |k| plate_n_slopes(k, 1.42, 40.0, 1.7).unwrap().by_absorption;
        let (none, little) = (at(0.0), at(1e-6));
        assert!((none.reflectance - little.reflectance).abs() < 1e-3, "{none:?} {little:?}");
        assert!((none.transmittance - little.transmittance).abs() < 1e-3);
        // Planted difference: ten thousand times the absorption is another slope.
        assert!((none.transmittance - at(0.01).transmittance).abs() > 1e-2);
        assert!(plate_n_slopes(0.1, 1.42, 40.0, 0.9).is_err());
    }
}
