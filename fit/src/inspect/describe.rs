//! What is in an asset: for `info`, for the report, and for anyone who wants to know where the bytes go.

use crate::error::FitError;
use crate::inspect::describe_voltex::{VoltexDescription, describe_voltex, is_voltex};
use crate::provenance::{Material, side_of_layer, sides_of_capture};
use crate::units::text_from_bytes;
use btf_capture::Side;
use btf_runtime::{
    Asset, Heights, Layer, LobeFamily, Resident, ResidentFile, ResidualKind, SectionEntry, SectionKind, SurfaceSide,
    VERSION, read_directory,
};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::Path;
use std::sync::Arc;

/// What is in an asset. The names are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Description {
    /// Bytes at hand.
    pub bytes: u64,
    /// Bytes of the whole asset; more than `bytes` where only a tier is at hand.
    pub whole_bytes: u64,
    /// Bytes that a decoder holds once the asset is loaded.
    pub resident_bytes: u64,
    /// Format version.
    pub version: u32,
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Physical width and height in millimetres, where known.
    pub size_mm: Option<[f32; 2]>,
    /// Width and height of each level, the finest first.
    pub levels: Vec<[usize; 2]>,
    /// Prefixes of the file that are assets of their own, the last the whole file.
    pub tiers: Vec<TierDescription>,
    /// Sizes by kind of section, all layers, in the order of the file.
    pub sections: Vec<SectionSize>,
    /// Layers.
    pub layers: Vec<LayerDescription>,
    /// The asset's own description.
    pub material: Material,
}

/// A prefix of the file that is an asset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TierDescription {
    /// Length of the prefix.
    pub bytes: u64,
    /// Residual components of the first layer that it reaches; `None` for lobes without residual.
    pub components: Option<usize>,
}

/// Bytes of one kind of section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SectionSize {
    /// The kind's name in format.md.
    pub kind: String,
    /// How many there are.
    pub count: usize,
    /// Bytes of all of them, without padding.
    pub bytes: u64,
}

/// What is in a layer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LayerDescription {
    /// `front`, `back`, `transmission-back` or `transmission-front`.
    pub side: String,
    /// Number of view directions.
    pub views: usize,
    /// Number of light directions.
    pub lights: usize,
    /// Clusters.
    pub clusters: usize,
    /// Lobes in all dictionaries.
    pub dictionary_lobes: usize,
    /// Mean number of lobes of a texel.
    pub lobes_per_texel_mean: f64,
    /// Largest number of lobes of a texel.
    pub lobes_per_texel_max: usize,
    /// How many texels have 0, 1, 2, ... lobes.
    pub lobe_counts: Vec<u64>,
    /// Use of each lobe family that occurs.
    pub families: Vec<FamilyUse>,
    /// `additive`, `log`, `root`, or `none`.
    pub residual: String,
    /// Residual components.
    pub components: usize,
    /// Bases that all clusters share.
    pub shared_bases: usize,
    /// Ranks `[view, light]` of the factored bases, per channel (grey, red-blue, green-magenta).
    pub ranks: [[usize; 2]; 3],
    /// Least and greatest height, texel widths; `null` without heights.
    pub heights: Option<[f32; 2]>,
}

/// How often a lobe family occurs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyUse {
    /// The family's name.
    pub family: &'static str,
    /// Lobes of this family in the dictionaries.
    pub dictionary: usize,
    /// References to them from texels.
    pub texels: usize,
}

/// Describes the asset in `bytes`, or the tier of one.
///
/// # Errors
/// What is wrong with the bytes, as [`Asset::parse`]; a description that is not understood.
pub fn describe(bytes: &[u8]) -> Result<Description, FitError> {
    let asset = Asset::parse(bytes)?;
    let directory = read_directory(bytes)?;
    let tiers = directory.tiers.iter().map(|&length| {
        let bases = directory.sections.iter().filter(|entry| {
            entry.kind == SectionKind::Basis as u32 && entry.layer == 0 && entry.offset + entry.length <= length
        });
        TierDescription { bytes: length.into(), components: bases.count().checked_sub(1) }
    });
    Ok(Description {
        bytes: bytes.len() as u64,
        whole_bytes: directory.tiers.last().copied().unwrap_or(0).into(),
        resident_bytes: 4 * resident_in_parallel(&asset).words().len() as u64,
        version: VERSION,
        width: asset.width,
        height: asset.height,
        size_mm: asset.size_mm,
        levels: std::iter::once([asset.width, asset.height])
            .chain(asset.levels.iter().map(|level| [level.width, level.height]))
            .collect(),
        tiers: tiers.collect(),
        sections: section_sizes(&directory.sections, bytes.len(), |kind| {
            SectionKind::from_number(kind).map(|kind| format!("{kind:?}"))
        }),
        layers: asset.layers.iter().map(describe_layer).collect(),
        material: Material::from_asset(&asset)?,
    })
}

