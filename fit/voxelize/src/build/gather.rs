//! Microflakes gathered into the voxels of a grid.

use crate::build::clip::clip_triangle;
use crate::model::microflakes::{CellMicroflakes, MicroflakeColour, MicroflakeSums};
use glam::Vec3;
use std::collections::BTreeMap;

/// Voxels of one level by their coordinates.
pub type VoxelSums = BTreeMap<[u32; 3], CellMicroflakes>;

/// Gathers microflakes into the finest voxels of the unit cube.
#[derive(Debug, Clone)]
pub struct Gather {
    resolution: u32,
    voxels: VoxelSums,
}

impl Gather {
    /// Returns an empty cube of `resolution` voxels a side.
    pub fn new(resolution: u32) -> Gather {
        Gather { resolution, voxels: BTreeMap::new() }
    }

    /// Returns a cube of `resolution` voxels a side with microflakes that have been gathered already.
    pub fn of(resolution: u32, voxels: VoxelSums) -> Gather {
        Gather { resolution, voxels }
    }

    /// Adds microflakes of one sort to a voxel; those outside the cube are dropped.
    pub fn add(&mut self, cell: [i32; 3], microflakes: &MicroflakeSums) {
        if cell.iter().all(|x| (0..self.resolution as i32).contains(x)) {
            self.voxels.entry(cell.map(|x| x as u32)).or_default().add(microflakes);
        }
    }

    /// Adds a triangle of the unit cube.
    pub fn add_triangle(&mut self, corners: [Vec3; 3], colour: &MicroflakeColour, weight: f32) {
        let r = self.resolution as f32;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        if normal == Vec3::ZERO {
            return;
        }
        clip_triangle(corners.map(|p| p * r), &mut |cell, polygon| {
            let area = 0.5 * polygon.double_area().length() / (r * r) * weight;
            self.add(cell, &MicroflakeSums::microflake(area, normal, colour));
        });
    }

    /// Returns the voxels of all levels, finest first, down to one.
    pub fn levels(self) -> Vec<VoxelSums> {
        let mut levels = vec![self.voxels];
        let mut resolution = self.resolution;
        while resolution > 1 {
            let mut coarser = VoxelSums::new();
            for (cell, sums) in levels.last().into_iter().flatten() {
                coarser.entry(cell.map(|x| x / 2)).or_default().add_cell(sums);
            }
            levels.push(coarser);
            resolution /= 2;
        }
        levels
    }
}
