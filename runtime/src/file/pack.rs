//! Writes an [`Asset`] as bytes. The same asset always gives the same bytes.

use crate::asset::asset::{Asset, Layer, LevelTexels, LobeRole, doubled_sides, level_sizes};
use crate::asset::dictionary::{DictionaryLobe, LobeRef, refs_exist};
use crate::asset::edit::{Edit, MAX_EDITS};
use crate::asset::heights::Heights;
use crate::asset::limits::EPSILON_RANGE;
use crate::asset::limits::MAX_HEIGHT_STEP;
use crate::asset::limits::{
    MAX_BASIS_STEP, MAX_BASIS_WORDS, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_DICTIONARY, MAX_LAYERS,
    MAX_NODES, MAX_RANK, MAX_SHARED, MAX_SIDE, MAX_WEIGHT_INPUTS, basis_words,
};
use crate::asset::lobe::Lobe;
use crate::asset::lobe_weights::LobeWeights;
use crate::asset::relief::Relief;
use crate::asset::residual::{Coefficients, Factors, PredictedGroup, Residual};
use crate::asset::spectrum::Spectrum;
use crate::container::entropy::{Encoder, Signed, bounded, code_plane, encode_plane};
use crate::container::writer::{SectionSource, write_file_of};
use crate::error::FormatError;
use crate::file::coefficient_coding::{CoefficientFrame, encode_groups};
use crate::file::format::{Form, Head, SectionKind, Spmm, in_mm_range, version_of};
use crate::file::residual_coding::{FactorCodes, shared_stream};
use crate::file::texel_coding::{MAX_FRESH, code_clusters, code_counts, code_refs, encode_refs};
use half::f16;

fn refuse<T>(reason: &str) -> Result<T, FormatError> {
    Err(FormatError::Pack { reason: reason.to_string() })
}

