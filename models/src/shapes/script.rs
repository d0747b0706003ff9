//! The script: space, materials and strokes.

use serde::{Deserialize, Serialize};

use crate::shapes::material::Material;
use crate::shapes::point::Point;
use crate::shapes::shape::Shape;

/// A model that is painted into a box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// The box.
    pub space: Space,
    /// What strokes are made of.
    #[serde(default)]
    pub materials: Vec<Material>,
    /// Painted in this order.
    #[serde(default)]
    pub strokes: Vec<Stroke>,
}

/// The box that is painted, in metres, z up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Space {
    /// Corner of the least coordinates.
    pub least_m: Point,
    /// Corner of the greatest.
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
    /// What painting does to what is there.
    #[serde(default)]
    pub mode: PaintMode,
    /// The shapes.
    pub shapes: Vec<Shape>,
}

/// What a stroke does to what has been painted: the drawing mode of [Neyret 1996, section 3].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PaintMode {
    /// Adds the shape's surface to what is there.
    #[default]
    Add,
    /// Takes away what lies inside the shape, a solid, and leaves no surface of it.
    Subtract,
    /// Takes away what lies inside the shape, then adds its surface; of what is no solid, like `add`.
    Set,
    /// Leaves area and material, and turns all normals of voxels that the surface passes to its own.
    Normals,
}

impl Script {
    /// Returns the number of a material by its name.
    pub fn material_number(&self, name: &str) -> Option<usize> {
        self.materials.iter().position(|material| material.name == name)
    }
}
