//! Reads an [`Asset`] from bytes: what [`crate::pack`] writes.

use crate::asset::{
    Asset, DictionaryLobe, EPSILON_RANGE, Layer, Level, LevelTexels, LobeRef, LobeRole, SurfaceSide, doubled_sides,
    level_sizes, refs_exist,
};
use crate::edit::{EDIT_NUMBERS, Edit, Edits, MOST_EDITS};
use crate::entropy::{Decoder, Signed, bounded, code_plane, decode_plane};
use crate::error::FormatError;
use crate::format::{
    Form, MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_DICTIONARY,
    MAX_RANK, MAX_SHARED, SectionKind, basis_words, read_directory_on,
};
use crate::lobe::{FILE_WORDS, Lobe};
use crate::parallax::{Heights, MOST_HEIGHT_STEP};
use crate::residual::{Basis, Coefficients, Factors, Residual, ResidualKind, SharedBases};
use crate::sphere::Sphere;
use crate::texel_coding::{code_clusters, code_counts, code_refs};
use crate::threads::{Threads, map, serial};
use half::f16;
use std::collections::HashMap;

/// Words of a layer section.
pub const LAYER_WORDS: usize = 8;
/// A section's bytes, read front to back.
#[derive(Clone)]
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
    fn plane<T>(&mut self, count: usize, width: usize) -> Result<Vec<T>, FormatError>
    where
        T: Copy + Default + Into<i32> + TryFrom<i32>,
    {
        let bytes = self.take(self.bytes.len())?;
        decode_plane(bytes, count, width).or_else(|reason| self.bad(reason))
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
        Asset::parse_on(bytes, &serial)
    }

    /// The same on `threads`.
    pub fn parse_on(bytes: &[u8], threads: Threads) -> Result<Asset, FormatError> {
        let directory = read_directory_on(bytes, threads)?;
        if directory.head.form != Form::File {
            return Err(FormatError::Form { expected: "file", got: "resident" });
        }
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
        let head = directory.head;
        let (width, height) = (head.width as usize, head.height as usize);
        let mut material = sections.get(SectionKind::Material, 0, 0)?;
        let text = material.take(material.bytes.len())?;
        let material = match std::str::from_utf8(text) {
            Ok(text) => text.to_string(),
            Err(_) => return material.bad("it is not UTF-8"),
        };
        let layers = (0..head.layers)
            .map(|layer| read_layer(&sections, layer, [width, height], threads))
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
        let levels = read_levels(&sections, &layers, [width, height], threads)?;
        Ok(Asset { width, height, size_mm: head.size_mm, seamless: head.seamless, material, layers, levels, edits })
    }
}

fn side_from_word(word: u32) -> Option<SurfaceSide> {
    [SurfaceSide::Front, SurfaceSide::Back].into_iter().find(|side| *side as u32 == word)
}