fn bytes_from_words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn push_halves(bytes: &mut Vec<u8>, halves: &[f16]) {
    bytes.extend(halves.iter().flat_map(|x| x.to_bits().to_le_bytes()));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

/// Packs an asset into bytes, which `btf-fit` writes to an `.spmm` file.
///
/// Sections that every tier needs come first; then the coefficients that lobes depend on and then the residual of all
/// layers, both component by component, each of which ends a tier; then the levels, which end one tier together. Errors
/// name the rule of format.md that the asset breaks.
pub fn pack(asset: &Asset) -> Result<Vec<u8>, FormatError> {
    check(asset)?;
    let streams_of = |layer: &Layer| match &layer.residual {
        Some(residual) => encode_groups(residual, asset.width, &layer.texel_clusters),
        None => Vec::new(),
    };
    let streams: Vec<Vec<Vec<u8>>> = asset.layers.iter().map(streams_of).collect();
    for (layer, streams) in asset.layers.iter().zip(&streams) {
        check_effort(layer, asset.width, streams)?;
    }
    write(asset, &streams)
}

/// Returns the number of bytes of an asset whose predicted coefficients take `group_bytes` bytes, `[layer][group]`: what
/// [`crate::choose_coefficients`] tells.
///
/// # Errors
/// Those of [`pack`].
pub fn packed_len(asset: &Asset, group_bytes: &[Vec<usize>]) -> Result<usize, FormatError> {
    check(asset)?;
    let empty = |groups: &Vec<usize>| groups.iter().map(|bytes| vec![0; *bytes]).collect();
    Ok(write(asset, &group_bytes.iter().map(empty).collect::<Vec<_>>())?.len())
}

/// Checks everything but what depends on streams.
fn check(asset: &Asset) -> Result<(), FormatError> {
    check_head(asset)?;
    let groups = asset.spectrum.as_ref().map_or(1, |spectrum| spectrum.groups);
    if !asset.layers.iter().all(|layer| layer.lights.repeats(groups)) {
        return refuse("its lights must be there once for each group of channels");
    }
    asset.layers.iter().try_for_each(|layer| check_layer(layer, asset.texel_count()))
}

/// Writes an asset; `streams` are those of predicted coefficients, `[layer][group]`.
fn write(asset: &Asset, streams: &[Vec<Vec<u8>>]) -> Result<Vec<u8>, FormatError> {
    let mut sections = vec![SectionSource {
        kind: SectionKind::Material,
        layer: 0,
        index: 0,
        bytes: asset.material.clone().into_bytes(),
        ends_tier: false,
    }];
    if !asset.edits.list.is_empty() {
        let bytes = edit_bytes(asset)?;
        sections.push(SectionSource { kind: SectionKind::Edits, layer: 0, index: 0, bytes, ends_tier: false });
    }
    if let Some(spectrum) = &asset.spectrum {
        let bytes = bytes_from_words(&spectrum.to_words());
        sections.push(SectionSource { kind: SectionKind::Spectrum, layer: 0, index: 0, bytes, ends_tier: false });
    }
    let last = asset.layers.len() - 1;
    for (number, layer) in asset.layers.iter().enumerate() {
        push_base_sections(&mut sections, layer, asset.width, number as u32, number == last);
    }
    push_predicted(&mut sections, asset, streams);
    for index in 1..=asset.layers.iter().map(lobe_inputs).max().unwrap_or(0) {
        push_lobe_inputs(&mut sections, asset, index);
    }
    let deepest = asset.layers.iter().filter_map(plain_residual).map(|r| r.bases.len()).max();
    for index in 0..deepest.unwrap_or(0) {
        for (number, layer) in asset.layers.iter().enumerate() {
            push_residual_sections(&mut sections, layer, asset.width, number as u32, index);
        }
        if let Some(section) = sections.last_mut() {
            section.ends_tier = true;
        }
    }
    let sizes = level_sizes([asset.width, asset.height]);
    for (number, level) in asset.levels.iter().enumerate() {
        if sizes.get(number) != Some(&[level.width, level.height]) || level.layers.len() != asset.layers.len() {
            return refuse("a level has not half the size of the one before, or not every layer");
        }
        for (layer, texels) in level.layers.iter().enumerate() {
            check_level(texels, &asset.layers[layer], level.width * level.height)?;
            let bytes = level_bytes(texels, level.width);
            let (kind, layer, index) = (SectionKind::Level, layer as u32, number as u32 + 1);
            sections.push(SectionSource { kind, layer, index, bytes, ends_tier: false });
        }
    }
    // A layer with relief has lobes as base.
    let is_new = |layer: &Layer| {
        let predicted = layer.residual.as_ref().is_some_and(|residual| !residual.groups.is_empty());
        layer.lobe_role == LobeRole::Base || layer.lobe_weights.is_some() || predicted
    };
    let head = Head {
        version: version_of(asset.spectrum.is_some(), asset.layers.iter().any(is_new)),
        form: Form::File,
        width: asset.width as u32,
        height: asset.height as u32,
        layers: asset.layers.len() as u32,
        size_mm: asset.size_mm,
        seamless: asset.seamless,
        spectral: asset.spectrum.is_some(),
    };
    write_file_of::<Spmm>(&head, &sections)
}

/// Checks the asset's size, its physical size and the sides of its layers.
fn check_head(asset: &Asset) -> Result<(), FormatError> {
    let in_side = |side: usize| side >= 1 && side <= MAX_SIDE as usize;
    if !in_side(asset.width) || !in_side(asset.height) {
        return refuse("width and height must be 1 to 16384");
    }
    if !asset.size_mm.is_none_or(in_mm_range) {
        return refuse("its physical size must be above 0 mm and at most 1000000 mm");
    }
    if !asset.spectrum.as_ref().is_none_or(Spectrum::is_valid) {
        return refuse(
            "its bands must be 1 to 256 ascending wavelengths of 100 to 20000 nm with weights of at most 1000",
        );
    }
    if asset.layers.is_empty() || asset.layers.len() > MAX_LAYERS {
        return refuse("it must have 1 to 4 layers");
    }
    if doubled_sides(&asset.layers).is_some() {
        return refuse("no two layers may have the same sides of light and eye");
    }
    Ok(())
}

/// Checks the asset's edits and returns the bytes of the Edits section.
fn edit_bytes(asset: &Asset) -> Result<Vec<u8>, FormatError> {
    let edits = &asset.edits;
    if edits.list.len() > MAX_EDITS || !edits.list.iter().all(Edit::in_range) {
        return refuse("it has more than 255 edits, or one with a number out of its range");
    }
    if edits.texels.len() != asset.texel_count()
        || edits.texels.iter().any(|edit| usize::from(*edit) > edits.list.len())
    {
        return refuse("the edits do not fit the texels");
    }
    if !asset.layers.iter().all(|layer| edits.fit(&layer.dictionary)) {
        return refuse("its edited lobes would take more than 64 MiB; use fewer edits");
    }
    let mut bytes = bytes_from_words(&[edits.list.len() as u32]);
    bytes.extend(edits.list.iter().flat_map(|edit| edit.numbers()).flat_map(f32::to_le_bytes));
    bytes.extend(coded(|coder| code_clusters(coder, &mut edits.texels.clone(), asset.width)));
    Ok(bytes)
}

/// Checks a layer at the finest level, which has `texels` texels.
fn check_layer(layer: &Layer, texels: usize) -> Result<(), FormatError> {
    let clusters = layer.dictionary.len();
    if clusters == 0 || clusters > MAX_CLUSTERS || layer.dictionary.iter().any(|d| d.len() > MAX_DICTIONARY) {
        return refuse("a layer needs 1 to 256 clusters of at most 256 lobes");
    }
    check_texels(
        [&layer.texel_clusters, &layer.texel_lobe_counts],
        &layer.lobe_refs,
        layer.heights.as_ref(),
        &layer.dictionary,
        texels,
    )?;
    if layer.relief.is_some_and(|relief| !layer.may_have_relief() || Relief::from_numbers(relief.numbers()).is_none()) {
        return refuse(
            "relief needs heights, the root curve and predicted lobes as base, and shares within their ranges",
        );
    }
    if !EPSILON_RANGE.contains(&layer.epsilon) {
        return refuse("epsilon must be 1e-6 to 1");
    }
    let readable = |entry: &DictionaryLobe| Lobe::from_words(entry.lobe.to_words(entry.weight_scale)).is_some();
    if !layer.dictionary.iter().flatten().all(readable) {
        return refuse("a lobe's parameter or weight scale is out of its range; use Lobe::clamped");
    }
    if let Some(weights) = &layer.lobe_weights {
        check_lobe_weights(weights, &layer.dictionary)?;
    }
    match &layer.residual {
        Some(residual) => check_residual(residual, layer, texels),
        None => Ok(()),
    }
}

/// Checks the lobe weights of a layer.
fn check_lobe_weights(weights: &LobeWeights, dictionary: &[Vec<DictionaryLobe>]) -> Result<(), FormatError> {
    let lobes: usize = dictionary.iter().map(Vec::len).sum();
    let positive = |x: &f32| *x > 0.0 && x.is_finite();
    if weights.units.len() > MAX_WEIGHT_INPUTS
        || weights.codes.len() != 3 * lobes * (1 + weights.units.len())
        || !positive(&weights.step)
        || !weights.units.iter().all(positive)
    {
        return refuse(
            "the lobe weights do not fit the dictionaries, depend on more than 16 coefficients, or have a step or unit that is not above 0",
        );
    }
    let nodes = &weights.nodes;
    if nodes.len() > dictionary.len()
        || nodes.iter().any(|nodes| nodes.len() > MAX_NODES)
        || nodes.iter().flatten().any(|node| node.len() != weights.units.len())
    {
        return refuse("a cluster of the lobe weights has more than 64 nodes, or a node not one code for each unit");
    }
    Ok(())
}

/// Checks the residual of a layer.
fn check_residual(residual: &Residual, layer: &Layer, texels: usize) -> Result<(), FormatError> {
    let (clusters, factors) = (layer.dictionary.len(), &residual.factors);
    if residual.bases.is_empty()
        || residual.bases.len() > MAX_COMPONENTS + 1
        || residual.coefficients.len() + 1 != residual.bases.len()
    {
        return refuse("a residual needs a mean and at most 128 components, each with coefficients");
    }
    if factors.shape != [layer.views.len(), layer.lights.len()]
        || factors.ranks.iter().flatten().any(|rank| *rank > MAX_RANK)
    {
        return refuse("the factors do not fit the direction sets");
    }
    for channel in 0..3 {
        let [rv, rl] = factors.ranks[channel];
        if factors.view[channel].len() != factors.shape[0] * rv || factors.light[channel].len() != factors.shape[1] * rl
        {
            return refuse("a factor matrix does not fit its ranks");
        }
    }
    let finite = |halves: &[f16]| halves.iter().all(|x| x.is_finite());
    if !factors.view.iter().chain(&factors.light).all(|matrix| finite(matrix)) {
        return refuse("a factor is not a finite half-precision number");
    }
    if basis_words(factors.shape, clusters, residual.bases.len()) > MAX_BASIS_WORDS {
        return refuse("its bases would take more than 1 GiB when expanded; use fewer clusters or components");
    }
    let shared = residual.shared.steps.len();
    let steps_fit = |steps: &[f32], most: f32| steps.iter().all(|step| (0.0..=most).contains(step));
    if shared > MAX_SHARED
        || residual.shared.values.len() != shared * factors.core_len()
        || !steps_fit(&residual.shared.steps, MAX_BASIS_STEP)
    {
        return refuse("the shared bases do not fit the ranks, are more than 1024, or have a step out of range");
    }
    for basis in &residual.bases {
        if basis.steps.len() != clusters || basis.values.len() != clusters * shared {
            return refuse("a basis does not fit the clusters and the shared bases");
        }
        if !steps_fit(&basis.steps, MAX_BASIS_STEP) {
            return refuse("a basis' step is out of range");
        }
    }
    let mut first = 0;
    for group in &residual.groups {
        if !group.is_valid_behind(first) {
            return refuse(
                "a group of predicted coefficients has no component, or inputs that are not decoded before it",
            );
        }
        first += group.components;
    }
    if !residual.groups.is_empty() && first != residual.coefficients.len() {
        return refuse("the groups of predicted coefficients are not all components");
    }
    if !residual.groups.is_empty() {
        for (j, plane) in residual.coefficients.iter().enumerate() {
            let has: Vec<bool> = (0..clusters).map(|cluster| residual.has_component(cluster, j + 1)).collect();
            let lacks = |(code, cluster): (&i8, &u8)| *code != 0 && !has[usize::from(*cluster)];
            if plane.codes.iter().zip(&layer.texel_clusters).any(lacks) {
                return refuse("a texel has a predicted coefficient of a component that its cluster lacks");
            }
        }
    }
    for plane in &residual.coefficients {
        if plane.codes.len() != texels || !steps_fit(&[plane.step], MAX_COEFFICIENT_STEP) {
            return refuse("a coefficient plane does not fit the texels or its step is out of range");
        }
    }
    Ok(())
}

/// Checks the arrays of a level with `texels` texels: they are complete, and refer to clusters and lobes that exist.
fn check_texels(
    [clusters, lobe_counts]: [&[u8]; 2],
    lobe_refs: &[LobeRef],
    heights: Option<&Heights>,
    dictionary: &[Vec<DictionaryLobe>],
    texels: usize,
) -> Result<(), FormatError> {
    if clusters.len() != texels || lobe_counts.len() != texels {
        return refuse("a per-texel array has not one entry per texel");
    }
    if clusters.iter().any(|cluster| usize::from(*cluster) >= dictionary.len()) {
        return refuse("a texel names a cluster that is not there");
    }
    let total: usize = lobe_counts.iter().map(|count| usize::from(*count)).sum();
    if total != lobe_refs.len() {
        return refuse("the lobe counts do not add up to the references");
    }
    if !refs_exist(clusters, lobe_counts, lobe_refs, dictionary) {
        return refuse("a texel names a lobe that its cluster does not have");
    }
    match heights {
        Some(heights) if heights.codes.len() != texels || !(heights.step > 0.0 && heights.step <= MAX_HEIGHT_STEP) => {
            refuse("the heights do not fit the texels or their step is out of range")
        }
        _ => Ok(()),
    }
}

fn check_level(level: &LevelTexels, layer: &Layer, texels: usize) -> Result<(), FormatError> {
    let most = layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    if level.codes.len() > most || level.codes.iter().any(|plane| plane.len() != texels) {
        return refuse("a level has more components than its layer, or a plane that does not fit its texels");
    }
    let per_texel: [&[u8]; 2] = [&level.clusters, &level.lobe_counts];
    check_texels(per_texel, &level.lobe_refs, level.heights.as_ref(), &layer.dictionary, texels)
}

/// Returns the bytes of a Level section. The stream is long enough to bound its numbers, see [`encode_refs`].
fn level_bytes(level: &LevelTexels, width: usize) -> Vec<u8> {
    let step = level.heights.as_ref().map_or(0.0, |heights| heights.step);
    let head = bytes_from_words(&[level.codes.len() as u32, step.to_bits()]);
    let planes: Vec<&Vec<i8>> = level.heights.iter().map(|heights| &heights.codes).chain(&level.codes).collect();
    let mut fresh_every = MAX_FRESH;
    loop {
        let stream = coded(|coder| {
            code_clusters(coder, &mut level.clusters.clone(), width);
            code_counts(coder, &mut level.lobe_counts.clone(), &level.clusters);
            code_refs(coder, &mut level.lobe_refs.clone(), &level.clusters, &level.lobe_counts, fresh_every);
            for plane in &planes {
                code_plane(coder, &mut Signed::new(), &mut plane.to_vec(), width);
            }
        });
        if fresh_every == 1 || bounded(level.lobe_refs.len(), &stream).is_ok() {
            return [head, stream].concat();
        }
        fresh_every /= 4;
    }
}

/// Returns the bytes that `code` writes.
fn coded(code: impl FnOnce(&mut Encoder)) -> Vec<u8> {
    let mut coder = Encoder::new();
    code(&mut coder);
    coder.finish()
}

fn push_base_sections(
    sections: &mut Vec<SectionSource<SectionKind>>,
    layer: &Layer,
    width: usize,
    number: u32,
    ends_tier: bool,
) {
    let mut push = |kind, index, bytes: Vec<u8>, ends_tier| {
        sections.push(SectionSource { kind, layer: number, index, bytes, ends_tier });
    };
    let components = layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    let words = [
        layer.light_side as u32,
        layer.view_side as u32,
        layer.residual_kind as u32,
        layer.epsilon.to_bits(),
        layer.dictionary.len() as u32,
        components as u32,
        u32::from(layer.residual.is_some()),
        layer.lobe_role as u32,
    ];
    push(SectionKind::Layer, 0, bytes_from_words(&words), false);
    push(SectionKind::Directions, 0, bytes_from_words(&layer.lights.to_file_words()), false);
    push(SectionKind::Directions, 1, bytes_from_words(&layer.views.to_file_words()), false);
    if let Some(heights) = &layer.heights {
        let mut bytes = bytes_from_words(&[heights.step.to_bits()]);
        bytes.extend(encode_plane(&heights.codes, width));
        push(SectionKind::Height, 0, bytes, false);
    }
    if let Some(relief) = &layer.relief {
        push(SectionKind::Relief, 0, bytes_from_words(&relief.numbers().map(f32::to_bits)), false);
    }
    let ids = coded(|coder| code_clusters(coder, &mut layer.texel_clusters.clone(), width));
    let mut words: Vec<u32> = layer.dictionary.iter().map(|lobes| lobes.len() as u32).collect();
    words.extend(layer.dictionary.iter().flatten().flat_map(|entry| entry.lobe.to_words(entry.weight_scale)));
    let dictionary = bytes_from_words(&words);
    let weights = layer.lobe_weights.as_ref().map(|weights| lobe_weight_bytes(layer, weights));
    let bytes = [&ids, &dictionary].into_iter().chain(&weights).map(Vec::len).sum();
    let predicted = layer.may_predict_lobes(bytes) && layer.has_predicted_lobes();
    push(SectionKind::TexelClusters, 0, ids, false);
    if !predicted {
        let counts = coded(|coder| code_counts(coder, &mut layer.texel_lobe_counts.clone(), &layer.texel_clusters));
        push(SectionKind::TexelLobeCounts, 0, counts, false);
    }
    push(SectionKind::Dictionary, 0, dictionary, false);
    if let Some(bytes) = weights {
        push(SectionKind::LobeWeights, 0, bytes, ends_tier && predicted);
    }
    if predicted {
        return;
    }
    let refs = encode_refs(&layer.lobe_refs, &layer.texel_clusters, &layer.texel_lobe_counts);
    push(SectionKind::LobeRefs, 0, refs, ends_tier);
}

/// Returns the bytes of the LobeWeights section.
fn lobe_weight_bytes(layer: &Layer, weights: &LobeWeights) -> Vec<u8> {
    let count = weights.nodes.iter().map(Vec::len).max().unwrap_or(0);
    let of_texels = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), count) == weights.nodes;
    let mut words = vec![weights.units.len() as u32, count as u32, u32::from(!of_texels), weights.step.to_bits()];
    words.extend(weights.units.iter().map(|unit| unit.to_bits()));
    if !of_texels {
        words.extend((0..layer.dictionary.len()).map(|k| weights.nodes.get(k).map_or(0, Vec::len) as u32));
    }
    let mut bytes = bytes_from_words(&words);
    bytes.extend(coded(|coder| {
        code_plane(coder, &mut Signed::new(), &mut weights.codes.clone(), 1 + weights.units.len());
        if !of_texels {
            let mut inputs: Vec<i8> = weights.nodes.iter().flatten().flatten().copied().collect();
            code_plane(coder, &mut Signed::new(), &mut inputs, weights.units.len());
        }
    }));
    bytes
}

