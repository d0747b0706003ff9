//! The fit, stage by stage: read, project, cluster, dictionary, weights, residual, encode, measure.

use crate::error::FitError;
use crate::input::holdout::Holdout;
use crate::input::layer_frame::layer_directions;
use crate::input::residual_curve::Curve;
use crate::input::texel_sample::texel_sample;
use crate::input::tile_cache::{DecodedImages, Mapping, TileCache};
use crate::inspect::describe::resident_in_parallel;
use crate::measure::compare::{MeasureParams, colour_pair_stride, measure_images, stride_over_pairs};
use crate::monitor::Monitor;
use crate::params::{FitOutcome, FitParams, LobeFigures};
use crate::provenance::{FitRecord, Material, sides_of_capture};
use crate::resume::checkpoint::{Checkpoint, Stages};
use crate::resume::stored::{Input, Stored};
use crate::stages::budget::{Candidate, SEARCH_ROUNDS, within_bytes};
use crate::stages::candidates::candidate_lobes;
use crate::stages::dictionary::{Dictionary, Pairs, Target, build_dictionary};
use crate::stages::encode::Model;
use crate::stages::factor::Rotated;
use crate::stages::features::features;
use crate::stages::heights::{self, find_heights};
use crate::stages::kmeans::kmeans;
use crate::stages::local_pca::{local_pca, reassign};
use crate::stages::residual_source::{ResidualSource, TexelLobes};
use crate::stages::sparse::{ClusterLobes, Correlations, LobesOf, drop_unused, select};
use crate::stages::texel_coordinates::Coordinates;
use btf_capture::{Capture, CaptureInfo, Pixels};
use btf_runtime::{Asset, Layer, LobeRole, MAX_COMPONENTS, MAX_LAYERS, ResidualKind, Sphere, lobe_tables, pack};
use ndarray::{Array2, ArrayView2, s};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Principal directions that clusters are found in.
const FEATURE_DIMENSIONS: usize = 64;
/// Texels that these directions are found from.
const FEATURE_SAMPLE: usize = 2048;
/// Components of the models by which texels are moved between clusters, and rounds of that.
const REASSIGN_COMPONENTS: usize = 8;
const REASSIGN_ROUNDS: usize = 3;
/// Shared bases at most: the least and the most that are looked for, and how many more than the least per byte of
/// the texels' budget. Too few bound the error of a large asset (docs/results/results.md); more than a small one can use cost
/// time.
const MIN_SHARED_BASES: usize = 170;
const SHARED_BASES_PER_BYTE: f64 = 6.5;
const MAX_SHARED_BASES: usize = 640;
/// The same without a budget.
const SHARED_BASES: usize = 320;
/// Texels that they are found from.
const SHARED_SAMPLE: usize = 8192;
/// Representative texels per cluster.
const REPRESENTATIVES: usize = 12;
/// Lobes per dictionary.
const DICTIONARY_SIZE: usize = 32;
/// Pairs that a dictionary is fitted on at most.
const DICTIONARY_PAIRS: usize = 3400;
/// The same where lobes only guide: a third of the time, and their error stays the same.
const GUIDE_PAIRS: usize = 1100;
/// Texels that the clusters' means are taken from where lobes only guide.
const MEAN_SAMPLE: usize = 4096;
/// Texels that predicting held-back pairs is learnt from.
const HOLDOUT_SAMPLE: usize = 512;
/// Added to a reflectance before its tone weight is taken.
const TONE_EPSILON: f32 = 0.02;
/// The relative error that one more lobe must remove.
const LOBE_PRICE: f64 = 0.002;
/// Without a goal: components, and the step in the residual's curve relative to the root of the number of samples: a
/// third of that is the error of a sample that each component's rounding leaves.
const DEFAULT_COMPONENTS: usize = 8;
const DEFAULT_STEP: f64 = 0.001;
/// Rounds of encoding and measurement that a PSNR goal gets, and how far above the goal the sampled figure
/// must lie, so that the figure over all pairs reaches it.
const PSNR_ROUNDS: usize = 8;
const PSNR_MARGIN_DB: f64 = 0.03;
/// Room for the error figures in the material text and for its alignment: they are known only at the end.
pub(crate) const FIGURES_RESERVE: usize = 256;

