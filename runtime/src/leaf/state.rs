//! The state of a leaf: what its tissue holds, how its surface shines, and how exactly it is evaluated.

use crate::leaf::error::LeafError;

/// How a leaf's body is evaluated. docs/results/trade.md has each one's error and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u32)]
pub enum LeafMode {
    /// One plate as printed: three wavelengths, theta in three pieces, eq. 6 with its misprints, thickness as a factor on
    /// what is transmitted [Miao, eq. 5, 6 and 9]. Knows neither anthocyanins nor water. Not printed: the gloss, which is
    /// the other modes' so that the bodies compare, its coupling, and the limit to the light that fell in.
    ThreePiece = 0,
    /// One exact plate at the paper's three wavelengths, theta by a rational form [Miao, eq. 3-5].
    Rational = 1,
    /// N plates, PROSPECT-D, over the spectrum [Jacquemoud 1990; Feret 2017].
    #[default]
    NLayers = 2,
}

impl LeafMode {
    /// All modes, by number.
    pub const ALL: [LeafMode; 3] = [LeafMode::ThreePiece, LeafMode::Rational, LeafMode::NLayers];

    /// Its name: `three-piece`, `rational` or `n-layers`.
    pub fn name(self) -> &'static str {
        match self {
            LeafMode::ThreePiece => "three-piece",
            LeafMode::Rational => "rational",
            LeafMode::NLayers => "n-layers",
        }
    }
}

/// A quantity of a leaf, as a slider or a file needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafQuantity {
    /// Name of the field of [`LeafState`], and key in files.
    pub key: &'static str,
    /// Unit with a space before it; empty where there is none.
    pub unit: &'static str,
    /// Least and most of a leaf.
    pub range: [f32; 2],
}

/// The quantities of a leaf in the order of [`LeafState::values`].
pub const LEAF_QUANTITIES: [LeafQuantity; 10] = {
    const fn quantity(key: &'static str, unit: &'static str, least: f32, most: f32) -> LeafQuantity {
        LeafQuantity { key, unit, range: [least, most] }
    }
    [
        quantity("chlorophyll_ug_per_cm2", " ug/cm2", 0.0, 100.0),
        quantity("carotenoid_ug_per_cm2", " ug/cm2", 0.0, 25.0),
        quantity("anthocyanin_ug_per_cm2", " ug/cm2", 0.0, 15.0),
        quantity("brown", "", 0.0, 1.0),
        quantity("water_cm", " cm", 0.0, 0.04),
        quantity("dry_matter_g_per_cm2", " g/cm2", 0.0, 0.02),
        quantity("structure", "", 1.0, 3.0),
        quantity("gloss_index", "", 1.01, 3.0),
        quantity("gamma_along", "", 0.05, 1.0),
        quantity("gamma_across", "", 0.05, 1.0),
    ]
};

/// The state of a leaf. [`LeafState::check`] holds it to a leaf's ranges; whatever is finite beyond them is evaluated to
/// finite values that make no light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafState {
    /// How the body is evaluated.
    pub mode: LeafMode,
    /// Chlorophyll a + b in ug/cm2, 0 to 100.
    pub chlorophyll_ug_per_cm2: f32,
    /// Carotenoids in ug/cm2, 0 to 25.
    pub carotenoid_ug_per_cm2: f32,
    /// Anthocyanins in ug/cm2, 0 to 15.
    pub anthocyanin_ug_per_cm2: f32,
    /// Brown pigment in arbitrary units, 0 to 1.
    pub brown: f32,
    /// Water in cm, 0 to 0.04.
    pub water_cm: f32,
    /// Dry matter in g/cm2, 0 to 0.02.
    pub dry_matter_g_per_cm2: f32,
    /// Number of layers N, 1 to 3; need not be whole.
    pub structure: f32,
    /// Refractive index of the cuticle, for the gloss, 1.01 to 3.
    pub gloss_index: f32,
    /// Roughness of the gloss along the veins (root of twice the facets' slope variance), 0.05 to 1.
    pub gamma_along: f32,
    /// The same across the veins.
    pub gamma_across: f32,
}