/// Sizes by kind of the sections that are at hand, in their order.
pub(crate) fn section_sizes(
    entries: &[SectionEntry],
    bytes: usize,
    kind_name: impl Fn(u32) -> Option<String>,
) -> Vec<SectionSize> {
    let mut sections: Vec<SectionSize> = Vec::new();
    for entry in entries.iter().filter(|entry| (entry.offset as usize) < bytes) {
        let kind = kind_name(entry.kind).unwrap_or(format!("kind {}", entry.kind));
        let at = sections.iter().position(|size| size.kind == kind).unwrap_or_else(|| {
            sections.push(SectionSize { kind, count: 0, bytes: 0 });
            sections.len() - 1
        });
        sections[at].count += 1;
        sections[at].bytes += u64::from(entry.length);
    }
    sections
}

/// Work of the runtime on all threads of the pool.
pub(crate) fn parallel(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// The resident form, its clusters expanded on all threads of the pool.
pub fn resident_in_parallel(asset: &Asset) -> Resident {
    Resident::from_asset_on(asset, &parallel)
}

/// What is in an asset's resident form. The names are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidentDescription {
    /// `resident`.
    pub form: &'static str,
    /// Bytes of the file.
    pub bytes: u64,
    /// Format version.
    pub version: u32,
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Physical width and height in millimetres, where known.
    pub size_mm: Option<[f32; 2]>,
    /// Width and height of each level, the finest first.
    pub levels: Vec<[u32; 2]>,
    /// Sides of its layers, in order.
    pub layers: Vec<String>,
    /// Residual components of the layer that has most.
    pub components: u32,
    /// Lobes of the texel that has most.
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
    let file = ResidentFile::open(Arc::new(bytes), &parallel)?;
    let resident = &file.resident;
    Ok(ResidentDescription {
        form: "resident",
        bytes: length,
        version: VERSION,
        width: resident.width(),
        height: resident.height(),
        size_mm: file.size_mm,
        levels: (0..resident.levels()).map(|level| resident.size(level * resident.layers())).collect(),
        layers: sides_of_resident(resident).iter().map(ToString::to_string).collect(),
        components: resident.most_components(),
        lobes: resident.most_lobes(),
        material: Material::from_text(&file.material)?,
    })
}

impl Display for ResidentDescription {
    /// What `info` prints.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = if self.material.name.is_empty() { "(none)" } else { &self.material.name };
        let size = self.size_mm.map_or(String::new(), |[w, h]| format!(", {w} x {h} mm"));
        writeln!(f, "name        {name}")?;
        writeln!(f, "texels      {} x {}{size}", self.width, self.height)?;
        writeln!(f, "form        resident, {} ({} bytes)", text_from_bytes(self.bytes), self.bytes)?;
        writeln!(f, "format      version {}", self.version)?;
        writeln!(f, "levels      {}", self.levels.len())?;
        writeln!(f, "layers      {}", self.layers.join(", "))?;
        writeln!(f, "residual    {} components", self.components)?;
        write!(f, "lobes       at most {} a texel", self.lobes)
    }
}

/// What the layers' sides are, in order.
pub(crate) fn sides_of_resident(resident: &Resident) -> Vec<Side> {
    let mut sides: Vec<(u32, Side)> = Vec::new();
    for side in Side::ALL {
        let (light, view) = sides_of_capture(side);
        let back = |of: SurfaceSide| of == SurfaceSide::Back;
        sides.extend(resident.layer_for_sides(0, back(light), back(view)).map(|layer| (layer, side)));
    }
    sides.sort_by_key(|(layer, _)| *layer);
    sides.into_iter().map(|(_, side)| side).collect()
}