/// Fits captures (the layers of one asset) and packs them.
///
/// Same captures, parameters and seed give the same bytes on any number of threads. Memory: at most
/// `params.memory_bytes`. One step size quantises all layers, so that a byte budget goes where it takes away most
/// error; a PSNR goal is one over all samples of all layers. The material text is empty: the caller describes the
/// asset and packs it again.
///
/// # Errors
/// What is wrong with a capture, or with several together; a budget or a memory limit that is too small.
pub fn fit(captures: &[Capture], params: &FitParams, monitor: &Monitor) -> Result<FitOutcome, FitError> {
    params.check()?;
    let checkpoint = Checkpoint::open(captures, params, monitor)?;
    Ok(fit_from(captures, params, &checkpoint, monitor)?.0)
}

/// The same with checked `params` and the stages that `checkpoint` keeps; with the images of a single capture, where
/// they are at hand.
pub(crate) fn fit_from(
    captures: &[Capture],
    params: &FitParams,
    checkpoint: &Checkpoint,
    monitor: &Monitor,
) -> Result<(FitOutcome, Option<DecodedImages>), FitError> {
    check_layers(captures)?;
    let mut images = None;
    let encoded = checkpoint.whole().load_or("encode", || {
        let (encoded, decoded) = prepare_and_encode(captures, params, checkpoint, monitor)?;
        images = decoded;
        Ok(encoded)
    })?;
    let asset = Asset::parse(&encoded.bytes)?;
    let references: usize = asset.layers.iter().map(|layer| layer.lobe_refs.len()).sum();
    let lobes_per_texel_mean = references as f64 / (asset.texel_count() * asset.layers.len()) as f64;
    let components = asset.layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    let clusters = asset.layers[0].dictionary.len();
    let Encoded { bytes, lobes, left_out } = encoded;
    Ok((FitOutcome { asset, bytes, lobes_per_texel_mean, lobes, components, clusters, left_out }, images))
}

/// A packed asset and what is not read off it.
struct Encoded {
    bytes: Vec<u8>,
    lobes: LobeFigures,
    left_out: Vec<usize>,
}

impl Stored for Encoded {
    fn put(&self, to: &mut dyn std::io::Write) -> std::io::Result<()> {
        self.bytes.put(to)?;
        self.lobes.put(to)?;
        self.left_out.put(to)
    }

    fn take(from: &mut Input) -> std::io::Result<Encoded> {
        Ok(Encoded { bytes: Vec::take(from)?, lobes: LobeFigures::take(from)?, left_out: Vec::take(from)? })
    }
}

fn prepare_and_encode(
    captures: &[Capture],
    params: &FitParams,
    checkpoint: &Checkpoint,
    monitor: &Monitor,
) -> Result<(Encoded, Option<DecodedImages>), FitError> {
    let PreparedFit { layers: prepared, grid, lobes, left_out, images, .. } =
        PreparedFit::prepare_from(captures, params, checkpoint, monitor)?;
    let budget = byte_budget(captures, params);
    let asset = monitor.stage("encode", || match (budget, params.psnr_db) {
        (Some(bytes), _) => within_budget(captures, &prepared, bytes, grid, params, monitor),
        (None, Some(db)) => within_error(captures, images.as_ref(), &prepared, db, grid, params, monitor),
        (None, None) => {
            let step = DEFAULT_STEP * (3.0 * captures[0].info().pair_count() as f64).sqrt();
            Ok(assemble(&prepared, step, grid, params).asset)
        }
    })?;
    Ok((Encoded { bytes: pack(&asset)?, lobes, left_out }, images))
}

/// A fit up to the choice of its step: what `fit` searches in and `trade` sweeps over.
pub struct PreparedFit {
    layers: Vec<Prepared>,
    /// Texels per row, rows.
    grid: [usize; 2],
    params: FitParams,
    lobes: LobeFigures,
    left_out: Vec<usize>,
    /// Those of a single capture: of several each would take its room until all are fitted.
    images: Option<DecodedImages>,
}

impl PreparedFit {
    /// Every stage but the last. Memory: at most `params.memory_bytes`; four bytes per texel and shared basis stay.
    ///
    /// # Errors
    /// As [`fit`], without those about a budget.
    pub fn prepare(captures: &[Capture], params: &FitParams, monitor: &Monitor) -> Result<PreparedFit, FitError> {
        params.check()?;
        check_layers(captures)?;
        PreparedFit::prepare_from(captures, params, &Checkpoint::open(captures, params, monitor)?, monitor)
    }

