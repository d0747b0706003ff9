//! `btf-fit fit`.

use super::failure::Failure;
use super::options::{PriorsArg, RoleName, Shared};
use super::output::{check_distinct, check_file, complain, is_stdout, tell};
use super::progress;
use btf_capture::{Capture, write_file_atomically};
use btf_fit::{
    ErrorMeasure, FitError, FitParams, Fitted, Forecast, GpuChoice, KMeansEngine, LastStage, LobeUse, Metrics, Monitor,
    ReportInput, ReportLayer, Role, Stage, ValidFitParams, bytes_from_text, fit_and_measure, peak_memory_bytes,
    remove_finished_stages, report_html, side_of_layer, text_from_bytes,
};
use btf_runtime::{Layer, read_directory};
use clap::{Args, ValueEnum};
use cpu_time::ProcessTime;
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Fit captures and pack them into one asset
///
/// CAPTURE is a folder or a zip of images in Bonn's layout (UBO2003, ATRIUM, spectral sets) or with a list
/// of its images (a .csv), or a UBO2014 file (.btf); docs/guide/captures.md. Several captures of the same texel
/// grid, which differ in the sides of light and eye, become the layers of one asset. Those of the back
/// (side back or transmission-front in capture.toml) are as a camera sees the sample turned over about
/// its vertical axis; their columns and x are mirrored here.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit fit WOOL -o wool.spmm --bytes 2MB --report wool.html
  btf-fit fit WOOL -o wool.spmm --psnr 36               # the smallest asset of this PSNR
  btf-fit fit WOOL -o wool.spmm --bytes 2MB --resume    # again after a crash: goes on where that was
  btf-fit fit LEAF_FRONT LEAF_BACK LEAF_THROUGH_BACK LEAF_THROUGH_FRONT -o leaf.spmm --bytes 6MB --json -")]
pub(super) struct FitArgs {
    /// Captures: folders, zips or .btf files, one per layer
    #[arg(required = true, value_name = "CAPTURE")]
    captures: Vec<PathBuf>,
    /// The asset to write
    #[arg(short, long, value_name = "ASSET.spmm")]
    output: PathBuf,
    /// Largest size of the asset, as 2MB or 2MiB; components and bits are chosen to fit
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, conflicts_with = "psnr")]
    bytes: Option<u64>,
    /// Least PSNR of the 8-bit values in dB, after a tone curve where the capture is brighter than white; the smallest
    /// asset that reaches it is chosen
    #[arg(long, value_name = "DB")]
    psnr: Option<f64>,
    /// Clusters of texels, 1 to 256, each with its own lobes and bases; 32 if not given, with --bytes or --psnr one for
    /// each 1024 texels, 4 to 32, and at most 16 where --bytes leaves less than a byte a texel
    #[arg(long, value_name = "N")]
    clusters: Option<usize>,
    /// Most lobes, 0 to 32: of a texel as base, of a cluster as guide; 8 if not given, with --bytes or --psnr 4, and
    /// fewer where they would take more than 2.5 % of a small file
    #[arg(long, value_name = "N")]
    lobes: Option<usize>,
    /// What lobes are to the residual; base if not given: every texel has lobes of its own, and the residual is what
    /// they leave. With --bytes or --psnr their weights follow from the residual's coefficients and take hardly any
    /// bytes, without either each texel stores its own. As guide lobes add nothing to the value: 0.1 dB better at the
    /// measured directions at most, and worse between them
    #[arg(long, value_enum)]
    role: Option<RoleName>,
    /// Residual components, 0 to 128; what --bytes or --psnr gives, 8 without either
    #[arg(long, value_name = "N")]
    components: Option<usize>,
    /// Most memory to use
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "4GB")]
    memory: u64,
    /// The error to make small: of gamma-encoded values, of linear ones, or relative; auto chooses relative where a
    /// capture holds values above ten times white and spans orders of magnitude, else gamma
    #[arg(long, value_enum, default_value = "auto")]
    error: ErrorArg,
    /// Hold this share of the direction pairs back, 0 to 0.9, and report their error apart
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    leave_out: f64,
    #[command(flatten)]
    priors: PriorsArg,
    /// Find the heights of the texels and store them, so that views beyond the measured ones, towards grazing, keep the
    /// relief in place: about half a byte a texel
    #[arg(long)]
    heights: bool,
    /// Fit a capture in spectral bands as colours under D65
    #[arg(long)]
    colours: bool,
    /// The k-means to use
    #[arg(long, value_enum, default_value = "product")]
    kmeans: KMeansArg,
    /// Seed of every random choice
    #[arg(long, default_value_t = FitParams::default().seed)]
    seed: u64,
    /// Multiply matrices and measure the error on a GPU where that is quicker: auto, off, or a part of the adapter's name, which
    /// then computes whatever its speed. The asset differs from the CPU's by rounding
    #[arg(long, value_name = "auto|off|NAME", default_value = "off", value_parser = GpuChoice::from_words)]
    gpu: GpuChoice,
    /// Keep every finished stage in ASSET.spmm.resume until the asset is written, and go on from what an earlier,
    /// interrupted run of the same command kept there; the asset is the same, byte for byte
    #[arg(long)]
    resume: bool,
    /// Write a page with figures, pictures and error maps
    #[arg(long, value_name = "REPORT.html")]
    report: Option<PathBuf>,
    /// Write the figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ErrorArg {
    Auto,
    Gamma,
    Linear,
    Log,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KMeansArg {
    /// Matrix products, the fastest
    Product,
    /// linfa-clustering's, for comparison
    Linfa,
    /// Two levels, the finer clusters within the coarser, for comparison
    Levels,
}

