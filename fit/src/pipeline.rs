//! The fit, stage by stage: read, project, cluster, dictionary, weights, residual, encode, measure.

use crate::budget::{Plan, Planner, plans_within_bytes};
use crate::cache::{Mapping, TileCache};
use crate::candidates::candidate_lobes;
use crate::compare::{MeasureParams, colour_pair_stride, measure, stride_over_pairs};
use crate::curve::Curve;
use crate::dictionary::{Dictionary, Pairs, Target, build_dictionary};
use crate::encode::encode_residual;
use crate::error::FitError;
use crate::factor::Rotated;
use crate::frame::layer_directions;
use crate::holdout::Holdout;
use crate::kmeans::{Clustering, kmeans};
use crate::local_pca::{LocalPca, OVERSAMPLING, ResidualSource, local_pca};
use crate::material::sides_of_capture;
use crate::monitor::Monitor;
use crate::params::{FitOutcome, FitParams, LobeFigures};
use crate::project::features;
use crate::sparse::{ClusterLobes, Selection, correlate, select};
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::{Asset, Layer, MAX_LAYERS, Resident, Residual, ResidualKind, Sphere, lobe_tables, pack};
use ndarray::{Array2, ArrayView2};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Principal directions that clusters are found in.
const FEATURE_DIMENSIONS: usize = 64;
/// Texels that these directions are found from.
const FEATURE_SAMPLE: usize = 2048;
/// Representative texels per cluster.
const REPRESENTATIVES: usize = 12;
/// Lobes per dictionary.
const DICTIONARY_SIZE: usize = 32;
/// Pairs that a dictionary is fitted on at most.
const DICTIONARY_PAIRS: usize = 3400;
/// Added to a reflectance before its tone weight is taken.
const TONE_EPSILON: f32 = 0.02;
/// Without a byte budget: the relative error that one more lobe must remove.
const LOBE_PRICE: f64 = 0.002;
/// Share of a byte budget that lobe references may take.
const LOBE_SHARE: f64 = 0.15;
/// Bytes of a lobe reference.
const REF_BYTES: f64 = 4.0;
/// Without a budget: components, ranks and bits.
const DEFAULT_COMPONENTS: usize = 8;
const DEFAULT_RANKS: [usize; 3] = [32, 16, 16];
const DEFAULT_BITS: u32 = 8;
/// Rounds of plan and measurement that a PSNR goal gets, and how far above the goal the sampled figure
/// must lie, so that the figure over all pairs reaches it.
const PSNR_ROUNDS: usize = 5;
const PSNR_MARGIN_DB: f64 = 0.03;
/// Most components that a budget is filled with.
const MOST_COMPONENTS: usize = 40;
/// Room for the material text, whose figures are known only at the end.
pub const MATERIAL_RESERVE: usize = 4096;

