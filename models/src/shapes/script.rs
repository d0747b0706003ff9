//! Parts of a script: space, materials and strokes.

use serde::{Deserialize, Serialize};

use crate::shapes::material::Material;
use crate::shapes::point::Point;
use crate::shapes::shape::Shape;

/// Script of a model that is painted into a box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Box that is painted.
    pub space: Space,
    /// Materials of the strokes.
    #[serde(default)]
    pub materials: Vec<Material>,
    /// Strokes in the order of painting.
    #[serde(default)]
    pub strokes: Vec<Stroke>,
}

/// Box that is painted, in metres, z up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Space {
    /// Corner of the least coordinates.
    pub least_m: Point,
    /// Corner of the greatest coordinates.
    pub most_m: Point,
    /// Whether the box is one period of a cyclic pattern, along x and along y.
    #[serde(default)]
    pub cyclic: [bool; 2],
}

/// Shapes of one material, painted one after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Name of the material; subtracting and setting normals needs none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Effect of the stroke on what is already painted.
    #[serde(default)]
    pub mode: PaintMode,
    /// Shapes that the stroke draws.
    pub shapes: Vec<Shape>,
}

/// Effect of a stroke on what is already painted: the drawing mode of [Neyret 1996, section 3].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PaintMode {
    /// Addition of the surface of the shape.
    #[default]
    Add,
    /// Removal of what lies inside the shape, which must be a solid. No surface of the shape remains.
    Subtract,
    /// Removal of what lies inside the shape, then addition of its surface. Equal to `add` for a shape that is no
    /// solid.
    Set,
    /// Change of the normals of all voxels that the surface passes to its own; area and material stay.
    Normals,
}

impl Script {
    /// Returns the index of the material of a name.
    pub fn material_number(&self, name: &str) -> Option<usize> {
        self.materials.iter().position(|material| material.name == name)
    }
}