/// Result that `fit --json` writes. For an asset of several layers the error keys and those of [`LobeUse`] are of all
/// layers; `clusters`, `components`, `lobe_error` and `psnr_left_out_db` are the first layer's, and `by_layer` has each
/// layer's own.
#[derive(Debug, serde::Serialize)]
struct FitResult<'a> {
    asset: String,
    bytes: usize,
    seconds: f64,
    stages: Stages<'a>,
    /// Processor time of all threads so far, seconds.
    processor_seconds: f64,
    /// Processor time of each stage, seconds.
    stages_processor: BTreeMap<&'a str, f64>,
    /// Stages that an earlier run had finished; only with `--resume`.
    #[serde(skip_serializing_if = "Option::is_none")]
    resumed: Option<Vec<String>>,
    peak_memory_bytes: Option<u64>,
    #[serde(flatten)]
    metrics: Metrics,
    #[serde(skip_serializing_if = "Option::is_none")]
    psnr_left_out_db: Option<f64>,
    /// Error that was minimised: `gamma`, `linear` or `log`.
    error: ErrorMeasure,
    clusters: usize,
    #[serde(flatten)]
    lobe_use: LobeUse,
    components: usize,
    /// Bases that the clusters of the first layer mix theirs from.
    shared_bases: usize,
    /// Number of bands, and the root mean square error of bands in the root curve that their basis leaves.
    #[serde(skip_serializing_if = "Option::is_none")]
    bands: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    spectral_rmse: Option<f64>,
    layers: usize,
    by_layer: Vec<LayerResult>,
    lobe_error: LobeError,
}

/// Figures of one layer.
#[derive(Debug, serde::Serialize)]
struct LayerResult {
    side: String,
    psnr_db: f64,
    rel_rmse: f64,
    clusters: usize,
    #[serde(flatten)]
    lobe_use: LobeUse,
    components: usize,
    shared_bases: usize,
}

fn shared_bases(layer: &Layer) -> usize {
    layer.residual.as_ref().map_or(0, |residual| residual.shared.steps.len())
}

impl LayerResult {
    fn model(&self) -> String {
        let LayerResult { clusters, components, shared_bases, .. } = self;
        format!("{clusters} clusters, {components} components, {shared_bases} shared bases")
    }
}

/// Error of the lobes alone, relative to the energy of what they predict: after the Lasso, after the
/// refinement, and after every texel's own selection.
#[derive(Debug, serde::Serialize)]
struct LobeError {
    selected: f64,
    refined: f64,
    sparse: f64,
}