    /// The same of checked captures and parameters, with the stages that `checkpoint` keeps.
    fn prepare_from(
        captures: &[Capture],
        params: &FitParams,
        checkpoint: &Checkpoint,
        monitor: &Monitor,
    ) -> Result<PreparedFit, FitError> {
        let first = captures[0].info();
        let mut prepared = PreparedFit {
            layers: Vec::new(),
            grid: [first.width, first.height],
            params: params.clone(),
            lobes: LobeFigures::default(),
            left_out: Vec::new(),
            images: None,
        };
        for (number, capture) in captures.iter().enumerate() {
            let (sample, left) = plan_memory(capture.info(), params, captures.len() - 1)?;
            let stages = checkpoint.layer(number, sample);
            // A cache is held in memory if it takes at most half of what it is told: tell it twice what is left.
            let (most, kept) = (params.error.most(), Some(&stages));
            let cache = TileCache::new(capture, 2 * left, &params.cache_directory, most, kept, monitor)?;
            let (layer, figures, held_back) = prepare_layer(capture, &cache, params, sample, &stages, monitor)?;
            if number == 0 {
                (prepared.left_out, prepared.lobes) = (held_back, figures);
            }
            prepared.layers.push(layer);
            if captures.len() == 1 {
                prepared.images = cache.into_images();
            }
        }
        Ok(prepared)
    }

    /// The asset, without description, whose residuals are quantised with `step` and have at most `components`.
    pub fn asset(&self, step: f64, components: usize) -> Asset {
        let params = FitParams { components: Some(components), ..self.params.clone() };
        assemble(&self.layers, step, self.grid, &params).asset
    }

    /// The size of the greatest coefficient: steps are told relative to it.
    pub fn greatest_coefficient(&self) -> f64 {
        greatest_coefficient(&self.layers)
    }
}

/// What `--bytes` leaves for everything but the description.
fn byte_budget(captures: &[Capture], params: &FitParams) -> Option<usize> {
    params.bytes.map(|bytes| (bytes as usize).saturating_sub(description_bytes(captures, params)))
}

/// The most that the description of an asset of `captures` can take: what a byte budget leaves free for it.
pub fn description_bytes(captures: &[Capture], params: &FitParams) -> usize {
    let infos: Vec<&CaptureInfo> = captures.iter().map(Capture::info).collect();
    Material::new(&infos, FitRecord::new(params, MAX_COMPONENTS)).to_json().len() + FIGURES_RESERVE
}

/// Captures that become layers of one asset, at least one, have one texel grid and differ in their sides.
fn check_layers(captures: &[Capture]) -> Result<(), FitError> {
    let Some(first) = captures.first() else {
        return Err(FitError::Params("give at least one capture".to_string()));
    };
    let (width, height) = (first.info().width, first.info().height);
    if captures.len() > MAX_LAYERS {
        let path = captures[MAX_LAYERS].path_of(0, 0).into();
        return Err(FitError::Layers { path, reason: format!("an asset has at most {MAX_LAYERS} layers") });
    }
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        let reason = if (info.width, info.height) != (width, height) {
            format!("it is {} x {} texels, the first is {width} x {height}", info.width, info.height)
        } else if captures[..number].iter().any(|other| other.info().side == info.side) {
            format!("it shows the same side as another, `{}`", info.side)
        } else {
            continue;
        };
        return Err(FitError::Layers { path: capture.path_of(0, 0).into(), reason });
    }
    Ok(())
}

fn bytes_in_words(bytes: usize) -> String {
    format!("{:.0} MB", bytes as f64 / 1e6)
}

/// Shared bases that are looked for in a capture of `texels` texels.
fn shared_bases(params: &FitParams, texels: usize) -> usize {
    let Some(bytes) = params.bytes else {
        return SHARED_BASES;
    };
    let more = SHARED_BASES_PER_BYTE * bytes as f64 / texels as f64;
    (MIN_SHARED_BASES + more as usize).min(MAX_SHARED_BASES)
}

