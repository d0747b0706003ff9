//! Description of a volumetric texture's file: for `info`.

use crate::error::FitError;
use crate::inspect::load::{parallel, read_file};
use crate::inspect::sections::{SectionSize, section_sizes};
use btf_capture::text_from_bytes;
use btf_runtime::voltex::{
    MicroflakeMaterial, VOLTEX_VERSION, Voltex, VoltexSection, Volume, VolumeLevel, level_of_brick,
    read_voltex_directory,
};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::Path;

/// Contents of a volumetric texture. The names are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VoltexDescription {
    /// Always `voltex`.
    pub form: &'static str,
    /// Bytes that were read.
    pub bytes: u64,
    /// Bytes of the whole file; more than `bytes` where only a tier was read.
    pub whole_bytes: u64,
    /// Bytes that a decoder holds once the volume is loaded.
    pub resident_bytes: u64,
    /// Format version.
    pub version: u32,
    /// Metres per side of the unit cube.
    pub side_m: f32,
    /// Part of the unit cube that is used.
    pub extent: [f32; 3],
    /// Part of the cube that is used, in metres.
    pub extent_m: [f32; 3],
    /// Whether the volume repeats in x and in y.
    pub cyclic: [bool; 2],
    /// Number of voxels of all levels that were read.
    pub voxels: usize,
    /// Levels that were read, finest first.
    pub levels: Vec<LevelDescription>,
    /// Prefixes of the file that are volumes of their own, the last the whole file.
    pub tiers: Vec<VoltexTier>,
    /// Sizes by kind of section, in the order of the file.
    pub sections: Vec<SectionSize>,
    /// Materials of the microflakes, with the number of voxels of each.
    pub materials: Vec<MaterialUse>,
    /// The volume's own description; `null` where it is not JSON.
    pub description: serde_json::Value,
}

/// Contents of a level.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelDescription {
    /// Voxels along a side.
    pub side: u32,
    /// Voxels that are not empty.
    pub voxels: usize,
    /// Voxels with microflakes of two sorts.
    pub of_two_sorts: usize,
    /// Bytes of the level's sections.
    pub bytes: u64,
    /// Distance from the microflakes at which rays to the light begin, in voxels.
    pub shadow_offset: f32,
    /// Share of the gaps that eye and light have in common, at angles of 0 to 180 degrees between them.
    pub shadow_shared: [f32; 10],
    /// Entries xx, yy, zz, xy, xz, yz of the clumping matrix C: along a unit vector d, optical depths are `exp(d' C d)`
    /// times those of microflakes at random places.
    pub clumping: [f32; 6],
}

/// A prefix of the file that is a volume.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VoltexTier {
    /// Length of the prefix.
    pub bytes: u64,
    /// Voxels along a side of the finest level in the prefix.
    pub side: u32,
}

/// A material and its use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialUse {
    /// Share of light that leaves on the side where it came from.
    pub reflectance: [f32; 3],
    /// Share of light that leaves on the other side.
    pub transmittance: [f32; 3],
    /// Reflectance of the smooth surface at normal incidence.
    pub specular: f32,
    /// Roughness of the smooth surface.
    pub roughness: f32,
    /// Number of voxels of all levels that were read.
    pub voxels: usize,
}

/// Tells whether a file is a volumetric texture: by its first bytes, or else by its name.
pub(crate) fn is_voltex(path: &Path, bytes: &[u8]) -> bool {
    Volume::is_one(bytes) || path.extension().is_some_and(|extension| extension == "voltex")
}

/// Reads a volumetric texture: its bytes and what is in them. `None` if the file is something else.
///
/// # Errors
/// If it cannot be read or is no good volume; the message names the file.
pub fn load_voltex(path: &Path) -> Result<Option<(Vec<u8>, Volume)>, FitError> {
    let bytes = read_file(path)?;
    if !is_voltex(path, &bytes) {
        return Ok(None);
    }
    let volume =
        Volume::parse_on(&bytes, &parallel).map_err(|source| FitError::Volume { path: path.to_path_buf(), source })?;
    Ok(Some((bytes, volume)))
}