/// Seconds by stage, in the order of the stages.
#[derive(Debug)]
struct Stages<'a>(&'a [Stage]);

impl Serialize for Stages<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for stage in self.0 {
            map.serialize_entry(&stage.name, &stage.seconds)?;
        }
        map.end()
    }
}

pub(super) fn run(args: &FitArgs, shared: &Shared) -> Result<(), Failure> {
    let (start, processor) = (Instant::now(), ProcessTime::now());
    let mut params = params(args);
    check(&params)?;
    let outputs: Vec<&Path> = [Some(&args.output), args.report.as_ref(), args.json.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    if is_stdout(&args.output) {
        return Err(Failure::Usage("an asset cannot be written to standard output; give -o a file name".into()));
    }
    check_distinct(&outputs)?;
    args.priors.check()?;
    let captures = args.captures.iter().map(Capture::open).collect::<Result<Vec<_>, _>>()?;
    for path in &outputs {
        check_file(path, &args.captures)?;
    }
    params.suit(&captures, args.clusters, args.lobes);
    let params = check(&params)?;

    let last = if args.report.is_some() { LastStage::Report } else { LastStage::Measure };
    let monitor = progress::monitor(shared, Some(Forecast::new(captures.len(), &params, last)))?;
    let fitted = fit_and_measure(&captures, &params, &monitor).map_err(|error| match error {
        FitError::Interrupted if args.resume => Failure::Suspended,
        other => other.into(),
    })?;
    let page = match &args.report {
        Some(_) => Some(monitor.stage("report", || page(&captures, &fitted, &monitor))?),
        None => None,
    };
    // Ctrl-C up to here leaves everything as it was.
    monitor.check()?;
    write_file_atomically(&args.output, &fitted.bytes)?;
    if let (Some(path), Some(page)) = (&args.report, page) {
        write_file_atomically(path, page.as_bytes())?;
    }
    if let Some(folder) = params.resume() {
        remove_finished_stages(folder);
    }
    let stages = monitor.stages();
    let result = FitResult {
        asset: args.output.display().to_string(),
        bytes: fitted.bytes.len(),
        seconds: start.elapsed().as_secs_f64(),
        stages: Stages(&stages),
        processor_seconds: processor.elapsed().as_secs_f64(),
        stages_processor: stages.iter().map(|stage| (stage.name.as_str(), stage.processor_s)).collect(),
        resumed: args.resume.then(|| monitor.skipped()),
        peak_memory_bytes: peak_memory_bytes(),
        metrics: fitted.metrics,
        psnr_left_out_db: fitted.psnr_left_out_db,
        error: fitted.error,
        clusters: fitted.clusters,
        lobe_use: fitted.lobe_use,
        components: fitted.components,
        shared_bases: fitted.asset.layers.first().map_or(0, shared_bases),
        bands: fitted.asset.spectrum.as_ref().map(|spectrum| spectrum.wavelengths_nm.len()),
        spectral_rmse: fitted.spectral_rmse,
        layers: fitted.asset.layers.len(),
        by_layer: layer_results(&fitted)?,
        lobe_error: LobeError {
            selected: fitted.lobes.selected,
            refined: fitted.lobes.refined,
            sparse: fitted.lobes.sparse,
        },
    };
    tell(args.json.as_deref(), shared.quiet, &result, || summary(&result, args))?;
    if let Some(asked) = args.psnr.filter(|asked| fitted.metrics.psnr_db < *asked) {
        complain(&format!(
            "warning: {:.2} dB were reached, --psnr asked for {asked}; give more --clusters",
            fitted.metrics.psnr_db
        ));
    }
    Ok(())
}

fn check(params: &FitParams) -> Result<ValidFitParams, Failure> {
    params.check().map_err(|error| Failure::Usage(error.to_string()))
}

fn layer_results(fitted: &Fitted) -> Result<Vec<LayerResult>, FitError> {
    let sections = read_directory(&fitted.bytes)?.sections;
    let layers = &fitted.asset.layers;
    let figures = layers.iter().zip(&fitted.comparisons).enumerate().map(|(number, (layer, comparison))| {
        let metrics = comparison.metrics();
        LayerResult {
            side: side_of_layer(layer).to_string(),
            psnr_db: metrics.psnr_db,
            rel_rmse: metrics.rel_rmse,
            clusters: layer.dictionary.len(),
            lobe_use: LobeUse::of(&layers[number..=number], number, &sections),
            components: layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len()),
            shared_bases: shared_bases(layer),
        }
    });
    Ok(figures.collect())
}

