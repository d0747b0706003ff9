//! Reads an [`Asset`] from the bytes that [`crate::pack`] writes.

use crate::asset::asset::{Asset, Layer, Level, LevelTexels, LobeRole, SurfaceSide, doubled_sides, level_sizes};
use crate::asset::dictionary::{DictionaryLobe, LobeRef, refs_exist};
use crate::asset::edit::{EDIT_NUMBERS, Edit, Edits, MAX_EDITS};
use crate::asset::heights::Heights;
use crate::asset::limits::EPSILON_RANGE;
use crate::asset::limits::MAX_HEIGHT_STEP;
use crate::asset::limits::{
    MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_DICTIONARY, MAX_NODES,
    MAX_RANK, MAX_SHARED, MAX_WEIGHT_INPUTS, basis_words,
};
use crate::asset::lobe::{FILE_WORDS, Lobe};
use crate::asset::lobe_weights::LobeWeights;
use crate::asset::relief::Relief;
use crate::asset::residual::{Basis, Coefficients, Factors, PredictedGroup, Residual, ResidualKind, SharedBases};
use crate::asset::spectrum::Spectrum;
use crate::asset::sphere::Sphere;
use crate::container::directory::{Directory, read_directory_of};
use crate::container::entropy::{Decoder, Signed, bounded, code_columns, code_plane};
use crate::container::fault::Faults;
use crate::container::sections::{Reader, Sections};
use crate::error::FormatError;
use crate::file::coefficient_coding::{CoefficientFrame, Given, code_group};
use crate::file::format::{Form, Head, SectionKind, Spmm};
use crate::file::residual_coding::{FactorCodes, MAX_EXPONENT};
use crate::file::texel_coding::{code_clusters, code_counts, code_refs};
use crate::rule;
use crate::threads::{Threads, map, serial};

/// Number of words of a Layer section.
pub const LAYER_WORDS: usize = 8;

impl Asset {
    /// Checks and reads a whole asset or one of its documented prefixes (tiers) on the calling thread.
    ///
    /// Never panics. Allocates for coded numbers only what `bytes` can hold (1024 numbers a byte), and builds the grid
    /// of each direction set: of 64 x 64 cells at most.
    pub fn parse(bytes: &[u8]) -> Result<Asset, FormatError> {
        Asset::parse_on(bytes, &serial)
    }

    /// Checks and reads an asset like [`Asset::parse`], on `threads`.
    pub fn parse_on(bytes: &[u8], threads: Threads) -> Result<Asset, FormatError> {
        let directory = read_directory_of::<Spmm>(bytes, threads)?;
        if directory.head.form != Form::File {
            return Err(FormatError::Form { expected: "file", got: "resident" });
        }
        let mut faults = Faults::default();
        let asset = examine_asset(bytes, &directory, threads, &mut faults);
        faults.or_first(asset)
    }
}

/// Reads the asset in the file form with this directory, and continues after a fault with every section that does not
/// depend on a faulty one. Returns `None` if there is any fault.
pub(crate) fn examine_asset(
    bytes: &[u8],
    directory: &Directory<Head>,
    threads: Threads,
    faults: &mut Faults,
) -> Option<Asset> {
    let before = faults.len();
    let sections = Sections::<Spmm>::new(bytes, directory, faults);
    let head = directory.head;
    let (width, height) = (head.width as usize, head.height as usize);
    let material = sections.get(SectionKind::Material, 0, 0, faults);
    let material = material.and_then(|reader| faults.keep(reader.text()));
    let layers: Vec<Option<Layer>> =
        (0..head.layers).map(|layer| read_layer(&sections, layer, [width, height], threads, faults)).collect();
    let whole: Option<Vec<&Layer>> = layers.iter().map(Option::as_ref).collect();
    if let Some(number) = whole.and_then(doubled_sides) {
        let section = format!("Layer 0 of layer {number}");
        faults.push(FormatError::Section { section, reason: rule::SAME_SIDES });
    }
    let edits = match sections.find(SectionKind::Edits, 0, 0) {
        Some(reader) => faults.keep(read_edits(reader, width, height)),
        None => Some(Edits::default()),
    };
    if edits.as_ref().is_some_and(|edits| !layers.iter().flatten().all(|layer| edits.fit(&layer.dictionary))) {
        let section = "Edits 0 of layer 0".into();
        faults.push(FormatError::Section { section, reason: rule::EDITS_TOO_LARGE });
    }
    let spectrum = match head.spectral {
        true => {
            let reader = sections.get(SectionKind::Spectrum, 0, 0, faults);
            reader.and_then(|reader| faults.keep(read_spectrum(reader))).map(Some)
        }
        false => Some(None),
    };
    let groups = spectrum.as_ref().and_then(Option::as_ref).map_or(1, |spectrum| spectrum.groups);
    if layers.iter().flatten().any(|layer| !layer.lights.repeats(groups)) {
        faults.push(FormatError::Section { section: "Spectrum 0 of layer 0".into(), reason: rule::LIGHT_GROUPS });
    }
    let levels = read_levels(&sections, &layers, [width, height], threads, faults);
    let (material, edits, spectrum) = (material?, edits?, spectrum?);
    let layers = layers.into_iter().collect::<Option<Vec<_>>>()?;
    let Head { size_mm, seamless, .. } = head;
    let asset = Asset { width, height, size_mm, seamless, spectrum, material, layers, levels, edits };
    (faults.len() == before && sections.damaged.is_empty()).then_some(asset)
}