/// The name of a lobe family as people write it.
pub fn family_name(family: LobeFamily) -> &'static str {
    match family {
        LobeFamily::Lambertian => "Lambertian",
        LobeFamily::OrenNayar => "Oren-Nayar",
        LobeFamily::BlinnPhong => "Blinn-Phong",
        LobeFamily::Ward => "Ward",
        LobeFamily::CookTorrance => "Cook-Torrance",
        LobeFamily::Lafortune => "Lafortune",
        LobeFamily::AshikhminShirley => "Ashikhmin-Shirley",
        LobeFamily::Ggx => "GGX",
        LobeFamily::WindowedCosine => "windowed cosine",
    }
}

fn describe_layer(layer: &Layer) -> LayerDescription {
    let mut lobe_counts = vec![0; layer.most_lobes() + 1];
    layer.texel_lobe_counts.iter().for_each(|count| lobe_counts[usize::from(*count)] += 1);
    let mut dictionary = [0; LobeFamily::ALL.len()];
    let mut texels = [0; LobeFamily::ALL.len()];
    layer.dictionary.iter().flatten().for_each(|entry| dictionary[entry.lobe.family as usize] += 1);
    let mut refs = layer.lobe_refs.iter();
    for (cluster, count) in layer.texel_clusters.iter().zip(&layer.texel_lobe_counts) {
        for reference in refs.by_ref().take(usize::from(*count)) {
            let entry = layer.dictionary[usize::from(*cluster)][usize::from(reference.lobe)];
            texels[entry.lobe.family as usize] += 1;
        }
    }
    let residual = layer.residual.as_ref();
    LayerDescription {
        side: side_of_layer(layer).to_string(),
        views: layer.views.len(),
        lights: layer.lights.len(),
        clusters: layer.dictionary.len(),
        dictionary_lobes: dictionary.iter().sum(),
        lobes_per_texel_mean: layer.lobe_refs.len() as f64 / layer.texel_clusters.len().max(1) as f64,
        lobes_per_texel_max: layer.most_lobes(),
        lobe_counts,
        families: LobeFamily::ALL
            .into_iter()
            .map(|family| FamilyUse {
                family: family_name(family),
                dictionary: dictionary[family as usize],
                texels: texels[family as usize],
            })
            .filter(|used| used.dictionary > 0)
            .collect(),
        residual: match (residual, layer.residual_kind) {
            (None, _) => "none",
            (_, ResidualKind::Additive) => "additive",
            (_, ResidualKind::Log) => "log",
            (_, ResidualKind::Root) => "root",
        }
        .into(),
        components: residual.map_or(0, |residual| residual.coefficients.len()),
        shared_bases: residual.map_or(0, |residual| residual.shared.steps.len()),
        ranks: residual.map_or([[0; 2]; 3], |residual| residual.factors.ranks),
        heights: layer.heights.as_ref().map(Heights::range),
    }
}