fn params(args: &FitArgs) -> FitParams {
    let folder = args.output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    FitParams {
        bytes: args.bytes,
        psnr_db: args.psnr,
        clusters: args.clusters.unwrap_or(FitParams::default().clusters),
        lobes: args.lobes.unwrap_or(FitParams::default().lobes),
        role: args.role.map(Role::from),
        components: args.components,
        memory_bytes: args.memory,
        error: match args.error {
            ErrorArg::Auto => None,
            ErrorArg::Gamma => Some(ErrorMeasure::Gamma),
            ErrorArg::Linear => Some(ErrorMeasure::Linear),
            ErrorArg::Log => Some(ErrorMeasure::Log),
        },
        leave_out: args.leave_out,
        priors: args.priors.priors(),
        colours: args.colours,
        heights: args.heights,
        seed: args.seed,
        kmeans: match args.kmeans {
            KMeansArg::Product => KMeansEngine::Product,
            KMeansArg::Linfa => KMeansEngine::Linfa,
            KMeansArg::Levels => KMeansEngine::Levels,
        },
        gpu: args.gpu.clone(),
        cache_directory: folder.to_path_buf(),
        resume: args.resume.then(|| {
            let mut name = args.output.clone().into_os_string();
            name.push(".resume");
            name.into()
        }),
    }
}

fn page(captures: &[Capture], fitted: &Fitted, monitor: &Monitor) -> Result<String, FitError> {
    let stages = monitor.stages();
    let layers = captures
        .iter()
        .zip(&fitted.comparisons)
        .enumerate()
        .map(|(layer, (capture, comparison))| ReportLayer { capture, layer, comparison })
        .collect();
    let input = ReportInput {
        bytes: &fitted.bytes,
        asset: &fitted.asset,
        resident: &fitted.resident,
        layers,
        stages: &stages,
        peak_memory_bytes: peak_memory_bytes(),
        psnr_left_out_db: fitted.psnr_left_out_db,
    };
    report_html(&input, monitor)
}

