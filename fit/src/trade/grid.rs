//! Grid of a trade: its settings, and the measurement and timing of each of them.

use crate::error::FitError;
use crate::input::pair_stride::pairs_at_stride;
use crate::input::tone_curve::ToneCurve;
use crate::inspect::load::{parallel, resident_in_parallel};
use crate::inspect::lobe_use::LobeUse;
use crate::measure::compare::{CaptureImages, MeasureParams, colour_pair_stride, measure_decoder};
use crate::measure::image_decoder::ImageDecoder;
use crate::measure::thinned_grid::{ThinnedGrid, thinned_grid};
use crate::metrics::Metrics;
use crate::monitor::Monitor;
use crate::params::{FitParams, Role, ValidFitParams};
use crate::pipeline::prepare::PreparedFit;
use crate::provenance::{FitRecord, Material};
use crate::trade::evaluation_time::{Query, least_nanoseconds, random_queries};
use crate::trade::gpu_clock::{GpuAsset, GpuClock};
use crate::trade::params::TradeParams;
use crate::trade::pareto::spread;
use crate::trade::point::{Limit, Precision, Rule, TradePoint};
use btf_capture::{Capture, CaptureInfo, Pixels};
use btf_runtime::{
    Asset, DecodeOptions, MAX_COMPONENTS, Resident, SectionKind, SingleBases, decode, decode_single, pack,
    read_directory,
};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Bits of the coarsest step, and of the finest.
const MIN_BITS: f64 = 1.0;
const MAX_BITS: f64 = 16.0;
/// Gain in dB of a step over the one before below which the sweep ends: the components are used up.
const MIN_GAIN_DB: f64 = 0.05;
/// Pairs that interpolation is measured on at most.
pub(crate) const BETWEEN_PAIRS: usize = 32;
/// Pairs that a point's colour difference is taken over at most: it costs more than everything else that is measured.
const COLOUR_PAIRS: usize = 8;
/// Bytes of the largest asset where no limit is given: per texel, and beside them.
const MAX_BYTES_PER_TEXEL: usize = 64;
const MAX_BYTES_BESIDE: usize = 200_000;

/// Returns the pairs whose index is a multiple of the colour difference's stride, thinned to about `count`: all lights
/// and views alike, and each with a colour difference.
pub(crate) fn strided_pairs(info: &CaptureInfo, count: usize) -> Vec<usize> {
    let stride = colour_pair_stride(info.views.len(), info.lights.len());
    let all = pairs_at_stride(info, stride);
    let share = (all.len() as f64 / count as f64).round().max(1.0) as usize;
    all.into_iter().step_by(share).collect()
}

/// Images of a few pairs, held in memory for the whole grid.
pub(crate) struct Images(HashMap<(usize, usize), Pixels>);

impl Images {
    pub(crate) fn read(capture: &Capture, pairs: &[usize], monitor: &Monitor) -> Result<Images, FitError> {
        let lights = capture.info().lights.len();
        let read = |pair: &usize| {
            monitor.check()?;
            let at = (pair / lights, pair % lights);
            Ok((at, capture.read(at.0, at.1)?))
        };
        Ok(Images(pairs.par_iter().map(read).collect::<Result<_, FitError>>()?))
    }

    fn get(&self, view: usize, light: usize) -> Result<Pixels, FitError> {
        self.0
            .get(&(view, light))
            .cloned()
            .ok_or_else(|| FitError::Params(format!("view {view}, light {light} was not read beforehand")))
    }
}

/// Pairs that interpolation is measured on.
pub(crate) struct Between<'a> {
    pub(crate) images: Images,
    pub(crate) pairs: Vec<usize>,
    pub(crate) info: &'a CaptureInfo,
}

/// An asset of the grid with everything that decoders need.
struct Made {
    bytes: Vec<u8>,
    asset: Asset,
    resident: Resident,
    singles: SingleBases,
}

impl Made {
    fn from_bytes(bytes: Vec<u8>) -> Result<Made, FitError> {
        let asset = Asset::parse(&bytes)?;
        let (resident, singles) = (resident_in_parallel(&asset), singles_in_parallel(&asset));
        Ok(Made { bytes, asset, resident, singles })
    }

    fn components(&self) -> usize {
        self.asset.layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len())
    }

    /// Returns the bytes in a decoder's memory: the words of the resident form, with the bases' part doubled for single
    /// precision.
    fn resident_bytes(&self, precision: Precision) -> usize {
        let words = 4 * self.resident.words().len();
        match precision {
            Precision::Half => words,
            Precision::Single => words + 2 * self.singles.layer(0).len(),
        }
    }
}

