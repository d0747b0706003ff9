//! A trade as a table (CSV), plots (SVG) and a page (HTML) that needs nothing else.

use crate::params::Role;
use crate::report::page::{decibel_text, page, tile};
use crate::report::plot::{Dot, Mark, scatter};
use crate::trade::point::{Limit, Precision, Rule, TradePoint};
use crate::trade::trade::Trade;
use btf_capture::text_from_bytes;
use maud::{Markup, html};

/// Columns of the table, in order.
const COLUMNS: [&str; 30] = [
    "lobes",
    "role",
    "lobes_per_texel_mean",
    "lobes_per_cluster_mean",
    "bits",
    "bits_per_coefficient",
    "limit",
    "components",
    "interpolation",
    "precision",
    "bytes",
    "resident_bytes",
    "psnr_db",
    "psnr_linear_db",
    "delta_e00_mean",
    "rel_rmse",
    "worst_texel_rmse",
    "psnr_between_db",
    "cpu_ns",
    "gpu_ns",
    "gpu_kind",
    "front_bytes_psnr",
    "front_ns_psnr",
    "front_ns_between",
    "all_psnr_db",
    "all_psnr_linear_db",
    "all_delta_e00_mean",
    "all_rel_rmse",
    "all_worst_texel_rmse",
    "fit",
];

fn role_word(role: Role) -> &'static str {
    match role {
        Role::Guide => "guide",
        Role::Base => "base",
    }
}

fn limit_word(limit: Limit) -> &'static str {
    match limit {
        Limit::None => "none",
        Limit::Encode => "encode",
        Limit::Decode => "decode",
        Limit::Lobes => "lobes",
    }
}

fn rule_word(rule: Rule) -> &'static str {
    match rule {
        Rule::Fast => "fast",
        Rule::Exact => "exact",
    }
}

fn precision_word(precision: Precision) -> &'static str {
    match precision {
        Precision::Half => "half",
        Precision::Single => "single",
    }
}

/// Returns all points as CSV: one row each under one row of names; empty where there is no figure, `inf` for an
/// infinite PSNR. Columns `all_...` are errors over all pairs, of the points of the summary. `gpu_kind` is `software`
/// where `gpu_ns` is the time of a driver that computes on the CPU. `fit` has the options that make the row.
pub fn trade_csv(trade: &Trade) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    let optional = |x: Option<f64>, decimals: usize| x.map_or(String::new(), |x| format!("{x:.decimals$}"));
    let metrics = |m: Option<&crate::metrics::Metrics>| {
        [
            optional(m.map(|m| m.psnr_db), 4),
            optional(m.map(|m| m.psnr_linear_db), 4),
            optional(m.and_then(|m| m.delta_e00_mean), 5),
            optional(m.map(|m| m.rel_rmse), 6),
            optional(m.map(|m| m.worst_texel_rmse), 6),
        ]
    };
    for point in &trade.points {
        let mut row: Vec<String> = vec![
            point.lobes.to_string(),
            role_word(point.role).into(),
            format!("{:.3}", point.lobes_per_texel_mean),
            format!("{:.3}", point.lobes_per_cluster_mean),
            optional(point.bits, 3),
            optional(point.bits_per_coefficient, 4),
            limit_word(point.limit).into(),
            point.components.to_string(),
            rule_word(point.interpolation).into(),
            precision_word(point.precision).into(),
            point.bytes.to_string(),
            point.resident_bytes.to_string(),
        ];
        row.extend(metrics(Some(&point.metrics)));
        row.extend([optional(point.psnr_between_db, 4), format!("{:.1}", point.cpu_ns), optional(point.gpu_ns, 3)]);
        let kind = if trade.gpu_is_software { "software" } else { "gpu" };
        row.push(point.gpu_ns.map_or(String::new(), |_| kind.into()));
        let fronts = [point.front_bytes_psnr, point.front_ns_psnr, point.front_ns_between];
        row.extend(fronts.map(|on| u8::from(on).to_string()));
        row.extend(metrics(point.all_pairs.as_ref()));
        row.push(fit_options(trade, point));
        text += &row.join(",");
        text.push('\n');
    }
    text
}

/// Returns a number of bits without needless zeros.
fn bits_text(bits: f64) -> String {
    format!("{}", (bits * 100.0).round() / 100.0)
}

