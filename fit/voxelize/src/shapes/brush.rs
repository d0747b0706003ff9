//! Colour in which a shape is painted, from place to place.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::tint::TintMap;
use crate::build::lit::coloured_light;
use crate::model::light_table::LightTable;
use crate::model::microflakes::{MicroflakeColour, luminance};

/// What a surface is painted with.
#[derive(Debug, Clone, Default)]
pub struct Coat {
    /// Colour of its microflakes.
    pub colour: MicroflakeColour,
    /// Light of a leaf or of an asset by its directions, and the factor on it that a tint makes.
    table: Option<(Arc<LightTable>, f32)>,
}

impl Coat {
    /// Returns the coat of a leaf or of an asset.
    pub fn of_table(colour: MicroflakeColour, table: Arc<LightTable>) -> Coat {
        Coat { colour, table: Some((table, 1.0)) }
    }

    /// Returns the luminance that a surface with this unit normal sends to `eye` from `light`, unit vectors towards
    /// them, without shadow.
    pub fn light(&self, normal: Vec3, eye: Vec3, light: Vec3) -> f32 {
        match &self.table {
            Some((table, factor)) => factor * table.light(normal, eye, light),
            None => coloured_light(&self.colour, normal, eye, light),
        }
    }

    /// Returns the coat with other shares of light, by which a table's light changes as their luminance does.
    fn coloured(&self, colour: MicroflakeColour) -> Coat {
        let all = |colour: &MicroflakeColour| luminance(colour.reflectance) + luminance(colour.transmittance);
        let ratio = all(&colour) / all(&self.colour).max(f32::MIN_POSITIVE);
        Coat { colour, table: self.table.as_ref().map(|(table, factor)| (table.clone(), ratio * factor)) }
    }
}

impl From<MicroflakeColour> for Coat {
    fn from(colour: MicroflakeColour) -> Coat {
        Coat { colour, table: None }
    }
}

/// A material's coat and what tints it.
#[derive(Debug, Clone, Default)]
pub struct Brush {
    /// Coat of the untinted material.
    pub coat: Coat,
    /// Factors of reflectance and transmittance.
    pub tint: Option<TintMap>,
}

impl Brush {
    /// Returns the coat at a place, whose texture coordinates are `uv` where it has some.
    pub fn coat(&self, place_m: DVec3, uv: Option<DVec2>) -> Coat {
        match self.tint {
            Some(_) => self.coat.coloured(self.colour(place_m, uv)),
            None => self.coat.clone(),
        }
    }

    /// Returns the colour at a place, whose texture coordinates are `uv` where it has some.
    pub fn colour(&self, place_m: DVec3, uv: Option<DVec2>) -> MicroflakeColour {
        let Some(tint) = &self.tint else { return self.coat.colour };
        let factor = tint.at(place_m, uv);
        let tinted = |colour: [f32; 3]| std::array::from_fn(|k| colour[k] * factor[k]);
        MicroflakeColour {
            reflectance: tinted(self.coat.colour.reflectance),
            transmittance: tinted(self.coat.colour.transmittance),
            ..self.coat.colour
        }
    }
}