/// Texels of the sample that shared bases are found from, and what the memory limit leaves for the decoded capture,
/// while `waiting` other layers wait for their step with their coordinates in memory.
fn plan_memory(info: &CaptureInfo, params: &FitParams, waiting: usize) -> Result<(usize, u64), FitError> {
    let (texels, samples) = (info.texel_count(), info.pair_count() * 3);
    let clusters = params.clusters.min(texels);
    let threads = rayon::current_num_threads();
    let rank = shared_bases(params, texels).min(samples).min(texels);
    // Features, coordinates (those of one layer three times while it is encoded), products and choices of all
    // texels; one block twice as 8-bit or half samples and rows as floats; candidates' tables per thread; the
    // shared bases and what finds and factors them.
    let fixed = texels * (4 * FEATURE_DIMENSIONS + 4 * rank * (3 + waiting) + 12 * DICTIONARY_SIZE + 1024)
        + 1024.min(texels) * samples * 2 * 2
        + threads * 4 * 256.min(texels) * samples
        + (2 * threads + 1) * 4 * DICTIONARY_PAIRS.min(info.pair_count()) * 900
        + threads * 8 * 900 * 900
        + clusters * samples * 4 * (REPRESENTATIVES / 2 + (1 + waiting) * DICTIONARY_SIZE / 3)
        + (6 + waiting) * 4 * rank * samples
        + if params.heights { texels * heights::bytes_per_texel() } else { 0 }
        + 100_000_000;
    let limit = params.memory_bytes as usize;
    let least_sample = (2 * rank).min(SHARED_SAMPLE).min(texels);
    // Sampled texels lie in the form of the cache.
    let needed = fixed + 2 * least_sample * samples;
    if limit < needed {
        return Err(FitError::Memory { given: bytes_in_words(limit), needed: bytes_in_words(needed) });
    }
    let sample = ((limit - fixed) / 2 / (2 * samples).max(1)).clamp(least_sample, SHARED_SAMPLE.min(texels));
    Ok((sample, (limit - fixed - 2 * sample * samples) as u64))
}

/// A layer up to the choice of its residual's step.
struct Prepared {
    /// Without residual yet.
    layer: Layer,
    model: Model,
}

/// Everything up to the step, the figures of the lobes, and the held-back pairs. `sample` is what [`plan_memory`]
/// gives.
fn prepare_layer(
    capture: &Capture,
    cache: &TileCache,
    params: &FitParams,
    sample: usize,
    stages: &Stages,
    monitor: &Monitor,
) -> Result<(Prepared, LobeFigures, Vec<usize>), FitError> {
    let info = capture.info();
    let lights = Sphere::new(&layer_directions(&info.lights, info.side))?;
    let views = Sphere::new(&layer_directions(&info.views, info.side))?;
    let mut holdout = Holdout::new(info, &lights, &views, params.leave_out, params.seed);
    let (kind, epsilon) = params.error.residual();
    let curve = Curve::new(kind, epsilon);
    let mapping = Mapping::new(cache, curve.exact());
    if !holdout.pairs.is_empty() {
        holdout.sources = stages.run("leave-out", || {
            let chosen = texel_sample(info.texel_count(), HOLDOUT_SAMPLE, params.seed);
            let block = cache.gather(&chosen)?;
            let seen = ResidualSource { cache, mapping: &mapping, curve: &curve, lobes: None, holdout: &holdout };
            let rows = seen.rows(&block, 0..chosen.len(), |index| chosen[index]);
            Ok(holdout.learn(rows))
        })?;
    }

    // With a goal, lobes only guide: bytes go to a residual that stands alone, and texels are clustered by it.
    let guide = params.bytes.is_some() || params.psnr_db.is_some();
    let role = if guide { LobeRole::Guide } else { LobeRole::Base };
    let source = |lobes| ResidualSource { cache, mapping: &mapping, curve: &curve, lobes, holdout: &holdout };
    let (alone, scores) = if guide {
        let found = stages.run("project", || {
            Coordinates::new(
                &source(None),
                shared_bases(params, info.texel_count()),
                sample,
                params.seed,
                "project",
                monitor,
            )
        })?;
        let dimensions = FEATURE_DIMENSIONS.min(found.scores.ncols());
        let scores = found.scores.slice(s![.., ..dimensions]).to_owned();
        (Some(found), scores)
    } else {
        let found = stages.run("project", || {
            features(cache, &mapping, &holdout, FEATURE_DIMENSIONS, FEATURE_SAMPLE, params.seed, monitor)
        })?;
        (None, found.scores)
    };
    let (labels, representatives) = stages.run("cluster", || {
        let clustering = kmeans(scores.view(), params.clusters, params.kmeans, params.seed)?;
        let mut labels = clustering.labels;
        let clusters = clustering.centroids.nrows();
        let clusters = reassign(scores.view(), &mut labels, clusters, REASSIGN_COMPONENTS, REASSIGN_ROUNDS);
        let representatives = representatives(&labels, clusters, scores.view(), params.seed);
        Ok::<_, FitError>((labels, representatives))
    })?;
    drop(scores);
    let (mut clusters, figures) = stages.run("dictionary", || {
        let most_pairs = if guide { GUIDE_PAIRS } else { DICTIONARY_PAIRS };
        dictionaries(cache, &representatives, &views, &lights, &holdout, kind, params.lobes, most_pairs, monitor)
    })?;

    let mut selection = stages.run("weights", || {
        let (of, correlations) = if guide {
            let some = MEAN_SAMPLE.min(sample);
            (LobesOf::Clusters, Correlations::of_some(cache, &clusters, &labels, some, params.seed)?)
        } else {
            (LobesOf::Texels, Correlations::of_all(cache, &clusters, &labels, monitor)?)
        };
        Ok(select(&clusters, &labels, &correlations, of, params.lobes, LOBE_PRICE))
    })?;
    // Not part of the stage, because it changes what an earlier stage gave.
    drop_unused(&mut clusters, &mut selection, &labels);
    let mut coordinates = match alone {
        Some(found) => found,
        None => stages.run("residual", || {
            let lobes = TexelLobes { clusters: &clusters, selection: &selection, labels: &labels };
            Coordinates::new(
                &source(Some(lobes)),
                shared_bases(params, info.texel_count()),
                sample,
                params.seed,
                "residual",
                monitor,
            )
        })?,
    };
    let model = monitor.stage("residual", || {
        let rotated = Rotated::new(&coordinates.directions, &coordinates.energies, [views.len(), lights.len()]);
        coordinates.directions = Array2::zeros((0, 0));
        let most = params.components.unwrap_or(MAX_COMPONENTS);
        let models = local_pca(coordinates.scores.view(), &labels, clusters.len(), most);
        Ok::<_, FitError>(Model { coordinates, rotated, clusters: models, width: info.width })
    })?;
    let heights = if params.heights { monitor.stage("heights", || find_heights(cache, info, monitor))? } else { None };
    if params.heights && heights.is_none() {
        monitor.remark(&format!(
            "{} gets no heights: none that were found predict its steep views better than none do",
            info.name
        ));
    }
    let layer = Layer {
        light_side: sides_of_capture(info.side).0,
        view_side: sides_of_capture(info.side).1,
        lobe_role: role,
        residual_kind: kind,
        epsilon,
        lights,
        views,
        heights,
        texel_clusters: labels.iter().map(|label| *label as u8).collect(),
        texel_lobe_counts: selection.counts.clone(),
        dictionary: selection.dictionary.clone(),
        lobe_refs: selection.refs.clone(),
        residual: None,
    };
    let figures = LobeFigures { sparse: selection.mean_relative_error, ..figures };
    Ok((Prepared { layer, model }, figures, holdout.pairs))
}