/// Returns the lobes of a point, in words.
fn lobe_words(point: &TradePoint) -> String {
    let count = match point.lobes {
        1 => "1 lobe".to_string(),
        n => format!("{n} lobes"),
    };
    match (point.lobes, point.limit, point.role) {
        (0, ..) => "no lobes".into(),
        (_, Limit::Lobes, Role::Guide) => format!("{count} alone, one mix per cluster"),
        (_, Limit::Lobes, Role::Base) => format!("{count} alone, mixed per texel"),
        (_, _, Role::Guide) => format!("{count} as guide"),
        (_, _, Role::Base) => format!("{count} as base"),
    }
}

/// Returns the components of a point, in words.
fn component_words(point: &TradePoint) -> String {
    match point.limit {
        Limit::Lobes => "none".into(),
        Limit::None => format!("{}, all", point.components),
        Limit::Encode => format!("{}, limited in the file", point.components),
        Limit::Decode => format!("{}, limited by the decoder", point.components),
    }
}

/// Returns the setting of a point in words.
fn words(point: &TradePoint) -> String {
    let lobes = lobe_words(point);
    let Some(bits) = point.bits else { return lobes };
    format!(
        "{lobes}; components: {}; {} bits; {}, {}",
        component_words(point),
        bits_text(bits),
        rule_word(point.interpolation),
        precision_word(point.precision)
    )
}

/// One plot: file name, caption, picture.
struct Plot {
    name: &'static str,
    caption: String,
    picture: Markup,
}

fn plots(trade: &Trade) -> Vec<Plot> {
    let mut lobes: Vec<usize> = trade.points.iter().map(|point| point.lobes).collect();
    lobes.sort_unstable();
    lobes.dedup();
    let groups: Vec<String> = lobes
        .iter()
        .map(|n| match n {
            0 => "no lobes".to_string(),
            1 => "1 lobe".to_string(),
            n => format!("{n} lobes"),
        })
        .collect();
    let mark = |point: &TradePoint| match (point.limit, point.role) {
        (Limit::Lobes, _) => Mark::Triangle,
        (_, Role::Guide) => Mark::Circle,
        (_, Role::Base) => Mark::Square,
    };
    let all_marks = [
        (Mark::Circle, "residual alone, lobes guide"),
        (Mark::Square, "residual on lobes as base"),
        (Mark::Triangle, "lobes alone"),
    ];
    let marks: Vec<(Mark, &str)> =
        all_marks.into_iter().filter(|(kind, _)| trade.points.iter().any(|point| mark(point) == *kind)).collect();
    let dot = |point: &TradePoint, x: f64, y: f64, unit: &str, front: bool| Dot {
        x,
        y,
        group: lobes.iter().position(|n| *n == point.lobes).unwrap_or(0),
        mark: mark(point),
        front,
        title: format!("{}: {}, {} dB", words(point), unit, decibel_text(y)),
    };
    let draw = |dots: &[Dot], x: &str, y: &str| scatter(dots, &groups, &marks, x, y);
    let file = |point: &&TradePoint| point.interpolation == Rule::Fast && point.precision == Precision::Half;
    let bytes: Vec<Dot> = trade
        .points
        .iter()
        .filter(file)
        .map(|p| dot(p, p.bytes as f64 / 1e3, p.metrics.psnr_db, &text_from_bytes(p.bytes as u64), p.front_bytes_psnr))
        .collect();
    let time = |p: &TradePoint, y: f64, front: bool| dot(p, p.cpu_ns, y, &format!("{:.0} ns", p.cpu_ns), front);
    let speed: Vec<Dot> = trade
        .points
        .iter()
        .filter(|p| p.interpolation == Rule::Fast)
        .map(|p| time(p, p.metrics.psnr_db, p.front_ns_psnr))
        .collect();
    let between: Vec<Dot> =
        trade.points.iter().filter_map(|p| Some(time(p, p.psnr_between_db?, p.front_ns_between))).collect();
    let gpu: Vec<Dot> = trade
        .points
        .iter()
        .filter(|p| p.interpolation == Rule::Fast)
        .filter_map(|p| {
            let ns = p.gpu_ns?;
            Some(dot(p, ns, p.metrics.psnr_db, &format!("{ns:.2} ns"), false))
        })
        .collect();
    let cpu_axis = "CPU time per evaluation in ns, one thread";
    let mut plots = vec![
        Plot {
            name: "bytes-psnr.svg",
            caption: "Size against accuracy at measured directions. The line joins what no other setting beats.".into(),
            picture: draw(&bytes, "size in kB", "PSNR in dB"),
        },
        Plot {
            name: "ns-psnr.svg",
            caption: "Speed against accuracy at measured directions: fast rule, both precisions.".into(),
            picture: draw(&speed, cpu_axis, "PSNR in dB"),
        },
    ];
    if !between.is_empty() {
        plots.push(Plot {
            name: "ns-between.svg",
            caption: "Speed against accuracy between measured directions: both rules, both precisions.".into(),
            picture: draw(&between, cpu_axis, "PSNR between in dB"),
        });
    }
    if !gpu.is_empty() {
        let (caption, axis) = if trade.gpu_is_software {
            (
                "The same shader on a software driver, which computes on the CPU: no figure of a GPU.",
                "software driver: time per evaluation in ns",
            )
        } else {
            ("Speed on the GPU against accuracy at measured directions: fast rule.", "GPU time per evaluation in ns")
        };
        let picture = draw(&gpu, axis, "PSNR in dB");
        plots.push(Plot { name: "gpu-psnr.svg", caption: caption.into(), picture });
    }
    plots
}