/// Fits captures (the layers of one asset) and packs them.
///
/// Same captures, parameters and seed give the same bytes on any number of threads. Memory: at most
/// `params.memory_bytes`. A byte budget goes to the layers by need: the residuals of all of them are planned
/// together for the least error over all samples. With several captures under a budget each of them is
/// therefore read twice. A PSNR goal holds for every layer. The material text is empty: the caller describes
/// the asset and packs it again.
///
/// # Errors
/// What is wrong with a capture, or with several together; a budget or a memory limit that is too small.
pub fn fit(captures: &[Capture], params: &FitParams, monitor: &Monitor) -> Result<FitOutcome, FitError> {
    params.check()?;
    let Some(first) = captures.first() else {
        return Err(FitError::Params("give at least one capture".to_string()));
    };
    check_layers(captures)?;
    let (width, height) = (first.info().width, first.info().height);
    let budget = params.bytes.map(|bytes| (bytes as usize).saturating_sub(MATERIAL_RESERVE));
    let share = budget.map(|bytes| bytes / captures.len());
    let mut layers = Vec::new();
    let mut waiting = Vec::new();
    let mut left_out = Vec::new();
    let mut lobes = LobeFigures::default();
    for (number, capture) in captures.iter().enumerate() {
        let (prepared, figures) = prepare_layer(capture, params, share, captures.len() - 1, monitor)?;
        if number == 0 {
            (left_out, lobes) = (prepared.holdout.pairs.clone(), figures);
        }
        match budget {
            Some(_) if captures.len() > 1 => waiting.push(Prepared { cache: None, ..prepared }),
            Some(bytes) => {
                let plans = plan_for_bytes(std::slice::from_ref(&prepared), bytes)?;
                layers.push(finish_layer(capture, prepared, Goal::Plan(&plans[0]), params, monitor)?);
            }
            None => layers.push(finish_layer(capture, prepared, Goal::Params, params, monitor)?),
        }
    }
    if let (Some(bytes), false) = (budget, waiting.is_empty()) {
        let plans = plan_for_bytes(&waiting, bytes)?;
        for ((capture, prepared), plan) in captures.iter().zip(waiting).zip(&plans) {
            layers.push(finish_layer(capture, prepared, Goal::Plan(plan), params, monitor)?);
        }
    }
    let references: usize = layers.iter().map(|layer| layer.lobe_refs.len()).sum();
    let lobes_per_texel_mean = references as f64 / (width * height * layers.len()) as f64;
    let components = layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    let clusters = layers[0].dictionary.len();
    let asset = Asset { width, height, material: String::new(), layers };
    let bytes = pack(&asset)?;
    Ok(FitOutcome { asset, bytes, lobes_per_texel_mean, lobes, components, clusters, left_out })
}

/// Captures that become layers of one asset have one texel grid and differ in their sides.
fn check_layers(captures: &[Capture]) -> Result<(), FitError> {
    let (width, height) = (captures[0].info().width, captures[0].info().height);
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

/// Components that the memory limit allows, and what is left of it for the decoded capture, while `waiting`
/// other layers wait for their bytes with their bases in memory.
fn plan_memory(
    info: &CaptureInfo,
    params: &FitParams,
    wanted: usize,
    waiting: usize,
) -> Result<(usize, u64), FitError> {
    let (texels, samples) = (info.texel_count(), info.pair_count() * 3);
    let clusters = params.clusters.min(texels);
    let threads = rayon::current_num_threads();
    // Features, products and choices of all texels; one block twice as 8-bit or half samples and once as
    // floats; candidates' tables per thread; the feature sample.
    let fixed = texels * (4 * FEATURE_DIMENSIONS + 12 * DICTIONARY_SIZE + 1024)
        + 1024.min(texels) * samples * (2 * 2 + 4)
        + (2 * threads + 1) * 4 * DICTIONARY_PAIRS.min(info.pair_count()) * 900
        + threads * 8 * 900 * 900
        + 4 * FEATURE_SAMPLE.min(texels) * samples
        + clusters * samples * 4 * (REPRESENTATIVES / 2 + (1 + waiting) * DICTIONARY_SIZE / 3)
        + 100_000_000;
    let per_component = (5 + waiting) * 4 * clusters * samples;
    let limit = params.memory_bytes as usize;
    let needed = fixed + per_component * (OVERSAMPLING + 2);
    if limit < needed {
        return Err(FitError::Memory { given: bytes_in_words(limit), needed: bytes_in_words(needed) });
    }
    let most = ((limit - fixed) / per_component).saturating_sub(OVERSAMPLING + 1).min(wanted);
    let used = fixed + per_component * (most + OVERSAMPLING + 1);
    Ok((most, limit.saturating_sub(used) as u64))
}

/// A layer up to the choice of its residual's ranks and bits.
struct Prepared {
    /// Without residual yet.
    layer: Layer,
    lobes: Vec<ClusterLobes>,
    selection: Selection,
    labels: Vec<u32>,
    holdout: Holdout,
    /// Without the bases, which `rotated` holds.
    models: Vec<LocalPca>,
    rotated: Rotated,
    /// Bytes of an asset of this layer alone without the residual.
    base_bytes: usize,
    texels: usize,
    /// Memory for the decoded capture.
    cache_memory: u64,
    /// The decoded capture; `None` where it is to be read again.
    cache: Option<TileCache>,
}

impl Prepared {
    fn planner(&self) -> Planner<'_> {
        Planner::new(&self.models, &self.rotated, self.texels)
    }
}

