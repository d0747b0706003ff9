//! Page about a fit: figures, pictures beside their originals, where the error is, what the asset is made of. One HTML
//! file that needs nothing else, neither network nor other files.

use crate::error::FitError;
use crate::input::layer_frame::{turn_image, turn_map};
use crate::input::pair_stride::pairs_at_stride;
use crate::inspect::describe::{Description, describe};
use crate::inspect::load::resident_in_parallel;
use crate::inspect::lobe_use::LobeUse;
use crate::measure::compare::{Comparison, MeasureParams, colour_pair_stride, measure};
use crate::measure::heatmap::{Raster, scale_top};
use crate::measure::image_decoder::{ImageDecoder, Spot};
use crate::metrics::ErrorSums;
use crate::monitor::{Monitor, Stage};
use crate::params::Role;
use crate::report::base64::base64;
use crate::report::page::{decibel_text, page, tile};
use crate::report::plot::{bars, finite_range, histogram, legend, line, polar};
use btf_capture::{
    Capture, CaptureInfo, Direction, DirectionSet, Encoder8, ImageFormat, Pixels, Transfer, text_from_bytes,
};
use btf_runtime::{Asset, DecodeOptions, Layer, Resident};
use maud::{Markup, html};

/// Largest side of a picture in the page, in texels; larger captures show their centre.
const MAX_SIDE: usize = 256;
/// Side of pictures and maps on the page, in CSS pixels: four fit beside each other.
const SHOWN_SIDE: usize = 250;
/// Factor by which the difference pictures are brightened.
const DIFFERENCE_GAIN: u8 = 8;
/// Points of the curve of size against quality at most.
const MAX_TIERS: usize = 12;
/// Stride among the colour difference's pairs of the pairs that the curve of size against quality is measured on: about
/// 64 in all.
const TIER_PAIR_SHARE: usize = 4;

/// Names of a pair with light and eye on one side, and on two.
struct Title {
    reflected: &'static str,
    through: &'static str,
}

/// Directions of view and light that the page shows, theta and phi in degrees, a light behind the surface
/// as its mirror image in front: frontal, grazing light, mirror direction (straight through) at 45, across,
/// both grazing.
const SHOWN: [(Title, [f64; 2], [f64; 2]); 4] = [
    (Title { reflected: "Frontal view and light", through: "Frontal, light behind" }, [0.0, 0.0], [0.0, 0.0]),
    (Title { reflected: "Mirror direction, 45°", through: "Straight through, 45°" }, [45.0, 180.0], [45.0, 0.0]),
    (
        Title { reflected: "Frontal view, light from the side", through: "Frontal view, light askew behind" },
        [0.0, 0.0],
        [60.0, 90.0],
    ),
    (
        Title { reflected: "Grazing view and light", through: "Grazing view, grazing light behind" },
        [75.0, 90.0],
        [75.0, 0.0],
    ),
];

/// Input of a page.
pub struct ReportInput<'a> {
    /// Bytes of the asset's file.
    pub bytes: &'a [u8],
    /// The asset, as [`Asset::parse`] reads it.
    pub asset: &'a Asset,
    /// Resident form of the asset.
    pub resident: &'a Resident,
    /// Captures with the layers that they belong to and how they compare.
    pub layers: Vec<ReportLayer<'a>>,
    /// Times of the fit; empty where it was not watched.
    pub stages: &'a [Stage],
    /// Peak memory, where known.
    pub peak_memory_bytes: Option<u64>,
    /// `psnr_db` of the pairs that were held back, where some were.
    pub psnr_left_out_db: Option<f64>,
}

/// A layer and the capture it came from.
pub struct ReportLayer<'a> {
    /// The capture.
    pub capture: &'a Capture,
    /// Layer of the asset.
    pub layer: usize,
    /// Measured error of the layer.
    pub comparison: &'a Comparison,
}