fn push_residual_sections(
    sections: &mut Vec<SectionSource<SectionKind>>,
    layer: &Layer,
    width: usize,
    number: u32,
    index: usize,
) {
    let Some(residual) = plain_residual(layer) else {
        return;
    };
    if index >= residual.bases.len() {
        return;
    }
    let mut push = |kind, index: usize, bytes: Vec<u8>| {
        sections.push(SectionSource { kind, layer: number, index: index as u32, bytes, ends_tier: false });
    };
    let bits = |steps: &[f32]| steps.iter().map(|step| step.to_bits()).collect::<Vec<u32>>();
    let factors = &residual.factors;
    if index == 0 {
        push(SectionKind::Factors, 0, factor_bytes(factors));
        let mut bytes = bytes_from_words(&[residual.shared.steps.len() as u32]);
        bytes.extend(bytes_from_words(&bits(&residual.shared.steps)));
        bytes.extend(encode_plane(&residual.shared.values, factors.core_len()));
        push(SectionKind::SharedBases, 0, bytes);
    }
    push(SectionKind::Basis, index, basis_bytes(residual, index));
    // Coefficients that lobes depend on are there already.
    if let Some(component) = index.checked_sub(1).filter(|component| *component >= lobe_inputs(layer)) {
        push(SectionKind::Coefficients, index, coefficient_bytes(&residual.coefficients[component], width));
    }
}