/// An asset with its predicted error.
struct Assembled {
    asset: Asset,
    /// Predicted sum of squared errors over all samples of all layers, in the residual's curve.
    error: f64,
}

/// The asset whose residuals are all quantised with `step`.
fn assemble(layers: &[Prepared], step: f64, [width, height]: [usize; 2], params: &FitParams) -> Assembled {
    let default = if params.bytes.is_some() || params.psnr_db.is_some() { MAX_COMPONENTS } else { DEFAULT_COMPONENTS };
    let most = params.components.unwrap_or(default);
    let mut error = 0.0;
    let layers = layers
        .iter()
        .map(|prepared| {
            let encoded = prepared.model.encode(step, most);
            error += encoded.error;
            Layer { residual: Some(encoded.residual), ..prepared.layer.clone() }
        })
        .collect();
    Assembled {
        asset: Asset {
            width,
            height,
            size_mm: None,
            seamless: [false; 2],
            material: String::new(),
            layers,
            levels: Vec::new(),
            edits: Default::default(),
        },
        error,
    }
}

/// Size of the greatest coefficient that any layer can have: a row of root mean square length, times a margin.
fn greatest_coefficient(layers: &[Prepared]) -> f64 {
    let length = |prepared: &Prepared| {
        let coordinates = &prepared.model.coordinates;
        (coordinates.squares / coordinates.scores.nrows() as f64).sqrt()
    };
    layers.iter().map(length).fold(0.0, f64::max)
}