/// Returns the page. Reads four images of each capture and about 64 for the curve of size against quality.
///
/// # Errors
/// If the asset's bytes are damaged, an image cannot be read, or the monitor was cancelled.
pub fn report_html(input: &ReportInput, monitor: &Monitor) -> Result<String, FitError> {
    let description = describe(input.bytes)?;
    let mut sums = ErrorSums::default();
    for layer in &input.layers {
        sums.add(&layer.comparison.sums);
    }
    let raw: u64 =
        input.layers.iter().map(|l| (l.capture.info().texel_count() * l.capture.info().pair_count() * 3) as u64).sum();
    let name = match description.material.name.as_str() {
        "" => "Material",
        name => name,
    };
    let mut sections = Vec::new();
    for layer in &input.layers {
        monitor.check()?;
        sections.push(layer_section(input, layer, &description)?);
    }
    let tiers = tier_curve(input, &description, monitor)?;
    let metrics = sums.metrics();
    let body = html! {
        header {
            h1 { (name) }
            p { (description.width) " × " (description.height) " texels, " (direction_words(&description)) }
        }
        div.tiles {
            (tile("PSNR", &decibel_text(metrics.psnr_db), &format!("{}, dB", metrics.coded_as())))
            (tile("Size", &text_from_bytes(description.bytes), &format!("1 : {:.0} of {}", raw as f64 / description.bytes as f64, text_from_bytes(raw))))
            (tile("Colour difference", &metrics.delta_e00_mean.map_or("–".into(), |x| format!("{x:.2}")), "CIEDE2000, mean"))
            (tile("Relative RMSE", &format!("{:.2} %", 100.0 * metrics.rel_rmse), "linear"))
            (tile("PSNR, linear", &decibel_text(metrics.psnr_linear_db), "peak = brightest sample, dB"))
            (tile("Worst texel", &format!("{:.4}", metrics.worst_texel_rmse), "RMSE, linear"))
            @if let Some(db) = input.psnr_left_out_db {
                (tile("PSNR of pairs held back", &decibel_text(db), &format!("{}, dB", metrics.coded_as())))
            }
            @if let Some(bytes) = input.peak_memory_bytes {
                (tile("Peak memory", &text_from_bytes(bytes), "of the whole program"))
            }
        }
        @for section in &sections { (section) }
        section {
            h2 { "Size and time" }
            div.row {
                @if tiers.len() > 1 {
                    figure {
                        figcaption { "Size against quality, on a share of the pairs" @if input.layers.len() > 1 { " of the first layer" } ": each point is a prefix of the file that is an asset of its own" }
                        (line(&tiers, "size in MB", "PSNR in dB"))
                    }
                }
                figure { figcaption { "Where the bytes are" } (section_bars(&description)) }
                @if !input.stages.is_empty() {
                    figure { figcaption { "Where the time went" } (stage_bars(input.stages)) }
                }
            }
        }
        (fit_section(&description))
        footer { "Written by btf-fit " (env!("CARGO_PKG_VERSION")) ". PSNR is of 8-bit gamma-encoded values over all texels, pairs and channels, peak 255, unless it says otherwise." }
    };
    Ok(page(&format!("{name} – BTF fit"), "", &body))
}

fn direction_words(description: &Description) -> String {
    let layers: Vec<String> = description
        .layers
        .iter()
        .map(|layer| format!("{} with {} views × {} lights", layer.side, layer.views, layer.lights))
        .collect();
    layers.join("; ")
}