/// Describes the volumetric texture in `bytes`, or the tier of one.
///
/// # Errors
/// A fault of the bytes, as [`Volume::parse`].
pub fn describe_voltex(bytes: &[u8]) -> Result<VoltexDescription, FitError> {
    let volume = Volume::parse_on(bytes, &parallel)?;
    let directory = read_voltex_directory(bytes)?;
    let kind_name = |kind| VoltexSection::from_number(kind).map(|kind| format!("{kind:?}"));
    let level_bytes = |index: usize| {
        let is_own = |entry: &&btf_runtime::SectionEntry| match VoltexSection::from_number(entry.kind) {
            Some(VoltexSection::Level) => entry.index as usize == index,
            Some(VoltexSection::Brick) => level_of_brick(entry.index) as usize == index,
            _ => false,
        };
        directory.sections.iter().filter(is_own).map(|entry| u64::from(entry.length)).sum()
    };
    let describe_level = |(number, level): (usize, &VolumeLevel)| {
        let index = volume.levels.len() - 1 - number;
        LevelDescription {
            side: 1 << index,
            voxels: level.voxels.len(),
            of_two_sorts: level.others.len(),
            bytes: level_bytes(index),
            shadow_offset: level.shadow.offset,
            shadow_shared: level.shadow.shared,
            clumping: level.clumping.0,
        }
    };
    let mut voxels_of = vec![0; volume.materials.len()];
    volume.levels.iter().flat_map(VolumeLevel::microflakes).for_each(|voxel| voxels_of[voxel.material as usize] += 1);
    let ends_in = |length: u32| {
        let within = |entry: &&btf_runtime::SectionEntry| entry.offset + entry.length <= length;
        directory.sections.iter().filter(within).filter(|entry| entry.kind == VoltexSection::Level as u32).count()
    };
    Ok(VoltexDescription {
        form: "voltex",
        bytes: bytes.len() as u64,
        whole_bytes: directory.tiers.last().copied().unwrap_or(0).into(),
        resident_bytes: 4 * Voltex::new(&volume).words().len() as u64,
        version: VOLTEX_VERSION,
        side_m: volume.side_m,
        extent: volume.extent,
        extent_m: volume.extent.map(|x| x * volume.side_m),
        cyclic: volume.cyclic,
        voxels: volume.levels.iter().map(|level| level.voxels.len()).sum(),
        levels: volume.levels.iter().enumerate().map(describe_level).collect(),
        tiers: directory
            .tiers
            .iter()
            .map(|tier| VoltexTier { bytes: (*tier).into(), side: 1 << ends_in(*tier).saturating_sub(1) })
            .collect(),
        sections: section_sizes(&directory.sections, bytes.len(), kind_name),
        materials: volume.materials.iter().zip(voxels_of).map(|(material, voxels)| use_of(material, voxels)).collect(),
        description: serde_json::from_str(&volume.description).unwrap_or_default(),
    })
}

fn use_of(material: &MicroflakeMaterial, voxels: usize) -> MaterialUse {
    let MicroflakeMaterial { reflectance, transmittance, specular, roughness } = *material;
    MaterialUse { reflectance, transmittance, specular, roughness, voxels }
}

/// Materials that are printed at most.
const MAX_PRINTED: usize = 8;

