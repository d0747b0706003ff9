//! What shapes are made of, and colours that change from place to place within the volume.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::shapes::noise::Noise;
use crate::shapes::point::Point;

/// A material: numbers, or the leaf or asset that it is taken from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// What strokes call it.
    pub name: String,
    /// Diffuse reflectance, hemispherical, linear with sRGB primaries; without `from` it must be there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<[f64; 3]>,
    /// Diffuse transmittance, the same; none without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmittance: Option<[f64; 3]>,
    /// Specular reflectance at normal incidence, 0 to 1; 0 without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specular: Option<f64>,
    /// Roughness of that reflection, 0.05 to 1; 0.5 without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f64>,
    /// A leaf's description (.toml) or an asset (.spmm) that stands for the numbers, relative to the script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<PathBuf>,
    /// What reflectance and transmittance are multiplied by, from place to place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tint: Option<Tint>,
}

/// A colour that changes from place to place, as factors: pictures and procedural textures inside the volume
/// [Neyret 1996, section 3.3].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Tint {
    /// A picture (PNG or JPEG, sRGB), repeated beyond its edges.
    Picture {
        /// The file, relative to the script.
        file: PathBuf,
        /// How it is projected; without it texture coordinates of sheets and meshes tell the place.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        projection: Option<Projection>,
    },
    /// From the first colour to the second as the noise goes from -1/2 to 1/2.
    Noise {
        /// The noise.
        noise: Noise,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
    /// Two colours by turns, half a period each.
    Stripes {
        /// Across the stripes, as long as a period.
        period_m: Point,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
    /// Boxes of two colours by turns.
    Checker {
        /// Size of a box.
        box_m: Point,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
}

/// Where a projected picture lies. It is the same along the normal of its plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Projection {
    /// The picture's lower left corner.
    pub corner_m: Point,
    /// From there along its lower edge to the right corner.
    pub right_m: Point,
    /// From there along its left edge to the upper corner.
    pub up_m: Point,
}

impl Material {
    /// Returns the diffuse reflectance by numbers; black for what is taken from a file.
    pub fn reflectance(&self) -> [f64; 3] {
        self.reflectance.unwrap_or_default()
    }

    /// Returns the diffuse transmittance by numbers.
    pub fn transmittance(&self) -> [f64; 3] {
        self.transmittance.unwrap_or_default()
    }

    /// Returns the specular reflectance at normal incidence by numbers.
    pub fn specular(&self) -> f64 {
        self.specular.unwrap_or(0.0)
    }

    /// Returns the roughness of that reflection.
    pub fn roughness(&self) -> f64 {
        self.roughness.unwrap_or(0.5)
    }
}
