//! An asset in memory, in its file form: what [`crate::pack`] writes and [`Asset::parse`] reads.

use crate::edit::{EDIT_NUMBERS, Edit, Edits, MOST_EDITS};
use crate::entropy::{Decoder, bounded, decode_plane};
use crate::error::FormatError;
use crate::format::{
    MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_DICTIONARY, MAX_RANK,
    MAX_SHARED, SectionKind, basis_words, read_directory,
};
use crate::lobe::{FILE_WORDS, Lobe};
use crate::parallax::{Heights, MOST_HEIGHT_STEP};
use crate::residual::{Basis, Coefficients, Factors, Residual, ResidualKind, SharedBases};
use crate::sphere::Sphere;
use crate::texel_coding::{code_clusters, code_counts, code_refs};
use half::f16;
use std::collections::HashMap;

/// Which side of the surface a light or an eye is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SurfaceSide {
    /// The side that the macroscopic normal points to.
    Front = 0,
    /// The other one; its directions are stored mirrored in z, so that they too have z > 0. Their x and
    /// y are the front's.
    Back = 1,
}

/// What a layer's lobes are to its residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum LobeRole {
    /// The residual is added to them: `X = g^-1(g(S) + R)`.
    Base = 0,
    /// The residual stands alone, `X = g^-1(g(0) + R)`; the lobes guide interpolation, sampling and editing.
    Guide = 1,
}

/// A texel's use of one lobe of its cluster's dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LobeRef {
    /// Index into the cluster's dictionary.
    pub lobe: u8,
    /// RGB weight codes, see [`crate::weight_from_byte`].
    pub weight: [u8; 3],
}

/// A lobe of a dictionary with the scale of the weights that refer to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DictionaryLobe {
    /// The lobe.
    pub lobe: Lobe,
    /// Largest weight that a texel can give it.
    pub weight_scale: f32,
}

/// One combination of light side and eye side.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Side of the light.
    pub light_side: SurfaceSide,
    /// Side of the eye.
    pub view_side: SurfaceSide,
    /// What the lobes are to the residual.
    pub lobe_role: LobeRole,
    /// Curve in which the residual is added.
    pub residual_kind: ResidualKind,
    /// The curve's epsilon, 1e-6 to 1.
    pub epsilon: f32,
    /// Light directions.
    pub lights: Sphere,
    /// View directions.
    pub views: Sphere,
    /// Heights of the texels, if parallax between the views is to be removed.
    pub heights: Option<Heights>,
    /// Cluster per texel.
    pub texel_clusters: Vec<u8>,
    /// Number of lobes per texel.
    pub texel_lobe_counts: Vec<u8>,
    /// Dictionary per cluster.
    pub dictionary: Vec<Vec<DictionaryLobe>>,
    /// References of all texels, one texel after the other, in order of importance.
    pub lobe_refs: Vec<LobeRef>,
    /// The residual, if the asset has one and the tier at hand reaches it.
    pub residual: Option<Residual>,
}

impl Layer {
    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> usize {
        self.texel_lobe_counts.iter().copied().max().unwrap_or(0).into()
    }
}

/// A packed BTF in its file form.
#[derive(Debug, Clone, PartialEq)]
pub struct Asset {
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Material description, JSON.
    pub material: String,
    /// One to four layers, no two with the same sides, all on one texel grid: the front's.
    pub layers: Vec<Layer>,
    /// What was changed after it was measured.
    pub edits: Edits,
}