fn side_from_word(word: u32) -> Option<SurfaceSide> {
    [SurfaceSide::Front, SurfaceSide::Back].into_iter().find(|side| *side as u32 == word)
}

/// The contents of a Layer section.
struct Parameters {
    light_side: SurfaceSide,
    view_side: SurfaceSide,
    lobe_role: LobeRole,
    residual_kind: ResidualKind,
    epsilon: f32,
    clusters: usize,
    components: usize,
    has_residual: bool,
}

fn read_parameters(mut reader: Reader) -> Result<Parameters, FormatError> {
    let words = reader.words(LAYER_WORDS)?;
    reader.end()?;
    let (Some(light_side), Some(view_side)) = (side_from_word(words[0]), side_from_word(words[1])) else {
        return reader.bad(rule::SIDE);
    };
    let Some(residual_kind) = ResidualKind::from_number(words[2]) else {
        return reader.bad(rule::RESIDUAL_KIND);
    };
    let epsilon = f32::from_bits(words[3]);
    if !EPSILON_RANGE.contains(&epsilon) {
        return reader.bad(rule::EPSILON);
    }
    let (clusters, components) = (words[4] as usize, words[5] as usize);
    if clusters == 0 || clusters > MAX_CLUSTERS || components > MAX_COMPONENTS || words[6] > 1 {
        return reader.bad(rule::COUNT);
    }
    let Some(lobe_role) = LobeRole::from_number(words[7]) else {
        return reader.bad(rule::COUNT);
    };
    let has_residual = words[6] == 1;
    Ok(Parameters { light_side, view_side, lobe_role, residual_kind, epsilon, clusters, components, has_residual })
}

/// Reads a layer at the finest level; `None` if anything of the layer is at fault.
fn read_layer(
    sections: &Sections<Spmm>,
    layer: u32,
    [width, height]: [usize; 2],
    threads: Threads,
    faults: &mut Faults,
) -> Option<Layer> {
    let (before, texels) = (faults.len(), width * height);
    let parameters = sections.get(SectionKind::Layer, layer, 0, faults);
    let parameters = parameters.and_then(|reader| faults.keep(read_parameters(reader)));
    let [lights, views] = [0, 1].map(|index| {
        let reader = sections.get(SectionKind::Directions, layer, index, faults)?;
        faults.keep(read_sphere(reader))
    });
    let heights = sections.find(SectionKind::Height, layer, 0);
    let heights = heights.map(|reader| faults.keep(read_heights(reader, texels, width)));
    let relief = sections.find(SectionKind::Relief, layer, 0);
    let relief = relief.map(|reader| faults.keep(read_relief(reader)));

    let clusters = parameters.as_ref().map(|parameters| parameters.clusters);
    let reader = sections.get(SectionKind::TexelClusters, layer, 0, faults);
    let texel_clusters = reader.and_then(|reader| faults.keep(read_clusters(reader, texels, width, clusters)));
    let weights = sections.find(SectionKind::LobeWeights, layer, 0);
    // Where weights follow from the coefficients, no references are stored.
    let predicted = weights.is_some() && sections.find(SectionKind::TexelLobeCounts, layer, 0).is_none();
    let reader = if predicted { None } else { sections.get(SectionKind::TexelLobeCounts, layer, 0, faults) };
    let texel_lobe_counts = reader
        .zip(texel_clusters.as_ref())
        .and_then(|(reader, texel_clusters)| faults.keep(read_lobe_counts(reader, texel_clusters)));
    let reader = sections.get(SectionKind::Dictionary, layer, 0, faults);
    let dictionary = reader.zip(clusters).and_then(|(reader, clusters)| faults.keep(read_dictionary(reader, clusters)));
    let lobe_weights = weights.zip(dictionary.as_ref());
    let lobe_weights = lobe_weights.and_then(|(reader, dictionary)| faults.keep(read_lobe_weights(reader, dictionary)));
    let reader = if predicted { None } else { sections.get(SectionKind::LobeRefs, layer, 0, faults) };
    let lobe_refs = match (reader, &texel_clusters, &texel_lobe_counts, &dictionary) {
        (Some(reader), Some(clusters), Some(counts), Some(dictionary)) => {
            faults.keep(read_lobe_refs(reader, clusters, counts, dictionary))
        }
        _ => None,
    };
    let mut parts = None;
    let residual = match (&parameters, &lights, &views, &texel_clusters) {
        (Some(parameters), Some(lights), Some(views), Some(ids)) if parameters.has_residual => {
            let shape = [views.len(), lights.len()];
            if sections.find(SectionKind::PredictedCoefficients, layer, 1).is_some() {
                parts = read_predicted(sections, layer, (ids, width), parameters, threads, faults);
                parts.as_ref().and_then(|parts| {
                    read_predicted_residual(sections, layer, parts, parameters, shape, threads, faults)
                })
            } else {
                read_residual(sections, layer, [width, height], parameters, shape, threads, faults)
            }
        }
        _ => None,
    };
    if faults.len() > before || sections.damage_in(layer) {
        return None;
    }
    let Parameters { light_side, view_side, lobe_role, residual_kind, epsilon, components, has_residual, .. } =
        parameters?;
    let number = layer;
    let mut layer = Layer {
        light_side,
        view_side,
        lobe_role,
        residual_kind,
        epsilon,
        lights: lights?,
        views: views?,
        heights: heights.flatten(),
        relief: relief.flatten(),
        texel_clusters: texel_clusters?,
        texel_lobe_counts: if predicted { Vec::new() } else { texel_lobe_counts? },
        dictionary: dictionary?,
        lobe_refs: if predicted { Vec::new() } else { lobe_refs? },
        lobe_weights: None,
        residual,
    };
    if let Some((weights, nodes)) = lobe_weights {
        let most = if has_residual { components } else { 0 };
        let at_hand = parts.map(|parts| parts.coefficients);
        add_lobe_weights(sections, number, &mut layer, (weights, nodes), (most, at_hand), [width, height], faults)?;
    }
    if layer.relief.is_some() && !layer.may_have_relief() {
        return faults.keep(sections.find(SectionKind::Relief, number, 0)?.bad(rule::RELIEF_ALONE));
    }
    Some(layer)
}