impl Display for Description {
    /// What `info` prints.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let material = &self.material;
        writeln!(f, "name        {}", if material.name.is_empty() { "(none)" } else { &material.name })?;
        let size = self.size_mm.map_or(String::new(), |[w, h]| format!(", {w} x {h} mm"));
        writeln!(f, "texels      {} x {}{size}", self.width, self.height)?;
        let cut = if self.bytes < self.whole_bytes {
            format!(", a tier of {}", text_from_bytes(self.whole_bytes))
        } else {
            String::new()
        };
        writeln!(f, "size        {} ({} bytes{cut})", text_from_bytes(self.bytes), self.bytes)?;
        if let [_, .., [width, height]] = self.levels[..] {
            writeln!(f, "levels      {}, the coarsest {width} x {height}", self.levels.len())?;
        }
        writeln!(f, "loaded      {} in the decoder's memory", text_from_bytes(self.resident_bytes))?;
        writeln!(f, "format      version {}", self.version)?;
        for (number, layer) in self.layers.iter().enumerate() {
            writeln!(f, "\nlayer {number}: {}, {} views x {} lights", layer.side, layer.views, layer.lights)?;
            if let Some(record) = material.layers.get(number).map(|layer| &layer.capture) {
                write!(f, "  capture   {}", if record.name.is_empty() { "(no name)" } else { &record.name })?;
                writeln!(
                    f,
                    ", {}, curve {}, cosine {}, scale {}",
                    record.format, record.transfer, record.cosine, record.scale
                )?;
            }
            writeln!(f, "  clusters  {} with {} lobes", layer.clusters, layer.dictionary_lobes)?;
            writeln!(
                f,
                "  lobes     {:.2} per texel, at most {}",
                layer.lobes_per_texel_mean, layer.lobes_per_texel_max
            )?;
            for family in &layer.families {
                writeln!(
                    f,
                    "            {:18} {:5} in dictionaries {:9} in texels",
                    family.family, family.dictionary, family.texels
                )?;
            }
            write!(f, "  residual  {}, {} components", layer.residual, layer.components)?;
            if layer.components > 0 {
                write!(f, " mixed from {} shared bases, ranks {:?}", layer.shared_bases, layer.ranks)?;
            }
            writeln!(f)?;
            if let Some([least, most]) = layer.heights {
                writeln!(f, "  heights   {least:.1} to {most:.1} texel widths")?;
            }
        }
        writeln!(f, "\nsections")?;
        for section in &self.sections {
            writeln!(f, "  {:16} {:4} x {:>12} bytes in all", section.kind, section.count, section.bytes)?;
        }
        writeln!(f, "\ntiers")?;
        for tier in &self.tiers {
            let what = match tier.components {
                None => "lobes only".to_string(),
                Some(0) => "the residual's mean".to_string(),
                Some(1) => "1 component".to_string(),
                Some(n) => format!("{n} components"),
            };
            writeln!(f, "  {:>12} bytes  {what}", tier.bytes)?;
        }
        if let Some(error) = &material.error {
            writeln!(f, "\nerror of the whole asset against its capture")?;
            writeln!(f, "  psnr {:.2} dB (8-bit), {:.2} dB (linear)", error.psnr_db, error.psnr_linear_db)?;
            write!(f, "  relative RMSE {:.4}, worst texel RMSE {:.4}", error.rel_rmse, error.worst_texel_rmse)?;
            if let Some(delta_e) = error.delta_e00_mean {
                write!(f, ", CIEDE2000 {delta_e:.2}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

/// Reads and checks an asset file: its bytes and what is in them.
///
/// # Errors
/// If it cannot be read or is no good asset; the message names the file.
pub fn load_asset(path: &Path) -> Result<(Vec<u8>, Asset), FitError> {
    let bytes = read_file(path)?;
    let asset = Asset::parse(&bytes).map_err(|source| FitError::Asset { path: path.to_path_buf(), source })?;
    Ok((bytes, asset))
}

/// What is in a file, an asset's in either form or a volumetric texture's.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum FileDescription {
    /// The file form.
    File(Box<Description>),
    /// The resident form.
    Resident(Box<ResidentDescription>),
    /// A volumetric texture.
    Voltex(Box<VoltexDescription>),
}

impl Display for FileDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FileDescription::File(description) => description.fmt(f),
            FileDescription::Resident(description) => description.fmt(f),
            FileDescription::Voltex(description) => description.fmt(f),
        }
    }
}

/// [`describe`], [`describe_resident`] or [`describe_voltex`] of a file.
///
/// # Errors
/// As they, or if it cannot be read; the message names the file.
pub fn describe_file(path: &Path) -> Result<FileDescription, FitError> {
    let bytes = read_file(path)?;
    let described = if is_voltex(path, &bytes) {
        describe_voltex(&bytes).map(|description| FileDescription::Voltex(Box::new(description)))
    } else if ResidentFile::is_one(&bytes) {
        describe_resident(bytes).map(|description| FileDescription::Resident(Box::new(description)))
    } else {
        describe(&bytes).map(|description| FileDescription::File(Box::new(description)))
    };
    described.map_err(|error| with_path(path, error))
}

/// The same error with the name of the asset that it is about.
pub fn with_path(path: &Path, error: FitError) -> FitError {
    match error {
        FitError::Pack(source) => FitError::Asset { path: path.to_path_buf(), source },
        FitError::PackVolume(source) => FitError::Volume { path: path.to_path_buf(), source },
        FitError::Params(text) => FitError::Params(format!("{}: {text}", path.display())),
        other => other,
    }
}