/// Returns the bases of `asset` in single precision, expanded on all threads of the pool.
pub(crate) fn singles_in_parallel(asset: &Asset) -> SingleBases {
    SingleBases::from_asset_on(asset, &parallel)
}

/// A grid that is being filled.
pub(crate) struct Grid<'a> {
    pub(crate) capture: &'a Capture,
    pub(crate) params: &'a TradeParams,
    pub(crate) gpu: Option<&'a GpuClock>,
    pub(crate) strided: Vec<usize>,
    pub(crate) held: Images,
    pub(crate) reference: Option<Between<'a>>,
    /// Pairs of a thinned grid, in place of a reference; read with the first asset.
    pub(crate) thinned: Option<Between<'a>>,
    /// Tone curve of the capture, by which its reference is judged, too.
    pub(crate) tone_curve: Option<ToneCurve>,
    pub(crate) points: Vec<TradePoint>,
    /// File that each point is decoded from.
    pub(crate) files: Vec<Arc<Vec<u8>>>,
    pub(crate) monitor: &'a Monitor,
}

/// Setting that the points of one asset and one limit share.
struct Setting {
    lobes: usize,
    role: Role,
    bits: Option<f64>,
    limit: Limit,
    components: usize,
}

impl Grid<'_> {
    /// Measures all steps and limits for one number of lobes in one role; the sweep is number `at[0]` of `at[1]`.
    pub(crate) fn sweep(&mut self, lobes: usize, role: Role, at: [usize; 2]) -> Result<(), FitError> {
        let params = FitParams {
            lobes,
            components: None,
            role: Some(role),
            // As a fit with `--bytes`; how large it is matters to the number of shared bases alone.
            bytes: Some(self.most_bytes() as u64),
            psnr_db: None,
            leave_out: 0.0,
            ..self.params.fit.clone()
        };
        let params = params.check()?;
        let fit = PreparedFit::prepare(std::slice::from_ref(self.capture), &params, self.monitor)?;
        let monitor = self.monitor;
        monitor.stage("grid", || self.steps(&fit, &params, role, at))
    }

    /// Returns the bytes of the largest asset that is tried.
    fn most_bytes(&self) -> usize {
        let usual = MAX_BYTES_PER_TEXEL * self.capture.info().texel_count() + MAX_BYTES_BESIDE;
        self.params.most_bytes.map_or(usual, |x| x as usize)
    }

    fn steps(
        &mut self,
        fit: &PreparedFit,
        params: &ValidFitParams,
        role: Role,
        [number, sweeps]: [usize; 2],
    ) -> Result<(), FitError> {
        let info = self.capture.info();
        let most = self.most_bytes();
        let count = ((MAX_BITS - MIN_BITS) * self.params.steps_per_bit as f64) as usize + 1;
        let total = count * sweeps;
        let mut before: Option<f64> = None;
        for at in 0..count {
            self.monitor.report("grid", number * count + at, total)?;
            let bits = MIN_BITS + at as f64 / self.params.steps_per_bit as f64;
            let step = fit.greatest_coefficient().max(1e-12) / bits.exp2();
            let make = |components: usize| -> Result<Made, FitError> {
                let asset = fit.asset(step, components);
                let chosen = asset.layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
                let material = Material::new(&[info], FitRecord::new(params.asked(), chosen)).to_json();
                Made::from_bytes(pack(&Asset { material, ..asset })?)
            };
            let whole = make(MAX_COMPONENTS)?;
            let all = whole.components();
            // Steps too coarse for any component are all alike; steps beyond the limit end the sweep.
            let last = at + 1 == count;
            if all == 0 && !last {
                continue;
            }
            if whole.bytes.len() > most && before.is_some() {
                break;
            }
            let setting =
                |limit, components| Setting { lobes: params.lobes(), role, bits: Some(bits), limit, components };
            if before.is_none() && params.lobes() > 0 {
                self.lobes_alone(&whole, &setting(Limit::Lobes, 0))?;
            }
            let psnr = self.measure_made(&whole, &[setting(Limit::None, all)])?;
            let mut decode: Vec<usize> = self.params.components.iter().copied().filter(|k| *k < all).collect();
            decode.extend([0].iter().filter(|_| all > 0 && !self.params.components.contains(&0)));
            decode.sort_unstable();
            decode.dedup();
            let prefixes: Vec<Setting> = decode.iter().map(|k| setting(Limit::Decode, *k)).collect();
            self.measure_made(&whole, &prefixes)?;
            for limit in self.params.components.clone().into_iter().filter(|limit| *limit < all) {
                self.monitor.check()?;
                let limited = make(limit)?;
                self.measure_made(&limited, &[setting(Limit::Encode, limited.components())])?;
            }
            if !psnr.is_finite() || before.is_some_and(|before| psnr < before + MIN_GAIN_DB) {
                break;
            }
            before = Some(psnr);
        }
        Ok(())
    }

    /// Measures the tier without residual.
    fn lobes_alone(&mut self, whole: &Made, setting: &Setting) -> Result<(), FitError> {
        let directory = read_directory(&whole.bytes)?;
        let Some(first) = directory.tiers.first() else { return Ok(()) };
        let made = Made::from_bytes(whole.bytes[..*first as usize].to_vec())?;
        let setting = Setting { bits: None, ..*setting };
        let before = self.points.len();
        self.measure_made(&made, &[setting])?;
        self.points[before..].iter_mut().for_each(|point| point.file_bytes = whole.bytes.len());
        Ok(())
    }

    /// Adds the points of `settings`, all of them of `made`; returns `psnr_db` of the last one.
    fn measure_made(&mut self, made: &Made, settings: &[Setting]) -> Result<f64, FitError> {
        let mut last = f64::INFINITY;
        if settings.is_empty() {
            return Ok(last);
        }
        let residual = made.asset.layers[0].residual.is_some();
        let thin = self.thinned_of(made)?;
        let layer = &made.asset.layers[0];
        let queries = random_queries(self.params.evaluations, made.asset.texel_count(), layer, self.params.fit.seed);
        let on_gpu: Option<(&GpuClock, GpuAsset)> = self.gpu.and_then(|clock| {
            let count = clock.query_count();
            let queries = random_queries(count, made.asset.texel_count(), layer, self.params.fit.seed);
            Some((clock, clock.upload(&made.resident, &queries)?))
        });
        let file = Arc::new(made.bytes.clone());
        let lobe_use = LobeUse::of(&made.asset.layers[..1], 0, &[]);
        for setting in settings {
            let (bytes, coefficient_bytes) = tier_bytes(&made.bytes, setting)?;
            let coefficients = setting.components * made.asset.texel_count();
            let precisions: &[Precision] =
                if residual { &[Precision::Half, Precision::Single] } else { &[Precision::Half] };
            for precision in precisions.iter().copied() {
                let metrics = self.metrics(made, setting.components as u32, precision)?;
                last = metrics.psnr_db;
                for rule in [Rule::Fast, Rule::Exact] {
                    if !residual && rule == Rule::Exact {
                        continue;
                    }
                    let options = options(setting.components, rule);
                    // The shader reads halves only.
                    let gpu = on_gpu.as_ref().filter(|_| precision == Precision::Half);
                    self.points.push(TradePoint {
                        lobes: setting.lobes,
                        role: setting.role,
                        lobes_per_texel_mean: lobe_use.per_texel_mean,
                        lobes_per_cluster_mean: lobe_use.per_cluster_mean,
                        bits: setting.bits,
                        bits_per_coefficient: (coefficients > 0)
                            .then(|| 8.0 * coefficient_bytes as f64 / coefficients as f64),
                        limit: setting.limit,
                        components: setting.components,
                        interpolation: rule,
                        precision,
                        bytes,
                        file_bytes: made.bytes.len(),
                        resident_bytes: made.resident_bytes(precision),
                        metrics,
                        psnr_between_db: self.between(made, thin.as_ref(), &options, precision)?,
                        cpu_ns: self.time(made, &queries, &options, precision),
                        gpu_ns: gpu.and_then(|(clock, asset)| clock.nanoseconds(asset, &options, self.params.repeats)),
                        front_bytes_psnr: false,
                        front_ns_psnr: false,
                        front_ns_between: false,
                        all_pairs: None,
                    });
                    self.files.push(file.clone());
                }
            }
        }
        Ok(last)
    }

    /// Returns the asset on a thinned grid where there is no reference; reads its images with the first asset.
    fn thinned_of(&mut self, made: &Made) -> Result<Option<(ThinnedGrid, Resident, SingleBases)>, FitError> {
        if self.reference.is_some() {
            return Ok(None);
        }
        let Some(thin) = thinned_grid(&made.asset, 0) else { return Ok(None) };
        if self.thinned.is_none() {
            let info = self.capture.info();
            let present: Vec<usize> = thin.pairs.iter().copied().filter(|pair| info.has_image(*pair)).collect();
            let pairs = spread(&present, BETWEEN_PAIRS);
            let images = Images::read(self.capture, &pairs, self.monitor)?;
            self.thinned = Some(Between { images, pairs, info: self.capture.info() });
        }
        let (resident, singles) = (resident_in_parallel(&thin.asset), singles_in_parallel(&thin.asset));
        Ok(Some((thin, resident, singles)))
    }

    /// Measures the error on the share of pairs.
    fn metrics(&self, made: &Made, components: u32, precision: Precision) -> Result<Metrics, FitError> {
        let options = DecodeOptions { components, ..MeasureParams::default().options };
        // Where no pair is missing they are multiples of the step between them; else all count that are multiples of 1.
        let step = self.strided.get(1).copied().unwrap_or(1);
        let is_whole = self.capture.info().missing.is_empty();
        let colour_stride = Some(if is_whole { step * self.strided.len().div_ceil(COLOUR_PAIRS) } else { 1 });
        let measuring = MeasureParams { pairs: Some(self.strided.clone()), colour_stride, ..MeasureParams::default() };
        let decoder = decoder(&made.asset, &made.resident, &made.singles, &options, precision);
        let read = |view, light| self.held.get(view, light);
        let quiet = Monitor::default();
        let images = CaptureImages { info: self.capture.info(), read: &read, tone_curve: self.tone_curve };
        Ok(measure_decoder(&images, &made.asset, &decoder, &measuring, None, &quiet)?.metrics())
    }

    /// Measures `psnr_db` where the asset interpolates.
    fn between(
        &self,
        made: &Made,
        thin: Option<&(ThinnedGrid, Resident, SingleBases)>,
        options: &DecodeOptions,
        precision: Precision,
    ) -> Result<Option<f64>, FitError> {
        let (between, asset, resident, singles) = match (&self.reference, &self.thinned, thin) {
            (Some(between), _, _) => (between, &made.asset, &made.resident, &made.singles),
            (None, Some(between), Some((thin, resident, singles))) => (between, &thin.asset, resident, singles),
            _ => return Ok(None),
        };
        let decoder = decoder(asset, resident, singles, options, precision);
        let measuring =
            MeasureParams { pairs: Some(between.pairs.clone()), colour_stride: Some(0), ..MeasureParams::default() };
        let read = |view, light| between.images.get(view, light);
        let quiet = Monitor::default();
        let images = CaptureImages { info: between.info, read: &read, tone_curve: self.tone_curve };
        let measured = measure_decoder(&images, asset, &decoder, &measuring, None, &quiet)?;
        Ok(Some(measured.metrics().psnr_db))
    }

    /// Times an evaluation, in nanoseconds.
    fn time(&self, made: &Made, queries: &[Query], options: &DecodeOptions, precision: Precision) -> f64 {
        let repeats = self.params.repeats;
        match precision {
            Precision::Half => least_nanoseconds(queries, repeats, |(texel, wi, wo)| {
                decode(&made.resident, 0, *texel, *wi, *wo, options)
            }),
            Precision::Single => least_nanoseconds(queries, repeats, |(texel, wi, wo)| {
                decode_single(&made.resident, &made.singles, 0, *texel, *wi, *wo, options)
            }),
        }
    }
}