/// The asset of least error within `bytes`, everything but the description included.
fn within_budget(
    captures: &[Capture],
    layers: &[Prepared],
    bytes: usize,
    grid: [usize; 2],
    params: &FitParams,
    monitor: &Monitor,
) -> Result<Asset, FitError> {
    let mut round = 0;
    let mut search = |components: Option<usize>| {
        let params = FitParams { components, ..params.clone() };
        within_bytes(bytes, greatest_coefficient(layers), |step| {
            monitor.report("encode", round, 2 * SEARCH_ROUNDS)?;
            round += 1;
            let made = assemble(layers, step, grid, &params);
            Ok::<_, FitError>(Candidate { bytes: pack(&made.asset)?.len(), value: made })
        })
    };
    let mut found = search(params.components)?;
    // A component more is a jump in size: what is left in front of it goes to a smaller step.
    if let Ok(best) = &mut found {
        let residuals = best.value.asset.layers.iter().flat_map(|layer| &layer.residual);
        let components = residuals.map(|residual| residual.coefficients.len()).max().unwrap_or(0);
        if best.bytes < bytes - bytes / 50
            && let Ok(other) = search(Some(components))?
            && other.value.error < best.value.error
        {
            *best = other;
        }
    }
    found.map(|best| best.value.asset).map_err(|least| {
        FitError::Budget(format!(
            "--bytes is too small for {} texels: the smallest asset has about {} bytes; raise --bytes or lower --clusters",
            grid[0] * grid[1] * layers.len(),
            least + description_bytes(captures, params)
        ))
    })
}

/// The smallest asset whose measured `psnr_db` over all layers is at least `db`: the first step is the one that is
/// predicted to give it, the others follow from what was measured.
fn within_error(
    captures: &[Capture],
    images: Option<&DecodedImages>,
    layers: &[Prepared],
    db: f64,
    grid: [usize; 2],
    params: &FitParams,
    monitor: &Monitor,
) -> Result<Asset, FitError> {
    let samples: f64 = captures.iter().map(|c| (c.info().texel_count() * c.info().pair_count() * 3) as f64).sum();
    let greatest = greatest_coefficient(layers);
    let (mut exponent, first) =
        coarsest_within_error(layers, error_for_psnr(db) * samples, greatest, grid, params, monitor)?;
    let mut first = Some(first.asset);
    let mut found: Option<(usize, Asset)> = None;
    // What meets the goal without the margin, if nothing does with it.
    let mut nearest: Option<Asset> = None;
    let mut reached = 0.0f64;
    // log2 of steps with what they gave, nearest to the goal from either side.
    let mut above: Option<(f64, f64)> = None;
    let mut below: Option<(f64, f64)> = None;
    let mut side = None;
    for round in 0..PSNR_ROUNDS {
        monitor.report("encode", round, PSNR_ROUNDS)?;
        let asset = first.take().unwrap_or_else(|| assemble(layers, greatest * exponent.exp2(), grid, params).asset);
        let bytes = pack(&asset)?.len();
        let last_resort = exponent <= FINEST_EXPONENT;
        let resident = resident_in_parallel(&asset);
        let mut errors = (0.0, 0.0);
        for capture in captures {
            let info = capture.info();
            let stride = colour_pair_stride(info.views.len(), info.lights.len());
            let measure_params = MeasureParams {
                pairs: Some((0..info.pair_count()).step_by(stride).collect()),
                memory_bytes: params.memory_bytes / 8,
                ..MeasureParams::default()
            };
            let read = read_images(capture, images);
            let metrics = measure_images(info, &read, &asset, &resident, &measure_params, monitor)?.metrics();
            let weight = (info.texel_count() * info.pair_count()) as f64;
            errors = (errors.0 + weight * 10f64.powf(-metrics.psnr_db / 10.0), errors.1 + weight);
        }
        let measured = -10.0 * (errors.0 / errors.1).log10();
        let enough = measured >= db + PSNR_MARGIN_DB;
        if enough && found.as_ref().is_none_or(|(least, _)| bytes < *least) {
            found = Some((bytes, asset));
        } else if measured >= db && measured > reached {
            nearest = Some(asset);
        }
        reached = reached.max(measured);
        if (measured < db && last_resort) || (enough && measured <= db + 6.0 * PSNR_MARGIN_DB) {
            break;
        }
        // A little above the goal on the line between what was too much and what was too little; else as if halving
        // the step halved the error. (Near the rounding of 8-bit captures it falls much faster.)
        let point = (exponent, measured);
        if measured > db {
            above = Some(point)
        } else {
            below = Some(point)
        }
        let goal = db + 3.0 * PSNR_MARGIN_DB;
        let next = match (above, below) {
            (Some(above), Some(below)) if above.1 > below.1 && goal > below.1 => {
                let along = ((goal - below.1) / (above.1 - below.1)).clamp(0.05, 0.95);
                // Twice on one side: the line misleads.
                let along = if side == Some(measured > db) { 0.5 } else { along };
                below.0 + along * (above.0 - below.0)
            }
            _ => point.0 + ((measured - goal) / (20.0 * 2f64.log10())).clamp(-4.0, 4.0),
        };
        exponent = next.clamp(FINEST_EXPONENT, COARSEST_EXPONENT);
        side = Some(measured > db);
    }
    found.map(|(_, asset)| asset).or(nearest).ok_or_else(|| {
        FitError::Budget(format!(
            "--psnr {db} cannot be reached with these clusters and components (the best was {reached:.2} dB); lower it or raise --clusters"
        ))
    })
}