impl Display for VoltexDescription {
    /// Writes what `info` prints.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.description["name"].as_str().filter(|name| !name.is_empty()).unwrap_or("(none)");
        writeln!(f, "name        {name}")?;
        let [x, y, z] = self.extent_m;
        let cyclic = match self.cyclic {
            [true, true] => ", repeated in x and y",
            [true, false] => ", repeated in x",
            [false, true] => ", repeated in y",
            [false, false] => "",
        };
        writeln!(f, "extent      {x} x {y} x {z} m of a cube of {} m{cyclic}", self.side_m)?;
        let cut = if self.bytes < self.whole_bytes {
            format!(", a tier of {}", text_from_bytes(self.whole_bytes))
        } else {
            String::new()
        };
        writeln!(f, "size        {} ({} bytes{cut})", text_from_bytes(self.bytes), self.bytes)?;
        writeln!(f, "loaded      {} in the decoder's memory", text_from_bytes(self.resident_bytes))?;
        writeln!(f, "format      volumetric texture, version {}", self.version)?;
        let per_voxel = self.bytes as f64 / self.voxels as f64;
        writeln!(f, "voxels      {}, {per_voxel:.2} bytes each\n", self.voxels)?;
        writeln!(f, "levels      side    voxels  two sorts     bytes")?;
        for level in &self.levels {
            writeln!(f, "        {:>8} {:>9} {:>10} {:>9}", level.side, level.voxels, level.of_two_sorts, level.bytes)?;
        }
        writeln!(f, "\nsections")?;
        for section in &self.sections {
            writeln!(f, "  {:<16} {:>3} {:>9} bytes", section.kind, section.count, section.bytes)?;
        }
        writeln!(f, "\nmaterials   reflectance            transmittance          specular  roughness  voxels")?;
        let rgb = |[r, g, b]: [f32; 3]| format!("{r:.3} {g:.3} {b:.3}");
        for (number, material) in self.materials.iter().enumerate().take(MAX_PRINTED) {
            let (reflectance, transmittance) = (rgb(material.reflectance), rgb(material.transmittance));
            writeln!(
                f,
                "  {number:<8}  {reflectance:<21}  {transmittance:<21}  {:<8.3}  {:<9.3}  {}",
                material.specular, material.roughness, material.voxels
            )?;
        }
        if self.materials.len() > MAX_PRINTED {
            writeln!(f, "  and {} more, which --json lists", self.materials.len() - MAX_PRINTED)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::describe_file::describe_file;
    use btf_runtime::testing::sample_volume;

    #[test]
    fn the_description_counts_what_is_there() {
        let volume = sample_volume(3, 5, 80);
        let bytes = volume.pack().unwrap();
        let found = describe_voltex(&bytes).unwrap();
        assert_eq!((found.bytes, found.whole_bytes), (bytes.len() as u64, bytes.len() as u64));
        assert_eq!(found.levels.iter().map(|level| level.side).collect::<Vec<_>>(), [16, 8, 4, 2, 1]);
        assert_eq!(found.voxels, volume.levels.iter().map(|level| level.voxels.len()).sum::<usize>());
        let others: usize = found.levels.iter().map(|level| level.of_two_sorts).sum();
        assert_eq!(others, volume.levels.iter().map(|level| level.others.len()).sum::<usize>());
        assert_eq!(found.materials.iter().map(|material| material.voxels).sum::<usize>(), found.voxels + others);
        let of_levels: u64 = found.levels.iter().map(|level| level.bytes).sum();
        assert_eq!(found.sections.iter().find(|size| size.kind == "Level").unwrap().bytes, of_levels);
        assert_eq!(found.extent_m, [volume.side_m, 0.75 * volume.side_m, 0.5 * volume.side_m]);
        assert_eq!(found.tiers.iter().map(|tier| tier.side).collect::<Vec<_>>(), [1, 2, 4, 8, 16]);
        let text = found.to_string();
        assert!(text.contains("sample") && text.contains("Materials"), "{text}");
        // A tier is what it is.
        let tier = describe_voltex(&bytes[..found.tiers[2].bytes as usize]).unwrap();
        assert_eq!((tier.levels.len(), tier.levels[0].side, tier.whole_bytes), (3, 4, found.bytes));
        assert!(tier.to_string().contains("a tier of"), "{tier}");
    }

    #[test]
    fn a_file_is_told_by_its_bytes_or_its_name_and_messages_name_it() {
        let folder = tempfile::tempdir().unwrap();
        let (good, junk) = (folder.path().join("grass"), folder.path().join("junk.voltex"));
        std::fs::write(&good, sample_volume(1, 3, 9).pack().unwrap()).unwrap();
        std::fs::write(&junk, b"junk").unwrap();
        assert_eq!(serde_json::to_value(describe_file(&good).unwrap()).unwrap()["form"], "voltex");
        let message = describe_file(&junk).unwrap_err().to_string();
        assert!(message.contains("junk.voltex") && message.contains("not a volumetric texture"), "{message}");
        assert!(!message.contains('\n'));
    }
}