/// Returns the decoder's options for a point.
pub(crate) fn options(components: usize, rule: Rule) -> DecodeOptions {
    DecodeOptions { components: components as u32, interpolation: rule.interpolation(), ..DecodeOptions::default() }
}

/// Returns a decoder of images with bases of `precision`.
pub(crate) fn decoder<'a>(
    asset: &'a Asset,
    resident: &'a Resident,
    singles: &'a SingleBases,
    options: &DecodeOptions,
    precision: Precision,
) -> ImageDecoder<'a> {
    let decoder = ImageDecoder::new(asset, resident, 0, options);
    if precision == Precision::Half || asset.layers[0].residual.is_none() {
        return decoder;
    }
    decoder.with_single_bases(singles)
}

/// Returns the bytes of the first tier that has `setting`'s components, and of that tier's coefficients.
fn tier_bytes(bytes: &[u8], setting: &Setting) -> Result<(usize, usize), FitError> {
    let directory = read_directory(bytes)?;
    let within = |kind: SectionKind, length: u32| {
        let sections = directory.sections.iter().filter(move |entry| entry.kind == kind as u32);
        sections.filter(move |entry| entry.offset + entry.length <= length)
    };
    let has =
        |kinds: [SectionKind; 2], length: u32| kinds.into_iter().any(|kind| within(kind, length).next().is_some());
    let wanted = |tier: &&u32| {
        within(SectionKind::Basis, **tier).count() > setting.components
            && has([SectionKind::Factors, SectionKind::FactorCodes], **tier)
    };
    let length = match setting.limit {
        Limit::Decode => directory.tiers.iter().find(wanted).copied().unwrap_or(bytes.len() as u32),
        _ => bytes.len() as u32,
    };
    let coefficients = [SectionKind::Coefficients, SectionKind::PredictedCoefficients].into_iter();
    let bytes = coefficients.flat_map(|kind| within(kind, length)).map(|entry| entry.length as usize);
    Ok((length as usize, bytes.sum()))
}