/// Allowed epsilon of a residual's curve.
pub const EPSILON_RANGE: std::ops::RangeInclusive<f32> = 1e-6..=1.0;
/// Words of a layer section.
pub const LAYER_WORDS: usize = 8;
/// A section's bytes, read front to back.
struct Reader<'a> {
    name: String,
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn bad<T>(&self, reason: &'static str) -> Result<T, FormatError> {
        Err(FormatError::Section { section: self.name.clone(), reason })
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        if count > self.bytes.len() {
            return self.bad("it ends too early");
        }
        let (head, tail) = self.bytes.split_at(count);
        self.bytes = tail;
        Ok(head)
    }

    fn words(&mut self, count: usize) -> Result<Vec<u32>, FormatError> {
        let bytes = count.checked_mul(4).map_or_else(|| self.bad("a count overflows"), Ok)?;
        Ok(self.take(bytes)?.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// Half-precision numbers, padded to a whole word; all must be finite.
    fn halves(&mut self, count: usize) -> Result<Vec<f16>, FormatError> {
        let padded = count.div_ceil(2).checked_mul(4).map_or_else(|| self.bad("a count overflows"), Ok)?;
        let all: Vec<f16> =
            self.take(padded)?.chunks_exact(2).map(|b| f16::from_bits(u16::from_le_bytes([b[0], b[1]]))).collect();
        if all.iter().any(|x| !x.is_finite()) {
            return self.bad("a number is not finite");
        }
        if all[count..].iter().any(|x| x.to_bits() != 0) {
            return self.bad("padding is not zero");
        }
        Ok(all[..count].to_vec())
    }

    /// Steps of up to `most`.
    fn steps(&mut self, count: usize, most: f32) -> Result<Vec<f32>, FormatError> {
        let steps: Vec<f32> = self.words(count)?.into_iter().map(f32::from_bits).collect();
        if steps.iter().all(|step| (0.0..=most).contains(step)) {
            Ok(steps)
        } else {
            self.bad("a step is out of range")
        }
    }

    /// What is left, as a coded plane of `count` numbers.
    fn plane(&mut self, count: usize, width: usize) -> Result<Vec<i32>, FormatError> {
        let bytes = self.take(self.bytes.len())?;
        decode_plane(bytes, count, width).or_else(|reason| self.bad(reason))
    }

    /// The same as 16-bit numbers.
    fn plane16(&mut self, count: usize, width: usize) -> Result<Vec<i16>, FormatError> {
        let plane = self.plane(count, width)?;
        match plane.into_iter().map(i16::try_from).collect() {
            Ok(values) => Ok(values),
            Err(_) => self.bad("a number has more than 16 bits"),
        }
    }

    /// What is left, decoded by `code` into `count` values.
    fn coded<T: Clone>(
        &mut self,
        count: usize,
        empty: T,
        code: impl FnOnce(&mut Decoder, &mut [T]),
    ) -> Result<Vec<T>, FormatError> {
        let bytes = self.take(self.bytes.len())?;
        bounded(count, bytes).or_else(|reason| self.bad(reason))?;
        let mut values = vec![empty; count];
        let mut decoder = Decoder::new(bytes);
        code(&mut decoder, &mut values);
        decoder.ended().or_else(|reason| self.bad(reason))?;
        Ok(values)
    }

    fn end(&self) -> Result<(), FormatError> {
        if self.bytes.is_empty() { Ok(()) } else { self.bad("it is longer than its content") }
    }
}

/// The sections that are present in the tier at hand, by kind, layer and index.
struct Sections<'a> {
    bytes: &'a [u8],
    entries: HashMap<(u32, u32, u32), (usize, usize)>,
    /// True where the bytes are the whole file, so that every promised section must be there.
    whole: bool,
}

impl<'a> Sections<'a> {
    fn find(&self, kind: SectionKind, layer: u32, index: u32) -> Option<Reader<'a>> {
        let (start, end) = *self.entries.get(&(kind as u32, layer, index))?;
        Some(Reader { name: format!("{kind:?} {index} of layer {layer}"), bytes: self.bytes.get(start..end)? })
    }

    fn get(&self, kind: SectionKind, layer: u32, index: u32) -> Result<Reader<'a>, FormatError> {
        self.find(kind, layer, index)
            .ok_or_else(|| FormatError::MissingSection { section: format!("{kind:?} {index} of layer {layer}") })
    }

    /// `None` where a coarser tier ends before the section; in a whole file its absence is an error.
    fn get_in_tier(&self, kind: SectionKind, layer: u32, index: u32) -> Result<Option<Reader<'a>>, FormatError> {
        if self.whole { self.get(kind, layer, index).map(Some) } else { Ok(self.find(kind, layer, index)) }
    }
}