/// What reads the images of a capture: `decoded` where they are at hand, else its files.
pub(crate) fn read_images<'a>(
    capture: &'a Capture,
    decoded: Option<&'a DecodedImages>,
) -> impl Fn(usize, usize) -> Result<Pixels, FitError> + Sync + 'a {
    move |view, light| match decoded {
        Some(images) => images.read(view * capture.info().lights.len() + light),
        None => Ok(capture.read(view, light)?),
    }
}

/// log2 of the finest and of the coarsest step, relative to the greatest coefficient, that a PSNR is looked for with.
const FINEST_EXPONENT: f64 = -16.0;
const COARSEST_EXPONENT: f64 = 2.0;

/// log2 of the coarsest step, relative to `greatest`, whose predicted error is at most `target`, and its asset; the
/// finest step where none is.
fn coarsest_within_error(
    layers: &[Prepared],
    target: f64,
    greatest: f64,
    grid: [usize; 2],
    params: &FitParams,
    monitor: &Monitor,
) -> Result<(f64, Assembled), FitError> {
    let mut exponents = [FINEST_EXPONENT, COARSEST_EXPONENT];
    let mut best = None;
    for _ in 0..8 {
        monitor.check()?;
        let middle = 0.5 * (exponents[0] + exponents[1]);
        let candidate = assemble(layers, greatest * middle.exp2(), grid, params);
        if candidate.error <= target {
            exponents[0] = middle;
            best = Some(candidate);
        } else {
            exponents[1] = middle;
        }
    }
    let best = best.unwrap_or_else(|| assemble(layers, greatest * exponents[0].exp2(), grid, params));
    Ok((exponents[0], best))
}

/// Mean squared error in the root domain at which `psnr_db` is `db`: the 8-bit code is about
/// `255 (1.055 g - 0.055)`, and rounding adds 1/12.
fn error_for_psnr(db: f64) -> f64 {
    let code_error = 255.0f64.powi(2) / 10f64.powf(db / 10.0);
    (code_error - 1.0 / 12.0).max(1e-3) / (255.0f64 * 1.055).powi(2)
}

/// Texels of each cluster that its dictionary is fitted to: the one nearest to the centroid, then by
/// distance-squared sampling, so that the cluster's variety is seen.
fn representatives(labels: &[u32], clusters: usize, scores: ArrayView2<f32>, seed: u64) -> Vec<Vec<usize>> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); clusters];
    for (texel, label) in labels.iter().enumerate() {
        members[*label as usize].push(texel);
    }
    members
        .par_iter()
        .enumerate()
        .map(|(cluster, members)| {
            let distance = |texel: usize, other: ndarray::ArrayView1<f32>| -> f32 {
                scores.row(texel).iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum()
            };
            let mut random = Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_add(cluster as u64 * 7919));
            let mut centroid = ndarray::Array1::<f32>::zeros(scores.ncols());
            members.iter().for_each(|&texel| centroid += &scores.row(texel));
            centroid /= members.len().max(1) as f32;
            let centroid = centroid.view();
            let Some(first) =
                members.iter().copied().min_by(|&a, &b| distance(a, centroid).total_cmp(&distance(b, centroid)))
            else {
                return Vec::new();
            };
            let mut chosen = vec![first];
            let mut nearest: Vec<f32> = members.iter().map(|&texel| distance(texel, scores.row(first))).collect();
            while chosen.len() < REPRESENTATIVES.min(members.len()) {
                let total: f64 = nearest.iter().map(|x| f64::from(*x)).sum();
                if total <= 0.0 {
                    break;
                }
                let mut target = random.r#gen::<f64>() * total;
                let index = nearest.iter().position(|x| {
                    target -= f64::from(*x);
                    target < 0.0
                });
                let texel = members[index.unwrap_or(members.len() - 1)];
                chosen.push(texel);
                for (near, &member) in nearest.iter_mut().zip(members) {
                    *near = near.min(distance(member, scores.row(texel)));
                }
            }
            chosen
        })
        .collect()
}

