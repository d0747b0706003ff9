//! Colour in which a shape is painted, from place to place.

use glam::{DVec2, DVec3};

use super::tint::TintMap;
use crate::model::microflakes::MicroflakeColour;

/// A material's colour and what tints it.
#[derive(Debug, Clone, Default)]
pub struct Brush {
    /// Colour of the untinted material.
    pub colour: MicroflakeColour,
    /// Factors of reflectance and transmittance.
    pub tint: Option<TintMap>,
}

impl Brush {
    /// Returns the colour at a place, whose texture coordinates are `uv` where it has some.
    pub fn colour(&self, place_m: DVec3, uv: Option<DVec2>) -> MicroflakeColour {
        let Some(tint) = &self.tint else { return self.colour };
        let factor = tint.at(place_m, uv);
        let tinted = |colour: [f32; 3]| std::array::from_fn(|k| colour[k] * factor[k]);
        MicroflakeColour {
            reflectance: tinted(self.colour.reflectance),
            transmittance: tinted(self.colour.transmittance),
            ..self.colour
        }
    }
}