/// Returns the sections about one layer.
fn layer_section(input: &ReportInput, layer: &ReportLayer, description: &Description) -> Result<Markup, FitError> {
    let (info, comparison) = (layer.capture.info(), layer.comparison);
    let source = &input.asset.layers[layer.layer];
    let facts = &description.layers[layer.layer];
    let heading = |title: &str| {
        if input.layers.len() > 1 { format!("{title} – {}", info.side) } else { title.to_string() }
    };
    let rmse = comparison.texel_rmse_codes();
    let top = scale_top(rmse.iter().copied());
    let map = Raster::of_values(&rmse.into_iter().map(Some).collect::<Vec<_>>(), comparison.width, top);
    let pair_rmse = comparison.pair_rmse_codes();
    let pair_top = scale_top(pair_rmse.iter().flatten().copied());
    let pair_map = Raster::of_values(&pair_rmse, comparison.lights, pair_top);
    let (by_view, by_light) = (comparison.psnr_by_view(), comparison.psnr_by_light());
    let range = finite_range(by_view.iter().chain(&by_light));
    let counts: Vec<(String, u64)> =
        facts.lobe_counts.iter().enumerate().map(|(lobes, texels)| (lobes.to_string(), *texels)).collect();
    let families: Vec<(String, f64, String)> = facts
        .families
        .iter()
        .filter(|f| f.texels > 0)
        .map(|f| (f.family.to_string(), f.texels as f64, format!("{} of {}", f.texels, source.lobe_refs.len())))
        .collect();
    let guides = facts.lobe_use.role == Role::Guide;
    Ok(html! {
        section {
            h2 { (heading("Beside the originals")) }
            (pictures(input, layer)?)
        }
        section {
            h2 { (heading("Where the error is")) }
            div.row {
                figure {
                    figcaption { "RMSE of each texel over all pairs" }
                    (picture(&map, SHOWN_SIDE)?) (legend((0.0, top.into()), "8-bit steps"))
                }
                figure {
                    figcaption { "PSNR by view (centre: frontal, rim: 90°)" }
                    (polar(info.views.directions(), &by_view, range)) (legend(range, "dB"))
                }
                figure {
                    figcaption { "PSNR by light" }
                    (polar(info.lights.directions(), &by_light, range)) (legend(range, "dB"))
                }
                figure {
                    figcaption { "RMSE of each pair: row view, column light" }
                    (picture(&pair_map, SHOWN_SIDE)?) (legend((0.0, pair_top.into()), "8-bit steps"))
                }
            }
        }
        section {
            h2 { (heading("What it is made of")) }
            div.row {
                figure {
                    figcaption { (facts.clusters) " clusters, each with its own dictionary and bases" }
                    (picture(&cluster_map(source, info), SHOWN_SIDE)?)
                }
                figure {
                    figcaption { (lobe_caption(&facts.lobe_use)) }
                    (picture(&lobe_map(source, info), SHOWN_SIDE)?)
                    (legend((0.0, facts.lobes_per_texel_max as f64), "lobes"))
                }
                figure { figcaption { "How many texels have how many lobes" @if guides { " in their cluster's set" } } (histogram(&counts, if guides { "lobes per cluster" } else { "lobes per texel" })) }
                @if !families.is_empty() {
                    figure { figcaption { "Lobe families by the texels " @if guides { "of the clusters that use them" } @else { "that use them" } } (bars(&families)) }
                }
            }
        }
    })
}

/// Returns the caption of the map of lobe counts, which says whose lobes are counted.
fn lobe_caption(lobes: &LobeUse) -> String {
    match lobes.role {
        Role::Base => format!("Lobes of each texel, mean {:.2}: the residual is what they leave", lobes.per_texel_mean),
        Role::Guide => format!(
            "Lobes of each texel's cluster, mean {:.2} per cluster: they guide interpolation, sampling and editing and add nothing to the value",
            lobes.per_cluster_mean
        ),
    }
}

/// Returns a map with each cluster in a colour of its own: hues a golden angle apart, so that neighbours in number
/// differ. Columns are in the capture's order.
fn cluster_map(layer: &Layer, info: &CaptureInfo) -> Raster {
    let mut clusters = layer.texel_clusters.clone();
    turn_map(&mut clusters, info.width, info.side);
    let colour = |cluster: u8| {
        let hue = (f32::from(cluster) * 0.618_034).fract() * 6.0;
        let value = if cluster.is_multiple_of(2) { 0.92 } else { 0.68 };
        let channel = |offset: f32| {
            let x = ((hue + offset) % 6.0 - 3.0).abs() - 1.0;
            ((1.0 - 0.6 * (1.0 - x.clamp(0.0, 1.0))) * value * 255.0) as u8
        };
        [channel(0.0), channel(4.0), channel(2.0)]
    };
    Raster::from_fn(info.width, info.height, |x, y| colour(clusters[y * info.width + x]))
}

fn lobe_map(layer: &Layer, info: &CaptureInfo) -> Raster {
    let mut values: Vec<_> = layer.texel_lobe_counts.iter().map(|count| Some(f32::from(*count))).collect();
    let top = values.iter().flatten().fold(0.0f32, |top, count| top.max(*count));
    turn_map(&mut values, info.width, info.side);
    Raster::of_values(&values, info.width, top)
}

fn section_bars(description: &Description) -> Markup {
    let words = |kind: &str| match kind {
        "Material" => "description".to_string(),
        "Layer" => "layer parameters".into(),
        "Directions" => "directions".into(),
        "TexelClusters" => "cluster per texel".into(),
        "TexelLobeCounts" => "lobe counts".into(),
        "Dictionary" => "dictionaries".into(),
        "LobeRefs" => "lobe references".into(),
        "Factors" | "FactorCodes" => "basis factors".into(),
        "SharedBases" | "SharedBasesPart" => "shared bases".into(),
        "Basis" => "mixtures of the bases".into(),
        "Coefficients" | "PredictedCoefficients" => "coefficients".into(),
        other => other.to_string(),
    };
    let rows: Vec<_> =
        description.sections.iter().map(|s| (words(&s.kind), s.bytes as f64, text_from_bytes(s.bytes))).collect();
    bars(&rows)
}