/// Returns the rate-distortion plots as SVG files, each as its name and content.
pub fn trade_plots(trade: &Trade) -> Vec<(&'static str, String)> {
    let files = plots(trade).into_iter().map(|plot| {
        let svg = plot.picture.into_string();
        (plot.name, svg.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1) + "\n")
    });
    files.collect()
}

fn table(trade: &Trade) -> Markup {
    let optional = |x: Option<f64>, decimals: usize| x.map_or("–".to_string(), |x| format!("{x:.decimals$}"));
    let gpu = if trade.gpu_is_software { "Software driver, ns" } else { "GPU, ns" };
    let heads = ["Lobes", "Bits", "Components", "Rule", "Bases", "Size", "In memory", "PSNR, dB", "Linear PSNR, dB"];
    let more = ["ΔE00", "PSNR between, dB", "CPU, ns", gpu, "Best in", "Options of fit"];
    html! {
        div.wide { table.figures {
            tr { @for head in heads.iter().chain(&more) { th { (head) } } }
            @for point in trade.summary.iter().map(|i| &trade.points[*i]) {
                @let metrics = point.all_pairs.as_ref().unwrap_or(&point.metrics);
                @let alone = point.limit == Limit::Lobes;
                tr {
                    td { (lobe_words(point)) }
                    td { (point.bits.map_or("–".into(), bits_text)) }
                    td { (component_words(point)) }
                    td { (if alone { "–" } else { rule_word(point.interpolation) }) }
                    td { (if alone { "–" } else { precision_word(point.precision) }) }
                    td { (text_from_bytes(point.bytes as u64)) }
                    td { (text_from_bytes(point.resident_bytes as u64)) }
                    td { (decibel_text(metrics.psnr_db)) }
                    td { (decibel_text(metrics.psnr_linear_db)) }
                    td { (optional(metrics.delta_e00_mean, 2)) }
                    td { (point.psnr_between_db.map_or("–".into(), decibel_text)) }
                    td { (format!("{:.0}", point.cpu_ns)) }
                    td { (optional(point.gpu_ns, if trade.gpu_is_software { 0 } else { 2 })) }
                    td {
                        @for (on, word) in [(point.front_bytes_psnr, "size"), (point.front_ns_psnr, "speed"), (point.front_ns_between, "between")] {
                            @if on { span.mark { (word) } " " }
                        }
                    }
                    td { code { (fit_options(trade, point)) } }
                }
            }
        } }
    }
}

/// Returns the options with which `btf-fit fit` makes about the file of `point`, and what of that file the row is.
fn fit_options(trade: &Trade, point: &TradePoint) -> String {
    let (components, part) = match point.limit {
        Limit::None => (String::new(), String::new()),
        Limit::Encode => (format!(" --components {}", point.components), String::new()),
        Limit::Decode => (String::new(), format!("; decoded with --components {}", point.components)),
        Limit::Lobes => (String::new(), "; its first tier".to_string()),
    };
    let lobes = match point.lobes {
        0 => "--lobes 0".to_string(),
        lobes => format!("--role {} --lobes {lobes}", role_word(point.role)),
    };
    let Trade { clusters, seed, .. } = trade;
    format!("{lobes} --clusters {clusters} --seed {seed}{components} --bytes {}{part}", point.file_bytes)
}

