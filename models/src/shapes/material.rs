//! Materials of shapes, and colours that change from place to place within the volume.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::shapes::noise::Noise;
use crate::shapes::point::Point;

/// Material given by numbers, or by the leaf or asset that it is taken from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Name by which strokes refer to the material.
    pub name: String,
    /// Diffuse reflectance, hemispherical, linear with sRGB primaries; required without `from`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<[f64; 3]>,
    /// Diffuse transmittance, hemispherical, linear with sRGB primaries; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transmittance: Option<[f64; 3]>,
    /// Specular reflectance at normal incidence, 0 to 1; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specular: Option<f64>,
    /// Roughness of the specular reflection, 0.05 to 1; 0.5 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f64>,
    /// Description of a leaf (.toml) or asset (.spmm) that gives the material, relative to the script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<PathBuf>,
    /// Tint that reflectance and transmittance are multiplied by, from place to place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tint: Option<Tint>,
}

/// Factor on a colour that changes from place to place: pictures and procedural textures inside the volume [Neyret
/// 1996, section 3.3].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Tint {
    /// Picture (PNG or JPEG, sRGB), repeated beyond its edges.
    Picture {
        /// Path of the file, relative to the script.
        file: PathBuf,
        /// Projection of the picture; without it texture coordinates of sheets and meshes give the place.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        projection: Option<Projection>,
    },
    /// Blend from the first colour to the second as the noise goes from -1/2 to 1/2.
    Noise {
        /// The noise.
        noise: Noise,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
    /// Two alternating colours, half a period each.
    Stripes {
        /// Vector across the stripes, one period long.
        period_m: Point,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
    /// Boxes of two alternating colours.
    Checker {
        /// Size of a box.
        box_m: Point,
        /// Both colours, linear factors, 0 to 1.
        colours: [[f64; 3]; 2],
    },
}

/// Plane of a projected picture, which is constant along the normal of the plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Projection {
    /// Lower left corner of the picture.
    pub corner_m: Point,
    /// Vector from the lower left corner along the lower edge to the right corner.
    pub right_m: Point,
    /// Vector from the lower left corner along the left edge to the upper corner.
    pub up_m: Point,
}

impl Material {
    /// Returns the diffuse reflectance that is given by numbers; black for a material that is taken from a file.
    pub fn reflectance(&self) -> [f64; 3] {
        self.reflectance.unwrap_or_default()
    }

    /// Returns the diffuse transmittance that is given by numbers.
    pub fn transmittance(&self) -> [f64; 3] {
        self.transmittance.unwrap_or_default()
    }

    /// Returns the specular reflectance at normal incidence that is given by numbers.
    pub fn specular(&self) -> f64 {
        self.specular.unwrap_or(0.0)
    }

    /// Returns the roughness of the specular reflection.
    pub fn roughness(&self) -> f64 {
        self.roughness.unwrap_or(0.5)
    }
}
