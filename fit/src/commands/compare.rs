//! `btf-fit compare`.

use super::compare_voltex::{self, Compared};
use super::failure::Failure;
use super::options::{Decoding, Packing, Shared};
use super::output::{check_distinct, check_file, tell};
use super::progress;
use btf_capture::{Capture, CaptureInfo, Direction, write_file_atomically};
use btf_fit::{
    MeasureParams, Metrics, ReportInput, ReportLayer, bytes_from_text, layer_for_capture, load_asset, load_voltex,
    measure_capture, packed_in_parallel, peak_memory_bytes, report_html, resident_in_parallel, unpacked_in_parallel,
    write_heatmaps,
};
use btf_runtime::Resident;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Measure the error of an asset against a capture, or of a volumetric texture against its model
///
/// The capture must have the asset's texels. Of an asset of several layers it is compared with the one of
/// its side. Where its directions are not those of the asset, the asset is interpolated.
///
/// A volumetric texture is compared with the model that it was built of: opacity, transmittance and direct light along
/// parallel rays, from directions and under lights that it was not fitted to.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit compare WOOL wool.spmm --json - --heatmap maps
  btf-fit compare tree.glb tree.voltex --ablate")]
pub(super) struct CompareArgs {
    /// The capture: a folder, a zip or a .btf file; or the model, .obj, .gltf or .glb
    #[arg(value_name = "CAPTURE")]
    capture: PathBuf,
    /// The asset, or the .voltex file
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// Layer of the asset, from 0; the one of the capture's side if not given
    #[arg(long, value_name = "N")]
    layer: Option<usize>,
    /// Measure only the pairs whose light and view are both at most so many degrees from the normal
    #[arg(long, value_name = "DEG")]
    max_theta: Option<f64>,
    #[command(flatten)]
    decoding: Decoding,
    /// Of a volumetric texture also measure what each of its terms is worth, and simplified meshes; takes minutes
    #[arg(long, conflicts_with_all = ["layer", "max_theta", "heatmap", "report", "Packing"])]
    ablate: bool,
    #[command(flatten)]
    packing: Packing,
    /// Most memory to use for images
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "4GB")]
    memory: u64,
    /// Write error maps (per texel, per pair) and a table of all pairs into this folder
    #[arg(long, value_name = "DIR")]
    heatmap: Option<PathBuf>,
    /// Write a page with figures, pictures and error maps
    #[arg(long, value_name = "REPORT.html", conflicts_with = "Packing")]
    report: Option<PathBuf>,
    /// Write the figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `compare --json` writes.
#[derive(Debug, serde::Serialize)]
struct CompareResult {
    capture: String,
    asset: String,
    layer: usize,
    /// Side of the capture, in its own words.
    side: String,
    bytes: usize,
    /// Bytes of the packed resident form, where it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    resident_bytes: Option<usize>,
    #[serde(flatten)]
    metrics: Metrics,
    texels: usize,
    pairs: usize,
    interpolated: bool,
    /// Column and row of the texel with the largest linear error.
    worst_texel: [usize; 2],
    seconds: f64,
    peak_memory_bytes: Option<u64>,
}