/// Returns the bytes of a Factors section.
fn factor_bytes(factors: &Factors) -> Vec<u8> {
    let mut bytes = rank_bytes(factors);
    for channel in 0..3 {
        push_halves(&mut bytes, &factors.view[channel]);
        push_halves(&mut bytes, &factors.light[channel]);
    }
    bytes
}

fn rank_bytes(factors: &Factors) -> Vec<u8> {
    let mut words: Vec<u32> = factors.ranks.iter().flatten().map(|rank| *rank as u32).collect();
    words.extend([0, 0]);
    bytes_from_words(&words)
}

/// Returns the bytes of a Basis section.
fn basis_bytes(residual: &Residual, index: usize) -> Vec<u8> {
    let basis = &residual.bases[index];
    let mut bytes = bytes_from_words(&basis.steps.iter().map(|step| step.to_bits()).collect::<Vec<u32>>());
    bytes.extend(encode_plane(&basis.values, residual.shared.steps.len()));
    bytes
}

/// Returns the residual of a layer whose components are coded by themselves.
fn plain_residual(layer: &Layer) -> Option<&Residual> {
    layer.residual.as_ref().filter(|residual| residual.groups.is_empty())
}

/// A section of a layer: kind, index and bytes.
type IndexedSection = (SectionKind, usize, Vec<u8>);