/// What decides on a residual.
enum Goal<'a> {
    /// This plan.
    Plan(&'a Plan),
    /// The parameters' PSNR or, without one, the defaults.
    Params,
}

/// Everything up to the plan. `share` is the layer's share of a byte budget, for its lobes; `others` is the
/// number of other layers.
fn prepare_layer(
    capture: &Capture,
    params: &FitParams,
    share: Option<usize>,
    others: usize,
    monitor: &Monitor,
) -> Result<(Prepared, LobeFigures), FitError> {
    let info = capture.info();
    let lights = Sphere::new(&layer_directions(&info.lights, info.side))?;
    let views = Sphere::new(&layer_directions(&info.views, info.side))?;
    let searched = share.is_some() || params.psnr_db.is_some();
    let wanted = params.components.unwrap_or(if searched { MOST_COMPONENTS } else { DEFAULT_COMPONENTS });
    let waiting = if share.is_some() { others } else { 0 };
    let (most_components, left) = plan_memory(info, params, wanted, waiting)?;

    // A cache is held in memory if it takes at most half of what it is told: tell it twice what is left.
    let cache_memory = 2 * left;
    let cache = read_capture(capture, cache_memory, params, monitor)?;
    let holdout = Holdout::new(info, &lights, &views, params.leave_out, params.seed);
    let (kind, epsilon) = params.error.residual();
    let curve = Curve::new(kind, epsilon);
    let mapping = Mapping::new(&cache, curve.exact());

    let clustering = {
        let found = monitor.stage("project", || {
            features(&cache, &mapping, &holdout, FEATURE_DIMENSIONS, FEATURE_SAMPLE, params.seed, monitor)
        })?;
        let clustering =
            monitor.stage("cluster", || kmeans(found.scores.view(), params.clusters, params.kmeans, params.seed))?;
        let representatives = representatives(&clustering, found.scores.view(), params.seed);
        (clustering, representatives)
    };
    let (clustering, representatives) = clustering;
    let (clusters, figures) = monitor.stage("dictionary", || {
        dictionaries(&cache, &representatives, &views, &lights, &holdout, kind, params.lobes, monitor)
    })?;

    let selection = monitor.stage("weights", || {
        let correlations = correlate(&cache, &clusters, &clustering.labels, monitor)?;
        let count = |bytes: usize| LOBE_SHARE * bytes as f64 / (REF_BYTES * info.texel_count() as f64);
        let mean_count = share.map(count).or(params.psnr_db.map(|_| 1.0));
        Ok(select(&clusters, &clustering.labels, &correlations, params.lobes, LOBE_PRICE, mean_count))
    })?;
    let layer = Layer {
        light_side: sides_of_capture(info.side).0,
        view_side: sides_of_capture(info.side).1,
        residual_kind: kind,
        epsilon,
        lights,
        views,
        texel_clusters: clustering.labels.iter().map(|label| *label as u8).collect(),
        texel_lobe_counts: selection.counts.clone(),
        dictionary: selection.dictionary.clone(),
        lobe_refs: selection.refs.clone(),
        residual: None,
    };

    let source = ResidualSource {
        cache: &cache,
        mapping: &mapping,
        curve: &curve,
        clusters: &clusters,
        selection: &selection,
        labels: &clustering.labels,
        holdout: &holdout,
    };
    let (models, rotated) = monitor.stage("residual", || {
        let models = local_pca(&source, most_components, params.seed, monitor)?;
        let rotated = Rotated::new(&models, [layer.views.len(), layer.lights.len()]);
        Ok((models.into_iter().map(LocalPca::without_bases).collect(), rotated))
    })?;
    let alone = Asset { width: info.width, height: info.height, material: String::new(), layers: vec![layer.clone()] };
    let figures = LobeFigures { sparse: selection.mean_relative_error, ..figures };
    let prepared = Prepared {
        layer,
        lobes: clusters,
        labels: clustering.labels,
        selection,
        holdout,
        models,
        rotated,
        base_bytes: pack(&alone)?.len(),
        texels: info.texel_count(),
        cache_memory,
        cache: Some(cache),
    };
    Ok((prepared, figures))
}