pub(super) fn run(args: &CompareArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let outputs: Vec<&Path> =
        [args.report.as_ref(), args.json.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    check_distinct(&outputs)?;
    if let Some((bytes, volume)) = load_voltex(&args.asset)? {
        if args.layer.is_some()
            || args.max_theta.is_some()
            || args.heatmap.is_some()
            || args.report.is_some()
            || args.packing.goal().is_some()
        {
            let path = args.asset.display();
            return Err(Failure::Usage(format!(
                "{path} is a volumetric texture: --layer, --max-theta, --heatmap, --report, --resident-bytes and --resident-psnr are for assets; leave them out"
            )));
        }
        let compared = Compared { model: &args.capture, file: &args.asset, bytes: bytes.len(), volume: &volume };
        return compare_voltex::run(&compared, args.ablate, args.json.as_deref(), shared);
    }
    if args.ablate {
        let path = args.asset.display();
        return Err(Failure::Usage(format!("{path} is no volumetric texture: --ablate is for those; leave it out")));
    }
    let capture = Capture::open(&args.capture)?;
    let (bytes, asset) = load_asset(&args.asset)?;
    for path in &outputs {
        check_file(path, &[args.capture.clone(), args.asset.clone()])?;
    }
    if let Some(dir) = &args.heatmap {
        std::fs::create_dir_all(dir).map_err(|error| {
            Failure::Path(format!("{} cannot be made a folder ({error}); give another one", dir.display()))
        })?;
        check_file(&dir.join("pairs.csv"), std::slice::from_ref(&args.capture))?;
    }
    let layer = match args.layer {
        Some(layer) if layer < asset.layers.len() => layer,
        Some(layer) => {
            let last = asset.layers.len() - 1;
            let path = args.asset.display();
            return Err(Failure::Usage(format!("{path} has no layer {layer}; give --layer 0 to {last}")));
        }
        None => layer_for_capture(capture.info(), &asset)?,
    };

    let monitor = progress::monitor(shared, None)?;
    let packed = args.packing.goal().map(|goal| packed_in_parallel(&asset, goal)).transpose()?;
    let resident = if packed.is_some() { Resident::without_bases(&asset) } else { resident_in_parallel(&asset) };
    let params = MeasureParams {
        layer,
        options: args.decoding.options(),
        memory_bytes: args.memory,
        pairs: args.max_theta.map(|most| pairs_within(capture.info(), most)).transpose()?,
        bases: packed.as_ref().map(|packed| Arc::new(unpacked_in_parallel(packed))),
        ..MeasureParams::default()
    };
    let comparison = monitor.stage("measure", || measure_capture(&capture, &asset, &resident, &params, &monitor))?;
    if let Some(dir) = &args.heatmap {
        write_heatmaps(dir, capture.info(), &comparison)?;
    }
    if let Some(path) = &args.report {
        let layers = vec![ReportLayer { capture: &capture, layer, comparison: &comparison }];
        let input = ReportInput {
            bytes: &bytes,
            asset: &asset,
            resident: &resident,
            layers,
            stages: &[],
            peak_memory_bytes: None,
            psnr_left_out_db: None,
        };
        write_file_atomically(path, report_html(&input, &monitor)?.as_bytes())?;
    }
    let worst = comparison
        .texel_linear_error
        .iter()
        .enumerate()
        .fold((0, 0.0), |worst, (texel, error)| if *error > worst.1 { (texel, *error) } else { worst })
        .0;
    let result = CompareResult {
        capture: args.capture.display().to_string(),
        asset: args.asset.display().to_string(),
        layer,
        side: capture.info().side.to_string(),
        bytes: bytes.len(),
        resident_bytes: packed.as_ref().map(|packed| 4 * packed.words().len()),
        metrics: comparison.metrics(),
        texels: comparison.width * comparison.height,
        pairs: comparison.pairs.len(),
        interpolated: comparison.interpolated,
        worst_texel: [worst % comparison.width, worst / comparison.width],
        seconds: start.elapsed().as_secs_f64(),
        peak_memory_bytes: peak_memory_bytes(),
    };
    tell(args.json.as_deref(), shared.quiet, &result, || summary(&result))
}

/// Returns the pairs of a capture whose light and view are at most `most_deg` degrees from the normal.
fn pairs_within(info: &CaptureInfo, most_deg: f64) -> Result<Vec<usize>, Failure> {
    let within = |direction: &Direction| {
        // Lights of a transmission capture stand behind the surface.
        direction.theta_deg.min(180.0 - direction.theta_deg) <= most_deg
    };
    let [views, lights] =
        [&info.views, &info.lights].map(|set| set.directions().iter().map(within).collect::<Vec<_>>());
    let count = lights.len();
    let pairs: Vec<usize> = info.present_pairs().filter(|pair| views[pair / count] && lights[pair % count]).collect();
    match pairs.is_empty() {
        false => Ok(pairs),
        true => Err(Failure::Usage(format!(
            "the capture {} has no pair within {most_deg} degrees of the normal; give a larger --max-theta",
            info.name
        ))),
    }
}

fn summary(result: &CompareResult) -> String {
    let metrics = &result.metrics;
    let [x, y] = result.worst_texel;
    let mut text = format!(
        "psnr            {:.3} dB ({})\npsnr, linear    {:.3} dB\nrelative RMSE   {:.5}\nworst texel     {:.5} RMSE at column {x}, row {y}",
        metrics.psnr_db,
        metrics.coded_as(),
        metrics.psnr_linear_db,
        metrics.rel_rmse,
        metrics.worst_texel_rmse
    );
    text += &format!("\nenergy          x {:.4}", metrics.energy_ratio);
    if let Some(delta_e) = metrics.delta_e00_mean {
        text += &format!("\nCIEDE2000       {delta_e:.3}, mean");
    }
    if result.interpolated {
        text += "\nthe capture has directions that the asset has not measured; the asset was interpolated there";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{DirectionSet, ImageFormat};

    #[test]
    fn pairs_within_an_angle_are_those_of_upright_views_and_lights() {
        let set = DirectionSet::bonn81();
        let info = CaptureInfo::new("bonn", 1, 1, set.clone(), set, ImageFormat::Png);
        let upright = pairs_within(&info, 20.0).ok().unwrap();
        assert_eq!(upright.len(), 49);
        assert!(upright.iter().all(|pair| pair / 81 < 7 && pair % 81 < 7));
        assert_eq!(pairs_within(&info, 90.0).ok().unwrap().len(), 81 * 81);
        assert!(pairs_within(&info, -1.0).is_err());
    }
}
