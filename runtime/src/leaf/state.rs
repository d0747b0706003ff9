//! The state of a leaf: the contents of its tissue, the gloss of its surface, and the mode in which it is evaluated.

use crate::leaf::error::LeafError;
use btf_leaf_quantities::{Part, QUANTITIES, Quantity};

/// The mode in which a leaf's body is evaluated. docs/results/trade.md has each one's error and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u32)]
pub enum LeafMode {
    /// One plate as printed: three wavelengths, theta in three pieces, eq. 6 with its misprints, thickness as a factor
    /// on the transmitted light [Miao, eq. 5, 6 and 9]. The mode has neither anthocyanins nor water. Not printed: the
    /// gloss, which is that of the other modes so that the bodies compare, its coupling, and the limit to the light
    /// that entered.
    ThreePiece = 0,
    /// One exact plate at the paper's three wavelengths, theta by a rational form [Miao, eq. 3-5].
    Rational = 1,
    /// N plates, PROSPECT-D, over the spectrum [Jacquemoud 1990; Feret 2017].
    #[default]
    NLayers = 2,
    /// Two unequal piles of plates over the spectrum, [`TwoHalves::BROAD_LEAF`], so that the back is paler than the front.
    TwoSided = 3,
    /// A table of an algorithmic model, [`crate::LeafScattering`], with its own reflection of the surface in place of the gloss.
    /// The mode has chlorophyll and carotenoids, no other contents.
    Tissue = 4,
}

/// How layers and contents of a leaf of [`LeafMode::TwoSided`] divide between its upper half, palisade tissue, and its lower
/// one, spongy tissue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoHalves {
    /// Share of the layers that is palisade.
    pub layers: f64,
    /// Share of the pigments that is in them.
    pub pigments: f64,
    /// Share of water and dry matter that is in them.
    pub body: f64,
}

impl TwoHalves {
    /// Halves that fit 66 leaves of oak, birch and goldenrod, seen from both faces, best [Noda 2013]
    /// (docs/results/leaf-optics.md).
    pub const BROAD_LEAF: TwoHalves = TwoHalves { layers: 0.9, pigments: 0.99, body: 0.95 };

    /// Returns for the upper and the lower half: its share of the layers, and how much more of the pigments, and of water and dry
    /// matter, one of them holds than a layer of the whole leaf.
    pub(crate) fn of_layers(self) -> [[f64; 3]; 2] {
        let half = |layers: f64, pigments: f64, body: f64| [layers, pigments / layers, body / layers];
        [half(self.layers, self.pigments, self.body), half(1.0 - self.layers, 1.0 - self.pigments, 1.0 - self.body)]
    }
}

impl LeafMode {
    /// All modes that need no table, by number.
    pub const ALL: [LeafMode; 4] = [LeafMode::ThreePiece, LeafMode::Rational, LeafMode::NLayers, LeafMode::TwoSided];

    /// Returns the mode's name: `three-piece`, `rational`, `n-layers`, `two-sided` or `tissue`.
    pub fn name(self) -> &'static str {
        match self {
            LeafMode::ThreePiece => "three-piece",
            LeafMode::Rational => "rational",
            LeafMode::NLayers => "n-layers",
            LeafMode::TwoSided => "two-sided",
            LeafMode::Tissue => "tissue",
        }
    }
}

/// A quantity of a leaf, as a slider or a file needs it: [`btf_leaf_quantities::Quantity`] in single precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafQuantity {
    /// Name of the field of [`LeafState`], and key in messages.
    pub key: &'static str,
    /// Unit; empty where there is none.
    pub unit: &'static str,
    /// Least and greatest value that leaves have.
    pub range: [f32; 2],
    /// Part of the leaf that the number describes.
    pub part: Part,
}

