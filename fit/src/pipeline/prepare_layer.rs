//! One layer of an asset up to the choice of its residual's step, by one of two recipes: lobes that guide, and lobes as
//! base.

use crate::error::FitError;
use crate::gpu::fit_gpu::FitGpu;
use crate::input::layer_frame::{layer_directions, sides_of_capture};
use crate::input::residual_curve::Curve;
use crate::input::rounds::Rounds;
use crate::input::texel_sample::texel_sample;
use crate::input::tile_cache::{Mapping, TileCache};
use crate::params::{Goal, KMeansEngine, ValidFitParams};
use crate::pipeline::choose_relief::FIRST_RELIEF;
use crate::pipeline::memory_plan::{DICTIONARY_PAIRS, FEATURE_DIMENSIONS, shared_bases};
use crate::pipeline::representatives::representatives;
use crate::priors::covariance::PairCovariance;
use crate::priors::holdout::Holdout;
use crate::priors::parts::prior_parts;
use crate::priors::predict::Prediction;
use crate::resume::checkpoint::Stages;
use crate::stages::budget::error_for_psnr;
use crate::stages::encode::Model;
use crate::stages::factor::Rotated;
use crate::stages::features::features;
use crate::stages::heights::find_heights;
use crate::stages::kmeans::kmeans;
use crate::stages::lobe_dictionaries::{DictionaryTask, LobeFigures};
use crate::stages::lobe_weights::{FittedWeights, add_upright_lambertian};
use crate::stages::local_pca::{local_pca, reassign};
use crate::stages::rate_labels::{TexelGoal, assign_by_rate, step_for};
use crate::stages::residual_source::{ResidualSource, TexelLobes};
use crate::stages::sparse::{ClusterLobes, Correlations, LobesOf, Selection, drop_unused, select};
use crate::stages::texel_coordinates::Coordinates;
use btf_capture::CaptureInfo;
use btf_runtime::{Heights, Layer, MAX_COMPONENTS, ResidualKind, Sphere};
use ndarray::{Array2, Axis, s};

/// Texels that the features' directions are found from.
const FEATURE_SAMPLE: usize = 2048;
/// Components of the models by which texels are moved between clusters, and rounds of that.
const REASSIGN_COMPONENTS: usize = 8;
const REASSIGN_ROUNDS: usize = 3;
/// Direction pairs that a dictionary is fitted on at most where lobes guide: a third of the time of
/// [`DICTIONARY_PAIRS`], and the lobes' error stays the same.
pub const GUIDE_PAIRS: usize = 1100;
/// Texels that the clusters' means are taken from where lobes guide.
pub const MEAN_SAMPLE: usize = 4096;
/// Texels that the prediction of held-back pairs is learnt from.
const HOLDOUT_SAMPLE: usize = 512;
/// The relative error that one more lobe must remove.
const LOBE_PRICE: f64 = 0.002;

/// A layer up to the choice of its residual's step.
pub struct PreparedLayer {
    /// The layer without its residual.
    pub layer: Layer,
    /// The residual before it is quantised.
    pub model: Model,
    /// Lobe weights as functions of the coefficients; `None` where texels' references are in the layer.
    pub lobe_weights: Option<FittedWeights>,
    /// Figures of the lobes alone, without the residual.
    pub figures: LobeFigures,
    /// Direction pairs that were held back or have no image (`view * lights + light`).
    pub left_out: Vec<usize>,
}