fn stage_bars(stages: &[Stage]) -> Markup {
    let rows: Vec<_> = stages.iter().map(|s| (s.name.clone(), s.seconds, format!("{:.1} s", s.seconds))).collect();
    bars(&rows)
}

fn fit_section(description: &Description) -> Markup {
    let material = &description.material;
    let guides = description.layers.first().is_some_and(|layer| layer.lobe_use.role == Role::Guide);
    html! {
        section {
            h2 { "How it was made" }
            table {
                @for record in material.layers.iter().map(|layer| &layer.capture) {
                    tr { th { "Capture" } td { (record.name) @if !record.provenance.is_empty() { " – " (record.provenance) } } }
                    tr {
                        th { "Its conventions" }
                        td { (record.format) ", curve " (record.transfer) ", cosine " (record.cosine) ", scale " (record.scale) ", " (record.side) }
                    }
                }
                @if let Some([width, height]) = description.size_mm {
                    tr { th { "Physical size" } td { (width) " × " (height) " mm" } }
                }
                @if let Some(fit) = &material.fit {
                    tr {
                        th { "Fit" }
                        td {
                            (fit.clusters) " clusters, at most " (fit.lobes) " lobes " (if guides { "a cluster, " } else { "a texel, " }) (fit.components) " components, error " (fit.error)
                            ", k-means " (fit.kmeans) ", seed " (fit.seed)
                            @if let Some(bytes) = fit.bytes { ", at most " (text_from_bytes(bytes)) }
                            @if let Some(db) = fit.psnr_db { ", at least " (db) " dB" }
                            @if let Some(share) = fit.leave_out { ", " (format!("{:.0}", 100.0 * share)) " % of the pairs held back" }
                        }
                    }
                }
                @for layer in &description.layers {
                    tr { th { "Lobes" } td { (layer.lobe_use) } }
                    tr {
                        th { "Residual" }
                        td {
                            (layer.residual) ", " (layer.components) " components"
                            @if layer.components > 0 {
                                " mixed from " (layer.shared_bases) " shared bases, ranks "
                                (format!("{:?}", layer.ranks))
                            }
                        }
                    }
                }
                tr { th { "In the decoder's memory" } td { (text_from_bytes(description.resident_bytes)) } }
            }
        }
    }
}

/// Returns a table of originals, decoded images and differences of a few pairs.
fn pictures(input: &ReportInput, layer: &ReportLayer) -> Result<Markup, FitError> {
    let info = layer.capture.info();
    let source = &input.asset.layers[layer.layer];
    let decoder = ImageDecoder::new(input.asset, input.resident, layer.layer, &DecodeOptions::default());
    // Shown with the sRGB curve, whatever the files have.
    let shown = Encoder8::new(&CaptureInfo { transfer: Transfer::Srgb, ..info.in_format(ImageFormat::Png) });
    let mut columns = Vec::new();
    let mut seen = Vec::new();
    for (title, view, light) in SHOWN {
        let title = if info.side.is_transmission() { title.through } else { title.reflected };
        let view = nearest(&info.views, view);
        let light = nearest(&info.lights, light);
        if seen.contains(&(view, light)) || !info.has_image(view * info.lights.len() + light) {
            continue;
        }
        seen.push((view, light));
        let linear = match layer.capture.read(view, light)? {
            Pixels::Linear(linear) => linear,
            Pixels::Encoded8(codes) => {
                let table = info.linear_from_encoded8(light);
                codes.into_iter().map(|code| table[usize::from(code)]).collect()
            }
        };
        let spots = (
            Spot::of_set(&source.views, &info.views, info.side)[view],
            Spot::of_set(&source.lights, &info.lights, info.side)[light],
        );
        let mut decoded = vec![0.0; linear.len()];
        decoder.decode_image(&decoder.plan(spots.0, spots.1), &mut decoded);
        turn_image(&mut decoded, info.width, info.side);
        let (mut original, mut coded) = (vec![0; linear.len()], vec![0; linear.len()]);
        shown.encode_slice(light, &linear, &mut original);
        shown.encode_slice(light, &decoded, &mut coded);
        let difference: Vec<u8> =
            original.iter().zip(&coded).map(|(x, y)| x.abs_diff(*y).saturating_mul(DIFFERENCE_GAIN)).collect();
        let psnr = layer.comparison.psnr_of_pairs([view * info.lights.len() + light]);
        let (v, l) = (info.views.directions()[view], info.lights.directions()[light]);
        let caption = html! {
            strong { (title) }
            small { "view " (v) } small { "light " (l) }
            @if let Some(db) = psnr { small { (decibel_text(db)) " dB" } }
        };
        let pixels = [&original, &coded, &difference];
        columns.push((caption, pixels.map(|pixels| picture(&crop(pixels, info.width, info.height), SHOWN_SIDE))));
    }
    let mut captions = Vec::new();
    let mut rows = [const { Vec::new() }; 3];
    for (caption, pictures) in columns {
        captions.push(caption);
        for (row, picture) in rows.iter_mut().zip(pictures) {
            row.push(picture?);
        }
    }
    let labels = ["original".to_string(), "decoded".to_string(), format!("difference × {DIFFERENCE_GAIN}")];
    Ok(html! {
        table.pictures {
            tr { th {} @for caption in &captions { th { (caption) } } }
            @for (label, row) in labels.iter().zip(&rows) {
                tr { th { (label) } @for picture in row { td { (picture) } } }
            }
        }
    })
}