impl Default for LeafState {
    /// A green leaf under its own gloss, evaluated over the spectrum.
    fn default() -> LeafState {
        LeafState {
            mode: LeafMode::default(),
            chlorophyll_ug_per_cm2: 40.0,
            carotenoid_ug_per_cm2: 8.0,
            anthocyanin_ug_per_cm2: 0.0,
            brown: 0.0,
            water_cm: 0.01,
            dry_matter_g_per_cm2: 0.005,
            structure: 1.5,
            gloss_index: 1.42,
            gamma_along: 0.3,
            gamma_across: 0.3,
        }
    }
}

impl LeafState {
    /// The quantities in the order of [`LEAF_QUANTITIES`].
    pub fn values(&self) -> [f32; 10] {
        [
            self.chlorophyll_ug_per_cm2,
            self.carotenoid_ug_per_cm2,
            self.anthocyanin_ug_per_cm2,
            self.brown,
            self.water_cm,
            self.dry_matter_g_per_cm2,
            self.structure,
            self.gloss_index,
            self.gamma_along,
            self.gamma_across,
        ]
    }

    /// The state of `mode` with the quantities in the order of [`LEAF_QUANTITIES`].
    pub fn from_values(mode: LeafMode, values: [f32; 10]) -> LeafState {
        let [
            chlorophyll_ug_per_cm2,
            carotenoid_ug_per_cm2,
            anthocyanin_ug_per_cm2,
            brown,
            water_cm,
            dry_matter_g_per_cm2,
            structure,
            gloss_index,
            gamma_along,
            gamma_across,
        ] = values;
        LeafState {
            mode,
            chlorophyll_ug_per_cm2,
            carotenoid_ug_per_cm2,
            anthocyanin_ug_per_cm2,
            brown,
            water_cm,
            dry_matter_g_per_cm2,
            structure,
            gloss_index,
            gamma_along,
            gamma_across,
        }
    }

    /// Checks every quantity against the ranges of leaves.
    ///
    /// # Errors
    /// [`LeafError::OutOfRange`] for the first beyond its range or not a number.
    pub fn check(&self) -> Result<(), LeafError> {
        refuse_beyond(self, |quantity| quantity.range)
    }

    /// Refuses what cannot be evaluated: a value that is not finite.
    pub(crate) fn check_finite(&self) -> Result<(), LeafError> {
        refuse_beyond(self, |_| [f32::MIN, f32::MAX])
    }

    /// The same state within what can be evaluated: contents not negative, N at least 1, index and roughness in their
    /// ranges.
    pub(crate) fn evaluable(&self) -> LeafState {
        let mut values = self.values();
        for (i, (value, quantity)) in values.iter_mut().zip(LEAF_QUANTITIES).enumerate() {
            let [least, most] = quantity.range;
            // Contents and N have no upper end.
            *value = if i < 7 { value.max(least) } else { value.clamp(least, most) };
        }
        LeafState::from_values(self.mode, values)
    }

    /// Contents in the order of [`crate::LeafRow::absorption`].
    pub(crate) fn contents(&self) -> [f32; 6] {
        [0, 1, 2, 3, 4, 5].map(|i| self.values()[i])
    }
}

/// Refuses the first quantity outside of `allowed`, or not a number, with its range of leaves.
fn refuse_beyond(state: &LeafState, allowed: impl Fn(&LeafQuantity) -> [f32; 2]) -> Result<(), LeafError> {
    for (value, quantity) in state.values().into_iter().zip(&LEAF_QUANTITIES) {
        let [low, high] = allowed(quantity);
        if !(low..=high).contains(&value) {
            let LeafQuantity { key, unit, range: [least, most] } = *quantity;
            return Err(LeafError::OutOfRange { key, value, least, most, unit });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_is_refused_beyond_its_range_by_its_own_name() {
        LeafState::default().check().unwrap();
        for (i, quantity) in LEAF_QUANTITIES.iter().enumerate() {
            let [least, most] = quantity.range;
            for (value, fine) in
                [(least, true), (most, true), (least - 0.01, false), (most * 100.0, false), (f32::NAN, false)]
            {
                let mut values = LeafState::default().values();
                values[i] = value;
                let state = LeafState::from_values(LeafMode::Rational, values);
                let checked = state.check();
                assert_eq!(checked.is_ok(), fine, "{} {value}", quantity.key);
                if let Err(error) = checked {
                    assert!(error.to_string().starts_with(quantity.key), "{error}");
                }
                assert_eq!(state.check_finite().is_ok(), value.is_finite());
            }
        }
    }
}