impl Asset {
    /// Checks and reads a whole asset or one of its documented prefixes (tiers).
    ///
    /// Never panics. Allocates for coded numbers only what `bytes` can hold (1024 numbers a byte), and builds each
    /// direction set's grid: of 64 x 64 cells at most.
    pub fn parse(bytes: &[u8]) -> Result<Asset, FormatError> {
        let directory = read_directory(bytes)?;
        let mut entries = HashMap::new();
        for entry in &directory.sections {
            let (start, end) = (entry.offset as usize, entry.offset as usize + entry.length as usize);
            let key = (entry.kind, entry.layer, entry.index);
            if SectionKind::from_number(entry.kind).is_none() {
                continue;
            }
            if end <= bytes.len() && entries.insert(key, (start, end)).is_some() {
                return Err(FormatError::Section { section: entry.name(), reason: "it is there twice" });
            }
        }
        let sections = Sections { bytes, entries, whole: directory.tier + 1 == directory.tiers.len() };
        let (width, height) = (directory.width as usize, directory.height as usize);
        let mut material = sections.get(SectionKind::Material, 0, 0)?;
        let text = material.take(material.bytes.len())?;
        let material = match std::str::from_utf8(text) {
            Ok(text) => text.to_string(),
            Err(_) => return material.bad("it is not UTF-8"),
        };
        let layers = (0..directory.layers)
            .map(|layer| read_layer(&sections, layer, width, height))
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(number) = doubled_sides(&layers) {
            let section = format!("Layer 0 of layer {number}");
            return Err(FormatError::Section { section, reason: "an earlier layer has the same sides" });
        }
        let edits = match sections.find(SectionKind::Edits, 0, 0) {
            Some(reader) => read_edits(reader, width, height)?,
            None => Edits::default(),
        };
        if !layers.iter().all(|layer| edits.fit(layer)) {
            let section = "Edits 0 of layer 0".into();
            return Err(FormatError::Section { section, reason: "its edited lobes would take more than 64 MiB" });
        }
        Ok(Asset { width, height, material, layers, edits })
    }

    /// The same with at most so many residual components, and of each texel's lobes at most so many, the most important
    /// ones. Cost: a copy.
    pub fn trimmed(&self, components: usize, lobes: usize) -> Asset {
        let mut asset = self.clone();
        for layer in &mut asset.layers {
            if let Some(residual) = &mut layer.residual {
                residual.coefficients.truncate(components);
                residual.bases.truncate(residual.coefficients.len() + 1);
            }
            let (mut first, mut kept) = (0, Vec::new());
            for count in &mut layer.texel_lobe_counts {
                let all = usize::from(*count);
                kept.extend_from_slice(&layer.lobe_refs[first..first + all.min(lobes)]);
                *count = all.min(lobes) as u8;
                first += all;
            }
            layer.lobe_refs = kept;
        }
        asset
    }

    /// Residual components of the layer that has most.
    pub fn most_components(&self) -> usize {
        let residuals = self.layers.iter().filter_map(|layer| layer.residual.as_ref());
        residuals.map(|residual| residual.coefficients.len()).max().unwrap_or(0)
    }

    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> usize {
        self.layers.iter().map(Layer::most_lobes).max().unwrap_or(0)
    }

    /// Texels.
    pub fn texel_count(&self) -> usize {
        self.width * self.height
    }
}

/// Number of the first layer whose sides an earlier one has.
pub(crate) fn doubled_sides(layers: &[Layer]) -> Option<usize> {
    let sides = |layer: &Layer| (layer.light_side, layer.view_side);
    (0..layers.len()).find(|&number| layers[..number].iter().any(|other| sides(other) == sides(&layers[number])))
}

fn side_from_word(word: u32) -> Option<SurfaceSide> {
    [SurfaceSide::Front, SurfaceSide::Back].into_iter().find(|side| *side as u32 == word)
}