/// Pushes the residuals whose coefficients are predicted. Tiers: the first group with its bases, by which lobes vary; the
/// factors and the first shared bases; the other shared bases; each other group with its bases.
fn push_predicted(sections: &mut Vec<SectionSource<SectionKind>>, asset: &Asset, streams: &[Vec<Vec<u8>>]) {
    let predicted = |layer: &Layer| layer.residual.as_ref().filter(|residual| !residual.groups.is_empty()).cloned();
    let residuals: Vec<Option<Residual>> = asset.layers.iter().map(predicted).collect();
    let groups = residuals.iter().flatten().map(|residual| residual.groups.len()).max().unwrap_or(0);
    let mut tier = |kinds: &dyn Fn(&Residual, usize) -> Vec<IndexedSection>| {
        for (number, residual) in residuals.iter().enumerate() {
            for (kind, index, bytes) in residual.iter().flat_map(|residual| kinds(residual, number)) {
                let (layer, index) = (number as u32, index as u32);
                sections.push(SectionSource { kind, layer, index, bytes, ends_tier: false });
            }
        }
        if let Some(section) = sections.last_mut() {
            section.ends_tier = true;
        }
    };
    for index in 0..groups {
        tier(&|residual, layer| {
            let Some(group) = residual.groups.get(index) else { return Vec::new() };
            let first: usize = residual.groups[..index].iter().map(|group| group.components).sum();
            let bases = if index == 0 { 0 } else { first + 1 }..first + group.components + 1;
            let bases = bases.map(|j| (SectionKind::Basis, j, basis_bytes(residual, j)));
            let bytes = group_bytes(residual, (group, first), &streams[layer][index]);
            bases.chain([(SectionKind::PredictedCoefficients, index + 1, bytes)]).collect()
        });
        if index == 0 {
            tier(&|residual, _| {
                let factors = &residual.factors;
                let codes = FactorCodes::of(factors).map(|codes| factor_code_bytes(factors, codes));
                let factors = match codes {
                    Some(bytes) => (SectionKind::FactorCodes, 0, bytes),
                    None => (SectionKind::Factors, 0, factor_bytes(factors)),
                };
                vec![factors, (SectionKind::SharedBasesPart, 0, shared_bytes(residual, 0))]
            });
            tier(&|residual, _| vec![(SectionKind::SharedBasesPart, 1, shared_bytes(residual, 1))]);
        }
    }
}

