//! How much there is in a landscape.

use std::fmt;

/// Numbers of the parts of a landscape.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct LandscapeCounts {
    /// `lawn`, `grove` or `forest`.
    pub name: String,
    /// Bilinear patches of the land.
    pub patches: u64,
    /// Texels that are not empty.
    pub texels: u64,
    /// Blades of grass.
    pub blades: u64,
    /// Flowers.
    pub flowers: u64,
    /// Trees.
    pub trees: u64,
    /// Blades, petals, stems, branches and leaves that the volumes stand for, of the volumes that come with the viewer.
    pub primitives: u64,
    /// Tetrahedra of the thick skin's finest shell.
    pub tets: u64,
    /// Volumes.
    pub volumes: u64,
    /// Voxels along a side of the finest one.
    pub resolution: u32,
    /// Bytes of the volumes' files together.
    pub volume_file_bytes: u64,
    /// Bytes of the volumes in memory together.
    pub volume_bytes: u64,
}

impl fmt::Display for LandscapeCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} patches, {} texels, ", self.name, self.patches, self.texels)?;
        if self.trees > 0 {
            write!(f, "{} trees", self.trees)?;
        } else {
            write!(f, "{} blades, {} flowers", self.blades, self.flowers)?;
        }
        write!(
            f,
            ", which are {} shapes; {} volumes of {}^3 in {:.1} MB, files of {:.1} kB; {} tetrahedra",
            self.primitives,
            self.volumes,
            self.resolution,
            self.volume_bytes as f64 * 1e-6,
            self.volume_file_bytes as f64 * 1e-3,
            self.tets
        )
    }
}