const MORE_STYLE: &str = "
.figures td, .figures th { padding: 4px 12px 4px 0; font-variant-numeric: tabular-nums; border-bottom: 1px solid #eef0f2; }
.figures { font-size: 13px; } .figures th { vertical-align: bottom; } .figures td { white-space: nowrap; } .wide { overflow-x: auto; }
.mark { background: #e3eff2; border-radius: 4px; padding: 1px 6px; font-size: 12px; white-space: nowrap; }
.row figcaption { max-width: 560px; } ul { margin: 0; padding-left: 20px; }
";

/// Returns the page: plots, the summary's table with errors over all pairs, and how everything was measured.
pub fn trade_html(trade: &Trade) -> String {
    let points = || trade.points.iter();
    let best = points().map(|p| p.metrics.psnr_db).fold(f64::NEG_INFINITY, f64::max);
    let fastest = points().filter(|p| p.limit == Limit::None).map(|p| p.cpu_ns).fold(f64::INFINITY, f64::min);
    let sizes = points().map(|p| p.bytes as u64);
    let (least, most) = (sizes.clone().min().unwrap_or(0), sizes.max().unwrap_or(0));
    let [width, height] = trade.size;
    let body = html! {
        header {
            h1 { (trade.capture) }
            p { "Speed against accuracy against size: " (width) " × " (height) " texels, " (trade.capture_pairs) " direction pairs, " (trade.clusters) " clusters" }
        }
        div.tiles {
            (tile("Settings", &trade.points.len().to_string(), "measured"))
            (tile("Sizes", &format!("{} to {}", text_from_bytes(least), text_from_bytes(most)), "smallest and largest file"))
            (tile("Best PSNR", &decibel_text(best), "8-bit values, dB"))
            (tile("Fastest", &format!("{fastest:.0} ns"), "per evaluation, all components"))
        }
        section {
            h2 { "The trade" }
            div.row {
                @for plot in plots(trade) {
                    figure { figcaption { (plot.caption) } (plot.picture) }
                }
            }
        }
        section {
            h2 { "What nothing beats" }
            p { "Up to eight settings of each front, their errors over all pairs." }
            (table(trade))
        }
        section {
            h2 { "What the names mean" }
            ul {
                li { b { "Lobes" } ": as " code { "--lobes" } " and " code { "--role" } " of " code { "fit" } ". As guide, each cluster has one set of at most so many lobes; the residual holds the whole value, and the lobes lead interpolation by the exact rule, sampling and editing. As base, each texel has at most so many of its own, and the residual is what they leave. Alone: the file's first tier, without residual." }
                li { b { "Bits" } ": the one step that quantises everything is the length of a texel's coefficients (root mean square over the texels) over two to this power. One more bit halves the error of rounding." }
                li { b { "Components" } " of the residual: all that are worth their bytes at this step; fewer in the file; or all in the file and fewer decoded." }
                li { b { "Rule" } ": how directions between measured ones are decoded, " code { "--interpolation" } "." }
                li { b { "Bases" } ": precision of the expanded bases in memory. Half is what decoders hold; single is there to tell what half costs." }
                li { b { "Options of fit" } ": with them, " code { "btf-fit fit CAPTURE -o ASSET.spmm" } " makes a file of at most this size and about this error; its step is searched for the size and lies between those that were swept over here. Behind a semicolon stands what of that file the row is: a tier, which other commands read from a file of that length, or a decoding with fewer components." }
                li { b { "Best in" } ": size, speed at measured directions, speed between them: no other setting has less of it at this accuracy." }
            }
        }
        section {
            h2 { "How it was measured" }
            ul {
                li { "Plots and the CSV's columns without " code { "all_" } ": " (trade.pairs) " of " (trade.capture_pairs) " pairs, evenly over all views and lights; all texels; the colour difference over at most eight of them. The table's are over all pairs." }
                li { "CPU ns: the resident decoder on one thread at " (trade.timing[0]) " random texels and directions, the same for all settings; the least of " (trade.timing[1]) " passes after one that is not counted. They depend on the machine: read them as ratios." }
                li { "GPU: " (trade.gpu) "." }
                li { "PSNR between: " (trade.between) "." }
                li { "Both rules decode measured directions alike, and neither rule nor precision changes the file: the front of size is of the fast rule in half precision." }
                li { "Components limited while decoding: the size is that of the file's tier with them, the memory that of the whole file, which a decoder has that turns components off; a file limited while encoding has both." }
                li { "Seed " (trade.seed) "." }
            }
        }
        footer { "Written by btf-fit " (env!("CARGO_PKG_VERSION")) ". PSNR is of 8-bit gamma-encoded values over texels, pairs and channels, peak 255, unless it says otherwise." }
    };
    page(&format!("{} – speed against accuracy", trade.capture), MORE_STYLE, &body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Metrics;

    fn point(lobes: usize, bytes: usize, psnr_db: f64, front: bool) -> TradePoint {
        let metrics = Metrics {
            psnr_db,
            psnr_linear_db: 40.0,
            rel_rmse: 0.1,
            worst_texel_rmse: 0.2,
            energy_ratio: 1.0,
            delta_e00_mean: Some(1.5),
            tone_curve: None,
        };
        TradePoint {
            lobes,
            role: Role::Guide,
            lobes_per_texel_mean: 0.0,
            lobes_per_cluster_mean: 1.25,
            bits: Some(3.5),
            bits_per_coefficient: Some(2.5),
            limit: Limit::Decode,
            components: 8,
            interpolation: Rule::Fast,
            precision: Precision::Half,
            bytes,
            file_bytes: 3 * bytes,
            resident_bytes: 2 * bytes,
            metrics,
            psnr_between_db: Some(psnr_db - 3.0),
            cpu_ns: 123.45,
            gpu_ns: None,
            front_bytes_psnr: front,
            front_ns_psnr: false,
            front_ns_between: false,
            all_pairs: front.then_some(metrics),
        }
    }

    fn sample() -> Trade {
        Trade {
            capture: "wool <1>".into(),
            size: [4, 3],
            capture_pairs: 36,
            pairs: 36,
            seed: 1,
            clusters: 2,
            timing: [100, 3],
            between: "nowhere".into(),
            gpu: "empty: no GPU".into(),
            gpu_is_software: false,
            points: vec![point(0, 1000, 30.0, true), point(2, 2000, f64::INFINITY, false)],
            summary: vec![0],
        }
    }

    #[test]
    fn every_row_has_every_column() {
        let text = trade_csv(&sample());
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.len(), 3);
        assert!(rows.iter().all(|row| row.len() == COLUMNS.len()));
        let value = |row: usize, column: &str| rows[row][COLUMNS.iter().position(|name| *name == column).unwrap()];
        assert_eq!(rows[0], COLUMNS);
        assert_eq!((value(1, "bytes"), value(1, "psnr_db"), value(1, "limit")), ("1000", "30.0000", "decode"));
        assert_eq!((value(1, "cpu_ns"), value(1, "gpu_ns"), value(1, "front_bytes_psnr")), ("123.5", "", "1"));
        assert_eq!((value(1, "all_psnr_db"), value(2, "all_psnr_db")), ("30.0000", ""));
        assert_eq!((value(2, "psnr_db"), value(2, "front_bytes_psnr")), ("inf", "0"));
        assert_eq!((value(2, "role"), value(2, "bits"), value(2, "gpu_kind")), ("guide", "3.500", ""));
        assert!(value(1, "fit").starts_with("--lobes 0 --clusters 2"), "{}", value(1, "fit"));
    }

    #[test]
    fn the_page_stands_alone_and_names_the_reason_of_an_empty_column() {
        let page = trade_html(&sample());
        for outside in ["http:", "https:", "src=\"/", "<link", "<script", "url(", "NaN"] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert!(page.contains("empty: no GPU") && page.contains("wool &lt;1&gt;"));
        assert_eq!(page.matches("<svg").count(), 3);
        // A row that is decoded with fewer components than its file has names the whole file.
        assert!(page.contains("--bytes 3000; decoded with --components 8</code>"));
        let mut whole = sample();
        (whole.points[0].limit, whole.points[0].lobes, whole.points[0].role) = (Limit::Encode, 2, Role::Base);
        let options = "--role base --lobes 2 --clusters 2 --seed 1 --components 8 --bytes 3000";
        assert!(trade_html(&whole).contains(&format!("<code>{options}</code>")));
        // The table has the summary's points alone.
        assert_eq!(page.matches("<td>no lobes").count(), 1);
        assert_eq!(page.matches("<td>2 lobes").count(), 0);
    }

    #[test]
    fn times_of_a_software_driver_are_never_told_as_those_of_a_gpu() {
        let mut trade = sample();
        trade.points[0].gpu_ns = Some(900.0);
        for (software, kind, axis) in [(true, "software", "software driver: time"), (false, "gpu", "GPU time")] {
            trade.gpu_is_software = software;
            assert!(trade_csv(&trade).lines().nth(1).unwrap().contains(&format!(",900.000,{kind},")));
            let page = trade_html(&trade);
            assert!(page.contains(axis) && page.contains("GPU, ns") != software);
            assert_eq!(trade_plots(&trade)[3].0, "gpu-psnr.svg");
        }
    }

    #[test]
    fn a_plot_as_a_file_is_an_svg_of_its_own() {
        let files = trade_plots(&sample());
        let names: Vec<&str> = files.iter().map(|file| file.0).collect();
        assert_eq!(names, ["bytes-psnr.svg", "ns-psnr.svg", "ns-between.svg"]);
        for (name, text) in files {
            assert!(text.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" ") && !text.contains("NaN"), "{name}");
        }
    }
}