fn read_capture(capture: &Capture, memory: u64, params: &FitParams, monitor: &Monitor) -> Result<TileCache, FitError> {
    monitor.stage("read", || TileCache::build(capture, memory, &params.cache_directory, monitor))
}

/// Chooses the residual's plan where it is not given, and makes the residual.
fn finish_layer(
    capture: &Capture,
    mut prepared: Prepared,
    goal: Goal,
    params: &FitParams,
    monitor: &Monitor,
) -> Result<Layer, FitError> {
    let cache = match prepared.cache.take() {
        Some(cache) => cache,
        None => read_capture(capture, prepared.cache_memory, params, monitor)?,
    };
    let mut layer = prepared.layer.clone();
    let curve = Curve::new(layer.residual_kind, layer.epsilon);
    let mapping = Mapping::new(&cache, curve.exact());
    let source = ResidualSource {
        cache: &cache,
        mapping: &mapping,
        curve: &curve,
        clusters: &prepared.lobes,
        selection: &prepared.selection,
        labels: &prepared.labels,
        holdout: &prepared.holdout,
    };
    let encode = |plan: &Plan| encode_residual(&source, &prepared.rotated, plan, monitor);
    let residual = monitor.stage("residual", || match (goal, params.psnr_db) {
        (Goal::Plan(plan), _) => encode(plan),
        (Goal::Params, Some(db)) => {
            residual_for_psnr(capture, &mut layer, &prepared.planner(), db, params, monitor, &encode)
        }
        (Goal::Params, None) => {
            let planner = prepared.planner();
            encode(&planner.fixed(DEFAULT_RANKS, vec![DEFAULT_BITS; planner.most_components()]))
        }
    })?;
    layer.residual = Some(residual);
    Ok(layer)
}

/// The plans of least error over all layers within `bytes`, everything but the description included.
fn plan_for_bytes(layers: &[Prepared], bytes: usize) -> Result<Vec<Plan>, FitError> {
    let base: usize = layers.iter().map(|layer| layer.base_bytes).sum();
    let planners: Vec<Planner> = layers.iter().map(Prepared::planner).collect();
    plans_within_bytes(&planners, bytes.saturating_sub(base)).ok_or_else(|| {
        let least: usize = planners.iter().map(|planner| planner.bytes([2, 2, 2], &[])).sum();
        FitError::Budget(format!(
            "--bytes is too small for {} texels: the smallest asset has about {} bytes; raise --bytes or lower --clusters",
            layers.iter().map(|layer| layer.texels).sum::<usize>(),
            base + least + MATERIAL_RESERVE
        ))
    })
}