/// Adds lobe weights to layer `number`, and the references that follow from them to one without references. The layer
/// has `components` components in the whole file; `predicted` are the coefficients at hand where they are predicted. `None`
/// if anything is at fault.
fn add_lobe_weights(
    sections: &Sections<Spmm>,
    number: u32,
    layer: &mut Layer,
    (mut weights, nodes): (LobeWeights, Nodes),
    (components, predicted): (usize, Option<Vec<Coefficients>>),
    grid: [usize; 2],
    faults: &mut Faults,
) -> Option<()> {
    let most = weights.units.len().min(components);
    // A residual of fewer components lacks coefficients that are there already.
    let has_all = layer.residual.as_ref().is_some_and(|residual| residual.coefficients.len() >= most);
    let read = match predicted {
        _ if has_all => None,
        Some(predicted) => Some(predicted),
        None => Some(read_lobe_inputs(sections, number, grid, most, faults)?),
    };
    let planes = match &read {
        Some(inputs) => inputs.iter().map(|plane| plane.codes.as_slice()).collect(),
        None => layer.coefficient_planes(),
    };
    if let Nodes::OfTexels(count) = nodes {
        weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &planes, count);
    }
    if sections.find(SectionKind::TexelLobeCounts, number, 0).is_none() {
        let kinds = [SectionKind::TexelClusters, SectionKind::Dictionary, SectionKind::LobeWeights];
        let bytes = kinds.iter().filter_map(|kind| sections.find(*kind, number, 0)).map(|reader| reader.bytes.len());
        if !layer.may_predict_lobes(bytes.sum()) {
            return faults.keep(sections.find(SectionKind::LobeWeights, number, 0)?.bad(rule::COUNT));
        }
        let (counts, references) = layer.predicted_lobes(&weights, &planes);
        (layer.texel_lobe_counts, layer.lobe_refs) = (counts, references);
    }
    layer.lobe_weights = Some(weights);
    Some(())
}

/// Reads the coefficients of the first `most` components, as far as they are at hand one after the other; `None` if one
/// of them is at fault.
fn read_lobe_inputs(
    sections: &Sections<Spmm>,
    layer: u32,
    grid: [usize; 2],
    most: usize,
    faults: &mut Faults,
) -> Option<Vec<Coefficients>> {
    let at_hand = (1..=most as u32).map_while(|index| sections.find(SectionKind::Coefficients, layer, index));
    at_hand.map(|reader| faults.keep(read_coefficients(reader, grid))).collect()
}

fn read_coefficients(mut reader: Reader, [width, height]: [usize; 2]) -> Result<Coefficients, FormatError> {
    let step = reader.steps(1, MAX_COEFFICIENT_STEP)?[0];
    Ok(Coefficients { step, codes: reader.plane(width * height, width)? })
}

/// Source of the nodes of lobe weights.
enum Nodes {
    /// At most so many texels of each cluster.
    OfTexels(usize),
    /// Stored with the weights.
    Stored,
}