/// Returns the bytes of a PredictedCoefficients section.
fn group_bytes(residual: &Residual, (group, first): (&PredictedGroup, usize), stream: &[u8]) -> Vec<u8> {
    let [left, above, above_left, above_right] = group.inputs.map(u32::from);
    let shared = residual.shared.steps.len() as u32;
    let components = group.components as u32;
    let mut words = vec![shared, components, left, above, above_left, above_right, group.own.into()];
    words.extend(residual.coefficients[first..first + group.components].iter().map(|plane| plane.step.to_bits()));
    [&bytes_from_words(&words), stream].concat()
}

/// Returns the bytes of a FactorCodes section.
fn factor_code_bytes(factors: &Factors, mut codes: FactorCodes) -> Vec<u8> {
    let mut bytes = rank_bytes(factors);
    bytes.extend(&codes.exponents);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend(coded(|coder| {
        codes.code(coder, factors.shape);
    }));
    bytes
}

/// Number of shared bases of the first part: enough for a picture of the means.
const FIRST_SHARED: usize = 24;

/// Returns the bytes of a SharedBasesPart section: of the first shared bases or of the others.
fn shared_bytes(residual: &Residual, part: usize) -> Vec<u8> {
    let (shared, core) = (&residual.shared, residual.factors.core_len());
    let first = FIRST_SHARED.min(shared.steps.len());
    let of_part = if part == 0 { 0..first } else { first..shared.steps.len() };
    let mut words = vec![of_part.len() as u32];
    words.extend(shared.steps[of_part.clone()].iter().map(|step| step.to_bits()));
    let mut bytes = bytes_from_words(&words);
    bytes.extend(shared_stream(&shared.values[of_part.start * core..of_part.end * core], core));
    bytes
}

