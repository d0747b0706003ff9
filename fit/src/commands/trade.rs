//! `btf-fit trade`.

use super::failure::Failure;
use super::options::{RoleName, Shared};
use super::output::{check_distinct, check_file, is_stdout, tell};
use super::progress;
use btf_capture::{Capture, write_file_atomically};
use btf_fit::{
    FitParams, GpuChoice, Limit, Precision, Role, Rule, Stage, Trade, TradeParams, bytes_from_text, peak_memory_bytes,
    text_from_bytes, trade, trade_csv, trade_html, trade_plots,
};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Files that `--out` gets beside the plots.
const TABLE: &str = "trade.csv";
const PAGE: &str = "trade.html";
/// Names of all plots that `--out` may get.
const PLOTS: [&str; 4] = ["bytes-psnr.svg", "ns-psnr.svg", "ns-between.svg", "gpu-psnr.svg"];

/// Measure speed against accuracy against size over a grid of settings
///
/// Varies lobes and what they are to the residual, step of the quantisers (bits), components (limited while
/// encoding and while decoding), interpolation and precision in memory; measures bytes, errors and nanoseconds of
/// each setting, and marks those that no other one beats. docs/results/trade.md tells how to choose from them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit trade WOOL --out wool-trade --quick
  btf-fit trade WOOL --lobes 0,2 --roles guide --components 8,16 --gpu none --html wool.html --json -

A page with plots stands alone: it opens without a network.")]
pub(super) struct TradeArgs {
    /// The capture: a folder, a zip or a .btf file
    #[arg(value_name = "CAPTURE")]
    capture: PathBuf,
    /// Write trade.csv, trade.html and the plots into this folder
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Numbers of lobes to try, as --lobes of fit; 0,2,8 if not given
    #[arg(long, value_name = "N,N", value_delimiter = ',')]
    lobes: Option<Vec<usize>>,
    /// What lobes are to the residual, as --role of fit; both if not given
    #[arg(long, value_name = "ROLE,ROLE", value_delimiter = ',', value_enum)]
    roles: Option<Vec<RoleName>>,
    /// Limits of components to try beside none, 0 to 128; 4,16,32 if not given
    #[arg(long, value_name = "N,N", value_delimiter = ',')]
    components: Option<Vec<usize>>,
    /// Steps of the quantisers per bit, that is per factor of two; 1 if not given
    #[arg(long, value_name = "N")]
    steps_per_bit: Option<usize>,
    /// Largest asset to try; 64 bytes a texel and 200 kB if not given
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text)]
    most_bytes: Option<u64>,
    /// Clusters of texels, 1 to 256
    #[arg(long, value_name = "N", default_value_t = FitParams::default().clusters)]
    clusters: usize,
    /// About how many direction pairs to measure each setting on, 1 to 256; 64 if not given
    #[arg(long, value_name = "N")]
    pairs: Option<usize>,
    /// A capture of the same sample in other directions, to measure interpolation on
    #[arg(long, value_name = "CAPTURE")]
    reference: Option<PathBuf>,
    /// Adapter to time on: part of its name, or off (or none); the best one if not given. A software driver is told as such
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
    /// A coarse grid: lobes 0 and 2, one limit of components, half the pairs
    #[arg(long)]
    quick: bool,
    /// Most memory to use
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "4GB")]
    memory: u64,
    /// Seed of every random choice
    #[arg(long, default_value_t = FitParams::default().seed)]
    seed: u64,
    /// Write all settings as a table of comma-separated values
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write a page with plots and the best settings
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Write all settings as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `trade --json` writes.
#[derive(Debug, serde::Serialize)]
struct TradeResult<'a> {
    #[serde(flatten)]
    trade: &'a Trade,
    seconds: f64,
    stages: std::collections::BTreeMap<String, f64>,
    peak_memory_bytes: Option<u64>,
}