/// The smallest residual whose measured `psnr_db` is at least `db`: the plan's prediction is corrected by
/// what it turned out to give.
fn residual_for_psnr(
    capture: &Capture,
    layer: &mut Layer,
    planner: &Planner,
    db: f64,
    params: &FitParams,
    monitor: &Monitor,
    encode: &dyn Fn(&Plan) -> Result<Residual, FitError>,
) -> Result<Residual, FitError> {
    let info = capture.info();
    let most = planner.most_components();
    let samples = (info.texel_count() * info.pair_count() * 3) as f64;
    let stride = colour_pair_stride(info.views.len(), info.lights.len());
    let measured_pairs: Vec<usize> = (0..info.pair_count()).step_by(stride).collect();
    let mut target = error_for_psnr(db) * samples;
    let mut found: Option<(usize, Residual)> = None;
    let mut reached = 0.0f64;
    for _ in 0..PSNR_ROUNDS {
        let Some(plan) = planner.within_error(target, most).or_else(|| planner.best(most)) else { break };
        let last_resort = plan.error > target;
        layer.residual = Some(encode(&plan)?);
        let asset =
            Asset { width: info.width, height: info.height, material: String::new(), layers: vec![layer.clone()] };
        let resident = Resident::from_asset_with(&asset, |n, expand| (0..n).into_par_iter().map(expand).collect());
        let measure_params = MeasureParams {
            pairs: Some(measured_pairs.clone()),
            memory_bytes: params.memory_bytes / 8,
            ..MeasureParams::default()
        };
        let measured = measure(capture, &asset, &resident, &measure_params, monitor)?.metrics().psnr_db;
        reached = reached.max(measured);
        let smaller = found.as_ref().is_none_or(|(bytes, _)| plan.bytes < *bytes);
        if measured >= db + PSNR_MARGIN_DB && smaller {
            found = layer.residual.take().map(|residual| (plan.bytes, residual));
        }
        if (measured < db && last_resort) || (measured >= db && measured <= db + 6.0 * PSNR_MARGIN_DB) {
            break;
        }
        target *= 10f64.powf((measured - db - 3.0 * PSNR_MARGIN_DB) / 10.0);
    }
    found.map(|(_, residual)| residual).ok_or_else(|| {
        FitError::Budget(format!(
            "--psnr {db} cannot be reached with these clusters and components (the best was {reached:.2} dB); lower it or raise --clusters"
        ))
    })
}

/// Mean squared error in the root domain at which `psnr_db` is `db`: the 8-bit code is about
/// `255 (1.055 g - 0.055)`, and rounding adds 1/12.
fn error_for_psnr(db: f64) -> f64 {
    let code_error = 255.0f64.powi(2) / 10f64.powf(db / 10.0);
    (code_error - 1.0 / 12.0).max(1e-3) / (255.0f64 * 1.055).powi(2)
}

/// Texels of each cluster that its dictionary is fitted to: the one nearest to the centroid, then by
/// distance-squared sampling, so that the cluster's variety is seen.
fn representatives(clustering: &Clustering, scores: ArrayView2<f32>, seed: u64) -> Vec<Vec<usize>> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); clustering.centroids.nrows()];
    for (texel, label) in clustering.labels.iter().enumerate() {
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
            let centroid = clustering.centroids.row(cluster);
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
    monitor: &Monitor,
) -> Result<(Vec<ClusterLobes>, LobeFigures), FitError> {
    let pairs = cache.pair_count();
    let mut functions: Vec<Array2<f32>> =
        representatives.iter().map(|chosen| Array2::zeros((pairs, 3 * chosen.len()))).collect();
    let mut row = vec![0.0; 3 * pairs];
    for tile in 0..cache.tile_count() {
        let loaded = cache.read(tile)?;
        for (cluster, chosen) in representatives.iter().enumerate() {
            for (slot, texel) in chosen.iter().enumerate().filter(|(_, texel)| loaded.texels.contains(texel)) {
                loaded.texel_linear(texel - loaded.texels.start, &mut row);
                for (p, rgb) in row.chunks_exact(3).enumerate() {
                    for c in 0..3 {
                        functions[cluster][[p, 3 * slot + c]] = rgb[c];
                    }
                }
            }
        }
        monitor.check()?;
    }

    // A stride that shares no factor with the number of lights visits all of them.
    let stride = stride_over_pairs(pairs.div_ceil(DICTIONARY_PAIRS), lights.len());
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