/// Returns the number of the direction of `set` nearest to theta and phi in degrees; a direction behind the surface
/// counts as its mirror image in front.
fn nearest(set: &DirectionSet, angles: [f64; 2]) -> usize {
    let wanted = Direction::new(angles[0], angles[1]).unit_f64();
    let closeness = |direction: &Direction| {
        let [x, y, z] = direction.unit_f64();
        x * wanted[0] + y * wanted[1] + z.abs() * wanted[2]
    };
    let all = set.directions();
    // The first of equally near ones.
    (0..all.len()).rev().max_by(|a, b| closeness(&all[*a]).total_cmp(&closeness(&all[*b]))).unwrap_or(0)
}

/// Returns the centre of an image, at most [`MAX_SIDE`] texels wide and high.
fn crop(pixels: &[u8], width: usize, height: usize) -> Raster {
    let (w, h) = (width.min(MAX_SIDE), height.min(MAX_SIDE));
    let (x0, y0) = ((width - w) / 2, (height - h) / 2);
    Raster::from_fn(w, h, |x, y| {
        let at = ((y0 + y) * width + x0 + x) * 3;
        [pixels[at], pixels[at + 1], pixels[at + 2]]
    })
}

/// Returns an image element with an inlined PNG, whose longer side is shown `side` pixels long.
fn picture(raster: &Raster, side: usize) -> Result<Markup, FitError> {
    // Maps of large captures are shown smaller than they are; a picture of their size would only weigh.
    let factor = raster.width.max(raster.height).div_ceil(2 * MAX_SIDE);
    let small;
    let raster = if factor > 1 {
        small = Raster::from_fn(raster.width.div_ceil(factor), raster.height.div_ceil(factor), |x, y| {
            raster.pixel(x * factor, y * factor)
        });
        &small
    } else {
        raster
    };
    let longer = raster.width.max(raster.height);
    let scaled = |length: usize| (length * side).div_ceil(longer);
    let source = format!("data:image/png;base64,{}", base64(&raster.png()?));
    Ok(html! { img src=(source) width=(scaled(raster.width)) height=(scaled(raster.height)) alt=""; })
}

/// Returns size in MB and `psnr_db` of the file's tiers, on a share of the pairs of the first layer.
fn tier_curve(input: &ReportInput, description: &Description, monitor: &Monitor) -> Result<Vec<(f64, f64)>, FitError> {
    let Some(layer) = input.layers.first() else {
        return Ok(Vec::new());
    };
    let info = layer.capture.info();
    let stride = colour_pair_stride(info.views.len(), info.lights.len());
    let pairs = pairs_at_stride(info, stride * TIER_PAIR_SHARE);
    let params = MeasureParams { layer: layer.layer, pairs: Some(pairs), ..MeasureParams::default() };
    let present: Vec<usize> = description
        .tiers
        .iter()
        .map(|tier| tier.bytes as usize)
        .filter(|length| *length <= input.bytes.len())
        .collect();
    let count = present.len().min(MAX_TIERS);
    let mut points = Vec::new();
    for i in 0..count {
        // The first, the last, and evenly between.
        let length = present[i * (present.len() - 1) / (count - 1).max(1)];
        let asset = Asset::parse(&input.bytes[..length])?;
        let found = measure(layer.capture, &asset, &resident_in_parallel(&asset), &params, monitor)?;
        points.push((length as f64 / 1e6, found.metrics().psnr_db));
    }
    points.retain(|point| point.1.is_finite());
    Ok(points)
}

#[cfg(test)]
mod tests;