/// Checks that predicted coefficients do not ask for more time and memory than their streams allow.
fn check_effort(layer: &Layer, width: usize, streams: &[Vec<u8>]) -> Result<(), FormatError> {
    let Some(residual) = &layer.residual else { return Ok(()) };
    let mut first = 0;
    for (group, stream) in residual.groups.iter().zip(streams) {
        let frame = CoefficientFrame {
            width,
            texel_clusters: &layer.texel_clusters,
            bases: &residual.bases,
            steps: &[],
            components: residual.coefficients.len(),
        };
        if !frame.allows(group, first, stream.len()) {
            return refuse("a group of predicted coefficients has more inputs than its length allows; use fewer");
        }
        first += group.components;
    }
    Ok(())
}

/// Returns the number of components that predicted lobes depend on and that are coded by themselves.
fn lobe_inputs(layer: &Layer) -> usize {
    let components = plain_residual(layer).map_or(0, |residual| residual.coefficients.len());
    layer.lobe_weights.as_ref().map_or(0, |weights| weights.units.len().min(components))
}

/// Pushes the coefficients of component `index`, counted from 1, of each layer whose lobes depend on it. They end a
/// tier.
fn push_lobe_inputs(sections: &mut Vec<SectionSource<SectionKind>>, asset: &Asset, index: usize) {
    for (number, layer) in asset.layers.iter().enumerate().filter(|(_, layer)| index <= lobe_inputs(layer)) {
        let Some(residual) = &layer.residual else { continue };
        let bytes = coefficient_bytes(&residual.coefficients[index - 1], asset.width);
        let (kind, layer) = (SectionKind::Coefficients, number as u32);
        sections.push(SectionSource { kind, layer, index: index as u32, bytes, ends_tier: false });
    }
    if let Some(section) = sections.last_mut() {
        section.ends_tier = true;
    }
}

