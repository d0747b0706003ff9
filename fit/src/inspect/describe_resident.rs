//! Description of an asset's resident form: for `info`.

use crate::error::FitError;
use crate::input::layer_frame::sides_of_capture;
use crate::inspect::load::parallel;
use crate::provenance::Material;
use btf_capture::{Side, text_from_bytes};
use btf_runtime::{Resident, ResidentFile, read_version};
use serde::Serialize;
use std::fmt::{self, Display};
use std::sync::Arc;

/// Contents of an asset's resident form. The names are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidentDescription {
    /// Always `resident`.
    pub form: &'static str,
    /// Bytes of the file.
    pub bytes: u64,
    /// Format version.
    pub version: u32,
    /// Texels per row.
    pub width: u32,
    /// Number of rows of texels.
    pub height: u32,
    /// Physical width and height in millimetres, where known.
    pub size_mm: Option<[f32; 2]>,
    /// Width and height of each level, the finest first.
    pub levels: Vec<[u32; 2]>,
    /// Sides of the layers, in order.
    pub layers: Vec<String>,
    /// Residual components of the layer that has most.
    pub components: u32,
    /// Whether bases are packed.
    pub packed: bool,
    /// Lobes that the texel with most of them refers to.
    pub lobes: u32,
    /// The asset's own description.
    pub material: Material,
}

/// Describes the resident form in `bytes`.
///
/// # Errors
/// As [`ResidentFile::open`]; a description that is not understood.
pub fn describe_resident(bytes: Vec<u8>) -> Result<ResidentDescription, FitError> {
    let length = bytes.len() as u64;
    let version = read_version(&bytes).unwrap_or_default();
    let file = ResidentFile::open(Arc::new(bytes), &parallel)?;
    let resident = &file.resident;
    Ok(ResidentDescription {
        form: "resident",
        bytes: length,
        version,
        width: resident.width(),
        height: resident.height(),
        size_mm: file.size_mm,
        levels: (0..resident.levels()).map(|level| resident.size(level * resident.layers())).collect(),
        layers: sides_of_resident(resident).iter().map(ToString::to_string).collect(),
        components: resident.most_components(),
        packed: (0..resident.layers()).any(|layer| resident.is_packed(layer)),
        lobes: resident.most_lobes(),
        material: Material::from_text(&file.material)?,
    })
}

impl Display for ResidentDescription {
    /// Writes what `info` prints.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = if self.material.name.is_empty() { "(none)" } else { &self.material.name };
        let size = self.size_mm.map_or(String::new(), |[w, h]| format!(", {w} x {h} mm"));
        writeln!(f, "name        {name}")?;
        writeln!(f, "texels      {} x {}{size}", self.width, self.height)?;
        writeln!(f, "form        resident, {} ({} bytes)", text_from_bytes(self.bytes), self.bytes)?;
        writeln!(f, "format      version {}", self.version)?;
        writeln!(f, "levels      {}", self.levels.len())?;
        writeln!(f, "layers      {}", self.layers.join(", "))?;
        let packed = if self.packed { ", bases packed" } else { "" };
        writeln!(f, "residual    {} components{packed}", self.components)?;
        write!(f, "lobes       at most {} looked up for a texel, its own or, as guide, its cluster's", self.lobes)
    }
}

/// Returns the sides of the layers, in order.
pub(crate) fn sides_of_resident(resident: &Resident) -> Vec<Side> {
    let mut sides: Vec<(u32, Side)> = Vec::new();
    for side in Side::ALL {
        let (light, view) = sides_of_capture(side);
        sides.extend(resident.layer_for_sides(0, light, view).map(|layer| (layer, side)));
    }
    sides.sort_by_key(|(layer, _)| *layer);
    sides.into_iter().map(|(_, side)| side).collect()
}