/// The quantities of a leaf in the order of [`LeafState::values`].
pub const LEAF_QUANTITIES: [LeafQuantity; QUANTITIES.len()] = {
    let blank = LeafQuantity { key: "", unit: "", range: [0.0; 2], part: Part::Tissue };
    let mut all = [blank; QUANTITIES.len()];
    let mut i = 0;
    while i < all.len() {
        let Quantity { whole_key, unit, part, .. } = QUANTITIES[i];
        all[i] = LeafQuantity { key: whole_key, unit, range: QUANTITIES[i].range_f32(), part };
        i += 1;
    }
    all
};

/// The state of a leaf. [`LeafState::check`] holds it to the ranges of leaves; finite values beyond them are evaluated
/// to finite values that create no light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafState {
    /// Mode in which the body is evaluated.
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
    /// Roughness of the gloss along the veins (square root of twice the slope variance of its facets, Beckmann's alpha), 0.05 to 1.
    pub gamma_along: f32,
    /// Roughness of the gloss across the veins (square root of twice the slope variance of its facets, Beckmann's alpha), 0.05 to 1.
    pub gamma_across: f32,
}

impl Default for LeafState {
    /// Returns a green leaf under its own gloss, evaluated over the spectrum.
    fn default() -> LeafState {
        LeafState::from_values(LeafMode::default(), QUANTITIES.map(|quantity| quantity.default as f32))
    }
}

impl LeafState {
    /// Returns the quantities in the order of [`LEAF_QUANTITIES`].
    pub fn values(&self) -> [f32; QUANTITIES.len()] {
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

    /// Makes a state of `mode` from quantities in the order of [`LEAF_QUANTITIES`].
    pub fn from_values(mode: LeafMode, values: [f32; QUANTITIES.len()]) -> LeafState {
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
    /// [`LeafError::OutOfRange`] for the first quantity that is beyond its range or not a number.
    pub fn check(&self) -> Result<(), LeafError> {
        refuse_beyond(self, |quantity| quantity.range)
    }

    /// Refuses a state that cannot be evaluated: one with a value that is not finite.
    pub(crate) fn check_finite(&self) -> Result<(), LeafError> {
        refuse_beyond(self, |_| [f32::MIN, f32::MAX])
    }

    /// Returns the nearest state that can be evaluated: contents not negative, N at least 1, index and roughness in
    /// their ranges.
    pub(crate) fn evaluable(&self) -> LeafState {
        let mut values = self.values();
        for (value, quantity) in values.iter_mut().zip(LEAF_QUANTITIES) {
            let [least, most] = quantity.range;
            // Contents and N have no upper end.
            *value = match quantity.part {
                Part::Tissue => value.max(least),
                Part::Gloss => value.clamp(least, most),
            };
        }
        LeafState::from_values(self.mode, values)
    }

    /// Returns the contents in the order of [`crate::LeafRow::absorption`].
    pub(crate) fn contents(&self) -> [f32; 6] {
        [0, 1, 2, 3, 4, 5].map(|i| self.values()[i])
    }
}

/// Refuses the first quantity that is outside of `allowed` or not a number. The error names the range of leaves.
fn refuse_beyond(state: &LeafState, allowed: impl Fn(&LeafQuantity) -> [f32; 2]) -> Result<(), LeafError> {
    for (value, quantity) in state.values().into_iter().zip(&LEAF_QUANTITIES) {
        let [low, high] = allowed(quantity);
        if !(low..=high).contains(&value) {
            let LeafQuantity { key, unit, range: [least, most], .. } = *quantity;
            return Err(LeafError::OutOfRange { key, value, least, most, unit });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stand_in_the_order_of_the_quantities() {
        // One value at a time, by its field's name.
        for (i, quantity) in LEAF_QUANTITIES.iter().enumerate() {
            let mut values = [0.0; QUANTITIES.len()];
            values[i] = 0.5;
            let state = LeafState::from_values(LeafMode::Rational, values);
            assert!(format!("{state:?}").contains(&format!("{}: 0.5", quantity.key)), "{state:?}");
            assert_eq!(state.values(), values);
        }
    }

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
