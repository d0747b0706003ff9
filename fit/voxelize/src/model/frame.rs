//! Place of a model in the unit cube of its volume.

use crate::error::VoxelizeError;
use btf_runtime::voltex::MAX_SIDE_M;
use glam::Vec3;

/// Size of the cube over that of the model, so that nothing lies on the cube's faces.
const MARGIN: f32 = 1.001;

/// Place of a model in the unit cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Corner of the cube in metres.
    pub origin: Vec3,
    /// Side of the cube in metres.
    pub side_m: f32,
}

impl Frame {
    /// Returns the cube over a model, which stands on the cube's floor, in the middle.
    ///
    /// # Errors
    /// [`VoxelizeError::Model`] for a model without extent, and for one that is larger than a file can say.
    pub fn around([lo, hi]: [Vec3; 2]) -> Result<Frame, VoxelizeError> {
        let side_m = (hi - lo).max_element() * MARGIN;
        // Without triangles it is less than nothing.
        if side_m.is_nan() || side_m <= 0.0 {
            return Err(VoxelizeError::Model(
                "the model has no extent, so there is nothing to make a volume of".into(),
            ));
        }
        if side_m > MAX_SIDE_M {
            return Err(VoxelizeError::Model(format!(
                "the model is {side_m} m large and a volume at most {MAX_SIDE_M} m: scale it to metres"
            )));
        }
        let middle = 0.5 * (lo + hi);
        Ok(Frame {
            origin: Vec3::new(middle.x - 0.5 * side_m, middle.y - 0.5 * side_m, lo.z - 0.5 * (MARGIN - 1.0) * side_m),
            side_m,
        })
    }

    /// Converts a point from metres to the unit cube.
    pub fn cube_from_m(&self, p: Vec3) -> Vec3 {
        (p - self.origin) / self.side_m
    }
}