fn read_layer(sections: &Sections, layer: u32, width: usize, height: usize) -> Result<Layer, FormatError> {
    let texels = width * height;
    let mut reader = sections.get(SectionKind::Layer, layer, 0)?;
    let words = reader.words(LAYER_WORDS)?;
    reader.end()?;
    let (Some(light_side), Some(view_side)) = (side_from_word(words[0]), side_from_word(words[1])) else {
        return reader.bad("a side is neither 0 nor 1");
    };
    let Some(residual_kind) = ResidualKind::from_number(words[2]) else {
        return reader.bad("residual_kind is not 0, 1 or 2");
    };
    let epsilon = f32::from_bits(words[3]);
    if !EPSILON_RANGE.contains(&epsilon) {
        return reader.bad("epsilon is not within 1e-6 to 1");
    }
    let (clusters, components) = (words[4] as usize, words[5] as usize);
    if clusters == 0 || clusters > MAX_CLUSTERS || components > MAX_COMPONENTS || words[6] > 1 || words[7] > 1 {
        return reader.bad("a count is out of range");
    }
    let has_residual = words[6] == 1;
    let lobe_role = if words[7] == 0 { LobeRole::Base } else { LobeRole::Guide };

    let sphere = |index: u32| -> Result<Sphere, FormatError> {
        let mut reader = sections.get(SectionKind::Directions, layer, index)?;
        let words = reader.words(reader.bytes.len() / 4)?;
        reader.end()?;
        Sphere::from_file_words(&words).or_else(|reason| reader.bad(reason))
    };
    let (lights, views) = (sphere(0)?, sphere(1)?);

    let heights = match sections.find(SectionKind::Height, layer, 0) {
        Some(reader) => Some(read_heights(reader, texels, width)?),
        None => None,
    };

    let mut reader = sections.get(SectionKind::TexelClusters, layer, 0)?;
    let texel_clusters = reader.coded(texels, 0u8, |decoder, ids| code_clusters(decoder, ids, width))?;
    if texel_clusters.iter().any(|cluster| usize::from(*cluster) >= clusters) {
        return reader.bad("a texel names a cluster that is not there");
    }
    let mut reader = sections.get(SectionKind::TexelLobeCounts, layer, 0)?;
    let texel_lobe_counts = reader.coded(texels, 0u8, |decoder, counts| {
        code_counts(decoder, counts, &texel_clusters);
    })?;

    let mut reader = sections.get(SectionKind::Dictionary, layer, 0)?;
    let counts = reader.words(clusters)?;
    let mut dictionary = Vec::with_capacity(clusters);
    for count in counts {
        if count as usize > MAX_DICTIONARY {
            return reader.bad("a dictionary has more than 256 lobes");
        }
        let words = reader.words(count as usize * FILE_WORDS)?;
        let lobes: Option<Vec<_>> = words
            .chunks_exact(FILE_WORDS)
            .map(|w| Lobe::from_words([w[0], w[1], w[2], w[3], w[4]]))
            .map(|found| found.map(|(lobe, weight_scale)| DictionaryLobe { lobe, weight_scale }))
            .collect();
        match lobes {
            Some(lobes) => dictionary.push(lobes),
            None => return reader.bad("a lobe's parameter is out of its range"),
        }
    }
    reader.end()?;

    let mut reader = sections.get(SectionKind::LobeRefs, layer, 0)?;
    let total: usize = texel_lobe_counts.iter().map(|count| usize::from(*count)).sum();
    let lobe_refs = reader.coded(total, LobeRef { lobe: 0, weight: [0; 3] }, |decoder, refs| {
        code_refs(decoder, refs, &texel_clusters, &texel_lobe_counts, 1);
    })?;
    let mut at = 0;
    for (texel, count) in texel_lobe_counts.iter().enumerate() {
        let lobes = dictionary[usize::from(texel_clusters[texel])].len();
        let refs = &lobe_refs[at..at + usize::from(*count)];
        at += usize::from(*count);
        if refs.iter().any(|reference| usize::from(reference.lobe) >= lobes) {
            return reader.bad("a texel names a lobe that its cluster does not have");
        }
    }

    let residual = if has_residual {
        read_residual(sections, layer, [width, height], clusters, components, [views.len(), lights.len()])?
    } else {
        None
    };
    Ok(Layer {
        light_side,
        view_side,
        lobe_role,
        residual_kind,
        epsilon,
        lights,
        views,
        heights,
        texel_clusters,
        texel_lobe_counts,
        dictionary,
        lobe_refs,
        residual,
    })
}