/// Fits everything of the capture in `cache` but the step of its residual. `sample` is the number of texels that shared
/// bases are found from ([`crate::pipeline::memory_plan`]).
pub fn prepare_layer(
    info: &CaptureInfo,
    cache: &TileCache,
    params: &ValidFitParams,
    sample: usize,
    gpu: Option<&FitGpu>,
    stages: &Stages,
) -> Result<PreparedLayer, FitError> {
    let source = LayerSource { gpu, ..LayerSource::new(info, cache, params, sample, stages)? };
    let mut fitted = if params.stores_lobes() { source.fit_base()? } else { source.fit_whole()? };
    let model = source.model(&mut fitted)?;
    let lobe_weights = if params.predicts_lobes() { Some(source.lobe_weights(&fitted, &model)?) } else { None };
    let heights = source.heights()?;
    let LayerSource { views, lights, kind, epsilon, holdout, .. } = source;
    let FittedLobes { labels, selection, figures, .. } = fitted;
    let (light_side, view_side) = sides_of_capture(info.side);
    let layer = Layer {
        light_side,
        view_side,
        lobe_role: params.role().of_layer(),
        residual_kind: kind,
        epsilon,
        lights,
        views,
        relief: heights
            .as_ref()
            .filter(|_| params.predicts_lobes() && kind == ResidualKind::Root)
            .map(|_| FIRST_RELIEF),
        heights,
        texel_clusters: labels.iter().map(|label| *label as u8).collect(),
        texel_lobe_counts: selection.counts,
        dictionary: selection.dictionary,
        lobe_refs: selection.refs,
        lobe_weights: None,
        residual: None,
    };
    let figures = LobeFigures { sparse: selection.mean_relative_error, ..figures };
    Ok(PreparedLayer { layer, model, lobe_weights, figures, left_out: holdout.pairs })
}

/// Result of a recipe: clusters, lobes, and the coordinates of the residual.
struct FittedLobes {
    /// Cluster of each texel.
    labels: Vec<u32>,
    /// Lobes of each cluster, those that no texel takes left out.
    dictionaries: Vec<ClusterLobes>,
    selection: Selection,
    figures: LobeFigures,
    coordinates: Coordinates,
}

/// A capture with everything that the steps of both recipes read it by.
struct LayerSource<'a> {
    info: &'a CaptureInfo,
    cache: &'a TileCache<'a>,
    params: &'a ValidFitParams,
    sample: usize,
    gpu: Option<&'a FitGpu>,
    stages: &'a Stages<'a>,
    views: Sphere,
    lights: Sphere,
    kind: ResidualKind,
    epsilon: f32,
    curve: Curve,
    mapping: Mapping,
    holdout: Holdout,
}