/// Reads lobe weights; nodes of texels are left out.
fn read_lobe_weights(
    mut reader: Reader,
    dictionary: &[Vec<DictionaryLobe>],
) -> Result<(LobeWeights, Nodes), FormatError> {
    let words = reader.words(4)?;
    let (inputs, count, step) = (words[0] as usize, words[1] as usize, f32::from_bits(words[3]));
    if inputs > MAX_WEIGHT_INPUTS || count > MAX_NODES || words[2] > 1 {
        return reader.bad(rule::COUNT);
    }
    let units: Vec<f32> = reader.words(inputs)?.into_iter().map(f32::from_bits).collect();
    if !std::iter::once(&step).chain(&units).all(|x| *x > 0.0 && x.is_finite()) {
        return reader.bad(rule::STEP);
    }
    let counts = if words[2] == 1 { reader.words(dictionary.len())? } else { Vec::new() };
    if counts.iter().any(|nodes| *nodes as usize > count) {
        return reader.bad(rule::COUNT);
    }
    let lobes: usize = dictionary.iter().map(Vec::len).sum();
    let (rows, of_nodes) =
        (3 * lobes * (1 + inputs), counts.iter().map(|nodes| *nodes as usize * inputs).sum::<usize>());
    let bytes = reader.take(reader.bytes.len())?;
    bounded(rows + of_nodes, bytes).or_else(|reason| reader.bad(reason))?;
    let mut decoder = Decoder::new(bytes);
    let (mut codes, mut values) = (vec![0i16; rows], vec![0i8; of_nodes]);
    let mut fits = code_plane(&mut decoder, &mut Signed::new(), &mut codes, 1 + inputs);
    if words[2] == 1 {
        fits &= code_plane(&mut decoder, &mut Signed::new(), &mut values, inputs);
    }
    decoder.ended().or_else(|reason| reader.bad(reason))?;
    if !fits {
        return reader.bad(rule::NUMBER);
    }
    let mut values = values.into_iter();
    let mut node = |_| values.by_ref().take(inputs).collect();
    let nodes = counts.iter().map(|nodes| (0..*nodes).map(&mut node).collect()).collect();
    let nodes_from = if words[2] == 1 { Nodes::Stored } else { Nodes::OfTexels(count) };
    Ok((LobeWeights { step, units, codes, nodes }, nodes_from))
}

fn read_spectrum(mut reader: Reader) -> Result<Spectrum, FormatError> {
    let words = reader.words(reader.bytes.len() / 4)?;
    reader.end()?;
    match Spectrum::from_words(&words) {
        Some((spectrum, length)) if length == words.len() => Ok(spectrum),
        _ => reader.bad(rule::SPECTRUM),
    }
}

fn read_sphere(mut reader: Reader) -> Result<Sphere, FormatError> {
    let words = reader.words(reader.bytes.len() / 4)?;
    reader.end()?;
    Sphere::from_file_words(&words).or_else(|reason| reader.bad(reason))
}

/// Reads the cluster ids of the texels. They must be below `clusters`, where that is known.
fn read_clusters(
    mut reader: Reader,
    texels: usize,
    width: usize,
    clusters: Option<usize>,
) -> Result<Vec<u8>, FormatError> {
    let ids = reader.coded(texels, 0u8, |decoder, ids| code_clusters(decoder, ids, width))?;
    match clusters {
        Some(clusters) if ids.iter().any(|cluster| usize::from(*cluster) >= clusters) => reader.bad(rule::NO_CLUSTER),
        _ => Ok(ids),
    }
}

fn read_lobe_counts(mut reader: Reader, texel_clusters: &[u8]) -> Result<Vec<u8>, FormatError> {
    reader.coded(texel_clusters.len(), 0u8, |decoder, counts| code_counts(decoder, counts, texel_clusters))
}

fn read_dictionary(mut reader: Reader, clusters: usize) -> Result<Vec<Vec<DictionaryLobe>>, FormatError> {
    let counts = reader.words(clusters)?;
    let mut dictionary = Vec::with_capacity(clusters);
    for count in counts {
        if count as usize > MAX_DICTIONARY {
            return reader.bad(rule::DICTIONARY_SIZE);
        }
        let words = reader.words(count as usize * FILE_WORDS)?;
        let lobes: Option<Vec<_>> = words
            .chunks_exact(FILE_WORDS)
            .map(|w| Lobe::from_words([w[0], w[1], w[2], w[3], w[4]]))
            .map(|found| found.map(|(lobe, weight_scale)| DictionaryLobe { lobe, weight_scale }))
            .collect();
        match lobes {
            Some(lobes) => dictionary.push(lobes),
            None => return reader.bad(rule::LOBE_RANGE),
        }
    }
    reader.end()?;
    Ok(dictionary)
}

fn read_lobe_refs(
    mut reader: Reader,
    texel_clusters: &[u8],
    lobe_counts: &[u8],
    dictionary: &[Vec<DictionaryLobe>],
) -> Result<Vec<LobeRef>, FormatError> {
    let total: usize = lobe_counts.iter().map(|count| usize::from(*count)).sum();
    let refs = reader.coded(total, LobeRef { lobe: 0, weight: [0; 3] }, |decoder, refs| {
        code_refs(decoder, refs, texel_clusters, lobe_counts, 1);
    })?;
    if refs_exist(texel_clusters, lobe_counts, &refs, dictionary) { Ok(refs) } else { reader.bad(rule::NO_LOBE) }
}