/// The bytes of an asset, not looked at.
///
/// # Errors
/// If the file cannot be read; the message names it.
pub fn read_file(path: &Path) -> Result<Vec<u8>, FitError> {
    std::fs::read(path).map_err(|source| FitError::File {
        path: path.to_path_buf(),
        action: "reading the asset",
        source,
        remedy: "check the path",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::provenance::FitRecord;
    use crate::sample_asset::sample_asset;
    use btf_runtime::pack;

    fn bytes() -> Vec<u8> {
        let material = Material { name: "felt".into(), fit: Some(FitRecord::default()), ..Material::default() };
        pack(&Asset { material: material.to_json(), ..sample_asset() }).unwrap()
    }

    #[test]
    fn the_description_counts_what_is_there() {
        let bytes = bytes();
        let found = describe(&bytes).unwrap();
        let layer = &found.layers[0];
        assert_eq!((found.width, found.height, found.bytes), (5, 3, bytes.len() as u64));
        assert_eq!((layer.views, layer.lights, layer.clusters, layer.dictionary_lobes), (7, 9, 3, 9));
        assert_eq!(layer.lobe_counts.iter().sum::<u64>(), 15);
        let refs: usize = layer.families.iter().map(|family| family.texels).sum();
        assert_eq!(refs as f64, layer.lobes_per_texel_mean * 15.0);
        // Every dictionary has the same three families and every texel takes its lobes from the front.
        assert!(layer.families[0].texels > layer.families[2].texels);
        assert_eq!(layer.shared_bases, 5);
        assert_eq!(found.resident_bytes, 4 * Resident::from_asset(&Asset::parse(&bytes).unwrap()).words().len() as u64);
        let components: Vec<_> = found.tiers.iter().map(|tier| tier.components).collect();
        assert_eq!(components, [None, Some(0), Some(1), Some(2), Some(3)]);
        let text = found.to_string();
        assert!(text.contains("felt") && text.contains("windowed cosine") && !text.contains("Oren-Nayar"), "{text}");
    }

    #[test]
    fn heights_are_described_where_there_are_any() {
        let mut asset = Asset::parse(&bytes()).unwrap();
        let described = |asset: &Asset| describe(&pack(asset).unwrap()).unwrap();
        assert_eq!(described(&asset).layers[0].heights, None);
        let codes = (0..asset.texel_count()).map(|texel| texel as i8 - 4).collect();
        asset.layers[0].heights = Some(Heights { step: 0.5, codes });
        let found = described(&asset);
        assert_eq!(found.layers[0].heights, Some([-2.0, 5.0]));
        assert!(found.to_string().contains("-2.0 to 5.0 texel widths"), "{found}");
    }

    #[test]
    fn a_tier_is_described_as_what_it_is() {
        let bytes = bytes();
        let whole = describe(&bytes).unwrap();
        let tier = describe(&bytes[..whole.tiers[2].bytes as usize]).unwrap();
        assert_eq!((tier.layers[0].components, tier.whole_bytes), (1, whole.bytes));
        assert!(tier.sections.iter().map(|s| s.bytes).sum::<u64>() < whole.sections.iter().map(|s| s.bytes).sum());
        let lobes = describe(&bytes[..whole.tiers[0].bytes as usize]).unwrap();
        assert_eq!(lobes.layers[0].residual, "none");
    }

    #[test]
    fn a_message_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let (absent, junk) = (folder.path().join("absent.spmm"), folder.path().join("junk.spmm"));
        std::fs::write(&junk, b"junk").unwrap();
        let nameless = folder.path().join("nameless.spmm");
        std::fs::write(&nameless, pack(&Asset { material: "[]x".into(), ..sample_asset() }).unwrap()).unwrap();
        for (path, name) in [(&absent, "absent.spmm"), (&junk, "junk.spmm"), (&nameless, "nameless.spmm")] {
            let message = describe_file(path).unwrap_err().to_string();
            assert!(message.contains(name) && !message.contains('\n'), "{message}");
        }
        assert!(load_asset(&junk).unwrap_err().to_string().contains("junk.spmm"));
        std::fs::write(&junk, bytes()).unwrap();
        assert!(load_asset(&junk).is_ok());
    }
}