impl<'a> LayerSource<'a> {
    fn new(
        info: &'a CaptureInfo,
        cache: &'a TileCache<'a>,
        params: &'a ValidFitParams,
        sample: usize,
        stages: &'a Stages<'a>,
    ) -> Result<LayerSource<'a>, FitError> {
        let lights = Sphere::of_rounds(&layer_directions(&info.lights, info.side), info.lights.rounds())?;
        let views = Sphere::new(&layer_directions(&info.views, info.side))?;
        let holdout = Holdout::new(info, params.leave_out(), params.seed());
        let (kind, epsilon) = params.error().residual();
        let curve = Curve::new(kind, epsilon);
        let mapping = Mapping::new(cache, curve.exact());
        let mut source = LayerSource {
            info,
            cache,
            params,
            sample,
            gpu: None,
            stages,
            views,
            lights,
            kind,
            epsilon,
            curve,
            mapping,
            holdout,
        };
        if !source.holdout.pairs.is_empty() {
            source.holdout.prediction = Some(source.prediction()?);
        }
        Ok(source)
    }

    /// Learns how held-back and missing pairs follow from the others.
    fn prediction(&self) -> Result<Prediction, FitError> {
        self.stages.run("leave-out", || {
            let chosen = texel_sample(self.info.texel_count(), HOLDOUT_SAMPLE, self.params.seed());
            let block = self.cache.gather(&chosen)?;
            let rows = self.residual(None).rows(&block, 0..chosen.len(), |index| chosen[index]);
            let rounds = Rounds::of(&self.info.lights);
            let pairs = self.info.pair_count() / rounds.count;
            // Channels, those of every round, are samples of one covariance.
            let channels: Vec<Array2<f32>> = (0..rounds.count)
                .flat_map(|round| (0..3).map(move |channel| (round, channel)))
                .map(|(round, channel)| {
                    let columns = (0..pairs).map(|pair| 3 * rounds.place(pair, round) + channel);
                    rows.select(Axis(1), &columns.collect::<Vec<_>>())
                })
                .collect();
            let channels: Vec<_> = channels.iter().map(|samples| samples.view()).collect();
            let samples = ndarray::concatenate(Axis(0), &channels).unwrap_or_default();
            let directions = layer_directions(&self.info.lights, self.info.side);
            let lights = Sphere::new(&directions[..rounds.lights])?;
            let parts = prior_parts(
                self.params.priors(),
                sides_of_capture(self.info.side),
                [&self.views, &lights],
                &self.curve,
            )?;
            self.stages.monitor().check()?;
            let in_first = |pairs: &[usize]| pairs.iter().filter_map(|pair| rounds.in_first(*pair)).collect::<Vec<_>>();
            let seen = in_first(&self.holdout.seen(self.info.pair_count()));
            let covariance = PairCovariance::adapted(&self.views, &lights, parts, samples.view(), &seen);
            self.stages.monitor().check()?;
            Ok(Prediction::new(&covariance, rounds, seen, in_first(&self.holdout.pairs)))
        })
    }

    /// Fits a residual that holds the whole value, so that bytes go to it and texels are clustered by it; lobes guide or
    /// follow from its coefficients.
    fn fit_whole(&self) -> Result<FittedLobes, FitError> {
        let coordinates = self.coordinates("project", None)?;
        let dimensions = FEATURE_DIMENSIONS.min(coordinates.scores.ncols());
        let (labels, representatives) = self.cluster(coordinates.scores.slice(s![.., ..dimensions]).to_owned())?;
        let (mut dictionaries, figures) = self.dictionaries(&representatives, GUIDE_PAIRS)?;
        let mut selection = self.stages.run("weights", || {
            let some = MEAN_SAMPLE.min(self.sample);
            let correlations = Correlations::of_some(self.cache, &dictionaries, &labels, some, self.params.seed())?;
            let most = self.params.lobes() - usize::from(self.params.predicts_lobes());
            Ok(select(&dictionaries, &labels, &correlations, LobesOf::Clusters, most, LOBE_PRICE))
        })?;
        // Not part of the stage, because it changes what an earlier stage gave.
        drop_unused(&mut dictionaries, &mut selection, &labels);
        if self.params.predicts_lobes() {
            add_upright_lambertian(&mut dictionaries, &mut selection, &self.views, &self.lights);
        }
        Ok(FittedLobes { labels, dictionaries, selection, figures, coordinates })
    }

    /// Fits lobes as base: every texel selects its own, and the residual is what they leave.
    fn fit_base(&self) -> Result<FittedLobes, FitError> {
        let found = self.stages.run("project", || {
            let (dimensions, sample, seed) = (FEATURE_DIMENSIONS, FEATURE_SAMPLE, self.params.seed());
            features(self.cache, &self.mapping, &self.holdout, dimensions, sample, seed, self.stages.monitor())
        })?;
        let (labels, representatives) = self.cluster(found.scores)?;
        let (mut dictionaries, figures) = self.dictionaries(&representatives, DICTIONARY_PAIRS)?;
        let mut selection = self.stages.run("weights", || {
            let correlations = Correlations::of_all(self.cache, &dictionaries, &labels, self.stages.monitor())?;
            Ok(select(&dictionaries, &labels, &correlations, LobesOf::Texels, self.params.lobes(), LOBE_PRICE))
        })?;
        // Not part of the stage, because it changes what an earlier stage gave.
        drop_unused(&mut dictionaries, &mut selection, &labels);
        let lobes = TexelLobes { clusters: &dictionaries, selection: &selection, labels: &labels };
        let coordinates = self.coordinates("residual", Some(lobes))?;
        Ok(FittedLobes { labels, dictionaries, selection, figures, coordinates })
    }

    /// Finds the lobes' weights as functions of the coefficients.
    fn lobe_weights(&self, fitted: &FittedLobes, model: &Model) -> Result<FittedWeights, FitError> {
        self.stages.run("predict", || {
            let (values, curve) = (self.residual(None), (self.kind, self.epsilon));
            FittedWeights::new(&values, &fitted.dictionaries, model, curve, self.sample, self.params.seed())
        })
    }

    /// Returns what `lobes` leave of every texel, or the whole value without lobes.
    fn residual<'b>(&'b self, lobes: Option<TexelLobes<'b>>) -> ResidualSource<'b> {
        let LayerSource { cache, mapping, curve, holdout, .. } = self;
        ResidualSource { cache, mapping, curve, lobes, holdout }
    }

    /// Finds the shared bases of the residual and every texel's place along them, as the stage `stage`.
    fn coordinates(&self, stage: &str, lobes: Option<TexelLobes>) -> Result<Coordinates, FitError> {
        self.stages.run(stage, || {
            let rank = shared_bases(self.params, self.info.texel_count());
            let monitor = self.stages.monitor();
            Coordinates::new(&self.residual(lobes), rank, self.sample, self.params.seed(), self.gpu, (stage, monitor))
        })
    }

    /// Clusters texels by `scores`, `[texel, dimension]`: labels, and the representatives of each cluster.
    fn cluster(&self, scores: Array2<f32>) -> Result<(Vec<u32>, Vec<Vec<usize>>), FitError> {
        self.stages.run("cluster", || {
            let seed = self.params.seed();
            let clustering = kmeans(scores.view(), self.params.clusters(), self.params.kmeans(), seed)?;
            let mut labels = clustering.labels;
            let clusters = clustering.centroids.nrows();
            // Texels of clusters within clusters stay where they are.
            let rounds = if self.params.kmeans() == KMeansEngine::Levels { 0 } else { REASSIGN_ROUNDS };
            let clusters = reassign(scores.view(), &mut labels, clusters, REASSIGN_COMPONENTS, rounds);
            let clusters = match self.texel_goal() {
                Some(goal) => {
                    let models = local_pca(scores.view(), &labels, clusters, scores.ncols());
                    let step = step_for(&models, goal);
                    assign_by_rate(scores.view(), &mut labels, clusters, self.info.width, step)
                }
                None => clusters,
            };
            let representatives = representatives(&labels, clusters, scores.view(), seed);
            Ok((labels, representatives))
        })
    }

    /// Returns what a texel may take; `None` without a goal.
    fn texel_goal(&self) -> Option<TexelGoal> {
        let samples = 3.0 * self.info.pair_count() as f64;
        match self.params.goal() {
            Goal::Bytes(bytes) => Some(TexelGoal::Bytes(bytes as f64 / self.info.texel_count() as f64)),
            Goal::PsnrDb(db) => Some(TexelGoal::Error(samples * error_for_psnr(db))),
            Goal::None => None,
        }
    }

    /// Fits each cluster's lobes to its representatives, on at most `max_pairs` direction pairs.
    fn dictionaries(
        &self,
        representatives: &[Vec<usize>],
        max_pairs: usize,
    ) -> Result<(Vec<ClusterLobes>, LobeFigures), FitError> {
        let task = DictionaryTask {
            cache: self.cache,
            representatives,
            views: &self.views,
            lights: &self.lights,
            holdout: &self.holdout,
            kind: self.kind,
            lobes: self.params.lobes(),
            max_pairs,
        };
        self.stages.run("dictionary", || task.build(self.stages.monitor()))
    }

    /// Factors the shared bases and fits the clusters' models; takes the coordinates out of `fitted`.
    fn model(&self, fitted: &mut FittedLobes) -> Result<Model, FitError> {
        let nothing = Coordinates {
            scores: Array2::zeros((0, 0)),
            directions: Array2::zeros((0, 0)),
            squares: 0.0,
            energies: Vec::new(),
        };
        let mut coordinates = std::mem::replace(&mut fitted.coordinates, nothing);
        self.stages.monitor().stage("residual", || {
            let shape = [self.views.len(), self.lights.len()];
            let rotated = Rotated::new(&coordinates.directions, &coordinates.energies, shape);
            coordinates.directions = Array2::zeros((0, 0));
            let most = self.params.components().unwrap_or(MAX_COMPONENTS);
            let clusters = local_pca(coordinates.scores.view(), &fitted.labels, fitted.dictionaries.len(), most);
            Ok(Model { coordinates, rotated, clusters, width: self.info.width })
        })
    }

    /// Finds the texels' heights where they are asked for, with a remark where they predict no view better.
    fn heights(&self) -> Result<Option<Heights>, FitError> {
        if !self.params.finds_heights() {
            return Ok(None);
        }
        let monitor = self.stages.monitor();
        if !self.info.missing.is_empty() {
            monitor.remark(&format!("{} gets no heights: they are found from all images of a view", self.info.name));
            return Ok(None);
        }
        let heights = monitor.stage("heights", || find_heights(self.cache, self.info, monitor))?;
        if heights.is_none() {
            monitor.remark(&format!(
                "{} gets no heights: none that were found predict its steep views better than none do",
                self.info.name
            ));
        }
        Ok(heights)
    }
}