/// Reads the levels up to the first that a layer does not have. Nothing is read of layers at fault.
fn read_levels(
    sections: &Sections<Spmm>,
    layers: &[Option<Layer>],
    finest: [usize; 2],
    threads: Threads,
    faults: &mut Faults,
) -> Vec<Level> {
    let sizes = level_sizes(finest);
    let mut readers: Vec<Vec<Reader>> = Vec::new();
    for level in 1..=sizes.len() as u32 {
        let of_layer = |layer| sections.find(SectionKind::Level, layer as u32, level);
        let found: Vec<Reader> = (0..layers.len()).filter_map(of_layer).collect();
        match found.len() {
            0 => break,
            some if some == layers.len() => readers.push(found),
            _ => {
                if sections.whole && sections.damaged.is_empty() {
                    faults.keep(found[0].bad::<()>(rule::LEVEL_LAYERS));
                }
                break;
            }
        }
    }
    let texels = map(threads, readers.len() * layers.len(), |number| {
        let (level, layer) = (number / layers.len(), number % layers.len());
        let of_layer = layers[layer].as_ref()?;
        Some(read_level(readers[level][layer].clone(), of_layer, sizes[level]))
    });
    let mut texels = texels.into_iter().map(|read| faults.keep(read?));
    let mut levels = Vec::new();
    for [width, height] in sizes.into_iter().take(readers.len()) {
        // All are taken, so that all faults are kept.
        let of_level: Vec<Option<LevelTexels>> = texels.by_ref().take(layers.len()).collect();
        levels.extend(of_level.into_iter().collect::<Option<_>>().map(|layers| Level { width, height, layers }));
    }
    levels
}

fn read_level(mut reader: Reader, layer: &Layer, [width, height]: [usize; 2]) -> Result<LevelTexels, FormatError> {
    let texels = width * height;
    let components = reader.words(1)?[0] as usize;
    let step = reader.steps(1, MAX_HEIGHT_STEP)?[0];
    // A coarser tier may hold fewer components than the level has.
    let most = layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    if components > most {
        return reader.bad(rule::LEVEL_COMPONENTS);
    }
    let with_heights = step > 0.0;
    let bytes = reader.take(reader.bytes.len())?;
    let bad = |reason| reader.bad(reason);
    bounded(texels * (2 + usize::from(with_heights) + components), bytes).or_else(bad)?;
    let mut decoder = Decoder::new(bytes);
    let (mut clusters, mut lobe_counts) = (vec![0u8; texels], vec![0u8; texels]);
    code_clusters(&mut decoder, &mut clusters, width);
    if clusters.iter().any(|cluster| usize::from(*cluster) >= layer.dictionary.len()) {
        return reader.bad(rule::NO_CLUSTER);
    }
    code_counts(&mut decoder, &mut lobe_counts, &clusters);
    let total: usize = lobe_counts.iter().map(|count| usize::from(*count)).sum();
    bounded(total, bytes).or_else(bad)?;
    let mut lobe_refs = vec![LobeRef { lobe: 0, weight: [0; 3] }; total];
    code_refs(&mut decoder, &mut lobe_refs, &clusters, &lobe_counts, 1);
    if !refs_exist(&clusters, &lobe_counts, &lobe_refs, &layer.dictionary) {
        return reader.bad(rule::NO_LOBE);
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
        return reader.bad(rule::NUMBER);
    }
    Ok(LevelTexels { heights, clusters, lobe_counts, lobe_refs, codes })
}

fn read_edits(mut reader: Reader, width: usize, height: usize) -> Result<Edits, FormatError> {
    let count = reader.words(1)?[0] as usize;
    if count == 0 || count > MAX_EDITS {
        return reader.bad(rule::EDIT_COUNT);
    }
    let words = reader.words(count * EDIT_NUMBERS)?;
    let numbers = |w: &[u32]| std::array::from_fn(|i| f32::from_bits(w[i]));
    let list: Option<Vec<_>> = words.chunks_exact(EDIT_NUMBERS).map(|w| Edit::from_numbers(numbers(w))).collect();
    let Some(list) = list else { return reader.bad(rule::NUMBER) };
    let texels = reader.coded(width * height, 0u8, |decoder, ids| code_clusters(decoder, ids, width))?;
    if texels.iter().any(|edit| usize::from(*edit) > count) {
        return reader.bad(rule::NO_EDIT);
    }
    Ok(Edits { list, texels })
}

fn read_heights(mut reader: Reader, texels: usize, width: usize) -> Result<Heights, FormatError> {
    let step = reader.steps(1, MAX_HEIGHT_STEP)?[0];
    if step == 0.0 {
        return reader.bad(rule::HEIGHT_STEP);
    }
    Ok(Heights { step, codes: reader.plane(texels, width)? })
}

