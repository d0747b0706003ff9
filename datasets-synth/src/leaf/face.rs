//! The visible face of a leaf, the other one behind it, and the side of the light.

use crate::optics::abm::path_lengths::Face;
use crate::optics::abm::scatter_table::Passage;
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::vector::dot;

/// Factors of the appearance textures on a leaf's contents at one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tint {
    /// Factor on chlorophyll.
    pub chlorophyll: f32,
    /// Factor on carotenoids.
    pub carotenoid: f32,
    /// Factor on brown pigment and anthocyanins.
    pub brown: f32,
    /// Factor on all absorption, for thickness.
    pub thickness: f32,
}

/// The two faces of a leaf as the camera sees them. Both lie on one grid, in the lateral frame of the visible face; the
/// heights of the far face are along its own normal.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    /// Face that is seen.
    pub side: Face,
    /// Whether the light is on the side of the eye or on the other one.
    pub passage: Passage,
    /// Side of the images in texels.
    pub size: usize,
    /// Height field of the visible face.
    pub face: HeightField,
    /// Height field of the far face.
    pub far: HeightField,
}

/// Returns a direction in the frame of the far face.
#[inline]
fn turned(w: [f32; 3]) -> [f32; 3] {
    [w[0], w[1], -w[2]]
}

impl Seen {
    /// Returns the visibility of the light `wi` from the face that it falls on.
    pub fn visibility(&self, wi: [f32; 3]) -> LightVisibility {
        match self.passage {
            Passage::Reflection => LightVisibility::new(&self.face, wi),
            Passage::Transmission => LightVisibility::new(&self.far, turned(wi)),
        }
    }

    /// Returns the normal of the far face at a place, in its own frame; needed for transmission only.
    #[inline]
    pub fn far_normal(&self, place: [f32; 2]) -> [f32; 3] {
        match self.passage {
            Passage::Reflection => [0.0, 0.0, 1.0],
            Passage::Transmission => self.far.normal_at(place),
        }
    }

    /// Returns the cosine of incidence on the lit face.
    #[inline]
    pub fn cos_i(&self, normal: [f32; 3], far_normal: [f32; 3], wi: [f32; 3]) -> f32 {
        match self.passage {
            Passage::Reflection => dot(normal, wi),
            Passage::Transmission => dot(far_normal, turned(wi)),
        }
    }
}