fn read_layer(
    sections: &Sections,
    layer: u32,
    [width, height]: [usize; 2],
    threads: Threads,
) -> Result<Layer, FormatError> {
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
    if !refs_exist(&texel_clusters, &texel_lobe_counts, &lobe_refs, &dictionary) {
        return reader.bad("a texel names a lobe that its cluster does not have");
    }

    let residual = if has_residual {
        read_residual(sections, layer, [width, height], clusters, components, [views.len(), lights.len()], threads)?
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

/// Levels up to the first that a layer does not have.
fn read_levels(
    sections: &Sections,
    layers: &[Layer],
    finest: [usize; 2],
    threads: Threads,
) -> Result<Vec<Level>, FormatError> {
    let sizes = level_sizes(finest);
    let mut readers: Vec<Vec<Reader>> = Vec::new();
    for level in 1..=sizes.len() as u32 {
        let of_layer = |layer| sections.find(SectionKind::Level, layer as u32, level);
        let found: Vec<Reader> = (0..layers.len()).filter_map(of_layer).collect();
        match found.len() {
            0 => break,
            some if some == layers.len() => readers.push(found),
            _ if sections.whole => return found[0].bad("another layer does not have the level"),
            _ => break,
        }
    }
    let texels = map(threads, readers.len() * layers.len(), |number| {
        let (level, layer) = (number / layers.len(), number % layers.len());
        read_level(readers[level][layer].clone(), &layers[layer], sizes[level])
    });
    let mut texels = texels.into_iter();
    let mut levels = Vec::new();
    for [width, height] in sizes.into_iter().take(readers.len()) {
        let layers = texels.by_ref().take(layers.len()).collect::<Result<_, _>>()?;
        levels.push(Level { width, height, layers });
    }
    Ok(levels)
}

fn read_level(mut reader: Reader, layer: &Layer, [width, height]: [usize; 2]) -> Result<LevelTexels, FormatError> {
    let texels = width * height;
    let components = reader.words(1)?[0] as usize;
    let step = reader.steps(1, MOST_HEIGHT_STEP)?[0];
    // A coarser tier may hold fewer components than the level has.
    let most = layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    if components > most {
        return reader.bad("it has more components than its layer");
    }
    let with_heights = step > 0.0;
    let bytes = reader.take(reader.bytes.len())?;
    let bad = |reason| reader.bad(reason);
    bounded(texels * (2 + usize::from(with_heights) + components), bytes).or_else(bad)?;
    let mut decoder = Decoder::new(bytes);
    let (mut clusters, mut lobe_counts) = (vec![0u8; texels], vec![0u8; texels]);
    code_clusters(&mut decoder, &mut clusters, width);
    if clusters.iter().any(|cluster| usize::from(*cluster) >= layer.dictionary.len()) {
        return reader.bad("a texel names a cluster that is not there");
    }
    code_counts(&mut decoder, &mut lobe_counts, &clusters);
    let total: usize = lobe_counts.iter().map(|count| usize::from(*count)).sum();
    bounded(total, bytes).or_else(bad)?;
    let mut lobe_refs = vec![LobeRef { lobe: 0, weight: [0; 3] }; total];
    code_refs(&mut decoder, &mut lobe_refs, &clusters, &lobe_counts, 1);
    if !refs_exist(&clusters, &lobe_counts, &lobe_refs, &layer.dictionary) {
        return reader.bad("a texel names a lobe that its cluster does not have");
    }
    let mut fits = true;
    let mut plane = || {
        let mut codes = vec![0i8; texels];
        fits &= code_plane(&mut decoder, &mut Signed::new(), &mut codes, width);
        codes
    };
    let heights = with_heights.then(|| Heights { step, codes: plane() });
    let codes = (0..components).map(|_| plane()).collect();
    decoder.ended().or_else(bad)?;
    if !fits {
        return reader.bad("a number is out of its range");
    }
    Ok(LevelTexels { heights, clusters, lobe_counts, lobe_refs, codes })
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
    Ok(Heights { step, codes: reader.plane(texels, width)? })
}

/// `None` where the tier at hand ends before the factors.
fn read_residual(
    sections: &Sections,
    layer: u32,
    grid: [usize; 2],
    clusters: usize,
    components: usize,
    shape: [usize; 2],
    threads: Threads,
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
    let core_len = factors.core_len();

    // What is there of means and components: the one and the other section of each.
    let mut there: Vec<(Reader, Option<Reader>)> = Vec::new();
    for index in 0..=components as u32 {
        let basis = sections.get_in_tier(SectionKind::Basis, layer, index)?;
        let plane = if index == 0 { None } else { sections.get_in_tier(SectionKind::Coefficients, layer, index)? };
        match basis {
            Some(basis) if index == 0 || plane.is_some() => there.push((basis, plane)),
            _ => break,
        }
    }
    if there.is_empty() {
        return Ok(None);
    }
    // Streams do not depend on each other. Number 0 are the shared bases; then bases and coefficients by turns.
    enum Plane {
        Shared(Vec<i16>),
        Basis(Basis),
        Coefficients(Option<Coefficients>),
    }
    let decoded = map(threads, 1 + 2 * there.len(), |number| -> Result<Plane, FormatError> {
        let Some(number) = number.checked_sub(1) else {
            return reader.clone().plane(shared * core_len, core_len).map(Plane::Shared);
        };
        let (basis, plane) = &there[number / 2];
        if number % 2 == 0 {
            let mut reader = basis.clone();
            let steps = reader.steps(clusters, MAX_BASIS_STEP)?;
            return Ok(Plane::Basis(Basis { steps, values: reader.plane(clusters * shared, shared)? }));
        }
        let Some(mut reader) = plane.clone() else { return Ok(Plane::Coefficients(None)) };
        let step = reader.steps(1, MAX_COEFFICIENT_STEP)?[0];
        Ok(Plane::Coefficients(Some(Coefficients { step, codes: reader.plane(grid[0] * grid[1], grid[0])? })))
    });
    let (mut values, mut bases, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
    for plane in decoded {
        match plane? {
            Plane::Shared(of_shared) => values = of_shared,
            Plane::Basis(basis) => bases.push(basis),
            Plane::Coefficients(plane) => coefficients.extend(plane),
        }
    }
    Ok(Some(Residual { factors, shared: SharedBases { steps, values }, bases, coefficients }))
}