fn read_relief(mut reader: Reader) -> Result<Relief, FormatError> {
    let words = reader.words(3)?;
    reader.end()?;
    let relief = Relief::from_numbers([0, 1, 2].map(|i| f32::from_bits(words[i])));
    relief.map_or_else(|| reader.bad(rule::NUMBER), Ok)
}

/// Reads the residual of a layer; `None` where the tier at hand ends before the residual's mean, or anything is at
/// fault.
fn read_residual(
    sections: &Sections<Spmm>,
    layer: u32,
    grid: [usize; 2],
    parameters: &Parameters,
    shape: [usize; 2],
    threads: Threads,
    faults: &mut Faults,
) -> Option<Residual> {
    let clusters = parameters.clusters;
    let factors = sections.get_in_tier(SectionKind::Factors, layer, 0, faults);
    let factors = factors.and_then(|reader| {
        let fits = basis_words(shape, clusters, parameters.components + 1) <= MAX_BASIS_WORDS;
        faults.keep(if fits { read_factors(reader, shape) } else { reader.bad(rule::BASES_TOO_LARGE) })
    });
    // Shared bases and means come together: without them there is no residual.
    let shared = sections.get_in_tier(SectionKind::SharedBases, layer, 0, faults);
    let shared = shared.and_then(|mut reader| {
        let steps = faults.keep(read_shared_steps(&mut reader))?;
        Some((steps, reader))
    });

    let there = components_at_hand(sections, layer, parameters.components as u32, faults);
    let (factors, (steps, reader)) = (factors?, shared?);
    if there.is_empty() {
        return None;
    }
    let (bases_at_hand, core_len) = (steps.len(), factors.core_len());
    // Streams do not depend on each other. Number 0 are the shared bases; then bases and coefficients by turns.
    enum Plane {
        Shared(Vec<i16>),
        Basis(Basis),
        Coefficients(Option<Coefficients>),
    }
    let decoded = map(threads, 1 + 2 * there.len(), |number| -> Result<Plane, FormatError> {
        let Some(number) = number.checked_sub(1) else {
            return reader.clone().plane(bases_at_hand * core_len, core_len).map(Plane::Shared);
        };
        let (basis, plane) = &there[number / 2];
        if number % 2 == 0 {
            let mut reader = basis.clone();
            let steps = reader.steps(clusters, MAX_BASIS_STEP)?;
            let values = reader.plane(clusters * bases_at_hand, bases_at_hand)?;
            return Ok(Plane::Basis(Basis { steps, values }));
        }
        let plane = plane.clone().map(|reader| read_coefficients(reader, grid));
        plane.transpose().map(Plane::Coefficients)
    });
    let (mut values, mut bases, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
    for plane in decoded {
        match faults.keep(plane) {
            Some(Plane::Shared(of_shared)) => values = of_shared,
            Some(Plane::Basis(basis)) => bases.push(basis),
            Some(Plane::Coefficients(plane)) => coefficients.extend(plane),
            None => {}
        }
    }
    Some(Residual { factors, shared: SharedBases { steps, values }, bases, coefficients, groups: Vec::new() })
}

/// The groups of predicted coefficients at hand, with their bases.
struct PredictedParts {
    /// Number of shared bases in the whole file.
    shared: usize,
    groups: Vec<PredictedGroup>,
    bases: Vec<Basis>,
    coefficients: Vec<Coefficients>,
}

/// What a PredictedCoefficients section begins with.
struct GroupHead {
    group: PredictedGroup,
    steps: Vec<f32>,
}

/// Reads the head of the group behind component `first`, and the number of shared bases.
fn read_group_head(reader: &mut Reader, first: usize) -> Result<(usize, GroupHead), FormatError> {
    let words = reader.words(7)?;
    let narrow = |word: u32| u8::try_from(word).ok();
    let inputs = [2, 3, 4, 5].map(|at| narrow(words[at]));
    let (shared, components) = (words[0] as usize, words[1] as usize);
    let ([Some(left), Some(above), Some(above_left), Some(above_right)], Some(own)) = (inputs, narrow(words[6])) else {
        return reader.bad(rule::GROUP);
    };
    let group = PredictedGroup { components, inputs: [left, above, above_left, above_right], own };
    if shared > MAX_SHARED || components > MAX_COMPONENTS || !group.is_valid_behind(first) {
        return reader.bad(rule::GROUP);
    }
    let steps = reader.steps(components, MAX_COEFFICIENT_STEP)?;
    Ok((shared, GroupHead { group, steps }))
}

/// Reads the groups of predicted coefficients that are at hand with their bases, one after the other; `None` if anything
/// is at fault.
fn read_predicted(
    sections: &Sections<Spmm>,
    layer: u32,
    (texel_clusters, width): (&[u8], usize),
    parameters: &Parameters,
    threads: Threads,
    faults: &mut Faults,
) -> Option<PredictedParts> {
    let (before, components) = (faults.len(), parameters.components);
    let (mut heads, mut first, mut shared) = (Vec::new(), 0, 0);
    let mut basis_readers = Vec::new();
    while first < components {
        let index = heads.len() as u32 + 1;
        let reader = sections.get_in_tier(SectionKind::PredictedCoefficients, layer, index, faults);
        let Some(mut reader) = reader else { break };
        let (of_group, head) = faults.keep(read_group_head(&mut reader, first))?;
        let end = first + head.group.components;
        if end > components || (index > 1 && of_group != shared) {
            return faults.keep(reader.bad(rule::GROUP));
        }
        shared = of_group;
        let bases = basis_readers.len()..end + 1;
        let own = bases.map_while(|j| sections.get_in_tier(SectionKind::Basis, layer, j as u32, faults));
        let own: Vec<Reader> = own.collect();
        if basis_readers.len() + own.len() <= end {
            break;
        }
        basis_readers.extend(own);
        heads.push((head, reader));
        first = end;
    }
    let bases = map(threads, basis_readers.len(), |j| -> Result<Basis, FormatError> {
        let mut reader = basis_readers[j].clone();
        let steps = reader.steps(parameters.clusters, MAX_BASIS_STEP)?;
        Ok(Basis { steps, values: reader.plane(parameters.clusters * shared, shared)? })
    });
    let bases: Vec<Basis> = bases.into_iter().filter_map(|basis| faults.keep(basis)).collect();
    // A texel of a cluster that is not there was told already.
    if faults.len() > before || bases.is_empty() {
        return None;
    }
    let steps: Vec<f32> = heads.iter().flat_map(|(head, _)| head.steps.iter().copied()).collect();
    let frame = |components| CoefficientFrame {
        width,
        texel_clusters,
        bases: &bases[..=components],
        steps: &steps[..components],
        components: steps.len(),
    };
    let mut codes = Vec::new();
    let mut first = 0;
    for (head, reader) in &mut heads {
        let frame = frame(first + head.group.components);
        let coded = read_group(reader.clone(), &frame, (&head.group, first), &mut codes);
        faults.keep(coded)?;
        first += head.group.components;
    }
    let plane = |(j, step): (usize, &f32)| Coefficients {
        step: *step,
        codes: codes.iter().skip(j).step_by(steps.len()).copied().collect(),
    };
    let coefficients = steps.iter().enumerate().map(plane).collect();
    Some(PredictedParts { shared, groups: heads.iter().map(|(head, _)| head.group).collect(), bases, coefficients })
}

/// Reads the stream of a group. `codes` are those of all components at hand, `[texel][component]`, or none yet.
fn read_group(
    mut reader: Reader,
    frame: &CoefficientFrame,
    (group, first): (&PredictedGroup, usize),
    codes: &mut Vec<i8>,
) -> Result<(), FormatError> {
    let bytes = reader.take(reader.bytes.len())?;
    let texels = frame.texel_clusters.len();
    bounded(texels * group.components, bytes).or_else(|reason| reader.bad(reason))?;
    if !frame.allows(group, first, bytes.len()) {
        return reader.bad(rule::GROUP_EFFORT);
    }
    codes.resize(texels * frame.components, 0);
    let mut decoder = Decoder::new(bytes);
    let mut given = Given { codes: &[], components: 0 };
    let fits = code_group(&mut decoder, &mut given, frame, (group, first), codes);
    decoder.ended().or_else(|reason| reader.bad(reason))?;
    if fits { Ok(()) } else { reader.bad(rule::NUMBER) }
}

/// Reads what a residual with predicted coefficients has beside them; `None` where the tier at hand ends before it, or
/// anything is at fault. Mixtures lack the shared bases that the tier lacks.
fn read_predicted_residual(
    sections: &Sections<Spmm>,
    layer: u32,
    parts: &PredictedParts,
    parameters: &Parameters,
    shape: [usize; 2],
    threads: Threads,
    faults: &mut Faults,
) -> Option<Residual> {
    let before = faults.len();
    let as_codes = sections.find(SectionKind::FactorCodes, layer, 0);
    let factors = match as_codes {
        Some(reader) => faults.keep(read_factor_codes(reader, shape)),
        None => {
            let reader = sections.get_in_tier(SectionKind::Factors, layer, 0, faults);
            reader.and_then(|reader| faults.keep(read_factors(reader, shape)))
        }
    };
    if let Some(reader) = sections.find(SectionKind::SharedBasesPart, layer, 0)
        && basis_words(shape, parameters.clusters, parameters.components + 1) > MAX_BASIS_WORDS
    {
        return faults.keep(reader.bad(rule::BASES_TOO_LARGE));
    }
    let readers: Vec<Reader> =
        (0..2).map_while(|index| sections.get_in_tier(SectionKind::SharedBasesPart, layer, index, faults)).collect();
    let factors = factors?;
    let core = factors.core_len();
    let read = map(threads, readers.len(), |index| read_shared_part(readers[index].clone(), parts.shared, core));
    let read: Vec<SharedBases> = read.into_iter().filter_map(|part| faults.keep(part)).collect();
    if faults.len() > before || read.is_empty() {
        return None;
    }
    let mut shared = SharedBases { steps: Vec::new(), values: Vec::new() };
    for part in read {
        shared.steps.extend(part.steps);
        shared.values.extend(part.values);
    }
    if shared.steps.len() > parts.shared || (sections.whole && shared.steps.len() < parts.shared) {
        return faults.keep(readers[0].bad(rule::SHARED_COUNT));
    }
    let PredictedParts { groups, bases, coefficients, .. } = parts;
    let (groups, mut bases, coefficients) = (groups.clone(), bases.clone(), coefficients.clone());
    for basis in &mut bases {
        let rows = basis.values.chunks_exact(parts.shared.max(1));
        basis.values = rows.flat_map(|row| &row[..shared.steps.len()]).copied().collect();
    }
    Some(Residual { factors, shared, bases, coefficients, groups })
}

fn read_shared_part(mut reader: Reader, most: usize, core: usize) -> Result<SharedBases, FormatError> {
    let count = reader.words(1)?[0] as usize;
    if count > most {
        return reader.bad(rule::SHARED_COUNT);
    }
    let steps = reader.steps(count, MAX_BASIS_STEP)?;
    let bytes = reader.take(reader.bytes.len())?;
    bounded(count * core, bytes).or_else(|reason| reader.bad(reason))?;
    let mut values = vec![0i16; count * core];
    let mut decoder = Decoder::new(bytes);
    let fits = code_columns(&mut decoder, &mut values, core);
    decoder.ended().or_else(|reason| reader.bad(reason))?;
    if fits { Ok(SharedBases { steps, values }) } else { reader.bad(rule::NUMBER) }
}

fn read_ranks(reader: &mut Reader) -> Result<[[usize; 2]; 3], FormatError> {
    let words = reader.words(8)?;
    let ranks = [0, 1, 2].map(|c| [words[2 * c] as usize, words[2 * c + 1] as usize]);
    if ranks.iter().flatten().any(|rank| *rank > MAX_RANK) || words[6] | words[7] != 0 {
        return reader.bad(rule::RANK);
    }
    Ok(ranks)
}

fn read_factor_codes(mut reader: Reader, shape: [usize; 2]) -> Result<Factors, FormatError> {
    let ranks = read_ranks(&mut reader)?;
    let count: usize = ranks.iter().flatten().sum();
    let exponents = reader.padded_bytes(count)?;
    if exponents.iter().any(|exponent| *exponent > MAX_EXPONENT) {
        return reader.bad(rule::EXPONENT);
    }
    let bytes = reader.take(reader.bytes.len())?;
    let numbers = ranks.iter().map(|[rv, rl]| rv * shape[0] + rl * shape[1]).sum();
    bounded(numbers, bytes).or_else(|reason| reader.bad(reason))?;
    let matrices = ranks.map(|rank| [0, 1].map(|side| vec![0i16; rank[side] * shape[side]]));
    let mut codes = FactorCodes { exponents, matrices };
    let mut decoder = Decoder::new(bytes);
    let fits = codes.code(&mut decoder, shape);
    decoder.ended().or_else(|reason| reader.bad(reason))?;
    if fits { Ok(codes.factors(shape, ranks)) } else { reader.bad(rule::NUMBER) }
}

/// Finds the sections of a residual's mean and components that are at hand: the basis of each, and the coefficients of
/// a component.
fn components_at_hand<'a>(
    sections: &Sections<'a, Spmm>,
    layer: u32,
    components: u32,
    faults: &mut Faults,
) -> Vec<(Reader<'a>, Option<Reader<'a>>)> {
    let mut there = Vec::new();
    for index in 0..=components {
        let basis = sections.get_in_tier(SectionKind::Basis, layer, index, faults);
        let plane = match index {
            0 => None,
            _ => sections.get_in_tier(SectionKind::Coefficients, layer, index, faults),
        };
        match basis {
            Some(basis) if index == 0 || plane.is_some() => there.push((basis, plane)),
            // Nothing is read behind a gap; in a whole file every gap is told.
            _ if sections.whole => {}
            _ => break,
        }
    }
    there
}

fn read_factors(mut reader: Reader, shape: [usize; 2]) -> Result<Factors, FormatError> {
    let ranks = read_ranks(&mut reader)?;
    let mut view = [const { Vec::new() }; 3];
    let mut light = [const { Vec::new() }; 3];
    for channel in 0..3 {
        view[channel] = reader.halves(shape[0] * ranks[channel][0])?;
        light[channel] = reader.halves(shape[1] * ranks[channel][1])?;
    }
    reader.end()?;
    Ok(Factors { shape, ranks, view, light })
}

fn read_shared_steps(reader: &mut Reader) -> Result<Vec<f32>, FormatError> {
    let shared = reader.words(1)?[0] as usize;
    if shared > MAX_SHARED { reader.bad(rule::SHARED_COUNT) } else { reader.steps(shared, MAX_BASIS_STEP) }
}