fn summary(result: &FitResult, args: &FitArgs) -> String {
    let metrics = &result.metrics;
    let mut lines = vec![
        format!("{}: {}", args.output.display(), text_from_bytes(result.bytes as u64)),
        format!(
            "  psnr        {:.2} dB ({}), {:.2} dB (linear)",
            metrics.psnr_db,
            metrics.coded_as(),
            metrics.psnr_linear_db
        ),
        format!(
            "  error       {:.4} relative RMSE, {:.4} worst texel, energy x {:.3}",
            metrics.rel_rmse, metrics.worst_texel_rmse, metrics.energy_ratio
        ),
        format!("  minimised   {}", result.error.words()),
    ];
    if let Some(delta_e) = metrics.delta_e00_mean {
        lines.push(format!("  colour      {delta_e:.2} CIEDE2000, mean"));
    }
    if let Some(db) = result.psnr_left_out_db {
        lines.push(format!("  left out    {db:.2} dB"));
    }
    if let [layer] = &result.by_layer[..] {
        lines.push(format!("  model       {}", layer.model()));
    } else {
        for layer in &result.by_layer {
            lines.push(format!("  {:18}  {:.2} dB, {}", layer.side, layer.psnr_db, layer.model()));
        }
    }
    lines.push(format!("  lobes       {}", result.lobe_use));
    if let (Some(bands), Some(rmse)) = (result.bands, result.spectral_rmse) {
        let floor =
            if rmse > 0.0 { format!(", whose basis leaves {:.1} dB", -20.0 * rmse.log10()) } else { String::new() };
        lines.push(format!("  bands       {bands}{floor}"));
    }
    let memory = result.peak_memory_bytes.map_or(String::new(), |bytes| format!(", {} memory", text_from_bytes(bytes)));
    lines.push(format!("  time        {:.1} s{memory}", result.seconds));
    if let Some(path) = &args.report {
        lines.push(format!("  report      {}", path.display()));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Wrapper {
        #[command(flatten)]
        args: FitArgs,
    }

    fn parse(words: &[&str]) -> Result<FitParams, clap::Error> {
        Wrapper::try_parse_from(["fit"].iter().chain(words)).map(|wrapper| params(&wrapper.args))
    }

    #[test]
    fn the_defaults_are_the_librarys() {
        assert_eq!(parse(&["capture", "-o", "a.spmm"]).unwrap(), FitParams::default());
        let other =
            parse(&["c", "-o", "out/a.spmm", "--bytes", "1.75MB", "--memory", "500MiB", "--error", "log"]).unwrap();
        assert_eq!((other.bytes, other.memory_bytes), (Some(1_750_000), 500 << 20));
        let kept = parse(&["c", "-o", "out/a.spmm", "--resume"]).unwrap().resume;
        assert_eq!((other.resume, kept), (None, Some(PathBuf::from("out/a.spmm.resume"))));
        assert_eq!((other.error, other.cache_directory), (Some(ErrorMeasure::Log), PathBuf::from("out")));
    }

    #[test]
    fn options_that_contradict_each_other_are_refused() {
        assert!(parse(&["c", "-o", "a", "--bytes", "2MB", "--psnr", "35"]).is_err());
        assert!(parse(&["-o", "a"]).is_err());
        assert!(parse(&["c"]).is_err());
        assert!(parse(&["c", "-o", "a", "--bytes", "lots"]).is_err());
    }

    #[test]
    fn json_has_the_keys_that_scripts_rely_on_and_stages_in_order() {
        let stages = [
            Stage { name: "read".into(), seconds: 1.0, processor_s: 1.0 },
            Stage { name: "cluster".into(), seconds: 2.0, processor_s: 2.0 },
        ];
        let metrics = Metrics {
            psnr_db: 34.0,
            psnr_linear_db: 40.0,
            rel_rmse: 0.1,
            worst_texel_rmse: 0.2,
            energy_ratio: 1.0,
            delta_e00_mean: Some(1.0),
            tone_curve: None,
        };
        let result = FitResult {
            bands: None,
            spectral_rmse: None,
            asset: "a.spmm".into(),
            bytes: 5,
            seconds: 3.0,
            stages: Stages(&stages),
            processor_seconds: 5.0,
            stages_processor: BTreeMap::new(),
            resumed: None,
            peak_memory_bytes: Some(7),
            metrics,
            psnr_left_out_db: None,
            error: ErrorMeasure::Gamma,
            clusters: 32,
            lobe_use: LobeUse { role: Role::Base, bytes: 3, per_texel_mean: 2.5, per_cluster_mean: 0.0 },
            components: 8,
            shared_bases: 90,
            layers: 1,
            by_layer: Vec::new(),
            lobe_error: LobeError { selected: 0.1, refined: 0.09, sparse: 0.08 },
        };
        let text = serde_json::to_string(&result).unwrap();
        for key in [
            "bytes",
            "seconds",
            "stages",
            "peak_memory_bytes",
            "psnr_db",
            "psnr_linear_db",
            "rel_rmse",
            "worst_texel_rmse",
            "energy_ratio",
            "error",
            "clusters",
            "lobe_role",
            "lobe_bytes",
            "lobes_per_texel_mean",
            "components",
            "delta_e00_mean",
        ] {
            assert!(text.contains(&format!("\"{key}\":")), "{key} in {text}");
        }
        assert!(!text.contains("psnr_left_out_db"));
        assert!(text.contains(r#""lobe_role":"base""#), "{text}");
        assert!(text.contains(r#""stages":{"read":1.0,"cluster":2.0}"#), "{text}");
    }
}
