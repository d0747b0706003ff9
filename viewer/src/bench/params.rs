//! What a bench varies, and how.

use crate::gpu::backend::BackendChoice;
use crate::options::ShadeOptions;
use serde::Serialize;
use std::path::PathBuf;

/// Quantity that the bench varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BenchKind {
    /// 1 to 64 point lights on four meshes.
    Lights,
    /// 1 to 32 assets that share the same pixels, on two meshes.
    Materials,
    /// The share of the picture that shows assets: a shoe with three from farther and farther away.
    Coverage,
    /// The picture's size.
    Resolution,
    /// Residual components.
    Components,
    /// The decoder without its short cuts, one by one.
    Ablations,
    /// Triangles: a model placed ever more often, under sun and sky with one ray each.
    Triangles,
    /// Error against the path-traced picture over time, for every setting of the dials; and of the modes of a live
    /// leaf.
    Trade,
    /// Lawn, grove and forest of volumetric textures, from afar, nearer and from close by.
    Landscapes,
}

impl BenchKind {
    /// Returns the name of the bench as the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            BenchKind::Lights => "lights",
            BenchKind::Materials => "materials",
            BenchKind::Coverage => "coverage",
            BenchKind::Resolution => "resolution",
            BenchKind::Components => "components",
            BenchKind::Ablations => "ablations",
            BenchKind::Triangles => "triangles",
            BenchKind::Trade => "trade",
            BenchKind::Landscapes => "landscapes",
        }
    }
}

/// Parameters of a bench.
#[derive(Debug, Clone)]
pub struct BenchParams {
    /// Quantity that the bench varies.
    pub kind: BenchKind,
    /// For `triangles`, and for `resolution` where it is given: the model that is placed.
    pub mesh: Option<PathBuf>,
    /// Width and height of the picture, pixels, where the size is not what is varied.
    pub size: [u32; 2],
    /// Which renderer.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// Shading options of all pictures; the bench changes the one that it varies.
    pub shade: ShadeOptions,
}