/// Returns the bytes of a Coefficients section.
fn coefficient_bytes(plane: &Coefficients, width: usize) -> Vec<u8> {
    let mut bytes = bytes_from_words(&[plane.step.to_bits()]);
    bytes.extend(encode_plane(&plane.codes, width));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::testing::sample_asset;

    fn with(asset: &mut Asset) -> &mut Residual {
        asset.layers[0].residual.as_mut().unwrap()
    }

    #[test]
    fn the_packer_refuses_every_asset_that_the_parser_would_refuse() {
        let mut asset = sample_asset(1, 6, 5, ResidualKind::Root);
        assert!(pack(&asset).is_ok(), "the control must pass");
        type Change = fn(&mut Asset);
        let changes: [(&str, Change); 24] = [
            ("no width", |a| a.width = 0),
            ("too high", |a| a.height = 16_385),
            ("no layers", |a| a.layers.clear()),
            ("five layers", |a| a.layers = vec![a.layers[0].clone(); 5]),
            ("the same sides twice", |a| a.layers.push(a.layers[0].clone())),
            ("no clusters", |a| a.layers[0].dictionary.clear()),
            ("a short texel array", |a| {
                a.layers[0].texel_clusters.pop();
            }),
            ("an unknown cluster", |a| a.layers[0].texel_clusters[3] = 3),
            ("too few references", |a| {
                a.layers[0].lobe_refs.pop();
            }),
            ("an unknown lobe", |a| a.layers[0].lobe_refs[0].lobe = 9),
            ("epsilon 0", |a| a.layers[0].epsilon = 0.0),
            ("epsilon NaN", |a| a.layers[0].epsilon = f32::NAN),
            ("a lobe out of range", |a| a.layers[0].dictionary[1][7].lobe.params[0] = 0.01),
            ("a negative weight scale", |a| a.layers[0].dictionary[1][7].weight_scale = -1.0),
            ("a component without coefficients", |a| {
                with(a).coefficients.pop();
            }),
            ("a factor of another shape", |a| {
                with(a).factors.light[2].pop();
            }),
            ("an infinite factor", |a| with(a).factors.view[0][0] = f16::INFINITY),
            ("a short basis", |a| {
                with(a).bases[2].values.pop();
            }),
            ("a negative step", |a| with(a).bases[2].steps[0] = -1.0),
            ("short shared bases", |a| {
                with(a).shared.values.pop();
            }),
            ("a step of a shared basis too large", |a| with(a).shared.steps[0] = 2e4),
            ("a step that is not a number", |a| with(a).coefficients[0].step = f32::NAN),
            ("a short plane", |a| {
                with(a).coefficients[0].codes.pop();
            }),
            ("directions of another count", |a| with(a).factors.shape.reverse()),
        ];
        for (what, change) in changes {
            let mut bad = asset.clone();
            change(&mut bad);
            assert!(matches!(pack(&bad), Err(FormatError::Pack { .. })), "{what} must be refused");
        }
        // Without a residual it is an asset still.
        asset.layers[0].residual = None;
        let bytes = pack(&asset).unwrap();
        assert_eq!(Asset::parse(&bytes).unwrap(), asset);
    }
}
