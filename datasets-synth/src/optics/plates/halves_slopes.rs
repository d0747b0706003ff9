//! Exact derivatives of `plate-two-sided` by the absorption and the number of layers of each half, for fits to measured
//! spectra (see [`crate::optics::plates::two_halves`]).

use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::slopes::{LitSurface, PlateSlopes};

/// Reflectance and transmittance of two halves with their derivatives, the lit half first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HalvesSlopes {
    /// Reflectance and transmittance.
    pub(crate) optics: PlateOptics,
    /// Derivatives by the absorption of one layer of each half.
    pub(crate) by_absorption: [PlateOptics; 2],
    /// Derivatives by the number of layers of each half.
    pub(crate) by_layers: [PlateOptics; 2],
}

impl LitSurface {
    /// Returns a leaf of two piles, the lit one first, of absorptions `k >= 0` of a layer and of `layers > 0` layers.
    pub(crate) fn halves(&self, k: [f64; 2], layers: [f64; 2]) -> HalvesSlopes {
        let [lit, behind] = [0, 1].map(|half| self.diffuse_pile(k[half], layers[half]));
        let PlateOptics { reflectance: lit_r, transmittance: lit_t } = lit.optics;
        let PlateOptics { reflectance: behind_r, transmittance: behind_t } = behind.optics;
        let between = 1.0 / (1.0 - lit_r * behind_r);
        let whole = PlateOptics {
            reflectance: lit_r + lit_t * lit_t * behind_r * between,
            transmittance: lit_t * behind_t * between,
        };
        let by_lit = |by: PlateOptics| PlateOptics {
            reflectance: (1.0 + (lit_t * behind_r * between).powi(2)) * by.reflectance
                + 2.0 * lit_t * behind_r * between * by.transmittance,
            transmittance: behind_t * between * (lit_t * behind_r * between * by.reflectance + by.transmittance),
        };
        let by_behind = |by: PlateOptics| PlateOptics {
            reflectance: (lit_t * between).powi(2) * by.reflectance,
            transmittance: lit_t * between * (behind_t * lit_r * between * by.reflectance + by.transmittance),
        };
        let by = |of: fn(&PlateSlopes) -> PlateOptics| {
            [by_lit(of(&lit)), by_behind(of(&behind))].map(|by| self.uncovered_by(whole, by))
        };
        HalvesSlopes {
            optics: self.uncovered(whole),
            by_absorption: by(|slopes| slopes.by_absorption),
            by_layers: by(|slopes| slopes.by_structure),
        }
    }
}
