//! The fit, stage by stage: read, project, cluster, dictionary, weights, residual, encode, measure.

use crate::budget::{Plan, Planner};
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
use crate::local_pca::{OVERSAMPLING, ResidualSource, local_pca};
use crate::material::sides_of_capture;
use crate::monitor::Monitor;
use crate::params::{FitOutcome, FitParams, LobeFigures};
use crate::project::features;
use crate::sparse::{ClusterLobes, correlate, select};
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::{Asset, Layer, Resident, Residual, ResidualKind, Sphere, lobe_tables, pack};
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
/// `params.memory_bytes`. The material text is empty: the caller describes the asset and packs it again.
pub fn fit(captures: &[Capture], params: &FitParams, monitor: &Monitor) -> Result<FitOutcome, FitError> {
    params.check()?;
    let Some(first) = captures.first() else {
        return Err(FitError::Params("give at least one capture".to_string()));
    };
    let (width, height) = (first.info().width, first.info().height);
    let mut layers = Vec::new();
    let mut left_out = Vec::new();
    let mut lobes = LobeFigures::default();
    let budget = params.bytes.map(|bytes| (bytes as usize).saturating_sub(MATERIAL_RESERVE) / captures.len());
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        let reason = if (info.width, info.height) != (width, height) {
            Some(format!("it is {} x {} texels, the first is {width} x {height}", info.width, info.height))
        } else if captures[..number]
            .iter()
            .any(|other| sides_of_capture(other.info().side) == sides_of_capture(info.side))
        {
            Some("it shows the same sides as another".to_string())
        } else {
            None
        };
        if let Some(reason) = reason {
            return Err(FitError::Layers { path: capture.path_of(0, 0).into(), reason });
        }
        let (layer, held, figures) = fit_layer(capture, params, budget, monitor)?;
        if number == 0 {
            (left_out, lobes) = (held, figures);
        }
        layers.push(layer);
    }
    let references: usize = layers.iter().map(|layer| layer.lobe_refs.len()).sum();
    let lobes_per_texel_mean = references as f64 / (width * height * layers.len()) as f64;
    let components = layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    let clusters = layers[0].dictionary.len();
    let asset = Asset { width, height, material: String::new(), layers };
    let bytes = pack(&asset)?;
    Ok(FitOutcome { asset, bytes, lobes_per_texel_mean, lobes, components, clusters, left_out })
}

fn bytes_in_words(bytes: usize) -> String {
    format!("{:.0} MB", bytes as f64 / 1e6)
}

/// Components that the memory limit allows, and what is left of it for the decoded capture.
fn plan_memory(info: &CaptureInfo, params: &FitParams, wanted: usize) -> Result<(usize, u64), FitError> {
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
        + clusters * samples * 4 * (REPRESENTATIVES / 2 + DICTIONARY_SIZE / 3)
        + 100_000_000;
    let per_component = 5 * 4 * clusters * samples;
    let limit = params.memory_bytes as usize;
    let needed = fixed + per_component * (OVERSAMPLING + 2);
    if limit < needed {
        return Err(FitError::Memory { given: bytes_in_words(limit), needed: bytes_in_words(needed) });
    }
    let most = ((limit - fixed) / per_component).saturating_sub(OVERSAMPLING + 1).min(wanted);
    let used = fixed + per_component * (most + OVERSAMPLING + 1);
    Ok((most, limit.saturating_sub(used) as u64))
}

fn fit_layer(
    capture: &Capture,
    params: &FitParams,
    budget: Option<usize>,
    monitor: &Monitor,
) -> Result<(Layer, Vec<usize>, LobeFigures), FitError> {
    let info = capture.info();
    let lights = Sphere::new(&layer_directions(&info.lights, info.side))?;
    let views = Sphere::new(&layer_directions(&info.views, info.side))?;
    let searched = budget.is_some() || params.psnr_db.is_some();
    let wanted = params.components.unwrap_or(if searched { MOST_COMPONENTS } else { DEFAULT_COMPONENTS });
    let (most_components, left) = plan_memory(info, params, wanted)?;

    // A cache is held in memory if it takes at most half of what it is told: tell it twice what is left.
    let cache = monitor.stage("read", || TileCache::build(capture, 2 * left, &params.cache_directory, monitor))?;
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
        let share = |bytes: usize| LOBE_SHARE * bytes as f64 / (REF_BYTES * info.texel_count() as f64);
        let mean_count = budget.map(share).or(params.psnr_db.map(|_| 1.0));
        Ok(select(&clusters, &clustering.labels, &correlations, params.lobes, LOBE_PRICE, mean_count))
    })?;
    let mut layer = Layer {
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
    let residual = monitor.stage("residual", || {
        let models = local_pca(&source, most_components, params.seed, monitor)?;
        let rotated = Rotated::new(&models, [layer.views.len(), layer.lights.len()]);
        let planner = Planner::new(&models, &rotated, info.texel_count());
        let base = pack(&Asset {
            width: info.width,
            height: info.height,
            material: String::new(),
            layers: vec![layer.clone()],
        })?
        .len();
        match (budget, params.psnr_db) {
            (Some(bytes), _) => {
                let plan = plan_for_bytes(&planner, bytes, base, info)?;
                encode_residual(&source, &rotated, &plan, monitor)
            }
            (None, Some(db)) => residual_for_psnr(capture, &mut layer, &planner, db, params, monitor, &|plan| {
                encode_residual(&source, &rotated, plan, monitor)
            }),
            (None, None) => {
                let plan = planner.fixed(DEFAULT_RANKS, vec![DEFAULT_BITS; planner.most_components()]);
                encode_residual(&source, &rotated, &plan, monitor)
            }
        }
    })?;
    layer.residual = Some(residual);
    let lobes = LobeFigures { sparse: selection.mean_relative_error, ..figures };
    Ok((layer, holdout.pairs, lobes))
}

fn plan_for_bytes(planner: &Planner, bytes: usize, base: usize, info: &CaptureInfo) -> Result<Plan, FitError> {
    planner.within_bytes(bytes.saturating_sub(base), planner.most_components()).ok_or_else(|| {
        let least = base + planner.bytes([2, 2, 2], &[]) + MATERIAL_RESERVE;
        FitError::Budget(format!(
            "--bytes is too small for {} texels: the smallest asset has about {least} bytes; raise --bytes or lower --clusters",
            info.texel_count()
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