fn read_edits(mut reader: Reader, width: usize, height: usize) -> Result<Edits, FormatError> {
    let count = reader.words(1)?[0] as usize;
    if count == 0 || count > MOST_EDITS {
        return reader.bad("it has not 1 to 255 edits");
    }
    let words = reader.words(count * EDIT_NUMBERS)?;
    let numbers = |w: &[u32]| std::array::from_fn(|i| f32::from_bits(w[i]));
    let list: Option<Vec<_>> = words.chunks_exact(EDIT_NUMBERS).map(|w| Edit::from_numbers(numbers(w))).collect();
    let Some(list) = list else { return reader.bad("a number is out of its range") };
    let texels = reader.coded(width * height, 0u8, |decoder, ids| code_clusters(decoder, ids, width))?;
    if texels.iter().any(|edit| usize::from(*edit) > count) {
        return reader.bad("a texel names an edit that is not there");
    }
    Ok(Edits { list, texels })
}

fn read_heights(mut reader: Reader, texels: usize, width: usize) -> Result<Heights, FormatError> {
    let step = reader.steps(1, MOST_HEIGHT_STEP)?[0];
    if step == 0.0 {
        return reader.bad("its step is 0");
    }
    match reader.plane(texels, width)?.into_iter().map(i8::try_from).collect() {
        Ok(codes) => Ok(Heights { step, codes }),
        Err(_) => reader.bad("a code has more than 8 bits"),
    }
}

/// `None` where the tier at hand ends before the factors.
fn read_residual(
    sections: &Sections,
    layer: u32,
    grid: [usize; 2],
    clusters: usize,
    components: usize,
    shape: [usize; 2],
) -> Result<Option<Residual>, FormatError> {
    let Some(mut reader) = sections.get_in_tier(SectionKind::Factors, layer, 0)? else {
        return Ok(None);
    };
    if basis_words(shape, clusters, components + 1) > MAX_BASIS_WORDS {
        return reader.bad("its bases would take more than 1 GiB when expanded");
    }
    let words = reader.words(8)?;
    let ranks = [0, 1, 2].map(|c| [words[2 * c] as usize, words[2 * c + 1] as usize]);
    if ranks.iter().flatten().any(|rank| *rank > MAX_RANK) || words[6] | words[7] != 0 {
        return reader.bad("a rank is above 256 or a reserved word is not zero");
    }
    let mut view = [const { Vec::new() }; 3];
    let mut light = [const { Vec::new() }; 3];
    for channel in 0..3 {
        view[channel] = reader.halves(shape[0] * ranks[channel][0])?;
        light[channel] = reader.halves(shape[1] * ranks[channel][1])?;
    }
    reader.end()?;
    let factors = Factors { shape, ranks, view, light };

    // Shared bases and means come together: without them there is no residual.
    let Some(mut reader) = sections.get_in_tier(SectionKind::SharedBases, layer, 0)? else {
        return Ok(None);
    };
    let shared = reader.words(1)?[0] as usize;
    if shared > MAX_SHARED {
        return reader.bad("it has more than 1024 bases");
    }
    let steps = reader.steps(shared, MAX_BASIS_STEP)?;
    let values = reader.plane16(shared * factors.core_len(), factors.core_len())?;
    let shared = SharedBases { steps, values };

    let mut bases = Vec::new();
    let mut coefficients = Vec::new();
    for index in 0..=components as u32 {
        let basis = sections.get_in_tier(SectionKind::Basis, layer, index)?;
        let plane = if index == 0 { None } else { sections.get_in_tier(SectionKind::Coefficients, layer, index)? };
        let Some(mut reader) = basis else { break };
        if index > 0 && plane.is_none() {
            break;
        }
        let steps = reader.steps(clusters, MAX_BASIS_STEP)?;
        let values = reader.plane16(clusters * shared.steps.len(), shared.steps.len())?;
        bases.push(Basis { steps, values });
        if let Some(mut reader) = plane {
            let step = reader.steps(1, MAX_COEFFICIENT_STEP)?[0];
            let plane = reader.plane(grid[0] * grid[1], grid[0])?;
            match plane.into_iter().map(i8::try_from).collect() {
                Ok(codes) => coefficients.push(Coefficients { step, codes }),
                Err(_) => return reader.bad("a code has more than 8 bits"),
            }
        }
    }
    if bases.is_empty() {
        return Ok(None);
    }
    Ok(Some(Residual { factors, shared, bases, coefficients }))
}