pub(super) fn run(args: &TradeArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let params = params(args);
    params.check().map_err(|error| Failure::Usage(error.to_string()))?;
    let outputs: Vec<&Path> = [&args.csv, &args.html, &args.json].into_iter().flatten().map(PathBuf::as_path).collect();
    if [&args.csv, &args.html].into_iter().flatten().any(|path| is_stdout(path)) {
        return Err(Failure::Usage(
            "only --json can write to standard output; give --csv and --html file names".into(),
        ));
    }
    let in_folder: Vec<PathBuf> =
        args.out.iter().flat_map(|dir| [TABLE, PAGE].iter().chain(&PLOTS).map(|name| dir.join(name))).collect();
    let mut distinct = outputs.clone();
    distinct.extend(in_folder.iter().map(PathBuf::as_path));
    check_distinct(&distinct)?;
    let capture = Capture::open(&args.capture)?;
    let reference = args.reference.as_ref().map(Capture::open).transpose()?;
    let mut inputs = vec![args.capture.clone()];
    inputs.extend(args.reference.clone());
    for path in &outputs {
        check_file(path, &inputs)?;
    }
    if let Some(dir) = &args.out {
        let made = !dir.exists();
        std::fs::create_dir_all(dir).map_err(|error| {
            Failure::Path(format!("{} cannot be made a folder ({error}); give another one", dir.display()))
        })?;
        let checked = in_folder.iter().try_for_each(|path| check_file(path, &inputs));
        // Nothing is left behind: the folder comes back with its first file.
        if made {
            let _ = std::fs::remove_dir(dir);
        }
        checked?;
    }

    let monitor = progress::monitor(shared, None)?;
    let found = trade(&capture, reference.as_ref(), &params, &monitor)?;
    let (table, page, plots) = (trade_csv(&found), trade_html(&found), trade_plots(&found));
    // Ctrl-C up to here leaves everything as it was.
    monitor.check()?;
    if let Some(dir) = &args.out {
        std::fs::create_dir_all(dir).map_err(|error| {
            Failure::Path(format!("{} cannot be made a folder ({error}); give another one", dir.display()))
        })?;
        write_file_atomically(dir.join(TABLE), table.as_bytes())?;
        write_file_atomically(dir.join(PAGE), page.as_bytes())?;
        for (name, svg) in &plots {
            write_file_atomically(dir.join(name), svg.as_bytes())?;
        }
    }
    if let Some(path) = &args.csv {
        write_file_atomically(path, table.as_bytes())?;
    }
    if let Some(path) = &args.html {
        write_file_atomically(path, page.as_bytes())?;
    }
    let stages: Vec<Stage> = monitor.stages();
    let result = TradeResult {
        trade: &found,
        seconds: start.elapsed().as_secs_f64(),
        stages: stages.into_iter().map(|stage| (stage.name, stage.seconds)).collect(),
        peak_memory_bytes: peak_memory_bytes(),
    };
    tell(args.json.as_deref(), shared.quiet, &result, || summary(&result))
}

fn params(args: &TradeArgs) -> TradeParams {
    let base = if args.quick { TradeParams::quick() } else { TradeParams::default() };
    // The cache of a capture that does not fit into memory lies where the results will.
    let beside = [&args.out, &args.html, &args.csv].into_iter().flatten().next();
    let folder = beside.and_then(|path| path.parent()).filter(|folder| !folder.as_os_str().is_empty());
    TradeParams {
        fit: FitParams {
            clusters: args.clusters,
            memory_bytes: args.memory,
            seed: args.seed,
            cache_directory: folder.unwrap_or(Path::new(".")).to_path_buf(),
            ..FitParams::default()
        },
        lobes: args.lobes.clone().unwrap_or(base.lobes.clone()),
        roles: args
            .roles
            .as_ref()
            .map_or(base.roles.clone(), |roles| roles.iter().map(|name| Role::from(*name)).collect()),
        gpu: match args.gpu.as_deref() {
            None | Some("auto") => GpuChoice::Best,
            Some("none" | "off") => GpuChoice::Off,
            Some(name) => GpuChoice::Named(name.to_string()),
        },
        components: args.components.clone().unwrap_or(base.components.clone()),
        steps_per_bit: args.steps_per_bit.unwrap_or(base.steps_per_bit),
        most_bytes: args.most_bytes,
        pairs: args.pairs.unwrap_or(base.pairs),
        ..base
    }
}

/// Returns the settings on the front of size, one line each.
fn summary(result: &TradeResult) -> String {
    let trade = result.trade;
    let software = if trade.gpu_is_software { " (software)" } else { "" };
    let mut text = format!(
        "{} settings in {:.0} s, measured on {} of {} pairs; those that none of their size or below beats, over all pairs:\n      size   psnr dB  dE00   cpu ns  gpu ns{software}  lobes        bits  components  limit",
        trade.points.len(),
        result.seconds,
        trade.pairs,
        trade.capture_pairs
    );
    let points = trade.summary.iter().map(|i| &trade.points[*i]);
    for point in points.filter(|point| point.front_bytes_psnr && point.interpolation == Rule::Fast) {
        let metrics = point.all_pairs.as_ref().unwrap_or(&point.metrics);
        debug_assert_eq!(point.precision, Precision::Half);
        let limit = match point.limit {
            Limit::None => "none",
            Limit::Encode => "encode",
            Limit::Decode => "decode",
            Limit::Lobes => "lobes alone",
        };
        let role = match (point.lobes, point.role) {
            (0, _) => "",
            (_, Role::Guide) => " guide",
            (_, Role::Base) => " base",
        };
        text += &format!(
            "\n{:>10}  {:>8.3}  {:>4}  {:>7.0}  {:>gpu_width$}  {:<11}  {:>4}  {:>10}  {limit}",
            text_from_bytes(point.bytes as u64),
            metrics.psnr_db,
            metrics.delta_e00_mean.map_or("-".into(), |x| format!("{x:.2}")),
            point.cpu_ns,
            point.gpu_ns.map_or("-".into(), |ns| if ns < 10.0 { format!("{ns:.2}") } else { format!("{ns:.0}") }),
            format!("{}{role}", point.lobes),
            point.bits.map_or("-".into(), |bits| format!("{bits}")),
            point.components,
            gpu_width = 6 + software.len(),
        );
    }
    text
}
