//! Description of an asset's contents: for `info`, for the report, and for anyone who wants to know where the bytes go.

use crate::error::FitError;
use crate::input::layer_frame::side_of_layer;
use crate::inspect::load::resident_in_parallel;
use crate::inspect::lobe_use::LobeUse;
use crate::inspect::sections::{SectionSize, section_sizes};
use crate::params::Role;
use crate::provenance::Material;
use btf_capture::text_from_bytes;
use btf_runtime::{Asset, Heights, Layer, LobeFamily, ResidualKind, SectionEntry, SectionKind, read_directory};
use serde::Serialize;
use std::fmt::{self, Display};

/// Contents of an asset. The names are the keys of `info --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Description {
    /// Bytes that were read.
    pub bytes: u64,
    /// Bytes of the whole asset; more than `bytes` where only a tier was read.
    pub whole_bytes: u64,
    /// Bytes that a decoder holds once the asset is loaded.
    pub resident_bytes: u64,
    /// Format version.
    pub version: u32,
    /// Texels per row.
    pub width: usize,
    /// Number of rows of texels.
    pub height: usize,
    /// Physical width and height in millimetres, where known.
    pub size_mm: Option<[f32; 2]>,
    /// Width and height of each level, the finest first.
    pub levels: Vec<[usize; 2]>,
    /// Prefixes of the file that are assets of their own, the last the whole file.
    pub tiers: Vec<TierDescription>,
    /// Sizes by kind of section, all layers, in the order of the file.
    pub sections: Vec<SectionSize>,
    /// The asset's layers.
    pub layers: Vec<LayerDescription>,
    /// The asset's own description.
    pub material: Material,
}

/// A prefix of the file that is an asset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TierDescription {
    /// Length of the prefix.
    pub bytes: u64,
    /// Residual components of the first layer that the prefix holds; `None` for lobes without residual.
    pub components: Option<usize>,
}

/// Contents of a layer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LayerDescription {
    /// Side: `front`, `back`, `transmission-back` or `transmission-front`.
    pub side: String,
    /// Number of view directions.
    pub views: usize,
    /// Number of light directions.
    pub lights: usize,
    /// Number of clusters.
    pub clusters: usize,
    /// Lobes in all dictionaries.
    pub dictionary_lobes: usize,
    /// Number of lobes, their role and their bytes.
    #[serde(flatten)]
    pub lobe_use: LobeUse,
    /// Largest number of lobes that a texel refers to: its own, or its cluster's where lobes guide.
    pub lobes_per_texel_max: usize,
    /// Histogram of the lobes per texel: numbers of texels with 0, 1, 2, ... lobes.
    pub lobe_counts: Vec<u64>,
    /// Use of each lobe family that occurs.
    pub families: Vec<FamilyUse>,
    /// Curve of the residual: `additive`, `log`, `root`, or `none`.
    pub residual: String,
    /// Number of residual components.
    pub components: usize,
    /// Bases that all clusters share.
    pub shared_bases: usize,
    /// Ranks `[view, light]` of the factored bases, per channel (grey, red-blue, green-magenta).
    pub ranks: [[usize; 2]; 3],
    /// Least and greatest height, texel widths; `null` without heights.
    pub heights: Option<[f32; 2]>,
}

/// Use of one lobe family in an asset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyUse {
    /// The family's name.
    pub family: &'static str,
    /// Lobes of this family in the dictionaries.
    pub dictionary: usize,
    /// References from texels to lobes of this family.
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
        let count = |kind: SectionKind| {
            let of_kind = directory.sections.iter().filter(move |entry| entry.kind == kind as u32 && entry.layer == 0);
            of_kind.filter(|entry| entry.offset + entry.length <= length).count()
        };
        // Bases alone, by which coefficients are predicted, are no residual.
        let has_residual = count(SectionKind::Factors) + count(SectionKind::FactorCodes) > 0;
        let components = count(SectionKind::Basis).checked_sub(1).filter(|_| has_residual);
        TierDescription { bytes: length.into(), components }
    });
    Ok(Description {
        bytes: bytes.len() as u64,
        whole_bytes: directory.tiers.last().copied().unwrap_or(0).into(),
        resident_bytes: 4 * resident_in_parallel(&asset).words().len() as u64,
        version: directory.head.version,
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
        layers: (0..asset.layers.len())
            .map(|number| describe_layer(&asset.layers[number..=number], number, &directory.sections))
            .collect(),
        material: Material::from_asset(&asset)?,
    })
}

/// Returns the name of a lobe family as people write it.
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

/// Describes layer `number` of an asset, which is the only one in `layers`.
fn describe_layer(layers: &[Layer], number: usize, sections: &[SectionEntry]) -> LayerDescription {
    let layer = &layers[0];
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
        lights: layer.lights.distinct(),
        clusters: layer.dictionary.len(),
        dictionary_lobes: dictionary.iter().sum(),
        lobe_use: LobeUse::of(layers, number, sections),
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
    /// Writes what `info` prints.
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
                if record.missing > 0 {
                    let pairs = layer.views * layer.lights;
                    writeln!(f, "            {} of {pairs} pairs had no image and are predicted", record.missing)?;
                }
            }
            writeln!(f, "  clusters  {} with {} lobes", layer.clusters, layer.dictionary_lobes)?;
            writeln!(f, "  lobes     {}; at most {}", layer.lobe_use, layer.lobes_per_texel_max)?;
            for family in &layer.families {
                write!(f, "            {:18} {:5} in dictionaries", family.family, family.dictionary)?;
                match layer.lobe_use.role {
                    Role::Base => writeln!(f, " {:9} in texels", family.texels)?,
                    Role::Guide => writeln!(f)?,
                }
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
            let (db, linear_db) = (error.psnr_db, error.psnr_linear_db);
            writeln!(f, "  psnr {db:.2} dB ({}), {linear_db:.2} dB (linear)", error.coded_as())?;
            write!(f, "  relative RMSE {:.4}, worst texel RMSE {:.4}", error.rel_rmse, error.worst_texel_rmse)?;
            if let Some(delta_e) = error.delta_e00_mean {
                write!(f, ", CIEDE2000 {delta_e:.2}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::provenance::FitRecord;
    use crate::sample_asset::sample_asset;
    use btf_runtime::{Resident, pack};

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
        assert_eq!(refs as f64, layer.lobe_use.per_texel_mean * 15.0);
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
}