fn tone_weight(kind: ResidualKind, mean: f32) -> f32 {
    let x = mean.max(0.0) + TONE_EPSILON;
    match kind {
        ResidualKind::Additive => 1.0,
        ResidualKind::Log => x.powi(-2),
        ResidualKind::Root => x.powf(2.0 / btf_runtime::ROOT - 2.0),
    }
}

fn dictionaries(
    cache: &TileCache,
    representatives: &[Vec<usize>],
    views: &Sphere,
    lights: &Sphere,
    holdout: &Holdout,
    kind: ResidualKind,
    lobes: usize,
    most_pairs: usize,
    monitor: &Monitor,
) -> Result<(Vec<ClusterLobes>, LobeFigures), FitError> {
    let pairs = cache.pair_count();
    let mut functions: Vec<Array2<f32>> =
        representatives.iter().map(|chosen| Array2::zeros((pairs, 3 * chosen.len()))).collect();
    let mut chosen: Vec<usize> = representatives.iter().flatten().copied().collect();
    chosen.sort_unstable();
    let block = cache.gather(&chosen)?;
    functions.par_iter_mut().zip(representatives).for_each(|(functions, own)| {
        let mut row = vec![0.0; 3 * pairs];
        for (slot, texel) in own.iter().enumerate() {
            // Clusters share no texel.
            let number = chosen.partition_point(|other| other < texel);
            block.texel_linear(number, &mut row);
            for (p, rgb) in row.chunks_exact(3).enumerate() {
                for c in 0..3 {
                    functions[[p, 3 * slot + c]] = rgb[c];
                }
            }
        }
    });
    drop(block);
    monitor.check()?;

    // A stride that shares no factor with the number of lights visits all of them.
    let stride = stride_over_pairs(pairs.div_ceil(most_pairs), lights.len());
    let used: Vec<usize> = (0..pairs).step_by(stride).collect();
    let light_count = lights.len();
    let sampled = Pairs {
        wi: used.iter().map(|pair| lights.direction((pair % light_count) as u32)).collect(),
        wo: used.iter().map(|pair| views.direction((pair / light_count) as u32)).collect(),
    };
    let candidates = if lobes == 0 { Vec::new() } else { candidate_lobes() };
    let columns: Vec<Vec<f32>> = candidates.par_iter().map(|lobe| sampled.table(lobe)).collect();
    let tables = Array2::from_shape_fn((used.len(), candidates.len()), |(p, i)| columns[i][p]);
    drop(columns);

    let done = std::sync::atomic::AtomicUsize::new(0);
    let built: Vec<(ClusterLobes, Dictionary)> = functions
        .par_iter()
        .map(|functions| {
            monitor.check()?;
            let mut weights: Vec<f32> = functions
                .rows()
                .into_iter()
                .map(|row| tone_weight(kind, if row.is_empty() { 0.0 } else { row.mean().unwrap_or(0.0) }))
                .collect();
            holdout.zero(&mut weights);
            let mean = weights.iter().map(|w| f64::from(*w)).sum::<f64>() / weights.len() as f64;
            weights.iter_mut().for_each(|w| *w /= mean.max(1e-12) as f32);
            let found = if candidates.is_empty() || functions.ncols() == 0 {
                Dictionary { lobes: Vec::new(), energy: 0.0, error_selected: 0.0, error_refined: 0.0 }
            } else {
                let target = Target {
                    root_weights: used.iter().map(|pair| weights[*pair].sqrt()).collect(),
                    functions: Array2::from_shape_fn((used.len(), functions.ncols()), |(p, column)| {
                        functions[[used[p], column]]
                    }),
                };
                build_dictionary(&target, &sampled, &candidates, &tables, DICTIONARY_SIZE)
            };
            let tables = lobe_tables(&found.lobes, views, lights);
            let count = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            monitor.report("dictionary", count, representatives.len())?;
            Ok((ClusterLobes::new(found.lobes.clone(), tables, weights), found))
        })
        .collect::<Result<_, FitError>>()?;
    let total = |part: fn(&Dictionary) -> f64| built.iter().map(|(_, found)| part(found)).sum::<f64>();
    let energy = total(|found| found.energy).max(1e-30);
    let figures = LobeFigures {
        selected: total(|found| found.error_selected) / energy,
        refined: total(|found| found.error_refined) / energy,
        sparse: 0.0,
    };
    Ok((built.into_iter().map(|(lobes, _)| lobes).collect(), figures))
}
